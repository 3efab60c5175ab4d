//! Shock wave of an underwater explosion on the surface of a body.
//!
//! A plane wave of the pressure p_i(t) in free water meets the surface, which reflects it and, as it moves away at the speed w,
//! radiates a wave of rarefaction into the water \[Taylor1941\]:
//!
//! ```text
//! p = max(2 p_i(t) - rho c w, p_c)       w = - v . n      Pa
//! ```
//!
//! with the outward normal n, the velocity v of the points, and the density rho and speed of sound c of the water. Pressures are
//! relative to that at rest, which is in balance with the other side. Water does not bear tension: it cavitates at p_c, the
//! cut-off. A free plate of the mass m per area in the wave `p_0 exp(-t / theta)` then takes up the impulse
//!
//! ```text
//! I = 2 p_0 theta q^(q / (1 - q)),   q = rho c theta / m,   up to the time theta ln(q) / (q - 1)
//! ```
//!
//! Assumptions: the wave is plane within a wavelength, and the surface is large against it, so that no water flows around edges; a
//! cavity closes where p rises above p_c again, without a wave of its own; the surface is that of the reference configuration. Not
//! for the pulsation of the gas bubble. Theory: `docs/theory/fluid_structure.md`.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use perimelt_core::body::SurfaceCell;
use perimelt_core::numbers::check_positive;
use perimelt_core::world::BodyIndex;
use perimelt_core::{
    Coupler, Face, GivenValue, InSpace, LoadError, Placed, Prepared, Read, Report, RunError,
    RunningCoupler, SavedState, Setup, SetupError, Step, StepLimits, World, flattened, keys,
};

use super::surface_force::{SurfaceForce, face_centres};
use crate::surface::{OnSurface, select};

/// Fraction of the time in which the water stops a cell of the surface that a step may take.
const STEP_FRACTION: f64 = 0.5;

fn water_density() -> f64 {
    1000.0
}

fn water_sound_speed() -> f64 {
    1500.0
}

flattened! {
    /// Shock wave in water that meets the surface of a body, with the motion of the surface and cavitation.
    #[derive(Debug)]
    pub struct Undex {
        ..place: OnSurface,
        /// Outward directions of the surface that the wave meets, such as `["z+"]`.
        pub faces: Vec<Face>,
        /// Pressure of the incident wave in free water (Pa), relative to that at rest: a number, or a formula in the reference
        /// position x, y, z (m) and the time t (s), such as `"9.65e6 * exp(-t / 2e-4)"`; 0 for water that is only behind the body.
        pub incident: InSpace,
        /// Density of the water, kg/m³.
        #[serde(default = "water_density")]
        #[schemars(extend("exclusiveMinimum" = 0))]
        pub density: f64,
        /// Speed of sound in the water, m/s.
        #[serde(default = "water_sound_speed")]
        #[schemars(extend("exclusiveMinimum" = 0))]
        pub sound_speed: f64,
        /// Pressure at which the water cavitates (Pa), relative to that at rest: 0 or less, such as -1e5 in shallow water.
        #[serde(default)]
        #[schemars(extend("maximum" = 0))]
        pub cavitation: f64,
    }
}

/// A wave that is ready to act.
struct RunningUndex {
    body: BodyIndex,
    cells: Vec<SurfaceCell>,
    incident: Placed,
    water: Water,
    velocity: Read<Vector3<f64>>,
    surface: SurfaceForce,
    /// Longest stable step, s.
    stable_step: f64,
    /// Total force, N.
    force: Vector3<f64>,
    /// Time of the first cavitation, s.
    cavitation_start: Option<f64>,
}

/// The water in front of the surface.
#[derive(Clone, Copy, Debug)]
struct Water {
    /// `rho c`, Pa s/m.
    impedance: f64,
    /// Pressure at which it cavitates, Pa.
    cavitation: f64,
}

impl Water {
    /// `2 p_i - rho c w` with the speed w (m/s) at which the surface moves away from the water, and whether the water cavitates: then the
    /// pressure is that of cavitation, Pa.
    fn pressure(self, incident: f64, recession: f64) -> (f64, bool) {
        let pressure = 2.0 * incident - self.impedance * recession;
        (pressure.max(self.cavitation), pressure < self.cavitation)
    }
}

/// Half of the least time in which the water stops a cell of the surface, `rho_s V / (rho c A)`, s: the pressure takes the velocity
/// before the step.
fn stable_step(
    setup: &Setup<'_>,
    body: BodyIndex,
    cells: &[SurfaceCell],
    impedance: f64,
) -> Result<f64, SetupError> {
    let density = setup.world().property(body, "density")?;
    let body = setup.body(body);
    let mut area = BTreeMap::new();
    for cell in cells {
        *area.entry(cell.point as usize).or_insert(0.0) += cell.face_area;
    }
    let time = area.into_iter().map(|(point, area)| {
        let density = density[body.material_of_point[point] as usize].values();
        let least = density.into_iter().fold(f64::INFINITY, f64::min);
        least * body.points.volume[point] / (impedance * area)
    });
    Ok(STEP_FRACTION * time.fold(f64::INFINITY, f64::min))
}

#[typetag::serialize(name = "undex")]
impl Coupler for Undex {
    fn prepare(self: Box<Self>, setup: &mut Setup<'_>) -> Prepared<dyn RunningCoupler> {
        check_positive("density", self.density, "kg/m³")?;
        check_positive("sound_speed", self.sound_speed, "m/s")?;
        if self.cavitation.is_nan() || self.cavitation > 0.0 {
            let message = format!("the water cavitates at {} Pa", self.cavitation);
            let expected = "a pressure relative to that at rest, 0 or less";
            return Err(SetupError::value("cavitation", message, expected));
        }
        let body = setup.find_body(self.place.body.as_deref())?;
        let cells = select(setup, body, &self.faces, self.place.region.as_deref())?;
        let centres = face_centres(&setup.body(body).points, &cells);
        let given = GivenValue {
            key: "incident",
            value: &self.incident,
            column: "pressure",
        };
        let water = Water {
            impedance: self.density * self.sound_speed,
            cavitation: self.cavitation,
        };
        Ok(Box::new(RunningUndex {
            body,
            incident: setup.placed(body, given, centres)?,
            stable_step: stable_step(setup, body, &cells, water.impedance)?,
            water,
            velocity: setup.read(body, &keys::VELOCITY)?,
            surface: SurfaceForce::prepare(setup, body)?,
            cells,
            force: Vector3::zeros(),
            cavitation_start: None,
        }))
    }
}

impl RunningCoupler for RunningUndex {
    fn apply(&mut self, world: &World, step: Step) -> Result<(), RunError> {
        let time = step.end();
        let incident = self.incident.at(time);
        let incident = incident.map_err(|e| e.during("undex", time))?;
        let (water, velocity) = (self.water, world.read(self.velocity));
        let reducer = world.reducer(self.body);
        let mut cavitates = false;
        let force_on = |(index, cell): (usize, &SurfaceCell)| {
            let recession = -velocity[cell.point as usize].dot(&cell.face.normal());
            let (pressure, is_cut_off) = water.pressure(incident[index], recession);
            cavitates |= is_cut_off && (cell.point as usize) < reducer.owned();
            -cell.face.normal() * (pressure * cell.face_area)
        };
        self.force = self.surface.add(world, &self.cells, force_on);
        if self.cavitation_start.is_none() && reducer.any(cavitates) {
            self.cavitation_start = Some(time);
        }
        Ok(())
    }

    fn stable_step(&mut self, world: &World) -> Option<f64> {
        Some(world.reducer(self.body).min(self.stable_step))
    }

    fn step_limits(&self, time: f64) -> StepLimits {
        StepLimits {
            next_event: self.incident.next_event(time),
            ..StepLimits::default()
        }
    }

    fn save(&self, _world: &World) -> Box<dyn erased_serde::Serialize + '_> {
        Box::new(self.cavitation_start)
    }

    fn load(&mut self, _world: &World, state: SavedState<'_, '_>) -> Result<(), LoadError> {
        self.cavitation_start = erased_serde::deserialize(state)?;
        Ok(())
    }

    fn report(&self) -> Vec<Report> {
        let axes = ["x", "y", "z"].into_iter().zip(&self.force);
        let force = axes.map(|(axis, force)| Report::new(format!("force.{axis}"), "N", *force));
        let start = self.cavitation_start.unwrap_or(f64::NAN);
        force
            .chain([Report::new("cavitation.start", "s", start)])
            .collect()
    }
}

perimelt_core::register_coupler!("undex", Undex, supports: [Births, Cuts, Layers, Division]);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{STEEL, apply, block, prepare, read, refusal, values};
    use perimelt_core::World;

    fn own(setup: &mut Setup<'_>) {
        setup.own(0, &keys::VELOCITY).expect("free");
        setup.consume(0, &keys::BODY_FORCE).expect("free");
    }

    /// The block, which moves at `velocity` (m/s), for the second from `start` (s): force per volume (N/m³) on the points of the
    /// last layer along x, force (N), and the time of the first cavitation (s).
    fn loaded(keys_given: &str, velocity: [f64; 3], start: f64) -> (Vec<f64>, Vec<f64>, f64) {
        let mut world = World::new(vec![block([4, 3, 2], 3, STEEL)]);
        let wave: Undex = read(&format!("faces = ['x+']\n{keys_given}"));
        let (mut wave, ()) = prepare(&mut world, wave, own).expect("valid");
        let field = world.fields().find(0, "velocity").expect("owned");
        let values_of = world.values_mut(field);
        values_of
            .chunks_mut(3)
            .for_each(|v| v.copy_from_slice(&velocity));
        apply(&world, &mut *wave, start);
        let reports: Vec<f64> = wave.report().iter().map(|r| r.value).collect();
        let body_force = values(&world, &keys::BODY_FORCE);
        let last = (0..6).map(|row| body_force[3 * (4 * row + 3)]).collect();
        (last, reports[..3].to_vec(), reports[3])
    }

    /// `2 p_i - rho c w` at the end of the step against the outward normal; w = -v . n.
    #[test]
    fn the_surface_reflects_the_wave_and_radiates_another_one() {
        let wave = "incident = '1e6 * t'\ndensity = 1000\nsound_speed = 1500";
        // at rest, receding along -x, and sideways
        for (velocity, pressure) in [
            ([0.0; 3], 4e6),
            ([-2.0, 0.0, 0.0], 1e6),
            ([0.0, 5.0, 7.0], 4e6),
        ] {
            let (body_force, force, start) = loaded(wave, velocity, 1.0);
            // unit cells
            assert_eq!(body_force, [-pressure; 6], "{velocity:?}");
            assert_eq!(force, [-6.0 * pressure, 0.0, 0.0]);
            assert!(start.is_nan(), "the water is there");
        }
        // moving into the water at 1 m/s
        assert_eq!(
            loaded(wave, [1.0, 0.0, 0.0], 1.0).1,
            [-6.0 * 5.5e6, 0.0, 0.0]
        );
        // water without a wave damps the motion
        assert_eq!(
            loaded("incident = 0", [1.0, 0.0, 0.0], 0.0).1,
            [-6.0 * 1.5e6, 0.0, 0.0]
        );
    }

    #[test]
    fn the_water_cavitates_where_the_surface_recedes_too_fast() {
        let receding = [-4.0, 0.0, 0.0];
        let (body_force, force, start) = loaded("incident = 1e6", receding, 1.0);
        assert_eq!((body_force, force), (vec![0.0; 6], vec![0.0; 3]));
        assert_eq!(start, 2.0);
        // 2e6 - 1.5e6 * 4 = -4e6 Pa are more than -5e6 Pa
        let deep = loaded("incident = 1e6\ncavitation = -5e6", receding, 1.0);
        assert_eq!(deep.1, [6.0 * 4e6, 0.0, 0.0]);
        assert!(deep.2.is_nan());
        let less_deep = loaded("incident = 1e6\ncavitation = -3e6", receding, 1.0);
        assert_eq!(less_deep.1, [6.0 * 3e6, 0.0, 0.0]);
    }

    #[test]
    fn steps_are_short_against_the_time_in_which_the_water_stops_a_cell() {
        let mut world = World::new(vec![block([4, 3, 2], 3, STEEL)]);
        let wave: Undex = read("faces = ['x+', 'z+']\nincident = 0\ndensity = 2000");
        let (mut wave, ()) = prepare(&mut world, wave, own).expect("valid");
        // unit cells of 8000 kg/m3 with two faces at the edge
        let edge = 0.5 * 8000.0 / (2000.0 * 1500.0 * 2.0);
        assert_eq!(wave.stable_step(&world), Some(edge));
    }

    #[test]
    fn mistakes_are_refused() {
        for (keys_given, message) in [
            (
                "incident = 1\ncavitation = 1e5",
                "cavitation: the water cavitates at 100000 Pa",
            ),
            ("incident = 1\nsound_speed = 0", "sound_speed: "),
            ("incident = 1\ndensity = -1", "density: "),
            (
                "incident = '1 / (x - 4)'",
                "incident: `1 / (x - 4)` is inf at [4, 0.5, 0.5] m",
            ),
            (
                "incident = 1\nregion = 'left'",
                "region: no point of region `left`",
            ),
        ] {
            let mut world = World::new(vec![block([4, 3, 2], 3, STEEL)]);
            let wave: Undex = read(&format!("faces = ['x+']\n{keys_given}"));
            let refused = refusal(&mut world, wave);
            assert!(refused.starts_with(message), "{keys_given}: {refused}");
        }
    }
}
