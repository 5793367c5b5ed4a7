//! From a coarse functional map to a dense one.

pub mod coinciding;
pub mod embedded_surface;
pub mod fingers;
pub mod overlap;
pub mod parts;
pub mod piece;
pub mod propagation;
pub mod regions;
pub mod relative_length;
pub mod settings;
pub mod side;
pub mod upsampling;
