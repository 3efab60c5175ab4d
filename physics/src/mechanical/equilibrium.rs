//! Equilibrium: the displacement at which bond forces and loads balance.

use perimelt_core::family::LayerRule;
use perimelt_core::solver::{
    Hints, KrylovMethod, Newton, NewtonOptions, NewtonReport, NullSpace, Reducer, Relaxation,
    RelaxationOptions, Rhs, SolverError, fictitious_mass, largest_eigenvalue,
};
use perimelt_core::{Body, Step, Work, World};

use super::coarse::Coarse;
use super::keys::{MechanicalSolver, tolerance};
use super::residual::{Linearised, Residual, Tangent};
use super::rigid::{free_rigid_modes, rigid_modes};
use super::solid::{Solid, Stiffness, Wanted};
use super::step::{MechanicalRun, MechanicalState};

/// The solvers of equilibrium with what they keep between steps.
#[derive(Debug)]
pub(super) struct Statics {
    newton: Newton,
    relaxation: Relaxation,
    /// Unbalanced force relative to the loads.
    tolerance: f64,
    rigid: Option<FreeRigidModes>,
    coarse: Coarse,
}

/// Rigid modes that nothing resists.
#[derive(Debug)]
struct FreeRigidModes {
    /// Number of held components when they were found.
    held: usize,
    space: NullSpace,
}

impl Statics {
    /// Solvers for a body whose forces have a `tangent`.
    pub(super) fn new(solver: &MechanicalSolver, tangent: Tangent) -> Self {
        let options = match solver {
            MechanicalSolver::Relaxation(options) => *options,
            _ => RelaxationOptions::default(),
        };
        Statics {
            newton: Newton::new(NewtonOptions {
                relative_tolerance: 0.0,
                linear: tangent == Tangent::Stiffness,
                ..NewtonOptions::default()
            }),
            relaxation: Relaxation::new(options),
            tolerance: match solver {
                MechanicalSolver::QuasiStatic { tolerance } => *tolerance,
                _ => tolerance(),
            },
            rigid: None,
            coarse: Coarse::default(),
        }
    }

    /// Makes the next update find the rigid modes again: other points have material than before.
    pub(super) fn forget_rigid_modes(&mut self) {
        self.rigid = None;
    }

    /// Updates the free rigid modes and the coarse space of `body` where held points, moduli or bonds changed, and
    /// chooses the Krylov method.
    fn update(
        &mut self,
        residual: &mut Residual<'_>,
        body: &Body,
        present: &[bool],
    ) -> Result<(), SolverError> {
        let held = residual.constraint.iter().filter(|c| **c > 0.0).count();
        let has_changed = self.rigid.as_ref().is_none_or(|rigid| rigid.held != held);
        if residual.points.any(has_changed) {
            let positions = residual.solid.base().nodes.positions(body);
            let mut modes = rigid_modes(positions, &residual.points, body.dimension);
            for mode in &mut modes {
                let (points, _) = mode.as_chunks_mut::<3>();
                let points = points.iter_mut().zip(residual.present);
                points
                    .filter(|(_, p)| !**p)
                    .for_each(|(m, _)| *m = [0.0; 3]);
            }
            let space = free_rigid_modes(residual, modes)?;
            self.rigid = Some(FreeRigidModes { held, space });
        }
        self.coarse.update(body, residual, present);
        // Layers under traction and those that hold follow the points in another way than a mirror image would, but points do not follow the
        // layers: this makes the tangent nonsymmetric. So does plastic flow that follows another strain than that of the bonds, or whose law is nonsymmetric.
        let has_layers = residual.solid.base().nodes.corners().is_none();
        let is_symmetric = |rule: &LayerRule| rule.is_symmetric(body.dimension);
        let nonsymmetric = has_layers && !residual.rules.iter().all(is_symmetric)
            || residual.tangent == Tangent::Linearised
                && !residual.solid.base().has_symmetric_tangent();
        self.newton.options.krylov = match nonsymmetric {
            true => KrylovMethod::Gmres,
            false => KrylovMethod::ConjugateGradient,
        };
        Ok(())
    }

    /// Whether nothing resists some rigid motion.
    fn has_free_modes(&self) -> bool {
        let rigid = self.rigid.as_ref();
        rigid.is_some_and(|rigid| rigid.space.dimension().is_some())
    }

    /// Finds the displacement at which `residual` vanishes. The tolerance is relative to the loads, so that a good initial
    /// guess does not tighten it. Without a guess, the initial unbalanced force is that of the loads.
    fn solve(
        &mut self,
        residual: &mut Residual<'_>,
        displacement: &mut [f64],
        search: &Search<'_>,
    ) -> Result<NewtonReport, SolverError> {
        let rigid = self.rigid.as_ref().map(|rigid| &rigid.space);
        let hints = Hints {
            null_space: rigid,
            coarse: self.coarse.space.as_ref(),
            ..Hints::default()
        };
        let by_loads = |residual: &mut Residual<'_>, options: NewtonOptions| {
            let loads = size_of_loads(residual, search.held, search.time, rigid)?;
            Ok(NewtonOptions {
                relative_tolerance: 0.0,
                absolute_tolerance: (self.tolerance * loads).max(search.rounding),
                ..options
            })
        };
        let newton = &mut self.newton;
        newton.options = match search.is_guessed {
            true => by_loads(residual, newton.options)?,
            false => NewtonOptions {
                relative_tolerance: self.tolerance,
                absolute_tolerance: search.rounding,
                ..newton.options
            },
        };
        match newton.solve(residual, search.time, displacement, hints) {
            Err(error) if search.is_plastic => Err(about_flow(error)),
            Err(error) if residual.tangent != Tangent::Stiffness => {
                if !search.is_guessed {
                    newton.options = by_loads(residual, newton.options)?;
                }
                displacement.copy_from_slice(search.held);
                newton_from_linear(newton, residual, search.time, displacement, hints)
                    .or(Err(error))
            }
            report => report,
        }
    }
}

/// Where Newton's method starts, and what it is to reach.
struct Search<'a> {
    /// Displacement of the held components, zero elsewhere.
    held: &'a [f64],
    /// s.
    time: f64,
    /// Unbalanced force of rounding, N/m³ in the norm over all points.
    rounding: f64,
    /// Whether the initial displacement is more than that of held components.
    is_guessed: bool,
    is_plastic: bool,
}

/// Finds equilibrium by `balance`, breaks the bonds that exceed their limit most, and repeats until none exceeds
/// it, or breaks all that exceed it `once`; returns the sum of the work.
pub(super) fn balance_and_break(
    run: &mut MechanicalRun,
    world: &World,
    once: bool,
    mut balance: impl FnMut(&mut MechanicalRun) -> Result<Work, SolverError>,
) -> Result<Work, SolverError> {
    /// Bonds loaded to this fraction of the largest load break together: they are neighbours at a crack tip,
    /// which would break one after the other.
    const TOGETHER: f64 = 0.95;
    let mut work = Work::default();
    loop {
        work = work + balance(run)?;
        if run.fields.damage.is_none() {
            return Ok(work);
        }
        run.load_displacement(world);
        run.solid.evaluate(Wanted::force(&mut run.work));
        work.evaluations += 1;
        let fraction = if once { 0.0 } else { TOGETHER };
        let broke = run.break_bonds(world, fraction);
        if !world.reducer(run.body).any(broke) || once {
            return Ok(work);
        }
    }
}

/// Brings `run` into equilibrium by Newton-Krylov.
pub(super) fn newton(
    run: &mut MechanicalRun,
    world: &World,
    step: Step,
) -> Result<Work, SolverError> {
    let rules = world.layer_rules(run.layers);
    let sinks = run.fields.loads(world);
    let loads = sinks.of_points(&rules);
    let nodes = run.nodes().clone();
    let of_nodes = run.node_reducer(world);
    let constraint = &run.constraints(world)[..];
    let mut displacement = world.write(run.fields.displacement);
    let body = world.body(run.body);
    let is_plastic = run.fields.plastic.is_some();
    let MechanicalRun {
        solid,
        statics,
        relative_volume,
        work,
        loads: buffer,
        state:
            MechanicalState {
                corners,
                present: points,
                ..
            },
        ..
    } = run;
    let (body_force, present) = (nodes.loads(loads, points, buffer), nodes.present(points));
    let state = nodes.values_mut(&mut displacement, &mut corners.displacement);
    let mut residual = Residual {
        tangent: solid.base().tangent(),
        solid: &mut **solid,
        homogeneous: rules.iter().map(LayerRule::homogeneous).collect(),
        rules: &rules,
        body_force,
        volumes: (!relative_volume.is_empty()).then_some(&relative_volume[..]),
        constraint,
        present: &present,
        points: of_nodes,
        dimension: body.dimension,
    };
    statics.update(&mut residual, body, points)?;

    let held = work.iter_mut().zip(held_part(state, constraint));
    held.for_each(|(w, u)| *w = u);
    let search = Search {
        held: work,
        time: step.end(),
        rounding: rounding(&mut residual, run.eigenstrain_size, state),
        is_guessed: statics.has_free_modes() || residual.points.any(*state != work[..]),
        is_plastic,
    };
    let report = statics.solve(&mut residual, state, &search)?;
    let is_guessed = search.is_guessed;
    drop(displacement);
    run.write_means(world);
    Ok(Work {
        iterations: report.krylov_iterations,
        evaluations: report.evaluations + usize::from(is_guessed),
    })
}

/// The error of a body that flows: no equilibrium exists above its limit load, whatever the step.
pub(super) fn about_flow(error: SolverError) -> SolverError {
    match error {
        SolverError::NotConverged {
            method,
            iterations,
            residual,
            tolerance,
            ..
        } => SolverError::NotConverged {
            method,
            iterations,
            residual,
            tolerance,
            advice: "the body flows, and its load may be above the limit load, for which there is no equilibrium: lower the load, prescribe a displacement in its place, or give the material its `hardening_modulus`",
        },
        other => other,
    }
}

/// Newton's method from the equilibrium of small displacements; `state` holds the held components.
///
/// Where a step begins, held points and layers have all of their new displacement, and the others have none of it: long
/// displacements turn bonds over, and Newton's method may fail from there.
fn newton_from_linear(
    newton: &mut Newton,
    residual: &mut Residual<'_>,
    time: f64,
    state: &mut [f64],
    hints: Hints,
) -> Result<NewtonReport, SolverError> {
    let linear = NewtonOptions {
        linear: true,
        relative_tolerance: 1e-4,
        ..newton.options
    };
    let nonlinear = std::mem::replace(&mut newton.options, linear);
    let guess = newton.solve(&mut Linearised::new(residual), time, state, hints);
    newton.options = nonlinear;
    let guess = guess?;
    let report = newton.solve(residual, time, state, hints)?;
    Ok(NewtonReport {
        krylov_iterations: guess.krylov_iterations + report.krylov_iterations,
        evaluations: guess.evaluations + report.evaluations,
        ..report
    })
}

/// Norm of the loads: of the unbalanced force when only held components are displaced.
fn size_of_loads(
    residual: &mut Residual<'_>,
    held: &[f64],
    time: f64,
    rigid: Option<&NullSpace>,
) -> Result<f64, SolverError> {
    let mut loads = vec![0.0; held.len()];
    residual.rate(time, held, &mut loads)?;
    for (load, volume) in loads.iter_mut().zip(residual.volumes.unwrap_or(&[])) {
        *load *= volume;
    }
    if let Some(rigid) = rigid {
        rigid.project(&mut loads);
    }
    Ok(residual.points.norm(&loads))
}

/// The displacement of held components, zero elsewhere.
fn held_part(displacement: &[f64], constraint: &[f64]) -> impl Iterator<Item = f64> {
    let components = displacement.iter().zip(constraint);
    components.map(|(u, c)| if *c > 0.0 { *u } else { 0.0 })
}

/// Rounding of the sum of forces that cancel, N/m³ in the norm over all points. Loads may be no larger, as those
/// of a body that is uniformly heated between walls.
fn rounding(residual: &mut Residual<'_>, eigenstrain: f64, displacement: &[f64]) -> f64 {
    const RELATIVE: f64 = 1e-14;
    let (solid, points) = (&mut *residual.solid, &residual.points);
    let diagonal: Vec<f64> = solid.blocks().iter().map(|b| b[0] + b[1] + b[2]).collect();
    let horizon = points.max(solid.base().largest_horizon());
    let extension = eigenstrain * horizon + points.max_abs(displacement);
    RELATIVE * points.norm(&diagonal) * extension
}

/// Brings `run` into equilibrium by adaptive dynamic relaxation.
pub(super) fn relax(run: &mut MechanicalRun, world: &World) -> Result<Work, SolverError> {
    let rules = world.layer_rules(run.layers);
    let sinks = run.fields.loads(world);
    let loads = sinks.of_points(&rules);
    let nodes = run.nodes().clone();
    let points = &run.node_reducer(world);
    let constraint = &run.constraints(world)[..];
    let mut displacement = world.write(run.fields.displacement);
    let dimension = world.body(run.body).dimension;
    let MechanicalRun {
        solid,
        work,
        loads: buffer,
        state: MechanicalState {
            corners, present, ..
        },
        ..
    } = run;
    let body_force = nodes.loads(loads, present, buffer);
    let free = |i: usize| constraint[i] == 0.0 && i % 3 < dimension;
    load_fictitious_mass(&mut **solid, work, &rules, points, free);
    let state = nodes.values_mut(&mut displacement, &mut corners.displacement);
    let mut unbalanced = |u: &[f64], force: &mut [f64]| {
        solid.set_displacement(u, &rules);
        solid.evaluate(Wanted::force(force));
        force.iter_mut().zip(body_force).for_each(|(f, b)| *f += b);
        for (i, f) in force.iter_mut().enumerate() {
            *f = if free(i) { *f } else { 0.0 };
        }
        Ok(())
    };
    // the tolerance is relative to the loads, so that a good initial guess does not tighten it
    let held: Vec<f64> = held_part(state, constraint).collect();
    let mut loads = vec![0.0; held.len()];
    unbalanced(&held, &mut loads)?;
    let accelerations = loads.iter_mut().zip(&run.work);
    accelerations.for_each(|(load, mass)| *load /= mass);
    let relaxation = &mut run.statics.relaxation;
    let report = relaxation.solve(state, &run.work, points.norm(&loads), points, unbalanced)?;
    drop(displacement);
    run.write_means(world);
    Ok(Work {
        iterations: report.iterations,
        // those of the loads and of the final state
        evaluations: report.iterations + 2,
    })
}

/// Fictitious masses in proportion to the diagonal of the stiffness, scaled for stability with steps of 1.
fn load_fictitious_mass(
    solid: &mut dyn Solid,
    masses: &mut [f64],
    rules: &[LayerRule],
    points: &Reducer,
    is_free: impl Fn(usize) -> bool,
) {
    for (mass, block) in masses.chunks_exact_mut(3).zip(solid.blocks()) {
        let trace: f64 = block[..3].iter().sum();
        // a point without unbroken bonds does not move, whatever its mass
        let least = if trace > 0.0 { trace } else { 1.0 };
        (0..3).for_each(|axis| mass[axis] = block[axis] + least);
    }
    points.bring(masses);
    let inverse = masses.iter().enumerate();
    let inverse = inverse.map(|(i, mass)| {
        if is_free(i) && *mass > 0.0 {
            1.0 / mass
        } else {
            0.0
        }
    });
    let inverse: Vec<f64> = inverse.collect();
    let homogeneous: Vec<LayerRule> = rules.iter().map(LayerRule::homogeneous).collect();
    let stiffest = largest_eigenvalue(&inverse, points, |u, out| {
        solid.set_displacement(u, &homogeneous);
        solid.stiffness(Stiffness::Elastic, out);
    });
    let steepest = solid.base().elastic_law.steepest;
    let factor = fictitious_mass(stiffest * steepest, 1.0);
    masses.iter_mut().for_each(|mass| *mass *= factor);
}
