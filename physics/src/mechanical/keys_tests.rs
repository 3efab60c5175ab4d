//! Defaults of keys that depend on other keys.

use super::keys::{Formulation, Mechanical};
use crate::testing::read;

#[test]
fn a_body_that_flows_is_staggered_unless_a_key_says_otherwise() {
    for (keys, expected) in [
        ("", Formulation::Bond),
        ("plasticity = {}", Formulation::Staggered),
        ("flow.norton = {}", Formulation::Staggered),
        ("formulation = 'staggered'", Formulation::Staggered),
        (
            "plasticity = {}\nformulation = 'correspondence'",
            Formulation::Correspondence,
        ),
    ] {
        let mechanical: Mechanical = read(keys);
        assert_eq!(mechanical.formulation(), expected, "{keys}");
    }
}
