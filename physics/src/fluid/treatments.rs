//! Published treatments that keep a flow smooth and its points apart, each with an error of its own.
//!
//! Their sums are not corrected where families are incomplete, so that each pair of points exchanges equal and
//! opposite amounts.

use nalgebra::{Matrix4, Vector3, Vector4};
use perimelt_core::family::{ByRules, LayerRule, Mirrored};
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::{Bond, BondKernel, Family, SlotField};
use rayon::prelude::*;

use crate::shape_tensor::CompleteFamily;

use super::medium::Medium;
use super::rates::POINTS_PER_TASK;
use super::walls::Walls;

/// Fraction of a complete family below which a point counts as a surface point: the first row below a flat surface
/// has 0.69, the second row 0.93.
pub(super) const AT_SURFACE: f64 = 0.8;

/// Fraction below which a point is not smoothed: too few neighbours determine a linear field, as in a thread or a
/// splash.
const TOO_FEW: f64 = 0.55;

/// Fraction below which a point is not shifted: no shifting near free surfaces.
const NEAR_SURFACE: f64 = 0.97;

/// A family and the fluid in it.
#[derive(Clone, Copy)]
pub(super) struct Around<'a> {
    pub(super) family: &'a Family,
    pub(super) medium: &'a Medium,
}

/// Neighbours among which fields are smoothed.
#[derive(Clone, Copy)]
pub(super) struct Neighbours<'a> {
    pub(super) family: &'a Family,
    /// m³.
    pub(super) volume: &'a [f64],
    /// Of each point: nothing is smoothed from one material to another.
    pub(super) material: &'a [u16],
    /// Of the velocity behind faces: symmetric images are neighbours, others are not.
    pub(super) rules: &'a [LayerRule],
}

/// Whether a layer is the mirror image of the flow.
fn is_symmetric(rule: &LayerRule) -> bool {
    let mirrored = |axis: usize| if axis == rule.face.axis() { -1.0 } else { 1.0 };
    let bare = rule.offset == [0.0; 3] && rule.values.is_none() && rule.traction.is_none();
    bare && (0..3).all(|axis| rule.scale[axis] == mirrored(axis))
}

/// The treatments with their work arrays.
#[derive(Debug)]
pub(super) struct Treatments {
    dimension: usize,
    pub complete: CompleteFamily,
    sums: Vec<f64>,
    crowding: Vec<[f64; 6]>,
    smooth: Vec<Vector4<f64>>,
    /// By slot: velocity (m/s), density (kg/m³), and the number of the material from one; zero where there is no neighbour.
    fields: [SlotField; 5],
    /// One for layers of neighbours, zero for others.
    counted: Vec<LayerRule>,
}

/// Sum of the distances of the neighbours (m), their number, `sum_j xi / |xi|^3` (1/m²), `sum w` (1/m).
pub(super) struct Crowding;

impl BondKernel<0, 6> for Crowding {
    #[inline(always)]
    fn bond(&self, bond: &Bond, _: [f64; 0], _: [f64; 0]) -> [f64; 6] {
        // members in the skin have weight zero
        let counts = if bond.weight > 0.0 { 1.0 } else { 0.0 };
        let cube = counts / (bond.length * bond.length * bond.length);
        let [x, y, z] = bond.xi;
        let length = counts * bond.length;
        [length, counts, cube * x, cube * y, cube * z, bond.weight]
    }
}

/// `sum w (v_j - v_i)`.
struct Difference;

impl<const D: usize> BondKernel<D, D> for Difference {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; D], other: [f64; D]) -> [f64; D] {
        std::array::from_fn(|a| bond.weight * (other[a] - own[a]))
    }
}

/// `sum w min((v_j - v_i) . xi, 0) / (|xi|^2 + e) xi`.
struct Approach {
    /// `(0.1 h)^2`, m².
    softening: f64,
}

impl<const D: usize> BondKernel<D, D> for Approach {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; D], other: [f64; D]) -> [f64; D] {
        let approach: f64 = (0..D).map(|a| (other[a] - own[a]) * bond.xi[a]).sum();
        let square = bond.length * bond.length + self.softening;
        let part = bond.weight * approach.min(0.0) / square;
        std::array::from_fn(|a| part * bond.xi[a])
    }
}

impl Treatments {
    pub(super) fn new(complete: CompleteFamily, dimension: usize) -> Self {
        Treatments {
            dimension,
            complete,
            sums: Vec::new(),
            crowding: Vec::new(),
            smooth: Vec::new(),
            fields: Default::default(),
            counted: Vec::new(),
        }
    }

    /// Sums of a kernel over velocities by slot; `D` of them for each point.
    fn sum<K>(&mut self, family: &Family, kernel: &K, velocity: &[SlotField], points: usize)
    where
        K: BondKernel<2, 2> + BondKernel<3, 3>,
    {
        self.sums.resize(points * self.dimension, 0.0);
        match velocity {
            [x, y] => family.sum(kernel, [x, y], self.sums.as_chunks_mut::<2>().0),
            [x, y, z] => family.sum(kernel, [x, y, z], self.sums.as_chunks_mut::<3>().0),
            _ => unreachable!("a fluid has two or three dimensions"),
        }
    }

    /// Viscosity `alpha h c` between points that approach each other; `strength` is `alpha dt`, s (Gao (2020),
    /// eq. 6.56, which is an acceleration and printed as a force).
    pub(super) fn artificial_viscosity(
        &mut self,
        around: Around<'_>,
        strength: f64,
        slots: &[SlotField],
        velocity: &mut [Vector3<f64>],
        density: &[f64],
    ) {
        let Around { family, medium } = around;
        let size = medium.smoothing_length(0);
        let kernel = Approach {
            softening: (0.1 * size).powi(2),
        };
        self.sum(family, &kernel, slots, density.len());
        for (i, (v, sum)) in velocity
            .iter_mut()
            .zip(self.sums.chunks_exact(self.dimension))
            .enumerate()
        {
            let factor = strength * size * medium.sound_speed(i) / self.complete.moment
                * medium.reference_density[i]
                / density[i];
            (0..self.dimension).for_each(|a| v[a] += factor * sum[a]);
        }
    }

    /// XSPH: displaces points with the mean velocity of their neighbours; `fraction` is `chi dt` (s) (Gao (2020),
    /// eq. 6.53, with the mass of the neighbour, where that of the point is printed).
    pub(super) fn xsph(
        &mut self,
        family: &Family,
        fraction: f64,
        slots: &[SlotField],
        displacement: &mut [Vector3<f64>],
    ) {
        self.sum(family, &Difference, slots, displacement.len());
        let factor = fraction / (self.complete.content + self.complete.own_content);
        let points = displacement
            .iter_mut()
            .zip(self.sums.chunks_exact(self.dimension));
        for (u, sum) in points {
            (0..self.dimension).for_each(|a| u[a] += factor * sum[a]);
        }
    }

    /// Walls that are bodies count as neighbours.
    fn sum_crowding(&mut self, family: &Family, walls: Option<&Walls>, points: usize) {
        self.crowding.resize(points, [0.0; 6]);
        family.sum(&Crowding, [], &mut self.crowding);
        if let Some(walls) = walls {
            walls.add_crowding(&Crowding, &mut self.crowding);
        }
    }

    /// Shifting: moves points away from crowded places by `-C |v|max dt U` with `U = sum_j (r / |xi|)^2 n` and the
    /// mean distance r of the neighbours, at most a fifth of a spacing, except near free surfaces; `fraction` is
    /// `C dt` (s) (Gao (2020), eqs. 6.46 to 6.50, printed with the sign that moves points together).
    pub(super) fn shift(
        &mut self,
        around: Around<'_>,
        walls: Option<&Walls>,
        fraction: f64,
        velocity: &[Vector3<f64>],
        displacement: &mut [Vector3<f64>],
    ) {
        let Around { family, medium } = around;
        let square = velocity.iter().map(Vector3::norm_squared);
        let fastest = square.fold(0.0, f64::max).sqrt();
        self.sum_crowding(family, walls, velocity.len());
        let least = NEAR_SURFACE * self.complete.content;
        let points = displacement
            .par_iter_mut()
            .zip(&self.crowding)
            .zip(&medium.spacing);
        let points = points.with_min_len(POINTS_PER_TASK);
        points.for_all(|((u, &[sum, number, x, y, z, content]), spacing)| {
            if content < least {
                return;
            }
            let mean = sum / number;
            let shift = Vector3::new(x, y, z) * (-fraction * fastest * mean * mean);
            let most = 0.2 * spacing;
            *u += shift * (most / shift.norm().max(most));
        });
    }

    /// Sets the pressure of points at free surfaces to zero (Gao (2020), eq. 6.59), and their density to the reference
    /// density, which would drift without a pressure that restores it.
    pub(super) fn zero_surface_pressure(
        &mut self,
        around: Around<'_>,
        density: &mut [f64],
        pressure: &mut [f64],
    ) {
        let Around { family, medium } = around;
        self.sum_crowding(family, None, pressure.len());
        let least = AT_SURFACE * self.complete.content;
        for (i, [.., content]) in self.crowding.iter().enumerate() {
            if *content < least {
                (density[i], pressure[i]) = (medium.reference_density[i], 0.0);
            }
        }
    }

    /// Brings what moving least squares take of points and symmetric images to their slots.
    fn load_neighbours(
        &mut self,
        neighbours: Neighbours<'_>,
        velocity: &[Vector3<f64>],
        density: &[f64],
    ) {
        let Neighbours {
            family,
            material,
            rules,
            ..
        } = neighbours;
        self.counted.clear();
        self.counted.extend(rules.iter().map(|rule| LayerRule {
            scale: [f64::from(u8::from(is_symmetric(rule))); 3],
            ..LayerRule::even(rule.face)
        }));
        let [along @ .., rho, kind] = &mut self.fields;
        for (axis, slots) in along.iter_mut().enumerate() {
            slots.load(family, |i: usize| velocity[i][axis], ByRules(rules, axis));
        }
        rho.load(family, density, Mirrored::Scalar);
        let number = |i: usize| f64::from(material[i]) + 1.0;
        kind.load(family, number, ByRules(&self.counted, 0));
    }

    /// Velocity (m/s) and density (kg/m³) by moving least squares over points and their neighbours (Gao
    /// (2020), eqs. 5.111 to 5.114; eq. 5.114c lacks the volumes) of one material, with symmetric images. Points with too few neighbours keep their values.
    pub(super) fn smooth(
        &mut self,
        neighbours: Neighbours<'_>,
        velocity: &[Vector3<f64>],
        density: &[f64],
    ) -> &[Vector4<f64>] {
        let Neighbours {
            family,
            volume,
            material,
            ..
        } = neighbours;
        let dimension = self.dimension;
        self.load_neighbours(neighbours, velocity, density);
        let [x, y, z, rho, kind] = &self.fields;
        let in_slot = |slot: usize| Vector4::new(x[slot], y[slot], z[slot], rho[slot]);
        let is_same = |slot: usize, point: usize| kind[slot] == f64::from(material[point]) + 1.0;
        let at = |point: usize| {
            let own = self.complete.own_weight * volume[point];
            let mut moments = Matrix4::zeros();
            moments[(0, 0)] = own;
            // axes that a plane body does not have
            (dimension..3).for_each(|a| moments[(a + 1, a + 1)] = 1.0);
            family.for_each_bond(point, |_, bond, slot| {
                if is_same(slot, point) {
                    let p = Vector4::new(1.0, bond.xi[0], bond.xi[1], bond.xi[2]);
                    moments += bond.weight * p * p.transpose();
                }
            });
            let value = |p: usize| velocity[p].push(density[p]);
            let has_too_few = moments[(0, 0)] - own < TOO_FEW * self.complete.content;
            let weights = moments.cholesky().filter(|_| !has_too_few);
            let Some(weights) = weights.map(|c| c.solve(&Vector4::x())) else {
                return value(point);
            };
            let mut sum = own * weights[0] * value(point);
            family.for_each_bond(point, |_, bond, slot| {
                if is_same(slot, point) {
                    let p = Vector4::new(1.0, bond.xi[0], bond.xi[1], bond.xi[2]);
                    sum += bond.weight * p.dot(&weights) * in_slot(slot);
                }
            });
            sum
        };
        let smooth = (0..density.len()).into_par_iter().with_min_len(64).map(at);
        smooth.fill(&mut self.smooth);
        &self.smooth
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use perimelt_core::FamilySpec;
    use perimelt_core::body::Store;
    use perimelt_core::{Horizon, Influence, PartialVolume, Pddo};

    use crate::testing::block;

    /// With an influence that is constant, the point and its neighbours count alike.
    #[test]
    fn a_point_counts_in_its_own_family_as_each_of_its_neighbours() {
        for (cells, dimension, neighbours) in [([9, 9, 1], 2, 20.0), ([9, 9, 9], 3, 80.0)] {
            let body = block(cells, dimension, 0.1, Store::Lattice, "density = 2");
            let spec = FamilySpec {
                influence: Influence::Constant,
                partial_volume: PartialVolume::None,
                ..Pddo::spec(Horizon::Spacings(2.5))
            };
            let family = Family::moving(&body, &spec).expect("valid");
            let complete = CompleteFamily::of(&body, &family);
            let mut treatments = Treatments::new(complete, dimension);
            let points = body.points.len();
            let centre = points / 2;
            let (mut velocity, mut density) = (vec![Vector3::zeros(); points], vec![2.0; points]);
            (velocity[centre], density[centre]) = (Vector3::x(), 3.0);

            let slots: Vec<SlotField> = (0..dimension)
                .map(|axis| {
                    let mut slots = SlotField::default();
                    slots.load(&family, |p: usize| velocity[p][axis], Mirrored::Scalar);
                    slots
                })
                .collect();
            let mut displacement = vec![Vector3::zeros(); points];
            treatments.xsph(&family, 0.5, &slots, &mut displacement);
            // half way from its own velocity to the mean of the family
            let mean = 1.0 / (neighbours + 1.0);
            assert!((displacement[centre].x - 0.5 * (mean - 1.0)).abs() < 1e-12);
            assert!((displacement[centre + 1].x - 0.5 * mean).abs() < 1e-12);

            let volume = &body.points.volume;
            let neighbours = Neighbours {
                family: &family,
                volume,
                material: &body.material_of_point,
                rules: &[],
            };
            let smooth = treatments.smooth(neighbours, &velocity, &density);
            for point in [centre, centre + 1] {
                assert!((smooth[point].x - mean).abs() < 1e-12, "{dimension}D");
                assert!((smooth[point].w - 2.0 - mean).abs() < 1e-12, "{dimension}D");
            }
        }
    }
}
