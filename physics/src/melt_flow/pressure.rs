//! Pressure of the melt, for which no cell gains or loses volume.
//!
//! ```text
//! U_ij = b xi.(v~_i + v~_j) + ds c_ij [ G_ij - (p_j - p_i) ],   c_ij = 2 b beta_ij,   G_ij = xi.(F_i + F_j)/2
//! sum_j U_ij = 0  determines p
//! v_i = v~_i + ds/2 sum_j xi c_ij [ G_ij - (p_j - p_i) ]
//! beta_ij = 2/(rho (2 + ds (D_i + D_j)))                             with the drag D of the mushy zone, 1/s
//! ```
//!
//! over open bonds. Flux and velocity take the same bracket, so that a force that pressure can balance moves nothing. Fluxes of
//! the two ends of a bond are opposite to the last bit: nothing that they carry is lost.

use perimelt_core::solver::{Hints, Krylov, KrylovMethod, KrylovOptions, Reducer, SolverError};

use super::momentum::{Momentum, Vector, dot};
use super::pool::{Pool, set_cells, set_rows};

/// Pressures of the cells and fluxes of volume.
#[derive(Debug)]
pub(super) struct Pressure {
    /// Pa.
    pub(super) values: Vec<f64>,
    /// `c_ij` of each bond, m/kg; 0 at walls.
    coefficient: Vec<f64>,
    diagonal: Vec<f64>,
    rhs: Vec<f64>,
    /// Flux of volume of each bond over the volume of the cell, 1/s; 0 at walls.
    pub(super) flux: Vec<f64>,
    krylov: Krylov,
}

impl Default for Pressure {
    fn default() -> Self {
        let options = KrylovOptions {
            relative_tolerance: 0.0,
            ..KrylovOptions::default()
        };
        Pressure {
            values: Vec::new(),
            coefficient: Vec::new(),
            diagonal: Vec::new(),
            rhs: Vec::new(),
            flux: Vec::new(),
            krylov: Krylov::new(KrylovMethod::ConjugateGradient, options),
        }
    }
}

impl Pressure {
    pub(super) fn resize(&mut self, pool: &Pool) {
        let cells = pool.len();
        self.values.resize(cells, 0.0);
        self.diagonal.resize(cells, 0.0);
        self.rhs.resize(cells, 0.0);
        let bonds = cells * pool.stencil.bonds.len();
        self.coefficient.resize(bonds, 0.0);
        self.flux.resize(bonds, 0.0);
    }

    /// Finds the coefficients of the bonds for the drag in a sub-step `ds` (s) of a melt of this density, kg/m³.
    pub(super) fn find_coefficients(
        &mut self,
        pool: &Pool,
        momentum: &Momentum,
        density: f64,
        ds: f64,
    ) {
        let bonds = &pool.stencil.bonds;
        for (i, coefficients) in self.coefficient.chunks_mut(bonds.len()).enumerate() {
            let own = momentum.drag(i);
            let mut total = 0.0;
            for ((c, n), bond) in coefficients.iter_mut().zip(pool.neighbours(i)).zip(bonds) {
                let drag = own + momentum.drag(n.cell as usize);
                let open = 4.0 * bond.weight / (density * (2.0 + ds * drag));
                *c = if n.is_open { open } else { 0.0 };
                if n.cell as usize != i {
                    total += *c;
                }
            }
            // a cell without liquid neighbours keeps its pressure
            self.diagonal[i] = if total > 0.0 { total } else { 1.0 };
        }
    }

    /// Bracket of force and pressure along a bond, Pa.
    #[inline(always)]
    fn bracket(&self, pool: &Pool, force: &[Vector], (i, bond): (usize, usize)) -> f64 {
        let n = pool.neighbours(i)[bond];
        let cell = n.cell as usize;
        let rise = self.values[cell] - self.values[i];
        if force.is_empty() {
            return -rise;
        }
        half_force(pool.stencil.bonds[bond].xi, force[i], n.mirror(force[cell])) - rise
    }

    /// Acceleration of a cell by force and pressure, m/s².
    #[inline(always)]
    pub(super) fn acceleration(&self, pool: &Pool, momentum: &Momentum, i: usize) -> Vector {
        let bonds = &pool.stencil.bonds;
        let coefficients = &self.coefficient[i * bonds.len()..(i + 1) * bonds.len()];
        let mut sum = [0.0; 3];
        for (k, (bond, c)) in bonds.iter().zip(coefficients).enumerate() {
            let push = 0.5 * c * self.bracket(pool, &momentum.force, (i, k));
            for (sum, xi) in sum.iter_mut().zip(bond.xi) {
                *sum += push * xi;
            }
        }
        sum
    }

    /// Finds the pressure of a sub-step `ds` (s), for which the root mean square of the change of volume is below `tolerance`
    /// (1/s); returns the number of iterations.
    pub(super) fn solve(
        &mut self,
        pool: &Pool,
        momentum: &Momentum,
        ds: f64,
        tolerance: f64,
    ) -> Result<usize, SolverError> {
        let bonds = &pool.stencil.bonds;
        let coefficient = &self.coefficient;
        let (velocity, force) = (&momentum.provisional, &momentum.force);
        set_cells(&mut self.rhs, |i| {
            let own = velocity[i];
            let coefficients = &coefficient[i * bonds.len()..(i + 1) * bonds.len()];
            let ends = pool.neighbours(i).iter().zip(bonds).zip(coefficients);
            let mut sum = 0.0;
            for ((n, bond), c) in ends {
                if n.is_open {
                    let cell = n.cell as usize;
                    sum -= divergence(bond.xi, own, n.mirror(velocity[cell])) * bond.weight / ds;
                    if !force.is_empty() {
                        sum -= c * half_force(bond.xi, force[i], n.mirror(force[cell]));
                    }
                }
            }
            sum
        });
        let apply = |p: &[f64], out: &mut [f64]| {
            set_cells(out, |i| {
                let own = p[i];
                let coefficients = &coefficient[i * bonds.len()..(i + 1) * bonds.len()];
                let ends = pool.neighbours(i).iter().zip(coefficients);
                let mut sum = 0.0;
                for (n, c) in ends {
                    sum += c * (own - p[n.cell as usize]);
                }
                sum
            });
            Ok(())
        };
        let cells = pool.len() as f64;
        self.krylov.options.absolute_tolerance = tolerance / ds * cells.sqrt();
        let hints = Hints {
            diagonal: Some(&self.diagonal),
            ..Hints::default()
        };
        let alone = Reducer::alone(pool.len());
        let report = self
            .krylov
            .solve(apply, &self.rhs, &mut self.values, &alone, hints)?;
        Ok(report.iterations)
    }

    /// Finds the fluxes of volume and the velocities at the end of a sub-step `ds` (s).
    pub(super) fn apply(&mut self, pool: &Pool, momentum: &mut Momentum, ds: f64) {
        let mut velocity = std::mem::take(&mut momentum.velocity);
        let provisional = &momentum.provisional;
        set_cells(&mut velocity, |i| {
            let push = self.acceleration(pool, momentum, i);
            let v = provisional[i];
            [0, 1, 2].map(|a| v[a] + ds * push[a])
        });
        momentum.velocity = velocity;
        let bonds = &pool.stencil.bonds;
        let mut flux = std::mem::take(&mut self.flux);
        set_rows(&mut flux, bonds.len(), |i, flux| {
            let own = momentum.provisional[i];
            for (k, (flux, n)) in flux.iter_mut().zip(pool.neighbours(i)).enumerate() {
                let other = n.mirror(momentum.provisional[n.cell as usize]);
                let moved = divergence(bonds[k].xi, own, other) * bonds[k].weight;
                let pushed = ds * self.coefficient[i * bonds.len() + k];
                let pushed = pushed * self.bracket(pool, &momentum.force, (i, k));
                *flux = if n.is_open { moved + pushed } else { 0.0 };
            }
        });
        self.flux = flux;
    }
}

/// `xi.(v_i + v_j)`.
#[inline(always)]
fn divergence(xi: Vector, own: Vector, other: Vector) -> f64 {
    dot(
        xi,
        [own[0] + other[0], own[1] + other[1], own[2] + other[2]],
    )
}

/// `xi.(F_i + F_j)/2`.
#[inline(always)]
fn half_force(xi: Vector, own: Vector, other: Vector) -> f64 {
    0.5 * divergence(xi, own, other)
}
