//! Distances from some vertices of an OFF mesh, timed and written for comparison with other
//! libraries: `geodesic_distances mesh.off out.bin [sources]`.
//!
//! The file holds the number of sources and of vertices as u32, the source ids as u32, then the
//! distances source by source as f32, little-endian, in the units of the OFF file.

mod off;

use std::error::Error;
use std::io::Write;
use std::time::Instant;

use sgmds_core::geodesics::{FastMarching, Workspace, farthest_points};
use sgmds_core::mesh::Mesh;

/// Rounds over all sources; the fastest is reported.
const ROUNDS: usize = 20;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let path = arguments.next().ok_or("which OFF file?")?;
    let output = arguments.next().ok_or("which output file?")?;
    let count: usize = arguments.next().map_or(Ok(20), |s| s.parse())?;
    let (vertices, faces) = off::read(&std::fs::read_to_string(path)?)?;
    let mesh = Mesh::new(&vertices, &faces)?;

    let begin = Instant::now();
    let marching = FastMarching::new(&mesh);
    println!("layout {:.3} ms", begin.elapsed().as_secs_f64() * 1e3);
    let begin = Instant::now();
    let samples = farthest_points(&marching, &mesh, mesh.vertices.len(), 500, &|| false)?;
    println!("500 samples {:.3} ms", begin.elapsed().as_secs_f64() * 1e3);

    let sources = &samples[..count.min(samples.len())];
    let n = mesh.vertices.len();
    let mut workspace = Workspace::new(&marching);
    let mut distances = vec![0.0; n * sources.len()];
    let mut fastest = f64::INFINITY;
    for _ in 0..ROUNDS {
        let begin = Instant::now();
        for (&source, out) in sources.iter().zip(distances.chunks_exact_mut(n)) {
            marching.march(source, &mut workspace, out);
        }
        fastest = fastest.min(begin.elapsed().as_secs_f64() * 1e3 / sources.len() as f64);
    }
    println!("{n} vertices: {fastest:.3} ms a source, one thread");

    let mut file = std::io::BufWriter::new(std::fs::File::create(output)?);
    let whole = vertices.len() as u32;
    for number in [sources.len() as u32, whole] {
        file.write_all(&number.to_le_bytes())?;
    }
    for &s in sources {
        file.write_all(&mesh.input_vertex[s as usize].0.to_le_bytes())?;
    }
    for row in distances.chunks_exact(n) {
        let mut given = vec![f32::INFINITY; vertices.len()];
        for (d, &v) in row.iter().zip(&mesh.input_vertex) {
            given[v.index()] = (f64::from(*d) * mesh.scale) as f32;
        }
        for d in given {
            file.write_all(&d.to_le_bytes())?;
        }
    }
    Ok(())
}
