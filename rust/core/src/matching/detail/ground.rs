//! The surface on which images lie, asked for the point that is near and faces the same way.

use rayon::prelude::*;

use crate::algebra::oriented_tree::{Oriented, OrientedTree, oriented, squared_distance};
use crate::algebra::vector::{self, Point};
use crate::matching::detail::creases::Creases;
use crate::mesh::surface_point::{SurfacePoint, nearest_in_triangle};
use crate::mesh::{Adjacency, Mesh};

/// A surface with its normals and a tree over both.
pub(super) struct Ground<'a> {
    mesh: &'a Mesh,
    vertex_faces: Adjacency,
    oriented: Vec<Oriented>,
    tree: OrientedTree,
    on_rim: Vec<bool>,
}

/// Where a vertex is drawn to.
#[derive(Debug, Clone, Copy)]
pub(super) struct Foot {
    pub(super) point: SurfacePoint,
    pub(super) place: Point,
    pub(super) normal: Point,
    /// Whether it lies on a rim, where the surface was cut off.
    pub(super) on_rim: bool,
    /// The nearest vertex.
    pub(super) vertex: u32,
}

impl<'a> Ground<'a> {
    /// A surface, its tree made for a weight ρ of normals.
    pub(super) fn new(mesh: &'a Mesh, rho: f64) -> Self {
        let normals = mesh.vertex_normals();
        let oriented: Vec<Oriented> = mesh
            .vertices
            .iter()
            .zip(normals)
            .map(|(&p, n)| oriented(p, n))
            .collect();
        let mut on_rim = vec![false; mesh.vertices.len()];
        if mesh.is_open() {
            for v in mesh.boundary_vertices() {
                on_rim[v as usize] = true;
            }
        }
        Self {
            mesh,
            vertex_faces: mesh.vertex_faces(),
            tree: OrientedTree::new(&oriented, rho),
            oriented,
            on_rim,
        }
    }

    /// Its creases at a finest length of averaging.
    pub(super) fn creases(&self, length: f64) -> Creases {
        let normals: Vec<Point> = (self.oriented.iter())
            .map(|&[.., x, y, z]| [x, y, z])
            .collect();
        Creases::new(self.mesh, &normals, &self.on_rim, length)
    }

    /// The points that are nearest to places of vertices, normals weighted by each one's ρ; `known` are vertices close by.
    pub(super) fn feet(
        &self,
        places: &[Point],
        normals: &[Point],
        rho: &[f64],
        known: &[u32],
    ) -> Vec<Foot> {
        (0..places.len())
            .into_par_iter()
            .map(|v| {
                let query = oriented(places[v], normals[v]);
                self.foot(&query, rho[v] * rho[v], known[v])
            })
            .collect()
    }

    fn foot(&self, query: &Oriented, turning: f64, known: u32) -> Foot {
        let to = |v: u32| squared_distance(&self.oriented[v as usize], query, turning);
        let vertex = self.tree.nearest(query, turning, (to(known), known));
        let mut best: Option<(f64, Foot)> = None;
        let mut around = |v: u32, seen: &[u32]| -> u32 {
            for &face in self.vertex_faces.row(v as usize) {
                let corners = self.mesh.faces[face as usize];
                if corners.iter().any(|c| seen.contains(c)) {
                    continue;
                }
                let (cost, foot) = self.on_face(query, turning, face, vertex);
                if best.is_none_or(|(least, _)| cost < least) {
                    best = Some((cost, foot));
                }
            }
            best.map_or(0, |(_, foot)| foot.point.face)
        };
        let face = around(vertex, &[]);
        let [a, b] = others(self.mesh.faces[face as usize], vertex);
        around(a, &[vertex]);
        around(b, &[vertex, a]);
        best.expect("a vertex of a checked mesh has a face").1
    }

    fn on_face(&self, query: &Oriented, turning: f64, face: u32, vertex: u32) -> (f64, Foot) {
        let corners = self.mesh.faces[face as usize];
        let at = corners.map(|v| self.oriented[v as usize]);
        let [x, y, z, ..] = *query;
        let (square, weights) = nearest_in_triangle([x, y, z], at.map(|[a, b, c, ..]| [a, b, c]));
        let blend = |from: usize| {
            [0, 1, 2].map(|c| (0..3).map(|i| weights[i] * at[i][from + c]).sum::<f64>())
        };
        let (place, normal) = (blend(0), vector::normalised(blend(3)));
        let turned = vector::sub(normal, [query[3], query[4], query[5]]);
        let cost = square + turning * vector::dot(turned, turned);
        let carried_by_rim = |i: usize| weights[i] <= 0.0 || self.on_rim[corners[i] as usize];
        let foot = Foot {
            point: SurfacePoint { face, weights },
            place,
            normal,
            on_rim: (0..3).all(carried_by_rim),
            vertex,
        };
        (cost, foot)
    }
}

/// The two other corners of a face.
fn others(corners: [u32; 3], vertex: u32) -> [u32; 2] {
    match corners {
        [v, a, b] if v == vertex => [a, b],
        [a, v, b] if v == vertex => [a, b],
        [a, b, _] => [a, b],
    }
}
