//! The grade of a map between figures: that of what was matched, for all that is seen.

use super::{Figure, FigureMap, Origin};
use crate::algebra::vector::{self, Point};
use crate::figure::settings::{JUDGEMENT, TURNING};
use crate::matching::ranking::quality::{self, Grade};
use crate::mesh::numbering::GivenVertex;
use crate::transfer::surface::blend;

/// Grade and reasons of a map between figures.
#[must_use]
pub fn graded(found: &FigureMap, source: &Figure, target: &Figure) -> (Grade, Vec<String>) {
    let known = match found.origin {
        Origin::Matched => None,
        Origin::Worn => {
            Some("the target lies on the source as it is worn: each point takes what lies below it")
        }
        Origin::Copies => {
            Some("both have the same pieces: each point takes the one that it is a copy of")
        }
    };
    if let Some(reason) = known {
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
    let turns = source.turns_onto_itself() || target.turns_onto_itself();
    let is_told = turns && is_way_round_told(found, source, target);
    for (role, figure) in [("source", source), ("target", target)] {
        let vertices = figure.shape.given_mesh().vertices.len();
        if vertices < JUDGEMENT.fewest_sure {
            grade = at_most_amber(grade);
            reasons.push(format!(
                "the {role} has only {vertices} vertices: too few to be sure, look at it"
            ));
        }
        if figure.turns_onto_itself() && !is_told {
            grade = at_most_amber(grade);
            reasons.push(format!(
                "the {role} looks the same when it is turned about an axis: which way round it goes cannot be told, \
                 set two landmarks a quarter turn apart"
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

/// Whether landmarks tell which way round surfaces go that turn onto themselves, and the map goes by them: not at the landmarks
/// alone, but around them too.
fn is_way_round_told(found: &FigureMap, source: &Figure, target: &Figure) -> bool {
    let landmarks = &found.landmarks;
    !landmarks.is_empty()
        && source.are_off_every_axis(landmarks.iter().map(|l| l.source))
        && target.are_off_every_axis(landmarks.iter().map(|l| l.target))
        && landmarks.iter().all(|landmark| {
            let (own, images) = around(found, source, target, landmark.target);
            let apart = |a, b, figure: &Figure| vector::distance(a, b) / figure.shape.unit;
            // At a border the neighbours lie to one side.
            let aside = apart(own, target.place(landmark.target), target);
            apart(images, source.place(landmark.source), source) < aside + TURNING.slid
        })
}

/// Mean place of the neighbours of a target vertex, and of their images.
fn around(
    found: &FigureMap,
    source: &Figure,
    target: &Figure,
    vertex: GivenVertex,
) -> (Point, Point) {
    let class = |v: u32| target.welded.class[v as usize];
    let own_class = class(vertex.0);
    let faces = target.faces.iter();
    let at = faces.filter(|f| f.iter().any(|&v| class(v) == own_class));
    let others = at.flatten().filter(|&&v| class(v) != own_class);
    let (mut count, mut own, mut images) = (0.0, [0.0; 3], [0.0; 3]);
    for &v in others {
        let corners = source.faces[found.map.faces[v as usize] as usize];
        let image = blend(
            corners.map(|c| source.place(GivenVertex(c))),
            found.map.barycentric[v as usize],
        );
        own = vector::add(own, target.place(GivenVertex(v)));
        images = vector::add(images, image);
        count += 1.0;
    }
    (
        vector::scaled(own, 1.0 / count),
        vector::scaled(images, 1.0 / count),
    )
}

fn at_most_amber(grade: Grade) -> Grade {
    if grade == Grade::Green {
        Grade::Amber
    } else {
        grade
    }
}
