//! How far the surface lies from the outermost points, as bonds see it.
//!
//! A flux q enters the outermost points. Far below, the temperature is linear, `T = T_s - q x / k` with the depth x; at the
//! outermost points it deviates from that line by `c q s / k`, since longer bonds reach beyond them, and bonds at bare
//! surfaces are corrected. The temperature of the surface follows from that of the outermost points as over a distance
//! `d = (1/2 - c) s`. The deviation c solves the equations of the bonds of one column of points, whose rows are those of the
//! family, for a uniform flux and a linear temperature below.

use nalgebra::{DMatrix, DVector, Vector3};
use perimelt_core::family::Mirrored;
use perimelt_core::{Body, Face, Family, SlotField};

use super::conduction::coefficient;

/// Layers of the column.
const LAYERS: usize = 14;

/// Cells on all sides of a column in which the surface has to be plane, for a representative one.
const FLAT: usize = 3;

/// Distances of the surface from the outermost points by direction, in spacings; half a spacing where no column of points
/// below a plane surface is deep enough.
pub(super) fn depths(body: &Body, family: &Family) -> [f64; 6] {
    let mut depths = [0.5; 6];
    for face in Face::ALL.into_iter().filter(|f| f.axis() < body.dimension) {
        if let Some(column) = column_below(body, face) {
            let deviation = deviation(body, family, (face, &column));
            // a family so long that the outermost points are warmer than the surface
            depths[face as usize] = deviation.map_or(0.5, |c| (0.5 - c).clamp(0.0, 1.5));
        }
    }
    depths
}

/// Points below the middle of a plane part of the surface, from the outermost one inwards.
fn column_below(body: &Body, face: Face) -> Option<Vec<usize>> {
    let inwards = face.opposite();
    let bare = |point: usize| body.neighbour(point, face).is_none();
    let sideways = Face::ALL.into_iter();
    let sideways: Vec<Face> = sideways
        .filter(|f| f.axis() < body.dimension && f.axis() != face.axis())
        .collect();
    let is_flat = |point: usize, reach: usize| {
        sideways.iter().all(|side| {
            let mut at = Some(point);
            (0..reach).all(|_| {
                at = at.and_then(|p| body.neighbour(p, *side));
                at.is_some_and(bare)
            })
        })
    };
    let column = |point: usize| {
        let next = |p: &usize| body.neighbour(*p, inwards);
        std::iter::successors(Some(point), next)
            .take(LAYERS)
            .collect::<Vec<_>>()
    };
    for reach in [FLAT, 1, 0] {
        let mut points = (0..body.points.len()).filter(|&p| bare(p) && is_flat(p, reach));
        // the first one is at the edge of the plane part that is flat enough
        if let Some(point) = points.next() {
            let column = column(point);
            return (column.len() == LAYERS).then_some(column);
        }
    }
    None
}

/// The deviation c of the outermost point of a column.
fn deviation(body: &Body, family: &Family, (face, column): (Face, &[usize])) -> Option<f64> {
    let spacing = body.points.spacing[column[0]];
    let axis = face.axis();
    let top = body.points.position[column[0]][axis];
    let sign = face.normal()[axis];
    let below = |x: &Vector3<f64>| (sign * (top - x[axis]) / spacing).round();
    let layers: Vec<f64> = body.points.position.iter().map(below).collect();
    // points behind faces have the layers of those that they mirror
    let mut layer_of_slot = SlotField::zeros(family);
    layer_of_slot.load(family, &layers[..], Mirrored::Scalar);
    // the matrix of `sum_j c_ij (T_j - T_i)` over layers, and what a linear temperature leaves
    let mut matrix = DMatrix::<f64>::zeros(LAYERS, LAYERS);
    let mut rest = DVector::<f64>::zeros(LAYERS);
    let linear = |layer: usize| -(layer as f64 + 0.5) * spacing;
    for (row, &point) in column.iter().enumerate() {
        family.for_each_bond(point, |_, bond, slot| {
            let other = layer_of_slot[slot].max(0.0) as usize;
            let c = coefficient(bond);
            rest[row] += c * (linear(other) - linear(row));
            matrix[(row, row)] -= c;
            if other < LAYERS {
                matrix[(row, other)] += c;
            }
        });
    }
    // flux of one into the outermost layer, conductivity of one
    rest[0] += 1.0 / spacing;
    // below, the temperature is linear
    let known = LAYERS - 4;
    let matrix = matrix.view((0, 0), (known, known)).into_owned();
    let rest = rest.rows(0, known).into_owned();
    let deviations = matrix.lu().solve(&(-rest))?;
    let c: f64 = deviations[0] / spacing;
    c.is_finite().then_some(c)
}
