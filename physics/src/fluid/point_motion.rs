//! Points of an Eulerian fluid that follow its walls (arbitrary Lagrangian-Eulerian description; Donea, Huerta, Ponthot and
//! Rodríguez-Ferran (2004), doi:10.1002/0470091355.ecm009).
//!
//! The points are displaced by `u`, the displacement of the walls where they are and harmonic between them. Sums stay those of
//! the lattice X, whose families do not change; the mapping `x = X + u` enters them by
//!
//! ```text
//! F = I + grad u,   J = det F,   C = J F^-T                       gradient, volume ratio, cofactors
//! div C^T f   for a flux f,   div (C p)   for the pressure,   div (K grad v) with K = C^T C / J   for viscosity
//! J' = div C^T w,   w = (u - u_before) / dt                       volumes of the points
//! ```
//!
//! Mass and momentum are carried by `v - w`. The cofactors are derivatives of the discrete gradient in the form of Thomas and
//! Lombard (1979), doi:10.2514/3.61273,
//!
//! ```text
//! C_aA = delta_aA (1 + sum_B G_BB) - G_Aa + sum 1/2 e_abc e_ABC D_B (u_b G_cC),   G_aA = D_A u_a
//! ```
//!
//! with the operator D of the sums, so that `D_A C_aA = 0` to rounding: a uniform pressure exerts no force, and with the volumes by
//! the same sums a uniform flow stays uniform, however the points move. For this u is known in all cells around the fluid, also those
//! that walls fill. Behind faces it is mirrored, so that points slide along them and do not leave them.
//!
//! A few sweeps of successive over-relaxation in each step let u follow the walls; they need not converge, since the equations
//! hold for any motion of the points.

use std::f64::consts::PI;

use nalgebra::{Matrix3, Vector3};
use perimelt_core::family::Mirrored;
use perimelt_core::shape::{BoxShape, Shape};
use perimelt_core::{Axis, Body, Bond, BondKernel, Face, Family, SetupError, SlotField};
use rayon::prelude::*;

use super::rates::POINTS_PER_TASK;
use crate::shape_tensor::{COMPONENTS, CompleteFamily, components, is_diagonal};

/// Pairs of sweeps, forth and back, in each step.
const SWEEPS: usize = 2;

/// Least share of a cell that makes it part of a wall.
const LEAST_SHARE: f64 = 1e-6;

/// Least volume ratio of a point, and least factor of a bond in the viscosity, of a mapping that is not folded.
pub(super) const LEAST_DISTORTION: f64 = 0.1;

/// Motion of the points of a fluid.
#[derive(Debug)]
pub(super) struct PointMotion {
    dimension: usize,
    /// All cells around the fluid, also those that walls fill.
    lattice: Body,
    family: Family,
    complete: CompleteFamily,
    /// Cell of each point of the fluid.
    cell: Vec<u32>,
    /// Cells around each one, below and above along each axis; itself behind a face.
    around: Vec<[[u32; 2]; 3]>,
    /// Cells in which u is harmonic.
    free: Vec<u32>,
    in_walls: Vec<WallCell>,
    over_relaxation: f64,
    /// u by cell, m.
    displacement: Vec<Vector3<f64>>,
    /// By slot of the lattice, m.
    slots: Vec<SlotField>,
    /// Directions of the bonds of a complete family.
    directions: Vec<Vector3<f64>>,
    points: Vec<Mapped>,
    /// By slot of the family of the fluid: the rows of C, and the tensor of the viscosity.
    pub(super) cofactors: Vec<SlotField>,
    pub(super) stretch: Vec<SlotField>,
}

/// A cell that walls fill.
#[derive(Debug)]
struct WallCell {
    cell: u32,
    /// Number of the wall, its point, and the share of that.
    shares: Vec<(u32, u32, f64)>,
}

/// The mapping at a point of the fluid.
#[derive(Clone, Debug)]
pub(super) struct Mapped {
    /// m/s.
    pub(super) velocity: Vector3<f64>,
    /// F.
    pub(super) gradient: Matrix3<f64>,
    /// C.
    pub(super) cofactors: Matrix3<f64>,
    /// J.
    volume: f64,
    /// Q with which weights `w (1 + n . Q n)` of bonds along n give the tensor K.
    pub(super) stretch: [f64; 6],
    /// Least of J and of the factors `1 + n . Q n`.
    distortion: f64,
}

/// `(1/a) sum w xi_B (f_j - f_i)` of `I` fields.
struct Gradient<const D: usize> {
    /// `1/a`, 1/m.
    inverse: f64,
}

impl<const D: usize, const I: usize, const O: usize> BondKernel<I, O> for Gradient<D> {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; I], other: [f64; I]) -> [f64; O] {
        let weight = bond.weight * self.inverse;
        std::array::from_fn(|n| weight * bond.xi[n % D] * (other[n / D] - own[n / D]))
    }
}

/// `(1/a) sum w xi_B (T_j - T_i)` with `T_aAB = sum 1/2 e_abc e_ABC u_b G_cC`, from u and G: the part of the cofactors that is of
/// second order.
struct SecondOrder {
    inverse: f64,
}

impl BondKernel<12, 9> for SecondOrder {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; 12], other: [f64; 12]) -> [f64; 9] {
        let half = 0.5 * bond.weight * self.inverse;
        let product = |b: usize, c: usize, at: usize| {
            let of = |end: &[f64; 12]| end[b] * end[3 + 3 * c + at];
            of(&other) - of(&own)
        };
        // even permutations (a, a1, a2) and (A, A1, A2)
        std::array::from_fn(|n| {
            let (a, axis) = (n / 3, n % 3);
            let (b, c) = ((a + 1) % 3, (a + 2) % 3);
            let (e, f) = ((axis + 1) % 3, (axis + 2) % 3);
            half * (bond.xi[e] * (product(b, c, f) - product(c, b, f))
                - bond.xi[f] * (product(b, c, e) - product(c, b, e)))
        })
    }
}

impl Default for Mapped {
    fn default() -> Self {
        Mapped {
            velocity: Vector3::zeros(),
            gradient: Matrix3::identity(),
            cofactors: Matrix3::identity(),
            volume: 1.0,
            stretch: [0.0; 6],
            distortion: 1.0,
        }
    }
}

impl PointMotion {
    /// Of the points of `body` with this family, between walls of which the points lie at `walls` (m).
    pub(super) fn prepare(
        body: &Body,
        family: &Family,
        walls: &[&[Vector3<f64>]],
    ) -> Result<PointMotion, SetupError> {
        let failed = |e: Box<dyn std::error::Error + Send + Sync>| SetupError::other("body", e);
        let lattice = cells_around(body, family).map_err(|e| failed(e.into()))?;
        let own = Family::build(&lattice, family.spec()).map_err(|e| failed(e.into()))?;
        let complete = CompleteFamily::of(&lattice, &own);
        let grid = lattice.lattice().expect("filled with cells");
        let cell_at = |x: &Vector3<f64>| -> [f64; 3] {
            std::array::from_fn(|a| (x[a] - grid.origin[a]) / grid.spacing - 0.5)
        };
        let number = |cell: [i64; 3]| -> Option<u32> {
            let wrapped = std::array::from_fn(|a| match lattice.periodic[a] {
                true => cell[a].rem_euclid(grid.cells[a] as i64),
                false => cell[a],
            });
            grid.point(wrapped).map(|n| n as u32)
        };
        let of_point = |x: &Vector3<f64>| number(cell_at(x).map(|c| c.round() as i64));
        let points = body.points.position.iter();
        let cell: Vec<u32> = points.map(|x| of_point(x).expect("a cell")).collect();
        let mut shares = vec![Vec::new(); lattice.points.len()];
        for (wall, position) in (0..).zip(walls) {
            for (point, x) in (0..).zip(*position) {
                let at = cell_at(x);
                for corner in 0..1_usize << body.dimension {
                    let (mut to, mut share) = ([0; 3], 1.0);
                    for a in 0..body.dimension {
                        let lower = at[a].floor();
                        to[a] = lower as i64 + (corner >> a & 1) as i64;
                        share *= 1.0 - (at[a] - to[a] as f64).abs();
                    }
                    if let Some(cell) = number(to).filter(|_| share > LEAST_SHARE) {
                        shares[cell as usize].push((wall, point, share));
                    }
                }
            }
        }
        cell.iter().for_each(|c| shares[*c as usize].clear());
        let all = || (0..).zip(&shares);
        let free = all().filter(|(_, s)| s.is_empty()).map(|(c, _)| c);
        let free = free.collect();
        let in_walls = all().filter(|(_, s)| !s.is_empty());
        let in_walls = in_walls.map(|(cell, shares)| {
            let sum: f64 = shares.iter().map(|(.., share)| share).sum();
            let shares = shares.iter().map(|(w, p, share)| (*w, *p, share / sum));
            WallCell {
                cell,
                shares: shares.collect(),
            }
        });
        let in_walls = in_walls.collect();
        let beside = |cell: &[u32; 3], axis: usize, step: i64| {
            let mut to = cell.map(i64::from);
            to[axis] += step;
            number(to).unwrap_or_else(|| number(cell.map(i64::from)).expect("itself"))
        };
        let around = grid.cell_of_point.iter();
        let around = around.map(|cell| [0, 1, 2].map(|a| [-1, 1].map(|s| beside(cell, a, s))));
        let around = around.collect();
        let mut directions = Vec::new();
        own.for_each_bond(complete.point, |_, bond, _| {
            directions.push(Vector3::from(bond.xi) * bond.inverse_length);
        });
        // of a Jacobi iteration on a box
        let wave = |a: usize| (PI / grid.cells[a] as f64).cos();
        let radius = (0..body.dimension).map(wave).sum::<f64>() / body.dimension as f64;
        let mut motion = PointMotion {
            dimension: body.dimension,
            displacement: vec![Vector3::zeros(); lattice.points.len()],
            slots: vec![SlotField::default(); body.dimension],
            over_relaxation: 2.0 / (1.0 + (1.0 - radius * radius).sqrt()),
            points: vec![Mapped::default(); cell.len()],
            cofactors: Vec::new(),
            stretch: Vec::new(),
            family: own,
            lattice,
            complete,
            cell,
            around,
            free,
            in_walls,
            directions,
        };
        motion.fill_slots(family);
        Ok(motion)
    }

    /// Lets the points follow walls that are displaced by this much (m) since the set-up, in a step of `dt` (s); `family`: that of the
    /// fluid.
    pub(super) fn follow(&mut self, family: &Family, walls: &[&[Vector3<f64>]], dt: f64) {
        for WallCell { cell, shares } in &self.in_walls {
            let parts = shares.iter();
            let parts = parts.map(|(wall, point, s)| *s * walls[*wall as usize][*point as usize]);
            self.displacement[*cell as usize] = parts.sum();
        }
        let before: Vec<_> = self.displacements().collect();
        for _ in 0..SWEEPS {
            (0..self.free.len()).for_each(|n| self.relax(n));
            (0..self.free.len()).rev().for_each(|n| self.relax(n));
        }
        self.map(family, &before, dt);
    }

    /// Places and displacements (m) of the cells in walls.
    #[cfg(test)]
    pub(super) fn cells_in_walls(&self) -> impl Iterator<Item = [Vector3<f64>; 2]> {
        let cells = self.in_walls.iter().map(|wall| wall.cell as usize);
        cells.map(|cell| [self.lattice.points.position[cell], self.displacement[cell]])
    }

    /// Displaces the points by this much at each place (m) in a step of `dt` (s).
    #[cfg(test)]
    pub(super) fn displace(
        &mut self,
        family: &Family,
        dt: f64,
        by: impl Fn(&Vector3<f64>) -> Vector3<f64>,
    ) {
        let before: Vec<_> = self.displacements().collect();
        let places = self.lattice.points.position.iter();
        self.displacement = places.map(by).collect();
        self.map(family, &before, dt);
    }

    fn map(&mut self, family: &Family, before: &[Vector3<f64>], dt: f64) {
        match self.dimension {
            2 => self.find_mapping::<2, 4>(),
            _ => self.find_mapping::<3, 9>(),
        }
        for ((mapped, before), cell) in self.points.iter_mut().zip(before).zip(&self.cell) {
            mapped.velocity = (self.displacement[*cell as usize] - before) / dt;
        }
        self.fill_slots(family);
    }

    /// One value of the relaxation.
    fn relax(&mut self, n: usize) {
        let cell = self.free[n] as usize;
        let around = &self.around[cell];
        let (mut sum, mut count) = (Vector3::zeros(), Vector3::zeros());
        for (axis, ends) in around.iter().enumerate().take(self.dimension) {
            for end in ends.map(|end| end as usize) {
                if end == cell {
                    // the image behind the face: opposite along the axis, else the same
                    count[axis] += 2.0;
                } else {
                    sum += self.displacement[end];
                    count += Vector3::repeat(1.0);
                }
            }
        }
        let here = self.displacement[cell];
        for a in 0..self.dimension {
            if count[a] > 0.0 {
                let change = sum[a] / count[a] - here[a];
                self.displacement[cell][a] += self.over_relaxation * change;
            }
        }
    }

    /// Finds the mapping from u; `P = D * D`.
    fn find_mapping<const D: usize, const P: usize>(&mut self) {
        let cells = self.displacement.len();
        for (axis, slots) in self.slots.iter_mut().enumerate() {
            let along = |cell: usize| self.displacement[cell][axis];
            slots.load(&self.family, along, Mirrored::Vector(axis));
        }
        let inverse = 1.0 / self.complete.moment;
        let inputs: [&[f64]; D] = std::array::from_fn(|a| &self.slots[a][..]);
        let mut gradient = vec![[0.0; P]; cells];
        self.family
            .sum(&Gradient::<D> { inverse }, inputs, &mut gradient);
        let mut second = Vec::new();
        if D == 3 {
            second = self.second_order(&gradient, inverse);
        }
        let complete = (self.fourth_moment(), &self.directions[..]);
        let points = self.points.par_iter_mut().zip(&self.cell);
        points
            .with_min_len(POINTS_PER_TASK)
            .for_each(|(mapped, cell)| {
                let own = &gradient[*cell as usize];
                let mut slope = Matrix3::zeros();
                (0..P).for_each(|n| slope[(n / D, n % D)] = own[n]);
                let mut cofactors = Matrix3::identity() * (1.0 + slope.trace()) - slope.transpose();
                if let Some(second) = second.get(*cell as usize) {
                    (0..9).for_each(|n| cofactors[(n / 3, n % 3)] += second[n]);
                }
                mapped.set(slope, cofactors, D, complete);
            });
    }

    /// The part of the cofactors that is of second order, by cell.
    fn second_order<const P: usize>(&self, gradient: &[[f64; P]], inverse: f64) -> Vec<[f64; 9]> {
        let mut slots: [SlotField; P] = std::array::from_fn(|_| SlotField::default());
        for (n, slots) in slots.iter_mut().enumerate() {
            let component = |cell: usize| gradient[cell][n];
            slots.load(&self.family, component, Mirrored::Tensor(n / 3, n % 3));
        }
        let inputs: [&[f64]; 12] = std::array::from_fn(|n| match n {
            0..3 => &self.slots[n][..],
            _ => &slots[n - 3],
        });
        let mut sums = vec![[0.0; 9]; self.displacement.len()];
        self.family.sum(&SecondOrder { inverse }, inputs, &mut sums);
        sums
    }

    /// `sum w xi_x^2 xi_y^2 / xi^2` of a complete family over its moment.
    fn fourth_moment(&self) -> f64 {
        let mut sum = 0.0;
        self.family.for_each_bond(self.complete.point, |_, b, _| {
            sum += b.weight * (b.xi[0] * b.xi[1] * b.inverse_length).powi(2);
        });
        sum / self.complete.moment
    }

    /// Copies cofactors and stretch to the slots of the fluid.
    fn fill_slots(&mut self, family: &Family) {
        let d = self.dimension;
        self.cofactors.resize(d * d, SlotField::default());
        self.stretch.resize(components(d), SlotField::default());
        for (n, slots) in self.cofactors.iter_mut().enumerate() {
            let (a, b) = (n / d, n % d);
            let cofactor = |point: usize| self.points[point].cofactors[(a, b)];
            slots.load(family, cofactor, Mirrored::Tensor(a, b));
        }
        for (n, (slots, &(a, b))) in self.stretch.iter_mut().zip(&COMPONENTS).enumerate() {
            let stretch = |point: usize| self.points[point].stretch[n];
            slots.load(family, stretch, Mirrored::Tensor(a, b));
        }
    }

    /// The mapping at each point.
    pub(super) fn points(&self) -> &[Mapped] {
        &self.points
    }

    /// Displacement of each point of the fluid, m.
    pub(super) fn displacements(&self) -> impl Iterator<Item = Vector3<f64>> + '_ {
        self.cell.iter().map(|c| self.displacement[*c as usize])
    }

    /// Displacement of the lattice at a place of the reference configuration, m.
    pub(super) fn displacement_at(&self, x: &Vector3<f64>) -> Vector3<f64> {
        let grid = self.lattice.lattice().expect("filled with cells");
        let (mut sum, mut shares) = (Vector3::zeros(), 0.0);
        for corner in 0..1_usize << self.dimension {
            let (mut cell, mut share) = ([0; 3], 1.0);
            for a in 0..self.dimension {
                let at = (x[a] - grid.origin[a]) / grid.spacing - 0.5;
                let lower = at.floor() as i64 + (corner >> a & 1) as i64;
                share *= 1.0 - (at - lower as f64).abs();
                let size = grid.cells[a] as i64;
                cell[a] = match self.lattice.periodic[a] {
                    true => lower.rem_euclid(size),
                    false => lower.clamp(0, size - 1),
                };
            }
            if let Some(cell) = grid.point(cell) {
                sum += share * self.displacement[cell];
                shares += share;
            }
        }
        sum / shares
    }

    /// Displacement of all cells, m: what a resumed run must know.
    pub(super) fn state(&self) -> &Vec<Vector3<f64>> {
        &self.displacement
    }

    /// Restores what [`PointMotion::state`] gave.
    pub(super) fn set_state(&mut self, displacement: Vec<Vector3<f64>>) {
        self.displacement = displacement;
    }

    /// Least of the volume ratios and of the factors of bonds in the viscosity, and the point that has it.
    pub(super) fn distortion(&self) -> (f64, usize) {
        let points = self.points.iter().zip(0..);
        points.fold((f64::INFINITY, 0), |least, (mapped, point)| {
            match mapped.distortion < least.0 {
                true => (mapped.distortion, point),
                false => least,
            }
        })
    }

    /// Largest `|F^-1|^2`, by which distances shrink at most.
    pub(super) fn largest_compression(&self) -> f64 {
        let of_point = |m: &Mapped| {
            let metric = m.cofactors.transpose() * m.cofactors / (m.volume * m.volume);
            1.0 + (metric - Matrix3::identity()).norm()
        };
        self.points.iter().map(of_point).fold(1.0, f64::max)
    }
}

impl Mapped {
    /// From `grad u` and C; `complete`: the moment of [`PointMotion::fourth_moment`] and the directions of a complete family.
    fn set(
        &mut self,
        slope: Matrix3<f64>,
        cofactors: Matrix3<f64>,
        dimension: usize,
        (fourth, directions): (f64, &[Vector3<f64>]),
    ) {
        self.gradient = Matrix3::identity() + slope;
        self.cofactors = cofactors;
        self.volume = self.gradient.determinant();
        let tensor = cofactors.transpose() * cofactors / self.volume;
        let trace: f64 = (0..dimension).map(|a| tensor[(a, a)] - 1.0).sum();
        // sum w xi_a xi_b n.Qn over a complete family, for Q
        let along = 1.0 - (dimension as f64 - 1.0) * fourth;
        let mut matrix = Matrix3::zeros();
        for (n, &(a, b)) in COMPONENTS[..components(dimension)].iter().enumerate() {
            self.stretch[n] = match is_diagonal(n) {
                true => (tensor[(a, a)] - 1.0 - fourth * trace) / (along - fourth),
                false => tensor[(a, b)] / (2.0 * fourth),
            };
            (matrix[(a, b)], matrix[(b, a)]) = (self.stretch[n], self.stretch[n]);
        }
        let factor = |n: &Vector3<f64>| 1.0 + n.dot(&(matrix * n));
        let factors = directions.iter().map(factor);
        self.distortion = factors.fold(self.volume, f64::min);
    }
}

/// The cells around a body of which the faces that its family does not mirror lie within it.
fn cells_around(body: &Body, family: &Family) -> Result<Body, perimelt_core::body::BodyError> {
    let (mut min, mut max) = body.bounds();
    let spacing = body.finest_spacing();
    let spec = family.spec();
    // derivatives of derivatives
    let margin = 2.0 * (spec.horizon.of(spacing) / spacing).ceil() * spacing;
    for face in Face::ALL {
        let axis = face.axis();
        let ends = spec.layers.contains(&face) || body.periodic[axis];
        if axis < body.dimension && !ends {
            match face.is_upper() {
                true => max[axis] += margin,
                false => min[axis] -= margin,
            }
        }
    }
    let shape = Shape::Box(BoxShape {
        min: min.into(),
        max: max.into(),
    });
    let mut cells = Body::fill(&body.name, &shape, body.dimension, spacing, body.thickness)?;
    let periodic = Axis::ALL.into_iter();
    let periodic: Vec<Axis> = periodic.filter(|a| body.periodic[a.index()]).collect();
    cells.repeat(&periodic)?;
    Ok(cells)
}
