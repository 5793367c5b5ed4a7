//! How far a computation has come, and whether it shall stop.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::error::{Error, Result};

/// Asked between pieces of work of at most about a tenth of a second at 50,000 vertices; an error,
/// which is [`Error::Cancelled`], ends the work.
pub type Check<'a> = &'a (dyn Fn() -> Result<()> + Sync);

/// Shared between the computing threads and whoever watches them.
#[derive(Debug)]
pub struct Progress {
    cancelled: AtomicBool,
    now: Mutex<(&'static str, f64)>,
}

impl Default for Progress {
    fn default() -> Self {
        Self {
            cancelled: AtomicBool::new(false),
            now: Mutex::new(("start", 0.0)),
        }
    }
}

impl Progress {
    /// Asks the computation to stop at its next check.
    pub fn cancel(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }

    /// Whether somebody asked to stop.
    #[must_use]
    pub fn is_cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }

    /// # Errors
    /// [`Error::Cancelled`] when somebody asked to stop.
    pub fn check(&self) -> Result<()> {
        if self.is_cancelled() {
            Err(Error::Cancelled)
        } else {
            Ok(())
        }
    }

    /// Announces a stage and the fraction of the whole that lies behind it.
    ///
    /// # Errors
    /// [`Error::Cancelled`] when somebody asked to stop.
    pub fn enter(&self, stage: &'static str, fraction: f64) -> Result<()> {
        if let Ok(mut now) = self.now.lock() {
            // Two shapes are prepared at the same time: the bar never runs back.
            *now = (stage, fraction.max(now.1));
        }
        self.check()
    }

    /// Stage and fraction of the whole, 0 to 1.
    #[must_use]
    pub fn now(&self) -> (&'static str, f64) {
        self.now.lock().map_or(("", 0.0), |now| *now)
    }
}
