//! The golden cases in `tests/golden/`: 25 digits, from two independent methods. Quaternions there are w, x, y, z.

use glam::{DMat3, DQuat, DVec3};
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
