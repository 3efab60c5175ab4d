//! Properties of the materials of a body.

use super::facts::Fact;
use super::{BodyIndex, World};
use crate::body::Body;
use crate::error::{Problem, SetupError};
use crate::material::{
    Directional, EnthalpyCurve, Expansion, LatentHeatForm, Material, MaterialError, MushyCapacity,
    Property,
};

/// How a body melts and freezes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PhaseChange {
    /// What heats up between solidus and liquidus.
    pub mushy_capacity: MushyCapacity,
    /// How a step of heating finds the new temperature.
    pub form: LatentHeatForm,
}

impl Fact for PhaseChange {}

impl World {
    /// The property `name` of each material of a body.
    ///
    /// # Errors
    /// When a material lacks it, or it is not the same in all directions.
    pub fn property(&self, body: BodyIndex, name: &str) -> Result<Vec<Property>, SetupError> {
        self.of_materials(body, name, |m| Ok(m.same_in_all_directions(name)?.cloned()))
    }

    /// The thermal expansion of each material of a body.
    ///
    /// # Errors
    /// When a material states none.
    pub fn expansions(&self, body: BodyIndex) -> Result<Vec<Directional<Expansion>>, SetupError> {
        self.of_materials(body, "thermal_expansion", Expansion::of)
    }

    /// What each material of a body has; `property` names what is missing where it has none.
    fn of_materials<T>(
        &self,
        body: BodyIndex,
        property: &str,
        of: impl Fn(&Material) -> Result<Option<T>, MaterialError>,
    ) -> Result<Vec<T>, SetupError> {
        let body = self.body(body);
        let materials = body.materials.iter();
        let found = materials.map(|material| found(body, material, property, of(material)));
        found.collect()
    }

    /// The property `name` of one of the materials of a body, by its number.
    ///
    /// # Errors
    /// When the material lacks it or it differs by direction.
    pub fn property_of(
        &self,
        body: BodyIndex,
        material: u16,
        name: &str,
    ) -> Result<Property, SetupError> {
        let body = self.body(body);
        let material = &body.materials[usize::from(material)];
        let of = material.same_in_all_directions(name);
        found(body, material, name, of.map(|of| of.cloned()))
    }

    /// The property `name` of the material of each point of a body, as a number.
    ///
    /// # Errors
    /// When a material lacks it or it is not constant.
    pub fn constant_at_points(&self, body: BodyIndex, name: &str) -> Result<Vec<f64>, SetupError> {
        let number = |property: &Property| {
            property.constant().ok_or_else(|| {
                let message = format!("`{name}` is a table");
                SetupError::value("", message, format!("one number for `{name}`"))
            })
        };
        let properties = self.property(body, name)?;
        let by_material: Vec<f64> = properties.iter().map(number).collect::<Result<_, _>>()?;
        let materials = self.body(body).material_of_point.iter();
        Ok(materials.map(|&m| by_material[m as usize]).collect())
    }

    /// Density that fixes the mass of the points of each material of a body, kg/m³
    /// ([`Material::reference_density`]).
    ///
    /// # Errors
    /// When a material lacks it.
    pub fn reference_densities(&self, body: BodyIndex) -> Result<Vec<f64>, SetupError> {
        let materials = self.body(body).materials.iter();
        let densities = materials.map(Material::reference_density);
        let densities: Result<_, MaterialError> = densities.collect();
        densities.map_err(|e| SetupError::other("", e))
    }

    /// [`World::reference_densities`] for each point of the body, kg/m³.
    ///
    /// # Errors
    /// See [`World::reference_densities`].
    pub fn density_at_points(&self, body: BodyIndex) -> Result<Vec<f64>, SetupError> {
        let by_material = self.reference_densities(body)?;
        let materials = self.body(body).material_of_point.iter();
        Ok(materials.map(|&m| by_material[m as usize]).collect())
    }

    /// Enthalpy against temperature of each material of a body, with latent heat where the
    /// body has a phase change and the material all of solidus, liquidus and latent heat.
    ///
    /// # Errors
    /// When density or specific heat are missing, or the curve cannot be.
    pub fn enthalpy_curves(&self, body: BodyIndex) -> Result<Vec<EnthalpyCurve>, SetupError> {
        let change = self.fact::<PhaseChange>(body).copied();
        let curve = |material: &Material| {
            // a material that does not say how it melts stays solid
            let melts = ["solidus", "liquidus", "latent_heat"]
                .iter()
                .all(|p| material.get(p).is_some());
            let latent = match change.filter(|_| melts) {
                Some(change) => Some(material.latent_heat(change.mushy_capacity, change.form)?),
                None => None,
            };
            material.enthalpy_curve(latent)
        };
        self.bodies[body]
            .materials
            .iter()
            .map(curve)
            .collect::<Result<_, MaterialError>>()
            .map_err(|e| SetupError::other("", e))
    }
}

/// What was found of a material of a body; `property` names what is missing where nothing was.
fn found<T>(
    body: &Body,
    material: &Material,
    property: &str,
    found: Result<Option<T>, MaterialError>,
) -> Result<T, SetupError> {
    let found = found.map_err(|e| SetupError::other("", e))?;
    found.ok_or_else(|| {
        let problem = Problem::MissingProperty {
            material: material.name().into(),
            body: body.name.clone(),
            property: property.into(),
        };
        SetupError::new("", problem)
    })
}
