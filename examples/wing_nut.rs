//! A wing nut spun about its middle axis flips over and back (V. A. Dzhanibekov saw it on Salyut 7 in 1985): the period
//! of the flip in closed form, and the spin around the first flips.
//!
//!     cargo run --release --example wing_nut

use glam::{DQuat, DVec3};
use polhode::Result;
use polhode::kernel::free_motion::FreeMotion;

fn main() -> Result<()> {
    // A steel nut with two wings: moments in kg m² along its body axes, the screw's axis being the middle one.
    let inertia = DVec3::new(2.1e-6, 3.4e-6, 4.9e-6);
    let spin = 2.0 * std::f64::consts::TAU;
    println!("A wing nut spun at 2 turns/s about its middle axis:");
    println!("{:>14} {:>14} {:>22} {:>20}", "tilt [rad]", "flip every [s]", "precession [turns/s]", "k'");
    for tilt in [1e-1, 1e-2, 1e-3, 1e-6, 1e-9] {
        let motion = FreeMotion::new(inertia, DQuat::IDENTITY, DVec3::new(tilt * spin, spin, 0.0))?;
        let period = motion.nutation_period().expect("the spin is next to the middle axis, not on it");
        let precession = motion.mean_precession_rate() / std::f64::consts::TAU;
        println!("{tilt:>14e} {period:>14.6} {precession:>22.6} {:>20.3e}", motion.complementary_modulus());
    }

    let motion = FreeMotion::new(inertia, DQuat::IDENTITY, DVec3::new(1e-3 * spin, spin, 0.0))?;
    println!("\nThe spin about the middle axis around the first flips, tilt 1e-3 rad:");
    for flip in motion.flips(0.0, 60.0).take(3) {
        let spin_at = |time: f64| motion.at(time).angular_velocity_body.y / std::f64::consts::TAU;
        println!(
            "t = {flip:>9.6} s: {:>8.5} turns/s half a second before, {:>8.5} half a second after",
            spin_at(flip - 0.5),
            spin_at(flip + 0.5)
        );
    }
    Ok(())
}
