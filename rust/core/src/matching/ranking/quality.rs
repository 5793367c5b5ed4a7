//! A grade for a whole map, with its reasons in words.

use crate::matching::problem::pair::Coverage;
use crate::matching::ranking::Metrics;
use crate::matching::ranking::settings::{EVIDENCE, METRICS, QUALITY};
use crate::mesh::IntakeReport;

/// How far a map can be trusted as a whole.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Grade {
    /// Use it.
    Green,
    /// Look at it first.
    Amber,
    /// Probably wrong.
    Red,
}

impl Grade {
    /// Name of the grade.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Green => "green",
            Self::Amber => "amber",
            Self::Red => "red",
        }
    }
}

/// Whether the search has found nothing convincing, so that more should be tried.
#[must_use]
pub fn doubtful(metrics: &Metrics) -> bool {
    metrics.orientation < QUALITY.orientation.0
        || metrics.local_distortion > QUALITY.local_distortion.1
}

/// Whether a map changes distances by so much that these do not tell which point is which.
#[must_use]
pub fn incomparable(metrics: &Metrics) -> bool {
    metrics.local_distortion > QUALITY.incomparable
}

/// Whether a map changes short distances by more than there is between bodies that are alike.
#[must_use]
pub fn stretches(metrics: &Metrics) -> bool {
    metrics.local_distortion > QUALITY.local_distortion.0
}

/// Whether the two shapes hardly look like one body in two poses, by the curvatures of a map between them.
#[must_use]
fn unlike(metrics: &Metrics) -> bool {
    metrics.agreement < QUALITY.alike
}

/// Whether the best map so far says that the shapes are not poses of one body.
#[must_use]
pub fn differ(metrics: &Metrics) -> bool {
    unlike(metrics) || doubtful(metrics)
}

/// Whether a map keeps distances and orientation so well that it is one of two poses of a body.
#[must_use]
pub fn clear(metrics: &Metrics) -> bool {
    metrics.orientation > QUALITY.clear.0 && metrics.local_distortion < QUALITY.clear.1
}

/// Whether a map keeps distances and orientation as hardly any but between poses of one body does.
#[must_use]
pub fn isometric(metrics: &Metrics) -> bool {
    metrics.orientation > QUALITY.clear.0 && metrics.local_distortion < QUALITY.isometric
}

/// How likely a map is right, in [0, 1]: 1/(1 + e⁻ᶻ) of the chosen one, z = β₀ + β·[`evidence`], fitted to maps that are known to be
/// right or wrong; of an alternative less, the farther it lies from the chosen one.
#[must_use]
pub fn score(metrics: &Metrics, coverage: Coverage) -> f64 {
    let coefficients = [
        EVIDENCE.agreement,
        EVIDENCE.orientation,
        EVIDENCE.distortion,
        EVIDENCE.clarity,
        EVIDENCE.torn,
    ];
    let weighed = coefficients.iter().zip(evidence(metrics, coverage));
    let z = EVIDENCE.constant + weighed.map(|(c, x)| c * x).sum::<f64>();
    (-(metrics.apart / QUALITY.reach).powi(2)).exp() / (1.0 + (-z).exp())
}

/// What the score weighs of a map: agreement of curvatures, orientation, logarithm of the change of short distances, how clearly no
/// other map fits as well (0 to 1), and whether it tears the surface.
#[must_use]
pub fn evidence(metrics: &Metrics, coverage: Coverage) -> [f64; 5] {
    let clarity = (metrics.margin - QUALITY.margin.0) / (QUALITY.margin.1 - QUALITY.margin.0);
    [
        metrics.agreement,
        metrics.orientation,
        (metrics.local_distortion + METRICS.distortion_noise).ln(),
        clarity.clamp(0.0, 1.0),
        f64::from(u8::from(tears(metrics, coverage))),
    ]
}

/// Whether a map tears the surface where it should not: what a part lacks of the target goes to one rim or another of it.
fn tears(metrics: &Metrics, coverage: Coverage) -> bool {
    metrics.torn > 0.0 && coverage != Coverage::SOURCE_IS_PART
}

/// What was left out of a shape, in words, if anything was: the match is of one connected part.
#[must_use]
pub fn left_out(role: &str, report: &IntakeReport) -> Option<String> {
    let (parts, vertices) = (report.dropped_components, report.dropped_component_vertices);
    match parts {
        0 => None,
        1 => Some(format!(
            "one unconnected part of the {role} was left out ({vertices} vertices)"
        )),
        _ => Some(format!(
            "{parts} unconnected parts of the {role} were left out ({vertices} vertices)"
        )),
    }
}

/// Grade and reason of a map by a method that computes no metrics.
#[must_use]
pub fn ungraded() -> (Grade, Vec<String>) {
    let reason = "this method does not judge its map: look at it".into();
    (Grade::Amber, vec![reason])
}

/// Grade and reasons of a map by its metrics.
#[must_use]
pub fn graded(metrics: &Metrics, coverage: Coverage) -> (Grade, Vec<String>) {
    let score = score(metrics, coverage);
    // A part is asked half as many questions, but looks like what it is a part of.
    let unlike_part = coverage != Coverage::BOTH && metrics.agreement < QUALITY.looks_alike;
    let is_beaten = metrics.margin < QUALITY.margin.0;
    let grade = if score < QUALITY.score.0 || is_beaten || incomparable(metrics) {
        Grade::Red
    } else if score < QUALITY.score.1
        || metrics.margin < QUALITY.least_margin
        || unlike_part
        || tears(metrics, coverage)
        || metrics.mirrored_gain > QUALITY.mirrored_gain
    {
        Grade::Amber
    } else {
        Grade::Green
    };
    let mut reasons: Vec<String> = Vec::new();
    if coverage == Coverage::TARGET_IS_PART {
        reasons.push("the target looks like a part of the source".into());
    } else if coverage == Coverage::SOURCE_IS_PART {
        reasons.push("the source looks like a part of the target".into());
    }
    let doubts = doubts(metrics, coverage);
    if grade == Grade::Green && !doubts.is_empty() {
        reasons.push(format!(
            "not all that was compared agrees, but together it says that the map is right ({:.0} %)",
            100.0 * score
        ));
    } else {
        reasons.extend(doubts);
    }
    if reasons.is_empty() {
        reasons.push("distances, curvatures and orientation agree".into());
    }
    (grade, reasons)
}

/// What speaks against a map, each metric by itself.
fn doubts(metrics: &Metrics, coverage: Coverage) -> Vec<String> {
    let o = metrics.orientation;
    let d = 100.0 * metrics.local_distortion;
    let mut reasons: Vec<String> = Vec::new();
    if metrics.mirrored_gain > QUALITY.mirrored_gain {
        reasons
            .push("one shape looks like a mirror image of the other: allow mirrored maps".into());
    }
    if metrics.apart > QUALITY.reach {
        reasons.push("another map fits better: this is an alternative".into());
    } else if metrics.margin < QUALITY.margin.1 {
        reasons.push(
            "other maps fit almost as well: compare the alternatives or set a landmark".into(),
        );
    }
    if metrics.agreement < QUALITY.looks_alike {
        reasons.push(format!(
            "bumps and hollows do not agree (correlation {:.2}): the shapes may not match",
            metrics.agreement
        ));
    }
    if o < QUALITY.orientation.0 {
        reasons.push(format!(
            "left and right are hard to tell apart (orientation {o:.2}): try the next alternative"
        ));
    } else if o < QUALITY.orientation.1 {
        reasons.push(format!("the surface turns in places (orientation {o:.2})"));
    }
    if metrics.local_distortion > QUALITY.local_distortion.1 {
        reasons.push(format!(
            "distances change by {d:.1} % of √area: the shapes differ, or one is a part"
        ));
    } else if metrics.local_distortion > QUALITY.local_distortion.0 {
        reasons.push(format!(
            "distances change by {d:.1} % of √area: the bodies differ"
        ));
    }
    if tears(metrics, coverage) {
        reasons.push(
            "neighbours on the target go to places far apart: limbs may have grown together where they touch".into(),
        );
    }
    reasons
}

#[cfg(test)]
mod tests {
    use super::*;

    fn good() -> Metrics {
        Metrics {
            orientation: 0.9,
            local_distortion: 0.01,
            agreement: 0.9,
            margin: QUALITY.margin.1,
            ..Metrics::default()
        }
    }

    #[test]
    fn a_part_that_looks_like_another_body_is_not_green() {
        let unlike = Metrics {
            agreement: 0.99 * QUALITY.looks_alike,
            ..good()
        };
        let grades = [
            Coverage::BOTH,
            Coverage::TARGET_IS_PART,
            Coverage::SOURCE_IS_PART,
        ]
        .map(|coverage| graded(&unlike, coverage).0);
        assert_eq!(grades, [Grade::Green, Grade::Amber, Grade::Amber]);
    }

    #[test]
    fn where_distances_do_not_tell_a_map_is_red_however_alike_the_shapes_look() {
        let beyond = Metrics {
            local_distortion: 1.01 * QUALITY.incomparable,
            agreement: 1.0,
            ..good()
        };
        assert_eq!(graded(&beyond, Coverage::BOTH).0, Grade::Red);
    }

    #[test]
    fn a_map_that_another_one_equals_is_not_green_whatever_else_agrees() {
        let best = Metrics {
            agreement: 1.0,
            orientation: 1.0,
            local_distortion: 0.0,
            ..good()
        };
        let rivalled = Metrics {
            margin: 0.99 * QUALITY.least_margin,
            ..best
        };
        let beaten = Metrics {
            margin: 0.99 * QUALITY.margin.0,
            ..best
        };
        let grades = [best, rivalled, beaten].map(|metrics| graded(&metrics, Coverage::BOTH).0);
        assert_eq!(grades, [Grade::Green, Grade::Amber, Grade::Red]);
    }

    #[test]
    fn what_is_doubtful_by_itself_is_no_doubt_where_all_the_rest_agrees() {
        let turned_in_places = Metrics {
            orientation: 0.99 * QUALITY.orientation.0,
            ..good()
        };
        let (grade, reasons) = graded(&turned_in_places, Coverage::BOTH);
        assert_eq!(grade, Grade::Green);
        assert!(
            matches!(&reasons[..], [all] if all.contains("together it says")),
            "{reasons:?}"
        );
        let less = Metrics {
            agreement: 0.5,
            local_distortion: 0.06,
            ..turned_in_places
        };
        let (grade, reasons) = graded(&less, Coverage::BOTH);
        assert_eq!(grade, Grade::Amber);
        assert_eq!(reasons.len(), 3, "{reasons:?}");
    }

    #[test]
    fn a_torn_surface_is_not_green_unless_it_is_met_by_a_part() {
        let good = good();
        let torn = Metrics { torn: 0.01, ..good };
        assert_eq!(graded(&good, Coverage::BOTH).0, Grade::Green);
        let (grade, reasons) = graded(&torn, Coverage::BOTH);
        assert_eq!(grade, Grade::Amber);
        assert!(
            reasons.iter().any(|r| r.contains("far apart")),
            "{reasons:?}"
        );
        assert_eq!(graded(&torn, Coverage::SOURCE_IS_PART).0, Grade::Green);
    }
}
