//! Pieces of a mesh that are copies of another's: the same triangles, moved, turned, scaled, posed by a rig, their vertices and
//! triangles in another order.
//!
//! One triangle is laid onto a similar one, and then triangle after triangle across their edges. A piece whose triangles all come
//! to lie on others is a copy where its edges are the other's in one ratio: all of them, or the most where it is bent at joints.
//! Its vertices answer to those of the other exactly. O(n log n).

use rayon::prelude::*;

use super::Adjacency;
use crate::algebra::vector::{self, Point};
use crate::error::Result;
use crate::mesh::settings::COPIES;
use crate::watch::progress::Check;

/// No vertex.
const NONE: u32 = u32::MAX;

/// Vertices and triangles, of one piece or many.
#[derive(Debug, Clone, Copy)]
pub struct Triangles<'a> {
    /// Positions, `(n)`.
    pub vertices: &'a [Point],
    /// Corners, `(m)`.
    pub faces: &'a [[u32; 3]],
}

/// The vertex that another is a copy of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Original {
    /// Its number.
    pub vertex: u32,
    /// Whether no other would do.
    pub is_only: bool,
}

/// The source's vertex of each target vertex whose piece is a copy. Of several ways the one is taken that keeps most edges, and of
/// these the one nearest to the `images` of the target's vertices where these are known. `mirrored` are copies whose triangles are
/// wound the other way round.
///
/// # Errors
/// [`crate::Error::Cancelled`].
pub fn originals(
    source: Triangles<'_>,
    target: Triangles<'_>,
    images: Option<&[Point]>,
    mirrored: bool,
    check: Check<'_>,
) -> Result<Vec<Option<Original>>> {
    let mut found = vec![None; target.vertices.len()];
    if source.faces.len() < COPIES.fewest_faces {
        return Ok(found);
    }
    let similar = Similar::new(source);
    let mut search = Search {
        source: Side::new(source),
        target: Side::new(target),
        mirrored,
        same: COPIES.same * vector::extent(target.vertices),
        image: vec![NONE; target.vertices.len()],
        taken: vec![false; source.vertices.len()],
        laid: vec![false; target.faces.len()],
        is_original: vec![false; source.vertices.len()],
    };
    for piece in search.pieces() {
        check()?;
        if piece.len() < COPIES.fewest_faces || piece.len() > source.faces.len() {
            continue;
        }
        let seeds = search.rarest(&piece, &similar);
        let Some((best, is_only)) = seeds
            .into_iter()
            .find_map(|seed| search.best(seed, piece.len(), &similar, images))
        else {
            continue;
        };
        for (v, vertex) in best.images {
            search.is_original[vertex as usize] = true;
            found[v as usize] = Some(Original { vertex, is_only });
        }
    }
    Ok(found)
}

/// A mesh and the faces around its vertices.
struct Side<'a> {
    mesh: Triangles<'a>,
    vertex_faces: Adjacency,
}

impl<'a> Side<'a> {
    fn new(mesh: Triangles<'a>) -> Self {
        let corners = mesh.faces.iter().enumerate();
        let corners = corners.flat_map(|(f, corners)| corners.map(|v| (v, f as u32)));
        Self {
            mesh,
            vertex_faces: Adjacency::from_lists(mesh.vertices.len(), corners),
        }
    }

    /// The face in which b comes after a, and the corner of a in it.
    fn with_edge(&self, a: u32, b: u32) -> Option<(usize, usize)> {
        let faces = self.vertex_faces.row(a as usize).iter();
        faces.map(|&face| face as usize).find_map(|face| {
            let corners = self.mesh.faces[face];
            let begins = |&c: &usize| corners[c] == a && corners[(c + 1) % 3] == b;
            (0..3).find(begins).map(|corner| (face, corner))
        })
    }

    fn length(&self, a: u32, b: u32) -> f64 {
        let [a, b] = [a, b].map(|v| self.mesh.vertices[v as usize]);
        vector::distance(a, b)
    }
}

/// A piece laid onto another.
struct Laid {
    /// Target vertices and the source's.
    images: Vec<(u32, u32)>,
    /// Whether all edges are the same, and the share of those that are alike.
    fit: (bool, f64),
}

struct Search<'a> {
    source: Side<'a>,
    target: Side<'a>,
    mirrored: bool,
    /// Lengths of the target that differ less are the same.
    same: f64,
    /// Source vertex of each target vertex while a piece is laid.
    image: Vec<u32>,
    /// Source vertices that are images, while a piece is laid.
    taken: Vec<bool>,
    /// Target faces that are laid, while a piece is.
    laid: Vec<bool>,
    /// Source vertices that are originals of other pieces.
    is_original: Vec<bool>,
}

impl Search<'_> {
    /// Faces of each piece of the target, connected across edges.
    fn pieces(&self) -> Vec<Vec<u32>> {
        let faces = self.target.mesh.faces;
        let mut seen = vec![false; faces.len()];
        let mut pieces = Vec::new();
        for first in 0..faces.len() {
            if seen[first] {
                continue;
            }
            seen[first] = true;
            let mut piece = vec![first as u32];
            let mut next = 0;
            while let Some(&face) = piece.get(next) {
                next += 1;
                let corners = faces[face as usize];
                for k in 0..3 {
                    let across = self.target.with_edge(corners[(k + 1) % 3], corners[k]);
                    if let Some((across, _)) = across.filter(|&(f, _)| !seen[f]) {
                        seen[across] = true;
                        piece.push(across as u32);
                    }
                }
            }
            pieces.push(piece);
        }
        pieces
    }

    /// Of faces drawn from a piece, those that fewest of the source are similar to, but some.
    fn rarest(&self, piece: &[u32], similar: &Similar) -> Vec<usize> {
        let every = piece.len().div_ceil(COPIES.drawn);
        let drawn = piece.iter().step_by(every).map(|&f| f as usize);
        let count = |face: usize| similar.to(&edges(self.target.mesh, face)).count();
        let mut counted: Vec<(usize, usize)> = drawn.map(|face| (count(face), face)).collect();
        counted.retain(|&(count, _)| count > 0);
        counted.sort_unstable();
        counted
            .iter()
            .take(COPIES.seeds)
            .map(|&(_, face)| face)
            .collect()
    }

    /// The best way to lay a piece of so many faces from a seed, and whether it is the only one.
    fn best(
        &mut self,
        seed: usize,
        faces: usize,
        similar: &Similar,
        images: Option<&[Point]>,
    ) -> Option<(Laid, bool)> {
        let lengths = edges(self.target.mesh, seed);
        let near = images.map(|images| images[self.target.mesh.faces[seed][0] as usize]);
        let mut onto: Vec<(f64, u32)> = (similar.to(&lengths))
            .map(|(unlike, face)| {
                let corner = self.source.mesh.faces[face as usize][0];
                let place = self.source.mesh.vertices[corner as usize];
                (
                    near.map_or(unlike, |near| vector::distance(place, near)),
                    face,
                )
            })
            .collect();
        onto.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut ways: Vec<Laid> = Vec::new();
        let (mut keeping, mut is_found) = (0, false);
        for (_, face) in onto.into_iter().take(COPIES.tried) {
            if is_found && keeping > 1 || keeping == 0 && ways.len() >= COPIES.ways {
                break;
            }
            for turn in 0..3 {
                let Some(way) = self.laid_from(seed, (face as usize, turn), faces) else {
                    continue;
                };
                if way.fit.0 {
                    keeping += 1;
                    is_found |= self.is_free(&way);
                }
                ways.push(way);
            }
        }
        // Ways that keep fewer edges are no rivals of those that keep all.
        if keeping > 0 {
            ways.retain(|way| way.fit.0);
        }
        let is_only = ways.len() == 1;
        ways.retain(|way| self.is_free(way));
        let better = |best: Laid, other: Laid| {
            if other.fit.1 > best.fit.1 {
                other
            } else {
                best
            }
        };
        ways.into_iter().reduce(better).map(|best| (best, is_only))
    }

    /// Whether no other piece has its originals there.
    fn is_free(&self, way: &Laid) -> bool {
        let mut originals = way.images.iter().map(|&(_, v)| v as usize);
        !originals.any(|v| self.is_original[v])
    }

    /// Lays a face of the target onto one of the source, turned by so many corners, and all of its piece.
    fn laid_from(
        &mut self,
        seed: usize,
        (face, turn): (usize, usize),
        faces: usize,
    ) -> Option<Laid> {
        let own = self.target.mesh.faces[seed];
        let mut onto = self.source.mesh.faces[face];
        onto.rotate_left(turn);
        if self.mirrored {
            onto.swap(1, 2);
        }
        let mut named = Vec::new();
        let mut reached = vec![seed];
        let fit = self.spread(own, onto, &mut named, &mut reached);
        let is_whole = reached.len() == faces;
        for face in reached {
            self.laid[face] = false;
        }
        let images = named.iter().map(|&v| (v, self.image[v as usize]));
        let images: Vec<(u32, u32)> = images.collect();
        for &(v, image) in &images {
            self.image[v as usize] = NONE;
            self.taken[image as usize] = false;
        }
        fit.filter(|_| is_whole).map(|fit| Laid { images, fit })
    }

    /// Lays faces across edges from the first of `reached` on, as long as they lie on others; how well their edges fit.
    fn spread(
        &mut self,
        own: [u32; 3],
        onto: [u32; 3],
        named: &mut Vec<u32>,
        reached: &mut Vec<usize>,
    ) -> Option<(bool, f64)> {
        let long = (0..3).max_by(|&a, &b| self.edge(own, a).total_cmp(&self.edge(own, b)))?;
        let length = self.source.length(onto[long], onto[(long + 1) % 3]);
        let ratio = self.edge(own, long) / length;
        if !ratio.is_finite() {
            return None;
        }
        let (mut counted, mut alike) = (0usize, 0usize);
        let (mut all_same, mut is_part) = (true, false);
        let mut open = vec![(own, onto)];
        self.laid[reached[0]] = true;
        while let Some((own, onto)) = open.pop() {
            self.name(own, onto, named)?;
            for k in 0..3 {
                let [a, b] = [own[k], own[(k + 1) % 3]];
                let [p, q] = [onto[k], onto[(k + 1) % 3]];
                let here = self.target.length(a, b);
                let off = (here - ratio * self.source.length(p, q)).abs();
                counted += 1;
                alike += usize::from(off <= COPIES.alike * here + self.same);
                all_same &= off <= self.same;
                let (from, to) = if self.mirrored { (p, q) } else { (q, p) };
                let there = self.source.with_edge(from, to);
                let Some((across, corner)) = self.target.with_edge(b, a) else {
                    is_part |= there.is_some();
                    continue;
                };
                let (there, at) = there?;
                let third = self.source.mesh.faces[there][(at + 2) % 3];
                let own_third = self.target.mesh.faces[across][(corner + 2) % 3];
                if self.laid[across] {
                    let known = self.image[own_third as usize];
                    if known != NONE && known != third {
                        return None;
                    }
                } else {
                    self.laid[across] = true;
                    reached.push(across);
                    open.push(([b, a, own_third], [q, p, third]));
                }
            }
            if ((alike + COPIES.first) as f64) < COPIES.most * counted as f64 {
                return None;
            }
        }
        let share = alike as f64 / counted as f64;
        (all_same || share >= COPIES.most && !is_part).then_some((all_same, share))
    }

    fn edge(&self, own: [u32; 3], k: usize) -> f64 {
        self.target.length(own[k], own[(k + 1) % 3])
    }

    /// Names the images of a face's corners; nothing where others are known.
    fn name(&mut self, own: [u32; 3], onto: [u32; 3], named: &mut Vec<u32>) -> Option<()> {
        for (v, image) in own.into_iter().zip(onto) {
            let known = self.image[v as usize];
            if known == NONE && !self.taken[image as usize] {
                self.image[v as usize] = image;
                self.taken[image as usize] = true;
                named.push(v);
            } else if known != image {
                return None;
            }
        }
        Some(())
    }
}

/// Faces by their shapes, the middle and the shortest edge over the longest, in cells of a square grid of `COPIES.alike`.
struct Similar {
    shapes: Vec<[f64; 2]>,
    cells: Adjacency,
}

/// Cells along a side, with one around them.
fn cells() -> usize {
    (1.0 / COPIES.alike) as usize + 3
}

impl Similar {
    fn new(mesh: Triangles<'_>) -> Self {
        let faces = (0..mesh.faces.len()).into_par_iter();
        let shapes: Vec<[f64; 2]> = faces.map(|face| shape(edges(mesh, face))).collect();
        let faces = shapes.iter().enumerate();
        let faces = faces.filter(|(_, shape)| shape.iter().all(|ratio| ratio.is_finite()));
        let in_cells = faces.map(|(face, shape)| (cell(*shape), face as u32));
        let cells = Adjacency::from_lists(cells() * cells(), in_cells);
        Self { shapes, cells }
    }

    /// Those similar to a triangle of edges in ascending order, and how unlike they are.
    fn to(&self, &edges: &[f64; 3]) -> impl Iterator<Item = (f64, u32)> + '_ {
        let wanted = shape(edges);
        let is_triangle = wanted.iter().all(|ratio| ratio.is_finite());
        let middle = if is_triangle {
            cell(wanted) as usize
        } else {
            cells() + 1
        };
        let rows = [middle - cells(), middle, middle + cells()].into_iter();
        let near = rows.flat_map(|row| [row - 1, row, row + 1]);
        near.flat_map(|cell| self.cells.row(cell))
            .filter_map(move |&face| {
                let [a, b] = self.shapes[face as usize];
                let unlike = (a - wanted[0]).abs().max((b - wanted[1]).abs());
                (unlike <= COPIES.alike).then_some((unlike, face))
            })
    }
}

/// The middle and the shortest of three edges over the longest.
fn shape([short, middle, long]: [f64; 3]) -> [f64; 2] {
    [middle / long, short / long]
}

/// Cell of a shape, whose ratios are in [0, 1].
fn cell(shape: [f64; 2]) -> u32 {
    let [a, b] = shape.map(|ratio| (ratio / COPIES.alike) as usize + 1);
    (a * cells() + b) as u32
}

/// Lengths of a face's edges in ascending order.
fn edges(mesh: Triangles<'_>, face: usize) -> [f64; 3] {
    let places = mesh.faces[face].map(|v| mesh.vertices[v as usize]);
    let mut lengths = [0, 1, 2].map(|k| vector::distance(places[k], places[(k + 1) % 3]));
    lengths.sort_by(f64::total_cmp);
    lengths
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{AROUND, RINGS, SPIKES, torus_mesh};

    /// Several pieces as one soup.
    fn together(pieces: &[(Vec<Point>, Vec<[i64; 3]>)]) -> (Vec<Point>, Vec<[u32; 3]>) {
        let (mut vertices, mut faces) = (Vec::new(), Vec::new());
        for (places, corners) in pieces {
            let first = vertices.len() as u32;
            vertices.extend_from_slice(places);
            faces.extend(corners.iter().map(|f| f.map(|v| v as u32 + first)));
        }
        (vertices, faces)
    }

    fn moved(
        (vertices, faces): &(Vec<Point>, Vec<[i64; 3]>),
        to: impl Fn(Point) -> Point,
    ) -> (Vec<Point>, Vec<[i64; 3]>) {
        let vertices = vertices.iter().map(|&p| to(p)).collect();
        (vertices, faces.clone())
    }

    fn found(
        source: &(Vec<Point>, Vec<[u32; 3]>),
        target: &(Vec<Point>, Vec<[u32; 3]>),
        images: Option<&[Point]>,
    ) -> Vec<Option<Original>> {
        let [source, target] =
            [source, target].map(|(vertices, faces)| Triangles { vertices, faces });
        originals(source, target, images, false, &|| Ok(())).expect("not cancelled")
    }

    /// Two pieces, each moved in its own way and given in the other order.
    #[test]
    fn pieces_are_told_wherever_they_are_posed() {
        let pieces = [torus_mesh(RINGS, &[], 0.0), torus_mesh(RINGS, &SPIKES, 0.0)];
        let n = RINGS * AROUND;
        let source = together(&pieces);
        let target = together(&[
            moved(&pieces[1], |[x, y, z]| [z, x + 9.0, y]),
            moved(&pieces[0], |[x, y, z]| [-x, -y - 4.0, z]),
        ]);
        for (v, original) in found(&source, &target, None).into_iter().enumerate() {
            let vertex = ((v + n) % (2 * n)) as u32;
            let is_only = true;
            assert_eq!(original, Some(Original { vertex, is_only }));
        }
    }

    /// The half of a tube behind a joint is turned about it, which stretches the faces at the joint.
    #[test]
    fn a_bent_piece_is_a_copy() {
        let straight = torus_mesh(RINGS / 2, &SPIKES, 0.0);
        let bent = moved(&straight, |[x, y, z]| {
            if x > 0.0 {
                [x, y, z]
            } else {
                [0.6 * x - 0.8 * z, y, 0.8 * x + 0.6 * z]
            }
        });
        let (source, target) = (together(&[straight]), together(&[bent]));
        let images = found(&source, &target, None);
        let used: Vec<u32> = source.1.concat();
        assert!(
            used.iter()
                .all(|&v| images[v as usize].is_some_and(|o| o.vertex == v))
        );
    }

    #[test]
    fn of_pieces_that_are_alike_the_nearest_is_taken_and_none_is_the_only_one() {
        let piece = torus_mesh(RINGS, &SPIKES, 0.0);
        let beside = moved(&piece, |[x, y, z]| [x + 5.0, y, z]);
        let source = together(&[piece.clone(), beside.clone()]);
        let target = together(&[beside, piece]);
        let images = found(&source, &target, Some(&target.0));
        let n = RINGS * AROUND;
        for (v, original) in images.into_iter().enumerate() {
            let vertex = ((v + n) % (2 * n)) as u32;
            let is_only = false;
            assert_eq!(original, Some(Original { vertex, is_only }));
        }
    }

    #[test]
    fn other_triangles_are_no_copy() {
        let source = together(&[torus_mesh(RINGS, &[], 0.0)]);
        let stretched = moved(&torus_mesh(RINGS, &[], 0.0), |[x, y, z]| {
            [x, 1.5 * y, 2.0 * z]
        });
        let target = together(&[stretched]);
        assert!(found(&source, &target, None).iter().all(Option::is_none));
        let larger = together(&[torus_mesh(RINGS, &[], 0.0), torus_mesh(9, &[], 0.2)]);
        let images = found(&larger, &source, None);
        assert!(images.iter().all(Option::is_some));
    }
}
