//! From a coarse functional map to a dense one.

pub mod coinciding;
pub mod covered;
pub mod embedded_surface;
pub mod fingers;
pub mod parts;
pub mod propagation;
pub mod regions;
pub mod relative_length;
pub mod side;
pub mod upsampling;
