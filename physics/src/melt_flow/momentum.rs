//! Momentum of the melt: convection, viscosity and surface stress in a sub-step, before the pressure acts.
//!
//! ```text
//! v_m = (v + ds/2 A(v) + ds/4 sum_j xi c_ij [G_ij - (p_j - p_i)]) / (1 + ds/2 D)     in the middle, with the pressure before
//! v~  = (v + ds A(v_m)) / (1 + ds D)
//! A(v) = sum_j b [ 2 nu_ij (v_j - v_i) - xi.(v_i + v_j) (v_j - v_i)/2 ] + f
//! ```
//!
//! Convection and viscosity in the middle of the step are of second order in the step, and need nothing from the step before. At a
//! wall `v_j = -v_i` in the viscous part, and the convective one vanishes.

use super::heat::Heat;
use super::melt::Melt;
use super::pool::{Pool, set_cells};
use super::pressure::Pressure;
use super::surface::Surface;
use crate::advection::Convection;

pub(super) type Vector = [f64; 3];

#[inline(always)]
pub(super) fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn add(sum: &mut Vector, factor: f64, v: Vector) {
    sum[0] += factor * v[0];
    sum[1] += factor * v[1];
    sum[2] += factor * v[2];
}

#[inline(always)]
fn difference(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
fn sum(a: Vector, b: Vector) -> Vector {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// The middle of a sub-step.
#[derive(Clone, Copy, Debug, Default)]
struct Middle {
    velocity: Vector,
    /// Diffusivity that short waves lack times the difference of the velocity from the mean of its neighbours, m³/s².
    short_waves: Vector,
}

/// Velocities of the cells and what changes them.
#[derive(Debug, Default)]
pub(super) struct Momentum {
    /// m/s.
    pub(super) velocity: Vec<Vector>,
    /// Velocity before the pressure acts, m/s.
    pub(super) provisional: Vec<Vector>,
    middle: Vec<Middle>,
    /// Force per volume, N/m³, which pressure may balance; empty where there is none.
    pub(super) force: Vec<Vector>,
    /// The part of it that couplers give; empty where none does.
    pub(super) given: Vec<Vector>,
    /// Acceleration by surface stress, m/s²; empty where there is none.
    stress: Vec<Vector>,
    /// Kinematic viscosity, m²/s.
    viscosity: Vec<f64>,
    /// Rate at which the mushy zone brings the melt to rest, 1/s; empty without drag.
    drag: Vec<f64>,
}

impl Momentum {
    pub(super) fn resize(&mut self, cells: usize, melt: &Melt, has_force: bool) {
        self.velocity.resize(cells, [0.0; 3]);
        self.provisional.resize(cells, [0.0; 3]);
        self.middle.resize(cells, Middle::default());
        self.viscosity.resize(cells, 0.0);
        self.force
            .resize(if has_force { cells } else { 0 }, [0.0; 3]);
        self.stress
            .resize(if melt.has_tension() { cells } else { 0 }, [0.0; 3]);
        self.drag
            .resize(if melt.drag.is_some() { cells } else { 0 }, 0.0);
    }

    /// Evaluates properties and forces at the temperatures and enthalpies of the cells.
    pub(super) fn follow(&mut self, melt: &Melt, pool: &Pool, surface: &Surface, heat: &Heat) {
        let (temperature, enthalpy) = (&heat.temperature, &heat.enthalpy);
        set_cells(&mut self.viscosity, |i| melt.viscosity(temperature[i]));
        let given = &self.given;
        set_cells(&mut self.force, |i| {
            let lift = melt.lift(temperature[i]).unwrap_or_default();
            given.get(i).map_or(lift, |given| sum(*given, lift))
        });
        set_cells(&mut self.drag, |i| melt.drag_rate(enthalpy[i]));
        if !self.stress.is_empty() {
            self.stress.fill([0.0; 3]);
            surface.add_stress(melt, pool, temperature, &mut self.stress);
        }
    }

    /// Rate at which the mushy zone brings a cell to rest, 1/s.
    #[inline(always)]
    pub(super) fn drag(&self, cell: usize) -> f64 {
        self.drag.get(cell).copied().unwrap_or(0.0)
    }

    pub(super) fn largest_speed(&self) -> f64 {
        let squares = self.velocity.iter().map(|v| dot(*v, *v));
        squares.fold(0.0, f64::max).sqrt()
    }

    /// Largest acceleration by force and surface stress, m/s², in a melt of this density, kg/m³.
    pub(super) fn largest_acceleration(&self, density: f64) -> f64 {
        let largest = |of: &[Vector]| {
            let squares = of.iter().map(|v| dot(*v, *v));
            squares.fold(0.0, f64::max).sqrt()
        };
        largest(&self.force) / density + largest(&self.stress)
    }

    /// m²/s.
    pub(super) fn largest_viscosity(&self) -> f64 {
        self.viscosity.iter().copied().fold(0.0, f64::max)
    }

    /// Finds the velocity before the pressure acts, from a sub-step `ds` (s).
    pub(super) fn advance(
        &mut self,
        pool: &Pool,
        pressure: &Pressure,
        convection: Convection,
        ds: f64,
    ) {
        let mut middle = std::mem::take(&mut self.middle);
        set_cells(&mut middle, |i| {
            self.middle(pool, pressure, convection, (i, ds))
        });
        let mut provisional = std::mem::take(&mut self.provisional);
        set_cells(&mut provisional, |i| {
            let mut v = self.velocity[i];
            add(&mut v, ds, self.acceleration(pool, &middle, i));
            v.map(|v| v / (1.0 + ds * self.drag(i)))
        });
        (self.middle, self.provisional) = (middle, provisional);
    }

    fn stress(&self, cell: usize) -> Vector {
        self.stress.get(cell).copied().unwrap_or_default()
    }

    /// The middle of a sub-step `ds` (s) in a cell.
    fn middle(
        &self,
        pool: &Pool,
        pressure: &Pressure,
        convection: Convection,
        (i, ds): (usize, f64),
    ) -> Middle {
        let stencil = &pool.stencil;
        let (own, nu) = (self.velocity[i], self.viscosity[i]);
        let mut rate = self.stress(i);
        let mut bend = [0.0; 3];
        for (n, bond) in pool.neighbours(i).iter().zip(&stencil.bonds) {
            let b = bond.weight;
            if !n.is_open {
                add(&mut rate, -4.0 * b * nu, own);
                add(&mut bend, -4.0 * b, own);
                continue;
            }
            let cell = n.cell as usize;
            let v = self.velocity[cell];
            let mirrored = n.mirror(v);
            let flux = b * dot(bond.xi, sum(own, mirrored));
            add(&mut rate, -0.5 * flux, difference(mirrored, own));
            let sheared = difference(n.shear(v), own);
            add(&mut rate, b * (nu + self.viscosity[cell]), sheared);
            add(&mut bend, 2.0 * b, sheared);
        }
        add(&mut rate, 1.0, pressure.acceleration(pool, self, i));
        let mut velocity = own;
        add(&mut velocity, 0.5 * ds, rate);
        let drag = 1.0 + 0.5 * ds * self.drag(i);
        let (speed, laplacian) = (dot(own, own).sqrt(), stencil.laplacian);
        let lacking = convection.missing_diffusivity(speed, stencil.spacing, laplacian, nu);
        Middle {
            velocity: velocity.map(|v| v / drag),
            short_waves: bend.map(|bend| -lacking * bend / laplacian),
        }
    }

    /// Acceleration of a cell by convection, viscosity, the diffusion of short waves, and surface stress.
    fn acceleration(&self, pool: &Pool, middle: &[Middle], i: usize) -> Vector {
        let (own, nu) = (middle[i], self.viscosity[i]);
        let mut rate = self.stress(i);
        for (n, bond) in pool.neighbours(i).iter().zip(&pool.stencil.bonds) {
            let b = bond.weight;
            if !n.is_open {
                add(&mut rate, -4.0 * b * nu, own.velocity);
                add(&mut rate, -4.0 * b, own.short_waves);
                continue;
            }
            let cell = n.cell as usize;
            let other = middle[cell];
            let mirrored = n.mirror(other.velocity);
            let flux = b * dot(bond.xi, sum(own.velocity, mirrored));
            add(&mut rate, -0.5 * flux, difference(mirrored, own.velocity));
            let sheared = difference(n.shear(other.velocity), own.velocity);
            add(&mut rate, b * (nu + self.viscosity[cell]), sheared);
            let waves = difference(n.shear(other.short_waves), own.short_waves);
            add(&mut rate, 2.0 * b, waves);
        }
        rate
    }
}
