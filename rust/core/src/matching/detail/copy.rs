//! A target whose triangles are those of the source, or of a part of it: moved, turned, scaled, bent without stretching, its
//! vertices and triangles in another order.
//!
//! One triangle is laid onto one of the same edges, near its image, and then triangle after triangle across their edges. Where
//! every edge of the target is found so, in one ratio to the source's, the vertices answer to one another exactly. O(n log n).

use super::at;
use crate::algebra::vector;
use crate::mesh::surface_point::SurfacePoint;
use crate::mesh::{Adjacency, Mesh};

/// Difference of lengths at unit area up to which edges are alike: what coordinates in single precision are wrong by, tenfold.
pub(super) const ALIKE: f64 = 1e-5;
/// Triangles of the target among which the one is chosen that fewest of the source are similar to.
const DRAWN: usize = 200;
/// Triangles of the source that it is laid onto, the nearest to its image first.
const TRIED: usize = 32;
/// No vertex.
const NONE: u32 = u32::MAX;

/// The source's vertex of each target vertex where the target is a copy; its images, and whether it is mirrored, tell which of
/// several ways.
pub(super) fn vertices(
    source: &Mesh,
    target: &Mesh,
    points: &[SurfacePoint],
    mirrored: bool,
) -> Option<Vec<u32>> {
    let similar = Similar::new(source);
    let mut copy = Copy {
        source: Side::new(source),
        target: Side::new(target),
        mirrored,
        image: vec![NONE; target.vertices.len()],
        taken: vec![false; source.vertices.len()],
        laid: vec![false; target.faces.len()],
    };
    while let Some(seed) = copy.rarest_face(&similar) {
        let near = at(source, &points[target.faces[seed][0] as usize]);
        let mut tried: Vec<(f64, u32)> = (similar.to(&edges(target, seed)).iter())
            .map(|&(_, face)| {
                let corner = source.vertices[source.faces[face as usize][0] as usize];
                (vector::distance(corner, near), face)
            })
            .collect();
        tried.sort_by(|a, b| a.0.total_cmp(&b.0));
        let starts = tried.iter().take(TRIED);
        let mut starts = starts.flat_map(|&(_, face)| [0, 1, 2].map(|turn| (face as usize, turn)));
        starts.find(|&start| copy.laid_from(seed, start))?;
    }
    Some(copy.image)
}

/// A mesh and the faces around its vertices.
struct Side<'a> {
    mesh: &'a Mesh,
    vertex_faces: Adjacency,
}

impl<'a> Side<'a> {
    fn new(mesh: &'a Mesh) -> Self {
        Self {
            mesh,
            vertex_faces: mesh.vertex_faces(),
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
        let places = [a, b].map(|v| self.mesh.vertices[v as usize]);
        vector::distance(places[0], places[1])
    }
}

/// What of a copy is known.
struct Copy<'a> {
    source: Side<'a>,
    target: Side<'a>,
    mirrored: bool,
    /// Source vertex of each target vertex.
    image: Vec<u32>,
    /// Source vertices that are images.
    taken: Vec<bool>,
    /// Target faces that are laid.
    laid: Vec<bool>,
}

impl Copy<'_> {
    /// Of the faces drawn from those that are not laid, the one that fewest of the source are similar to.
    fn rarest_face(&self, similar: &Similar) -> Option<usize> {
        let left: Vec<usize> = (0..self.laid.len()).filter(|&f| !self.laid[f]).collect();
        let every = left.len().div_ceil(DRAWN).max(1);
        let count = |&f: &usize| similar.to(&edges(self.target.mesh, f)).len();
        left.into_iter().step_by(every).min_by_key(count)
    }

    /// Lays a face of the target onto one of the source, turned by so many corners, and all that is connected with it; nothing
    /// where an edge differs.
    fn laid_from(&mut self, seed: usize, (face, turn): (usize, usize)) -> bool {
        let own = self.target.mesh.faces[seed];
        let mut onto = self.source.mesh.faces[face];
        onto.rotate_left(turn);
        if self.mirrored {
            onto.swap(1, 2);
        }
        let ratio =
            self.target.length(own[0], own[1]) / self.source.length(onto[0], onto[1]).max(ALIKE);
        let mut reached: Vec<usize> = Vec::new();
        let mut named: Vec<u32> = Vec::new();
        let mut open = vec![(seed, own, onto)];
        let mut fits = true;
        while let Some((face, own, onto)) = open.pop() {
            if self.laid[face] {
                let known = own.map(|v| self.image[v as usize]);
                fits = known == onto;
            } else {
                fits = self.lay(&own, &onto, ratio, &mut named);
                self.laid[face] = true;
                reached.push(face);
            }
            if !fits {
                break;
            }
            for k in 0..3 {
                let [a, b] = [own[k], own[(k + 1) % 3]];
                let Some((across, corner)) = self.target.with_edge(b, a) else {
                    continue;
                };
                if self.laid[across] {
                    continue;
                }
                let (p, q) = (onto[k], onto[(k + 1) % 3]);
                let (from, to) = if self.mirrored { (p, q) } else { (q, p) };
                let Some((there, at)) = self.source.with_edge(from, to) else {
                    fits = false;
                    break;
                };
                let third = self.target.mesh.faces[across][(corner + 2) % 3];
                let its_image = self.source.mesh.faces[there][(at + 2) % 3];
                open.push((across, [b, a, third], [q, p, its_image]));
            }
        }
        if !fits {
            for face in reached {
                self.laid[face] = false;
            }
            for v in named {
                self.taken[self.image[v as usize] as usize] = false;
                self.image[v as usize] = NONE;
            }
        }
        fits
    }

    /// Names the images of a face's corners; whether they agree with what is known and all edges are alike.
    fn lay(&mut self, own: &[u32; 3], onto: &[u32; 3], ratio: f64, named: &mut Vec<u32>) -> bool {
        let alike = (0..3).all(|k| {
            let next = (k + 1) % 3;
            let here = self.target.length(own[k], own[next]);
            (here - ratio * self.source.length(onto[k], onto[next])).abs() < ALIKE
        });
        alike
            && own.iter().zip(onto).all(|(&v, &image)| {
                let known = self.image[v as usize];
                if known == NONE && !self.taken[image as usize] {
                    self.image[v as usize] = image;
                    self.taken[image as usize] = true;
                    named.push(v);
                    return true;
                }
                known == image
            })
    }
}

/// The source's faces by their shapes.
struct Similar {
    /// Middle and shortest edge over the longest, ascending by the first.
    shapes: Vec<([f64; 2], u32)>,
}

impl Similar {
    fn new(mesh: &Mesh) -> Self {
        let of = |face: u32| {
            let [short, middle, long] = edges(mesh, face as usize);
            ([middle / long, short / long], face)
        };
        let mut shapes: Vec<([f64; 2], u32)> = (0..mesh.faces.len() as u32).map(of).collect();
        shapes.sort_by(|a, b| a.0[0].total_cmp(&b.0[0]));
        Self { shapes }
    }

    /// Those similar to a triangle of edges in ascending order.
    fn to(&self, &[short, middle, long]: &[f64; 3]) -> Vec<([f64; 2], u32)> {
        let within = 2.0 * ALIKE / long;
        let [first, second] = [middle / long, short / long];
        let start = self.shapes.partition_point(|(s, _)| s[0] < first - within);
        let alike = self.shapes[start..].iter();
        let alike = alike.take_while(|(s, _)| s[0] <= first + within);
        alike
            .filter(|(s, _)| (s[1] - second).abs() <= within)
            .copied()
            .collect()
    }
}

/// Lengths of a face's edges in ascending order.
fn edges(mesh: &Mesh, face: usize) -> [f64; 3] {
    let places = mesh.faces[face].map(|v| mesh.vertices[v as usize]);
    let mut lengths = [0, 1, 2].map(|k| vector::distance(places[k], places[(k + 1) % 3]));
    lengths.sort_by(f64::total_cmp);
    lengths
}
