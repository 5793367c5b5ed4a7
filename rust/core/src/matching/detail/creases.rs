//! Creases draw creases: rims of lids, lips and nostrils, edges of nails and cuffs.
//!
//! Along its normal a vertex finds the other surface; across it, only where that bends. With normals nᵢ and unit tangents tᵢⱼ
//! towards the neighbours, Mᵢ = mean of κᵢⱼ tᵢⱼtᵢⱼᵀ, κᵢⱼ = ⟨nⱼ − nᵢ, tᵢⱼ⟩ / ‖pⱼ − pᵢ‖, has the eigenvalues (3a + b)/8 and (a +
//! 3b)/8, a and b being the principal curvatures. A vertex is on a crease where the larger of these is above `CREASES.bend` by
//! the finest length of averaging, and its radius below `CREASES.broadest`, so that limbs of a coarse mesh are none: on a ridge
//! where it is positive, else in a valley. It is drawn to the nearest place of that kind that faces the same way, in the
//! direction in which that bends, and stays free to slide along.
//!
//! # Source
//! Taubin, "Estimating the tensor of curvature of a surface from a polyhedral approximation", 1995.

use crate::algebra::oriented_tree::{Oriented, OrientedTree, oriented, squared_distance};
use crate::algebra::vector::{self, Point};
use crate::matching::detail::membrane::{Symmetric, along, times};
use crate::matching::detail::settings::CREASES;
use crate::mesh::Mesh;

/// How a surface bends at a vertex.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bend {
    /// The principal curvature that is larger in size, positive where the surface is convex.
    curvature: f64,
    /// Its direction, of length one.
    across: Point,
}

impl Bend {
    /// Whether it bends by more than `CREASES.bend` over a length, and by a radius of less than `CREASES.broadest`.
    fn is_crease(&self, length: f64) -> bool {
        self.curvature.abs() > f64::max(CREASES.bend / length, 1.0 / CREASES.broadest)
    }
}

/// How a mesh bends at each vertex.
pub(super) fn bends(mesh: &Mesh, normals: &[Point]) -> Vec<Bend> {
    let frames: Vec<[Point; 2]> = normals.iter().map(|&n| vector::tangent_frame(n)).collect();
    // κ t tᵀ in the frame, summed, and how many.
    let mut sums = vec![([0.0; 3], 0.0); normals.len()];
    for &[a, b, c] in &mesh.faces {
        for (i, j) in [(a, b), (b, a), (b, c), (c, b), (c, a), (a, c)] {
            let (i, j) = (i as usize, j as usize);
            let off = vector::sub(mesh.vertices[j], mesh.vertices[i]);
            let [x, y] = frames[i].map(|e| vector::dot(e, off));
            let length = x.hypot(y);
            if length == 0.0 {
                continue;
            }
            let (x, y) = (x / length, y / length);
            let turned = vector::sub(normals[j], normals[i]);
            let turned = frames[i].map(|e| vector::dot(e, turned));
            let bent = (turned[0] * x + turned[1] * y) / vector::norm(off);
            let (sum, count) = &mut sums[i];
            *sum = vector::add(*sum, [bent * x * x, bent * x * y, bent * y * y]);
            *count += 1.0;
        }
    }
    let of_vertex = |([xx, xy, yy], count): ([f64; 3], f64), [u, v]: [Point; 2]| {
        let (middle, half) = (f64::midpoint(xx, yy), ((xx - yy) / 2.0).hypot(xy));
        let (high, low) = (middle + half, middle - half);
        let (a, b) = ((3.0 * high - low) / count, (3.0 * low - high) / count);
        let angle = f64::atan2(2.0 * xy, xx - yy) / 2.0;
        let (sin, cos) = angle.sin_cos();
        let (curvature, [x, y]) = if a.abs() >= b.abs() {
            (a, [cos, sin])
        } else {
            (b, [-sin, cos])
        };
        Bend {
            curvature,
            across: vector::add(vector::scaled(u, x), vector::scaled(v, y)),
        }
    };
    sums.into_iter()
        .zip(frames)
        .map(|(sum, frame)| of_vertex(sum, frame))
        .collect()
}

/// Ridges or valleys of a surface.
struct Kind {
    places: Vec<Oriented>,
    across: Vec<Point>,
    tree: OrientedTree,
}

/// The creases of a surface, to be asked for those nearby.
pub(super) struct Creases {
    /// Valleys and ridges.
    kinds: [Kind; 2],
    /// The finest length of averaging.
    length: f64,
}

impl Creases {
    /// Those of a mesh at a finest length of averaging. Vertices of rims are left out.
    pub(super) fn new(mesh: &Mesh, normals: &[Point], on_rim: &[bool], length: f64) -> Self {
        let bends = bends(mesh, normals);
        let kind = |ridges: bool| {
            let (mut places, mut across) = (Vec::new(), Vec::new());
            for (v, bend) in bends.iter().enumerate() {
                if bend.is_crease(length) && (bend.curvature > 0.0) == ridges && !on_rim[v] {
                    places.push(oriented(mesh.vertices[v], normals[v]));
                    across.push(bend.across);
                }
            }
            let tree = OrientedTree::new(&places, length);
            Kind {
                places,
                across,
                tree,
            }
        };
        Self {
            kinds: [kind(false), kind(true)],
            length,
        }
    }

    /// From how far they draw.
    pub(super) fn reach(&self) -> f64 {
        CREASES.reach * self.length
    }

    /// How the nearest crease of its kind draws a vertex with its place, normal and area, and by how much: M and M times the way
    /// to there. Nothing where none does.
    pub(super) fn drawing(
        &self,
        bend: &Bend,
        (place, normal): (Point, Point),
        rho: f64,
        area: f64,
    ) -> Option<(Symmetric, Point)> {
        let query = oriented(place, normal);
        let (there, across, cosine) = self.nearest(bend, &query, rho * rho)?;
        let draw = along(across, 0.0, CREASES.drawn * area * cosine * cosine);
        Some((draw, times(&draw, vector::sub(there, place))))
    }

    /// Where the nearest crease of the kind of a vertex is, at ρ² = `turning`, the direction in which it bends, and the cosine
    /// between the normals; nothing where the vertex is on none or none lies within reach.
    fn nearest(&self, bend: &Bend, query: &Oriented, turning: f64) -> Option<(Point, Point, f64)> {
        let kind = &self.kinds[usize::from(bend.curvature > 0.0)];
        if !bend.is_crease(self.length) || kind.places.is_empty() {
            return None;
        }
        let first = (squared_distance(&kind.places[0], query, turning), 0);
        let found = kind.tree.nearest(query, turning, first) as usize;
        let [x, y, z, a, b, c] = kind.places[found];
        let place = [x, y, z];
        let off = vector::distance(place, [query[0], query[1], query[2]]);
        let cosine = vector::dot([a, b, c], [query[3], query[4], query[5]]);
        (off < self.reach() && cosine > 0.0).then(|| (place, kind.across[found], cosine))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const AROUND: usize = 48;
    const ALONG: usize = 12;

    /// Rows of the same places, each further along, joined by triangles; closed around if wished.
    fn drawn_along(row: &[(f64, f64)], step: f64, closed: bool) -> Mesh {
        let n = row.len();
        let place = |j: usize| row.iter().map(move |&(x, y)| [x, y, step * j as f64]);
        let vertices: Vec<Point> = (0..ALONG).flat_map(place).collect();
        let at = |i: usize, j: usize| (j * n + i % n) as i64;
        let mut faces = Vec::new();
        for j in 0..ALONG - 1 {
            for i in 0..if closed { n } else { n - 1 } {
                let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                faces.extend([[a, b, c], [a, c, d]]);
            }
        }
        Mesh::new(&vertices, &faces).expect("a sound mesh")
    }

    #[test]
    fn a_tube_bends_around_itself_by_one_over_its_radius() {
        let angle = |i: usize| std::f64::consts::TAU * i as f64 / AROUND as f64;
        let circle: Vec<(f64, f64)> = (0..AROUND).map(|i| angle(i).sin_cos()).collect();
        let circle: Vec<_> = circle.into_iter().map(|(sin, cos)| (cos, sin)).collect();
        let mesh = drawn_along(&circle, 0.15, true);
        let radius = mesh.vertices[0][0].hypot(mesh.vertices[0][1]);
        let inside = AROUND..AROUND * (ALONG - 1);
        for (v, bend) in bends(&mesh, &mesh.vertex_normals()).iter().enumerate() {
            let [x, y, _] = mesh.vertices[v];
            let around = [-y / radius, x / radius, 0.0];
            if inside.contains(&v) {
                // Six edges are not all directions: along the tube and across two that lean.
                let share = bend.curvature * radius;
                assert!((0.7..1.3).contains(&share), "{share}");
                assert!(vector::dot(bend.across, around).abs() > 0.95);
            }
        }
    }

    /// A sheet with a round fold along its middle.
    #[test]
    fn a_fold_is_a_ridge_between_valleys_and_draws_its_own_kind() {
        const RADIUS: f64 = 0.003;
        let half_circle = (0..7).map(|i| f64::from(i) * std::f64::consts::PI / 6.0);
        let mut row = vec![(0.5, 0.0), (0.1, 0.0)];
        row.extend(half_circle.map(|angle| (RADIUS * angle.cos(), RADIUS * angle.sin())));
        row.extend([(-0.1, 0.0), (-0.5, 0.0)]);
        let mesh = drawn_along(&row, 0.09, false);
        let normals = mesh.vertex_normals();
        let bends = bends(&mesh, &normals);
        // In a row far from the ends: the foot of the fold, and its top.
        let [foot, top] = [2, 5].map(|i| 5 * row.len() + i);
        assert!(bends[foot].is_crease(RADIUS) && bends[foot].curvature < 0.0);
        assert!(bends[top].is_crease(RADIUS) && bends[top].curvature > 0.0);
        assert!(bends[top].across[0].abs() > 0.99);
        let none = vec![false; normals.len()];
        let creases = Creases::new(&mesh, &normals, &none, RADIUS);
        let query = oriented(mesh.vertices[top], normals[top]);
        let nearest = |bend: &Bend| creases.nearest(bend, &query, RADIUS * RADIUS);
        let (place, _, cosine) = nearest(&bends[top]).expect("itself");
        assert_eq!(place, mesh.vertices[top]);
        assert!((cosine - 1.0).abs() < 1e-12);
        // No valley is as near, and what is flat is drawn to nothing.
        assert!(nearest(&bends[foot]).is_none_or(|(place, ..)| place != mesh.vertices[top]));
        assert!(nearest(&bends[5 * row.len()]).is_none());
    }
}
