//! Surfaces that lie on one another as they were given.

use crate::common::lumpy;
use sgmds_core::matching::problem::pair::Coverage;
use sgmds_core::matching::refinement::coinciding::coinciding;
use sgmds_core::shape::Shape;
use sgmds_core::watch::progress::Progress;

type Surface = (Vec<[f64; 3]>, Vec<[i64; 3]>);

fn prepared((vertices, faces): &Surface) -> Shape {
    Shape::new(vertices, faces, &Progress::default(), &|_, _| Ok(())).expect("a sound mesh")
}

fn moved(surface: &Surface, scale: f64, to: [f64; 3]) -> Surface {
    let place = |p: &[f64; 3]| [0, 1, 2].map(|c| scale * p[c] + to[c]);
    (surface.0.iter().map(place).collect(), surface.1.clone())
}

/// Which of two surfaces, first the source, lies on the other.
fn lying(source: &Surface, target: &Surface) -> Option<Coverage> {
    coinciding(&prepared(source), &prepared(target), &|| Ok(()))
        .expect("nothing cancels")
        .map(|found| found.coverage)
}

#[test]
fn a_surface_lies_on_itself_and_a_piece_on_its_whole_wherever_they_are() {
    for to in [[0.0; 3], [300.0, -200.0, 100.0]] {
        let whole = moved(&lumpy(3), 10.0, to);
        let upper = |f: &&[i64; 3]| f.iter().all(|&v| whole.0[v as usize][2] > to[2] - 4.0);
        let piece = (
            whole.0.clone(),
            whole.1.iter().filter(upper).copied().collect(),
        );
        assert_eq!(lying(&whole, &whole), Some(Coverage::BOTH));
        assert_eq!(lying(&whole, &piece), Some(Coverage::TARGET_IS_PART));
        assert_eq!(lying(&piece, &whole), Some(Coverage::SOURCE_IS_PART));
    }
}

#[test]
fn what_stands_beside_a_surface_or_is_small_does_not_lie_on_it() {
    let whole = lumpy(3);
    let beside = moved(&whole, 1.0, [0.3, 0.0, 0.0]);
    let small = moved(&whole, 1e-3, whole.0[100]);
    for other in [beside, small] {
        assert_eq!(lying(&whole, &other), None);
        assert_eq!(lying(&other, &whole), None);
    }
}
