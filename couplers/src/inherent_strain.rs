//! Inherent strain: the strain that welding or a layer leaves in the material, given instead of computed.
//!
//! The points of `region` get a stress-free strain as soon as they have material:
//!
//! ```text
//! eigenstrain_tensor += factor(t) strain(height)
//! ```
//!
//! With `deposit` and its `layers` every layer gets it when it is deposited, so that one quasi-static step for each
//! layer, or for several layers deposited together (`at_once`), gives the distortion of a part: layers are free of
//! stress on the deformed part below them, and then shrink. The strain comes from a measurement (a cantilever cut
//! free), or from a transient run of a patch or of a few layers of the same process; it is negative where metal
//! shrinks. It replaces thermal and plastic strain, so that neither `thermal` nor `plasticity` is needed.
//!
//! Not for: temperatures, and residual stresses above the yield stress where the body has no `plasticity`.

use nalgebra::Matrix3;
use perimelt_core::{
    Coupler, Face, Prepared, Programme, RunError, RunningCoupler, Setup, SetupError, Step,
    StepLimits, Stepping, World, Write, keys,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::InTime;
use crate::boundary::with_programme;

/// Stress-free strain of a region, by components.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct InherentStrain {
    /// Body; may be left out when there is one only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
    /// Region of the points that get the strain, such as that of `deposit`.
    pub region: String,
    /// Strain, negative where it shrinks: `[xx, yy, zz]`, or `[xx, yy, zz, xy, yz, zx]` with shear strains of the tensor
    /// (half of the angle).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub strain: Option<Vec<f64>>,
    /// Strain by height above the lowest point of the region, instead of `strain`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub by_height: Option<ByHeight>,
    /// Direction in which heights are measured; default `"z+"` in 3D, `"y+"` in 2D, `"x+"` in 1D.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub up: Option<Face>,
    /// Factor on the strain in time: a number, or `{ time = [...], value = [...] }`, times in s; default 1.
    #[serde(default = "one")]
    pub factor: InTime,
}

fn one() -> InTime {
    InTime::Constant(1.0)
}

/// Strains at heights, linear in between and constant beyond.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ByHeight {
    /// Heights (m), increasing.
    pub height: Vec<f64>,
    /// Strain at each height, as `strain`.
    pub strain: Vec<Vec<f64>>,
}

/// A strain that is ready to act.
struct RunningInherentStrain {
    factor: InTime,
    /// Points with their strain.
    strains: Vec<(u32, Matrix3<f64>)>,
    inherent: Write<Matrix3<f64>>,
}

/// A strain from three or six components.
fn tensor(components: &[f64]) -> Option<Matrix3<f64>> {
    if components.iter().any(|e| !e.is_finite()) {
        return None;
    }
    match *components {
        [xx, yy, zz] => Some(Matrix3::from_diagonal(&[xx, yy, zz].into())),
        [xx, yy, zz, xy, yz, zx] => Some(Matrix3::new(xx, xy, zx, xy, yy, yz, zx, yz, zz)),
        _ => None,
    }
}

/// A strain from the components of `key`.
fn read(key: &str, components: &[f64]) -> Result<Matrix3<f64>, SetupError> {
    tensor(components).ok_or_else(|| {
        let message = format!("the strain {components:?} has not three or six components");
        let expected = "`[xx, yy, zz]` or `[xx, yy, zz, xy, yz, zx]`";
        SetupError::value(key, message, expected)
    })
}

/// Strains by height: one for all heights, or rows.
struct Profile {
    height: Vec<f64>,
    strain: Vec<Matrix3<f64>>,
}

impl Profile {
    fn of(keys: &InherentStrain) -> Result<Profile, SetupError> {
        match (&keys.strain, &keys.by_height) {
            (Some(strain), None) => Ok(Profile {
                height: vec![0.0],
                strain: vec![read("strain", strain)?],
            }),
            (None, Some(rows)) => {
                let increase = rows.height.windows(2).all(|w| w[0] < w[1]);
                if !increase || rows.height.is_empty() || rows.height.len() != rows.strain.len() {
                    let message = "the heights do not increase, or there are not as many strains";
                    let expected = "`height` in increasing order, and as many rows in `strain`";
                    return Err(SetupError::value("by_height", message, expected));
                }
                let strain = rows.strain.iter().map(|e| read("by_height.strain", e));
                Ok(Profile {
                    height: rows.height.clone(),
                    strain: strain.collect::<Result<_, _>>()?,
                })
            }
            _ => {
                let message = "`strain` and `by_height` are both given or both missing";
                let expected = "either `strain` or `by_height`";
                Err(SetupError::value("strain", message, expected))
            }
        }
    }

    fn at(&self, height: f64) -> Matrix3<f64> {
        let above = self.height.partition_point(|h| *h <= height);
        match above {
            0 => self.strain[0],
            n if n == self.height.len() => self.strain[n - 1],
            n => {
                let (low, high) = (self.height[n - 1], self.height[n]);
                let part = (height - low) / (high - low);
                self.strain[n - 1] * (1.0 - part) + self.strain[n] * part
            }
        }
    }
}

#[typetag::serialize(name = "inherent_strain")]
impl Coupler for InherentStrain {
    fn prepare(self: Box<Self>, setup: &mut Setup<'_>) -> Prepared<dyn RunningCoupler> {
        let body = setup.find_body(self.body.as_deref())?;
        let profile = Profile::of(&self)?;
        let points = setup.region(body, "region", &self.region)?.points;
        let this = setup.body(body);
        let usual = [Face::XMax, Face::YMax, Face::ZMax][this.dimension - 1];
        let up = self.up.unwrap_or(usual);
        let level = |p: u32| this.points.position.at(p as usize).dot(&up.normal());
        let lowest = |p: &u32| level(*p) - 0.5 * this.points.spacing[*p as usize];
        let base = points.iter().map(lowest).fold(f64::INFINITY, f64::min);
        let base = setup.world().reducer(body).min(base);
        let strain = |&p: &u32| (p, profile.at(level(p) - base));
        let strains = points.iter().map(strain).collect();
        let programme = Programme::of_values([("factor", &self.factor)]);
        setup.stepping(Stepping {
            is_steady: matches!(self.factor, InTime::Constant(_)),
            ..with_programme(programme)
        });
        Ok(Box::new(RunningInherentStrain {
            factor: self.factor,
            strains,
            inherent: setup.add(body, &keys::EIGENSTRAIN_TENSOR)?,
        }))
    }
}

impl RunningCoupler for RunningInherentStrain {
    fn apply(&mut self, world: &World, step: Step) -> Result<(), RunError> {
        let factor = self.factor.value_at("factor", step.end());
        let factor = factor.map_err(|e| RunError::wrong_value("inherent_strain", e))?;
        let mut inherent = world.write(self.inherent);
        for (point, strain) in &self.strains {
            inherent[*point as usize] += factor * strain;
        }
        Ok(())
    }

    fn step_limits(&self, time: f64) -> StepLimits {
        StepLimits {
            next_event: self.factor.next_event(time),
            ..StepLimits::default()
        }
    }
}

perimelt_core::register_coupler!("inherent_strain", InherentStrain, supports: [Births, Cuts, Division]);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{STEEL, apply, block, prepare, read, refusal, values};

    #[test]
    fn the_strain_follows_height_and_time() {
        let mut world = World::new(vec![block([1, 4, 1], 2, STEEL)]);
        let coupler: InherentStrain = read(
            "region = 'left'\nfactor = { time = [0, 2], value = [0, 2] }
             by_height = { height = [1, 3], strain = [[0, 0, 0], [-4, 2, 0, 1, 0, 0]] }",
        );
        let (mut coupler, ()) = prepare(&mut world, coupler, |setup| {
            setup.consume(0, &keys::EIGENSTRAIN_TENSOR).expect("free");
        })
        .expect("valid");
        apply(&world, &mut *coupler, 0.0);
        let strain = values(&world, &keys::EIGENSTRAIN_TENSOR);
        let xx: Vec<f64> = (0..4).map(|p| strain[9 * p]).collect();
        // centres of unit cells, at the end of the first second
        assert_eq!(xx, [0.0, -1.0, -3.0, -4.0]);
        assert_eq!((strain[9 * 3 + 1], strain[9 * 3 + 4]), (1.0, 2.0));
        assert_eq!(coupler.step_limits(0.5).next_event, Some(2.0));
    }

    #[test]
    fn heights_count_along_the_direction_of_build() {
        let by_height = "by_height = { height = [1, 3], strain = [[0, 0, 0], [-4, 2, 0]] }";
        for (cells, dimension, up, expected) in [
            ([1, 4, 1], 2, "", [0.0, -1.0, -3.0, -4.0]),
            ([1, 4, 1], 2, "up = 'y-'", [-4.0, -3.0, -1.0, 0.0]),
            ([1, 1, 4], 3, "", [0.0, -1.0, -3.0, -4.0]),
            // all cells at one height of half a metre
            ([1, 1, 4], 3, "up = 'x-'", [0.0; 4]),
        ] {
            let mut world = World::new(vec![block(cells, dimension, STEEL)]);
            let table = format!("region = 'left'\n{up}\n{by_height}");
            let coupler: InherentStrain = read(&table);
            let (mut coupler, ()) = prepare(&mut world, coupler, |setup| {
                setup.consume(0, &keys::EIGENSTRAIN_TENSOR).expect("free");
            })
            .expect("valid");
            apply(&world, &mut *coupler, 0.0);
            let strain = values(&world, &keys::EIGENSTRAIN_TENSOR);
            let xx: Vec<f64> = strain.iter().step_by(9).copied().collect();
            assert_eq!(xx, expected, "{up}");
        }
    }

    /// Components `[xx, yy, zz, xy, yz, zx]` of a symmetric tensor.
    #[test]
    fn six_components_are_those_of_the_tensor() {
        let strain = tensor(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]).expect("six components");
        let expected = Matrix3::new(1.0, 4.0, 6.0, 4.0, 2.0, 5.0, 6.0, 5.0, 3.0);
        assert_eq!(strain, expected);
        assert_eq!(tensor(&[1.0, f64::NAN, 3.0]), None);
    }

    #[test]
    fn mistakes_are_told_with_their_key() {
        for (table, key) in [
            ("region = 'left'", "strain"),
            ("region = 'left'\nstrain = [1, 2]", "strain"),
            (
                "region = 'left'\nby_height = { height = [1, 1], strain = [[0, 0, 0], [0, 0, 0]] }",
                "by_height",
            ),
        ] {
            let mut world = World::new(vec![block([2, 2, 1], 2, STEEL)]);
            let coupler: InherentStrain = read(table);
            assert!(
                refusal(&mut world, coupler).starts_with(&format!("{key}: ")),
                "{table}"
            );
        }
    }
}
