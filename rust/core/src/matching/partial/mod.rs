//! Maps between a part and a whole: where the part lies, how large it is there, and what it leaves uncovered.

pub(in crate::matching) mod location;
pub(in crate::matching) mod of_part;
mod relocation;
mod search;
pub mod settings;
pub(in crate::matching) mod uncovered;
