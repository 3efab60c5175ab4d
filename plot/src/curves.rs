//! Charts of quantities over time or along a line.

use crate::axes::{ChartAxis, ChartFrame, LABEL, TICK};
use crate::colour::{GREY, LINES};
use crate::heading::{Legend, ROW, draw_heading, heading_height};
use crate::picture::{Anchor, Picture, look};
use crate::scale::range;

const LEFT: f64 = 125.0;
const RIGHT: f64 = 30.0;
const BOTTOM: f64 = 72.0;
const GAP: f64 = 50.0;
/// Height of the title of a panel, pixels.
const TITLE: f64 = 30.0;

/// Curves over one axis, in panels one above the other.
#[derive(Clone, Debug, Default)]
pub struct Chart {
    /// what it shows
    pub title: String,
    /// name of the horizontal axis with its unit
    pub horizontal_label: String,
    /// numbers along the horizontal axis, in its unit
    pub horizontal: Vec<f64>,
    /// from above to below
    pub panels: Vec<Panel>,
}

/// Curves with the same unit.
#[derive(Clone, Debug, Default)]
pub struct Panel {
    /// what it shows, above the panel, where that is too long for the vertical axis; may be empty
    pub title: String,
    /// whether values have dots, as those of single runs
    pub has_dots: bool,
    /// name of the vertical axis with its unit
    pub label: String,
    /// powers of ten instead of even steps
    pub logarithmic: bool,
    /// names and values; NaN leaves a gap, and so does what a logarithmic axis cannot show
    pub lines: Vec<(String, Vec<f64>)>,
    /// name and value of a horizontal line
    pub limit: Option<(String, f64)>,
}

impl Chart {
    /// The chart as a picture of this width under the title of the case, `None` if it would be empty.
    pub fn draw(&self, case: &str, width: u32) -> Option<Picture> {
        let horizontal = self.horizontal_axis()?;
        let right = f64::from(width) - RIGHT;
        let panels = self.panels.iter();
        let placed: Vec<PlacedPanel> = panels
            .filter_map(|panel| PlacedPanel::new(panel, right - LEFT))
            .collect();
        let height = match placed.len() {
            0 => return None,
            1 => 460.0,
            _ => 300.0,
        };
        let above: f64 = placed.iter().map(|panel| panel.above).sum();
        let count = placed.len() as f64;
        let mut below = heading_height(case);
        let total = below + above + BOTTOM + count * height + (count - 1.0) * GAP;
        let mut picture = Picture::new(width, total as u32);
        draw_heading(&mut picture, LEFT, case, &self.title);
        for (index, placed) in placed.iter().enumerate() {
            let top = below + placed.above;
            below = top + height + GAP;
            let frame = ChartFrame {
                edges: [LEFT, top, right, top + height],
                horizontal: horizontal.clone(),
                vertical: placed.vertical.clone(),
            };
            self.draw_panel(&mut picture, placed, &frame, index + 1 == count as usize);
        }
        Some(picture)
    }

    fn horizontal_axis(&self) -> Option<ChartAxis> {
        let numbers = || self.horizontal.iter().copied();
        match range(numbers())? {
            [from, to] if from < to => Some(ChartAxis::linear(from, to, &self.horizontal_label)),
            _ => ChartAxis::around(numbers(), &self.horizontal_label, false),
        }
    }

    fn draw_panel(
        &self,
        picture: &mut Picture,
        placed: &PlacedPanel,
        frame: &ChartFrame,
        is_last: bool,
    ) {
        let [_, top, right, _] = frame.edges;
        frame.draw_grid(picture);
        if let Some((name, value)) = &placed.panel.limit {
            draw_limit(picture, frame, name, *value);
        }
        for line in 0..placed.panel.lines.len() {
            self.draw_line(picture, frame, placed.panel, line);
        }
        frame.draw(picture, is_last);
        let top = top - placed.above;
        let mut corner = [right, top + 18.0 - ROW];
        if !placed.panel.title.is_empty() {
            let at = [LEFT, top + ROW - TITLE];
            picture.text(&*placed.panel.title, at, look(LABEL, Anchor::Left));
            corner[1] += TITLE + ROW;
        }
        placed.legend.draw(picture, corner, |picture, piece, line| {
            picture.line(piece, 3.0, LINES[line % LINES.len()]);
        });
    }

    fn draw_line(&self, picture: &mut Picture, frame: &ChartFrame, panel: &Panel, line: usize) {
        let colour = LINES[line % LINES.len()];
        let is_shown = |&[x, y]: &[f64; 2]| {
            x.is_finite() && y.is_finite() && (y > 0.0 || !frame.vertical.logarithmic)
        };
        let points = self.horizontal.iter().zip(&panel.lines[line].1);
        let points: Vec<[f64; 2]> = points.map(|(&x, &y)| [x, y]).collect();
        for piece in points.split(|point| !is_shown(point)) {
            let piece: Vec<[f64; 2]> = piece.iter().map(|point| frame.place(*point)).collect();
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
    legend: Legend,
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
        let names = panel.lines.iter().map(|(name, _)| name.clone());
        // the label names a single line
        let names = names.filter(|_| panel.lines.len() > 1);
        let legend = Legend::new(names, room);
        // a title has a row of its own above the legend
        let (title, spare) = if panel.title.is_empty() {
            (0.0, 1)
        } else {
            (TITLE, 0)
        };
        let above = title + ROW * legend.len().saturating_sub(spare) as f64;
        Some(Self {
            panel,
            vertical,
            legend,
            above,
        })
    }
}

/// A dashed line across the frame, with its name.
fn draw_limit(picture: &mut Picture, frame: &ChartFrame, name: &str, value: f64) {
    let [left, top, right, _] = frame.edges;
    let [_, y] = frame.place([frame.horizontal.from, value]);
    picture.dashes([[left, y], [right, y]], [14.0, 23.8], 2.0, GREY);
    let beside = if y - top < 28.0 { 14.0 } else { -14.0 };
    picture.text(name, [right - 8.0, y + beside], look(TICK, Anchor::Right));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(lines: &[(&str, &[f64])]) -> Chart {
        let line = |(name, values): &(&str, &[f64])| (name.to_string(), values.to_vec());
        Chart {
            title: "curves".into(),
            horizontal_label: "time (s)".into(),
            horizontal: vec![0.0, 1.0, 2.0, 3.0, 4.0],
            panels: vec![Panel {
                label: "temperature (K)".into(),
                lines: lines.iter().map(line).collect(),
                ..Panel::default()
            }],
        }
    }

    /// Number of elements of a kind in the picture.
    fn count(chart: &Chart, element: &str) -> usize {
        let picture = chart.draw("", 600).expect("something to draw");
        picture.svg().expect("drawn").matches(element).count()
    }

    #[test]
    fn values_that_cannot_be_shown_leave_gaps() {
        let whole = [("a", &[1.0, 2.0, 3.0, 2.0, 1.0][..])];
        let gap = [("a", &[1.0, 2.0, f64::NAN, 3.0, 1.0][..])];
        let lone = [("a", &[1.0, 2.0, f64::NAN, 3.0, f64::NAN][..])];
        let lines = |lines| count(&chart(lines), "<polyline");
        assert_eq!(lines(&gap), lines(&whole) + 1);
        assert_eq!(lines(&lone), lines(&whole));
        assert_eq!(count(&chart(&lone), "<polygon"), 1);
        let mut with_zero = chart(&[("a", &[1.0, 2.0, 0.0, 2.0, f64::NAN])]);
        assert_eq!(count(&with_zero, "<polygon"), 0);
        with_zero.panels[0].logarithmic = true;
        assert_eq!(count(&with_zero, "<polygon"), 1);
    }

    #[test]
    fn several_lines_have_names_and_one_has_none() {
        let values = &[1.0, 2.0, 3.0, 2.0, 1.0][..];
        let svg = |lines: &[_]| {
            let picture = chart(lines).draw("", 600).expect("something to draw");
            picture.svg().expect("drawn")
        };
        assert!(!svg(&[("first", values)]).contains("first"));
        let both = svg(&[("first", values), ("second", values)]);
        assert!(both.contains("first") && both.contains("second"));
    }

    #[test]
    fn nothing_to_draw_is_no_picture() {
        assert!(chart(&[("a", &[f64::NAN; 5])]).draw("", 600).is_none());
        assert!(Chart::default().draw("", 600).is_none());
    }
}
