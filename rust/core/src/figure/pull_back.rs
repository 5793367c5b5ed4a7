//! From the map between what was matched to one between the given meshes, all pieces of them.
//!
//! A vertex goes to its nearest point of the target's envelope, from there along the map to the source's, and as deep under
//! that as it lay under its own to the nearest point of the given source whose surface lies alike: skin to skin and
//! cloth to cloth where both have both. What lies far from the envelope, as teeth do, was not matched: it goes to its
//! counterpart where there is one, else with what lies around it. A piece of some size that comes to lie on several of the source's
//! is drawn to one of them where it can be.

use std::cmp::Ordering;

use rayon::prelude::*;

use super::{Figure, copies, largest};
use crate::algebra::similarity::Similarity;
use crate::algebra::vector::{self, Point};
use crate::error::Result;
use crate::figure::settings::{FIGURE, PULL_BACK};
use crate::matching::Correspondence;
use crate::matching::problem::landmark::Landmark;
use crate::mesh::numbering::GivenVertex;
use crate::mesh::surface_point::SurfacePoint;
use crate::transfer::counterparts::{Members, Piece, extent, largest_small, members};
use crate::transfer::parts::components;
use crate::transfer::settings::COUNTERPARTS;
use crate::transfer::surface::blend;
use crate::transfer::{Surface, SurfaceMap};
use crate::watch::progress::Progress;

/// A map between given meshes, and how much of what is seen of the target has no image of its own.
#[derive(Debug)]
pub struct FigureMap {
    /// In given numbering; its functional map is between the spectra of what was matched.
    pub map: Correspondence,
    /// Share of the target's visible area that was placed without having been matched.
    pub unknown: f64,
    /// How it was found.
    pub origin: Origin,
    /// Pairs of points that the caller gave.
    pub landmarks: Vec<Landmark<GivenVertex>>,
}

/// How a map between figures was found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Origin {
    /// By their shapes.
    Matched,
    /// The target is worn by the source and takes the nearest points.
    Worn,
    /// The target's pieces are the source's, each posed in its own way.
    Copies,
}

/// A vertex of the target before small pieces are put onto their counterparts.
pub(super) struct Placed {
    pub point: SurfacePoint,
    pub confidence: f64,
}

impl FigureMap {
    /// The map between two figures from that between what was matched of them, pieces that both have on their originals where
    /// these count.
    pub(super) fn pulled_back(
        mut map: Correspondence,
        source: &Figure,
        target: &Figure,
        landmarks: Vec<Landmark<GivenVertex>>,
        by_copies: bool,
        progress: &Progress,
    ) -> Result<Self> {
        progress.check()?;
        let has_unmatched = map.unmatched > 0 && target.pieces > 1;
        if source.is_plain() && target.is_plain() && !has_unmatched && !by_copies {
            return Ok(Self {
                map,
                unknown: 0.0,
                origin: Origin::Matched,
                landmarks,
            });
        }
        let mut placed = if source.is_wrapped() || target.is_wrapped() {
            placed(&map, source, target, progress)?
        } else {
            let points = map.faces.iter().zip(&map.barycentric);
            let points = points.map(|(&face, &weights)| SurfacePoint { face, weights });
            points
                .zip(&map.confidence)
                .map(|(point, &confidence)| Placed { point, confidence })
                .collect()
        };
        if by_copies {
            copies::on_originals(source, target, &mut placed, progress)?;
        }
        let unknown = unknown(target, &placed);
        let placed = on_counterparts(source, target, placed)?;
        in_given_numbering(&mut map, source, target, &placed);
        Ok(Self {
            map,
            unknown,
            origin: Origin::Matched,
            landmarks,
        })
    }
}

/// Puts images of welded target vertices into the numbering of the given meshes.
pub(super) fn in_given_numbering(
    map: &mut Correspondence,
    source: &Figure,
    target: &Figure,
    placed: &[Placed],
) {
    let count = target.vertex_count();
    map.faces = Vec::with_capacity(count);
    map.barycentric = Vec::with_capacity(count);
    map.vertices = Vec::with_capacity(count);
    map.confidence = Vec::with_capacity(count);
    for &class in &target.welded.class {
        let Placed { point, confidence } = &placed[class as usize];
        let face = source.welded.face[point.face as usize];
        map.faces.push(face);
        map.barycentric.push(point.weights);
        map.vertices
            .push(source.faces[face as usize][largest(point.weights)]);
        map.confidence.push(*confidence);
    }
    map.unmatched = map.confidence.iter().filter(|&&c| c == 0.0).count();
}

/// Images of welded target vertices on the welded source where either is matched by its envelope.
fn placed(
    map: &Correspondence,
    source: &Figure,
    target: &Figure,
    progress: &Progress,
) -> Result<Vec<Placed>> {
    let (on_source, on_target) = (source.matched()?, target.matched()?);
    let given = source.given()?;
    let extents = [on_source, on_target].map(|s| vector::extent(&s.vertices));
    // √area tells sizes of bodies with limbs better than extents, which depend on the pose.
    let scale = source.shape.unit / target.shape.unit;
    let images: Vec<Point> = map
        .faces
        .iter()
        .zip(&map.barycentric)
        .map(|(&face, &weights)| blend(on_source.corners(face), weights))
        .collect();
    let image = |v: usize| -> Sent {
        let (corners, weights, height, away) = match &target.wrapped {
            Some(wrapped) => {
                let anchor = wrapped.anchors[v];
                let corners = on_target.triangles[anchor.point.face as usize];
                (corners, anchor.point.weights, anchor.height, anchor.away)
            }
            None => ([v as u32; 3], [1.0, 0.0, 0.0], 0.0, 0.0),
        };
        let nearest = corners[largest(weights)] as usize;
        let places = corners.map(|c| images[c as usize]);
        let [a, b, c] = places;
        let spread = vector::distance(a, b)
            .max(vector::distance(b, c))
            .max(vector::distance(c, a));
        let longest = match &target.wrapped {
            Some(wrapped) => scale * on_target.longest_edge(wrapped.anchors[v].point.face),
            None => 0.0,
        };
        let place = if spread <= PULL_BACK.torn * longest {
            blend(places, weights)
        } else {
            images[nearest]
        };
        let mut confidence: f64 = (0..3)
            .map(|i| weights[i] * map.confidence[corners[i] as usize])
            .sum();
        if away > FIGURE.on_envelope {
            confidence = 0.0;
        }
        let face = map.faces[nearest];
        let normal = vector::normalised(on_source.cross(face));
        let height = (scale * height).clamp(
            -PULL_BACK.deepest * extents[0],
            PULL_BACK.deepest * extents[0],
        );
        let goal = vector::add(place, vector::scaled(normal, height));
        let point = lying_alike(given, goal, normal, PULL_BACK.aside * extents[0]);
        Sent {
            placed: Placed { point, confidence },
            goal,
            normal,
        }
    };
    let sent: Vec<Sent> = (0..target.welded.vertices.len())
        .into_par_iter()
        .map(|v| {
            progress.check()?;
            Ok(image(v))
        })
        .collect::<Result<_>>()?;
    let mirrored = map.metrics.is_some_and(|metrics| metrics.orientation < 0.0);
    kept_together(
        source,
        target,
        sent,
        mirrored,
        PULL_BACK.deepest * extents[0],
    )
}

/// Where a vertex of the target was placed, and where the map of what was matched put it.
struct Sent {
    placed: Placed,
    goal: Point,
    /// Of the source's surface there.
    normal: Point,
}

/// The images, those of a piece of the target on one piece of the source where nearly all of them can be.
///
/// Hair, a beard or a cap over one of two heads would else draw that part of the other's face to itself. A piece goes to that of
/// the source, of those with any of its images, whose shape is most like its own, or else to the one which has most of them, if
/// `PULL_BACK.covers` of its vertices come within reach of it. One that carries nearly all that is seen answers for skin and clothes
/// alike and stays, and small ones go to their counterparts.
fn kept_together(
    source: &Figure,
    target: &Figure,
    mut sent: Vec<Sent>,
    mirrored: bool,
    reach: f64,
) -> Result<Vec<Placed>> {
    let (given, own) = (source.given()?, target.given()?);
    let (piece, count) = components(own);
    let (source_piece, source_count) = components(given);
    let theirs = members(given, &source_piece, source_count);
    let theirs: Vec<Option<Piece>> = (theirs.par_iter())
        .map(|members| Piece::new(given, members, |p| p))
        .collect::<Result<_>>()?;
    let of_face = |face: u32| source_piece[given.triangles[face as usize][0] as usize];
    let mut seen = vec![0.0; count];
    for (face, area) in (target.welded.faces.iter()).zip(target.visible.iter().flatten()) {
        seen[piece[face[0] as usize] as usize] += area;
    }
    let all: f64 = seen.iter().sum();
    let small = largest_small(own);
    // Where the vertices of a piece come to lie together; nothing where it stays.
    let together = |piece: &Members, seen: f64| -> Result<Option<Vec<Option<SurfacePoint>>>> {
        let mut on: Vec<u32> = (piece.0.iter())
            .map(|&v| of_face(sent[v as usize].placed.point.face))
            .collect();
        on.sort_unstable();
        let places = own.places(&piece.0);
        let is_small = extent(&places).1 <= small;
        if on.first() == on.last() || is_small || seen >= FIGURE.carries_all * all {
            return Ok(None);
        }
        let count = places.len() as f64;
        let drawn = |run: &[u32]| {
            let other = theirs[run[0] as usize].as_ref()?;
            let drawn = |&v: &u32| {
                let sent = &sent[v as usize];
                let is_there = of_face(sent.placed.point.face) == run[0];
                let point = is_there.then_some(sent.placed.point);
                point.or_else(|| sent.drawn_to(given, other, reach))
            };
            let points: Vec<Option<SurfacePoint>> = piece.0.par_iter().map(drawn).collect();
            let covered = points.iter().flatten().count() as f64;
            (covered >= PULL_BACK.covers * count).then(|| Drawn {
                other,
                share: run.len() as f64 / count,
                points,
                by_shape: None,
            })
        };
        let mut candidates: Vec<Drawn> = (on.chunk_by(|a, b| a == b)).filter_map(drawn).collect();
        if candidates.len() > 1 || candidates.iter().any(|drawn| !drawn.is_matched()) {
            for drawn in &mut candidates {
                drawn.lay((own, piece), given, mirrored)?;
            }
        }
        let best = candidates.into_iter().min_by(Drawn::compare);
        Ok(best.map(Drawn::places))
    };
    let pieces = members(own, &piece, count);
    let kept: Vec<Option<Vec<Option<SurfacePoint>>>> = (pieces.par_iter().zip(&seen))
        .map(|(piece, &seen)| together(piece, seen))
        .collect::<Result<_>>()?;
    for ((vertices, _), points) in pieces.iter().zip(kept) {
        for (&v, point) in vertices.iter().zip(points.into_iter().flatten()) {
            let placed = &mut sent[v as usize].placed;
            placed.point = point.unwrap_or(placed.point);
        }
    }
    Ok(sent.into_iter().map(|sent| sent.placed).collect())
}

/// A piece of the target drawn to one of the source.
struct Drawn<'a> {
    other: &'a Piece<'a>,
    /// Share of its images that were there.
    share: f64,
    /// Where its images come to lie.
    points: Vec<Option<SurfacePoint>>,
    /// What it costs by its shape, and where that lays it; nothing where that is not like.
    by_shape: Option<(f64, Vec<SurfacePoint>)>,
}

impl Drawn<'_> {
    /// Whether what was matched of it tells where it lies.
    fn is_matched(&self) -> bool {
        self.share > COUNTERPARTS.held
    }

    /// Lays it by its shape, its images saying where.
    fn lay(
        &mut self,
        (own, piece): (&Surface, &Members),
        given: &Surface,
        mirrored: bool,
    ) -> Result<()> {
        let pairs: Vec<(Point, Point, f64)> = (own.places(&piece.0).iter().zip(&self.points))
            .filter_map(|(&place, point)| Some((place, given.position(point.as_ref()?), 1.0)))
            .collect();
        let there = Similarity::fitted(&pairs, mirrored);
        let piece = Piece::new(own, piece, |p| there.apply(p))?;
        self.by_shape = piece.and_then(|piece| {
            let cost = piece.cost(self.other)?;
            (cost <= PULL_BACK.like).then(|| (cost, piece.laid_on(self.other).collect()))
        });
        Ok(())
    }

    /// The better one first: that which is more alike, or that with more of the images where none is.
    fn compare(&self, other: &Self) -> Ordering {
        let cost = |drawn: &Self| drawn.by_shape.as_ref().map_or(f64::INFINITY, |laid| laid.0);
        (cost(self).total_cmp(&cost(other))).then(other.share.total_cmp(&self.share))
    }

    /// Where its vertices come to lie. What was matched of little of it is more of what lies over it: where both have one shape,
    /// that tells more.
    fn places(self) -> Vec<Option<SurfacePoint>> {
        let is_matched = self.is_matched();
        match self.by_shape {
            Some((_, laid)) if !is_matched => laid.into_iter().map(Some).collect(),
            _ => self.points,
        }
    }
}

impl Sent {
    /// The nearest point of a piece of a surface, one where it lies alike before others.
    fn drawn_to(&self, surface: &Surface, piece: &Piece, reach: f64) -> Option<SurfacePoint> {
        let is_alike = |face: u32| lies_alike(surface, face, self.normal);
        (piece.nearest_within(self.goal, reach, is_alike))
            .or_else(|| piece.nearest_within(self.goal, reach, |_| true))
    }
}

/// Whether a surface lies alike at a face, whatever its winding.
fn lies_alike(surface: &Surface, face: u32, normal: Point) -> bool {
    let cross = surface.cross(face);
    vector::dot(cross, normal).abs() > PULL_BACK.alike * vector::norm(cross)
}

/// Nearest point where the surface lies alike, unless another is nearer by more than `aside`.
pub(super) fn lying_alike(
    surface: &Surface,
    goal: Point,
    normal: Point,
    aside: f64,
) -> SurfacePoint {
    let nearest = surface.nearest(goal);
    let is_alike = |face: u32| lies_alike(surface, face, normal);
    if is_alike(nearest.face) {
        return nearest;
    }
    let within = aside + vector::distance(goal, surface.position(&nearest));
    surface
        .nearest_within(goal, within, is_alike)
        .unwrap_or(nearest)
}

/// Share of the visible area of the target whose vertices have no image of their own.
fn unknown(target: &Figure, placed: &[Placed]) -> f64 {
    let Some(visible) = &target.visible else {
        return 0.0;
    };
    let all: f64 = visible.iter().sum();
    let of_face = |f: &[u32; 3]| {
        let is_unknown = |&&v: &&u32| placed[v as usize].confidence == 0.0;
        f.iter().filter(is_unknown).count() as f64 / 3.0
    };
    let faces = target.welded.faces.iter().zip(visible);
    let unknown: f64 = faces.map(|(f, area)| area * of_face(f)).sum();
    if all > 0.0 { unknown / all } else { 0.0 }
}

/// Pieces without an image of their own, on their counterparts of the source where it has them.
fn on_counterparts(source: &Figure, target: &Figure, placed: Vec<Placed>) -> Result<Vec<Placed>> {
    if target.pieces < 2 {
        return Ok(placed);
    }
    let faces: Vec<i64> = placed.iter().map(|p| i64::from(p.point.face)).collect();
    let weights: Vec<[f64; 3]> = placed.iter().map(|p| p.point.weights).collect();
    let confidence = placed.iter().map(|p| p.confidence).collect();
    let (source, target) = (source.given()?.clone(), target.given()?.clone());
    let map = SurfaceMap::new(source, target, &faces, &weights, confidence)?
        .on_counterparts(COUNTERPARTS.held)?;
    let points = map.points.iter().zip(&map.confidence);
    Ok(points
        .map(|(&point, &confidence)| Placed { point, confidence })
        .collect())
}
