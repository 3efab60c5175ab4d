//! Residual stresses at the end, with warnings about impossible values.

use perimelt_core::log::{BodyInfo, Log, LoggedCloud};
use perimelt_core::material::Material;

use super::{BodyRecord, Label, ReadOff};
use crate::case::of_log::case_of;
use crate::log_file::plugins_of;
use crate::quantity::scalar::scalar;
use crate::unit;

/// Largest hydrostatic stress over the yield stress that metal bears: that of a notch with a fully plastic ligament (Prandtl's
/// field, 1 + pi/2 in tension of plane strain) is 2.4 to 3.
const MOST_HYDROSTATIC: f64 = 3.0;

/// Reads off hydrostatic and principal stresses.
pub(super) fn stresses(record: &BodyRecord<'_>, found: &mut Vec<ReadOff>) {
    let &BodyRecord {
        log, body, last, ..
    } = record;
    let extreme = |component: &str, is_better: fn(f64, f64) -> bool| {
        let stress = scalar(last, &format!("stress.{component}"))?;
        let values = stress.values.iter().copied().enumerate();
        let finite = values.filter(|(_, value)| value.is_finite());
        finite.reduce(|best, next| {
            if is_better(next.1, best.1) {
                next
            } else {
                best
            }
        })
    };
    let mut add =
        |id: &str, quantity: &str, value: Option<(usize, f64)>, warning: Option<String>| {
            found.extend(value.map(|(point, value)| {
                let name = Label::new(id, format!("{quantity} at the end"));
                let stress = ReadOff::new(&body.name, name, value, "Pa").at(last.time);
                ReadOff {
                    warning,
                    ..stress.within(last.positions[point])
                }
            }));
        };
    let yields = Yield::of(log, body);
    let von_mises = extreme("von_mises", |a, b| a > b);
    let of_elastic = von_mises.and_then(|(point, value)| {
        let yields = yields.as_ref().filter(|_| !is_plastic(log, body))?;
        yields.exceeded(value, 1.0, temperature_at(last, point))
    });
    let of_elastic = of_elastic.map(|(limit, _)| {
        format!(
            "the yield stress of {limit} is exceeded in a computation without plastic flow: give `plasticity` in `mechanical`"
        )
    });
    let name = "largest von Mises stress";
    add("stress.von_mises.end", name, von_mises, of_elastic);
    let hydrostatic = extreme("hydrostatic", |a, b| a.abs() > b.abs());
    let too_large = hydrostatic.and_then(|(point, value)| {
        let temperature = temperature_at(last, point);
        let yields = yields.as_ref()?;
        yields.exceeded(value.abs(), MOST_HYDROSTATIC, temperature)
    });
    let too_large = too_large.map(|(limit, ratio)| {
        format!(
            "this is {ratio} times the yield stress of {limit}; above {MOST_HYDROSTATIC} times, metal yields or tears before: \
             do not rely on the stresses near this place"
        )
    });
    let name = "largest hydrostatic stress (by size)";
    add("stress.hydrostatic.end", name, hydrostatic, too_large);
    let largest = extreme("principal_1", |a, b| a > b);
    let name = "largest principal stress";
    add("stress.principal_1.end", name, largest, None);
    let smallest = extreme("principal_3", |a, b| a < b);
    let name = "smallest principal stress";
    add("stress.principal_3.end", name, smallest, None);
}

fn temperature_at(last: &LoggedCloud, point: usize) -> Option<f64> {
    scalar(last, "temperature")?.values.get(point).copied()
}

/// Whether the physics `mechanical` of a body has plastic flow.
fn is_plastic(log: &Log, body: &BodyInfo) -> bool {
    let mut mechanical = plugins_of(log, "physics", "mechanical", &body.name);
    mechanical.any(|physics| {
        ["plasticity", "flow"]
            .iter()
            .any(|key| !physics[key].is_null())
    })
}

/// Yield stress of the materials of a body.
struct Yield(Vec<Material>);

impl Yield {
    fn of(log: &Log, body: &BodyInfo) -> Option<Yield> {
        let materials = case_of(log).ok()?.materials_of(&body.name).ok()?;
        Some(Yield(materials))
    }

    /// The yield stress as text, and how many times it is reached, where a stress (Pa) exceeds `factor` times the largest yield
    /// stress of the materials at a temperature (K), that of the table's coldest row without one.
    fn exceeded(
        &self,
        stress: f64,
        factor: f64,
        temperature: Option<f64>,
    ) -> Option<(String, String)> {
        let of = |material: &Material| {
            let property = material.get("yield_stress")?;
            let at = temperature.unwrap_or(0.0);
            Some(property.at(at, 0.0))
        };
        let largest = self.0.iter().filter_map(of).max_by(f64::total_cmp)?;
        (stress > factor * largest).then(|| {
            let (scale, name) = unit::value("Pa", largest);
            let limit = format!("{} {name}", unit::number(largest * scale, 3));
            (limit, unit::number(stress / largest, 2))
        })
    }
}

#[cfg(test)]
mod tests {
    use crate::summary::testing::{Plate, number, positions};
    use crate::summary::{ReadOff, SummaryOptions, print, read_off};
    use serde_json::{Value, json};

    /// Read-offs of a plate of a steel with a yield stress of 300 MPa, with these stresses at one point each (tensors, MPa).
    fn found(stresses: &[[f64; 9]], physics: Value) -> Vec<ReadOff> {
        let mut stress = vec![0.0; 9 * positions().len()];
        for (point, tensor) in stresses.iter().enumerate() {
            for (entry, value) in tensor.iter().enumerate() {
                stress[9 * point + entry] = 1e6 * value;
            }
        }
        let plate = Plate {
            states: vec![vec![("stress", "Pa", 9, stress)]],
            plugins: json!({ "physics": [physics] }),
            ..Plate::default()
        };
        let folder = tempfile::tempdir().expect("a folder");
        let log = plate.log(&folder.path().join("plate.mcap"));
        read_off(&log, &SummaryOptions::default()).expect("readable")
    }

    fn pressure(p: f64) -> [f64; 9] {
        [p, 0.0, 0.0, 0.0, p, 0.0, 0.0, 0.0, p]
    }

    #[test]
    fn hydrostatic_stress_beyond_three_times_yield_is_warned_of() {
        let plastic = || json!({ "type": "mechanical", "plasticity": {} });
        let along = [400.0, 0.0, 0.0, 0.0, 30.0, 0.0, 0.0, 0.0, -70.0];
        let hydrostatic = "largest hydrostatic stress (by size) at the end";
        let sound = found(&[along, pressure(-880.0)], plastic());
        let value = number(&sound, hydrostatic);
        assert!((value.value + 880e6).abs() < 1.0 && value.warning.is_none());
        assert_eq!(value.place, Some(positions()[1]));
        let largest = number(&sound, "largest principal stress at the end");
        assert!((largest.value - 400e6).abs() < 1.0);
        let smallest = number(&sound, "smallest principal stress at the end");
        assert!((smallest.value + 880e6).abs() < 1.0);
        let wrong = found(&[along, pressure(-930.0)], plastic());
        let warning = number(&wrong, hydrostatic).warning.clone();
        let warning = warning.expect("beyond three times yield");
        assert!(
            warning.contains("3.1 times the yield stress of 300 MPa"),
            "{warning}"
        );
        let mut text = Vec::new();
        print(&wrong, &mut text).expect("it writes to memory");
        let text = String::from_utf8(text).expect("text");
        assert!(text.contains("warning: this is 3.1 times"), "{text}");
    }

    #[test]
    fn an_elastic_computation_beyond_yield_is_warned_of() {
        let shear = [0.0, 200.0, 0.0, 200.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        let warned = |plasticity: Value| {
            let physics = json!({ "type": "mechanical", "plasticity": plasticity });
            let found = found(&[shear], physics);
            let stress = number(&found, "largest von Mises stress at the end");
            assert!((stress.value - 3f64.sqrt() * 200e6).abs() < 1.0);
            stress.warning.is_some()
        };
        assert!(warned(Value::Null));
        assert!(!warned(json!({ "annealing_temperature": 1300 })));
    }
}
