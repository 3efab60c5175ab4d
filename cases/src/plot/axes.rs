//! Axes: a frame, ticks at round numbers, labels.

use super::{
    colour::{BLACK, GREY, LIGHT_GREY},
    picture::{Anchor, Picture, TextLook},
};

/// Sizes of letters at a width of 1200 pixels.
pub(crate) const TITLE: f64 = 25.0;
pub(crate) const LABEL: f64 = 20.0;
pub(crate) const TICK: f64 = 18.0;

pub(crate) fn look(size: f64, anchor: Anchor) -> TextLook {
    TextLook {
        size,
        bold: false,
        anchor,
        colour: BLACK,
    }
}

/// An axis: numbers from `from` to `to` along it.
#[derive(Clone, Debug)]
pub(crate) struct ChartAxis {
    pub from: f64,
    pub to: f64,
    pub label: String,
    /// powers of ten instead of even steps
    pub logarithmic: bool,
}

impl ChartAxis {
    pub(crate) fn linear(from: f64, to: f64, label: impl Into<String>) -> Self {
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
        label: impl Into<String>,
        logarithmic: bool,
    ) -> Option<Self> {
        let (mut from, mut to) = (f64::INFINITY, f64::NEG_INFINITY);
        for number in numbers.filter(|x| x.is_finite() && (!logarithmic || *x > 0.0)) {
            from = from.min(number);
            to = to.max(number);
        }
        if from > to {
            return None;
        }
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
            from,
            to,
            label: label.into(),
            logarithmic,
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
    pub(crate) fn ticks(&self, count: f64) -> Vec<(f64, String)> {
        if self.logarithmic {
            let (first, last) = (
                self.from.log10().ceil() as i32,
                self.to.log10().floor() as i32,
            );
            let step = (f64::from(last - first) / count).ceil().max(1.0) as i32;
            let tick = |power: i32| (10_f64.powi(power), power_of_ten(power));
            return (first..=last).step_by(step as usize).map(tick).collect();
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
        let wanted = steps
            .iter()
            .position(|&step| step >= rough * 0.999)
            .unwrap_or(steps.len() - 1);
        // one number alone shows no scale
        let is_scale = |step: &f64| ends(*step).0 < ends(*step).1;
        let smaller = steps[..=wanted].iter().rev().copied();
        let step = smaller.into_iter().find(is_scale).unwrap_or(steps[wanted]);
        let (first, last) = ends(step);
        let decimals = (-step.log10().floor()).clamp(0.0, 12.0) as usize;
        let large = self.from.abs().max(self.to.abs());
        let text = |number: f64| {
            if large >= 1e6 || decimals > 5 {
                crate::unit::signed_number(number, 4)
            } else {
                format!("{number:.decimals$}").replace('-', "−")
            }
        };
        (first..=last)
            .map(|index| (index as f64 * step + 0.0, text(index as f64 * step + 0.0)))
            .collect()
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
    match power {
        0 => "1".into(),
        1 => "10".into(),
        _ => format!(
            "10{}",
            power.to_string().chars().map(raised).collect::<String>()
        ),
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
    pub(crate) fn place(&self, x: f64, y: f64) -> [f64; 2] {
        let [left, top, right, bottom] = self.edges;
        [
            left + self.horizontal.fraction(x) * (right - left),
            bottom - self.vertical.fraction(y) * (bottom - top),
        ]
    }

    /// Lines across the frame at the ticks, to be drawn below the contents.
    pub(crate) fn draw_grid(&self, picture: &mut Picture) {
        let [left, top, right, bottom] = self.edges;
        for (tick, _) in self.horizontal.ticks(self.horizontal_count()) {
            let [x, _] = self.place(tick, self.vertical.from);
            picture.line(vec![[x, top], [x, bottom]], 1.0, LIGHT_GREY);
        }
        for (tick, _) in self.vertical.ticks(self.vertical_count()) {
            let [_, y] = self.place(self.horizontal.from, tick);
            picture.line(vec![[left, y], [right, y]], 1.0, LIGHT_GREY);
        }
    }

    /// Frame, ticks and labels, to be drawn over the contents.
    pub(crate) fn draw(&self, picture: &mut Picture, with_horizontal_labels: bool) {
        let [left, top, right, bottom] = self.edges;
        let outline = vec![
            [left, top],
            [right, top],
            [right, bottom],
            [left, bottom],
            [left, top],
        ];
        picture.line(outline, 1.0, GREY);
        for (tick, text) in self.horizontal.ticks(self.horizontal_count()) {
            let [x, _] = self.place(tick, self.vertical.from);
            picture.line(vec![[x, bottom], [x, bottom + 6.0]], 1.0, GREY);
            if with_horizontal_labels {
                picture.text(text, [x, bottom + 18.0], look(TICK, Anchor::Middle));
            }
        }
        for (tick, text) in self.vertical.ticks(self.vertical_count()) {
            let [_, y] = self.place(self.horizontal.from, tick);
            picture.line(vec![[left - 6.0, y], [left, y]], 1.0, GREY);
            picture.text(text, [left - 11.0, y], look(TICK, Anchor::Right));
        }
        if with_horizontal_labels {
            let middle = 0.5 * (left + right);
            picture.text(
                &self.horizontal.label,
                [middle, bottom + 46.0],
                look(LABEL, Anchor::Middle),
            );
        }
        let middle = 0.5 * (top + bottom);
        picture.upright_text(
            &self.vertical.label,
            [left - 82.0, middle],
            look(LABEL, Anchor::Middle),
        );
    }

    fn horizontal_count(&self) -> f64 {
        ((self.edges[2] - self.edges[0]) / 120.0).max(2.0)
    }

    fn vertical_count(&self) -> f64 {
        ((self.edges[3] - self.edges[1]) / 60.0).max(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_numbers_inside_the_axis() {
        let texts = |axis: ChartAxis, count| -> Vec<String> {
            axis.ticks(count)
                .into_iter()
                .map(|(_, text)| text)
                .collect()
        };
        assert_eq!(
            texts(ChartAxis::linear(-0.31, 0.62, ""), 5.0),
            ["−0.2", "0.0", "0.2", "0.4", "0.6"]
        );
        assert_eq!(
            texts(ChartAxis::linear(300.0, 2100.0, ""), 4.0),
            ["500", "1000", "1500", "2000"]
        );
        // 5 would be the only multiple of 5
        assert_eq!(
            texts(ChartAxis::linear(1.0, 9.0, ""), 2.0),
            ["2", "4", "6", "8"]
        );
        assert_eq!(texts(ChartAxis::linear(-1.3, 0.3, ""), 1.0), ["−1", "0"]);
        let powers = ChartAxis::around([3e-13, 2e-10].into_iter(), "", true).expect("positive");
        assert_eq!(
            texts(powers, 5.0),
            ["10⁻¹³", "10⁻¹²", "10⁻¹¹", "10⁻¹⁰", "10⁻⁹"]
        );
    }
}
