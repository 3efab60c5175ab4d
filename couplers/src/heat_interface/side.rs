//! The surface of a body that exchanges heat with another one.

use std::mem;
use std::sync::Arc;

use nalgebra::Vector3;
use perimelt_core::body::{NO_POINT, SurfaceCell, SurfacePoints};
use perimelt_core::material::{EnthalpyCurve, Property};
use perimelt_core::solver::reduce::max_abs;
use perimelt_core::{PointRows, Read, Setup, SetupError, World, Write, keys};

use crate::point_materials::PointMaterials;

/// Least distance of a surface from a point, in spacings: with long horizons the outermost points have the temperature of the
/// surface, but the exchange needs a time.
const LEAST_DEPTH: f64 = 0.1;

/// One of the two bodies. Of processes that share it each knows its whole surface.
#[derive(Debug)]
pub(super) struct Side {
    body: usize,
    temperature: Read<f64>,
    pub(super) heat_source: Write<f64>,
    pub(super) heat_conductance: Write<f64>,
    materials: PointMaterials,
    conductivity: Vec<Property>,
    curves: Vec<EnthalpyCurve>,
    pub(super) surface: Arc<SurfacePoints>,
    /// By point of the surface, the point of this process that it is; [`NO_POINT`] where another process owns it.
    pub(super) own: Vec<u32>,
    /// Distance of the surface from the point of each cell, m; empty before the first step.
    depth: Vec<f64>,
    /// Present centres of the cell faces, m.
    pub(super) centre: Vec<Vector3<f64>>,
    /// State of the points of the surface.
    pub(super) points: Vec<SurfacePoint>,
    pub(super) moved: bool,
    rows: PointRows,
}

/// State of a point of a surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct SurfacePoint {
    /// K.
    pub(super) temperature: f64,
    /// W/(m K).
    conductivity: f64,
    /// m.
    position: Vector3<f64>,
}

impl SurfacePoint {
    /// Numbers in a row of a point.
    const ROW: usize = 5;

    fn row(&self) -> [u64; SurfacePoint::ROW] {
        let x = self.position;
        [self.temperature, self.conductivity, x.x, x.y, x.z].map(f64::to_bits)
    }

    fn of(row: &[u64]) -> SurfacePoint {
        let number = |at: usize| f64::from_bits(row[at]);
        SurfacePoint {
            temperature: number(0),
            conductivity: number(1),
            position: Vector3::new(number(2), number(3), number(4)),
        }
    }
}

impl Side {
    pub(super) fn new(setup: &mut Setup<'_>, body: usize) -> Result<Side, SetupError> {
        let surface = setup.world().surface_points(body);
        let reducer = setup.world().reducer(body);
        let mut own = vec![NO_POINT; surface.number.len()];
        for point in 0..reducer.owned() {
            if let Ok(place) = surface.number.binary_search(&reducer.number(point)) {
                own[place] = point as u32;
            }
        }
        let at_start = |position: &Vector3<f64>| SurfacePoint {
            temperature: f64::NAN,
            conductivity: f64::NAN,
            position: *position,
        };
        let mut side = Side {
            body,
            points: surface.position.iter().map(at_start).collect(),
            surface,
            own,
            centre: Vec::new(),
            depth: Vec::new(),
            temperature: setup.read(body, &keys::TEMPERATURE)?,
            heat_source: setup.add(body, &keys::HEAT_SOURCE)?,
            heat_conductance: setup.add(body, &keys::HEAT_CONDUCTANCE)?,
            materials: PointMaterials::prepare(setup, body)?,
            conductivity: setup.world().property(body, "conductivity")?,
            curves: setup.world().enthalpy_curves(body).unwrap_or_default(),
            moved: true,
            rows: PointRows::default(),
        };
        side.find_centres();
        Ok(side)
    }

    pub(super) fn spacing(&self, cell: &SurfaceCell) -> f64 {
        self.surface.width[cell.point as usize][0]
    }

    /// Finds the present centres of the cell faces.
    fn find_centres(&mut self) {
        self.centre.clear();
        for cell in &self.surface.cells {
            let half = 0.5 * self.spacing(cell);
            let position = self.points[cell.point as usize].position;
            self.centre.push(position + half * cell.face.normal());
        }
    }

    /// Cells of points that this process owns, with these points.
    fn own_cells(&self) -> impl Iterator<Item = (usize, usize)> {
        let cells = self.surface.cells.iter().enumerate();
        let cells = cells.map(|(index, cell)| (index, self.own[cell.point as usize]));
        let cells = cells.filter(|(_, point)| *point != NO_POINT);
        cells.map(|(index, point)| (index, point as usize))
    }

    /// Points of the surface that this process owns, ascending.
    fn own_points(&self) -> impl Iterator<Item = usize> {
        let points = self.own.iter().filter(|point| **point != NO_POINT);
        points.map(|point| *point as usize)
    }

    /// Finds the distances of the surface, which the physics of the body has told once all plugins are prepared. Collective.
    pub(super) fn find_depths(&mut self, world: &World) {
        if !self.depth.is_empty() {
            return;
        }
        let (body, depths) = (world.body(self.body), world.surface_depths(self.body));
        let mut of_faces = vec![[f64::INFINITY; 6]; self.own.len()];
        for (index, point) in self.own_cells() {
            let cell = &self.surface.cells[index];
            let place = cell.point as usize;
            let here = SurfaceCell {
                point: point as u32,
                ..*cell
            };
            let depth = depths.at(body, &here).max(LEAST_DEPTH) * body.points.spacing[point];
            of_faces[place][cell.face as usize] = depth;
        }
        world.processes().min_each(of_faces.as_flattened_mut());
        let cells = self.surface.cells.iter();
        let depth = |cell: &SurfaceCell| of_faces[cell.point as usize][cell.face as usize];
        self.depth = cells.map(depth).collect();
    }

    /// Gathers the state of the points of the surface. Collective.
    pub(super) fn gather(&mut self, world: &World) {
        let now = world.configuration(self.body);
        let temperature = world.read(self.temperature);
        let fraction = self.materials.fraction(world);
        let materials = (self.materials).with(world.body(self.body), fraction.as_deref());
        let mut rows = mem::take(&mut self.rows);
        rows.clear();
        for point in self.own_points() {
            let t = temperature[point];
            let conductivity = materials.conductivity(point, |m| {
                let liquid = self.curves.get(m).map_or(0.0, |c| c.liquid_fraction(t));
                self.conductivity[m].at(t, liquid)
            });
            let state = SurfacePoint {
                temperature: t,
                conductivity,
                position: now.positions()[point],
            };
            rows.push(point, &state.row());
        }
        self.rows = world.rows_of_whole(self.body, rows);
        let rows = self.rows.iter(SurfacePoint::ROW);
        for (point, (_, row)) in self.points.iter_mut().zip(rows) {
            let now = SurfacePoint::of(row);
            self.moved |= now.position != point.position;
            *point = now;
        }
        if self.moved {
            self.find_centres();
        }
    }

    /// Resistance from the point of a cell to its face, m² K/W.
    pub(super) fn resistance(&self, cell: u32) -> f64 {
        let point = self.surface.cells[cell as usize].point as usize;
        self.depth[cell as usize] / self.points[point].conductivity
    }

    /// Least resistance from a point to its face, m² K/W. Collective.
    pub(super) fn least_resistance(&self, world: &World) -> f64 {
        let body = world.body(self.body);
        let resistances = self.own_cells().flat_map(|(cell, point)| {
            let materials = self.materials.possible(body, point).into_iter();
            materials.map(move |material| self.least_resistance_of(cell, material))
        });
        let least = resistances.fold(f64::INFINITY, f64::min);
        world.processes().min(least)
    }

    /// Least resistance from the point of a cell to its face if the point is of a material, m² K/W.
    fn least_resistance_of(&self, cell: usize, material: usize) -> f64 {
        self.depth[cell] / max_abs(&self.conductivity[material].values())
    }

    /// Least time constant (s) of a point whose faces are in contact with a body that adds this resistance (m² K/W), whichever
    /// of its possible materials it is of. That of a mixture is not shorter than the shorter one of both fluids. Collective.
    pub(super) fn least_time_constant(&self, world: &World, added: f64) -> f64 {
        let body = world.body(self.body);
        let mut area = vec![0.0; self.own.len()];
        for cell in &self.surface.cells {
            area[cell.point as usize] += cell.area;
        }
        let constants = self.own_cells().flat_map(|(cell, point)| {
            let place = self.surface.cells[cell].point as usize;
            let depth = self.surface.volume[place] / area[place];
            let materials = self.materials.possible(body, point).into_iter();
            materials.map(move |material| {
                let curve = self.curves.get(material);
                let capacity = curve.map_or(f64::INFINITY, EnthalpyCurve::minimum_capacity);
                capacity * depth * (self.least_resistance_of(cell, material) + added)
            })
        });
        let least = constants.fold(f64::INFINITY, f64::min);
        world.processes().min(least)
    }
}
