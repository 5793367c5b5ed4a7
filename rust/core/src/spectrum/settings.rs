//! Numbers that steer this stage, each with its reason.

use crate::settings::settings;

settings! {
    /// Block Lanczos for the eigenpairs of `M = A^{1/2}(W − sA)⁻¹A^{1/2}` far from zero.
    LANCZOS: Lanczos {
        /// Times that the first block is multiplied by `M` before the space begins. Each brings convergence as much
        /// nearer as one more block of the space would, of which nothing is made orthogonal; from six on, less and
        /// less.
        multiplied_first: usize = 4,
        /// Where it grows by more than this from block to block, none waits. On 26 meshes it grows by 3e2 to 4e4 (in
        /// blocks of eight); with the shift moved towards an eigenvalue, pairs of blocks leave `ΦᵀAΦ = I` to 3e-14 at
        /// 5e4, to 1e-11 at 5e5, and fail at 5e7.
        most_growth: f64 = 1e5,
        /// Gaps between the eigenvalues wanted and the rest at which a factor is tried.
        gaps_tried: usize = 4,
        /// The iteration gives up at this multiple of the size expected.
        patience: usize = 3,
        /// Below this fraction of a block's length before orthogonalisation, what is left of it needs a second pass
        /// against the basis.
        cancellation: f64 = 1e-4,
    }

    /// Smallest eigenpairs of the Laplace–Beltrami operator: `W φ = λ A φ`.
    EIGENBASIS: Eigenbasis {
        /// Bound on `‖Wφ − λAφ‖` in the `A⁻¹` norm, as a fraction of the largest eigenvalue asked for.
        residual_bound: f64 = 1e-8,
        /// The iteration stops at this fraction of the bound; the rest is for rounding in the check.
        safety: f64 = 0.25,
        /// Single vertices relaxed at most for a pair whose residual is rounding at tiny vertices, for each vertex.
        relaxations: usize = 100,
        /// Times at most that pairs which miss the bound are corrected. Once was enough for every pair seen.
        corrections: usize = 3,
        /// A vertex is tiny where its stiffness is more than this many times its mass times the eigenvalue: the
        /// pair's equation there says what its value is, given those around it.
        stiff: f64 = 1e3,
        /// Meshes with fewer vertices than this many per vector of the first space are solved densely.
        dense_ratio: usize = 2,
        /// Eigenvalues among which repeated ones are counted.
        looked_at: usize = 24,
        /// Neighbouring eigenvalues nearer than this share of their mean distance, λ/i by Weyl's law, are one that is
        /// repeated: prisms have 10 pairs of 12, of 81 bodies, animals and characters none has one.
        repeated: f64 = 0.01,
    }

    /// Factors of `W − sA` and solves with them, in the factor's own ordering.
    SHIFTED_FACTOR: ShiftedFactor {
        /// Largest relative error of a solve that is still taken for a sound factor.
        solve_accuracy: f64 = 1e-7,
    }

    /// Consecutive eigenvalues of a spectrum.
    SLICE: Slice {
        /// Size of the space needed for a hundred pairs more, and for none: measured at 12 to 300 pairs of 37 meshes,
        /// enough for nine in ten. Two blocks too many cost less than to look again.
        lowest: [usize; 2] = [160, 32],
        /// Eigenvalues farther apart than this, relatively, are told apart, by a factor whose shift lies between
        /// them.
        gap: f64 = 1e-6,
    }

    /// The lowest eigenpairs in slices of the spectrum, each from a Krylov space of its own.
    SLICES: Slices {
        /// Fewer eigenpairs are found in one slice: two would take more solves than they save elsewhere. A shape has
        /// 150, and two shapes are mostly prepared side by side, so that no core is left for a second slice.
        least_sliced: usize = 180,
        /// The shift of one slice lies where this fraction of the wanted eigenvalues is below it. Krylov spaces then
        /// find both ends equally late, at 5k vertices and k = 200 with 400 vectors instead of 600 for a shift below
        /// the spectrum.
        shift: f64 = 0.62,
        /// Those of two slices, which meet midway: their spaces are then of one size.
        shifts: [f64; 2] = [0.37, 0.81],
        /// How far from its place, in fractions of the wanted eigenvalues, the shift of one slice may end: farther
        /// off, a second factor costs less than a larger space.
        tolerance: f64 = 0.08,
        /// The same for the shift of one of two slices, which matters more.
        tolerance_of_two: f64 = 0.03,
        /// How far it may end at least, in eigenvalues.
        least_tolerance: f64 = 2.0,
        /// How many more eigenvalues there are below a shift than Weyl's law says: some low ones of long limbs. Mean
        /// of 37 meshes, bodies above all.
        more_low: f64 = 2.0,
        /// How many more there are, times the square of their number over that of the vertices: eigenvalues are
        /// smaller on a mesh. Mean of the same meshes.
        more_high: f64 = 1.0,
        /// Factorisations tried to place the shift.
        trials: usize = 6,
        /// A shift whose factor is inaccurate is replaced by this multiple.
        step_aside: f64 = 0.97,
        /// A shift that is nearer to an eigenvalue than this fraction of their spacing is moved: rounding grows with
        /// the largest eigenvalue of the inverse, and one of 160 poses of people missed the bound on residuals.
        too_near: f64 = 0.01,
        /// By how much of the spacing it is moved.
        aside: f64 = 0.3,
        /// Eigenvectors of two slices meet at the residual over the distance of their eigenvalues. Where that is more
        /// than this, removing it leaves those of one slice not orthogonal to each other, and they are made so
        /// again.
        small_overlap: f64 = 1e-7,
        /// Where it is more than this, both have the same eigenvector, or the border falls among copies of an
        /// eigenvalue.
        most_overlap: f64 = 1e-2,
    }

    /// Edge lengths instead of positions: a triangulation that is Delaunay and has no flat triangle.
    INTRINSIC_TRIANGULATION: IntrinsicTriangulation {
        /// Every triangle inequality holds by at least this fraction of the mean edge. As in the paper.
        mollification: f64 = 1e-5,
        /// An edge is flipped when the sum of the opposite cotangents is below minus this: less is rounding of
        /// cotangents near one, and four points on a circle would be flipped for ever.
        delaunay_tolerance: f64 = 1e-9,
        /// Flips allowed for each triangle. Meshes need about one at most; needles across a whole mesh need as many
        /// as the edges that they cross.
        flips_a_face: usize = 200,
    }
}
