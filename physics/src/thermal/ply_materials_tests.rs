//! Conduction in laminates of several materials against resistances in series and conductances in parallel.

use perimelt_core::Body;
use perimelt_core::body::{Layup, Stations};
use perimelt_core::shape::{BoxShape, Shape};
use perimelt_core::simulation::Simulation;

use super::Thermal;
use crate::testing::{material, read, run, set, simulation, values};

const SPACING: f64 = 1e-3;
/// Conductivities of two materials along and across the fibres and through the thickness, W/(m K).
const CONDUCTIVITY: [[f64; 3]; 2] = [[8.0, 0.8, 0.2], [1.0, 0.5, 4.0]];
/// K.
const MIDDLE: f64 = 500.0;

struct Stack<'a> {
    /// Along x and y, m.
    size: [f64; 2],
    angles: &'a [f64],
    thickness: &'a [f64],
    stations: Stations,
    conductivity: [[f64; 3]; 2],
}

impl Stack<'_> {
    /// A laminate whose points have the material that a function of position and ply gives.
    fn body(&self, material_at: impl Fn([f64; 3], usize) -> u16) -> Body {
        let [width, height] = self.size;
        let shape = Shape::Box(BoxShape {
            min: [0.0; 3],
            max: [width, height, self.thickness.iter().sum()],
        });
        let layup = Layup {
            angles: self.angles.to_vec(),
            ply_thickness: self.thickness.to_vec(),
            stations: self.stations,
        };
        let mut body = Body::stack("plate", &shape, SPACING, &layup).expect("a plate");
        let keys = |k: &[f64; 3]| {
            format!("density = 1000\nspecific_heat = 1000\nconductivity = {{ axes = {k:?} }}")
        };
        body.materials = self
            .conductivity
            .iter()
            .map(|k| material(&keys(k)))
            .collect();
        let layers = body.layers().expect("layers");
        let ply = |point| layers.layers()[layers.place(point).0].ply;
        let points = body.points.position.iter().enumerate();
        let of_point = points.map(|(point, x)| material_at((*x).into(), ply(point)));
        body.material_of_point = of_point.collect();
        body
    }
}

fn heated(body: Body, keys: &str, temperature: impl Fn([f64; 3]) -> f64) -> Simulation {
    let thermal: Thermal = read(keys);
    let mut s = simulation(body, vec![Box::new(thermal)], vec![], 0.5);
    set(&mut s, "temperature", |x| [temperature(x)]);
    s
}

/// Heat that a first explicit step brings to each point, W/m³.
fn rates(s: &mut Simulation) -> Vec<f64> {
    s.start().expect("starts");
    let before = values(s, "enthalpy");
    s.step().expect("steps");
    let dt = s.progress().last_step;
    let after = values(s, "enthalpy").into_iter().zip(before);
    after.map(|(after, before)| (after - before) / dt).collect()
}

/// Temperature of the steady flux (W/m²) towards lower positions through parts of these thicknesses (m) and conductivities (W/(m K)).
fn in_series(parts: &[[f64; 2]], flux: f64, position: f64) -> f64 {
    let mut below = 0.0;
    let mut temperature = MIDDLE;
    for [thickness, conductivity] in parts {
        let inside = (position - below).clamp(0.0, *thickness);
        temperature += flux * inside / conductivity;
        below += thickness;
    }
    temperature
}

/// The flux leaves the lowest layer and enters the highest one, and no other layer warms.
#[test]
fn plies_of_several_materials_conduct_in_series() {
    let thickness = [1e-3, 0.3e-3, 0.5e-3, 0.7e-3];
    let of_ply = [0, 1, 1, 0];
    for stations in [Stations::One, Stations::Two] {
        for horizon in [1.5, 3.0] {
            let stack = Stack {
                size: [9e-3; 2],
                angles: &[0.0, 45.0, 90.0, 0.0],
                thickness: &thickness,
                stations,
                conductivity: CONDUCTIVITY,
            };
            let body = stack.body(|_, ply| of_ply[ply]);
            let through = of_ply.map(|m| CONDUCTIVITY[m as usize][2]);
            let parts: Vec<[f64; 2]> = thickness
                .into_iter()
                .zip(through)
                .map(|(h, k)| [h, k])
                .collect();
            let flux = 1e4;
            let layers = body.layers().expect("layers").clone();
            let keys = format!("horizon = {horizon}\nsolver = \"explicit\"");
            let mut s = heated(body, &keys, |[.., z]| in_series(&parts, flux, z));
            let last = layers.layers().len() - 1;
            for (point, rate) in rates(&mut s).iter().enumerate() {
                let (layer, _) = layers.place(point);
                let expected = match layer {
                    0 => 1.0,
                    _ if layer == last => -1.0,
                    _ => 0.0,
                };
                let relative = rate * layers.layers()[layer].thickness / flux;
                // rounding of the enthalpies, 1e8 J/m³, over a step of about 1e-2 s
                let told = format!("{stations:?}, horizon {horizon}, {layer}: {relative}");
                assert!((relative - expected).abs() < 1e-7, "{told}");
            }
        }
    }
}

/// A slope of the temperature along the plies: each ply brings the flux of its own conductivity to the insulated half.
#[test]
fn plies_of_several_materials_conduct_in_parallel() {
    let angles = [0.0, 90.0, 90.0, 0.0];
    let (of_ply, thickness) = ([0, 1, 0, 1], [1e-3, 0.3e-3, 0.5e-3, 0.7e-3]);
    let stack = Stack {
        size: [40e-3, 9e-3],
        angles: &angles,
        thickness: &thickness,
        stations: Stations::Two,
        conductivity: CONDUCTIVITY,
    };
    let body = stack.body(|_, ply| of_ply[ply]);
    let layers = body.layers().expect("layers").clone();
    let (position, volume) = (body.points.position.to_vec(), body.points.volume.clone());
    let slope = 1e4;
    let mut s = heated(body, "", |[x, ..]| MIDDLE + slope * x);
    let mut heat = [0.0; 4];
    let rates = rates(&mut s);
    for (point, rate) in rates.iter().enumerate() {
        let ply = layers.layers()[layers.place(point).0].ply;
        if position[point].x < 20e-3 {
            heat[ply] += rate * volume[point];
        }
    }
    for ply in 0..4 {
        let axis = if angles[ply] == 0.0 { 0 } else { 1 };
        let conductivity = CONDUCTIVITY[of_ply[ply] as usize][axis];
        let expected = conductivity * slope * thickness[ply] * 9e-3;
        let error = heat[ply] / expected - 1.0;
        assert!(error.abs() < 1e-7, "ply {ply}: {error:e}");
    }
}

/// Two materials beside each other in the layers of a ply.
#[test]
fn materials_beside_each_other_in_a_ply_conduct_in_series() {
    // the second one conducts a quarter in all directions
    let alike = [[8.0, 0.8, 0.2], [2.0, 0.2, 0.05]];
    for (horizon, conductivity) in [(1.0, CONDUCTIVITY), (1.0, alike), (3.0, alike)] {
        for angle in [0.0, 90.0] {
            let stack = Stack {
                size: [40e-3, 13e-3],
                angles: &[angle],
                thickness: &[1e-3],
                stations: Stations::Two,
                conductivity,
            };
            let body = stack.body(|[x, ..], _| u16::from(x > 20e-3));
            let axis = if angle == 0.0 { 0 } else { 1 };
            let parts = conductivity.map(|k| [20e-3, k[axis]]);
            let flux = 1e4;
            let (position, volume) = (body.points.position.to_vec(), body.points.volume.clone());
            let keys = format!("horizon = {horizon}");
            let mut s = heated(body, &keys, |[x, ..]| in_series(&parts, flux, x));
            let (mut heat, mut total) = (0.0, 0.0);
            for (point, rate) in rates(&mut s).iter().enumerate() {
                let x = position[point].x;
                total += rate * volume[point];
                if x < 20e-3 {
                    heat += rate * volume[point];
                }
                // corrections of the edges reach over two horizons, and factors of the bonds along fibres over a third
                let is_inside = (x - 20e-3).abs() < 11e-3;
                assert!(
                    !is_inside || rate.abs() < 1e-7 * flux / SPACING,
                    "{rate} at {x}"
                );
            }
            let whole = flux * 13e-3 * 1e-3;
            let told = format!("horizon {horizon}, {angle} degrees: {heat} {total} {whole}");
            assert!((heat / whole - 1.0).abs() < 1e-7, "{told}");
            assert!(total.abs() < 1e-7 * whole, "{told}");
        }
    }
}

/// Core and skin of two materials, of which one depends on the temperature; the hot middle of the plate is on its plane of symmetry.
#[test]
fn half_of_a_laminate_of_several_materials_cools_like_the_whole_with_every_solver() {
    let hot = |middle: f64| {
        move |[x, _, z]: [f64; 3]| MIDDLE + 200.0 * (-((x - middle) / 3e-3).powi(2)).exp() + 5e4 * z
    };
    let stack = |width: f64| {
        let stack = Stack {
            size: [width, 6e-3],
            angles: &[0.0, 90.0, 0.0],
            thickness: &[0.5e-3, 1e-3, 0.5e-3],
            stations: Stations::Two,
            conductivity: CONDUCTIVITY,
        };
        let mut body = stack.body(|_, ply| u16::from(ply == 1));
        let table = "{ temperature = [300, 900], value = [0.5, 3.0] }";
        let keys = "density = 500\nspecific_heat = 2000\nconductivity = ";
        body.materials[1] = material(&format!("{keys}{{ axes = [{table}, 0.5, {table}] }}"));
        body
    };
    let mut reference: Option<Vec<f64>> = None;
    for solver in ["explicit", "rkl2", "implicit"] {
        let keys =
            format!("horizon = 1\ncorrection = \"lattice\"\nsolver = \"{solver}\"\nstep = 2e-3");
        let keys = match solver {
            "explicit" => keys.replace("\nstep = 2e-3", ""),
            _ => keys,
        };
        let mut whole = heated(stack(24e-3), &keys, hot(12e-3));
        let mut half = heated(stack(12e-3), &keys, hot(0.0));
        run(&mut whole);
        run(&mut half);
        let positions = whole.world().body(0).points.position.to_vec();
        let temperature = values(&whole, "temperature");
        let right = positions.iter().zip(&temperature);
        let right = right.filter(|(x, _)| x.x > 12e-3).map(|(_, t)| *t);
        let cooled = values(&half, "temperature");
        let differences = right.zip(&cooled).map(|(a, b)| (a - b).abs());
        let largest = differences.fold(0.0, f64::max);
        // the tolerance of the solver of equations
        assert!(largest < 1e-5, "{solver}: {largest:e} K");
        let reference = reference.get_or_insert_with(|| cooled.clone());
        let differences = cooled.iter().zip(reference).map(|(a, b)| (a - *b).abs());
        let largest = differences.fold(0.0, f64::max);
        // temperatures change by up to 100 K; steps of the implicit solver are of first order
        assert!(largest < 1.0, "{solver}: {largest} K from explicit steps");
        let [start, end] = [hot(0.0)([0.5e-3, 0.0, 0.0]), cooled[0]];
        assert!((start - end).abs() > 20.0, "cooled by {} K", start - end);
    }
}
