//! Distances from many sources at once: they are swept over the vertices in the order of another source's march.

use super::layout::FastMarching;
use super::march::{Seed, Workspace};
use super::update::{across, unfolded};
use crate::algebra::dense::{LANES, vectorised};
use crate::algebra::packed::{packed, unpacked};
use crate::geodesics::settings::SWEEP;

/// Sources that are swept together, each in a lane of its own.
pub(in crate::geodesics) const TOGETHER: usize = 2 * LANES;

/// A triangle as seen from one corner, over the edge between the others.
#[derive(Debug, Clone, Copy)]
struct Triangle {
    /// The other corners; the same twice where an edge is in no further triangle.
    ends: [u32; 2],
    /// Length of the edge to the first of them, and whether paths bend there.
    length: f32,
    bends: bool,
    /// Length of the edge between them, NaN where there is no triangle.
    edge: f32,
    /// Place of the corner above that edge, which runs from (0, 0) to (`edge`, 0).
    place: (f32, f32),
}

/// What is known of a vertex, source by source.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
struct Fronts {
    distance: [f32; TOGETHER],
    /// Distance of the (pseudo-)source that the vertex sees straight.
    offset: [f32; TOGETHER],
}

const NOWHERE: Fronts = Fronts {
    distance: [f32::INFINITY; TOGETHER],
    offset: [0.0; TOGETHER],
};

/// A mesh laid out for sweeping: the triangles around each vertex.
///
/// A vertex that is visited takes from its neighbours what lowers it, for all sources in one vector register; the same
/// circles go across edges as in a march. Sweeps go through the vertices in the order of a march from some source
/// nearby, forwards and backwards, and visit those that a neighbour may lower, until there are none. For 120 sources on 5,000
/// vertices they take half of the time of as many marches, and distances differ by 0.02 % of √area.
///
/// # Source
/// Sweeping of distances in alternating order: J. Qian, Y.-T. Zhang, H.-K. Zhao, "Fast sweeping methods for eikonal
/// equations on triangular meshes", SIAM J. Numer. Anal. 45 (2007).
#[derive(Debug)]
pub(in crate::geodesics) struct Sweeping<'a> {
    marching: &'a FastMarching,
    /// Start of the triangles of each vertex, `(n + 1)`.
    starts: Vec<u32>,
    triangles: Vec<Triangle>,
    least_gain: f32,
}

impl<'a> Sweeping<'a> {
    /// Lays out what marches run on.
    pub(in crate::geodesics) fn new(marching: &'a FastMarching) -> Self {
        let mut triangles = Vec::with_capacity(LANES * marching.spokes.len());
        let mut starts = vec![0];
        for (v, blocks) in (0..).zip(marching.starts.windows(2)) {
            for spokes in &marching.spokes[blocks[0] as usize..blocks[1] as usize] {
                for i in (0..LANES).filter(|&i| spokes.vertex[i] != v) {
                    let (end, length) = (spokes.vertex[i], spokes.length[i]);
                    let mut triangle = Triangle {
                        ends: [end; 2],
                        length,
                        bends: marching.bends[end as usize],
                        edge: f32::NAN,
                        place: (0.0, 0.0),
                    };
                    // The last spoke of a fan or of a block spans nothing.
                    if !spokes.cos[i].is_nan() {
                        let next = spokes.length[i + 1];
                        let (along, above) = (next * spokes.cos[i], next * spokes.sin[i]);
                        let edge = (length - along).hypot(above);
                        triangle.ends[1] = spokes.vertex[i + 1];
                        triangle.edge = edge;
                        triangle.place = (length * (length - along) / edge, length * above / edge);
                    }
                    triangles.push(triangle);
                }
            }
            starts.push(triangles.len() as u32);
        }
        Self {
            marching,
            starts,
            triangles,
            least_gain: SWEEP.least_gain.0 * marching.mean_edge,
        }
    }

    fn around(&self, v: u32) -> &[Triangle] {
        let v = v as usize;
        &self.triangles[self.starts[v] as usize..self.starts[v + 1] as usize]
    }

    /// Distances from at most [`TOGETHER`] sources to all vertices, `out` one column `(n)` for each; infinite where
    /// unreachable. `guide` holds the distances `(n)` from the source in whose order they are swept.
    pub(in crate::geodesics) fn run(
        &self,
        sources: &[u32],
        guide: &[f32],
        workspace: &mut Workspace,
        out: &mut [&mut [f32]],
    ) {
        let mut order: Vec<u64> = (0..).zip(guide).map(|(v, &d)| packed(d, v)).collect();
        order.sort_unstable();
        let order: Vec<u32> = order.into_iter().map(|key| unpacked(key).1).collect();
        let mut fronts = vec![NOWHERE; guide.len()];
        let mut waiting = vec![false; guide.len()];
        for (lane, &source) in sources.iter().enumerate() {
            let bound = SWEEP.marched * guide[source as usize];
            self.marching
                .run_seeds(&[Seed::at(source)], bound, workspace);
            for (v, front) in workspace.passed() {
                fronts[v as usize].distance[lane] = front.distance;
                fronts[v as usize].offset[lane] = front.offset;
                for triangle in self.around(v) {
                    waiting[triangle.ends[0] as usize] = true;
                }
            }
        }
        vectorised(
            #[inline(always)]
            || self.sweep(&order, &mut fronts, &mut waiting),
        );
        for (lane, out) in out.iter_mut().enumerate() {
            for (out, fronts) in out.iter_mut().zip(&fronts) {
                *out = fronts.distance[lane];
            }
        }
    }

    /// Sweeps until nothing changes.
    #[inline(always)]
    fn sweep(&self, order: &[u32], fronts: &mut [Fronts], waiting: &mut [bool]) {
        for doubling in (0..=SWEEP.doublings).rev() {
            let near = &order[..order.len() >> doubling];
            loop {
                let forwards = self.pass(near.iter(), fronts, waiting);
                let backwards = self.pass(near.iter().rev(), fronts, waiting);
                if !forwards && !backwards {
                    break;
                }
            }
        }
    }

    /// Visits the vertices that wait; true when there was one.
    #[inline(always)]
    fn pass<'b>(
        &self,
        order: impl Iterator<Item = &'b u32>,
        fronts: &mut [Fronts],
        waiting: &mut [bool],
    ) -> bool {
        let mut visited = false;
        for &v in order {
            if !waiting[v as usize] {
                continue;
            }
            visited = true;
            waiting[v as usize] = false;
            let lowered = self.lowered(v, fronts);
            let gained = self.gained(&fronts[v as usize], &lowered);
            fronts[v as usize] = lowered;
            for triangle in self.around(v) {
                let [a, b] = triangle.ends.map(|end| end as usize);
                // Across an obtuse angle a vertex lowers one that is nearer than itself.
                let (before, behind) = (-triangle.place.0, triangle.place.0 - triangle.edge);
                waiting[a] |= any_below(&gained, &fronts[a].distance, before.max(0.0));
                if behind > 0.0 {
                    waiting[b] |= any_below(&gained, &fronts[b].distance, behind);
                }
            }
        }
        visited
    }

    /// A vertex after it took from its neighbours what lowers it.
    ///
    /// Loops over the lanes one after the other, each of which becomes a few instructions.
    #[inline(always)]
    fn lowered(&self, v: u32, fronts: &[Fronts]) -> Fronts {
        let Fronts {
            mut distance,
            mut offset,
        } = fronts[v as usize];
        for triangle in self.around(v) {
            let [a, b] = triangle.ends.map(|end| fronts[end as usize]);
            let along = if triangle.bends { a.distance } else { a.offset };
            for i in 0..TOGETHER {
                let by_edge = a.distance[i] + triangle.length;
                let lower = by_edge < distance[i];
                distance[i] = if lower { by_edge } else { distance[i] };
                offset[i] = if lower { along[i] } else { offset[i] };
            }
            let edge = triangle.edge;
            let mut least = [0.0; TOGETHER];
            let (mut x, mut y) = ([0.0; TOGETHER], [0.0; TOGETHER]);
            for i in 0..TOGETHER {
                least[i] = if a.offset[i] < b.offset[i] {
                    a.offset[i]
                } else {
                    b.offset[i]
                };
                let (ra, rb) = (a.distance[i] - least[i], b.distance[i] - least[i]);
                (x[i], y[i]) = unfolded(ra, rb, edge);
            }
            let mut over = [0.0; TOGETHER];
            for i in 0..TOGETHER {
                over[i] = least[i] + across((x[i], y[i]), edge, triangle.place);
            }
            for i in 0..TOGETHER {
                let lower = over[i] < distance[i];
                distance[i] = if lower { over[i] } else { distance[i] };
                offset[i] = if lower { least[i] } else { offset[i] };
            }
        }
        Fronts { distance, offset }
    }

    /// Distances that neighbours should hear of, infinite where too little was gained.
    #[inline(always)]
    fn gained(&self, before: &Fronts, after: &Fronts) -> [f32; TOGETHER] {
        let mut gained = after.distance;
        for (distance, before) in gained.iter_mut().zip(before.distance) {
            let told = *distance + self.least_gain + SWEEP.least_gain.1 * *distance < before;
            *distance += if told { 0.0 } else { f32::INFINITY };
        }
        gained
    }
}

/// Whether any of `a` is below that of `b`, or above it by less than `slack`.
#[inline(always)]
fn any_below(a: &[f32; TOGETHER], b: &[f32; TOGETHER], slack: f32) -> bool {
    let mut below = [0.0f32; TOGETHER];
    for (below, (a, b)) in below.iter_mut().zip(a.iter().zip(b)) {
        *below = if a - slack < *b { 1.0 } else { 0.0 };
    }
    let any = below.iter().fold(0, |any, below| any | below.to_bits());
    any != 0
}
