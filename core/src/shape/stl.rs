//! Shapes from STL files: closed surfaces of triangles.
//!
//! A position is inside where the surface winds around it. The winding number is the sum over the triangles in front of the
//! position along x: +1 for one that is left through, -1 for one that is entered. Edges are counted by a half-open rule and
//! turns are computed from the vertex with the smaller number, so that two triangles with a common edge agree bit by bit,
//! also for a ray through the edge. Overlapping parts are united; voids have their normals inwards.

mod defects;
mod facing;
mod mesh;
mod reader;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use nalgebra::{Vector2, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use self::mesh::Mesh;
use super::{Bounds, distance_from_segment};
use crate::input::{self, InputError};

pub use self::defects::Defects;
pub use self::reader::{Format, FormatError};

/// The solids in an STL file, text or binary. Their surfaces must be closed, but for corners that differ by less than
/// `tolerance`. Normals in the file are not used: a surface has its corners counterclockwise when seen from outside.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Stl {
    /// The file, relative to the case file.
    pub file: PathBuf,
    /// Length of the unit of the file, m: 0.001 for a file in millimetres.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub scale: f64,
    /// Where the origin of the file lies, m; default the origin.
    #[serde(default)]
    pub origin: [f64; 3],
    /// Largest distance of corners that are joined where the surface is open, m; default 1e-6 of the extent of the file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tolerance: Option<f64>,
    #[serde(skip)]
    #[schemars(skip)]
    surface: Option<Arc<Surface>>,
}

/// Why an STL file is no solid.
#[derive(Debug, thiserror::Error)]
pub enum StlError {
    /// The file cannot be read.
    #[error("cannot read {path}: {source}", path = .path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: InputError,
    },
    /// The file contains no triangles that can be read.
    #[error("cannot read {path}: {source}", path = .path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// What is wrong, and where.
        source: FormatError,
    },
    /// A surface with gaps, flipped or repeated triangles.
    #[error(
        "the surface in {path} ({format}, {triangles} triangles) is not closed: {defects}; repair the mesh in the program \
         that wrote it",
        path = .path.display(), format = .defects.format
    )]
    Open {
        /// The file.
        path: PathBuf,
        /// Triangles in the file that are no lines.
        triangles: usize,
        /// What is wrong, and where.
        defects: Defects,
    },
    /// A surface that encloses nothing.
    #[error("the surface in {path} encloses no volume", path = .0.display())]
    NoVolume(PathBuf),
}

impl Stl {
    /// A solid in a file that has not been read yet (`Stl::load`).
    pub fn new(file: impl Into<PathBuf>, scale: f64) -> Stl {
        Stl {
            file: file.into(),
            scale,
            origin: [0.0; 3],
            tolerance: None,
            surface: None,
        }
    }

    /// Reads the file, whose path starts from `folder`. A scale or an origin that cannot be are left to
    /// [`mistake`](Self::mistake).
    pub(super) fn load(&mut self, folder: &Path) -> Result<(), StlError> {
        if self.wrong_number().is_some() {
            return Ok(());
        }
        let surface = self.read(&folder.join(&self.file))?;
        self.surface = Some(Arc::new(surface));
        Ok(())
    }

    pub(super) fn contains(&self, position: &Vector3<f64>, tolerance: f64) -> bool {
        let surface = self.surface.as_ref();
        surface.is_some_and(|surface| surface.contains(position, tolerance))
    }

    pub(super) fn bounds(&self) -> Option<Bounds> {
        self.surface.as_ref().map(|surface| surface.bounds)
    }

    /// Volume (m³) by the triangles; `None` where parts may overlap, or before the file has been read.
    pub(super) fn volume(&self) -> Option<f64> {
        let surface = self.surface.as_ref()?;
        let volume = surface.enclosed_volume().abs();
        (!surface.may_overlap()).then_some(volume)
    }

    fn wrong_number(&self) -> Option<String> {
        if !(self.scale > 0.0 && self.scale.is_finite()) {
            return Some(format!(
                "the scale {} is not positive and finite",
                self.scale
            ));
        }
        if let Some(tolerance) = self.tolerance.filter(|t| !(*t > 0.0 && t.is_finite())) {
            return Some(format!(
                "the tolerance {tolerance} is not positive and finite"
            ));
        }
        let coordinate = self.origin.iter().find(|c| !c.is_finite())?;
        Some(format!("the origin has the coordinate {coordinate}"))
    }

    pub(super) fn mistake(&self) -> Option<String> {
        let unread = || format!("{} has not been read", self.file.display());
        let missing = self.surface.is_none().then(unread);
        self.wrong_number().or(missing)
    }
}

/// A closed surface.
#[derive(Debug)]
struct Surface {
    /// m.
    vertices: Vec<Vector3<f64>>,
    triangles: Vec<[u32; 3]>,
    bounds: Bounds,
    columns: Columns,
}

/// Triangles by cells of a grid over y and z.
#[derive(Debug)]
struct Columns {
    /// Cells along y and z.
    count: [usize; 2],
    /// Size of a cell, m.
    size: [f64; 2],
    /// Where the triangles of each cell start in `triangles`.
    starts: Vec<u32>,
    triangles: Vec<u32>,
}

/// Default tolerance as a fraction of the extent: six digits, as many programs write.
const TOLERANCE: f64 = 1e-6;

impl Stl {
    fn read(&self, path: &Path) -> Result<Surface, StlError> {
        let told = |source| StlError::Read {
            path: path.into(),
            source,
        };
        let bytes = input::read_bytes(path, input::LIMIT).map_err(told)?;
        let (mut mesh, format) = reader::read(&bytes).map_err(|source| StlError::Format {
            path: path.into(),
            source,
        })?;
        drop(bytes);
        let tolerance = self.tolerance.map(|tolerance| tolerance / self.scale);
        let triangles = mesh.triangles.len();
        if !mesh
            .close(tolerance.unwrap_or_else(|| default_tolerance(&mesh)))
            .is_empty()
        {
            return Err(StlError::Open {
                path: path.into(),
                triangles,
                defects: Defects::of(mesh, format),
            });
        }
        let place = |corner: Vector3<f64>| corner * self.scale + Vector3::from(self.origin);
        let surface = Surface::new(mesh.without_unused_corners(), place);
        surface.ok_or_else(|| StlError::NoVolume(path.into()))
    }
}

/// In units of the file; not below the rounding of single precision, which is large far away from the origin.
fn default_tolerance(mesh: &Mesh) -> f64 {
    let Some((low, high)) = bounds(&mesh.corners) else {
        return TOLERANCE;
    };
    let rounding = 2.0 * f64::from(f32::EPSILON) * low.amax().max(high.amax());
    (TOLERANCE * (high - low).norm()).max(rounding)
}

fn bounds(vertices: &[Vector3<f64>]) -> Option<Bounds> {
    let boxes = vertices.iter().map(|v| (*v, *v));
    boxes.reduce(|a, b| (a.0.inf(&b.0), a.1.sup(&b.1)))
}

impl Surface {
    /// The surface of a closed mesh, with the positions (m) of its corners; `None` if it encloses nothing.
    fn new(mesh: Mesh, place: impl Fn(Vector3<f64>) -> Vector3<f64>) -> Option<Surface> {
        let vertices: Vec<_> = mesh.corners.into_iter().map(place).collect();
        let triangles = mesh.triangles;
        let bounds = bounds(&vertices)?;
        let columns = Columns::new(&vertices, &triangles, bounds);
        let surface = Surface {
            vertices,
            triangles,
            bounds,
            columns,
        };
        let extent = (bounds.1 - bounds.0).norm();
        // rounding of the sum
        let has_volume = surface.enclosed_volume().abs() > 1e-12 * extent.powi(3);
        has_volume.then_some(surface)
    }

    /// Whether the boxes around two connected parts of the surface overlap.
    fn may_overlap(&self) -> bool {
        let mut part: Vec<u32> = (0..self.vertices.len() as u32).collect();
        for [a, b, c] in &self.triangles {
            for other in [b, c] {
                let (a, b) = (mesh::root(&mut part, *a), mesh::root(&mut part, *other));
                part[a.max(b) as usize] = a.min(b);
            }
        }
        let mut boxes: BTreeMap<u32, Bounds> = BTreeMap::new();
        for (index, vertex) in self.vertices.iter().enumerate() {
            let part = mesh::root(&mut part, index as u32);
            let around = boxes.entry(part).or_insert((*vertex, *vertex));
            *around = (around.0.inf(vertex), around.1.sup(vertex));
        }
        let boxes: Vec<Bounds> = boxes.into_values().collect();
        // many parts are not compared in pairs
        const PARTS: usize = 1000;
        let overlap = |a: &Bounds, b: &Bounds| (0..3).all(|i| a.0[i] < b.1[i] && b.0[i] < a.1[i]);
        let mut with_others = boxes.iter().enumerate();
        boxes.len() > PARTS
            || with_others.any(|(index, a)| boxes[..index].iter().any(|b| overlap(a, b)))
    }

    /// The integral of the winding number, m³: the volume if no parts overlap.
    fn enclosed_volume(&self) -> f64 {
        let of_triangle = |triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(|v| self.vertices[v as usize] - self.bounds.0);
            a.dot(&b.cross(&c)) / 6.0
        };
        self.triangles.iter().map(of_triangle).sum()
    }
}

impl Columns {
    fn new(vertices: &[Vector3<f64>], triangles: &[[u32; 3]], bounds: Bounds) -> Columns {
        let (low, high) = bounds;
        let extent = [high.y - low.y, high.z - low.z];
        // about one cell for each triangle, of equal sides
        let edge = (extent[0] * extent[1] / triangles.len() as f64).sqrt();
        let cells = |extent: f64| ((extent / edge).ceil()).clamp(1.0, 2048.0) as usize;
        let count = extent.map(cells);
        let mut columns = Columns {
            count,
            size: [0, 1].map(|a| extent[a] / count[a] as f64),
            starts: vec![0; count[0] * count[1] + 1],
            triangles: Vec::new(),
        };
        let ranges: Vec<[[usize; 2]; 2]> = triangles
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|v| vertices[v as usize] - low);
                let (min, max) = (a.inf(&b).inf(&c), a.sup(&b).sup(&c));
                columns.range([min.y, min.z], [max.y, max.z])
            })
            .collect();
        for range in &ranges {
            for cell in columns.cells(*range) {
                columns.starts[cell + 1] += 1;
            }
        }
        for cell in 1..columns.starts.len() {
            columns.starts[cell] += columns.starts[cell - 1];
        }
        let mut next = columns.starts.clone();
        let mut listed = vec![0; next.last().map_or(0, |total| *total as usize)];
        for (triangle, range) in ranges.iter().enumerate() {
            for cell in columns.cells(*range) {
                listed[next[cell] as usize] = triangle as u32;
                next[cell] += 1;
            }
        }
        columns.triangles = listed;
        columns
    }

    /// First and last cell along each axis of a rectangle relative to the lower corner, m.
    fn range(&self, min: [f64; 2], max: [f64; 2]) -> [[usize; 2]; 2] {
        let cell =
            |at: f64, a: usize| ((at / self.size[a]).max(0.0) as usize).min(self.count[a] - 1);
        [0, 1].map(|a| [cell(min[a], a), cell(max[a], a)])
    }

    fn cells(&self, [y, z]: [[usize; 2]; 2]) -> impl Iterator<Item = usize> + use<> {
        let width = self.count[0];
        (z[0]..=z[1]).flat_map(move |z| (y[0]..=y[1]).map(move |y| z * width + y))
    }

    fn in_cell(&self, cell: usize) -> &[u32] {
        &self.triangles[self.starts[cell] as usize..self.starts[cell + 1] as usize]
    }
}

impl Surface {
    fn contains(&self, position: &Vector3<f64>, tolerance: f64) -> bool {
        let (low, high) = self.bounds;
        let reach = tolerance.abs();
        if (0..3).any(|a| !(position[a] >= low[a] - reach && position[a] <= high[a] + reach)) {
            return false;
        }
        let at = [position.y - low.y, position.z - low.z];
        let near = self
            .columns
            .range(at.map(|c| c - reach), at.map(|c| c + reach));
        let mut touching = self
            .columns
            .cells(near)
            .flat_map(|c| self.columns.in_cell(c));
        if touching.any(|&t| self.distance(t, position) <= reach) {
            return tolerance >= 0.0;
        }
        let column = self.columns.cells(self.columns.range(at, at)).next();
        let in_column = column.map_or(&[][..], |cell| self.columns.in_cell(cell));
        in_column
            .iter()
            .map(|&t| self.winding(t, position))
            .sum::<i32>()
            != 0
    }

    fn corners(&self, triangle: u32) -> [Vector3<f64>; 3] {
        self.triangles[triangle as usize].map(|v| self.vertices[v as usize])
    }

    /// Contribution to the winding number of a triangle in front of the position along x.
    fn winding(&self, triangle: u32, position: &Vector3<f64>) -> i32 {
        let at = position.yz();
        let numbers = self.triangles[triangle as usize];
        let mut winding = 0;
        let mut turns = [0.0; 3];
        for (i, turn) in turns.iter_mut().enumerate() {
            let (a, b) = (numbers[i], numbers[(i + 1) % 3]);
            *turn = self.turn(a, b, at);
            let [from, to] = [a, b].map(|v| self.vertices[v as usize].z);
            if from <= at.y && at.y < to && *turn > 0.0 {
                winding += 1;
            } else if to <= at.y && at.y < from && *turn < 0.0 {
                winding -= 1;
            }
        }
        if winding == 0 {
            return 0;
        }
        // the turn of an edge weights the corner opposite of it
        let [a, b, c] = self.corners(triangle).map(|corner| corner.x);
        let area: f64 = turns.iter().sum();
        let x = match area == 0.0 {
            true => a.max(b).max(c),
            false => (turns[1] * a + turns[2] * b + turns[0] * c) / area,
        };
        if x > position.x { winding } else { 0 }
    }

    /// Twice the signed area between an edge and a position in y and z, m²; exactly opposite for the reverse edge.
    fn turn(&self, a: u32, b: u32, at: Vector2<f64>) -> f64 {
        let [first, second] = [a.min(b), a.max(b)].map(|v| self.vertices[v as usize].yz());
        let turn = (second - first).perp(&(at - first));
        if a < b { turn } else { -turn }
    }

    /// Distance of a position from a triangle, m.
    fn distance(&self, triangle: u32, position: &Vector3<f64>) -> f64 {
        let corners = self.corners(triangle);
        let [a, b, c] = corners;
        let normal = (b - a).cross(&(c - a));
        let edges = [(a, b), (b, c), (c, a)];
        let inside = edges.map(|(from, to)| (to - from).cross(&(position - from)).dot(&normal));
        let area = normal.norm();
        if area > 0.0 && inside.iter().all(|side| *side >= 0.0) {
            return (position - a).dot(&normal).abs() / area;
        }
        let to_edge = edges.map(|(from, to)| distance_from_segment(*position, [from, to]));
        to_edge.into_iter().fold(f64::INFINITY, f64::min)
    }
}

#[cfg(test)]
mod tests;
