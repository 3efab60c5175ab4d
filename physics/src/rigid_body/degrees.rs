//! Degrees of freedom of a rigid body: free, held, or driven along a prescribed displacement.

use std::f64::consts::TAU;

use perimelt_core::numbers::check_at_least;
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
pub(super) struct DegreeState {
    pub displacement: f64,
    pub velocity: f64,
}

impl Sine {
    /// Displacement `A sin(2 pi f t + phase)` and velocity `2 pi f A cos(2 pi f t + phase)`.
    fn at(&self, time: f64) -> DegreeState {
        let angular_frequency = TAU * self.frequency;
        let (sine, cosine) = (angular_frequency * time + self.phase).sin_cos();
        DegreeState {
            displacement: self.amplitude * sine,
            velocity: angular_frequency * self.amplitude * cosine,
        }
    }
}

impl Prescribed {
    /// State at t = 0. A prescribed velocity starts from the given displacement.
    pub(super) fn start(&self, displacement: f64) -> DegreeState {
        match self {
            Prescribed::Displacement(table) => DegreeState {
                displacement: table.at(0.0),
                velocity: table.next_event(0.0).map_or(0.0, |row| {
                    // linear from 0 to the next row
                    (table.at(row) - table.at(0.0)) / row
                }),
            },
            Prescribed::Velocity(table) => DegreeState {
                displacement,
                velocity: table.at(0.0),
            },
            Prescribed::Sine(sine) => sine.at(0.0),
        }
    }

    /// State at the end of `step`, from the displacement at its start. Steps end on the rows of tables, so that a
    /// table is linear over a step: the velocity of a displacement is its slope, and the displacement of a velocity
    /// is the exact integral.
    pub(super) fn end(&self, displacement: f64, step: Step) -> DegreeState {
        match self {
            Prescribed::Displacement(table) => {
                let end = table.at(step.end());
                DegreeState {
                    displacement: end,
                    velocity: (end - table.at(step.start)) / step.size,
                }
            }
            Prescribed::Velocity(table) => DegreeState {
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

/// Constraint of one degree of freedom.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Freedom {
    /// Moves by the forces.
    Free,
    /// Keeps its initial value.
    Held,
    /// Follows a prescribed displacement, independent of the forces.
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

/// Rotational freedom of a body.
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
    /// Degrees of freedom by the keys `hold` and `driven` of a body in 2D or 3D.
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
    check_at_least(key, value, 0.0, "")?;
    Ok(())
}

fn held_and_driven(key: &str) -> SetupError {
    let message = "the degree of freedom is held and driven";
    SetupError::value(
        key,
        message,
        "the degree of freedom in one of `hold` and `driven`",
    )
}

fn needs_one_axis(key: &str) -> SetupError {
    let message = "a 3D body that rotates freely has no axis of rotation";
    let expected = "two rotations held, such as `hold = [\"rotation_x\", \"rotation_y\"]`";
    SetupError::value(key, message, expected)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::read;

    fn driven(keys: &str) -> ByDegree<Prescribed> {
        read(keys)
    }

    fn freedoms(dimension: usize, hold: &[Degree], keys: &str) -> Freedoms {
        Freedoms::new(dimension, hold, &driven(keys)).expect(keys)
    }

    /// Displacement and velocity at the start, from a displacement of 7 m, and at the end of a step of half a second from 1 s.
    #[test]
    fn prescribed_motions_have_their_displacements_and_velocities() {
        let rows = "{ time = [0, 2, 3], value = [2, 6, 1] }";
        let sine = "sine = { amplitude = 2, frequency = 0.25, phase = 0.3 }";
        let angle = |t: f64| 0.5 * std::f64::consts::PI * t + 0.3;
        let rate = 0.5 * std::f64::consts::PI;
        for (keys, start, end) in [
            ("displacement = 3".into(), [3.0, 0.0], [3.0, 0.0]),
            // slopes of the rows
            (format!("displacement = {rows}"), [2.0, 2.0], [5.0, 2.0]),
            ("velocity = 4".into(), [7.0, 4.0], [9.0, 4.0]),
            // from 4 m/s to 5 m/s in the step
            (
                format!("velocity = {rows}"),
                [7.0, 2.0],
                [7.0 + 0.5 * 4.5, 5.0],
            ),
            (
                sine.to_owned(),
                [2.0 * angle(0.0).sin(), 2.0 * rate * angle(0.0).cos()],
                [2.0 * angle(1.5).sin(), 2.0 * rate * angle(1.5).cos()],
            ),
        ] {
            let prescribed: Prescribed = read(&keys);
            let step = Step::new(1.0, 0.5);
            let places = [prescribed.start(7.0), prescribed.end(7.0, step)];
            for (place, expected) in places.into_iter().zip([start, end]) {
                let found = [place.displacement, place.velocity];
                let off = found.iter().zip(expected).map(|(a, b)| (a - b).abs());
                assert!(off.fold(0.0, f64::max) < 1e-12, "{keys}: {found:?}");
            }
        }
    }

    /// The rows of the prescribed motions of all degrees of freedom are events.
    #[test]
    fn rows_of_all_degrees_of_freedom_are_events() {
        let rows = |from: u32| format!("{{ time = [{from}, {}], value = [0, 1] }}", from + 2);
        let keys = format!(
            "x.displacement = {}\nrotation.velocity = {}",
            rows(1),
            rows(2)
        );
        let all = freedoms(2, &[], &keys);
        for (after, event) in [
            (0.0, Some(1.0)),
            (1.0, Some(2.0)),
            (2.0, Some(3.0)),
            (3.0, Some(4.0)),
            (4.0, None),
        ] {
            assert_eq!(all.next_event(after), event, "{after}");
        }
        let sine = "y.sine = { amplitude = 1, frequency = 1 }";
        assert_eq!(freedoms(2, &[], sine).next_event(0.0), None);
    }

    #[test]
    fn a_body_is_free_where_nothing_is_held_or_driven() {
        use Degree::{Rotation, RotationX, RotationY, RotationZ, X, Z};
        for (dimension, hold, keys, is_free) in [
            (2, &[][..], "", true),
            (3, &[], "", true),
            (2, &[X], "", false),
            (3, &[Z], "", false),
            (2, &[Rotation], "", false),
            (3, &[Rotation], "", false),
            (3, &[RotationX, RotationY], "", false),
            (3, &[RotationX, RotationY, RotationZ], "", false),
            (2, &[], "y.velocity = 1", false),
            (2, &[], "rotation.velocity = 1", false),
        ] {
            let found = freedoms(dimension, hold, keys).is_free();
            assert_eq!(found, is_free, "{dimension}D {hold:?} {keys}");
        }
        let about = |hold: &[Degree]| freedoms(3, hold, "").turning;
        assert_eq!(
            about(&[RotationX, RotationZ]),
            Turning::About(1, Freedom::Free)
        );
        assert_eq!(about(&[RotationX, RotationY, RotationZ]), Turning::Held);
        assert_eq!(about(&[]), Turning::Any);
        // a plane body does not move across its plane
        assert_eq!(freedoms(2, &[], "").translation[2], Freedom::Held);
    }

    #[test]
    fn springs_act_on_free_degrees_of_freedom() {
        use Degree::{Rotation, RotationX, RotationY, X};
        for (dimension, hold, keys, at_fault) in [
            (2, &[][..], "x = 0\ny = 3\nrotation = 1", None),
            (3, &[RotationX, RotationY], "z = 1\nrotation = 1", None),
            (2, &[X], "y = 1", None),
            (2, &[X], "x = 1", Some("spring.x")),
            (2, &[], "z = 1", Some("spring.z")),
            (2, &[], "y = -1", Some("spring.y")),
            (2, &[], "y = inf", Some("spring.y")),
            (2, &[], "rotation = -1", Some("spring.rotation")),
            (2, &[Rotation], "rotation = 1", Some("spring.rotation")),
            (3, &[], "rotation = 1", Some("spring.rotation")),
        ] {
            let spring: ByDegree<f64> = read(keys);
            let checked = freedoms(dimension, hold, "").check_resistance("spring", &spring);
            let found = checked.err().map(|e| e.key);
            assert_eq!(found.as_deref(), at_fault, "{dimension}D {hold:?} {keys}");
        }
    }
}
