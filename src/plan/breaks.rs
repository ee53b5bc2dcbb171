//! Times at which steps must end, because a formula of the time changes fast near them.
//!
//! Steps with error estimates know a torque only where they evaluate it, and a Taylor series only at its start: a pulse of `exp(-((time - 5) /
//! 0.1)^2)` is 0 to all digits some tenths of a second before, and a step may pass it as if it were not there. So what formulas compute from
//! the time alone is looked at on a grid beforehand, and steps end where it begins and ceases to change fast. A jump is located: no step but one
//! between two neighbouring numbers contains it. Phases of sines need no such times, nor do sampled torques, whose steps end at their samples.

use crate::scene::{Scene, Stepping};
use crate::torque::time_functions::TimeFunctions;

/// Intervals of the grid over the span. A pulse much narrower than one of them is not found.
const CELLS: usize = 4096;

/// A change across one interval by more than this part of the whole range is fast: twice as fast as that of a function that changes at the
/// same rate over the whole span. So a Gaussian pulse is found if its standard deviation is less than a fourth of the span; in the slowest of
/// these a series sees it from anywhere.
const FAST: f64 = 2.0 / CELLS as f64;

/// Steps also end at these multiples of its length before a fast change: a Gaussian pulse is found from one and a half to three and a half
/// standard deviations on, and all of it must be seen.
const BEFORE: [f64; 3] = [0.5, 1.0, 2.0];

/// If most of the grid changes fast, or functions that each body has of its own do, steps end at this many equal parts of the span, or at
/// [`PARTS_OF_CHANGE`] in the shortest change of a body's own that the grid resolves, up to [`MOST_EQUAL_PARTS`]. In a part of 1.6 standard
/// deviations of a Gaussian pulse, of which 6.5 are fast, a series sees it.
const EQUAL_PARTS: usize = 64;
const PARTS_OF_CHANGE: usize = 4;
const MOST_EQUAL_PARTS: usize = 1024;

/// With more windows of fast change than this, likewise.
const MOST_WINDOWS: usize = 256;

/// The break times of a scene, s, ascending, without 0 and the end.
pub(super) fn of(scene: &Scene) -> Vec<f64> {
    let end = scene.end();
    // Steps that are given are kept as they are.
    let is_given = matches!(scene.stepping(), Stepping::Pinned { .. });
    if is_given || !(end.is_finite() && end > 0.0) || scene.ensemble().is_empty() {
        return Vec::new();
    }
    let part = |index: usize, of: usize| index as f64 / of as f64 * end;
    let grid: Vec<f64> = (0..=CELLS).map(|index| part(index, CELLS)).collect();
    let (mut fast, mut parts) = (vec![false; CELLS], 0);
    let mut jumps = Vec::new();
    let mut narrow = Vec::new();
    for functions in scene.torques().iter().flat_map(|torque| torque.time_functions(scene.ensemble())) {
        let values = functions.values(&grid);
        let marks: Vec<Vec<bool>> = values.iter().map(|values| fast_intervals(values)).collect();
        if functions.are_shared {
            let own = jumps_of(&functions, &grid, &values, &marks);
            narrow.extend(narrow_changes(&functions, &grid, &marks, &own));
            jumps.extend(own);
            for own in &marks {
                fast.iter_mut().zip(own).for_each(|(fast, own)| *fast |= own);
            }
        } else {
            parts = marks.iter().map(|fast| parts_for(fast)).fold(parts, usize::max);
        }
    }
    let windows = windows(&fast);
    let is_everywhere = 2 * fast.iter().filter(|fast| **fast).count() > CELLS || windows.len() > MOST_WINDOWS;
    let mut times: Vec<f64> = match is_everywhere {
        true => Vec::new(),
        false => {
            let edges = windows.iter().flatten().map(|&index| part(index, CELLS));
            let before = clusters(&windows).into_iter().flat_map(|[first, last]| {
                let (first, last) = (part(first, CELLS), part(last, CELLS));
                BEFORE.map(|lengths| first - lengths * (last - first))
            });
            edges.chain(before).collect()
        }
    };
    let parts = if is_everywhere { parts.max(EQUAL_PARTS) } else { parts };
    times.extend((1..parts).map(|index| part(index, parts)));
    if jumps.len() <= MOST_WINDOWS {
        times.extend(jumps.into_iter().flatten());
    }
    if narrow.len() <= MOST_NARROW {
        times.extend(narrow);
    }
    times.retain(|&time| time > 0.0 && time < end);
    times.sort_by(f64::total_cmp);
    times.dedup();
    times
}

/// The number of equal parts of the span at which steps end because a function of some bodies' own changes fast: none if it does not. A change within
/// one interval is a jump.
fn parts_for(fast: &[bool]) -> usize {
    let windows = windows(fast);
    if windows.is_empty() {
        return 0;
    }
    let resolved = clusters(&windows).into_iter().map(|[first, last]| last - first).filter(|&width| width > 1);
    let of_shortest = resolved.min().map_or(0, |width| PARTS_OF_CHANGE * CELLS / width);
    of_shortest.clamp(EQUAL_PARTS, MOST_EQUAL_PARTS)
}

/// Halvings of an interval after which a smooth function has lost most of its change across it, and after which no number lies within.
const FIRST_HALVINGS: usize = 4;
const MOST_HALVINGS: usize = 64;

/// A change within at most so many intervals of a grid is not resolved by it; it is looked at on a grid of so many intervals of its own, and again, at
/// most so many times.
const UNRESOLVED: usize = 4;
const FINER_CELLS: usize = 64;
const FINER_GRIDS: usize = 5;

/// More times than this near unresolved changes are not needed.
const MOST_NARROW: usize = 4096;

/// Times near the changes that the grid does not resolve, as a pulse that is much narrower than its intervals and shows at one time of it by its
/// tail. Jumps are located otherwise.
fn narrow_changes(functions: &TimeFunctions, grid: &[f64], marks: &[Vec<bool>], jumps: &[[f64; 2]]) -> Vec<f64> {
    let mut found = Vec::new();
    for (function, fast) in marks.iter().enumerate() {
        let windows = windows(fast);
        if windows.len() > MOST_WINDOWS {
            continue;
        }
        let mut unresolved: Vec<[f64; 2]> = Vec::new();
        let is_narrow = |window: &&[usize; 2]| window[1] - window[0] <= UNRESOLVED;
        unresolved.extend(windows.iter().filter(is_narrow).map(|window| window.map(|index| grid[index])));
        for _ in 0..FINER_GRIDS {
            unresolved.retain(|[first, last]| !jumps.iter().any(|[before, after]| before >= first && after <= last));
            let mut narrower = Vec::new();
            for [first, last] in unresolved {
                let at = |index: usize| first + (last - first) * (index as f64 / FINER_CELLS as f64);
                let times: Vec<f64> = (0..=FINER_CELLS).map(at).collect();
                let fast = changes_above(&functions.values(&times)[function], 2.0 / FINER_CELLS as f64);
                for [first, last] in clusters(&self::windows(&fast)) {
                    if last - first <= UNRESOLVED {
                        narrower.push([at(first), at(last)]);
                    }
                    let (first, last) = (at(first), at(last));
                    found.extend(
                        [first, last].into_iter().chain(BEFORE.map(|lengths| first - lengths * (last - first))),
                    );
                }
            }
            unresolved = narrower;
        }
    }
    found
}

/// The neighbouring numbers between which functions jump: where half of the change across an interval of the grid stays in one half of it, as
/// often as that is halved. Of several jumps in one interval the greatest is found.
fn jumps_of(functions: &TimeFunctions, grid: &[f64], values: &[Vec<f64>], marks: &[Vec<bool>]) -> Vec<[f64; 2]> {
    /// A function, an interval, the values at its ends, and the change across it at first.
    struct Candidate {
        function: usize,
        times: [f64; 2],
        ends: [f64; 2],
        change: f64,
    }
    let mut candidates = Vec::new();
    for (function, (values, fast)) in values.iter().zip(marks).enumerate() {
        let is_finite = |index: &usize| values[*index].is_finite() && values[index + 1].is_finite();
        candidates.extend((0..CELLS).filter(|&index| fast[index]).filter(is_finite).map(|index| {
            let (times, ends) = ([grid[index], grid[index + 1]], [values[index], values[index + 1]]);
            Candidate { function, times, ends, change: (ends[1] - ends[0]).abs() }
        }));
    }
    let mut found = Vec::new();
    for halving in 1..=MOST_HALVINGS {
        let middle = |candidate: &Candidate| 0.5 * candidate.times[0] + 0.5 * candidate.times[1];
        let middles: Vec<f64> = candidates.iter().map(middle).collect();
        let values = functions.values(&middles);
        for (index, candidate) in candidates.iter_mut().enumerate() {
            let (time, value) = (middles[index], values[candidate.function][index]);
            let changes = candidate.ends.map(|end| (end - value).abs());
            let is_later = changes[1] > changes[0];
            // A narrow pulse may be much higher within than at the ends, where its tails are.
            candidate.change = changes.into_iter().fold(candidate.change, f64::max);
            let end = usize::from(!is_later);
            (candidate.times[end], candidate.ends[end]) = (time, value);
        }
        candidates.retain(|Candidate { times, ends, change, .. }| {
            let jumps = (ends[1] - ends[0]).abs() > 0.5 * change;
            let is_located = times[0].next_up() >= times[1];
            if jumps && is_located {
                found.push(*times);
            }
            !is_located && (jumps || halving < FIRST_HALVINGS)
        });
    }
    found.sort_by(|a, b| a[0].total_cmp(&b[0]));
    found.dedup();
    found
}

/// Whether a function changes fast across each interval of the grid.
fn fast_intervals(values: &[f64]) -> Vec<bool> {
    changes_above(values, FAST)
}

/// Whether a function changes across each interval by more than a part of its range.
fn changes_above(values: &[f64], part: f64) -> Vec<bool> {
    let finite = values.iter().copied().filter(|value| value.is_finite());
    let (low, high) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
    let least = part * (high - low);
    let is_fast = |pair: &[f64]| {
        let change = (pair[1] - pair[0]).abs();
        // Also where it begins or ceases to be a number.
        change > least || (change.is_nan() && (pair[0].is_finite() || pair[1].is_finite()))
    };
    values.windows(2).map(is_fast).collect()
}

/// The first and the last grid point of each run of marked intervals.
fn windows(fast: &[bool]) -> Vec<[usize; 2]> {
    let mut windows: Vec<[usize; 2]> = Vec::new();
    for index in (0..fast.len()).filter(|&index| fast[index]) {
        match windows.last_mut() {
            Some(window) if window[1] == index => window[1] = index + 1,
            _ => windows.push([index, index + 1]),
        }
    }
    windows
}

/// Windows with gaps that are no longer than both together, as that at the top of a pulse, are one change.
fn clusters(windows: &[[usize; 2]]) -> Vec<[usize; 2]> {
    let mut clusters: Vec<[usize; 2]> = Vec::new();
    for &[first, last] in windows {
        match clusters.last_mut() {
            Some(before) if first - before[1] <= (before[1] - before[0]) + (last - first) => before[1] = last,
            _ => clusters.push([first, last]),
        }
    }
    clusters
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec3};

    use super::*;
    use crate::scene::AdaptiveSteps;
    use crate::torque::{Parameters, Torque};
    use crate::{Ensemble, Method};

    fn breaks_of(formula: &str, parameters: Parameters) -> Vec<f64> {
        let bodies = Ensemble::from_fn(3, |_| (DVec3::new(1.0, 2.0, 2.5), DQuat::IDENTITY, DVec3::X)).expect("valid");
        let torque = Torque::custom(formula, parameters).expect("a formula");
        let scene = Scene::new(bodies).until(20.0).torque(torque);
        assert!(of(&scene.clone().pinned(Method::Rk4, 0.1, None)).is_empty());
        of(&scene.adaptive(AdaptiveSteps { tolerance: 1e-9, least_step: None }, None))
    }

    #[test]
    fn steps_end_where_a_pulse_begins_and_ends() {
        let none = Parameters::new;
        for width in [0.01, 0.1, 1.0] {
            let found = breaks_of(&format!("vec(exp(-((time - 7) / {width})^2), 0, 0) * 0.1"), none());
            assert!((5..10).contains(&found.len()), "{width}: {found:?}");
            let (first, last) = (found[0], found[found.len() - 1]);
            // At the first time nothing is seen of it yet, to twelve digits.
            assert!((-((7.0 - first) / width).powi(2)).exp() < 1e-12, "{width}: {found:?}");
            assert!((1.0 * width..4.5 * width + 0.02).contains(&(last - 7.0)), "{width}: {found:?}");
        }
        // A pulse much narrower than an interval of the grid, which shows by its tail.
        let found = breaks_of("vec(exp(-((time - 7) / 2e-4)^2), 0, 0) * 0.1", none());
        assert!(found.iter().filter(|time| (*time - 7.0).abs() < 2e-3).count() >= 4, "{found:?}");
        // A jump, in one interval of the grid.
        let found = breaks_of("vec(select(time > 7.001, 1, 0), 0, 0)", none());
        let last = found.len() - 1;
        assert!(found.len() == 7 && found[last] > 7.001 && found[last] - found[0] < 0.02, "{found:?}");
        assert_eq!(found[last - 2..last], [7.001, 7.001_f64.next_up()], "no step contains the jump");
    }

    #[test]
    fn what_changes_slowly_or_by_phases_needs_no_break() {
        let none = Parameters::new;
        for slow in ["vec(sin(3 * time), 0, 0)", "vec(0.1 * time, 0, 0)", "time * angular_velocity", "vec(1, 2, 3)"] {
            assert_eq!(breaks_of(slow, none()), [0.0; 0], "{slow}");
        }
        // Everywhere, and at times of each body's own.
        assert_eq!(breaks_of("vec(sin(time * time * time), 0, 0)", none()).len(), EQUAL_PARTS - 1);
        let own = || none().number("t", vec![1.0, 2.0, 3.0]).expect("a name");
        // Pulses of 0.07 s, of which 0.5 s are fast, in 20 s.
        let found = breaks_of("vec(exp(-(time - t)^2 * 100), 0, 0)", own()).len();
        assert!((100..300).contains(&found), "{found}");
        assert_eq!(breaks_of("vec(select(time > t, 1, 0), 0, 0)", own()).len(), EQUAL_PARTS - 1);
        // The shape is shared, its height and an addend are not.
        let found = breaks_of("vec(t - 3 * t * exp(-(time - 7)^2 * 100) / inertia.xx, 0, 0)", own());
        assert!((5..10).contains(&found.len()), "{found:?}");
        assert_eq!(breaks_of("vec(time * t, time / inertia.xx, 0)", own()), [0.0; 0]);
        let shared = none().number("t", 5.0).expect("a name").number("k", vec![1.0, 2.0, 3.0]).expect("a name");
        let found = breaks_of("vec(exp(-(time - t)^2 * 100), 0, 0) * (k * angular_velocity.x)", shared);
        assert!((5..10).contains(&found.len()), "{found:?}");
    }
}
