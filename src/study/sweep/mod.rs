//! Sweeps: `[[sweep]]` names the axes, `[design]` determines which points are taken, and `{ sweep = "name" }` refers to an axis in place of
//! a number.
//!
//! Each point is a *cell*. A study has `bodies.count` bodies in every cell, and body `b` lies in cell `b` modulo the number of
//! cells: the first bodies of a study cover all of its cells, and more bodies in each cell do not change those that were there before.
//!
//! * `grid`: the cartesian product of all values, the last axis changing fastest.
//! * `latin-hypercube`: `points` cells. Each axis is cut into as many equal strata, and has one value in each of them, at a random
//!   position in the stratum, in an order of its own: a permutation keyed by seed and axis (M. D. McKay, R. J. Beckman, W. J. Conover,
//!   Technometrics 21 (1979) 239).
//! * `sobol`: the first `points` of Sobol's sequence, best a power of two (I. M. Sobol', USSR Comput. Math. Math. Phys. 7 (1967) 86;
//!   direction numbers of S. Joe, F. Y. Kuo, SIAM J. Sci. Comput. 30 (2008) 2635), scrambled by A. B. Owen's method (*Monte Carlo and
//!   Quasi-Monte Carlo Methods in Scientific Computing*, 1995, 299): every digit of every point is flipped or not by a random bit
//!   that the axis and the preceding digits select.
//!
//! A value is a function only of seed, axis and index of the point (and, for a Latin hypercube, of the number of points).

mod points;

use super::draw::Draw;
use super::reader::{Node, Table};
use super::unit::Unit;
use crate::error::{InputFault, Result};
pub(crate) use points::MOST_SOBOL_AXES;

/// The most cells of a study.
pub(crate) const MOST_CELLS: usize = 1 << 20;

/// The points of a sweep.
#[derive(Clone, Debug, PartialEq)]
pub struct Design {
    axes: Vec<Axis>,
    cells: usize,
    common_draws: bool,
}

/// A parameter that a study sweeps over.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    name: String,
    /// The value in each cell, SI units, shape `[cells]`.
    values: Vec<f64>,
    /// The unit used in the study.
    unit: Option<Unit>,
}

impl Design {
    /// Number of cells, above zero.
    pub fn cells(&self) -> usize {
        self.cells
    }

    /// The axes, in the order of the study.
    pub fn axes(&self) -> &[Axis] {
        &self.axes
    }

    /// The cell that contains a body, from 0.
    pub fn cell_of(&self, body: usize) -> usize {
        body % self.cells
    }

    /// Whether the n-th bodies of all cells have the same draws, so that they differ only by what is swept.
    pub(crate) fn has_common_draws(&self) -> bool {
        self.common_draws
    }

    pub(super) fn axis(&self, name: &str) -> Option<&Axis> {
        self.axes.iter().find(|axis| axis.name == name)
    }

    pub(super) fn names(&self) -> impl Iterator<Item = &str> {
        self.axes.iter().map(Axis::name)
    }

    /// Reads `[[sweep]]` and `[design]`, if the study has them.
    pub(super) fn read(root: &Table<'_>, draw: Draw) -> Result<Option<Self>> {
        let Some(sweep) = root.find("sweep") else {
            return match root.find("design") {
                Some(_) => root.need("sweep", "a [design] needs axes: tables [[sweep]]").map(|_| None),
                None => Ok(None),
            };
        };
        const EXPECTED: &str = "expected tables [[sweep]], each with a name and values, or from and to";
        let elements = sweep.elements().filter(|elements| !elements.is_empty());
        let mut elements = elements.ok_or_else(|| sweep.refuse(EXPECTED))?;
        let design = Settings::read(root)?;
        let mut axes: Vec<Declared> = Vec::with_capacity(elements.len());
        for (index, element) in elements.iter_mut().enumerate() {
            element.path = place(index);
            let table = element.any_table().ok_or_else(|| element.refuse(EXPECTED))?;
            let axis = Declared::read(&table, design.kind)?;
            if axes.iter().any(|before| before.name == axis.name) {
                return Err(table.need("name", EXPECTED)?.refuse("expected each name once"));
            }
            axes.push(axis);
        }
        const MOST: &str = "expected at most 1,048,576 cells in all";
        let cells = match design.points {
            Some(points) => points,
            None => axes
                .iter()
                .try_fold(1_usize, |cells, axis| cells.checked_mul(axis.size()))
                .filter(|cells| *cells <= MOST_CELLS)
                .ok_or_else(|| sweep.fault(InputFault::Syntax { reason: MOST.to_owned() }))?,
        };
        if design.kind == Kind::Sobol && axes.len() > MOST_SOBOL_AXES {
            return Err(elements[MOST_SOBOL_AXES].fault(InputFault::Syntax {
                reason: format!("expected at most {MOST_SOBOL_AXES} axes of a design by Sobol's sequence"),
            }));
        }
        let mut after = cells;
        let mut read = Vec::with_capacity(axes.len());
        for (index, axis) in axes.into_iter().enumerate() {
            let values = (0..cells).map(|cell| match design.kind {
                Kind::Grid => axis.at(cell / (after / axis.size()) % axis.size()),
                Kind::LatinHypercube => axis.at_part(points::latin_hypercube(draw, index as u16, cell, cells)),
                Kind::Sobol => axis.at_part(points::sobol(draw, index as u16, cell)),
            });
            let values = values.collect();
            if design.kind == Kind::Grid {
                after /= axis.size();
            }
            read.push(Axis { name: axis.name, values, unit: axis.unit });
        }
        Ok(Some(Self { axes: read, cells, common_draws: design.common_draws }))
    }

    /// Refuses axes that nothing in the study uses.
    pub(super) fn check_use(&self, root: &Table<'_>) -> Result<()> {
        let Some(index) = self.names().position(|name| !root.context().is_used(name)) else { return Ok(()) };
        let elements = root.find("sweep").and_then(|sweep| sweep.elements()).unwrap_or_default();
        let Some(mut element) = elements.into_iter().nth(index) else { return Ok(()) };
        element.path = place(index);
        let name = &self.axes[index].name;
        let expected = format!("nothing is swept by it: expected {{ sweep = \"{name}\" }} in the place of a number");
        match element.any_table().and_then(|table| table.find("name")) {
            Some(node) => Err(node.refuse(expected)),
            None => Err(element.refuse(expected)),
        }
    }
}

impl Axis {
    /// Its name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its value in a cell, SI units.
    ///
    /// # Panics
    ///
    /// If there is no such cell.
    pub fn value(&self, cell: usize) -> f64 {
        self.values[cell]
    }

    /// Its values in all cells, SI units.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// The SI unit of its values, if the study gives a unit.
    pub(crate) fn si_unit(&self) -> Option<String> {
        self.unit.as_ref().map(Unit::in_si)
    }

    pub(super) fn unit(&self) -> Option<&Unit> {
        self.unit.as_ref()
    }
}

/// The name of an axis of the list in messages.
fn place(index: usize) -> String {
    format!("sweep[{}]", index + 1)
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Grid,
    LatinHypercube,
    Sobol,
}

/// `[design]`.
struct Settings {
    kind: Kind,
    points: Option<usize>,
    common_draws: bool,
}

impl Settings {
    fn read(root: &Table<'_>) -> Result<Self> {
        let Some(node) = root.find("design") else {
            return Ok(Self { kind: Kind::Grid, points: None, common_draws: false });
        };
        let table = node.table("expected a table [design]", &["kind", "points", "common_draws"])?;
        let kind =
            match table.find("kind").map(|kind| kind.choice(&["grid", "latin-hypercube", "sobol"])).transpose()? {
                Some("latin-hypercube") => Kind::LatinHypercube,
                Some("sobol") => Kind::Sobol,
                _ => Kind::Grid,
            };
        const POINTS: &str = "expected the number of cells, from 1 to 1,048,576";
        let points = match (kind, table.find("points")) {
            (Kind::Grid, Some(points)) => {
                return Err(
                    points.refuse("the cells of a grid follow from its axes: leave it out, or choose another kind")
                );
            }
            (Kind::Grid, None) => None,
            _ => {
                let node = table.need("points", POINTS)?;
                let points = usize::try_from(node.whole(POINTS)?).unwrap_or(usize::MAX);
                Some(points)
                    .filter(|points| (1..=MOST_CELLS).contains(points))
                    .ok_or_else(|| node.refuse(POINTS))
                    .map(Some)?
            }
        };
        let common = table.find("common_draws").map(|node| node.boolean("expected true or false")).transpose()?;
        Ok(Self { kind, points, common_draws: common.unwrap_or(false) })
    }
}

/// An axis as declared.
struct Declared {
    name: String,
    values: Values,
    unit: Option<Unit>,
}

enum Values {
    List(Vec<f64>),
    /// Evenly spaced with both ends, or a range from which points are taken.
    Range {
        from: f64,
        to: f64,
        count: usize,
        is_logarithmic: bool,
    },
}

impl Declared {
    fn read(table: &Table<'_>, kind: Kind) -> Result<Self> {
        table.only(&["name", "values", "from", "to", "count", "scale"])?;
        const NAME: &str = "expected a name of ASCII letters, digits, _ and -";
        let node = table.need("name", NAME)?;
        let name = node.string(NAME)?;
        let is_word = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '-');
        if name.is_empty() || !name.chars().all(is_word) {
            return Err(node.refuse(NAME));
        }
        if ["cell", "bodies"].contains(&name) {
            return Err(node.refuse("expected another name: the table of cells has a column of this one"));
        }
        // Taken from the first number, once it is read.
        let mut unit: Option<Option<Unit>> = None;
        let mut number = |node: &Node<'_>| -> Result<f64> {
            const EXPECTED: &str = "expected a finite number, or one with a unit such as \"5 deg\"";
            let (value, own) = node.quantity_as_written(EXPECTED)?;
            match (unit.get_or_insert_with(|| own.clone()), own) {
                (Some(first), Some(own)) => own.check_same(first).map_err(|expected| node.refuse(expected))?,
                (None, None) => {}
                _ => return Err(node.refuse("expected numbers that all have a unit, or none")),
            }
            Ok(value)
        };
        for key in ["from", "to", "count", "scale"] {
            table.exclusive(key, "values")?;
        }
        let values = match table.find("values") {
            Some(node) => {
                const LIST: &str = "expected a list of numbers, one at least";
                let elements = node.elements().filter(|elements| !elements.is_empty());
                let elements = elements.ok_or_else(|| node.refuse(LIST))?;
                Values::List(elements.iter().map(&mut number).collect::<Result<_>>()?)
            }
            None => Self::range(table, kind, &mut number)?,
        };
        Ok(Self { name: name.to_owned(), values, unit: unit.flatten() })
    }

    fn range(table: &Table<'_>, kind: Kind, number: &mut impl FnMut(&Node<'_>) -> Result<f64>) -> Result<Values> {
        let start = table.need("from", "expected the first value, beside `to`, or a list `values`")?;
        let end = table.need("to", "expected the last value")?;
        let (from, to) = (number(&start)?, number(&end)?);
        let is_logarithmic = table.is_logarithmic()?;
        for (node, value) in [(&start, from), (&end, to)] {
            if is_logarithmic && value <= 0.0 {
                return Err(node.refuse("expected a number above zero, as the scale is logarithmic"));
            }
        }
        const COUNT: &str = "expected the number of values, both ends among them: 2 to 1,048,576";
        let count = match (kind, table.find("count")) {
            (Kind::Grid, _) => {
                let node = table.need("count", COUNT)?;
                let count = usize::try_from(node.whole(COUNT)?).unwrap_or(usize::MAX);
                Some(count).filter(|count| (2..=MOST_CELLS).contains(count)).ok_or_else(|| node.refuse(COUNT))?
            }
            (_, Some(node)) => return Err(node.refuse("the design takes points between the ends: leave it out")),
            (_, None) => 0,
        };
        Ok(Values::Range { from, to, count, is_logarithmic })
    }

    /// Number of values on a grid.
    fn size(&self) -> usize {
        match &self.values {
            Values::List(list) => list.len(),
            Values::Range { count, .. } => *count,
        }
    }

    /// The value with an index on a grid.
    fn at(&self, index: usize) -> f64 {
        match &self.values {
            Values::List(list) => list[index],
            Values::Range { from, .. } if index == 0 => *from,
            Values::Range { to, count, .. } if index + 1 == *count => *to,
            Values::Range { count, .. } => self.at_part(index as f64 / (*count - 1) as f64),
        }
    }

    /// The value at a fraction of the axis, from 0 to 1; a list is cut into equal parts.
    fn at_part(&self, part: f64) -> f64 {
        match &self.values {
            Values::List(list) => list[((part * list.len() as f64) as usize).min(list.len() - 1)],
            Values::Range { from, to, is_logarithmic: false, .. } => from + (to - from) * part,
            Values::Range { from, to, .. } if (to / from).is_normal() => from * libm::exp(libm::log(to / from) * part),
            // Ends that are further apart than numbers reach have no quotient.
            Values::Range { from, to, .. } => libm::exp(libm::log(*from) * (1.0 - part) + libm::log(*to) * part),
        }
    }
}
