//! Welding, envelopes and what is seen from outside.

use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use sgmds_core::envelope::{self, Envelope, Offsets, Settings};
use sgmds_core::mesh::weld::{Welded, checked_faces};

use crate::triples;
use crate::watched::watched;

type Floats<'py> = Bound<'py, PyArray2<f64>>;
type Ids<'py> = Bound<'py, PyArray2<i64>>;
type Numbers<'py> = Bound<'py, PyArray1<i64>>;

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(weld, module)?)?;
    module.add_function(wrap_pyfunction!(visible, module)?)?;
    module.add_function(wrap_pyfunction!(make_envelope, module)?)
}

fn places(py: Python<'_>, rows: Vec<[f64; 3]>) -> PyResult<Floats<'_>> {
    let count = rows.len();
    rows.into_flattened().into_pyarray(py).reshape([count, 3])
}

fn corners(py: Python<'_>, rows: Vec<[u32; 3]>) -> PyResult<Ids<'_>> {
    let count = rows.len();
    let flat = rows.into_flattened().into_iter().map(i64::from);
    flat.collect::<Vec<_>>()
        .into_pyarray(py)
        .reshape([count, 3])
}

fn ids(py: Python<'_>, ids: Vec<u32>) -> Numbers<'_> {
    let wide: Vec<i64> = ids.into_iter().map(i64::from).collect();
    wide.into_pyarray(py)
}

/// Vertices and faces with vertices at one place made one, welded vertex of each given one, given face of each welded one.
#[pyfunction]
fn weld<'py>(
    py: Python<'py>,
    vertices: PyReadonlyArray2<'py, f64>,
    faces: PyReadonlyArray2<'py, i64>,
) -> PyResult<(Floats<'py>, Ids<'py>, Numbers<'py>, Numbers<'py>)> {
    let (vertices, faces) = (triples(&vertices)?, triples(&faces)?);
    let welded = watched(py, None, None, |_| {
        Welded::of(&vertices, &checked_faces(vertices.len(), &faces)?)
    })?;
    Ok((
        places(py, welded.vertices)?,
        corners(py, welded.faces)?,
        ids(py, welded.class),
        ids(py, welded.face),
    ))
}

/// Share of each face that is seen from outside.
#[pyfunction]
fn visible<'py>(
    py: Python<'py>,
    vertices: PyReadonlyArray2<'py, f64>,
    faces: PyReadonlyArray2<'py, i64>,
) -> PyResult<Bound<'py, PyArray1<f32>>> {
    let (vertices, faces) = (triples(&vertices)?, triples(&faces)?);
    let shares = watched(py, None, None, |_| {
        envelope::visible(&vertices, &checked_faces(vertices.len(), &faces)?)
    })?;
    Ok(shares.into_pyarray(py))
}

/// Closed surface around a figure: vertices, faces and figures. Offsets are triples of those of solids, of sheets and
/// between pieces, in units of the largest extent.
#[pyfunction]
#[pyo3(name = "envelope", signature = (vertices, faces, cells=None, offsets=None, threads=None))]
fn make_envelope<'py>(
    py: Python<'py>,
    vertices: PyReadonlyArray2<'py, f64>,
    faces: PyReadonlyArray2<'py, i64>,
    cells: Option<usize>,
    offsets: Option<Vec<(f64, f64, f64)>>,
    threads: Option<usize>,
) -> PyResult<(Floats<'py>, Ids<'py>, Bound<'py, PyDict>)> {
    let (vertices, faces) = (triples(&vertices)?, triples(&faces)?);
    let usual = Settings::default();
    let given = |(solid, sheet, blend)| Offsets {
        solid,
        sheet,
        blend,
    };
    let settings = Settings {
        cells: cells.unwrap_or(usual.cells),
        offsets: offsets.map_or(usual.offsets, |all| all.into_iter().map(given).collect()),
        ..usual
    };
    let made = watched(py, None, threads, |progress| {
        let faces = checked_faces(vertices.len(), &faces)?;
        let seen = envelope::visible(&vertices, &faces)?;
        Envelope::of(&vertices, &faces, &seen, &settings, progress)
    })?;
    let figures = PyDict::new(py);
    figures.set_item("handles", made.handles)?;
    figures.set_item("components", made.components)?;
    figures.set_item("kept_share", made.kept_share)?;
    figures.set_item("pieces", made.pieces)?;
    let Offsets {
        solid,
        sheet,
        blend,
    } = made.offsets;
    figures.set_item("offsets", (solid, sheet, blend))?;
    Ok((
        places(py, made.vertices)?,
        corners(py, made.faces)?,
        figures,
    ))
}
