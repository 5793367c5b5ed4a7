//! Where the source's seams run over the target's faces, as cuts from edge to edge.

use std::collections::{HashMap, HashSet};

use rayon::prelude::*;

use crate::algebra::vector::{self, Point};
use crate::error::Result;
use crate::mesh::Adjacency;
use crate::mesh::surface_point::{SurfacePoint, nearest_in_triangle};
use crate::transfer::corners::{CornerValues, ON_EDGE, Polygons, triangles_around};
use crate::transfer::settings::SEAM_CUTS;
use crate::transfer::surface::{NONE, Surface, blend};
use crate::transfer::surface_map::{SurfaceMap, check_table};
use crate::transfer::trace::{Crossing, crossings};

/// Where seams meet within a face, the point stays this far from the face's corners, in
/// barycentric weights.
const INSIDE: f64 = 0.1;

/// A new point of the target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CutPoint {
    /// The edge that it divides, none for a point within a face.
    pub edge: Option<[u32; 2]>,
    /// Share of the way from the first vertex of the edge to the second.
    pub share: f64,
    /// Where it lies.
    pub position: Point,
    /// Its image, on a seam.
    pub image: SurfacePoint,
}

/// A cut through a face between two of the target's vertices and new points; point i is number
/// n + i.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cut {
    /// The face.
    pub face: u32,
    /// Where the cut begins and ends.
    pub ends: [u32; 2],
}

/// What separates the target's faces along the images of seams.
#[derive(Debug, Default)]
pub struct SeamCuts {
    /// New points; those of one edge in the order of their coverage.
    pub points: Vec<CutPoint>,
    /// Cuts, in an order in which they can be made.
    pub cuts: Vec<Cut>,
    /// Vertices that lay beside a seam, and their new images on it.
    pub moved: Vec<(u32, SurfacePoint)>,
}

/// Traces borders of values at the corners of the source's triangles over the target's faces.
///
/// Every edge of the target is followed on the source; where it crosses a border there is a point.
/// Two points in a face are joined by a cut. With more of them each stretch of the face's rim that
/// has one and the same side before and after it is cut off; where three or more sides meet, a
/// point within the face is joined to all. Faces in which a border ends stay whole.
///
/// # Errors
/// [`crate::Error::BadArgument`] when there are not three values for each source triangle.
pub fn seam_cuts(
    map: &SurfaceMap,
    faces: &Polygons,
    values: &CornerValues<'_>,
) -> Result<SeamCuts> {
    let rows = 3 * map.source.triangles.len();
    check_table("values", values.values.len(), rows, values.channels)?;
    let mut tracer = Tracer::new(map, faces, values.open(&map.source));
    let moved = tracer.snap();
    let found: Vec<FaceCuts> = (0..faces.len())
        .into_par_iter()
        .map(|f| tracer.face(f))
        .collect();
    let used: HashSet<Spot> = found
        .iter()
        .flat_map(|f| {
            f.cuts
                .iter()
                .flatten()
                .chain(f.star.iter().flat_map(|s| &s.rim))
        })
        .copied()
        .collect();
    let mut made = SeamCuts {
        moved,
        ..SeamCuts::default()
    };
    let n = map.target.vertices.len() as u32;
    let mut number: HashMap<Spot, u32> = HashMap::new();
    for (e, &[a, b]) in tracer.edges.iter().enumerate() {
        for (order, crossing) in tracer.ways[e].iter().enumerate() {
            let spot = Spot::Edge(e as u32, order as u32);
            if used.contains(&spot) {
                number.insert(spot, n + made.points.len() as u32);
                let ends = [a, b].map(|v| map.target.vertices[v as usize]);
                made.points.push(CutPoint {
                    edge: Some([a, b]),
                    share: crossing.share,
                    position: vector::add(
                        vector::scaled(ends[0], 1.0 - crossing.share),
                        vector::scaled(ends[1], crossing.share),
                    ),
                    image: crossing.place,
                });
            }
        }
    }
    let place = |spot: &Spot| match spot {
        Spot::Vertex(v) => *v,
        Spot::Edge(..) => number[spot],
    };
    for (face, found) in (0..).zip(&found) {
        for cut in &found.cuts {
            let ends = [place(&cut[0]), place(&cut[1])];
            made.cuts.push(Cut { face, ends });
        }
        if let Some(star) = &found.star {
            let centre = n + made.points.len() as u32;
            made.points.push(CutPoint {
                edge: None,
                share: 0.0,
                position: star.position,
                image: star.image,
            });
            for spot in &star.rim {
                let ends = [place(spot), centre];
                made.cuts.push(Cut { face, ends });
            }
        }
    }
    Ok(made)
}

/// A place on a face's rim that lies on a seam.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum Spot {
    Vertex(u32),
    /// An edge and the number of the crossing on it.
    Edge(u32, u32),
}

/// A spot on the rim of one face, with the triangle of the source behind it on the rim.
#[derive(Debug, Clone, Copy)]
struct RimSpot {
    spot: Spot,
    /// Corner of the face at or after which it lies.
    corner: usize,
    /// Where the rim goes on; none when it follows the seam.
    after: Option<u32>,
}

#[derive(Debug, Default)]
struct FaceCuts {
    cuts: Vec<[Spot; 2]>,
    star: Option<Star>,
}

/// A point within a face where seams meet.
#[derive(Debug)]
struct Star {
    rim: Vec<Spot>,
    position: Point,
    image: SurfacePoint,
}

struct Tracer<'a> {
    map: &'a SurfaceMap,
    faces: &'a Polygons,
    open: Vec<[bool; 3]>,
    around: Adjacency,
    /// Source vertices on a seam.
    on_seam: Vec<bool>,
    /// Vertices of the target's edges, ascending.
    edges: Vec<[u32; 2]>,
    /// Edge after each corner.
    edge_after: Vec<u32>,
    /// Seams on the way along each edge.
    ways: Vec<Vec<Crossing>>,
    points: Vec<SurfacePoint>,
}

impl<'a> Tracer<'a> {
    fn new(map: &'a SurfaceMap, faces: &'a Polygons, open: Vec<[bool; 3]>) -> Self {
        let mut on_seam = vec![false; map.source.vertices.len()];
        for (t, corners) in map.source.triangles.iter().enumerate() {
            for k in 0..3 {
                if is_seam(&map.source, &open, t, k) {
                    on_seam[corners[k] as usize] = true;
                    on_seam[corners[(k + 1) % 3] as usize] = true;
                }
            }
        }
        let mut number: HashMap<[u32; 2], u32> = HashMap::new();
        let mut edges = Vec::new();
        let mut edge_after = Vec::with_capacity(faces.vertices.len());
        for f in 0..faces.len() {
            let row = faces.row(f);
            for (i, &a) in row.iter().enumerate() {
                let b = row[(i + 1) % row.len()];
                let edge = [a.min(b), a.max(b)];
                edge_after.push(*number.entry(edge).or_insert_with(|| {
                    edges.push(edge);
                    edges.len() as u32 - 1
                }));
            }
        }
        Self {
            around: triangles_around(&map.source),
            ways: vec![Vec::new(); edges.len()],
            points: map.points.clone(),
            map,
            faces,
            open,
            on_seam,
            edges,
            edge_after,
        }
    }

    /// Follows all edges, and puts vertices beside a seam onto it; returns these.
    fn snap(&mut self) -> Vec<(u32, SurfacePoint)> {
        self.follow(|_| true);
        let mut nearest: HashMap<u32, (f64, SurfacePoint)> = HashMap::new();
        for (edge, way) in self.edges.iter().zip(&self.ways) {
            let length = self.length(*edge);
            let ends = [
                way.first().map(|c| (edge[0], c.share, c)),
                way.last().map(|c| (edge[1], 1.0 - c.share, c)),
            ];
            for (v, share, crossing) in ends.into_iter().flatten() {
                if share < SEAM_CUTS.snap && !self.is_on_seam(v) {
                    let found = (share * length, crossing.place);
                    nearest
                        .entry(v)
                        .and_modify(|best| {
                            if found.0 < best.0 {
                                *best = found;
                            }
                        })
                        .or_insert(found);
                }
            }
        }
        let mut moved: Vec<(u32, SurfacePoint)> =
            nearest.into_iter().map(|(v, (_, p))| (v, p)).collect();
        moved.sort_unstable_by_key(|(v, _)| *v);
        for &(v, place) in &moved {
            self.points[v as usize] = place;
        }
        let again: HashSet<u32> = moved.iter().map(|(v, _)| *v).collect();
        self.follow(|edge| edge.iter().any(|v| again.contains(v)));
        let held = self.held();
        for (edge, way) in self.edges.iter().zip(&mut self.ways) {
            let [first, last] = edge.map(|v| held[v as usize]);
            way.retain(|c| {
                !(first && c.share < SEAM_CUTS.snap || last && c.share > 1.0 - SEAM_CUTS.snap)
            });
        }
        moved
    }

    /// Follows edges; one from seam to seam is taken to lie along it, as cuts do that were made before.
    fn follow(&mut self, wanted: impl Fn(&[u32; 2]) -> bool + Sync) {
        let held = self.held();
        let (source, open, points) = (&self.map.source, &self.open, &self.points);
        self.edges
            .par_iter()
            .zip(&mut self.ways)
            .filter(|(edge, _)| wanted(edge))
            .for_each(|(edge, way)| {
                *way = if edge.iter().all(|&v| held[v as usize]) {
                    Vec::new()
                } else {
                    let [from, to] = edge.map(|v| points[v as usize]);
                    crossings(source, open, &from, &to).unwrap_or_default()
                };
            });
    }

    /// Which target vertices lie on a seam.
    fn held(&self) -> Vec<bool> {
        (0..self.points.len() as u32)
            .map(|v| self.is_on_seam(v))
            .collect()
    }

    fn length(&self, edge: [u32; 2]) -> f64 {
        let [a, b] = edge.map(|v| self.map.source.position(&self.points[v as usize]));
        vector::distance(a, b)
    }

    /// Corners of the source's triangle that a target vertex's image leans on.
    fn touched(&self, vertex: u32) -> Vec<usize> {
        let point = &self.points[vertex as usize];
        (0..3).filter(|&k| point.weights[k] > ON_EDGE).collect()
    }

    /// The source's vertex on which a target vertex lies.
    fn source_vertex(&self, vertex: u32) -> Option<u32> {
        let corners = self.map.source.triangles[self.points[vertex as usize].face as usize];
        match self.touched(vertex)[..] {
            [k] => Some(corners[k]),
            _ => None,
        }
    }

    /// Whether a target vertex lies on a seam.
    fn is_on_seam(&self, vertex: u32) -> bool {
        if let Some(v) = self.source_vertex(vertex) {
            return self.on_seam[v as usize];
        }
        let [i, j] = self.touched(vertex)[..] else {
            return false;
        };
        let face = self.points[vertex as usize].face as usize;
        is_seam(
            &self.map.source,
            &self.open,
            face,
            if j == i + 1 { i } else { j },
        )
    }

    fn face(&self, f: usize) -> FaceCuts {
        let rim = self.rim(f);
        // Neighbouring vertices on a seam are one place: a cut may end at any of them.
        let mut groups: Vec<Vec<RimSpot>> = Vec::new();
        for (i, &spot) in rim.iter().enumerate() {
            let last = rim[(i + rim.len() - 1) % rim.len()];
            match groups.last_mut() {
                Some(group) if last.after.is_none() => group.push(spot),
                _ => groups.push(vec![spot]),
            }
        }
        if groups.len() > 1 && rim.last().is_some_and(|s| s.after.is_none()) {
            let first = groups.remove(0);
            groups
                .last_mut()
                .expect("there were two groups")
                .extend(first);
        }
        let crossed = rim.iter().any(|s| matches!(s.spot, Spot::Edge(..)));
        match groups.len() {
            0 | 1 => FaceCuts::default(),
            2 if crossed => FaceCuts {
                cuts: self.cut(f, &groups[0], &groups[1]).into_iter().collect(),
                star: None,
            },
            _ => self.divided(f, groups),
        }
    }

    /// Spots on the rim of a face, in its order.
    fn rim(&self, f: usize) -> Vec<RimSpot> {
        let row = self.faces.row(f);
        let mut rim = Vec::new();
        for (corner, &v) in row.iter().enumerate() {
            let next = row[(corner + 1) % row.len()];
            let e = self.edge_after[self.faces.starts[f] as usize + corner];
            let way = &self.ways[e as usize];
            let forward = self.edges[e as usize][0] == v;
            let order: Vec<usize> = if forward {
                (0..way.len()).collect()
            } else {
                (0..way.len()).rev().collect()
            };
            let sides = |k: usize| {
                let crossing = &way[k];
                if forward {
                    (crossing.before, crossing.beyond)
                } else {
                    (crossing.beyond, crossing.before)
                }
            };
            if self.is_on_seam(v) {
                let after = match order.first() {
                    Some(&k) => Some(sides(k).0),
                    None if self.is_on_seam(next) => None,
                    None => Some(self.points[next as usize].face),
                };
                let spot = Spot::Vertex(v);
                rim.push(RimSpot {
                    spot,
                    corner,
                    after,
                });
            }
            rim.extend(order.into_iter().map(|k| RimSpot {
                spot: Spot::Edge(e, k as u32),
                corner,
                after: Some(sides(k).1),
            }));
        }
        rim
    }

    /// A cut between two groups, from the nearest pair that does not lie on one edge of the face.
    fn cut(&self, f: usize, a: &[RimSpot], b: &[RimSpot]) -> Option<[Spot; 2]> {
        let count = self.faces.row(f).len();
        let edges = |s: &RimSpot| match s.spot {
            Spot::Vertex(_) => [(s.corner + count - 1) % count, s.corner],
            Spot::Edge(..) => [s.corner; 2],
        };
        a.iter()
            .flat_map(|s| b.iter().map(move |t| (s, t)))
            .filter(|(s, t)| edges(s).iter().all(|e| !edges(t).contains(e)))
            .map(|(s, t)| {
                let length = vector::distance(self.position(s.spot), self.position(t.spot));
                (length, [s.spot, t.spot])
            })
            .min_by(|x, y| x.0.total_cmp(&y.0))
            .map(|(_, ends)| ends)
    }

    fn position(&self, spot: Spot) -> Point {
        let at = |v: u32| self.map.target.vertices[v as usize];
        match spot {
            Spot::Vertex(v) => at(v),
            Spot::Edge(e, k) => {
                let [a, b] = self.edges[e as usize].map(at);
                let share = self.ways[e as usize][k as usize].share;
                vector::add(vector::scaled(a, 1.0 - share), vector::scaled(b, share))
            }
        }
    }

    /// Cuts of a face with more spots than two, by the sides on which its rim runs.
    fn divided(&self, f: usize, mut groups: Vec<Vec<RimSpot>>) -> FaceCuts {
        let sides = self.sides(f, &groups);
        let Some(mut runs) = groups
            .iter()
            .map(|g| {
                let seed = g.last().and_then(|s| s.after)?;
                sides.get(&seed).copied()
            })
            .collect::<Option<Vec<u32>>>()
        else {
            return FaceCuts::default();
        };
        let mut cuts = Vec::new();
        // Run i goes from group i to the next.
        loop {
            let n = runs.len();
            if let Some(i) = (0..n).find(|&i| n > 1 && runs[i] == runs[(i + 1) % n]) {
                // One side before and after a spot: there is nothing to separate.
                groups.remove((i + 1) % n);
                runs.remove((i + 1) % n);
                continue;
            }
            if n < 2 {
                return FaceCuts { cuts, star: None };
            }
            if n == 2 {
                cuts.extend(self.cut(f, &groups[0], &groups[1]));
                return FaceCuts { cuts, star: None };
            }
            let ear = (0..n).find(|&i| runs[(i + n - 1) % n] == runs[(i + 1) % n]);
            let Some(i) = ear else {
                return self.meeting(f, cuts, &groups, &runs, &sides);
            };
            let next = (i + 1) % n;
            cuts.extend(self.cut(f, &groups[i], &groups[next]));
            // What is left has the runs before and after as one.
            for gone in [i.max(next), i.min(next)] {
                groups.remove(gone);
                runs.remove(gone);
            }
        }
    }

    /// Number of the side of each triangle of the source under a face.
    fn sides(&self, f: usize, groups: &[Vec<RimSpot>]) -> HashMap<u32, u32> {
        let source = &self.map.source;
        let (centre, radius) = self.under(f);
        let mut sides: HashMap<u32, u32> = HashMap::new();
        for (number, seed) in (0..).zip(groups.iter().flatten().filter_map(|s| s.after)) {
            let mut stack = vec![seed];
            while let Some(t) = stack.pop() {
                if sides.contains_key(&t) {
                    continue;
                }
                sides.insert(t, number);
                for k in 0..3 {
                    if self.open[t as usize][k] {
                        let s = source.across[t as usize][k];
                        if source.to_triangle(centre, s).0 <= radius * radius {
                            stack.push(s);
                        }
                    }
                }
            }
        }
        sides
    }

    /// Middle of a face's image and the distance of its furthest corner.
    fn under(&self, f: usize) -> (Point, f64) {
        let row = self.faces.row(f);
        let images = row
            .iter()
            .map(|&v| self.map.source.position(&self.points[v as usize]));
        let sum = images.clone().fold([0.0; 3], vector::add);
        let centre = vector::scaled(sum, 1.0 / row.len() as f64);
        let radius = images
            .map(|p| vector::distance(p, centre))
            .fold(0.0, f64::max);
        (centre, radius)
    }

    /// Cuts from where all sides meet to all groups: from a spot of the rim or a point within.
    fn meeting(
        &self,
        f: usize,
        mut cuts: Vec<[Spot; 2]>,
        groups: &[Vec<RimSpot>],
        runs: &[u32],
        sides: &HashMap<u32, u32>,
    ) -> FaceCuts {
        let Some((v, image)) = self.junction(f, runs, sides) else {
            return FaceCuts { cuts, star: None };
        };
        let there = |s: &RimSpot| match s.spot {
            Spot::Vertex(u) => self.source_vertex(u) == Some(v),
            Spot::Edge(..) => false,
        };
        if let Some(meeting) = groups.iter().find(|g| g.iter().any(there)) {
            let others = groups.iter().filter(|g| !g.iter().any(there));
            cuts.extend(others.filter_map(|other| self.cut(f, meeting, other)));
            return FaceCuts { cuts, star: None };
        }
        let star = Star {
            rim: groups.iter().map(|g| g[0].spot).collect(),
            position: self.within(f, self.map.source.vertices[v as usize]),
            image,
        };
        FaceCuts {
            cuts,
            star: Some(star),
        }
    }

    /// The vertex of the source nearest to a face's middle at which all sides meet.
    fn junction(
        &self,
        f: usize,
        runs: &[u32],
        sides: &HashMap<u32, u32>,
    ) -> Option<(u32, SurfacePoint)> {
        let source = &self.map.source;
        let (centre, _) = self.under(f);
        let meets = |v: u32| {
            runs.iter().all(|run| {
                self.around
                    .row(v as usize)
                    .iter()
                    .any(|t| sides.get(t) == Some(run))
            })
        };
        let away = |v: u32| vector::distance(source.vertices[v as usize], centre);
        let (v, face) = sides
            .keys()
            .flat_map(|&t| source.triangles[t as usize].map(|v| (v, t)))
            .filter(|&(v, _)| meets(v))
            .min_by(|a, b| away(a.0).total_cmp(&away(b.0)).then(a.cmp(b)))?;
        let weights = source.triangles[face as usize].map(|u| f64::from(u8::from(u == v)));
        Some((v, SurfacePoint { face, weights }))
    }

    /// The place inside a face of the target whose image is nearest to a point.
    fn within(&self, f: usize, goal: Point) -> Point {
        let row = self.faces.row(f);
        let (_, fan, weights) = (1..row.len() - 1)
            .map(|i| {
                let fan = [row[0], row[i], row[i + 1]];
                let images = fan.map(|v| self.map.source.position(&self.points[v as usize]));
                let (distance, weights) = nearest_in_triangle(goal, images);
                (distance, fan, weights)
            })
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .expect("a face has three corners or more");
        let held = weights.map(|w| w.max(INSIDE));
        let total: f64 = held.iter().sum();
        blend(
            fan.map(|v| self.map.target.vertices[v as usize]),
            held.map(|w| w / total),
        )
    }
}

/// Whether an edge lies on a seam: borders of the surface itself are none.
fn is_seam(surface: &Surface, open: &[[bool; 3]], t: usize, k: usize) -> bool {
    surface.across[t][k] != NONE && !open[t][k]
}
