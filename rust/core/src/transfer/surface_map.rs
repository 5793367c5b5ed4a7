//! A dense map between two surfaces as given, the ground on which all data travels.

use std::sync::OnceLock;

use crate::algebra::vector::Point;
use crate::error::{Error, Result};
use crate::mesh::surface_point::SurfacePoint;
use crate::mesh::weld::Welded;
use crate::transfer::frame::Frame;
use crate::transfer::surface::Surface;

/// Source, target and the image of every target vertex on the source.
#[derive(Debug)]
pub struct SurfaceMap {
    /// The surface that has the data.
    pub source: Surface,
    /// The surface that receives it.
    pub target: Surface,
    /// Image of each target vertex, `(n_target)`.
    pub points: Vec<SurfacePoint>,
    /// How far each image is to be trusted, 0 to 1, `(n_target)`.
    pub confidence: Vec<f64>,
    images: Vec<Point>,
    /// Made when first asked for.
    joined: OnceLock<Joined>,
    /// Made when first asked for.
    pub(super) frames: OnceLock<Vec<Frame>>,
    /// Piece of each of the source's vertices, and which pieces are small: made when first asked for.
    pub(super) source_pieces: OnceLock<(Vec<u32>, Vec<bool>)>,
}

/// Which of the target's vertices are one, being at one place, as they were before an exporter split them at seams.
#[derive(Debug)]
pub(super) struct Joined {
    /// The target with these made one; nothing where each is alone.
    surface: Option<Surface>,
    /// Vertex of that surface for each of the target's.
    pub class: Vec<u32>,
    /// The first of the target's vertices for each of that surface.
    pub first: Vec<u32>,
}

impl Joined {
    fn of(target: &Surface) -> Self {
        let welded = Welded::of(&target.vertices, &target.triangles)
            .expect("corners of a surface are among its vertices");
        // Where all lies at one place, no triangle is left.
        if !welded.has_joined() || welded.faces.is_empty() {
            let own: Vec<u32> = (0..target.vertices.len() as u32).collect();
            return Self {
                surface: None,
                class: own.clone(),
                first: own,
            };
        }
        let mut first = vec![0; welded.vertices.len()];
        for (v, &c) in welded.class.iter().enumerate().rev() {
            first[c as usize] = v as u32;
        }
        let faces: Vec<[i64; 3]> = (welded.faces.iter())
            .map(|corners| corners.map(i64::from))
            .collect();
        let surface = Surface::new(welded.vertices, &faces).expect("it is a part of a surface");
        Self {
            surface: Some(surface),
            class: welded.class,
            first,
        }
    }
}

impl SurfaceMap {
    /// Joins two surfaces and a map between them.
    ///
    /// `weights` are non-negative and sum to one, up to rounding.
    ///
    /// # Errors
    /// [`Error::BadArgument`] when the lengths do not fit or a source triangle does not exist.
    pub fn new(
        source: Surface,
        target: Surface,
        faces: &[i64],
        weights: &[[f64; 3]],
        confidence: Vec<f64>,
    ) -> Result<Self> {
        let n = target.vertices.len();
        for (name, found) in [
            ("faces", faces.len()),
            ("barycentric", weights.len()),
            ("confidence", confidence.len()),
        ] {
            if found != n {
                return Err(Error::BadArgument {
                    what: format!(
                        "`{name}` should have one entry for each of the {n} target vertices, \
                         got {found}: give the map that was made for this target"
                    ),
                });
            }
        }
        let m = source.triangles.len();
        if let Some((vertex, face)) = faces
            .iter()
            .enumerate()
            .find(|&(_, &f)| f < 0 || f as usize >= m)
        {
            return Err(Error::BadArgument {
                what: format!(
                    "target vertex {vertex} lies on source triangle {face}, but there are {m}: \
                     give the map that was made for this source"
                ),
            });
        }
        let points: Vec<SurfacePoint> = faces
            .iter()
            .zip(weights)
            .map(|(&face, &weights)| SurfacePoint {
                face: face as u32,
                weights,
            })
            .collect();
        let images = points.iter().map(|p| source.position(p)).collect();
        Ok(Self {
            source,
            target,
            points,
            confidence,
            images,
            joined: OnceLock::new(),
            frames: OnceLock::new(),
            source_pieces: OnceLock::new(),
        })
    }

    /// Where the image of each target vertex lies in space, `(n_target)`.
    #[must_use]
    pub fn images(&self) -> &[Point] {
        &self.images
    }

    /// The target with vertices at one place made one, and which they are.
    pub(super) fn joined(&self) -> (&Surface, &Joined) {
        let joined = self.joined.get_or_init(|| Joined::of(&self.target));
        (joined.surface.as_ref().unwrap_or(&self.target), joined)
    }
}

/// Checks that an argument has as many rows as it should.
///
/// # Errors
/// [`Error::BadArgument`].
pub(crate) fn check_rows(name: &str, found: usize, rows: usize) -> Result<()> {
    if found == rows {
        return Ok(());
    }
    Err(Error::BadArgument {
        what: format!("`{name}` should have {rows} rows, got {found}"),
    })
}

/// Checks that an argument has as many rows of `channels` numbers, perhaps of none, as it should.
///
/// # Errors
/// [`Error::BadArgument`].
pub(crate) fn check_table(name: &str, found: usize, rows: usize, channels: usize) -> Result<()> {
    if found == rows * channels {
        return Ok(());
    }
    Err(Error::BadArgument {
        what: format!(
            "`{name}` should have {rows} rows of {channels} numbers, got {found} numbers"
        ),
    })
}
