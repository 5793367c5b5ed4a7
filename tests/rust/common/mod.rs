//! Surfaces of closed form for the tests.
#![allow(dead_code, reason = "each test file uses its own part")]

use std::collections::HashMap;

pub type Point = [f64; 3];

/// Icosahedron with every triangle split in four, so many times, on the unit sphere.
pub fn icosphere(subdivisions: usize) -> (Vec<Point>, Vec<[i64; 3]>) {
    let g = f64::midpoint(1.0, 5.0f64.sqrt());
    let mut vertices: Vec<Point> = Vec::new();
    for (a, b) in [(1.0, g), (1.0, -g), (-1.0, g), (-1.0, -g)] {
        vertices.extend([[0.0, a, b], [a, b, 0.0], [b, 0.0, a]]);
    }
    let edge = |i: usize, j: usize| (length(sub(vertices[i], vertices[j])) - 2.0).abs() < 1e-9;
    let mut faces: Vec<[i64; 3]> = Vec::new();
    for i in 0..12 {
        for j in i + 1..12 {
            for k in j + 1..12 {
                if edge(i, j) && edge(j, k) && edge(k, i) {
                    let [a, b, c] = [vertices[i], vertices[j], vertices[k]];
                    let n = cross(sub(b, a), sub(c, a));
                    let outward = n[0] * a[0] + n[1] * a[1] + n[2] * a[2] > 0.0;
                    faces.push(if outward { [i, j, k] } else { [i, k, j] }.map(|v| v as i64));
                }
            }
        }
    }
    for _ in 0..subdivisions {
        let mut middles = HashMap::new();
        let mut split = Vec::with_capacity(4 * faces.len());
        for [a, b, c] in faces {
            let [ab, bc, ca] = [(a, b), (b, c), (c, a)].map(|(p, q)| {
                *middles.entry((p.min(q), p.max(q))).or_insert_with(|| {
                    let (p, q) = (vertices[p as usize], vertices[q as usize]);
                    vertices.push([0, 1, 2].map(|i| f64::midpoint(p[i], q[i])));
                    vertices.len() as i64 - 1
                })
            });
            split.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        faces = split;
        for p in &mut vertices {
            let size = length(*p);
            *p = p.map(|x| x / size);
        }
    }
    (vertices, faces)
}

/// A sphere with five unequal limbs: no symmetry, so that its map to itself is unique.
pub fn lumpy(subdivisions: usize) -> (Vec<Point>, Vec<[i64; 3]>) {
    const LIMBS: [(Point, f64, f64); 5] = [
        ([0.0, 0.0, 1.0], 0.8, 0.35),
        ([0.9, 0.3, 0.1], 1.6, 0.22),
        ([-0.8, 0.5, 0.2], 1.2, 0.28),
        ([0.4, -0.5, -0.8], 1.9, 0.25),
        ([-0.5, -0.2, -0.9], 1.4, 0.3),
    ];
    limbed(icosphere(subdivisions), &LIMBS)
}

/// A unit sphere with limbs, given by their axis, height and width.
pub fn limbed(
    (mut vertices, faces): (Vec<Point>, Vec<[i64; 3]>),
    limbs: &[(Point, f64, f64)],
) -> (Vec<Point>, Vec<[i64; 3]>) {
    for p in &mut vertices {
        let mut radius = 1.0;
        for &(axis, height, width) in limbs {
            let size = length(axis);
            let away = length(sub(*p, axis.map(|x| x / size)));
            radius += height * (-(away / width).powi(2)).exp();
        }
        *p = p.map(|x| radius * x);
    }
    (vertices, faces)
}

/// The same surface turned, moved, scaled and renumbered; `order[new] = old`.
pub fn disguised(
    (vertices, faces): &(Vec<Point>, Vec<[i64; 3]>),
    scale: f64,
) -> (Vec<Point>, Vec<[i64; 3]>, Vec<usize>) {
    let n = vertices.len();
    // A multiplier without a common factor with n visits every vertex once.
    let stride = (n / 3..n).find(|s| gcd(*s, n) == 1).unwrap();
    let order: Vec<usize> = (0..n).map(|i| (i * stride + 7) % n).collect();
    let mut new_id = vec![0i64; n];
    for (new, &old) in order.iter().enumerate() {
        new_id[old] = new as i64;
    }
    let (s, c) = 0.7f64.sin_cos();
    let moved = |p: Point| {
        let q = [c * p[0] - s * p[1], s * p[0] + c * p[1], p[2]];
        [scale * q[1] + 3.0, scale * q[2] - 2.0, scale * q[0] + 5.0]
    };
    (
        order.iter().map(|&old| moved(vertices[old])).collect(),
        faces
            .iter()
            .rev()
            .map(|f| f.map(|v| new_id[v as usize]))
            .collect(),
        order,
    )
}

fn gcd(a: usize, b: usize) -> usize {
    if b == 0 { a } else { gcd(b, a % b) }
}

pub fn sub(a: Point, b: Point) -> Point {
    [0, 1, 2].map(|i| a[i] - b[i])
}

pub fn length(a: Point) -> f64 {
    (a[0] * a[0] + a[1] * a[1] + a[2] * a[2]).sqrt()
}

pub fn cross(a: Point, b: Point) -> Point {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}
