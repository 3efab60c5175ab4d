//! Set-up of a simulation: plugins publish, then they are prepared, and the order of the steps follows.

use std::path::Path;

use super::{ClockState, Named, Ready, Simulation, TimeOptions};
use crate::error::{Problem, SetupError};
use crate::plugin::{Coupler, Physics, RunningCoupler, RunningPhysics, supported};
use crate::schedule::Plan;
use crate::setup::Setup;
use crate::stepping::{Stepping, Update};
use crate::world::World;
use crate::world::families::FamilySize;

/// Mistakes of a composition, each with the plugin at fault.
pub type Faults = Vec<(Culprit, SetupError)>;

/// A plugin at fault, by its kind and position in the case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Culprit {
    /// The n-th physics.
    Physics(usize),
    /// The n-th coupler.
    Coupler(usize),
}

impl Simulation {
    /// Prepares every plugin and derives the order. `folder` is where relative paths start.
    ///
    /// # Errors
    /// The mistakes of what plugins publish, else those of all plugins, else those of how the plugins fit together.
    pub fn prepare(
        mut world: World,
        mut couplers: Vec<Named<dyn Coupler>>,
        mut physics: Vec<Named<dyn Physics>>,
        options: TimeOptions,
        folder: &Path,
    ) -> Result<Simulation, Faults> {
        let composition = composition(&couplers, &physics);
        let couplers_count = couplers.len();
        let culprit = |plugin: usize| match plugin.checked_sub(couplers_count) {
            Some(physics) => Culprit::Physics(physics),
            None => Culprit::Coupler(plugin),
        };
        let at = |(plugin, error)| (culprit(plugin), error);
        let mut setup = Setup::new(&mut world, folder);
        publish(&mut setup, &mut couplers, &mut physics)
            .map_err(|faults| faults.into_iter().map(at).collect::<Faults>())?;
        setup.divide_bodies().map_err(|fault| vec![at(fault)])?;
        let labels = couplers.iter().map(|c| &c.label);
        let labels: Vec<String> = labels
            .chain(physics.iter().map(|p| &p.label))
            .cloned()
            .collect();
        let prepared = prepare_all(&mut setup, couplers, physics);
        let (couplers, physics) =
            prepared.map_err(|faults| faults.into_iter().map(at).collect::<Faults>())?;
        let mut declared = setup
            .finish()
            .map_err(|mistakes| mistakes.into_iter().map(at).collect::<Faults>())?;
        world.plan_exchanges();
        let families = world.families();
        let sizes = families.map(|(of, family)| FamilySize::of(of.body, &family));
        let family_sizes = sizes.chain(declared.kept_families.drain(..)).collect();
        let body_of_field: Vec<usize> = world.fields.iter().map(|f| f.body).collect();
        let plan = Plan::derive(
            couplers.len(),
            physics.len(),
            &declared.declarations,
            &body_of_field,
            &labels,
        );
        let plan = plan.map_err(|problem| {
            let first = match &problem {
                Problem::Cycle(names) => labels.iter().position(|l| Some(l) == names.first()),
                _ => None,
            };
            vec![(culprit(first.unwrap_or(0)), SetupError::new("", problem))]
        })?;
        let mut stepping = declared.stepping.drain(..).zip(labels);
        let couplers = ready(couplers, &mut stepping);
        let physics = ready(physics, &mut stepping);
        drop(stepping);
        check_updates(&plan, &physics).map_err(|fault| vec![fault])?;
        check_rates(&plan, &couplers, &physics).map_err(|fault| vec![fault])?;
        world.set_times(&(0..body_of_field.len()).collect::<Vec<_>>(), 0.0);
        let count = physics.len();
        let rates = plan.groups.iter();
        let rates = rates.map(|g| vec![Vec::new(); g.rates.len()]).collect();
        Ok(Simulation {
            world,
            couplers,
            physics,
            composition,
            plan,
            options,
            clock: ClockState::at_start(count),
            sub_step: vec![f64::INFINITY; count],
            stable_step: vec![None; count],
            stable_exchange: Vec::new(),
            group_steps: Vec::new(),
            rates,
            family_sizes,
            requests: declared.requests,
            warnings: declared.warnings,
            notes: declared.notes,
            wall: vec![0.0; count],
        })
    }
}

/// Plugins with how they are stepped and their names, as many as there are.
fn ready<P: ?Sized>(
    plugins: Vec<Box<P>>,
    stepping: &mut impl Iterator<Item = (Stepping, String)>,
) -> Vec<Ready<P>> {
    let plugins = plugins.into_iter().zip(stepping);
    let ready = plugins.map(|(plugin, (stepping, label))| Ready {
        label,
        plugin,
        stepping,
    });
    ready.collect()
}

fn composition(
    couplers: &[Named<dyn Coupler>],
    physics: &[Named<dyn Physics>],
) -> serde_json::Value {
    let physics = physics.iter();
    let physics: Vec<_> = physics
        .map(|p| serde_json::to_value(&p.plugin).unwrap_or_default())
        .collect();
    let couplers = couplers.iter();
    let couplers: Vec<_> = couplers
        .map(|c| serde_json::to_value(&c.plugin).unwrap_or_default())
        .collect();
    serde_json::json!({ "physics": physics, "couplers": couplers })
}

/// Lets all plugins publish what others need when they are prepared. Mistakes come with the position of the plugin.
fn publish(
    setup: &mut Setup<'_>,
    couplers: &mut [Named<dyn Coupler>],
    physics: &mut [Named<dyn Physics>],
) -> Result<(), Vec<(usize, SetupError)>> {
    for c in &*couplers {
        let supports = supported::<dyn Coupler>(c.plugin.typetag_name());
        setup.add_plugin(&c.label, false, supports);
    }
    for p in &*physics {
        let supports = supported::<dyn Physics>(p.plugin.typetag_name());
        setup.add_plugin(&p.label, true, supports);
    }
    let mut faults = Vec::new();
    for (i, c) in couplers.iter_mut().enumerate() {
        setup.enter(i);
        let published = c.plugin.publish(setup);
        faults.extend(published.err().map(|e| (i, e)));
    }
    for (i, p) in (couplers.len()..).zip(physics) {
        setup.enter(i);
        let published = p.plugin.publish(setup);
        faults.extend(published.err().map(|e| (i, e)));
    }
    match faults.is_empty() {
        true => Ok(()),
        false => Err(faults),
    }
}

/// Couplers and physics that are ready to run, in the order of the case.
type Prepared = (Vec<Box<dyn RunningCoupler>>, Vec<Box<dyn RunningPhysics>>);

/// Prepares couplers, then physics: those first that decide where points are, since others sum over the same bonds.
fn prepare_all(
    setup: &mut Setup<'_>,
    couplers: Vec<Named<dyn Coupler>>,
    physics: Vec<Named<dyn Physics>>,
) -> Result<Prepared, Vec<(usize, SetupError)>> {
    let count = couplers.len();
    let mut faults = Vec::new();
    let mut ready = Vec::new();
    for (i, c) in couplers.into_iter().enumerate() {
        setup.enter(i);
        match c.plugin.prepare(setup) {
            Ok(coupler) => ready.push(coupler),
            Err(e) => faults.push((i, e)),
        }
    }
    let mut in_order: Vec<_> = (count..).zip(physics).collect();
    in_order.sort_by_key(|(i, _)| !setup.decides_points(*i));
    let mut ready_physics = Vec::new();
    for (i, p) in in_order {
        setup.enter(i);
        match p.plugin.prepare(setup) {
            Ok(physics) => ready_physics.push((i, physics)),
            Err(e) => faults.push((i, e)),
        }
    }
    if !faults.is_empty() {
        faults.sort_by_key(|(i, _)| *i);
        return Err(faults);
    }
    ready_physics.sort_by_key(|(i, _)| *i);
    let physics = ready_physics.into_iter().map(|(_, physics)| physics);
    Ok((ready, physics.collect()))
}

/// Refuses couplers that act on a steady state by the rate of another state.
fn check_rates(
    plan: &Plan,
    couplers: &[Ready<dyn RunningCoupler>],
    physics: &[Ready<dyn RunningPhysics>],
) -> Result<(), (Culprit, SetupError)> {
    let acts_by_rate = |c: &&usize| couplers[**c].stepping.acts_by_rate;
    for (before, physics) in plan.before.iter().zip(physics) {
        if !physics.stepping.is_steady {
            continue;
        }
        if let Some(&c) = before.iter().find(acts_by_rate) {
            let message = format!(
                "`{}` acts by the rate of a state, and `{}` finds a steady one, in which nothing changes",
                couplers[c].label, physics.label
            );
            let mistake = SetupError::value("", message, "another `solver` of that physics");
            return Err((Culprit::Coupler(c), mistake));
        }
    }
    Ok(())
}

/// Refuses physics that advance together although one of them advances only once per log interval.
fn check_updates(
    plan: &Plan,
    physics: &[Ready<dyn RunningPhysics>],
) -> Result<(), (Culprit, SetupError)> {
    let coupled = plan.groups.iter().filter(|g| g.members.len() > 1);
    let rare = |p: &&usize| physics[**p].stepping.update == Update::Log;
    match coupled.flat_map(|g| &g.members).find(rare) {
        Some(&p) => {
            let message = format!(
                "`{}` exchanges heat or momentum with another physics, so that both advance in every macro step",
                physics[p].label
            );
            let mistake = SetupError::value("update", message, "`update = \"step\"`");
            Err((Culprit::Physics(p), mistake))
        }
        None => Ok(()),
    }
}
