//! Bones that the surface does not place, each by one that is placed.

use std::ops::Deref;

use super::rest::Rest;
use super::whole_body::WholeBody;
use super::{Bone, Bones};
use crate::algebra::vector::{self, Point};
use crate::transfer::joints::Joint;
use crate::transfer::settings::BONES;

/// Bones on their way to the target.
#[derive(Debug)]
pub struct Placing<'a> {
    bones: &'a Bones<'a>,
    rest: &'a Rest,
    /// Those that each bone leads.
    led: Vec<Vec<usize>>,
    placed: Vec<Option<Bone>>,
    /// Numbers of those placed by the surface or beside such ones, in the order in which they were.
    firm: Vec<usize>,
    /// Where each joint is in the target, once that is known.
    settled: Vec<Option<Point>>,
}

/// How a bone was moved: its ends, and the turn and scale of what it goes with.
struct Moved<'a> {
    ends: [Point; 2],
    turn: &'a [Point; 3],
    scale: f64,
    firm: bool,
    /// Whether it runs along what it goes with, and keeps its direction.
    parallel: bool,
}

impl<'a> Placing<'a> {
    /// With joints where they are fitted, and no bone placed.
    #[must_use]
    pub fn new(bones: &'a Bones<'a>, rest: &'a Rest, fitted: &[Option<Joint>]) -> Self {
        let mut led = vec![Vec::new(); rest.ends.len()];
        for &[bone, other] in bones.leads {
            led[bone as usize].push(other as usize);
        }
        Self {
            bones,
            rest,
            led,
            placed: vec![None; rest.ends.len()],
            firm: Vec::new(),
            settled: (fitted.iter())
                .map(|joint| joint.map(|joint| joint.position))
                .collect(),
        }
    }

    /// Places one bone.
    pub fn place(&mut self, bone: usize, placed: Bone) {
        self.placed[bone] = Some(placed);
        if placed.firm {
            self.firm.push(bone);
        }
    }

    /// All bones, once they are placed.
    ///
    /// # Panics
    /// Where `place_others` was not called before.
    #[must_use]
    pub fn all(self) -> Vec<Bone> {
        let placed = self.placed.into_iter();
        placed
            .map(|bone| bone.expect("the others were placed"))
            .collect()
    }

    /// Places the bones that are not yet, `order` with parents before their children; joints that are settled stay.
    ///
    /// `body` is asked for only where a bone goes with it.
    pub fn place_others<'b>(
        &mut self,
        order: Vec<usize>,
        body: &impl Deref<Target = WholeBody<'b>>,
    ) {
        let mut pending = order;
        pending.retain(|&bone| self.placed[bone].is_none());
        while !pending.is_empty() {
            let before = pending.len();
            pending.retain(|&bone| {
                let by = self.firm_one(bone);
                if let Some(by) = by {
                    self.place_beside(bone, by);
                }
                by.is_none()
            });
            if pending.len() == before {
                // Nothing firm is near: the topmost bone goes with what is above it, or with the body.
                let bone = pending.remove(0);
                let above = self.above(bone).find(|&b| self.placed[b].is_some());
                match above {
                    Some(by) => self.place_beside(bone, by),
                    None => self.place_with(bone, body),
                }
            }
        }
    }

    /// The bones above one, its parent first.
    fn above(&self, bone: usize) -> impl Iterator<Item = usize> + use<'a> {
        let parents = self.bones.rig.parents;
        let parent = move |&bone: &usize| usize::try_from(parents[bone]).ok();
        std::iter::successors(parent(&bone), parent)
    }

    /// The bone, placed by the surface, by which another one is placed.
    fn firm_one(&self, own: usize) -> Option<usize> {
        let Rest { axes, lengths, .. } = self.rest;
        let head = self.rest.joints[own][0];
        let firm = || self.firm.iter().copied();
        let beside = firm().filter(|&bone| self.rest.joints[bone][0] == head);
        // How much two bones of one head point alike, in steps, and how little they are alike in length.
        let unlike = |bone: usize| {
            let cosine = vector::dot(axes[own][1], axes[bone][1]);
            let steps = (cosine / BONES.alike).round() as i64;
            (-steps, (lengths[own] / lengths[bone]).ln().abs())
        };
        let nearest = beside
            .map(|bone| (unlike(bone), bone))
            .min_by(|(a, _), (b, _)| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        if let Some((_, bone)) = nearest {
            return Some(bone);
        }
        let ends_there = |bone: &usize| self.rest.joints[*bone][1] == head;
        let is_firm = |&bone: &usize| self.placed[bone].is_some_and(|placed| placed.firm);
        let parent = self.above(own).take(1).filter(is_firm).find(ends_there);
        let ending = || firm().find(ends_there);
        let above = || self.above(own).find(is_firm);
        parent
            .or_else(ending)
            .or_else(above)
            .or_else(|| self.led_one(own))
    }

    /// The nearest firm bone that another leads: a control of the trunk leads limbs too, and what it leads nearby, and on
    /// its side, tells where it is.
    fn led_one(&self, own: usize) -> Option<usize> {
        let sided = self.bones.sided;
        let head = self.rest.ends[own][0];
        let gap = |bone: usize| {
            let [a, b] = self.rest.ends[bone].map(|end| vector::distance(end, head));
            a.min(b)
        };
        let led = self.led[own].iter().copied();
        led.filter(|&bone| self.placed[bone].is_some_and(|placed| placed.firm))
            .map(|bone| (sided[bone] != sided[own], gap(bone), bone))
            .min_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)))
            .map(|(_, _, bone)| bone)
    }

    /// A bone that keeps how it stands to another one, from that end of the other one which is nearer.
    fn place_beside(&mut self, own: usize, other: usize) {
        let by = self.placed[other].expect("it is asked for among those that are placed");
        let rest = self.rest;
        let [to_head, to_tail] =
            rest.ends[other].map(|end| vector::distance(end, rest.ends[own][0]));
        let (anchor, there) = if to_tail < to_head {
            (rest.ends[other][1], by.tail)
        } else {
            (rest.ends[other][0], by.head)
        };
        let ends = rest.ends[own].map(|end| {
            let turned = vector::by_rows(&by.turn, vector::sub(end, anchor));
            vector::add(there, vector::scaled(turned, by.scale))
        });
        let cosine = vector::dot(rest.axes[own][1], rest.axes[other][1]);
        let moved = Moved {
            ends,
            turn: &by.turn,
            scale: by.scale,
            firm: by.firm,
            parallel: rest.joints[own][0] == rest.joints[other][0] && cosine > BONES.parallel,
        };
        self.settle(own, &moved);
    }

    /// A bone that goes with the whole body, from the nearest part of it.
    fn place_with(&mut self, own: usize, body: &WholeBody<'_>) {
        let moved = Moved {
            ends: body.moved(self.rest.ends[own]),
            turn: &body.turn,
            scale: body.scale,
            firm: false,
            parallel: false,
        };
        self.settle(own, &moved);
    }

    /// Places a bone whose ends were moved, but for joints that are settled; what it ends in is settled then.
    fn settle(&mut self, own: usize, moved: &Moved<'_>) {
        let [head, tail] = self.rest.joints[own];
        let begin = *self.settled[head].get_or_insert(moved.ends[0]);
        let mut end = vector::add(begin, vector::sub(moved.ends[1], moved.ends[0]));
        if !moved.parallel {
            end = *self.settled[tail].get_or_insert(end);
        }
        let bone = (self.rest).laid(own, [begin, end], moved.turn, moved.scale, moved.firm);
        self.place(own, bone);
    }
}
