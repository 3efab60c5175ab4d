//! Equilibrium: the displacement at which bond forces and loads balance.

use nalgebra::Vector3;
use perimelt_core::family::{Continuation, LayerRule};
use perimelt_core::solver::reduce::{max_abs, norm};
use perimelt_core::solver::{
    At, CoarseSpace, Hints, KrylovMethod, NullSpace, Rhs, SolverError, Spring, fictitious_mass,
    largest_eigenvalue,
};
use perimelt_core::{Body, BrokenBonds, Step, Work, World};
use rayon::prelude::*;

use super::Run;
use super::solid::Solid;

/// Unbalanced force of a displacement; zero for held components.
struct Residual<'a> {
    solid: &'a mut dyn Solid,
    rules: &'a [LayerRule],
    /// The rules without their prescribed values: for displacements that are differences.
    homogeneous: Vec<LayerRule>,
    body_force: &'a [f64],
    /// Volumes of the components, where they differ: forces are densities.
    volumes: Option<&'a [f64]>,
    constraint: &'a [f64],
    dimension: usize,
    tangent: Tangent,
}

/// How the residual changes with the displacement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Tangent {
    /// By the stiffness.
    Stiffness,
    /// By the stiffness of the flowing body.
    Plastic,
    /// By differences of forces.
    Differences,
}

impl Residual<'_> {
    fn release(&self, out: &mut [f64], value: f64) {
        for (i, (f, c)) in out.iter_mut().zip(self.constraint).enumerate() {
            if *c > 0.0 || i % 3 >= self.dimension {
                *f = value;
            }
        }
    }
}

impl Rhs for Residual<'_> {
    fn rate(&mut self, _: f64, state: &[f64], rate: &mut [f64]) -> Result<(), SolverError> {
        self.solid.set_displacement(state, self.rules);
        self.solid.force(rate);
        rate.iter_mut()
            .zip(self.body_force)
            .for_each(|(f, b)| *f += b);
        self.release(rate, 0.0);
        Ok(())
    }

    fn tangent(
        &mut self,
        _: At<'_>,
        direction: &[f64],
        out: &mut [f64],
    ) -> Result<bool, SolverError> {
        if self.tangent == Tangent::Differences {
            return Ok(false);
        }
        self.solid.set_displacement(direction, &self.homogeneous);
        match self.tangent {
            Tangent::Plastic => self.solid.tangent(out),
            _ => self.solid.stiffness(out),
        }
        out.iter_mut().for_each(|f| *f = -*f);
        self.release(out, 0.0);
        Ok(true)
    }

    fn weights(&self) -> Option<&[f64]> {
        self.volumes
    }

    /// Once in each iteration, right after the rate of its state.
    fn tangent_diagonal(&mut self, _: At<'_>, out: &mut [f64]) -> Result<bool, SolverError> {
        if self.tangent == Tangent::Plastic {
            self.solid.linearise();
        }
        for (out, block) in out.chunks_exact_mut(3).zip(self.solid.blocks()) {
            (0..3).for_each(|axis| out[axis] = -block[axis]);
        }
        self.release(out, -1.0);
        if let Some(fracture) = self.solid.fracture() {
            // a point that lost its bonds stays where it is
            let lost = |point| fracture.state.broken.of(point) > 0;
            let zeros = out.iter_mut().enumerate().filter(|(_, d)| **d == 0.0);
            zeros
                .filter(|(i, _)| lost(i / 3))
                .for_each(|(_, d)| *d = -1.0);
        }
        match out.iter().position(|&d| d == 0.0) {
            Some(component) => Err(SolverError::model(Loose {
                point: component / 3,
                axis: ["x", "y", "z"][component % 3],
            })),
            None => Ok(true),
        }
    }
}

/// A point that can move along an axis without stretching a bond.
#[derive(Debug, thiserror::Error)]
#[error(
    "no bond of point {point} resists motion along {axis}: the body needs two points or more along {axis}, or that direction held"
)]
struct Loose {
    point: usize,
    axis: &'static str,
}

/// Finds equilibrium by `balance`, breaks the bonds that are loaded most beyond their limit, and goes on
/// until none exceeds it; returns the sum of the work.
pub(super) fn break_and_balance(
    run: &mut Run,
    world: &World,
    mut balance: impl FnMut(&mut Run) -> Result<Work, SolverError>,
) -> Result<Work, SolverError> {
    /// Bonds loaded to this share of the worst break with it: neighbours at a crack tip, of which one
    /// breaking would soon break the other.
    const TOGETHER: f64 = 0.95;
    let mut work = Work::default();
    loop {
        let balanced = balance(run)?;
        work.iterations += balanced.iterations;
        work.evaluations += balanced.evaluations;
        if run.damage.is_none() {
            return Ok(work);
        }
        run.load_displacement(world);
        run.solid.force(&mut run.work);
        work.evaluations += 1;
        if !run.break_bonds(world, TOGETHER) {
            return Ok(work);
        }
    }
}

/// Brings `run` into equilibrium by Newton-Krylov.
pub(super) fn newton(run: &mut Run, world: &World, step: Step) -> Result<Work, SolverError> {
    let body_force = run.body_force.map(|b| world.read(b));
    let body_force: &[f64] = body_force
        .as_deref()
        .map_or(&[], |b| bytemuck::cast_slice(b));
    let constraint = &run.constraints(world)[..];
    let rules = world.layer_rules(run.layers);
    let mut displacement = world.write(run.displacement);
    let state: &mut [f64] = bytemuck::cast_slice_mut(&mut displacement);
    let body = world.body(run.body);
    let mut residual = Residual {
        solid: &mut *run.solid,
        homogeneous: rules.iter().map(LayerRule::homogeneous).collect(),
        rules: &rules,
        body_force,
        volumes: (!run.relative_volume.is_empty()).then_some(&run.relative_volume[..]),
        constraint,
        dimension: body.dimension,
        tangent: match (run.plastic.is_some(), run.newton.options.linear) {
            (true, _) => Tangent::Plastic,
            (false, true) => Tangent::Stiffness,
            (false, false) => Tangent::Differences,
        },
    };

    let held = constraint.iter().filter(|c| **c > 0.0).count();
    if run.rigid.as_ref().is_none_or(|(count, _)| *count != held) {
        let modes = rigid_motions(&body.points.position, body.dimension);
        run.rigid = Some((held, hindered_by_nothing(&mut residual, modes)?));
    }
    let (_, rigid) = run.rigid.as_ref().expect("set above");
    run.coarse.update(body, &residual);

    // layers under traction follow the points, which feel them, but not the other way round; and bonds
    // feel plastic strains that follow the gradients of families, not themselves
    let lopsided = rules.iter().any(|r| r.traction.is_some())
        || run.plastic.is_some() && !residual.solid.flows_by_its_own_strain();
    run.newton.options.krylov = match lopsided {
        true => KrylovMethod::Gmres,
        false => KrylovMethod::ConjugateGradient,
    };
    // unbalanced force is measured against the loads: a good first guess must not tighten it
    let held = run.work.iter_mut().zip(held_part(state, constraint));
    held.for_each(|(w, u)| *w = u);
    let rounding = rounding(residual.solid, run.eigenstrain_size, state);
    // where the guess is none, its unbalanced force is the loads
    let unguessed = rigid.dimension().is_none() && *state == run.work[..];
    let options = &mut run.newton.options;
    if unguessed {
        (options.relative_tolerance, options.absolute_tolerance) = (run.tolerance, rounding);
    } else {
        let mut loads = vec![0.0; state.len()];
        residual.rate(step.end(), &run.work, &mut loads)?;
        for (load, volume) in loads.iter_mut().zip(&run.relative_volume) {
            *load *= volume;
        }
        rigid.project(&mut loads);
        options.relative_tolerance = 0.0;
        options.absolute_tolerance = (run.tolerance * norm(&loads)).max(rounding);
    }
    let hints = Hints {
        null_space: Some(rigid),
        coarse: run.coarse.space.as_ref(),
        ..Hints::default()
    };
    let report = run.newton.solve(&mut residual, step.end(), state, hints)?;
    Ok(Work {
        iterations: report.krylov_iterations,
        // and that of the loads
        evaluations: report.evaluations + usize::from(!unguessed),
    })
}

/// The coarse space of a body, and what it was made of.
#[derive(Debug, Default)]
pub(super) struct Coarse {
    space: Option<CoarseSpace>,
    /// Stiffness of the bonds of each point, Pa.
    stiffness: Vec<f64>,
    constraint: Vec<f64>,
    broken: usize,
}

impl Coarse {
    /// Makes the space anew where what it is made of changed: never by halves, so that a run that is
    /// resumed goes on with the same.
    fn update(&mut self, body: &Body, residual: &Residual<'_>) {
        let Residual {
            solid,
            constraint,
            volumes,
            ..
        } = residual;
        let (family, dimension) = (solid.family(), body.dimension);
        let points = 0..body.points.len();
        let stiffness = points.map(|p| solid.moduli_of(p).bond_stiffness(dimension));
        let stiffness: Vec<f64> = stiffness.collect();
        let broken = solid.fracture().map(|f| &f.state.broken);
        let total = broken.map_or(0, BrokenBonds::total);
        if self.stiffness == stiffness && self.constraint == *constraint && self.broken == total {
            return;
        }
        let free = constraint.as_chunks::<3>().0.iter().map(|c| {
            std::array::from_fn(|axis| match c[axis] > 0.0 || axis >= dimension {
                true => 0.0,
                false => 1.0,
            })
        });
        let point_in = family.points_of_slots();
        /// Scale of the layers that tractions bend.
        const BENT: [f64; 3] = [0.0; 3];
        let position = &body.points.position;
        let mut scales = vec![[1.0; 3]; point_in.len()];
        // points bend the layers of tractions as they go, so that these do not resist as mirror images
        // would; the bonds of the body stand for them
        let rules = residual.homogeneous.iter().map(|rule| LayerRule {
            scale: match rule.traction {
                Some(_) => BENT,
                None => rule.scale,
            },
            ..*rule
        });
        let rules: Vec<LayerRule> = rules.collect();
        for image in family.images(&Continuation::plain(&rules)) {
            scales[image.slot] = image.scale;
        }
        let stand_in = |point: usize| {
            let [mut all, mut own] = [0.0; 2];
            family.for_each_bond(point, |_, bond, slot| {
                all += bond.weight;
                if scales[slot] != BENT {
                    own += bond.weight;
                }
            });
            if own > 0.0 { all / own } else { 1.0 }
        };
        let stand_in: Vec<f64> = (0..position.len()).into_par_iter().map(stand_in).collect();
        // springs to nothing but the next points along the axes do not resist shear
        let only_next = family.bonds() <= 2 * dimension * position.len() && dimension > 1;
        let across = match only_next && solid.bonds_shear() {
            true => 0.2,
            false => 0.0,
        };
        let springs = |point: usize, receive: &mut dyn FnMut(Spring)| {
            let volume = volumes.map_or(1.0, |v| v[3 * point]);
            family.for_each_bond(point, |number, bond, slot| {
                if scales[slot] == BENT || broken.is_some_and(|b| b.is_broken(point, number)) {
                    return;
                }
                let other = point_in[slot] as usize;
                let sum = stiffness[point] * bond.weight + stiffness[other] * bond.dual;
                receive(Spring {
                    stiffness: 0.25 * (stand_in[point] + stand_in[other]) * volume * sum
                        / bond.length,
                    across,
                    along: bond.xi.map(|xi| xi / bond.length),
                    to: other,
                    scale: scales[slot],
                });
            });
        };
        *self = Coarse {
            space: CoarseSpace::new(position, dimension, free.collect(), springs),
            constraint: constraint.to_vec(),
            broken: total,
            stiffness,
        };
    }
}

/// The displacement of held components alone: its forces are the loads.
fn held_part(displacement: &[f64], constraint: &[f64]) -> impl Iterator<Item = f64> {
    let components = displacement.iter().zip(constraint);
    components.map(|(u, c)| if *c > 0.0 { *u } else { 0.0 })
}

/// What rounding leaves of forces that cancel, N/m³ in the norm over all points: loads may be nothing
/// but that, as those of a body that is uniformly heated between walls.
fn rounding(solid: &mut dyn Solid, eigenstrain: f64, displacement: &[f64]) -> f64 {
    const SHARE: f64 = 1e-14;
    let diagonal: Vec<f64> = solid.blocks().iter().map(|b| b[0] + b[1] + b[2]).collect();
    let extension = eigenstrain * solid.horizon() + max_abs(displacement);
    SHARE * norm(&diagonal) * extension
}

/// Brings `run` into equilibrium by adaptive dynamic relaxation.
pub(super) fn relax(run: &mut Run, world: &World) -> Result<Work, SolverError> {
    let body_force = run.body_force.map(|b| world.read(b));
    let body_force: &[f64] = body_force
        .as_deref()
        .map_or(&[], |b| bytemuck::cast_slice(b));
    let constraint = &run.constraints(world)[..];
    let rules = world.layer_rules(run.layers);
    let mut displacement = world.write(run.displacement);
    let dimension = world.body(run.body).dimension;
    let Run { solid, work, .. } = run;
    // a mass of the shape of the stiffness, scaled for stability with dt = 1
    for (mass, block) in work.chunks_exact_mut(3).zip(solid.blocks()) {
        let trace: f64 = block[..3].iter().sum();
        // a point that lost its bonds stays where it is, whatever its mass
        let least = if trace > 0.0 { trace } else { 1.0 };
        (0..3).for_each(|axis| mass[axis] = block[axis] + least);
    }
    let free = |i: usize| constraint[i] == 0.0 && i % 3 < dimension;
    let inverse: Vec<f64> = (0..work.len())
        .map(|i| if free(i) { 1.0 / work[i] } else { 0.0 })
        .collect();
    let homogeneous: Vec<LayerRule> = rules.iter().map(LayerRule::homogeneous).collect();
    let stiffest = largest_eigenvalue(&inverse, |u, out| {
        solid.set_displacement(u, &homogeneous);
        solid.stiffness(out);
    });
    work.iter_mut()
        .for_each(|mass| *mass *= fictitious_mass(stiffest, 1.0));
    let state = bytemuck::cast_slice_mut::<Vector3<f64>, f64>(&mut displacement);
    let mut unbalanced = |u: &[f64], force: &mut [f64]| {
        solid.set_displacement(u, &rules);
        solid.force(force);
        force.iter_mut().zip(body_force).for_each(|(f, b)| *f += b);
        for (i, f) in force.iter_mut().enumerate() {
            *f = if free(i) { *f } else { 0.0 };
        }
        Ok(())
    };
    // measured against the loads: a good first guess must not tighten it
    let held: Vec<f64> = held_part(state, constraint).collect();
    let mut loads = vec![0.0; held.len()];
    unbalanced(&held, &mut loads)?;
    let accelerations = loads.iter_mut().zip(&run.work);
    accelerations.for_each(|(load, mass)| *load /= mass);
    let report = run
        .relaxation
        .solve(state, &run.work, norm(&loads), unbalanced)?;
    Ok(Work {
        iterations: report.iterations,
        // that of the loads, and that which found the equilibrium
        evaluations: report.iterations + 2,
    })
}

/// Translations and infinitesimal rotations of the points, three components each.
fn rigid_motions(position: &[Vector3<f64>], dimension: usize) -> Vec<Vec<f64>> {
    let centre = position.iter().sum::<Vector3<f64>>() / position.len() as f64;
    let size = position
        .iter()
        .map(|x| (x - centre).norm())
        .fold(0.0, f64::max);
    let field = |motion: &dyn Fn(Vector3<f64>) -> Vector3<f64>| {
        position
            .iter()
            .flat_map(|x| <[f64; 3]>::from(motion((x - centre) / size)))
            .collect()
    };
    let axis = |a: usize| Vector3::ith_axis(a).into_inner();
    let mut modes: Vec<Vec<f64>> = (0..dimension).map(|a| field(&|_| axis(a))).collect();
    let rotations = match dimension {
        1 => 0..0,
        2 => 2..3,
        _ => 0..3,
    };
    modes.extend(rotations.map(|a| field(&|x| axis(a).cross(&x))));
    modes
}

/// Those of `modes` that meet no resistance.
fn hindered_by_nothing(
    residual: &mut Residual<'_>,
    modes: Vec<Vec<f64>>,
) -> Result<NullSpace, SolverError> {
    let mut free = Vec::new();
    let mut resistance = vec![0.0; modes[0].len()];
    let stiffness = residual
        .solid
        .blocks()
        .iter()
        .map(|b| b[0])
        .fold(0.0, f64::max);
    for mode in modes {
        let held = mode
            .iter()
            .zip(residual.constraint)
            .any(|(m, c)| *c > 0.0 && *m != 0.0);
        residual
            .solid
            .set_displacement(&mode, &residual.homogeneous);
        residual.solid.stiffness(&mut resistance);
        // rounding of a sum of a few hundred terms, against one hindered point among millions
        if !held && norm(&resistance) <= 1e-10 * stiffness * norm(&mode) {
            free.push(mode);
        }
    }
    Ok(NullSpace::new(free))
}
