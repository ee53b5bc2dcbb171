// Entry points: what a study asks of its bodies, formed where their states are. `evaluate` forms the quantities, `reduce` their moments
// piece by piece, `count` their histograms. Numbers are f64 whatever the precision of the states. Host: src/engine/gpu/gather.rs, which puts
// `quantities_of` before this file; twins: UserAxes::components in src/bodies/user_axes.rs, Moments in src/math/moments.rs.
// Component c of body i is at c * stride + i in the state; other tables are by place, place_stride apart.

struct Settings {
    // Distance of two columns of the state.
    stride: u32,
    // Always 0, which no compiler knows; see `separated` in separated_int64.wgsl.
    zero: u32,
    // Workgroups of `reduce`, one a piece of the places.
    piece_count: u32,
    place_count: u32,
    place_stride: u32,
    quantity_count: u32,
    // How many of the quantities have moments: the first ones.
    moment_count: u32,
    histogram_count: u32,
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

// Columns of a body's frame.
const MOMENTS: u32 = 0u;
const PRINCIPAL_TO_BODY: u32 = 3u;
const ANGULAR_VELOCITY_UNIT: u32 = 7u;
const ANGULAR_MOMENTUM_UNIT: u32 = 8u;
const ENERGY_UNIT: u32 = 9u;
const IS_LINEAR_ROTOR: u32 = 10u;

// Moments of the bodies of each lane, for two quantities in turn: one is merged while the next is formed.
var<workgroup> lanes: array<PieceMoments, 2u * WORKGROUP>;

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

// The moments of a quantity over the bodies of a piece that fall to one lane, in two passes.
fn moments_of_lane(quantity: u32, first: u32, count: u32, lane: u32) -> PieceMoments {
    let start = quantity * settings.place_stride + first;
    var own: PieceMoments;
    var sum: real = 0.0;
    for (var offset = lane; offset < count; offset += WORKGROUP) {
        own.sound += select(0u, 1u, has_not_failed(first + offset));
        if (has_value(quantity, first + offset)) {
            let value = formed[start + offset];
            if (own.count == 0u || value < own.least) {
                own.least = value;
                own.least_place = first + offset;
            }
            if (own.count == 0u || value > own.greatest) {
                own.greatest = value;
                own.greatest_place = first + offset;
            }
            sum += value;
            own.count += 1u;
        }
    }
    own.mean = sum / real(max(own.count, 1u));
    for (var offset = lane; offset < count; offset += WORKGROUP) {
        if (has_value(quantity, first + offset)) {
            let deviation = formed[start + offset] - own.mean;
            own.squares += deviation * deviation;
        }
    }
    return own;
}

// The moments of both (Chan, Golub and LeVeque 1983, equation 2.1); of equal extremes the first place is kept.
fn merged(a: PieceMoments, b: PieceMoments) -> PieceMoments {
    var both = a;
    both.sound = a.sound + b.sound;
    if (b.count == 0u) {
        return both;
    }
    if (a.count == 0u) {
        both = b;
        both.sound = a.sound + b.sound;
        return both;
    }
    both.count = a.count + b.count;
    let share = real(b.count) / real(both.count);
    let difference = b.mean - a.mean;
    both.mean = a.mean + difference * share;
    both.squares = a.squares + b.squares + difference * difference * (real(a.count) * share);
    if (b.least < a.least || (b.least == a.least && b.least_place < a.least_place)) {
        both.least = b.least;
        both.least_place = b.least_place;
    }
    if (b.greatest > a.greatest || (b.greatest == a.greatest && b.greatest_place < a.greatest_place)) {
        both.greatest = b.greatest;
        both.greatest_place = b.greatest_place;
    }
    return both;
}

@compute @workgroup_size(WORKGROUP)
fn reduce(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let first = places[2u * group.x];
    let count = places[2u * group.x + 1u];
    for (var quantity = 0u; quantity < settings.moment_count; quantity += 1u) {
        let side = WORKGROUP * (quantity % 2u);
        lanes[side + lane] = moments_of_lane(quantity, first, count, lane);
        // One barrier a quantity, as a software adapter pays dearly for them: whoever merges comes to the next one after it.
        workgroupBarrier();
        if (lane == quantity % WORKGROUP) {
            var all = lanes[side];
            for (var other = 1u; other < WORKGROUP; other += 1u) {
                all = merged(all, lanes[side + other]);
            }
            moments[group.x * settings.moment_count + quantity] = all;
        }
    }
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
