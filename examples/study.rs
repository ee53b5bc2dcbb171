//! A study file from Rust: read it, run it, use the states in memory.
//!
//!     cargo run --release --example study -- examples/studies/spacecraft.toml

use std::path::PathBuf;

use glam::DVec3;
use polhode::study::Study;
use polhode::{Engine, Plan};

fn main() -> polhode::Result<()> {
    let file = std::env::args_os().nth(1).unwrap_or_else(|| "examples/studies/spacecraft.toml".into());
    let study = Study::read(&PathBuf::from(file))?;
    let scene = study.scene()?;
    let engine = Engine::cpu();
    let plan = Plan::new(&scene, &engine)?;
    println!(
        "{}: {} in {}, {} steps",
        study.title().unwrap_or("untitled"),
        plan.method(),
        plan.precision(),
        plan.steps()
    );

    let record = engine.run(&plan)?;
    for snapshot in record.snapshots() {
        for body in 0..snapshot.len().min(4) {
            let axis_world = snapshot.orientation(body) * DVec3::Z;
            println!("{:7.1} s  body {body}  z axis at {axis_world:+.4}", snapshot.time());
        }
    }
    println!("{}", record.trust());
    Ok(())
}
