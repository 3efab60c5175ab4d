//! What is wrong with a surface that is not closed.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::fmt;

use super::mesh::Mesh;
use super::reader::Format;

/// Gaps, flipped triangles, and triangles written twice.
#[derive(Clone, Debug, PartialEq)]
pub struct Defects {
    /// Kind of the file, which says what the numbers of triangles mean.
    pub format: Format,
    /// Gaps in the surface.
    pub gaps: usize,
    /// Edges around all gaps.
    pub open_edges: usize,
    /// An edge of the first gap, in units of the file, and line or number of its triangle.
    pub first_gap: Option<([[f64; 3]; 2], u32)>,
    /// Lines or numbers of triangles that are turned the other way than their neighbours.
    pub flipped: Vec<u32>,
    /// Lines or numbers of triangles that repeat another one.
    pub repeated: Vec<u32>,
}

impl fmt::Display for Defects {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut parts = Vec::new();
        let counted = |count: usize, one: &str, many: &str| match count {
            1 => format!("1 {one}"),
            _ => format!("{count} {many}"),
        };
        if let Some(([from, to], place)) = self.first_gap {
            parts.push(format!(
                "{} with {}, such as that from {from:?} to {to:?} of triangle {}",
                counted(self.gaps, "gap", "gaps"),
                counted(self.open_edges, "open edge", "open edges"),
                self.format.place(place)
            ));
        }
        for (places, one, many) in [
            (&self.flipped, "flipped triangle", "flipped triangles"),
            (
                &self.repeated,
                "triangle written twice",
                "triangles written twice",
            ),
        ] {
            if let Some(first) = places.first() {
                let which = if places.len() == 1 { "" } else { "the first " };
                let count = counted(places.len(), one, many);
                parts.push(format!("{count}, {which}{}", self.format.place(*first)));
            }
        }
        f.write_str(&parts.join("; "))
    }
}

impl Defects {
    /// Takes the triangles that repeat others out of the mesh, turns the flipped ones back, and counts what is still open.
    pub(super) fn of(mut mesh: Mesh, format: Format) -> Defects {
        let repeated = remove_repeated(&mut mesh);
        let flipped = turn_back(&mut mesh);
        let open = mesh.open_edges();
        let first_gap = open.keys().next().map(|edge| {
            let at = edge.map(|corner| mesh.corners[corner as usize].into());
            let of_edge = |t: &[u32; 3]| edge.iter().all(|corner| t.contains(corner));
            let triangle = mesh.triangles.iter().position(of_edge);
            (at, triangle.map_or(0, |index| mesh.places[index]))
        });
        Defects {
            format,
            gaps: connected(&open),
            open_edges: open.len(),
            first_gap,
            flipped,
            repeated,
        }
    }
}

/// Places of the triangles that were removed.
fn remove_repeated(mesh: &mut Mesh) -> Vec<u32> {
    let mut seen = HashSet::new();
    let mut repeated = Vec::new();
    let (triangles, places) = (
        std::mem::take(&mut mesh.triangles),
        std::mem::take(&mut mesh.places),
    );
    for (triangle, place) in triangles.into_iter().zip(places) {
        let smallest = (0..3).min_by_key(|i| triangle[*i]).unwrap_or(0);
        let mut turned = triangle;
        turned.rotate_left(smallest);
        if seen.insert(turned) {
            mesh.triangles.push(triangle);
            mesh.places.push(place);
        } else {
            repeated.push(place);
        }
    }
    repeated
}

/// Turns the smaller part of the triangles of each connected surface where two parts are turned against each other; the
/// places of these triangles.
fn turn_back(mesh: &mut Mesh) -> Vec<u32> {
    // triangles at each edge, and whether they pass it upwards
    let mut at_edge: HashMap<[u32; 2], Vec<(usize, bool)>> = HashMap::new();
    let edges = |[a, b, c]: [u32; 3]| [[a, b], [b, c], [c, a]];
    for (index, triangle) in mesh.triangles.iter().enumerate() {
        for [from, to] in edges(*triangle) {
            let edge = [from.min(to), from.max(to)];
            at_edge.entry(edge).or_default().push((index, from < to));
        }
    }
    let mut side: Vec<Option<bool>> = vec![None; mesh.triangles.len()];
    let mut flipped = Vec::new();
    for first in 0..mesh.triangles.len() {
        if side[first].is_some() {
            continue;
        }
        side[first] = Some(false);
        let mut surface = vec![first];
        let mut next = 0;
        while let Some(&index) = surface.get(next) {
            next += 1;
            for [from, to] in edges(mesh.triangles[index]) {
                let Some([one, other]) = at_edge
                    .get(&[from.min(to), from.max(to)])
                    .map(Vec::as_slice)
                else {
                    continue;
                };
                let neighbour = if one.0 == index { other.0 } else { one.0 };
                if side[neighbour].is_none() {
                    let is_same = one.1 != other.1;
                    side[neighbour] = side[index].map(|side| side == is_same);
                    surface.push(neighbour);
                }
            }
        }
        let (turned, straight): (Vec<usize>, Vec<usize>) =
            surface.into_iter().partition(|i| side[*i] == Some(true));
        let smaller = match turned.len() <= straight.len() {
            true => turned,
            false => straight,
        };
        flipped.extend(smaller);
    }
    flipped.sort_unstable();
    for index in &flipped {
        mesh.triangles[*index].swap(1, 2);
    }
    flipped.into_iter().map(|i| mesh.places[i]).collect()
}

/// The number of connected groups of edges.
fn connected(edges: &BTreeMap<[u32; 2], i32>) -> usize {
    let mut neighbours: HashMap<u32, Vec<u32>> = HashMap::new();
    for [a, b] in edges.keys() {
        neighbours.entry(*a).or_default().push(*b);
        neighbours.entry(*b).or_default().push(*a);
    }
    let mut groups = 0;
    for [first, _] in edges.keys() {
        let mut waiting = vec![*first];
        let mut is_new = false;
        while let Some(corner) = waiting.pop() {
            if let Some(others) = neighbours.remove(&corner) {
                is_new = true;
                waiting.extend(others);
            }
        }
        groups += usize::from(is_new);
    }
    groups
}
