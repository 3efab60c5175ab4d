//! What heat sources of every kind promise: the power asked for arrives.

use std::path::Path;

use nalgebra::Vector3;
use proptest::prelude::*;

use super::heated_body::lattice::TestLattice;
use super::*;
use crate::toolpath::{Pose, Toolpath};

/// Relative tolerance of powers, the acceptance target; sums of 1e5 terms round to 1e-12.
const POWER: f64 = 1e-10;

/// One of every kind, all of size 1 mm or less.
const SOURCES: &[&str] = &[
    "point = { power = 3200 }",
    "point = { power = 3200, dwell = 'on_arrival', efficiency = 0.8 }",
    "gaussian = { power = 3200, sigma = 4e-4, effective_depth = 1e-3 }",
    "semi_ellipsoid = { power = 3200, half_length = 5e-4, half_width = 1e-3, depth = 1e-3 }",
    "goldak = { front_length = 5e-4, rear_length = 1e-3, half_width = 8e-4, depth = 6e-4,
        front_fraction = 0.9 }",
    "super_gaussian = { absorptivity = 0.35, radius = 8e-4, order = 6, penetration_depth = 3e-5 }",
    "super_gaussian = { absorptivity = 0.35, radius = 8e-4, penetration_depth = 3e-4, penetration = 'gaussian' }",
    "super_gaussian = { absorptivity = 0.35, radius = 8e-4, penetration_depth = 4e-4, penetration = 'linear' }",
    "super_gaussian = { absorptivity = 0.35, radius = 8e-4, penetration_depth = 5e-4,
        penetration = 'uniform' }",
    "profile = { power = 3200, efficiency = 0.7, profile = 'exp(-2 * r^2 / 6e-4^2) * (1 - z / 8e-4) * (2 + x / 1e-3)',
        reach = 1e-3, depth = 8e-4 }",
];

/// Every kind of toolpath, on z = 0 within 4 mm of the origin, all within 1 s.
const TOOLPATHS: &[&str] = &[
    "line = { start = [-0.003, 0.0002, 0], direction = [1, 0, 0], speed = 0.006, end_time = 1 }",
    "line = { start = [-0.002, -0.003, 0], end = [0.001, 0.002, 0], speed = 0.006 }",
    "polyline = { start = [0, 0, 0], speed = 0.01, segments = [
        { to = [0.003, 0, 0], dwell = 0.1, power = 100 }, { to = [0, -0.002, 0], power = 900 } ] }",
    "circle = { centre = [0, 0.001, 0], radius = 0.002, speed = 0.0125 }",
    "weave = { start = [-0.003, 0, 0], end = [0.002, 0.001, 0], speed = 0.0052, amplitude = 5e-4,
        wavelength = 8e-4 }",
    "hatch = { corner = [-0.001, -0.001, 0], length = 0.003, width = 0.001, spacing = 3e-4,
        speed = 0.015, turn_time = 0.01, angle = 0.5 }",
];

/// A shape from the name of its file and its keys, as `goldak = { ... }`.
pub(super) fn shape(toml: &str) -> Box<dyn SourceShape> {
    fn read<S: SourceShape + serde::de::DeserializeOwned + 'static>(
        keys: toml::Value,
    ) -> Box<dyn SourceShape> {
        Box::new(keys.try_into::<S>().expect("well-formed keys"))
    }
    let table: toml::Table = toml.parse().expect("a table");
    let (name, keys) = table.into_iter().next().expect("a shape");
    match &name[..] {
        "point" => read::<Point>(keys),
        "gaussian" => read::<Gaussian>(keys),
        "semi_ellipsoid" => read::<SemiEllipsoid>(keys),
        "goldak" => read::<Goldak>(keys),
        "super_gaussian" => read::<SuperGaussian>(keys),
        "profile" => read::<Profile>(keys),
        _ => panic!("{name}"),
    }
}

pub(super) fn depositor(toml: &str, lattice: &TestLattice) -> Depositor {
    Depositor::new(&*shape(toml), &lattice.grid).expect("the source of the test is valid")
}

pub(super) fn pose(position: [f64; 3], direction: [f64; 3]) -> Pose {
    Pose {
        position: position.into(),
        direction: Vector3::from(direction).normalize(),
        power: 1000.0,
        speed: 0.005,
        torch: None,
    }
}

/// A body under z = 0 that holds all of the sources on all of the toolpaths. Exponential depths
/// reach 32 lengths (1 mm), ellipsoids 3.3 times their size.
pub(super) fn block(spacing: [f64; 3]) -> TestLattice {
    let dims = [0.015, 0.015, 0.005]
        .iter()
        .zip(spacing)
        .map(|(length, dx)| (length / dx).ceil() as usize + 4)
        .collect::<Vec<_>>();
    let dims = [dims[0], dims[1], dims[2]];
    let low = |axis: usize| -0.5 * spacing[axis] * dims[axis] as f64;
    TestLattice::full(
        [low(0), low(1), -spacing[2] * dims[2] as f64],
        spacing,
        dims,
    )
}

pub(super) fn agree(found: f64, expected: f64) -> bool {
    (found - expected).abs() <= POWER * expected.abs()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn power_is_exact_for_every_source_on_every_toolpath_at_any_spacing(
        dx in -1.0..0.48_f64, aspect in (0.6..1.6, 0.6..1.6), time in 0.0..1.0, shift in 0.0..1.0,
    ) {
        // 0.1 to 3 mm, which is 0.1 to 3 times the size of the sources
        let dx = 1e-3 * 10_f64.powf(dx);
        let mut lattice = block([dx, dx * aspect.0, dx.max(1.5e-4) * aspect.1]);
        lattice.grid.origin.x += shift * dx;
        let mut values = lattice.zeros();
        for toml in SOURCES {
            let source = shape(toml);
            let mut depositor = depositor(toml, &lattice);
            for path in TOOLPATHS {
                let path: Toolpath = toml::from_str(path).expect("a path");
                let track = path.track(source.power().or(Some(500.0)), Path::new("")).expect("a track");
                let pose = track.pose(time * track.end().expect("an end"));
                values.fill(0.0);
                let deposit = depositor.add(&lattice, &pose, &mut values);
                let asked = pose.power * source.efficiency();
                prop_assert!(agree(deposit.asked, asked), "{toml}");
                prop_assert!(agree(lattice.power(&values), asked), "{toml} {path:?} {deposit:?}");
                prop_assert_eq!(deposit.lost, 0.0, "{} {:?}", toml, path);
                prop_assert!(values.iter().all(|&value| value >= 0.0));
            }
        }
    }

    #[test]
    fn power_is_exact_on_a_plate(
        dx in 1e-4..3e-3, x in -3e-3..3e-3, y in -3e-3..3e-3, angle in 0.0..6.3_f64,
    ) {
        let lattice = TestLattice::plate(dx, 0.01, (0.024 / dx) as usize + 4);
        for toml in SOURCES {
            // the effective depth of this one is not the thickness
            let factor = if toml.starts_with("gaussian") { 10.0 } else { 1.0 };
            let mut values = lattice.zeros();
            let pose = pose([x, y, 7.0], [angle.cos(), angle.sin(), 0.0]);
            let deposit = depositor(toml, &lattice).add(&lattice, &pose, &mut values);
            let asked = 1000.0 * shape(toml).efficiency() * factor;
            prop_assert!(agree(deposit.asked, asked));
            prop_assert!(agree(lattice.power(&values), asked), "{toml}");
        }
    }

    #[test]
    fn what_one_half_of_a_body_loses_the_other_receives(
        x in -2e-3..2e-3, y in -2e-3..2e-3, angle in 0.0..6.3_f64, dx in 2e-4..1e-3,
    ) {
        let mut lattice = block([dx, dx, dx]);
        let at = pose([x, y, 0.0], [angle.cos(), angle.sin(), 0.0]);
        for toml in SOURCES {
            let mut depositor = depositor(toml, &lattice);
            let halves: [fn([usize; 3]) -> bool; 2] =
                [|[x, y, _]| (x + 3 * y).is_multiple_of(5), |[x, y, _]| !(x + 3 * y).is_multiple_of(5)];
            let [one, other] = halves.map(|half| {
                lattice.material = half;
                let mut values = lattice.zeros();
                let deposit = depositor.add(&lattice, &at, &mut values);
                assert!(agree(lattice.power(&values), deposit.deposited));
                deposit
            });
            for deposit in [one, other] {
                prop_assert!(agree(deposit.deposited + deposit.lost, deposit.asked));
            }
            prop_assert!((one.lost - other.deposited).abs() < POWER * one.asked, "{toml}");
        }
    }
}

#[test]
fn half_of_a_source_over_an_edge_is_lost() {
    for toml in SOURCES.iter().filter(|toml| !toml.contains("on_arrival")) {
        let mut lattice = block([4e-4; 3]);
        let edge = lattice.grid.origin.x;
        lattice.grid.origin.y += 1e-4;
        // travelling along the edge, so front and rear lie on the body alike
        let at = pose([edge, 0.0, 0.0], [0.0, 1.0, 0.0]);
        let deposit = depositor(toml, &lattice).add(&lattice, &at, &mut lattice.zeros());
        assert!(
            agree(deposit.lost, 0.5 * deposit.asked),
            "{toml}: {deposit:?}"
        );
        // far off the body nothing arrives
        let at = pose([edge - 0.1, 0.0, 0.0], [0.0, 1.0, 0.0]);
        let deposit = depositor(toml, &lattice).add(&lattice, &at, &mut lattice.zeros());
        assert!(agree(deposit.lost, deposit.asked) && deposit.deposited == 0.0);
    }
}

#[test]
fn aligned_cell_averages_need_no_normalisation_but_point_values_do() {
    // docs/theory/heat_sources.md, "Cells and power": c = 1.25 dx oscillates by 1.2 % in x
    let lattice = block([4e-4; 3]);
    let with = |sampling: &str, x: f64| {
        let toml = format!(
            "semi_ellipsoid = {{ half_length = 5e-4, half_width = 1e-3, depth = 1e-3,
             normalise = false, sampling = '{sampling}' }}"
        );
        let at = pose([x, 0.0, 0.0], [1.0, 0.0, 0.0]);
        let deposit = depositor(&toml, &lattice).add(&lattice, &at, &mut lattice.zeros());
        assert!((deposit.sampling_error() - (1000.0 - deposit.deposited)).abs() < 1e-9);
        deposit.deposited / 1000.0 - 1.0
    };
    for x in [0.0, 1e-4, 2e-4, 3.3e-4] {
        // the cut-off tails carry 1e-14
        assert!(with("cell_average", x).abs() < 1e-12);
    }
    let [on_plane, on_centre] = [0.0, 2e-4].map(|x| with("point", x));
    assert!((on_plane + 0.012).abs() < 1e-3, "{on_plane}");
    assert!((on_centre - 0.012).abs() < 1e-3, "{on_centre}");
}

#[test]
fn crossing_a_cell_is_smooth() {
    for toml in SOURCES.iter().filter(|toml| !toml.starts_with("point")) {
        let lattice = block([4e-4; 3]);
        let mut depositor = depositor(toml, &lattice);
        let steps = 200;
        let runs = [[1.0, 0.0], [0.8, 0.6]].map(|[u, v]| {
            let mut before: Option<Vec<f64>> = None;
            let (mut largest, mut change) = (0.0_f64, 0.0_f64);
            for step in 0..=steps {
                let s = 8e-4 * f64::from(step) / f64::from(steps);
                let mut values = lattice.zeros();
                depositor.add(
                    &lattice,
                    &pose([s * u, s * v, 0.0], [u, v, 0.0]),
                    &mut values,
                );
                for (point, &value) in values.iter().enumerate() {
                    largest = largest.max(value);
                    if let Some(before) = &before {
                        change = change.max((value - before[point]).abs());
                    }
                }
                before = Some(values);
            }
            change / largest
        });
        // a step is 1/100 of a cell; a source sharper than the cell empties it in about one cell
        assert!(runs.iter().all(|&change| change < 0.02), "{toml}: {runs:?}");
    }
}

#[test]
fn gaussian_on_a_plate_has_the_peak_of_its_effective_depth() {
    // [Wang2025] 7.5.5: q_m = 1.03938e9 W/m² for 3200 W and sigma = 0.7 mm
    let lattice = TestLattice::plate(4e-5, 0.01, 301);
    for (depth, h_eff) in [("", 0.01), (", effective_depth = 4e-4", 4e-4)] {
        let mut values = lattice.zeros();
        let at = Pose {
            power: 3200.0,
            ..pose([0.0; 3], [1.0, 0.0, 0.0])
        };
        let toml = format!("gaussian = {{ sigma = 7e-4{depth} }}");
        let deposit = depositor(&toml, &lattice).add(&lattice, &at, &mut values);
        let peak = values.iter().copied().fold(0.0, f64::max) * h_eff;
        // averaged over a cell of sigma/17: (dx/sigma)²/24 = 1.4e-4 along each axis
        assert!((peak / 1.03938e9 - 1.0).abs() < 3e-4, "{peak}");
        assert!(agree(deposit.asked, 3200.0 * 0.01 / h_eff));
    }
}

#[test]
fn sources_heat_any_face_and_only_below_it() {
    for (face, axis, level) in [("x-", 0, -0.001), ("y+", 1, 0.002), ("z-", 2, -0.001)] {
        let lattice = TestLattice::full([-0.001; 3], [1e-4; 3], [30, 30, 30]);
        let toml = format!(
            "semi_ellipsoid = {{ half_length = 3e-4, half_width = 2e-4, depth = 4e-4,
             heated_surface = {{ face = '{face}' }} }}"
        );
        let mut position = [5e-4; 3];
        position[axis] = level;
        let mut direction = [1.0, 2.0, 3.0];
        direction[axis] = 0.0;
        let mut values = lattice.zeros();
        depositor(&toml, &lattice).add(&lattice, &pose(position, direction), &mut values);
        assert!(agree(lattice.power(&values), 1000.0), "{face}");
        let layer = |index: usize| -> f64 {
            let strides = [1, 30, 900];
            (0..values.len())
                .filter(|point| point / strides[axis] % 30 == index)
                .map(|point| values[point])
                .sum()
        };
        let [outer, inner] = if face.ends_with('+') {
            [29, 0]
        } else {
            [0, 29]
        };
        assert!(layer(outer) > 10.0 * layer(10.max(inner.min(19))), "{face}");
    }
}

#[test]
fn beam_from_above_heats_the_top_edge_of_a_cross_section() {
    let lattice = TestLattice::plate(1e-4, 0.01, 100);
    for shape in ["", ", order = 8"] {
        let toml = format!(
            "super_gaussian = {{ absorptivity = 1, radius = 5e-4, penetration_depth = 1e-4{shape},
             heated_surface = {{ face = 'y+' }} }}"
        );
        let mut values = lattice.zeros();
        let at = pose([0.0, 5e-3, 0.0], [1.0, 0.0, 0.0]);
        depositor(&toml, &lattice).add(&lattice, &at, &mut values);
        assert!(agree(lattice.power(&values), 1000.0), "{shape}");
        // half of it right of the centre
        let right: f64 = (0..values.len())
            .filter(|p| p % 100 >= 50)
            .map(|p| values[p])
            .sum();
        assert!(agree(right, 0.5 * values.iter().sum::<f64>()));
    }
}

#[test]
fn point_sampling_of_a_source_between_the_centres_loses_no_power() {
    let toml = "semi_ellipsoid = { half_length = 1e-6, half_width = 1e-6, depth = 1e-6,
        sampling = 'point' }";
    let lattice = block([1e-3; 3]);
    let mut values = lattice.zeros();
    depositor(toml, &lattice).add(
        &lattice,
        &pose([3e-4, 3e-4, 0.0], [1.0, 0.0, 0.0]),
        &mut values,
    );
    assert!(agree(lattice.power(&values), 1000.0));
}

#[test]
fn mistakes_name_the_key() {
    let block = block([1e-3; 3]);
    let ellipsoid = "half_width = 1e-3, depth = 1e-3";
    let cases = [
        ("point = { efficiency = 1.2 }".to_owned(), "efficiency"),
        (
            "gaussian = { sigma = 0, effective_depth = 1 }".to_owned(),
            "sigma",
        ),
        ("gaussian = { sigma = 1e-3 }".to_owned(), "effective_depth"),
        (
            "gaussian = { sigma = nan, effective_depth = 1 }".to_owned(),
            "sigma",
        ),
        (
            format!("semi_ellipsoid = {{ half_length = -1, {ellipsoid} }}"),
            "half_length",
        ),
        (
            format!("semi_ellipsoid = {{ half_length = 1e3, {ellipsoid} }}"),
            "half_length",
        ),
        (
            format!(
                "goldak = {{ front_length = 1, rear_length = 1, front_fraction = 1, \
                     rear_fraction = 1.5, {ellipsoid} }}"
            ),
            "front_fraction",
        ),
        (
            format!(
                "goldak = {{ front_length = 1, rear_length = 1, rear_fraction = 3, \
                     {ellipsoid} }}"
            ),
            "rear_fraction",
        ),
        (
            "super_gaussian = { absorptivity = 2, radius = 1e-3, penetration_depth = 1e-3 }"
                .to_owned(),
            "absorptivity",
        ),
        (
            "super_gaussian = { absorptivity = 1, radius = 1e-3, order = 0, \
             penetration_depth = 1e-3 }"
                .to_owned(),
            "order",
        ),
    ];
    for (toml, key) in cases {
        let error = Depositor::new(&*shape(&toml), &block.grid).expect_err(&toml);
        assert_eq!(error.key, key, "{error}");
    }
    assert!(toml::from_str::<Gaussian>("sigma = 1\nsgima = 2").is_err());
}

#[test]
fn the_efficiency_is_that_given_or_that_of_the_process() {
    let goldak = |keys: &str| {
        let size = "front_length = 1, rear_length = 1, half_width = 1, depth = 1";
        shape(&format!("goldak = {{ {size} {keys} }}")).efficiency()
    };
    // EN 1011-1
    for (process, expected) in [
        ("submerged_arc", 1.0),
        ("manual_metal_arc", 0.8),
        ("mig", 0.8),
        ("mag", 0.8),
        ("tig", 0.6),
        ("plasma", 0.6),
    ] {
        assert_eq!(goldak(&format!(", process = '{process}'")), expected);
    }
    assert_eq!(goldak(", process = 'tig', efficiency = 0.7"), 0.7);
    assert_eq!(goldak(""), 1.0);
}

/// On a direction that lies along an axis within rounding the exact integrals are used, as on the axis; a round source has
/// no direction, and one that never moved faces along the first axis.
#[test]
fn directions_within_rounding_of_an_axis_are_along_it() {
    let lattice = block([4e-4; 3]);
    let heat = |toml: &str, direction: [f64; 3]| {
        let at = Pose {
            position: Vector3::new(1e-4, 2e-4, 0.0),
            direction: direction.into(),
            power: 1000.0,
            speed: 0.005,
            torch: None,
        };
        let mut values = lattice.zeros();
        depositor(toml, &lattice).add(&lattice, &at, &mut values);
        values
    };
    let goldak =
        "goldak = { front_length = 5e-4, rear_length = 1e-3, half_width = 8e-4, depth = 6e-4,
        front_fraction = 0.9 }";
    let axes = [
        [1.0, 0.0, 0.0],
        [-1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, -1.0, 0.0],
    ];
    for (i, axis) in axes.into_iter().enumerate() {
        let exact = heat(goldak, axis);
        assert_eq!(heat(goldak, axis.map(|c| 3.0 * c)), exact, "{axis:?}");
        assert_eq!(heat(goldak, axis.map(|c| c + 1e-14)), exact, "{axis:?}");
        assert!(heat(goldak, axis.map(|c| c + 1e-9)) != exact, "{axis:?}");
        for other in &axes[..i] {
            assert!(heat(goldak, *other) != exact, "{axis:?}");
        }
    }
    assert_eq!(heat(goldak, [0.0; 3]), heat(goldak, axes[0]));
    let round = "gaussian = { sigma = 4e-4, effective_depth = 1e-3 }";
    assert_eq!(heat(round, [0.6, 0.8, 0.0]), heat(round, axes[0]));
}
