//! A target that lies on the source's surface, as pieces on the body they were joined to: exact places.

use faer::Mat;
use rayon::prelude::*;

use crate::algebra::dense::solve_with_ridge;
use crate::algebra::similarity::{Similarity, nearest_turn};
use crate::algebra::vector::{self, Point};
use crate::error::{Error, Result, System};
use crate::mesh::surface_point::SurfacePoint;
use crate::transfer::frame::Affine;
use crate::transfer::settings::COINCIDENCE;
use crate::transfer::surface::{Surface, blend};
use crate::transfer::surface_map::SurfaceMap;

/// Where the target lies on the source.
#[derive(Debug, Clone, PartialEq)]
pub struct Coincidence {
    /// What takes the source's coordinates to the target's.
    pub to_target: Affine,
    /// Which of the target's face corners lie on the source, `(corners)`.
    pub there: Vec<bool>,
    /// The place of the source nearest to each of them, on its side of a hard edge, `(corners)`.
    pub points: Vec<SurfacePoint>,
}

/// Corners of the target's faces.
#[derive(Debug, Clone, Copy)]
pub struct Corners<'a> {
    /// Vertex of each corner, `(corners)`.
    pub vertices: &'a [i64],
    /// Corners of the triangles into which the faces are divided; of a corner of several the last tells its side of an
    /// edge, since faces need not be flat.
    pub triangles: &'a [[i64; 3]],
}

/// How the target lies on the source, or nothing where less than half of it does.
///
/// `standing` takes the source's coordinates to the target's as both stand. Where the target does not lie on the source
/// so, the similarity is sought that lays it there: that of the map first, then in rounds by the planes with normals n at the
/// places q nearest to its vertices p, `min Σ ⟨p + ω × p + t + g p − q, n⟩²` over the nearer half of them, with a small turn
/// ω, shift t and growth g. A corner whose image is far from where it lies is of another part and not there.
///
/// # Errors
/// [`Error::BadArgument`] when a vertex or corner does not exist or `standing` flattens space.
///
/// # Source
/// Chen, Medioni, "Object modelling by registration of multiple range images", 1992.
pub fn coincidence(
    map: &SurfaceMap,
    standing: &Affine,
    corners: Corners<'_>,
) -> Result<Option<Coincidence>> {
    let (source, target) = (&map.source, &map.target);
    let vertices = checked("corner_vertices", corners.vertices, target.vertices.len())?;
    checked(
        "triangle_corners",
        corners.triangles.as_flattened(),
        vertices.len(),
    )?;
    let Some(standing) = standing.inverse() else {
        return Err(Error::BadArgument {
            what:
                "`standing` should be a matrix with an inverse: give one that keeps volumes above 0"
                    .into(),
        });
    };
    let step = (target.vertices.len() / COINCIDENCE.probes).max(1);
    let probes: Vec<(Point, Point)> = (target.vertices.iter().zip(map.images()))
        .map(|(&place, &image)| (place, image))
        .step_by(step)
        .collect();
    let size = target.diagonal();
    let lies = |to_source: &Affine| {
        let reach = COINCIDENCE.on * size * to_source.scale();
        let near = probes.par_iter().filter(|(place, _)| {
            let place = to_source.apply(*place);
            vector::distance(source.position(&source.nearest(place)), place) < reach
        });
        near.count() as f64 >= COINCIDENCE.most * probes.len() as f64
    };
    let to_source = if lies(&standing) {
        standing
    } else {
        let laid = laid(source, &probes)?;
        if !lies(&laid) {
            return Ok(None);
        }
        laid
    };
    Ok(to_source.inverse().map(|to_target| {
        let size = size * to_source.scale();
        let (there, points) = places(map, &vertices, corners.triangles, &to_source, size);
        Coincidence {
            to_target,
            there,
            points,
        }
    }))
}

fn checked(name: &str, ids: &[i64], count: usize) -> Result<Vec<u32>> {
    let found: Option<Vec<u32>> = (ids.iter())
        .map(|&id| (0..count as i64).contains(&id).then_some(id as u32))
        .collect();
    found.ok_or_else(|| Error::BadArgument {
        what: format!("`{name}` should be from 0 and below {count}: give those of this target"),
    })
}

/// A probe as it lies, the way to its nearest place, and the normal there.
struct Foot {
    place: Point,
    way: Point,
    normal: Point,
}

/// The similarity that lays the target onto the source best: from its vertices and their images, then by nearest planes.
fn laid(source: &Surface, probes: &[(Point, Point)]) -> Result<Affine> {
    let pairs: Vec<(Point, Point, f64)> = probes.iter().map(|&(p, q)| (p, q, 1.0)).collect();
    let mut to_source = Affine::from(Similarity::onto(&pairs, false));
    for _ in 0..COINCIDENCE.rounds {
        let feet: Vec<Foot> = (probes.par_iter())
            .map(|&(place, _)| {
                let place = to_source.apply(place);
                let nearest = source.nearest(place);
                Foot {
                    place,
                    way: vector::sub(source.position(&nearest), place),
                    normal: vector::normalised(source.cross(nearest.face)),
                }
            })
            .collect();
        to_source = drawn(&feet)?.after(&to_source);
    }
    Ok(to_source)
}

/// A small turn, shift and growth by which the nearer half of the probes comes onto the planes.
fn drawn(feet: &[Foot]) -> Result<Affine> {
    let mut distances: Vec<f64> = feet.iter().map(|foot| vector::norm(foot.way)).collect();
    distances.sort_by(f64::total_cmp);
    let median = distances[(distances.len() - 1) / 2];
    let near: Vec<&Foot> = (feet.iter())
        .filter(|foot| vector::norm(foot.way) <= median)
        .collect();
    let places: Vec<Point> = near.iter().map(|foot| foot.place).collect();
    // Around their middle and in units of their size, turns, shifts and growth count alike.
    let middle = vector::mean(&places);
    let size = vector::extent(&places).max(f64::MIN_POSITIVE);
    let (mut gram, mut right) = (Mat::zeros(7, 7), Mat::zeros(7, 1));
    for foot in &near {
        let place = vector::scaled(vector::sub(foot.place, middle), 1.0 / size);
        let [a, b, c] = vector::cross(place, foot.normal);
        let [x, y, z] = foot.normal;
        let row = [a, b, c, x, y, z, vector::dot(place, foot.normal)];
        let off = vector::dot(foot.way, foot.normal) / size;
        for i in 0..7 {
            right[(i, 0)] += row[i] * off;
            for j in 0..7 {
                gram[(i, j)] += row[i] * row[j];
            }
        }
    }
    let ridge = COINCIDENCE.ridge * near.len() as f64;
    let step = solve_with_ridge(System::Deformation, gram, |_| ridge, right.as_ref())?;
    let [a, b, c, x, y, z, growth] = [0, 1, 2, 3, 4, 5, 6].map(|i| step[(i, 0)]);
    let turn = nearest_turn(&[[1.0, -c, b], [c, 1.0, -a], [-b, a, 1.0]], false);
    let grown = 1.0 + growth.clamp(-COINCIDENCE.largest_growth, COINCIDENCE.largest_growth);
    let linear = turn.map(|row| vector::scaled(row, grown));
    let moved = vector::add(middle, vector::scaled([x, y, z], size));
    Ok(Affine {
        linear,
        shift: vector::sub(moved, vector::by_rows(&linear, middle)),
    })
}

/// Which corners lie on the source, whose coordinates the target of a size there is taken to, and where.
fn places(
    map: &SurfaceMap,
    vertices: &[u32],
    triangles: &[[i64; 3]],
    to_source: &Affine,
    size: f64,
) -> (Vec<bool>, Vec<SurfacePoint>) {
    let place = |corner: usize| map.target.vertices[vertices[corner] as usize];
    let mut middles: Vec<Point> = (0..vertices.len()).map(place).collect();
    for corners in triangles {
        let corners = corners.map(|corner| corner as usize);
        let middle = vector::mean(&corners.map(place));
        for corner in corners {
            middles[corner] = middle;
        }
    }
    (0..vertices.len())
        .into_par_iter()
        .map(|corner| {
            let [place, middle] = [place(corner), middles[corner]].map(|p| to_source.apply(p));
            let into = vector::scaled(vector::sub(middle, place), COINCIDENCE.into_face);
            let looked_up = vector::add(place, into);
            let nearest = map.source.nearest(looked_up);
            let corners = map.source.corners(nearest.face);
            let (_, weights) = map.source.to_triangle(place, nearest.face);
            let face = nearest.face;
            let away = vector::distance(map.source.position(&nearest), looked_up);
            let off = vector::distance(blend(corners, weights), place);
            let apart = vector::distance(map.images()[vertices[corner] as usize], place);
            let is_there =
                away.max(off) < COINCIDENCE.on * size && apart < COINCIDENCE.same_part * size;
            (is_there, SurfacePoint { face, weights })
        })
        .unzip()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wavy sheet that curves every way, so that nothing slides along itself.
    fn sheet() -> (Vec<Point>, Vec<[i64; 3]>) {
        let side = 12;
        let vertices = (0..side * side)
            .map(|v| {
                let [x, y] = [v / side, v % side].map(|i| i as f64 / side as f64);
                [
                    x,
                    y,
                    0.3 * (5.0 * x).sin() * (4.0 * y + 1.0).cos() + 0.2 * x * y,
                ]
            })
            .collect();
        let faces = (0..side * (side - 1))
            .filter(|v| v % side + 1 < side)
            .flat_map(|v| [[v, v + side, v + 1], [v + 1, v + side, v + side + 1]])
            .collect();
        (vertices, faces)
    }

    #[test]
    fn a_sheet_that_was_moved_is_laid_back() {
        let (vertices, faces) = sheet();
        let motion = Affine {
            linear: [[0.0, 0.0, 1.5], [1.5, 0.0, 0.0], [0.0, 1.5, 0.0]],
            shift: [4.0, -2.0, 1.0],
        };
        let target: Vec<Point> = vertices.iter().map(|&p| motion.apply(p)).collect();
        // A map that leads to one corner of the right face.
        let of = |v: usize| faces.iter().position(|f| f.contains(&(v as i64))).unwrap() as i64;
        let count = vertices.len();
        let map = SurfaceMap::new(
            Surface::new(vertices.clone(), &faces).unwrap(),
            Surface::new(target, &faces).unwrap(),
            &(0..count).map(of).collect::<Vec<_>>(),
            &vec![[1.0, 0.0, 0.0]; count],
            vec![1.0; count],
        )
        .unwrap();
        let own: Vec<[i64; 3]> = (0..faces.len() as i64)
            .map(|f| [3 * f, 3 * f + 1, 3 * f + 2])
            .collect();
        let corners = Corners {
            vertices: faces.as_flattened(),
            triangles: &own,
        };
        for standing in [motion, Affine::of_rows(&unity())] {
            let found = coincidence(&map, &standing, corners).unwrap().unwrap();
            for (corner, point) in found.points.iter().enumerate() {
                let vertex = vertices[corners.vertices[corner] as usize];
                // What fifteen rounds leave is rounding.
                assert!(
                    vector::distance(found.to_target.apply(vertex), motion.apply(vertex)) < 1e-9
                );
                assert!(found.there[corner]);
                assert!(vector::distance(map.source.position(point), vertex) < 1e-9);
            }
        }
    }

    fn unity() -> [[f64; 4]; 4] {
        [0, 1, 2, 3].map(|i| [0, 1, 2, 3].map(|j| f64::from(u8::from(i == j))))
    }
}
