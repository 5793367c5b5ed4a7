//! A dense map in given numbering, from matched embeddings.

use std::cell::LazyCell;
use std::sync::Arc;

use faer::{Mat, MatRef};

use crate::algebra::dense::{self, Rows};
use crate::algebra::space_tree::SpaceTree;
use crate::algebra::vector;
use crate::baselines::Convergence;
use crate::error::{Result, System};
use crate::matching::detail;
use crate::matching::detail::settings::DETAIL;
use crate::matching::problem::constraints::Constraints;
use crate::matching::problem::landmark::Landmark;
use crate::matching::problem::pair::Coverage;
use crate::matching::problem::point_map::PointMaps;
use crate::matching::ranking::{Hypothesis, Metrics};
use crate::matching::result::confidence::confidence;
use crate::matching::result::settings::CORRESPONDENCE;
use crate::mesh::numbering::{CheckedVertex, WorkingVertex};
use crate::mesh::surface_point::SurfacePoint;
use crate::mesh::{Mesh, boundary};
use crate::shape::Shape;
use crate::shape::full_resolution::{FullResolution, FullSpectrum};
use crate::shape::pointwise_map::{self, EmbeddedTriangles};
use crate::spectrum::eigenbasis::Eigenbasis;
use crate::watch::progress::{Check, Progress};

/// A dense map in given numbering: for every target vertex a point of the source.
#[derive(Debug, Clone)]
pub struct Correspondence {
    /// Source face of each target vertex's image.
    pub faces: Vec<u32>,
    /// Weights of that face's corners, in the given order of its corners.
    pub barycentric: Vec<[f64; 3]>,
    /// Corner with the largest weight.
    pub vertices: Vec<u32>,
    /// Confidence in [0, 1].
    pub confidence: Vec<f64>,
    /// `(kₜ, kₛ)`: source coefficients → target coefficients, in given units, between the spectra of the
    /// working meshes; between those of the given ones see [`Correspondence::full_functional_map`].
    pub functional_map: Mat<f64>,
    /// Image of each vertex of the checked target, when a working mesh is not the given one.
    points: Vec<SurfacePoint>,
    /// How the map was judged; nothing for the paper's method.
    pub metrics: Option<Metrics>,
    /// Which shape was taken as a part of the other.
    pub coverage: Coverage,
    /// What could not be done for it, in words.
    pub remarks: Vec<String>,
    /// How the paper's minimisation ended; nothing for the automatic method.
    pub convergence: Option<Convergence>,
    /// Target vertices without an image of their own.
    pub unmatched: usize,
    /// Other maps that stood in the vote, best first.
    pub others: Vec<Hypothesis>,
    /// Whether the target is a copy of the source, or of a part of it, and answers vertex to vertex: no other map then says anything.
    pub is_copy: bool,
    /// What was known of the map.
    pub constraints: Arc<Constraints>,
}

impl Correspondence {
    /// Whether both working meshes are the given ones.
    #[must_use]
    pub fn is_on_given_meshes(&self) -> bool {
        self.points.is_empty()
    }

    /// A map that is known otherwise: for each vertex of the checked target its point on the checked source and how far to
    /// trust it, and for the vertices of both working meshes their images on the other. It is not judged.
    ///
    /// # Errors
    /// [`crate::Error::Cancelled`].
    pub(crate) fn of_points(
        source: &Shape,
        target: &Shape,
        points: Vec<SurfacePoint>,
        trust: &[f64],
        maps: PointMaps<&[u32]>,
        progress: &Progress,
    ) -> Result<Self> {
        let map = functional_map(source, target, maps, &|| progress.check())?;
        let mut found = in_given_numbering(source, target, &points, trust, map);
        if source.full.is_some() || target.full.is_some() {
            found.points = points;
        }
        Ok(found)
    }

    /// The functional map between the spectra of the given meshes when a working mesh is another one: these
    /// are computed when first asked for, which takes longer than the match.
    ///
    /// # Errors
    /// Those of [`Shape::full_spectrum`].
    pub fn full_functional_map(
        &self,
        source: &Shape,
        target: &Shape,
        progress: &Progress,
    ) -> Result<Mat<f64>> {
        let target_full = target.full_spectrum(progress)?;
        let source_full = source.full_spectrum(progress)?;
        let (target_basis, mass, target_unit) = target_full.as_deref().map_or(
            (&target.basis, &target.mass, target.unit),
            |s: &FullSpectrum| (&s.basis, &s.mass, s.unit),
        );
        let (source_basis, source_unit) = source_full
            .as_deref()
            .map_or((&source.basis, source.unit), |s| (&s.basis, s.unit));
        let size = |b: &Eigenbasis| CORRESPONDENCE.functional_map_size.min(b.values.len());
        let faces = &source.given_mesh().faces;
        let own = Mat::from_fn(self.points.len(), size(target_basis), |i, j| {
            mass[i].sqrt() * target_basis.functions[(i, j)]
        });
        let carried = Mat::from_fn(self.points.len(), size(source_basis), |i, j| {
            let SurfacePoint { face, weights } = self.points[i];
            let corners = faces[face as usize];
            let value: f64 = (0..3)
                .map(|c| weights[c] * source_basis.functions[(corners[c] as usize, j)])
                .sum();
            mass[i].sqrt() * value
        });
        let gram = dense::product(own.transpose(), own.as_ref());
        let right = dense::product(own.transpose(), carried.as_ref());
        solved_functional_map(target_unit / source_unit, gram, right.as_ref())
    }
}

/// Points on the given meshes, confidence and functional map, from the rows of both embeddings, the vertex maps
/// between them, and local distortion and gap at each target vertex; `in_detail` refined on the given meshes.
pub(in crate::matching) fn dense_map(
    source: &Shape,
    target: &Shape,
    [source_rows, target_rows]: [&Rows; 2],
    maps: PointMaps<&[u32]>,
    misfit: &[(f64, f64)],
    (landmarks, in_detail): (&[Landmark<WorkingVertex>], bool),
    progress: &Progress,
) -> Result<Correspondence> {
    let check: Check<'_> = &|| progress.check();
    let vertices = &target.mesh.vertices;
    let returns = |v: usize| {
        let there = maps.target_to_source[v] as usize;
        let end = maps.source_to_target[there] as usize;
        vector::norm(vector::sub(vertices[v], vertices[end]))
    };
    let beyond = boundary::beyond(
        &source.rim_nearness,
        &target.rim_nearness,
        maps.target_to_source,
    );
    let trust: Vec<f64> = misfit
        .iter()
        .enumerate()
        .map(|(v, &(distortion, gap))| confidence(distortion, gap, returns(v), beyond[v]))
        .collect();
    let (points, functional_map) = rayon::join(
        || {
            located(
                source,
                target,
                [source_rows, target_rows],
                maps.target_to_source,
                landmarks,
                check,
            )
        },
        || functional_map(source, target, maps, check),
    );
    let (mut points, functional_map) = (points?, functional_map?);
    let mut is_copy = false;
    if in_detail {
        (points, is_copy) = in_detail_of_given(source, target, points, landmarks, check)?;
    }
    let trust = match &target.full {
        Some(full) => full.carried(&trust, &target.mesh),
        None => trust,
    };
    let mut found = in_given_numbering(source, target, &points, &trust, functional_map);
    found.is_copy = is_copy;
    if source.full.is_some() || target.full.is_some() {
        found.points = points;
    }
    Ok(found)
}

/// Points refined on the given meshes where these are as fine as the working ones, and not too large, and whether the target is a
/// copy.
fn in_detail_of_given(
    source: &Shape,
    target: &Shape,
    points: Vec<SurfacePoint>,
    landmarks: &[Landmark<WorkingVertex>],
    check: Check<'_>,
) -> Result<(Vec<SurfacePoint>, bool)> {
    let given = landmarks.iter().map(|l| target.checked_vertex(l.target));
    let given: Vec<CheckedVertex> = given.collect();
    let meshes = [source.given_mesh(), target.given_mesh()];
    if let Some(copied) = detail::copied(meshes[0], meshes[1], &points, &given, check)? {
        return Ok((copied, true));
    }
    let is_coarse = |shape: &Shape| shape.full.as_ref().is_some_and(FullResolution::is_finer);
    let is_large = |mesh: &Mesh| mesh.vertices.len() > DETAIL.most_vertices;
    if is_coarse(source) || is_coarse(target) || meshes.into_iter().any(is_large) {
        return Ok((points, false));
    }
    let refined = detail::refined(meshes[0], meshes[1], &points, &given, check)?;
    Ok((refined, false))
}

/// Point of the given source mesh for each vertex of the given target mesh.
fn located(
    source: &Shape,
    target: &Shape,
    [source_rows, target_rows]: [&Rows; 2],
    images: &[u32],
    landmarks: &[Landmark<WorkingVertex>],
    check: Check<'_>,
) -> Result<Vec<SurfacePoint>> {
    let full = target.full.as_ref();
    let triangles = EmbeddedTriangles::new(source, source_rows);
    let mut points = match full {
        Some(full) => pointwise_map::projected_at_full_resolution(
            &triangles,
            (target, target_rows, full),
            images,
            check,
        ),
        None => pointwise_map::projected(&triangles, target_rows, images, check),
    }?;
    for landmark in landmarks {
        let vertex = target.checked_vertex(landmark.target);
        points[vertex.index()] = source.point_at(landmark.source);
    }
    match &source.full {
        Some(full) => full.located(&points, &source.mesh, check),
        None => Ok(points),
    }
}

/// α with Φₜ α ≈ Φₛ at matched points of both vertex maps, weighted by area; in given units a
/// constant goes to √(areaₜ/areaₛ) times the constant.
fn functional_map(
    source: &Shape,
    target: &Shape,
    maps: PointMaps<&[u32]>,
    check: Check<'_>,
) -> Result<Mat<f64>> {
    let k = |s: &Shape| CORRESPONDENCE.functional_map_size.min(s.basis.values.len());
    let all = |s: &Shape| (0..s.mass.len() as u32).collect::<Vec<u32>>();
    // √a times each shape's eigenfunctions at some vertices.
    let at = |shape: &Shape, vertices: &[u32], mass: &[f64]| {
        shape.rows.gather_weighted(vertices, mass, k(shape))
    };
    let own = at(target, &all(target), &target.mass);
    let carried = at(source, maps.target_to_source, &target.mass);
    check()?;
    let mut right = dense::sum_of_products(own.as_columns(), carried.as_columns());
    check()?;
    let carried_back = at(target, maps.source_to_target, &source.mass);
    let own_of_source = at(source, &all(source), &source.mass);
    check()?;
    right += dense::sum_of_products(carried_back.as_columns(), own_of_source.as_columns());
    check()?;
    // ΦₜᵀAₜΦₜ = I.
    let gram = Mat::<f64>::identity(k(target), k(target)) + dense::gram(carried_back.as_columns());
    solved_functional_map(target.unit / source.unit, gram, right.as_ref())
}

/// `unit_ratio` is the target's unit of length over the source's.
fn solved_functional_map(
    unit_ratio: f64,
    gram: Mat<f64>,
    right: MatRef<'_, f64>,
) -> Result<Mat<f64>> {
    // The constant is carried exactly, so it takes no part in the ridge.
    let ridge = |i: usize| {
        if i == 0 {
            0.0
        } else {
            CORRESPONDENCE.functional_map_ridge
        }
    };
    let alpha = dense::solve_with_ridge(System::Map, gram, ridge, right)?;
    Ok(faer::Scale(unit_ratio) * alpha)
}

/// From the checked meshes in given resolution to their given numbering; dropped target vertices take over the image of the
/// nearest matched one, with confidence 0.
fn in_given_numbering(
    source: &Shape,
    target: &Shape,
    points: &[SurfacePoint],
    trust: &[f64],
    functional_map: Mat<f64>,
) -> Correspondence {
    let (mesh, source) = (target.given_mesh(), source.given_mesh());
    let count = mesh.input_positions.len();
    let mut checked: Vec<Option<u32>> = vec![None; count];
    for (i, &v) in mesh.input_vertex.iter().enumerate() {
        checked[v.index()] = Some(i as u32);
    }
    let tree = LazyCell::new(|| SpaceTree::new(&mesh.vertices));
    let mut found = Correspondence {
        faces: Vec::with_capacity(count),
        barycentric: Vec::with_capacity(count),
        vertices: Vec::with_capacity(count),
        confidence: Vec::with_capacity(count),
        functional_map,
        points: Vec::new(),
        metrics: None,
        coverage: Coverage::BOTH,
        remarks: Vec::new(),
        convergence: None,
        unmatched: 0,
        others: Vec::new(),
        is_copy: false,
        constraints: Arc::default(),
    };
    for (v, own) in checked.into_iter().enumerate() {
        let (i, certainty) = if let Some(i) = own {
            (i, trust[i as usize])
        } else {
            found.unmatched += 1;
            let near = tree.nearest(mesh.input_positions[v]);
            (near.expect("a checked mesh has vertices"), 0.0)
        };
        let SurfacePoint { face, weights } = points[i as usize];
        let largest = (1..3).fold(
            0,
            |best, c| if weights[c] > weights[best] { c } else { best },
        );
        let corner = source.faces[face as usize][largest];
        found.faces.push(source.input_face[face as usize]);
        found.vertices.push(source.input_vertex[corner as usize].0);
        let turned = source.turned[face as usize];
        let [a, b, c] = weights;
        found
            .barycentric
            .push(if turned { [a, c, b] } else { [a, b, c] });
        found.confidence.push(certainty);
    }
    found
}
