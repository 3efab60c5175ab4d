//! The coarse space with which Newton's method preconditions the stiffness of a body.

use perimelt_core::family::{Continuation, LayerRule};
use perimelt_core::solver::{CoarseSpace, Spring};
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
    constraint: Vec<f64>,
    /// Number of broken bonds.
    broken: usize,
}

impl Coarse {
    /// Points that are not `present` have no stiffness; all are where it is empty.
    ///
    /// Rebuilds the space completely if anything that it was built from changed, so that a resumed run is
    /// bit-identical.
    pub(super) fn update(&mut self, body: &Body, residual: &Residual<'_>, present: &[bool]) {
        let (solid, constraint) = (residual.solid.base(), residual.constraint);
        let moduli = |point: usize| match present.get(point) {
            Some(false) => None,
            _ => Some(solid.moduli_of(point)),
        };
        let moduli: Vec<_> = (0..body.points.len()).map(moduli).collect();
        let broken = solid.broken();
        let total = broken.map_or(0, BrokenBonds::total);
        let is_known =
            self.moduli == moduli && self.constraint == *constraint && self.broken == total;
        if !residual.points.any(!is_known) {
            return;
        }
        let stiffness = |moduli: &Option<Moduli>| {
            moduli.map_or(0.0, |moduli| moduli.bond_stiffness(body.dimension))
        };
        let has_bonds = solid.family().points() > 0;
        let space = match has_bonds {
            true => {
                let stiffness: Vec<f64> = moduli.iter().map(stiffness).collect();
                let springs = Springs::new(residual, &stiffness);
                coarse_space(body, residual, |point, receive| springs.of(point, receive))
            }
            false => coarse_space(body, residual, |node, receive| {
                residual.solid.couplings(node, receive);
            }),
        };
        *self = Coarse {
            space,
            constraint: constraint.to_vec(),
            broken: total,
            moduli,
        };
    }
}

/// The coarse space of the nodes of a body with the `springs` of each.
fn coarse_space(
    body: &Body,
    residual: &Residual<'_>,
    springs: impl Fn(usize, &mut dyn FnMut(Spring)) + Sync,
) -> Option<CoarseSpace> {
    let dimension = body.dimension;
    let (constraint, _) = residual.constraint.as_chunks::<3>();
    let free = constraint.iter().map(|c| {
        std::array::from_fn(|axis| match c[axis] > 0.0 || axis >= dimension {
            true => 0.0,
            false => 1.0,
        })
    });
    let positions = residual.solid.base().nodes.positions(body);
    CoarseSpace::new(
        positions,
        dimension,
        free.collect(),
        &residual.points,
        springs,
    )
}

/// The bonds of a body as springs.
struct Springs<'a> {
    /// Relative volumes of the components, if they differ.
    volumes: Option<&'a [f64]>,
    family: &'a Family,
    broken: Option<&'a BrokenBonds>,
    /// Stiffness of the bonds of each point, Pa.
    stiffness: &'a [f64],
    /// The point in each slot, or whose image is in it.
    point_in: Vec<u32>,
    /// Factors on the displacement of each slot: those of its image, one for points.
    scales: Vec<[f64; 3]>,
    /// Factor by which the bonds of each point are stiffened in place of its bonds to layers under traction.
    stand_in: Vec<f64>,
    /// Fraction of the stiffness of a spring that also resists motion across it.
    across: f64,
}

impl<'a> Springs<'a> {
    fn new(residual: &'a Residual<'_>, stiffness: &'a [f64]) -> Self {
        let (solid, dimension) = (residual.solid.base(), residual.dimension);
        let family = solid.family();
        // Layers under traction follow the points that bend them and do not resist as mirror images would;
        // the bonds of the body are stiffened in their place.
        let rules = residual.homogeneous.iter().map(|rule| LayerRule {
            scale: match rule.traction {
                Some(_) => BENT,
                None => rule.scale,
            },
            ..rule.clone()
        });
        let rules: Vec<LayerRule> = rules.collect();
        let point_in = family.points_of_slots();
        let mut scales = vec![[1.0; 3]; point_in.len()];
        for image in family.images(&Continuation::plain(&rules)) {
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
        stand_in.resize(stiffness.len(), 1.0);
        points.bring(&mut stand_in);
        let [count] = points.sum_points(|_| [1.0]);
        let bonds = points.total_of(family.bonds() as f64);
        // springs to the nearest neighbours along the axes alone do not resist shear
        let nearest_only = bonds <= 2.0 * dimension as f64 * count && dimension > 1;
        Springs {
            volumes: residual.volumes,
            family,
            broken: solid.broken(),
            stiffness,
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
    fn of(&self, point: usize, receive: &mut dyn FnMut(Spring)) {
        let Self {
            stiffness,
            stand_in,
            scales,
            ..
        } = self;
        let volume = self.volumes.map_or(1.0, |v| v[3 * point]);
        self.family.for_each_bond(point, |number, bond, slot| {
            let is_broken = self.broken.is_some_and(|b| b.is_broken(point, number));
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
