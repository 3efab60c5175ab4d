//! Force through a plane section of the body: the sum of the forces of all bonds that cross it (docs/theory/stress.md),
//! which balances the forces on either side exactly.

use perimelt_core::family::AxisPlane;
use perimelt_core::solver::ExactSum;
use perimelt_core::{Axis, Report, Setup, SetupError, World};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::step::MechanicalRun;

/// A plane across the body, best halfway between points.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Section {
    /// Name in reports.
    pub name: String,
    /// Axis of its normal, `"x"`, `"y"` or `"z"`.
    pub axis: Axis,
    /// Reference position along that axis, m.
    pub at: f64,
    /// Only bonds of the points of this region that lie below the plane; all bonds across the plane when left out.
    #[serde(default)]
    pub region: Option<String>,
}

impl Section {
    /// Checks all sections of a body.
    ///
    /// # Errors
    /// Those of [`Section::check`], two sections of one name.
    pub(super) fn check_all(
        sections: &[Section],
        setup: &Setup<'_>,
        body: usize,
    ) -> Result<(), SetupError> {
        for (number, section) in sections.iter().enumerate() {
            section.check(setup, body)?;
            if sections[..number].iter().any(|s| s.name == section.name) {
                let message = format!("two sections are called `{}`", section.name);
                return Err(SetupError::value("sections", message, "different names"));
            }
        }
        Ok(())
    }

    /// # Errors
    /// The plane misses the body, or there is no such region.
    fn check(&self, setup: &Setup<'_>, body: usize) -> Result<(), SetupError> {
        if let Some(region) = &self.region {
            setup.region(body, "sections", region)?;
        }
        let ((min, max), axis) = (setup.body(body).bounds(), self.axis as usize);
        if axis < setup.body(body).dimension && self.at >= min[axis] && self.at <= max[axis] {
            return Ok(());
        }
        let message = format!("section `{}` misses the body", self.name);
        let expected = format!("a position from {} to {} m", min[axis], max[axis]);
        Err(SetupError::value("sections", message, expected))
    }

    /// Force that the part above the plane exerts on the part below, N.
    pub(super) fn force(&self, run: &mut MechanicalRun, world: &World) -> [f64; 3] {
        let body = world.body(run.body);
        let volume = &body.points.volume;
        let region = self.region.as_ref().map(|name| &body.regions[name].points);
        let mut counts = vec![region.is_none(); volume.len()];
        region
            .into_iter()
            .flatten()
            .for_each(|&point| counts[point as usize] = true);
        let mut total: [ExactSum; 3] = Default::default();
        let plane = AxisPlane {
            axis: self.axis as usize,
            at: self.at,
        };
        let points = world.reducer(run.body);
        run.solid.force_across(plane, &mut |point, force| {
            if counts[point] && point < points.owned() {
                (0..3).for_each(|a| total[a].add(force[a] * volume[point]));
            }
        });
        total.map(|sum| points.total(sum))
    }

    pub(super) fn report(&self, force: [f64; 3]) -> impl Iterator<Item = Report> + '_ {
        force
            .into_iter()
            .zip(["x", "y", "z"])
            .map(|(value, axis)| Report::new(format!("section.{}.{axis}", self.name), "N", value))
    }
}
