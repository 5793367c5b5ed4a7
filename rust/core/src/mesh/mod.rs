//! Triangle meshes: from what was given to a checked surface of unit area, and what its triangles tell.
//!
//! Comes in: vertices `(n, 3)` and triangles `(m, 3)` of any kind. Goes out: a [`Mesh`], and of it boundaries, convexity,
//! weights of edges, finer meshes by [bisection] and coarser ones by [simplification].

pub mod bisection;
pub mod boundary;
pub mod convexity;
pub mod copies;
pub mod edge_weights;
mod intake;
pub mod numbering;
pub mod polygons;
pub mod settings;
pub mod simplification;
pub mod strays;
pub mod surface_point;
pub mod weld;

pub use intake::*;
