//! Energies of heat sources and of deposited metal, and heat input per length.

use perimelt_core::log::{Log, LogError, Series};
use perimelt_core::material::Material;
use serde_json::Value;

use super::passes::SourceReports;
use super::{Label, ReadOff};
use crate::case::of_log::case_of;
use crate::log_file::plugins_of;
use crate::log_names::REPORTS;
use crate::quantity::scalar::scalar;

/// Energies of the heat sources, and energy per length of their paths.
pub(super) fn sources(log: &Log, found: &mut Vec<ReadOff>) -> Result<(), LogError> {
    let Some(series) = log.probes().get(REPORTS) else {
        return Ok(());
    };
    let deposits = deposits(log, series)?;
    let names = series.columns.iter().map(|c| &*c.name);
    let sources: Vec<&str> = names
        .filter_map(|name| name.strip_suffix(".energy.asked"))
        .collect();
    let cell = finest_cell(log);
    for &source in &sources {
        let reports = SourceReports { series, source };
        let is_of_source = |d: &&Deposited| match &d.source {
            Some(name) => name == source,
            None => sources.len() == 1,
        };
        let deposited = deposits.iter().filter(is_of_source);
        let heat = deposited.map(|d| d.heat).sum::<f64>();
        energies(&reports, found);
        energy_per_length(&reports, cell, heat, found);
        interpass_temperatures(&reports, found);
    }
    Ok(())
}

/// The finest spacing of the bodies, m: a source that goes less far stands still.
pub(super) fn finest_cell(log: &Log) -> f64 {
    let spacings = log.run().bodies.iter().map(|body| body.spacing);
    spacings.fold(f64::INFINITY, f64::min)
}

/// Energy deposited in the mirrored part of the body, J.
fn mirrored_energy(reports: &SourceReports<'_>) -> Option<f64> {
    reports
        .last("energy.mirrored")
        .filter(|energy| *energy > 0.0)
}

fn energies(reports: &SourceReports<'_>, found: &mut Vec<ReadOff>) {
    let last = |what: &str| reports.last(what);
    for (id, part, energy) in [
        ("energy.asked", "asked", last("energy.asked")),
        ("energy.deposited", "deposited", last("energy.deposited")),
        (
            "energy.mirrored",
            "deposited in the mirrored part of the body",
            mirrored_energy(reports),
        ),
        ("energy.lost", "lost", last("energy.lost")),
    ] {
        let name = Label::new(id, format!("energy {part}"));
        found.extend(energy.map(|e| ReadOff::new(reports.source, name, e, "J")));
    }
}

/// Energy per length of the path, without and with the heat (J) of the deposited metal; `cell` is the finest spacing, m.
fn energy_per_length(
    reports: &SourceReports<'_>,
    cell: f64,
    metal_heat: f64,
    found: &mut Vec<ReadOff>,
) {
    let source = reports.source;
    // a path within a cell stands for a source at rest
    let path = reports.last("path").filter(|path| *path > cell);
    let (Some(deposited), Some(path)) = (reports.last("energy.deposited"), path) else {
        return;
    };
    let mirrored = mirrored_energy(reports).unwrap_or(0.0);
    let energy = deposited + mirrored;
    let name = Label::new("path.length", "length of the path with power");
    found.push(ReadOff::new(source, name, path, "m"));
    let name = Label::new(
        "path.energy_per_length",
        "energy deposited per length of the path",
    );
    found.push(ReadOff::new(source, name, energy / path, "J/m"));
    // the source deposits mirror images of the metal as it heats those of the body
    let copies = match deposited > 0.0 {
        true => 1.0 + mirrored / deposited,
        false => 1.0,
    };
    let heat = copies * metal_heat;
    if heat > 0.0 {
        let name = Label::new(
            "deposited_metal.heat",
            "heat of the deposited metal above the temperature at the start",
        );
        found.push(ReadOff::new(source, name, heat, "J"));
        let name = Label::new(
            "path.total_energy_per_length",
            "total energy per length of the path, with the deposited metal",
        );
        let total = (energy + heat) / path;
        found.push(ReadOff::new(source, name, total, "J/m"));
    }
}

/// Starts of passes that waited for an interpass temperature, with that temperature.
fn interpass_temperatures(reports: &SourceReports<'_>, found: &mut Vec<ReadOff>) {
    for pass in 1.. {
        let start = reports.last(&format!("pass.{pass}.start"));
        let Some(start) = start.filter(|start| start.is_finite()) else {
            break;
        };
        let name = Label::new(
            format!("pass.{pass}.start"),
            format!("start of pass {pass}"),
        );
        found.push(ReadOff::new(reports.source, name, start, "s"));
        let name = Label::new(
            format!("pass.{pass}.interpass_temperature"),
            format!("interpass temperature before pass {pass}"),
        );
        let temperature = reports.last(&format!("pass.{pass}.temperature"));
        let temperature = temperature.filter(|t| t.is_finite());
        found.extend(temperature.map(|t| ReadOff::new(reports.source, name, t, "K").at(start)));
    }
}

/// Metal that a coupler `deposit` added.
struct Deposited {
    /// The heat source whose path it follows, if it has no path of its own.
    source: Option<String>,
    /// Heat above the lowest temperature of the first state, J.
    heat: f64,
}

/// The metal of all couplers `deposit` with a constant temperature, in the order of the case.
fn deposits(log: &Log, reports: &Series) -> Result<Vec<Deposited>, LogError> {
    let mut deposits = Vec::new();
    let Ok(case) = case_of(log) else {
        return Ok(deposits);
    };
    // only couplers `deposit` report a volume
    let labels = reports.columns.iter();
    let mut labels = labels.filter_map(|c| c.name.strip_suffix(".volume"));
    for body in &log.run().bodies {
        for deposit in plugins_of(log, "couplers", "deposit", &body.name) {
            let volume = labels.next().and_then(|label| {
                let name = format!("{label}.volume");
                let column = reports.columns.iter().find(|c| c.name == name)?;
                column.values.last().copied()
            });
            let first = match log.times(&body.name).is_empty() {
                true => None,
                false => scalar(&log.first_cloud(&body.name)?, "temperature"),
            };
            let coldest = first.and_then(|t| t.values.into_iter().min_by(f64::total_cmp));
            let melts = plugins_of(log, "couplers", "phase_change", &body.name)
                .next()
                .is_some();
            let materials = case.materials_of(&body.name).unwrap_or_default();
            let temperature = deposit["temperature"].as_f64();
            let heat = temperature.zip(coldest).and_then(|(hot, cold)| {
                let material = materials.first()?;
                Some(volume? * (enthalpy(material, hot, melts)? - enthalpy(material, cold, melts)?))
            });
            deposits.extend(heat.map(|heat| Deposited {
                source: match &deposit["source"] {
                    Value::String(name) => Some(name.clone()),
                    _ => None,
                },
                heat,
            }));
        }
    }
    Ok(deposits)
}

/// Enthalpy of a material at a temperature (K) above that at 0 K with the specific heat of its coldest row, J/m³.
fn enthalpy(material: &Material, temperature: f64, melts: bool) -> Option<f64> {
    /// K; resolves rows 10 K apart of a specific heat that is linear between rows
    const STEP: f64 = 2.0;
    let density = material.reference_density().ok()?;
    let capacity = material.get("specific_heat")?;
    let constant = |name: &str| material.get(name)?.constant();
    let melting = || {
        Some([
            constant("solidus")?,
            constant("liquidus")?,
            constant("latent_heat")?,
        ])
    };
    let melting = melting().filter(|_| melts);
    let liquid = |t: f64| match melting {
        Some([_, liquidus, _]) if t >= liquidus => 1.0,
        Some([solidus, liquidus, _]) => ((t - solidus) / (liquidus - solidus)).max(0.0),
        None => 0.0,
    };
    let steps = (temperature / STEP).ceil().max(1.0);
    let size = temperature / steps;
    let sensible = (0..steps as usize).map(|step| {
        let middle = (step as f64 + 0.5) * size;
        capacity.at(middle, liquid(middle)) * size
    });
    let latent = melting.map_or(0.0, |[.., latent]| latent * liquid(temperature));
    Some(density * (sensible.sum::<f64>() + latent))
}

#[cfg(test)]
mod tests {
    use super::*;
    use perimelt_core::material::MushyCapacity;

    #[test]
    fn the_enthalpy_is_that_of_the_solver() {
        for name in ["S355", "316L", "Ti-6Al-4V"] {
            let material = crate::library::find(name).expect("in the library");
            let latent = material
                .latent_heat(MushyCapacity::LatentPlusSensible, Default::default())
                .expect("it melts");
            let curve = material.enthalpy_curve(Some(latent)).expect("a curve");
            let expected = curve.enthalpy(2000.0) - curve.enthalpy(300.0);
            let at = |t: f64| enthalpy(&material, t, true).expect("known");
            let ratio = (at(2000.0) - at(300.0)) / expected;
            // specific heats with a peak, by the midpoint rule
            assert!((ratio - 1.0).abs() < 2e-3, "{name}: {ratio}");
        }
    }
}
