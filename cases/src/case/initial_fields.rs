//! Sets initial fields: those of `initial`, and columns of a table of points that have the name of a field.

use perimelt_core::body::POINT_COLUMNS;
use perimelt_core::input;
use perimelt_core::samples::{FieldFile, NumberTable};
use perimelt_core::{InSpace, Problem, Simulation, Warning, keys};

use super::bodies::suggest;
use super::error::Mistakes;
use super::initial::Initial;
use super::sections::BodySection;
use super::{Case, CaseError, Mistake, Result};

/// A body whose fields are set.
#[derive(Clone, Copy)]
struct TargetBody<'a> {
    index: usize,
    name: &'a str,
    section: &'a BodySection,
}

impl Case {
    /// Sets the initial fields of all bodies.
    ///
    /// # Errors
    /// The mistakes of all fields of all bodies.
    pub(super) fn set_initial(
        &self,
        simulation: &mut Simulation,
    ) -> std::result::Result<(), CaseError> {
        let mut mistakes = Mistakes::default();
        for (index, (name, section)) in self.bodies.iter().enumerate() {
            let target = TargetBody {
                index,
                name,
                section,
            };
            for column in self.other_columns(section) {
                let is_field = names_of(simulation, index).contains(&column);
                if is_field && !section.initial.contains_key(&column) {
                    let file = section.points.clone().expect("it has the column");
                    let values = FieldFile {
                        file,
                        column: Some(column.clone()),
                    };
                    let set = self.set_from_file(simulation, target, &column, &values);
                    let path = [name, "points"];
                    mistakes.collect(set.map_err(|e| self.body_error(&path, e.to_string(), "")));
                }
            }
            for (field, initial) in &section.initial {
                let set = self.set_field(simulation, target, field, initial);
                mistakes.collect(set.and_then(|()| self.check_axes(simulation, target, field)));
            }
            mistakes.collect(self.orient_plies(simulation, target));
        }
        mistakes.finish(())
    }

    /// Refuses motion along axes that a body does not have.
    fn check_axes(
        &self,
        simulation: &Simulation,
        TargetBody { index, name, .. }: TargetBody<'_>,
        field: &str,
    ) -> Result<()> {
        if !["displacement", "velocity"].contains(&field) {
            return Ok(());
        }
        let world = simulation.world();
        let (dimension, fields) = (world.body(index).dimension, world.fields());
        let Some(found) = fields.find(index, field) else {
            return Ok(());
        };
        let data = fields.field(found).data();
        let (vectors, _) = data.flat().as_chunks::<3>();
        let axes = dimension..3;
        let found = axes.map(|axis| (axis, vectors.iter().find(|v| v[axis] != 0.0)));
        match found.filter_map(|(axis, v)| Some((axis, v?[axis]))).next() {
            None => Ok(()),
            Some((axis, value)) => {
                let axis = ["x", "y", "z"][axis];
                let message = format!(
                    "the initial `{field}` is {value} along {axis} in body `{name}` of {dimension} dimensions"
                );
                let expected = format!("expected zero along {axis}");
                Err(self.body_error(&[name, "initial", field], message, &expected))
            }
        }
    }

    /// Turns the material of a lay-up about z by the angles of its plies, where a plugin reads its orientation.
    fn orient_plies(&self, simulation: &mut Simulation, target: TargetBody<'_>) -> Result<()> {
        let TargetBody { index, name, .. } = target;
        let orientation = keys::ORIENTATION;
        if simulation
            .world()
            .fields()
            .find(index, &orientation.name)
            .is_none()
        {
            return Ok(());
        }
        let Some(layers) = simulation.world().body(index).layers().cloned() else {
            return Ok(());
        };
        for point in 0..simulation.world().body(index).points.len() {
            let turn = [0.0, 0.0, layers.angle(point)];
            simulation
                .set_initial(index, &orientation.name, std::iter::once(point), &turn)
                .map_err(|e| self.explained_body_error(&[name, "layup"], e.explain()))?;
        }
        Ok(())
    }

    fn set_field(
        &self,
        simulation: &mut Simulation,
        target: TargetBody<'_>,
        field: &str,
        initial: &Initial,
    ) -> Result<()> {
        let TargetBody {
            index,
            name,
            section,
        } = target;
        let known = names_of(simulation, index);
        if !known.iter().any(|k| k == field) {
            let mut lasting = simulation.lasting().filter(|f| f.body == index);
            if lasting.any(|f| f.name == field) {
                let message = format!("the field `{field}` of body `{name}` follows from others");
                let expected = format!("an initial value of {}", known.join(", "));
                return Err(self.body_key_error(&[name, "initial", field], message, &expected));
            }
            let message =
                format!("body `{name}` has no field `{field}` that can have an initial value");
            let error = self.body_key_error(
                &[name, "initial", field],
                message,
                "no physics or coupler provides it",
            );
            return Err(suggest(
                error,
                field,
                &known.iter().map(String::as_str).collect::<Vec<_>>(),
            ));
        }
        let place = |e: Problem, path: &[&str]| -> Box<Mistake> {
            self.explained_body_error(path, e.explain())
        };
        let path = [name, "initial", field];
        if initial.turns() && field != keys::ORIENTATION.name {
            let message = format!("the initial `{field}` is an angle");
            return Err(self.body_error(
                &path,
                message,
                "expected numbers: only an `orientation` is an angle",
            ));
        }
        if let Initial::File(file) = initial {
            return self
                .set_from_file(simulation, target, field, file)
                .map_err(|e| self.body_error(&path, e.to_string(), ""));
        }
        let count = simulation.world().body(index).points.len();
        match initial.varies() {
            false => simulation
                .set_initial(index, field, 0..count, &initial.at([0.0; 3]))
                .map_err(|e| place(e, &path))?,
            true => {
                for point in 0..count {
                    let position = simulation.world().body(index).points.position.at(point);
                    let value = initial.at(position.into());
                    if let Some(wrong) = value.iter().find(|v| !v.is_finite()) {
                        let at = perimelt_core::text::position(position);
                        let message = format!("the initial `{field}` is {wrong} at {at} m");
                        return Err(self.body_error(
                            &path,
                            message,
                            "expected a finite number at every point",
                        ));
                    }
                    simulation
                        .set_initial(index, field, point..point + 1, &value)
                        .map_err(|e| place(e, &path))?;
                }
            }
        }
        for (region, value) in initial.regions() {
            let path = [name, "initial", field, "regions", region];
            let Some(points) = simulation.world().body(index).regions.get(region).cloned() else {
                return Err(self.unknown_region(&path, region, section));
            };
            let points = points.points.iter().map(|&p| p as usize);
            simulation
                .set_initial(index, field, points, &value.values())
                .map_err(|e| place(e, &path))?;
        }
        Ok(())
    }

    /// Sets a scalar field from a file.
    fn set_from_file(
        &self,
        simulation: &mut Simulation,
        target: TargetBody<'_>,
        field: &str,
        file: &FieldFile,
    ) -> std::result::Result<(), Box<dyn std::error::Error>> {
        let body = simulation.world().body(target.index);
        let (positions, dimension) = (body.points.position.to_vec(), body.dimension);
        let value = InSpace::File(file.clone());
        let mut placed = value.at(field, &self.folder, positions, dimension)?;
        let values = placed.at(0.0)?.to_vec();
        for (point, value) in values.iter().enumerate() {
            simulation.set_initial(target.index, field, point..point + 1, &[*value])?;
        }
        if let Some(message) = placed.warning() {
            simulation.warn(Warning {
                plugin: format!("`initial.{field}` of body `{}`", target.name),
                message,
            });
        }
        Ok(())
    }

    /// Columns of the table of points of a body that do not describe the points.
    fn other_columns(&self, section: &BodySection) -> Vec<String> {
        let text = section
            .points
            .as_ref()
            .map(|path| input::read_text(&self.folder.join(path), input::LIMIT));
        let text = text.and_then(std::result::Result::ok).unwrap_or_default();
        let table = NumberTable::new(&text);
        let is_other = |name: &&String| !name.is_empty() && !POINT_COLUMNS.contains(&name.as_str());
        table.names().iter().filter(is_other).cloned().collect()
    }

    /// Sentences about columns of tables of points that nothing reads.
    pub(super) fn unused_columns(&self, simulation: &Simulation) -> Vec<String> {
        let mut found = Vec::new();
        for (index, (name, section)) in self.bodies.iter().enumerate() {
            for column in self.other_columns(section) {
                let reason = if section.initial.contains_key(&column) {
                    format!("`initial.{column}` is given, too")
                } else if names_of(simulation, index).contains(&column) {
                    continue;
                } else {
                    let fields = names_of(simulation, index).join("`, `");
                    format!(
                        "the columns are `{}` and initial fields of the body: `{fields}`",
                        POINT_COLUMNS.join("`, `")
                    )
                };
                found.push(format!(
                    "the column `{column}` of the points of body `{name}` is not used: {reason}"
                ));
            }
        }
        found
    }
}

/// Names of the fields of a body that can have an initial value.
fn names_of(simulation: &Simulation, body: usize) -> Vec<String> {
    let fields = simulation.initial().filter(|f| f.body == body);
    fields.map(|f| f.name.clone()).collect()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::case::Case;

    const BAR: &str = r#"
[bodies.bar]
shape.box = { min = [0, 0, 0], max = [0.02, 0.004, 1e-3] }
dimension = 2
spacing = 1e-3
material = "steel"
initial.velocity = VELOCITY

[materials.steel]
density = 7800
youngs_modulus = 2e11
poissons_ratio = 0.3333333333333333

[[physics]]
type = "mechanical"
solver.explicit = {}

[time]
end = 1e-6
"#;

    #[test]
    fn bodies_do_not_move_along_axes_that_they_lack() {
        let told = |velocity: &str| {
            let text = BAR.replace("VELOCITY", velocity);
            let case = Case::parse("bar.toml", text, Path::new(".")).expect("valid");
            case.compose().err().map(|error| error.render(false))
        };
        assert!(told("[1, 2, 0]").is_none());
        for velocity in ["[1, 2, 30]", "[\"x\", 0, \"1500 * x\"]"] {
            let told = told(velocity).expect(velocity);
            let expected = "along z in body `bar` of 2 dimensions";
            assert!(told.contains(expected), "{told}");
        }
    }
}
