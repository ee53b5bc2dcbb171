//! Truth: results against closed forms, published tables, golden data of 25 digits, orders of convergence and what motions conserve.

mod accumulated;
mod balance;
#[path = "../common/mod.rs"]
mod common;
mod conservation;
mod control;
mod convergence;
mod convergence_methods;
mod custom_inertia;
mod dense_output;
mod derivation;
mod elementary;
mod events;
mod extremes;
mod flat_plates;
mod free_motion;
#[path = "../support/fused.rs"]
mod fused;
mod golden;
mod golden_forced;
mod golden_free_motion;
mod late_torques;
mod linear_rotor;
mod mass_properties;
mod meshes;
mod own_state;
mod principal_axes;
mod properties;
mod published_tables;
mod quantities;
mod separatrix;
mod sin_cos;
mod stops;
#[path = "../strategies/mod.rs"]
mod strategies;
mod studies;
#[path = "../support/mod.rs"]
mod support;
mod switches;
mod tableau;
mod taylor;
mod toolkit;
mod torque_physics;
mod translation;
mod variable_inertia;
