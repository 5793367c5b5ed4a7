//! Sparse grid: bricks of 4 × 4 × 4 points, of which only those near the surface hold values.

/// Points of a brick along an axis.
pub(super) const SIDE: usize = 4;

/// Points of a brick.
pub(super) const POINTS: usize = SIDE * SIDE * SIDE;

/// Values of a brick, x fastest.
pub(super) type Values<T> = [T; POINTS];

/// Brick without values, all of it outside.
pub(super) const OUTSIDE: u32 = u32::MAX;

/// Brick without values, all of it inside.
pub(super) const INSIDE: u32 = u32::MAX - 1;

/// Which bricks there are.
#[derive(Debug, Clone)]
pub(super) struct Grid {
    pub origin: [f32; 3],
    pub step: f32,
    /// Bricks along each axis.
    pub bricks: [usize; 3],
    /// Place of each brick's values among those of all, [`OUTSIDE`] or [`INSIDE`]; x fastest.
    pub slots: Vec<u32>,
    /// The bricks that have values, in the order of those.
    pub active: Vec<u32>,
}

/// Number of a point within its brick.
pub(super) fn local(point: [usize; 3]) -> usize {
    point[0] % SIDE + SIDE * (point[1] % SIDE + SIDE * (point[2] % SIDE))
}

impl Grid {
    /// Bricks over a box, none of them with values.
    pub fn over(low: [f32; 3], high: [f32; 3], step: f32) -> Self {
        let bricks =
            [0, 1, 2].map(|i| (((high[i] - low[i]) / step).ceil() as usize + 1).div_ceil(SIDE));
        Self {
            origin: low,
            step,
            bricks,
            slots: vec![OUTSIDE; bricks.iter().product()],
            active: Vec::new(),
        }
    }

    /// Position of a brick among all.
    pub fn brick_at(&self, brick: u32) -> [usize; 3] {
        let brick = brick as usize;
        let [x, y, _] = self.bricks;
        [brick % x, brick / x % y, brick / (x * y)]
    }

    /// First point of a brick.
    pub fn corner(&self, brick: u32) -> [usize; 3] {
        self.brick_at(brick).map(|b| b * SIDE)
    }

    /// Place of a point.
    pub fn place(&self, point: [usize; 3]) -> [f32; 3] {
        [0, 1, 2].map(|i| self.origin[i] + self.step * point[i] as f32)
    }

    /// Half of what the points of a brick take up along an axis.
    pub fn half(&self) -> f32 {
        self.step * (SIDE - 1) as f32 / 2.0
    }

    /// Middle of the points of a brick.
    pub fn middle(&self, brick: u32) -> [f32; 3] {
        self.place(self.corner(brick)).map(|x| x + self.half())
    }

    /// Points of a brick in the order of its values.
    pub fn points(&self, brick: u32) -> impl Iterator<Item = [usize; 3]> {
        let [x, y, z] = self.corner(brick);
        (0..POINTS).map(move |n| [x + n % SIDE, y + n / SIDE % SIDE, z + n / (SIDE * SIDE)])
    }

    /// Number of the brick at a position.
    pub fn brick(&self, at: [usize; 3]) -> usize {
        at[0] + self.bricks[0] * (at[1] + self.bricks[1] * at[2])
    }

    /// Slot of the brick of a point; outside the grid there is [`OUTSIDE`].
    pub fn slot(&self, point: [usize; 3]) -> u32 {
        let at = point.map(|x| x / SIDE);
        if (0..3).any(|i| at[i] >= self.bricks[i]) {
            return OUTSIDE;
        }
        self.slots[self.brick(at)]
    }

    /// The up to 26 bricks around one.
    pub fn around(&self, brick: u32) -> impl Iterator<Item = u32> {
        let at = self.brick_at(brick);
        (0..27).filter(|&n| n != 13).filter_map(move |n| {
            let [x, y, z] = [n % 3, n / 3 % 3, n / 9];
            let shifted = [at[0] + x, at[1] + y, at[2] + z];
            let fits = (0..3).all(|i| (1..=self.bricks[i]).contains(&shifted[i]));
            fits.then(|| self.brick(shifted.map(|s| s - 1)) as u32)
        })
    }

    /// How many bricks with values have one outside beside them.
    pub fn outer(&self) -> usize {
        let is_outside = |other: u32| self.slots[other as usize] == OUTSIDE;
        let is_outer = |&&brick: &&u32| self.around(brick).any(is_outside);
        self.active.iter().filter(is_outer).count()
    }

    /// Gives a brick values, which its caller appends to those of all.
    pub fn activate(&mut self, brick: u32) {
        self.slots[brick as usize] = self.active.len() as u32;
        self.active.push(brick);
    }

    /// Value of a brick without values.
    pub fn constant(slot: u32, far: f32) -> f32 {
        if slot == INSIDE { -far } else { far }
    }
}
