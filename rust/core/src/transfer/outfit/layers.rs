//! Layers of cloth over one another, which keep their order.

use rayon::prelude::*;

use super::garment::Garment;
use super::settings::Settings;
use crate::algebra::vector::{self, Point};
use crate::error::Result;
use crate::transfer::surface::Surface;

/// A place of a garment over or under a triangle of another piece.
#[derive(Debug, Clone, Copy)]
pub struct Contact {
    /// The place, and the corners of the triangle.
    pub places: [u32; 4],
    /// Factors whose sum over the places is the offset from the triangle to the place.
    pub factors: [f64; 4],
    /// 1 where the place is on the side to which the triangle's normal points, else −1.
    pub side: f64,
    /// Distance between them, in the source's units.
    pub gap: f64,
}

impl Contact {
    /// How far the place is on its side of the triangle, and the way out there.
    #[must_use]
    pub fn gap_at(&self, positions: &[Point]) -> (f64, Point) {
        let [p, a, b, c] = self.places.map(|v| positions[v as usize]);
        let cross = vector::cross(vector::sub(b, a), vector::sub(c, a));
        let out = vector::scaled(vector::normalised(cross), self.side);
        let corners = [p, a, b, c];
        let offset = (0..4).fold([0.0; 3], |sum, k| {
            vector::add(sum, vector::scaled(corners[k], self.factors[k]))
        });
        (vector::dot(offset, out), out)
    }
}

/// Places that lie over or under a triangle of another piece on a body of a height, each with the nearest.
///
/// # Errors
/// None beyond those of [`Surface::new`], which a checked garment satisfies.
pub fn contacts(garment: &Garment, height: f64, settings: &Settings) -> Result<Vec<Contact>> {
    if garment.triangles.is_empty() {
        return Ok(Vec::new());
    }
    let triangles: Vec<[i64; 3]> = garment.triangles.iter().map(|t| t.map(i64::from)).collect();
    let surface = Surface::new(garment.places.clone(), &triangles)?;
    let reach = settings.layer_reach * height;
    let of_piece = |t: u32| garment.piece_of[garment.triangles[t as usize][0] as usize];
    Ok((0..garment.places.len() as u32)
        .into_par_iter()
        .filter_map(|v| {
            let g = garment.places[v as usize];
            let own = garment.piece_of[v as usize];
            let near = surface.nearest_within(g, reach, |t| of_piece(t) != own)?;
            let offset = vector::sub(g, surface.position(&near));
            let gap = vector::norm(offset);
            let height = vector::dot(offset, vector::normalised(surface.cross(near.face)));
            if height.abs() < settings.layer_cosine * gap || gap <= 0.0 {
                return None;
            }
            let [a, b, c] = garment.triangles[near.face as usize];
            let [wa, wb, wc] = near.weights.map(|w| -w);
            Some(Contact {
                places: [v, a, b, c],
                factors: [1.0, wa, wb, wc],
                side: height.signum(),
                gap: height.abs(),
            })
        })
        .collect())
}
