//! Shapes of heat sources: power densities, deposited on the cells of a body with exact total power.
//!
//! | source | file | density |
//! |---|---|---|
//! | [`Point`] | `point.rs` | the cells around the lattice vertex nearest the source |
//! | [`Gaussian`] | `gaussian.rs` | `exp(-r^2 / 2 sigma^2)`, spread evenly over an effective depth |
//! | [`SemiEllipsoid`] | `ellipsoid.rs` | `exp(-3 xi^2/c^2 - 3 eta^2/a^2 - 3 zeta^2/b^2)` |
//! | [`Goldak`] | `ellipsoid.rs` | `SemiEllipsoid` with different lengths in front and behind |
//! | [`SuperGaussian`] | `super_gaussian.rs` | `exp(-2 (r/w)^k)`, times a choice of depth profiles, or column by column (`column_beam.rs`) |
//! | [`Profile`] | `formula_profile.rs` | a formula in x, y, z and r |
//! | a shape of another crate | | any [`Density`] |
//! | [`PulsedLaser`] | `pulsed.rs` | `exp(-zeta/l)` under a whole face, a pulse in time, no toolpath |
//!
//! A [`Depositor`] adds the [`PowerDensity`] (W/m³) of a [`SourceShape`] to the points of a [`HeatedBody`] and
//! returns a [`Deposit`], the powers to log. The coordinate xi runs along the travel direction, eta across
//! it, and zeta is the depth below the heated face; above the face the density is zero.
//!
//! On a body without a lattice each point receives the integral of the density over its own cell ([`Cells`]).
//!
//! **Power.** The density is averaged over all cells of the lattice that the source reaches, those without
//! material included (below the heated face the lattice continues beyond the body). It is scaled so that
//! these cells together receive the power asked for. Cells with material receive their part; the part of
//! cells without material is reported as `lost`. The power is therefore exact while the source crosses
//! cells, and falls in proportion while it crosses an edge of the body.

mod beam;
mod cells;
mod column_beam;
mod density;
mod deposit;
mod ellipsoid;
mod formula_profile;
mod gaussian;
mod heated_body;
mod point;
mod profile;
mod pulsed;
mod sampled;
mod super_gaussian;
#[cfg(test)]
mod tests;
mod tilted;

pub use beam::Beam;
pub use cells::{Cells, Cover};
pub use column_beam::{Absorber, ColumnBeam};
pub use density::{Density, DensityOnFace};
pub use deposit::{Deposit, Depositor, Depression};
pub use ellipsoid::{Goldak, SemiEllipsoid};
pub use formula_profile::Profile;
pub use gaussian::Gaussian;
pub use heated_body::{CellGrid, GatheredCells, HeatedBody, HeatedSurface};
pub use point::{Dwell, Point};
pub use pulsed::PulsedLaser;
pub use super_gaussian::{Penetration, SuperGaussian};

use perimelt_core::{Setup, SetupError, shared_keys};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The shape of a moving heat source, with its keys in the case file.
pub trait SourceShape: std::fmt::Debug {
    /// Power where the toolpath gives none (W), before the efficiency.
    fn power(&self) -> Option<f64>;

    /// Part of the power that enters the body: arc efficiency or absorptivity.
    fn efficiency(&self) -> f64;

    /// Shortest length on the heated face, m; zero for a point.
    fn length(&self) -> f64;

    /// Heated face.
    fn surface(&self) -> HeatedSurface;

    /// Completes the shape with properties of the materials of the body.
    ///
    /// # Errors
    /// When a property that is needed is missing.
    fn complete(&mut self, _setup: &Setup<'_>, _body: usize) -> Result<(), SetupError> {
        Ok(())
    }

    /// What absorbs a beam that is absorbed column by column.
    fn absorber(&self) -> Option<Absorber> {
        None
    }

    /// The power density on a body with the cells of `grid`.
    ///
    /// # Errors
    /// Keys without a meaning.
    fn power_density(&self, grid: &CellGrid) -> Result<PowerDensity, SetupError>;
}

/// A power density that a [`Depositor`] adds to the points of a body.
#[derive(Debug, Clone)]
pub enum PowerDensity {
    /// All power in the cells around one lattice vertex.
    Point(Point),
    /// A footprint on the heated face times a depth profile, with exact averages of cells.
    Beam(Beam),
    /// A footprint that is absorbed column by column: at an interface, or on the wall of a keyhole.
    Columns(ColumnBeam),
    /// Any density, which is sampled.
    Sampled(DensityOnFace),
}

/// Arc welding processes, with the thermal efficiencies of EN 1011-1 as SSAB quotes them (plasma has that of TIG): the part
/// of current times voltage that heats the joint.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ArcProcess {
    /// Submerged arc (12): 1.0.
    SubmergedArc,
    /// Covered electrode (111): 0.8.
    ManualMetalArc,
    /// Metal with inert gas (131): 0.8.
    Mig,
    /// Metal with active gas, solid or cored wire (135, 136): 0.8.
    Mag,
    /// Tungsten with inert gas (141): 0.6.
    Tig,
    /// Plasma (15): 0.6.
    Plasma,
}

impl ArcProcess {
    /// Part of the electric power that enters the body.
    pub fn efficiency(self) -> f64 {
        match self {
            Self::SubmergedArc => 1.0,
            Self::ManualMetalArc | Self::Mig | Self::Mag => 0.8,
            Self::Tig | Self::Plasma => 0.6,
        }
    }
}

shared_keys! {
    /// The power of a shape and the part of it that enters the body.
    #[derive(Debug, Clone, PartialEq)]
    pub struct ArcPower {
        /// Power where the toolpath gives none (W).
        #[serde(skip_serializing_if = "Option::is_none")]
        #[schemars(extend("minimum" = 0))]
        pub power: Option<f64>,
        /// Part of the power that enters the body, 0 to 1; default that of `process`, else 1.
        #[serde(skip_serializing_if = "Option::is_none")]
        #[schemars(extend("minimum" = 0, "maximum" = 1))]
        pub efficiency: Option<f64>,
        /// Arc process, whose efficiency counts where `efficiency` is left out.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub process: Option<ArcProcess>,
    }
}

impl ArcPower {
    /// Efficiency as given, or of the process, or 1.
    fn efficiency(&self) -> f64 {
        let of_process = self.process.map(ArcProcess::efficiency);
        self.efficiency.or(of_process).unwrap_or(1.0)
    }
}

shared_keys! {
    /// The cells on which a density is sampled, and their face.
    #[derive(Debug, Clone, PartialEq)]
    pub struct CellSampling {
        /// Cell average or value at the cell centre; default `cell_average`.
        #[serde(default)]
        pub sampling: Sampling,
        /// Whether the power is made exact; default yes.
        #[serde(default = "default_normalise")]
        pub normalise: bool,
        /// The heated face; default z+ at the height of the toolpath.
        #[serde(default)]
        pub heated_surface: HeatedSurface,
    }
}

/// How a density becomes one value per cell.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Sampling {
    /// Its mean over the cell.
    #[default]
    CellAverage,
    /// Its value at the centre of the cell. Without `normalise` the power oscillates while the
    /// source crosses cells: by 1.2 % for a length of 1.25 cells.
    Point,
}

/// `heated_surface.direction` is given for something that does not have a torch.
fn no_direction(of: &str) -> SetupError {
    let message = format!("`heated_surface.direction` is given for {of}");
    let expected = "a 3D body, a source with a depth and a length above 0";
    SetupError::value("heated_surface.direction", message, expected)
}

/// Refuses a source that spans too many cells or samples of the lattice.
fn check_cells(key: &str, cells: f64, limit: f64) -> Result<(), SetupError> {
    if cells <= limit {
        return Ok(());
    }
    let message =
        format!("the heat source spans {cells:.1e} cells of the lattice, more than {limit:.0e}");
    Err(SetupError::value(
        key,
        message,
        format!("a smaller `{key}`, m"),
    ))
}

/// Default of an efficiency: all power enters the body.
fn default_efficiency() -> f64 {
    1.0
}

/// Default of `normalise`.
fn default_normalise() -> bool {
    true
}
