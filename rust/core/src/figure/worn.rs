//! What is worn: a shirt, a hat, hair or teeth on the body that wears them, in their place.
//!
//! Such a target lies over, or under, some of the source with a gap. Its intrinsic shape says little, but where it lies says
//! all: each of its points takes the nearest one of the source that lies alike.

use rayon::prelude::*;

use super::pull_back::{Placed, in_given_numbering, lying_alike};
use super::{Figure, FigureMap, Origin};
use crate::algebra::space_tree::SpaceTree;
use crate::algebra::vector::{self, Point};
use crate::error::Result;
use crate::figure::settings::{PULL_BACK, WORN};
use crate::matching::Correspondence;
use crate::matching::problem::point_map::PointMaps;
use crate::shape::Shape;
use crate::transfer::Surface;
use crate::watch::progress::Progress;

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
    let trust = |gap: f64| (-(gap / (WORN.reach * size)).powi(2)).exp();
    let normals = on_target.vertex_normals();
    let placed: Vec<Placed> = (0..on_target.vertices.len())
        .into_par_iter()
        .map(|v| {
            progress.check()?;
            let place = on_target.vertices[v];
            let point = lying_alike(on_source, place, normals[v], PULL_BACK.aside * size);
            let gap = vector::distance(place, on_source.position(&point));
            Ok(Placed {
                point,
                confidence: trust(gap),
            })
        })
        .collect::<Result<_>>()?;
    let mut map = between_matched(&source.shape, &target.shape, |p| p, trust, progress)?;
    in_given_numbering(&mut map, source, target, &placed);
    Ok(Some(FigureMap {
        map,
        unknown: 0.0,
        origin: Origin::Worn,
        landmarks: Vec::new(),
    }))
}

/// The map between what was prepared of both: each place of the target is carried onto the source, to the nearest point there,
/// and trusted by how far off it lies.
pub(super) fn between_matched(
    source: &Shape,
    target: &Shape,
    carried: impl Fn(Point) -> Point + Sync,
    trust: impl Fn(f64) -> f64,
    progress: &Progress,
) -> Result<Correspondence> {
    let there = source.given_mesh();
    let places = |mesh: &crate::mesh::Mesh| -> Vec<Point> {
        mesh.vertices.iter().map(|&p| mesh.as_given(p)).collect()
    };
    let carried = |mesh: &crate::mesh::Mesh| -> Vec<Point> {
        places(mesh).into_par_iter().map(&carried).collect()
    };
    let faces: Vec<[i64; 3]> = there.faces.iter().map(|f| f.map(i64::from)).collect();
    let surface = Surface::new(places(there), &faces)?;
    let found: Vec<_> = carried(target.given_mesh())
        .par_iter()
        .map(|&place| {
            let point = surface.nearest(place);
            (point, vector::distance(place, surface.position(&point)))
        })
        .collect();
    let trust: Vec<f64> = found.iter().map(|&(_, gap)| trust(gap)).collect();
    let points = found.into_iter().map(|(point, _)| point).collect();
    let (own, other) = (carried(&target.mesh), places(&source.mesh));
    let images = PointMaps {
        target_to_source: SpaceTree::new(&other).nearest_to_each(&own),
        source_to_target: SpaceTree::new(&own).nearest_to_each(&other),
    };
    let maps = images.as_slices();
    Correspondence::of_points(source, target, points, &trust, maps, progress)
}

/// Whether the target is worn by the source.
fn is_worn(source: &Surface, target: &Surface) -> bool {
    let size = vector::extent(&source.vertices);
    let asked = spread(target, WORN.asked);
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
    if median * size > WORN.largest_gap * vector::extent(&target.vertices) {
        return false;
    }
    if along < WORN.runs_along * gaps.len() as f64 {
        return false;
    }
    let outside = outside as f64 / gaps.len() as f64;
    let on_one_side = outside.max(1.0 - outside);
    let is_close =
        median <= WORN.close[0] && most <= WORN.close[1] && on_one_side >= WORN.on_one_side;
    let is_layer = median <= WORN.layer[0]
        && most <= WORN.layer[1]
        && most <= WORN.even * median
        && on_one_side >= WORN.layer_on_one_side;
    if !is_close && !is_layer {
        return false;
    }
    // What reaches as far as the source everywhere is another body about it.
    if sticking_out(source, target) < WORN.sticking_out * size {
        return false;
    }
    let asked = spread(source, WORN.asked);
    let uncovered = below(target, source, &asked).filter(|b| b.gap / size > WORN.covered + median);
    uncovered.count() as f64 >= WORN.uncovered * asked.len() as f64
}

/// How far a surface sticks out of the box of another along an axis at most, negative where it lies within it.
fn sticking_out(surface: &Surface, other: &Surface) -> f64 {
    let [[low, high], [other_low, other_high]] = [surface, other].map(|surface| {
        let triangles = 0..surface.triangles.len() as u32;
        vector::bounds(triangles.flat_map(|t| surface.corners(t)))
    });
    [vector::sub(other_low, low), vector::sub(high, other_high)]
        .into_iter()
        .flatten()
        .fold(f64::NEG_INFINITY, f64::max)
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
pub(super) fn spread(surface: &Surface, count: usize) -> Vec<(Point, u32)> {
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

    /// It leaves a quarter of the tube uncovered, on the inner side of the ring, and reaches as far as the tube does.
    #[test]
    fn what_reaches_as_far_as_the_other_is_not_worn() {
        let body = rings(RINGS, 0.0, 0.0);
        let (vertices, faces) = torus_mesh(RINGS, &[], 0.03);
        let is_outer = |f: &&[i64; 3]| {
            f.iter().all(|&v| {
                let [x, y, _] = vertices[v as usize];
                x.hypot(y) > 0.85
            })
        };
        let outer: Vec<[i64; 3]> = faces.iter().filter(is_outer).copied().collect();
        let around = Surface::new(vertices.clone(), &outer).expect("a surface");
        assert!(!is_worn(&body, &around));
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
        let places = spread(&body, WORN.asked);
        assert!(places.len().abs_diff(WORN.asked) <= 1);
        for &(place, _) in &places {
            let gap = vector::distance(place, body.position(&body.nearest(place)));
            // Rounding of coordinates up to 1.5.
            assert!(gap < 1e-7, "{gap}");
        }
    }
}
