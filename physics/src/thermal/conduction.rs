//! The conduction operator: the divergence of the heat flux at the points of a body, in one of two forms.
//!
//! ```text
//! bonds               sum_j kappa_ij v V_j (T_j - T_i) / |xi|,   kappa_ij = 2 k_ij / M
//! second derivatives  k lap T + grad k . grad T
//! ```
//!
//! The conductivity of a bond within a material is the mean over the temperatures between its ends,
//! `k_ij (T_j - T_i) = Theta(T_j) - Theta(T_i)` with the [`HeatPotential`] Theta: where the conductivity jumps at a
//! melting front, the front lies within the bond. The mean of the ends, `(k_i + k_j) / 2` (Wang (2025),
//! eqs. 6.19, 6.20), gives the bond that contains the front the conductivity of the wrong phase, so that fronts lag by half a
//! spacing. Between materials the parts of a bond conduct in series ([`interfaces`](super::interfaces)); in the ordinary form
//! its conductivity is the mean of the ends.

mod at_points;
mod change;
mod derivatives;
mod load;
mod ply_flow;
mod row_sums;

use std::sync::Arc;

use nalgebra::Vector3;
use perimelt_core::body::Layers;
use perimelt_core::device::DeviceKernel;
use perimelt_core::family::LayerRule;
use perimelt_core::material::{EnthalpyCurve, HeatPotential, Property};
use perimelt_core::solver::reduce::max_abs;
use perimelt_core::solver::{ExactSum, Reducer};
use perimelt_core::{
    Body, Bond, BondKernel, BrokenBonds, Derivatives, Family, Number, Pddo, SlotField,
};
use rayon::prelude::*;

use super::conductivity::Directions;
use super::interfaces::{Across, Interfaces, MaterialPoints, Mixed};
use super::mixture::{MixedConductivity, MixedFluids};
use super::phases::{ConductingPhase, Series};
use super::plies::ConductingPlies;
use super::states::{OrdinaryState, StateFlow};
use derivatives::SecondDerivatives;
pub(super) use ply_flow::PlyBonds;
use ply_flow::{MixedPlies, PlyFlow};

/// The conduction operator with its work arrays.
#[derive(Debug)]
pub(super) struct Conduction {
    conductivity: Vec<Property>,
    /// Largest conductivity of each material, W/(m K).
    largest: Vec<f64>,
    uniform: Option<f64>,
    /// Factor of the conductivities of bonds with which a complete family conducts exactly.
    calibration: f64,
    derivatives: Option<SecondDerivatives>,
    /// Moments and gradients, in the ordinary form.
    states: Option<OrdinaryState>,
    /// Directions of conductivities, in the ordinary form.
    directions: Option<Directions>,
    temperature_slots: SlotField,
    conductivity_slots: SlotField,
    conductivity_field: Vec<f64>,
    /// Heat potential of each material, where conductivities depend on the temperature.
    potentials: Vec<HeatPotential>,
    /// Heat potential by slot, W/m.
    potential_slots: SlotField,
    potential_field: Vec<f64>,
    /// Fields of layer points by slot, taken from the points that they mirror.
    mirrored: MirroredFields,
    /// The conductivity for which slots were loaded last.
    loaded: BondConductivity,
    /// Powder, where the body has some.
    powder: Option<ConductingPhase>,
    /// Austenite, where a `metallurgy` provides its fraction.
    austenite: Option<ConductingPhase>,
    /// Two fluids, where there are two of different conductivities.
    fluids: Option<MixedConductivity>,
    /// Plies of a lay-up.
    plies: Option<PlyFlow>,
    /// Interfaces in the form of bonds, where the body has several materials and no powder.
    interfaces: Option<Interfaces>,
    /// Slots of layer points with temperatures of their own, K.
    layers: Vec<(u32, f64)>,
    /// Bonds that no longer conduct.
    pub(super) broken: Option<BrokenBonds>,
    /// Heat that flows to each point as last evaluated, W/m³.
    pub(super) rate: Vec<[f64; 1]>,
}

/// Fields by slot; layer points have the values of the points that they mirror.
#[derive(Debug, Default)]
struct MirroredFields {
    /// Temperature, K.
    temperature: SlotField,
    material: SlotField,
}

/// How the conductivity of bonds is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum BondConductivity {
    /// One conductivity.
    Uniform,
    /// The conductivities of their ends, whose halves conduct in series; second derivatives take their gradient.
    Ends,
    /// The conductivities of their ends, whose parts on both sides of an interface conduct in series.
    Across,
    /// The potential of the one material.
    Potential,
    /// The potential within a material; conductivities as in `Across` between materials.
    Mixed,
    /// The conductivities and gradients of their ends, in the ordinary form.
    States,
    /// The potentials of the three conductivities of plies, of one material or several.
    Plies,
}

/// Kernels with their fields by slot: temperatures (K) or potentials (W/m); temperatures and conductivities (W/(m K)); both
/// with distances from interfaces (m); all of these with materials; the state of the ordinary form.
enum KernelInputs<'a> {
    One(BondConduction, [&'a [f64]; 1]),
    Series([&'a [f64]; 2]),
    Across([&'a [f64]; 3]),
    Mixed([&'a [f64]; 5]),
    States(StateFlow, [&'a [f64]; 5]),
    Plies([&'a [f64]; 3]),
    PliesOfMaterials([&'a [f64]; 9]),
}

/// Family, boundary rules and materials of a body.
#[derive(Clone, Copy)]
pub(super) struct Matter<'a> {
    pub(super) family: &'a Family,
    /// Continuation of the temperature behind faces.
    pub(super) rules: &'a [LayerRule],
    pub(super) material: &'a [u16],
    pub(super) curves: &'a [EnthalpyCurve],
    pub(super) points: &'a Reducer,
}

/// Conduction with one conductivity, W/(m K), or by a potential (W/m) with a conductivity of one; the
/// micro-conductivity is `2 k / M`, and weights of bonds hold the `1 / M`.
#[derive(Clone, Copy, Debug)]
pub struct BondConduction {
    /// W/(m K).
    pub conductivity: f64,
}

impl BondKernel<1, 1> for BondConduction {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; 1], other: [f64; 1]) -> [f64; 1] {
        self.bond_of(bond, own, other)
    }
}

impl DeviceKernel<1, 1> for BondConduction {
    #[inline(always)]
    fn bond_of<N: Number>(&self, bond: &Bond<N>, [own]: [N; 1], [other]: [N; 1]) -> [N; 1] {
        let over_difference = bond.mean() * (2.0 * self.conductivity) * bond.inverse_length;
        [over_difference * (other - own)]
    }
}

/// Heat that a bond carries to its point, over conductivity and difference of temperatures, 1/m².
pub(super) fn coefficient(bond: &Bond) -> f64 {
    let [heat] = BondConduction { conductivity: 1.0 }.bond(bond, [0.0], [1.0]);
    heat
}

impl Conduction {
    /// Conduction by bonds, whose conductivities are multiplied by `calibration`.
    pub(super) fn by_bonds(
        family: &Family,
        conductivity: Vec<Property>,
        points: usize,
        calibration: f64,
    ) -> Self {
        let uniform = Property::common(&conductivity);
        let varying = if uniform.is_some() { 0 } else { points };
        let has_interfaces = uniform.is_none() && conductivity.len() > 1;
        Conduction {
            largest: conductivity.iter().map(|k| max_abs(&k.values())).collect(),
            conductivity,
            uniform,
            calibration,
            derivatives: None,
            states: None,
            directions: None,
            temperature_slots: SlotField::zeros(family),
            conductivity_slots: SlotField::default(),
            conductivity_field: vec![0.0; varying],
            potentials: Vec::new(),
            potential_slots: SlotField::default(),
            potential_field: Vec::new(),
            mirrored: MirroredFields::default(),
            loaded: BondConductivity::Uniform,
            powder: None,
            austenite: None,
            fluids: None,
            plies: None,
            interfaces: has_interfaces.then(|| Interfaces::new(points)),
            layers: Vec::new(),
            broken: None,
            rate: vec![[0.0]; points],
        }
    }

    /// Conduction by the bonds of plies.
    pub(super) fn by_plies(body: &Body, layers: &Layers, plies: &ConductingPlies) -> Self {
        let points = body.points.len();
        let mut conduction = Conduction::by_bonds(&plies.family, Vec::new(), points, 1.0);
        conduction.plies = Some(PlyFlow::new(plies, layers));
        conduction
    }

    /// Conduction by second derivatives.
    pub(super) fn by_derivatives(
        pddo: Arc<Pddo>,
        conductivity: Vec<Property>,
        points: usize,
    ) -> Self {
        let mut conduction = Conduction::by_bonds(pddo.family(), conductivity, points, 1.0);
        conduction.interfaces = None;
        conduction.derivatives = Some(SecondDerivatives {
            pddo,
            work: Derivatives::default(),
            temperature: Vec::new(),
            conductivity: Vec::new(),
        });
        conduction
    }

    /// Selects the ordinary form, with this stabilisation and the directions of conductivities, if they have any.
    pub(super) fn set_states(
        &mut self,
        body: &Body,
        stabilisation: f64,
        directions: Option<Directions>,
    ) {
        self.interfaces = None;
        if let Some(directions) = directions {
            self.uniform = None;
            let materials = 0..self.conductivity.len();
            self.largest = materials.map(|m| directions.largest(m)).collect();
            self.directions = Some(directions);
        }
        self.states = Some(OrdinaryState::new(body, stabilisation));
    }

    /// Turns the directions of conductivities by rotation vectors of the points, rad.
    pub(super) fn set_orientation(&mut self, orientation: &[Vector3<f64>]) {
        if let Some(directions) = &mut self.directions {
            directions.set_orientation(orientation);
        }
    }

    /// Adds powder with these conductivities by material.
    pub(super) fn set_powder(&mut self, conductivity: Vec<Property>) {
        self.uniform = None;
        self.interfaces = None;
        let points = self.rate.len();
        self.conductivity_field = vec![0.0; points];
        for (largest, powder) in self.largest.iter_mut().zip(&conductivity) {
            *largest = largest.max(max_abs(&powder.values()));
        }
        self.powder = Some(ConductingPhase::new(conductivity, points));
    }

    /// Adds two fluids.
    pub(super) fn set_fluids(&mut self, fluids: &MixedFluids, curves: &[EnthalpyCurve]) {
        if self.uniform.is_some() {
            return;
        }
        self.interfaces = None;
        let largest = fluids.materials.map(|m| self.largest[m as usize]);
        self.largest.fill(largest[0].max(largest[1]));
        let mixed = MixedConductivity::new(fluids, curves, largest, self.rate.len());
        self.fluids = Some(mixed);
    }

    /// Largest conductivities of two fluids over that of both; 1 where they are the same.
    pub(super) fn fluid_ratios(&self) -> [f64; 2] {
        let largest = self.fluids.as_ref().map(MixedConductivity::largest);
        largest.map_or([1.0; 2], |[first, second]| {
            let both = first.max(second);
            [first / both, second / both]
        })
    }

    /// Sets the fraction of the first of two fluids.
    pub(super) fn mix(&mut self, fraction: &[f64]) {
        if let Some(fluids) = &mut self.fluids {
            fluids.set_fraction(fraction);
        }
    }

    /// Sets which points are powder (0) and which are dense (1).
    pub(super) fn consolidate(&mut self, consolidated: &[f64]) {
        if let Some(powder) = &mut self.powder {
            powder.set_fraction(consolidated.iter().map(|dense| 1.0 - dense));
        }
    }

    /// Sets the fraction of austenite at each point and its conductivities by material.
    pub(super) fn set_austenite(&mut self, conductivity: &[Property], fraction: &[f64]) {
        if self.austenite.is_none() {
            self.uniform = None;
            self.interfaces = None;
            for (largest, austenite) in self.largest.iter_mut().zip(conductivity) {
                *largest = largest.max(max_abs(&austenite.values()));
            }
        }
        let new = || ConductingPhase::new(conductivity.to_vec(), fraction.len());
        let austenite = self.austenite.get_or_insert_with(new);
        austenite.set_fraction(fraction.iter().copied());
    }

    /// Finds the distances of points from interfaces, if there are any: of all points, or of those that `changed` in a
    /// growing family.
    pub(super) fn find_interfaces(
        &mut self,
        family: &Family,
        points: MaterialPoints<'_>,
        changed: Option<&[u32]>,
        reducer: &Reducer,
    ) {
        match (&mut self.interfaces, changed) {
            (Some(interfaces), Some(changed)) => {
                interfaces.find_some(family, points, changed, reducer)
            }
            (Some(interfaces), None) => interfaces.find(family, points, reducer),
            (None, _) => {}
        }
    }

    /// Whether the heat flow of each bond depends on the states of its two ends only.
    pub(super) fn is_by_bonds(&self) -> bool {
        self.derivatives.is_none() && self.states.is_none()
    }

    /// Whether heat is conserved to rounding.
    pub(super) fn is_conservative(&self) -> bool {
        self.derivatives.is_none()
    }

    /// Slots and temperatures (K) of layer points that do not continue the body; for bodies of one material.
    pub(super) fn layers_mut(&mut self) -> &mut Vec<(u32, f64)> {
        &mut self.layers
    }

    /// The field by slot to whose differences the heat of bonds is proportional, and its factor, from what was loaded, for
    /// bodies of one material in the form of bonds: with [`coefficient`] they give W/m³.
    pub(super) fn linear_input(&self) -> (&[f64], f64) {
        match self.loaded {
            BondConductivity::Potential => (&self.potential_slots, 1.0),
            _ => {
                let conductivity = self.calibration * self.uniform.unwrap_or_default();
                (&self.temperature_slots, conductivity)
            }
        }
    }

    /// Heat that flows to each point, W/m³, from what was loaded.
    pub(super) fn flow(&mut self, matter: &Matter<'_>) {
        if self.derivatives.is_some() {
            return self.flow_by_derivatives();
        }
        let mut rate = std::mem::take(&mut self.rate);
        let (family, broken) = (matter.family, self.broken.as_ref());
        match self.inputs() {
            KernelInputs::One(kernel, inputs) => {
                family.sum_unbroken(&kernel, inputs, broken, &mut rate);
            }
            KernelInputs::Series(inputs) => family.sum_unbroken(&Series, inputs, broken, &mut rate),
            KernelInputs::Across(inputs) => family.sum_unbroken(&Across, inputs, broken, &mut rate),
            KernelInputs::Mixed(inputs) => family.sum_unbroken(&Mixed, inputs, broken, &mut rate),
            KernelInputs::States(kernel, inputs) => {
                family.sum_unbroken(&kernel, inputs, broken, &mut rate);
            }
            KernelInputs::Plies(inputs) => {
                family.sum_unbroken(&PlyBonds, inputs, broken, &mut rate);
            }
            KernelInputs::PliesOfMaterials(inputs) => {
                family.sum_unbroken(&MixedPlies, inputs, broken, &mut rate);
            }
        }
        self.rate = rate;
    }

    /// The kernel for what was loaded, with its fields.
    fn inputs(&self) -> KernelInputs<'_> {
        let temperature = &self.temperature_slots[..];
        let (conductivity, potential) = (&self.conductivity_slots[..], &self.potential_slots[..]);
        let distance = self.interfaces.as_ref().map_or(&[][..], Interfaces::slots);
        match self.loaded {
            BondConductivity::Uniform => {
                let conductivity = self.calibration * self.uniform.unwrap_or_default();
                KernelInputs::One(BondConduction { conductivity }, [temperature])
            }
            BondConductivity::Potential => {
                KernelInputs::One(BondConduction { conductivity: 1.0 }, [potential])
            }
            BondConductivity::Ends => KernelInputs::Series([temperature, conductivity]),
            BondConductivity::Across => KernelInputs::Across([temperature, conductivity, distance]),
            BondConductivity::States => {
                let states = self.states.as_ref().expect("loaded from them");
                let (kernel, inputs) = states.flow(temperature, conductivity);
                KernelInputs::States(kernel, inputs)
            }
            BondConductivity::Plies => {
                let plies = self.plies.as_ref().expect("loaded from them");
                plies.inputs()
            }
            BondConductivity::Mixed => KernelInputs::Mixed([
                temperature,
                conductivity,
                potential,
                &self.mirrored.material,
                distance,
            ]),
        }
    }

    /// Heat that flows in through layers with prescribed values, W, from what was loaded, for points of these volumes
    /// (m³); zero in the form of second derivatives, which does not provide it.
    pub(super) fn inflow(&self, family: &Family, volume: impl Fn(usize) -> f64) -> ExactSum {
        let mut total = ExactSum::default();
        if self.derivatives.is_some() {
            return total;
        }
        let add = |point: usize, [rate]: [f64; 1]| total.add(volume(point) * rate);
        match self.inputs() {
            KernelInputs::One(kernel, inputs) => family.sum_from_layers(&kernel, inputs, add),
            KernelInputs::Series(inputs) => family.sum_from_layers(&Series, inputs, add),
            KernelInputs::Across(inputs) => family.sum_from_layers(&Across, inputs, add),
            KernelInputs::Mixed(inputs) => family.sum_from_layers(&Mixed, inputs, add),
            KernelInputs::States(kernel, inputs) => family.sum_from_layers(&kernel, inputs, add),
            // layers of plies end
            KernelInputs::Plies(_) | KernelInputs::PliesOfMaterials(_) => {}
        }
        total
    }

    /// Whether conductivities have directions.
    pub(super) fn has_directions(&self) -> bool {
        self.directions.is_some()
    }

    /// Whether the flow is linear in the temperature.
    pub(super) fn is_linear(&self) -> bool {
        if let Some(directions) = &self.directions {
            return directions.is_constant();
        }
        if let Some(plies) = &self.plies {
            return plies.is_constant();
        }
        let by_austenite = self.austenite.is_some();
        self.uniform.is_some()
            || !by_austenite && self.conductivity.iter().all(Property::is_constant)
    }
}

/// Factor of the conductivities of bonds with which the most complete family conducts exactly.
pub(super) fn calibration(family: &Family, points: usize, dimension: usize) -> f64 {
    let trace = |point: usize| {
        let mut sum = 0.0;
        family.for_each_bond(point, |_, bond, _| sum += bond.weight * bond.length);
        sum
    };
    let largest = (0..points)
        .into_par_iter()
        .map(trace)
        .reduce(|| 0.0, f64::max);
    dimension as f64 / largest
}
