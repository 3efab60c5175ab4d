//! Conduction of plies against the tensor of their conductivities.

use nalgebra::Vector3;
use perimelt_core::body::{Layup, Stations};
use perimelt_core::material::{Directional, Property};
use perimelt_core::shape::{BoxShape, Shape};
use perimelt_core::{Axis, Body, BondKernel, Cut, Family, FamilySpec, Horizon};

use super::conduction::PlyBonds;
use super::plies;

const SPACING: f64 = 1e-3;
/// Graphite/epoxy of [Gao2020], chapter 4, W/(m K).
const CONDUCTIVITY: [f64; 3] = [8.3075, 0.7575, 0.2];

fn plate(angles: &[f64], thickness: &[f64], stations: Stations) -> Body {
    let height: f64 = thickness.iter().sum();
    let shape = Shape::Box(BoxShape {
        min: [0.0; 3],
        max: [20.0 * SPACING, 20.0 * SPACING, height],
    });
    let layup = Layup {
        angles: angles.to_vec(),
        ply_thickness: thickness.to_vec(),
        stations,
    };
    Body::stack("plate", &shape, SPACING, &layup).expect("a plate")
}

fn spec() -> FamilySpec {
    FamilySpec {
        horizon: Horizon::Spacings(3.0),
        ..FamilySpec::new(3.0 * SPACING)
    }
}

/// A family with conductivities along and across the fibres and through the thickness, W/(m K).
#[derive(Debug)]
struct Conducting {
    family: Family,
    conductivity: [f64; 3],
}

fn family(body: &Body, conductivity: [f64; 3]) -> Result<Conducting, String> {
    let values = conductivity.map(Property::Constant);
    let layers = body.layers().expect("layers");
    let found = [Directional::Axes(Box::new(values))];
    let plies = plies::family(body, layers, &spec(), &found).map_err(|e| e.to_string())?;
    Ok(Conducting {
        family: plies.family,
        conductivity,
    })
}

/// Heat that flows to each point, W/m³.
fn rates(
    body: &Body,
    conducting: &Conducting,
    temperature: impl Fn(&Vector3<f64>) -> f64,
) -> Vec<f64> {
    let at = |point: usize| temperature(&body.points.position.at(point));
    let Conducting {
        family,
        conductivity: [along, across, through],
    } = conducting;
    let potentials = |t: f64| [across * t, (along - across) * t, through * t];
    let rate = |point: usize| {
        let mut sum = 0.0;
        family.for_each_bond(point, |_, bond, slot| {
            let other = family.point_in(slot).expect("no images");
            let [own, other] = [point, other].map(|point| potentials(at(point)));
            let [part] = PlyBonds.bond(bond, own, other);
            sum += part;
        });
        sum
    };
    (0..body.points.len()).map(rate).collect()
}

/// Whether a point is three horizons from the edges of the plane: factors of its neighbours are those of complete families.
fn is_inside(x: &Vector3<f64>) -> bool {
    let near = |x: f64| (x - 10.0 * SPACING).abs() < 0.6 * SPACING;
    near(x.x) && near(x.y)
}

#[test]
fn a_ply_has_the_conductivities_of_its_tensor() {
    // also fibres that conduct less, and angles without bonds
    for (angles, conductivity) in [
        (&[0.0, 90.0, 45.0, -45.0][..], CONDUCTIVITY),
        (&[0.0, 45.0, 30.0, 77.0], [0.5, 1.2, 0.2]),
        (&[0.0, 33.0], [1.2, 0.5, 0.3]),
    ] {
        let thickness = vec![0.4e-3; angles.len()];
        let body = plate(angles, &thickness, Stations::Two);
        let layers = body.layers().expect("layers");
        let family = family(&body, conductivity).expect("bonds");
        for (a, b) in [(0, 0), (1, 1), (0, 1)] {
            let rates = rates(&body, &family, |x| x[a] * x[b]);
            for (point, rate) in rates.iter().enumerate() {
                if !is_inside(&body.points.position.at(point)) {
                    continue;
                }
                let (sin, cos) = layers.angle(point).sin_cos();
                let [along, across, _] = conductivity;
                let tensor = [
                    [
                        along * cos * cos + across * sin * sin,
                        (along - across) * cos * sin,
                    ],
                    [
                        (along - across) * cos * sin,
                        along * sin * sin + across * cos * cos,
                    ],
                ];
                let expected = 2.0 * tensor[a][b];
                assert!((rate - expected).abs() < 1e-9, "{rate} {expected}");
            }
        }
    }
}

#[test]
fn linear_temperatures_are_in_equilibrium_with_the_exact_flux_through_plies() {
    for stations in [Stations::One, Stations::Two] {
        let body = plate(&[0.0, 45.0, 90.0], &[1e-3, 0.3e-3, 0.5e-3], stations);
        let layers = body.layers().expect("layers");
        let family = family(&body, CONDUCTIVITY).expect("bonds");
        let slope = [3.0e3, -2.0e3, 5.0e4];
        let rates = rates(&body, &family, |x| x.dot(&Vector3::from(slope)));
        let last = layers.layers().len() - 1;
        for (point, rate) in rates.iter().enumerate() {
            let (layer, _) = layers.place(point);
            // the flux leaves the lowest layer and enters the highest one
            let thickness = layers.layers()[layer].thickness;
            let flux = CONDUCTIVITY[2] * slope[2] / thickness;
            let expected = match layer {
                0 => flux,
                _ if layer == last => -flux,
                _ => 0.0,
            };
            if is_inside(&body.points.position.at(point)) {
                assert!((rate - expected).abs() < 1e-7 * flux, "{rate} {expected}");
            }
        }
    }
}

#[test]
fn heat_is_conserved() {
    let body = plate(&[0.0, 45.0, 90.0], &[1e-3, 0.3e-3, 0.5e-3], Stations::Two);
    let family = family(&body, CONDUCTIVITY).expect("bonds");
    let rates = rates(&body, &family, |x| {
        (1e4 * x.x + 7e3 * x.y * x.y + 3e4 * x.z).sin()
    });
    let heat: Vec<f64> = rates
        .iter()
        .zip(&body.points.volume)
        .map(|(r, v)| r * v)
        .collect();
    let total: f64 = heat.iter().sum();
    let size: f64 = heat.iter().map(|q| q.abs()).sum();
    assert!(total.abs() < 1e-13 * size, "{total} {size}");
}

#[test]
fn a_crack_insulates_all_plies() {
    let mut body = plate(&[0.0, 45.0, 90.0], &[1e-3; 3], Stations::Two);
    let middle = 10.0 * SPACING;
    body.sever(Cut::segment([middle, -1.0], [middle, 1.0]).expect("length"));
    let family = family(&body, CONDUCTIVITY).expect("bonds");
    let rates = rates(&body, &family, |x| if x.x < middle { 300.0 } else { 900.0 });
    assert!(rates.iter().all(|rate| *rate == 0.0));
}

#[test]
fn what_plies_do_not_conduct_is_refused() {
    let body = plate(&[30.0], &[1e-3], Stations::Two);
    let told = family(&body, CONDUCTIVITY).expect_err("negative bonds");
    assert!(told.contains("a ply at 30 degrees"), "{told}");
    let mut body = plate(&[0.0], &[1e-3], Stations::Two);
    body.repeat(&[Axis::X]).expect("a box");
    let told = family(&body, CONDUCTIVITY).expect_err("images");
    assert!(told.contains("periodic"), "{told}");
}
