//! What staggered solids do not support.

use perimelt_core::body::Lattice;
use perimelt_core::{Body, Correction, Influence, PartialVolume, SetupError};

use crate::mechanical::keys::Mechanical;
use crate::mechanical::surface_stress::SurfaceStress;

/// Refuses keys that do not go together with corners as nodes.
pub(in crate::mechanical) fn check(keys: &Mechanical) -> Result<(), SetupError> {
    for (key, is_supported, expected) in [
        ("fracture", keys.fracture.is_none(), "no `fracture`"),
        (
            "surface_stress",
            keys.surface_stress == SurfaceStress::Direct,
            "\"direct\": points at surfaces have the strain of their own cell",
        ),
        ("horizon", keys.horizon.is_none(), "no `horizon`"),
        (
            "partial_volume",
            keys.partial_volume == PartialVolume::default(),
            "no `partial_volume`",
        ),
        (
            "influence",
            keys.influence == Influence::default(),
            "no `influence`",
        ),
        (
            "correction",
            keys.correction == Correction::default(),
            "no `correction`",
        ),
    ] {
        if !is_supported {
            let message = format!("`formulation = \"staggered\"` does not support this `{key}`");
            let expected = format!("{expected}, or `formulation = \"correspondence\"`");
            return Err(SetupError::value(key, message, expected));
        }
    }
    Ok(())
}

/// The lattice of a body; refuses bodies whose cells do not meet at corners.
pub(super) fn lattice(body: &Body) -> Result<&Lattice, SetupError> {
    body.lattice().ok_or_else(|| {
        let message = format!(
            "`formulation = \"staggered\"` does not support body `{}`, which has points that are no lattice",
            body.name
        );
        let expected = "a body on one lattice, or `formulation = \"correspondence\"`";
        SetupError::value("formulation", message, expected)
    })
}
