//! What a study asks for beside states: `[[quantity]]`, `[output] statistics`, `quantiles` and `by_cell`, `[[histogram]]`, `[[event]]`.

use std::path::Path;

use glam::DVec3;

use super::custom::{form, formula_at, orbit_of_study, reads_orbit};
use super::euler::{ABOUT, EULER, sequence};
use super::reader::{FileText, Node, Table};
use super::torque::StudyTorque;
use super::unit::ANY;
use super::{TorquesOfStudy, accumulated, output, torque, torques};
use crate::bodies::{Ensemble, state_columns};
use crate::error::{Error, Result, nearest};
use crate::expression::orbit::{OrbitElements, OrbitSymbols};
use crate::scene::{Condition, Event, Histogram, MOST_CELLS, Observed, Quantity, Scene};
use crate::torque::control::{ANY_SI, OwnPart};

/// What a study asks for.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct StudyObserved {
    /// Quantities that only this study has: the own state of its torques, and the quantities that it defines.
    own: Vec<Quantity>,
    statistics: Vec<Quantity>,
    quantiles: Vec<f64>,
    histograms: Vec<Histogram>,
    events: Vec<Event>,
    cells: Option<usize>,
}

impl StudyObserved {
    /// Reads the root of a study with these torques and its table `[output]`; its design has so many cells, if it has one.
    pub fn read(
        root: &Table<'_>,
        output: Option<&Table<'_>>,
        torques: &[StudyTorque],
        cells: Option<usize>,
    ) -> Result<Self> {
        let own_state = &torque::own_parts(torques);
        let energies = torque::with_potential(torques).map(Quantity::of_potential);
        // Laws by which quantities add up come after the torques; what they keep is no quantity.
        let laws = torques.iter().filter(|torque| torque.is_accumulation()).count();
        let of_torques = torque::own_parts(&torques[..torques.len() - laws]);
        let own_state_numbers = of_torques.iter().flat_map(OwnPart::numbers).map(Quantity::of_own);
        let mut own: Vec<Quantity> = own_state_numbers.chain(energies).collect();
        for (place, table) in tables(root, "quantity")?.into_iter().enumerate() {
            let law = torques.iter().position(|torque| torque.path() == accumulated::path(place));
            let (quantity, name) = quantity(&table, own_state, law)?;
            if find(&own, quantity.name()).is_some() {
                return Err(name.refuse("expected a name that no other quantity has"));
            }
            if is_column(quantity.name()) {
                return Err(name.refuse("expected another name: tables of states have a column of this one"));
            }
            own.push(quantity);
        }
        let mut found = Self::default();
        let find_output = |key: &str| output.and_then(|table| table.find(key));
        if let Some(node) = find_output("statistics") {
            found.statistics = statistics(&node, &own)?;
        }
        if let Some(node) = find_output("quantiles") {
            if found.statistics.is_empty() {
                return Err(node.refuse("expected output.statistics too: the quantiles are those of its quantities"));
            }
            found.quantiles = quantiles(&node)?;
        }
        for table in tables(root, "histogram")? {
            found.histograms.push(histogram(&table, &own)?);
        }
        for table in tables(root, "event")? {
            let (event, name) = event(&table, &own)?;
            if found.events.iter().any(|other| other.name() == event.name()) {
                return Err(name.refuse("expected a name that no other event has"));
            }
            found.events.push(event);
        }
        let has_distributions = !(found.statistics.is_empty() && found.histograms.is_empty());
        let fits = |cells: &usize| *cells <= MOST_CELLS;
        found.cells = match find_output("by_cell") {
            None => cells.filter(|cells| has_distributions && fits(cells)),
            Some(node) if node.boolean("expected true or false")? => {
                if !has_distributions {
                    return Err(
                        node.refuse("expected output.statistics or a [[histogram]] too: they are formed by cell")
                    );
                }
                let cells =
                    cells.ok_or_else(|| node.refuse("expected axes too: tables [[sweep]], which make cells"))?;
                if !fits(&cells) {
                    return Err(node.refuse(format!("expected at most {MOST_CELLS} cells, not {cells}")));
                }
                Some(cells)
            }
            Some(_) => None,
        };
        found.own = own;
        Ok(found)
    }

    /// The quantity of a name: one that only this study has, or one without parameters.
    pub fn quantity(&self, name: &str) -> Option<&Quantity> {
        find(&self.own, name)
    }

    /// The names of all quantities.
    pub fn quantity_names(&self) -> impl Iterator<Item = &str> {
        self.own.iter().chain(Quantity::NAMED).map(Quantity::name)
    }

    /// Whether nothing is asked for.
    pub fn is_empty(&self) -> bool {
        self.statistics.is_empty() && self.histograms.is_empty() && self.events.is_empty()
    }

    /// Whether statistics and histograms are formed by cell; `None` if there are none.
    pub fn forms_by_cell(&self) -> Option<bool> {
        let has_distributions = !(self.statistics.is_empty() && self.histograms.is_empty());
        has_distributions.then_some(self.cells.is_some())
    }

    /// Whether there are events.
    pub fn has_events(&self) -> bool {
        !self.events.is_empty()
    }

    /// The scene with what is asked for.
    pub fn applied_to(&self, scene: Scene) -> Result<Scene> {
        let scene = scene.statistics(&self.statistics).quantiles(&self.quantiles)?;
        let scene = match self.cells {
            Some(cells) => scene.by_cell(cells)?,
            None => scene,
        };
        let scene = self.histograms.iter().cloned().fold(scene, Scene::histogram);
        Ok(self.events.iter().cloned().fold(scene, Scene::event))
    }
}

/// What the text of a study asks for, without reading further files; `file` is its name in messages.
pub(crate) fn observed_in(file: &Path, text: &str) -> Result<Observed> {
    FileText::new(file, text).parse(|root| {
        let output = root.find("output").map(|node| output::table(&node)).transpose()?;
        let TorquesOfStudy { design, torques, .. } = torques(&root)?;
        let cells = design.map(|design| design.cells());
        let nobody = Scene::new(Ensemble::from_columns::<DVec3>(&[], &[], &[])?);
        Ok(StudyObserved::read(&root, output.as_ref(), &torques, cells)?.applied_to(nobody)?.observed().clone())
    })
}

/// The tables of a list.
pub(super) fn tables<'a>(root: &Table<'a>, key: &str) -> Result<Vec<Table<'a>>> {
    let Some(node) = root.find(key) else { return Ok(Vec::new()) };
    let expected = format!("expected a list of tables: [[{key}]]");
    let elements = node.elements().ok_or_else(|| node.refuse(expected.clone()))?;
    let table = |(index, mut element): (usize, Node<'a>)| {
        element.path = format!("{key}[{}]", index + 1);
        element.any_table().ok_or_else(|| element.refuse(expected.clone()))
    };
    elements.into_iter().enumerate().map(table).collect()
}

/// The quantity of a name: one that only this study has, or one without parameters.
fn find<'q>(own: &'q [Quantity], name: &str) -> Option<&'q Quantity> {
    own.iter().chain(Quantity::NAMED).find(|quantity| quantity.name() == name)
}

fn named(node: &Node<'_>, own: &[Quantity]) -> Result<Quantity> {
    let name = node.string("expected the name of a quantity")?;
    find(own, name).cloned().ok_or_else(|| {
        let known: Vec<&str> = own.iter().chain(Quantity::NAMED).map(Quantity::name).collect();
        let suggestion = nearest(name, &known).map(|near| format!("did you mean {near}? ")).unwrap_or_default();
        node.refuse(format!("{suggestion}expected a quantity: {}", known.join(", ")))
    })
}

/// A name that is valid in formulas: it becomes part of column names.
fn identifier<'a>(node: &Node<'a>) -> Result<&'a str> {
    const EXPECTED: &str = "expected a name of ASCII letters, digits and underscores that begins with a letter";
    let name = node.string(EXPECTED)?;
    let begins = name.starts_with(|first: char| first.is_ascii_alphabetic());
    let is_name = begins && name.chars().all(|letter| letter.is_ascii_alphanumeric() || letter == '_');
    if is_name { Ok(name) } else { Err(node.refuse(EXPECTED)) }
}

/// Whether tables of states have a column of this name; those of translation count in every study, so that a force may be added to it.
fn is_column(name: &str) -> bool {
    let others = ["body", "t", state_columns::STATUS, state_columns::CELL, state_columns::STOPPED_AT];
    others.contains(&name) || state_columns::names(true).any(|column| column == name)
}

/// A quantity of the study's own, and the node of its name; `law` is the index of the law by which it adds up, if it
/// does and is asked for.
fn quantity<'a>(table: &Table<'a>, own_state: &[OwnPart], law: Option<usize>) -> Result<(Quantity, Node<'a>)> {
    let name_node = table.need("name", "expected the name by which statistics, histograms and events ask for it")?;
    let name = identifier(&name_node)?;
    let adding_up = accumulated::KINDS.map(|(key, _)| key);
    let kinds: Vec<&str> = ["formula", "axis", EULER].into_iter().chain(adding_up).collect();
    for (place, kind) in kinds.iter().enumerate() {
        kinds[place + 1..].iter().try_for_each(|other| table.exclusive(kind, other))?;
    }
    let of_sum = accumulated::kind(table).map(|(accumulation, node)| (node, Some(accumulation)));
    if let Some((node, accumulation)) = of_sum.or_else(|| Some((table.find("formula")?, None))) {
        match accumulation {
            Some(_) => table.only(&["name", "every", "unit"].iter().chain(&adding_up).copied().collect::<Vec<_>>())?,
            None => table.only(&["name", "formula", "unit"])?,
        }
        let unit = table.find("unit").map(|node| node.string("expected the unit, as text")).transpose()?;
        let text = node.string("expected a formula, as text")?;
        let orbit = if reads_orbit(text) { Some(shared_orbit(&node)?) } else { None };
        let formula = |text: &str| {
            let quantity = Quantity::formula_with((own_state, orbit), name, unit.unwrap_or("1"), text);
            quantity.map_err(|error| formula_at(&node, &error))
        };
        // A formula that adds up is refused as the user wrote it.
        let own = formula(text)?;
        let quantity = match accumulation {
            Some(accumulation) => {
                let every = accumulated::every(table)?;
                law.map_or(Ok(own), |law| formula(&accumulation.completed(text, every, law)))?
            }
            None => own,
        };
        return Ok((quantity, name_node));
    }
    if let Some(axis) = table.find("axis") {
        table.only(&["name", "axis", "direction"])?;
        const DIRECTION: &str = "expected a direction in world axes [x, y, z], or one of the orbit, such as \"nadir\"";
        let direction = table.need("direction", DIRECTION)?;
        let axis_body = axis.vector("1", "expected an axis of the body [x, y, z]")?;
        let of_orbit = if direction.is_text() { Some(direction.choice(&DIRECTIONS_OF_ORBIT)?) } else { None };
        let direction_world = match of_orbit {
            // Any direction, for the check of the axis.
            Some(_) => DVec3::X,
            None => direction.vector("1", DIRECTION)?,
        };
        let refused = |error: Error| match error {
            Error::Setting { field: "direction", expected, .. } => direction.refuse(expected),
            Error::Setting { expected, .. } => axis.refuse(expected),
            other => other,
        };
        let quantity = Quantity::axis_angle(name, axis_body, direction_world).map_err(refused)?;
        let Some(of_orbit) = of_orbit else { return Ok((quantity, name_node)) };
        const ORBIT: &str = "a direction of the orbit asks for a table [orbit] with mu and radius";
        if direction.context().orbit().is_none() {
            return Err(direction.refuse(ORBIT));
        }
        let text = angle_to_orbit(axis_body, of_orbit);
        let quantity = Quantity::formula_with((&[], Some(shared_orbit(&direction)?)), name, "rad", &text);
        return Ok((quantity.map_err(|error| formula_at(&direction, &error))?, name_node));
    }
    const KINDS: &str = "expected how it is formed: `formula`, `axis` with `direction`, `euler` with `angle`, or `integral` or `sign_changes` with `every`";
    let Some(node) = table.find(EULER) else {
        return Err(table.need("formula", KINDS).map_or_else(|error| error, |node| node.refuse(KINDS)));
    };
    table.only(&["name", EULER, ABOUT, "angle"])?;
    let sequence = sequence(table, &node)?;
    let angle = table.need("angle", "expected which of the three angles it is: 1, 2 or 3")?;
    let index = match angle.whole("expected 1, 2 or 3")? {
        index @ 1..=3 => index as usize - 1,
        _ => return Err(angle.refuse("expected 1, 2 or 3")),
    };
    Ok((Quantity::EulerAngle { name: name.into(), sequence, index }, name_node))
}

/// The directions of the study's orbit.
const DIRECTIONS_OF_ORBIT: [&str; 4] = ["nadir", "zenith", "velocity", "orbit-normal"];

/// The formula of the angle, rad, between an axis of the body and a direction of the orbit.
fn angle_to_orbit(axis_body: DVec3, direction: &str) -> String {
    let direction = match direction {
        "nadir" => "-orbit_position",
        "zenith" => "orbit_position",
        "velocity" => "orbit_velocity",
        _ => "cross(orbit_position, orbit_velocity)",
    };
    let [x, y, z] = (axis_body / axis_body.abs().max_element()).to_array();
    format!(
        "let a = to_world(vec({x:?}, {y:?}, {z:?})); let d = normalize({direction}); atan2(norm(cross(a, d)), dot(a, d))"
    )
}

/// The study's orbit for a formula of a quantity: one for all bodies.
fn shared_orbit(node: &Node<'_>) -> Result<OrbitSymbols> {
    const SHARED: &str = "a quantity knows only an orbit that all bodies share: expected numbers in [orbit], no distributions or columns";
    let orbit = orbit_of_study(node)?;
    let elements: Option<Vec<f64>> = orbit.iter().map(|(_, element)| element.constant()).collect();
    let elements = elements.and_then(|elements| elements.try_into().ok()).ok_or_else(|| node.refuse(SHARED))?;
    let (is_eccentric, drifts) = form(orbit);
    Ok(OrbitSymbols { elements: OrbitElements::Constants(elements), is_eccentric, drifts })
}

/// The unit of a level or an edge: any, for the own state of a user's law.
fn unit_of(quantity: &Quantity) -> &str {
    if quantity.unit() == ANY_SI { ANY } else { quantity.unit() }
}

fn statistics(node: &Node<'_>, own: &[Quantity]) -> Result<Vec<Quantity>> {
    const LIST: &str = "expected a list of quantities, such as [\"kinetic_energy\", \"spin_rate\"]";
    let elements = node.elements().ok_or_else(|| node.refuse(LIST))?;
    let mut found = Vec::with_capacity(elements.len());
    for element in elements {
        let quantity = named(&element, own)?;
        if found.contains(&quantity) {
            return Err(element.refuse("expected each quantity once"));
        }
        found.push(quantity);
    }
    Ok(found)
}

fn quantiles(node: &Node<'_>) -> Result<Vec<f64>> {
    const LIST: &str = "expected a list of percentages from 0 to 100, such as [5, 50, 95]";
    let elements = node.elements().ok_or_else(|| node.refuse(LIST))?;
    let percent = |element: &Node<'_>| {
        let percent = element.percent(LIST)?;
        if (0.0..=100.0).contains(&percent) { Ok(percent) } else { Err(element.refuse(LIST)) }
    };
    elements.iter().map(percent).collect()
}

fn histogram(table: &Table<'_>, own: &[Quantity]) -> Result<Histogram> {
    table.only(&["quantity", "low", "high", "bins", "scale"])?;
    let quantity = named(&table.need("quantity", "expected the name of a quantity")?, own)?;
    let low = table.need("low", "expected the first edge, in the quantity's unit")?;
    let high = table.need("high", "expected the last edge, in the quantity's unit")?;
    let bins = table.find("bins");
    let count = bins.as_ref().map(|node| node.whole("expected a number of bins")).transpose()?.unwrap_or(50);
    let count = usize::try_from(count).unwrap_or(usize::MAX);
    let edge =
        |node: &Node<'_>| node.quantity_in(unit_of(&quantity), "expected a finite number, in the quantity's unit");
    let (first, last) = (edge(&low)?, edge(&high)?);
    let is_logarithmic = table.is_logarithmic()?;
    let made = match is_logarithmic {
        true => Histogram::logarithmic(quantity, first, last, count),
        false => Histogram::linear(quantity, first, last, count),
    };
    made.map_err(|error| match error {
        Error::Setting { field: "low", expected, .. } => low.refuse(expected),
        Error::Setting { field: "bins", expected, .. } => bins.as_ref().unwrap_or(&high).refuse(expected),
        Error::Setting { expected, .. } => high.refuse(expected),
        other => other,
    })
}

/// An event, and the node of its name.
fn event<'a>(table: &Table<'a>, own: &[Quantity]) -> Result<(Event, Node<'a>)> {
    let conditions: Vec<&str> = Condition::ALL.iter().map(|condition| condition.name()).collect();
    let keys: Vec<&str> =
        ["name", "quantity", "occurrence", "action"].into_iter().chain(conditions.iter().copied()).collect();
    table.only(&keys)?;
    let name_node = table.need("name", "expected the event's name in events and survival")?;
    let name = name_node.string("expected a text")?;
    if name.is_empty() || name.contains(char::is_control) {
        return Err(name_node.refuse("expected a text on one line that is not empty"));
    }
    let quantity = named(&table.need("quantity", "expected the name of a quantity")?, own)?;
    for (place, condition) in conditions.iter().enumerate() {
        conditions[place + 1..].iter().try_for_each(|other| table.exclusive(condition, other))?;
    }
    let found = Condition::ALL.iter().find(|condition| table.find(condition.name()).is_some());
    let condition = found.unwrap_or(&Condition::ALL[0]);
    let level = table.need(condition.name(), format!("expected one of {}, with a level", conditions.join(", ")))?;
    let expected = "expected a finite level, in the quantity's unit";
    let condition = condition.with_level(level.quantity_in(unit_of(&quantity), expected)?);
    let mut event = Event::new(name, quantity, condition)?;
    if let Some(action) = table.find("action")
        && action.choice(&Event::ACTIONS)? == "stop"
    {
        event = event.stopping();
    }
    let Some(node) = table.find("occurrence") else { return Ok((event, name_node)) };
    const NTH: &str = "expected 1 for the first time, 2 for the second, and so on";
    let nth = node.whole(NTH)?;
    let nth = u32::try_from(nth).ok().filter(|&nth| nth > 0).ok_or_else(|| node.refuse(NTH))?;
    Ok((event.occurrence(nth)?, name_node))
}
