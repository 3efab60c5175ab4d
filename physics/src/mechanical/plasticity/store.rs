//! Inelastic states of the points of a body: at the end of the last step, and tried in this one.

use rayon::prelude::*;

use super::law::Flow;
use crate::mechanical::variables::VariableStates;

/// Inelastic strain of a point (xx, yy, zz, xy, yz, zx) and equivalent plastic strain.
#[derive(Clone, Copy, Debug, Default)]
pub struct Inelastic {
    /// Plastic and annealed strain.
    pub strain: [f64; 6],
    /// Equivalent plastic strain since the last annealing.
    pub equivalent: f64,
}

/// Inelastic states of all points, with the state variables of the law. A trial state is committed or rejected as a whole.
#[derive(Debug)]
pub struct InelasticStates {
    settled: Vec<Inelastic>,
    tried: Vec<Inelastic>,
    /// Work of the flow from the settled to the trial state, J/m³.
    work: Vec<f64>,
    /// State variables of the law.
    pub(in crate::mechanical) variables: VariableStates,
}

/// The state of a point at the end of the last step.
#[derive(Clone, Copy, Debug)]
pub(super) struct SettledPoint<'a> {
    pub(super) inelastic: &'a Inelastic,
    /// State variables of the law.
    pub(super) variables: &'a [f64],
}

/// The trial state of a point that is being found.
pub(super) struct Tried<'a> {
    inelastic: &'a mut Inelastic,
    work: &'a mut f64,
    /// State variables of the law.
    pub(super) variables: &'a mut [f64],
}

impl Tried<'_> {
    /// The state after a flow.
    #[inline(always)]
    pub(super) fn advance(self, settled: &Inelastic, flow: &Flow) {
        *self.inelastic = *settled;
        let strain = self.inelastic.strain.iter_mut().zip(flow.strain);
        strain.for_each(|(e, de)| *e += de);
        self.inelastic.equivalent += flow.equivalent;
        *self.work = flow.work;
    }

    /// The state without flow.
    #[inline(always)]
    pub(super) fn rest(self, settled: SettledPoint<'_>) {
        *self.inelastic = *settled.inelastic;
        *self.work = 0.0;
        self.variables.copy_from_slice(settled.variables);
    }
}

impl InelasticStates {
    /// States without inelastic strain; `width` is that of the state variables of the law.
    pub(super) fn new(points: usize, width: usize) -> Self {
        InelasticStates {
            settled: vec![Inelastic::default(); points],
            tried: vec![Inelastic::default(); points],
            work: vec![0.0; points],
            variables: VariableStates::new(points, width),
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

    /// The work of the flow of each point from the settled to the trial state, J/m³.
    pub(super) fn work(&self) -> &[f64] {
        &self.work
    }

    /// The settled state of each point, with the trial state to be found from it.
    pub(super) fn try_from_settled(
        &mut self,
    ) -> impl IndexedParallelIterator<Item = (SettledPoint<'_>, Tried<'_>)> {
        let tried = self.tried.par_iter_mut().zip(&mut self.work);
        let points = self.settled.par_iter().zip(tried);
        let points = points.zip(self.variables.try_from_settled());
        points.map(|((settled, (inelastic, work)), (row, variables))| {
            let settled = SettledPoint {
                inelastic: settled,
                variables: row,
            };
            let tried = Tried {
                inelastic,
                work,
                variables,
            };
            (settled, tried)
        })
    }

    /// Accepts the trial states.
    pub(super) fn commit(&mut self) {
        self.settled.copy_from_slice(&self.tried);
        self.variables.commit();
    }

    /// Goes back to the settled states.
    pub fn reject(&mut self) {
        self.tried.copy_from_slice(&self.settled);
        self.variables.reject();
    }

    /// Replaces the settled states, and rejects the trial states.
    pub fn load(&mut self, states: impl Iterator<Item = Inelastic>) {
        let settled = self.settled.iter_mut().zip(states);
        settled.for_each(|(settled, state)| *settled = state);
        self.reject();
    }

    /// Takes inelastic strain, hardening and state variables from a point between steps; [`InelasticStates::reject`] must
    /// follow.
    pub(super) fn take(&mut self, point: usize) -> Inelastic {
        self.variables.clear(point);
        std::mem::take(&mut self.settled[point])
    }

    /// The settled state of a point, to be changed between steps; [`InelasticStates::reject`] must follow.
    pub(super) fn settled_mut(&mut self, point: usize) -> &mut Inelastic {
        &mut self.settled[point]
    }
}
