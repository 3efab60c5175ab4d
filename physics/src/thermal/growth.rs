//! Heat of a body that grows: births of points, and the heat and mass that deposition adds and cutting removes.
//!
//! A coupler makes points active ([`perimelt_core::world::activity`]). A point is *born* when this physics includes it: it gets the
//! temperature at which its material is deposited and the enthalpy at that temperature, which the account of the heat
//! counts as supplied. Points that are not born have no bonds and no heat sources, and do not count in the balances.

use std::borrow::Cow;

use perimelt_core::body::Sizes;
use perimelt_core::material::EnthalpyCurve;
use perimelt_core::solver::ExactSum;
use perimelt_core::world::BodyIndex;
use perimelt_core::{
    ActivityChanges, Balance, LoadError, ReadIfProvided, Report, Setup, SetupError, World, Write,
    keys,
};
use serde::{Deserialize, Serialize};

use super::run::HeatAccount;

/// State of thermal points that are added or cut off.
#[derive(Debug)]
pub(super) struct Growth {
    body: BodyIndex,
    birth_temperature: ReadIfProvided<f64>,
    /// Mass of each point, kg.
    mass: Vec<f64>,
    pub(super) state: Born,
    /// Version of the family for which the sums over bonds were found.
    pub(super) row_sums_of: Option<u64>,
}

/// Points that are born, with the heat and mass that were deposited less those cut off.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Born {
    /// Points that are born.
    born: ActivityChanges,
    /// Heat, J.
    heat: f64,
    /// Mass at the start, and mass added since, kg.
    mass: [f64; 2],
}

/// Temperature (K) and enthalpy (J/m³) of the points.
pub(super) struct HeatState {
    pub(super) temperature: Write<f64>,
    pub(super) enthalpy: Write<f64>,
}

impl Growth {
    pub(super) fn prepare(setup: &mut Setup<'_>, body: BodyIndex) -> Result<Growth, SetupError> {
        let birth_temperature = setup.read_if_provided(body, &keys::BIRTH_TEMPERATURE)?;
        let density = setup.world().density_at_points(body)?;
        let volume = &setup.body(body).points.volume;
        Ok(Growth {
            body,
            birth_temperature,
            mass: density
                .iter()
                .zip(volume.each())
                .map(|(d, v)| d * v)
                .collect(),
            state: Born {
                born: ActivityChanges::none(volume.count()),
                ..Born::default()
            },
            row_sums_of: None,
        })
    }

    /// Marks points that have material at the start as born.
    pub(super) fn start(&mut self, world: &World) {
        self.state = Born {
            born: ActivityChanges::until_now(world, self.body),
            ..Born::default()
        };
        self.state.mass[0] = self.total_mass(world);
    }

    /// The state of the points of all processes. Collective.
    pub(super) fn save(&self, world: &World) -> Born {
        Born {
            born: self.state.born.of_whole(world, self.body),
            ..self.state
        }
    }

    /// Takes what [`Growth::save`] gave.
    pub(super) fn load(&mut self, world: &World, saved: Born) -> Result<(), LoadError> {
        self.state = Born {
            born: saved.born.of_part(world, self.body)?,
            ..saved
        };
        Ok(())
    }

    /// Whether a point is born.
    pub(super) fn is_born(&self, point: usize) -> bool {
        self.state.born.is_active(point)
    }

    /// Mass of the points that are born, kg.
    fn total_mass(&self, world: &World) -> f64 {
        let mass = |point: usize| {
            [if self.is_born(point) {
                self.mass[point]
            } else {
                0.0
            }]
        };
        world.reducer(self.body).sum_points(mass)[0]
    }

    /// Volumes of the points, zero where they are not born, m³.
    pub(super) fn volumes(&self, volume: &Sizes) -> Sizes {
        let points = self.state.born.active().iter().zip(volume.each());
        let born = points.map(|(b, v)| if *b { v } else { 0.0 });
        born.collect::<Vec<_>>().into()
    }

    /// Marks active points as born and others as removed; returns whether any point changed.
    pub(super) fn take_births(
        &mut self,
        world: &World,
        curves: &[EnthalpyCurve],
        state: &HeatState,
        account: &mut HeatAccount,
    ) -> bool {
        let Some(changed) = self.state.born.since_last(world, self.body) else {
            return false;
        };
        let body = world.body(self.body);
        let birth_temperature = world.read_if_provided(self.birth_temperature);
        let mut temperature = world.write(state.temperature);
        let mut enthalpy = world.write(state.enthalpy);
        let reducer = world.reducer(self.body);
        let [mut heat, mut mass] = [ExactSum::default(), ExactSum::default()];
        for point in changed {
            let point = point as usize;
            let is_born = self.state.born.is_active(point);
            if is_born {
                let curve = &curves[body.material_of_point[point] as usize];
                if let Some(birth_temperature) = &birth_temperature {
                    temperature[point] = birth_temperature[point];
                }
                enthalpy[point] = curve.enthalpy(temperature[point]);
            }
            if point < reducer.owned() {
                let sign = if is_born { 1.0 } else { -1.0 };
                heat.add(sign * body.points.volume[point] * enthalpy[point]);
                mass.add(sign * self.mass[point]);
            }
        }
        let heat = reducer.total(heat);
        self.state.heat += heat;
        self.state.mass[1] += reducer.total(mass);
        account.supply(heat);
        true
    }

    /// Values of a consumed field, zero at points that are not born.
    pub(super) fn masked<'a>(&self, values: &'a [f64]) -> Cow<'a, [f64]> {
        let points = values.iter().zip(self.state.born.active());
        let idle = |(v, born): (&f64, &bool)| *born || *v == 0.0;
        match points.clone().all(idle) {
            true => Cow::Borrowed(values),
            false => Cow::Owned(points.map(|(v, b)| if *b { *v } else { 0.0 }).collect()),
        }
    }

    pub(super) fn mass_balance(&self, world: &World) -> Balance {
        let [initial, deposited] = self.state.mass;
        let stored = self.total_mass(world);
        let balance = Balance::new("mass", "kg", stored, initial, deposited);
        balance.of_size(stored).with_deposited(deposited)
    }

    /// Heat deposited since the start, J.
    pub(super) fn deposited_heat(&self) -> f64 {
        self.state.heat
    }

    pub(super) fn reports(&self) -> [Report; 1] {
        [Report::new("heat.deposited", "J", self.state.heat)]
    }
}
