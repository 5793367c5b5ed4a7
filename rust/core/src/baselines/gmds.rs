//! Generalised multidimensional scaling of sampled points, in the vertex domain.
//!
//! Samples of the target are placed on the source's triangles so that geodesic distances between
//! them change least. The paper replaces these points by functions.
//!
//! # Source
//! Bronstein, Bronstein, Kimmel, "Generalized multidimensional scaling: a framework for
//! isometry-invariant partial surface matching", PNAS 103 (2006). The start by growing partial
//! placements is in the spirit of the branch-and-bound of Raviv, Dubrovina, Kimmel, "Hierarchical
//! framework for shape correspondence", 2013, without its descriptors.

use faer::Mat;

use super::{Convergence, Embedding};
use crate::algebra::dense::Rows;
use crate::baselines::settings::GMDS;
use crate::error::Result;
use crate::geodesics::{Seed, Workspace};
use crate::mesh::numbering::{Sample, WorkingVertex};
use crate::mesh::surface_point::SurfacePoint;
use crate::shape::Shape;
use crate::shape::nearest::nearest;
use crate::shape::pointwise_map::{Distances, EmbeddedTriangles};
use crate::watch::progress::Progress;

/// Embeddings by distances from the target's samples and from their images on the source.
///
/// # Errors
/// [`crate::Error::Cancelled`].
pub fn embedded(source: &Shape, target: &Shape, progress: &Progress) -> Result<Embedding> {
    let most = target.marched().len();
    let levels = GMDS.levels.map(|m| m.min(most));
    let mut best: Option<Placement> = None;
    for start in starts(source, target, levels[0]) {
        let mut placement = Placement::new(source, target, &start);
        placement.settle(progress)?;
        if best
            .as_ref()
            .is_none_or(|b| placement.stress() < b.stress())
        {
            best = Some(placement);
        }
    }
    let mut placement = best.unwrap_or_else(|| Placement::new(source, target, &[]));
    for &count in &levels[1..] {
        placement.extend(count, progress)?;
        placement.settle(progress)?;
    }
    let count = placement.points.len();
    let mut rows = Rows::zeros(target.fields.nrows(), count);
    for v in 0..rows.count() {
        for (j, x) in rows.row_mut(v).iter_mut().enumerate() {
            *x = target.fields[(v, j)];
        }
    }
    Ok(Embedding {
        target: rows,
        convergence: Convergence {
            energy: placement.stress(),
            gradient_norm: None,
            steps: placement.sweeps,
            converged: placement.converged,
        },
        source: placement.fields,
    })
}

/// Vertices of the source for the target's first samples: partial placements on the source's
/// samples grow by one sample at a time, the least stressed are kept, and of the complete ones
/// the best that differ are returned.
fn starts(source: &Shape, target: &Shape, count: usize) -> Vec<Vec<WorkingVertex>> {
    let (on_target, on_source) = (target.between_marched(), source.between_marched());
    let candidates = on_source.nrows() as u32;
    let sites = (0..candidates).map(Sample);
    let mut partial: Vec<(f32, Vec<Sample>)> = sites.clone().map(|c| (0.0, vec![c])).collect();
    for i in 1..count {
        let mut grown: Vec<(f32, usize, Sample)> = Vec::new();
        for (parent, (stress, placed)) in partial.iter().enumerate() {
            for c in sites.clone() {
                let change: f32 = placed
                    .iter()
                    .enumerate()
                    .map(|(j, &p)| (on_target[(i, j)] - on_source[(c.index(), p.index())]).powi(2))
                    .sum();
                grown.push((stress + change, parent, c));
            }
        }
        grown.sort_by(|a, b| a.0.total_cmp(&b.0));
        grown.truncate(GMDS.placements);
        partial = grown
            .into_iter()
            .map(|(stress, parent, c)| {
                let mut placed = partial[parent].1.clone();
                placed.push(c);
                (stress, placed)
            })
            .collect();
    }
    let mut chosen: Vec<Vec<Sample>> = Vec::new();
    for (_, placed) in partial {
        let apart = |other: &Vec<Sample>| {
            let sum: f32 = placed
                .iter()
                .zip(other)
                .map(|(&a, &b)| on_source[(a.index(), b.index())])
                .sum();
            f64::from(sum) / count as f64
        };
        if chosen.iter().all(|other| apart(other) > GMDS.different) {
            chosen.push(placed);
        }
        if chosen.len() == GMDS.starts {
            break;
        }
    }
    let vertex = |p: Sample| WorkingVertex(source.marched()[p.index()]);
    let vertices = |placed: Vec<Sample>| placed.into_iter().map(vertex).collect();
    chosen.into_iter().map(vertices).collect()
}

/// The target's first samples placed on the source.
struct Placement<'a> {
    source: &'a Shape,
    /// Distances between the target's samples.
    wanted: Mat<f32>,
    points: Vec<SurfacePoint>,
    /// Distances on the source from each point, a row for each vertex.
    fields: Rows,
    workspace: Workspace,
    sweeps: usize,
    converged: bool,
}

impl<'a> Placement<'a> {
    fn new(source: &'a Shape, target: &Shape, vertices: &[WorkingVertex]) -> Self {
        let mut placement = Self {
            source,
            wanted: target.between_marched(),
            points: Vec::new(),
            fields: Rows::zeros(source.fields.nrows(), vertices.len()),
            workspace: Workspace::new(&source.marching),
            sweeps: 0,
            converged: false,
        };
        for (i, &v) in vertices.iter().enumerate() {
            placement.points.push(source.point_at(v));
            placement.march(i);
        }
        placement
    }

    /// Sum of squared changes of distances over half the ordered pairs, over the number of pairs.
    fn stress(&self) -> f64 {
        let count = self.points.len();
        let mut sum = 0.0;
        for (i, point) in self.points.iter().enumerate() {
            let corners = self.source.mesh.faces[point.face as usize];
            for j in 0..count {
                let there: f64 = (0..3)
                    .map(|c| point.weights[c] * f64::from(self.fields.row(corners[c] as usize)[j]))
                    .sum();
                if i != j {
                    sum += (there - f64::from(self.wanted[(i, j)])).powi(2);
                }
            }
        }
        sum / (count * count.saturating_sub(1)).max(1) as f64
    }

    /// Distances from point `i`.
    fn march(&mut self, i: usize) {
        let SurfacePoint { face, weights } = self.points[i];
        let seeds = Seed::in_face(&self.source.mesh, face, weights, 0.0).map(|seed| Seed {
            distance: seed.distance * self.source.length_factors[seed.vertex as usize] as f32,
            ..seed
        });
        let mut field = vec![0.0; self.fields.count()];
        self.source
            .marching
            .march_seeds(&seeds, f32::INFINITY, &mut self.workspace, &mut field);
        for (v, distance) in field.into_iter().enumerate() {
            self.fields.row_mut(v)[i] = distance;
        }
    }

    /// The point of the source at which sample `i` changes its distances to the others least.
    fn best_point(&mut self, i: usize) -> SurfacePoint {
        let count = self.fields.dims;
        let mut query = Rows::zeros(1, count);
        for j in 0..count {
            query.row_mut(0)[j] = if j == i { 0.0 } else { self.wanted[(i, j)] };
        }
        if i < count {
            for v in 0..self.fields.count() {
                self.fields.row_mut(v)[i] = 0.0;
            }
        }
        let vertex = nearest(&query, &self.fields);
        let mut distances = Distances::with_room(self.fields.count());
        EmbeddedTriangles::new(self.source, &self.fields).nearest_around(
            vertex[0],
            query.row(0),
            &mut distances,
        )
    }

    /// Moves one sample after the other to its best point until the stress rests.
    fn settle(&mut self, progress: &Progress) -> Result<()> {
        let mut stress = self.stress();
        self.converged = false;
        for _ in 0..GMDS.sweeps {
            for i in 0..self.points.len() {
                progress.check()?;
                self.points[i] = self.best_point(i);
                self.march(i);
            }
            self.sweeps += 1;
            let next = self.stress();
            if next >= (1.0 - GMDS.decrease_bound) * stress {
                self.converged = true;
                break;
            }
            stress = next;
        }
        Ok(())
    }

    /// Places further samples by their distances to those placed before.
    fn extend(&mut self, count: usize, progress: &Progress) -> Result<()> {
        let placed = self.points.len();
        for i in placed..count {
            let point = self.best_point(i);
            self.points.push(point);
        }
        let mut wider = Rows::zeros(self.fields.count(), count);
        for v in 0..wider.count() {
            wider.row_mut(v)[..placed].copy_from_slice(self.fields.row(v));
        }
        self.fields = wider;
        for i in placed..count {
            progress.check()?;
            self.march(i);
        }
        Ok(())
    }
}
