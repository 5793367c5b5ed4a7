//! Numbers that steer this stage, each with its reason.

use crate::settings::settings;

settings! {
    /// A map between the low ends of two spectra: fitted to point maps, and judged by those it gives.
    CANDIDATE: Candidate {
        /// Tikhonov weight of a fit, per sample.
        fit_ridge: f64 = 1e-3,
        /// Eigenfunctions whose bivectors tell direct from mirrored maps.
        orientation_functions: usize = 8,
        /// Below this size the orientation of a right map is as good as random.
        oriented_from: usize = 15,
        /// A map's energy is weighted by this less its orientation.
        orientation_offset: f64 = 1.2,
    }

    /// Initial maps: a beam search over sign patterns, scored by geodesic distortion.
    SEARCH: Search {
        /// Maps closer than this, as a mean geodesic distance at unit area, lie in one basin.
        basin: f64 = 0.08,
        /// Ratio of neighbouring eigenvalues below which their functions may come mixed.
        nearly_double: f64 = 1.15,
        /// Number of eigenfunctions from which on maps are also tried with their front and back turned.
        turned_from: usize = 12,
        /// In every so many of the steps from there on they are.
        turned_every: usize = 4,
        /// Maps closer than this are the same.
        same: f64 = 0.03,
        /// Mean distance between points and their images from which a map of a shape to itself is none but for
        /// details: a person turned front to back lies 0.43 to 0.53 off.
        away: f64 = 0.4,
    }

    /// One shape's samples, and what it costs to answer on them.
    SAMPLED: Sampled {
        /// Weight of the descriptors beside the eigenfunctions.
        descriptor_weight: f32 = 0.7,
        /// Weight of the distance from the own mirror image beside the eigenfunctions: 6 to 12 do the same.
        offset_weight: f32 = 8.0,
    }

    /// Where the search starts: sign patterns of the first eigenfunctions, and of the coordinates of a scaling.
    SEEDS: Seeds {
        /// Eigenfunctions of the seeds.
        seed_size: usize = 7,
        /// Sign and order patterns kept of all that are tried.
        sign_seeds: usize = 48,
        /// Coordinates of the spectral multidimensional scaling.
        scaling_dims: usize = 5,
        /// Eigenfunctions from which those coordinates are taken.
        scaling_functions: usize = 30,
    }
}
