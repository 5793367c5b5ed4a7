//! Numbers of a vertex on its way from the caller to the mesh on which a map is sought, and among samples.

use crate::algebra::numbering::numbering;

numbering! {
    /// A vertex as the caller numbers it.
    GivenVertex;
    /// A vertex as the intake was given it, before it was checked: of the given mesh with vertices at one place joined,
    /// of an envelope, or of the mesh that a piece was cut from.
    InputVertex;
    /// A vertex of the checked mesh in the resolution in which it was given.
    CheckedVertex;
    /// A vertex of the mesh on which a map is sought: the checked one, a simplified or a finer one.
    WorkingVertex;
    /// The place of a vertex in a list of samples, which stand for all: those of a shape are its farthest points.
    Sample;
}
