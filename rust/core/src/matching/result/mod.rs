//! What a match gives: the dense map in the numbering of the given meshes and its confidence.

pub mod confidence;
pub mod correspondence;
pub mod settings;
