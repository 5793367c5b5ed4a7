//! From a coarse functional map to a dense one.

mod block_equations;
pub mod coinciding;
pub mod covered;
pub mod embedded_surface;
pub mod parts;
pub mod piecewise_affine;
pub mod propagation;
pub mod regions;
pub mod relative_length;
pub mod rigid_surface;
pub mod side;
pub mod upsampling;
