//! Cloth out of the body and layers in their order: what is short of its distance is moved, and the cloth around it
//! goes with it.

use rayon::prelude::*;

use super::Settings;
use super::bodies::Bodies;
use super::equations::Equations;
use super::garment::Garment;
use super::layers::Contact;
use crate::algebra::vector::{self, Point};
use crate::error::Result;

/// Distances that are kept, in the target's units.
#[derive(Debug)]
pub struct Distances {
    /// From the body, of each place.
    pub places: Vec<f64>,
    /// From one layer to the next, of each contact.
    pub contacts: Vec<f64>,
    /// From the body, of every place that was moved without its neighbours.
    pub least: f64,
    /// What is deeper in the body than this stays there.
    pub deepest: f64,
    pub out: Vec<Point>,
    pub clearance: Vec<f64>,
    pub doubt: f64,
}

/// A place, the middle of an edge or the centre of a triangle, and what is known of its distance to the body.
struct Probe<'a> {
    corners: &'a [u32],
    /// Least distance to the body.
    goal: f64,
    /// A triangle of the body that is probably near.
    guess: u32,
    /// Where it was when its distance was measured, and that distance.
    measured: Option<(Point, f64)>,
    /// How far it has to go, and where to.
    push: Option<Point>,
}

/// Moves places out of the target and layers off one another.
///
/// Rounds of `min tr DᵀLD + w|BD − n·need|² + ε|D|²` over the rows B of what is short of its distance by need: places,
/// middles of edges, centres of triangles and contacts, with the garment's Laplacian L.
///
/// # Errors
/// [`NotFactorised`](crate::Error::NotFactorised).
#[expect(
    clippy::too_many_arguments,
    reason = "what a garment is bound to, each from a stage of its own"
)]
pub fn cleared(
    bodies: &Bodies,
    garment: &Garment,
    equations: &Equations,
    contacts: &[Contact],
    distances: &Distances,
    guesses: &[u32],
    mut positions: Vec<Point>,
    settings: &Settings,
) -> Result<Vec<Point>> {
    let mut cloth = equations.sums();
    let shaped = positions.clone();
    for v in 0..positions.len() as u32 {
        cloth.add(&[(v, 1.0)], settings.push_ridge, [0.0; 3]);
    }
    let singles: Vec<u32> = (0..positions.len() as u32).collect();
    let mut probes: Vec<Probe<'_>> = singles
        .iter()
        .map(std::slice::from_ref)
        .chain(garment.edges.iter().map(<[u32; 2]>::as_slice))
        .chain(garment.triangles.iter().map(<[u32; 3]>::as_slice))
        .map(|corners| Probe {
            corners,
            goal: distances.of(corners),
            guess: guesses[corners[0] as usize],
            measured: None,
            push: None,
        })
        .collect();
    for _ in 0..settings.rounds {
        probes
            .par_iter_mut()
            .for_each(|probe| probe.measure(bodies, &positions, distances, settings));
        let mut sums = cloth.clone();
        let mut zone = super::shape::crumpled(garment, &positions);
        let before = zone.clone();
        for &[a, b] in &garment.edges {
            zone[a as usize] |= before[b as usize];
            zone[b as usize] |= before[a as usize];
        }
        for &[a, b] in &garment.edges {
            let [i, j] = [a, b].map(|v| v as usize);
            let inside = zone[i] && zone[j];
            // Crumpled cloth goes back to its shape, the rest keeps what it has.
            let rho = f64::from(u8::from(inside));
            let back = vector::sub(
                vector::sub(shaped[j], shaped[i]),
                vector::sub(positions[j], positions[i]),
            );
            sums.add(
                &[(a, -1.0), (b, 1.0)],
                if inside { settings.zone_weight } else { 1.0 },
                vector::scaled(back, rho),
            );
        }
        let mut pushed = false;
        for probe in &probes {
            if let Some(push) = probe.push {
                let share = 1.0 / probe.corners.len() as f64;
                let mut row = [(0, share); 3];
                for (entry, &v) in row.iter_mut().zip(probe.corners) {
                    entry.0 = v;
                }
                sums.add(&row[..probe.corners.len()], settings.push, push);
                pushed = true;
            }
        }
        for (contact, &goal) in contacts.iter().zip(&distances.contacts) {
            let (gap, out) = contact.gap_at(&positions);
            if gap < goal && gap > -distances.deepest {
                let row = [0, 1, 2, 3].map(|k| (contact.places[k], contact.factors[k]));
                sums.add(&row, settings.push_layers, vector::scaled(out, goal - gap));
                pushed = true;
            }
        }
        if !pushed {
            break;
        }
        for (p, d) in positions.iter_mut().zip(sums.solved()?) {
            *p = vector::add(*p, d);
        }
    }
    // What is still short goes alone.
    let count = positions.len();
    positions
        .par_iter_mut()
        .zip(&probes[..count])
        .for_each(|(p, probe)| {
            let target = &bodies.map.target;
            let near = bodies.target.nearest(target, *p, Some(probe.guess));
            if near.distance < distances.least && near.distance >= -distances.deepest {
                let out = vector::scaled(near.normal, distances.least);
                *p = vector::add(target.position(&near.point), out);
            }
        });
    Ok(positions)
}

impl Distances {
    /// Of a place, the middle of an edge or the centre of a triangle.
    fn of(&self, corners: &[u32]) -> f64 {
        match *corners {
            [v] => self.places[v as usize],
            _ => self.least,
        }
    }
}

impl Probe<'_> {
    fn measure(
        &mut self,
        bodies: &Bodies,
        positions: &[Point],
        distances: &Distances,
        settings: &Settings,
    ) {
        let deepest = distances.deepest;
        let first = self.corners[0] as usize;
        let share = 1.0 / self.corners.len() as f64;
        let at = self.corners.iter().fold([0.0; 3], |sum, &v| {
            vector::add(sum, vector::scaled(positions[v as usize], share))
        });
        self.push = None;
        if let Some((before, distance)) = self.measured
            && distance - vector::distance(before, at) >= self.goal
        {
            return;
        }
        let near = bodies
            .target
            .nearest(&bodies.map.target, at, Some(self.guess));
        self.guess = near.point.face;
        self.measured = Some((at, near.distance));
        if near.distance < self.goal
            && near.distance >= -deepest
            && !(near.distance < 0.0
                && vector::dot(near.normal, distances.out[first]) < settings.doubt_cos
                && distances.clearance[first] - near.distance > distances.doubt)
        {
            self.push = Some(vector::scaled(near.normal, self.goal - near.distance));
        }
    }
}
