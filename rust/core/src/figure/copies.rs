//! Pieces that two figures have in common, as a character has with itself in another pose.
//!
//! Their [originals](crate::mesh::copies) are known before anything is matched: those that can be no other's are landmarks of the
//! map between the figures. Afterwards every vertex of such a piece answers to its original.

use super::Figure;
use super::pull_back::Placed;
use crate::algebra::vector::{self, Point};
use crate::error::Result;
use crate::figure::settings::{COPIES, FIGURE};
use crate::mesh::copies::{Original, Triangles, originals};
use crate::mesh::surface_point::SurfacePoint;
use crate::watch::progress::Progress;

fn triangles(figure: &Figure) -> Triangles<'_> {
    Triangles {
        vertices: &figure.welded.vertices,
        faces: &figure.welded.faces,
    }
}

/// Source vertices of target vertices, welded, by common pieces.
fn common(
    source: &Figure,
    target: &Figure,
    images: Option<&[Point]>,
    progress: &Progress,
) -> Result<Vec<Option<Original>>> {
    let (source, target) = (triangles(source), triangles(target));
    originals(source, target, images, false, &|| progress.check())
}

/// Landmarks for what is matched of two figures, far apart from one another, on pieces of which each is the only one of its kind.
///
/// # Errors
/// [`crate::Error::Cancelled`].
pub(super) fn landmarks(
    source: &Figure,
    target: &Figure,
    progress: &Progress,
) -> Result<Vec<(u32, u32)>> {
    let found = common(source, target, None, progress)?;
    let known = |v: usize| {
        let original = found[v].filter(|original| original.is_only)?;
        let is_seen = source.is_matched(original.vertex) && target.is_matched(v as u32);
        is_seen.then_some((original.vertex, v as u32))
    };
    let known: Vec<(u32, u32)> = (0..found.len()).filter_map(known).collect();
    let place = |&(_, v): &(u32, u32)| target.welded.vertices[v as usize];
    let mut left: Vec<f64> = vec![f64::INFINITY; known.len()];
    let mut landmarks: Vec<(u32, u32)> = Vec::new();
    for _ in 0..COPIES.landmarks.min(known.len()) {
        let Some(next) = (0..known.len()).max_by(|&a, &b| left[a].total_cmp(&left[b])) else {
            break;
        };
        let (s, t) = known[next];
        let pair = (source.matched_class(s), target.matched_class(t));
        if !landmarks.iter().any(|l| l.0 == pair.0 || l.1 == pair.1) {
            landmarks.push(pair);
        }
        let new = place(&known[next]);
        for (left, other) in left.iter_mut().zip(&known) {
            *left = left.min(vector::distance(place(other), new));
        }
    }
    Ok(landmarks)
}

/// Vertices of common pieces on their originals; those of which there are several ones like it keep their confidence.
///
/// # Errors
/// [`crate::Error::Cancelled`].
pub(super) fn on_originals(
    source: &Figure,
    target: &Figure,
    placed: &mut [Placed],
    progress: &Progress,
) -> Result<()> {
    let given = source.given()?;
    let images: Vec<Point> = placed.iter().map(|p| given.position(&p.point)).collect();
    let found = common(source, target, Some(&images), progress)?;
    let mut a_face = vec![0; source.welded.vertices.len()];
    for (face, corners) in source.welded.faces.iter().enumerate() {
        for &v in corners {
            a_face[v as usize] = face as u32;
        }
    }
    for (placed, original) in placed.iter_mut().zip(found) {
        let Some(Original { vertex, is_only }) = original else {
            continue;
        };
        let face = a_face[vertex as usize];
        placed.point = SurfacePoint::at_corner(&source.welded.faces, face, vertex);
        if is_only {
            placed.confidence = 1.0;
        }
    }
    Ok(())
}

impl Figure {
    /// Whether a welded vertex lies on what is matched.
    fn is_matched(&self, class: u32) -> bool {
        match &self.wrapped {
            Some(wrapped) => wrapped.anchors[class as usize].away <= FIGURE.on_envelope,
            None => (self.shape.given_mesh().input_vertex)
                .binary_search(&class)
                .is_ok(),
        }
    }
}
