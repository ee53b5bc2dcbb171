//! Times in the unit that suits how long a run lasts.

use super::figure::{Axis, Item, Panel};

/// Units with their length, s, and the shortest run that is drawn in them, s.
const UNITS: [(&str, f64, f64); 9] = [
    ("ps", 1e-12, 0.0),
    ("ns", 1e-9, 1e-9),
    ("\u{b5}s", 1e-6, 1e-6),
    ("ms", 1e-3, 1e-3),
    ("s", 1.0, 1.0),
    ("min", 60.0, 600.0),
    ("h", 3600.0, 3.0 * 3600.0),
    ("d", 86_400.0, 3.0 * 86_400.0),
    ("yr", 365.25 * 86_400.0, 3.0 * 365.25 * 86_400.0),
];

/// A unit of time.
#[derive(Clone, Copy, Debug)]
pub(super) struct TimeUnit {
    name: &'static str,
    seconds: f64,
}

impl TimeUnit {
    /// The unit of a run that ends at `end` s.
    pub fn of(end: f64) -> Self {
        let unit = UNITS.iter().rfind(|(.., least)| end >= *least).filter(|_| end > 0.0);
        unit.map_or(Self { name: "s", seconds: 1.0 }, |&(name, seconds, _)| Self { name, seconds })
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        self.name
    }

    /// The number of units of a time, s.
    pub fn number(self, time: f64) -> f64 {
        time / self.seconds
    }

    /// A time, s, with four digits.
    pub fn text(self, time: f64) -> String {
        let value = self.number(time);
        // Rounded in decimal, and printed without needless zeros.
        let rounded: f64 = format!("{value:.3e}").parse().unwrap_or(value);
        format!("{rounded} {}", self.name)
    }

    fn scale(self, item: &mut Item) {
        match item {
            Item::Curve { points, .. } => points.iter_mut().for_each(|point| point.0 /= self.seconds),
            Item::Band { points, .. } => points.iter_mut().for_each(|point| point.0 /= self.seconds),
            Item::Bar { low, high, .. } => [low, high].into_iter().for_each(|corner| corner.0 /= self.seconds),
        }
    }
}

/// A panel of items whose abscissae are times, s.
pub(super) fn over_time(title: String, y: Axis, mut items: Vec<Item>) -> Panel {
    let end = |item: &Item| match item {
        Item::Curve { points, .. } => points.iter().map(|point| point.0).fold(0.0, f64::max),
        Item::Band { points, .. } => points.iter().map(|point| point.0).fold(0.0, f64::max),
        Item::Bar { low, high, .. } => low.0.max(high.0),
    };
    let unit = TimeUnit::of(items.iter().map(end).fold(0.0, f64::max));
    items.iter_mut().for_each(|item| unit.scale(item));
    Panel { title, x: Axis::linear(&format!("time ({})", unit.name)), y, items, equal: false }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plot::figure::{Line, Style};

    #[test]
    fn units_suit_the_span() {
        let unit = |end: f64| TimeUnit::of(end).name;
        assert_eq!([1e-11, 2e-9, 5e-6, 0.5].map(unit), ["ps", "ns", "\u{b5}s", "ms"]);
        assert_eq!([1.0, 599.0, 600.0, 86_400.0, 604_800.0, 1e9].map(unit), ["s", "s", "min", "h", "d", "yr"]);
        assert_eq!(unit(0.0), "s");
        assert_eq!(TimeUnit::of(86_400.0).text(86_400.0), "24 h");
        assert_eq!(TimeUnit::of(604_800.0).text(1e5), "1.157 d");
        assert_eq!(TimeUnit::of(10.0).text(0.0), "0 s");
    }

    #[test]
    fn items_are_in_the_unit_of_their_label() {
        let style = Style::line([0; 3], Line::Solid);
        let curve = Item::Curve { points: vec![(0.0, 1.0), (7200.0, 2.0), (36_000.0, 3.0)], style };
        let panel = over_time("spin".into(), Axis::linear("rad/s"), vec![curve]);
        assert_eq!(panel.x.label, "time (h)");
        let Item::Curve { points, .. } = &panel.items[0] else { panic!("a curve") };
        assert_eq!(points[..], [(0.0, 1.0), (2.0, 2.0), (10.0, 3.0)]);
    }
}
