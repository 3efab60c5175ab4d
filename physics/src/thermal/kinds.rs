//! Which keys belong to which heat conduction, and what they need.
//!
//! The table ([`Thermal`]) lists all keys side by side; form, solver and points decide which of them it has ([`take_keys`]).

use perimelt_core::material::LatentHeatForm;
use perimelt_core::numbers::{check_fraction, check_positive};
use perimelt_core::world::BodyIndex;
use perimelt_core::world::refinement::Level;
use perimelt_core::{Correction, Description, SetupError, World};

use crate::advection::Convection;
use crate::dependent_keys::{Choice, Part, need, take_keys};

use super::integrate::Solver;
use super::keys::{BrokenConduction, Form, Surfaces, Thermal, ThermalSolver};

/// Keys that depend on form, solver and points. A combination that makes no sense cannot be written.
#[derive(Debug)]
pub(super) struct ThermalKeys {
    pub(super) form: FormKeys,
    pub(super) solver: Solver,
    /// Whether bonds that broke in the mechanics conduct no heat.
    pub(super) follows_cracks: bool,
    /// Stabilisation of the convective terms, in a flow.
    pub(super) convection: Option<Convection>,
}

/// How the divergence of the heat flux becomes a sum.
#[derive(Clone, Copy, Debug)]
pub(super) enum FormKeys {
    Bonds(BondKeys),
    /// Ordinary state-based, with this stabilisation.
    Ordinary(BondKeys, f64),
    SecondDerivatives,
}

/// Keys of the forms whose bonds carry heat.
#[derive(Clone, Copy, Debug)]
pub(super) struct BondKeys {
    /// `None` where it is left out.
    pub(super) correction: Option<Correction>,
    pub(super) surfaces: Surfaces,
}

/// What the points of a body are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Points {
    AtRest,
    /// A physics moves them.
    Moving,
    /// A fluid with sound flows through them.
    InFlow,
    /// Two fluids flow through them.
    TwoFluids,
    /// Material is deposited on them or cut off.
    Growing,
    /// The body has a window of finer points.
    Plate,
    /// The body is a window of finer points.
    Window,
    /// Of the plies of a lay-up.
    Layers,
}

/// How a flow carries heat.
#[derive(Clone, Copy, Debug)]
pub(super) struct HeatOfFlow {
    /// It gives the amounts that it carried.
    pub(super) is_given: bool,
    pub(super) of_two_fluids: bool,
}

impl Points {
    fn of(world: &World, body: BodyIndex, flow: HeatOfFlow) -> Points {
        match (world.refinement(body), world.description(body)) {
            _ if flow.of_two_fluids => Points::TwoFluids,
            _ if world.body(body).layers().is_some() => Points::Layers,
            (Some((_, Level::Plate)), _) => Points::Plate,
            (Some((_, Level::Window)), _) => Points::Window,
            (None, Description::UpdatedLagrangian) => Points::Moving,
            (None, description) if description.flows_through() && !flow.is_given => Points::InFlow,
            (None, _) if world.is_growing(body) => Points::Growing,
            (None, _) => Points::AtRest,
        }
    }

    /// The points in words.
    fn text(self) -> &'static str {
        match self {
            Points::AtRest => "points at rest",
            Points::Moving => "points that a physics moves",
            Points::InFlow => "a flow through the points",
            Points::TwoFluids => "two fluids",
            Points::Growing => "material that is deposited or cut off",
            Points::Plate => "a body that has a window of finer points",
            Points::Window => "a body that is a window of finer points",
            Points::Layers => "a body with a `layup`",
        }
    }
}

/// What decides which keys there are.
#[derive(Clone, Copy)]
struct ThermalChoice {
    form: Form,
    solver: ThermalSolver,
    points: Points,
}

impl ThermalChoice {
    /// Whether this heat conduction is built.
    fn is_built(self) -> bool {
        let is_by_bonds = self.form == Form::Bonds;
        let is_explicit = self.solver == ThermalSolver::Explicit;
        match self.points {
            Points::AtRest => true,
            Points::Moving | Points::Layers => is_by_bonds,
            Points::InFlow => self.form != Form::Ordinary && is_explicit,
            Points::TwoFluids => is_by_bonds && is_explicit,
            Points::Growing => is_by_bonds && self.solver != ThermalSolver::Steady,
            Points::Plate | Points::Window => is_by_bonds && is_explicit,
        }
    }
}

impl Choice for ThermalChoice {
    fn all() -> impl Iterator<Item = ThermalChoice> {
        let points = [
            Points::AtRest,
            Points::Moving,
            Points::InFlow,
            Points::TwoFluids,
            Points::Growing,
            Points::Plate,
            Points::Window,
            Points::Layers,
        ];
        let forms = [Form::Bonds, Form::Ordinary, Form::SecondDerivatives];
        let solvers = [
            ThermalSolver::Explicit,
            ThermalSolver::Rkl2,
            ThermalSolver::Implicit,
            ThermalSolver::CrankNicolson,
            ThermalSolver::Steady,
        ];
        points.into_iter().flat_map(move |points| {
            forms.into_iter().flat_map(move |form| {
                solvers.map(|solver| ThermalChoice {
                    form,
                    solver,
                    points,
                })
            })
        })
    }

    fn parts(self) -> Vec<Part> {
        vec![
            Part::key("form", &self.form),
            Part::key("solver", &self.solver),
            Part::elsewhere(self.points.text()),
        ]
    }
}

impl Thermal {
    /// Takes the keys of this heat conduction out of the table, and refuses those that belong to others.
    pub(super) fn take_keys(
        &self,
        world: &World,
        body: BodyIndex,
        flow: HeatOfFlow,
    ) -> Result<ThermalKeys, SetupError> {
        self.check_numbers()?;
        let choice = ThermalChoice {
            form: self.form,
            solver: self.solver,
            points: Points::of(world, body, flow),
        };
        let keys = take_keys(self, choice, Thermal::take)?;
        self.check_needs(world, body, flow)?;
        Ok(keys)
    }

    fn take(&mut self, choice: ThermalChoice) -> Option<ThermalKeys> {
        if !choice.is_built() {
            return None;
        }
        let points = choice.points;
        let form = match choice.form {
            Form::Bonds => FormKeys::Bonds(self.take_bonds(points)),
            Form::Ordinary => {
                let stabilisation = self.stabilisation.take().unwrap_or(1.0);
                FormKeys::Ordinary(self.take_bonds(points), stabilisation)
            }
            // derivatives of complete families are exact without corrections
            Form::SecondDerivatives => {
                self.correction.take_if(|c| *c == Correction::None);
                self.surfaces.take_if(|s| *s != Surfaces::Bare);
                FormKeys::SecondDerivatives
            }
        };
        let stays = matches!(
            points,
            Points::AtRest | Points::Plate | Points::Window | Points::Layers
        );
        let has_bonds = choice.form != Form::SecondDerivatives;
        let broken = (stays && has_bonds).then(|| self.broken_bonds.take().unwrap_or_default());
        let is_in_flow = points == Points::InFlow;
        Some(ThermalKeys {
            form,
            solver: self.take_solver(choice.solver),
            follows_cracks: broken == Some(BrokenConduction::Insulate),
            convection: is_in_flow.then(|| self.convection.take().unwrap_or_default()),
        })
    }

    fn take_bonds(&mut self, points: Points) -> BondKeys {
        // a window goes on behind its faces
        let surfaces = match points {
            Points::Window => self.surfaces.take_if(|s| *s != Surfaces::Bare),
            // layers end
            Points::Layers => {
                self.surfaces.take_if(|s| *s != Surfaces::Mirrored);
                Some(Surfaces::Bare)
            }
            _ => self.surfaces.take(),
        };
        BondKeys {
            correction: self.correction.take(),
            surfaces: surfaces.unwrap_or_default(),
        }
    }

    fn check_numbers(&self) -> Result<(), SetupError> {
        check_positive("tolerance", self.tolerance, "")?;
        check_positive("time_tolerance", self.time_tolerance, "")?;
        check_fraction("stabilisation", self.stabilisation)?;
        Ok(())
    }

    /// Refuses bodies and materials that do not fit this heat conduction.
    fn check_needs(
        &self,
        world: &World,
        body: BodyIndex,
        flow: HeatOfFlow,
    ) -> Result<(), SetupError> {
        let description = world.description(body);
        let moves = description == Description::UpdatedLagrangian;
        let is_refined = world.refinement(body).is_some();
        let curves = world.enthalpy_curves(body)?;
        let is_apparent = curves.iter().any(|c| c.form() == LatentHeatForm::Apparent);
        let of_complete_families = [None, Some(Correction::None), Some(Correction::Lattice)];
        need(
            !is_apparent || self.solver == ThermalSolver::Explicit,
            "solver",
            "the apparent heat capacity is defined for explicit steps only",
            "`solver = \"explicit\"`, or the enthalpy form",
        )?;
        need(
            !is_apparent || !flow.is_given,
            "body",
            "`form = \"apparent\"` of `phase_change` changes the heat of points, so that none can be carried",
            "`form = \"enthalpy\"` of `phase_change`",
        )?;
        need(
            self.solver != ThermalSolver::Steady || !flow.is_given,
            "solver",
            "a flow carries an amount of heat in each step, and a steady state has no steps",
            "another `solver`, such as \"rkl2\"",
        )?;
        need(
            description != Description::ArbitraryLagrangianEulerian,
            "body",
            "heat in a fluid whose points follow its walls is not computed",
            "a fluid with `description = \"eulerian\"` or `\"updated_lagrangian\"`",
        )?;
        need(
            !is_refined || description == Description::TotalLagrangian,
            "body",
            "a window of finer points needs points at rest",
            "a body without `fluid`",
        )?;
        need(
            !is_refined || !world.is_growing(body),
            "body",
            "material is deposited on a body with a window of finer points",
            "a body without `deposit` and `cut`",
        )?;
        need(
            self.correction != Some(Correction::Uniaxial),
            "correction",
            "the uniaxial correction applies to elasticity, not to conduction",
            "\"point\"",
        )?;
        need(
            !moves || of_complete_families.contains(&self.correction),
            "correction",
            "bonds of points that move are calibrated for complete families",
            "\"lattice\" or \"none\"",
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::read;

    /// The mistake in a table for these points.
    fn mistake(points: Points, table: &str) -> Option<SetupError> {
        let thermal: Thermal = read(table);
        let choice = ThermalChoice {
            form: thermal.form,
            solver: thermal.solver,
            points,
        };
        take_keys(&thermal, choice, Thermal::take).err()
    }

    #[test]
    fn keys_fit_form_solver_and_points() {
        let ordinary = "form = 'ordinary'";
        let derivatives = "form = 'second_derivatives'";
        for (points, table, at_fault) in [
            (Points::AtRest, "", None),
            (Points::AtRest, "stabilisation = 1", Some("stabilisation")),
            (Points::AtRest, "form = 'ordinary'\nstabilisation = 0", None),
            (Points::AtRest, "convection = 'central'", Some("convection")),
            (Points::InFlow, "convection = 'central'", None),
            (Points::AtRest, "solver = 'steady'\ntolerance = 1e-6", None),
            (Points::AtRest, "tolerance = 1e-6", Some("tolerance")),
            (
                Points::AtRest,
                "solver = 'rkl2'\ntime_tolerance = 0.1",
                None,
            ),
            (
                Points::AtRest,
                "solver = 'steady'\ntime_tolerance = 0.1",
                Some("time_tolerance"),
            ),
            (
                Points::AtRest,
                "form = 'second_derivatives'\ncorrection = 'point'",
                Some("correction"),
            ),
            (
                Points::AtRest,
                "form = 'second_derivatives'\ncorrection = 'none'",
                None,
            ),
            (
                Points::AtRest,
                "form = 'second_derivatives'\nsurfaces = 'bare'",
                Some("surfaces"),
            ),
            (Points::AtRest, "broken_bonds = 'conduct'", None),
            (
                Points::Growing,
                "broken_bonds = 'conduct'",
                Some("broken_bonds"),
            ),
            (Points::Plate, "surfaces = 'bare'", None),
            (Points::Window, "surfaces = 'bare'", Some("surfaces")),
            (Points::Moving, "solver = 'implicit'", None),
            (Points::Moving, ordinary, Some("form")),
            (Points::Moving, derivatives, Some("form")),
            (Points::InFlow, derivatives, None),
            (Points::InFlow, ordinary, Some("form")),
            (Points::InFlow, "solver = 'implicit'", Some("solver")),
            (Points::Growing, "solver = 'implicit'", None),
            (Points::Growing, "solver = 'steady'", Some("solver")),
            (Points::Growing, derivatives, Some("form")),
            (Points::Plate, ordinary, Some("form")),
            (Points::Window, "solver = 'rkl2'", Some("solver")),
        ] {
            let found = mistake(points, table).map(|e| e.key);
            assert_eq!(found.as_deref(), at_fault, "{points:?}: {table}");
        }
    }

    /// The message names what the key does not fit, and the nearest table that works.
    #[test]
    fn the_message_follows_from_the_keys_of_other_tables() {
        for (points, table, expected) in [
            (
                Points::AtRest,
                "stabilisation = 0.5",
                "`stabilisation` does not work with `form = \"bonds\"`; \
                 expected `form = \"ordinary\"` or no `stabilisation`",
            ),
            (
                Points::AtRest,
                "convection = 'central'",
                "`convection = \"central\"` does not work with points at rest; expected no `convection`",
            ),
            (
                Points::Growing,
                "form = 'ordinary'",
                "`form = \"ordinary\"` does not work with material that is deposited or cut off; \
                 expected `form = \"bonds\"`",
            ),
            (
                Points::Plate,
                "form = 'ordinary'\nsolver = 'implicit'",
                "`form = \"ordinary\"` does not work with a body that has a window of finer points; \
                 expected `form = \"bonds\"` with `solver = \"explicit\"`",
            ),
            (
                Points::AtRest,
                "solver = 'steady'\ntime_tolerance = 0.1",
                "`time_tolerance` does not work with `solver = \"steady\"`; expected `solver = \"rkl2\"`, \
                 `solver = \"implicit\"`, `solver = \"crank_nicolson\"` or no `time_tolerance`",
            ),
        ] {
            let error = mistake(points, table).expect("a key that does not fit");
            assert_eq!(error.to_string(), expected);
        }
    }
}
