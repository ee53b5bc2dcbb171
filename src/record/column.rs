//! The columns of output tables: `body`, `t`, numbers of the state or derived from it, [`STATUS`] and, in sweeps, [`CELL`].

use super::OutputState;
use crate::bodies::state_columns;
pub use crate::bodies::state_columns::{CELL, STATUS, STOPPED_AT};
pub use crate::bodies::{ROTATION_COLUMNS, TRANSLATION_COLUMNS};
use crate::scene::{Quantity, Scene};
use crate::study::{Output, OutputColumn};
use crate::torque::control;

/// The most columns of numbers of a state.
pub(crate) const MOST_COLUMNS: usize = ROTATION_COLUMNS.len() + TRANSLATION_COLUMNS.len();

/// The index in [`values`] of the column with this name.
pub(crate) fn place(name: &str) -> Option<usize> {
    state_columns::names(true).position(|column| column == name)
}

/// The numbers of a state; those of translation are zero if there is none.
fn values(state: &OutputState) -> [f64; MOST_COLUMNS] {
    let rotation = &state.rotation;
    let (q, w, l) = (rotation.orientation, rotation.angular_velocity_body, rotation.angular_momentum_world);
    let (x, v) = state.translation.unwrap_or_default();
    [q.x, q.y, q.z, q.w, w.x, w.y, w.z, l.x, l.y, l.z, rotation.kinetic_energy, x.x, x.y, x.z, v.x, v.y, v.z]
}

/// A column of numbers.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Named {
    pub name: String,
    pub unit: String,
    /// Its meaning, with its frame.
    pub meaning: String,
}

impl Named {
    /// A number of the state.
    fn state(name: &str) -> Self {
        let (unit, meaning) = state_columns::meaning(name).unwrap_or(("1", ""));
        Self { name: name.to_owned(), unit: unit.to_owned(), meaning: meaning.to_owned() }
    }
}

/// The columns of a table of states.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Layout {
    /// In their order in the table.
    pub columns: Vec<Named>,
    /// The sources of their numbers.
    sources: Vec<Source>,
    /// The derived quantities among them.
    pub quantities: Vec<Quantity>,
    /// Number of cells of the study's design, if it has one: body b lies in cell b modulo this.
    pub cells: Option<usize>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Source {
    /// The index in [`values`].
    State(usize),
    /// The index in [`Layout::quantities`], followed by the numbers of the own state of sampled torques.
    Derived(usize),
    /// [`STOPPED_AT`].
    StoppedAt,
}

impl Layout {
    /// All numbers of states.
    pub fn of_states(translates: bool) -> Self {
        let mut layout = Self::default();
        state_columns::names(translates).for_each(|name| layout.push_state(name));
        layout
    }

    /// The columns that a study asks for.
    pub fn of_output(output: &Output, scene: &Scene, cells: Option<usize>) -> Self {
        let mut layout = match &output.columns {
            None => Self { cells, ..Self::of_states(scene.ensemble().translation().is_some()) },
            Some(columns) => Self { cells, ..Self::of_chosen(columns) },
        };
        for (place, number) in control::own_numbers(scene.torques()).into_iter().enumerate() {
            let torque = &scene.torques()[number.torque];
            if control::is_accumulation(torque.declaration()) {
                continue;
            }
            let meaning = format!("own state of torque {} ({})", number.torque + 1, torque.name());
            layout.sources.push(Source::Derived(layout.quantities.len() + place));
            layout.columns.push(Named { name: number.label(), unit: number.unit, meaning });
        }
        if scene.stops() {
            layout.columns.push(Named {
                name: STOPPED_AT.to_owned(),
                unit: "s".to_owned(),
                meaning: "when an event stopped the body; NaN as long as none has".to_owned(),
            });
            layout.sources.push(Source::StoppedAt);
        }
        layout
    }

    fn of_chosen(columns: &[OutputColumn]) -> Self {
        let mut layout = Self::default();
        for column in columns {
            match column {
                OutputColumn::State(name) => layout.push_state(name),
                OutputColumn::Quantity(quantity) => {
                    let (name, unit) = (quantity.name().to_owned(), quantity.unit().to_owned());
                    layout.columns.push(Named { name, unit, meaning: "derived quantity".to_owned() });
                    layout.sources.push(Source::Derived(layout.quantities.len()));
                    layout.quantities.push(quantity.clone());
                }
            }
        }
        layout
    }

    /// Columns whose numbers are copied from a table.
    pub fn of_columns(columns: Vec<Named>, cells: Option<usize>) -> Self {
        Self { columns, cells, ..Self::default() }
    }

    fn push_state(&mut self, name: &str) {
        self.sources.extend(place(name).map(Source::State));
        self.columns.push(Named::state(name));
    }

    /// The names of the columns, in their order.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.columns.iter().map(|column| column.name.as_str())
    }
}

/// Some rows of a table of states, by column.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct StateRows {
    pub numbers: Vec<Vec<f64>>,
    pub status: Vec<u8>,
}

/// Number of rows that are transposed at once: few enough for the first-level cache.
const TURNED: usize = 64;

impl Layout {
    /// Passes the numbers of `states` to `take`, some rows of a column at a time, with the column's index; `derived` holds the values of
    /// [`Layout::quantities`], by quantity, followed by the numbers of the own state of sampled torques.
    pub fn turn(&self, states: &[OutputState], derived: &[&[f64]], mut take: impl FnMut(usize, &[f64])) {
        let mut turned = [[0.0; TURNED]; MOST_COLUMNS];
        let stops = self.sources.contains(&Source::StoppedAt);
        let mut stopped_at = [f64::NAN; TURNED];
        for (block, states) in states.chunks(TURNED).enumerate() {
            for (row, state) in states.iter().enumerate() {
                for (column, number) in turned.iter_mut().zip(values(state)) {
                    column[row] = number;
                }
            }
            if stops {
                for (time, state) in stopped_at.iter_mut().zip(states) {
                    *time = state.stopped_at.unwrap_or(f64::NAN);
                }
            }
            let rows = block * TURNED..block * TURNED + states.len();
            for (place, source) in self.sources.iter().enumerate() {
                match source {
                    Source::State(number) => take(place, &turned[*number][..states.len()]),
                    Source::Derived(number) => take(place, &derived[*number][rows.clone()]),
                    Source::StoppedAt => take(place, &stopped_at[..states.len()]),
                }
            }
        }
    }
}

impl StateRows {
    /// Replaces the contents by the rows of `states`, with `derived` values as in [`Layout::turn`].
    pub fn fill(&mut self, layout: &Layout, states: &[OutputState], derived: &[&[f64]]) {
        self.numbers.resize(layout.sources.len(), Vec::new());
        self.numbers.iter_mut().for_each(Vec::clear);
        layout.turn(states, derived, |place, numbers| self.numbers[place].extend_from_slice(numbers));
        self.status.clear();
        self.status.extend(states.iter().map(|state| state.status().number()));
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.status.len()
    }
}
