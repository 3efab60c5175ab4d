//! Surface tension of a material, ready for its formulas.

use perimelt_core::material::Property;
use perimelt_core::world::BodyIndex;
use perimelt_core::{Setup, SetupError, SurfaceTension, TensionLaw};

/// [`prepare_tension`] of a flat face, along which only differences of the tension drive. Warns of one that has none.
///
/// # Errors
/// See [`prepare_tension`].
pub(crate) fn prepare_face_tension(
    tension: SurfaceTension,
    key: &str,
    setup: &mut Setup<'_>,
    body: BodyIndex,
    material: u16,
) -> Result<TensionLaw, SetupError> {
    let law = prepare_tension(tension, key, setup, body, material)?;
    if law.is_constant() {
        let name = &setup.body(body).materials[usize::from(material)].name();
        let warning = format!(
            "the `surface_tension` of `{name}` is the same at all temperatures, so that it drives nothing along the surface"
        );
        setup.warn(warning);
    }
    Ok(law)
}

/// The tension of a material of a body; mistakes are blamed on `key`. Warns of sulphur in a metal that is no steel, by its
/// melting temperature.
///
/// # Errors
/// Numbers outside of their ranges, or a material without the property that [`SurfaceTension::Material`] needs.
pub(crate) fn prepare_tension(
    tension: SurfaceTension,
    key: &str,
    setup: &mut Setup<'_>,
    body: BodyIndex,
    material: u16,
) -> Result<TensionLaw, SetupError> {
    tension.check(key)?;
    let this = &setup.body(body).materials[usize::from(material)];
    let liquidus = this.get("liquidus").and_then(Property::constant);
    if let Some(liquidus) = liquidus.filter(|liquidus| !tension.holds_for(*liquidus)) {
        let name = this.name().to_owned();
        setup.warn(format!(
            "the surface tension with sulphur is that of steel, and `{name}` melts at {liquidus} K"
        ));
    }
    let property = match tension {
        SurfaceTension::Material => setup
            .world()
            .property_of(body, material, "surface_tension")?,
        _ => Property::Constant(0.0),
    };
    Ok(tension.with_property(property))
}
