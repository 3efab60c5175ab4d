//! Which materials the points of a body consist of at present.

use std::cell::Ref;

use perimelt_core::material::mixed_conductivity;
use perimelt_core::world::{BodyIndex, LayerSideBySide, TwoFluids};
use perimelt_core::{Body, Read, Setup, SetupError, World, keys};

/// How properties of a point follow from its materials: each point has one, or two fluids flow through the points.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PointMaterials {
    fluids: Option<FlowingFluids>,
}

/// Two fluids that flow through the points.
#[derive(Clone, Copy, Debug)]
struct FlowingFluids {
    materials: [u16; 2],
    /// Volume of the first one over that of the point.
    fraction: Read<f64>,
    /// Whether they conduct side by side in the layer between them.
    conduct_side_by_side: bool,
}

/// The materials of the points at a time.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PresentMaterials<'a> {
    material: &'a [u16],
    mixture: Option<(FlowingFluids, &'a [f64])>,
}

impl PointMaterials {
    /// The materials of a body; where two fluids flow through it, the calling plugin reads their fraction from now on.
    ///
    /// # Errors
    /// As [`Setup::read`].
    pub fn prepare(setup: &mut Setup<'_>, body: BodyIndex) -> Result<Self, SetupError> {
        let fluids = setup.facts::<TwoFluids>(body).next();
        let fluids = match fluids.and_then(|fluids| fluids.indices(setup.body(body))) {
            None => None,
            Some(materials) => Some(FlowingFluids {
                materials,
                fraction: setup.read(body, &keys::FLUID_FRACTION)?,
                conduct_side_by_side: setup.facts::<LayerSideBySide>(body).next().is_some(),
            }),
        };
        Ok(PointMaterials { fluids })
    }

    /// Whether two fluids flow through the points.
    pub fn are_fluids(&self) -> bool {
        self.fluids.is_some()
    }

    /// Indices of the materials that a point may have during the run; of one twice.
    pub fn possible(&self, body: &Body, point: usize) -> [usize; 2] {
        let own = [body.material_of_point[point]; 2];
        self.fluids.map_or(own, |f| f.materials).map(usize::from)
    }

    /// Fraction of the first of two fluids at present, where there are two.
    pub fn fraction<'a>(&self, world: &'a World) -> Option<Ref<'a, [f64]>> {
        self.fluids.map(|fluids| world.read(fluids.fraction))
    }

    /// The materials of the points of a body with this [`PointMaterials::fraction`].
    pub fn with<'a>(&self, body: &'a Body, fraction: Option<&'a [f64]>) -> PresentMaterials<'a> {
        PresentMaterials {
            material: &body.material_of_point,
            mixture: self.fluids.zip(fraction),
        }
    }
}

impl PresentMaterials<'_> {
    /// Mean of a property by volume; `of`: the property of a material by its index.
    pub fn mean(&self, point: usize, of: impl Fn(usize) -> f64) -> f64 {
        match self.mixture {
            None => of(usize::from(self.material[point])),
            Some(_) => {
                let [first, second] = self.shares(point).map(|(m, share)| share * of(m));
                first + second
            }
        }
    }

    /// The two materials of a point, by their indices, with their shares of its volume.
    pub fn shares(&self, point: usize) -> [(usize, f64); 2] {
        match self.mixture {
            None => [1.0, 0.0].map(|share| (usize::from(self.material[point]), share)),
            Some((fluids, fraction)) => {
                let c = fraction[point].clamp(0.0, 1.0);
                let [first, second] = fluids.materials.map(usize::from);
                [(first, c), (second, 1.0 - c)]
            }
        }
    }

    /// Conductivity of a point from those of materials by their index, W/(m K); [`mixed_conductivity`].
    pub fn conductivity(&self, point: usize, of: impl Fn(usize) -> f64) -> f64 {
        match self.mixture {
            None => of(usize::from(self.material[point])),
            Some((fluids, fraction)) => {
                let both = fluids.materials.map(|m| of(usize::from(m)));
                mixed_conductivity(both, fraction[point], fluids.conduct_side_by_side)
            }
        }
    }
}
