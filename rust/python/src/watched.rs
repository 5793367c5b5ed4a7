//! Runs the core off the interpreter: the lock released, progress told, cancellation heard.

use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Mutex, OnceLock};
use std::time::Duration;

use pyo3::prelude::*;
use sgmds_core::Error;
use sgmds_core::progress::Progress;

use crate::errors;

/// Time between two looks at a running computation.
const GLANCE: Duration = Duration::from_millis(40);

/// The process that may have started the common pool. A child forked from it has the pool, but none of its threads.
static POOL_OWNER: OnceLock<u32> = OnceLock::new();

/// Runs `work` on its own thread (with `threads` workers, or the process's pool) while this one
/// calls `progress(stage, fraction)` and handles signals. A callback that returns `False` or
/// raises, and Ctrl-C, stop the work at its next check.
pub fn watched<T: Send>(
    py: Python<'_>,
    progress: Option<&Bound<'_, PyAny>>,
    threads: Option<usize>,
    work: impl FnOnce(&Progress) -> Result<T, Error> + Send,
) -> PyResult<T> {
    if let Some(callback) = progress
        && !callback.is_callable()
    {
        let what = format!("`progress` should be callable, got {}", callback.repr()?);
        return Err(errors::to_python(py, &Error::BadArgument { what }));
    }
    let process = std::process::id();
    let is_forked = *POOL_OWNER.get_or_init(|| process) != process;
    // Zero stands for the usual number.
    let workers = threads.map_or(0, |count| count.max(1));
    let pool = (workers > 0 || is_forked)
        .then(|| rayon::ThreadPoolBuilder::new().num_threads(workers).build())
        .transpose()
        .map_err(|error| {
            let what = format!("the system starts no more threads ({error}): set `threads` lower");
            errors::to_python(py, &Error::BadArgument { what })
        })?;
    let state = Progress::default();
    let (done, wait) = channel::<()>();
    let wait = Mutex::new(wait);
    let still_running = || match wait.lock() {
        Ok(wait) => wait.recv_timeout(GLANCE) == Err(RecvTimeoutError::Timeout),
        Err(_) => false,
    };
    let mut interruption = None;
    let outcome = std::thread::scope(|scope| {
        let worker = scope.spawn(|| {
            // Dropped when the work ends in whatever way, which ends the waiting.
            let _done = done;
            match &pool {
                Some(pool) => pool.install(|| work(&state)),
                // Within the pool too: from outside every parallel step would wake it and wait.
                None => rayon::scope(|_| work(&state)),
            }
        });
        while py.detach(still_running) {
            if interruption.is_none()
                && let Err(error) = glance(py, progress, &state)
            {
                interruption = Some(error);
                state.cancel();
            }
        }
        py.detach(|| worker.join())
    });
    if let Some(error) = interruption {
        return Err(error);
    }
    match outcome {
        Ok(Ok(value)) => {
            // How far it came in the end.
            glance(py, progress, &state)?;
            Ok(value)
        }
        Ok(Err(error)) => Err(errors::to_python(py, &error)),
        Err(payload) => Err(errors::from_panic(py, state.now().0, payload.as_ref())),
    }
}

fn glance(py: Python<'_>, progress: Option<&Bound<'_, PyAny>>, state: &Progress) -> PyResult<()> {
    py.check_signals()?;
    let Some(callback) = progress else {
        return Ok(());
    };
    let (stage, fraction) = state.now();
    let answer = callback.call1((stage, fraction))?;
    // Python's truth values, or numpy's, whose name has changed.
    let is_bool = matches!(answer.get_type().name()?.to_str()?, "bool" | "bool_");
    if is_bool && !answer.is_truthy()? {
        return Err(errors::to_python(py, &Error::Cancelled));
    }
    Ok(())
}
