//! The core as its callers see it, in one program: each one more would be linked with all of the core again.

mod common;

mod chain;
mod coinciding;
mod geodesics;
mod regions;
mod reliability;
mod simplification;
mod spectral_gmds;
mod spectrum;
mod symmetry;
