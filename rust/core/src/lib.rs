//! Spectral generalised multidimensional scaling (S-GMDS): dense maps between deformable surfaces.

pub mod eigenbasis;
pub mod error;
pub mod geodesics;
pub mod laplacian;
pub mod mesh;
pub mod vector;
