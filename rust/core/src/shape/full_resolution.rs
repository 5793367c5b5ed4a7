//! The given mesh of a shape whose map is sought on a simplified or a finer one, and points between both.

use std::sync::{Arc, Mutex, PoisonError};

use faer::Mat;
use rayon::prelude::*;

use crate::algebra::vector::{self, Point};
use crate::error::Result;
use crate::geodesics;
use crate::geodesics::distance_operator;
use crate::geodesics::metric::{Measured, Metric};
use crate::mesh::bisection::{Bisected, Piece, bisected};
use crate::mesh::numbering::{CheckedVertex, WorkingVertex};
use crate::mesh::simplification::simplified;
use crate::mesh::surface_point::{SurfacePoint, nearest_in_triangle};
use crate::mesh::{Adjacency, Mesh};
use crate::spectrum::eigenbasis::Eigenbasis;
use crate::watch::progress::{Check, Progress};

/// A given mesh beside the working mesh on which its map is sought: a simplified one, or the same surface
/// with more vertices.
///
/// Memory: about 250 bytes a given vertex.
#[derive(Debug)]
pub struct FullResolution {
    /// The given mesh, checked.
    pub mesh: Mesh,
    /// Vertex of the given mesh at each vertex of the working one, close to it when it has more.
    kept: Vec<CheckedVertex>,
    /// Where each vertex lies on the working mesh.
    pub points: Vec<SurfacePoint>,
    /// Where each face of the working mesh lies on the given one; nothing when it was simplified.
    pieces: Option<Vec<Piece>>,
    /// Vertices that lie on each face of the working mesh.
    on_face: Adjacency,
    /// Faces around each vertex.
    vertex_faces: Adjacency,
    /// The spectrum, once somebody has asked for it.
    spectrum: Mutex<Option<Arc<FullSpectrum>>>,
}

/// Spectrum and distances of the given mesh itself, at unit area.
#[derive(Debug)]
pub struct FullSpectrum {
    /// Smallest eigenpairs.
    pub basis: Eigenbasis,
    /// Lumped areas.
    pub mass: Vec<f64>,
    /// Length of one unit here, as of [`Measured`].
    pub unit: f64,
    /// Distances between the samples, `(s, s)`, symmetric.
    pub geodesics: Mat<f64>,
    /// Distance operator `(q, q)`.
    pub distance_operator: Mat<f64>,
}

impl FullResolution {
    /// Simplifies a mesh to about `wanted` vertices: the simplified mesh, checked and at unit
    /// area, and the given one beside it.
    ///
    /// # Errors
    /// [`crate::Error::Cancelled`]; those of [`Mesh::new`].
    pub fn simplified(mesh: Mesh, wanted: usize, progress: &Progress) -> Result<(Mesh, Self)> {
        let coarse = simplified(&mesh, wanted, &|| progress.is_cancelled())?;
        let positions: Vec<Point> = coarse
            .kept
            .iter()
            .map(|&v| mesh.vertices[v as usize])
            .collect();
        let faces: Vec<[i64; 3]> = coarse.faces.iter().map(|f| f.map(i64::from)).collect();
        let mut working = Mesh::new(&positions, &faces)?;
        // What the check dropped takes over the anchor of any vertex that is left.
        let mut number = vec![0; positions.len()];
        for (i, &v) in working.input_vertex.iter().enumerate() {
            number[v.index()] = i as u32;
        }
        let kept: Vec<CheckedVertex> = working
            .input_vertex
            .iter()
            .map(|&v| CheckedVertex(coarse.kept[v.index()]))
            .collect();
        working.input_vertex = kept.iter().map(|&v| mesh.input_vertex[v.index()]).collect();
        working.centre = vector::add(vector::scaled(working.centre, mesh.scale), mesh.centre);
        working.scale *= mesh.scale;
        working.report = mesh.report.clone();
        progress.check()?;

        let ground = Ground {
            vertices: &kept
                .iter()
                .map(|&v| mesh.vertices[v.index()])
                .collect::<Vec<_>>(),
            faces: &working.faces,
            vertex_faces: &working.vertex_faces(),
        };
        let points: Vec<SurfacePoint> = mesh
            .vertices
            .par_iter()
            .zip(mesh.vertex_normals().par_iter())
            .zip(&coarse.anchor)
            .map(|((&p, &normal), &anchor)| {
                progress.check()?;
                Ok(ground.closest(p, normal, number[anchor as usize]))
            })
            .collect::<Result<_>>()?;
        let full = Self::beside(&working, mesh, kept, points, None);
        Ok((working, full))
    }

    /// Cuts a mesh finer, to `wanted` vertices: the finer mesh, in which the given vertices come first, and
    /// the given one beside it.
    #[must_use]
    pub fn refined(mesh: Mesh, wanted: usize) -> (Mesh, Self) {
        let Bisected {
            vertices,
            faces,
            pieces,
            close,
            ..
        } = bisected(&mesh, wanted);
        let working = Mesh {
            vertices,
            faces,
            input_vertex: close
                .iter()
                .map(|&v| mesh.input_vertex[v as usize])
                .collect(),
            input_face: pieces
                .iter()
                .map(|p| mesh.input_face[p.face as usize])
                .collect(),
            turned: pieces
                .iter()
                .map(|p| mesh.turned[p.face as usize])
                .collect(),
            scale: mesh.scale,
            centre: mesh.centre,
            report: mesh.report.clone(),
            input_positions: mesh.input_positions.clone(),
        };
        let kept = CheckedVertex::each(close);
        let vertex_faces = working.vertex_faces();
        let points = (0..mesh.vertices.len() as u32)
            .map(|v| SurfacePoint::at_corner(&working.faces, vertex_faces.row(v as usize)[0], v))
            .collect();
        let full = Self::beside(&working, mesh, kept, points, Some(pieces));
        (working, full)
    }

    fn beside(
        working: &Mesh,
        mesh: Mesh,
        kept: Vec<CheckedVertex>,
        points: Vec<SurfacePoint>,
        pieces: Option<Vec<Piece>>,
    ) -> Self {
        let on_face = Adjacency::from_lists(
            working.faces.len(),
            points.iter().zip(0..).map(|(p, v)| (p.face, v)),
        );
        Self {
            vertex_faces: mesh.vertex_faces(),
            mesh,
            kept,
            points,
            pieces,
            on_face,
            spectrum: Mutex::new(None),
        }
    }

    /// Whether the working mesh is the finer one.
    #[must_use]
    pub fn is_finer(&self) -> bool {
        self.pieces.is_some()
    }

    /// Vertices whose points lie on a face of the working mesh.
    pub fn on_face(&self, face: u32) -> impl ExactSizeIterator<Item = CheckedVertex> + '_ {
        self.on_face
            .row(face as usize)
            .iter()
            .copied()
            .map(CheckedVertex)
    }

    /// Vertex of the given mesh at a vertex of the working one, close to it when that has more.
    #[must_use]
    pub fn checked_vertex(&self, vertex: WorkingVertex) -> CheckedVertex {
        self.kept[vertex.index()]
    }

    /// Vertex of the working mesh nearest to one of the given mesh.
    #[must_use]
    pub fn working_vertex(&self, vertex: CheckedVertex, working: &Mesh) -> WorkingVertex {
        let SurfacePoint { face, weights } = self.points[vertex.index()];
        let largest = (1..3).fold(
            0,
            |best, c| if weights[c] > weights[best] { c } else { best },
        );
        WorkingVertex(working.faces[face as usize][largest])
    }

    /// Values at the vertices of the working mesh, carried to the given vertices.
    #[must_use]
    pub fn carried(&self, values: &[f64], working: &Mesh) -> Vec<f64> {
        self.points
            .par_iter()
            .map(|p| {
                let corners = working.faces[p.face as usize];
                (0..3)
                    .map(|c| p.weights[c] * values[corners[c] as usize])
                    .sum()
            })
            .collect()
    }

    /// Points of the working mesh as points of the given one.
    ///
    /// # Errors
    /// [`crate::Error::Cancelled`].
    pub fn located(
        &self,
        points: &[SurfacePoint],
        working: &Mesh,
        check: Check<'_>,
    ) -> Result<Vec<SurfacePoint>> {
        if let Some(pieces) = &self.pieces {
            let located = |p: &SurfacePoint| pieces[p.face as usize].located(p.weights);
            return Ok(points.iter().map(located).collect());
        }
        let ground = Ground {
            vertices: &self.mesh.vertices,
            faces: &self.mesh.faces,
            vertex_faces: &self.vertex_faces,
        };
        points
            .par_iter()
            .map(|point| {
                check()?;
                let corners = working.faces[point.face as usize].map(|v| self.kept[v as usize]);
                let place_of = |v: CheckedVertex| self.mesh.vertices[v.index()];
                let [a, b, c] = corners.map(place_of);
                let place = (0..3).fold([0.0; 3], |sum, i| {
                    vector::add(sum, vector::scaled([a, b, c][i], point.weights[i]))
                });
                let normal = vector::cross(vector::sub(b, a), vector::sub(c, a));
                let apart = |v: CheckedVertex| vector::distance(place_of(v), place);
                let around = corners.into_iter().chain(self.on_face(point.face));
                let start = around.fold(
                    corners[0],
                    |best, v| {
                        if apart(v) < apart(best) { v } else { best }
                    },
                );
                Ok(ground.closest(place, normal, start.0))
            })
            .collect()
    }

    /// Eigenpairs, distances and distance operator of the given mesh, computed when first asked
    /// for. `samples` are vertices of the working mesh that the given one has too.
    ///
    /// Memory while it runs: about 4 kilobytes a vertex.
    ///
    /// # Errors
    /// Those of [`Eigenbasis::new`]; [`crate::Error::Cancelled`].
    pub fn spectrum(
        &self,
        metric: Metric,
        (pairs, operator_size): (usize, usize),
        samples: &[u32],
        progress: &Progress,
    ) -> Result<Arc<FullSpectrum>> {
        let mut known = self.spectrum.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(spectrum) = &*known {
            return Ok(Arc::clone(spectrum));
        }
        let cancelled = || progress.is_cancelled();
        let Measured {
            laplacian,
            marching,
            unit,
            ..
        } = Measured::new(&self.mesh, metric)?;
        let basis = Eigenbasis::new(&laplacian, pairs, &cancelled)?;
        let samples: Vec<u32> = samples.iter().map(|&v| self.kept[v as usize].0).collect();
        let fields = geodesics::distances_from(&marching, &samples, &cancelled)?;
        let d = |i: usize, j: usize| f64::from(fields[(samples[i] as usize, j)]);
        let geodesics = Mat::from_fn(samples.len(), samples.len(), |i, j| {
            f64::midpoint(d(i, j), d(j, i))
        });
        let distance_operator = distance_operator::from_fields(
            basis.functions.get(.., ..operator_size),
            &basis.values[..operator_size],
            &laplacian.mass,
            &samples,
            fields.as_ref(),
            &|| progress.check(),
        )?;
        let spectrum = Arc::new(FullSpectrum {
            basis,
            mass: laplacian.mass,
            unit,
            geodesics,
            distance_operator,
        });
        *known = Some(Arc::clone(&spectrum));
        Ok(spectrum)
    }
}

/// A mesh on which the point nearest to a place in space is sought from a vertex close by, so that
/// another limb that happens to be near is never reached.
struct Ground<'a> {
    vertices: &'a [Point],
    faces: &'a [[u32; 3]],
    vertex_faces: &'a Adjacency,
}

impl Ground<'_> {
    /// Walks downhill over the vertices, then takes the closest point of the faces around, those
    /// that face `normal` first.
    fn closest(&self, place: Point, normal: Point, start: u32) -> SurfacePoint {
        let square = |v: u32| {
            let d = vector::sub(self.vertices[v as usize], place);
            vector::dot(d, d)
        };
        let (mut at, mut least) = (start, square(start));
        loop {
            let from = at;
            for &f in self.vertex_faces.row(from as usize) {
                for v in self.faces[f as usize] {
                    let found = square(v);
                    if found < least {
                        (at, least) = (v, found);
                    }
                }
            }
            if at == from {
                break;
            }
        }
        let mut best = (
            (true, f64::INFINITY),
            SurfacePoint {
                face: 0,
                weights: [1.0, 0.0, 0.0],
            },
        );
        let mut around = |v: u32, seen: &[u32]| {
            for &face in self.vertex_faces.row(v as usize) {
                if self.faces[face as usize].iter().any(|v| seen.contains(v)) {
                    continue;
                }
                let found = self.on_face(place, normal, face);
                if found.0 < best.0 {
                    best = found;
                }
            }
            best.1.face
        };
        let face = around(at, &[]);
        let mut seen = [at; 2];
        for corner in self.faces[face as usize] {
            if corner != at {
                around(corner, &seen);
                seen[1] = corner;
            }
        }
        best.1
    }

    /// Whether a face turns away and how far it is, with its closest point.
    fn on_face(&self, place: Point, normal: Point, face: u32) -> ((bool, f64), SurfacePoint) {
        let corners = self.faces[face as usize].map(|v| self.vertices[v as usize]);
        let (square, weights) = nearest_in_triangle(place, corners);
        let [a, b, c] = corners;
        let across = vector::cross(vector::sub(b, a), vector::sub(c, a));
        let away = vector::dot(across, normal) < 0.0;
        ((away, square), SurfacePoint { face, weights })
    }
}
