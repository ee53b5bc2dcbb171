//! Many bodies: 100,000 asymmetric tops, on a GPU where there is a real one, else on all cores.
//!
//!     cargo run --release --example ensemble

use glam::{DQuat, DVec3};
use polhode::{Accuracy, Engine, Ensemble, Plan, Scene};

fn main() -> polhode::Result<()> {
    // Body i is a function of i, so that the ensemble can be made on all cores, and made again.
    let ensemble = Ensemble::from_fn(100_000, |body| {
        let part = body as f64 / 100_000.0;
        let moments = DVec3::new(1.0, 1.2 + 0.3 * part, 1.8);
        (moments, DQuat::IDENTITY, DVec3::new(0.1, 1.0, part))
    })?;

    let scene = Scene::new(ensemble).until(60.0).accuracy(Accuracy::attitude(1e-5));
    let engine = Engine::auto()?;
    let record = engine.run(&Plan::new(&scene, &engine)?)?;

    let end = record.final_state();
    println!("body 0 points its x axis to {:.6}", end.orientation(0) * DVec3::X);
    // What is conserved says how far the answer can be trusted.
    println!("{}", record.trust());
    let seconds = record.trust().wall_time.compute;
    println!("{:.2e} body-steps a second", record.trust().body_steps as f64 / seconds);
    Ok(())
}
