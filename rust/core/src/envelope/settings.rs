//! Numbers that steer this stage, each with its reason.

use super::Offsets;
use crate::error::{Error, Result};
use crate::settings::settings;

/// How an envelope is made, where [`USUAL`] has the reason for each value.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Cells along the largest extent.
    pub cells: usize,
    /// Bricks along the outside at most: a figure with more of them is on a coarser grid.
    pub outer_bricks: usize,
    /// Offsets that are tried, in this order; on a coarser grid those of solids and sheets are as many of its cells.
    pub offsets: Vec<Offsets>,
    /// Half of the gaps that are bridged, in this order, between parts that stay apart with all offsets.
    pub bridges: Vec<f64>,
    /// Share of the visible area that has to be connected.
    pub connected: f64,
}

impl Default for Settings {
    fn default() -> Self {
        let offsets = |[solid, sheet, blend]: [f64; 3]| Offsets {
            solid,
            sheet,
            blend,
        };
        Self {
            cells: USUAL.cells,
            outer_bricks: USUAL.outer_bricks,
            offsets: USUAL.offsets.map(offsets).to_vec(),
            bridges: USUAL.bridges.to_vec(),
            connected: USUAL.connected,
        }
    }
}

/// Cells along the largest extent, at least.
pub(super) const LEAST_CELLS: usize = 8;

impl Settings {
    pub(super) fn check(&self) -> Result<()> {
        let bad = |what: &str| {
            Err(Error::BadArgument {
                what: what.to_owned(),
            })
        };
        let is_length = |x: f64| (0.0..0.1).contains(&x);
        let are_lengths =
            |o: &Offsets| is_length(o.solid) && is_length(o.sheet) && is_length(o.blend);
        if !(LEAST_CELLS..=1024).contains(&self.cells) {
            return bad("`cells` should be 8 to 1024: give a number of cells in that range");
        }
        if !self.bridges.iter().all(|&b| is_length(b)) {
            return bad("`bridges` should each be 0 to 0.1 of the largest extent");
        }
        if self.outer_bricks == 0 {
            return bad("`outer_bricks` should be 1 or more");
        }
        if self.offsets.is_empty() || !self.offsets.iter().all(are_lengths) {
            return bad("`offsets` should be one or more, each 0 to 0.1 of the largest extent");
        }
        Ok(())
    }
}

settings! {
    /// How an envelope is made where the caller says nothing else.
    USUAL: Usual {
        /// Cells along the largest extent. Finer grids of three pairs of humanoids did not map better, at three times
        /// the size.
        cells: usize = 128,
        /// Bricks along the outside at most: a figure with more of them is on a coarser grid. With so many there are
        /// some 28,000 vertices, and maps are sought on 7,000. Slender figures have 1,200, those of four legs 1,900,
        /// plump ones with large heads up to 4,000.
        outer_bricks: usize = 2000,
        /// Offsets (solid, sheet, blend) that are tried, in this order; on a coarser grid those of solids and sheets
        /// are as many of its cells. Sheets are found by the grid from half a cell on, and gaps of a hundredth of a
        /// person are those between plates.
        offsets: [[f64; 3]; 2] = [[0.004, 0.006, 0.006], [0.006, 0.006, 0.008]],
        /// Half of the gaps that are bridged, in this order, between parts that stay apart with all offsets: a head
        /// over a collar.
        bridges: [f64; 2] = [0.016, 0.032],
        /// Share of the visible area that has to be connected: the rest is earrings and the like.
        connected: f64 = 0.99,
    }

    /// The function whose zero level set is the envelope, sampled near it.
    FIELD: Field {
        /// How steeply the solid ends where |w| passes 1/2: at 1/4 and 3/4 it is a distance again.
        steepness: f32 = 4.0,
        /// Distance of |w| from 0 and 1 above which a surface is a sheet.
        sheet_above: f32 = 0.2,
        /// Depth in cells of the deepest point around below which a solid is thin: at a point outside the next one
        /// inward of a thick solid is up to a cell deep, and half a cell is enough to be found.
        thin_below: f32 = 0.2,
        /// The depth above which it needs no offset.
        thick_above: f32 = 0.4,
        /// λ: what counts is a gap between two pieces and not one behind the other, where p₂ lies beyond p₁; 2d₁ is
        /// then added so many times.
        between: f32 = 1.0,
        /// A cell that the surface crosses has a point within the offset; its corners are within a diagonal of that,
        /// in steps.
        diagonal: f32 = 1.8,
        /// Winding number at most beyond the box of all triangles: outside of any solid, and still beside a sheet.
        most_beyond: f32 = 0.45,
    }

    /// The zero level set of values on the grid, as a closed manifold.
    SURFACE: Surface {
        /// Crossings stay this share of an edge away from its ends: vertices of different cells are then apart, and
        /// no triangle is degenerate.
        least_part: f32 = 0.1,
    }

    /// What of a soup can be seen from outside: depth buffers from directions all around.
    VISIBLE: Visible {
        /// Axes, each of two views. With 64 of them the visible area of a clothed character differs by less than 1 %.
        axes: usize = 32,
        /// Pixels along the largest extent: the narrowest gap through which something is seen is some thousandths of
        /// it.
        pixels: f32 = 256.0,
        /// How far before a sample the plane of another triangle may pass, in pixels: neighbours of a curved surface
        /// do.
        slack: f32 = 0.5,
        /// A view counts for a face whose normal is less than this away from it, as a cosine: in slanting ones depths
        /// across a pixel differ by many.
        least_cosine: f32 = 0.2,
        /// Views from which a sample has to be seen: a single one of 64 looks through a crack between two pieces.
        seen_from: u8 = 2,
        /// Edge, over the largest extent, of which a face has one sample; of twice as long ones four, of longer ones
        /// sixteen.
        one_sample: f32 = 0.03,
        /// How far outside an edge, in pixels times its length, a pixel still counts as covered: without it rounding
        /// leaves cracks.
        cover: f32 = 1e-3,
    }

    /// Generalised winding number of a soup of triangles, by a tree of multipoles.
    WINDING: Winding {
        /// A node is expanded from so many of its radii. Against all solid angles the largest error is 0.044 with 2
        /// on a sphere, a torus and an open box, below the error allowed for with 2.5.
        opening: f32 = 2.5,
        /// Distance, in radii of the part, from which the share of a node or triangle is smooth there.
        smooth: f32 = 2.5,
    }
}
