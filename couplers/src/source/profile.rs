//! The two factors of a beam's power density: footprint on the heated face × profile in depth.
//!
//! Each integrates to 1, so that power × footprint × profile is a density in W/m³.

use std::f64::consts::PI;

/// The density counts as zero below `exp(-CUT)` = 1e-14 of its peak.
const CUT: f64 = 32.236;

/// Power per area on the heated face, for a power of 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Footprint {
    /// `exp(-3 xi²/c² - 3 eta²/a²)` with c = `front` for xi > 0 and `rear` behind; the half in
    /// front carries `front_share` of the power.
    Ellipse {
        front: f64,
        rear: f64,
        half_width: f64,
        front_share: f64,
    },
    /// `peak exp(-2 (r/w)^k)`.
    SuperGaussian { radius: f64, order: f64, peak: f64 },
}

impl Footprint {
    /// Circular Gaussian with `exp(-3 r²/c²)`.
    pub fn round(radius: f64) -> Self {
        Self::Ellipse {
            front: radius,
            rear: radius,
            half_width: radius,
            front_share: 0.5,
        }
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

    /// Whether the density is a product of a function of xi and one of eta.
    pub fn is_separable(&self) -> bool {
        matches!(self, Self::Ellipse { .. })
    }

    /// Whether the travel direction makes no difference.
    pub fn is_round(&self) -> bool {
        match *self {
            Self::Ellipse {
                front,
                rear,
                half_width,
                front_share,
            } => front == rear && front == half_width && front_share == 0.5,
            Self::SuperGaussian { .. } => true,
        }
    }

    /// How far the density reaches along and across the travel direction (m).
    pub fn reach(&self) -> [f64; 2] {
        match *self {
            Self::Ellipse {
                front,
                rear,
                half_width,
                ..
            } => [front.max(rear), half_width].map(|length| length * (CUT / 3.0).sqrt()),
            Self::SuperGaussian { radius, order, .. } => {
                [radius * (0.5 * CUT).powf(1.0 / order); 2]
            }
        }
    }

    /// Length over which the density changes by a good part (m).
    pub fn finest(&self) -> f64 {
        match *self {
            Self::Ellipse {
                front,
                rear,
                half_width,
                ..
            } => front.min(rear).min(half_width),
            // the rim gets steeper with the order
            Self::SuperGaussian { radius, order, .. } => {
                radius * (4.0 / order).clamp(1.0 / 16.0, 1.0)
            }
        }
    }

    /// Power per area at a place (1/m²); zero where the cut-off leaves nothing.
    pub fn density(&self, xi: f64, eta: f64) -> f64 {
        let (peak, exponent) = match *self {
            Self::Ellipse {
                front,
                rear,
                half_width,
                front_share,
            } => {
                let (length, share) = if xi >= 0.0 {
                    (front, front_share)
                } else {
                    (rear, 1.0 - front_share)
                };
                let square = (xi / length).powi(2) + (eta / half_width).powi(2);
                (6.0 / PI * share / (length * half_width), 3.0 * square)
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
        // this is the inner loop of a turned source: half of its box lies outside
        if exponent > CUT {
            0.0
        } else {
            peak * (-exponent).exp()
        }
    }

    /// The factor of a separable density along the travel direction (1/m).
    pub fn along(&self, xi: f64) -> f64 {
        let Self::Ellipse {
            front,
            rear,
            front_share,
            ..
        } = *self
        else {
            return f64::NAN;
        };
        if xi >= 0.0 {
            2.0 * front_share * bell(xi, front)
        } else {
            2.0 * (1.0 - front_share) * bell(xi, rear)
        }
    }

    /// The factor of a separable density across the travel direction (1/m).
    pub fn across(&self, eta: f64) -> f64 {
        let Self::Ellipse { half_width, .. } = *self else {
            return f64::NAN;
        };
        bell(eta, half_width)
    }

    /// Integral of [`along`](Self::along) from 0 to `xi`, by error functions.
    pub fn along_from_centre(&self, xi: f64) -> f64 {
        let Self::Ellipse {
            front,
            rear,
            front_share,
            ..
        } = *self
        else {
            return f64::NAN;
        };
        if xi >= 0.0 {
            2.0 * front_share * half_bell(xi, front)
        } else {
            2.0 * (1.0 - front_share) * half_bell(xi, rear)
        }
    }

    /// Integral of [`across`](Self::across) from 0 to `eta`.
    pub fn across_from_centre(&self, eta: f64) -> f64 {
        let Self::Ellipse { half_width, .. } = *self else {
            return f64::NAN;
        };
        half_bell(eta, half_width)
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
    /// `2 sqrt(3/pi)/b exp(-3 zeta²/b²)`.
    Bell { depth: f64 },
    /// `exp(-zeta/l)/l`.
    Exponential { length: f64 },
    /// `1/h` down to the depth h.
    Uniform { depth: f64 },
}

impl DepthProfile {
    /// Depth below which there is nothing (m).
    pub fn reach(&self) -> f64 {
        match *self {
            Self::Bell { depth } => depth * (CUT / 3.0).sqrt(),
            Self::Exponential { length } => length * CUT,
            Self::Uniform { depth } => depth,
        }
    }

    /// Power per depth at the depth `zeta` (1/m); zero above the face.
    pub fn density(&self, zeta: f64) -> f64 {
        match *self {
            _ if zeta < 0.0 => 0.0,
            Self::Bell { depth } => 2.0 * bell(zeta, depth),
            Self::Exponential { length } => (-zeta / length).exp() / length,
            Self::Uniform { depth } => f64::from(u8::from(zeta < depth)) / depth,
        }
    }

    /// Part of the power between the face and the depth `zeta`.
    pub fn down_to(&self, zeta: f64) -> f64 {
        match *self {
            _ if zeta <= 0.0 => 0.0,
            Self::Bell { depth } => 2.0 * half_bell(zeta, depth),
            Self::Exponential { length } => -(-zeta / length).exp_m1(),
            Self::Uniform { depth } => (zeta / depth).min(1.0),
        }
    }
}
