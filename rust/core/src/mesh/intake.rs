//! A checked triangle mesh: the clean part of what was given, at unit area.

use crate::algebra::vector::{self, Point};
use crate::error::{Error, Result};
use crate::mesh::numbering::InputVertex;
use crate::mesh::settings::INTAKE;

/// A face counts as flat when its area is below this fraction of the square of its longest edge: in
/// double precision its angles are then noise.
pub(crate) const LEAST_RELATIVE_AREA: f64 = 1e-12;

/// What the intake ignored or mended. Nothing is dropped without being counted here.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct IntakeReport {
    /// Dropped faces without an area (also those that name a vertex twice).
    pub zero_area_faces: usize,
    /// Faces without an area that were kept, because the surface would be slit along them.
    pub bridging_faces: usize,
    /// Faces with the same three vertices as an earlier one.
    pub duplicate_faces: usize,
    /// Vertices far out that were taken to be between their neighbours.
    pub stray_vertices: usize,
    /// Vertices that no kept face uses.
    pub isolated_vertices: usize,
    /// Connected parts other than the one that is kept.
    pub dropped_components: usize,
    /// Vertices of those parts.
    pub dropped_component_vertices: usize,
    /// Faces whose winding was turned to agree with their neighbours.
    pub flipped_faces: usize,
    /// Edges with more than two faces.
    pub nonmanifold_edges: usize,
    /// Edges with one face.
    pub boundary_edges: usize,
}

/// Largest connected part of a triangle mesh, scaled to unit area and centred at its area centroid.
///
/// Lengths here are unit-area lengths; multiply by `scale` for the mesh's own.
#[derive(Debug, Clone)]
pub struct Mesh {
    /// Vertex positions, `(n)`, at unit area.
    pub vertices: Vec<Point>,
    /// Triangles, `(m)`, consistently wound where the surface is orientable.
    pub faces: Vec<[u32; 3]>,
    /// What each vertex was as the intake was given it.
    pub input_vertex: Vec<InputVertex>,
    /// Given face of each face.
    pub input_face: Vec<u32>,
    /// Whether the last two corners of each face were exchanged to turn its winding.
    pub turned: Vec<bool>,
    /// Given mesh's length of one unit here: √area.
    pub scale: f64,
    /// Area centroid of the part in given coordinates.
    pub centre: Point,
    /// What was ignored or mended.
    pub report: IntakeReport,
    /// Every given vertex at the scale of `vertices`, so that dropped ones can be placed.
    pub input_positions: Vec<Point>,
}

/// Neighbours of each vertex in compressed rows.
#[derive(Debug, Clone)]
pub struct Adjacency {
    /// Start of each vertex's row, `(n + 1)`.
    pub starts: Vec<u32>,
    /// Entries of the rows.
    pub entries: Vec<u32>,
}

impl Adjacency {
    /// Entries of one row.
    #[must_use]
    pub fn row(&self, i: usize) -> &[u32] {
        &self.entries[self.starts[i] as usize..self.starts[i + 1] as usize]
    }

    /// No entries in any row.
    #[must_use]
    pub fn empty(rows: usize) -> Self {
        Self {
            starts: vec![0; rows + 1],
            entries: Vec::new(),
        }
    }

    pub(crate) fn from_lists(rows: usize, pairs: impl Iterator<Item = (u32, u32)> + Clone) -> Self {
        let mut starts = vec![0u32; rows + 1];
        for (i, _) in pairs.clone() {
            starts[i as usize + 1] += 1;
        }
        for i in 0..rows {
            starts[i + 1] += starts[i];
        }
        let mut fill = starts.clone();
        let mut entries = vec![0u32; starts[rows] as usize];
        for (i, j) in pairs {
            entries[fill[i as usize] as usize] = j;
            fill[i as usize] += 1;
        }
        Self { starts, entries }
    }
}

/// For each vertex the number of the nearest of some `centres`, by edges; the first of them where several are as near or
/// none is connected.
pub(crate) fn cells(neighbours: &Adjacency, centres: &[u32]) -> Vec<u32> {
    const NONE: u32 = u32::MAX;
    let mut cell = vec![NONE; neighbours.starts.len() - 1];
    let mut reached = centres.to_vec();
    for (number, &v) in centres.iter().enumerate() {
        cell[v as usize] = number as u32;
    }
    let mut next = 0;
    while next < reached.len() {
        let v = reached[next];
        for &u in neighbours.row(v as usize) {
            if cell[u as usize] == NONE {
                cell[u as usize] = cell[v as usize];
                reached.push(u);
            }
        }
        next += 1;
    }
    cell.into_iter()
        .map(|c| if c == NONE { 0 } else { c })
        .collect()
}

/// Which of `count` [cells] touch one another.
pub(crate) fn between_cells(neighbours: &Adjacency, cell: &[u32], count: usize) -> Adjacency {
    let across = |v: usize| {
        let others = neighbours.row(v).iter().map(|&u| cell[u as usize]);
        others
            .filter(move |&other| other != cell[v])
            .map(move |other| (cell[v], other))
    };
    let mut touching: Vec<(u32, u32)> = (0..cell.len()).flat_map(across).collect();
    touching.sort_unstable();
    touching.dedup();
    Adjacency::from_lists(count, touching.into_iter())
}

impl Mesh {
    /// Checks and cleans a triangle mesh.
    ///
    /// Duplicate faces are dropped, and those without an area, except where they join two others:
    /// vertices on the straight edge of a triangle need them. Windings are made to agree. Of the
    /// connected parts with vertices enough for a spectrum the one with the largest area is kept: a
    /// ground plane of two triangles may be larger than the character on it.
    ///
    /// # Errors
    /// [`Error::NotFinite`], [`Error::FaceIndexOutOfRange`], [`Error::EmptyMesh`],
    /// [`Error::TooFewVertices`].
    pub fn new(vertices: &[Point], faces: &[[i64; 3]]) -> Result<Self> {
        let mut report = IntakeReport::default();
        let (mut kept, normalised, unit, origin) = checked_faces(vertices, faces, &mut report)?;
        drop_smaller_components(vertices.len(), &normalised, &mut kept, &mut report);
        let turned = orient(&mut kept, &mut report);

        let mut new_id = vec![u32::MAX; vertices.len()];
        let mut input_vertex = Vec::new();
        for (_, face) in &mut kept {
            for corner in face.iter_mut() {
                let id = &mut new_id[*corner as usize];
                if *id == u32::MAX {
                    *id = 0;
                    input_vertex.push(*corner);
                }
            }
        }
        input_vertex.sort_unstable();
        for (new, &old) in input_vertex.iter().enumerate() {
            new_id[old as usize] = new as u32;
        }
        if input_vertex.len() < INTAKE.fewest_vertices {
            return Err(Error::TooFewVertices {
                found: input_vertex.len(),
                wanted: INTAKE.fewest_vertices,
            });
        }
        let faces: Vec<[u32; 3]> = kept
            .iter()
            .map(|(_, f)| f.map(|v| new_id[v as usize]))
            .collect();
        let positions: Vec<Point> = input_vertex
            .iter()
            .map(|&v| normalised[v as usize])
            .collect();

        let (area, centre) = area_and_centroid(&positions, &faces);
        let reach = positions.iter().map(|&p| vector::distance(p, centre));
        if area <= INTAKE.least_surface * reach.fold(0.0, f64::max).powi(2) {
            return Err(Error::EmptyMesh {
                vertices: vertices.len(),
                faces: faces.len(),
            });
        }
        let length = area.sqrt();
        let place = |p: &Point| vector::scaled(vector::sub(*p, centre), 1.0 / length);
        Ok(Self {
            vertices: positions.iter().map(place).collect(),
            faces,
            input_vertex: InputVertex::each(input_vertex),
            input_face: kept.iter().map(|&(id, _)| id).collect(),
            scale: length * unit,
            centre: vector::add(origin, vector::scaled(centre, unit)),
            turned,
            report,
            input_positions: normalised.iter().map(place).collect(),
        })
    }

    /// Whether every edge has one face or two, the faces around every vertex are one fan, and no
    /// face is a needle: then the cotangent weights of its triangles are sound.
    #[must_use]
    pub fn is_regular(&self) -> bool {
        let edges = edge_faces(self.faces.iter().copied());
        // Corners of faces that share an edge at a vertex belong to one fan.
        let mut fans: Vec<u32> = (0..3 * self.faces.len() as u32).collect();
        let mut count = fans.len();
        for run in edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            let [first, second] = match run {
                [_] => continue,
                [a, b] => [a.2, b.2],
                _ => return false,
            };
            for vertex in [run[0].0, run[0].1] {
                let [a, b] = [first, second].map(|face| {
                    let corners = self.faces[face as usize];
                    let corner =
                        u32::from(corners[1] == vertex) + 2 * u32::from(corners[2] == vertex);
                    find(&mut fans, 3 * face + corner)
                });
                if a != b {
                    fans[b as usize] = a;
                    count -= 1;
                }
            }
        }
        count == self.vertices.len()
            && self
                .faces
                .iter()
                .all(|&face| relative_area(&self.vertices, face) > INTAKE.needle_relative_area)
    }

    /// A point of this mesh in given coordinates.
    #[must_use]
    pub fn as_given(&self, p: Point) -> Point {
        vector::add(vector::scaled(p, self.scale), self.centre)
    }

    /// A point in given coordinates in those of this mesh.
    #[must_use]
    pub fn as_own(&self, p: Point) -> Point {
        vector::scaled(vector::sub(p, self.centre), 1.0 / self.scale)
    }

    /// Whether a face has so little area that its angles are noise.
    #[must_use]
    pub fn is_flat(&self, face: usize) -> bool {
        is_flat(&self.vertices, self.faces[face])
    }

    /// Area of one face.
    #[must_use]
    pub fn face_area(&self, face: usize) -> f64 {
        vector::norm(self.face_cross(face)) / 2.0
    }

    /// Twice the area of a face times its normal.
    #[must_use]
    pub fn face_cross(&self, face: usize) -> Point {
        let [a, b, c] = self.faces[face].map(|v| self.vertices[v as usize]);
        vector::cross(vector::sub(b, a), vector::sub(c, a))
    }

    /// Sign of the enclosed volume: +1 when the windings point outward, −1 otherwise.
    #[must_use]
    pub fn volume_sign(&self) -> f64 {
        let volume: f64 = self
            .faces
            .iter()
            .map(|f| {
                let [a, b, c] = f.map(|v| self.vertices[v as usize]);
                vector::dot(a, vector::cross(b, c))
            })
            .sum();
        if volume < 0.0 { -1.0 } else { 1.0 }
    }

    /// Area-weighted unit normals, `(n)`; zero where they cancel.
    #[must_use]
    pub fn vertex_normals(&self) -> Vec<Point> {
        normals_of(&self.vertices, &self.faces)
    }

    /// Vertices that share an edge with each vertex, in ascending order.
    #[must_use]
    pub fn vertex_neighbours(&self) -> Adjacency {
        let around = self.vertex_faces();
        let mut starts = Vec::with_capacity(self.vertices.len() + 1);
        let mut entries = Vec::with_capacity(3 * self.faces.len());
        let mut row = Vec::new();
        starts.push(0);
        for v in 0..self.vertices.len() {
            let corners = around.row(v).iter().flat_map(|&f| self.faces[f as usize]);
            row.clear();
            row.extend(corners.filter(|&u| u as usize != v));
            row.sort_unstable();
            row.dedup();
            entries.extend_from_slice(&row);
            starts.push(entries.len() as u32);
        }
        Adjacency { starts, entries }
    }

    /// Faces around each vertex, in ascending order.
    #[must_use]
    pub fn vertex_faces(&self) -> Adjacency {
        Adjacency::from_lists(
            self.vertices.len(),
            self.faces
                .iter()
                .enumerate()
                .flat_map(|(f, corners)| corners.map(|v| (v, f as u32))),
        )
    }

    /// Whether the surface has a rim.
    #[must_use]
    pub fn is_open(&self) -> bool {
        self.report.boundary_edges > 0
    }

    /// Vertices of the edges with one face, in ascending order.
    #[must_use]
    pub fn boundary_vertices(&self) -> Vec<u32> {
        let edges = edge_faces(self.faces.iter().copied());
        let mut ids: Vec<u32> = edges
            .chunk_by(|a, b| (a.0, a.1) == (b.0, b.1))
            .filter(|run| run.len() == 1)
            .flat_map(|run| [run[0].0, run[0].1])
            .collect();
        ids.sort_unstable();
        ids.dedup();
        ids
    }
}

/// Area-weighted unit vertex normals of any positions on a face list.
#[must_use]
pub fn normals_of(positions: &[Point], faces: &[[u32; 3]]) -> Vec<Point> {
    let mut normals = vec![[0.0; 3]; positions.len()];
    for f in faces {
        let [a, b, c] = f.map(|v| positions[v as usize]);
        let n = vector::cross(vector::sub(b, a), vector::sub(c, a));
        for &v in f {
            normals[v as usize] = vector::add(normals[v as usize], n);
        }
    }
    for n in &mut normals {
        *n = vector::normalised(*n);
    }
    normals
}

type FacesWithIds = Vec<(u32, [u32; 3])>;

/// Valid faces with their ids, and positions moved and scaled so that products of coordinates
/// neither overflow nor vanish, with the length of one unit and the origin.
fn checked_faces(
    vertices: &[Point],
    faces: &[[i64; 3]],
    report: &mut IntakeReport,
) -> Result<(FacesWithIds, Vec<Point>, f64, Point)> {
    if let Some(vertex) = vertices
        .iter()
        .position(|p| !p.iter().all(|x| x.is_finite()))
    {
        return Err(Error::NotFinite { vertex });
    }
    for (face, corners) in faces.iter().enumerate() {
        for &index in corners {
            if index < 0 || index as usize >= vertices.len() {
                return Err(Error::FaceIndexOutOfRange {
                    face,
                    index,
                    vertices: vertices.len(),
                });
            }
        }
    }
    let mut used = vec![false; vertices.len()];
    for &v in faces.iter().flatten() {
        used[v as usize] = true;
    }
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for (p, _) in vertices.iter().zip(&used).filter(|(_, used)| **used) {
        low = [0, 1, 2].map(|i| low[i].min(p[i]));
        high = [0, 1, 2].map(|i| high[i].max(p[i]));
    }
    let unit = (0..3)
        .map(|i| high[i] / 2.0 - low[i] / 2.0)
        .fold(0.0, f64::max)
        * 2.0;
    if faces.is_empty() || unit <= 0.0 {
        return Err(Error::EmptyMesh {
            vertices: vertices.len(),
            faces: faces.len(),
        });
    }
    let origin = [0, 1, 2].map(|i| low[i] / 2.0 + high[i] / 2.0);
    let normalised: Vec<Point> = vertices
        .iter()
        .map(|p| [0, 1, 2].map(|i| p[i] / unit - origin[i] / unit))
        .collect();

    let mut kept: FacesWithIds = (0..)
        .zip(faces)
        .map(|(id, corners)| (id, corners.map(|v| v as u32)))
        .filter(|(_, [a, b, c])| a != b && b != c && c != a)
        .collect();
    report.zero_area_faces += faces.len() - kept.len();
    drop_duplicates(&mut kept, report);
    drop_flat_faces(&normalised, &mut kept, report);
    if kept.iter().all(|(_, f)| is_flat(&normalised, *f)) {
        return Err(Error::EmptyMesh {
            vertices: vertices.len(),
            faces: faces.len(),
        });
    }
    Ok((kept, normalised, unit, origin))
}

/// Keeps the first of faces with the same corners.
fn drop_duplicates(faces: &mut FacesWithIds, report: &mut IntakeReport) {
    let corners = (0..).zip(faces.iter()).map(|(place, &(_, face))| {
        let mut corners = face;
        corners.sort_unstable();
        (corners, place)
    });
    let sorted: Vec<([u32; 3], u32)> = sorted_by_vertex(corners, |(corners, _)| corners[0]);
    let mut repeated = vec![false; faces.len()];
    for pair in sorted.windows(2).filter(|pair| pair[0].0 == pair[1].0) {
        repeated[pair[1].1 as usize] = true;
    }
    let before = faces.len();
    let mut fate = repeated.iter();
    faces.retain(|_| fate.next() == Some(&false));
    report.duplicate_faces += before - faces.len();
}

/// Whether a face has no area worth the name.
fn is_flat(positions: &[Point], face: [u32; 3]) -> bool {
    relative_area(positions, face) <= LEAST_RELATIVE_AREA
}

/// Area over the square of the longest edge; 0 when two corners coincide.
fn relative_area(positions: &[Point], face: [u32; 3]) -> f64 {
    let [a, b, c] = face.map(|v| positions[v as usize]);
    let (ab, bc, ca) = (vector::sub(b, a), vector::sub(c, b), vector::sub(a, c));
    let squares = [ab, bc, ca].map(|e| vector::dot(e, e));
    if squares.contains(&0.0) {
        return 0.0;
    }
    let longest = squares.into_iter().fold(0.0, f64::max);
    vector::norm(vector::cross(ab, ca)) / 2.0 / longest
}

/// Drops the flat faces that do not join another face across each of their edges.
fn drop_flat_faces(positions: &[Point], faces: &mut FacesWithIds, report: &mut IntakeReport) {
    let flat: Vec<bool> = faces.iter().map(|(_, f)| is_flat(positions, *f)).collect();
    if !flat.contains(&true) {
        return;
    }
    let edges = edge_faces(faces.iter().map(|(_, f)| *f));
    let mut joins = vec![true; faces.len()];
    for run in edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        if run.len() != 2 {
            for edge in run {
                joins[edge.2 as usize] = false;
            }
        }
    }
    let mut fate = flat.iter().zip(&joins);
    faces.retain(|_| match fate.next() {
        Some((true, false)) => {
            report.zero_area_faces += 1;
            false
        }
        Some((true, true)) => {
            report.bridging_faces += 1;
            true
        }
        _ => true,
    });
}

/// Keeps the part connected through shared vertices that has the largest area among those with
/// `INTAKE.fewest_vertices`, or among all where none has so many.
fn drop_smaller_components(
    vertices: usize,
    positions: &[Point],
    faces: &mut FacesWithIds,
    report: &mut IntakeReport,
) {
    let mut parent: Vec<u32> = (0..vertices as u32).collect();
    let mut used = vec![false; vertices];
    for (_, f) in faces.iter() {
        let root = find(&mut parent, f[0]);
        for &v in f {
            let other = find(&mut parent, v);
            parent[other as usize] = root;
            used[v as usize] = true;
        }
    }
    let mut area = vec![0.0; vertices];
    for (_, f) in faces.iter() {
        let [a, b, c] = f.map(|v| positions[v as usize]);
        let root = find(&mut parent, f[0]);
        area[root as usize] += vector::norm(vector::cross(vector::sub(b, a), vector::sub(c, a)));
    }
    let mut size = vec![0; vertices];
    for v in (0..vertices).filter(|&v| used[v]) {
        size[find(&mut parent, v as u32) as usize] += 1;
    }
    let parts = (0..vertices).filter(|&v| size[v] > 0);
    let rank = |v: usize| (size[v] >= INTAKE.fewest_vertices, area[v]);
    // Of equals the first, whatever comes later.
    let main = parts
        .clone()
        .reduce(|best, v| if rank(v) > rank(best) { v } else { best })
        .expect("there is a face");
    report.isolated_vertices = used.iter().filter(|&&used| !used).count();
    report.dropped_components = parts.clone().count() - 1;
    report.dropped_component_vertices = parts.map(|v| size[v]).sum::<usize>() - size[main];
    faces.retain(|(_, f)| find(&mut parent, f[0]) as usize == main);
}

fn find(parent: &mut [u32], v: u32) -> u32 {
    let mut root = v;
    while parent[root as usize] != root {
        parent[root as usize] = parent[parent[root as usize] as usize];
        root = parent[root as usize];
    }
    root
}

/// Edge with its faces; the flag says whether the face runs from the lower to the higher vertex.
pub(crate) fn edge_faces(
    faces: impl Iterator<Item = [u32; 3]> + Clone,
) -> Vec<(u32, u32, u32, bool)> {
    let edges = (0..).zip(faces).flat_map(|(face, [a, b, c])| {
        [(a, b), (b, c), (c, a)].map(|(u, v)| (u.min(v), u.max(v), face, u < v))
    });
    sorted_by_vertex(edges, |edge| edge.0)
}

/// Entries in their order, which begins with the order of a `vertex` that few of them share: each goes straight to
/// those of its vertex.
fn sorted_by_vertex<T: Ord + Copy + Default>(
    entries: impl Iterator<Item = T> + Clone,
    vertex: impl Fn(&T) -> u32,
) -> Vec<T> {
    let mut ends = Vec::new();
    for entry in entries.clone() {
        let v = vertex(&entry) as usize;
        if v >= ends.len() {
            ends.resize(v + 1, 0);
        }
        ends[v] += 1;
    }
    let mut count = 0;
    for end in &mut ends {
        count += std::mem::replace(end, count);
    }
    let mut sorted = vec![T::default(); count];
    for entry in entries {
        let end = &mut ends[vertex(&entry) as usize];
        sorted[*end] = entry;
        *end += 1;
    }
    let mut start = 0;
    for end in ends {
        sorted[start..end].sort_unstable();
        start = end;
    }
    sorted
}

/// Turns windings so that neighbours across manifold edges agree; each part connected that way
/// keeps the winding of the majority of its faces. Returns which faces were turned.
fn orient(faces: &mut FacesWithIds, report: &mut IntakeReport) -> Vec<bool> {
    /// No face across an edge.
    const NOTHING: (u32, bool) = (u32::MAX, false);
    let edges = edge_faces(faces.iter().map(|(_, f)| *f));
    // The faces across the edges of each, and whether both wind alike.
    let mut across = vec![[NOTHING; 3]; faces.len()];
    let mut link = |face: u32, other: u32, agree: bool| {
        let own = &mut across[face as usize];
        if let Some(free) = own.iter_mut().find(|place| **place == NOTHING) {
            *free = (other, agree);
        }
    };
    for run in edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        match run {
            [_] => report.boundary_edges += 1,
            [a, b] => {
                let agree = a.3 != b.3;
                link(a.2, b.2, agree);
                link(b.2, a.2, agree);
            }
            _ => report.nonmanifold_edges += 1,
        }
    }
    for own in &mut across {
        own.sort_unstable();
    }
    let mut turned: Vec<Option<bool>> = vec![None; faces.len()];
    for seed in 0..faces.len() {
        if turned[seed].is_some() {
            continue;
        }
        turned[seed] = Some(false);
        let mut patch = vec![seed as u32];
        let mut next = 0;
        while next < patch.len() {
            let f = patch[next];
            next += 1;
            let flag = turned[f as usize] == Some(true);
            for &(g, agree) in across[f as usize].iter().filter(|&&own| own != NOTHING) {
                if turned[g as usize].is_none() {
                    turned[g as usize] = Some(flag == agree);
                    patch.push(g);
                }
            }
        }
        let flips = patch
            .iter()
            .filter(|&&f| turned[f as usize] == Some(true))
            .count();
        if 2 * flips > patch.len() {
            for &f in &patch {
                turned[f as usize] = turned[f as usize].map(|t| !t);
            }
        }
    }
    let turned: Vec<bool> = turned.into_iter().map(|t| t == Some(true)).collect();
    for ((_, face), &turn) in faces.iter_mut().zip(&turned) {
        if turn {
            face.swap(1, 2);
            report.flipped_faces += 1;
        }
    }
    turned
}

/// Total area and its centroid.
fn area_and_centroid(positions: &[Point], faces: &[[u32; 3]]) -> (f64, Point) {
    let mut area = 0.0;
    let mut moment = [0.0; 3];
    for f in faces {
        let [a, b, c] = f.map(|v| positions[v as usize]);
        let weight = vector::norm(vector::cross(vector::sub(b, a), vector::sub(c, a))) / 2.0;
        area += weight;
        let corners = vector::add(vector::add(a, b), c);
        moment = vector::add(moment, vector::scaled(corners, weight / 3.0));
    }
    (area, vector::scaled(moment, 1.0 / area))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_sorted_by_vertex_are_in_the_order_of_a_sort() {
        // Products modulo a prime scatter; vertices are repeated, and some have no entry.
        let entries = (1..500u32).map(|i| ((i * 7919) % 101 / 2, (i * 104_729) % 997, i));
        let mut expected: Vec<_> = entries.clone().collect();
        expected.sort_unstable();
        assert_eq!(sorted_by_vertex(entries, |entry| entry.0), expected);
        assert!(sorted_by_vertex(std::iter::empty::<(u32, u32)>(), |entry| entry.0).is_empty());
    }
}
