//! Studies: scenes described in files, and ensembles drawn from distributions.

pub mod draw;
pub mod problem;
