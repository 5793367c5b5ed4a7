//! The last stage, on the given meshes: the target's surface is laid onto the source's down to its finest edges.
//!
//! Maps are sought on working meshes, which leave out what is finer than their edges, and read off them vertex by vertex, so
//! that lips, lids and fingers that lie close exchange images. Here the target's given surface is [laid](similar) through its
//! images and then moves onto the source's given surface in steps: each vertex is drawn along the normal of the source's
//! point that is near *and faces the same way*, and the displacements of a step are those of a [membrane] whose length of
//! averaging falls from `DETAIL.coarsest` to that of the finest edges. The surface moves as a whole, so that neighbours stay
//! neighbours along it, and sheets that face each other are never exchanged. [Creases](creases) are drawn to creases.
//!
//! A target that is a [copy](crate::mesh::copies) of the source or of a part of it answers vertex to vertex.
//!
//! Comes in: two checked meshes at unit area, the source's point of each target vertex, and which of these are given. Goes out:
//! these points, refined.
//!
//! # Source
//! Chen, Medioni, "Object modelling by registration of multiple range images", 1992 (drawn along normals); Amberg, Romdhani,
//! Vetter, "Optimal step nonrigid ICP algorithms for surface registration", 2007 (stiffness lowered step by step); Thirion,
//! "Image matching as a diffusion process: an analogy with Maxwell's demons", 1998 (steps smoothed, not their sum).

mod creases;
mod ground;
mod membrane;
pub mod settings;
mod similar;

use crate::algebra::vector::{self, Point};
use crate::error::Result;
use crate::matching::detail::settings::DETAIL;
use crate::mesh::copies::{Triangles, originals};
use crate::mesh::edge_weights::EdgeWeights;
use crate::mesh::numbering::CheckedVertex;
use crate::mesh::settings::COPIES;
use crate::mesh::surface_point::SurfacePoint;
use crate::mesh::{Mesh, normals_of};
use crate::watch::progress::Check;

use creases::bends;
use ground::Ground;
use membrane::{Membrane, Symmetric, along, times};

/// The source's point of each target vertex where the target is a [copy](crate::mesh::copies) of it, or of a part, and the
/// vertices whose points are given keep theirs.
///
/// # Errors
/// [`crate::Error::Cancelled`].
pub(crate) fn copied(
    source: &Mesh,
    target: &Mesh,
    points: &[SurfacePoint],
    given: &[CheckedVertex],
    check: Check<'_>,
) -> Result<Option<Vec<SurfacePoint>>> {
    if target.faces.len() > source.faces.len() {
        return Ok(None);
    }
    let images: Vec<Point> = points.iter().map(|p| at(source, p)).collect();
    let mirrored = is_mirrored(source, target, points, &images);
    let [from, to] = [source, target].map(|mesh| Triangles {
        vertices: &mesh.vertices,
        faces: &mesh.faces,
    });
    let found = originals(from, to, Some(&images), mirrored, check)?;
    let vertices: Option<Vec<u32>> = (found.into_iter().map(|o| o.map(|o| o.vertex))).collect();
    let kept = |vertices: &[u32]| {
        given.iter().all(|&v| {
            let image = source.vertices[vertices[v.index()] as usize];
            vector::distance(image, images[v.index()]) < COPIES.same
        })
    };
    let copied = vertices.filter(|vertices| kept(vertices));
    Ok(copied.map(|vertices| at_vertices(source, &vertices)))
}

/// The source's point of each target vertex, refined on the given surfaces but for the vertices whose points are given.
///
/// # Errors
/// [`crate::Error::Cancelled`].
pub(crate) fn refined(
    source: &Mesh,
    target: &Mesh,
    points: &[SurfacePoint],
    given: &[CheckedVertex],
    check: Check<'_>,
) -> Result<Vec<SurfacePoint>> {
    let rest = &target.vertices;
    let images: Vec<Point> = points.iter().map(|p| at(source, p)).collect();
    let mirrored = is_mirrored(source, target, points, &images);
    let mut is_given = vec![false; rest.len()];
    for &v in given {
        is_given[v.index()] = true;
    }
    let (edges, ground) = rayon::join(
        || EdgeWeights::new(rest, &target.faces),
        || Ground::new(source, DETAIL.coarsest_turn / 2.0),
    );
    let areas = areas(target);
    let own_edges = edge_lengths(rest, &edges);
    let finest = DETAIL.finest * quantile(&own_edges, DETAIL.fine_part);
    let facing = if mirrored { -1.0 } else { 1.0 };
    let creases = ground.creases(finest);
    let own_bends = bends(target, &target.vertex_normals());
    let mut places = similar::laid(rest, (&areas, &edges), &images, mirrored, check)?;
    let mut known: Vec<u32> = points
        .iter()
        .map(|p| source.faces[p.face as usize][0])
        .collect();
    let finest_turn = DETAIL.finest_turn * finest;
    let mut rho = vec![0.0; rest.len()];
    let normals = |places: &[Point]| -> Vec<Point> {
        let mut normals = normals_of(places, &target.faces);
        for n in &mut normals {
            *n = vector::scaled(*n, facing);
        }
        normals
    };
    for stage in 0..DETAIL.stages {
        let share = stage as f64 / (DETAIL.stages - 1) as f64;
        let between = |from: f64, to: f64| from * (to / from).powf(share);
        let length = between(DETAIL.coarsest, finest.min(DETAIL.coarsest));
        let turn = between(DETAIL.coarsest_turn, finest_turn.min(DETAIL.coarsest_turn));
        let lengths: Vec<f64> = own_edges
            .iter()
            .map(|e| length.max(DETAIL.own_edges * e))
            .collect();
        for (rho, l) in rho.iter_mut().zip(&lengths) {
            *rho = turn * (l / length);
        }
        let steps = if stage + 1 == DETAIL.stages {
            DETAIL.last_steps
        } else {
            DETAIL.steps
        };
        for _ in 0..steps {
            check()?;
            let facing = normals(&places);
            let feet = ground.feet(&places, &facing, &rho, &known);
            let mut drawn: Vec<Symmetric> = Vec::with_capacity(feet.len());
            let mut right = Vec::with_capacity(feet.len());
            for (v, foot) in feet.iter().enumerate() {
                known[v] = foot.vertex;
                if is_given[v] {
                    let weight = DETAIL.given * areas[v];
                    right.push(vector::scaled(vector::sub(images[v], places[v]), weight));
                    drawn.push([weight, 0.0, 0.0, weight, 0.0, weight]);
                    continue;
                }
                let agree = vector::dot(foot.normal, facing[v]).max(0.0);
                let weight = if foot.on_rim {
                    0.0
                } else {
                    areas[v] * agree * agree
                };
                let mut draw = along(foot.normal, DETAIL.across, weight);
                let mut toward = times(&draw, vector::sub(foot.place, places[v]));
                let at = (places[v], facing[v]);
                if length < creases.reach()
                    && let Some((more, off)) = creases.drawing(&own_bends[v], at, rho[v], areas[v])
                {
                    toward = vector::add(toward, off);
                    for (all, more) in draw.iter_mut().zip(more) {
                        *all += more;
                    }
                }
                right.push(toward);
                let least = DETAIL.least_draw * areas[v];
                let [xx, xy, xz, yy, yz, zz] = draw;
                drawn.push([xx + least, xy, xz, yy + least, yz, zz + least]);
            }
            let start = vec![[0.0; 3]; places.len()];
            let moved = Membrane::new(&edges, &lengths, &drawn).solved(&right, start, check)?;
            for (place, moved) in places.iter_mut().zip(moved) {
                *place = vector::add(*place, vector::scaled(moved, DETAIL.stride));
            }
        }
    }
    let feet = ground.feet(&places, &normals(&places), &rho, &known);
    let mut refined: Vec<SurfacePoint> = feet.into_iter().map(|foot| foot.point).collect();
    for &v in given {
        refined[v.index()] = points[v.index()];
    }
    Ok(refined)
}

/// Vertices of a mesh as points of its surface.
fn at_vertices(mesh: &Mesh, vertices: &[u32]) -> Vec<SurfacePoint> {
    let faces = mesh.vertex_faces();
    let point = |&v: &u32| SurfacePoint::at_corner(&mesh.faces, faces.row(v as usize)[0], v);
    vertices.iter().map(point).collect()
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{RINGS, draws, torus_mesh};

    /// A mesh, and vertex i of it as `order[i]` of the returned one, its faces shuffled and rotated, its places moved.
    fn renumbered(mesh: &Mesh, moved: impl Fn(Point) -> Point) -> (Mesh, Vec<u32>) {
        let n = mesh.vertices.len();
        let mut draw = draws(7);
        let mut order: Vec<u32> = (0..n as u32).collect();
        for i in (1..n).rev() {
            order.swap(i, draw() as usize % (i + 1));
        }
        let mut vertices = vec![[0.0; 3]; n];
        for (v, &new) in order.iter().enumerate() {
            vertices[new as usize] = moved(mesh.vertices[v]);
        }
        let mut faces: Vec<[i64; 3]> = (mesh.faces.iter())
            .map(|f| f.map(|v| i64::from(order[v as usize])))
            .collect();
        for i in (1..faces.len()).rev() {
            faces.swap(i, draw() as usize % (i + 1));
            faces[i].rotate_left(draw() as usize % 3);
        }
        (Mesh::new(&vertices, &faces).expect("a sound mesh"), order)
    }

    fn part_of_torus(rings: usize) -> Mesh {
        let (vertices, faces) = torus_mesh(rings, &[], 0.0);
        Mesh::new(&vertices, &faces).expect("a sound mesh")
    }

    /// Every target vertex at the vertex of the source that is `apart` numbers further.
    fn points_at(source: &Mesh, vertices: impl Iterator<Item = u32>) -> Vec<SurfacePoint> {
        at_vertices(source, &vertices.collect::<Vec<_>>())
    }

    fn turned([x, y, z]: Point) -> Point {
        [2.0 * z + 5.0, 2.0 * x, 2.0 * y - 1.0]
    }

    fn mirrored([x, y, z]: Point) -> Point {
        [-x, y, z]
    }

    /// For a target whose vertex `order[v]` is the source's v: the greatest distance of an image from there.
    fn furthest_off(source: &Mesh, points: &[SurfacePoint], order: &[u32]) -> f64 {
        let off = order.iter().enumerate().map(|(v, &new)| {
            vector::distance(at(source, &points[new as usize]), source.vertices[v])
        });
        off.fold(0.0, f64::max)
    }

    #[test]
    fn copies_come_back_vertex_by_vertex() {
        let source = part_of_torus(RINGS);
        for moved in [turned, mirrored] {
            let (target, order) = renumbered(&source, moved);
            // Each near its image: the neighbour in its ring.
            let mut near = vec![0; order.len()];
            for (v, &new) in order.iter().enumerate() {
                near[new as usize] = (v as u32 / 20) * 20 + (v as u32 + 1) % 20;
            }
            let points = points_at(&source, near.into_iter());
            let found = copied(&source, &target, &points, &[], &|| Ok(()));
            let found = found.expect("not cancelled").expect("it is a copy");
            assert_eq!(furthest_off(&source, &found, &order), 0.0);
        }
    }

    #[test]
    fn a_part_is_found_in_its_place() {
        let source = part_of_torus(RINGS);
        let (part, faces) = torus_mesh(9, &[], 0.0);
        let part = Mesh::new(&part, &faces).expect("a sound mesh");
        let far = points_at(&source, part.vertices.iter().map(|_| 400));
        let found = copied(&source, &part, &far, &[], &|| Ok(()));
        let found = found.expect("not cancelled").expect("it is a part");
        for (own, point) in part.input_vertex.iter().zip(&found) {
            let image = source.faces[point.face as usize]
                .iter()
                .zip(point.weights)
                .find(|(_, w)| *w == 1.0);
            assert_eq!(
                image.map(|(&v, _)| source.input_vertex[v as usize]),
                Some(*own)
            );
        }
    }

    #[test]
    fn what_is_stretched_is_no_copy() {
        let source = part_of_torus(RINGS);
        let points = points_at(&source, 0..source.vertices.len() as u32);
        let (stretched, _) = renumbered(&source, |[x, y, z]| [x, y, 2.0 * z]);
        assert!(copied(&source, &stretched, &points, &[], &|| Ok(())) == Ok(None));
        // A copy that a given point contradicts is none.
        let (target, order) = renumbered(&source, turned);
        let own = order.iter().position(|&new| new == 0).expect("a vertex") as u32;
        let other = points_at(&source, (0..order.len() as u32).map(|_| own + 1));
        assert!(copied(&source, &target, &other, &[CheckedVertex(0)], &|| Ok(())) == Ok(None));
    }

    /// Two spheres, one inside the other and facing inward, joined by a neck: a shell whose sheets are a hundredth apart.
    /// Images on the wrong sheet come back to their own.
    #[test]
    fn sheets_that_lie_close_do_not_exchange_images() {
        let shell = shell();
        let (target, order) = renumbered(&shell, |p| p);
        let mut inner = vec![false; order.len()];
        let radius = |m: &Mesh, v: usize| vector::norm(m.vertices[v]);
        let largest = (0..shell.vertices.len())
            .map(|v| radius(&shell, v))
            .fold(0.0, f64::max);
        let mut images = vec![0; order.len()];
        for (v, &new) in order.iter().enumerate() {
            inner[v] = radius(&shell, v) < 0.97 * largest;
            images[new as usize] = v as u32;
        }
        // Every tenth vertex is given an image on the other sheet, the next to its own in space.
        let other_sheet = |v: u32| {
            let there = (0..shell.vertices.len()).filter(|&u| inner[u] != inner[v as usize]);
            let apart =
                |u: &usize| vector::distance(shell.vertices[*u], shell.vertices[v as usize]);
            there
                .min_by(|a, b| apart(a).total_cmp(&apart(b)))
                .expect("two sheets") as u32
        };
        for image in images.iter_mut().step_by(10) {
            *image = other_sheet(*image);
        }
        let points = points_at(&shell, images.into_iter());
        let found = refined(&shell, &target, &points, &[], &|| Ok(())).expect("not cancelled");
        let exchanged = order.iter().enumerate().filter(|&(v, &new)| {
            let is_inner = vector::norm(at(&shell, &found[new as usize])) < 0.97 * largest;
            is_inner != inner[v]
        });
        assert_eq!(exchanged.count(), 0);
    }

    /// A sphere without a cap and one of 0.94 times its radius inside it, joined along the rim.
    fn shell() -> Mesh {
        let (rings, around) = (24i64, 32i64);
        let mut vertices = Vec::new();
        for radius in [1.0, 0.94] {
            for ring in 0..rings {
                let polar = 0.3 + (std::f64::consts::PI - 0.6) * ring as f64 / (rings - 1) as f64;
                for step in 0..around {
                    let turn = std::f64::consts::TAU * step as f64 / around as f64;
                    let (sin, cos) = polar.sin_cos();
                    vertices.push([sin * turn.cos(), sin * turn.sin(), cos].map(|c| radius * c));
                }
            }
        }
        let vertex =
            |sheet: i64, ring: i64, step: i64| (sheet * rings + ring) * around + step % around;
        let mut faces = Vec::new();
        let mut quad = |a: i64, b: i64, c: i64, d: i64| faces.extend([[a, b, c], [a, c, d]]);
        for step in 0..around {
            for ring in 0..rings - 1 {
                let [a, b, c, d] = [(0, 0), (1, 0), (1, 1), (0, 1)];
                let outer = |(r, s): (i64, i64)| vertex(0, ring + r, step + s);
                let inner = |(r, s): (i64, i64)| vertex(1, ring + r, step + s);
                quad(outer(a), outer(b), outer(c), outer(d));
                quad(inner(d), inner(c), inner(b), inner(a));
            }
            for (ring, flip) in [(0, true), (rings - 1, false)] {
                let rim = [(0, step), (0, step + 1), (1, step + 1), (1, step)];
                let [a, b, c, d] = rim.map(|(sheet, step)| vertex(sheet, ring, step));
                if flip {
                    quad(a, b, c, d);
                } else {
                    quad(d, c, b, a);
                }
            }
        }
        Mesh::new(&vertices, &faces).expect("a sound mesh")
    }
}
