//! Poses of a rig taken to the rig that was fitted to another body.
//!
//! In the world, a bone of the source is turned by `P₁` and its partner shall be turned by `P₂ = G P₁ S N`: `G` turns
//! the source's body to the target's ([`facing`]), `S` mirrors a bone's own x axis where `G` mirrors, and the constant
//! `N` takes the direction of the limb in the target's bone to that in the source's. What a pose tells is the turn `B`
//! of a bone from its place at rest, `P = P_parent R B`. So
//!
//! `B₂ = L (S B₁ S) N`, `L = R₂⁻¹ F⁻¹ S R₁ S`,
//!
//! where the parent of the target's bone is turned by `G P₁ S F`: `F` is the parent's `N` if its turn is fitted too
//! ([`fitted_turns`]).

use crate::algebra::similarity::{Similarity, nearest_turn};
use crate::algebra::vector::{self, Point};
use crate::error::{Error, Result};
use crate::transfer::frame::{Affine, Matrix, determinant, polar, product, transposed, unity};
use crate::transfer::outfit::bone_map::descendants;
use crate::transfer::settings::{BONES, POSES};
use crate::transfer::surface_map::check_rows;

/// Two directions whose sum is shorter than this, for 1 of each, are opposite but for roundings of single precision.
const OPPOSITE: f64 = 1e-7;

/// Of places so near to one another, as a share of their largest coordinate, nothing tells how they are turned.
const ONE_PLACE: f64 = 1e-12;

/// The similarity, without mirroring, that brings `points` nearest to `aims` in the sense of least squares.
///
/// Both are `(n)`, of any units; points count by `weights`, `(n)`, alike without any or where all are zero. A shift
/// alone is left where the points that count, or their aims, are all at one place.
///
/// # Errors
/// [`Error::BadArgument`] when there are no points, not as many aims and weights as points, or a weight is negative.
///
/// # Source
/// Umeyama, "Least-squares estimation of transformation parameters between two point patterns", 1991.
pub fn similarity(points: &[Point], aims: &[Point], weights: Option<&[f64]>) -> Result<Affine> {
    check_rows("aims", aims.len(), points.len())?;
    let weights = weights.unwrap_or_default();
    if !weights.is_empty() {
        check_rows("weights", weights.len(), points.len())?;
    }
    if points.is_empty() {
        return Err(Error::BadArgument {
            what: "`points` should have at least one row, got 0".into(),
        });
    }
    if weights.iter().any(|&weight| weight < 0.0) {
        return Err(Error::BadArgument {
            what: "`weights` should be 0 or more".into(),
        });
    }
    let alike = weights.iter().all(|&weight| weight == 0.0);
    let pairs: Vec<(Point, Point, f64)> = (points.iter().zip(aims).enumerate())
        .map(|(i, (&p, &q))| (p, q, if alike { 1.0 } else { weights[i] }))
        .filter(|&(_, _, weight)| weight > 0.0)
        .collect();
    let found = Similarity::onto(&pairs, false);
    if at_one_place(pairs.iter().map(|pair| pair.0))
        || at_one_place(pairs.iter().map(|pair| pair.1))
    {
        return Ok(Affine {
            linear: unity(),
            shift: vector::sub(found.to, found.from),
        });
    }
    Ok(found.into())
}

fn at_one_place(places: impl Iterator<Item = Point>) -> bool {
    let ends = vector::bounds(places);
    let [low, high] = ends;
    let far = ends
        .as_flattened()
        .iter()
        .fold(0.0, |far: f64, x| far.max(x.abs()));
    vector::sub(high, low)
        .into_iter()
        .all(|side| side <= ONE_PLACE * far)
}

/// What turns the source's body at rest to the target's, rows of a matrix: a mirroring one if `mirrors`.
///
/// Each rig is the heads of its bones, `(bones)`, and matrices whose columns are their x, y and z axes, `(bones)`, in
/// the world or another space of its own; what tells are those places, and the axes that no mirroring turns over, y and
/// z, up to what differs in the two poses. Bodies that stand by whole quarter turns to each other, in those spaces or
/// in two more `spaces`, matrices of which only the turns count, stand exactly so ([`POSES`]).
///
/// # Errors
/// [`Error::BadArgument`] when the rigs have not the same number of bones.
///
/// # Source
/// Wahba, "A least squares estimate of satellite attitude", 1965, for heads and axes.
pub fn facing(
    source: (&[Point], &[[Point; 3]]),
    target: (&[Point], &[[Point; 3]]),
    mirrors: bool,
    spaces: &[[Point; 3]; 2],
) -> Result<[Point; 3]> {
    let count = source.0.len();
    check_rows("source_axes", source.1.len(), count)?;
    check_rows("target_heads", target.0.len(), count)?;
    check_rows("target_axes", target.1.len(), count)?;
    let size = BONES.axes_count * vector::extent(source.0);
    let [before, after] = [source, target].map(|(heads, axes)| marks(heads, axes, size));
    let mut covariance = [[0.0; 3]; 3];
    for (p, q) in before.into_iter().zip(after) {
        for (row, x) in covariance.iter_mut().zip(q) {
            *row = vector::add(*row, vector::scaled(p, x));
        }
    }
    let found = nearest_turn(&covariance, mirrors);
    let [first, second] = spaces.map(|space| polar(&space).0);
    let within = product(&product(&transposed(&second), &found), &first);
    let within =
        quarter(&within).map(|turn| product(&product(&second, &turn), &transposed(&first)));
    // Of two turns 1 + 2 cos of the angle between them.
    let alike = |turn: &Matrix| -> f64 { (0..3).map(|i| vector::dot(turn[i], found[i])).sum() };
    let nearest = [quarter(&found), within]
        .into_iter()
        .flatten()
        .max_by(|a, b| alike(a).total_cmp(&alike(b)));
    let least = 1.0 + 2.0 * POSES.quarters.to_radians().cos();
    Ok(nearest.filter(|turn| alike(turn) > least).unwrap_or(found))
}

/// Heads around their middle, and what is beside them along their axes.
fn marks(heads: &[Point], axes: &[Matrix], size: f64) -> Vec<Point> {
    let middle = vector::mean(heads);
    let places = heads.iter().map(|&head| vector::sub(head, middle));
    let beside = axes.iter().map(transposed);
    places
        .chain(beside.flat_map(|[_, y, z]| [y, z].map(|axis| vector::scaled(axis, size))))
        .collect()
}

/// The whole quarter turn, mirroring or not, next to a turn; none between two of them.
fn quarter(turn: &Matrix) -> Option<Matrix> {
    let nearest = turn.map(|row| row.map(f64::round_ties_even));
    (product(&nearest, &transposed(&nearest)) == unity()).then_some(nearest)
}

/// The one of some axes, unit vectors `(n)`, or of their opposites, that is next to a direction, a unit vector too; the
/// direction itself where all are farther from it than a body may lean ([`POSES`]).
#[must_use]
pub fn nearest_axis(direction: Point, axes: &[Point]) -> Point {
    let both = axes
        .iter()
        .flat_map(|&axis| [axis, vector::scaled(axis, -1.0)]);
    let along = |axis: &Point| vector::dot(*axis, direction);
    both.max_by(|a, b| along(a).total_cmp(&along(b)))
        .filter(|axis| along(axis) > POSES.quarters.to_radians().cos())
        .unwrap_or(direction)
}

/// What takes turns of a rig's bones from their places at rest to those of the fitted rig: `B₂ = left (S B₁ S) right`.
#[derive(Debug, Clone, PartialEq)]
pub struct FittedTurns {
    /// `L`, rows of a turn for each bone, `(bones)`.
    pub left: Vec<[Point; 3]>,
    /// `N`, or, of a bone that is not fitted, what that makes of `P₂` beside `G P₁ S`, `(bones)`.
    pub right: Vec<[Point; 3]>,
}

/// The rests of two rigs with the same bones, `(bones)` each.
#[derive(Debug, Clone, Copy)]
pub struct Rests<'a> {
    /// The parent of each bone, −1 of a root and of a bone that is not turned with its parent.
    pub parents: &'a [i64],
    /// Matrices whose columns are the axes of each bone of the source, in the space in which it faces the target.
    pub source: &'a [[Point; 3]],
    /// Those of the target's bones.
    pub target: &'a [[Point; 3]],
    /// The direction, of any length, of the limb in each bone's own axes, of source and target; of none it is y, along
    /// the bone.
    pub limbs: &'a [[Point; 2]],
    /// `B₁` and `B₂` of the bones that are not fitted: as they are posed in both rigs.
    pub kept: &'a [Option<[Point; 3]>],
}

/// `L` and `N` of each bone, for two rigs of which [`facing`] takes the source to the target.
///
/// # Errors
/// [`Error::BadArgument`] when an argument has not one row for each bone, or a bone is its own
/// ancestor.
pub fn fitted_turns(rests: &Rests<'_>, facing: &[Point; 3]) -> Result<FittedTurns> {
    let count = rests.parents.len();
    for (name, rows) in [
        ("source_axes", rests.source.len()),
        ("target_axes", rests.target.len()),
        ("limbs", rests.limbs.len()),
        ("kept", rests.kept.len()),
    ] {
        check_rows(name, rows, count)?;
    }
    let (_, order) = descendants("parents", rests.parents)?;
    let mut left = vec![unity(); count];
    let mut right = left.clone();
    for bone in order {
        let [source, target] = [rests.source[bone], rests.target[bone]];
        // Of all bones of a rig either all mirror or none does.
        let mirrors = determinant(facing) * determinant(&source) * determinant(&target) < 0.0;
        let to_target = transposed(&target);
        let above = match usize::try_from(rests.parents[bone]) {
            Err(_) => product(facing, &source),
            Ok(parent) => {
                let given = product(&transposed(&rests.source[parent]), &source);
                let turned = product(&transposed(&right[parent]), &mirrored(&given, mirrors));
                let above = product(&rests.target[parent], &turned);
                mirrored_columns(&above, mirrors)
            }
        };
        left[bone] = mirrored_columns(&product(&to_target, &above), mirrors);
        right[bone] = match &rests.kept[bone] {
            None => {
                let [source, target] = rests.limbs[bone].map(limb);
                let flip = if mirrors { -1.0 } else { 1.0 };
                smallest_turn(target, [flip * source[0], source[1], source[2]])
            }
            Some(kept) => {
                let fitted = product(&left[bone], &mirrored(kept, mirrors));
                product(&transposed(&fitted), kept)
            }
        };
    }
    Ok(FittedTurns { left, right })
}

/// `S m S`.
fn mirrored(m: &Matrix, mirrors: bool) -> Matrix {
    let [x, y, z] = mirrored_columns(m, mirrors);
    let flip = if mirrors { -1.0 } else { 1.0 };
    [vector::scaled(x, flip), y, z]
}

/// `m S`.
fn mirrored_columns(m: &Matrix, mirrors: bool) -> Matrix {
    let flip = if mirrors { -1.0 } else { 1.0 };
    m.map(|[x, y, z]| [flip * x, y, z])
}

fn limb(direction: Point) -> Point {
    match vector::normalised(direction) {
        [0.0, 0.0, 0.0] => [0.0, 1.0, 0.0],
        direction => direction,
    }
}

/// The smallest turn that takes one unit vector to another: half a turn about one and then about the middle of both.
fn smallest_turn(from: Point, to: Point) -> Matrix {
    let half = |axis: Point| {
        let mut rows = axis.map(|x| vector::scaled(axis, 2.0 * x));
        for (i, row) in rows.iter_mut().enumerate() {
            row[i] -= 1.0;
        }
        rows
    };
    let middle = vector::add(from, to);
    if vector::norm(middle) < OPPOSITE {
        return half(vector::tangent_frame(from)[0]);
    }
    product(&half(vector::normalised(middle)), &half(from))
}

/// Where the bones of a rig begin in a pose, `(bones)`, given where they begin at rest.
///
/// `axes` are matrices whose columns are the axes of the bones at rest, `turns` the turns of the bones from there, in
/// their own axes; bones that are `loose` go with their parent's place and not with its turn.
///
/// # Errors
/// [`Error::BadArgument`] when an argument has not one row for each bone, or a bone is its own
/// ancestor.
pub fn posed_heads(
    heads: &[Point],
    axes: &[[Point; 3]],
    parents: &[i64],
    loose: &[bool],
    turns: &[[Point; 3]],
) -> Result<Vec<Point>> {
    let count = parents.len();
    for (name, rows) in [
        ("heads", heads.len()),
        ("axes", axes.len()),
        ("loose", loose.len()),
        ("turns", turns.len()),
    ] {
        check_rows(name, rows, count)?;
    }
    let (_, order) = descendants("parents", parents)?;
    let mut posed = heads.to_vec();
    // What takes directions at rest to those in the pose.
    let mut turned = vec![unity(); count];
    for bone in order {
        let mut above = unity();
        if let Ok(parent) = usize::try_from(parents[bone]) {
            let way = vector::sub(heads[bone], heads[parent]);
            posed[bone] = vector::add(posed[parent], vector::by_rows(&turned[parent], way));
            if !loose[bone] {
                above = turned[parent];
            }
        }
        let own = product(
            &product(&axes[bone], &turns[bone]),
            &transposed(&axes[bone]),
        );
        turned[bone] = product(&above, &own);
    }
    Ok(posed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::fractions;

    const DOWN: [Point; 3] = [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]];

    /// A turn about (1, 2, 3), in degrees.
    fn turn(degrees: f64) -> Matrix {
        let axis = vector::normalised([1.0, 2.0, 3.0]);
        let (sin, cos) = degrees.to_radians().sin_cos();
        let column = |i: usize| {
            let mut unit = [0.0; 3];
            unit[i] = 1.0;
            let along = vector::scaled(axis, vector::dot(axis, unit) * (1.0 - cos));
            let across = vector::scaled(vector::cross(axis, unit), sin);
            vector::add(vector::add(vector::scaled(unit, cos), along), across)
        };
        transposed(&[column(0), column(1), column(2)])
    }

    /// Heads of so many bones and their axes, all over the place.
    fn rig(seed: u64, count: usize) -> (Vec<Point>, Vec<Matrix>) {
        let mut fraction = fractions(seed);
        let mut random = || [0; 3].map(|_| f64::from(fraction()) - 0.5);
        (0..count)
            .map(|_| (random(), polar(&[random(), random(), random()]).0))
            .map(|(head, axes)| {
                let side = determinant(&axes).signum();
                (head, axes.map(|row| vector::scaled(row, side)))
            })
            .unzip()
    }

    fn close(a: &Matrix, b: &Matrix) {
        for (x, y) in a.as_flattened().iter().zip(b.as_flattened()) {
            // Some roundings of turns, one after the other along a chain.
            assert!((x - y).abs() < 1e-13, "{a:?} {b:?}");
        }
    }

    /// A rig that was turned and moved, its bones' x axes turned over where that mirrors.
    fn taken(heads: &[Point], axes: &[Matrix], by: &Matrix) -> (Vec<Point>, Vec<Matrix>) {
        let place = |&head: &Point| vector::add(vector::by_rows(by, head), [3.0, -1.0, 2.0]);
        let mirrors = determinant(by) < 0.0;
        let axes = axes
            .iter()
            .map(|m| mirrored_columns(&product(by, m), mirrors));
        (heads.iter().map(place).collect(), axes.collect())
    }

    fn faces(by: &Matrix, spaces: &[Matrix; 2]) -> Matrix {
        let (heads, axes) = rig(1, 20);
        let (heads_2, axes_2) = taken(&heads, &axes, by);
        let mirrors = determinant(by) < 0.0;
        facing((&heads, &axes), (&heads_2, &axes_2), mirrors, spaces).unwrap()
    }

    fn random_points(seed: u64) -> Vec<Point> {
        let mut fraction = fractions(seed);
        (0..30)
            .map(|_| [0; 3].map(|_| f64::from(fraction())))
            .collect()
    }

    #[test]
    fn points_that_were_turned_scaled_and_moved_tell_how() {
        let points = random_points(3);
        let made = Affine {
            linear: turn(120.0).map(|row| vector::scaled(row, 0.01)),
            shift: [1.0, 2.0, 3.0],
        };
        let mut aims: Vec<Point> = points.iter().map(|&p| made.apply(p)).collect();
        aims[0] = [9.0, 9.0, 9.0];
        let mut weights = vec![1.0; points.len()];
        weights[0] = 0.0;
        let found = similarity(&points, &aims, Some(&weights)).unwrap();
        for &p in &points {
            assert!(vector::distance(found.apply(p), made.apply(p)) < 1e-14);
        }
        // What has weights of zero alone counts alike.
        let [none, zero] = [None, Some(&[0.0; 30][..])]
            .map(|weights| similarity(&points, &aims, weights).unwrap());
        assert_eq!(none, zero);
        assert_ne!(none, found);
    }

    #[test]
    fn what_is_at_one_place_is_moved_alone() {
        let points = random_points(4);
        let place = vec![[0.1, 0.2, 0.3]; points.len()];
        for (from, to) in [(&points, &place), (&place, &points), (&place, &place)] {
            let found = similarity(from, to, None).unwrap();
            assert_eq!(found.linear, unity());
            let away = vector::sub(found.apply(vector::mean(from)), vector::mean(to));
            assert!(vector::norm(away) < 1e-15);
        }
    }

    #[test]
    fn pairs_that_do_not_fit_are_refused() {
        let points = random_points(5);
        let negative = vec![-1.0; points.len()];
        for (points, aims, weights, words) in [
            (&points[..], &points[1..], None, "`aims`"),
            (
                &points,
                &points,
                Some(&negative[1..]),
                "`weights` should have 30",
            ),
            (
                &points,
                &points,
                Some(&negative),
                "`weights` should be 0 or more",
            ),
            (&[], &[], None, "`points`"),
        ] {
            let error = similarity(points, aims, weights).unwrap_err();
            assert!(error.to_string().contains(words), "{error}");
        }
    }

    #[test]
    fn a_body_that_was_turned_faces_so() {
        let flip = |m: &Matrix| mirrored_columns(m, true);
        let none = [unity(); 2];
        for by in [turn(30.0), flip(&turn(-100.0)), DOWN, flip(&DOWN)] {
            close(&faces(&by, &none), &by);
        }
        // By less than what tells apart nothing but poses, and by a little more.
        assert_eq!(faces(&product(&turn(11.9), &DOWN), &none), DOWN);
        let beyond = product(&turn(12.1), &DOWN);
        close(&faces(&beyond, &none), &beyond);
        // By quarter turns in spaces that are turned in the world, stretched ones too.
        let spaces = [turn(33.0), turn(70.0)];
        let exact = product(&product(&spaces[1], &DOWN), &transposed(&spaces[0]));
        let stretched =
            spaces.map(|m| product(&m, &[[3.0, 1.0, 0.0], [1.0, 2.0, 0.0], [0.0, 0.0, 0.5]]));
        close(&faces(&product(&turn(8.0), &exact), &stretched), &exact);
        // Of one bone the axes tell, in no size at all nothing does.
        let (heads, axes) = rig(2, 1);
        let found = facing((&heads, &axes), (&heads, &axes), false, &none).unwrap();
        assert_eq!(found, unity());
    }

    #[test]
    fn a_direction_stands_upright_where_it_nearly_does() {
        let axes = turn(20.0);
        let down = vector::scaled(axes[2], -1.0);
        let leaning = |degrees: f64| vector::by_rows(&turn(degrees), down);
        let away = vector::dot(leaning(5.0), down).acos().to_degrees();
        assert!(away > 1.0 && away < 5.0);
        assert_eq!(nearest_axis(leaning(5.0), &axes), down);
        assert_eq!(nearest_axis(leaning(60.0), &axes[2..]), leaning(60.0));
        assert_eq!(nearest_axis(down, &[]), down);
    }

    #[test]
    fn the_smallest_turn_is_about_what_is_across() {
        let (from, across) = (turn(40.0)[0], turn(40.0)[1]);
        for angle in [0.0, 1e-6, 1.0, 3.1, std::f64::consts::PI] {
            let to = vector::add(
                vector::scaled(from, f64::cos(angle)),
                vector::scaled(across, f64::sin(angle)),
            );
            let found = smallest_turn(from, to);
            // Near half a turn the middle of both is short.
            assert!(vector::distance(vector::by_rows(&found, from), to) < 1e-12);
            assert!((determinant(&found) - 1.0).abs() < 1e-14);
            let trace: f64 = (0..3).map(|i| found[i][i]).sum();
            assert!((trace - 1.0 - 2.0 * angle.cos()).abs() < 1e-12);
        }
    }

    /// Poses of one rig and of the other by the equations' own words: every bone of the target is turned by `G P₁ S N`.
    #[test]
    fn fitted_turns_turn_the_target_as_the_source() {
        let count = 12;
        let (_, source) = rig(3, count);
        let (_, target) = rig(4, count);
        let (limbs, bases) = rig(5, count);
        let limbs: Vec<[Point; 2]> = limbs.iter().map(|&p| [p, [p[1], p[2], -p[0]]]).collect();
        let parents: Vec<i64> = (0..count as i64)
            .map(|b| if b % 5 == 0 { -1 } else { b - 1 })
            .collect();
        for facing in [turn(50.0), mirrored_columns(&turn(50.0), true)] {
            let mirrors = determinant(&facing) < 0.0;
            let kept: Vec<Option<Matrix>> = (0..count)
                .map(|b| (b % 4 == 2).then_some(bases[b]))
                .collect();
            let rests = Rests {
                parents: &parents,
                source: &source,
                target: &target,
                limbs: &limbs,
                kept: &kept,
            };
            let found = fitted_turns(&rests, &facing).unwrap();
            let (mut posed_1, mut posed_2) = (source.clone(), target.clone());
            for bone in 0..count {
                let given = mirrored(&bases[bone], mirrors);
                let own = match kept[bone] {
                    None => product(&product(&found.left[bone], &given), &found.right[bone]),
                    Some(kept) => kept,
                };
                for (posed, rest, basis) in [
                    (&mut posed_1, &source, &bases[bone]),
                    (&mut posed_2, &target, &own),
                ] {
                    let mut above = unity();
                    if let Ok(parent) = usize::try_from(parents[bone]) {
                        above = product(&posed[parent], &transposed(&rest[parent]));
                    }
                    posed[bone] = product(&product(&above, &rest[bone]), basis);
                }
                let wanted = product(&facing, &posed_1[bone]);
                let wanted = product(&mirrored_columns(&wanted, mirrors), &found.right[bone]);
                close(&posed_2[bone], &wanted);
                if kept[bone].is_none() {
                    // The limb of both rigs points to one side of the body.
                    let limbs = limbs[bone].map(vector::normalised);
                    let way = vector::by_rows(&product(&facing, &posed_1[bone]), limbs[0]);
                    let found = vector::by_rows(&posed_2[bone], limbs[1]);
                    assert!(vector::distance(way, found) < 1e-12);
                }
            }
        }
    }

    #[test]
    fn heads_go_with_what_turns_them() {
        let heads = [[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [3.0, 0.0, 0.0]];
        let axes = [turn(10.0), turn(20.0), turn(30.0), turn(40.0)];
        // A quarter turn about z in the world, of the first two bones; the third keeps how it stands.
        let quarter = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
        let own = |bone: usize| product(&product(&transposed(&axes[bone]), &quarter), &axes[bone]);
        let turns = [own(0), own(1), unity(), unity()];
        let loose = [false, false, true, false];
        let found = posed_heads(&heads, &axes, &[-1, 0, 1, 2], &loose, &turns).unwrap();
        let wanted = [[0.0; 3], [0.0, 1.0, 0.0], [-1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        for (found, wanted) in found.iter().zip(wanted) {
            assert!(vector::distance(*found, wanted) < 1e-14, "{found:?}");
        }
    }

    #[test]
    fn rigs_that_do_not_fit_are_refused() {
        let (heads, axes) = rig(6, 3);
        let message = |found: Result<()>| found.unwrap_err().to_string();
        let off = facing((&heads, &axes), (&heads, &axes[1..]), false, &[unity(); 2]);
        assert!(message(off.map(drop)).contains("`target_axes` should have 3 rows"));
        let rests = |parents, limbs| Rests {
            parents,
            source: &axes,
            target: &axes,
            limbs,
            kept: &[None; 3],
        };
        let limbs = [[[0.0; 3]; 2]; 3];
        let turns = |rests| fitted_turns(&rests, &unity()).map(drop);
        assert!(turns(rests(&[-1, 0, 1], &limbs)).is_ok());
        assert!(message(turns(rests(&[-1, 0, 1], &limbs[1..]))).contains("`limbs`"));
        assert!(message(turns(rests(&[2, 0, 1], &limbs))).contains("`parents`"));
        assert!(message(turns(rests(&[-1, 0, 3], &limbs))).contains("`parents`"));
        let posed = |loose| posed_heads(&heads, &axes, &[-1, 0, 1], loose, &axes).map(drop);
        assert!(message(posed(&[false])).contains("`loose`"));
    }
}
