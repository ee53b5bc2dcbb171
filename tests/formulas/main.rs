//! Formulas: expressions as graphs, programs, series and WGSL, and torques and forces that users write down.

#[path = "../common/mod.rs"]
mod common;
mod custom;
mod custom_translation;
mod expression;
mod kinds;
mod models;
mod names;
mod study_torque;
mod torque_texts;
