//! The constants of laws at all temperatures of their tables.

use perimelt_core::law::Constants;
use perimelt_core::{Body, SetupError};

/// Passes the constants of each material at the temperatures of their tables to `visit`, as many as there are, with a text that names
/// the material, and the temperature if they depend on it.
///
/// # Errors
/// The first one of `visit`.
pub(super) fn visit_states(
    body: &Body,
    constants: &Constants,
    count: usize,
    mut visit: impl FnMut(&[f64], &str) -> Result<(), SetupError>,
) -> Result<(), SetupError> {
    let mut values = vec![0.0; count];
    for (m, material) in body.materials.iter().enumerate() {
        let material = format!("material `{}`", material.name());
        let mut tables = constants.temperatures(m);
        tables.sort_by(f64::total_cmp);
        tables.dedup();
        let temperatures = if tables.is_empty() {
            &[0.0]
        } else {
            &tables[..]
        };
        for &temperature in temperatures {
            constants.load(m, temperature, 0.0, &mut values);
            let of = match tables.is_empty() {
                true => material.clone(),
                false => format!("{material} at {temperature} K"),
            };
            visit(&values, &of)?;
        }
    }
    Ok(())
}
