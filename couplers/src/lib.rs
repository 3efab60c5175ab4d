//! Couplers: what one field does to another, and what the surroundings do to a body.
//!
//! Every coupler is a plugin: a struct whose fields are the keys of its `[[couplers]]` table.
//!
//! | `type` | plugin | reads | adds or writes |
//! |---|---|---|---|
//! | `thermal_expansion` | [`expansion::ThermalExpansion`] | temperature | eigenstrain |
//! | `phase_expansion` | [`phase_expansion::PhaseExpansion`] | temperature, austenite | eigenstrain |
//! | `phase_strength` | [`phase_strength::PhaseStrength`] | temperature, fractions of the constituents of steel | yield stress |
//! | `transformation_heat` | [`transformation_heat::TransformationHeat`] | austenite | heat source |
//! | `phase_change` | [`phase_change::PhaseChange`] | temperature, enthalpy | liquid fraction; lets the body melt |
//! | `plastic_heat` | [`plastic_heat::PlasticHeat`] | plastic work | heat source |
//! | `viscous_heat` | [`viscous_heat::ViscousHeat`] | viscous work | heat source |
//! | `deformation_heat` | [`deformation_heat::DeformationHeat`] | temperature, conjugate_stress rate | heat source |
//! | `goldak` | [`heat_source::GoldakSource`] | | heat source |
//! | `ellipsoid` | [`heat_source::EllipsoidSource`] | | heat source |
//! | `gaussian_source` | [`heat_source::GaussianSource`] | | heat source |
//! | `point_source` | [`heat_source::PointSource`] | | heat source |
//! | `super_gaussian` | [`heat_source::SuperGaussianSource`] | | heat source |
//! | `profile_source` | [`heat_source::ProfileSource`] | | heat source |
//! | `pulsed_laser` | [`heat_source::PulsedLaserSource`] | | heat source |
//! | `prescribed_temperature` | [`boundary::PrescribedTemperature`] | | layer of temperature, or held temperature |
//! | `insulated` | [`boundary::Insulated`] | | even layer of a field |
//! | `heat_flux` | [`boundary::HeatFlux`] | | heat source |
//! | `deposit` | [`deposit::Deposit`] | | active points; their temperature at birth |
//! | `cut` | [`cut::Cut`] | | points that lose their material |
//! | `inherent_strain` | [`inherent_strain::InherentStrain`] | | eigenstrain with directions |
//! | `powder` | [`powder::Powder`] | liquid fraction | consolidated metal; conductivity of powder |
//! | `convection` | [`boundary::Convection`] | temperature | heat source |
//! | `water_jet` | [`boundary::WaterJet`] | temperature | heat source |
//! | `radiation` | [`boundary::Radiation`] | temperature | heat source |
//! | `prescribed_displacement` | [`boundary::PrescribedDisplacement`] | | layer of displacement, or held displacement |
//! | `clamp` | [`boundary::Clamp`] | | held displacement, until released |
//! | `traction` | [`boundary::Traction`] | | body force |
//! | `undex` | [`boundary::Undex`] | velocity | body force |
//! | `gravity` | [`boundary::Gravity`] | | body force |
//! | `symmetry` | [`boundary::Symmetry`] | | layers of temperature, displacement and velocity |
//! | `wall` | [`boundary::Wall`] | | layers of velocity |
//! | `evaporation` | [`evaporation::Evaporation`] | temperature, fraction of the first of two fluids | heat source, pressure on the interface |
//! | `lorentz_force` | [`lorentz::LorentzForce`] | | force on the melt |
//! | `buoyancy` | [`buoyancy::Buoyancy`] | temperature | body force |
//! | `contact` | [`contact::Contact`] | displacement, velocity of one body or two | impulse |
//! | `fluid_structure` | [`fluid_structure::FluidStructure`] | displacement, velocity of the solid | impulse, by way of the fluid |
//! | `impactor` | [`contact::Impactor`] | displacement, velocity | body force |
//! | `forcing_zone` | [`forcing_zone::ForcingZone`] | velocity | body force |
//! | `heat_interface` | [`heat_interface::HeatInterface`] | temperature of two bodies | heat source |
//! | `moving_refinement` | [`moving_refinement::MovingRefinement`] | temperature, enthalpy of two bodies | moves a window of finer points |
//! | `growing_crack` | [`boundary::GrowingCrack`] | | breaks bonds of the body |
//! | `insulated_crack` | [`boundary::InsulatedCrack`] | | cuts the families of the body |
//!
//! The modules [`heat_source::shape`] and [`toolpath`] do not depend on plugins; [`InTime`] is a number that may change in time.

#![cfg_attr(not(test), warn(unused_crate_dependencies))]
pub mod boundary;
pub mod buoyancy;
#[cfg(test)]
mod clock_tests;
pub mod contact;
pub mod cut;
pub mod deformation_heat;
pub mod deposit;
pub mod evaporation;
pub mod expansion;
pub mod fluid_structure;
pub mod forcing_zone;
pub mod heat_interface;
pub mod heat_source;
pub mod inherent_strain;
pub mod lorentz;
pub mod moving_refinement;
pub mod phase_change;
pub mod phase_expansion;
pub mod phase_strength;
pub mod plastic_heat;
mod point_materials;
pub mod powder;
#[cfg(test)]
mod programme_tests;
mod rate;
mod surface;
#[cfg(test)]
mod testing;
pub mod toolpath;
pub mod transformation_heat;
pub mod viscous_heat;

#[doc(hidden)]
pub use perimelt_core;
pub use perimelt_core::in_time::{self, InTime};

#[cfg(test)]
mod tests {
    use perimelt_core::{Coupler, plugin::registered};

    #[test]
    fn the_table_of_the_crate_page_lists_every_registered_coupler() {
        let page = include_str!("lib.rs");
        let couplers = registered::<dyn Coupler>();
        assert_eq!(couplers.len(), 43);
        for coupler in couplers {
            let row = format!("//! | `{}` |", coupler.name);
            assert!(page.contains(&row), "{}", coupler.name);
        }
    }
}
