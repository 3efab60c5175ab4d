//! What can happen to the points of a body during a run or set them apart, and which of it a plugin supports.

use std::fmt;

/// What can happen to the points of a body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// A physics moves the points, which change neighbours.
    Motion,
    /// Matter flows through the points.
    Flow,
    /// Points get material during the run.
    Births,
    /// Points lose their material during the run.
    Cuts,
    /// The points are a window of finer points that moves over another body.
    Window,
    /// The points lie in the layers of a lay-up.
    Layers,
    /// The points are divided among processes.
    Division,
}

impl Change {
    /// All of them, in the order of the table of support.
    pub const ALL: [Change; 7] = [
        Change::Motion,
        Change::Flow,
        Change::Births,
        Change::Cuts,
        Change::Window,
        Change::Layers,
        Change::Division,
    ];

    /// The name in the table of support.
    pub fn name(self) -> &'static str {
        match self {
            Change::Motion => "motion",
            Change::Flow => "flow",
            Change::Births => "births",
            Change::Cuts => "cuts",
            Change::Window => "window",
            Change::Layers => "layers",
            Change::Division => "division",
        }
    }
}

/// A set of changes.
#[derive(Clone, Copy, Default, PartialEq, Eq)]
pub struct Changes(u8);

impl Changes {
    /// No change: points at rest that keep their material.
    pub const NONE: Changes = Changes(0);
    /// All changes.
    pub const ALL: Changes = Changes::of(&Change::ALL);

    /// The set of these changes.
    pub const fn of(changes: &[Change]) -> Changes {
        let (mut set, mut next) = (0, 0);
        while next < changes.len() {
            set |= 1 << changes[next] as u8;
            next += 1;
        }
        Changes(set)
    }

    /// Whether a change is in the set.
    pub fn contains(self, change: Change) -> bool {
        self.0 >> change as u8 & 1 == 1
    }

    /// The changes of both sets.
    #[must_use]
    pub fn and(self, other: Changes) -> Changes {
        Changes(self.0 | other.0)
    }
}

impl fmt::Debug for Changes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let changes = Change::ALL.into_iter().filter(|c| self.contains(*c));
        f.debug_set().entries(changes).finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_set_contains_its_changes_only() {
        let set = Changes::of(&[Change::Flow, Change::Window]);
        let contained = Change::ALL.map(|change| set.contains(change));
        assert_eq!(contained, [false, true, false, false, true, false, false]);
        assert_eq!(Changes::NONE.and(set), set);
        assert!(Change::ALL.iter().all(|c| Changes::ALL.contains(*c)));
    }
}
