//! Textures of the source baked into the target's own UV layout, texel by texel.

use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

use crate::algebra::vector::{self, Point};
use crate::error::{Error, Result};
use crate::mesh::surface_point::SurfacePoint;
use crate::transfer::layout::scan_rows;
use crate::transfer::normal_maps::{FixedSpace, Spot, TangentSpace};
use crate::transfer::settings::TEXTURE;
use crate::transfer::surface::blend;
use crate::transfer::surface_map::{SurfaceMap, check_rows};
use crate::watch::progress::Progress;

/// Numbers a texel: red, green, blue, alpha.
pub const CHANNELS: usize = 4;

/// Largest side of an image.
pub const LARGEST_SIDE: usize = 8192;

/// Rows of the image that a thread fills at a time.
const BAND: usize = 32;

type Uv = [f64; 2];

/// An image in rows from the bottom, as UV counts.
#[derive(Debug, Clone, Copy)]
pub struct Image<'a> {
    /// Texels a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `(height, width, 4)`.
    pub pixels: &'a [f32],
}

/// An image over one unit of UV.
#[derive(Debug, Clone, Copy)]
pub struct Tile<'a> {
    /// Where that unit begins: column and row.
    pub cell: [i32; 2],
    /// Its image.
    pub image: Image<'a>,
}

impl Tile<'_> {
    /// Square of the distance of a UV to the tile.
    fn distance(&self, uv: Uv) -> f64 {
        (0..2)
            .map(|axis| {
                let local = uv[axis] - f64::from(self.cell[axis]);
                (local - local.clamp(0.0, 1.0)).powi(2)
            })
            .sum()
    }
}

/// What an image shows beyond its borders.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Extension {
    /// Itself again.
    Repeat,
    /// Itself in a mirror.
    Mirror,
    /// The texels at its border.
    Extend,
    /// Nothing: zeros.
    Clip,
}

impl Extension {
    /// The extension of that name.
    ///
    /// # Errors
    /// [`Error::BadArgument`] for an unknown name.
    pub fn named(name: &str) -> Result<Self> {
        match name {
            "repeat" => Ok(Self::Repeat),
            "mirror" => Ok(Self::Mirror),
            "extend" => Ok(Self::Extend),
            "clip" => Ok(Self::Clip),
            _ => Err(Error::BadArgument {
                what: format!(
                    "`extension` should be \"repeat\", \"mirror\", \"extend\" or \"clip\", got {name:?}"
                ),
            }),
        }
    }

    /// The texel shown at place `at` of a line of `count`.
    fn texel(self, at: i64, count: i64) -> Option<usize> {
        let place = match self {
            Self::Repeat => at.rem_euclid(count),
            Self::Mirror => {
                let place = at.rem_euclid(2 * count);
                place.min(2 * count - 1 - place)
            }
            Self::Extend => at.clamp(0, count - 1),
            Self::Clip => return (0..count).contains(&at).then_some(at as usize),
        };
        Some(place as usize)
    }
}

/// The source's texture: one image over the unit square, or tiles.
#[derive(Debug, Clone, Copy)]
pub struct Texture<'a> {
    /// The tile nearest to a UV shows there, beyond its borders by `extension`.
    pub tiles: &'a [Tile<'a>],
    /// What shows beyond the borders of a tile.
    pub extension: Extension,
    /// Whether the nearest texel is taken instead of filtering.
    pub closest: bool,
}

impl<'a> Texture<'a> {
    fn tile(&self, uv: Uv) -> &'a Tile<'a> {
        let [first, others @ ..] = self.tiles else {
            unreachable!("checked: there is a tile")
        };
        others.iter().fold(first, |best, tile| {
            if tile.distance(uv) < best.distance(uv) {
                tile
            } else {
                best
            }
        })
    }

    /// The texture at a UV. Colours with straight alpha count by their alpha.
    fn at(&self, uv: Uv, straight: bool) -> [f32; CHANNELS] {
        let tile = self.tile(uv);
        let local = [0, 1].map(|axis| uv[axis] - f64::from(tile.cell[axis]));
        if !local.iter().all(|u| u.is_finite()) {
            return [0.0; CHANNELS];
        }
        if self.closest {
            let [x, y] = tile.image.texels(local).map(|at| at.floor() as i64);
            tile.image.texel(x, y, self.extension)
        } else {
            filtered(&tile.image, local, self.extension, straight)
        }
    }
}

impl Image<'_> {
    /// A UV in texels.
    fn texels(&self, uv: Uv) -> Uv {
        [uv[0] * self.width as f64, uv[1] * self.height as f64]
    }

    fn texel(&self, x: i64, y: i64, extension: Extension) -> [f32; CHANNELS] {
        let column = extension.texel(x, self.width as i64);
        let row = extension.texel(y, self.height as i64);
        let (Some(column), Some(row)) = (column, row) else {
            return [0.0; CHANNELS];
        };
        let at = (row * self.width + column) * CHANNELS;
        [0, 1, 2, 3].map(|c| self.pixels[at + c])
    }
}

/// What an image holds.
#[derive(Debug, Clone, Copy)]
pub enum Content<'a> {
    /// Colours or other numbers; with `straight_alpha` colours count by their alpha in a mixture.
    Colour {
        /// Whether colours are stored apart from alpha.
        straight_alpha: bool,
    },
    /// Normals in the tangent frames of the source, wanted in those of the target.
    TangentNormals {
        /// Frames in which the image's normals are.
        source: TangentSpace<'a>,
        /// Frames in which they are wanted.
        target: TangentSpace<'a>,
    },
    /// Normals in one space all over the source, wanted in one all over the target.
    FixedNormals {
        /// Space in which the image's normals are.
        source: FixedSpace<'a>,
        /// Space in which they are wanted.
        target: FixedSpace<'a>,
    },
}

impl Content<'_> {
    fn straight_alpha(&self) -> bool {
        matches!(
            self,
            Self::Colour {
                straight_alpha: true
            }
        )
    }

    /// A texel of the source as one of the target.
    fn carried(&self, texel: [f32; CHANNELS], spot: &Spot<'_>) -> [f32; CHANNELS] {
        let [r, g, b, alpha] = texel;
        let normal = [r, g, b].map(|c| f64::from(c) * 2.0 - 1.0);
        let turned = match self {
            Self::Colour { .. } => return texel,
            Self::TangentNormals { source, target } => {
                spot.between_tangents(normal, source, target)
            }
            Self::FixedNormals { source, target } => spot.between_fixed(normal, source, target),
        };
        let [r, g, b] = turned.map(|c| (c * 0.5 + 0.5) as f32);
        [r, g, b, alpha]
    }
}

/// What is baked, and into what.
#[derive(Debug, Clone, Copy)]
pub struct Bake<'a> {
    /// UVs of the source's triangles, `(m_source, 3)`.
    pub source_uv: &'a [[Uv; 3]],
    /// UVs of the target's triangles, `(m_target, 3)`.
    pub target_uv: &'a [[Uv; 3]],
    /// The source's texture.
    pub texture: Texture<'a>,
    /// Source triangles that have the texture, `(m_source,)`: it is looked up on these alone.
    pub source_used: Option<&'a [bool]>,
    /// Target triangles that get it, `(m_target,)`.
    pub target_used: Option<&'a [bool]>,
    /// What the texture holds.
    pub content: Content<'a>,
    /// Texels a row of the result.
    pub width: usize,
    /// Rows of the result.
    pub height: usize,
    /// Texels by which islands are extended into the empty space.
    pub margin: usize,
}

/// A baked image.
#[derive(Debug)]
pub struct Baked {
    /// `(height, width, 4)`, zero where nothing was baked.
    pub pixels: Vec<f32>,
    /// Texels under a triangle, before the margin.
    pub covered: usize,
}

/// Bakes: target texel → point of the target → point of the source → source UV → filtered sample.
///
/// # Errors
/// [`Error::BadArgument`] when lengths do not fit or the image is too large,
/// [`Error::Cancelled`].
pub fn bake(map: &SurfaceMap, bake: &Bake<'_>, progress: &Progress) -> Result<Baked> {
    check(map, bake)?;
    let triangles: Vec<TargetTriangle> = (0..bake.target_uv.len())
        .into_par_iter()
        .filter(|&t| bake.target_used.is_none_or(|used| used[t]))
        .map(|t| TargetTriangle::new(map, bake, t))
        .collect();
    let mut bands: Vec<Vec<u32>> = vec![Vec::new(); bake.height.div_ceil(BAND)];
    for (t, triangle) in triangles.iter().enumerate() {
        let rows = triangle.texels.map(|p| p[1]);
        let low = rows.iter().copied().fold(f64::INFINITY, f64::min).max(0.0);
        let high = rows.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if high < 0.0 || low >= bake.height as f64 {
            continue;
        }
        let last = (high as usize / BAND).min(bands.len() - 1);
        for band in &mut bands[low as usize / BAND..=last] {
            band.push(t as u32);
        }
    }
    let mut pixels = vec![0.0f32; bake.width * bake.height * CHANNELS];
    let mut filled = vec![false; bake.width * bake.height];
    let done = AtomicUsize::new(0);
    let count = bands.len();
    pixels
        .par_chunks_mut(BAND * bake.width * CHANNELS)
        .zip(filled.par_chunks_mut(BAND * bake.width))
        .zip(bands)
        .enumerate()
        .try_for_each(|(b, ((pixels, filled), band))| {
            let lines = filled.len() / bake.width;
            let rows = (b * BAND) as i64..(b * BAND + lines) as i64;
            let mut guess = None;
            for t in band {
                let triangle = &triangles[t as usize];
                scan_rows(
                    triangle.texels,
                    rows.clone(),
                    0..bake.width as i64,
                    |x, y, w| {
                        let place = (y - rows.start) as usize * bake.width + x as usize;
                        let texel = triangle.sample(map, bake, w, &mut guess);
                        pixels[place * CHANNELS..][..CHANNELS].copy_from_slice(&texel);
                        filled[place] = true;
                    },
                );
            }
            let part = done.fetch_add(1, Ordering::Relaxed) + 1;
            progress.enter("baking", part as f64 / count as f64)
        })?;
    let covered = filled.iter().filter(|&&f| f).count();
    extend(
        &mut pixels,
        &mut filled,
        bake.width,
        bake.height,
        bake.margin,
        bake.content.straight_alpha(),
    );
    Ok(Baked { pixels, covered })
}

fn check(map: &SurfaceMap, bake: &Bake<'_>) -> Result<()> {
    let (source, target) = (map.source.triangles.len(), map.target.triangles.len());
    check_rows("source_uv", bake.source_uv.len(), source)?;
    check_rows("target_uv", bake.target_uv.len(), target)?;
    match bake.content {
        Content::Colour { .. } => {}
        Content::TangentNormals {
            source: from,
            target: to,
        } => {
            check_rows("source normals", from.normals.len(), source)?;
            check_rows("source tangents", from.tangents.len(), source)?;
            check_rows("target normals", to.normals.len(), target)?;
            check_rows("target tangents", to.tangents.len(), target)?;
        }
        Content::FixedNormals {
            source: from,
            target: to,
        } => {
            let counts = [&map.source, &map.target].map(|surface| surface.vertices.len());
            check_rows("source normals", from.normals.len(), counts[0])?;
            check_rows("target normals", to.normals.len(), counts[1])?;
        }
    }
    for (name, used, count) in [
        ("source_triangles", bake.source_used, source),
        ("target_triangles", bake.target_used, target),
    ] {
        if let Some(used) = used {
            check_rows(name, used.len(), count)?;
            if !used.contains(&true) {
                return Err(Error::BadArgument {
                    what: format!("no triangle of `{name}` has the texture"),
                });
            }
        }
    }
    let tiles = bake.texture.tiles;
    if tiles.is_empty() {
        return Err(Error::BadArgument {
            what: "the texture has no tile: give an image".into(),
        });
    }
    let sizes = tiles
        .iter()
        .map(|tile| ("image", tile.image.width, tile.image.height))
        .chain([("result", bake.width, bake.height)]);
    for (name, width, height) in sizes {
        if width == 0 || height == 0 || width.max(height) > LARGEST_SIDE {
            return Err(Error::BadArgument {
                what: format!(
                    "the {name} has {width} × {height} texels: each side should be 1 to {LARGEST_SIDE}"
                ),
            });
        }
    }
    tiles.iter().try_for_each(|tile| {
        check_rows(
            "image",
            tile.image.pixels.len(),
            tile.image.width * tile.image.height * CHANNELS,
        )
    })
}

/// A target triangle in the result's texels, with what its texels have in common.
struct TargetTriangle {
    number: u32,
    texels: [Uv; 3],
    /// Images of its corners.
    images: [Point; 3],
    points: [SurfacePoint; 3],
    /// Mean normal of the source where the corners lie.
    normal: Point,
    /// Change of the weights from texel to texel along x and y.
    steps: [[f64; 3]; 2],
    /// Samples along each side of a texel.
    samples: usize,
}

impl TargetTriangle {
    fn new(map: &SurfaceMap, bake: &Bake<'_>, t: usize) -> Self {
        let vertices = map.target.triangles[t];
        let points = vertices.map(|v| map.points[v as usize]);
        let images = vertices.map(|v| map.images()[v as usize]);
        let texels =
            bake.target_uv[t].map(|uv| [uv[0] * bake.width as f64, uv[1] * bake.height as f64]);
        let [a, b, c] = texels;
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        let step = |k: usize| {
            let (next, last) = (texels[(k + 1) % 3], texels[(k + 2) % 3]);
            [(next[1] - last[1]) / area, (last[0] - next[0]) / area]
        };
        let gradients = [0, 1, 2].map(step);
        let normal = points.iter().fold([0.0; 3], |sum, p| {
            vector::add(sum, vector::normalised(map.source.cross(p.face)))
        });
        // Source texels under a texel of the result.
        let image_area = vector::norm(vector::cross(
            vector::sub(images[1], images[0]),
            vector::sub(images[2], images[0]),
        ));
        let density = points
            .iter()
            .map(|p| {
                let corners = &bake.source_uv[p.face as usize];
                let [a, b, c] = *corners;
                let uv = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
                let image = bake.texture.tile(uv_at(corners, [1.0 / 3.0; 3])).image;
                let texels = uv.abs() * (image.width * image.height) as f64;
                texels / vector::norm(map.source.cross(p.face)).max(f64::MIN_POSITIVE)
            })
            .fold(0.0, f64::max);
        let ratio = (image_area * density / area.abs().max(f64::MIN_POSITIVE)).sqrt();
        Self {
            number: t as u32,
            texels,
            images,
            points,
            normal,
            steps: [0, 1].map(|axis| gradients.map(|g| g[axis])),
            // A texel of the same size, up to rounding and stretch, is one sample.
            samples: if bake.texture.closest {
                1
            } else {
                ((ratio - 0.25).ceil() as usize).clamp(1, TEXTURE.most_samples)
            },
        }
    }

    fn sample(
        &self,
        map: &SurfaceMap,
        bake: &Bake<'_>,
        weights: [f64; 3],
        guess: &mut Option<u32>,
    ) -> [f32; CHANNELS] {
        let n = self.samples;
        let straight = bake.content.straight_alpha();
        let mut mean = Mean::new(straight);
        for j in 0..n {
            for i in 0..n {
                let [dx, dy] = [i, j].map(|k| (k as f64 + 0.5) / n as f64 - 0.5);
                let w =
                    [0, 1, 2].map(|k| weights[k] + dx * self.steps[0][k] + dy * self.steps[1][k]);
                let place = self.place(map, bake.source_used, w, guess);
                let uv = uv_at(&bake.source_uv[place.face as usize], place.weights);
                let spot = Spot {
                    map,
                    triangle: self.number,
                    images: self.images,
                    weights: w,
                    source: place,
                };
                mean.add(bake.content.carried(bake.texture.at(uv, straight), &spot));
            }
        }
        mean.texel()
    }

    /// The point of the source, on its `used` triangles, under a point of this triangle.
    fn place(
        &self,
        map: &SurfaceMap,
        used: Option<&[bool]>,
        weights: [f64; 3],
        guess: &mut Option<u32>,
    ) -> SurfacePoint {
        let used = |t: u32| used.is_none_or(|used| used[t as usize]);
        let [first, ..] = self.points;
        if self.points.iter().all(|p| p.face == first.face) && used(first.face) {
            return SurfacePoint {
                face: first.face,
                weights: [0, 1, 2]
                    .map(|c| (0..3).map(|k| weights[k] * self.points[k].weights[c]).sum()),
            };
        }
        let query = blend(self.images, weights);
        let faces = |t: u32| vector::dot(map.source.cross(t), self.normal) > 0.0;
        let nearest = map
            .source
            .nearest_where(query, guess.filter(|&t| used(t)), used)
            .unwrap_or_else(|| map.source.nearest(query));
        let found = if faces(nearest.face) {
            nearest
        } else {
            // The other side of what is thin; a triangle that faces this one lies at one of its corners.
            let apart = |image: &Point| vector::distance(*image, query);
            let near = self.images.iter().map(apart).fold(0.0, f64::max);
            let facing = |t: u32| used(t) && faces(t);
            map.source
                .nearest_within(query, near, facing)
                .unwrap_or(nearest)
        };
        *guess = Some(found.face);
        found
    }
}

/// Mean of texels, in which colours with straight alpha count by their alpha.
struct Mean {
    straight: bool,
    weighted: [f32; 3],
    plain: [f32; CHANNELS],
    count: f32,
}

impl Mean {
    fn new(straight: bool) -> Self {
        Self {
            straight,
            weighted: [0.0; 3],
            plain: [0.0; CHANNELS],
            count: 0.0,
        }
    }

    fn add(&mut self, texel: [f32; CHANNELS]) {
        for (sum, value) in self.weighted.iter_mut().zip(texel) {
            *sum += value * texel[3];
        }
        for (sum, value) in self.plain.iter_mut().zip(texel) {
            *sum += value;
        }
        self.count += 1.0;
    }

    fn texel(&self) -> [f32; CHANNELS] {
        let [r, g, b, alpha] = self.plain;
        let colour = if self.straight && alpha > TEXTURE.transparent {
            self.weighted.map(|c| c / alpha)
        } else {
            [r, g, b].map(|c| c / self.count)
        };
        [colour[0], colour[1], colour[2], alpha / self.count]
    }
}

fn uv_at(corners: &[Uv; 3], weights: [f64; 3]) -> Uv {
    [0, 1].map(|axis| (0..3).map(|k| weights[k] * corners[k][axis]).sum())
}

/// The image at a UV: cubic (Catmull–Rom), held within the four texels around.
///
/// Holding avoids the ringing at edges. Colours with straight alpha count by their alpha.
fn filtered(image: &Image<'_>, uv: Uv, extension: Extension, straight: bool) -> [f32; CHANNELS] {
    let [x, y] = image.texels(uv).map(|at| at - 0.5);
    let (column, row) = (x.floor(), y.floor());
    let along = cubic((x - column) as f32);
    let up = cubic((y - row) as f32);
    let mut colour = [0.0f32; CHANNELS];
    let mut plain = [0.0f32; 3];
    let mut low = [f32::INFINITY; CHANNELS];
    let mut high = [f32::NEG_INFINITY; CHANNELS];
    for (j, &wy) in up.iter().enumerate() {
        for (i, &wx) in along.iter().enumerate() {
            let [x, y] =
                [(column, i), (row, j)].map(|(at, k)| (at as i64).saturating_add(k as i64 - 1));
            let texel = image.texel(x, y, extension);
            let weight = wx * wy;
            for c in 0..3 {
                plain[c] += weight * texel[c];
                colour[c] += weight * texel[c] * if straight { texel[3] } else { 1.0 };
            }
            colour[3] += weight * texel[3];
            if (1..3).contains(&i) && (1..3).contains(&j) {
                for c in 0..CHANNELS {
                    low[c] = low[c].min(texel[c]);
                    high[c] = high[c].max(texel[c]);
                }
            }
        }
    }
    if straight {
        for c in 0..3 {
            colour[c] = if colour[3] > TEXTURE.transparent {
                colour[c] / colour[3]
            } else {
                plain[c]
            };
        }
    }
    [0, 1, 2, 3].map(|c| colour[c].clamp(low[c], high[c]))
}

/// Weights of four texels for a place between the second and the third.
fn cubic(t: f32) -> [f32; 4] {
    let (t2, t3) = (t * t, t * t * t);
    [
        -0.5 * t3 + t2 - 0.5 * t,
        1.5 * t3 - 2.5 * t2 + 1.0,
        -1.5 * t3 + 2.0 * t2 + 0.5 * t,
        0.5 * t3 - 0.5 * t2,
    ]
}

/// Extends filled texels `margin` times into their empty neighbours, each the mean of those filled.
///
/// Colours with straight alpha count by their alpha.
fn extend(
    pixels: &mut [f32],
    filled: &mut [bool],
    width: usize,
    height: usize,
    margin: usize,
    straight: bool,
) {
    let around = |p: usize| {
        let (x, y) = (p % width, p / width);
        (y.saturating_sub(1)..=(y + 1).min(height - 1)).flat_map(move |j| {
            (x.saturating_sub(1)..=(x + 1).min(width - 1)).map(move |i| j * width + i)
        })
    };
    let mut rim: Vec<u32> = (0..filled.len())
        .into_par_iter()
        .filter(|&p| !filled[p] && around(p).any(|q| filled[q]))
        .map(|p| p as u32)
        .collect();
    for _ in 0..margin {
        let values: Vec<[f32; CHANNELS]> = rim
            .par_iter()
            .map(|&p| {
                let mut mean = Mean::new(straight);
                for q in around(p as usize).filter(|&q| filled[q]) {
                    mean.add([0, 1, 2, 3].map(|c| pixels[q * CHANNELS + c]));
                }
                mean.texel()
            })
            .collect();
        for (&p, value) in rim.iter().zip(&values) {
            pixels[p as usize * CHANNELS..][..CHANNELS].copy_from_slice(value);
            filled[p as usize] = true;
        }
        let mut next: Vec<u32> = rim
            .iter()
            .flat_map(|&p| around(p as usize).filter(|&q| !filled[q]).map(|q| q as u32))
            .collect();
        next.sort_unstable();
        next.dedup();
        rim = next;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn filter_gives_texels_at_their_centres_and_lines_between() {
        // Grey grows along x in steps of 1/8; the filter is exact for lines.
        let pixels: Vec<f32> = (0..8 * 8).flat_map(|i| [(i % 8) as f32 / 8.0; 4]).collect();
        let image = Image {
            width: 8,
            height: 8,
            pixels: &pixels,
        };
        for x in [2.5, 3.0, 4.75] {
            let found = filtered(&image, [x / 8.0, 0.5], Extension::Repeat, false);
            assert!((f64::from(found[0]) - (x - 0.5) / 8.0).abs() < 1e-6);
        }
    }

    #[test]
    fn margin_grows_by_so_many_texels() {
        let mut pixels = vec![0.0; 9 * 9 * CHANNELS];
        let mut filled = vec![false; 81];
        filled[40] = true;
        pixels[40 * CHANNELS..][..CHANNELS].copy_from_slice(&[0.25, 0.5, 0.75, 1.0]);
        extend(&mut pixels, &mut filled, 9, 9, 2, true);
        assert_eq!(filled.iter().filter(|&&f| f).count(), 25);
        assert!(
            filled
                .iter()
                .enumerate()
                .all(|(p, &f)| !f || pixels[p * CHANNELS] == 0.25)
        );
    }

    #[test]
    fn a_margin_beside_transparent_texels_has_the_colour_of_those_seen() {
        // White and opaque beside black and transparent.
        let mut pixels = vec![0.0; 4 * CHANNELS];
        pixels[..CHANNELS].copy_from_slice(&[1.0; CHANNELS]);
        let mut filled = vec![true, true, false, false];
        extend(&mut pixels, &mut filled, 2, 2, 1, true);
        assert_eq!(pixels[2 * CHANNELS..][..CHANNELS], [1.0, 1.0, 1.0, 0.5]);
    }

    #[test]
    fn beyond_its_borders_an_image_shows_what_its_extension_says() {
        let at = |extension: Extension| [-2, -1, 0, 3, 4, 5].map(|x| extension.texel(x, 4));
        assert_eq!(at(Extension::Repeat), [2, 3, 0, 3, 0, 1].map(Some));
        assert_eq!(at(Extension::Mirror), [1, 0, 0, 3, 3, 2].map(Some));
        assert_eq!(at(Extension::Extend), [0, 0, 0, 3, 3, 3].map(Some));
        assert_eq!(
            at(Extension::Clip),
            [None, None, Some(0), Some(3), None, None]
        );
    }

    #[test]
    fn a_place_shows_the_tile_over_it_and_the_nearest_where_there_is_none() {
        let (dark, light) = ([0.0; CHANNELS], [1.0; 4 * CHANNELS]);
        let image = |side, pixels| Image {
            width: side,
            height: side,
            pixels,
        };
        let tiles = [
            Tile {
                cell: [0, 0],
                image: image(1, &dark),
            },
            Tile {
                cell: [9, 0],
                image: image(2, &light),
            },
        ];
        let texture = Texture {
            tiles: &tiles,
            extension: Extension::Extend,
            closest: false,
        };
        for (u, expected) in [(0.5, 0.0), (1.0, 0.0), (9.25, 1.0), (10.0, 1.0), (8.0, 1.0)] {
            assert_eq!(texture.at([u, 0.5], true)[0], expected, "at {u}");
        }
    }
}
