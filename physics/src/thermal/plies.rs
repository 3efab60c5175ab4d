//! Conduction in laminates: bonds within each layer by their direction, and bonds between layers.
//!
//! ```text
//! ply:        sum_j 2 mean(w) C(n) (T_j - T_i) / |xi|,   C(n) = k2 + F [n along the fibres],   sum w |xi| F = k1 - k2
//! interface:  k3 (T_above - T_i) / (h_i d)                h_i: thickness of the layer of the point, d: distance of the layers
//! ```
//!
//! with the conductivities k1, k2, k3 of the ply along and across its fibres and through the thickness. F is the fibre increment of
//! \[Gao2020\], chapter 4, with the mean of both ends, so that heat is conserved; its row is complete at each point, also at edges. Without a bond
//! along the fibres, and where fibres conduct less than what is between them, C has waves of 2 psi, as long as no bond is negative. Linear
//! temperatures are in equilibrium, with the exact flux: across plies the parts conduct in series. The published model exchanges heat between plies
//! over a disc, which is off by the sum over the disc where plies are thinner than the spacing.
//!
//! C is linear in k2 and k1 - k2: a bond has a weight for each ([`PointBond`]), and conductivities may depend on the temperature.
//!
//! Each point has the conductivities of its material. The parts of a bond in two materials conduct in series: between layers by the distances of
//! the layers from the plane where their cells meet, within a layer as in other bodies ([`interfaces`](super::interfaces)). Across plies the resistance is exact.
//! Within a layer it is exact with a horizon of one spacing, or where C has the same ratio in all directions; otherwise what fibres conduct along the
//! interface, within a horizon, acts on the flux across it.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use perimelt_core::body::{Layer, Layers};
use perimelt_core::family::PointBond;
use perimelt_core::material::{Directional, EnthalpyCurve, HeatPotential, Property};
use perimelt_core::shape::{BoxShape, Shape};
use perimelt_core::solver::reduce::max_abs;
use perimelt_core::{Body, Face, Family, FamilySpec, SetupError, text};

use super::interfaces::{Interfaces, MaterialPoints};
use super::surface_depth::{Column, DEEP, DEVIATING};
use crate::plies::{
    CompleteFamily, TensorBonds, fibre_factors, is_along, plane_direction, turned, uncut,
};

/// Conductivities of plies along and across their fibres and through their thickness, W/(m K).
#[derive(Clone, Debug)]
pub(super) struct PlyConductivity([Property; 3]);

/// What conducts in the bonds of a ply, by their direction.
#[derive(Debug)]
struct ConductingBonds {
    fibre: [f64; 2],
    /// Of k2.
    matrix: TensorBonds,
    /// Of k1 - k2.
    excess: Excess,
}

/// How bonds carry what fibres conduct beyond the rest.
#[derive(Debug)]
enum Excess {
    /// By bonds along the fibres.
    Fibre {
        /// Over the excess of the conductivity.
        increment: f64,
        /// By point of the plane; empty where it is one.
        factors: Vec<f64>,
    },
    /// By waves over all directions.
    Waves(TensorBonds),
}

/// The family by which a laminate conducts.
pub(super) struct ConductingPlies {
    pub(super) family: Family,
    /// By material.
    pub(super) conductivity: Vec<PlyConductivity>,
    /// Distances of points from other materials in their layers, where there are several materials.
    pub(super) interfaces: Option<Interfaces>,
    /// By layer and material, distances of the edges across x and y from the outermost points, in spacings.
    pub(super) edges: Vec<Vec<[f64; 2]>>,
}

/// The materials of layers.
struct LayerMatter<'a> {
    layers: &'a Layers,
    conductivity: &'a [PlyConductivity],
    /// Of the points of each layer.
    materials: Vec<BTreeSet<u16>>,
}

impl<'a> LayerMatter<'a> {
    fn new(body: &Body, layers: &'a Layers, conductivity: &'a [PlyConductivity]) -> Self {
        let of_layers = body.material_of_point.chunks(layers.points_of_layer());
        let materials = of_layers.map(|layer| layer.iter().copied().collect());
        LayerMatter {
            layers,
            conductivity,
            materials: materials.collect(),
        }
    }

    /// Angle of the fibres of a layer, rad.
    fn angle(&self, layer: usize) -> f64 {
        self.layers.plies()[self.layers.layers()[layer].ply].angle
    }

    fn materials(&self, layer: usize) -> Vec<&'a PlyConductivity> {
        let own = self.materials[layer].iter();
        own.map(|m| &self.conductivity[*m as usize]).collect()
    }

    /// By layer and material, the distances of the edges across x and y: `distance` is that with an angle of the fibres between the bonds of some
    /// materials at a point of one of them.
    fn edges(
        &self,
        distance: impl Fn(f64, &[&PlyConductivity], &PlyConductivity) -> f64,
    ) -> Vec<Vec<[f64; 2]>> {
        // layers of one ply mostly have the same materials
        let mut known = BTreeMap::new();
        let mut of_layer = |(number, layer): (usize, &Layer)| {
            let key = (layer.ply, &self.materials[number]);
            let materials = self.materials(number);
            let edge = |own, from| distance(self.angle(number) - from, &materials, own);
            let both = |own| [0.0, std::f64::consts::FRAC_PI_2].map(|from| edge(own, from));
            let edges = || self.conductivity.iter().map(both).collect::<Vec<_>>();
            known.entry(key).or_insert_with(edges).clone()
        };
        self.layers
            .layers()
            .iter()
            .enumerate()
            .map(&mut of_layer)
            .collect()
    }
}

impl PlyConductivity {
    fn of(conductivity: &Directional<Property>) -> Self {
        PlyConductivity([0, 1, 2].map(|axis| conductivity.along(axis).clone()))
    }

    pub(super) fn is_constant(&self) -> bool {
        self.0.iter().all(Property::is_constant)
    }

    /// At a temperature (K) and liquid fraction.
    pub(super) fn at(&self, temperature: f64, liquid: f64) -> [f64; 3] {
        self.0.each_ref().map(|k| k.at(temperature, liquid))
    }

    pub(super) fn potentials(&self, curve: &EnthalpyCurve) -> [HeatPotential; 3] {
        self.0.each_ref().map(|k| HeatPotential::new(k, curve))
    }

    /// The largest of each.
    pub(super) fn largest(&self) -> [f64; 3] {
        self.0.each_ref().map(|k| max_abs(&k.values()))
    }

    /// The mean of the given values of each.
    fn mean(&self) -> [f64; 3] {
        self.0.each_ref().map(|k| {
            let values = k.values();
            values.iter().sum::<f64>() / values.len() as f64
        })
    }

    /// k1 and k2 at the rows of their tables, solid and liquid: what depends on them monotonically has its extremes here.
    fn in_plane(&self) -> Vec<[f64; 2]> {
        let [along, across, _] = &self.0;
        let mut rows = [along.temperatures(), across.temperatures()].concat();
        // of numbers
        rows.push(300.0);
        let phases = rows.iter().flat_map(|&t| [(t, 0.0), (t, 1.0)]);
        phases
            .map(|(t, liquid)| [along.at(t, liquid), across.at(t, liquid)])
            .collect()
    }

    /// Largest difference of k1 and k2.
    pub(super) fn largest_excess(&self) -> f64 {
        let rows = self.in_plane().into_iter();
        rows.map(|[along, across]| (along - across).abs())
            .fold(0.0, f64::max)
    }
}

impl ConductingBonds {
    fn new(
        family: &CompleteFamily,
        uncut: &Family,
        angle: f64,
        materials: &[&PlyConductivity],
    ) -> Result<Self, SetupError> {
        let (sin, cos) = angle.sin_cos();
        let fibre = [cos, sin];
        let row = family.moment_along(fibre);
        let rows: Vec<[f64; 2]> = materials.iter().flat_map(|k| k.in_plane()).collect();
        let has_increment = row > 0.0 && rows.iter().all(|[along, across]| along >= across);
        // the moments have a factor of one half
        let by = |values| TensorBonds::new(family, &(0.5 * turned(fibre, values)));
        let excess = match has_increment {
            true => Some(Excess::Fibre {
                increment: 1.0 / row,
                factors: fibre_factors(uncut, family, fibre),
            }),
            false => by([1.0, 0.0]).map(Excess::Waves),
        };
        let bonds = by([1.0, 1.0]).zip(excess);
        let bonds = bonds.map(|(matrix, excess)| ConductingBonds {
            fibre,
            matrix,
            excess,
        });
        let is_positive = |bonds: &ConductingBonds, [along, across]: [f64; 2]| {
            let conducts = |direction: [f64; 2]| {
                let [matrix, excess] = bonds.of(direction, [usize::MAX; 2]);
                across * matrix + (along - across) * excess
            };
            // rounding
            let least = -1e-12 * along.max(across);
            family.bonds.iter().all(|b| conducts(b.direction) >= least)
        };
        let mut negative = None;
        if let Some(bonds) = bonds {
            negative = rows
                .iter()
                .find(|values| !is_positive(&bonds, **values))
                .copied();
            if negative.is_none() {
                return Ok(bonds);
            }
        }
        Err(negative_bonds(angle, negative.unwrap_or(rows[0]), &rows))
    }

    /// What k2 and k1 - k2 are multiplied by in the bond of two points of the plane along a unit vector. A point beyond the last one is
    /// one inside.
    fn of(&self, direction: [f64; 2], points: [usize; 2]) -> [f64; 2] {
        let excess = match &self.excess {
            Excess::Waves(bonds) => bonds.of(direction),
            Excess::Fibre { increment, factors } if is_along(self.fibre, direction) => {
                let factor = |point: usize| factors.get(point).copied().unwrap_or(1.0);
                0.5 * (factor(points[0]) + factor(points[1])) * increment
            }
            Excess::Fibre { .. } => 0.0,
        };
        [self.matrix.of(direction), excess]
    }
}

/// The mistake of a ply at an angle (rad) of which a bond would be negative, with conductivities for which it would, and all of them.
fn negative_bonds(angle: f64, [along, across]: [f64; 2], rows: &[[f64; 2]]) -> SetupError {
    let angle = text::number(angle.to_degrees(), 5);
    let message = format!(
        "bonds of a ply at {angle} degrees would have negative conductivities: {along} W/(m K) along its fibres, \
         {across} W/(m K) across them"
    );
    let changes = rows.iter().any(|[k1, k2]| k1 < k2) && rows.iter().any(|[k1, k2]| k1 > k2);
    let expected = match changes {
        true => {
            "fibres that conduct more than what is between them at all temperatures, or conductivities that differ by less than a factor of 3"
        }
        false => {
            "plies at 0, 90, 45 or -45 degrees, or conductivities that differ by less than a factor of 3"
        }
    };
    SetupError::value("conductivity", message, expected)
}

/// Distance of an edge of a layer from outermost points of a material, in spacings, across an axis from which the fibres run at an angle (rad),
/// with the bonds of the `materials` of the layer: see [`surface_depth`](super::surface_depth).
fn edge_depth(
    complete: &CompleteFamily,
    spec: &FamilySpec,
    spacing: f64,
    angle: f64,
    materials: &[&PlyConductivity],
    own: &PlyConductivity,
) -> Option<f64> {
    let reach = (spec.horizon.of(spacing) / spacing).ceil().max(1.0) as usize;
    // the neighbours of the middle row are complete across it
    let (deep, wide) = (DEEP * reach, 4 * reach + 1);
    let shape = Shape::Box(BoxShape {
        min: [0.0; 3],
        max: [deep as f64 * spacing, wide as f64 * spacing, spacing],
    });
    let plane = Body::fill("half plane", &shape, 2, spacing, 1.0).ok()?;
    let family = Family::build(&plane, spec).ok()?;
    let bonds = ConductingBonds::new(complete, &family, angle, materials).ok()?;
    let [along, across, _] = own.mean();
    let (sin, cos) = angle.sin_cos();
    let normal = turned([cos, sin], [along, across])[(0, 0)];
    let position = &plane.points.position;
    // the surface is at the upper end of x
    let layer = |point: usize| deep - 1 - (position[point].x / spacing) as usize;
    let middle = |point: usize| (position[point].y / spacing) as usize == wide / 2;
    let mut row = vec![0; deep];
    (0..position.len())
        .filter(|p| middle(*p))
        .for_each(|p| row[layer(p)] = p);
    let column = Column {
        known: DEVIATING * reach,
        spacing,
        distance: spacing,
    };
    let flux_into = |layer: usize| f64::from(u8::from(layer == 0));
    let deviation = column.deviation(flux_into, |number, visit| {
        let point = row[number];
        family.for_each_bond(point, |_, bond, slot| {
            if let Some(other) = family.point_in(slot) {
                let [matrix, excess] = bonds.of(plane_direction(bond), [point, other]);
                let conducts = across * matrix + (along - across) * excess;
                let coefficient = 2.0 * bond.mean() * bond.inverse_length * conducts / normal;
                visit(layer(other), coefficient);
            }
        });
    });
    deviation.map(|c| (0.5 - c).clamp(0.0, 1.5))
}

/// The family by which a laminate conducts.
///
/// # Errors
/// Conductivities that would make bonds negative, a periodic body, a horizon that reaches no point.
pub(super) fn family(
    body: &Body,
    layers: &Layers,
    spec: &FamilySpec,
    found: &[Directional<Property>],
) -> Result<ConductingPlies, SetupError> {
    if body.periodic.contains(&true) {
        let message = format!("body `{}` has a `layup` and is periodic", body.name);
        let expected = "a body with a `layup` that is not `periodic`, which ends insulated";
        return Err(SetupError::value("body", message, expected));
    }
    let conductivity: Vec<PlyConductivity> = found.iter().map(PlyConductivity::of).collect();
    let of_family = |e| SetupError::new("horizon", e);
    let plane = Arc::new(Family::build(layers.plane(), spec).map_err(of_family)?);
    let uncut = uncut(layers.plane(), &plane).map_err(of_family)?;
    let spacing = body.finest_spacing();
    let complete = CompleteFamily::new(spacing, spec).map_err(of_family)?;
    let points = layers.points_of_layer();
    let matter = LayerMatter::new(body, layers, &conductivity);
    let bonds_of = |layer: usize| {
        let (angle, materials) = (matter.angle(layer), matter.materials(layer));
        ConductingBonds::new(&complete, &uncut, angle, &materials)
    };
    let numbers = 0..layers.layers().len();
    let bonds: Result<Vec<ConductingBonds>, SetupError> = numbers.map(bonds_of).collect();
    let bonds = bonds?;
    let row = |point: usize| {
        let (layer, number) = layers.place(point);
        let mut row = Vec::new();
        // in series: half of 1 / (d R) per thickness is the weight times the conductivity over the distance
        let across = 0.5 / layers.layers()[layer].thickness;
        let mut beside = |other: usize| {
            let face = if other > layer {
                Face::ZMax
            } else {
                Face::ZMin
            };
            let distance = (layers.layers()[other].z - layers.layers()[layer].z).abs();
            row.push(PointBond {
                other: (other * points + number) as u32,
                weights: [across, body.face_distance(point, face) / distance],
            });
        };
        layer.checked_sub(1).into_iter().for_each(&mut beside);
        (layer + 1 < bonds.len())
            .then_some(layer + 1)
            .into_iter()
            .for_each(&mut beside);
        plane.for_each_bond(number, |_, bond, slot| {
            if let Some(other) = plane.point_in(slot) {
                let parts = bonds[layer].of(plane_direction(bond), [number, other]);
                row.push(PointBond {
                    other: (layer * points + other) as u32,
                    weights: parts.map(|part| bond.mean() * part),
                });
            }
        });
        row
    };
    let family = Family::of_bonds(body, spec, row);
    let edges = matter.edges(|angle, materials, own| {
        edge_depth(&complete, spec, spacing, angle, materials, own).unwrap_or(0.5)
    });
    let points = MaterialPoints {
        material: &body.material_of_point,
        spacing: &body.points.spacing,
    };
    let has_several = conductivity.len() > 1;
    Ok(ConductingPlies {
        family,
        interfaces: has_several.then(|| Interfaces::of_layers(&plane, points)),
        edges,
        conductivity,
    })
}
