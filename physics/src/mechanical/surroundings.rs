//! What surrounds a point that is born: how the displacement of the material around it goes on.

use nalgebra::{Matrix3, Vector3};
use perimelt_core::family::{ByRules, Continuation, LayerRule};
use perimelt_core::solver::Reducer;
use perimelt_core::{Family, SlotField};

/// The displacement of the points that are there, and where layers mirror them.
pub(super) struct Surroundings<'a> {
    family: &'a Family,
    /// By slot, the point in it or mirrored there.
    point_in: Vec<u32>,
    /// By slot, the signs of the components of a symmetric image; one for points, zero for other images.
    sign: Vec<[f64; 3]>,
    /// Whether the displacement of each point is known.
    pub(super) known: Vec<bool>,
}

/// State of motion of a body.
pub(super) struct MotionState<'a> {
    /// By component and slot, m.
    pub(super) displacement: [SlotField; 3],
    /// By point.
    pub(super) gradient: &'a [Matrix3<f64>],
    /// m/s; empty in equilibrium.
    pub(super) velocity: &'a [Vector3<f64>],
}

/// State of motion of a point.
#[derive(Clone, Copy, Default)]
pub(super) struct Placed {
    pub(super) displacement: Vector3<f64>,
    pub(super) gradient: Matrix3<f64>,
    pub(super) velocity: Vector3<f64>,
}

impl<'a> Surroundings<'a> {
    pub(super) fn new(family: &'a Family, rules: &[LayerRule], known: Vec<bool>) -> Self {
        let point_in = family.points_of_slots();
        let mut sign = vec![[1.0; 3]; point_in.len()];
        for image in family.images(&Continuation::plain(rules)) {
            sign[image.slot] = match image.is_symmetric() {
                true => image.scale,
                false => [0.0; 3],
            };
        }
        Surroundings {
            family,
            point_in,
            sign,
            known,
        }
    }

    /// A displacement (m) by slot, continued into the layers by `rules`.
    pub(super) fn in_slots(
        &self,
        displacement: &[Vector3<f64>],
        rules: &[LayerRule],
    ) -> [SlotField; 3] {
        std::array::from_fn(|axis| {
            let mut slots = SlotField::default();
            let along = |point: usize| displacement[point][axis];
            slots.load(self.family, along, ByRules(rules, axis));
            slots
        })
    }

    /// Lets points of other processes be known where their owners know them. Collective.
    pub(super) fn bring(&mut self, points: &Reducer) {
        let known = self.known.iter();
        let mut flags: Vec<f64> = known.map(|known| f64::from(u8::from(*known))).collect();
        points.bring(&mut flags);
        self.known = flags.into_iter().map(|flag| flag > 0.0).collect();
    }

    /// Continues the displacement of the known neighbours to a point; `None` if it has none.
    pub(super) fn continued(&self, point: usize, state: &MotionState<'_>) -> Option<Placed> {
        let mut total = 0.0;
        let mut sum = Placed::default();
        self.family.for_each_bond(point, |_, bond, slot| {
            let other = self.point_in[slot] as usize;
            let sign = self.sign[slot];
            if bond.weight <= 0.0 || sign == [0.0; 3] || !self.known.get(other).unwrap_or(&false) {
                return;
            }
            let mirror = Matrix3::from_diagonal(&sign.into());
            let gradient = mirror * state.gradient[other] * mirror;
            let xi = Vector3::from(bond.xi);
            let displacement = Vector3::from_fn(|axis, _| state.displacement[axis][slot]);
            sum.displacement += bond.weight * (displacement - gradient * xi);
            sum.gradient += bond.weight * gradient;
            if let Some(velocity) = state.velocity.get(other) {
                sum.velocity += bond.weight * (mirror * velocity);
            }
            total += bond.weight;
        });
        (total > 0.0).then(|| Placed {
            displacement: sum.displacement / total,
            gradient: sum.gradient / total,
            velocity: sum.velocity / total,
        })
    }
}
