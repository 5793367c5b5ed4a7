//! Positions and triangles of a soup scaled to 1, in single precision.

/// Position in the scaled soup.
pub(super) type Place = [f32; 3];

/// A triangle with the piece to which it belongs.
#[derive(Debug, Clone, Copy)]
pub(super) struct Triangle {
    pub corners: [Place; 3],
    pub piece: u32,
}

#[inline(always)]
pub(super) fn sub(a: Place, b: Place) -> Place {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
pub(super) fn add(a: Place, b: Place) -> Place {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[inline(always)]
pub(super) fn scaled(a: Place, s: f32) -> Place {
    [a[0] * s, a[1] * s, a[2] * s]
}

#[inline(always)]
pub(super) fn dot(a: Place, b: Place) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
pub(super) fn cross(a: Place, b: Place) -> Place {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

impl Triangle {
    pub fn centroid(&self) -> Place {
        let [a, b, c] = self.corners;
        scaled(add(add(a, b), c), 1.0 / 3.0)
    }

    /// Normal of twice the area as its length.
    pub fn cross(&self) -> Place {
        let [a, b, c] = self.corners;
        cross(sub(b, a), sub(c, a))
    }
}
