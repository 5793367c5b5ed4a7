//! Stray vertices: one that a slip of the hand or a damaged file put far away from the surface that it belongs to. The
//! triangles around it become a spike that has most of the area and all of the extent, and nothing measured on the whole
//! means anything.

use crate::algebra::vector::{self, Point};
use crate::mesh::settings::{INTAKE, STRAYS};

/// Places of vertices with the strays among them laid between their neighbours.
#[derive(Debug, Clone, PartialEq)]
pub struct Settled {
    /// Places of all vertices, `(n)`.
    pub vertices: Vec<Point>,
    /// How many of them were moved.
    pub strays: usize,
}

/// Lays each stray vertex into the mean of its neighbours; nothing where there is none, which is on nearly every mesh.
///
/// Stray are the outermost vertices, at most one of `STRAYS.one_of`, that are `STRAYS.gap` times as far from the median of all as any
/// other, and that triangles join to the rest over feet `STRAYS.slender` times narrower than the spikes are long. Copies at one
/// place stay at one place. Coordinates have to be finite and `faces` in range. O(n).
#[must_use]
pub fn settled(vertices: &[Point], faces: &[[u32; 3]]) -> Option<Settled> {
    let away = distances_from_the_middle(vertices, faces)?;
    let far = far_out(&away);
    if far.is_empty() {
        return None;
    }
    let group = at_one_place(vertices, &far);
    let groups = group.iter().copied().max().map_or(0, |last| last + 1);
    let mut is_far = vec![usize::MAX; vertices.len()];
    for (&v, &own) in far.iter().zip(&group) {
        is_far[v as usize] = own;
    }
    // Neighbours of each place.
    let mut around: Vec<Vec<u32>> = vec![Vec::new(); groups];
    for corners in faces {
        for &v in corners {
            if let Some(own) = around.get_mut(is_far[v as usize]) {
                own.extend(corners.iter().filter(|&&u| u != v));
            }
        }
    }
    for own in &mut around {
        own.sort_unstable();
        own.dedup();
    }
    let mut place: Vec<Option<Point>> = vec![None; groups];
    for (&v, &own) in far.iter().zip(&group) {
        let feet = around[own]
            .iter()
            .filter(|&&u| is_far[u as usize] >= groups);
        let feet: Vec<Point> = feet.map(|&u| vertices[u as usize]).collect();
        if feet.is_empty() {
            continue;
        }
        let middle = vector::mean(&feet);
        let width = feet.iter().map(|&p| scaled_distance(p, middle));
        let width = width.fold(0.0, f64::max);
        if scaled_distance(vertices[v as usize], middle) < STRAYS.slender * width {
            return None;
        }
        place[own] = Some(middle);
    }
    // Farther ones of several that hang together follow those that have a place; what hangs on nothing else is a piece.
    loop {
        let next: Vec<(usize, Point)> = (0..groups)
            .filter(|&own| place[own].is_none())
            .filter_map(|own| {
                let known = around[own]
                    .iter()
                    .filter_map(|&u| place[is_far[u as usize]]);
                let known: Vec<Point> = known.collect();
                (!known.is_empty()).then(|| (own, vector::mean(&known)))
            })
            .collect();
        if next.is_empty() {
            break;
        }
        for (own, middle) in next {
            place[own] = Some(middle);
        }
    }
    let mut settled = Settled {
        vertices: vertices.to_vec(),
        strays: 0,
    };
    for (&v, &own) in far.iter().zip(&group) {
        if let Some(middle) = place[own] {
            settled.vertices[v as usize] = middle;
            settled.strays += 1;
        }
    }
    (settled.strays > 0).then_some(settled)
}

/// Distance of each vertex of a face from the median of them along each axis; −1 for vertices of no face. Nothing where
/// there are too few for one to be far out of them.
fn distances_from_the_middle(vertices: &[Point], faces: &[[u32; 3]]) -> Option<Vec<f64>> {
    let mut away = vec![-1.0; vertices.len()];
    for &v in faces.iter().flatten() {
        away[v as usize] = 0.0;
    }
    let used: Vec<usize> = (0..vertices.len()).filter(|&v| away[v] == 0.0).collect();
    if used.len() < INTAKE.fewest_vertices {
        return None;
    }
    let middle = [0, 1, 2].map(|axis| {
        let mut along: Vec<f64> = used.iter().map(|&v| vertices[v][axis]).collect();
        let half = along.len() / 2;
        *along.select_nth_unstable_by(half, f64::total_cmp).1
    });
    for v in used {
        away[v] = scaled_distance(vertices[v], middle);
    }
    Some(away)
}

/// The vertices beyond the widest gap of the outermost distances, in ascending order.
fn far_out(away: &[f64]) -> Vec<u32> {
    let mut used: Vec<u32> = (0..away.len() as u32)
        .filter(|&v| away[v as usize] >= 0.0)
        .collect();
    let most = (used.len() / STRAYS.one_of).max(1);
    let farther = |a: &u32, b: &u32| {
        let order = away[*b as usize].total_cmp(&away[*a as usize]);
        order.then(a.cmp(b))
    };
    used.select_nth_unstable_by(most, farther);
    used.truncate(most + 1);
    used.sort_unstable_by(farther);
    let distance = |place: usize| away[used[place] as usize];
    let last = (0..most)
        .rev()
        .find(|&place| distance(place) > STRAYS.gap * distance(place + 1));
    used.truncate(last.map_or(0, |place| place + 1));
    used.sort_unstable();
    used
}

/// Numbers 0, 1, … of the places where some vertices are.
fn at_one_place(vertices: &[Point], some: &[u32]) -> Vec<usize> {
    let bits = |v: u32| vertices[v as usize].map(f64::to_bits);
    let mut places: Vec<[u64; 3]> = some.iter().map(|&v| bits(v)).collect();
    places.sort_unstable();
    places.dedup();
    some.iter()
        .map(|&v| places.partition_point(|place| *place < bits(v)))
        .collect()
}

/// Distance whose squares neither overflow nor vanish.
fn scaled_distance(a: Point, b: Point) -> f64 {
    let halves = [0, 1, 2].map(|i| a[i] / 2.0 - b[i] / 2.0);
    let largest = halves
        .into_iter()
        .fold(0.0, |most: f64, x| most.max(x.abs()));
    if largest > 0.0 {
        2.0 * (largest * vector::norm(halves.map(|x| x / largest))).min(f64::MAX / 2.0)
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIDE: u32 = 20;

    /// A square of `SIDE` by `SIDE` vertices, a unit apart.
    fn square() -> (Vec<Point>, Vec<[u32; 3]>) {
        let vertices = (0..SIDE * SIDE)
            .map(|v| [f64::from(v / SIDE), f64::from(v % SIDE), 0.0])
            .collect();
        let corners = (0..SIDE - 1).flat_map(|i| (0..SIDE - 1).map(move |j| i * SIDE + j));
        let faces = corners
            .flat_map(|v| [[v, v + SIDE, v + SIDE + 1], [v, v + SIDE + 1, v + 1]])
            .collect();
        (vertices, faces)
    }

    /// A vertex inside.
    const INNER: usize = (7 * SIDE + 8) as usize;

    #[test]
    fn a_vertex_far_out_comes_back_to_where_it_was() {
        let (vertices, faces) = square();
        for reach in [100.0, 1e4, 1e9, 1e300] {
            let mut moved = vertices.clone();
            moved[INNER] = [reach, -0.3 * reach, 0.7 * reach];
            let found = settled(&moved, &faces).expect("one is far out");
            assert_eq!(found.strays, 1);
            // Its neighbours are around it on every side.
            assert!(vector::distance(found.vertices[INNER], vertices[INNER]) < 1e-12);
            let others = (0..vertices.len()).filter(|&v| v != INNER);
            assert!(others.clone().count() > 300);
            for v in others {
                assert_eq!(found.vertices[v], vertices[v]);
            }
        }
    }

    #[test]
    fn neighbours_that_are_far_out_together_and_copies_at_one_place_follow_the_rest() {
        let (vertices, mut faces) = square();
        let mut moved = vertices.clone();
        for v in [INNER, INNER + 1] {
            moved[v] = [1e3, 1e3 + v as f64, 0.0];
        }
        // Half of the faces of one name a copy of it, as at the seam of a texture.
        moved.push(moved[INNER]);
        let copy = vertices.len() as u32;
        let of_it = faces.iter_mut().flatten().filter(|v| **v == INNER as u32);
        for corner in of_it.step_by(2) {
            *corner = copy;
        }
        let found = settled(&moved, &faces).expect("two places are far out");
        assert_eq!(found.strays, 3);
        assert_eq!(found.vertices[INNER], found.vertices[copy as usize]);
        for v in [INNER, INNER + 1] {
            // A third of the neighbours of each is the other, so the mean is less than one unit off.
            assert!(vector::distance(found.vertices[v], vertices[v]) < 1.0);
        }
    }

    #[test]
    fn ordinary_shapes_cones_and_far_pieces_stay() {
        let (vertices, faces) = square();
        assert_eq!(settled(&vertices, &faces), None);
        // A vertex of no face is no part of any surface.
        let mut loose = vertices.clone();
        loose.push([1e9; 3]);
        assert_eq!(settled(&loose, &faces), None);
        // A piece of its own has its own place.
        loose.extend([[1e9, 0.0, 0.0], [0.0, 1e9, 0.0]]);
        let n = vertices.len() as u32;
        let with_piece = [faces.clone(), vec![[n, n + 1, n + 2]]].concat();
        assert_eq!(settled(&loose, &with_piece), None);
        // A pointed hat: its tip is far out, over the whole of the rim.
        let rim = 64u32;
        let mut cone: Vec<Point> = (0..rim)
            .map(|i| std::f64::consts::TAU * f64::from(i) / f64::from(rim))
            .map(|angle| [angle.cos(), angle.sin(), 0.0])
            .collect();
        cone.push([0.0, 0.0, 12.0]);
        let sides: Vec<[u32; 3]> = (0..rim).map(|i| [i, (i + 1) % rim, rim]).collect();
        assert_eq!(settled(&cone, &sides), None);
    }
}
