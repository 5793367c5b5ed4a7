//! A surface prepared for matching: everything that depends on one shape only.

pub mod descriptors;
pub mod full_resolution;
pub mod gradients;
pub mod nearest;
pub mod pointwise_map;
pub mod protrusions;
pub mod settings;

use std::sync::{Arc, OnceLock};

use faer::{Mat, MatRef};

use crate::algebra::dense::{self, Rows};
use crate::algebra::vector::Point;
use crate::deformation::piecewise_affine::DeformationGraph;
use crate::deformation::rigid_surface::Rigidity;
use crate::error::{Error, Result};
use crate::geodesics::distance_operator;
use crate::geodesics::metric::{Measured, Metric};
use crate::geodesics::settings::DISTANCE_OPERATOR;
use crate::geodesics::{self, FastMarching};
use crate::mesh::boundary;
use crate::mesh::convexity::Surface;
use crate::mesh::numbering::{CheckedVertex, InputVertex, WorkingVertex};
use crate::mesh::surface_point::SurfacePoint;
use crate::mesh::{Adjacency, Mesh};
use crate::shape::descriptors::Descriptors;
use crate::shape::full_resolution::{FullResolution, FullSpectrum};
use crate::shape::gradients::TangentGradients;
use crate::shape::nearest::Cells;
use crate::shape::protrusions::Protrusions;
use crate::shape::settings::{GRADIENTS, SHAPE};
use crate::spectrum::eigenbasis::Eigenbasis;
use crate::watch::progress::{Check, Progress};

/// A surface as a sampled metric space with its spectrum. Lengths are at unit area in its metric;
/// the positions of `mesh` are at unit area in space.
///
/// A mesh of more than `SHAPE.simplified_above` vertices is simplified first, one of fewer than `SHAPE.refined_below` cut
/// finer; then everything here is that of the working mesh, and [`Shape::full`] leads back to the given one.
#[derive(Debug)]
pub struct Shape {
    /// Checked mesh, simplified when a large one was given, cut finer when a small one was.
    pub mesh: Mesh,
    /// The given mesh behind another one.
    pub full: Option<FullResolution>,
    /// How lengths are measured.
    pub metric: Metric,
    /// Length of one unit here: in given units, or without unit in the scale-invariant metric.
    pub unit: f64,
    /// Lengths around each vertex relative to those of the mesh's positions, `(n)`.
    pub length_factors: Vec<f64>,
    /// Lumped mixed-Voronoi areas, `(n)`, summing to 1.
    pub mass: Vec<f64>,
    /// Smallest eigenpairs of the Laplace–Beltrami operator.
    pub basis: Eigenbasis,
    /// Its eigenfunctions in single precision, a row a vertex.
    pub rows: Rows,
    /// Farthest-point list.
    pub farthest: Vec<u32>,
    /// Distances from the first samples to every vertex, `(n, s)`.
    pub fields: Mat<f32>,
    /// Distance operator `(q, q)`.
    pub distance_operator: Mat<f64>,
    /// [Distances](Self::spectral_distances) between the samples on which maps are judged (`SHAPE.judged`).
    pub between_judged: Mat<f64>,
    /// Coefficients of the positions, `(k, 3)`: `ΦᵀA` V.
    pub coordinates: Mat<f64>,
    /// Pointwise descriptors.
    pub descriptors: Descriptors,
    /// Unit vertex normals, zero where undefined.
    pub normals: Vec<Point>,
    /// +1 when the faces are wound outward.
    pub volume_sign: f64,
    /// How much the surface [bulges](crate::mesh::convexity) around each vertex.
    pub bulging: Vec<f64>,
    /// How [near](boundary::nearness) each vertex lies to a rim.
    pub rim_nearness: Vec<f64>,
    /// Neighbours of each vertex.
    pub neighbours: Adjacency,
    /// Vertices around each farthest-point sample.
    pub cells: Cells,
    /// Faces around each vertex.
    pub vertex_faces: Adjacency,
    /// Marching on this mesh.
    pub marching: FastMarching,
    /// What holds the surface together, and what carries its parts, when it is drawn onto another.
    rigidity: OnceLock<Rigidity>,
    deformation_graph: OnceLock<DeformationGraph>,
    protrusions: OnceLock<Protrusions>,
    judged_gradients: OnceLock<Arc<TangentGradients>>,
    paper_operator: OnceLock<Mat<f64>>,
}

impl Shape {
    /// Prepares a triangle mesh with lengths as in space.
    ///
    /// # Errors
    /// As [`Self::with_metric`].
    pub fn new(
        vertices: &[Point],
        faces: &[[i64; 3]],
        progress: &Progress,
        report: &(dyn Fn(&'static str, f64) -> Result<()> + Sync),
    ) -> Result<Self> {
        Self::with_metric(vertices, faces, Metric::Euclidean, progress, report)
    }

    /// Prepares a triangle mesh.
    ///
    /// `report` is told the stage and the fraction of this shape's work that lies behind.
    ///
    /// # Errors
    /// Those of [`Mesh::new`], [`Eigenbasis::new`], and [`crate::Error::Cancelled`].
    pub fn with_metric(
        vertices: &[Point],
        faces: &[[i64; 3]],
        metric: Metric,
        progress: &Progress,
        report: &(dyn Fn(&'static str, f64) -> Result<()> + Sync),
    ) -> Result<Self> {
        report("reading", 0.0)?;
        let mesh = Self::working_mesh(vertices, faces, progress, report)?;
        Self::of_working_mesh(mesh, metric, progress, report)
    }

    /// Prepares a working mesh, with the given one behind it when that is another.
    ///
    /// # Errors
    /// Those of [`Eigenbasis::new`], and [`crate::Error::Cancelled`].
    pub(crate) fn of_working_mesh(
        (mesh, full): (Mesh, Option<FullResolution>),
        metric: Metric,
        progress: &Progress,
        report: &(dyn Fn(&'static str, f64) -> Result<()> + Sync),
    ) -> Result<Self> {
        report("operator", 0.05)?;
        let surface = Measured::new(&mesh, metric)?;
        report("eigenpairs", 0.1)?;
        let pairs = SHAPE
            .eigenpairs
            .min(mesh.vertices.len() / SHAPE.vertices_a_pair);
        let cancelled = || progress.is_cancelled();
        let basis = Eigenbasis::new(&surface.laplacian, pairs, &cancelled)?;
        report("sampling", 0.6)?;
        let among = sampled_vertices(&mesh, full.as_ref());
        let wanted = SHAPE.samples.min(among);
        let farthest =
            geodesics::farthest_points(&surface.marching, &mesh, among, wanted, &cancelled)?;
        report("geodesics", 0.7)?;
        let marched = &farthest[..SHAPE.marched.min(farthest.len())];
        let fields = geodesics::distances_from(&surface.marching, marched, &cancelled)?;
        let check = || report("distance operator", 0.9);
        Self::assembled((mesh, full), surface, basis, farthest, fields, &check)
    }

    /// The mesh on which everything is computed, and the given one behind it when that is another.
    fn working_mesh(
        vertices: &[Point],
        faces: &[[i64; 3]],
        progress: &Progress,
        report: &(dyn Fn(&'static str, f64) -> Result<()> + Sync),
    ) -> Result<(Mesh, Option<FullResolution>)> {
        let mesh = Mesh::new(vertices, faces)?;
        let given = mesh.vertices.len();
        let (working, full) = if given > SHAPE.simplified_above {
            report("simplification", 0.02)?;
            FullResolution::simplified(mesh, SHAPE.simplified, progress)?
        } else if given < SHAPE.refined_below {
            FullResolution::refined(mesh, SHAPE.refined.min(SHAPE.refined_times * given))
        } else {
            return Ok((mesh, None));
        };
        Ok((working, Some(full)))
    }

    /// Everything that follows from the costly parts.
    fn assembled(
        (mesh, full): (Mesh, Option<FullResolution>),
        surface: Measured,
        basis: Eigenbasis,
        farthest: Vec<u32>,
        fields: Mat<f32>,
        check: Check<'_>,
    ) -> Result<Self> {
        check()?;
        let Measured {
            metric,
            unit,
            laplacian,
            marching,
            length_factors,
        } = surface;
        let marched = &farthest[..fields.ncols()];
        let size = SHAPE
            .operator_size
            .min(basis.values.len())
            .min(2 * marched.len() / 3);
        let distance_operator = distance_operator::from_fields(
            basis.functions.get(.., ..size),
            &basis.values[..size],
            &laplacian.mass,
            marched,
            fields.as_ref(),
            check,
        )?;
        check()?;
        let neighbours = mesh.vertex_neighbours();
        let (normals, volume_sign) = (mesh.vertex_normals(), mesh.volume_sign());
        let functions = basis.functions.as_ref();
        let weighted = Mat::from_fn(mesh.vertices.len(), 3, |i, c| {
            laplacian.mass[i] * mesh.vertices[i][c]
        });
        let coordinates = dense::product(functions.transpose(), weighted.as_ref());
        let (descriptors, (bulging, rim_nearness)) = rayon::join(
            || {
                Descriptors::new(
                    &mesh,
                    &laplacian,
                    &length_factors,
                    &basis,
                    coordinates.as_ref(),
                    check,
                )
            },
            || {
                let surface = Surface {
                    mesh: &mesh,
                    normals: &normals,
                    volume_sign,
                    neighbours: &neighbours,
                    mass: &laplacian.mass,
                };
                (surface.bulging(), boundary::nearness(&mesh))
            },
        );
        let descriptors = descriptors?;
        check()?;
        let judged = &farthest[..SHAPE.judged.min(farthest.len())];
        let between_judged = distance_operator::between_vertices(
            distance_operator.as_ref(),
            functions,
            judged,
            judged,
        );
        Ok(Self {
            coordinates,
            between_judged,
            normals,
            volume_sign,
            bulging,
            rim_nearness,
            cells: Cells::new(&neighbours, &farthest),
            neighbours,
            vertex_faces: mesh.vertex_faces(),
            mass: laplacian.mass,
            metric,
            unit,
            length_factors,
            mesh,
            full,
            rows: Rows::from_matrix(basis.functions.as_ref(), basis.values.len()),
            basis,
            farthest,
            fields,
            distance_operator,
            descriptors,
            marching,
            rigidity: OnceLock::new(),
            deformation_graph: OnceLock::new(),
            protrusions: OnceLock::new(),
            judged_gradients: OnceLock::new(),
            paper_operator: OnceLock::new(),
        })
    }

    /// A shape from its mesh and what an earlier preparation of it kept.
    ///
    /// # Errors
    /// Those of [`Mesh::new`]; [`Error::BadArgument`] when the parts do not fit the mesh;
    /// [`Error::Cancelled`].
    pub fn restored(
        vertices: &[Point],
        faces: &[[i64; 3]],
        metric: Metric,
        parts: CostlyParts,
        progress: &Progress,
    ) -> Result<Self> {
        let (mesh, full) = Self::working_mesh(vertices, faces, progress, &|_, _| progress.check())?;
        let CostlyParts {
            values,
            functions,
            farthest,
            fields,
        } = parts;
        let n = mesh.vertices.len();
        let fit = functions.nrows() == n
            && fields.nrows() == n
            && functions.ncols() == values.len()
            && values.len() > 1
            && (SHAPE.least_marched..=farthest.len()).contains(&fields.ncols())
            && farthest
                .iter()
                .all(|&v| (v as usize) < sampled_vertices(&mesh, full.as_ref()))
            && values.windows(2).all(|w| w[0] <= w[1])
            && values.iter().all(|l| l.is_finite())
            && (0..functions.ncols()).all(|j| functions.col(j).iter().all(|x| x.is_finite()))
            && (0..fields.ncols()).all(|j| fields.col(j).iter().all(|d| *d >= 0.0));
        if !fit {
            return Err(Error::BadArgument {
                what: "the stored parts do not fit the mesh: prepare the shape again".into(),
            });
        }
        let surface = Measured::new(&mesh, metric)?;
        let basis = Eigenbasis {
            values,
            functions,
            residual: f64::NAN,
            solves: 0,
            ordering: None,
        };
        Self::assembled((mesh, full), surface, basis, farthest, fields, &|| {
            progress.check()
        })
    }

    /// What holds the surface together; found when first asked for, since only a shape that moves needs it.
    ///
    /// # Errors
    /// [`Error::NotFactorised`].
    pub fn rigidity(&self) -> Result<&Rigidity> {
        let Mesh {
            vertices, faces, ..
        } = &self.mesh;
        let ordering = self.basis.ordering.as_deref();
        let found = || Rigidity::new(vertices, faces, &self.mass, ordering);
        known_or_found(&self.rigidity, found)
    }

    /// Which nodes carry the surface when its parts slide; found when first asked for, likewise.
    ///
    /// # Errors
    /// [`Error::NotFactorised`].
    pub fn deformation_graph(&self) -> Result<&DeformationGraph> {
        let nodes = self.farthest_points(SHAPE.nodes);
        let found = || DeformationGraph::new(&self.mesh.vertices, &self.neighbours, nodes);
        known_or_found(&self.deformation_graph, found)
    }

    /// Its fingers and what else sticks out; found when first asked for, since only maps between wholes need them.
    pub fn protrusions(&self) -> &Protrusions {
        self.protrusions
            .get_or_init(|| Protrusions::new(self.fields.as_ref(), &self.mass, &self.neighbours))
    }

    /// Gradients at the samples on which maps are judged; found when first asked for.
    pub fn judged_gradients(&self) -> &Arc<TangentGradients> {
        self.judged_gradients.get_or_init(|| {
            let samples = self.farthest_points(SHAPE.judged);
            Arc::new(TangentGradients::new(self, samples, GRADIENTS.functions))
        })
    }

    /// Eigenfunctions of the paper's method at most.
    #[must_use]
    pub fn paper_size(&self) -> usize {
        SHAPE.paper_size.min(self.distance_operator.nrows())
    }

    /// Distance operator of the paper's method, `(k, k)`, from the distances between samples alone; that of
    /// [all](Self::paper_size) its eigenfunctions is kept.
    ///
    /// # Errors
    /// [`Error::NotFactorised`].
    pub fn paper_operator(&self, k: usize) -> Result<Mat<f64>> {
        let found = || {
            distance_operator::from_samples(
                dense::gather_rows(self.basis.functions.as_ref(), self.marched(), k).as_ref(),
                &self.basis.values[..k],
                dense::in_double(self.between_marched().as_ref()).as_ref(),
                DISTANCE_OPERATOR.data_penalty,
            )
        };
        if k == self.paper_size() {
            known_or_found(&self.paper_operator, found).cloned()
        } else {
            found()
        }
    }

    /// Finds what is otherwise found when first asked for.
    ///
    /// # Errors
    /// [`Error::NotFactorised`].
    pub fn complete(&self) -> Result<()> {
        let (rigidity, others) = rayon::join(
            || self.rigidity(),
            || {
                self.protrusions();
                self.judged_gradients();
                self.paper_operator(self.paper_size())?;
                self.deformation_graph()
            },
        );
        rigidity.and(others).map(|_| ())
    }

    /// The checked mesh in the given resolution.
    #[must_use]
    pub fn given_mesh(&self) -> &Mesh {
        self.full.as_ref().map_or(&self.mesh, |full| &full.mesh)
    }

    /// Spectrum of the given mesh when [`Shape::mesh`] is another one; computed when first asked for.
    ///
    /// # Errors
    /// Those of [`FullResolution::spectrum`].
    pub fn full_spectrum(&self, progress: &Progress) -> Result<Option<Arc<FullSpectrum>>> {
        let Some(full) = &self.full else {
            return Ok(None);
        };
        let pairs = SHAPE
            .eigenpairs
            .min(full.mesh.vertices.len() / SHAPE.vertices_a_pair);
        let sizes = (pairs, self.distance_operator.nrows().min(pairs));
        full.spectrum(self.metric, sizes, self.marched(), progress)
            .map(Some)
    }

    /// First `k` eigenfunctions, `(n, k)`.
    #[must_use]
    pub fn functions(&self, k: usize) -> MatRef<'_, f64> {
        self.basis.functions.get(.., ..k)
    }

    /// The samples from which distances were marched.
    #[must_use]
    pub fn marched(&self) -> &[u32] {
        &self.farthest[..self.fields.ncols()]
    }

    /// Distances between the samples from which they were marched, `(s, s)`.
    #[must_use]
    pub fn between_marched(&self) -> Mat<f32> {
        let marched = self.marched();
        let d = |i: usize, j: usize| self.fields[(marched[i] as usize, j)];
        Mat::from_fn(marched.len(), marched.len(), |i, j| {
            f32::midpoint(d(i, j), d(j, i))
        })
    }

    /// The vertex of the given mesh at a vertex, or close to it.
    #[must_use]
    pub fn checked_vertex(&self, vertex: WorkingVertex) -> CheckedVertex {
        let itself = || CheckedVertex(vertex.0);
        (self.full.as_ref()).map_or_else(itself, |full| full.checked_vertex(vertex))
    }

    /// The vertex nearest to one that was given to the intake; `None` where that was dropped.
    #[must_use]
    pub fn working_vertex(&self, vertex: InputVertex) -> Option<WorkingVertex> {
        let checked = self.given_mesh().input_vertex.binary_search(&vertex).ok()?;
        let checked = CheckedVertex(checked as u32);
        let itself = || WorkingVertex(checked.0);
        let found = (self.full.as_ref())
            .map_or_else(itself, |full| full.working_vertex(checked, &self.mesh));
        Some(found)
    }

    /// A vertex as a point of one of its triangles.
    #[must_use]
    pub fn point_at(&self, vertex: WorkingVertex) -> SurfacePoint {
        let face = self.vertex_faces.row(vertex.index())[0];
        SurfacePoint::at_corner(&self.mesh.faces, face, vertex.0)
    }

    /// The first so many farthest-point samples, fewer on a small shape; any number of them covers it.
    #[must_use]
    pub fn farthest_points(&self, count: usize) -> &[u32] {
        &self.farthest[..count.min(self.farthest.len())]
    }

    /// Distances between two lists of vertices through the distance operator, about 2 % off.
    #[must_use]
    pub fn spectral_distances(&self, a: &[u32], b: &[u32]) -> Mat<f64> {
        distance_operator::between_vertices(
            self.distance_operator.as_ref(),
            self.basis.functions.as_ref(),
            a,
            b,
        )
    }

    /// Mean distance between the vertices of two lists of equal length.
    #[must_use]
    pub fn mean_spectral_distance(&self, a: &[u32], b: &[u32]) -> f64 {
        let k = self.distance_operator.nrows();
        let basis = self.basis.functions.as_ref();
        let half = dense::product(
            dense::gather_rows(basis, a, k).as_ref(),
            self.distance_operator.as_ref(),
        );
        let other = dense::gather_rows(basis, b, k);
        let sum: f64 = (0..a.len())
            .map(|i| {
                let d: f64 = (0..k).map(|j| half[(i, j)] * other[(i, j)]).sum();
                if a[i] == b[i] { 0.0 } else { d.max(0.0) }
            })
            .sum();
        sum / a.len() as f64
    }

    /// The farthest-point samples, filled up with vertices in an order that looks random, so that
    /// small and large features get their share.
    #[must_use]
    pub fn drawn_vertices(&self, count: usize) -> Vec<u32> {
        /// Any odd multiplier near 2³²/φ scatters consecutive numbers.
        const SCATTER: u64 = 2_654_435_769;
        let n = self.mesh.vertices.len() as u64;
        let more = count.saturating_sub(self.farthest.len()) as u64;
        let scattered = (0..more).map(|i| (((i * SCATTER) % (1 << 32) * n) >> 32) as u32);
        let mut drawn: Vec<u32> = self.farthest.iter().copied().chain(scattered).collect();
        drawn.truncate(count);
        drawn
    }

    /// Spectrum and distances as handed out: of the given mesh, in given numbering and units.
    ///
    /// # Errors
    /// Those of [`FullResolution::spectrum`], when the given mesh was simplified.
    pub fn public_arrays(&self, progress: &Progress) -> Result<PublicArrays> {
        let spectrum = self.full_spectrum(progress)?;
        let (basis, operator, unit) = spectrum
            .as_ref()
            .map_or((&self.basis, &self.distance_operator, self.unit), |s| {
                (&s.basis, &s.distance_operator, s.unit)
            });
        let geodesics = spectrum.as_ref().map_or_else(
            || dense::in_double(self.between_marched().as_ref()),
            |s| s.geodesics.clone(),
        );
        let mesh = self.given_mesh();
        let mut eigenfunctions = Mat::zeros(mesh.input_positions.len(), basis.values.len());
        for j in 0..basis.values.len() {
            for (phi, &v) in basis.functions.col(j).iter().zip(&mesh.input_vertex) {
                eigenfunctions[(v.index(), j)] = phi / unit;
            }
        }
        Ok(PublicArrays {
            eigenvalues: basis.values.iter().map(|l| l / unit.powi(2)).collect(),
            eigenfunctions,
            geodesics: faer::Scale(unit) * geodesics,
            distance_operator: faer::Scale(unit.powi(3)) * operator,
        })
    }

    /// Vertex areas in given numbering and units; zero at dropped vertices.
    ///
    /// # Errors
    /// Those of [`Measured::new`].
    pub fn given_mass(&self) -> Result<Vec<f64>> {
        let mesh = self.given_mesh();
        let (mass, unit) = if let Some(full) = &self.full {
            let surface = Measured::new(&full.mesh, self.metric)?;
            (surface.laplacian.mass, surface.unit)
        } else {
            (self.mass.clone(), self.unit)
        };
        let mut out = vec![0.0; mesh.input_positions.len()];
        for (a, &v) in mass.iter().zip(&mesh.input_vertex) {
            out[v.index()] = a * unit.powi(2);
        }
        Ok(out)
    }

    /// Samples from which distances were marched, as they were given.
    #[must_use]
    pub fn input_samples(&self) -> Vec<InputVertex> {
        let given = |&v: &u32| self.mesh.input_vertex[v as usize];
        self.marched().iter().map(given).collect()
    }
}

/// What is known, or what is found now. Two that ask at once may both find it; neither waits for the other, who may be
/// waiting for its thread.
fn known_or_found<T>(known: &OnceLock<T>, found: impl FnOnce() -> Result<T>) -> Result<&T> {
    match known.get() {
        Some(known) => Ok(known),
        None => found().map(|found| known.get_or_init(|| found)),
    }
}

/// How many of a working mesh's vertices may be samples: those that the given mesh has too, which are all of
/// a simplified one and the first of a finer one.
fn sampled_vertices(working: &Mesh, full: Option<&FullResolution>) -> usize {
    let given = full.map_or(usize::MAX, |full| full.mesh.vertices.len());
    given.min(working.vertices.len())
}

/// The parts of a shape that take long to compute, in the order of the checked (and simplified)
/// mesh, at unit area.
#[derive(Debug)]
pub struct CostlyParts {
    /// The k eigenvalues.
    pub values: Vec<f64>,
    /// Eigenfunctions `(n, k)`.
    pub functions: Mat<f64>,
    /// Farthest-point samples; distances are known from the first s of them.
    pub farthest: Vec<u32>,
    /// Distances `(n, s)`.
    pub fields: Mat<f32>,
}

/// What a shape hands out, in given numbering and units; zero at dropped vertices.
#[derive(Debug)]
pub struct PublicArrays {
    /// `(k)`, 1/length².
    pub eigenvalues: Vec<f64>,
    /// `(given, k)`.
    pub eigenfunctions: Mat<f64>,
    /// Distances between the samples, `(s, s)`.
    pub geodesics: Mat<f64>,
    /// `(q, q)`, length³.
    pub distance_operator: Mat<f64>,
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use crate::testing::{RINGS, torus};

    #[test]
    fn what_is_found_when_first_asked_for_is_kept() {
        let shape = torus(RINGS);
        let rigidity = shape.rigidity().expect("a pattern");
        shape.complete().expect("patterns");
        assert!(std::ptr::eq(rigidity, shape.rigidity().expect("known")));
        let graph = shape.deformation_graph().expect("known");
        assert!(std::ptr::eq(
            graph,
            shape.deformation_graph().expect("known")
        ));
        let gradients = Arc::as_ptr(shape.judged_gradients());
        assert!(std::ptr::eq(
            gradients,
            Arc::as_ptr(shape.judged_gradients())
        ));
    }

    #[test]
    fn an_operator_of_the_paper_with_fewer_eigenfunctions_is_not_the_kept_one() {
        let shape = torus(RINGS);
        let sizes = [shape.paper_size(), shape.paper_size() / 2];
        for k in [sizes[0], sizes[1], sizes[0]] {
            let found = shape.paper_operator(k).expect("regular");
            assert_eq!(found.shape(), (k, k));
        }
    }
}
