//! Binding of `sgmds_core::transfer`; `sgmds.transfer` wraps it and checks shapes and types.

use std::sync::{Arc, OnceLock};

use numpy::{
    Element, IntoPyArray, PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray1,
    PyReadonlyArray2, PyReadonlyArray3,
};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use sgmds_core::Error;
use sgmds_core::transfer::bones::{Bone, Bones, Mirrors, fitted_bones};
use sgmds_core::transfer::coincidence::{Corners, coincidence};
use sgmds_core::transfer::contacts;
use sgmds_core::transfer::corners::{self, CornerValues, Polygons};
use sgmds_core::transfer::diffusion::Diffusion;
use sgmds_core::transfer::frame::Affine;
use sgmds_core::transfer::joints::fitted_joints;
use sgmds_core::transfer::normal_maps::{FixedSpace, TangentSpace};
use sgmds_core::transfer::outfit::bodies::Bodies;
use sgmds_core::transfer::outfit::bone_map::{Rig, bone_map};
use sgmds_core::transfer::outfit::guidance::{Skeleton, guided};
use sgmds_core::transfer::outfit::settings::Settings;
use sgmds_core::transfer::outfit::{self, Sitting};
use sgmds_core::transfer::seam_cuts::seam_cuts;
use sgmds_core::transfer::settings::LAYOUT;
use sgmds_core::transfer::skin_weights::{Locked, SkinOptions, SkinWeights, carried_skin};
use sgmds_core::transfer::strands::Root;
use sgmds_core::transfer::texture::{self, Bake, Content, Extension, Image, Texture, Tile};
use sgmds_core::transfer::{self, Surface, curves, displacement, labels, layout};

use crate::errors;
use crate::triples;
use crate::watched::watched;

type Array1<'py, T> = Bound<'py, PyArray1<T>>;
type Array2<'py, T> = Bound<'py, PyArray2<T>>;
type Array3<'py, T> = Bound<'py, PyArray3<T>>;
/// Starts, groups, weights and the vertices filled.
type SkinRows<'py> = (
    Array1<'py, i64>,
    Array1<'py, i64>,
    Array1<'py, f64>,
    Array1<'py, i64>,
);

fn pairs<T: Element + Copy>(array: &PyReadonlyArray2<'_, T>) -> PyResult<Vec<[T; 2]>> {
    Ok(array.as_slice()?.as_chunks().0.to_vec())
}

/// `(n, 3, K)` as n triangles of corners.
pub(crate) fn corners_of<const K: usize>(
    array: &PyReadonlyArray3<'_, f64>,
) -> PyResult<Vec<[[f64; K]; 3]>> {
    let rows: &[[f64; K]] = array.as_slice()?.as_chunks().0;
    Ok(rows.as_chunks().0.to_vec())
}

pub(crate) fn table<T: Element, const K: usize>(
    py: Python<'_>,
    rows: Vec<[T; K]>,
) -> PyResult<Bound<'_, PyArray2<T>>> {
    let count = rows.len();
    rows.into_iter()
        .flatten()
        .collect::<Vec<T>>()
        .into_pyarray(py)
        .reshape([count, K])
}

/// Matrices (n, 3, 3) by rows.
pub(crate) fn matrices(
    py: Python<'_>,
    rows: impl ExactSizeIterator<Item = [[f64; 3]; 3]>,
) -> PyResult<Array3<'_, f64>> {
    let count = rows.len();
    let flat: Vec<f64> = rows.flat_map(|m| m.into_iter().flatten()).collect();
    flat.into_pyarray(py).reshape([count, 3, 3])
}

fn whole(ids: impl IntoIterator<Item = u32>) -> Vec<i64> {
    ids.into_iter().map(i64::from).collect()
}

/// Two surfaces and a map between them.
#[pyclass(frozen, module = "sgmds._core")]
pub struct SurfaceMap {
    pub(crate) map: Arc<transfer::SurfaceMap>,
    /// What garments need of the two bodies, made for the first.
    bodies: OnceLock<Arc<Bodies>>,
}

/// A garment bound to the bodies of a map.
#[pyclass(frozen, module = "sgmds._core")]
pub struct Fitting {
    fitting: Arc<outfit::Fitting>,
}

/// Starts, bones and weights of rows of vertices, and the parent of each bone.
type GivenRig = (Vec<u32>, Vec<u32>, Vec<f64>, Vec<i64>);

fn checked_rig(given: GivenRig) -> Result<(SkinWeights, Vec<i64>), Error> {
    let (starts, bones, weights, parents) = given;
    let skin = SkinWeights::new(starts, bones, weights, parents.len())?;
    Ok((skin, parents))
}

fn as_rig(checked: &(SkinWeights, Vec<i64>)) -> Rig<'_> {
    Rig {
        skin: &checked.0,
        parents: &checked.1,
    }
}

#[pymethods]
impl Fitting {
    /// Where the garments' vertices lie on the target, (n, 3).
    fn place<'py>(
        &self,
        py: Python<'py>,
        distance: f64,
        tightness: f64,
        collide: bool,
    ) -> PyResult<Array2<'py, f64>> {
        let fitting = Arc::clone(&self.fitting);
        let sitting = Sitting {
            distance,
            tightness,
            collide,
        };
        let placed = watched(py, None, None, move |state| {
            fitting.place(&sitting, &|| state.check())
        })?;
        table(py, placed)
    }

    /// Distance to the target that each vertex keeps at least.
    fn gaps<'py>(
        &self,
        py: Python<'py>,
        distance: f64,
        tightness: f64,
    ) -> PyResult<Array1<'py, f64>> {
        let sitting = Sitting {
            distance,
            tightness,
            collide: true,
        };
        let gaps = self
            .fitting
            .gaps(&sitting)
            .map_err(|e| errors::to_python(py, &e))?;
        Ok(gaps.into_pyarray(py))
    }

    /// Signed distance to the target of each vertex at positions (n, 3).
    fn clearance<'py>(
        &self,
        py: Python<'py>,
        positions: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<Array1<'py, f64>> {
        let (fitting, positions) = (Arc::clone(&self.fitting), triples(&positions)?);
        let found = watched(py, None, None, move |_| fitting.clearance(&positions))?;
        Ok(found.into_pyarray(py))
    }

    /// Signed distance to the source of each vertex, in the target's units.
    fn clearance_before<'py>(&self, py: Python<'py>) -> Array1<'py, f64> {
        self.fitting.clearance_before().into_pyarray(py)
    }

    /// Displacements of the vertices (n, 3) on the source as on the target.
    fn displacements<'py>(
        &self,
        py: Python<'py>,
        offsets: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<Array2<'py, f64>> {
        let (fitting, offsets) = (Arc::clone(&self.fitting), triples(&offsets)?);
        let carried = watched(py, None, None, move |_| fitting.displacements(&offsets))?;
        table(py, carried)
    }

    /// Which of the target's vertices the garments hide at positions (n, 3).
    fn hidden<'py>(
        &self,
        py: Python<'py>,
        positions: PyReadonlyArray2<'py, f64>,
        reach: f64,
        margin: f64,
    ) -> PyResult<Array1<'py, bool>> {
        let (fitting, positions) = (Arc::clone(&self.fitting), triples(&positions)?);
        let found = watched(py, None, None, move |_| {
            fitting.hidden(&positions, reach, margin)
        })?;
        Ok(found.into_pyarray(py))
    }

    /// The map from the target to the garments at positions (n, 3), with triangles (m, 3).
    fn on_target(
        &self,
        py: Python<'_>,
        positions: PyReadonlyArray2<'_, f64>,
        triangles: PyReadonlyArray2<'_, i64>,
    ) -> PyResult<SurfaceMap> {
        let fitting = Arc::clone(&self.fitting);
        let (positions, triangles) = (triples(&positions)?, triples(&triangles)?);
        let map = watched(py, None, None, move |_| {
            fitting.on_target(&positions, &triangles)
        })?;
        Ok(SurfaceMap {
            map: Arc::new(map),
            bodies: OnceLock::new(),
        })
    }
}

#[pymethods]
impl SurfaceMap {
    #[new]
    #[expect(
        clippy::too_many_arguments,
        reason = "keyword arguments of the Python function"
    )]
    fn new(
        py: Python<'_>,
        source_vertices: PyReadonlyArray2<'_, f64>,
        source_triangles: PyReadonlyArray2<'_, i64>,
        target_vertices: PyReadonlyArray2<'_, f64>,
        target_triangles: PyReadonlyArray2<'_, i64>,
        faces: Vec<i64>,
        barycentric: PyReadonlyArray2<'_, f64>,
        confidence: Vec<f64>,
    ) -> PyResult<Self> {
        let source = (triples(&source_vertices)?, triples(&source_triangles)?);
        let target = (triples(&target_vertices)?, triples(&target_triangles)?);
        let weights = triples(&barycentric)?;
        let map = watched(py, None, None, move |_| {
            let (source, target) = rayon::join(
                || Surface::new(source.0, &source.1),
                || Surface::new(target.0, &target.1),
            );
            transfer::SurfaceMap::new(source?, target?, &faces, &weights, confidence)?
                .on_counterparts(0.0)
        })?;
        Ok(Self {
            map: Arc::new(map),
            bodies: OnceLock::new(),
        })
    }

    /// Binds a garment, vertices (n, 3) and triangles (m, 3), to the two bodies.
    fn bind(
        &self,
        py: Python<'_>,
        vertices: PyReadonlyArray2<'_, f64>,
        triangles: PyReadonlyArray2<'_, i64>,
        stiff: Option<Vec<bool>>,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Fitting> {
        let (map, known) = (Arc::clone(&self.map), self.bodies.get().cloned());
        let (vertices, triangles) = (triples(&vertices)?, triples(&triangles)?);
        let (bodies, fitting) = watched(py, progress, None, move |state| {
            state.enter("garments", 0.0)?;
            let settings = Settings::default();
            let bodies = match known {
                Some(bodies) => bodies,
                None => Arc::new(Bodies::new(map, &settings)?),
            };
            let fitting = outfit::Fitting::new(
                Arc::clone(&bodies),
                &vertices,
                &triangles,
                stiff.as_deref().unwrap_or_default(),
                settings,
                &|| state.check(),
            )?;
            Ok((bodies, fitting))
        })?;
        // Another thread's are the same.
        self.bodies.get_or_init(|| bodies);
        Ok(Fitting {
            fitting: Arc::new(fitting),
        })
    }

    /// For each bone of the source its partner on the target or −1, their share, and the nearest bone or −1.
    ///
    /// A rig is starts, bones and weights of rows of vertices, and the parent of each bone.
    fn bones<'py>(
        &self,
        py: Python<'py>,
        source: GivenRig,
        target: GivenRig,
    ) -> PyResult<(Array1<'py, i64>, Array1<'py, f64>, Array1<'py, i64>)> {
        let map = Arc::clone(&self.map);
        let found = watched(py, None, None, move |_| {
            let (source, target) = (checked_rig(source)?, checked_rig(target)?);
            bone_map(&map, as_rig(&source), as_rig(&target))
        })?;
        let number = |bone: Option<u32>| bone.map_or(-1, i64::from);
        let each = found.iter();
        let partners: Vec<i64> = each.clone().map(|p| number(p.bone)).collect();
        let shares: Vec<f64> = each.clone().map(|p| p.share).collect();
        let nearest: Vec<i64> = each.map(|p| number(p.nearest)).collect();
        Ok((
            partners.into_pyarray(py),
            shares.into_pyarray(py),
            nearest.into_pyarray(py),
        ))
    }

    /// The map in which doubtful vertices lie where the rigs put them; a rig as in `bones`, heads of its bones (n, 3).
    fn guided(
        &self,
        py: Python<'_>,
        source: GivenRig,
        target: GivenRig,
        source_heads: PyReadonlyArray2<'_, f64>,
        target_heads: PyReadonlyArray2<'_, f64>,
    ) -> PyResult<Self> {
        let map = Arc::clone(&self.map);
        let (heads_1, heads_2) = (triples(&source_heads)?, triples(&target_heads)?);
        let found = watched(py, None, None, move |_| {
            let (source, target) = (checked_rig(source)?, checked_rig(target)?);
            let skeleton = |rig, heads| Skeleton { rig, heads };
            guided(
                &map,
                skeleton(as_rig(&source), &heads_1),
                skeleton(as_rig(&target), &heads_2),
            )
        })?;
        Ok(Self {
            map: Arc::new(found),
            bodies: OnceLock::new(),
        })
    }

    /// Source triangle of each target vertex, small parts on their counterparts.
    #[getter]
    fn faces<'py>(&self, py: Python<'py>) -> Array1<'py, i64> {
        whole(self.map.points.iter().map(|p| p.face)).into_pyarray(py)
    }

    /// Weights of that triangle's corners.
    #[getter]
    fn barycentric<'py>(&self, py: Python<'py>) -> PyResult<Array2<'py, f64>> {
        table(py, self.map.points.iter().map(|p| p.weights).collect())
    }

    /// Confidence of each target vertex.
    #[getter]
    fn confidence<'py>(&self, py: Python<'py>) -> Array1<'py, f64> {
        self.map.confidence.clone().into_pyarray(py)
    }

    /// Points beside the source (n, 3) where the target takes them, pieces with one number together.
    fn followed<'py>(
        &self,
        py: Python<'py>,
        points: PyReadonlyArray2<'py, f64>,
        pieces: Vec<i64>,
    ) -> PyResult<Array2<'py, f64>> {
        let (map, points) = (Arc::clone(&self.map), triples(&points)?);
        let moved = watched(py, None, None, move |_| map.followed(&points, &pieces))?;
        table(py, moved)
    }

    /// Points of hair (n, 3), each of one of the strands whose roots are given: where they go, and for each
    /// strand its scale, target triangle, weights of that triangle's corners and confidence.
    #[expect(clippy::type_complexity, reason = "one array for each")]
    fn strands<'py>(
        &self,
        py: Python<'py>,
        roots: PyReadonlyArray2<'py, f64>,
        points: PyReadonlyArray2<'py, f64>,
        strands: Vec<u32>,
    ) -> PyResult<(
        Array2<'py, f64>,
        Array1<'py, f64>,
        Array1<'py, i64>,
        Array2<'py, f64>,
        Array1<'py, f64>,
    )> {
        let (map, places) = (Arc::clone(&self.map), triples(&roots)?);
        let points = triples(&points)?;
        let (roots, moved) = watched(py, None, None, move |_| {
            let roots = map.roots(&places)?;
            let moved = points.iter().zip(&strands);
            let moved: Vec<[f64; 3]> = moved.map(|(&p, &s)| roots[s as usize].apply(p)).collect();
            Ok((roots, moved))
        })?;
        let each = |pick: fn(&Root) -> f64| roots.iter().map(pick).collect::<Vec<f64>>();
        Ok((
            table(py, moved)?,
            each(|r| r.frame.scale).into_pyarray(py),
            whole(roots.iter().map(|r| r.point.face)).into_pyarray(py),
            table(py, roots.iter().map(|r| r.point.weights).collect())?,
            each(|r| r.confidence).into_pyarray(py),
        ))
    }

    /// Images of the target's vertices in space, (n, 3).
    fn images<'py>(&self, py: Python<'py>) -> PyResult<Array2<'py, f64>> {
        table(py, self.map.images().to_vec())
    }

    /// Turn (n, 3, 3) and scale (n,) at each target vertex.
    fn frames<'py>(&self, py: Python<'py>) -> PyResult<(Array3<'py, f64>, Array1<'py, f64>)> {
        let map = Arc::clone(&self.map);
        let frames = watched(py, None, None, move |_| Ok(map.frames().to_vec()))?;
        let scales: Vec<f64> = frames.iter().map(|f| f.scale).collect();
        Ok((
            matrices(py, frames.iter().map(|f| f.turn))?,
            scales.into_pyarray(py),
        ))
    }

    /// Displacements of the source's vertices (n, 3) as the target's.
    fn displacements<'py>(
        &self,
        py: Python<'py>,
        offsets: PyReadonlyArray2<'py, f64>,
        turn_only: bool,
        keep_contacts: bool,
    ) -> PyResult<Array2<'py, f64>> {
        let (map, offsets) = (Arc::clone(&self.map), triples(&offsets)?);
        let carried = watched(py, None, None, move |_| {
            let carried = displacement::displacements(&map, &offsets, turn_only)?;
            if keep_contacts && !turn_only {
                return contacts::kept(&map, &offsets, carried);
            }
            Ok(carried)
        })?;
        table(py, carried)
    }

    /// UVs at the target's corners, the source island of each face, and which faces straddle a seam.
    fn layout<'py>(
        &self,
        py: Python<'py>,
        starts: Vec<i64>,
        corner_vertices: Vec<i64>,
        uv: PyReadonlyArray3<'py, f64>,
    ) -> PyResult<(Array2<'py, f64>, Array1<'py, i64>, Array1<'py, bool>)> {
        let (map, uv) = (Arc::clone(&self.map), corners_of::<2>(&uv)?);
        let found = watched(py, None, None, move |_| {
            let faces = Polygons::new(&starts, &corner_vertices, &map.target)?;
            layout::carried_layout(&map, &faces, uv.as_flattened())
        })?;
        Ok((
            table(py, found.uv)?,
            whole(found.island).into_pyarray(py),
            found.straddles.into_pyarray(py),
        ))
    }

    /// Cuts of the target's faces along borders of values at the corners of the source's triangles (m, 3, c).
    fn seam_cuts<'py>(
        &self,
        py: Python<'py>,
        starts: Vec<i64>,
        corner_vertices: Vec<i64>,
        values: PyReadonlyArray3<'py, f64>,
        tolerance: f64,
    ) -> PyResult<Bound<'py, PyDict>> {
        let map = Arc::clone(&self.map);
        let channels = values.as_array().shape()[2];
        let values = values.as_slice()?.to_vec();
        let found = watched(py, None, None, move |_| {
            let faces = Polygons::new(&starts, &corner_vertices, &map.target)?;
            let values = CornerValues {
                values: &values,
                channels,
                tolerance,
            };
            seam_cuts(&map, &faces, &values)
        })?;
        let points = found.points.iter();
        let edges = points
            .clone()
            .map(|p| p.edge.map_or([-1; 2], |e| e.map(i64::from)));
        let cuts = found
            .cuts
            .iter()
            .map(|c| [c.face, c.ends[0], c.ends[1]].map(i64::from));
        let shares: Vec<f64> = points.clone().map(|p| p.share).collect();
        let moved = found.moved.iter();
        let dict = PyDict::new(py);
        dict.set_item("edges", table(py, edges.collect())?)?;
        dict.set_item("shares", shares.into_pyarray(py))?;
        dict.set_item(
            "positions",
            table(py, points.clone().map(|p| p.position).collect())?,
        )?;
        dict.set_item(
            "faces",
            whole(points.clone().map(|p| p.image.face)).into_pyarray(py),
        )?;
        dict.set_item(
            "barycentric",
            table(py, points.map(|p| p.image.weights).collect())?,
        )?;
        dict.set_item("cuts", table(py, cuts.collect())?)?;
        dict.set_item("moved", whole(moved.clone().map(|m| m.0)).into_pyarray(py))?;
        dict.set_item(
            "moved_faces",
            whole(moved.clone().map(|m| m.1.face)).into_pyarray(py),
        )?;
        dict.set_item(
            "moved_barycentric",
            table(py, moved.map(|m| m.1.weights).collect())?,
        )?;
        Ok(dict)
    }

    /// Values at the corners of the source's triangles (m, 3, c) as values at the target's corners.
    fn corner_values<'py>(
        &self,
        py: Python<'py>,
        starts: Vec<i64>,
        corner_vertices: Vec<i64>,
        values: PyReadonlyArray3<'py, f64>,
        tolerance: f64,
        nearest: bool,
    ) -> PyResult<Array2<'py, f64>> {
        let map = Arc::clone(&self.map);
        let channels = values.as_array().shape()[2];
        let (count, values) = (corner_vertices.len(), values.as_slice()?.to_vec());
        let carried = watched(py, None, None, move |_| {
            let faces = Polygons::new(&starts, &corner_vertices, &map.target)?;
            let values = CornerValues {
                values: &values,
                channels,
                tolerance,
            };
            let mut places = corners::corner_places(&map, &faces, &values, false)?;
            if nearest {
                corners::snap(&mut places);
            }
            Ok(corners::corner_values(&places, &values))
        })?;
        carried.into_pyarray(py).reshape([count, channels])
    }

    /// Sparse weights of the source's vertices as the target's: rows and the vertices filled.
    #[expect(
        clippy::too_many_arguments,
        reason = "keyword arguments of the Python function"
    )]
    fn skin_weights<'py>(
        &self,
        py: Python<'py>,
        starts: Vec<u32>,
        groups: Vec<u32>,
        weights: Vec<f64>,
        group_count: usize,
        deforming: Vec<bool>,
        reject_below: f64,
        smoothing: usize,
        prune: f64,
        limit: Option<usize>,
        normalize: bool,
        locked: Option<(Vec<bool>, Vec<f64>, Vec<u32>)>,
    ) -> PyResult<SkinRows<'py>> {
        let map = Arc::clone(&self.map);
        let found = watched(py, None, None, move |_| {
            let source = SkinWeights::new(starts, groups, weights, group_count)?;
            let options = SkinOptions {
                groups: group_count,
                reject_below,
                smoothing,
                prune,
                limit,
                normalize,
                deforming: &deforming,
                locked: locked.as_ref().map(|(groups, sums, counts)| Locked {
                    groups,
                    sums,
                    counts,
                }),
            };
            carried_skin(&map, &source, &options)
        })?;
        Ok((
            whole(found.skin.starts).into_pyarray(py),
            whole(found.skin.groups).into_pyarray(py),
            found.skin.weights.into_pyarray(py),
            whole(found.filled).into_pyarray(py),
        ))
    }

    /// The commonest label of the source's triangles (m,) under each target face.
    fn face_labels<'py>(
        &self,
        py: Python<'py>,
        starts: Vec<i64>,
        corner_vertices: Vec<i64>,
        labels: Vec<i64>,
    ) -> PyResult<Array1<'py, i64>> {
        let map = Arc::clone(&self.map);
        let carried = watched(py, None, None, move |_| {
            let faces = Polygons::new(&starts, &corner_vertices, &map.target)?;
            labels::face_labels(&map, &faces, &labels)
        })?;
        Ok(carried.into_pyarray(py))
    }

    /// The mean of values of the source's triangles (m, c) under each target face.
    fn face_means<'py>(
        &self,
        py: Python<'py>,
        starts: Vec<i64>,
        corner_vertices: Vec<i64>,
        values: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<Array2<'py, f64>> {
        let map = Arc::clone(&self.map);
        let channels = values.as_array().shape()[1];
        let (count, values) = (starts.len().saturating_sub(1), values.as_slice()?.to_vec());
        let carried = watched(py, None, None, move |_| {
            let faces = Polygons::new(&starts, &corner_vertices, &map.target)?;
            labels::face_means(&map, &faces, &values, channels)
        })?;
        carried.into_pyarray(py).reshape([count, channels])
    }

    /// Values of the target's edges along the curves of the source's marked edges.
    fn marks<'py>(
        &self,
        py: Python<'py>,
        source_edges: PyReadonlyArray2<'py, i64>,
        values: Vec<f64>,
        target_edges: PyReadonlyArray2<'py, i64>,
    ) -> PyResult<Array1<'py, f64>> {
        let map = Arc::clone(&self.map);
        let (source_edges, target_edges) = (pairs(&source_edges)?, pairs(&target_edges)?);
        let carried = watched(py, None, None, move |_| {
            curves::carried_marks(&map, &source_edges, &values, &target_edges)
        })?;
        Ok(carried.into_pyarray(py))
    }

    /// The source's edge nearest to the image of each target edge, of those that run like it.
    fn nearest_edges<'py>(
        &self,
        py: Python<'py>,
        source_edges: PyReadonlyArray2<'py, i64>,
        target_edges: PyReadonlyArray2<'py, i64>,
    ) -> PyResult<Array1<'py, i64>> {
        let map = Arc::clone(&self.map);
        let (source_edges, target_edges) = (pairs(&source_edges)?, pairs(&target_edges)?);
        let found = watched(py, None, None, move |_| {
            curves::nearest_edges(&map, &source_edges, &target_edges)
        })?;
        Ok(whole(found).into_pyarray(py))
    }

    /// The source's joints (j, 3) in the target: position (j, 3), turn (j, 3, 3) and scale (j,).
    fn joints<'py>(
        &self,
        py: Python<'py>,
        joints: PyReadonlyArray2<'py, f64>,
        starts: Vec<u32>,
        vertices: Vec<u32>,
        weights: Vec<f64>,
    ) -> PyResult<(Array2<'py, f64>, Array3<'py, f64>, Array1<'py, f64>)> {
        let (map, joints) = (Arc::clone(&self.map), triples(&joints)?);
        let found = watched(py, None, None, move |_| {
            let count = map.source.vertices.len();
            let influence = SkinWeights::new(starts, vertices, weights, count)?;
            fitted_joints(&map, &joints, &influence)
        })?;
        let scales: Vec<f64> = found.iter().map(|j| j.scale).collect();
        Ok((
            table(py, found.iter().map(|j| j.position).collect())?,
            matrices(py, found.iter().map(|j| j.turn))?,
            scales.into_pyarray(py),
        ))
    }

    /// The bones of a rig in the target: heads, tails, axes as columns, turns, scales, and which are firm.
    ///
    /// A rig as in `bones`. `leads` are bones and those that they lead, `partners` the bones of the other side or −1,
    /// `mirrors` the reflection of the source's directions and of the target's points.
    #[expect(
        clippy::too_many_arguments,
        reason = "keyword arguments of the Python function"
    )]
    #[expect(clippy::type_complexity, reason = "one array for each")]
    fn fit_bones<'py>(
        &self,
        py: Python<'py>,
        heads: PyReadonlyArray2<'py, f64>,
        tails: PyReadonlyArray2<'py, f64>,
        ups: PyReadonlyArray2<'py, f64>,
        rig: GivenRig,
        leads: PyReadonlyArray2<'py, i64>,
        partners: Vec<i64>,
        sided: Vec<bool>,
        mirrors: Option<([[f64; 3]; 3], [[f64; 4]; 4])>,
    ) -> PyResult<(
        Array2<'py, f64>,
        Array2<'py, f64>,
        Array3<'py, f64>,
        Array3<'py, f64>,
        Array1<'py, f64>,
        Array1<'py, bool>,
    )> {
        let map = Arc::clone(&self.map);
        let (heads, tails) = (triples(&heads)?, triples(&tails)?);
        let (ups, leads) = (triples(&ups)?, pairs(&leads)?);
        let found = watched(py, None, None, move |_| {
            let rig = checked_rig(rig)?;
            let bones = Bones {
                heads: &heads,
                tails: &tails,
                ups: &ups,
                rig: as_rig(&rig),
                leads: &leads,
                partners: &partners,
                sided: &sided,
                mirrors: mirrors.map(|(source, target)| Mirrors {
                    source,
                    target: Affine::of_rows(&target),
                }),
            };
            fitted_bones(&map, &bones)
        })?;
        let columns = |bone: &Bone| [0, 1, 2].map(|i| bone.axes.map(|axis| axis[i]));
        let scales: Vec<f64> = found.iter().map(|bone| bone.scale).collect();
        let firm: Vec<bool> = found.iter().map(|bone| bone.firm).collect();
        Ok((
            table(py, found.iter().map(|bone| bone.head).collect())?,
            table(py, found.iter().map(|bone| bone.tail).collect())?,
            matrices(py, found.iter().map(columns))?,
            matrices(py, found.iter().map(|bone| bone.turn))?,
            scales.into_pyarray(py),
            firm.into_pyarray(py),
        ))
    }

    /// How the target lies on the source: a matrix (4, 4) to it, and which corners do, with triangle and weights of each.
    #[expect(clippy::type_complexity, reason = "one array for each")]
    fn coincidence<'py>(
        &self,
        py: Python<'py>,
        corner_vertices: Vec<i64>,
        triangle_corners: PyReadonlyArray2<'py, i64>,
        standing: [[f64; 4]; 4],
    ) -> PyResult<
        Option<(
            Array2<'py, f64>,
            Array1<'py, bool>,
            Array1<'py, i64>,
            Array2<'py, f64>,
        )>,
    > {
        let (map, triangles) = (Arc::clone(&self.map), triples(&triangle_corners)?);
        let found = watched(py, None, None, move |_| {
            let corners = Corners {
                vertices: &corner_vertices,
                triangles: &triangles,
            };
            coincidence(&map, &Affine::of_rows(&standing), corners)
        })?;
        let Some(found) = found else {
            return Ok(None);
        };
        Ok(Some((
            table(py, found.to_target.rows().to_vec())?,
            found.there.into_pyarray(py),
            whole(found.points.iter().map(|p| p.face)).into_pyarray(py),
            table(py, found.points.iter().map(|p| p.weights).collect())?,
        )))
    }

    /// A texture of the source baked into the target's layout, and how many texels it covers.
    ///
    /// `tiles` are the columns and rows of UV units with their images (h, w, 4). `used` are the source's and
    /// the target's triangles with the texture; by default all.
    /// `frames` are the normals (m, 3, 3) and tangents (m, 3, 4) of source and target, for tangent-space
    /// normal maps; `spaces` the matrices to the source's and from the target's coordinates for others.
    #[pyo3(signature = (source_uv, target_uv, tiles, width, height, margin, straight_alpha, extension, closest, used, frames, spaces, progress=None))]
    #[expect(
        clippy::too_many_arguments,
        reason = "keyword arguments of the Python function"
    )]
    fn bake<'py>(
        &self,
        py: Python<'py>,
        source_uv: PyReadonlyArray3<'py, f64>,
        target_uv: PyReadonlyArray3<'py, f64>,
        tiles: Vec<([i32; 2], PyReadonlyArray3<'py, f32>)>,
        width: usize,
        height: usize,
        margin: usize,
        straight_alpha: bool,
        extension: &str,
        closest: bool,
        used: [Option<PyReadonlyArray1<'py, bool>>; 2],
        frames: Option<[PyReadonlyArray3<'py, f64>; 4]>,
        spaces: Option<[[[f64; 3]; 3]; 2]>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<(Array3<'py, f32>, usize)> {
        let map = Arc::clone(&self.map);
        let (source_uv, target_uv) = (corners_of::<2>(&source_uv)?, corners_of::<2>(&target_uv)?);
        let extension = Extension::named(extension).map_err(|e| errors::to_python(py, &e))?;
        let tiles = tiles
            .iter()
            .map(|(cell, pixels)| {
                let size = pixels.as_array().raw_dim();
                let image = Image {
                    width: size[1],
                    height: size[0],
                    pixels: pixels.as_slice()?,
                };
                Ok(Tile { cell: *cell, image })
            })
            .collect::<PyResult<Vec<_>>>()?;
        let [source_used, target_used] = &used;
        let source_used = source_used
            .as_ref()
            .map(|used| used.as_slice())
            .transpose()?;
        let target_used = target_used
            .as_ref()
            .map(|used| used.as_slice())
            .transpose()?;
        let frames = frames
            .map(|[a, b, c, d]| {
                Ok::<_, PyErr>((
                    (corners_of::<3>(&a)?, corners_of::<4>(&b)?),
                    (corners_of::<3>(&c)?, corners_of::<4>(&d)?),
                ))
            })
            .transpose()?;
        let baked = watched(py, progress, None, |state| {
            let [source_normals, target_normals] = match spaces {
                None => [vec![], vec![]],
                Some(_) => [&map.source, &map.target].map(Surface::vertex_normals),
            };
            let content = match (&frames, spaces) {
                (None, None) => Content::Colour { straight_alpha },
                (None, Some([source, target])) => Content::FixedNormals {
                    source: FixedSpace {
                        normals: &source_normals,
                        matrix: source,
                    },
                    target: FixedSpace {
                        normals: &target_normals,
                        matrix: target,
                    },
                },
                (Some((source, target)), _) => Content::TangentNormals {
                    source: TangentSpace {
                        normals: &source.0,
                        tangents: &source.1,
                    },
                    target: TangentSpace {
                        normals: &target.0,
                        tangents: &target.1,
                    },
                },
            };
            let wanted = Bake {
                source_uv: &source_uv,
                target_uv: &target_uv,
                texture: Texture {
                    tiles: &tiles,
                    extension,
                    closest,
                },
                source_used,
                target_used,
                content,
                width,
                height,
                margin,
            };
            texture::bake(&map, &wanted, state)
        })?;
        let pixels = baked.pixels.into_pyarray(py).reshape([height, width, 4])?;
        Ok((pixels, baked.covered))
    }

    /// Values (n, c) with those of `unknown` vertices replaced by a harmonic fill from the others.
    fn filled<'py>(
        &self,
        py: Python<'py>,
        values: PyReadonlyArray2<'py, f64>,
        unknown: Vec<bool>,
    ) -> PyResult<Array2<'py, f64>> {
        let map = Arc::clone(&self.map);
        let [rows, channels] = *values.as_array().shape() else {
            unreachable!("the array has two dimensions")
        };
        let values = values.as_slice()?.to_vec();
        let filled = watched(py, None, None, move |_| {
            Diffusion::new(&map.target).filled(values, channels, &unknown)
        })?;
        filled.into_pyarray(py).reshape([rows, channels])
    }
}

/// Stretch, flipped share and overlap of a layout: corners (m, 3, 3) and their UVs (m, 3, 2).
#[pyfunction]
pub fn judge_layout<'py>(
    py: Python<'py>,
    corners: PyReadonlyArray3<'py, f64>,
    uv: PyReadonlyArray3<'py, f64>,
) -> PyResult<Bound<'py, PyDict>> {
    let (corners, uv) = (corners_of::<3>(&corners)?, corners_of::<2>(&uv)?);
    let report = watched(py, None, None, move |_| {
        Ok::<_, Error>(layout::judged(&corners, &uv))
    })?;
    let dict = PyDict::new(py);
    dict.set_item("stretch", report.stretch)?;
    dict.set_item("flipped", report.flipped)?;
    dict.set_item("overlap", report.overlap)?;
    Ok(dict)
}

/// Number of the connected island of each triangle of a layout (m, 3, 2).
#[pyfunction]
pub fn uv_islands<'py>(
    py: Python<'py>,
    vertices: PyReadonlyArray2<'py, f64>,
    triangles: PyReadonlyArray2<'py, i64>,
    uv: PyReadonlyArray3<'py, f64>,
) -> PyResult<Array1<'py, i64>> {
    let (vertices, triangles) = (triples(&vertices)?, triples(&triangles)?);
    let uv = uv.as_slice()?.to_vec();
    let islands = watched(py, None, None, move |_| {
        let surface = Surface::new(vertices, &triangles)?;
        let values = CornerValues {
            values: &uv,
            channels: 2,
            tolerance: LAYOUT.uv_rounding,
        };
        Ok(corners::islands(&surface, &values.open(&surface)))
    })?;
    Ok(whole(islands).into_pyarray(py))
}

/// Adds what is here to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<SurfaceMap>()?;
    module.add_class::<Fitting>()?;
    module.add_function(wrap_pyfunction!(judge_layout, module)?)?;
    module.add_function(wrap_pyfunction!(uv_islands, module)?)?;
    Ok(())
}
