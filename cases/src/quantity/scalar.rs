//! One number per point from a logged field.

use std::collections::BTreeSet;

use perimelt_core::log::{CloudField, Log, LogError, LoggedCloud};

use crate::argument::suggestion;
use crate::component::Number;

/// A scalar made from a field.
#[derive(Clone, Debug)]
pub(crate) struct Scalar {
    /// what it is, for a reader
    pub label: String,
    /// SI unit
    pub unit: String,
    /// one value per point
    pub values: Vec<f64>,
}

/// Why a scalar cannot be made from the fields of a log.
#[derive(Debug, thiserror::Error)]
pub enum ScalarError {
    /// The log cannot be read.
    #[error(transparent)]
    Log(#[from] LogError),
    /// No body has it.
    #[error(
        "the log has no field `{field}`; it has: {} (of vectors and tensors also components, such \
         as `displacement.x`){}",
        known.join(", "), suggestion(field, known)
    )]
    Unknown {
        /// the requested name
        field: String,
        /// the known names
        known: Vec<String>,
    },
}

/// Refuses the name of a scalar that none of the bodies has.
///
/// # Errors
/// [`ScalarError`].
pub(crate) fn check_scalars<'a>(
    log: &Log,
    bodies: impl Iterator<Item = &'a str>,
    names: &[String],
) -> Result<(), ScalarError> {
    let with_states = bodies.filter(|body| !log.times(body).is_empty());
    let clouds = with_states.map(|body| log.first_cloud(body));
    let clouds = clouds.collect::<Result<Vec<_>, _>>()?;
    let missing = |name: &&String| clouds.iter().all(|cloud| scalar(cloud, name).is_none());
    match names.iter().find(missing) {
        Some(field) if !clouds.is_empty() => {
            let fields = clouds.iter().flat_map(|cloud| &cloud.fields);
            let known: BTreeSet<_> = fields.map(|field| field.name.clone()).collect();
            Err(ScalarError::Unknown {
                field: field.clone(),
                known: known.into_iter().collect(),
            })
        }
        _ => Ok(()),
    }
}

/// The scalar called `name`: a scalar field, the magnitude of a vector field, the von Mises
/// equivalent of a tensor field, or one of their numbers such as `field.x`, `field.principal_1`.
/// `None` if the cloud has no such field.
pub(crate) fn scalar(cloud: &LoggedCloud, name: &str) -> Option<Scalar> {
    let field = |name: &str| cloud.fields.iter().find(|field| field.name == name);
    let pretty = crate::unit::pretty_name;
    if let Some(field) = field(name) {
        let (label, number) = match field.components {
            3 => (format!("{} magnitude", pretty(name)), Number::Magnitude),
            9 => (format!("{} (von Mises)", pretty(name)), Number::VonMises),
            _ => (pretty(name), Number::Entry(0)),
        };
        return Some(made(field, label, number));
    }
    let (base, component) = name.rsplit_once('.')?;
    let field = field(base)?;
    let number = Number::find(field.components, component)?;
    let label = format!("{} {}", pretty(base), component.replace('_', " "));
    Some(made(field, label, number))
}

/// Fields of what happens to some points only; they are zero where it has not happened.
const OF_EVENTS: [&str; 4] = [
    "cooling_time",
    "cooling_rate",
    "thermal_gradient",
    "solidification_speed",
];

fn made(field: &CloudField, label: String, number: Number) -> Scalar {
    let is_of_events = OF_EVENTS.contains(&&*field.name);
    // a cooling time that was never reached is no cooling time of zero
    let happened = |value: f64| {
        if is_of_events && value == 0.0 {
            f64::NAN
        } else {
            value
        }
    };
    Scalar {
        label,
        unit: field.unit.clone(),
        values: field
            .values
            .chunks_exact(field.components)
            .map(|value| happened(number.of(value)))
            .collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vectors_and_tensors_become_their_textbook_scalars() {
        let field = |name: &str, components, values| CloudField {
            name: name.into(),
            unit: "Pa".into(),
            components,
            values,
        };
        let cloud = LoggedCloud {
            time: 0.0,
            positions: vec![[0.0; 3]],
            fields: vec![
                field("force", 3, vec![3.0, 0.0, -4.0]),
                // uniaxial tension of 7 with a pressure of 2 on top, and pure shear of 1
                field(
                    "stress",
                    9,
                    vec![5.0, 0.0, 0.0, 0.0, -2.0, 0.0, 0.0, 0.0, -2.0],
                ),
                field(
                    "shear",
                    9,
                    vec![0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
                ),
            ],
        };
        let value = |name| scalar(&cloud, name).map(|scalar| scalar.values[0]);
        assert_eq!(value("force"), Some(5.0));
        assert_eq!(value("force.z"), Some(-4.0));
        // rounding only
        assert!((value("stress").expect("there") - 7.0).abs() < 1e-14);
        assert!((value("shear").expect("there") - 3.0_f64.sqrt()).abs() < 1e-14);
        assert_eq!(value("stress.yy"), Some(-2.0));
        assert_eq!(value("stress.principal_1"), Some(5.0));
        assert_eq!(value("force.q"), None);
        assert_eq!(value("heat"), None);
    }
}
