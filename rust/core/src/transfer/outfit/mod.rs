//! Garments of one body on another.
//!
//! In: a map between two bodies, and a garment that the source wears. Out: the garment on the target.
//!
//! 1. [`bodies`]: the target is wrapped around the source, and its surface sampled.
//! 2. [`binding`]: every place g of the garment is bound to the nearest place q of the wrapped body, and taken where the
//!    [`frame`] of the body there takes it.
//! 3. [`shape`]: one solve gives the cloth its shape back.
//! 4. [`collision`]: the cloth leaves the body.
//!
//! 1 to 3 do not depend on how tight the garment shall be and are done once, in [`Fitting::new`]; [`Fitting::place`] does
//! the rest.

pub mod binding;
pub mod bodies;
pub mod collision;
pub mod equations;
pub mod frame;
pub mod garment;
pub mod layers;
pub mod outside;
pub mod shape;

use std::sync::Arc;

use self::binding::Binding;
use self::bodies::Bodies;
use self::collision::Distances;
use self::equations::Equations;
use self::garment::Garment;
use self::layers::Contact;
use crate::algebra::vector::{self, Point};
use crate::error::{Error, Result};

/// What steers the fitting. Lengths are in heights of the body they lie at.
#[derive(Debug, Clone, Copy)]
pub struct Settings {
    /// Samples of the wrapped body for narrow frames, and for wide ones.
    pub samples: [usize; 2],
    /// Samples around a point that its frame is fitted to.
    pub neighbours: usize,
    /// Width from which the coarser samples are used.
    pub wide: f64,
    /// Width σ of the frame of what lies on the skin.
    pub least_width: f64,
    /// How much wider it is, over the distance from the skin.
    pub width_by_distance: f64,
    /// Ridge of the affine fit, over the trace of its matrix.
    pub frame_ridge: f64,
    /// Power of the confidence by which a place counts in a frame: stretches of cloth over places that the map is unsure of
    /// are 1.41 apart with the second one, 1.46 without, over 46 garments.
    pub trust: i32,
    /// Confidence that every place has at least, so that a region of which nothing is known has a frame.
    pub least_trust: f64,
    /// Distance from the skin at which cloth takes 1/e of the relief of the target.
    pub relief_reach: f64,
    /// Weight a of the places beside the shape of the cloth.
    pub hold: f64,
    /// Distance from the skin at which that weight is halved.
    pub hold_reach: f64,
    /// Rounds of the collision.
    pub rounds: usize,
    /// Weight of what has to leave the body.
    pub push: f64,
    /// Weight of staying where it is.
    pub push_ridge: f64,
    /// Distance to the skin of what is pushed out.
    pub least_gap: f64,
    /// Distance to the skin beyond which cloth is free.
    pub largest_gap: f64,
    /// What is deeper in the body was there on purpose.
    pub deepest: f64,
    /// How softly the gap of the source is kept when it is small.
    pub squash: f64,
    /// Least gap that is kept of the source.
    pub lowest: f64,
    /// Distance within which two layers lie on one another.
    pub layer_reach: f64,
    /// Share of the gap between two layers that has to lie across them for one to be over the other.
    pub over: f64,
    /// Largest gap between two layers that is kept.
    pub layer_gap: f64,
    /// Weight of what has to leave the layer below.
    pub push_layers: f64,
    /// What is left of the weight of places where cloth crumples.
    pub crumple_hold: f64,
    /// Rounds in which crumpled cloth is let loose.
    pub crumple_rounds: usize,
    /// Misfit of a frame from which it is widened.
    pub residual: f64,
    /// Width to which it is widened.
    pub widest: f64,
    /// Factor by which it is widened.
    pub widen: f64,
    /// Rounds of averaging of the wrapped body.
    pub smooth: usize,
    /// How much deeper than its gap cloth may lie before a push the other way is doubted.
    pub doubt: f64,
    /// Cosine below which a push goes the other way than the frame says.
    pub doubt_cos: f64,
    /// Weight of edges in crumpled cloth while it is pushed.
    pub zone_weight: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            samples: [16_000, 2_500],
            neighbours: 64,
            wide: 0.02,
            least_width: 0.012,
            width_by_distance: 0.5,
            frame_ridge: 1e-3,
            trust: 2,
            least_trust: 0.03,
            relief_reach: 0.04,
            hold: 0.7,
            hold_reach: 0.12,
            rounds: 5,
            push: 4.0,
            push_ridge: 0.02,
            least_gap: 0.0008,
            largest_gap: 0.004,
            deepest: 0.03,
            squash: 0.0005,
            lowest: 0.0005,
            layer_reach: 0.01,
            over: 0.7,
            layer_gap: 0.001,
            push_layers: 4.0,
            crumple_hold: 0.05,
            crumple_rounds: 2,
            residual: 0.2,
            widest: 0.03,
            widen: 1.5,
            smooth: 5,
            doubt: 0.01,
            zone_weight: 4.0,
            doubt_cos: -0.3,
        }
    }
}

impl Settings {
    /// Least distance to the body of what was so far from it on the source: never less than the lowest gap, ever more for
    /// what was further out, and all of it up to the largest.
    fn gap(&self, clearance: f64) -> f64 {
        let above = clearance - self.lowest;
        let positive = 0.5 * (above + above.hypot(2.0 * self.squash));
        (self.lowest + positive).min(self.largest_gap)
    }

    fn width(&self, distance: f64) -> f64 {
        self.least_width.max(self.width_by_distance * distance)
    }
}

/// How a garment shall sit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sitting {
    /// Added to the distance to the skin, in the target's units.
    pub distance: f64,
    /// Share of the gap to the skin that is taken away; below zero it is widened.
    pub tightness: f64,
    /// Whether cloth is kept out of the body.
    pub collide: bool,
}

impl Default for Sitting {
    fn default() -> Self {
        Self {
            distance: 0.0,
            tightness: 0.0,
            collide: true,
        }
    }
}

/// A garment bound to two bodies.
#[derive(Debug)]
pub struct Fitting {
    bodies: Arc<Bodies>,
    settings: Settings,
    garment: Garment,
    equations: Equations,
    bindings: Vec<Binding>,
    contacts: Vec<Contact>,
    shaped: Vec<Point>,
}

impl Fitting {
    /// Binds a garment, vertices and triangles, that the source wears.
    ///
    /// # Errors
    /// Those of [`Garment::new`], and [`Error::NotFactorised`].
    pub fn new(
        bodies: Arc<Bodies>,
        vertices: &[Point],
        triangles: &[[i64; 3]],
        settings: Settings,
    ) -> Result<Self> {
        let garment = Garment::new(vertices, triangles)?;
        let reach = settings.layer_reach * bodies.heights[0];
        let contacts = layers::contacts(&garment, reach, &settings)?;
        let (equations, bindings) = rayon::join(
            || {
                let across = contacts.iter().flat_map(|c| {
                    let [v, i, j, k] = c.places;
                    [[v, i], [v, j], [v, k]]
                });
                Equations::new(
                    garment.places.len(),
                    garment.edges.iter().copied().chain(across),
                )
            },
            || binding::bound(&bodies, &garment, &settings),
        );
        let equations = equations?;
        let shaped = shape::shaped(&garment, &equations, &bindings, &settings)?;
        Ok(Self {
            bodies,
            settings,
            garment,
            equations,
            bindings,
            contacts,
            shaped,
        })
    }

    /// Where the garment's vertices lie on the target.
    ///
    /// # Errors
    /// [`Error::BadArgument`] when a number of the sitting is not finite, [`Error::NotFactorised`].
    pub fn place(&self, sitting: &Sitting) -> Result<Vec<Point>> {
        for (name, value) in [
            ("distance", sitting.distance),
            ("tightness", sitting.tightness),
        ] {
            if !value.is_finite() {
                return Err(Error::BadArgument {
                    what: format!("`{name}` should be a finite number, got {value}"),
                });
            }
        }
        let settings = &self.settings;
        let height = self.bodies.heights[1];
        let mut positions: Vec<Point> = self.shaped.clone();
        let mut places = Vec::with_capacity(positions.len());
        for (p, b) in positions.iter_mut().zip(&self.bindings) {
            let anchor = self.bodies.map.target.position(&b.anchor);
            let gap = vector::dot(vector::sub(*p, anchor), b.frame.out).max(0.0);
            let step = b.tightness(settings) * (sitting.distance - sitting.tightness * gap);
            *p = vector::add(*p, vector::scaled(b.frame.out, step));
            let wanted = b.clearance * (1.0 - sitting.tightness) + sitting.distance;
            places.push(height * settings.gap(wanted / height));
        }
        if sitting.collide {
            let distances = Distances {
                places,
                contacts: self
                    .contacts
                    .iter()
                    .map(|c| {
                        let scale = self.bindings[c.places[0] as usize].scale();
                        (c.gap * scale).min(settings.layer_gap * height)
                    })
                    .collect(),
                least: settings.least_gap * height,
                deepest: settings.deepest * height,
                out: self.bindings.iter().map(|b| b.frame.out).collect(),
                clearance: self.bindings.iter().map(|b| b.clearance).collect(),
                doubt: settings.doubt * height,
            };
            let guesses: Vec<u32> = self.bindings.iter().map(|b| b.anchor.face).collect();
            positions = collision::cleared(
                &self.bodies,
                &self.garment,
                &self.equations,
                &self.contacts,
                &distances,
                &guesses,
                positions,
                settings,
            )?;
        }
        Ok(self
            .garment
            .place_of
            .iter()
            .map(|&v| positions[v as usize])
            .collect())
    }
}
