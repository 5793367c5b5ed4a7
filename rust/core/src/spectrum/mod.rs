//! The Laplace–Beltrami operator and its eigenpairs: W φ = λ A φ.
//!
//! Comes in: a [mesh](crate::mesh::Mesh). Goes out: cotangent stiffness W and Voronoi mass A, where needed of another
//! triangulation of the same surface, and the eigenpairs of lowest frequency with `Φᵀ A Φ = I`.

pub mod eigenbasis;
pub mod intrinsic_triangulation;
pub mod laplacian;
pub mod settings;
