//! Generalised winding number of a soup of triangles, by a tree of multipoles.
//!
//! ```text
//! w(q) = 1/4π Σ_t Ω_t(q)          Ω_t: signed solid angle of triangle t from q
//!      ≈ 1/4π Σ_nodes  N·R/R³ + tr M/R³ − 3 RᵀMR/R⁵
//! R = c − q,   N = Σ a n,   M = Σ a n (x − c)ᵀ
//! ```
//!
//! with area a, unit normal n and centroid x of each triangle, about the centre of area c of a node that is farther than
//! `WINDING.opening` of its radii from q. 1 inside a closed surface with outward normals, 0 outside, ±1/2 on both sides of a wide
//! open sheet, and in between where something is missing.
//!
//! # Source
//! Jacobson, Kavan, Sorkine-Hornung, "Robust inside-outside segmentation using generalized winding numbers", 2013, for the
//! function; Barill, Dickson, Schmidt, Levin, Jacobson, "Fast winding numbers for soups and clouds", 2018, for the
//! expansion (here its first two terms); Van Oosterom, Strackee, "The solid angle of a plane triangle", 1983, for Ω.

use std::f32::consts::PI;

use super::distance::squared_from_box;
use super::place::{Place, Triangle, cross, dot, sub};
use super::tree::Tree;
use crate::algebra::dense::vectorised;
use crate::envelope::settings::WINDING;

/// Largest error of a winding number by expansion and interpolation: 1/2 is what has to be told from 0 and 1.
pub(super) const EXPANSION_ERROR: f32 = 0.03;

/// Winding numbers at many points of a part of space: what is far from it varies little there.
///
/// The share of whatever is farther from the middle than `WINDING.smooth` radii of the part is found at its eight corners alone
/// and interpolated: it is harmonic, and the error of trilinear interpolation in the middle is a multiple of the Laplacian.
#[derive(Debug)]
pub(super) struct Part {
    pub middle: Place,
    /// Half of its width along each axis.
    pub half: f32,
}

/// Angles are summed as a product of complex numbers, of which only those near the negative real axis need care.
#[derive(Clone, Copy)]
struct Angles<const N: usize> {
    re: [f32; N],
    im: [f32; N],
    /// Full turns.
    turns: [f32; N],
}

impl<const N: usize> Angles<N> {
    fn new() -> Self {
        Self {
            re: [1.0; N],
            im: [0.0; N],
            turns: [0.0; N],
        }
    }

    /// Adds half of the solid angle of a triangle from each point.
    #[expect(
        clippy::needless_range_loop,
        reason = "several arrays of lanes are walked side by side"
    )]
    #[inline(always)]
    fn add(&mut self, triangle: &Triangle, points: &[[f32; N]; 3]) {
        let [first, second, third] = triangle.corners;
        for i in 0..N {
            let q = [points[0][i], points[1][i], points[2][i]];
            let (a, b, c) = (sub(first, q), sub(second, q), sub(third, q));
            let (la, lb, lc) = (dot(a, a).sqrt(), dot(b, b).sqrt(), dot(c, c).sqrt());
            let y = dot(a, cross(b, c));
            let x = la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb;
            let (re, im) = (self.re[i], self.im[i]);
            let (new_re, new_im) = (re * x - im * y, re * y + im * x);
            let up = im >= 0.0 && y >= 0.0 && new_im < 0.0;
            let down = im < 0.0 && y < 0.0 && new_im >= 0.0;
            let turn = if up { 1.0 } else { 0.0 };
            self.turns[i] += if down { -1.0 } else { turn };
            // Neither overflows nor vanishes; on an edge of the triangle both are zero, and nothing is added.
            let size = new_re.abs() + new_im.abs();
            let is_some = size > f32::MIN_POSITIVE;
            let inverse = 1.0 / if is_some { size } else { 1.0 };
            self.re[i] = if is_some { new_re * inverse } else { re };
            self.im[i] = if is_some { new_im * inverse } else { im };
        }
    }

    /// Sum of the solid angles.
    fn sums(&self) -> [f32; N] {
        std::array::from_fn(|i| 2.0 * (self.im[i].atan2(self.re[i]) + 2.0 * PI * self.turns[i]))
    }
}

impl Tree {
    /// Winding numbers at points of a part of space, by coordinate.
    pub fn winding_in<const N: usize>(&self, part: &Part, points: &[[f32; N]; 3]) -> [f32; N] {
        vectorised(
            #[inline(always)]
            || {
                let [far, near] = self.winding_sums(part, points);
                std::array::from_fn(|i| (far[i] + near[i]) / (4.0 * PI))
            },
        )
    }

    /// Sums of solid angles of what is smooth in the part, interpolated, and of the rest.
    #[inline(always)]
    fn winding_sums<const N: usize>(&self, part: &Part, points: &[[f32; N]; 3]) -> [[f32; N]; 2] {
        let radius = part.half * 3f32.sqrt();
        let sign = |corner: usize, axis: usize| if corner >> axis & 1 == 1 { 1.0 } else { -1.0 };
        let corners: [[f32; 8]; 3] = std::array::from_fn(|axis| {
            std::array::from_fn(|c| part.middle[axis] + part.half * sign(c, axis))
        });
        let mut smooth = [0.0; 8];
        let mut smooth_angles = Angles::<8>::new();
        let mut sums = [0.0; N];
        let mut angles = Angles::<N>::new();
        let mut stack = [0u32; STACK];
        let mut height = 1;
        while height > 0 {
            height -= 1;
            let number = stack[height] as usize;
            let node = &self.nodes[number];
            let apart = sub(node.moments.centre, part.middle);
            let distance = dot(apart, apart).sqrt();
            let is_smooth = squared_from_box(node.low, node.high, part.middle)
                >= (WINDING.smooth * radius).powi(2);
            if distance > WINDING.opening * node.moments.radius + radius {
                if is_smooth {
                    node.moments.add_far(&corners, &mut smooth);
                } else {
                    node.moments.add_far(points, &mut sums);
                }
            } else if let Some(triangles) = self.leaf(number) {
                for triangle in triangles {
                    if is_smooth {
                        smooth_angles.add(triangle, &corners);
                    } else {
                        angles.add(triangle, points);
                    }
                }
            } else {
                stack[height] = 2 * number as u32 + 2;
                stack[height + 1] = 2 * number as u32 + 1;
                height += 2;
            }
        }
        let corner_angles = smooth_angles.sums();
        let at_corners: [f32; 8] = std::array::from_fn(|c| smooth[c] + corner_angles[c]);
        let near = angles.sums();
        let far = std::array::from_fn(|i| {
            let t: Place = std::array::from_fn(|axis| {
                f32::midpoint((points[axis][i] - part.middle[axis]) / part.half, 1.0)
            });
            (0..8)
                .map(|c| {
                    let weight = |axis: usize| {
                        if c >> axis & 1 == 1 {
                            t[axis]
                        } else {
                            1.0 - t[axis]
                        }
                    };
                    at_corners[c] * weight(0) * weight(1) * weight(2)
                })
                .sum::<f32>()
        });
        [far, std::array::from_fn(|i| sums[i] + near[i])]
    }
}

/// Nodes that wait at most: one a level, and as many levels as there are bits in the number of a triangle.
const STACK: usize = 64;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::envelope::shapes::{self, Soup};

    /// Van Oosterom and Strackee, in double precision, over all triangles.
    fn exact(soup: &Soup, q: [f64; 3]) -> f64 {
        use crate::algebra::vector::{cross, dot, norm, sub};
        let angle = |face: &[u32; 3]| {
            let [a, b, c] = face.map(|v| sub(soup.vertices[v as usize], q));
            let (la, lb, lc) = (norm(a), norm(b), norm(c));
            let over = dot(a, cross(b, c));
            let under = la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb;
            2.0 * over.atan2(under)
        };
        soup.faces.iter().map(angle).sum::<f64>() / (4.0 * std::f64::consts::PI)
    }

    /// Largest difference from the exact sum, and the winding numbers, at eight points in each of many parts.
    fn compared(soup: &Soup) -> (f64, Vec<([f64; 3], f64)>) {
        let tree = Tree::new(&soup.triangles());
        let (mut worst, mut found) = (0f64, Vec::new());
        let half = 0.015;
        for n in 0..1000usize {
            let at = [n % 10, n / 10 % 10, n / 100].map(|x| 0.137 * x as f32 - 0.611);
            let points: [[f32; 8]; 3] = std::array::from_fn(|axis| {
                std::array::from_fn(|i| at[axis] + half * (0.77 * (i * (axis + 2)) as f32).sin())
            });
            let windings = tree.winding_in(&Part { middle: at, half }, &points);
            for i in 0..8 {
                let q = points.map(|x| f64::from(x[i]));
                worst = worst.max((f64::from(windings[i]) - exact(soup, q)).abs());
                found.push((q, f64::from(windings[i])));
            }
        }
        (worst, found)
    }

    #[test]
    fn winding_numbers_are_those_of_all_solid_angles() {
        let open = shapes::open_box([0.8, 0.6, 1.0]);
        for soup in [shapes::sphere(0.5, 60), shapes::torus(0.35, 0.15, 60), open] {
            let (worst, _) = compared(&soup);
            assert!(worst < f64::from(EXPANSION_ERROR), "{worst}");
        }
    }

    #[test]
    fn a_closed_surface_winds_once_around_what_is_inside() {
        let sphere = shapes::sphere(0.5, 60);
        for (q, w) in compared(&sphere).1 {
            let r = crate::algebra::vector::norm(q);
            // Between, the facets are inside the sphere by 1 − cos(π/60) of its radius.
            if (r - 0.5).abs() > 0.002 {
                let expected = if r < 0.5 { 1.0 } else { 0.0 };
                assert!(
                    (w - expected).abs() < f64::from(EXPANSION_ERROR),
                    "{w} at {r}"
                );
            }
        }
        // From the centre of a cube its six sides have equal solid angles; one is missing.
        let tree = Tree::new(&shapes::open_box([1.0, 1.0, 1.0]).triangles());
        let points = [[0.0], [0.0], [0.0]];
        let centre = tree.winding_in(
            &Part {
                middle: [0.0; 3],
                half: 0.01,
            },
            &points,
        );
        assert!((centre[0] - 5.0 / 6.0).abs() < 1e-5, "{}", centre[0]);
    }
}
