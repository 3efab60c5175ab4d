//! Keys of the semi-ellipsoid and of Goldak's double ellipsoid.
//!
//! The power density is `Footprint::Ellipse` times `DepthProfile::Bell`; both formulas are documented in `profile.rs`.
//! The double ellipsoid has the length c_f and the fraction f_f in front of the source and c_r, f_r behind it, with
//! `f_f + f_r = 2`. It is continuous at xi = 0 for `f_f = 2 c_f / (c_f + c_r)`, the default. The semi-ellipsoid is
//! `c_f = c_r`, `f_f = f_r = 1`.

use perimelt_core::{SetupError, flattened};

use super::beam::Beam;
use super::profile::{DepthProfile, Ellipse, Footprint};
use super::{ArcPower, CellGrid, CellSampling, HeatedSurface, PowerDensity, SourceShape};
use perimelt_core::numbers::{check_positive, check_within};

flattened! {
    /// An ellipsoid cut in half by the heated face.
    #[derive(Debug, Clone, PartialEq)]
    pub struct SemiEllipsoid {
        ..supplied: ArcPower,
        ..sampled: CellSampling,
        /// c, half length along the travel direction (m): exp(-3) of the peak there.
        #[schemars(extend("exclusiveMinimum" = 0))]
        pub half_length: f64,
        /// a, half width (m).
        #[schemars(extend("exclusiveMinimum" = 0))]
        pub half_width: f64,
        /// b, depth (m). A 2D plate heats through its thickness.
        #[schemars(extend("exclusiveMinimum" = 0))]
        pub depth: f64,
    }
}

flattened! {
    /// Goldak's double ellipsoid: a short front and a long rear.
    #[derive(Debug, Clone, PartialEq)]
    pub struct Goldak {
        ..supplied: ArcPower,
        ..sampled: CellSampling,
        /// c_f, length of the front (m): exp(-3) of the peak there.
        #[schemars(extend("exclusiveMinimum" = 0))]
        pub front_length: f64,
        /// c_r, length of the rear (m).
        #[schemars(extend("exclusiveMinimum" = 0))]
        pub rear_length: f64,
        /// a, half width (m).
        #[schemars(extend("exclusiveMinimum" = 0))]
        pub half_width: f64,
        /// b, depth (m). A 2D plate heats through its thickness.
        #[schemars(extend("exclusiveMinimum" = 0))]
        pub depth: f64,
        /// f_f, 0 to 2: twice the part of the power in front. Default 2 - f_r, or what makes the
        /// density continuous.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("minimum" = 0, "maximum" = 2))]
        pub front_fraction: Option<f64>,
        /// f_r, 0 to 2: twice the part of the power behind. Default 2 - f_f.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("minimum" = 0, "maximum" = 2))]
        pub rear_fraction: Option<f64>,
    }
}

impl SourceShape for SemiEllipsoid {
    fn power(&self) -> Option<f64> {
        self.supplied.power
    }

    fn efficiency(&self) -> f64 {
        self.supplied.efficiency()
    }

    fn length(&self) -> f64 {
        self.half_length.min(self.half_width)
    }

    fn surface(&self) -> HeatedSurface {
        self.sampled.heated_surface
    }

    fn power_density(&self, _: &CellGrid) -> Result<PowerDensity, SetupError> {
        let length = check_positive("half_length", self.half_length, "m")?;
        Ok(PowerDensity::Beam(Beam {
            footprint: Footprint::Ellipse(Ellipse {
                front: length,
                rear: length,
                half_width: check_positive("half_width", self.half_width, "m")?,
                power_in_front: 0.5,
            }),
            depth: DepthProfile::Bell {
                depth: check_positive("depth", self.depth, "m")?,
            },
            plate_depth: None,
            sampled: self.sampled.clone(),
            widest_key: "half_length",
        }))
    }
}

impl Goldak {
    /// f_f and f_r, given or computed.
    pub fn fractions(&self) -> Result<[f64; 2], SetupError> {
        let front = match (self.front_fraction, self.rear_fraction) {
            (Some(front), Some(rear)) if (front + rear - 2.0).abs() > 1e-9 => {
                let message = format!(
                    "`front_fraction` and `rear_fraction` are {front} and {rear}, and do not add up to 2"
                );
                return Err(SetupError::value(
                    "front_fraction",
                    message,
                    "one of them, or neither",
                ));
            }
            (Some(front), _) => check_within("front_fraction", front, 0.0, 2.0)?,
            (None, Some(rear)) => 2.0 - check_within("rear_fraction", rear, 0.0, 2.0)?,
            (None, None) => 2.0 * self.front_length / (self.front_length + self.rear_length),
        };
        Ok([front, 2.0 - front])
    }
}

impl SourceShape for Goldak {
    fn power(&self) -> Option<f64> {
        self.supplied.power
    }

    fn efficiency(&self) -> f64 {
        self.supplied.efficiency()
    }

    fn length(&self) -> f64 {
        self.front_length.min(self.rear_length).min(self.half_width)
    }

    fn surface(&self) -> HeatedSurface {
        self.sampled.heated_surface
    }

    fn power_density(&self, _: &CellGrid) -> Result<PowerDensity, SetupError> {
        let front = check_positive("front_length", self.front_length, "m")?;
        let rear = check_positive("rear_length", self.rear_length, "m")?;
        let [front_fraction, _] = self.fractions()?;
        Ok(PowerDensity::Beam(Beam {
            footprint: Footprint::Ellipse(Ellipse {
                front,
                rear,
                half_width: check_positive("half_width", self.half_width, "m")?,
                power_in_front: 0.5 * front_fraction,
            }),
            depth: DepthProfile::Bell {
                depth: check_positive("depth", self.depth, "m")?,
            },
            plate_depth: None,
            sampled: self.sampled.clone(),
            widest_key: if rear > front {
                "rear_length"
            } else {
                "front_length"
            },
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::super::heated_body::lattice::TestLattice;
    use super::super::tests::{agree, block, depositor, pose};
    use crate::toolpath::Pose;

    #[test]
    fn peak_of_the_semi_ellipsoid_is_the_corrected_q_m() {
        // [Wang2025] 7.5.4: 3200 W, a = b = 1 mm, c = 0.5 mm
        let toml = "semi_ellipsoid = { half_length = 5e-4, half_width = 1e-3, depth = 1e-3,
            normalise = false, sampling = 'point' }";
        let lattice = TestLattice::full([-2e-5, -2e-5, -4e-8], [4e-5, 4e-5, 4e-8], [1, 1, 1]);
        let mut values = lattice.zeros();
        let at = Pose {
            power: 3200.0,
            ..pose([0.0; 3], [1.0, 0.0, 0.0])
        };
        depositor(toml, &lattice).add(&lattice, &at, &mut values);
        // printed with six digits
        assert!((values[0] - 1.19445e13).abs() < 1e8, "{}", values[0]);
    }

    #[test]
    fn cell_averages_tend_to_the_density() {
        let toml = "goldak = { front_length = 5e-4, rear_length = 1e-3, half_width = 8e-4,
            depth = 6e-4, normalise = false }";
        let q_m = 6.0 * 3_f64.sqrt() * 1000.0 / (8e-4 * 6e-4 * std::f64::consts::PI.powf(1.5));
        for (direction, x, y) in [
            ([1.0, 0.0, 0.0], 3e-4, 2e-4),
            ([0.0, -1.0, 0.0], 3e-4, 2e-4),
            ([0.6, 0.8, 0.0], -4e-4, 3e-4),
            ([-0.6, 0.8, 0.0], -4e-4, 3e-4),
        ] {
            // one cell of 10 µm, 0.2 mm deep
            let size = 1e-5;
            let low = [x - 0.5 * size, y - 0.5 * size, -2e-4 - 0.5 * size];
            let lattice = TestLattice::full(low, [size; 3], [1, 1, 1]);
            let mut values = lattice.zeros();
            depositor(toml, &lattice).add(&lattice, &pose([0.0; 3], direction), &mut values);
            let xi = x * direction[0] + y * direction[1];
            let eta = y * direction[0] - x * direction[1];
            let (c, f) = if xi > 0.0 {
                (5e-4, 2.0 / 3.0)
            } else {
                (1e-3, 4.0 / 3.0)
            };
            let square = (xi / c).powi(2) + (eta / 8e-4).powi(2) + (2e-4_f64 / 6e-4).powi(2);
            let expected = f * q_m / c * (-3.0 * square).exp();
            // the curvature, up to 30/c² here, over a cell of c/50 gives 30/50²/24 = 5e-4 per axis
            assert!((values[0] / expected - 1.0).abs() < 1e-3, "{direction:?}");
        }
    }

    #[test]
    fn front_and_rear_receive_their_fractions() {
        for (given, front) in [
            ("front_fraction = 0.6", 0.6),
            ("rear_fraction = 0.6", 1.4),
            ("efficiency = 1.0", 2.0 * 5.0 / 15.0),
        ] {
            let toml = format!(
                "goldak = {{ front_length = 5e-4, rear_length = 1e-3, half_width = 8e-4,
                 depth = 6e-4, {given} }}"
            );
            let dx = 3e-4;
            let mut lattice = TestLattice::full([-20.0 * dx; 3], [dx; 3], [40, 40, 20]);
            // travelling backwards, the front is on the side of low x
            lattice.material = |[x, ..]| x < 20;
            let at = pose([0.0; 3], [-1.0, 0.0, 0.0]);
            let deposit = depositor(&toml, &lattice).add(&lattice, &at, &mut lattice.zeros());
            assert!(
                agree(deposit.deposited, 500.0 * front),
                "{given}: {deposit:?}"
            );
        }
    }

    /// docs/theory/heat_sources.md, "Cells and power": within 1.5 % of the power at the published sizes and spacing, at any
    /// place between the points.
    #[test]
    fn the_published_source_needs_little_normalisation_at_its_points() {
        let toml = "semi_ellipsoid = { half_length = 5e-4, half_width = 1e-3, depth = 1e-3,
            normalise = false, sampling = 'point' }";
        let lattice = block([4e-4; 3]);
        for part in 0..8 {
            let at = pose([5e-5 * f64::from(part), 0.0, 0.0], [1.0, 0.0, 0.0]);
            let deposit = depositor(toml, &lattice).add(&lattice, &at, &mut lattice.zeros());
            let error = deposit.sampling_error() / 1000.0;
            assert!(error.abs() < 0.015, "{part}: {error}");
        }
    }

    #[test]
    fn turned_sources_need_little_normalisation() {
        for toml in [
            "goldak = { front_length = 5e-4, rear_length = 1e-3, half_width = 8e-4, depth = 6e-4,
                normalise = false }",
            "super_gaussian = { absorptivity = 1, radius = 8e-4, order = 6, penetration_depth = 3e-5,
                normalise = false }",
        ] {
            for dx in [2e-4, 7e-4, 3e-3] {
                let lattice = block([dx; 3]);
                let at = pose([1.3e-4, 0.7e-4, 0.0], [0.8, 0.6, 0.0]);
                let deposit = depositor(toml, &lattice).add(&lattice, &at, &mut lattice.zeros());
                // panels of half the finest length, across the jump of the second derivative between
                // front and rear, leave 1e-5
                assert!(
                    deposit.sampling_error().abs() < 1e-2,
                    "{toml} {dx}: {deposit:?}"
                );
            }
        }
    }
}
