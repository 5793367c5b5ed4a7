//! Runs the core off the interpreter: the lock released, progress told, cancellation heard.

use std::sync::OnceLock;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::time::Duration;

use pyo3::prelude::*;
use sgmds_core::Error;
use sgmds_core::watch::progress::Progress;

use crate::errors;

/// Longest time between two looks at a running computation.
const GLANCE: Duration = Duration::from_millis(40);

/// The process that may have started the common pool. A child forked from it has the pool, but none of its threads.
static POOL_OWNER: OnceLock<u32> = OnceLock::new();

/// What the working thread tells the waiting one.
enum News {
    Stage(&'static str, f64),
    End,
}

/// Tells of the end when it is dropped, in whatever way the work ends.
struct Ending(Sender<News>);

impl Drop for Ending {
    fn drop(&mut self) {
        // Nobody waits any more when the waiting thread panicked.
        let _ = self.0.send(News::End);
    }
}

/// Runs `work` on its own thread (with `threads` workers, or the process's pool) while this one
/// calls `progress(stage, fraction)`, for every stage and from time to time, and handles signals.
/// A callback that returns `False` or raises, and Ctrl-C, stop the work at its next check.
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
    let (tell, news) = channel();
    let state = match progress {
        Some(_) => {
            let tell = tell.clone();
            Progress::followed_by(Box::new(move |stage, fraction| {
                let _ = tell.send(News::Stage(stage, fraction));
            }))
        }
        None => Progress::default(),
    };
    let mut next = move || news.recv_timeout(GLANCE);
    let mut interruption = None;
    let outcome = std::thread::scope(|scope| {
        let ending = Ending(tell);
        let worker = scope.spawn(|| {
            let _ending = ending;
            match &pool {
                Some(pool) => pool.install(|| work(&state)),
                // Within the pool too: from outside every parallel step would wake it and wait.
                None => rayon::scope(|_| work(&state)),
            }
        });
        loop {
            let (stage, fraction) = match py.detach(&mut next) {
                Ok(News::Stage(stage, fraction)) => (stage, fraction),
                Err(RecvTimeoutError::Timeout) => state.now(),
                Ok(News::End) | Err(RecvTimeoutError::Disconnected) => break,
            };
            if interruption.is_none()
                && let Err(error) = glance(py, progress, stage, fraction)
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
            let (stage, fraction) = state.now();
            glance(py, progress, stage, fraction)?;
            Ok(value)
        }
        Ok(Err(error)) => Err(errors::to_python(py, &error)),
        Err(payload) => Err(errors::from_panic(py, state.now().0, payload.as_ref())),
    }
}

fn glance(
    py: Python<'_>,
    progress: Option<&Bound<'_, PyAny>>,
    stage: &str,
    fraction: f64,
) -> PyResult<()> {
    py.check_signals()?;
    let Some(callback) = progress else {
        return Ok(());
    };
    let answer = callback.call1((stage, fraction))?;
    // Python's truth values, or numpy's, whose name has changed.
    let is_bool = matches!(answer.get_type().name()?.to_str()?, "bool" | "bool_");
    if is_bool && !answer.is_truthy()? {
        return Err(errors::to_python(py, &Error::Cancelled));
    }
    Ok(())
}
