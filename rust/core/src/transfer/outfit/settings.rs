//! What steers the fitting of garments.

use crate::settings::settings;

settings! {
    /// Numbers of the method. Lengths are in heights of the body at which they lie; what was measured is 23 of 46
    /// garments of `MakeHuman` on other bodies, along maps found by this program, but for the two bodies with a
    /// cartoon's head.
    FITTING: Settings {
        /// Places of the wrapped body, for narrow frames and for wide ones: one in 0.006 and in 0.015, so that the
        /// neighbours of a point reach as far as the width of its frame.
        samples: [usize; 2] = [16_000, 2_500],
        /// Nearest places that make a frame: a disk of 0.027 of the many, of 0.07 of the few.
        neighbours: usize = 64,
        /// A frame wider than this is made of the few places.
        wide: f64 = 0.02,
        /// Width σ of frames at the skin, two hundredths of a person: muscles and not wrinkles. Wider ones follow the
        /// body less well, narrower ones repeat the faults of the map.
        least_width: f64 = 0.012,
        /// Width for 1 of distance from the skin: what hangs loose turns with more of the body.
        width_by_distance: f64 = 0.5,
        /// Share of the trace of A that keeps J defined where the places lie on a line.
        frame_ridge: f64 = 1e-3,
        /// Power of the confidence by which a place counts. With the second one stretches of cloth over a doubtful head
        /// are 1.45 instead of 1.54 apart, and nothing changes where the map is good.
        trust: i32 = 2,
        /// Confidence that every place has at least, so that a region of which nothing is known has a frame.
        least_trust: f64 = 0.03,
        /// Distance at which cloth takes 1/e of the relief of the skin under it; tight cloth takes all, loose none.
        relief_reach: f64 = 0.04,
        /// Rounds in which J is averaged along the garment's edges before edges follow it: 0.09 % of the edges are
        /// folded without, 0.08 % after five.
        smoothing: usize = 5,
        /// Weight a of the place where a vertex on the skin would go for itself, beside 1 of each edge. With 3 the
        /// stretches of a triangle are 1.43 apart, with 0.7 1.38, with 0.3 1.36 and the cloth further from where it
        /// should be.
        hold: f64 = 0.7,
        /// Distance from the skin at which that weight is halved.
        hold_reach: f64 = 0.12,
        /// Rounds in which folds are let go, after which hardly one is left that can be.
        unfolding: usize = 2,
        /// What is left of the weight of places around a fold.
        fold_hold: f64 = 0.05,
        /// Rounds of moving cloth out of the body. After three 0.17 % of the covered body shows, after five 0.04 %,
        /// after eight the same.
        rounds: usize = 5,
        /// Weight of what has to leave the body or the layer below, beside 1 of each edge. With 10 there are more
        /// folds, with 2 twice as much of the body shows.
        push: f64 = 4.0,
        /// Weight of staying, for each place: a push fades over 1/√0.02, seven edges.
        stay: f64 = 0.02,
        /// Weight of edges at folds, which go back to their shape while the cloth is moved out: 0.14 % of the edges are
        /// folded without it, 0.08 % with it.
        fold_push: f64 = 4.0,
        /// Distance to the body that everything keeps: a millimetre and a half, under which the skin shows between the
        /// vertices. With half of it 0.20 % of the body shows, with it 0.04 %.
        least_gap: f64 = 0.0008,
        /// Distance up to which what was further out on the source stays further out, 7 mm: beyond, cloth is free.
        largest_gap: f64 = 0.004,
        /// Distance at which what was deep in the source is kept.
        lowest_gap: f64 = 0.0005,
        /// Distance over which the source's distance turns into the one that is kept: layers that were inside the body
        /// one over the other leave it one over the other.
        gap_softness: f64 = 0.0005,
        /// What is deeper in the body stays: hair roots and soles, and cloth that another limb has swallowed.
        deepest: f64 = 0.03,
        /// What lies below skin that faces the other way, and was further than this from there on the source, is not
        /// taken to be inside: toes that come out through their own sole. With it there are 0.15 % folds instead of
        /// 0.19 %.
        doubt: f64 = 0.01,
        /// Distance within which a place lies over a layer.
        layer_reach: f64 = 0.01,
        /// Cosine between the offset to a layer and its normal from which a place is over it and not beside it.
        layer_cosine: f64 = 0.7,
        /// Distance between layers up to which the source's is kept, two millimetres. Without contacts 94 to 98 % of
        /// the places of a suit keep their order, with them all.
        layer_gap: f64 = 0.001,
        /// Pieces smaller than this are stiff: buttons and buckles.
        stiff_size: f64 = 0.03,
    }
}

impl Settings {
    /// Distance to the target that is kept of what was so far from the source, negative within it, both in heights.
    ///
    /// It is l + ½(x + √(x² + 4s²)) with x = clearance − l: at least the lowest gap l, nearly the clearance above it,
    /// and everywhere more for what was further out, up to the largest gap.
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
