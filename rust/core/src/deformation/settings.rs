//! Numbers that steer this stage, each with its reason.

use crate::settings::settings;

settings! {
    /// A surface that is deformed by affine maps, one around each of some hundred nodes, that change little from node
    /// to node, or much between few.
    PIECEWISE_AFFINE: PiecewiseAffine {
        /// Weight μ of the changes between neighbouring nodes beside what draws the vertices, at unit area; half and
        /// twice as much change errors by up to a tenth, up on one pair and down on another.
        smoothness: f64 = 1e-4,
        /// ε: changes of less than this count by their squares. Between bodies of other build half of them are above.
        small_change: f64 = 0.03,
        /// Keeps the matrix regular where nothing draws.
        least_pull: f64 = 1e-10,
    }

    /// A surface that is drawn to given points and stays locally rigid.
    RIGID_SURFACE: RigidSurface {
        /// Weight μ of rigidity; of the points together it is that of the pull, at unit area.
        rigidity: f64 = 2e-3,
        /// Rounds of rotations and positions a call.
        rounds: usize = 3,
        /// Steps of a rotation at most.
        rotation_steps: usize = 30,
        /// Angle to which a rotation is found.
        rotation_accuracy: f64 = 1e-6,
        /// Newton's method doubles the digits: a step of less is the last.
        last_step: f64 = 1e-3,
    }
}
