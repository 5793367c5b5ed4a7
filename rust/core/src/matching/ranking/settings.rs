//! Numbers that steer this stage, each with its reason.

use crate::settings::settings;

settings! {
    /// How far a map contradicts what is known: landmarks, a common frame, the symmetry of both shapes.
    CONTRADICTION: Contradiction {
        /// A landmark missed by a tenth of √area doubles the score.
        landmark_tolerance: f64 = 0.1,
        /// Half a turn about the height of a standing character then triples its rank.
        axes_weight: f64 = 4.0,
        /// A leg taken for the tail doubles the rank.
        symmetry_tolerance: f64 = 0.06,
    }

    /// Metrics by which a whole map is judged, from the images of some samples.
    METRICS: Metrics {
        /// Eigenfunctions of the orientation test at 60.
        orientation_functions: usize = 24,
        /// Weight of the orientation in the score and in the rank: a perfect one is 1.
        orientation_offset: (f64, f64) = (1.2, 2.0),
        /// What agreement of extrinsic looks leaves of the rank, squared: a perfect one is about 0.
        disagreement_offset: f64 = 1.05,
        /// Distortions that differ by less are equal: spectral distances are about 2 % off.
        distortion_noise: f64 = 2e-3,
        /// Added to the power of weighted curvatures: that of a sphere's sampling noise.
        curvature_floor: f64 = 1e-5,
        /// Distances below this are compared for the grade; long ones differ between right maps too.
        local: f64 = 0.35,
    }

    /// Which of the candidates is the map.
    RANKING: Ranking {
        /// Eigenfunctions of a candidate's map after its short refinement.
        refined_size: usize = 120,
        /// Candidates whose ranks differ by less than this fraction are told apart by their dense maps.
        close: f64 = 0.15,
        /// Maps whose images lie farther apart than this on average are not the same.
        another_map: f64 = 0.05,
        /// From here on curvatures of other maps count for the margin: a body turned front to back lies 0.3 to 0.6
        /// from the right map, what differs in a leg or in details less.
        turned: f64 = 0.2,
        /// Beyond this margin more says nothing.
        margin_at_most: f64 = 2.0,
    }

    /// How likely a map is right: coefficients of a logistic regression, of 173 right and 77 wrong maps
    /// (docs/decisions/076).
    EVIDENCE: Evidence {
        /// Of nothing else.
        constant: f64 = -7.7,
        /// Of the agreement of curvatures.
        agreement: f64 = 4.9,
        /// Of the orientation.
        orientation: f64 = 0.9,
        /// Of the logarithm of the mean change of short distances.
        distortion: f64 = -1.9,
        /// Of how clearly no other map fits as well, 0 to 1.
        clarity: f64 = 1.6,
        /// Where the map tears the surface.
        torn: f64 = -1.8,
    }

    /// A grade for a whole map, with its reasons in words.
    QUALITY: Quality {
        /// Orientation below which a map is doubtful, and from which it is clearly direct.
        orientation: (f64, f64) = (0.65, 0.75),
        /// Mean change of short distances up to which bodies are alike, and beyond which a map is doubtful.
        local_distortion: (f64, f64) = (0.035, 0.05),
        /// Mean change of short distances beyond which these do not tell which point is which: between game figures,
        /// at rest and in poses, right maps of a narrow search stay below 0.075, and 0.09 to 0.105 were all wrong.
        incomparable: f64 = 0.085,
        /// Orientation from which, and mean change of short distances up to which, a map without a rival needs no
        /// wider search: poses of one body have 0.75 and 0.02.
        clear: (f64, f64) = (0.7, 0.025),
        /// Mean change of short distances below which the second way of the refinement brings nothing: 55 such pairs
        /// have the same errors without it, 18 between 0.021 and 0.025 four per cent larger ones.
        isometric: f64 = 0.021,
        /// Score below which a map is graded red, as it is then more likely wrong than right, and from which it may be
        /// green: of 250 maps that the coefficients were fitted to none of 77 wrong ones has more than 0.935.
        score: (f64, f64) = (0.5, 0.95),
        /// Least margin of a green map: a body turned front to back may say all else as well as the right one, and
        /// between the equal maps of an ellipsoid it is 1.17.
        least_margin: f64 = 1.2,
        /// Margin at which another map is clearly better than the chosen one, and from which it is no rival.
        margin: (f64, f64) = (0.85, 1.35),
        /// Distance from the chosen map at which an alternative's score falls to 1/e.
        reach: f64 = 0.07,
        /// Agreement of curvatures from which shapes may be poses of one body: these have 0.7 to 0.9, other bodies
        /// 0.4 to 0.7.
        alike: f64 = 0.75,
        /// Agreement of curvatures below which shapes do not look alike.
        looks_alike: f64 = 0.6,
        /// From this gain on a mirrored map fits clearly better than the direct one.
        mirrored_gain: f64 = 1.5,
    }

    /// Candidates that take part in the vote: upsampled, scored, and different from one another.
    SHORTLIST: Shortlist {
        /// Candidates that are upsampled and scored.
        scored: usize = 12,
        /// Candidates that take part in the vote.
        shortlisted: usize = 8,
        /// Samples against which two candidates are told apart.
        witnesses: usize = 100,
        /// Candidates are different when the distances of their images differ by this on average, and finds of two
        /// searches when their images lie this far apart.
        different: f64 = 0.04,
        /// A candidate at 24 eigenfunctions counts as mirrored below this orientation.
        mirrored: f64 = -0.1,
        /// A candidate at 60 eigenfunctions takes part in the vote from this orientation on.
        oriented: f64 = 0.15,
    }
}
