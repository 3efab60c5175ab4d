//! A source whose power density is a formula of the case file, such as `"exp(-2 * r^2 / 1e-3^2) * (1 - z / 2e-3)"`.

use std::borrow::Cow;
use std::rc::Rc;

use perimelt_core::formula::Formula;
use perimelt_core::{SetupError, flattened};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

use super::density::{Density, DensityOnFace};
use super::{ArcPower, CellGrid, HeatedSurface, PowerDensity, SourceShape};
use perimelt_core::numbers::check_positive;

/// Variables of a profile.
const VARIABLES: [&str; 4] = ["x", "y", "z", "r"];

/// Lengths over which a profile changes, as a fraction of its shortest reach, where the case does not give one.
const USUAL_FINEST: f64 = 0.125;

flattened! {
    /// A source with a power density by formula, scaled to its power.
    #[derive(Debug, Clone, PartialEq)]
    pub struct Profile {
        ..supplied: ArcPower,
        /// Power density in local coordinates (m): x along the direction of travel, y to its left as seen from outside, z the depth below the
        /// heated face, r = sqrt(x^2 + y^2). Nowhere negative; only its shape counts, since it is scaled to the power.
        pub profile: LocalFormula,
        /// Distance along the face from the position of the source beyond which the density is zero (m).
        #[schemars(extend("exclusiveMinimum" = 0))]
        pub reach: f64,
        /// Depth below which the density is zero (m). A 2D plate is heated through its thickness.
        #[schemars(extend("exclusiveMinimum" = 0))]
        pub depth: f64,
        /// Shortest length over which the density changes (m): the distance of its samples, and four times the way of the source in a step.
        /// Default an eighth of the shorter of `reach` and `depth` for the samples, and a quarter of `reach` for the steps.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("exclusiveMinimum" = 0))]
        pub finest: Option<f64>,
        /// The heated face; default z+ at the height of the toolpath.
        #[serde(default)]
        pub heated_surface: HeatedSurface,
    }
}

impl Profile {
    /// Shortest length over which the density changes (m).
    pub fn finest(&self) -> f64 {
        self.finest
            .unwrap_or(USUAL_FINEST * self.reach.min(self.depth))
    }
}

impl SourceShape for Profile {
    fn power(&self) -> Option<f64> {
        self.supplied.power
    }

    fn efficiency(&self) -> f64 {
        self.supplied.efficiency()
    }

    fn length(&self) -> f64 {
        self.finest.unwrap_or(0.25 * self.reach)
    }

    fn surface(&self) -> HeatedSurface {
        self.heated_surface
    }

    fn power_density(&self, _: &CellGrid) -> Result<PowerDensity, SetupError> {
        check_positive("reach", self.reach, "m")?;
        check_positive("depth", self.depth, "m")?;
        check_positive("finest", self.finest(), "m")?;
        Ok(PowerDensity::Sampled(DensityOnFace {
            density: Rc::new(self.clone()),
            surface: self.heated_surface,
        }))
    }
}

impl Density for Profile {
    fn at(&self, x: f64, y: f64, z: f64) -> f64 {
        let r = x.hypot(y);
        match r > self.reach {
            true => 0.0,
            false => self.profile.0.of(&[x, y, z, r]),
        }
    }

    fn reach(&self) -> [f64; 3] {
        [self.reach, self.reach, self.depth]
    }

    fn finest(&self) -> f64 {
        Profile::finest(self)
    }
}

/// A formula in the coordinates x, y, z and r of a source (m).
#[derive(Clone, Debug, PartialEq)]
pub struct LocalFormula(Formula);

impl Serialize for LocalFormula {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.0.serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for LocalFormula {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        let formula = Formula::in_variables(&text, &VARIABLES);
        formula.map(LocalFormula).map_err(de::Error::custom)
    }
}

impl JsonSchema for LocalFormula {
    fn schema_name() -> Cow<'static, str> {
        "LocalFormula".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "type": "string",
            "description": "formula in x, y, z and r (m), such as \"exp(-2 * r^2 / 1e-3^2)\""
        })
    }
}
