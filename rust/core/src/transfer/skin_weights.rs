//! Vertex groups: sparse weights carried, filled, smoothed, limited and normalised.

use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::transfer::diffusion::{COLUMNS_A_SOLVE, Diffusion};
use crate::transfer::settings::SKIN_WEIGHTS;
use crate::transfer::surface_map::{SurfaceMap, check_rows};

/// Weights of vertices in groups, in compressed rows.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SkinWeights {
    /// Start of each vertex's row, `(n + 1)`.
    pub starts: Vec<u32>,
    /// Group of each entry; ascending within a row.
    pub groups: Vec<u32>,
    /// Weight of each entry.
    pub weights: Vec<f64>,
}

/// What is done to the weights after they were carried.
#[derive(Debug, Clone)]
pub struct SkinOptions<'a> {
    /// Number of groups.
    pub groups: usize,
    /// Images less trusted than this are rejected, and their vertices filled from the others.
    pub reject_below: f64,
    /// Rounds of smoothing along the target.
    pub smoothing: usize,
    /// Weights below this are dropped.
    pub prune: f64,
    /// Most entries of deforming groups a vertex.
    pub limit: Option<usize>,
    /// Whether rows of deforming groups are scaled back to the sum that came across.
    pub normalize: bool,
    /// Which groups deform; the others are neither limited nor normalised.
    pub deforming: &'a [bool],
    /// What the target keeps.
    pub locked: Option<Locked<'a>>,
}

/// Deforming weights that the target keeps: the carried ones share what these leave.
#[derive(Debug, Clone, Copy)]
pub struct Locked<'a> {
    /// Which of the carried groups are among them. They count in the sum that comes across, and do
    /// not arrive.
    pub groups: &'a [bool],
    /// Their sum at each vertex of the target.
    pub sums: &'a [f64],
    /// Their number at each vertex of the target, for the limit.
    pub counts: &'a [u32],
}

/// Carried weights and which vertices were filled.
#[derive(Debug)]
pub struct CarriedSkin {
    /// Rows of the target's vertices.
    pub skin: SkinWeights,
    /// Vertices whose images were rejected and which were filled from their neighbours.
    pub filled: Vec<u32>,
}

impl SkinWeights {
    /// Checks rows.
    ///
    /// # Errors
    /// [`Error::BadArgument`] when rows do not fit, a group does not exist or a weight is not
    /// finite.
    pub fn new(
        starts: Vec<u32>,
        groups: Vec<u32>,
        weights: Vec<f64>,
        count: usize,
    ) -> Result<Self> {
        let fits = starts.first() == Some(&0)
            && starts.last() == Some(&(groups.len() as u32))
            && starts.windows(2).all(|w| w[0] <= w[1])
            && groups.len() == weights.len()
            && groups.iter().all(|&g| (g as usize) < count)
            && weights.iter().all(|w| w.is_finite());
        if fits {
            Ok(Self {
                starts,
                groups,
                weights,
            })
        } else {
            Err(Error::BadArgument {
                what: format!(
                    "the rows of weights do not fit together: {} starts, {} groups below {count}, \
                     {} finite weights are expected to agree",
                    starts.len(),
                    groups.len(),
                    weights.len()
                ),
            })
        }
    }

    /// Entries of one row.
    pub fn row(&self, v: usize) -> impl Iterator<Item = (u32, f64)> + '_ {
        let range = self.starts[v] as usize..self.starts[v + 1] as usize;
        range.map(|i| (self.groups[i], self.weights[i]))
    }

    pub(super) fn from_rows(rows: Vec<Vec<(u32, f64)>>) -> Self {
        let mut found = Self::default();
        found.starts.push(0);
        for row in rows {
            for (group, weight) in row {
                found.groups.push(group);
                found.weights.push(weight);
            }
            found.starts.push(found.groups.len() as u32);
        }
        found
    }
}

/// Sums sparse rows into one; reused from vertex to vertex.
struct Accumulator {
    dense: Vec<f64>,
    touched: Vec<u32>,
}

impl Accumulator {
    fn new(groups: usize) -> Self {
        Self {
            dense: vec![0.0; groups],
            touched: Vec::new(),
        }
    }

    fn add(&mut self, group: u32, weight: f64) {
        let at = &mut self.dense[group as usize];
        if *at == 0.0 {
            self.touched.push(group);
        }
        *at += weight;
    }

    fn take(&mut self, least: f64) -> Vec<(u32, f64)> {
        self.touched.sort_unstable();
        // A sum may have passed through zero and have been touched twice.
        self.touched.dedup();
        self.touched
            .drain(..)
            .map(|g| (g, std::mem::take(&mut self.dense[g as usize])))
            .filter(|&(_, w)| w > least)
            .collect()
    }
}

/// Carries the weights of the source's vertices to the target's.
///
/// Barycentric within the source's triangle; then rejected vertices are filled by a Laplace solve,
/// all are smoothed, limited, pruned and scaled back to their sum, in this order.
///
/// # Errors
/// [`Error::BadArgument`] when lengths do not fit, [`Error::NotFactorised`].
///
/// # Source
/// Rejecting and filling by a solve over the surface: Abdrashitov, Raichstat, Monsen, Hill,
/// "Robust Skin Weights Transfer via Weight Inpainting", SIGGRAPH Asia 2023. There the solve is
/// biharmonic; harmonic filling keeps weights between those of the rim.
pub fn carried_skin(
    map: &SurfaceMap,
    source: &SkinWeights,
    options: &SkinOptions<'_>,
) -> Result<CarriedSkin> {
    check_rows(
        "weights",
        source.starts.len() - 1,
        map.source.vertices.len(),
    )?;
    check_rows("deforming", options.deforming.len(), options.groups)?;
    if let Some(locked) = options.locked {
        check_rows("locked groups", locked.groups.len(), options.groups)?;
        check_rows("locked sums", locked.sums.len(), map.target.vertices.len())?;
        check_rows(
            "locked counts",
            locked.counts.len(),
            map.target.vertices.len(),
        )?;
    }
    let fresh = || Accumulator::new(options.groups);
    let mut rows: Vec<Vec<(u32, f64)>> = map
        .points
        .par_iter()
        .map_init(fresh, |sum, point| {
            for (k, v) in map.source.triangles[point.face as usize]
                .into_iter()
                .enumerate()
            {
                if point.weights[k] > 0.0 {
                    for (group, weight) in source.row(v as usize) {
                        sum.add(group, point.weights[k] * weight);
                    }
                }
            }
            sum.take(0.0)
        })
        .collect();
    let rejected: Vec<bool> = map
        .confidence
        .iter()
        .map(|&c| c < options.reject_below)
        .collect();
    let mut filled = Vec::new();
    if rejected.contains(&true) || options.smoothing > 0 {
        let diffusion = Diffusion::new(&map.target);
        filled = fill(&diffusion, &mut rows, &rejected, options.groups)?;
        for _ in 0..options.smoothing {
            rows = smoothed(&diffusion, &rows, options.groups);
        }
    }
    rows.par_iter_mut()
        .enumerate()
        .for_each(|(v, row)| finish(row, options, v));
    Ok(CarriedSkin {
        skin: SkinWeights::from_rows(rows),
        filled,
    })
}

fn fill(
    diffusion: &Diffusion,
    rows: &mut [Vec<(u32, f64)>],
    rejected: &[bool],
    groups: usize,
) -> Result<Vec<u32>> {
    let filling = diffusion.filling(rejected)?;
    let vertices = filling.vertices.clone();
    // Only the groups on the rim can come in.
    let mut used = vec![false; groups];
    for &v in &vertices {
        for &u in diffusion.edges.neighbours.row(v as usize) {
            if !rejected[u as usize] {
                for &(g, _) in &rows[u as usize] {
                    used[g as usize] = true;
                }
            }
        }
    }
    let used: Vec<u32> = (0..groups as u32).filter(|&g| used[g as usize]).collect();
    let mut fresh: Vec<Vec<(u32, f64)>> = vec![Vec::new(); vertices.len()];
    for columns in used.chunks(COLUMNS_A_SOLVE) {
        let solved = filling.solve(columns.len(), |v, c| {
            rows[v]
                .iter()
                .find(|(g, _)| *g == columns[c])
                .map_or(0.0, |&(_, w)| w)
        });
        for (i, row) in fresh.iter_mut().enumerate() {
            for (c, &group) in columns.iter().enumerate() {
                if solved[(i, c)] > SKIN_WEIGHTS.negligible {
                    row.push((group, solved[(i, c)]));
                }
            }
        }
    }
    for (&v, row) in vertices.iter().zip(fresh) {
        rows[v as usize] = row;
    }
    Ok(vertices)
}

/// One round: halfway to the weighted mean of the neighbours.
fn smoothed(
    diffusion: &Diffusion,
    rows: &[Vec<(u32, f64)>],
    groups: usize,
) -> Vec<Vec<(u32, f64)>> {
    const SHARE: f64 = 0.5;
    (0..rows.len())
        .into_par_iter()
        .map_init(
            || Accumulator::new(groups),
            |sum, v| {
                let total: f64 = diffusion.edges.row(v).map(|(_, w)| w).sum();
                let own = if total > 0.0 { 1.0 - SHARE } else { 1.0 };
                for &(g, w) in &rows[v] {
                    sum.add(g, own * w);
                }
                for (u, share) in diffusion.edges.row(v) {
                    for &(g, w) in &rows[u as usize] {
                        sum.add(g, SHARE * share / total * w);
                    }
                }
                sum.take(SKIN_WEIGHTS.negligible)
            },
        )
        .collect()
}

fn finish(row: &mut Vec<(u32, f64)>, options: &SkinOptions<'_>, v: usize) {
    let deforms = |g: u32| options.deforming[g as usize];
    let sum = |row: &[(u32, f64)]| -> f64 {
        row.iter()
            .filter(|&&(g, _)| deforms(g))
            .map(|&(_, w)| w)
            .sum()
    };
    let mut wanted = sum(row);
    if (wanted - 1.0).abs() < SKIN_WEIGHTS.sum_rounding {
        wanted = 1.0;
    }
    let bound = wanted >= 1.0;
    let mut most = options.limit.unwrap_or(usize::MAX);
    if let Some(locked) = options.locked {
        wanted = (wanted - locked.sums[v]).max(0.0);
        most = most.saturating_sub(locked.counts[v] as usize);
        row.retain(|&(g, _)| !locked.groups[g as usize]);
    }
    let mut strengths: Vec<(f64, u32)> = row
        .iter()
        .filter(|&&(g, _)| deforms(g))
        .map(|&(g, w)| (w, g))
        .collect();
    strengths.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    if strengths.len() > most {
        strengths.truncate(most);
        row.retain(|&(g, _)| !deforms(g) || strengths.iter().any(|&(_, kept)| kept == g));
    }
    row.retain(|&(_, w)| w >= options.prune);
    if options.normalize {
        let left = sum(row);
        if left > 0.0 {
            for entry in row.iter_mut().filter(|&&mut (g, _)| deforms(g)) {
                entry.1 *= wanted / left;
            }
        } else if let (Some(&(_, g)), true) = (strengths.first(), bound) {
            // Pruned away altogether: a vertex that was bound stays bound.
            row.push((g, wanted));
            row.sort_unstable_by_key(|e| e.0);
        }
    }
    row.retain(|&(_, w)| w > 0.0);
    for entry in row.iter_mut() {
        entry.1 = entry.1.min(1.0);
    }
}
