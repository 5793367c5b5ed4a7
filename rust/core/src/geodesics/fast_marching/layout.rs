//! Layout of a mesh for marching: the edges around each vertex as fans of spokes, in blocks for vector registers.

use crate::algebra::dense::LANES;
use crate::algebra::vector::{self, Point};

/// Triangles around a vertex of which those that share an edge are looked for one by one.
const MOST_COMPARED: usize = 64;

/// Edges as seen from the end that they share, side by side in vector registers. They are spokes of fans: each spans a
/// triangle with the next. A closed fan ends with the spoke that it starts with, and one that goes on in the next
/// block starts there with the last spoke of this.
#[derive(Debug, Clone, Copy)]
#[repr(align(32))]
pub(super) struct Spokes {
    /// Length of each.
    pub(super) length: [f32; LANES],
    /// Cosine and sine of the angle to the next spoke, NaN for the last one of a fan.
    pub(super) cos: [f32; LANES],
    pub(super) sin: [f32; LANES],
    /// The other end; where there is no spoke, that which they share.
    pub(super) vertex: [u32; LANES],
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
    pub(super) starts: Vec<u32>,
    pub(super) spokes: Vec<Spokes>,
    /// Whether shortest paths can bend at a vertex: saddles and boundary vertices, `(n)`.
    pub(super) bends: Vec<bool>,
    /// Mean edge length, an edge counted once a face.
    pub(super) mean_edge: f32,
}

impl FastMarching {
    pub(super) fn laid_out(
        vertices: &[Point],
        faces: &[[u32; 3]],
        factor: impl Fn(usize) -> f64,
    ) -> Self {
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
