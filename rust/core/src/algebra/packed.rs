//! A number and an id as one integer, for queues.

/// Integers in the order of `key`, not negative, then of `id`.
#[inline]
pub(crate) fn packed(key: f32, id: u32) -> u64 {
    // Bits of non-negative floats are in the order of the floats.
    u64::from(key.to_bits()) << 32 | u64::from(id)
}

/// The number and the id.
#[inline]
pub(crate) fn unpacked(packed: u64) -> (f32, u32) {
    (f32::from_bits((packed >> 32) as u32), packed as u32)
}
