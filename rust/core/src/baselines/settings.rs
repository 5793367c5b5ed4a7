//! Numbers that steer this stage, each with its reason.

use crate::settings::settings;

settings! {
    /// Functional map from descriptors alone.
    FUNCTIONAL_MAP: FunctionalMap {
        /// Eigenfunctions of the map.
        size: usize = 50,
        /// Weight of commutativity against the descriptors, each of unit norm, with eigenvalues relative to the
        /// largest.
        commutativity: f64 = 1.0,
        /// Keeps the descriptors' Gram matrix invertible for pairs of equal eigenvalues.
        ridge: f64 = 1e-6,
        /// Most steps of the refinement.
        steps: usize = 20,
        /// The refinement rests when at most one in so many images changes.
        unchanged_share: usize = 100,
        /// Target vertices that ask in a step.
        asking: usize = 2000,
    }

    /// Generalised multidimensional scaling of sampled points, in the vertex domain.
    GMDS: Gmds {
        /// Samples of the levels, coarse to fine.
        levels: [usize; 4] = [10, 20, 40, 80],
        /// Partial placements kept while the coarsest level is started.
        placements: usize = 1000,
        /// Starts that are minimised on the coarsest level.
        starts: usize = 8,
        /// Starts are different when their images are this far apart on average.
        different: f64 = 0.1,
        /// Most sweeps over the samples of a level.
        sweeps: usize = 20,
        /// A sweep that lowers the stress by less than this fraction is the last.
        decrease_bound: f64 = 1e-3,
    }

    /// The paper's objective: S-GMDS energy, its constraints and its minimisation.
    SPECTRAL_GMDS: SpectralGmds {
        /// Most steps of the minimisation.
        steps: usize = 200,
        /// Pairs of steps and gradient changes remembered.
        memory: usize = 10,
        /// Gradient norm, relative to 1 + energy, at which a minimum is reached.
        gradient_bound: f64 = 1e-6,
        /// Relative decrease below which nothing more is to be gained.
        decrease_bound: f64 = 1e-10,
        /// Share of the slope by which a step has to lower the energy (Armijo); the usual one.
        sufficient: f64 = 1e-4,
        /// Times that a step is halved at most.
        halvings: usize = 30,
    }
}
