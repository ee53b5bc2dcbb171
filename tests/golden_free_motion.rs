mod support;
use polhode::free_motion::FreeMotion;
use support::{attitude_error, golden, relative_error};

#[test]
fn free_motion_follows_the_golden_bodies_in_f64() {
    for case in golden::load_free() {
        let motion = FreeMotion::new(case.inertia, case.orientation, case.angular_velocity_body).expect("valid");
        let errors: Vec<String> = case
            .states
            .iter()
            .map(|state| {
                let found = motion.at(state.time);
                format!(
                    "{:.0e}/{:.0e}",
                    attitude_error(found.orientation, state.orientation),
                    relative_error(found.angular_velocity_body, state.angular_velocity_body)
                )
            })
            .collect();
        println!("{:28} {}", case.name, errors.join(" "));
    }
}
