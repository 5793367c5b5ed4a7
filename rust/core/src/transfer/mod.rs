//! Data carried from source to target through a map.
//!
//! A [`SurfaceMap`] holds both surfaces in their own units and, for every target vertex, a point of
//! the source. Each kind of data has a module.

pub mod bones;
pub mod coincidence;
pub mod contacts;
pub mod corners;
pub mod counterparts;
pub mod curves;
pub mod diffusion;
pub mod displacement;
pub mod frame;
pub mod frames;
pub mod joints;
pub mod labels;
pub mod layout;
pub mod normal_maps;
pub mod outfit;
pub mod parts;
pub mod poses;
pub mod seam_cuts;
pub mod settings;
pub mod skin_weights;
pub mod strands;
pub mod surface;
pub mod surface_map;
pub mod texture;
pub mod trace;
pub mod values;

pub use surface::Surface;
pub use surface_map::SurfaceMap;
pub use values::transfer;
