//! The prepared heat physics: its state and its stable step.

use std::borrow::Cow;

use nalgebra::Vector3;
use perimelt_core::body::Sizes;
use perimelt_core::material::EnthalpyCurve;
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::world::refinement::Level;
use perimelt_core::world::{BodyIndex, BrokenPairs, LayersHandle};
use perimelt_core::{BrokenBonds, Family, FamilyHandle, Read, World};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::carried::{CarriedHeat, Diffusion};
use super::conduction::{Conduction, Matter};
use super::faces::HeatedFace;
use super::growth::{Growth, HeatState};
use super::integrate::Integrator;
use super::interfaces::MaterialPoints;
use super::keys::ThermalSolver;
use super::mixture::MixedFluids;
use super::points::ConductingPoints;
use super::prepare::{Austenite, HeatFields};
use super::refined::Refined;
use super::surface::Surface;

/// A prepared heat physics.
#[derive(Debug)]
pub(super) struct RunningThermal {
    pub(super) solver: ThermalSolver,
    /// Whether steps are as long as stability and accuracy allow.
    pub(super) is_automatic: bool,
    pub(super) body: BodyIndex,
    pub(super) family: FamilyHandle,
    /// Whether a physics moves the points, so that neighbours change.
    pub(super) moves: bool,
    pub(super) layers: LayersHandle,
    pub(super) fields: HeatFields,
    pub(super) curves: Vec<EnthalpyCurve>,
    /// Where two fluids flow through the points.
    pub(super) fluids: Option<MixedFluids>,
    pub(super) conduction: Conduction,
    /// Where conductivities have directions.
    pub(super) orientation: Option<Read<Vector3<f64>>>,
    /// Convection, in an Eulerian fluid.
    pub(super) carried: Option<CarriedHeat>,
    pub(super) cracks: Option<Cracks>,
    /// State of points that are added or cut off, in a growing body.
    pub(super) growth: Option<Growth>,
    /// Coupling of a coarse body and its refined window.
    pub(super) refined: Option<Refined>,
    /// Field of powder (0) and dense material (1), where the body has powder.
    pub(super) consolidated: Option<Read<f64>>,
    pub(super) austenite: Option<Austenite>,
    pub(super) integrator: Integrator,
    /// No boundary fixes the temperature: all are insulated or prescribe fluxes.
    pub(super) floating: bool,
    pub(super) heat: HeatAccount,
    pub(super) faces: Vec<HeatedFace>,
    /// Power of the bonds to layers with prescribed values as last observed, W.
    pub(super) through_layers: f64,
    /// Exchange of the surface with its surroundings.
    pub(super) surface: Option<Surface>,
    /// Largest stable explicit step, s; `None` until found.
    pub(super) stable_step: Option<f64>,
    /// Largest stable explicit step of conduction alone, s; found once where points stay.
    pub(super) conduction_step: Option<f64>,
    pub(super) exchange_limit: Option<ExchangeLimit>,
}

/// The stable step of points at the surface, and the state for which it was found.
#[derive(Clone, Copy, Debug)]
pub(super) struct ExchangeLimit {
    /// Bound of the temperatures (K), changes of the faces, version of a family that grows.
    found_for: (f64, u64, Option<u64>),
    /// s.
    step: f64,
}

/// Heat balance since the start of the run, J.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct HeatAccount {
    pub(super) initial: f64,
    pub(super) supplied: f64,
    /// Sum of the absolute values of what was supplied in each step.
    pub(super) exchanged: f64,
    /// What of `supplied` came from other bodies in two-way exchanges.
    pub(super) from_bodies: f64,
}

impl HeatAccount {
    /// Counts the heat of a step (J), negative when it leaves.
    pub(super) fn supply(&mut self, heat: f64) {
        self.supplied += heat;
        self.exchanged += heat.abs();
    }
}

/// Progress of the transfer of broken bonds from the mechanics.
#[derive(Debug, Default)]
pub(super) struct Cracks {
    taken: usize,
    replaced: usize,
    point_in: Vec<u32>,
}

impl Cracks {
    pub(super) fn follow(
        &mut self,
        broken: &BrokenPairs,
        family: &Family,
        own: &mut Option<BrokenBonds>,
    ) {
        if self.replaced != broken.replaced {
            (self.taken, self.replaced, *own) = (0, broken.replaced, None);
        }
        if self.taken == broken.pairs.len() {
            return;
        }
        if self.point_in.is_empty() {
            self.point_in = family.points_of_slots();
        }
        let own = own.get_or_insert_with(|| family.unbroken());
        for pair in &broken.pairs[self.taken..] {
            family.break_pair(*pair, &self.point_in, own);
        }
        self.taken = broken.pairs.len();
    }
}

impl RunningThermal {
    /// Breaks the bonds that broke in the mechanics since the last step.
    pub(super) fn follow_cracks(&mut self, world: &World) {
        if let Some(cracks) = &mut self.cracks {
            let pairs = world.broken_pairs(self.body);
            let family = world.family(self.family);
            cracks.follow(&pairs, &family, &mut self.conduction.broken);
        }
    }

    /// Whether points neither move nor are added or cut off.
    pub(super) fn is_at_rest(&self) -> bool {
        !self.moves && self.growth.is_none()
    }

    /// Adds points on which material was deposited since the last step.
    pub(super) fn take_births(&mut self, world: &World) {
        let state = self.heat_state();
        let Some(growth) = &mut self.growth else {
            return;
        };
        if growth.take_births(world, &self.curves, &state, &mut self.heat) {
            self.find_stable_step(world);
        }
    }

    pub(super) fn heat_state(&self) -> HeatState {
        HeatState {
            temperature: self.fields.temperature,
            enthalpy: self.fields.enthalpy,
        }
    }

    /// Volumes of the points whose heat counts, m³.
    pub(super) fn heated_volumes<'a>(&self, world: &'a World) -> Cow<'a, Sizes> {
        let volume = &world.body(self.body).points.volume;
        let refinement = world.refinement(self.body);
        match (&self.growth, refinement) {
            (Some(growth), _) => Cow::Owned(growth.volumes(volume)),
            (None, Some((refinement, Level::Plate))) => Cow::Owned(refinement.uncovered(volume)),
            (None, _) => Cow::Borrowed(volume),
        }
    }

    /// Heat that moves of the window transferred to it, J: positive for the window, negative for the body around it.
    pub(super) fn heat_of_moves(&self, world: &World) -> f64 {
        match world.refinement(self.body) {
            Some((refinement, Level::Window)) => refinement.position().carried,
            Some((refinement, Level::Plate)) => -refinement.position().carried,
            None => 0.0,
        }
    }

    /// Current volume over reference volume of each point, where points move.
    pub(super) fn volume_ratios(&self, world: &World) -> Option<Vec<f64>> {
        if !self.moves {
            return None;
        }
        let now = world.configuration(self.body);
        let reference = &world.body(self.body).points.volume;
        let points = now.volumes().iter().zip(reference);
        Some(points.map(|(now, reference)| now / reference).collect())
    }

    /// Finds the distances of points from interfaces between materials, where points move.
    pub(super) fn follow_interfaces(&mut self, world: &World) {
        if self.moves {
            let points = self.points(world);
            let family = world.family(self.family);
            let reducer = world.reducer(self.body);
            (self.conduction).find_interfaces(&family, points, None, &reducer);
        }
    }

    fn points<'a>(&self, world: &'a World) -> MaterialPoints<'a> {
        let body = world.body(self.body);
        MaterialPoints {
            material: &body.material_of_point,
            spacing: &body.points.spacing,
        }
    }

    /// Finds the sums over the bonds of each point, which change only where points move or become active.
    fn find_row_sums(&mut self, world: &World) {
        let points = self.points(world);
        let material = points.material;
        let reducer = world.reducer(self.body);
        if let Some(growth) = &mut self.growth {
            let family = world.family(self.family);
            let is_next = growth.row_sums_of.map(|v| v + 1) == Some(family.version());
            if growth.row_sums_of == Some(family.version()) {
                return;
            }
            let changed = is_next.then(|| family.recalibrated());
            (self.conduction).find_interfaces(&family, points, changed, &reducer);
            let (conduction, sums) = (&self.conduction, self.integrator.row_sums_mut());
            let find = |&point: &u32| conduction.row_sum(&family, material, point as usize);
            if is_next {
                let near = family.recalibrated();
                let found: Vec<f64> = near.par_iter().map(find).collect();
                let pairs = near.iter().zip(found);
                pairs.for_each(|(&point, sum)| sums[point as usize] = [sum]);
            } else {
                let points: Vec<u32> = (0..reducer.owned() as u32).collect();
                let found = points.par_iter().map(|p| [find(p)]);
                found.fill(sums);
                sums.resize(material.len(), [0.0]);
            }
            growth.row_sums_of = Some(family.version());
            return;
        }
        let is_at_rest = self.is_at_rest();
        if is_at_rest && !self.integrator.row_sums().is_empty() {
            return;
        }
        let family = world.family(self.family);
        (self.conduction).find_interfaces(&family, points, None, &reducer);
        let mut row_sums = (self.conduction).largest_row_sums(&family, material, &reducer);
        if let Some(ratios) = self.volume_ratios(world) {
            let sums = row_sums.iter_mut().zip(ratios);
            sums.for_each(|([sum], ratio)| *sum *= ratio);
        }
        self.integrator.set_row_sums(row_sums);
    }

    /// Finds the largest stable explicit step for the current configuration and velocity: the monotone limit
    /// `min C / sum_j kappa v V / |xi|` (docs/theory/heat_conduction.md, "Steps in time"), with the smallest capacity and the
    /// largest conductivity of each material, and the limit of convection.
    pub(super) fn find_stable_step(&mut self, world: &World) {
        self.find_row_sums(world);
        let body = world.body(self.body);
        let points = self
            .integrator
            .row_sums()
            .iter()
            .zip(&body.material_of_point);
        let is_at_rest = self.is_at_rest();
        let known = self.conduction_step.filter(|_| is_at_rest);
        let stable_step = match (known, &self.carried) {
            (Some(known), None) => known,
            (None, None) => {
                let limits = points.map(|([sum], &m)| self.longest_step(m, *sum, 0.0));
                limits.fold(f64::INFINITY, f64::min)
            }
            (_, Some(carried)) => {
                let velocity = world.read(carried.velocity);
                let squares = velocity.iter().map(|v| v.norm_squared());
                let speed = squares.fold(0.0, f64::max).sqrt();
                let points = points.zip(&body.points.spacing);
                let limits = points.map(|(([sum], &m), spacing)| {
                    let at = Diffusion {
                        conductivity: self.conduction.largest_conductivity(m),
                        row_sum: *sum,
                        capacity: self.curves[m as usize].minimum_capacity(),
                    };
                    carried.stable_step(at, speed, *spacing)
                });
                limits.fold(f64::INFINITY, f64::min)
            }
        };
        self.conduction_step = Some(stable_step);
        let stable_step = stable_step.min(self.find_exchange_limit(world));
        let stable_step = match &self.refined {
            Some(refined) => refined.step_fraction() * stable_step,
            None => stable_step,
        };
        let stable_step = world.reducer(self.body).min(stable_step);
        self.stable_step = Some(stable_step);
        self.integrator.set_stable_step(stable_step);
    }

    /// Longest stable step (s) of a point of a material with this sum over its bonds and this conductance of its surface,
    /// W/(m³ K). Of two fluids either may be there, and the diffusivity of a mixture is not above the larger one of both.
    fn longest_step(&self, material: u16, row_sum: f64, at_surface: f64) -> f64 {
        let least = |m: u16| self.curves[m as usize].minimum_capacity();
        let Some(fluids) = self.fluids else {
            return least(material) / (row_sum + at_surface);
        };
        let fluids = fluids.materials.into_iter();
        let steps = fluids.zip(self.conduction.fluid_ratios());
        let steps = steps.map(|(m, ratio)| least(m) / (ratio * row_sum + at_surface));
        steps.fold(f64::INFINITY, f64::min)
    }

    /// The stable step of points at the surface, s: the conductances of bonds and of the exchange over their capacity.
    fn find_exchange_limit(&mut self, world: &World) -> f64 {
        self.follow_surface(world);
        let Some(surface) = &self.surface else {
            return f64::INFINITY;
        };
        let hottest = surface.hottest(
            &world.read::<f64>(self.fields.temperature.into()),
            &world.reducer(self.body),
        );
        let sums_of = self.growth.as_ref().and_then(|growth| growth.row_sums_of);
        let found_for = (hottest, surface.changes(), sums_of);
        let moves = self.moves;
        let known = self.exchange_limit.filter(|_| !moves);
        if let Some(known) = known.filter(|known| known.found_for == found_for) {
            return known.step;
        }
        let material = &world.body(self.body).material_of_point;
        let largest = |point: usize, axis: usize| {
            (self.conduction).largest_conductivity_along(point, axis, material[point])
        };
        let row_sums = self.integrator.row_sums();
        let mut step = f64::INFINITY;
        surface.visit_stiffness(hottest, largest, |point, at_point| {
            step = step.min(self.longest_step(material[point], row_sums[point][0], at_point));
        });
        self.exchange_limit = Some(ExchangeLimit { found_for, step });
        step
    }

    /// Whether other bodies give heat to this one, or take it.
    pub(super) fn exchanges_with_bodies(&self) -> bool {
        let takes = self.surface.as_ref().is_some_and(|s| s.given.is_possible());
        takes || self.fields.given.is_some()
    }

    /// The longest step (s) of a two-way exchange with other bodies, which see each other's temperature at its start.
    pub(super) fn given_step(&mut self, world: &World) -> Option<f64> {
        self.follow_surface(world);
        let surface = self.surface.as_mut().filter(|s| !s.given.is_empty())?;
        let hottest = surface.hottest(
            &world.read::<f64>(self.fields.temperature.into()),
            &world.reducer(self.body),
        );
        let body = world.body(self.body);
        let largest = |point: usize, axis: usize| {
            let material = body.material_of_point[point];
            (self.conduction).largest_conductivity_along(point, axis, material)
        };
        Some(surface.given_step(hottest, largest, &body.points.volume))
    }

    /// Updates the faces through which the surface exchanges heat.
    pub(super) fn follow_surface(&mut self, world: &World) {
        if let Some(surface) = &mut self.surface {
            let growth = self.growth.as_ref();
            let has_material = |point: usize| growth.is_none_or(|g| g.is_born(point));
            surface.follow(world.body(self.body), has_material);
        }
    }

    /// Whether the stable step changes during the run.
    pub(super) fn has_changing_limit(&self) -> bool {
        let radiates = self.surface.as_ref().is_some_and(|s| !s.is_linear());
        self.carried.is_some() || radiates || !self.is_at_rest()
    }

    /// Measures the heat that crosses faces.
    pub(super) fn measure_faces(&mut self, world: &World) {
        self.follow_fluids(world);
        self.follow_surface(world);
        let temperature = world.read::<f64>(self.fields.temperature.into());
        let reducer = world.reducer(self.body);
        if let Some(surface) = &self.surface {
            let points = ConductingPoints {
                conduction: &self.conduction,
                curves: &self.curves,
                material: &world.body(self.body).material_of_point,
                temperature: &temperature,
            };
            surface.report(&points, &reducer);
        }
        if self.faces.is_empty() {
            return;
        }
        let rules = world.layer_rules(self.layers);
        let body = world.body(self.body);
        let family = world.family(self.family);
        let matter = Matter {
            family: &family,
            rules: &rules,
            material: &body.material_of_point,
            curves: &self.curves,
            points: &reducer,
        };
        self.conduction.load(&matter, &temperature);
        let volume = self.heated_volumes(world);
        let inflow = (self.conduction).inflow(&family, |point| volume[point]);
        self.through_layers = reducer.total(inflow);
        let points = ConductingPoints {
            conduction: &self.conduction,
            curves: &self.curves,
            material: &body.material_of_point,
            temperature: &temperature,
        };
        for face in &mut self.faces {
            if let Some(rule) = rules.iter().find(|r| r.face == face.face) {
                let growth = self.growth.as_ref();
                let has_material = |point: usize| growth.is_none_or(|g| g.is_born(point));
                let spacing = &body.points.spacing;
                let axis = face.face.axis();
                let conductivity = |point: usize| points.conductivity_along(point, axis);
                let inflow = face.measure(rule, &temperature, has_material, conductivity, spacing);
                face.add_up(inflow, &reducer);
            }
        }
    }
}
