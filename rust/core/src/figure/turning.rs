//! Whether a surface is the same after a turn about an axis, by how it lies.
//!
//! Such a turn leaves the centroid and the tensor of second moments alone, so its axis is a principal one wherever the moments
//! differ. Where two of them are equal, as of prisms of three sides and more, most axes are not found here; eigenvalues of the
//! Laplace operator then come in pairs, which [`Eigenbasis::repeated`](crate::spectrum::eigenbasis::Eigenbasis::repeated) counts.
//! Where all three are equal, as of a cube or a jack, every axis is a principal one, and the sixth moments tell: such turns leave
//! ∫ (n·x)⁶ alone too, so that directions n in which it is largest are axes of turns, as of a cube through corners, of a jack
//! along arms.

use std::f64::consts::TAU;

use faer::{Mat, Side};

use super::worn::spread;
use crate::algebra::dense::clearing_registers;
use crate::algebra::vector::{self, Point};
use crate::figure::settings::TURNING;
use crate::mesh::Mesh;
use crate::transfer::Surface;

/// Turns by a part of a full one that are tried: each group of turns has one of prime order. Of what is the same after a
/// smaller part nothing but equal pairs of eigenvalues is known to tell.
const PARTS: [f64; 6] = [2.0, 3.0, 5.0, 7.0, 11.0, 13.0];

/// Steps towards the direction of the largest sixth moment; 12 were the most that a jack took to rest within 1e-9.
const STEPS: usize = 30;

/// Whether some turn about a principal axis takes a mesh onto itself.
pub(super) fn turns_onto_itself(mesh: &Mesh) -> bool {
    let faces: Vec<[i64; 3]> = mesh.faces.iter().map(|f| f.map(i64::from)).collect();
    let Ok(surface) = Surface::new(mesh.vertices.clone(), &faces) else {
        return false;
    };
    let Some((centre, axes)) = principal_axes(&surface) else {
        return false;
    };
    let asked = spread(&surface, TURNING.asked);
    // On this thread alone: a grade is asked for outside of a match, and in a process that was forked there is no other.
    let is_same = |axis: Point, angle: f64| {
        let most = TURNING.mean * asked.len() as f64;
        let mut sum = 0.0;
        let mut apart = Vec::with_capacity(asked.len());
        for &(place, _) in &asked {
            let off = vector::sub(place, centre);
            let turned = vector::add(centre, turned(off, axis, angle));
            let distance = vector::distance(turned, surface.position(&surface.nearest(turned)));
            sum += distance;
            // At unit area; of most turns the first few places tell.
            if sum >= most || sum.is_nan() {
                return false;
            }
            apart.push(distance);
        }
        apart.sort_by(f64::total_cmp);
        let nearly_all = apart[(TURNING.quantile * (apart.len() - 1) as f64) as usize];
        nearly_all < TURNING.nearly_all
    };
    !asked.is_empty()
        && axes
            .iter()
            .any(|&axis| PARTS.iter().any(|part| is_same(axis, TAU / part)))
}

/// Whether no turn about an axis through the centroid leaves some points where they are, nearly.
///
/// A turn that takes a surface onto itself has such an axis, since it leaves the centroid alone. The root of the points'
/// squared distances from the axis that lies nearest to them, ∑|p|² less the largest eigenvalue of ∑ p pᵀ, tells.
pub(super) fn are_off_every_axis(mesh: &Mesh, points: impl Iterator<Item = Point>) -> bool {
    let faces: Vec<[i64; 3]> = mesh.faces.iter().map(|f| f.map(i64::from)).collect();
    let Ok(surface) = Surface::new(mesh.vertices.clone(), &faces) else {
        return false;
    };
    let Some((centre, _)) = principal_axes(&surface) else {
        return false;
    };
    off_every_axis(points.map(|p| vector::sub(p, centre))) > TURNING.off
}

/// Root of the sum of squared distances from the line through the origin that lies nearest to some points.
fn off_every_axis(points: impl Iterator<Item = Point>) -> f64 {
    let mut moments = [[0.0; 3]; 3];
    for p in points {
        for (row, x) in moments.iter_mut().zip(p) {
            *row = vector::add(*row, vector::scaled(p, x));
        }
    }
    let matrix = Mat::from_fn(3, 3, |i, j| moments[i][j]);
    // Ascending.
    match clearing_registers(|| matrix.self_adjoint_eigenvalues(Side::Lower)) {
        Ok(found) => (found[0] + found[1]).max(0.0).sqrt(),
        Err(_) => 0.0,
    }
}

/// Centroid and principal axes of the area; nothing where there is none.
fn principal_axes(surface: &Surface) -> Option<(Point, [Point; 3])> {
    let triangles = 0..surface.triangles.len() as u32;
    let area = |t: u32| vector::norm(surface.cross(t)) / 2.0;
    let middle =
        |[a, b, c]: [Point; 3]| vector::scaled(vector::add(a, vector::add(b, c)), 1.0 / 3.0);
    let (mut total, mut sum) = (0.0, [0.0; 3]);
    for t in triangles.clone() {
        total += area(t);
        sum = vector::add(sum, vector::scaled(middle(surface.corners(t)), area(t)));
    }
    let centre = vector::scaled(sum, 1.0 / total);
    // ∫ x xᵀ over a triangle is area · (Σ corners + 9 · middle) / 12, each as its square.
    let weighted: Vec<(Point, f64)> = triangles
        .flat_map(|t| {
            let corners = surface.corners(t).map(|p| vector::sub(p, centre));
            let each = area(t) / (12.0 * total);
            let middle = (middle(corners), 9.0 * each);
            corners.map(|p| (p, each)).into_iter().chain([middle])
        })
        .collect();
    let mut moments = [[0.0; 3]; 3];
    for &(p, weight) in &weighted {
        for (row, x) in moments.iter_mut().zip(p) {
            *row = vector::add(*row, vector::scaled(p, x * weight));
        }
    }
    if !moments.as_flattened().iter().all(|x| x.is_finite()) {
        return None;
    }
    let matrix = Mat::from_fn(3, 3, |i, j| moments[i][j]);
    let eigen = clearing_registers(|| matrix.self_adjoint_eigen(Side::Lower)).ok()?;
    let mut axes = [0, 1, 2].map(|j| [0, 1, 2].map(|i| eigen.U()[(i, j)]));
    if eigen.S()[2] - eigen.S()[0] < TURNING.equal * eigen.S()[2] {
        axes = axes.map(|axis| largest_sixth_moment(&weighted, axis));
    }
    Some((centre, axes))
}

/// The direction n in which ∑ w (n·p)⁶ is largest near a given one: as that is convex, its gradient leads upwards always.
fn largest_sixth_moment(weighted: &[(Point, f64)], start: Point) -> Point {
    (0..STEPS).fold(start, |n, _| {
        let gradient = weighted.iter().fold([0.0; 3], |sum, &(p, weight)| {
            vector::add(sum, vector::scaled(p, weight * vector::dot(n, p).powi(5)))
        });
        vector::normalised(gradient)
    })
}

/// A direction turned about a unit axis, by Rodrigues' formula.
fn turned(off: Point, axis: Point, angle: f64) -> Point {
    let along = vector::scaled(axis, vector::dot(axis, off) * (1.0 - angle.cos()));
    let across = vector::scaled(vector::cross(axis, off), angle.sin());
    vector::add(vector::scaled(off, angle.cos()), vector::add(across, along))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A box whose sides differ.
    fn block() -> Surface {
        let vertices: Vec<Point> = (0..8_i32)
            .map(|i| {
                [
                    f64::from(i & 1),
                    1.5 * f64::from((i >> 1) & 1),
                    2.5 * f64::from(i >> 2),
                ]
            })
            .collect();
        let sides = [
            [0, 2, 3, 1],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 4, 6, 2],
            [1, 3, 7, 5],
        ];
        let halves = sides
            .iter()
            .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]);
        Surface::new(vertices, &halves.collect::<Vec<[i64; 3]>>()).unwrap()
    }

    #[test]
    fn axes_of_a_box_are_its_own() {
        let (centre, axes) = principal_axes(&block()).unwrap();
        assert!(vector::distance(centre, [0.5, 0.75, 1.25]) < 1e-12);
        for axis in axes {
            // Nothing but rounding is left.
            let largest = axis.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
            assert!((largest - 1.0).abs() < 1e-12, "{axis:?}");
        }
    }

    #[test]
    fn axes_of_an_octahedron_lead_to_its_corners() {
        let axis = vector::normalised([1.0, 2.0, -0.5]);
        let own = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|p| turned(p, axis, 0.7));
        let corners: Vec<Point> = (0..6)
            .map(|i| vector::scaled(own[i / 2], if i % 2 == 0 { 1.0 } else { -1.0 }))
            .collect();
        let faces: Vec<[i64; 3]> = (0..8)
            .map(|i| [i & 1, 2 + ((i >> 1) & 1), 4 + (i >> 2)])
            .collect();
        let (_, axes) = principal_axes(&Surface::new(corners, &faces).unwrap()).unwrap();
        for found in axes {
            let nearest = own.iter().map(|&p| vector::dot(found, p).abs());
            assert!(
                (nearest.fold(0.0, f64::max) - 1.0).abs() < 1e-12,
                "{found:?}"
            );
        }
    }

    /// A star that is thick in its middle, whose points are so far from there.
    fn star(points: &[f64]) -> Mesh {
        let around = 2 * points.len();
        let rings = [(0.4, -0.4), (0.8, -0.2), (1.0, 0.0), (0.8, 0.2), (0.4, 0.4)];
        let sides = rings.iter().flat_map(|&(size, height)| {
            (0..around).map(move |i| {
                let angle = TAU * i as f64 / around as f64;
                let far = size * if i % 2 == 0 { points[i / 2] } else { 0.4 };
                [far * angle.cos(), far * angle.sin(), height]
            })
        });
        let vertices: Vec<Point> = sides.chain([[0.0, 0.0, -0.5], [0.0, 0.0, 0.5]]).collect();
        let (n, top) = (around as i64, (rings.len() * around) as i64 + 1);
        let faces = (0..n).flat_map(|i| {
            let j = (i + 1) % n;
            let ends = [[j, i, top - 1], [top - 1 - n + i, top - 1 - n + j, top]];
            let side = (0..rings.len() as i64 - 1).flat_map(move |ring| {
                let [a, b, c, d] = [
                    ring * n + i,
                    ring * n + j,
                    (ring + 1) * n + j,
                    (ring + 1) * n + i,
                ];
                [[a, b, c], [a, c, d]]
            });
            ends.into_iter().chain(side)
        });
        Mesh::new(&vertices, &faces.collect::<Vec<_>>()).unwrap()
    }

    #[test]
    fn stars_turn_onto_themselves_unless_two_points_are_longer() {
        for count in [3, 4, 5, 6, 7, 9, 10, 11, 13] {
            let mut points = vec![1.0; count];
            assert!(turns_onto_itself(&star(&points)), "{count} points");
            // By different lengths: half a turn about one longer point alone would change nothing.
            points[..2].copy_from_slice(&[1.6, 1.3]);
            assert!(
                !turns_onto_itself(&star(&points)),
                "{count} points, two longer"
            );
        }
    }

    #[test]
    fn two_points_off_one_line_through_the_centre_tell_all_turns() {
        let off = |points: &[Point]| off_every_axis(points.iter().copied());
        assert!(off(&[]) == 0.0 && off(&[[1.0, 2.0, 3.0]]) < 1e-7);
        // Opposite each other: half a turn about their line changes nothing.
        assert!(off(&[[1.0, 2.0, 3.0], [-0.5, -1.0, -1.5]]) < 1e-7);
        // A quarter of a turn apart: the line between them is a half of √2 from each.
        assert!((off(&[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_fifth_of_a_turn_comes_back_after_five() {
        let axis = vector::normalised([1.0, 2.0, -0.5]);
        let start = [0.3, -1.2, 2.0];
        let after = |turns: usize| (0..turns).fold(start, |p, _| turned(p, axis, TAU / 5.0));
        assert!(vector::distance(after(5), start) < 1e-14);
        assert!(vector::distance(after(1), start) > 1.0);
    }
}
