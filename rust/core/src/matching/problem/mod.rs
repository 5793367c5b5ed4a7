//! What is asked: two shapes, and what is known of the map between them.

pub mod constraints;
pub mod landmark;
pub mod pair;
pub mod point_map;
pub mod settings;
pub mod which;
