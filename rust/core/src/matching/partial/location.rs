//! Where a part lies on a whole, by its shape in space alone.
//!
//! A head, a hand, a foot or a face keeps its shape in every pose, whatever is cut away around it, and of so small a part
//! neither eigenfunctions nor distances between far samples tell where on a body it belongs. Two points with their normals
//! make a feature that no motion changes: how far they are apart, and the angles between the normals and the line between
//! them. Pairs of the part that begin at one sample vote for where on the whole that sample lies and how it is turned about
//! its normal there. The placements with most votes are moved onto the surface, and those that fit best are drawn onto it by
//! maps that are affine on each part, since no two bodies have one head.
//!
//! # Source
//! Drost, Ulrich, Navab, Ilic, "Model globally, match locally: efficient and robust 3D object recognition", 2010, for the
//! features and the vote; Chen, Medioni, "Object modelling by registration of multiple range images", 1992, for the motion.
//! What is sought is a part on a surface here, instead of a whole in a scene.

use std::f64::consts::{FRAC_1_SQRT_2, TAU};
use std::sync::Arc;

use rayon::prelude::*;

use crate::algebra::oriented_tree::{self, OrientedTree, squared_distance};
use crate::algebra::similarity::Similarity;
use crate::algebra::vector::{self, Point};
use crate::deformation::registration::{self, Held, Sampled};
use crate::error::Result;
use crate::matching::partial::settings::LOCATION;
use crate::matching::problem::pair::{Coverage, Pair};
use crate::matching::problem::point_map::PointMaps;
use crate::matching::problem::which::Which;
use crate::matching::ranking::Metrics;
use crate::matching::refinement::coinciding::Placed;
use crate::watch::progress::Check;

/// Cosines of 15°, 30°, … 165°: between them angles count alike.
const ANGLES: [f64; 11] = [
    0.965_925_826,
    0.866_025_404,
    FRAC_1_SQRT_2,
    0.5,
    0.258_819_045,
    0.0,
    -0.258_819_045,
    -0.5,
    -FRAC_1_SQRT_2,
    -0.866_025_404,
    -0.965_925_826,
];
/// A part placed on a whole.
#[derive(Debug, Clone)]
pub(in crate::matching) struct Location {
    /// Where it lies.
    pub placed: Arc<Placed>,
    /// Mean distance of its samples from the whole in positions and normals before it was drawn onto it, √area of the part.
    pub misfit: f64,
    /// Mean cosine between the normals of its samples and of their images.
    pub facing: f64,
    /// Mean change of straight distances between its samples that are near one another, √area of the part.
    pub stretch: f64,
}

impl Location {
    /// Metrics of its map, by what the part's shape says: its curvatures and those of the whole are smoothed over other lengths.
    pub fn metrics(&self, of_map: Metrics) -> Metrics {
        let agreement = 1.0 - self.misfit / LOCATION.misplaced;
        Metrics {
            orientation: self.facing,
            local_distortion: self.stretch,
            agreement,
            extrinsic_agreement: agreement,
            ..of_map
        }
    }
}

/// Points with outward unit normals.
#[derive(Debug)]
struct Facing {
    places: Vec<Point>,
    normals: Vec<Point>,
}

/// Where a part lies on the whole, the best places first, the lengths of both being given in one unit.
///
/// # Errors
/// [`crate::Error::NotFactorised`], [`crate::Error::Cancelled`].
pub(in crate::matching) fn locations(
    pair: &Pair<'_>,
    part_is: Which,
    check: Check<'_>,
) -> Result<Vec<Location>> {
    let (part, whole) = (pair.shape(part_is), pair.shape(part_is.other()));
    // All in the part's own frame, where its area is 1. Surfaces of one kind are wound alike.
    let outward = whole.volume_sign;
    let own = Facing::new(part.mesh.vertices.clone(), &part.normals, outward);
    let given = whole.mesh.vertices.iter();
    let there = given
        .map(|&p| part.mesh.as_own(whole.mesh.as_given(p)))
        .collect();
    let there = Facing::new(there, &whole.normals, outward);
    let samples = part.farthest_points(LOCATION.part_samples);
    let (asking, answering) = (
        own.gathered(samples),
        there.gathered(&whole.drawn_vertices(LOCATION.whole_samples)),
    );
    let mut found = voted(&asking, &answering, check)?;
    found.truncate(LOCATION.kept);
    let coarse = Answering::new(&answering);
    let mut found = moved(&asking, &coarse, &found, LOCATION.first_steps, check)?;
    different(&asking, &mut found);
    found.truncate(LOCATION.finished);
    let all = Answering::new(&there);
    let motions: Vec<Similarity> = found.into_iter().map(|(_, motion)| motion).collect();
    let mut found = moved(&asking, &all, &motions, LOCATION.last_steps, check)?;
    different(&asking, &mut found);
    found.truncate(LOCATION.drawn);
    // Each would find it for itself.
    part.deformation_graph()?;
    found
        .par_iter()
        .map(|&(misfit, motion)| {
            let moved = own.moved(&motion);
            drawn(pair, part_is, &moved, &all, outward, misfit, check)
        })
        .collect()
}

/// A moved part drawn onto the whole.
fn drawn(
    pair: &Pair<'_>,
    part_is: Which,
    moved: &Facing,
    answering: &Answering<'_>,
    outward: f64,
    misfit: f64,
    check: Check<'_>,
) -> Result<Location> {
    let (part, whole) = (pair.shape(part_is), pair.shape(part_is.other()));
    let there = answering.points;
    let all: Vec<u32> = (0..there.places.len() as u32).collect();
    let moving = Sampled {
        places: &moved.places,
        normals: &moved.normals,
        samples: &part.drawn_vertices(LOCATION.drawn_by),
    };
    let held = Held {
        graph: part.deformation_graph()?,
        faces: &part.mesh.faces,
        volume_sign: outward,
    };
    let still = Sampled {
        places: &there.places,
        normals: &there.normals,
        samples: &all,
    };
    let settings = registration::Settings {
        rounds: LOCATION.rounds,
        pull: LOCATION.pull,
        to_place: LOCATION.to_place,
        normal: LOCATION.normal,
        agreeing: LOCATION.agreeing,
        both_ask: false,
        known: 0.0,
    };
    let drawn = registration::registered(moving, held, still, &[], &settings, check)?;
    let drawn = Facing {
        places: drawn.places,
        normals: drawn.normals,
    };
    let images = answering.nearest(&drawn);
    let samples = part.farthest_points(LOCATION.part_samples);
    let on_whole = |v: u32| images[v as usize] as usize;
    let cosines = samples
        .iter()
        .map(|&v| vector::dot(drawn.normals[v as usize], there.normals[on_whole(v)]));
    let facing = cosines.sum::<f64>() / samples.len() as f64;
    let on_part = |v: u32| part.mesh.vertices[v as usize];
    let stretch = mean_stretch(samples, &on_part, &|v| there.places[on_whole(v)]);
    check()?;
    let back = Answering::new(&drawn).nearest(there);
    let placed = drawn.places.iter();
    let places = placed
        .map(|&p| whole.mesh.as_own(part.mesh.as_given(p)))
        .collect();
    let placed = Arc::new(Placed {
        moving: part_is,
        places,
        images: match part_is {
            Which::Target => PointMaps {
                target_to_source: images,
                source_to_target: back,
            },
            Which::Source => PointMaps {
                target_to_source: back,
                source_to_target: images,
            },
        },
        coverage: Coverage::of_part(part_is),
    });
    Ok(Location {
        placed,
        misfit,
        facing,
        stretch,
    })
}

/// Mean change of the straight distances between points that are near (`LOCATION.near`) one another at first.
fn mean_stretch(points: &[u32], first: &dyn Fn(u32) -> Point, then: &dyn Fn(u32) -> Point) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for (i, &a) in points.iter().enumerate() {
        for &b in &points[..i] {
            let before = vector::distance(first(a), first(b));
            if before < LOCATION.near {
                sum += (vector::distance(then(a), then(b)) - before).abs();
                count += 1.0;
            }
        }
    }
    sum / f64::max(count, 1.0)
}

impl Facing {
    fn new(places: Vec<Point>, normals: &[Point], outward: f64) -> Self {
        let normals = normals.iter().map(|&n| vector::scaled(n, outward));
        Self {
            places,
            normals: normals.collect(),
        }
    }

    fn oriented(&self, i: usize) -> oriented_tree::Oriented {
        oriented_tree::oriented(self.places[i], self.normals[i])
    }

    fn gathered(&self, vertices: &[u32]) -> Self {
        let of = |list: &[Point]| vertices.iter().map(|&v| list[v as usize]).collect();
        Self {
            places: of(&self.places),
            normals: of(&self.normals),
        }
    }

    fn moved(&self, motion: &Similarity) -> Self {
        let place = |&p: &Point| motion.apply(p);
        let normal = |&n: &Point| vector::by_rows(&motion.turn, n);
        Self {
            places: self.places.iter().map(place).collect(),
            normals: self.normals.iter().map(normal).collect(),
        }
    }
}

/// Points that are asked for the nearest in positions and normals.
struct Answering<'a> {
    points: &'a Facing,
    tree: OrientedTree,
}

impl<'a> Answering<'a> {
    fn new(points: &'a Facing) -> Self {
        let oriented: Vec<_> = (0..points.places.len())
            .map(|i| points.oriented(i))
            .collect();
        Self {
            points,
            tree: OrientedTree::new(&oriented, LOCATION.normal),
        }
    }

    fn nearest(&self, asking: &Facing) -> Vec<u32> {
        let image = |i| {
            let nothing = (f64::INFINITY, 0);
            self.tree.nearest(
                &asking.oriented(i),
                LOCATION.normal * LOCATION.normal,
                nothing,
            )
        };
        (0..asking.places.len())
            .into_par_iter()
            .map(image)
            .collect()
    }

    /// Distance in positions and normals.
    fn off(&self, asking: &Facing, i: usize, image: u32) -> f64 {
        let there = self.points.oriented(image as usize);
        squared_distance(
            &asking.oriented(i),
            &there,
            LOCATION.normal * LOCATION.normal,
        )
        .sqrt()
    }
}

/// Mean distance of some points from their images, far ones alike.
fn mean_misfit(asking: &Facing, there: &Answering<'_>, images: &[u32], points: &[u32]) -> f64 {
    let off = |&v: &u32| {
        there
            .off(asking, v as usize, images[v as usize])
            .min(LOCATION.far)
    };
    points.iter().map(off).sum::<f64>() / points.len() as f64
}

/// The motions after some steps towards the nearest points, with their misfits, the least first.
fn moved(
    part: &Facing,
    there: &Answering<'_>,
    motions: &[Similarity],
    steps: usize,
    check: Check<'_>,
) -> Result<Vec<(f64, Similarity)>> {
    let all: Vec<u32> = (0..part.places.len() as u32).collect();
    let settled = |motion: &Similarity| {
        check()?;
        let mut motion = *motion;
        for _ in 0..steps {
            let now = part.moved(&motion);
            let images = there.nearest(&now);
            let pairs: Vec<(Point, Point, f64)> = (0..part.places.len())
                .map(|i| {
                    let off = there.off(&now, i, images[i]) / LOCATION.tolerance;
                    let weight = (1.0 + off * off).powi(-2);
                    let image = there.points.places[images[i] as usize];
                    (part.places[i], image, weight)
                })
                .collect();
            motion = Similarity {
                scale: 1.0,
                ..Similarity::fitted(&pairs, false)
            };
        }
        let now = part.moved(&motion);
        let images = there.nearest(&now);
        Ok((mean_misfit(&now, there, &images, &all), motion))
    };
    let mut found: Vec<(f64, Similarity)> =
        motions.par_iter().map(settled).collect::<Result<_>>()?;
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    Ok(found)
}

/// Leaves of motions that bring samples to about the same places the first.
fn different(part: &Facing, motions: &mut Vec<(f64, Similarity)>) {
    let mut kept: Vec<Facing> = Vec::new();
    motions.retain(|(_, motion)| {
        let now = part.moved(motion);
        let differs = |other: &Facing| {
            let apart = now.places.iter().zip(&other.places);
            let sum: f64 = apart.map(|(&a, &b)| vector::distance(a, b)).sum();
            sum > LOCATION.same * part.places.len() as f64
        };
        let is_new = kept.iter().all(differs);
        if is_new {
            kept.push(now);
        }
        is_new
    });
}

/// A pair of points: its feature, the point at which it begins, and how its line is turned about the normal there.
type Feature = (u32, u16, f64);

/// Motions by the votes of pairs, most votes first.
fn voted(part: &Facing, whole: &Facing, check: Check<'_>) -> Result<Vec<Similarity>> {
    let extent = vector::extent(&part.places);
    let frames: Vec<[Point; 3]> = whole.normals.iter().map(|&n| along_normal(n)).collect();
    let mut pairs: Vec<Feature> = (0..whole.places.len())
        .into_par_iter()
        .flat_map_iter(|i| {
            let frame = frames[i];
            features_from(whole, i, frame, extent)
                .map(move |(feature, turn)| (feature, i as u16, turn))
        })
        .collect();
    pairs.par_sort_unstable_by(|a, b| {
        (a.0, a.1)
            .cmp(&(b.0, b.1))
            .then_with(|| a.2.total_cmp(&b.2))
    });
    check()?;
    let references = LOCATION.references.min(part.places.len());
    let mut found: Vec<(f64, Similarity)> = (0..references)
        .into_par_iter()
        .flat_map_iter(|reference| {
            let frame = along_normal(part.normals[reference]);
            let mut votes = vec![0.0; whole.places.len() * LOCATION.turns];
            for (feature, turn) in features_from(part, reference, frame, extent) {
                let from = pairs.partition_point(|pair| pair.0 < feature);
                let alike = pairs[from..].iter().take_while(|pair| pair.0 == feature);
                let count = alike.clone().count() as f64;
                for &(_, there, turned) in alike {
                    let by = (turned - turn).rem_euclid(TAU) / TAU;
                    let step = ((by * LOCATION.turns as f64) as usize).min(LOCATION.turns - 1);
                    votes[usize::from(there) * LOCATION.turns + step] +=
                        1.0 / (1.0 + count / LOCATION.common);
                }
            }
            let mut most: Vec<usize> = (0..votes.len()).collect();
            most.select_nth_unstable_by(LOCATION.kept_of_each, |&a, &b| {
                votes[b].total_cmp(&votes[a]).then(a.cmp(&b))
            });
            most.truncate(LOCATION.kept_of_each);
            let placed = |cell: usize| {
                let (there, step) = (cell / LOCATION.turns, cell % LOCATION.turns);
                let by = (step as f64 + 0.5) / LOCATION.turns as f64 * TAU;
                let motion = Similarity {
                    from: part.places[reference],
                    to: whole.places[there],
                    turn: brought(frame, frames[there], by),
                    scale: 1.0,
                };
                (votes[cell], motion)
            };
            most.into_iter().map(placed).collect::<Vec<_>>()
        })
        .collect();
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    Ok(found.into_iter().map(|(_, motion)| motion).collect())
}

/// The rotation that brings one frame onto another that is turned about its first axis: rows.
fn brought(from: [Point; 3], to: [Point; 3], by: f64) -> [Point; 3] {
    let (sine, cosine) = by.sin_cos();
    let [first, second, third] = to;
    let turned = |s: f64, t: f64| vector::add(vector::scaled(second, s), vector::scaled(third, t));
    let onto = [first, turned(cosine, sine), turned(-sine, cosine)];
    [0, 1, 2].map(|row| vector::by_columns(&from, onto.map(|axis| axis[row])))
}

/// An orthonormal frame whose first axis is a normal: rows.
fn along_normal(normal: Point) -> [Point; 3] {
    let least = (0..3)
        .min_by(|&a, &b| normal[a].abs().total_cmp(&normal[b].abs()))
        .unwrap_or(0);
    let mut axis = [0.0; 3];
    axis[least] = 1.0;
    let second = vector::normalised(vector::cross(normal, axis));
    [normal, second, vector::cross(normal, second)]
}

/// Features of the pairs of a point with all others up to the part's extent, by numbers, and how each line is turned about the normal
/// in a frame along it.
fn features_from(
    points: &Facing,
    from: usize,
    frame: [Point; 3],
    extent: f64,
) -> impl Iterator<Item = (u32, f64)> + '_ {
    let (place, normal) = (points.places[from], points.normals[from]);
    (0..points.places.len()).filter_map(move |to| {
        let line = vector::sub(points.places[to], place);
        let length = vector::norm(line);
        if to == from || length > extent || length <= 0.0 {
            return None;
        }
        let direction = vector::scaled(line, 1.0 / length);
        let other = points.normals[to];
        let angles = [
            vector::dot(normal, direction),
            vector::dot(other, direction),
            vector::dot(normal, other),
        ];
        let step = (LOCATION.distance_steps * length / extent) as u32;
        let feature = angles.iter().fold(step, |feature, &cosine| {
            let angle = ANGLES.iter().filter(|&&least| cosine < least).count();
            feature * (ANGLES.len() as u32 + 1) + angle as u32
        });
        let [_, y, z] = vector::by_rows(&frame, line);
        Some((feature, z.atan2(y)))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::matching::problem::constraints::Constraints;
    use crate::shape::Shape;
    use crate::testing::{self, RINGS, torus, torus_mesh};
    use crate::watch::progress::Progress;

    /// A quarter of a turn about z, another about x, and a shift.
    fn moved([x, y, z]: Point) -> Point {
        [-y + 5.0, -z, x - 2.0]
    }

    fn moved_back([x, y, z]: Point) -> Point {
        [z + 2.0, 5.0 - x, -y]
    }

    #[test]
    fn a_piece_that_was_moved_is_found_where_it_was_cut() {
        let whole = torus(RINGS);
        let (vertices, faces) = torus_mesh(RINGS / 3, &[], 0.0);
        let vertices: Vec<Point> = vertices.into_iter().map(moved).collect();
        let piece = Shape::new(&vertices, &faces, &Progress::default(), &|_, _| Ok(()))
            .expect("a sound mesh");
        let constraints = Constraints::default();
        let found = [
            (
                Which::Target,
                testing::pair(&whole, &piece, Coverage::BOTH, &constraints),
            ),
            (
                Which::Source,
                testing::pair(&piece, &whole, Coverage::BOTH, &constraints),
            ),
        ]
        .map(|(part_is, pair)| {
            let found = locations(&pair, part_is, &|| Ok(())).expect("a graph of parts");
            found.into_iter().next().expect("it has samples")
        });
        for location in &found {
            // Samples of both meshes are other ones, within an edge of each other.
            assert!(location.misfit < 0.05, "{}", location.misfit);
            assert!(location.facing > 0.99, "{}", location.facing);
            for (v, &place) in location.placed.places.iter().enumerate() {
                let given = moved_back(piece.mesh.as_given(piece.mesh.vertices[v]));
                let off = vector::distance(place, whole.mesh.as_own(given));
                assert!(off < 0.03, "vertex {v} is {off} off");
            }
        }
        assert_eq!(found[0].placed.places, found[1].placed.places);
        assert_eq!(
            found[0].placed.images.target_to_source,
            found[1].placed.images.source_to_target
        );
    }

    #[test]
    fn a_frame_is_brought_onto_a_turned_one() {
        let (from, to) = (
            along_normal([0.6, 0.0, 0.8]),
            along_normal([0.0, -1.0, 0.0]),
        );
        let by = 0.7_f64;
        let motion = brought(from, to, by);
        let off = |a: Point, b: Point| vector::distance(a, b);
        assert!(off(vector::by_rows(&motion, from[0]), to[0]) < 1e-12);
        let second = vector::add(
            vector::scaled(to[1], by.cos()),
            vector::scaled(to[2], by.sin()),
        );
        assert!(off(vector::by_rows(&motion, from[1]), second) < 1e-12);
    }
}
