//! Targets near rounding: met, or refused as out of reach.

use std::path::Path;

use polhode::study::Study;
use polhode::{Engine, Error, Plan};

/// Near rounding two sequences of steps are as far apart as either is from the motion: finer steps do not lessen that, and plans that thought so
/// missed what they promised by a factor of ten.
#[test]
fn rounding_is_not_taken_for_an_error_that_finer_steps_lessen() {
    const TOPS: &str = "seed = 6\n[bodies]\ncount = 10\n\
        inertia = { moments = [0.01, 0.011, 0.02], scatter = 0.02 }\n\
        orientation = { distribution = \"uniform\" }\n\
        angular_velocity = { distribution = \"normal\", mean = [0, 0, 30], sigma = 3 }\n\
        [[torque]]\nmodel = \"heavy-top\"\nmass = 0.5\ncentre = [0, 0, 0.04]\ngravity = [0, 0, -9.81]\n\
        [time]\nend = 100\noutputs = { every = 10 }\n[accuracy]\n";
    let engine = Engine::cpu();
    let mut refused = 0;
    for attitude in [1e-12, 1e-11, 1e-9] {
        let study =
            Study::parse(Path::new("study.toml"), &format!("{TOPS}attitude = {attitude:e}\n")).expect("a study");
        let scene = study.scene().expect("a scene");
        match Plan::new(&scene, &engine) {
            Ok(plan) => {
                let recomputed = engine.run(&plan).expect("a run").trust().recomputed_sample;
                assert_eq!(recomputed.met, Some(true), "{attitude:e}: {recomputed}");
            }
            Err(Error::AccuracyOutOfReach { factor, .. }) => {
                assert!(attitude < 1e-9 && factor > 1.0 && factor * attitude < 1e-8, "{attitude:e}: {factor:e}");
                refused += 1;
            }
            Err(error) => panic!("{attitude:e}: {error}"),
        }
    }
    assert!(refused >= 1, "1e-12 rad over 3000 rad is below rounding");
}
