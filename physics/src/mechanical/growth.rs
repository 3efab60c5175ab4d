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
//! Points that were there before get other neighbours by a birth or a cut, and from the same displacement another H. Their
//! stress does not change by that:
//!
//! ```text
//! e0 += e(H with the new neighbours) - e(H with the old ones)
//! ```
//!
//! Births and cuts hence change no stress of any other point; what is unbalanced afterwards is what the material
//! that is gone carried.
//!
//! A body in motion (`explicit`) gets its material at the velocity of what is around it. The balance of momentum counts what
//! comes and goes with material as given.
//!
//! Correspondence solids only: their stress belongs to points. A bond of the other solids has the mean of the strains of its
//! ends, and a point born beside a loaded one would not be free of stress.

use nalgebra::{Matrix3, Vector3};
use perimelt_core::activity::is_active;
use perimelt_core::family::{Continuation, LayerRule};
use perimelt_core::solver::reduce::max_abs;
use perimelt_core::world::BodyIndex;
use perimelt_core::{Face, Family, Setup, SetupError, World, keys};
use rayon::prelude::*;

use super::classical::{COMPONENTS, Point};
use super::keys::{Formulation, Mechanical};
use super::momentum::{Momentum, place};
use super::step::Run;
use super::surface_stress::SurfaceStress;

/// Whether there is material at each point.
pub(super) fn mask(activity: &[f64]) -> Vec<bool> {
    activity.iter().map(|v| is_active(*v)).collect()
}

/// Refuses keys that do not go together with a body that grows or with inherent strains.
pub(super) fn check(
    keys: &Mechanical,
    setup: &Setup<'_>,
    body: BodyIndex,
) -> Result<(), SetupError> {
    let grows = setup.is_growing(body);
    let has_strain = setup.is_added(body, &keys::INHERENT_STRAIN);
    if !(grows || has_strain) {
        return Ok(());
    }
    let cause = match grows {
        true => "a body whose material is deposited or cut off",
        false => "a body with an inherent strain",
    };
    let refuse = |key: &str, what: &str, expected: &str| {
        Err(SetupError::value(
            key,
            format!("{cause} does not go together with {what}"),
            expected,
        ))
    };
    if keys.formulation != Formulation::Correspondence {
        let what = "bonds that have the mean strain of their ends";
        return refuse("formulation", what, "`formulation = \"correspondence\"`");
    }
    if !grows {
        return Ok(());
    }
    if keys.fracture.is_some() {
        return refuse("fracture", "breaking bonds", "no `fracture`");
    }
    if keys.surface_stress != SurfaceStress::Direct {
        let what = "a surface that is known from the start";
        return refuse("surface_stress", what, "\"direct\"");
    }
    Ok(())
}

/// Refuses a traction by a layer, whose slope takes no strain at birth into account.
pub(super) fn check_layer(
    setup: &Setup<'_>,
    body: BodyIndex,
    face: Face,
) -> Result<(), SetupError> {
    if !(setup.is_growing(body) || setup.is_added(body, &keys::INHERENT_STRAIN)) {
        return Ok(());
    }
    let message = format!(
        "the traction on face `{}` acts by a layer, which does not know the strain at which material was deposited",
        face.name()
    );
    Err(SetupError::value(
        "body",
        message,
        "`by = \"body_force\"` in `traction`",
    ))
}

/// The displacement of the points that are there, and where layers mirror them.
struct Surroundings<'a> {
    family: &'a Family,
    /// By slot, the point in it or mirrored there.
    point_in: Vec<u32>,
    /// By slot, the signs of the components of a symmetric image; one for points, zero for other images.
    sign: Vec<[f64; 3]>,
    /// Whether the displacement of each point is known.
    known: Vec<bool>,
}

/// State of motion of a body, by point.
struct MotionState<'a> {
    /// m.
    displacement: &'a [Vector3<f64>],
    gradient: &'a [Matrix3<f64>],
    /// m/s; empty in equilibrium.
    velocity: &'a [Vector3<f64>],
}

/// State of motion of a point.
#[derive(Clone, Copy, Default)]
struct Placed {
    displacement: Vector3<f64>,
    gradient: Matrix3<f64>,
    velocity: Vector3<f64>,
}

impl<'a> Surroundings<'a> {
    fn new(family: &'a Family, rules: &[LayerRule], known: Vec<bool>) -> Self {
        let point_in = family.points_of_slots();
        let mut sign = vec![[1.0; 3]; point_in.len()];
        for image in family.images(&Continuation::plain(rules)) {
            sign[image.slot] = match image.is_symmetric() {
                true => image.scale,
                false => [0.0; 3],
            };
        }
        Surroundings {
            family,
            point_in,
            sign,
            known,
        }
    }

    /// Continues the displacement of the known neighbours to a point; `None` if it has none.
    fn continued(&self, point: usize, state: &MotionState<'_>) -> Option<Placed> {
        let mut total = 0.0;
        let mut sum = Placed::default();
        self.family.for_each_bond(point, |_, bond, slot| {
            let other = self.point_in[slot] as usize;
            let sign = self.sign[slot];
            if bond.weight <= 0.0 || sign == [0.0; 3] || !self.known.get(other).unwrap_or(&false) {
                return;
            }
            let mirror = Matrix3::from_diagonal(&sign.into());
            let gradient = mirror * state.gradient[other] * mirror;
            let xi = Vector3::from(bond.xi);
            sum.displacement += bond.weight * (mirror * state.displacement[other] - gradient * xi);
            sum.gradient += bond.weight * gradient;
            if let Some(velocity) = state.velocity.get(other) {
                sum.velocity += bond.weight * (mirror * velocity);
            }
            total += bond.weight;
        });
        (total > 0.0).then(|| Placed {
            displacement: sum.displacement / total,
            gradient: sum.gradient / total,
            velocity: sum.velocity / total,
        })
    }
}

impl Run {
    /// Takes up points that became active or inactive since the last step.
    pub(super) fn follow_activity(&mut self, world: &World) {
        let Some(active) = world.activity(self.body).map(|a| mask(&a)) else {
            return;
        };
        if active == self.state.present {
            return;
        }
        self.load_displacement(world);
        let before = self.solid.gradients().to_vec();
        self.solid.set_present(&active);
        self.statics.forget_rigid_modes();
        let was_present = std::mem::replace(&mut self.state.present, active);
        let present = self.state.present.clone();
        let gone = self.momentum_where(world, |i| was_present[i] && !present[i]);
        self.place_born(world, &was_present, &before);
        let born = self.momentum_where(world, |i| !was_present[i] && present[i]);
        self.state.given += gone.times(-1.0).with_size_of(&gone);
        self.state.given += born;
        self.set_in_motion(world);
        self.load_displacement(world);
        let finite = self.balanced.angular;
        let after = self.solid.gradients().to_vec();
        let Some(birth_strain) = self.fields.birth_strain else {
            return;
        };
        let mut birth_strain = world.write(birth_strain);
        for &point in self.solid.family().recalibrated() {
            let point = point as usize;
            let strain = |gradient: &Matrix3<f64>| Point::strain(gradient, finite);
            match self.state.present[point] {
                true => birth_strain[point] += strain(&after[point]) - strain(&before[point]),
                false => birth_strain[point] = Matrix3::zeros(),
            }
        }
    }

    /// Sets the displacement of the points that are present now and were not before, from that of the others and its
    /// `gradients`.
    fn place_born(&self, world: &World, was_present: &[bool], gradients: &[Matrix3<f64>]) {
        let present = &self.state.present;
        let pairs = || was_present.iter().zip(present);
        let mut waiting: Vec<usize> = (0..present.len())
            .zip(pairs())
            .filter(|(_, (before, now))| !**before && **now)
            .map(|(point, _)| point)
            .collect();
        if waiting.is_empty() {
            return;
        }
        let known = pairs().map(|(before, now)| *before && *now).collect();
        let rules = world.layer_rules(self.layers);
        let mut around = Surroundings::new(self.solid.family(), &rules, known);
        let mut gradients = gradients.to_vec();
        let mut displacement = world.write(self.fields.displacement);
        let mut velocity = self.fields.velocity.map(|v| world.write(v));
        while !waiting.is_empty() {
            let state = MotionState {
                displacement: &displacement,
                gradient: &gradients,
                velocity: velocity.as_deref().unwrap_or(&[]),
            };
            let place = |&point: &usize| around.continued(point, &state);
            let placed: Vec<Option<Placed>> = waiting.par_iter().map(place).collect();
            // where nothing is there to which the material is attached, it stays at rest
            let is_alone = placed.iter().all(Option::is_none);
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
        }
        drop(velocity);
        let Some(hold) = self.fields.hold else {
            return;
        };
        let (constraint, held) = (world.read(hold.constraint), world.read(hold.displacement));
        let born = pairs()
            .enumerate()
            .filter(|(_, (before, now))| !**before && **now);
        for (point, _) in born {
            for axis in 0..3 {
                if constraint[point][axis] > 0.0 {
                    displacement[point][axis] = held[point][axis] / constraint[point][axis];
                }
            }
        }
    }

    /// Momentum of some points; zero in equilibrium.
    fn momentum_where(&self, world: &World, counts: impl Fn(usize) -> bool + Sync) -> Momentum {
        let Some(velocity) = self.fields.velocity else {
            return Momentum::default();
        };
        let velocity = &*world.read::<Vector3<f64>>(velocity.into());
        let displacement = &*world.read::<Vector3<f64>>(self.fields.displacement.into());
        let (points, density) = (&world.body(self.body).points, &self.density);
        Momentum::sum(self.balanced, points.len(), |i| {
            let mass = if counts(i) {
                density[i] * points.volume[i]
            } else {
                0.0
            };
            let x = place(&points.position[i], displacement[i].as_slice());
            [x, (mass * velocity[i]).into()]
        })
    }

    /// Lets the points that are present move, and no others.
    fn set_in_motion(&mut self, world: &World) {
        self.free_present_points();
        let Some(velocity) = self.fields.velocity else {
            return;
        };
        let mut velocity = world.write(velocity);
        let points = velocity.iter_mut().zip(&self.state.present);
        points
            .filter(|(_, p)| !**p)
            .for_each(|(v, _)| *v = Vector3::zeros());
        let state = &mut self.state;
        state.verlet.forget_force();
        state.external_force = None;
        state.watch.disturbed = true;
    }

    /// Gives points without material no inverse density. Boundaries that hold points set theirs afterwards.
    pub(super) fn free_present_points(&mut self) {
        let (inverse, _) = self.free_inverse_density.as_chunks_mut::<3>();
        let points = inverse
            .iter_mut()
            .zip(&self.density)
            .zip(&self.state.present);
        points.for_each(|((inverse, density), present)| {
            *inverse = [if *present { 1.0 / density } else { 0.0 }; 3];
        });
    }

    /// Gives the family the points that were present when the state was saved.
    pub(super) fn restore_presence(&mut self) {
        if !self.state.present.is_empty() {
            self.solid.set_present(&self.state.present);
            self.statics.forget_rigid_modes();
            self.free_present_points();
        }
    }

    /// Takes the strains with components at which points are free of stress.
    pub(super) fn load_stress_free(&mut self, world: &World) {
        let birth = self.fields.birth_strain.map(|f| world.read(f.into()));
        let inherent = self.fields.inherent_strain.map(|f| world.read(f));
        if birth.is_none() && inherent.is_none() {
            return;
        }
        let fields = [birth.as_deref(), inherent.as_deref()];
        let strain = |point: usize| {
            let sum: Matrix3<f64> = fields.into_iter().flatten().map(|field| field[point]).sum();
            COMPONENTS.map(|at| sum[at])
        };
        let strains = (0..self.density.len()).into_par_iter().map(strain);
        let strains: Vec<[f64; 6]> = strains.collect();
        self.eigenstrain_size += max_abs(strains.as_flattened());
        self.solid.set_stress_free(strains);
    }
}
