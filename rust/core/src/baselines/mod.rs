//! Small, honest versions of the methods that S-GMDS starts from and is compared with.
//!
//! Each gives two embeddings in which matched points lie together; the rest of the chain, from
//! nearest neighbours to barycentric weights, is the same for all methods.

pub mod functional_map;
pub mod gmds;
pub mod settings;
pub mod spectral_gmds;

use crate::algebra::dense::Rows;

/// Both shapes in one space, and how the method got there.
#[derive(Debug)]
pub struct Embedding {
    /// A row for each target vertex.
    pub target: Rows,
    /// A row for each source vertex.
    pub source: Rows,
    /// How the minimisation ended.
    pub convergence: Convergence,
}

/// How a minimisation ended.
#[derive(Debug, Clone, Copy)]
pub struct Convergence {
    /// Final value of what was minimised.
    pub energy: f64,
    /// Norm of its gradient over the unknowns, where it has one.
    pub gradient_norm: Option<f64>,
    /// Steps taken.
    pub steps: usize,
    /// Whether it came to rest.
    pub converged: bool,
}
