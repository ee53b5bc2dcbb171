//! The example studies do what their first lines say.

#![cfg(feature = "cli")]

use std::fs;

use glam::DVec3;

use crate::workspace;

use workspace::{States, Workspace, example, report};

fn run_example(name: &str) -> Workspace {
    let workspace = Workspace::new("");
    workspace.done(&["run", &example(name), "--engine", "cpu", "--out", "out"]);
    assert_eq!(report(&workspace, "out")["failed_bodies"], serde_json::json!([]));
    workspace
}

#[test]
fn tumbling_upper_stages_keep_what_free_bodies_keep() {
    let workspace = run_example("tumbling");
    let report = report(&workspace, "out");
    assert_eq!(report["bodies"], 100_000);
    for quantity in ["kinetic_energy", "angular_momentum_world"] {
        // The study asks for 1e-6 rad; what is conserved must be kept no worse.
        let p99 = report["drift"][quantity]["p99"].as_f64().expect("a number");
        assert!(p99 < 1e-6, "{quantity}: {p99:e}");
    }
    // Many parts of a table, written side by side; the study's cylinder of 1400 kg, 1.2 m and 6.5 m.
    let across = 1400.0 * (3.0 * 1.2 * 1.2 + 6.5 * 6.5) / 12.0;
    let moments = DVec3::new(across, across, 1400.0 * 1.2 * 1.2 / 2.0);
    let states = States::read(&workspace.path("out/final.csv"));
    assert_eq!(states.rows(), 100_000);
    for (body, (&number, row)) in states.column("body").iter().zip(0..).enumerate() {
        assert_eq!(number, body as f64);
        // L = R I ω, from columns of the same row, with moments along the body's axes.
        let momentum = states.orientation(row) * (moments * states.vector(["wx", "wy", "wz"], row));
        let written = states.vector(["lx", "ly", "lz"], row);
        assert!((momentum - written).length() <= 1e-12 * written.length(), "body {body}: {written}, not {momentum}");
    }
}

#[test]
fn the_intermediate_axis_flips_again_and_again() {
    let states = States::read(&run_example("intermediate_axis").path("out/snapshots.csv"));
    for body in 0..8 {
        let spin: Vec<f64> = states.of_body(body).into_iter().map(|row| states.column("wx")[row]).collect();
        let flips = spin.windows(2).filter(|pair| pair[0] * pair[1] < 0.0).count();
        assert!(flips >= 4, "body {body} flips {flips} times");
        let largest = spin.iter().fold(0.0_f64, |largest, w| largest.max(w.abs()));
        assert!((largest - std::f64::consts::TAU).abs() < 0.05, "body {body} spins at most at {largest} rad/s");
    }
}

#[test]
fn the_disc_wobbles_twice_as_fast_as_it_turns() {
    let workspace = Workspace::new("");
    let text = fs::read_to_string(example("wobbling_disc")).unwrap().replace("format = \"npz\"", "format = \"csv\"");
    fs::write(workspace.path("disc.toml"), text).unwrap();
    workspace.done(&["run", "disc.toml", "--engine", "cpu", "--out", "out"]);
    let states = States::read(&workspace.path("out/snapshots.csv"));
    let momentum = states.vector(["lx", "ly", "lz"], 0);
    // The disc's axis goes round the angular momentum; its azimuth, unwound, gives the rate.
    let across = momentum.normalize().any_orthonormal_pair();
    let mut azimuth = 0.0;
    let mut last: Option<f64> = None;
    for row in 0..states.rows() {
        let axis = states.orientation(row) * DVec3::Z;
        let now = f64::atan2(axis.dot(across.1), axis.dot(across.0));
        if let Some(last) = last {
            azimuth += (now - last + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU) - std::f64::consts::PI;
        }
        last = Some(now);
    }
    let rate = azimuth.abs() / (states.column("t")[states.rows() - 1] - states.column("t")[0]);
    // L / I1 for a symmetric top; I1 = m (r²/4 + h²/12).
    let across_moment = 0.3 * (0.12 * 0.12 / 4.0 + 0.004 * 0.004 / 12.0);
    assert!((rate / (momentum.length() / across_moment) - 1.0).abs() < 1e-9, "wobble {rate} rad/s");
    assert!((rate / 20.0 - 2.0).abs() < 2e-3, "wobble {rate} rad/s is not twice the spin");
}

#[test]
fn the_wobbling_disc_as_it_stands_writes_arrays() {
    assert_eq!(run_example("wobbling_disc").names("out"), ["final.npz", "plan.json", "report.json", "snapshots.npz"]);
}

#[test]
fn spacecraft_tumble_in_their_own_axes() {
    let states = States::read(&run_example("spacecraft").path("out/snapshots.csv"));
    assert_eq!(states.rows(), 16);
    let angular_velocity = |row: usize| states.vector(["wx", "wy", "wz"], row);
    // Astrobee's tensor is spherical: its rotation never changes. Envisat's is not.
    let (astrobee, envisat) = (states.of_body(3), states.of_body(0));
    let changes = |rows: &[usize]| {
        rows.iter().map(|&row| (angular_velocity(row) - angular_velocity(rows[0])).length()).fold(0.0, f64::max)
    };
    assert!(changes(&astrobee) < 1e-12, "{}", changes(&astrobee));
    assert!(changes(&envisat) > 0.01, "{}", changes(&envisat));
    // World angular momentum = R I ω with the tensor of the table, off-diagonal elements and all.
    for row in envisat {
        let w = angular_velocity(row);
        let momentum_body = DVec3::new(
            17023.3 * w.x + 397.1 * w.y - 2171.4 * w.z,
            397.1 * w.x + 124825.7 * w.y + 344.2 * w.z,
            -2171.4 * w.x + 344.2 * w.y + 129112.2 * w.z,
        );
        let (found, expected) = (states.vector(["lx", "ly", "lz"], row), states.orientation(row) * momentum_body);
        assert!((found - expected).length() < 1e-12 * expected.length(), "row {row}: {found} and {expected}");
    }
}

#[test]
fn fragments_drift_as_a_constant_force_demands() {
    let workspace = run_example("debris");
    let states = States::read(&workspace.path("out/final.csv"));
    let report = report(&workspace, "out");
    assert_eq!(report["bodies"], 1000);
    let time = 60.0;
    for row in 0..states.rows() {
        // From rest at the origin with v₀: x = v t - ½ a t², along and across the force alike.
        let (x, v) = (states.vector(["x", "y", "z"], row), states.vector(["vx", "vy", "vz"], row));
        assert!((x.x - v.x * time).abs() < 1e-12 * x.length() && (x.y - v.y * time).abs() < 1e-12 * x.length());
        // The force pulls down, so the fragment is higher than its last velocity would have brought it.
        assert!(x.z > v.z * time, "row {row}");
    }
}

#[test]
fn satellites_that_run_out_booms_keep_their_angular_momentum_and_slow_down() {
    let states = States::read(&run_example("booms").path("out/snapshots.csv"));
    let bodies = 1000;
    for body in 0..bodies {
        let (first, last) = (body, states.rows() - bodies + body);
        let momentum = |row| states.vector(["lx", "ly", "lz"], row);
        let change = (momentum(last) - momentum(first)).length() / momentum(first).length();
        assert!(change < 1e-6, "body {body}: {change:e}");
        let spin = |row| states.vector(["wx", "wy", "wz"], row).length();
        // 50/172, less what the nutation and the scatter of 1 % in each second moment make of it.
        let slower = spin(last) / spin(first);
        assert!((slower - 50.0 / 172.0).abs() < 0.02, "body {body}: {slower}");
    }
}

#[test]
fn satellites_that_run_out_wires_slow_down_as_their_moments_grow() {
    let workspace = run_example("wire_booms");
    let (first, last) =
        (States::read(&workspace.path("out/initial.csv")), States::read(&workspace.path("out/final.csv")));
    for body in 0..500 {
        let parameter = |name: &str| first.column(&format!("torque[1].{name}"))[body];
        // 2 m ((R + l)² − R²) of each pair.
        let out = |length: f64| 2.0 * 0.08 * ((0.45 + length).powi(2) - 0.45 * 0.45);
        let (x, y) = (out(parameter("length_x")), out(parameter("length_y")));
        let moments = DVec3::new(18.0 + y, 20.0 + x, 26.0 + x + y);
        let omega = last.vector(["wx", "wy", "wz"], body);
        let before = DVec3::new(18.0, 20.0, 26.0) * first.vector(["wx", "wy", "wz"], body);
        let after = moments * omega;
        assert!((after.length() / before.length() - 1.0).abs() < 1e-6, "body {body}: {after} after {before}");
        let slower = omega.z / first.vector(["wx", "wy", "wz"], body).z;
        // Nutation takes 2e-4 of it.
        assert!((slower * moments.z / 26.0 - 1.0).abs() < 1e-3, "body {body}: {slower}");
    }
}

/// Whether the centre of mass follows a formula of the time, or is integrated with the rotation: what the library makes of forces for a
/// torque that names the velocity is no column of `initial`.
#[test]
fn initial_has_the_parameters_that_were_drawn_alone() {
    for drag in ["linear-drag", "quadratic-drag"] {
        let workspace = Workspace::new(&format!(
            r#"
            seed = 3
            [bodies]
            count = 5
            inertia = [1.0, 2.0, 2.5]
            mass = 2.0
            velocity = {{ distribution = "normal", mean = [0, 0, 10], sigma = 1 }}
            angular_velocity = [0.1, 0.2, 1.0]
            [[force]]
            model = "{drag}"
            coefficient = {{ distribution = "uniform", low = 0.01, high = 0.02 }}
            [[force]]
            model = "gravity"
            acceleration = [0, 0, -9.81]
            [[torque]]
            model = "custom"
            parameters = {{ k = {{ distribution = "uniform", low = 0.01, high = 0.02 }}, d = 0.1 }}
            torque = "-k * d * to_body(velocity)"
            [time]
            end = 1.0
            [output]
            initial = true
            "#
        ));
        workspace.done(&["run", "study.toml", "--out", "out", "--engine", "cpu", "--quiet"]);
        let initial = States::read(&workspace.path("out/initial.csv"));
        let mut drawn: Vec<&String> = initial.columns.keys().filter(|name| name.contains('[')).collect();
        drawn.sort();
        assert_eq!(drawn, ["force[1].coefficient", "torque[1].k"], "{drag}");
        for name in drawn {
            assert!(initial.column(name).iter().all(|number| (0.01..0.02).contains(number)), "{drag}: {name}");
        }
    }
}

#[test]
fn a_stuck_thruster_pushes_a_tumbling_stage_less_than_a_steady_one() {
    let states = States::read(&run_example("thruster").path("out/snapshots.csv"));
    // Without drag or turning, 400 N on 1400 kg come to 34 m/s in 120 s. Weight and thrust together reach √((Mg + F)/C), 154 m/s,
    // at most, against the drag.
    for row in 0..states.rows() {
        let v = states.vector(["vx", "vy", "vz"], row);
        assert!(v.z <= 0.0 && v.length() < 153.5, "{v}");
        assert!(v.truncate().length() < 34.3, "{v}");
    }
}

#[test]
fn curveballs_fall_by_as_much_more_as_their_topspin_pushes_them_down() {
    let states = States::read(&run_example("curveball").path("out/snapshots.csv"));
    let (bodies, time, g, lift_per_mass) = (100, 0.46_f64, 9.81, 9.6e-5 / 0.145);
    let mut spins = (f64::INFINITY, 0.0_f64);
    for body in 0..bodies {
        let (first, last) = (body, states.rows() - bodies + body);
        let spin = states.vector(["wx", "wy", "wz"], last);
        spins = (spins.0.min(spin.y), spins.1.max(spin.y));
        let end = states.vector(["x", "y", "z"], last);
        // The drag takes a tenth of the speed on the way; what lift and weight add up to is nearly vertical.
        let [start, slowed] = [first, last].map(|row| states.vector(["vx", "vy", "vz"], row).x);
        let speed = 0.5 * (start + slowed);
        assert!(slowed < 0.93 * start && slowed > 0.85 * start, "body {body}: {slowed} m/s");
        // Drag slows the fall down too, at the rate C v/M.
        let drag = 0.00088 * speed / 0.145;
        let fall = 0.5 * time * time * (g + lift_per_mass * spin.y * speed) * (1.0 - drag * time / 3.0);
        assert!((1.8 - end.z - fall).abs() < 0.015 * fall, "body {body}: {} m, not {fall} m", 1.8 - end.z);
    }
    assert!(spins.1 - spins.0 > 50.0, "{spins:?}");
}

/// What the study asks for, relative, of energies and momenta with the angle; its mean over 2,000 bodies is closer.
const RELAXING: f64 = 1e-3;

#[test]
fn stages_that_dissipate_keep_their_momentum_and_end_in_a_flat_spin() {
    let workspace = run_example("relaxing");
    assert_eq!(workspace.names("out"), ["plan.json", "report.json", "statistics.csv"]);
    let states = States::read(&workspace.path("out/statistics.csv"));
    let (time, momentum) = (states.column("t"), states.column("angular_momentum_mean"));
    assert_eq!((time.len(), time[0], time[19]), (20, 360.0, 7200.0));
    assert!(states.column("count").iter().all(|&count| count == 2000.0));
    assert!(momentum.iter().all(|l| (l / momentum[0] - 1.0).abs() < RELAXING), "{momentum:?}");
    let energy = states.column("kinetic_energy_mean");
    assert!(energy.windows(2).all(|pair| pair[1] < pair[0] * (1.0 + RELAXING)), "{energy:?}");
    // In the end T = L²/2I of most; the mean of L² is that of L squared and the variance. I1 = m (r²/4 + h²/12).
    let across = 1400.0 * (1.2 * 1.2 / 4.0 + 6.5 * 6.5 / 12.0);
    let squared = momentum[19].powi(2) + states.column("angular_momentum_standard_deviation")[19].powi(2);
    let least = squared / (2.0 * across);
    assert!(energy[19] > least * (1.0 - RELAXING) && energy[19] < 0.8 * energy[0], "{energy:?}, at least {least}");
    let report = report(&workspace, "out");
    let sampled = report["drift"]["bodies"].as_u64().expect("a number");
    assert!((96..=192).contains(&sampled), "{sampled}");
    assert_eq!(report["statistics"]["count"], 2000);
    assert!(report["plan"]["skips"].as_array().expect("a list").iter().any(|skip| skip["name"] == "states"));
}

/// The mean motion of the orbits in `bdot` and `pointing`, rad/s.
const MEAN_MOTION: f64 = 1.1068e-3;

#[test]
fn coils_stop_tumbling_satellites_until_they_follow_the_field() {
    let states = States::read(&run_example("bdot").path("out/statistics.csv"));
    let spin = states.column("spin_rate_mean");
    assert_eq!(spin.len(), 40);
    assert!(spin.windows(2).all(|pair| pair[1] < pair[0]), "{spin:?}");
    // A hundredth of the start, 0.44 rad/s, and no less than the field's own rate, which is about twice that of the orbit.
    let last = spin[39];
    assert!(last > MEAN_MOTION && last < 0.01 * 0.44, "{last:e}");
    assert!(states.column("spin_rate_max")[39] < 0.02);
}

#[test]
fn a_spring_and_a_damper_bring_cameras_to_a_moving_target() {
    let states = States::read(&run_example("pointing").path("out/final.csv"));
    assert_eq!(states.rows(), 500);
    let (phase, inclination) = (MEAN_MOTION * 1200.0, 0.9_f64);
    let nadir = -DVec3::new(phase.cos(), phase.sin() * inclination.cos(), phase.sin() * inclination.sin());
    for row in 0..states.rows() {
        let angle = (states.orientation(row) * DVec3::Z).angle_between(nadir);
        // The gyroscopic torque of a turning body over the stiffness: 1.1 kg m² times the rate squared over 2e-3 N m.
        assert!(angle < 1e-3, "row {row}: {angle:e} rad");
        let rate = states.vector(["wx", "wy", "wz"], row).length();
        assert!((rate / MEAN_MOTION - 1.0).abs() < 1e-3, "row {row}: {rate:e} rad/s");
    }
}

#[test]
fn bodies_that_swing_by_a_table_keep_their_total_energy() {
    let workspace = run_example("aero_table");
    let report = report(&workspace, "out");
    let balance = &report["balance"];
    assert_eq!(balance["conservative_bodies"], 300);
    // The potential is the table's integral; steps at its kinks cost most of the error.
    let worst = balance["total_energy"]["max"].as_f64().expect("a number");
    assert!(worst < 1e-6, "{worst:e}");
    let states = States::read(&workspace.path("out/snapshots.csv"));
    let (mut nose_first, mut tail_first) = (0, 0);
    for body in 0..300 {
        let beyond = |row: usize| (states.orientation(row) * DVec3::X).x < 140.0_f64.to_radians().cos();
        let rows = states.of_body(body);
        let count = rows.iter().filter(|&&row| beyond(row)).count();
        nose_first += usize::from(count == 0);
        tail_first += usize::from(count == rows.len());
    }
    assert!(nose_first > 200 && (1..30).contains(&tail_first), "{nose_first} nose first, {tail_first} tail first");
}
