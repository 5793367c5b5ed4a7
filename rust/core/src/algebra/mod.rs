//! Dense and sparse linear algebra, vectors of three coordinates, and searches for what is nearest.
//!
//! Knows nothing of surfaces. Comes in: numbers and points. Goes out: products, factors, similarities, nearest rows.

pub mod closest;
pub mod conjugate_gradients;
pub mod dense;
pub mod numbering;
pub mod oriented_tree;
pub(crate) mod packed;
pub mod similarity;
pub mod space_tree;
pub mod sparse_factor;
pub mod stretch;
pub mod unions;
pub mod vector;
