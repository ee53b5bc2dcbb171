//! Draws and designs: the bits of a second implementation, the moments of closed forms, and what one draw may not know of another.

#![cfg(feature = "study")]

use std::path::Path;

use glam::DVec3;
use polhode::Ensemble;
use polhode::study::Study;
use serde_json::Value;

/// The bodies of a study's text.
fn bodies(text: &str) -> Ensemble {
    let study = Study::parse(Path::new("study.toml"), text).unwrap_or_else(|error| panic!("{text}\n{error}"));
    study.ensemble().unwrap_or_else(|error| panic!("{text}\n{error}"))
}

/// Bodies whose angular velocity is drawn so, with moments of 1, 1.5 and 2 kg m².
fn spinning(count: usize, angular_velocity: &str) -> Vec<DVec3> {
    let text = format!(
        "seed = 7\n[bodies]\ncount = {count}\ninertia = [1.0, 1.5, 2.0]\nangular_velocity = {angular_velocity}\n[time]\nend = 1.0\n"
    );
    bodies(&text).angular_velocity_body().to_vec()
}

/// Numbers drawn from a distribution.
fn numbers(distribution: &str) -> Vec<f64> {
    spinning(COUNT, &format!("[{distribution}, 0, 0]")).iter().map(|omega| omega.x).collect()
}

const COUNT: usize = 40_000;

/// Deviations, of a mean or of a fraction, beyond which a draw of these seeds would be wrong: chance exceeds them in one case of two million.
const STANDARD_ERRORS: f64 = 5.0;

#[test]
fn draws_are_those_of_a_second_implementation() {
    let text = include_str!("../golden/draws.json");
    let cases: Vec<Value> = serde_json::from_str(text).expect("tests/golden/draws.json");
    assert!(cases.len() >= 23, "{} cases", cases.len());
    for case in &cases {
        let ensemble = bodies(case["study"].as_str().expect("a study"));
        let ulps = case["ulps"].as_f64().expect("a number");
        let mut furthest = 0.0_f64;
        for (body, expected) in case["values"].as_array().expect("rows").iter().enumerate() {
            let expected: Vec<f64> = expected.as_array().expect("a row").iter().filter_map(Value::as_f64).collect();
            let found = match case["column"].as_str() {
                Some("orientation") => ensemble.orientation()[body].to_array().to_vec(),
                _ => ensemble.angular_velocity_body()[body].to_array().to_vec(),
            };
            assert_eq!(found.len(), expected.len());
            let scale = expected.iter().fold(0.0_f64, |scale, x| scale.max(x.abs()));
            for (found, expected) in found.iter().zip(&expected) {
                let apart = (found - expected).abs() / (scale * f64::EPSILON).max(f64::MIN_POSITIVE);
                assert!(apart <= ulps, "{}: body {body}: {found:?}, not {expected:?}: {apart} ulps", case["name"]);
                furthest = furthest.max(apart);
            }
        }
        println!("{}: up to {furthest:.2} ulps", case["name"]);
    }
}

/// Mean and variance within five standard errors of theirs; that of the variance follows from the fourth moment of the draws.
fn assert_moments(name: &str, draws: &[f64], mean: f64, variance: f64) {
    let count = draws.len() as f64;
    let found = draws.iter().sum::<f64>() / count;
    let central = |power: i32| draws.iter().map(|x| (x - mean).powi(power)).sum::<f64>() / count;
    let (second, fourth) = (central(2), central(4));
    let error = (variance / count).sqrt();
    assert!((found - mean).abs() <= STANDARD_ERRORS * error, "{name}: mean {found}, not {mean} ± {error}");
    let error = ((fourth - second * second) / count).sqrt();
    assert!(
        (second - variance).abs() <= STANDARD_ERRORS * error,
        "{name}: variance {second}, not {variance} ± {error}"
    );
}

/// Kolmogorov's distance times √n stays below 2.2, which chance exceeds in one case of 8,000.
fn assert_distribution(name: &str, mut draws: Vec<f64>, probability: impl Fn(f64) -> f64) {
    draws.sort_by(f64::total_cmp);
    let count = draws.len() as f64;
    let distance = draws.iter().enumerate().fold(0.0_f64, |distance, (rank, x)| {
        let p = probability(*x);
        distance.max((p - rank as f64 / count).abs()).max(((rank + 1) as f64 / count - p).abs())
    });
    assert!(distance * count.sqrt() < 2.2, "{name}: distance {distance}, times √n {}", distance * count.sqrt());
}

#[test]
fn numbers_have_the_moments_of_their_distributions() {
    use std::f64::consts::PI;
    for (distribution, mean, variance) in [
        ("{ distribution = 'uniform', low = -1.0, high = 3.0 }", 1.0, 16.0 / 12.0),
        ("{ distribution = 'normal', mean = 1.0, sigma = 0.5 }", 1.0, 0.25),
        (
            "{ distribution = 'log-normal', median = 2.0, sigma = 0.5 }",
            2.0 * 0.125_f64.exp(),
            4.0 * 0.25_f64.exp_m1() * 0.25_f64.exp(),
        ),
        ("{ distribution = 'exponential', mean = 0.3 }", 0.3, 0.09),
        ("{ distribution = 'rayleigh', sigma = 2.0 }", 2.0 * (PI / 2.0).sqrt(), 4.0 * (2.0 - PI / 2.0)),
        // (a + b + c)/3 and (a² + b² + c² − ab − bc − ca)/18.
        ("{ distribution = 'triangular', low = -1.0, mode = 0.5, high = 2.0 }", 0.5, 6.75 / 18.0),
        ("{ distribution = 'triangular', low = 0.0, mode = 0.0, high = 3.0 }", 1.0, 0.5),
        // μ + σ (φ(a) − φ(b))/Z and σ² (1 + (a φ(a) − b φ(b))/Z − ((φ(a) − φ(b))/Z)²): a = −1.6, b = 4, and a = 6.
        (
            "{ distribution = 'truncated-normal', mean = 1.0, sigma = 0.5, low = 0.2, high = 3.0 }",
            1.058_606_979_339_094,
            0.199_481_406_959_044_2,
        ),
        (
            "{ distribution = 'truncated-normal', mean = 0.0, sigma = 1.0, low = 6.0 }",
            6.158_482_604_544_581,
            0.023_987_636_789_279,
        ),
        (
            "{ distribution = 'mixture', weights = [1, 3], of = [{ distribution = 'normal', mean = 2.0, sigma = 0.1 }, -1.0] }",
            -0.25,
            0.25 * 4.01 + 0.75 - 0.0625,
        ),
    ] {
        assert_moments(distribution, &numbers(distribution), mean, variance);
    }
}

#[test]
fn numbers_are_distributed_as_they_should_be() {
    let exponential = numbers("{ distribution = 'exponential', mean = 0.3 }");
    assert_distribution("exponential", exponential, |x| -(-x / 0.3).exp_m1());
    let rayleigh = numbers("{ distribution = 'rayleigh', sigma = 2.0 }");
    assert_distribution("rayleigh", rayleigh, |x| -(-x * x / 8.0).exp_m1());
    let triangular = numbers("{ distribution = 'triangular', low = -1.0, mode = 0.5, high = 2.0 }");
    let rising = |x: f64| (x + 1.0).powi(2) / 4.5;
    assert_distribution("triangular", triangular, |x| if x < 0.5 { rising(x) } else { 1.0 - rising(1.0 - x) });
}

#[test]
fn truncated_draws_keep_within_their_ends_however_far_they_lie() {
    for (low, high) in [(6.0, 6.5), (-30.0, -29.0), (30.0, 31.0), (-1e-9, 1e-9), (-37.0, 37.0), (2.0, 1e9)] {
        let text =
            format!("{{ distribution = 'truncated-normal', mean = 0.0, sigma = 1.0, low = {low}, high = {high} }}");
        let draws = numbers(&text);
        assert!(draws.iter().all(|x| (low..=high).contains(x)), "{low} to {high}");
        let different: std::collections::BTreeSet<u64> = draws.iter().map(|x| x.to_bits()).collect();
        assert!(different.len() > COUNT * 99 / 100, "{low} to {high}: {} different draws", different.len());
    }
    // Q(x) = φ(x)/x (1 − 1/x² + 3/x⁴ − ...), to 2e-8 here (Abramowitz and Stegun, 26.2.12).
    let series = |x: f64| (1.0 - 1.0 / (x * x) + 3.0 / x.powi(4)) / x;
    let draws = numbers("{ distribution = 'truncated-normal', mean = 0.0, sigma = 1.0, low = 30.0 }");
    assert_distribution("far tail", draws, |x| 1.0 - (-0.5 * (x - 30.0) * (x + 30.0)).exp() * series(x) / series(30.0));
}

#[test]
fn directions_keep_to_their_axes() {
    let axis = DVec3::new(1.0, -2.0, 2.0) / 3.0;
    for kappa in [1e-6, 0.5, 5.0, 1e4] {
        let text = format!(
            "{{ distribution = 'von-mises-fisher', axis = [1, -2, 2], concentration = {kappa}, magnitude = 1.0 }}"
        );
        let draws = spinning(COUNT, &text);
        assert!(draws.iter().all(|d| (d.length() - 1.0).abs() < 8.0 * f64::EPSILON));
        // P(cos θ ≤ w) = (e^(κw) − e^(−κ))/(e^κ − e^(−κ)).
        let probability = |w: f64| 1.0 - (kappa * (w - 1.0)).exp_m1() / (-2.0 * kappa).exp_m1();
        assert_distribution(&text, draws.iter().map(|d| d.dot(axis).clamp(-1.0, 1.0)).collect(), probability);
        assert_azimuths(&text, &draws, axis);
    }
    let draws = spinning(COUNT, "{ distribution = 'cone', axis = [1, -2, 2], half_angle = '20 deg', magnitude = 2.0 }");
    let least = 20.0_f64.to_radians().cos();
    let cosines: Vec<f64> = draws.iter().map(|d| d.dot(axis) / 2.0).collect();
    assert!(cosines.iter().all(|w| *w >= least - 1e-15));
    assert_distribution("cone", cosines, |w| ((w - least) / (1.0 - least)).clamp(0.0, 1.0));
    assert_azimuths("cone", &draws, axis);
}

/// Azimuths about an axis are even.
fn assert_azimuths(name: &str, draws: &[DVec3], axis: DVec3) {
    let (x, y) = axis.any_orthonormal_pair();
    let turns = draws.iter().map(|d| 0.5 + d.dot(y).atan2(d.dot(x)) / std::f64::consts::TAU).collect();
    assert_distribution(name, turns, |turn| turn);
}

#[test]
fn covariances_are_those_asked_for() {
    let draws = spinning(
        COUNT,
        "{ distribution = 'normal', mean = [1, 2, 3], covariance = [[4, 2, 0], [2, 5, 2], [0, 2, 2]] }",
    );
    let (mean, covariance) = (DVec3::new(1.0, 2.0, 3.0), [[4.0, 2.0, 0.0], [2.0, 5.0, 2.0], [0.0, 2.0, 2.0]]);
    for i in 0..3 {
        for j in 0..=i {
            let found = draws.iter().map(|d| (d - mean)[i] * (d - mean)[j]).sum::<f64>() / COUNT as f64;
            let expected: f64 = covariance[i][j];
            // Isserlis: the variance of a product of normal numbers.
            let error = ((covariance[i][i] * covariance[j][j] + expected * expected) / COUNT as f64).sqrt();
            assert!((found - expected).abs() <= STANDARD_ERRORS * error, "{i}, {j}: {found}, not {expected} ± {error}");
        }
    }
}

#[test]
fn variables_of_a_group_go_together_wherever_they_stand() {
    let text = r#"
        [correlated.craft]
        variables = ["size", "spin"]
        mean = ["50 cm", "2 rpm"]
        sigma = [0.05, 0.01]
        correlation = [[1, -0.8], [-0.8, 1]]
        [bodies]
        count = 40_000
        inertia = { shape = "sphere", mass = 10.0, radius = { distribution = "correlated", variable = "craft.size" } }
        angular_velocity = [0, 0, { distribution = "correlated", variable = "craft.spin" }]
        [time]
        end = 1.0
    "#;
    let ensemble = bodies(text);
    let radius = |body: usize| (ensemble.inertia()[body].xx / 4.0).sqrt();
    let rows =
        (0..COUNT).map(|body| (radius(body) - 0.5, ensemble.angular_velocity_body()[body].z - 0.209_439_510_239_319_5));
    let (mut xx, mut yy, mut xy) = (0.0_f64, 0.0_f64, 0.0_f64);
    for (x, y) in rows {
        (xx, yy, xy) = (xx + x * x, yy + y * y, xy + x * y);
    }
    let coefficient = xy / (xx * yy).sqrt();
    // The coefficient's deviation is (1 − ρ²)/√n.
    assert!((coefficient + 0.8).abs() < STANDARD_ERRORS * 0.36 / (COUNT as f64).sqrt(), "{coefficient}");
}

/// The result of reading a study with a group of a length and a rate, given by `keys`, that stand where they should.
fn craft(keys: &str) -> polhode::Result<Study> {
    let variable = |name: &str| format!("{{ distribution = 'correlated', variable = 'craft.{name}' }}");
    let text = format!(
        "[correlated.craft]\nvariables = ['size', 'spin']\n{keys}\n[bodies]\ncount = 1\n\
         inertia = {{ shape = 'sphere', mass = 10.0, radius = {} }}\nangular_velocity = [0, 0, {}]\n[time]\nend = 1.0\n",
        variable("size"),
        variable("spin")
    );
    Study::parse(Path::new("study.toml"), &text)
}

#[test]
fn variables_of_a_group_keep_their_units() {
    for keys in [
        "mean = ['50 cm', '2 rpm']\ncovariance = [['25 cm²', '1 mm rpm'], ['0.1 cm rpm', '0.01 rpm²']]",
        "mean = ['50 cm', '2 rpm']\ncovariance = [[0.0025, 0], [0, '0.01 rpm^2']]",
        "mean = [0.5, 0.2]\ncovariance = [['25 cm²', '0 cm rpm'], [0, '0.01 rpm²']]",
        "mean = [0.5, 0.2]\ncovariance = [[0.0025, 0], [0, 0.01]]",
        "mean = [0.5, '2 rpm']\nsigma = ['5 cm', 0.01]\ncorrelation = [[1, '-80 %'], [-0.8, 1]]",
    ] {
        craft(keys).unwrap_or_else(|error| panic!("{keys}: {error}"));
    }
    for (keys, message) in [
        (
            "mean = ['50 cm', '2 rpm']\ncovariance = [['0.01 cm', 0], [0, 0.01]]",
            "study.toml:4: correlated.craft.covariance = '0.01 cm': expected a unit that measures the same as (cm) (cm)",
        ),
        (
            "mean = ['50 cm', '2 rpm']\ncovariance = [[0.01, 0], [0, '4 kg']]",
            "study.toml:4: correlated.craft.covariance = '4 kg': expected a unit that measures the same as (rpm) (rpm)",
        ),
        (
            "mean = ['50 cm', '2 rpm']\ncovariance = [[0.01, '0 cm²'], [0, 0.01]]",
            "study.toml:4: correlated.craft.covariance = '0 cm²': expected a unit that measures the same as (cm) (rpm)",
        ),
        (
            "mean = ['50 cm', 0.2]\ncovariance = [[0.01, '0 cm rpm'], [0, 0.01]]",
            "study.toml:4: correlated.craft.covariance = '0 cm rpm': expected a unit that measures the same as (cm) (1)",
        ),
        ("mean = [0.5, 0.2]\ncovariance = [['25 cm²', 0], [0, '1 km²']]", "expected a unit of angular velocity"),
        (
            "mean = [0.5, 0.2]\nsigma = [0.05, '5 m']\ncorrelation = [[1, 0], [0, 1]]",
            "expected a unit of angular velocity",
        ),
        (
            "mean = ['50 cm', 0.2]\nsigma = ['5 s', 0.1]\ncorrelation = [[1, 0], [0, 1]]",
            "study.toml:4: correlated.craft.sigma = ['5 s', 0.1]: expected a unit that measures the same as cm",
        ),
        (
            "mean = ['50 cm', 0.2]\nsigma = [0.1, 0.1]\ncorrelation = [[1, '0.5 m'], [0.5, 1]]",
            "study.toml:5: correlated.craft.correlation = '0.5 m': m is a unit of length: expected a number without a unit",
        ),
    ] {
        let error = craft(keys).expect_err(keys).to_string();
        assert!(error.contains(message), "{error}\nnot {message}");
    }
}

#[test]
fn attitudes_scatter_as_asked_for() {
    let text = "seed = 3\n[bodies]\ncount = 40_000\ninertia = [1, 1, 1]\nangular_velocity = [0, 0, 1]\norientation = { distribution = 'scatter', about = { axis = [1, 1, 0], angle = '40 deg' }, sigma = ['1 deg', '2 deg', '0 deg'] }\n[time]\nend = 1.0\n";
    let ensemble = bodies(text);
    let about = glam::DQuat::from_axis_angle(DVec3::new(1.0, 1.0, 0.0).normalize(), 40.0_f64.to_radians());
    let turned: Vec<DVec3> = ensemble.orientation().iter().map(|q| (about.inverse() * *q).to_scaled_axis()).collect();
    for (axis, sigma) in [1.0_f64, 2.0, 0.0].map(f64::to_radians).into_iter().enumerate() {
        let components: Vec<f64> = turned.iter().map(|v| v[axis]).collect();
        if sigma == 0.0 {
            assert!(components.iter().all(|x| x.abs() < 1e-15));
        } else {
            assert_moments("scatter", &components, 0.0, sigma * sigma);
        }
    }
}

#[test]
fn euler_angles_turn_bodies_in_the_order_of_their_axes() {
    let text = |orientation: &str| {
        let sweep = "[[sweep]]\nname = 'yaw'\nvalues = ['10 deg', '100 deg']\n";
        let sweep = if orientation.contains("sweep") { sweep } else { "" };
        format!(
            "{sweep}[bodies]\ncount = 500\ninertia = [1, 2, 2.5]\nangular_velocity = [0, 0, 1]\norientation = {orientation}\n[time]\nend = 1.0\n"
        )
    };
    let of = |orientation: &str| bodies(&text(orientation)).orientation().to_vec();
    let bound = 4.0 * f64::EPSILON;
    let forward = |q: glam::DQuat| q * DVec3::X;
    // Yaw about z, then pitch about the new y: the nose points up where the pitch is negative.
    let heading = |yaw: f64, pitch: f64| DVec3::new(yaw.cos() * pitch.cos(), yaw.sin() * pitch.cos(), -pitch.sin());
    let [yaw, pitch, roll] = [40.0_f64, -20.0, 5.0].map(f64::to_radians);
    let turned = of("{ euler = 'zyx', angles = ['40 deg', '-20 deg', '5 deg'] }");
    assert!((forward(turned[0]) - heading(yaw, pitch)).length() <= bound, "{}", forward(turned[0]));
    // The roll lifts the body's y axis, by its sine where the pitch is level.
    assert!(((turned[0] * DVec3::Y).z - roll.sin() * pitch.cos()).abs() <= bound);
    // The same turns about the axes of the world are made in reverse order.
    let about_world = of("{ euler = 'xyz', about = 'world', angles = ['5 deg', '-20 deg', '40 deg'] }");
    assert!((turned[0] - about_world[0]).length() <= bound);
    // Angles that are swept, and drawn: the pitch is within its bounds, and each body has its own.
    let swept =
        of("{ euler = 'zyx', angles = [{ sweep = 'yaw' }, { distribution = 'uniform', low = 0.1, high = 0.2 }, 0] }");
    assert_eq!(swept.len(), 1000);
    let pitch = |q: &glam::DQuat| -forward(*q).z.asin();
    for (body, q) in swept.iter().enumerate() {
        let yaw = if body % 2 == 0 { 10.0_f64 } else { 100.0 }.to_radians();
        assert!((0.1..=0.2).contains(&pitch(q)), "body {body}: {}", pitch(q));
        assert!((forward(*q) - heading(yaw, pitch(q))).length() <= 1e-14, "body {body}: {}", forward(*q));
    }
    let pitches: Vec<f64> = swept.iter().map(pitch).collect();
    assert_moments("uniform", &pitches, 0.15, 0.01 / 12.0);
    // A parameter of a formula may be turned so, too.
    let custom = "[[torque]]\nmodel = 'custom'\nparameters = { target = { euler = 'zyx', angles = ['40 deg', 0, 0] } }\ntorque = 'rotate(target, vec(1, 0, 0))'\n";
    let study = text("[0, 0, 0, 1]") + custom + "[accuracy]\nmethod = 'rk4'\ndt = 0.1\n";
    Study::parse(Path::new("study.toml"), &study).and_then(|study| study.scene()).expect("a rotation as parameter");
    for (orientation, message) in [
        ("{ euler = 'zzx', angles = [0, 0, 0] }", "no two neighbouring ones equal"),
        ("{ euler = 'zyx', angles = [40, 0, 0] }", "or one with its unit, such as \"40 deg\""),
        ("{ euler = 'zyx', angles = [0, 0] }", "expected three angles (rad)"),
        ("{ euler = 'zyx' }", "expected three angles (rad)"),
        ("{ euler = 'zyx', angles = [0, 0, 0], about = 'orbit' }", "world"),
        ("{ euler = 'zyx', angles = [0, 0, 0], axis = [0, 0, 1] }", "known here: axis, angle"),
    ] {
        let error = Study::parse(Path::new("study.toml"), &text(orientation)).expect_err(orientation).to_string();
        assert!(error.contains(message), "{error}\nnot {message}");
    }
}

#[test]
fn thermal_rotors_share_their_energy_evenly() {
    // Moments of water about axes that are not the body's, and temperatures in two cells.
    let text = "
        [[sweep]]
        name = 'temperature'
        values = ['100 K', '300 K']
        [bodies]
        count = 40_000
        inertia = { ixx = 2.0e-47, iyy = 1.5e-47, izz = 2.9e-47, ixy = 0.4e-47, ixz = 0.1e-47, iyz = -0.2e-47 }
        angular_velocity = { distribution = 'thermal', temperature = { sweep = 'temperature' } }
        [time]
        end = 1.0
    ";
    let ensemble = bodies(text);
    let tensor = ensemble.inertia()[0];
    let axes = polhode::bodies::inertia::principal_axes(&tensor);
    for (cell, temperature) in [100.0, 300.0].into_iter().enumerate() {
        let kt = 1.380_649e-23 * temperature;
        for axis in 0..3 {
            // I ω² has the distribution k T z²: mean k T, variance 2 (k T)².
            let direction = axes.axis_body(axis);
            let of_cell = ensemble.angular_velocity_body().iter().skip(cell).step_by(2);
            let shares: Vec<f64> = of_cell.map(|w| axes.moments[axis] * w.dot(direction).powi(2) / kt).collect();
            assert_eq!(shares.len(), COUNT);
            assert_moments("thermal", &shares, 1.0, 2.0);
        }
    }
}

#[test]
fn energies_and_momenta_that_are_fixed_are_so() {
    let moments = DVec3::new(1.0, 1.5, 2.0);
    for omega in spinning(1000, "{ distribution = 'fixed-energy', energy = 4.0 }") {
        assert!((0.5 * omega.dot(moments * omega) - 4.0).abs() < 1e-14);
    }
    let momenta: Vec<DVec3> =
        spinning(10 * COUNT, "{ distribution = 'fixed-angular-momentum', angular_momentum = 4.0 }")
            .into_iter()
            .map(|omega| moments * omega / 4.0)
            .collect();
    assert!(momenta.iter().all(|n| (n.length() - 1.0).abs() < 1e-14));
    for axis in 0..3 {
        assert_distribution("momentum", momenta.iter().map(|n| n[axis]).collect(), |x| 0.5 + 0.5 * x);
    }
}

#[test]
fn linear_rotors_get_no_spin_about_their_axes() {
    for distribution in [
        "{ distribution = 'thermal', temperature = 300.0 }",
        "{ distribution = 'fixed-energy', energy = 4e-21 }",
        "{ distribution = 'fixed-angular-momentum', angular_momentum = 1e-33 }",
    ] {
        let text = format!(
            "[bodies]\ncount = 1000\ninertia = {{ parts = [{{ shape = 'rod', mass = 4e-26, length = 2e-10, orientation = {{ axis = [0, 1, 0], angle = '50 deg' }} }}] }}\nangular_velocity = {distribution}\n[time]\nend = 1.0\n"
        );
        let ensemble = bodies(&text);
        assert!((0..1000).all(|body| ensemble.is_linear_rotor(body)));
    }
}

#[test]
fn rows_of_a_file_are_drawn_together_and_evenly() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("catalogue.csv"), "object,wx,wy,wz,moment\nA,1,2,3,10\nB,4,5,6,20\nC,7,8,9,30\n")
        .expect("a file");
    let file = folder.path().join("study.toml");
    let text = r#"
        [bodies]
        count = 30_000
        inertia = { moments = { distribution = "rows", file = "catalogue.csv", columns = ["moment", "moment", "moment"] } }
        angular_velocity = { distribution = "rows", file = "catalogue.csv", columns = ["wx", "wy", "wz"] }
        [time]
        end = 1.0
    "#;
    let ensemble = Study::parse(&file, text).and_then(|study| study.ensemble()).expect("a study");
    let mut counts = [0_usize; 3];
    for (tensor, omega) in ensemble.inertia().iter().zip(ensemble.angular_velocity_body()) {
        let row = (tensor.xx / 10.0) as usize - 1;
        assert_eq!(*omega, DVec3::new(1.0, 2.0, 3.0) + 3.0 * row as f64);
        counts[row] += 1;
    }
    for count in counts {
        let error = (30_000.0 * (1.0 / 3.0) * (2.0 / 3.0_f64)).sqrt();
        assert!((count as f64 - 10_000.0).abs() < STANDARD_ERRORS * error, "{counts:?}");
    }
}

#[test]
fn rows_of_a_file_under_two_spellings_of_its_name_are_those_of_one() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("rr.csv"), "a,b\n1,10\n2,20\n3,30\n4,40\n").expect("a file");
    let drawn = |first: &str, second: &str| {
        let rows =
            |file: &str, column: &str| format!("{{ distribution = 'rows', file = '{file}', column = '{column}' }}");
        let text = format!(
            "[bodies]\ncount = 100\ninertia = [1, 1, 1]\nangular_velocity = [{}, {}, 0]\n[time]\nend = 1.0\n",
            rows(first, "a"),
            rows(second, "b")
        );
        let study = Study::parse(&folder.path().join("study.toml"), &text).and_then(|study| study.ensemble());
        study.expect("a study").angular_velocity_body().to_vec()
    };
    let expected = drawn("rr.csv", "rr.csv");
    assert!(expected.iter().all(|omega| omega.y == 10.0 * omega.x));
    for (first, second) in [("rr.csv", "./rr.csv"), ("./rr.csv", ".//./rr.csv")] {
        assert_eq!(drawn(first, second), expected, "{first}, {second}");
    }
}

#[test]
fn a_column_that_stands_twice_in_a_file_of_rows_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("rows.csv"), "a,b,a\n1,2,3\n").expect("a file");
    let study = |column: &str| {
        let text = format!(
            "[bodies]\ncount = 1\ninertia = [1, 1, 1]\nangular_velocity = [{{ distribution = 'rows', file = 'rows.csv', column = '{column}' }}, 0, 0]\n[time]\nend = 1.0\n"
        );
        Study::parse(&folder.path().join("study.toml"), &text)
    };
    assert!(study("b").is_ok());
    let error = study("a").expect_err("which of them?").to_string();
    assert!(error.contains("rows.csv:1: a: this column occurs twice in the header"), "{error}");
}

#[test]
fn the_draws_of_a_body_do_not_depend_on_how_many_there_are() {
    for distribution in [
        "{ distribution = 'mixture', weights = [1, 1], of = [{ distribution = 'direction', magnitude = 1.0 }, [1, 2, 3]] }",
        "{ distribution = 'thermal', temperature = { distribution = 'exponential', mean = 1e22 } }",
        "[{ distribution = 'truncated-normal', mean = 1, sigma = 1, low = 0 }, '1 rpm', { distribution = 'rayleigh', sigma = 1 }]",
    ] {
        let (few, many) = (spinning(100, distribution), spinning(1000, distribution));
        assert_eq!(few[..], many[..100], "{distribution}");
    }
}
