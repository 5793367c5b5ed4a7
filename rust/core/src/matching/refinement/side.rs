//! One shape's part in a refinement: which vertices ask and where their images lie, the embedding of the
//! surface, and weighted rows for the fits.

use std::borrow::Cow;
use std::f64::consts::PI;

use faer::{Accum, Mat, MatMut, MatRef};
use rayon::prelude::*;

use crate::algebra::dense::{self, COMPARED, Rows, multiply};
use crate::algebra::similarity::Similarity;
use crate::algebra::vector::Point;
use crate::error::Result;
use crate::matching::problem::pair::{Pair, Part};
use crate::matching::problem::which::Which;
use crate::matching::refinement::propagation::Images;
use crate::matching::refinement::settings::SIDE;
use crate::mesh::{self, Adjacency};
use crate::shape::Shape;
use crate::watch::progress::Check;

/// Weights in the embedding beside the spectrum; insensitive within a factor of three.
#[derive(Debug, Clone, Copy)]
pub(super) struct Weights {
    pub positions: f64,
    pub normals: f64,
    pub looks: f32,
    /// Eigenfunctions that take part, the lowest.
    pub functions: usize,
}

impl Weights {
    /// What the map coverage of the eigenfunctions that take part.
    pub fn of(self, shared: &[f64]) -> &[f64] {
        &shared[..shared.len().min(self.functions)]
    }
}

/// What an embedding shows of a shape.
#[derive(Debug, Clone, Copy)]
pub(super) enum Surface<'a> {
    /// The shape as it is.
    Whole,
    /// The low-passed surface.
    Smoothed,
    /// A surface with its vertices here, `(n, 3)`.
    Deformed(MatRef<'a, f64>),
}

/// Vertices whose rows are written at once, by one thread.
const EMBEDDED_AT_ONCE: usize = 512;

/// One shape's part in a refinement.
#[derive(Debug, Clone)]
pub struct Side<'a> {
    /// The shape whose side this is.
    pub shape: &'a Shape,
    /// Vertices that ask.
    pub asking: Vec<u32>,
    /// Weight of each; they sum to this side's share.
    pub(super) weights: Vec<f64>,
    /// Those of them that the fits are made of.
    fitting: Fitting,
    /// Which asking vertices are neighbours (none when only some ask).
    pub(super) neighbours: Adjacency,
    /// Images of the asking vertices on the other shape.
    pub images: Images,
    /// Coefficients of the surface that is low-passed, `(K, 3)`.
    coordinates: Mat<f64>,
    /// Low-passed surface, before any deformation.
    pub smoothed: Mat<f64>,
    /// Number of eigenfunctions of which it is made.
    low_passed_to: usize,
    /// What a vertex looks like and how near it is to each landmark: the same at each step.
    fixed: Rows,
    /// Whether positions and normals take part in the embedding.
    extrinsic: bool,
    /// Where landmarks ask, as (number of the asking vertex, image).
    known: Vec<(u32, u32)>,
    /// Embedding of every vertex in the last step.
    pub rows: Rows,
}

/// The asking vertices that fits are made of: a few hundred for each unknown say as much as all.
#[derive(Debug, Clone)]
struct Fitting {
    /// Their numbers among those that ask.
    numbers: Vec<u32>,
    /// Which of them is nearest to each that asks; empty where all that ask are fitted, or none.
    cells: Vec<u32>,
    /// Weight of each, with that of those nearest to it that only ask.
    weights: Vec<f64>,
    /// √w times their shape's eigenfunctions.
    own: Rows,
    /// Sum of the squares of each.
    squares: Vec<f32>,
    /// Their Gram matrix, its lower half.
    gram: Mat<f64>,
}

impl Fitting {
    /// These asking vertices with these weights.
    fn new(
        shape: &Shape,
        asking: &[u32],
        numbers: Vec<u32>,
        cells: Vec<u32>,
        weights: Vec<f64>,
    ) -> Self {
        let vertices: Vec<u32> = numbers.iter().map(|&i| asking[i as usize]).collect();
        let functions = &shape.rows;
        let own = functions.gather_weighted(&vertices, &weights, functions.dims);
        let gram = if numbers.len() == shape.mesh.vertices.len() {
            // Weighted by their areas: orthonormal.
            let share = weights.iter().sum::<f64>();
            let k = functions.dims;
            Mat::from_fn(k, k, |i, j| if i == j { share } else { 0.0 })
        } else {
            dense::gram(own.as_columns())
        };
        Self {
            numbers,
            cells,
            squares: own.squares(),
            gram,
            own,
            weights,
        }
    }

    /// All that ask.
    fn all(shape: &Shape, asking: &[u32], weights: &[f64]) -> Self {
        let numbers = (0..asking.len() as u32).collect();
        Self::new(shape, asking, numbers, Vec::new(), weights.to_vec())
    }

    /// None of them, where they have no weight.
    fn none(shape: &Shape) -> Self {
        Self::new(shape, &[], Vec::new(), Vec::new(), Vec::new())
    }

    /// Some (`SIDE.fitting`) of a shape's vertices, all of which ask, and these.
    fn drawn(shape: &Shape, weights: &[f64], with: &[(u32, u32)]) -> Self {
        let all: Vec<u32> = (0..weights.len() as u32).collect();
        if all.len() <= SIDE.fitting {
            return Self::all(shape, &all, weights);
        }
        let mut drawn = shape.drawn_vertices(SIDE.fitting);
        drawn.extend(with.iter().map(|&(own, _)| own));
        drawn.sort_unstable();
        drawn.dedup();
        let mut gathered = vec![0.0; drawn.len()];
        let cells = mesh::cells(&shape.neighbours, &drawn);
        for (&cell, w) in cells.iter().zip(weights) {
            gathered[cell as usize] += w;
        }
        Self::new(shape, &all, drawn, cells, gathered)
    }
}

impl<'a> Side<'a> {
    pub(super) fn new(pair: &Pair<'a>, which: Which, drawn: Option<usize>) -> Self {
        let (shape, share) = (pair.shape(which), pair.coverage.of(which));
        let mesh = &shape.mesh;
        let (asking, neighbours, weights) = if let Some(count) = drawn {
            let asking = shape.drawn_vertices(count);
            let none = Adjacency::empty(asking.len());
            let weights = vec![share / asking.len() as f64; asking.len()];
            (asking, none, weights)
        } else {
            let all = (0..mesh.vertices.len() as u32).collect();
            let weights = shape.mass.iter().map(|a| share * a).collect();
            (all, shape.neighbours.clone(), weights)
        };
        let known: Vec<(u32, u32)> = pair
            .constraints
            .landmarks
            .iter()
            .filter_map(|landmark| {
                let own = landmark.on(which).0;
                let number = asking.iter().position(|&v| v == own)?;
                Some((number as u32, landmark.on(which.other()).0))
            })
            .collect();
        let detail = shape.descriptors.detail.as_ref();
        let looks = if pair.uses(Part::Descriptors) {
            1.0
        } else {
            0.0
        };
        let held = pair.constraints.in_refinement(which);
        let seen = detail.ncols();
        let mut fixed = Rows::zeros(mesh.vertices.len(), seen + held.ncols());
        for (i, row) in fixed.data.chunks_exact_mut(fixed.dims).enumerate() {
            for (c, out) in row.iter_mut().enumerate() {
                *out = if c < seen {
                    looks * detail[(i, c)]
                } else {
                    held[(i, c - seen)]
                };
            }
        }
        // What a part shows of the whole is little enough, and what the whole has beyond it says nothing.
        let fitting = if share == 0.0 {
            Fitting::none(shape)
        } else if drawn.is_some() || pair.coverage.part().is_some() {
            Fitting::all(shape, &asking, &weights)
        } else {
            Fitting::drawn(shape, &weights, &known)
        };
        Self {
            coordinates: shape.coordinates.clone(),
            images: Images::unknown(asking.len()),
            asking,
            weights,
            neighbours,
            fixed,
            extrinsic: pair.uses(Part::Extrinsic),
            known,
            smoothed: Mat::zeros(0, 3),
            low_passed_to: 0,
            fitting,
            rows: Rows::zeros(0, 1),
            shape,
        }
    }

    /// The same side where only some (`SIDE.fitting`) vertices ask for all. They are neighbours where those nearest to them
    /// are.
    pub(super) fn thinned(&self) -> Self {
        let (n, shape) = (self.asking.len(), self.shape);
        if n < shape.mesh.vertices.len() || n <= SIDE.fitting {
            return self.clone();
        }
        let mut fitting = if self.fitting.cells.is_empty() {
            Fitting::drawn(shape, &self.weights, &self.known)
        } else {
            self.fitting.clone()
        };
        let all = (0..fitting.numbers.len() as u32).collect();
        let asking = std::mem::replace(&mut fitting.numbers, all);
        let cells = std::mem::take(&mut fitting.cells);
        let number = |v: u32| asking.binary_search(&v).ok().map(|number| number as u32);
        let known = self.known.iter();
        let known = known.filter_map(|&(v, image)| Some((number(v)?, image)));
        Self {
            shape,
            known: known.collect(),
            images: self.images.of(&asking),
            neighbours: mesh::between_cells(&shape.neighbours, &cells, asking.len()),
            weights: fitting.weights.clone(),
            fitting: if self.fitting.numbers.is_empty() {
                Fitting::none(shape)
            } else {
                fitting
            },
            asking,
            coordinates: self.coordinates.clone(),
            smoothed: self.smoothed.clone(),
            low_passed_to: self.low_passed_to,
            fixed: self.fixed.clone(),
            extrinsic: self.extrinsic,
            rows: self.rows.clone(),
        }
    }

    /// Images of all the vertices of `all`, of which these were asked for, with the present embeddings of this shape
    /// and of the other.
    pub(super) fn images_of_all(
        &self,
        all: &Self,
        other: &Self,
        sweeps: usize,
        check: Check<'_>,
    ) -> Result<Vec<u32>> {
        let mut images = Images::unknown(all.asking.len());
        for (&v, &image) in self.asking.iter().zip(&self.images.vertex) {
            images.vertex[v as usize] = image;
        }
        if self.asking.len() < all.asking.len() {
            images.settle(
                &all.asking,
                (&self.rows, &all.neighbours),
                (&other.rows, &other.shape.neighbours),
                sweeps,
                check,
            )?;
        }
        Ok(images.vertex)
    }

    pub(super) fn basis(&self, k: usize) -> MatRef<'a, f64> {
        self.shape.functions(k)
    }

    /// How many eigenfunctions there are.
    pub(super) fn most(&self) -> usize {
        self.shape.basis.values.len()
    }

    /// Low-passes the surface to `k` eigenfunctions; those of before are added to.
    pub(super) fn low_pass(&mut self, k: usize) {
        let k = k.min(self.most());
        if k < self.low_passed_to || self.low_passed_to == 0 {
            self.smoothed = Mat::zeros(self.shape.mesh.vertices.len(), 3);
            self.low_passed_to = 0;
        }
        let more = self.low_passed_to..k;
        dense::add_product(
            self.smoothed.as_mut(),
            self.shape.basis.functions.get(.., more.clone()),
            self.coordinates.get(more, ..),
        );
        self.low_passed_to = k;
    }

    /// Turns, scales and moves the surface that is low-passed.
    pub(super) fn place(&mut self, placing: &Similarity) {
        let turn = Mat::from_fn(3, 3, |i, j| placing.scale * placing.turn[i][j]);
        let centre = placing.apply([0.0; 3]);
        let mut coordinates = dense::product(self.coordinates.as_ref(), turn.transpose());
        // A constant is √area = 1 times the first eigenfunction.
        for i in 0..3 {
            coordinates[(0, i)] += centre[i];
        }
        self.coordinates = coordinates;
        self.low_passed_to = 0;
    }

    /// Puts the images of landmarks where they are given.
    pub(super) fn answer_landmarks(&mut self) {
        for &(number, image) in &self.known {
            self.images.vertex[number as usize] = image;
        }
    }

    /// √w times the way from each of the vertices that fits are made of to its image: from a row of `own` to one of
    /// `other`.
    pub(super) fn shifts(&self, own: MatRef<'_, f64>, other: MatRef<'_, f64>) -> Mat<f64> {
        let Fitting {
            numbers, weights, ..
        } = &self.fitting;
        Mat::from_fn(numbers.len(), own.ncols(), |i, c| {
            let number = numbers[i] as usize;
            let (v, image) = (self.asking[number], self.images.vertex[number]);
            weights[i].sqrt() * (other[(image as usize, c)] - own[(v as usize, c)])
        })
    }

    /// √w times k eigenfunctions at the vertices that fits are made of, each a column of `(k, fitting)`.
    pub(super) fn own(&self, k: usize) -> MatRef<'_, f32> {
        self.fitting.own.as_columns().subrows(0, k)
    }

    /// Sums of the squares of its rows.
    pub(super) fn own_squares(&self, k: usize) -> &[f32] {
        &self.fitting.squares[..k]
    }

    /// √w times k eigenfunctions of the other shape at their images.
    pub(super) fn at_images(&self, other: &Side<'_>, k: usize) -> Rows {
        let Fitting {
            numbers, weights, ..
        } = &self.fitting;
        let image = |&i: &u32| self.images.vertex[i as usize];
        let images: Vec<u32> = numbers.iter().map(image).collect();
        other.shape.rows.gather_weighted(&images, weights, k)
    }

    /// Gram matrix of [these](Self::own), its lower half.
    pub(super) fn own_gram(&self, k: usize) -> MatRef<'_, f64> {
        self.fitting.gram.get(..k, ..k)
    }

    /// \[surface, weighted normals, looks, landmarks, Φ or Φ·`matrix` / (√π k), zeros\]: in the surface and the
    /// spectrum a unit is about a unit of length on the surface, in the latter because Σλ ≈ 2πk² at unit area.
    /// Each eigenfunction is scaled by the square of what is shared of it: the others say nothing. Places come
    /// first since they tell most points apart, before the rest of a row is read.
    pub(super) fn embed(
        &mut self,
        matrix: Option<MatRef<'_, f64>>,
        shared: &[f64],
        surface: Surface<'_>,
        weights: Weights,
    ) {
        let mesh = &self.shape.mesh;
        let (n, k) = (mesh.vertices.len(), shared.len());
        let scale = 1.0 / (PI.sqrt() * k as f64);
        let scales: Vec<f32> = shared.iter().map(|r| (scale * r * r) as f32).collect();
        let placed = |at: MatRef<'_, f64>| {
            let positions: Vec<Point> = (0..n).map(|i| [0, 1, 2].map(|c| at[(i, c)])).collect();
            let normals = mesh::normals_of(&positions, &mesh.faces);
            (Cow::Owned(positions), Cow::Owned(normals))
        };
        let (positions, normals): (Cow<'_, [Point]>, Cow<'_, [Point]>) = match surface {
            Surface::Whole => ((&mesh.vertices).into(), (&self.shape.normals).into()),
            Surface::Smoothed => placed(self.smoothed.as_ref()),
            Surface::Deformed(at) => placed(at),
        };
        let sign = weights.normals * self.shape.volume_sign;
        let looks = self.shape.descriptors.detail.ncols();
        // What has no weight is left out.
        let first_fixed = if weights.looks > 0.0 { 0 } else { looks };
        let before = 6 + self.fixed.dims - first_fixed;
        let spectrum = before..before + k;
        let functions = &self.shape.rows;
        // Rows have no padding, of which products would read what is left there: see `Rows::times`.
        let transposed = matrix.map(|matrix| {
            let mut scaled = Rows::from_matrix(matrix, k);
            for row in scaled.data.chunks_exact_mut(k) {
                for (value, scale) in row.iter_mut().zip(&scales) {
                    *value *= scale;
                }
            }
            scaled
        });
        let dims = spectrum.end.next_multiple_of(COMPARED);
        self.rows.resize(n, dims);
        let shown = if self.extrinsic { 1.0 } else { 0.0 };
        let fixed = &self.fixed;
        let write = |block: usize, rows: &mut [f32]| {
            let first = block * EMBEDDED_AT_ONCE;
            if let Some(transposed) = &transposed {
                let count = rows.len() / dims;
                let of_block =
                    functions
                        .as_columns()
                        .submatrix(0, first, transposed.count(), count);
                multiply(
                    MatMut::from_column_major_slice_mut(rows, dims, count).subrows_mut(before, k),
                    Accum::Replace,
                    transposed.as_columns(),
                    of_block,
                    1.0,
                );
            }
            for (i, row) in (first..).zip(rows.chunks_exact_mut(dims)) {
                for c in 0..3 {
                    row[c] = (shown * weights.positions * positions[i][c]) as f32;
                    row[3 + c] = (shown * sign * normals[i][c]) as f32;
                }
                let (own, held) = fixed.row(i).split_at(looks);
                let (out, out_held) = row[6..before].split_at_mut(looks - first_fixed);
                for (out, value) in out.iter_mut().zip(own) {
                    *out = weights.looks * value;
                }
                out_held.copy_from_slice(held);
                if transposed.is_none() {
                    let row = row[spectrum.clone()].iter_mut();
                    for ((out, value), scale) in row.zip(functions.row(i)).zip(&scales) {
                        *out = scale * value;
                    }
                }
                row[spectrum.end..].fill(0.0);
            }
        };
        self.rows
            .data
            .par_chunks_mut(EMBEDDED_AT_ONCE * dims)
            .enumerate()
            .for_each(|(block, rows)| write(block, rows));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::matching::problem::constraints::Constraints;
    use crate::matching::problem::pair::Coverage;
    use crate::testing::{self, RINGS, torus};

    #[test]
    fn low_passing_to_more_adds_to_what_is_there() {
        let shape = torus(RINGS);
        let constraints = Constraints::default();
        let pair = testing::pair(&shape, &shape, Coverage::BOTH, &constraints);
        let smoothed_to = |sizes: &[usize]| {
            let mut side = Side::new(&pair, Which::Target, None);
            for &k in sizes {
                side.low_pass(k);
            }
            side.smoothed
        };
        let at_once = smoothed_to(&[60]);
        for sizes in [&[20, 60][..], &[20, 60, 60], &[80, 60]] {
            // Rounding of sums of 60 numbers below 1, in another order.
            assert!(
                (smoothed_to(sizes) - &at_once).norm_max() < 1e-14,
                "{sizes:?}"
            );
        }
        assert!((smoothed_to(&[20]) - &at_once).norm_max() > 1e-3);
    }

    #[test]
    fn some_vertices_ask_for_all_and_lead_to_the_images_of_all() {
        let shape = torus(RINGS);
        let constraints = Constraints::default();
        let pair = testing::pair(&shape, &shape, Coverage::BOTH, &constraints);
        let mut all = Side::new(&pair, Which::Target, None);
        let count = all.asking.len();
        all.images.vertex = (0..count as u32).collect();
        all.rows = shape.rows.clone();

        // The 500 farthest points and more; some are drawn twice.
        let thinned = all.thinned();
        assert!(SIDE.fitting < count && (500..=SIDE.fitting).contains(&thinned.asking.len()));
        // Fits are made of the same vertices with the same weights, whether the others ask or not.
        assert_eq!(all.own(20), thinned.own(20));
        // Every vertex is counted once, in another order than that of the sum.
        assert!((thinned.weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        let number = |v: u32| thinned.asking.binary_search(&v).expect("asks") as u32;
        for (i, &v) in thinned.asking.iter().enumerate() {
            assert_eq!(thinned.images.vertex[i], v);
            let around = thinned.neighbours.row(i);
            assert!(!around.is_empty());
            for &j in around {
                assert!(thinned.neighbours.row(j as usize).contains(&(i as u32)));
            }
            // Neighbours on the mesh that both ask are neighbours.
            for &u in all.shape.neighbours.row(v as usize) {
                if thinned.asking.binary_search(&u).is_ok() {
                    assert!(around.contains(&number(u)));
                }
            }
        }

        // In equal embeddings the nearest vertex is the same one, of all that were not asked for too.
        let images = thinned.images_of_all(&all, &all, 3, &|| Ok(()));
        assert_eq!(images.expect("not cancelled"), all.images.vertex);

        // They are no more when thinned again.
        assert_eq!(thinned.thinned().asking, thinned.asking);
    }

    #[test]
    fn a_cell_holds_the_vertices_nearest_to_its_centre() {
        let shape = torus(RINGS);
        let centres = [3, 500, 777];
        let cell = mesh::cells(&shape.neighbours, &centres);
        // Edges from each centre, ring by ring.
        let steps = centres.map(|centre| {
            let mut steps = vec![usize::MAX; cell.len()];
            let mut front = vec![centre];
            steps[centre as usize] = 0;
            for step in 1.. {
                let around = front.iter().flat_map(|&v| shape.neighbours.row(v as usize));
                let mut next: Vec<u32> = around.copied().collect();
                next.retain(|&v| steps[v as usize] == usize::MAX);
                next.sort_unstable();
                next.dedup();
                if next.is_empty() {
                    break;
                }
                for &v in &next {
                    steps[v as usize] = step;
                }
                front = next;
            }
            steps
        });
        for (v, &own) in cell.iter().enumerate() {
            let least = steps.iter().map(|steps| steps[v]).min();
            assert_eq!(Some(steps[own as usize][v]), least);
        }
        let touching = mesh::between_cells(&shape.neighbours, &cell, centres.len());
        for a in 0..centres.len() {
            assert!(!touching.row(a).contains(&(a as u32)));
            // On a ring of three cells each touches both others.
            assert_eq!(touching.row(a).len(), 2);
        }
    }
}
