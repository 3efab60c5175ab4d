//! Conduction across flat interfaces between materials.

use super::Thermal;
use crate::testing::{block, material, read, set, simulation, values};
use perimelt_core::body::{Body, Store, Zone};
use perimelt_core::shape::{BoxShape, Shape};
use perimelt_core::simulation::Simulation;

const SPACING: f64 = 1e-3;
const CELLS: usize = 40;
/// m.
const INTERFACE: f64 = 0.5 * CELLS as f64 * SPACING;
/// K.
const AT_INTERFACE: f64 = 650.0;

/// Conductivity `value + slope (T - 650 K)`, W/(m K) and W/(m K²).
#[derive(Clone, Copy)]
struct Conductivity {
    value: f64,
    slope: f64,
}

impl Conductivity {
    const fn constant(value: f64) -> Conductivity {
        Conductivity { value, slope: 0.0 }
    }

    fn keys(self) -> String {
        let Conductivity { value, slope } = self;
        let conductivity = match slope {
            0.0 => format!("{value}"),
            _ => {
                let [low, high] = [250.0, 1050.0].map(|t| value + slope * (t - AT_INTERFACE));
                format!("{{ temperature = [250, 1050], value = [{low}, {high}] }}")
            }
        };
        format!("density = 1000\nspecific_heat = 1000\nconductivity = {conductivity}")
    }

    /// Temperature in steady flow by `flux` (W/m²) at a distance from the interface (m, negative on the left).
    fn temperature(self, flux: f64, distance: f64) -> f64 {
        // value u + slope u^2 / 2 = flux distance
        let rise = flux * distance;
        let root = (self.value * self.value + 2.0 * self.slope * rise).sqrt();
        AT_INTERFACE + 2.0 * rise / (self.value + root)
    }
}

/// Two layers, in steady flow.
struct Laminate {
    left: Conductivity,
    right: Conductivity,
    /// W/m², towards the left.
    flux: f64,
}

impl Laminate {
    /// The poorer layer, on the left, takes 300 K.
    fn new(left: Conductivity, right: Conductivity) -> Laminate {
        let flux = (left.value * 300.0 - left.slope * 0.5 * 300.0 * 300.0) / INTERFACE;
        Laminate { left, right, flux }
    }

    fn simulation(&self, mut body: Body, keys: &str) -> Simulation {
        let materials = [self.left, self.right].map(|k| material(&k.keys()));
        body.materials = materials.to_vec();
        let x: Vec<f64> = body.points.position.iter().map(|p| p.x).collect();
        body.material_of_point = x.iter().map(|x| u16::from(*x > INTERFACE)).collect();
        let thermal: Thermal = read(keys);
        let mut s = simulation(body, vec![Box::new(thermal)], vec![], 0.5);
        set(&mut s, "temperature", |[x, ..]| {
            let side = if x > INTERFACE { self.right } else { self.left };
            [side.temperature(self.flux, x - INTERFACE)]
        });
        s
    }
}

/// Heat that a first explicit step brings to each point, W/m³.
fn rates(s: &mut Simulation) -> Vec<f64> {
    s.start().expect("starts");
    let before = values(s, "enthalpy");
    s.step().expect("steps");
    let dt = s.progress().last_step;
    let after = values(s, "enthalpy");
    after
        .iter()
        .zip(before)
        .map(|(a, b)| (a - b) / dt)
        .collect()
}

/// Heat that crosses the interface (W/m²) from the rates of the points, which lie in layers over the face of `area` (m²).
fn flux(s: &Simulation, rates: &[f64], area: f64) -> f64 {
    let points = &s.world().body(0).points;
    let left = points.position.iter().map(|p| p.x < INTERFACE);
    let heat = rates.iter().zip(&points.volume).zip(left);
    heat.filter(|(_, left)| *left)
        .map(|((r, v), _)| r * v)
        .sum::<f64>()
        / area
}

/// The body is insulated: its left half receives the heat that crosses the interface.
#[test]
fn the_flux_through_two_materials_is_that_of_resistances_in_series() {
    for ratio in [2.0, 4.0, 10.0, 100.0] {
        let [poor, good] = [1.0, ratio].map(Conductivity::constant);
        for horizon in [1.0, 2.0, 3.0, 3.015, 4.0] {
            for cells in [[CELLS, 1, 1], [CELLS, 12, 1], [CELLS, 9, 9]] {
                let dimension = cells.iter().filter(|c| **c > 1).count();
                let laminate = Laminate::new(poor, good);
                for store in [Store::Lattice, Store::List] {
                    let body = block(cells, dimension, SPACING, store, "density = 1");
                    let area = body.points.volume.iter().sum::<f64>() / (2.0 * INTERFACE);
                    let mut s = laminate.simulation(body, &format!("horizon = {horizon}"));
                    let rates = rates(&mut s);
                    let what = format!("ratio {ratio}, horizon {horizon}, {cells:?}");
                    let error = flux(&s, &rates, area) / laminate.flux - 1.0;
                    // differences of temperatures of 1000 K that are 0.1 K apart in the good conductor
                    assert!(error.abs() < 1e-9, "{what}: {error:e}");
                    let positions = &s.world().body(0).points.position;
                    for (x, rate) in positions.iter().map(|p| p.x).zip(&rates) {
                        let is_inside = (x - INTERFACE).abs() < INTERFACE - 5.0 * SPACING;
                        let bound = 1e-9 * laminate.flux / SPACING;
                        assert!(!is_inside || rate.abs() < bound, "{what}: {rate:e} at {x}");
                    }
                    let heat: f64 = rates.iter().sum();
                    // rounding of the enthalpies, 1e9 J/m³, over a step of about 1e-3 s
                    let most = rates.iter().map(|r| r.abs()).fold(0.0, f64::max);
                    assert!(heat.abs() < 1e-8 * most, "{what}: {heat:e}");
                }
            }
        }
    }
}

#[test]
fn the_flux_by_conductivities_that_depend_on_the_temperature_is_that_of_resistances_in_series() {
    let poor = Conductivity {
        value: 1.0,
        slope: -1e-3,
    };
    for good in [2.0, 10.0, 100.0] {
        for relative in [0.0, 1e-3] {
            let good = Conductivity {
                value: good,
                slope: relative * good,
            };
            for horizon in [1.0, 2.0, 3.0] {
                let laminate = Laminate::new(poor, good);
                let body = block([CELLS, 12, 1], 2, SPACING, Store::Lattice, "density = 1");
                let area = body.points.volume.iter().sum::<f64>() / (2.0 * INTERFACE);
                let mut s = laminate.simulation(body, &format!("horizon = {horizon}"));
                let rates = rates(&mut s);
                let error = flux(&s, &rates, area) / laminate.flux - 1.0;
                // conductivities are those of the ends, up to a horizon from the interface: 1e-3 / K over 15 K / spacing
                assert!(error.abs() < 0.01 * horizon, "{horizon}: {error}");
            }
        }
    }
}

#[test]
fn a_laminate_of_two_spacings_has_the_flux_of_resistances_in_series() {
    let zone = |min: f64, max: f64, spacing| Zone {
        min: [min, 0.0, 0.0],
        max: [max, 0.024, 0.0],
        spacing,
        horizon_factor: 1.0,
    };
    let zones = [
        zone(0.0, INTERFACE, SPACING),
        zone(INTERFACE, 2.0 * INTERFACE, 2.0 * SPACING),
    ];
    let shape = Shape::Box(BoxShape {
        min: [0.0; 3],
        max: [2.0 * INTERFACE, 0.024, 0.01],
    });
    for ratio in [2.0, 10.0, 100.0] {
        let [poor, good] = [1.0, ratio].map(Conductivity::constant);
        let laminate = Laminate::new(poor, good);
        let body = Body::fill_zones("plate", &shape, 2, 0.1, &zones).expect("valid zones");
        let area = body.points.volume.iter().sum::<f64>() / (2.0 * INTERFACE);
        let mut s = laminate.simulation(body, "horizon = 3\ncorrection = \"balanced\"");
        let rates = rates(&mut s);
        let error = flux(&s, &rates, area) / laminate.flux - 1.0;
        // distances from the interface are those of the nearest points, which lie beside the normal
        assert!(error.abs() < 0.1, "ratio {ratio}: {error}");
    }
}
