//! The first of two fluids where it has frozen, such as the metal of a plate below its melt.
//!
//! A point is frozen where the first fluid has the larger part of its volume and less than half of it is liquid: `c > 1/2`, `f(T) < 1/2`. So is the rest of
//! the layer on it, points with a bond to such a one and with `c > 0.01`, `f(T) < 1/2`: a stream of gas would strip it off. Bonds of frozen points
//! carry neither volume nor momentum nor heat by the flow, so that it keeps its fraction; the divergence of its neighbours lacks these
//! bonds, and so does the gradient of their pressure, which is the exact adjoint. The fluid beside it sticks half way to it. What
//! flows with solid in it flows as a slurry, with the heat of both.
//!
//! Tension and pressure of an interface act where the first fluid is liquid: they are multiplied by the liquid part of the first fluid
//! among the neighbours,
//!
//! ```text
//! sum_j w c_j l_j / sum_j w c_j,    l = 1 where points are open with f(T) >= 1/2, else 0
//! ```
//!
//! since the gas beside a frozen surface would be driven by its steps, and by the rest of its layer that is open. See docs/theory/fluids.md, "Metal and gas".

use perimelt_core::family::Mirrored;
use perimelt_core::material::LatentHeat;
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::{Bond, BondKernel, SlotField};
use rayon::prelude::*;

use super::Projection;
use crate::fluid::rates::POINTS_PER_TASK;

/// Sums over the bonds below which there is none of the first fluid, over that of a complete family.
const NONE: f64 = 1e-9;

/// Fraction from which on a point belongs to the layer on frozen points.
const LAYER: f64 = 0.01;

/// `sum_j w g_j`, from a field g.
struct Around;

impl BondKernel<1, 1> for Around {
    #[inline(always)]
    fn bond(&self, bond: &Bond, _: [f64; 1], [other]: [f64; 1]) -> [f64; 1] {
        [bond.weight * other]
    }
}

/// `sum_j w c_j l_j` and `sum_j w c_j`, from the fraction and whether it is liquid.
struct LiquidPart;

impl BondKernel<2, 2> for LiquidPart {
    #[inline(always)]
    fn bond(&self, bond: &Bond, _: [f64; 2], [fraction, liquid]: [f64; 2]) -> [f64; 2] {
        let part = bond.weight * fraction;
        [part * liquid, part]
    }
}

/// Freezing of the first of two fluids.
#[derive(Debug)]
pub(super) struct Freezing {
    /// Temperature at which half of it is liquid, K.
    temperature: f64,
    /// Liquid part of the first fluid around each point, 0 to 1.
    pub(super) liquid_part: Vec<[f64; 1]>,
    /// By slot, kg/m³; infinite where points are frozen.
    pub(super) inertia: SlotField,
    sums: Vec<[f64; 2]>,
    /// By slot: 1 where the first fluid is liquid.
    liquid: SlotField,
    /// By slot: 1 where the first fluid has the larger part and is frozen; and the sum over the bonds.
    solid: SlotField,
    solid_around: Vec<[f64; 1]>,
}

impl Freezing {
    /// Freezing of a fluid that melts in a range of temperatures.
    pub(super) fn new(melting: &LatentHeat, points: usize) -> Self {
        Freezing {
            temperature: 0.5 * (melting.solidus + melting.liquidus),
            liquid_part: vec![[1.0]; points],
            inertia: SlotField::default(),
            sums: vec![[0.0; 2]; points],
            liquid: SlotField::default(),
            solid: SlotField::default(),
            solid_around: vec![[0.0]; points],
        }
    }
}

impl Projection {
    /// Finds which points are frozen, from their fraction now and their temperature at the start of the step.
    pub(super) fn find_frozen(&mut self) {
        let (Some(freezing), Some(phase), Some(heat)) =
            (&mut self.freezing, &self.phase, &self.heat)
        else {
            return;
        };
        let (fraction, temperature) = (&phase.fraction, heat.temperature());
        let limit = freezing.temperature;
        let solid = |i: usize| f64::from(u8::from(fraction[i] > 0.5 && temperature[i] < limit));
        freezing.solid.load(&self.family, solid, Mirrored::Scalar);
        let around = &mut freezing.solid_around;
        self.family.sum(&Around, [&freezing.solid], around);
        let hot = temperature.par_iter().with_min_len(POINTS_PER_TASK);
        hot.map(|t| *t >= limit).fill(&mut self.state.melted);
        let points = fraction.par_iter().zip(temperature).zip(&*around);
        let is_frozen = |((c, t), [solid]): ((&f64, &f64), &[f64; 1])| {
            *t < limit && (*c > 0.5 || *c > LAYER && *solid > 0.0)
        };
        let frozen = points.with_min_len(POINTS_PER_TASK).map(is_frozen);
        frozen.fill(&mut self.state.frozen);
    }

    /// Copies which points are frozen to slots, with the densities of the others (kg/m³), and finds the liquid part around each point.
    pub(super) fn load_frozen(&mut self, density: &[f64]) {
        let Some(freezing) = &mut self.freezing else {
            return;
        };
        let (family, frozen) = (&*self.family, &self.state.frozen);
        let liquid = |i: usize| f64::from(u8::from(!frozen[i] && self.state.melted[i]));
        freezing.liquid.load(family, liquid, Mirrored::Scalar);
        let open = |i: usize| f64::from(u8::from(!frozen[i]));
        self.slots.open.load(family, open, Mirrored::Scalar);
        let inertia = |i: usize| match frozen[i] {
            true => f64::INFINITY,
            false => density[i],
        };
        freezing.inertia.load(family, inertia, Mirrored::Scalar);
        let inputs: [&[f64]; 2] = [&self.slots.fraction, &freezing.liquid];
        family.sum(&LiquidPart, inputs, &mut freezing.sums);
        let least = NONE * self.complete.content;
        let points = freezing.liquid_part.par_iter_mut().zip(&freezing.sums);
        points
            .with_min_len(POINTS_PER_TASK)
            .for_all(|([part], [liquid, all])| {
                *part = match *all > least {
                    true => (liquid / all).clamp(0.0, 1.0),
                    false => 0.0,
                };
            });
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use perimelt_core::material::Material;
    use perimelt_core::{Coupler, Physics, Simulation};

    use crate::fluid::Fluid;
    use crate::fluid::tests::periodic;
    use crate::testing::{Melting, read, run, set, simulation, values};
    use crate::thermal::Thermal;

    /// An ellipse of metal in a gas, at rest or in vortices of this speed (m/s), at one temperature.
    fn metal_in_gas(speed: f64, temperature: f64, end: f64) -> Simulation {
        let gas = "density = 1\nviscosity = 0.02\nspecific_heat = 100\nconductivity = 0.05";
        let metal = "density = 20\nviscosity = 0.05\nspecific_heat = 5\nconductivity = 0.2\nsurface_tension = 0.1\n\
            solidus = 1000\nliquidus = 1040\nlatent_heat = 1000";
        let mut body = periodic(24, gas);
        let section = toml::from_str(metal).expect("a valid material");
        body.materials
            .push(Material::new("metal", section, None).expect("a valid material"));
        let fluid: Fluid = read(
            "description = 'eulerian'\nform = 'conservative'\nstate.incompressible = {}\nfluids = ['metal', 'test']",
        );
        let thermal: Thermal = read("horizon = 1");
        let physics: Vec<Box<dyn Physics>> = vec![Box::new(fluid), Box::new(thermal)];
        let couplers: Vec<Box<dyn Coupler>> = vec![Box::new(Melting {})];
        let mut s = simulation(body, physics, couplers, end);
        set(&mut s, "velocity", |[x, y, _]| {
            [speed * (TAU * y).sin(), speed * (TAU * x).sin(), 0.0]
        });
        set(&mut s, "temperature", |_| [temperature]);
        set(&mut s, "fluid_fraction", |[x, y, _]| {
            let distance = 0.25 - ((x - 0.5) / 1.3).hypot((y - 0.5) * 1.3);
            [1.0 / (1.0 + (-distance * 24.0 / 0.75).exp())]
        });
        s
    }

    fn fraction(s: &Simulation) -> Vec<f64> {
        values(s, "fluid_fraction")
    }

    fn speeds(s: &Simulation) -> Vec<f64> {
        let velocity = values(s, "velocity");
        let points = velocity.chunks(3);
        points
            .map(|v| v.iter().map(|v| v * v).sum::<f64>().sqrt())
            .collect()
    }

    /// In a stream of gas frozen points keep their metal exactly and rest; molten ones are carried away.
    #[test]
    fn gas_flows_around_what_has_frozen() {
        for (temperature, is_frozen) in [
            (900.0, true),
            (1019.0, true),
            (1021.0, false),
            (1200.0, false),
        ] {
            let mut s = metal_in_gas(1.0, temperature, 0.05);
            let before = fraction(&s);
            run(&mut s);
            let (after, speeds) = (fraction(&s), speeds(&s));
            let inside = || (0..before.len()).filter(|i| before[*i] > 0.5);
            let moved = inside()
                .map(|i| (after[i] - before[i]).abs())
                .fold(0.0, f64::max);
            let fastest = inside().map(|i| speeds[i]).fold(0.0, f64::max);
            if is_frozen {
                assert_eq!([moved, fastest], [0.0; 2], "{temperature}");
            } else {
                assert!(
                    moved > 0.01 && fastest > 0.3,
                    "{temperature}: {moved} {fastest}"
                );
            }
            assert!(speeds.iter().all(|v| *v < 2.0) && speeds.iter().any(|v| *v > 0.2));
            for (name, balances) in s.balances() {
                for balance in balances.iter().filter(|b| {
                    ["mass", "first_fluid.volume", "heat"].contains(&b.quantity.as_str())
                }) {
                    assert!(
                        balance.relative_error().abs() < 1e-12,
                        "{name:?} {balance:?}"
                    );
                }
            }
            // the slope of the enthalpy changes twentyfold where the metal melts
            let deviation = values(&s, "temperature")
                .iter()
                .map(|t| (t / temperature - 1.0).abs())
                .fold(0.0, f64::max);
            assert!(deviation < 1e-9, "{temperature}: {deviation}");
        }
    }

    /// The tension of a frozen surface drives nothing, whatever its shape.
    #[test]
    fn the_tension_of_a_frozen_surface_is_none() {
        for (temperature, least, most) in [(900.0, 0.0, 1e-12), (1200.0, 1e-3, 1.0)] {
            let mut s = metal_in_gas(0.0, temperature, 0.05);
            run(&mut s);
            let fastest = speeds(&s).into_iter().fold(0.0, f64::max);
            assert!(
                (least..=most).contains(&fastest),
                "{temperature}: {fastest}"
            );
        }
    }
}
