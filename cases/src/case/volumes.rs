//! Volumes of points against those of the shapes that they fill.

use perimelt_core::shape::{Difference, Shape};
use perimelt_core::{Body, Simulation};

use super::{Case, CaseError};
use crate::unit;

/// Fraction of the volume of a shape by which that of the points may differ.
const MOST: f64 = 0.03;

/// Difference between the volume of the points and that of their shape (m³), where it is too large.
fn difference(filled: f64, asked: f64) -> Option<String> {
    let difference = filled / asked - 1.0;
    if !(difference.abs() > MOST) {
        return None;
    }
    let sign = if difference < 0.0 { "less" } else { "more" };
    let percent = unit::number(100.0 * difference.abs(), 2);
    let [filled, asked] = [filled, asked].map(|v| unit::number(v, 4));
    Some(format!(
        "a volume of {filled} m³, {percent} % {sign} than the {asked} m³ of its shape"
    ))
}

/// A body whose points fill another volume than its shape has.
pub(super) fn of_body(body: &Body, shape: &Shape) -> Option<String> {
    let asked = body.thickness * shape.measure(body.dimension)?;
    let difference = difference(body.points.volume.each().sum(), asked)?;
    Some(format!(
        "the points of body `{}` have {difference}: heat, mass and stiffness are those of the points; take a smaller `spacing`, or \
         one that divides its thicknesses",
        body.name
    ))
}

impl Case {
    /// Regions of deposited metal whose points fill another volume than their part of the body has, as where an inclined face
    /// passes through points.
    pub(super) fn deposited_volumes(
        &self,
        simulation: &Simulation,
    ) -> Result<Vec<String>, CaseError> {
        let bodies = simulation.world().bodies();
        let mut found = Vec::new();
        for table in self.plugin_tables("couplers")? {
            let at = (table.text("region"), table.body_index(bodies));
            let ((Some(region), Some(index)), "deposit") = (at, &table.kind[..]) else {
                continue;
            };
            let ((name, section), body) = (&self.bodies[index], &bodies[index]);
            let Some(shape) = section.regions.get(region) else {
                continue;
            };
            let shape = self.loaded(&[name.as_str(), "regions", region], shape)?;
            let whole = self.loaded(&[name.as_str(), "shape"], &section.shape)?;
            let asked = common(whole, shape).measure(body.dimension);
            let points = body.regions[region].points.iter();
            let filled = points.map(|p| body.points.volume[*p as usize]).sum();
            let told = asked.and_then(|asked| difference(filled, body.thickness * asked));
            if let Some(difference) = told {
                found.push(format!(
                    "the points of region `{region}`, which `deposit` fills, have {difference}: mass, heat and throat of the metal are those \
                     of the points; take a smaller `spacing`, or turn an inclined face that passes through points by some degrees"
                ));
            }
        }
        Ok(found)
    }
}

/// Intersection of two shapes.
fn common(one: Shape, other: Shape) -> Shape {
    let less = |from: Shape, subtract: Shape| {
        Shape::Difference(Difference {
            from: Box::new(from),
            subtract: Box::new(subtract),
        })
    };
    less(one.clone(), less(one, other))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    /// Fillets of 5 mm at 1 mm between a plate and a web: with the inclined face through the middles of cells 15 cells for 12.5.
    #[test]
    fn a_fillet_whose_face_passes_through_points_is_told() {
        for ([y, z], told) in [
            ([0.005, 0.005], Some("20 % more")),
            ([0.0053, 0.0046], None),
        ] {
            let fillet = format!(
                "extrusion = {{ axis = 'x', from = 0, to = 0.02, polygon = [[0, 0], [{y}, 0], [0, {z}]] }}"
            );
            let text = format!(
                "[bodies.joint]\n\
                 spacing = 1e-3\nmaterial = 'steel'\ninitial.temperature = 293.15\nregions.bead.{fillet}\n\
                 shape.union = [{{ box = {{ min = [0, -0.02, -0.004], max = [0.02, 0.02, 0] }} }}, \
                 {{ box = {{ min = [0, -0.004, 0], max = [0.02, 0, 0.02] }} }}, {{ {fillet} }}]\n\
                 [[physics]]\ntype = 'thermal'\nhorizon = 1\n\
                 [[couplers]]\ntype = 'deposit'\nregion = 'bead'\ntemperature = 1800\nlayers = {{ height = 5e-3, interval = 1 }}\n\
                 [materials.steel]\ndensity = 7800\nspecific_heat = 500\nconductivity = 50\n\
                 [time]\nend = 1\n"
            );
            let case = Case::parse("joint.toml", text, Path::new("")).expect("valid");
            let mut simulation = case.compose().expect("complete");
            case.start(&mut simulation).expect("starts");
            let found = case.deposited_volumes(&simulation).expect("read");
            assert_eq!(found.len(), usize::from(told.is_some()), "{y}: {found:?}");
            assert!(
                found.iter().zip(told).all(|(f, told)| f.contains(told)),
                "{found:?}"
            );
        }
    }
}
