//! The two factors of the power density of a beam: the footprint on the heated face (1/m²) and the depth profile (1/m).
//!
//! ```text
//! q(xi, eta, zeta) = Q footprint(xi, eta) profile(zeta)      W/m³, with the power Q in W
//! ```
//!
//! The integral of each factor is 1. For a semi-ellipsoid or a double ellipsoid the product is
//!
//! ```text
//! q = f q_m exp(-3 xi²/c² - 3 eta²/a² - 3 zeta²/b²),   q_m = 6 sqrt(3) Q / (a b c pi sqrt(pi))
//! ```
//!
//! (Goldak, Chakravarti, Bibby 1984; Wang (2025), eqs. 7.9, 7.10. The printed q_m of the thesis lacks the 3 under the
//! root; the half space receives the power Q only with it.)

use std::f64::consts::PI;

/// The density counts as zero below `exp(-CUT)` = 1e-14 of its peak.
const CUT: f64 = 32.236;

/// Two half ellipses: c = `front` for xi > 0 and `rear` behind, a = `half_width`. The fraction `power_in_front` (f_f / 2) of
/// the power lies in the front half.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ellipse {
    pub front: f64,
    pub rear: f64,
    pub half_width: f64,
    pub power_in_front: f64,
}

/// Power per area on the heated face, for a power of 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Footprint {
    /// Two half ellipses, the product of a function of xi and one of eta.
    Ellipse(Ellipse),
    /// Super-Gaussian of radius w and order k.
    SuperGaussian { radius: f64, order: f64, peak: f64 },
}

impl Footprint {
    /// Circular Gaussian with `exp(-3 r²/c²)`.
    pub fn round(radius: f64) -> Self {
        Self::Ellipse(Ellipse {
            front: radius,
            rear: radius,
            half_width: radius,
            power_in_front: 0.5,
        })
    }

    /// Super-Gaussian beam of order k: `peak = k 4^(1/k) / (2 pi w² Gamma(2/k))`.
    pub fn super_gaussian(radius: f64, order: f64) -> Self {
        // a plain Gaussian has exact cell averages
        if order == 2.0 {
            return Self::round(radius * 1.5_f64.sqrt());
        }
        let peak = order * 4_f64.powf(1.0 / order)
            / (2.0 * PI * radius * radius * libm::tgamma(2.0 / order));
        Self::SuperGaussian {
            radius,
            order,
            peak,
        }
    }

    /// The ellipse whose factors are known, if it is one.
    pub fn ellipse(&self) -> Option<&Ellipse> {
        match self {
            Self::Ellipse(ellipse) => Some(ellipse),
            Self::SuperGaussian { .. } => None,
        }
    }

    /// Whether the travel direction makes no difference.
    pub fn is_round(&self) -> bool {
        match *self {
            Self::Ellipse(Ellipse {
                front,
                rear,
                half_width,
                power_in_front,
            }) => front == rear && front == half_width && power_in_front == 0.5,
            Self::SuperGaussian { .. } => true,
        }
    }

    /// Extent of the density along and across the travel direction (m).
    pub fn reach(&self) -> [f64; 2] {
        match *self {
            Self::Ellipse(Ellipse {
                front,
                rear,
                half_width,
                ..
            }) => [front.max(rear), half_width].map(|length| length * (CUT / 3.0).sqrt()),
            Self::SuperGaussian { radius, order, .. } => {
                [radius * (0.5 * CUT).powf(1.0 / order); 2]
            }
        }
    }

    /// Shortest length over which the density changes (m).
    pub fn finest(&self) -> f64 {
        match *self {
            Self::Ellipse(Ellipse {
                front,
                rear,
                half_width,
                ..
            }) => front.min(rear).min(half_width),
            // the rim gets steeper with the order
            Self::SuperGaussian { radius, order, .. } => {
                radius * (4.0 / order).clamp(1.0 / 16.0, 1.0)
            }
        }
    }

    /// Power per area at (xi, eta), for a power of 1 (1/m²); zero below the cut-off:
    ///
    /// ```text
    /// ellipse:         3 f / (pi c a) exp(-3 xi²/c² - 3 eta²/a²)     f/2: fraction of the power in this half
    /// super-Gaussian:  peak exp(-2 (r/w)^k)
    /// ```
    pub fn density(&self, xi: f64, eta: f64) -> f64 {
        let (peak, exponent) = match *self {
            Self::Ellipse(Ellipse {
                front,
                rear,
                half_width,
                power_in_front,
            }) => {
                let (length, fraction) = if xi >= 0.0 {
                    (front, power_in_front)
                } else {
                    (rear, 1.0 - power_in_front)
                };
                let square = (xi / length).powi(2) + (eta / half_width).powi(2);
                (6.0 / PI * fraction / (length * half_width), 3.0 * square)
            }
            Self::SuperGaussian {
                radius,
                order,
                peak,
            } => {
                let square = (xi * xi + eta * eta) / (radius * radius);
                (peak, 2.0 * square.powf(0.5 * order))
            }
        };
        // inner loop of a turned source: half of the points of its box lie below the cut-off
        if exponent > CUT {
            0.0
        } else {
            peak * (-exponent).exp()
        }
    }
}

impl Ellipse {
    /// Factor along the travel direction, `f sqrt(3/pi)/c exp(-3 xi²/c²)` (1/m).
    pub fn along(&self, xi: f64) -> f64 {
        if xi >= 0.0 {
            2.0 * self.power_in_front * bell(xi, self.front)
        } else {
            2.0 * (1.0 - self.power_in_front) * bell(xi, self.rear)
        }
    }

    /// Factor across the travel direction, `sqrt(3/pi)/a exp(-3 eta²/a²)` (1/m).
    pub fn across(&self, eta: f64) -> f64 {
        bell(eta, self.half_width)
    }

    /// Integral of [`along`](Self::along) from 0 to `xi`, by error functions.
    pub fn along_from_centre(&self, xi: f64) -> f64 {
        if xi >= 0.0 {
            2.0 * self.power_in_front * half_bell(xi, self.front)
        } else {
            2.0 * (1.0 - self.power_in_front) * half_bell(xi, self.rear)
        }
    }

    /// Integral of [`across`](Self::across) from 0 to `eta`.
    pub fn across_from_centre(&self, eta: f64) -> f64 {
        half_bell(eta, self.half_width)
    }
}

/// `sqrt(3/pi)/c exp(-3 x²/c²)`, integral 1.
fn bell(x: f64, c: f64) -> f64 {
    (3.0 / PI).sqrt() / c * (-3.0 * x * x / (c * c)).exp()
}

/// Integral of [`bell`] from 0 to x: `erf(sqrt(3) x/c) / 2`.
fn half_bell(x: f64, c: f64) -> f64 {
    0.5 * libm::erf(3_f64.sqrt() * x / c)
}

/// Power per depth below the heated face, for a power of 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum DepthProfile {
    /// `2 sqrt(3/pi)/b exp(-3 zeta²/b²)`, of the ellipsoids.
    Bell { depth: f64 },
    /// `exp(-zeta/l)/l`.
    Exponential { length: f64 },
    /// `1/h` down to the depth h.
    Uniform { depth: f64 },
    /// `2/h (1 - zeta/h)` down to the depth h.
    Linear { depth: f64 },
}

impl DepthProfile {
    /// Depth below which the density is zero or below the cut-off (m).
    pub fn reach(&self) -> f64 {
        match *self {
            Self::Bell { depth } => depth * (CUT / 3.0).sqrt(),
            Self::Exponential { length } => length * CUT,
            Self::Uniform { depth } | Self::Linear { depth } => depth,
        }
    }

    /// Length over which the density changes (m).
    pub fn finest(&self) -> f64 {
        match *self {
            Self::Bell { depth } | Self::Uniform { depth } | Self::Linear { depth } => depth,
            Self::Exponential { length } => length,
        }
    }

    /// Power per depth at the depth `zeta` (1/m); zero above the face.
    pub fn density(&self, zeta: f64) -> f64 {
        match *self {
            _ if zeta < 0.0 => 0.0,
            Self::Bell { depth } => 2.0 * bell(zeta, depth),
            Self::Exponential { length } => (-zeta / length).exp() / length,
            Self::Uniform { depth } => f64::from(u8::from(zeta < depth)) / depth,
            Self::Linear { depth } => 2.0 / depth * (1.0 - zeta / depth).max(0.0),
        }
    }

    /// Part of the power between the face and the depth `zeta`.
    pub fn down_to(&self, zeta: f64) -> f64 {
        match *self {
            _ if zeta <= 0.0 => 0.0,
            Self::Bell { depth } => 2.0 * half_bell(zeta, depth),
            Self::Exponential { length } => -(-zeta / length).exp_m1(),
            Self::Uniform { depth } => (zeta / depth).min(1.0),
            Self::Linear { depth } => 1.0 - (1.0 - zeta / depth).max(0.0).powi(2),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Power deeper than the length, and mean depth over the length, as the documentation of `penetration` says.
    #[test]
    fn depth_profiles_have_their_tails_and_means() {
        let length = 2e-5;
        for (profile, deeper, mean) in [
            (DepthProfile::Uniform { depth: length }, 0.0, 0.5),
            (DepthProfile::Linear { depth: length }, 0.0, 1.0 / 3.0),
            (
                DepthProfile::Bell {
                    depth: length * 1.5_f64.sqrt(),
                },
                libm::erfc(2.0_f64.sqrt()),
                1.0 / (2.0 * PI).sqrt(),
            ),
            (DepthProfile::Exponential { length }, (-1.0_f64).exp(), 1.0),
        ] {
            assert!(
                (1.0 - profile.down_to(length) - deeper).abs() < 1e-12,
                "{profile:?}"
            );
            assert!((profile.down_to(profile.reach()) - 1.0).abs() < 1e-12);
            let cells = 40_000;
            let width = profile.reach() / f64::from(cells);
            let middle = |cell: i32| (f64::from(cell) + 0.5) * width;
            let first: f64 = (0..cells)
                .map(|cell| profile.density(middle(cell)) * middle(cell) * width)
                .sum();
            assert!(
                (first / length - mean).abs() < 1e-4,
                "{profile:?}: {}",
                first / length
            );
        }
    }

    /// The density of an ellipse is the product of its factors, whose integrals are those from the centre on; the front
    /// half has its fraction of the power.
    #[test]
    fn factors_of_an_ellipse_integrate_to_its_parts() {
        let (front, rear, half_width, power_in_front) = (2e-3, 3e-3, 1e-3, 0.3);
        let ellipse = Ellipse {
            front,
            rear,
            half_width,
            power_in_front,
        };
        let footprint = Footprint::Ellipse(ellipse);
        for (xi, eta) in [
            (1e-3, 0.4e-3),
            (-1e-3, 0.4e-3),
            (0.5e-3, -1.2e-3),
            (-4e-3, 0.0),
        ] {
            let (length, fraction) = if xi > 0.0 {
                (front, power_in_front)
            } else {
                (rear, 1.0 - power_in_front)
            };
            // q = 6 f / (pi c a) exp(-3 xi²/c² - 3 eta²/a²), of which f is the fraction of the half
            let exponent = -3.0 * (xi * xi / (length * length) + eta * eta / 1e-6);
            let expected = 6.0 * fraction / (PI * length * half_width) * f64::exp(exponent);
            for found in [
                footprint.density(xi, eta),
                ellipse.along(xi) * ellipse.across(eta),
            ] {
                assert!(
                    (found / expected - 1.0).abs() < 1e-12,
                    "{xi} {eta}: {found}"
                );
            }
        }
        // midpoint rule of 1000 cells over one length
        let sum = |to: f64, of: &dyn Fn(f64) -> f64| -> f64 {
            let width = to / 1000.0;
            (0..1000)
                .map(|i| of((f64::from(i) + 0.5) * width) * width)
                .sum()
        };
        for to in [2e-3, -3e-3, 1e-2] {
            for (found, expected) in [
                (
                    ellipse.along_from_centre(to),
                    sum(to, &|x| ellipse.along(x)),
                ),
                (
                    ellipse.across_from_centre(to),
                    sum(to, &|x| ellipse.across(x)),
                ),
            ] {
                assert!((found - expected).abs() < 1e-5, "{to}: {found} {expected}");
            }
        }
        assert!((ellipse.along_from_centre(1.0) - power_in_front).abs() < 1e-12);
        assert!((ellipse.along_from_centre(-1.0) + 1.0 - power_in_front).abs() < 1e-12);
        assert!((ellipse.across_from_centre(1.0) - 0.5).abs() < 1e-12);
        assert_eq!(footprint.finest(), 1e-3);
        let reach = (CUT / 3.0).sqrt();
        assert_eq!(footprint.reach(), [3e-3 * reach, 1e-3 * reach]);
    }

    /// `2 pi` times the integral of the density times the radius is 1.
    #[test]
    fn a_super_gaussian_has_the_power_1() {
        let radius = 0.8e-3;
        for (order, finest) in [
            (1.0, 1.0),
            (2.0, 1.5_f64.sqrt()),
            (4.0, 1.0),
            (8.0, 0.5),
            (200.0, 1.0 / 16.0),
        ] {
            let beam = Footprint::super_gaussian(radius, order);
            let [reach, across] = beam.reach();
            assert_eq!(reach, across);
            let (cells, width) = (40_000, reach / 40_000.0);
            let ring = |i: i32| {
                let r = (f64::from(i) + 0.5) * width;
                // in any direction
                2.0 * PI * r * beam.density(0.6 * r, -0.8 * r) * width
            };
            let power: f64 = (0..cells).map(ring).sum();
            // the midpoint rule near the rim of order 200
            assert!((power - 1.0).abs() < 1e-5, "{order}: {power}");
            // 1/e² of the peak at the radius
            let at_radius = beam.density(radius, 0.0) / beam.density(0.0, 0.0);
            assert!((at_radius - f64::exp(-2.0)).abs() < 1e-12, "{order}");
            assert!((beam.finest() - finest * radius).abs() < 1e-15, "{order}");
            assert!(beam.is_round() && beam.ellipse().is_some() == (order == 2.0));
        }
    }

    #[test]
    fn only_an_ellipse_with_one_length_is_round() {
        for ([front, rear, half_width, power_in_front], is_round) in [
            ([1.0, 1.0, 1.0, 0.5], true),
            ([2.0, 1.0, 1.0, 0.5], false),
            ([1.0, 2.0, 1.0, 0.5], false),
            ([1.0, 1.0, 2.0, 0.5], false),
            ([1.0, 1.0, 1.0, 0.6], false),
        ] {
            let ellipse = Footprint::Ellipse(Ellipse {
                front,
                rear,
                half_width,
                power_in_front,
            });
            assert_eq!(ellipse.is_round(), is_round, "{ellipse:?}");
        }
    }

    #[test]
    fn the_power_down_to_a_depth_is_the_integral_of_the_density() {
        for profile in [
            DepthProfile::Bell { depth: 2.0 },
            DepthProfile::Exponential { length: 0.7 },
            DepthProfile::Uniform { depth: 1.5 },
            DepthProfile::Linear { depth: 3.0 },
        ] {
            assert_eq!([-0.1, 0.0].map(|z| profile.down_to(z)), [0.0; 2]);
            assert_eq!(profile.density(-1e-9), 0.0);
            for to in [0.5, 1.4, 4.0] {
                let width = to / 4000.0;
                let middle = |i: i32| (f64::from(i) + 0.5) * width;
                let sum: f64 = (0..4000).map(|i| profile.density(middle(i)) * width).sum();
                // a cell across the end of the uniform one
                assert!(
                    (profile.down_to(to) - sum).abs() < 1e-3,
                    "{profile:?} {to}: {sum}"
                );
            }
        }
        assert_eq!(DepthProfile::Exponential { length: 0.7 }.finest(), 0.7);
        assert_eq!(DepthProfile::Linear { depth: 3.0 }.finest(), 3.0);
    }
}
