//! Traction: force per area on the surface.
//!
//! By default the traction becomes a force per volume on the points of the surface, `body_force += traction
//! area / volume`, which acts half a spacing below the surface, unless the body takes its moment about the point, too
//! ([`LoadedFaces`](perimelt_core::world::LoadedFaces)). With `by = "layer"` a layer behind a face of
//! the body's box continues the strain that belongs to the traction (Wang (2025), eqs. 4.24 to 4.28). The
//! force then acts on the face, has the error of the bond stiffness, and needs an elastic surface. These forces have no
//! potential, so that bodies in explicit motion refuse them.
//!
//! The surface is that of the reference configuration: a pressure does not turn with the body.

use nalgebra::Vector3;
use perimelt_core::body::SurfaceCell;
use perimelt_core::family::LayerRule;
use perimelt_core::in_space::PlacedError;
use perimelt_core::numbers::check_vector;
use perimelt_core::world::LayerHandle;
use perimelt_core::{
    Coupler, Face, GivenValue, InSpace, LayerRole, Placed, Prepared, Programme, Report, RunError,
    RunningCoupler, Setup, SetupError, Step, StepLimits, World, flattened, keys,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::surface_force::{SurfaceForce, face_centres, whole_force};
use super::with_programme;
use crate::InTime;
use crate::in_time::earlier;
use crate::surface::{OnSurface, select};

flattened! {
    /// Force on the surface: give `traction` or `pressure`.
    #[derive(Debug)]
    pub struct Traction {
        ..place: OnSurface,
        /// Outward directions of the loaded surface, such as `["x+"]`.
        pub faces: Vec<Face>,
        /// Force per area (Pa), by component.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub traction: Option<[f64; 3]>,
        /// Pressure (Pa), against the outward normal: a number, or a formula in the reference position x, y, z (m) and the
        /// time t (s), such as `"9800 * (0.14 - y)"` (not with `by = "layer"`).
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub pressure: Option<InSpace>,
        /// How the traction acts: as force on points, or by a layer behind the face.
        #[serde(default)]
        pub by: By,
        /// Factor on the load: a number, or `{ time = [...], value = [...] }`, times in s;
        /// default 1.
        #[serde(default = "constant")]
        pub factor: InTime,
    }
}

/// Where a traction acts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum By {
    /// On the points of the surface, as force per volume.
    #[default]
    BodyForce,
    /// On whole faces of the body's box, by a layer that continues the strain, as published.
    Layer,
}

fn constant() -> InTime {
    InTime::Constant(1.0)
}

/// A traction that is ready to act.
struct RunningTraction {
    body: usize,
    factor: InTime,
    cells: Vec<SurfaceCell>,
    load: Load,
    sink: TractionSink,
    /// Total force, N.
    force: Vector3<f64>,
}

#[derive(Debug)]
enum TractionSink {
    Points(SurfaceForce),
    Layers(Vec<(Face, LayerHandle)>),
}

#[derive(Clone, Debug)]
enum Load {
    Traction(Vector3<f64>),
    /// Pressure on each cell of the surface, at the centre of its face.
    Pressure(Box<Placed>),
}

impl Load {
    /// Forces per area on the cells at a time (s).
    fn at(&mut self, time: f64) -> Result<CellLoads<'_>, PlacedError> {
        Ok(match self {
            Load::Traction(traction) => CellLoads::Traction(*traction),
            Load::Pressure(pressure) => CellLoads::Pressure(pressure.at(time)?),
        })
    }
}

/// Forces per area (Pa) on the cells of the surface.
#[derive(Clone, Copy, Debug)]
enum CellLoads<'a> {
    Traction(Vector3<f64>),
    Pressure(&'a [f64]),
}

impl CellLoads<'_> {
    fn on(&self, cell: usize, face: Face) -> Vector3<f64> {
        match self {
            CellLoads::Traction(traction) => *traction,
            CellLoads::Pressure(pressures) => -pressures[cell] * face.normal(),
        }
    }
}

impl Traction {
    fn sink(&self, setup: &mut Setup<'_>, body: usize) -> Result<TractionSink, SetupError> {
        if self.by == By::BodyForce {
            return Ok(TractionSink::Points(SurfaceForce::prepare(setup, body)?));
        }
        if setup.body(body).lattice().is_none() {
            let message = "a traction layer needs a body with one spacing";
            return Err(SetupError::value("by", message, "\"body_force\""));
        }
        if self
            .pressure
            .as_ref()
            .is_some_and(|p| p.uniform().is_none())
        {
            let message = "`by = \"layer\"` loads whole faces uniformly";
            let expected = "a number, or `by = \"body_force\"`";
            return Err(SetupError::value("pressure", message, expected));
        }
        if self.place.region.is_some() {
            let message = "`by = \"layer\"` loads whole faces";
            return Err(SetupError::value("region", message, "no `region`"));
        }
        let mut layers = Vec::new();
        for &face in &self.faces {
            let layer = setup.layer(body, &keys::DISPLACEMENT, face, LayerRole::Prescribed);
            // the key is `faces` here, not `face`
            let layer = layer.map_err(|e| SetupError {
                key: "faces".into(),
                ..e
            });
            let layer = layer?;
            let none = perimelt_core::family::Traction {
                stress: [0.0; 3],
                difference: false,
            };
            let rule = LayerRule {
                traction: Some(none),
                ..LayerRule::even(face)
            };
            setup.announce_layer(layer, rule);
            layers.push((face, layer));
        }
        Ok(TractionSink::Layers(layers))
    }
}

#[typetag::serialize(name = "traction")]
impl Coupler for Traction {
    fn prepare(self: Box<Self>, setup: &mut Setup<'_>) -> Prepared<dyn RunningCoupler> {
        let body = setup.find_body(self.place.body.as_deref())?;
        let cells = select(setup, body, &self.faces, self.place.region.as_deref())?;
        let load = match (self.traction, &self.pressure) {
            (Some(traction), None) => {
                check_vector("traction", traction, setup.body(body))?;
                Load::Traction(traction.into())
            }
            (None, Some(pressure)) => {
                let centres = face_centres(&setup.body(body).points, &cells);
                let given = GivenValue {
                    key: "pressure",
                    value: pressure,
                    column: "pressure",
                };
                Load::Pressure(setup.placed(body, given, centres)?.into())
            }
            _ => {
                let message = "`traction` and `pressure` are both given or both missing";
                let expected = "either `traction` or `pressure`";
                return Err(SetupError::value("traction", message, expected));
            }
        };
        let programme = Programme::of_values([("factor", &self.factor)]);
        setup.stepping(with_programme(programme));
        Ok(Box::new(RunningTraction {
            body,
            cells,
            load,
            sink: self.sink(setup, body)?,
            factor: self.factor,
            force: Vector3::zeros(),
        }))
    }
}

impl RunningCoupler for RunningTraction {
    fn apply(&mut self, world: &World, step: Step) -> Result<(), RunError> {
        let factor = self.factor.value_at("factor", step.end());
        let factor = factor.map_err(|e| RunError::wrong_value("traction", e))?;
        let loads = self.load.at(step.end());
        let loads = loads.map_err(|e| e.during("traction", step.end()))?;
        let on_cell = |(index, cell): (usize, &SurfaceCell)| {
            loads.on(index, cell.face) * (factor * cell.face_area)
        };
        self.force = match &self.sink {
            TractionSink::Points(surface) => surface.add(world, &self.cells, on_cell),
            TractionSink::Layers(layers) => {
                for (face, layer) in layers {
                    let on_face = self.cells.iter().position(|cell| cell.face == *face);
                    let load = on_face.map_or_else(Vector3::zeros, |cell| loads.on(cell, *face));
                    let stress = factor * load;
                    world.set_traction_layer(*layer, stress.into());
                }
                whole_force(world, self.body, &self.cells, on_cell)
            }
        };
        Ok(())
    }

    fn step_limits(&self, time: f64) -> StepLimits {
        let pressure = match &self.load {
            Load::Traction(_) => None,
            Load::Pressure(pressure) => pressure.next_event(time),
        };
        StepLimits {
            next_event: earlier(self.factor.next_event(time), pressure),
            ..StepLimits::default()
        }
    }

    fn report(&self) -> Vec<Report> {
        let axes = ["x", "y", "z"].into_iter().zip(&self.force);
        axes.map(|(axis, force)| Report::new(format!("force.{axis}"), "N", *force))
            .collect()
    }
}

perimelt_core::register_coupler!("traction", Traction, supports: [Births, Cuts, Layers, Division]);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{STEEL, apply, block, prepare, read, refusal, values};

    fn loaded(table: &str) -> (Vec<f64>, Vec<f64>) {
        let mut world = World::new(vec![block([4, 3, 2], 3, STEEL)]);
        let (mut boundary, _) = prepare(&mut world, read::<Traction>(table), |setup| {
            setup.consume(0, &keys::BODY_FORCE).expect("free");
        })
        .expect("valid");
        apply(&world, &mut *boundary, 1.0);
        let force = boundary.report().iter().map(|r| r.value).collect();
        (values(&world, &keys::BODY_FORCE), force)
    }

    #[test]
    fn the_force_is_the_traction_at_the_end_of_the_step_times_the_area() {
        let table =
            "faces = ['x+']\ntraction = [5, 0, -1]\nfactor = { time = [0, 4], value = [0, 2] }";
        let (body_force, force) = loaded(table);
        assert_eq!(force, [30.0, 0.0, -6.0]);
        // unit volumes; the last point of the first row carries its part, the first none
        assert_eq!(
            (&body_force[9..12], body_force[0]),
            (&[5.0, 0.0, -1.0][..], 0.0)
        );
    }

    #[test]
    fn pressure_pushes_inwards_and_cancels_all_around() {
        assert_eq!(loaded("faces = ['z+']\npressure = 2").1, [0.0, 0.0, -24.0]);
        let all = "faces = ['x-', 'x+', 'y-', 'y+', 'z-', 'z+']\npressure = 2";
        assert_eq!(loaded(all).1, [0.0; 3]);
    }

    #[test]
    fn pressure_may_be_a_formula_in_place_and_time() {
        // two rows of faces of unit area at x = 0, with centres at y = 0.5, 1.5, 2.5; the step ends at 2 s
        let (body_force, force) = loaded("faces = ['x-']\npressure = '10 * (3 - y) * t'");
        assert_eq!(force, [2.0 * 2.0 * 45.0, 0.0, 0.0]);
        assert_eq!([body_force[0], body_force[12]], [50.0, 30.0]);
        // on the face, not at the points behind it
        for (face, axis, force) in [
            ("x+", "x", [-4.0 * 6.0, 0.0, 0.0]),
            ("x-", "x + 1", [6.0, 0.0, 0.0]),
            ("y+", "y", [0.0, -3.0 * 8.0, 0.0]),
        ] {
            let table = format!("faces = ['{face}']\npressure = '{axis}'");
            assert_eq!(loaded(&table).1, force, "{face}");
        }
        let mut world = World::new(vec![block([4, 3, 2], 3, STEEL)]);
        let table = "faces = ['x+']\npressure = 'y'\nby = 'layer'";
        assert!(refusal(&mut world, read::<Traction>(table)).starts_with("pressure"));
    }

    #[test]
    fn a_layer_carries_the_load_instead_of_the_points() {
        let mut world = World::new(vec![block([4, 3, 2], 3, STEEL)]);
        let boundary: Traction = read("faces = ['x-']\npressure = 2\nby = 'layer'");
        let (mut boundary, layers) = prepare(&mut world, boundary, |setup| {
            setup.own(0, &keys::DISPLACEMENT).expect("free");
            setup.layers(0, &keys::DISPLACEMENT).handle
        })
        .expect("nobody needs to take up a body force");
        apply(&world, &mut *boundary, 0.0);
        let traction = world.layer_rules(layers)[0].traction.expect("it was set");
        assert_eq!(traction.stress, [2.0, 0.0, 0.0]);
        assert_eq!(boundary.report()[0].value, 12.0);
    }

    /// A region limits the loaded surface, and only points with material carry a load.
    #[test]
    fn only_material_in_the_region_is_loaded() {
        let (body_force, force) = loaded("faces = ['z+']\nregion = 'left'\npressure = 2");
        assert_eq!(force, [0.0, 0.0, -2.0 * 3.0]);
        assert_eq!(body_force[3 * 12 + 2], -2.0);
        assert_eq!(body_force[3 * 13 + 2], 0.0);

        let mut world = World::new(vec![block([4, 3, 2], 3, STEEL)]);
        let boundary: Traction = read("faces = ['z+']\npressure = 2");
        let mut setup = Setup::new(&mut world, std::path::Path::new("."));
        setup.next_plugin("deposit");
        setup
            .change_material(0, perimelt_core::Change::Births, &[12, 13])
            .expect("a lattice");
        setup.next_plugin("traction");
        let mut boundary = Box::new(boundary).prepare(&mut setup).expect("valid");
        setup.next_plugin("mechanical");
        setup.consume(0, &keys::BODY_FORCE).expect("free");
        setup.finish().expect("complete");
        apply(&world, &mut *boundary, 0.0);
        assert_eq!(boundary.report()[2].value, -2.0 * 10.0);
        let body_force = values(&world, &keys::BODY_FORCE);
        assert_eq!(
            [12, 13, 14].map(|p| body_force[3 * p + 2]),
            [0.0, 0.0, -2.0]
        );
    }

    #[test]
    fn a_layer_has_whole_faces() {
        let mut world = World::new(vec![block([4, 3, 2], 3, STEEL)]);
        let table = "faces = ['x+']\npressure = 2\nby = 'layer'\nregion = 'left'";
        assert!(refusal(&mut world, read::<Traction>(table)).starts_with("region"));
    }

    #[test]
    fn one_kind_of_load_is_needed() {
        let mut world = World::new(vec![block([4, 3, 2], 3, STEEL)]);
        let boundary: Traction = read("faces = ['x+']");
        assert!(refusal(&mut world, boundary).contains("either `traction` or `pressure`"));
    }
}
