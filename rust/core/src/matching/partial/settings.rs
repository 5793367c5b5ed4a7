//! Numbers that steer this stage, each with its reason.

use std::ops::Range;

use crate::settings::settings;

settings! {
    /// Where a part lies on a whole, by its shape in space alone.
    LOCATION: Location {
        /// Samples of the part that are moved.
        part_samples: usize = 300,
        /// Samples of the whole to which they go at first.
        whole_samples: usize = 1_500,
        /// Vertices of the part that ask when it is drawn onto the whole.
        drawn_by: usize = 1_500,
        /// Samples of the part whose pairs vote.
        references: usize = 24,
        /// Steps of the distance within the part's extent.
        distance_steps: f64 = 16.0,
        /// Steps of turns about a normal: 15° each, as the angles between normals.
        turns: usize = 24,
        /// Features that so many pairs of the whole have count half: what is flat everywhere says little.
        common: f64 = 200.0,
        /// Placements kept of each reference.
        kept_of_each: usize = 4,
        /// Placements kept of all references together.
        kept: usize = 40,
        /// Steps that move each placement kept.
        first_steps: usize = 6,
        /// Steps that move each of the few that then fit best.
        last_steps: usize = 15,
        /// How many placements are moved so far.
        finished: usize = 4,
        /// How many of them are drawn onto the surface: the best, and what it has to be told from.
        drawn: usize = 2,
        /// Mean distance between the places of samples up to which two placements are one, √area of the part as all
        /// lengths here.
        same: f64 = 0.2,
        /// Length that a unit normal counts beside positions.
        normal: f64 = 0.3,
        /// Rounds in which the part is drawn onto the whole.
        rounds: usize = 8,
        /// Weight of what draws the part, all together, beside what holds it: of the first round and of the last.
        pull: [f64; 2] = [1e-3, 0.1],
        /// Of that the share that draws to the place of an image, the rest to its tangent plane.
        to_place: f64 = 0.02,
        /// Least cosine between the normals of a sample and its image, which is else not drawn.
        agreeing: f64 = 0.3,
        /// Distance of a sample from the whole at which it counts a quarter in the next step.
        tolerance: f64 = 0.15,
        /// Distance from which on all samples count alike in the misfit.
        far: f64 = 0.3,
        /// Misfit of a part that lies where it does not belong: 0.11 to 0.17 over heads, hands, feet, legs and trunks
        /// of people.
        misplaced: f64 = 0.2,
        /// Samples that are nearer to one another than this are asked how their distance changes.
        near: f64 = 0.35,
    }

    /// The automatic method for a part of a whole: its hypotheses, and how the best of them becomes the map.
    OF_PART: OfPart {
        /// Lengths of a part in units of the whole, both at unit area, when they are given in one unit: a body that
        /// is no part is not just so much smaller, and less leaves little to be recognised by.
        part_lengths: Range<f64> = 0.4..0.97,
        /// Lengths of a part that is located by its shape: from a hand of a child on a man up to a third of the area,
        /// beyond which parts bend too much and distances find them.
        located_lengths: Range<f64> = 0.07..0.6,
        /// Lengths of the unit of a part on the whole where nothing tells them: each finds the maps of parts within a
        /// tenth.
        assumed_part_lengths: [f64; 2] = [0.9, 0.75],
        /// Maps found otherwise that a search for a part begins with too.
        other_starts: usize = 6,
        /// Hypotheses of a part that are completed at most, the first ones.
        most_completed: usize = 8,
        /// How many of them are completed beside each other before it is asked whether that is enough.
        at_once: usize = 3,
        /// Times that the samples of a part are moved to where the rest of its map would have them.
        relocations: usize = 3,
        /// Maps with moved samples are completed when their rank after a short refinement is below this times that of
        /// the map they come from.
        worth_completing: f64 = 1.25,
        /// Times that the map of a part is refined on what it covers of the whole.
        covered_rounds: usize = 5,
        /// Such a map is kept when its rank is below this times that of the map before the first time: right ones
        /// stay below 1.1 mostly and 1.25 at most. Where too much is cut away it is above 1.25, with rims that
        /// count fully in the rank.
        covered_well: f64 = 1.25,
    }

    /// Where the rest of a part's map would have each of its samples.
    RELOCATION: Relocation {
        /// Distance from which on the others say where a sample belongs, √area: all do, or only those farther than a
        /// limb is wide, since its neighbours were mislaid with it.
        heard_from: [f32; 2] = [0.0, 0.15],
        /// A change of distance whose cost is half of the largest, √area.
        tolerance: f32 = 0.05,
        /// A sample belongs elsewhere if it costs so much less there, of 1.
        cheaper: f32 = 0.05,
        /// Elsewhere is farther off than a limb is wide, √area.
        elsewhere: f64 = 0.12,
        /// What a sample that belongs elsewhere itself counts among the others.
        mislaid: f32 = 0.1,
        /// How often samples that belong elsewhere are looked for.
        rounds: usize = 2,
    }

    /// First maps of a part into a whole: samples placed one after the other so that their distances stay.
    SEARCH: Search {
        /// Samples of the part that are placed.
        placed: usize = 12,
        /// Placements kept at each step.
        kept: usize = 1000,
        /// Placements that are looked at for each one kept.
        children: usize = 20,
        /// Weight of a distance that is longer on the part, as where its shortest path was cut. From 0.3 to 0.5 most
        /// right placements are found.
        longer: f32 = 0.5,
        /// Samples of the whole around which places are alike: placements alike in all their places differ by little.
        cells: usize = 24,
        /// Placements kept of those that are alike.
        alike: usize = 2,
        /// Finished placements that become maps at most.
        finished: usize = 24,
        /// Least mean distance between two of them, √area.
        apart: f32 = 0.1,
        /// Samples of the part to which a map is fitted.
        asking: usize = 300,
        /// Eigenfunctions of the part in a map; of the whole as many as have no larger eigenvalue.
        map_size: usize = 20,
        /// Tikhonov weight of a fit, per sample.
        fit_ridge: f64 = 1e-3,
    }

    /// What the map of a part leaves over of the whole.
    UNCOVERED: Uncovered {
        /// Samples of the whole that are looked at; next ones lie about 0.07 apart.
        looked_at: usize = 300,
        /// A sample farther than this from all images of the part's samples, which lie closer together, is left over.
        farther_than: f64 = 0.08,
        /// Samples nearer than this to one another belong to one piece.
        of_one_piece: f64 = 0.13,
        /// A piece begins at an image that is nearer than this to one of its samples.
        begins_within: f64 = 0.15,
        /// Nearness of a sample at a rim: 0.04 from it.
        at_rim: f64 = 0.17,
        /// What may begin elsewhere: this share of the samples, fingertips that lie a little away from all images,
        /// and this share of what is left over. Right maps of cut bodies have at most 0.013 where little is left
        /// over, else at most 0.15 of it; maps that take a whole body with small holes for a part leave 0.3 to 1 of
        /// it so.
        elsewhere_at_most: (f64, f64) = (0.01, 0.2),
    }
}
