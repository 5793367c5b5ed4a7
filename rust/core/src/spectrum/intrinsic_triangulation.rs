//! Edge lengths instead of positions: a triangulation that is Delaunay and has no flat triangle.
//!
//! The cotangent weights of a Delaunay triangulation are never negative, whatever the triangles the
//! user drew, so the operator built on it obeys the maximum principle. Flips keep the surface and
//! its vertices; only the straight lines between them change. Used where the triangles themselves
//! are no basis for an operator; on ordinary meshes, even ones with obtuse triangles, maps between
//! shapes come out worse on it.
//!
//! Where the surface is closed, manifold and consistently wound the triangulation is that of the
//! mesh. Otherwise it covers the mesh twice, once from either side, glued so that every edge has
//! two triangles: around an edge of any number of triangles the side of each is glued to the
//! facing side of the next. At a boundary the front is glued to the back, which is the
//! natural (Neumann) condition.
//!
//! # Source
//! Sharp, Crane, "A Laplacian for nonmanifold triangle meshes", 2020, for the cover and the
//! mollification; Bobenko, Springborn, "A discrete Laplace–Beltrami operator for simplicial
//! surfaces", 2007, for the flips.

use std::collections::VecDeque;

use crate::algebra::vector::{self, Point};
use crate::mesh::{self, Mesh};
use crate::spectrum::settings::INTRINSIC_TRIANGULATION;

/// One of the three sides of a triangle: from corner `side` to the next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct FaceSide {
    face: u32,
    side: u8,
}

/// Triangles known by their corners, side lengths and neighbours.
#[derive(Debug, Clone)]
pub struct IntrinsicTriangulation {
    /// Corners, vertices of the mesh; two may be the same vertex.
    pub faces: Vec<[u32; 3]>,
    /// Length of the side from each corner to the next.
    pub lengths: Vec<[f64; 3]>,
    /// The side of another triangle on the other side of each side.
    across: Vec<[FaceSide; 3]>,
    /// How often the surface is covered: once or twice.
    pub sheets: usize,
    /// Length that was added to every side.
    pub mollification: f64,
    /// Edges flipped.
    pub flips: usize,
}

impl IntrinsicTriangulation {
    /// The intrinsic Delaunay triangulation of a mesh.
    #[must_use]
    pub fn delaunay(mesh: &Mesh) -> Self {
        let mut triangulation = Self::of_surface(&mesh.vertices, &mesh.faces);
        triangulation.mollify();
        triangulation.flip_to_delaunay();
        triangulation
    }

    fn of_surface(vertices: &[Point], triangles: &[[u32; 3]]) -> Self {
        let edges = mesh::edge_faces(triangles.iter().copied());
        let runs = || edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1));
        let closed = runs().all(|run| matches!(run, [a, b] if a.3 != b.3));
        let m = triangles.len();
        let mut faces = triangles.to_vec();
        if !closed {
            faces.extend(triangles.iter().map(|&[a, b, c]| [a, c, b]));
        }
        let lengths = faces
            .iter()
            .map(|f| {
                let [a, b, c] = f.map(|v| vertices[v as usize]);
                [(a, b), (b, c), (c, a)].map(|(p, q)| vector::distance(p, q))
            })
            .collect();
        let nowhere = FaceSide { face: 0, side: 0 };
        let mut made = Self {
            across: vec![[nowhere; 3]; faces.len()],
            sheets: if closed { 1 } else { 2 },
            faces,
            lengths,
            mollification: 0.0,
            flips: 0,
        };
        for run in runs() {
            let (low, high) = (run[0].0, run[0].1);
            if closed {
                let sides = [0, 1].map(|i| {
                    let (from, to) = if run[i].3 { (low, high) } else { (high, low) };
                    made.side_between(run[i].2, from, to)
                });
                made.glue(sides[0], sides[1]);
                continue;
            }
            let around = around_edge(vertices, triangles, run);
            for (i, &(face, forward)) in around.iter().enumerate() {
                let (next, next_forward) = around[(i + 1) % around.len()];
                // The copy that looks ahead around the edge runs along it, the one that looks back
                // against it.
                let ahead = if forward { face } else { face + m as u32 };
                let back = if next_forward { next + m as u32 } else { next };
                let sides = (
                    made.side_between(ahead, low, high),
                    made.side_between(back, high, low),
                );
                made.glue(sides.0, sides.1);
            }
        }
        made
    }

    fn side_between(&self, face: u32, from: u32, to: u32) -> FaceSide {
        let corners = self.faces[face as usize];
        let side = (0..3)
            .find(|&s| corners[s] == from && corners[(s + 1) % 3] == to)
            .expect("the edge list was made from these faces") as u8;
        FaceSide { face, side }
    }

    fn glue(&mut self, a: FaceSide, b: FaceSide) {
        self.across[a.face as usize][a.side as usize] = b;
        self.across[b.face as usize][b.side as usize] = a;
    }

    /// Adds the same length to all sides, just enough that no triangle is flat.
    fn mollify(&mut self) {
        let sum: f64 = self.lengths.iter().flatten().sum();
        let slack =
            INTRINSIC_TRIANGULATION.mollification * sum / (3 * self.lengths.len()).max(1) as f64;
        let added = self
            .lengths
            .iter()
            .flat_map(|&[a, b, c]| [a - b - c, b - c - a, c - a - b])
            .map(|excess| slack + excess)
            .fold(0.0, f64::max);
        if added > 0.0 {
            for length in self.lengths.iter_mut().flatten() {
                *length += added;
            }
        }
        self.mollification = added;
    }

    fn flip_to_delaunay(&mut self) {
        let mut queue: VecDeque<FaceSide> = (0..self.faces.len() as u32)
            .flat_map(|face| (0..3).map(move |side| FaceSide { face, side }))
            .filter(|&s| !self.is_delaunay(s))
            .collect();
        let most = INTRINSIC_TRIANGULATION.flips_a_face * self.faces.len();
        while let Some(side) = queue.pop_front() {
            if self.flips == most {
                break;
            }
            if self.is_delaunay(side) {
                continue;
            }
            if let Some(outer) = self.flip(side) {
                self.flips += 1;
                queue.extend(outer);
            }
        }
    }

    fn is_delaunay(&self, side: FaceSide) -> bool {
        let other = self.across[side.face as usize][side.side as usize];
        self.cotangent_opposite(side) + self.cotangent_opposite(other)
            >= -INTRINSIC_TRIANGULATION.delaunay_tolerance
    }

    fn cotangent_opposite(&self, FaceSide { face, side }: FaceSide) -> f64 {
        let lengths = self.lengths[face as usize];
        let [a, b, c] = [0, 1, 2].map(|i| lengths[(side as usize + i) % 3]);
        (b * b + c * c - a * a) / (2.0 * double_area([a, b, c]))
    }

    /// Replaces a side by the other diagonal of its two triangles; gives the four sides around.
    fn flip(&mut self, first: FaceSide) -> Option<[FaceSide; 4]> {
        let second = self.across[first.face as usize][first.side as usize];
        if first.face == second.face {
            // A triangle glued to itself: its two angles are less than π together.
            return None;
        }
        let turned = |of: FaceSide, by: u8| FaceSide {
            face: of.face,
            side: (of.side + by) % 3,
        };
        let corner =
            |of: FaceSide, by: u8| self.faces[of.face as usize][turned(of, by).side as usize];
        let length =
            |of: FaceSide, by: u8| self.lengths[of.face as usize][turned(of, by).side as usize];
        // The side runs from i to j, k is ahead of it in the first triangle, l in the second.
        let [i, j, k, l] = [
            corner(first, 0),
            corner(first, 1),
            corner(first, 2),
            corner(second, 2),
        ];
        let (jk, ki) = (length(first, 1), length(first, 2));
        let (il, lj) = (length(second, 1), length(second, 2));
        let diagonal = other_diagonal(length(first, 0), [jk, ki], [il, lj]);
        let valid = |a: f64, b: f64| double_area([diagonal, a, b]) > 0.0;
        if !(diagonal.is_finite() && valid(il, ki) && valid(jk, lj)) {
            return None;
        }
        let old = [
            turned(second, 1),
            turned(first, 2),
            turned(first, 1),
            turned(second, 2),
        ];
        let at = |face: u32, side: u8| FaceSide { face, side };
        let (f, s) = (first.face, second.face);
        let new = [at(f, 0), at(f, 2), at(s, 0), at(s, 2)];
        let outside = old.map(|o| {
            let beyond = self.across[o.face as usize][o.side as usize];
            // Two of the four may be glued to each other.
            old.iter()
                .position(|&p| p == beyond)
                .map_or(beyond, |p| new[p])
        });
        self.faces[f as usize] = [i, l, k];
        self.faces[s as usize] = [j, k, l];
        self.lengths[f as usize] = [il, diagonal, ki];
        self.lengths[s as usize] = [jk, diagonal, lj];
        for (side, beyond) in new.into_iter().zip(outside) {
            self.glue(side, beyond);
        }
        self.glue(at(f, 1), at(s, 1));
        Some(new)
    }
}

/// Twice the area of a triangle from its side lengths, 0 when they make none.
///
/// # Source
/// Kahan, "Miscalculating area and angles of a needle-like triangle", 2014.
#[must_use]
pub fn double_area(mut sides: [f64; 3]) -> f64 {
    sides.sort_by(|x, y| y.total_cmp(x));
    let [a, b, c] = sides;
    let product = (a + (b + c)) * (c - (a - b)) * (c + (a - b)) * (a + (b - c));
    product.max(0.0).sqrt() / 2.0
}

/// Length between the apexes of two triangles on a common base from i to j, unfolded into a plane;
/// the first has the sides jk, ki, the second il, lj.
fn other_diagonal(base: f64, [jk, ki]: [f64; 2], [il, lj]: [f64; 2]) -> f64 {
    let along =
        |from_i: f64, from_j: f64| (base * base + from_i * from_i - from_j * from_j) / (2.0 * base);
    let height = |from_i: f64, from_j: f64| double_area([base, from_i, from_j]) / base;
    (along(ki, jk) - along(il, lj)).hypot(height(ki, jk) + height(il, lj))
}

/// Faces of an edge, with whether they run along it, in the order in which they stand around it:
/// anticlockwise as seen against its direction.
fn around_edge(
    vertices: &[Point],
    triangles: &[[u32; 3]],
    run: &[(u32, u32, u32, bool)],
) -> Vec<(u32, bool)> {
    let mut faces: Vec<(u32, bool)> = run.iter().map(|&(_, _, f, forward)| (f, forward)).collect();
    if faces.len() < 3 {
        return faces;
    }
    let (low, high) = (run[0].0, run[0].1);
    let origin = vertices[low as usize];
    let axis = vector::normalised(vector::sub(vertices[high as usize], origin));
    let arm = |face: u32| {
        let apex = triangles[face as usize]
            .into_iter()
            .find(|&v| v != low && v != high)
            .expect("a face has three different corners");
        let arm = vector::sub(vertices[apex as usize], origin);
        vector::sub(arm, vector::scaled(axis, vector::dot(arm, axis)))
    };
    let first = vector::normalised(arm(faces[0].0));
    let second = vector::cross(axis, first);
    faces.sort_by_cached_key(|&(face, _)| {
        let arm = arm(face);
        let angle = vector::dot(arm, second).atan2(vector::dot(arm, first));
        // Integers are ordered; a billionth of a radian is far below what matters.
        (
            ((angle + std::f64::consts::TAU) % std::f64::consts::TAU * 1e9) as i64,
            face,
        )
    });
    faces
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(triangulation: &IntrinsicTriangulation) {
        for (f, across) in triangulation.across.iter().enumerate() {
            for (s, other) in across.iter().enumerate() {
                let back = triangulation.across[other.face as usize][other.side as usize];
                assert_eq!((back.face as usize, back.side as usize), (f, s));
                let here = triangulation.faces[f];
                let there = triangulation.faces[other.face as usize];
                let o = other.side as usize;
                assert_eq!((here[s], here[(s + 1) % 3]), (there[(o + 1) % 3], there[o]));
                let gap =
                    triangulation.lengths[f][s] - triangulation.lengths[other.face as usize][o];
                assert!(gap.abs() < 1e-12);
            }
        }
    }

    fn delaunay(vertices: &[Point], triangles: &[[u32; 3]]) -> IntrinsicTriangulation {
        let mut made = IntrinsicTriangulation::of_surface(vertices, triangles);
        check(&made);
        made.mollify();
        made.flip_to_delaunay();
        check(&made);
        assert!(made.lengths.iter().all(|&l| double_area(l) > 0.0));
        for face in 0..made.faces.len() as u32 {
            for side in 0..3 {
                assert!(made.is_delaunay(FaceSide { face, side }));
            }
        }
        made
    }

    #[test]
    fn kite_gets_its_short_diagonal_on_either_side() {
        let vertices = [
            [0.0, 0.0, 0.0],
            [4.0, 0.0, 0.0],
            [2.0, 0.5, 0.0],
            [2.0, -0.5, 0.0],
        ];
        let made = delaunay(&vertices, &[[0, 1, 2], [1, 0, 3]]);
        assert_eq!(made.sheets, 2);
        assert_eq!(made.flips, 2);
        assert!(made.faces.iter().all(|f| f.contains(&2) && f.contains(&3)));
        let area: f64 = made.lengths.iter().map(|&l| double_area(l) / 2.0).sum();
        assert!((area - 2.0 * 2.0).abs() < 1e-12);
    }

    #[test]
    fn closed_surface_is_covered_once() {
        let vertices = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let made = delaunay(&vertices, &[[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]);
        assert_eq!((made.sheets, made.mollification), (1, 0.0));
    }

    #[test]
    fn three_leaves_of_a_book_are_glued_face_to_face() {
        let leaf = |angle: f64| [angle.cos(), angle.sin(), 0.5];
        let vertices = [[0.0; 3], [0.0, 0.0, 1.0], leaf(0.0), leaf(4.0), leaf(2.0)];
        let made = delaunay(&vertices, &[[0, 1, 2], [1, 0, 3], [0, 1, 4]]);
        // Anticlockwise the leaves stand as 2, 4, 3: front copies 0 to 2, back copies 3 to 5.
        let spine = |face: u32| {
            let corners = made.faces[face as usize];
            let side = (0..3).find(|&s| corners[s] < 2 && corners[(s + 1) % 3] < 2);
            made.across[face as usize][side.unwrap()].face
        };
        assert_eq!([0, 2, 4].map(spine), [5, 1, 3]);
    }

    #[test]
    fn flat_triangle_is_mollified() {
        let vertices = [[0.0; 3], [2.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]];
        let made = delaunay(&vertices, &[[0, 1, 2], [1, 0, 3]]);
        assert!(made.mollification > 0.0 && made.mollification < 1e-4);
    }

    #[test]
    fn needle_area_keeps_its_digits() {
        // Isosceles with base 2e-9 and height 1.
        let area = double_area([1.0, 1.0, 2e-9]);
        assert!((area / 2e-9 - 1.0).abs() < 1e-12);
    }
}
