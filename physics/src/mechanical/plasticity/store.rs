//! Inelastic states of the points of a body: at the end of the last step, and tried in this one.

use rayon::prelude::*;

use super::law::Flow;

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
    /// Numbers of the state variables of a point.
    width: usize,
    settled_variables: Vec<f64>,
    tried_variables: Vec<f64>,
}

/// The trial state of a point that is being found.
pub(super) struct Tried<'a> {
    inelastic: &'a mut Inelastic,
    work: &'a mut f64,
    /// State variables of the law, and more numbers where it has none.
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
    pub(super) fn rest(self, (inelastic, variables): (&Inelastic, &[f64])) {
        *self.inelastic = *inelastic;
        *self.work = 0.0;
        self.variables[..variables.len()].copy_from_slice(variables);
    }
}

impl InelasticStates {
    /// States without inelastic strain; `width` is that of the state variables of the law.
    pub(super) fn new(points: usize, width: usize) -> Self {
        // rows of at least one number, since chunks are not empty
        let variables = vec![0.0; points * width.max(1)];
        InelasticStates {
            settled: vec![Inelastic::default(); points],
            tried: vec![Inelastic::default(); points],
            work: vec![0.0; points],
            width,
            settled_variables: variables.clone(),
            tried_variables: variables,
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

    fn row<'a>(&self, variables: &'a [f64], point: usize) -> &'a [f64] {
        &variables[point * self.width.max(1)..][..self.width]
    }

    /// State variables of a point at the end of the last step.
    pub(super) fn settled_variables(&self, point: usize) -> &[f64] {
        self.row(&self.settled_variables, point)
    }

    /// State variables of a point in the trial state.
    pub(super) fn tried_variables(&self, point: usize) -> &[f64] {
        self.row(&self.tried_variables, point)
    }

    /// The state variable at a place of the row of each point, of settled states.
    pub(in crate::mechanical) fn variable<const N: usize>(
        &self,
        at: usize,
    ) -> impl Iterator<Item = [f64; N]> {
        let rows = self.settled_variables.chunks_exact(self.width.max(1));
        rows.map(move |row| std::array::from_fn(|n| row[at + n]))
    }

    /// Replaces the state variable at a place of the row of each point, of settled states; [`InelasticStates::load`] must follow.
    pub(in crate::mechanical) fn set_variable<const N: usize>(
        &mut self,
        at: usize,
        values: impl Iterator<Item = [f64; N]>,
    ) {
        let rows = self.settled_variables.chunks_exact_mut(self.width.max(1));
        rows.zip(values)
            .for_each(|(row, value)| row[at..at + N].copy_from_slice(&value));
    }

    /// The work of the flow of each point from the settled to the trial state, J/m³.
    pub(super) fn work(&self) -> &[f64] {
        &self.work
    }

    /// Each point with its settled state and the trial state to be found from it.
    pub(super) fn try_from_settled(
        &mut self,
    ) -> impl IndexedParallelIterator<Item = (usize, (&Inelastic, &[f64]), Tried<'_>)> {
        let (width, row) = (self.width, self.width.max(1));
        let settled = self.settled.par_iter();
        let settled = settled.zip(self.settled_variables.par_chunks_exact(row));
        let tried = self.tried.par_iter_mut().zip(&mut self.work);
        let tried = tried.zip(self.tried_variables.par_chunks_exact_mut(row));
        let points = settled.zip(tried).enumerate();
        points.map(
            move |(i, ((settled, row), ((inelastic, work), variables)))| {
                let tried = Tried {
                    inelastic,
                    work,
                    variables,
                };
                (i, (settled, &row[..width]), tried)
            },
        )
    }

    /// Accepts the trial states.
    pub(super) fn commit(&mut self) {
        self.settled.copy_from_slice(&self.tried);
        self.settled_variables
            .copy_from_slice(&self.tried_variables);
    }

    /// Goes back to the settled states.
    pub fn reject(&mut self) {
        self.tried.copy_from_slice(&self.settled);
        self.tried_variables
            .copy_from_slice(&self.settled_variables);
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
        let row = self.width.max(1);
        self.settled_variables[point * row..][..row].fill(0.0);
        std::mem::take(&mut self.settled[point])
    }

    /// The settled state of a point, to be changed between steps; [`InelasticStates::reject`] must follow.
    pub(super) fn settled_mut(&mut self, point: usize) -> &mut Inelastic {
        &mut self.settled[point]
    }
}
