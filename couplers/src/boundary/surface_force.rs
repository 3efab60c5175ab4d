//! Force on the surface of a body, as force per volume on the points behind the faces of cells.

use nalgebra::{Matrix3, Vector3};
use perimelt_core::body::{Points, SurfaceCell};
use perimelt_core::solver::ExactSum;
use perimelt_core::world::activity::is_active;
use perimelt_core::world::{BodyIndex, LoadedFaces};
use perimelt_core::{Setup, SetupError, World, Write, keys};

/// Where the force on a surface goes.
#[derive(Debug)]
pub(super) struct SurfaceForce {
    body: BodyIndex,
    body_force: Write<Vector3<f64>>,
    /// `body_force_moment` of a body that takes it.
    moment: Option<Write<Matrix3<f64>>>,
}

impl SurfaceForce {
    pub fn prepare(setup: &mut Setup<'_>, body: BodyIndex) -> Result<SurfaceForce, SetupError> {
        let is_taken = setup.facts::<LoadedFaces>(body).next().is_some();
        let moment = match is_taken {
            true => Some(setup.add(body, &keys::BODY_FORCE_MOMENT)?),
            false => None,
        };
        Ok(SurfaceForce {
            body,
            body_force: setup.add(body, &keys::BODY_FORCE)?,
            moment,
        })
    }

    /// Adds the force (N) on each cell with material, by its place in the list, and returns the whole force, N.
    pub fn add(
        &self,
        world: &World,
        cells: &[SurfaceCell],
        mut force_on: impl FnMut((usize, &SurfaceCell)) -> Vector3<f64>,
    ) -> Vector3<f64> {
        let points = &world.body(self.body).points;
        let mut body_force = world.write(self.body_force);
        let mut moment = self.moment.map(|moment| world.write(moment));
        whole_force(world, self.body, cells, |(index, cell)| {
            let point = cell.point as usize;
            let force = force_on((index, cell));
            let density = force / points.volume[point];
            body_force[point] += density;
            if let Some(moment) = &mut moment {
                moment[point] += density * arm(points, cell).transpose();
            }
            force
        })
    }
}

/// The sum of the forces (N) on the cells with material of a surface, by their places in the list, whichever process owns their points. `force_on` is
/// called for all cells that this process has. Collective.
pub(super) fn whole_force(
    world: &World,
    body: BodyIndex,
    cells: &[SurfaceCell],
    mut force_on: impl FnMut((usize, &SurfaceCell)) -> Vector3<f64>,
) -> Vector3<f64> {
    let reducer = world.reducer(body);
    let mut whole: [ExactSum; 3] = Default::default();
    for (index, cell) in with_material(world, body, cells) {
        let force = force_on((index, cell));
        if (cell.point as usize) < reducer.owned() {
            (0..3).for_each(|axis| whole[axis].add(force[axis]));
        }
    }
    whole.map(|sum| reducer.total(sum)).into()
}

/// Arm from the point of a cell of a surface to its face, m.
fn arm(points: &Points, cell: &SurfaceCell) -> Vector3<f64> {
    0.5 * points.spacing[cell.point as usize] * cell.face.normal()
}

/// Centres of the faces of the cells of a surface, m.
pub(super) fn face_centres(points: &Points, cells: &[SurfaceCell]) -> Vec<Vector3<f64>> {
    let centre = |cell: &SurfaceCell| points.position.at(cell.point as usize) + arm(points, cell);
    cells.iter().map(centre).collect()
}

/// The cells of a surface that have material now, with their places in the list.
fn with_material<'a>(
    world: &World,
    body: BodyIndex,
    cells: &'a [SurfaceCell],
) -> impl Iterator<Item = (usize, &'a SurfaceCell)> {
    let activity = world.activity(body);
    cells.iter().enumerate().filter(move |(_, cell)| {
        let activity = activity.as_ref();
        activity.is_none_or(|a| is_active(a[cell.point as usize]))
    })
}
