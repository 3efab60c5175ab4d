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

use std::sync::Arc;

use perimelt_core::body::{Layer, Layers};
use perimelt_core::family::PointBond;
use perimelt_core::material::{Directional, Property};
use perimelt_core::{Body, Family, FamilySpec, SetupError, text};

use crate::plies::{
    CompleteFamily, TensorBonds, fibre_factors, is_along, plane_direction, turned, uncut,
};

/// Conductivities of a ply along and across its fibres and through its thickness, W/(m K).
#[derive(Clone, Copy, Debug)]
struct PlyConductivity([f64; 3]);

/// Conductivity of the bonds of a ply, W/(m K), by their direction.
#[derive(Debug)]
struct ConductingBonds {
    fibre: [f64; 2],
    matrix: TensorBonds,
    /// Added to bonds along the fibres.
    increment: f64,
    /// By point of the plane; empty where it is one.
    factors: Vec<f64>,
}

impl PlyConductivity {
    fn of(body: &Body, found: &[Directional<Property>]) -> Result<Self, SetupError> {
        let refuse = |message: String| {
            let expected = "the same numbers at all temperatures for all plies";
            Err(SetupError::value("conductivity", message, expected))
        };
        let [conductivity] = found else {
            let message = format!("body `{}` has plies of several materials", body.name);
            return refuse(message);
        };
        let along = [0, 1, 2].map(|axis| conductivity.along(axis).constant());
        match along {
            [Some(first), Some(second), Some(third)] => Ok(PlyConductivity([first, second, third])),
            _ => {
                let message = format!("`conductivity` of body `{}` is a table", body.name);
                refuse(message)
            }
        }
    }
}

impl ConductingBonds {
    fn new(
        family: &CompleteFamily,
        uncut: &Family,
        angle: f64,
        [along, across, _]: [f64; 3],
    ) -> Result<Self, SetupError> {
        let (sin, cos) = angle.sin_cos();
        let fibre = [cos, sin];
        let row = family.moment_along(fibre);
        // the moments have a factor of one half
        let by = |values: [f64; 2]| {
            let bonds = TensorBonds::new(family, &(0.5 * turned(fibre, values)));
            bonds.ok_or_else(|| {
                let angle = text::number(angle.to_degrees(), 5);
                let message = format!(
                    "bonds of a ply at {angle} degrees would have negative conductivities: {along} W/(m K) along its fibres, \
                     {across} W/(m K) across them"
                );
                let expected = "plies at 0, 90, 45 or -45 degrees, or conductivities that differ by less than a factor of 3";
                SetupError::value("conductivity", message, expected)
            })
        };
        let has_increment = row > 0.0 && along > across;
        Ok(ConductingBonds {
            fibre,
            matrix: by([if has_increment { across } else { along }, across])?,
            increment: if has_increment {
                (along - across) / row
            } else {
                0.0
            },
            factors: match has_increment {
                true => fibre_factors(uncut, family, fibre),
                false => Vec::new(),
            },
        })
    }

    /// Conductivity of the bond of two points of the plane along a unit vector.
    fn of(&self, direction: [f64; 2], points: [usize; 2]) -> f64 {
        let matrix = self.matrix.of(direction);
        if self.increment == 0.0 || !is_along(self.fibre, direction) {
            return matrix;
        }
        let factor = |point: usize| self.factors.get(point).copied().unwrap_or(1.0);
        matrix + 0.5 * (factor(points[0]) + factor(points[1])) * self.increment
    }
}

/// The family by which a laminate conducts with the conductivity through its thickness, W/(m K), which comes with it.
///
/// # Errors
/// Conductivities that are no numbers or would make bonds negative, a periodic body, a horizon that reaches no point.
pub(super) fn family(
    body: &Body,
    layers: &Layers,
    spec: &FamilySpec,
    found: &[Directional<Property>],
) -> Result<(Family, f64), SetupError> {
    if body.periodic.contains(&true) {
        let message = format!("body `{}` has a `layup` and is periodic", body.name);
        let expected = "a body with a `layup` that is not `periodic`, which ends insulated";
        return Err(SetupError::value("body", message, expected));
    }
    let PlyConductivity(conductivity) = PlyConductivity::of(body, found)?;
    let of_family = |e| SetupError::new("horizon", e);
    let plane = Arc::new(Family::build(layers.plane(), spec).map_err(of_family)?);
    let uncut = uncut(layers.plane(), &plane).map_err(of_family)?;
    let complete = CompleteFamily::new(body.finest_spacing(), spec).map_err(of_family)?;
    let through = conductivity[2];
    let bonds_of = |layer: &Layer| {
        let angle = layers.plies()[layer.ply].angle;
        ConductingBonds::new(&complete, &uncut, angle, conductivity)
    };
    let bonds: Result<Vec<ConductingBonds>, SetupError> =
        layers.layers().iter().map(bonds_of).collect();
    let bonds = bonds?;
    let points = layers.points_of_layer();
    let row = |point: usize| {
        let (layer, number) = layers.place(point);
        let mut row = Vec::new();
        // in series: half of 1 / (d R) per thickness is the weight times the conductivity over the distance
        let across = 0.5 / layers.layers()[layer].thickness;
        let mut beside = |other: usize| {
            row.push(PointBond {
                other: (other * points + number) as u32,
                weight: across,
            });
        };
        layer.checked_sub(1).into_iter().for_each(&mut beside);
        (layer + 1 < bonds.len())
            .then_some(layer + 1)
            .into_iter()
            .for_each(&mut beside);
        plane.for_each_bond(number, |_, bond, slot| {
            if let Some(other) = plane.point_in(slot) {
                let conductivity = bonds[layer].of(plane_direction(bond), [number, other]);
                row.push(PointBond {
                    other: (layer * points + other) as u32,
                    weight: bond.mean() * conductivity / through,
                });
            }
        });
        row
    };
    Ok((Family::of_bonds(body, spec, row), through))
}
