//! Fingers are laid onto their own before the whole surface is drawn there.

use super::state::Refined;
use crate::algebra::vector::{self, Point};
use crate::error::Result;
use crate::matching::refinement::fingers::{Imaged, misplaced};
use crate::watch::progress::Check;

impl Refined<'_> {
    /// Gives the vertices of [`misplaced`] fingers and of those they belong to images on one another: the nearest
    /// ones, once the finger is moved with its tip onto the other's. The steps that follow do the rest.
    pub(super) fn set_fingers_right(&mut self, check: Check<'_>) -> Result<()> {
        let (moving, still) = (self.moving.shape, self.still.shape);
        let sides = [&self.moving, &self.still];
        if sides
            .iter()
            .any(|side| side.asking.len() < side.shape.mesh.vertices.len())
        {
            return Ok(());
        }
        let [own, other] = sides.map(|side| Imaged {
            shape: side.shape,
            images: &side.images.vertex,
        });
        let pairs = misplaced(own, other, self.lengths, check)?;
        let (here, there) = (moving.protrusions(), still.protrusions());
        for (p, q) in pairs {
            let place = |v: u32| still.mesh.vertices[v as usize];
            let (own, other) = (&here.vertices[p], &there.vertices[q]);
            let off = vector::sub(
                place(there.tips[q]),
                self.deformed_at(here.tips[p] as usize),
            );
            let moved = |&v: &u32| vector::add(self.deformed_at(v as usize), off);
            let own_at: Vec<Point> = own.iter().map(moved).collect();
            let other_at: Vec<Point> = other.iter().map(|&v| place(v)).collect();
            for (&v, &at) in own.iter().zip(&own_at) {
                self.moving.images.vertex[v as usize] = nearest(at, other, &other_at);
            }
            for (&v, &at) in other.iter().zip(&other_at) {
                self.still.images.vertex[v as usize] = nearest(at, own, &own_at);
            }
        }
        self.moving.answer_landmarks();
        self.still.answer_landmarks();
        Ok(())
    }
}

/// The vertex of some that lies nearest to a point, the first of them if there is only one.
fn nearest(point: Point, vertices: &[u32], places: &[Point]) -> u32 {
    let away = |place: &Point| vector::distance(*place, point);
    let found = vertices
        .iter()
        .zip(places)
        .min_by(|a, b| away(a.1).total_cmp(&away(b.1)));
    found.map_or(0, |(&v, _)| v)
}
