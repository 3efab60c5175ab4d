//! Kernels on a device: their operations are recorded, printed in C and compiled, and the sums of a program of C have the bits of the sweep.
//!
//! Without a compiler (`cc`) the tests say so and pass.

use std::fmt::Write as _;
use std::process::Command;

use perimelt_core::body::Store;
use perimelt_core::device::{DeviceKernel, record};
use perimelt_core::family::LatticeTables;
use perimelt_core::shape::{BoxShape, Shape, Sphere};
use perimelt_core::{Body, Bond, BondKernel, Correction, Face, Family, FamilySpec, Number};
use perimelt_physics::mechanical::stretch::{
    BodyLaw, BondConstants, BondLaw, Force, INPUTS, Linear, Pairs, States,
};
use perimelt_physics::thermal::BondConduction;
use serde::Serialize;

/// What calls the sweep: reads arrays, and writes sums.
const PROGRAM: &str = r#"
#include <stdio.h>
#include <stdlib.h>

static void *array(FILE *file, long *count, size_t size)
{
    int64_t length;
    if (fread(&length, sizeof length, 1, file) != 1)
        exit(2);
    void *values = malloc(length * size + 1);
    if (fread(values, size, length, file) != (size_t)length)
        exit(3);
    *count = length;
    return values;
}

int main(int count, char **names)
{
    FILE *file = fopen(names[1], "rb");
    if (count != 3 || file == NULL)
        return 1;
    long points, bonds, rest;
    uint32_t *slots = array(file, &points, sizeof(uint32_t));
    int64_t *first_weight = array(file, &rest, sizeof(int64_t));
    double *weights = array(file, &rest, sizeof(double));
    int64_t *offsets = array(file, &bonds, sizeof(int64_t));
    double *stencil = array(file, &rest, sizeof(double));
    const double *inputs[INPUTS];
    for (int i = 0; i < INPUTS; i++)
        inputs[i] = array(file, &rest, sizeof(double));
    double *sums = malloc(points * SUMS * sizeof(double));
    sweep(points, slots, first_weight, weights, bonds, offsets, stencil, inputs, sums);
    FILE *out = fopen(names[2], "wb");
    return out != NULL && fwrite(sums, sizeof(double), points * SUMS, out) == (size_t)(points * SUMS) && fclose(out) == 0 ? 0 : 4;
}
"#;

/// A kernel whose bonds are evaluated from both ends, as on a device.
struct OneEnded<K>(K);

impl<const I: usize, const O: usize, K: BondKernel<I, O>> BondKernel<I, O> for OneEnded<K> {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; I], other: [f64; I]) -> [f64; O] {
        self.0.bond(bond, own, other)
    }
}

/// A law of a user: stiffer with the stretch, and without resistance where bonds are shortened by half.
#[derive(Clone, Copy, Debug, Serialize)]
struct Stiffening {}

impl BondLaw for Stiffening {
    #[inline(always)]
    fn force<N: Number>(&self, [b, limit, ..]: &BondConstants, stretch: N) -> N {
        let force = stretch * (stretch * *b).mul_add(stretch, N::from(1.0));
        stretch.select_above(N::from(*limit), force, N::from(0.0))
    }

    fn mean_force(&self, _: &BondConstants, stretch: f64) -> f64 {
        0.5 * stretch
    }

    fn slope(&self, _: &BondConstants, _: f64) -> f64 {
        1.0
    }

    fn steepest(&self, _: &BondConstants) -> f64 {
        1.0
    }
}

fn append<T: Copy, const BYTES: usize>(
    file: &mut Vec<u8>,
    values: &[T],
    bytes: impl Fn(T) -> [u8; BYTES],
) {
    file.extend_from_slice(&(values.len() as i64).to_ne_bytes());
    values
        .iter()
        .for_each(|v| file.extend_from_slice(&bytes(*v)));
}

/// Sums of a kernel by a program of C; `None` without a compiler.
fn on_device<const I: usize, const O: usize>(
    kernel: &impl DeviceKernel<I, O>,
    tables: &LatticeTables,
    inputs: [&[f64]; I],
) -> Option<Vec<[f64; O]>> {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    let mut source = record(kernel).sweep_in_c();
    source.write_str(PROGRAM).expect("text");
    std::fs::write(at("sweep.c"), source).expect("written");
    let mut compiler = Command::new("cc");
    compiler.args(["-O2", "-ffp-contract=off", "-o"]);
    match (compiler.arg(at("sweep")).arg(at("sweep.c")).arg("-lm")).status() {
        Ok(status) => assert!(status.success(), "the source does not compile"),
        Err(error) => {
            eprintln!("left out, no compiler `cc`: {error}");
            return None;
        }
    }
    let mut file = Vec::new();
    append(&mut file, &tables.slots, u32::to_ne_bytes);
    append(&mut file, &tables.first_weight, i64::to_ne_bytes);
    append(&mut file, &tables.weights, f64::to_ne_bytes);
    append(&mut file, &tables.offsets, i64::to_ne_bytes);
    append(&mut file, tables.bonds.as_flattened(), f64::to_ne_bytes);
    for input in inputs {
        append(&mut file, input, f64::to_ne_bytes);
    }
    std::fs::write(at("arrays"), file).expect("written");
    let mut program = Command::new(at("sweep"));
    let status = program.arg(at("arrays")).arg(at("sums")).status();
    assert!(status.expect("it starts").success());
    let sums = std::fs::read(at("sums")).expect("sums");
    let values = sums
        .chunks_exact(8)
        .map(|bytes| f64::from_ne_bytes(bytes.try_into().expect("eight")));
    let values: Vec<f64> = values.collect();
    let (points, rest) = values.as_chunks::<O>();
    assert!(rest.is_empty());
    Some(points.to_vec())
}

/// Bodies with complete families, bare faces, curved surfaces, and layers on some faces.
fn families() -> Vec<(&'static str, Body, Family)> {
    let block = |max: [f64; 3]| Shape::Box(BoxShape { min: [0.0; 3], max });
    let cube = block([19.0, 13.0, 11.0]);
    let ball = Shape::Sphere(Sphere {
        centre: [0.0; 3],
        radius: 8.0,
    });
    let plate = block([40.0, 21.0, 1.0]);
    let all = Face::ALL.to_vec();
    let some = vec![Face::ALL[0], Face::ALL[3]];
    let cases = [
        ("layers", &cube, 3, Correction::Lattice, all),
        ("bare", &cube, 3, Correction::Point, Vec::new()),
        ("mixed", &cube, 3, Correction::Point, some),
        ("ball", &ball, 3, Correction::Point, Vec::new()),
        ("plate", &plate, 2, Correction::Point, Vec::new()),
    ];
    let family = |(name, shape, dimension, correction, layers)| {
        let mut body = Body::fill(name, shape, dimension, 1.0, 1.0).expect("a valid body");
        body.store = Store::Lattice;
        let spec = FamilySpec {
            correction,
            layers,
            ..FamilySpec::new(3.015)
        };
        let family = Family::build(&body, &spec).expect("a valid family");
        (name, body, family)
    };
    cases.into_iter().map(family).collect()
}

/// Compares a kernel on all bodies.
fn check<const I: usize, const O: usize>(name: &str, kernel: impl DeviceKernel<I, O> + Copy) {
    for (body_name, body, family) in families() {
        let value = |slot: usize, input: usize| {
            let wave = ((slot * (2 * input + 7) + input) as f64).sin();
            // displacements are small beside a spacing, other inputs positive
            if input < 3 {
                0.1 * wave
            } else {
                1.0 + 0.5 * wave
            }
        };
        let input = |i| {
            (0..family.slots())
                .map(|slot| value(slot, i))
                .collect::<Vec<f64>>()
        };
        let inputs: [Vec<f64>; I] = std::array::from_fn(input);
        let inputs = std::array::from_fn(|i| &inputs[i][..]);
        let tables = family.lattice_tables().expect("a lattice");
        let Some(found) = on_device(&kernel, &tables, inputs) else {
            return;
        };
        let mut sums = vec![[0.0; O]; body.points.len()];
        family.sum(&OneEnded(kernel), inputs, &mut sums);
        assert_eq!(found.len(), sums.len());
        assert!(sums.iter().flatten().any(|sum| *sum != 0.0));
        let differ = |(a, b): &(&f64, &f64)| a.to_bits() != b.to_bits();
        let numbers = || found.iter().flatten().zip(sums.iter().flatten());
        let wrong = numbers().filter(differ).count();
        assert_eq!(
            wrong,
            0,
            "{name}, {body_name}: {:?}",
            numbers().find(differ)
        );
    }
}

#[test]
fn heat_has_the_bits_of_the_sweep() {
    check::<1, 1>("heat", BondConduction { conductivity: 0.1 });
}

fn check_forces<L: BondLaw>(name: &str, law: BodyLaw<L>) {
    check::<INPUTS, 3>(
        &format!("{name}, pairs, linear"),
        Force::<false, _>(Pairs(law)),
    );
    check::<INPUTS, 3>(
        &format!("{name}, pairs, finite"),
        Force::<true, _>(Pairs(law)),
    );
    check::<INPUTS, 3>(
        &format!("{name}, states, finite"),
        Force::<true, _>(States(law)),
    );
}

#[test]
fn forces_of_bonds_have_the_bits_of_the_sweep() {
    check_forces("linear", BodyLaw::new(Linear {}, [0.0; 4]));
}

/// Fused operations and choices of a law that is not ours.
#[test]
fn laws_of_users_are_translated() {
    check_forces(
        "stiffening",
        BodyLaw::new(Stiffening {}, [20.0, -0.5, 0.0, 0.0]),
    );
}
