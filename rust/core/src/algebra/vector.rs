//! Vectors of three coordinates.

use std::array::from_fn;

/// Position or direction in space.
pub type Point = [f64; 3];

/// a + b.
#[must_use]
pub fn add(a: Point, b: Point) -> Point {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// a − b.
#[must_use]
pub fn sub(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// s·a.
#[must_use]
pub fn scaled(a: Point, s: f64) -> Point {
    [a[0] * s, a[1] * s, a[2] * s]
}

/// ⟨a, b⟩.
#[must_use]
pub fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// a × b.
#[must_use]
pub fn cross(a: Point, b: Point) -> Point {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// The matrix of these rows times v.
#[must_use]
pub fn by_rows(rows: &[Point; 3], v: Point) -> Point {
    rows.map(|row| dot(row, v))
}

/// The matrix of these columns times v.
#[must_use]
pub fn by_columns(columns: &[Point; 3], v: Point) -> Point {
    let [a, b, c] = [0, 1, 2].map(|i| scaled(columns[i], v[i]));
    add(a, add(b, c))
}

/// Mean of points, no sum of which overflows.
#[must_use]
pub fn mean(points: &[Point]) -> Point {
    let share = 1.0 / points.len() as f64;
    let sum = |sum, &p| add(sum, scaled(p, share));
    points.iter().fold([0.0; 3], sum)
}

/// The lowest and the highest corner of the box around points; around none, infinities the wrong way round.
pub fn bounds(points: impl IntoIterator<Item = Point>) -> [Point; 2] {
    around(points.into_iter().map(|p| [p; 2]))
}

/// The lowest and the highest corner of the box around boxes given so, as [`bounds`] has them of points.
pub fn around(boxes: impl IntoIterator<Item = [Point; 2]>) -> [Point; 2] {
    let none = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
    boxes.into_iter().fold(none, |[low, high], [p, q]| {
        [
            from_fn(|c| low[c].min(p[c])),
            from_fn(|c| high[c].max(q[c])),
        ]
    })
}

/// The largest side of the box around some points, 0 around none.
#[must_use]
pub fn extent(points: &[Point]) -> f64 {
    let [low, high] = bounds(points.iter().copied());
    sub(high, low).into_iter().fold(0.0, f64::max)
}

/// Euclidean length.
#[must_use]
pub fn norm(a: Point) -> f64 {
    dot(a, a).sqrt()
}

/// a / ‖a‖, or zero when a is zero.
#[must_use]
pub fn normalised(a: Point) -> Point {
    let length = norm(a);
    if length > 0.0 {
        scaled(a, 1.0 / length)
    } else {
        [0.0; 3]
    }
}

/// Two unit vectors that make a right-handed frame with a unit normal.
#[must_use]
pub fn tangent_frame(normal: Point) -> [Point; 2] {
    let smallest = (0..3).fold(0, |best, c| {
        if normal[c].abs() < normal[best].abs() {
            c
        } else {
            best
        }
    });
    let mut axis = [0.0; 3];
    axis[smallest] = 1.0;
    let first = normalised(cross(normal, axis));
    [first, cross(normal, first)]
}

/// ‖a − b‖.
#[must_use]
pub fn distance(a: Point, b: Point) -> f64 {
    norm(sub(a, b))
}
