//! Degrees of freedom of a rigid body: free, held, or driven along a prescribed displacement.

use std::f64::consts::TAU;

use perimelt_core::{InTime, SetupError, Step};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A degree of freedom, as `hold` names it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Degree {
    /// Translation along x.
    X,
    /// Translation along y.
    Y,
    /// Translation along z.
    Z,
    /// All rotation.
    Rotation,
    /// Rotation about x (3D); two of the three leave rotation about one fixed axis.
    RotationX,
    /// Rotation about y (3D).
    RotationY,
    /// Rotation about z (3D).
    RotationZ,
}

/// One entry for each degree of freedom that is given one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ByDegree<T> {
    /// Along x.
    pub x: Option<T>,
    /// Along y.
    pub y: Option<T>,
    /// Along z.
    pub z: Option<T>,
    /// About the only axis of rotation: z in 2D; in 3D the one that `hold` leaves free.
    pub rotation: Option<T>,
}

impl<T> Default for ByDegree<T> {
    fn default() -> Self {
        ByDegree {
            x: None,
            y: None,
            z: None,
            rotation: None,
        }
    }
}

impl<T> ByDegree<T> {
    /// The entries along x, y and z.
    pub fn translations(&self) -> [Option<&T>; 3] {
        [self.x.as_ref(), self.y.as_ref(), self.z.as_ref()]
    }
}

/// A prescribed displacement (m) or rotation (rad).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Prescribed {
    /// Displacement from the reference position, m (rotation: rad); a number or a table in time.
    Displacement(InTime),
    /// Velocity, m/s (rotation: rad/s); a number or a table in time.
    Velocity(InTime),
    /// `amplitude sin(2 pi frequency t + phase)`.
    Sine(Sine),
}

/// A harmonic displacement.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Sine {
    /// Amplitude, m (rotation: rad).
    pub amplitude: f64,
    /// Frequency, Hz.
    pub frequency: f64,
    /// Phase at t = 0, rad.
    #[serde(default)]
    pub phase: f64,
}

/// Displacement (m) and velocity (m/s) of a degree of freedom, or angle (rad) and its rate (rad/s).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place {
    pub displacement: f64,
    pub velocity: f64,
}

impl Sine {
    /// Displacement `A sin(2 pi f t + phase)` and velocity `2 pi f A cos(2 pi f t + phase)`.
    fn at(&self, time: f64) -> Place {
        let angular_frequency = TAU * self.frequency;
        let (sine, cosine) = (angular_frequency * time + self.phase).sin_cos();
        Place {
            displacement: self.amplitude * sine,
            velocity: angular_frequency * self.amplitude * cosine,
        }
    }
}

impl Prescribed {
    /// Place at t = 0. A velocity starts from the displacement that is there.
    pub(super) fn start(&self, displacement: f64) -> Place {
        match self {
            Prescribed::Displacement(table) => Place {
                displacement: table.at(0.0),
                velocity: table.next_event(0.0).map_or(0.0, |row| {
                    // linear from 0 to the next row
                    (table.at(row) - table.at(0.0)) / row
                }),
            },
            Prescribed::Velocity(table) => Place {
                displacement,
                velocity: table.at(0.0),
            },
            Prescribed::Sine(sine) => sine.at(0.0),
        }
    }

    /// Place at the end of `step`, from the displacement at its start. Steps end on the rows of tables, so that a
    /// table is linear over a step: the velocity of a displacement is its slope, and the displacement of a velocity
    /// is the exact integral.
    pub(super) fn end(&self, displacement: f64, step: Step) -> Place {
        match self {
            Prescribed::Displacement(table) => {
                let end = table.at(step.end());
                Place {
                    displacement: end,
                    velocity: (end - table.at(step.start)) / step.size,
                }
            }
            Prescribed::Velocity(table) => Place {
                displacement: displacement + step.size * table.at(step.middle()),
                velocity: table.at(step.end()),
            },
            Prescribed::Sine(sine) => sine.at(step.end()),
        }
    }

    /// The next time after `after` (s) at which the velocity has a kink or a jump.
    pub(super) fn next_event(&self, after: f64) -> Option<f64> {
        match self {
            Prescribed::Displacement(table) | Prescribed::Velocity(table) => {
                table.next_event(after)
            }
            Prescribed::Sine(_) => None,
        }
    }
}

/// What may happen to one degree of freedom.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Freedom {
    /// Follows the forces.
    Free,
    /// Stays where it starts.
    Held,
    /// Follows a prescribed displacement, whatever the forces.
    Driven(Prescribed),
}

impl Freedom {
    pub(super) fn is_free(&self) -> bool {
        *self == Freedom::Free
    }

    fn prescribed(&self) -> Option<&Prescribed> {
        match self {
            Freedom::Driven(prescribed) => Some(prescribed),
            _ => None,
        }
    }
}

/// How a body may turn.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Turning {
    /// In any way (3D).
    Any,
    /// About one fixed axis of space (0, 1 or 2).
    About(usize, Freedom),
    /// Not at all.
    Held,
}

/// All degrees of freedom of a body.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Freedoms {
    pub dimension: usize,
    pub translation: [Freedom; 3],
    pub turning: Turning,
}

impl Freedoms {
    /// From the keys `hold` and `driven` of a body in 2D or 3D.
    pub(super) fn new(
        dimension: usize,
        hold: &[Degree],
        driven: &ByDegree<Prescribed>,
    ) -> Result<Self, SetupError> {
        if dimension == 2
            && let Some(degree) = hold
                .iter()
                .find(|d| !matches!(d, Degree::X | Degree::Y | Degree::Rotation))
        {
            let message = format!("a 2D body has no degree of freedom {degree:?}");
            let expected = "\"x\", \"y\" or \"rotation\"";
            return Err(SetupError::value("hold", message, expected));
        }
        let mut translation = [Degree::X, Degree::Y, Degree::Z].map(|d| match hold.contains(&d) {
            true => Freedom::Held,
            false => Freedom::Free,
        });
        if dimension == 2 {
            translation[2] = Freedom::Held;
        }
        for (axis, prescribed) in driven.translations().into_iter().enumerate() {
            let Some(prescribed) = prescribed else {
                continue;
            };
            let key = format!("driven.{}", ["x", "y", "z"][axis]);
            check_exists(&key, axis < dimension)?;
            if hold.contains(&[Degree::X, Degree::Y, Degree::Z][axis]) {
                return Err(held_and_driven(&key));
            }
            translation[axis] = Freedom::Driven(prescribed.clone());
        }
        let mut turning = turning(dimension, hold)?;
        if let Some(prescribed) = &driven.rotation {
            match &mut turning {
                Turning::About(_, freedom) => *freedom = Freedom::Driven(prescribed.clone()),
                Turning::Held => return Err(held_and_driven("driven.rotation")),
                Turning::Any => return Err(needs_one_axis("driven.rotation")),
            }
        }
        Ok(Freedoms {
            dimension,
            translation,
            turning,
        })
    }

    /// Whether nothing is held or driven: then momentum and angular momentum change by loads alone.
    pub(super) fn is_free(&self) -> bool {
        let turning = match &self.turning {
            Turning::Any => true,
            Turning::About(_, freedom) => self.dimension == 2 && freedom.is_free(),
            Turning::Held => false,
        };
        turning
            && self.translation[..self.dimension]
                .iter()
                .all(Freedom::is_free)
    }

    /// Checks that springs or dashpots (by `key`) act on free degrees of freedom only and are not negative.
    pub(super) fn check_resistance(
        &self,
        key: &str,
        resistance: &ByDegree<f64>,
    ) -> Result<(), SetupError> {
        let translations = resistance.translations().into_iter().zip(&self.translation);
        let names = ["x", "y", "z"].into_iter().enumerate();
        for ((axis, name), (value, freedom)) in names.zip(translations) {
            let Some(value) = value else { continue };
            let key = format!("{key}.{name}");
            check_exists(&key, axis < self.dimension)?;
            check_free(&key, *value, freedom)?;
        }
        let Some(value) = resistance.rotation else {
            return Ok(());
        };
        let key = format!("{key}.rotation");
        match &self.turning {
            Turning::Any => Err(needs_one_axis(&key)),
            Turning::Held => check_free(&key, value, &Freedom::Held),
            Turning::About(_, freedom) => check_free(&key, value, freedom),
        }
    }

    /// The next time after `after` (s) at which a prescribed velocity has a kink or a jump.
    pub(super) fn next_event(&self, after: f64) -> Option<f64> {
        let rotation = match &self.turning {
            Turning::About(_, freedom) => freedom.prescribed(),
            _ => None,
        };
        let all = self.translation.iter().filter_map(Freedom::prescribed);
        let events = all.chain(rotation).filter_map(|p| p.next_event(after));
        events.min_by(f64::total_cmp)
    }
}

fn turning(dimension: usize, hold: &[Degree]) -> Result<Turning, SetupError> {
    if hold.contains(&Degree::Rotation) {
        return Ok(Turning::Held);
    }
    if dimension == 2 {
        return Ok(Turning::About(2, Freedom::Free));
    }
    let axes = [Degree::RotationX, Degree::RotationY, Degree::RotationZ];
    let free: Vec<usize> = (0..3).filter(|&a| !hold.contains(&axes[a])).collect();
    match free[..] {
        [] => Ok(Turning::Held),
        [axis] => Ok(Turning::About(axis, Freedom::Free)),
        [_, _] => {
            let message = "rotation is held about one axis only";
            let expected = "rotation held about two axes, about all (\"rotation\") or about none";
            Err(SetupError::value("hold", message, expected))
        }
        _ => Ok(Turning::Any),
    }
}

fn check_exists(key: &str, exists: bool) -> Result<(), SetupError> {
    match exists {
        true => Ok(()),
        false => Err(SetupError::value(
            key,
            "a 2D body has no degree of freedom z",
            "x, y or rotation",
        )),
    }
}

fn check_free(key: &str, value: f64, freedom: &Freedom) -> Result<(), SetupError> {
    if !freedom.is_free() {
        let message = "a spring or dashpot has no effect on a held or driven degree of freedom";
        return Err(SetupError::value(key, message, "a free degree of freedom"));
    }
    if !(value >= 0.0 && value.is_finite()) {
        let message = format!("{value} is negative or not finite");
        return Err(SetupError::value(key, message, "zero or a positive number"));
    }
    Ok(())
}

fn held_and_driven(key: &str) -> SetupError {
    let message = "the degree of freedom is held and driven";
    SetupError::value(key, message, "it in `hold` or in `driven`")
}

fn needs_one_axis(key: &str) -> SetupError {
    let message = "a 3D body that may turn in any way has no axis of rotation";
    let expected = "two rotations held, such as `hold = [\"rotation_x\", \"rotation_y\"]`";
    SetupError::value(key, message, expected)
}
