//! Times the operator and its eigenpairs: `spectrum_timing [k] [mesh.off]`; a blob of 5,000
//! vertices when no mesh is given. Prints vertices, times, solves and the residual.

// Indices of these meshes are far below 2^63.
#![allow(clippy::cast_possible_wrap)]

mod off;

use std::time::Instant;

use sgmds_core::mesh::Mesh;
use sgmds_core::spectrum::eigenbasis::Eigenbasis;
use sgmds_core::spectrum::laplacian::Laplacian;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let k: usize = arguments.next().map_or(Ok(200), |a| a.parse())?;
    let (vertices, faces) = match arguments.next() {
        Some(path) => off::read(&std::fs::read_to_string(path)?)?,
        None => blob(71, 70),
    };
    let mesh = Mesh::new(&vertices, &faces)?;
    println!("{} vertices, k = {k}", mesh.vertices.len());
    for _ in 0..5 {
        let start = Instant::now();
        let laplacian = Laplacian::new(&mesh)?;
        let operator = start.elapsed();
        let start = Instant::now();
        let basis = Eigenbasis::new(&laplacian, k, &|| false)?;
        println!(
            "operator {:.1} ms, eigenpairs {:.1} ms, {} solves, residual/λ_k {:.1e}, λ₁ {:.6}, λ_k {:.6}",
            operator.as_secs_f64() * 1e3,
            start.elapsed().as_secs_f64() * 1e3,
            basis.solves,
            basis.residual / basis.values[k - 1],
            basis.values[1],
            basis.values[k - 1],
        );
    }
    Ok(())
}

/// A sphere with lobes: rings of latitude between two poles.
fn blob(rings: usize, around: usize) -> off::Triangles {
    let at = |theta: f64, phi: f64| {
        let r = 1.0 + 0.3 * (3.0 * theta).cos() * (2.0 * phi).sin() * theta.sin();
        [
            r * theta.sin() * phi.cos(),
            1.7 * r * theta.sin() * phi.sin(),
            0.6 * r * theta.cos(),
        ]
    };
    let mut vertices = vec![at(0.0, 0.0)];
    for i in 1..=rings {
        let theta = std::f64::consts::PI * i as f64 / (rings + 1) as f64;
        for j in 0..around {
            let turn = j as f64 + 0.5 * (i % 2) as f64;
            vertices.push(at(theta, std::f64::consts::TAU * turn / around as f64));
        }
    }
    vertices.push(at(std::f64::consts::PI, 0.0));
    let south = vertices.len() - 1;
    let id = |i: usize, j: usize| (1 + (i - 1) * around + j % around) as i64;
    let mut faces = Vec::new();
    for j in 0..around {
        faces.push([0, id(1, j), id(1, j + 1)]);
        faces.push([south as i64, id(rings, j + 1), id(rings, j)]);
    }
    for i in 1..rings {
        for j in 0..around {
            let (a, b, c, d) = (id(i, j), id(i, j + 1), id(i + 1, j), id(i + 1, j + 1));
            if i % 2 == 1 {
                faces.extend([[a, c, b], [b, c, d]]);
            } else {
                faces.extend([[a, c, d], [a, d, b]]);
            }
        }
    }
    (vertices, faces)
}
