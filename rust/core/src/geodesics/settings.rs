//! Numbers that steer this stage, each with its reason.

use crate::settings::settings;

settings! {
    /// Geodesic distances in the eigenbasis: α with D ≈ Φ α Φᵀ.
    DISTANCE_OPERATOR: DistanceOperator {
        /// Weight of the Dirichlet term against the data when whole distance fields are known: ten times more or less
        /// changes the reconstruction error in its third digit only.
        dirichlet_weight: f64 = 1e-3,
        /// Data penalty μ of the interpolation from samples alone: 10² smooths distances away, 10⁶ rings when there
        /// are hardly more samples than eigenfunctions.
        data_penalty: f64 = 1e4,
    }

    /// Distances from many sources at once: they are swept over the vertices in the order of another source's march.
    SWEEP: Sweep {
        /// Each source is marched so far towards the source whose march gives the order; beyond, fronts of both run
        /// alike.
        marched: f32 = 0.5,
        /// The first vertices of the order are swept until nothing changes, then twice as many, and so on: an eighth
        /// first. What comes late near the sources would run through everything again.
        doublings: usize = 3,
        /// What a vertex gains is told to its neighbours above this fraction of the mean edge, well below the error
        /// of discretisation, or above this fraction of the distance, single precision's rounding.
        least_gain: (f32, f32) = (5e-3, 2e-6),
    }

    /// Update across triangles: what the ends of a block of spokes get from the vertex that is passed.
    UPDATE: Update {
        /// A vertex that was already passed is opened again only for a gain above this fraction of the edge it came
        /// by: below, the change is smaller than the discretisation error by far.
        least_gain_of_edge: f32 = 1e-4,
        /// The same as a fraction of the distance, above single precision's rounding.
        least_gain_of_distance: f32 = 2e-6,
        /// A ray may miss the edge it should cross by this fraction of the edge, so that rays along mesh lines
        /// through a vertex do not fall between its edges by rounding.
        crossing_slack: f32 = 1e-3,
        /// Circles around the ends of an edge that miss each other by at most this fraction of the edge count as
        /// touching.
        touching_slack: f32 = 1e-4,
    }

    /// Which lengths a surface has: those in space, or those that no local scaling changes.
    METRIC: Metric {
        /// Time of the diffusion that smooths the Gaussian curvature before it is used; unit area.
        curvature_heat_time: f64 = 3e-4,
        /// |K| is replaced by √(K² + this²); unit area.
        curvature_floor: f64 = 5.0,
    }
}
