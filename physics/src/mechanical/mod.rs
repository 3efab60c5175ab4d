//! Deformation of a thermoelastic solid.
//!
//! The laws stand in [`stretch`] (bond-based and ordinary state-based) and [`correspondence`], behind
//! what the solvers need of them ([`solid::Solid`]). This file is the plugin: it balances
//! (`quasi_static`, `relaxation`) or integrates (`explicit`)
//!
//! ```text
//! rho u'' = sum_j T_ij - T_ji + b                               Wang (2025), eq. 3.2
//! ```
//!
//! with force states T that follow the displacement and the eigenstrain (sink field, from thermal
//! expansion), and b the sink field `body_force`, N/m³. Moduli follow the temperature where the
//! material gives tables.
//!
//! Metal flows plastically by [`plasticity`]. Assumes small eigenstrains with `linear` kinematics.

mod classical;
pub mod correspondence;
#[cfg(test)]
mod correspondence_tests;
mod equilibrium;
pub mod fracture;
#[cfg(test)]
mod fracture_tests;
mod gradient;
#[cfg(test)]
mod layer_tests;
pub mod moduli;
mod motion;
pub mod ordinary;
pub mod plasticity;
pub mod section;
pub mod solid;
pub mod stretch;
#[cfg(test)]
mod tests;

use nalgebra::{Matrix3, Vector3};
use perimelt_core::family::LayerRule;
use perimelt_core::solver::reduce::{max_abs, sum_of, weighted_sum};
use perimelt_core::solver::{
    Newton, NewtonOptions, NullSpace, Relaxation, RelaxationOptions, Verlet, largest_eigenvalue,
};
use perimelt_core::world::{BodyIndex, LayersHandle};
use perimelt_core::{
    Balance, Clock, Correction, FamilySpec, Horizon, Influence, PartialVolume, Physics, Read,
    ReadIfProvided, Report, RunError, Setup, SetupError, Step, StepSize, Update, Work, World,
    Write, keys,
};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use correspondence::Correspondence;
use fracture::{Criterion, Fracture, FractureSection, FractureState};
use moduli::{Elasticity, Moduli, Plane};
use ordinary::Ordinary;
use plasticity::{Inelastic, Plasticity, PlasticitySection};
use section::Section;
use solid::Solid;

/// Thermoelastic solid: bond-based, ordinary state-based or by correspondence; owns `displacement` and `velocity`, consumes `eigenstrain`
/// and `body_force`, provides `stress` and `conjugate_stress`.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Mechanical {
    /// Body that deforms; may be left out when there is only one.
    #[serde(default)]
    pub body: Option<String>,
    /// What a bond carries.
    #[serde(default)]
    pub formulation: Formulation,
    /// What holds across the thickness of a 2D body.
    #[serde(default)]
    pub plane: Plane,
    /// Resistance G of `correspondence` to modes without strain.
    #[serde(default = "tenth")]
    pub stabilisation: f64,
    /// Horizon in spacings of each point, or `{ length = ... }` in m, the same everywhere; 3 spacings
    /// when left out, or 2 for `correspondence`.
    #[serde(default)]
    pub horizon: Option<Horizon>,
    /// Partial volume of neighbours at the edge of the horizon.
    #[serde(default)]
    pub partial_volume: PartialVolume,
    /// Influence of neighbours by their distance.
    #[serde(default)]
    pub influence: Influence,
    /// Calibration of the bonds.
    #[serde(default)]
    pub correction: Correction,
    /// Small displacements, or current lengths and directions of bonds.
    #[serde(default)]
    pub kinematics: Kinematics,
    /// Plastic flow, such as `{ annealing_temperature = 1300 }`; left out: elastic.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub plasticity: Option<PlasticitySection>,
    /// When bonds break, such as `{ no_fail = ["grip"] }`; left out: never.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fracture: Option<FractureSection>,
    /// How equilibrium or motion is found.
    #[serde(default)]
    pub solver: MechanicalSolver,
    /// Step in s, or "auto" (explicit solver).
    #[serde(default)]
    pub step: StepSize,
    /// Advance in every macro `step`, or once per `log` interval.
    #[serde(default)]
    pub update: Update,
    /// Planes whose force is reported with each logged state, such as
    /// `sections = [{ name = "middle", axis = "x", at = 0 }]`.
    #[serde(default)]
    pub sections: Vec<Section>,
    #[serde(skip)]
    #[schemars(skip)]
    run: Option<Run>,
}

fn tenth() -> f64 {
    0.1
}

/// What a bond carries, and with it which Poisson's ratios there are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Formulation {
    /// A force by its own stretch. Poisson's ratio is 1/4 (3D, plane strain) or 1/3 (plane stress),
    /// whatever the material says.
    #[default]
    Bond,
    /// A force along the bond, by its stretch and the dilatation at its ends: any Poisson's ratio.
    Ordinary,
    /// A force of any direction from the classical stress at its ends: exact for uniform strain on any
    /// cloud; best with a horizon of 2 spacings.
    Correspondence,
}

/// Measure of stretch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Kinematics {
    /// Stretch linear in the displacement, directions of the reference configuration.
    #[default]
    Linear,
    /// Current lengths and directions: large rotations and displacements.
    Finite,
}

/// How the mechanical state follows its loads.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MechanicalSolver {
    /// Equilibrium at every step by Newton-Krylov; stress waves are left out.
    QuasiStatic {
        /// Unbalanced force relative to the loads at which the solution counts as found.
        #[serde(default = "tolerance")]
        tolerance: f64,
    },
    /// Equilibrium at every step by adaptive dynamic relaxation, as published; `relative_tolerance`
    /// is relative to the loads.
    Relaxation(RelaxationOptions),
    /// Motion by velocity Verlet, with stress waves.
    Explicit {
        /// Mass-proportional damping rate, 1/s.
        #[serde(default)]
        damping: f64,
    },
}

fn tolerance() -> f64 {
    1e-8
}

impl Default for MechanicalSolver {
    fn default() -> Self {
        MechanicalSolver::QuasiStatic {
            tolerance: tolerance(),
        }
    }
}

#[derive(Debug)]
struct Run {
    body: BodyIndex,
    solid: Box<dyn Solid>,
    layers: LayersHandle,
    displacement: Write<Vector3<f64>>,
    /// Of the explicit solver.
    velocity: Option<Write<Vector3<f64>>>,
    stress: Write<Matrix3<f64>>,
    conjugate_stress: Write<f64>,
    conjugate_stress_wanted: bool,
    plastic: Option<PlasticFields>,
    /// Where bonds break.
    damage: Option<Write<f64>>,
    eigenstrain: Option<Read<f64>>,
    body_force: Option<Read<Vector3<f64>>>,
    /// Of the explicit solver.
    impulse: Option<Read<Vector3<f64>>>,
    hold: Option<Hold>,
    temperature: ReadIfProvided<f64>,
    /// kg/m³, by point.
    density: Vec<f64>,
    /// m³/kg, by component; zero where it is held.
    free_inverse_density: Vec<f64>,
    /// Volume over mean volume of each component, where points differ; else empty.
    relative_volume: Vec<f64>,
    work: Vec<f64>,
    newton: Newton,
    relaxation: Relaxation,
    /// Rigid motions that nothing hinders, and the number of held components they are for.
    rigid: Option<(usize, NullSpace)>,
    coarse: equilibrium::Coarse,
    tolerance: f64,
    /// Largest eigenstrain and inelastic strain together.
    eigenstrain_size: f64,
    /// By section, N.
    section_forces: Vec<[f64; 3]>,
    state: State,
}

/// Boundaries that hold points, where there are any.
#[derive(Clone, Copy, Debug)]
struct Hold {
    constraint: Read<Vector3<f64>>,
    held: Read<Vector3<f64>>,
}

#[derive(Debug)]
struct PlasticFields {
    strain: Write<Matrix3<f64>>,
    equivalent: Write<f64>,
    work: Write<f64>,
}

/// What a restart needs beside the fields.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct State {
    verlet: Verlet,
    /// Work done by body forces and eigenstrains since the start, J.
    supplied: f64,
    /// Impulse of body forces since the start, N s.
    impulse: [f64; 3],
    initial_energy: f64,
    initial_momentum: [f64; 3],
}

impl Run {
    /// Takes loads and moduli of the moment and writes held components into `displacement`.
    fn load(&mut self, world: &World) {
        let body = world.body(self.body);
        let temperature = world.read_if_provided(self.temperature);
        self.solid.set_moduli(body, temperature.as_deref());
        self.eigenstrain_size = 0.0;
        if let Some(eigenstrain) = self.eigenstrain {
            let eigenstrain = world.read(eigenstrain);
            self.solid.set_eigenstrain(&eigenstrain);
            self.eigenstrain_size = max_abs(&eigenstrain);
        }
        self.load_plasticity(world, temperature.as_deref());
        let Some(Hold { constraint, held }) = self.hold else {
            return;
        };
        let (constraint, held) = (world.read(constraint), world.read(held));
        let mut displacement = world.write(self.displacement);
        let points = displacement.par_iter_mut().zip(&*constraint).zip(&*held);
        points.with_min_len(4096).for_each(|((u, c), h)| {
            for axis in 0..3 {
                if c[axis] > 0.0 {
                    u[axis] = h[axis] / c[axis];
                }
            }
        });
    }

    /// Number of boundaries that hold each component of the displacement.
    fn constraints(&self, world: &World) -> Vec<f64> {
        match self.hold {
            Some(hold) => bytemuck::cast_slice(&world.read(hold.constraint)).to_vec(),
            None => vec![0.0; self.work.len()],
        }
    }

    fn load_displacement(&mut self, world: &World) {
        let displacement = world.read::<Vector3<f64>>(self.displacement.into());
        let rules = world.layer_rules(self.layers);
        self.solid
            .set_displacement(bytemuck::cast_slice(&displacement), &rules);
    }

    fn load_plasticity(&mut self, world: &World, temperature: Option<&[f64]>) {
        let (Some(fields), Some(plasticity)) = (&self.plastic, self.solid.plasticity()) else {
            return;
        };
        plasticity.set_temperature(&world.body(self.body).material_of_point, temperature);
        let strains = world.read::<Matrix3<f64>>(fields.strain.into());
        let equivalents = world.read::<f64>(fields.equivalent.into());
        let settled = plasticity
            .settled
            .iter_mut()
            .zip(&*strains)
            .zip(&*equivalents);
        settled.for_each(|((settled, strain), &equivalent)| {
            let strain = classical::COMPONENTS.map(|at| strain[at]);
            *settled = Inelastic { strain, equivalent };
        });
        plasticity.tried.copy_from_slice(&plasticity.settled);
        let strains = plasticity.settled.iter().map(|s| max_abs(&s.strain));
        self.eigenstrain_size += strains.fold(0.0, f64::max);
    }

    /// Makes the plastic flow of the displacement that was found the state, and anneals.
    fn settle(&mut self, world: &World) {
        if self.plastic.is_none() {
            return;
        }
        self.load_displacement(world);
        self.solid.force(&mut self.work);
        let fields = self.plastic.as_ref().expect("asked above");
        let plasticity = self.solid.plasticity().expect("there are its fields");
        plasticity.settle(&mut world.write(fields.work));
        if let Some(temperature) = world.read_if_provided(self.temperature)
            && plasticity.annealing_temperature.is_some()
        {
            let moduli: Vec<Moduli> = (0..self.density.len())
                .map(|i| self.solid.moduli_of(i))
                .collect();
            let stress = self.solid.material_stress();
            let plasticity = self.solid.plasticity().expect("there are its fields");
            plasticity.anneal(&temperature, &stress, |i| moduli[i]);
        }
        let plasticity = self.solid.plasticity().expect("there are its fields");
        plasticity.tried.copy_from_slice(&plasticity.settled);
        let (mut strains, mut equivalents) =
            (world.write(fields.strain), world.write(fields.equivalent));
        let points = strains.iter_mut().zip(equivalents.iter_mut());
        for ((strain, equivalent), settled) in points.zip(&plasticity.settled) {
            *strain = classical::symmetric(&settled.strain);
            *equivalent = settled.equivalent;
        }
    }

    /// Breaks the bonds that exceed their limit in the displacement of the last force and are loaded to at
    /// least `share` of the worst; whether there were any.
    fn break_bonds(&mut self, world: &World, share: f64) -> bool {
        let Some(damage) = self.damage else {
            return false;
        };
        let (pairs, any) = self.solid.break_bonds(share, &mut world.write(damage));
        world.broken_pairs_mut(self.body).pairs.extend(pairs);
        any
    }

    /// The highest frequency by its bound or by power iteration, rad/s.
    fn largest_frequency(&mut self, world: &World) -> f64 {
        if let Some(bound) = self.solid.frequency_bound(&self.density) {
            return bound;
        }
        let dimension = world.body(self.body).dimension;
        let inverse_density: Vec<f64> = (0..3 * self.density.len())
            .map(|i| {
                if i % 3 < dimension {
                    1.0 / self.density[i / 3]
                } else {
                    0.0
                }
            })
            .collect();
        let rules: Vec<LayerRule> = world
            .layer_rules(self.layers)
            .iter()
            .map(LayerRule::homogeneous)
            .collect();
        let square = largest_eigenvalue(&inverse_density, |u, out| {
            self.solid.set_displacement(u, &rules);
            self.solid.stiffness(out);
        });
        square.sqrt()
    }

    fn provide_stress(&mut self, world: &World) {
        if let Some(eigenstrain) = self.eigenstrain {
            self.solid.set_eigenstrain(&world.read(eigenstrain));
        }
        self.load_displacement(world);
        let stress = self.solid.stress();
        for (sigma, components) in world.write(self.stress).iter_mut().zip(stress) {
            *sigma = classical::symmetric(components);
        }
    }

    fn provide_conjugate_stress(&mut self, world: &World) {
        self.load_displacement(world);
        let energy = self.solid.energy();
        for (p, [_, conjugate_stress]) in world.write(self.conjugate_stress).iter_mut().zip(energy)
        {
            *p = *conjugate_stress;
        }
    }

    /// Kinetic and elastic energy, J (none of the former but in the explicit solver).
    fn energy(&mut self, world: &World) -> f64 {
        let volume = &world.body(self.body).points.volume;
        self.load_displacement(world);
        let mut density: Vec<f64> = self.solid.energy().iter().map(|[w, _]| *w).collect();
        if let Some(velocity) = self.velocity {
            let velocity = world.read::<Vector3<f64>>(velocity.into());
            for ((w, v), rho) in density.iter_mut().zip(&*velocity).zip(&self.density) {
                *w += 0.5 * rho * v.norm_squared();
            }
        }
        weighted_sum(&density, volume)
    }

    fn momentum(&self, world: &World) -> [f64; 3] {
        let Some(velocity) = self.velocity else {
            return [0.0; 3];
        };
        let velocity = world.read::<Vector3<f64>>(velocity.into());
        let volume = &world.body(self.body).points.volume;
        std::array::from_fn(|axis| {
            let component: Vec<f64> = velocity.iter().map(|v| v[axis]).collect();
            sum_of([&component, &self.density, volume], |[v, rho, volume]| {
                v * rho * volume
            })
        })
    }
}

#[typetag::serde(name = "mechanical")]
impl Physics for Mechanical {
    fn prepare(&mut self, setup: &mut Setup<'_>) -> Result<(), SetupError> {
        let body = setup.find_body(self.body.as_deref())?;
        let correspondence = self.formulation == Formulation::Correspondence;
        let usual = Horizon::Spacings(if correspondence { 2.0 } else { 3.0 });
        let horizon = self.horizon.unwrap_or(usual);
        horizon.check(setup.body(body))?;
        let (layers, faces, _) = setup.layers(body, &keys::DISPLACEMENT);
        let spec = FamilySpec {
            horizon,
            partial_volume: self.partial_volume,
            influence: self.influence,
            // correspondence is exact as it is
            correction: if correspondence {
                Correction::Lattice
            } else {
                self.correction
            },
            layers: faces,
            audited: Vec::new(),
        };
        for section in &self.sections {
            section.check(setup, body)?;
        }
        let family = setup.family(body, &spec)?;
        let bond_based = self.formulation == Formulation::Bond;
        let elasticity = Elasticity::of(setup, body, self.plane, bond_based)?;
        if bond_based && self.plasticity.is_some() {
            let message = "bonds alone cannot flow without changing volume";
            let expected = "`formulation` \"ordinary\" or \"correspondence\"";
            return Err(SetupError::value("plasticity", message, expected));
        }
        let plasticity = match &self.plasticity {
            Some(section) => Some(Plasticity::of(section, setup, body, self.plane)?),
            None => None,
        };
        let plastic = plasticity.is_some();
        let fracture = match &self.fracture {
            Some(section) if correspondence && section.criterion == Criterion::Energy => {
                let message = "a bond of a correspondence solid has no energy of its own";
                let expected = "\"stretch\", or `formulation` \"bond\" or \"ordinary\"";
                return Err(SetupError::value("fracture.criterion", message, expected));
            }
            Some(section) => Some(Fracture::of(section, setup, body, &family)?),
            None => None,
        };
        let breaks = fracture.is_some();
        let this = setup.body(body);
        let finite = self.kinematics == Kinematics::Finite;
        let solid: Box<dyn Solid> = if correspondence {
            let (g, flow_and_break) = (self.stabilisation, (plasticity, fracture));
            let solid = Correspondence::new(this, family, elasticity, finite, g, flow_and_break);
            Box::new(solid.map_err(|e| SetupError::other("", e))?)
        } else {
            let solid = Ordinary::new(this, family, elasticity, finite, plasticity, fracture);
            Box::new(solid.map_err(|e| SetupError::other("", e))?)
        };
        let density = setup.density_at_points(body)?;
        let points = density.len();
        let volume = &this.points.volume;
        let mean = volume.iter().sum::<f64>() / points as f64;
        let relative_volume = match this.lattice() {
            Some(_) => Vec::new(),
            None => volume.iter().flat_map(|v| [v / mean; 3]).collect(),
        };

        let options = match self.solver {
            MechanicalSolver::Relaxation(options) => options,
            _ => RelaxationOptions::default(),
        };
        let damping = match self.solver {
            MechanicalSolver::Explicit { damping } => damping,
            _ => 0.0,
        };
        let tolerance = match self.solver {
            MechanicalSolver::QuasiStatic { tolerance } => tolerance,
            _ => tolerance(),
        };
        let explicit = matches!(self.solver, MechanicalSolver::Explicit { .. });
        let newton = NewtonOptions {
            relative_tolerance: 0.0,
            linear: !(finite || plastic),
            ..NewtonOptions::default()
        };
        let constraint = setup.consume_if_added(body, &keys::CONSTRAINT)?;
        let hold = match constraint {
            Some(constraint) => Some(Hold {
                constraint,
                held: setup.consume(body, &keys::HELD_DISPLACEMENT)?,
            }),
            None => None,
        };
        self.run = Some(Run {
            body,
            layers,
            displacement: setup.own(body, &keys::DISPLACEMENT)?,
            velocity: if explicit {
                Some(setup.own(body, &keys::VELOCITY)?)
            } else {
                None
            },
            stress: setup.own(body, &keys::STRESS)?,
            plastic: match plastic {
                true => Some(PlasticFields {
                    strain: setup.own(body, &keys::PLASTIC_STRAIN)?,
                    equivalent: setup.own(body, &keys::EQUIVALENT_PLASTIC_STRAIN)?,
                    work: setup.own(body, &keys::PLASTIC_WORK)?,
                }),
                false => None,
            },
            damage: match breaks {
                true => Some(setup.own(body, &keys::DAMAGE)?),
                false => None,
            },
            conjugate_stress_wanted: setup.is_read(body, &keys::CONJUGATE_STRESS),
            conjugate_stress: setup.own(body, &keys::CONJUGATE_STRESS)?,
            eigenstrain: setup.consume_if_added(body, &keys::EIGENSTRAIN)?,
            body_force: setup.consume_if_added(body, &keys::BODY_FORCE)?,
            impulse: match explicit {
                true => setup.take_if_added(body, &keys::IMPULSE)?,
                false => None,
            },
            hold,
            temperature: setup.read_if_provided(body, &keys::TEMPERATURE)?,
            solid,
            free_inverse_density: density.iter().flat_map(|rho| [1.0 / rho; 3]).collect(),
            density,
            relative_volume,
            work: vec![0.0; 3 * points],
            newton: Newton::new(newton),
            relaxation: Relaxation::new(options),
            rigid: None,
            coarse: equilibrium::Coarse::default(),
            tolerance,
            eigenstrain_size: 0.0,
            section_forces: vec![[0.0; 3]; self.sections.len()],
            state: State {
                verlet: Verlet::new(damping),
                ..State::default()
            },
        });
        Ok(())
    }

    fn start(&mut self, world: &World) -> Result<(), RunError> {
        let run = self.run.as_mut().expect("prepared before the start");
        let temperature = world.read_if_provided(run.temperature);
        run.solid
            .set_moduli(world.body(run.body), temperature.as_deref());
        if run.conjugate_stress_wanted {
            run.provide_conjugate_stress(world);
        }
        run.state.initial_energy = run.energy(world);
        run.state.initial_momentum = run.momentum(world);
        Ok(())
    }

    fn clock(&self) -> Clock {
        Clock {
            step: self.step,
            update: self.update,
        }
    }

    /// `2 / omega`, with the highest frequency.
    fn stable_step(&mut self, world: &World) -> Option<f64> {
        let run = self.run.as_mut().expect("prepared before the start");
        if !matches!(self.solver, MechanicalSolver::Explicit { .. }) {
            return None;
        }
        run.solid.set_stiffest_moduli(world.body(run.body));
        // of the whole body, so that a run that is resumed takes the same steps
        let mut broken = run.solid.fracture().map(|_| run.solid.family().unbroken());
        let mut swap = |solid: &mut dyn Solid| {
            if let (Some(fracture), Some(broken)) = (solid.fracture_mut(), &mut broken) {
                std::mem::swap(&mut fracture.state.broken, broken);
            }
        };
        swap(&mut *run.solid);
        let largest = run.largest_frequency(world);
        swap(&mut *run.solid);
        Some(2.0 / (largest * run.solid.rise_by_damage().sqrt()))
    }

    fn plausible(&self, world: &World) -> Vec<(&'static str, f64)> {
        let body = self.run.as_ref().map_or(0, |r| r.body);
        let (min, max) = world.body(body).bounds();
        vec![("displacement", 10.0 * (max - min).norm())]
    }

    fn advance(&mut self, world: &World, step: Step) -> Result<Work, RunError> {
        let run = self.run.as_mut().expect("prepared before the first step");
        if !step.repeated {
            run.load(world);
        }
        let result = match self.solver {
            MechanicalSolver::QuasiStatic { .. } => {
                equilibrium::break_and_balance(run, world, |run| {
                    equilibrium::newton(run, world, step)
                })
            }
            MechanicalSolver::Relaxation(_) => {
                equilibrium::break_and_balance(run, world, |run| equilibrium::relax(run, world))
            }
            MechanicalSolver::Explicit { .. } => {
                let done = run.move_on(world, step);
                run.break_bonds(world, 0.0);
                done
            }
        };
        let work = result.map_err(|cause| RunError::Plugin {
            plugin: "mechanical".into(),
            time: step.end(),
            cause: cause.into(),
        })?;
        run.settle(world);
        if run.conjugate_stress_wanted {
            run.provide_conjugate_stress(world);
        }
        Ok(work)
    }

    fn observe(&mut self, world: &World) {
        let run = self.run.as_mut().expect("prepared before the first step");
        run.provide_conjugate_stress(world);
        run.provide_stress(world);
        for (i, section) in self.sections.iter().enumerate() {
            run.section_forces[i] = section.force(run, world);
        }
    }

    fn report(&self) -> Vec<Report> {
        let run = self.run.as_ref().expect("prepared before the first step");
        let forces = self.sections.iter().zip(&run.section_forces);
        let forces = forces.flat_map(|(s, force)| s.report(*force));
        let broken = run.solid.fracture().map(|fracture| Report {
            name: "bonds.broken".into(),
            unit: "1".into(),
            value: 0.5 * fracture.state.broken.total() as f64,
        });
        forces.chain(broken).collect()
    }

    fn balance(&self, world: &World) -> Vec<Balance> {
        let run = self.run.as_ref().expect("prepared before the first step");
        if !matches!(self.solver, MechanicalSolver::Explicit { .. }) {
            return Vec::new();
        }
        let momentum = run.momentum(world);
        let axes = 0..world.body(run.body).dimension;
        axes.map(|axis| {
            let name = format!("momentum.{}", ["x", "y", "z"][axis]);
            let (initial, impulse) = (run.state.initial_momentum[axis], run.state.impulse[axis]);
            Balance::new(&name, "N s", momentum[axis], initial, impulse)
        })
        .collect()
    }

    fn save(&self) -> Box<dyn erased_serde::Serialize + '_> {
        let run = self.run.as_ref().expect("prepared before a save");
        Box::new((&run.state, run.solid.fracture().map(|f| &f.state)))
    }

    fn load(
        &mut self,
        state: &mut dyn erased_serde::Deserializer<'_>,
    ) -> Result<(), erased_serde::Error> {
        let run = self.run.as_mut().expect("prepared before a restart");
        let (state, broken): (State, Option<FractureState>) = erased_serde::deserialize(state)?;
        run.state = state;
        if let (Some(fracture), Some(state)) = (run.solid.fracture_mut(), broken) {
            fracture.state = state;
        }
        Ok(())
    }

    fn restored(&mut self, world: &World) {
        let run = self.run.as_ref().expect("prepared before a restart");
        if let Some(fracture) = run.solid.fracture() {
            let mut broken = world.broken_pairs_mut(run.body);
            broken.pairs = fracture.broken_pairs(run.solid.family());
            broken.replaced += 1;
        }
    }
}

perimelt_core::register_physics!("mechanical", Mechanical);
