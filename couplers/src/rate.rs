//! The rate of a field between the times at which a coupler is applied.

/// Rate of a field from its values when the rate was last taken. All changes are counted exactly once, whatever
/// the step size of the physics that changes the field.
#[derive(Debug)]
pub(crate) struct Rate {
    /// Values when the rate was last taken; empty before the first time. A restart needs them.
    pub seen: Vec<f64>,
    /// Change per second, by point.
    pub values: Vec<f64>,
}

impl Rate {
    /// The rate of a field of `points` values that is zero at first.
    pub fn new(points: usize) -> Self {
        Rate {
            seen: Vec::new(),
            values: vec![0.0; points],
        }
    }

    /// Takes the values of `now` at the end of a step of `size` (s); in a step of size zero the rate is zero.
    pub fn take(&mut self, now: &[f64], size: f64) {
        self.seen.resize(now.len(), 0.0);
        for ((rate, now), seen) in self.values.iter_mut().zip(now).zip(&mut self.seen) {
            *rate = if size > 0.0 {
                (now - *seen) / size
            } else {
                0.0
            };
            *seen = *now;
        }
    }
}
