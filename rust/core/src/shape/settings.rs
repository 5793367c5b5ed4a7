//! Numbers that steer this stage, each with its reason.

use crate::settings::settings;

settings! {
    /// What a point looks like on its own surface: wave kernel signature and mean curvature.
    DESCRIPTORS: Descriptors {
        /// Width of each energy band in steps between energies.
        wave_band_steps: f64 = 7.0,
        /// Eigenpairs that the wave kernel uses.
        wave_pairs: usize = 100,
        /// Added inside the logarithm, relative to the mean.
        wave_floor: f64 = 1e-3,
        /// Mean curvature at unit area is clipped here: a radius of 1/50 of √area is a sharp spike.
        curvature_limit: f64 = 50.0,
        /// Heat time that smooths the curvature column; unit area.
        curvature_heat_time: f64 = 3e-3,
        /// Of how many of them is told what distances cannot: a limb's and a chest's change with poses and builds,
        /// and prefer bodies that are turned front to back.
        extrinsic_curvatures: usize = 3,
        /// Weight of √t h in the refinement. From 0.1 to 0.25 errors change little; 0.8 doubles them.
        detail_curvature_weight: f64 = 0.15,
        /// Weight of the wave kernel in the refinement; more helps one body in many poses and harms others.
        detail_wave_weight: f64 = 0.03,
        /// Neighbouring energies say nearly the same: every so many of them are used.
        detail_wave_step: usize = 6,
        /// The same of the energies that curvatures are explained by.
        explaining_wave_step: usize = 3,
        /// Ridge of that, relative to the mean variance of a wave kernel value.
        explaining_ridge: f64 = 1e-6,
    }

    /// Tells the direct map from the mirrored one.
    GRADIENTS: Gradients {
        /// Eigenfunctions whose gradients are used at most, between whole shapes.
        functions: usize = 40,
    }

    /// A surface prepared for matching: everything that depends on one shape only.
    SHAPE: Shape {
        /// Eigenpairs of a prepared shape; more bring nothing to a map.
        eigenpairs: usize = 150,
        /// Farthest-point samples.
        samples: usize = 500,
        /// Samples from which distances are marched: twice the operator's size.
        marched: usize = 120,
        /// Fewer leave no distance operator, which is two thirds of their size.
        least_marched: usize = 3,
        /// Size of the distance operator.
        operator_size: usize = 60,
        /// Samples on which maps are judged.
        judged: usize = 300,
        /// Meshes with more vertices than this are simplified to so many before anything else is done.
        simplified_above: usize = 9_000,
        /// Vertices of a simplified mesh.
        simplified: usize = 7_000,
        /// Meshes with fewer vertices than this are cut finer before anything else is done.
        refined_below: usize = 2_000,
        /// Vertices of a mesh that was cut finer, at most.
        refined: usize = 3_000,
        /// Vertices of such a mesh for each given one, at most.
        refined_times: usize = 4,
        /// Eigenfunctions of the paper's map at most.
        paper_size: usize = 30,
        /// Nodes of maps that are affine on each part, some ten on a limb; with 200 and 500 errors change by up to 7
        /// %.
        nodes: usize = 300,
        /// Vertices for each eigenpair at least: beyond, eigenfunctions show the mesh, not the surface.
        vertices_a_pair: usize = 3,
    }

    /// Small parts of a surface that stick out, as fingers, toes, ears and horns do.
    PROTRUSIONS: Protrusions {
        /// How far a peak rises above where it meets another, at unit area: middle fingers are 0.07 to 0.09 long.
        /// With half of it toes are found too, and fingers are as right.
        least_height: f32 = 0.02,
        /// Area of a protrusion at most: fingers have 0.001 to 0.004, a hand all in all 0.02.
        largest: f64 = 0.02,
    }
}
