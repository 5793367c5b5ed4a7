//! Numbers that steer this stage, each with its reason.

use crate::settings::settings;

settings! {
    /// Pieces that two figures have in common, as a character has with itself in another pose.
    COPIES: Copies {
        /// Landmarks drawn from copies: as many as points that a registration gives, see the search's use of
        /// landmarks.
        landmarks: usize = 12,
        /// Landmarks say the same as common pieces where they lie nearer to the originals than this, over the extent:
        /// a limb's width.
        agree: f64 = 0.05,
        /// Share of what is seen on common pieces from which they are the map: as much as one piece has to carry to
        /// be matched by itself.
        enough: f64 = 0.97,
    }

    /// The grade of a map between figures: that of what was matched, for all that is seen.
    JUDGEMENT: Judgement {
        /// More of the visible area than this without an image of its own leaves a map amber.
        most_unknown: f64 = 0.1,
        /// A surface of fewer vertices is too coarse for its map to be sure.
        fewest_sure: usize = 120,
    }

    /// What an artist selects as one figure, however many pieces it has.
    FIGURE: Figure {
        /// Share of what is seen from outside that the largest piece has to carry to be matched by itself: eyes,
        /// lashes and buttons beside a body stay below the rest; any garment or plate is more.
        carries_all: f64 = 0.97,
        /// Vertices of a figure nearer to its envelope than this, over the largest extent, are on it: half more than
        /// the largest offset and a cell of the envelope's grid.
        on_envelope: f64 = 0.02,
        /// A piece no thicker than this share of its largest extent is flat.
        flat: f64 = 1e-3,
    }

    /// Whether a surface is the same after a turn about an axis, by how it lies.
    TURNING: Turning {
        /// Share of repeated eigenvalues from which a surface is taken to be the same after a turn: prisms have 0.7
        /// and more, bodies at most 0.
        repeated: f64 = 0.3,
        /// Points that are turned, spread evenly over the area.
        asked: usize = 1_000,
        /// Mean distance between a turned point and the surface, over √area, up to which the surface is the same. Solids
        /// that are so have 0.0000; of 31 scanned and modelled people and animals none has less than 0.021, of 38 game
        /// figures with arms spread, who face forward by little, none less than 0.0068.
        mean: f64 = 0.003,
        /// Quantile of that distance that has a bound of its own.
        quantile: f64 = 0.99,
        /// That quantile at most: the solids have 0.001, the people and animals at least 0.081, the game figures 0.032.
        nearly_all: f64 = 0.012,
        /// Difference of the largest and the least second moment, over the largest, below which all count as equal: jacks
        /// that turn onto themselves have at most 0.019, people, animals and game figures at least 0.44.
        equal: f64 = 0.05,
        /// Distance of landmarks from every axis, over √area, from which they tell turns apart: as much as an image may
        /// be off before a map counts as wrong.
        off: f64 = 0.06,
        /// Distance of the images around a landmark from where it belongs, over √area, beyond which the map goes round
        /// another way in between: half of that.
        slid: f64 = 0.03,
    }

    /// From the map between what was matched to one between the given meshes, all pieces of them.
    PULL_BACK: PullBack {
        /// Images of the corners of a face that are farther apart than this many times its longest edge, at the
        /// source's size, belong to different limbs: the nearest corner's is taken. Faces of right maps stretch to
        /// about three times.
        torn: f64 = 6.0,
        /// Cosine of the angle between two surfaces from which they lie alike, whatever their windings.
        alike: f64 = 0.3,
        /// Depth that is carried, over the largest extent: a body lies within it under ordinary clothes, and farther
        /// inside another surface's nearest point may be that of its other side.
        deepest: f64 = 0.05,
        /// How much farther than the nearest point of all one may lie that lies alike, over the largest extent.
        aside: f64 = 0.03,
        /// A piece that lies on several of the source goes to the first of them where at least this share of it can.
        covers: f64 = 0.9,
        /// Such a piece is laid on that one by its shape where as a counterpart it costs at most this.
        like: f64 = 0.6,
    }

    /// What is worn: a shirt, a hat, hair or teeth on the body that wears them, in their place.
    WORN: Worn {
        /// Points of each surface that are asked where they lie, spread evenly over its area.
        asked: usize = 2_000,
        /// Median and 97 % quantile of the gap at most, over the largest extent of the source: eleven garments,
        /// shoes, a hat and hair on their bodies have at most 0.018 and 0.055.
        close: [f64; 2] = [0.02, 0.06],
        /// Least share of the points that lie on one side of the wearer: what is worn has at least 0.83; of 70 pairs
        /// of whole characters at one place those with such gaps and as much uncovered have at most 0.74.
        on_one_side: f64 = 0.8,
        /// Median and 97 % quantile of the gap at most of a layer with an even gap, over the largest extent of the
        /// source.
        layer: [f64; 2] = [0.05, 0.08],
        /// Least share of the points of such a layer that lie on one side.
        layer_on_one_side: f64 = 0.97,
        /// By how many times its 97 % quantile is the median of an even gap at most: a small figure beside a large
        /// one's leg has 1.6.
        even: f64 = 1.5,
        /// The gap is at most this share of the target's own largest extent.
        largest_gap: f64 = 0.5,
        /// What is worn runs along its wearer: mean |cosine| between its normals and those below. Garments, shoes, a
        /// hat and hair of two people have at least 0.65, their teeth 0.60 and 0.62; of 153 small figures that stand
        /// as near to a large one at most 0.59.
        runs_along: f64 = 0.59,
        /// Least share of the source's area that what is worn leaves uncovered: the garments leave 0.11, two bodies
        /// of one size at one place up to 0.08.
        uncovered: f64 = 0.1,
        /// How far the source sticks out of what is worn along an axis at least, over its largest extent: out of suits with
        /// shoes by 0.13, of other garments by more; of another person of a like size at one place, one of 24 of whom
        /// lies as near as clothes, by up to 0.123.
        sticking_out: f64 = 0.128,
        /// Gap up to which the source is covered, over its largest extent.
        covered: f64 = 0.03,
        /// Gap at which confidence falls to 1/e, over the largest extent of the source.
        reach: f64 = 0.1,
    }
}
