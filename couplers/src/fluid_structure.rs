//! The interface between a fluid and a solid of any shape, deformable or rigid.
//!
//! The solid may also be another updated Lagrangian fluid, with which the first one does not mix.
//!
//! The points of the solid are walls for the fluid. The fluid uses their positions and velocities and exerts on each of them
//! the opposite of the force that the point exerts on the fluid, as an impulse at the start of the solid's step: pressure, and
//! viscous traction unless the fluid slips along the solid. The momentum of fluid and solid is conserved to rounding for any
//! step sizes. The forces are part of the fluid (`fluid`, conservative form), which reports them as `force.<solid>.x` and so
//! on, and their sum over several solids as `force.all.x`.
//!
//! Gao (2020), 7.2, gives each solid point instead the force `P n / spacing` with `P = 2 sum_b w0 V_b P_b` over the fluid
//! (eqs. 7.22, 7.23). That sum is the pressure at the interface; at the first row of the solid, half a spacing behind it, it is 53 %
//! of this pressure, and the fluid does not receive the opposite force (docs/theory/fluid_structure.md, "The published load").
//! The bond forces have neither error, and need no normal and no choice of loaded rows. The normals of that section, by the colour
//! gradient, are the field `interface_normal` of the solid, evaluated when a state is logged; its collision of points with
//! the solid is `collisions` of `fluid`.

use nalgebra::Vector3;
use perimelt_core::numbers::check_within;
use perimelt_core::world::{ContactAngle, WallPlace};
use perimelt_core::{
    Body, Coupler, ExpectedGift, FactRule, Prepared, RunningCoupler, Setup, SetupError, Stepping,
    Wall, keys,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::boundary::Idle;

/// Largest spacing of the solid over the spacing of the fluid; the fluid penetrates a coarser solid.
const COARSEST: f64 = 1.05;

/// A solid is a wall for a fluid, which pushes and drags it.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FluidStructure {
    /// Body that flows.
    pub fluid: String,
    /// Body that is a wall for it: with explicit mechanics, rigid, or another fluid.
    pub solid: String,
    /// Whether the fluid slips along the solid; else it sticks.
    #[serde(default)]
    pub slip: bool,
    /// Angle at which the interface of two fluids meets the solid, in the first fluid, degrees; when left out, 90, and the
    /// solid has no energy of its own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 0, "maximum" = 180))]
    pub contact_angle: Option<f64>,
}

#[typetag::serialize(name = "fluid_structure")]
impl Coupler for FluidStructure {
    fn prepare(self: Box<Self>, setup: &mut Setup<'_>) -> Prepared<dyn RunningCoupler> {
        let find = |key: &str, name: &str| {
            setup.find_body(Some(name)).map_err(|e| SetupError {
                key: key.into(),
                ..e
            })
        };
        let (fluid, solid) = (find("fluid", &self.fluid)?, find("solid", &self.solid)?);
        if fluid == solid {
            let message = format!("`fluid` and `solid` are both `{}`", self.fluid);
            return Err(SetupError::value("solid", message, "another body"));
        }
        let dimensions = [fluid, solid].map(|b| setup.body(b).dimension);
        if dimensions[0] != dimensions[1] {
            let message = format!(
                "a {}D solid cannot be a wall of a {}D fluid",
                dimensions[1], dimensions[0]
            );
            return Err(SetupError::value(
                "solid",
                message,
                "bodies of one dimension",
            ));
        }
        let spacing = setup.body(fluid).finest_spacing();
        let coarsest = setup.body(solid).coarsest_spacing();
        if coarsest > COARSEST * spacing {
            let message = format!(
                "the points of body `{}` are {coarsest} m apart, those of the fluid {spacing} m: it would be permeable",
                self.solid
            );
            let expected = "a solid with at most the spacing of the fluid";
            return Err(SetupError::value("solid", message, expected));
        }
        let wall = Wall {
            other: solid,
            slip: self.slip,
            unread: NO_WALLS,
        };
        setup.publish(fluid, wall)?;
        if let Some(angle) = check_within("contact_angle", self.contact_angle, 0.0, 180.0)? {
            check_common_lattice(setup.body(fluid), setup.body(solid))?;
            let wall = WallPlace::Body(solid);
            setup.publish(fluid, ContactAngle { wall, angle })?;
        }
        setup.publish(solid, ExpectedGift::of(&keys::IMPULSE))?;
        setup.stepping(Stepping {
            is_steady: true,
            ..Stepping::default()
        });
        // the fluid evaluates the interface
        Ok(Box::new(Idle))
    }
}

/// Refuses a solid whose points do not lie on the lattice of the fluid, between whose points the interface is continued.
fn check_common_lattice(fluid: &Body, solid: &Body) -> Result<(), SetupError> {
    /// Largest distance from a point of the lattice, in spacings.
    const NEAR: f64 = 0.01;
    let Some(lattice) = fluid.lattice() else {
        return Ok(());
    };
    let off = |x: &Vector3<f64>, axis: usize| {
        let along = (x[axis] - lattice.origin[axis]) / lattice.spacing - 0.5;
        (along - along.round()).abs()
    };
    let points = solid.points.position.iter();
    let off = points.flat_map(|x| (0..fluid.dimension).map(move |axis| off(x, axis)));
    let farthest = off.fold(0.0, f64::max);
    if farthest <= NEAR {
        return Ok(());
    }
    let message = format!(
        "points of `{}` lie {farthest:.2} spacings beside the lattice of `{}`, where the angle would be wrong",
        solid.name, fluid.name
    );
    let expected = "bodies of one spacing whose boxes begin whole spacings apart";
    Err(SetupError::value("contact_angle", message, expected))
}

/// The mistake of walls that no physics of the fluid takes.
const NO_WALLS: FactRule = FactRule {
    key: "fluid",
    message: "no physics of body `{body}` has walls",
    expected: "a `fluid` of that body with `form = \"conservative\"`",
};

perimelt_core::register_coupler!("fluid_structure", FluidStructure, supports: [Motion, Flow]);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{STEEL, block, read, refusal};
    use perimelt_core::World;

    #[test]
    fn mistakes_are_refused() {
        let world = || {
            let mut solid = block([3, 3, 1], 2, STEEL);
            solid.name = "gate".into();
            World::new(vec![
                block([3, 3, 1], 2, STEEL),
                solid,
                block([2, 2, 2], 3, STEEL),
            ])
        };
        let mut third = world();
        third = {
            let mut bodies = third.bodies().to_vec();
            bodies[2].name = "cube".into();
            World::new(bodies)
        };
        for (keys, message) in [
            ("fluid = 'block'\nsolid = 'block'", "are both `block`"),
            (
                "fluid = 'block'\nsolid = 'gat'",
                "solid: no body is called `gat`; did you mean `gate`?",
            ),
            (
                "fluid = 'block'\nsolid = 'cube'",
                "a 3D solid cannot be a wall of a 2D fluid",
            ),
            (
                "fluid = 'block'\nsolid = 'gate'\ncontact_angle = -1",
                "contact_angle: ",
            ),
            // nothing flows
            ("fluid = 'block'\nsolid = 'gate'", "no physics"),
        ] {
            let found = refusal(&mut third, read::<FluidStructure>(keys));
            assert!(found.contains(message), "{found}");
        }
    }

    /// The interface is continued between points of one lattice, wherever its cells begin.
    #[test]
    fn an_angle_needs_a_solid_on_the_lattice_of_the_fluid() {
        for (offset, is_right) in [(2.0, true), (-3.0, true), (2.4, false)] {
            let mut solid = block([2, 2, 1], 2, STEEL);
            solid.name = "gate".into();
            solid.points.position.iter_mut().for_each(|x| x.y += offset);
            let checked = check_common_lattice(&block([2, 2, 1], 2, STEEL), &solid);
            assert_eq!(checked.is_ok(), is_right, "{offset}");
            if let Err(e) = checked {
                let message = format!("{}: {e}", e.key);
                assert!(
                    message.starts_with("contact_angle: points of `gate` lie 0.40 spacings"),
                    "{message}"
                );
            }
        }
    }
}
