//! What is worn: a shirt, a hat, hair or teeth on the body that wears them, in their place.
//!
//! Such a target lies over, or under, some of the source with a gap. Its intrinsic shape says little, but where it lies says
//! all: each of its points takes the nearest one of the source that lies alike.

use rayon::prelude::*;

use super::pull_back::{ASIDE, Placed, in_given_numbering, lying_alike};
use super::{Figure, FigureMap};
use crate::algebra::space_tree::SpaceTree;
use crate::algebra::vector::{self, Point};
use crate::error::Result;
use crate::matching::Correspondence;
use crate::matching::problem::point_map::PointMaps;
use crate::shape::Shape;
use crate::transfer::Surface;
use crate::watch::progress::Progress;

/// Points of each surface that are asked where they lie, spread evenly over its area.
const ASKED: usize = 2_000;

/// Median and 97 % quantile of the gap, over the largest extent of the source, and share of the points that lie on one side:
/// eleven garments, shoes, a hat and hair on their bodies have at most 0.018 and 0.055 and at least 0.83; of 70 pairs of whole
/// characters at one place those with such gaps and as much uncovered have at most 0.74 on one side.
const CLOSE: [f64; 2] = [0.02, 0.06];
const ON_ONE_SIDE: f64 = 0.8;

/// The same of a layer with an even gap, and by how many times its 97 % quantile is the median at most: a small figure beside a
/// large one's leg has 1.6.
const LAYER: [f64; 2] = [0.05, 0.08];
const LAYER_ON_ONE_SIDE: f64 = 0.97;
const EVEN: f64 = 1.5;

/// The gap is at most this share of the target's own largest extent.
const LARGEST_GAP: f64 = 0.5;

/// What is worn runs along its wearer: mean |cosine| between its normals and those below. Garments, shoes, a hat and hair of
/// two people have at least 0.65, their teeth 0.60 and 0.62; of 153 small figures that stand as near to a large one at most 0.59.
const RUNS_ALONG: f64 = 0.59;

/// What is worn leaves this share of the source's area uncovered, by more than [`COVERED`] of the largest extent: the garments
/// leave 0.11, two bodies of one size at one place up to 0.08.
const UNCOVERED: f64 = 0.1;
const COVERED: f64 = 0.03;

/// Gap at which confidence falls to 1/e, over the largest extent of the source.
const REACH: f64 = 0.1;

/// The map from what is worn to its wearer; nothing where the target is not worn by the source.
pub(super) fn worn(
    source: &Figure,
    target: &Figure,
    progress: &Progress,
) -> Result<Option<FigureMap>> {
    let (on_source, on_target) = (source.given()?, target.given()?);
    if !is_worn(on_source, on_target) {
        return Ok(None);
    }
    progress.check()?;
    let size = vector::extent(&on_source.vertices);
    let trust = |gap: f64| (-(gap / (REACH * size)).powi(2)).exp();
    let normals = on_target.vertex_normals();
    let placed: Vec<Placed> = (0..on_target.vertices.len())
        .into_par_iter()
        .map(|v| {
            progress.check()?;
            let place = on_target.vertices[v];
            let point = lying_alike(on_source, place, normals[v], ASIDE * size);
            let gap = vector::distance(place, on_source.position(&point));
            Ok(Placed {
                point,
                confidence: trust(gap),
            })
        })
        .collect::<Result<_>>()?;
    let mut map = between_matched(&source.shape, &target.shape, trust, progress)?;
    in_given_numbering(&mut map, source, target, &placed);
    Ok(Some(FigureMap {
        map,
        unknown: 0.0,
        is_worn: true,
    }))
}

/// Nearest points between what was prepared of both, where they lie.
fn between_matched(
    source: &Shape,
    target: &Shape,
    trust: impl Fn(f64) -> f64,
    progress: &Progress,
) -> Result<Correspondence> {
    let there = source.given_mesh();
    let places = |mesh: &crate::mesh::Mesh| -> Vec<Point> {
        mesh.vertices.iter().map(|&p| mesh.as_given(p)).collect()
    };
    let faces: Vec<[i64; 3]> = there.faces.iter().map(|f| f.map(i64::from)).collect();
    let surface = Surface::new(places(there), &faces)?;
    let found: Vec<_> = places(target.given_mesh())
        .par_iter()
        .map(|&place| {
            let point = surface.nearest(place);
            (point, vector::distance(place, surface.position(&point)))
        })
        .collect();
    let trust: Vec<f64> = found.iter().map(|&(_, gap)| trust(gap)).collect();
    let points = found.into_iter().map(|(point, _)| point).collect();
    let (own, other) = (places(&target.mesh), places(&source.mesh));
    let images = SpaceTree::new(&other).nearest_to_each(&own);
    let back = SpaceTree::new(&own).nearest_to_each(&other);
    let maps = PointMaps {
        target_to_source: &images,
        source_to_target: &back,
    };
    Correspondence::of_points(source, target, points, &trust, maps, progress)
}

/// Whether the target is worn by the source.
fn is_worn(source: &Surface, target: &Surface) -> bool {
    let size = vector::extent(&source.vertices);
    let asked = spread(target, ASKED);
    let mut outside = 0;
    let mut along = 0.0;
    let mut gaps: Vec<f64> = Vec::with_capacity(asked.len());
    for Below {
        gap,
        is_outside,
        cosine,
    } in below(source, target, &asked)
    {
        gaps.push(gap / size);
        outside += usize::from(is_outside);
        along += cosine.abs();
    }
    if gaps.is_empty() {
        return false;
    }
    gaps.sort_by(f64::total_cmp);
    let [median, most] = [0.5, 0.97].map(|q| gaps[(q * (gaps.len() - 1) as f64) as usize]);
    // A small thing anywhere in a large one is no part of its clothes.
    if median * size > LARGEST_GAP * vector::extent(&target.vertices) {
        return false;
    }
    if along < RUNS_ALONG * gaps.len() as f64 {
        return false;
    }
    let outside = outside as f64 / gaps.len() as f64;
    let on_one_side = outside.max(1.0 - outside);
    let is_close = median <= CLOSE[0] && most <= CLOSE[1] && on_one_side >= ON_ONE_SIDE;
    let is_layer = median <= LAYER[0]
        && most <= LAYER[1]
        && most <= EVEN * median
        && on_one_side >= LAYER_ON_ONE_SIDE;
    if !is_close && !is_layer {
        return false;
    }
    let asked = spread(source, ASKED);
    let uncovered = below(target, source, &asked).filter(|b| b.gap / size > COVERED + median);
    uncovered.count() as f64 >= UNCOVERED * asked.len() as f64
}

/// What lies nearest to a place.
struct Below {
    /// Distance to it.
    gap: f64,
    /// Whether the place lies on the side to which it faces.
    is_outside: bool,
    /// Cosine between the normal at the place and there.
    cosine: f64,
}

/// What of a surface lies nearest to each place of another.
fn below(
    surface: &Surface,
    other: &Surface,
    asked: &[(Point, u32)],
) -> impl Iterator<Item = Below> {
    let found: Vec<Below> = asked
        .par_iter()
        .map(|&(place, face)| {
            let point = surface.nearest(place);
            let off = vector::sub(place, surface.position(&point));
            let normal = surface.cross(point.face);
            let cosine = vector::dot(
                vector::normalised(other.cross(face)),
                vector::normalised(normal),
            );
            Below {
                gap: vector::norm(off),
                is_outside: vector::dot(off, normal) > 0.0,
                cosine,
            }
        })
        .collect();
    found.into_iter()
}

/// Places spread evenly over the area of a surface, in the order of their faces, and these.
fn spread(surface: &Surface, count: usize) -> Vec<(Point, u32)> {
    let areas: Vec<f64> = (0..surface.triangles.len() as u32)
        .map(|t| vector::norm(surface.cross(t)))
        .collect();
    let step = areas.iter().sum::<f64>() / count as f64;
    let mut places = Vec::with_capacity(count);
    let mut passed = 0.5 * step;
    for (t, area) in (0..).zip(areas) {
        let [a, b, c] = surface.corners(t);
        let mut here = Vec::new();
        while passed < area && step > 0.0 {
            here.push(passed / area);
            passed += step;
        }
        passed -= area;
        for share in here {
            // From one corner to the other side, through the middle.
            let along = share.sqrt();
            let side = vector::scaled(vector::add(b, c), 0.5);
            let off = vector::scaled(vector::sub(side, a), along);
            places.push((vector::add(a, off), t));
        }
    }
    places
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{RINGS, torus_mesh};

    /// Some rings of a torus, thicker and moved.
    fn rings(count: usize, thicker: f64, moved: f64) -> Surface {
        let (mut vertices, faces) = torus_mesh(count, &[], thicker);
        for p in &mut vertices {
            p[0] += moved;
        }
        Surface::new(vertices, &faces).expect("a surface")
    }

    #[test]
    fn a_sleeve_is_worn_and_what_lies_beside_or_is_another_body_is_not() {
        let body = rings(RINGS, 0.0, 0.0);
        assert!(is_worn(&body, &rings(RINGS / 3, 0.03, 0.0)));
        assert!(!is_worn(&body, &rings(RINGS / 3, 0.03, 0.5)));
        assert!(!is_worn(&body, &rings(RINGS, 0.03, 0.0)));
    }

    /// It lies as near as clothes do, all on one side, but does not run along the tube.
    #[test]
    fn a_small_figure_beside_a_large_one_is_not_worn() {
        let body = rings(RINGS, 0.0, 0.0);
        let (mut vertices, faces) = torus_mesh(RINGS, &[], 0.0);
        // Up to 0.64 along x, inside of the tube, which begins at 0.65.
        for p in &mut vertices {
            *p = vector::add([0.6, 0.0, 0.0], vector::scaled(*p, 0.03));
        }
        let small = Surface::new(vertices, &faces).expect("a surface");
        assert!(!is_worn(&body, &small));
    }

    #[test]
    fn places_are_spread_by_area() {
        let body = rings(RINGS, 0.0, 0.0);
        let places = spread(&body, ASKED);
        assert!(places.len().abs_diff(ASKED) <= 1);
        for &(place, _) in &places {
            let gap = vector::distance(place, body.position(&body.nearest(place)));
            // Rounding of coordinates up to 1.5.
            assert!(gap < 1e-7, "{gap}");
        }
    }
}
