//! Things joined into groups, step by step.

/// Disjoint groups of the numbers below a count.
#[derive(Debug)]
pub struct Unions {
    parent: Vec<u32>,
}

impl Unions {
    /// Every number in a group of its own.
    #[must_use]
    pub fn new(count: usize) -> Self {
        Self {
            parent: (0..count as u32).collect(),
        }
    }

    /// The lowest number of a group, which stands for it.
    pub fn root(&mut self, mut i: u32) -> u32 {
        while self.parent[i as usize] != i {
            self.parent[i as usize] = self.parent[self.parent[i as usize] as usize];
            i = self.parent[i as usize];
        }
        i
    }

    /// Makes one group of two.
    pub fn unite(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.parent[a.max(b) as usize] = a.min(b);
    }
}
