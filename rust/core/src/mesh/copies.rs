//! Pieces of a mesh that are copies of another's: the same triangles, moved, turned, scaled, posed by a rig, their vertices and
//! triangles in another order.
//!
//! One triangle is laid onto a similar one, and then triangle after triangle across their edges. A piece whose triangles all come
//! to lie on others is a copy where its edges are the other's in one ratio: all of them, or the most where it is bent at joints.
//! Its vertices answer to those of the other exactly. O(n log n).
//!
//! Of pieces that are alike, as left and right ones are, each is told by what holds it: the distances across a joint are those
//! across the joint of the originals, in every pose.

use rayon::prelude::*;

use super::Adjacency;
use crate::algebra::space_tree::SpaceTree;
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

/// The source's vertex of each target vertex whose piece is a copy. Of several ways the one is taken that a joint
/// tells; otherwise the one that keeps most edges, and of these the one nearest to the `images` of the target's vertices where
/// these are known. `mirrored` are copies whose triangles are wound the other way round.
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
        extent: vector::extent(target.vertices),
        most: COPIES.most,
        ratio: None,
        seeds: COPIES.seeds,
        image: vec![NONE; target.vertices.len()],
        taken: vec![false; source.vertices.len()],
        laid: vec![false; target.faces.len()],
        is_original: vec![false; source.vertices.len()],
    };
    let mut pieces = search.pieces();
    pieces.retain(|piece| (COPIES.fewest_faces..=source.faces.len()).contains(&piece.len()));
    let (mut left, mut holders) = (Vec::new(), Vec::new());
    for faces in pieces {
        check()?;
        match search.best_of(&faces, &similar, images) {
            Some((best, true)) => {
                holders.push(search.holder(&best));
                search.take(best, true, &mut found);
            }
            best => left.push(Left {
                faces,
                is_copy: best.is_some(),
            }),
        }
    }
    search.assemble(&mut left, holders, &similar, &mut found, check)?;
    for piece in left.iter().filter(|piece| piece.is_copy) {
        check()?;
        if let Some((best, is_only)) = search.best_of(&piece.faces, &similar, images) {
            search.take(best, is_only, &mut found);
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
    /// Lengths of the target over those of the source.
    ratio: f64,
}

/// A copy that may hold others.
struct Holder {
    /// Target vertices and the source's.
    images: Vec<(u32, u32)>,
    /// Of the target vertices' places.
    tree: SpaceTree<'static>,
    /// Lengths of the target over those of the source.
    ratio: f64,
}

/// A vertex of a piece and the nearest one of a copy.
struct Contact {
    /// Target vertex of the piece.
    vertex: u32,
    /// Source vertex of the copy's vertex there.
    original: u32,
    /// How far the two lie apart.
    apart: f64,
}

/// Where a piece is near a copy.
struct Joint {
    /// The nearest contacts, the nearest first, at least one.
    contacts: Vec<Contact>,
    /// Of the copy, lengths of the target over those of the source.
    ratio: f64,
}

/// A way to lay a piece that a joint tells.
struct Held {
    /// By how much the joint is off.
    off: f64,
    /// Whether no other way onto the same piece would do.
    is_only: bool,
    way: Laid,
}

/// A piece that is no copy by itself, or one in several ways.
struct Left {
    faces: Vec<u32>,
    is_copy: bool,
}

struct Search<'a> {
    source: Side<'a>,
    target: Side<'a>,
    mirrored: bool,
    /// Of the target.
    extent: f64,
    /// Share of the edges that are alike in a copy.
    most: f64,
    /// Lengths of the target over those of the source, where these are known.
    ratio: Option<f64>,
    /// Faces of a piece from which it is laid.
    seeds: usize,
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
            .take(self.seeds)
            .map(|&(_, face)| face)
            .collect()
    }

    /// The best way to lay a piece, and whether it is the only one.
    fn best_of(
        &mut self,
        piece: &[u32],
        similar: &Similar,
        images: Option<&[Point]>,
    ) -> Option<(Laid, bool)> {
        let seeds = self.rarest(piece, similar);
        let near = |seed: usize| images.map(|at| at[self.target.mesh.faces[seed][0] as usize]);
        let seeds: Vec<_> = seeds.into_iter().map(|seed| (seed, near(seed))).collect();
        seeds
            .into_iter()
            .find_map(|(seed, near)| self.best(seed, piece.len(), similar, near))
    }

    /// The vertices of a piece answer to their originals.
    fn take(&mut self, way: Laid, is_only: bool, found: &mut [Option<Original>]) {
        for (v, vertex) in way.images {
            self.is_original[vertex as usize] = true;
            found[v as usize] = Some(Original { vertex, is_only });
        }
    }

    /// Source faces that a face is similar to, those at a place first or else the most similar ones.
    fn onto(&self, seed: usize, similar: &Similar, near: Option<Point>) -> Vec<u32> {
        let lengths = edges(self.target.mesh, seed);
        let mut onto: Vec<(f64, u32)> = (similar.to(&lengths))
            .map(|(unlike, face)| {
                let corner = self.source.mesh.faces[face as usize][0];
                let place = self.source.mesh.vertices[corner as usize];
                let away = near.map_or(unlike, |near| vector::distance(place, near));
                (away, face)
            })
            .collect();
        onto.sort_by(|a, b| a.0.total_cmp(&b.0));
        onto.into_iter().take(COPIES.tried).map(|o| o.1).collect()
    }

    /// The best way to lay a piece of so many faces from a seed, and whether it is the only one.
    fn best(
        &mut self,
        seed: usize,
        faces: usize,
        similar: &Similar,
        near: Option<Point>,
    ) -> Option<(Laid, bool)> {
        let mut ways: Vec<Laid> = Vec::new();
        let (mut keeping, mut is_found) = (0, false);
        for face in self.onto(seed, similar, near) {
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

    /// Of the pieces left takes those that are told by what holds them, again and again, since each may hold others.
    fn assemble(
        &mut self,
        left: &mut Vec<Left>,
        mut holders: Vec<Holder>,
        similar: &Similar,
        found: &mut [Option<Original>],
        check: Check<'_>,
    ) -> Result<()> {
        self.most = COPIES.most_held;
        self.seeds = COPIES.drawn;
        while !holders.is_empty() {
            let mut told = Vec::new();
            for (number, Left { faces, .. }) in left.iter().enumerate() {
                check()?;
                let joints = self.joints(faces, &holders);
                if let Some(held) = self.held(faces, &joints, similar) {
                    told.push((number, held));
                }
            }
            told.sort_by(|(_, a), (_, b)| a.off.total_cmp(&b.off));
            let mut is_told = vec![false; left.len()];
            let mut new = Vec::new();
            for (number, held) in told {
                if self.is_free(&held.way) {
                    is_told[number] = true;
                    new.push(self.holder(&held.way));
                    self.take(held.way, held.is_only, found);
                }
            }
            holders.extend(new);
            if !is_told.contains(&true) {
                break;
            }
            let mut pieces = is_told.into_iter();
            left.retain(|_| pieces.next() == Some(false));
        }
        self.most = COPIES.most;
        self.seeds = COPIES.seeds;
        Ok(())
    }

    fn holder(&self, way: &Laid) -> Holder {
        let places = way
            .images
            .iter()
            .map(|&(v, _)| self.target.mesh.vertices[v as usize]);
        Holder {
            images: way.images.clone(),
            tree: SpaceTree::new(places.collect::<Vec<_>>()),
            ratio: way.ratio,
        }
    }

    /// Where a piece is near each of some others.
    fn joints(&self, piece: &[u32], holders: &[Holder]) -> Vec<Joint> {
        let faces = piece.iter().map(|&f| self.target.mesh.faces[f as usize]);
        let mut vertices: Vec<u32> = faces.flatten().collect();
        vertices.sort_unstable();
        vertices.dedup();
        let joint = |holder: &Holder| {
            let contact = |&vertex: &u32| {
                let place = self.target.mesh.vertices[vertex as usize];
                let (other, original) = holder.images[holder.tree.nearest(place)? as usize];
                let apart = self.target.length(vertex, other);
                Some(Contact {
                    vertex,
                    original,
                    apart,
                })
            };
            let mut contacts: Vec<Contact> = vertices.iter().filter_map(contact).collect();
            contacts.sort_by(|a, b| a.apart.total_cmp(&b.apart));
            contacts.truncate(COPIES.contacts);
            Joint {
                contacts,
                ratio: holder.ratio,
            }
        };
        let mut joints: Vec<Joint> = holders.iter().map(joint).collect();
        joints.retain(|joint| joint.contacts[0].apart <= COPIES.joint * self.extent);
        joints.sort_by(|a, b| a.contacts[0].apart.total_cmp(&b.contacts[0].apart));
        joints
    }

    /// The way to lay a piece that one of its joints tells from ways onto any other piece.
    fn held(&mut self, piece: &[u32], joints: &[Joint], similar: &Similar) -> Option<Held> {
        let nearest = joints.first()?;
        let near = self.source.mesh.vertices[nearest.contacts[0].original as usize];
        self.ratio = Some(nearest.ratio);
        let mut ways: Vec<(f64, Laid)> = Vec::new();
        for seed in self.rarest(piece, similar) {
            for face in self.onto(seed, similar, Some(near)) {
                let turns = (0..3)
                    .filter_map(|turn| self.laid_from(seed, (face as usize, turn), piece.len()));
                let turns: Vec<Laid> = turns.collect();
                let free = turns.into_iter().filter(|way| self.is_free(way));
                ways.extend(free.map(|way| (self.off(&way, joints), way)));
            }
            if !ways.is_empty() {
                break;
            }
        }
        self.ratio = None;
        ways.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut ways = ways.into_iter();
        let (off, way) = ways.next()?;
        let least = |way: &Laid| way.images.iter().map(|&(_, v)| v).min();
        let is_rival = |other: f64| other < COPIES.clearly * off.max(COPIES.same);
        let (own, others): (Vec<_>, Vec<_>) = ways.partition(|(_, w)| least(w) == least(&way));
        let is_told = off <= COPIES.held && !others.iter().any(|&(other, _)| is_rival(other));
        let is_only = !own.iter().any(|&(other, _)| is_rival(other));
        is_told.then_some(Held { off, is_only, way })
    }

    /// By how much distances across a joint differ from those of the originals, on average, over the extent: of several joints
    /// the least, since pieces come near each other in a pose that do not hold each other.
    fn off(&self, way: &Laid, joints: &[Joint]) -> f64 {
        let off = |joint: &Joint| {
            let off = joint.contacts.iter().map(|contact| {
                let image = way.images.iter().find(|&&(v, _)| v == contact.vertex);
                let there = image.map_or(f64::INFINITY, |&(_, v)| {
                    self.source.length(v, contact.original)
                });
                (way.ratio * there - contact.apart).abs()
            });
            off.sum::<f64>() / (joint.contacts.len() as f64 * self.extent)
        };
        joints.iter().map(off).fold(f64::INFINITY, f64::min)
    }

    fn same(&self) -> f64 {
        COPIES.same * self.extent
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
        let (fit, ratio) = fit.filter(|_| is_whole)?;
        Some(Laid { images, fit, ratio })
    }

    /// Lays faces across edges from the first of `reached` on, as long as they lie on others; how well their edges fit.
    fn spread(
        &mut self,
        own: [u32; 3],
        onto: [u32; 3],
        named: &mut Vec<u32>,
        reached: &mut Vec<usize>,
    ) -> Option<((bool, f64), f64)> {
        let long = (0..3).max_by(|&a, &b| self.edge(own, a).total_cmp(&self.edge(own, b)))?;
        let length = self.source.length(onto[long], onto[(long + 1) % 3]);
        let ratio = self.ratio.unwrap_or(self.edge(own, long) / length);
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
                alike += usize::from(off <= COPIES.alike * here + self.same());
                all_same &= off <= self.same();
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
            if ((alike + COPIES.first) as f64) < self.most * counted as f64 {
                return None;
            }
        }
        let share = alike as f64 / counted as f64;
        (all_same || share >= self.most && !is_part).then_some(((all_same, share), ratio))
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

    /// A trunk between two arms that are alike, each of which is moved about its joint; the other one lies near its hand.
    #[test]
    fn of_pieces_that_are_alike_each_is_told_by_its_joint() {
        let trunk = torus_mesh(RINGS, &[], 0.0);
        let arm = torus_mesh(RINGS / 2, &SPIKES, 0.0);
        let left = moved(&arm, |[x, y, z]| [0.3 * x + 1.9, 0.3 * y, 0.3 * z]);
        let right = moved(&arm, |[x, y, z]| [-0.3 * x - 1.9, -0.3 * y, 0.3 * z]);
        let joint = 1.5;
        let raised = |[x, y, z]: Point| [joint - z, y, x - joint];
        let lowered = |[x, y, z]: Point| [-joint + z, y, -x - joint];
        let source = together(&[trunk.clone(), left.clone(), right.clone()]);
        // Given in the other order.
        let target = together(&[moved(&right, lowered), trunk.clone(), moved(&left, raised)]);
        let [n, a] = [&trunk, &arm].map(|piece| piece.0.len() as u32);
        let images = found(&source, &target, None);
        let used: Vec<u32> = target.1.concat();
        for v in used {
            let vertex = match v {
                v if v < a => n + a + v,
                v if v < a + n => v - a,
                v => v - a - n + n,
            };
            assert_eq!(
                images[v as usize].map(|original| original.vertex),
                Some(vertex)
            );
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
