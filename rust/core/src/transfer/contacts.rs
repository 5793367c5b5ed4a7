//! What touches in a shape key of the source touches on the target.
//!
//! Displacements are carried point by point, so that an eye that is larger than the source's stays open in a blink, and a
//! smaller one is closed beyond its other lid. Let x and y be points of the source that face each other and that a key brings
//! together, v and w those of the target whose images they are. The key turns the gap g = y − x into g′, and h = w − v into
//! h′; what is left of it along its own direction shall be the same share,
//!
//! (h′·h) / ‖h‖² = (g′·g) / ‖g‖²,
//!
//! or less by `CONTACTS.overlap` at most. Both sides make up for what is missing in proportion to how far they move, so that a lower
//! lid that stands still stays still. The corrections c minimise Σ aᵢmᵢ‖cᵢ − tᵢ‖² + ℓ² Σ ½wᵢⱼ‖cᵢ − cⱼ‖² around the contacts,
//! t what a vertex is to make up for, m how closely its points meet, a areas, w cotangent weights and ℓ half an edge; they
//! end where the key ends, and at `CONTACTS.reach` gaps from the contacts. So keys that bring nothing together stay as they are,
//! copies stay exact, and keys whose contacts lie apart keep their sums. A piece that is not small and of which a key moves nothing
//! takes no part: a jaw that opens comes near the collar below it, and does not touch it.

use rayon::prelude::*;

use crate::algebra::conjugate_gradients::{self, Until};
use crate::algebra::space_tree::SpaceTree;
use crate::algebra::vector::{self, Point};
use crate::error::Result;
use crate::mesh::edge_weights::EdgeWeights;
use crate::mesh::surface_point::SurfacePoint;
use crate::transfer::counterparts::{Members, extent, largest_small, members};
use crate::transfer::parts::components;
use crate::transfer::settings::CONTACTS;
use crate::transfer::surface::{Surface, blend};
use crate::transfer::surface_map::{Joined, SurfaceMap, check_rows};

/// How well corrections are solved.
const UNTIL: Until = Until {
    residual: 1e-6,
    steps: 1000,
};

/// A vertex of the target at one side of a contact.
struct Contact {
    vertex: u32,
    /// What it is to make up for.
    missing: Point,
    /// 1 where its points meet, 0 at the share `CONTACTS.meets` of their gap.
    closeness: f64,
    gap: f64,
}

/// A key's displacements of the target's vertices `(n_target)`, `carried` from its displacements of the source's `(n_source)`,
/// corrected where it brings points of the source together.
///
/// # Errors
/// [`crate::Error::BadArgument`] when there is not one displacement for each vertex.
pub fn kept(map: &SurfaceMap, offsets: &[Point], carried: Vec<Point>) -> Result<Vec<Point>> {
    check_rows("offsets", offsets.len(), map.source.vertices.len())?;
    check_rows("carried", carried.len(), map.target.vertices.len())?;
    let (surface, Joined { class, first, .. }) = map.joined();
    let mut contacts = contacts(map, offsets, &carried);
    // Of vertices at one place, all of which move alike, the first speaks.
    contacts.retain_mut(|contact| {
        let own = class[contact.vertex as usize];
        let speaks = first[own as usize] == contact.vertex;
        contact.vertex = own;
        speaks
    });
    if contacts.is_empty() {
        return Ok(carried);
    }
    let moves: Vec<bool> = (first.iter())
        .map(|&v| carried[v as usize] != [0.0; 3])
        .collect();
    let corrections = corrections(surface, &contacts, &moves)?;
    let corrected = |(d, &class): (Point, &u32)| vector::add(d, corrections[class as usize]);
    Ok(carried.into_iter().zip(class).map(corrected).collect())
}

/// The piece of each of the source's vertices, and which pieces a key brings together with others: those of which it moves
/// something, and small ones that stand still, as teeth do. A chin only comes near to the coat below it.
fn taking_part<'a>(map: &'a SurfaceMap, offsets: &[Point], longest: f64) -> (&'a [u32], Vec<bool>) {
    let source = &map.source;
    let (piece, is_small) = map.source_pieces.get_or_init(|| {
        let (piece, count) = components(source);
        let small = largest_small(source);
        let is_small = |(vertices, _): &Members| extent(&source.places(vertices)).1 <= small;
        let is_small = members(source, &piece, count)
            .iter()
            .map(is_small)
            .collect();
        (piece, is_small)
    });
    let mut takes_part = is_small.clone();
    for (&d, &own) in offsets.iter().zip(piece) {
        takes_part[own as usize] |= vector::norm(d) > CONTACTS.least_gap / 4.0 * longest;
    }
    (piece, takes_part)
}

/// The target's vertices whose images meet another part of the source.
fn contacts(map: &SurfaceMap, offsets: &[Point], carried: &[Point]) -> Vec<Contact> {
    let source = &map.source;
    let longest = offsets.iter().map(|&d| vector::norm(d)).fold(0.0, f64::max);
    let moved: Vec<Point> = (source.vertices.iter().zip(offsets))
        .map(|(&p, &d)| vector::add(p, d))
        .collect();
    // A gap is at most what both sides move and what is left of it.
    let reach = 2.0 * longest * CONTACTS.meets / (1.0 - CONTACTS.meets);
    let moving = (moved.iter().zip(offsets))
        .filter(|(_, d)| vector::norm(**d) > CONTACTS.least_gap / 4.0 * longest)
        .map(|(p, _)| *p);
    let Some(within) = Room::around(moving, reach) else {
        return Vec::new();
    };
    let Some(in_key) = Part::of(&moved, &source.triangles, &within) else {
        return Vec::new();
    };
    let (piece, takes_part) = taking_part(map, offsets, longest);
    let normals = source.vertex_normals();
    let at = |from: &[Point], point: &SurfacePoint| {
        blend(
            source.triangles[point.face as usize].map(|v| from[v as usize]),
            point.weights,
        )
    };
    // Each vertex with the point of the source that its image meets.
    let meeting: Vec<(u32, SurfacePoint)> = (0..map.points.len() as u32)
        .into_par_iter()
        .filter_map(|v| {
            let own = &map.points[v as usize];
            let (x, there) = (at(&source.vertices, own), at(&moved, own));
            if !within.holds(there) {
                return None;
            }
            let normal = vector::normalised(at(&normals, own));
            let meets = |face: u32| {
                let (square, weights) = in_key.surface.to_triangle(there, face);
                let point = in_key.given(SurfacePoint { face, weights });
                let corner = source.triangles[point.face as usize][0];
                if !takes_part[piece[corner as usize] as usize] {
                    return false;
                }
                let gap = vector::sub(at(&source.vertices, &point), x);
                let length = vector::norm(gap);
                let other = vector::normalised(at(&normals, &point));
                length >= CONTACTS.least_gap * longest
                    && square.sqrt() < CONTACTS.meets * length
                    && vector::dot(gap, normal) > CONTACTS.facing * length
                    && vector::dot(gap, other) < -CONTACTS.facing * length
            };
            let met = in_key.surface.nearest_within(there, reach, meets)?;
            Some((v, in_key.given(met)))
        })
        .collect();
    let images = map.images();
    let ends = meeting.iter().map(|(_, point)| at(&source.vertices, point));
    let drawn =
        Room::around(ends, reach).and_then(|room| Part::of(images, &map.target.triangles, &room));
    let Some(drawn) = drawn else {
        return Vec::new();
    };
    let facing = if map.mirrors() { -1.0 } else { 1.0 };
    meeting
        .into_par_iter()
        .filter_map(|(vertex, met)| {
            let own = &map.points[vertex as usize];
            let (x, y) = (at(&source.vertices, own), at(&source.vertices, &met));
            let gap = vector::sub(y, x);
            let (dx, dy) = (at(offsets, own), at(offsets, &met));
            let outward = vector::scaled(source.cross(met.face), facing);
            let alike = |face: u32| vector::dot(drawn.surface.cross(face), outward) > 0.0;
            let square = vector::dot(gap, gap);
            let beside = CONTACTS.beside * square.sqrt();
            let partner = drawn.given(drawn.surface.nearest_within(y, beside, alike)?);
            let corners = map.target.triangles[partner.face as usize];
            let of = |from: &[Point]| blend(corners.map(|v| from[v as usize]), partner.weights);
            let v = vertex as usize;
            let own_gap = vector::sub(of(&map.target.vertices), map.target.vertices[v]);
            let own_square = vector::dot(own_gap, own_gap);
            let (first, second) = (vector::norm(dx), vector::norm(dy));
            if own_square == 0.0 || first + second == 0.0 {
                return None;
            }
            let closed = vector::sub(dx, dy);
            let own_closed = vector::sub(carried[v], of(carried));
            let open =
                vector::dot(closed, gap) / square - vector::dot(own_closed, own_gap) / own_square;
            let missing = open.max(0.0) + (open + CONTACTS.overlap).min(0.0);
            let left = vector::norm(vector::sub(gap, closed)) / square.sqrt();
            Some(Contact {
                vertex,
                missing: vector::scaled(own_gap, missing * first / (first + second)),
                closeness: (1.0 - left / CONTACTS.meets).max(0.0),
                gap: own_square.sqrt(),
            })
        })
        .collect()
}

/// Smooth corrections around the contacts, of the vertices that move.
fn corrections(target: &Surface, contacts: &[Contact], moves: &[bool]) -> Result<Vec<Point>> {
    let mut corrections = vec![[0.0; 3]; target.vertices.len()];
    let places: Vec<Point> = (contacts.iter())
        .map(|c| target.vertices[c.vertex as usize])
        .collect();
    let tree = SpaceTree::new(places.as_slice());
    let widest = contacts.iter().map(|c| c.gap).fold(0.0, f64::max);
    let Some(room) = Room::around(places.iter().copied(), CONTACTS.reach * widest) else {
        return Ok(corrections);
    };
    let is_free: Vec<bool> = (target.vertices.par_iter().zip(moves))
        .map(|(&p, &moves)| {
            moves
                && room.holds(p)
                && tree.nearest(p).is_some_and(|c| {
                    vector::distance(p, places[c as usize])
                        < CONTACTS.reach * contacts[c as usize].gap
                })
        })
        .collect();
    // The triangles around free vertices, numbered for themselves.
    let mut number = vec![u32::MAX; target.vertices.len()];
    let mut vertices = Vec::new();
    let mut triangles = Vec::new();
    for corners in &target.triangles {
        if corners.iter().any(|&v| is_free[v as usize]) {
            triangles.push(corners.map(|v| {
                let own = &mut number[v as usize];
                if *own == u32::MAX {
                    *own = vertices.len() as u32;
                    vertices.push(v);
                }
                *own
            }));
        }
    }
    let rest = target.places(&vertices);
    let edges = EdgeWeights::new(&rest, &triangles);
    let mut areas = vec![0.0; rest.len()];
    for corners in &triangles {
        let [a, b, c] = corners.map(|v| rest[v as usize]);
        let cross = vector::cross(vector::sub(b, a), vector::sub(c, a));
        for &v in corners {
            areas[v as usize] += vector::norm(cross) / 6.0;
        }
    }
    let mut held = vec![0.0; rest.len()];
    let mut right = vec![[0.0; 3]; rest.len()];
    let (mut area, mut count) = (0.0, 0.0);
    for contact in contacts.iter().filter(|c| is_free[c.vertex as usize]) {
        let v = number[contact.vertex as usize] as usize;
        held[v] = areas[v] * contact.closeness;
        right[v] = vector::scaled(contact.missing, held[v]);
        area += areas[v];
        count += 1.0;
    }
    if count == 0.0 {
        return Ok(corrections);
    }
    // A vertex has about the square of an edge.
    let square = CONTACTS.averaged_over * CONTACTS.averaged_over * area / count;
    let diagonal: Vec<f64> = (0..rest.len())
        .map(|v| held[v] + square * edges.row(v).map(|(_, w)| w).sum::<f64>())
        .collect();
    let free = |v: usize| is_free[vertices[v] as usize];
    let apply = |u: &[Point]| -> Vec<Point> {
        (0..u.len())
            .map(|v| {
                let mut sum = vector::scaled(u[v], diagonal[v]);
                if free(v) {
                    for (other, w) in edges.row(v).filter(|&(other, _)| free(other as usize)) {
                        sum = vector::sub(sum, vector::scaled(u[other as usize], square * w));
                    }
                }
                sum
            })
            .collect()
    };
    let precondition = |u: &[Point]| -> Vec<Point> {
        let rows = u.iter().zip(&diagonal);
        rows.map(|(&row, &d)| vector::scaled(row, 1.0 / d.max(f64::MIN_POSITIVE)))
            .collect()
    };
    let start = vec![[0.0; 3]; rest.len()];
    let found = conjugate_gradients::solved(apply, precondition, &right, start, UNTIL, &|| Ok(()))?;
    for (&v, correction) in vertices.iter().zip(found) {
        if is_free[v as usize] {
            corrections[v as usize] = correction;
        }
    }
    Ok(corrections)
}

/// A box in space.
struct Room {
    low: Point,
    high: Point,
}

impl Room {
    /// What lies within a margin around some points; nothing where there are none.
    fn around(points: impl Iterator<Item = Point>, margin: f64) -> Option<Self> {
        let mut room = Self {
            low: [f64::INFINITY; 3],
            high: [f64::NEG_INFINITY; 3],
        };
        for p in points {
            for (c, x) in p.into_iter().enumerate() {
                room.low[c] = room.low[c].min(x - margin);
                room.high[c] = room.high[c].max(x + margin);
            }
        }
        (room.low[0] <= room.high[0]).then_some(room)
    }

    fn holds(&self, p: Point) -> bool {
        (0..3).all(|c| self.low[c] <= p[c] && p[c] <= self.high[c])
    }
}

/// The triangles of a surface that come into a room.
struct Part {
    surface: Surface,
    triangle: Vec<u32>,
}

impl Part {
    fn of(vertices: &[Point], triangles: &[[u32; 3]], room: &Room) -> Option<Self> {
        let inside: Vec<bool> = vertices.iter().map(|&p| room.holds(p)).collect();
        let (triangle, corners): (Vec<u32>, Vec<[i64; 3]>) = (0u32..)
            .zip(triangles)
            .filter(|(_, corners)| corners.iter().any(|&v| inside[v as usize]))
            .map(|(t, corners)| (t, corners.map(i64::from)))
            .unzip();
        // Of finite places and with corners that exist, so that only an empty one is refused.
        let surface = Surface::new(vertices.to_vec(), &corners).ok()?;
        Some(Self { surface, triangle })
    }

    /// A point of this part as one of the whole surface.
    fn given(&self, point: SurfacePoint) -> SurfacePoint {
        SurfacePoint {
            face: self.triangle[point.face as usize],
            ..point
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transfer::displacement::displacements;

    /// Rows of vertices of a plate.
    const SIDE: usize = 17;

    /// Two square plates of side 2 that face each other across a gap.
    fn plates(gap: f64) -> Surface {
        let mut vertices = Vec::new();
        let mut triangles = Vec::new();
        for plate in 0..2 {
            let first = vertices.len() as i64;
            for i in 0..SIDE * SIDE {
                let [x, y] = [i % SIDE, i / SIDE].map(|k| 2.0 * k as f64 / (SIDE - 1) as f64 - 1.0);
                vertices.push([x, y, gap * f64::from(plate)]);
            }
            for i in 0..(SIDE - 1) * (SIDE - 1) {
                let a = first + ((i / (SIDE - 1)) * SIDE + i % (SIDE - 1)) as i64;
                let [b, c, d] = [a + 1, a + SIDE as i64 + 1, a + SIDE as i64];
                for [p, q, r] in [[a, b, c], [a, c, d]] {
                    triangles.push(if plate == 0 { [p, q, r] } else { [p, r, q] });
                }
            }
        }
        Surface::new(vertices, &triangles).expect("a sound surface")
    }

    /// From plates to plates, vertex to vertex.
    fn onto(source: f64, target: f64) -> SurfaceMap {
        let (source, target) = (plates(source), plates(target));
        let n = target.vertices.len();
        let (mut faces, mut weights) = (vec![0; n], vec![[0.0; 3]; n]);
        for (t, corners) in source.triangles.iter().enumerate() {
            for k in 0..3 {
                faces[corners[k] as usize] = t as i64;
                weights[corners[k] as usize] = [0.0; 3];
                weights[corners[k] as usize][k] = 1.0;
            }
        }
        SurfaceMap::new(source, target, &faces, &weights, vec![1.0; n]).expect("a sound map")
    }

    /// The second plate pressed down around its middle by this much, the first drawn aside at a corner.
    fn pressed(by: f64) -> Vec<Point> {
        let plates = plates(1.0);
        let down = |&[x, y, z]: &Point| {
            let near = (1.0 - (x * x + y * y) / 0.7).max(0.0);
            [0.0, 0.0, if z > 0.0 { -by * near.sqrt() } else { 0.0 }]
        };
        let mut offsets: Vec<Point> = plates.vertices.iter().map(down).collect();
        offsets[0] = [-0.1, -0.1, 0.0];
        offsets
    }

    const MIDDLE: usize = SIDE * SIDE + SIDE * SIDE / 2;

    #[test]
    fn a_gap_of_another_width_closes_to_the_same_share() {
        // Of a gap of half the size as much more is closed as may overlap.
        for (gap, pressing, wanted) in [
            (1.5, 0.98, 0.98),
            (1.5, 1.02, 1.02),
            (0.5, 0.98, 0.98 + CONTACTS.overlap),
            (0.9, 0.98, 0.98 / 0.9),
        ] {
            let map = onto(1.0, gap);
            let offsets = pressed(pressing);
            let carried = displacements(&map, &offsets, false).expect("a row each");
            assert!((carried[MIDDLE][2] + pressing).abs() < 1e-9);
            let kept = kept(&map, &offsets, carried.clone()).expect("a row each");
            // Averaged over half an edge, a fourteenth of the way over which the correction fades.
            let share = -kept[MIDDLE][2] / gap;
            assert!((share - wanted).abs() < 0.02, "{gap}: {share}");
            // What the key leaves in its place stays there exactly.
            for (d, before) in kept.iter().zip(&carried) {
                assert!(*before != [0.0; 3] || *d == [0.0; 3]);
            }
        }
    }

    #[test]
    fn a_large_piece_that_stands_still_is_only_come_near() {
        let map = onto(1.0, 1.5);
        let mut offsets = pressed(0.98);
        offsets[0] = [0.0; 3];
        let carried = displacements(&map, &offsets, false).expect("a row each");
        let same = kept(&map, &offsets, carried.clone()).expect("a row each");
        assert_eq!(same, carried);
    }

    #[test]
    fn copies_and_keys_that_bring_nothing_together_stay() {
        let map = onto(1.0, 1.0);
        let offsets = pressed(0.98);
        let carried = displacements(&map, &offsets, false).expect("a row each");
        let same = kept(&map, &offsets, carried.clone()).expect("a row each");
        for (d, before) in same.iter().zip(&carried) {
            assert!(vector::distance(*d, *before) < 1e-12);
        }
        let map = onto(1.0, 1.5);
        for by in [0.5, -0.98] {
            let offsets = pressed(by);
            let carried = displacements(&map, &offsets, false).expect("a row each");
            let same = kept(&map, &offsets, carried.clone()).expect("a row each");
            assert_eq!(same, carried);
        }
    }
}
