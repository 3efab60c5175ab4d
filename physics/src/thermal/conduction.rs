//! The conduction operator: the divergence of the heat flux at the points of a body, in one of two forms.
//!
//! ```text
//! bonds               sum_j kappa_ij v V_j (T_j - T_i) / |xi|,   kappa_ij = 2 k_ij / M
//! second derivatives  k lap T + grad k . grad T
//! ```
//!
//! The conductivity of a bond within a material is the mean over the temperatures between its ends,
//! `k_ij (T_j - T_i) = Theta(T_j) - Theta(T_i)` with the [`HeatPotential`] Theta: where the conductivity jumps at a
//! melting front, the front takes its place within the bond. The mean of the ends, `(k_i + k_j) / 2` (Wang (2025),
//! eqs. 6.19, 6.20), counts the bond that holds the front with the conductivity of the wrong phase, so that fronts lag by half a
//! spacing. Between materials the parts of a bond conduct in series ([`interfaces`](super::interfaces)); in the ordinary form
//! its conductivity is the mean of the ends.

mod change;

use std::sync::Arc;

use perimelt_core::family::{ByRules, LayerRule, Mirrored};
use perimelt_core::material::{EnthalpyCurve, HeatPotential, Property};
use perimelt_core::solver::reduce::max_abs;
use perimelt_core::{Bond, BondKernel, BrokenBonds, Derivatives, Family, Pddo, SlotField};
use rayon::prelude::*;

use super::interfaces::{Across, Interfaces, Mixed, Points, RowSumAcross};
use super::parts::{Part, Series};
use super::states::{StateFlow, States};

/// Slots that a thread takes at a time.
const SLOTS_PER_TASK: usize = 4096;

/// The conduction operator with its work arrays.
#[derive(Debug)]
pub(super) struct Conduction {
    conductivity: Vec<Property>,
    /// Largest conductivity of each material, W/(m K).
    largest: Vec<f64>,
    uniform: Option<f64>,
    /// What the conductivities of bonds are multiplied by, so that a complete family is exact.
    calibration: f64,
    derivatives: Option<SecondDerivatives>,
    /// In the ordinary form.
    states: Option<States>,
    temperature_slots: SlotField,
    conductivity_slots: SlotField,
    conductivity_field: Vec<f64>,
    /// Of each material, where conductivities depend on the temperature.
    potentials: Vec<HeatPotential>,
    /// By slot, W/m.
    potential_slots: SlotField,
    potential_field: Vec<f64>,
    /// By slot, of the points that they mirror.
    mirrored: MirroredFields,
    /// What was loaded last.
    loaded: Loaded,
    /// Where the body has powder.
    powder: Option<Part>,
    /// Where a metallurgy tells where there is austenite.
    austenite: Option<Part>,
    /// In the form of bonds, where the body has several materials and no powder.
    interfaces: Option<Interfaces>,
    /// Slots of layer points with temperatures of their own, K.
    layers: Vec<(u32, f64)>,
    /// Bonds that conduct no more.
    pub(super) broken: Option<BrokenBonds>,
    /// Heat that flowed to each point when last asked for, W/m³.
    pub(super) rate: Vec<[f64; 1]>,
}

/// Fields behind faces as those of the points that they mirror, by slot.
#[derive(Debug, Default)]
struct MirroredFields {
    /// K.
    temperature: SlotField,
    material: SlotField,
}

/// What bonds conduct by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Loaded {
    /// One conductivity.
    Uniform,
    /// The conductivities of their ends, whose halves conduct in series; second derivatives take their gradient.
    Ends,
    /// The conductivities of their ends, whose parts on both sides of an interface conduct in series.
    Across,
    /// The potential of the one material.
    Potential,
    /// The potential within a material, as across interfaces between materials.
    Mixed,
    /// The conductivities and gradients of their ends, in the ordinary form.
    States,
}

/// Fields by slot for the kernel that sums them: temperatures (K) or potentials (W/m); temperatures and conductivities
/// (W/(m K)); these with distances from interfaces (m); and these with potentials and materials.
enum Inputs<'a> {
    One(Uniform, [&'a [f64]; 1]),
    Series([&'a [f64]; 2]),
    Across([&'a [f64]; 3]),
    Mixed([&'a [f64]; 5]),
    States(StateFlow, [&'a [f64]; 5]),
}

/// The form of second derivatives.
#[derive(Debug)]
struct SecondDerivatives {
    pddo: Arc<Pddo>,
    work: Derivatives,
    /// One row for each point: the gradient of the temperature, then its Laplacian.
    temperature: Vec<f64>,
    /// One row for each point: the gradient of the conductivity.
    conductivity: Vec<f64>,
}

/// Where heat flows and by which properties.
#[derive(Clone, Copy)]
pub(super) struct Matter<'a> {
    pub(super) family: &'a Family,
    /// How the temperature continues behind faces.
    pub(super) rules: &'a [LayerRule],
    pub(super) material: &'a [u16],
    pub(super) curves: &'a [EnthalpyCurve],
}

/// Conduction with one conductivity, W/(m K), or by a potential (W/m) with a conductivity of one; the
/// micro-conductivity is `2 k / M`, and weights of bonds hold the `1 / M`.
struct Uniform {
    conductivity: f64,
}

impl BondKernel<1, 1> for Uniform {
    #[inline(always)]
    fn bond(&self, bond: &Bond, [own]: [f64; 1], [other]: [f64; 1]) -> [f64; 1] {
        [2.0 * self.conductivity * bond.mean() * bond.inverse_length * (other - own)]
    }
}

/// Heat that a bond carries to its point, over conductivity and difference of temperatures, 1/m².
pub(super) fn coefficient(bond: &Bond) -> f64 {
    let [heat] = Uniform { conductivity: 1.0 }.bond(bond, [0.0], [1.0]);
    heat
}

/// Sum of the coefficients of a point's bonds, W/(m³ K), with the mean conductivity of the ends, which is at least that of
/// halves in series.
struct RowSum;

impl BondKernel<1, 1> for RowSum {
    const RARE: bool = true;

    #[inline(always)]
    fn bond(&self, bond: &Bond, [own]: [f64; 1], [other]: [f64; 1]) -> [f64; 1] {
        [bond.mean() * bond.inverse_length * (own + other)]
    }
}

impl Conduction {
    /// By bonds, whose conductivities are multiplied by `calibration`.
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
            temperature_slots: SlotField::zeros(family),
            conductivity_slots: SlotField::default(),
            conductivity_field: vec![0.0; varying],
            potentials: Vec::new(),
            potential_slots: SlotField::default(),
            potential_field: Vec::new(),
            mirrored: MirroredFields::default(),
            loaded: Loaded::Uniform,
            powder: None,
            austenite: None,
            interfaces: has_interfaces.then(|| Interfaces::new(points)),
            layers: Vec::new(),
            broken: None,
            rate: vec![[0.0]; points],
        }
    }

    /// By second derivatives.
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

    /// The ordinary form, with this stabilisation.
    pub(super) fn set_states(&mut self, dimension: usize, stabilisation: f64) {
        self.interfaces = None;
        self.states = Some(States::new(dimension, self.rate.len(), stabilisation));
    }

    /// Lets points be powder, which has these conductivities by material.
    pub(super) fn set_powder(&mut self, conductivity: Vec<Property>) {
        self.uniform = None;
        self.interfaces = None;
        let points = self.rate.len();
        self.conductivity_field = vec![0.0; points];
        for (largest, powder) in self.largest.iter_mut().zip(&conductivity) {
            *largest = largest.max(max_abs(&powder.values()));
        }
        self.powder = Some(Part::new(conductivity, points));
    }

    /// Takes over which points are powder (0) and which are dense (1).
    pub(super) fn consolidate(&mut self, consolidated: &[f64]) {
        if let Some(powder) = &mut self.powder {
            powder.set_fraction(consolidated.iter().map(|dense| 1.0 - dense));
        }
    }

    /// Takes over the fraction of austenite at each point, which has these conductivities by material.
    pub(super) fn set_austenite(&mut self, conductivity: &[Property], fraction: &[f64]) {
        if self.austenite.is_none() {
            self.uniform = None;
            self.interfaces = None;
            for (largest, austenite) in self.largest.iter_mut().zip(conductivity) {
                *largest = largest.max(max_abs(&austenite.values()));
            }
        }
        let new = || Part::new(conductivity.to_vec(), fraction.len());
        let austenite = self.austenite.get_or_insert_with(new);
        austenite.set_fraction(fraction.iter().copied());
    }

    /// Finds the distances of points from interfaces, where they matter: of all points, or of those that `changed` in a
    /// family that grows.
    pub(super) fn find_interfaces(
        &mut self,
        family: &Family,
        points: Points<'_>,
        changed: Option<&[u32]>,
    ) {
        match (&mut self.interfaces, changed) {
            (Some(interfaces), Some(changed)) => interfaces.find_some(family, points, changed),
            (Some(interfaces), None) => interfaces.find(family, points),
            (None, _) => {}
        }
    }

    /// Whether heat flows by bonds whose sums depend on the temperatures of their ends only.
    pub(super) fn is_by_bonds(&self) -> bool {
        self.derivatives.is_none() && self.states.is_none()
    }

    /// Whether the heat that leaves a point arrives at others to rounding.
    pub(super) fn is_conservative(&self) -> bool {
        self.derivatives.is_none()
    }

    /// Fills the slots from a temperature field (K) and evaluates the conductivities.
    pub(super) fn load(&mut self, matter: &Matter<'_>, temperature: &[f64]) {
        let ghosts = ByRules(matter.rules, 0);
        self.temperature_slots
            .load(matter.family, temperature, ghosts);
        for (slot, own) in &self.layers {
            self.temperature_slots[*slot as usize] = *own;
        }
        self.loaded = self.what_to_load();
        if self.loaded == Loaded::Uniform {
            return;
        }
        if self.loaded != Loaded::Potential {
            self.load_conductivity(matter, temperature);
        }
        if [Loaded::Potential, Loaded::Mixed].contains(&self.loaded) {
            self.load_potential(matter, temperature);
        }
        if let Some(interfaces) = &mut self.interfaces {
            interfaces.load(matter.family);
        }
        if let Some(states) = &mut self.states {
            let fields = (&self.temperature_slots[..], &self.conductivity_field[..]);
            states.load(matter, fields, self.broken.as_ref());
        }
    }

    fn what_to_load(&self) -> Loaded {
        let has_parts = self.powder.is_some() || self.austenite.is_some();
        let by_points = self.derivatives.is_some() || has_parts;
        if self.states.is_some() {
            return Loaded::States;
        }
        match self.uniform {
            Some(_) => Loaded::Uniform,
            None if by_points => Loaded::Ends,
            None if self.is_linear() => Loaded::Across,
            None if self.conductivity.len() == 1 => Loaded::Potential,
            None => Loaded::Mixed,
        }
    }

    fn load_conductivity(&mut self, matter: &Matter<'_>, temperature: &[f64]) {
        self.conductivity_field.resize(temperature.len(), 0.0);
        let mut field = std::mem::take(&mut self.conductivity_field);
        let values = field.par_iter_mut().zip(temperature).zip(matter.material);
        values.enumerate().for_each(|(point, ((k, &t), &m))| {
            let liquid = matter.curves[m as usize].liquid_fraction(t);
            *k = self.calibration * self.conductivity((point, m), t, liquid);
        });
        self.conductivity_field = field;
        let field = &self.conductivity_field[..];
        self.conductivity_slots
            .load(matter.family, field, Mirrored::Scalar);
    }

    /// Behind faces the potential continues as the temperature does: as far from its value at the mean of both sides.
    fn load_potential(&mut self, matter: &Matter<'_>, temperature: &[f64]) {
        if self.potentials.is_empty() {
            let materials = self.conductivity.iter().zip(matter.curves);
            self.potentials = materials.map(|(k, c)| HeatPotential::new(k, c)).collect();
        }
        let (family, potentials) = (matter.family, &self.potentials);
        let calibration = self.calibration;
        let points = temperature.par_iter().zip(matter.material);
        let potential = points.map(|(&t, &m)| calibration * potentials[m as usize].at(t));
        potential.collect_into_vec(&mut self.potential_field);
        self.potential_slots
            .load(family, &self.potential_field[..], Mirrored::Scalar);
        let several = potentials.len() > 1;
        let mirrored = &mut self.mirrored;
        if several {
            let material = |point: usize| f64::from(matter.material[point]);
            mirrored.material.load(family, material, Mirrored::Scalar);
        }
        if matter.rules.is_empty() {
            return self.load_layers();
        }
        let slots = &mut mirrored.temperature;
        slots.load(family, temperature, Mirrored::Scalar);
        let material = |slot: usize| match several {
            true => mirrored.material[slot] as usize,
            false => 0,
        };
        let behind = self
            .potential_slots
            .par_iter_mut()
            .zip(&self.temperature_slots[..])
            .zip(&mirrored.temperature[..]);
        let behind = behind.enumerate().with_min_len(SLOTS_PER_TASK);
        behind.for_each(|(slot, ((potential, here), mirrored))| {
            if here != mirrored {
                let face = potentials[material(slot)].at(0.5 * (here + mirrored));
                *potential = 2.0 * calibration * face - *potential;
            }
        });
        self.load_layers();
    }

    /// The potential of layer points with temperatures of their own, which have the one material of the body.
    fn load_layers(&mut self) {
        for (slot, temperature) in &self.layers {
            self.potential_slots[*slot as usize] =
                self.calibration * self.potentials[0].at(*temperature);
        }
    }

    /// Layer points whose temperature (K) does not follow from that of the body, by slot; for bodies of one material.
    pub(super) fn layers_mut(&mut self) -> &mut Vec<(u32, f64)> {
        &mut self.layers
    }

    /// The field by slot to whose differences the heat of bonds is proportional, and its factor, from what was loaded, for
    /// bodies of one material in the form of bonds: with [`coefficient`] they give W/m³.
    pub(super) fn linear_input(&self) -> (&[f64], f64) {
        match self.loaded {
            Loaded::Potential => (&self.potential_slots, 1.0),
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
            Inputs::One(kernel, inputs) => {
                family.sum_unbroken(&kernel, inputs, broken, &mut rate);
            }
            Inputs::Series(inputs) => family.sum_unbroken(&Series, inputs, broken, &mut rate),
            Inputs::Across(inputs) => family.sum_unbroken(&Across, inputs, broken, &mut rate),
            Inputs::Mixed(inputs) => family.sum_unbroken(&Mixed, inputs, broken, &mut rate),
            Inputs::States(kernel, inputs) => {
                family.sum_unbroken(&kernel, inputs, broken, &mut rate);
            }
        }
        self.rate = rate;
    }

    /// What was loaded, for its kernel.
    fn inputs(&self) -> Inputs<'_> {
        let temperature = &self.temperature_slots[..];
        let (conductivity, potential) = (&self.conductivity_slots[..], &self.potential_slots[..]);
        let distance = self.interfaces.as_ref().map_or(&[][..], Interfaces::slots);
        match self.loaded {
            Loaded::Uniform => {
                let conductivity = self.calibration * self.uniform.unwrap_or_default();
                Inputs::One(Uniform { conductivity }, [temperature])
            }
            Loaded::Potential => Inputs::One(Uniform { conductivity: 1.0 }, [potential]),
            Loaded::Ends => Inputs::Series([temperature, conductivity]),
            Loaded::Across => Inputs::Across([temperature, conductivity, distance]),
            Loaded::States => {
                let states = self.states.as_ref().expect("loaded from them");
                let (kernel, inputs) = states.flow(temperature, conductivity);
                Inputs::States(kernel, inputs)
            }
            Loaded::Mixed => Inputs::Mixed([
                temperature,
                conductivity,
                potential,
                &self.mirrored.material,
                distance,
            ]),
        }
    }

    fn flow_by_derivatives(&mut self) {
        let Some(derivatives) = &mut self.derivatives else {
            return;
        };
        let SecondDerivatives {
            pddo,
            work,
            temperature,
            conductivity,
        } = derivatives;
        pddo.gradient_and_laplacian(&self.temperature_slots, work, temperature);
        let is_uniform = self.loaded == Loaded::Uniform;
        if !is_uniform {
            pddo.gradient(&self.conductivity_slots, work, conductivity);
        }
        let dimension = pddo.dimension();
        let (uniform, field) = (self.uniform, &self.conductivity_field);
        let conductivity = &*conductivity;
        let rows = self.rate.par_iter_mut().enumerate().with_min_len(1024);
        rows.for_each(|(i, [rate])| {
            let row = &temperature[i * (dimension + 1)..][..dimension + 1];
            let own = match uniform {
                Some(k) if is_uniform => k,
                _ => field[i],
            };
            *rate = own * row[dimension];
            if !is_uniform {
                let slope = &conductivity[i * dimension..][..dimension];
                *rate += (0..dimension).map(|a| slope[a] * row[a]).sum::<f64>();
            }
        });
    }

    /// Heat that flows in through layers with prescribed values, W, from what was loaded, for points of these volumes
    /// (m³); zero in the form of second derivatives, which does not know it.
    pub(super) fn inflow(&self, family: &Family, volume: &[f64]) -> f64 {
        let mut total = 0.0;
        if self.derivatives.is_some() {
            return total;
        }
        let add = |point: usize, [rate]: [f64; 1]| total += volume[point] * rate;
        match self.inputs() {
            Inputs::One(kernel, inputs) => family.sum_from_layers(&kernel, inputs, add),
            Inputs::Series(inputs) => family.sum_from_layers(&Series, inputs, add),
            Inputs::Across(inputs) => family.sum_from_layers(&Across, inputs, add),
            Inputs::Mixed(inputs) => family.sum_from_layers(&Mixed, inputs, add),
            Inputs::States(kernel, inputs) => family.sum_from_layers(&kernel, inputs, add),
        }
        total
    }

    /// Whether the flow is linear in the temperature.
    pub(super) fn is_linear(&self) -> bool {
        let by_austenite = self.austenite.is_some();
        self.uniform.is_some()
            || !by_austenite && self.conductivity.iter().all(Property::is_constant)
    }

    /// Conductivity of a point of a material at a temperature (K) and liquid fraction, W/(m K).
    pub(super) fn conductivity(
        &self,
        (point, material): (usize, u16),
        temperature: f64,
        liquid: f64,
    ) -> f64 {
        let at = (material as usize, temperature);
        let mut conductivity = self.conductivity[at.0].at(temperature, liquid);
        if let Some(austenite) = &self.austenite {
            conductivity = austenite.mixed(point, at, (conductivity, 1.0 - liquid));
        }
        if let Some(powder) = &self.powder {
            conductivity = powder.mixed(point, at, (conductivity, 1.0));
        }
        conductivity
    }

    /// Conductivity of molten material at a temperature, W/(m K): what was powder is dense.
    pub(super) fn melt_conductivity(&self, material: u16, temperature: f64) -> f64 {
        self.conductivity[material as usize].at(temperature, 1.0)
    }

    /// Largest conductivity of a material, W/(m K).
    pub(super) fn largest_conductivity(&self, material: u16) -> f64 {
        self.largest[material as usize]
    }

    /// Sum of the coefficients of each point's bonds at the largest conductivities, W/(m³ K).
    pub(super) fn largest_row_sums(&mut self, family: &Family, material: &[u16]) -> Vec<[f64; 1]> {
        let broken = self.broken.as_ref();
        let stiffness = self
            .states
            .as_mut()
            .map_or(1.0, |s| s.stiffness(family, broken));
        let largest = &self.largest;
        if let Some(SecondDerivatives { pddo, .. }) = &self.derivatives {
            let points = material.par_iter().enumerate();
            let sum =
                |(point, &m): (usize, &u16)| [largest[m as usize] * pddo.laplacian_sum(point)];
            return points.map(sum).collect();
        }
        let factor = stiffness * self.calibration;
        let conductivity = |point: usize| factor * largest[material[point] as usize];
        let mut slots = SlotField::default();
        slots.load(family, conductivity, Mirrored::Scalar);
        let mut sums = vec![[0.0]; material.len()];
        match &mut self.interfaces {
            Some(interfaces) => {
                interfaces.load(family);
                family.sum(&RowSumAcross, [&slots, interfaces.slots()], &mut sums);
            }
            None => family.sum(&RowSum, [&slots], &mut sums),
        }
        sums
    }
}

impl Conduction {
    /// The sum of the coefficients of one point's bonds, as [`Conduction::largest_row_sums`] in a family that grows,
    /// W/(m³ K).
    pub(super) fn row_sum(&self, family: &Family, material: &[u16], point: usize) -> f64 {
        let ends = |p: usize| {
            let conductivity = self.calibration * self.largest[material[p] as usize];
            let interfaces = self.interfaces.as_ref();
            [conductivity, interfaces.map_or(1.0, |i| i.of(p))]
        };
        let own = ends(point);
        let mut sum = 0.0;
        family.for_each_bond(point, |_, bond, slot| {
            let other = family.mirrored_point(slot).map_or(own, ends);
            let [part] = match self.interfaces {
                Some(_) => RowSumAcross.bond(bond, own, other),
                None => RowSum.bond(bond, [own[0]], [other[0]]),
            };
            sum += part;
        });
        sum
    }
}

/// What the conductivities of bonds are multiplied by so that the most complete family conducts exactly.
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
