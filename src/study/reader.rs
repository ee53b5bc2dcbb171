//! A TOML tree in which every node knows its line and its key, so that every refusal can name both.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::DVec3;
use toml::de::{DeTable, DeValue};

use super::context::Context;
use super::sweep::Design;
use super::unit::{Quantity, Unit};
use crate::error::{Error, Result, Text};
use crate::error::{InputError, InputFault, nearest};

/// The longest excerpt of the file in a message, characters.
const LONGEST_EXCERPT: usize = 60;

/// The key that refers to the number of an axis by name.
const SWEEP: &str = "sweep";

/// A file's text and the offsets of its lines.
pub(super) struct FileText<'a> {
    file: &'a Path,
    text: &'a str,
    /// The offset of every line break, ascending.
    breaks: Vec<usize>,
    context: Context,
}

impl<'a> FileText<'a> {
    pub(super) fn new(file: &'a Path, text: &'a str) -> Self {
        let breaks = text.match_indices('\n').map(|(offset, _)| offset).collect();
        Self { file, text, breaks, context: Context::default() }
    }

    /// Parses the text and passes its root table to `read`.
    pub(super) fn parse<T>(&self, read: impl FnOnce(Table<'_>) -> Result<T>) -> Result<T> {
        let root = DeTable::parse(self.text).map_err(|error| {
            let span = error.span().unwrap_or(0..0);
            let start = span.start;
            let mut reason = error.message().lines().collect::<Vec<_>>().join(", ");
            if reason.contains("recursion") {
                "tables and lists are nested too deeply".clone_into(&mut reason);
            }
            let found = self.excerpt(span);
            if !found.is_empty() {
                reason += &format!(" at {found}");
            }
            self.error(start, String::new(), InputFault::Syntax { reason })
        })?;
        // A missing key of the root is reported at the file's first line.
        read(Table { source: self, path: String::new(), table: root.get_ref(), start: 0 })
    }

    fn line(&self, offset: usize) -> usize {
        1 + self.breaks.partition_point(|&end| end < offset)
    }

    fn error(&self, offset: usize, key: String, fault: InputFault) -> Error {
        InputError { file: self.file.to_owned(), line: self.line(offset), key, fault }.into()
    }

    /// The text at `span`, on one line and not too long.
    fn excerpt(&self, span: Range<usize>) -> String {
        let words: Vec<&str> = self.text[span].split_whitespace().collect();
        let text = words.join(" ");
        if text.chars().count() <= LONGEST_EXCERPT {
            return text;
        }
        text.chars().take(LONGEST_EXCERPT - 3).chain("...".chars()).collect()
    }
}

/// The texts among the values of a file's text, in any table or list; none if it cannot be parsed.
pub(super) fn texts(text: &str) -> Vec<String> {
    fn collect(value: &DeValue<'_>, found: &mut Vec<String>) {
        match value {
            DeValue::String(text) => found.push(text.to_string()),
            DeValue::Array(values) => values.iter().for_each(|value| collect(value.get_ref(), found)),
            DeValue::Table(table) => table.iter().for_each(|(_, value)| collect(value.get_ref(), found)),
            _ => {}
        }
    }
    let mut found = Vec::new();
    if let Ok(root) = DeTable::parse(text) {
        root.get_ref().iter().for_each(|(_, value)| collect(value.get_ref(), &mut found));
    }
    found
}

/// The place of a key, and its value as written.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Place {
    pub(super) line: usize,
    pub(super) value: String,
}

/// A table of the tree.
#[derive(Clone)]
pub(super) struct Table<'a> {
    source: &'a FileText<'a>,
    path: String,
    table: &'a DeTable<'a>,
    start: usize,
}

/// A value of the tree.
#[derive(Clone)]
pub(super) struct Node<'a> {
    source: &'a FileText<'a>,
    /// Dotted path from the root.
    pub(super) path: String,
    value: &'a DeValue<'a>,
    span: Range<usize>,
}

impl<'a> Table<'a> {
    /// The named references of the file's values.
    pub(super) fn context(&self) -> &'a Context {
        &self.source.context
    }

    fn path_of(&self, key: &str) -> String {
        if self.path.is_empty() { key.to_owned() } else { format!("{}.{key}", self.path) }
    }

    /// The value of `key`, if there is one.
    pub(super) fn find(&self, key: &str) -> Option<Node<'a>> {
        let (_, value) = self.table.iter().find(|(name, _)| name.get_ref() == key)?;
        Some(Node { source: self.source, path: self.path_of(key), value: value.get_ref(), span: value.span() })
    }

    /// All keys with their values, in the order of the file.
    pub(super) fn nodes(&self) -> Vec<(String, Node<'a>)> {
        let mut keys: Vec<_> = self.table.keys().map(|key| (key.span().start, key.get_ref().to_string())).collect();
        keys.sort();
        keys.into_iter().filter_map(|(_, key)| self.find(&key).map(|node| (key, node))).collect()
    }

    /// Whether the key `scale` says so; `log` is short for `logarithmic`.
    pub(super) fn is_logarithmic(&self) -> Result<bool> {
        let scale = self.find("scale").map(|node| node.choice(&["linear", "logarithmic", "log"])).transpose()?;
        Ok(scale.is_some_and(|scale| scale != "linear"))
    }

    /// The value of `key`, which is required.
    pub(super) fn need(&self, key: &str, expected: impl Into<Text>) -> Result<Node<'a>> {
        let missing =
            || self.source.error(self.start, self.path_of(key), InputFault::Missing { expected: expected.into() });
        self.find(key).ok_or_else(missing)
    }

    /// Refuses keys that are not among `known`; the first in the file is reported.
    pub(super) fn only(&self, known: &[&str]) -> Result<()> {
        let unknown = self.table.keys().filter(|key| !known.contains(&key.get_ref().as_ref()));
        match unknown.min_by_key(|key| key.span().start) {
            None => Ok(()),
            Some(key) => {
                let fault = InputFault::unknown(key.get_ref(), known);
                Err(self.source.error(key.span().start, self.path_of(key.get_ref()), fault))
            }
        }
    }

    /// Refuses two keys that are given together.
    pub(super) fn exclusive(&self, key: &str, other: &str) -> Result<()> {
        match (self.find(key), self.find(other)) {
            (Some(node), Some(_)) => Err(node.fault(InputFault::Conflict { other: other.to_owned() })),
            _ => Ok(()),
        }
    }

    /// Collects the place of every key below, by its dotted path.
    pub(super) fn places(&self, places: &mut BTreeMap<String, Place>) {
        for (key, value) in self.table {
            let path = self.path_of(key.get_ref());
            let line = self.source.line(key.span().start);
            places.insert(path.clone(), Place { line, value: self.source.excerpt(value.span()) });
            match value.get_ref() {
                DeValue::Table(table) => {
                    Table { source: self.source, path, table, start: key.span().start }.places(places);
                }
                // Tables of a list are counted from 1: `torque[1].coefficient`.
                DeValue::Array(array) => {
                    for (index, element) in array.iter().enumerate() {
                        let DeValue::Table(table) = element.get_ref() else { continue };
                        let path = format!("{path}[{}]", index + 1);
                        let (start, line) = (element.span().start, self.source.line(element.span().start));
                        places.insert(path.clone(), Place { line, value: String::new() });
                        Table { source: self.source, path, table, start }.places(places);
                    }
                }
                _ => {}
            }
        }
    }
}

/// Whether a line ends in the backslash of a basic string.
fn is_joined(line: &str) -> bool {
    line.trim_end_matches('\r').ends_with('\\')
}

impl<'a> Node<'a> {
    /// Its line, from 1.
    pub(super) fn line(&self) -> usize {
        self.source.line(self.span.start)
    }

    /// The error `fault` at this value.
    pub(super) fn fault(&self, fault: InputFault) -> Error {
        self.source.error(self.span.start, self.path.clone(), fault)
    }

    /// The error at a line and column, both from 1, of a text value; `fault` is given the column in the file.
    pub(super) fn fault_in_text(&self, line: usize, column: usize, fault: impl FnOnce(usize) -> InputFault) -> Error {
        let (text, start) = (self.source.text, self.span.start);
        let raw = &text[self.span.clone()];
        let quotes = if raw.starts_with("\"\"\"") || raw.starts_with("'''") { 3 } else { 1 };
        // A line break right after three quotes is not part of the text.
        let skipped = usize::from(quotes == 3 && raw[3..].trim_start_matches('\r').starts_with('\n'));
        if line + skipped < 2 {
            let before = text[..start].rfind('\n').map_or(0, |end| end + 1);
            let place = text[before..start].chars().count() + quotes + column;
            return self.source.error(start, self.path.clone(), fault(place));
        }
        // A backslash at the end of a line joins it with the next, which the text does not show.
        let mut ends = raw.match_indices('\n').map(|(at, _)| at).filter(|&at| !is_joined(&raw[..at]));
        let offset = ends.nth(line + skipped - 2).map_or(0, |at| at + 1);
        self.source.error(start + offset, self.path.clone(), fault(column))
    }

    /// The error for a value that is not `expected`.
    pub(super) fn refuse(&self, expected: impl Into<Text>) -> Error {
        self.fault(InputFault::Value { value: self.text(), expected: expected.into() })
    }

    /// The value as written in the file.
    pub(super) fn text(&self) -> String {
        self.source.excerpt(self.span.clone())
    }

    /// The path of a file named relative to this one.
    pub(super) fn beside(&self, name: &str) -> PathBuf {
        self.source.file.parent().unwrap_or(Path::new("")).join(name)
    }

    /// The table, if the value is one with only `known` keys; otherwise an error.
    pub(super) fn table(&self, expected: impl Into<Text>, known: &[&str]) -> Result<Table<'a>> {
        let table = self.any_table().ok_or_else(|| self.refuse(expected))?;
        table.only(known)?;
        Ok(table)
    }

    /// The table, if the value is one.
    pub(super) fn any_table(&self) -> Option<Table<'a>> {
        match self.value {
            DeValue::Table(table) => {
                Some(Table { source: self.source, path: self.path.clone(), table, start: self.span.start })
            }
            _ => None,
        }
    }

    /// The elements, if the value is an array.
    pub(super) fn elements(&self) -> Option<Vec<Node<'a>>> {
        match self.value {
            DeValue::Array(array) => Some(
                array
                    .iter()
                    .map(|value| Node {
                        source: self.source,
                        path: self.path.clone(),
                        value: value.get_ref(),
                        span: value.span(),
                    })
                    .collect(),
            ),
            _ => None,
        }
    }

    /// The number, if the value is one, integer or not.
    pub(super) fn any_number(&self) -> Option<f64> {
        match self.value {
            DeValue::Float(float) => float.as_str().parse().ok(),
            DeValue::Integer(integer) => i128::from_str_radix(integer.as_str(), integer.radix()).ok().map(|n| n as f64),
            _ => None,
        }
    }

    /// A finite number above zero that has no unit.
    pub(super) fn positive(&self, expected: &'static str) -> Result<f64> {
        self.any_number().filter(|x| x.is_finite() && *x > 0.0).ok_or_else(|| self.refuse(expected))
    }

    /// A finite number in SI units, with its unit if it is a text that has one.
    pub(super) fn quantity_as_written(&self, expected: impl Into<Text>) -> Result<(f64, Option<Unit>)> {
        let (value, unit) = match self.value {
            DeValue::String(text) => match Quantity::parse(text) {
                None => return Err(self.refuse(expected)),
                Some(quantity) => {
                    let Quantity { value, unit } = quantity.map_err(|fault| self.refuse(fault.expected()))?;
                    (Some(value), Some(unit))
                }
            },
            _ => (self.any_number(), None),
        };
        match value.filter(|x| x.is_finite()) {
            Some(value) => Ok((value, unit)),
            None => Err(self.refuse(expected)),
        }
    }

    /// A finite number in `unit`, an SI unit: as written, converted from its own unit, or the value of an axis in the cell that is being
    /// read.
    pub(super) fn quantity(&self, unit: &str, expected: impl Into<Text>) -> Result<f64> {
        Ok(self.quantity_of(unit, expected)?.0)
    }

    /// The same in a unit that need not be of SI.
    pub(super) fn quantity_in(&self, unit: &str, expected: impl Into<Text>) -> Result<f64> {
        let (value, has_unit) = self.quantity_of(unit, expected)?;
        let one = Quantity::parse(&format!("1 {unit}")).filter(|_| has_unit).and_then(Result::ok);
        Ok(value / one.map_or(1.0, |one| one.value))
    }

    /// A finite number with a unit, converted to SI, or as written, and which of these.
    fn quantity_of(&self, unit: &str, expected: impl Into<Text>) -> Result<(f64, bool)> {
        let (value, own) = match self.axis() {
            Some(name) => self.swept(&name)?,
            None => self.quantity_as_written(expected)?,
        };
        match own.as_ref().map_or(Ok(()), |own| own.check(unit)) {
            Ok(()) => Ok((value, own.is_some())),
            Err(expected) => Err(self.refuse(expected)),
        }
    }

    /// A finite number above zero in `unit`.
    pub(super) fn positive_quantity(&self, unit: &str, expected: impl Into<Text>) -> Result<f64> {
        let expected = expected.into();
        self.quantity(unit, expected.clone()).and_then(|x| if x > 0.0 { Ok(x) } else { Err(self.refuse(expected)) })
    }

    /// A finite number in percent: as written, or before the unit `%`, so that "50 %" is 50.
    pub(super) fn percent(&self, expected: &'static str) -> Result<f64> {
        let number = match self.value {
            DeValue::String(text) => text.trim_end().strip_suffix('%'),
            _ => return self.quantity("1", expected),
        };
        let quantity = number.and_then(|number| Quantity::parse(&format!("{number} 1"))?.ok());
        let plain = quantity.filter(|quantity| quantity.unit.check("1").is_ok() && quantity.value.is_finite());
        plain.map(|quantity| quantity.value).ok_or_else(|| self.refuse(expected))
    }

    /// The name of a sweep's axis, if the value is `{ sweep = "name" }`.
    fn axis(&self) -> Option<Node<'a>> {
        self.any_table()?.find(SWEEP)
    }

    /// All values of an axis without a unit, if the value is `{ sweep = "name" }`.
    pub(super) fn swept_without_unit(&self) -> Option<&'a [f64]> {
        let name = self.axis()?.string("").ok()?;
        let axis = self.source.context.design()?.axis(name)?;
        axis.unit().is_none().then(|| axis.values())
    }

    /// The value of an axis.
    fn swept(&self, name: &Node<'_>) -> Result<(f64, Option<Unit>)> {
        self.table("expected { sweep = \"name\" }", &[SWEEP])?;
        let wanted = name.string("expected the name of a [[sweep]]")?;
        let context = &self.source.context;
        let axis = context.design().and_then(|design| design.axis(wanted)).ok_or_else(|| {
            let known: Vec<&str> = context.design().into_iter().flat_map(Design::names).collect();
            match known.is_empty() {
                true => name.refuse("the study has no [[sweep]] of this name, and no other"),
                false => name.refuse(unknown_name(wanted, &known, "a [[sweep]]")),
            }
        })?;
        let cell = context.cell().ok_or_else(|| {
            self.refuse("expected a number: all bodies share this one, so it cannot be swept within a run")
        })?;
        context.note_use(wanted);
        Ok((axis.value(cell), axis.unit().cloned()))
    }

    /// Whether the value contains a swept number at any depth.
    fn mentions_sweep(&self) -> bool {
        fn mentions(value: &DeValue<'_>) -> bool {
            match value {
                DeValue::Table(table) => {
                    table.iter().any(|(key, value)| key.get_ref() == SWEEP || mentions(value.get_ref()))
                }
                DeValue::Array(array) => array.iter().any(|value| mentions(value.get_ref())),
                _ => false,
            }
        }
        mentions(self.value)
    }

    /// The result of `read` in each cell, if any number in the value is swept.
    pub(super) fn per_cell<T>(&self, read: impl Fn(&Self) -> Result<T>) -> Result<Option<Arc<[T]>>> {
        let context = &self.source.context;
        if context.cell().is_some() || !self.mentions_sweep() {
            return Ok(None);
        }
        // Without a design the first read reports the error.
        let cells = context.design().map_or(1, Design::cells);
        (0..cells).map(|cell| context.for_cell(cell, || read(self))).collect::<Result<_>>().map(Some)
    }

    /// The named references of the file's values.
    pub(super) fn context(&self) -> &'a Context {
        &self.source.context
    }

    /// Whether the value is a number, begins with one, or refers to an axis.
    pub(super) fn is_number(&self) -> bool {
        let begins_with_one = || matches!(self.value, DeValue::String(text) if Quantity::parse(text).is_some());
        self.any_number().is_some() || begins_with_one() || self.axis().is_some()
    }

    /// Whether the value is a text.
    pub(super) fn is_text(&self) -> bool {
        matches!(self.value, DeValue::String(_))
    }

    /// A whole number, not negative.
    pub(super) fn whole(&self, expected: impl Into<Text>) -> Result<u64> {
        match self.value {
            DeValue::Integer(integer) => u64::from_str_radix(integer.as_str(), integer.radix()).ok(),
            _ => None,
        }
        .ok_or_else(|| self.refuse(expected))
    }

    /// `true` or `false`.
    pub(super) fn boolean(&self, expected: &'static str) -> Result<bool> {
        match self.value {
            DeValue::Boolean(value) => Ok(*value),
            _ => Err(self.refuse(expected)),
        }
    }

    /// A string.
    pub(super) fn string(&self, expected: &'static str) -> Result<&'a str> {
        match self.value {
            DeValue::String(text) => Ok(text.as_ref()),
            _ => Err(self.refuse(expected)),
        }
    }

    /// One of a few words.
    pub(super) fn choice(&self, choices: &'static [&'static str]) -> Result<&'static str> {
        let found = match self.value {
            DeValue::String(text) => text.as_ref(),
            _ => "",
        };
        choices.iter().copied().find(|choice| *choice == found).ok_or_else(|| {
            self.fault(InputFault::Choice { value: self.text(), nearest: nearest(found, choices), choices })
        })
    }

    /// `N` finite numbers in `unit`.
    pub(super) fn quantities<const N: usize>(&self, unit: &str, expected: impl Into<Text>) -> Result<[f64; N]> {
        let expected = expected.into();
        let elements = self.elements().ok_or_else(|| self.refuse(expected.clone()))?;
        let number = |element: &Node<'_>| element.quantity(unit, expected.clone());
        let numbers: Vec<f64> = elements.iter().map(number).collect::<Result<_>>()?;
        numbers.try_into().map_err(|_| self.refuse(expected))
    }

    /// Three finite numbers in `unit`.
    pub(super) fn vector(&self, unit: &str, expected: impl Into<Text>) -> Result<DVec3> {
        self.quantities(unit, expected).map(DVec3::from_array)
    }
}

/// The text about a name that is not among the known ones.
pub(super) fn unknown_name(name: &str, known: &[&str], what: &str) -> String {
    let guess = nearest(name, known).map(|name| format!("did you mean {name}? ")).unwrap_or_default();
    format!("expected the name of {what}: {guess}known: {}", known.join(", "))
}
