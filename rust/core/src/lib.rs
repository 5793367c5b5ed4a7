//! Spectral generalised multidimensional scaling (S-GMDS): dense maps between deformable surfaces.

pub mod error;
pub mod mesh;
pub mod vector;
