//! What an artist selects as one figure, however many pieces it has.
//!
//! Comes in: vertices and triangles as exporters and modellers leave them: split at seams, in plates, clothes, hair and
//! eyes. Vertices at one place become one ([`crate::mesh::weld`]). Where the largest connected piece then carries nearly
//! all that is seen from outside it is matched as it is; otherwise the closed [envelope](crate::envelope) of the whole
//! is matched in its place. Goes out: a map in the numbering of the given meshes, [pulled back](pull_back) to every piece,
//! and a [grade](judgement) that answers for the whole.

mod copies;
mod judgement;
mod pull_back;
pub mod settings;
mod turning;
mod worn;

use std::sync::{Arc, OnceLock};

use faer::Mat;

pub use judgement::graded;
pub use pull_back::{FigureMap, Origin};

use crate::algebra::unions::Unions;
use crate::algebra::vector::{self, Point};
use crate::envelope::{self, Envelope};
use crate::error::{Error, Result};
use crate::figure::settings::{FIGURE, TURNING};
use crate::geodesics::metric::Metric;
use crate::matching::problem::landmark::Landmark;
use crate::matching::{self, Method, Options, match_shapes};
use crate::mesh::numbering::{GivenVertex, InputVertex};
use crate::mesh::surface_point::SurfacePoint;
use crate::mesh::weld::{Welded, checked_faces};
use crate::mesh::{IntakeReport, strays};
use crate::shape::{CostlyParts, PublicArrays, Shape};
use crate::transfer::Surface;
use crate::watch::progress::Progress;

/// A surface or many, prepared to be matched as one.
#[derive(Debug)]
pub struct Figure {
    /// What is matched: the given surface or the envelope.
    pub shape: Arc<Shape>,
    /// Connected pieces after welding.
    pub pieces: usize,
    /// Share of the visible area that what is matched carries.
    pub seen: f64,
    /// Given vertices far out that were taken to be between their neighbours.
    pub strays: usize,
    /// Corners of the given faces.
    faces: Vec<[u32; 3]>,
    /// The given mesh with vertices at one place joined, in given units.
    welded: Welded,
    /// Visible area of each welded face in squares of given units; nothing where there is one piece.
    visible: Option<Vec<f64>>,
    wrapped: Option<Wrapped>,
    surface: OnceLock<Surface>,
    turns: OnceLock<bool>,
}

/// The envelope of a figure, and where the figure lies in it.
#[derive(Debug)]
struct Wrapped {
    surface: Surface,
    anchors: Vec<Anchor>,
    handles: usize,
}

/// A vertex as seen from the envelope.
#[derive(Debug, Clone, Copy)]
struct Anchor {
    /// Nearest point of the envelope.
    point: SurfacePoint,
    /// Height above the envelope along its normal, in given units; negative inside.
    height: f64,
    /// Distance over the largest extent of the figure.
    away: f64,
}

/// What is to be prepared.
enum Matched {
    Surface,
    Envelope(Envelope),
}

impl Figure {
    /// Prepares a figure.
    ///
    /// # Errors
    /// Those of [`Shape::new`] and [`Envelope::of`].
    pub fn new(
        vertices: &[Point],
        faces: &[[i64; 3]],
        metric: Metric,
        progress: &Progress,
        report: &(dyn Fn(&'static str, f64) -> Result<()> + Sync),
    ) -> Result<Self> {
        Self::made(vertices, faces, progress, report, |vertices, faces| {
            Shape::with_metric(vertices, faces, metric, progress, report)
        })
    }

    /// A figure from its mesh and what an earlier preparation of it kept.
    ///
    /// # Errors
    /// Those of [`Figure::new`] and [`Shape::restored`].
    pub fn restored(
        vertices: &[Point],
        faces: &[[i64; 3]],
        metric: Metric,
        parts: CostlyParts,
        progress: &Progress,
    ) -> Result<Self> {
        let report = |_: &'static str, _: f64| progress.check();
        Self::made(vertices, faces, progress, &report, |vertices, faces| {
            Shape::restored(vertices, faces, metric, parts, progress)
        })
    }

    fn made(
        vertices: &[Point],
        faces: &[[i64; 3]],
        progress: &Progress,
        report: &(dyn Fn(&'static str, f64) -> Result<()> + Sync),
        prepare: impl FnOnce(&[Point], &[[i64; 3]]) -> Result<Shape>,
    ) -> Result<Self> {
        progress.check()?;
        let is_finite = |p: &Point| p.iter().all(|x| x.is_finite());
        if let Some(vertex) = vertices.iter().position(|p| !is_finite(p)) {
            return Err(Error::NotFinite { vertex });
        }
        let given = checked_faces(vertices.len(), faces)?;
        let settled = strays::settled(vertices, &given);
        let (vertices, strays) = settled
            .as_ref()
            .map_or((vertices, 0), |s| (s.vertices.as_slice(), s.strays));
        let welded = Welded::of(vertices, &given)?;
        let (piece, pieces) = pieces(&welded);
        let (matched, visible, seen) = if pieces > 1 {
            report("envelope", 0.01)?;
            matched(&welded, &piece, pieces, progress)?
        } else {
            (Matched::Surface, None, 1.0)
        };
        let in_ids = |faces: &[[u32; 3]]| -> Vec<[i64; 3]> {
            faces.iter().map(|f| f.map(i64::from)).collect()
        };
        let (shape, wrapped) = match matched {
            Matched::Surface => (prepare(&welded.vertices, &in_ids(&welded.faces))?, None),
            Matched::Envelope(envelope) => {
                let faces = in_ids(&envelope.faces);
                let shape = prepare(&envelope.vertices, &faces)?;
                let surface = Surface::new(envelope.vertices, &faces)?;
                let anchors = anchors(&welded, &surface);
                let handles = envelope.handles;
                let wrapped = Wrapped {
                    surface,
                    anchors,
                    handles,
                };
                (shape, Some(wrapped))
            }
        };
        Ok(Self {
            shape: Arc::new(shape),
            pieces,
            seen,
            strays,
            faces: given,
            welded,
            visible,
            wrapped,
            surface: OnceLock::new(),
            turns: OnceLock::new(),
        })
    }

    /// Given vertices.
    #[must_use]
    pub fn vertex_count(&self) -> usize {
        self.welded.class.len()
    }

    /// Given vertices that were joined to another at their place.
    #[must_use]
    pub fn joined(&self) -> usize {
        self.welded.class.len() - self.welded.vertices.len()
    }

    /// Whether the envelope is matched.
    #[must_use]
    pub fn is_wrapped(&self) -> bool {
        self.wrapped.is_some()
    }

    /// Handles of the envelope, none of a surface.
    #[must_use]
    pub fn handles(&self) -> usize {
        self.wrapped.as_ref().map_or(0, |wrapped| wrapped.handles)
    }

    /// Whether given vertices are those of the shape that is matched.
    fn is_plain(&self) -> bool {
        self.wrapped.is_none() && !self.welded.has_joined()
    }

    /// What was ignored or mended of the given mesh.
    #[must_use]
    pub fn report(&self) -> IntakeReport {
        let mut report = self.shape.mesh.report.clone();
        let collapsed = |f: &&[u32; 3]| {
            let [a, b, c] = f.map(|v| self.welded.class[v as usize]);
            a == b || b == c || c == a
        };
        if self.welded.has_joined() {
            let flat = self.faces.iter().filter(collapsed).count();
            report.zero_area_faces += flat;
            report.duplicate_faces += self.faces.len() - self.welded.faces.len() - flat;
        }
        if self.is_wrapped() {
            // The envelope is of the whole: nothing is left out.
            report = IntakeReport {
                zero_area_faces: report.zero_area_faces,
                duplicate_faces: report.duplicate_faces,
                ..IntakeReport::default()
            };
        }
        report.stray_vertices = self.strays;
        report
    }

    /// The given mesh with vertices at one place joined.
    fn given(&self) -> Result<&Surface> {
        if let Some(known) = self.surface.get() {
            return Ok(known);
        }
        let faces: Vec<[i64; 3]> = self.welded.faces.iter().map(|f| f.map(i64::from)).collect();
        let surface = Surface::new(self.welded.vertices.clone(), &faces)?;
        Ok(self.surface.get_or_init(|| surface))
    }

    /// What is matched, in given units.
    fn matched(&self) -> Result<&Surface> {
        match &self.wrapped {
            Some(wrapped) => Ok(&wrapped.surface),
            None => self.given(),
        }
    }

    /// Whether what is matched is the same after a turn about an axis.
    fn turns_onto_itself(&self) -> bool {
        *self.turns.get_or_init(|| {
            let shape = &self.shape;
            shape.basis.repeated() > TURNING.repeated
                || turning::turns_onto_itself(shape.given_mesh())
        })
    }

    /// Whether given vertices tell all turns of what is matched apart.
    fn are_off_every_axis(&self, given: impl Iterator<Item = GivenVertex>) -> bool {
        let mesh = self.shape.given_mesh();
        let place = |v| mesh.input_vertex.binary_search(&self.matched_vertex(v));
        let known = given.filter_map(|v| place(v).ok());
        turning::are_off_every_axis(mesh, known.map(|v| mesh.vertices[v]))
    }

    /// Where a given vertex is, in given units.
    fn place(&self, given: GivenVertex) -> Point {
        self.welded.vertices[self.welded.class[given.index()] as usize]
    }

    /// Number that a given vertex has in what is matched; the nearest one of an envelope.
    fn matched_vertex(&self, given: GivenVertex) -> InputVertex {
        let Some(&class) = self.welded.class.get(given.index()) else {
            // Out of range here and there.
            return InputVertex(given.0);
        };
        self.matched_class(class)
    }

    /// The same of a welded vertex.
    fn matched_class(&self, class: u32) -> InputVertex {
        match &self.wrapped {
            Some(wrapped) => {
                let SurfacePoint { face, weights } = wrapped.anchors[class as usize].point;
                InputVertex(wrapped.surface.triangles[face as usize][largest(weights)])
            }
            None => InputVertex(class),
        }
    }

    /// Spectrum and distances as handed out, in given numbering and units. Vertices at one place have the same values;
    /// those of an envelope are read at the nearest point of it.
    ///
    /// # Errors
    /// Those of [`Shape::public_arrays`].
    pub fn public_arrays(&self, progress: &Progress) -> Result<PublicArrays> {
        let mut arrays = self.shape.public_arrays(progress)?;
        if self.is_plain() {
            return Ok(arrays);
        }
        let matched = arrays.eigenfunctions.as_ref();
        let value = |class: u32, j: usize| match &self.wrapped {
            Some(wrapped) => {
                let SurfacePoint { face, weights } = wrapped.anchors[class as usize].point;
                let corners = wrapped.surface.triangles[face as usize];
                (0..3)
                    .map(|c| weights[c] * matched[(corners[c] as usize, j)])
                    .sum()
            }
            None => matched[(class as usize, j)],
        };
        let rows = self.vertex_count();
        arrays.eigenfunctions =
            Mat::from_fn(rows, matched.ncols(), |i, j| value(self.welded.class[i], j));
        Ok(arrays)
    }

    /// Vertex areas in given numbering and units: of what is matched, or of all pieces where that is an envelope; vertices
    /// at one place share theirs alike.
    ///
    /// # Errors
    /// Those of [`Shape::given_mass`].
    pub fn given_mass(&self) -> Result<Vec<f64>> {
        let mass = if self.is_wrapped() {
            self.given()?.vertex_areas()
        } else {
            self.shape.given_mass()?
        };
        if self.is_plain() {
            return Ok(mass);
        }
        let mut sharing = vec![0.0; mass.len()];
        for &class in &self.welded.class {
            sharing[class as usize] += 1.0;
        }
        let share = |&class: &u32| mass[class as usize] / sharing[class as usize];
        Ok(self.welded.class.iter().map(share).collect())
    }

    /// Samples from which distances were marched, in given numbering: the first vertex at their place, or the nearest one
    /// to a sample of an envelope.
    #[must_use]
    pub fn given_samples(&self) -> Vec<GivenVertex> {
        let samples = self.shape.input_samples();
        if self.is_plain() {
            return samples.iter().map(|v| GivenVertex(v.0)).collect();
        }
        let mut first = vec![GivenVertex(0); self.welded.vertices.len()];
        for (given, &class) in self.welded.class.iter().enumerate().rev() {
            first[class as usize] = GivenVertex(given as u32);
        }
        match &self.wrapped {
            Some(wrapped) => {
                let tree = crate::algebra::space_tree::SpaceTree::new(&self.welded.vertices);
                let place = |v: &InputVertex| wrapped.surface.vertices[v.index()];
                let near = samples.iter().map(|v| tree.nearest(place(v)).unwrap_or(0));
                near.map(|class| first[class as usize]).collect()
            }
            None => samples.iter().map(|class| first[class.index()]).collect(),
        }
    }
}

/// Finds the map between two figures.
///
/// # Errors
/// Those of [`match_shapes`].
pub fn match_figures(
    source: &Figure,
    target: &Figure,
    options: &Options<GivenVertex>,
    progress: &Progress,
    report: &(dyn Fn(&'static str, f64) -> Result<()> + Sync),
) -> Result<FigureMap> {
    let is_free = options.landmarks.is_empty() && options.coverage.is_none();
    if options.method == Method::Auto
        && is_free
        && let Some(found) = worn::worn(source, target, progress)?
    {
        return Ok(found);
    }
    let matched = |given: &Landmark<GivenVertex>| Landmark {
        source: source.matched_vertex(given.source),
        target: target.matched_vertex(given.target),
    };
    let mut landmarks: Vec<_> = options.landmarks.iter().map(matched).collect();
    let has_pieces = source.pieces > 1 || target.pieces > 1;
    let mut by_copies = options.method == Method::Auto && options.coverage.is_none() && has_pieces;
    if by_copies {
        let common = copies::common(source, target, None, progress)?;
        by_copies = copies::agree(source, target, &common, &options.landmarks);
        if by_copies {
            if let Some(found) = copies::copied(source, target, &common, progress)? {
                return Ok(found);
            }
            copies::add_landmarks(source, target, &common, &mut landmarks);
        }
    }
    let within = options.with_landmarks(landmarks);
    let found = match_shapes(&source.shape, &target.shape, &within, progress, report)?;
    let given = options.landmarks.clone();
    FigureMap::pulled_back(found, source, target, given, by_copies, progress)
}

/// Completes one of the other maps that were found between two figures.
///
/// # Errors
/// Those of [`matching::completed`].
pub fn completed(
    source: &Figure,
    target: &Figure,
    found: &FigureMap,
    index: usize,
    progress: &Progress,
    report: &(dyn Fn(&'static str, f64) -> Result<()> + Sync),
) -> Result<FigureMap> {
    let (others, constraints) = (&found.map.others, &found.map.constraints);
    let other = &others[index];
    let map = matching::completed(
        &source.shape,
        &target.shape,
        constraints,
        other,
        progress,
        report,
    )?;
    let given = found.landmarks.clone();
    FigureMap::pulled_back(map, source, target, given, false, progress)
}

fn largest(weights: [f64; 3]) -> usize {
    (1..3).fold(
        0,
        |best, c| if weights[c] > weights[best] { c } else { best },
    )
}

/// Piece of each face, and how many there are.
fn pieces(welded: &Welded) -> (Vec<u32>, usize) {
    let mut unions = Unions::new(welded.vertices.len());
    for &[a, b, c] in &welded.faces {
        unions.unite(a, b);
        unions.unite(a, c);
    }
    let mut number = vec![u32::MAX; welded.vertices.len()];
    let mut count = 0;
    let piece = welded.faces.iter().map(|f| {
        let own = &mut number[unions.root(f[0]) as usize];
        if *own == u32::MAX {
            *own = count;
            count += 1;
        }
        *own
    });
    (piece.collect(), count as usize)
}

/// What of several pieces is matched, the visible area of each face, and how much of it that carries.
fn matched(
    welded: &Welded,
    piece: &[u32],
    pieces: usize,
    progress: &Progress,
) -> Result<(Matched, Option<Vec<f64>>, f64)> {
    let shares = envelope::visible(&welded.vertices, &welded.faces)?;
    progress.check()?;
    let is_backdrop = backdrops(welded, piece, pieces);
    let visible: Vec<f64> = welded
        .faces
        .iter()
        .zip(piece)
        .zip(&shares)
        .map(|((f, &piece), &share)| {
            if is_backdrop[piece as usize] {
                return 0.0;
            }
            let [a, b, c] = f.map(|v| welded.vertices[v as usize]);
            let cross = vector::cross(vector::sub(b, a), vector::sub(c, a));
            f64::from(share) * vector::norm(cross) / 2.0
        })
        .collect();
    let mut of_piece = vec![0.0; pieces];
    for (&piece, area) in piece.iter().zip(&visible) {
        of_piece[piece as usize] += area;
    }
    let all: f64 = of_piece.iter().sum();
    let most = of_piece.iter().copied().fold(0.0, f64::max);
    let seen = if all > 0.0 { most / all } else { 1.0 };
    if seen >= FIGURE.carries_all {
        return Ok((Matched::Surface, Some(visible), seen));
    }
    let settings = envelope::Settings::default();
    let (faces, shares): (Vec<[u32; 3]>, Vec<f32>) = welded
        .faces
        .iter()
        .zip(piece)
        .zip(shares)
        .filter(|&((_, &piece), _)| !is_backdrop[piece as usize])
        .map(|((f, _), share)| (*f, share))
        .unzip();
    let envelope = Envelope::of(&welded.vertices, &faces, &shares, &settings, progress)?;
    // What lies apart from it, as a second body does, leaves the largest piece alone in its envelope.
    if seen >= FIGURE.carries_all * envelope.kept_share {
        return Ok((Matched::Surface, Some(visible), seen));
    }
    let seen = envelope.kept_share;
    Ok((Matched::Envelope(envelope), Some(visible), seen))
}

/// Which pieces are a ground or a wall: flat along an axis, and along the others as large as all else together.
fn backdrops(welded: &Welded, piece: &[u32], pieces: usize) -> Vec<bool> {
    const NOTHING: [Point; 2] = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
    let joined = |[low, high]: [Point; 2], [l, h]: [Point; 2]| -> [Point; 2] {
        [
            [0, 1, 2].map(|i| low[i].min(l[i])),
            [0, 1, 2].map(|i| high[i].max(h[i])),
        ]
    };
    let mut boxes = vec![NOTHING; pieces];
    for (f, &piece) in welded.faces.iter().zip(piece) {
        for p in f.map(|v| welded.vertices[v as usize]) {
            boxes[piece as usize] = joined(boxes[piece as usize], [p, p]);
        }
    }
    // The boxes of all pieces but one, from those before and those after it.
    let mut after = vec![NOTHING; pieces + 1];
    for n in (0..pieces).rev() {
        after[n] = joined(after[n + 1], boxes[n]);
    }
    let mut before = NOTHING;
    let extents = |[low, high]: [Point; 2]| [0, 1, 2].map(|i| high[i] - low[i]);
    (0..pieces)
        .map(|n| {
            let (own, rest) = (extents(boxes[n]), extents(joined(before, after[n + 1])));
            before = joined(before, boxes[n]);
            let largest = own.into_iter().fold(0.0, f64::max);
            let is_flat = |i: usize| own[i] <= FIGURE.flat * largest;
            (0..3).any(|axis| is_flat(axis) && (0..3).all(|i| i == axis || own[i] >= rest[i]))
        })
        .collect()
}

/// Every welded vertex as seen from the envelope.
fn anchors(welded: &Welded, envelope: &Surface) -> Vec<Anchor> {
    use rayon::prelude::*;
    let extent = vector::extent(&envelope.vertices);
    welded
        .vertices
        .par_iter()
        .map(|&place| {
            let point = envelope.nearest(place);
            let offset = vector::sub(place, envelope.position(&point));
            let normal = vector::normalised(envelope.cross(point.face));
            let length = vector::norm(offset);
            Anchor {
                point,
                height: length.copysign(vector::dot(offset, normal)),
                away: length / extent,
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::matching::ranking::quality::Grade;
    use crate::testing::{RINGS, torus_mesh};

    type Soup = (Vec<Point>, Vec<[i64; 3]>);

    fn joined(parts: &[Soup]) -> Soup {
        let (mut vertices, mut faces) = (Vec::new(), Vec::new());
        for (own, corners) in parts {
            let start = vertices.len() as i64;
            vertices.extend_from_slice(own);
            faces.extend(corners.iter().map(|f| f.map(|v| v + start)));
        }
        (vertices, faces)
    }

    /// The torus in four pieces, each of which ends where the next begins, with a gap between them.
    fn plates() -> Soup {
        const PLATES: usize = 4;
        let (vertices, faces) = torus_mesh(RINGS, &[], 0.0);
        let plate = |f: &[i64; 3]| f.map(|v| v as usize * PLATES / vertices.len());
        let parts: Vec<Soup> = (0..PLATES)
            .map(|n| {
                let own = faces.iter().filter(|f| plate(f) == [n; 3]);
                (vertices.clone(), own.copied().collect())
            })
            .collect();
        joined(&parts)
    }

    fn figure((vertices, faces): &Soup) -> Figure {
        let progress = Progress::default();
        Figure::new(
            vertices,
            faces,
            Metric::Euclidean,
            &progress,
            &|_, _| Ok(()),
        )
        .expect("a sound figure")
    }

    fn map(source: &Figure, target: &Figure) -> FigureMap {
        let progress = Progress::default();
        match_figures(source, target, &Options::default(), &progress, &|_, _| {
            Ok(())
        })
        .expect("a map")
    }

    #[test]
    fn plates_are_matched_as_the_whole_that_they_make() {
        let (whole, plates) = (torus_mesh(RINGS, &[], 0.0), plates());
        let (source, target) = (figure(&whole), figure(&plates));
        assert!(target.is_wrapped() && target.pieces == 4);
        let found = map(&source, &target);
        let mut away: Vec<f64> = Vec::new();
        for (v, (&face, weights)) in found
            .map
            .faces
            .iter()
            .zip(&found.map.barycentric)
            .enumerate()
        {
            let used = plates.1.iter().flatten().any(|&u| u as usize == v);
            if used {
                let corners = whole.1[face as usize].map(|u| whole.0[u as usize]);
                let image = crate::transfer::surface::blend(corners, *weights);
                away.push(vector::distance(image, plates.0[v]));
            }
        }
        away.sort_by(f64::total_cmp);
        // The torus is 2.8 wide, a cell of the envelope's grid 0.02.
        assert!(away[away.len() / 2] < 0.05, "{}", away[away.len() / 2]);
        assert!(found.unknown < 0.05);
    }

    #[test]
    fn what_stands_apart_leaves_the_largest_piece_as_it_is() {
        let body = torus_mesh(RINGS, &[], 0.0);
        let apart = body
            .0
            .iter()
            .map(|p| [0.5 * p[0] + 4.0, 0.5 * p[1], 0.5 * p[2]]);
        let both = joined(&[body.clone(), (apart.collect(), body.1.clone())]);
        let (alone, beside) = (figure(&body), figure(&both));
        assert!(!beside.is_wrapped());
        assert_eq!(
            beside.shape.given_mesh().faces,
            alone.shape.given_mesh().faces
        );
        let second = map(&alone, &beside);
        // A fifth of what is seen is the other one.
        assert!((second.unknown - 0.2).abs() < 0.03, "{}", second.unknown);
        let (grade, reasons) = graded(&second, &alone, &beside);
        assert!(grade != Grade::Green && reasons.iter().any(|r| r.contains("% of what is seen")));
    }

    #[test]
    fn a_ground_is_a_backdrop_and_a_plate_is_not() {
        let body = torus_mesh(RINGS, &[], 0.0);
        let square = |half: f64| -> Soup {
            let corners = [[-half, -half], [half, -half], [half, half], [-half, half]];
            let vertices = corners.map(|[x, y]| [x, y, -1.0]).to_vec();
            (vertices, vec![[0, 1, 2], [0, 2, 3]])
        };
        for (half, is_ground) in [(3.0, true), (0.5, false)] {
            let (vertices, faces) = joined(&[body.clone(), square(half)]);
            let faces = checked_faces(vertices.len(), &faces).expect("faces in range");
            let welded = Welded::of(&vertices, &faces).expect("faces in range");
            let (piece, count) = pieces(&welded);
            assert_eq!(backdrops(&welded, &piece, count), [false, is_ground]);
        }
    }
}
