//! Bonds between the points of a body and those of another one: its *foreign ghosts*.
//!
//! A physics whose body touches another one adds these bonds to the sums over its own family. They are weighted as
//! that family weighs its members, so that a foreign point in the place of an own one counts as much; the
//! horizon and the spacing that partial volumes depend on are those of the body, so that both ends of a bond see the same
//! influence. Each bond is visited once from either end: what it gives to the one end, the caller can take from
//! the other one, bond by bond.
//!
//! Behind mirrored faces of the body the foreign points have images, too.
//!
//! Foreign points have no slots, and a [`SlotField`](super::SlotField) does not hold their fields: which points are near changes
//! as bodies move, and values there belong to bonds rather than to ghosts. In an interface of a fluid, the velocity is extrapolated
//! by the depth of the bond behind the surface, and the viscosity of the own point applies. Callers hence evaluate kernels bond by
//! bond, and reflect the vectors of images ([`ForeignGhost::reflect`]).

use std::ops::Range;

use nalgebra::Vector3;
use rayon::prelude::*;

use crate::body::{Body, BoxImage, BoxImages};
use crate::cell_list::CellList;
use crate::neighbours::{self, FoundAt, Reaching};

use super::build::continued_faces;
use super::{Bond, FamilySpec};

/// Width of the skin as a fraction of the spacing of the body.
const SKIN: f64 = 0.5;

/// Owners or foreign points that a thread takes at a time.
const POINTS: usize = 64;

/// A foreign point, or its image behind mirrored faces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForeignGhost {
    /// The foreign point.
    pub point: usize,
    /// The image.
    image: BoxImage,
}

impl ForeignGhost {
    /// Position, m.
    fn place(&self, foreign: &[Vector3<f64>]) -> Vector3<f64> {
        self.image.of(foreign[self.point])
    }

    /// Mirrors a vector of the foreign point to the ghost, or back.
    pub fn reflect(&self, vector: Vector3<f64>) -> Vector3<f64> {
        self.image.reflect(vector)
    }
}

/// Bonds of a body to foreign points.
#[derive(Debug)]
pub struct ForeignBonds {
    spec: FamilySpec,
    /// m.
    horizon: f64,
    moment: f64,
    /// m.
    spacing: f64,
    /// Distance within which bonds are found, m.
    reach: f64,
    images: BoxImages,
    periodic: [bool; 3],
    cells: CellList,
    /// Where own and foreign points were when the bonds were found.
    found_at: [FoundAt; 2],
    ghosts: Vec<ForeignGhost>,
    /// Own points that have foreign members, ascending.
    owners: Vec<u32>,
    /// m³.
    owner_volume: Vec<f64>,
    /// First bond of each owner, and the number of bonds.
    start: Vec<usize>,
    /// Ghost of each bond.
    ghost: Vec<u32>,
    /// Owner of each bond, by its place among the owners.
    owner: Vec<u32>,
    bonds: Vec<Bond>,
    /// First of the bonds of each foreign point in `reverse`, and the number of bonds.
    reverse_start: Vec<usize>,
    reverse: Vec<u32>,
}

/// Current positions (m) and volumes (m³) of the points of a body.
#[derive(Clone, Copy, Debug)]
pub struct Places<'a> {
    /// m.
    pub positions: &'a [Vector3<f64>],
    /// m³.
    pub volumes: &'a [f64],
}

impl<'a> Places<'a> {
    /// Reference positions and volumes.
    pub fn reference(body: &'a Body) -> Places<'a> {
        Places {
            positions: &body.points.position,
            volumes: &body.points.volume,
        }
    }
}

/// A bond with its own point and its ghost.
#[derive(Clone, Copy, Debug)]
pub struct ForeignBond<'a> {
    /// Lengths and weights.
    pub bond: &'a Bond,
    /// Point of the own body.
    pub point: usize,
    /// Point of the other body, or its image.
    pub ghost: &'a ForeignGhost,
}

impl ForeignBonds {
    /// Weights bonds like a family of `body` with points of one spacing; there are none yet.
    pub fn new(body: &Body, spec: &FamilySpec) -> ForeignBonds {
        let spacing = body.finest_spacing();
        let horizon = spec.horizon.of(spacing);
        let reach = spec.reach(horizon, spacing) + SKIN * spacing;
        let faces = continued_faces(body, spec);
        ForeignBonds {
            spec: spec.clone(),
            horizon,
            moment: spec.moment(body, horizon),
            spacing,
            reach,
            images: BoxImages::new(body, &faces, reach),
            periodic: body.periodic,
            cells: CellList::default(),
            found_at: Default::default(),
            ghosts: Vec::new(),
            owners: Vec::new(),
            owner_volume: Vec::new(),
            start: Vec::new(),
            ghost: Vec::new(),
            owner: Vec::new(),
            bonds: Vec::new(),
            reverse_start: Vec::new(),
            reverse: Vec::new(),
        }
    }

    /// Updates the bonds to the current positions of own and foreign points.
    pub fn follow(&mut self, own: Places<'_>, foreign: Places<'_>) {
        let now = [own.positions, foreign.positions];
        let mut known = self.found_at.iter().zip(now);
        if known.any(|(found_at, now)| found_at.is_outdated(now, |_| SKIN * self.spacing)) {
            self.find(own.positions, foreign.positions);
        }
        self.weigh(own, foreign);
    }

    /// Foreign points and their images behind mirrored and periodic faces.
    fn images(&self, foreign: &[Vector3<f64>]) -> Vec<ForeignGhost> {
        let mut images = Vec::new();
        let (reach, periodic) = (self.reach, self.periodic);
        for (point, x) in foreign.iter().enumerate() {
            self.images.for_each_near(x, |image, depth| {
                // copies of points beyond a periodic side lie inside
                let is_near = |axis: usize| periodic[axis] || depth[axis].abs() <= reach;
                if (0..3).all(is_near) {
                    images.push(ForeignGhost { point, image });
                }
            });
        }
        let face = |image: &BoxImage| image.last_step(periodic).map(|step| step.face);
        images.sort_by_key(|g| (g.image.level(), face(&g.image), g.point, g.image.n));
        let itself = |point| ForeignGhost {
            point,
            image: BoxImage::ORIGINAL,
        };
        (0..foreign.len()).map(itself).chain(images).collect()
    }

    fn find(&mut self, own: &[Vector3<f64>], foreign: &[Vector3<f64>]) {
        let ghosts = self.images(foreign);
        let places: Vec<_> = ghosts.iter().map(|ghost| ghost.place(foreign)).collect();
        let reach = self.reach;
        let [own_reach, reaches] = [own.len(), places.len()].map(|n| vec![reach; n]);
        let owners = Reaching {
            positions: own,
            reach: &own_reach,
        };
        let candidates = Reaching {
            positions: &places,
            reach: &reaches,
        };
        let rows = neighbours::find(&mut self.cells, owners, candidates, |_, _| Some(reach));
        for list in [&mut self.owners, &mut self.ghost, &mut self.owner] {
            list.clear();
        }
        self.start.clear();
        self.start.push(0);
        for (point, row) in rows.into_iter().enumerate().filter(|(_, r)| !r.is_empty()) {
            let owner = self.owners.len() as u32;
            self.owners.push(point as u32);
            self.owner.extend(row.iter().map(|_| owner));
            self.ghost.extend(row);
            self.start.push(self.ghost.len());
        }
        self.ghosts = ghosts;
        self.found_at[0].set(own);
        self.found_at[1].set(foreign);
        self.find_reverse(foreign.len());
    }

    fn find_reverse(&mut self, foreign: usize) {
        let point = |ghost: &u32| self.ghosts[*ghost as usize].point;
        self.reverse_start = vec![0; foreign + 1];
        for ghost in &self.ghost {
            self.reverse_start[point(ghost) + 1] += 1;
        }
        for i in 0..foreign {
            self.reverse_start[i + 1] += self.reverse_start[i];
        }
        let mut next = self.reverse_start.clone();
        self.reverse = vec![0; self.ghost.len()];
        for (bond, ghost) in self.ghost.iter().enumerate() {
            let place = &mut next[point(ghost)];
            self.reverse[*place] = bond as u32;
            *place += 1;
        }
    }

    fn weigh(&mut self, own: Places<'_>, foreign: Places<'_>) {
        let mut bonds = std::mem::take(&mut self.bonds);
        self.owner_volume.clear();
        let volumes = self.owners.iter().map(|p| own.volumes[*p as usize]);
        self.owner_volume.extend(volumes);
        let numbers = (0..self.ghost.len()).into_par_iter().with_min_len(1024);
        let weighed = numbers.map(|n| {
            let point = self.owners[self.owner[n] as usize] as usize;
            let ghost = &self.ghosts[self.ghost[n] as usize];
            let xi = ghost.place(foreign.positions) - own.positions[point];
            let length = xi.norm();
            let influence = self.spec.share(self.horizon, self.spacing, length) / self.moment;
            let weights = [foreign.volumes[ghost.point], own.volumes[point]];
            let bond = Bond::new(xi.into(), length, weights.map(|volume| influence * volume));
            match length > 0.0 {
                true => bond,
                // points in one place
                false => Bond {
                    inverse_length: 0.0,
                    ..bond
                },
            }
        });
        weighed.collect_into_vec(&mut bonds);
        self.bonds = bonds;
    }

    /// Reach of the bonds, m.
    pub fn horizon(&self) -> f64 {
        self.horizon
    }

    /// Spacing of the own points, m.
    pub fn spacing(&self) -> f64 {
        self.spacing
    }

    /// Number of bonds.
    pub fn len(&self) -> usize {
        self.bonds.len()
    }

    /// Whether no foreign point is near.
    pub fn is_empty(&self) -> bool {
        self.bonds.is_empty()
    }

    /// Own points that have foreign members, ascending.
    pub fn owners(&self) -> &[u32] {
        &self.owners
    }

    /// A bond by its number.
    pub fn bond(&self, number: usize) -> ForeignBond<'_> {
        ForeignBond {
            bond: &self.bonds[number],
            point: self.owners[self.owner[number] as usize] as usize,
            ghost: &self.ghosts[self.ghost[number] as usize],
        }
    }

    /// Passes the own point of each bond and the bond to `change`, whose changes stay until points move.
    pub fn for_each_mut(&mut self, mut change: impl FnMut(usize, &mut Bond)) {
        for (bond, owner) in self.bonds.iter_mut().zip(&self.owner) {
            change(self.owners[*owner as usize] as usize, bond);
        }
    }

    /// Numbers of the bonds of an owner, given by its place among the owners.
    pub fn bonds_of(&self, owner: usize) -> Range<usize> {
        self.start[owner]..self.start[owner + 1]
    }

    /// Numbers of the bonds of a foreign point and its images.
    pub fn bonds_to(&self, point: usize) -> &[u32] {
        &self.reverse[self.reverse_start[point]..self.reverse_start[point + 1]]
    }

    /// Passes the foreign points, and their images behind mirrored faces, whose distance from `at` (m) is not more than
    /// `reach` (m) to `receive`, each with its vector from `at` (m), always in the same order. `foreign`: positions of the
    /// foreign points that the bonds follow, m.
    pub fn for_each_foreign(
        &self,
        foreign: &[Vector3<f64>],
        at: &Vector3<f64>,
        reach: f64,
        mut receive: impl FnMut(&ForeignGhost, Vector3<f64>),
    ) {
        // points may have moved by half the skin since they were sorted
        let within = reach + 0.5 * SKIN * self.spacing;
        let mut near = Vec::new();
        self.cells.visit_near(at, within, |ghost| near.push(ghost));
        near.sort_unstable();
        for ghost in near {
            let ghost = &self.ghosts[ghost];
            let xi = ghost.place(foreign) - at;
            if xi.norm_squared() <= reach * reach {
                receive(ghost, xi);
            }
        }
    }

    /// Volume of the own point of a bond, m³.
    pub fn own_volume(&self, number: usize) -> f64 {
        self.owner_volume[self.owner[number] as usize]
    }

    /// For each of the owners, the sum of `part(number of the bond)` over its bonds.
    pub fn sum_by_owner<const O: usize>(
        &self,
        part: impl Fn(usize) -> [f64; O] + Sync,
        sums: &mut Vec<[f64; O]>,
    ) {
        let sum = |n: usize| add_all((self.start[n]..self.start[n + 1]).map(&part));
        let owners = (0..self.owners.len()).into_par_iter();
        owners.with_min_len(POINTS).map(sum).collect_into_vec(sums);
    }

    /// Adds what [`ForeignBonds::sum_by_owner`] found to sums by point.
    pub fn add_to_owners<const O: usize>(&self, found: &[[f64; O]], sums: &mut [[f64; O]]) {
        for (&owner, found) in self.owners.iter().zip(found) {
            let sums = &mut sums[owner as usize];
            (0..O).for_each(|o| sums[o] += found[o]);
        }
    }

    /// For each foreign point, the sum of `part(number of the bond)` over its bonds and those of its images.
    pub fn sum_by_foreign<const O: usize>(
        &self,
        part: impl Fn(usize) -> [f64; O] + Sync,
        sums: &mut Vec<[f64; O]>,
    ) {
        let sum = |point: usize| add_all(self.bonds_to(point).iter().map(|b| part(*b as usize)));
        let points = (0..self.reverse_start.len() - 1).into_par_iter();
        points.with_min_len(POINTS).map(sum).collect_into_vec(sums);
    }
}

fn add_all<const O: usize>(parts: impl Iterator<Item = [f64; O]>) -> [f64; O] {
    parts.fold([0.0; O], |mut sums, part| {
        (0..O).for_each(|o| sums[o] += part[o]);
        sums
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::Face;
    use crate::family::{Correction, Family, Influence};
    use crate::shape::{BoxShape, Shape};

    fn plate(min: [f64; 3], max: [f64; 3]) -> Body {
        let shape = Shape::Box(BoxShape { min, max });
        Body::fill("plate", &shape, 2, 0.1, 0.5).expect("valid")
    }

    fn spec(layers: Vec<Face>) -> FamilySpec {
        FamilySpec {
            influence: Influence::Wendland,
            correction: Correction::None,
            layers,
            ..FamilySpec::new(0.3)
        }
    }

    /// Moments of the family and of the foreign bonds of each point together.
    fn moments(body: &Body, family: &Family, foreign: Option<&ForeignBonds>) -> Vec<[f64; 4]> {
        let mut all = vec![[0.0; 4]; body.points.len()];
        let part = |bond: &Bond| {
            let [x, y, _] = bond.xi;
            [1.0, x * x, y * y, x * y].map(|m| m * bond.weight)
        };
        for (point, sums) in all.iter_mut().enumerate() {
            family.for_each_bond(point, |_, bond, _| {
                let part = part(bond);
                (0..4).for_each(|o| sums[o] += part[o]);
            });
        }
        if let Some(foreign) = foreign {
            let mut sums = Vec::new();
            foreign.sum_by_owner(|n| part(foreign.bond(n).bond), &mut sums);
            foreign.add_to_owners(&sums, &mut all);
        }
        all
    }

    #[test]
    fn foreign_points_and_their_images_complete_a_family_as_own_points_would() {
        // the lower half of a body, whose upper half is another body, between mirrored or periodic sides
        for is_periodic in [false, true] {
            let plate = |min, max| {
                let mut body = plate(min, max);
                body.periodic[0] = is_periodic;
                body
            };
            let whole = plate([0.0; 3], [0.8, 1.2, 0.1]);
            let lower = plate([0.0; 3], [0.8, 0.6, 0.1]);
            let upper = plate([0.0, 0.6, 0.0], [0.8, 1.2, 0.1]);
            let sides = [Face::XMin, Face::XMax, Face::YMin];
            let spec = spec(sides[if is_periodic { 2 } else { 0 }..].to_vec());
            let family = |body: &Body| Family::moving(body, &spec).expect("valid");
            let mut foreign = ForeignBonds::new(&lower, &spec);
            foreign.follow(Places::reference(&lower), Places::reference(&upper));
            let expected = moments(&whole, &family(&whole), None);
            let found = moments(&lower, &family(&lower), Some(&foreign));
            for (x, found) in lower.points.position.iter().zip(&found) {
                let same = whole.points.position.iter();
                let at = same.clone().position(|y| (x - y).norm() < 1e-9);
                let expected = expected[at.expect("the lower half")];
                assert!((0..4).all(|o| (found[o] - expected[o]).abs() < 1e-12));
            }
            check_that_both_ends_see_each_bond(&foreign);
        }
    }

    fn check_that_both_ends_see_each_bond(foreign: &ForeignBonds) {
        let (mut owners, mut others) = (Vec::new(), Vec::new());
        foreign.sum_by_owner(|n| [foreign.bond(n).bond.weight], &mut owners);
        foreign.sum_by_foreign(|n| [foreign.bond(n).bond.dual], &mut others);
        let total = |sums: &[[f64; 1]]| sums.iter().map(|[s]| s).sum::<f64>();
        assert!((total(&owners) - total(&others)).abs() < 1e-12 * total(&owners));
    }

    #[test]
    fn sums_do_not_depend_on_when_bonds_were_found() {
        let mut lower = plate([0.0; 3], [0.8, 0.6, 0.1]);
        let mut upper = plate([0.0, 0.6, 0.0], [0.8, 1.2, 0.1]);
        let mut old = ForeignBonds::new(&lower, &spec(Vec::new()));
        old.follow(Places::reference(&lower), Places::reference(&upper));
        let sums = |bonds: &ForeignBonds| {
            let mut sums = Vec::new();
            bonds.sum_by_foreign(|n| [bonds.bond(n).bond.dual], &mut sums);
            sums
        };
        for (along, down) in [(0.0, 0.02), (0.3, 0.1)] {
            lower.points.position.iter_mut().for_each(|x| x.x += along);
            upper.points.position.iter_mut().for_each(|x| x.y -= down);
            old.follow(Places::reference(&lower), Places::reference(&upper));
            let mut new = ForeignBonds::new(&lower, &spec(Vec::new()));
            new.follow(Places::reference(&lower), Places::reference(&upper));
            assert_eq!(sums(&old), sums(&new));
        }
    }
}
