use super::super::heated_body::lattice::TestLattice;
use super::super::{PowerDensity, SourceShape, SuperGaussian};
use super::*;
use nalgebra::Vector3;

/// A lattice whose points have a fraction of metal, and a power with which each boils (W/m³).
struct Metal {
    lattice: TestLattice,
    fraction: Vec<f64>,
    boiling: Vec<f64>,
}

impl HeatedBody for Metal {
    fn grid(&self) -> &CellGrid {
        self.lattice.grid()
    }

    fn point(&self, cell: [usize; 3]) -> Option<usize> {
        self.lattice.point(cell)
    }

    fn volume(&self, point: usize) -> f64 {
        self.lattice.volume(point)
    }

    fn first_fluid(&self, point: usize) -> Option<f64> {
        Some(self.fraction[point])
    }

    fn boiling_power(&self, point: usize) -> f64 {
        self.boiling[point]
    }
}

fn beam(keys: &str) -> ColumnBeam {
    let keys = format!("radius = 2.0\nabsorptivity = 1\npenetration = {keys}");
    let shape: SuperGaussian = toml::from_str(&keys).expect("valid keys");
    let grid = TestLattice::full([0.0; 3], [1.0; 3], [2; 3]).grid;
    match shape.power_density(&grid).expect("valid") {
        PowerDensity::Columns(beam) => beam,
        other => panic!("{other:?}"),
    }
}

fn metal(surface: impl Fn(f64, f64) -> f64) -> Metal {
    let lattice = TestLattice::full([-16.0, -16.0, 0.0], [1.0; 3], [32, 32, 20]);
    let mut fraction = lattice.zeros();
    for (point, c) in fraction.iter_mut().enumerate() {
        let cell = [point % 32, point / 32 % 32, point / 1024];
        let [x, y, z] = [0, 1, 2].map(|a| lattice.grid.origin[a] + cell[a] as f64 + 0.5);
        *c = 1.0 / (1.0 + ((z - surface(x, y)) / 0.75).exp());
    }
    Metal {
        boiling: vec![f64::INFINITY; fraction.len()],
        lattice,
        fraction,
    }
}

fn pose() -> Pose {
    Pose {
        position: Vector3::new(0.3, -0.2, 25.0),
        direction: Vector3::x(),
        power: 100.0,
        speed: 0.0,
        torch: None,
    }
}

/// On flat, inclined and stepped surfaces, from above and from below.
#[test]
fn a_surface_of_any_shape_absorbs_all_power_in_its_layer() {
    let shapes: [fn(f64, f64) -> f64; 3] = [
        |_, _| 10.3,
        |x, y| 10.0 + 0.4 * x - 0.1 * y,
        |x, _| if x > 0.0 { 6.0 } else { 14.0 },
    ];
    for surface in shapes {
        let metal = metal(surface);
        let mut values = metal.lattice.zeros();
        let deposit =
            beam("'interface'").add(&metal, &pose(), 100.0, &mut values, &mut Scratch::default());
        assert!((deposit.deposited - 100.0).abs() < 1e-9, "{deposit:?}");
        assert_eq!(deposit.lost, 0.0);
        assert!((metal.lattice.power(&values) - 100.0).abs() < 1e-9);
        let mean: f64 = values.iter().zip(&metal.fraction).map(|(q, c)| q * c).sum();
        // the mean of c over rises of its square is 2/3, a little more by cells
        assert!((mean / 100.0 - 2.0 / 3.0).abs() < 0.12, "{mean}");
    }
    // from below it is metal everywhere: the first cell absorbs
    let metal = metal(|_, _| 10.3);
    let mut values = metal.lattice.zeros();
    let from_below = beam("'interface'\nheated_surface.face = 'z-'");
    from_below.add(&metal, &pose(), 100.0, &mut values, &mut Scratch::default());
    let first: f64 = values[..1024].iter().sum();
    assert!((first - 100.0).abs() < 1e-3, "{first}");
}

/// A flat surface and one above the level reflect into the open; a groove with walls of 45 degrees has `s/S = 1/sqrt(2)`.
#[test]
fn a_depression_absorbs_what_its_walls_reflect() {
    let gain = |surface: fn(f64, f64) -> f64, level: f64| {
        let metal = metal(surface);
        let mut values = metal.lattice.zeros();
        let mut at = pose();
        at.position.z = level;
        let mut beam = beam("'interface'");
        beam.reflecting = Some(0.3);
        let deposit = beam.add(&metal, &at, 30.0, &mut values, &mut Scratch::default());
        assert!((metal.lattice.power(&values) - deposit.deposited).abs() < 1e-9);
        deposit.asked / 30.0
    };
    assert_eq!(gain(|_, _| 10.0, 10.0), 1.0);
    assert_eq!(gain(|x, _| 10.0 + x.abs(), 3.0), 1.0);
    let groove = gain(|x, _| f64::min(5.0 + x.abs(), 10.0), 10.0);
    let expected = 1.0 / (0.3 + 0.7 / 2.0_f64.sqrt());
    // the layer rounds the bottom
    assert!(
        (groove / expected - 1.0).abs() < 0.05,
        "{groove} {expected}"
    );
    let deep = gain(|x, _| if x.abs() < 1.6 { 2.0 } else { 14.0 }, 14.0);
    // four columns; the steps of 12 spacings beside two of them have a root mean square of 12/sqrt(2)
    let expected = 1.0 / (0.3 + 0.7 * 4.0 / (2.0 + 2.0 * 73.0_f64.sqrt()));
    assert!((deep / expected - 1.0).abs() < 0.05, "{deep} {expected}");
}

#[test]
fn columns_without_metal_lose_their_power() {
    let metal = metal(|x, _| if x > 0.3 { -9.0 } else { 10.0 });
    let mut values = metal.lattice.zeros();
    let mut at = pose();
    at.position.x = 1.0;
    let deposit = beam("'interface'").add(&metal, &at, 100.0, &mut values, &mut Scratch::default());
    // the part of a beam of radius 2 beyond its own axis: the first column of metal ends at x = 0
    let inside = 0.5 * libm::erfc(2.0_f64.sqrt() * 1.0 / 2.0);
    assert!(
        (deposit.deposited / 100.0 - inside).abs() < 1e-6,
        "{deposit:?} {inside}"
    );
    assert!((deposit.deposited + deposit.lost - 100.0).abs() < 1e-9);
}

/// 32 x 32 x 20 cells of 0.5 m that boil with 40 W/m³, below z = 10, with a gap.
fn boiling() -> Metal {
    let mut lattice = TestLattice::full([-8.0, -8.0, 0.0], [0.5; 3], [32, 32, 20]);
    lattice.material = |cell| cell[2] != 17;
    let points = lattice.zeros().len();
    Metal {
        fraction: vec![1.0; points],
        boiling: vec![40.0; points],
        lattice,
    }
}

fn pose_at(z: f64) -> Pose {
    let mut at = pose();
    at.position = Vector3::new(0.0, 0.0, z);
    at
}

/// Each column fills its cells from the top, across the gap; what the lowest cell does not take is lost.
#[test]
fn a_keyhole_takes_the_power_cell_by_cell_up_to_boiling() {
    let body = boiling();
    for (power, is_lost) in [(300.0, false), (6e4, true)] {
        let mut values = body.lattice.zeros();
        let deposit = beam("'keyhole'").add(
            &body,
            &pose_at(10.0),
            power,
            &mut values,
            &mut Scratch::default(),
        );
        assert!((body.lattice.power(&values) - deposit.deposited).abs() < 1e-9 * power);
        assert!((deposit.deposited + deposit.lost - power).abs() < 1e-9 * power);
        assert_eq!(deposit.lost > 0.0, is_lost, "{deposit:?}");
        let column = |x: usize, y: usize| {
            let values = &values;
            (0..20).rev().map(move |z| values[x + 32 * (y + 32 * z)])
        };
        let (mut filled, mut part) = (0, 0);
        for (x, y) in (0..32 * 32).map(|n| (n % 32, n / 32)) {
            let mut ended = false;
            for (layer, value) in column(x, y).enumerate() {
                if layer == 2 {
                    assert_eq!(value, 0.0, "the gap");
                    continue;
                }
                assert!((0.0..=40.0 + 1e-12).contains(&value), "{value}");
                assert!(!ended || value == 0.0, "{x} {y} {layer}");
                ended |= value < 40.0;
                filled += usize::from(value == 40.0);
                part += usize::from(value > 0.0 && value < 40.0);
            }
        }
        assert!(filled > 20 && part > 20, "{filled} {part}");
    }
    // a surface inside of the body: cells above it stay cold
    let mut values = body.lattice.zeros();
    beam("'keyhole'").add(
        &body,
        &pose_at(6.0),
        300.0,
        &mut values,
        &mut Scratch::default(),
    );
    assert!(values[32 * 32 * 12..].iter().all(|value| *value == 0.0));
    assert!(values[32 * 32 * 11..32 * 32 * 12].iter().sum::<f64>() > 0.0);
}

/// A top hat: all columns have the same depth d in proportion to what they absorb, `A/(A + (1 - A) s/S)`.
#[test]
fn a_keyhole_absorbs_what_its_walls_reflect() {
    let mut body = boiling();
    body.lattice.material = |_| true;
    let mut beam = beam("'keyhole'\norder = 50\nsampling = 'point'");
    beam.reflecting = Some(0.3);
    let deposit = |power: f64| {
        let mut values = body.lattice.zeros();
        let deposit = beam.add(
            &body,
            &pose_at(10.0),
            power,
            &mut values,
            &mut Scratch::default(),
        );
        (deposit, values)
    };
    // below a spacing there is no depression
    assert_eq!(deposit(100.0).0.asked, 100.0);
    let power = 1200.0;
    let (deposit, values) = deposit(power);
    let gain = deposit.asked / power;
    let depth = |x: usize, y: usize| -> f64 {
        let cells = (0..20).map(|z| values[x + 32 * (y + 32 * z)] / 40.0);
        cells.sum()
    };
    let (mut opening, mut wall) = (0.0, 0.0);
    for (x, y) in (0..32 * 32).map(|n| (n % 32, n / 32)) {
        let here = depth(x, y);
        if here >= 1.0 {
            let beside = [(x - 1, y), (x + 1, y), (x, y - 1), (x, y + 1)];
            let squares = beside.map(|(x, y)| (depth(x, y) - here).powi(2));
            opening += 1.0;
            wall += (1.0 + 0.5 * squares.iter().sum::<f64>()).sqrt();
        }
    }
    let expected = 1.0 / (0.3 + 0.7 * opening / wall);
    assert!(gain > 1.5, "{gain}");
    assert!((gain / expected - 1.0).abs() < 1e-5, "{gain} {expected}");
}
