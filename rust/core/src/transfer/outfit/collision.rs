//! Cloth out of the body and layers in their order: what is short of its distance is moved, and the cloth around it
//! goes with it.

use rayon::prelude::*;

use super::bodies::Bodies;
use super::equations::{Equations, Sums};
use super::garment::Garment;
use super::layers::Contact;
use super::outside::Nearest;
use super::settings::Settings;
use crate::algebra::vector::{self, Point};
use crate::error::Result;
use crate::transfer::settings::COLLISION;
use crate::watch::progress::Check;

/// What is kept of a place, in the target's units.
#[derive(Debug, Clone, Copy)]
pub struct Keep {
    /// Least distance to the body.
    pub gap: f64,
    /// The same of the edges and triangles that begin there, and when it is moved without its neighbours.
    pub least: f64,
    /// Distance to the body that it had on the source.
    pub clearance: f64,
    /// The way out of the body at its anchor.
    pub out: Point,
    /// The target's triangle with its anchor.
    pub face: u32,
}

/// Distances that are kept, in the target's units.
#[derive(Debug)]
pub struct Distances {
    /// Of each place.
    pub places: Vec<Keep>,
    /// From one layer to the next, of each contact.
    pub contacts: Vec<f64>,
    /// What is deeper in the body than this stays there.
    pub deepest: f64,
    /// What lies below skin that faces the other way and was further than this from there is not inside.
    pub doubt: f64,
}

/// A place, the middle of an edge or the centre of a triangle, and what is known of its distance to the body.
struct Probe<'a> {
    corners: &'a [u32],
    keep: Keep,
    /// Where it was when its distance was measured, and that distance.
    measured: Option<(Point, f64)>,
    /// How far it has to go, and where to.
    push: Option<Point>,
}

/// Moves places out of the target and layers off one another.
///
/// Rounds of `min tr DᵀLD + w|BD − n·need|² + ε|D|²` over the rows B of what is short of its distance by need: places,
/// middles of edges, centres of triangles and contacts, with the garment's Laplacian L. Edges at folds count more, and
/// take D to the shape that they had.
///
/// # Errors
/// [`NotFactorised`](crate::Error::NotFactorised), [`Cancelled`](crate::Error::Cancelled).
pub fn cleared(
    bodies: &Bodies,
    (garment, equations, contacts): (&Garment, &Equations, &[Contact]),
    distances: &Distances,
    mut positions: Vec<Point>,
    settings: &Settings,
    check: Check<'_>,
) -> Result<Vec<Point>> {
    let mut staying = equations.sums();
    for v in 0..positions.len() as u32 {
        staying.add(&[(v, 1.0)], settings.stay, [0.0; 3]);
    }
    let shaped = positions.clone();
    let singles: Vec<u32> = (0..positions.len() as u32).collect();
    let mut probes: Vec<Probe<'_>> = singles
        .iter()
        .map(std::slice::from_ref)
        .chain(garment.edges.iter().map(<[u32; 2]>::as_slice))
        .chain(garment.triangles.iter().map(<[u32; 3]>::as_slice))
        .map(|corners| Probe::new(corners, distances))
        .collect();
    for _ in 0..settings.rounds {
        check()?;
        probes
            .par_iter_mut()
            .for_each(|probe| probe.measure(bodies, distances, &positions));
        let mut sums = staying.clone();
        let pushed = push(&mut sums, &probes, settings)
            | part(&mut sums, contacts, distances, &positions, settings);
        if !pushed {
            break;
        }
        let folds = garment.folds(&positions, COLLISION.rings);
        for &[a, b] in &garment.edges {
            let [i, j] = [a, b].map(|v| v as usize);
            let (weight, back) = if folds[i] && folds[j] {
                let along = |of: &[Point]| vector::sub(of[j], of[i]);
                let back = vector::sub(along(&shaped), along(&positions));
                (settings.fold_push, back)
            } else {
                (1.0, [0.0; 3])
            };
            sums.add(&[(a, -1.0), (b, 1.0)], weight, back);
        }
        for (p, d) in positions.iter_mut().zip(sums.solved()?) {
            *p = vector::add(*p, d);
        }
    }
    // What is still short goes alone, to whichever side is nearest.
    positions
        .par_iter_mut()
        .zip(&distances.places)
        .for_each(|(p, keep)| {
            let target = &bodies.map.target;
            let near = bodies.target.nearest(target, *p, Some(keep.face));
            if near.distance < keep.least && near.distance >= -distances.deepest {
                let out = vector::scaled(near.normal, keep.least);
                *p = vector::add(target.position(&near.point), out);
            }
        });
    Ok(positions)
}

/// Adds the rows of probes that are too near to the body; whether there was one.
fn push(sums: &mut Sums<'_>, probes: &[Probe<'_>], settings: &Settings) -> bool {
    let mut found = false;
    for probe in probes {
        if let Some(push) = probe.push {
            let mut row = [(0, probe.share()); 3];
            for (entry, &v) in row.iter_mut().zip(probe.corners) {
                entry.0 = v;
            }
            sums.add(&row[..probe.corners.len()], settings.push, push);
            found = true;
        }
    }
    found
}

/// Adds the rows of layers that are too near to one another, or through one another; whether there was one.
fn part(
    sums: &mut Sums<'_>,
    contacts: &[Contact],
    distances: &Distances,
    positions: &[Point],
    settings: &Settings,
) -> bool {
    let mut found = false;
    for (contact, &kept) in contacts.iter().zip(&distances.contacts) {
        let (gap, out) = contact.gap_at(positions);
        if gap < kept && gap > -distances.deepest {
            let row = [0, 1, 2, 3].map(|k| (contact.places[k], contact.factors[k]));
            sums.add(&row, settings.push, vector::scaled(out, kept - gap));
            found = true;
        }
    }
    found
}

impl Distances {
    /// Whether a place that is too near to the body, or within it, is to leave.
    #[must_use]
    pub fn counts(&self, keep: &Keep, near: &Nearest) -> bool {
        let turned = near.distance < 0.0
            && vector::dot(near.normal, keep.out) < 0.0
            && keep.clearance - near.distance > self.doubt;
        near.distance >= -self.deepest && !turned
    }
}

impl<'a> Probe<'a> {
    fn new(corners: &'a [u32], distances: &Distances) -> Self {
        let first = distances.places[corners[0] as usize];
        let gap = if corners.len() == 1 {
            first.gap
        } else {
            first.least
        };
        Self {
            corners,
            keep: Keep { gap, ..first },
            measured: None,
            push: None,
        }
    }

    /// Share of each of its places.
    fn share(&self) -> f64 {
        1.0 / self.corners.len() as f64
    }

    fn measure(&mut self, bodies: &Bodies, distances: &Distances, positions: &[Point]) {
        let at = self.corners.iter().fold([0.0; 3], |sum, &v| {
            vector::add(sum, vector::scaled(positions[v as usize], self.share()))
        });
        self.push = None;
        if let Some((before, distance)) = self.measured
            && distance - vector::distance(before, at) >= self.keep.gap
        {
            return;
        }
        let target = &bodies.map.target;
        let near = bodies.target.nearest(target, at, Some(self.keep.face));
        self.keep.face = near.point.face;
        self.measured = Some((at, near.distance));
        let need = self.keep.gap - near.distance;
        if need > 0.0 && distances.counts(&self.keep, &near) {
            self.push = Some(vector::scaled(near.normal, need));
        }
    }
}
