//! Fast marching with circular wavefronts.

use super::front_queue::FrontQueue;
use crate::mesh::Mesh;
use crate::vector::{self, Point};

/// A vertex that was already passed is opened again only for a gain above this fraction of the
/// edge it came by: below, the change is smaller than the discretisation error by far.
const LEAST_GAIN_OF_EDGE: f32 = 1e-4;

/// The same as a fraction of the distance, above single precision's rounding.
const LEAST_GAIN_OF_DISTANCE: f32 = 2e-6;

/// A ray may miss the edge it should cross by this fraction of the edge, so that rays along mesh
/// lines through a vertex do not fall between its edges by rounding.
const CROSSING_SLACK: f32 = 1e-3;

/// Circles around the ends of an edge that miss each other by at most this fraction of the edge
/// count as touching.
const TOUCHING_SLACK: f32 = 1e-4;

/// One triangle (a, b, c) as seen from its corner a, which owns the row.
#[derive(Debug, Clone, Copy)]
struct Corner {
    b: u32,
    c: u32,
    ab: f32,
    ac: f32,
    /// Cosine and sine of the angle at a.
    cos: f32,
    sin: f32,
}

/// What a march knows of a vertex.
#[derive(Debug, Clone, Copy)]
struct Front {
    distance: f32,
    /// Distance of the (pseudo-)source that the vertex sees straight.
    offset: f32,
    passed: bool,
    /// In the list of vertices whose value the step at hand has lowered.
    lowered: bool,
}

const FAR: Front = Front {
    distance: f32::INFINITY,
    offset: 0.0,
    passed: false,
    lowered: false,
};

/// Start of a march: a vertex with its distance from a point source.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Seed {
    /// Vertex.
    pub vertex: u32,
    /// Distance at the vertex.
    pub distance: f32,
    /// Distance at the point that the vertex sees straight; at most `distance`.
    pub offset: f32,
}

/// Fast marching on a triangle mesh, laid out once and used for any number of sources.
///
/// Where Kimmel and Sethian carry a plane wave over an edge, this carries a circular one: from the
/// distances at both ends the source is unfolded into the triangle's plane, and the third vertex
/// takes its straight distance if that line crosses the edge. Distances are thus exact on flat
/// parts, including the first rings around a source. Every vertex also keeps the distance of its
/// pseudo-source: a shortest path that bends at a saddle or boundary vertex starts a new circle
/// there. Obtuse triangles need no virtual edges, because a vertex passed too early (before the
/// far end of the edge its path crosses) is opened again when that end is known.
///
/// The result depends on geometry only, up to rounding, not on how vertices are numbered.
///
/// # Source
/// R. Kimmel, J. Sethian, "Computing geodesic paths on manifolds", PNAS 95 (1998), for the
/// marching; M. Novotni, R. Klein, "Computing geodesic distances on triangular meshes", WSCG 2002,
/// for the circular update; pseudo-sources as in J. Mitchell, D. Mount, C. Papadimitriou, "The
/// discrete geodesic problem", SIAM J. Comput. 16 (1987).
#[derive(Debug, Clone)]
pub struct FastMarching {
    /// Start of each vertex's row of corners, `(n + 1)`.
    starts: Vec<u32>,
    corners: Vec<Corner>,
    /// Whether shortest paths can bend at a vertex: saddles and boundary vertices, `(n)`.
    bends: Vec<bool>,
    /// Mean edge length, an edge counted once a face.
    mean_edge: f32,
}

/// Memory of one march, kept from source to source; one for each thread.
#[derive(Debug, Clone)]
pub struct Workspace {
    front: Vec<Front>,
    queue: FrontQueue,
    touched: Vec<u32>,
    lowered: Vec<u32>,
}

impl Workspace {
    /// Room for marches on one mesh.
    #[must_use]
    pub fn new(marching: &FastMarching) -> Self {
        let n = marching.vertex_count();
        Self {
            front: vec![FAR; n],
            queue: FrontQueue::new(marching.mean_edge),
            touched: Vec::with_capacity(n),
            lowered: Vec::new(),
        }
    }

    /// Vertices reached by the last march with their distances, in no particular order.
    pub fn reached(&self) -> impl Iterator<Item = (u32, f32)> + '_ {
        self.touched.iter().filter_map(|&v| {
            let front = self.front[v as usize];
            front.passed.then_some((v, front.distance))
        })
    }

    fn clear(&mut self) {
        for &v in &self.touched {
            self.front[v as usize] = FAR;
        }
        self.touched.clear();
        self.queue.clear();
    }
}

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

    fn laid_out(vertices: &[Point], faces: &[[u32; 3]], factor: impl Fn(usize) -> f64) -> Self {
        let n = vertices.len();
        let mut starts = vec![0u32; n + 1];
        for &v in faces.iter().flatten() {
            starts[v as usize + 1] += 1;
        }
        for i in 0..n {
            starts[i + 1] += starts[i];
        }
        let mut fill = starts.clone();
        let mut corners = vec![NO_CORNER; 3 * faces.len()];
        let mut angle = vec![0.0; n];
        for (face, f) in faces.iter().enumerate() {
            for i in 0..3 {
                let [a, b, c] = [f[i], f[(i + 1) % 3], f[(i + 2) % 3]];
                let (corner, at) = corner(vertices, a, b, c, factor(face));
                corners[fill[a as usize] as usize] = corner;
                fill[a as usize] += 1;
                angle[a as usize] += at;
            }
        }
        let mut bends: Vec<bool> = angle.iter().map(|&a| a > std::f64::consts::TAU).collect();
        let mut edges: Vec<(u32, u32)> = faces
            .iter()
            .flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)].map(|(u, v)| (u.min(v), u.max(v))))
            .collect();
        edges.sort_unstable();
        for run in edges.chunk_by(|a, b| a == b).filter(|run| run.len() != 2) {
            bends[run[0].0 as usize] = true;
            bends[run[0].1 as usize] = true;
        }
        let total: f64 = corners.iter().map(|c: &Corner| f64::from(c.ab)).sum();
        let mean_edge = (total / corners.len().max(1) as f64) as f32;
        Self {
            starts,
            corners,
            bends,
            mean_edge,
        }
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
        self.run(seeds, workspace, |_| bound);
        out.fill(f32::INFINITY);
        for (v, distance) in workspace.reached() {
            out[v as usize] = distance;
        }
    }

    /// Marches from `seeds`; a vertex takes part while its distance is at most `limit` of it.
    pub(super) fn run(
        &self,
        seeds: &[Seed],
        workspace: &mut Workspace,
        limit: impl Fn(u32) -> f32,
    ) {
        workspace.clear();
        for seed in seeds {
            let front = &mut workspace.front[seed.vertex as usize];
            if seed.distance < front.distance && seed.distance <= limit(seed.vertex) {
                if front.distance == f32::INFINITY {
                    workspace.touched.push(seed.vertex);
                }
                front.distance = seed.distance;
                front.offset = seed.offset;
                workspace.queue.push(seed.distance, seed.vertex);
            }
        }
        // An entry is out of date when its vertex was lowered since.
        while let Some(a) = {
            let front = &workspace.front;
            let valid =
                |distance: f32, v: u32| front[v as usize].distance.to_bits() == distance.to_bits();
            workspace.queue.pop(valid)
        } {
            self.step(a, workspace, &limit);
        }
    }

    /// Passes vertex `a` and lowers its neighbours.
    fn step(&self, a: u32, workspace: &mut Workspace, limit: &impl Fn(u32) -> f32) {
        let from = workspace.front[a as usize];
        workspace.front[a as usize].passed = true;
        let edge_offset = if self.bends[a as usize] {
            from.distance
        } else {
            from.offset
        };
        let row = self.starts[a as usize] as usize..self.starts[a as usize + 1] as usize;
        for corner in &self.corners[row] {
            let b = workspace.front[corner.b as usize];
            let c = workspace.front[corner.c as usize];
            // A vertex passed earlier can only gain across an edge, when its angle is obtuse.
            let b_open = !b.passed || corner.ac * corner.cos > corner.ab;
            let c_open = !c.passed || corner.ab * corner.cos > corner.ac;
            if b_open {
                let mut best = (from.distance + corner.ab, edge_offset);
                if c.passed {
                    across(from, c, corner.ac, corner.ab, corner, &mut best);
                }
                workspace.lower(corner.b, b, best, corner.ab, limit);
            }
            if c_open {
                let mut best = (from.distance + corner.ac, edge_offset);
                if b.passed {
                    across(from, b, corner.ab, corner.ac, corner, &mut best);
                }
                workspace.lower(corner.c, c, best, corner.ac, limit);
            }
        }
        for &v in &workspace.lowered {
            let front = &mut workspace.front[v as usize];
            front.lowered = false;
            workspace.queue.push(front.distance, v);
        }
        workspace.lowered.clear();
    }
}

impl Workspace {
    #[inline]
    fn lower(
        &mut self,
        v: u32,
        old: Front,
        (distance, offset): (f32, f32),
        edge: f32,
        limit: &impl Fn(u32) -> f32,
    ) {
        let gain = if old.passed {
            (LEAST_GAIN_OF_EDGE * edge).max(LEAST_GAIN_OF_DISTANCE * distance)
        } else {
            0.0
        };
        if distance + gain < old.distance && distance <= limit(v) {
            if old.distance == f32::INFINITY {
                self.touched.push(v);
            }
            if !old.lowered {
                self.lowered.push(v);
            }
            self.front[v as usize] = Front {
                distance,
                offset,
                passed: old.passed,
                lowered: true,
            };
        }
    }
}

/// Lowers `best` (distance, offset) of the vertex opposite the edge from a (front `a`) of length
/// `edge` to its other end (front `b`), when the ray from the unfolded source crosses the edge.
/// `side` is the length from a to the vertex.
#[inline]
fn across(a: Front, b: Front, edge: f32, side: f32, corner: &Corner, best: &mut (f32, f32)) {
    let offset = a.offset.min(b.offset);
    let (ra, rb) = (a.distance - offset, b.distance - offset);
    let (cx, cy) = (side * corner.cos, side * corner.sin);
    // Source at (x, −y): a at the origin, b at (edge, 0).
    let x = 0.5 * ((ra - rb) * (ra + rb) / edge + edge);
    let y_squared = (ra - x) * (ra + x);
    if y_squared < -TOUCHING_SLACK * edge * edge {
        return;
    }
    let y = y_squared.max(0.0).sqrt();
    let drop = y + cy;
    let crossing = x * cy + cx * y;
    let slack = CROSSING_SLACK * edge * drop;
    // Written so that NaN from a degenerate triangle fails.
    if drop > 0.0 && crossing >= -slack && crossing <= edge * drop + slack {
        let distance = offset + ((cx - x) * (cx - x) + drop * drop).sqrt();
        if distance < best.0 {
            *best = (distance, offset);
        }
    }
}

const NO_CORNER: Corner = Corner {
    b: 0,
    c: 0,
    ab: 0.0,
    ac: 0.0,
    cos: 1.0,
    sin: 0.0,
};

/// The triangle as seen from `a`, its lengths times `factor`, and its angle there.
fn corner(vertices: &[Point], a: u32, b: u32, c: u32, factor: f64) -> (Corner, f64) {
    let [p, q, r] = [a, b, c].map(|v| vertices[v as usize]);
    let (u, v) = (vector::sub(q, p), vector::sub(r, p));
    let (along, across) = (vector::dot(u, v), vector::norm(vector::cross(u, v)));
    let angle = across.atan2(along);
    let corner = Corner {
        b,
        c,
        ab: (factor * vector::norm(u)) as f32,
        ac: (factor * vector::norm(v)) as f32,
        cos: angle.cos() as f32,
        sin: angle.sin() as f32,
    };
    (corner, angle)
}

impl Seed {
    /// A vertex as source.
    #[must_use]
    pub fn at(vertex: u32) -> Self {
        Self {
            vertex,
            distance: 0.0,
            offset: 0.0,
        }
    }

    /// A point in a face as source, `weights` its barycentric coordinates, `offset` its own
    /// distance: seeds at the three corners.
    #[must_use]
    pub fn in_face(mesh: &Mesh, face: u32, weights: [f64; 3], offset: f32) -> [Self; 3] {
        let corners = mesh.faces[face as usize];
        let mut point = [0.0; 3];
        for (&v, w) in corners.iter().zip(weights) {
            point = vector::add(point, vector::scaled(mesh.vertices[v as usize], w));
        }
        corners.map(|vertex| Self {
            vertex,
            distance: offset + vector::distance(point, mesh.vertices[vertex as usize]) as f32,
            offset,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let mut state = 12345u64;
        let mut draw = |below: u64| {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 33) % below
        };
        for round in 0..200 {
            let n = 12;
            let flat = [1.0, 1e-9, 1e-30][round % 3];
            let vertices: Vec<Point> = (0..n)
                .map(|_| [draw(4) as f64, draw(4) as f64 * flat, draw(2) as f64 * flat])
                .collect();
            let faces: Vec<[u32; 3]> = (0..30).map(|_| [(); 3].map(|()| draw(n) as u32)).collect();
            for source in 0..n as u32 {
                let out = marched(&vertices, &faces, source);
                assert!(out.iter().all(|d| *d >= 0.0), "{out:?}");
                for f in &faces {
                    let reached = f.map(|v| out[v as usize].is_finite());
                    assert!(reached[0] == reached[1] && reached[1] == reached[2]);
                }
            }
        }
    }
}
