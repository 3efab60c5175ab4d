//! Bodies in contact without heat exchange.

use std::collections::BTreeSet;
use std::rc::Rc;

use perimelt_core::world::exchange::{Covered, Exchange, FreeFaces};
use perimelt_core::{Face, Simulation};

use super::warnings::provides;
use super::{Case, CaseError};

impl Case {
    /// Pairs of bodies with a temperature that are in contact and exchange no heat.
    pub(super) fn touching_bodies(
        &self,
        simulation: &Simulation,
    ) -> Result<Vec<String>, CaseError> {
        let world = simulation.world();
        let physics = self.plugin_tables("physics")?;
        let couplers = self.plugin_tables("couplers")?;
        let flows = |name: &str| {
            let mut fluids = physics.iter().filter(|p| p.kind == "fluid");
            fluids.any(|p| p.body().is_none_or(|body| body == name))
        };
        let is_joined = |pair: [&str; 2]| {
            let mut interfaces = couplers.iter().filter(|c| c.kind == "heat_interface");
            interfaces.any(|c| {
                let named = [c.body(), c.text("other")];
                pair.iter().all(|name| named.contains(&Some(name)))
            })
        };
        let solids: Vec<usize> = (0..world.bodies().len())
            .filter(|body| provides(simulation, *body, "temperature"))
            .filter(|body| !flows(&world.body(*body).name))
            .collect();
        if solids.len() < 2 {
            return Ok(Vec::new());
        }
        let mut touching = BTreeSet::new();
        // one body surrounds the other
        let mut joined: BTreeSet<[String; 2]> = BTreeSet::new();
        for &index in &solids {
            let body = world.body(index);
            let exchanges = world.facts::<Rc<Exchange>>(index);
            let around = exchanges.filter_map(|e| e.around.as_ref());
            joined.extend(around.map(|around| {
                let mut pair = [body.name.clone(), world.body(around.body).name.clone()];
                pair.sort();
                pair
            }));
            let free = FreeFaces::new(world, index, "temperature");
            for cell in body.surface(&Face::ALL) {
                let (_, Some(Covered::Body(other))) = free.free_cell(world, body, &cell) else {
                    continue;
                };
                if solids.iter().any(|s| world.body(*s).name == other) {
                    let mut pair = [body.name.clone(), other];
                    pair.sort();
                    touching.insert(pair);
                }
            }
        }
        let sentence = |[one, other]: [String; 2]| {
            format!(
                "bodies `{one}` and `{other}` lie against each other and exchange no heat: there is no coupler `heat_interface` between them"
            )
        };
        touching.retain(|pair| {
            !joined.contains(pair) && !is_joined(pair.each_ref().map(String::as_str))
        });
        Ok(touching.into_iter().map(sentence).collect())
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    const STEEL: &str =
        "[materials.steel]\ndensity = 7800\nspecific_heat = 500\nconductivity = 50\n";

    #[test]
    fn bodies_that_touch_without_an_interface_are_told() {
        let interface = "[[couplers]]\ntype = 'heat_interface'\nbody = 'top'\nother = 'bottom'\n";
        for (start, interface, count) in [(0.01, "", 1), (0.012, "", 0), (0.01, interface, 0)] {
            let body = |name: &str, from: f64| {
                let to = from + 0.01;
                format!(
                    "[bodies.{name}]\nshape.box = {{ min = [0, 0, {from}], max = [0.01, 0.01, {to}] }}\n\
                     spacing = 2e-3\nmaterial = 'steel'\ninitial.temperature = 293.15\n\
                     [[physics]]\ntype = 'thermal'\nhorizon = 1\nbody = '{name}'\n"
                )
            };
            let [bottom, top] = [body("bottom", 0.0), body("top", start)];
            let text = format!("{bottom}{top}{interface}{STEEL}[time]\nend = 1\n");
            let case = Case::parse("two.toml", text, Path::new("")).expect("valid");
            let mut simulation = case.compose().expect("complete");
            case.start(&mut simulation).expect("starts");
            let found = case.touching_bodies(&simulation).expect("read");
            assert_eq!(found.len(), count, "{start}: {found:?}");
        }
    }
}
