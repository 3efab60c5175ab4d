//! Material that is deposited on a solid, or cut off it.
//!
//! A point that gets its material is *born* at the displacement that continues that of the material around it:
//!
//! ```text
//! u_i = sum_j w (u_j - H_j xi) / sum_j w,   H_i = sum_j w H_j / sum_j w      j: points that are there
//! ```
//!
//! points beside the body first, then those beside them. It is free of stress in that shape: the field `birth_strain` e0 is
//! the strain of its displacement gradient H at birth, and its stress is that of the strain beyond e0. So is the
//! strain of any point measured from the configuration in which its material was deposited, as inactive elements are
//! activated in welding codes.
//!
//! Points that were there before get further neighbours by a birth, and from the displacement that was made up for them another H.
//! Their stress does not change by that:
//!
//! ```text
//! e0 += e(H with the new neighbours) - e(H with the old ones)
//! ```
//!
//! A cut leaves the displacement as it is. H of a point that loses neighbours becomes the mean over those that remain, and e0
//! stays: a strain at which the rest is free of stress is not shifted.
//!
//! The rotation of H_j is continued, and its strain up to that of elastic metal: fresh metal does not take over how the layer
//! below has shrunk.
//!
//! Where the body has an annealing temperature, material that is deposited above it is free of all stress, pressure included,
//! until it has cooled below for the first time: e0 follows its strain, and there is no plastic strain. Metal that melts
//! again is annealed as any other.
//!
//! Births hence change no stress of any other point; what is unbalanced after a cut is what the material that is gone carried.
//!
//! A body in motion (`explicit`) gets material at the velocity around it; its balance of momentum counts what comes and goes.
//!
//! Points of staggered solids have the family of their own corners: births change no H of others, and new corners continue the
//! displacement of those with which they share a cell.
//!
//! Correspondence and staggered solids only: their stress belongs to points. A bond of the other solids has the mean of the strains
//! of its ends, and a point born beside a loaded one would not be free of stress.

use nalgebra::Matrix3;
use perimelt_core::family::LayerRule;
use perimelt_core::world::BodyIndex;
use perimelt_core::{Face, Setup, SetupError, World};
use rayon::prelude::*;

use super::classical::{COMPONENTS, Point, symmetric};
use super::fields::has_tensor_eigenstrain;
use super::keys::{Formulation, Mechanical};
use super::moduli::Moduli;
use super::solid::{PointStates, StressFreeStrain, Wanted};
use super::staggered::Births;
use super::step::MechanicalRun;
use super::surface_stress::SurfaceStress;
use super::surroundings::{MotionState, Placed, Surroundings};

/// Strain that is continued from the body to what is deposited on it, of the order of the elastic limit of metals.
const CONTINUED: f64 = 2e-3;

/// The part of a displacement gradient that is continued to new material: the rotation, and strain up to [`CONTINUED`].
pub(super) fn continued_part(gradient: &Matrix3<f64>) -> Matrix3<f64> {
    let strain = 0.5 * (gradient + gradient.transpose());
    let size = strain.norm();
    match size > CONTINUED {
        true => gradient + strain * (CONTINUED / size - 1.0),
        false => *gradient,
    }
}

/// Refuses keys that do not go together with a body that grows, or with an eigenstrain that differs by direction.
pub(super) fn check(
    keys: &Mechanical,
    setup: &Setup<'_>,
    body: BodyIndex,
) -> Result<(), SetupError> {
    let refuse =
        |key: &str, message: String, expected: &str| Err(SetupError::value(key, message, expected));
    let (formulation, grows) = (keys.formulation(), setup.world().is_growing(body));
    let cause = "a body whose material is deposited or cut off";
    if grows && matches!(formulation, Formulation::Bond | Formulation::Ordinary) {
        let message = format!("`formulation = \"bond\"` and `\"ordinary\"` do not support {cause}");
        let expected = "`formulation = \"correspondence\"` or `\"staggered\"`";
        return refuse("formulation", message, expected);
    }
    let has_tensor =
        formulation == Formulation::Correspondence && has_tensor_eigenstrain(setup, body);
    let strain = "a stress-free strain that differs by direction in a correspondence solid";
    let causes = [(grows, cause), (has_tensor, strain)];
    let cause_of_fracture = causes.iter().find(|(applies, _)| *applies);
    if let (Some(_), Some((_, cause))) = (&keys.fracture, cause_of_fracture) {
        let message = format!("`fracture` does not support {cause}");
        return refuse("fracture", message, "no `fracture`");
    }
    if grows && keys.surface_stress != SurfaceStress::Direct {
        let message = format!("`surface_stress = \"extrapolated\"` does not support {cause}");
        return refuse("surface_stress", message, "\"direct\"");
    }
    Ok(())
}

/// Refuses a traction by a layer, whose slope takes neither strains at birth nor those that differ by direction into account.
pub(super) fn check_layer(
    setup: &Setup<'_>,
    body: BodyIndex,
    face: Face,
) -> Result<(), SetupError> {
    if !setup.world().is_growing(body) && !has_tensor_eigenstrain(setup, body) {
        return Ok(());
    }
    let message = format!(
        "the traction on face `{}` acts by a layer, which knows neither the strain at which material was deposited nor a \
         stress-free strain that differs by direction",
        face.name()
    );
    Err(SetupError::value(
        "body",
        message,
        "`by = \"body_force\"` in `traction`",
    ))
}

/// The deformation of a body.
struct Strained {
    /// Gradients of the displacement.
    gradient: Vec<Matrix3<f64>>,
    /// What means over families add to the prescribed strains; empty where they add nothing.
    smoothing: Vec<[f64; 6]>,
}

impl Strained {
    /// The strain of a point beyond what means over families add to the prescribed one.
    fn strain(&self, point: usize, finite: bool) -> Matrix3<f64> {
        let strain = Point::strain(&self.gradient[point], finite);
        let smoothing = self.smoothing.get(point).map(symmetric);
        smoothing.map_or(strain, |smoothing| strain - smoothing)
    }
}

impl MechanicalRun {
    /// Takes up points that became active or inactive since the last step; whether there are any.
    pub(super) fn follow_activity(&mut self, world: &World) -> bool {
        let Some(mut active) = world.present_points(self.body) else {
            return false;
        };
        if let Some(corners) = self.nodes().corners() {
            let points = world.reducer(self.body);
            corners.leave_out_hinges(&points, &mut active, &self.state.present);
        }
        let has_changed = world.processes().any(active != self.state.present);
        if has_changed {
            self.change_presence(world, active);
        }
        let rules = world.layer_rules(self.layers);
        self.state.layers = rules.iter().map(|r| [r.scale, r.offset]).collect();
        has_changed
    }

    /// Lets other points be present. Layers are as in the last step: what they prescribe for the end of this one strains
    /// the material after its birth.
    fn change_presence(&mut self, world: &World, active: Vec<bool>) {
        let mut rules = world.layer_rules(self.layers).to_vec();
        for (rule, [scale, offset]) in rules.iter_mut().zip(&self.state.layers) {
            (rule.scale, rule.offset) = (*scale, *offset);
        }
        let before = self.strained(world, &rules);
        self.keep_ratio(world);
        self.solid.set_points(PointStates {
            present: Some(&active),
            ..PointStates::default()
        });
        self.statics.forget_rigid_modes();
        let was_present = std::mem::replace(&mut self.state.present, active);
        let present = self.state.present.clone();
        self.state.fresh.resize(present.len(), false);
        for (point, fresh) in self.state.fresh.iter_mut().enumerate() {
            *fresh = present[point] && (*fresh || !was_present[point]);
        }
        let density = self.nodes().densities(&self.density, &present);
        let earlier = std::mem::replace(&mut self.node_density, density);
        let change = |this: &Self, i: usize| this.node_density[i] - earlier[i];
        let gone = self.momentum_with(world, |i| (-change(self, i)).max(0.0));
        self.place_born(world, &was_present, &rules, &before.gradient);
        let born = self.momentum_with(world, |i| change(self, i).max(0.0));
        self.state.given += gone.times(-1.0).with_size_of(&gone);
        self.state.given += born;
        self.set_in_motion(world);
        let after = self.strained(world, &rules);
        let finite = self.balanced.angular;
        let Some(birth_strain) = self.fields.birth_strain else {
            return;
        };
        let field = birth_strain;
        let mut birth_strain = world.write(field);
        let is_born = |point: usize| present[point] && !was_present[point];
        for (point, has_gained) in self.changed_families(&was_present) {
            match self.state.present[point] {
                true if has_gained => {
                    birth_strain[point] +=
                        after.strain(point, finite) - before.strain(point, finite);
                }
                true => {}
                false => birth_strain[point] = Matrix3::zeros(),
            }
        }
        drop(birth_strain);
        world.bring_remote(field);
        self.solid.relieve_modes(&is_born);
        if let Some(plastic) = &self.fields.plastic {
            // what is born has no flow of metal that was cut off there before
            let mut strain = world.write(plastic.strain);
            let mut equivalent = world.write(plastic.equivalent);
            for point in (0..present.len()).filter(|point| is_born(*point)) {
                (strain[point], equivalent[point]) = (Matrix3::zeros(), 0.0);
            }
        }
    }

    /// Points whose family changed with the presence of points (of bonds, those that this process owns), and whether it gained material: all of their neighbourhood, or,
    /// where points have the family of their corners, those alone that were born or cut off.
    fn changed_families(&self, was_present: &[bool]) -> Vec<(usize, bool)> {
        let present = &self.state.present;
        let is_born = |point: usize| present[point] && !was_present[point];
        if self.nodes().corners().is_some() {
            let changed = (0..present.len()).filter(|&p| present[p] != was_present[p]);
            return changed.map(|point| (point, is_born(point))).collect();
        }
        let family = self.solid.base().family();
        let point_in = family.points_of_slots();
        let has_gained = |point: usize| {
            let mut gained = is_born(point);
            family.for_each_bond(point, |_, bond, slot| {
                gained |= bond.weight > 0.0 && is_born(point_in[slot] as usize);
            });
            gained
        };
        let changed = family.recalibrated().iter().map(|point| *point as usize);
        changed.map(|point| (point, has_gained(point))).collect()
    }

    /// The deformation under the present displacement.
    fn strained(&mut self, world: &World, rules: &[LayerRule]) -> Strained {
        self.set_displacement(world, rules);
        let evaluated = self.solid.evaluate(Wanted {
            gradient: true,
            ..Wanted::default()
        });
        Strained {
            gradient: evaluated.gradient.to_vec(),
            smoothing: evaluated.smoothing.to_vec(),
        }
    }

    /// Sets the displacement of the points that are present now and were not before, from that of the others and its
    /// `gradients`.
    fn place_born(
        &mut self,
        world: &World,
        was_present: &[bool],
        rules: &[LayerRule],
        gradients: &[Matrix3<f64>],
    ) {
        if let Some(corners) = self.nodes().corners().cloned() {
            let births = Births {
                was_present,
                present: &self.state.present,
                gradients,
                rules,
            };
            corners.place_born(&mut self.state.corners, births);
            self.write_means(world);
            return;
        }
        let present = &self.state.present;
        let points = world.reducer(self.body);
        let pairs = || was_present.iter().zip(present);
        let mut waiting: Vec<usize> = (0..points.owned())
            .zip(pairs())
            .filter(|(_, (before, now))| !**before && **now)
            .map(|(point, _)| point)
            .collect();
        if !points.any(!waiting.is_empty()) {
            return;
        }
        let known = pairs().map(|(before, now)| *before && *now).collect();
        let mut around = Surroundings::new(self.solid.base().family(), rules, known);
        let mut gradients: Vec<_> = gradients.iter().map(continued_part).collect();
        let mut displacement = world.write(self.fields.displacement);
        let mut velocity = self.fields.velocity.map(|v| world.write(v));
        while points.any(!waiting.is_empty()) {
            let state = MotionState {
                displacement: around.in_slots(&displacement, rules),
                gradient: &gradients,
                velocity: velocity.as_deref().unwrap_or(&[]),
            };
            let place = |&point: &usize| around.continued(point, &state);
            let placed: Vec<Option<Placed>> = waiting.par_iter().map(place).collect();
            // where nothing is there to which the material is attached, it stays at rest
            let is_alone = !points.any(placed.iter().any(Option::is_some));
            let mut left = Vec::new();
            for (point, placed) in waiting.into_iter().zip(placed) {
                let Some(placed) = placed.or_else(|| is_alone.then(Placed::default)) else {
                    left.push(point);
                    continue;
                };
                (displacement[point], gradients[point]) = (placed.displacement, placed.gradient);
                if let Some(velocity) = &mut velocity {
                    velocity[point] = placed.velocity;
                }
                around.known[point] = true;
            }
            waiting = left;
            points.bring(bytemuck::cast_slice_mut(&mut displacement));
            points.bring(bytemuck::cast_slice_mut(&mut gradients));
            if let Some(velocity) = &mut velocity {
                points.bring(bytemuck::cast_slice_mut(velocity));
            }
            around.bring(&points);
        }
    }

    /// Relieves material that was deposited above the annealing temperature (K) and has not cooled below it yet of its
    /// `stress` (Pa), which is then zero, and of its plastic strain.
    pub(super) fn relieve_fresh(
        &mut self,
        world: &World,
        temperature: &[f64],
        limit: f64,
        moduli: &[Moduli],
        stress: &mut [[f64; 6]],
    ) {
        let Some(birth_strain) = self.fields.birth_strain else {
            return;
        };
        let fresh = self.state.fresh.iter_mut().enumerate();
        for (_, fresh) in fresh.filter(|(i, _)| temperature[*i] < limit) {
            *fresh = false;
        }
        let Some(plasticity) = self.solid.base_mut().plasticity() else {
            return;
        };
        let mut birth_strain = world.write(birth_strain);
        let fresh = self.state.fresh.iter().enumerate().filter(|(_, f)| **f);
        for (i, _) in fresh {
            let relieved = plasticity.reset(i, &stress[i], &moduli[i]);
            birth_strain[i] += symmetric(&relieved);
            stress[i] = [0.0; 6];
        }
        drop(birth_strain);
        self.load_stress_free(world);
    }

    /// Lets the nodes that have material move, and no others.
    pub(super) fn set_in_motion(&mut self, world: &World) {
        self.free_present_nodes();
        let Some(velocity) = self.fields.velocity else {
            return;
        };
        let mut velocity = world.write(velocity);
        let mut of_corners = std::mem::take(&mut self.state.corners.velocity);
        let velocity = self.nodes().values_mut(&mut velocity, &mut of_corners);
        let (nodes, _) = velocity.as_chunks_mut::<3>();
        let nodes = nodes.iter_mut().zip(&self.node_density);
        nodes
            .filter(|(_, density)| **density == 0.0)
            .for_each(|(v, _)| *v = [0.0; 3]);
        let state = &mut self.state;
        state.corners.velocity = of_corners;
        state.verlet.forget_force();
        state.external_force = None;
        state.watch.renew();
    }

    /// Gives nodes the density of the material that is present, and no inverse density where there is none. Boundaries that hold
    /// nodes set theirs afterwards.
    pub(super) fn free_present_nodes(&mut self) {
        if self.state.present.is_empty() {
            return;
        }
        let density = self.nodes().densities(&self.density, &self.state.present);
        let (inverse, _) = self.free_inverse_density.as_chunks_mut::<3>();
        for (inverse, density) in inverse.iter_mut().zip(&density) {
            *inverse = [if *density > 0.0 { 1.0 / density } else { 0.0 }; 3];
        }
        self.node_density = density;
    }

    /// Gives the family the points that were present when the state was saved.
    pub(super) fn restore_presence(&mut self) {
        if !self.state.present.is_empty() {
            self.solid.set_points(PointStates {
                present: Some(&self.state.present),
                ..PointStates::default()
            });
            self.statics.forget_rigid_modes();
            self.free_present_nodes();
        }
    }

    /// Takes the strains with components at which points are free of stress, and notes them for the solvers.
    pub(super) fn load_stress_free(&mut self, world: &World) {
        let strains = self.set_stress_free(world);
        if !strains.is_empty() {
            let points = world.reducer(self.body);
            self.eigenstrain_size += points.max_abs(strains.as_flattened());
            self.note_stress_free(world, &strains);
        }
    }

    /// Takes the strains with components at which points are free of stress; returns them, empty if there are none.
    pub(super) fn set_stress_free(&mut self, world: &World) -> Vec<[f64; 6]> {
        let birth = self.fields.birth_strain.map(|f| world.read(f.into()));
        let tensor = self.fields.eigenstrain_tensor.map(|f| world.read(f));
        let (birth, tensor) = (birth.as_deref(), tensor.as_deref());
        let fields: Vec<&[Matrix3<f64>]> = [birth, tensor].into_iter().flatten().collect();
        if fields.is_empty() {
            return Vec::new();
        }
        let points = || (0..self.density.len()).into_par_iter();
        let components = |tensor: Matrix3<f64>| COMPONENTS.map(|at| tensor[at]);
        let sum = |point: usize| components(fields.iter().map(|field| field[point]).sum());
        let strains: Vec<[f64; 6]> = points().map(sum).collect();
        let prescribed: Vec<[f64; 6]> = match tensor {
            Some(tensor) => points().map(|point| components(tensor[point])).collect(),
            None => Vec::new(),
        };
        self.solid.set_points(PointStates {
            stress_free: Some(StressFreeStrain {
                strain: &strains,
                prescribed: &prescribed,
            }),
            ..PointStates::default()
        });
        strains
    }
}
