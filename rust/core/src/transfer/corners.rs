//! Data of face corners: every target face takes its values from one side of a border.
//!
//! A border is an edge of the source along which the values of its two triangles differ: a UV
//! seam, a hard edge between two colours.

use rayon::prelude::*;

use crate::algebra::vector::{self, Point};
use crate::error::{Error, Result};
use crate::mesh::Adjacency;
use crate::mesh::surface_point::SurfacePoint;
use crate::transfer::settings::CORNERS;
use crate::transfer::surface::{NONE, Surface};
use crate::transfer::surface_map::{SurfaceMap, check_table};

/// Weights below this are zero: the point lies on an edge or at a vertex.
pub const ON_EDGE: f64 = 1e-6;

/// Faces of any number of corners, in compressed rows.
#[derive(Debug)]
pub struct Polygons {
    /// First corner of each face, and the number of corners at the end.
    pub starts: Vec<u32>,
    /// Vertex of each corner.
    pub vertices: Vec<u32>,
}

impl Polygons {
    /// Checks rows against a surface.
    ///
    /// # Errors
    /// [`Error::BadArgument`] when the rows do not cover the corners or a vertex does not exist.
    pub fn new(starts: &[i64], vertices: &[i64], surface: &Surface) -> Result<Self> {
        let n = surface.vertices.len() as i64;
        let rows_fit = starts.first() == Some(&0)
            && starts.last() == Some(&(vertices.len() as i64))
            && starts
                .windows(2)
                .all(|w| w[1].checked_sub(w[0]).is_some_and(|count| count >= 3));
        if !rows_fit || vertices.iter().any(|&v| v < 0 || v >= n) {
            return Err(Error::BadArgument {
                what: format!(
                    "the faces' rows should cover {} corners, three or more each, of {n} vertices",
                    vertices.len()
                ),
            });
        }
        Ok(Self {
            starts: starts.iter().map(|&s| s as u32).collect(),
            vertices: vertices.iter().map(|&v| v as u32).collect(),
        })
    }

    /// Number of faces.
    #[must_use]
    pub fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// Whether there is no face.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Vertices of one face.
    #[must_use]
    pub fn row(&self, face: usize) -> &[u32] {
        &self.vertices[self.starts[face] as usize..self.starts[face + 1] as usize]
    }
}

/// Values at the corners of the source's triangles, `channels` numbers each.
#[derive(Debug)]
pub struct CornerValues<'a> {
    /// `(m, 3, channels)`.
    pub values: &'a [f64],
    /// Numbers a corner.
    pub channels: usize,
    /// Differences up to this are rounding.
    pub tolerance: f64,
}

impl CornerValues<'_> {
    fn at(&self, triangle: u32, corner: usize) -> &[f64] {
        let begin = (triangle as usize * 3 + corner) * self.channels;
        &self.values[begin..begin + self.channels]
    }

    fn same(&self, a: &[f64], b: &[f64]) -> bool {
        a.iter()
            .zip(b)
            .all(|(x, y)| (x - y).abs() <= self.tolerance)
    }

    /// Weighted sum over the corners of a triangle.
    fn blend(&self, point: &SurfacePoint) -> Vec<f64> {
        (0..self.channels)
            .map(|c| {
                (0..3)
                    .map(|k| point.weights[k] * self.at(point.face, k)[c])
                    .sum()
            })
            .collect()
    }

    /// For each triangle and edge, whether the surface goes on across it without a border.
    ///
    /// # Panics
    /// Never: triangles across an edge share its vertices.
    #[must_use]
    pub fn open(&self, surface: &Surface) -> Vec<[bool; 3]> {
        (0..surface.triangles.len() as u32)
            .into_par_iter()
            .map(|t| {
                let corners = surface.triangles[t as usize];
                [0, 1, 2].map(|k| {
                    let s = surface.across[t as usize][k];
                    s != NONE
                        && [k, (k + 1) % 3].into_iter().all(|i| {
                            let j = surface.triangles[s as usize]
                                .iter()
                                .position(|&v| v == corners[i])
                                .expect("triangles across an edge share its vertices");
                            self.same(self.at(t, i), self.at(s, j))
                        })
                })
            })
            .collect()
    }
}

/// Number of the connected piece of each triangle, where `open` edges connect.
#[must_use]
pub fn islands(surface: &Surface, open: &[[bool; 3]]) -> Vec<u32> {
    let mut label = vec![NONE; surface.triangles.len()];
    let mut count = 0;
    for start in 0..label.len() {
        if label[start] != NONE {
            continue;
        }
        label[start] = count;
        let mut stack = vec![start];
        while let Some(t) = stack.pop() {
            for (&s, _) in surface.across[t]
                .iter()
                .zip(open[t])
                .filter(|(_, open)| *open)
            {
                if label[s as usize] == NONE {
                    label[s as usize] = count;
                    stack.push(s as usize);
                }
            }
        }
        count += 1;
    }
    label
}

/// The place on the source from which a target corner takes its value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CornerPlace {
    /// Triangle and weights; weights below zero reach beyond the triangle in its own plane.
    pub point: SurfacePoint,
    /// Whether the corner's own image lies on another side, so that this is not it.
    pub displaced: bool,
}

/// Finds the place of every target corner, all corners of a face on one side of every border.
///
/// With `extrapolate` a corner beyond a border continues the plane of the nearest triangle on its
/// face's side, as UVs do; without it the corner takes the nearest point there.
///
/// # Errors
/// [`Error::BadArgument`] when there are not three values for each source triangle.
pub fn corner_places(
    map: &SurfaceMap,
    faces: &Polygons,
    values: &CornerValues<'_>,
    extrapolate: bool,
) -> Result<Vec<CornerPlace>> {
    let rows = 3 * map.source.triangles.len();
    check_table("values", values.values.len(), rows, values.channels)?;
    let search = Search {
        map,
        values,
        extrapolate,
        open: values.open(&map.source),
        around: triangles_around(&map.source),
    };
    let places: Vec<Vec<CornerPlace>> = (0..faces.len())
        .into_par_iter()
        .map_init(Patch::default, |patch, f| search.face(faces.row(f), patch))
        .collect();
    Ok(places.into_iter().flatten().collect())
}

/// Moves every place to the nearest corner of its triangle, for values that cannot be mixed.
///
/// # Panics
/// Never: a triangle has three corners.
pub fn snap(places: &mut [CornerPlace]) {
    for place in places {
        let weights = place.point.weights;
        let strongest = (0..3)
            .max_by(|&a, &b| weights[a].total_cmp(&weights[b]).then(b.cmp(&a)))
            .expect("three corners");
        place.point.weights = [0, 1, 2].map(|k| f64::from(u8::from(k == strongest)));
    }
}

/// Values at the target's corners, `(corners, channels)`.
#[must_use]
pub fn corner_values(places: &[CornerPlace], values: &CornerValues<'_>) -> Vec<f64> {
    places
        .iter()
        .flat_map(|place| values.blend(&place.point))
        .collect()
}

/// Triangles around each vertex.
#[must_use]
pub fn triangles_around(surface: &Surface) -> Adjacency {
    Adjacency::from_lists(
        surface.vertices.len(),
        surface
            .triangles
            .iter()
            .enumerate()
            .flat_map(|(t, corners)| corners.map(|v| (v, t as u32))),
    )
}

/// The source's triangles around one target face that hang together without crossing a border.
#[derive(Default)]
struct Patch {
    triangles: Vec<u32>,
    members: std::collections::HashMap<u32, u32>,
    /// Whether there is a border among them.
    bordered: bool,
}

struct Search<'a> {
    map: &'a SurfaceMap,
    values: &'a CornerValues<'a>,
    extrapolate: bool,
    open: Vec<[bool; 3]>,
    around: Adjacency,
}

impl Search<'_> {
    fn face(&self, corners: &[u32], patch: &mut Patch) -> Vec<CornerPlace> {
        let images = self.map.images();
        let centre = corners.iter().fold([0.0; 3], |sum, &v| {
            vector::add(
                sum,
                vector::scaled(images[v as usize], 1.0 / corners.len() as f64),
            )
        });
        let radius = corners
            .iter()
            .map(|&v| vector::distance(images[v as usize], centre))
            .fold(0.0, f64::max);
        let normal = corners.iter().fold([0.0; 3], |sum, &v| {
            let own = self.map.source.cross(self.map.points[v as usize].face);
            vector::add(sum, vector::normalised(own))
        });
        // Samples in the middle and halfway to the corners vote for the side.
        let samples: Vec<SurfacePoint> = std::iter::once(centre)
            .chain(
                corners
                    .iter()
                    .map(|&v| vector::scaled(vector::add(centre, images[v as usize]), 0.5)),
            )
            .map(|p| facing_nearest(&self.map.source, p, normal))
            .collect();
        let mut best: Option<(usize, SurfacePoint)> = None;
        let mut tried: Vec<u32> = Vec::new();
        for sample in &samples {
            if tried.contains(&sample.face) {
                continue;
            }
            self.gather(*sample, centre, radius, patch);
            let reached = samples
                .iter()
                .filter(|s| patch.members.contains_key(&s.face))
                .inspect(|s| tried.push(s.face))
                .count();
            if best.is_none_or(|(most, _)| reached > most) {
                best = Some((reached, *sample));
            }
            if 2 * reached >= samples.len() {
                break;
            }
        }
        let (_, mut seed) = best.expect("there is a sample at the centre");
        if patch.triangles.first() != Some(&seed.face) {
            self.gather(seed, centre, radius, patch);
        }
        if self.extrapolate && patch.bordered {
            seed = self.middle(seed, corners, patch);
        }
        corners
            .iter()
            .map(|&v| self.corner(v, &seed, patch))
            .collect()
    }

    /// The seed or a corner's place in the patch, whichever foretells most corners.
    ///
    /// Where a face cuts through a thin limb, the place nearest to its centre may lie behind all
    /// of its corners.
    fn middle(&self, seed: SurfacePoint, corners: &[u32], patch: &Patch) -> SurfacePoint {
        let own: Vec<SurfacePoint> = corners
            .iter()
            .filter_map(|&v| self.own_side(&self.map.points[v as usize], patch))
            .collect();
        let foretells = |a: &SurfacePoint| own.iter().filter(|b| self.foretold(a, b)).count();
        let mut best = (foretells(&seed), seed);
        for place in &own {
            if best.0 == corners.len() {
                break;
            }
            let count = foretells(place);
            if count > best.0 {
                best = (count, *place);
            }
        }
        best.1
    }

    /// Collects the triangles within reach of `centre` that hang together with the seed's.
    fn gather(&self, seed: SurfacePoint, centre: Point, radius: f64, patch: &mut Patch) {
        let reach = (radius * CORNERS.reach).powi(2);
        let source = &self.map.source;
        patch.triangles.clear();
        patch.members.clear();
        patch.bordered = false;
        patch.triangles.push(seed.face);
        patch.members.insert(seed.face, 0);
        let mut next = 0;
        while next < patch.triangles.len() && patch.triangles.len() < CORNERS.most_triangles {
            let t = patch.triangles[next] as usize;
            next += 1;
            for k in 0..3 {
                let s = source.across[t][k];
                if s == NONE || patch.members.contains_key(&s) {
                    continue;
                }
                if !self.open[t][k] {
                    patch.bordered = true;
                    continue;
                }
                if source.to_triangle(centre, s).0 <= reach {
                    patch.members.insert(s, patch.triangles.len() as u32);
                    patch.triangles.push(s);
                }
            }
        }
    }

    fn corner(&self, vertex: u32, seed: &SurfacePoint, patch: &Patch) -> CornerPlace {
        let point = self.map.points[vertex as usize];
        if let Some(own) = self.own_side(&point, patch)
            && (!patch.bordered || !self.extrapolate || self.foretold(seed, &own))
        {
            return CornerPlace {
                point: own,
                displaced: false,
            };
        }
        CornerPlace {
            point: self.continued(self.map.images()[vertex as usize], seed, patch),
            displaced: true,
        }
    }

    /// The same point in the patch's triangle that is nearest to the seed, when there is one.
    fn own_side(&self, point: &SurfacePoint, patch: &Patch) -> Option<SurfacePoint> {
        let source = &self.map.source;
        let corners = source.triangles[point.face as usize];
        let touched: Vec<usize> = (0..3).filter(|&k| point.weights[k] > ON_EDGE).collect();
        if touched.len() == 3 {
            return patch.members.contains_key(&point.face).then_some(*point);
        }
        let first = corners[*touched.first()?];
        let holding = self.around.row(first as usize).iter().filter(|&&t| {
            touched
                .iter()
                .all(|&k| source.triangles[t as usize].contains(&corners[k]))
        });
        let (_, &face) = holding
            .filter_map(|t| patch.members.get(t).map(|depth| (depth, t)))
            .min()?;
        let mut weights = [0.0; 3];
        for &k in &touched {
            let at = source.triangles[face as usize]
                .iter()
                .position(|&v| v == corners[k])
                .expect("chosen because it holds this vertex");
            weights[at] = point.weights[k];
        }
        let total: f64 = weights.iter().sum();
        Some(SurfacePoint {
            face,
            weights: weights.map(|w| w / total),
        })
    }

    /// Whether the values at two places foretell each other.
    fn foretold(&self, a: &SurfacePoint, b: &SurfacePoint) -> bool {
        let source = &self.map.source;
        let (at_a, at_b) = (self.values.blend(a), self.values.blend(b));
        let (place_a, place_b) = (source.position(a), source.position(b));
        let miss = |from: &SurfacePoint, to: Point, expected: &[f64]| {
            let there = self.values.blend(&SurfacePoint {
                face: from.face,
                weights: plane_weights(source, from.face, to),
            });
            difference(&there, expected)
        };
        let scale = self.scale(a.face).max(self.scale(b.face));
        let room = CORNERS.largest_miss * scale * vector::distance(place_a, place_b)
            + self.values.tolerance;
        miss(a, place_b, &at_b).max(miss(b, place_a, &at_a)) <= room
    }

    /// Change of the values along the edge where it is fastest, a unit of length.
    fn scale(&self, triangle: u32) -> f64 {
        let corners = self.map.source.corners(triangle);
        (0..3)
            .map(|k| {
                let next = (k + 1) % 3;
                let length = vector::distance(corners[k], corners[next]);
                let change =
                    difference(self.values.at(triangle, k), self.values.at(triangle, next));
                if length > 0.0 { change / length } else { 0.0 }
            })
            .fold(0.0, f64::max)
    }

    /// The nearest place to `goal` on the seed's side, continued in its triangle's plane where wanted.
    ///
    /// A patch that reaches around a limb has both sides of a border: places whose values the
    /// seed does not foretell lie on the other one.
    fn continued(&self, goal: Point, seed: &SurfacePoint, patch: &Patch) -> SurfacePoint {
        let source = &self.map.source;
        let usable = |t: u32| {
            let longest = source.longest_edge(t);
            vector::norm(source.cross(t)) > 2.0 * CORNERS.sliver * longest * longest
        };
        let mut places: Vec<(f64, SurfacePoint)> = patch
            .triangles
            .iter()
            .map(|&face| {
                let (distance, weights) = source.to_triangle(goal, face);
                (distance, SurfacePoint { face, weights })
            })
            .collect();
        places.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut here = places
            .into_iter()
            .map(|(_, place)| place)
            .filter(|place| !self.extrapolate || !patch.bordered || self.foretold(seed, place));
        let nearest = here.next().unwrap_or(*seed);
        if !self.extrapolate {
            return nearest;
        }
        let widest = std::iter::once(nearest)
            .chain(here)
            .find(|place| usable(place.face));
        widest.map_or(nearest, |place| SurfacePoint {
            face: place.face,
            weights: plane_weights(source, place.face, goal),
        })
    }
}

/// Nearest point among the triangles that face the same way; of all when there is none.
#[must_use]
pub fn facing_nearest(surface: &Surface, query: Point, normal: Point) -> SurfacePoint {
    surface
        .nearest_where(query, None, |t| vector::dot(surface.cross(t), normal) > 0.0)
        .unwrap_or_else(|| surface.nearest(query))
}

/// Barycentric weights of a point's projection onto a triangle's plane, also outside of it.
#[must_use]
pub fn plane_weights(surface: &Surface, triangle: u32, point: Point) -> [f64; 3] {
    let [a, b, c] = surface.corners(triangle);
    let (u, v, d) = (vector::sub(b, a), vector::sub(c, a), vector::sub(point, a));
    let (uu, uv, vv) = (vector::dot(u, u), vector::dot(u, v), vector::dot(v, v));
    let (ud, vd) = (vector::dot(u, d), vector::dot(v, d));
    let area = uu * vv - uv * uv;
    if area <= f64::EPSILON * uu * vv {
        return [1.0, 0.0, 0.0];
    }
    let (s, t) = ((vv * ud - uv * vd) / area, (uu * vd - uv * ud) / area);
    [1.0 - s - t, s, t]
}

fn difference(a: &[f64], b: &[f64]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(x, y)| (x - y) * (x - y))
        .sum::<f64>()
        .sqrt()
}
