//! Set-up of the heat: fields, family, conduction, convection.

use std::rc::Rc;
use std::sync::Arc;

use perimelt_core::material::{EnthalpyCurve, LatentHeatForm, Property};
use perimelt_core::world::exchange::Exchange;
use perimelt_core::world::{BodyIndex, SurfaceDepths};
use perimelt_core::{
    Access, Body, Correction, Description, Face, FamilyHandle, FamilySpec, Horizon, Influence,
    Pddo, Read, ReadIfProvided, Setup, SetupError, StepSize, Wall, keys,
};

use crate::advection::{FlowFamily, usual_horizon};

use super::carried::{CarriedHeat, FlowFields, WallInFlow};
use super::conduction::{Conduction, calibration};
use super::faces::HeatedFace;
use super::growth::Growth;
use super::integrate::Integrator;
use super::keys::{BrokenConduction, Form, Surfaces, Thermal, ThermalSolver};
use super::refined::Refined;
use super::run::{Cracks, HeatAccount, RunningThermal};
use super::surface::Surface;
use super::surface_depth;

/// Conductivity of austenite by material, W/(m K), and its fraction.
#[derive(Debug)]
pub(super) struct Austenite {
    pub(super) conductivity: Vec<Property>,
    pub(super) fraction: ReadIfProvided<f64>,
}

/// A body that conducts heat.
pub(super) struct ConductionDomain {
    pub(super) body: BodyIndex,
    pub(super) description: Description,
    horizon: Horizon,
    /// Faces behind which the body continues.
    layers: Vec<Face>,
    /// Faces with a prescribed temperature.
    pub(super) heated: Vec<Face>,
}

impl RunningThermal {
    pub(super) fn prepare(
        thermal: &Thermal,
        setup: &mut Setup<'_>,
    ) -> Result<RunningThermal, SetupError> {
        let body = setup.find_body(thermal.body.as_deref())?;
        let description = setup.world().description(body);
        let horizon = thermal.horizon_of(setup.body(body), description);
        horizon.check(setup.body(body))?;
        let temperature = setup.own(body, &keys::TEMPERATURE)?;
        let enthalpy = setup.own(body, &keys::ENTHALPY)?;
        let heat_source = setup.consume_if_added(body, &keys::HEAT_SOURCE)?;
        let heat_conductance = setup.consume_if_added(body, &keys::HEAT_CONDUCTANCE)?;
        let constraint = setup.consume_if_added(body, &keys::TEMPERATURE_CONSTRAINT)?;
        let held = setup.consume_if_added(body, &keys::HELD_TEMPERATURE)?;
        let curves = setup.world().enthalpy_curves(body)?;
        thermal.check(&curves, description)?;
        let is_growing = setup.world().is_growing(body);
        if is_growing {
            thermal.check_growth()?;
        }
        let layers = setup.layers(body, &keys::TEMPERATURE);
        let domain = ConductionDomain {
            body,
            description,
            horizon,
            layers: thermal.continued_faces(setup.body(body), layers.faces()),
            heated: layers.prescribed,
        };
        let (family, mut conduction) = thermal.operators(setup, &domain)?;
        let refined = Refined::prepare(thermal, setup, &domain, family)?;
        let growth = is_growing
            .then(|| Growth::prepare(setup, body))
            .transpose()?;
        let consolidated = thermal.powder(setup, &domain, refined.is_some(), &mut conduction)?;
        let austenite = thermal.austenite(setup, &domain, refined.is_some())?;
        let carried = match description {
            Description::Eulerian => Some(thermal.carried(setup, &domain)?),
            _ => None,
        };
        let has_conductance = heat_conductance.is_some();
        let surface = prepare_surface(setup, body, family, &conduction, has_conductance)?;
        let fixed = constraint.is_some() || surface.as_ref().is_some_and(Surface::has_conductance);
        let moves = description == Description::UpdatedLagrangian;
        let is_at_rest = !moves && growth.is_none();
        let follows_cracks = thermal.broken_bonds == BrokenConduction::Insulate && is_at_rest;
        let faces = domain.heated.iter().filter(|_| !moves);
        let faces = faces.map(|face| HeatedFace::of(setup.body(body), *face));
        Ok(RunningThermal {
            solver: thermal.solver,
            is_automatic: thermal.step == StepSize::Auto,
            body,
            family,
            moves,
            layers: layers.handle,
            temperature,
            enthalpy,
            heat_source,
            heat_conductance,
            floating: domain.heated.is_empty() && !fixed && !has_conductance,
            constraint,
            held,
            curves,
            conduction,
            carried,
            cracks: follows_cracks.then(Cracks::default),
            growth,
            refined,
            consolidated,
            austenite,
            integrator: Integrator::new(thermal),
            heat: HeatAccount::default(),
            faces: faces.filter(HeatedFace::is_measurable).collect(),
            through_layers: 0.0,
            surface,
            stable_step: None,
            conduction_step: None,
            exchange_limit: None,
        })
    }
}

/// Publishes the distances of the surface from the outermost points, and collects the exchanges of the surface.
/// `has_conductance`: other bodies exchange heat through the surface.
fn prepare_surface(
    setup: &mut Setup<'_>,
    body: BodyIndex,
    family: FamilyHandle,
    conduction: &Conduction,
    has_conductance: bool,
) -> Result<Option<Surface>, SetupError> {
    let exchanges: Vec<Rc<Exchange>> = setup.facts(body).cloned().collect();
    let is_exchanged = !exchanges.is_empty() || has_conductance;
    let depth = match is_exchanged && conduction.is_by_bonds() {
        false => [0.5; 6],
        true => {
            let family = setup.world().family(family);
            surface_depth::depths(setup.body(body), &family)
        }
    };
    setup.publish(body, SurfaceDepths(depth))?;
    Ok(Surface::new(exchanges, depth))
}

impl Thermal {
    /// The horizon; by default three spacings, or the horizon of the fluid in an Eulerian flow.
    fn horizon_of(&self, body: &Body, description: Description) -> Horizon {
        self.horizon.unwrap_or_else(|| match description {
            Description::Eulerian => usual_horizon(description, body),
            _ => Horizon::Spacings(3.0),
        })
    }

    /// Refuses keys that fit neither the materials nor the description of the points.
    fn check(&self, curves: &[EnthalpyCurve], description: Description) -> Result<(), SetupError> {
        for (key, tolerance) in [
            ("tolerance", self.tolerance),
            ("time_tolerance", self.time_tolerance),
        ] {
            if !(tolerance > 0.0) {
                let message = format!("`{key}` is {tolerance}");
                return Err(SetupError::value(key, message, "a number above 0"));
            }
        }
        let is_explicit = self.solver == ThermalSolver::Explicit;
        let apparent = curves.iter().any(|c| c.form() == LatentHeatForm::Apparent);
        if apparent && !is_explicit {
            let message = "the apparent heat capacity is defined for explicit steps only";
            let expected = "`solver = \"explicit\"`, or the enthalpy form";
            return Err(SetupError::value("solver", message, expected));
        }
        if description == Description::ArbitraryLagrangianEulerian {
            let message = "heat in a fluid whose points follow its walls is not computed";
            let expected = "a fluid with `description = \"eulerian\"` or `\"updated_lagrangian\"`";
            return Err(SetupError::value("body", message, expected));
        }
        if description == Description::Eulerian && !is_explicit {
            let message = "heat that a flow carries is advanced by explicit steps only";
            let expected = "`solver = \"explicit\"`";
            return Err(SetupError::value("solver", message, expected));
        }
        self.check_states(description)?;
        if self.form == Form::SecondDerivatives && description == Description::UpdatedLagrangian {
            let message = "second derivatives need points that stay";
            return Err(SetupError::value("form", message, "`form = \"bonds\"`"));
        }
        self.check_correction(description)
    }

    /// Refuses the ordinary form where points move, and a stabilisation in other forms.
    fn check_states(&self, description: Description) -> Result<(), SetupError> {
        if self.form != Form::Ordinary {
            if self.stabilisation != 1.0 {
                let message = "`stabilisation` belongs to the ordinary form";
                let expected = "`form = \"ordinary\"` with it";
                return Err(SetupError::value("stabilisation", message, expected));
            }
            return Ok(());
        }
        if description != Description::TotalLagrangian {
            let message = "the ordinary form needs points that are matter at rest";
            return Err(SetupError::value("form", message, "`form = \"bonds\"`"));
        }
        if !(0.0..=1.0).contains(&self.stabilisation) {
            let message = format!("`stabilisation` is {}", self.stabilisation);
            return Err(SetupError::value("stabilisation", message, "0 to 1"));
        }
        Ok(())
    }

    /// Refuses keys that do not fit a body that grows.
    fn check_growth(&self) -> Result<(), SetupError> {
        let (key, message, expected) = match (self.solver, self.form) {
            (ThermalSolver::Steady, _) => {
                let message = "a steady state has no time in which material is deposited";
                (
                    "solver",
                    message,
                    "a solver that steps in time, such as \"explicit\"",
                )
            }
            (_, Form::Ordinary) => {
                let message = "the ordinary form needs families that stay, but `deposit` adds material to the body";
                ("form", message, "`form = \"bonds\"`")
            }
            (_, Form::SecondDerivatives) => {
                let message = "second derivatives need complete families, but `deposit` adds material to the body";
                ("form", message, "`form = \"bonds\"`")
            }
            _ => return Ok(()),
        };
        Err(SetupError::value(key, message, expected))
    }

    /// The field of powder and dense material, where the body has powder, whose conductivity is added to `conduction`.
    fn powder(
        &self,
        setup: &mut Setup<'_>,
        domain: &ConductionDomain,
        is_refined: bool,
        conduction: &mut Conduction,
    ) -> Result<Option<Read<f64>>, SetupError> {
        let body = domain.body;
        if !setup.is_declared(body, &keys::CONSOLIDATED, Access::Write) {
            return Ok(None);
        }
        self.check_powder(domain.description)?;
        if is_refined {
            let message = "a body with a window of finer points has no powder";
            let expected = "a body without `powder`";
            return Err(SetupError::value("body", message, expected));
        }
        conduction.set_powder(setup.world().property(body, "powder_conductivity")?);
        Ok(Some(setup.read(body, &keys::CONSOLIDATED)?))
    }

    /// Conductivity and fraction of austenite, where a material has `austenite_conductivity`.
    fn austenite(
        &self,
        setup: &mut Setup<'_>,
        domain: &ConductionDomain,
        is_refined: bool,
    ) -> Result<Option<Austenite>, SetupError> {
        const KEY: &str = "austenite_conductivity";
        let body = domain.body;
        let materials = &setup.body(body).materials;
        let applies = self.form == Form::Bonds && domain.description != Description::Eulerian;
        if !applies || is_refined || materials.iter().all(|m| m.get(KEY).is_none()) {
            return Ok(None);
        }
        let rest = setup.world().property(body, "conductivity")?;
        let materials = setup.body(body).materials.iter().zip(rest);
        let conductivity = materials.map(|(m, rest)| m.get(KEY).cloned().unwrap_or(rest));
        Ok(Some(Austenite {
            conductivity: conductivity.collect(),
            fraction: setup.read_if_provided(body, &keys::AUSTENITE)?,
        }))
    }

    /// Refuses keys and points for which powder has no meaning.
    fn check_powder(&self, description: Description) -> Result<(), SetupError> {
        if self.form == Form::Bonds && description != Description::Eulerian {
            return Ok(());
        }
        let message = "powder conducts by bonds between points that are matter";
        let expected = "`form = \"bonds\"`, and a body through which nothing flows";
        Err(SetupError::value("form", message, expected))
    }

    fn check_correction(&self, description: Description) -> Result<(), SetupError> {
        let (message, expected) = match (self.correction, self.form, description) {
            (Some(Correction::Uniaxial), ..) => ("conduction has no uniaxial strain", "\"point\""),
            (
                Some(
                    Correction::Point
                    | Correction::Balanced
                    | Correction::Lattice
                    | Correction::Zone
                    | Correction::Volume,
                ),
                Form::SecondDerivatives,
                _,
            ) => {
                let message = "`correction` applies to bonds; second derivatives are exact without";
                (message, "\"none\", or leave it out")
            }
            (
                Some(
                    Correction::Point
                    | Correction::Balanced
                    | Correction::Zone
                    | Correction::Volume,
                ),
                _,
                Description::UpdatedLagrangian,
            ) => {
                let message = "bonds of points that move are calibrated for complete families";
                (message, "\"lattice\" or \"none\"")
            }
            _ => return Ok(()),
        };
        Err(SetupError::value("correction", message, expected))
    }

    /// Faces behind which the body continues: the `claimed` faces of boundaries, or all.
    fn continued_faces(&self, body: &Body, claimed: Vec<Face>) -> Vec<Face> {
        let all = match self.surfaces {
            Surfaces::Auto => body.fills_box(),
            Surfaces::Mirrored => true,
            Surfaces::Bare => false,
        };
        let faces = Face::ALL.into_iter().filter(|f| f.axis() < body.dimension);
        match all {
            true => faces.collect(),
            false => claimed,
        }
    }

    /// The family and the operator of conduction.
    fn operators(
        &self,
        setup: &mut Setup<'_>,
        domain: &ConductionDomain,
    ) -> Result<(FamilyHandle, Conduction), SetupError> {
        let body = domain.body;
        let conductivity = setup.world().property(body, "conductivity")?;
        let points = setup.body(body).points.len();
        if self.form == Form::SecondDerivatives {
            let (family, pddo) = self.second_derivatives(setup, domain)?;
            let conduction = Conduction::by_derivatives(pddo, conductivity, points);
            return Ok((family, conduction));
        }
        let mut spec = FamilySpec {
            horizon: domain.horizon,
            partial_volume: self.partial_volume,
            influence: Influence::default(),
            correction: self.correction.unwrap_or_default(),
            layers: domain.layers.clone(),
            audited: domain.heated.clone(),
        };
        let moves = domain.description == Description::UpdatedLagrangian;
        if moves {
            spec.correction = Correction::None;
        }
        let handle = setup.family(body, &spec)?;
        let family = setup.world().family(handle);
        let dimension = setup.body(body).dimension;
        let calibration = match self.correction {
            Some(Correction::None) => 1.0,
            _ if moves => calibration(&family, points, dimension),
            _ => 1.0,
        };
        let mut conduction = Conduction::by_bonds(&family, conductivity, points, calibration);
        if self.form == Form::Ordinary {
            conduction.set_states(dimension, self.stabilisation);
        }
        Ok((handle, conduction))
    }

    /// The operator of second derivatives.
    fn second_derivatives(
        &self,
        setup: &mut Setup<'_>,
        domain: &ConductionDomain,
    ) -> Result<(FamilyHandle, Arc<Pddo>), SetupError> {
        let this = setup.body(domain.body);
        if !this.fills_box() {
            let message =
                "second derivatives need complete families, but the body does not fill its box";
            return Err(SetupError::value("form", message, "`form = \"bonds\"`"));
        }
        let handle = self.box_family(setup, domain)?;
        let family = setup.world().family(handle);
        let pddo = Pddo::build(setup.body(domain.body), family, 2);
        let pddo = pddo.map_err(|e| SetupError::other("horizon", e))?;
        Ok((handle, Arc::new(pddo)))
    }

    /// A complete family of a body that fills its box.
    fn box_family(
        &self,
        setup: &mut Setup<'_>,
        domain: &ConductionDomain,
    ) -> Result<FamilyHandle, SetupError> {
        let this = setup.body(domain.body);
        let needs_layer = |f: &Face| f.axis() < this.dimension && !this.periodic[f.axis()];
        let spec = FamilySpec {
            partial_volume: self.partial_volume,
            layers: Face::ALL.into_iter().filter(needs_layer).collect(),
            ..Pddo::spec(domain.horizon)
        };
        setup.family(domain.body, &spec)
    }

    /// Convection by the flow through the points: over a family with the horizon of the heat, or, where bodies stand in the
    /// flow, over the family of the flow.
    fn carried(
        &self,
        setup: &mut Setup<'_>,
        domain: &ConductionDomain,
    ) -> Result<CarriedHeat, SetupError> {
        let body = domain.body;
        let fields = FlowFields {
            velocity: setup.read(body, &keys::VELOCITY)?,
            density: setup.read(body, &keys::DENSITY)?,
            mass_flux: setup.read(body, &keys::MASS_FLUX)?,
        };
        let family = match setup.body(body).fills_box() {
            true => self.box_family(setup, domain)?,
            false => {
                let of_flow = setup.facts::<FlowFamily>(body).next();
                of_flow
                    .expect("an Eulerian flow has published its family")
                    .0
            }
        };
        let family = setup.world().family(family);
        let walls: Vec<Wall> = setup.facts(body).copied().collect();
        let walls = walls
            .into_iter()
            .map(|wall| WallInFlow::new(setup, body, &family, wall));
        let walls = walls.collect::<Result<Vec<_>, _>>()?;
        Ok(CarriedHeat::new(
            setup.body(body),
            family,
            walls,
            self.convection,
            fields,
        ))
    }
}
