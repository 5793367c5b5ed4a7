//! The map between two OFF meshes, to compare what different systems and processors make of it:
//! `match_files source.off target.off > map.txt`.
//!
//! A line for each target vertex: the triangle of the source, the weights of its corners, the confidence. What
//! instructions were chosen and the grade go to standard error.

mod off;

use std::error::Error;
use std::fmt::Write;

use sgmds_core::figure::{Figure, graded, match_figures};
use sgmds_core::geodesics::metric::Metric;
use sgmds_core::matching::Options;
use sgmds_core::watch::progress::Progress;

fn main() -> Result<(), Box<dyn Error>> {
    let progress = Progress::default();
    let unheard = |_: &'static str, _: f64| progress.check();
    let figure = |path: Option<String>| -> Result<Figure, Box<dyn Error>> {
        let text = std::fs::read_to_string(path.ok_or("which two OFF files?")?)?;
        let (vertices, faces) = off::read(&text)?;
        Ok(Figure::new(
            &vertices,
            &faces,
            Metric::Euclidean,
            &progress,
            &unheard,
        )?)
    };
    let mut paths = std::env::args().skip(1);
    let (source, target) = (figure(paths.next())?, figure(paths.next())?);
    let found = match_figures(&source, &target, &Options::default(), &progress, &unheard)?;
    let mut text = String::new();
    let map = &found.map;
    for ((face, [a, b, c]), confidence) in
        map.faces.iter().zip(&map.barycentric).zip(&map.confidence)
    {
        // Sixteen decimals give every number back to the last bit.
        writeln!(text, "{face} {a:.16e} {b:.16e} {c:.16e} {confidence:.16e}")?;
    }
    print!("{text}");
    let arch = pulp::Arch::new();
    let (grade, _) = graded(&found, &source, &target);
    let (system, processor) = (std::env::consts::OS, std::env::consts::ARCH);
    eprintln!("{system} {processor} {arch:?} {grade:?}");
    Ok(())
}
