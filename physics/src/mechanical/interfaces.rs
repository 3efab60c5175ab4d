//! Strength of bonds between materials and across interfaces.
//!
//! A bond within one material has the mean limit of its ends. A bond between two materials, or one that passes through a
//! third, has the smallest limit of what it passes: that of its ends and of the points through whose cells it goes. A weak layer
//! hence breaks at its own strength even where bonds reach from one side of it to the other.
//!
//! An interface has a limit of its own, by `fracture_energy` or `critical_stretch`, which takes the place of these for all
//! bonds that cross it.

use nalgebra::Vector3;
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::solver::Reducer;
use perimelt_core::{Body, Bond, Cut, Family, Setup, SetupError};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{self, Deserializer, MapAccess, SeqAccess};
use serde::{Deserialize, Serialize};

use super::fracture::Criterion;

/// An interface: between two materials or regions, or a surface through the body.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Interface {
    /// Names of two regions or materials, such as `["steel", "weld"]`: bonds from one to the other cross the interface.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub between: Option<[String; 2]>,
    /// Corners of a chain of lines through the whole thickness, x and y (m): bonds that cross it cross the interface.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub through: Option<Vec<[f64; 2]>>,
    /// A corner of a parallelogram (m) that bonds cross, in 3D.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub corner: Option<[f64; 3]>,
    /// The two edges of the parallelogram from its corner, as vectors (m).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub edges: Option<[[f64; 3]; 2]>,
    /// Energy to separate both sides, J/m².
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub fracture_energy: Option<f64>,
    /// Stretch at which bonds break; for the criterion `stretch`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub critical_stretch: Option<f64>,
}

/// One interface or a list of them.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[serde(transparent)]
pub struct Interfaces(pub Vec<Interface>);

/// For the schema.
#[derive(JsonSchema)]
#[schemars(untagged)]
#[expect(dead_code, reason = "describes what is read by hand")]
pub(super) enum OneOrMany {
    One(Interface),
    Many(Vec<Interface>),
}

/// By hand, because an untagged enum cannot say what it expected.
impl<'de> Deserialize<'de> for Interfaces {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Visitor;
        impl<'de> de::Visitor<'de> for Visitor {
            type Value = Interfaces;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("an interface, such as { between = [\"a\", \"b\"], fracture_energy = 10 }, or a list of them")
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Interfaces, A::Error> {
                let interface = Interface::deserialize(MapAccessDeserializer::new(map))?;
                Ok(Interfaces(vec![interface]))
            }

            fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<Interfaces, A::Error> {
                let list = SeqAccessDeserializer::new(list);
                Ok(Interfaces(Vec::deserialize(list)?))
            }
        }
        deserializer.deserialize_any(Visitor)
    }
}

/// Limit of an interface.
#[derive(Clone, Copy, Debug)]
pub(super) enum Limit {
    Stretch(f64),
    /// J/m².
    Energy(f64),
}

/// What bonds cross at an interface.
#[derive(Debug)]
enum Crossed {
    /// The bits of both sides in the class of points.
    Sides([u64; 2]),
    Cuts(Vec<Cut>),
}

/// Bits of the sides of interfaces in the class of a point: two for each.
const MOST: usize = 32;

fn refuse<T>(message: String, expected: &str) -> Result<T, SetupError> {
    Err(SetupError::value("fracture.interface", message, expected))
}

impl Interface {
    fn limit(&self, criterion: Criterion) -> Result<Limit, SetupError> {
        let (limit, value) = match (self.fracture_energy, self.critical_stretch) {
            (Some(energy), None) => (Limit::Energy(energy), energy),
            (None, Some(stretch)) if criterion == Criterion::Stretch => {
                (Limit::Stretch(stretch), stretch)
            }
            (None, Some(_)) => {
                let message = "a critical stretch is no limit of the energy of bonds".into();
                return refuse(message, "`fracture_energy` (J/m²)");
            }
            _ => {
                let message = "the interface has no strength, or two".into();
                return refuse(message, "`fracture_energy` (J/m²) or `critical_stretch`");
            }
        };
        match value > 0.0 && value.is_finite() {
            true => Ok(limit),
            false => refuse(format!("the strength is {value}"), "a number above 0"),
        }
    }

    /// The cuts that describe it; `None` if it is between two sides.
    fn cuts(&self) -> Result<Option<Vec<Cut>>, SetupError> {
        let cuts: Vec<Option<Cut>> = match (&self.between, &self.through, self.corner, self.edges) {
            (Some(_), None, None, None) => return Ok(None),
            (None, Some(corners), None, None) => {
                let lines = corners.windows(2);
                lines.map(|ends| Cut::segment(ends[0], ends[1])).collect()
            }
            (None, None, Some(corner), Some(edges)) => vec![Cut::parallelogram(corner, edges)],
            _ => {
                let message = "the interface has no description, or several".into();
                return refuse(
                    message,
                    "one of `between`, `through`, or `corner` and `edges`",
                );
            }
        };
        match cuts.into_iter().collect::<Option<Vec<Cut>>>() {
            Some(cuts) if !cuts.is_empty() => Ok(Some(cuts)),
            _ => refuse(
                "the length or area of the interface is zero".into(),
                "different corners or edges",
            ),
        }
    }
}

/// The points of a region or a material.
fn points_of(setup: &Setup<'_>, body: usize, name: &str) -> Result<Vec<u32>, SetupError> {
    let this = setup.body(body);
    let of_material = || {
        let material = this.materials.iter().position(|m| m.name() == name)?;
        let points = this.material_of_point.iter().enumerate();
        let points = points.filter(|(_, m)| usize::from(**m) == material);
        Some(points.map(|(point, _)| point as u32).collect::<Vec<_>>())
    };
    match (this.regions.contains_key(name), of_material()) {
        // the part of the body that a process has may have none of them
        (false, Some(points)) if setup.world().processes().any(!points.is_empty()) => Ok(points),
        (false, _) => {
            let names = this.materials.iter().map(|m| m.name().to_owned());
            let known: Vec<String> = names.chain(this.regions.keys().cloned()).collect();
            let message = format!(
                "body `{}` has no region or material `{name}` with points",
                this.name
            );
            refuse(message, &format!("one of {}", known.join(", ")))
        }
        (true, _) => Ok(setup.region(body, "fracture.interface", name)?.points),
    }
}

/// A bond with a limit of its own.
#[derive(Debug)]
struct Crossing {
    point: u32,
    /// Number of the bond in the family of the point.
    bond: u32,
    /// The other end, or the point that it is the image of.
    other: u32,
    /// The interface that it crosses.
    interface: Option<u16>,
    /// Points in between that count.
    passed: Vec<u32>,
    /// Mean limit of its ends over its own limit.
    factor: f64,
}

/// The bonds of a body with limits of their own.
#[derive(Debug, Default)]
pub(super) struct Crossings {
    limits: Vec<Limit>,
    /// By point, then bond.
    bonds: Vec<Crossing>,
}

/// What tells the bonds of a body apart.
struct Classes<'a> {
    body: &'a Body,
    /// Sides of interfaces, by point.
    sides: Vec<u64>,
    crossed: Vec<Crossed>,
    point_in: Vec<u32>,
}

impl Classes<'_> {
    fn of(&self, point: u32) -> (u16, u64) {
        let sides = self.sides.get(point as usize).copied().unwrap_or(0);
        (self.body.material_of_point[point as usize], sides)
    }

    /// Whether the segment from a point along `xi` (m) passes through the cell of another.
    fn passes(&self, point: u32, xi: &[f64; 3], through: u32) -> bool {
        /// Part of the segment that counts.
        const LEAST: f64 = 1e-6;
        let points = &self.body.points;
        let arm = points.position.at(through as usize) - points.position.at(point as usize);
        let half = 0.5 * points.spacing[through as usize];
        let (mut enter, mut leave) = (0.0f64, 1.0f64);
        for axis in 0..self.body.dimension {
            let (low, high) = (arm[axis] - half, arm[axis] + half);
            if xi[axis].abs() < LEAST * half {
                // along the side of a cell is outside
                if low > -LEAST * half || high < LEAST * half {
                    return false;
                }
                continue;
            }
            let [from, to] = [low / xi[axis], high / xi[axis]];
            enter = enter.max(from.min(to));
            leave = leave.min(from.max(to));
        }
        leave - enter > LEAST
    }

    /// The bonds of a point with limits of their own.
    fn crossings(&self, family: &Family, point: u32) -> Vec<Crossing> {
        let own = self.of(point);
        let mut bonds: Vec<(u32, Bond, u32, bool)> = Vec::new();
        family.for_each_bond(point as usize, |number, bond, slot| {
            let is_point = family.any_point_in(slot).is_some();
            bonds.push((number as u32, *bond, self.point_in[slot], is_point));
        });
        let mut others: Vec<u32> = bonds
            .iter()
            .filter(|(_, _, other, is_point)| *is_point && self.of(*other) != own)
            .map(|(_, _, other, _)| *other)
            .collect();
        others.sort_unstable();
        let has_cuts = self.crossed.iter().any(|c| matches!(c, Crossed::Cuts(_)));
        if others.is_empty() && !has_cuts {
            return Vec::new();
        }
        let from = self.body.points.position.at(point as usize);
        let crossing = |(bond, geometry, other, _): &(u32, Bond, u32, bool)| {
            let (material, sides) = self.of(*other);
            let is_new = |class: (u16, u64)| {
                (class.0 != own.0 && class.0 != material) || class.1 & !(own.1 | sides) != 0
            };
            let passed: Vec<u32> = others
                .iter()
                .copied()
                .filter(|p| {
                    p != other && is_new(self.of(*p)) && self.passes(point, &geometry.xi, *p)
                })
                .collect();
            let sides = passed.iter().fold(own.1 | sides, |s, p| s | self.of(*p).1);
            let to = from + Vector3::from(geometry.xi);
            let crosses = |crossed: &Crossed| match crossed {
                Crossed::Sides(both) => both.iter().all(|side| sides & side != 0),
                Crossed::Cuts(cuts) => cuts.iter().any(|cut| cut.crosses(&from, &to)),
            };
            let interface = self.crossed.iter().position(crosses).map(|i| i as u16);
            let passed: Vec<u32> = passed
                .into_iter()
                .filter(|p| self.of(*p).0 != own.0 && self.of(*p).0 != material)
                .collect();
            let is_special = interface.is_some() || material != own.0 || !passed.is_empty();
            is_special.then_some(Crossing {
                point,
                bond: *bond,
                other: *other,
                interface,
                passed,
                factor: 1.0,
            })
        };
        let known = bonds.iter().filter(|(_, _, other, _)| *other != u32::MAX);
        known.filter_map(crossing).collect()
    }
}

impl Crossings {
    /// Finds the bonds with limits of their own, and warns of materials that are thinner than the horizon.
    ///
    /// # Errors
    /// An interface without description or strength, or between unknown names.
    pub(super) fn of(
        interfaces: &Interfaces,
        criterion: Criterion,
        setup: &mut Setup<'_>,
        body: usize,
        family: &Family,
    ) -> Result<Self, SetupError> {
        let Interfaces(list) = interfaces;
        if list.len() > MOST {
            let message = format!("there are {} interfaces", list.len());
            return refuse(message, &format!("{MOST} at most"));
        }
        let points = setup.body(body).points.len();
        let (mut sides, mut crossed, mut limits) = (Vec::new(), Vec::new(), Vec::new());
        for (number, interface) in list.iter().enumerate() {
            limits.push(interface.limit(criterion)?);
            if let Some(cuts) = interface.cuts()? {
                crossed.push(Crossed::Cuts(cuts));
                continue;
            }
            sides.resize(points, 0u64);
            let bits = [1 << (2 * number), 2 << (2 * number)];
            for (name, bit) in interface.between.iter().flatten().zip(bits) {
                for point in points_of(setup, body, name)? {
                    sides[point as usize] |= bit;
                }
            }
            let both = bits[0] | bits[1];
            if let Some(point) = sides.iter().position(|s| s & both == both) {
                let [x, y, z] = setup.body(body).points.position.at(point).into();
                let message = format!("the point at ({x}, {y}, {z}) m belongs to both sides");
                return refuse(message, "regions or materials without common points");
            }
            crossed.push(Crossed::Sides(bits));
        }
        let this = setup.body(body);
        let processes = setup.world().processes();
        let differ = this.material_of_point.windows(2).any(|m| m[0] != m[1]);
        if list.is_empty() && !processes.any(differ) {
            return Ok(Crossings::default());
        }
        let classes = Classes {
            body: this,
            sides,
            crossed,
            point_in: family.points_of_slots(),
        };
        let points = (0..family.points() as u32).into_par_iter();
        let of_point = |point| classes.crossings(family, point);
        let bonds: Vec<Crossing> = points.flat_map_iter(of_point).collect();
        for number in 0..list.len() {
            if !processes.any(bonds.iter().any(|b| b.interface == Some(number as u16))) {
                let message = format!("no bond crosses interface number {}", number + 1);
                return refuse(message, "an interface within the body");
            }
        }
        let warnings = thin_materials(this, &bonds, &setup.world().reducer(body));
        warnings.into_iter().for_each(|warning| setup.warn(warning));
        Ok(Crossings { limits, bonds })
    }

    pub(super) fn is_empty(&self) -> bool {
        self.bonds.is_empty()
    }

    /// Evaluates the limits from those of points and, by the ends of a bond, that of an interface.
    pub(super) fn load(
        &mut self,
        critical: &[f64],
        of_interface: impl Fn(Limit, [usize; 2]) -> f64 + Sync,
    ) {
        let limits = &self.limits;
        self.bonds.par_iter_mut().for_all(|crossing| {
            let ends = [crossing.point as usize, crossing.other as usize];
            let [own, other] = ends.map(|point| critical[point]);
            let passed = crossing.passed.iter().map(|p| critical[*p as usize]);
            let limit = match crossing.interface {
                Some(interface) => of_interface(limits[usize::from(interface)], ends),
                None => passed.fold(own.min(other), f64::min),
            };
            // ends that never break make a bond that never breaks
            let mean = 0.5 * (own + other);
            crossing.factor = if mean.is_finite() { mean / limit } else { 1.0 };
        });
    }

    fn of_point(&self, point: usize) -> &[Crossing] {
        let start = self.bonds.partition_point(|b| (b.point as usize) < point);
        let bonds = &self.bonds[start..];
        &bonds[..bonds.partition_point(|b| b.point as usize == point)]
    }

    /// Mean limit of the ends of a bond over its own limit.
    pub(super) fn factor(&self, point: usize, bond: usize) -> f64 {
        if self.bonds.is_empty() {
            return 1.0;
        }
        let own = self.of_point(point);
        own.iter()
            .find(|b| b.bond as usize == bond)
            .map_or(1.0, |b| b.factor)
    }

    /// Adds what the load of unbroken bonds exceeds their own limits by, over the limit, to the excess of their points.
    /// `ratio` is the load over the mean limit of the ends, from the slots of both.
    pub(super) fn add_excess(
        &self,
        family: &Family,
        is_broken: impl Fn(usize, usize) -> bool + Sync,
        ratio: impl Fn(&Bond, usize, usize) -> f64 + Sync,
        excess: &mut [f64],
    ) {
        let of_point = |bonds: &[Crossing]| {
            let point = bonds[0].point as usize;
            let here = family.slot_of(point);
            let mut rest = bonds;
            let mut sum = 0.0;
            family.for_each_bond(point, |number, bond, other| {
                let Some((next, others)) = rest.split_first() else {
                    return;
                };
                if next.bond as usize != number {
                    return;
                }
                rest = others;
                if !is_broken(point, number) {
                    sum += (ratio(bond, here, other) * next.factor - 1.0).max(0.0);
                }
            });
            (point, sum)
        };
        let points: Vec<&[Crossing]> = self.bonds.chunk_by(|a, b| a.point == b.point).collect();
        let sums: Vec<(usize, f64)> = points.into_par_iter().map(of_point).collect();
        sums.into_iter()
            .for_each(|(point, sum)| excess[point] += sum);
    }
}

/// Sentences about the materials most of whose points are passed by bonds from one side to the other.
fn thin_materials(body: &Body, bonds: &[Crossing], reducer: &Reducer) -> Vec<String> {
    let mut is_passed = vec![false; body.points.len()];
    for point in bonds.iter().flat_map(|b| &b.passed) {
        is_passed[*point as usize] = true;
    }
    let mut sentences = Vec::new();
    for (number, material) in body.materials.iter().enumerate() {
        let points = body.material_of_point.iter().zip(&is_passed);
        let points = points.take(reducer.owned());
        let points = points.filter(|(m, _)| usize::from(**m) == number);
        let passed: Vec<bool> = points.map(|(_, passed)| *passed).collect();
        let count = passed.iter().filter(|passed| **passed).count();
        let [count, all] = [count, passed.len()].map(|own| reducer.total_of(own as f64));
        if count > 0.0 && 2.0 * count >= all {
            sentences.push(format!(
                "material `{}` of body `{}` is thinner than the horizon: bonds reach through it, so that its strength acts \
                 over the width of the horizon (use a finer spacing, or give the strength of the layer as `interface` in \
                 `fracture`)",
                material.name(),
                body.name,
            ));
        }
    }
    sentences
}
