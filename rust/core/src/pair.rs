//! What is asked: two shapes, which of their points ask, and what is known of the answer.

use crate::hints::Hints;
use crate::shape::Shape;

/// Whether mirrored maps may be chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mirror {
    /// Only orientation-preserving maps.
    Forbid,
    /// Either; for a left against a right hand.
    Allow,
}

/// How much each shape's questions to the other count in fits and energies.
///
/// Between whole shapes both count alike. When one is a part of the other only its own points have
/// an answer, and only they are asked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shares {
    /// Weight of target points asking the source.
    pub target: f64,
    /// Weight of source points asking the target.
    pub source: f64,
}

impl Shares {
    /// Two whole shapes.
    pub const BOTH: Self = Self {
        target: 1.0,
        source: 1.0,
    };
    /// The target is a part of the source.
    pub const TARGET_IS_PART: Self = Self {
        target: 2.0,
        source: 0.0,
    };
    /// The source is a part of the target.
    pub const SOURCE_IS_PART: Self = Self {
        target: 0.0,
        source: 2.0,
    };

    /// Mean of what the target's and the source's points give.
    #[must_use]
    pub fn mean(self, by_target: f64, by_source: f64) -> f64 {
        f64::midpoint(self.target * by_target, self.source * by_source)
    }
}

/// Two shapes to be matched.
#[derive(Debug, Clone, Copy)]
pub struct Pair<'a> {
    /// The shape whose points are asked for.
    pub target: &'a Shape,
    /// The shape that answers.
    pub source: &'a Shape,
    /// Which of their points ask.
    pub shares: Shares,
    /// Whether the map may turn the surface over.
    pub mirror: Mirror,
    /// What is known of the map.
    pub hints: &'a Hints,
}
