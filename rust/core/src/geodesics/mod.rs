//! Geodesic distances from vertices or points, and samples spread evenly by them.
//!
//! All distances are in the unit of the mesh's coordinates (unit-area lengths for a [`Mesh`]), and
//! in single precision: their discretisation error is far above its rounding.
//!
//! [`Mesh`]: crate::mesh::Mesh

pub mod distance_operator;
mod distances;
mod farthest_points;
mod fast_marching;
mod front_queue;
pub mod metric;
pub mod settings;

pub use distances::{distances_from, distances_within};
pub use farthest_points::farthest_points;
pub use fast_marching::{FastMarching, Seed, Workspace};
