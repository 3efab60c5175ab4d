//! Charts of quantities over time or along a line.

use perimelt_core::log::{Column, Series};

use super::{
    axes::{ChartAxis, Frame, LABEL, TICK, TITLE, look},
    colour::LINES,
    picture::{Anchor, Picture, TextLook, text_width},
    unit,
};

const LEFT: f64 = 125.0;
const RIGHT: f64 = 30.0;
const TOP: f64 = 64.0;
const BOTTOM: f64 = 72.0;
const GAP: f64 = 50.0;

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
    /// name of the vertical axis with its unit
    pub label: String,
    pub logarithmic: bool,
    /// names and values; NaN leaves a gap, and so does what a logarithmic axis cannot show
    pub lines: Vec<(String, Vec<f64>)>,
}

impl Chart {
    /// The series, one panel for each unit.
    pub(crate) fn of_series(title: impl Into<String>, series: &Series, logarithmic: bool) -> Self {
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
        let panel = |si_unit: &&str| {
            let columns: Vec<&Column> = series
                .columns
                .iter()
                .filter(|column| column.unit == *si_unit)
                .collect();
            let finite = columns
                .iter()
                .flat_map(|c| &c.values)
                .filter(|x| x.is_finite());
            let largest = finite.fold(0.0_f64, |largest, x| largest.max(x.abs()));
            let (factor, shown_unit) = unit::value(si_unit, largest);
            let name = match columns[..] {
                [column] => unit::pretty_name(&column.name),
                _ => String::new(),
            };
            let values = |column: &Column| {
                let shown = |x: &f64| {
                    if logarithmic {
                        x.abs() * factor
                    } else {
                        x * factor
                    }
                };
                column.values.iter().map(shown).collect()
            };
            let line = |column: &&Column| (unit::pretty_name(&column.name), values(column));
            Panel {
                label: if name.is_empty() {
                    shown_unit
                } else {
                    unit::label(&name, &shown_unit)
                },
                logarithmic,
                lines: columns.iter().map(line).collect(),
            }
        };
        Self {
            title: title.into(),
            horizontal_label: unit::label("time", time.unit),
            horizontal: series.times.iter().map(|t| t * time.factor).collect(),
            panels: units.iter().map(panel).collect(),
        }
    }

    /// The chart as a picture of this width, `None` if it would be empty.
    pub(crate) fn draw(&self, width: u32) -> Option<Picture> {
        let horizontal = self.horizontal_axis()?;
        let panels: Vec<(&Panel, ChartAxis)> = self
            .panels
            .iter()
            .filter_map(|panel| {
                let numbers = panel
                    .lines
                    .iter()
                    .flat_map(|(_, values)| values.iter().copied());
                Some((
                    panel,
                    ChartAxis::around(numbers, &panel.label, panel.logarithmic)?,
                ))
            })
            .collect();
        if panels.is_empty() {
            return None;
        }
        let count = panels.len() as f64;
        let height = if panels.len() == 1 { 460.0 } else { 300.0 };
        let total = TOP + BOTTOM + count * height + (count - 1.0) * GAP;
        let mut picture = Picture::new(width, total as u32);
        let right = f64::from(width) - RIGHT;
        let title = TextLook {
            bold: true,
            ..look(TITLE, Anchor::Left)
        };
        picture.text(&self.title, [LEFT, 0.45 * TOP], title);
        for (index, (panel, vertical)) in panels.into_iter().enumerate() {
            let top = TOP + index as f64 * (height + GAP);
            let edges = [LEFT, top, right, top + height];
            let frame = Frame {
                edges,
                horizontal: horizontal.clone(),
                vertical,
            };
            frame.draw_grid(&mut picture);
            for (line, (_, values)) in panel.lines.iter().enumerate() {
                self.draw_line(&mut picture, &frame, values, line);
            }
            frame.draw(&mut picture, index + 1 == count as usize);
            if panel.lines.len() > 1 {
                draw_legend(&mut picture, panel, [right, top - 18.0]);
            }
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

    fn draw_line(&self, picture: &mut Picture, frame: &Frame, values: &[f64], line: usize) {
        let colour = LINES[line % LINES.len()];
        let mut points: Vec<[f64; 2]> = Vec::new();
        let mut pieces = Vec::new();
        for (&x, &y) in self.horizontal.iter().zip(values) {
            if x.is_finite() && y.is_finite() && (y > 0.0 || !frame.vertical.logarithmic) {
                points.push(frame.place(x, y));
            } else {
                pieces.push(std::mem::take(&mut points));
            }
        }
        pieces.push(points);
        for piece in pieces {
            match piece[..] {
                [] => {}
                [point] => picture.dot(point, 4.0, colour),
                _ => picture.line(piece, 2.6, colour),
            }
        }
    }
}

/// Names of the lines in a row that ends at `end`.
fn draw_legend(picture: &mut Picture, panel: &Panel, [mut x, y]: [f64; 2]) {
    for (line, (name, _)) in panel.lines.iter().enumerate().rev() {
        x -= text_width(name, TICK);
        picture.text(name, [x, y], look(TICK, Anchor::Left));
        picture.line(
            vec![[x - 36.0, y], [x - 8.0, y]],
            3.0,
            LINES[line % LINES.len()],
        );
        x -= 36.0 + 0.9 * LABEL;
    }
}
