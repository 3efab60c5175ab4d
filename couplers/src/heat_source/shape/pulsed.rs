//! Laser pulse on a whole face, absorbed with exponential depth (Wang et al. (2021), section 4.4):
//!
//! `s = p J (1 - R) / (t_p l) exp(-zeta/l - a |t - t_0| / t_p)` (W/m³)
//!
//! J fluence, R reflectivity, t_p pulse duration, l absorption depth, t_0 the time of the peak,
//! 2 t_p by default. The printed p = 0.94 and a = 1.992 are the defaults: over all time and depth
//! the body then absorbs 2 p/a J (1 - R) = 0.944 J (1 - R) per area.
//!
//! Averages over a cell and a step are exact. Power that passes through the body is reported as `lost`.

use perimelt_core::SetupError;
use perimelt_core::solver::ExactSum;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::heated_body::depth_range;
use super::{Cells, Deposit, HeatedBody, HeatedSurface, no_direction};
use perimelt_core::numbers::{check_at_least, check_finite, check_fraction, check_positive};

/// An exponentially absorbed laser pulse on a whole face.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PulsedLaser {
    /// Fluence of the laser (J/m²).
    #[schemars(extend("minimum" = 0))]
    pub fluence: f64,
    /// Part that is reflected, 0 to 1.
    #[schemars(extend("minimum" = 0, "maximum" = 1))]
    pub reflectivity: f64,
    /// Pulse duration, full width at half maximum of the Gaussian it stands for (s).
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub pulse_duration: f64,
    /// Depth in which the intensity falls by e (m).
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub absorption_depth: f64,
    /// Time of the peak (s); default twice the pulse duration.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub peak_time: Option<f64>,
    /// a, steepness of the pulse (-); default 1.992.
    #[serde(default = "printed_decay")]
    pub decay: f64,
    /// p, height of the pulse (-); default 0.94.
    #[serde(default = "printed_height")]
    pub height: f64,
    /// The heated face; default z+, where the body ends.
    #[serde(default)]
    pub heated_surface: HeatedSurface,
}

fn printed_decay() -> f64 {
    1.992
}

fn printed_height() -> f64 {
    0.94
}

impl PulsedLaser {
    /// Checks all keys.
    ///
    /// # Errors
    /// [`SetupError`] with the key to blame.
    pub fn validate(&self) -> Result<(), SetupError> {
        check_at_least("fluence", self.fluence, 0.0, "J/m²")?;
        check_fraction("reflectivity", self.reflectivity)?;
        check_positive("pulse_duration", self.pulse_duration, "s")?;
        check_positive("absorption_depth", self.absorption_depth, "m")?;
        check_finite("peak_time", self.peak_time())?;
        check_positive("decay", self.decay, "")?;
        check_positive("height", self.height, "m")?;
        match self.heated_surface.direction {
            Some(_) => Err(no_direction("a pulse on a whole face")),
            None => Ok(()),
        }
    }

    /// Time of the peak (s).
    pub fn peak_time(&self) -> f64 {
        self.peak_time.unwrap_or(2.0 * self.pulse_duration)
    }

    /// The peak, where the pulse has a kink, when it comes after `after` (s).
    pub fn next_event(&self, after: f64) -> Option<f64> {
        Some(self.peak_time()).filter(|&peak| peak > after)
    }

    /// Energy absorbed per area of a thick body between two times (J/m²).
    pub fn absorbed(&self, from: f64, to: f64) -> f64 {
        let since_peak = |time: f64| {
            let s = self.decay * (time - self.peak_time()) / self.pulse_duration;
            -s.signum() * (-s.abs()).exp_m1()
        };
        let whole = self.height * self.fluence * (1.0 - self.reflectivity) / self.decay;
        whole * (since_peak(to) - since_peak(from))
    }

    /// Adds the mean power density of a step from `from` to `to` (s) to `values` (W/m³).
    ///
    /// The power asked for is the mean intensity times `area` (m²), that of the cells that face the laser.
    pub fn add(
        &self,
        body: &(impl HeatedBody + ?Sized),
        from: f64,
        to: f64,
        area: f64,
        values: &mut [f64],
    ) -> Deposit {
        let grid = *body.grid();
        let face = self.heated_surface.face;
        let axis = face.axis();
        let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
        let width = grid.spacing[axis];
        let layers = grid.dims[axis] as i64;
        let level = match self.heated_surface.level {
            _ if grid.is_thickness(axis) => 1.0,
            Some(level) => grid.in_cells(axis, level),
            None if face.is_upper() => layers as f64,
            None => 0.0,
        };
        let deeper = |depth: f64| self.left_at(depth * width);
        let intensity = self.absorbed(from, to) / (to - from);
        let column = intensity * grid.spacing[u] * grid.spacing[v];
        let mut deposited = ExactSum::default();
        for j in 0..grid.dims[v] {
            for i in 0..grid.dims[u] {
                for k in 0..layers {
                    let mut cell = [0; 3];
                    (cell[axis], cell[u], cell[v]) = (k as usize, i, j);
                    let Some(point) = body.point(cell) else {
                        continue;
                    };
                    let (near, far) = depth_range(face, k, level);
                    let power = column * (deeper(near) - deeper(far));
                    values[point] += power / body.volume(point);
                    deposited.add(power);
                }
            }
        }
        Deposit::of(intensity * area, body.total(deposited))
    }
}

impl PulsedLaser {
    /// Fraction of the intensity that is left at a depth (m).
    fn left_at(&self, depth: f64) -> f64 {
        (-depth.max(0.0) / self.absorption_depth).exp()
    }

    /// [`PulsedLaser::add`] for a body without a lattice.
    pub fn add_to_cells(
        &self,
        cells: &Cells<'_>,
        from: f64,
        to: f64,
        area: f64,
        values: &mut [f64],
    ) -> Deposit {
        let face = self.heated_surface.face;
        let axis = face.axis();
        let through = cells.grid.is_thickness(axis);
        let [low, high] = cells.bounds;
        let level = match self.heated_surface.level {
            Some(level) if !through => level,
            _ if face.is_upper() => high[axis],
            _ => low[axis],
        };
        let intensity = self.absorbed(from, to) / (to - from);
        let mut deposited = ExactSum::default();
        let own = values.iter_mut().take(cells.reducer.owned());
        for (point, value) in own.enumerate() {
            let extent = cells.extent(point);
            let [low, high] = cells.corners(point);
            let (near, far) = match (through, face.is_upper()) {
                (true, _) => (0.0, extent[axis]),
                (false, true) => (level - high[axis], level - low[axis]),
                (false, false) => (low[axis] - level, high[axis] - level),
            };
            let part = self.left_at(near) - self.left_at(far);
            let power = intensity * part * cells.volume[point] / extent[axis];
            *value += power / cells.volume[point];
            deposited.add(power);
        }
        Deposit::of(intensity * area, cells.reducer.total(deposited))
    }
}

#[cfg(test)]
mod tests {
    use super::super::heated_body::lattice::TestLattice;
    use super::super::tests::agree;
    use super::*;

    fn film_laser(face: &str) -> PulsedLaser {
        toml::from_str(&format!(
            "fluence = 13.4\nreflectivity = 0.93\nabsorption_depth = 15.3e-9\n\
             pulse_duration = 100e-15\nheated_surface = {{ face = '{face}' }}"
        ))
        .expect("a valid laser")
    }

    #[test]
    fn pulse_deposits_the_fluence_of_the_film_in_any_number_of_steps() {
        // cases/references/femtosecond_film.py: absorbed fluence 0.639719 J/m² of a film of 20 nm in 1 ps
        for face in ["x-", "x+"] {
            let mut film = TestLattice::plate(2e-10, 1e-9, 100);
            film.grid.dims = [100, 3, 1];
            let laser = film_laser(face);
            for steps in [1, 7, 1000] {
                let step = 1e-12 / f64::from(steps);
                let mut energy = 0.0;
                for n in 0..steps {
                    let mut values = film.zeros();
                    let [from, to] = [n, n + 1].map(|n| step * f64::from(n));
                    let deposit = laser.add(&film, from, to, 3.0 * 2e-10 * 1e-9, &mut values);
                    assert!(agree(film.power(&values), deposit.deposited));
                    assert!(agree(deposit.deposited + deposit.lost, deposit.asked));
                    energy += deposit.deposited * step;
                }
                let fluence = energy / (3.0 * 2e-10 * 1e-9);
                // printed with six digits
                assert!(
                    (fluence - 0.639719).abs() < 1e-6,
                    "{face} {steps}: {fluence}"
                );
            }
        }
    }

    #[test]
    fn pulse_has_the_printed_density() {
        let film = TestLattice::plate(2e-10, 1e-9, 100);
        let laser = film_laser("x-");
        let mut values = film.zeros();
        let time = 150e-15;
        laser.add(&film, time - 1e-18, time + 1e-18, 2e-19, &mut values);
        // s at the centre of the sixth cell, 1.1 nm deep
        let expected = 0.94 * 13.4 * 0.07 / (100e-15 * 15.3e-9)
            * (-1.1 / 15.3 - 1.992 * (50.0 / 100.0_f64)).exp();
        // cell average of an exponential: (dx/l)²/24 = 7e-6
        assert!(
            (values[5] / expected - 1.0).abs() < 1e-5,
            "{}",
            values[5] / expected
        );
        assert_eq!(
            (laser.next_event(0.0), laser.next_event(3e-13)),
            (Some(2e-13), None)
        );
    }

    #[test]
    fn mistakes_name_the_key() {
        let laser = PulsedLaser {
            reflectivity: 1.5,
            ..film_laser("x-")
        };
        assert_eq!(
            laser.validate().expect_err("too bright").key,
            "reflectivity"
        );
    }
}
