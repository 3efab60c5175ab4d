//! Insulated crack: bonds that cross it are removed, so neither heat nor force passes
//! (docs/theory/heat_conduction.md, "Insulated crack").
//!
//! The correction of the bonds beside the crack stays that of the uncut body: families there lack
//! members for a physical reason, not because the lattice ends. The crack grows when the mechanics has
//! `fracture`. Without `contact` its faces pass through each other when it closes.

use perimelt_core::text::position;
use perimelt_core::{Body, Coupler, Cut, Face, Prepared, RunningCoupler, Setup, SetupError};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Idle;

/// A crack: a line (`from`, `to`) or chain of lines (`through`) through the whole thickness, or in 3D a
/// plane part (`corner`, `edges`) or a `disc`.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct InsulatedCrack {
    /// Body; may be left out when there is one only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
    /// One tip of the line, x and y (m).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub from: Option<[f64; 2]>,
    /// The other tip, x and y (m).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to: Option<[f64; 2]>,
    /// Corners of a chain of lines, x and y (m).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub through: Option<Vec<[f64; 2]>>,
    /// A corner of the parallelogram (m).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub corner: Option<[f64; 3]>,
    /// The two edges from that corner, as vectors (m).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub edges: Option<[[f64; 3]; 2]>,
    /// A penny-shaped crack, such as `{ centre = [0, 0, 0], normal = [0, 0, 1], radius = 1e-3 }`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub disc: Option<Disc>,
}

/// A flat disc.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Disc {
    /// Centre, m.
    pub centre: [f64; 3],
    /// Normal of its plane, of any length.
    pub normal: [f64; 3],
    /// Radius, m.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub radius: f64,
}

impl InsulatedCrack {
    /// The cuts and the key that describes them.
    fn cuts(&self) -> Result<(Vec<Cut>, &'static str), SetupError> {
        let given = (
            self.from,
            self.to,
            &self.through,
            self.corner,
            self.edges,
            &self.disc,
        );
        let (cuts, key) = match given {
            (Some(from), Some(to), None, None, None, None) => (vec![Cut::segment(from, to)], "to"),
            (None, None, Some(corners), None, None, None) => {
                let lines = corners
                    .windows(2)
                    .map(|ends| Cut::segment(ends[0], ends[1]));
                (lines.collect(), "through")
            }
            (None, None, None, Some(corner), Some(edges), None) => {
                (vec![Cut::parallelogram(corner, edges)], "edges")
            }
            (None, None, None, None, None, Some(d)) => {
                (vec![Cut::disc(d.centre, d.normal, d.radius)], "disc")
            }
            _ => {
                let message = "the crack needs exactly one description";
                let expected = "one of `from` and `to`, `through`, `corner` and `edges`, or `disc`";
                return Err(SetupError::value("", message, expected));
            }
        };
        let cuts: Option<Vec<Cut>> = cuts.into_iter().collect();
        let cuts = cuts.filter(|cuts| !cuts.is_empty());
        let flat = || {
            let expected = "different ends, corners or edges, and a radius above 0";
            SetupError::value(key, "the length or area of the crack is zero", expected)
        };
        Ok((cuts.ok_or_else(flat)?, key))
    }
}

/// Whether `cut` separates any two neighbouring cells.
fn separates_cells(body: &Body, cut: &Cut) -> bool {
    let positions = &body.points.position;
    let upper = [Face::XMax, Face::YMax, Face::ZMax];
    positions.iter().enumerate().any(|(point, position)| {
        upper[..body.dimension].iter().any(|&face| {
            let neighbour = body.neighbour(point, face);
            // not the one across a periodic side
            let above = |n: &usize| positions[*n][face.axis()] > position[face.axis()];
            let neighbour = neighbour.filter(above);
            neighbour.is_some_and(|n| cut.crosses(position, &positions[n]))
        })
    })
}

#[typetag::serialize(name = "insulated_crack")]
impl Coupler for InsulatedCrack {
    fn prepare(self: Box<Self>, setup: &mut Setup<'_>) -> Prepared<dyn RunningCoupler> {
        let body = setup.find_body(self.body.as_deref())?;
        let (cuts, key) = self.cuts()?;
        let this = setup.body(body);
        if let (Some(_), "edges" | "disc") = (this.layers(), key) {
            let message = format!(
                "body `{}` has a `layup`, whose cracks pass through all plies",
                this.name
            );
            return Err(SetupError::value(
                key,
                message,
                "`from` and `to`, or `through`",
            ));
        }
        // a crack in a hole of the body cuts the bonds across the hole
        let (min, max) = this.bounds();
        let (dimension, box_of_body) = (this.dimension, [min, max]);
        let meets = |cut: &Cut| separates_cells(this, cut) || cut.is_within(box_of_body, dimension);
        if !setup.world().processes().any(cuts.iter().any(meets)) {
            let message = format!(
                "the crack separates no points of body `{}`, which spans {} to {} m",
                setup.body(body).name,
                position(min),
                position(max),
            );
            return Err(SetupError::value(key, message, "a crack inside the body"));
        }
        for cut in cuts {
            setup.cut(body, cut);
        }
        Ok(Box::new(Idle))
    }
}

perimelt_core::register_coupler!("insulated_crack", InsulatedCrack, supports: [Layers, Division]);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{STEEL, block, prepare, read, refusal};
    use perimelt_core::shape::{BoxShape, Difference, Shape};
    use perimelt_core::{FamilySpec, World};

    fn bonds(setup: &mut Setup<'_>) -> usize {
        let spec = FamilySpec::new(1.0);
        let family = setup.family(0, &spec).expect("valid");
        setup.world().family(family).bonds()
    }

    #[test]
    fn families_obtained_after_it_lack_the_bonds_that_cross() {
        for (crack, cut) in [
            ("from = [0, 1]\nto = [2, 1]", 2 * 2 * 2),
            ("corner = [0, 1, 0]\nedges = [[2, 0, 0], [0, 0, 1]]", 2 * 2),
            ("through = [[0, 1], [2, 1], [2, 3]]", 2 * 2 * (2 + 2)),
            (
                "disc = { centre = [2, 1, 1], normal = [0, 2, 0], radius = 0.8 }",
                2 * 2 * 2,
            ),
        ] {
            let mut world = World::new(vec![block([4, 3, 2], 3, STEEL)]);
            let coupler: InsulatedCrack = read(crack);
            let (_, left) = prepare(&mut world, coupler, bonds).expect("valid");
            // edges of the lattice along x, y, z; each is two directed bonds
            let whole = 2 * (3 * 3 * 2 + 4 * 2 * 2 + 4 * 3);
            assert_eq!(left, whole - cut, "{crack}");
        }
    }

    #[test]
    fn a_crack_in_a_hole_severs_what_reaches_across() {
        let side = |min, max| Shape::Box(BoxShape { min, max });
        let slotted = Shape::Difference(Difference {
            from: Box::new(side([0.0; 3], [4.0, 3.0, 1.0])),
            subtract: Box::new(side([0.0, 1.0, 0.0], [4.0, 2.0, 1.0])),
        });
        let body = Body::fill("slotted", &slotted, 2, 1.0, 1.0).expect("valid");
        let across = |setup: &mut Setup<'_>| {
            let spec = FamilySpec::new(2.0);
            let family = setup.family(0, &spec).expect("valid");
            setup.world().family(family).bonds()
        };
        let mut world = World::new(vec![body]);
        let coupler: InsulatedCrack = read("from = [0, 1.5]\nto = [4, 1.5]");
        let (_, left) = prepare(&mut world, coupler, across).expect("valid");
        // two rows of four points, each with bonds to neighbours and next ones, both ways
        assert_eq!(left, 2 * 2 * (3 + 2));
    }

    #[test]
    fn a_crack_beside_the_body_is_refused() {
        for (crack, message) in [
            (
                "from = [9, 1]\nto = [12, 1]",
                "separates no points of body `block`",
            ),
            (
                "from = [1, 1]\nto = [1, 1]",
                "length or area of the crack is zero",
            ),
            ("from = [1, 1]", "one of `from` and `to`"),
            ("through = [[1, 1]]", "length or area of the crack is zero"),
        ] {
            let mut world = World::new(vec![block([4, 3, 2], 3, STEEL)]);
            let coupler: InsulatedCrack = read(crack);
            assert!(refusal(&mut world, coupler).contains(message), "{crack}");
        }
    }
}
