//! Fields that the mechanical physics reads and writes.

use nalgebra::{Matrix3, Vector3};
use perimelt_core::law::{StateVariable, VariableShape};
use perimelt_core::world::{BodyIndex, BondBreaker};
use perimelt_core::{Access, Key, Read, ReadIfProvided, Setup, SetupError, World, Write, keys};

use super::classical::{COMPONENTS, symmetric};
use super::nodes::LoadSinks;
use super::plasticity::Plasticity;
use super::points::LawPoints;
use super::variables::VariableStates;

/// Force of the bonds and of loads in the last step.
const FORCE: Key<Vector3<f64>> = Key::new("force", "N/m3", "force at the end of the last step");

/// The body force in [`FORCE`].
const LOADS_IN_FORCE: Key<Vector3<f64>> = Key::new(
    "loads_in_force",
    "N/m3",
    "body force at the end of the last step",
);

/// See [`Watched`].
const WATCHED_EIGENSTRAIN: Key<f64> =
    Key::new("watched_eigenstrain", "1", "eigenstrain in the last step");

/// See [`Watched`].
const WATCHED_STRESS: Key<f64> = Key::new(
    "watched_conjugate_stress",
    "Pa",
    "conjugate stress before the eigenstrain changed last",
);

/// Handles of the fields of a body.
#[derive(Debug)]
pub(super) struct Fields {
    pub(super) displacement: Write<Vector3<f64>>,
    /// For the explicit solver.
    pub(super) velocity: Option<Write<Vector3<f64>>>,
    /// Of the last step at the points, N/m³, for the explicit solver whose nodes they are.
    pub(super) force: Option<Write<Vector3<f64>>>,
    /// The body force in it, N/m³, where there is one.
    pub(super) loads_in_force: Option<Write<Vector3<f64>>>,
    pub(super) stress: Write<Matrix3<f64>>,
    pub(super) conjugate_stress: Write<f64>,
    /// Whether a coupler reads the conjugate stress, so that it is needed in each step.
    pub(super) conjugate_stress_is_read: bool,
    /// If a coupler reads it.
    pub(super) conjugate_stress_tensor: Option<Write<Matrix3<f64>>>,
    pub(super) plastic: Option<PlasticFields>,
    /// State variables of the law of elasticity.
    pub(super) law_variables: Vec<VariableField>,
    /// If bonds break.
    pub(super) damage: Option<Damage>,
    pub(super) eigenstrain: Option<Read<f64>>,
    /// For a body in motion with an eigenstrain.
    pub(super) watched: Option<Watched>,
    pub(super) eigenstrain_tensor: Option<Read<Matrix3<f64>>>,
    /// For a body that grows.
    pub(super) birth_strain: Option<Write<Matrix3<f64>>>,
    pub(super) body_force: Option<Read<Vector3<f64>>>,
    /// Where loads act at the faces of cells.
    pub(super) body_force_moment: Option<Read<Matrix3<f64>>>,
    /// For the explicit solver.
    pub(super) impulse: Option<Read<Vector3<f64>>>,
    /// If boundaries hold points.
    pub(super) hold: Option<Hold>,
    pub(super) temperature: ReadIfProvided<f64>,
    /// Of the material, rad; if it counts for the law of elasticity.
    pub(super) orientation: Option<Read<Vector3<f64>>>,
}

/// What the watch over the energy keeps.
#[derive(Clone, Copy, Debug)]
pub(super) struct Watched {
    /// Eigenstrain in the last step.
    pub(super) eigenstrain: Write<f64>,
    /// Stress conjugate to it before it changed last, Pa, where the deformation makes heat.
    pub(super) stress: Option<Write<f64>>,
}

/// Fields of the boundaries that hold points.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hold {
    /// Number of boundaries that hold each component.
    pub(super) constraint: Read<Vector3<f64>>,
    /// Sum of the displacements at which they hold it, m.
    pub(super) displacement: Read<Vector3<f64>>,
}

/// What a body whose bonds break writes.
#[derive(Debug)]
pub(super) struct Damage {
    pub(super) field: Write<f64>,
    /// `damage.<mode>`, of a solid whose bonds break in several ways.
    pub(super) modes: Vec<Write<f64>>,
    pub(super) breaker: BondBreaker,
}

/// Fields of a body that flows plastically.
#[derive(Debug)]
pub(super) struct PlasticFields {
    pub(super) strain: Write<Matrix3<f64>>,
    pub(super) equivalent: Write<f64>,
    pub(super) work: Write<f64>,
    /// State variables of the law.
    pub(super) variables: Vec<VariableField>,
    /// Pa, in place of the materials'.
    pub(super) yield_stress: ReadIfProvided<f64>,
    /// 1/Pa.
    pub(super) transformation_compliance: ReadIfProvided<f64>,
}

/// The field of a state variable, with its place in the row of a point.
#[derive(Clone, Copy, Debug)]
pub(super) enum VariableField {
    Scalar(Write<f64>, usize),
    Tensor(Write<Matrix3<f64>>, usize),
    Matrix(Write<Matrix3<f64>>, usize),
}

impl VariableField {
    /// Passes the field to the settled states; [`VariableStates::reject`] must follow.
    pub(super) fn load(&self, world: &World, states: &mut VariableStates) {
        match *self {
            VariableField::Scalar(field, at) => {
                let values = world.read::<f64>(field.into());
                states.replace(at, values.iter().map(|value| [*value]));
            }
            VariableField::Tensor(field, at) => {
                let values = world.read::<Matrix3<f64>>(field.into());
                let components = |tensor: &Matrix3<f64>| COMPONENTS.map(|at| tensor[at]);
                states.replace(at, values.iter().map(components));
            }
            VariableField::Matrix(field, at) => {
                let values = world.read::<Matrix3<f64>>(field.into());
                states.replace::<9>(at, values.iter().copied().map(bytemuck::must_cast));
            }
        }
    }

    /// Takes the settled states into the field.
    pub(super) fn store(&self, world: &World, states: &VariableStates) {
        match *self {
            VariableField::Scalar(field, at) => {
                let mut values = world.write(field);
                let states = values.iter_mut().zip(states.values(at));
                states.for_each(|(value, [state])| *value = state);
            }
            VariableField::Tensor(field, at) => {
                let mut values = world.write(field);
                let states = values.iter_mut().zip(states.values(at));
                states.for_each(|(value, state)| *value = symmetric(&state));
            }
            VariableField::Matrix(field, at) => {
                let mut values = world.write(field);
                let states = values.iter_mut().zip(states.values::<9>(at));
                states.for_each(|(value, state)| *value = Matrix3::from_column_slice(&state));
            }
        }
    }
}

/// The state variables of a law.
#[derive(Clone, Copy, Debug)]
pub(super) struct LawState<'a> {
    law: &'static str,
    variables: &'a [StateVariable],
    has_directions: bool,
}

impl<'a> LawState<'a> {
    /// The state variables of the law of flow.
    pub(super) fn of_flow(plasticity: &Plasticity) -> Self {
        LawState {
            law: plasticity.law_name(),
            variables: plasticity.state_variables(),
            has_directions: false,
        }
    }

    /// The state variables of a law of points.
    pub(super) fn of_points(points: &'a LawPoints) -> Self {
        LawState {
            law: points.law_name(),
            variables: points.state_variables(),
            has_directions: points.has_directions(),
        }
    }

    /// Declares the fields `<law>.<name>`.
    fn declare(
        &self,
        setup: &mut Setup<'_>,
        body: BodyIndex,
    ) -> Result<Vec<VariableField>, SetupError> {
        let mut at = 0;
        let mut fields = Vec::new();
        for variable in self.variables {
            let name = format!("{}.{}", self.law, variable.name);
            let unit = || variable.unit.to_string();
            match variable.shape {
                VariableShape::Scalar => {
                    let key = Key::named(name, unit());
                    fields.push(VariableField::Scalar(setup.own(body, &key)?, at));
                }
                VariableShape::Tensor => {
                    let key = Key::named(name, unit());
                    fields.push(VariableField::Tensor(setup.own(body, &key)?, at));
                }
                VariableShape::Matrix => {
                    let key = Key::named(name, unit());
                    fields.push(VariableField::Matrix(setup.own(body, &key)?, at));
                }
                VariableShape::Numbers(count) => {
                    for number in 0..count {
                        let key = Key::named(format!("{name}_{}", number + 1), unit());
                        fields.push(VariableField::Scalar(setup.own(body, &key)?, at + number));
                    }
                }
            }
            at += variable.width();
        }
        Ok(fields)
    }
}

/// Which optional fields a body has.
#[derive(Clone, Copy, Debug)]
pub(super) struct Features<'a> {
    pub(super) is_explicit: bool,
    /// Whether the nodes of the solid are its points.
    pub(super) has_points_as_nodes: bool,
    /// The law of flow, if it flows.
    pub(super) flow: Option<LawState<'a>>,
    /// The law of elasticity, if it is one of points.
    pub(super) law: Option<LawState<'a>>,
    pub(super) breaks: bool,
    /// Names of the ways in which bonds break, if there are several.
    pub(super) modes: &'a [&'static str],
}

/// Whether couplers give a body an eigenstrain that differs by direction.
pub(super) fn has_tensor_eigenstrain(setup: &Setup<'_>, body: BodyIndex) -> bool {
    setup.is_declared(body, &keys::EIGENSTRAIN_TENSOR, Access::Add)
}

/// Whether a coupler reads the stress that is conjugate to such an eigenstrain.
pub(super) fn is_conjugate_tensor_read(setup: &Setup<'_>, body: BodyIndex) -> bool {
    setup.is_declared(body, &keys::CONJUGATE_STRESS_TENSOR, Access::Read)
}

/// What holds the points, if boundaries do.
fn hold(setup: &mut Setup<'_>, body: BodyIndex) -> Result<Option<Hold>, SetupError> {
    let Some(constraint) = setup.consume_if_added(body, &keys::CONSTRAINT)? else {
        return Ok(None);
    };
    Ok(Some(Hold {
        constraint,
        displacement: setup.consume(body, &keys::HELD_DISPLACEMENT)?,
    }))
}

/// The fields of the force of the last step, and of the body force in it where there is one.
fn kept(
    setup: &mut Setup<'_>,
    body: BodyIndex,
    is_kept: bool,
) -> Result<[Option<Write<Vector3<f64>>>; 2], SetupError> {
    let is_loaded = setup.is_declared(body, &keys::BODY_FORCE, Access::Add);
    let mut keep = |is_kept: bool, key| match is_kept {
        true => setup.keep(body, key).map(Some),
        false => Ok(None),
    };
    Ok([
        keep(is_kept, &FORCE)?,
        keep(is_kept && is_loaded, &LOADS_IN_FORCE)?,
    ])
}

fn watched(
    setup: &mut Setup<'_>,
    body: BodyIndex,
    is_explicit: bool,
) -> Result<Option<Watched>, SetupError> {
    if !is_explicit || !setup.is_declared(body, &keys::EIGENSTRAIN, Access::Add) {
        return Ok(None);
    }
    let makes_heat = setup.is_declared(body, &keys::CONJUGATE_STRESS, Access::Read);
    let keep_stress = makes_heat.then(|| setup.keep(body, &WATCHED_STRESS));
    Ok(Some(Watched {
        stress: keep_stress.transpose()?,
        eigenstrain: setup.keep(body, &WATCHED_EIGENSTRAIN)?,
    }))
}

impl Fields {
    /// The sinks of loads.
    pub(super) fn loads<'a>(&self, world: &'a World) -> LoadSinks<'a> {
        LoadSinks {
            force: self.body_force.map(|force| world.read(force)),
            moment: self.body_force_moment.map(|moment| world.read(moment)),
        }
    }

    /// Declares the fields of `body`.
    pub(super) fn declare(
        setup: &mut Setup<'_>,
        body: BodyIndex,
        features: Features<'_>,
    ) -> Result<Self, SetupError> {
        let Features {
            is_explicit,
            has_points_as_nodes,
            flow,
            law,
            breaks,
            modes,
        } = features;
        let [force, loads_in_force] = kept(setup, body, is_explicit && has_points_as_nodes)?;
        Ok(Fields {
            displacement: setup.own(body, &keys::DISPLACEMENT)?,
            velocity: (is_explicit.then(|| setup.own(body, &keys::VELOCITY))).transpose()?,
            force,
            loads_in_force,
            stress: setup.own_derived(body, &keys::STRESS)?,
            plastic: match flow {
                Some(law) => Some(PlasticFields {
                    strain: setup.own(body, &keys::PLASTIC_STRAIN)?,
                    equivalent: setup.own(body, &keys::EQUIVALENT_PLASTIC_STRAIN)?,
                    work: setup.own_derived(body, &keys::PLASTIC_WORK)?,
                    variables: law.declare(setup, body)?,
                    yield_stress: setup.read_if_provided(body, &keys::YIELD_STRESS)?,
                    transformation_compliance: setup
                        .read_if_provided(body, &keys::TRANSFORMATION_COMPLIANCE)?,
                }),
                None => None,
            },
            law_variables: match law {
                Some(law) => law.declare(setup, body)?,
                None => Vec::new(),
            },
            damage: match breaks {
                true => Some(Damage {
                    field: setup.own_derived(body, &keys::DAMAGE)?,
                    modes: modes
                        .iter()
                        .map(|mode| {
                            setup.own_derived(
                                body,
                                &Key::named(format!("damage.{mode}"), "1".into()),
                            )
                        })
                        .collect::<Result<_, _>>()?,
                    breaker: setup.break_bonds(body, false)?,
                }),
                false => None,
            },
            conjugate_stress_is_read: setup.is_declared(
                body,
                &keys::CONJUGATE_STRESS,
                Access::Read,
            ),
            conjugate_stress: setup.own_derived(body, &keys::CONJUGATE_STRESS)?,
            conjugate_stress_tensor: match is_conjugate_tensor_read(setup, body) {
                true => Some(setup.own_derived(body, &keys::CONJUGATE_STRESS_TENSOR)?),
                false => None,
            },
            eigenstrain: setup.consume_if_added(body, &keys::EIGENSTRAIN)?,
            watched: watched(setup, body, is_explicit)?,
            eigenstrain_tensor: setup.consume_if_added(body, &keys::EIGENSTRAIN_TENSOR)?,
            birth_strain: match setup.world().is_growing(body) {
                true => Some(setup.own_derived(body, &keys::BIRTH_STRAIN)?),
                false => None,
            },
            body_force: setup.consume_if_added(body, &keys::BODY_FORCE)?,
            body_force_moment: setup.consume_if_added(body, &keys::BODY_FORCE_MOMENT)?,
            impulse: match is_explicit {
                true => setup.take_if_added(body, &keys::IMPULSE)?,
                false => None,
            },
            hold: hold(setup, body)?,
            temperature: setup.read_if_provided(body, &keys::TEMPERATURE)?,
            orientation: match law.is_some_and(|law| law.has_directions) {
                true => Some(setup.given(body, &keys::ORIENTATION)?),
                false => None,
            },
        })
    }
}
