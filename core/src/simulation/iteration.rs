//! Strong coupling: the pass is repeated until the state at its end stands still.

use serde::{Deserialize, Serialize};

use super::Simulation;
use crate::error::RunError;
use crate::field::FieldIndex;
use crate::solver::Reducer;
use crate::stepping::Step;

/// Repetition of the staggered pass.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Iteration {
    /// Largest relative change of any state field between passes.
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1))]
    pub tolerance: f64,
    /// Largest number of passes.
    #[schemars(extend("minimum" = 2))]
    pub passes: usize,
    /// What happens when the passes end before the tolerance is met.
    #[serde(default)]
    pub unconverged: Unconverged,
}

/// What happens when repeated passes do not meet their tolerance.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum Unconverged {
    /// The run stops with an error.
    #[default]
    Stop,
    /// The run goes on; `unconverged` in the progress log counts such steps.
    Continue,
}

/// Values of all owned fields, in the order of the plan.
type State = Vec<Vec<f64>>;

/// Aitken's relaxation of a sequence of states.
struct Aitken {
    /// The points of each field.
    points: Vec<Reducer>,
    last_residual: State,
    factor: Option<f64>,
}

impl Aitken {
    fn new(points: Vec<Reducer>) -> Self {
        Aitken {
            points,
            last_residual: Vec::new(),
            factor: None,
        }
    }

    /// `sum a b` over the points of all fields.
    fn dot(&self, a: &State, b: &State) -> f64 {
        let fields = self.points.iter().zip(a.iter().zip(b));
        fields.map(|(points, (a, b))| points.dot(a, b)).sum()
    }

    /// The largest value of a field.
    fn size(points: &Reducer, values: &[f64]) -> f64 {
        points.max_abs(values).max(f64::MIN_POSITIVE)
    }

    /// The state to go on from, after a pass went from `old` to `new`.
    fn relax(&mut self, new: &State, old: &State) -> State {
        let fields = self.points.iter().zip(new.iter().zip(old));
        let residual = fields.map(|(points, (n, o))| -> Vec<f64> {
            // fields of all units count alike
            let scale = Self::size(points, n);
            n.iter().zip(o).map(|(n, o)| (n - o) / scale).collect()
        });
        let residual: State = residual.collect();
        let mut factor = self.factor.unwrap_or(1.0);
        if !self.last_residual.is_empty() {
            let fields = residual.iter().zip(&self.last_residual);
            let difference = fields.map(|(r, l)| r.iter().zip(l).map(|(r, l)| r - l).collect());
            let difference: State = difference.collect();
            let curvature = self.dot(&difference, &difference);
            if curvature > 0.0 {
                factor *= -self.dot(&self.last_residual, &difference) / curvature;
                factor = factor.clamp(0.05, 1.5);
            }
        }
        self.factor = Some(factor);
        self.last_residual = residual;
        let relaxed = |(n, o): (&Vec<f64>, &Vec<f64>)| {
            let values = n.iter().zip(o);
            values.map(|(n, o)| o + factor * (n - o)).collect()
        };
        new.iter().zip(old).map(relaxed).collect()
    }

    /// Largest relative change of any field.
    fn largest_change(&self, new: &State, old: &State) -> f64 {
        let change = |(points, (new, old)): (&Reducer, (&Vec<f64>, &Vec<f64>))| {
            let pairs = points.own(new).iter().zip(old);
            let worst = pairs.map(|(n, o)| (n - o).abs()).fold(0.0, f64::max);
            points.max(worst) / Self::size(points, new)
        };
        let fields = self.points.iter().zip(new.iter().zip(old));
        fields.map(change).fold(0.0, f64::max)
    }
}

impl Simulation {
    /// Repeats the pass from the same start until the end state stands still. The state that
    /// a physics sees of later ones is that of the pass before, relaxed by Aitken's rule; the
    /// last pass is not relaxed, so that balances hold. Physics of one group start again together.
    pub(super) fn iterate(
        &mut self,
        end: f64,
        logging: bool,
        iteration: Iteration,
    ) -> Result<(), RunError> {
        let before = self.save_physics()?;
        let couplers_before = self.save_couplers()?;
        let advanced_to = self.clock.advanced_to.clone();
        let all: Vec<usize> = (0..self.physics.len()).collect();
        let mut guess: Option<State> = None;
        let mut aitken = Aitken::new(self.points_of(&all));
        let mut change = f64::INFINITY;
        for pass in 1..=iteration.passes {
            if pass > 1 {
                self.restore_couplers(&couplers_before)?;
            }
            for g in 0..self.plan.groups.len() {
                if pass > 1 {
                    for m in 0..self.plan.groups[g].members.len() {
                        let p = self.plan.groups[g].members[m];
                        if self.clock.advanced_to[p] > advanced_to[p] {
                            self.restore_physics(p, &before[p])?;
                            self.clock.advanced_to[p] = advanced_to[p];
                        }
                    }
                }
                self.advance_group(g, end, logging)?;
            }
            self.clock.progress.passes += 1;
            let result = self.state_of(&all);
            let Some(old) = guess else {
                guess = Some(result);
                continue;
            };
            change = aitken.largest_change(&result, &old);
            if change <= iteration.tolerance {
                return Ok(());
            }
            if pass == iteration.passes {
                break;
            }
            let relaxed = aitken.relax(&result, &old);
            self.set_state(&all, &relaxed);
            guess = Some(relaxed);
        }
        self.clock.progress.unconverged += 1;
        match iteration.unconverged {
            Unconverged::Continue => Ok(()),
            Unconverged::Stop => Err(RunError::Unconverged {
                passes: iteration.passes,
                change,
                tolerance: iteration.tolerance,
                time: end,
            }),
        }
    }

    /// Finds the common steady state of a group: each member is solved with the others as they are, with Aitken's relaxation in
    /// between. The last pass is not relaxed.
    pub(super) fn find_steady_group(
        &mut self,
        g: usize,
        start: f64,
        end: f64,
        logging: bool,
    ) -> Result<(), RunError> {
        /// Relative to the largest value of a field; solvers are that exact.
        const TOLERANCE: f64 = 1e-9;
        const PASSES: usize = 500;
        let members = self.plan.groups[g].members.clone();
        let step = Step::new(start, end - start);
        let mut aitken = Aitken::new(self.points_of(&members));
        let mut change = f64::INFINITY;
        for _ in 0..PASSES {
            let old = self.state_of(&members);
            self.exchange(g, step)?;
            for &p in &members {
                self.clock.advanced_to[p] = start;
                self.advance(p, end, logging, true)?;
            }
            let new = self.state_of(&members);
            change = aitken.largest_change(&new, &old);
            if change <= TOLERANCE {
                break;
            }
            let relaxed = aitken.relax(&new, &old);
            self.set_state(&members, &relaxed);
        }
        for &p in &members {
            self.set_time(p, end);
        }
        match change <= TOLERANCE {
            true => Ok(()),
            false => Err(RunError::Unconverged {
                passes: PASSES,
                change,
                tolerance: TOLERANCE,
                time: end,
            }),
        }
    }

    /// Values of the fields that some physics own.
    fn state_of(&self, physics: &[usize]) -> State {
        let fields = physics.iter().flat_map(|&p| &self.plan.owned[p]);
        fields
            .map(|&f| self.world.fields.field(f).data().flat().to_vec())
            .collect()
    }

    /// The points of the fields that some physics own.
    fn points_of(&self, physics: &[usize]) -> Vec<Reducer> {
        let fields = physics.iter().flat_map(|&p| &self.plan.owned[p]);
        let body = |f: &FieldIndex| self.world.fields.field(*f).body;
        fields.map(|f| self.world.reducer(body(f))).collect()
    }

    fn set_state(&self, physics: &[usize], state: &State) {
        let fields = physics.iter().flat_map(|&p| &self.plan.owned[p]);
        for (&f, values) in fields.zip(state) {
            let field = self.world.fields.field(f);
            field.data_mut().flat_mut().copy_from_slice(values);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn aitken(fields: usize) -> Aitken {
        Aitken::new(vec![Reducer::default(); fields])
    }

    /// A state with a component that stays, whose scale does not change between passes.
    fn state(x: f64) -> State {
        vec![vec![1e4, x]]
    }

    /// For passes `x -> a x + b`, Aitken's factor is `1 / (1 - a)`, which leads to the fixed point `b / (1 - a)`; it is
    /// kept between 0.05 and 1.5.
    #[test]
    fn aitken_finds_the_fixed_point_of_a_linear_pass() {
        for (a, factor) in [(-0.5, 1.0 / 1.5), (0.2, 1.25), (0.9, 1.5), (-30.0, 0.05)] {
            let pass = |x: f64| a * x + 3.0;
            let mut aitken = aitken(1);
            let first = aitken.relax(&state(pass(1.0)), &state(1.0));
            assert_eq!(first, state(pass(1.0)), "nothing is known yet");
            let old = first[0][1];
            let second = aitken.relax(&state(pass(old)), &first)[0][1];
            let expected = old + factor * (pass(old) - old);
            // rounding of numbers up to 1e4
            assert!((second - expected).abs() < 1e-9, "{a}: {second} {expected}");
            if a.abs() < 0.6 {
                assert!((pass(second) - second).abs() < 1e-8, "{a}: {second}");
            }
        }
    }

    /// Two fields that change by the same part of their size count alike, whatever their units.
    #[test]
    fn fields_of_all_units_count_alike() {
        // passes towards 1 with factors of 0.5 and -0.5, in units that differ by 1e12
        let pass = |state: &State| -> State {
            let towards = |size: f64, value: f64, factor: f64| size + factor * (value - size);
            vec![
                vec![towards(1e6, state[0][0], 0.5)],
                vec![towards(1e-6, state[1][0], -0.5)],
            ]
        };
        let start = vec![vec![1e6 * (1.0 - 1e-4)], vec![1e-6 * (1.0 - 1e-4)]];
        let mut aitken = aitken(2);
        let first = aitken.relax(&pass(&start), &start);
        aitken.relax(&pass(&first), &first);
        // residuals of 0.5 and 1.5, then of 0.25 and -0.75; from the first field alone 2, from the second 2/3
        let (last, difference) = ([0.5, 1.5], [-0.25, -2.25]);
        let product = |a: [f64; 2], b: [f64; 2]| a[0] * b[0] + a[1] * b[1];
        let expected = -product(last, difference) / product(difference, difference);
        let factor = aitken.factor.expect("two passes");
        assert!((factor - expected).abs() < 1e-3, "{factor} {expected}");
    }

    #[test]
    fn a_factor_is_kept_where_the_residual_does_not_change() {
        let mut aitken = aitken(1);
        aitken.relax(&state(2.0), &state(1.0));
        let relaxed = aitken.relax(&state(3.0), &state(2.0));
        assert_eq!(relaxed, state(3.0));
    }

    #[test]
    fn the_largest_change_is_relative_to_the_largest_value_of_its_field() {
        let old = vec![vec![1.0, -4.0], vec![1e-6, 0.0], vec![0.0]];
        for (new, expected) in [
            (vec![vec![1.0, -4.0], vec![1e-6, 0.0], vec![0.0]], 0.0),
            (vec![vec![1.5, -4.0], vec![1e-6, 0.0], vec![0.0]], 0.125),
            (vec![vec![1.0, -5.0], vec![1e-6, 0.0], vec![0.0]], 0.2),
            (vec![vec![1.5, -4.0], vec![2e-6, 0.0], vec![0.0]], 0.5),
        ] {
            let found = aitken(3).largest_change(&new, &old);
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        }
    }
}
