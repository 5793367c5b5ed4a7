//! One closed surface around a figure of many pieces.
//!
//! A character is plates, clothes, hair and eyes rather than one surface. Its envelope is: the level set f = 0 of
//! [`field`], the union of its solids, of its sheets with some thickness, and of what lies between pieces that nearly touch.
//! It comes in: vertices and faces, with vertices at one place already one ([`crate::mesh::weld`]). It goes out: the
//! component of the largest area, a closed manifold that faces outwards, in the units that were given.
//!
//! The largest extent is scaled to 1 on a grid of step h = 1/[`Settings::cells`], or coarser where more than
//! [`Settings::outer_bricks`] would lie along the outside; only a band of bricks near the surface has values. The offsets are the
//! first of a short list that connects nearly all that is seen from outside.
//!
//! # Sources
//! Jacobson, Kavan, Sorkine-Hornung 2013 and Barill, Dickson, Schmidt, Levin, Jacobson 2018 (winding number, [`winding`]);
//! Gibson 1998 and Latecki 1997 (level set, [`surface`]).

mod candidate;
mod components;
mod distance;
mod field;
mod grid;
mod moments;
mod pieces;
mod place;
mod scaled;
pub mod settings;
#[cfg(test)]
pub(crate) mod shapes;
mod surface;
mod tree;
mod visible;
mod winding;

use rayon::prelude::*;

pub use field::Offsets;
pub use settings::Settings;
pub use visible::visible;

use crate::algebra::vector::Point;
use crate::error::{Error, Result};
use crate::watch::progress::Progress;
use candidate::{Candidate, Seen};
use field::{Band, Bridges};
use grid::Grid;
use pieces::Pieces;
use place::Triangle;
use scaled::Scaled;
use settings::LEAST_CELLS;
use tree::Tree;

/// Closed surface around a figure.
#[derive(Debug, Clone, PartialEq)]
pub struct Envelope {
    /// Vertices in given units.
    pub vertices: Vec<Point>,
    /// Faces, counter-clockwise from outside.
    pub faces: Vec<[u32; 3]>,
    /// Handles: half of 2 − χ.
    pub handles: usize,
    /// Closed outer surfaces that there were; the largest is the envelope.
    pub components: usize,
    /// Share of the visible area that lies at the envelope.
    pub kept_share: f64,
    /// Connected pieces of what was given.
    pub pieces: usize,
    /// What was offset by how much.
    pub offsets: Offsets,
}

impl Envelope {
    /// Envelope of a soup of which so much of each face is [`visible`]. Faces may be wound in any way.
    ///
    /// # Errors
    /// [`Error::EmptyMesh`] without a face of an area, [`Error::NotFinite`], [`Error::FaceIndexOutOfRange`],
    /// [`Error::BadArgument`] for settings without a meaning, [`Error::Cancelled`].
    pub fn of(
        vertices: &[Point],
        faces: &[[u32; 3]],
        visible: &[f32],
        settings: &Settings,
        progress: &Progress,
    ) -> Result<Self> {
        settings.check()?;
        if visible.len() != faces.len() {
            let (wanted, found) = (faces.len(), visible.len());
            let what = format!("`visible` should have one share a face, {wanted}, got {found}");
            return Err(Error::BadArgument { what });
        }
        let scaled = Scaled::of(vertices, faces)?;
        let pieces = Pieces::of(vertices, faces);
        let triangles: Vec<Triangle> = (0..faces.len())
            .into_par_iter()
            .map(|face| {
                let [a, b, c] = faces[face].map(|v| scaled.places[v as usize]);
                let corners = if pieces.turned[face] {
                    [a, c, b]
                } else {
                    [a, b, c]
                };
                let piece = pieces.of_face[face];
                Triangle { corners, piece }
            })
            .collect();
        let has_area = |t: &Triangle| place::dot(t.cross(), t.cross()) > 0.0;
        if !triangles.iter().any(has_area) {
            return Err(Error::EmptyMesh {
                vertices: vertices.len(),
                faces: faces.len(),
            });
        }
        progress.check()?;
        let figure = Figure {
            seen: triangles
                .iter()
                .zip(visible)
                .filter(|(_, share)| **share > 0.0)
                .map(|(t, &share)| Seen::of(t, share))
                .collect(),
            tree: Tree::new(&triangles),
            pieces: pieces.count,
        };
        progress.check()?;
        let chosen = figure.chosen(settings, progress)?;
        let chosen = chosen.ok_or(Error::EmptyMesh {
            vertices: vertices.len(),
            faces: faces.len(),
        })?;
        Ok(Self {
            vertices: chosen.vertices.iter().map(|&p| scaled.given(p)).collect(),
            faces: chosen.faces,
            handles: chosen.handles,
            components: chosen.components,
            kept_share: chosen.kept_share,
            pieces: pieces.count,
            offsets: chosen.offsets,
        })
    }
}

/// The largest of a kind of offset.
fn largest(offsets: &[Offsets], kind: fn(&Offsets) -> f64) -> f64 {
    offsets.iter().map(kind).fold(0.0, f64::max)
}

/// The largest of all offsets.
fn widest(offsets: &[Offsets]) -> f64 {
    largest(offsets, |o| o.solid.max(o.sheet).max(o.blend))
}

/// What an envelope is made of.
struct Figure {
    tree: Tree,
    seen: Vec<Seen>,
    pieces: usize,
}

impl Figure {
    /// The grid, and the offsets on it.
    fn grid_for(&self, settings: &Settings, progress: &Progress) -> Result<(Grid, Vec<Offsets>)> {
        let made = |cells: f64, offsets: &[Offsets]| {
            let (step, reach) = (1.0 / cells as f32, widest(offsets) as f32);
            field::grid_near(&self.tree, step, reach, progress)
        };
        let finest = settings.cells as f64;
        let grid = made(finest, &settings.offsets)?;
        let coarser = (grid.outer() as f64 / settings.outer_bricks as f64).sqrt();
        let cells = (finest / coarser).max(LEAST_CELLS as f64);
        if cells >= finest {
            return Ok((grid, settings.offsets.clone()));
        }
        let coarser = finest / cells;
        let offsets: Vec<Offsets> = (settings.offsets.iter())
            .map(|&offsets| Offsets {
                solid: offsets.solid * coarser,
                sheet: offsets.sheet * coarser,
                ..offsets
            })
            .collect();
        Ok((made(cells, &offsets)?, offsets))
    }

    /// Of the offsets that connect enough those with the fewest handles, the first of equal ones; otherwise, with wider
    /// gaps bridged between what is apart with the offsets that connect most, the first that do.
    fn chosen(&self, settings: &Settings, progress: &Progress) -> Result<Option<Candidate>> {
        let (grid, offsets) = self.grid_for(settings, progress)?;
        let narrow = Bridges {
            blend: largest(&offsets, |o| o.blend) as f32,
            ..Bridges::none(self.pieces)
        };
        let reach = widest(&offsets) as f32;
        let band = Band::of(&self.tree, grid, reach, &narrow, progress)?;
        let is_enough = |c: &Candidate| c.kept_share >= settings.connected;
        let mut best: Option<Candidate> = None;
        for &offsets in &offsets {
            let found = Candidate::of(band.level(offsets), offsets, &self.seen, self.pieces);
            progress.check()?;
            let is_better = |found: &Candidate| {
                best.as_ref()
                    .is_none_or(|best| match (is_enough(found), is_enough(best)) {
                        (true, true) => found.handles < best.handles,
                        (false, false) => found.kept_share > best.kept_share,
                        (found, _) => found,
                    })
            };
            if let Some(found) = found.filter(is_better) {
                best = Some(found);
            }
            if best
                .as_ref()
                .is_some_and(|b| is_enough(b) && b.handles == 0)
            {
                break;
            }
        }
        for &wide in &settings.bridges {
            let Some(apart) = best.as_ref().filter(|best| !is_enough(best)) else {
                break;
            };
            let bridges = Bridges {
                blend: apart.offsets.blend as f32,
                groups: apart.groups.clone(),
                wide: wide as f32,
            };
            let Some(band) = band.bridged(&self.tree, &bridges, progress)? else {
                continue;
            };
            let level = band.level(apart.offsets);
            let found = Candidate::of(level, apart.offsets, &self.seen, self.pieces);
            if let Some(found) = found.filter(|found| found.kept_share > apart.kept_share) {
                best = Some(found);
            }
        }
        Ok(best)
    }
}

/// Bytes of a face: twice as a triangle, as two nodes of the tree with their levels, as three edges, as samples of what
/// is seen, and where it is seen.
const FACE_BYTES: u64 = 600;
/// Bytes of a vertex: scaled, numbered by piece, and seen along an axis on each thread.
const VERTEX_BYTES: u64 = 64;
/// Bytes of a brick: samples, values, and what there is of the surface in it, twice.
const BRICK_BYTES: u64 = 4096;

/// Bytes that [`visible`] and [`Envelope::of`] take at most beside their input and result. What there is of bricks is a
/// quarter of that for a figure: the bound is that of one that fills its box.
#[must_use]
pub fn memory_bound(vertices: u64, faces: u64, settings: &Settings) -> u64 {
    let wide = settings.bridges.iter().copied().fold(0.0, f64::max);
    let cells = settings.cells as f64;
    let bricks =
        field::points_along(cells, widest(&settings.offsets).max(wide)) / grid::SIDE as f64 + 1.0;
    let bricks = bricks.powi(3) as u64;
    (bricks.saturating_mul(BRICK_BYTES))
        .saturating_add(faces.saturating_mul(FACE_BYTES))
        .saturating_add(vertices.saturating_mul(VERTEX_BYTES))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::algebra::vector;
    use shapes::Soup;

    fn made(soup: &Soup) -> Envelope {
        with(soup, &Settings::default())
    }

    fn with(soup: &Soup, settings: &Settings) -> Envelope {
        let seen = visible(&soup.vertices, &soup.faces).expect("a sound soup");
        let made = Envelope::of(
            &soup.vertices,
            &soup.faces,
            &seen,
            settings,
            &Progress::default(),
        );
        let made = made.expect("a sound soup");
        // Closed, wound alike, outwards, and of the Euler characteristic that goes with the handles.
        let characteristic = Soup::euler_characteristic(made.vertices.len(), &made.faces);
        assert_eq!(characteristic, 2 - 2 * made.handles as i64);
        let corners = |f: &[u32; 3]| f.map(|v| made.vertices[v as usize]);
        let signed = |f: &[u32; 3]| {
            let [a, b, c] = corners(f);
            vector::dot(a, vector::cross(b, c))
        };
        assert!(made.faces.iter().map(signed).sum::<f64>() > 0.0);
        for f in &made.faces {
            let [a, b, c] = corners(f);
            let (ab, ac) = (vector::sub(b, a), vector::sub(c, a));
            let edge = [ab, ac, vector::sub(c, b)]
                .map(vector::norm)
                .into_iter()
                .fold(0.0, f64::max);
            assert!(vector::norm(vector::cross(ab, ac)) > 1e-3 * edge * edge);
        }
        made
    }

    fn only(solid: f64, sheet: f64, blend: f64) -> Settings {
        Settings {
            offsets: vec![Offsets {
                solid,
                sheet,
                blend,
            }],
            bridges: Vec::new(),
            ..Settings::default()
        }
    }

    #[test]
    fn the_envelope_of_a_sphere_is_the_sphere() {
        let radius = 3.0;
        let made = made(&shapes::sphere(radius, 80));
        let step = 2.0 * radius / 128.0;
        // A vertex is the mean of crossings in its cell; their distance from the sphere is second order in the step.
        for p in &made.vertices {
            assert!((vector::norm(*p) - radius).abs() < 0.25 * step);
        }
        assert_eq!((made.handles, made.components, made.pieces), (0, 1, 1));
        assert!(made.kept_share > 0.999);
    }

    #[test]
    fn an_open_sheet_gets_its_offset_on_both_sides() {
        let mut sheet = shapes::box_of([1.0, 0.7, 0.5], 12);
        let is_top = |v: u32| sheet.vertices[v as usize][2] > 0.249;
        let faces = sheet
            .faces
            .iter()
            .copied()
            .filter(|f| f.iter().all(|&v| is_top(v)));
        sheet.faces = faces.collect();
        let offset = 0.02;
        let made = with(&sheet, &only(0.0, offset, 0.0));
        let reach = made.vertices.iter().map(|p| (p[2] - 0.25).abs());
        // Away from the rim, where w is near 1/2, to a quarter of a step.
        let inner = made
            .vertices
            .iter()
            .filter(|p| p[0].abs() < 0.4 && p[1].abs() < 0.25);
        for p in inner {
            assert!(
                ((p[2] - 0.25).abs() - offset).abs() < 0.25 / 128.0,
                "{}",
                p[2]
            );
        }
        assert!(reach.fold(0.0, f64::max) < offset + 0.25 / 128.0);
        assert_eq!((made.handles, made.components), (0, 1));
    }

    #[test]
    fn more_surface_is_on_a_coarser_grid_on_which_sheets_have_no_holes() {
        let (cos, sin) = (0.6, 0.8);
        // Slanting, so that sheets pass between points of the grid in all ways.
        let turned = |[x, y, z]: Point| {
            [
                cos * x - sin * y,
                cos * (sin * x + cos * y) - sin * z,
                sin * (sin * x + cos * y) + cos * z,
            ]
        };
        let bin = shapes::open_box([1.0; 3]).mapped(turned);
        let without_bound = Settings {
            outer_bricks: usize::MAX,
            ..Settings::default()
        };
        let [coarse, fine] = [made(&bin), with(&bin, &without_bound)];
        // What surrounds a bent disc is a sphere.
        for envelope in [&coarse, &fine] {
            assert_eq!((envelope.handles, envelope.components), (0, 1));
            assert!(envelope.kept_share > 0.999);
        }
        assert!(coarse.vertices.len() < fine.vertices.len());
    }

    #[test]
    fn a_torus_has_one_handle_and_its_winding_does_not_matter() {
        let torus = shapes::torus(1.0, 0.3, 48);
        let made = made(&torus);
        assert_eq!((made.handles, made.components), (1, 1));
        let mut turned = torus.clone();
        for f in turned.faces.iter_mut().step_by(3) {
            f.swap(0, 1);
        }
        let turned = super::tests::made(&turned);
        assert_eq!(turned.faces.len(), made.faces.len());
        for (p, q) in turned.vertices.iter().zip(&made.vertices) {
            // Sums over corners in another order differ by rounding in single precision.
            assert!(vector::distance(*p, *q) < 1e-5);
        }
    }

    #[test]
    fn boxes_that_touch_or_lie_in_one_another_are_one() {
        let cube = shapes::box_of([1.0; 3], 4);
        let inner = cube.mapped(|p| vector::scaled(p, 0.5));
        let nested = made(&cube.clone().with(&inner));
        assert_eq!(
            (nested.handles, nested.components, nested.pieces),
            (0, 1, 2)
        );
        let alone = made(&cube);
        assert_eq!(nested.vertices.len(), alone.vertices.len());
        // A hundredth of the extent apart, which a piece does not bridge to itself.
        let beside = made(&cube.clone().with(&cube.moved([1.02, 0.0, 0.0])));
        assert_eq!((beside.handles, beside.components), (0, 1));
        assert!(beside.kept_share > 0.99);
    }

    /// Two fingers on a palm, one piece, with a gap.
    fn fingers(gap: f64) -> Soup {
        let lines = [
            vec![0.0, 0.3, 0.3 + gap, 0.6 + gap],
            vec![0.0, 0.3, 1.0],
            vec![0.0, 0.2],
        ];
        shapes::blocks(&lines, |[x, y, _]| x != 1 || y == 0)
    }

    #[test]
    fn fingers_of_one_piece_stay_apart_and_pieces_as_near_are_joined() {
        // Wider than a step and narrower than all that is bridged between pieces.
        let gap = 0.0105;
        let settings = Settings::default();
        assert!(gap > 1.0 / 128.0 && settings.offsets.iter().all(|o| gap < 2.0 * o.blend));
        let soup = fingers(gap);
        let made = made(&soup);
        let between = |p: &&Point| (p[0] - 0.3 - gap / 2.0).abs() < gap && p[1] > 0.35;
        // Both sides of the gap have a wall all along it.
        let wall = made.vertices.iter().filter(between);
        let (left, right): (Vec<&Point>, Vec<&Point>) = wall.partition(|p| p[0] < 0.3 + gap / 2.0);
        for side in [left, right] {
            let deepest = side.iter().map(|p| p[1]).fold(f64::INFINITY, f64::min);
            assert!(
                side.len() > 500 && deepest < 0.37,
                "{} {deepest}",
                side.len()
            );
        }
        // The same gap between two boxes is closed.
        let lines = [vec![0.0, 0.3], vec![0.0, 1.0], vec![0.0, 0.2]];
        let one = shapes::blocks(&lines, |_| true);
        let pair = super::tests::made(&one.clone().with(&one.moved([0.3 + gap, 0.0, 0.0])));
        let inside = pair.vertices.iter().filter(|p| {
            (p[0] - 0.3 - gap / 2.0).abs() < gap
                && (0.1..0.9).contains(&p[1])
                && (0.05..0.15).contains(&p[2])
        });
        assert_eq!((pair.components, inside.count()), (1, 0));
    }

    #[test]
    fn parts_farther_apart_are_bridged_when_they_would_be_lost() {
        let cube = shapes::box_of([1.0, 0.6, 0.6], 4);
        let apart = cube.clone().with(&cube.moved([1.05, 0.0, 0.0]));
        let lost = with(&apart, &only(0.004, 0.006, 0.006));
        assert_eq!(lost.components, 2);
        assert!((lost.kept_share - 0.5).abs() < 0.01);
        let kept = made(&apart);
        assert_eq!((kept.components, kept.handles), (1, 0));
        assert!(kept.kept_share > 0.99);
    }

    #[test]
    fn a_turned_and_scaled_figure_has_the_turned_and_scaled_envelope() {
        let figure =
            shapes::torus(1.0, 0.35, 40).with(&shapes::sphere(0.5, 30).moved([1.5, 0.0, 0.2]));
        let turn = |p: Point| {
            let (s, c) = 0.7f64.sin_cos();
            let q = [c * p[0] - s * p[1], s * p[0] + c * p[1], p[2]];
            [
                7.0 * (c * q[0] - s * q[2]) + 100.0,
                7.0 * q[1] - 3.0,
                7.0 * (s * q[0] + c * q[2]),
            ]
        };
        let (one, other) = (made(&figure), made(&figure.mapped(turn)));
        assert_eq!(
            (one.handles, one.components),
            (other.handles, other.components)
        );
        let turned: Vec<Point> = one.vertices.iter().map(|&p| turn(p)).collect();
        let step = 7.0 * 3.35 / 128.0;
        for (from, to) in [(&turned, &other.vertices), (&other.vertices, &turned)] {
            let tree = crate::algebra::space_tree::SpaceTree::new(to);
            for &p in from {
                let nearest = tree.nearest(p).expect("there are vertices");
                // Vertices are up to the diagonal of a cell apart.
                assert!(vector::distance(p, to[nearest as usize]) < 1.8 * step);
            }
        }
    }

    #[test]
    fn the_number_of_threads_does_not_matter() {
        let figure =
            shapes::torus(1.0, 0.3, 40).with(&shapes::sphere(0.5, 30).moved([1.5, 0.0, 0.2]));
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            pool.expect("threads").install(|| made(&figure))
        };
        assert_eq!(on(1), on(3));
    }

    #[test]
    fn what_is_inside_is_not_seen_and_what_is_outside_is() {
        let cube = shapes::box_of([1.0; 3], 8);
        let inner = cube.mapped(|p| vector::scaled(p, 0.95));
        let both = cube.clone().with(&inner);
        let seen = visible(&both.vertices, &both.faces).expect("a sound soup");
        let (outside, inside) = seen.split_at(cube.faces.len());
        assert!(outside.iter().all(|&s| s == 1.0));
        assert!(inside.iter().all(|&s| s == 0.0));
    }

    #[test]
    fn bad_input_is_named() {
        let cube = shapes::box_of([1.0; 3], 1);
        let of = |vertices: &[Point], faces: &[[u32; 3]], seen: &[f32], settings: &Settings| {
            Envelope::of(vertices, faces, seen, settings, &Progress::default())
                .expect_err("bad input")
        };
        let (settings, all) = (Settings::default(), vec![1.0; cube.faces.len()]);
        let empty = |vertices, faces| Error::EmptyMesh { vertices, faces };
        assert_eq!(of(&cube.vertices, &[], &[], &settings), empty(8, 0));
        let flat = vec![[0, 0, 1], [2, 2, 2]];
        assert_eq!(of(&cube.vertices, &flat, &[1.0; 2], &settings), empty(8, 2));
        let line: Vec<Point> = (0..3).map(|i| [f64::from(i), 0.0, 0.0]).collect();
        assert_eq!(of(&line, &[[0, 1, 2]], &[1.0], &settings), empty(3, 1));
        let point = vec![[2.0; 3]; 3];
        assert_eq!(of(&point, &[[0, 1, 2]], &[1.0], &settings), empty(3, 1));
        let mut hole = cube.vertices.clone();
        hole[5][1] = f64::NAN;
        let unknown = Error::NotFinite { vertex: 5 };
        assert_eq!(of(&hole, &cube.faces, &all, &settings), unknown);
        assert_eq!(visible(&hole, &cube.faces), Err(unknown));
        let far = Error::FaceIndexOutOfRange {
            face: 0,
            index: 8,
            vertices: 8,
        };
        assert_eq!(of(&cube.vertices, &[[0, 1, 8]], &[1.0], &settings), far);
        let few = Settings {
            cells: 2,
            ..Settings::default()
        };
        for (settings, seen) in [(&few, &all[..]), (&settings, &all[1..])] {
            let error = of(&cube.vertices, &cube.faces, seen, settings);
            assert!(matches!(error, Error::BadArgument { .. }));
        }
    }

    #[test]
    fn a_cancelled_envelope_ends() {
        let cube = shapes::box_of([1.0; 3], 1);
        let progress = Progress::default();
        progress.cancel();
        let seen = vec![1.0; cube.faces.len()];
        let made = Envelope::of(
            &cube.vertices,
            &cube.faces,
            &seen,
            &Settings::default(),
            &progress,
        );
        assert_eq!(made, Err(Error::Cancelled));
    }
}
