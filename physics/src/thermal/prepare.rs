//! Set-up of the heat: fields, family, conduction, convection.

use std::sync::Arc;

use perimelt_core::material::{Directional, Property};
use perimelt_core::world::BodyIndex;
use perimelt_core::{
    Access, Body, Correction, Description, Face, FamilyHandle, FamilySpec, Horizon, Influence,
    Pddo, Read, ReadIfProvided, Setup, SetupError, StepSize, Wall, Write, keys,
};

use crate::advection::{Convection, FlowFamily, usual_horizon};
use crate::dependent_keys::need;

use super::carried::{CarriedHeat, FlowFields, WallInFlow};
use super::conduction::{Conduction, calibration};
use super::conductivity::{Directions, conductivities};
use super::faces::HeatedFace;
use super::growth::Growth;
use super::integrate::Integrator;
use super::keys::{Form, Surfaces, Thermal, ThermalSolver};
use super::kinds::{BondKeys, FormKeys, HeatOfFlow};
use super::mixture::MixedFluids;
use super::plies;
use super::refined::Refined;
use super::run::{Cracks, HeatAccount, RunningThermal};
use super::surface::{self, Surface};

/// The state of a heat physics, and the sinks that it consumes where a plugin adds into them.
#[derive(Clone, Copy, Debug)]
pub(super) struct HeatFields {
    pub(super) temperature: Write<f64>,
    pub(super) enthalpy: Write<f64>,
    pub(super) source: Option<Read<f64>>,
    /// Conductance to other bodies, for steady states.
    pub(super) conductance: Option<Read<f64>>,
    pub(super) constraint: Option<Read<f64>>,
    pub(super) held: Option<Read<f64>>,
    /// Heat that a flow carried to each point, J/m³.
    pub(super) carried: Option<Read<f64>>,
    /// Heat that physics of other bodies gave to each point, J/m³.
    pub(super) given: Option<Read<f64>>,
}

impl HeatFields {
    fn declare(setup: &mut Setup<'_>, body: BodyIndex) -> Result<Self, SetupError> {
        Ok(HeatFields {
            temperature: setup.own(body, &keys::TEMPERATURE)?,
            enthalpy: setup.own_derived(body, &keys::ENTHALPY)?,
            source: setup.consume_if_added(body, &keys::HEAT_SOURCE)?,
            conductance: setup.consume_if_added(body, &keys::HEAT_CONDUCTANCE)?,
            constraint: setup.consume_if_added(body, &keys::TEMPERATURE_CONSTRAINT)?,
            held: setup.consume_if_added(body, &keys::HELD_TEMPERATURE)?,
            carried: setup.take_if_added(body, &keys::CARRIED_HEAT)?,
            given: setup.take_if_added(body, &keys::GIVEN_HEAT)?,
        })
    }
}

/// Conductivity of austenite by material, W/(m K), and its fraction.
#[derive(Debug)]
pub(super) struct Austenite {
    pub(super) conductivity: Vec<Property>,
    pub(super) fraction: ReadIfProvided<f64>,
}

/// The operator of conduction with its family.
struct Operators {
    family: FamilyHandle,
    conduction: Conduction,
    /// Of plies, the distances of their edges from the outermost points.
    edges: Option<Vec<Vec<[f64; 2]>>>,
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

impl ConductionDomain {
    /// The faces with a prescribed temperature whose heat can be measured, if any can.
    fn measured_faces(&self, setup: &Setup<'_>, is_measurable: bool) -> Vec<HeatedFace> {
        let (body, reducer) = (setup.body(self.body), setup.world().reducer(self.body));
        let faces = self.heated.iter().filter(|_| is_measurable);
        let faces = faces.map(|face| HeatedFace::of(body, *face, &reducer));
        faces.filter(|face| face.is_measurable(&reducer)).collect()
    }
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
        let fields = HeatFields::declare(setup, body)?;
        let curves = setup.world().enthalpy_curves(body)?;
        let fluids = MixedFluids::prepare(setup, body)?;
        let flow = HeatOfFlow {
            is_given: fields.carried.is_some(),
            of_two_fluids: fluids.is_some(),
        };
        let keys = thermal.take_keys(setup.world(), body, flow)?;
        let is_growing = setup.world().is_growing(body);
        let layers = setup.layers(body, &keys::TEMPERATURE);
        let domain = ConductionDomain {
            body,
            description,
            horizon,
            layers: keys.form.continued_faces(setup.body(body), layers.faces()),
            heated: layers.prescribed,
        };
        let Operators {
            family,
            mut conduction,
            edges,
        } = thermal.operators(setup, &domain, keys.form)?;
        if let Some(fluids) = &fluids {
            fluids.check(&curves)?;
            conduction.set_fluids(fluids, &curves);
        }
        let refined = Refined::prepare(setup, &domain, family)?;
        let growth = is_growing
            .then(|| Growth::prepare(setup, body))
            .transpose()?;
        let consolidated = thermal.powder(setup, &domain, refined.is_some(), &mut conduction)?;
        let austenite = thermal.austenite(setup, &domain, refined.is_some())?;
        let orientation = (conduction.has_directions())
            .then(|| setup.given(body, &keys::ORIENTATION))
            .transpose()?;
        let carried = (keys.convection)
            .map(|convection| thermal.carried(setup, &domain, convection))
            .transpose()?;
        let has_conductance = fields.conductance.is_some();
        let surface = surface::prepare(setup, body, family, &conduction, has_conductance, edges)?;
        check_two_way(thermal.solver, surface.as_ref(), fields.given.is_some())?;
        check_directions(&conduction, austenite.is_some(), surface.is_some())?;
        let fixed =
            fields.constraint.is_some() || surface.as_ref().is_some_and(Surface::has_conductance);
        let moves = description == Description::UpdatedLagrangian;
        let is_measurable = !moves && !conduction.has_directions();
        let faces = domain.measured_faces(setup, is_measurable);
        Ok(RunningThermal {
            solver: thermal.solver,
            is_automatic: thermal.step == StepSize::Auto,
            body,
            family,
            moves,
            layers: layers.handle,
            fields,
            floating: domain.heated.is_empty() && !fixed && !has_conductance,
            curves,
            fluids,
            conduction,
            orientation,
            carried,
            cracks: keys.follows_cracks.then(Cracks::default),
            growth,
            refined,
            consolidated,
            austenite,
            integrator: Integrator::new(keys.solver),
            heat: HeatAccount::default(),
            faces,
            through_layers: 0.0,
            surface,
            stable_step: None,
            conduction_step: None,
            exchange_limit: None,
        })
    }
}

/// Refuses what a conductivity with directions does not know.
fn check_directions(
    conduction: &Conduction,
    has_austenite: bool,
    has_surface: bool,
) -> Result<(), SetupError> {
    let has_directions = conduction.has_directions();
    need(
        !(has_directions && has_austenite),
        "conductivity",
        "the conductivity of austenite has no directions",
        "a `conductivity` without directions, or a material without `austenite_conductivity`",
    )?;
    need(
        !(has_directions && has_surface),
        "conductivity",
        "boundaries that exchange heat through the surface take the same conductivity in all directions",
        "a `conductivity` without directions, or prescribed temperatures",
    )
}

/// Refuses steady states of bodies that give heat to each other: amounts belong to steps in time.
fn check_two_way(
    solver: ThermalSolver,
    surface: Option<&Surface>,
    gives_to_others: bool,
) -> Result<(), SetupError> {
    let takes_from_others = surface.is_some_and(|s| s.given.is_possible());
    need(
        !(takes_from_others || gives_to_others) || solver != ThermalSolver::Steady,
        "solver",
        "a two-way exchange moves amounts of heat between bodies in steps of time, of which a steady state has none",
        "another `solver`, or `exchange = \"one_way\"` in the `ambient` of the boundaries",
    )
}

/// Publishes the distances of the surface from the outermost points, and collects the exchanges of the surface.
impl FormKeys {
    /// Faces behind which the body continues: the `claimed` faces of boundaries, or all.
    fn continued_faces(self, body: &Body, claimed: Vec<Face>) -> Vec<Face> {
        let surfaces = match self {
            FormKeys::Bonds(keys) | FormKeys::Ordinary(keys, _) => keys.surfaces,
            FormKeys::SecondDerivatives => Surfaces::Mirrored,
        };
        let all = match surfaces {
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
}

impl Thermal {
    /// The horizon; by default three spacings, or the horizon of the fluid in an Eulerian flow.
    fn horizon_of(&self, body: &Body, description: Description) -> Horizon {
        self.horizon.unwrap_or_else(|| match description {
            Description::Eulerian => usual_horizon(description, body),
            _ => Horizon::Spacings(3.0),
        })
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
        need(
            self.form == Form::Bonds && domain.description != Description::Eulerian,
            "form",
            "powder conducts by bonds, and its points must not be those of a flow",
            "`form = \"bonds\"` and a body without an Eulerian `fluid`",
        )?;
        need(
            !is_refined,
            "body",
            "a body with a window of finer points has no powder",
            "a body without `powder`",
        )?;
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

    /// The family and the operator of conduction.
    fn operators(
        &self,
        setup: &mut Setup<'_>,
        domain: &ConductionDomain,
        form: FormKeys,
    ) -> Result<Operators, SetupError> {
        let body = domain.body;
        let found = conductivities(self.conductivity.clone(), setup.body(body))?;
        if setup.body(body).layers().is_some() {
            return self.plies(setup, domain, form, &found);
        }
        let directions = Directions::of(&found, setup.body(body));
        need(
            directions.is_none() || self.form == Form::Ordinary,
            "form",
            "a conductivity with directions needs the ordinary form: bonds and second derivatives conduct the same in all directions",
            "`form = \"ordinary\"`, or a `conductivity` without directions",
        )?;
        let conductivity = found.iter().map(|k| k.along(0).clone()).collect();
        let points = setup.body(body).points.len();
        let (BondKeys { correction, .. }, stabilisation) = match form {
            FormKeys::Bonds(keys) => (keys, None),
            FormKeys::Ordinary(keys, stabilisation) => (keys, Some(stabilisation)),
            FormKeys::SecondDerivatives => {
                let (family, pddo) = self.second_derivatives(setup, domain)?;
                let conduction = Conduction::by_derivatives(pddo, conductivity, points);
                return Ok(Operators {
                    family,
                    conduction,
                    edges: None,
                });
            }
        };
        let mut spec = FamilySpec {
            horizon: domain.horizon,
            partial_volume: self.partial_volume,
            influence: Influence::default(),
            correction: correction.unwrap_or_default(),
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
        let calibration = match correction {
            Some(Correction::None) => 1.0,
            _ if moves => calibration(&family, points, dimension),
            _ => 1.0,
        };
        let mut conduction = Conduction::by_bonds(&family, conductivity, points, calibration);
        if let Some(stabilisation) = stabilisation {
            conduction.set_states(setup.body(body), stabilisation, directions);
        }
        Ok(Operators {
            family: handle,
            conduction,
            edges: None,
        })
    }

    /// The family and the operator of a body with a lay-up.
    fn plies(
        &self,
        setup: &mut Setup<'_>,
        domain: &ConductionDomain,
        form: FormKeys,
        found: &[Directional<Property>],
    ) -> Result<Operators, SetupError> {
        let correction = match form {
            FormKeys::Bonds(keys) => keys.correction,
            FormKeys::Ordinary(..) | FormKeys::SecondDerivatives => None,
        };
        let spec = FamilySpec {
            horizon: domain.horizon,
            partial_volume: self.partial_volume,
            influence: Influence::default(),
            correction: correction.unwrap_or_default(),
            layers: Vec::new(),
            audited: Vec::new(),
        };
        let this = setup.body(domain.body);
        let Some(layers) = this.layers() else {
            unreachable!("the caller has asked for them");
        };
        let plies = plies::family(this, layers, &spec, found)?;
        let conduction = Conduction::by_plies(this, layers, &plies);
        Ok(Operators {
            family: setup.take_family(domain.body, plies.family)?,
            conduction,
            edges: Some(plies.edges),
        })
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
        if !this.cuts.is_empty() {
            let message = "second derivatives need complete families, but a crack cuts some";
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
        convection: Convection,
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
            convection,
            fields,
        ))
    }
}
