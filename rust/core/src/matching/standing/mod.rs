//! The map between two figures that stand alike: upright and at rest, facing one way.
//!
//! Where proportions differ, distances along the surface say little of what is a head and what a hand, but figures made to
//! be animated stand alike. With both on one ground, and of one height, the target is
//! [registered](crate::deformation::registration) onto the source. Where its samples come to lie gives a first map of
//! eigenfunctions, which is refined and judged as any other. Nothing is searched for it.

mod levels;

use rayon::prelude::*;

use crate::algebra::dense;
use crate::algebra::vector::{self, Point};
use crate::deformation::registration::{
    self, Held, Registered, Sampled, Settings, misfit, nearest_samples,
};
use crate::error::Result;
use crate::matching::problem::pair::Pair;
use crate::matching::problem::point_map::PointMaps;
use crate::matching::ranking::{self, Hypothesis, judging, quality};
use crate::matching::refinement::settings::UPSAMPLING;
use crate::matching::search::{SampledBases, fit, gram};
use crate::matching::settings::{LEVELS, STANDING};
use crate::shape::Shape;
use crate::watch::progress::{Check, Progress};

/// Which coordinate of a turned figure is which as given, and its sign.
type Turn = [(usize, f64); 3];

/// As given.
const UNTURNED: Turn = [(0, 1.0), (1, 1.0), (2, 1.0)];

/// All turns of the axes onto one another, the first as given.
fn turns() -> Vec<Turn> {
    let even = [[0, 1, 2], [1, 2, 0], [2, 0, 1]].map(|order| (order, 1.0));
    let odd = [[0, 2, 1], [2, 1, 0], [1, 0, 2]].map(|order| (order, -1.0));
    let signs = [1.0, -1.0].into_iter();
    let signs = signs.flat_map(|x| [1.0, -1.0].map(|y| (x, y)));
    (even.into_iter().chain(odd))
        .flat_map(|([a, b, c], parity)| {
            let turned = move |(x, y)| [(a, x), (b, y), (c, parity * x * y)];
            signs.clone().map(turned)
        })
        .collect()
}

/// How two figures may stand alike.
#[derive(Debug, Clone, Copy)]
struct Alignment {
    /// Of the target.
    turn: Turn,
    /// The axis that points up.
    up: usize,
    /// Height at which the legs of source and target join, where they have some.
    legs: [Option<f64>; 2],
    /// Mean distance between samples.
    misfit: f64,
}

impl Alignment {
    /// Whether figures rather stand like this than like another: they stand on legs.
    fn is_better(&self, other: &Self) -> bool {
        let on_legs = |alignment: &Self| alignment.legs.iter().flatten().count();
        let (own, others) = (on_legs(self), on_legs(other));
        own > others || (own == others && self.misfit < other.misfit)
    }
}

/// A figure of some height with its feet on the ground, its centroid above the origin.
#[derive(Debug)]
struct Figure {
    places: Vec<Point>,
    /// Outward.
    normals: Vec<Point>,
}

impl Figure {
    /// Turned, and standing along an axis.
    fn new(shape: &Shape, turn: Turn, up: usize, height: f64) -> Self {
        let (axis, sign) = turn[up];
        let [low, high] = levels::reach(&shape.mesh, axis).map(|end| sign * end);
        let (low, high) = (low.min(high), low.max(high));
        let turned = |p: &Point| turn.map(|(axis, sign)| sign * p[axis]);
        let place = |p: &Point| {
            let mut foot = turned(p);
            foot[up] -= low;
            vector::scaled(foot, height / (high - low))
        };
        let outward = |normal: &Point| vector::scaled(turned(normal), shape.volume_sign);
        Self {
            places: shape.mesh.vertices.iter().map(place).collect(),
            normals: shape.normals.iter().map(outward).collect(),
        }
    }

    fn sampled<'a>(&'a self, samples: &'a [u32]) -> Sampled<'a> {
        Sampled {
            places: &self.places,
            normals: &self.normals,
            samples,
        }
    }
}

/// How they may stand alike: as given first.
fn alignments(pair: &Pair<'_>) -> Vec<Alignment> {
    let [of_source, of_target] = [pair.source, pair.target].map(judging);
    let source_legs = [0, 1, 2].map(|up| levels::legs(&pair.source.mesh, up, 1.0));
    let target_legs =
        [1.0, -1.0].map(|sign| [0, 1, 2].map(|axis| levels::legs(&pair.target.mesh, axis, sign)));
    let best = |turn: Turn| {
        let along = |up: usize| {
            // As large as the source is, whichever axis points up.
            let [low, high] = levels::reach(&pair.source.mesh, up);
            let target = Figure::new(pair.target, turn, up, high - low);
            let source = Figure::new(pair.source, UNTURNED, up, high - low);
            let (here, there) = (target.sampled(of_target), source.sampled(of_source));
            let misfit = misfit(here, there, STANDING.normal);
            let (axis, sign) = turn[up];
            let legs = [source_legs[up], target_legs[usize::from(sign < 0.0)][axis]];
            Alignment {
                turn,
                up,
                legs,
                misfit,
            }
        };
        // Most figures stand along z.
        [1, 0].into_iter().map(along).fold(along(2), |best, other| {
            if other.is_better(&best) { other } else { best }
        })
    };
    if pair.constraints.same_axes {
        return vec![best(UNTURNED)];
    }
    let mut found: Vec<Alignment> = turns().into_par_iter().map(best).collect();
    let mut turned = found.split_off(1);
    turned.retain(|alignment| alignment.misfit < found[0].misfit);
    turned.sort_by(|a, b| a.misfit.total_cmp(&b.misfit));
    found.extend(turned.into_iter().take(STANDING.most_turned));
    found
}

/// Heights of legs and necks of the target, and those of the source to which they go, ascending.
fn common_levels(pair: &Pair<'_>, alignment: &Alignment) -> Vec<[f64; 2]> {
    let &Alignment { turn, up, legs, .. } = alignment;
    let mut found: Vec<[f64; 2]> = legs[0]
        .zip(legs[1])
        .map(|(s, t)| [t, s])
        .into_iter()
        .collect();
    let extent = |axis: usize| {
        let [low, high] = levels::reach(&pair.source.mesh, axis);
        high - low
    };
    let [a, b] = [(up + 1) % 3, (up + 2) % 3];
    let sideways = if extent(b) > extent(a) { b } else { a };
    let (axis, sign) = turn[up];
    let of_target = levels::neck(&pair.target.mesh, axis, sign, turn[sideways].0);
    let of_source = levels::neck(&pair.source.mesh, up, 1.0, sideways);
    if let Some((t, s)) = of_target.zip(of_source) {
        let is_above = found
            .last()
            .is_none_or(|[of_target, of_source]| t > *of_target && s > *of_source);
        if is_above {
            found.push([t, s]);
        }
    }
    found
}

/// The target registered onto the source, of both of which some samples take part, and the source's figure.
fn registered(
    pair: &Pair<'_>,
    alignment: &Alignment,
    [of_source, of_target]: [&[u32]; 2],
    check: Check<'_>,
) -> Result<(Registered, Figure)> {
    let up = alignment.up;
    let mut target = Figure::new(pair.target, alignment.turn, up, 1.0);
    let source = Figure::new(pair.source, UNTURNED, up, 1.0);
    let levels = common_levels(pair, alignment);
    if levels.iter().any(|[t, s]| (t - s).abs() > LEVELS.unlike) {
        levels::stretch(&mut target.places, up, &levels);
    }
    let held = Held {
        graph: pair.target.deformation_graph()?,
        faces: &pair.target.mesh.faces,
        volume_sign: pair.target.volume_sign,
    };
    let (moving, still) = (target.sampled(of_target), source.sampled(of_source));
    let settings = Settings {
        rounds: STANDING.rounds,
        pull: STANDING.pull,
        to_place: STANDING.to_place,
        normal: STANDING.normal,
        agreeing: STANDING.agreeing,
        both_ask: true,
        known: STANDING.known,
    };
    let landmarks = pair.constraints.landmarks.iter();
    let known: Vec<(u32, Point)> = landmarks
        .map(|l| (l.target.0, source.places[l.source.index()]))
        .collect();
    let registered = registration::registered(moving, held, still, &known, &settings, check)?;
    Ok((registered, source))
}

/// The map between figures that stand alike in this way; nothing where they do not.
fn aligned(pair: &Pair<'_>, alignment: &Alignment, check: Check<'_>) -> Result<Option<Hypothesis>> {
    let [of_source, of_target] =
        [pair.source, pair.target].map(|shape| shape.drawn_vertices(STANDING.samples));
    let samples = [of_source.as_slice(), &of_target];
    let (target, source) = registered(pair, alignment, samples, check)?;
    let [here, there] = [target.sampled(&of_target), source.sampled(&of_source)];
    if misfit(here, there, STANDING.normal) > STANDING.fits {
        return Ok(None);
    }
    check()?;
    let [on_source, on_target] = nearest_samples(
        target.sampled(&pair.target.farthest),
        source.sampled(&pair.source.farthest),
        STANDING.normal,
    );
    let size = UPSAMPLING
        .upsampled_size
        .min(pair.target.basis.values.len())
        .min(pair.source.basis.values.len());
    let [of_source, of_target] = [pair.source, pair.target].map(|shape| {
        let functions = shape.basis.functions.as_ref();
        dense::gather_rows(functions, &shape.farthest, size)
    });
    let source_gram = gram(of_source.as_ref());
    let bases = SampledBases {
        target: of_target.as_ref(),
        source: of_source.as_ref(),
        source_gram: source_gram.as_ref(),
    };
    let maps = PointMaps {
        target_to_source: on_source.as_slice(),
        source_to_target: &on_target,
    };
    let first = fit(bases, maps, pair.coverage, size)?;
    ranking::of_first_map(pair, first, check).map(Some)
}

/// The map between figures as they stand, as given or turned; nothing where they do not fit.
///
/// # Errors
/// [`crate::Error::NotFactorised`], [`crate::Error::Cancelled`].
pub fn hypothesis(pair: &Pair<'_>, progress: &Progress) -> Result<Option<Hypothesis>> {
    // Each would find it for itself.
    pair.target.deformation_graph()?;
    let found: Vec<Option<Hypothesis>> = alignments(pair)
        .par_iter()
        .map(|alignment| aligned(pair, alignment, &|| progress.check()))
        .collect::<Result<_>>()?;
    let mut found = found.into_iter();
    let as_given = found.next().flatten();
    let cost = |h: &Hypothesis| h.metrics.cost();
    let turned = found
        .flatten()
        .min_by(|a, b| cost(a).total_cmp(&cost(b)))
        .filter(|turned| {
            let as_given = as_given.as_ref().map_or(f64::INFINITY, cost);
            cost(turned) < STANDING.turned.min(STANDING.better_turned * as_given)
        });
    Ok(turned.or(as_given))
}

/// The map between figures as they stand and those of a search, best first, and whether nothing else need be searched for: where
/// it agrees with the best of the search, of which the worse is left out, or costs clearly less. Where distances do
/// [not tell](quality::incomparable) which point is which it is taken alone, whatever they say. A surface that was cut off may
/// be a part of the other: there it is enough only if it shows that they look alike. What the search found of mirrored maps holds
/// for it too.
#[must_use]
pub fn beside(
    pair: &Pair<'_>,
    mut map: Hypothesis,
    mut searched: Vec<Hypothesis>,
) -> (Vec<Hypothesis>, bool) {
    let source = pair.source;
    let may_be_part = [source, pair.target]
        .iter()
        .any(|shape| shape.mesh.is_open());
    let may_be_enough = !may_be_part || map.metrics.agreement > STANDING.looks_alike;
    let Some(best) = searched.first() else {
        return (vec![map], may_be_enough);
    };
    map.metrics.mirrored_gain = best.metrics.mirrored_gain;
    let (cost, least) = (map.metrics.cost(), best.metrics.cost());
    if source.mean_spectral_distance(map.judged_images(), best.judged_images()) <= STANDING.agree {
        if cost < least {
            searched[0] = map;
        }
        return (searched, true);
    }
    if !may_be_part && quality::incomparable(&best.metrics) {
        return (vec![map], true);
    }
    let is_enough = may_be_enough && cost < STANDING.clearly_less * least;
    (ranking::merged(source, searched, vec![map]), is_enough)
}

#[cfg(test)]
mod tests {
    use rayon::ThreadPoolBuilder;

    use super::*;
    use crate::matching::problem::constraints::Constraints;
    use crate::matching::problem::landmark::Landmark;
    use crate::matching::problem::pair::Coverage;
    use crate::mesh::numbering::WorkingVertex;
    use crate::testing::{AROUND, RINGS, pair, torus};

    /// The same vertices moved outward by so much, then by a map.
    fn changed(shape: &Shape, outward: f64, moved: impl Fn(Point) -> Point) -> Shape {
        let mesh = &shape.mesh;
        let vertices: Vec<Point> = (mesh.vertices.iter().zip(&shape.normals))
            .map(|(&p, &n)| {
                moved(vector::add(
                    p,
                    vector::scaled(n, outward * shape.volume_sign),
                ))
            })
            .collect();
        let faces: Vec<[i64; 3]> = mesh.faces.iter().map(|f| f.map(i64::from)).collect();
        Shape::new(&vertices, &faces, &Progress::default(), &|_, _| Ok(())).expect("a sound mesh")
    }

    fn larger([x, y, z]: Point) -> Point {
        [3.0 * x + 1.0, 3.0 * y, 3.0 * z - 2.0]
    }

    fn thicker_and_larger() -> [Shape; 2] {
        let source = changed(&torus(RINGS), 0.0, |p| p);
        let target = changed(&source, 0.04, larger);
        [source, target]
    }

    #[test]
    fn turns_are_rotations() {
        let all = turns();
        let rows = |turn: &Turn| {
            turn.map(|(axis, sign)| [0, 1, 2].map(|c| if c == axis { sign } else { 0.0 }))
        };
        for (i, turn) in all.iter().enumerate() {
            let [x, y, z] = rows(turn);
            assert_eq!(vector::dot(vector::cross(x, y), z), 1.0);
            assert!(all[..i].iter().all(|other| other != turn));
        }
        assert_eq!((all.len(), all[0]), (24, UNTURNED));
    }

    #[test]
    fn a_thicker_and_larger_figure_comes_to_lie_on_its_counterpart() {
        let [source, target] = thicker_and_larger();
        let constraints = Constraints::default();
        let pair = pair(&source, &target, Coverage::BOTH, &constraints);
        let as_given = alignments(&pair)[0];
        let samples = [&source, &target].map(|shape| shape.drawn_vertices(STANDING.samples));
        let samples = [samples[0].as_slice(), &samples[1]];
        let (registered, onto) =
            registered(&pair, &as_given, samples, &|| Ok(())).expect("regular");
        let off = |places: &[Point]| {
            let apart = places.iter().zip(&onto.places);
            apart.map(|(&p, &q)| vector::distance(p, q)).sum::<f64>() / places.len() as f64
        };
        let before = off(&Figure::new(&target, UNTURNED, as_given.up, 1.0).places);
        let after = off(&registered.places);
        assert!(after < 0.3 * before, "{after} of {before}");
    }

    /// A point a seventh of the way around from its counterpart.
    #[test]
    fn a_landmark_is_drawn_to_its_place() {
        let [source, target] = thicker_and_larger();
        let samples = [&source, &target].map(|shape| shape.drawn_vertices(STANDING.samples));
        let samples = [samples[0].as_slice(), &samples[1]];
        let [from, to] = [0, (RINGS / 7 * AROUND) as u32];
        let apart = |landmarks: Vec<Landmark<WorkingVertex>>| {
            let progress = Progress::default();
            let known = Constraints::new(&source, &target, landmarks, false, &progress);
            let known = known.expect("not cancelled");
            let pair = pair(&source, &target, Coverage::BOTH, &known);
            let as_given = alignments(&pair)[0];
            let found = registered(&pair, &as_given, samples, &|| Ok(()));
            let (registered, onto) = found.expect("regular");
            vector::distance(registered.places[from as usize], onto.places[to as usize])
        };
        let known = Landmark {
            source: WorkingVertex(to),
            target: WorkingVertex(from),
        };
        let (free, held) = (apart(Vec::new()), apart(vec![known]));
        assert!(held < 0.1 * free, "{held} of {free}");
    }

    /// However it was turned, each sample finds its counterpart.
    #[test]
    fn a_figure_is_found_as_given_and_turned() {
        let source = changed(&torus(RINGS), 0.0, |p| p);
        let tipped = |[x, y, z]: Point| [x, -z, y];
        let about_face = |[x, y, z]: Point| [-x, -y, z];
        for target in [
            changed(&source, 0.04, larger),
            changed(&source, 0.04, tipped),
            changed(&source, 0.04, about_face),
        ] {
            let constraints = Constraints::default();
            let pair = pair(&source, &target, Coverage::BOTH, &constraints);
            let found = hypothesis(&pair, &Progress::default()).expect("regular");
            let found = found.expect("they stand alike");
            let images = found.judged_images();
            let apart = source.mean_spectral_distance(images, &target.farthest[..images.len()]);
            // Of 500 samples on a unit area neighbours lie 1/√500 apart.
            assert!(apart < 1.5 / 500f64.sqrt(), "{apart}");
        }
    }

    #[test]
    fn threads_change_nothing() {
        let [source, target] = thicker_and_larger();
        let constraints = Constraints::default();
        let pair = pair(&source, &target, Coverage::BOTH, &constraints);
        let [one, three] = [1, 3].map(|threads| {
            let pool = ThreadPoolBuilder::new().num_threads(threads).build();
            let found = pool
                .expect("threads")
                .install(|| hypothesis(&pair, &Progress::default()));
            found.expect("regular").expect("they stand alike")
        });
        assert_eq!(one.matrix, three.matrix);
        assert_eq!(one.images, three.images);
    }
}
