//! Small parts of a surface that stick out, as fingers, toes, ears and horns do.
//!
//! The mean distance of a point from all others rises towards every end of a body. Where the regions above two peaks
//! meet, going down, each has shown how far it sticks out.
//!
//! # Source
//! Hilaga, Shinagawa, Kohmura, Kunii, "Topology matching for fully automatic similarity estimation of 3D shapes", 2001,
//! for the mean distance; Edelsbrunner, Letscher, Zomorodian, "Topological persistence and simplification", 2002, for
//! peaks and where they meet.

use faer::MatRef;

use crate::mesh::Adjacency;
use crate::shape::settings::PROTRUSIONS;

/// The protrusions of a surface.
#[derive(Debug, Default)]
pub struct Protrusions {
    /// That of each vertex, if it lies on one.
    pub of_vertex: Vec<Option<usize>>,
    /// Farthest vertex of each.
    pub tips: Vec<u32>,
    /// Vertices of each, the tip first.
    pub vertices: Vec<Vec<u32>>,
}

impl Protrusions {
    /// Of a surface with these distances from samples to every vertex, `(n, s)`, areas and neighbours, at unit area.
    #[must_use]
    pub fn new(fields: MatRef<'_, f32>, mass: &[f64], neighbours: &Adjacency) -> Self {
        let height = mean_distances(fields);
        let mut found = Self {
            of_vertex: vec![None; mass.len()],
            ..Self::default()
        };
        for (tip, saddle) in peaks(&height, neighbours) {
            let Some(vertices) = region(tip, (&height, saddle), mass, neighbours) else {
                continue;
            };
            for &v in &vertices {
                found.of_vertex[v as usize] = Some(found.tips.len());
            }
            found.tips.push(tip);
            found.vertices.push(vertices);
        }
        found
    }

    /// How many there are.
    #[must_use]
    pub fn count(&self) -> usize {
        self.tips.len()
    }
}

fn mean_distances(fields: MatRef<'_, f32>) -> Vec<f32> {
    let mut sums = vec![0.0; fields.nrows()];
    for field in fields.col_iter() {
        for (sum, distance) in sums.iter_mut().zip(field.iter()) {
            *sum += distance;
        }
    }
    let count = fields.ncols() as f32;
    sums.into_iter().map(|sum| sum / count).collect()
}

/// Peaks that rise by the least height (`PROTRUSIONS.least_height`) above where they first meet another such, and how high that is.
fn peaks(height: &[f32], neighbours: &Adjacency) -> Vec<(u32, f32)> {
    let higher = |a: &u32, b: &u32| height[*b as usize].total_cmp(&height[*a as usize]);
    let mut order: Vec<u32> = (0..height.len() as u32).collect();
    order.sort_unstable_by(|a, b| higher(a, b).then(a.cmp(b)));
    // Regions above the present height are trees below their peaks.
    let mut parent: Vec<Option<u32>> = vec![None; height.len()];
    let mut has_met = vec![false; height.len()];
    let (mut found, mut around) = (Vec::new(), Vec::new());
    for v in order {
        let here = height[v as usize];
        around.clear();
        for &u in neighbours.row(v as usize) {
            if let Some(peak) = peak_of(&mut parent, u)
                && !around.contains(&peak)
            {
                around.push(peak);
            }
        }
        around.sort_unstable_by(higher);
        let own = around.first().copied().unwrap_or(v);
        parent[v as usize] = Some(own);
        for &peak in &around {
            parent[peak as usize] = Some(own);
        }
        let sticks_out = |&&peak: &&u32| height[peak as usize] - here >= PROTRUSIONS.least_height;
        if around.iter().filter(sticks_out).count() > 1 {
            let first_met = around.iter().filter(sticks_out);
            found.extend(
                first_met
                    .filter(|&&p| !has_met[p as usize])
                    .map(|&p| (p, here)),
            );
            has_met[own as usize] = true;
        }
    }
    found
}

/// The peak of the region a vertex lies in, if it is in one.
fn peak_of(parent: &mut [Option<u32>], mut v: u32) -> Option<u32> {
    let mut above = parent[v as usize]?;
    while above != v {
        let next = parent[above as usize]?;
        parent[v as usize] = Some(next);
        (v, above) = (above, next);
    }
    Some(v)
}

/// What hangs together with a peak above a height, if that is small (`PROTRUSIONS.largest`).
fn region(
    peak: u32,
    (height, above): (&[f32], f32),
    mass: &[f64],
    neighbours: &Adjacency,
) -> Option<Vec<u32>> {
    let mut is_known = vec![false; height.len()];
    is_known[peak as usize] = true;
    let (mut vertices, mut next, mut area) = (vec![peak], 0, 0.0);
    while let Some(&v) = vertices.get(next) {
        next += 1;
        area += mass[v as usize];
        if area > PROTRUSIONS.largest {
            return None;
        }
        for &u in neighbours.row(v as usize) {
            if height[u as usize] > above && !std::mem::replace(&mut is_known[u as usize], true) {
                vertices.push(u);
            }
        }
    }
    Some(vertices)
}

#[cfg(test)]
mod tests {
    use crate::testing::{self, RINGS, torus};

    #[test]
    fn spikes_are_found_and_nothing_else() {
        let shape = testing::spiked_torus();
        let found = shape.protrusions();
        let mut tips = found.tips.clone();
        tips.sort_unstable();
        assert_eq!(tips, testing::SPIKES);
        for (number, (tip, vertices)) in found.tips.iter().zip(&found.vertices).enumerate() {
            assert_eq!(vertices[0], *tip);
            let here = vertices.iter().map(|&v| found.of_vertex[v as usize]);
            assert!(here.into_iter().all(|of| of == Some(number)));
        }
        let on_spikes = found.of_vertex.iter().filter(|of| of.is_some()).count();
        assert_eq!(on_spikes, found.vertices.iter().map(Vec::len).sum());
        // Its thick side bulges, but not as a small part.
        assert_eq!(torus(RINGS).protrusions().count(), 0);
    }
}
