//! Inelastic states of the points of a body: at the end of the last step, and tried in this one.

/// Inelastic strain of a point (xx, yy, zz, xy, yz, zx) and equivalent plastic strain.
#[derive(Clone, Copy, Debug, Default)]
pub struct Inelastic {
    /// Plastic and annealed strain.
    pub strain: [f64; 6],
    /// Equivalent plastic strain since the last annealing.
    pub equivalent: f64,
}

/// Inelastic states of all points. A trial state is committed or rejected as a whole.
#[derive(Debug)]
pub struct InelasticStates {
    settled: Vec<Inelastic>,
    tried: Vec<Inelastic>,
}

impl InelasticStates {
    /// States without inelastic strain.
    pub(super) fn new(points: usize) -> Self {
        InelasticStates {
            settled: vec![Inelastic::default(); points],
            tried: vec![Inelastic::default(); points],
        }
    }

    /// States at the end of the last step.
    pub fn settled(&self) -> &[Inelastic] {
        &self.settled
    }

    /// Trial states of the displacement whose force was evaluated.
    pub fn tried(&self) -> &[Inelastic] {
        &self.tried
    }

    /// The settled states, and the trial states to be found from them.
    pub(super) fn try_from_settled(&mut self) -> (&[Inelastic], &mut [Inelastic]) {
        (&self.settled, &mut self.tried)
    }

    /// Accepts the trial states.
    pub(super) fn commit(&mut self) {
        self.settled.copy_from_slice(&self.tried);
    }

    /// Goes back to the settled states.
    pub fn reject(&mut self) {
        self.tried.copy_from_slice(&self.settled);
    }

    /// Replaces the settled states, and rejects the trial states.
    pub fn load(&mut self, states: impl Iterator<Item = Inelastic>) {
        let settled = self.settled.iter_mut().zip(states);
        settled.for_each(|(settled, state)| *settled = state);
        self.reject();
    }

    /// The settled state of a point, to be changed between steps; [`InelasticStates::reject`] must follow.
    pub(super) fn settled_mut(&mut self, point: usize) -> &mut Inelastic {
        &mut self.settled[point]
    }
}
