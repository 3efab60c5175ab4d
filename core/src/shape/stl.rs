//! Shapes from STL files: closed surfaces of triangles.
//!
//! A position is inside where the surface winds around it. The winding number is the sum over the triangles in front of the
//! position along x: +1 for one that is left through, -1 for one that is entered. Edges are counted by a half-open rule and
//! turns are computed from the vertex with the smaller number, so that two triangles with a common edge agree bit by bit,
//! also for a ray through the edge. Overlapping parts are united; voids have their normals inwards.

mod facing;

use std::collections::HashMap;
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use nalgebra::{Vector2, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Bounds, distance_from_segment};

/// The solid in an STL file, text or binary. Its surface must be closed.
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
        /// Error of the system or of the parser.
        source: std::io::Error,
    },
    /// No triangle with an area.
    #[error("{path} has no triangles", path = .0.display())]
    Empty(PathBuf),
    /// A coordinate that is infinite or not a number.
    #[error("{path} has a corner with the coordinate {coordinate}", path = .path.display())]
    NotFinite {
        /// The file.
        path: PathBuf,
        /// The coordinate.
        coordinate: f32,
    },
    /// A surface with a border.
    #[error(
        "the surface in {path} is not closed: {edges} edges do not join two triangles of one orientation, such as that from {from:?} to {to:?}; \
         repair the mesh in the program that wrote it",
        path = .path.display()
    )]
    Open {
        /// The file.
        path: PathBuf,
        /// Edges of the border.
        edges: usize,
        /// Start of one of them, in units of the file.
        from: [f32; 3],
        /// Its end.
        to: [f32; 3],
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
            surface: None,
        }
    }

    /// Reads the file, whose path starts from `folder`. A scale or an origin that cannot be are left to
    /// [`mistake`](Self::mistake).
    pub(super) fn load(&mut self, folder: &Path) -> Result<(), StlError> {
        if self.wrong_number().is_some() {
            return Ok(());
        }
        let place = |corner: [f32; 3]| {
            Vector3::from(corner.map(f64::from)) * self.scale + Vector3::from(self.origin)
        };
        let surface = read(&folder.join(&self.file), place)?;
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

    fn wrong_number(&self) -> Option<String> {
        if !(self.scale > 0.0 && self.scale.is_finite()) {
            return Some(format!(
                "the scale {} is not positive and finite",
                self.scale
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

/// Corners by number, and three of them for each triangle that has three different ones.
type Numbered = (Vec<[f32; 3]>, Vec<[u32; 3]>);

/// Whether the length of a file is that of a binary one with as many triangles as it tells.
fn is_binary(bytes: &[u8]) -> bool {
    const HEADER: usize = 80;
    const TRIANGLE: u64 = 50;
    let count = bytes.get(HEADER..).and_then(<[u8]>::first_chunk);
    let expected = |count| HEADER as u64 + 4 + TRIANGLE * u64::from(u32::from_le_bytes(count));
    count.is_some_and(|count| expected(*count) == bytes.len() as u64)
}

fn number(path: &Path) -> Result<Numbered, StlError> {
    let unreadable = |source| StlError::Read {
        path: path.into(),
        source,
    };
    let mut bytes = std::fs::read(path).map_err(unreadable)?;
    if is_binary(&bytes) {
        // some programs let the header begin with `solid`, as text does
        bytes[..5].fill(b' ');
    }
    let mut reader = Cursor::new(bytes);
    let mut corners = Vec::new();
    let mut triangles = Vec::new();
    let mut numbers = HashMap::new();
    for triangle in stl_io::create_stl_reader(&mut reader).map_err(unreadable)? {
        let triangle = triangle.map_err(unreadable)?;
        let mut numbered = [0; 3];
        for (number, vertex) in numbered.iter_mut().zip(triangle.vertices) {
            // no negative zeros
            let corner = vertex.0.map(|c| c + 0.0);
            if let Some(&coordinate) = corner.iter().find(|c| !c.is_finite()) {
                let path = path.into();
                return Err(StlError::NotFinite { path, coordinate });
            }
            *number = *numbers.entry(corner.map(f32::to_bits)).or_insert_with(|| {
                corners.push(corner);
                corners.len() as u32 - 1
            });
        }
        let [a, b, c] = numbered;
        if a != b && b != c && c != a {
            triangles.push(numbered);
        }
    }
    Ok((corners, triangles))
}

/// Reads a surface; `place` gives the position (m) of a corner of the file.
fn read(path: &Path, place: impl Fn([f32; 3]) -> Vector3<f64>) -> Result<Surface, StlError> {
    let (corners, triangles) = number(path)?;
    if triangles.is_empty() {
        return Err(StlError::Empty(path.into()));
    }
    // each edge as often in one direction as in the other
    let mut balance: HashMap<[u32; 2], i32> = HashMap::new();
    for [a, b, c] in &triangles {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            let edge = [*from.min(to), *from.max(to)];
            *balance.entry(edge).or_default() += if from < to { 1 } else { -1 };
        }
    }
    let border = balance.iter().filter(|(_, balance)| **balance != 0);
    let (edges, first) = (border.clone().count(), border.map(|(edge, _)| edge).min());
    if let Some(&[from, to]) = first {
        return Err(StlError::Open {
            path: path.into(),
            edges,
            from: corners[from as usize],
            to: corners[to as usize],
        });
    }
    let vertices: Vec<_> = corners.into_iter().map(place).collect();
    let first = vertices[0];
    let bounds = vertices
        .iter()
        .fold((first, first), |(low, high), v| (low.inf(v), high.sup(v)));
    let corners_of = |t: &[u32; 3]| t.map(|v| vertices[v as usize] - first);
    let volume: f64 = triangles
        .iter()
        .map(|t| {
            let [a, b, c] = corners_of(t);
            a.dot(&b.cross(&c)) / 6.0
        })
        .sum();
    let extent = bounds.1 - bounds.0;
    // rounding of the sum
    if !(volume.abs() > 1e-12 * extent.norm().powi(3)) {
        return Err(StlError::NoVolume(path.into()));
    }
    let columns = Columns::new(&vertices, &triangles, bounds);
    Ok(Surface {
        vertices,
        triangles,
        bounds,
        columns,
    })
}

impl Columns {
    fn new(vertices: &[Vector3<f64>], triangles: &[[u32; 3]], (low, high): Bounds) -> Columns {
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

    /// What a triangle in front of the position along x adds to the winding number.
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
