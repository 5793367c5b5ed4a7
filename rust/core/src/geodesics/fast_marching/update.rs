//! Update across triangles: what the ends of a block of spokes get from the vertex that is passed.

use std::array::from_fn;

use super::layout::Spokes;
use crate::algebra::dense::LANES;
use crate::geodesics::settings::UPDATE;

/// What a march knows of a vertex.
#[derive(Debug, Clone, Copy)]
pub(super) struct Front {
    pub(super) distance: f32,
    /// The same once the vertex was passed, NaN before.
    pub(super) passed: f32,
    /// Distance of the (pseudo-)source that the vertex sees straight.
    pub(super) offset: f32,
}

pub(super) const FAR: Front = Front {
    distance: f32::INFINITY,
    passed: f32::NAN,
    offset: 0.0,
};

/// What vertices at the other ends of spokes get from the end that they share.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reached {
    pub(super) distance: [f32; LANES],
    pub(super) offset: [f32; LANES],
    /// Bit by bit, which distances are lower than before.
    pub(super) lower: u32,
    /// Bit by bit, which vertices were passed before.
    pub(super) passed: u32,
}

impl Reached {
    pub(super) const NOTHING: Self = Self {
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
    pub(super) fn new(
        from: Front,
        edge_offset: f32,
        spokes: &Spokes,
        fronts: &[Front; LANES],
    ) -> Self {
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
            (x[i], y[i]) = unfolded(ra, rb, length[i]);
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
            let gain = (UPDATE.least_gain_of_edge * length[i])
                .max(UPDATE.least_gain_of_distance * distance);
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

/// The source (x, −y) below the edge from (0, 0) to (edge, 0), at these distances from its ends; y is NaN when there is none.
#[inline(always)]
pub(super) fn unfolded(ra: f32, rb: f32, edge: f32) -> (f32, f32) {
    let x = 0.5 * ((ra - rb) * (ra + rb) / edge + edge);
    let y_squared = (ra - x) * (ra + x);
    // Written so that NaN, of what was not passed too, stays NaN.
    let touches = y_squared >= -UPDATE.touching_slack * edge * edge;
    (
        x,
        y_squared.max(0.0).sqrt() + if touches { 0.0 } else { f32::NAN },
    )
}

/// Distance from a source unfolded to (x, −y) of the vertex at a place above the edge from (0, 0) to (edge, 0),
/// infinite when the ray does not cross the edge.
#[expect(
    clippy::needless_bitwise_bool,
    reason = "behind a branch roots would not be taken in vector registers"
)]
#[inline(always)]
pub(super) fn across((x, y): (f32, f32), edge: f32, (cx, cy): (f32, f32)) -> f32 {
    let drop = y + cy;
    let crossing = x * cy + cx * y;
    let slack = UPDATE.crossing_slack * edge * drop;
    let distance = ((cx - x) * (cx - x) + drop * drop).sqrt();
    // Written so that NaN from a degenerate triangle fails.
    let crosses = (drop > 0.0) & (crossing >= -slack) & (crossing <= edge * drop + slack);
    distance + if crosses { 0.0 } else { f32::INFINITY }
}
