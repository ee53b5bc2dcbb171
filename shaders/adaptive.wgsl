// Entry point: loads a body of a list, tries adaptive steps, stores it and records its progress. Twin: Advance in
// src/engine/cpu/adaptive.rs. The control block (control.wgsl) determines which bodies, and how many attempts.

override workgroup_size: u32 = 64u;

struct Settings {
    stride: u32,
    // Always 0, which no compiler knows; see `rounded` in real_f32.wgsl.
    zero: u32,
    // Length of the interval in seconds, in two words.
    span_value: real,
    span_residue: real,
    tolerance: real,
    // In seconds, or in units of the body's own scale.
    least_step: real,
    least_step_in_seconds: u32,
    padding: u32,
    // Whole ticks from the initial state to the start of the interval, low word first; see src/math/clock.rs.
    ticks: vec2<u32>,
    // Ticks in a second times 2^-60.
    tick_scale: real,
}

@group(0) @binding(0) var<uniform> settings: Settings;
@group(0) @binding(1) var<storage, read> parameters: array<real>;
@group(0) @binding(2) var<storage, read_write> state_columns: array<real>;
// Step, remainder of the interval (two words) and `retried` of each body's Controller.
@group(0) @binding(3) var<storage, read_write> controllers: array<real>;
// Accepted and rejected steps since the initial state, two words each, low word first.
@group(0) @binding(4) var<storage, read_write> counts: array<u32>;
// Rows of the bodies under way.
@group(0) @binding(5) var<storage, read> list: array<u32>;
// For each body of this round its attempts, and whether it is still under way.
@group(0) @binding(6) var<storage, read_write> outcomes: array<u32>;
@group(0) @binding(7) var<storage, read> control: Control;

fn controller_at(column: u32, i: u32) -> real {
    return controllers[column * settings.stride + i];
}

fn load_controller(i: u32) -> Controller {
    let left = TwoWordsReal(controller_at(1u, i), controller_at(2u, i));
    return Controller(controller_at(0u, i), left, controller_at(3u, i), 0.0, 0.0);
}

fn store_controller(controller: Controller, i: u32) {
    let stride = settings.stride;
    controllers[i] = controller.step;
    controllers[stride + i] = controller.left.value;
    controllers[2u * stride + i] = controller.left.residue;
    controllers[3u * stride + i] = controller.retried;
}

// Adds to the count in columns `first` and `first` + 1.
fn count(first: u32, i: u32, more_steps: u32) {
    let low = first * settings.stride + i;
    let high = low + settings.stride;
    let sum = counts[low] + more_steps;
    counts[low] = sum;
    counts[high] = counts[high] + select(0u, 1u, sum < more_steps);
}

@compute @workgroup_size(workgroup_size)
fn adaptive(@builtin(global_invocation_id) id: vec3<u32>) {
    let entry = id.x;
    if (entry >= entry_count()) {
        return;
    }
    let i = row_of(entry);
    let body = load_body(i);
    load_torques(i);
    // In units of the body's own scale: the rate is a power of two, so that all products with it are exact.
    let rate = parameter_at(RATE_COLUMN, i);
    let span = TwoWordsReal(settings.span_value * rate, settings.span_residue * rate);
    let unit = select(real(1.0), rate, settings.least_step_in_seconds != 0u);
    let limits = Limits(settings.tolerance, settings.least_step * unit);
    let state = load_state(i);
    var controller = load_controller(i);
    if (is_fresh(entry) && control.starts != 0u) {
        controller = over(controller, span);
    }
    let attempted = advance(body, span, limits, control.attempts, controller, state);
    store_state(attempted.state, i);
    store_controller(attempted.controller, i);
    let accepted = u32(attempted.controller.accepted);
    let rejected = u32(attempted.controller.rejected);
    count(0u, i, accepted);
    count(2u, i, rejected);
    let flag = select(0u, UNDER_WAY, under_way(attempted.controller, attempted.state));
    outcomes[entry] = (accepted + rejected) | flag;
}
