//! Fast marching with circular wavefronts.

mod layout;
mod march;
mod sweep;
mod update;

pub use layout::FastMarching;
pub use march::{Seed, Workspace};
pub(super) use sweep::{Sweeping, TOGETHER};

use std::array::from_mut;

use crate::algebra::dense::vectorised;
use crate::algebra::vector::Point;
use crate::mesh::Mesh;

impl FastMarching {
    /// Lays out a mesh.
    #[must_use]
    pub fn new(mesh: &Mesh) -> Self {
        Self::from_triangles(&mesh.vertices, &mesh.faces)
    }

    /// Lays out a mesh whose faces have their own units of length: `factors`, `(m)`, positive.
    #[must_use]
    pub fn stretched(mesh: &Mesh, factors: &[f64]) -> Self {
        Self::laid_out(&mesh.vertices, &mesh.faces, |face| factors[face])
    }

    /// Lays out any triangles: needles, zero-length edges and non-manifold parts are allowed.
    ///
    /// Positions must be finite and faces must name existing vertices, as a checked [`Mesh`] does.
    #[must_use]
    pub fn from_triangles(vertices: &[Point], faces: &[[u32; 3]]) -> Self {
        Self::laid_out(vertices, faces, |_| 1.0)
    }

    /// Number of vertices.
    #[must_use]
    pub fn vertex_count(&self) -> usize {
        self.bends.len()
    }

    /// Distances from a vertex to all vertices, `out` of shape `(n)`; infinite where unreachable.
    ///
    /// # Panics
    /// When `source` is not a vertex, or `out` has not one entry for each vertex.
    pub fn march(&self, source: u32, workspace: &mut Workspace, out: &mut [f32]) {
        self.march_bounded(source, f32::INFINITY, workspace, out);
    }

    /// Distances from a vertex up to `bound`; infinite beyond. The cost follows the area covered,
    /// apart from filling `out`.
    ///
    /// # Panics
    /// As [`march`](Self::march).
    pub fn march_bounded(
        &self,
        source: u32,
        bound: f32,
        workspace: &mut Workspace,
        out: &mut [f32],
    ) {
        self.march_seeds(&[Seed::at(source)], bound, workspace, out);
    }

    /// Distances from several seeds up to `bound`; infinite beyond.
    ///
    /// # Panics
    /// When a seed is not a vertex, or `out` has not one entry for each vertex.
    pub fn march_seeds(
        &self,
        seeds: &[Seed],
        bound: f32,
        workspace: &mut Workspace,
        out: &mut [f32],
    ) {
        assert_eq!(out.len(), self.vertex_count(), "one distance a vertex");
        self.run_seeds(seeds, bound, workspace);
        workspace.write(out);
    }

    /// Marches from seeds up to `bound`, and leaves what it found in the workspace.
    fn run_seeds(&self, seeds: &[Seed], bound: f32, workspace: &mut Workspace) {
        vectorised(
            #[inline(always)]
            || self.run([seeds], from_mut(workspace), |_| bound),
        );
    }

    /// Distances from two vertices up to `bound`; infinite beyond. Both marches go step by step beside each other,
    /// which takes a tenth less time than one after the other, and have the same results.
    ///
    /// # Panics
    /// As [`march`](Self::march).
    pub(super) fn march_two(
        &self,
        sources: [u32; 2],
        bound: f32,
        workspaces: &mut [Workspace; 2],
        out: [&mut [f32]; 2],
    ) {
        let seeds = sources.map(|source| [Seed::at(source)]);
        let seeds = seeds.each_ref().map(<[Seed; 1]>::as_slice);
        vectorised(
            #[inline(always)]
            || self.run(seeds, workspaces, |_| bound),
        );
        for (workspace, out) in workspaces.iter().zip(out) {
            workspace.write(out);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::algebra::vector;
    use crate::geodesics::distances_from;
    use crate::testing::draws;

    fn marched(vertices: &[Point], faces: &[[u32; 3]], source: u32) -> Vec<f32> {
        let marching = FastMarching::from_triangles(vertices, faces);
        let mut workspace = Workspace::new(&marching);
        let mut out = vec![0.0; vertices.len()];
        marching.march(source, &mut workspace, &mut out);
        out
    }

    #[test]
    fn another_part_and_loose_vertices_are_infinitely_far() {
        let mut vertices = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        vertices.extend([[5.0, 0.0, 0.0], [6.0, 0.0, 0.0], [5.0, 1.0, 0.0]]);
        vertices.push([9.0, 9.0, 9.0]);
        let out = marched(&vertices, &[[0, 1, 2], [3, 4, 5]], 0);
        // Single precision's rounding.
        assert!(out[0] == 0.0 && out[1..3].iter().all(|d| (d - 1.0).abs() < 1e-6));
        assert_eq!(out[3..], [f32::INFINITY; 4]);
    }

    #[test]
    fn a_march_is_the_same_beside_another_that_ends_sooner() {
        // Two separate strips of 60 and 4 triangles, and a vertex of none.
        let strip = |count: u32, height: f64| {
            (0..count + 2).map(move |i| [f64::from(i) / 2.0, f64::from(i % 2), height])
        };
        let mut vertices: Vec<Point> = strip(60, 0.0).chain(strip(4, 9.0)).collect();
        vertices.push([-9.0; 3]);
        let faces: Vec<[u32; 3]> = (0..60).chain(62..66).map(|i| [i, i + 1, i + 2]).collect();
        let marching = FastMarching::from_triangles(&vertices, &faces);
        let loose = vertices.len() as u32 - 1;
        let mut workspaces = [Workspace::new(&marching), Workspace::new(&marching)];
        for sources in [[20, 64], [64, 20], [loose, 0], [7, 7]] {
            let mut beside = [vec![0.0; vertices.len()], vec![0.0; vertices.len()]];
            let out = beside.each_mut().map(Vec::as_mut_slice);
            marching.march_two(sources, f32::INFINITY, &mut workspaces, out);
            assert_eq!(beside, sources.map(|s| marched(&vertices, &faces, s)));
        }
    }

    #[test]
    fn any_number_of_triangles_around_a_vertex_is_passed() {
        // A flat disc of wedges around its middle, of one block of spokes, of several and of more than are compared,
        // closed and with one wedge missing, from a point of the rim.
        for wedges in [5, 7, 8, 20, 64, 65, 200] {
            for missing in [0, 1] {
                let angle = |i: u32| std::f64::consts::TAU * f64::from(i) / f64::from(wedges);
                let rim = (0..wedges).map(|i| [angle(i).cos(), angle(i).sin(), 0.0]);
                let vertices: Vec<Point> = std::iter::once([0.0; 3]).chain(rim).collect();
                // In an order that scatters neighbours (7919 is prime), every third turned over.
                let faces: Vec<[u32; 3]> = (0..wedges)
                    .map(|i| (i * 7919) % wedges)
                    .filter(|&i| i >= missing)
                    .map(|i| [0, 1 + i, 1 + (i + 1) % wedges])
                    .map(|[a, b, c]| if b % 3 == 0 { [c, b, a] } else { [a, b, c] })
                    .collect();
                assert_eq!(faces.len() as u32, wedges - missing);
                let source = 1 + wedges / 2;
                let out = marched(&vertices, &faces, source);
                // To the middle and to the neighbours along edges, exact but for single precision.
                for v in [0, source - 1, source + 1] {
                    let truth = vector::distance(vertices[source as usize], vertices[v as usize]);
                    assert!(
                        (f64::from(out[v as usize]) - truth).abs() < 1e-6,
                        "{wedges} {v}"
                    );
                }
                // No way is shorter than the straight one or longer than that through the middle.
                for (v, &p) in vertices.iter().enumerate() {
                    let truth = vector::distance(vertices[source as usize], p) as f32;
                    assert!(
                        out[v] > truth - 1e-5 && out[v] < 2.0 + 1e-5,
                        "{wedges} {v}: {}",
                        out[v]
                    );
                }
            }
        }
    }

    #[test]
    fn paths_bend_around_a_notch() {
        // A square ring of unit cells without its middle cell: from one side of the hole to the
        // other the shortest path is two straight lines that meet at a corner of the hole.
        let mut vertices = Vec::new();
        let mut faces = Vec::new();
        let n = 10u32;
        for j in 0..=n {
            for i in 0..=n {
                vertices.push([f64::from(i), f64::from(j), 0.0]);
            }
        }
        for j in 0..n {
            for i in 0..n {
                if (3..7).contains(&i) && (3..7).contains(&j) {
                    continue;
                }
                let a = j * (n + 1) + i;
                faces.extend([[a, a + 1, a + n + 2], [a, a + n + 2, a + n + 1]]);
            }
        }
        let id = |i: u32, j: u32| (j * (n + 1) + i) as usize;
        let out = marched(&vertices, &faces, id(1, 1) as u32);
        // Corners of the hole: (3, 3), (7, 3), (3, 7), (7, 7).
        let to = |x: f32, y: f32| (x * x + y * y).sqrt();
        for (i, j, truth) in [
            (9, 4, to(6.0, 2.0) + to(2.0, 1.0)),
            (9, 9, to(6.0, 2.0) + to(2.0, 6.0)),
            (10, 7, to(6.0, 2.0) + to(3.0, 4.0)),
            (10, 2, to(9.0, 1.0)),
        ] {
            // The edge on the shadow's border mixes both circles.
            let found = out[id(i, j)];
            assert!(
                (found - truth).abs() < 0.01 * truth,
                "({i}, {j}): {found} for {truth}"
            );
        }
    }

    #[test]
    fn degenerate_triangles_end_in_numbers() {
        // Points on a coarse lattice in a flat box: many coincide or are collinear, every edge may
        // have any number of faces.
        let mut drawn = draws(12345);
        let mut draw = |below: u32| drawn() % below;
        for round in 0..200 {
            let n = 12;
            let flat = [1.0, 1e-9, 1e-30][round % 3];
            let vertices: Vec<Point> = (0..n)
                .map(|_| {
                    let [x, y, z] = [4, 4, 2].map(|below| f64::from(draw(below)));
                    [x, y * flat, z * flat]
                })
                .collect();
            let faces: Vec<[u32; 3]> = (0..30).map(|_| [(); 3].map(|()| draw(n))).collect();
            // Each vertex six times as a source: enough of them to be swept.
            let sources: Vec<u32> = (0..6 * n).map(|i| i % n).collect();
            let marching = FastMarching::from_triangles(&vertices, &faces);
            let swept = distances_from(&marching, &sources, &|| false).unwrap();
            for source in 0..n {
                let out = marched(&vertices, &faces, source);
                for j in (0..6).map(|time| source + time * n) {
                    for (v, distance) in out.iter().enumerate() {
                        let found = swept[(v, j as usize)];
                        assert!(found >= 0.0 && found.is_finite() == distance.is_finite());
                    }
                }
                assert!(out.iter().all(|d| *d >= 0.0), "{out:?}");
                for f in &faces {
                    let reached = f.map(|v| out[v as usize].is_finite());
                    assert!(reached[0] == reached[1] && reached[1] == reached[2]);
                }
            }
        }
    }
}
