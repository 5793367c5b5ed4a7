//! Consecutive eigenvalues of a spectrum.

use std::ops::Range;

use crate::spectrum::settings::SLICE;

/// The same in the midst of the spectrum, for twice as many pairs as lie on that side of the shift where there are more.
const INNER: [usize; 2] = [192, 58];

/// Consecutive eigenvalues; zero is not counted. Two slices meet at the first gap from their border on, so that both mean the
/// same.
pub(super) struct Slice {
    /// Eigenvalues below the slice.
    pub(super) first: usize,
    /// Eigenvalues below its end.
    pub(super) end: usize,
    /// Whether another begins there.
    pub(super) is_followed: bool,
}

impl Slice {
    /// So many eigenvalues above zero.
    pub(super) fn lowest(count: usize) -> Self {
        Self {
            first: 0,
            end: count,
            is_followed: false,
        }
    }

    /// Where it is in a spectrum of which its first eigenvalue and that after its last have these places; none where that
    /// ends before.
    pub(super) fn within(
        &self,
        spectrum: &[f64],
        [first, end]: [usize; 2],
    ) -> Option<Range<usize>> {
        let first = match self.first {
            0 => first,
            _ => gaps(spectrum, first).next()?,
        };
        let end = if self.is_followed {
            gaps(spectrum, end).next()?
        } else {
            end
        };
        (first < end && end <= spectrum.len()).then_some(first..end)
    }

    /// How many eigenvalues it has.
    pub(super) fn count(&self) -> usize {
        self.end - self.first
    }

    /// Size of the space at which convergence is first looked at, if so many eigenvalues are below its shift.
    pub(super) fn expected_size(&self, below: usize) -> usize {
        let (pairs, [per_hundred, least]) = if self.first == 0 {
            (self.count(), SLICE.lowest)
        } else {
            let [before, after] = [
                below.saturating_sub(self.first),
                self.end.saturating_sub(below),
            ];
            (2 * before.max(after), INNER)
        };
        pairs * per_hundred / 100 + least
    }
}

/// Places from one on whose eigenvalue is told apart from that before it.
pub(super) fn gaps(spectrum: &[f64], from: usize) -> impl Iterator<Item = usize> {
    let apart =
        |&place: &usize| spectrum[place] - spectrum[place - 1] > SLICE.gap * spectrum[place];
    (from.max(1)..spectrum.len()).filter(apart)
}
