//! The list of liquid cells and their neighbours.
//!
//! Cells are in the order of their points. Behind a face of the body stands the mirror image of the cells before it: a free
//! surface or a plane of symmetry mirrors the velocity, a wall also turns it round, so that it vanishes there. All other cells
//! that are not in the list are walls: solid, without material, or beside the body, and so are cracks.

use std::mem;

use nalgebra::Vector3;
use perimelt_core::body::{Lattice, severed};
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::{Body, Face};
use rayon::prelude::*;

use super::stencil::Stencil;

/// Marks a point that is not in the list.
const SOLID: u32 = u32::MAX;

/// Below this number of cells, handing work to another thread costs more than it saves.
const PARALLEL: usize = 3000;

/// Signs of the components of a mirrored vector, by a set of axes.
const SIGNS: [[f64; 3]; 8] = [
    [1.0, 1.0, 1.0],
    [-1.0, 1.0, 1.0],
    [1.0, -1.0, 1.0],
    [-1.0, -1.0, 1.0],
    [1.0, 1.0, -1.0],
    [-1.0, 1.0, -1.0],
    [1.0, -1.0, -1.0],
    [-1.0, -1.0, -1.0],
];

/// What stands at the other end of a bond.
#[derive(Clone, Copy, Debug)]
pub(super) struct Neighbour {
    /// Position in the list; that of the cell itself at a wall.
    pub(super) cell: u32,
    /// Axes of which a mirrored vector changes its sign, as bits.
    mirrored: u8,
    /// Axes of which the velocity that viscosity sees changes its sign, as bits.
    sheared: u8,
    /// Whether matter flows through the bond.
    pub(super) is_open: bool,
}

impl Neighbour {
    /// A vector of the cell as it stands at the end of the bond, even along the faces of the body.
    #[inline(always)]
    pub(super) fn mirror(self, v: [f64; 3]) -> [f64; 3] {
        signed(v, self.mirrored)
    }

    /// The velocity at the end of the bond as viscosity sees it.
    #[inline(always)]
    pub(super) fn shear(self, v: [f64; 3]) -> [f64; 3] {
        signed(v, self.sheared)
    }

    /// Whether it is the image behind a wall at a face of the body.
    pub(super) fn is_behind_wall(self) -> bool {
        self.mirrored != self.sheared
    }
}

#[inline(always)]
fn signed(v: [f64; 3], axes: u8) -> [f64; 3] {
    let signs = &SIGNS[usize::from(axes & 7)];
    [v[0] * signs[0], v[1] * signs[1], v[2] * signs[2]]
}

/// The liquid cells of a body.
#[derive(Debug)]
pub(super) struct Pool {
    pub(super) stencil: Stencil,
    /// By face ([`Face::ALL`]): whether the melt slips along it.
    slips: [bool; 6],
    /// Points of the cells, ascending, by their numbers in the whole body.
    pub(super) points: Vec<u32>,
    /// Points of the list before, then of the next one.
    other: Vec<u32>,
    /// Position in the list by point.
    cell_of: Vec<u32>,
    neighbours: Vec<Neighbour>,
}

impl Pool {
    pub(super) fn new(body: &Body, lattice: &Lattice, slips: [bool; 6]) -> Pool {
        Pool {
            stencil: Stencil::new(body.dimension, lattice.spacing),
            slips,
            points: Vec::new(),
            other: Vec::new(),
            cell_of: vec![SOLID; lattice.whole().points()],
            neighbours: Vec::new(),
        }
    }

    /// Number of cells.
    pub(super) fn len(&self) -> usize {
        self.points.len()
    }

    /// Position of a point in the list.
    pub(super) fn cell(&self, point: usize) -> Option<usize> {
        let cell = self.cell_of[point];
        (cell != SOLID).then_some(cell as usize)
    }

    /// Neighbours of a cell, in the order of the bonds.
    #[inline(always)]
    pub(super) fn neighbours(&self, cell: usize) -> &[Neighbour] {
        let bonds = self.stencil.bonds.len();
        &self.neighbours[cell * bonds..(cell + 1) * bonds]
    }

    /// Takes up the points that are liquid now, ascending; whether the list changed. [`Pool::before`] is the list before.
    pub(super) fn update(&mut self, body: &Body, liquid: impl Iterator<Item = usize>) -> bool {
        self.other.clear();
        self.other.extend(liquid.map(|p| p as u32));
        if self.other == self.points {
            return false;
        }
        mem::swap(&mut self.points, &mut self.other);
        self.find_neighbours(body);
        true
    }

    /// Replaces the list by the points of a restored state.
    pub(super) fn restore(&mut self, body: &Body, points: Vec<u32>) {
        self.other = mem::replace(&mut self.points, points);
        self.find_neighbours(body);
    }

    /// The points of the list before the last change.
    pub(super) fn before(&self) -> &[u32] {
        &self.other
    }

    fn find_neighbours(&mut self, body: &Body) {
        self.other
            .iter()
            .for_each(|p| self.cell_of[*p as usize] = SOLID);
        for (cell, point) in (0..).zip(&self.points) {
            self.cell_of[*point as usize] = cell;
        }
        self.neighbours.clear();
        let Some(lattice) = body.lattice().map(Lattice::whole) else {
            return;
        };
        for (cell, point) in (0..).zip(&self.points) {
            let at = lattice.cell(*point as usize).map(i64::from);
            for bond in &self.stencil.bonds {
                let neighbour = self.neighbour(body, lattice, at, bond.step);
                let severed = |n: &Neighbour| {
                    !body.cuts.is_empty() && self.is_severed(body, lattice, *point, bond.xi, *n)
                };
                let whole = neighbour.filter(|n| !severed(n));
                self.neighbours.push(whole.unwrap_or(Neighbour {
                    cell,
                    mirrored: 0,
                    sheared: 0,
                    is_open: false,
                }));
            }
        }
    }

    /// The neighbour of a lattice cell; `None` where it is a wall.
    fn neighbour(
        &self,
        body: &Body,
        lattice: &Lattice,
        mut at: [i64; 3],
        step: [i64; 3],
    ) -> Option<Neighbour> {
        let (mut mirrored, mut sheared) = (0, 0);
        for a in 0..3 {
            let cells = lattice.cells[a] as i64;
            at[a] += step[a];
            let is_upper = at[a] >= cells;
            if at[a] >= 0 && !is_upper {
                continue;
            }
            if body.periodic[a] {
                at[a] = at[a].rem_euclid(cells);
                continue;
            }
            // the image of the cell before the face
            at[a] -= step[a];
            mirrored ^= 1 << a;
            sheared ^= match self.slips[2 * a + usize::from(is_upper)] {
                true => 1 << a,
                false => 7,
            };
        }
        let cell = self.cell(lattice.point(at)?)?;
        Some(Neighbour {
            cell: cell as u32,
            mirrored,
            sheared,
            is_open: true,
        })
    }

    /// Whether a crack lies between a point and its neighbour at the end of the bond `xi` (m).
    fn is_severed(
        &self,
        body: &Body,
        lattice: &Lattice,
        point: u32,
        xi: [f64; 3],
        neighbour: Neighbour,
    ) -> bool {
        let position = |point: u32| lattice.centre(lattice.cell(point as usize));
        let from = position(point);
        let to = match neighbour.mirrored {
            0 => from + Vector3::from(xi),
            _ => position(self.points[neighbour.cell as usize]),
        };
        severed(&body.cuts, &from, &to)
    }

    /// The pool of each cell, numbered by their first cells: melt that is connected. Returns their number, too.
    pub(super) fn find_pools(&self) -> (usize, Vec<usize>) {
        const NONE: usize = usize::MAX;
        let mut pool_of = vec![NONE; self.len()];
        let (mut count, mut open) = (0, Vec::new());
        for first in 0..self.len() {
            if pool_of[first] != NONE {
                continue;
            }
            pool_of[first] = count;
            open.push(first);
            while let Some(cell) = open.pop() {
                for neighbour in self.neighbours(cell).iter().filter(|n| n.is_open) {
                    let other = neighbour.cell as usize;
                    if pool_of[other] == NONE {
                        pool_of[other] = count;
                        open.push(other);
                    }
                }
            }
            count += 1;
        }
        (count, pool_of)
    }

    /// The lattice cell of a cell.
    pub(super) fn place(&self, lattice: &Lattice, cell: usize) -> [u32; 3] {
        lattice.whole().cell(self.points[cell] as usize)
    }

    /// Whether a cell lies at a face of the body.
    pub(super) fn is_at(&self, body: &Body, cell: usize, face: Face) -> bool {
        body.lattice().is_some_and(|lattice| {
            let axis = face.axis();
            let at = self.place(lattice, cell)[axis] as usize;
            at == if face.is_upper() {
                lattice.cells[axis] - 1
            } else {
                0
            }
        })
    }
}

/// Sets the value of each cell, on several threads where that pays.
pub(super) fn set_cells<T: Send>(values: &mut [T], of: impl Fn(usize) -> T + Sync) {
    let cells = values.par_iter_mut().enumerate().with_min_len(PARALLEL / 2);
    cells.for_all(|(cell, value)| *value = of(cell));
}

/// Sets the values of the bonds of each cell, `bonds` for each, on several threads where that pays.
pub(super) fn set_rows(values: &mut [f64], bonds: usize, of: impl Fn(usize, &mut [f64]) + Sync) {
    let cells = values.par_chunks_mut(bonds).enumerate();
    let cells = cells.with_min_len(PARALLEL / 2);
    cells.for_all(|(cell, values)| of(cell, values));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::block;
    use perimelt_core::body::{Cut, Store};

    /// A plane of 4 x 3 cells, free along y+, of which the last column is solid.
    fn pool() -> Pool {
        let body = block([4, 3, 1], 2, 0.5, Store::Lattice, "density = 1");
        let mut slips = [false; 6];
        slips[3] = true;
        let lattice = body.lattice().expect("a lattice");
        let mut pool = Pool::new(&body, lattice, slips);
        let liquid = || (0..12).filter(|point| point % 4 < 3);
        assert!(pool.update(&body, liquid()));
        assert!(!pool.update(&body, liquid()));
        pool
    }

    fn neighbour(pool: &Pool, cell: usize, step: [i64; 3]) -> Neighbour {
        let bonds = &pool.stencil.bonds;
        let bond = bonds.iter().position(|b| b.step == step).expect("a bond");
        pool.neighbours(cell)[bond]
    }

    #[test]
    fn walls_turn_the_velocity_and_free_faces_mirror_it() {
        let pool = pool();
        let v = [1.0, 2.0, 0.0];
        // cell 4 is the middle one
        let beside = neighbour(&pool, 4, [1, 1, 0]);
        assert!(beside.is_open && beside.cell == 8 && beside.mirror(v) == v);
        let solid = neighbour(&pool, 5, [1, 0, 0]);
        assert!(!solid.is_open && solid.cell == 5);
        let free = neighbour(&pool, 7, [1, 1, 0]);
        assert_eq!(
            (free.cell, free.is_open, free.is_behind_wall()),
            (8, true, false)
        );
        assert_eq!([free.mirror(v), free.shear(v)], [[1.0, -2.0, 0.0]; 2]);
        let wall = neighbour(&pool, 3, [-1, 0, 0]);
        assert_eq!((wall.cell, wall.is_behind_wall()), (3, true));
        assert_eq!(wall.mirror(v), [-1.0, 2.0, 0.0]);
        assert_eq!(wall.shear(v), [-1.0, -2.0, -0.0]);
        assert_eq!(pool.cell(3), None);
        assert_eq!(pool.cell(4), Some(3));
    }

    #[test]
    fn a_new_list_knows_the_points_of_the_one_before() {
        let mut pool = pool();
        let body = block([4, 3, 1], 2, 0.5, Store::Lattice, "density = 1");
        assert!(pool.update(&body, [5].into_iter()));
        assert_eq!((pool.points.as_slice(), pool.before().len()), (&[5][..], 9));
        assert!(pool.neighbours(0).iter().all(|n| !n.is_open));
        assert_eq!((pool.cell(4), pool.cell(5)), (None, Some(0)));
    }

    /// A crack from the upper face to the middle: no bond crosses it, not even one with an image behind the face, and melt on both
    /// sides of a longer one is not connected.
    #[test]
    fn melt_does_not_flow_through_cracks() {
        let mut body = block([4, 3, 1], 2, 0.5, Store::Lattice, "density = 1");
        let mut slips = [false; 6];
        slips[3] = true;
        for (lowest, pools) in [(0.5, 1), (-0.1, 2)] {
            body.cuts = vec![Cut::segment([1.0, 1.6], [1.0, lowest]).expect("a length")];
            let mut pool = Pool::new(&body, body.lattice().expect("a lattice"), slips);
            assert!(pool.update(&body, 0..12));
            for (cell, step) in [
                (9, [1, 0, 0]),
                (9, [1, 1, 0]),
                (5, [1, 1, 0]),
                (10, [-1, 1, 0]),
            ] {
                let across = neighbour(&pool, cell, step);
                assert!(
                    !across.is_open && across.cell as usize == cell,
                    "{cell} {step:?}"
                );
            }
            assert!(neighbour(&pool, 9, [-1, 1, 0]).is_open);
            assert_eq!(neighbour(&pool, 1, [1, 0, 0]).is_open, pools == 1);
            let (count, pool_of) = pool.find_pools();
            assert_eq!((count, pool_of[11]), (pools, pools - 1));
        }
    }
}
