//! The grade of a map between figures: that of what was matched, for all that is seen.

use super::{Figure, FigureMap};
use crate::matching::ranking::quality::{self, Grade};

/// More of the visible area than this without an image of its own leaves a map amber.
const MOST_UNKNOWN: f64 = 0.1;

/// Grade and reasons of a map between figures.
#[must_use]
pub fn graded(found: &FigureMap, source: &Figure, target: &Figure) -> (Grade, Vec<String>) {
    if found.is_worn {
        let reason =
            "the target lies on the source as it is worn: each point takes what lies below it";
        return (Grade::Green, vec![reason.into()]);
    }
    let (mut grade, mut reasons) = match &found.map.metrics {
        Some(metrics) => quality::graded(metrics, found.map.coverage),
        None => quality::ungraded(),
    };
    let unknown = found.unknown.max(1.0 - source.seen);
    if unknown > MOST_UNKNOWN {
        if grade == Grade::Green {
            grade = Grade::Amber;
        }
        reasons.push(format!(
            "{:.0} % of what is seen was placed beside what was matched: look at it",
            100.0 * unknown
        ));
    }
    for (role, figure) in [("source", source), ("target", target)] {
        if figure.is_wrapped() {
            let pieces = figure.pieces;
            reasons.push(format!(
                "the {role}'s {pieces} pieces were matched as one figure"
            ));
        } else {
            reasons.extend(quality::left_out(role, &figure.shape.mesh.report));
        }
    }
    reasons.extend(found.map.remarks.iter().cloned());
    (grade, reasons)
}
