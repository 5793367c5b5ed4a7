//! Distances from many sources, in columns.

use faer::{Mat, MatMut};
use rayon::prelude::*;

use super::fast_marching::{FastMarching, Sweeping, TOGETHER, Workspace};
use crate::error::{Error, Result};

/// Fewer sources are all marched, each on its own: of so few groups most threads would get none.
const FEWEST_SWEPT: usize = 4 * TOGETHER;

/// Distances from each source to every vertex.
///
/// Shape `(n, s)`: column `j` holds the distances from `sources[j]`, contiguous in memory.
/// Vertices that cannot be reached are infinite. Few sources are marched, each on its own. Of many, only the
/// first are, which should be spread as farthest points are; the others are swept, in full groups, in the order of
/// one of those that is near. The result does not depend on the number of threads. `cancelled` is asked before each source or group.
///
/// # Errors
/// [`Error::BadArgument`] when a source is not a vertex, [`Error::Cancelled`].
pub fn distances_from(
    marching: &FastMarching,
    sources: &[u32],
    cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Mat<f32>> {
    if sources.len() < FEWEST_SWEPT {
        return distances_within(f32::INFINITY, marching, sources, cancelled);
    }
    check(marching, sources)?;
    let group_count = sources.len() / (TOGETHER + 1);
    let (marched, others) = sources.split_at(sources.len() - TOGETHER * group_count);
    let mut distances = Mat::zeros(marching.vertex_count(), sources.len());
    let (mut guiding, following) = distances.split_at_col_mut(marched.len());
    march(
        f32::INFINITY,
        marching,
        marched,
        guiding.as_mut(),
        cancelled,
    )?;
    let mut groups: Vec<Group> = contiguous(guiding)
        .take(group_count)
        .map(|guide| Group {
            guide,
            sources: Vec::new(),
            columns: Vec::new(),
        })
        .collect();
    let mut columns: Vec<_> = contiguous(following).map(Some).collect();
    for (source, group) in nearest(others, &groups) {
        groups[group].sources.push(others[source]);
        groups[group].columns.extend(columns[source].take());
    }
    let sweeping = Sweeping::new(marching);
    groups.par_iter_mut().try_for_each_init(
        || Workspace::new(marching),
        |workspace, group| {
            if cancelled() {
                return Err(Error::Cancelled);
            }
            sweeping.run(&group.sources, group.guide, workspace, &mut group.columns);
            Ok(())
        },
    )?;
    Ok(distances)
}

/// Distances from each source to the vertices up to a bound, infinite beyond: [`distances_from`] with each source
/// marched on its own.
///
/// # Errors
/// Those of [`distances_from`].
pub fn distances_within(
    bound: f32,
    marching: &FastMarching,
    sources: &[u32],
    cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Mat<f32>> {
    check(marching, sources)?;
    let mut distances = Mat::zeros(marching.vertex_count(), sources.len());
    march(bound, marching, sources, distances.as_mut(), cancelled)?;
    Ok(distances)
}

/// Sources that are swept together, with their columns and the distances from the source in whose order they are.
struct Group<'a> {
    guide: &'a [f32],
    sources: Vec<u32>,
    columns: Vec<&'a mut [f32]>,
}

/// Each source by number with the nearest group that has room, nearest first.
fn nearest(sources: &[u32], groups: &[Group]) -> Vec<(usize, usize)> {
    let mut by_distance: Vec<(f32, usize, usize)> = (0..sources.len())
        .flat_map(|source| {
            let distance = move |group: &Group| group.guide[sources[source] as usize];
            (0..)
                .zip(groups)
                .map(move |(g, group)| (distance(group), source, g))
        })
        .collect();
    by_distance.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let mut room = vec![TOGETHER; groups.len()];
    let mut placed = vec![false; sources.len()];
    let mut nearest = Vec::with_capacity(sources.len());
    for (_, source, group) in by_distance {
        if !placed[source] && room[group] > 0 {
            placed[source] = true;
            room[group] -= 1;
            nearest.push((source, group));
        }
    }
    nearest
}

fn check(marching: &FastMarching, sources: &[u32]) -> Result<()> {
    let n = marching.vertex_count();
    match sources.iter().find(|&&s| s as usize >= n) {
        None => Ok(()),
        Some(source) => Err(Error::BadArgument {
            what: format!("source {source} is not one of the {n} vertices: give ids below {n}"),
        }),
    }
}

/// Marches from each source into its column, two beside each other.
fn march(
    bound: f32,
    marching: &FastMarching,
    sources: &[u32],
    distances: MatMut<f32>,
    cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<()> {
    distances
        .par_col_chunks_mut(2)
        .zip(sources.par_chunks(2))
        .try_for_each_init(
            || [Workspace::new(marching), Workspace::new(marching)],
            |workspaces, (columns, sources)| {
                if cancelled() {
                    return Err(Error::Cancelled);
                }
                let mut columns = contiguous(columns);
                match (sources, columns.next(), columns.next()) {
                    (&[one, two], Some(first), Some(second)) => {
                        marching.march_two([one, two], bound, workspaces, [first, second]);
                    }
                    (&[one], Some(first), _) => {
                        marching.march_bounded(one, bound, &mut workspaces[0], first);
                    }
                    _ => unreachable!("as many columns as sources"),
                }
                Ok(())
            },
        )
}

/// The columns of an owned matrix, whose entries are beside each other.
fn contiguous(matrix: MatMut<'_, f32>) -> impl Iterator<Item = &mut [f32]> {
    matrix.col_iter_mut().map(|column| {
        let column = column.try_as_col_major_mut();
        column
            .expect("an owned matrix has contiguous columns")
            .as_slice_mut()
    })
}
