//! Numbers that steer this stage, each with its reason.

use crate::settings::settings;

settings! {
    /// What the user knows of the map: pairs of points, and that both shapes stand in one frame.
    CONSTRAINTS: Constraints {
        /// Reach of a landmark in the search, at unit area: about a limb.
        search_reach: f64 = 0.4,
        /// Weight of a landmark in the search beside eigenfunctions and descriptors.
        search_weight: f64 = 2.0,
        /// Reach of a landmark in the refinement, where it only has to draw its neighbourhood along.
        refinement_reach: f64 = 0.1,
        /// Weight of the coordinates in the search when both shapes stand in one frame.
        axes_weight: f64 = 2.0,
    }
}
