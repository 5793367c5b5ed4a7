//! Numbers that steer this stage, each with its reason.

use crate::settings::settings;

settings! {
    /// The last stage, on the given meshes: the target's surface is laid onto the source's down to its finest edges.
    DETAIL: Detail {
        /// Larger meshes keep what the working meshes say.
        most_vertices: usize = 60_000,
        /// Length over which the first displacements are averaged, at unit area: what maps are off on working meshes.
        /// Lids come to lie as well from 0.015 on, and a tenth worse from 0.03 on.
        coarsest: f64 = 0.02,
        /// The last length of averaging in edges of the finest parts.
        finest: f64 = 0.7,
        /// Share of the vertices that are the finest parts.
        fine_part: f64 = 0.1,
        /// Least length of averaging of a vertex in its own edges: what is coarser moves with what is around it.
        own_edges: f64 = 0.5,
        /// Lengths of averaging, in equal ratios from the coarsest to the finest.
        stages: usize = 5,
        /// Steps at each.
        steps: usize = 2,
        /// Steps at the last.
        last_steps: usize = 4,
        /// How far vertices move along the displacements of a step, which lag behind: where feet slide along with the
        /// vertices, half as far again comes as near in 12 steps as once as far in 17.
        stride: f64 = 1.5,
        /// ρ, the distance that a turn of normals by one radian counts, at the coarsest.
        coarsest_turn: f64 = 0.015,
        /// The same at the finest, in lengths of averaging.
        finest_turn: f64 = 2.0,
        /// How strongly vertices are drawn across the normal, relative to along it.
        across: f64 = 0.1,
        /// Keeps the equations regular where nothing draws.
        least_draw: f64 = 1e-6,
        /// How strongly vertices whose points are given are drawn to them, relative to all others.
        given: f64 = 1e4,
    }

    /// Creases draw creases across the normal. Lengths are in the finest lengths of averaging.
    CREASES: Creases {
        /// Curvature of a crease, radians a length: of a radius of 5 mm on a person's face of 2 mm edges. With half as
        /// much again lids close by 0.95 instead of 0.98.
        bend: f64 = 0.28,
        /// Radius at unit area from which on what bends is no crease: half of `DETAIL.coarsest`, 13 mm on a person. Limbs of
        /// meshes of 2,500 vertices, 4 edges around, are drawn to wherever a vertex lies, a third of an edge off, from
        /// 0.02 on a little; faces are the same from 0.006 on.
        broadest: f64 = 0.01,
        /// From how far a crease draws, once displacements are averaged over less than that.
        reach: f64 = 3.0,
        /// How strongly, relative to the surface along its normal: twice as strongly lids close by 0.96.
        drawn: f64 = 1.0,
    }

    /// The surface laid through its images, as similar to itself around each vertex as they allow.
    SIMILAR: Similar {
        /// √μ, the length over which images are averaged at unit area: two edges of a working mesh.
        averaged_over: f64 = 0.015,
        /// Distance of an image from the surface from which it counts less: an edge of a working mesh.
        far: f64 = 0.007,
        /// Least weight of an image.
        least_weight: f64 = 0.05,
        /// Rounds of turns, weights and positions.
        rounds: usize = 5,
    }
}
