//! The surface on which a boundary acts, and heat that flows through it.

use perimelt_core::body::SurfaceCell;
use perimelt_core::world::BodyIndex;
use perimelt_core::{ActivityChanges, Face, Report, Setup, SetupError, World, Write, keys};

/// Fraction of the time constant of an exchange of heat that a step may take.
const STEP_FRACTION: f64 = 0.5;

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
///
/// On a body on which material is deposited, the surface is that of the material which is there now: it changes with
/// each point that becomes active.
#[derive(Debug)]
pub(crate) struct SurfaceHeat {
    /// In the order of their points.
    cells: Vec<SurfaceCell>,
    faces: Vec<Face>,
    /// Points that limit the surface, ascending.
    region: Option<Vec<u32>>,
    activity: ActivityChanges,
    body: BodyIndex,
    heat_source: Write<f64>,
    /// Into the body in the last step, W.
    power: f64,
    /// Shortest time in which a point takes up the temperature of its surroundings, s, once found.
    time_constant: Option<f64>,
}

impl SurfaceHeat {
    pub fn prepare(
        setup: &mut Setup<'_>,
        body: BodyIndex,
        faces: &[Face],
        region: Option<&str>,
    ) -> Result<SurfaceHeat, SetupError> {
        // a region would be a part of the window that moves with it
        if region.is_none() {
            setup.follow_window(body);
        }
        Self::without_window(setup, body, faces, region)
    }

    /// As [`SurfaceHeat::prepare`], of a body without a moving refinement.
    pub fn without_window(
        setup: &mut Setup<'_>,
        body: BodyIndex,
        faces: &[Face],
        region: Option<&str>,
    ) -> Result<SurfaceHeat, SetupError> {
        setup.follow_activity(body);
        let message = format!(
            "the points of body `{}` move: heat through faces of cells needs points at rest",
            setup.body(body).name
        );
        let expected = "`prescribed_temperature` at a wall, a heat source, or an Eulerian or total Lagrangian body";
        setup.refuse_moving_points(body, SetupError::value("body", message, expected));
        let cells = select(setup, body, faces, region)?;
        let points = region.map(|name| setup.region(body, "region", name));
        Ok(SurfaceHeat {
            faces: faces.to_vec(),
            region: points.transpose()?.map(|region| region.points),
            ..Self::through(setup, body, cells)?
        })
    }

    fn through(
        setup: &mut Setup<'_>,
        body: BodyIndex,
        cells: Vec<SurfaceCell>,
    ) -> Result<SurfaceHeat, SetupError> {
        Ok(SurfaceHeat {
            cells,
            faces: Vec::new(),
            region: None,
            activity: ActivityChanges::default(),
            body,
            heat_source: setup.add(body, &keys::HEAT_SOURCE)?,
            power: 0.0,
            time_constant: None,
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
            face_area: this.points.volume[point as usize] / this.thickness,
            area: this.points.volume[point as usize] / this.thickness,
        });
        let cells = cells.collect();
        Self::through(setup, body, cells)
    }

    /// The faces of cells through which it flows.
    pub fn cells(&self) -> &[SurfaceCell] {
        &self.cells
    }

    /// Finds the bare cell faces around points that became active or inactive; whether there are any.
    pub fn follow(&mut self, world: &World) -> bool {
        let Some(changed) = self.activity.since_last(world, self.body) else {
            return false;
        };
        let body = world.body(self.body);
        let neighbours = |&point: &u32| {
            let next = move |face| body.neighbour(point as usize, face).map(|p| p as u32);
            Face::ALL.into_iter().filter_map(next).chain([point])
        };
        let mut points: Vec<u32> = changed.iter().flat_map(neighbours).collect();
        points.sort_unstable();
        points.dedup();
        let is_changed = |cell: &SurfaceCell| points.binary_search(&cell.point).is_ok();
        self.cells.retain(|cell| !is_changed(cell));
        let region = self.region.as_ref();
        let here = points.iter().copied();
        let here = here.filter(|p| region.is_none_or(|r| r.binary_search(p).is_ok()));
        let here = here.map(|point| point as usize);
        let active = |point: usize| self.activity.is_active(point);
        self.cells
            .extend(body.surface_of(here, &self.faces, active));
        // faces of a point stay in the order of `faces`
        self.cells.sort_by_key(|cell| cell.point);
        true
    }

    /// Adds `flux` (W/m², into the body) of each surface point.
    pub fn add(&mut self, world: &World, flux: impl Fn(usize) -> f64) {
        self.follow(world);
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

    /// Largest ratio of bare surface to volume of a point, 1/m; where material is deposited, as if all faces were bare.
    pub fn largest_ratio(&self, world: &World) -> f64 {
        let points = &world.body(self.body).points;
        if world.is_growing(self.body) {
            let spacings = points.spacing.iter().copied();
            return self.faces.len() as f64 / spacings.fold(f64::INFINITY, f64::min);
        }
        let volume = &points.volume;
        let mut ratio = vec![0.0; volume.len()];
        for cell in &self.cells {
            ratio[cell.point as usize] += cell.area / volume[cell.point as usize];
        }
        ratio.into_iter().fold(0.0, f64::max)
    }

    /// Largest stable step of an exchange, s: the shortest time in which a point takes up the temperature of its
    /// surroundings, by the largest coefficient (W/(m² K)) and the smallest capacity (J/(m³ K)).
    pub fn stable_step(
        &mut self,
        world: &World,
        largest: f64,
        capacity: Option<f64>,
    ) -> Option<f64> {
        let exchange = largest * self.largest_ratio(world);
        self.time_constant = capacity.filter(|_| exchange > 0.0).map(|c| c / exchange);
        self.time_constant
    }

    /// Largest step that resolves the exchange, s, once its stable step was asked.
    pub fn step_limit(&self) -> Option<f64> {
        self.time_constant.map(|time| STEP_FRACTION * time)
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

    #[test]
    fn the_surface_is_that_of_the_material_that_is_there() {
        let mut world = World::new(vec![block([3, 3, 4], 3, STEEL)]);
        let mut setup = Setup::new(&mut world, Path::new("."));
        setup.next_plugin("heat");
        let faces = [Face::ZMax, Face::XMin];
        let mut surface = SurfaceHeat::prepare(&mut setup, 0, &faces, None).expect("valid");
        setup.next_plugin("deposit");
        let upper: Vec<u32> = (18..36).collect();
        let active = setup.deposit(0, &upper).expect("a lattice");
        setup.next_plugin("thermal");
        setup.consume(0, &keys::HEAT_SOURCE).expect("free");
        setup.follow_activity(0);
        setup.finish().expect("complete");
        let mut heat = |expected: f64| {
            surface.add(&world, |_| 1.0);
            assert_eq!(surface.power, expected);
        };
        // two layers of nine cells: the top, and three cells of the side each
        heat(9.0 + 6.0);
        // a point in the middle, one beside it at the side, and one above that: the top stays as large
        for (point, expected) in [(22, 16.0), (21, 16.0), (30, 17.0)] {
            world.write(active)[point] = 1.0;
            heat(expected);
        }
        world.write(active).fill(1.0);
        heat(9.0 + 12.0);
        assert_eq!(surface.largest_ratio(&world), 2.0);
    }
}
