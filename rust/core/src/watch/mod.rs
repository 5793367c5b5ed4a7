//! How a long computation is followed and stopped.

pub mod progress;
