//! Distance to the nearest triangle, and to the nearest of another piece.

use super::place::{Place, Triangle, add, dot, scaled, sub};
use super::tree::{SEVERAL, Tree};

/// Nearest point of the soup.
#[derive(Debug, Clone, Copy)]
pub(super) struct Nearest {
    pub squared: f32,
    pub place: Place,
    pub piece: u32,
    /// Triangle, in the order of the tree.
    pub triangle: u32,
}

/// Nearest point of a triangle, by the region of its plane in which q lies.
///
/// # Source
/// Ericson, "Real-Time Collision Detection", 2005, section 5.1.5.
pub(super) fn nearest_on(triangle: &Triangle, q: Place) -> Place {
    let [a, b, c] = triangle.corners;
    let (ab, ac, aq) = (sub(b, a), sub(c, a), sub(q, a));
    let (d1, d2) = (dot(ab, aq), dot(ac, aq));
    if d1 <= 0.0 && d2 <= 0.0 {
        return a;
    }
    let bq = sub(q, b);
    let (d3, d4) = (dot(ab, bq), dot(ac, bq));
    if d3 >= 0.0 && d4 <= d3 {
        return b;
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return add(a, scaled(ab, d1 / (d1 - d3)));
    }
    let cq = sub(q, c);
    let (d5, d6) = (dot(ab, cq), dot(ac, cq));
    if d6 >= 0.0 && d5 <= d6 {
        return c;
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return add(a, scaled(ac, d2 / (d2 - d6)));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        let along = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return add(b, scaled(sub(c, b), along));
    }
    let sum = va + vb + vc;
    add(a, add(scaled(ab, vb / sum), scaled(ac, vc / sum)))
}

/// Squared distance of a point from a box.
#[inline(always)]
pub(super) fn squared_from_box(low: Place, high: Place, q: Place) -> f32 {
    let x = (low[0] - q[0]).max(q[0] - high[0]).max(0.0);
    let y = (low[1] - q[1]).max(q[1] - high[1]).max(0.0);
    let z = (low[2] - q[2]).max(q[2] - high[2]).max(0.0);
    x * x + y * y + z * z
}

impl Tree {
    /// Nearest point nearer than the square root of `within`, of any piece but some.
    pub fn nearest(
        &self,
        q: Place,
        within: f32,
        but: &(impl Fn(u32) -> bool + ?Sized),
    ) -> Option<Nearest> {
        let mut best = None;
        let mut least = within;
        self.visit(0, q, but, &mut least, &mut best);
        best
    }

    /// The same of any piece, where a triangle is known that will not be far from the nearest.
    pub fn nearest_from(&self, q: Place, within: f32, triangle: u32) -> Option<Nearest> {
        let mut best = self.offered(triangle, q).filter(|n| n.squared < within);
        let mut least = best.map_or(within, |n| n.squared);
        self.visit(0, q, &|_| false, &mut least, &mut best);
        best
    }

    fn offered(&self, number: u32, q: Place) -> Option<Nearest> {
        let triangle = self.triangles.get(number as usize)?;
        let place = nearest_on(triangle, q);
        let d = sub(place, q);
        Some(Nearest {
            squared: dot(d, d),
            place,
            piece: triangle.piece,
            triangle: number,
        })
    }

    /// Squared distance of a node, infinite when it holds one piece and that is left out.
    #[inline(always)]
    fn at_least(&self, node: usize, q: Place, but: &(impl Fn(u32) -> bool + ?Sized)) -> f32 {
        let node = &self.nodes[node];
        if node.piece != SEVERAL && but(node.piece) {
            f32::INFINITY
        } else {
            squared_from_box(node.low, node.high, q)
        }
    }

    fn visit(
        &self,
        node: usize,
        q: Place,
        but: &(impl Fn(u32) -> bool + ?Sized),
        least: &mut f32,
        best: &mut Option<Nearest>,
    ) {
        if let Some(triangles) = self.leaf_range(node) {
            for number in triangles {
                let offered = self.offered(number as u32, q);
                if let Some(found) = offered.filter(|n| n.squared < *least && !but(n.piece)) {
                    *least = found.squared;
                    *best = Some(found);
                }
            }
            return;
        }
        let (one, other) = (2 * node + 1, 2 * node + 2);
        let (to_one, to_other) = (self.at_least(one, q, but), self.at_least(other, q, but));
        let [near, far] = if to_other < to_one {
            [(to_other, other), (to_one, one)]
        } else {
            [(to_one, one), (to_other, other)]
        };
        for (squared, child) in [near, far] {
            if squared < *least {
                self.visit(child, q, but, least, best);
            }
        }
    }
}
