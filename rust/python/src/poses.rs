//! Binding of `sgmds_core::transfer::poses`; `sgmds.poses` wraps it and checks shapes and types.

use numpy::{PyArray2, PyArray3, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::prelude::*;
use sgmds_core::transfer::frame;
use sgmds_core::transfer::poses::{self, Rests};

use crate::errors;
use crate::transfer::{corners_of, matrices, table};
use crate::triples;

type Array2<'py> = Bound<'py, PyArray2<f64>>;
type Array3<'py> = Bound<'py, PyArray3<f64>>;
type Matrix = [[f64; 3]; 3];

/// The similarity (4, 4) that brings points (n, 3) nearest to aims (n, 3), with weights (n,).
#[pyfunction]
fn similarity<'py>(
    py: Python<'py>,
    points: PyReadonlyArray2<'py, f64>,
    aims: PyReadonlyArray2<'py, f64>,
    weights: Option<Vec<f64>>,
) -> PyResult<Array2<'py>> {
    let (points, aims) = (triples(&points)?, triples(&aims)?);
    let found = poses::similarity(&points, &aims, weights.as_deref());
    let found = found.map_err(|e| errors::to_python(py, &e))?;
    table(py, found.rows().to_vec())
}

/// The turn (3, 3) and the stretch (3, 3) of a matrix.
#[pyfunction]
fn polar(py: Python<'_>, matrix: Matrix) -> PyResult<(Array2<'_>, Array2<'_>)> {
    let (turn, stretch) = frame::polar(&matrix);
    Ok((table(py, turn.to_vec())?, table(py, stretch.to_vec())?))
}

/// What turns one rig, heads (n, 3) and axes (n, 3, 3), to another, (3, 3).
#[pyfunction]
fn facing<'py>(
    py: Python<'py>,
    source: (PyReadonlyArray2<'py, f64>, PyReadonlyArray3<'py, f64>),
    target: (PyReadonlyArray2<'py, f64>, PyReadonlyArray3<'py, f64>),
    mirrors: bool,
    spaces: [Matrix; 2],
) -> PyResult<Array2<'py>> {
    let (heads_1, axes_1) = (triples(&source.0)?, corners_of(&source.1)?);
    let (heads_2, axes_2) = (triples(&target.0)?, corners_of(&target.1)?);
    let found = poses::facing((&heads_1, &axes_1), (&heads_2, &axes_2), mirrors, &spaces);
    let found = found.map_err(|e| errors::to_python(py, &e))?;
    table(py, found.to_vec())
}

/// The one of axes (n, 3), or their opposites, next to a direction, or that itself.
#[pyfunction]
fn nearest_axis(direction: [f64; 3], axes: PyReadonlyArray2<'_, f64>) -> PyResult<[f64; 3]> {
    Ok(poses::nearest_axis(direction, &triples(&axes)?))
}

/// `L` and `N` of each bone, (n, 3, 3) each.
///
/// Axes of the bones of source and target (n, 3, 3), what takes the first to the second, parents, limbs of each (n, 3),
/// and which bones are fitted, with the turns (n, 3, 3) that the others keep.
#[pyfunction]
fn fitted_turns<'py>(
    py: Python<'py>,
    axes: [PyReadonlyArray3<'py, f64>; 2],
    facing: Matrix,
    parents: Vec<i64>,
    limbs: [PyReadonlyArray2<'py, f64>; 2],
    fitted: Vec<bool>,
    kept: PyReadonlyArray3<'py, f64>,
) -> PyResult<(Array3<'py>, Array3<'py>)> {
    let [source, target] = [corners_of(&axes[0])?, corners_of(&axes[1])?];
    let limbs = triples(&limbs[0])?.into_iter().zip(triples(&limbs[1])?);
    let kept = corners_of(&kept)?.into_iter().zip(fitted);
    let rests = Rests {
        parents: &parents,
        source: &source,
        target: &target,
        limbs: &limbs.map(<[_; 2]>::from).collect::<Vec<_>>(),
        kept: &kept
            .map(|(turn, fitted)| (!fitted).then_some(turn))
            .collect::<Vec<_>>(),
    };
    let found = poses::fitted_turns(&rests, &facing).map_err(|e| errors::to_python(py, &e))?;
    Ok((
        matrices(py, found.left.into_iter())?,
        matrices(py, found.right.into_iter())?,
    ))
}

/// Heads (n, 3) of a rig in a pose.
#[pyfunction]
fn posed_heads<'py>(
    py: Python<'py>,
    heads: PyReadonlyArray2<'py, f64>,
    axes: PyReadonlyArray3<'py, f64>,
    parents: Vec<i64>,
    loose: Vec<bool>,
    turns: PyReadonlyArray3<'py, f64>,
) -> PyResult<Array2<'py>> {
    let (axes, turns) = (corners_of(&axes)?, corners_of(&turns)?);
    let found = poses::posed_heads(&triples(&heads)?, &axes, &parents, &loose, &turns);
    table(py, found.map_err(|e| errors::to_python(py, &e))?)
}

/// Adds what is here to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(similarity, module)?)?;
    module.add_function(wrap_pyfunction!(polar, module)?)?;
    module.add_function(wrap_pyfunction!(facing, module)?)?;
    module.add_function(wrap_pyfunction!(nearest_axis, module)?)?;
    module.add_function(wrap_pyfunction!(fitted_turns, module)?)?;
    module.add_function(wrap_pyfunction!(posed_heads, module)?)?;
    Ok(())
}
