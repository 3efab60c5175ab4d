//! Broken bonds of a laminate, by the way in which they broke, and the bonds that break next.
//!
//! Each layer has two sets of bonds: those of the matrix, to which the dilatation belongs, and those of the fibres. Each interface has two: bonds
//! across, and pairs of crossing bonds. Every set has limits and broken bonds of its own.

use perimelt_core::body::Layers;
use perimelt_core::family::BrokenBonds;
use perimelt_core::{Bond, Family};

use super::LayerSolid;
use super::interface::Interface;
use super::limits::SetLimits;
use super::strength::PlyStrength;
use crate::mechanical::exceeding::{Breakable, Exceeding, broken_pairs, lost_fraction};
use crate::mechanical::fracture::FractureState;
use crate::mechanical::solid::FailureMode;
use crate::plies::{CompleteFamily, is_along, plane_direction};

/// The ways in which bonds break.
const MODES: [&str; 4] = ["fibre", "matrix", "opening", "sliding"];

/// Which bonds a set has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum BondSet {
    /// Of a layer.
    Matrix(usize),
    /// Of a layer.
    Fibres(usize),
    /// Of an interface, one for each point.
    Opening(usize),
    /// Of an interface.
    Sliding(usize),
}

/// Limits and broken bonds of a laminate.
#[derive(Debug)]
pub(super) struct Failure {
    /// The sets in the order of [`BondSet`], by layer or interface.
    pub(super) state: FractureState,
    layers: usize,
    /// Of a layer.
    points: usize,
    pub(super) limits: SetLimits,
    /// Unit vectors along the fibres that have bonds of their own, by layer.
    pub(super) fibres: Vec<Option<[f64; 2]>>,
    /// Whether changes of the conjugate stress heat the body.
    pub(super) heats: bool,
    /// Whether bonds of a set broke.
    has_broken: Vec<bool>,
    /// By mode and point of the body.
    damage: [Vec<f64>; 4],
}

/// What a laminate consists of.
pub(super) struct LaminateParts<'a> {
    pub(super) layers: &'a Layers,
    pub(super) plane: &'a Family,
    pub(super) complete: &'a CompleteFamily,
    pub(super) solids: &'a [LayerSolid],
    pub(super) interfaces: &'a [Interface],
}

impl Failure {
    /// Nothing is broken, and limits are not loaded.
    pub(super) fn new(parts: &LaminateParts<'_>, strength: PlyStrength) -> Self {
        let LaminateParts {
            layers,
            plane,
            solids,
            interfaces,
            ..
        } = *parts;
        let points = layers.points_of_layer();
        let of_body = strength.unbreakable.len();
        let of_fibres = |layer: &LayerSolid| layer.bonds.has_fibres().then_some(layer.bonds.fibre);
        let in_layers = (0..2 * solids.len()).map(|_| plane.unbroken());
        let across = interfaces.iter().map(|_| BrokenBonds::none(points, 1));
        let sheared = interfaces.iter().map(|_| plane.unbroken());
        let broken: Vec<BrokenBonds> = in_layers.chain(across).chain(sheared).collect();
        Failure {
            has_broken: vec![false; broken.len()],
            state: FractureState {
                broken,
                frozen: vec![[0.0; 6]; of_body],
                sliding_energy: match strength.mixed_mode_exponent {
                    Some(_) => vec![0.0; points * interfaces.len()],
                    None => Vec::new(),
                },
            },
            heats: strength.heats,
            layers: solids.len(),
            points,
            fibres: solids.iter().map(of_fibres).collect(),
            damage: std::array::from_fn(|_| vec![0.0; of_body]),
            limits: SetLimits::new(parts, strength),
        }
    }

    fn interfaces(&self) -> usize {
        self.layers - 1
    }

    pub(super) fn number(&self, set: BondSet) -> usize {
        match set {
            BondSet::Matrix(layer) => layer,
            BondSet::Fibres(layer) => self.layers + layer,
            BondSet::Opening(interface) => 2 * self.layers + interface,
            BondSet::Sliding(interface) => 2 * self.layers + self.interfaces() + interface,
        }
    }

    fn set(&self, number: usize) -> BondSet {
        match number / self.layers {
            0 => BondSet::Matrix(number),
            1 => BondSet::Fibres(number - self.layers),
            _ => match number - 2 * self.layers {
                interface if interface < self.interfaces() => BondSet::Opening(interface),
                number => BondSet::Sliding(number - self.interfaces()),
            },
        }
    }

    fn broken(&self, set: BondSet) -> &BrokenBonds {
        &self.state.broken[self.number(set)]
    }

    /// The bonds of a set, by its number.
    pub(super) fn breakable<'a>(&'a self, set: usize, family: &'a Family) -> Breakable<'a> {
        Breakable {
            set,
            family,
            broken: &self.state.broken[set],
        }
    }

    /// Broken bonds of matrix and fibres of a layer; `None` before the first one breaks.
    pub(super) fn of_layer(&self, layer: usize) -> Option<[&BrokenBonds; 2]> {
        let sets = [BondSet::Matrix(layer), BondSet::Fibres(layer)];
        let is_broken = sets.iter().any(|set| self.has_broken[self.number(*set)]);
        is_broken.then(|| sets.map(|set| self.broken(set)))
    }

    /// Broken pairs of crossing bonds of an interface.
    pub(super) fn of_interface(&self, interface: usize) -> &BrokenBonds {
        self.broken(BondSet::Sliding(interface))
    }

    /// Whether the bond of a point of the plane across an interface broke.
    pub(super) fn is_open(&self, interface: usize, point: usize) -> bool {
        self.broken(BondSet::Opening(interface)).of(point) > 0
    }

    /// Whether a point of the body has lost bonds.
    pub(super) fn has_damage(&self, point: usize) -> bool {
        self.damage.iter().any(|damage| damage[point] > 0.0)
    }

    /// Replaces the broken bonds; those before.
    pub(super) fn replace(&mut self, plane: &Family, state: FractureState) -> FractureState {
        let before = std::mem::replace(&mut self.state, state);
        for (has_broken, broken) in self.has_broken.iter_mut().zip(&self.state.broken) {
            *has_broken = broken.total() > 0;
        }
        for point in 0..self.state.frozen.len() {
            self.load_damage(plane, point);
        }
        before
    }

    /// Evaluates the damage of a point of the body from its broken bonds, always in the same order.
    fn load_damage(&mut self, plane: &Family, point: usize) {
        let (layer, number) = (point / self.points, point % self.points);
        let lost = |set: BondSet, along: Option<[f64; 2]>| {
            let counts =
                |bond: &Bond| along.is_none_or(|along| is_along(along, plane_direction(bond)));
            lost_fraction(plane, self.broken(set), number, counts)
        };
        let beside = [
            layer.checked_sub(1),
            (layer < self.interfaces()).then_some(layer),
        ];
        let mean = |of: &dyn Fn(usize) -> f64| {
            let (sum, count) = (beside.iter().flatten()).fold((0.0, 0.0_f64), |(sum, count), i| {
                (sum + of(*i), count + 1.0)
            });
            sum / count.max(1.0)
        };
        let fibre = self.fibres[layer].map(|along| lost(BondSet::Fibres(layer), Some(along)));
        let damage = [
            fibre.unwrap_or(0.0),
            lost(BondSet::Matrix(layer), None),
            mean(&|interface| f64::from(u8::from(self.is_open(interface, number)))),
            mean(&|interface| lost(BondSet::Sliding(interface), None)),
        ];
        for (field, value) in self.damage.iter_mut().zip(damage) {
            field[point] = value;
        }
    }

    /// Whether the bond of a point of the plane with a slot has lost all of its parts in a layer.
    fn is_gone(&self, plane: &Family, layer: usize, [point, slot]: [usize; 2]) -> bool {
        let [matrix, fibres] =
            [BondSet::Matrix(layer), BondSet::Fibres(layer)].map(|set| self.broken(set));
        let mut is_gone = false;
        plane.for_each_bond(point, |number, bond, other| {
            if other == slot {
                let along = self.fibres[layer];
                let has_fibre = along.is_some_and(|along| is_along(along, plane_direction(bond)));
                is_gone = matrix.is_broken(point, number)
                    && (!has_fibre || fibres.is_broken(point, number));
            }
        });
        is_gone
    }

    /// Two points of a plane as points of the body.
    fn pair(&self, layers: [usize; 2], points: [usize; 2]) -> [u32; 2] {
        [0, 1].map(|end| (layers[end] * self.points + points[end]) as u32)
    }

    pub(super) fn broken_pairs(&self, plane: &Family) -> Vec<[u32; 2]> {
        let in_layer = |layer: usize| {
            let pairs = broken_pairs(plane, self.broken(BondSet::Matrix(layer)));
            let gone = move |[point, other]: &[usize; 2]| {
                self.is_gone(plane, layer, [*point, plane.slot_of(*other)])
            };
            pairs
                .filter(gone)
                .map(move |pair| self.pair([layer; 2], pair))
        };
        let across = |interface: usize| {
            let open = (0..self.points).filter(move |point| self.is_open(interface, *point));
            open.map(move |point| self.pair([interface, interface + 1], [point; 2]))
        };
        let in_layers = (0..self.layers).flat_map(in_layer);
        in_layers
            .chain((0..self.interfaces()).flat_map(across))
            .collect()
    }

    pub(super) fn modes(&self) -> Vec<FailureMode<'_>> {
        let mut broken = [0.0; 4];
        for (number, bonds) in self.state.broken.iter().enumerate() {
            let total = bonds.total() as f64;
            match self.set(number) {
                BondSet::Fibres(_) => broken[0] += 0.5 * total,
                BondSet::Matrix(_) => broken[1] += 0.5 * total,
                BondSet::Opening(_) => broken[2] += total,
                BondSet::Sliding(_) => broken[3] += 0.5 * total,
            }
        }
        let modes = MODES.iter().zip(broken).zip(&self.damage);
        modes
            .map(|((name, broken), damage)| FailureMode {
                name,
                broken,
                damage,
            })
            .collect()
    }

    /// Breaks bonds, and adds the damage of their points to `damage`.
    pub(super) fn break_all(
        &mut self,
        plane: &Family,
        found: &[Exceeding],
        damage: &mut [f64],
    ) -> Vec<[u32; 2]> {
        let mut pairs = Vec::new();
        let mut touched = Vec::new();
        for bond in found {
            let set = self.set(bond.set);
            self.has_broken[bond.set] = true;
            let broken = &mut self.state.broken[bond.set];
            match set {
                BondSet::Opening(interface) => {
                    broken.break_bond(bond.point, 0);
                    let pair = self.pair([interface, interface + 1], [bond.point; 2]);
                    touched.extend(pair);
                    pairs.push(pair);
                }
                BondSet::Sliding(interface) => {
                    bond.break_bond(plane, broken, |point, _| {
                        let layers = [interface, interface + 1];
                        touched.extend(layers.map(|l| (l * self.points + point) as u32));
                    });
                }
                BondSet::Matrix(layer) | BondSet::Fibres(layer) => {
                    let pair = bond.break_bond(plane, broken, |point, _| {
                        touched.push((layer * self.points + point) as u32);
                    });
                    let ends = [bond.point, bond.slot];
                    if let Some(pair) = pair.filter(|_| self.is_gone(plane, layer, ends)) {
                        pairs.push(self.pair([layer; 2], pair.map(|point| point as usize)));
                    }
                }
            }
        }
        touched.sort_unstable();
        touched.dedup();
        for point in touched.into_iter().map(|point| point as usize) {
            self.load_damage(plane, point);
            let modes = self.damage.iter().map(|mode| mode[point]);
            damage[point] = modes.fold(damage[point], f64::max);
        }
        pairs
    }
}
