//! From a coarse functional map to a dense one.

pub mod embedded_surface;
pub mod propagation;
pub mod upsampling;
