//! Which keys belong to which fluid.
//!
//! The table of a fluid ([`Fluid`]) lists all keys side by side; its description and form decide which of them it has
//! ([`take_keys`]).

use perimelt_core::{Description, SetupError};

use crate::advection::Convection;
use crate::dependent_keys::{Choice, Part, take_keys};

use super::eulerian::projection::ProjectionKeys;
use super::keys::{Fluid, Form, Scheme, Stress, Surface};
use super::lagrangian::collision::Collisions;
use super::run::StepSettings;

/// Keys that depend on description and form. A combination that makes no sense cannot be written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FluidKeys {
    pub(super) settings: StepSettings,
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
    /// Conservative, at points at rest, of a fluid that keeps its volume.
    Projection(ProjectionKeys),
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
        !self.is_incompressible() && (self.is_conservative() || self.settings.zero_surface_pressure)
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
                let is_smoothed =
                    self.settings.smoothing > 0 || self.settings.zero_surface_pressure;
                keys.is_central && moves_by_velocity && !is_smoothed
            }
            _ => false,
        }
    }
}

/// The keys that decide which others a fluid has.
#[derive(Clone, Copy, Debug, PartialEq)]
struct FluidChoice {
    description: Description,
    form: Form,
    /// Whether the fluid keeps its volume.
    is_incompressible: bool,
}

impl Choice for FluidChoice {
    fn all() -> impl Iterator<Item = FluidChoice> {
        let descriptions = [
            Description::UpdatedLagrangian,
            Description::TotalLagrangian,
            Description::Eulerian,
            Description::ArbitraryLagrangianEulerian,
        ];
        let forms = [Form::Differences, Form::Conservative];
        let with = move |description| forms.map(|form| (description, form));
        let all = descriptions.into_iter().flat_map(with);
        all.flat_map(|(description, form)| {
            [false, true].map(|is_incompressible| FluidChoice {
                description,
                form,
                is_incompressible,
            })
        })
    }

    fn parts(self) -> Vec<Part> {
        vec![
            Part::key("description", &self.description),
            Part::key("form", &self.form),
            match self.is_incompressible {
                false => Part::named("state", "a `state` with sound, such as `state.tait`"),
                true => Part::named("state", "`state.incompressible`"),
            },
        ]
    }
}

impl Fluid {
    /// Takes the keys of this description and form out of the table, and refuses those that belong to others.
    pub(super) fn take_keys(&self) -> Result<FluidKeys, SetupError> {
        let choice = FluidChoice {
            description: self.description,
            form: self.form,
            is_incompressible: self.state.law.incompressible().is_some(),
        };
        take_keys(self, choice, Fluid::take)
    }

    fn take(&mut self, choice: FluidChoice) -> Option<FluidKeys> {
        let points = match (choice.description, choice.form) {
            _ if choice.is_incompressible => self.take_projection(choice)?,
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
                        self.take_fluids();
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
            settings: StepSettings::default(),
            points,
        };
        if choice.is_incompressible {
            self.take_natural();
            return Some(keys);
        }
        self.take_sound(&mut keys.settings);
        // the volumes of points that follow walls change, which smoothing does not know
        if choice.description != Description::ArbitraryLagrangianEulerian {
            keys.settings.smoothing = self.smoothing.take().unwrap_or(0);
            keys.settings.smoothed = self.smoothed.take().unwrap_or_default();
        }
        let carries_mass = matches!(points, PointKeys::Lagrangian(_));
        if carries_mass || !keys.is_conservative() {
            let zero = self.surface.take_if(|s| *s == Surface::ZeroPressure);
            keys.settings.zero_surface_pressure = zero.is_some();
        }
        self.take_natural();
        Some(keys)
    }

    /// Takes what every fluid may say.
    fn take_natural(&mut self) {
        self.surface.take_if(|surface| *surface == Surface::Natural);
        self.stress
            .take_if(|stress| *stress == Stress::Incompressible);
        self.scheme.take_if(|scheme| *scheme == Scheme::Symplectic);
    }

    /// Takes the keys of a fluid with sound.
    fn take_sound(&mut self, settings: &mut StepSettings) {
        settings.scheme = self.scheme.take().unwrap_or_default();
        settings.density_diffusion = self.density_diffusion.take().unwrap_or(0.0);
        settings.artificial_viscosity = self.artificial_viscosity.take().unwrap_or(0.0);
        settings.startup = self.startup.take().unwrap_or(0.0);
    }

    fn take_projection(&mut self, choice: FluidChoice) -> Option<PointKeys> {
        if (choice.description, choice.form) != (Description::Eulerian, Form::Conservative) {
            return None;
        }
        self.take_fluids();
        let keys = ProjectionKeys {
            tolerance: self.state.law.incompressible().unwrap_or_default(),
        };
        Some(PointKeys::Eulerian(EulerianKeys {
            convection: self.convection.take().unwrap_or_default(),
            form: EulerianForm::Projection(keys),
        }))
    }

    fn take_fluids(&mut self) {
        self.fluids.take();
        self.interface.take();
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
