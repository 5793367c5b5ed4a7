//! Normals of a normal map, turned as the map turns the surface under a texel.

use crate::algebra::vector::{self, Point};
use crate::mesh::surface_point::SurfacePoint;
use crate::transfer::corners::plane_weights;
use crate::transfer::surface::{Surface, blend};
use crate::transfer::surface_map::SurfaceMap;

/// Normals and tangents at the corners of triangles, `(m, 3)`: unit vectors, the tangent's fourth
/// number being the sign of the bitangent.
#[derive(Debug, Clone, Copy)]
pub struct TangentSpace<'a> {
    /// Normals.
    pub normals: &'a [[Point; 3]],
    /// Tangents along u.
    pub tangents: &'a [[[f64; 4]; 3]],
}

impl TangentSpace<'_> {
    /// Normal, tangent and bitangent within a triangle; unit vectors, at right angles.
    fn frame(&self, triangle: u32, weights: [f64; 3]) -> (Point, Point, Point) {
        let triangle = triangle as usize;
        let normal = vector::normalised(blend(self.normals[triangle], weights));
        let corners = self.tangents[triangle];
        let tangent = blend(corners.map(|t| [t[0], t[1], t[2]]), weights);
        let tangent = vector::normalised(flat(tangent, normal));
        let sign = if corners[0][3] < 0.0 { -1.0 } else { 1.0 };
        (
            normal,
            tangent,
            vector::scaled(vector::cross(normal, tangent), sign),
        )
    }
}

/// A space that is the same all over a surface, such as object or world space.
#[derive(Debug, Clone, Copy)]
pub struct FixedSpace<'a> {
    /// Normals of the surface's vertices, `(n,)`: unit vectors.
    pub normals: &'a [Point],
    /// Rows of the matrix that takes normals of this space to the surface's coordinates, or on the
    /// target from these to this space; their lengths do not count.
    pub matrix: [Point; 3],
}

impl FixedSpace<'_> {
    fn normal(&self, surface: &Surface, triangle: u32, weights: [f64; 3]) -> Point {
        let corners = surface.triangles[triangle as usize];
        vector::normalised(blend(corners.map(|v| self.normals[v as usize]), weights))
    }

    fn taken(&self, normal: Point) -> Point {
        vector::normalised(vector::by_rows(&self.matrix, normal))
    }
}

/// A place of a target triangle, and that of the source which comes there.
#[derive(Debug, Clone, Copy)]
pub struct Spot<'a> {
    /// The map between them.
    pub map: &'a SurfaceMap,
    /// The target's triangle.
    pub triangle: u32,
    /// Images of its corners.
    pub images: [Point; 3],
    /// The place in it.
    pub weights: [f64; 3],
    /// The place on the source.
    pub source: SurfacePoint,
}

impl Spot<'_> {
    /// A normal of the source's tangent frame, unit length not needed, in the target's.
    #[must_use]
    pub fn between_tangents(
        &self,
        normal: Point,
        source: &TangentSpace<'_>,
        target: &TangentSpace<'_>,
    ) -> Point {
        let (from, tangent, bitangent) = source.frame(self.source.face, self.source.weights);
        let carried = vector::normalised(blend([tangent, bitangent, from], normal));
        let (_, along, across) = target.frame(self.triangle, self.weights);
        let u = vector::normalised(flat(self.on_source(along), from));
        let v = flat(self.on_source(across), from);
        let v = vector::normalised(flat(v, u));
        [u, v, from].map(|axis| vector::dot(axis, carried))
    }

    /// A normal of a fixed space of the source, unit length not needed, in one of the target.
    ///
    /// It stands to the target's smooth surface as it stood to the source's; around the normal it is
    /// turned by the rotation, or reflection, nearest to what the map does in the tangent plane.
    #[must_use]
    pub fn between_fixed(
        &self,
        normal: Point,
        source: &FixedSpace<'_>,
        target: &FixedSpace<'_>,
    ) -> Point {
        let carried = source.taken(normal);
        let from = source.normal(&self.map.source, self.source.face, self.source.weights);
        let to = target.normal(&self.map.target, self.triangle, self.weights);
        // Any two directions at right angles will do: the nearest rotation is the same for all.
        let [a, b, _] = self.map.target.corners(self.triangle);
        let along = vector::normalised(flat(vector::sub(b, a), to));
        let across = vector::cross(to, along);
        let [u, v] = [along, across].map(|axis| flat(self.on_source(axis), from));
        let side = if vector::dot(from, vector::cross(u, v)) < 0.0 {
            -1.0
        } else {
            1.0
        };
        let back = vector::scaled(vector::cross(from, v), side);
        let u = vector::normalised(vector::sub(u, back));
        let v = vector::scaled(vector::cross(from, u), side);
        let local = [u, v, from].map(|axis| vector::dot(axis, carried));
        target.taken(blend([along, across, to], local))
    }

    /// A direction on the target's triangle as one on the source, by the map itself; its length is of
    /// no use but beside others of the same triangle.
    fn on_source(&self, direction: Point) -> Point {
        let [a, b, c] = self.map.target.corners(self.triangle);
        let size = vector::distance(a, b).max(vector::distance(a, c));
        let end = vector::add(a, vector::scaled(direction, size));
        let weights = plane_weights(&self.map.target, self.triangle, end);
        vector::sub(blend(self.images, weights), self.images[0])
    }
}

/// What of a vector is at right angles to a unit normal.
fn flat(vector: Point, normal: Point) -> Point {
    vector::sub(vector, vector::scaled(normal, vector::dot(vector, normal)))
}
