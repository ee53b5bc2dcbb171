// Entry point: statistics of the bodies' state by workgroup. Twin: src/kernel/observe.rs; component c of body i is at c * stride + i in
// every table, where i is the body's row in the state and its place in the other tables.

struct Settings {
    stride: u32,
    // Always 0, which no compiler knows; see `rounded` in real_f32.wgsl.
    zero: u32,
    statistic_count: u32,
    // Number of workgroups, one for each piece of the places.
    piece_count: u32,
    // The statistics asked for, by the numbers below.
    statistics: vec4<u32>,
}

// mantissa * 2^exponent.
struct Scaled {
    mantissa: real,
    exponent: i32,
}

// A body's quantity at one end of the range.
struct Extreme {
    mantissa: real,
    exponent: i32,
    body: u32,
}

// Statistics of some bodies: multiples of 2^exponent, or of its square.
struct Partial {
    // Bodies that did not fail.
    count: u32,
    // The number of those bodies that are marked as spinning too fast.
    faster: u32,
    exponent: i32,
    padding: u32,
    // The mean, in two words.
    mean: real,
    residue: real,
    // The sum of squared deviations from the mean.
    squares: real,
    least: Extreme,
    greatest: Extreme,
}

@group(0) @binding(0) var<uniform> settings: Settings;
@group(0) @binding(1) var<storage, read> state_columns: array<real>;
// The same columns, as bits.
@group(0) @binding(2) var<storage, read> state_words: array<u32>;
// 1/I1, 1/I2, 1/I3, the spin rate beyond which a body is marked, and each statistic's scale.
@group(0) @binding(3) var<storage, read> columns: array<real>;
// One for each workgroup and statistic.
@group(0) @binding(4) var<storage, read_write> partials: array<Partial>;
// Four words for every 64 bodies: a bit for each body that failed, then one for each that spins too fast.
@group(0) @binding(5) var<storage, read_write> marks: array<u32>;

// The first place of each piece and how many there are, then the row of each place.
@group(0) @binding(6) var<storage, read> places: array<u32>;

const WORKGROUP: u32 = 64u;
// Number of bodies that a lane merges before the workgroup's tree: few enough to fill a GPU, and enough that barriers, which are
// expensive on a software adapter, do not matter.
const BODIES_PER_LANE: u32 = 16u;
const SCALE_COLUMN: u32 = 4u;
const ZERO_EXPONENT: i32 = -16384;

const KINETIC_ENERGY: u32 = 0u;
const SPIN_RATE: u32 = 1u;
const ANGULAR_MOMENTUM: u32 = 2u;

var<workgroup> tree: array<Partial, WORKGROUP>;
var<workgroup> workgroup_marks: array<atomic<u32>, 64>;

fn column_at(column: u32, place: u32) -> real {
    return columns[column * settings.stride + place];
}

// Whether no component of body i is NaN and no step has failed on it.
fn is_sound(i: u32) -> bool {
    var sound = true;
    for (var column = 0u; column < 7u; column += 1u) {
        sound = sound && is_finite(column, i);
    }
    return sound && state_columns[7u * WORDS * settings.stride + i] == 0.0;
}

fn partial_of_body(x: Scaled, body: u32, faster: bool) -> Partial {
    let extreme = Extreme(x.mantissa, x.exponent, body);
    return Partial(1u, select(0u, 1u, faster), x.exponent, 0u, x.mantissa, 0.0, 0.0, extreme, extreme);
}

fn is_less(a: Extreme, b: Extreme) -> bool {
    return a.exponent < b.exponent || (a.exponent == b.exponent && a.mantissa < b.mantissa);
}

// The statistics of both; of equal extremes the first is kept.
fn merge(a: Partial, b: Partial) -> Partial {
    if (b.count == 0u) {
        return a;
    }
    if (a.count == 0u) {
        return b;
    }
    let exponent = max(a.exponent, b.exponent);
    let a_scale = power_of_two(a.exponent - exponent);
    let b_scale = power_of_two(b.exponent - exponent);
    let share = real(b.count) / real(a.count + b.count);
    let mean = a.mean * a_scale;
    let residue = a.residue * a_scale;
    let difference = rounded(rounded(b.mean * b_scale - mean) + rounded(b.residue * b_scale - residue));
    let corrected = rounded(rounded(difference * share) + residue);
    let sum = rounded(mean + corrected);
    let taken = rounded(sum - mean);
    let squares = (a.squares * a_scale) * a_scale + (b.squares * b_scale) * b_scale;
    var merged: Partial;
    merged.count = a.count + b.count;
    merged.faster = a.faster + b.faster;
    merged.exponent = exponent;
    merged.mean = sum;
    merged.residue = corrected - taken;
    merged.squares = squares + difference * difference * (real(a.count) * share);
    merged.least = a.least;
    if (is_less(b.least, a.least)) {
        merged.least = b.least;
    }
    merged.greatest = a.greatest;
    if (is_less(a.greatest, b.greatest)) {
        merged.greatest = b.greatest;
    }
    return merged;
}

// Sums the entries of `tree` into the first one.
fn merge_tree(lane: u32) {
    workgroupBarrier();
    for (var half = WORKGROUP / 2u; half > 0u; half /= 2u) {
        if (lane < half) {
            tree[lane] = merge(tree[lane], tree[lane + half]);
        }
        workgroupBarrier();
    }
}

// The angular momentum without the spin that a method may give a linear rotor about its axis, whose inverse moment is
// zero here.
fn without_axis(inverse_moments: vector, m: vector) -> vector {
    return vector(select(real(0.0), m.x, inverse_moments.x > 0.0), m.y, m.z);
}

// The quantity of angular momentum m in a body's own scale.
fn quantity(statistic: u32, inverse_moments: vector, m: vector) -> real {
    let omega = inverse_moments * m;
    if (statistic == KINETIC_ENERGY) {
        return 0.5 * dot_vector(m, omega);
    }
    if (statistic == SPIN_RATE) {
        return sqrt(dot_vector(omega, omega));
    }
    return sqrt(dot_vector(m, m));
}

// The power of the angular momentum to which a statistic is proportional.
fn degree(statistic: u32) -> i32 {
    return select(1, 2, statistic == KINETIC_ENERGY);
}

@compute @workgroup_size(WORKGROUP)
fn observe(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let stride = settings.stride;
    let first = places[2u * group.x];
    let count = places[2u * group.x + 1u];
    var own: array<Partial, 3>;
    for (var round = 0u; round < BODIES_PER_LANE; round += 1u) {
        let offset = round * WORKGROUP + lane;
        if (offset >= count) {
            break;
        }
        let place = first + offset;
        let i = places[2u * settings.piece_count + place];
        if (!is_sound(i)) {
            atomicOr(&workgroup_marks[4u * round + lane / 32u], 1u << (lane % 32u));
            continue;
        }
        let inverse_moments = vector(column_at(0u, place), column_at(1u, place), column_at(2u, place));
        let momentum = without_axis(
            inverse_moments,
            vector(state_columns[4u * stride + i], state_columns[5u * stride + i], state_columns[6u * stride + i]),
        );
        let exponent = exponent_of(max(max(abs(momentum.x), abs(momentum.y)), abs(momentum.z)));
        let m = momentum * power_of_two(-exponent);
        let rate = quantity(SPIN_RATE, inverse_moments, m);
        let faster = rate * power_of_two(exponent) > column_at(3u, place);
        if (faster) {
            atomicOr(&workgroup_marks[4u * round + 2u + lane / 32u], 1u << (lane % 32u));
        }
        for (var index = 0u; index < settings.statistic_count; index += 1u) {
            let statistic = settings.statistics[index];
            let scale = column_at(SCALE_COLUMN + index, place);
            let x = normalised(quantity(statistic, inverse_moments, m), scale, degree(statistic) * exponent);
            own[index] = merge(own[index], partial_of_body(x, place, faster));
        }
    }
    for (var index = 0u; index < settings.statistic_count; index += 1u) {
        tree[lane] = own[index];
        merge_tree(lane);
        if (lane == 0u) {
            partials[group.x * settings.statistic_count + index] = tree[0];
        }
        workgroupBarrier();
    }
    marks[64u * group.x + lane] = atomicLoad(&workgroup_marks[lane]);
}
