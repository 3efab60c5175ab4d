//! Axes: a frame, ticks at round numbers, labels.

use crate::colour::{GREY, LIGHT_GREY};
use crate::picture::{Anchor, Picture, TextLook, look};
use crate::scale::range;

/// Sizes of letters at a width of 1200 pixels.
pub(crate) const TITLE: f64 = 25.0;
pub(crate) const LABEL: f64 = 20.0;
pub(crate) const TICK: f64 = 18.0;

/// An axis: numbers from `from` to `to` along it.
#[derive(Clone, Debug)]
pub struct ChartAxis {
    /// number at its beginning
    pub from: f64,
    /// number at its end
    pub to: f64,
    /// what it shows, with the unit
    pub label: String,
    /// powers of ten instead of even steps
    pub logarithmic: bool,
}

impl ChartAxis {
    /// An axis with even steps.
    pub fn linear(from: f64, to: f64, label: impl Into<String>) -> Self {
        Self {
            from,
            to,
            label: label.into(),
            logarithmic: false,
        }
    }

    /// An axis around these numbers, with some room; one number alone gets a range of its size.
    pub(crate) fn around(
        numbers: impl Iterator<Item = f64>,
        label: &str,
        logarithmic: bool,
    ) -> Option<Self> {
        let [mut from, mut to] = range(numbers.filter(|x| !logarithmic || *x > 0.0))?;
        if logarithmic {
            (from, to) = (from.log10().floor(), to.log10().ceil());
            if from == to {
                (from, to) = (from - 1.0, to + 1.0);
            }
            (from, to) = (10_f64.powf(from), 10_f64.powf(to));
        } else {
            // what only differs by rounding is constant
            let size = match from.abs().max(to.abs()) {
                0.0 => 1.0,
                size => size,
            };
            let room = if to - from > 1e-9 * size {
                0.06 * (to - from)
            } else {
                0.1 * size
            };
            let touches_zero = from >= 0.0 && from < 0.3 * to;
            (from, to) = (if touches_zero { 0.0 } else { from - room }, to + room);
        }
        Some(Self {
            logarithmic,
            ..Self::linear(from, to, label)
        })
    }

    /// Position along the axis, from 0 to 1.
    pub(crate) fn fraction(&self, number: f64) -> f64 {
        if self.logarithmic {
            (number / self.from).log10() / (self.to / self.from).log10()
        } else {
            (number - self.from) / (self.to - self.from)
        }
    }

    /// Round numbers on the axis, about `count`, and how they read.
    pub fn ticks(&self, count: f64) -> Vec<(f64, String)> {
        if self.logarithmic {
            let [first, last] = [self.from.log10().ceil(), self.to.log10().floor()];
            let step = ((last - first) / count).ceil().max(1.0) as usize;
            let tick = |power: i32| (10_f64.powi(power), power_of_ten(power));
            let powers = (first as i32..=last as i32).step_by(step);
            return powers.map(tick).collect();
        }
        let span = self.to - self.from;
        if span <= 0.0 || !span.is_finite() {
            return Vec::new();
        }
        let rough = span / count.max(1.0);
        let size = 10_f64.powf(rough.log10().floor());
        let ends = |step: f64| {
            let first = (self.from / step - 1e-6).ceil() as i64;
            (first, (self.to / step + 1e-6).floor() as i64)
        };
        let steps = [0.2, 0.5, 1.0, 2.0, 5.0, 10.0].map(|step| step * size);
        let wanted = steps.iter().position(|&step| step >= rough * 0.999);
        let wanted = wanted.unwrap_or(steps.len() - 1);
        // one number alone shows no scale
        let is_scale = |step: &f64| ends(*step).0 < ends(*step).1;
        let smaller = steps[..=wanted].iter().rev().copied();
        let step = smaller.into_iter().find(is_scale).unwrap_or(steps[wanted]);
        let decimals = (-step.log10().floor()).clamp(0.0, 12.0) as usize;
        let is_short = self.from.abs().max(self.to.abs()) < 1e6 && decimals <= 5;
        let tick = |index: i64| {
            let number = index as f64 * step + 0.0;
            let text = match is_short {
                true => format!("{number:.decimals$}"),
                false => shortest(number),
            };
            (number, text.replace('-', "−"))
        };
        let (first, last) = ends(step);
        (first..=last).map(tick).collect()
    }
}

/// A number with at most four significant digits, very large and very small ones with an exponent.
fn shortest(number: f64) -> String {
    let rounded: f64 = format!("{number:.3e}").parse().unwrap_or(number);
    if rounded == 0.0 || (1e-4..1e6).contains(&rounded.abs()) {
        rounded.to_string()
    } else {
        format!("{rounded:e}")
    }
}

/// `10⁻³`.
fn power_of_ten(power: i32) -> String {
    let raised = |sign| match sign {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        digit => char::from_u32('⁰' as u32 + digit as u32 - '0' as u32).unwrap_or(digit),
    };
    let exponent: String = power.to_string().chars().map(raised).collect();
    match power {
        0 => "1".into(),
        1 => "10".into(),
        _ => format!("10{exponent}"),
    }
}

/// A frame with a horizontal and a vertical axis; numbers become pixels by [`ChartFrame::place`].
#[derive(Clone, Debug)]
pub(crate) struct ChartFrame {
    /// left, top, right, bottom, pixels
    pub edges: [f64; 4],
    pub horizontal: ChartAxis,
    pub vertical: ChartAxis,
}

impl ChartFrame {
    /// Pixel of a pair of numbers.
    pub(crate) fn place(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [left, top, right, bottom] = self.edges;
        [
            left + self.horizontal.fraction(x) * (right - left),
            bottom - self.vertical.fraction(y) * (bottom - top),
        ]
    }

    /// Pixels across and texts of the ticks of the horizontal axis.
    fn columns(&self) -> Vec<(f64, String)> {
        let [left, _, right, _] = self.edges;
        let ticks = self.horizontal.ticks(((right - left) / 120.0).max(2.0));
        let place = |(tick, text)| (self.place([tick, self.vertical.from])[0], text);
        ticks.into_iter().map(place).collect()
    }

    /// Pixels down and texts of the ticks of the vertical axis.
    fn rows(&self) -> Vec<(f64, String)> {
        let [_, top, _, bottom] = self.edges;
        let ticks = self.vertical.ticks(((bottom - top) / 60.0).max(1.0));
        let place = |(tick, text)| (self.place([self.horizontal.from, tick])[1], text);
        ticks.into_iter().map(place).collect()
    }

    /// Lines across the frame at the ticks, to be drawn below the contents.
    pub(crate) fn draw_grid(&self, picture: &mut Picture) {
        let [left, top, right, bottom] = self.edges;
        for (x, _) in self.columns() {
            picture.line([[x, top], [x, bottom]], 1.0, LIGHT_GREY);
        }
        for (y, _) in self.rows() {
            picture.line([[left, y], [right, y]], 1.0, LIGHT_GREY);
        }
    }

    /// Frame, ticks and labels, to be drawn over the contents.
    pub(crate) fn draw(&self, picture: &mut Picture, with_horizontal_labels: bool) {
        let [left, top, right, bottom] = self.edges;
        picture.outline(self.edges, GREY);
        for (x, text) in self.columns() {
            picture.line([[x, bottom], [x, bottom + 6.0]], 1.0, GREY);
            if with_horizontal_labels {
                picture.text(text, [x, bottom + 18.0], look(TICK, Anchor::Middle));
            }
        }
        for (y, text) in self.rows() {
            picture.line([[left - 6.0, y], [left, y]], 1.0, GREY);
            picture.text(text, [left - 11.0, y], look(TICK, Anchor::Right));
        }
        let label = look(LABEL, Anchor::Middle);
        if with_horizontal_labels {
            let at = [0.5 * (left + right), bottom + 46.0];
            picture.text(&self.horizontal.label, at, label);
        }
        let upright = TextLook {
            upright: true,
            ..label
        };
        let at = [left - 82.0, 0.5 * (top + bottom)];
        picture.text(&self.vertical.label, at, upright);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(axis: &ChartAxis, count: f64) -> Vec<String> {
        let ticks = axis.ticks(count);
        ticks.into_iter().map(|(_, text)| text).collect()
    }

    #[test]
    fn ticks_are_round_numbers_inside_the_axis() {
        for (from, to, count, expected) in [
            (-0.31, 0.62, 5.0, &["−0.2", "0.0", "0.2", "0.4", "0.6"][..]),
            (300.0, 2100.0, 4.0, &["500", "1000", "1500", "2000"]),
            // 5 would be the only multiple of 5
            (1.0, 9.0, 2.0, &["2", "4", "6", "8"]),
            (-1.3, 0.3, 1.0, &["−1", "0"]),
            (0.0, 2.2e6, 2.0, &["0", "2e6"]),
            (-6e-7, 3e-7, 3.0, &["−5e−7", "0"]),
        ] {
            assert_eq!(texts(&ChartAxis::linear(from, to, ""), count), expected);
        }
        let powers = ChartAxis::around([3e-13, 2e-10].into_iter(), "", true).expect("positive");
        let expected = ["10⁻¹³", "10⁻¹²", "10⁻¹¹", "10⁻¹⁰", "10⁻⁹"];
        assert_eq!(texts(&powers, 5.0), expected);
        assert_eq!(texts(&powers, 2.0), ["10⁻¹³", "10⁻¹¹", "10⁻⁹"]);
        assert!(ChartAxis::linear(1.0, 1.0, "").ticks(5.0).is_empty());
    }

    #[test]
    fn an_axis_leaves_room_around_its_numbers() {
        let ends = |numbers: &[f64]| {
            let axis = ChartAxis::around(numbers.iter().copied(), "", false);
            axis.map(|axis| [axis.from, axis.to])
        };
        assert_eq!(ends(&[100.0, f64::NAN, 200.0]), Some([94.0, 206.0]));
        // from zero where it is near
        assert_eq!(ends(&[10.0, 100.0]), Some([0.0, 105.4]));
        assert_eq!(ends(&[5.0]), Some([4.5, 5.5]));
        assert_eq!(ends(&[0.0]), Some([-0.1, 0.1]));
        assert_eq!(ends(&[f64::INFINITY]), None);
        assert!(ChartAxis::around([-1.0, 0.0].into_iter(), "", true).is_none());
    }

    #[test]
    fn numbers_lie_between_the_edges_of_the_frame() {
        let frame = ChartFrame {
            edges: [100.0, 50.0, 300.0, 250.0],
            horizontal: ChartAxis::linear(0.0, 4.0, "x"),
            vertical: ChartAxis::around([1.0, 100.0].into_iter(), "y", true).expect("positive"),
        };
        assert_eq!(frame.place([0.0, 1.0]), [100.0, 250.0]);
        assert_eq!(frame.place([1.0, 10.0]), [150.0, 150.0]);
        assert_eq!(frame.place([4.0, 100.0]), [300.0, 50.0]);
    }
}
