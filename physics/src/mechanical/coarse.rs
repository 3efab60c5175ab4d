//! The coarse space with which Newton's method preconditions the stiffness of a body.

use std::sync::Arc;

use perimelt_core::family::{Continuation, LayerRule};
use perimelt_core::solver::{CoarseGrid, CoarseSpace, Spring};
use perimelt_core::{Body, BrokenBonds, Family};
use rayon::prelude::*;

use super::moduli::Moduli;
use super::residual::Residual;

/// Scale of the layers that tractions bend.
const BENT: [f64; 3] = [0.0; 3];

/// The coarse space of a body, and what it was built from.
#[derive(Debug, Default)]
pub(super) struct Coarse {
    pub(super) space: Option<CoarseSpace>,
    /// By point; `None` without material.
    moduli: Vec<Option<Moduli>>,
    network: Option<Network>,
}

/// What the coarse space of a body has besides its moduli.
#[derive(Clone, Debug, PartialEq)]
struct Layout {
    constraint: Vec<f64>,
    /// Number of broken bonds.
    broken: usize,
    has_material: Vec<bool>,
    /// Factors of the layers behind faces.
    scales: Vec<[f64; 3]>,
}

/// The network of springs of a body, and the points on a coarse grid.
#[derive(Debug)]
struct Network {
    layout: Layout,
    /// `None` for nodes that are not points.
    bonds: Option<Springs>,
    grid: Option<Arc<CoarseGrid>>,
}

impl Coarse {
    /// Points that are not `present` have no stiffness; all are where it is empty.
    ///
    /// Rebuilds the space completely if anything that it was built from changed, so that a resumed run is
    /// bit-identical. Where moduli changed only, as with temperature, the network of springs is kept.
    pub(super) fn update(&mut self, body: &Body, residual: &Residual<'_>, present: &[bool]) {
        let solid = residual.solid.base();
        let moduli = |point: usize| match present.get(point) {
            Some(false) => None,
            _ => Some(solid.moduli_of(point)),
        };
        let moduli: Vec<_> = (0..body.points.len()).map(moduli).collect();
        let rules = rules_of_springs(residual);
        let layout = Layout {
            constraint: residual.constraint.to_vec(),
            broken: solid.broken().map_or(0, BrokenBonds::total),
            has_material: moduli.iter().map(Option::is_some).collect(),
            scales: rules.iter().map(|rule| rule.scale).collect(),
        };
        let network = self.network.as_ref();
        let is_same_network = network.is_some_and(|network| network.layout == layout);
        let points = &residual.points;
        if !points.any(!is_same_network || self.moduli != moduli) {
            return;
        }
        let stiffness = |moduli: &Option<Moduli>| {
            moduli.map_or(0.0, |moduli| moduli.bond_stiffness(body.dimension))
        };
        let stiffness: Vec<f64> = moduli.iter().map(stiffness).collect();
        if points.any(!is_same_network) {
            self.network = Some(Network::new(body, residual, &rules, layout));
        }
        self.moduli = moduli;
        let Some(Network { bonds, grid, .. }) = &self.network else {
            return;
        };
        self.space = match bonds {
            Some(springs) => {
                // points beyond the reach of all bonds have no temperature
                let own = points.own(&stiffness).iter().copied();
                let stiffest = points.max(own.fold(0.0, f64::max));
                let bonds = Bonds::new(residual, &stiffness);
                grid.as_ref().and_then(|grid| {
                    CoarseSpace::new(grid.clone(), stiffest, points, |point, receive| {
                        springs.of(&bonds, point, receive);
                    })
                })
            }
            None => {
                let couplings = |node: usize, receive: &mut dyn FnMut(Spring)| {
                    residual.solid.couplings(node, receive);
                };
                let grid = coarse_grid(body, residual, couplings);
                grid.and_then(|grid| CoarseSpace::new(Arc::new(grid), 1.0, points, couplings))
            }
        };
    }
}

impl Network {
    /// The springs of a body whose points with material have bonds of the stiffness one (Pa).
    fn new(body: &Body, residual: &Residual<'_>, rules: &[LayerRule], layout: Layout) -> Self {
        let has_bonds = residual.solid.base().family().points() > 0;
        if !has_bonds {
            return Network {
                layout,
                bonds: None,
                grid: None,
            };
        }
        let stiffness = layout.has_material.iter();
        let stiffness: Vec<f64> = stiffness.map(|is| f64::from(u8::from(*is))).collect();
        let springs = Springs::new(residual, rules);
        let bonds = Bonds::new(residual, &stiffness);
        let grid = coarse_grid(body, residual, |point, receive| {
            springs.of(&bonds, point, receive);
        });
        Network {
            layout,
            bonds: Some(springs),
            grid: grid.map(Arc::new),
        }
    }
}

/// How the displacement continues behind faces, for springs. Layers under traction follow the points that bend them and do not resist as mirror images would;
/// the bonds of the body are stiffened in their place.
fn rules_of_springs(residual: &Residual<'_>) -> Vec<LayerRule> {
    let rules = residual.homogeneous.iter().map(|rule| LayerRule {
        scale: match rule.traction {
            Some(_) => BENT,
            None => rule.scale,
        },
        ..rule.clone()
    });
    rules.collect()
}

/// The coarse grid of the nodes of a body with the `springs` of each.
fn coarse_grid(
    body: &Body,
    residual: &Residual<'_>,
    springs: impl Fn(usize, &mut dyn FnMut(Spring)) + Sync,
) -> Option<CoarseGrid> {
    let dimension = body.dimension;
    let (constraint, _) = residual.constraint.as_chunks::<3>();
    let free = constraint.iter().map(|c| {
        std::array::from_fn(|axis| match c[axis] > 0.0 || axis >= dimension {
            true => 0.0,
            false => 1.0,
        })
    });
    let positions = residual.solid.base().nodes.positions(body);
    let points = &residual.points;
    CoarseGrid::new(positions, dimension, free.collect(), points, springs)
}

/// The bonds of a body now.
struct Bonds<'a> {
    family: &'a Family,
    broken: Option<&'a BrokenBonds>,
    /// Relative volumes of the components, if they differ.
    volumes: Option<&'a [f64]>,
    /// Stiffness of the bonds of each point, Pa.
    stiffness: &'a [f64],
}

impl<'a> Bonds<'a> {
    fn new(residual: &'a Residual<'_>, stiffness: &'a [f64]) -> Self {
        let solid = residual.solid.base();
        Bonds {
            family: solid.family(),
            broken: solid.broken(),
            volumes: residual.volumes,
            stiffness,
        }
    }
}

/// The bonds of a body as springs.
#[derive(Debug)]
struct Springs {
    /// The point in each slot, or whose image is in it.
    point_in: Vec<u32>,
    /// Factors on the displacement of each slot: those of its image, one for points.
    scales: Vec<[f64; 3]>,
    /// Factor by which the bonds of each point are stiffened in place of its bonds to layers under traction.
    stand_in: Vec<f64>,
    /// Fraction of the stiffness of a spring that also resists motion across it.
    across: f64,
}

impl Springs {
    fn new(residual: &Residual<'_>, rules: &[LayerRule]) -> Self {
        let (solid, dimension) = (residual.solid.base(), residual.dimension);
        let family = solid.family();
        let point_in = family.points_of_slots();
        let mut scales = vec![[1.0; 3]; point_in.len()];
        for image in family.images(&Continuation::plain(rules)) {
            scales[image.slot] = image.scale;
        }
        let stand_in = |point: usize| {
            let [mut all, mut own] = [0.0; 2];
            family.for_each_bond(point, |_, bond, slot| {
                all += bond.weight;
                if scales[slot] != BENT {
                    own += bond.weight;
                }
            });
            if own > 0.0 { all / own } else { 1.0 }
        };
        let points = &residual.points;
        let stand_in = (0..family.points()).into_par_iter().map(stand_in);
        let mut stand_in: Vec<f64> = stand_in.collect();
        stand_in.resize(residual.constraint.len() / 3, 1.0);
        points.bring(&mut stand_in);
        let [count] = points.sum_points(|_| [1.0]);
        let bonds = points.total_of(family.bonds() as f64);
        // springs to the nearest neighbours along the axes alone do not resist shear
        let nearest_only = bonds <= 2.0 * dimension as f64 * count && dimension > 1;
        Springs {
            point_in,
            scales,
            stand_in,
            across: match nearest_only && solid.properties.bonds_shear {
                true => 0.2,
                false => 0.0,
            },
        }
    }

    /// Passes the springs of a point to `receive`.
    fn of(&self, bonds: &Bonds<'_>, point: usize, receive: &mut dyn FnMut(Spring)) {
        let Self {
            stand_in, scales, ..
        } = self;
        let stiffness = bonds.stiffness;
        let volume = bonds.volumes.map_or(1.0, |v| v[3 * point]);
        bonds.family.for_each_bond(point, |number, bond, slot| {
            let is_broken = bonds.broken.is_some_and(|b| b.is_broken(point, number));
            if scales[slot] == BENT || is_broken {
                return;
            }
            let other = self.point_in[slot] as usize;
            let sum = stiffness[point] * bond.weight + stiffness[other] * bond.dual;
            let stiffness = 0.25 * (stand_in[point] + stand_in[other]) * volume * sum / bond.length;
            let along = bond.xi.map(|xi| xi / bond.length);
            receive(Spring {
                stiffness: Spring::axial(stiffness, along, self.across),
                to: other,
                scale: scales[slot],
            });
        });
    }
}
