//! Pieces that were not matched (eyes, teeth, a tongue, buttons) on their counterparts.
//!
//! The similarity of the matched surface around a piece P of the target takes it to the source. Let a, b be its centre there and
//! that of a piece Q of the source, r and s their root mean square radii, and δ(P, Q) the mean distance of the vertices of P from
//! the surface of Q once both have their centre at the origin and a radius of one. Q costs
//!
//! ‖a − b‖ / max(r, s) + κ·½(δ(P, Q) + δ(Q, P)),
//!
//! κ being `COUNTERPARTS.shape`. Pairs are taken in the order of their costs, each piece once. A piece for which none is left shares
//! the one that costs it least, as two rows of lashes share one.

use crate::algebra::similarity::Similarity;
use crate::algebra::vector::{self, Point};
use crate::error::Result;
use crate::mesh::surface_point::SurfacePoint;
use crate::transfer::parts::components;
use crate::transfer::settings::COUNTERPARTS;
use crate::transfer::surface::Surface;
use crate::transfer::surface_map::SurfaceMap;

/// A connected piece of a surface.
struct Piece {
    /// Its vertices and triangles on the surface.
    vertices: Vec<u32>,
    triangles: Vec<u32>,
    centre: Point,
    /// Root mean square distance of the vertices from the centre.
    radius: f64,
    /// Itself, its centre at the origin and its radius one.
    normalised: Surface,
}

impl Piece {
    /// A piece whose vertices are moved; nothing where they are at one place.
    fn new(
        surface: &Surface,
        (vertices, triangles): (Vec<u32>, Vec<u32>),
        moved: impl Fn(Point) -> Point,
    ) -> Result<Option<Self>> {
        let places: Vec<Point> = (vertices.iter())
            .map(|&v| moved(surface.vertices[v as usize]))
            .collect();
        let (centre, radius) = extent(&places);
        if radius <= 0.0 || triangles.is_empty() {
            return Ok(None);
        }
        let own = |v: u32| vertices.partition_point(|&w| w < v) as i64;
        let corners: Vec<[i64; 3]> = (triangles.iter())
            .map(|&t| surface.triangles[t as usize].map(own))
            .collect();
        let normalised = (places.iter())
            .map(|&p| vector::scaled(vector::sub(p, centre), 1.0 / radius))
            .collect();
        Ok(Some(Self {
            normalised: Surface::new(normalised, &corners)?,
            vertices,
            triangles,
            centre,
            radius,
        }))
    }

    /// What another piece costs as the counterpart of this one; nothing where it is too far away, too large or too small, or
    /// costs too much.
    fn cost(&self, other: &Self) -> Option<f64> {
        let ratio = self.radius / other.radius;
        let offset = vector::distance(self.centre, other.centre) / self.radius.max(other.radius);
        if ratio.max(1.0 / ratio) > COUNTERPARTS.largest_ratio
            || offset > COUNTERPARTS.largest_offset
        {
            return None;
        }
        let (own, theirs) = (&self.normalised, &other.normalised);
        let unlike = f64::midpoint(distance_from(own, theirs), distance_from(theirs, own));
        let cost = offset + COUNTERPARTS.shape * unlike;
        (cost <= COUNTERPARTS.largest_cost).then_some(cost)
    }
}

/// Centre and root mean square radius of some points.
fn extent(points: &[Point]) -> (Point, f64) {
    let share = 1.0 / points.len() as f64;
    let centre = vector::mean(points);
    let square = |&p: &Point| {
        let off = vector::sub(p, centre);
        share * vector::dot(off, off)
    };
    (centre, points.iter().map(square).sum::<f64>().sqrt())
}

/// Mean distance of a surface's vertices from another.
fn distance_from(surface: &Surface, other: &Surface) -> f64 {
    let off = |&p: &Point| vector::distance(p, other.position(&other.nearest(p)));
    surface.vertices.iter().map(off).sum::<f64>() / surface.vertices.len() as f64
}

/// Vertices and triangles of each of `count` pieces, ascending.
fn members(surface: &Surface, piece: &[u32], count: usize) -> Vec<(Vec<u32>, Vec<u32>)> {
    let mut members = vec![(Vec::new(), Vec::new()); count];
    for (v, &c) in (0..).zip(piece) {
        members[c as usize].0.push(v);
    }
    for (t, corners) in (0..).zip(&surface.triangles) {
        members[piece[corners[0] as usize] as usize].1.push(t);
    }
    members
}

/// For each of some pieces the number of its counterpart among others.
fn paired(pieces: &[Piece], others: &[Piece]) -> Vec<Option<usize>> {
    let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
    for (c, piece) in pieces.iter().enumerate() {
        let costs = others.iter().enumerate();
        pairs.extend(costs.filter_map(|(d, other)| Some((piece.cost(other)?, c, d))));
    }
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let mut found = vec![None; pieces.len()];
    let mut taken = vec![false; others.len()];
    for &(_, c, d) in &pairs {
        if found[c].is_none() && !taken[d] {
            (found[c], taken[d]) = (Some(d), true);
        }
    }
    for &(_, c, d) in &pairs {
        found[c].get_or_insert(d);
    }
    found
}

impl SurfaceMap {
    /// The map with the target's unmatched pieces put onto their counterparts on the source.
    ///
    /// A piece is unmatched when no vertex of it has any confidence; its counterpart is one that nothing matched lies on. Without
    /// one it keeps the image it had.
    ///
    /// # Errors
    /// None beyond those of [`SurfaceMap::new`], which its own parts satisfy.
    pub fn on_counterparts(self) -> Result<Self> {
        let (piece, count) = components(&self.target);
        let mut matched = vec![false; count];
        for (v, &c) in self.confidence.iter().enumerate() {
            matched[piece[v] as usize] |= c > 0.0;
        }
        if !matched.contains(&false) || !matched.contains(&true) {
            return Ok(self);
        }
        let (source_piece, source_count) = components(&self.source);
        let mut taken = vec![false; source_count];
        for (v, point) in self.points.iter().enumerate() {
            if matched[piece[v] as usize] {
                let corner = self.source.triangles[point.face as usize][0];
                taken[source_piece[corner as usize] as usize] = true;
            }
        }
        let around: Vec<usize> = (0..piece.len())
            .filter(|&v| matched[piece[v] as usize])
            .collect();
        let mut pieces = Vec::new();
        for (own, matched) in members(&self.target, &piece, count)
            .into_iter()
            .zip(matched)
        {
            if !matched && !own.1.is_empty() {
                let there = self.surroundings(&own.0, &around);
                pieces.extend(Piece::new(&self.target, own, |p| there.apply(p))?);
            }
        }
        let mut others = Vec::new();
        let members = members(&self.source, &source_piece, source_count);
        for (own, taken) in members.into_iter().zip(taken) {
            if !taken {
                others.extend(Piece::new(&self.source, own, |p| p)?);
            }
        }
        let mut points = self.points.clone();
        let mut confidence = self.confidence.clone();
        for (piece, counterpart) in pieces.iter().zip(paired(&pieces, &others)) {
            let Some(counterpart) = counterpart.map(|d| &others[d]) else {
                continue;
            };
            for (&v, &goal) in piece.vertices.iter().zip(&piece.normalised.vertices) {
                let SurfacePoint { face, weights } = counterpart.normalised.nearest(goal);
                let face = counterpart.triangles[face as usize];
                points[v as usize] = SurfacePoint { face, weights };
                confidence[v as usize] = COUNTERPARTS.confidence;
            }
        }
        let faces: Vec<i64> = points.iter().map(|p| i64::from(p.face)).collect();
        let weights: Vec<[f64; 3]> = points.iter().map(|p| p.weights).collect();
        Self::new(self.source, self.target, &faces, &weights, confidence)
    }

    /// The similarity from target to source of some vertices, those near a piece above all.
    fn surroundings(&self, piece: &[u32], around: &[usize]) -> Similarity {
        let place = |&v: &u32| self.target.vertices[v as usize];
        let (centre, radius) = extent(&piece.iter().map(place).collect::<Vec<_>>());
        let near = (around.iter())
            .map(|&v| vector::distance(self.target.vertices[v], centre))
            .fold(f64::INFINITY, f64::min);
        let width = radius + near;
        let pairs: Vec<(Point, Point, f64)> = (around.iter())
            .map(|&v| {
                let far = vector::distance(self.target.vertices[v], centre) / width;
                (
                    self.target.vertices[v],
                    self.images()[v],
                    (-far * far).exp(),
                )
            })
            .collect();
        Similarity::fitted(&pairs, self.mirrors())
    }
}
