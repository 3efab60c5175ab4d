//! The surface on which a boundary acts, and heat that flows through it.

use perimelt_core::body::SurfaceCell;
use perimelt_core::world::BodyIndex;
use perimelt_core::{Face, Report, Setup, SetupError, World, Write, keys};

/// All faces, the default of boundaries that act on the whole surface.
pub(crate) fn all_faces() -> Vec<Face> {
    Face::ALL.to_vec()
}

/// Cell faces of `body` without material in front of them whose outward direction is one of `faces`; with a region,
/// those of its points only.
///
/// # Errors
/// An unknown or empty region, a face across a missing dimension, no such cell face.
pub(crate) fn select(
    setup: &Setup<'_>,
    body: BodyIndex,
    faces: &[Face],
    region: Option<&str>,
) -> Result<Vec<SurfaceCell>, SetupError> {
    let dimension = setup.body(body).dimension;
    let outside = |f: &&Face| f.axis() >= dimension;
    if faces.len() < Face::ALL.len()
        && let Some(face) = faces.iter().find(outside)
    {
        return Err(SetupError::value(
            "faces",
            format!("a {dimension}D body has no face `{}`", face.name()),
            "faces within the body's dimensions",
        ));
    }
    let mut cells = setup.body(body).surface(faces);
    if let Some(name) = region {
        let points = setup.region(body, "region", name)?.points;
        cells.retain(|cell| points.binary_search(&cell.point).is_ok());
    }
    if cells.is_empty() {
        let names: Vec<_> = faces.iter().map(|f| f.name()).collect();
        let place = region.map_or_else(String::new, |r| format!(" of region `{r}`"));
        return Err(SetupError::value(
            if region.is_some() { "region" } else { "faces" },
            format!(
                "no point{place} has a bare surface towards {}",
                names.join(", ")
            ),
            "a part of the body's surface",
        ));
    }
    Ok(cells)
}

/// Heat through a surface: a flux (W/m²) becomes a source `flux * area / volume` (W/m³) of the
/// points behind it (Wang (2025), eq. 7.18).
#[derive(Debug)]
pub(crate) struct SurfaceHeat {
    cells: Vec<SurfaceCell>,
    body: BodyIndex,
    heat_source: Write<f64>,
    /// Into the body in the last step, W.
    power: f64,
}

impl SurfaceHeat {
    pub fn prepare(
        setup: &mut Setup<'_>,
        body: BodyIndex,
        faces: &[Face],
        region: Option<&str>,
    ) -> Result<SurfaceHeat, SetupError> {
        Ok(SurfaceHeat {
            cells: select(setup, body, faces, region)?,
            body,
            heat_source: setup.add(body, &keys::HEAT_SOURCE)?,
            power: 0.0,
        })
    }

    /// Through the plane of a 2D body, or of a region of it.
    pub fn through_plane(
        setup: &mut Setup<'_>,
        body: BodyIndex,
        region: Option<&str>,
    ) -> Result<SurfaceHeat, SetupError> {
        let points = match region {
            Some(name) => setup.region(body, "region", name)?.points,
            None => (0..setup.body(body).points.len() as u32).collect(),
        };
        let this = setup.body(body);
        let cells = points.into_iter().map(|point| SurfaceCell {
            point,
            face: Face::ZMax,
            area: this.points.volume[point as usize] / this.thickness,
        });
        Ok(SurfaceHeat {
            cells: cells.collect(),
            body,
            heat_source: setup.add(body, &keys::HEAT_SOURCE)?,
            power: 0.0,
        })
    }

    /// The faces of cells through which it flows.
    pub fn cells(&self) -> &[SurfaceCell] {
        &self.cells
    }

    /// Adds `flux` (W/m², into the body) of each surface point.
    pub fn add(&mut self, world: &World, flux: impl Fn(usize) -> f64) {
        let volume = &world.body(self.body).points.volume;
        let mut heat_source = world.write(self.heat_source);
        self.power = 0.0;
        for cell in &self.cells {
            let point = cell.point as usize;
            let power = flux(point) * cell.area;
            heat_source[point] += power / volume[point];
            self.power += power;
        }
    }

    /// Largest ratio of bare surface to volume of a point, 1/m.
    pub fn largest_ratio(&self, volume: &[f64]) -> f64 {
        let mut ratio = vec![0.0; volume.len()];
        for cell in &self.cells {
            ratio[cell.point as usize] += cell.area / volume[cell.point as usize];
        }
        ratio.into_iter().fold(0.0, f64::max)
    }

    pub fn report(&self) -> Vec<Report> {
        vec![Report {
            name: "power into the body".into(),
            unit: "W".into(),
            value: self.power,
        }]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{STEEL, block};
    use std::path::Path;

    #[test]
    fn a_selection_is_cut_down_to_a_region_and_never_empty() {
        let mut world = World::new(vec![block([4, 3, 2], 3, STEEL)]);
        let setup = Setup::new(&mut world, Path::new("."));
        let count = |faces: &[Face], region| {
            select(&setup, 0, faces, region)
                .map(|cells| cells.len())
                .map_err(|e| (e.key.clone(), e.to_string()))
        };
        assert_eq!(count(&Face::ALL, None), Ok(2 * (12 + 8 + 6)));
        assert_eq!(count(&[Face::ZMax], Some("left")), Ok(3));
        let (key, message) = count(&[Face::XMax], Some("left")).expect_err("no point there");
        assert_eq!(key, "region");
        assert!(message.contains("no point of region `left` has a bare surface towards x+"));
        let (key, message) = count(&[Face::XMax], Some("lef")).expect_err("misspelt");
        assert_eq!(key, "region");
        assert!(message.contains("did you mean `left`?"));
    }

    #[test]
    fn a_plate_has_no_top() {
        let mut world = World::new(vec![block([4, 3, 1], 2, STEEL)]);
        let setup = Setup::new(&mut world, Path::new("."));
        let error = select(&setup, 0, &[Face::ZMax], None).expect_err("2D");
        assert!(error.to_string().contains("a 2D body has no face `z+`"));
        assert_eq!(
            select(&setup, 0, &Face::ALL, None).expect("valid").len(),
            14
        );
    }
}
