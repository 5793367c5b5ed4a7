//! How the body around a point is turned, stretched and moved: moving least squares over the surface.

use rayon::prelude::*;

use super::settings::Settings;
use crate::algebra::similarity::nearest_turn;
use crate::algebra::space_tree::SpaceTree;
use crate::algebra::vector::{self, Point};
use crate::transfer::frame::{Matrix, determinant, inverse, product};
use crate::transfer::surface::Surface;

/// Steps of the R₂ sequence, which fills a square evenly: powers of 1/1.3247…, the real root of x³ = x + 1 (Roberts,
/// "The unreasonable effectiveness of quasirandom sequences", 2018).
const EVEN_STEPS: [f64; 2] = [0.754_877_666_246_692_7, 0.569_840_290_998_053_3];

/// A place of the body: on the source, and on the target.
#[derive(Debug, Clone, Copy)]
pub struct Pair {
    /// Position and normal on the source.
    pub from: (Point, Point),
    /// Position and normal on the target.
    pub to: (Point, Point),
    /// How much it counts, above 0.
    pub trust: f64,
}

/// Places spread evenly over the source's side of a map.
#[derive(Debug)]
pub struct Samples {
    places: Vec<Pair>,
    tree: SpaceTree<'static>,
}

/// `g → to + linear · (g − from)`: what the map makes of the space around a point of the source.
#[derive(Debug, Clone, Copy)]
pub struct Frame {
    /// Mean of the places of the source.
    pub from: Point,
    /// Mean of their counterparts.
    pub to: Point,
    /// J: offsets of the source as offsets of the target.
    pub linear: Matrix,
    /// The way out of the target.
    pub out: Point,
}

impl Frame {
    /// Where the affine map takes a point.
    #[must_use]
    pub fn apply(&self, g: Point) -> Point {
        vector::add(self.to, times(&self.linear, vector::sub(g, self.from)))
    }

    /// Cube root of the volume that J makes of 1.
    #[must_use]
    pub fn size(&self) -> f64 {
        determinant(&self.linear).abs().cbrt()
    }
}

impl Samples {
    /// `count` places of a surface, by area; `pair` is what lies at weights of the corners of a triangle.
    #[must_use]
    pub fn spread(
        surface: &Surface,
        count: usize,
        pair: impl Fn(u32, [f64; 3]) -> Pair + Sync,
    ) -> Self {
        let areas = (0..surface.triangles.len() as u32).map(|t| vector::norm(surface.cross(t)));
        let mut sum = 0.0;
        let upto: Vec<f64> = areas
            .map(|area| {
                sum += area;
                sum
            })
            .collect();
        let places: Vec<Pair> = (0..count)
            .into_par_iter()
            .map(|k| {
                let at = (k as f64 + 0.5) / count as f64 * sum;
                let face = upto.partition_point(|&end| end < at).min(upto.len() - 1);
                let [a, b] = EVEN_STEPS.map(|step| (0.5 + step * (k + 1) as f64).fract());
                let root = a.sqrt();
                pair(face as u32, [1.0 - root, root * (1.0 - b), root * b])
            })
            .collect();
        let points: Vec<Point> = places.iter().map(|p| p.from.0).collect();
        Self {
            places,
            tree: SpaceTree::new(points),
        }
    }

    /// The frame around a point of the source with a normal, of a width.
    ///
    /// With weights w = exp(−|x − q|²/2σ²) max(0, ⟨n, n(q)⟩)² · trust of sum 1, means x̄ and ȳ of the places on source and
    /// target, s² = Σw|y − ȳ|²/Σw|x − x̄|² and e² = Σw|x − x̄|²/2: C = Σw (y − ȳ)(x − x̄)ᵀ + e² s Σw m nᵀ and
    /// A = Σw (x − x̄)(x − x̄)ᵀ + e² Σw n nᵀ, of which J = (C + εsR)(A + ε)⁻¹, with R the turn nearest to C and ε a share of
    /// the trace of A. Without the normals n and m of source and target J would not know what to do with an offset from the
    /// surface; with them it scales it by s. None where nothing is near that looks the same way.
    ///
    /// # Source
    /// Moving least squares: Schaefer, `McPhail`, Warren, "Image deformation using moving least squares", 2006; the normals
    /// are this program's.
    #[must_use]
    pub fn frame(
        &self,
        at: (Point, Point),
        width: f64,
        mirrored: bool,
        settings: &Settings,
    ) -> Option<Frame> {
        let (q, normal) = at;
        let near = self.tree.nearest_few(q, settings.neighbours);
        let weight = |pair: &Pair, squared: f64| {
            let alike = vector::dot(pair.from.1, normal).max(0.0);
            (-squared / (2.0 * width * width)).exp() * alike * alike * pair.trust
        };
        let weighted: Vec<(&Pair, f64)> = near
            .iter()
            .map(|&(squared, id)| {
                let pair = &self.places[id as usize];
                (pair, weight(pair, squared))
            })
            .filter(|&(_, w)| w > 0.0)
            .collect();
        let total: f64 = weighted.iter().map(|&(_, w)| w).sum();
        if weighted.is_empty() || !total.is_normal() {
            return None;
        }
        let mean = |pick: fn(&Pair) -> Point| {
            let sum = weighted.iter().fold([0.0; 3], |sum, &(pair, w)| {
                vector::add(sum, vector::scaled(pick(pair), w))
            });
            vector::scaled(sum, 1.0 / total)
        };
        let (from, to) = (mean(|p| p.from.0), mean(|p| p.to.0));
        let (mut before, mut after) = (0.0, 0.0);
        let (mut c, mut a) = ([[0.0; 3]; 3], [[0.0; 3]; 3]);
        let mut out = [0.0; 3];
        let (mut c_normal, mut a_normal) = ([[0.0; 3]; 3], [[0.0; 3]; 3]);
        for &(pair, w) in &weighted {
            let (x, y) = (vector::sub(pair.from.0, from), vector::sub(pair.to.0, to));
            before += w * vector::dot(x, x);
            after += w * vector::dot(y, y);
            add_outer(&mut c, y, x, w);
            add_outer(&mut a, x, x, w);
            out = vector::add(out, vector::scaled(pair.to.1, w));
            add_outer(&mut c_normal, pair.to.1, pair.from.1, w);
            add_outer(&mut a_normal, pair.from.1, pair.from.1, w);
        }
        let scale = (after / before).sqrt();
        if !scale.is_normal() {
            return None;
        }
        let spread = 0.5 * before;
        add(&mut c, &c_normal, spread / total * scale);
        add(&mut a, &a_normal, spread / total);
        let turn = nearest_turn(&c, mirrored);
        let ridge = settings.frame_ridge * (a[0][0] + a[1][1] + a[2][2]);
        add(&mut c, &turn, ridge * scale);
        for (k, row) in a.iter_mut().enumerate() {
            row[k] += ridge;
        }
        let linear = product(&c, &inverse(&a)?);
        Some(Frame {
            from,
            to,
            linear,
            out: vector::normalised(out),
        })
    }
}

/// Matrix times vector.
#[must_use]
pub fn times(matrix: &Matrix, v: Point) -> Point {
    matrix.map(|row| vector::dot(row, v))
}

fn add_outer(sum: &mut Matrix, column: Point, row: Point, factor: f64) {
    for (out, x) in sum.iter_mut().zip(column) {
        *out = vector::add(*out, vector::scaled(row, factor * x));
    }
}

fn add(sum: &mut Matrix, other: &Matrix, factor: f64) {
    for (out, row) in sum.iter_mut().zip(other) {
        *out = vector::add(*out, vector::scaled(*row, factor));
    }
}
