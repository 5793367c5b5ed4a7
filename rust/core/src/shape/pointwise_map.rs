//! The dense map: for every target vertex a triangle of the source and barycentric weights.

use rayon::prelude::*;

use crate::algebra::dense::{LANES, Rows, squared_distance, sum_of_lanes, vectorised};
use crate::error::Result;
use crate::mesh::numbering::CheckedVertex;
use crate::mesh::surface_point::{OnTriangle, SurfacePoint, closest_on_triangle};
use crate::shape::Shape;
use crate::shape::full_resolution::FullResolution;
use crate::watch::progress::Check;

/// Triangles in which the closest point is sought at once, each in a lane.
const TRIANGLES_AT_ONCE: usize = 8;

/// Triangles whose products one thread works out at once.
const FACES_AT_ONCE: usize = 512;

/// The triangles of a shape in an embedding, with the inner products that all questions share.
pub struct EmbeddedTriangles<'a> {
    shape: &'a Shape,
    /// A row a vertex.
    rows: &'a Rows,
    /// ⟨b − a, b − a⟩, ⟨b − a, c − a⟩, ⟨c − a, c − a⟩ of each triangle (a, b, c).
    sides: Vec<[f64; 3]>,
}

impl<'a> EmbeddedTriangles<'a> {
    /// The triangles of a shape whose vertices lie at `rows`.
    #[must_use]
    pub fn new(shape: &'a Shape, rows: &'a Rows) -> Self {
        let faces = &shape.mesh.faces;
        let sides = faces.par_chunks(FACES_AT_ONCE).flat_map_iter(|faces| {
            vectorised(
                #[inline(always)]
                || {
                    let mut sides = Vec::with_capacity(faces.len());
                    for corners in faces {
                        let [a, b, c] = corners.map(|v| rows.row(v as usize));
                        sides.push(products_from(a, [b, c], [(0, 0), (0, 1), (1, 1)]));
                    }
                    sides
                },
            )
        });
        Self {
            shape,
            rows,
            sides: sides.collect(),
        }
    }

    /// Nearest point of the triangles around a vertex and the nearest of its neighbours.
    #[must_use]
    pub fn nearest_around(
        &self,
        vertex: u32,
        query: &[f32],
        distances: &mut Distances,
    ) -> SurfacePoint {
        vectorised(
            #[inline(always)]
            || self.nearest_in_lanes(vertex, query, distances),
        )
    }

    #[inline(always)]
    fn nearest_in_lanes(
        &self,
        vertex: u32,
        query: &[f32],
        distances: &mut Distances,
    ) -> SurfacePoint {
        let shape = self.shape;
        distances.query += 1;
        let mut distance_to = |v: u32| distances.to(v, self.rows, query);
        let mut second = (f64::INFINITY, vertex);
        for &v in shape.neighbours.row(vertex as usize) {
            let distance = distance_to(v);
            if distance < second.0 {
                second = (distance, v);
            }
        }
        let mut best = Closest::default();
        for around in [vertex, second.1] {
            for &face in shape.vertex_faces.row(around as usize) {
                let corners = shape.mesh.faces[face as usize];
                if around != vertex && corners.contains(&vertex) {
                    continue;
                }
                let mut to = [0.0; 3];
                for (to, v) in to.iter_mut().zip(corners) {
                    *to = distance_to(v);
                }
                let [a, b, c] = to;
                best.try_triangle(face, self.sides[face as usize], [a, b - a, c - a]);
            }
        }
        best.point()
    }
}

/// Squared distances of queries from vertices, each worked out once.
pub struct Distances {
    /// Number of the present query.
    query: u32,
    /// Last query for which each was worked out.
    asked_by: Vec<u32>,
    found: Vec<f64>,
}

impl Distances {
    /// Room for those from so many vertices.
    #[must_use]
    pub fn with_room(count: usize) -> Self {
        Self {
            query: 0,
            asked_by: vec![0; count],
            found: vec![0.0; count],
        }
    }

    #[inline(always)]
    fn to(&mut self, vertex: u32, rows: &Rows, query: &[f32]) -> f64 {
        let v = vertex as usize;
        if self.asked_by[v] != self.query {
            self.asked_by[v] = self.query;
            self.found[v] = f64::from(squared_distance(query, rows.row(v)));
        }
        self.found[v]
    }
}

/// The closest point of some triangles, of which several are looked at at once.
#[derive(Default)]
struct Closest {
    /// The face where it lies, its squared distance, and the weights of the last two corners; none so far.
    best: Option<(u32, OnTriangle)>,
    /// Triangles that wait to be looked at.
    waiting: usize,
    faces: [u32; TRIANGLES_AT_ONCE],
    products: [[f64; TRIANGLES_AT_ONCE]; 6],
}

impl Closest {
    /// Tries a triangle (a, b, c) with the given [sides](EmbeddedTriangles::sides), from ‖a − q‖² and how much
    /// larger ‖b − q‖² and ‖c − q‖² are.
    #[inline(always)]
    fn try_triangle(
        &mut self,
        face: u32,
        [uu, uv, vv]: [f64; 3],
        [to_a, more_to_b, more_to_c]: [f64; 3],
    ) {
        // ⟨b − a, q − a⟩ by the law of cosines; likewise for c.
        let uq = f64::midpoint(uu, -more_to_b);
        let vq = f64::midpoint(vv, -more_to_c);
        self.faces[self.waiting] = face;
        for (lanes, product) in self.products.iter_mut().zip([uu, uv, vv, uq, vq, to_a]) {
            lanes[self.waiting] = product;
        }
        self.waiting += 1;
        if self.waiting == TRIANGLES_AT_ONCE {
            self.look();
        }
    }

    /// Looks at all that wait.
    #[inline(always)]
    fn look(&mut self) {
        let mut found = [OnTriangle::default(); TRIANGLES_AT_ONCE];
        let [uu, uv, vv, uq, vq, qq] = &self.products;
        for l in 0..TRIANGLES_AT_ONCE {
            found[l] = closest_on_triangle([uu[l], uv[l], vv[l], uq[l], vq[l], qq[l]]);
        }
        for (&face, found) in self.faces.iter().zip(found).take(self.waiting) {
            if self.best.is_none_or(|(_, best)| found.cost < best.cost) {
                self.best = Some((face, found));
            }
        }
        self.waiting = 0;
    }

    /// The closest point of all that were tried.
    #[inline(always)]
    fn point(mut self) -> SurfacePoint {
        self.look();
        let (face, found) = self.best.unwrap_or_default();
        let weights = found.weights();
        SurfacePoint { face, weights }
    }
}

/// Nearest point of the source's triangles in the common embedding, for each target row.
///
/// `images` is the nearest source vertex of each target vertex.
///
/// # Errors
/// [`crate::Error::Cancelled`].
pub fn projected(
    source: &EmbeddedTriangles<'_>,
    target: &Rows,
    images: &[u32],
    check: Check<'_>,
) -> Result<Vec<SurfacePoint>> {
    images
        .par_iter()
        .enumerate()
        .map_init(
            || Distances::with_room(source.rows.count()),
            |distances, (i, &image)| {
                check()?;
                Ok(source.nearest_around(image, target.row(i), distances))
            },
        )
        .collect()
}

/// As [`projected`], for every vertex of the given mesh behind a target's working mesh.
///
/// Rows of given vertices are those of the working mesh, linear on its faces, and are never
/// formed: the vertices of a face share the inner products of its corners with the source's rows,
/// so that the cost hardly grows with the given mesh. `images` is the nearest source vertex of
/// each vertex of that mesh.
///
/// # Errors
/// [`crate::Error::Cancelled`].
pub fn projected_at_full_resolution(
    source: &EmbeddedTriangles<'_>,
    (target, target_rows, full): (&Shape, &Rows, &FullResolution),
    images: &[u32],
    check: Check<'_>,
) -> Result<Vec<SurfacePoint>> {
    let found: Vec<Vec<(CheckedVertex, SurfacePoint)>> = (0..target.mesh.faces.len() as u32)
        .into_par_iter()
        .map(|face| {
            check()?;
            let asking = full.on_face(face);
            if asking.len() == 0 {
                return Ok(Vec::new());
            }
            let corners = target.mesh.faces[face as usize];
            Ok(vectorised(
                #[inline(always)]
                || {
                    let rows = corners.map(|v| target_rows.row(v as usize));
                    let near = NearFaces::new(rows, corners.map(|v| images[v as usize]), source);
                    let mut found = Vec::with_capacity(asking.len());
                    for v in asking {
                        let weights = full.points[v.index()].weights;
                        found.push((v, near.closest(weights, source)));
                    }
                    found
                },
            ))
        })
        .collect::<Result<_>>()?;
    let nowhere = SurfacePoint {
        face: 0,
        weights: [1.0, 0.0, 0.0],
    };
    let mut points = vec![nowhere; full.points.len()];
    for (v, point) in found.into_iter().flatten() {
        points[v.index()] = point;
    }
    Ok(points)
}

/// Faces of the source near the image of a target face, seen from the face's first corner t₀.
struct NearFaces {
    /// Gram matrix of t₁ − t₀, t₂ − t₀.
    own: [f64; 3],
    /// ⟨t₁ − t₀, v − t₀⟩, ⟨t₂ − t₀, v − t₀⟩, ‖v − t₀‖² of each source vertex v.
    products: Vec<[f64; 3]>,
    /// Faces with the places of their corners among the vertices.
    faces: Vec<(u32, [usize; 3])>,
}

impl NearFaces {
    #[inline(always)]
    fn new(corners: [&[f32]; 3], images: [u32; 3], source: &EmbeddedTriangles<'_>) -> Self {
        let EmbeddedTriangles {
            shape: source,
            rows,
            ..
        } = source;
        let mut faces: Vec<u32> = Vec::with_capacity(96);
        for (i, &image) in images.iter().enumerate() {
            if images[..i].contains(&image) {
                continue;
            }
            faces.extend(source.vertex_faces.row(image as usize));
            for &v in source.neighbours.row(image as usize) {
                faces.extend(source.vertex_faces.row(v as usize));
            }
        }
        faces.sort_unstable();
        faces.dedup();
        let corners_of = |face: u32| source.mesh.faces[face as usize];
        let mut vertices: Vec<u32> = faces.iter().flat_map(|&face| corners_of(face)).collect();
        vertices.sort_unstable();
        vertices.dedup();
        let place = |v: u32| vertices.partition_point(|&other| other < v);
        let faces = faces
            .into_iter()
            .map(|face| (face, corners_of(face).map(place)))
            .collect();
        let [t0, t1, t2] = corners;
        let mut products = Vec::with_capacity(vertices.len());
        for &v in &vertices {
            let v = rows.row(v as usize);
            products.push(products_from(t0, [t1, t2, v], [(0, 2), (1, 2), (2, 2)]));
        }
        Self {
            own: products_from(t0, [t1, t2], [(0, 0), (0, 1), (1, 1)]),
            products,
            faces,
        }
    }

    /// Closest point, of the faces around the two nearest vertices, to the point of the target face with these weights.
    #[inline(always)]
    fn closest(&self, [_, w1, w2]: [f64; 3], source: &EmbeddedTriangles<'_>) -> SurfacePoint {
        let [e11, e12, e22] = self.own;
        let square = w1 * w1 * e11 + 2.0 * w1 * w2 * e12 + w2 * w2 * e22;
        // ‖v − q‖² without ‖q − t₀‖².
        let distance =
            |[along1, along2, square]: [f64; 3]| square - 2.0 * (w1 * along1 + w2 * along2);
        let (mut first, mut second) = ((f64::INFINITY, 0), (f64::INFINITY, 0));
        for (v, &products) in self.products.iter().enumerate() {
            let distance = distance(products);
            if distance < first.0 {
                (first, second) = ((distance, v), first);
            } else if distance < second.0 {
                second = (distance, v);
            }
        }
        let mut best = Closest::default();
        for &(face, corners) in &self.faces {
            if !corners.contains(&first.1) && !corners.contains(&second.1) {
                continue;
            }
            let [a, b, c] = corners.map(|v| distance(self.products[v]));
            best.try_triangle(
                face,
                source.sides[face as usize],
                [square + a, b - a, c - a],
            );
        }
        best.point()
    }
}

/// ⟨x − o, y − o⟩ of three pairs of vectors, given by their places.
#[inline(always)]
fn products_from<const N: usize>(
    o: &[f32],
    vectors: [&[f32]; N],
    pairs: [(usize, usize); 3],
) -> [f64; 3] {
    let (mut lanes, mut rest) = ([[0f32; LANES]; 3], [0f32; 3]);
    let whole = o.len() / LANES * LANES;
    for from in (0..whole).step_by(LANES) {
        let mut apart = [[0f32; LANES]; N];
        for (apart, vector) in apart.iter_mut().zip(vectors) {
            let (vector, o) = (&vector[from..][..LANES], &o[from..][..LANES]);
            for l in 0..LANES {
                apart[l] = vector[l] - o[l];
            }
        }
        for (lanes, (x, y)) in lanes.iter_mut().zip(pairs) {
            for l in 0..LANES {
                lanes[l] += apart[x][l] * apart[y][l];
            }
        }
    }
    for i in whole..o.len() {
        for (rest, (x, y)) in rest.iter_mut().zip(pairs) {
            *rest += (vectors[x][i] - o[i]) * (vectors[y][i] - o[i]);
        }
    }
    let mut products = [0.0; 3];
    for i in 0..3 {
        products[i] = f64::from(sum_of_lanes(lanes[i]) + rest[i]);
    }
    products
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::algebra::vector;
    use crate::mesh::surface_point::nearest_in_triangle;
    use crate::testing::{RINGS, torus};

    #[test]
    fn the_nearest_point_of_triangles_is_that_of_the_three_dimensional_formula() {
        let shape = torus(RINGS);
        // Space within more dimensions, as many as need whole and broken registers.
        let mut rows = Rows::zeros(shape.mass.len(), 21);
        for (v, place) in shape.mesh.vertices.iter().enumerate() {
            for (c, x) in place.iter().enumerate() {
                rows.row_mut(v)[7 * c] = *x as f32;
            }
        }
        let triangles = EmbeddedTriangles::new(&shape, &rows);
        let mut distances = Distances::with_room(rows.count());
        for v in (0..shape.mass.len() as u32).step_by(7) {
            // Over a face of the vertex, off the surface, and nearest to that vertex.
            let face = shape.vertex_faces.row(v as usize)[0];
            let corners = shape.mesh.faces[face as usize];
            let weights = corners.map(|u| if u == v { 0.6 } else { 0.2 });
            let at = |u: u32| shape.mesh.vertices[u as usize];
            let mut query = vector::scaled(shape.normals[v as usize], 0.01);
            for (&u, w) in corners.iter().zip(weights) {
                query = vector::add(query, vector::scaled(at(u), w));
            }
            let mut row = vec![0.0; 21];
            for (c, x) in query.iter().enumerate() {
                row[7 * c] = *x as f32;
            }
            let found = triangles.nearest_around(v, &row, &mut distances);
            let cost_of =
                |face: u32| nearest_in_triangle(query, shape.mesh.faces[face as usize].map(at)).0;
            let around = shape.vertex_faces.row(v as usize).iter();
            let least = around.map(|&f| cost_of(f)).fold(f64::INFINITY, f64::min);
            let mut point = [0.0; 3];
            for (&u, w) in shape.mesh.faces[found.face as usize]
                .iter()
                .zip(found.weights)
            {
                point = vector::add(point, vector::scaled(at(u), w));
            }
            // Squares of lengths up to 0.1 in single precision.
            assert!(vector::distance(point, query).powi(2) < least + 1e-7);
        }
    }
}
