//! A soup at the size and place at which envelopes are made.

use super::place::Place;
use crate::algebra::vector::Point;
use crate::error::{Error, Result};

/// A soup of largest extent 1 about the origin.
pub(super) struct Scaled {
    pub places: Vec<Place>,
    centre: Point,
    unit: f64,
}

impl Scaled {
    pub fn of(vertices: &[Point], faces: &[[u32; 3]]) -> Result<Self> {
        let empty = Error::EmptyMesh {
            vertices: vertices.len(),
            faces: faces.len(),
        };
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for (face, corners) in faces.iter().enumerate() {
            for &v in corners {
                let p = vertices.get(v as usize).ok_or(Error::FaceIndexOutOfRange {
                    face,
                    index: i64::from(v),
                    vertices: vertices.len(),
                })?;
                if !p.iter().all(|x| x.is_finite()) {
                    return Err(Error::NotFinite { vertex: v as usize });
                }
                low = [0, 1, 2].map(|i| low[i].min(p[i]));
                high = [0, 1, 2].map(|i| high[i].max(p[i]));
            }
        }
        // Halves, since the difference of the largest numbers overflows.
        let unit = (0..3)
            .map(|i| high[i] / 2.0 - low[i] / 2.0)
            .fold(0.0, f64::max)
            * 2.0;
        if faces.is_empty() || unit <= 0.0 || !unit.is_finite() {
            return Err(empty);
        }
        let centre = [0, 1, 2].map(|i| low[i] / 2.0 + high[i] / 2.0);
        let place = |p: &Point| [0, 1, 2].map(|i| (p[i] / unit - centre[i] / unit) as f32);
        Ok(Self {
            places: vertices.iter().map(place).collect(),
            centre,
            unit,
        })
    }

    pub fn given(&self, place: Place) -> Point {
        [0, 1, 2].map(|i| self.centre[i] + self.unit * f64::from(place[i]))
    }
}
