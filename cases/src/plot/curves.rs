//! Charts of quantities over time or along a line.

use perimelt_core::log::{Column, Series};

use super::{
    axes::{ChartAxis, ChartFrame, LABEL, TICK, look},
    colour::{GREY, LINES},
    heading::{ROW, draw_heading, draw_rows, heading_height, rows},
    picture::{Anchor, Picture},
};
use crate::unit::{self, Shown};

const LEFT: f64 = 125.0;
const RIGHT: f64 = 30.0;
const BOTTOM: f64 = 72.0;
const GAP: f64 = 50.0;
/// Height of the title of a panel, pixels.
const TITLE: f64 = 30.0;

/// Curves over one axis, in panels one above the other.
#[derive(Clone, Debug, Default)]
pub(crate) struct Chart {
    pub title: String,
    pub horizontal_label: String,
    pub horizontal: Vec<f64>,
    pub panels: Vec<Panel>,
}

/// Curves with the same unit.
#[derive(Clone, Debug, Default)]
pub(crate) struct Panel {
    /// what it shows, above the panel, where that is too long for the vertical axis; may be empty
    pub title: String,
    /// whether values have dots, as those of single runs
    pub has_dots: bool,
    /// name of the vertical axis with its unit
    pub label: String,
    pub logarithmic: bool,
    /// names and values; NaN leaves a gap, and so does what a logarithmic axis cannot show
    pub lines: Vec<(String, Vec<f64>)>,
    /// name and value of a horizontal line
    pub limit: Option<(String, f64)>,
}

impl Chart {
    /// The series, one panel for each unit, or several where a panel would have more lines than there are colours.
    pub(crate) fn of_series(title: impl Into<String>, series: &Series, celsius: bool) -> Self {
        let last = series
            .times
            .iter()
            .fold(0.0_f64, |last, t| last.max(t.abs()));
        let time = unit::time(last);
        let mut units: Vec<&str> = Vec::new();
        for column in &series.columns {
            if !units.contains(&column.unit.as_str()) {
                units.push(&column.unit);
            }
        }
        let mut panels = Vec::new();
        for si_unit in units {
            let columns: Vec<&Column> = series
                .columns
                .iter()
                .filter(|column| column.unit == si_unit)
                .collect();
            panels.extend(
                columns
                    .chunks(LINES.len())
                    .map(|columns| Panel::of_columns(si_unit, columns, celsius)),
            );
        }
        Self {
            title: title.into(),
            horizontal_label: unit::label("time", time.unit),
            horizontal: series.times.iter().map(|t| t * time.factor).collect(),
            panels,
        }
    }

    /// The chart as a picture of this width under the title of the case, `None` if it would be empty.
    pub(crate) fn draw(&self, case: &str, width: u32) -> Option<Picture> {
        let horizontal = self.horizontal_axis()?;
        let right = f64::from(width) - RIGHT;
        let placed: Vec<PlacedPanel> = self
            .panels
            .iter()
            .filter_map(|panel| PlacedPanel::new(panel, right - LEFT))
            .collect();
        if placed.is_empty() {
            return None;
        }
        let height = if placed.len() == 1 { 460.0 } else { 300.0 };
        let above: f64 = placed.iter().map(|panel| panel.above).sum();
        let count = placed.len() as f64;
        let top = heading_height(case);
        let total = top + above + BOTTOM + count * height + (count - 1.0) * GAP;
        let mut picture = Picture::new(width, total as u32);
        draw_heading(&mut picture, LEFT, case, &self.title);
        let mut below = top;
        for (index, placed) in placed.iter().enumerate() {
            let top = below + placed.above;
            below = top + height + GAP;
            let frame = ChartFrame {
                edges: [LEFT, top, right, top + height],
                horizontal: horizontal.clone(),
                vertical: placed.vertical.clone(),
            };
            frame.draw_grid(&mut picture);
            if let Some((name, value)) = &placed.panel.limit {
                draw_limit(&mut picture, &frame, name, *value);
            }
            for line in 0..placed.panel.lines.len() {
                self.draw_line(&mut picture, &frame, placed.panel, line);
            }
            frame.draw(&mut picture, index + 1 == count as usize);
            if !placed.panel.title.is_empty() {
                let at = [LEFT, top - placed.above + ROW - TITLE];
                picture.text(&*placed.panel.title, at, look(LABEL, Anchor::Left));
            }
            let title = match placed.panel.title.is_empty() {
                true => 0.0,
                false => TITLE + ROW,
            };
            let corner = [right, top - placed.above + 18.0 - ROW + title];
            let sample = |picture: &mut Picture, piece: Vec<[f64; 2]>, line: usize| {
                picture.line(piece, 3.0, LINES[line % LINES.len()]);
            };
            draw_rows(&mut picture, &placed.names, &placed.legend, corner, sample);
        }
        Some(picture)
    }

    fn horizontal_axis(&self) -> Option<ChartAxis> {
        let finite = || self.horizontal.iter().copied().filter(|x| x.is_finite());
        let (from, to) = (
            finite().fold(f64::NAN, f64::min),
            finite().fold(f64::NAN, f64::max),
        );
        if from < to {
            Some(ChartAxis::linear(from, to, &self.horizontal_label))
        } else {
            ChartAxis::around(finite(), &self.horizontal_label, false)
        }
    }

    fn draw_line(&self, picture: &mut Picture, frame: &ChartFrame, panel: &Panel, line: usize) {
        let colour = LINES[line % LINES.len()];
        let mut points: Vec<[f64; 2]> = Vec::new();
        let mut pieces = Vec::new();
        for (&x, &y) in self.horizontal.iter().zip(&panel.lines[line].1) {
            if x.is_finite() && y.is_finite() && (y > 0.0 || !frame.vertical.logarithmic) {
                points.push(frame.place(x, y));
            } else {
                pieces.push(std::mem::take(&mut points));
            }
        }
        pieces.push(points);
        for piece in pieces {
            if panel.has_dots {
                piece.iter().for_each(|p| picture.dot(*p, 5.0, colour));
            }
            match piece[..] {
                [] => {}
                [point] => picture.dot(point, 4.0, colour),
                _ => picture.line(piece, 2.6, colour),
            }
        }
    }
}

/// A panel with its axis and legend.
struct PlacedPanel<'a> {
    panel: &'a Panel,
    vertical: ChartAxis,
    names: Vec<String>,
    /// numbers of the names in each row
    legend: Vec<Vec<usize>>,
    /// height of the rows that do not fit into the space above a panel, pixels
    above: f64,
}

impl<'a> PlacedPanel<'a> {
    /// `None` for a panel without numbers.
    fn new(panel: &'a Panel, room: f64) -> Option<Self> {
        let lines = panel.lines.iter().flat_map(|(_, values)| values.iter());
        let limit = panel.limit.iter().map(|(_, limit)| limit);
        let numbers = lines.chain(limit).copied();
        let vertical = ChartAxis::around(numbers, &panel.label, panel.logarithmic)?;
        let names: Vec<String> = match &panel.lines[..] {
            [_] => Vec::new(),
            lines => lines.iter().map(|(name, _)| name.clone()).collect(),
        };
        let legend = rows(&names, room);
        // a title has a row of its own above the legend
        let has_title = !panel.title.is_empty();
        let spare = usize::from(!has_title);
        let title = if has_title { TITLE } else { 0.0 };
        let above = title + ROW * legend.len().saturating_sub(spare) as f64;
        Some(Self {
            panel,
            vertical,
            names,
            legend,
            above,
        })
    }
}

impl Panel {
    /// Columns of one unit.
    fn of_columns(si_unit: &str, columns: &[&Column], celsius: bool) -> Self {
        let finite = columns
            .iter()
            .flat_map(|c| &c.values)
            .filter(|x| x.is_finite());
        let largest = finite.fold(0.0_f64, |largest, x| largest.max(x.abs()));
        let shown = Shown::new(si_unit, largest, celsius);
        let label = match columns {
            [column] => unit::label(&unit::pretty_name(&column.name), &shown.unit),
            _ => shown.unit.clone(),
        };
        let line = |column: &&Column| {
            let values = column.values.iter().map(|x| shown.of(*x)).collect();
            (unit::pretty_name(&column.name), values)
        };
        Self {
            label,
            lines: columns.iter().map(line).collect(),
            ..Self::default()
        }
    }
}

/// A dashed line across the frame, with its name.
fn draw_limit(picture: &mut Picture, frame: &ChartFrame, name: &str, value: f64) {
    const DASH: f64 = 14.0;
    let [left, top, right, _] = frame.edges;
    let [_, y] = frame.place(frame.horizontal.from, value);
    let mut x = left;
    while x < right {
        picture.line(vec![[x, y], [(x + DASH).min(right), y]], 2.0, GREY);
        x += 1.7 * DASH;
    }
    let beside = if y - top < 28.0 { 14.0 } else { -14.0 };
    picture.text(name, [right - 8.0, y + beside], look(TICK, Anchor::Right));
}
