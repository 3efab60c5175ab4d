//! Several parts of a body in one process give the bits of the whole body.

use nalgebra::Vector3;

use super::{
    Bond, BondKernel, ByRules, Correction, Direction, Family, FamilyError, FamilySpec, Folded,
    GhostRule, Influence, LayerRule, Mirrored, SlotField, moving,
};
use crate::Axis;
use crate::body::{Body, Face, Horizon, Jitter, Part, Store, Zone};
use crate::shape::{BoxShape, Shape};

struct Conduction;

impl BondKernel<1, 1> for Conduction {
    #[inline(always)]
    fn bond(&self, bond: &Bond, [own]: [f64; 1], [other]: [f64; 1]) -> [f64; 1] {
        [2.0 * bond.mean() * bond.inverse_length * (other - own)]
    }
}

/// Force of bonds under finite displacements, and the sum of their strain energies at one end.
struct Stretch;

impl BondKernel<3, 4> for Stretch {
    const PAIRED: usize = 3;

    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; 3], other: [f64; 3]) -> [f64; 4] {
        let y: [f64; 3] = std::array::from_fn(|a| bond.xi[a] + other[a] - own[a]);
        let length = (y[0] * y[0] + y[1] * y[1] + y[2] * y[2]).sqrt();
        let stretch = length * bond.inverse_length - 1.0;
        let pull = bond.mean() * stretch / length;
        let energy = bond.weight * stretch * stretch * bond.length;
        [pull * y[0], pull * y[1], pull * y[2], energy]
    }
}

/// Rates of the velocity and of the density of a fluid, from velocity and density.
struct Stream;

impl BondKernel<4, 4> for Stream {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; 4], other: [f64; 4]) -> [f64; 4] {
        let pressure = own[3] + other[3] - 2.0;
        let rate: [f64; 3] = std::array::from_fn(|a| other[a] - own[a]);
        let along = rate[0] * bond.xi[0] + rate[1] * bond.xi[1] + rate[2] * bond.xi[2];
        let force = |a: usize| bond.weight * (0.01 * rate[a] - 20.0 * pressure * bond.xi[a]);
        [force(0), force(1), force(2), -own[3] * bond.weight * along]
    }
}

/// A body in parts, in one process.
struct World {
    parts: Vec<Part>,
    families: Vec<Family>,
    /// Part and point in it that own each point of the body.
    owner: Vec<(usize, usize)>,
}

impl World {
    /// `part_of` tells the part of each point.
    fn new(body: &Body, spec: &FamilySpec, part_of: impl Fn(&Vector3<f64>) -> usize) -> World {
        World::with(body, spec, part_of, |part| Family::of_part(part, spec))
    }

    fn with(
        body: &Body,
        spec: &FamilySpec,
        part_of: impl Fn(&Vector3<f64>) -> usize,
        family: impl Fn(&Part) -> Result<Family, FamilyError>,
    ) -> World {
        let part_of: Vec<usize> = body.points.position.iter().map(part_of).collect();
        let part = |number: usize| {
            let points = (0..part_of.len() as u32).filter(|p| part_of[*p as usize] == number);
            Part::new(body, &points.collect::<Vec<_>>(), spec.horizon)
        };
        let parts: Vec<Part> = (0..=part_of.iter().copied().max().unwrap_or(0))
            .map(part)
            .collect();
        let families = parts.iter().map(family);
        let mut owner = vec![(0, 0); part_of.len()];
        for (number, part) in parts.iter().enumerate() {
            for (point, global) in part.numbers()[..part.owned()].iter().enumerate() {
                owner[*global as usize] = (number, point);
            }
        }
        World {
            families: families.map(|f| f.expect("valid")).collect(),
            parts,
            owner,
        }
    }

    /// Fields of all parts with their ghosts, from values by point of the body.
    fn load<R: GhostRule + Copy>(&self, values: &[f64], rule: R) -> Vec<SlotField> {
        let take = |(part, family): (&Part, &Family)| {
            let mut field = SlotField::default();
            let numbers = part.numbers();
            let value = |point: usize| values[numbers[point] as usize];
            field.load(family, value, Mirrored::Scalar);
            // what is not exchanged is not used
            family
                .remote()
                .iter()
                .for_each(|(slot, _)| field[*slot as usize] = f64::NAN);
            field
        };
        let mut fields: Vec<_> = self.parts.iter().zip(&self.families).map(take).collect();
        self.cross(&mut fields, rule);
        fields
    }

    /// Lets a field cross the border between points and ghosts.
    fn cross<R: GhostRule + Copy>(&self, fields: &mut [SlotField], rule: R) {
        if R::DIRECTION == Direction::ValuesOut {
            self.exchange(fields, R::DIRECTION);
        }
        for (field, family) in fields.iter_mut().zip(&self.families) {
            field.fill_ghosts(family, rule);
        }
        if R::DIRECTION == Direction::SumsBack {
            self.exchange(fields, R::DIRECTION);
        }
    }

    /// What a transport does between processes.
    fn exchange(&self, fields: &mut [SlotField], direction: Direction) {
        for (part, family) in self.families.iter().enumerate() {
            for &(slot, point) in family.remote() {
                let global = self.parts[part].numbers()[point as usize];
                let (owner, owned) = self.owner[global as usize];
                let (slot, from) = (slot as usize, self.families[owner].slot_of(owned));
                match direction {
                    Direction::ValuesOut => fields[part][slot] = fields[owner][from],
                    Direction::SumsBack => {
                        fields[owner][from] += std::mem::take(&mut fields[part][slot]);
                    }
                }
            }
        }
    }

    /// Sums over bonds by point of the body.
    fn sum<const I: usize, const O: usize>(
        &self,
        kernel: &impl BondKernel<I, O>,
        inputs: &[Vec<SlotField>; I],
    ) -> Vec<[f64; O]> {
        let mut all = vec![[f64::NAN; O]; self.owner.len()];
        for (number, (part, family)) in self.parts.iter().zip(&self.families).enumerate() {
            let mut sums = vec![[f64::NAN; O]; part.owned()];
            let inputs = inputs.each_ref().map(|fields| &fields[number][..]);
            family.sum(kernel, inputs, &mut sums);
            for (global, sum) in part.numbers().iter().zip(sums) {
                all[*global as usize] = sum;
            }
        }
        all
    }
}

/// The temperature after some explicit steps, with a face that holds another temperature.
fn conducted(world: &World, body: &Body, rules: &[LayerRule]) -> Vec<f64> {
    let start = |x: &Vector3<f64>| 300.0 + 40.0 * (x.x * 3.0 + x.y).sin() + 7.0 * x.z * x.y;
    let mut values: Vec<f64> = body.points.position.iter().map(start).collect();
    let limit = 0.05 * body.finest_spacing().powi(2);
    for _ in 0..12 {
        let fields = [world.load(&values, ByRules(rules, 0))];
        let sums = world.sum(&Conduction, &fields);
        let changes = values.iter_mut().zip(sums);
        changes.for_each(|(value, [sum])| *value += limit * sum);
    }
    values
}

/// Displacement and energy after some explicit steps of motion.
fn moved(world: &World, body: &Body) -> Vec<[f64; 4]> {
    let start = |x: &Vector3<f64>| 1e-2 * Vector3::new((2.0 * x.y).sin(), x.x * x.z, x.x.cos());
    let mut displacement: Vec<_> = body.points.position.iter().map(start).collect();
    let mut velocity = vec![Vector3::zeros(); displacement.len()];
    let mut sums = Vec::new();
    for _ in 0..8 {
        let fields = [0, 1, 2].map(|axis| {
            let values: Vec<f64> = displacement.iter().map(|u| u[axis]).collect();
            world.load(&values, Mirrored::Vector(axis))
        });
        sums = world.sum(&Stretch, &fields);
        for ((u, v), [x, y, z, _]) in displacement.iter_mut().zip(&mut velocity).zip(&sums) {
            *v += 0.02 * Vector3::new(*x, *y, *z);
            *u += 0.1 * *v;
        }
    }
    let all = displacement.iter().zip(&sums);
    all.map(|(u, sum)| [u.x, u.y, u.z, sum[3]]).collect()
}

/// A fluid whose points move: where they are, their velocity and density.
struct Fluid {
    body: Body,
    velocity: Vec<Vector3<f64>>,
    density: Vec<f64>,
    /// Points that another part owned before.
    handed_over: usize,
}

impl Fluid {
    /// A vortex that carries points across the middle of the block.
    fn vortex(mut body: Body) -> Fluid {
        let jitter = Jitter {
            amplitude: 0.1,
            seed: 9,
        };
        body = body.jittered(jitter).expect("valid");
        let velocity = body.points.position.iter();
        let velocity = velocity.map(|x| Vector3::new(x.y - 0.95, 0.85 - x.x, 0.1 * x.y * x.x));
        Fluid {
            velocity: velocity.collect(),
            density: vec![1.0; body.points.len()],
            handed_over: 0,
            body,
        }
    }

    /// Moves the points; parts are cut anew when a point has moved by half the skin.
    fn flow(&mut self, spec: &FamilySpec, part_of: impl Fn(&Vector3<f64>) -> usize + Copy) {
        let volume = self.body.points.volume.to_vec();
        let half_skin = 0.5 * moving::skin(self.body.finest_spacing());
        let mut found_at = Vec::<Vector3<f64>>::new();
        let mut world: Option<World> = None;
        for _ in 0..40 {
            let positions = &self.body.points.position;
            let mut ways = positions.iter().zip(&found_at);
            if found_at.is_empty() || ways.any(|(x, before)| (x - before).norm() > half_skin) {
                let of_part = |part: &Part| Family::of_moving_part(part.clone(), spec);
                let cut = World::with(&self.body, spec, part_of, of_part);
                if let Some(before) = world.replace(cut) {
                    let now = world.iter().flat_map(|w| &w.owner);
                    let owners = before.owner.iter().zip(now);
                    self.handed_over += owners.filter(|(a, b)| a.0 != b.0).count();
                }
                found_at = positions.to_vec();
            }
            let world = world.as_mut().expect("it was cut");
            for (part, family) in world.parts.iter().zip(&mut world.families) {
                let of_part = |point: &u32| positions[*point as usize];
                let positions: Vec<_> = part.numbers().iter().map(of_part).collect();
                let volumes = part.numbers().iter().map(|p| volume[*p as usize]);
                family.update_weights(&positions, &volumes.collect::<Vec<_>>());
            }
            let component =
                |axis: usize| -> Vec<f64> { self.velocity.iter().map(|v| v[axis]).collect() };
            let [x, y, z] =
                [0, 1, 2].map(|axis| world.load(&component(axis), Mirrored::Vector(axis)));
            let density = world.load(&self.density, Mirrored::Scalar);
            let sums = world.sum(&Stream, &[x, y, z, density]);
            for (point, [x, y, z, density]) in sums.into_iter().enumerate() {
                self.velocity[point] += 2e-3 * Vector3::new(x, y, z);
                self.density[point] += 2e-2 * density;
                self.body.points.position[point] += 2e-2 * self.velocity[point];
            }
        }
    }

    fn bits(&self) -> Vec<[u64; 7]> {
        let points = self.body.points.position.iter().zip(&self.velocity);
        let points = points.zip(&self.density);
        let bits = |((x, v), d): ((&Vector3<f64>, &Vector3<f64>), &f64)| {
            [x.x, x.y, x.z, v.x, v.y, v.z, *d].map(f64::to_bits)
        };
        points.map(bits).collect()
    }
}

fn block(dimension: usize) -> Body {
    let (min, max) = ([0.0; 3], [1.7, 1.9, 2.1]);
    let shape = Shape::Box(BoxShape { min, max });
    Body::fill("block", &shape, dimension, 0.1, 1.0).expect("valid")
}

fn pool(dimension: usize) -> Body {
    let shape = Shape::Box(BoxShape {
        min: [0.0; 3],
        max: [1.7, 1.9, 0.5],
    });
    Body::fill("pool", &shape, dimension, 0.1, 1.0).expect("valid")
}

fn spec(layers: &[Face], correction: Correction) -> FamilySpec {
    FamilySpec {
        horizon: Horizon::Spacings(3.0),
        influence: Influence::Conical,
        correction,
        layers: layers.to_vec(),
        ..FamilySpec::default()
    }
}

fn rules(spec: &FamilySpec) -> Vec<LayerRule> {
    let odd = |(value, &face): (f64, &Face)| LayerRule {
        scale: [-1.0; 3],
        offset: [2.0 * value; 3],
        ..LayerRule::even(face)
    };
    [350.0, 290.0]
        .into_iter()
        .zip(&spec.layers)
        .map(odd)
        .collect()
}

fn two(axis: usize, at: f64) -> impl Fn(&Vector3<f64>) -> usize {
    move |x| usize::from(x[axis] > at)
}

/// Four parts that meet in an edge, one of them thinner than a horizon.
fn four(x: &Vector3<f64>) -> usize {
    usize::from(x.x > 0.9) + 2 * usize::from(x.y > 1.75)
}

#[test]
fn heat_on_a_lattice_in_parts_has_the_bits_of_the_whole() {
    for dimension in [2, 3] {
        for (is_periodic, store) in [
            (false, Store::Lattice),
            (true, Store::Lattice),
            (false, Store::List),
        ] {
            let mut body = block(dimension);
            body.store = store;
            let mut layers = vec![Face::XMin, Face::YMax, Face::XMax];
            if is_periodic {
                body.repeat(&[Axis::X]).expect("it fits");
                layers.retain(|f| f.axis() == 1);
            }
            let spec = spec(&layers, Correction::Point);
            let rules = rules(&spec);
            let whole = World::new(&body, &spec, |_| 0);
            let expected = conducted(&whole, &body, &rules);
            let cut = [
                World::new(&body, &spec, two(1, 0.8)),
                World::new(&body, &spec, two(1, 1.75)),
            ];
            for parts in cut {
                assert_eq!(conducted(&parts, &body, &rules), expected);
            }
            if !is_periodic {
                let parts = World::new(&body, &spec, four);
                assert_eq!(conducted(&parts, &body, &rules), expected);
                let parts = World::new(&body, &spec, two(0, 0.4));
                assert_eq!(conducted(&parts, &body, &rules), expected);
            }
        }
    }
}

#[test]
fn heat_in_a_cloud_in_parts_has_the_bits_of_the_whole() {
    let zone = |min, max, spacing| Zone {
        min,
        max,
        spacing,
        horizon_factor: 1.0,
    };
    let zones = [
        zone([0.0; 3], [0.8, 1.6, 0.0], 0.1),
        zone([0.8, 0.0, 0.0], [1.6, 1.6, 0.0], 0.05),
    ];
    let (min, max) = ([0.0; 3], [1.6, 1.6, 1.0]);
    let shape = Shape::Box(BoxShape { min, max });
    let body = Body::fill_zones("plate", &shape, 2, 1.0, &zones[..]).expect("valid");
    let jitter = Jitter {
        amplitude: 0.2,
        seed: 3,
    };
    let body = body.jittered(jitter).expect("valid");
    let spec = spec(&[Face::XMin, Face::YMax], Correction::Point);
    let rules = rules(&spec);
    let expected = conducted(&World::new(&body, &spec, |_| 0), &body, &rules);
    for parts in [
        World::new(&body, &spec, two(0, 0.7)),
        World::new(&body, &spec, two(1, 0.9)),
        World::new(&body, &spec, four),
    ] {
        assert_eq!(conducted(&parts, &body, &rules), expected);
    }
}

#[test]
fn explicit_motion_of_bonds_in_parts_has_the_bits_of_the_whole() {
    for dimension in [2, 3] {
        for layers in [&[][..], &[Face::XMin, Face::YMax]] {
            let body = block(dimension);
            let spec = spec(layers, Correction::Point);
            let expected = moved(&World::new(&body, &spec, |_| 0), &body);
            let mut cuts = vec![two(1, 0.8), two(1, 1.75), two(0, 0.45), two(0, 0.7)];
            if dimension == 3 {
                cuts.extend([two(2, 1.0), two(2, 1.95)]);
            }
            for cut in cuts {
                let parts = World::new(&body, &spec, cut);
                assert_eq!(moved(&parts, &body), expected);
            }
            let parts = World::new(&body, &spec, four);
            assert_eq!(moved(&parts, &body), expected);
        }
    }
}

#[test]
fn sums_of_ghosts_come_back_to_the_owners() {
    let body = block(2);
    let spec = spec(&[Face::XMin, Face::YMax], Correction::None);
    let folded = |world: &World| -> Vec<f64> {
        let mut fields: Vec<SlotField> = world.families.iter().map(SlotField::zeros).collect();
        // what points do to the slots of their bonds
        for (family, field) in world.families.iter().zip(&mut fields) {
            for point in 0..family.points() {
                family.for_each_bond(point, |number, _, slot| field[slot] += 1.0 + number as f64);
            }
        }
        world.cross(&mut fields, Folded(&[], 0));
        let owned = world.owner.iter();
        owned
            .map(|&(part, point)| fields[part][world.families[part].slot_of(point)])
            .collect()
    };
    let expected = folded(&World::new(&body, &spec, |_| 0));
    for parts in [
        World::new(&body, &spec, two(1, 0.8)),
        World::new(&body, &spec, four),
    ] {
        assert_eq!(folded(&parts), expected);
    }
}

#[test]
fn a_moving_fluid_in_parts_has_the_bits_of_the_whole() {
    for dimension in [2, 3] {
        for layers in [&[][..], &[Face::XMin, Face::XMax, Face::YMin, Face::YMax]] {
            let spec = FamilySpec {
                horizon: Horizon::Spacings(2.015),
                ..spec(layers, Correction::None)
            };
            let mut whole = Fluid::vortex(pool(dimension));
            whole.flow(&spec, |_| 0);
            assert!(
                whole
                    .bits()
                    .iter()
                    .flatten()
                    .all(|b| f64::from_bits(*b).is_finite())
            );
            for part_of in [
                &two(0, 0.8) as &dyn Fn(&Vector3<f64>) -> usize,
                &two(1, 0.95),
                &four,
            ] {
                let mut parts = Fluid::vortex(pool(dimension));
                parts.flow(&spec, part_of);
                assert!(parts.handed_over > 10, "{}", parts.handed_over);
                assert!(parts.bits() == whole.bits(), "{dimension}D");
            }
        }
    }
}
