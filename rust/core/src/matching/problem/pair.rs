//! What is asked: two shapes, which of their points ask, and what is known of the answer.

use crate::error::{Error, Result};
use crate::matching::problem::constraints::Constraints;
use crate::matching::problem::point_map::{PointMap, SampledMap};
use crate::matching::problem::which::Which;
use crate::shape::Shape;

/// Whether mirrored maps may be chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mirror {
    /// Only orientation-preserving maps.
    Forbid,
    /// Either; for a left against a right hand.
    Allow,
    /// Only orientation-reversing maps; for the symmetry of one shape.
    Only,
    /// Only maps of a shape to itself that bring its points far away on average, and keep the orientation.
    Away,
}

/// How much each shape's questions to the other count in fits and energies.
///
/// Between whole shapes both count alike. When one is a part of the other only its own points have
/// an answer, and only they are asked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coverage {
    /// Weight of target points asking the source.
    pub target: f64,
    /// Weight of source points asking the target.
    pub source: f64,
}

impl Coverage {
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

    /// That either is a part of the other.
    #[must_use]
    pub fn of_part(part: Which) -> Self {
        match part {
            Which::Target => Self::TARGET_IS_PART,
            Which::Source => Self::SOURCE_IS_PART,
        }
    }

    /// Weight of a shape's points asking the other.
    #[must_use]
    pub fn of(self, which: Which) -> f64 {
        match which {
            Which::Target => self.target,
            Which::Source => self.source,
        }
    }

    /// Which shape is a part of the other, if one is.
    #[must_use]
    pub fn part(self) -> Option<Which> {
        match self {
            Self::TARGET_IS_PART => Some(Which::Target),
            Self::SOURCE_IS_PART => Some(Which::Source),
            _ => None,
        }
    }

    /// The same with target and source exchanged.
    #[must_use]
    pub fn inverse(self) -> Self {
        Self {
            target: self.source,
            source: self.target,
        }
    }

    /// Mean of what the source's and the target's points give.
    #[must_use]
    pub fn mean(self, by_source: f64, by_target: f64) -> f64 {
        f64::midpoint(self.target * by_target, self.source * by_source)
    }
}

/// A part of the automatic method that can be left out, to see what it contributes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// Changes of distances, wherever candidates are compared.
    Geodesic,
    /// Wave kernel and curvature, in the search and in the refinement.
    Descriptors,
    /// Bivectors of gradients, wherever candidates are compared or turned.
    Orientation,
    /// All candidates of the search but the best of each step.
    Search,
    /// All candidates of the finished search but the best.
    Vote,
    /// Upsampling to 60 eigenfunctions before the refinement.
    Upsampling,
    /// Positions and normals in the refinement.
    Extrinsic,
    /// The refinement's second way, by fewer eigenfunctions.
    Detour,
    /// Steps of the refinement on the whole surface, locally rigid.
    Rigid,
    /// The own mirror symmetry of shapes that are not poses of one body.
    Symmetry,
    /// Parts of shapes where the result is poor.
    Retry,
    /// A wider search where the result is poor still.
    Wide,
    /// The map between figures as they stand.
    Standing,
    /// The map found, turned as the source is like itself.
    Turned,
    /// Where the shape of a small part is found on the whole.
    Located,
    /// The narrow search before the usual one.
    Narrow,
    /// The map between surfaces that lie on one another as they were given.
    InPlace,
    /// Fingers that lie on their neighbours, set right.
    Fingers,
    /// The surface deformed by maps that are affine on each part, sliding along the other.
    Sliding,
    /// That creases draw little while it slides.
    Convexity,
    /// A part refined once more on what it covers of the whole.
    Overlap,
    /// Samples of a part moved to where the rest of its map would have them.
    Relocation,
    /// That what a part leaves over of the whole has to begin at its boundary.
    Uncovered,
    /// Points refined on the given meshes.
    Detail,
}

impl Part {
    /// All parts with their names.
    pub const ALL: [(&'static str, Self); 24] = [
        ("geodesic", Self::Geodesic),
        ("descriptors", Self::Descriptors),
        ("orientation", Self::Orientation),
        ("search", Self::Search),
        ("vote", Self::Vote),
        ("upsampling", Self::Upsampling),
        ("extrinsic", Self::Extrinsic),
        ("detour", Self::Detour),
        ("rigid", Self::Rigid),
        ("symmetry", Self::Symmetry),
        ("retry", Self::Retry),
        ("wide", Self::Wide),
        ("standing", Self::Standing),
        ("turned", Self::Turned),
        ("located", Self::Located),
        ("narrow", Self::Narrow),
        ("in_place", Self::InPlace),
        ("fingers", Self::Fingers),
        ("sliding", Self::Sliding),
        ("convexity", Self::Convexity),
        ("overlap", Self::Overlap),
        ("relocation", Self::Relocation),
        ("uncovered", Self::Uncovered),
        ("detail", Self::Detail),
    ];
}

/// Parts of the automatic method that are left out; none by default.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct LeftOut(u32);

impl LeftOut {
    /// These parts.
    #[must_use]
    pub fn of(parts: &[Part]) -> Self {
        Self(parts.iter().fold(0, |bits, &part| bits | 1 << part as u16))
    }

    /// The parts of these names.
    ///
    /// # Errors
    /// [`Error::BadArgument`] for a name that is not in [`Part::ALL`].
    pub fn named(names: &[String]) -> Result<Self> {
        let parts: Vec<Part> = names
            .iter()
            .map(|name| {
                let found = Part::ALL.iter().find(|(known, _)| known == name);
                found.map(|&(_, part)| part).ok_or_else(|| {
                    let known: Vec<&str> = Part::ALL.iter().map(|&(known, _)| known).collect();
                    Error::BadArgument {
                        what: format!(
                            "{name:?} cannot be left out: choose of {}",
                            known.join(", ")
                        ),
                    }
                })
            })
            .collect::<Result<_>>()?;
        Ok(Self::of(&parts))
    }

    /// Whether a part is among them.
    #[must_use]
    pub fn has(self, part: Part) -> bool {
        self.0 & (1 << part as u16) != 0
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
    pub coverage: Coverage,
    /// Whether the map may turn the surface over.
    pub mirror: Mirror,
    /// What is known of the map.
    pub constraints: &'a Constraints,
    /// What of the method is not used.
    pub left_out: LeftOut,
    /// How many units of length of the source one of the target is, where that is known, else 1: each shape
    /// has unit area.
    pub lengths: f64,
    /// What the distance of each vertex of the source and of the target from its own mirror image
    /// [counts](crate::matching::symmetry::counted).
    pub mirror_offsets: Option<[&'a [f32]; 2]>,
}

impl<'a> Pair<'a> {
    /// The map that gives the vertices of the target their images on the source.
    #[must_use]
    pub fn to_source<'b>(&self, images: &'b [u32]) -> PointMap<'b>
    where
        'a: 'b,
    {
        PointMap {
            from: self.target,
            to: self.source,
            images,
        }
    }

    /// The map that gives the vertices of the source their images on the target.
    #[must_use]
    pub fn to_target<'b>(&self, images: &'b [u32]) -> PointMap<'b>
    where
        'a: 'b,
    {
        PointMap {
            from: self.source,
            to: self.target,
            images,
        }
    }

    /// The map that gives the first samples of the target their images on the source.
    #[must_use]
    pub fn samples_to_source<'b>(&self, images: &'b [u32]) -> SampledMap<'b>
    where
        'a: 'b,
    {
        SampledMap {
            from: self.target,
            to: self.source,
            images,
        }
    }

    /// The map that gives the first samples of the source their images on the target.
    #[must_use]
    pub fn samples_to_target<'b>(&self, images: &'b [u32]) -> SampledMap<'b>
    where
        'a: 'b,
    {
        SampledMap {
            from: self.source,
            to: self.target,
            images,
        }
    }

    /// Either shape.
    #[must_use]
    pub fn shape(&self, which: Which) -> &'a Shape {
        match which {
            Which::Target => self.target,
            Which::Source => self.source,
        }
    }

    /// The same with target and source exchanged, given what is known of the inverse map.
    #[must_use]
    pub fn inverse(&self, constraints: &'a Constraints) -> Self {
        Self {
            target: self.source,
            source: self.target,
            coverage: self.coverage.inverse(),
            mirror: self.mirror,
            constraints,
            left_out: self.left_out,
            lengths: 1.0 / self.lengths,
            mirror_offsets: self.mirror_offsets.map(|[source, target]| [target, source]),
        }
    }

    /// Whether the shapes' units of length are known to differ.
    #[must_use]
    pub fn knows_lengths(&self) -> bool {
        (self.lengths - 1.0).abs() > f64::EPSILON
    }

    /// Whether a part of the method is used.
    #[must_use]
    pub fn uses(&self, part: Part) -> bool {
        !self.left_out.has(part)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_part_can_be_left_out_by_itself() {
        for (name, part) in Part::ALL {
            let left_out = LeftOut::named(&[name.to_string()]).expect("it is a known name");
            for (_, other) in Part::ALL {
                assert_eq!(left_out.has(other), part == other, "{name}, {other:?}");
            }
        }
    }
}
