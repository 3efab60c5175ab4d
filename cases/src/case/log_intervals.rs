//! Log intervals that leave out what the run is for.

use perimelt_core::Simulation;

use super::provides;
use crate::unit;

/// Intervals of the log, s.
fn intervals(simulation: &Simulation) -> Vec<f64> {
    let log = &simulation.options().log;
    let of_stages = log.stages.iter().map(|s| s.interval);
    of_stages.chain([log.interval]).collect()
}

/// Most moments of a period at which log intervals are compared with it.
const MOMENTS: u32 = 50;

/// Pulsed sources whose logged states show the same few moments of a period, of which fewer than two lie within a pulse.
pub(super) fn at_few_moments_of_pulses(simulation: &Simulation) -> Vec<String> {
    let composition = simulation.composition();
    let couplers = composition["couplers"].as_array().into_iter().flatten();
    let warning = |(label, coupler): (&str, &serde_json::Value)| {
        let pulse = &coupler["pulse"];
        let (frequency, duty) = (pulse["frequency"].as_f64()?, pulse["duty"].as_f64()?);
        let moments = |interval: f64| {
            let is_repeated = |n: &u32| {
                let periods = f64::from(*n) * interval * frequency;
                periods > 0.5 && (periods - periods.round()).abs() < 1e-6 * periods
            };
            let moments = (1..=MOMENTS).find(is_repeated)?;
            (f64::from(moments) * duty < 2.0).then_some((interval, moments))
        };
        let (interval, moments) = intervals(simulation).into_iter().find_map(moments)?;
        let moments = match moments {
            1 => "the same moment".to_string(),
            _ => format!("the same {moments} moments"),
        };
        let [interval, other] = [interval, 0.97 * interval].map(unit::time_text);
        Some(format!(
            "log: with an interval of {interval} all states show {moments} of the pulses of `{label}`, so that temperatures and melt \
             pools of the pulses may be missing; {other} shows others"
        ))
    };
    let labelled = simulation.coupler_labels().zip(couplers);
    labelled.filter_map(warning).collect()
}

/// Way of a torch between two solutions of stress from which on a warning is given, in spacings.
const FAR: f64 = 3.0;

/// Bodies whose metal flows and whose stress is found at logged states only, with a torch that goes far from one to the next.
pub(super) fn with_flow_far_apart(simulation: &Simulation) -> Vec<String> {
    let composition = simulation.composition();
    let list = |key: &str| composition[key].as_array().into_iter().flatten();
    let longest = intervals(simulation).into_iter().fold(0.0, f64::max);
    let speed_of = |coupler: &serde_json::Value| {
        let mut kinds = coupler["toolpath"].as_object()?.values();
        kinds.find_map(|path| path["speed"].as_f64())
    };
    let fastest = list("couplers").filter_map(speed_of).fold(0.0, f64::max);
    let bodies = simulation.observed().bodies();
    let is_rare = |physics: &serde_json::Value| {
        let name = physics["body"].as_str();
        let body = bodies
            .iter()
            .position(|b| name.is_none_or(|name| b.name == name))?;
        let is_rare = physics["type"] == "mechanical" && physics["update"] == "log";
        (is_rare && provides(simulation, body, "plastic_strain")).then_some(body)
    };
    let warning = |body: usize| {
        let body = &bodies[body];
        let spacings = longest * fastest / body.coarsest_spacing();
        (spacings > FAR).then(|| {
            let [first, last] = [1.0, 2.0].map(|n| unit::time_text(n * body.coarsest_spacing() / fastest));
            format!(
                "log: the torch advances by {} spacings between two solutions of the stress of body `{}` (`update = \"log\"`), on which \
                 residual stress and distortion of metal that flows depend; intervals of {first} to {last} while it moves give one or two",
                unit::number(spacings, 2),
                body.name
            )
        })
    };
    let rare = list("physics").filter_map(is_rare);
    rare.filter_map(warning).collect()
}

#[cfg(test)]
mod tests {
    use crate::case::units::tests::warnings_of;

    const WELD: &str = r#"
[bodies.plate]
shape.box = { min = [0, 0, 0], max = [0.02, 0.01, 0.003] }
spacing = 1e-3
material = "steel"
initial.temperature = 300

[materials.steel]
density = 7800
specific_heat = 500
conductivity = 30
youngs_modulus = 2e11
poissons_ratio = 0.3
yield_stress = 3e8
thermal_expansion = 1.2e-5

[[physics]]
type = "thermal"

[[physics]]
type = "mechanical"
formulation = "staggered"
plasticity = {}
update = "log"

[[couplers]]
type = "thermal_expansion"
reference_temperature = 300

[[couplers]]
type = "convection"
coefficient = 20
ambient = 300

[[couplers]]
type = "goldak"
name = "torch"
power = 200
half_width = 2e-3
depth = 2e-3
front_length = 2e-3
rear_length = 4e-3
toolpath.line = { start = [0.002, 0.005, 0.003], end = [0.018, 0.005, 0.003], speed = 4e-3 }

[time]
end = 4

[log]
interval = 1
"#;

    #[test]
    fn stress_of_flowing_metal_is_found_every_few_spacings() {
        let found = warnings_of(WELD);
        let expected = "advances by 4 spacings between two solutions of the stress of body `plate`";
        assert!(found.len() == 1 && found[0].contains(expected), "{found:?}");
        assert!(
            found[0].contains("intervals of 0.25 s to 0.5 s"),
            "{found:?}"
        );
        for (right, other) in [
            ("interval = 1", "interval = 0.5"),
            ("update = \"log\"", "update = \"step\""),
            ("plasticity = {}\n", ""),
        ] {
            let found = warnings_of(&WELD.replace(right, other));
            assert!(found.is_empty(), "{other}: {found:?}");
        }
    }
}
