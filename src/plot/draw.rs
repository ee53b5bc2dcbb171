//! A figure as SVG or PNG.
//!
//! Text is set in DejaVu Sans, which is compiled in, so that no font need be installed; an SVG file names `sans-serif`.

use std::path::Path;
use std::sync::Once;

use plotters::coord::Shift;
use plotters::element::DashedPathElement;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{FontStyle, register_font};

use super::figure::{Figure, Item, Line, Mark, Outline, Panel, Scale, Style};
use super::scale::Laid;
use crate::error::{Error, FileAction, Result};
use crate::record::folder::write_whole;

/// Width and height of a panel in an SVG file, pixels.
const PANEL: (u32, u32) = (400, 320);
/// The least width of a figure, so that captions fit.
const LEAST_WIDTH: u32 = 800;
const TITLE_HEIGHT: u32 = 34;
const CAPTION_LINE: u32 = 15;
/// The place of a legend's first line, and the most from line to line.
const LEGEND_TOP: u32 = 24;
const LEGEND_LINE: u32 = 20;
/// Number of caption letters per pixel of width.
const LETTERS_PER_PIXEL: f64 = 0.165;
/// The most letters of a legend in the place of a panel.
const LETTERS_OF_PANEL: usize = 44;
/// Letters of a title per pixel of width, and the size of its font, which is smaller if the title has more.
const LETTERS_OF_TITLE: f64 = 0.115;
const TITLE_FONT: f64 = 16.0;
/// The ratio of a PNG file's pixels to the SVG file's units, on each side.
const PNG_SCALE: u32 = 2;

const FONT: &str = "sans-serif";

/// Draws `figure` to `path`, as SVG or PNG by the extension.
///
/// # Errors
///
/// [`Error::File`] if the file cannot be written.
pub fn draw(figure: &Figure, path: &Path) -> Result<()> {
    static FONTS: Once = Once::new();
    FONTS.call_once(|| {
        // The font is compiled in and valid.
        let _ = register_font(FONT, FontStyle::Normal, dejavu::sans::regular());
    });
    let (width, height) = size(figure);
    let bytes = if path.extension().is_some_and(|ending| ending == "png") {
        let (width, height) = (PNG_SCALE * width, PNG_SCALE * height);
        let mut pixels = vec![255; 3 * (width * height) as usize];
        let backend = BitMapBackend::with_buffer(&mut pixels, (width, height));
        paint(figure, &backend.into_drawing_area(), PNG_SCALE).map_err(|reason| failure(path, reason))?;
        png_file(&pixels, width, height).map_err(|error| failure(path, error.to_string()))?
    } else {
        let mut text = String::new();
        let backend = SVGBackend::with_string(&mut text, (width, height));
        paint(figure, &backend.into_drawing_area(), 1).map_err(|reason| failure(path, reason))?;
        text.into_bytes()
    };
    write_whole(path, &bytes)
}

fn failure(path: &Path, reason: String) -> Error {
    Error::file(path, FileAction::Write, &std::io::Error::other(reason))
}

fn png_file(pixels: &[u8], width: u32, height: u32) -> std::result::Result<Vec<u8>, png::EncodingError> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.write_header()?.write_image_data(pixels)?;
    Ok(bytes)
}

/// Width, and height including the caption's lines.
fn size(figure: &Figure) -> (u32, u32) {
    let (rows, columns) = grid(figure);
    let width = (columns as u32 * PANEL.0).max(LEAST_WIDTH);
    let lines = caption_lines(figure, width).len() as u32;
    (width, TITLE_HEIGHT + rows as u32 * PANEL.1 + legend_height(figure) + CAPTION_LINE * (lines + 1))
}

/// Rows and columns of panels.
fn grid(figure: &Figure) -> (usize, usize) {
    let columns = figure.columns.max(1);
    (figure.panels.len().div_ceil(columns).max(1), columns)
}

/// The height of a legend below the panels; 0 without a legend, and where it stands in the place of a panel.
fn legend_height(figure: &Figure) -> u32 {
    let (rows, columns) = grid(figure);
    let fits = figure.legend.iter().all(|(name, _)| name.chars().count() <= LETTERS_OF_PANEL);
    let has_place = figure.panels.len() < rows * columns && fits;
    if figure.legend.is_empty() || has_place { 0 } else { LEGEND_TOP + LEGEND_LINE * figure.legend.len() as u32 }
}

/// The caption, broken between words.
fn caption_lines(figure: &Figure, width: u32) -> Vec<String> {
    let letters = (f64::from(width) * LETTERS_PER_PIXEL) as usize;
    let mut lines: Vec<String> = Vec::new();
    for paragraph in &figure.caption {
        let mut line = String::new();
        for word in paragraph.split_whitespace() {
            if !line.is_empty() && line.chars().count() + 1 + word.chars().count() > letters {
                lines.push(std::mem::take(&mut line));
            }
            if !line.is_empty() {
                line.push(' ');
            }
            line += word;
        }
        lines.push(line);
    }
    lines
}

type Area<'a, B> = DrawingArea<B, Shift>;
type Painted = std::result::Result<(), String>;

fn words<E: std::error::Error + Send + Sync>(error: DrawingAreaErrorKind<E>) -> String {
    error.to_string()
}

fn paint<B: DrawingBackend>(figure: &Figure, area: &Area<'_, B>, scale: u32) -> Painted {
    area.fill(&WHITE).map_err(words)?;
    let font = |size: u32| (FONT, (size * scale) as i32).into_font();
    let (width, height) = area.dim_in_pixel();
    let (title, rest) = area.split_vertically(TITLE_HEIGHT * scale);
    let letters = f64::from(width / scale) * LETTERS_OF_TITLE;
    let fitting = TITLE_FONT * (letters / figure.title.chars().count().max(1) as f64).min(1.0);
    let title_font = (FONT, fitting * f64::from(scale)).into_font();
    let centred = title_font.color(&BLACK).pos(Pos::new(HPos::Center, VPos::Center));
    let middle = ((width / 2) as i32, (TITLE_HEIGHT * scale / 2) as i32);
    title.draw(&Text::new(figure.title.clone(), middle, centred)).map_err(words)?;
    let lines = caption_lines(figure, width / scale);
    let caption_height = CAPTION_LINE * (lines.len() as u32 + 1) * scale;
    let (middle, caption) = rest.split_vertically(height - TITLE_HEIGHT * scale - caption_height);
    for (index, line) in lines.into_iter().enumerate() {
        let at = ((10 * scale) as i32, (index as u32 * CAPTION_LINE * scale + 4 * scale) as i32);
        caption.draw(&Text::new(line, at, font(11).color(&BLACK))).map_err(words)?;
    }
    let (panels, below) = middle.split_vertically(grid(figure).0 as u32 * PANEL.1 * scale);
    let cells = panels.split_evenly(grid(figure));
    for (panel, cell) in figure.panels.iter().zip(&cells) {
        paint_panel(panel, cell, scale)?;
    }
    let legend = cells.get(figure.panels.len()).filter(|_| legend_height(figure) == 0).unwrap_or(&below);
    if figure.legend.is_empty() { Ok(()) } else { paint_legend(&figure.legend, legend, scale) }
}

fn paint_legend<B: DrawingBackend>(legend: &[(String, Style)], area: &Area<'_, B>, scale: u32) -> Painted {
    let (_, height) = area.dim_in_pixel();
    let step = (height.saturating_sub(LEGEND_TOP * scale) / legend.len() as u32).min(LEGEND_LINE * scale) as i32;
    let unit = scale as i32;
    for (index, (name, style)) in legend.iter().enumerate() {
        let y = LEGEND_TOP as i32 * unit + index as i32 * step;
        let (left, right) = ((40 * unit, y), (90 * unit, y));
        stroke(area, &[left, right], style, scale)?;
        if let Some(mark) = style.mark {
            paint_mark(area, (65 * unit, y), mark, style, scale)?;
        }
        let text = (FONT, (12 * scale) as i32).into_font().color(&BLACK).pos(Pos::new(HPos::Left, VPos::Center));
        area.draw(&Text::new(name.clone(), (100 * unit, y), text)).map_err(words)?;
    }
    Ok(())
}

fn paint_panel<B: DrawingBackend>(panel: &Panel, area: &Area<'_, B>, scale: u32) -> Painted {
    let (xs, ys): (Vec<f64>, Vec<f64>) = panel.items.iter().flat_map(corners).unzip();
    let mut x = Laid::new(&panel.x, xs.into_iter());
    let mut y = Laid::new(&panel.y, ys.into_iter());
    let font = |size: u32| (FONT, (size * scale) as i32).into_font();
    let left = if matches!(panel.y.scale, Scale::Names(_)) { 100 * scale } else { 64 * scale };
    let (bottom, margin) = (48 * scale, 10 * scale);
    let (title_font, title_height) = (font(13), 22 * scale);
    if panel.equal {
        let (width, height) = area.dim_in_pixel();
        let inner = (f64::from(width - left - 2 * margin), f64::from(height - bottom - 2 * margin - title_height));
        let unit = (x.span() / inner.0).max(y.span() / inner.1);
        x.widen(unit * inner.0);
        y.widen(unit * inner.1);
    }
    let mut chart = ChartBuilder::on(area)
        .margin(margin)
        .caption(&panel.title, title_font)
        .x_label_area_size(bottom)
        .y_label_area_size(left)
        .build_cartesian_2d(x.clone(), y.clone())
        .map_err(words)?;
    chart
        .configure_mesh()
        .x_desc(&panel.x.label)
        .y_desc(&panel.y.label)
        .label_style(font(11))
        .axis_desc_style(font(12))
        .bold_line_style(RGBColor(225, 225, 225))
        .light_line_style(TRANSPARENT)
        .axis_style(BLACK.stroke_width(scale))
        .set_all_tick_mark_size((4 * scale) as i32)
        .draw()
        .map_err(words)?;
    let spec = chart.as_coord_spec();
    let at = |px: f64, py: f64| Some(spec.translate(&(x.position(px)?, y.position(py)?)));
    let plane = area.strip_coord_spec();
    // `translate` counts from the corner of the whole picture.
    let (origin_x, origin_y) = {
        let (xs, ys) = area.get_pixel_range();
        (xs.start, ys.start)
    };
    let at = |px: f64, py: f64| at(px, py).map(|(px, py)| (px - origin_x, py - origin_y));
    for item in &panel.items {
        paint_item(item, &plane, &at, scale)?;
    }
    Ok(())
}

/// The corners of an item's extent.
fn corners(item: &Item) -> Vec<(f64, f64)> {
    match item {
        Item::Curve { points, .. } => points.clone(),
        Item::Band { points, .. } => points.iter().flat_map(|&(x, low, high)| [(x, low), (x, high)]).collect(),
        Item::Bar { low, high, .. } => vec![*low, *high],
    }
}

fn paint_item<B: DrawingBackend>(
    item: &Item,
    area: &Area<'_, B>,
    at: &impl Fn(f64, f64) -> Option<(i32, i32)>,
    scale: u32,
) -> Painted {
    match item {
        Item::Curve { points, style } => {
            let pixels: Vec<Option<(i32, i32)>> = points.iter().map(|&(x, y)| at(x, y)).collect();
            for piece in pixels.split(Option::is_none) {
                let piece: Vec<(i32, i32)> = piece.iter().copied().flatten().collect();
                stroke(area, &piece, style, scale)?;
            }
            match style.mark {
                None => Ok(()),
                Some(mark) => {
                    pixels.into_iter().flatten().try_for_each(|pixel| paint_mark(area, pixel, mark, style, scale))
                }
            }
        }
        Item::Band { points, style } => {
            let side =
                |upper: bool| points.iter().filter_map(move |&(x, low, high)| at(x, if upper { high } else { low }));
            let outline: Vec<(i32, i32)> =
                side(false).chain(side(true).collect::<Vec<_>>().into_iter().rev()).collect();
            area.draw(&Polygon::new(outline, colour(style).mix(0.2).filled())).map_err(words)
        }
        Item::Bar { low, high, style } => {
            let ends = (at(low.0, low.1), at(high.0, high.1));
            let (Some(foot), Some(head)) = ends else { return Ok(()) };
            let border = colour(style).stroke_width(scale);
            if style.line != Line::Dashed {
                area.draw(&Rectangle::new([foot, head], colour(style).filled())).map_err(words)?;
            }
            area.draw(&Rectangle::new([foot, head], border)).map_err(words)
        }
    }
}

fn colour(style: &Style) -> RGBColor {
    let [red, green, blue] = style.colour;
    RGBColor(red, green, blue)
}

/// A path of so many pixels has the shortest dashes; longer ones have longer dashes, as each is an element of the picture.
const LONGEST: f64 = 4000.0;

/// A line through pixels.
fn stroke<B: DrawingBackend>(area: &Area<'_, B>, pixels: &[(i32, i32)], style: &Style, scale: u32) -> Painted {
    if pixels.len() < 2 {
        return Ok(());
    }
    let pen = colour(style).stroke_width(style.width * scale);
    let path = pixels.to_vec();
    let far = |ends: &[(i32, i32)]| f64::from(ends[1].0 - ends[0].0).hypot(f64::from(ends[1].1 - ends[0].1));
    let longer = (pixels.windows(2).map(far).sum::<f64>() / (f64::from(scale) * LONGEST)).max(1.0);
    let dash = |length: u32| (f64::from(length * scale) * longer).round() as u32;
    match style.line {
        Line::None => Ok(()),
        // One segment at a time: the bitmap back end draws spikes where a path turns sharply, and holes where it crosses itself.
        Line::Solid if scale == PNG_SCALE => {
            pixels.windows(2).try_for_each(|ends| area.draw(&PathElement::new(ends.to_vec(), pen)).map_err(words))
        }
        Line::Solid => area.draw(&PathElement::new(path, pen)).map_err(words),
        Line::Dashed => area.draw(&DashedPathElement::new(path, dash(6), dash(4), pen)).map_err(words),
        Line::Dotted => area.draw(&DashedPathElement::new(path, dash(2), dash(3), pen)).map_err(words),
    }
}

fn paint_mark<B: DrawingBackend>(
    area: &Area<'_, B>,
    (x, y): (i32, i32),
    mark: Mark,
    style: &Style,
    scale: u32,
) -> Painted {
    let size = 4.0 * f64::from(scale);
    let corner = |dx: f64, dy: f64| (x + (dx * size).round() as i32, y + (dy * size).round() as i32);
    let pen = colour(style).stroke_width(scale);
    let outline = match mark.outline {
        Outline::Circle => {
            let fill: ShapeStyle = if mark.filled { colour(style).filled() } else { WHITE.filled() };
            area.draw(&Circle::new((x, y), size as i32, fill)).map_err(words)?;
            return area.draw(&Circle::new((x, y), size as i32, pen)).map_err(words);
        }
        Outline::Plus | Outline::Cross | Outline::Star => {
            let upright = [(1.0, 0.0), (0.0, 1.0)].into_iter().filter(|_| mark.outline != Outline::Cross);
            let diagonal = [(0.8, 0.8), (0.8, -0.8)].into_iter().filter(|_| mark.outline != Outline::Plus);
            return upright.chain(diagonal).try_for_each(|(dx, dy)| {
                area.draw(&PathElement::new(vec![corner(-dx, -dy), corner(dx, dy)], pen)).map_err(words)
            });
        }
        Outline::Square => vec![(-0.9, -0.9), (0.9, -0.9), (0.9, 0.9), (-0.9, 0.9)],
        Outline::Triangle => vec![(0.0, -1.1), (1.0, 0.8), (-1.0, 0.8)],
        Outline::Tip => vec![(0.0, 1.1), (1.0, -0.8), (-1.0, -0.8)],
        Outline::Wedge => vec![(-1.1, 0.0), (0.8, 1.0), (0.8, -1.0)],
        Outline::Diamond => vec![(0.0, -1.2), (1.2, 0.0), (0.0, 1.2), (-1.2, 0.0)],
    };
    let mut outline: Vec<(i32, i32)> = outline.into_iter().map(|(dx, dy)| corner(dx, dy)).collect();
    let fill = if mark.filled { colour(style).filled() } else { WHITE.filled() };
    area.draw(&Polygon::new(outline.clone(), fill)).map_err(words)?;
    outline.push(outline[0]);
    area.draw(&PathElement::new(outline, pen)).map_err(words)
}
