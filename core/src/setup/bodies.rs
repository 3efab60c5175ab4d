//! What the case says: bodies, regions, materials, values by place.

use std::path::PathBuf;

use nalgebra::Vector3;

use super::Setup;
use crate::body::{Body, Cut, Region};
use crate::error::{Problem, SetupError};
use crate::in_space::{InSpace, Placed};
use crate::material::{Expansion, Material, MaterialError, Property};
use crate::world::{BodyIndex, World};

impl Setup<'_> {
    /// The world as it is so far: what plugins before the calling one declared and published.
    pub fn world(&self) -> &World {
        self.world
    }

    /// A path of the case file, relative to the file's folder.
    pub fn path(&self, path: &str) -> PathBuf {
        self.folder.join(path)
    }

    /// The values of the key `key` at positions (m) of a body, those at the start computed. A file has a column with the name of
    /// the `field`, or only one.
    ///
    /// # Errors
    /// A file that cannot be read or whose points lie elsewhere, or a value that is not finite.
    pub fn placed(
        &mut self,
        (body, field): (BodyIndex, &str),
        key: &str,
        value: &InSpace,
        positions: Vec<Vector3<f64>>,
    ) -> Result<Placed, SetupError> {
        let dimension = self.body(body).dimension;
        let placed = value.at((field, &self.folder), positions, dimension);
        let mut placed = placed.map_err(|e| SetupError::other(key, e))?;
        placed.at(0.0).map_err(|e| SetupError::other(key, e))?;
        if let Some(warning) = placed.warning() {
            self.warn(format!("`{key}`: {warning}"));
        }
        Ok(placed)
    }

    /// The body called `name`, or the only one.
    ///
    /// # Errors
    /// When there is none of that name, or several and no name.
    pub fn find_body(&self, name: Option<&str>) -> Result<BodyIndex, SetupError> {
        let names = || {
            self.world
                .bodies
                .iter()
                .map(|b| b.name.clone())
                .collect::<Vec<_>>()
        };
        match name {
            Some(name) => self
                .world
                .bodies
                .iter()
                .position(|b| b.name == name)
                .ok_or_else(|| {
                    let problem = Problem::UnknownName {
                        what: "body",
                        name: name.into(),
                        known: names(),
                    };
                    SetupError::new("body", problem)
                }),
            None if self.world.bodies.len() == 1 => Ok(0),
            None => Err(SetupError::new("body", Problem::WhichBody(names()))),
        }
    }

    /// A body.
    pub fn body(&self, index: BodyIndex) -> &Body {
        &self.world.bodies[index]
    }

    /// The region called `name` of a body.
    ///
    /// # Errors
    /// When there is none of that name, or it holds no point; blamed on `key`.
    pub fn region(&self, body: BodyIndex, key: &str, name: &str) -> Result<Region, SetupError> {
        let body = self.body(body);
        let region = body.regions.get(name).ok_or_else(|| {
            let known = body.regions.keys().cloned().collect();
            SetupError::new(
                key,
                Problem::UnknownName {
                    what: "region",
                    name: name.into(),
                    known,
                },
            )
        })?;
        if region.points.is_empty() {
            let (from, to) = body.bounds();
            let problem = Problem::EmptyRegion {
                region: name.into(),
                body: body.name.clone(),
                from: from.into(),
                to: to.into(),
                spacing: body.finest_spacing(),
            };
            return Err(SetupError::new(key, problem));
        }
        Ok(region.clone())
    }

    /// The property `name` of each material of a body.
    ///
    /// # Errors
    /// When a material lacks it.
    pub fn property(&self, body: BodyIndex, name: &str) -> Result<Vec<Property>, SetupError> {
        self.of_materials(body, name, |m| Ok(m.get(name).cloned()))
    }

    /// The thermal expansion of each material of a body.
    ///
    /// # Errors
    /// When a material states none.
    pub fn expansions(&self, body: BodyIndex) -> Result<Vec<Expansion>, SetupError> {
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
        let missing = |material: &Material| {
            let problem = Problem::MissingProperty {
                material: material.name().into(),
                body: body.name.clone(),
                property: property.into(),
            };
            SetupError::new("", problem)
        };
        let materials = body.materials.iter().map(|material| {
            let found = of(material).map_err(|e| SetupError::other("", e))?;
            found.ok_or_else(|| missing(material))
        });
        materials.collect()
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

    /// [`Setup::reference_densities`] for each point of the body, kg/m³.
    ///
    /// # Errors
    /// As [`Setup::reference_densities`].
    pub fn density_at_points(&self, body: BodyIndex) -> Result<Vec<f64>, SetupError> {
        let by_material = self.reference_densities(body)?;
        let materials = self.body(body).material_of_point.iter();
        Ok(materials.map(|&m| by_material[m as usize]).collect())
    }

    /// Cuts a body: no family obtained from now on has bonds across `cut`. Called by crack
    /// couplers, which are prepared before all physics.
    pub fn cut(&mut self, body: BodyIndex, cut: Cut) {
        self.world.bodies[body].cuts.push(cut);
    }
}
