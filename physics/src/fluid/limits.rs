//! Limits of a run: the largest stable step, values that are no longer a flow, and how far walls may move.

use nalgebra::Vector3;
use perimelt_core::{Read, RunError, World, keys};

use super::eulerian::immersed::LARGEST_DISPLACEMENT;
use super::eulerian::point_motion::LEAST_DISTORTION;
use super::eulerian::projection::Projection;
use super::points::Points;
use super::rates::Stability;
use super::run::FluidRun;
use super::step::Cause;
use super::walls::Walls;

/// Largest displacement of a wall along its normal for a fluid that keeps its volume, in spacings.
const RESTING: f64 = 0.01;

/// A wall has left the place that it has for a fluid whose points rest.
#[derive(Debug, thiserror::Error)]
#[error(
    "body `{wall}` moves by {moved:.3e} m along its normal; for an Eulerian fluid walls keep their reference shape, and a \
     displacement may be up to {allowed:.3e} m for body `{fluid}`, half a spacing and a hundredth without sound: choose \
     `description = \"arbitrary_lagrangian_eulerian\"` or `\"updated_lagrangian\"`, or a coarser fluid"
)]
struct WallHasLeft {
    wall: String,
    fluid: String,
    /// m.
    moved: f64,
    /// m.
    allowed: f64,
}

/// Points that follow walls can no longer do so.
#[derive(Debug, thiserror::Error)]
#[error(
    "the points of body `{fluid}` near {place:?} m are distorted until they fold, because the walls that they follow have moved too \
     far: choose `description = \"updated_lagrangian\"`, or keep displacements and rotations of the walls smaller"
)]
struct PointsFold {
    fluid: String,
    /// Reference position, m.
    place: [f64; 3],
}

/// A fraction of the first of two fluids is outside of 0 to 1.
#[derive(Debug, thiserror::Error)]
#[error(
    "the initial `fluid_fraction` is {fraction} at {place:?} m; expected 0 in the second fluid, 1 in the first, and values between \
     them in a layer"
)]
struct FractionOutside {
    fraction: f64,
    /// m.
    place: [f64; 3],
}

/// A fraction differs from that of the material of its point.
#[derive(Debug, thiserror::Error)]
#[error(
    "the initial `fluid_fraction` is {fraction} at {place:?} m, where the material of the point makes it {own}: points that move keep their \
     material; leave `initial.fluid_fraction` out, and choose the fluids by `materials` of regions"
)]
struct FractionOfPoint {
    fraction: f64,
    own: f64,
    /// m.
    place: [f64; 3],
}

/// The density of two fluids is no longer above zero.
#[derive(Debug, thiserror::Error)]
#[error(
    "`fluid_fraction` is {fraction} at {place:?} m, where the density is {density} kg/m3: the layer between the fluids is not \
     resolved; choose a finer spacing, or a start whose layer is `interface.width` spacings thick"
)]
struct LostFluid {
    fraction: f64,
    /// kg/m³.
    density: f64,
    /// m.
    place: [f64; 3],
}

impl FluidRun {
    /// Why the pressure of two fluids cannot be found: where the density is not above zero.
    pub(super) fn find_lost_fluid(&self, world: &World) -> Option<Cause> {
        self.points.projection()?;
        let fraction = world.read::<f64>(self.fields.fraction?.into());
        let density = world.read::<f64>(self.fields.density.into());
        let point = density.iter().position(|rho| !(*rho > 0.0))?;
        Some(Box::new(LostFluid {
            fraction: fraction[point],
            density: density[point],
            place: world.body(self.body).points.position.at(point).into(),
        }))
    }

    /// A point whose velocity or density (`field`), of which the `largest` value is given, is no longer that of a flow.
    pub(super) fn point_beyond_limits(
        &self,
        world: &World,
        field: &str,
        largest: f64,
    ) -> Option<usize> {
        if field == keys::VELOCITY.name {
            let limit = 10.0 * self.medium.largest_sound_speed();
            let velocity: Read<Vector3<f64>> = self.fields.velocity.into();
            return (largest > limit).then(|| world.first_beyond(velocity, limit))?;
        }
        let limit = 10.0 * self.largest_density();
        let is_beyond = field == keys::DENSITY.name && largest > limit;
        let density: Read<f64> = self.fields.density.into();
        is_beyond.then(|| world.first_beyond(density, limit))?
    }

    /// Largest density of the fluid, or of both fluids, at rest, kg/m³.
    fn largest_density(&self) -> f64 {
        match self.points.projection().and_then(|p| p.pair()) {
            Some(pair) => pair.density_of(0.0).max(pair.density_of(1.0)),
            None => (self.medium.reference_density.iter().copied()).fold(0.0, f64::max),
        }
    }

    /// Largest step (s) of a fluid that keeps its volume.
    fn step_of(&self, projection: &Projection, world: &World) -> f64 {
        let velocity = world.read::<Vector3<f64>>(self.fields.velocity.into());
        let (medium, material) = (&self.medium, &world.body(self.body).material_of_point);
        let points = medium.reference_density.iter().zip(material);
        let diffusivity = points.map(|(rho, &m)| medium.viscosity.largest(m) / rho);
        projection.stable_step(&velocity, diffusivity.fold(0.0, f64::max))
    }

    /// Refuses to go on where walls have moved too far for points that rest or follow them.
    pub(super) fn check_walls(&self, world: &World, time: f64) -> Result<(), RunError> {
        let Points::Eulerian(points) = &self.points else {
            return Ok(());
        };
        let fluid = world.body(self.body);
        let failed = |cause: Box<dyn std::error::Error + Send + Sync>| RunError::Plugin {
            plugin: "fluid".into(),
            time,
            cause,
        };
        if let Some(motion) = points.motion() {
            let (least, point) = motion.distortion();
            if least < LEAST_DISTORTION {
                let cause = PointsFold {
                    fluid: fluid.name.clone(),
                    place: fluid.points.position.at(point).into(),
                };
                return Err(failed(cause.into()));
            }
            return Ok(());
        }
        // bonds to walls carry no volume of a fluid that keeps it
        let allowed = match points.projection() {
            Some(_) => RESTING,
            None => LARGEST_DISPLACEMENT,
        };
        match points.walls().and_then(Walls::largest_displacement) {
            Some((moved, wall)) if moved > allowed => {
                let spacing = fluid.finest_spacing();
                let cause = WallHasLeft {
                    wall: wall.into(),
                    fluid: fluid.name.clone(),
                    moved: moved * spacing,
                    allowed: allowed * spacing,
                };
                Err(failed(cause.into()))
            }
            _ => Ok(()),
        }
    }

    /// Refuses a fraction of the first of two fluids outside of 0 to 1.
    pub(super) fn check_fraction(&self, world: &World) -> Result<(), RunError> {
        let Some(fraction) = self.fields.fraction else {
            return Ok(());
        };
        let fraction = world.read::<f64>(fraction.into());
        let body = world.body(self.body);
        let place = |point: usize| body.points.position.at(point).into();
        let cause: Option<Cause> = match (&self.points, self.points.pair()) {
            (Points::Lagrangian(_), Some(pair)) => {
                let own = |point: usize| pair.fraction_of(body.material_of_point[point]);
                let other = (0..fraction.len()).find(|&point| fraction[point] != own(point));
                other.map(|point| {
                    FractionOfPoint {
                        fraction: fraction[point],
                        own: own(point),
                        place: place(point),
                    }
                    .into()
                })
            }
            _ => {
                let outside = fraction.iter().position(|c| !(0.0..=1.0).contains(c));
                outside.map(|point| {
                    FractionOutside {
                        fraction: fraction[point],
                        place: place(point),
                    }
                    .into()
                })
            }
        };
        cause.map_or(Ok(()), |cause| {
            Err(RunError::Plugin {
                plugin: "fluid".into(),
                time: 0.0,
                cause,
            })
        })
    }

    /// Largest step (s) for which sound and viscosity are stable (docs/theory/fluids.md, "Largest step"), for speeds up
    /// to a tenth of that of sound: with the frequency `w = kappa c` of sound and the rate `r = 2 S (nu + D)` of viscosity and
    /// density diffusion, a symplectic step is stable for `dt^2 w^2 + 2 dt r < 4`. In an Eulerian fluid `w` is
    /// `kappa (c + |v|)`; convection in the middle of the step has no limit of its own.
    pub(super) fn find_stable_step(&self, world: &World) -> f64 {
        if let Some(projection) = self.points.projection() {
            return self.step_of(projection, world);
        }
        let (medium, settings) = (&self.medium, self.settings);
        let Stability {
            wave_number,
            laplacian,
        } = self.stability;
        let limit = |(i, &m): (usize, &u16)| {
            let sound = medium.sound_speed(i);
            let passing = self.points.convection().map(|c| (c, 0.1 * sound));
            let speed = passing.map_or(0.0, |(_, speed)| speed);
            let artificial = settings.artificial_viscosity * medium.smoothing_length(i) * sound;
            let largest = medium.viscosity.largest(m) / medium.reference_density[i];
            // short waves lack more where the viscosity is small; their rate is that of the Laplacian squared
            let missing = passing.map_or(0.0, |(c, speed)| {
                2.0 * c.missing_diffusivity(speed, medium.spacing[i], laplacian, 0.0)
            });
            let viscosity = largest + artificial + missing;
            let damping = viscosity + settings.density_diffusion * medium.sound_diffusivity(i);
            let frequency = wave_number * (sound + speed);
            let rate = 2.0 * laplacian * damping;
            4.0 / (rate + (rate * rate + 4.0 * frequency * frequency).sqrt())
        };
        let points = world.body(self.body).material_of_point.iter().enumerate();
        let capillary = match &self.points {
            Points::Lagrangian(points) => {
                let temperature = self.fields.interface_temperature.map(|t| world.read(t));
                points.capillary_step(temperature.as_deref())
            }
            Points::Eulerian(_) => f64::INFINITY,
        };
        points.map(limit).fold(capillary, f64::min)
    }
}
