//! A laser pulse on a whole face of a body, as a coupler.
//!
//! The mean over a step is exact for any length of the step. Automatic steps take at most a quarter
//! of the pulse duration until the pulse is over.

use std::borrow::Cow;
use std::collections::BTreeSet;

use perimelt_core::solver::ExactSum;
use perimelt_core::world::BodyIndex;
use perimelt_core::{
    Coupler, Face, LoadError, Prepared, Report, RunError, RunningCoupler, SavedState, Setup, Step,
    StepLimits, World, Write, flattened, keys,
};
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::{Deserialize, Deserializer, Serialize};

use super::account::Account;
use super::lattice::{AbsorbingState, LatticeBody, grid};
use super::shape::{self, CellGrid, Cells};
use super::step_positions::StepPositions;
use crate::surface::OnBody;

/// Fraction of the pulse duration that a step may take.
const STEP_FRACTION: f64 = 0.25;

/// Pulse durations after the peak until the pulse is over: exp(-40) is below rounding.
const TAIL: f64 = 40.0;

/// A laser pulse on a whole face.
#[derive(Serialize)]
pub struct PulsedLaserSource {
    #[serde(flatten)]
    target: OnBody,
    /// Pulse and absorption.
    #[serde(flatten)]
    pub shape: shape::PulsedLaser,
}

/// A laser pulse that is ready to heat.
struct RunningPulsedLaserSource {
    shape: shape::PulsedLaser,
    body: BodyIndex,
    grid: CellGrid,
    /// Area of the cells that face the laser, m².
    area: f64,
    heat_source: Write<f64>,
    account: Account,
    positions: StepPositions,
}

/// Area of the cells of a body that face a laser, m². Collective.
fn facing_area(world: &World, body: BodyIndex, grid: &CellGrid, face: Face) -> f64 {
    let (this, reducer, axis) = (world.body(body), world.reducer(body), face.axis());
    let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
    if let Some(lattice) = this.lattice() {
        let cells = lattice.whole().cells_of_points();
        let columns: BTreeSet<[u32; 2]> = cells.map(|cell| [cell[u], cell[v]]).collect();
        return columns.len() as f64 * grid.spacing[u] * grid.spacing[v];
    }
    if axis >= this.dimension {
        return reducer.sum(&this.points.volume) / grid.spacing[axis];
    }
    let mut area = ExactSum::default();
    let faces = this.surface_of(0..reducer.owned(), &[face], |_| true);
    faces.iter().for_each(|cell| area.add(cell.area));
    reducer.total(area)
}

#[typetag::serialize(name = "pulsed_laser")]
impl Coupler for PulsedLaserSource {
    fn prepare(self: Box<Self>, setup: &mut Setup<'_>) -> Prepared<dyn RunningCoupler> {
        let body = setup.find_body(self.target.body.as_deref())?;
        self.shape.validate()?;
        let grid = grid(setup.body(body));
        let area = facing_area(setup.world(), body, &grid, self.shape.heated_surface.face);
        Ok(Box::new(RunningPulsedLaserSource {
            shape: self.shape,
            body,
            grid,
            area,
            heat_source: setup.add(body, &keys::HEAT_SOURCE)?,
            account: Account::default(),
            positions: StepPositions::default(),
        }))
    }
}

impl RunningCoupler for RunningPulsedLaserSource {
    fn begin_step(&mut self, world: &World, time: f64) {
        self.positions.begin_step(world, self.body, time);
    }

    fn apply(&mut self, world: &World, step: Step) -> Result<(), RunError> {
        if step.size > 0.0 {
            let body = world.body(self.body);
            let mut heat_source = world.write(self.heat_source);
            let (from, to) = (step.start, step.end());
            let now = self.positions.at(world, self.body, step.middle());
            let deposit = match Cells::of(world, self.body, now, self.grid) {
                Some(cells) => {
                    (self.shape).add_to_cells(&cells, from, to, self.area, &mut heat_source)
                }
                None => {
                    let body = LatticeBody {
                        body,
                        grid: self.grid,
                        activity: None,
                        state: AbsorbingState::None,
                        reducer: world.reducer(self.body),
                    };
                    self.shape.add(&body, from, to, self.area, &mut heat_source)
                }
            };
            self.account.book(&deposit, 1.0, step.size, Some(0.0));
        }
        Ok(())
    }

    fn step_limits(&self, time: f64) -> StepLimits {
        let duration = self.shape.pulse_duration;
        let end = self.shape.peak_time() + TAIL / self.shape.decay * duration;
        StepLimits {
            next_event: self.shape.next_event(time),
            longest: (time < end).then_some(STEP_FRACTION * duration),
        }
    }

    fn report(&self) -> Vec<Report> {
        self.account.report()
    }

    fn save(&self, _world: &World) -> Box<dyn erased_serde::Serialize + '_> {
        Box::new(self.account)
    }

    fn load(&mut self, _world: &World, state: SavedState<'_, '_>) -> Result<(), LoadError> {
        self.account = Account::deserialize(state)?;
        Ok(())
    }
}

perimelt_core::register_coupler!("pulsed_laser", PulsedLaserSource, supports: [Motion, Flow, Division]);

impl<'de> Deserialize<'de> for PulsedLaserSource {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let ((target,), shape) = flattened::read(deserializer)?;
        Ok(PulsedLaserSource { target, shape })
    }
}

impl JsonSchema for PulsedLaserSource {
    fn schema_name() -> Cow<'static, str> {
        shape::PulsedLaser::schema_name()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let mut schema = shape::PulsedLaser::json_schema(generator);
        flattened::add_schema::<OnBody>(&mut schema, generator);
        schema
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{STEEL, block, prepare, read as from_toml, refusal};

    const PULSE: &str = "fluence = 10\nreflectivity = 0.5\npulse_duration = 1\nabsorption_depth = 0.1\nheated_surface.face = 'x-'";

    fn ready(world: &mut World) -> Box<dyn RunningCoupler> {
        let laser: PulsedLaserSource = from_toml(PULSE);
        let prepared = prepare(world, laser, |setup| {
            setup.consume(0, &keys::HEAT_SOURCE).expect("free");
        });
        prepared.expect("valid").0
    }

    #[test]
    fn the_whole_fluence_arrives_in_steps_of_any_length() {
        for steps in [1, 7, 200] {
            let mut world = World::new(vec![block([30, 1, 1], 1, STEEL)]);
            let mut laser = ready(&mut world);
            assert_eq!(laser.step_limits(0.0).longest, Some(0.25));
            let size = 40.0 / f64::from(steps);
            for s in 0..steps {
                let start = f64::from(s) * size;
                laser
                    .apply(&world, Step::new(start, size))
                    .expect("applies");
            }
            // 2 p/a J (1 - R) less exp(-4) of one half before time 0
            let expected = 0.94 / 1.992 * 5.0 * (2.0 - (-2.0 * 1.992_f64).exp());
            let reports = laser.report();
            let energy = reports.iter().find(|r| r.name == "energy.deposited");
            let energy = energy.expect("reported").value;
            // rounding of 200 differences of numbers of order 1
            assert!((energy - expected).abs() < 1e-11, "{steps} steps: {energy}");
            assert_eq!(laser.step_limits(40.0).longest, None, "the pulse is over");
        }
    }

    /// The pulse is over 40 / 1.992 durations after its peak at 2 s. What was booked survives a restart.
    #[test]
    fn steps_are_short_and_energies_kept_until_the_pulse_is_over() {
        let mut world = World::new(vec![block([30, 1, 1], 1, STEEL)]);
        let mut laser = ready(&mut world);
        let events = [1.0, 2.0].map(|after| laser.step_limits(after).next_event);
        assert_eq!(events, [Some(2.0), None]);
        let end = 2.0 + 40.0 / 1.992;
        for (until, limit) in [
            (3.0, Some(0.25)),
            (end - 0.01, Some(0.25)),
            (end + 0.01, None),
        ] {
            let step = Step::new(until - 0.5, 0.5);
            laser.apply(&world, step).expect("applies");
            assert_eq!(laser.step_limits(until).longest, limit, "{until}");
            let saved = serde_json::to_string(&laser.save(&world)).expect("serialises");
            let mut json = serde_json::Deserializer::from_str(&saved);
            let mut resumed = ready(&mut World::new(vec![block([30, 1, 1], 1, STEEL)]));
            let mut erased = <dyn erased_serde::Deserializer<'_>>::erase(&mut json);
            resumed.load(&world, &mut erased).expect("what was saved");
            assert_eq!(resumed.report(), laser.report());
            assert_eq!(resumed.step_limits(until).longest, limit);
        }
    }

    #[test]
    fn a_pulse_has_no_toolpath() {
        let text = format!("{PULSE}\ntoolpath.line.speed = 1");
        let error = toml::from_str::<PulsedLaserSource>(&text)
            .err()
            .expect("no such key");
        assert!(error.message().contains("unknown field `toolpath`"));
        let mut world = World::new(vec![block([30, 1, 1], 1, STEEL)]);
        let wrong: PulsedLaserSource = from_toml(&PULSE.replace("0.5", "1.5"));
        assert!(refusal(&mut world, wrong).starts_with("reflectivity: "));
    }
}
