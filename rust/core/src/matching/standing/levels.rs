//! Heights by which upright figures of other proportions are alike: where their legs join, and the neck.
//!
//! Both are saddles, found as such: of what lies beyond a plane that sweeps over a figure the pieces are followed, each with the
//! vertex where it began. Where two join that have lasted for a while, something branches there. A plane that rises finds legs, of
//! which both began at the ground; one that comes from a side finds the head, which began above the place where it joins the
//! rest of the body, and from the other side at the same height.

use crate::algebra::unions::Unions;
use crate::algebra::vector::Point;
use crate::matching::settings::LEVELS;
use crate::mesh::Mesh;

/// Where two pieces join.
#[derive(Debug, Clone, Copy)]
struct Joint {
    at: u32,
    /// Where each began, the one that has lasted longer first.
    began: [u32; 2],
    /// How far the plane went while there were both.
    lasted: f64,
}

/// Joints of the pieces of a mesh below a height of its vertices, `(n)`, while that rises, lowest first; those that lasted.
fn joints(mesh: &Mesh, heights: &[f64], least: f64) -> Vec<Joint> {
    let height = |v: u32| heights[v as usize];
    let ascending = |[a, b]: [u32; 2]| {
        if height(b) < height(a) {
            [b, a]
        } else {
            [a, b]
        }
    };
    let sides = |&[a, b, c]: &[u32; 3]| [[a, b], [b, c], [c, a]];
    let mut edges: Vec<[u32; 2]> = mesh.faces.iter().flat_map(sides).map(ascending).collect();
    edges.sort_unstable_by(|one, other| {
        let by_height = height(one[1]).total_cmp(&height(other[1]));
        by_height.then(one.cmp(other))
    });
    let mut pieces = Unions::new(heights.len());
    let mut began: Vec<u32> = (0..heights.len() as u32).collect();
    let mut found = Vec::new();
    for [a, b] in edges {
        let (one, other) = (pieces.root(a), pieces.root(b));
        if one == other {
            continue;
        }
        let [mut first, mut second] = [one, other].map(|piece| began[piece as usize]);
        if height(second) < height(first) {
            std::mem::swap(&mut first, &mut second);
        }
        let lasted = height(b) - height(second);
        if lasted > least {
            found.push(Joint {
                at: b,
                began: [first, second],
                lasted,
            });
        }
        pieces.unite(one, other);
        began[pieces.root(one) as usize] = first;
    }
    found
}

/// Height at which the legs join of a figure that stands along an axis, or against it where the sign is −1: the highest such
/// place, with the ground at 0 and the top at 1; nothing where there are no legs.
pub(super) fn legs(mesh: &Mesh, axis: usize, sign: f64) -> Option<f64> {
    let heights = heights(mesh, axis, sign);
    let grounded = |joint: &Joint| {
        joint
            .began
            .map(|v| heights[v as usize])
            .iter()
            .all(|&low| low < LEVELS.ground)
    };
    let found = joints(mesh, &heights, LEVELS.leg);
    let last = found.iter().rfind(|joint| grounded(joint))?;
    Some(heights[last.at as usize])
}

/// Height of the neck of such a figure, whose sides are along another axis; nothing where no head is told from what is below it.
pub(super) fn neck(mesh: &Mesh, axis: usize, sign: f64, sideways: usize) -> Option<f64> {
    let heights = heights(mesh, axis, sign);
    let [low, high] = reach(mesh, axis);
    let from_side = |side: f64| -> Vec<(f64, f64)> {
        let along: Vec<f64> = mesh
            .vertices
            .iter()
            .map(|p| side * p[sideways] / (high - low))
            .collect();
        joints(mesh, &along, LEVELS.head)
            .iter()
            .map(|joint| (joint, heights[joint.at as usize]))
            .filter(|(joint, at)| heights[joint.began[1] as usize] > at + LEVELS.above)
            .map(|(joint, at)| (at, joint.lasted))
            .collect()
    };
    let (one, other) = (from_side(1.0), from_side(-1.0));
    let pairs = one.iter().flat_map(|a| other.iter().map(move |b| (a, b)));
    pairs
        .filter(|(a, b)| (a.0 - b.0).abs() < LEVELS.even)
        .max_by(|x, y| x.0.1.min(x.1.1).total_cmp(&y.0.1.min(y.1.1)))
        .map(|(a, b)| f64::midpoint(a.0, b.0))
}

/// Of the vertices along an axis, or against it, from 0 to 1.
fn heights(mesh: &Mesh, axis: usize, sign: f64) -> Vec<f64> {
    let [a, b] = reach(mesh, axis).map(|end| sign * end);
    let (low, high) = (a.min(b), a.max(b));
    let along = mesh.vertices.iter().map(|p| sign * p[axis]);
    along.map(|at| (at - low) / (high - low)).collect()
}

/// Lowest and highest coordinate of a mesh.
pub(super) fn reach(mesh: &Mesh, axis: usize) -> [f64; 2] {
    let along = || mesh.vertices.iter().map(|p| p[axis]);
    [
        along().fold(f64::INFINITY, f64::min),
        along().fold(f64::NEG_INFINITY, f64::max),
    ]
}

/// Moves places along the axis that points up, from 0 to 1, so that some heights come to lie at others, ascending both, and
/// what is between them in proportion.
pub(super) fn stretch(places: &mut [Point], up: usize, levels: &[[f64; 2]]) {
    let knots: Vec<[f64; 2]> = [[0.0, 0.0]]
        .iter()
        .chain(levels)
        .chain(&[[1.0, 1.0]])
        .copied()
        .collect();
    for place in places {
        let above = knots[1..].iter().position(|knot| place[up] <= knot[0]);
        let k = above.unwrap_or(knots.len() - 2);
        let ([from, to], [next, next_to]) = (knots[k], knots[k + 1]);
        place[up] = to + (place[up] - from) * (next_to - to) / (next - from);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::envelope::shapes::blocks;

    /// A figure of blocks, its arms held out, along the axes in an order: sideways, forward and up.
    fn figure(order: [usize; 3], legs: f64, with_head: bool) -> Mesh {
        let lines = [
            vec![-5.0, -2.0, -1.5, -1.0, -0.7, 0.7, 1.0, 1.5, 2.0, 5.0],
            vec![-1.0, 0.0, 1.0],
            vec![0.0, legs, 7.0, 8.0, 8.5, 9.0, 10.0],
        ];
        let soup = blocks(&lines, |[x, _, z]| match z {
            0 => x != 0 && x != 4 && x != 8,
            1 => x != 0 && x != 8,
            2 => true,
            3 => x == 4,
            4 => with_head && (3..=5).contains(&x),
            _ => with_head && (2..=6).contains(&x),
        });
        let vertices: Vec<Point> = soup
            .vertices
            .iter()
            .map(|p| {
                let mut place = [0.0; 3];
                for (axis, &x) in order.iter().zip(p) {
                    place[*axis] = x;
                }
                place
            })
            .collect();
        let faces: Vec<[i64; 3]> = soup.faces.iter().map(|f| f.map(i64::from)).collect();
        Mesh::new(&vertices, &faces).expect("a sound mesh")
    }

    #[test]
    fn legs_join_where_they_do_whatever_axis_points_up() {
        for order in [[0, 1, 2], [1, 2, 0], [2, 0, 1]] {
            let figure = figure(order, 4.0, true);
            let up = order[2];
            let found = legs(&figure, up, 1.0).expect("it has legs");
            assert!((found - 0.4).abs() < 1e-12, "{found}");
            // Upside down its head is the only thing on the ground.
            assert_eq!(legs(&figure, up, -1.0), None);
        }
    }

    #[test]
    fn the_neck_lies_between_head_and_shoulders() {
        let figure = figure([0, 1, 2], 4.0, true);
        let found = neck(&figure, 2, 1.0, 0).expect("it has a head");
        // Anywhere between the planes that bound it, which rounding of a height moves.
        assert!((found - 0.825).abs() < 0.025 + 1e-12, "{found}");
        let headless = self::figure([0, 1, 2], 4.0, false);
        assert_eq!(neck(&headless, 2, 1.0, 0), None);
    }

    #[test]
    fn heights_come_to_lie_on_one_another_and_stay_in_order() {
        let heights = [0.0, 0.1, 0.2, 0.5, 0.8, 0.9, 1.0];
        let mut places: Vec<Point> = heights.iter().map(|&z| [z, 1.0, z]).collect();
        stretch(&mut places, 2, &[[0.2, 0.5], [0.8, 0.9]]);
        let found: Vec<f64> = places.iter().map(|p| p[2]).collect();
        let wanted = [0.0, 0.25, 0.5, 0.7, 0.9, 0.95, 1.0];
        for (a, b) in found.iter().zip(wanted) {
            assert!((a - b).abs() < 1e-12, "{found:?}");
        }
        assert!(
            places
                .iter()
                .zip(heights)
                .all(|(p, z)| p[0] == z && p[1] == 1.0)
        );
    }
}
