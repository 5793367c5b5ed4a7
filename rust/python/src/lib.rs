//! Thin Python binding: arrays in, one call, arrays out. The package `sgmds` wraps it.
#![expect(
    clippy::needless_pass_by_value,
    reason = "arguments of Python functions are extracted by value"
)]

mod envelope;
mod errors;
mod kernels;
mod poses;
mod transfer;
mod watched;

use std::hint::black_box;
use std::sync::Arc;

use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use sgmds_core::Error;
use sgmds_core::figure::{self, Figure, FigureMap};
use sgmds_core::geodesics::metric::Metric;
use sgmds_core::matching::problem::landmark::Landmark;
use sgmds_core::matching::problem::pair::{Coverage, LeftOut, Mirror};
use sgmds_core::matching::ranking::Metrics;
use sgmds_core::matching::ranking::quality;
use sgmds_core::matching::{self, Correspondence, Method, Options};
use sgmds_core::memory;
use sgmds_core::mesh::numbering::GivenVertex;
use sgmds_core::mesh::{Mesh, polygons};
use sgmds_core::shape::CostlyParts;
use sgmds_core::shape::full_resolution::FullResolution;

use watched::watched;

/// A prepared figure: a surface, or pieces that are matched as one.
#[pyclass(frozen, module = "sgmds._core")]
struct PreparedShape {
    figure: Arc<Figure>,
}

/// What `match_pair` takes for each shape.
enum Input {
    Ready(Arc<Figure>),
    Raw(Vec<[f64; 3]>, Vec<[i64; 3]>),
}

impl Input {
    fn extract(value: &Bound<'_, PyAny>) -> PyResult<Self> {
        if let Ok(shape) = value.cast::<PreparedShape>() {
            return Ok(Self::Ready(Arc::clone(&shape.get().figure)));
        }
        let (vertices, faces): (PyReadonlyArray2<'_, f64>, PyReadonlyArray2<'_, i64>) =
            value.extract()?;
        Ok(Self::Raw(triples(&vertices)?, triples(&faces)?))
    }

    fn prepared(
        self,
        progress: &sgmds_core::watch::progress::Progress,
        report: &(dyn Fn(&'static str, f64) -> Result<(), Error> + Sync),
    ) -> Result<Arc<Figure>, Error> {
        match self {
            Self::Ready(figure) => Ok(figure),
            Self::Raw(vertices, faces) => {
                Figure::new(&vertices, &faces, Metric::Euclidean, progress, report).map(Arc::new)
            }
        }
    }
}

fn triples<T: numpy::Element + Copy>(array: &PyReadonlyArray2<'_, T>) -> PyResult<Vec<[T; 3]>> {
    let flat = array.as_slice()?;
    Ok(flat.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect())
}

fn matrix<'py>(py: Python<'py>, m: faer::MatRef<'_, f64>) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let flat: Vec<f64> = (0..m.nrows())
        .flat_map(|i| (0..m.ncols()).map(move |j| m[(i, j)]))
        .collect();
    flat.into_pyarray(py).reshape([m.nrows(), m.ncols()])
}

#[pymethods]
impl PreparedShape {
    /// How lengths are measured.
    #[getter]
    fn metric(&self) -> &'static str {
        self.figure.shape.metric.name()
    }

    /// Eigenvalues, eigenfunctions, geodesics and distance operator in given numbering and
    /// units; they are computed now where the map is sought on another mesh than the given one.
    fn public_arrays<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let arrays = watched(py, None, None, |state| self.figure.public_arrays(state))?;
        let dict = PyDict::new(py);
        dict.set_item("eigenvalues", arrays.eigenvalues.into_pyarray(py))?;
        for (name, array) in [
            ("eigenfunctions", arrays.eigenfunctions),
            ("geodesics", arrays.geodesics),
            ("distance_operator", arrays.distance_operator),
        ] {
            dict.set_item(name, matrix(py, array.as_ref())?)?;
        }
        Ok(dict)
    }

    /// Lumped areas at the given vertices.
    #[getter]
    fn mass<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let mass = watched(py, None, None, |_| self.figure.given_mass())?;
        Ok(mass.into_pyarray(py))
    }

    /// Samples from which distances were marched.
    #[getter]
    fn samples<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        let samples = self.figure.given_samples().into_iter();
        let ids: Vec<i64> = samples.map(|v| i64::from(v.0)).collect();
        ids.into_pyarray(py)
    }

    /// Vertices of the mesh on which maps are sought.
    #[getter]
    fn working_vertices(&self) -> usize {
        self.figure.shape.mesh.vertices.len()
    }

    /// The costly parts in the order of the checked mesh, at unit area, for `restore`.
    #[getter]
    fn parts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let shape = &self.figure.shape;
        let (basis, fields) = (&shape.basis, &shape.fields);
        let flat: Vec<f32> = (0..fields.nrows())
            .flat_map(|i| (0..fields.ncols()).map(move |j| fields[(i, j)]))
            .collect();
        let dict = PyDict::new(py);
        dict.set_item("values", basis.values.clone().into_pyarray(py))?;
        dict.set_item("functions", matrix(py, basis.functions.as_ref())?)?;
        dict.set_item("farthest", shape.farthest.clone().into_pyarray(py))?;
        dict.set_item(
            "fields",
            flat.into_pyarray(py)
                .reshape([fields.nrows(), fields.ncols()])?,
        )?;
        Ok(dict)
    }

    /// Vertices and faces that were left to prepare, before any simplification.
    #[getter]
    fn checked_size(&self) -> (usize, usize) {
        let mesh = self.figure.shape.given_mesh();
        (mesh.vertices.len(), mesh.faces.len())
    }

    /// Given vertices.
    #[getter]
    fn vertex_count(&self) -> usize {
        self.figure.vertex_count()
    }

    /// What was done to make one surface of the figure.
    #[getter]
    fn made<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let figure = &self.figure;
        let dict = PyDict::new(py);
        dict.set_item("welded", figure.joined())?;
        dict.set_item("pieces", figure.pieces)?;
        dict.set_item("envelope", figure.is_wrapped())?;
        dict.set_item("handles", figure.handles())?;
        dict.set_item("seen", figure.seen)?;
        Ok(dict)
    }

    /// What the intake ignored or mended.
    #[getter]
    fn report<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let r = self.figure.report();
        let dict = PyDict::new(py);
        for (name, count) in [
            ("zero_area_faces", r.zero_area_faces),
            ("bridging_faces", r.bridging_faces),
            ("duplicate_faces", r.duplicate_faces),
            ("stray_vertices", r.stray_vertices),
            ("isolated_vertices", r.isolated_vertices),
            ("dropped_components", r.dropped_components),
            ("dropped_component_vertices", r.dropped_component_vertices),
            ("flipped_faces", r.flipped_faces),
            ("nonmanifold_edges", r.nonmanifold_edges),
            ("boundary_edges", r.boundary_edges),
        ] {
            dict.set_item(name, count)?;
        }
        Ok(dict)
    }
}

fn metric_named(name: &str) -> PyResult<Metric> {
    [Metric::Euclidean, Metric::ScaleInvariant]
        .into_iter()
        .find(|m| m.name() == name)
        .ok_or_else(|| PyValueError::new_err(format!("no metric named {name:?}")))
}

/// A shape from its mesh and the stored parts of an earlier preparation.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "one for each stored part")]
fn restore(
    py: Python<'_>,
    vertices: PyReadonlyArray2<'_, f64>,
    faces: PyReadonlyArray2<'_, i64>,
    metric: &str,
    values: Vec<f64>,
    functions: PyReadonlyArray2<'_, f64>,
    farthest: Vec<u32>,
    fields: PyReadonlyArray2<'_, f32>,
) -> PyResult<PreparedShape> {
    let (vertices, faces) = (triples(&vertices)?, triples(&faces)?);
    let metric = metric_named(metric)?;
    let (functions, fields) = (functions.as_array(), fields.as_array());
    let functions = faer::Mat::from_fn(functions.nrows(), functions.ncols(), |i, j| {
        functions[[i, j]]
    });
    let fields = faer::Mat::from_fn(fields.nrows(), fields.ncols(), |i, j| fields[[i, j]]);
    let figure = watched(py, None, None, move |state| {
        let parts = CostlyParts {
            values,
            functions,
            farthest,
            fields,
        };
        Figure::restored(&vertices, &faces, metric, parts, state)
    })?;
    Ok(PreparedShape {
        figure: Arc::new(figure),
    })
}

/// Prepares one mesh: `vertices` (n, 3) float64, `faces` (m, 3) int64, both contiguous.
#[pyfunction]
#[pyo3(signature = (vertices, faces, metric, progress=None, threads=None))]
fn prepare(
    py: Python<'_>,
    vertices: PyReadonlyArray2<'_, f64>,
    faces: PyReadonlyArray2<'_, i64>,
    metric: &str,
    progress: Option<&Bound<'_, PyAny>>,
    threads: Option<usize>,
) -> PyResult<PreparedShape> {
    let (vertices, faces) = (triples(&vertices)?, triples(&faces)?);
    let metric = metric_named(metric)?;
    let figure = watched(py, progress, threads, move |state| {
        let figure = Figure::new(&vertices, &faces, metric, state, &|stage, f| {
            state.enter(stage, f)
        })?;
        figure.shape.complete()?;
        Ok(figure)
    })?;
    Ok(PreparedShape {
        figure: Arc::new(figure),
    })
}

/// A map as computed, with the shapes it needs to complete its alternatives.
#[pyclass(frozen, module = "sgmds._core")]
struct RawMatch {
    source: Arc<Figure>,
    target: Arc<Figure>,
    found: FigureMap,
}

impl RawMatch {
    fn map(&self) -> &Correspondence {
        &self.found.map
    }
}

#[pymethods]
impl RawMatch {
    /// Source face of each target vertex's image.
    #[getter]
    fn faces<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        let ids: Vec<i64> = self.map().faces.iter().map(|&f| i64::from(f)).collect();
        ids.into_pyarray(py)
    }

    /// Weights of that face's corners.
    #[getter]
    fn barycentric<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let flat: Vec<f64> = self.map().barycentric.iter().flatten().copied().collect();
        flat.into_pyarray(py)
            .reshape([self.map().barycentric.len(), 3])
    }

    /// Corner with the largest weight.
    #[getter]
    fn vertices<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        let ids: Vec<i64> = self.map().vertices.iter().map(|&v| i64::from(v)).collect();
        ids.into_pyarray(py)
    }

    /// Confidence in [0, 1].
    #[getter]
    fn confidence<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.map().confidence.clone().into_pyarray(py)
    }

    /// α, source coefficients → target coefficients; computed now where the map was sought on other meshes than
    /// the given ones.
    fn functional_map<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        if self.map().is_on_given_meshes() {
            return matrix(py, self.map().functional_map.as_ref());
        }
        let map = watched(py, None, None, |state| {
            self.map()
                .full_functional_map(&self.source.shape, &self.target.shape, state)
        })?;
        matrix(py, map.as_ref())
    }

    /// Whether the functional map is known already.
    #[getter]
    fn knows_functional_map(&self) -> bool {
        self.map().is_on_given_meshes()
    }

    /// Whether the functional map takes next to no time: unless a mesh was simplified, since it was large.
    #[getter]
    fn functional_map_is_quick(&self) -> bool {
        let small = |figure: &Figure| {
            let full = figure.shape.full.as_ref();
            full.is_none_or(FullResolution::is_finer)
        };
        small(&self.source) && small(&self.target)
    }

    /// What the score of the quality weighs, nothing where nothing was measured.
    #[getter]
    fn evidence(&self) -> Option<[f64; 5]> {
        let metrics = self.map().metrics.as_ref()?;
        Some(quality::evidence(metrics, self.map().coverage))
    }

    /// Grade, reasons and metrics.
    #[getter]
    fn quality<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let dict = PyDict::new(py);
        dict.set_item("unmatched", self.map().unmatched)?;
        dict.set_item("unknown", self.found.unknown)?;
        let (grade, reasons) = figure::graded(&self.found, &self.source, &self.target);
        dict.set_item("grade", grade.name())?;
        dict.set_item("reasons", reasons)?;
        if let Some(metrics) = &self.map().metrics {
            dict.set_item("score", quality::score(metrics, self.map().coverage))?;
            let Metrics {
                orientation,
                local_distortion,
                contradiction,
                margin,
                apart,
                agreement,
                extrinsic_agreement,
                mirrored_gain,
                torn,
            } = *metrics;
            dict.set_item("orientation", orientation)?;
            dict.set_item("local_distortion", local_distortion)?;
            dict.set_item("contradiction", contradiction)?;
            dict.set_item("margin", margin)?;
            dict.set_item("apart", apart)?;
            dict.set_item("agreement", agreement)?;
            dict.set_item("extrinsic_agreement", extrinsic_agreement)?;
            dict.set_item("mirrored_gain", mirrored_gain)?;
            dict.set_item("torn", torn)?;
        }
        if let Some(end) = &self.map().convergence {
            dict.set_item("energy", end.energy)?;
            if let Some(norm) = end.gradient_norm {
                dict.set_item("gradient_norm", norm)?;
            }
            dict.set_item("steps", end.steps)?;
            dict.set_item("converged", end.converged)?;
        }
        let map = self.map().functional_map.as_ref();
        let energy = matching::energy(&self.source.shape, &self.target.shape, map)
            .map_err(|e| errors::to_python(py, &e))?;
        dict.set_item("sgmds_energy", energy)?;
        Ok(dict)
    }

    /// How many alternatives there are.
    #[getter]
    fn alternative_count(&self) -> usize {
        self.map().others.len()
    }

    /// Completes one alternative to a dense map.
    #[pyo3(signature = (index, progress=None, threads=None))]
    fn alternative(
        &self,
        py: Python<'_>,
        index: usize,
        progress: Option<&Bound<'_, PyAny>>,
        threads: Option<usize>,
    ) -> PyResult<Self> {
        let found = watched(py, progress, threads, |state| {
            let report = |stage: &'static str, f: f64| state.enter(stage, f);
            figure::completed(
                &self.source,
                &self.target,
                &self.found,
                index,
                state,
                &report,
            )
        })?;
        Ok(Self {
            source: Arc::clone(&self.source),
            target: Arc::clone(&self.target),
            found,
        })
    }
}

/// Matches two shapes, each prepared or a pair of contiguous arrays (float64, int64).
#[pyfunction]
#[pyo3(signature = (source, target, method, mirror, part, landmarks, same_axes, without, progress=None, threads=None))]
#[expect(
    clippy::too_many_arguments,
    reason = "keyword arguments of the Python function"
)]
fn match_pair(
    py: Python<'_>,
    source: &Bound<'_, PyAny>,
    target: &Bound<'_, PyAny>,
    method: &str,
    mirror: &str,
    part: Option<&str>,
    landmarks: Vec<(u32, u32)>,
    same_axes: bool,
    without: Vec<String>,
    progress: Option<&Bound<'_, PyAny>>,
    threads: Option<usize>,
) -> PyResult<RawMatch> {
    let landmark = |(source, target)| Landmark {
        source: GivenVertex(source),
        target: GivenVertex(target),
    };
    let options = Options {
        method: match method {
            "paper" => Method::Paper,
            "gmds" => Method::Gmds,
            "functional-map" => Method::FunctionalMap,
            _ => Method::Auto,
        },
        mirror: if mirror == "allow" {
            Mirror::Allow
        } else {
            Mirror::Forbid
        },
        coverage: match part {
            Some("source") => Some(Coverage::SOURCE_IS_PART),
            Some("target") => Some(Coverage::TARGET_IS_PART),
            _ => None,
        },
        landmarks: landmarks.into_iter().map(landmark).collect(),
        same_axes,
        left_out: LeftOut::named(&without).map_err(|e| errors::to_python(py, &e))?,
    };
    let (source, target) = (Input::extract(source)?, Input::extract(target)?);
    // Preparing is about half of the work.
    let prepared_share = match (&source, &target) {
        (Input::Ready(_), Input::Ready(_)) => 0.0,
        _ => 0.5,
    };
    let outcome = watched(py, progress, threads, move |state| {
        let report = |stage, f: f64| state.enter(stage, prepared_share * f);
        let (source, target) = match rayon::join(
            || source.prepared(state, &report),
            || target.prepared(state, &report),
        ) {
            (Ok(source), Ok(target)) => (source, target),
            (Err(error), _) => return Ok(Err(("source", error))),
            (_, Err(error)) => return Ok(Err(("target", error))),
        };
        let found = figure::match_figures(&source, &target, &options, state, &|stage, f| {
            state.enter(stage, prepared_share + (1.0 - prepared_share) * f)
        })?;
        Ok(Ok(RawMatch {
            source,
            target,
            found,
        }))
    })?;
    outcome.map_err(|(role, error)| errors::about(py, role, &error))
}

/// Panics on a worker thread in the stage "selection", to test what becomes of that.
#[pyfunction]
fn provoke_panic(py: Python<'_>) -> PyResult<()> {
    watched(py, None, None, |state| {
        state.enter("selection", 0.5)?;
        rayon::join(|| panic!("provoked"), || ());
        Ok(())
    })
}

/// Vertices and faces of a mesh that would be left to prepare.
#[pyfunction]
fn checked_size(
    py: Python<'_>,
    vertices: PyReadonlyArray2<'_, f64>,
    faces: PyReadonlyArray2<'_, i64>,
) -> PyResult<(usize, usize)> {
    let (vertices, faces) = (triples(&vertices)?, triples(&faces)?);
    watched(py, None, None, move |_| {
        let mesh = Mesh::new(&vertices, &faces)?;
        Ok((mesh.vertices.len(), mesh.faces.len()))
    })
}

/// Triangles `(c − 2 p, 3)` of `p` polygons with `c` corners, named by vertex.
#[pyfunction]
fn triangulate<'py>(
    py: Python<'py>,
    vertices: PyReadonlyArray2<'py, f64>,
    corners: PyReadonlyArray1<'py, i64>,
    sizes: PyReadonlyArray1<'py, i64>,
) -> PyResult<Bound<'py, PyArray2<i64>>> {
    let (corners, sizes) = (corners.as_slice()?, sizes.as_slice()?);
    let vertices = vertices.as_slice()?.as_chunks().0;
    let triangles = watched(py, None, None, |progress| {
        polygons::triangulate(vertices, corners, sizes, &|| progress.check())
    })?;
    let count = triangles.len();
    triangles
        .into_flattened()
        .into_pyarray(py)
        .reshape([count, 3])
}

/// Bytes that preparing meshes of these (vertices, faces) together takes at its peak.
#[pyfunction]
fn memory_to_prepare(sizes: Vec<(u64, u64)>) -> u64 {
    memory::to_prepare(&sizes)
}

/// Bytes that matching two prepared shapes takes at its peak, beyond the shapes.
#[pyfunction]
fn memory_to_match(source: u64, target: u64) -> u64 {
    memory::to_match(source, target)
}

/// Bytes that the spectrum of a simplified mesh in its given resolution takes at its peak.
#[pyfunction]
fn memory_for_spectrum(vertices: u64, faces: u64) -> u64 {
    memory::for_spectrum(vertices, faces)
}

/// Values of the source at the images of the target's vertices; all arrays contiguous.
#[pyfunction]
fn transfer_values<'py>(
    py: Python<'py>,
    faces: Vec<i64>,
    barycentric: PyReadonlyArray2<'py, f64>,
    triangles: PyReadonlyArray2<'py, i64>,
    values: PyReadonlyArray2<'py, f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (weights, triangles) = (triples(&barycentric)?, triples(&triangles)?);
    let [rows, channels] = *values.as_array().shape() else {
        unreachable!("the array has two dimensions")
    };
    let values = values.as_slice()?;
    let out = watched(py, None, None, |_| {
        sgmds_core::transfer::transfer(&faces, &weights, &triangles, rows, values, channels)
    })?;
    out.into_pyarray(py).reshape([faces.len(), channels])
}

/// Memory that the allocator of glibc keeps after it was freed: it gives back what lies free at an arena's end from twice the
/// largest block on that it ever had from the system alone and got back, at most 32 MB, and then every page is mapped
/// anew. Of 200 eigenpairs of 5,000 vertices that was a fifth.
const KEPT_FREE: usize = 64 << 20;

/// What the allocator adds to a block, in whole pages, at most.
const HEADER: usize = 8 << 10;

/// Frees a block as large as counts, its header included; its memory is never touched.
fn keep_freed_memory() {
    drop(black_box(Vec::<u8>::with_capacity(KEPT_FREE / 2 - HEADER)));
}

#[pymodule]
fn _core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    // Threads are taken per pair and per shape; a factorisation that took its own would change
    // the order of sums.
    faer::set_global_parallelism(faer::Par::Seq);
    keep_freed_memory();
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<PreparedShape>()?;
    module.add_class::<RawMatch>()?;
    module.add_class::<kernels::Kernels>()?;
    module.add_function(wrap_pyfunction!(prepare, module)?)?;
    module.add_function(wrap_pyfunction!(restore, module)?)?;
    module.add_function(wrap_pyfunction!(match_pair, module)?)?;
    module.add_function(wrap_pyfunction!(transfer_values, module)?)?;
    transfer::register(module)?;
    poses::register(module)?;
    envelope::register(module)?;
    module.add_function(wrap_pyfunction!(memory_to_prepare, module)?)?;
    module.add_function(wrap_pyfunction!(memory_to_match, module)?)?;
    module.add_function(wrap_pyfunction!(memory_for_spectrum, module)?)?;
    module.add_function(wrap_pyfunction!(checked_size, module)?)?;
    module.add_function(wrap_pyfunction!(triangulate, module)?)?;
    module.add_function(wrap_pyfunction!(provoke_panic, module)?)?;
    Ok(())
}
