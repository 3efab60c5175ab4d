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
//! - *Eulerian*: points stay, convective terms are added (eqs. 5.99 to 5.101; corrected, see spec 05, E7), as
//!   fluxes that keep mass and momentum to rounding (ours), with so much viscosity and conduction where they are
//!   weak that the terms stay stable ([`Convection`]).
//!
//! Every face of the body's box, or of its `tank`, is a `wall`, a plane of `symmetry`, or periodic; in the
//! conservative form it may be open, and the body need not fill it: where it ends its surface is free. Behind
//! walls the pressure goes on with the weight of the fluid (eq. 5.106, by mirror images: second order). The
//! divergence takes mirror images, too, also where the fluid sticks to the wall: nothing flows through.
//!
//! The speed of sound is a number of the method: pressures, also hydrostatic ones, must stay below a
//! hundredth of `rho0 c^2`. The derivatives do not see a pressure that changes sign from point to point;
//! `density_diffusion` removes it.
//!
//! Not for: turbulence, surface tension.

mod conservative;
mod differences;
#[cfg(test)]
mod tests;
mod treatments;

use std::sync::Arc;

use nalgebra::Vector3;
use perimelt_core::body::SurfaceCell;
use perimelt_core::family::{FamilyError, LayerRule};
use perimelt_core::material::{EnthalpyCurve, Property};
use perimelt_core::solver::reduce::{max_abs, sum_of};
use perimelt_core::world::{BodyIndex, LayersHandle};
use perimelt_core::{
    Balance, Body, Clock, Face, Family, FamilySpec, Horizon, Influence, PartialVolume, Pddo,
    PddoError, Physics, Read, Report, RunError, Setup, SetupError, Step, StepSize, Work, World,
    Write, keys,
};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use conservative::Conservative;
use differences::Differences;
use treatments::{CompleteFamily, Treatments};

/// Points that a thread takes at once.
const SHARE: usize = 1024;

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
    /// Influence of neighbours by their distance; when left out, "gaussian" as published, and "wendland" in the
    /// conservative form.
    #[serde(default)]
    pub influence: Option<Influence>,
    /// Where the pressure comes from.
    pub state: State,
    /// How derivatives become sums.
    #[serde(default)]
    pub form: Form,
    /// What a free surface does to the pressure.
    #[serde(default)]
    pub surface: Surface,
    /// Viscous stress.
    #[serde(default)]
    pub stress: Stress,
    /// Order in which a step does things.
    #[serde(default)]
    pub scheme: Scheme,
    /// What the convective terms of an Eulerian fluid add.
    #[serde(default)]
    pub convection: Convection,
    /// Diffusion of density, as a share of spacing times speed of sound, such as 0.05: smooths the
    /// pressure, at the cost of an error of second order in pressure gradients that change.
    #[serde(default)]
    pub density_diffusion: f64,
    /// How fast the density of the conservative form goes towards that of the points, as a share of the speed of
    /// sound over the spacing: keeps the volume over long times. More makes noise where points are in disorder.
    #[serde(default = "slowly")]
    pub volume_relaxation: f64,
    /// How far points of an updated Lagrangian fluid are moved from where they crowd, as a share of the way
    /// that the fastest one goes, such as 0.05, or 0.5 where a lid stirs (Gao (2020), eqs. 6.46 to 6.50; corrected,
    /// see spec 05, E23). The fields stay with the points: an error of the order of the shift.
    #[serde(default)]
    pub shifting: f64,
    /// Part of the way that points of an updated Lagrangian fluid go with the mean velocity around them, from 0
    /// to 1 (XSPH; Gao (2020), eq. 6.53; corrected, see spec 05, E24): keeps them in order; where the velocity
    /// bends they do not quite follow the fluid.
    #[serde(default)]
    pub xsph: f64,
    /// Viscosity between points that approach each other, as a share of 1.2 spacings times the speed of sound,
    /// such as 0.02 (Gao (2020), eq. 6.56; corrected, see spec 05, E26): damps sound and impacts; shear, too,
    /// by about a tenth of it in two dimensions.
    #[serde(default)]
    pub artificial_viscosity: f64,
    /// After how many steps velocity and density are smoothed by moving least squares, such as 20 (Gao (2020),
    /// eqs. 5.111 to 5.114; corrected, see spec 05, E12); 0: never. Linear fields stay; each time is a diffusion
    /// by about a tenth of the squared horizon, and mass is that of the points, not of the densities.
    #[serde(default)]
    pub smoothing: u32,
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

fn slowly() -> f64 {
    1e-4
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

/// How derivatives become sums.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Form {
    /// Derivatives of second order, as published: the most accurate on complete families, but momentum is kept
    /// only as far as they are exact, and families must be complete.
    #[default]
    Differences,
    /// Ours: the divergence of first order and its adjoint, pairwise viscosity. Momentum is kept to rounding,
    /// surfaces may be free. Of the updated Lagrangian description, for points of one spacing.
    Conservative,
}

/// What a free surface does to the pressure.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Surface {
    /// Nothing presses from outside: that is all that the conservative form needs.
    #[default]
    Natural,
    /// Points of the first row have no pressure and the reference density, after Gao (2020), eq. 6.59: what
    /// presses them does no work, so that impacts may blow up.
    ZeroPressure,
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

/// What the convective terms of an Eulerian fluid add.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Convection {
    /// Ours: where the viscosity is below a fifth of speed times spacing it counts as that, and so does the
    /// conductivity over the heat capacity (after the hybrid scheme of Spalding (1972), who takes a half). Short
    /// waves do not grow; first order there.
    #[default]
    Hybrid,
    /// Nothing. Short waves grow where speed times spacing is more than some ten times the viscosity.
    Central,
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
    medium: Medium,
    rates: Box<dyn Rates>,
    /// Of the rates at the start: a restart must come to the same steps.
    stability: Stability,
    treatments: Treatments,
    /// Components of the velocity by slot.
    slots: Vec<Vec<f64>>,
    moving: Option<Moving>,
    steps: u64,
    initial_mass: f64,
    /// Where the box is periodic along all axes: momentum at the start and given by forces since, N s.
    momentum: Option<[Vector3<f64>; 2]>,
    /// J.
    kinetic_energy: f64,
    /// Largest `|rho/rho0 - 1|`.
    density_deviation: f64,
}

/// The fluid and its properties at the temperature that it has.
#[derive(Debug)]
struct Medium {
    state: State,
    /// By point, kg/m³.
    reference_density: Vec<f64>,
    /// By point, m.
    spacing: Vec<f64>,
    /// Pa s.
    viscosity: Coefficient,
    /// W/(m K).
    conductivity: Coefficient,
}

/// A property of the fluid.
#[derive(Debug)]
struct Coefficient {
    /// By material.
    properties: Vec<Property>,
    /// By point.
    value: Vec<f64>,
    /// Whether it differs from point to point.
    varies: bool,
}

impl Coefficient {
    fn new(properties: Vec<Property>, points: usize) -> Self {
        let uniform = Property::common(&properties);
        Coefficient {
            value: vec![uniform.unwrap_or(0.0); points],
            varies: uniform.is_none() && !properties.is_empty(),
            properties,
        }
    }

    fn evaluate(&mut self, temperature: &[f64], material: &[u16], curves: &[EnthalpyCurve]) {
        if !self.varies {
            return;
        }
        let points = self.value.par_iter_mut().zip(temperature).zip(material);
        points.with_min_len(SHARE).for_each(|((value, &t), &m)| {
            let liquid = curves[m as usize].liquid_fraction(t);
            *value = self.properties[m as usize].at(t, liquid);
        });
    }

    /// Takes it to slots; where it does not vary only when their number changed.
    fn load(&self, family: &Family, slots: &mut Vec<f64>) {
        if self.varies || slots.len() != family.slots() {
            load(family, (&self.value, 1), 0, &[], slots);
        }
    }

    /// Largest value that a material can have.
    fn largest(&self, material: u16) -> f64 {
        let property = self.properties.get(material as usize);
        property.map_or(0.0, |p| max_abs(&p.values()))
    }
}

impl Medium {
    /// m/s.
    fn sound_speed(&self, point: usize) -> f64 {
        self.state.sound_speed(self.reference_density[point])
    }

    /// What viscosity over density and diffusivity of heat count as at least where the fluid passes, m²/s.
    fn least_diffusivity(&self, convection: Convection, point: usize, speed: f64) -> f64 {
        match convection {
            Convection::Hybrid => 0.2 * speed * self.spacing[point],
            Convection::Central => 0.0,
        }
    }

    /// Spacing times speed of sound, m²/s.
    fn sound_diffusivity(&self, point: usize) -> f64 {
        self.spacing[point] * self.sound_speed(point)
    }

    /// Length h of Gao (2020), chapter 6: 1.2 spacings, m.
    fn smoothing_length(&self, point: usize) -> f64 {
        1.2 * self.spacing[point]
    }

    /// Pressure of a point whose density went from `before` to `after` (kg/m³), Pa.
    fn pressure(&self, point: usize, densities: (f64, f64), pressure: f64) -> f64 {
        self.state
            .pressure(densities, pressure, self.reference_density[point])
    }
}

/// What a step takes into account.
struct Terms<'a> {
    medium: &'a Medium,
    /// N/m³.
    force: Option<&'a [Vector3<f64>]>,
    density_diffusion: f64,
    volume_relaxation: f64,
    compressible: bool,
    /// Of an Eulerian fluid.
    convection: Option<Convection>,
    /// Share of the acceleration that counts.
    share: f64,
}

impl Terms<'_> {
    /// Along an axis, m/s².
    fn body_acceleration(&self, point: usize, axis: usize) -> f64 {
        let density = self.medium.reference_density[point];
        self.force.map_or(0.0, |f| f[point][axis] / density)
    }

    /// What the weight of the fluid makes of the density along an axis, kg/m⁴.
    fn density_slope(&self, point: usize, axis: usize) -> f64 {
        let sound = self.medium.sound_speed(point);
        self.force.map_or(0.0, |f| f[point][axis] / (sound * sound))
    }

    /// Of density, m²/s.
    fn density_diffusivity(&self, point: usize) -> f64 {
        self.density_diffusion * self.medium.sound_diffusivity(point)
    }
}

/// Fluid that passes points.
#[derive(Clone, Copy)]
struct Passing<'a> {
    convection: Convection,
    velocity: &'a [Vector3<f64>],
    density: &'a [f64],
}

/// What the enthalpy changes by.
struct Heating<'a> {
    /// In an Eulerian description.
    carried_by: Option<Passing<'a>>,
    /// W/m³.
    source: Option<&'a [f64]>,
    /// Friction heats.
    dissipates: bool,
    temperature: &'a [f64],
    material: &'a [u16],
    curves: &'a [EnthalpyCurve],
}

/// What the largest stable step depends on.
#[derive(Clone, Copy, Debug)]
struct Stability {
    /// Largest wave number of the gradient, 1/m.
    wave_number: f64,
    /// Sum of the weights of the Laplacian, 1/m².
    laplacian: f64,
}

/// Rates of the fields in one form of the equations: what they are is seen, then each is advanced by a time dt
/// (s).
trait Rates: std::fmt::Debug {
    /// Over which sums are taken.
    fn family(&self) -> &Family;

    /// Lets points be at these positions (m) with these volumes (m³).
    fn follow(&mut self, positions: &[Vector3<f64>], volumes: &[f64]) -> Result<(), PddoError>;

    /// Looks for neighbours at these positions (m).
    fn look_from(&mut self, positions: &[Vector3<f64>]);

    /// Where they are stable.
    fn stability(&self) -> Stability;

    /// Temperature, and coefficients that depend on it.
    fn see_temperature(&mut self, temperature: &[f64], rules: &[LayerRule], medium: &Medium);

    /// Components of the velocity by slot.
    fn see_velocity(&mut self, velocity: &[Vec<f64>], density: &[f64], terms: &Terms<'_>);

    /// Behind faces the pressure goes on with the weight of the fluid before them.
    fn see_pressure(&mut self, pressure: &[f64], force: Option<&[Vector3<f64>]>);

    /// Advances density and pressure.
    fn drift(&mut self, terms: &Terms<'_>, dt: f64, fields: (&mut [f64], &mut [f64]));

    /// Advances the velocity.
    fn kick(&self, terms: &Terms<'_>, dt: f64, velocity: &mut [Vector3<f64>], density: &[f64]);

    /// Advances the enthalpy.
    fn heat(&mut self, heating: &Heating<'_>, medium: &Medium, dt: f64, enthalpy: &mut [f64]);
}

/// Takes a component of a field to slots; behind faces it goes on by their rules.
fn load(
    family: &Family,
    (field, components): (&[f64], usize),
    component: usize,
    rules: &[LayerRule],
    slots: &mut Vec<f64>,
) {
    slots.resize(family.slots(), 0.0);
    family.scatter(field, components, component, slots);
    family.fill_layers(rules, component, slots);
}

/// Takes a field to slots; behind faces it is mirrored, and `rise(axis, point, distance)` added.
fn load_weighted(
    family: &Family,
    field: &[f64],
    slots: &mut Vec<f64>,
    rise: impl Fn(usize, usize, f64) -> f64,
) {
    slots.resize(family.slots(), 0.0);
    family.scatter(field, 1, 0, slots);
    family.fill_layers_rising(slots, rise);
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
    /// Smallest and largest heat flux into the body, W/m².
    flux: [f64; 2],
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
            flux: [0.0; 2],
        }
    }

    /// Heat that enters at the slope of a parabola through the wall and the two points before it.
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
        if scale == 1.0 || self.cells.is_empty() {
            (self.inflow, self.flux) = (0.0, [0.0; 2]);
            return;
        }
        (self.inflow, self.flux) = (0.0, [f64::INFINITY, f64::NEG_INFINITY]);
        for &(first, next, area) in &self.cells {
            let [first, next] = [first, next].map(|p| p as usize);
            let slope = (3.0 * temperature[first] - (temperature[next] + 8.0 * wall) / 3.0)
                / spacing[first];
            let flux = -conductivity[first] * slope;
            self.inflow += flux * area;
            self.flux = [self.flux[0].min(flux), self.flux[1].max(flux)];
        }
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
            ("volume_relaxation", self.volume_relaxation),
            ("xsph", self.xsph),
            ("artificial_viscosity", self.artificial_viscosity),
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
        let updated = self.description == Description::UpdatedLagrangian;
        self.check_form(setup.body(body))?;
        let velocity = setup.own(body, &keys::VELOCITY)?;
        let (velocity_layers, walls, _) = setup.layers(body, &keys::VELOCITY);
        let may_be_free = self.form == Form::Conservative || self.surface == Surface::ZeroPressure;
        if !may_be_free && !setup.body(body).fills_box() {
            let message = "the body does not fill its box, so that its surface is free";
            let expected = "`form = \"conservative\"`, or a body that fills its box";
            return Err(SetupError::value("form", message, expected));
        }
        if let Some(face) = bare_face(setup, body, &walls).filter(|_| !may_be_free) {
            let message = format!("nothing is said of face `{}` of the body", face.name());
            let expected = "a `wall` or `symmetry` there, a body that is `periodic` along that axis, or `form = \"conservative\"`";
            return Err(SetupError::value("body", message, expected));
        }
        let spec = FamilySpec {
            partial_volume: self.partial_volume,
            influence: self.influence.unwrap_or(match self.form {
                Form::Differences => Influence::Gaussian,
                Form::Conservative => Influence::Wendland,
            }),
            layers: walls,
            ..Pddo::spec(self.horizon)
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
        let mistake = |e: FamilyError| SetupError::other("horizon", e);
        let family = match updated {
            true => Arc::new(Family::moving(setup.body(body), &spec).map_err(mistake)?),
            false => setup.family(body, &spec)?,
        };
        let this = setup.body(body);
        let points = this.points.len();
        let medium = Medium {
            state: self.state,
            reference_density: setup.density_at_points(body)?,
            spacing: this.points.spacing.clone(),
            viscosity: Coefficient::new(viscosity, points),
            conductivity: Coefficient::new(conductivity, points),
        };
        let treatments = Treatments::new(CompleteFamily::of(this, &family), this.dimension);
        let rates: Box<dyn Rates> = match self.form {
            Form::Conservative => {
                let family = Arc::into_inner(family).expect("a moving family has one owner");
                Box::new(Conservative::new(family, this, treatments.complete))
            }
            Form::Differences => {
                let pddo = Pddo::build(this, family, 2);
                Box::new(Differences::new(
                    pddo.map_err(|e| SetupError::other("horizon", e))?,
                ))
            }
        };
        let slots = vec![Vec::new(); this.dimension];
        let is_periodic = this.periodic[..this.dimension] == [true; 3][..this.dimension];
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
            medium,
            stability: rates.stability(),
            rates,
            treatments,
            slots,
            moving,
            steps: 0,
            initial_mass: 0.0,
            momentum: is_periodic.then(Default::default),
            kinetic_energy: 0.0,
            density_deviation: 0.0,
        });
        Ok(())
    }

    /// Density from the pressure at the start, enthalpy from the temperature.
    fn start(&mut self, world: &World) -> Result<(), RunError> {
        let run = self.run.as_mut().expect("prepared before the start");
        let pressure = world.read(run.pressure.into());
        let mut density = world.write(run.density);
        let reference = &run.medium.reference_density;
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
        if run.momentum.is_some() {
            run.momentum = Some([run.momentum_now(world, |v| *v), Vector3::zeros()]);
        }
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
    /// sound: with the frequency `w = kappa c` of sound and the rate `r = 2 S (nu + D)` of viscosity and density
    /// diffusion, a symplectic step is stable for `dt^2 w^2 + 2 dt r < 4`. In an Eulerian fluid (ours) `w` is
    /// `kappa (c + |v|)`, and convection by old values lets sound grow by `kappa^2 c |v| dt^2 / (1 - (w dt/2)^2)^1/2`
    /// a step while it is damped by `kappa^2 (nu + D) dt`.
    fn stable_step(&mut self, world: &World) -> Option<f64> {
        let run = self.run.as_ref().expect("prepared before the start");
        let medium = &run.medium;
        let capacity: Vec<f64> = match &run.heat {
            Some(heat) => heat.curves.iter().map(|c| c.minimum_capacity()).collect(),
            None => Vec::new(),
        };
        let Stability {
            wave_number,
            laplacian,
        } = run.stability;
        let limit = |(i, &m): (usize, &u16)| {
            let sound = medium.sound_speed(i);
            let passing = self.convection().map(|c| (c, 0.1 * sound));
            let speed = passing.map_or(0.0, |(_, speed)| speed);
            let least = passing.map_or(0.0, |(c, speed)| medium.least_diffusivity(c, i, speed));
            let artificial = self.artificial_viscosity * medium.smoothing_length(i) * sound;
            let viscosity = medium.viscosity.largest(m) / medium.reference_density[i] + artificial;
            let damping =
                viscosity.max(least) + self.density_diffusion * medium.sound_diffusivity(i);
            let frequency = wave_number * (sound + speed);
            let rate = 2.0 * laplacian * damping;
            let at_rest = 4.0 / (rate + (rate * rate + 4.0 * frequency * frequency).sqrt());
            // whether it is that fast is a guess, by which no given step is refused
            let guessed = passing.filter(|_| self.step == StepSize::Auto);
            let carried = guessed.map_or(f64::INFINITY, |(_, speed)| {
                let slowly = damping / (sound * speed);
                slowly / (1.0 + (0.5 * frequency * slowly).powi(2)).sqrt()
            });
            let heat = capacity.get(m as usize).map_or(f64::INFINITY, |capacity| {
                let diffusivity = medium.conductivity.largest(m) / capacity;
                1.0 / (laplacian * diffusivity.max(least))
            });
            at_rest.min(carried).min(heat)
        };
        let points = world.body(run.body).material_of_point.iter().enumerate();
        Some(points.map(limit).fold(f64::INFINITY, f64::min))
    }

    fn plausible(&self, _world: &World) -> Vec<(&'static str, f64)> {
        let run = self.run.as_ref().expect("prepared before the start");
        let reference = &run.medium.reference_density;
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
        let mass = Balance::new("mass", "kg", run.mass(world), run.initial_mass, 0.0);
        let mut all = vec![mass.of_size(run.initial_mass)];
        if let Some([initial, given]) = run.momentum {
            let now = run.momentum_now(world, |v| *v);
            let size = run.momentum_now(world, |v| Vector3::repeat(v.norm()));
            for (axis, name) in ["x", "y", "z"].iter().enumerate().take(run.slots.len()) {
                let name = format!("momentum.{name}");
                let balance = Balance::new(&name, "N s", now[axis], initial[axis], given[axis]);
                all.push(balance.of_size(size[axis]));
            }
        }
        all
    }

    fn report(&self) -> Vec<Report> {
        let run = self.run.as_ref().expect("prepared before the first step");
        let report = |name: &str, unit: &str, value: f64| Report {
            name: name.into(),
            unit: unit.into(),
            value,
        };
        let mut all = vec![
            report("energy.kinetic", "J", run.kinetic_energy),
            report("density.deviation", "1", run.density_deviation),
        ];
        let faces = run.heat.iter().flat_map(|h| &h.faces);
        all.extend(faces.flat_map(|f| {
            let ([least, most], face) = (f.flux, f.face.name());
            [
                report(&format!("heat.{face}"), "W", f.inflow),
                report(&format!("heat_flux.{face}.min"), "W/m2", least),
                report(&format!("heat_flux.{face}.max"), "W/m2", most),
            ]
        }));
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
        run.kinetic_energy = sum_of([&square, &density, volume], |[v2, rho, volume]| {
            0.5 * v2 * rho * volume
        });
        let reference = &run.medium.reference_density;
        let deviation = density
            .iter()
            .zip(reference)
            .map(|(rho, rho0)| (rho / rho0 - 1.0).abs());
        run.density_deviation = deviation.fold(0.0, f64::max);
        if let Some(heat) = &mut run.heat {
            let temperature = world.read::<f64>(heat.temperature.into());
            let rules = world.layer_rules(heat.layers);
            let body = world.body(run.body);
            let conductivity = &mut run.medium.conductivity;
            conductivity.evaluate(&temperature, &body.material_of_point, &heat.curves);
            let conductivity = &conductivity.value;
            for face in &mut heat.faces {
                if let Some(rule) = rules.iter().find(|r| r.face == face.face) {
                    face.measure(rule, &temperature, conductivity, &body.points.spacing);
                }
            }
        }
    }

    fn save(&self) -> Box<dyn erased_serde::Serialize + '_> {
        let run = self.run.as_ref().expect("prepared before a save");
        let looked_from = || run.rates.family().looked_from();
        let moving = run.moving.as_ref().map(|m| (&m.mass, looked_from()));
        Box::new((run.initial_mass, run.momentum, run.steps, moving))
    }

    fn load(
        &mut self,
        state: &mut dyn erased_serde::Deserializer<'_>,
    ) -> Result<(), erased_serde::Error> {
        let run = self.run.as_mut().expect("prepared before a restart");
        let moving: Option<(Vec<f64>, Vec<Vector3<f64>>)>;
        (run.initial_mass, run.momentum, run.steps, moving) = erased_serde::deserialize(state)?;
        if let (Some(own), Some((mass, looked_from))) = (&mut run.moving, moving) {
            own.mass = mass;
            run.rates.look_from(&looked_from);
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

impl Fluid {
    /// Of an Eulerian fluid.
    fn convection(&self) -> Option<Convection> {
        (self.description == Description::Eulerian).then_some(self.convection)
    }

    /// Whether the form fits the body and the other keys.
    fn check_form(&self, body: &Body) -> Result<(), SetupError> {
        let updated = self.description == Description::UpdatedLagrangian;
        if self.form == Form::Conservative {
            if !updated {
                let message =
                    "the conservative form is one of points that move and change neighbours";
                let expected = "`description = \"updated_lagrangian\"`";
                return Err(SetupError::value("description", message, expected));
            }
            if self.stress == Stress::Compressible {
                let message = "pairwise viscosity is that of a flow without divergence";
                return Err(SetupError::value(
                    "stress",
                    message,
                    "`stress = \"incompressible\"`",
                ));
            }
            if body.finest_spacing() < body.coarsest_spacing() {
                let message = "points of several spacings do not give each other what they take";
                return Err(SetupError::value("form", message, "points of one spacing"));
            }
        }
        if self.convection != Convection::default() && self.convection().is_none() {
            let message = "nothing passes points that move with the fluid";
            let expected = "`description = \"eulerian\"`";
            return Err(SetupError::value("convection", message, expected));
        }
        let only_moving = [("shifting", self.shifting), ("xsph", self.xsph)];
        match only_moving.into_iter().find(|(_, value)| *value > 0.0) {
            Some((key, _)) if !updated => {
                let message = "points are put in order only where they change neighbours";
                let expected = "`description = \"updated_lagrangian\"`";
                Err(SetupError::value(key, message, expected))
            }
            _ => Ok(()),
        }
    }
}

impl Run {
    /// Sum of mass times `of(velocity)`, N s.
    fn momentum_now(
        &self,
        world: &World,
        of: impl Fn(&Vector3<f64>) -> Vector3<f64>,
    ) -> Vector3<f64> {
        let velocity = world.read::<Vector3<f64>>(self.velocity.into());
        let density = world.read::<f64>(self.density.into());
        let mass = mass_of(&self.moving, world.body(self.body), &density);
        velocity
            .iter()
            .enumerate()
            .map(|(i, v)| mass(i) * of(v))
            .sum()
    }

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
        self.rates.follow(&moving.position, &moving.volume)
    }

    fn advance(&mut self, fluid: &Fluid, world: &World, step: Step) -> Result<(), PddoError> {
        let (medium, rates) = (&mut self.medium, &mut *self.rates);
        let material = &world.body(self.body).material_of_point;
        let (mut velocity, mut density) = (world.write(self.velocity), world.write(self.density));
        let mut pressure = world.write(self.pressure);
        let force = self.body_force.map(|f| world.read(f));
        let force = force.as_deref();
        let rules = world.layer_rules(self.velocity_layers);
        let convection = fluid.convection();
        let dt = step.size;

        if let Some(heat) = &self.heat {
            let temperature = world.read(heat.temperature.into());
            for coefficient in [&mut medium.viscosity, &mut medium.conductivity] {
                coefficient.evaluate(&temperature, material, &heat.curves);
            }
            rates.see_temperature(&temperature, &world.layer_rules(heat.layers), medium);
        }
        let medium = &*medium;
        let terms = Terms {
            medium,
            force,
            density_diffusion: fluid.density_diffusion,
            volume_relaxation: fluid.volume_relaxation,
            compressible: fluid.stress == Stress::Compressible,
            convection,
            share: startup(fluid.startup, step.middle()),
        };
        let treatments = &mut self.treatments;
        let slots = &mut self.slots;
        see_velocity(rates, slots, &rules, (&velocity, &density), &terms);
        if let Some(heat) = &self.heat {
            let source = heat.source.map(|s| world.read(s));
            let (mut temperature, mut enthalpy) =
                (world.write(heat.temperature), world.write(heat.enthalpy));
            let heating = Heating {
                carried_by: convection.map(|convection| Passing {
                    convection,
                    velocity: &velocity,
                    density: &density,
                }),
                source: source.as_deref(),
                dissipates: fluid.energy.is_some_and(|e| e.dissipation),
                temperature: &temperature,
                material,
                curves: &heat.curves,
            };
            rates.heat(&heating, medium, dt, &mut enthalpy);
            for ((t, h), &m) in temperature.iter_mut().zip(&*enthalpy).zip(material) {
                *t = heat.curves[m as usize].temperature(*h);
            }
        }
        // while the density is still that of the volumes
        if fluid.artificial_viscosity > 0.0 {
            let strength = dt * fluid.artificial_viscosity;
            let fields = (&mut velocity[..], &density[..]);
            treatments.brake((rates.family(), medium), strength, slots, fields);
        }
        let (first_kick, last_kick) = match fluid.scheme {
            Scheme::KickDriftKick => (0.5 * dt, 0.5 * dt),
            Scheme::Symplectic | Scheme::Published => (0.0, dt),
        };
        if fluid.scheme != Scheme::Symplectic {
            rates.see_pressure(&pressure, force);
        }
        if first_kick > 0.0 {
            rates.kick(&terms, first_kick, &mut velocity, &density);
            see_velocity(rates, slots, &rules, (&velocity, &density), &terms);
        }
        rates.drift(&terms, dt, (&mut density, &mut pressure));
        if fluid.surface == Surface::ZeroPressure {
            let fields = (&mut density[..], &mut pressure[..]);
            treatments.release((rates.family(), medium), fields);
        }
        if fluid.scheme != Scheme::Published {
            rates.see_pressure(&pressure, force);
        }
        rates.kick(&terms, last_kick, &mut velocity, &density);
        self.steps += 1;
        if fluid.smoothing > 0 && self.steps.is_multiple_of(u64::from(fluid.smoothing)) {
            let volume = match &self.moving {
                Some(moving) => &moving.volume,
                None => &world.body(self.body).points.volume,
            };
            treatments.smooth(
                rates.family(),
                volume,
                &mut velocity,
                &mut density,
                |i, densities| {
                    pressure[i] = medium.pressure(i, densities, pressure[i]);
                },
            );
        }
        if let Some(displacement) = self.displacement {
            let mut displacement = world.write(displacement);
            displacement
                .iter_mut()
                .zip(&*velocity)
                .for_each(|(u, v)| *u += dt * v);
            if self.moving.is_some() {
                if fluid.xsph > 0.0 {
                    treatments.drag(rates.family(), fluid.xsph * dt, slots, &mut displacement);
                }
                if fluid.shifting > 0.0 {
                    let share = fluid.shifting * dt;
                    treatments.shift(
                        (rates.family(), medium),
                        share,
                        &velocity,
                        &mut displacement,
                    );
                }
                let body = world.body(self.body);
                keep_inside(body, &rules, &mut displacement, &mut velocity);
            }
        }
        if let (Some([_, given]), Some(force)) = (&mut self.momentum, force) {
            let mass = mass_of(&self.moving, world.body(self.body), &density);
            for (i, f) in force.iter().enumerate() {
                *given += dt * terms.share * mass(i) / medium.reference_density[i] * f;
            }
        }
        drop((velocity, density, pressure));
        self.follow(world)
    }
}

/// Mass of a point, kg: its own, or that in its reference volume.
fn mass_of(moving: &Option<Moving>, body: &Body, density: &[f64]) -> impl Fn(usize) -> f64 {
    move |point| match moving {
        Some(moving) => moving.mass[point],
        None => density[point] * body.points.volume[point],
    }
}

/// Takes the velocity to slots and lets the rates see it.
fn see_velocity(
    rates: &mut dyn Rates,
    slots: &mut [Vec<f64>],
    rules: &[LayerRule],
    (velocity, density): (&[Vector3<f64>], &[f64]),
    terms: &Terms<'_>,
) {
    let flat = (bytemuck::cast_slice(velocity), 3);
    for (axis, slots) in slots.iter_mut().enumerate() {
        load(rates.family(), flat, axis, rules, slots);
    }
    rates.see_velocity(slots, density, terms);
}

/// Puts points that left through periodic faces or those with a rule back: at the other side, or as reflected.
fn keep_inside(
    body: &Body,
    rules: &[LayerRule],
    displacement: &mut [Vector3<f64>],
    velocity: &mut [Vector3<f64>],
) {
    let is_closed = |face: Face| body.periodic[face.axis()] || rules.iter().any(|r| r.face == face);
    let end = |face: Face| match is_closed(face) {
        true => body.face_position(face),
        false if face.is_upper() => f64::INFINITY,
        false => f64::NEG_INFINITY,
    };
    let [low, high] = [0, 1].map(|side| [0, 1, 2].map(|a| end(Face::ALL[2 * a + side])));
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
