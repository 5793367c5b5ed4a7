//! The function whose zero level set is the envelope, sampled near it.
//!
//! ```text
//! f(x) = min( σ(x)·d₁,   d₁ − r(x),   g(x) − b )
//! σ(x) = clamp(4·(1/2 − |w(x)|), −1, 1)
//! r(x) = (1 − τ(x))·ϑ(x)·r_solid + τ(x)·r_sheet
//! g(x) = (d₁ + d₂)/2 + λ·(d₁ + d₂ − ‖p₁ − p₂‖)
//! ```
//!
//! d₁ is the distance to the nearest point p₁ of the soup, d₂ that to the nearest point p₂ of another piece, and w the
//! winding number. The first term is the solid, continuous where something is missing; the second gives sheets a
//! thickness, since τ is 1 where w is that of a sheet (±1/2) and 0 where it is that of a solid (0 or 1), and solids one where
//! they are too thin for the grid, which ϑ tells; the third joins different pieces that are nearer to one another than 2b,
//! between them. No piece is joined to itself.

use rayon::prelude::*;

use super::distance::Nearest;
use super::grid::{Grid, INSIDE, OUTSIDE, POINTS, SIDE, Values, local};
use super::place::{Place, dot, sub};
use super::surface::Level;
use super::tree::Tree;
use super::winding::{EXPANSION_ERROR, Part};
use crate::envelope::settings::FIELD;
use crate::error::Result;
use crate::watch::progress::Progress;

/// |w|, and its distance from 1, below which a surface is that of a solid, and above which it is a sheet. What the winding
/// number is wrong by does not make a sheet of a solid.
const SOLID_BELOW: f32 = EXPANSION_ERROR + 0.02;

/// Steps around all that is within reach: a brick beside it that can change, and one that cannot.
const MARGIN: f32 = 2.0 * SIDE as f32;

/// Points of the grid along the largest extent, of so many cells, with offsets as large as that.
pub(super) fn points_along(cells: f64, largest: f64) -> f64 {
    cells * (1.0 + 2.0 * largest) + 2.0 * f64::from(FIELD.diagonal + MARGIN) + 1.0
}

/// What f is made of at a point.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Sample {
    /// d₁, at most the reach of the band.
    distance: f32,
    /// σ·d₁.
    solid: f32,
    /// τ.
    sheet: f32,
    /// g, infinite where it does not matter.
    gap: f32,
}

/// Offsets in units of the scaled soup.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Offsets {
    /// `r_solid`, of solids where they are thinner than some cells.
    pub solid: f64,
    /// `r_sheet`.
    pub sheet: f64,
    /// b.
    pub blend: f64,
}

/// Samples in the bricks near the surface.
#[derive(Debug)]
pub(super) struct Band {
    grid: Grid,
    samples: Vec<Values<Sample>>,
    /// Largest distance that is told.
    reach: f32,
}

/// Between which pieces gaps are bridged.
#[derive(Debug, Clone)]
pub(super) struct Bridges {
    /// Half of the widest gap between any two pieces.
    pub blend: f32,
    /// Group of each piece.
    pub groups: Vec<u32>,
    /// Half of the widest gap between groups.
    pub wide: f32,
}

impl Bridges {
    /// None, with every piece in one group.
    pub fn none(pieces: usize) -> Self {
        Self {
            blend: 0.0,
            groups: vec![0; pieces],
            wide: 0.0,
        }
    }

    /// g at a place.
    fn gap(&self, tree: &Tree, q: Place, first: Nearest) -> f32 {
        let distance = first.squared.sqrt();
        let beyond = |blend: f32, is_same: &dyn Fn(u32) -> bool| {
            let left = 2.0 * blend - distance;
            let second = (distance < blend).then(|| tree.nearest(q, left * left, is_same))??;
            let apart = sub(first.place, second.place);
            let sum = distance + second.squared.sqrt();
            Some(sum / 2.0 + FIELD.between * (sum - dot(apart, apart).sqrt()))
        };
        let narrow = beyond(self.blend, &|piece| piece == first.piece);
        let group = self.groups[first.piece as usize];
        let wide = beyond(self.wide, &|piece| self.groups[piece as usize] == group);
        let narrow = narrow.unwrap_or(f32::INFINITY);
        // A wide gap counts as one that is as much narrower as wider ones are bridged.
        narrow.min(wide.map_or(f32::INFINITY, |gap| gap - (self.wide - self.blend)))
    }

    /// Whether the ways from a place to two groups are no longer than twice a width together.
    fn two_groups_are_near(&self, tree: &Tree, q: Place, width: f32) -> bool {
        let Some(first) = tree.nearest(q, width * width, &|_| false) else {
            return false;
        };
        let left = 2.0 * width - first.squared.sqrt();
        let group = self.groups[first.piece as usize];
        let is_same = |piece: u32| self.groups[piece as usize] == group;
        tree.nearest(q, left * left, &is_same).is_some()
    }
}

/// The grid of a soup with the bricks that can have a part of the surface, of offsets that are not larger than that.
pub(super) fn grid_near(tree: &Tree, step: f32, largest: f32, progress: &Progress) -> Result<Grid> {
    let reach = reach_of(largest, step);
    let root = &tree.nodes[0];
    let margin = reach + MARGIN * step;
    let mut grid = Grid::over(
        root.low.map(|x| x - margin),
        root.high.map(|x| x + margin),
        step,
    );
    let wide = (grid.half() * 3f32.sqrt() + reach).powi(2);
    progress.check()?;
    let sides = sides(tree, &grid, wide);
    for (brick, side) in (0..).zip(&sides) {
        match side {
            Some(false) => {}
            Some(true) => grid.slots[brick as usize] = INSIDE,
            None => grid.activate(brick),
        }
    }
    for (brick, side) in (0..).zip(&sides) {
        let differs =
            |&other: &u32| sides[other as usize].is_some_and(|is_in| Some(is_in) != *side);
        if side.is_some() && grid.around(brick).any(|other| differs(&other)) {
            grid.activate(brick);
        }
    }
    progress.check()?;
    Ok(grid)
}

/// Largest distance that is told for offsets that are not larger than that.
fn reach_of(largest: f32, step: f32) -> f32 {
    largest + FIELD.diagonal * step
}

impl Band {
    /// Samples a soup in the bricks of a grid, for offsets that are not larger than that.
    pub fn of(
        tree: &Tree,
        grid: Grid,
        largest: f32,
        bridges: &Bridges,
        progress: &Progress,
    ) -> Result<Self> {
        let mut band = Self {
            reach: reach_of(largest, grid.step),
            grid,
            samples: Vec::new(),
        };
        band.fill(tree, bridges, progress)?;
        Ok(band)
    }

    /// The band of a soup with wider gaps bridged between groups, if any are so near to one another: the bricks where that
    /// matters are sampled anew.
    pub fn bridged(
        &self,
        tree: &Tree,
        bridges: &Bridges,
        progress: &Progress,
    ) -> Result<Option<Self>> {
        let needed = bridges.wide + FIELD.diagonal * self.grid.step;
        let width = self.grid.half() * 3f32.sqrt() + needed;
        let between: Vec<u32> = (0..self.grid.slots.len() as u32)
            .into_par_iter()
            .filter(|&brick| bridges.two_groups_are_near(tree, self.grid.middle(brick), width))
            .collect();
        progress.check()?;
        if between.is_empty() {
            return Ok(None);
        }
        let mut band = Self {
            grid: self.grid.clone(),
            samples: self.samples.clone(),
            reach: self.reach.max(needed),
        };
        let slots: Vec<usize> = (between.iter())
            .map(|&brick| self.grid.slots[brick as usize] as usize)
            .filter(|&slot| slot < self.samples.len())
            .collect();
        let anew: Vec<Values<Sample>> = (slots.par_iter())
            .map(|&slot| band.sampled(tree, band.grid.active[slot], bridges))
            .collect();
        for (&slot, samples) in slots.iter().zip(anew) {
            band.samples[slot] = samples;
        }
        progress.check()?;
        for brick in between {
            if self.grid.slots[brick as usize] as usize >= self.samples.len() {
                band.grid.activate(brick);
            }
        }
        band.fill(tree, bridges, progress)?;
        Ok(Some(band))
    }

    /// Samples the bricks that wait for it, and those that these show to be needed.
    fn fill(&mut self, tree: &Tree, bridges: &Bridges, progress: &Progress) -> Result<()> {
        while self.samples.len() < self.grid.active.len() {
            let from = self.samples.len();
            let new: Vec<Values<Sample>> = self.grid.active[from..]
                .par_iter()
                .map(|&brick| self.sampled(tree, brick, bridges))
                .collect();
            self.samples.extend(new);
            self.follow(from);
            progress.check()?;
        }
        Ok(())
    }

    fn sampled(&self, tree: &Tree, brick: u32, bridges: &Bridges) -> Values<Sample> {
        let mut points = [[0.0; POINTS]; 3];
        for (n, point) in self.grid.points(brick).enumerate() {
            let place = self.grid.place(point);
            for axis in 0..3 {
                points[axis][n] = place[axis];
            }
        }
        let part = Part {
            middle: self.grid.middle(brick),
            half: self.grid.half(),
        };
        let windings = tree.winding_in(&part, &points);
        let mut samples = [Sample::default(); POINTS];
        let mut known = u32::MAX;
        for n in 0..POINTS {
            // There and back again, so that the nearest triangle of a point is near to the next one.
            let n = boustrophedon(n);
            let q = points.map(|x| x[n]);
            let nearest = tree.nearest_from(q, self.reach * self.reach, known);
            known = nearest.map_or(known, |n| n.triangle);
            let winding = windings[n].abs();
            let winding = if tree.holds(q) {
                winding
            } else {
                winding.min(FIELD.most_beyond)
            };
            samples[n] = self.sample(tree, q, nearest, winding, bridges);
        }
        samples
    }

    fn sample(
        &self,
        tree: &Tree,
        q: Place,
        nearest: Option<Nearest>,
        w: f32,
        bridges: &Bridges,
    ) -> Sample {
        let distance = nearest.map_or(self.reach, |n| n.squared.sqrt());
        let sigma = (FIELD.steepness * (0.5 - w)).clamp(-1.0, 1.0);
        let from_solid = w.min((1.0 - w).abs());
        let sheet = (from_solid - SOLID_BELOW) / (FIELD.sheet_above - SOLID_BELOW);
        let gap = nearest.map(|first| bridges.gap(tree, q, first));
        Sample {
            distance,
            solid: sigma * distance,
            sheet: sheet.clamp(0.0, 1.0),
            gap: gap.unwrap_or(f32::INFINITY),
        }
    }

    /// Activates bricks without values beside points that are on the other side.
    fn follow(&mut self, from: usize) {
        for slot in from..self.samples.len() {
            let brick = self.grid.active[slot];
            let around: Vec<u32> = self.grid.around(brick).collect();
            for other in around {
                let constant = self.grid.slots[other as usize];
                if constant != OUTSIDE && constant != INSIDE {
                    continue;
                }
                let (own, at) = (self.grid.brick_at(brick), self.grid.brick_at(other));
                let touches = |point: &[usize; 3]| {
                    (0..3).all(|i| match at[i].cmp(&own[i]) {
                        std::cmp::Ordering::Less => point[i].is_multiple_of(SIDE),
                        std::cmp::Ordering::Equal => true,
                        std::cmp::Ordering::Greater => point[i] % SIDE == SIDE - 1,
                    })
                };
                let points = self.grid.points(brick).zip(&self.samples[slot]);
                let is_crossed = points
                    .filter(|(point, _)| touches(point))
                    .any(|(_, sample)| (sample.solid < 0.0) != (constant == INSIDE));
                if is_crossed {
                    self.grid.activate(other);
                }
            }
        }
    }

    /// f with these offsets.
    pub fn level(&self, offsets: Offsets) -> Level {
        let [solid, sheet, blend] = [offsets.solid, offsets.sheet, offsets.blend].map(|x| x as f32);
        let bricks = self.grid.active.par_iter().zip(&self.samples);
        let values = bricks.map(|(&brick, samples)| {
            let mut values = [0.0; POINTS];
            for ((value, s), point) in values.iter_mut().zip(samples).zip(self.grid.points(brick)) {
                let thin = if s.solid >= 0.0 && s.distance < solid {
                    solid * self.thinness(point)
                } else {
                    0.0
                };
                let offset = thin + (sheet - thin) * s.sheet;
                *value = s.solid.min(s.distance - offset).min(s.gap - blend);
            }
            values
        });
        let mut level = Level {
            values: values.collect(),
            grid: self.grid.clone(),
            far: self.reach,
        };
        level.widen();
        level
    }

    /// ϑ: how far the solid beside a point is from being found by the grid, 0 where a point around is well inside, 1 where
    /// none is.
    fn thinness(&self, [x, y, z]: [usize; 3]) -> f32 {
        let mut depth = 0f32;
        for n in 0..27 {
            let point = [x + n % 3 - 1, y + n / 3 % 3 - 1, z + n / 9 - 1];
            let slot = self.grid.slot(point);
            if slot == INSIDE {
                return 0.0;
            }
            if slot != OUTSIDE {
                depth = depth.max(-self.samples[slot as usize][local(point)].solid);
            }
        }
        let cells = depth / self.grid.step;
        1.0 - ((cells - FIELD.thin_below) / (FIELD.thick_above - FIELD.thin_below)).clamp(0.0, 1.0)
    }
}

/// Of each brick without a triangle nearer to its middle than the square root of `wide` whether it is inside.
fn sides(tree: &Tree, grid: &Grid, wide: f32) -> Vec<Option<bool>> {
    // Bricks of bricks, so that their winding numbers are found together.
    let width = grid.step * SIDE as f32;
    let large = grid.bricks.map(|count| count.div_ceil(SIDE));
    let middle = |at: [usize; 3]| {
        grid.place(at.map(|b| b * SIDE))
            .map(|x| x + grid.step * (SIDE - 1) as f32 / 2.0)
    };
    let found: Vec<Vec<(usize, bool)>> = (0..large.iter().product())
        .into_par_iter()
        .map(|n| {
            let first = [
                n % large[0],
                n / large[0] % large[1],
                n / (large[0] * large[1]),
            ];
            let first = first.map(|b| b * SIDE);
            let bricks: [[usize; 3]; POINTS] = std::array::from_fn(|n| {
                let shift = [n % SIDE, n / SIDE % SIDE, n / (SIDE * SIDE)];
                [0, 1, 2].map(|i| first[i] + shift[i])
            });
            let is_far = |at: &[usize; 3]| {
                let exists = (0..3).all(|i| at[i] < grid.bricks[i]);
                exists && tree.nearest(middle(*at), wide, &|_| false).is_none()
            };
            let far: Vec<usize> = (0..POINTS).filter(|&n| is_far(&bricks[n])).collect();
            if far.is_empty() {
                return Vec::new();
            }
            let half = width * (SIDE - 1) as f32 / 2.0;
            let part = Part {
                middle: middle(first).map(|x| x + half),
                half,
            };
            let mut points = [[0.0; POINTS]; 3];
            for n in 0..POINTS {
                let place = middle(bricks[n]);
                for axis in 0..3 {
                    points[axis][n] = place[axis];
                }
            }
            let windings = tree.winding_in(&part, &points);
            far.into_iter()
                .map(|n| {
                    let is_inside = windings[n].abs() > 0.5 && tree.holds(middle(bricks[n]));
                    (grid.brick(bricks[n]), is_inside)
                })
                .collect()
        })
        .collect();
    let mut sides = vec![None; grid.slots.len()];
    for (brick, is_inside) in found.into_iter().flatten() {
        sides[brick] = Some(is_inside);
    }
    sides
}

/// Points of a brick in an order in which each is beside the one before.
fn boustrophedon(n: usize) -> usize {
    let [x, y, z] = [n % SIDE, n / SIDE % SIDE, n / (SIDE * SIDE)];
    let back = |x: usize, is_back: bool| if is_back { SIDE - 1 - x } else { x };
    let row = n / SIDE;
    back(x, row % 2 == 1) + SIDE * (back(y, z % 2 == 1) + SIDE * z)
}
