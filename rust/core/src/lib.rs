//! Spectral generalised multidimensional scaling (S-GMDS): dense maps between deformable surfaces.
#![forbid(unsafe_code)]

pub mod baselines;
pub mod bisection;
pub mod bulging;
pub mod closest;
pub mod confidence;
pub mod deformation;
pub mod dense;
pub mod descriptors;
pub mod distance_operator;
pub mod edge_weights;
pub mod eigenbasis;
pub mod error;
pub mod full_resolution;
pub mod geodesics;
pub mod hints;
pub mod intrinsic_triangulation;
pub mod laplacian;
pub mod map_search;
pub mod matching;
pub mod memory;
pub mod mesh;
pub mod metric;
pub mod nearest;
pub mod orientation;
mod packed;
pub mod pair;
mod part_relocation;
mod part_search;
pub mod pointwise_map;
pub mod progress;
pub mod protrusions;
pub mod quality;
pub mod refinement;
pub mod rims;
pub mod selection;
pub mod shape;
pub mod similarity;
pub mod simplification;
pub mod space_tree;
pub mod sparse_factor;
pub mod spectral_gmds;
pub mod symmetry;
#[cfg(test)]
mod testing;
pub mod transfer;
pub mod vector;

pub use error::{Error, Result};
