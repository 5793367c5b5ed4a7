//! The queue of a march: smallest distance first.

use std::cmp::Reverse;

use crate::algebra::packed::{packed, unpacked};

/// Buckets to one mean edge: about ten vertices of a front of some hundred share one.
const BUCKETS_PER_EDGE: f32 = 32.0;

/// Buckets ahead of the front, a power of two: eight mean edges. Longer leaps wait elsewhere.
const BUCKETS: usize = 256;

/// Vertices by distance, then by id, in exact order.
///
/// Entries are sorted coarsely into buckets ahead of the front, and in full once the front is in their bucket: a bucket
/// holds few. Entries that are out of date by then are left out.
#[derive(Debug, Clone)]
pub(super) struct FrontQueue {
    /// Buckets to a unit of distance.
    per_unit: f32,
    /// Number of the bucket that is sorted.
    current: u32,
    /// Packed entries of the current bucket and all before, the least last.
    sorted: Vec<u64>,
    buckets: Vec<Vec<u64>>,
    /// Entries in `buckets`.
    waiting: usize,
    /// Entries beyond the last bucket.
    beyond: Vec<u64>,
}

impl FrontQueue {
    pub(super) fn new(mean_edge: f32) -> Self {
        let per_unit = BUCKETS_PER_EDGE / mean_edge;
        Self {
            per_unit: if per_unit.is_finite() { per_unit } else { 0.0 },
            current: 0,
            sorted: Vec::new(),
            buckets: vec![Vec::new(); BUCKETS],
            waiting: 0,
            beyond: Vec::new(),
        }
    }

    pub(super) fn clear(&mut self) {
        self.current = 0;
        self.sorted.clear();
        self.beyond.clear();
        if self.waiting > 0 {
            self.buckets.iter_mut().for_each(Vec::clear);
            self.waiting = 0;
        }
    }

    #[inline]
    pub(super) fn push(&mut self, distance: f32, vertex: u32) {
        let key = packed(distance, vertex);
        let bucket = self.bucket_of(distance);
        if bucket <= self.current {
            let place = self.sorted.partition_point(|&other| other > key);
            self.sorted.insert(place, key);
        } else if (bucket - self.current) < BUCKETS as u32 {
            self.buckets[bucket as usize % BUCKETS].push(key);
            self.waiting += 1;
        } else {
            self.beyond.push(key);
        }
    }

    /// The first entry for which `valid(distance, vertex)` holds.
    #[inline]
    pub(super) fn pop(&mut self, valid: impl Fn(f32, u32) -> bool) -> Option<u32> {
        loop {
            while let Some(key) = self.sorted.pop() {
                let (distance, vertex) = unpacked(key);
                if valid(distance, vertex) {
                    return Some(vertex);
                }
            }
            if !self.advance(&valid) {
                return None;
            }
        }
    }

    /// Moves on to the next bucket with entries; false when there are none left.
    fn advance(&mut self, valid: &impl Fn(f32, u32) -> bool) -> bool {
        if self.waiting == 0 {
            if self.beyond.is_empty() {
                return false;
            }
            let least = self.beyond.iter().copied().fold(u64::MAX, u64::min);
            self.current = self.bucket_of(unpacked(least).0);
            let beyond = std::mem::take(&mut self.beyond);
            for &key in &beyond {
                let (distance, vertex) = unpacked(key);
                if valid(distance, vertex) {
                    self.push(distance, vertex);
                }
            }
            return true;
        }
        self.current += 1;
        // Those beyond may have come into reach; they are few, and looked at twice a turn.
        if !self.beyond.is_empty() {
            self.recall();
        }
        let bucket = &mut self.buckets[self.current as usize % BUCKETS];
        self.waiting -= bucket.len();
        for &key in bucket.iter() {
            let (distance, vertex) = unpacked(key);
            if valid(distance, vertex) {
                self.sorted.push(key);
            }
        }
        bucket.clear();
        self.sorted.sort_unstable_by_key(|&key| Reverse(key));
        true
    }

    /// Brings back the entries beyond the buckets, before the front overtakes them.
    fn recall(&mut self) {
        if !self.current.is_multiple_of(BUCKETS as u32 / 2) {
            return;
        }
        let beyond = std::mem::take(&mut self.beyond);
        for &key in &beyond {
            let (distance, vertex) = unpacked(key);
            self.push(distance, vertex);
        }
    }

    #[inline]
    #[expect(clippy::cast_sign_loss, reason = "distances are not negative")]
    fn bucket_of(&self, distance: f32) -> u32 {
        // Saturates for distances of very many edges, which only makes that bucket larger.
        (distance * self.per_unit) as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::fractions;

    #[test]
    fn entries_leave_in_order_near_and_far() {
        // Leaps of up to 40 mean edges, so that entries pass through the sorted bucket, the others and
        // beyond; every fifth one is lowered before its turn and must leave once, at its new place.
        let mut draw = fractions(7);
        let mut queue = FrontQueue::new(1.0);
        let mut distance = vec![0.0f32; 5000];
        for _ in 0..2 {
            queue.clear();
            let mut next = 0;
            let mut now = 0.0f32;
            let mut left = 0;
            loop {
                for _ in 0..3 {
                    if next < distance.len() {
                        let leap = draw();
                        distance[next] = now + if draw() < 0.1 { 40.0 } else { 1.0 } * leap;
                        queue.push(distance[next], next as u32);
                        if next % 5 == 0 {
                            distance[next] = now + 0.5 * leap.min(0.9);
                            queue.push(distance[next], next as u32);
                        }
                        next += 1;
                    }
                }
                let valid = |d: f32, v: u32| distance[v as usize].to_bits() == d.to_bits();
                let Some(v) = queue.pop(valid) else { break };
                assert!(distance[v as usize] >= now);
                now = distance[v as usize];
                left += 1;
            }
            assert_eq!(left, distance.len());
        }
    }
}
