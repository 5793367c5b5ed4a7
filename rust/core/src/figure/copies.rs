//! Pieces that two figures have in common, as a character has with itself in another pose.
//!
//! Their [originals](crate::mesh::copies) are known before anything is matched. Where they are nearly all that is seen, they are the
//! map; otherwise those that can be no other's are landmarks of the map between the figures, and afterwards every vertex of a
//! common piece answers to its original.

use super::pull_back::Placed;
use super::worn::between_matched;
use super::{Figure, FigureMap, Origin};
use crate::algebra::vector::{self, Point};
use crate::error::Result;
use crate::figure::settings::{COPIES, FIGURE};
use crate::matching::problem::landmark::Landmark;
use crate::mesh::copies::{Original, Triangles, originals};
use crate::mesh::numbering::{GivenVertex, InputVertex};
use crate::mesh::surface_point::SurfacePoint;
use crate::transfer::Surface;
use crate::transfer::surface::blend;
use crate::watch::progress::Progress;

fn triangles(figure: &Figure) -> Triangles<'_> {
    Triangles {
        vertices: &figure.welded.vertices,
        faces: &figure.welded.faces,
    }
}

/// Source vertices of target vertices, welded, by common pieces.
///
/// # Errors
/// [`crate::Error::Cancelled`].
pub(super) fn common(
    source: &Figure,
    target: &Figure,
    images: Option<&[Point]>,
    progress: &Progress,
) -> Result<Vec<Option<Original>>> {
    let (source, target) = (triangles(source), triangles(target));
    originals(source, target, images, false, &|| progress.check())
}

/// The map between figures where nearly all that is seen of the target lies on common pieces that can be no other's; otherwise
/// nothing.
///
/// # Errors
/// [`crate::Error::Cancelled`].
pub(super) fn copied(
    source: &Figure,
    target: &Figure,
    common: &[Option<Original>],
    progress: &Progress,
) -> Result<Option<FigureMap>> {
    let Some(visible) = &target.visible else {
        return Ok(None);
    };
    let image = |v: u32| {
        let original = common[v as usize].filter(|original| original.is_only)?;
        Some(source.welded.vertices[original.vertex as usize])
    };
    let images = |f: &[u32; 3]| Some([image(f[0])?, image(f[1])?, image(f[2])?]);
    let faces = target.welded.faces.iter();
    let known: Vec<Option<[Point; 3]>> = faces.map(images).collect();
    let of_known = known.iter().zip(visible);
    let of_known = of_known.filter_map(|(images, area)| images.map(|_| area));
    if of_known.sum::<f64>() < COPIES.enough * visible.iter().sum::<f64>() {
        return Ok(None);
    }
    progress.check()?;
    let faces = target.welded.faces.iter().zip(known);
    let (faces, images): (Vec<[i64; 3]>, Vec<[Point; 3]>) = faces
        .filter_map(|(f, images)| Some((f.map(i64::from), images?)))
        .unzip();
    let surface = Surface::new(target.welded.vertices.clone(), &faces)?;
    let carried = |place: Point| {
        let SurfacePoint { face, weights } = surface.nearest(place);
        blend(images[face as usize], weights)
    };
    let reach = FIGURE.on_envelope * vector::extent(&source.welded.vertices);
    let trust = |gap: f64| (-(gap / reach).powi(2)).exp();
    let (from, to) = (&source.shape, &target.shape);
    let map = between_matched(from, to, carried, trust, progress)?;
    let found = FigureMap::pulled_back(map, source, target, Vec::new(), true, progress)?;
    Ok(Some(FigureMap {
        origin: Origin::Copies,
        ..found
    }))
}

/// Whether what is known of the map, pairs of given vertices, is as common pieces say.
pub(super) fn agree(
    source: &Figure,
    target: &Figure,
    common: &[Option<Original>],
    landmarks: &[Landmark<GivenVertex>],
) -> bool {
    let reach = COPIES.agree * vector::extent(&source.welded.vertices);
    landmarks.iter().all(|landmark| {
        let of = |figure: &Figure, v: GivenVertex| figure.welded.class.get(v.index()).copied();
        let (Some(s), Some(t)) = (of(source, landmark.source), of(target, landmark.target)) else {
            // Not among the vertices, as is told when they are matched.
            return false;
        };
        let place = |v: u32| source.welded.vertices[v as usize];
        common[t as usize]
            .is_none_or(|original| vector::distance(place(original.vertex), place(s)) <= reach)
    })
}

/// More landmarks for what is matched of two figures, far apart from one another, on common pieces that can be no other's.
pub(super) fn add_landmarks(
    source: &Figure,
    target: &Figure,
    found: &[Option<Original>],
    landmarks: &mut Vec<Landmark<InputVertex>>,
) {
    let known = |v: usize| {
        let original = found[v].filter(|original| original.is_only)?;
        let is_seen = source.is_matched(original.vertex) && target.is_matched(v as u32);
        is_seen.then_some((original.vertex, v as u32))
    };
    let known: Vec<(u32, u32)> = (0..found.len()).filter_map(known).collect();
    let place = |&(_, v): &(u32, u32)| target.welded.vertices[v as usize];
    let mut left: Vec<f64> = vec![f64::INFINITY; known.len()];
    for _ in 0..COPIES.landmarks.min(known.len()) {
        let Some(next) = (0..known.len()).max_by(|&a, &b| left[a].total_cmp(&left[b])) else {
            break;
        };
        let (s, t) = known[next];
        let new = Landmark {
            source: source.matched_class(s),
            target: target.matched_class(t),
        };
        let is_taken = |l: &Landmark<_>| l.source == new.source || l.target == new.target;
        if !landmarks.iter().any(is_taken) {
            landmarks.push(new);
        }
        let new = place(&known[next]);
        for (left, other) in left.iter_mut().zip(&known) {
            *left = left.min(vector::distance(place(other), new));
        }
    }
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
                .binary_search(&InputVertex(class))
                .is_ok(),
        }
    }
}
