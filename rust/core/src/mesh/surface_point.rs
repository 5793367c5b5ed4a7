//! A point of a triangulated surface, and the closest point of a triangle.

use crate::algebra::vector::{self, Point};

/// A point of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePoint {
    /// Triangle of the checked mesh.
    pub face: u32,
    /// Weights of its corners, non-negative, summing to one.
    pub weights: [f64; 3],
}

impl SurfacePoint {
    /// A corner of a triangle.
    #[must_use]
    pub fn at_corner(faces: &[[u32; 3]], face: u32, vertex: u32) -> Self {
        Self {
            face,
            weights: faces[face as usize].map(|v| if v == vertex { 1.0 } else { 0.0 }),
        }
    }
}

/// Squared distance to a triangle, and the weights of its nearest point.
#[must_use]
pub(crate) fn nearest_in_triangle(query: Point, [a, b, c]: [Point; 3]) -> (f64, [f64; 3]) {
    let (u, v, d) = (vector::sub(b, a), vector::sub(c, a), vector::sub(query, a));
    let found = closest_on_triangle([
        vector::dot(u, u),
        vector::dot(u, v),
        vector::dot(v, v),
        vector::dot(u, d),
        vector::dot(v, d),
        vector::dot(d, d),
    ]);
    (found.cost, found.weights())
}

/// A point of a triangle.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct OnTriangle {
    /// Its squared distance from the query.
    pub(crate) cost: f64,
    /// Weight of the second corner.
    s: f64,
    /// Weight of the third.
    t: f64,
}

impl OnTriangle {
    /// Weights of the three corners.
    pub(crate) fn weights(self) -> [f64; 3] {
        [1.0 - self.s - self.t, self.s, self.t].map(|w| w.max(0.0))
    }

    /// This one, or the other where `takes_other`: without a branch.
    #[inline(always)]
    fn or(self, other: Self, takes_other: bool) -> Self {
        let of = |own, other| if takes_other { other } else { own };
        Self {
            cost: of(self.cost, other.cost),
            s: of(self.s, other.s),
            t: of(self.t, other.t),
        }
    }

    /// The closer one, this where both are as close.
    #[inline(always)]
    fn or_closer(self, other: Self) -> Self {
        self.or(other, other.cost < self.cost)
    }
}

/// The closest point of a triangle, from the products ⟨u, u⟩, ⟨u, v⟩, ⟨v, v⟩, ⟨u, q⟩, ⟨v, q⟩, ⟨q, q⟩ of its edges u, v at
/// the first corner and the query's offset q from there. Without branches, so that several go beside each other in lanes.
#[inline(always)]
pub(crate) fn closest_on_triangle([uu, uv, vv, uq, vq, qq]: [f64; 6]) -> OnTriangle {
    let at = |s: f64, t: f64| OnTriangle {
        cost: qq - 2.0 * (s * uq + t * vq) + s * s * uu + 2.0 * s * t * uv + t * t * vv,
        s,
        t,
    };
    let along = |numerator: f64, length: f64| {
        let at = (numerator / length).clamp(0.0, 1.0);
        if length > 0.0 { at } else { 0.0 }
    };
    let on_bc = along(vq - uq + uu - uv, uu + vv - 2.0 * uv);
    let outside = at(along(uq, uu), 0.0)
        .or_closer(at(0.0, along(vq, vv)))
        .or_closer(at(1.0 - on_bc, on_bc));
    let determinant = uu * vv - uv * uv;
    let s = (vv * uq - uv * vq) / determinant;
    let t = (uu * vq - uv * uq) / determinant;
    let is_inside = determinant > 0.0 && s >= 0.0 && t >= 0.0 && s + t <= 1.0;
    outside.or(at(s, t), is_inside)
}
