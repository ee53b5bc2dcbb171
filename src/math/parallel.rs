//! Loops on all threads of the current pool.
//!
//! rayon compiles a parallel iterator anew for each closure, thousands of lines of machine code each. Here closures are passed as `dyn`, so that
//! rayon's part is compiled once, or once for each type of results.

use std::ops::Range;
use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;

/// The fewest rows of a thread where each takes about a microsecond, as what is done for a body between two steps.
pub(crate) const OF_A_STEP: usize = 64;

/// Calls `task` with each index below `count`. A single one stays on the calling thread, as waking another takes longer than most tasks.
fn for_each(count: usize, task: &(dyn Fn(usize) + Sync)) {
    match count {
        0 | 1 => (0..count).for_each(task),
        _ => (0..count).into_par_iter().for_each(task),
    }
}

/// Calls `task` with each of some tasks and its index.
pub(crate) fn for_each_task<T: Send>(tasks: impl IntoIterator<Item = T>, task: impl Fn(usize, T) + Sync) {
    let tasks: Vec<Mutex<Option<T>>> = tasks.into_iter().map(|task| Mutex::new(Some(task))).collect();
    for_each(tasks.len(), &|index| {
        let own = tasks[index].lock().unwrap_or_else(PoisonError::into_inner).take();
        own.into_iter().for_each(|own| task(index, own));
    });
}

/// Calls `task` with chunks of `length` items and their indices; the last may be shorter.
pub(crate) fn for_each_chunk<T: Send>(items: &mut [T], length: usize, task: impl Fn(usize, &mut [T]) + Sync) {
    for_each_task(items.chunks_mut(length), task);
}

/// Calls `task` with each item and its index. A thread takes at least `least` items at once.
pub(crate) fn for_each_mut<T: Send>(items: &mut [T], least: usize, task: impl Fn(usize, &mut T) + Sync) {
    let length = rows_of_a_task(items.len()).max(least);
    for_each_chunk(items, length, |chunk, items| {
        items.iter_mut().enumerate().for_each(|(row, item)| task(chunk * length + row, item));
    });
}

/// What `task` returns for each index below `count`, in order. Each is worth a lock; see [`rows`] for what is not.
pub(crate) fn map<R: Send>(count: usize, task: impl Fn(usize) -> R + Sync) -> Vec<R> {
    map_tasks(0..count, |_, index| task(index))
}

/// What `task` returns for each of some tasks and its index, in order.
pub(crate) fn map_tasks<T: Send, R: Send>(
    tasks: impl IntoIterator<Item = T>,
    task: impl Fn(usize, T) -> R + Sync,
) -> Vec<R> {
    let tasks: Vec<T> = tasks.into_iter().collect();
    let mut found: Vec<Option<R>> = tasks.iter().map(|_| None).collect();
    for_each_task(tasks.into_iter().zip(&mut found), |index, (own, found)| *found = Some(task(index, own)));
    found.into_iter().flatten().collect()
}

/// What `of_row` returns for each row below `count`, in order. A thread takes at least `least` rows.
pub(crate) fn rows<R: Send>(count: usize, least: usize, of_row: &(dyn Fn(usize) -> R + Sync)) -> Vec<R> {
    if count <= least {
        return (0..count).map(of_row).collect();
    }
    (0..count).into_par_iter().with_min_len(least).map(of_row).collect()
}

/// Appends what `of_row` returns for each row below `count`, in order. A thread takes at least `least` rows. All threads touch the new
/// memory, which takes longer than filling it.
pub(crate) fn extend_by_rows<R: Send>(
    items: &mut Vec<R>,
    count: usize,
    least: usize,
    of_row: &(dyn Fn(usize) -> R + Sync),
) {
    if count <= least {
        return items.extend((0..count).map(of_row));
    }
    items.par_extend((0..count).into_par_iter().with_min_len(least).map(of_row));
}

/// The rows below `count` in pieces, in order, as many as keep all threads busy.
pub(crate) fn pieces(count: usize) -> impl Iterator<Item = Range<usize>> {
    let length = rows_of_a_task(count);
    (0..count).step_by(length).map(move |start| start..count.min(start + length))
}

/// How many of so many rows a thread takes at once, so that all are busy until the end.
pub(crate) fn rows_of_a_task(rows: usize) -> usize {
    const TASKS_OF_A_THREAD: usize = 8;
    rows.div_ceil(TASKS_OF_A_THREAD * rayon::current_num_threads()).max(1)
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;

    #[test]
    fn every_row_is_visited_once_and_results_keep_their_order() {
        for count in [0, 1, 2, 15, 16, 17, 1_000, 20_000] {
            let visits: Vec<AtomicUsize> = (0..count).map(|_| AtomicUsize::new(0)).collect();
            for_each(count, &|index| {
                visits[index].fetch_add(1, Ordering::Relaxed);
            });
            assert!(visits.iter().all(|visits| visits.load(Ordering::Relaxed) == 1), "{count}");

            let expected: Vec<usize> = (0..count).map(|row| 3 * row + 1).collect();
            assert_eq!(map(count, |row| 3 * row + 1), expected);
            assert_eq!(map_tasks(expected.iter().copied(), |index, own| (index, own).1), expected);
            for least in [1, 100] {
                assert_eq!(rows(count, least, &|row| 3 * row + 1), expected);
                let mut extended = vec![7];
                extend_by_rows(&mut extended, count, least, &|row| 3 * row + 1);
                assert_eq!(extended.split_first(), Some((&7, &expected[..])));
            }

            for least in [1, 100] {
                let mut items = vec![0; count];
                for_each_mut(&mut items, least, |row, item| *item += 3 * row + 1);
                assert_eq!(items, expected);
            }
            let mut items = vec![0; count];
            for_each_chunk(&mut items, 10, |chunk, items| {
                items.iter_mut().enumerate().for_each(|(row, item)| *item += 3 * (10 * chunk + row) + 1);
            });
            assert_eq!(items, expected);
            let covered: Vec<usize> = pieces(count).flatten().collect();
            assert_eq!(covered, (0..count).collect::<Vec<_>>());
        }
    }
}
