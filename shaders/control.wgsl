// The request for a round of attempts, and the results of the rounds before it. A round reads one such block and writes that of the next.
// Twin: Control in src/engine/gpu/adaptive/control.rs. The entry point's chunk declares `control` and `list`.

struct Control {
    // Workgroups of adaptive.wgsl in this round, and of each entry point of compact.wgsl.
    advance_groups: array<u32, 3>,
    compact_groups: array<u32, 3>,
    // The bodies of this round: the number of listed entries, then the number of rows that no round has had yet, and the first of those.
    listed: u32,
    fresh: u32,
    first_fresh: u32,
    // Whether the interval starts for those; otherwise their controllers hold their positions.
    starts: u32,
    // The most attempts of a body in this round, in this and the later rounds of the submission, and in any one round.
    attempts: u32,
    attempts_left: u32,
    attempts_limit: u32,
    // The most attempts of a body since rows were last added.
    made: u32,
    // For the submission so far: the most attempts of a body; those of all bodies; and the same including those during which bodies waited
    // for the slowest of their workgroup. The last two in two words, low word first.
    longest: u32,
    tried: array<u32, 2>,
    held: array<u32, 2>,
}

// In the outcome of a body: the bit that says that it is still under way. The other bits are its attempts in the round.
const UNDER_WAY: u32 = 0x80000000u;

fn entry_count() -> u32 {
    return control.listed + control.fresh;
}

fn is_fresh(entry: u32) -> bool {
    return entry >= control.listed;
}

// The row of the body at an entry.
fn row_of(entry: u32) -> u32 {
    if (is_fresh(entry)) {
        return control.first_fresh + (entry - control.listed);
    }
    return list[entry];
}
