//! The order of bodies by expected work, and the balance of work between neighbours.
//!
//! Bodies that are integrated side by side, in the lanes of a register or the invocations of a workgroup, all wait for the
//! slowest of them.

/// The bodies' indices by expected work, most first, so that neighbours finish together and the bodies with most work
/// start first.
///
/// `expected`: any measure of work by body, finite; among equals the lower index comes first, so that the order is
/// unique.
pub fn order(expected: &[f64]) -> Vec<usize> {
    let mut order: Vec<(f64, usize)> = expected.iter().copied().zip(0..).collect();
    order.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    order.into_iter().map(|(_, index)| index).collect()
}

/// Work of groups of `group` neighbours, including the waiting for the slowest, as a multiple of the work of all
/// bodies: 1 if every group is balanced, `group` if one body of each works and the others wait.
///
/// # Panics
///
/// If `group` is 0.
pub fn imbalance(work: &[u64], group: usize) -> f64 {
    let total: u64 = work.iter().sum();
    if total == 0 {
        return 1.0;
    }
    let taken: u64 = work.chunks(group).map(|chunk| chunk.iter().max().unwrap_or(&0) * chunk.len() as u64).sum();
    taken as f64 / total as f64
}
