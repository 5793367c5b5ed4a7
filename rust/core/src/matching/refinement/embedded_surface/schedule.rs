//! Which vertices take part in a refinement, and its numbers of eigenfunctions.

/// Which vertices take part in the fits, and for which numbers of eigenfunctions.
#[derive(Debug, Clone, Copy)]
pub struct Schedule {
    /// Whether two ways climb first.
    pub two_ways: bool,
    /// Eigenfunctions to which surfaces are low-passed at least.
    pub detail: usize,
    /// Numbers of eigenfunctions, one a step.
    pub sizes: &'static [usize],
    /// Numbers of eigenfunctions of the steps on the whole surface afterwards.
    pub rigid_sizes: &'static [usize],
    /// Only this many vertices of each shape ask, all when `None`.
    pub drawn: Option<usize>,
}

/// What surfaces are low-passed to at least, so that a limb is no line, which has no sides. The first way's
/// climb keeps a gorilla's leg from being twisted by doing without.
pub(super) const DETAIL: usize = 100;

/// The full schedule: two ways, 60 to 150 eigenfunctions in equal ratios, then on the whole surface.
pub const FULL: Schedule = Schedule {
    two_ways: true,
    detail: DETAIL,
    sizes: &[60, 75, 95, 120, 150],
    rigid_sizes: &[80, 120, 150, 150],
    drawn: None,
};

/// Of a map that keeps distances: a second way would find nothing better, and the second climb and the steps on the
/// whole surface have less to do.
pub const ISOMETRIC: Schedule = Schedule {
    two_ways: false,
    sizes: &[80, 110, 150],
    rigid_sizes: &[150, 150],
    ..FULL
};

/// The short one, by which candidates are compared.
pub const SHORT: Schedule = Schedule {
    two_ways: false,
    detail: 0,
    sizes: &[60, 76, 95, 120, 120],
    rigid_sizes: &[],
    drawn: Some(800),
};

/// The one by which first maps of a part are compared, of some twenty eigenfunctions and lengths that are known.
pub const OF_PART: Schedule = Schedule {
    sizes: &[20, 25, 32, 40, 50, 60, 76, 95, 120],
    ..SHORT
};
