//! A grade for a whole map, with its reasons in words.

use crate::map_search::Shares;
use crate::selection::Figures;

/// How far a map can be trusted as a whole.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Grade {
    /// Use it.
    Green,
    /// Look at it first.
    Amber,
    /// Probably wrong.
    Red,
}

/// Orientation from which a map counts as clearly direct, and below which as doubtful.
const ORIENTATION: (f64, f64) = (0.75, 0.65);
/// Mean change of short distances up to which a map counts as good, and beyond which as bad.
const LOCAL_DISTORTION: (f64, f64) = (0.035, 0.05);

impl Grade {
    /// Name of the grade.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Green => "green",
            Self::Amber => "amber",
            Self::Red => "red",
        }
    }
}

/// Grade and reasons of a map by its figures.
#[must_use]
pub fn graded(figures: &Figures, shares: Shares) -> (Grade, Vec<String>) {
    let mut reasons = Vec::new();
    if shares == Shares::TARGET_IS_PART {
        reasons.push("the target looks like a part of the source".into());
    } else if shares == Shares::SOURCE_IS_PART {
        reasons.push("the source looks like a part of the target".into());
    }
    let o = figures.orientation;
    let d = 100.0 * figures.local_distortion;
    if o < ORIENTATION.1 {
        reasons.push(format!(
            "left and right are hard to tell apart (orientation {o:.2}): try the next alternative"
        ));
    } else if o < ORIENTATION.0 {
        reasons.push(format!("the surface turns in places (orientation {o:.2})"));
    }
    if figures.local_distortion > LOCAL_DISTORTION.1 {
        reasons.push(format!(
            "distances change by {d:.1} % of √area: the shapes differ, or one is a part"
        ));
    } else if figures.local_distortion > LOCAL_DISTORTION.0 {
        reasons.push(format!(
            "distances change by {d:.1} % of √area: the bodies differ"
        ));
    }
    if !figures.clear {
        reasons.push("two maps fit almost equally well: compare the alternatives".into());
    }
    let grade = if o < ORIENTATION.1 || figures.local_distortion > LOCAL_DISTORTION.1 {
        Grade::Red
    } else if reasons.is_empty() {
        Grade::Green
    } else {
        Grade::Amber
    };
    if grade == Grade::Green {
        reasons.push("distances and orientation agree".into());
    }
    (grade, reasons)
}
