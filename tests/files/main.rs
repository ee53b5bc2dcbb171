//! Files and the command: studies, tables, results, reports, pictures, and hostile input.

mod accumulated;
mod bench;
mod by_cell;
mod checkpoint_faults;
mod checkpoints;
mod cli;
mod control;
mod draws;
#[path = "../../fuzz/entries.rs"]
mod entries;
mod failed_bodies;
mod hindrances;
mod in_parts;
mod inertia_files;
mod input;
mod layers;
mod limits;
mod mutations;
mod observed;
mod orbit_formulas;
mod outputs;
mod own_state;
mod parquet_bodies;
mod parquet_files;
mod plan_document;
mod plot;
mod public_items;
mod replay;
mod results;
mod shards;
mod stops;
mod studies;
mod summary;
#[path = "../support/mod.rs"]
mod support;
mod sweeps;
mod times;
mod units;
#[path = "../support/workspace.rs"]
mod workspace;
