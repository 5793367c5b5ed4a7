//! Vertices at one place made one: what exporters split at texture seams, hard edges and materials is one surface again.
//!
//! Two faces with the same three corners after welding are one sheet: front and back of cloth that was given a second
//! time with its winding turned, so that both sides are drawn. The first stays, and a sheet stays a manifold. Where two
//! surfaces merely touch along an edge, more than two faces meet there: all of them stay and keep the edge, since
//! [`crate::spectrum::intrinsic_triangulation`] walks from each to the next around it, and [`crate::mesh::Mesh`] keeps
//! them in one connected part.

use super::edge_faces;
use crate::algebra::vector::{self, Point};
use crate::error::{Error, Result};
use crate::mesh::settings::WELD;

/// Width of a cell of the grid in tolerances: three of four points, wherever they are, look into one cell only along an axis.
const CELL: f64 = 8.0;

/// Where in a cell the corner of the bounding box lies. Many vertices of characters are exactly at the ends and in the
/// middle of the box, which should not be the border of a cell.
const CELL_SHIFT: f64 = 0.37;

/// Faces whose numbers are those of so many vertices.
///
/// # Errors
/// [`Error::FaceIndexOutOfRange`].
pub fn checked_faces(vertices: usize, faces: &[[i64; 3]]) -> Result<Vec<[u32; 3]>> {
    let checked = faces.iter().enumerate().map(|(face, corners)| {
        let is_known = |index: &i64| (0..vertices as i64).contains(index);
        match corners.iter().find(|index| !is_known(index)) {
            Some(&index) => Err(Error::FaceIndexOutOfRange {
                face,
                index,
                vertices,
            }),
            None => Ok(corners.map(|v| v as u32)),
        }
    });
    checked.collect()
}

/// A mesh whose vertices at one place are one.
#[derive(Debug, Clone, PartialEq)]
pub struct Welded {
    /// Place of the first given vertex of each class, in the order of first appearance.
    pub vertices: Vec<Point>,
    /// Faces that have three corners left and are not the copy of an earlier one, in their order.
    pub faces: Vec<[u32; 3]>,
    /// Welded vertex of each given vertex.
    pub class: Vec<u32>,
    /// Given face of each welded face.
    pub face: Vec<u32>,
}

impl Welded {
    /// Welds the vertices of a mesh within `WELD.weld_tolerance`.
    ///
    /// A vertex joins the first earlier class whose first vertex is within the tolerance. Vertices that are not finite
    /// stay alone, and unless a sheet was given twice those with faces all around: a surface that touches itself there is
    /// not cut. Without two vertices at one place the result is what was given, faces without an area included.
    /// O(n); the same on every machine.
    ///
    /// # Errors
    /// [`Error::FaceIndexOutOfRange`].
    pub fn of(vertices: &[Point], faces: &[[u32; 3]]) -> Result<Self> {
        for (face, corners) in faces.iter().enumerate() {
            if let Some(&index) = corners.iter().find(|&&v| v as usize >= vertices.len()) {
                return Err(Error::FaceIndexOutOfRange {
                    face,
                    index: i64::from(index),
                    vertices: vertices.len(),
                });
            }
        }
        let (mut class, mut first) = classes(vertices, faces, &|_| true);
        if first.len() < vertices.len()
            && copies(faces, &class) <= WELD.doubled * faces.len() as f64
        {
            let at_seam = at_boundary(vertices.len(), faces);
            (class, first) = classes(vertices, faces, &|v| at_seam[v as usize]);
        }
        if first.len() == vertices.len() {
            return Ok(Self::unchanged(vertices, faces));
        }
        let welded = faces.iter().map(|f| f.map(|v| class[v as usize]));
        let whole = (0..)
            .zip(welded)
            .filter(|(_, [a, b, c])| a != b && b != c && c != a);
        let (face, faces) = without_copies(whole.collect()).into_iter().unzip();
        Ok(Self {
            vertices: first.iter().map(|&v| vertices[v as usize]).collect(),
            faces,
            class,
            face,
        })
    }

    /// A mesh as it is, each of its vertices alone.
    #[must_use]
    pub fn unchanged(vertices: &[Point], faces: &[[u32; 3]]) -> Self {
        Self {
            vertices: vertices.to_vec(),
            faces: faces.to_vec(),
            class: (0..vertices.len() as u32).collect(),
            face: (0..faces.len() as u32).collect(),
        }
    }

    /// Whether two given vertices are at one place.
    #[must_use]
    pub fn has_joined(&self) -> bool {
        self.vertices.len() < self.class.len()
    }
}

/// How many faces have their corners where another has them.
fn copies(faces: &[[u32; 3]], class: &[u32]) -> f64 {
    let mut corners: Vec<[u32; 3]> = faces
        .iter()
        .map(|f| f.map(|v| class[v as usize]))
        .filter(|[a, b, c]| a != b && b != c && c != a)
        .map(|mut corners| {
            corners.sort_unstable();
            corners
        })
        .collect();
    corners.sort_unstable();
    let pairs = corners.windows(2).filter(|pair| pair[0] == pair[1]);
    pairs.count() as f64
}

/// Which vertices are on an edge of one face, or on no face.
fn at_boundary(vertices: usize, faces: &[[u32; 3]]) -> Vec<bool> {
    let mut at_boundary = vec![true; vertices];
    for &v in faces.iter().flatten() {
        at_boundary[v as usize] = false;
    }
    let edges = edge_faces(faces.iter().copied());
    for run in edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        if let [alone] = run {
            at_boundary[alone.0 as usize] = true;
            at_boundary[alone.1 as usize] = true;
        }
    }
    at_boundary
}

/// Class of each vertex, of those that may join another, and first vertex of each class.
fn classes(
    vertices: &[Point],
    faces: &[[u32; 3]],
    may_join: &dyn Fn(u32) -> bool,
) -> (Vec<u32>, Vec<u32>) {
    let is_finite = |p: &Point| p.iter().all(|x| x.is_finite());
    let corners = faces.iter().flatten().map(|&v| vertices[v as usize]);
    let [low, high] = bulk(&corners.filter(is_finite).collect::<Vec<_>>());
    // Halves, since the difference of the largest numbers overflows.
    let half = [0, 1, 2].map(|i| (high[i] / 2.0 - low[i] / 2.0).max(0.0));
    let reach = half.into_iter().fold(0.0, f64::max) * 2.0;
    let unit = if reach > 0.0 { reach } else { 1.0 };
    let tolerance = WELD.weld_tolerance * 2.0 * vector::norm(half.map(|x| x / unit));
    let cell = if tolerance > 0.0 {
        CELL * tolerance
    } else {
        1.0
    };
    let origin = low.map(|x| if x.is_finite() { x / unit } else { 0.0 });

    let mut class = Vec::with_capacity(vertices.len());
    let mut first: Vec<u32> = Vec::new();
    let mut places: Vec<Point> = Vec::new();
    let mut table = Table::new(vertices.len());
    for (v, p) in (0..).zip(vertices) {
        let place = [0, 1, 2].map(|i| p[i] / unit - origin[i]);
        let cell_at = |shift: f64| place.map(|x| ((x + shift) / cell + CELL_SHIFT).floor() as i64);
        let joins = is_finite(p) && may_join(v);
        let found = joins
            .then(|| {
                let near = |&c: &u32| vector::distance(places[c as usize], place) <= tolerance;
                let cells = between(cell_at(-tolerance), cell_at(tolerance));
                cells
                    .filter_map(|cell| table.entries(cell).filter(near).min())
                    .min()
            })
            .flatten();
        class.push(found.unwrap_or(first.len() as u32));
        if found.is_none() {
            table.add(joins.then(|| cell_at(0.0)));
            first.push(v);
            places.push(place);
        }
    }
    (class, first)
}

/// The bounding box of points, but for those so far out that they say nothing of the size of the rest: beyond `WELD.far`
/// times the largest extent of all but a hundredth at either end of each axis.
fn bulk(points: &[Point]) -> [Point; 2] {
    if points.is_empty() {
        return [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
    }
    let few = points.len() / 100;
    let ends = [0, 1, 2].map(|axis| {
        let mut along: Vec<f64> = points.iter().map(|p| p[axis]).collect();
        let last = along.len() - 1;
        [few, last - few].map(|n| *along.select_nth_unstable_by(n, f64::total_cmp).1)
    });
    // Halves, since the difference of the largest numbers overflows.
    let extent = ends
        .iter()
        .map(|[low, high]| high / 2.0 - low / 2.0)
        .fold(0.0, f64::max);
    let near = |axis: usize, x: f64| {
        let [low, high] = ends[axis];
        low / 2.0 - x / 2.0 <= WELD.far * extent && x / 2.0 - high / 2.0 <= WELD.far * extent
    };
    let mut bounds = [ends.map(|[low, _]| low), ends.map(|[_, high]| high)];
    for p in points {
        for axis in (0..3).filter(|&axis| near(axis, p[axis])) {
            bounds[0][axis] = bounds[0][axis].min(p[axis]);
            bounds[1][axis] = bounds[1][axis].max(p[axis]);
        }
    }
    bounds
}

/// All cells from one corner to the other.
fn between(low: [i64; 3], high: [i64; 3]) -> impl Iterator<Item = [i64; 3]> {
    (low[0]..=high[0]).flat_map(move |x| {
        (low[1]..=high[1]).flat_map(move |y| (low[2]..=high[2]).map(move |z| [x, y, z]))
    })
}

/// No entry.
const NONE: u32 = u32::MAX;

/// Numbers 0, 1, … by the cell they are in. Cells that share a row of the table are not told apart.
struct Table {
    /// Last entry of each row.
    last: Vec<u32>,
    /// Entry before each entry in its row.
    before: Vec<u32>,
}

impl Table {
    fn new(count: usize) -> Self {
        Self {
            last: vec![NONE; (2 * count).next_power_of_two()],
            before: Vec::new(),
        }
    }

    fn row(&self, cell: [i64; 3]) -> usize {
        // Odd factors with bits all over, the first 2⁶⁴ over the golden ratio: their products differ in the high bits.
        const FACTORS: [u64; 3] = [
            0x9e37_79b9_7f4a_7c15,
            0xc2b2_ae3d_27d4_eb4f,
            0x1656_67b1_9e37_79f9,
        ];
        let mixed = (0..3).fold(0u64, |sum, i| {
            (sum ^ cell[i] as u64)
                .wrapping_mul(FACTORS[i])
                .rotate_left(29)
        });
        (mixed.wrapping_mul(FACTORS[0]) >> 32) as usize & (self.last.len() - 1)
    }

    fn entries(&self, cell: [i64; 3]) -> impl Iterator<Item = u32> {
        let known = |entry: u32| (entry != NONE).then_some(entry);
        std::iter::successors(known(self.last[self.row(cell)]), move |&entry| {
            known(self.before[entry as usize])
        })
    }

    /// Adds the next number, in a cell or nowhere.
    fn add(&mut self, cell: Option<[i64; 3]>) {
        let number = self.before.len() as u32;
        let before = match cell.map(|cell| self.row(cell)) {
            Some(row) => std::mem::replace(&mut self.last[row], number),
            None => NONE,
        };
        self.before.push(before);
    }
}

/// The first of all faces with the same corners.
fn without_copies(mut faces: Vec<(u32, [u32; 3])>) -> Vec<(u32, [u32; 3])> {
    let mut sorted: Vec<([u32; 3], u32)> = (0..)
        .zip(&faces)
        .map(|(place, &(_, mut corners))| {
            corners.sort_unstable();
            (corners, place)
        })
        .collect();
    sorted.sort_unstable();
    let mut is_copy = vec![false; faces.len()];
    for pair in sorted.windows(2).filter(|pair| pair[0].0 == pair[1].0) {
        is_copy[pair[1].1 as usize] = true;
    }
    let mut fate = is_copy.into_iter();
    faces.retain(|_| fate.next() == Some(false));
    faces
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A grid of squares in a plane, each of two triangles.
    fn plane(side: u32) -> (Vec<Point>, Vec<[u32; 3]>) {
        let at = |i: u32, j: u32| i * (side + 1) + j;
        let vertices = (0..=side)
            .flat_map(|i| (0..=side).map(move |j| [f64::from(i), 0.3 * f64::from(j), 2.0]))
            .collect();
        let faces = (0..side)
            .flat_map(|i| (0..side).map(move |j| (i, j)))
            .flat_map(|(i, j)| {
                [
                    [at(i, j), at(i + 1, j), at(i + 1, j + 1)],
                    [at(i, j), at(i + 1, j + 1), at(i, j + 1)],
                ]
            })
            .collect();
        (vertices, faces)
    }

    /// Each face with three vertices of its own.
    fn shattered(vertices: &[Point], faces: &[[u32; 3]]) -> (Vec<Point>, Vec<[u32; 3]>) {
        let corners = faces.iter().flatten().map(|&v| vertices[v as usize]);
        let apart = (0..faces.len() as u32).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]);
        (corners.collect(), apart.collect())
    }

    #[test]
    fn what_has_no_two_vertices_at_one_place_stays_to_the_last_bit() {
        let (mut vertices, mut faces) = plane(5);
        vertices.push([f64::NAN, 0.0, 1.0]);
        faces.push([3, 3, 4]);
        faces.push(faces[0]);
        let welded = Welded::of(&vertices, &faces).expect("faces in range");
        assert!(!welded.has_joined());
        assert!(welded.class.iter().copied().eq(0..vertices.len() as u32));
        assert!(welded.face.iter().copied().eq(0..faces.len() as u32));
        assert_eq!(welded.faces, faces);
        let bits = |p: &Point| p.map(f64::to_bits);
        assert!(
            welded
                .vertices
                .iter()
                .map(bits)
                .eq(vertices.iter().map(bits))
        );
    }

    #[test]
    fn a_shattered_plane_is_whole_again_with_first_vertices_in_order() {
        let (vertices, faces) = plane(7);
        let (apart, triangles) = shattered(&vertices, &faces);
        let welded = Welded::of(&apart, &triangles).expect("faces in range");
        assert_eq!(welded.vertices.len(), vertices.len());
        assert_eq!(welded.faces.len(), faces.len());
        for (v, &class) in welded.class.iter().enumerate() {
            assert_eq!(welded.vertices[class as usize], apart[v]);
        }
        let mut seen = 0;
        for &class in &welded.class {
            assert!(class <= seen);
            seen = seen.max(class + 1);
        }
    }

    #[test]
    fn the_tolerance_parts_what_is_one_place_from_what_is_two() {
        let diagonal = 3f64.sqrt();
        for (gap, joined) in [(0.9, true), (1.1, false)] {
            let d = gap * WELD.weld_tolerance * diagonal;
            for axis in 0..3 {
                for start in [0.0, 0.5, 0.123_456_7] {
                    let mut one = [start; 3];
                    let mut other = one;
                    other[axis] += d;
                    one[(axis + 1) % 3] = start;
                    let vertices = [[0.0; 3], [1.0; 3], [0.0, 1.0, 0.0], one, other];
                    let welded = Welded::of(&vertices, &[[0, 1, 2]]).expect("faces in range");
                    assert_eq!(welded.class[3] == welded.class[4], joined);
                }
            }
        }
    }

    #[test]
    fn the_scale_and_the_place_do_not_matter() {
        let (vertices, faces) = plane(4);
        let (apart, triangles) = shattered(&vertices, &faces);
        let expected = Welded::of(&apart, &triangles)
            .expect("faces in range")
            .class;
        for (scale, shift) in [(1e-150, 0.0), (1e300, 0.0), (1024.0, 4096.0), (1e-3, -8.0)] {
            let moved: Vec<Point> = apart.iter().map(|p| p.map(|x| scale * x + shift)).collect();
            let welded = Welded::of(&moved, &triangles).expect("faces in range");
            assert_eq!(welded.class, expected);
        }
    }

    #[test]
    fn a_closed_surface_that_touches_itself_is_not_joined_there() {
        // Two tetrahedra that share the place of one corner.
        let corners = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let mirrored = corners.map(|p: Point| p.map(|x| -x));
        let sides = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]];
        let faces: Vec<[u32; 3]> = sides
            .into_iter()
            .chain(sides.map(|f| f.map(|v| v + 4)))
            .collect();
        let vertices = [corners, mirrored].concat();
        let welded = Welded::of(&vertices, &faces).expect("faces in range");
        assert!(!welded.has_joined());
        // Without one side each has a boundary there.
        let welded = Welded::of(&vertices, &faces[1..7]).expect("faces in range");
        assert_eq!(welded.class[4], 0);
    }

    #[test]
    fn vertices_that_are_not_finite_stay_alone() {
        let vertices = [
            [0.0; 3],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [f64::NAN; 3],
            [f64::NAN; 3],
            [f64::INFINITY; 3],
            [f64::INFINITY; 3],
            [0.0; 3],
        ];
        let welded = Welded::of(&vertices, &[[0, 1, 2], [7, 1, 2]]).expect("faces in range");
        assert_eq!(welded.class, [0, 1, 2, 3, 4, 5, 6, 0]);
        assert_eq!(welded.face, [0]);
    }

    #[test]
    fn front_and_back_of_cloth_become_one_sheet() {
        let (vertices, faces) = plane(3);
        let back = faces
            .iter()
            .map(|&[a, b, c]| [a, c, b].map(|v| v + vertices.len() as u32));
        let both: Vec<[u32; 3]> = faces.iter().copied().chain(back).collect();
        let twice = [vertices.clone(), vertices.clone()].concat();
        let welded = Welded::of(&twice, &both).expect("faces in range");
        assert_eq!(welded.vertices, vertices);
        assert_eq!(welded.faces, faces);
    }

    #[test]
    fn faces_that_collapse_are_dropped_and_a_bad_number_is_named() {
        let vertices = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0; 3]];
        let welded = Welded::of(&vertices, &[[0, 3, 1], [3, 1, 2]]).expect("faces in range");
        assert_eq!((welded.faces, welded.face), (vec![[0, 1, 2]], vec![1]));
        let error = Welded::of(&vertices, &[[0, 1, 2], [0, 4, 1]]);
        let expected = Error::FaceIndexOutOfRange {
            face: 1,
            index: 4,
            vertices: 4,
        };
        assert_eq!(error, Err(expected));
    }
}
