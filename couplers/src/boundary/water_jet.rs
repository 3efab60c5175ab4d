//! A water jet that moves over a hot surface, and the film that runs off: boiling where the surface is wet, little heat
//! where the film has lifted off.
//!
//! The jet hits the surface between its position and `impingement` further along `flow`. There, the flux follows the
//! boiling curve at any temperature. Behind, the film wets the surface up to the first place hotter than the
//! Leidenfrost temperature; from there on it is lifted off by vapour, and `film_coefficient` holds. Upstream of the jet
//! the surface is dry.
//!
//! ```text
//! q = -flux(T)                              wet
//! q = film_coefficient (T_water - T)        lifted off
//! ```
//!
//! (Aatitya et al. (2021), 2.5. The zone of impingement makes the speed of the front independent of the spacing:
//! docs/theory/quenching.md.) Each row of cells along the flow has a film of its own. A 2D plate is cooled through its
//! plane. On a body that grows, such as a cast ingot, the film covers the present surface.
//!
//! Reports: the power into the body (W), and the areas `film.dry`, `film.wet` and `film.lifted_off` (m²).

use std::collections::BTreeMap;

use nalgebra::Vector3;
use perimelt_core::material::Property;
use perimelt_core::numbers::{check_above, check_at_least, check_finite, check_positive};
use perimelt_core::world::exchange::{SurfaceFlux, SurfaceLaw};
use perimelt_core::{
    Coupler, Face, Prepared, Read, Report, RunError, RunningCoupler, Setup, SetupError, Step,
    World, flattened, keys,
};

use crate::surface::{OnSurface, SurfaceHeat, SurfacePlace};

flattened! {
    /// Heat that a moving water jet and its film take from a surface.
    #[derive(Debug)]
    pub struct WaterJet {
        ..place: OnSurface,
        /// Outward directions of the cooled surface; a 2D body is cooled through its plane when left out.
        #[serde(default)]
        pub faces: Vec<Face>,
        /// Direction in which the water runs off, such as `"x+"`.
        pub flow: Face,
        /// Coordinate along the flow of the upstream edge of the jet at time 0 (m).
        pub start: f64,
        /// Speed of the jet along that axis (m/s), negative towards smaller coordinates.
        #[serde(default)]
        pub speed: f64,
        /// Length of the zone that the jet hits (m).
        #[schemars(extend("exclusiveMinimum" = 0))]
        pub impingement: f64,
        /// Temperature of the water (K).
        #[schemars(extend("exclusiveMinimum" = 0))]
        pub water: f64,
        /// Boiling curve: flux out of the wet surface (W/m²), `{ temperature = [...], value = [...] }` with the temperature of
        /// the surface in K.
        pub flux: Property,
        /// Temperature of the surface above which the film lifts off (K).
        #[schemars(extend("exclusiveMinimum" = 0))]
        pub leidenfrost: f64,
        /// Heat transfer coefficient where the film has lifted off (W/(m² K)).
        #[serde(default = "usual_film_coefficient")]
        #[schemars(extend("minimum" = 0))]
        pub film_coefficient: f64,
    }
}

fn usual_film_coefficient() -> f64 {
    200.0
}

/// The film over a part of the surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Film {
    /// Upstream of the jet.
    Dry,
    Wet,
    LiftedOff,
}

impl Film {
    const ALL: [Film; 3] = [Film::Dry, Film::Wet, Film::LiftedOff];

    fn report_name(self) -> &'static str {
        match self {
            Film::Dry => "film.dry",
            Film::Wet => "film.wet",
            Film::LiftedOff => "film.lifted_off",
        }
    }
}

/// The flux into the surface by the film over it.
#[derive(Debug)]
struct FilmLaw {
    /// Film by cell face.
    film: Vec<Film>,
    /// Boiling curve, W/m² out of the wet surface.
    boiling: Property,
    /// Temperature of the water, K.
    water: f64,
    /// Coefficient where the film is lifted off, W/(m² K).
    film_coefficient: f64,
    /// Largest coefficient of the exchange, W/(m² K).
    largest_coefficient: f64,
}

impl SurfaceLaw for FilmLaw {
    fn is_film(&self) -> bool {
        true
    }

    fn flux(&self, cell: usize, temperature: f64) -> SurfaceFlux {
        match self.film.get(cell) {
            None | Some(Film::Dry) => SurfaceFlux::default(),
            Some(Film::Wet) => {
                let (flux, slope) = self.boiling.with_slope(temperature);
                SurfaceFlux {
                    flux: -flux,
                    slope: -slope,
                }
            }
            Some(Film::LiftedOff) => SurfaceFlux {
                flux: self.film_coefficient * (self.water - temperature),
                slope: -self.film_coefficient,
            },
        }
    }

    fn stiffness(&self, _: f64) -> f64 {
        self.largest_coefficient
    }
}

/// A cell face in a row.
#[derive(Debug)]
struct RowCell {
    /// Index among the cell faces.
    cell: usize,
    point: usize,
    /// Distance along the flow from the origin, m.
    along: f64,
    /// Area, m².
    area: f64,
}

/// A water jet that is ready to act.
struct RunningWaterJet {
    flow: Face,
    /// Coordinate along the flow at time 0, m.
    start: f64,
    /// Speed of the jet, m/s.
    speed: f64,
    /// Length of the zone of impingement, m.
    impingement: f64,
    /// Leidenfrost temperature, K.
    leidenfrost: f64,
    heat: SurfaceHeat<FilmLaw>,
    temperature: Read<f64>,
    /// Row of each point, by its first cell, and distance of the point along the flow from the origin (m).
    place: Vec<([u32; 3], f64)>,
    /// Rows of cell faces, each in the order of the flow.
    rows: Vec<Vec<RowCell>>,
    /// Area of each of [`Film::ALL`], m².
    areas: [f64; 3],
    /// Version of the cell faces in the rows.
    version: u64,
}

impl RunningWaterJet {
    /// Finds the rows of the surface that is bare now.
    fn find_rows(&mut self) {
        let mut rows: BTreeMap<(Face, [u32; 3]), Vec<RowCell>> = BTreeMap::new();
        for (index, cell) in self.heat.cells().iter().enumerate() {
            let (row, along) = self.place[cell.point as usize];
            let row = rows.entry((cell.face, row)).or_default();
            row.push(RowCell {
                cell: index,
                point: cell.point as usize,
                along,
                area: cell.area,
            });
        }
        self.rows = rows.into_values().collect();
        self.version = self.heat.version();
        let rows = self.rows.iter_mut();
        rows.for_each(|row| row.sort_by(|a, b| a.along.total_cmp(&b.along)));
    }
}

impl WaterJet {
    fn check(&self) -> Result<(), SetupError> {
        let fluxes = self.flux.values();
        if self.flux.is_by_phase() || fluxes.iter().any(|q| !(*q >= 0.0 && q.is_finite())) {
            let message = "the flux is negative or given by phase";
            let expected = "a table in temperature, nowhere below 0";
            return Err(SetupError::value("flux", message, expected));
        }
        check_positive("impingement", self.impingement, "m")?;
        check_at_least("film_coefficient", self.film_coefficient, 0.0, "W/(m² K)")?;
        check_positive("water", self.water, "K")?;
        check_above(
            "leidenfrost",
            self.leidenfrost,
            self.water,
            "K, the temperature of the water",
        )?;
        check_finite("start", self.start)?;
        check_finite("speed", self.speed)?;
        Ok(())
    }

    /// Largest coefficient of the exchange, W/(m² K).
    fn largest_coefficient(&self) -> f64 {
        let slopes = match &self.flux {
            Property::Table(table) => {
                let (t, q) = (table.abscissae(), table.values());
                let slopes = t.windows(2).zip(q.windows(2));
                slopes
                    .map(|(t, q)| (q[1] - q[0]) / (t[1] - t[0]))
                    .fold(0.0, f64::max)
            }
            _ => 0.0,
        };
        slopes.max(self.film_coefficient)
    }
}

#[typetag::serialize(name = "water_jet")]
impl Coupler for WaterJet {
    fn prepare(self: Box<Self>, setup: &mut Setup<'_>) -> Prepared<dyn RunningCoupler> {
        self.check()?;
        let body = setup.find_body(self.place.body.as_deref())?;
        let region = self.place.region.as_deref();
        let this = setup.body(body);
        let axis = self.flow.axis();
        if axis >= this.dimension {
            let message = format!(
                "a {}D body has no direction `{}`",
                this.dimension,
                self.flow.name()
            );
            return Err(SetupError::value(
                "flow",
                message,
                "a direction within the body's dimensions",
            ));
        }
        let Some(lattice) = this.lattice() else {
            let message = "the film needs the rows of cells of a lattice";
            return Err(SetupError::value(
                "body",
                message,
                "a body on one regular grid",
            ));
        };
        let place = |(position, cell): (&Vector3<f64>, &[u32; 3])| {
            let mut row = *cell;
            row[axis] = 0;
            let along = position[axis];
            (row, if self.flow.is_upper() { along } else { -along })
        };
        let points = this.points.position.iter().zip(&lattice.cell_of_point);
        let place: Vec<_> = points.map(place).collect();
        let through_plane = self.faces.is_empty() && this.dimension == 2;
        if self.faces.is_empty() && !through_plane {
            let message = "the cooled surface is not given";
            return Err(SetupError::value(
                "faces",
                message,
                "directions such as `faces = [\"z+\"]`",
            ));
        }
        let law = FilmLaw {
            film: Vec::new(),
            largest_coefficient: self.largest_coefficient(),
            boiling: self.flux,
            water: self.water,
            film_coefficient: self.film_coefficient,
        };
        let heat = match through_plane {
            true => SurfaceHeat::through_plane(setup, body, region, law)?,
            false => {
                SurfaceHeat::prepare(setup, body, SurfacePlace::new(&self.faces, region), law)?
            }
        };
        let mut running = RunningWaterJet {
            flow: self.flow,
            start: self.start,
            speed: self.speed,
            impingement: self.impingement,
            leidenfrost: self.leidenfrost,
            heat,
            temperature: setup.read(body, &keys::TEMPERATURE)?,
            rows: Vec::new(),
            areas: [0.0; 3],
            place,
            version: 0,
        };
        running.find_rows();
        Ok(Box::new(running))
    }
}

impl RunningCoupler for RunningWaterJet {
    fn apply(&mut self, world: &World, step: Step) -> Result<(), RunError> {
        self.heat.follow(world);
        if self.version != self.heat.version() {
            self.find_rows();
        }
        let temperature = world.read(self.temperature);
        let jet = self.start + self.speed * step.middle();
        let jet = if self.flow.is_upper() { jet } else { -jet };
        self.areas = [0.0; 3];
        let mut law = self.heat.law();
        let cells = self.heat.cells().len();
        law.film.resize(cells, Film::Dry);
        for row in &self.rows {
            let mut lifted = false;
            for part in row {
                let behind = part.along - jet;
                lifted |= behind > self.impingement && temperature[part.point] > self.leidenfrost;
                let film = match (behind >= 0.0, lifted) {
                    (false, _) => Film::Dry,
                    (true, false) => Film::Wet,
                    (true, true) => Film::LiftedOff,
                };
                self.areas[film as usize] += part.area;
                law.film[part.cell] = film;
            }
        }
        Ok(())
    }

    fn report(&self) -> Vec<Report> {
        let area = |(film, value): (Film, f64)| Report::new(film.report_name(), "m2", value);
        let areas = Film::ALL.into_iter().zip(self.areas).map(area);
        self.heat.report().into_iter().chain(areas).collect()
    }
}

perimelt_core::register_coupler!("water_jet", WaterJet, supports: [Flow, Births, Cuts]);

#[cfg(test)]
mod tests;
