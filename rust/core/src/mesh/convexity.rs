//! How much a surface bulges around each vertex.

use rayon::prelude::*;

use crate::algebra::vector::{self, Point};
use crate::mesh::settings::CONVEXITY;
use crate::mesh::{Adjacency, Mesh};

/// Vertices that one thread looks at in a row.
const VERTICES_AT_ONCE: usize = 256;

/// A surface at unit area, and what of it is at hand.
#[derive(Debug, Clone, Copy)]
pub struct Surface<'a> {
    /// Its vertices and faces.
    pub mesh: &'a Mesh,
    /// Unit vertex normals, `(n)`.
    pub normals: &'a [Point],
    /// +1 when they point outward.
    pub volume_sign: f64,
    /// Neighbours of each vertex.
    pub neighbours: &'a Adjacency,
    /// Areas, `(n)`.
    pub mass: &'a [f64],
}

impl Surface<'_> {
    /// How much the surface bulges around each vertex, 0 to 1: near 1 on a limb, near 0 in the crease between limb and
    /// trunk. It is looked at around vertices three edges apart; the others have the mean of those beside
    /// them, first those that are neighbours and then the rest.
    #[must_use]
    pub fn bulging(&self) -> Vec<f64> {
        let n = self.mesh.vertices.len();
        let (mut is_near, mut chosen) = (vec![false; n], Vec::new());
        for v in 0..n as u32 {
            if is_near[v as usize] {
                continue;
            }
            chosen.push(v);
            for &u in self.neighbours.row(v as usize) {
                is_near[u as usize] = true;
                for &w in self.neighbours.row(u as usize) {
                    is_near[w as usize] = true;
                }
            }
        }
        let blocks = chosen.par_chunks(VERTICES_AT_ONCE).flat_map_iter(|block| {
            // The last vertex around which each was looked at.
            let mut counted = vec![u32::MAX; n];
            let mut region = Vec::new();
            let around = move |&v: &u32| self.bulging_around(v, &mut counted, &mut region);
            block.iter().map(around)
        });
        let found: Vec<f64> = blocks.collect();
        let mut known = vec![None; n];
        for (&v, found) in chosen.iter().zip(found) {
            known[v as usize] = Some(found);
        }
        for _ in 0..2 {
            known = (0..n)
                .map(|v| known[v].or_else(|| self.mean_beside(v, &known)))
                .collect();
        }
        known.into_iter().flatten().collect()
    }

    /// Mean of what is known at the neighbours of a vertex.
    fn mean_beside(&self, v: usize, known: &[Option<f64>]) -> Option<f64> {
        let beside = self.neighbours.row(v).iter();
        let (sum, count) = beside
            .filter_map(|&u| known[u as usize])
            .fold((0.0, 0.0), |(sum, count), f| (sum + f, count + 1.0));
        (count > 0.0).then(|| sum / count)
    }

    /// The same at one vertex.
    fn bulging_around(&self, v: u32, counted: &mut [u32], region: &mut Vec<u32>) -> f64 {
        let (at, normals) = (&self.mesh.vertices, self.normals);
        let (here, normal) = (at[v as usize], normals[v as usize]);
        let near = |u: usize| {
            let off = vector::sub(at[u], here);
            vector::dot(off, off) < CONVEXITY.reach * CONVEXITY.reach
                && vector::dot(normals[u], normal) > CONVEXITY.other_side
        };
        region.clear();
        region.push(v);
        counted[v as usize] = v;
        let (mut next, mut area, mut height) = (0, 0.0, 0.0);
        while let Some(&u) = region.get(next) {
            next += 1;
            let mass = self.mass[u as usize];
            area += mass;
            height += mass * vector::dot(vector::sub(at[u as usize], here), normal);
            for &w in self.neighbours.row(u as usize) {
                if std::mem::replace(&mut counted[w as usize], v) != v && near(w as usize) {
                    region.push(w);
                }
            }
        }
        let height = self.volume_sign * height / (area * CONVEXITY.reach);
        1.0 / (1.0 + ((height - CONVEXITY.flat) / CONVEXITY.flat_width).exp())
    }
}

#[cfg(test)]
mod tests {
    use crate::algebra::vector::Point;
    use crate::testing::{RINGS, torus};

    #[test]
    fn the_outside_of_a_ring_bulges_and_its_inside_less() {
        let shape = torus(RINGS);
        let found = &shape.bulging;
        let radius = |p: Point| p[0].hypot(p[1]);
        let at = |pick: fn(f64, f64) -> f64, start: f64| {
            let radii = shape.mesh.vertices.iter().map(|&p| radius(p));
            let bound = radii.clone().fold(start, pick);
            let (sum, count) = radii.zip(found).fold((0.0, 0.0), |(sum, count), (r, f)| {
                if (r - bound).abs() < 1e-6 {
                    (sum + f, count + 1.0)
                } else {
                    (sum, count)
                }
            });
            sum / count
        };
        let (outside, inside) = (at(f64::max, 0.0), at(f64::min, f64::MAX));
        assert!(outside > inside, "{outside} {inside}");
        // Where both curvatures have one sign it is convex.
        assert!(outside > 0.5, "{outside}");
    }
}
