//! Garments of one body on another.
//!
//! In: a map between two bodies, and garments that the source wears in the pose in which it was matched. Out: the garments
//! on the target.
//!
//! 1. [`bodies`]: the target is wrapped around the source, each vertex at its image, and its surface sampled.
//! 2. [`binding`]: every place g of a garment is bound to the nearest place of the wrapped body and taken where the
//!    [`frame`] of the body there takes it, x̄ → ȳ with the affine J.
//! 3. [`shape`]: one solve gives the cloth its shape back, `min Σᵢⱼ |pⱼ − pᵢ − ½(Jᵢ + Jⱼ)(gⱼ − gᵢ)|² + Σ aᵢ |pᵢ − goalᵢ|²`.
//! 4. [`collision`]: the cloth leaves the body, [`layers`] leave one another, and [`stiff`] pieces go as a whole.
//!
//! 1 to 3 do not depend on how tight a garment shall be and are done once, in [`Fitting::new`]; [`Fitting::place`] does the
//! rest. Weights and whatever else the target's skin has travel along [`Fitting::on_target`], bones by [`bone_map`]; where both
//! bodies have rigs, these tell where the map is unsure ([`guidance`]).

pub mod binding;
pub mod bodies;
pub mod bone_map;
pub mod collision;
pub mod equations;
pub mod frame;
pub mod garment;
pub mod guidance;
pub mod hidden;
pub mod layers;
pub mod outside;
pub mod settings;
pub mod shape;
pub mod stiff;

use std::sync::Arc;

use rayon::prelude::*;

use self::binding::Binding;
use self::bodies::Bodies;
use self::collision::{Distances, Keep};
use self::equations::Equations;
use self::frame::times;
use self::garment::Garment;
use self::layers::Contact;
use self::settings::Settings;
use crate::algebra::vector::{self, Point};
use crate::error::{Error, Result};
use crate::transfer::surface::Surface;
use crate::transfer::surface_map::{SurfaceMap, check_rows};
use crate::watch::progress::Check;

/// How a garment shall sit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sitting {
    /// Added to the distance to the skin, in the target's units.
    pub distance: f64,
    /// Share of the gap to the skin that is taken away, 1 at most; below zero the gap is widened.
    pub tightness: f64,
    /// Whether cloth is kept out of the body, and layers in their order.
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

impl Sitting {
    fn checked(&self) -> Result<()> {
        let Self {
            distance,
            tightness,
            ..
        } = *self;
        if !distance.is_finite() {
            return Err(Error::BadArgument {
                what: format!("`distance` should be a finite number, got {distance}"),
            });
        }
        if !(tightness.is_finite() && tightness <= 1.0) {
            return Err(Error::BadArgument {
                what: format!("`tightness` should be a number of at most 1, got {tightness}"),
            });
        }
        Ok(())
    }
}

/// Garments bound to two bodies.
#[derive(Debug)]
pub struct Fitting {
    bodies: Arc<Bodies>,
    settings: Settings,
    garment: Garment,
    equations: Equations,
    bindings: Vec<Binding>,
    contacts: Vec<Contact>,
    /// Places of each stiff piece.
    stiff: Vec<Vec<u32>>,
    shaped: Vec<Point>,
}

impl Fitting {
    /// Binds garments that the source wears: vertices and triangles of all of them together.
    ///
    /// `stiff` tells for each vertex whether its piece keeps its shape, as small ones do in any case; it may be empty.
    ///
    /// # Errors
    /// Those of [`Garment::new`]; [`Error::BadArgument`] when `stiff` has another length; [`Error::NotFactorised`],
    /// [`Error::Cancelled`].
    pub fn new(
        bodies: Arc<Bodies>,
        vertices: &[Point],
        triangles: &[[i64; 3]],
        stiff: &[bool],
        settings: Settings,
        check: Check<'_>,
    ) -> Result<Self> {
        let garment = Garment::new(vertices, triangles)?;
        if !stiff.is_empty() {
            check_rows("stiff", stiff.len(), vertices.len())?;
        }
        let height = bodies.heights[0];
        let contacts = layers::contacts(&garment, height, &settings)?;
        let (equations, bindings) = rayon::join(
            || {
                let across = contacts.iter().flat_map(|c| {
                    let [v, i, j, k] = c.places;
                    [[v, i], [v, j], [v, k]]
                });
                let pairs = garment.edges.iter().copied().chain(across);
                Equations::new(garment.places.len(), pairs)
            },
            || binding::bound(&bodies, &garment, &settings, check),
        );
        let (equations, bindings) = (equations?, bindings?);
        check()?;
        let mut shaped = shape::shaped(&garment, &equations, &bindings, &settings)?;
        let stiff = stiff_pieces(&garment, stiff, settings.stiff_size * height);
        stiff::kept_stiff(&stiff, &garment.places, &mut shaped, bodies.mirrored);
        Ok(Self {
            bodies,
            settings,
            garment,
            equations,
            bindings,
            contacts,
            stiff,
            shaped,
        })
    }

    /// Number of vertices that were given.
    #[must_use]
    pub fn len(&self) -> usize {
        self.garment.place_of.len()
    }

    /// Never: a garment has a vertex.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Where the garments' vertices lie on the target.
    ///
    /// # Errors
    /// [`Error::BadArgument`] when the distance is not finite or the tightness is not a number up to 1;
    /// [`Error::NotFactorised`], [`Error::Cancelled`].
    pub fn place(&self, sitting: &Sitting, check: Check<'_>) -> Result<Vec<Point>> {
        sitting.checked()?;
        let Sitting {
            distance,
            tightness,
            collide,
        } = *sitting;
        let settings = &self.settings;
        let height = self.bodies.heights[1];
        let mut positions = self.shaped.clone();
        let mut places = Vec::with_capacity(positions.len());
        for ((p, b), stiff) in positions
            .iter_mut()
            .zip(&self.bindings)
            .zip(self.is_stiff())
        {
            let anchor = self.bodies.map.target.position(&b.anchor);
            let out = b.frame.out;
            let gap = vector::dot(vector::sub(*p, anchor), out).max(0.0);
            let step = b.tightness(settings) * (distance - tightness * gap);
            *p = vector::add(*p, vector::scaled(out, step));
            places.push(Keep {
                gap: self.gap(b, stiff, sitting),
                least: if stiff {
                    f64::NEG_INFINITY
                } else {
                    settings.least_gap * height
                },
                clearance: b.clearance * (1.0 - tightness) + distance,
                out,
                face: b.anchor.face,
            });
        }
        stiff::kept_stiff(&self.stiff, &self.shaped, &mut positions, false);
        if collide {
            let between = |c: &Contact| {
                let size = self.bindings[c.places[0] as usize].frame.size();
                (c.gap * size).min(settings.layer_gap * height)
            };
            let distances = Distances {
                places,
                contacts: self.contacts.iter().map(between).collect(),
                deepest: settings.deepest * height,
                doubt: settings.doubt * height,
            };
            let cloth = (&self.garment, &self.equations, self.contacts.as_slice());
            positions =
                collision::cleared(&self.bodies, cloth, &distances, positions, settings, check)?;
            stiff::kept_stiff(&self.stiff, &self.shaped, &mut positions, false);
            stiff::moved_out(&self.bodies, &self.stiff, &distances, &mut positions);
        }
        Ok(self.given(&positions))
    }

    /// Distance to the skin that each of the garments' vertices keeps at least, in the target's units.
    ///
    /// # Errors
    /// [`Error::BadArgument`] as in [`Fitting::place`].
    pub fn gaps(&self, sitting: &Sitting) -> Result<Vec<f64>> {
        sitting.checked()?;
        let bound = self.bindings.iter().zip(self.is_stiff());
        let gaps: Vec<f64> = bound
            .map(|(b, stiff)| self.gap(b, stiff, sitting))
            .collect();
        Ok(self.given(&gaps))
    }

    /// The same of one place.
    fn gap(&self, binding: &Binding, stiff: bool, sitting: &Sitting) -> f64 {
        let height = self.bodies.heights[1];
        let clearance = binding.clearance * (1.0 - sitting.tightness);
        let gap = height * self.settings.gap(clearance / height) + sitting.distance.max(0.0);
        // What keeps its shape stays as deep in the body as it was, the lining of a hat, and is moved as a whole.
        if stiff {
            gap.min(binding.clearance)
        } else {
            gap
        }
    }

    /// Whether each place is of a piece that keeps its shape.
    fn is_stiff(&self) -> Vec<bool> {
        let mut stiff = vec![false; self.bindings.len()];
        for &v in self.stiff.iter().flatten() {
            stiff[v as usize] = true;
        }
        stiff
    }

    /// Distance of each of the garments' vertices to the target's skin, negative within the body.
    ///
    /// # Errors
    /// [`Error::BadArgument`] when there is not one position for each vertex.
    pub fn clearance(&self, positions: &[Point]) -> Result<Vec<f64>> {
        let places = self.places("vertices", positions)?;
        let target = &self.bodies.map.target;
        let found: Vec<f64> = places
            .par_iter()
            .zip(&self.bindings)
            .map(|(&p, b)| {
                let near = self.bodies.target.nearest(target, p, Some(b.anchor.face));
                near.distance
            })
            .collect();
        Ok(self.given(&found))
    }

    /// Distance of each of the garments' vertices to the source's skin, in the target's units, negative within the body.
    #[must_use]
    pub fn clearance_before(&self) -> Vec<f64> {
        let found: Vec<f64> = self.bindings.iter().map(|b| b.clearance).collect();
        self.given(&found)
    }

    /// Displacements of the garments' vertices on the source as on the target, J of each.
    ///
    /// # Errors
    /// [`Error::BadArgument`] when there is not one displacement for each vertex.
    pub fn displacements(&self, offsets: &[Point]) -> Result<Vec<Point>> {
        check_rows("offsets", offsets.len(), self.len())?;
        Ok(offsets
            .iter()
            .zip(&self.garment.place_of)
            .map(|(&d, &v)| times(&self.bindings[v as usize].frame.linear, d))
            .collect())
    }

    /// Which of the target's vertices the garments hide at these positions: under cloth at most `reach` above them, and
    /// at least `margin` from skin that shows, both in the target's units.
    ///
    /// # Errors
    /// [`Error::BadArgument`] when there is not one position for each vertex, or a length is not a number from 0.
    pub fn hidden(&self, positions: &[Point], reach: f64, margin: f64) -> Result<Vec<bool>> {
        for (name, length) in [("reach", reach), ("margin", margin)] {
            if !(length.is_finite() && length >= 0.0) {
                return Err(Error::BadArgument {
                    what: format!("`{name}` should be a finite number from 0, got {length}"),
                });
            }
        }
        let places = self.places("vertices", positions)?;
        hidden::hidden(&self.bodies, &self.garment, places, (reach, margin))
    }

    /// The map from the target's skin to the garments at these positions, by the anchors: what the skin carries, such as
    /// its weights, comes to the cloth along it.
    ///
    /// # Errors
    /// [`Error::BadArgument`] when there is not one position for each vertex, or the garments have no triangle.
    pub fn on_target(&self, positions: &[Point], triangles: &[[i64; 3]]) -> Result<SurfaceMap> {
        check_rows("vertices", positions.len(), self.len())?;
        let skin = &self.bodies.map.target;
        let wound: Vec<[i64; 3]> = skin.triangles.iter().map(|t| t.map(i64::from)).collect();
        let bound = self.garment.place_of.iter();
        let bound: Vec<&Binding> = bound.map(|&v| &self.bindings[v as usize]).collect();
        let faces: Vec<i64> = bound.iter().map(|b| i64::from(b.anchor.face)).collect();
        let weights: Vec<[f64; 3]> = bound.iter().map(|b| b.anchor.weights).collect();
        let trust = |b: &&Binding| {
            let corners = skin.triangles[b.anchor.face as usize];
            (0..3)
                .map(|k| b.anchor.weights[k] * self.bodies.map.confidence[corners[k] as usize])
                .sum()
        };
        SurfaceMap::new(
            Surface::new(skin.vertices.clone(), &wound)?,
            Surface::new(positions.to_vec(), triangles)?,
            &faces,
            &weights,
            bound.iter().map(trust).collect(),
        )
    }

    /// One of each place for every given vertex.
    fn given<T: Copy>(&self, of_places: &[T]) -> Vec<T> {
        let places = self.garment.place_of.iter();
        places.map(|&v| of_places[v as usize]).collect()
    }

    /// One of the given vertices for each place.
    fn places(&self, name: &str, given: &[Point]) -> Result<Vec<Point>> {
        check_rows(name, given.len(), self.len())?;
        let mut places = vec![[0.0; 3]; self.garment.places.len()];
        for (&v, &p) in self.garment.place_of.iter().zip(given) {
            places[v as usize] = p;
        }
        Ok(places)
    }
}

/// Pieces with a vertex that is said to be stiff, and those smaller than a size.
fn stiff_pieces(garment: &Garment, said: &[bool], size: f64) -> Vec<Vec<u32>> {
    let mut stiff = vec![false; garment.pieces];
    for (&v, &said) in garment.place_of.iter().zip(said) {
        stiff[garment.piece_of[v as usize] as usize] |= said;
    }
    let is_small = |piece: &[u32]| {
        let extent = [0, 1, 2].map(|c| {
            let along = piece.iter().map(|&v| garment.places[v as usize][c]);
            let (low, high) = along.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
                (low.min(x), high.max(x))
            });
            high - low
        });
        piece.len() > 2 && vector::norm(extent) < size
    };
    let pieces = garment.places_of_pieces().into_iter().zip(stiff);
    pieces
        .filter(|(piece, stiff)| *stiff || is_small(piece))
        .map(|(piece, _)| piece)
        .collect()
}
