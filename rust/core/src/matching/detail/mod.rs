//! The last stage, on the given meshes: the target's surface is laid onto the source's down to its finest edges.
//!
//! Maps are sought on working meshes, which leave out what is finer than their edges, and read off them vertex by vertex, so
//! that lips, lids and fingers that lie close exchange images. Here the target's given surface is [laid](similar) through its
//! images and then moves onto the source's given surface in steps: each vertex is drawn along the normal of the source's
//! point that is near *and faces the same way*, and the displacements of a step are those of a [membrane] whose length of
//! averaging falls from [`COARSEST`] to that of the finest edges. The surface moves as a whole, so that neighbours stay
//! neighbours along it, and sheets that face each other are never exchanged.
//!
//! Comes in: two checked meshes at unit area and the source's point of each target vertex. Goes out: these points, refined.
//!
//! # Source
//! Chen, Medioni, "Object modelling by registration of multiple range images", 1992 (drawn along normals); Amberg, Romdhani,
//! Vetter, "Optimal step nonrigid ICP algorithms for surface registration", 2007 (stiffness lowered step by step); Thirion,
//! "Image matching as a diffusion process: an analogy with Maxwell's demons", 1998 (steps smoothed, not their sum).

mod ground;
mod membrane;
mod similar;

use crate::algebra::vector::{self, Point};
use crate::error::Result;
use crate::mesh::edge_weights::EdgeWeights;
use crate::mesh::surface_point::SurfacePoint;
use crate::mesh::{Mesh, normals_of};
use crate::watch::progress::Check;

use ground::Ground;
use membrane::{Membrane, Symmetric, along, times};

/// Larger meshes keep what the working meshes say: the stage takes a tenth of a second for a thousand vertices.
pub(crate) const MOST_VERTICES: usize = 60_000;
/// Length over which the first displacements are averaged, at unit area: twice what maps are off on working meshes.
const COARSEST: f64 = 0.03;
/// The last length of averaging in edges of the finest parts.
const FINEST: f64 = 0.7;
/// Share of the vertices that are the finest parts.
const FINE_PART: f64 = 0.1;
/// Least length of averaging of a vertex in its own edges: what is coarser moves with what is around it.
const OWN_EDGES: f64 = 0.5;
/// Lengths of averaging, in equal ratios from the coarsest to the finest.
const STAGES: usize = 5;
/// Steps at each.
const STEPS: usize = 3;
/// Steps at the last.
const LAST_STEPS: usize = 5;
/// ρ, the distance that a turn of normals by one radian counts, at the coarsest and, in lengths of averaging, at the finest.
const COARSEST_TURN: f64 = 0.015;
const FINEST_TURN: f64 = 2.0;
/// How strongly vertices are drawn across the normal, relative to along it.
const ACROSS: f64 = 0.1;
/// Keeps the equations regular where nothing draws.
const LEAST_DRAW: f64 = 1e-6;

/// The source's point of each target vertex, refined on the given surfaces.
///
/// # Errors
/// [`crate::Error::Cancelled`].
pub(crate) fn refined(
    source: &Mesh,
    target: &Mesh,
    points: &[SurfacePoint],
    check: Check<'_>,
) -> Result<Vec<SurfacePoint>> {
    let rest = &target.vertices;
    let images: Vec<Point> = points.iter().map(|p| at(source, p)).collect();
    let (edges, ground) = rayon::join(
        || EdgeWeights::new(rest, &target.faces),
        || Ground::new(source, COARSEST_TURN / 2.0),
    );
    let areas = areas(target);
    let own_edges = edge_lengths(rest, &edges);
    let finest = FINEST * quantile(&own_edges, FINE_PART);
    let mirrored = is_mirrored(source, target, points, &images);
    let facing = if mirrored { -1.0 } else { 1.0 };
    let mut places = similar::laid(rest, (&areas, &edges), &images, mirrored, check)?;
    let mut known: Vec<u32> = points
        .iter()
        .map(|p| source.faces[p.face as usize][0])
        .collect();
    let finest_turn = FINEST_TURN * finest;
    let mut rho = vec![0.0; rest.len()];
    let normals = |places: &[Point]| -> Vec<Point> {
        let mut normals = normals_of(places, &target.faces);
        for n in &mut normals {
            *n = vector::scaled(*n, facing);
        }
        normals
    };
    for stage in 0..STAGES {
        let share = stage as f64 / (STAGES - 1) as f64;
        let between = |from: f64, to: f64| from * (to / from).powf(share);
        let length = between(COARSEST, finest.min(COARSEST));
        let turn = between(COARSEST_TURN, finest_turn.min(COARSEST_TURN));
        let lengths: Vec<f64> = own_edges
            .iter()
            .map(|e| length.max(OWN_EDGES * e))
            .collect();
        for (rho, l) in rho.iter_mut().zip(&lengths) {
            *rho = turn * (l / length);
        }
        let steps = if stage + 1 == STAGES {
            LAST_STEPS
        } else {
            STEPS
        };
        for _ in 0..steps {
            check()?;
            let facing = normals(&places);
            let feet = ground.feet(&places, &facing, &rho, &known);
            let mut drawn: Vec<Symmetric> = Vec::with_capacity(feet.len());
            let mut right = Vec::with_capacity(feet.len());
            for (v, foot) in feet.iter().enumerate() {
                let agree = vector::dot(foot.normal, facing[v]).max(0.0);
                let weight = if foot.on_rim {
                    0.0
                } else {
                    areas[v] * agree * agree
                };
                let draw = along(foot.normal, ACROSS, weight);
                right.push(times(&draw, vector::sub(foot.place, places[v])));
                let least = LEAST_DRAW * areas[v];
                let [xx, xy, xz, yy, yz, zz] = draw;
                drawn.push([xx + least, xy, xz, yy + least, yz, zz + least]);
                known[v] = foot.vertex;
            }
            let start = vec![[0.0; 3]; places.len()];
            let moved = Membrane::new(&edges, &lengths, &drawn).solved(&right, start, check)?;
            for (place, moved) in places.iter_mut().zip(moved) {
                *place = vector::add(*place, moved);
            }
        }
    }
    let feet = ground.feet(&places, &normals(&places), &rho, &known);
    Ok(feet.into_iter().map(|foot| foot.point).collect())
}

/// Where a point of a surface lies.
fn at(mesh: &Mesh, point: &SurfacePoint) -> Point {
    let corners = mesh.faces[point.face as usize];
    (0..3).fold([0.0; 3], |sum, i| {
        let corner = mesh.vertices[corners[i] as usize];
        vector::add(sum, vector::scaled(corner, point.weights[i]))
    })
}

/// A third of the area of the faces around each vertex.
fn areas(mesh: &Mesh) -> Vec<f64> {
    let mut areas = vec![0.0; mesh.vertices.len()];
    for (f, corners) in mesh.faces.iter().enumerate() {
        let third = mesh.face_area(f) / 3.0;
        for &v in corners {
            areas[v as usize] += third;
        }
    }
    areas
}

/// Mean length of the edges at each vertex.
fn edge_lengths(places: &[Point], edges: &EdgeWeights) -> Vec<f64> {
    (0..places.len())
        .map(|i| {
            let row = edges.neighbours.row(i);
            let sum: f64 = row
                .iter()
                .map(|&j| vector::distance(places[i], places[j as usize]))
                .sum();
            sum / row.len().max(1) as f64
        })
        .collect()
}

/// The value below which this share of some values lies.
fn quantile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    let place = ((values.len() - 1) as f64 * share) as usize;
    *sorted.select_nth_unstable_by(place, f64::total_cmp).1
}

/// Whether images of triangles are wound the other way round than the surface on which they lie.
fn is_mirrored(source: &Mesh, target: &Mesh, points: &[SurfacePoint], images: &[Point]) -> bool {
    let turned: f64 = target
        .faces
        .iter()
        .map(|&corners| {
            let [a, b, c] = corners.map(|v| images[v as usize]);
            let across = vector::cross(vector::sub(b, a), vector::sub(c, a));
            let on = source.face_cross(points[corners[0] as usize].face as usize);
            vector::dot(across, vector::normalised(on))
        })
        .sum();
    turned < 0.0
}
