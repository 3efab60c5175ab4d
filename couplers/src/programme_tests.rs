//! Programmes of couplers: until when they act, and what is told of a run that ends earlier.

use crate::boundary::{
    Clamp, Convection, HeatFlux, PrescribedDisplacement, PrescribedTemperature, Radiation, Traction,
};
use crate::clock_tests::{Ready, ready, ready_on};
use crate::cut::Cut;
use crate::deposit::Deposit;
use crate::heat_source::{EllipsoidSource, PulsedLaserSource};
use crate::inherent_strain::InherentStrain;
use crate::testing::{STEEL, block};

/// What is told of a run that ends at 4 s.
fn told(coupler: &Ready) -> String {
    let limits = |after| coupler.running.step_limits(after);
    let programme = coupler.stepping.programme_at(4.0, limits);
    programme.and_then(|p| p.unreached(4.0)).unwrap_or_default()
}

#[test]
fn values_releases_and_cuts_after_the_end_of_the_run_are_told() {
    let ramp = "{ time = [0, 10], value = [300, 500] }";
    let short = "{ time = [0, 4, 100], value = [300, 500, 500] }";
    let of = |values: &str| -> Vec<Ready> {
        vec![
            ready::<Convection>(&format!("coefficient = 9\nambient = {values}")),
            ready::<Radiation>(&format!("ambient = {values}")),
            ready::<HeatFlux>(&format!("faces = ['z+']\nflux = {values}")),
            ready::<PrescribedTemperature>(&format!("face = 'z+'\nvalue = {values}")),
            ready::<PrescribedDisplacement>(&format!("face = 'z+'\nx = 0\ny = {values}")),
            ready::<Traction>(&format!("faces = ['z+']\npressure = 1\nfactor = {values}")),
            ready::<InherentStrain>(&format!(
                "region = 'left'\nstrain = [0, 0, 0]\nfactor = {values}"
            )),
        ]
    };
    let keys = [
        "ambient", "ambient", "flux", "value", "y", "factor", "factor",
    ];
    for (coupler, key) in of(ramp).iter().zip(keys) {
        let expected = format!("the run ends at 4 s, the last change of `{key}` is at 10 s");
        assert_eq!(told(coupler), expected);
    }
    for coupler in of(short).iter().chain(&of("300")) {
        assert_eq!(told(coupler), "");
    }
    let clamp = |until: &str| told(&ready::<Clamp>(&format!("region = 'left'\n{until}")));
    assert_eq!(
        clamp("until = 9"),
        "the run ends at 4 s, the clamp is released at 9 s"
    );
    assert_eq!(clamp("until = 4") + &clamp(""), "");
    let cut = |time: f64| told(&ready::<Cut>(&format!("region = 'left'\ntime = {time}")));
    assert_eq!(cut(6.0), "the run ends at 4 s, the cut is made at 6 s");
    assert_eq!(cut(3.0), "");
    let pulse = "fluence = 10\nreflectivity = 0.5\npulse_duration = 3\nabsorption_depth = 0.1";
    assert_eq!(
        told(&ready::<PulsedLaserSource>(pulse)),
        "the run ends at 4 s, its last event is at 6 s"
    );
}

fn torch(toolpath: &str) -> Ready {
    let shape = "power = 100\nhalf_length = 2\nhalf_width = 2\ndepth = 1";
    let body = block([20, 20, 8], 3, STEEL);
    ready_on::<EllipsoidSource>(vec![body], &format!("{shape}\ntoolpath.{toolpath}"))
}

#[test]
fn a_toolpath_after_the_end_of_the_run_is_told_with_the_part_that_is_done() {
    let line = "line = { start = [5, 10, 8], end = [15, 10, 8], speed = 0.25 }";
    let rest = "polyline = { start = [5, 10, 8], segments = [{ to = [5, 10, 8], dwell = 8 }] }";
    // 2 m with power, 8 s without, 2 m with power, 8 s without
    let gaps = "polyline = { start = [5, 10, 8], speed = 1, segments = [
        { to = [7, 10, 8], dwell = 8, dwell_power = 0 }, { to = [9, 10, 8], dwell = 8, dwell_power = 0 } ] }";
    let waits = format!(
        "sequence = {{ wait_until = {{ temperature = 400 }}, passes = [{{ toolpath.{line} }}, {{ toolpath.{line} }}] }}"
    );
    for (path, expected) in [
        (
            line,
            "the run ends at 4 s, its toolpath at 40 s (10 % of the path with power)",
        ),
        (
            rest,
            "the run ends at 4 s, its toolpath at 8 s (50 % of the energy)",
        ),
        (
            gaps,
            "the run ends at 4 s, its toolpath at 12 s (50 % of the path with power)",
        ),
        (
            &waits,
            "the run ends at 4 s, its toolpath at 80 s (5 % of the path with power)",
        ),
        (
            "line = { start = [5, 10, 8], end = [15, 10, 8], speed = 2.5 }",
            "",
        ),
        (
            "line = { start = [5, 10, 8], direction = [1, 0, 0], speed = 0.25 }",
            "",
        ),
    ] {
        assert_eq!(told(&torch(path)), expected, "{path}");
    }
    // power that ends before the path does not matter
    let back = "polyline = { start = [5, 10, 8], speed = 1, segments = [{ to = [7, 10, 8] }, { to = [17, 10, 8], power = 0 }] }";
    assert_eq!(told(&torch(back)), "");
}

#[test]
fn material_after_the_end_of_the_run_is_told() {
    let layers = |interval: f64| {
        let table = format!(
            "region = 'left'\ntemperature = 900\nlayers = {{ height = 1, interval = {interval} }}"
        );
        told(&ready_on::<Deposit>(
            vec![block([5, 4, 4], 3, STEEL)],
            &table,
        ))
    };
    // layers at 0, 3, 6 and 9 s
    assert_eq!(
        layers(3.0),
        "the run ends at 4 s, the last material is deposited at 9 s (50 % of the points)"
    );
    assert_eq!(layers(1.0), "");
}
