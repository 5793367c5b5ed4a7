//! Numbers that steer this stage, each with its reason.

use crate::settings::settings;

settings! {
    /// How far to trust each vertex of a map.
    CONFIDENCE: Confidence {
        /// Samples whose distances are compared: with 200 wrong places are told as well.
        witnesses: usize = 80,
        /// Distance at unit area from which on a sample says nothing; its weight (1 − d²/h²)⁴ has fallen to 1/e at
        /// half of that. With 0.6 wrong places between animals and humans are told better, those of poses worse.
        horizon: f32 = 0.4,
        /// Distances are compared up to this one, since the weight has fallen to 1/100 there.
        compared: f32 = 0.33,
        /// Keeps the weights' sum above zero.
        weight_floor: f32 = 1e-6,
        /// Doubt at which confidence falls to 1/e: half of it is left at 0.067, which separates best the vertices of
        /// a whole that a part lacks from the others.
        tolerated: f64 = 0.08,
        /// Weight of the gap between a vertex of the drawn target and its image.
        gap_weight: f64 = 2.0,
    }

    /// A dense map in given numbering, from matched embeddings.
    CORRESPONDENCE: Correspondence {
        /// Columns of the functional map that is handed out.
        functional_map_size: usize = 60,
        /// Ridge of that map's fit.
        functional_map_ridge: f64 = 1e-3,
    }
}
