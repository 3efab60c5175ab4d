//! Distance of the surface from the outermost points, as it follows from the bonds.
//!
//! A flux q enters the outermost points. Far below, the temperature is linear, `T = T_s - q x / k` with the depth x; at the
//! outermost points it deviates from that line by `c q s / k`, since longer bonds reach beyond them, and bonds at bare
//! surfaces are corrected. The temperature of the surface follows from that of the outermost points as over a distance
//! `d = (1/2 - c) s`, and `(cos / 2 - c) s` at the steps of an inclined surface. The deviation c solves the equations of the bonds of a
//! half space, whose family is that of the body, for a uniform flux and a linear temperature below. Its points at one distance from
//! the surface have the same temperature. It is the same for all surfaces of one direction, whatever the thickness and the shape of
//! the body.

use nalgebra::{DMatrix, DVector, Vector3};
use perimelt_core::family::{FamilySpec, Mirrored};
use perimelt_core::shape::{BoxShape, Cylinder, Shape};
use perimelt_core::world::SurfaceDepths;
use perimelt_core::{Body, Face, Family, SlotField};

use super::conduction::coefficient;

/// Depth below the surface whose temperatures deviate, in reaches of the family.
pub(super) const DEVIATING: usize = 4;

/// Depth of the half space, in reaches of the family.
pub(super) const DEEP: usize = 8;

/// Distance of the surface from the outermost points; half a spacing where the points are not on a lattice.
pub(super) fn depths(body: &Body, family: &Family) -> SurfaceDepths {
    if body.lattice().is_none() {
        return SurfaceDepths::default();
    }
    let deviation = |normal: [i32; 3], is_mirrored: bool| {
        let half_space = HalfSpace::new(body, family.spec(), normal, is_mirrored);
        half_space.and_then(|h| h.deviation()).unwrap_or(0.0)
    };
    let is_mirrored = Face::ALL.map(|face| family.spec().layers.contains(&face));
    let mut depths = SurfaceDepths {
        is_mirrored,
        ..SurfaceDepths::default()
    };
    if is_mirrored.contains(&true) {
        depths.mirrored = deviation([1, 0, 0], true);
    }
    let has_steps = body.has_steps();
    for (c, normal) in depths.bare.iter_mut().zip(SurfaceDepths::NORMALS) {
        let is_needed = has_steps && normal[body.dimension..].iter().all(|n| *n == 0);
        if is_needed || normal == [1, 0, 0] {
            *c = deviation(normal, false);
        }
    }
    depths
}

/// Points below a plane surface that is inclined to their lattice. Points in a plane parallel to the surface are equivalent: the lattice
/// has a translation from one to the other. These planes are its layers, counted from the surface.
struct HalfSpace {
    family: Family,
    spacing: f64,
    /// Components without a common factor.
    normal: [i32; 3],
    layer_of: Vec<usize>,
    /// A point of each layer that deviates, far from the sides of the part of the half space that is here.
    point_of_layer: Vec<usize>,
}

impl HalfSpace {
    fn new(
        body: &Body,
        spec: &FamilySpec,
        normal: [i32; 3],
        is_mirrored: bool,
    ) -> Option<HalfSpace> {
        let spacing = body.finest_spacing();
        let reach = (spec.horizon.of(spacing) / spacing).ceil().max(1.0) as usize;
        let direction = Vector3::from(normal.map(f64::from));
        let size = direction.norm();
        // the families of the neighbours of the points of the layers are complete
        let deep = (DEEP * reach) as f64 * spacing;
        let wide = (2 * reach + 1) as f64 * spacing;
        let is_along_axis = normal == [1, 0, 0];
        let shape = match is_along_axis {
            true => Shape::Box(BoxShape {
                min: [0.0; 3],
                max: [deep, wide, wide],
            }),
            false => Shape::Cylinder(Cylinder {
                start: [0.0; 3],
                end: (direction * (deep / size)).into(),
                radius: (2.0 * reach as f64 + 2.5) * spacing,
            }),
        };
        let mut points = Body::fill("half space", &shape, body.dimension, spacing, 1.0).ok()?;
        if is_along_axis {
            (1..body.dimension).for_each(|axis| points.periodic[axis] = true);
        }
        let surface = is_mirrored.then_some(Face::XMax);
        let spec = FamilySpec {
            layers: surface.into_iter().collect(),
            audited: Vec::new(),
            ..spec.clone()
        };
        let family = Family::build(&points, &spec).ok()?;
        let positions = &points.points.position;
        let height = |x: &Vector3<f64>| x.dot(&direction) / spacing;
        let top = positions.iter().map(height).fold(f64::MIN, f64::max);
        let layer_of: Vec<usize> = positions
            .iter()
            .map(|x| (top - height(x)).round() as usize)
            .collect();
        let (min, max) = points.bounds();
        let middle = 0.5 * (min + max);
        let from_axis = |x: &Vector3<f64>| {
            let offset = x - middle;
            (offset - direction * (offset.dot(&direction) / (size * size))).norm_squared()
        };
        let layers = (size * (DEVIATING * reach) as f64).ceil() as usize;
        let mut nearest = vec![(f64::INFINITY, 0); layers];
        for (point, x) in positions.iter().enumerate() {
            if let Some(best) = nearest.get_mut(layer_of[point]) {
                let distance = from_axis(x);
                if distance < best.0 {
                    *best = (distance, point);
                }
            }
        }
        Some(HalfSpace {
            family,
            spacing,
            normal,
            layer_of,
            point_of_layer: nearest.into_iter().map(|(_, point)| point).collect(),
        })
    }

    /// The deviation c of the outermost points, on the mean of the flux into them.
    fn deviation(&self) -> Option<f64> {
        let size = Vector3::from(self.normal.map(f64::from)).norm();
        // points behind the surface have the layers of the points that they mirror
        let mut layer_of_slot = SlotField::zeros(&self.family);
        let layers: Vec<f64> = self.layer_of.iter().map(|l| *l as f64).collect();
        layer_of_slot.load(&self.family, &layers[..], Mirrored::Scalar);
        // a cell face along an axis is bare where its neighbour lies above the surface
        let flux_into = |layer: usize| {
            let steps = self.normal.iter().filter(|n| **n > layer as i32);
            steps.map(|n| f64::from(*n) / size).sum::<f64>()
        };
        let column = Column {
            known: self.point_of_layer.len(),
            spacing: self.spacing,
            distance: self.spacing / size,
        };
        column.deviation(flux_into, |row, visit| {
            let point = self.point_of_layer[row];
            self.family.for_each_bond(point, |_, bond, slot| {
                visit(layer_of_slot[slot].max(0.0) as usize, coefficient(bond));
            });
        })
    }
}

/// Layers of points below a plane surface.
pub(super) struct Column {
    /// Number of layers that deviate.
    pub known: usize,
    /// Edge of a cell, m.
    pub spacing: f64,
    /// Distance of the layers, m.
    pub distance: f64,
}

impl Column {
    /// The deviation c of the outermost layers of a half space of conductivity 1 W/(m K). `flux_into` is the area of the surface at a
    /// point of a layer over that of a cell face. `bonds` calls its argument with the layer at the other end and the coefficient (1/m²)
    /// of each bond of a point of a layer, counted from the surface.
    pub fn deviation(
        &self,
        flux_into: impl Fn(usize) -> f64,
        bonds: impl Fn(usize, &mut dyn FnMut(usize, f64)),
    ) -> Option<f64> {
        // matrix of `sum_j c_ij (T_j - T_i)` over layers, and its residual for a linear temperature
        let mut matrix = DMatrix::<f64>::zeros(self.known, self.known);
        let mut rest = DVector::<f64>::zeros(self.known);
        let linear = |layer: usize| -(layer as f64 + 0.5) * self.distance;
        for row in 0..self.known {
            bonds(row, &mut |other, c| {
                rest[row] += c * (linear(other) - linear(row));
                matrix[(row, row)] -= c;
                if other < self.known {
                    matrix[(row, other)] += c;
                }
            });
            rest[row] += flux_into(row) / self.spacing;
        }
        let deviations = matrix.lu().solve(&(-rest))?;
        let parts = deviations.iter().enumerate();
        let (sum, flux) = parts.fold((0.0, 0.0), |(sum, flux), (layer, deviation)| {
            (sum + flux_into(layer) * deviation, flux + flux_into(layer))
        });
        let c = sum / flux / self.spacing;
        c.is_finite().then_some(c)
    }
}
