//! Heat that the surface of a body exchanges by the laws of its boundaries.
//!
//! A boundary gives the flux q(T_s) into the body at the temperature T_s of the surface, which lies half a cell from its
//! points. Both fluxes are equal there, that of the boundaries and that through the half cell:
//!
//! ```text
//! sum_l q_l(T_s) = k (T_s - T) / d,     d = delta s
//! ```
//!
//! with the temperature T and the conductivity k of the point and the spacing s. All boundaries that act on a cell face share
//! its temperature. For bonds between nearest neighbours delta is a half; longer bonds, and those corrected at bare surfaces, shift the
//! temperature of the outermost points, which [`depths`](super::surface_depth::depths) find from the family. Plies conduct by the
//! conductivity along the normal, over the distance of their stations from the upper and the lower side.

use std::rc::Rc;

use perimelt_core::body::{Sizes, SurfaceCell};
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::solver::{ExactSum, Reducer};
use perimelt_core::world::exchange::{Exchange, SurfaceDepth, SurfaceLaw};
use perimelt_core::world::{BodyIndex, SurfaceDepths};
use perimelt_core::{Body, FamilyHandle, Setup, SetupError};
use rayon::prelude::*;

use super::conduction::Conduction;
use super::given::GivenHeat;
use super::points::ConductingPoints;
use super::surface_depth;

/// Largest number of iterations for the temperature of a surface.
const ITERATIONS: usize = 30;

/// Relative change of the temperature of a surface below which the next one would be of the order of rounding: Newton's method
/// converges quadratically.
const CONVERGED: f64 = 1e-7;

/// The exchanges of a body, by cell face.
#[derive(Debug)]
pub(super) struct Surface {
    pub(super) exchanges: Vec<Rc<Exchange>>,
    /// Versions of their cell faces that `faces` includes.
    versions: Vec<Option<u64>>,
    distances: SurfaceDistances,
    /// Faces in the order of their points.
    pub(super) faces: Vec<ExposedFace>,
    /// Laws of all faces, face by face.
    pub(super) parts: Vec<FaceLaw>,
    /// Flux through each face as last evaluated.
    pub(super) fluxes: Vec<SurfaceFlux>,
    /// Heat that the surroundings give which are bodies.
    pub(super) given: GivenHeat,
    is_linear: bool,
    /// How often the faces have changed.
    pub(super) changes: u64,
}

/// Distances of the surface from its points.
#[derive(Debug)]
pub(super) enum SurfaceDistances {
    /// Those that follow from the bonds.
    Bonds(SurfaceDepths),
    /// By layer and material, those of edges across x and y, in spacings; the others are those of the stations.
    Layers(Vec<Vec<[f64; 2]>>),
}

/// Prepares the exchanges of a body whose heat `conduction` conducts. `has_conductance`: other bodies exchange heat through the surface.
/// `edges` are those of [`SurfaceDistances::Layers`].
pub(super) fn prepare(
    setup: &mut Setup<'_>,
    body: BodyIndex,
    family: FamilyHandle,
    conduction: &Conduction,
    has_conductance: bool,
    edges: Option<Vec<Vec<[f64; 2]>>>,
) -> Result<Option<Surface>, SetupError> {
    let exchanges: Vec<Rc<Exchange>> = setup.facts(body).cloned().collect();
    let is_exchanged = !exchanges.is_empty() || has_conductance;
    let depth = match is_exchanged && conduction.is_by_bonds() && edges.is_none() {
        false => SurfaceDepths::default(),
        true => {
            let family = setup.world().family(family);
            surface_depth::depths(setup.body(body), &family)
        }
    };
    setup.publish(body, depth)?;
    let distances = match edges {
        Some(edges) => SurfaceDistances::Layers(edges),
        None => SurfaceDistances::Bonds(depth),
    };
    Surface::new(exchanges, distances)
        .map(|surface| surface.with_surroundings(setup))
        .transpose()
}

impl SurfaceDistances {
    /// Of a cell face of a point, m.
    fn of(&self, body: &Body, cell: &SurfaceCell) -> f64 {
        let (point, axis) = (cell.point as usize, cell.face.axis());
        let spacings = match (self, body.layers()) {
            (SurfaceDistances::Bonds(depths), _) => depths.at(body, cell),
            (SurfaceDistances::Layers(edges), Some(layers)) if axis < 2 => {
                let material = body.material_of_point[point] as usize;
                edges[layers.place(point).0][material][axis] * cell.cosine()
            }
            (SurfaceDistances::Layers(_), _) => return body.face_distance(point, cell.face),
        };
        spacings * body.points.spacing[point]
    }
}

/// A cell face through which heat flows.
#[derive(Clone, Copy, Debug)]
pub(super) struct ExposedFace {
    pub(super) point: u32,
    /// Axis of its normal.
    pub(super) axis: u8,
    /// Distance of the surface from the point, m.
    pub(super) depth: f64,
    /// Area over the volume of the point, 1/m.
    pub(super) area_over_volume: f64,
    /// First and last index (exclusive) of the laws that act on the face.
    pub(super) parts: [u32; 2],
}

impl ExposedFace {
    /// Laws that act on the face.
    fn parts<'a>(&self, all: &'a [FaceLaw]) -> &'a [FaceLaw] {
        &all[self.parts[0] as usize..self.parts[1] as usize]
    }
}

/// A law that acts on a face.
#[derive(Clone, Copy, Debug)]
pub(super) struct FaceLaw {
    pub(super) exchange: u32,
    /// Index of the face in the cells of the exchange.
    pub(super) cell: u32,
    /// Fraction of the area of the face.
    pub(super) fraction: f64,
    /// Area, m².
    area: f64,
}

/// A flux (W/m²) and its derivative by the temperature of the point (W/(m² K)).
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SurfaceFlux {
    flux: f64,
    gain: f64,
    /// Temperature of the surface, K.
    temperature: f64,
    /// Temperature at which the laws were last asked, K, and the change from there, with which the flux is linear.
    pub(super) asked: f64,
    pub(super) change: f64,
    /// Derivative of the temperature of the surface by that of the point, without the slopes of the laws: the gain of a law is its slope
    /// times this.
    pub(super) transfer: f64,
}

impl Surface {
    /// The exchanges of a body; `None` without any.
    pub(super) fn new(
        exchanges: Vec<Rc<Exchange>>,
        distances: SurfaceDistances,
    ) -> Option<Surface> {
        let is_there = !exchanges.is_empty();
        is_there.then(|| Surface {
            versions: vec![None; exchanges.len()],
            is_linear: exchanges.iter().all(|e| e.law().is_linear()),
            exchanges,
            distances,
            faces: Vec::new(),
            parts: Vec::new(),
            fluxes: Vec::new(),
            given: GivenHeat::default(),
            changes: 0,
        })
    }

    /// How often the faces have changed.
    pub(super) fn changes(&self) -> u64 {
        self.changes
    }

    /// Whether all fluxes are linear in the temperature of the surface.
    pub(super) fn is_linear(&self) -> bool {
        self.is_linear
    }

    /// Whether the flux of an exchange depends on the temperature, unlike prescribed fluxes.
    pub(super) fn has_conductance(&self) -> bool {
        let stiffness = |e: &Rc<Exchange>| e.law().stiffness(1000.0);
        self.exchanges.iter().any(|e| stiffness(e) > 0.0)
    }

    /// Rebuilds the faces when cell faces changed; `has_material` tells which points of a growing body exist.
    pub(super) fn follow(&mut self, body: &Body, has_material: impl Fn(usize) -> bool) {
        let now = self.exchanges.iter().map(|e| Some(e.version()));
        if now.clone().eq(self.versions.iter().copied()) {
            return;
        }
        self.versions = now.collect();
        self.changes += 1;
        let mut all: Vec<(SurfaceCell, SurfaceDepth, FaceLaw)> = Vec::new();
        for (index, exchange) in self.exchanges.iter().enumerate() {
            let cells = exchange.cells();
            let here = cells.iter().enumerate();
            all.extend(
                here.filter(|(_, c)| has_material(c.point as usize))
                    .map(|(i, c)| {
                        let part = FaceLaw {
                            exchange: index as u32,
                            cell: i as u32,
                            fraction: 1.0,
                            area: c.area,
                        };
                        (*c, exchange.depth, part)
                    }),
            );
        }
        let place = |(cell, depth, _): &(SurfaceCell, _, _)| {
            (cell.point, *depth == SurfaceDepth::Plane, cell.face)
        };
        all.sort_by_key(|part| (place(part), part.2.exchange));
        (self.faces, self.parts) = (Vec::new(), Vec::new());
        for same in all.chunk_by(|a, b| place(a) == place(b)) {
            let (cell, depth, _) = &same[0];
            let area = same.iter().map(|s| s.2.area).fold(0.0, f64::max);
            if area == 0.0 {
                continue;
            }
            let first = self.parts.len() as u32;
            self.parts.extend(same.iter().map(|s| FaceLaw {
                fraction: s.2.area / area,
                ..s.2
            }));
            let depth = match depth {
                SurfaceDepth::Face => self.distances.of(body, cell),
                SurfaceDepth::Plane => 0.0,
            };
            self.faces.push(ExposedFace {
                point: cell.point,
                axis: cell.face.axis() as u8,
                depth,
                area_over_volume: area / body.points.volume[cell.point as usize],
                parts: [first, self.parts.len() as u32],
            });
        }
        self.fluxes = vec![SurfaceFlux::default(); self.faces.len()];
        self.given.find(&self.faces, &self.parts, &self.exchanges);
    }

    /// Evaluates the heat through all faces.
    pub(super) fn evaluate(&mut self, points: &ConductingPoints<'_>) {
        let borrowed: Vec<_> = self.exchanges.iter().map(|e| e.law()).collect();
        let laws: Vec<&dyn SurfaceLaw> = borrowed.iter().map(|law| &**law).collect();
        let (parts, is_linear) = (&self.parts[..], self.is_linear);
        let faces = self.fluxes.par_iter_mut().zip(&self.faces);
        faces.with_min_len(512).for_all(|(flux, face)| {
            let half = HalfCell::of(face, points);
            *flux = balance(face.parts(parts), &laws, is_linear, &half);
        });
    }

    /// Adds the heat of the last evaluation to the rates of the points (W/m³), and its power (W) at the first `owned` ones to `power`.
    pub(super) fn add(
        &self,
        rate: &mut [[f64; 1]],
        volume: &Sizes,
        owned: usize,
        power: &mut ExactSum,
    ) {
        let faces = self.faces.iter().zip(&self.fluxes);
        let heats = faces.map(|(face, through)| face.area_over_volume * through.flux);
        self.add_heats(heats, rate, volume, owned, power);
    }

    /// Adds a heat of each face (W/m³), and its power.
    fn add_heats(
        &self,
        heats: impl Iterator<Item = f64>,
        rate: &mut [[f64; 1]],
        volume: &Sizes,
        owned: usize,
        power: &mut ExactSum,
    ) {
        for (face, heat) in self.faces.iter().zip(heats) {
            let point = face.point as usize;
            rate[point][0] += heat;
            if point < owned {
                power.add(heat * volume[point]);
            }
        }
    }

    /// The derivatives of the heat through the faces by the temperatures of their points when last evaluated, W/(m³ K), then
    /// those of the heat that other bodies give.
    pub(super) fn gains(&self, gains: &mut Vec<f64>) {
        gains.clear();
        let faces = self.faces.iter().zip(&self.fluxes);
        gains.extend(faces.map(|(face, through)| face.area_over_volume * through.gain));
        gains.extend(self.given_rates(|law, through| through.transfer * law.slope));
    }

    /// Adds the change of the heat for a `change` of the temperatures (K) to the rates, and that of the power to `power`, as [`Surface::add`].
    pub(super) fn add_change(
        &self,
        [gains, change]: [&[f64]; 2],
        rate: &mut [[f64; 1]],
        volume: &Sizes,
        owned: usize,
        power: &mut ExactSum,
    ) {
        let faces = self.faces.iter().zip(gains);
        let heats = faces.map(|(face, gain)| gain * change[face.point as usize]);
        self.add_heats(heats, rate, volume, owned, power);
    }

    /// Subtracts the gains of the last evaluation, over a capacity, from the diagonal of a tangent.
    pub(super) fn add_diagonal(&self, diagonal: &mut [f64], capacity: impl Fn(usize) -> f64) {
        for (face, through) in self.faces.iter().zip(&self.fluxes) {
            let point = face.point as usize;
            let gain = face.area_over_volume * through.gain;
            diagonal[point] += gain.min(0.0) / capacity(point);
        }
    }

    /// Passes the power of each exchange and the temperatures of the surface to the exchange.
    pub(super) fn report(&self, points: &ConductingPoints<'_>, reducer: &Reducer) {
        let mut power = vec![ExactSum::default(); self.exchanges.len()];
        let cells = self
            .exchanges
            .iter()
            .map(|e| vec![f64::NAN; e.cells().len()]);
        let mut temperatures: Vec<Vec<f64>> = cells.collect();
        {
            let borrowed: Vec<_> = self.exchanges.iter().map(|e| e.law()).collect();
            let laws: Vec<&dyn SurfaceLaw> = borrowed.iter().map(|law| &**law).collect();
            for face in &self.faces {
                let parts = face.parts(&self.parts);
                let half = HalfCell::of(face, points);
                let surface = balance(parts, &laws, self.is_linear, &half).temperature;
                for part in parts {
                    let (exchange, cell) = (part.exchange as usize, part.cell as usize);
                    let flux = laws[exchange].flux(cell, surface).flux;
                    if (face.point as usize) < reducer.owned() {
                        power[exchange].add(flux * part.area);
                    }
                    temperatures[exchange][cell] = surface;
                }
            }
        }
        let observed = power.into_iter().zip(temperatures);
        for (exchange, (power, temperatures)) in self.exchanges.iter().zip(observed) {
            exchange.set_observed(reducer.total(power), temperatures);
        }
    }

    /// Bound of the temperatures of the points at the surface and of their surroundings, K, in steps of two per cent, so that it
    /// rarely changes.
    pub(super) fn hottest(&self, temperature: &[f64], reducer: &Reducer) -> f64 {
        const STEP: f64 = 1.02;
        let own = |face: &&ExposedFace| (face.point as usize) < reducer.owned();
        let faces = self.faces.iter().filter(own);
        let faces = faces.map(|f| temperature[f.point as usize]);
        let around = self.exchanges.iter().map(|e| e.law().surroundings());
        let hottest = reducer.max(faces.chain(around).fold(1.0, f64::max));
        STEP.powf((hottest.ln() / STEP.ln()).ceil())
    }

    /// Calls `visit` with each point at the surface and a bound of the conductance to the surroundings over its volume
    /// (W/(m³ K)) while no point is warmer than `hottest` (K), from the largest conductivity of a point along an axis, W/(m K).
    pub(super) fn visit_stiffness(
        &self,
        hottest: f64,
        conductivity: impl Fn(usize, usize) -> f64,
        mut visit: impl FnMut(usize, f64),
    ) {
        let laws = self.exchanges.iter().map(|e| e.law().stiffness(hottest));
        let laws: Vec<f64> = laws.collect();
        for faces in self.faces.chunk_by(|a, b| a.point == b.point) {
            let point = faces[0].point as usize;
            let mut at_point = 0.0;
            for face in faces {
                let parts = face.parts(&self.parts);
                let coefficient = |p: &FaceLaw| p.fraction * laws[p.exchange as usize];
                let coefficient: f64 = parts.iter().map(coefficient).sum();
                if coefficient > 0.0 {
                    let conductivity = conductivity(point, face.axis as usize);
                    let resistance = 1.0 / coefficient + face.depth / conductivity;
                    at_point += face.area_over_volume / resistance;
                }
            }
            visit(point, at_point);
        }
    }
}

/// The half cell between a point and its face.
struct HalfCell<'a> {
    points: &'a ConductingPoints<'a>,
    point: usize,
    /// Of the normal of the face.
    axis: usize,
    /// Distance of the surface, m; zero where the point is at the surface.
    depth: f64,
}

impl<'a> HalfCell<'a> {
    fn of(face: &ExposedFace, points: &'a ConductingPoints<'_>) -> HalfCell<'a> {
        HalfCell {
            points,
            point: face.point as usize,
            axis: face.axis as usize,
            depth: face.depth,
        }
    }

    /// Liquidus (K) and conductance of the melt (W/(m² K)) of a half cell whose surface is warmer than its liquidus.
    fn melt(&self, surface: f64) -> Option<(f64, f64)> {
        let own = self.points.temperature[self.point];
        let melt = || self.points.melt(self.point, self.axis);
        let (liquidus, conductivity) = (surface > own).then(melt).flatten()?;
        (surface > liquidus).then(|| (liquidus, conductivity / self.depth))
    }
}

/// The flux through a face in series with the half cell below it. Where the surface melts and the point does not, the part above
/// the liquidus conducts as melt; otherwise the temperature of a loose powder under a strong flux would be unbounded.
fn balance(
    parts: &[FaceLaw],
    laws: &[&dyn SurfaceLaw],
    is_linear: bool,
    half: &HalfCell<'_>,
) -> SurfaceFlux {
    let at = |temperature: f64| {
        let mut sum = (0.0, 0.0);
        for part in parts {
            let law = laws[part.exchange as usize].flux(part.cell as usize, temperature);
            sum.0 += part.fraction * law.flux;
            sum.1 += part.fraction * law.slope;
        }
        sum
    };
    let own = half.points.temperature[half.point];
    let mut temperature = own;
    if half.depth == 0.0 {
        let (flux, gain) = at(own);
        return SurfaceFlux {
            flux,
            gain,
            temperature,
            asked: own,
            change: 0.0,
            transfer: 1.0,
        };
    }
    let mut conductance = half.points.conductivity_along(half.point, half.axis) / half.depth;
    // temperature of the point if the whole half cell were melt, and its derivative by the temperature of the point
    let (mut base, mut base_slope) = (own, 1.0);
    let mut is_melt = false;
    let mut through = SurfaceFlux::default();
    for _ in 0..ITERATIONS {
        let (flux, slope) = at(temperature);
        let surplus = flux + conductance * (base - temperature);
        // a boiling curve may rise faster than the half cell conducts
        let stiffness = conductance - slope.min(0.5 * conductance);
        let change = surplus / stiffness;
        let asked = temperature;
        temperature += change;
        if !is_melt && let Some((liquidus, melt_conductance)) = half.melt(temperature) {
            temperature = liquidus;
            is_melt = at(liquidus).0 > conductance * (liquidus - own);
            if is_melt {
                base_slope = conductance / melt_conductance;
                base = liquidus - base_slope * (liquidus - own);
                conductance = melt_conductance;
            }
            continue;
        }
        through = SurfaceFlux {
            flux: flux + slope * change,
            gain: base_slope * conductance * slope / stiffness,
            temperature,
            asked,
            change,
            transfer: base_slope * conductance / stiffness,
        };
        if is_linear || change.abs() <= CONVERGED * temperature.abs() {
            break;
        }
    }
    through
}
