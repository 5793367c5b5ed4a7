//! The costliest kernels by themselves, for benches beside peers.

use faer::Mat;
use numpy::{PyArray2, PyReadonlyArray2};
use pyo3::prelude::*;
use sgmds_core::geodesics::{FastMarching, distances_from};
use sgmds_core::mesh::Mesh;
use sgmds_core::spectrum::eigenbasis::{Eigenbasis, bare_solves, factorise};
use sgmds_core::spectrum::laplacian::Laplacian;

use crate::matrix;
use crate::triples;
use crate::watched::watched;

/// Operator and geodesics of one mesh, whose vertices must all be used.
#[pyclass(frozen, module = "sgmds._core")]
pub struct Kernels {
    laplacian: Laplacian,
    marching: FastMarching,
    /// Given mesh's length of one unit of the core.
    unit: f64,
}

#[pymethods]
impl Kernels {
    #[new]
    fn new(
        py: Python<'_>,
        vertices: PyReadonlyArray2<'_, f64>,
        faces: PyReadonlyArray2<'_, i64>,
    ) -> PyResult<Self> {
        let (vertices, faces) = (triples(&vertices)?, triples(&faces)?);
        watched(py, None, None, |_| {
            let mesh = Mesh::new(&vertices, &faces)?;
            Ok(Self {
                laplacian: Laplacian::new(&mesh)?,
                marching: FastMarching::new(&mesh),
                unit: mesh.scale,
            })
        })
    }

    /// Computes the `count` smallest eigenpairs: (largest residual over the largest eigenvalue,
    /// linear systems solved).
    fn eigenpairs(&self, py: Python<'_>, count: usize) -> PyResult<(f64, usize)> {
        watched(py, None, None, |progress| {
            let basis = Eigenbasis::new(&self.laplacian, count, &|| progress.is_cancelled())?;
            let largest = basis.values[count - 1];
            Ok((basis.residual / largest, basis.solves))
        })
    }

    /// Factorises once.
    fn factorise(&self, py: Python<'_>) -> PyResult<()> {
        watched(py, None, None, |_| factorise(&self.laplacian))
    }

    /// Factorises and solves so many linear systems, nothing else.
    fn bare_solves(&self, py: Python<'_>, count: usize) -> PyResult<()> {
        watched(py, None, None, |_| bare_solves(&self.laplacian, count))
    }

    /// Geodesic distances from each source to every vertex, `(n, s)`, in given units.
    fn distances<'py>(
        &self,
        py: Python<'py>,
        sources: Vec<u32>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let found = watched(py, None, None, |progress| {
            distances_from(&self.marching, &sources, &|| progress.is_cancelled())
        })?;
        let wide = Mat::from_fn(found.nrows(), found.ncols(), |i, j| {
            self.unit * f64::from(found[(i, j)])
        });
        matrix(py, wide.as_ref())
    }
}
