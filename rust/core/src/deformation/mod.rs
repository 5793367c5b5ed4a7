//! How a surface deforms when it is drawn onto another.

mod block_equations;
pub mod piecewise_affine;
pub mod registration;
pub mod rigid_surface;
pub mod settings;
