//! Integral of the conductivity over the temperature.

use super::{EnthalpyCurve, Property};

/// Heat flux potential (Kirchhoff transformation) of a material, `Theta(T) = int k dT'` (W/m), whose gradient is the
/// heat flux wherever the conductivity is that of the temperature: also across a front where it jumps.
///
/// Between the rows of its tables, solidus and liquidus the conductivity is at most quadratic in the temperature, so
/// that the integral is exact. It is zero at the lowest of these temperatures.
#[derive(Debug, Clone, PartialEq)]
pub struct HeatPotential {
    /// Where piece 1, 2, ... starts, K; piece 0 lies below.
    starts: Vec<f64>,
    pieces: Vec<Piece>,
}

/// `c[0] + c[1] d + c[2] d^2 + c[3] d^3` with the distance d (K) from `origin`.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Piece {
    origin: f64,
    coefficients: [f64; 4],
}

impl Piece {
    fn at(&self, temperature: f64) -> f64 {
        let [a, b, c, d] = self.coefficients;
        let x = temperature - self.origin;
        a + x * (b + x * (c + x * d))
    }
}

impl HeatPotential {
    /// Integrates a conductivity, W/(m K), of a material with this enthalpy curve.
    pub fn new(conductivity: &Property, curve: &EnthalpyCurve) -> Self {
        let k = |t: f64| conductivity.at(t, curve.liquid_fraction(t));
        let mut starts = conductivity.temperatures();
        if let Some(latent) = curve.latent_heat() {
            starts.extend([latent.solidus, latent.liquidus]);
        }
        starts.sort_by(f64::total_cmp);
        starts.dedup();
        let constant = |origin: f64, value: f64, k: f64| Piece {
            origin,
            coefficients: [value, k, 0.0, 0.0],
        };
        let (Some(&first), Some(&last)) = (starts.first(), starts.last()) else {
            let pieces = vec![constant(0.0, 0.0, k(0.0))];
            return HeatPotential { starts, pieces };
        };
        let mut pieces = vec![constant(first, 0.0, k(first - 1.0))];
        let mut value = 0.0;
        for pair in starts.windows(2) {
            let width = pair[1] - pair[0];
            // within the piece, as the conductivity may jump at its ends
            let [a, b, c] = [0.25, 0.5, 0.75].map(|x| k(pair[0] + x * width));
            let (slope, bend) = (
                (-5.0 * a + 8.0 * b - 3.0 * c) * 2.0,
                (a - 2.0 * b + c) * 8.0,
            );
            let start = 3.0 * a - 3.0 * b + c;
            let piece = Piece {
                origin: pair[0],
                coefficients: [
                    value,
                    start,
                    0.5 * slope / width,
                    bend / (3.0 * width * width),
                ],
            };
            value = piece.at(pair[1]);
            pieces.push(piece);
        }
        pieces.push(constant(last, value, k(last + 1.0)));
        HeatPotential { starts, pieces }
    }

    /// Value at a temperature (K), W/m.
    pub fn at(&self, temperature: f64) -> f64 {
        let piece = self.starts.partition_point(|start| *start <= temperature);
        self.pieces[piece].at(temperature)
    }
}

#[cfg(test)]
mod tests {
    use super::super::{LatentHeat, LatentHeatForm, MushyCapacity, Table};
    use super::*;

    fn table(rows: &[(f64, f64)]) -> Property {
        let (x, y) = rows.iter().copied().unzip();
        Property::Table(Table::new(x, y).expect("valid"))
    }

    fn curve(melting: Option<[f64; 2]>) -> EnthalpyCurve {
        let latent = melting.map(|[solidus, liquidus]| LatentHeat {
            solidus,
            liquidus,
            latent_heat: 1e5,
            mushy_capacity: MushyCapacity::LatentOnly,
            form: LatentHeatForm::Enthalpy,
        });
        EnthalpyCurve::new(1000.0, &Property::Constant(500.0), latent).expect("valid")
    }

    #[test]
    fn its_slope_is_the_conductivity_at_every_temperature() {
        let by_phase = Property::ByPhase {
            solid: Box::new(table(&[(300.0, 50.0), (900.0, 20.0), (1500.0, 35.0)])),
            liquid: Box::new(table(&[(950.0, 80.0), (2000.0, 120.0)])),
        };
        for (k, melting) in [
            (table(&[(300.0, 10.0), (400.0, 30.0), (1000.0, 5.0)]), None),
            (by_phase.clone(), Some([880.0, 1000.0])),
            (by_phase, Some([960.0, 960.0])),
            (Property::Constant(7.0), None),
        ] {
            let curve = curve(melting);
            let potential = HeatPotential::new(&k, &curve);
            for n in 0..2200 {
                // not at a row
                let t = 100.0 + f64::from(n) + 0.37;
                let slope = (potential.at(t + 0.1) - potential.at(t - 0.1)) / 0.2;
                let expected = k.at(t, curve.liquid_fraction(t));
                assert!(
                    (slope - expected).abs() < 1e-5 * expected,
                    "{t} K: {slope} {expected}"
                );
            }
            // continuous, also where the conductivity jumps
            for t in k.temperatures().into_iter().chain([880.0, 960.0, 1000.0]) {
                let step = potential.at(t + 1e-9) - potential.at(t - 1e-9);
                assert!(step.abs() < 1e-6, "{t} K: {step}");
            }
        }
    }
}
