//! A surface that is drawn to given points and stays locally rigid.
//!
//! The low-passed surfaces of the spectral steps have no fingertips and stretch freely. Here every
//! vertex keeps its place: xᵢ minimise Σ aᵢ‖xᵢ − yᵢ‖² + μ Σ wᵢⱼ‖(xᵢ − xⱼ) − Rᵢ(pᵢ − pⱼ)‖² with a
//! rotation Rᵢ for each vertex, so that distances between neighbours resist a map that slides. The areas aᵢ are the
//! surface's own, wherever it is drawn, so that it is factorised once.
//!
//! # Source
//! Sorkine, Alexa, "As-rigid-as-possible surface modeling", 2007, equations 7 (energy), 8
//! (positions), 5 and 6 (rotations). These are found here by Newton's method, and where they are far off as in
//! Müller, Bender, Chentanez, Macklin, "A robust method to extract the rotational part of deformations", 2016.

use rayon::prelude::*;

use crate::algebra::sparse_factor::{Factor, Pattern};
use crate::algebra::vector::{self, Point};
use crate::deformation::settings::RIGID_SURFACE;
use crate::error::{Error, Result, System};
use crate::mesh::edge_weights::EdgeWeights;
use crate::watch::progress::Check;

/// Columns of a rotation.
type Rotation = [Point; 3];

/// What holds a surface together: what depends on its shape alone, in any unit of length.
#[derive(Debug)]
pub struct Rigidity {
    edges: EdgeWeights,
    areas: Vec<f64>,
    /// Of μW + diag(a).
    factor: Factor,
    /// Vertices in the factor's ordering.
    ordering: Vec<u32>,
}

/// A surface on its way to given points.
pub struct RigidSurface<'a> {
    rigidity: &'a Rigidity,
    rest: Vec<Point>,
    rotations: Vec<Rotation>,
    /// Where the vertices are.
    pub positions: Vec<Point>,
}

impl Rigidity {
    /// Of a surface at rest with the area of each vertex, some above zero; where an order is known in which neighbours are
    /// eliminated with little fill, it need not be found.
    ///
    /// # Errors
    /// [`Error::NotFactorised`].
    pub fn new(
        rest: &[Point],
        triangles: &[[u32; 3]],
        areas: &[f64],
        ordering: Option<&[u32]>,
    ) -> Result<Self> {
        let edges = EdgeWeights::new(rest, triangles);
        let before = |i: usize| edges.row(i).take_while(move |&(j, _)| (j as usize) < i);
        let columns = (0..areas.len()).map(|i| before(i).map(|(j, _)| j).chain([i as u32]));
        let pattern = Pattern::new(columns, ordering)?;
        let mut entries = Vec::new();
        for (i, area) in areas.iter().enumerate() {
            entries.extend(before(i).map(|(_, w)| -RIGID_SURFACE.rigidity * w));
            let held: f64 = edges.row(i).map(|(_, w)| RIGID_SURFACE.rigidity * w).sum();
            entries.push(area + held);
        }
        let positive = |factor: &Factor| factor.negative_pivots() == 0;
        let factor = pattern.factor(&entries).filter(positive);
        let factor = factor.ok_or_else(|| Error::NotFactorised {
            of: System::Deformation,
            reason: "the rigid surface has a pivot that is not positive".into(),
        })?;
        Ok(Self {
            ordering: pattern.ordering().to_vec(),
            edges,
            areas: areas.to_vec(),
            factor,
        })
    }
}

impl<'a> RigidSurface<'a> {
    /// A surface at rest, from where its positions may be set to what a rotation makes of them; `rest` in any unit.
    #[must_use]
    pub fn new(rigidity: &'a Rigidity, rest: Vec<Point>) -> Self {
        Self {
            rigidity,
            rotations: vec![[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]; rest.len()],
            positions: rest.clone(),
            rest,
        }
    }

    /// Moves towards a place for each vertex.
    ///
    /// # Errors
    /// [`Error::Cancelled`].
    pub fn drawn_to(&mut self, places: &[Point], check: Check<'_>) -> Result<()> {
        let Rigidity {
            edges,
            areas,
            factor,
            ordering,
        } = self.rigidity;
        for _ in 0..RIGID_SURFACE.rounds {
            check()?;
            self.turn();
            // With a fourth coordinate of nothing they fill a register.
            let mut balance: Vec<[f64; 4]> = ordering
                .par_iter()
                .map(|&i| {
                    let i = i as usize;
                    // Σ ½μw (Rᵢ + Rⱼ)(pᵢ − pⱼ), Rᵢ taken out.
                    let (mut own, mut others) = ([0.0; 3], [0.0; 3]);
                    for (j, w) in edges.row(i) {
                        let j = j as usize;
                        let edge = vector::scaled(vector::sub(self.rest[i], self.rest[j]), w);
                        own = vector::add(own, edge);
                        others = vector::add(others, vector::by_columns(&self.rotations[j], edge));
                    }
                    let held = vector::add(vector::by_columns(&self.rotations[i], own), others);
                    let held = vector::scaled(held, 0.5 * RIGID_SURFACE.rigidity);
                    let [x, y, z] = vector::add(vector::scaled(places[i], areas[i]), held);
                    [x, y, z, 0.0]
                })
                .collect();
            factor.solve(&mut balance);
            for (&i, [x, y, z, _]) in ordering.iter().zip(balance) {
                self.positions[i as usize] = [x, y, z];
            }
        }
        Ok(())
    }

    /// The rotation around each vertex that fits its edges best.
    fn turn(&mut self) {
        let Self {
            rest,
            rigidity: Rigidity { edges, .. },
            rotations,
            positions,
        } = self;
        rotations
            .par_iter_mut()
            .enumerate()
            .for_each(|(i, rotation)| {
                // Columns Σ w (xᵢ − xⱼ)(pᵢ − pⱼ)ᵀ.
                let mut covariance = [[0.0; 3]; 3];
                for (j, w) in edges.row(i) {
                    let at_rest = vector::sub(rest[i], rest[j as usize]);
                    let now = vector::sub(positions[i], positions[j as usize]);
                    for (column, r) in covariance.iter_mut().zip(at_rest) {
                        *column = vector::add(*column, vector::scaled(now, w * r));
                    }
                }
                rotate_towards(rotation, &covariance);
            });
    }
}

/// Turns R until tr(RᵀM) is largest, M given by columns.
///
/// A turn by ω changes the trace by ⟨g, ω⟩ − ½ ωᵀHω, g = Σ rᵢ × mᵢ, H = tr(B)I − ½(B + Bᵀ), B = Σ mᵢrᵢᵀ. Near the
/// best rotation H is positive and Newton's step ω = H⁻¹g doubles the digits; far from it that of Müller et al. leads on.
fn rotate_towards(rotation: &mut Rotation, columns: &[Point; 3]) {
    for _ in 0..RIGID_SURFACE.rotation_steps {
        let (mut moment, mut aligned) = ([0.0; 3], 0.0);
        let mut product = [[0.0; 3]; 3];
        for (r, m) in rotation.iter().zip(columns) {
            moment = vector::add(moment, vector::cross(*r, *m));
            aligned += vector::dot(*r, *m);
            for (row, x) in product.iter_mut().zip(m) {
                *row = vector::add(*row, vector::scaled(*r, *x));
            }
        }
        let newton = newton_step(&product, aligned, moment);
        let least = if newton.is_some() {
            RIGID_SURFACE.last_step
        } else {
            RIGID_SURFACE.rotation_accuracy
        };
        let step = newton.unwrap_or_else(|| {
            vector::scaled(moment, 1.0 / (aligned.abs() + f64::MIN_POSITIVE.sqrt()))
        });
        let half = vector::scaled(step, 0.5);
        let square = vector::dot(half, half);
        if !square.is_finite() {
            break;
        }
        for r in rotation.iter_mut() {
            // Cayley's rotation by 2·atan(‖step‖/2).
            let across = vector::cross(half, *r);
            let change = vector::add(across, vector::cross(half, across));
            *r = vector::add(*r, vector::scaled(change, 2.0 / (1.0 + square)));
        }
        if 4.0 * square < least * least {
            break;
        }
    }
}

/// H⁻¹g for H = tI − ½(B + Bᵀ), t = tr(B); nothing where H is not clearly positive.
fn newton_step(b: &[Point; 3], t: f64, g: Point) -> Option<Point> {
    /// Least determinant of H for its cube of size: well above rounding.
    const REGULAR: f64 = 1e-9;
    let off = |i: usize, j: usize| -0.5 * (b[i][j] + b[j][i]);
    let [x, y, z] = [0, 1, 2].map(|i| t - b[i][i]);
    let [xy, xz, yz] = [off(0, 1), off(0, 2), off(1, 2)];
    let columns = [[x, xy, xz], [xy, y, yz], [xz, yz, z]];
    let normals = [(1, 2), (2, 0), (0, 1)].map(|(i, j)| vector::cross(columns[i], columns[j]));
    let determinant = vector::dot(columns[0], normals[0]);
    // Leading minors, by Sylvester's criterion.
    let positive = x > 0.0 && normals[2][2] > 0.0 && determinant > REGULAR * t.powi(3) && t > 0.0;
    positive.then(|| normals.map(|normal| vector::dot(normal, g) / determinant))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A strip of a cylinder, which no rotation about its centre leaves as it is.
    fn strip() -> (Vec<Point>, Vec<[u32; 3]>) {
        let positions = (0..40)
            .map(|i| {
                let (along, around) = (f64::from(i / 4), f64::from(i % 4));
                [0.3 * along, (0.7 * around).cos(), (0.7 * around).sin()]
            })
            .collect();
        let triangles = (0..9u32)
            .flat_map(|a| (0..3u32).map(move |b| 4 * a + b))
            .flat_map(|v| [[v, v + 1, v + 4], [v + 1, v + 5, v + 4]])
            .collect();
        (positions, triangles)
    }

    /// Half a turn and more about a skew axis.
    fn moved(p: Point) -> Point {
        let (s, c) = 2.5f64.sin_cos();
        let [x, y, z] = p;
        let (x, y) = (c * x - s * y, s * x + c * y);
        [x + 3.0, c * y - s * z, s * y + c * z]
    }

    #[test]
    fn three_drawn_vertices_move_a_rigid_surface_as_a_whole() {
        let (rest, triangles) = strip();
        let there: Vec<Point> = rest.iter().map(|&p| moved(p)).collect();
        let drawn = |i: usize| [0, 3, 37].contains(&i);
        let areas: Vec<f64> = (0..rest.len())
            .map(|i| if drawn(i) { 1.0 } else { 0.0 })
            .collect();
        let rigidity = Rigidity::new(&rest, &triangles, &areas, None).expect("regular");
        let mut surface = RigidSurface::new(&rigidity, rest.clone());
        surface.positions.clone_from(&there);
        let places: Vec<Point> = (0..rest.len())
            .map(|i| if drawn(i) { there[i] } else { [0.0; 3] })
            .collect();
        surface
            .drawn_to(&places, &|| Ok(()))
            .expect("not cancelled");
        for (x, y) in surface.positions.iter().zip(&there) {
            // Rotations are exact to 1e-6, edges shorter than 2.
            assert!(vector::distance(*x, *y) < 1e-5, "{x:?} {y:?}");
        }
    }

    #[test]
    fn rotations_are_found_from_anywhere() {
        let identity = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        // By how much a patch stretches in its own directions: round, flat, a line and almost.
        for stretch in [[2.0, 1.0, 0.5], [1.0, 1.0, 0.0], [3.0, 1.0, 1e-3]] {
            for angle in [1e-3, 0.4, 1.5, 2.5, 3.1] {
                let about: Rotation = identity.map(|axis| {
                    let (s, c) = f64::sin_cos(angle);
                    let [x, y, z] = axis;
                    let (x, y) = (c * x - s * y, s * x + c * y);
                    [x, c * y - s * z, s * y + c * z]
                });
                // Columns of M = R diag(stretch), whose nearest rotation is R.
                let columns: [Point; 3] =
                    std::array::from_fn(|i| vector::scaled(about[i], stretch[i]));
                let mut found = identity;
                for _ in 0..RIGID_SURFACE.rounds {
                    rotate_towards(&mut found, &columns);
                }
                for (r, wanted) in found.iter().zip(&about) {
                    // A step shorter than the accuracy was the last.
                    let off = vector::distance(*r, *wanted);
                    assert!(
                        off < 10.0 * RIGID_SURFACE.rotation_accuracy,
                        "{stretch:?} {angle}: {off}"
                    );
                }
            }
        }
    }

    #[test]
    fn noise_is_smoothed_without_shrinking() {
        let (rest, triangles) = strip();
        let noisy: Vec<Point> = rest
            .iter()
            .enumerate()
            .map(|(i, p)| vector::add(*p, [0.0, 0.05 * (i as f64 * 2.4).sin(), 0.0]))
            .collect();
        // Drawn weakly against the rigidity.
        let areas = vec![1e-5; rest.len()];
        let rigidity = Rigidity::new(&rest, &triangles, &areas, None).expect("regular");
        let mut surface = RigidSurface::new(&rigidity, rest.clone());
        surface.positions.clone_from(&noisy);
        surface.drawn_to(&noisy, &|| Ok(())).expect("not cancelled");
        let square = |points: &[Point]| -> f64 {
            points
                .iter()
                .zip(&rest)
                .map(|(x, y)| vector::distance(*x, *y).powi(2))
                .sum()
        };
        assert!(square(&surface.positions) < 0.2 * square(&noisy));
    }
}
