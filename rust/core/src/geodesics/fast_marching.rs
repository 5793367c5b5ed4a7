//! Fast marching with circular wavefronts.

use std::array::{from_fn, from_mut};

use super::front_queue::FrontQueue;
use crate::dense::{LANES, vectorised};
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

/// Triangles around a vertex of which those that share an edge are looked for one by one.
const MOST_COMPARED: usize = 64;

/// Edges as seen from the end that they share, side by side in vector registers. They are spokes of fans: each spans a
/// triangle with the next. A closed fan ends with the spoke that it starts with, and one that goes on in the next
/// block starts there with the last spoke of this.
#[derive(Debug, Clone, Copy)]
#[repr(align(32))]
struct Spokes {
    /// Length of each.
    length: [f32; LANES],
    /// Cosine and sine of the angle to the next spoke, NaN for the last one of a fan.
    cos: [f32; LANES],
    sin: [f32; LANES],
    /// The other end; where there is no spoke, that which they share.
    vertex: [u32; LANES],
}

/// What a march knows of a vertex.
#[derive(Debug, Clone, Copy)]
struct Front {
    distance: f32,
    /// The same once the vertex was passed, NaN before.
    passed: f32,
    /// Distance of the (pseudo-)source that the vertex sees straight.
    offset: f32,
}

const FAR: Front = Front {
    distance: f32::INFINITY,
    passed: f32::NAN,
    offset: 0.0,
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
    /// Start of the blocks of each vertex, `(n + 1)`.
    starts: Vec<u32>,
    spokes: Vec<Spokes>,
    /// Whether shortest paths can bend at a vertex: saddles and boundary vertices, `(n)`.
    bends: Vec<bool>,
    /// Mean edge length, an edge counted once a face.
    mean_edge: f32,
}

/// Memory of one march, kept from source to source; one for each that runs at the same time.
#[derive(Debug, Clone)]
pub struct Workspace {
    front: Vec<Front>,
    queue: FrontQueue,
    touched: Vec<u32>,
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
        }
    }

    /// Vertices reached by the last march with their distances, in no particular order.
    pub fn reached(&self) -> impl Iterator<Item = (u32, f32)> + '_ {
        self.touched.iter().filter_map(|&v| {
            let front = self.front[v as usize];
            (!front.passed.is_nan()).then_some((v, front.distance))
        })
    }

    /// Distances of all vertices, infinite where the last march did not come.
    fn write(&self, out: &mut [f32]) {
        out.fill(f32::INFINITY);
        for (v, distance) in self.reached() {
            out[v as usize] = distance;
        }
    }

    /// Forgets the last march and places the seeds of the next.
    fn begin(&mut self, seeds: &[Seed], limit: &impl Fn(u32) -> f32) {
        for &v in &self.touched {
            self.front[v as usize] = FAR;
        }
        self.touched.clear();
        self.queue.clear();
        for seed in seeds {
            self.lower_vertex(seed.vertex, seed.distance, seed.offset, limit);
        }
    }

    /// The vertex to be passed next.
    #[inline(always)]
    fn next(&mut self) -> Option<u32> {
        let front = &self.front;
        // An entry is out of date when its vertex was lowered since.
        self.queue.pop(
            #[inline(always)]
            |distance, v| front[v as usize].distance.to_bits() == distance.to_bits(),
        )
    }

    /// Lowers what can be lowered at the ends of spokes; true when only those were that had been passed too early.
    #[inline(always)]
    fn lower(&mut self, spokes: &Spokes, reached: &Reached, limit: &impl Fn(u32) -> f32) -> bool {
        // Those passed too early first: across their edges others come too near.
        let opened = reached.lower & reached.passed;
        let mut lower = if opened == 0 { reached.lower } else { opened };
        while lower != 0 {
            let lane = lower.trailing_zeros() as usize;
            lower &= lower - 1;
            let (distance, offset) = (reached.distance[lane], reached.offset[lane]);
            self.lower_vertex(spokes.vertex[lane], distance, offset, limit);
        }
        opened != 0
    }

    /// Lowers a vertex, unless it is as near or `limit` is nearer.
    #[inline(always)]
    fn lower_vertex(&mut self, v: u32, distance: f32, offset: f32, limit: &impl Fn(u32) -> f32) {
        let front = &mut self.front[v as usize];
        // The first spoke of a closed fan is the last one too.
        if distance >= front.distance || distance > limit(v) {
            return;
        }
        if front.distance == f32::INFINITY {
            self.touched.push(v);
        }
        front.distance = distance;
        front.offset = offset;
        if !front.passed.is_nan() {
            front.passed = distance;
        }
        self.queue.push(distance, v);
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
        let mut total = 0.0;
        for (face, f) in faces.iter().enumerate() {
            for i in 0..3 {
                let [a, b, c] = [f[i], f[(i + 1) % 3], f[(i + 2) % 3]];
                let (corner, at) = corner(vertices, a, b, c, factor(face));
                total += f64::from(corner.lengths[0]);
                corners[fill[a as usize] as usize] = corner;
                fill[a as usize] += 1;
                angle[a as usize] += at;
            }
        }
        let mut spokes = Vec::with_capacity(n);
        let mut fan_starts = Vec::with_capacity(n + 1);
        fan_starts.push(0);
        let mut bends: Vec<bool> = angle.iter().map(|&a| a > std::f64::consts::TAU).collect();
        let mut ends = Vec::new();
        for (v, row) in (0..).zip(starts.windows(2)) {
            let around = &mut corners[row[0] as usize..row[1] as usize];
            // An edge is in two faces, or paths bend at its ends.
            ends.clear();
            ends.extend(around.iter().flat_map(|corner| corner.ends));
            ends.sort_unstable();
            bends[v as usize] |= ends.chunk_by(|a, b| a == b).any(|run| run.len() != 2);
            add_fans(v, around, &mut spokes);
            fan_starts.push(spokes.len() as u32);
        }
        let mean_edge = (total / corners.len().max(1) as f64) as f32;
        Self {
            starts: fan_starts,
            spokes,
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
        vectorised(
            #[inline(always)]
            || self.run([seeds], from_mut(workspace), |_| bound),
        );
        workspace.write(out);
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

    /// Marches from each of `seeds` in its workspace; a vertex takes part while its distance is at most `limit` of it.
    #[inline(always)]
    pub(super) fn run<const M: usize>(
        &self,
        seeds: [&[Seed]; M],
        workspaces: &mut [Workspace; M],
        limit: impl Fn(u32) -> f32,
    ) {
        for (workspace, seeds) in workspaces.iter_mut().zip(seeds) {
            workspace.begin(seeds, &limit);
        }
        loop {
            let mut vertices = [None; M];
            for (vertex, workspace) in vertices.iter_mut().zip(&mut *workspaces) {
                *vertex = workspace.next();
            }
            if vertices.iter().all(Option::is_none) {
                break;
            }
            self.step(vertices, workspaces, &limit);
        }
    }

    /// Passes the next vertex of each march, if there is one, and lowers its neighbours.
    ///
    /// What the first blocks' neighbours get is worked out for all marches before anything branches on it: it is a
    /// chain of roots and divisions, and the processor works on several at once. Loops instead of closures, which
    /// would not be compiled for vector registers.
    #[inline(always)]
    fn step<const M: usize>(
        &self,
        vertices: [Option<u32>; M],
        workspaces: &mut [Workspace; M],
        limit: &impl Fn(u32) -> f32,
    ) {
        let mut passings = [Passing::NONE; M];
        let mut reached = [Reached::NOTHING; M];
        for m in 0..M {
            if let Some(vertex) = vertices[m] {
                passings[m] = self.pass(vertex, &mut workspaces[m]);
            }
        }
        for m in 0..M {
            if passings[m].first < passings[m].end {
                reached[m] = self.reach(&passings[m], passings[m].first, &workspaces[m]);
            }
        }
        for m in 0..M {
            let passing = passings[m];
            let mut reached = reached[m];
            for block in passing.first..passing.end {
                if block > passing.first {
                    reached = self.reach(&passing, block, &workspaces[m]);
                }
                // Where a vertex that was passed too early is opened, what the others get has changed.
                while workspaces[m].lower(&self.spokes[block], &reached, limit) {
                    reached = self.reach(&passing, block, &workspaces[m]);
                }
            }
        }
    }

    #[inline(always)]
    fn pass(&self, vertex: u32, workspace: &mut Workspace) -> Passing {
        let from = &mut workspace.front[vertex as usize];
        from.passed = from.distance;
        Passing {
            from: *from,
            edge_offset: if self.bends[vertex as usize] {
                from.distance
            } else {
                from.offset
            },
            first: self.starts[vertex as usize] as usize,
            end: self.starts[vertex as usize + 1] as usize,
        }
    }

    #[inline(always)]
    fn reach(&self, passing: &Passing, block: usize, workspace: &Workspace) -> Reached {
        let spokes = &self.spokes[block];
        let mut fronts = [FAR; LANES];
        for (front, &v) in fronts.iter_mut().zip(&spokes.vertex) {
            *front = workspace.front[v as usize];
        }
        Reached::new(passing.from, passing.edge_offset, spokes, &fronts)
    }
}

/// A vertex that is being passed, and its blocks of spokes.
#[derive(Debug, Clone, Copy)]
struct Passing {
    from: Front,
    /// Offset of what goes along its edges.
    edge_offset: f32,
    first: usize,
    end: usize,
}

impl Passing {
    /// None, without blocks.
    const NONE: Self = Self {
        from: FAR,
        edge_offset: 0.0,
        first: 0,
        end: 0,
    };
}

/// What vertices at the other ends of spokes get from the end that they share.
#[derive(Debug, Clone, Copy)]
struct Reached {
    distance: [f32; LANES],
    offset: [f32; LANES],
    /// Bit by bit, which distances are lower than before.
    lower: u32,
    /// Bit by bit, which vertices were passed before.
    passed: u32,
}

impl Reached {
    const NOTHING: Self = Self {
        distance: [0.0; LANES],
        offset: [0.0; LANES],
        lower: 0,
        passed: 0,
    };

    /// From the end `from`, which was passed last, by the edge, where `edge_offset` is the offset, or across an edge
    /// to another vertex that was passed.
    #[expect(
        clippy::needless_bitwise_bool,
        reason = "behind a branch roots would not be taken in vector registers"
    )]
    #[inline(always)]
    fn new(from: Front, edge_offset: f32, spokes: &Spokes, fronts: &[Front; LANES]) -> Self {
        let Spokes {
            length, cos, sin, ..
        } = *spokes;
        let next_length = next(length);
        let passed = from_fn(|i| fronts[i].passed);
        let next_passed = next(passed);

        // Of each edge the unfolded source at (x, −y): the shared end at the origin, the other at (length, 0).
        let mut offset = [0.0; LANES];
        let mut x = [0.0; LANES];
        let mut y = [0.0; LANES];
        for i in 0..LANES {
            offset[i] = from.offset.min(fronts[i].offset);
            let (ra, rb) = (from.distance - offset[i], passed[i] - offset[i]);
            x[i] = 0.5 * ((ra - rb) * (ra + rb) / length[i] + length[i]);
            let y_squared = (ra - x[i]) * (ra + x[i]);
            // Written so that NaN, of what was not passed too, stays NaN.
            let touches = y_squared >= -TOUCHING_SLACK * length[i] * length[i];
            y[i] = y_squared.max(0.0).sqrt() + if touches { 0.0 } else { f32::NAN };
        }
        let (next_x, next_y, next_offset) = (next(x), next(y), next(offset));

        // In each triangle, to the next spoke's end across this edge, and to this one's across the next edge. A vertex
        // passed earlier can only gain where its angle is obtuse.
        let mut to_next = [0.0; LANES];
        let mut to_this = [0.0; LANES];
        for i in 0..LANES {
            let place = (next_length[i] * cos[i], next_length[i] * sin[i]);
            let open = next_passed[i].is_nan() | (length[i] * cos[i] > next_length[i]);
            to_next[i] = offset[i]
                + across((x[i], y[i]), length[i], place)
                + if open { 0.0 } else { f32::INFINITY };
        }
        for i in 0..LANES {
            let place = (length[i] * cos[i], length[i] * sin[i]);
            let open = passed[i].is_nan() | (next_length[i] * cos[i] > length[i]);
            to_this[i] = next_offset[i]
                + across((next_x[i], next_y[i]), next_length[i], place)
                + if open { 0.0 } else { f32::INFINITY };
        }

        let from_previous = previous(to_next);
        let previous_offset = previous(offset);
        let mut reached = Self {
            distance: [0.0; LANES],
            offset: [0.0; LANES],
            lower: 0,
            passed: 0,
        };
        for i in 0..LANES {
            let mut best = (from.distance + length[i], edge_offset);
            if from_previous[i] < best.0 {
                best = (from_previous[i], previous_offset[i]);
            }
            if to_this[i] < best.0 {
                best = (to_this[i], next_offset[i]);
            }
            (reached.distance[i], reached.offset[i]) = best;
        }
        for i in 0..LANES {
            let distance = reached.distance[i];
            let gain = (LEAST_GAIN_OF_EDGE * length[i]).max(LEAST_GAIN_OF_DISTANCE * distance);
            let gain = if passed[i].is_nan() { 0.0 } else { gain };
            reached.lower |= u32::from(distance + gain < fronts[i].distance) << i;
            reached.passed |= u32::from(!passed[i].is_nan()) << i;
        }
        reached
    }
}

/// Of each lane the value of the one after it; written out, it becomes one instruction.
#[inline(always)]
fn next([a, b, c, d, e, f, g, h]: [f32; LANES]) -> [f32; LANES] {
    [b, c, d, e, f, g, h, a]
}

/// Of each lane the value of the one before it.
#[inline(always)]
fn previous([a, b, c, d, e, f, g, h]: [f32; LANES]) -> [f32; LANES] {
    [h, a, b, c, d, e, f, g]
}

/// Distance from a source unfolded to (x, −y) of the vertex at a place above the edge from (0, 0) to (edge, 0),
/// infinite when the ray does not cross the edge.
#[expect(
    clippy::needless_bitwise_bool,
    reason = "behind a branch roots would not be taken in vector registers"
)]
#[inline(always)]
fn across((x, y): (f32, f32), edge: f32, (cx, cy): (f32, f32)) -> f32 {
    let drop = y + cy;
    let crossing = x * cy + cx * y;
    let slack = CROSSING_SLACK * edge * drop;
    let distance = ((cx - x) * (cx - x) + drop * drop).sqrt();
    // Written so that NaN from a degenerate triangle fails.
    let crosses = (drop > 0.0) & (crossing >= -slack) & (crossing <= edge * drop + slack);
    distance + if crosses { 0.0 } else { f32::INFINITY }
}

/// A triangle as seen from one corner: the other two and the lengths of the edges there, cosine and sine of the angle
/// between.
#[derive(Debug, Clone, Copy)]
struct Corner {
    ends: [u32; 2],
    lengths: [f32; 2],
    cos: f32,
    sin: f32,
}

impl Corner {
    /// Seen from behind.
    fn turn(&mut self) {
        self.ends.swap(0, 1);
        self.lengths.swap(0, 1);
    }
}

const NO_CORNER: Corner = Corner {
    ends: [0; 2],
    lengths: [0.0; 2],
    cos: 1.0,
    sin: 0.0,
};

/// The triangle as seen from `a`, its lengths times `factor`, and its angle there.
fn corner(vertices: &[Point], a: u32, b: u32, c: u32, factor: f64) -> (Corner, f64) {
    let [p, q, r] = [a, b, c].map(|v| vertices[v as usize]);
    let (u, v) = (vector::sub(q, p), vector::sub(r, p));
    let (along, across) = (vector::dot(u, v), vector::norm(vector::cross(u, v)));
    let lengths = [u, v].map(vector::norm);
    let product = lengths[0] * lengths[1];
    let (cos, sin) = if product > 0.0 {
        ((along / product) as f32, (across / product) as f32)
    } else {
        (NO_CORNER.cos, NO_CORNER.sin)
    };
    let corner = Corner {
        ends: [b, c],
        lengths: lengths.map(|length| (factor * length) as f32),
        cos,
        sin,
    };
    (corner, across.atan2(along))
}

/// Adds the triangles around vertex `v` to the spokes, in as few fans as the edges that they share allow; where they are
/// too many to be compared, each is a fan of its own.
fn add_fans(v: u32, mut corners: &mut [Corner], spokes: &mut Vec<Spokes>) {
    let none = Spokes {
        length: [0.0; LANES],
        cos: [f32::NAN; LANES],
        sin: [f32::NAN; LANES],
        vertex: [v; LANES],
    };
    let mut filled = LANES;
    let mut add = |corner: &Corner, end: usize| {
        if filled == LANES {
            spokes.push(none);
            filled = 0;
        }
        if let Some(last) = spokes.last_mut() {
            last.vertex[filled] = corner.ends[end];
            last.length[filled] = corner.lengths[end];
            // Nothing follows the last spoke of a block.
            if end == 0 && filled + 1 < LANES {
                (last.cos[filled], last.sin[filled]) = (corner.cos, corner.sin);
            }
            filled += 1;
        }
        filled == LANES
    };
    while !corners.is_empty() {
        let mut grown = 1;
        // To one side and then to the other.
        for _ in 0..2 {
            grown = grow(corners, grown);
            corners[..grown].reverse();
            corners[..grown].iter_mut().for_each(Corner::turn);
        }
        let (fan, others) = corners.split_at_mut(grown);
        for corner in &*fan {
            // Where a block ends the spoke is repeated in the next.
            if add(corner, 0) {
                add(corner, 0);
            }
        }
        if let Some(last) = fan.last() {
            add(last, 1);
        }
        corners = others;
    }
}

/// Lengthens the fan that the first `grown` corners are by others, put behind it; returns the new number.
fn grow(corners: &mut [Corner], mut grown: usize) -> usize {
    if corners.len() > MOST_COMPARED {
        return grown;
    }
    loop {
        let last = corners[grown - 1];
        let shared = |other: &Corner, end: usize| {
            other.ends[end] == last.ends[1] && other.lengths[end] == last.lengths[1]
        };
        let others = &mut corners[grown..];
        let Some(next) = others.iter().position(|o| shared(o, 0) || shared(o, 1)) else {
            return grown;
        };
        if !shared(&others[next], 0) {
            others[next].turn();
        }
        others.swap(0, next);
        grown += 1;
    }
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
