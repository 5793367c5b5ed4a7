//! Soups for the tests of envelopes.

use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

use super::place::Triangle;
use crate::algebra::vector::{self, Point};

#[derive(Debug, Clone)]
pub struct Soup {
    pub vertices: Vec<Point>,
    pub faces: Vec<[u32; 3]>,
}

impl Soup {
    pub(super) fn triangles(&self) -> Vec<Triangle> {
        let place = |v: u32| self.vertices[v as usize].map(|x| x as f32);
        let triangle = |f: &[u32; 3]| Triangle {
            corners: f.map(place),
            piece: 0,
        };
        self.faces.iter().map(triangle).collect()
    }

    pub fn moved(&self, by: Point) -> Self {
        self.mapped(|p| vector::add(p, by))
    }

    pub fn mapped(&self, place: impl Fn(Point) -> Point) -> Self {
        Self {
            vertices: self.vertices.iter().map(|&p| place(p)).collect(),
            faces: self.faces.clone(),
        }
    }

    pub fn with(mut self, other: &Self) -> Self {
        let count = self.vertices.len() as u32;
        self.vertices.extend_from_slice(&other.vertices);
        self.faces
            .extend(other.faces.iter().map(|f| f.map(|v| v + count)));
        self
    }

    /// V − E + F, when every edge has two faces that run along it in opposite directions.
    pub fn euler_characteristic(vertices: usize, faces: &[[u32; 3]]) -> i64 {
        let mut edges = BTreeMap::new();
        for &[a, b, c] in faces {
            for (u, v) in [(a, b), (b, c), (c, a)] {
                let (there, back) = edges.entry((u.min(v), u.max(v))).or_insert((0, 0));
                *if u < v { there } else { back } += 1;
            }
        }
        assert!(edges.values().all(|&count| count == (1, 1)));
        vertices as i64 - edges.len() as i64 + faces.len() as i64
    }
}

/// A closed surface of u and v, which close after so many steps, v or not.
fn closed(around: u32, along: u32, at: impl Fn(f64, f64) -> Point) -> Soup {
    let place = |i: u32, j: u32| i % around + around * (j % along);
    let vertices = (0..along)
        .flat_map(|j| (0..around).map(move |i| (i, j)))
        .map(|(i, j)| {
            at(
                f64::from(i) / f64::from(around),
                f64::from(j) / f64::from(along),
            )
        })
        .collect();
    let faces = (0..along)
        .flat_map(|j| (0..around).map(move |i| (i, j)))
        .flat_map(|(i, j)| {
            let [a, b, c, d] = [
                place(i, j),
                place(i + 1, j),
                place(i + 1, j + 1),
                place(i, j + 1),
            ];
            [[a, b, c], [a, c, d]]
        })
        .collect();
    Soup { vertices, faces }
}

pub fn torus(radius: f64, thickness: f64, steps: u32) -> Soup {
    closed(steps, steps, |u, v| {
        let (u, v) = (TAU * u, TAU * v);
        let r = radius + thickness * v.cos();
        [r * u.cos(), r * u.sin(), thickness * v.sin()]
    })
}

/// Faces of the cube cut into squares, blown up.
pub fn sphere(radius: f64, steps: u32) -> Soup {
    let cube = box_of([2.0; 3], steps.div_ceil(4));
    cube.mapped(|p| {
        let bent = p.map(|x| (PI / 4.0 * x).tan());
        vector::scaled(vector::normalised(bent), radius)
    })
}

/// A box about the origin, its sides cut into so many squares each way.
pub fn box_of(size: Point, cuts: u32) -> Soup {
    let lines = size.map(|s| {
        (0..=cuts)
            .map(|i| s * (f64::from(i) / f64::from(cuts) - 0.5))
            .collect()
    });
    blocks(&lines, |_| true)
}

/// A box without its upper side.
pub fn open_box(size: Point) -> Soup {
    let mut soup = box_of(size, 1);
    let top = |&v: &u32| soup.vertices[v as usize][2] > 0.0;
    soup.faces.retain(|f| !f.iter().all(top));
    soup
}

/// Boundary of those cells between planes that are solid, wound outwards.
pub fn blocks(lines: &[Vec<f64>; 3], is_solid: impl Fn([usize; 3]) -> bool) -> Soup {
    let counts = [0, 1, 2].map(|i| lines[i].len() - 1);
    let solid = |cell: [i64; 3]| {
        (0..3).all(|i| (0..counts[i] as i64).contains(&cell[i]))
            && is_solid(cell.map(|x| x as usize))
    };
    let mut number = BTreeMap::new();
    let (mut vertices, mut faces) = (Vec::new(), Vec::new());
    let all = |axis: usize| 0..counts[axis] as i64;
    let cells = all(0).flat_map(|x| all(1).flat_map(move |y| all(2).map(move |z| [x, y, z])));
    for cell in cells.filter(|&cell| solid(cell)) {
        for axis in 0..3 {
            for side in [0, 1] {
                let mut beside = cell;
                beside[axis] += 2 * side - 1;
                if solid(beside) {
                    continue;
                }
                let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
                let mut square = [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[db, dc]| {
                    let mut at = cell;
                    at[axis] += side;
                    at[b] += db;
                    at[c] += dc;
                    *number.entry(at).or_insert_with(|| {
                        vertices.push([0, 1, 2].map(|i| lines[i][at[i] as usize]));
                        vertices.len() as u32 - 1
                    })
                });
                if side == 0 {
                    square.reverse();
                }
                let [p, q, r, s] = square;
                faces.extend([[p, q, r], [p, r, s]]);
            }
        }
    }
    Soup { vertices, faces }
}
