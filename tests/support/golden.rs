//! The golden cases in `tests/golden/`: 25 digits, from two independent methods. Quaternions there are w, x, y, z.

use glam::{DMat3, DQuat, DVec3};
use polhode::Torque;
use polhode::torque::Orbit;
use serde_json::Value;

/// One case of a golden file.
pub struct Case {
    pub name: String,
    pub inertia: DMat3,
    pub orientation: DQuat,
    pub angular_velocity_body: DVec3,
    pub states: Vec<State>,
    /// The whole record, for what only some cases have.
    pub record: Value,
}

impl Case {
    /// The times of the states, from 0 on.
    pub fn times(&self) -> Vec<f64> {
        self.states.iter().map(|state| state.time).collect()
    }
}

/// The reference state at one time.
pub struct State {
    pub time: f64,
    pub orientation: DQuat,
    pub angular_velocity_body: DVec3,
    pub angular_momentum_world: DVec3,
    pub kinetic_energy: f64,
}

/// All cases of `tests/golden/<name>.json`.
pub fn load(name: &str) -> Vec<Case> {
    let path = format!("{}/tests/golden/{name}.json", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{path}: {error}"));
    let file: Value = serde_json::from_str(&text).unwrap_or_else(|error| panic!("{path}: {error}"));
    file["cases"].as_array().unwrap_or_else(|| panic!("{path}: no cases")).iter().map(case).collect()
}

/// The cases of every file of torque-free bodies.
pub fn load_free() -> Vec<Case> {
    ["free_asymmetric", "free_degenerate", "free_separatrix", "free_special"].into_iter().flat_map(load).collect()
}

/// A decimal string as the nearest f64.
pub fn number(value: &Value) -> f64 {
    let text = value.as_str().unwrap_or_else(|| panic!("{value} is no decimal string"));
    text.parse().unwrap_or_else(|error| panic!("{text}: {error}"))
}

/// A list of three decimal strings.
pub fn vector(value: &Value) -> DVec3 {
    DVec3::new(number(&value[0]), number(&value[1]), number(&value[2]))
}

/// A list of four decimal strings w, x, y, z, normalised.
pub fn quaternion(value: &Value) -> DQuat {
    DQuat::from_xyzw(number(&value[1]), number(&value[2]), number(&value[3]), number(&value[0])).normalize()
}

/// The torques of a case's model, their amplitudes multiplied by `factor`.
pub fn torques(model: &Value, factor: f64) -> Vec<Torque> {
    let scaled = |field: &str| number(&model[field]) * factor;
    let scaled_vector = |field: &str| vector(&model[field]) * factor;
    match model["type"].as_str().expect("a type") {
        "const_body_torque" => vec![Torque::constant_body(scaled_vector("tau"))],
        "const_world_torque" => vec![Torque::constant_world(scaled_vector("tau"))],
        "linear_drag" => vec![Torque::linear_drag(scaled("c"))],
        "quadratic_drag" => vec![Torque::quadratic_drag(scaled("c"))],
        "matrix_drag" => {
            let rows = &model["C"];
            let matrix = DMat3::from_cols(vector(&rows[0]), vector(&rows[1]), vector(&rows[2])).transpose();
            vec![Torque::matrix_drag(matrix * factor)]
        }
        "heavy_top" => {
            let gravity = DVec3::new(0.0, 0.0, -number(&model["g"]));
            vec![Torque::heavy_top(scaled("mass"), vector(&model["com_body"]), gravity)]
        }
        "gravity_gradient_circular" => {
            vec![Torque::gravity_gradient(Orbit::circular(scaled("mu"), number(&model["r"])))]
        }
        "gravity_gradient_kepler" => {
            let orbit = Orbit::kepler(scaled("mu"), number(&model["a"]), number(&model["e"]));
            vec![Torque::gravity_gradient(orbit)]
        }
        "gravity_gradient_inclined" => {
            let orbit = Orbit::kepler(scaled("mu"), number(&model["a"]), number(&model["e"]))
                .inclined(number(&model["inclination"]))
                .with_ascending_node(number(&model["ascending_node"]))
                .with_pericentre(number(&model["pericentre"]))
                .with_mean_anomaly(number(&model["mean_anomaly"]));
            vec![Torque::gravity_gradient(orbit)]
        }
        "magnetic_dipole" => vec![Torque::magnetic_dipole(scaled_vector("m_body"), vector(&model["B_world"]))],
        "sin_body_torque" => {
            vec![Torque::sinusoidal(scaled_vector("tau_sin"), scaled_vector("tau_cos"), number(&model["omega"]))]
        }
        "spring_sin" => {
            vec![Torque::sine_spring(scaled("k"), quaternion(&model["q_target_raw"])), Torque::linear_drag(scaled("c"))]
        }
        "spring_log" => {
            vec![Torque::log_spring(scaled("k"), quaternion(&model["q_target_raw"])), Torque::linear_drag(scaled("c"))]
        }
        "free" => Vec::new(),
        other => panic!("no torque for the golden model {other}"),
    }
}

fn case(record: &Value) -> Case {
    let rows = &record["body"]["inertia_body"];
    let inertia = DMat3::from_cols(vector(&rows[0]), vector(&rows[1]), vector(&rows[2])).transpose();
    let states = record["states"].as_array().expect("states");
    Case {
        name: record["name"].as_str().expect("name").to_owned(),
        inertia,
        orientation: quaternion(&record["initial"]["q_raw"]),
        angular_velocity_body: vector(&record["initial"]["w_body"]),
        states: states
            .iter()
            .map(|state| State {
                time: number(&state["t"]),
                orientation: quaternion(&state["q"]),
                angular_velocity_body: vector(&state["w_body"]),
                angular_momentum_world: vector(&state["L_world"]),
                kinetic_energy: number(&state["kinetic_energy"]),
            })
            .collect(),
        record: record.clone(),
    }
}
