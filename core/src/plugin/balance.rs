//! What plugins tell of their state: conserved totals and numbers for the log.

use serde::{Deserialize, Serialize};

/// A conserved total of a physics, all since the start of the run.
///
/// `stored - initial = supplied + error`
#[derive(Clone, Debug, Serialize, Deserialize, PartialEq)]
pub struct Balance {
    /// What is conserved, such as `heat` or `momentum.x`.
    pub quantity: String,
    /// SI unit.
    pub unit: String,
    /// Total now.
    pub stored: f64,
    /// Total at the start.
    pub initial: f64,
    /// What came in through sources and boundaries, negative when it left.
    pub supplied: f64,
    /// How much there is of it and was exchanged: the sum of the absolute values of what points have, such as momenta,
    /// and of what sources and boundaries gave and took in each step. An error counts against it also where both
    /// changes and supplies cancel, as at the end of a cycle.
    #[serde(default)]
    pub size: f64,
    /// What came in with deposited material, a part of `supplied`; `None` where none is deposited.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub deposited: Option<f64>,
}

impl Balance {
    /// What is `stored` now and was at the start, and what came in since.
    pub fn new(quantity: &str, unit: &str, stored: f64, initial: f64, supplied: f64) -> Self {
        Balance {
            quantity: quantity.into(),
            unit: unit.into(),
            stored,
            initial,
            supplied,
            size: 0.0,
            deposited: None,
        }
    }

    /// The same, with the part of `supplied` that came in with deposited material.
    pub fn with_deposited(self, deposited: f64) -> Self {
        Balance {
            deposited: Some(deposited),
            ..self
        }
    }

    /// The same, with the [`Balance::size`] of the quantity.
    pub fn of_size(self, size: f64) -> Self {
        Balance { size, ..self }
    }

    /// `stored - initial - supplied`, in the unit of the quantity.
    pub fn error(&self) -> f64 {
        self.stored - self.initial - self.supplied
    }

    /// The error as a share of the largest of what is stored in excess, what was supplied, and the size.
    pub fn relative_error(&self) -> f64 {
        let excess = (self.stored - self.initial).abs();
        let scale = excess.max(self.supplied.abs()).max(self.size);
        if scale == 0.0 {
            self.error().abs()
        } else {
            self.error().abs() / scale
        }
    }
}

/// A number that a plugin reports for the progress log, such as deposited power.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// Name.
    pub name: String,
    /// SI unit.
    pub unit: String,
    /// Value now.
    pub value: f64,
}

impl Report {
    /// A number with its SI unit; a negative zero, such as the sum of nothing, becomes a positive one.
    pub fn new(name: impl Into<String>, unit: impl Into<String>, value: f64) -> Self {
        Report {
            name: name.into(),
            unit: unit.into(),
            value: value + 0.0,
        }
    }
}

/// What a physics reports of the last state that was observed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PhysicsReport {
    /// Numbers for the progress log.
    pub numbers: Vec<Report>,
    /// States outside the validity of its model among those that were logged, as sentences without a full stop for the end
    /// of the run.
    pub remarks: Vec<String>,
}

impl From<Vec<Report>> for PhysicsReport {
    fn from(numbers: Vec<Report>) -> Self {
        PhysicsReport {
            numbers,
            remarks: Vec::new(),
        }
    }
}
