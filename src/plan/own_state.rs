//! The own state of sampled torques, for some bodies, in the order in which the scene numbers it.

use std::collections::BTreeMap;

use crate::engine::controlled::Controls;
use crate::plan::TorqueSet;
use crate::torque::Torque;
use crate::torque::control::{self, OwnNumber};

/// Describes the numbers in the own state of a scene's torques.
#[derive(Clone, Debug)]
pub(crate) struct OwnStates {
    numbers: Vec<OwnNumber>,
    /// For each torque the index of its first number, if it is sampled.
    firsts: Vec<Option<usize>>,
}

impl OwnStates {
    /// The own state of a scene's torques.
    pub fn of(torques: &[Torque]) -> Self {
        let numbers = control::own_numbers(torques);
        let first = |(place, torque): (usize, &Torque)| {
            torque.is_sampled().then(|| numbers.partition_point(|number| number.torque < place))
        };
        let firsts = torques.iter().enumerate().map(first).collect();
        Self { numbers, firsts }
    }

    /// The numbers, in the order used throughout.
    pub fn numbers(&self) -> &[OwnNumber] {
        &self.numbers
    }

    /// Calls `take` with index, body and value of each number that `controls` hold at `time`, s (not before the last change), for bodies on
    /// which the torques of `set` act.
    pub fn each(&self, (set, controls): (TorqueSet, &Controls), time: f64, take: &mut dyn FnMut(usize, usize, f64)) {
        if self.numbers.is_empty() {
            return;
        }
        // The controls contain the laws of those torques that act.
        let acting = self.firsts.iter().enumerate().filter(|(torque, _)| set.contains(*torque));
        let firsts: Vec<usize> = acting.filter_map(|(_, first)| *first).collect();
        controls.own_state(time, &mut |(law, number), body, value| take(firsts[law] + number, body, value));
    }

    /// The own state of the bodies of some controls.
    pub fn of_all(&self, (set, controls): (TorqueSet, Option<&Controls>), time: f64) -> OwnOfBodies {
        let mut all = OwnOfBodies::default();
        if let Some(controls) = controls {
            self.each((set, controls), time, &mut |number, body, value| {
                all.0.entry(body).or_insert_with(|| vec![f64::NAN; self.numbers.len()])[number] = value;
            });
        }
        all
    }
}

/// The own state of some bodies, by body, in the order of the scene's numbers; NaN for torques that do not act on a body.
#[derive(Clone, Debug, Default)]
pub(crate) struct OwnOfBodies(BTreeMap<usize, Vec<f64>>);

impl OwnOfBodies {
    /// The own state of one body; empty if no sampled torque acts on it.
    pub fn of(&self, body: usize) -> &[f64] {
        self.0.get(&body).map_or(&[], Vec::as_slice)
    }

    /// Adds the own state of other bodies.
    pub fn extend(&mut self, other: Self) {
        self.0.extend(other.0);
    }
}
