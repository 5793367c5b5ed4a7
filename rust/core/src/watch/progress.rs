//! How far a computation has come, and whether it shall stop.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::error::{Error, Result};

/// Asked between pieces of work of at most about a tenth of a second at 50,000 vertices; an error,
/// which is [`Error::Cancelled`], ends the work.
pub type Check<'a> = &'a (dyn Fn() -> Result<()> + Sync);

/// Told of each stage as it begins, in order, by the computing thread: name and fraction of the whole.
pub type Follower = Box<dyn Fn(&'static str, f64) + Send + Sync>;

/// Shared between the computing threads and whoever watches them.
pub struct Progress {
    cancelled: AtomicBool,
    now: Mutex<(&'static str, f64)>,
    follower: Option<Follower>,
}

impl Default for Progress {
    fn default() -> Self {
        Self {
            cancelled: AtomicBool::new(false),
            now: Mutex::new(("start", 0.0)),
            follower: None,
        }
    }
}

impl Progress {
    /// One that tells `follower` of every stage. Who only wants to look from time to time needs none.
    #[must_use]
    pub fn followed_by(follower: Follower) -> Self {
        Self {
            follower: Some(follower),
            ..Self::default()
        }
    }

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
            let fraction = fraction.max(now.1);
            let is_new = now.0 != stage;
            *now = (stage, fraction);
            if is_new && let Some(follower) = &self.follower {
                follower(stage, fraction);
            }
        }
        self.check()
    }

    /// Stage and fraction of the whole, 0 to 1.
    #[must_use]
    pub fn now(&self) -> (&'static str, f64) {
        self.now.lock().map_or(("", 0.0), |now| *now)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;

    use super::*;

    #[test]
    fn a_follower_is_told_of_each_stage_once_and_never_of_less_than_was_done() {
        let (tell, told) = channel();
        let progress = Progress::followed_by(Box::new(move |stage, fraction| {
            tell.send((stage, fraction)).expect("somebody listens");
        }));
        for (stage, fraction) in [("a", 0.2), ("a", 0.3), ("b", 0.1), ("a", 0.5)] {
            progress.enter(stage, fraction).expect("nobody cancels");
        }
        let told: Vec<_> = told.try_iter().collect();
        assert_eq!(told, [("a", 0.2), ("b", 0.3), ("a", 0.5)]);
    }
}
