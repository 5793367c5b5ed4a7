//! Shapes for the tests of several modules.

use std::f64::consts::TAU;

use crate::algebra::vector::Point;
use crate::matching::problem::constraints::Constraints;
use crate::matching::problem::pair::{Coverage, LeftOut, Mirror, Pair};
use crate::shape::Shape;
use crate::watch::progress::Progress;

/// Rings of a whole torus, and vertices of a ring.
pub const RINGS: usize = 48;
pub const AROUND: usize = 20;

/// The first so many rings of a torus with a thin and a thick side. Vertices have the same numbers in all.
pub fn torus(rings: usize) -> Shape {
    spiked(rings, &[])
}

/// Vertices on the inner side of a torus that are spikes.
pub const SPIKES: [u32; 4] = [10, 14, 33, 50];

/// The whole torus with spikes close to one another.
pub fn spiked_torus() -> Shape {
    spiked(RINGS, &SPIKES)
}

fn spiked(rings: usize, spikes: &[u32]) -> Shape {
    let (vertices, faces) = torus_mesh(rings, spikes, 0.0);
    Shape::new(&vertices, &faces, &Progress::default(), &|_, _| Ok(())).expect("a sound mesh")
}

/// The first so many rings of the torus, with spikes, and thicker by so much. Without all rings some vertices have no face.
pub fn torus_mesh(rings: usize, spikes: &[u32], thicker: f64) -> (Vec<Point>, Vec<[i64; 3]>) {
    const HEIGHT: f64 = 0.35;
    let at = |i: usize, j: usize| ((i % RINGS) * AROUND + j % AROUND) as i64;
    let angle = |i: usize, of: usize| TAU * i as f64 / of as f64;
    let vertices: Vec<_> = (0..RINGS * AROUND)
        .map(|number| {
            let (u, v) = (
                angle(number / AROUND, RINGS),
                angle(number % AROUND, AROUND),
            );
            let spike = spikes.contains(&(number as u32));
            let lifted = if spike { HEIGHT } else { 0.0 };
            let thick = 0.3 + 0.1 * u.cos() + 0.05 * (2.0 * u).sin() + lifted + thicker;
            let radius = 1.0 + thick * v.cos();
            [radius * u.cos(), radius * u.sin(), thick * v.sin()]
        })
        .collect();
    let strips = if rings < RINGS { rings - 1 } else { rings };
    let faces: Vec<_> = (0..strips)
        .flat_map(|i| (0..AROUND).map(move |j| (i, j)))
        .flat_map(|(i, j)| {
            let corner = at(i + 1, j + 1);
            [
                [at(i, j), at(i + 1, j), corner],
                [at(i, j), corner, at(i, j + 1)],
            ]
        })
        .collect();
    (vertices, faces)
}

/// Pseudo-random numbers below 2³¹ (Knuth's linear congruential generator, of which the first bits are best).
pub fn draws(mut state: u64) -> impl FnMut() -> u32 {
    move || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (state >> 33) as u32
    }
}

/// The same in [0, 1), exact in single precision.
pub fn fractions(state: u64) -> impl FnMut() -> f32 {
    let mut draw = draws(state);
    move || (draw() >> 7) as f32 / (1u32 << 24) as f32
}

/// A pair of which nothing is known but its coverage.
pub fn pair<'a>(
    source: &'a Shape,
    target: &'a Shape,
    coverage: Coverage,
    constraints: &'a Constraints,
) -> Pair<'a> {
    Pair {
        target,
        source,
        coverage,
        mirror: Mirror::Forbid,
        constraints,
        left_out: LeftOut::default(),
        lengths: 1.0,
        mirror_offsets: None,
    }
}
