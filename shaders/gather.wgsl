// Entry points: what a study asks of its bodies, formed where their states are. `evaluate` forms the quantities, `reduce` their moments
// piece by piece, `count` their histograms. Numbers are f64 whatever the precision of the states. Host: src/engine/gpu/gather.rs, which puts
// `quantities_of` before this file; twins: UserAxes::components in src/bodies/user_axes.rs, Moments in src/math/moments.rs.
// Component c of body i is at c * stride + i in the state; other tables are by place, place_stride apart.

struct Settings {
    // Distance of two columns of the state.
    stride: u32,
    // Always 0, which no compiler knows; see `separated` in real_f64.wgsl.
    zero: u32,
    // Workgroups of `reduce`, one a piece of the places.
    piece_count: u32,
    place_count: u32,
    place_stride: u32,
    quantity_count: u32,
    histogram_count: u32,
    padding: u32,
    // Seconds.
    time: real,
}

// A body's state in the user's axes and units, as formulas read it.
struct UserState {
    orientation: quaternion,
    angular_velocity: vector,
    momentum_world: vector,
    kinetic_energy: real,
}

// Moments of a quantity over the bodies of a piece.
struct PieceMoments {
    // Bodies whose quantity is a finite number.
    count: u32,
    // Bodies that have not failed.
    sound: u32,
    // Whose the extremes are; of equal ones the first.
    least_place: u32,
    greatest_place: u32,
    mean: real,
    // The sum of squared deviations from the mean.
    squares: real,
    least: real,
    greatest: real,
}

@group(0) @binding(0) var<uniform> settings: Settings;
@group(0) @binding(1) var<storage, read> state_columns: array<state_real>;
// The same columns, as bits.
@group(0) @binding(2) var<storage, read> state_words: array<u32>;
// What does not change in time: the frames of the bodies, then what else the quantities read.
@group(0) @binding(3) var<storage, read> columns: array<real>;
// The first place of each piece and how many there are, then the row of each place.
@group(0) @binding(4) var<storage, read> places: array<u32>;
// The quantities, then 1 for a body that has not failed, else 0.
@group(0) @binding(5) var<storage, read_write> values: array<real>;
// The same, once they are formed, as numbers and as bits.
@group(0) @binding(6) var<storage, read> formed: array<real>;
@group(0) @binding(7) var<storage, read> formed_words: array<u32>;
// One a piece and quantity.
@group(0) @binding(8) var<storage, read_write> moments: array<PieceMoments>;
// Of each histogram its quantity, how many bins it has, where its edges begin and where its counts do.
@group(0) @binding(9) var<storage, read> histograms: array<vec4<u32>>;
@group(0) @binding(10) var<storage, read> edges: array<real>;
@group(0) @binding(11) var<storage, read_write> counts: array<atomic<u32>>;

const WORKGROUP: u32 = 64u;
const BODIES_PER_LANE: u32 = 16u;

// Columns of a body's frame.
const MOMENTS: u32 = 0u;
const PRINCIPAL_TO_BODY: u32 = 3u;
const ANGULAR_VELOCITY_UNIT: u32 = 7u;
const ANGULAR_MOMENTUM_UNIT: u32 = 8u;
const ENERGY_UNIT: u32 = 9u;
const IS_LINEAR_ROTOR: u32 = 10u;

var<workgroup> tree_counts: array<u32, WORKGROUP>;
var<workgroup> tree_sound: array<u32, WORKGROUP>;
var<workgroup> tree_sums: array<real, WORKGROUP>;
var<workgroup> tree_least: array<real, WORKGROUP>;
var<workgroup> tree_least_place: array<u32, WORKGROUP>;
var<workgroup> tree_greatest: array<real, WORKGROUP>;
var<workgroup> tree_greatest_place: array<u32, WORKGROUP>;

fn column_at(column: u32, place: u32) -> real {
    return columns[column * settings.place_stride + place];
}

// Whether body i is a number in every place and no step has failed on it.
fn is_sound(i: u32) -> bool {
    var sound = true;
    for (var column = 0u; column < 7u; column += 1u) {
        sound = sound && is_finite(column, i);
    }
    return sound && state_columns[STATUS_COLUMN * settings.stride + i] == 0.0;
}

// q v q*, with products that are not fused with sums.
fn rotated(q: quaternion, v: vector) -> vector {
    let u = q.xyz;
    let across = vector(u.y * v.z - v.y * u.z, u.z * v.x - v.z * u.x, u.x * v.y - v.x * u.y);
    let length_squared = u.x * u.x + u.y * u.y + u.z * u.z;
    let along = v.x * u.x + v.y * u.y + v.z * u.z;
    return v * (q.w * q.w - length_squared) + u * (along * 2.0) + across * (q.w * 2.0);
}

// The product of two unit quaternions, with the norm's roundings taken out to first order.
fn unit_product(a: quaternion, b: quaternion) -> quaternion {
    let p = quaternion(
        a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
        a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x,
        a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w,
        a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z,
    );
    return p * (1.5 - 0.5 * (p.x * p.x + p.y * p.y + p.z * p.z + p.w * p.w));
}

// The state of the body in row i, whose place is given, in the user's axes and units.
fn user_state(place: u32, i: u32) -> UserState {
    let q = quaternion(state_at(0u, i), state_at(1u, i), state_at(2u, i), state_at(3u, i));
    // A linear rotor has no spin; a method that turns about one axis after another makes some, of its own error.
    let spin = select(state_at(4u, i), real(0.0), column_at(IS_LINEAR_ROTOR, place) > 0.5);
    let m = vector(spin, state_at(5u, i), state_at(6u, i));
    let inertia = vector(column_at(MOMENTS, place), column_at(MOMENTS + 1u, place), column_at(MOMENTS + 2u, place));
    let turn = quaternion(
        column_at(PRINCIPAL_TO_BODY, place),
        column_at(PRINCIPAL_TO_BODY + 1u, place),
        column_at(PRINCIPAL_TO_BODY + 2u, place),
        column_at(PRINCIPAL_TO_BODY + 3u, place),
    );
    let norm = sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
    let unit = q * (real(1.0) / norm);
    let omega = m / inertia;
    let energy = 0.5 * (m.x * omega.x + m.y * omega.y + m.z * omega.z);
    return UserState(
        unit_product(unit, quaternion(-turn.x, -turn.y, -turn.z, turn.w)),
        rotated(turn, omega) * column_at(ANGULAR_VELOCITY_UNIT, place),
        rotated(unit, m) * column_at(ANGULAR_MOMENTUM_UNIT, place),
        energy * column_at(ENERGY_UNIT, place),
    );
}

@compute @workgroup_size(WORKGROUP)
fn evaluate(@builtin(global_invocation_id) invocation: vec3<u32>) {
    let place = invocation.x;
    if (place >= settings.place_count) {
        return;
    }
    let i = places[2u * settings.piece_count + place];
    let sound = is_sound(i);
    values[settings.quantity_count * settings.place_stride + place] = select(real(0.0), real(1.0), sound);
    if (!sound) {
        return;
    }
    var found = quantities_of(user_state(place, i), place);
    for (var quantity = 0u; quantity < settings.quantity_count; quantity += 1u) {
        values[quantity * settings.place_stride + place] = found[quantity];
    }
}

fn has_not_failed(place: u32) -> bool {
    return formed[settings.quantity_count * settings.place_stride + place] > 0.5;
}

// Whether a body has a quantity: shaders must not compare with NaN, so the exponent's bits are looked at, in the upper word.
fn has_value(quantity: u32, place: u32) -> bool {
    let upper = formed_words[2u * (quantity * settings.place_stride + place) + 1u];
    return has_not_failed(place) && (upper & 0x7ff00000u) != 0x7ff00000u;
}

@compute @workgroup_size(WORKGROUP)
fn reduce(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let first = places[2u * group.x];
    let count = places[2u * group.x + 1u];
    for (var quantity = 0u; quantity < settings.quantity_count; quantity += 1u) {
        let start = quantity * settings.place_stride + first;
        var found = 0u;
        var sound = 0u;
        var sum: real = 0.0;
        var least: real = 0.0;
        var greatest: real = 0.0;
        var least_place = first;
        var greatest_place = first;
        for (var offset = lane; offset < count; offset += WORKGROUP) {
            sound += select(0u, 1u, has_not_failed(first + offset));
            if (!has_value(quantity, first + offset)) {
                continue;
            }
            let value = formed[start + offset];
            if (found == 0u || value < least) {
                least = value;
                least_place = first + offset;
            }
            if (found == 0u || value > greatest) {
                greatest = value;
                greatest_place = first + offset;
            }
            sum += value;
            found += 1u;
        }
        tree_counts[lane] = found;
        tree_sound[lane] = sound;
        tree_sums[lane] = sum;
        tree_least[lane] = least;
        tree_least_place[lane] = least_place;
        tree_greatest[lane] = greatest;
        tree_greatest_place[lane] = greatest_place;
        workgroupBarrier();
        for (var half = WORKGROUP / 2u; half > 0u; half /= 2u) {
            if (lane < half) {
                merge_lanes(lane, lane + half);
            }
            workgroupBarrier();
        }
        let total = tree_counts[0];
        let mean = tree_sums[0] / real(max(total, 1u));
        // All have read what the tree came to before it is used again.
        workgroupBarrier();
        var squares: real = 0.0;
        for (var offset = lane; offset < count; offset += WORKGROUP) {
            if (has_value(quantity, first + offset)) {
                let deviation = formed[start + offset] - mean;
                squares += deviation * deviation;
            }
        }
        tree_sums[lane] = squares;
        workgroupBarrier();
        for (var half = WORKGROUP / 2u; half > 0u; half /= 2u) {
            if (lane < half) {
                tree_sums[lane] += tree_sums[lane + half];
            }
            workgroupBarrier();
        }
        if (lane == 0u) {
            moments[group.x * settings.quantity_count + quantity] = PieceMoments(
                total,
                tree_sound[0],
                tree_least_place[0],
                tree_greatest_place[0],
                mean,
                tree_sums[0],
                tree_least[0],
                tree_greatest[0],
            );
        }
        workgroupBarrier();
    }
}

// Merges what lane b holds into what lane a holds; of equal extremes the first place stays.
fn merge_lanes(a: u32, b: u32) {
    let has_a = tree_counts[a] > 0u;
    let has_b = tree_counts[b] > 0u;
    let is_less = tree_least[b] < tree_least[a]
        || (tree_least[b] == tree_least[a] && tree_least_place[b] < tree_least_place[a]);
    if (has_b && (!has_a || is_less)) {
        tree_least[a] = tree_least[b];
        tree_least_place[a] = tree_least_place[b];
    }
    let is_greater = tree_greatest[b] > tree_greatest[a]
        || (tree_greatest[b] == tree_greatest[a] && tree_greatest_place[b] < tree_greatest_place[a]);
    if (has_b && (!has_a || is_greater)) {
        tree_greatest[a] = tree_greatest[b];
        tree_greatest_place[a] = tree_greatest_place[b];
    }
    tree_counts[a] += tree_counts[b];
    tree_sound[a] += tree_sound[b];
    tree_sums[a] += tree_sums[b];
}

@compute @workgroup_size(WORKGROUP)
fn count(@builtin(global_invocation_id) invocation: vec3<u32>) {
    let place = invocation.x;
    if (place >= settings.place_count) {
        return;
    }
    for (var index = 0u; index < settings.histogram_count; index += 1u) {
        let quantity = histograms[index].x;
        let bins = histograms[index].y;
        let first_edge = histograms[index].z;
        if (!has_value(quantity, place)) {
            continue;
        }
        let value = formed[quantity * settings.place_stride + place];
        // How many edges are not above the value: 0 is below the first, bins + 1 not below the last.
        var below = 0u;
        var above = bins + 1u;
        while (below < above) {
            let middle = (below + above) / 2u;
            if (edges[first_edge + middle] <= value) {
                below = middle + 1u;
            } else {
                above = middle;
            }
        }
        atomicAdd(&counts[histograms[index].w + below], 1u);
    }
}
