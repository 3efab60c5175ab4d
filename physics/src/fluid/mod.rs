//! Laminar flow of a weakly compressible Newtonian fluid, by the peridynamic differential operator.
//!
//! ```text
//! D rho/Dt = -rho div v                                               Gao (2020), eqs. 5.22 to 5.27
//! rho Dv/Dt = -grad p + mu lap v [+ mu/3 grad div v] + 2 eps . grad mu + f    eqs. 5.50, 5.55, 5.44 (corrected)
//! p = B ((rho/rho0)^gamma - 1) + p0,   B = rho0 c^2 / gamma           eqs. 5.34, 5.35
//! D h/Dt = div(k grad T) + Phi + q                                    eqs. 5.65, 5.66
//! ```
//!
//! Derivatives are those of [`Pddo`], of second order. `h` is the enthalpy per reference volume, so that
//! melting works as in the thermal physics; `f` (N/m³) and `q` (W/m³) are the sink fields `body_force` and
//! `heat_source`. Without the term in brackets the flow counts as incompressible, since its divergence is
//! small.
//!
//! - *Updated Lagrangian*: points move with the fluid and keep their mass; families and operators are found
//!   again in every step, volumes follow from the density (eqs. 5.89 to 5.98, with `V = m / rho` for 5.98). A
//!   point that has gone through a wall is put back (eq. 6.45), one that leaves a periodic side enters at the
//!   other (eq. 5.117).
//! - *Total Lagrangian*: points move with the fluid, families stay as they were. For small strains, and where
//!   nothing changes along the flow.
//! - *Eulerian*: points stay, convective terms are added (eqs. 5.99 to 5.101; corrected, see spec 05, E7).
//!
//! The body must fill its box; every face is a `wall`, a plane of `symmetry`, or periodic. Behind walls the
//! pressure goes on with the weight of the fluid (eq. 5.106, by mirror images: second order).
//!
//! The speed of sound is a number of the method: pressures, also hydrostatic ones, must stay below a
//! hundredth of `rho0 c^2`. The derivatives do not see a pressure that changes sign from point to point;
//! `density_diffusion` removes it.
//!
//! Not for: turbulence, free surfaces, points that leave their neighbours.

mod flow;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use nalgebra::Vector3;
use perimelt_core::body::SurfaceCell;
use perimelt_core::family::LayerRule;
use perimelt_core::material::{EnthalpyCurve, Property};
use perimelt_core::solver::reduce::sum_of;
use perimelt_core::world::{BodyIndex, LayersHandle};
use perimelt_core::{
    Balance, Body, Clock, Face, Family, FamilySpec, Horizon, PartialVolume, Pddo, PddoError,
    Physics, Read, Report, RunError, Setup, SetupError, Step, StepSize, Work, World, Write, keys,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use flow::{Flow, Properties};

/// Weakly compressible laminar flow; owns `velocity`, `density` and `pressure`.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Fluid {
    /// Body that flows; may be left out when there is only one.
    #[serde(default)]
    pub body: Option<String>,
    /// Whether points move, and whether they change neighbours.
    #[serde(default)]
    pub description: Description,
    /// Horizon in spacings of each point, or `{ length = ... }` in m.
    #[serde(default = "usual_horizon")]
    pub horizon: Horizon,
    /// Partial volume of neighbours at the edge of the horizon.
    #[serde(default)]
    pub partial_volume: PartialVolume,
    /// Where the pressure comes from.
    pub state: State,
    /// Viscous stress.
    #[serde(default)]
    pub stress: Stress,
    /// Order in which a step does things.
    #[serde(default)]
    pub scheme: Scheme,
    /// Diffusion of density, as a share of spacing times speed of sound, such as 0.05: smooths the
    /// pressure, at the cost of an error of second order in pressure gradients that change.
    #[serde(default)]
    pub density_diffusion: f64,
    /// How far points of an updated Lagrangian fluid are moved from where they crowd, as a share of the way
    /// that the fastest one goes, such as 0.05 (Gao (2020), eqs. 6.46 to 6.50; corrected, see spec 05, E23).
    /// The fields stay with the points: an error of the order of the shift.
    #[serde(default)]
    pub shifting: f64,
    /// Accelerations grow smoothly from zero during this time, s (Gao (2020), eq. 5.110).
    #[serde(default)]
    pub startup: f64,
    /// Temperature flows along: conduction, convection, sources; the fluid then owns `temperature`.
    #[serde(default)]
    pub energy: Option<Energy>,
    /// Step in s, or "auto".
    #[serde(default)]
    pub step: StepSize,
    #[serde(skip)]
    #[schemars(skip)]
    run: Option<Run>,
}

fn usual_horizon() -> Horizon {
    Horizon::Spacings(3.015)
}

/// Whether points move, and whether they change neighbours.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Description {
    /// With the fluid; families are those of the points where they are.
    #[default]
    UpdatedLagrangian,

    /// With the fluid; families stay those of the reference configuration.
    TotalLagrangian,
    /// Not at all.
    Eulerian,
}

/// Where the pressure comes from.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum State {
    /// From the density.
    Tait(Tait),
    /// From the rate of compression, `Dp/Dt = -K div v` (Gao (2020), eqs. 5.40, 5.82).
    Rate {
        /// Bulk modulus K, Pa.
        bulk_modulus: f64,
    },
}

/// `p = B ((rho/rho0)^gamma - 1) + p0`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Tait {
    /// Speed of sound c, m/s: ten times the largest speed, and more where walls or weight make pressure.
    pub sound_speed: f64,
    /// Exponent gamma: 7 for liquids, 1 for gases.
    #[serde(default = "seven")]
    pub exponent: f64,
    /// Pressure at the reference density, Pa.
    #[serde(default)]
    pub background: f64,
}

fn seven() -> f64 {
    7.0
}

/// Viscous stress.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Stress {
    /// That of a flow without divergence.
    #[default]
    Incompressible,
    /// With `mu/3 grad div v`.
    Compressible,
}

/// Order in which a step does things; all but `published` keep sound waves at their size (spec 05, 1.5).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Scheme {
    /// New density and pressure, then the velocity from them.
    #[default]
    Symplectic,
    /// Velocity by half a step before and after the density: second order for sound, twice the work.
    KickDriftKick,
    /// Velocity from the pressure before the step, as printed (eq. 5.83): sound waves grow unless viscosity
    /// damps them.
    Published,
}

/// How temperature flows along.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Energy {
    /// Viscous friction heats the fluid.
    #[serde(default)]
    pub dissipation: bool,
}

#[derive(Debug)]
struct Run {
    body: BodyIndex,
    velocity: Write<Vector3<f64>>,
    density: Write<f64>,
    pressure: Write<f64>,
    displacement: Option<Write<Vector3<f64>>>,
    body_force: Option<Read<Vector3<f64>>>,
    heat: Option<Heat>,
    velocity_layers: LayersHandle,
    flow: Flow,
    moving: Option<Moving>,
    initial_mass: f64,
}

/// Points of an updated Lagrangian fluid.
#[derive(Debug)]
struct Moving {
    /// kg.
    mass: Vec<f64>,
    /// Now, m.
    position: Vec<Vector3<f64>>,
    /// Now, m³.
    volume: Vec<f64>,
}

/// Fields of the energy equation.
#[derive(Debug)]
struct Heat {
    temperature: Write<f64>,
    enthalpy: Write<f64>,
    source: Option<Read<f64>>,
    layers: LayersHandle,
    curves: Vec<EnthalpyCurve>,
    faces: Vec<HeatedFace>,
}

/// A face that exchanges heat.
#[derive(Debug)]
struct HeatedFace {
    face: Face,
    /// Point at the face, the next one behind it, and area of the cell face, m².
    cells: Vec<(u32, u32, f64)>,
    /// Heat that enters, W.
    inflow: f64,
}

impl HeatedFace {
    fn of(body: &Body, face: Face) -> HeatedFace {
        let opposite = Face::ALL[face as usize ^ 1];
        let cell = |cell: SurfaceCell| {
            let next = body.neighbour(cell.point as usize, opposite)?;
            Some((cell.point, next as u32, cell.area))
        };
        HeatedFace {
            face,
            cells: body.surface(&[face]).into_iter().filter_map(cell).collect(),
            inflow: 0.0,
        }
    }

    /// Heat that enters at the slope of a parabola through the wall and the two points before it, W.
    fn measure(
        &mut self,
        rule: &LayerRule,
        temperature: &[f64],
        conductivity: &[f64],
        spacing: &[f64],
    ) {
        let (scale, offset) = (rule.scale[0], rule.offset[0]);
        // an even layer insulates
        let wall = offset / (1.0 - scale);
        self.inflow = match scale == 1.0 {
            true => 0.0,
            false => self.cells.iter().fold(0.0, |sum, &(first, next, area)| {
                let [first, next] = [first, next].map(|p| p as usize);
                let slope = (3.0 * temperature[first] - (temperature[next] + 8.0 * wall) / 3.0)
                    / spacing[first];
                sum - conductivity[first] * slope * area
            }),
        };
    }
}

impl State {
    fn check(&self) -> Result<(), SetupError> {
        let (key, value) = match self {
            State::Tait(tait) if tait.exponent.is_nan() || tait.exponent <= 0.0 => {
                ("state.tait.exponent", tait.exponent)
            }
            State::Tait(tait) => ("state.tait.sound_speed", tait.sound_speed),
            State::Rate { bulk_modulus } => ("state.rate.bulk_modulus", *bulk_modulus),
        };
        if value.is_finite() && value > 0.0 {
            return Ok(());
        }
        Err(SetupError::value(
            key,
            format!("{value} is not above zero"),
            "a positive number",
        ))
    }
}

/// Faces that need a wall and have none.
fn bare_face(setup: &Setup<'_>, body: BodyIndex, walls: &[Face]) -> Option<Face> {
    let this = setup.body(body);
    let bare =
        |f: &Face| f.axis() < this.dimension && !this.periodic[f.axis()] && !walls.contains(f);
    Face::ALL.into_iter().find(bare)
}

#[typetag::serde(name = "fluid")]
impl Physics for Fluid {
    fn prepare(&mut self, setup: &mut Setup<'_>) -> Result<(), SetupError> {
        let body = setup.find_body(self.body.as_deref())?;
        self.horizon.check(setup.body(body))?;
        self.state.check()?;
        for (key, value) in [
            ("density_diffusion", self.density_diffusion),
            ("startup", self.startup),
            ("shifting", self.shifting),
        ] {
            if !(value.is_finite() && value >= 0.0) {
                let message = format!("{value} is below zero");
                return Err(SetupError::value(key, message, "zero or above"));
            }
        }
        if setup.body(body).dimension == 1 {
            return Err(SetupError::value(
                "body",
                "a 1D body cannot flow",
                "a 2D or 3D body",
            ));
        }
        if !setup.body(body).fills_box() {
            let message = "the body does not fill its box";
            return Err(SetupError::value(
                "body",
                message,
                "a box: walls are its faces",
            ));
        }
        let velocity = setup.own(body, &keys::VELOCITY)?;
        let (velocity_layers, walls, _) = setup.layers(body, &keys::VELOCITY);
        if let Some(face) = bare_face(setup, body, &walls) {
            let message = format!("nothing is said of face `{}` of the body", face.name());
            let expected =
                "a `wall` or `symmetry` there, or a body that is `periodic` along that axis";
            return Err(SetupError::value("body", message, expected));
        }
        let spec = FamilySpec {
            partial_volume: self.partial_volume,
            layers: walls,
            ..Pddo::spec(self.horizon)
        };
        let updated = self.description == Description::UpdatedLagrangian;
        let family = match updated {
            true => {
                let family = Family::moving(setup.body(body), &spec);
                Arc::new(family.map_err(|e| SetupError::other("horizon", e))?)
            }
            false => setup.family(body, &spec)?,
        };
        let (temperature_layers, _, heated) = setup.layers(body, &keys::TEMPERATURE);
        let heat = match &self.energy {
            Some(_) => Some(Heat {
                faces: heated
                    .iter()
                    .map(|face| HeatedFace::of(setup.body(body), *face))
                    .collect(),
                temperature: setup.own(body, &keys::TEMPERATURE)?,
                enthalpy: setup.own(body, &keys::ENTHALPY)?,
                source: setup.consume_if_added(body, &keys::HEAT_SOURCE)?,
                layers: temperature_layers,
                curves: setup.enthalpy_curves(body)?,
            }),
            None => None,
        };
        let conductivity: Vec<Property> = match heat {
            Some(_) => setup.property(body, "conductivity")?,
            None => Vec::new(),
        };
        let viscosity = setup.property(body, "viscosity")?;
        if heat.is_none() && viscosity.iter().any(|v| !v.is_constant()) {
            let message = "the viscosity depends on temperature, which the fluid does not have";
            return Err(SetupError::value(
                "energy",
                message,
                "`energy = {}`, or a constant viscosity",
            ));
        }
        let this = setup.body(body);

        let properties = Properties {
            reference_density: setup.density_at_points(body)?,
            viscosity,
            conductivity,
        };
        let pddo = Pddo::build(this, family, 2).map_err(|e| SetupError::other("horizon", e))?;
        let spacing = this.points.spacing.clone();
        let lagrangian = self.description != Description::Eulerian;
        let moving = updated.then(|| Moving {
            mass: this.points.volume.clone(),
            position: this.points.position.clone(),
            volume: this.points.volume.clone(),
        });
        self.run = Some(Run {
            body,
            velocity,
            density: setup.own(body, &keys::DENSITY)?,
            pressure: setup.own(body, &keys::PRESSURE)?,
            displacement: match lagrangian {
                true => Some(setup.own(body, &keys::DISPLACEMENT)?),
                false => None,
            },
            body_force: setup.consume_if_added(body, &keys::BODY_FORCE)?,
            heat,
            velocity_layers,
            flow: Flow::new(pddo, properties, spacing),
            moving,
            initial_mass: 0.0,
        });
        Ok(())
    }

    /// Density from the pressure at the start, enthalpy from the temperature.
    fn start(&mut self, world: &World) -> Result<(), RunError> {
        let run = self.run.as_mut().expect("prepared before the start");
        let pressure = world.read(run.pressure.into());
        let mut density = world.write(run.density);
        let reference = &run.flow.properties.reference_density;
        for ((rho, &p), &rho0) in density.iter_mut().zip(&*pressure).zip(reference) {
            *rho = self.state.density(p, rho0);
        }
        if let Some(heat) = &run.heat {
            let temperature = world.read(heat.temperature.into());
            let material = &world.body(run.body).material_of_point;
            let mut enthalpy = world.write(heat.enthalpy);
            for ((h, &t), &m) in enthalpy.iter_mut().zip(&*temperature).zip(material) {
                *h = heat.curves[m as usize].enthalpy(t);
            }
        }
        if let Some(moving) = &mut run.moving {
            let points = moving.mass.iter_mut().zip(&*density).zip(&moving.volume);
            points.for_each(|((m, rho), v)| *m = rho * v);
        }
        drop(density);
        run.initial_mass = run.mass(world);
        run.follow(world).map_err(|cause| RunError::Plugin {
            plugin: "fluid".into(),
            time: 0.0,
            cause: cause.into(),
        })
    }

    fn clock(&self) -> Clock {
        Clock {
            step: self.step,
            ..Clock::default()
        }
    }

    /// Where sound, viscosity and conduction are stable (spec 05, 1.10), for speeds up to a tenth of that of
    /// sound.
    fn stable_step(&mut self, world: &World) -> Option<f64> {
        let run = self.run.as_mut().expect("prepared before the start");
        let capacity = match &run.heat {
            Some(heat) => heat.curves.iter().map(|c| c.minimum_capacity()).collect(),
            None => Vec::new(),
        };
        let material = &world.body(run.body).material_of_point;
        let eulerian = self.description == Description::Eulerian;
        Some(
            run.flow
                .stable_step(&self.state, (material, &capacity), eulerian),
        )
    }

    fn plausible(&self, _world: &World) -> Vec<(&'static str, f64)> {
        let run = self.run.as_ref().expect("prepared before the start");
        let reference = &run.flow.properties.reference_density;
        let lightest = reference.iter().copied().fold(f64::INFINITY, f64::min);
        let heaviest = reference.iter().copied().fold(0.0, f64::max);
        vec![
            ("velocity", 10.0 * self.state.sound_speed(lightest)),
            ("density", 10.0 * heaviest),
        ]
    }

    fn advance(&mut self, world: &World, step: Step) -> Result<Work, RunError> {
        let Fluid { run, .. } = self;
        let mut run = run.take().expect("prepared before the first step");
        let done = run.advance(self, world, step);
        self.run = Some(run);
        done.map_err(|cause| RunError::Plugin {
            plugin: "fluid".into(),
            time: step.end(),
            cause: cause.into(),
        })?;
        Ok(Work::of_stages(1))
    }

    fn balance(&self, world: &World) -> Vec<Balance> {
        let run = self.run.as_ref().expect("prepared before the first step");
        vec![Balance::new(
            "mass",
            "kg",
            run.mass(world),
            run.initial_mass,
            0.0,
        )]
    }

    fn report(&self) -> Vec<Report> {
        let run = self.run.as_ref().expect("prepared before the first step");
        let report = |name: &str, unit: &str, value: f64| Report {
            name: name.into(),
            unit: unit.into(),
            value,
        };
        let mut all = vec![
            report("energy.kinetic", "J", run.flow.kinetic_energy),
            report("density.deviation", "1", run.flow.density_deviation),
        ];
        let faces = run.heat.iter().flat_map(|h| &h.faces);
        all.extend(faces.map(|f| report(&format!("heat.{}", f.face.name()), "W", f.inflow)));
        all
    }

    fn observe(&mut self, world: &World) {
        let run = self.run.as_mut().expect("prepared before the first step");
        let (velocity, density) = (
            world.read(run.velocity.into()),
            world.read::<f64>(run.density.into()),
        );
        let volume = &world.body(run.body).points.volume;
        let square: Vec<f64> = velocity.iter().map(Vector3::norm_squared).collect();
        run.flow.kinetic_energy = sum_of([&square, &density, volume], |[v2, rho, volume]| {
            0.5 * v2 * rho * volume
        });
        let reference = &run.flow.properties.reference_density;
        let deviation = density
            .iter()
            .zip(reference)
            .map(|(rho, rho0)| (rho / rho0 - 1.0).abs());
        run.flow.density_deviation = deviation.fold(0.0, f64::max);
        if let Some(heat) = &mut run.heat {
            let temperature = world.read::<f64>(heat.temperature.into());
            let rules = world.layer_rules(heat.layers);
            let body = world.body(run.body);
            let conductivity =
                run.flow
                    .conductivity(&temperature, &body.material_of_point, &heat.curves);
            for face in &mut heat.faces {
                if let Some(rule) = rules.iter().find(|r| r.face == face.face) {
                    face.measure(rule, &temperature, conductivity, &body.points.spacing);
                }
            }
        }
    }

    fn save(&self) -> Box<dyn erased_serde::Serialize + '_> {
        let run = self.run.as_ref().expect("prepared before a save");
        let moving = run
            .moving
            .as_ref()
            .map(|m| (&m.mass, run.flow.looked_from()));
        Box::new((run.initial_mass, moving))
    }

    fn load(
        &mut self,
        state: &mut dyn erased_serde::Deserializer<'_>,
    ) -> Result<(), erased_serde::Error> {
        let run = self.run.as_mut().expect("prepared before a restart");
        let moving: Option<(Vec<f64>, Vec<Vector3<f64>>)>;
        (run.initial_mass, moving) = erased_serde::deserialize(state)?;
        if let (Some(own), Some((mass, looked_from))) = (&mut run.moving, moving) {
            own.mass = mass;
            run.flow.look_from(&looked_from);
        }
        Ok(())
    }

    fn restored(&mut self, world: &World) {
        let run = self.run.as_mut().expect("prepared before a restart");
        // the operator was found before the state was saved
        let _ = run.follow(world);
    }
}

perimelt_core::register_physics!("fluid", Fluid);

impl Run {
    /// Mass, kg: of points that keep theirs, or in the reference volumes. There, of a total Lagrangian fluid, it
    /// shows how far densities drift from the change of volumes.
    fn mass(&self, world: &World) -> f64 {
        if let Some(moving) = &self.moving {
            return sum_of([&moving.mass], |[m]| m);
        }
        let density = world.read::<f64>(self.density.into());
        sum_of(
            [&density, &world.body(self.body).points.volume],
            |[rho, v]| rho * v,
        )
    }

    /// Finds families and operators where the points are.
    fn follow(&mut self, world: &World) -> Result<(), PddoError> {
        let (Some(moving), Some(displacement)) = (&mut self.moving, self.displacement) else {
            return Ok(());
        };
        let reference = &world.body(self.body).points.position;
        let displacement = world.read::<Vector3<f64>>(displacement.into());
        let density = world.read::<f64>(self.density.into());
        let points = moving
            .position
            .iter_mut()
            .zip(reference)
            .zip(&*displacement);
        points.for_each(|((x, start), u)| *x = start + u);
        let volumes = moving.volume.iter_mut().zip(&moving.mass).zip(&*density);
        volumes.for_each(|((v, m), rho)| *v = m / rho);
        self.flow.follow(&moving.position, &moving.volume)
    }

    fn advance(&mut self, fluid: &Fluid, world: &World, step: Step) -> Result<(), PddoError> {
        let flow = &mut self.flow;
        let material = &world.body(self.body).material_of_point;
        let (mut velocity, mut density) = (world.write(self.velocity), world.write(self.density));
        let mut pressure = world.write(self.pressure);
        let force = self.body_force.map(|f| world.read(f));
        let force = force.as_deref();
        let rules = world.layer_rules(self.velocity_layers);
        let eulerian = fluid.description == Description::Eulerian;
        let dt = step.size;
        let drift = Drift {
            state: &fluid.state,
            diffusion: fluid.density_diffusion,
            eulerian,
            force,
        };
        let kick = Kick {
            compressible: fluid.stress == Stress::Compressible,
            eulerian,
            share: startup(fluid.startup, step.middle()),
            force,
        };

        if let Some(heat) = &self.heat {
            let rules = world.layer_rules(heat.layers);
            let temperature = world.read(heat.temperature.into());
            flow.derive_temperature(&temperature, &rules, material, &heat.curves);
        }
        flow.load_velocity(&velocity, &rules);
        flow.derive_velocity();
        if let Some(heat) = &self.heat {
            let source = heat.source.map(|s| world.read(s));
            let dissipates = fluid.energy.is_some_and(|e| e.dissipation);
            let (mut temperature, mut enthalpy) =
                (world.write(heat.temperature), world.write(heat.enthalpy));
            let warming = Warming {
                carried_by: eulerian.then_some(&*velocity),
                source: source.as_deref(),
                dissipates,
                temperature: &temperature,
                material,
                curves: &heat.curves,
            };
            flow.heat(&warming, dt, &mut enthalpy);
            for ((t, h), &m) in temperature.iter_mut().zip(&*enthalpy).zip(material) {
                *t = heat.curves[m as usize].temperature(*h);
            }
        }
        match fluid.scheme {
            Scheme::Symplectic => {
                flow.drift(&drift, dt, (&mut density, &mut pressure), &velocity);
                flow.derive_pressure(&pressure, force);
                flow.kick(&kick, dt, &mut velocity, &density);
            }
            Scheme::Published => {
                flow.derive_pressure(&pressure, force);
                flow.drift(&drift, dt, (&mut density, &mut pressure), &velocity);
                flow.kick(&kick, dt, &mut velocity, &density);
            }
            Scheme::KickDriftKick => {
                flow.derive_pressure(&pressure, force);
                flow.kick(&kick, 0.5 * dt, &mut velocity, &density);
                flow.load_velocity(&velocity, &rules);
                flow.derive_velocity();
                flow.drift(&drift, dt, (&mut density, &mut pressure), &velocity);
                flow.derive_pressure(&pressure, force);
                flow.kick(&kick, 0.5 * dt, &mut velocity, &density);
            }
        }
        if let Some(displacement) = self.displacement {
            let mut displacement = world.write(displacement);
            displacement
                .iter_mut()
                .zip(&*velocity)
                .for_each(|(u, v)| *u += dt * v);
            if self.moving.is_some() {
                if fluid.shifting > 0.0 {
                    flow.shift(fluid.shifting * dt, &velocity, &mut displacement);
                }
                keep_inside(world.body(self.body), &mut displacement, &mut velocity);
            }
        }
        drop((velocity, density, pressure));
        self.follow(world)
    }
}

/// Puts points that left the box of their body back: at the other side where it is periodic, else as reflected.
fn keep_inside(body: &Body, displacement: &mut [Vector3<f64>], velocity: &mut [Vector3<f64>]) {
    let (low, high) = body.bounds();
    let points = displacement
        .iter_mut()
        .zip(velocity)
        .zip(&body.points.position);
    for ((u, v), start) in points {
        for axis in 0..body.dimension {
            let x = start[axis] + u[axis];
            let beyond = (x - high[axis]).max(0.0) + (x - low[axis]).min(0.0);
            if beyond == 0.0 {
                continue;
            }
            if body.periodic[axis] {
                u[axis] -= beyond.signum() * (high[axis] - low[axis]);
            } else {
                u[axis] -= 2.0 * beyond;
                if v[axis] * beyond > 0.0 {
                    v[axis] = -v[axis];
                }
            }
        }
    }
}

/// What the density changes by.
struct Drift<'a> {
    state: &'a State,
    diffusion: f64,
    eulerian: bool,
    force: Option<&'a [Vector3<f64>]>,
}

/// What the enthalpy changes by.
struct Warming<'a> {
    /// In an Eulerian description.
    carried_by: Option<&'a [Vector3<f64>]>,
    /// W/m³.
    source: Option<&'a [f64]>,
    /// Friction heats.
    dissipates: bool,
    temperature: &'a [f64],
    material: &'a [u16],
    curves: &'a [EnthalpyCurve],
}

/// What the velocity changes by.
struct Kick<'a> {
    compressible: bool,
    eulerian: bool,
    /// Share of the acceleration that counts.
    share: f64,
    force: Option<&'a [Vector3<f64>]>,
}

/// Share of the acceleration at a time, s (Gao (2020), eq. 5.110).
fn startup(duration: f64, time: f64) -> f64 {
    if time >= duration {
        return 1.0;
    }
    0.5 * (((time / duration - 0.5) * std::f64::consts::PI).sin() + 1.0)
}

/// Whole exponents, the usual ones, by multiplication.
fn power(base: f64, exponent: f64) -> f64 {
    match exponent {
        1.0 => base,
        7.0 => base.powi(7),
        _ => base.powf(exponent),
    }
}

impl State {
    /// Pressure after the density went from `before` to `after` (kg/m³), Pa.
    fn pressure(&self, (before, after): (f64, f64), pressure: f64, reference: f64) -> f64 {
        match self {
            State::Tait(t) => {
                let stiffness = reference * t.sound_speed.powi(2) / t.exponent;
                stiffness * (power(after / reference, t.exponent) - 1.0) + t.background
            }
            State::Rate { bulk_modulus } => pressure + bulk_modulus * (after / before - 1.0),
        }
    }

    /// Density at a pressure, kg/m³.
    fn density(&self, pressure: f64, reference: f64) -> f64 {
        match self {
            State::Tait(t) => {
                let stiffness = reference * t.sound_speed.powi(2) / t.exponent;
                reference * ((pressure - t.background) / stiffness + 1.0).powf(1.0 / t.exponent)
            }
            State::Rate { bulk_modulus } => reference * (1.0 + pressure / bulk_modulus),
        }
    }

    /// Speed of sound, m/s.
    fn sound_speed(&self, density: f64) -> f64 {
        match self {
            State::Tait(tait) => tait.sound_speed,
            State::Rate { bulk_modulus } => (bulk_modulus / density).sqrt(),
        }
    }
}
