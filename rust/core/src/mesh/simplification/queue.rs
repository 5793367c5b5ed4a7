//! The order in which vertices go.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use crate::algebra::packed::{packed, unpacked};

/// Vertices by what they wait for, then by number, in exact order; what is pushed is never less than what was popped
/// last.
///
/// The next few are a heap, all others lie in buckets by the leading bits of their keys, so that a million of them are
/// each moved twice.
pub(super) struct Queue {
    next: BinaryHeap<Reverse<u64>>,
    /// Number of the bucket that was made the heap.
    current: usize,
    buckets: Vec<Vec<u64>>,
}

impl Queue {
    /// Bits that keys of one bucket may differ in: they are equal to a 128th.
    const WITHIN: u32 = 48;

    pub(super) fn new() -> Self {
        Self {
            next: BinaryHeap::new(),
            current: 0,
            // Keys are not negative: their first bit is zero.
            buckets: vec![Vec::new(); 1 << (u64::BITS - Self::WITHIN - 1)],
        }
    }

    pub(super) fn push(&mut self, key: f32, vertex: u32) {
        let key = packed(key, vertex);
        let bucket = (key >> Self::WITHIN) as usize;
        if bucket > self.current {
            self.buckets[bucket].push(key);
        } else {
            self.next.push(Reverse(key));
        }
    }

    pub(super) fn pop(&mut self) -> Option<(f32, u32)> {
        while self.next.is_empty() {
            self.current += 1;
            let bucket = std::mem::take(self.buckets.get_mut(self.current)?);
            self.next.extend(bucket.into_iter().map(Reverse));
        }
        self.next.pop().map(|Reverse(key)| unpacked(key))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::fractions;

    #[test]
    fn vertices_leave_in_order_however_far_apart_their_keys_are() {
        let mut draw = fractions(7);
        let mut queue = Queue::new();
        let mut waiting = BinaryHeap::new();
        // Twelve powers of ten, zeros and equal keys.
        for vertex in 0..3000 {
            let key = match vertex % 10 {
                0 => 0.0,
                1 => 0.5,
                _ => 10.0f32.powf(-12.0 * draw()),
            };
            queue.push(key, vertex);
            waiting.push(Reverse((key.to_bits(), vertex)));
        }
        let mut left = 0;
        while let Some((key, vertex)) = queue.pop() {
            left += 1;
            let Some(Reverse(expected)) = waiting.pop() else {
                panic!("more than were pushed");
            };
            assert_eq!((key.to_bits(), vertex), expected);
            // A third waits again, a little or much longer.
            if left < 6000 && draw() < 1.0 / 3.0 {
                let later = key * (1.0 + draw().powi(8) * 1e3) + f32::MIN_POSITIVE;
                queue.push(later, vertex);
                waiting.push(Reverse((later.to_bits(), vertex)));
            }
        }
        assert!(waiting.is_empty() && left > 3000);
    }
}
