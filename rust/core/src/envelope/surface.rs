//! The zero level set of values on the grid, as a closed manifold.
//!
//! Surface nets: one vertex in every cell with corners inside and outside, at the mean of the crossings of its edges, and
//! one quadrilateral around every edge of the grid from inside to outside. That is a 2-manifold when the set of inside
//! points is *well-composed*: no square of four neighbouring points has only its two diagonals inside and outside, and
//! no cube only two opposite corners. Points of least value in such squares and cubes change sides until there is none.
//!
//! # Source
//! Gibson, "Constrained elastic surface nets", 1998, for the vertices; Latecki, "3D well-composed pictures", 1997,
//! for the condition; the rest is here.

use std::collections::VecDeque;

use rayon::prelude::*;

use super::grid::{Grid, INSIDE, OUTSIDE, POINTS, SIDE, Values, local};
use super::place::{Place, add, cross, dot, scaled, sub};
use crate::envelope::settings::SURFACE;

/// Points along an axis of a brick with the first ones of the next.
const WIDE: usize = SIDE + 1;

/// Values on a grid; inside they are negative.
#[derive(Debug, Clone)]
pub(super) struct Level {
    pub grid: Grid,
    pub values: Vec<Values<f32>>,
    /// What is beyond the bricks with values.
    pub far: f32,
}

/// Corners of a cell in the order of its mask's bits.
fn corner(bit: usize) -> [usize; 3] {
    [bit & 1, bit >> 1 & 1, bit >> 2 & 1]
}

/// How many squares with only the diagonals alike a cell has, and whether only two opposite corners are alike.
fn faults(mask: u8) -> u32 {
    let bit = |at: usize| mask >> at & 1;
    let mut count = 0;
    for axis in 0..3 {
        let (b, c) = (1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3));
        for side in [0, 1 << axis] {
            let square = [side, side | b, side | b | c, side | c].map(bit);
            count += u32::from(square == [0, 1, 0, 1] || square == [1, 0, 1, 0]);
        }
    }
    let two = if mask.count_ones() == 2 { mask } else { !mask };
    if two.count_ones() == 2 && (0..4).any(|at| two == 1 << at | 1 << (7 - at)) {
        count += 1;
    }
    count
}

impl Level {
    pub fn value(&self, point: [usize; 3]) -> f32 {
        match self.grid.slot(point) {
            slot @ (OUTSIDE | INSIDE) => Grid::constant(slot, self.far),
            slot => self.values[slot as usize][local(point)],
        }
    }

    /// Gives values to all bricks beside those that have some: cells at their border can then change too.
    pub fn widen(&mut self) {
        for slot in 0..self.grid.active.len() {
            let around: Vec<u32> = self.grid.around(self.grid.active[slot]).collect();
            for brick in around {
                if let slot @ (OUTSIDE | INSIDE) = self.grid.slots[brick as usize] {
                    self.grid.activate(brick);
                    self.values.push([Grid::constant(slot, self.far); POINTS]);
                }
            }
        }
    }

    /// Values of a brick with the first ones of the next along each axis.
    fn wide(&self, brick: u32) -> [f32; WIDE * WIDE * WIDE] {
        let corner = self.grid.corner(brick);
        let own = &self.values[self.grid.slots[brick as usize] as usize];
        std::array::from_fn(|n| {
            let at = [n % WIDE, n / WIDE % WIDE, n / (WIDE * WIDE)];
            if at.iter().all(|&x| x < SIDE) {
                own[local(at)]
            } else {
                self.value([0, 1, 2].map(|i| corner[i] + at[i]))
            }
        })
    }

    /// Makes the inside well-composed; returns how many points changed sides.
    pub fn compose(&mut self) -> usize {
        let faulty: Vec<Vec<[usize; 3]>> = self
            .grid
            .active
            .par_iter()
            .map(|&brick| {
                let wide = self.wide(brick);
                let cells = self.grid.points(brick).enumerate();
                cells
                    .filter(|&(cell, _)| faults(mask_of(&wide, cell)) > 0)
                    .map(|(_, point)| point)
                    .collect()
            })
            .collect();
        let mut queue: VecDeque<[usize; 3]> = faulty.into_iter().flatten().collect();
        let mut turned = std::collections::HashSet::new();
        while let Some(cell) = queue.pop_front() {
            let corners: [[usize; 3]; 8] =
                std::array::from_fn(|bit| [0, 1, 2].map(|i| cell[i] + corner(bit)[i]));
            let values = corners.map(|point| self.value(point));
            let mask = (0..8).fold(0, |mask, bit| mask | u8::from(values[bit] < 0.0) << bit);
            let before = faults(mask);
            if before == 0 {
                continue;
            }
            let helps = |bit: &usize| faults(mask ^ 1 << bit) < before;
            let least = |a: &usize, b: &usize| values[*a].abs().total_cmp(&values[*b].abs());
            let free = (0..8).filter(|&bit| !turned.contains(&corners[bit]));
            // Points that only ever change to inside end somewhere, at the latest with all of them.
            let bit = free.filter(helps).min_by(least).or_else(|| {
                let outside = (0..8).filter(|&bit| mask >> bit & 1 == 0);
                outside.min_by_key(|&bit| faults(mask ^ 1 << bit))
            });
            let bit = bit.expect("a cell with a fault has a corner outside");
            let point = corners[bit];
            turned.insert(point);
            let slot = self.grid.slot(point) as usize;
            let value = &mut self.values[slot][local(point)];
            *value = if *value < 0.0 {
                self.grid.step * SURFACE.least_part
            } else {
                -self.grid.step * SURFACE.least_part
            };
            // All cells of which the point is a corner, this one among them.
            for bit in 0..8 {
                queue.push_back([0, 1, 2].map(|i| point[i] - corner(bit)[i]));
            }
        }
        turned.len()
    }
}

/// Corners inside of a cell of a brick.
fn mask_of(wide: &[f32; WIDE * WIDE * WIDE], cell: usize) -> u8 {
    let at = [cell % SIDE, cell / SIDE % SIDE, cell / (SIDE * SIDE)];
    (0..8).fold(0, |mask, bit| {
        mask | u8::from(wide[wide_index(at, corner(bit))] < 0.0) << bit
    })
}

fn wide_index(at: [usize; 3], shift: [usize; 3]) -> usize {
    (at[0] + shift[0]) + WIDE * ((at[1] + shift[1]) + WIDE * (at[2] + shift[2]))
}

/// A closed surface of quadrilaterals.
#[derive(Debug)]
pub(super) struct Nets {
    pub vertices: Vec<Place>,
    /// Corners counter-clockwise from outside.
    pub quads: Vec<[u32; 4]>,
    /// First vertex of each brick with values.
    first: Vec<u32>,
    /// Cells of each such brick that have a vertex.
    cells: Vec<u64>,
}

impl Nets {
    /// Surface of a well-composed inside.
    pub fn of(level: &Level) -> Self {
        let grid = &level.grid;
        let made: Vec<(u64, Vec<Place>)> = grid
            .active
            .par_iter()
            .map(|&brick| vertices_of(level, brick))
            .collect();
        let mut first = Vec::with_capacity(made.len());
        let mut vertices = Vec::new();
        for (_, own) in &made {
            first.push(vertices.len() as u32);
            vertices.extend_from_slice(own);
        }
        let cells = made.into_iter().map(|(cells, _)| cells).collect();
        let mut nets = Self {
            vertices,
            quads: Vec::new(),
            first,
            cells,
        };
        let quads: Vec<Vec<[u32; 4]>> = grid
            .active
            .par_iter()
            .map(|&brick| nets.quads_of(level, brick))
            .collect();
        nets.quads = quads.concat();
        nets
    }

    /// Vertex in a cell, when it has one.
    pub fn vertex(&self, grid: &Grid, cell: [usize; 3]) -> Option<u32> {
        let slot = grid.slot(cell);
        if slot == OUTSIDE || slot == INSIDE {
            return None;
        }
        let (slot, bit) = (slot as usize, 1u64 << local(cell));
        let cells = self.cells[slot];
        (cells & bit != 0).then(|| self.first[slot] + (cells & (bit - 1)).count_ones())
    }

    fn quads_of(&self, level: &Level, brick: u32) -> Vec<[u32; 4]> {
        let wide = level.wide(brick);
        let mut quads = Vec::new();
        for (n, point) in level.grid.points(brick).enumerate() {
            let at = [n % SIDE, n / SIDE % SIDE, n / (SIDE * SIDE)];
            let own = wide[wide_index(at, [0; 3])] < 0.0;
            for axis in 0..3 {
                let mut shift = [0; 3];
                shift[axis] = 1;
                if (wide[wide_index(at, shift)] < 0.0) == own {
                    continue;
                }
                let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
                let cell = |back: [usize; 2]| {
                    let mut cell = point;
                    cell[b] -= back[0];
                    cell[c] -= back[1];
                    self.vertex(&level.grid, cell)
                        .expect("cells at a crossed edge have a vertex")
                };
                let mut quad = [cell([0, 0]), cell([1, 0]), cell([1, 1]), cell([0, 1])];
                if !own {
                    quad.reverse();
                }
                quads.push(quad);
            }
        }
        quads
    }
}

/// Cells of a brick with a vertex, and the vertices.
fn vertices_of(level: &Level, brick: u32) -> (u64, Vec<Place>) {
    let wide = level.wide(brick);
    let mut cells = 0;
    let mut vertices = Vec::new();
    for (n, point) in level.grid.points(brick).enumerate() {
        let mask = mask_of(&wide, n);
        if mask == 0 || mask == u8::MAX {
            continue;
        }
        let at = [n % SIDE, n / SIDE % SIDE, n / (SIDE * SIDE)];
        let value = |bit: usize| wide[wide_index(at, corner(bit))];
        let (mut sum, mut count) = ([0.0; 3], 0.0);
        for bit in 0..8 {
            for axis in 0..3 {
                let other = bit | 1 << axis;
                if other == bit || (mask >> bit & 1) == (mask >> other & 1) {
                    continue;
                }
                let (a, b) = (value(bit), value(other));
                let mut crossing = corner(bit).map(|x| x as f32);
                crossing[axis] = (a / (a - b)).clamp(SURFACE.least_part, 1.0 - SURFACE.least_part);
                sum = add(sum, crossing);
                count += 1.0;
            }
        }
        cells |= 1 << n;
        let within = scaled(sum, level.grid.step / count);
        vertices.push(add(level.grid.place(point), within));
    }
    (cells, vertices)
}

/// Two triangles of a quadrilateral, cut so that the worse of them is as good as can be.
pub(super) fn halved(vertices: &[Place], quad: [u32; 4]) -> [[u32; 3]; 2] {
    let [a, b, c, d] = quad;
    let along = |cut: [[u32; 3]; 2]| (cut.map(|t| shape(vertices, t)), cut);
    let worse = |(shapes, _): &([f32; 2], [[u32; 3]; 2])| shapes[0].min(shapes[1]);
    let (one, other) = (along([[a, b, c], [a, c, d]]), along([[a, b, d], [b, c, d]]));
    if worse(&other) > worse(&one) {
        other.1
    } else {
        one.1
    }
}

/// Area over the squared longest edge, twice: how far a triangle is from a needle.
fn shape(vertices: &[Place], triangle: [u32; 3]) -> f32 {
    let [a, b, c] = triangle.map(|v| vertices[v as usize]);
    let (ab, bc, ca) = (sub(b, a), sub(c, b), sub(a, c));
    let longest = [ab, bc, ca]
        .map(|e| dot(e, e))
        .into_iter()
        .fold(0.0, f32::max);
    let normal = cross(ab, ca);
    dot(normal, normal).sqrt() / longest
}
