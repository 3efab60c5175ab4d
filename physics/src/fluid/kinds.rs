//! Which keys belong to which fluid.
//!
//! The table of a fluid ([`Fluid`]) lists all keys side by side. [`Fluid::take_keys`] takes those that its description and form
//! have out of it. A key that is left although another fluid would take it is refused; the message says which description or
//! form takes it.

use perimelt_core::{Description, SetupError};
use serde_json::{Map, Value};

use crate::advection::Convection;

use super::keys::{Fluid, Form, Stress, Surface};
use super::lagrangian::collision::Collisions;

/// Keys that depend on description and form. A combination that makes no sense cannot be written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FluidKeys {
    /// Number of steps after which velocity and density are smoothed; 0: never.
    pub(super) smoothing: u32,
    /// Whether points at free surfaces have no pressure.
    pub(super) zero_surface_pressure: bool,
    pub(super) points: PointKeys,
}

/// What the points are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum PointKeys {
    /// Points carry their mass.
    Lagrangian(LagrangianKeys),
    /// The fluid flows through the points.
    Eulerian(EulerianKeys),
}

/// Keys of a fluid whose points carry their mass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum LagrangianKeys {
    /// Points keep their neighbours.
    Total(DifferencesKeys),
    /// Points change neighbours.
    Updated(Arrangement, DifferencesKeys),
    /// Points change neighbours, in the conservative form.
    Conservative(Arrangement, ConservativeKeys),
}

/// Keys of a fluid that flows through its points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct EulerianKeys {
    pub(super) convection: Convection,
    pub(super) form: EulerianForm,
}

/// Form of the equations at points through which the fluid flows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum EulerianForm {
    Differences(DifferencesKeys),
    /// Conservative, at points at rest.
    Resting,
    /// Conservative, at points that follow the walls.
    FollowingWalls,
}

/// Keys of the form with derivatives of second order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct DifferencesKeys {
    /// Whether the viscous stress has the term of the divergence.
    pub(super) is_compressible: bool,
}

/// Keys of the conservative form at points that move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ConservativeKeys {
    /// Whether viscous forces act along bonds.
    pub(super) is_central: bool,
    /// Whether the fluid fills a closed container.
    pub(super) is_closed: bool,
    /// Fraction of the speed of sound over the spacing.
    pub(super) volume_relaxation: f64,
    pub(super) collisions: Option<Collisions>,
}

/// What keeps points in order that change neighbours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Arrangement {
    /// Fraction of the distance that the fastest point moves.
    pub(super) shifting: f64,
    /// Fraction of the mean velocity of the neighbours.
    pub(super) xsph: f64,
    /// In spacings.
    pub(super) least_distance: f64,
}

impl FluidKeys {
    /// Whether the conservative form is summed.
    pub(super) fn is_conservative(&self) -> bool {
        match self.points {
            PointKeys::Lagrangian(keys) => matches!(keys, LagrangianKeys::Conservative(..)),
            PointKeys::Eulerian(keys) => !matches!(keys.form, EulerianForm::Differences(_)),
        }
    }

    /// Whether surfaces without a wall are allowed.
    pub(super) fn may_have_free_surface(&self) -> bool {
        self.is_conservative() || self.zero_surface_pressure
    }

    /// Keys of the conservative form at points that move.
    pub(super) fn conservative(&self) -> Option<&ConservativeKeys> {
        match &self.points {
            PointKeys::Lagrangian(LagrangianKeys::Conservative(_, keys)) => Some(keys),
            _ => None,
        }
    }

    /// Whether forces act along bonds or keep moments, and points move with their own velocity.
    pub(super) fn keeps_angular_momentum(&self) -> bool {
        match &self.points {
            PointKeys::Lagrangian(LagrangianKeys::Conservative(arrangement, keys)) => {
                let moves_by_velocity = arrangement.xsph == 0.0 && arrangement.shifting == 0.0;
                let is_smoothed = self.smoothing > 0 || self.zero_surface_pressure;
                keys.is_central && moves_by_velocity && !is_smoothed
            }
            _ => false,
        }
    }
}

/// The keys that decide which others a fluid has.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Choice {
    description: Description,
    form: Form,
}

impl Choice {
    fn all() -> impl Iterator<Item = Choice> {
        let descriptions = [
            Description::UpdatedLagrangian,
            Description::TotalLagrangian,
            Description::Eulerian,
            Description::ArbitraryLagrangianEulerian,
        ];
        let forms = [Form::Differences, Form::Conservative];
        let with = move |description| forms.map(|form| Choice { description, form });
        descriptions.into_iter().flat_map(with)
    }

    fn description(self) -> String {
        written("description", &value(&self.description))
    }

    fn form(self) -> String {
        written("form", &value(&self.form))
    }

    /// The least change of this choice to one that `fits`, as it is written.
    fn change_to(self, fits: impl Fn(Choice) -> bool) -> String {
        let fitting: Vec<Choice> = Choice::all().filter(|c| fits(*c)).collect();
        let same_form = fitting.iter().filter(|c| c.form == self.form);
        let same_points = fitting.iter().filter(|c| c.description == self.description);
        let mut changes: Vec<String> = same_points.map(|c| c.form()).collect();
        changes.extend(same_form.map(|c| c.description()));
        if changes.is_empty() {
            let both = |c: &Choice| format!("{} with {}", c.description(), c.form());
            changes = fitting.iter().map(both).collect();
        }
        match changes.split_last() {
            Some((last, others)) if !others.is_empty() => {
                format!("{} or {last}", others.join(", "))
            }
            _ => changes.concat(),
        }
    }
}

impl Fluid {
    /// Takes the keys of this description and form out of the table, and refuses those that belong to others.
    pub(super) fn take_keys(&mut self) -> Result<FluidKeys, SetupError> {
        let choice = Choice {
            description: self.description,
            form: self.form,
        };
        let before = self.clone();
        let Some(keys) = self.take(choice) else {
            let message = format!(
                "{} does not work with {}",
                choice.description(),
                choice.form()
            );
            let is_built = |c| before.clone().take(c).is_some();
            let expected = choice.change_to(is_built);
            return Err(SetupError::value("description", message, expected));
        };
        let takes = |c, key: &String| {
            let mut rest = before.clone();
            rest.take(c).is_some() && !rest.given().contains_key(key)
        };
        let left = self.given();
        let misfit = left
            .iter()
            .find(|(key, _)| Choice::all().any(|c| takes(c, key)));
        let Some((key, value)) = misfit else {
            return Ok(keys);
        };
        let message = format!(
            "{} does not work with {} and {}",
            written(key, value),
            choice.description(),
            choice.form()
        );
        let change = choice.change_to(|c| takes(c, key));
        let expected = format!("{change}, or leave `{key}` out");
        Err(SetupError::value(key, message, expected))
    }

    /// The keys that are given, with their values.
    fn given(&self) -> Map<String, Value> {
        match value(self) {
            Value::Object(keys) => keys,
            _ => Map::new(),
        }
    }

    /// Takes the keys of a choice out of the table; `None` for one that is not built.
    fn take(&mut self, choice: Choice) -> Option<FluidKeys> {
        let points = match (choice.description, choice.form) {
            (Description::TotalLagrangian, Form::Differences) => {
                PointKeys::Lagrangian(LagrangianKeys::Total(self.take_differences()))
            }
            (Description::UpdatedLagrangian, form) => {
                let arrangement = Arrangement {
                    shifting: self.shifting.take().unwrap_or(0.0),
                    xsph: self.xsph.take().unwrap_or(0.0),
                    least_distance: self.least_distance.take().unwrap_or(0.0),
                };
                PointKeys::Lagrangian(match form {
                    Form::Differences => {
                        LagrangianKeys::Updated(arrangement, self.take_differences())
                    }
                    Form::Conservative => {
                        LagrangianKeys::Conservative(arrangement, self.take_conservative())
                    }
                })
            }
            (Description::Eulerian, form) => PointKeys::Eulerian(EulerianKeys {
                convection: self.convection.take().unwrap_or_default(),
                form: match form {
                    Form::Differences => EulerianForm::Differences(self.take_differences()),
                    Form::Conservative => EulerianForm::Resting,
                },
            }),
            (Description::ArbitraryLagrangianEulerian, Form::Conservative) => {
                PointKeys::Eulerian(EulerianKeys {
                    convection: self.convection.take().unwrap_or_default(),
                    form: EulerianForm::FollowingWalls,
                })
            }
            (Description::TotalLagrangian, Form::Conservative)
            | (Description::ArbitraryLagrangianEulerian, Form::Differences) => return None,
        };
        let mut keys = FluidKeys {
            smoothing: 0,
            zero_surface_pressure: false,
            points,
        };
        // the volumes of points that follow walls change, which smoothing does not know
        if choice.description != Description::ArbitraryLagrangianEulerian {
            keys.smoothing = self.smoothing.take().unwrap_or(0);
        }
        let carries_mass = matches!(points, PointKeys::Lagrangian(_));
        if carries_mass || !keys.is_conservative() {
            let zero = self.surface.take_if(|s| *s == Surface::ZeroPressure);
            keys.zero_surface_pressure = zero.is_some();
        }
        self.surface.take_if(|surface| *surface == Surface::Natural);
        self.stress
            .take_if(|stress| *stress == Stress::Incompressible);
        Some(keys)
    }

    fn take_differences(&mut self) -> DifferencesKeys {
        let compressible = self.stress.take_if(|s| *s == Stress::Compressible);
        DifferencesKeys {
            is_compressible: compressible.is_some(),
        }
    }

    fn take_conservative(&mut self) -> ConservativeKeys {
        ConservativeKeys {
            is_central: self.stress.take_if(|s| *s == Stress::Central).is_some(),
            is_closed: self.surface.take_if(|s| *s == Surface::Closed).is_some(),
            volume_relaxation: self.volume_relaxation.take().unwrap_or(1e-4),
            collisions: self.collisions.take(),
        }
    }
}

/// A value as it stands in the table.
fn value(of: &impl serde::Serialize) -> Value {
    serde_json::to_value(of).unwrap_or_default()
}

/// A key as it is written: with its value where that is one of several names.
fn written(key: &str, value: &Value) -> String {
    match value {
        Value::String(_) => format!("`{key} = {value}`"),
        _ => format!("`{key}`"),
    }
}
