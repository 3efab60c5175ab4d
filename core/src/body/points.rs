//! The points of a body: positions and sizes, computed where they follow a rule.

use std::fmt::Debug;
use std::ops::{Deref, DerefMut, Index, IndexMut};
use std::sync::{Arc, OnceLock};

use nalgebra::Vector3;

use super::{Horizon, Lattice};

/// The points of a body.
#[derive(Clone, Debug, Default)]
pub struct Points {
    /// Reference positions, m.
    pub position: Positions,
    /// Reference volumes, m³ (2D: area times thickness; 1D: length times cross-section).
    pub volume: Sizes,
    /// Edge of the cell of each point, m.
    pub spacing: Sizes,
    /// Factor of the horizon of each point; empty where it is 1 everywhere.
    pub horizon_factor: Vec<f64>,
}

impl Points {
    /// Horizon of a point, m.
    pub fn horizon(&self, point: usize, horizon: Horizon) -> f64 {
        let factor = self.horizon_factor.get(point).copied().unwrap_or(1.0);
        factor * horizon.of(self.spacing[point])
    }

    /// Horizons of all points, m.
    pub fn horizons(&self, horizon: Horizon) -> Vec<f64> {
        (0..self.len()).map(|p| self.horizon(p, horizon)).collect()
    }

    /// Memory, bytes.
    pub fn memory(&self) -> usize {
        self.position.memory() + self.volume.memory() + self.spacing.memory()
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.position.count()
    }

    /// Whether there is no point.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Positions of points, m: the centres of the cells of a lattice, or a list.
pub type Positions = PointValues<Arc<Lattice>>;

/// A size of points: the same of all, or a list.
pub type Sizes = PointValues<Same>;

/// A value of each point by a rule, or from a list. Where there is a rule, single values ([`at`](Self::at), [`each`](Self::each)) are
/// computed. As a slice they are a list in any case, which is made when it is first asked for, and kept: it takes memory that large
/// bodies do without.
#[derive(Clone, Debug)]
pub struct PointValues<R: PointRule> {
    rule: Option<R>,
    list: OnceLock<Vec<R::Value>>,
}

/// Gives a value of each point.
pub trait PointRule: Clone + Debug {
    /// Type of a value.
    type Value: Copy + Debug;

    /// Number of points.
    fn count(&self) -> usize;

    /// Value of a point.
    fn at(&self, point: usize) -> Self::Value;
}

/// The same value of all points.
#[derive(Clone, Copy, Debug)]
pub struct Same {
    /// The value.
    pub value: f64,
    /// Number of points.
    pub count: usize,
}

impl PointRule for Same {
    type Value = f64;

    fn count(&self) -> usize {
        self.count
    }

    fn at(&self, _: usize) -> f64 {
        self.value
    }
}

impl PointRule for Arc<Lattice> {
    type Value = Vector3<f64>;

    fn count(&self) -> usize {
        self.points()
    }

    fn at(&self, point: usize) -> Vector3<f64> {
        self.centre(self.cell(point))
    }
}

impl<R: PointRule> PointValues<R> {
    /// Values by a rule.
    pub fn by(rule: R) -> Self {
        PointValues {
            rule: Some(rule),
            list: OnceLock::new(),
        }
    }

    /// Number of values.
    pub fn count(&self) -> usize {
        match &self.rule {
            Some(rule) => rule.count(),
            None => self.list().len(),
        }
    }

    /// Whether the values follow a rule.
    pub fn follow_rule(&self) -> bool {
        self.rule.is_some()
    }

    /// Value of a point.
    #[inline]
    pub fn at(&self, point: usize) -> R::Value {
        match &self.rule {
            Some(rule) => rule.at(point),
            None => self.list()[point],
        }
    }

    /// Values of all points, in their order.
    pub fn each(&self) -> impl ExactSizeIterator<Item = R::Value> + Clone {
        (0..self.count()).map(|point| self.at(point))
    }

    /// Values of some points, as a list.
    pub(super) fn of(&self, points: &[u32]) -> Self {
        let some = points.iter().map(|point| self.at(*point as usize));
        some.collect::<Vec<_>>().into()
    }

    fn list(&self) -> &[R::Value] {
        self.list.get_or_init(|| self.each().collect())
    }

    /// Memory of the list, bytes.
    pub fn memory(&self) -> usize {
        self.list.get().map_or(0, |list| size_of_val(&**list))
    }
}

impl Sizes {
    /// The size of all points, if they follow the rule that it is the same.
    pub fn same(&self) -> Option<f64> {
        self.rule.map(|same| same.value)
    }

    /// The sizes of some points; they follow the rule, too.
    pub(super) fn subset(&self, points: &[u32]) -> Self {
        let count = points.len();
        match self.rule {
            Some(Same { value, .. }) => PointValues::by(Same { value, count }),
            None => self.of(points),
        }
    }
}

impl<R: PointRule> From<Vec<R::Value>> for PointValues<R> {
    fn from(list: Vec<R::Value>) -> Self {
        PointValues {
            rule: None,
            list: list.into(),
        }
    }
}

impl<R: PointRule> Default for PointValues<R> {
    fn default() -> Self {
        Vec::new().into()
    }
}

impl<R: PointRule> Deref for PointValues<R> {
    type Target = [R::Value];

    fn deref(&self) -> &[R::Value] {
        self.list()
    }
}

impl<'a, R: PointRule> IntoIterator for &'a PointValues<R> {
    type Item = &'a R::Value;
    type IntoIter = std::slice::Iter<'a, R::Value>;

    fn into_iter(self) -> Self::IntoIter {
        self.list().iter()
    }
}

/// Values that change follow no rule.
impl<R: PointRule> DerefMut for PointValues<R> {
    fn deref_mut(&mut self) -> &mut [R::Value] {
        self.list();
        self.rule = None;
        self.list.get_mut().expect("it was just made")
    }
}

impl<R: PointRule> PartialEq for PointValues<R>
where
    R::Value: PartialEq,
{
    fn eq(&self, other: &Self) -> bool {
        self.each().eq(other.each())
    }
}

impl IndexMut<usize> for Sizes {
    fn index_mut(&mut self, point: usize) -> &mut f64 {
        &mut (**self)[point]
    }
}

impl Index<usize> for Sizes {
    type Output = f64;

    #[inline]
    fn index(&self, point: usize) -> &f64 {
        match &self.rule {
            Some(same) => &same.value,
            None => &self.list()[point],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::Body;
    use crate::shape::{BoxShape, Shape, Sphere};

    #[test]
    fn lists_have_the_values_of_the_rule_and_take_memory_when_they_are_asked_for() {
        let cube = Shape::Box(BoxShape {
            min: [0.1; 3],
            max: [1.0; 3],
        });
        let ball = Shape::Sphere(Sphere {
            centre: [0.3; 3],
            radius: 0.7,
        });
        for (shape, is_full) in [(cube, true), (ball, false)] {
            let body = Body::fill("body", &shape, 3, 0.1, 1.0).expect("valid");
            let (points, lattice) = (&body.points, body.lattice().expect("a lattice"));
            assert_eq!(lattice.is_full(), is_full);
            assert_eq!(lattice.memory() == 0, is_full);
            assert_eq!(points.memory(), 0);
            let cells = lattice.cells_of_points();
            assert!(cells.clone().is_sorted_by_key(|[x, y, z]| [z, y, x]));
            for (point, cell) in cells.enumerate() {
                assert_eq!(lattice.point(cell.map(i64::from)), Some(point));
                assert_eq!(points.position.at(point), lattice.centre(cell));
            }
            assert!(points.position.iter().copied().eq(points.position.each()));
            assert_eq!(points.memory(), 24 * points.len());
            assert_eq!(
                points.volume.iter().sum::<f64>(),
                points.volume.each().sum::<f64>()
            );
        }
    }

    #[test]
    fn values_that_change_follow_no_rule() {
        let value = 2.0;
        let mut sizes = Sizes::by(Same { value, count: 3 });
        assert_eq!((sizes.same(), sizes[2]), (Some(2.0), 2.0));
        sizes[1] = 3.0;
        assert_eq!(sizes.same(), None);
        assert_eq!(*sizes, [2.0, 3.0, 2.0]);
    }

    #[test]
    fn parts_have_the_positions_of_the_body_where_it_was_moved_too() {
        let cube = Shape::Box(BoxShape {
            min: [0.0; 3],
            max: [0.5; 3],
        });
        let mut body = Body::fill("body", &cube, 3, 0.1, 1.0).expect("valid");
        for moved in [false, true] {
            if moved {
                body.points.position.iter_mut().for_each(|x| x.z += 0.3);
            }
            let part = crate::body::Part::new(&body, &[7, 8, 9], Horizon::Spacings(2.0));
            for (point, number) in part.numbers().iter().enumerate() {
                let whole = body.points.position.at(*number as usize);
                assert_eq!(part.body.points.position.at(point), whole);
            }
        }
    }
}
