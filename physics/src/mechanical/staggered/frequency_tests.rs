//! Frequencies of staggered bodies.

use perimelt_core::solver::{Reducer, largest_eigenvalue};

use super::tests::{all, solid};
use crate::mechanical::solid::Stiffness;

/// No body of cells vibrates faster than a single one, nor does its largest frequency stay far below.
#[test]
fn no_frequency_is_above_that_of_a_cell() {
    all(|body, plane| {
        for stabilisation in ["", "stabilisation = 0.1", "stabilisation = 4"] {
            let mut solid = solid(body, &format!("{plane}{stabilisation}"));
            let density = vec![8000.0; body.points.len()];
            let limit = solid.largest_frequency(&density, &[]);
            let dimension = body.dimension;
            let at_nodes = solid.base().nodes.densities(&density, &[]);
            let inverse = at_nodes.iter().flat_map(|rho| {
                std::array::from_fn::<_, 3, _>(|a| if a < dimension { 1.0 / rho } else { 0.0 })
            });
            let inverse: Vec<f64> = inverse.collect();
            let square = largest_eigenvalue(&inverse, &Reducer::default(), |u, out| {
                solid.set_displacement(u, &[]);
                solid.stiffness(Stiffness::Elastic, out);
            });
            // the estimate has a margin of a tenth
            let largest = (square / 1.1).sqrt();
            let ratio = largest / limit;
            assert!(
                (0.7..1.0 + 1e-9).contains(&ratio),
                "{plane}{stabilisation}: {ratio}"
            );
        }
    });
}
