//! What wrong input gets: one line that names file, line or row, key, value and what would be valid.
//!
//! Every message is held as it stands, so that a change of words is seen.

#![cfg(feature = "study")]

use std::path::Path;

use polhode::record::OutputFolder;
use polhode::study::{BodyTable, Study};
use polhode::{Engine, Error, Plan};

/// A study without fault, into which faults are planted.
const SOUND: &str = r#"seed = 1
[bodies]
count = 10
inertia = { shape = "cylinder", mass = 2.0, radius = 0.5, height = 2.0 }
orientation = { distribution = "uniform" }
angular_velocity = { distribution = "normal", mean = [0, 0, 1], sigma = 0.1 }
[time]
end = 10.0
outputs = { every = 2.5 }
[accuracy]
attitude = 1e-6
[output]
snapshots = true
"#;

/// The study, its bodies and its plan on the CPU engine.
fn accept(text: &str) -> Result<(), Error> {
    let study = Study::parse(Path::new("study.toml"), text)?;
    let scene = study.scene()?;
    Plan::new(&scene, &Engine::cpu()).map_err(|error| study.located(error))?;
    Ok(())
}

/// The message that a study gets; it must count as wrong input and have one line.
fn refusal(text: &str) -> String {
    let error = accept(text).expect_err("the study should be refused");
    assert!(error.is_input(), "{error}");
    let message = error.to_string();
    assert!(!message.contains('\n'), "more than one line: {message}");
    message
}

/// The message for the sound study with one text replaced.
fn refusal_with(from: &str, to: &str) -> String {
    assert_eq!(SOUND.matches(from).count(), 1, "{from}");
    refusal(&SOUND.replace(from, to))
}

/// The message that a table of bodies gets, in a study that takes everything from it.
fn table_refusal(table: &str) -> String {
    let folder = tempfile::tempdir().expect("a temporary folder");
    std::fs::write(folder.path().join("bodies.csv"), table).expect("a file is written");
    let file = folder.path().join("study.toml");
    let text = "[bodies]\nfile = \"bodies.csv\"\n[time]\nend = 1.0\n";
    let error = Study::parse(&file, text).and_then(|study| study.scene()).expect_err("the table should be refused");
    assert!(error.is_input(), "{error}");
    // The folder's name differs from run to run.
    let message = error.to_string().replace(&format!("{}/", folder.path().display()), "");
    assert!(!message.contains('\n'), "more than one line: {message}");
    message
}

macro_rules! refuses {
    ($($name:ident: $message:expr => @$expected:literal;)*) => {
        $(#[test]
        fn $name() {
            insta::assert_snapshot!($message, @$expected);
        })*
    };
}

#[test]
fn axes_of_any_length_are_directions() {
    for axis in ["[1e200, 0, 1e200]", "[1e-200, 0, 1e-200]", "[5e-324, 0, 5e-324]", "[1e308, 0, 1e308]"] {
        let text = SOUND.replace("{ distribution = \"uniform\" }", &format!("{{ axis = {axis}, angle = 1 }}"));
        let scene = Study::parse(Path::new("study.toml"), &text).and_then(|study| study.scene()).expect(axis);
        let (sin, half) = (0.5_f64.sin(), 0.5_f64.sqrt());
        let turned = scene.ensemble().orientation()[0];
        assert!((turned.x - half * sin).abs() < 1e-15 && (turned.z - half * sin).abs() < 1e-15, "{axis}: {turned}");
    }
}

#[test]
fn the_sound_study_is_accepted() {
    accept(SOUND).unwrap();
}

#[test]
fn every_shape_is_accepted() {
    let shapes = [
        ("sphere", "density", "radius = 1"),
        ("spherical-shell", "mass", "radius = 1"),
        ("ellipsoid", "density", "semi_axes = [1, 2, 3]"),
        ("box", "density", "edges = { distribution = \"uniform\", low = 1, high = 2 }"),
        ("cylinder", "mass", "radius = 1, height = { distribution = \"log-normal\", median = 1, sigma = 0.3 }"),
        ("tube", "density", "inner_radius = 1, outer_radius = 2, height = 1"),
        ("capsule", "density", "radius = 1, length = 2"),
        ("cone", "density", "radius = 1, height = 2"),
        ("torus", "density", "major_radius = 2, minor_radius = 1"),
        ("rectangular-plate", "mass", "width = 1, depth = 2"),
        ("circular-plate", "mass", "radius = 1"),
    ];
    for (shape, matter, lengths) in shapes {
        let from = "shape = \"cylinder\", mass = 2.0, radius = 0.5, height = 2.0";
        let text = SOUND.replace(from, &format!("shape = \"{shape}\", {matter} = 3.0, {lengths}"));
        accept(&text).unwrap_or_else(|error| panic!("{shape}: {error}"));
    }
}

refuses! {
    a_file_that_is_not_toml: refusal("[bodies\ncount = 1\n") => @"study.toml:1: unclosed table, expected `]`";
    a_key_that_stands_twice: refusal_with("count = 10", "count = 10\ncount = 11") => @"study.toml:4: duplicate key at count";
    an_unknown_table: refusal_with("[accuracy]", "[acuracy]") => @"study.toml:10: acuracy is not known: did you mean accuracy? known here: title, seed, bodies, torque, force, time, accuracy, output, failures, checkpoint, quantity, histogram, event, sweep, design, correlated, orbit";
    an_unknown_key_with_the_nearest: refusal_with("outputs =", "output =") => @"study.toml:9: time.output is not known: did you mean outputs? known here: end, outputs, checks";
    an_unknown_key_with_no_near_one: refusal_with("seed", "colour") => @"study.toml:1: colour is not known: known here: title, seed, bodies, torque, force, time, accuracy, output, failures, checkpoint, quantity, histogram, event, sweep, design, correlated, orbit";
    an_unknown_parameter_of_a_shape: refusal_with("radius = 0.5", "raduis = 0.5") => @"study.toml:4: bodies.inertia.raduis is not known: did you mean radius? known here: shape, mass, density, radius, height, about";
    a_missing_table: refusal("[time]\nend = 1.0\n") => @"study.toml:1: bodies is missing: expected a table that describes the bodies";
    a_missing_time: refusal("[bodies]\ncount = 1\ninertia = [1, 1, 1]\nangular_velocity = [0, 0, 1]\n") => @"study.toml:1: time is missing: expected a table with the end of the simulated span";
    a_missing_key: refusal_with("radius = 0.5, ", "") => @"study.toml:4: bodies.inertia.radius is missing: expected a length (m)";
    a_missing_inertia: refusal_with("inertia = { shape = \"cylinder\", mass = 2.0, radius = 0.5, height = 2.0 }\n", "") => @"study.toml:2: bodies.inertia is missing: expected a shape, moments or a tensor (kg m²)";
    a_text_for_a_number: refusal_with("end = 10.0", "end = \"ten\"") => @r#"study.toml:8: time.end = "ten": expected a finite number (s)"#;
    a_number_for_a_table: refusal_with("outputs = { every = 2.5 }", "outputs = 2.5") => @"study.toml:9: time.outputs = 2.5: expected { every = seconds } or { times = [seconds, ...] }, with start = true for the start too";
    a_fraction_of_a_body: refusal_with("count = 10", "count = 10.5") => @"study.toml:3: bodies.count = 10.5: expected a whole number of bodies";
    a_negative_count: refusal_with("count = 10", "count = -10") => @"study.toml:3: bodies.count = -10: expected a whole number of bodies";
    a_negative_seed: refusal_with("seed = 1", "seed = -1") => @"study.toml:1: seed = -1: expected a whole number that is not negative";
    an_unknown_shape: refusal_with("\"cylinder\"", "\"cilinder\"") => @r#"study.toml:4: bodies.inertia.shape = "cilinder": did you mean cylinder? possible: point, rod, sphere, spherical-shell, ellipsoid, box, cylinder, tube, capsule, cone, torus, rectangular-plate, circular-plate, tetrahedron"#;
    an_unknown_distribution: refusal_with("\"normal\"", "\"gaussian\"") => @r#"study.toml:6: bodies.angular_velocity.distribution = "gaussian": possible: constant, uniform, normal, log-normal, truncated-normal, exponential, rayleigh, triangular, direction, von-mises-fisher, cone, mixture, rows, thermal, fixed-energy, fixed-angular-momentum"#;
    a_vector_of_two: refusal_with("mean = [0, 0, 1]", "mean = [0, 1]") => @"study.toml:6: bodies.angular_velocity.mean = [0, 1]: expected a finite number, or three";
    a_negative_deviation: refusal_with("sigma = 0.1", "sigma = -0.1") => @"study.toml:6: bodies.angular_velocity.sigma = -0.1: expected a standard deviation that is not negative, or three";
    two_deviations: refusal_with("sigma = 0.1", "sigma = [0.1, 0.2]") => @"study.toml:6: bodies.angular_velocity.sigma = [0.1, 0.2]: expected a standard deviation that is not negative, or three";
    an_interval_upside_down: refusal_with("radius = 0.5", "radius = { distribution = \"uniform\", low = 2, high = 1 }") => @"study.toml:4: bodies.inertia.radius.high = 1: expected a number not below `low`";
    a_zero_quaternion: refusal_with("{ distribution = \"uniform\" }", "[0, 0, 0, 0]") => @"study.toml:5: bodies.orientation = [0, 0, 0, 0]: expected a quaternion that is not zero";
    an_angle_in_degrees_without_its_unit: refusal_with("{ distribution = \"uniform\" }", "{ axis = [0, 0, 1], angle = 90 }") => @"study.toml:5: bodies.orientation.angle = 90: expected an angle in rad, from -2π to 2π, or one with its unit, such as \"90 deg\"";
    outputs_beyond_the_end: refusal_with("every = 2.5", "every = 12") => @"study.toml:9: time.outputs.every = 12: expected an interval up to time.end (s)";
    a_zero_axis: refusal_with("{ distribution = \"uniform\" }", "{ axis = [0, 0, 0], angle = 1 }") => @"study.toml:5: bodies.orientation.axis = [0, 0, 0]: expected an axis that is not zero";
    an_inertia_that_is_no_mass: refusal_with("{ shape = \"cylinder\", mass = 2.0, radius = 0.5, height = 2.0 }", "[1.0, 1.0, 3.0]") => @"study.toml:4: bodies.inertia: body 0: I1 + I2 - I3 = -1.0: no mass distribution has this tensor: I1 + I2 >= I3 is needed (principal moments, kg m²)";
    an_inertia_below_zero: refusal_with("{ shape = \"cylinder\", mass = 2.0, radius = 0.5, height = 2.0 }", "{ ixx = 1, iyy = 1, izz = 1, ixy = 2 }") => @"study.toml:4: bodies.inertia: body 0: the least principal moment of inertia = -1.0: expected a positive definite tensor (kg m²)";
    a_drawn_mass_below_zero: refusal_with("mass = 2.0", "mass = { distribution = \"normal\", mean = 0.1, sigma = 5 }") => @"study.toml:4: bodies.inertia.mass: body 0: mass = -2.6784561043931405: a positive, finite number";
    a_drawn_length_below_zero: refusal_with("height = 2.0", "height = { distribution = \"normal\", mean = 0.1, sigma = 5 }") => @"study.toml:4: bodies.inertia.height: body 0: height = -6.454693540894965: a positive, finite number";
    a_bore_wider_than_its_tube: refusal_with("shape = \"cylinder\", mass = 2.0, radius = 0.5, height = 2.0", "shape = \"tube\", mass = 2.0, inner_radius = 2, outer_radius = 1, height = 2.0") => @"study.toml:4: bodies.inertia.inner_radius: body 0: inner_radius = 2.0: at least 0 and less than outer_radius";
    a_density_of_a_plate: refusal_with("shape = \"cylinder\", mass = 2.0, radius = 0.5, height = 2.0", "shape = \"circular-plate\", density = 2.0, radius = 0.5") => @"study.toml:4: bodies.inertia.density = 2.0: this shape has no volume: use a mass instead (kg)";
    a_mass_and_a_density: refusal_with("mass = 2.0", "mass = 2.0, density = 1.0") => @"study.toml:4: bodies.inertia.density excludes mass: give one of them";
    neither_mass_nor_density: refusal_with("mass = 2.0, ", "") => @"study.toml:4: bodies.inertia.mass is missing: expected the mass (kg), or a density (kg/m³)";
    a_mass_beside_a_shape: refusal_with("count = 10", "count = 10\nmass = 2.0") => @"study.toml:4: bodies.mass = 2.0: the shape has the mass: leave it out here";
    a_number_that_is_not_finite: refusal_with("mean = [0, 0, 1]", "mean = [0, 0, inf]") => @"study.toml:6: bodies.angular_velocity.mean = inf: expected a finite number, or three";
    an_end_before_the_start: refusal_with("end = 10.0", "end = -10.0") => @"study.toml:8: time.end = -10.0: expected a finite time that is not negative (s)";
    a_billion_outputs: refusal_with("every = 2.5", "every = 1e-8") => @"study.toml:9: time.outputs.every = 1e-8: more than 1e7 outputs would follow: use a longer interval (s)";
    an_interval_of_zero: refusal_with("every = 2.5", "every = 0") => @"study.toml:9: time.outputs.every = 0: expected an interval above zero (s)";
    times_that_do_not_increase: refusal_with("every = 2.5", "times = [1.0, 3.0, 2.0]") => @"study.toml:9: time.outputs.times = 2.0: expected increasing times: this one is not after the one before it (s)";
    a_time_beyond_the_end: refusal_with("every = 2.5", "times = [1.0, 30.0]") => @"study.toml:9: time.outputs.times = 30.0: expected times from 0 to time.end (s)";
    an_interval_and_times: refusal_with("every = 2.5", "every = 2.5, times = [1.0]") => @"study.toml:9: time.outputs.every excludes times: give one of them";
    an_accuracy_and_a_step: refusal_with("attitude = 1e-6", "attitude = 1e-6\nmethod = \"rk4\"\ndt = 0.1") => @"study.toml:11: accuracy.attitude excludes method: give one of them";
    an_accuracy_of_zero: refusal_with("attitude = 1e-6", "attitude = 0") => @"study.toml:11: accuracy.attitude = 0: expected an angle above 0 and up to pi (rad)";
    an_accuracy_beyond_pi: refusal_with("attitude = 1e-6", "attitude = 4") => @"study.toml:11: accuracy.attitude = 4: expected an angle above 0 and up to pi (rad)";
    an_energy_error_of_zero: refusal_with("attitude = 1e-6", "energy = 0") => @"study.toml:11: accuracy.energy = 0: expected a relative error above 0";
    a_percentile_beyond_100: refusal_with("attitude = 1e-6", "percentile = 101") => @"study.toml:11: accuracy.percentile = 101: expected a percentile above 0 and up to 100";
    a_percentile_and_a_step: refusal_with("attitude = 1e-6", "percentile = 95\nmethod = \"rk4\"\ndt = 0.1") => @"study.toml:11: accuracy.percentile excludes method: give one of them";
    an_accuracy_that_f32_does_not_reach: refusal("[bodies]\ncount = 1\ninertia = [1, 2, 2.5]\nangular_velocity = [0.1, 1, 0.2]\n[time]\nend = 1.0\n[accuracy]\nattitude = 1e-9\nprecision = \"f32\"\n") => @"study.toml:8: accuracy.attitude = 1e-9: out of reach: attitude 1e-9 rad, in 99 % of the bodies: the best here (closed form in f32) misses the attitude by a factor of 9.6e2: use precision f64, or an error above 1e-6 plus 3e-8 of the angle turned (rad)";
    a_method_without_a_step: refusal_with("attitude = 1e-6", "method = \"rk4\"") => @r#"study.toml:10: accuracy.dt is missing: a method that is given needs a step beside it (s), or "rk8" or "taylor" a tolerance"#;
    a_step_without_a_method: refusal_with("attitude = 1e-6", "dt = 0.1") => @r#"study.toml:10: accuracy.method is missing: a step that is given needs a method beside it: "rk4" or "dlm""#;
    an_unknown_method: refusal_with("attitude = 1e-6", "method = \"rk5\"\ndt = 0.1") => @r#"study.toml:11: accuracy.method = "rk5": did you mean rk4? possible: rk4, rk8, cf4, splitting2, splitting4, splitting6, implicit_midpoint, dlm, explicit_euler, gyro_newton, clamped_euler, spiral, taylor"#;
    a_step_below_zero: refusal_with("attitude = 1e-6", "method = \"rk4\"\ndt = -0.1") => @"study.toml:12: accuracy.dt = -0.1: expected a step above zero (s)";
    a_step_too_small_to_finish: refusal_with("attitude = 1e-6", "method = \"rk4\"\ndt = 1e-20") => @"study.toml:12: accuracy.dt = 1e-20: more than 1e15 steps would be needed: use a longer step or a shorter span (s)";
    an_error_of_means_without_statistics: refusal_with("attitude = 1e-6", "mean = 1e-3") => @"study.toml:11: accuracy.mean = 1e-3: there are no means: expected output.statistics or a [[histogram]] too";
    an_error_of_quantiles_without_quantiles: refusal_with("attitude = 1e-6", "quantile = 1e-3") => @"study.toml:11: accuracy.quantile = 1e-3: there are no quantiles: expected output.statistics and output.quantiles too";
    an_error_of_event_times_without_events: refusal_with("attitude = 1e-6", "event_time = 1e-3") => @"study.toml:11: accuracy.event_time = 1e-3: there is no event: expected an [[event]] too";
    an_error_of_means_below_zero: refusal_with("attitude = 1e-6", "mean = -1e-3") => @"study.toml:11: accuracy.mean = -1e-3: expected an error above 0: a part of the quantity's spread";
    an_error_of_means_that_rounding_hides: refusal("[bodies]\ncount = 70\ninertia = [1, 2, 2.5]\nangular_velocity = { distribution = \"normal\", mean = [0, 0, 1], sigma = 0.1 }\n[[torque]]\nmodel = \"linear-drag\"\ncoefficient = 0.1\n[time]\nend = 1.0\n[output]\nstatistics = [\"spin_rate\"]\n[accuracy]\nmean = 1e-18\n") => @"study.toml:13: accuracy.mean = 1e-18: out of reach: mean 1e-18 of the spread: the best here misses the mean by a factor of 1.0e3: rounding is in the way, or steps finer than planning may try: use a larger error, precision f64, or name a method and its steps (accuracy.method)";
    an_attitude_that_chaos_hides: refusal("[bodies]\ncount = 70\ninertia = [1, 2, 2.5]\norientation = { distribution = \"uniform\" }\nangular_velocity = { distribution = \"normal\", mean = [0, 0, 1], sigma = 0.1 }\n[[torque]]\nmodel = \"sinusoidal\"\nsine = [0.5, 0.3, -0.7]\ncosine = [-0.2, 0.6, 0.4]\nrate = 1.5\n[time]\nend = 1000.0\n").split_once(": nothing").map_or_else(String::new, |(_, rest)| format!("nothing{rest}")) => @"nothing is left of the attitude in the finest steps that were tried, which does not tell why: the motion amplifies every error, rounding adds up over many turns, or torques change faster than these steps follow (pulses, switches): use a shorter span, or a larger error, ask for statistics and event times instead of attitudes (accuracy.mean, quantile, event_time), for fewer of the bodies (accuracy.percentile), or name a method and its steps or tolerance (accuracy.method, dt, tolerance)";
    an_unknown_precision: refusal_with("attitude = 1e-6", "precision = \"f16\"") => @r#"study.toml:11: accuracy.precision = "f16": possible: auto, f32, f64"#;
    an_unknown_format: refusal_with("snapshots = true", "format = \"xlsx\"") => @r#"study.toml:13: output.format = "xlsx": possible: csv, npz, parquet"#;
    a_flag_that_is_a_text: refusal_with("snapshots = true", "snapshots = \"yes\"") => @r#"study.toml:13: output.snapshots = "yes": expected true or false"#;
    a_statistic_named_twice: refusal_with("snapshots = true", "statistics = [\"spin_rate\", \"spin_rate\"]") => @r#"study.toml:13: output.statistics = "spin_rate": expected each quantity once"#;
    a_force_without_a_mass: refusal("[bodies]\ncount = 1\ninertia = [1, 1, 1]\nangular_velocity = [0, 0, 1]\n[force]\nconstant = [0, 0, 1]\n[time]\nend = 1.0\n") => @"study.toml:5: bodies.mass is missing: the force needs masses, here or as a column of the table of bodies (kg)";
    a_count_and_a_file: refusal_with("count = 10", "count = 10\nfile = \"bodies.csv\"") => @"study.toml:4: bodies.file excludes count: give one of them";
    a_table_that_is_not_there: refusal_with("count = 10", "file = \"missing.csv\"") => @"missing.csv: cannot be read: No such file or directory (os error 2)";
    more_bodies_than_memory: refusal_with("count = 10", "count = 4_000_000_000").split(", ").next().unwrap_or_default().to_owned() => @"study.toml:3: bodies.count = 4_000_000_000: 4000000000 bodies: their run needs 1200000000000 bytes";
    more_bodies_than_are_counted: refusal_with("count = 10", "count = 5_000_000_000") => @"study.toml:3: bodies.count = 5_000_000_000: expected up to 4294967295 bodies in all cells: they are counted in 32 bits";
}

/// A table without fault.
const TABLE: &str = "\
ixx,iyy,izz,wx,wy,wz
1.0,2.0,2.5,0.1,0.2,0.3
# a comment
1.0,2.0,2.5,0.1,0.2,0.3
";

#[test]
fn the_sound_table_is_accepted() {
    let table = BodyTable::from_reader(Path::new("bodies.csv"), TABLE.as_bytes(), usize::MAX).unwrap();
    assert_eq!(table.len(), 2);
}

refuses! {
    a_cell_that_is_no_number: table_refusal(&TABLE.replace("1.0,2.0,2.5,0.1,0.2,0.3\n#", "1.0,2.0,2.5,fast,0.2,0.3\n#")) => @"bodies.csv:2: wx = fast: expected a finite number";
    an_empty_cell: table_refusal(&TABLE.replace("0.3\n#", "\n#")) => @"bodies.csv:2: wz = (empty): expected a finite number";
    a_cell_that_is_not_finite: table_refusal(&TABLE.replace("0.3\n#", "nan\n#")) => @"bodies.csv:2: wz = nan: expected a finite number";
    a_row_that_is_too_short: table_refusal(&TABLE.replace(",0.3\n#", "\n#")) => @"bodies.csv:2: the row has 5 fields: expected 6, one a column of the header";
    a_row_that_is_no_body: table_refusal(&(TABLE.to_owned() + "1.0,1.0,3.0,0,0,0\n")) => @"bodies.csv:5: I1 + I2 - I3 = -1.0: no mass distribution has this tensor: I1 + I2 >= I3 is needed (principal moments, kg m²)";
    a_row_behind_comments_and_empty_lines: table_refusal("# one\n\n# two\nixx,iyy,izz,wx,wy,wz\n1,2,2.5,0,0,1\n# three\n\r\n1,2,2.5,0,0,fast\n") => @"bodies.csv:8: wz = fast: expected a finite number";
    a_header_behind_comments: table_refusal("# one\n\nixx,iyy,izz,wx,wy\n") => @"bodies.csv:3: wz is missing: wx, wy and wz belong together";
    a_body_behind_comments: table_refusal("ixx,iyy,izz,wx,wy,wz\n# one\n# two\n1,1,3,0,0,0\n") => @"bodies.csv:4: I1 + I2 - I3 = -1.0: no mass distribution has this tensor: I1 + I2 >= I3 is needed (principal moments, kg m²)";
    an_axis_of_no_length: refusal_with("{ distribution = \"uniform\" }", "{ axis = [0, 0, 0], angle = 1 }") => @"study.toml:5: bodies.orientation.axis = [0, 0, 0]: expected an axis that is not zero";
    an_unknown_column: table_refusal(&TABLE.replace("wz", "omega_z")) => @r#"bodies.csv:1: omega_z is no standard column, and nothing in the study names it: bodies.carry names columns for `initial`, { column = "omega_z" } reads one in a torque or force; standard: name, mass, ixx, iyy, izz, ixy, ixz, iyz, qx, qy, qz, qw, wx, wy, wz, x, y, z, vx, vy, vz"#;
    an_unused_column_with_a_near_one: table_refusal(&TABLE.replace("wz", "fx")).split("; standard").next().unwrap_or_default().to_owned() => @r#"bodies.csv:1: fx is no standard column, and nothing in the study names it: did you mean qx? bodies.carry names columns for `initial`, { column = "fx" } reads one in a torque or force"#;
    a_table_with_semicolons: table_refusal(&TABLE.replace(',', ";")) => @"bodies.csv:1: ixx;iyy;izz;wx;wy;wz: expected commas between columns";
    a_column_that_stands_twice: table_refusal(&TABLE.replace("iyy", "ixx")) => @"bodies.csv:1: ixx: this column occurs twice in the header";
    a_column_that_is_missing: table_refusal("ixx,iyy,izz,wx,wy\n1,2,2.5,0,0\n") => @"bodies.csv:1: wz is missing: wx, wy and wz belong together";
    a_column_for_a_component: refusal("[bodies]\nfile = \"bodies.csv\"\n[time]\nend = 1.0\n[[torque]]\nmodel = \"sinusoidal\"\nsine = [{ column = \"cx\" }, 0, 0]\ncosine = [0, 0, 0]\nrate = 1.5\n") => @r#"study.toml:7: torque[1].sine = [{ column = "cx" }, 0, 0]: expected { columns = ["cx", "...", "..."] }: a vector is read from three columns of the table of bodies, none of them a number"#;
    a_column_for_a_vector: refusal("[bodies]\nfile = \"bodies.csv\"\n[time]\nend = 1.0\n[force]\nconstant = { column = \"fx\" }\n") => @r#"study.toml:6: force.constant = { column = "fx" }: expected { columns = ["fx", "...", "..."] }: a vector is read from three columns of the table of bodies, none of them a number"#;
    a_table_without_inertia: table_refusal("wx,wy,wz\n0,0,1\n") => @"study.toml:1: bodies.inertia is missing: expected a shape, moments or a tensor (kg m²)";
    a_table_that_is_empty: table_refusal("") => @"bodies.csv:1: expected a header with the names of the columns";
    a_table_that_is_not_text: table_refusal_of_bytes(b"ixx,iyy,izz\n\xff\xfe,1,1\n") => @"bodies.csv:2: expected text in UTF-8";
}

#[test]
fn a_body_with_a_mass_in_its_table_and_another_in_its_shape_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("bodies.csv"), "mass,wx,wy,wz\n100,0,0,1\n").expect("a file is written");
    let study = |inertia: &str| {
        let text = format!("[bodies]\nfile = \"bodies.csv\"\ninertia = {inertia}\n[time]\nend = 1.0\n");
        Study::parse(&folder.path().join("study.toml"), &text)
    };
    assert!(study("[1, 1, 1]").is_ok());
    for inertia in [
        "{ shape = \"sphere\", mass = 1.0, radius = 1.0 }",
        "{ shape = \"sphere\", density = 1.0, radius = 1.0 }",
        "{ parts = [{ shape = \"sphere\", mass = 1.0, radius = 1.0 }] }",
    ] {
        let error = study(inertia).expect_err("two masses").to_string();
        let expected = "the table of bodies has the mass (column mass), and so has the shape: expected moments or a tensor \
                        here, or a table without that column";
        assert!(error.contains("study.toml:3: bodies.inertia = {") && error.ends_with(expected), "{error}");
    }
}

/// The longest that a study of 20,000 parts may take to be read, s: counting the lines before each key anew takes more than a minute.
const READ_IN: f64 = 8.0;

#[test]
fn the_time_to_read_a_study_is_proportional_to_its_length() {
    let parts: Vec<String> = (0..20_000)
        .map(|part| {
            format!("  {{ shape = \"box\", mass = 1.0, edges = [0.1, 0.2, 0.3], position = [{part}, 0, 0] }},\n")
        })
        .collect();
    let text = format!(
        "[bodies]\ncount = 1\nangular_velocity = [0, 0, 1]\n[time]\nend = 1.0\n[bodies.inertia]\nparts = [\n{}]\n",
        parts.concat()
    );
    let clock = std::time::Instant::now();
    Study::parse(Path::new("study.toml"), &text).expect("a study");
    let seconds = clock.elapsed().as_secs_f64();
    assert!(seconds < READ_IN, "{seconds} s");
    let wrong = text.clone() + "[output]\nfinal = 3\n";
    let error = Study::parse(Path::new("study.toml"), &wrong).expect_err("no truth value").to_string();
    assert!(error.starts_with("study.toml:20010: output.final = 3"), "{error}");
}

/// The message for a table of any bytes.
fn table_refusal_of_bytes(bytes: &[u8]) -> String {
    BodyTable::from_reader(Path::new("bodies.csv"), bytes, usize::MAX).expect_err("refused").to_string()
}

#[test]
fn a_folder_that_is_not_empty_is_refused_and_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("precious"), "x").unwrap();
    let error = OutputFolder::create(folder.path(), false).unwrap_err();
    assert!(error.is_input());
    let message = error.to_string().replace(&folder.path().display().to_string(), "out");
    insta::assert_snapshot!(message, @"out: the output folder is not empty: name another with --out, or replace its results with --force");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn a_file_in_the_place_of_the_folder_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out");
    std::fs::write(&path, "x").unwrap();
    let error = OutputFolder::create(&path, false).unwrap_err();
    assert!(error.is_input());
    let message = error.to_string().replace(&path.display().to_string(), "out");
    insta::assert_snapshot!(message, @"out: cannot be created: Not a directory (os error 20)");
}

#[test]
fn a_table_cut_anywhere_but_at_a_row_s_end_is_refused() {
    let rows = |text: &str| BodyTable::from_reader(Path::new("bodies.csv"), text.as_bytes(), usize::MAX);
    let whole = rows(TABLE).expect("a table").len();
    for end in 1..TABLE.len() {
        match rows(&TABLE[..end]) {
            Ok(table) => assert!(TABLE[..end].ends_with('\n') && table.len() <= whole, "{end}"),
            Err(error) => assert!(error.is_input() && error.to_string().starts_with("bodies.csv:"), "{error}"),
        }
    }
    let refusal = rows(TABLE.trim_end()).expect_err("no newline at the end").to_string();
    assert!(refusal.ends_with("so the table may be cut: add a newline if it is whole"), "{refusal}");
    // Exactly as many rows as are there: the last one is no better for it.
    let text = "ixx,iyy,izz,wx,wy,wz\n1,1,1,0,0,1\n1,1,1,0,0,12";
    BodyTable::from_reader(Path::new("bodies.csv"), text.as_bytes(), 2).expect_err("cut");
    assert_eq!(
        BodyTable::from_reader(Path::new("bodies.csv"), (text.to_owned() + "\n").as_bytes(), 2).expect("two").len(),
        2
    );
}

#[test]
fn rows_behind_an_open_quote_are_not_swallowed() {
    let text = "ixx,iyy,izz,wx,wy,wz,name\n1,1,1,0,0,1,\"a\n1,1,1,0,0,2,b\n";
    let error = BodyTable::from_reader(Path::new("bodies.csv"), text.as_bytes(), 9).expect_err("a row would be lost");
    assert_eq!(error.to_string(), "bodies.csv:2: a quotation mark is not closed on its line");
    // At the edge of a cell, where spaces count for nothing.
    let text = "ixx,iyy,izz,wx,wy,wz,name\n1,2,2.5,0,0,1,\"\n1,2,2.5,0,0,2,\"\n1,2,2.5,0,0,3,c\n";
    let error = BodyTable::from_reader(Path::new("bodies.csv"), text.as_bytes(), 9).expect_err("a row would be lost");
    assert_eq!(error.to_string(), "bodies.csv:2: a quotation mark is not closed on its line");
    let text = "ixx,iyy,izz,wx,wy,wz\n1,2,2.5,0,0,\"1\n";
    let error = BodyTable::from_reader(Path::new("bodies.csv"), text.as_bytes(), 9).expect_err("never closed");
    assert_eq!(error.to_string(), "bodies.csv:2: a quotation mark is not closed on its line");
    let text = "ixx, iyy,izz , wx,wy,wz\n 1, 2 ,2.5,0,0,\"1\"\n1,2,2.5,0,0, 2 \n";
    let table = BodyTable::from_reader(Path::new("bodies.csv"), text.as_bytes(), 9).expect("spaces count for nothing");
    assert_eq!([0, 1].map(|body| table.angular_velocity(body).z), [1.0, 2.0]);
}

/// Bodies that move under a force, given by `keys`; bodies.mass is line 4 of the study.
fn refusal_of_bodies(keys: &str) -> String {
    refusal(&format!(
        "[bodies]\ncount = 10\ninertia = [1.0, 2.0, 2.5]\n{keys}\n[[force]]\nmodel = \"gravity\"\nacceleration = [0, 0, -9]\n\
         [time]\nend = 1.0\n"
    ))
}

refuses! {
    a_bad_mass_is_named_by_its_own_line: refusal_of_bodies("mass = -1.0\nangular_velocity = [0, 0, 1]") => @"study.toml:4: bodies.mass: body 0: mass = -1.0: expected a finite mass above zero (kg)";
    a_drawn_rate_that_overflows_is_named_by_its_own_line: refusal_of_bodies("mass = 1.0\nangular_velocity = { distribution = \"log-normal\", median = [1e300, 1e300, 1e300], sigma = 50 }") => @"study.toml:5: bodies.angular_velocity: body 1: wx = inf: expected a finite number";
    a_position_that_overflows_is_named_by_its_own_line: refusal_of_bodies("mass = 1.0\nangular_velocity = [0, 0, 1]\nposition = { distribution = \"log-normal\", median = [1e300, 1e300, 1e300], sigma = 50 }") => @"study.toml:6: bodies.position: body 1: x = inf: expected finite components";
    tables_within_tables_without_end: refusal(&format!("a = {}{}", "[".repeat(300), "]".repeat(300))) => @"study.toml:1: tables and lists are nested too deeply at [";
}
