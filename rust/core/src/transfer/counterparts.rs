//! Pieces that were not matched as a whole (eyes, teeth, a tongue, lids, buttons) on their counterparts.
//!
//! The similarity of the matched surface around a piece P of the target takes it to the source. Let a, b be its centre there and
//! that of a piece Q of the source, r and s their root mean square radii, and δ(P, Q) the mean distance of the vertices of P from
//! the surface of Q once both have their centre at the origin and a radius of one. Q costs
//!
//! ‖a − b‖ / max(r, s) + κ·½(δ(P, Q) + δ(Q, P)),
//!
//! κ being `COUNTERPARTS.shape`. Pairs are taken in the order of their costs, each piece once. A piece for which none is left shares
//! the one that costs it least, as two rows of lashes share one. Where the surface around leads too far off for that, as on a head
//! under a beard, the pieces that have come to their counterparts lead the rest once more, as eyes lead brows.

use rayon::prelude::*;

use crate::algebra::similarity::Similarity;
use crate::algebra::stretch;
use crate::algebra::vector::{self, Point};
use crate::error::Result;
use crate::mesh::surface_point::SurfacePoint;
use crate::transfer::parts::components;
use crate::transfer::settings::COUNTERPARTS;
use crate::transfer::surface::Surface;
use crate::transfer::surface_map::SurfaceMap;

/// Vertices and triangles of a piece on its surface, ascending.
pub(crate) type Members = (Vec<u32>, Vec<u32>);

/// A connected piece of a surface.
pub(crate) struct Piece<'a> {
    /// Its vertices and triangles on the surface.
    vertices: &'a [u32],
    triangles: &'a [u32],
    centre: Point,
    /// Root mean square distance of the vertices from the centre.
    radius: f64,
    /// Itself, its centre at the origin and its radius one.
    normalised: Surface,
}

impl<'a> Piece<'a> {
    /// A piece whose vertices are moved; nothing where they are at one place.
    pub(crate) fn new(
        surface: &Surface,
        (vertices, triangles): &'a Members,
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
    pub(crate) fn cost(&self, other: &Self) -> Option<f64> {
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

    /// Where its vertices come to lie on another piece, on that piece's surface, stretched to its proportions.
    pub(crate) fn laid_on(&self, other: &Self) -> impl Iterator<Item = SurfacePoint> {
        let [own, theirs] = [self, other].map(|piece| stretch::moments(&piece.normalised.vertices));
        let stretch = stretch::between(&own, &theirs, COUNTERPARTS.thin);
        let laid = move |&place: &Point| {
            let goal = stretch.map(|row| vector::dot(row, place));
            other.on_surface(other.normalised.nearest(goal))
        };
        self.normalised.vertices.iter().map(laid)
    }

    /// Its point nearest to a place within a distance, in triangles of the surface for which `allowed` holds.
    pub(crate) fn nearest_within(
        &self,
        place: Point,
        distance: f64,
        allowed: impl Fn(u32) -> bool + Copy,
    ) -> Option<SurfacePoint> {
        let place = vector::scaled(vector::sub(place, self.centre), 1.0 / self.radius);
        let is_allowed = |own: u32| allowed(self.triangles[own as usize]);
        (self.normalised)
            .nearest_within(place, distance / self.radius, is_allowed)
            .map(|point| self.on_surface(point))
    }

    /// A point of itself as one of the surface that it is a piece of.
    fn on_surface(&self, SurfacePoint { face, weights }: SurfacePoint) -> SurfacePoint {
        SurfacePoint {
            face: self.triangles[face as usize],
            weights,
        }
    }
}

/// Centre and root mean square radius of some points.
pub(crate) fn extent(points: &[Point]) -> (Point, f64) {
    let share = 1.0 / points.len() as f64;
    let centre = vector::mean(points);
    let square = |&p: &Point| {
        let off = vector::sub(p, centre);
        share * vector::dot(off, off)
    };
    (centre, points.iter().map(square).sum::<f64>().sqrt())
}

/// The largest radius of a piece that is small beside its surface.
pub(crate) fn largest_small(surface: &Surface) -> f64 {
    let area: f64 = surface.vertex_areas().iter().sum();
    COUNTERPARTS.small * area.sqrt()
}

/// Mean distance of a surface's vertices from another.
fn distance_from(surface: &Surface, other: &Surface) -> f64 {
    let off = |&p: &Point| vector::distance(p, other.position(&other.nearest(p)));
    // Added up in their order, so that the number of threads does not matter.
    let offs: Vec<f64> = surface.vertices.par_iter().map(off).collect();
    offs.iter().sum::<f64>() / offs.len() as f64
}

/// The members of each of `count` pieces.
pub(crate) fn members(surface: &Surface, piece: &[u32], count: usize) -> Vec<Members> {
    let mut members = vec![(Vec::new(), Vec::new()); count];
    for (v, &c) in (0..).zip(piece) {
        members[c as usize].0.push(v);
    }
    for (t, corners) in (0..).zip(&surface.triangles) {
        members[piece[corners[0] as usize] as usize].1.push(t);
    }
    members
}

/// For each of some pieces the number of its counterpart among others, one that is not `taken` yet where there is one.
fn paired(pieces: &[Piece], others: &[Piece], taken: &mut [bool]) -> Vec<Option<usize>> {
    let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
    for (c, piece) in pieces.iter().enumerate() {
        let costs = others.iter().enumerate();
        pairs.extend(costs.filter_map(|(d, other)| Some((piece.cost(other)?, c, d))));
    }
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let mut found = vec![None; pieces.len()];
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
    /// The map with the target's loose pieces put onto their counterparts on the source.
    ///
    /// A piece is held by a source's piece on which more than `share` of its vertices have an image with any confidence, or, where
    /// it is not small, on which most of them have one; it is loose where none holds it. Its counterpart is one that holds nothing,
    /// sought by what is held around it, and where that leads to none by what has come to its counterpart. Without one it keeps the
    /// image it had.
    ///
    /// # Errors
    /// None beyond those of [`SurfaceMap::new`], which its own parts satisfy.
    pub fn on_counterparts(self, share: f64) -> Result<Self> {
        let (piece, count) = components(&self.target);
        let (source_piece, source_count) = components(&self.source);
        let own = members(&self.target, &piece, count);
        let holder = self.holders(&piece, &own, &source_piece, share);
        if !holder.contains(&None) || holder.iter().all(Option::is_none) {
            return Ok(self);
        }
        let mut holds = vec![false; source_count];
        for &d in holder.iter().flatten() {
            holds[d as usize] = true;
        }
        let held = (0..piece.len()).filter(|&v| holder[piece[v] as usize].is_some());
        let mut around: Vec<usize> = held.collect();
        let mut loose: Vec<&Members> = (own.iter().zip(holder))
            .filter(|(own, holder)| holder.is_none() && !own.1.is_empty())
            .map(|(own, _)| own)
            .collect();
        let mut others = Vec::new();
        let theirs = members(&self.source, &source_piece, source_count);
        for (own, holds) in theirs.iter().zip(holds) {
            if !holds {
                others.extend(Piece::new(&self.source, own, |p| p)?);
            }
        }
        let mut points = self.points.clone();
        let mut images = self.images().to_vec();
        let mut confidence = self.confidence.clone();
        let mut taken = vec![false; others.len()];
        // By what is held, then the rest by what has come to its counterpart: brows by the eyes, where the head is off.
        for _ in 0..2 {
            let mut pieces = Vec::new();
            for own in &loose {
                let there = self.surroundings(&own.0, &around, &images);
                pieces.extend(Piece::new(&self.target, own, |p| there.apply(p))?);
            }
            around.clear();
            for (piece, counterpart) in pieces.iter().zip(paired(&pieces, &others, &mut taken)) {
                let Some(counterpart) = counterpart.map(|d| &others[d]) else {
                    continue;
                };
                for (&v, point) in piece.vertices.iter().zip(piece.laid_on(counterpart)) {
                    points[v as usize] = point;
                    images[v as usize] = self.source.position(&point);
                    confidence[v as usize] = COUNTERPARTS.confidence;
                    around.push(v as usize);
                }
                loose.retain(|(vertices, _)| vertices.as_slice() != piece.vertices);
            }
            if around.is_empty() {
                break;
            }
        }
        let faces: Vec<i64> = points.iter().map(|p| i64::from(p.face)).collect();
        let weights: Vec<[f64; 3]> = points.iter().map(|p| p.weights).collect();
        Self::new(self.source, self.target, &faces, &weights, confidence)
    }

    /// For each piece of the target that of the source which holds it.
    fn holders(
        &self,
        piece: &[u32],
        members: &[Members],
        source_piece: &[u32],
        share: f64,
    ) -> Vec<Option<u32>> {
        let sure = (0..piece.len()).filter(|&v| self.confidence[v] > 0.0);
        let mut pairs: Vec<(u32, u32)> = sure
            .map(|v| {
                let corner = self.source.triangles[self.points[v].face as usize][0];
                (piece[v], source_piece[corner as usize])
            })
            .collect();
        pairs.sort_unstable();
        let mut most = vec![(0, None); members.len()];
        for same in pairs.chunk_by(|a, b| a == b) {
            let (c, d) = same[0];
            let (count, holder) = &mut most[c as usize];
            if same.len() > *count {
                (*count, *holder) = (same.len(), Some(d));
            }
        }
        let small = largest_small(&self.target);
        let is_held = |count: usize, own: &[u32]| {
            count as f64 > share * own.len() as f64 || extent(&self.target.places(own)).1 > small
        };
        (most.into_iter().zip(members))
            .map(|((count, holder), (own, _))| holder.filter(|_| is_held(count, own)))
            .collect()
    }

    /// The similarity from target to source of some vertices, those near a piece above all.
    fn surroundings(&self, piece: &[u32], around: &[usize], images: &[Point]) -> Similarity {
        let (centre, radius) = extent(&self.target.places(piece));
        let near = (around.iter())
            .map(|&v| vector::distance(self.target.vertices[v], centre))
            .fold(f64::INFINITY, f64::min);
        let width = radius + near;
        let pairs: Vec<(Point, Point, f64)> = (around.iter())
            .map(|&v| {
                let far = vector::distance(self.target.vertices[v], centre) / width;
                (self.target.vertices[v], images[v], (-far * far).exp())
            })
            .collect();
        Similarity::fitted(&pairs, self.mirrors())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{RINGS, torus_mesh};

    /// A ring, and two of such sizes beside it, so many of its extents from it.
    fn rings(beside: [(f64, f64); 2]) -> (Vec<Point>, Vec<[i64; 3]>) {
        let (ring, triangles) = torus_mesh(RINGS, &[], 0.0);
        let extent = vector::extent(&ring);
        let [second, third] = beside.map(|(size, away)| (size, away * extent));
        let (mut vertices, mut faces) = (Vec::new(), Vec::new());
        for (scale, x) in [(1.0, 0.0), second, third] {
            let first = vertices.len() as i64;
            let placed = |&p: &Point| vector::add(vector::scaled(p, scale), [x, 0.0, 0.0]);
            vertices.extend(ring.iter().map(placed));
            faces.extend(triangles.iter().map(|t| t.map(|v| v + first)));
        }
        (vertices, faces)
    }

    /// A map of rings to themselves, vertex to vertex.
    fn onto_itself(
        (vertices, faces): (Vec<Point>, Vec<[i64; 3]>),
        image: impl Fn(usize) -> usize,
        confidence: Vec<f64>,
    ) -> SurfaceMap {
        let corner = |v: usize| {
            let t = faces.iter().position(|t| t.contains(&(v as i64)));
            let t = t.expect("every vertex has a triangle");
            let weights = faces[t].map(|c| f64::from(u8::from(c == v as i64)));
            (t as i64, weights)
        };
        let (images, weights): (Vec<i64>, Vec<[f64; 3]>) =
            (0..vertices.len()).map(|v| corner(image(v))).unzip();
        let surface = || Surface::new(vertices.clone(), &faces).expect("a sound surface");
        SurfaceMap::new(surface(), surface(), &images, &weights, confidence).expect("a sound map")
    }

    /// A map of such rings, but for the second: a part of it lies on the first, the rest on the third.
    fn scattered(size: f64, on_the_first: f64) -> SurfaceMap {
        let rings = rings([(size, 2.0), (size, -2.0)]);
        let n = rings.0.len() / 3;
        let image = |v: usize| match v / n {
            1 if ((v - n) as f64) < on_the_first * n as f64 => v - n,
            1 => v + n,
            _ => v,
        };
        onto_itself(rings, image, vec![1.0; 3 * n])
    }

    /// Of a ring whose radius is 0.02 of the root of all areas.
    const SMALL: f64 = 0.05;

    fn off(map: &SurfaceMap) -> f64 {
        let offs =
            (map.target.vertices.iter().zip(map.images())).map(|(&a, &b)| vector::distance(a, b));
        offs.fold(0.0, f64::max)
    }

    #[test]
    fn a_piece_that_is_scattered_goes_as_a_whole_to_its_counterpart() {
        // The third is held by itself, so that the second is what is left.
        let put = scattered(SMALL, 0.5).on_counterparts(0.6).expect("a map");
        assert!(off(&put) < 1e-9);
        // What is held by one piece keeps its images, be it half of it, and so does what is large.
        for (size, on_the_first, share) in [(SMALL, 0.5, 0.0), (SMALL, 0.9, 0.6), (0.5, 0.5, 0.6)] {
            let kept = scattered(size, on_the_first);
            let images = kept.images().to_vec();
            let kept = kept.on_counterparts(share).expect("a map");
            assert_eq!(kept.images(), &images[..]);
        }
    }

    #[test]
    fn what_is_too_far_off_goes_by_a_piece_beside_it() {
        // The first is turned by one of its rings, by which the others come to lie an eighth of their distance off.
        let rings = rings([(0.7, 2.0), (0.3, 2.6)]);
        let n = rings.0.len() / 3;
        let around = n / RINGS;
        let image = |v: usize| if v < n { (v + around) % n } else { 0 };
        let known = (0..3 * n).map(|v| f64::from(u8::from(v < n))).collect();
        let put = onto_itself(rings, image, known)
            .on_counterparts(0.6)
            .expect("a map");
        for v in n..3 * n {
            let on = put.source.triangles[put.points[v].face as usize][0] as usize;
            assert_eq!(
                (on / n, put.confidence[v]),
                (v / n, COUNTERPARTS.confidence)
            );
        }
    }
}
