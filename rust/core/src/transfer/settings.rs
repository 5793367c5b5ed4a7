//! Numbers that steer this stage, each with its reason.

use std::ops::RangeInclusive;

use crate::settings::settings;

settings! {
    /// Bones of a rig placed in the target: by the surface around their joints, or by other bones.
    BONES: Bones {
        /// Ends of bones nearer than this share of the rig's size are one joint: in single precision ends that were meant
        /// to meet are a hundredth of that apart.
        same_joint: f64 = 1e-5,
        /// Weight above which a vertex moves with a bone: painting leaves traces below it.
        least_weight: f64 = 0.01,
        /// Vertices that have to move with a bone for it to hold the surface: two tell no turn.
        fewest_vertices: usize = 3,
        /// How many times more or less a bone between two joints may grow than its surroundings: its keys and shapes grow
        /// with it.
        most_growth: f64 = 2.0,
        /// Cosine from which on two bones with one head run along each other: copies of one bone differ by rounding.
        parallel: f64 = 0.99999,
        /// Steps of the cosine in which bones with one head point alike; of those in one step the lengths decide.
        alike: f64 = 1e-3,
        /// Weight of the axes at a joint beside its place for how the whole body is turned, and which way it faces, as
        /// a share of the rig's size: joints along one line tell no turn about it.
        axes_count: f64 = 0.1,
        /// Rounds of weighted least squares until the sum of distances settles.
        reweighted: usize = 30,
        /// What stands near to a root, as a share of the rig's size: feet do, hands do not.
        surroundings: f64 = 0.05,
        /// A joint of bones without a side lies in the mirror if fitted nearer to it than this share of the rig's size: two
        /// fingers' width of a person.
        in_the_middle: f64 = 0.02,
    }

    /// Where the target lies on the source's surface, as pieces lie on the body that they were joined to.
    COINCIDENCE: Coincidence {
        /// One surface lies on the other up to this share of the target's size: roundings of files and of moving.
        on: f64 = 1e-4,
        /// It lies on it where so much of it does; the rest may be modelled anew.
        most: f64 = 0.5,
        /// A corner is looked up this share of the way to the middle of its triangle, on its side of a hard edge.
        into_face: f64 = 0.05,
        /// An image further from where the vertex lies than this share of the target's size is of another part.
        same_part: f64 = 0.2,
        /// Vertices, at least, by which the two surfaces are laid onto each other.
        probes: usize = 2000,
        /// Rounds of it: the first find the place, and each of the last squares what is left.
        rounds: usize = 15,
        /// Largest growth in one round, as a share: the planes are near only then.
        largest_growth: f64 = 0.5,
        /// What a motion costs that no plane tells, for 1 of what is seen of it: a sheet does not slide along itself.
        ridge: f64 = 1e-9,
    }

    /// What touches in a shape key of the source touches on the target.
    CONTACTS: Contacts {
        /// Share of a gap that is left at most where points meet: lids of a blink are modelled with up to a fifth
        /// between vertices.
        meets: f64 = 0.25,
        /// Least gap in lengths of the longest displacement: what is nearer has no gap that the key closes.
        least_gap: f64 = 0.2,
        /// Least cosine between the gap and the normals at both of its ends: what does not face each other passes by.
        /// Keys of a jaw let walls of the mouth pass each other at up to 0.2.
        facing: f64 = 0.3,
        /// How much farther than on the source a gap may be closed, in gaps: lids lie over one another unseen, and
        /// where bodies were modelled with one key for all they do so by up to a fifth.
        overlap: f64 = 0.25,
        /// Farthest that the image of w may lie from y, in gaps: the target has no such point there.
        beside: f64 = 0.5,
        /// How far from a contact its correction ends, in gaps: as far as a lid is wide.
        reach: f64 = 1.0,
        /// ℓ in mean edges around the contacts.
        averaged_over: f64 = 0.5,
    }

    /// Data of face corners: every target face takes its values from one side of a border.
    CORNERS: Corners {
        /// The surroundings of a face reach this much beyond the furthest of its corners' images, so that a face
        /// whose centre lies across a border from most of it still finds its way.
        reach: f64 = 1.5,
        /// Most triangles looked at around a face: beyond this the map is torn there, and looking further brings no
        /// better side.
        most_triangles: usize = 4096,
        /// Two places belong to one side of a border that ends nearby when the values of each foretell those of the
        /// other, with an error of at most this share of their distance. Across a border the error is far larger; on
        /// a half turn without one it is 0.36.
        largest_miss: f64 = 0.5,
        /// Area over squared longest edge below which a triangle's plane says nothing.
        sliver: f64 = 1e-3,
    }

    /// Data of edges: marks (seams, sharp edges, creases) as curves, all else from the nearest edge.
    CURVES: Curves {
        /// Cost of a unit of way that lies on the curve itself, beside 1 for a unit one edge length away: enough to
        /// keep a way from wandering along the curve.
        length_cost: f64 = 1e-3,
        /// Lengths of edges in which distances from the curve are counted, in mean lengths: those of a short edge in
        /// its own, so that it is no way across the end of a narrow face.
        counted_lengths: RangeInclusive<f64> = 0.05..=1.0,
        /// Longest piece of a curve followed at once, in edges.
        longest_piece: usize = 128,
        /// Pieces into which a closed curve is cut at least, so that ends differ.
        loop_pieces: usize = 3,
        /// Cosine of the widest angle between edges that run alike: in a grid, those along and not across. Just below
        /// that of 45°, so that a diagonal runs like both.
        alike: f64 = 0.7,
    }

    /// Shape keys: displacements of the source's vertices carried in local frames.
    DISPLACEMENT: Displacement {
        /// Displacements shorter than this share of the source's diagonal are rounding: such vertices stand still.
        stillness: f64 = 1e-6,
    }

    /// How a map turns and scales the surroundings of each vertex.
    FRAMES: Frames {
        /// Length over which a frame is averaged, in roots of the target's area, as of a thumb on a body: images of
        /// neighbouring vertices are a fraction of an edge wrong and directions between them much more so, and what
        /// is smaller than this, such as a lid, may lie differently on another face without being turned. Faces move
        /// 2 to 4 % wrong by turns of half as much or up to four times as much, and 10 to 15 % by those of two edges.
        averaged_over: f64 = 0.015,
        /// Weight of the normals beside the edges in a frame's fit.
        normal_share: f64 = 0.5,
        /// A scale further than this from that of the whole map is a fault of the map, not of the bodies.
        largest_scale: f64 = 4.0,
    }

    /// Joints of a rig placed in the target, each by the surface around it.
    JOINTS: Joints {
        /// Width of the surroundings of a joint, over its distance from the surface: the ring around a limb counts
        /// fully, a place as far again along the limb a seventh.
        ring_width: f64 = 0.75,
        /// The surroundings are widened until they count as this many vertices.
        fewest_vertices: f64 = 12.0,
        /// Rounds of widening.
        widenings: usize = 8,
        /// Vertices without any confidence still say where the body is.
        least_confidence: f64 = 1e-3,
    }

    /// Data of whole faces: labels by the majority, numbers by the mean, of places within the face.
    LABELS: Labels {
        /// How far from the centre of a face towards its corners it is asked what lies under it.
        shares: [f64; 2] = [0.45, 0.85],
    }

    /// Poses of a rig taken to the rig that was fitted to another body.
    POSES: Poses {
        /// Bodies whose axes differ by less than this, in degrees, from whole quarter turns face alike: rigs fitted to
        /// bodies in other poses lean to each other by a few degrees, and who turns a body on purpose turns it further.
        quarters: f64 = 12.0,
    }

    /// UV maps: carried to the target's corners, joined where the target's faces agree, and judged.
    LAYOUT: Layout {
        /// UV differences up to this are rounding.
        uv_rounding: f64 = 1e-5,
        /// Two faces agree at an edge when their UVs differ by at most this share of the edge's UV length: each has
        /// found its own place for a corner beyond a seam.
        agreement: f64 = 0.25,
        /// Texels a unit of the grid on which overlaps are counted.
        overlap_grid: f64 = 1024.0,
        /// For how many units of UV texels may be kept or looked at: where a layout goes further or lies over itself
        /// more often than that, a coarser grid shows it as well.
        overlap_units: f64 = 16.0,
        /// A triangle squeezed further than this counts as this much, so that one without any UV area does not hide
        /// the others.
        smallest_stretch: f64 = 1e-2,
    }

    /// What is known of two bodies and the map between them before any garment is seen.
    BODIES: Bodies {
        /// Height of a standing person for 1 of the square root of the skin's area: between 1.22 and 1.36 for six
        /// bodies of `MakeHuman`, children and a cartoon's proportions among them. Neither pose nor rotation changes
        /// it.
        height: f64 = 1.3,
    }

    /// Which bone of one rig moves what a bone of another moves.
    BONE_MAP: BoneMap {
        /// Bones of which less than this is shared are no partners: it is what neighbours in a chain share at least
        /// when both rigs divide a limb alike.
        least_share: f64 = 0.1,
    }

    /// Cloth out of the body and layers in their order: what is short of its distance is moved, and the cloth around
    /// it goes with it.
    COLLISION: Collision {
        /// Rings of edges around a fold that go back to their shape with it.
        rings: usize = 1,
    }

    /// A garment as a graph: vertices at one place are one, pieces are what edges connect.
    GARMENT: Garment {
        /// Cosine between the normals of neighbouring triangles below which they are folded onto one another.
        folded: f64 = -0.2,
    }

    /// Where a map is unsure, the rigs of both bodies tell: a head many times as large is still where the head's bone is.
    GUIDANCE: Guidance {
        /// Share of the skin that a bone has to hold, with what hangs on it, to tell where anything is: hands and
        /// feet do, fingers and eyelids follow the bone that they hang on.
        least_held: f64 = 0.02,
        /// How much a vertex follows the rigs for 1 of doubt: all the way where its confidence is a half or less. On
        /// a cartoon's head, of confidence 0.2 to 0.4, images are 3.4 and 1.2 % of the height off without, 1.8 and
        /// 0.8 with 1, 1.4 and 0.6 with 2; where bodies are alike nothing changes.
        by_doubt: f64 = 2.0,
        /// Power of the confidence by which a vertex tells how the whole body is turned.
        sure: i32 = 4,
        /// Length over which ways are averaged, in roots of the target's area: two hundredths of a person's height.
        averaged_over: f64 = 0.04,
        /// Shortest way that is gone, for 1 of the source's size: below it a vertex stays exactly where it was.
        still: f64 = 1e-6,
    }

    /// Skin that nobody sees: vertices of the target under a garment, away from its rims.
    HIDDEN: Hidden {
        /// Cosine between the way out of the skin and the way to the cloth from which cloth is over the skin and not
        /// beside it.
        over: f64 = 0.5,
    }

    /// The shape of the cloth: places that keep the offsets along edges, near to where each would go for itself.
    SHAPE: Shape {
        /// Rings of edges around a fold that are let go with it: a fold is as wide as a triangle, and has two sides.
        rings: usize = 2,
    }

    /// Pieces that keep their shape: buttons, buckles, glasses and hats are turned, scaled and moved as a whole.
    STIFF: Stiff {
        /// Moves of a piece out of the body, each by what its deepest place needs: where skin bends around it one is
        /// not enough.
        moves: usize = 4,
    }

    /// Pieces that were not matched as a whole (eyes, teeth, a tongue, lids, buttons) on their counterparts.
    COUNTERPARTS: Counterparts {
        /// A piece of a figure is held where more than this share of its vertices lies on one piece: from 0.5 on lids, eyes
        /// and mouths that take part in an envelope go to their own, from 0.7 on brows too, of which 0.65 lie on the head.
        held: f64 = 0.7,
        /// Root mean square radius, in roots of the target's area, up to which a piece that is held by none goes to its
        /// counterpart as a whole: a head (0.07), a coat or hair is scattered because the other figure is made of other
        /// pieces. Eyes, lids, brows and mouths have at most 0.02 of a person and 0.055 of a head by itself.
        small: f64 = 0.06,
        /// Centres of counterparts, brought together by the body around, are at most this many radii apart.
        largest_offset: f64 = 1.5,
        /// Nor may one be this much larger than the other.
        largest_ratio: f64 = 2.5,
        /// κ, what a difference of shape counts beside the distance of the centres, both in radii: of 648 eyes, lashes,
        /// teeth and tongues of nine people, the body around 6 mm off, 1 goes wrong; 1 times as much leaves 11, none 105.
        shape: f64 = 3.0,
        /// Most that a counterpart costs. Right ones of those people cost 1.1 in 99 of 100, the best of the wrong ones 0.6.
        largest_cost: f64 = 1.2,
        /// Share of the square of its size that a piece has at least across, where it is stretched to the proportions of
        /// its counterpart: a strip of lashes is not stretched across by how its ends bend.
        thin: f64 = 0.01,
        /// Trust in the image of a piece that was put onto its counterpart.
        confidence: f64 = 0.5,
    }

    /// Where the source's seams run over the target's faces, as cuts from edge to edge.
    SEAM_CUTS: SeamCuts {
        /// A vertex from which a seam is nearer than this share of an edge is put onto it, so that no slivers arise.
        snap: f64 = 0.05,
    }

    /// Vertex groups: sparse weights carried, filled, smoothed, limited and normalised.
    SKIN_WEIGHTS: SkinWeights {
        /// Weights below this are dropped while smoothing, so that rows stay short.
        negligible: f64 = 1e-7,
        /// A carried sum this near to 1 is 1: the source's weights were normalised, in single precision.
        sum_rounding: f64 = 1e-3,
    }

    /// Textures of the source baked into the target's own UV layout, texel by texel.
    TEXTURE: Texture {
        /// Most samples along each side of a texel where the source's texels are smaller.
        most_samples: usize = 4,
        /// Alpha below which colours are mixed as if opaque: there is nothing to see.
        transparent: f32 = 1e-6,
    }

    /// The straight way between two points of a surface, and the borders that it crosses.
    TRACE: Trace {
        /// Most triangles on a way: a longer one is lost.
        most_steps: usize = 4096,
        /// The start is moved by this share towards the middle of its triangle, off edges and vertices.
        inset: f64 = 1e-7,
        /// A way that has gone this many times its length without arriving is on another sheet.
        lost: f64 = 2.0,
    }
}
