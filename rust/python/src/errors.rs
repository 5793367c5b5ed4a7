//! Core errors as the exceptions of `sgmds.errors`, with the same words.

use pyo3::prelude::*;
use sgmds_core::Error;

/// The exception for a core error.
pub fn to_python(py: Python<'_>, error: &Error) -> PyErr {
    raise(py, class(error), error.to_string())
}

/// The exception for a core error about one of two shapes, which names it first.
pub fn about(py: Python<'_>, role: &str, error: &Error) -> PyErr {
    raise(py, class(error), format!("{role}: {error}"))
}

fn class(error: &Error) -> &'static str {
    match error {
        Error::Cancelled => "Cancelled",
        Error::EmptyMesh { .. }
        | Error::NotFinite { .. }
        | Error::FaceIndexOutOfRange { .. }
        | Error::TooFewVertices { .. } => "MeshError",
        Error::BadArgument { .. } => "ArgumentError",
        Error::NotFactorised { .. } | Error::NotConverged { .. } | Error::NoMap { .. } => {
            "MatchError"
        }
    }
}

/// The exception for a panic, which names the stage.
pub fn from_panic(py: Python<'_>, stage: &str, payload: &(dyn std::any::Any + Send)) -> PyErr {
    let what = payload
        .downcast_ref::<String>()
        .map(String::as_str)
        .or_else(|| payload.downcast_ref::<&str>().copied())
        .unwrap_or("no message");
    raise(
        py,
        "InternalError",
        format!("internal error during {stage}: {what}; please report it with the mesh"),
    )
}

fn raise(py: Python<'_>, class: &str, message: String) -> PyErr {
    let made = py
        .import("sgmds.errors")
        .and_then(|module| module.getattr(class))
        .and_then(|class| class.call1((message,)));
    match made {
        Ok(exception) => PyErr::from_value(exception),
        Err(error) => error,
    }
}
