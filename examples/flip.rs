//! One body: the flip of a book thrown with a spin about its middle axis.
//!
//!     cargo run --release --example flip

use glam::{DQuat, DVec3};
use polhode::{Accuracy, Engine, Ensemble, Outputs, Plan, Scene};

fn main() -> polhode::Result<()> {
    // Moments along the body axes, kg m²: y is the axis of the intermediate one.
    let moments = DVec3::new(1.0, 2.0, 3.0);
    // A spin about y, and a thousandth of it about the others.
    let angular_velocity_body = DVec3::new(0.005, 5.0, 0.005);
    let ensemble = Ensemble::from_columns(&[moments], &[DQuat::IDENTITY], &[angular_velocity_body])?;

    let scene = Scene::new(ensemble).until(10.0).outputs(Outputs::Every(0.25)).accuracy(Accuracy::attitude(1e-8));
    let engine = Engine::cpu();
    let record = engine.run(&Plan::new(&scene, &engine)?)?;

    for snapshot in record.snapshots() {
        let spin = snapshot.angular_velocity_body(0).y;
        let column = ((spin / 5.0 + 1.0) * 30.0).round() as usize;
        println!("{:5.2} s  wy = {spin:+.3} rad/s  {}*", snapshot.time(), " ".repeat(column));
    }
    println!("{}", record.trust());
    Ok(())
}
