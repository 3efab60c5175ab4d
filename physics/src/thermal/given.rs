//! Heat that a body takes from the bodies around its surface, in a two-way exchange ([`SurroundingBody`]).
//!
//! The heat through a cell face is integrated by the scheme that integrates the temperatures, whatever that is, and taken from the points of
//! the other body near the face in the proportions of their mean. The physics of that body takes it up at the start of its step.
//! What one body gains the other one loses to rounding.
//!
//! The temperature of the other body is that at the start of the step: the exchange is of first order in the step, which is limited
//! to half of the shortest time constant of a point of the other body, so that the exchange is stable. Points in many means may become colder
//! than the surface, which sees the mean only.

use std::rc::Rc;

use perimelt_core::body::Sizes;
use perimelt_core::material::EnthalpyCurve;
use perimelt_core::solver::reduce::sum_of;
use perimelt_core::world::exchange::{Exchange, SurfaceFlux as LawFlux};
use perimelt_core::world::surrounding_body::SurroundingBody;
use perimelt_core::{Access, Setup, SetupError, World, Write, keys};

use super::surface::{ExposedFace, FaceLaw, Surface, SurfaceFlux};

/// Fraction of the time constant of a point of the other body that a step may take.
const STEP_FRACTION: f64 = 0.5;

/// Heat that other bodies give through the surface.
#[derive(Debug, Default)]
pub(super) struct GivenHeat {
    /// Where each exchange takes the heat from; `None` where nothing loses it.
    sources: Vec<Option<Source>>,
    /// Parts of the surface through which heat is given.
    parts: Vec<GivenPart>,
    /// Heat given in this step through each part, J.
    heat: Vec<f64>,
    known_step: Option<KnownStep>,
    /// Work vector: power through each part, W.
    pub(super) powers: Vec<f64>,
}

/// The longest step last found.
#[derive(Clone, Copy, Debug)]
struct KnownStep {
    /// Bound of the temperatures for which it was found, K.
    hottest: f64,
    /// How often the faces had changed.
    changes: u64,
    /// s.
    step: f64,
}

/// A law of a face whose heat another body gives.
#[derive(Clone, Copy, Debug)]
struct GivenPart {
    face: u32,
    part: u32,
    exchange: u32,
    cell: u32,
}

/// A body that gives heat.
#[derive(Debug)]
struct Source {
    /// Amounts that it takes up, J/m³.
    amounts: Write<f64>,
    /// Least heat capacity of each of its points, J/K.
    capacity: Vec<f64>,
}

fn two_way(exchange: &Exchange) -> Option<&SurroundingBody> {
    exchange.around.as_ref().filter(|around| around.is_two_way)
}

impl Source {
    fn prepare(setup: &mut Setup<'_>, around: &SurroundingBody) -> Result<Source, SetupError> {
        let curves = setup.world().enthalpy_curves(around.body)?;
        let least = curves.iter().map(EnthalpyCurve::minimum_capacity);
        let least = least.fold(f64::INFINITY, f64::min);
        let volume = &setup.body(around.body).points.volume;
        let capacity = volume.each().map(|v| least * v).collect();
        Ok(Source {
            amounts: setup.give(around.body, &keys::GIVEN_HEAT, Access::Give)?,
            capacity,
        })
    }
}

impl Surface {
    /// Prepares to take heat from the bodies of two-way exchanges.
    pub(super) fn with_surroundings(
        mut self,
        setup: &mut Setup<'_>,
    ) -> Result<Surface, SetupError> {
        let prepare = |exchange: &Rc<Exchange>| {
            let around = two_way(exchange);
            around.map(|a| Source::prepare(setup, a)).transpose()
        };
        let sources = self.exchanges.iter().map(prepare);
        self.given.sources = sources.collect::<Result<_, _>>()?;
        Ok(self)
    }

    /// Takes the heat given in the last step from the bodies that give it; returns its sum, J.
    pub(super) fn take_from_surroundings(&mut self, world: &World) -> f64 {
        if self.given.is_empty() {
            return 0.0;
        }
        for (part, heat) in self.given.parts.iter().zip(&self.given.heat) {
            let exchange = &self.exchanges[part.exchange as usize];
            let (Some(around), Some(source)) = (
                two_way(exchange),
                &self.given.sources[part.exchange as usize],
            ) else {
                continue;
            };
            let volume = &world.body(around.body).points.volume;
            let mut amounts = world.write(source.amounts);
            let near = around.near();
            let (points, fractions) = near.of(part.cell as usize);
            for (&point, fraction) in points.iter().zip(fractions) {
                amounts[point as usize] -= heat * fraction / volume[point as usize];
            }
        }
        let sum = sum_of([&self.given.heat], |[heat]| heat);
        self.given.heat.fill(0.0);
        sum
    }
}

impl Surface {
    /// Values of the laws through which other bodies give heat, per volume of the points, as last evaluated.
    pub(super) fn given_rates<'a>(
        &'a self,
        value: impl Fn(LawFlux, &SurfaceFlux) -> f64 + 'a,
    ) -> impl Iterator<Item = f64> + 'a {
        self.given.parts().map(move |(face, part)| {
            let (face, through) = (&self.faces[face as usize], &self.fluxes[face as usize]);
            let part = &self.parts[part as usize];
            let law = self.exchanges[part.exchange as usize].law();
            let law = law.flux(part.cell as usize, through.asked);
            face.area_over_volume * part.fraction * value(law, through)
        })
    }

    /// Writes the heat that other bodies give through each part of the surface as last evaluated, W.
    pub(super) fn given_powers(&self, volume: &Sizes, powers: &mut [f64]) {
        let rates = self.given_rates(|law, through| law.flux + law.slope * through.change);
        let points = self
            .given
            .parts()
            .map(|(face, _)| self.faces[face as usize].point);
        for ((power, rate), point) in powers.iter_mut().zip(rates).zip(points) {
            *power = rate * volume[point as usize];
        }
    }

    /// Writes the change of the heat that other bodies give for a `change` of the temperatures (K), from what
    /// [`Surface::gains`] found.
    pub(super) fn given_changes(
        &self,
        gains: &[f64],
        change: &[f64],
        volume: &Sizes,
        powers: &mut [f64],
    ) {
        let gains = &gains[self.faces.len()..];
        let points = self
            .given
            .parts()
            .map(|(face, _)| self.faces[face as usize].point);
        for ((power, gain), point) in powers.iter_mut().zip(gains).zip(points) {
            *power = gain * change[point as usize] * volume[point as usize];
        }
    }

    /// Adds the heat that other bodies give during a step (s) to what they gave.
    pub(super) fn give_during(&mut self, step: f64, volume: &Sizes) {
        if self.given.is_empty() {
            return;
        }
        let mut powers = std::mem::take(&mut self.given.powers);
        powers.resize(self.given.len(), 0.0);
        self.given_powers(volume, &mut powers);
        self.given.add(step, &powers);
        self.given.powers = powers;
    }

    /// Longest step (s) in which heat does not flow back to the bodies that give it, while no point is warmer than `hottest` (K), with the largest conductivity of a point along an axis, W/(m K).
    pub(super) fn given_step(
        &mut self,
        hottest: f64,
        conductivity: impl Fn(usize, usize) -> f64,
        volume: &Sizes,
    ) -> f64 {
        let changes = self.changes;
        let known = self.given.known_step;
        if let Some(known) = known.filter(|k| k.hottest == hottest && k.changes == changes) {
            return known.step;
        }
        let conductance = |(face, part): (u32, u32)| {
            let (face, part) = (&self.faces[face as usize], &self.parts[part as usize]);
            let point = face.point as usize;
            let stiffness = self.exchanges[part.exchange as usize]
                .law()
                .stiffness(hottest);
            let resistance = 1.0 / stiffness + face.depth / conductivity(point, face.axis as usize);
            face.area_over_volume * volume[point] * part.fraction / resistance
        };
        let parts = self.given.parts().map(conductance);
        let step = self.given.longest_step(&self.exchanges, parts);
        self.given.known_step = Some(KnownStep {
            hottest,
            changes,
            step,
        });
        step
    }
}

impl GivenHeat {
    /// Whether a body gives heat through the surface.
    pub(super) fn is_possible(&self) -> bool {
        self.sources.iter().any(Option::is_some)
    }

    /// Finds the parts of the surface through which other bodies give heat.
    pub(super) fn find(
        &mut self,
        faces: &[ExposedFace],
        parts: &[FaceLaw],
        exchanges: &[Rc<Exchange>],
    ) {
        self.parts.clear();
        for (index, face) in faces.iter().enumerate() {
            for part in face.parts[0]..face.parts[1] {
                let law = &parts[part as usize];
                if two_way(&exchanges[law.exchange as usize]).is_some() {
                    self.parts.push(GivenPart {
                        face: index as u32,
                        part,
                        exchange: law.exchange,
                        cell: law.cell,
                    });
                }
            }
        }
        self.heat = vec![0.0; self.parts.len()];
    }

    pub(super) fn is_empty(&self) -> bool {
        self.parts.is_empty()
    }

    /// Number of parts of the surface through which other bodies give heat.
    pub(super) fn len(&self) -> usize {
        self.parts.len()
    }

    /// Face and part of each of them.
    pub(super) fn parts(&self) -> impl Iterator<Item = (u32, u32)> {
        self.parts.iter().map(|p| (p.face, p.part))
    }

    /// Adds heat, `factor` times a value for each part.
    pub(super) fn add(&mut self, factor: f64, values: &[f64]) {
        let heat = self.heat.iter_mut().zip(values);
        heat.for_each(|(heat, value)| *heat += factor * value);
    }

    /// Longest step (s) with these conductances of the parts, W/K.
    pub(super) fn longest_step(
        &self,
        exchanges: &[Rc<Exchange>],
        conductances: impl Iterator<Item = f64>,
    ) -> f64 {
        let mut at_points: Vec<Vec<f64>> = vec![Vec::new(); self.sources.len()];
        for (part, conductance) in self.parts.iter().zip(conductances) {
            let exchange = part.exchange as usize;
            let (Some(around), Some(source)) =
                (two_way(&exchanges[exchange]), &self.sources[exchange])
            else {
                continue;
            };
            let at_points = &mut at_points[exchange];
            at_points.resize(source.capacity.len(), 0.0);
            let near = around.near();
            let (points, fractions) = near.of(part.cell as usize);
            for (&point, fraction) in points.iter().zip(fractions) {
                at_points[point as usize] += fraction * conductance;
            }
        }
        // boundaries of one body act together
        let bodies = exchanges.iter().map(|e| two_way(e).map(|a| a.body));
        let bodies: Vec<_> = bodies.collect();
        let mut step = f64::INFINITY;
        for (exchange, source) in self.sources.iter().enumerate() {
            let Some(source) = source else {
                continue;
            };
            let same = |e: &usize| bodies[*e] == bodies[exchange];
            let all: Vec<&[f64]> = (0..bodies.len())
                .filter(same)
                .map(|e| &at_points[e][..])
                .collect();
            for (point, capacity) in source.capacity.iter().enumerate() {
                let of = all.iter().map(|a| a.get(point).copied().unwrap_or(0.0));
                step = step.min(capacity / of.sum::<f64>());
            }
        }
        STEP_FRACTION * step
    }
}
