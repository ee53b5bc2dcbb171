//! Rounds of attempts on the device. Twin: `shaders/control.wgsl` and `shaders/compact.wgsl`.
//!
//! A round is three dispatches, whose sizes the device itself knows: attempts of all bodies in a list, a tally of what they did, and
//! the list of those that are still under way. A submission has several rounds, and only the last control block comes back.

use super::super::buffers::WORKGROUP_SIZE;

/// What a round is asked for, and what came of the rounds before it; the members are described in `shaders/control.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
pub(super) struct Control {
    pub advance_groups: [u32; 3],
    pub compact_groups: [u32; 3],
    pub listed: u32,
    pub fresh: u32,
    pub first_fresh: u32,
    pub starts: u32,
    pub attempts: u32,
    pub attempts_left: u32,
    pub attempts_limit: u32,
    pub made: u32,
    pub longest: u32,
    pub tried: [u32; 2],
    pub held: [u32; 2],
}

/// Where the arguments of the indirect dispatches are in it, in bytes.
pub(super) const ADVANCE_GROUPS: u64 = 0;
pub(super) const COMPACT_GROUPS: u64 = 12;

/// Entries of the list that a workgroup of `compact.wgsl` looks at.
pub(super) const GROUP_ENTRIES: u32 = 1024;

/// Bytes of what it says of them.
pub(super) const TALLY_BYTES: u64 = 16;

/// The least number of attempts of a round: of fewer, the cost of loading and storing a body is a part that counts.
const FEWEST_ATTEMPTS: u32 = 8;

/// The most rounds of a submission. Rounds that nobody needs any more cost a few microseconds each.
const MOST_ROUNDS: usize = 24;

/// The bodies of a submission's first round.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bodies {
    /// Entries of the list.
    pub listed: u32,
    /// Rows that no round has had yet, and the first of them.
    pub fresh: u32,
    pub first_fresh: u32,
    /// Whether the interval starts for those.
    pub starts: bool,
}

impl Bodies {
    pub fn count(&self) -> u32 {
        self.listed + self.fresh
    }
}

impl Control {
    /// For a submission in which a body makes at most `attempts` attempts, at most `limit` of them in one dispatch. `made`: attempts
    /// since rows were last added.
    pub fn new(bodies: Bodies, attempts: u32, limit: u32, made: u32) -> Self {
        let Bodies { listed, fresh, first_fresh, starts } = bodies;
        let [advance_groups, compact_groups] = groups(bodies.count());
        Self {
            advance_groups,
            compact_groups,
            listed,
            fresh,
            first_fresh,
            starts: u32::from(starts),
            attempts: next_attempts(made, limit, attempts),
            attempts_left: attempts,
            attempts_limit: limit,
            made,
            ..Self::default()
        }
    }

    /// The rounds that use up the attempts of a submission where some body makes all of them.
    pub fn rounds(&self) -> usize {
        let (mut made, mut left) = (self.made, self.attempts_left);
        let mut rounds = 0;
        while left > 0 && rounds < MOST_ROUNDS {
            let attempts = next_attempts(made, self.attempts_limit, left);
            (made, left) = (made.saturating_add(attempts), left - attempts);
            rounds += 1;
        }
        rounds
    }

    /// Attempts of all bodies in the submission.
    pub fn all_tried(&self) -> u64 {
        two_words(self.tried)
    }

    /// The same with those that bodies waited for the slowest of their workgroup.
    pub fn all_held(&self) -> u64 {
        two_words(self.held)
    }
}

fn two_words([low, high]: [u32; 2]) -> u64 {
    u64::from(low) | (u64::from(high) << 32)
}

/// As many attempts as bodies have made, so that one that has arrived holds its workgroup for no more attempts than its own, and the
/// number of rounds is the logarithm of the attempts.
fn next_attempts(made: u32, limit: u32, left: u32) -> u32 {
    made.max(FEWEST_ATTEMPTS).min(limit).min(left)
}

/// Workgroups of `adaptive.wgsl` and of `compact.wgsl` for so many entries. Of the second one at least, which writes the next block.
fn groups(entries: u32) -> [[u32; 3]; 2] {
    [[entries.div_ceil(WORKGROUP_SIZE), 1, 1], [entries.div_ceil(GROUP_ENTRIES).max(1), 1, 1]]
}

#[cfg(test)]
mod tests {
    use super::super::super::buffers::{bind, buffer};
    use super::super::super::device::Device;
    use super::super::super::{Gpu, opened_for_a_test};
    use super::super::{Layouts, compact_pipelines};
    use super::*;

    const UNDER_WAY: u32 = 1 << 31;

    /// The twin of `compact.wgsl`: the control block and the list after a round.
    fn after_round(control: &Control, list: &[u32], outcomes: &[u32]) -> (Control, Vec<u32>) {
        let entries = control.listed + control.fresh;
        let row = |entry: u32| match entry.checked_sub(control.listed) {
            Some(fresh) => control.first_fresh + fresh,
            None => list[entry as usize],
        };
        let outcomes = &outcomes[..entries as usize];
        let next_list: Vec<u32> =
            (0..entries).filter(|&entry| outcomes[entry as usize] & UNDER_WAY != 0).map(row).collect();
        let tried = |outcome: &u32| outcome & !UNDER_WAY;
        let longest = outcomes.iter().map(tried).max().unwrap_or(0);
        let all = outcomes.iter().map(|outcome| u64::from(tried(outcome))).sum::<u64>() + control.all_tried();
        let held: u64 = outcomes
            .chunks(WORKGROUP_SIZE as usize)
            .map(|beside| u64::from(beside.iter().map(tried).max().unwrap_or(0)) * beside.len() as u64)
            .sum();
        let words = |x: u64| [x as u32, (x >> 32) as u32];
        let [advance_groups, compact_groups] = groups(next_list.len() as u32);
        let (made, left) = (control.made + longest, control.attempts_left - control.attempts);
        let next = Control {
            advance_groups,
            compact_groups,
            listed: next_list.len() as u32,
            fresh: 0,
            attempts: next_attempts(made, control.attempts_limit, left),
            attempts_left: left,
            made,
            longest: control.longest + longest,
            tried: words(all),
            held: words(held + control.all_held()),
            ..*control
        };
        (next, next_list)
    }

    /// The same on a device.
    fn on_device(gpu: &Gpu, control: &Control, list: &[u32], outcomes: &[u32]) -> (Control, Vec<u32>) {
        let device: &Device = &gpu.device;
        let layouts = Layouts::new(&device.device);
        let pipelines = compact_pipelines(device, &layouts, &[]).expect("compiled");
        let usage = wgpu::BufferUsages::STORAGE
            | wgpu::BufferUsages::INDIRECT
            | wgpu::BufferUsages::COPY_DST
            | wgpu::BufferUsages::COPY_SRC;
        let make = |bytes: u64| buffer(device, "test", bytes.max(4), usage).ok().expect("made");
        let words = outcomes.len() as u64 * 4;
        let size = size_of::<Control>() as u64;
        let tallies = u64::from(control.compact_groups[0]) * TALLY_BYTES;
        let own = [make(size), make(size), make(words), make(words), make(words), make(tallies)];
        device.queue.write_buffer(&own[0], 0, bytemuck::bytes_of(control));
        device.queue.write_buffer(&own[2], 0, bytemuck::cast_slice(list));
        device.queue.write_buffer(&own[4], 0, bytemuck::cast_slice(outcomes));
        let bind_group = bind(device, "compact", &layouts.compact, own.each_ref()).ok().expect("bound");
        let mut encoder = device.device.create_command_encoder(&Default::default());
        let mut pass = encoder.begin_compute_pass(&Default::default());
        for pipeline in &pipelines {
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, &bind_group, &[]);
            pass.dispatch_workgroups_indirect(&own[0], COMPACT_GROUPS);
        }
        drop(pass);
        let read = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        let staging = buffer(device, "staging", size + words.max(4), read).ok().expect("made");
        encoder.copy_buffer_to_buffer(&own[1], 0, &staging, 0, size);
        encoder.copy_buffer_to_buffer(&own[3], 0, &staging, size, words);
        let seen = device.read(encoder.finish(), &staging, 0..size + words, |view| {
            let (control, list) = view.split_at(size as usize);
            (bytemuck::pod_read_unaligned::<Control>(control), bytemuck::pod_collect_to_vec::<u8, u32>(list))
        });
        let (control, mut list) = seen.expect("read");
        list.truncate(control.listed as usize);
        (control, list)
    }

    #[test]
    fn lists_and_tallies_on_a_device_are_those_of_the_host() {
        let gpu = opened_for_a_test();
        let mut random = 0x9e37_79b9_u32;
        let mut next = move || {
            random ^= random << 13;
            random ^= random >> 17;
            random ^= random << 5;
            random
        };
        for entries in [0, 1, 63, 64, 65, 1023, 1024, 1025, 2049, 70_001, 140_000_u32] {
            // Nobody is under way, all are, some are.
            for share in [0, u32::MAX, 0x4000_0000] {
                let listed = entries / 3;
                let bodies = Bodies { listed, fresh: entries - listed, first_fresh: 1_000_000, starts: true };
                let mut control = Control::new(bodies, 1 << 20, 60_000, 40);
                // Sums that pass into the second word.
                (control.tried, control.held, control.longest) = ([u32::MAX - 5, 2], [u32::MAX, 7], 3);
                let list: Vec<u32> = (0..listed).map(|entry| 3 * entry + 1).collect();
                let outcomes: Vec<u32> = (0..entries)
                    .map(|_| if next() <= share && share > 0 { UNDER_WAY | (next() % 60_001) } else { next() % 60_001 })
                    .collect();
                let expected = after_round(&control, &list, &outcomes);
                let seen = on_device(&gpu, &control, &list, &outcomes);
                assert_eq!(seen.0, expected.0, "{entries} entries, share {share:x}");
                assert!(seen.1 == expected.1, "{entries} entries, share {share:x}: lists differ");
            }
        }
    }

    #[test]
    fn rounds_use_up_the_attempts_of_a_submission() {
        let bodies = Bodies { listed: 0, fresh: 100, first_fresh: 0, starts: true };
        let rounds = |attempts, limit, made| Control::new(bodies, attempts, limit, made).rounds();
        assert_eq!(rounds(1, u32::MAX, 0), 1);
        // 8, 8, 16, 32, and the rest.
        assert_eq!(rounds(65, u32::MAX, 0), 5);
        assert_eq!(rounds(64, u32::MAX, 0), 4);
        assert_eq!(rounds(100, 10, 0), 11);
        assert_eq!(rounds(1000, u32::MAX, 1000), 1);
        assert_eq!(rounds(u32::MAX, 1, 0), MOST_ROUNDS);
    }
}
