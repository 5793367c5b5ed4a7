//! Numbers that steer this stage, each with its reason.

use crate::settings::settings;

settings! {
    /// Rims, where a surface was cut off.
    BOUNDARY: Boundary {
        /// Distance to a rim at which a vertex counts 1/e as much as on it.
        reach: f64 = 0.03,
    }

    /// How much a surface bulges around each vertex.
    CONVEXITY: Convexity {
        /// Radius within which a surface bulges or not, about that of a limb.
        reach: f64 = 0.08,
        /// Mean height over the tangent plane within the reach, by the reach, at which a vertex draws by half. A
        /// plane has 0, a crease more, a cylinder of radius r about −reach/8r: a trunk of radius 0.2 lies at the
        /// bound.
        flat: f64 = -0.05,
        /// Width of the change around it.
        flat_width: f64 = 0.02,
        /// Cosine of normals below which a surface near by is the other side of something thin.
        other_side: f64 = -0.2,
    }

    /// Pieces of a mesh that are copies of another's: the same triangles, moved, turned, scaled, posed by a rig,
    /// their vertices and triangles in another order.
    COPIES: Copies {
        /// Difference of lengths up to which edges are the same, over the extent: what coordinates in single
        /// precision are wrong by, tenfold.
        same: f64 = 1e-5,
        /// Relative difference of lengths up to which edges of a posed piece are alike.
        alike: f64 = 0.01,
        /// Share of the edges that are alike in a copy that is bent: a rig leaves most of a piece as it is, and
        /// pieces that merely have the same triangles, as bodies made from one base, have no such ratio in common.
        most: f64 = 0.5,
        /// Edges that may be unlike beside that share, so that a piece can begin at a joint.
        first: usize = 32,
        /// Fewest triangles of a piece that is told by them.
        fewest_faces: usize = 12,
        /// Triangles among which those are chosen that fewest others are similar to.
        drawn: usize = 50,
        /// How many of these are laid.
        seeds: usize = 4,
        /// Triangles that each is laid onto.
        tried: usize = 32,
        /// Ways to lay a piece from which the best is chosen, where none keeps all edges.
        ways: usize = 8,
        /// Share of the edges that are alike in a copy that another holds where its original does: a hand whose
        /// fingers are all bent keeps 0.3 of them.
        most_held: f64 = 0.25,
        /// Pieces nearer to one another than this may hold each other, over the extent: limbs of robots float a
        /// tenth of it apart.
        joint: f64 = 0.12,
        /// Contacts of a joint: the nearest ones lie about its centre, others are carried away from it.
        contacts: usize = 4,
        /// How much the distances across a joint change at most over the extent: by a right angle about a joint
        /// as thick as a limb.
        held: f64 = 0.05,
        /// By what factor they change more where another piece is laid.
        clearly: f64 = 2.0,
    }

    /// Positive cotangent weights of a surface's edges.
    EDGE_WEIGHTS: EdgeWeights {
        /// Least weight of an edge. Cotangents below zero would let an average of neighbours leave their range and a
        /// stretched edge pay off.
        least: f64 = 1e-2,
    }

    /// A checked triangle mesh: the clean part of what was given, at unit area.
    INTAKE: Intake {
        /// Fewest vertices of the largest part for which a spectrum says anything.
        fewest_vertices: usize = 32,
        /// A mesh has no surface when its area is below this fraction of the square of its reach: then the area is
        /// rounding. Of a hair a thousand times as long as thick it is 1e-3.
        least_surface: f64 = 1e-9,
        /// A face is a needle when its area is below this fraction of the square of its longest edge. A cotangent
        /// there can be as large as the inverse, which is what rounding in the eigensolver grows by.
        needle_relative_area: f64 = 1e-6,
    }

    /// Polygons cut into triangles as they lie in space.
    POLYGONS: Polygons {
        /// A corner is hollow when it turns back by more than this share of the polygon's largest turn: rounding
        /// stays below, and what is less hollow does not show.
        hollow: f64 = 1e-9,
        /// How often corners that were no ears are looked at again. A polygon that does not cross itself needs two or
        /// three.
        rounds: usize = 8,
        /// Corners that may be looked at for each corner of a polygon, on average, before the rest of it becomes a
        /// fan. A star of 20,000 hollow corners needs fewer than 100; one that crosses itself everywhere would need
        /// all of them.
        looks: usize = 20_000,
    }

    /// A coarse version of a fine mesh: few vertices, evenly spread, all of them given ones.
    SIMPLIFICATION: Simplification {
        /// Worst triangle a collapse may leave: quality (1 for equilateral) times the cosine by which its normal
        /// turns.
        least_quality: f64 = 0.1,
        /// A vertex whose faces' normals add up to a share of their areas counts as much as its area over this power
        /// of the share. Errors between `MakeHuman` bodies are 6 % smaller than without, 3 % with the second or
        /// fourth power.
        bending: i32 = 3,
        /// A smaller share counts as this one.
        least_share: f64 = 0.1,
        /// A vertex that cannot be removed waits until the others' stars have grown by this.
        patience: f32 = 1.5,
    }

    /// Stray vertices: one that a slip of the hand or a damaged file put far away from the surface that it belongs to.
    STRAYS: Strays {
        /// A vertex is far out when it is more than so many times as far from the middle as the farthest vertex of
        /// the rest: no limb, tail or lance of one vertex reaches so far, and at 3 the spike has a tenth of the area
        /// of a body of 1,500 vertices.
        gap: f64 = 3.0,
        /// Of so many vertices one may be far out.
        one_of: usize = 100,
        /// A spike is so many times as long as its foot is wide: a vertex that is far out over a wide foot is the tip
        /// of a cone.
        slender: f64 = 20.0,
    }

    /// Vertices at one place made one: what exporters split at texture seams, hard edges and materials is one surface again.
    WELD: Weld {
        /// Vertices nearer than this fraction of the diagonal of the bounding box are at one place. Copies that an
        /// exporter made of one vertex are equal to the last bit or to rounding in single precision, 6e-8 of their
        /// coordinates and a few times that after a node's transform; the closest distinct details of modelled
        /// characters are 1e-4 of their size.
        weld_tolerance: f64 = 1e-6,
        /// Where more than this share of the faces lie on another, a sheet was given twice; a pinched edge leaves two
        /// of ten thousand.
        doubled: f64 = 0.01,
        /// Points so many times the size of the rest away from it do not count for the size: a piece that was left a
        /// thousand body heights away would weld fingers, and no figure has a hundredth of its vertices so far out.
        far: f64 = 3.0,
    }
}
