//! The command line's grammar and its help.

use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, Parser, Subcommand};
use glam::DVec3;

use crate::engine_arguments::{CacheArguments, EngineArguments, FallbackName};

/// Integrates the rotation of large ensembles of independent rigid bodies.
#[derive(Debug, Parser)]
#[command(
    name = "polhode",
    version,
    arg_required_else_help = true,
    subcommand_required = true,
    after_help = "Begin with `polhode run examples/studies/tumbling.toml`; \
                  `polhode run --help` shows what a study file looks like.\n\
                  Exit status: 0 done, 1 the run, or a body of it, failed, 2 the input is wrong."
)]
pub struct Arguments {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Run a study and write its results.
    Run(RunArguments),
    /// Print what a study would run, what it leaves out, and why.
    Explain(ExplainArguments),
    /// Make the plan of a study once, for runs and parts that follow it.
    Plan(PlanArguments),
    /// Say which parts of a study are complete, and which must run again.
    Status(StatusArguments),
    /// Merge the parts of a study into the files of one run.
    Merge(MergeArguments),
    /// Step the GPU and the CPU side by side through a study and compare every step.
    Verify(VerifyArguments),
    /// Compute one body of a study or a run alone, more accurately, and compare.
    Replay(ReplayArguments),
    /// Print mass, centre of mass, inertia tensor and principal axes of the body that a file describes.
    Inertia(InertiaArguments),
    /// List the engines of this machine and which one is taken.
    Devices(DevicesArguments),
    /// Measure run time against error, throughput, and what skipping saves.
    Bench(crate::bench::BenchArguments),
    /// Draw the results of a benchmark or a run in a folder, as SVG and PNG.
    Plot(crate::plot::PlotArguments),
    /// Print a completion script for a shell.
    #[command(after_help = "Example: polhode completions bash > ~/.local/share/bash-completion/completions/polhode")]
    Completions(CompletionsArguments),
    /// Print the manual page.
    #[command(after_help = "Example: polhode man > ~/.local/share/man/man1/polhode.1")]
    Man,
}

const RUN_HELP: &str = "\
A study file in TOML describes the bodies, the time and what is written:

    seed = 42                         # the same seed draws the same bodies
    [bodies]
    count = 1000                      # or: file = \"bodies.csv\"
    inertia = { shape = \"cylinder\", mass = 1400.0, radius = 1.2, height = 6.5 }
    orientation = { distribution = \"uniform\" }
    angular_velocity = { distribution = \"normal\", mean = [0, 0, 0.1], sigma = 0.02 }
    [time]
    end = 600.0                       # seconds
    outputs = { every = 60.0 }        # or { times = [1.0, 10.0] }; none: the end only
    [accuracy]
    attitude = 1e-6                   # rad; or: method = \"rk4\", dt = 0.01
    [output]
    snapshots = true                  # all output times, not the end alone
    format = \"csv\"                    # or \"npz\" for NumPy, \"parquet\"

Keys (SI units, in brackets; a number in another unit is a text: \"30 deg\", \"2 rpm\", \"7000 km\"):
    title, seed           a text; a whole number, default 0
    bodies.count, .file   how many; or a CSV table: ixx iyy izz [ixy ixz iyz] wx wy wz [mass]
                          [qx qy qz qw] [x y z] [vx vy vz] [name]; missing ones are drawn
    bodies.inertia        { shape, mass (kg) or density (kg/m³), lengths (m) }: sphere,
                          spherical-shell, circular-plate (radius), ellipsoid (semi_axes),
                          box (edges), cylinder, cone (radius, height), tube (inner_radius,
                          outer_radius, height), capsule (radius, length), torus (major_radius,
                          minor_radius), rectangular-plate (width, depth), tetrahedron (corners),
                          rod (length), point;
                          { mesh = \"hull.stl\", mass or density [scale, shell] } (STL or OBJ);
                          { hull = \"corners.csv\", mass or density [scale] } (x y z);
                          { points = \"atoms.csv\" [scale, mass] } (mass x y z);
                          { parts = [{ shape, mesh, hull or points as above, position, orientation,
                          hole }, ...] [mass or density] }; moments [ixx, iyy, izz] (kg m²);
                          { moments = distribution }; { moments, scatter = relative deviation
                          of the second moments, so that every draw is a valid tensor };
                          or a tensor { ixx, iyy, izz, ixy, ixz, iyz [scatter] },
                          ixy = -(integral of xy dm); `polhode inertia` prints the result.
                          Origin and position of a body are its centre of mass, wherever that lies.
                          Beside a shape, mesh, hull, points or parts: about = [x, y, z], a point in
                          body axes from the centre of mass (m), for the tensor about it (heavy-top)
    bodies.repair_triangle_inequality
                          largest relative change by which measured tensors are repaired
    bodies.orientation    [x, y, z, w], { axis, angle (rad) }, or { distribution = \"uniform\" }
    bodies.angular_velocity, .position, .velocity, .mass
                          rad/s in body axes; m and m/s in world axes; kg
    bodies.carry          names of further columns of the table, for initial.csv
    [orbit]               mu (m³/s²) and radius or semi_major_axis (m), [eccentricity, inclination,
                          ascending_node, pericentre, mean_anomaly (rad)]: stated once, for
                          every torque that needs an orbit and states none of its own; with j2,
                          [equatorial_radius (m), else the Earth's] node and pericentre drift;
                          formulas may read orbit_position (m) and orbit_velocity (m/s)
    [[sweep]], [design]   parameters that take several values, and which; below
    [[torque]] model      one of those below, and its parameters; a key with a dot is in a
                          table: orbit = { radius = 7.0e6, inclination = 0.9 }
    [[force]] model       constant, thrust (force, N: world, body axes), gravity (acceleration,
                          m/s²), linear-drag, quadratic-drag (coefficient, N s/m, N s²/m²),
                          custom (force: a formula, N, world axes, of attitude, angular_velocity,
                          time, position, velocity, mass; parameters); the bodies need masses
    time.end, .outputs    s; { every } or { times = [...] } (s); start = true records the start too
    time.checks           { every } (s): events are sought between outputs too; writes nothing
    accuracy              errors at the end that percentile (default 99) % of the bodies meet:
                          attitude (rad, default 1e-6), angular_velocity (of its magnitude), energy
                          (kinetic, of its value) [precision: f32, f64];
                          or mean, quantile (of the quantity's spread) and event_time (of the span):
                          errors that the integration may add to statistics and mean times of
                          events, also of chaotic motions; 1e-3 if neither final nor snapshots are
                          written;
                          or method (rk4, rk8, cf4, splitting2, splitting4, splitting6,
                          implicit_midpoint and, for comparison, dlm, explicit_euler, gyro_newton,
                          clamped_euler, spiral; docs/methods.md has what each is), dt [projection =
                          true: free bodies near the separatrix keep their energy], or rk8 or taylor
                          (f64, CPU), tolerance [least_step, s, below which a body fails]
                          [precision: f32, f64];
                          recompute: how many bodies are recomputed to estimate the errors; 0: none
    output                final, snapshots, initial (true or false), format (csv, npz, parquet);
                          columns = [...] of final and snapshots, by name: any of their numbers and
                          any quantity (default: all numbers of the state; the own state of torques
                          is always there);
                          statistics = [...] of quantities over all bodies; quantiles = [5, 50,
                          95] of them, in percent; by_cell: of the bodies of each cell of a sweep
                          too, and so histograms (default: true up to 4096 cells)
    checkpoint            every: the wall time between two checkpoints, about (\"10 min\")
    [[histogram]]         quantity, low, high, bins (default 50), scale (linear, logarithmic)
    [[event]]             name, quantity and one of below, above, falls_below, rises_above,
                          crosses with a level; occurrence = 3 for the third time. Searched from
                          output (or check) to output: what passes and comes back in between goes
                          unnoticed. action = \"stop\" (default record): the body then keeps its
                          state
    [[quantity]]          name and formula (a number of attitude, angular_velocity,
                          angular_momentum, inertia, time; docs/custom-torques.md has the
                          functions) [unit]; or axis (body) and direction (world, or nadir,
                          zenith, velocity, orbit-normal of [orbit]): the angle between them; or
                          euler = \"zxz\" [about = \"world\"] and angle (1, 2, 3); or integral
                          (over time, s) or sign_changes of a formula, and every (s) [unit]: what has
                          added up so far, formed from the formula at these intervals
    failures.allow        how many bodies may fail before the exit status is 1; default 0
Quantities: kinetic_energy (J), spin_rate (rad/s), angular_momentum (kg m²/s; _x, _y, _z in world
axes), angular_velocity_x, _y, _z (rad/s, body axes), nutation (rad, between spin and angular
momentum), dynamic_inertia (kg m², L²/2T), separatrix_distance (-1 about the least axis, 0
separatrix, 1 about the greatest), latitude_least, latitude_middle, latitude_greatest (rad, of the
angular momentum above the equator of a principal axis), yaw, pitch, roll (rad), potential_energy,
total_energy, torque1_potential_energy (J, of a single torque), and the study's own.";

const RUN_EXAMPLES: &str = "\
Examples:
    polhode run study.toml                        results in study.out/
    polhode run study.toml --out results --force  replace those of an earlier run
    polhode run study.toml --engine gpu --precision f32
    polhode run study.toml --quiet --json | jq .drift
    polhode run study.toml --plan study.out/plan.json --out again    the same bits
    polhode run study.toml --plan plan.json --shard 3/64 --out parts  one part; see `polhode merge --help`
    polhode run study.toml --checkpoint 600    in pieces of about ten minutes, which a stopped run leaves behind
    polhode run study.toml --resume            continues with them

Results: final.csv (or .npz, .parquet) with body, t, orientation qx qy qz qw (body to world), angular velocity
wx wy wz (body axes), angular momentum lx ly lz (world axes), kinetic_energy, x y z vx vy vz where bodies have
positions, and status: 0, or why the body has failed, and then its numbers are NaN (1 not_converged, 2
step_too_long, 3 step_below_limit, 4 not_finite, 5 centre_not_finite: only position and velocity are NaN), or 6
if an event has stopped it at stopped_at (s); snapshots.csv with the same at all output times; failed.csv, if
bodies have failed, with body, t when it failed, status, reason, known_to, and the last good state: last_good_t
(0 is the start) qx qy qz qw wx wy wz (known_to step: t is the end of the first step that failed, or where
adaptive steps stopped; output: the output at which it was seen), and cause: for the study's own formulas the
torque, the operation without a finite result, and the numbers that it read; initial.csv, on request, with the
start of each body: name and carried columns, tensor (kg m²), moments i1 i2 i3 and axes ax ay az aw (principal
to body), state at t = 0, and torque[1].KEY, force[1].KEY of all that was drawn; for a sweep cells.csv with
cell, bodies and the axes' values, and a column cell in all tables of bodies; statistics.csv with t, count
(bodies that have not failed) and for each quantity mean, standard_deviation, min, max, min_body, max_body and
quantiles q5, q50, ... at all output times, and before these, for formulas and other quantities that a body may
lack, count (bodies with a finite value); histograms.csv with t, histogram (from 0), quantity, low, high, count;
for a sweep statistics_by_cell.csv and histograms_by_cell.csv, the same of the bodies of each cell;
events.csv with event, body, t, known_to (start, located, output) and the orientation and angular velocity then;
survival.csv with event, t, remaining bodies, the share that has not had it and its 95 % interval low, high;
times.csv with event, bodies, had, and the times (s) t10, t50, t90 by which 10, 50, 90 % of the bodies had it,
each with its 95 % interval t10_low, t10_high and so on (NaN: not by the end);
plan.json, which --plan takes; report.json with engine, plan, wall times, drift of conserved quantities, balance
of the torques' work, and errors of a recomputed sample, including position (m) and velocity (m/s) if bodies
translate; docs/outputs.md lists every key of both. The folder appears, or replaces the earlier one, when all
files are complete and on the disk; Ctrl-C leaves nothing except what --resume continues from (NAME.checkpoint).
With --force, files that no run has written stay. One run at a time may write to a folder. What a killed run
leaves beside it (.NAME.polhode-*) is removed by the next one.";

/// The text that `polhode run --help` adds to the options.
fn run_help() -> String {
    let models = polhode::study::describe_models();
    let (inputs, units) = (crate::inputs_help::INPUTS_HELP, polhode::study::describe_units());
    format!(
        "{RUN_HELP}\n\n{inputs}\n{units}\nTorques, their equations and parameters [default of an omitted key]:\n{models}\n\n{RUN_EXAMPLES}"
    )
}

/// Arguments of `polhode run`.
#[derive(Debug, Args)]
#[command(after_long_help = run_help(), after_help = "`polhode run --help` shows a study file and examples.")]
pub struct RunArguments {
    /// Study file.
    #[arg(value_name = "STUDY.toml")]
    pub study: PathBuf,
    /// Folder for the results [default: the study's name with the ending .out, in the current folder].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Write into a folder that is not empty; results of an earlier run in it are replaced.
    #[arg(long)]
    pub force: bool,
    /// Turn skipping off: step every body under all torques, as finely as the fastest needs.
    #[arg(long)]
    pub no_skip: bool,
    /// Repeat a run from its plan.json; on the same engine the bits are the same.
    #[arg(long, value_name = "FILE")]
    pub plan: Option<PathBuf>,
    /// Run one of COUNT parts of the study, from 1 on, into a folder of its own in --out; auto asks the launcher (Slurm, PBS and
    /// Grid Engine arrays, HyperQueue, MPI), auto/COUNT for the index alone.
    #[arg(long, value_name = "INDEX/COUNT|auto", requires = "plan", value_parser = crate::launcher::shard_argument)]
    pub shard: Option<crate::launcher::ShardArgument>,
    /// Write finished bodies about every SECONDS, some at a time, so that --resume can continue; overrides the study's
    /// [checkpoint]. --resume keeps to the SECONDS that the run was begun with, unless others are given. Ctrl-C finishes the
    /// bodies under way, a second one does not.
    #[arg(long, value_name = "SECONDS", conflicts_with = "shard", value_parser = seconds, allow_negative_numbers = true)]
    pub checkpoint: Option<Duration>,
    /// Continue a run with checkpoints that was stopped, was killed or has failed; the results are the same to the byte
    /// as those of an uninterrupted run. One that was begun with --force still replaces the former results. Where the run
    /// is complete, nothing is done.
    #[arg(long, conflicts_with_all = ["shard", "plan", "force"])]
    pub resume: bool,
    /// Run a study that is expected to take more than 30 days, which is refused otherwise.
    #[arg(long)]
    pub however_long: bool,
    /// Rank methods by the costs that `polhode bench accuracy` has measured on this engine and written to this folder,
    /// instead of by the shipped table.
    #[arg(long, value_name = "DIR", conflicts_with = "plan")]
    pub costs: Option<PathBuf>,
    #[command(flatten)]
    pub engine: EngineArguments,
    /// Engine that continues from the last output if the GPU is lost, hangs or has no memory left. To be ready for that, cpu
    /// keeps a copy of all bodies in the host's memory and reads their states at each output. The report says if it happened.
    #[arg(long, value_enum, default_value = "none", value_name = "ENGINE")]
    pub fallback: FallbackName,
    /// Exit with status 1 also if the accuracy asked for is not met, or not known to be met.
    #[arg(long, conflicts_with = "shard")]
    pub strict: bool,
    /// No progress (a bar; a line now and then if standard error is no terminal) and no summary.
    #[arg(long, short)]
    pub quiet: bool,
    /// Print the report as JSON instead of the summary.
    #[arg(long)]
    pub json: bool,
}

/// A duration in wall-clock seconds.
fn seconds(text: &str) -> Result<Duration, String> {
    let seconds = text.parse::<f64>().ok().filter(|seconds| *seconds > 0.0);
    let time = seconds.and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
    time.ok_or_else(|| "expected a number of seconds above zero".to_owned())
}

const EXPLAIN_HELP: &str = "\
Only the pilot runs, which tries methods and steps on a few bodies of each class.

Examples:
    polhode explain study.toml
    polhode explain study.toml --no-pilot          steps from the shipped table
    polhode explain study.toml --json | jq .skips
    polhode explain study.toml --costs bench.out   ranked by costs measured on this engine

The second line says what was asked for. Columns: class and number of the bodies, method, steps of a
body, arithmetic, expected attitude error at the percentile asked for (rad), expected wall time,
memory, and the torques that act.";

/// Arguments of `polhode explain`.
#[derive(Debug, Args)]
#[command(after_long_help = EXPLAIN_HELP, after_help = "`polhode explain --help` gives examples.")]
pub struct ExplainArguments {
    /// Study file.
    #[arg(value_name = "STUDY.toml")]
    pub study: PathBuf,
    /// Take methods and steps from the shipped table instead of trying them on a few bodies.
    #[arg(long)]
    pub no_pilot: bool,
    /// Show the plan without skipping.
    #[arg(long)]
    pub no_skip: bool,
    /// Rank methods by the costs that `polhode bench accuracy` has measured on this engine and written to this folder,
    /// instead of by the shipped table.
    #[arg(long, value_name = "DIR")]
    pub costs: Option<PathBuf>,
    #[command(flatten)]
    pub engine: EngineArguments,
    /// Print the table as JSON.
    #[arg(long)]
    pub json: bool,
}

const PLAN_HELP: &str = "\
The plan is the one that `polhode run` would make and write as plan.json: method, steps and arithmetic for the bodies of each
class, with a fingerprint of each block of the study. All that follow one plan give the same bits on the same engine, whether
one run (`polhode run --plan`) or parts on any number of machines (`polhode run --plan --shard`).

Examples:
    polhode plan study.toml --out plan.json
    polhode plan study.toml | jq .resolution";

/// Arguments of `polhode plan`.
#[derive(Debug, Args)]
#[command(after_long_help = PLAN_HELP, after_help = "`polhode plan --help` gives examples.")]
pub struct PlanArguments {
    /// Study file.
    #[arg(value_name = "STUDY.toml")]
    pub study: PathBuf,
    /// File for the plan; a plan of that name is replaced, any other file only with --force [default: standard output].
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Replace a file that is no plan; never one that the study is read from.
    #[arg(long, requires = "out")]
    pub force: bool,
    /// Plan without skipping.
    #[arg(long)]
    pub no_skip: bool,
    /// Rank methods by the costs that `polhode bench accuracy` has measured on this engine and written to this folder,
    /// instead of by the shipped table.
    #[arg(long, value_name = "DIR")]
    pub costs: Option<PathBuf>,
    #[command(flatten)]
    pub engine: EngineArguments,
    /// Do not report what was written.
    #[arg(long, short)]
    pub quiet: bool,
}

const STATUS_HELP: &str = "\
A part is complete, running, failed (it has left the reason), foreign (its results are those of another plan or study),
incomplete (its process was killed) or missing (nothing is there). Parts that are neither complete nor running must run
again; a part that runs again replaces what was left of it, results of a foreign one with --force. Foreign are parts that
cannot be merged with the one that was written last; --plan and --study say whose parts are wanted instead, and tell
whether all parts are those of a study that was changed since.

Examples:
    polhode status parts
    sbatch --array=$(polhode status parts --due) job.sh
    polhode status parts --json | jq .failed
    polhode status parts --plan plan.json --study study.toml

Exit status: 0 all parts are complete, 1 some are not, 2 the folder has no parts.";

/// Arguments of `polhode status`.
#[derive(Debug, Args)]
#[command(after_long_help = STATUS_HELP, after_help = "`polhode status --help` gives examples.")]
pub struct StatusArguments {
    /// Folder of all parts: the value of their --out.
    #[arg(value_name = "DIR")]
    pub folder: PathBuf,
    /// The plan that parts are to follow [default: that of the part written last].
    #[arg(long, value_name = "FILE")]
    pub plan: Option<PathBuf>,
    /// The study whose parts are wanted, by its text [default: that of the part written last].
    #[arg(long, value_name = "STUDY.toml")]
    pub study: Option<PathBuf>,
    /// Print only the parts that must run again, in the notation of array launchers: 3,7-9.
    #[arg(long, conflicts_with = "json")]
    pub due: bool,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
}

const MERGE_HELP: &str = "\
Parts are cut at fixed blocks of bodies, and statistics are formed block by block, so the tables are those of one run, byte
for byte, whatever the number of parts, threads and machines (of one kind of engine). Parts that are missing, failed or
changed, and parts of another plan, study or version, are refused. The parts are kept unchanged; report.json holds the
reports of all.

Examples:
    polhode plan study.toml --out plan.json
    for i in 1 2 3; do polhode run study.toml --plan plan.json --shard $i/3 --out parts; done
    polhode merge parts --out study.out

docs/scaling.md and examples/launchers show the same with Slurm, HyperQueue, GNU parallel, MPI and Snakemake.
Exit status as of `polhode run`.";

/// Arguments of `polhode merge`.
#[derive(Debug, Args)]
#[command(after_long_help = MERGE_HELP, after_help = "`polhode merge --help` gives examples.")]
pub struct MergeArguments {
    /// Folder of all parts: the value of their --out.
    #[arg(value_name = "DIR")]
    pub folder: PathBuf,
    /// Folder for the results [default: the folder merged in DIR].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Write into a folder that is not empty; results of an earlier run in it are replaced.
    #[arg(long)]
    pub force: bool,
    /// No progress (a bar; a line now and then if standard error is no terminal) and no summary.
    #[arg(long, short)]
    pub quiet: bool,
    /// Print the report as JSON instead of the summary.
    #[arg(long)]
    pub json: bool,
}

const VERIFY_HELP: &str = "\
Every kernel exists twice, as a shader and as Rust. A study is planned as `polhode run` plans it, and for each
group of its bodies the engine is compared with its scalar twin: the same operations in the same arithmetic, one
body at a time. Everything that acts is included: torques, formulas, noise, moments that change, forces that turn
with the body. Equal steps are compared one by one and in one call, adaptive steps attempt by attempt with their
controllers' decisions, closed forms at the output times. In f32 the twin is also compared with the f64 reference,
without a verdict. Whatever is not compared is listed. Steps whose bound is not known, and bodies that both sides have
lost, are counted.

Bounds are counted in roundings of one step, for each body by its own numbers. The first difference beyond its
bound is named with body, step, component and both numbers, and with the torque that it comes from: the step is
repeated under each torque alone, and without each of them. It is also repeated in fractions of its size, which
tells a slope from a later stage, and on a GPU its evaluations are compared one by one: the first that differs is
named, with the part that differs (time, state, torque, motion of the body), or else the step formed from them.

Without an adapter no shader can be checked: the exit status is 1, unless --engine cpu asks for the lanes of the
CPU engine, of every width that the processor has.

Examples:
    polhode verify                                 100 generated bodies, 32 steps
    polhode verify study.toml                      a study's first 100 bodies
    polhode verify study.toml --engine cpu --precision f64    SIMD lanes against one body at a time
    polhode verify study.toml --from-step 5000 --steps 10 --body 17
    polhode verify --bodies 4097 --steps 1000 --seed 7
    polhode verify study.toml --json | jq '.groups[].comparisons[].parting'

Exit status: 0 they agree, 1 they do not, or no state could be compared with a bound, or there is no adapter,
2 the input is wrong.";

/// Arguments of `polhode verify`.
#[derive(Debug, Args)]
#[command(after_long_help = VERIFY_HELP, after_help = "`polhode verify --help` gives examples.")]
pub struct VerifyArguments {
    /// Study file [default: a generated ensemble of asymmetric bodies].
    #[arg(value_name = "STUDY.toml")]
    pub study: Option<PathBuf>,
    /// Number of bodies, the first ones of a study; they move as in the plan of all.
    #[arg(long, default_value_t = 100, value_name = "K")]
    pub bodies: usize,
    /// Number of steps of each group of bodies: equal steps, rounds of attempts, or output times.
    #[arg(long, default_value_t = polhode::verify::DEFAULT_STEPS, value_name = "N")]
    pub steps: u64,
    /// Steps before the first that is compared; the twin takes them.
    #[arg(long, default_value_t = 0, value_name = "K")]
    pub from_step: u64,
    /// The only body that is compared, by its index.
    #[arg(long, value_name = "INDEX")]
    pub body: Option<usize>,
    /// Seed of the generated ensemble.
    #[arg(long, default_value_t = 0, value_name = "S", conflicts_with = "study")]
    pub seed: u64,
    #[command(flatten)]
    pub engine: EngineArguments,
    /// Print what was found as JSON.
    #[arg(long)]
    pub json: bool,
}

const REPLAY_HELP: &str = "\
The body is drawn from seed and index, and computed alone on the CPU in f64: torque-free bodies by their closed form,
others by rk8 at a tolerance of 1e-14, by Taylor series if the centre of mass is part of the motion, or in equal steps
under random torques and under forces that turn with the body. Its track has the columns of snapshots.csv, at N times
from 0 to the end and at the output times of the study. The command prints the errors of the run's own values of that
body, and the replay's own possible error.

For a study the body's values follow from the plan that `polhode run` would make (or from --plan): alone, a body has the
same bits as among others on the same engine. For a run's folder they come from its tables, and the plan is the run's own;
the study is read from where the run has read it. Under a random torque the track has only the output times, as other
steps would use other draws.

Examples:
    polhode replay study.toml --body 123456
    polhode replay study.out --body 123456 --samples 5000 --out track.csv
    polhode replay study.toml --plan study.out/plan.json --body 7 --json | jq .errors";

/// Arguments of `polhode replay`.
#[derive(Debug, Args)]
#[command(after_long_help = REPLAY_HELP, after_help = "`polhode replay --help` gives examples.")]
pub struct ReplayArguments {
    /// Study file, or the folder of a run.
    #[arg(value_name = "STUDY.toml|DIR")]
    pub study: PathBuf,
    /// The body, by its index from 0.
    #[arg(long, value_name = "INDEX")]
    pub body: usize,
    /// Times of the track, evenly from 0 to the end, beside the output times.
    #[arg(long, value_name = "N", default_value = "1000", value_parser = clap::value_parser!(u32).range(2..=10_000_000))]
    pub samples: u32,
    /// File for the track; an existing one is replaced only with --force [default: the study's name with the ending
    /// .body-INDEX.csv, in the current folder, where an earlier one is replaced].
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Replace the file of --out; never one that the study is read from.
    #[arg(long, requires = "out")]
    pub force: bool,
    /// Take the study's values of the body from this plan instead of making one.
    #[arg(long, value_name = "FILE")]
    pub plan: Option<PathBuf>,
    #[command(flatten)]
    pub engine: EngineArguments,
    /// Print what was found as JSON.
    #[arg(long)]
    pub json: bool,
}

const INERTIA_HELP: &str = "\
FILE is a closed surface (.stl, .obj) with --mass or --density, whose parts must not overlap or be
inside out, point masses (.csv with the columns mass,x,y,z), or a TOML file with `inertia = { ... }` as in
a study, or a study itself. Units are SI: m, kg, m³, kg m². The frame is that of the file. The tensor's
off-diagonal elements are -(integral of xy dm).

Examples:
    polhode inertia hull.stl --mass 900               a mesh in metres
    polhode inertia hull.obj --density 2700 --scale 0.001
                                                      aluminium, file in millimetres
    polhode inertia atoms.csv --scale 1e-10           lengths in ångström
    polhode inertia study.toml --body 3 --json        the fourth body that a study draws
    polhode inertia hull.stl --mass 900 --about 0,0,-1.5";

/// Arguments of `polhode inertia`.
#[derive(Debug, Args)]
#[command(after_long_help = INERTIA_HELP, after_help = "`polhode inertia --help` gives units and examples.")]
pub struct InertiaArguments {
    /// Mesh (.stl, .obj), point masses (.csv) or study (.toml).
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
    /// Mass of the mesh, or of all points, kg.
    #[arg(long, value_name = "KG", conflicts_with = "density")]
    pub mass: Option<f64>,
    /// Density of the mesh, kg/m³.
    #[arg(long, value_name = "KG/M3")]
    pub density: Option<f64>,
    /// Length of the file's unit, m.
    #[arg(long, value_name = "M")]
    pub scale: Option<f64>,
    /// The mesh is a thin skin, which may be open.
    #[arg(long)]
    pub shell: bool,
    /// Also give the tensor about this point, m.
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = point)]
    pub about: Option<DVec3>,
    /// Body of a study, by its index from 0 [default: the first].
    #[arg(long, value_name = "INDEX")]
    pub body: Option<usize>,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
}

/// Three numbers separated by commas.
fn point(text: &str) -> Result<DVec3, String> {
    let numbers: Option<Vec<f64>> =
        text.split(',').map(|number| number.trim().parse().ok().filter(|x: &f64| x.is_finite())).collect();
    match numbers.as_deref() {
        Some(&[x, y, z]) => Ok(DVec3::new(x, y, z)),
        _ => Err("expected three finite numbers X,Y,Z (m)".to_owned()),
    }
}

/// Arguments of `polhode devices`.
#[derive(Debug, Args)]
#[command(after_help = "--adapter takes the index in the first column.")]
pub struct DevicesArguments {
    /// Print the list as JSON.
    #[arg(long)]
    pub json: bool,
    /// Remove everything that --device-cache keeps, and list nothing.
    #[arg(long, conflicts_with = "json")]
    pub clear_cache: bool,
    #[command(flatten)]
    pub cache: CacheArguments,
}

/// Arguments of `polhode completions`.
#[derive(Debug, Args)]
pub struct CompletionsArguments {
    /// The shell.
    #[arg(value_enum)]
    pub shell: clap_complete::Shell,
}
