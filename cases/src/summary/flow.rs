//! The interface between two fluids and the motion of the first of them at the end.

use perimelt_core::log::Log;

use super::{Label, ReadOff};
use crate::log_names::REPORTS;

/// Reports of the interface: name, name in words, SI unit.
const INTERFACE: [(&str, &str, &str); 3] = [
    (
        "interface.pressure_jump",
        "jump of pressure between the fluids at the end",
        "Pa",
    ),
    ("interface.area", "area of the interface at the end", "m2"),
    (
        "interface.roundness",
        "roundness of the first fluid at the end",
        "1",
    ),
];

/// Numbers of the interfaces between two fluids, and of the first fluid along the axes along which it moved.
pub(super) fn flow(log: &Log, found: &mut Vec<ReadOff>) {
    let Some(reports) = log.probes().get(REPORTS) else {
        return;
    };
    let column = |name: String| reports.columns.iter().find(|c| c.name == name);
    let suffix = format!(".{}", INTERFACE[0].0);
    let fluids = reports.columns.iter();
    for physics in fluids.filter_map(|c| c.name.strip_suffix(&suffix)) {
        let mut number = |name: &str, words: String, unit: &str| {
            let last = column(format!("{physics}.{name}")).and_then(|c| c.values.last());
            let label = Label::new(format!("{name}.end"), words);
            found.extend(last.map(|value| ReadOff::new(physics, label, *value, unit)));
        };
        for (name, words, unit) in INTERFACE {
            number(name, words.into(), unit);
        }
        for axis in ["x", "y", "z"] {
            let velocity = format!("first_fluid.velocity.{axis}");
            let of_axis = column(format!("{physics}.{velocity}"));
            if of_axis.is_some_and(|c| c.values.iter().any(|v| *v != 0.0)) {
                let centre = format!("first_fluid.centre.{axis}");
                let words =
                    |what: &str| format!("{what} of the first fluid along {axis} at the end");
                number(&centre, words("centre"), "m");
                number(&velocity, words("mean velocity"), "m/s");
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use perimelt_core::log::Log;

    use crate::case::Case;
    use crate::run::{Options, run};
    use crate::summary::{SummaryOptions, read_off};

    const DROP: &str = r#"
[bodies.box]
dimension = 2
spacing = 1e-3
shape.box = { min = [0, 0, 0], max = [0.02, 0.02, 1e-3] }
material = "water"
materials = { drop = "oil" }
regions.drop.cylinder = { start = [0.01, 0.01, 0], end = [0.01, 0.01, 1e-3], radius = 5e-3 }
initial.velocity = ["0.01", "0", "0"]
periodic = ["x"]

[materials.oil]
density = 900
viscosity = 0.05

[materials.water]
density = 1000
viscosity = 0.01

[[physics]]
type = "fluid"
description = "eulerian"
form = "conservative"
state.incompressible = {}
fluids = ["oil", "water"]
interface = { surface_tension = 0.03 }

[[couplers]]
type = "wall"
faces = ["y-", "y+"]
kind = "slip"

[time]
end = 1e-3
"#;

    /// Of a drop that moves along x.
    #[test]
    fn a_drop_has_its_numbers() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("drop.mcap");
        let case = Case::parse("drop.toml", DROP.into(), folder.path()).expect("valid");
        let options = Options {
            out: path.clone(),
            quiet: true,
            ..Options::default()
        };
        assert!(run(&case, &options).is_ok());
        let found = read_off(
            &Log::open(&path).expect("a log"),
            &SummaryOptions::default(),
        );
        let found = found.expect("readable");
        let number = |id: &str| found.iter().find(|r| r.id == id).map(|r| r.value);
        let speed = number("first_fluid.velocity.x.end").expect("it moves");
        assert!((speed - 0.01).abs() < 1e-3, "{speed}");
        assert!(number("first_fluid.centre.z.end").is_none());
        let jump = number("interface.pressure_jump.end").expect("two fluids");
        assert!(jump > 0.0, "{jump}");
        assert!(number("velocity.end").is_some());
    }
}
