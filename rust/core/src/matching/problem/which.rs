//! Either shape of a pair.

/// Which shape of a pair.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Which {
    /// The one whose points are asked for.
    Target,
    /// The one that answers.
    Source,
}

impl Which {
    /// The other one.
    #[must_use]
    pub fn other(self) -> Self {
        match self {
            Self::Target => Self::Source,
            Self::Source => Self::Target,
        }
    }

    /// Units of length of the other shape that one of this one is, by how many of the source one of the target is;
    /// and back.
    #[must_use]
    pub fn seen(self, lengths: f64) -> f64 {
        match self {
            Self::Target => lengths,
            Self::Source => 1.0 / lengths,
        }
    }
}
