//! Rates at which austenite transforms by diffusion.
//!
//! Both laws are additive (Scheil's rule): the rate depends on temperature and on the fraction transformed so far, not on
//! the path. At a constant temperature [`Kinetics::after`] is exact for a step of any size.

use std::ops::Range;
use std::sync::{Arc, LazyLock};

use perimelt_core::material::Table;

/// A law of transformation.
#[derive(Clone, Debug)]
pub enum Kinetics {
    /// Measured times of beginning and end.
    Isothermal(IsothermalCurves),
    /// Rates by composition.
    Kirkaldy(Kirkaldy),
}

impl Kinetics {
    /// Fraction transformed after a `time` (s) at a temperature (K), from the fraction `x` transformed at its start.
    pub fn after(&self, x: f64, temperature: f64, time: f64) -> f64 {
        match self {
            Kinetics::Isothermal(curves) => curves.after(x, temperature, time),
            Kinetics::Kirkaldy(law) => {
                let progress = law.rate(temperature) * time;
                if progress == 0.0 {
                    x
                } else {
                    law.form.inverse(law.form.at(x) + progress)
                }
            }
        }
    }
}

/// Fractions at the times of beginning and end of an isothermal transformation.
const BEGINNING: f64 = 0.01;
const END: f64 = 0.99;

/// Johnson, Mehl, Avrami and Kolmogorov: `X = 1 - exp(-k t^n)`, with k and n at each temperature from the times at which
/// 1 % and 99 % are transformed.
#[derive(Clone, Debug)]
pub struct IsothermalCurves {
    /// Logarithm of the times (s) by temperature (K).
    beginning: Table,
    end: Table,
}

impl IsothermalCurves {
    /// Curves of the logarithms of the times (s) of 1 % and 99 % over temperature (K), each end after its beginning.
    pub fn new(beginning: Table, end: Table) -> Self {
        IsothermalCurves { beginning, end }
    }

    fn after(&self, x: f64, temperature: f64, time: f64) -> f64 {
        let (lowest, highest) = self.beginning.range();
        if !(lowest..=highest).contains(&temperature) {
            return x;
        }
        let (beginning, end) = (self.beginning.at(temperature), self.end.at(temperature));
        let unit = -(-BEGINNING).ln_1p();
        let exponent = ((1.0 - END).ln() / -unit).ln() / (end - beginning);
        // time at this temperature after which the fraction would be transformed, in times of beginning
        let elapsed = (-(-x).ln_1p() / unit).powf(exponent.recip()) + time / beginning.exp();
        let after = -(-unit * elapsed.powf(exponent)).exp_m1();
        after.max(x)
    }
}

/// Kirkaldy's rate:
///
/// ```text
/// dX/dt = X^(p (1-X)) (1-X)^(p X) exp(-s X^2) (T_start - T)^n / (factor sum_i w_i exp(A_i / T))
/// ```
///
/// The sum contains the resistances to diffusion of carbon and alloying elements at the interface.
#[derive(Clone, Debug)]
pub struct Kirkaldy {
    /// Factor by composition and grain size, s K^n.
    pub factor: f64,
    /// n.
    pub exponent: i32,
    /// Temperatures of the transformation, K; the upper one is `T_start`.
    pub range: Range<f64>,
    /// Weights w_i, and activation energies over the gas constant A_i, K.
    pub resistances: [(f64, f64); 2],
    /// Dependence of the rate on the transformed fraction, p and s.
    pub form: Arc<Sigmoid>,
}

/// An activation energy (cal/mol) over the gas constant, K.
pub const fn activation(energy: f64) -> f64 {
    energy * 4.184 / 8.314_462_618
}

/// The form of Li et al. (1998): p = 0.4, s = 0.
pub static LI: LazyLock<Arc<Sigmoid>> = LazyLock::new(|| Arc::new(Sigmoid::new(0.4, 0.0)));

impl Kirkaldy {
    /// Rate at which the integral of the form grows, 1/s.
    fn rate(&self, temperature: f64) -> f64 {
        if !self.range.contains(&temperature) {
            return 0.0;
        }
        let undercooling = (self.range.end - temperature).powi(self.exponent);
        let of_one = |(weight, activation): (f64, f64)| match weight {
            0.0 => 0.0,
            _ => weight * (activation / temperature).exp(),
        };
        let resistance: f64 = self.resistances.into_iter().map(of_one).sum();
        undercooling / (resistance * self.factor)
    }
}

/// `S(X)`, the integral of `exp(s X^2) / (X^(p (1-X)) (1-X)^(p X))` from 0 to X, by cubics over the variable w with
/// `X = w^m / (w^m + (1-w)^m)` and `m = 3 / (1 - p)`, in which it is smooth at both ends.
#[derive(Debug)]
pub struct Sigmoid {
    /// p.
    exponent: f64,
    /// s.
    slowing: f64,
    values: Vec<f64>,
    slopes: Vec<f64>,
}

/// Intervals of the table.
const INTERVALS: usize = 1000;

impl Sigmoid {
    /// The integral for the exponent p, below 1, and the factor s.
    pub fn new(exponent: f64, slowing: f64) -> Self {
        let mut sigmoid = Sigmoid {
            exponent,
            slowing,
            values: vec![0.0],
            slopes: Vec::new(),
        };
        let width = 1.0 / INTERVALS as f64;
        let slope_at = |i: usize| sigmoid.slope(i as f64 * width);
        let mut values = vec![0.0];
        for i in 0..INTERVALS {
            let middle = sigmoid.slope((i as f64 + 0.5) * width);
            let simpson = (slope_at(i) + 4.0 * middle + slope_at(i + 1)) * width / 6.0;
            values.push(values[i] + simpson);
        }
        let slopes = (0..=INTERVALS).map(slope_at).collect();
        (sigmoid.values, sigmoid.slopes) = (values, slopes);
        sigmoid
    }

    /// The exponent m.
    fn power(&self) -> f64 {
        3.0 / (1.0 - self.exponent)
    }

    fn at(&self, x: f64) -> f64 {
        let odds = (x / (1.0 - x)).powf(self.power().recip());
        let w = if x >= 1.0 { 1.0 } else { odds / (1.0 + odds) };
        let position = w * INTERVALS as f64;
        let interval = (position as usize).min(INTERVALS - 1);
        self.cubic(interval, position - interval as f64).0
    }

    /// Value and derivative by the coordinate in an interval, 0 to 1.
    fn cubic(&self, interval: usize, u: f64) -> (f64, f64) {
        let width = 1.0 / INTERVALS as f64;
        let (from, to) = (self.values[interval], self.values[interval + 1]);
        let (start, end) = (
            width * self.slopes[interval],
            width * self.slopes[interval + 1],
        );
        let (square, cube) = (
            3.0 * (to - from) - 2.0 * start - end,
            2.0 * (from - to) + start + end,
        );
        (
            from + u * (start + u * (square + u * cube)),
            start + u * (2.0 * square + u * 3.0 * cube),
        )
    }

    fn inverse(&self, value: f64) -> f64 {
        let next = self.values.partition_point(|v| *v <= value);
        if next > INTERVALS {
            return 1.0;
        }
        let interval = next.saturating_sub(1);
        let (from, to) = (self.values[interval], self.values[interval + 1]);
        let mut u = (value - from) / (to - from);
        for _ in 0..3 {
            let (at, slope) = self.cubic(interval, u);
            if slope > 0.0 {
                u = (u - (at - value) / slope).clamp(0.0, 1.0);
            }
        }
        let w = (interval as f64 + u) / INTERVALS as f64;
        self.fraction(w)
    }

    /// X by w.
    fn fraction(&self, w: f64) -> f64 {
        let (up, down) = (w.powf(self.power()), (1.0 - w).powf(self.power()));
        up / (up + down)
    }

    /// `dS/dw`.
    fn slope(&self, w: f64) -> f64 {
        let x = self.fraction(w);
        if x == 0.0 || x == 1.0 {
            return 0.0;
        }
        let (m, p) = (self.power(), self.exponent);
        let (up, down) = (w.powf(m), (1.0 - w).powf(m));
        let derivative = m * (w * (1.0 - w)).powf(m - 1.0) / (up + down).powi(2);
        let form = x.powf(p * (1.0 - x)) * (1.0 - x).powf(p * x);
        derivative * (self.slowing * x * x).exp() / form
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sigmoid_is_the_integral_and_its_inverse() {
        // of Li et al. (1998), of Kirkaldy and Venugopalan (1984)
        for (p, s) in [(0.4, 0.0), (2.0 / 3.0, 0.0), (2.0 / 3.0, 0.7)] {
            // by substitution X = u^9, two Gauss points in each interval
            let integral = |x: f64| {
                let (count, upper) = (20_000, x.powf(1.0 / 9.0));
                let width = upper / f64::from(count);
                let term = |place: f64| {
                    let u = place * width;
                    let x = u.powi(9);
                    let form = x.powf(p * (1.0 - x)) * (1.0 - x).powf(p * x);
                    9.0 * u.powi(8) * (s * x * x).exp() / form
                };
                let offset = 0.5 / 3.0_f64.sqrt();
                let pair = |i: i32| {
                    let middle = f64::from(i) + 0.5;
                    term(middle - offset) + term(middle + offset)
                };
                (0..count).map(pair).sum::<f64>() * width / 2.0
            };
            let sigmoid = Sigmoid::new(p, s);
            for x in [1e-6, 0.01, 0.3, 0.5, 0.9, 0.99] {
                let expected = integral(x);
                assert!((sigmoid.at(x) - expected).abs() < 1e-8, "{p} {x}");
                assert!((sigmoid.inverse(expected) - x).abs() < 1e-8, "{p} {x}");
            }
            assert_eq!(sigmoid.inverse(0.0), 0.0);
            assert_eq!(sigmoid.inverse(100.0), 1.0);
        }
    }

    #[test]
    fn isothermal_transformation_passes_beginning_and_end() {
        let table = |times: [f64; 2]| {
            Table::new(vec![700.0, 900.0], times.map(f64::ln).into()).expect("a table")
        };
        let law = Kinetics::Isothermal(IsothermalCurves::new(
            table([1.0, 2.0]),
            table([10.0, 50.0]),
        ));
        assert!((law.after(0.0, 700.0, 1.0) - 0.01).abs() < 1e-12);
        assert!((law.after(0.0, 900.0, 50.0) - 0.99).abs() < 1e-12);
        // in many steps as in one
        let many = (0..100).fold(0.0, |x, _| law.after(x, 800.0, 0.05));
        assert!((many - law.after(0.0, 800.0, 5.0)).abs() < 1e-12);
        assert_eq!(law.after(0.5, 950.0, 10.0), 0.5);
    }

    /// With one resistance: `dX/dt = X^(0.4 (1-X)) (1-X)^(0.4 X) (T_start - T)^n exp(-Q / (R T)) / factor` with Q = 27 500
    /// cal/mol, from the start of its range, which belongs to it, to the end, which does not.
    #[test]
    fn kirkaldys_rate_has_its_published_form() {
        let law = Kirkaldy {
            factor: 4.0,
            exponent: 3,
            range: 700.0..1000.0,
            resistances: [(1.0, activation(27_500.0)), (0.0, 0.0)],
            form: LI.clone(),
        };
        for (temperature, undercooling) in [
            (699.9, 0.0),
            (700.0, 300.0),
            (900.0, 100.0),
            (1000.0, 0.0),
            (1000.1, 0.0),
        ] {
            let arrhenius = f64::exp(-27_500.0 * 4.184 / (8.314_462_618 * temperature));
            let expected = f64::powi(undercooling, 3) * arrhenius / 4.0;
            let found = law.rate(temperature);
            assert!(
                (found - expected).abs() <= 1e-12 * expected,
                "{temperature}: {found}"
            );
        }
        // in steps so short that the fraction stays, around 0.3
        let (x, time) = (0.3_f64, 1e-3);
        let form = x.powf(0.4 * (1.0 - x)) * (1.0 - x).powf(0.4 * x);
        let rate = law.rate(900.0);
        let law = Kinetics::Kirkaldy(law);
        let change = (law.after(x, 900.0, time) - x) / time;
        assert!((change / (form * rate) - 1.0).abs() < 1e-4, "{change}");
        assert_eq!(law.after(0.3, 1100.0, 1e9), 0.3);
    }
}
