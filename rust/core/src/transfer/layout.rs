//! UV maps: carried to the target's corners, joined where the target's faces agree, and judged.

use std::collections::{HashMap, HashSet};
use std::ops::Range;

use rayon::prelude::*;

use crate::algebra::unions::Unions;
use crate::algebra::vector::{self, Point};
use crate::error::Result;
use crate::transfer::corners::{self, CornerPlace, CornerValues, Polygons};
use crate::transfer::settings::LAYOUT;
use crate::transfer::surface::Surface;
use crate::transfer::surface_map::SurfaceMap;

/// A UV map on the target.
#[derive(Debug)]
pub struct Layout {
    /// UV of each corner.
    pub uv: Vec<[f64; 2]>,
    /// Source island from which each face took its UVs.
    pub island: Vec<u32>,
    /// Whether a face straddles the image of a seam, so that some of its corners are extrapolated.
    pub straddles: Vec<bool>,
}

/// Carries a UV map: `source_uv` are the corners of the source's triangles, `(m, 3)`.
///
/// # Errors
/// [`crate::Error::BadArgument`] when there are not three UVs for each source triangle.
pub fn carried_layout(
    map: &SurfaceMap,
    faces: &Polygons,
    source_uv: &[[f64; 2]],
) -> Result<Layout> {
    let values = CornerValues {
        values: source_uv.as_flattened(),
        channels: 2,
        tolerance: LAYOUT.uv_rounding,
    };
    let mut places = corners::corner_places(map, faces, &values, true)?;
    let islands = corners::islands(&map.source, &values.open(&map.source));
    hold_back(map, faces, source_uv, &islands, &mut places)?;
    let flat = corners::corner_values(&places, &values);
    let mut uv: Vec<[f64; 2]> = flat.chunks_exact(2).map(|c| [c[0], c[1]]).collect();
    let displaced: Vec<bool> = places.iter().map(|p| p.displaced).collect();
    join(&mut uv, &displaced, faces);
    let rows = || (0..faces.len()).map(|f| faces.starts[f] as usize..faces.starts[f + 1] as usize);
    Ok(Layout {
        uv,
        island: rows()
            .map(|r| islands[places[r.start].point.face as usize])
            .collect(),
        straddles: rows()
            .map(|mut r| r.any(|corner| displaced[corner]))
            .collect(),
    })
}

/// Takes corners that were extrapolated onto another island of the chart back to the border of
/// their own, so that no face shows two islands. Where islands lie over each other in UV, a corner
/// that is on its own as well stays.
fn hold_back(
    map: &SurfaceMap,
    faces: &Polygons,
    source_uv: &[[f64; 2]],
    islands: &[u32],
    places: &mut [CornerPlace],
) -> Result<()> {
    let flat = source_uv.iter().map(|c| [c[0], c[1], 0.0]).collect();
    let triangles: Vec<[i64; 3]> = (0..source_uv.len() as i64 / 3)
        .map(|t| [0, 1, 2].map(|k| 3 * t + k))
        .collect();
    let chart = Surface::new(flat, &triangles)?;
    places
        .par_iter_mut()
        .zip(&faces.vertices)
        .filter(|(place, _)| place.displaced)
        .for_each(|(place, &vertex)| {
            let face = place.point.face;
            let at = chart.position(&place.point);
            let covers = |own: bool| {
                chart
                    .nearest_where(at, None, |t| {
                        (islands[t as usize] == islands[face as usize]) == own
                    })
                    .is_some_and(|p| vector::distance(chart.position(&p), at) <= LAYOUT.uv_rounding)
            };
            if !covers(true) && covers(false) {
                let image = map.images()[vertex as usize];
                place.point.weights = map.source.to_triangle(image, face).1;
            }
        });
    Ok(())
}

/// Gives corners that neighbouring faces place almost alike one common UV.
///
/// Extrapolated corners follow those that lie on their own image.
fn join(uv: &mut [[f64; 2]], displaced: &[bool], faces: &Polygons) {
    let mut sides: HashMap<(u32, u32), (usize, usize)> = HashMap::new();
    let mut groups = Unions::new(uv.len());
    for f in 0..faces.len() {
        let (begin, end) = (faces.starts[f] as usize, faces.starts[f + 1] as usize);
        for i in begin..end {
            let j = if i + 1 == end { begin } else { i + 1 };
            let (a, b) = (faces.vertices[i], faces.vertices[j]);
            // Corners in the order of their vertices' numbers.
            let (low, high) = if a < b { (i, j) } else { (j, i) };
            let key = (a.min(b), a.max(b));
            let Some((other_low, other_high)) = sides.insert(key, (low, high)) else {
                continue;
            };
            let length = gap(uv[low], uv[high]).min(gap(uv[other_low], uv[other_high]));
            let room = LAYOUT.agreement * length + LAYOUT.uv_rounding;
            if gap(uv[low], uv[other_low]) <= room && gap(uv[high], uv[other_high]) <= room {
                groups.unite(low as u32, other_low as u32);
                groups.unite(high as u32, other_high as u32);
            }
        }
    }
    let mut sums: HashMap<u32, [f64; 3]> = HashMap::new();
    for extrapolated in [false, true] {
        let settled: HashSet<u32> = sums.keys().copied().collect();
        for (i, place) in uv.iter().enumerate() {
            let root = groups.root(i as u32);
            if displaced[i] == extrapolated && !settled.contains(&root) {
                let sum = sums.entry(root).or_default();
                *sum = [sum[0] + place[0], sum[1] + place[1], sum[2] + 1.0];
            }
        }
    }
    for (i, place) in uv.iter_mut().enumerate() {
        let [u, v, count] = sums[&groups.root(i as u32)];
        *place = [u / count, v / count];
    }
}

fn gap(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// How a layout sits on its surface. Coverage are of the area in UV.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LayoutReport {
    /// Mean over the surface of the larger of σ₁ and 1/σ₂, the singular values of the map from
    /// surface to UV at equal total areas: 1 where nothing is stretched.
    pub stretch: f64,
    /// Share of the area wound against most of the rest.
    pub flipped: f64,
    /// Share of the covered texels of a grid, 1024 × 1024 to a unit of UV, that more than one triangle
    /// covers; coarser where the layout goes over more than 16 units.
    pub overlap: f64,
}

/// Measures a layout: corner positions and UVs of triangles, `(m, 3)` each.
#[must_use]
pub fn judged(corners: &[[Point; 3]], uv: &[[[f64; 2]; 3]]) -> LayoutReport {
    let signed: Vec<f64> = uv.iter().map(|t| signed_area(*t)).collect();
    let areas: Vec<f64> = corners
        .iter()
        .map(|[a, b, c]| {
            vector::norm(vector::cross(vector::sub(*b, *a), vector::sub(*c, *a))) / 2.0
        })
        .collect();
    let total: f64 = areas.iter().sum();
    let covered: f64 = signed.iter().map(|a| a.abs()).sum();
    let positive: f64 = signed.iter().filter(|a| **a > 0.0).sum();
    let flipped = positive.min(covered - positive) / covered.max(f64::MIN_POSITIVE);
    let unit = (total / covered.max(f64::MIN_POSITIVE)).sqrt();
    let mut stretch = 0.0;
    let mut weight = 0.0;
    for ((corner, uv), &area) in corners.iter().zip(uv).zip(&areas) {
        if let Some((large, small)) = singular_values(corner, uv, unit) {
            stretch += area * large.max(1.0 / small.max(LAYOUT.smallest_stretch));
            weight += area;
        }
    }
    LayoutReport {
        stretch: stretch / f64::max(weight, f64::MIN_POSITIVE),
        flipped,
        overlap: overlap(uv),
    }
}

fn signed_area([a, b, c]: [[f64; 2]; 3]) -> f64 {
    ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])) / 2.0
}

/// σ₁ ≥ σ₂ of the map from a triangle's plane to UV, times `unit`.
fn singular_values(corner: &[Point; 3], uv: &[[f64; 2]; 3], unit: f64) -> Option<(f64, f64)> {
    let (u, v) = (
        vector::sub(corner[1], corner[0]),
        vector::sub(corner[2], corner[0]),
    );
    let (uu, uv_, vv) = (vector::dot(u, u), vector::dot(u, v), vector::dot(v, v));
    let determinant = uu * vv - uv_ * uv_;
    if determinant <= f64::EPSILON * uu * vv {
        return None;
    }
    let step = |k: usize| [uv[k][0] - uv[0][0], uv[k][1] - uv[0][1]];
    let (p, q) = (step(1), step(2));
    // Invariants of JᵀJ in the metric of the triangle.
    let dot = |a: [f64; 2], b: [f64; 2]| a[0] * b[0] + a[1] * b[1];
    let trace = (vv * dot(p, p) - 2.0 * uv_ * dot(p, q) + uu * dot(q, q)) / determinant;
    let product = (p[0] * q[1] - p[1] * q[0]).powi(2) / determinant;
    let root = (trace * trace - 4.0 * product).max(0.0).sqrt();
    Some((
        unit * f64::midpoint(trace, root).sqrt(),
        unit * ((trace - root) / 2.0).max(0.0).sqrt(),
    ))
}

/// Share of covered texels that are covered twice; a texel is covered where its centre is.
fn overlap(uv: &[[[f64; 2]; 3]]) -> f64 {
    let finite = |t: &&[[f64; 2]; 3]| t.as_flattened().iter().all(|x| x.is_finite());
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    let mut looked_at = 0.0;
    for triangle in uv.iter().filter(finite) {
        let [(left, right), (bottom, top)] = [0, 1].map(|k| {
            let [a, b, c] = triangle.map(|corner| corner[k]);
            (a.min(b).min(c), a.max(b).max(c))
        });
        low = [low[0].min(left.floor()), low[1].min(bottom.floor())];
        high = [high[0].max(right.ceil()), high[1].max(top.ceil())];
        looked_at += (right - left) * (top - bottom);
    }
    // Whole units, one at least, so that all in one tile is counted as on its image.
    let size = [0, 1].map(|k| (high[k] - low[k]).max(1.0));
    let units = looked_at.max(size[0] * size[1]).max(LAYOUT.overlap_units);
    let most = LAYOUT.overlap_units * LAYOUT.overlap_grid * LAYOUT.overlap_grid;
    let grid = (most / units).sqrt().min(most / size[0].max(size[1]));
    let [columns, rows] = size.map(|x| (x * grid).ceil() as usize);
    let mut counts = vec![0u8; columns * rows];
    for triangle in uv.iter().filter(finite) {
        let texels = triangle.map(|c| [0, 1].map(|k| (c[k] - low[k]) * grid));
        scan_rows(texels, 0..rows as i64, 0..columns as i64, |x, y, _| {
            let count = &mut counts[y as usize * columns + x as usize];
            *count = count.saturating_add(1);
        });
    }
    let covered = counts.iter().filter(|&&c| c > 0).count();
    let twice = counts.iter().filter(|&&c| c > 1).count();
    twice as f64 / covered.max(1) as f64
}

/// Visits the pixels of some rows and columns whose centres lie in a triangle, with the weights of
/// its corners.
///
/// A centre on a common edge of two triangles belongs to one of them (the top-left rule), so that
/// neighbours never cover a pixel twice and never leave one out.
pub fn scan_rows(
    triangle: [[f64; 2]; 3],
    rows: Range<i64>,
    columns: Range<i64>,
    mut visit: impl FnMut(i64, i64, [f64; 3]),
) {
    let [a, mut b, mut c] = triangle;
    let mut area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    if area == 0.0 || !area.is_finite() {
        return;
    }
    let turned = area < 0.0;
    if turned {
        std::mem::swap(&mut b, &mut c);
        area = -area;
    }
    let low = |k: usize| a[k].min(b[k]).min(c[k]);
    let high = |k: usize| a[k].max(b[k]).max(c[k]);
    let side = |p: [f64; 2], q: [f64; 2], x: f64, y: f64| {
        // Computed from the same end for both triangles of an edge: the same bits, other sign.
        if (p[0], p[1]) < (q[0], q[1]) {
            (q[0] - p[0]) * (y - p[1]) - (q[1] - p[1]) * (x - p[0])
        } else {
            -((p[0] - q[0]) * (y - q[1]) - (p[1] - q[1]) * (x - q[0]))
        }
    };
    let owned = |p: [f64; 2], q: [f64; 2]| q[1] < p[1] || (q[1] == p[1] && q[0] > p[0]);
    let edges = [(b, c), (c, a), (a, b)];
    let within = |k: usize, limits: &Range<i64>| {
        let (first, last) = ((low(k) - 0.5).ceil() as i64, (high(k) - 0.5).floor() as i64);
        first.max(limits.start)..last.saturating_add(1).min(limits.end)
    };
    for y in within(1, &rows) {
        for x in within(0, &columns) {
            let at = edges.map(|(p, q)| side(p, q, x as f64 + 0.5, y as f64 + 0.5));
            let inside = at
                .iter()
                .zip(edges)
                .all(|(&s, (p, q))| s > 0.0 || (s == 0.0 && owned(p, q)));
            if inside {
                let [wa, wb, wc] = at.map(|s| s / area);
                visit(x, y, if turned { [wa, wc, wb] } else { [wa, wb, wc] });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_triangles_of_a_square_cover_every_pixel_once() {
        let (a, b, c, d) = ([0.5, 0.5], [8.5, 0.5], [8.5, 8.5], [0.5, 8.5]);
        for split in [
            [[a, b, c], [a, c, d]],
            [[a, b, d], [d, b, c]],
            [[a, c, b], [d, c, a]],
        ] {
            let mut counts = [[0; 10]; 10];
            for triangle in split {
                scan_rows(triangle, 0..10, 0..10, |x, y, w| {
                    counts[y as usize][x as usize] += 1;
                    assert!((w.iter().sum::<f64>() - 1.0).abs() < 1e-12);
                });
            }
            assert_eq!(counts.iter().flatten().sum::<i32>(), 64);
            assert!(counts.iter().flatten().all(|&n| n <= 1));
        }
    }

    #[test]
    fn overlap_is_counted_whatever_lies_over_one_another() {
        let half = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
        let other = [[1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        assert_eq!(overlap(&[half, other]), 0.0);
        assert_eq!(overlap(&[half, half]), 1.0);
        // Every face on the whole square, as a new layout has it.
        assert_eq!(overlap(&vec![half; 300_000]), 1.0);
        // The same in any tile, and from tile to tile nothing lies over one another.
        for tile in [[1.0, 0.0], [-3.0, 7.0], [0.0, 2000.0]] {
            let moved = half.map(|c| [c[0] + tile[0], c[1] + tile[1]]);
            assert_eq!(overlap(&[moved, moved]), 1.0);
            assert_eq!(overlap(&[half, moved]), 0.0);
        }
    }

    /// A band of squares two to a unit, cut into triangles; `shift` moves its inner columns.
    fn band(columns: usize, shift: f64) -> (Vec<Point>, Vec<[i64; 3]>) {
        let vertices = (0..2 * (columns + 1))
            .map(|i| {
                let (x, y) = ((i / 2) as f64, (i % 2) as f64);
                let inner = i / 2 > 0 && i / 2 < columns;
                let x = 2.0 * x / columns as f64 + if inner { shift } else { 0.0 };
                [x, y, 0.0]
            })
            .collect();
        let triangles = (0..columns as i64)
            .flat_map(|c| {
                let i = 2 * c;
                [[i, i + 2, i + 3], [i, i + 3, i + 1]]
            })
            .collect();
        (vertices, triangles)
    }

    #[test]
    fn a_face_beside_a_seam_does_not_reach_into_the_island_beyond_it() {
        // Left half to u < 1, right half turned round to 1 < u < 2: the islands touch in UV at u = 1,
        // where the left one has its seam and the right one its far end.
        let (vertices, triangles) = band(8, 0.0);
        let source_uv: Vec<[f64; 2]> = triangles
            .iter()
            .flat_map(|t| {
                let corners = t.map(|v| vertices[v as usize]);
                let right = corners.iter().map(|p| p[0]).sum::<f64>() > 3.0;
                corners.map(|p| [if right { 3.0 - p[0] } else { p[0] }, p[1]])
            })
            .collect();
        let (moved, other) = band(8, 0.1);
        let surface = Surface::new(vertices, &triangles).expect("two triangles a square");
        let (faces, weights): (Vec<i64>, Vec<[f64; 3]>) = moved
            .iter()
            .map(|&p| {
                let point = surface.nearest(p);
                (i64::from(point.face), point.weights)
            })
            .unzip();
        let starts: Vec<i64> = (0..=other.len() as i64).map(|f| 3 * f).collect();
        let target = Surface::new(moved.clone(), &other).expect("two triangles a square");
        let polygons = Polygons::new(&starts, other.as_flattened(), &target).expect("triangles");
        let sure = vec![1.0; moved.len()];
        let map = SurfaceMap::new(surface, target, &faces, &weights, sure).expect("a plain map");
        let layout = carried_layout(&map, &polygons, &source_uv).expect("three corners each");
        assert!(layout.straddles.iter().any(|&s| s));
        for (face, uv) in layout.uv.chunks_exact(3).enumerate() {
            let left = uv.iter().all(|c| c[0] <= 1.0 + LAYOUT.uv_rounding);
            let right = uv.iter().all(|c| c[0] >= 1.0 - LAYOUT.uv_rounding);
            assert!(left || right, "face {face}: {uv:?}");
        }
    }

    #[test]
    fn a_plain_layout_has_no_faults_and_a_folded_one_has() {
        let square = [
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [1.0, 1.0, 0.0],
            [0.0, 1.0, 0.0],
        ];
        let corners = [
            [square[0], square[1], square[2]],
            [square[0], square[2], square[3]],
        ];
        let flat = |p: Point| [p[0] / 2.0, p[1] / 2.0];
        let plain = judged(&corners, &corners.map(|t| t.map(flat)));
        assert!(
            (plain.stretch - 1.0).abs() < 1e-12 && plain.flipped == 0.0 && plain.overlap == 0.0
        );
        // The second triangle folded over the first along their diagonal.
        let folded = corners.map(|t| t.map(|p| if p[1] > p[0] { [0.5, 0.0] } else { flat(p) }));
        let report = judged(&corners, &folded);
        assert!((report.flipped - 0.5).abs() < 1e-12);
        assert!(report.overlap > 0.99);
    }
}
