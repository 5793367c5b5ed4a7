//! Numbers that steer this stage, each with its reason.

use crate::settings::settings;

settings! {
    /// The automatic method: which of the maps found is completed, and which are kept beside it.
    CHOICE: Choice {
        /// A map between a part and a whole is taken when its rank, without what it contradicts, is below this times
        /// that of the map between wholes: right ones reach 0.21 to 0.77; where the map between wholes is the better
        /// one they stay above 0.81, or leave over what begins elsewhere than at a rim.
        part_fits_better: f64 = 0.8,
        /// The same where given lengths say that it is a part and the map between wholes is doubtful: one that wraps
        /// a cut cat into a whole one reaches the rank of the right part.
        known_part_fits_better: f64 = 1.1,
        /// Misfit up to which a part lies on the whole where it was located.
        fits: f64 = 0.1,
        /// It does so clearly where this is so many times that of any other place.
        clearly_fits: f64 = 0.9,
        /// Close hypotheses completed at most.
        most_completed: usize = 3,
        /// Symmetries found on both shapes are the same when the best map that respects them has at most this times
        /// the rank of the best one that does not, each without what it contradicts: right ones stay below 1.1; from
        /// 1.36 on they bring nothing, or one of them was mistaken.
        same_symmetry: f64 = 1.35,
        /// Two images of a vertex that are farther apart than this are different.
        elsewhere: f64 = 0.05,
        /// Close maps that differ on at most this share of the target are compared on that part.
        part_at_most: f64 = 0.5,
    }

    /// A hypothesis with its final refinement.
    COMPLETED: Completed {
        /// Neighbours whose images are so much farther apart have been torn from one another: right maps of whole
        /// bodies leave at most 0.11, where limbs have grown together it is 0.1 to 0.6.
        torn_apart: f64 = 0.15,
    }

    /// Heights by which upright figures of other proportions are alike: where their legs join, and the neck.
    LEVELS: Levels {
        /// A leg begins below this share of the height: heels, and feet of one who walks.
        ground: f64 = 0.15,
        /// It is at least so long, by the height: those of short-legged game figures are.
        leg: f64 = 0.08,
        /// A head is at least so much wider than the neck, on each side, by the height: a person's by 0.02.
        head: f64 = 0.012,
        /// It is widest at least so much above the neck: a thigh joins the waist from below.
        above: f64 = 0.01,
        /// Heights of what was found from both sides differ by less.
        even: f64 = 0.05,
        /// Figures are unlike where legs or necks differ by more: those of 16 people of five packs differ by at most 0.08.
        unlike: f64 = 0.1,
    }

    /// The map between two figures that stand alike: upright and at rest, facing one way.
    STANDING: Standing {
        /// Samples of each figure in the registration.
        samples: usize = 1_500,
        /// Rounds of the registration. Over 26 pairs of people, robots and animals at rest, 0.80 of the area comes to lie on the
        /// right bone or a neighbour of it, 0.67 as they are given; and the same in 15 or 30 rounds.
        rounds: usize = 12,
        /// Weight of what draws a figure, all together, beside what holds it: of the first round and of the last; 0.77 when both
        /// are ten to a hundred times as strong.
        pull: [f64; 2] = [1e-5, 0.1],
        /// Of that the share that draws to the place of an image, the rest to its tangent plane; 0.75 when drawn to places alone.
        to_place: f64 = 0.02,
        /// Length that a unit normal counts beside positions, for 1 of the height.
        normal: f64 = 0.1,
        /// Least cosine between the normals of a sample and its image, which is else not drawn.
        agreeing: f64 = 0.3,
        /// Weight of what draws landmarks, all together, to their places, in every round.
        known: f64 = 0.1,
        /// Mean distance between samples after the registration, by the height and with normals, up to which figures
        /// may stand alike: 0.065 is the most of right maps.
        fits: f64 = 0.08,
        /// Agreement of curvatures from which they look alike: of 56 pairs of rigged figures right maps have 0.38 and
        /// more, wrong ones 0.33 and less.
        looks_alike: f64 = 0.35,
        /// They stand alike where what they cost is below this times that of the best of a search: right ones cost
        /// 0.3 to 0.6 of it, 0.77 that of two people of whom one waves.
        clearly_less: f64 = 0.7,
        /// A map found by a search from which that as they stand lies this far apart on average at most, √area, is
        /// the same but for what proportions change.
        agree: f64 = 0.1,
        /// Figures are tried turned where they lie nearer to one another than as given, so many times at most.
        most_turned: usize = 2,
        /// Figures are taken for turned where the cost is then below this: with other proportions wrong turns cost
        /// 0.07 to 0.12.
        turned: f64 = 0.05,
        /// The cost is then also below this times that as given.
        better_turned: f64 = 0.8,
    }

    /// How far each point of a surface lies from its own mirror image, where the body is symmetric, and how it is
    /// like itself turned.
    SYMMETRY: Symmetry {
        /// Mean change of distances up to which a surface's map to itself counts as a symmetry: posed animals reach
        /// 0.043, a body with five unequal limbs has 0.046.
        symmetric: f64 = 0.045,
        /// And over the orientation: posed animals stay below 0.1, shapes with holes or cuts exceed 0.14.
        reversing: f64 = 0.1,
        /// Mean distance between a point and the image of its image up to which it does.
        involutive: f64 = 0.06,
        /// Where distances from the mirror image begin to count alike: a man's feet are at 1.35, a gorilla's at 0.75.
        /// 0.3 to 1 set the same gorillas right.
        far: f32 = 0.5,
        /// Ridge of the smooth function through the samples' offsets, per sample.
        ridge: f64 = 1e-3,
    }
}
