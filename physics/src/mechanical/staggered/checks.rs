//! What staggered solids do not support.

use perimelt_core::body::Lattice;
use perimelt_core::family::LayerRule;
use perimelt_core::{Body, Correction, Influence, PartialVolume, SetupError};

use crate::mechanical::keys::Mechanical;
use crate::mechanical::surface_stress::SurfaceStress;

/// Refuses keys and layers that do not go together with corners as nodes.
pub(in crate::mechanical) fn check(
    keys: &Mechanical,
    rules: &[LayerRule],
) -> Result<(), SetupError> {
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
    if let Some(rule) = rules.iter().find(|rule| rule.traction.is_some()) {
        let message = format!(
            "the traction on face `{}` acts by a layer, and a staggered solid has none",
            rule.face.name()
        );
        let expected = "`by = \"body_force\"` in `traction`, which acts on the face exactly";
        return Err(SetupError::value("body", message, expected));
    }
    Ok(())
}

/// The lattice of a body; refuses bodies whose cells do not meet at corners.
pub(super) fn lattice(body: &Body) -> Result<&Lattice, SetupError> {
    let refuse = |what: &str| {
        let message = format!(
            "`formulation = \"staggered\"` does not support body `{}`, which {what}",
            body.name
        );
        let expected = "a body on one lattice, neither periodic nor cracked, or `formulation = \"correspondence\"`";
        Err(SetupError::value("formulation", message, expected))
    };
    if body.periodic.contains(&true) {
        return refuse("is periodic");
    }
    if !body.cuts.is_empty() {
        return refuse("has cracks");
    }
    match body.lattice() {
        Some(lattice) => Ok(lattice),
        None => refuse("has points that are no lattice"),
    }
}
