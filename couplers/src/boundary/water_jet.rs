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

use std::mem;

use nalgebra::Vector3;
use perimelt_core::body::SurfaceCell;
use perimelt_core::material::Property;
use perimelt_core::numbers::{check_above, check_at_least, check_finite, check_positive};
use perimelt_core::solver::ExactSum;
use perimelt_core::world::BodyIndex;
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

/// A water jet that is ready to act.
struct RunningWaterJet {
    body: BodyIndex,
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
    /// Row of each point, and distance of the point along the flow from the origin (m).
    place: Vec<(u32, f64)>,
    /// Number of rows that a face has at most.
    rows_of_face: usize,
    /// Where the film has lifted off in each row, m along the flow; infinite where it has not.
    lifted: Vec<f64>,
    /// Area of each of [`Film::ALL`], m².
    areas: [f64; 3],
}

impl RunningWaterJet {
    /// Number of the row of a cell face, the same in all processes, and distance of its point along the flow (m).
    fn place(&self, cell: &SurfaceCell) -> (usize, f64) {
        let (row, along) = self.place[cell.point as usize];
        (cell.face as usize * self.rows_of_face + row as usize, along)
    }
}

impl WaterJet {
    fn check(&self, dimension: usize) -> Result<(), SetupError> {
        if self.flow.axis() >= dimension {
            let message = format!(
                "a {dimension}D body has no direction `{}`",
                self.flow.name()
            );
            let expected = "a direction within the body's dimensions";
            return Err(SetupError::value("flow", message, expected));
        }
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
        let body = setup.find_body(self.place.body.as_deref())?;
        self.check(setup.body(body).dimension)?;
        let region = self.place.region.as_deref();
        let this = setup.body(body);
        let axis = self.flow.axis();
        let Some(lattice) = this.lattice() else {
            let message = "the film needs the rows of cells of a lattice";
            return Err(SetupError::value(
                "body",
                message,
                "a body on one regular grid",
            ));
        };
        let across = [0, 1, 2].map(|a| {
            if a == axis {
                1
            } else {
                lattice.cells[a] as u32
            }
        });
        let place = |(position, cell): (Vector3<f64>, [u32; 3])| {
            let [i, j, k] = [0, 1, 2].map(|a| if a == axis { 0 } else { cell[a] });
            let row = (k * across[1] + j) * across[0] + i;
            let along = position[axis];
            (row, if self.flow.is_upper() { along } else { -along })
        };
        let points = this.points.position.each().zip(lattice.cells_of_points());
        let place: Vec<_> = points.map(place).collect();
        let rows_of_face = across.iter().product::<u32>() as usize;
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
        Ok(Box::new(RunningWaterJet {
            body,
            flow: self.flow,
            start: self.start,
            speed: self.speed,
            impingement: self.impingement,
            leidenfrost: self.leidenfrost,
            heat,
            temperature: setup.read(body, &keys::TEMPERATURE)?,
            lifted: vec![f64::INFINITY; Face::ALL.len() * rows_of_face],
            areas: [0.0; 3],
            place,
            rows_of_face,
        }))
    }
}

impl RunningCoupler for RunningWaterJet {
    fn apply(&mut self, world: &World, step: Step) -> Result<(), RunError> {
        self.heat.follow(world);
        let temperature = world.read(self.temperature);
        let jet = self.start + self.speed * step.middle();
        let jet = if self.flow.is_upper() { jet } else { -jet };
        let reducer = world.reducer(self.body);
        let is_own = |cell: &SurfaceCell| (cell.point as usize) < reducer.owned();
        let cells = self.heat.cells();
        let mut lifted = mem::take(&mut self.lifted);
        lifted.fill(f64::INFINITY);
        for cell in cells.iter().filter(|cell| is_own(cell)) {
            let (row, along) = self.place(cell);
            let is_behind = along - jet > self.impingement;
            if is_behind && temperature[cell.point as usize] > self.leidenfrost {
                lifted[row] = f64::min(lifted[row], along);
            }
        }
        // a row may lie in several processes
        reducer.processes().min_each(&mut lifted);
        let mut areas = [(); 3].map(|()| ExactSum::default());
        let mut law = self.heat.law();
        law.film.clear();
        for cell in cells.iter() {
            let (row, along) = self.place(cell);
            let film = match (along >= jet, along >= lifted[row]) {
                (false, _) => Film::Dry,
                (true, false) => Film::Wet,
                (true, true) => Film::LiftedOff,
            };
            if is_own(cell) {
                areas[film as usize].add(cell.area);
            }
            law.film.push(film);
        }
        drop((cells, law));
        self.lifted = lifted;
        self.areas = areas.map(|area| reducer.total(area));
        Ok(())
    }

    fn report(&self) -> Vec<Report> {
        let area = |(film, value): (Film, f64)| Report::new(film.report_name(), "m2", value);
        let areas = Film::ALL.into_iter().zip(self.areas).map(area);
        self.heat.report().into_iter().chain(areas).collect()
    }
}

perimelt_core::register_coupler!("water_jet", WaterJet, supports: [Flow, Births, Cuts, Division]);

#[cfg(test)]
mod tests;
