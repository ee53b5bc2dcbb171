// Entry points: tally what the bodies of a round did, by group of entries; and write the list of those still under way, in order,
// with the control block of the next round. Twin: src/engine/gpu/adaptive/control.rs.

@group(0) @binding(0) var<storage, read> control: Control;
@group(0) @binding(1) var<storage, read_write> next_control: Control;
@group(0) @binding(2) var<storage, read> list: array<u32>;
@group(0) @binding(3) var<storage, read_write> next_list: array<u32>;
@group(0) @binding(4) var<storage, read> outcomes: array<u32>;
@group(0) @binding(5) var<storage, read_write> tallies: array<Tally>;

// What the bodies of a group of entries did in a round.
struct Tally {
    under_way: u32,
    tried: u32,
    held: u32,
    longest: u32,
}

// Lanes of a workgroup here, and bodies of one in adaptive.wgsl.
const WORKGROUP: u32 = 64u;
// Number of blocks of WORKGROUP entries that one workgroup here handles.
const BLOCKS: u32 = 16u;
// The least number of attempts of a round: with fewer, loading and storing a body would be a considerable part of the cost.
const FEWEST_ATTEMPTS: u32 = 8u;

var<workgroup> under_way_count: atomic<u32>;
var<workgroup> tried_sum: atomic<u32>;
var<workgroup> longest_of_block: array<atomic<u32>, BLOCKS>;
var<workgroup> entries_before: atomic<u32>;
// A bit for each entry that is under way, two words for each block.
var<workgroup> marks: array<atomic<u32>, 32>;
var<workgroup> sums: array<Sums, WORKGROUP>;

// Sums over tallies; attempts in two words.
struct Sums {
    under_way: u32,
    longest: u32,
    tried: vec2<u32>,
    held: vec2<u32>,
}

fn added(sum: vec2<u32>, more: u32) -> vec2<u32> {
    let low = sum.x + more;
    return vec2<u32>(low, sum.y + select(0u, 1u, low < more));
}

fn added_pair(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> {
    let sum = added(a, b.x);
    return vec2<u32>(sum.x, sum.y + b.y);
}

// The entry that a lane handles in a block of its group.
fn entry_of(group: u32, block: u32, lane: u32) -> u32 {
    return (group * BLOCKS + block) * WORKGROUP + lane;
}

@compute @workgroup_size(WORKGROUP)
fn tally(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    for (var block = 0u; block < BLOCKS; block += 1u) {
        let entry = entry_of(group.x, block, lane);
        if (entry >= entry_count()) {
            break;
        }
        let outcome = outcomes[entry];
        let tried = outcome & ~UNDER_WAY;
        atomicAdd(&under_way_count, select(0u, 1u, outcome != tried));
        atomicAdd(&tried_sum, tried);
        atomicMax(&longest_of_block[block], tried);
    }
    workgroupBarrier();
    if (lane == 0u) {
        var own = Tally(atomicLoad(&under_way_count), atomicLoad(&tried_sum), 0u, 0u);
        for (var block = 0u; block < BLOCKS; block += 1u) {
            let start = min(entry_of(group.x, block, 0u), entry_count());
            let longest = atomicLoad(&longest_of_block[block]);
            own.held += longest * min(entry_count() - start, WORKGROUP);
            own.longest = max(own.longest, longest);
        }
        tallies[group.x] = own;
    }
}

@compute @workgroup_size(WORKGROUP)
fn compact(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    var before = 0u;
    for (var other = lane; other < group.x; other += WORKGROUP) {
        before += tallies[other].under_way;
    }
    atomicAdd(&entries_before, before);
    for (var block = 0u; block < BLOCKS; block += 1u) {
        let entry = entry_of(group.x, block, lane);
        if (entry < entry_count() && (outcomes[entry] & UNDER_WAY) != 0u) {
            atomicOr(&marks[2u * block + lane / 32u], 1u << (lane % 32u));
        }
    }
    workgroupBarrier();
    var place = atomicLoad(&entries_before);
    let lower = (1u << (lane % 32u)) - 1u;
    for (var block = 0u; block < BLOCKS; block += 1u) {
        let low = atomicLoad(&marks[2u * block]);
        let high = atomicLoad(&marks[2u * block + 1u]);
        let own = select(high, low, lane < 32u);
        if ((own & (1u << (lane % 32u))) != 0u) {
            let rank = countOneBits(own & lower) + select(countOneBits(low), 0u, lane < 32u);
            next_list[place + rank] = row_of(entry_of(group.x, block, lane));
        }
        place += countOneBits(low) + countOneBits(high);
    }
    if (group.x == 0u) {
        write_next_control(lane);
    }
}

// Writes the control block of the next round, in the first workgroup.
fn write_next_control(lane: u32) {
    let groups = control.compact_groups[0];
    var own = Sums(0u, 0u, vec2<u32>(0u, 0u), vec2<u32>(0u, 0u));
    for (var other = lane; other < groups; other += WORKGROUP) {
        let tally = tallies[other];
        own.under_way += tally.under_way;
        own.longest = max(own.longest, tally.longest);
        own.tried = added(own.tried, tally.tried);
        own.held = added(own.held, tally.held);
    }
    sums[lane] = own;
    workgroupBarrier();
    if (lane != 0u) {
        return;
    }
    var next = control;
    var all = Sums(0u, 0u, vec2<u32>(control.tried[0], control.tried[1]), vec2<u32>(control.held[0], control.held[1]));
    for (var other = 0u; other < WORKGROUP; other += 1u) {
        let part = sums[other];
        all.under_way += part.under_way;
        all.longest = max(all.longest, part.longest);
        all.tried = added_pair(all.tried, part.tried);
        all.held = added_pair(all.held, part.held);
    }
    next.listed = all.under_way;
    next.fresh = 0u;
    next.made = control.made + all.longest;
    next.attempts_left = control.attempts_left - min(control.attempts, control.attempts_left);
    next.attempts = min(max(next.made, FEWEST_ATTEMPTS), min(control.attempts_limit, next.attempts_left));
    next.longest = control.longest + all.longest;
    next.tried = array<u32, 2>(all.tried.x, all.tried.y);
    next.held = array<u32, 2>(all.held.x, all.held.y);
    next.advance_groups = array<u32, 3>((next.listed + WORKGROUP - 1u) / WORKGROUP, 1u, 1u);
    let entries = BLOCKS * WORKGROUP;
    // At least one, which writes the block after this one.
    next.compact_groups = array<u32, 3>(max((next.listed + entries - 1u) / entries, 1u), 1u, 1u);
    next_control = next;
}
