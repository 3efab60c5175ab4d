//! Families whose bonds are given.

use rayon::prelude::*;

use crate::body::Body;

use super::build::chunks;
use super::images::Layers;
use super::kernel::ROW_LANES;
use super::{Bond, CloudRows, Family, FamilySpec, PointSlots, Rows, Span, Store};

/// A bond of a point of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointBond {
    /// The point at its other end.
    pub other: u32,
    /// 1/m: `weight` and `dual` of the [`Bond`], which a kernel may take for the weights of two fluxes.
    pub weights: [f64; 2],
}

impl Family {
    /// A family of the given bonds of each point, in their order, without images of points: of a body whose bonds do not follow from
    /// the distances of its points, such as layers. `spec` is what [`Family::spec`] gives.
    ///
    /// # Panics
    /// When a bond ends at a point that the body does not have.
    pub fn of_bonds(
        body: &Body,
        spec: &FamilySpec,
        bonds: impl Fn(usize) -> Vec<PointBond> + Sync,
    ) -> Family {
        let position = &body.points.position;
        let row = |point: usize| {
            let bonds = bonds(point)
                .into_iter()
                .map(|PointBond { other, weights }| {
                    let xi = position[other as usize] - position[point];
                    (other, Bond::new(xi.into(), xi.norm(), weights))
                });
            Rows::of_point(point, &bonds.collect::<Vec<_>>())
        };
        let rows: Vec<Rows> = (0..position.len()).into_par_iter().map(row).collect();
        let mut cloud = CloudRows::new(body, Rows::joined(&rows));
        cloud.places.at = std::array::from_fn(|a| position.iter().map(|x| x[a]).collect());
        let number = cloud.rows.column.len() - ROW_LANES;
        let all = Span {
            slot: 0,
            point: 0,
            len: position.len() as u32,
        };
        let mut family = Family::of_rows(
            body,
            spec,
            Store::Cloud(cloud),
            PointSlots::Ascending(vec![all]),
        );
        family.bonds = number;
        family.slots.len = position.len();
        family.slots.set_ghosts(Layers::default());
        family.chunks = chunks(&family.store);
        family
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::family::{BondKernel, Mirrored, SlotField};
    use crate::shape::{BoxShape, Shape};

    struct Difference;

    impl BondKernel<1, 1> for Difference {
        fn bond(&self, bond: &Bond, [own]: [f64; 1], [other]: [f64; 1]) -> [f64; 1] {
            [bond.mean() * bond.inverse_length * (other - own)]
        }
    }

    #[test]
    fn sums_run_over_the_bonds_that_are_given() {
        let shape = Shape::Box(BoxShape {
            min: [0.0; 3],
            max: [4.0, 1.0, 1.0],
        });
        let body = Body::fill("row", &shape, 3, 1.0, 1.0).expect("valid");
        // each point with the last one, two or three spacings away
        let bonds = |point: usize| {
            let to = |other: u32| PointBond {
                other,
                weights: [6.0; 2],
            };
            match point {
                3 => vec![to(0), to(1)],
                0 | 1 => vec![to(3)],
                _ => Vec::new(),
            }
        };
        let family = Family::of_bonds(&body, &FamilySpec::new(1.0), bonds);
        assert_eq!(family.bonds(), 4);
        let mut slots = SlotField::default();
        slots.load(&family, &[1.0, 2.0, 5.0, 8.0][..], Mirrored::Scalar);
        let mut sums = vec![[0.0]; 4];
        family.sum(&Difference, [&slots], &mut sums);
        assert_eq!(sums, [[14.0], [18.0], [0.0], [-32.0]]);
    }
}
