//! A coarse version of a fine mesh: few vertices, evenly spread, all of them given ones.
//!
//! The maps that are sought are smooth: a spectrum of 150 eigenfunctions has no detail below a
//! tenth of √area, so that a mesh of some ten thousand vertices shows it as well as one of a
//! million. Fingers and ears are thin, though, and keep more vertices than their area.

mod faces_around;
mod queue;

use self::faces_around::FacesAround;
use self::queue::Queue;
use crate::algebra::vector::{self, Point};
use crate::error::{Error, Result};
use crate::mesh::Mesh;
use crate::mesh::settings::SIMPLIFICATION;

/// Vertices with more faces stay: their star would cost too much to look at.
const LARGEST_STAR: usize = 40;
/// Collapses between two looks at whether to stop.
const COLLAPSES_A_CHECK: usize = 4096;

const NONE: u32 = u32::MAX;

/// What is left of a mesh.
#[derive(Debug)]
pub struct Simplified {
    /// Vertices of the fine mesh that are kept, ascending.
    pub kept: Vec<u32>,
    /// Triangles, numbers within `kept`.
    pub faces: Vec<[u32; 3]>,
    /// Number within `kept` of the vertex that each fine vertex was merged into.
    pub anchor: Vec<u32>,
}

/// Collapses edges until `wanted` vertices are left, or none can go.
///
/// Vertices go in the order of the area around them, which counts more where it bends (`SIMPLIFICATION.bending`), the smallest first,
/// each into that neighbour which leaves the best shaped triangles; so the rest is spread evenly. The topology stays: an
/// edge is collapsed only when its ends have no common neighbours but those across it, boundaries
/// shrink along themselves, and vertices at non-manifold edges stay. Memory: about 90 bytes a vertex
/// and 24 a face. The result does not depend on the number of threads.
///
/// # Errors
/// [`Error::Cancelled`].
///
/// # Source
/// The link condition is that of Dey, Edelsbrunner, Guha, Nekhayev, "Topology preserving edge
/// contraction", 1999.
pub fn simplified(
    mesh: &Mesh,
    wanted: usize,
    cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Simplified> {
    let mut collapser = Collapser::new(&mesh.vertices, &mesh.faces);
    collapser.reduce(wanted, cancelled)?;
    Ok(collapser.finished())
}

/// A mesh that loses vertices.
struct Collapser<'a> {
    positions: &'a [Point],
    /// Corners of each face; a dead one has `NONE` in front.
    faces: Vec<[u32; 3]>,
    /// Without the dead ones.
    around: FacesAround,
    /// Which vertex a removed one was merged into; itself for the others.
    merged: Vec<u32>,
    /// Twice the area of the faces around each vertex, or what it waits for.
    star: Vec<f32>,
    /// Marks of the vertices around the vertex at hand.
    stamp: Vec<u32>,
    now: u32,
    fan: Fan,
}

/// The faces around a vertex u in order: (u, x, y) for each.
#[derive(Default)]
struct Fan {
    faces: Vec<u32>,
    edges: Vec<[u32; 2]>,
    /// Twice the area of each face times its normal, and its length.
    normals: Vec<(Point, f64)>,
    /// Vertices around, in order; an open fan has one more than edges.
    ring: Vec<u32>,
    open: bool,
    /// Score and number in the ring of possible collapses.
    choices: Vec<(f64, usize)>,
}

impl<'a> Collapser<'a> {
    fn new(positions: &'a [Point], faces: &[[u32; 3]]) -> Self {
        let n = positions.len();
        let mut star = vec![0.0; n];
        for corners in faces {
            let area = vector::norm(normal(corners.map(|v| positions[v as usize]))) as f32;
            for &v in corners {
                star[v as usize] += area;
            }
        }
        Self {
            positions,
            faces: faces.to_vec(),
            around: FacesAround::new(n, faces),
            merged: (0..n as u32).collect(),
            star,
            stamp: vec![0; n],
            now: 0,
            fan: Fan::default(),
        }
    }

    fn reduce(&mut self, wanted: usize, cancelled: &(dyn Fn() -> bool + Sync)) -> Result<()> {
        let mut left = self.positions.len();
        let total: f32 = self.star.iter().sum();
        let mut queue = Queue::new();
        for (v, &star) in (0..).zip(&self.star) {
            queue.push(star, v);
        }
        let mut steps = 0usize;
        while left > wanted
            && let Some((key, v)) = queue.pop()
        {
            steps += 1;
            if steps.is_multiple_of(COLLAPSES_A_CHECK) && cancelled() {
                return Err(Error::Cancelled);
            }
            let star = self.star[v as usize];
            if star > key {
                queue.push(star, v);
                continue;
            }
            let weight = star.max(self.weight(v));
            if weight > key {
                queue.push(weight, v);
            } else if self.remove(v) {
                left -= 1;
            } else {
                let later = key * SIMPLIFICATION.patience;
                if later > 0.0 && later < total {
                    self.star[v as usize] = self.star[v as usize].max(later);
                    queue.push(later, v);
                }
            }
        }
        Ok(())
    }

    /// Twice the area around a vertex, and more (`SIMPLIFICATION.bending`) where it bends.
    fn weight(&self, v: u32) -> f32 {
        let (mut sum, mut area) = ([0.0; 3], 0.0);
        for &face in self.around.of(v) {
            let normal = normal(self.faces[face as usize].map(|c| self.positions[c as usize]));
            sum = vector::add(sum, normal);
            area += vector::norm(normal);
        }
        let share = (vector::norm(sum) / area).max(SIMPLIFICATION.least_share);
        (area / share.powi(SIMPLIFICATION.bending)) as f32
    }

    /// Merges a vertex into a neighbour; false when that would harm the surface.
    fn remove(&mut self, u: u32) -> bool {
        let mut fan = std::mem::take(&mut self.fan);
        let done = self.gather(u, &mut fan) && self.merge_into_best(u, &mut fan);
        self.fan = fan;
        done
    }

    /// The fan around a vertex; false when it is not one.
    fn gather(&mut self, u: u32, fan: &mut Fan) -> bool {
        fan.faces.clear();
        fan.edges.clear();
        fan.ring.clear();
        let row = self.around.of(u);
        if row.len() < 2 || row.len() > LARGEST_STAR {
            return false;
        }
        fan.faces.extend_from_slice(row);
        let edges = row.iter().map(|&f| others(self.faces[f as usize], u));
        fan.edges.extend(edges);
        // An open fan starts with the edge that none precedes.
        let starts = |fan: &Fan| {
            (0..fan.edges.len())
                .filter(|&e| fan.edges.iter().all(|other| other[1] != fan.edges[e][0]))
                .count()
        };
        fan.open = match starts(fan) {
            0 => false,
            1 => true,
            _ => return false,
        };
        if fan.open
            && let Some(first) = (0..fan.edges.len())
                .find(|&e| fan.edges.iter().all(|other| other[1] != fan.edges[e][0]))
        {
            fan.edges.swap(0, first);
            fan.faces.swap(0, first);
        }
        for at in 1..fan.edges.len() {
            let from = fan.edges[at - 1][1];
            let Some(found) = (at..fan.edges.len()).find(|&e| fan.edges[e][0] == from) else {
                return false;
            };
            fan.edges.swap(at, found);
            fan.faces.swap(at, found);
        }
        fan.ring.extend(fan.edges.iter().map(|e| e[0]));
        let last = fan.edges[fan.edges.len() - 1][1];
        if fan.open {
            fan.ring.push(last);
        } else if last != fan.ring[0] {
            return false;
        }
        // A vertex that comes twice belongs to a non-manifold edge.
        self.now += 1;
        fan.ring
            .iter()
            .all(|&v| std::mem::replace(&mut self.stamp[v as usize], self.now) != self.now)
    }

    fn merge_into_best(&mut self, u: u32, fan: &mut Fan) -> bool {
        let count = fan.ring.len();
        let place = |v: u32| self.positions[v as usize];
        let around = fan.edges.iter().map(|&[x, y]| {
            let normal = normal([place(u), place(x), place(y)]);
            (normal, vector::norm(normal))
        });
        fan.normals.clear();
        fan.normals.extend(around);
        fan.choices.clear();
        for at in 0..count {
            // A boundary vertex moves along its boundary only.
            if fan.open && at != 0 && at != count - 1 {
                continue;
            }
            let score = self.score(at, fan);
            if score >= SIMPLIFICATION.least_quality {
                fan.choices.push((score, at));
            }
        }
        fan.choices
            .sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        for c in 0..fan.choices.len() {
            let v = fan.ring[fan.choices[c].1];
            if self.keeps_topology(u, v, fan) {
                self.merge(u, v, fan);
                return true;
            }
        }
        false
    }

    /// The worst triangle after merging the fan's vertex into one of its ring, or one that is bad enough.
    fn score(&self, at: usize, fan: &Fan) -> f64 {
        let to = fan.ring[at];
        let q = self.positions[to as usize];
        let mut worst = 1.0f64;
        for (&[x, y], &(before, old)) in fan.edges.iter().zip(&fan.normals) {
            if x == to || y == to {
                continue;
            }
            let (x, y) = (self.positions[x as usize], self.positions[y as usize]);
            let after = normal([q, x, y]);
            let new = vector::norm(after);
            let squares = [(q, x), (x, y), (y, q)].map(|(a, b)| {
                let d = vector::sub(a, b);
                vector::dot(d, d)
            });
            let quality = 2.0 * 3.0f64.sqrt() * new / (squares[0] + squares[1] + squares[2]);
            let turned = if old > 0.0 {
                vector::dot(before, after) / (old * new)
            } else {
                1.0
            };
            let score = quality * turned;
            // NaN is that of a vanished triangle.
            if score.is_nan() || score < SIMPLIFICATION.least_quality {
                return 0.0;
            }
            worst = worst.min(score);
        }
        worst
    }

    /// The link condition. The ring of `u` is stamped.
    fn keeps_topology(&mut self, u: u32, v: u32, fan: &Fan) -> bool {
        let ring = self.now;
        let across = if fan.open { 1 } else { 2 };
        let closes = fan.edges.len() == 3 && !fan.open;
        self.now += 1;
        let mut common = 0;
        for &face in self.around.of(v) {
            let others = others(self.faces[face as usize], v);
            // The three faces of a vertex become one, which must not be there already.
            if closes && others.iter().all(|&x| x != u && fan.ring.contains(&x)) {
                self.restamp(fan);
                return false;
            }
            for x in others {
                if x != u && self.stamp[x as usize] == ring {
                    self.stamp[x as usize] = self.now;
                    common += 1;
                }
            }
        }
        self.restamp(fan);
        common == across
    }

    /// Stamps the ring again, for the next choice.
    fn restamp(&mut self, fan: &Fan) {
        self.now += 1;
        for &x in &fan.ring {
            self.stamp[x as usize] = self.now;
        }
    }

    fn merge(&mut self, u: u32, v: u32, fan: &Fan) {
        let twice_area =
            |corners: [u32; 3]| vector::norm(normal(corners.map(|c| self.positions[c as usize])));
        let mut grown = 0.0;
        let mut changes = [0f32; LARGEST_STAR];
        let faces = fan.edges.iter().zip(&fan.normals);
        for (change, (&[x, y], &(_, old))) in changes.iter_mut().zip(faces) {
            let vanishes = x == v || y == v;
            let new = if vanishes { 0.0 } else { twice_area([v, x, y]) };
            *change = (new - old) as f32;
            grown += if vanishes { -old } else { new };
        }
        for (change, edge) in changes.iter().zip(&fan.edges) {
            for &w in edge.iter().filter(|&&w| w != v) {
                self.star[w as usize] += change;
            }
        }
        self.star[v as usize] += grown as f32;
        for (&face, &[x, y]) in fan.faces.iter().zip(&fan.edges) {
            let corners = &mut self.faces[face as usize];
            if x == v || y == v {
                corners[0] = NONE;
                self.around.remove(face, if x == v { y } else { x });
            } else {
                for c in corners.iter_mut().filter(|c| **c == u) {
                    *c = v;
                }
            }
        }
        self.around
            .join(u, v, |face| self.faces[face as usize][0] != NONE);
        self.merged[u as usize] = v;
    }

    fn finished(mut self) -> Simplified {
        let n = self.positions.len();
        let mut number = vec![NONE; n];
        let mut kept = Vec::new();
        for v in 0..n as u32 {
            if self.merged[v as usize] == v {
                number[v as usize] = kept.len() as u32;
                kept.push(v);
            }
        }
        let anchor = (0..n as u32)
            .map(|v| {
                let mut root = v;
                while self.merged[root as usize] != root {
                    let up = self.merged[root as usize];
                    self.merged[root as usize] = self.merged[up as usize];
                    root = up;
                }
                number[root as usize]
            })
            .collect();
        let faces = self
            .faces
            .iter()
            .filter(|f| f[0] != NONE)
            .map(|f| f.map(|v| number[v as usize]))
            .collect();
        Simplified {
            kept,
            faces,
            anchor,
        }
    }
}

/// Twice the area of a triangle times its normal.
fn normal([a, b, c]: [Point; 3]) -> Point {
    vector::cross(vector::sub(b, a), vector::sub(c, a))
}

/// The corners of a face after one of them, in order.
fn others(face: [u32; 3], corner: u32) -> [u32; 2] {
    let [a, b, c] = face;
    if corner == a {
        [b, c]
    } else if corner == b {
        [c, a]
    } else {
        [a, b]
    }
}
