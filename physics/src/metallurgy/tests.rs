use std::path::Path;

use perimelt_core::body::Store;
use proptest::prelude::*;

use super::transformation::Constituent;
use super::*;
use crate::testing::{block, read};

/// S355: 0.17 % C, 1.4 % Mn, 0.3 % Si.
const STEEL: &str = "density = 7850\ncarbon = 0.17\nmanganese = 1.4\nsilicon = 0.3";

const BARE: &str = "density = 7850";

/// A block whose temperature a test sets, with its microstructure.
struct Heated {
    world: World,
    temperature: Write<f64>,
    metallurgy: RunningMetallurgy,
    time: f64,
}

impl Heated {
    fn try_new(material: &str, keys: &str, initial: f64) -> Result<Self, SetupError> {
        let mut world = World::new(vec![block([1, 1, 1], 1, 0.1, Store::Lattice, material)]);
        let metallurgy: Metallurgy = read(keys);
        let mut setup = Setup::new(&mut world, Path::new("."));
        setup.next_plugin("heat");
        let temperature = setup.own(0, &keys::TEMPERATURE)?;
        setup.next_plugin("metallurgy");
        let mut metallurgy = metallurgy.prepare_steels(&mut setup)?;
        let finished = setup.finish();
        finished.map_err(|mut mistakes| mistakes.swap_remove(0).1)?;
        world.write(temperature).fill(initial);
        metallurgy.start(&world).expect("it starts");
        Ok(Heated {
            world,
            temperature,
            metallurgy,
            time: 0.0,
        })
    }

    fn new(material: &str, keys: &str, initial: f64) -> Self {
        Self::try_new(material, keys, initial).expect("valid")
    }

    fn step(&mut self, size: f64, temperature: f64) {
        self.world.write(self.temperature).fill(temperature);
        let step = Step::new(self.time, size);
        self.metallurgy.advance(&self.world, step).expect("a step");
        self.time += size;
    }

    fn point(&self) -> &Microstructure {
        &self.metallurgy.points[0]
    }

    fn fraction(&self, of: Constituent) -> f64 {
        self.point().fraction(of)
    }

    fn field(&self, name: &str) -> f64 {
        let fields = self.world.fields();
        let index = fields.find(0, name).expect("a field");
        fields.field(index).data().flat()[0]
    }
}

#[test]
fn martensite_is_that_of_koistinen_and_marburger_on_any_path() {
    let keys = "martensite = { start = 673, rate = 0.011 }\ninitial = { austenite = 1 }";
    let mut heated = Heated::new(BARE, keys, 900.0);
    for temperature in [700.0, 650.0, 660.0, 600.0, 620.0, 450.0, 300.0] {
        heated.step(0.3, temperature);
    }
    let expected = 1.0 - (-0.011 * (673.0 - 300.0_f64)).exp();
    assert!((heated.field("martensite") - expected).abs() < 1e-12);
    assert!((heated.field("austenite") - 1.0 + expected).abs() < 1e-12);
}

#[test]
fn bainite_follows_the_isothermal_curves() {
    let keys = "bainite = { temperature = [600, 800], start = [1, 1], end = [20, 20] }\ninitial = { austenite = 1 }";
    let mut heated = Heated::new(BARE, keys, 700.0);
    let n = (0.01_f64.ln() / 0.99_f64.ln()).ln() / 20_f64.ln();
    for step in 1..=20 {
        heated.step(1.0, 700.0);
        let expected = 1.0 - 0.99_f64.powf(f64::from(step).powf(n));
        assert!((heated.field("bainite") - expected).abs() < 1e-12);
    }
}

#[test]
fn austenite_forms_with_its_time_constant_and_from_all_others_alike() {
    let keys = "austenite = { start = 1000, end = 1100, time = 2 }\ninitial = { ferrite = 0.6, bainite = 0.4 }";
    let mut heated = Heated::new(BARE, keys, 1050.0);
    heated.step(3.0, 1050.0);
    let expected = 0.5 * (1.0 - (-1.5_f64).exp());
    assert!((heated.fraction(Constituent::Austenite) - expected).abs() < 1e-12);
    assert!((heated.fraction(Constituent::Ferrite) - 0.6 * (1.0 - expected)).abs() < 1e-12);
    assert!((heated.fraction(Constituent::Bainite) - 0.4 * (1.0 - expected)).abs() < 1e-12);
}

/// Fractions after heating to 1200 K and cooling at a rate (K/s) in steps of a size (K).
fn cooled(rate: f64, size: f64) -> Heated {
    let mut heated = Heated::new(STEEL, "", 293.15);
    heated.step(1.0, 1200.0);
    heated.step(5.0, 1200.0);
    assert!(heated.fraction(Constituent::Austenite) > 1.0 - 1e-6);
    let mut temperature = 1200.0;
    while temperature > 293.15 {
        temperature = (temperature - size).max(293.15);
        heated.step(size / rate, temperature);
    }
    heated
}

#[test]
fn slow_cooling_gives_ferrite_and_pearlite_and_fast_cooling_martensite() {
    let [slow, medium, fast] = [0.1, 30.0, 1000.0].map(|rate| cooled(rate, 5.0));
    let of_diffusion =
        |h: &Heated| h.fraction(Constituent::Ferrite) + h.fraction(Constituent::Pearlite);
    assert!(of_diffusion(&slow) > 0.95);
    assert!(medium.fraction(Constituent::Bainite) > 0.3);
    assert!(fast.fraction(Constituent::Martensite) > 0.9);
    // the lever rule: 15 / 63.7 of the austenite is left for pearlite
    assert!((slow.fraction(Constituent::Pearlite) - 0.235).abs() < 0.03);
}

#[test]
fn hardness_rises_with_the_rate_of_cooling() {
    let hardness = [0.1, 30.0, 1000.0].map(|rate| {
        let mut heated = cooled(rate, 5.0);
        let observed = heated.metallurgy.observe(&heated.world, heated.time);
        observed.expect("valid");
        heated.field("hardness")
    });
    // by hand from the formulas, for pure constituents: 147 at 0.1 K/s, 450 at 1000 K/s
    assert!((hardness[0] - 147.0).abs() < 10.0, "{hardness:?}");
    assert!((hardness[2] - 450.0).abs() < 15.0, "{hardness:?}");
    assert!(hardness[0] < hardness[1] && hardness[1] < hardness[2]);
}

#[test]
fn result_does_not_depend_on_the_size_of_steps() {
    for rate in [1.0, 10.0, 50.0] {
        let (coarse, fine) = (cooled(rate, 20.0), cooled(rate, 0.25));
        for (coarse, fine) in coarse.point().fractions.iter().zip(fine.point().fractions) {
            assert!((coarse - fine).abs() < 0.01, "{rate}: {coarse} {fine}");
        }
    }
}

#[test]
fn transformation_compliance_is_that_of_the_share() {
    let keys = "martensite = { start = 673 }\ninitial = { austenite = 1 }\ntransformation_plasticity = 1e-10";
    let mut heated = Heated::new(BARE, keys, 700.0);
    heated.step(1.0, 600.0);
    heated.step(1.0, 500.0);
    let z = heated.fraction(Constituent::Martensite);
    let expected = 1e-10 * z * (2.0 - z);
    assert!((heated.field("transformation_compliance") - expected).abs() < 1e-24);
}

/// A mixture has the hardness of its constituents by their fractions; austenite that remains counts as martensite.
#[test]
fn hardness_is_that_of_the_mixture() {
    let keys = "initial = { austenite = 0.1, ferrite = 0.2, pearlite = 0.3, bainite = 0.15, martensite = 0.25 }\ninitial_cooling_rate = 2.777777777777778e-4";
    let mut heated = Heated::new("density = 7850\ncarbon = 0.3", keys, 300.0);
    let observed = heated.metallurgy.observe(&heated.world, heated.time);
    observed.expect("valid");
    // 1 K/h, whose logarithm is 0
    let [ferrite_pearlite, bainite, martensite] = [
        42.0 + 223.0 * 0.3,
        -323.0 + 185.0 * 0.3,
        127.0 + 949.0 * 0.3,
    ];
    let expected = 0.5 * ferrite_pearlite + 0.15 * bainite + 0.35 * martensite;
    let found = heated.field("hardness");
    assert!((found - expected).abs() < 1e-9, "{found} {expected}");
    assert_eq!(
        heated.metallurgy.report(&heated.world).numbers[0].value,
        0.1
    );
}

/// Only cooling through 700 °C sets the rate that counts for hardness.
#[test]
fn the_rate_of_cooling_is_that_through_700_degrees() {
    let mut heated = Heated::new(STEEL, "initial_cooling_rate = 7", 1000.0);
    for (size, temperature, rate) in [
        (1.0, 980.0, 7.0),
        (0.5, 973.15, 2.0 * 6.85),
        (1.0, 900.0, 2.0 * 6.85),
        (1.0, 1000.0, 2.0 * 6.85),
        (2.0, 900.0, 50.0),
        (2.0, 1000.0, 50.0),
        // a jump without time has no rate
        (0.0, 900.0, 50.0),
    ] {
        heated.step(size, temperature);
        let found = heated.point().cooling_rate;
        assert!((found - rate).abs() < 1e-9, "{temperature}: {found}");
    }
}

/// Martensite forms below the lowest temperature so far, and anew after the steel was austenite again.
#[test]
fn martensite_forms_again_after_austenite() {
    let keys = "martensite = { start = 673 }\naustenite = { start = 1000, end = 1100, time = 0.01 }\ninitial = { austenite = 1 }";
    let mut heated = Heated::new(BARE, keys, 900.0);
    let left = |temperature: f64| (-0.011 * (673.0 - temperature)).exp();
    let martensite = |heated: &Heated| heated.fraction(Constituent::Martensite);
    heated.step(1.0, 573.0);
    assert!((martensite(&heated) - 1.0 + left(573.0)).abs() < 1e-12);
    // back and forth above the lowest temperature
    heated.step(1.0, 640.0);
    heated.step(1.0, 573.0);
    assert!((martensite(&heated) - 1.0 + left(573.0)).abs() < 1e-12);
    heated.step(1.0, 1150.0);
    heated.step(10.0, 1150.0);
    assert!(martensite(&heated) < 1e-12);
    heated.step(1.0, 623.0);
    assert!((martensite(&heated) - 1.0 + left(623.0)).abs() < 1e-12);
}

/// Without a composition the fraction of austenite in equilibrium rises linearly from its start to its end.
#[test]
fn austenite_of_given_temperatures_is_linear_between_them() {
    let keys = "austenite = { start = 1000, end = 1200, time = 1e-3 }\ninitial = { ferrite = 1 }";
    for (temperature, expected) in [
        (1000.0, 0.0),
        (1050.0, 0.25),
        (1199.0, 0.995),
        (1300.0, 1.0),
    ] {
        let mut heated = Heated::new(BARE, keys, temperature);
        heated.step(1.0, temperature);
        let found = heated.fraction(Constituent::Austenite);
        assert!((found - expected).abs() < 1e-12, "{temperature}: {found}");
    }
}

#[test]
fn a_restart_goes_on_with_the_same_shares() {
    let ready = || {
        let mut heated = Heated::new(STEEL, "", 293.15);
        heated.step(1.0, 1200.0);
        heated.step(1.0, 900.0);
        heated
    };
    let mut first = ready();
    first.step(2.0, 850.0);
    let saved = serde_json::to_string(&first.metallurgy.save(&first.world)).expect("serialises");
    let mut second = ready();
    let mut json = serde_json::Deserializer::from_str(&saved);
    let mut erased = <dyn erased_serde::Deserializer<'_>>::erase(&mut json);
    second
        .metallurgy
        .load(&second.world, &mut erased)
        .expect("what was saved");
    let shares = |heated: &mut Heated| {
        heated.step(2.0, 800.0);
        (heated.point().fractions, heated.point().cooling_rate)
    };
    let (first, second) = (shares(&mut first), shares(&mut second));
    assert_eq!(first, second);
    assert!(first.0[1] > 0.01, "ferrite forms: {first:?}");
}

#[test]
fn laws_that_cannot_be_are_refused() {
    let refusal = |material: &str, keys: &str| {
        let refused = Heated::try_new(material, keys, 300.0);
        refused.err().expect("refused").to_string()
    };
    assert!(refusal(BARE, "").contains("carbon"));
    assert!(refusal(STEEL, "initial = { ferrite = 0.5 }").contains("sum 0.5"));
    let curve = "bainite = { temperature = [600, 800], start = [1, 5], end = [20, 4] }";
    assert!(refusal(STEEL, curve).contains("bainite"));
    assert!(refusal(STEEL, "austenite = { start = 1000, end = 900 }").contains("900"));
    assert!(refusal(STEEL, "transformation_plasticity = 1e-4").contains("0.0001"));
    for (keys, key) in [
        ("grain_size = -6", "grain_size"),
        ("grain_size = 21", "grain_size"),
        (
            "transformation_plasticity = -1e-12",
            "transformation_plasticity",
        ),
        ("initial_cooling_rate = 0", "initial_cooling_rate"),
        (
            "initial = { ferrite = 1.5, bainite = -0.5 }",
            "shares from 0 to 1",
        ),
        ("austenite = { start = 1000, end = 1000 }", "austenite.end"),
        ("austenite = { start = 0, end = 1000 }", "austenite.end"),
        (
            "austenite = { start = 1000, end = 1100, time = 0 }",
            "austenite.time",
        ),
        ("martensite = { start = 0 }", "martensite.start"),
        ("martensite = { start = 600, rate = 0 }", "martensite.rate"),
        (
            "bainite = { temperature = [600, 800], start = [0, 1], end = [20, 4] }",
            "bainite",
        ),
        (
            "bainite = { temperature = [600, 800], start = [1, 1], end = [20] }",
            "bainite",
        ),
        (
            "bainite = { temperature = [600, 800], start = [1, 1], end = [1, 4] }",
            "bainite",
        ),
        ("initial_cooling_rate = -1", "initial_cooling_rate"),
        (
            "austenite = { start = 1000, end = 1100, time = -1 }",
            "austenite.time",
        ),
        ("martensite = { start = -600 }", "martensite.start"),
        (
            "martensite = { start = 600, rate = -0.011 }",
            "martensite.rate",
        ),
    ] {
        let refused = refusal(STEEL, keys);
        assert!(refused.contains(key), "{keys}: {refused}");
    }
}

proptest! {
    #[test]
    fn shares_stay_shares_on_any_path(
        path in prop::collection::vec((300.0..1500.0_f64, -3.0..2.0_f64), 1..30),
    ) {
        let mut heated = Heated::new(STEEL, "", 300.0);
        for (temperature, time) in path {
            heated.step(10_f64.powf(time), temperature);
            let shares = heated.point().fractions;
            prop_assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            prop_assert!(shares.iter().all(|s| (-1e-15..=1.0 + 1e-12).contains(s)), "{shares:?}");
        }
    }
}
