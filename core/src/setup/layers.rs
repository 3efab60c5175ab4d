//! Layers behind the faces of a body: which boundary sets them, and which physics reads them.

use crate::body::Face;
use crate::error::SetupError;
use crate::family::LayerRule;
use crate::field::{Key, Value};
use crate::world::{BodyIndex, LayerHandle, Layers, LayersHandle};

use super::{Access, Setup};

/// What a layer does with the conserved quantity of its field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LayerRole {
    /// It exchanges the quantity with the body, so that its share is accounted for.
    Prescribed,
    /// It exchanges nothing.
    Free,
    /// Like `Free`, for a boundary that may act on a field without an owner.
    IfProvided,
}

/// Layers behind faces that boundaries have claimed for a field.
#[derive(Clone, Debug)]
pub struct ClaimedLayers {
    /// Permission to read the rules during the run.
    pub handle: LayersHandle,
    /// How layers continue the field, as far as boundaries announced at set-up.
    pub rules: Vec<LayerRule>,
    /// The faces whose layers exchange the conserved quantity.
    pub prescribed: Vec<Face>,
}

impl ClaimedLayers {
    /// The faces with a layer.
    pub fn faces(&self) -> Vec<Face> {
        self.rules.iter().map(|rule| rule.face).collect()
    }
}

impl Setup<'_> {
    fn layers_of(&mut self, body: BodyIndex, field: &str) -> usize {
        let layers = &mut self.world.layers;
        layers
            .iter()
            .position(|l| l.body == body && l.field == field)
            .unwrap_or_else(|| {
                let prescribed = Vec::new();
                let rules = Vec::new().into();
                layers.push(Layers {
                    body,
                    field: field.to_string(),
                    prescribed,
                    rules,
                });
                layers.len() - 1
            })
    }

    /// Tells at set-up how a layer will continue its field, so that a physics knows it before the first step: its
    /// stable step depends on it.
    pub fn announce_layer(&mut self, layer: LayerHandle, rule: LayerRule) {
        let rules = self.world.layers[layer.layers].rules.get_mut();
        let own = rules.iter_mut().filter(|r| r.face == layer.face);
        own.for_each(|own| *own = rule.clone());
    }

    /// A mirrored layer for the field of `key` behind a face of the body's box, whose values the calling boundary sets.
    ///
    /// # Errors
    /// When another boundary has the same layer, or the body has no such face.
    pub fn layer<T: Value>(
        &mut self,
        body: BodyIndex,
        key: &Key<T>,
        face: Face,
        kind: LayerRole,
    ) -> Result<LayerHandle, SetupError> {
        if face.axis() >= self.body(body).dimension {
            let dimension = self.body(body).dimension;
            return Err(SetupError::value(
                "face",
                format!("a {dimension}D body has no face `{}`", face.name()),
                "a face within the body's dimensions",
            ));
        }
        if self.body(body).periodic[face.axis()] {
            let message = format!("the body is periodic across face `{}`", face.name());
            let expected = "a face of an axis that is not in `periodic` of the body";
            return Err(SetupError::value("face", message, expected));
        }
        if self.body(body).layers().is_some() {
            let name = &self.body(body).name;
            let message = format!(
                "body `{name}` has a `layup`: its bonds end at face `{}`",
                face.name()
            );
            let expected = "a `region` of the body";
            return Err(SetupError::value("face", message, expected));
        }
        if let Some(lattice) = self.body(body).lattice()
            && !lattice.reaches(face)
        {
            // as of a quarter that is cut out of a cylinder: the box is that of the whole one
            let (name, face) = (&self.body(body).name, face.name());
            let message = format!(
                "no point of body `{name}` lies at face `{face}` of the bounding box of its shape"
            );
            let expected = "a shape whose bounding box ends at its points, such as a box from which the rest is subtracted";
            return Err(SetupError::value("face", message, expected));
        }
        let access = match kind {
            LayerRole::IfProvided => Access::LayerIfProvided,
            LayerRole::Prescribed | LayerRole::Free => Access::Layer,
        };
        self.declare(body, key, access)?;
        let layers = self.layers_of(body, &key.name);
        let entry = &mut self.world.layers[layers];
        let rules = entry.rules.get_mut();
        if rules.iter().any(|r| r.face == face) {
            let message = format!(
                "face `{}` already has a layer for `{}`",
                face.name(),
                key.name
            );
            return Err(SetupError::value(
                "face",
                message,
                "one boundary for each face and field",
            ));
        }
        rules.push(LayerRule::even(face));
        rules.sort_by_key(|r| r.face);
        if kind == LayerRole::Prescribed {
            entry.prescribed.push(face);
        }
        Ok(LayerHandle { layers, face })
    }

    /// The layers of a field that the calling physics owns.
    pub fn layers<T: Value>(&mut self, body: BodyIndex, key: &Key<T>) -> ClaimedLayers {
        let index = self.layers_of(body, &key.name);
        let layers = &self.world.layers[index];
        ClaimedLayers {
            handle: LayersHandle(index),
            rules: layers.rules.borrow().clone(),
            prescribed: layers.prescribed.clone(),
        }
    }
}
