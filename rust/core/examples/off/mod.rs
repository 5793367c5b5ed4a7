//! Triangle meshes in OFF, for the examples.

use std::error::Error;

pub type Triangles = (Vec<[f64; 3]>, Vec<[i64; 3]>);

/// Vertices and faces of a file's text.
pub fn read(text: &str) -> Result<Triangles, Box<dyn Error>> {
    let mut words = text
        .lines()
        .map(|line| line.split('#').next().unwrap_or(""))
        .flat_map(str::split_whitespace)
        .skip(1);
    let mut next = || words.next().ok_or("the file ends early");
    let (vertices, faces): (usize, usize) = (next()?.parse()?, next()?.parse()?);
    next()?;
    let mut positions = Vec::with_capacity(vertices);
    for _ in 0..vertices {
        positions.push([next()?.parse()?, next()?.parse()?, next()?.parse()?]);
    }
    let mut triangles = Vec::with_capacity(faces);
    for _ in 0..faces {
        let corners: usize = next()?.parse()?;
        let face: Vec<i64> = (0..corners)
            .map(|_| Ok(next()?.parse()?))
            .collect::<Result<_, Box<dyn Error>>>()?;
        triangles.push(face.try_into().map_err(|_| "triangles only")?);
    }
    Ok((positions, triangles))
}
