//! Triangles with common corners, as read from a file, and their repair: corners that differ in their last digits are
//! joined, and edges are divided at corners that lie on them.
//!
//! Only corners of open edges are moved, by the smallest tolerance that closes the surface: closed surfaces stay as they
//! are, and sheets thinner than the tolerance keep two faces.

use std::collections::{BTreeMap, HashMap};

use nalgebra::Vector3;

/// Triangles by the numbers of their corners.
#[derive(Clone, Debug, Default)]
pub(super) struct Mesh {
    /// In units of the file.
    pub corners: Vec<Vector3<f64>>,
    /// Numbers of three different corners each.
    pub triangles: Vec<[u32; 3]>,
    /// Line or number of each triangle in the file.
    pub places: Vec<u32>,
    /// Numbers of the corners by their bits.
    numbers: HashMap<[u64; 3], u32>,
}

/// Tolerances of joined corners that are tried one after the other, as fractions of the largest one.
const TOLERANCES: [f64; 4] = [1e-6, 1e-4, 1e-2, 1.0];

impl Mesh {
    pub fn add(&mut self, corners: [[f64; 3]; 3], place: u32) {
        let triangle = corners.map(|corner| {
            // no negative zeros
            let corner = corner.map(|c| c + 0.0);
            *self
                .numbers
                .entry(corner.map(f64::to_bits))
                .or_insert_with(|| {
                    self.corners.push(corner.into());
                    self.corners.len() as u32 - 1
                })
        });
        self.push(triangle, place);
    }

    /// Adds a triangle unless it is a line.
    fn push(&mut self, triangle: [u32; 3], place: u32) {
        let [a, b, c] = triangle;
        if a != b && b != c && c != a {
            self.triangles.push(triangle);
            self.places.push(place);
        }
    }

    /// Edges that are not as often used in one direction as in the other, with the difference.
    pub fn open_edges(&self) -> BTreeMap<[u32; 2], i32> {
        let mut balance: HashMap<[u32; 2], i32> = HashMap::new();
        for [a, b, c] in &self.triangles {
            for (from, to) in [(a, b), (b, c), (c, a)] {
                let edge = [*from.min(to), *from.max(to)];
                *balance.entry(edge).or_default() += if from < to { 1 } else { -1 };
            }
        }
        balance.into_iter().filter(|(_, uses)| *uses != 0).collect()
    }

    /// Joins corners of open edges within a distance, and divides edges at corners that lie on them; the edges that are
    /// still open.
    pub fn close(&mut self, tolerance: f64) -> BTreeMap<[u32; 2], i32> {
        let mut open = self.open_edges();
        let tolerances = TOLERANCES.map(|factor| factor * tolerance);
        for tolerance in tolerances {
            for repair in [Mesh::joined, Mesh::divided] {
                if open.is_empty() {
                    return open;
                }
                let repaired = repair(self, &open, tolerance);
                let still_open = repaired.open_edges();
                if still_open.len() < open.len() {
                    (*self, open) = (repaired, still_open);
                }
            }
        }
        open
    }

    /// The mesh with the corners of open edges joined within a distance, whatever cell of a grid they are in.
    fn joined(&self, open: &BTreeMap<[u32; 2], i32>, tolerance: f64) -> Mesh {
        let cell = |corner: u32, step: [i64; 3]| {
            let at = self.corners[corner as usize] / tolerance;
            [0, 1, 2].map(|axis| at[axis].floor() as i64 + step[axis])
        };
        // each joined corner refers to one with a smaller number
        let mut same: Vec<u32> = (0..self.corners.len() as u32).collect();
        let mut cells: HashMap<[i64; 3], Vec<u32>> = HashMap::new();
        for corner in border(open) {
            let at = self.corners[corner as usize];
            for step in (0..27).map(|n| [n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1]) {
                let Some(others) = cells.get(&cell(corner, step)) else {
                    continue;
                };
                for &other in others {
                    if (self.corners[other as usize] - at).norm() <= tolerance {
                        let (a, b) = (root(&mut same, corner), root(&mut same, other));
                        same[a.max(b) as usize] = a.min(b);
                    }
                }
            }
            cells.entry(cell(corner, [0; 3])).or_default().push(corner);
        }
        // joined corners become the one that most triangles have
        let mut uses = vec![0; self.corners.len()];
        for corner in self.triangles.as_flattened() {
            uses[*corner as usize] += 1;
        }
        let mut chosen: Vec<u32> = (0..self.corners.len() as u32).collect();
        for corner in border(open) {
            let root = root(&mut same, corner) as usize;
            if uses[corner as usize] > uses[chosen[root] as usize] {
                chosen[root] = corner;
            }
        }
        let triangles = self.triangles.iter().zip(&self.places);
        self.with(triangles.map(|(triangle, place)| {
            let joined = triangle.map(|corner| chosen[root(&mut same, corner) as usize]);
            (joined, *place)
        }))
    }

    /// The mesh without corners that no triangle has.
    pub fn without_unused_corners(mut self) -> Mesh {
        let corners = std::mem::take(&mut self.corners);
        let mut numbers = vec![u32::MAX; corners.len()];
        for corner in self.triangles.as_flattened_mut() {
            let number = &mut numbers[*corner as usize];
            if *number == u32::MAX {
                *number = self.corners.len() as u32;
                self.corners.push(corners[*corner as usize]);
            }
            *corner = *number;
        }
        self.numbers.clear();
        self
    }

    /// The mesh with open edges divided at the corners of other open edges that lie on them.
    fn divided(&self, open: &BTreeMap<[u32; 2], i32>, tolerance: f64) -> Mesh {
        let mut by_x: Vec<u32> = border(open).collect();
        let x = |corner: &u32| self.corners[*corner as usize].x;
        by_x.sort_by(|a, b| x(a).total_cmp(&x(b)));
        let on_edge = |&[from, to]: &[u32; 2]| {
            let [a, b] = [from, to].map(|corner| self.corners[corner as usize]);
            let (along, length) = ((b - a).normalize(), (b - a).norm());
            let first = by_x.partition_point(|c| x(c) < a.x.min(b.x) - tolerance);
            let near = by_x[first..]
                .iter()
                .take_while(|c| x(c) <= a.x.max(b.x) + tolerance);
            let mut found: Vec<(f64, u32)> = near
                .filter_map(|&corner| {
                    let relative = self.corners[corner as usize] - a;
                    let position = relative.dot(&along);
                    let between = position > tolerance && position < length - tolerance;
                    let is_near = (relative - along * position).norm() <= tolerance;
                    (between && is_near).then_some((position, corner))
                })
                .collect();
            found.sort_by(|a, b| a.0.total_cmp(&b.0));
            found.into_iter().map(|(_, corner)| corner).collect()
        };
        let corners_on: HashMap<[u32; 2], Vec<u32>> =
            open.keys().map(|edge| (*edge, on_edge(edge))).collect();
        let triangles = self.triangles.iter().zip(&self.places);
        self.with(triangles.flat_map(|(triangle, &place)| {
            divide(*triangle, &corners_on)
                .into_iter()
                .map(move |t| (t, place))
        }))
    }

    /// A mesh of these corners with other triangles.
    fn with(&self, triangles: impl Iterator<Item = ([u32; 3], u32)>) -> Mesh {
        let mut mesh = Mesh {
            corners: self.corners.clone(),
            ..Mesh::default()
        };
        for (triangle, place) in triangles {
            mesh.push(triangle, place);
        }
        mesh
    }
}

/// The corners of edges, without repetition.
fn border(edges: &BTreeMap<[u32; 2], i32>) -> impl Iterator<Item = u32> {
    let mut corners: Vec<u32> = edges.keys().flatten().copied().collect();
    corners.sort_unstable();
    corners.dedup();
    corners.into_iter()
}

/// The corner that stands for a joined one; the way to it is shortened.
pub(super) fn root(same: &mut [u32], mut corner: u32) -> u32 {
    while same[corner as usize] != corner {
        let next = same[same[corner as usize] as usize];
        same[corner as usize] = next;
        corner = next;
    }
    corner
}

/// Triangles that together replace one whose edges have further corners.
fn divide(triangle: [u32; 3], corners_on: &HashMap<[u32; 2], Vec<u32>>) -> Vec<[u32; 3]> {
    // one for each edge, and some for corners that only lie on a part of an edge
    const DIVISIONS: usize = 12;
    let mut parts = vec![triangle];
    let mut done = Vec::new();
    let mut divisions = 0;
    while let Some(part) = parts.pop() {
        let [a, b, c] = part;
        // an edge with corners, and the corner opposite of it
        let turned = [[a, b, c], [b, c, a], [c, a, b]];
        let divided = turned.into_iter().find_map(|[from, to, opposite]| {
            let on_edge = corners_on.get(&[from.min(to), from.max(to)])?;
            let mut chain: Vec<u32> = on_edge.clone();
            chain.retain(|corner| *corner != opposite);
            if from > to {
                chain.reverse();
            }
            (!chain.is_empty()).then_some((from, chain, to, opposite))
        });
        let Some((mut from, chain, to, opposite)) = divided.filter(|_| divisions < DIVISIONS)
        else {
            done.push(part);
            continue;
        };
        divisions += 1;
        for next in chain.into_iter().chain([to]) {
            parts.push([from, next, opposite]);
            from = next;
        }
    }
    done
}
