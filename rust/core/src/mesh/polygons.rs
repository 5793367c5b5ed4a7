//! Polygons cut into triangles as they lie in space.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use crate::error::{Error, Result};
use crate::mesh::settings::POLYGONS;
use crate::watch::progress::Check;

/// Corners between two questions whether to stop.
const CHECKED: usize = 1 << 14;

/// Triangles of polygons, in their order: a fan where the polygon is convex, else ears are cut off, the one with the
/// shortest cut first (Meisters 1975). A polygon of k corners has k − 2 triangles, whatever it is like; what is left of
/// one that crosses itself when no corner is an ear is a fan, as is one that names a vertex that is not there.
///
/// `corners` are the polygons' vertices, one polygon after the other, `sizes` how many each has, three or more. The
/// triangles name vertices as the corners do.
///
/// # Errors
/// [`Error::BadArgument`] when a size is below three or the sizes do not add up to the corners; what `check` returns.
///
/// # Panics
/// Never: sizes are checked first.
pub fn triangulate(
    vertices: &[[f64; 3]],
    corners: &[i64],
    sizes: &[i64],
    check: Check<'_>,
) -> Result<Vec<[i64; 3]>> {
    let wrong = |what: &str| Error::BadArgument {
        what: format!("`sizes` should be {what}"),
    };
    let mut left = corners.len();
    for &size in sizes {
        let size = usize::try_from(size).ok().filter(|&size| size >= 3);
        left = left
            .checked_sub(size.ok_or_else(|| wrong("3 or more"))?)
            .ok_or_else(|| wrong("as many corners as there are"))?;
    }
    if left > 0 {
        return Err(wrong("as many corners as there are"));
    }
    let mut triangles = Vec::with_capacity(corners.len() - 2 * sizes.len());
    let (mut rest, mut since) = (corners, 0);
    for &size in sizes {
        let (polygon, others) = rest.split_at(size as usize);
        rest = others;
        since += polygon.len();
        if since >= CHECKED {
            since = 0;
            check()?;
        }
        let flat = if polygon.len() > 3 {
            hollow_in_plane(vertices, polygon)
        } else {
            None
        };
        match flat {
            Some(flat) => Clipping::new(flat).cut(check, &mut |t| {
                triangles.push(t.map(|corner| polygon[corner as usize]));
            })?,
            None => triangles
                .extend((1..polygon.len() - 1).map(|k| [polygon[0], polygon[k], polygon[k + 1]])),
        }
    }
    Ok(triangles)
}

/// The corners of a hollow polygon projected along its normal, in counter-clockwise order; `None` when it is not
/// hollow, not in the range of numbers, or of more corners than are counted by 32 bits.
fn hollow_in_plane(vertices: &[[f64; 3]], polygon: &[i64]) -> Option<Vec<[f64; 2]>> {
    u32::try_from(polygon.len()).ok()?;
    let points: Vec<[f64; 3]> = polygon
        .iter()
        .map(|&id| vertices.get(usize::try_from(id).ok()?).copied())
        .collect::<Option<_>>()?;
    let count = points.len();
    let mean = |axis: usize| points.iter().map(|p| p[axis]).sum::<f64>() / count as f64;
    let centre = [mean(0), mean(1), mean(2)];
    let points: Vec<[f64; 3]> = points
        .iter()
        .map(|p| [p[0] - centre[0], p[1] - centre[1], p[2] - centre[2]])
        .collect();
    // Newell's normal: right for polygons that are hollow or not quite plane.
    let mut normal = [0.0; 3];
    for k in 0..count {
        let turn = cross(points[k], points[(k + 1) % count]);
        (0..3).for_each(|axis| normal[axis] += turn[axis]);
    }
    let along = |k: usize| {
        let (a, b, c) = (
            points[(k + count - 1) % count],
            points[k],
            points[(k + 1) % count],
        );
        let turn = cross(minus(b, a), minus(c, b));
        turn[0] * normal[0] + turn[1] * normal[1] + turn[2] * normal[2]
    };
    let (mut least, mut largest) = (f64::INFINITY, 0.0_f64);
    for turn in (0..count).map(along) {
        if !turn.is_finite() {
            return None;
        }
        least = least.min(turn);
        largest = largest.max(turn.abs());
    }
    if least >= -POLYGONS.hollow * largest {
        return None;
    }
    let axis = (0..3)
        .max_by(|&a, &b| normal[a].abs().total_cmp(&normal[b].abs()))
        .expect("three axes");
    let (first, second) = match (axis, normal[axis] > 0.0) {
        (0, true) => (1, 2),
        (0, false) => (2, 1),
        (1, true) => (2, 0),
        (1, false) => (0, 2),
        (_, true) => (0, 1),
        (_, false) => (1, 0),
    };
    Some(points.iter().map(|p| [p[first], p[second]]).collect())
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// An ear that may be cut off; one whose neighbours are others by now is of the past.
struct Ear {
    /// Square of the cut's length.
    cut: f64,
    corner: u32,
    before: u32,
    after: u32,
}

impl Ord for Ear {
    /// The shortest cut is the greatest, of equal ones that of the first corner.
    fn cmp(&self, other: &Self) -> Ordering {
        let shorter = other.cut.total_cmp(&self.cut);
        shorter.then_with(|| other.corner.cmp(&self.corner))
    }
}

impl PartialOrd for Ear {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Ear {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Ear {}

/// A polygon in the plane while ears are cut off.
struct Clipping {
    flat: Vec<[f64; 2]>,
    before: Vec<u32>,
    after: Vec<u32>,
    is_left: Vec<bool>,
    /// Only hollow corners can lie in an ear.
    is_hollow: Vec<bool>,
    /// Corners by their place along each axis; those that were cut off go when they are half of them.
    sorted: [Vec<u32>; 2],
    left: usize,
    looks: usize,
}

impl Clipping {
    fn new(flat: Vec<[f64; 2]>) -> Self {
        let count = u32::try_from(flat.len()).expect("larger polygons are fans");
        let mut clipping = Self {
            before: (0..count).map(|k| (k + count - 1) % count).collect(),
            after: (0..count).map(|k| (k + 1) % count).collect(),
            is_left: vec![true; flat.len()],
            is_hollow: vec![false; flat.len()],
            sorted: [(0..count).collect(), (0..count).collect()],
            left: flat.len(),
            looks: POLYGONS.looks * flat.len(),
            flat,
        };
        clipping.sort();
        for corner in 0..count {
            clipping.is_hollow[corner as usize] = clipping.turn(corner) <= 0.0;
        }
        clipping
    }

    /// Tells every triangle.
    fn cut(mut self, check: Check<'_>, tell: &mut impl FnMut([u32; 3])) -> Result<()> {
        let mut waiting = BinaryHeap::new();
        let mut since = 0_usize;
        for _ in 0..POLYGONS.rounds {
            // Corners that were blocked may have come free.
            waiting.clear();
            for corner in 0..self.flat.len() as u32 {
                if self.is_left[corner as usize] {
                    waiting.extend(self.judge(corner));
                    since += 1;
                    if since.is_multiple_of(CHECKED) {
                        check()?;
                    }
                }
            }
            if waiting.is_empty() {
                break;
            }
            while self.left > 3
                && let Some(Ear {
                    corner,
                    before,
                    after,
                    ..
                }) = waiting.pop()
            {
                let k = corner as usize;
                if !self.is_left[k] || (self.before[k], self.after[k]) != (before, after) {
                    continue;
                }
                tell([before, corner, after]);
                self.drop(corner);
                waiting.extend(self.judge(before));
                waiting.extend(self.judge(after));
                since += 1;
                if since.is_multiple_of(CHECKED / 16) {
                    check()?;
                }
            }
            if self.left == 3 {
                break;
            }
        }
        let rest: Vec<u32> = (0..self.flat.len() as u32)
            .filter(|&k| self.is_left[k as usize])
            .collect();
        (1..rest.len() - 1).for_each(|k| tell([rest[0], rest[k], rest[k + 1]]));
        Ok(())
    }

    /// Twice the area of the triangle at a corner, negative when the corner is hollow.
    fn turn(&self, corner: u32) -> f64 {
        let k = corner as usize;
        let at = |k: u32| self.flat[k as usize];
        area(at(self.before[k]), at(corner), at(self.after[k]))
    }

    /// Looks at a corner anew; the ear that it is, if it is one.
    fn judge(&mut self, corner: u32) -> Option<Ear> {
        let k = corner as usize;
        let turn = self.turn(corner);
        self.is_hollow[k] = turn <= 0.0;
        let (before, after) = (self.before[k], self.after[k]);
        let (a, b, c) = (
            self.flat[before as usize],
            self.flat[k],
            self.flat[after as usize],
        );
        (turn > 0.0 && !self.has_hollow_in([a, b, c])).then(|| Ear {
            cut: (c[0] - a[0]).powi(2) + (c[1] - a[1]).powi(2),
            corner,
            before,
            after,
        })
    }

    /// Whether a hollow corner lies in a triangle or on its sides, and not at one of its corners, where the doubles of
    /// a bridge to a hole lie. True when there was too much to look at.
    fn has_hollow_in(&mut self, triangle: [[f64; 2]; 3]) -> bool {
        let spans = [0, 1].map(|axis| {
            let places = triangle.map(|p| p[axis]);
            let low = places.iter().copied().fold(f64::INFINITY, f64::min);
            let high = places.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let sorted = &self.sorted[axis];
            let start = sorted.partition_point(|&k| self.flat[k as usize][axis] < low);
            let end = sorted.partition_point(|&k| self.flat[k as usize][axis] <= high);
            start..end
        });
        let axis = usize::from(spans[1].len() < spans[0].len());
        let near = spans[axis].clone();
        if near.len() > self.looks {
            self.looks = 0;
            return true;
        }
        self.looks -= near.len();
        let [a, b, c] = triangle;
        self.sorted[axis][near].iter().any(|&k| {
            let p = self.flat[k as usize];
            self.is_hollow[k as usize]
                && p != a
                && p != b
                && p != c
                && area(a, b, p) >= 0.0
                && area(b, c, p) >= 0.0
                && area(c, a, p) >= 0.0
        })
    }

    /// Takes a corner out.
    fn drop(&mut self, corner: u32) {
        let k = corner as usize;
        let (before, after) = (self.before[k], self.after[k]);
        self.after[before as usize] = after;
        self.before[after as usize] = before;
        (self.is_left[k], self.is_hollow[k]) = (false, false);
        self.left -= 1;
        if 2 * self.left < self.sorted[0].len() {
            self.sort();
        }
    }

    fn sort(&mut self) {
        for axis in 0..2 {
            let (flat, is_left) = (&self.flat, &self.is_left);
            let sorted = &mut self.sorted[axis];
            sorted.retain(|&k| is_left[k as usize]);
            // By number where places are equal, so that the order is one.
            sorted.sort_unstable_by(|&i, &j| {
                let (p, q) = (flat[i as usize][axis], flat[j as usize][axis]);
                p.total_cmp(&q).then(i.cmp(&j))
            });
        }
    }
}

/// Twice the area of a triangle, negative when it turns to the right.
fn area(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::draws;

    /// A star whose every second corner is hollow, in the plane x + y + z = 0.
    fn star(corners: usize) -> Vec<[f64; 3]> {
        let point = |k: usize| {
            let angle = std::f64::consts::TAU * k as f64 / corners as f64;
            let radius = 1.0 + (k % 2) as f64;
            let (u, v) = (radius * angle.cos(), radius * angle.sin());
            [u + v, v - u, -2.0 * v]
        };
        (0..corners).map(point).collect()
    }

    fn area_in_space(vertices: &[[f64; 3]], triangles: &[[i64; 3]]) -> (f64, [f64; 3]) {
        let (mut sum, mut normal) = (0.0, [0.0; 3]);
        for t in triangles {
            let [a, b, c] = t.map(|k| vertices[k as usize]);
            let n = cross(minus(b, a), minus(c, a));
            sum += (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt() / 2.0;
            (0..3).for_each(|axis| normal[axis] += n[axis] / 2.0);
        }
        (sum, normal)
    }

    #[test]
    fn star_is_covered_once() {
        for count in [8, 100, 2000] {
            let vertices = star(count);
            let corners: Vec<i64> = (0..count as i64).collect();
            let found = triangulate(&vertices, &corners, &[count as i64], &|| Ok(())).unwrap();
            assert_eq!(found.len(), count - 2);
            let (area, n) = area_in_space(&vertices, &found);
            // Of the fan, whose triangles overlap but add up with their signs: the true area.
            let fan: Vec<_> = (1..count as i64 - 1).map(|k| [0, k, k + 1]).collect();
            let (_, whole) = area_in_space(&vertices, &fan);
            let length = |n: [f64; 3]| (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
            assert!(
                (area - length(whole)).abs() < 1e-9 * area,
                "{area} {whole:?}"
            );
            assert!((length(n) - area).abs() < 1e-9 * area);
        }
    }

    #[test]
    fn polygons_of_all_sizes_stay_in_order() {
        let vertices: Vec<[f64; 3]> = star(20);
        let corners = [0, 1, 2, 2, 3, 99, 5, 6, 7, 8, 7, 6, 5];
        let found = triangulate(&vertices, &corners, &[3, 4, 3, 3], &|| Ok(())).unwrap();
        assert_eq!(
            found,
            [[0, 1, 2], [2, 3, 99], [2, 99, 5], [6, 7, 8], [7, 6, 5]]
        );
    }

    #[test]
    fn sizes_that_do_not_fit_are_refused() {
        for sizes in [&[2, 4][..], &[3], &[3, 4], &[-1, 7], &[i64::MAX, 3]] {
            let refused = triangulate(&[[0.0; 3]; 6], &[0; 6], sizes, &|| Ok(()));
            assert!(
                matches!(refused, Err(Error::BadArgument { .. })),
                "{sizes:?}"
            );
        }
    }

    #[test]
    fn crossing_everywhere_ends_soon_and_can_be_stopped() {
        // Corners by a multiplicative generator, far from each other: hardly one is an ear.
        let mut draw = draws(1);
        let mut next = || f64::from(draw());
        let vertices: Vec<[f64; 3]> = (0..3000).map(|_| [next(), next(), 0.0]).collect();
        let corners: Vec<i64> = (0..3000).collect();
        let found = triangulate(&vertices, &corners, &[3000], &|| Ok(())).unwrap();
        assert_eq!(found.len(), 2998);
        let stopped = triangulate(&vertices, &corners.repeat(6), &[3000; 6], &|| {
            Err(Error::Cancelled)
        });
        assert_eq!(stopped, Err(Error::Cancelled));
    }
}
