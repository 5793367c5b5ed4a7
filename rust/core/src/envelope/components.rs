//! Connected components of the level set.

use super::grid::Grid;
use super::place::{Place, add, cross, dot, scaled, sub};
use super::surface::{Level, Nets};

/// Steps, in cells, that are gone from a face along its normal until the level set is met.
const STEPS: [f32; 9] = [0.0, 0.5, -0.5, 1.0, -1.0, 1.5, -1.5, 2.0, 3.0];

/// Which vertex of a level set belongs to which component.
pub(super) struct Components {
    /// Lowest vertex of the component of each vertex.
    pub of_vertex: Vec<u32>,
    /// Of those that face outwards the one with the largest area.
    pub main: Option<u32>,
    /// How many face outwards; the others are hollows.
    pub outer: usize,
}

impl Nets {
    pub fn components(&self) -> Components {
        let mut parent: Vec<u32> = (0..self.vertices.len() as u32).collect();
        let find = |parent: &mut Vec<u32>, mut v: u32| {
            while parent[v as usize] != v {
                parent[v as usize] = parent[parent[v as usize] as usize];
                v = parent[v as usize];
            }
            v
        };
        for q in &self.quads {
            for other in [q[1], q[2], q[3]] {
                let (a, b) = (find(&mut parent, q[0]), find(&mut parent, other));
                parent[a.max(b) as usize] = a.min(b);
            }
        }
        let count = parent.len() as u32;
        let of_vertex: Vec<u32> = (0..count).map(|v| find(&mut parent, v)).collect();
        // Area and volume of each.
        let mut sizes = vec![(0.0f64, 0.0f64); of_vertex.len()];
        for q in &self.quads {
            let [a, b, c, d] = q.map(|v| self.vertices[v as usize]);
            let normal = cross(sub(c, a), sub(d, b));
            let middle = scaled(add(add(a, b), add(c, d)), 0.25);
            let (area, volume) = &mut sizes[of_vertex[q[0] as usize] as usize];
            *area += f64::from(dot(normal, normal).sqrt());
            *volume += f64::from(dot(normal, middle));
        }
        let outer = || (0..count).filter(|&v| sizes[v as usize].1 > 0.0);
        let larger = |best: u32, v: u32| {
            if sizes[v as usize].0 > sizes[best as usize].0 {
                v
            } else {
                best
            }
        };
        Components {
            main: outer().reduce(larger),
            outer: outer().count(),
            of_vertex,
        }
    }
}

impl Components {
    /// Component that is met first along the normal of a face from a place; nothing deep inside or far from all of them.
    pub fn at(&self, nets: &Nets, level: &Level, place: Place, normal: Place) -> Option<u32> {
        let grid = &level.grid;
        let met = STEPS.iter().find_map(|step| {
            let at = add(place, scaled(normal, step * grid.step));
            nets.vertex(grid, grid.cell(at))
        });
        met.map(|vertex| self.of_vertex[vertex as usize])
    }
}

impl Level {
    /// Whether the first corner of the cell of a place is inside.
    pub fn is_inside(&self, place: Place) -> bool {
        self.value(self.grid.cell(place)) < 0.0
    }
}

impl Grid {
    /// Cell in which a place lies.
    fn cell(&self, place: Place) -> [usize; 3] {
        [0, 1, 2].map(|i| ((place[i] - self.origin[i]) / self.step) as usize)
    }
}
