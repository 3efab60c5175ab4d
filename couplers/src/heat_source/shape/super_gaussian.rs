//! Super-Gaussian beam of order k: `q = A P k 4^(1/k) / (2 pi w² Gamma(2/k)) exp(-2 (r/w)^k)`
//! (W/m²), A the absorptivity; k = 2 is a Gaussian beam with the 1/e² radius w, large k a top hat.
//! Below the surface the power falls with depth by one of the profiles of [`Penetration`].

use perimelt_core::{Setup, SetupError, flattened};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::beam::Beam;
use super::profile::{DepthProfile, Footprint};
use super::{
    Absorber, CellGrid, CellSampling, ColumnBeam, HeatedSurface, PowerDensity, SourceShape,
};
use perimelt_core::numbers::{check_fraction, check_positive, check_within};
use perimelt_core::world::TwoFluids;

/// Wavelengths at which absorptivities of materials hold, m: fibre, disc, Nd:YAG and diode lasers.
const TABULATED: std::ops::RangeInclusive<f64> = 0.8e-6..=1.2e-6;

flattened! {
    /// A laser beam with an adjustable edge.
    #[derive(Debug, Clone, PartialEq)]
    pub struct SuperGaussian {
        ..sampled: CellSampling,
        /// Power of the laser where the toolpath gives none (W).
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("minimum" = 0))]
        pub power: Option<f64>,
        /// Part of the laser power that is absorbed, 0 to 1; default that of the material. Values of the library are those of
        /// flat metal near 1 um; powder and a vapour depression absorb more.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("minimum" = 0, "maximum" = 1))]
        pub absorptivity: Option<f64>,
        /// Wavelength of the laser (m): where it is not near 1 um (fibre, disc, diode), `absorptivity` must be given.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("exclusiveMinimum" = 0))]
        pub wavelength: Option<f64>,
        /// w, radius at which the flux is exp(-2) of its peak (m).
        #[schemars(extend("exclusiveMinimum" = 0))]
        pub radius: f64,
        /// k, 1 to 50: 2 is a Gaussian, large values approach a top hat; default 2.
        #[serde(default = "gaussian_order")]
        #[schemars(extend("minimum" = 1, "maximum" = 50))]
        pub order: f64,
        /// l, depth (m) with the meaning that `penetration` gives it. A 2D plate absorbs all power through its thickness. Only a beam
        /// that an interface or a keyhole absorbs has none.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("exclusiveMinimum" = 0))]
        pub penetration_depth: Option<f64>,
        /// How the power falls with depth, at the same total: `uniform` down to l; `linear` to zero at l; `gaussian`,
        /// exp(-2 (zeta/l)^2), as `radius` across the beam and as in other codes; `exponential`, exp(-zeta/l), the law of Beer
        /// and Lambert. Power deeper than l: none, none, 5 %, 37 %. Mean depth: 0.5, 0.33, 0.4 and 1 l. `interface`: where the beam meets
        /// the first of two fluids (`fluids` of `fluid`); `keyhole`: in cells below the boiling temperature, so that a cavity of boiling cells
        /// deepens until conduction takes the power; both without `penetration_depth`. Default `exponential`.
        #[serde(default)]
        pub penetration: Penetration,
        /// Whether a depression or a keyhole absorbs what its walls reflect: the absorptivity is then A/(A + (1 - A) s/S), with
        /// the area s of its opening and S of its wall below the level of the toolpath. Only with `penetration = "interface"` or
        /// `"keyhole"`; default no.
        #[serde(default, skip_serializing_if = "std::ops::Not::not")]
        pub reflections: bool,
    }
}

/// How absorbed power falls with depth.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Penetration {
    /// `exp(-zeta/l)/l`, the law of Beer and Lambert: 37 % of the power passes l.
    #[default]
    Exponential,
    /// `1/l` down to l.
    Uniform,
    /// `4/(l sqrt(2 pi)) exp(-2 zeta^2/l^2)`: l as the radius of a Gaussian beam; 5 % of the power passes l.
    Gaussian,
    /// `2/l (1 - zeta/l)` down to l, as in a keyhole whose wall absorbs less with depth.
    Linear,
    /// At the interface of two fluids, in the first one, column by column along the beam.
    Interface,
    /// In cells that do not boil yet, column by column along the beam.
    Keyhole,
}

fn gaussian_order() -> f64 {
    2.0
}

impl SuperGaussian {
    /// The depth that the beam heats, m.
    fn depth(&self) -> Result<f64, SetupError> {
        match self.penetration_depth {
            Some(depth) => check_positive("penetration_depth", depth, "m"),
            None => {
                let message = "the depth that the beam heats is missing";
                let expected = "`penetration_depth` in m, or `penetration = \"keyhole\"`, or \
                                `\"interface\"` between two fluids";
                Err(SetupError::value("penetration_depth", message, expected))
            }
        }
    }

    /// The beam as one that is absorbed column by column.
    fn columns(
        &self,
        absorber: Absorber,
        footprint: Footprint,
        grid: &CellGrid,
    ) -> Result<PowerDensity, SetupError> {
        if grid.is_thickness(self.sampled.heated_surface.face.axis()) {
            let message = match absorber {
                Absorber::Interface => {
                    "a plate (2D) has no depth in which the beam could meet an interface"
                }
                Absorber::Keyhole => "a plate (2D) has no depth in which a keyhole could grow",
            };
            let expected = "a 3D body, or `heated_surface.face` in the plane";
            return Err(SetupError::value("penetration", message, expected));
        }
        if self.penetration_depth.is_some() {
            let message = "a beam that an interface or a keyhole absorbs has no depth";
            let expected = "no `penetration_depth`, or another `penetration`";
            return Err(SetupError::value("penetration_depth", message, expected));
        }
        Ok(PowerDensity::Columns(ColumnBeam {
            footprint,
            sampled: self.sampled.clone(),
            absorber,
            reflecting: self.reflections.then(|| self.absorptivity.unwrap_or(1.0)),
            widest_key: "radius",
        }))
    }
}

impl SourceShape for SuperGaussian {
    fn power(&self) -> Option<f64> {
        self.power
    }

    fn efficiency(&self) -> f64 {
        self.absorptivity.unwrap_or(1.0)
    }

    fn length(&self) -> f64 {
        self.radius
    }

    fn surface(&self) -> HeatedSurface {
        self.sampled.heated_surface
    }

    fn absorber(&self) -> Option<Absorber> {
        match self.penetration {
            Penetration::Interface => Some(Absorber::Interface),
            Penetration::Keyhole => Some(Absorber::Keyhole),
            _ => None,
        }
    }

    /// Takes the absorptivity of the material, where the case gives none; at an interface that of the first fluid.
    fn complete(&mut self, setup: &Setup<'_>, body: usize) -> Result<(), SetupError> {
        let fluids = setup.facts::<TwoFluids>(body).next();
        let heats_interface = self.absorber() == Some(Absorber::Interface);
        if fluids.is_none() && heats_interface {
            let name = &setup.body(body).name;
            let message =
                format!("no two fluids flow through body `{name}`, so that it has no interface");
            let expected = "`fluids` of the physics `fluid`, or another `penetration`";
            return Err(SetupError::value("penetration", message, expected));
        }
        if fluids.is_some() && !heats_interface {
            let name = &setup.body(body).name;
            let message =
                format!("two fluids flow through body `{name}`, whose interface absorbs a beam");
            return Err(SetupError::value("penetration", message, "\"interface\""));
        }
        if self.absorptivity.is_some() {
            return Ok(());
        }
        let expected = "`absorptivity` of the source, or of the material";
        let refuse = |message: String| Err(SetupError::value("absorptivity", message, expected));
        if let Some(wavelength) = self.wavelength.filter(|w| !TABULATED.contains(w)) {
            return refuse(format!(
                "the absorptivities of materials hold near 1 um, not at a wavelength of {wavelength} m"
            ));
        }
        let mut found: Option<f64> = None;
        let first = fluids.filter(|_| heats_interface);
        let first = first.and_then(|fluids| fluids.indices(setup.body(body)));
        let materials = setup.body(body).materials.iter().enumerate();
        let absorbing =
            materials.filter(|(m, _)| first.is_none_or(|[first, _]| *m == usize::from(first)));
        for (_, material) in absorbing {
            let Some(value) = material.get("absorptivity").and_then(|p| p.constant()) else {
                let name = material.name();
                return refuse(format!("material `{name}` has no constant `absorptivity`"));
            };
            if found.is_some_and(|f| f != value) {
                return refuse("the materials of the body have different absorptivities".into());
            }
            found = Some(value);
        }
        self.absorptivity = found;
        Ok(())
    }

    fn power_density(&self, grid: &CellGrid) -> Result<PowerDensity, SetupError> {
        check_fraction("absorptivity", self.absorptivity.unwrap_or(1.0))?;
        if let Some(wavelength) = self.wavelength {
            check_positive("wavelength", wavelength, "m")?;
        }
        let radius = check_positive("radius", self.radius, "m")?;
        let order = check_within("order", self.order, 1.0, 50.0)?;
        if self.reflections && self.absorber().is_none() {
            let message = "a beam that is absorbed in depth is not reflected to other walls";
            let expected = "`penetration = \"keyhole\"` or `\"interface\"`, or no `reflections`";
            return Err(SetupError::value("reflections", message, expected));
        }
        let footprint = Footprint::super_gaussian(radius, order);
        let depth = match self.penetration {
            Penetration::Interface => return self.columns(Absorber::Interface, footprint, grid),
            Penetration::Keyhole => return self.columns(Absorber::Keyhole, footprint, grid),
            Penetration::Exponential => DepthProfile::Exponential {
                length: self.depth()?,
            },
            Penetration::Uniform => DepthProfile::Uniform {
                depth: self.depth()?,
            },
            Penetration::Linear => DepthProfile::Linear {
                depth: self.depth()?,
            },
            // exp(-2 zeta²/l²) = exp(-3 zeta²/b²)
            Penetration::Gaussian => DepthProfile::Bell {
                depth: self.depth()? * 1.5_f64.sqrt(),
            },
        };
        Ok(PowerDensity::Beam(Beam {
            footprint,
            depth,
            plate_depth: None,
            sampled: self.sampled.clone(),
            widest_key: "radius",
        }))
    }
}
