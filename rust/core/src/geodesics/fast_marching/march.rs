//! Marches step by step: from their seeds, the nearest vertex is passed and its neighbours are lowered.

use super::layout::{FastMarching, Spokes};
use super::update::{FAR, Front, Reached};
use crate::algebra::dense::LANES;
use crate::algebra::vector;
use crate::geodesics::front_queue::FrontQueue;
use crate::mesh::Mesh;

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
        self.passed().map(|(v, front)| (v, front.distance))
    }

    /// What the last march knows of the vertices that it reached.
    pub(super) fn passed(&self) -> impl Iterator<Item = (u32, Front)> + '_ {
        self.touched.iter().filter_map(|&v| {
            let front = self.front[v as usize];
            (!front.passed.is_nan()).then_some((v, front))
        })
    }

    /// Distances of all vertices, infinite where the last march did not come.
    pub(super) fn write(&self, out: &mut [f32]) {
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
    /// Marches from each of `seeds` in its workspace; a vertex takes part while its distance is at most `limit` of it.
    #[inline(always)]
    pub(in crate::geodesics) fn run<const M: usize>(
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
