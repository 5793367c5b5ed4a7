//! Moments of the triangles of a node: what they come to from afar.

use super::place::{Place, Triangle, add, dot, scaled, sub};

/// What a node is from afar.
#[derive(Debug, Clone, Copy)]
pub(super) struct Moments {
    /// Centre of area.
    pub centre: Place,
    /// Distance of the centre from the farthest corner of the box.
    pub radius: f32,
    /// Sum of areas.
    area: f32,
    /// N.
    normal: Place,
    /// Symmetric part of M: xx, yy, zz, xy, yz, zx.
    second: [f32; 6],
}

impl Moments {
    pub fn of_triangles(triangles: &[Triangle], low: Place, high: Place) -> Self {
        let area_of = |t: &Triangle| dot(t.cross(), t.cross()).sqrt() / 2.0;
        let area: f32 = triangles.iter().map(area_of).sum();
        let sum = triangles.iter().fold([0.0; 3], |sum, t| {
            add(sum, scaled(t.centroid(), area_of(t)))
        });
        let centre = centre(sum, area, low, high);
        let mut moments = Self {
            centre,
            radius: radius(centre, low, high),
            area,
            normal: [0.0; 3],
            second: [0.0; 6],
        };
        for t in triangles {
            let normal = scaled(t.cross(), 0.5);
            moments.normal = add(moments.normal, normal);
            moments.add_second(normal, sub(t.centroid(), centre));
        }
        moments
    }

    pub fn joined(&self, other: &Self, low: Place, high: Place) -> Self {
        let area = self.area + other.area;
        let sum = add(
            scaled(self.centre, self.area),
            scaled(other.centre, other.area),
        );
        let centre = centre(sum, area, low, high);
        let mut joined = Self {
            centre,
            radius: radius(centre, low, high),
            area,
            normal: add(self.normal, other.normal),
            second: std::array::from_fn(|i| self.second[i] + other.second[i]),
        };
        for child in [self, other] {
            joined.add_second(child.normal, sub(child.centre, centre));
        }
        joined
    }

    /// Adds the symmetric part of n dᵀ.
    fn add_second(&mut self, n: Place, d: Place) {
        for i in 0..3 {
            let j = (i + 1) % 3;
            self.second[i] += n[i] * d[i];
            self.second[3 + i] += f32::midpoint(n[i] * d[j], n[j] * d[i]);
        }
    }
}

fn centre(sum: Place, area: f32, low: Place, high: Place) -> Place {
    if area > 0.0 {
        scaled(sum, 1.0 / area)
    } else {
        scaled(add(low, high), 0.5)
    }
}

fn radius(centre: Place, low: Place, high: Place) -> f32 {
    let farthest = [0, 1, 2].map(|i| (centre[i] - low[i]).max(high[i] - centre[i]));
    dot(farthest, farthest).sqrt()
}

impl Moments {
    /// Adds 4π of the node's share in w at each point, all of them far from it.
    #[inline(always)]
    pub fn add_far<const N: usize>(&self, points: &[[f32; N]; 3], sums: &mut [f32; N]) {
        let m = self.second;
        let trace = m[0] + m[1] + m[2];
        for i in 0..N {
            let r = sub(self.centre, [points[0][i], points[1][i], points[2][i]]);
            let inverse = 1.0 / dot(r, r);
            let cubed = inverse * inverse.sqrt();
            let bilinear = m[0] * r[0] * r[0]
                + m[1] * r[1] * r[1]
                + m[2] * r[2] * r[2]
                + 2.0 * (m[3] * r[0] * r[1] + m[4] * r[1] * r[2] + m[5] * r[2] * r[0]);
            sums[i] += cubed * (dot(self.normal, r) + trace - 3.0 * bilinear * inverse);
        }
    }
}
