//! Bodies and materials of a case.

use perimelt_core::body::{BodyError, ZoneError};
use perimelt_core::error::nearest;
use perimelt_core::material::Material;
use perimelt_core::shape::Shape;
use perimelt_core::{Body, Explanation, Problem, input, keys};

use super::error::{CaseError, Mistake, Mistakes};
use super::sections::BodySection;
use super::{Case, Result};
use crate::library;

impl Case {
    /// Fills all bodies with points, their regions and materials.
    pub(super) fn fill_bodies(&self) -> Result<Vec<Body>, CaseError> {
        let mut mistakes = Mistakes::default();
        let filled = self
            .bodies
            .iter()
            .map(|(name, section)| self.fill(name, section));
        let filled = filled.filter_map(|body| mistakes.collect(body)).collect();
        mistakes.finish(filled)
    }

    fn fill(&self, name: &str, section: &BodySection) -> Result<Body> {
        if name.is_empty() || name == "probes" || name.contains('/') {
            return Err(self.body_error(
                &[name],
                format!("a body cannot be called `{name}`"),
                "a name without `/` other than `probes`: it becomes a topic of the log",
            ));
        }
        let thickness = match section.dimension {
            1 => section.cross_section,
            _ => section.thickness,
        };
        self.check_layup(name, section)?;
        let filled = self.points(name, section, thickness)?;
        let filled = filled.and_then(|body| {
            let mut body = match section.jitter {
                Some(jitter) => body.jittered(jitter)?,
                None => body,
            };
            body.repeat(&section.periodic)?;
            if let Some(tank) = &section.tank {
                body.enclose(tank.min.into(), tank.max.into())?;
            }
            Ok(body)
        });
        let mut body = filled.map_err(|e| {
            let zone = match &e {
                BodyError::Zone { number, .. } => number.to_string(),
                _ => String::new(),
            };
            let expected = match &e {
                BodyError::Layup(e) => e.expected(),
                _ => String::new(),
            };
            let key: &[&str] = match &e {
                BodyError::Layup(e) => &["layup", e.key()],
                BodyError::NotPositive {
                    key: "ply_thickness",
                    ..
                } => &["layup", "ply_thickness"],
                BodyError::NotPositive {
                    key: "thickness", ..
                } if section.dimension == 1 => &["cross_section"],
                BodyError::NotPositive { key, .. } => &[key],
                BodyError::Dimension(_) => &["dimension"],
                BodyError::NoPoints { .. } | BodyError::TooManyPoints(_) => &["spacing"],
                BodyError::Zone {
                    mistake: ZoneError::Spacing(_),
                    ..
                } => &["zones", &zone, "spacing"],
                BodyError::Zone { .. } => &["zones", &zone],
                BodyError::NotCovered { .. } => &["zones"],
                BodyError::Jitter(_) => &["jitter", "amplitude"],
                BodyError::Repeated { .. } | BodyError::RepeatedTwice { .. } => &["periodic"],
                BodyError::Tank { .. } => &["tank"],
                BodyError::Table(_) => &["points"],
                BodyError::Unbounded | BodyError::Shape(_) => &["shape"],
            };
            self.body_error(&[&[name], key].concat(), e.to_string(), &expected)
        })?;
        body.store = section.store;
        self.fill_regions(name, section, &mut body)?;
        self.assign_materials(name, section, &mut body)?;
        Ok(body)
    }

    /// Adds the regions of a body.
    fn fill_regions(&self, name: &str, section: &BodySection, body: &mut Body) -> Result<()> {
        for (region, shape) in &section.regions {
            let shape = self.loaded(&[name, "regions", region], shape)?;
            if let Some(mistake) = shape.mistake() {
                return Err(self.body_error(&[name, "regions", region], mistake, ""));
            }
            let points = body.points_in(&shape);
            if points.points.is_empty() {
                let (from, to) = body.bounds();
                let problem = Problem::EmptyRegion {
                    region: region.clone(),
                    body: name.to_string(),
                    from: from.into(),
                    to: to.into(),
                    spacing: body.finest_spacing(),
                };
                return Err(self.body_error(
                    &[name, "regions", region],
                    problem.to_string(),
                    "contains no point",
                ));
            }
            body.regions.insert(region.clone(), points);
        }
        Ok(())
    }

    /// A shape with the files that it names.
    pub(super) fn loaded(&self, path: &[&str], shape: &Shape) -> Result<Shape> {
        let mut shape = shape.clone();
        shape
            .load(&self.folder)
            .map_err(|e| self.body_error(path, e.to_string(), ""))?;
        Ok(shape)
    }

    /// The points of a body, from whichever of `spacing`, `zones` and `points` is given.
    fn points(
        &self,
        name: &str,
        section: &BodySection,
        thickness: f64,
    ) -> Result<std::result::Result<Body, BodyError>> {
        let (shape, dimension) = (
            &self.loaded(&[name, "shape"], &section.shape)?,
            section.dimension,
        );
        let zones = (!section.zones.is_empty()).then_some(&section.zones);
        self.check_memory(name, section, shape)?;
        match (section.spacing, zones, &section.points) {
            (Some(spacing), None, None) if let Some(layup) = &section.layup => {
                Ok(Body::stack(name, shape, spacing, layup))
            }
            (Some(spacing), None, None) => {
                Ok(Body::fill(name, shape, dimension, spacing, thickness))
            }
            (None, Some(zones), None) => {
                Ok(Body::fill_zones(name, shape, dimension, thickness, zones))
            }
            (None, None, Some(path)) => {
                let text = input::read_text(&self.folder.join(path), input::LIMIT);
                let text = text.map_err(|e| {
                    let message = format!("cannot read {}: {e}", path.display());
                    self.body_error(&[name, "points"], message, "a table of points")
                })?;
                Ok(Body::from_table(name, shape, dimension, thickness, &text))
            }
            (None, None, None) => Err(self.body_error(
                &[name],
                "the body has no points",
                "needs `spacing`, or `zones`, or `points`",
            )),
            (spacing, zones, _) => {
                let second = match (spacing, zones) {
                    (Some(_), Some(_)) => "zones",
                    _ => "points",
                };
                let message = "the body has more than one of `spacing`, `zones` and `points`";
                let expected = "either `spacing`, or `zones`, or `points`";
                Err(self.body_error(&[name, second], message, expected))
            }
        }
    }

    /// Refuses what does not go together with the layers of a lay-up.
    fn check_layup(&self, name: &str, section: &BodySection) -> Result<()> {
        if section.layup.is_none() {
            return Ok(());
        }
        for (key, is_given, expected) in [
            ("dimension", section.dimension != 3, "`dimension = 3`"),
            ("zones", !section.zones.is_empty(), "`spacing`"),
            ("points", section.points.is_some(), "`spacing`"),
            ("jitter", section.jitter.is_some(), "no `jitter`"),
            ("tank", section.tank.is_some(), "no `tank`"),
        ] {
            if is_given {
                let message = format!("body `{name}` has a `layup`, which needs {expected}");
                return Err(self.body_error(&[name, key], message, expected));
            }
        }
        let key = keys::ORIENTATION;
        let orientation: &str = &key.name;
        if section.initial.contains_key(orientation) {
            let message = format!("the `layup` of body `{name}` has the angles of its plies");
            let path = [name, "initial", orientation];
            return Err(self.body_error(&path, message, "no initial `orientation`"));
        }
        Ok(())
    }

    /// The materials that the section of a body names, its own first; none for an unknown body.
    ///
    /// # Errors
    /// A material that is neither in the case nor in the library.
    pub fn materials_of(&self, body: &str) -> Result<Vec<Material>, CaseError> {
        let Some((_, section)) = self.bodies.iter().find(|(name, _)| name == body) else {
            return Ok(Vec::new());
        };
        std::iter::once(&section.material)
            .chain(section.materials.values())
            .map(|name| Ok(self.material(&[body, "material"], name)?))
            .collect()
    }

    fn assign_materials(&self, name: &str, section: &BodySection, body: &mut Body) -> Result<()> {
        body.materials
            .push(self.material(&[name, "material"], &section.material)?);
        for (region, material) in &section.materials {
            let key = [name, "materials", region];
            let Some(points) = body.regions.get(region) else {
                return Err(self.unknown_region(&key, region, section));
            };
            let known = body.materials.iter().position(|m| m.name() == material);
            let index = match known {
                Some(index) => index,
                None => {
                    body.materials.push(self.material(&key, material)?);
                    body.materials.len() - 1
                }
            } as u16;
            for &point in &points.points {
                let of_point = &mut body.material_of_point[point as usize];
                if *of_point != 0 && *of_point != index {
                    let other = body.materials[*of_point as usize].name();
                    let message = format!(
                        "region `{region}` overlaps with another region of material `{other}`"
                    );
                    return Err(self.body_error(
                        &key,
                        message,
                        "expected regions that do not overlap",
                    ));
                }
                *of_point = index;
            }
        }
        Ok(())
    }

    /// The material called `material`, for the key at `path` below `bodies`.
    fn material(&self, path: &[&str], material: &str) -> Result<Material> {
        let Some(section) = self.materials.get(material) else {
            return library::find(material).ok_or_else(|| {
                let sections: Vec<&str> = self.materials.keys().map(String::as_str).collect();
                let known = [sections, library::names().collect()].concat();
                let message = format!("no material is called `{material}`");
                let error = self.body_error(path, message, "no such material");
                suggest(error, material, &known)
            });
        };
        let header = self.place(&["materials", material]).unwrap_or(0..0);
        let base = match &section.library {
            None => None,
            Some(entry) => Some(library::find(entry).ok_or_else(|| {
                let span = self
                    .place(&["materials", material, "library"])
                    .unwrap_or(0..0);
                let message = format!("the library has no material `{entry}`");
                let error = Mistake::new(&self.file, message, span)
                    .expected("no such entry")
                    .within(header.clone(), format!("in [materials.{material}]"));
                suggest(error, entry, &library::names().collect::<Vec<_>>())
            })?),
        };
        Material::new(material, section.clone(), base.as_ref())
            .map_err(|e| Mistake::explained(&self.file, e.explain(), header))
    }

    /// A mistake at a key below `bodies`.
    pub(super) fn body_error(
        &self,
        path: &[&str],
        message: impl Into<String>,
        expected: &str,
    ) -> Box<Mistake> {
        let words = Explanation::new(message);
        self.explained_body_error(path, words).expected(expected)
    }

    /// A mistake at a key below `bodies`, in words.
    pub(super) fn explained_body_error(&self, path: &[&str], words: Explanation) -> Box<Mistake> {
        let mut whole = vec!["bodies"];
        whole.extend(path);
        let header = self.place(&whole[..2]).unwrap_or(0..0);
        let span = self.place(&whole).unwrap_or(header.clone());
        let error = Mistake::explained(&self.file, words, span);
        error.within(header, format!("in [bodies.{}]", path[0]))
    }

    /// A mistake in the name of a key below `bodies`.
    pub(super) fn body_key_error(
        &self,
        path: &[&str],
        message: impl Into<String>,
        expected: &str,
    ) -> Box<Mistake> {
        let mut error = self.body_error(path, message, expected);
        let whole = [&["bodies"], path].concat();
        if let Some(place) = self.places().find(&whole) {
            error.span = Some(place.key);
        }
        error
    }

    pub(super) fn unknown_region(
        &self,
        path: &[&str],
        region: &str,
        section: &BodySection,
    ) -> Box<Mistake> {
        let known: Vec<&str> = section.regions.keys().map(String::as_str).collect();
        let error = self.body_key_error(
            path,
            format!("no region is called `{region}`"),
            "no such region",
        );
        suggest(error, region, &known)
    }
}

/// Adds the nearest of the known names, and all of them.
pub(super) fn suggest(error: Box<Mistake>, name: &str, known: &[&str]) -> Box<Mistake> {
    let error = match nearest(name, known.iter().copied()) {
        Some(close) => error.expected(format!("did you mean `{close}`?")),
        None => error,
    };
    if known.is_empty() {
        error.help("the list of known names is empty")
    } else {
        error.help(format!("known here: {}", known.join(", ")))
    }
}
