//! The grade of a map between figures: that of what was matched, for all that is seen.

use super::{Figure, FigureMap};
use crate::figure::settings::JUDGEMENT;
use crate::matching::ranking::quality::{self, Grade};

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
    if unknown > JUDGEMENT.most_unknown {
        grade = at_most_amber(grade);
        reasons.push(format!(
            "{:.0} % of what is seen was placed beside what was matched: look at it",
            100.0 * unknown
        ));
    }
    for (role, figure) in [("source", source), ("target", target)] {
        let vertices = figure.shape.given_mesh().vertices.len();
        if vertices < JUDGEMENT.fewest_sure {
            grade = at_most_amber(grade);
            reasons.push(format!(
                "the {role} has only {vertices} vertices: too few to be sure, look at it"
            ));
        }
        if figure.turns_onto_itself() {
            grade = at_most_amber(grade);
            reasons.push(format!(
                "the {role} looks the same when it is turned about an axis: which way round it goes cannot be told, \
                 set landmarks"
            ));
        }
        match figure.strays {
            0 => {}
            1 => reasons.push(format!(
                "one point of the {role} lies far out: it was taken to be between its neighbours"
            )),
            strays => reasons.push(format!(
                "{strays} points of the {role} lie far out: they were taken to be between their neighbours"
            )),
        }
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

fn at_most_amber(grade: Grade) -> Grade {
    if grade == Grade::Green {
        Grade::Amber
    } else {
        grade
    }
}
