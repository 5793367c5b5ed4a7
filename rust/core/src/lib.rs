//! Spectral generalised multidimensional scaling (S-GMDS): dense maps between deformable surfaces.
//!
//! The rooms of this crate stand in the order in which data flow; each imports only rooms above it.
//!
//! | room | what comes out of it |
//! |---|---|
//! | [`error`], [`watch`] | what can go wrong; how a computation is followed and stopped |
//! | [`algebra`] | dense and sparse linear algebra, nearest rows |
//! | [`mesh`] | a checked triangle mesh at unit area |
//! | [`envelope`] | one closed surface around a figure of many pieces |
//! | [`spectrum`] | eigenpairs of the Laplace–Beltrami operator, W φ = λ A φ |
//! | [`geodesics`] | distances by fast marching, and the operator α with D ≈ Φ α Φᵀ |
//! | [`deformation`] | how a surface bends when it is drawn onto another |
//! | [`shape`] | all that hangs on one surface, prepared once |
//! | [`baselines`] | the published method and those that it is compared with |
//! | [`matching`] | the map between two shapes, its confidence and its grade |
//! | [`transfer`] | data carried along a map |
//! | [`figure`] | characters of many pieces, welded and matched by their envelopes where need be |
//!
//! ```
//! use std::sync::Arc;
//!
//! use sgmds_core::{Options, Shape, match_shapes};
//! use sgmds_core::watch::progress::Progress;
//!
//! # fn main() -> sgmds_core::Result<()> {
//! // A torus of 24 by 12 vertices, with a thick and a thin side.
//! let at = |i: u32, j: u32| i64::from((i % 24) * 12 + j % 12);
//! let (mut vertices, mut faces) = (Vec::new(), Vec::new());
//! for i in 0..24 {
//!     for j in 0..12 {
//!         let (u, v) = (f64::from(i) * 0.2618, f64::from(j) * 0.5236);
//!         let (tube, turn) = (0.3 + 0.1 * u.cos(), 0.4 * (2.0 * u).sin());
//!         let ring = 1.0 + tube * v.cos();
//!         vertices.push([ring * u.cos(), ring * u.sin(), tube * v.sin() + turn]);
//!         faces.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
//!         faces.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
//!     }
//! }
//! let progress = Progress::default();
//! let unheard = |_, _| Ok(());
//! let source = Arc::new(Shape::new(&vertices, &faces, &progress, &unheard)?);
//! let target = Arc::new(Shape::new(&vertices, &faces, &progress, &unheard)?);
//! let map = match_shapes(&source, &target, &Options::default(), &progress, &unheard)?;
//! // Each vertex of the target has a triangle of the source and weights of its corners.
//! assert_eq!(map.faces.len(), vertices.len());
//! # Ok(())
//! # }
//! ```
#![forbid(unsafe_code)]

pub mod error;
pub mod settings;
pub mod watch;

pub mod algebra;
pub mod mesh;

pub mod envelope;

pub mod spectrum;

pub mod geodesics;

pub mod deformation;

pub mod shape;

pub mod baselines;

pub mod matching;

pub mod transfer;

pub mod figure;

pub mod memory;
#[cfg(test)]
mod testing;

pub use error::{Error, Result};
pub use matching::{Correspondence, Options, match_shapes};
pub use shape::Shape;
