//! The content of a picture, independent of how it is drawn.

/// A picture: panels in a grid, a common legend and a caption.
#[derive(Clone, Debug, Default)]
pub struct Figure {
    /// One line above all panels.
    pub title: String,
    /// Lines below all panels: command, commit, machine.
    pub caption: Vec<String>,
    /// The panels, row by row.
    pub panels: Vec<Panel>,
    /// Panels in a row.
    pub columns: usize,
    /// The meaning of lines and marks; it takes the cell after the last panel.
    pub legend: Vec<(String, Style)>,
}

/// One pair of axes.
#[derive(Clone, Debug)]
pub struct Panel {
    /// The title above the panel.
    pub title: String,
    /// The horizontal axis.
    pub x: Axis,
    /// The vertical axis.
    pub y: Axis,
    /// What is drawn, in this order.
    pub items: Vec<Item>,
    /// Whether a unit is equally long on both axes.
    pub equal: bool,
}

/// An axis; its range is that of the items.
#[derive(Clone, Debug)]
pub struct Axis {
    /// Quantity and unit.
    pub label: String,
    /// How numbers are laid out.
    pub scale: Scale,
    /// Numbers that lie in the range whatever the items are.
    pub include: Vec<f64>,
}

impl Axis {
    /// A linear axis.
    pub fn linear(label: &str) -> Self {
        Self { label: label.to_owned(), scale: Scale::Linear, include: Vec::new() }
    }

    /// A logarithmic axis, base 10.
    pub fn log(label: &str) -> Self {
        Self { label: label.to_owned(), scale: Scale::Log, include: Vec::new() }
    }

    /// An axis of names, at 0, 1, 2, …
    pub fn names(label: &str, names: Vec<String>) -> Self {
        let include = vec![-0.5, names.len() as f64 - 0.5];
        Self { label: label.to_owned(), scale: Scale::Names(names), include }
    }
}

/// How numbers are laid out.
#[derive(Clone, Debug, PartialEq)]
pub enum Scale {
    /// In proportion.
    Linear,
    /// By their logarithms; numbers without one are left out.
    Log,
    /// Whole numbers from 0, each with a name.
    Names(Vec<String>),
}

/// Something in a panel, in the units of its axes.
#[derive(Clone, Debug)]
pub enum Item {
    /// Points, joined if the style has a line, each marked if it has a mark; a point that is not finite breaks the line.
    Curve {
        /// The points.
        points: Vec<(f64, f64)>,
        /// Line and mark.
        style: Style,
    },
    /// The area between two curves over the same abscissae.
    Band {
        /// Abscissa, lower and upper end.
        points: Vec<(f64, f64, f64)>,
        /// Its colour; line and mark are ignored.
        style: Style,
    },
    /// A bar.
    Bar {
        /// One corner.
        low: (f64, f64),
        /// The opposite corner.
        high: (f64, f64),
        /// Its colour; a dashed line leaves it hollow.
        style: Style,
    },
}

/// Colour, line and mark: each alone distinguishes items, so that black and white suffices.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Style {
    /// Red, green, blue.
    pub colour: [u8; 3],
    /// The line; with none, only marks are drawn.
    pub line: Line,
    /// The mark; with none, only the line is drawn.
    pub mark: Option<Mark>,
    /// Width of the line in units of the usual one.
    pub width: u32,
}

/// Lines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Line {
    /// None.
    None,
    /// Unbroken.
    Solid,
    /// Dashed.
    Dashed,
    /// Dotted.
    Dotted,
}

/// A mark's outline, and whether it is filled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mark {
    /// The outline.
    pub outline: Outline,
    /// Whether it is filled.
    pub filled: bool,
}

/// Outlines of marks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outline {
    /// A circle.
    Circle,
    /// A square.
    Square,
    /// A triangle on its base.
    Triangle,
    /// A triangle on its tip.
    Tip,
    /// A square on its corner.
    Diamond,
    /// Two strokes, upright.
    Plus,
    /// Two strokes, diagonal.
    Cross,
    /// Four strokes.
    Star,
    /// A triangle that points to the left.
    Wedge,
}

impl Outline {
    /// All outlines, in the order in which they are assigned.
    pub const ALL: [Self; 9] = [
        Self::Circle,
        Self::Square,
        Self::Triangle,
        Self::Diamond,
        Self::Tip,
        Self::Plus,
        Self::Cross,
        Self::Star,
        Self::Wedge,
    ];
}

/// Colours that colour-blind readers can distinguish (M. Okabe, K. Ito, *Color universal design*, 2008), without the yellow, which
/// is invisible on white.
pub(crate) const COLOURS: [[u8; 3]; 7] =
    [BLACK, [230, 159, 0], [86, 180, 233], GREEN, BLUE, VERMILION, [204, 121, 167]];
pub(crate) const BLACK: [u8; 3] = [0, 0, 0];
pub(crate) const GREEN: [u8; 3] = [0, 158, 115];
pub(crate) const BLUE: [u8; 3] = [0, 114, 178];
pub(crate) const VERMILION: [u8; 3] = [213, 94, 0];

/// For the background.
pub(crate) const GREY: [u8; 3] = [150, 150, 150];

impl Style {
    /// The `index`-th combination of colour and mark, with a solid line; the first nine differ in their marks and the
    /// first 63 in one of the two.
    pub fn nth(index: usize) -> Self {
        Self {
            colour: COLOURS[index % COLOURS.len()],
            line: Line::Solid,
            mark: Some(Mark { outline: Outline::ALL[index % Outline::ALL.len()], filled: true }),
            width: 1,
        }
    }

    /// A line without marks.
    pub fn line(colour: [u8; 3], line: Line) -> Self {
        Self { colour, line, mark: None, width: 1 }
    }

    /// The same, drawn hollow and dashed.
    #[must_use]
    pub fn hollow(self) -> Self {
        Self { line: Line::Dashed, mark: self.mark.map(|mark| Mark { filled: false, ..mark }), ..self }
    }
}
