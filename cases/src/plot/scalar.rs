//! One number per point from a logged field.

use perimelt_core::log::{Cloud, CloudField};

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

const VECTOR: [&str; 3] = ["x", "y", "z"];
const TENSOR: [&str; 9] = ["xx", "yx", "zx", "xy", "yy", "zy", "xz", "yz", "zz"];

/// The scalar called `name`: a scalar field, the magnitude of a vector field, the von Mises
/// equivalent `sqrt(3/2 s:s)` (s: deviator) of a tensor field, or a component `field.x`,
/// `field.xy`. `None` if the cloud has no such field.
pub(crate) fn scalar(cloud: &Cloud, name: &str) -> Option<Scalar> {
    let field = |name: &str| cloud.fields.iter().find(|field| field.name == name);
    let pretty = super::unit::pretty_name;
    if let Some(field) = field(name) {
        let label = match field.components {
            3 => format!("{} magnitude", pretty(name)),
            9 => format!("{} (von Mises)", pretty(name)),
            _ => pretty(name),
        };
        let of_point: fn(&[f64]) -> f64 = match field.components {
            3 => |v| v.iter().map(|x| x * x).sum::<f64>().sqrt(),
            9 => von_mises,
            _ => |v| v[0],
        };
        return Some(made(field, label, of_point));
    }
    let (base, component) = name.rsplit_once('.')?;
    let field = field(base)?;
    let suffixes: &[&str] = match field.components {
        3 => &VECTOR,
        9 => &TENSOR,
        _ => return None,
    };
    let index = suffixes.iter().position(|suffix| *suffix == component)?;
    Some(made(field, format!("{} {component}", pretty(base)), |v| {
        v[index]
    }))
}

fn made(field: &CloudField, label: String, of: impl Fn(&[f64]) -> f64) -> Scalar {
    Scalar {
        label,
        unit: field.unit.clone(),
        values: field
            .values
            .chunks_exact(field.components)
            .map(of)
            .collect(),
    }
}

pub(crate) fn von_mises(t: &[f64]) -> f64 {
    let mean = (t[0] + t[4] + t[8]) / 3.0;
    let contraction: f64 = (0..9)
        .map(|c| if c % 4 == 0 { t[c] - mean } else { t[c] })
        .map(|deviator| deviator * deviator)
        .sum();
    (1.5 * contraction).sqrt()
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
        let cloud = Cloud {
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
        assert_eq!(value("force.q"), None);
        assert_eq!(value("heat"), None);
    }
}
