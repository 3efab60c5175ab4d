//! Two fluids of a body: their properties, and the tension between them.

use std::f64::consts::PI;

use perimelt_core::family::LayerRule;
use perimelt_core::law::Law;
use perimelt_core::material::Property;
use perimelt_core::numbers::{check_at_least, check_positive, check_within};
use perimelt_core::world::{BodyIndex, ContactAngle, WallPlace};
use perimelt_core::{Body, Face, Setup, SetupError, SurfaceTension, TensionLaw};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::dependent_keys::need;
use crate::fluid::viscosity::ViscositySweep;
use crate::tension::prepare_tension;

/// The interface between two fluids.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Interface {
    /// Length over which the fraction of a fluid changes, in spacings; across a plane interface it is
    /// `1 / (1 + exp(-distance / length))`. Below 1 the step is shorter, larger values cost resolution. For fluids that flow through their
    /// points.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("default" = 0.75, "minimum" = 0.6, "maximum" = 3))]
    pub width: Option<f64>,
    /// Tension of the interface, N/m, at the `reference_temperature` if `tension.slope` is given; when left out, the property
    /// `surface_tension` of the first fluid.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 0))]
    pub surface_tension: Option<f64>,
    /// How the tension depends on the temperature, which needs `thermal`; when left out, as the property of the first fluid does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tension: Option<SurfaceTension>,
    /// Temperature at which a tension with a `slope` has the value `surface_tension`, K.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub reference_temperature: Option<f64>,
}

/// Widths of an interface, in spacings: points resolve no thinner one, and a wider one is no interface on the scale of the points.
const WIDTHS: [f64; 2] = [0.6, 3.0];

/// Usual width of an interface, in spacings.
const WIDTH: f64 = 0.75;

impl Interface {
    /// The tension between two fluids of a body, which are these materials.
    fn law(
        &self,
        setup: &mut Setup<'_>,
        body: BodyIndex,
        material: [u16; 2],
    ) -> Result<TensionLaw, SetupError> {
        let Interface {
            surface_tension,
            tension,
            reference_temperature,
            ..
        } = *self;
        let reference = "interface.reference_temperature";
        check_at_least("interface.surface_tension", surface_tension, 0.0, "N/m")?;
        check_positive(reference, reference_temperature, "K")?;
        let names = material.map(|m| setup.body(body).materials[m as usize].name().to_owned());
        let first = &setup.body(body).materials[material[0] as usize];
        let property = first
            .same_in_all_directions("surface_tension")
            .ok()
            .flatten();
        let constant = surface_tension.or(property.and_then(Property::constant));
        let unknown = || {
            let [first, second] = &names;
            let message = format!("the tension between `{first}` and `{second}` is unknown");
            let expected = "`interface = { surface_tension = ... }` in N/m, 0 where there is none";
            SetupError::value("fluids", message, expected)
        };
        let slope = match tension {
            Some(SurfaceTension::Slope(slope)) => Some(slope),
            _ => None,
        };
        need(
            slope.is_some() == reference_temperature.is_some(),
            reference,
            "the temperature at which a tension has its value belongs to a constant slope",
            "both `interface.tension.slope` and `interface.reference_temperature`, or neither",
        )?;
        tension.map_or(Ok(()), |tension| tension.check("interface.tension"))?;
        if let (Some(slope), Some(temperature)) = (slope, reference_temperature) {
            let value = constant.ok_or_else(unknown)?;
            return Ok(TensionLaw::linear(value, temperature, slope));
        }
        need(
            tension.is_none() || surface_tension.is_none(),
            "interface.surface_tension",
            "`interface.tension` gives the tension at every temperature, and this is another value",
            "one of the two, or `tension.slope` with a `reference_temperature`",
        )?;
        let of_property = SurfaceTension::Material;
        match (surface_tension, tension) {
            (Some(value), _) => Ok(TensionLaw::constant(value)),
            (None, None) if property.is_none() => Err(unknown()),
            (None, law) => {
                let law = law.unwrap_or(of_property);
                prepare_tension(law, "interface.tension", setup, body, material[0])
            }
        }
    }
}

/// Keys of two fluids.
#[derive(Clone, Copy)]
pub(in crate::fluid) struct PairKeys<'a> {
    /// Names of their materials.
    pub(in crate::fluid) fluids: &'a [String],
    pub(in crate::fluid) interface: Interface,
    pub(in crate::fluid) viscosity: Option<&'a Law<dyn ViscositySweep>>,
}

/// Two fluids, and the tension between them.
#[derive(Clone, Debug)]
pub(in crate::fluid) struct PreparedPair {
    pub(in crate::fluid) pair: FluidPair,
    pub(in crate::fluid) tension: TensionLaw,
}

impl PreparedPair {
    /// The tension, where it depends on the temperature.
    pub(in crate::fluid) fn varying_tension(&self) -> Option<&TensionLaw> {
        Some(&self.tension).filter(|law| !law.is_constant())
    }
}

/// Two fluids.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::fluid) struct FluidPair {
    /// Indices of their materials.
    pub(in crate::fluid) material: [u16; 2],
    /// Density of each, kg/m³.
    pub(in crate::fluid) density: [f64; 2],
    /// Viscosity of each, Pa s.
    pub(in crate::fluid) viscosity: [f64; 2],
    /// N/m; the largest of the last step where it depends on the temperature.
    pub(in crate::fluid) surface_tension: f64,
    /// Length over which the fraction changes, in spacings.
    pub(in crate::fluid) width: f64,
    /// Angles at which the interface meets walls; none without a tension.
    pub(in crate::fluid) angles: Vec<ContactAngle>,
}

impl FluidPair {
    /// The two fluids of a body.
    pub(in crate::fluid) fn prepare(
        keys: PairKeys<'_>,
        setup: &mut Setup<'_>,
        body: BodyIndex,
    ) -> Result<PreparedPair, SetupError> {
        let width = keys.interface.width.unwrap_or(WIDTH);
        check_within("interface.width", width, WIDTHS[0], WIDTHS[1])?;
        need(
            keys.viscosity.is_none_or(|law| law.name == "newtonian"),
            "viscosity",
            "the viscosity of two fluids is the property `viscosity` of each",
            "`viscosity.newtonian`, or no `viscosity`",
        )?;
        let [first, second] = keys.fluids else {
            let message = format!("`fluids` has {} names", keys.fluids.len());
            return Err(SetupError::value(
                "fluids",
                message,
                "two materials of the body",
            ));
        };
        need(
            first != second,
            "fluids",
            "both fluids are of one material",
            "two materials of the body",
        )?;
        let this = setup.body(body);
        let material = [index(this, first)?, index(this, second)?];
        let others = &mut this
            .material_of_point
            .iter()
            .filter(|m| !material.contains(m));
        if let Some(other) = others.next() {
            let other = this.materials[*other as usize].name();
            let message = format!(
                "points of body `{}` are of a third material, `{other}`",
                this.name
            );
            return Err(SetupError::value(
                "fluids",
                message,
                "regions of the two fluids only",
            ));
        }
        let densities = setup.world().reference_densities(body)?;
        let viscosities = setup.world().property(body, "viscosity")?;
        let viscosity = |n: usize| {
            let value = viscosities[material[n] as usize].constant();
            value.filter(|v| *v > 0.0).ok_or_else(|| {
                let message = format!(
                    "the viscosity of `{}` is not one positive number",
                    keys.fluids[n]
                );
                SetupError::value("fluids", message, "a number for `viscosity`, Pa s")
            })
        };
        let viscosity = [viscosity(0)?, viscosity(1)?];
        let law = keys.interface.law(setup, body, material)?;
        let surface_tension = law.typical();
        let pair = FluidPair {
            material,
            density: material.map(|m| densities[m as usize]),
            viscosity,
            surface_tension,
            width,
            angles: match surface_tension > 0.0 {
                true => setup.facts(body).copied().collect(),
                false => Vec::new(),
            },
        };
        Ok(PreparedPair { pair, tension: law })
    }

    /// Speed at which the layer between the fluids is kept thin, over that of the flow. With less the fraction leaves the range from 0 to 1
    /// behind an interface that moves (Mirjalili, Ivey & Mani (2020)), and the wrong curvatures there brake the fluids, on any lattice.
    pub(in crate::fluid) fn mobility(&self) -> f64 {
        1.0 / (2.0 * self.width.min(1.0) - 1.0)
    }

    /// Fraction of the first fluid at points of a material.
    pub(in crate::fluid) fn fraction_of(&self, material: u16) -> f64 {
        f64::from(u8::from(material == self.material[0]))
    }

    /// Cosine of the angle in the first fluid at which the interface meets a wall; none where the wall has no angle.
    pub(in crate::fluid) fn contact_cosine(&self, wall: WallPlace) -> Option<f64> {
        let found = self.angles.iter().find(|angle| angle.wall == wall)?;
        Some(found.angle.to_radians().cos())
    }

    /// How normals into the first fluid continue behind faces: on a face they have the angle there, 90 degrees where it has none.
    pub(in crate::fluid) fn normal_rules(&self, body: &Body) -> Vec<LayerRule> {
        let closed = Face::ALL.into_iter().filter(|f| !body.periodic[f.axis()]);
        let rule = |face: Face| {
            let outwards = if face.is_upper() { 1.0 } else { -1.0 };
            let cosine = self.contact_cosine(WallPlace::Face(face)).unwrap_or(0.0);
            let mut rule = LayerRule::even(face);
            rule.scale[face.axis()] = -1.0;
            rule.offset[face.axis()] = 2.0 * outwards * cosine;
            rule
        };
        closed.map(rule).collect()
    }

    /// Of a mixture, kg/m³.
    pub(in crate::fluid) fn density_of(&self, fraction: f64) -> f64 {
        let [first, second] = self.density;
        second + (first - second) * fraction
    }

    /// Of a mixture, Pa s: that of layers in series.
    pub(in crate::fluid) fn viscosity_of(&self, fraction: f64) -> f64 {
        let [first, second] = self.viscosity;
        let c = fraction.clamp(0.0, 1.0);
        first * second / (c * second + (1.0 - c) * first)
    }

    /// `1/mu_1 - 1/mu_2`, 1/(Pa s).
    pub(in crate::fluid) fn jump_of_fluidity(&self) -> f64 {
        let [first, second] = self.viscosity;
        1.0 / first - 1.0 / second
    }

    /// Speed of capillary waves of the length of a spacing (m), m/s.
    pub(in crate::fluid) fn capillary_speed(&self, spacing: f64) -> f64 {
        let density: f64 = self.density.iter().sum();
        (self.surface_tension / (density * spacing)).sqrt()
    }

    /// Largest step (s) that capillary waves of a lattice of this spacing (m) allow: `sqrt((rho_1 + rho_2) dx^3 / (4 pi gamma))`
    /// (Brackbill et al. (1992)).
    pub(in crate::fluid) fn capillary_step(&self, spacing: f64) -> f64 {
        spacing / (self.capillary_speed(spacing) * (4.0 * PI).sqrt())
    }

    /// Largest kinematic viscosity, m²/s.
    pub(in crate::fluid) fn diffusivity(&self) -> f64 {
        let of = |n: usize| self.viscosity[n] / self.density[n];
        of(0).max(of(1))
    }
}

/// Index of a material of a body.
fn index(body: &Body, name: &str) -> Result<u16, SetupError> {
    let found = body.materials.iter().position(|m| m.name() == name);
    found.map(|index| index as u16).ok_or_else(|| {
        let names: Vec<String> = body.materials.iter().map(|m| format!("`{}`", m.name())).collect();
        let message = format!(
            "body `{}` has no material `{name}`, but {}",
            body.name,
            names.join(" and ")
        );
        let expected = "two of its materials; a second one is that of a region, `materials = { region = \"...\" }`";
        SetupError::value("fluids", message, expected)
    })
}
