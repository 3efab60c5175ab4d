//! What the case says: bodies, regions, materials, values by place.

use std::path::PathBuf;

use nalgebra::Vector3;

use super::Setup;
use crate::body::{Body, Cut, Region};
use crate::error::{Problem, SetupError};
use crate::in_space::{InSpace, Placed};
use crate::world::{BodyIndex, World};

/// A value of a key that may depend on position and time.
#[derive(Clone, Copy, Debug)]
pub struct GivenValue<'a> {
    /// The key, for messages.
    pub key: &'a str,
    /// Its value.
    pub value: &'a InSpace,
    /// Name of the column of a file that has the values; a file with one column may call it otherwise.
    pub column: &'a str,
}

impl Setup<'_> {
    /// The world as it is so far: what plugins before the calling one declared and published.
    pub fn world(&self) -> &World {
        self.world
    }

    /// A path of the case file, relative to the file's folder.
    pub fn path(&self, path: &str) -> PathBuf {
        self.folder.join(path)
    }

    /// A value that the case gives, at positions (m) of a body, computed for the start.
    ///
    /// # Errors
    /// A file that cannot be read or whose points lie elsewhere, or a value that is not finite.
    pub fn placed(
        &mut self,
        body: BodyIndex,
        given: GivenValue<'_>,
        positions: Vec<Vector3<f64>>,
    ) -> Result<Placed, SetupError> {
        let GivenValue { key, value, column } = given;
        let dimension = self.body(body).dimension;
        let placed = value.at(column, &self.folder, positions, dimension);
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
        self.world.find_body(name)
    }

    /// A body.
    pub fn body(&self, index: BodyIndex) -> &Body {
        &self.world.bodies[index]
    }

    /// The region called `name` of a body.
    ///
    /// # Errors
    /// When there is none of that name, or it holds no point of the whole body; blamed on `key`. Collective.
    pub fn region(&self, body: BodyIndex, key: &str, name: &str) -> Result<Region, SetupError> {
        let region = self.world.region(body, key, name)?;
        let body = self.body(body);
        // the part of the body that a process has may have none of them
        if !self.world.processes().any(!region.points.is_empty()) {
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

    /// Cuts a body: no family obtained from now on has bonds across `cut`. Called by crack
    /// couplers, which are prepared before all physics.
    pub fn cut(&mut self, body: BodyIndex, cut: Cut) {
        self.world.bodies[body].sever(cut);
    }
}
