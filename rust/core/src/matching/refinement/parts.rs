//! What draws one body onto another, along which it slides.
//!
//! A point of the first slides along the tangent plane at its image on the other, so that the places of a limb are told
//! by its tip and by how it is scaled as a whole, and not by where the crease lies from which it leaves the trunk. A
//! thicker trunk swallows more of the limb: creases draw little, and points that come to lie within the other body are
//! let lie there.
//!
//! # Source
//! Chen, Medioni, "Object modelling by registration of multiple range images", 1992, for distances from tangent planes;
//! Geman, `McClure`, "Statistical methods for tomographic image reconstruction", 1987, for weights 1/(1 + r²)².

use faer::linalg::solvers::Solve;
use faer::{Mat, Side};

use crate::algebra::dense::clearing_registers;
use crate::algebra::vector::{self, Point};
use crate::deformation::piecewise_affine::Pull;
use crate::matching::refinement::settings::PARTS;
use crate::mesh::surface_point::SurfacePoint;
use crate::shape::Shape;

/// Image of a vertex.
#[derive(Debug)]
pub struct Foot {
    /// Where it lies.
    pub place: Point,
    /// Outward.
    normal: Point,
    /// How much the surface bulges there, 0 to 1.
    bulging: f64,
}

impl Foot {
    /// At a point of a surface.
    #[must_use]
    pub fn new(shape: &Shape, image: &SurfacePoint) -> Self {
        let (mut place, mut normal, mut bulges) = ([0.0; 3], [0.0; 3], 0.0);
        let corners = shape.mesh.faces[image.face as usize];
        for (corner, share) in corners.into_iter().zip(image.weights) {
            let v = corner as usize;
            place = vector::add(place, vector::scaled(shape.mesh.vertices[v], share));
            normal = vector::add(normal, vector::scaled(shape.normals[v], share));
            bulges += share * shape.bulging[v];
        }
        Self {
            place,
            normal: vector::normalised(vector::scaled(normal, shape.volume_sign)),
            bulging: bulges,
        }
    }

    /// Drawing as much as where the surface bulges.
    #[must_use]
    pub fn drawing_fully(self) -> Self {
        Self {
            bulging: 1.0,
            ..self
        }
    }

    /// How a vertex of this weight is drawn, `anchor` its first image. One that lies within the body is `placed` there.
    #[must_use]
    pub fn pull(&self, weight: f64, placed: Option<Point>, anchor: Point) -> Pull {
        let depth = placed.map_or(0.0, |placed| {
            vector::dot(self.normal, vector::sub(self.place, placed)).max(0.0)
        });
        let weight = weight * self.bulging / (1.0 + (depth / PARTS.swallowed).powi(2)).powi(2);
        let held = weight * PARTS.anchor;
        let mut matrix = self.normal.map(|x| vector::scaled(self.normal, weight * x));
        for (c, row) in matrix.iter_mut().enumerate() {
            row[c] += held;
        }
        let height = vector::dot(self.normal, self.place);
        let moment = vector::add(
            vector::scaled(self.normal, weight * height),
            vector::scaled(anchor, held),
        );
        (matrix, moment)
    }
}

/// Root mean square distance between matched points, with weights, after the affine map that brings the first of each
/// nearest to the second; nothing where there is no such map, as of points in a plane.
#[must_use]
pub fn off_affine(matched: &[(Point, Point, f64)]) -> Option<f64> {
    let total: f64 = matched.iter().map(|m| m.2).sum();
    let mut gram = Mat::<f64>::zeros(4, 4);
    let mut right = Mat::<f64>::zeros(4, 3);
    for &([x, y, z], q, w) in matched {
        let row = [x, y, z, 1.0];
        for i in 0..4 {
            for j in 0..4 {
                gram[(i, j)] += w * row[i] * row[j];
            }
            for c in 0..3 {
                right[(i, c)] += w * row[i] * q[c];
            }
        }
    }
    let found = clearing_registers(|| Some(gram.llt(Side::Lower).ok()?.solve(&right)))?;
    let square = matched.iter().fold(0.0, |sum, &([x, y, z], q, w)| {
        let row = [x, y, z, 1.0];
        let there = [0, 1, 2].map(|c| (0..4).map(|i| row[i] * found[(i, c)]).sum::<f64>());
        sum + w * vector::distance(there, q).powi(2)
    });
    let off = (square / total).sqrt();
    off.is_finite().then_some(off)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Some points that lie in no plane, and where an affine map takes them.
    fn stretched() -> Vec<(Point, Point, f64)> {
        (0..40)
            .map(|i| {
                let t = f64::from(i);
                let [x, y, z] = [t.sin(), (1.7 * t).cos(), (0.6 * t).sin()];
                let there = [2.0 * x + 0.5 * y + 1.0, 0.7 * y - z, 0.3 * x + z - 2.0];
                ([x, y, z], there, 1.0 + 0.5 * (2.3 * t).sin())
            })
            .collect()
    }

    #[test]
    fn an_affine_map_leaves_nothing_and_a_bend_is_seen() {
        let mut matched = stretched();
        // Rounding of sums of forty.
        assert!(off_affine(&matched).expect("no plane") < 1e-12);
        for (p, q, _) in &mut matched {
            q[2] += p[0] * p[0];
        }
        assert!(off_affine(&matched).expect("no plane") > 0.1);
    }

    #[test]
    fn what_is_swallowed_draws_little_and_what_stands_out_fully() {
        let foot = Foot {
            place: [0.0, 0.0, 1.0],
            normal: [0.0, 0.0, 1.0],
            bulging: 1.0,
        };
        let along = |z: f64| foot.pull(1.0, Some([0.3, 0.0, z]), [0.0; 3]).0[2][2];
        assert!((along(1.2) - (1.0 + PARTS.anchor)).abs() < 1e-12);
        // 1/(1 + 1)².
        assert!((along(1.0 - PARTS.swallowed) - 0.25 * (1.0 + PARTS.anchor)).abs() < 1e-12);
        assert!((foot.pull(1.0, None, [0.0; 3]).0[2][2] - (1.0 + PARTS.anchor)).abs() < 1e-12);
    }
}
