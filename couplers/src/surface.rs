//! The surface on which a boundary acts, and heat that flows through it.

use std::cell::{Ref, RefCell, RefMut};
use std::rc::Rc;

use perimelt_core::body::SurfaceCell;
use perimelt_core::numbers::check_distinct;
use perimelt_core::world::BodyIndex;
use perimelt_core::world::exchange::{Exchange, FreeFaces, NewExchange, SurfaceDepth, SurfaceLaw};
use perimelt_core::world::surrounding_body::{NewSurroundingBody, SurroundingBody};
use perimelt_core::{
    ActivityChanges, Change, Face, FactRule, Report, Setup, SetupError, World, keys, shared_keys,
};

/// All faces, the default of boundaries that act on the whole surface.
pub(crate) fn all_faces() -> Vec<Face> {
    Face::ALL.to_vec()
}

shared_keys! {
    /// The body on which a coupler acts.
    #[derive(Clone, Debug, PartialEq)]
    pub struct OnBody {
        /// Body; may be left out when there is one only.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub body: Option<String>,
    }
}

shared_keys! {
    /// The part of the surface of a body on which a boundary acts.
    #[derive(Clone, Debug, PartialEq)]
    pub struct OnSurface {
        /// Body; may be left out when there is one only.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub body: Option<String>,
        /// Region that limits the surface.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub region: Option<String>,
    }
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
    check_distinct("faces", faces)?;
    let mut cells = setup.body(body).surface(faces);
    if let Some(name) = region {
        let points = setup.region(body, "region", name)?.points;
        cells.retain(|cell| points.binary_search(&cell.point).is_ok());
    }
    if !setup.world().processes().any(!cells.is_empty()) {
        let names: Vec<_> = faces.iter().map(|f| f.name()).collect();
        let place = region.map_or_else(String::new, |r| format!(" of region `{r}`"));
        return Err(SetupError::value(
            if region.is_some() { "region" } else { "faces" },
            format!(
                "no point{place} has a free surface in direction {}",
                names.join(", ")
            ),
            "a part of the body's surface",
        ));
    }
    Ok(cells)
}

/// Where a boundary exchanges heat, and with which body, if the surroundings are one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SurfacePlace<'a> {
    pub faces: &'a [Face],
    pub region: Option<&'a str>,
    pub around: Option<NewSurroundingBody>,
}

impl<'a> SurfacePlace<'a> {
    /// Without a body around it.
    pub fn new(faces: &'a [Face], region: Option<&'a str>) -> Self {
        SurfacePlace {
            faces,
            region,
            around: None,
        }
    }
}

/// The surface through which a boundary exchanges heat by a law, which the physics of the body evaluates.
///
/// Where material is deposited, the surface changes with each point that becomes active.
#[derive(Debug)]
pub(crate) struct SurfaceHeat<L> {
    law: Rc<RefCell<L>>,
    exchange: Rc<Exchange>,
    faces: Vec<Face>,
    /// Points that limit the surface, ascending.
    region: Option<Vec<u32>>,
    activity: ActivityChanges,
    /// Bare faces, once the surface has changed.
    free: Option<FreeFaces>,
}

/// The mistake of a boundary on a body without physics that evaluates its law.
const NO_EXCHANGE: FactRule = FactRule {
    key: "body",
    message: "no physics of body `{body}` exchanges heat through surfaces",
    expected: "a physics `thermal` of that body",
};

impl<L: SurfaceLaw + 'static> SurfaceHeat<L> {
    pub fn prepare(
        setup: &mut Setup<'_>,
        body: BodyIndex,
        place: SurfacePlace<'_>,
        law: L,
    ) -> Result<SurfaceHeat<L>, SetupError> {
        let SurfacePlace {
            faces,
            region,
            around,
        } = place;
        if let Some(region) = region {
            let message = format!("region `{region}` would move with the window of finer points");
            let error = SetupError::value(
                "region",
                message,
                "no `region`, or the body with the coarser points",
            );
            setup.refuse(body, Change::Window, error)?;
        }
        let cells = select(setup, body, faces, region)?;
        let points = region.map(|name| setup.region(body, "region", name));
        Ok(SurfaceHeat {
            faces: faces.to_vec(),
            region: points.transpose()?.map(|region| region.points),
            ..Self::through(setup, body, law, |law| NewExchange {
                depth: SurfaceDepth::Face,
                law,
                cells,
                around,
                unread: NO_EXCHANGE,
            })?
        })
    }

    fn through(
        setup: &mut Setup<'_>,
        body: BodyIndex,
        law: L,
        new: impl FnOnce(Rc<RefCell<L>>) -> NewExchange,
    ) -> Result<SurfaceHeat<L>, SetupError> {
        let law = Rc::new(RefCell::new(law));
        Ok(SurfaceHeat {
            exchange: setup.exchange(body, &keys::TEMPERATURE, new(law.clone()))?,
            law,
            faces: Vec::new(),
            region: None,
            activity: ActivityChanges::default(),
            free: None,
        })
    }

    /// Exchange through the plane of a 2D body, or of a region of it.
    pub fn through_plane(
        setup: &mut Setup<'_>,
        body: BodyIndex,
        region: Option<&str>,
        law: L,
    ) -> Result<SurfaceHeat<L>, SetupError> {
        let points = match region {
            Some(name) => setup.region(body, "region", name)?.points,
            None => (0..setup.body(body).points.len() as u32).collect(),
        };
        let this = setup.body(body);
        let cell = |point: u32| {
            let area = this.points.volume[point as usize] / this.thickness;
            SurfaceCell {
                point,
                face: Face::ZMax,
                face_area: area,
                area,
                step_of: None,
            }
        };
        let cells = points.into_iter().map(cell).collect();
        Self::through(setup, body, law, |law| NewExchange {
            depth: SurfaceDepth::Plane,
            law,
            cells,
            around: None,
            unread: NO_EXCHANGE,
        })
    }

    /// The law, for updates.
    pub fn law(&self) -> RefMut<'_, L> {
        self.law.borrow_mut()
    }

    /// The body around the surface, where there is one.
    pub fn around(&self) -> Option<&SurroundingBody> {
        self.exchange.around.as_ref()
    }

    /// The faces of cells through which heat flows.
    pub fn cells(&self) -> Ref<'_, [SurfaceCell]> {
        self.exchange.cells()
    }

    /// Number of changes of the faces.
    pub fn version(&self) -> u64 {
        self.exchange.version()
    }

    /// Finds the bare cell faces around points that became active or inactive.
    pub fn follow(&mut self, world: &World) {
        let index = self.exchange.body;
        let Some(changed) = self.activity.since_last(world, index) else {
            return;
        };
        let body = world.body(index);
        let neighbours = |&point: &u32| {
            let next = move |face| body.neighbour(point as usize, face).map(|p| p as u32);
            Face::ALL.into_iter().filter_map(next).chain([point])
        };
        let mut points: Vec<u32> = changed.iter().flat_map(neighbours).collect();
        points.sort_unstable();
        points.dedup();
        let is_changed = |cell: &SurfaceCell| points.binary_search(&cell.point).is_ok();
        let mut cells = self.exchange.cells().to_vec();
        cells.retain(|cell| !is_changed(cell));
        let region = self.region.as_ref();
        let here = points.iter().copied();
        let here = here.filter(|p| region.is_none_or(|r| r.binary_search(p).is_ok()));
        let here = here.map(|point| point as usize);
        let active = |point: usize| self.activity.is_active(point);
        let free = self.free.get_or_insert_with(|| {
            let free = FreeFaces::new(world, index, &keys::TEMPERATURE.name);
            free.reached_from(self.exchange.around.as_ref())
        });
        let bare = body.surface_of(here, &self.faces, active).into_iter();
        cells.extend(bare.filter_map(|cell| free.free_cell(world, body, &cell).0));
        // faces of a point stay in the order of `faces`
        cells.sort_by_key(|cell| cell.point);
        self.exchange.set_cells(world, cells);
    }

    pub fn report(&self) -> Vec<Report> {
        let power = self.exchange.power();
        vec![Report::new("power into the body", "W", power)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::boundary::PrescribedFlux;
    use crate::testing::{STEEL, block, disc_in_plate};
    use perimelt_core::LayerRole;
    use perimelt_core::body::{Layup, Stations};
    use perimelt_core::shape::{BoxShape, Shape};
    use perimelt_core::world::SymmetryPlane;
    use perimelt_core::{Body, keys};
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
        assert!(message.contains("no point of region `left` has a free surface in direction x+"));
        let twice = [Face::XMax, Face::ZMax, Face::XMax];
        let (key, message) = count(&twice, None).expect_err("the heat would count twice");
        assert_eq!(key, "faces");
        assert!(message.contains("face `x+` is given twice"), "{message}");
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
        let law = PrescribedFlux(1.0);
        let surface = SurfaceHeat::prepare(&mut setup, 0, SurfacePlace::new(&faces, None), law);
        let mut surface = surface.expect("valid");
        setup.next_plugin("deposit");
        let upper: Vec<u32> = (18..36).collect();
        let active = setup
            .change_material(0, perimelt_core::Change::Births, &upper)
            .expect("a lattice");
        setup.next_plugin("thermal");
        setup.own(0, &keys::TEMPERATURE).expect("free");
        assert_eq!(setup.facts::<Rc<Exchange>>(0).count(), 1);
        setup.finish().expect("complete");
        let mut area = |expected: f64| {
            surface.follow(&world);
            let cells = surface.cells();
            assert_eq!(cells.iter().map(|c| c.area).sum::<f64>(), expected);
        };
        // two layers of nine cells: the top, and three cells of the side each
        area(9.0 + 6.0);
        // a point in the middle, one beside it at the side, and one above that: the top stays as large
        for (point, expected) in [(22, 16.0), (21, 16.0), (30, 17.0)] {
            world.write(active)[point] = 1.0;
            area(expected);
        }
        world.write(active).fill(1.0);
        area(9.0 + 12.0);
    }

    /// Area that is left of a block of 4 x 3 x 2 cells.
    fn free_area(
        others: Vec<Body>,
        boundaries: impl FnOnce(&mut Setup<'_>),
    ) -> Result<f64, String> {
        let mut bodies = vec![block([4, 3, 2], 3, STEEL)];
        bodies.extend(others);
        free_area_of(bodies, boundaries)
    }

    /// Area that is left of the first body.
    fn free_area_of(
        bodies: Vec<Body>,
        boundaries: impl FnOnce(&mut Setup<'_>),
    ) -> Result<f64, String> {
        let mut world = World::new(bodies);
        let mut setup = Setup::new(&mut world, Path::new("."));
        setup.next_plugin("heat");
        let law = PrescribedFlux(1.0);
        let surface = SurfaceHeat::prepare(&mut setup, 0, SurfacePlace::new(&Face::ALL, None), law);
        boundaries(&mut setup);
        setup.next_plugin("thermal");
        setup.own(0, &keys::TEMPERATURE).expect("free");
        assert_eq!(setup.facts::<Rc<Exchange>>(0).count(), 1);
        setup
            .finish()
            .map_err(|mistakes| mistakes[0].1.to_string())?;
        let cells = surface.expect("valid");
        Ok(cells.cells().iter().map(|c| c.area).sum())
    }

    /// Also where the steps of the cells do not meet.
    #[test]
    fn a_body_in_a_hole_covers_its_wall() {
        for (spacings, offset) in [
            ([0.05, 0.05], 0.0),
            ([0.05, 0.025], 0.02),
            ([0.025, 0.05], 0.013),
        ] {
            let bodies: Vec<Body> = disc_in_plate(spacings, offset).into();
            let outside = 4.0 * (2.0 + offset);
            let free = free_area_of(bodies.clone(), |_| ()).expect("its outside");
            assert!((free / outside - 1.0).abs() < 0.02, "{spacings:?}: {free}");
            let [plate, disc] = disc_in_plate(spacings, offset);
            let of_disc = free_area_of(vec![disc, plate], |_| ());
            // single faces may be left
            let free = of_disc.unwrap_or(0.0);
            assert!(free < 0.02 * std::f64::consts::PI, "{spacings:?}: {free}");
        }
    }

    /// A block of which a third stands over the edge of a laminate of 6 x 6 x 1 m, on its upper side, and one against an edge of its plies.
    #[test]
    fn bodies_cover_sides_and_edges_of_laminates() {
        let of = |low: [f64; 3], high: [f64; 3]| {
            Shape::Box(BoxShape {
                min: low,
                max: high,
            })
        };
        let layup = Layup {
            angles: vec![0.0, 90.0],
            ply_thickness: vec![0.25, 0.75],
            stations: Stations::Two,
        };
        let plate = of([0.0; 3], [6.0, 6.0, 1.0]);
        let mut plate = Body::stack("plate", &plate, 1.0, &layup).expect("valid");
        plate.materials = block([1, 1, 1], 3, STEEL).materials;
        let whole = 2.0 * 36.0 + 24.0;
        assert_eq!(free_area_of(vec![plate.clone()], |_| ()), Ok(whole));
        for (low, high, covered) in [
            ([4.0, 1.0, 1.0], [7.0, 3.0, 2.0], 4.0),
            ([6.0, 1.5, 0.0], [7.0, 3.5, 0.5], 1.0),
            ([6.0, 1.5, 0.25], [7.0, 3.5, 1.75], 1.5),
        ] {
            let mut other = Body::fill("other", &of(low, high), 3, 0.25, 1.0).expect("valid");
            other.materials = plate.materials.clone();
            let free = free_area_of(vec![plate.clone(), other], |_| ()).expect("free faces");
            assert!((free - (whole - covered)).abs() < 1e-9, "{low:?}: {free}");
        }
    }

    #[test]
    fn heat_leaves_through_free_faces_only() {
        let whole = 2.0 * (12.0 + 8.0 + 6.0);
        assert_eq!(free_area(Vec::new(), |_| ()), Ok(whole));
        let symmetry = |setup: &mut Setup<'_>| {
            setup.next_plugin("symmetry");
            setup.publish(0, SymmetryPlane(Face::YMin)).expect("free");
        };
        assert_eq!(free_area(Vec::new(), symmetry), Ok(whole - 8.0));
        let prescribed = |setup: &mut Setup<'_>| {
            setup.next_plugin("prescribed_temperature");
            let layer = setup.layer(0, &keys::TEMPERATURE, Face::XMax, LayerRole::Prescribed);
            layer.expect("free");
        };
        assert_eq!(free_area(Vec::new(), prescribed), Ok(whole - 6.0));
        // on top, moved by one and a half cells, half of them over the edge
        let mut other = block([4, 3, 1], 3, STEEL);
        other.name = "other".into();
        let offset = nalgebra::Vector3::new(1.5, 0.0, 2.0);
        other.points.position.iter_mut().for_each(|x| *x += offset);
        let covered = free_area(vec![other], |_| ()).expect("free faces are left");
        assert!((covered - (whole - 2.5 * 3.0)).abs() < 1e-12, "{covered}");
        let all = |setup: &mut Setup<'_>| {
            setup.next_plugin("insulated");
            for face in Face::ALL {
                setup
                    .layer(0, &keys::TEMPERATURE, face, LayerRole::Free)
                    .expect("free");
            }
        };
        let message = free_area(Vec::new(), all).expect_err("nothing is free");
        assert!(
            message.contains("the boundary has no free surface"),
            "{message}"
        );
    }
}
