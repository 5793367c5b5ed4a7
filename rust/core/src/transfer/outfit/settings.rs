//! What steers the fitting of garments.

/// Numbers of the method. Lengths are in heights of the body at which they lie; what was measured is 23 of 46 garments of
/// `MakeHuman` on other bodies, along maps found by this program, but for the two bodies with a cartoon's head.
#[derive(Debug, Clone, Copy)]
pub struct Settings {
    /// Places of the wrapped body, for narrow frames and for wide ones: one in 0.006 and in 0.015, so that the
    /// neighbours of a point reach as far as the width of its frame.
    pub samples: [usize; 2],
    /// Nearest places that make a frame: a disk of 0.027 of the many, of 0.07 of the few.
    pub neighbours: usize,
    /// A frame wider than this is made of the few places.
    pub wide: f64,
    /// Width σ of frames at the skin, two hundredths of a person: muscles and not wrinkles. Wider ones follow the body
    /// less well, narrower ones repeat the faults of the map.
    pub least_width: f64,
    /// Width for 1 of distance from the skin: what hangs loose turns with more of the body.
    pub width_by_distance: f64,
    /// Share of the trace of A that keeps J defined where the places lie on a line.
    pub frame_ridge: f64,
    /// Power of the confidence by which a place counts. With the second one stretches of cloth over a doubtful head are
    /// 1.45 instead of 1.54 apart, and nothing changes where the map is good.
    pub trust: i32,
    /// Confidence that every place has at least, so that a region of which nothing is known has a frame.
    pub least_trust: f64,
    /// Distance at which cloth takes 1/e of the relief of the skin under it; tight cloth takes all, loose none.
    pub relief_reach: f64,
    /// Rounds in which J is averaged along the garment's edges before edges follow it: 0.09 % of the edges are folded
    /// without, 0.08 % after five.
    pub smoothing: usize,
    /// Weight a of the place where a vertex on the skin would go for itself, beside 1 of each edge. With 3 the stretches of
    /// a triangle are 1.43 apart, with 0.7 1.38, with 0.3 1.36 and the cloth further from where it should be.
    pub hold: f64,
    /// Distance from the skin at which that weight is halved.
    pub hold_reach: f64,
    /// Rounds in which folds are let go, after which hardly one is left that can be.
    pub unfolding: usize,
    /// What is left of the weight of places around a fold.
    pub fold_hold: f64,
    /// Rounds of moving cloth out of the body. After three 0.17 % of the covered body shows, after five 0.04 %, after
    /// eight the same.
    pub rounds: usize,
    /// Weight of what has to leave the body or the layer below, beside 1 of each edge. With 10 there are more folds, with 2
    /// twice as much of the body shows.
    pub push: f64,
    /// Weight of staying, for each place: a push fades over 1/√0.02, seven edges.
    pub stay: f64,
    /// Weight of edges at folds, which go back to their shape while the cloth is moved out: 0.14 % of the edges are folded
    /// without it, 0.08 % with it.
    pub fold_push: f64,
    /// Distance to the body that everything keeps: a millimetre and a half, under which the skin shows between the vertices.
    /// With half of it 0.20 % of the body shows, with it 0.04 %.
    pub least_gap: f64,
    /// Distance up to which what was further out on the source stays further out, 7 mm: beyond, cloth is free.
    pub largest_gap: f64,
    /// Distance at which what was deep in the source is kept.
    pub lowest_gap: f64,
    /// Distance over which the source's distance turns into the one that is kept: layers that were inside the body one over
    /// the other leave it one over the other.
    pub gap_softness: f64,
    /// What is deeper in the body stays: hair roots and soles, and cloth that another limb has swallowed.
    pub deepest: f64,
    /// What lies below skin that faces the other way, and was further than this from there on the source, is not taken to be
    /// inside: toes that come out through their own sole. With it there are 0.15 % folds instead of 0.19 %.
    pub doubt: f64,
    /// Distance within which a place lies over a layer.
    pub layer_reach: f64,
    /// Cosine between the offset to a layer and its normal from which a place is over it and not beside it.
    pub layer_cosine: f64,
    /// Distance between layers up to which the source's is kept, two millimetres. Without contacts 94 to 98 % of the places
    /// of a suit keep their order, with them all.
    pub layer_gap: f64,
    /// Pieces smaller than this are stiff: buttons and buckles.
    pub stiff_size: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            samples: [16_000, 2_500],
            neighbours: 64,
            wide: 0.02,
            least_width: 0.012,
            width_by_distance: 0.5,
            frame_ridge: 1e-3,
            trust: 2,
            least_trust: 0.03,
            relief_reach: 0.04,
            smoothing: 5,
            hold: 0.7,
            hold_reach: 0.12,
            unfolding: 2,
            fold_hold: 0.05,
            rounds: 5,
            push: 4.0,
            stay: 0.02,
            fold_push: 4.0,
            least_gap: 0.0008,
            largest_gap: 0.004,
            lowest_gap: 0.0005,
            gap_softness: 0.0005,
            deepest: 0.03,
            doubt: 0.01,
            layer_reach: 0.01,
            layer_cosine: 0.7,
            layer_gap: 0.001,
            stiff_size: 0.03,
        }
    }
}

impl Settings {
    /// Distance to the target that is kept of what was so far from the source, negative within it, both in heights.
    ///
    /// It is l + ½(x + √(x² + 4s²)) with x = clearance − l: at least the lowest gap l, nearly the clearance above it, and
    /// everywhere more for what was further out, up to the largest gap.
    #[must_use]
    pub fn gap(&self, clearance: f64) -> f64 {
        let above = clearance - self.lowest_gap;
        let positive = 0.5 * (above + above.hypot(2.0 * self.gap_softness));
        (self.lowest_gap + positive).min(self.largest_gap)
    }

    /// Width of the frame of a place at a distance from the skin.
    #[must_use]
    pub fn width(&self, distance: f64) -> f64 {
        self.least_width.max(self.width_by_distance * distance)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_are_those_of_the_source_and_never_lose_their_order() {
        let settings = Settings::default();
        let gaps: Vec<f64> = (-200..50)
            .map(|i| settings.gap(f64::from(i) * 1e-4))
            .collect();
        assert!(
            gaps.windows(2)
                .all(|w| w[0] < w[1] || w[1] == settings.largest_gap)
        );
        assert!(gaps.iter().all(|&g| g > settings.lowest_gap));
        // s²/x more than the clearance, as the root's series says.
        assert!((settings.gap(0.003) - 0.003).abs() < 1.1 * 0.0005f64.powi(2) / 0.0025);
        assert_eq!(settings.gap(1.0), settings.largest_gap);
    }
}
