//! Horizons of the points of a body: one number where all are the same.

use std::ops::Index;

use super::{Horizon, Points};

/// Horizon of each point, m.
#[derive(Clone, Debug, PartialEq)]
pub struct Horizons(Vec<f64>);

impl Horizons {
    /// Those of points.
    pub fn of(points: &Points, horizon: Horizon) -> Self {
        let first = (0..points.len().min(1)).map(|point| points.horizon(point, horizon));
        let mut horizons = Horizons(first.collect());
        if (1..points.len()).any(|point| points.horizon(point, horizon) != horizons.0[0]) {
            horizons.0 = points.horizons(horizon);
        }
        horizons
    }

    /// The same horizon (m) for all points.
    pub fn uniform(horizon: f64) -> Self {
        Horizons(vec![horizon])
    }

    /// Whether not all are the same.
    pub fn differ(&self) -> bool {
        self.0.len() > 1
    }

    /// The largest one, m; zero without points.
    pub fn largest(&self) -> f64 {
        self.0.iter().copied().fold(0.0, f64::max)
    }
}

impl Index<usize> for Horizons {
    type Output = f64;

    fn index(&self, point: usize) -> &f64 {
        match &self.0[..] {
            [all] => all,
            each => &each[point],
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    #[test]
    fn equal_horizons_are_one_number() {
        let points = |spacing: [f64; 3]| Points {
            position: vec![Vector3::zeros(); 3].into(),
            volume: vec![1.0; 3].into(),
            spacing: spacing.to_vec().into(),
            horizon_factor: vec![1.0; 3],
        };
        let of = |spacing| Horizons::of(&points(spacing), Horizon::Spacings(3.0));
        let same = of([0.5; 3]);
        assert_eq!(same, Horizons::uniform(1.5));
        assert!(!same.differ() && same[2] == 1.5);
        let zones = of([0.5, 1.0, 0.5]);
        assert!(zones.differ());
        assert_eq!([zones[0], zones[1], zones[2]], [1.5, 3.0, 1.5]);
        assert_eq!(zones.largest(), 3.0);
    }
}
