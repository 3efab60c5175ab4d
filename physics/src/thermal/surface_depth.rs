//! Distance of the surface from the outermost points, as it follows from the bonds.
//!
//! A flux q enters the outermost points. Far below, the temperature is linear, `T = T_s - q x / k` with the depth x; at the
//! outermost points it deviates from that line by `c q s / k`, since longer bonds reach beyond them, and bonds at bare
//! surfaces are corrected. The temperature of the surface follows from that of the outermost points as over a distance
//! `d = (1/2 - c) s`. The deviation c solves the equations of the bonds of one column of points in a half space, whose family is
//! that of the body, for a uniform flux and a linear temperature below. It is the same for all surfaces with, and for all without
//! mirrored points behind them, whatever the thickness and the shape of the body.

use nalgebra::{DMatrix, DVector};
use perimelt_core::family::{FamilySpec, Mirrored};
use perimelt_core::shape::{BoxShape, Shape};
use perimelt_core::world::SurfaceDepths;
use perimelt_core::{Body, Face, Family, SlotField};

use super::conduction::coefficient;

/// Layers below the surface whose temperatures deviate, in reaches of the family.
pub(super) const DEVIATING: usize = 4;

/// Layers of the half space, in reaches of the family.
pub(super) const DEEP: usize = 8;

/// Distance of the surface from the outermost points; half a spacing where the points are not on a lattice.
pub(super) fn depths(body: &Body, family: &Family) -> SurfaceDepths {
    if body.lattice().is_none() {
        return SurfaceDepths::default();
    }
    let depth = |is_mirrored: bool| {
        let deviation = deviation(body, family.spec(), is_mirrored);
        // a family so long that the outermost points are warmer than the surface
        deviation.map_or(0.5, |c| (0.5 - c).clamp(0.0, 1.5))
    };
    let is_mirrored = Face::ALL.map(|face| family.spec().layers.contains(&face));
    SurfaceDepths {
        bare: depth(false),
        mirrored: match is_mirrored.contains(&true) {
            true => depth(true),
            false => 0.5,
        },
        is_mirrored,
    }
}

/// The deviation c of the outermost points of a half space whose surface is at x+, with mirrored points behind it or without.
fn deviation(body: &Body, spec: &FamilySpec, is_mirrored: bool) -> Option<f64> {
    let spacing = body.finest_spacing();
    let reach = (spec.horizon.of(spacing) / spacing).ceil().max(1.0) as usize;
    let (layers, known, across) = (DEEP * reach, DEVIATING * reach, 2 * reach + 1);
    let [deep, wide] = [layers, across].map(|cells| cells as f64 * spacing);
    let shape = Shape::Box(BoxShape {
        min: [0.0; 3],
        max: [deep, wide, wide],
    });
    let mut half_space = Body::fill("half space", &shape, body.dimension, spacing, 1.0).ok()?;
    (1..body.dimension).for_each(|axis| half_space.periodic[axis] = true);
    let surface = is_mirrored.then_some(Face::XMax);
    let spec = FamilySpec {
        layers: surface.into_iter().chain([Face::XMin]).collect(),
        audited: Vec::new(),
        ..spec.clone()
    };
    let family = Family::build(&half_space, &spec).ok()?;
    let layer = |x: f64| ((deep - x) / spacing - 0.5).round();
    let positions = &half_space.points.position;
    let layer_of: Vec<f64> = positions.iter().map(|x| layer(x.x)).collect();
    // points behind the surface have the layers of the points that they mirror
    let mut layer_of_slot = SlotField::zeros(&family);
    layer_of_slot.load(&family, &layer_of[..], Mirrored::Scalar);
    let mut point_of_layer = vec![None; layers];
    for (point, layer) in layer_of.iter().enumerate() {
        point_of_layer[*layer as usize].get_or_insert(point);
    }
    deviation_of(known, spacing, |row, visit| {
        let point = point_of_layer[row].expect("each layer has points");
        family.for_each_bond(point, |_, bond, slot| {
            visit(layer_of_slot[slot].max(0.0) as usize, coefficient(bond));
        });
    })
}

/// The deviation c of the outermost layer of a half space of conductivity 1 W/(m K), in which `known` layers deviate. `bonds` calls its
/// argument with the layer at the other end and the coefficient (1/m²) of each bond of a point of a layer, counted from the surface.
pub(super) fn deviation_of(
    known: usize,
    spacing: f64,
    bonds: impl Fn(usize, &mut dyn FnMut(usize, f64)),
) -> Option<f64> {
    // matrix of `sum_j c_ij (T_j - T_i)` over layers, and its residual for a linear temperature
    let mut matrix = DMatrix::<f64>::zeros(known, known);
    let mut rest = DVector::<f64>::zeros(known);
    let linear = |layer: usize| -(layer as f64 + 0.5) * spacing;
    for row in 0..known {
        bonds(row, &mut |other, c| {
            rest[row] += c * (linear(other) - linear(row));
            matrix[(row, row)] -= c;
            if other < known {
                matrix[(row, other)] += c;
            }
        });
    }
    // flux of one into the outermost layer
    rest[0] += 1.0 / spacing;
    let deviations = matrix.lu().solve(&(-rest))?;
    let c: f64 = deviations[0] / spacing;
    c.is_finite().then_some(c)
}
