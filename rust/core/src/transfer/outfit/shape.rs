//! The shape of the cloth: places that keep the offsets along edges, near to where each would go for itself.

use super::Settings;
use super::binding::{Binding, edge_offsets};
use super::equations::Equations;
use super::garment::Garment;
use crate::algebra::vector::{self, Point};
use crate::error::Result;

/// The least of `Σᵢⱼ |pⱼ − pᵢ − ½(Jᵢ + Jⱼ)(gⱼ − gᵢ)|² + Σ aᵢ |pᵢ − goalᵢ|²`.
///
/// # Errors
/// [`NotFactorised`](crate::Error::NotFactorised), which positive weights rule out but for overflow.
pub fn shaped(
    garment: &Garment,
    equations: &Equations,
    bindings: &[Binding],
    settings: &Settings,
) -> Result<Vec<Point>> {
    let offsets = edge_offsets(garment, bindings, settings);
    let mut hold: Vec<f64> = bindings
        .iter()
        .map(|b| settings.hold * b.tightness(settings))
        .collect();
    let solve = |hold: &[f64]| {
        let mut sums = equations.sums();
        for ((v, b), &hold) in (0..).zip(bindings).zip(hold) {
            sums.add(&[(v, 1.0)], hold, b.goal);
        }
        for (&[a, b], &offset) in garment.edges.iter().zip(&offsets) {
            sums.add(&[(a, -1.0), (b, 1.0)], 1.0, offset);
        }
        sums.solved()
    };
    let mut found = solve(&hold)?;
    for _ in 0..settings.crumple_rounds {
        let mut loose = crumpled(garment, &found);
        if !loose.contains(&true) {
            break;
        }
        for _ in 0..2 {
            let before = loose.clone();
            for &[a, b] in &garment.edges {
                loose[a as usize] |= before[b as usize];
                loose[b as usize] |= before[a as usize];
            }
        }
        for (h, _) in hold.iter_mut().zip(&loose).filter(|(_, l)| **l) {
            *h *= settings.crumple_hold;
        }
        found = solve(&hold)?;
    }
    Ok(found)
}

#[must_use]
pub fn crumpled(garment: &Garment, found: &[Point]) -> Vec<bool> {
    let mut at: std::collections::HashMap<(u32, u32), u32> = std::collections::HashMap::new();
    let mut marked = vec![false; found.len()];
    let normal = |p: &[Point], t: u32| {
        let [a, b, c] = garment.triangles[t as usize].map(|v| p[v as usize]);
        vector::normalised(vector::cross(vector::sub(b, a), vector::sub(c, a)))
    };
    for (t, corners) in (0..).zip(&garment.triangles) {
        for k in 0..3 {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            if let Some(&s) = at.get(&(a.min(b), a.max(b))) {
                let now = vector::dot(normal(found, t), normal(found, s));
                let before = vector::dot(normal(&garment.places, t), normal(&garment.places, s));
                if now < -0.2 && before > 0.0 {
                    for v in garment.triangles[t as usize]
                        .iter()
                        .chain(&garment.triangles[s as usize])
                    {
                        marked[*v as usize] = true;
                    }
                }
            }
            at.insert((a.min(b), a.max(b)), t);
        }
    }
    marked
}
