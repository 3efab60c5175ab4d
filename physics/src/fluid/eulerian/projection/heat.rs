//! Heat that a fluid that keeps its volume, or two of them, carry from point to point.
//!
//! ```text
//! dh_i = -dt sum_j [C_ij (e_1i + e_1j)/2 + (U_ij - C_ij) (e_2i + e_2j)/2] + (c'_i - c_i) [h_1(T_0) - h_2(T_0)]
//! e_k  = h_k(T) - h_k(T_0)
//! ```
//!
//! with the fluxes U of volume and C of the first fluid that carry the fraction c in the same step: fluxes of enthalpy are opposite at the
//! two ends of each bond, so that heat is conserved to rounding, and a uniform temperature T_0 stays exactly uniform, however exactly
//! the pressure was found. Where the first fluid is a metal that freezes, the gas takes the enthalpy of the end which it leaves, and so does the metal to
//! the degree that one end lacks it: gas heats and cools by thousands of kelvin from point to point, and a mean of both ends would take heat
//! from points that have none. T_0 is the mean temperature, T that in the middle of the step. `thermal` takes up the amounts dh.

use perimelt_core::family::Mirrored;
use perimelt_core::material::EnthalpyCurve;
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::solver::reduce::sum;
use perimelt_core::{Body, Bond, BondKernel, Family, SlotField};
use rayon::prelude::*;

use super::Projection;
use super::kernels::{Carry, Inputs, Layer};
use super::thermocapillary::SurfaceLaws;
use crate::fluid::rates::POINTS_PER_TASK;
use crate::heat_content::{HeatContent, Mixture};

/// Heat that flows out of a point, W/m³, from the inputs of [`Carry`] and the enthalpies `e_1`, `e_2`.
struct CarryHeat<const D: usize> {
    carry: Carry<D>,
    /// 1 between metal and gas, else 0.
    upwind: f64,
}

impl<const D: usize> CarryHeat<D> {
    const FIRST: usize = Inputs::<D>::CARRY;
    const SECOND: usize = Self::FIRST + 1;
    const COUNT: usize = Self::SECOND + 1;
}

impl<const D: usize, const I: usize> BondKernel<I, 1> for CarryHeat<D> {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; I], other: [f64; I]) -> [f64; 1] {
        let fluxes = self.carry.fluxes(bond, &own, &other);
        let second = 2.0 * fluxes.half_volume - fluxes.first;
        let fraction = Inputs::<D>::FRACTION;
        let least = own[fraction].min(other[fraction]).clamp(0.0, 1.0);
        let of_first = carried(
            fluxes.first,
            self.upwind * (1.0 - least),
            [own[Self::FIRST], other[Self::FIRST]],
        );
        let of_second = carried(
            second,
            self.upwind,
            [own[Self::SECOND], other[Self::SECOND]],
        );
        [of_first + of_second]
    }
}

/// Heat that a flux from the first to the second of two ends carries: with the mean of the enthalpies of both, and with the part `upwind`
/// that of the end which it leaves.
#[inline(always)]
fn carried(flux: f64, upwind: f64, [own, other]: [f64; 2]) -> f64 {
    0.5 * flux * (own + other - upwind.copysign(flux) * (other - own))
}

const INPUTS_2D: usize = CarryHeat::<2>::COUNT;
const INPUTS_3D: usize = CarryHeat::<3>::COUNT;

/// What a fluid needs whose temperature is known.
#[derive(Debug)]
pub(in crate::fluid) struct HeatedFluid {
    /// Enthalpy by material.
    pub(in crate::fluid) curves: Vec<EnthalpyCurve>,
    pub(in crate::fluid) surfaces: SurfaceLaws,
}

/// Heat of the points during a step.
#[derive(Debug)]
pub(in crate::fluid) struct FlowHeat {
    matter: Matter,
    /// At the start of the step, by point, K and J/m³, and their mean temperature.
    temperature: Vec<f64>,
    enthalpy: Vec<f64>,
    mean: f64,
    /// Temperature (K) and fraction of the first fluid for which the fluxes are found.
    middle: Vec<f64>,
    fraction: Vec<f64>,
    /// `e_1`, `e_2` by slot.
    excess: [SlotField; 2],
    /// W/m³.
    outflow: Vec<[f64; 1]>,
    /// What the points got in the step, J/m³.
    carried: Vec<f64>,
}

/// Materials of the points.
#[derive(Debug)]
struct Matter {
    curves: Vec<EnthalpyCurve>,
    material: Vec<u16>,
    /// Of two fluids.
    materials: Option<[u16; 2]>,
}

impl Matter {
    fn content<'a>(&'a self, fraction: &'a [f64]) -> HeatContent<'a> {
        HeatContent {
            curves: &self.curves,
            material: &self.material,
            mixture: self.materials.map(|materials| Mixture {
                materials,
                fraction,
            }),
        }
    }
}

impl FlowHeat {
    /// Heat of a body with the enthalpies of its materials, two of which flow where there are two fluids.
    pub(in crate::fluid) fn new(
        curves: Vec<EnthalpyCurve>,
        materials: Option<[u16; 2]>,
        body: &Body,
    ) -> Self {
        let points = body.points.len();
        FlowHeat {
            matter: Matter {
                curves,
                material: body.material_of_point.clone(),
                materials,
            },
            temperature: vec![0.0; points],
            enthalpy: vec![0.0; points],
            mean: 0.0,
            middle: vec![0.0; points],
            fraction: vec![0.0; points],
            excess: Default::default(),
            outflow: vec![[0.0]; points],
            carried: vec![0.0; points],
        }
    }

    /// Takes temperatures (K) and enthalpies (J/m³) at the start of a step.
    pub(in crate::fluid) fn start(&mut self, temperature: &[f64], enthalpy: &[f64]) {
        self.temperature.copy_from_slice(temperature);
        self.enthalpy.copy_from_slice(enthalpy);
        self.middle.copy_from_slice(temperature);
        self.mean = sum(temperature) / temperature.len() as f64;
    }

    /// At the start of the step, K.
    pub(super) fn temperature(&self) -> &[f64] {
        &self.temperature
    }

    /// What the points got in the last step, J/m³.
    pub(in crate::fluid) fn carried(&self) -> &[f64] {
        &self.carried
    }

    /// Copies `e_1` and `e_2` at the temperatures in the middle to slots.
    fn load(&mut self, family: &Family) {
        let content = self.matter.content(&self.fraction);
        let (middle, mean) = (&self.middle, self.mean);
        for (fluid, slots) in self.excess.iter_mut().enumerate() {
            let of = |point: usize| {
                let [now, before] =
                    [middle[point], mean].map(|t| content.of_fluids(point, t)[fluid]);
                now - before
            };
            slots.load(family, of, Mirrored::Scalar);
        }
    }

    /// Finds what the points got in a time (s), by the change of the fraction of the first fluid.
    fn find_gains(&mut self, time: f64, change: impl Fn(usize) -> f64 + Sync) {
        let content = self.matter.content(&self.fraction);
        let [first, second] = content.of_fluids(0, self.mean);
        let jump = first - second;
        let points = self.carried.par_iter_mut().zip(&self.outflow);
        let points = points.enumerate().with_min_len(POINTS_PER_TASK);
        points.for_all(|(i, (carried, [outflow]))| *carried = change(i) * jump - time * outflow);
    }

    /// Finds the temperatures in the middle from what the points got until then.
    fn find_middle(&mut self) {
        let content = self.matter.content(&self.fraction);
        let points = self.middle.par_iter_mut().zip(&self.enthalpy);
        let points = points.zip(&self.carried).enumerate();
        points
            .with_min_len(POINTS_PER_TASK)
            .for_all(|(i, ((temperature, enthalpy), carried))| {
                *temperature = content.temperature(i, enthalpy + carried, *temperature);
            });
    }
}

impl Projection {
    /// Finds the heat that the fluxes of the last step carry in `dt` (s), after they have advanced the fraction of the first fluid.
    pub(super) fn carry_heat(&mut self, dt: f64, layer: Layer) {
        let Some(mut heat) = self.heat.take() else {
            return;
        };
        match self.dimension {
            2 => self.find_heat::<2, INPUTS_2D>(&mut heat, dt, layer),
            _ => self.find_heat::<3, INPUTS_3D>(&mut heat, dt, layer),
        }
        self.heat = Some(heat);
    }

    fn find_heat<const D: usize, const I: usize>(
        &self,
        heat: &mut FlowHeat,
        dt: f64,
        layer: Layer,
    ) {
        let volume = self.volume::<D>(self.state.step);
        let kernel = CarryHeat {
            carry: Carry { volume, layer },
            upwind: f64::from(u8::from(self.freezing.is_some())),
        };
        let phase = self.phase.as_ref();
        let before = |point: usize| self.slots.fraction[self.slot[point] as usize];
        let change = |point: usize| phase.map_or(0.0, |p| p.fraction[point] - before(point));
        if phase.is_some() {
            let fraction = heat.fraction.par_iter_mut().enumerate();
            let fraction = fraction.with_min_len(POINTS_PER_TASK);
            fraction.for_all(|(point, c)| *c = before(point) + 0.5 * change(point));
        }
        self.sum_heat::<D, I>(&kernel, heat);
        heat.find_gains(0.5 * dt, |point| 0.5 * change(point));
        heat.find_middle();
        self.sum_heat::<D, I>(&kernel, heat);
        heat.find_gains(dt, change);
    }

    /// Sums the heat that flows out of the points at the temperatures in the middle.
    fn sum_heat<const D: usize, const I: usize>(&self, kernel: &CarryHeat<D>, heat: &mut FlowHeat) {
        heat.load(&self.family);
        let mut all = self.slots.all().chain(&heat.excess);
        let inputs: [&[f64]; I] =
            std::array::from_fn(|_| all.next().map_or(&[][..], |slots| &slots[..]));
        self.family.sum(kernel, inputs, &mut heat.outflow);
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use perimelt_core::Simulation;
    use perimelt_core::material::Material;

    use crate::fluid::Fluid;
    use crate::fluid::tests::periodic;
    use crate::testing::{material, read, run, set, simulation, values};
    use crate::thermal::Thermal;

    /// A drop in a fluid of half its density and a fifth of its heat capacity, in a box of vortices whose pressure is found roughly.
    fn drop_in_vortices(temperature: impl Fn(f64) -> f64) -> Simulation {
        let gas = "density = 1\nviscosity = 0.01\nspecific_heat = 2\nconductivity = 0.05";
        let liquid = "density = 2\nviscosity = 0.02\nspecific_heat = 5\nconductivity = 0.2\nsurface_tension = 0";
        let mut body = periodic(24, gas);
        let section = toml::from_str(liquid).expect("a valid material");
        body.materials
            .push(Material::new("drop", section, None).expect("a valid material"));
        assert_eq!(material(gas).name(), "test");
        let fluid: Fluid = read(
            "description = 'eulerian'\nform = 'conservative'\nstate.incompressible = { tolerance = 1e-2 }\nfluids = ['drop', 'test']",
        );
        let thermal: Thermal = read("");
        let physics: Vec<Box<dyn perimelt_core::Physics>> =
            vec![Box::new(fluid), Box::new(thermal)];
        let mut s = simulation(body, physics, vec![], 0.2);
        set(&mut s, "velocity", |[x, y, _]| {
            [1.0 + 0.5 * (TAU * y).sin(), 0.5 * (TAU * x).sin(), 0.0]
        });
        set(&mut s, "temperature", |[x, ..]| [temperature(x)]);
        set(&mut s, "fluid_fraction", |[x, y, _]| {
            let distance = 0.25 - (x - 0.5).hypot(y - 0.5);
            [1.0 / (1.0 + (-distance * 24.0 / 0.75).exp())]
        });
        s
    }

    /// However roughly the pressure was found.
    #[test]
    fn two_fluids_of_one_temperature_keep_it() {
        let mut s = drop_in_vortices(|_| 900.0);
        run(&mut s);
        for t in values(&s, "temperature") {
            // rounding of enthalpies relative to 293 K in some fifty steps
            assert!((t / 900.0 - 1.0).abs() < 1e-11, "{t}");
        }
    }

    #[test]
    fn two_fluids_keep_their_heat() {
        let mut s = drop_in_vortices(|x| 600.0 + 200.0 * (TAU * x).sin());
        run(&mut s);
        let balances = s.balances();
        let mut all = balances.iter().flat_map(|(_, all)| all);
        let heat = all.find(|b| b.quantity == "heat").expect("of thermal");
        assert!(heat.error().abs() < 1e-13 * heat.stored, "{heat:?}");
        let temperature = values(&s, "temperature");
        let largest = temperature.iter().copied().fold(0.0, f64::max);
        let least = temperature.iter().copied().fold(f64::INFINITY, f64::min);
        assert!(least > 395.0 && largest < 805.0, "{least} {largest}");
    }

    /// A hot spot goes with the stream, and with it the heat.
    #[test]
    fn a_stream_carries_a_hot_spot() {
        let keys = "density = 1\nviscosity = 1e-3\nspecific_heat = 1\nconductivity = 1e-4";
        let fluid: Fluid =
            read("description = 'eulerian'\nform = 'conservative'\nstate.incompressible = {}");
        let thermal: Thermal = read("");
        let physics: Vec<Box<dyn perimelt_core::Physics>> =
            vec![Box::new(fluid), Box::new(thermal)];
        let mut s = simulation(periodic(32, keys), physics, vec![], 0.25);
        set(&mut s, "velocity", |_| [1.0, 0.0, 0.0]);
        set(&mut s, "temperature", |[x, y, _]| {
            [1.0 + (-((x - 0.3).powi(2) + (y - 0.5).powi(2)) / 0.02).exp()]
        });
        let middle = |s: &Simulation| {
            let places = s.world().body(0).points.position.iter();
            let (mut sum, mut moment) = (0.0, 0.0);
            for (x, t) in places.zip(values(s, "temperature")) {
                sum += t - 1.0;
                moment += (t - 1.0) * x.x;
            }
            (sum, moment / sum)
        };
        let before = middle(&s);
        run(&mut s);
        let after = middle(&s);
        // the speed of the gradient of a smooth spot is exact to a few per mille
        assert!((after.1 - before.1 - 0.25).abs() < 2e-3, "{after:?}");
        assert!((after.0 / before.0 - 1.0).abs() < 1e-10, "{after:?}");
    }
}
