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
    metallurgy: Metallurgy,
    time: f64,
}

impl Heated {
    fn try_new(material: &str, keys: &str, initial: f64) -> Result<Self, SetupError> {
        let mut world = World::new(vec![block([1, 1, 1], 1, 0.1, Store::Lattice, material)]);
        let mut metallurgy: Metallurgy = read(keys);
        let mut setup = Setup::new(&mut world, Path::new("."));
        setup.next_physics("heat");
        let temperature = setup.own(0, &keys::TEMPERATURE)?;
        setup.next_physics("metallurgy");
        metallurgy.prepare(&mut setup)?;
        setup.finish().map_err(|(_, e)| e)?;
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
        &self.metallurgy.run.as_ref().expect("prepared").points[0]
    }

    fn share(&self, of: Constituent) -> f64 {
        self.point().share(of)
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
    assert!((heated.share(Constituent::Austenite) - expected).abs() < 1e-12);
    assert!((heated.share(Constituent::Ferrite) - 0.6 * (1.0 - expected)).abs() < 1e-12);
    assert!((heated.share(Constituent::Bainite) - 0.4 * (1.0 - expected)).abs() < 1e-12);
}

/// Shares after heating to 1200 K and cooling at a rate (K/s) in steps of a size (K).
fn cooled(rate: f64, size: f64) -> Heated {
    let mut heated = Heated::new(STEEL, "", 293.15);
    heated.step(1.0, 1200.0);
    heated.step(5.0, 1200.0);
    assert!(heated.share(Constituent::Austenite) > 1.0 - 1e-6);
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
    let of_diffusion = |h: &Heated| h.share(Constituent::Ferrite) + h.share(Constituent::Pearlite);
    assert!(of_diffusion(&slow) > 0.95);
    assert!(medium.share(Constituent::Bainite) > 0.3);
    assert!(fast.share(Constituent::Martensite) > 0.9);
    // the lever rule: 15 / 63.7 of the austenite is left for pearlite
    assert!((slow.share(Constituent::Pearlite) - 0.235).abs() < 0.03);
}

#[test]
fn hardness_rises_with_the_rate_of_cooling() {
    let hardness = [0.1, 30.0, 1000.0].map(|rate| {
        let mut heated = cooled(rate, 5.0);
        heated.metallurgy.observe(&heated.world);
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
    let z = heated.share(Constituent::Martensite);
    let expected = 1e-10 * z * (2.0 - z);
    assert!((heated.field("transformation_compliance") - expected).abs() < 1e-24);
}

/// Maynier, Jungmann and Dollet (1978): hardness by each per cent of C, Si, Mn, Ni, Cr, Mo, V, and that times the logarithm of
/// the rate in K/h.
#[test]
fn hardness_rises_with_each_element_as_published() {
    let published = [
        (
            [223.0, 53.0, 30.0, 12.6, 7.0, 19.0, 0.0],
            [0.0, -19.0, 0.0, 4.0, 8.0, 0.0, 130.0],
        ),
        (
            [185.0, 330.0, 153.0, 65.0, 144.0, 191.0, 0.0],
            [53.0, -55.0, -22.0, -10.0, -20.0, -33.0, 0.0],
        ),
        ([949.0, 27.0, 11.0, 8.0, 16.0, 0.0, 0.0], [0.0; 7]),
    ];
    let with = |content: [f64; 7]| {
        let [c, si, mn, ni, cr, mo, v] = content;
        Composition {
            carbon: c,
            silicon: si,
            manganese: mn,
            nickel: ni,
            chromium: cr,
            molybdenum: mo,
            vanadium: v,
        }
    };
    // K/s, and the logarithm of the rate in K/h
    for (rate, logarithm) in [(1.0 / 3600.0, 0.0), (100.0 / 3600.0, 2.0)] {
        for element in 0..7 {
            let mut content = [0.3; 7];
            let less = with(content).hardness(rate);
            content[element] += 1.0;
            let more = with(content).hardness(rate);
            for (i, (constant, slope)) in published.iter().enumerate() {
                let expected = constant[element] + logarithm * slope[element];
                let found = more[i] - less[i];
                assert!((found - expected).abs() < 1e-9, "{found} {expected}");
            }
        }
    }
    let [ferrite, bainite, martensite] = Composition::default().hardness(10.0 / 3600.0);
    assert!((ferrite - 52.0).abs() < 1e-9 && (bainite + 234.0).abs() < 1e-9);
    assert!((martensite - 148.0).abs() < 1e-9);
}

#[test]
fn temperatures_of_the_composition() {
    let steel = Composition {
        carbon: 0.17,
        manganese: 1.4,
        silicon: 0.3,
        ..Composition::default()
    };
    let celsius = [steel.ac1(), steel.ac3(), steel.martensite_start()].map(|t| t - 273.15);
    for (found, by_hand) in celsius.into_iter().zip([716.75, 797.71, 424.53]) {
        assert!((found - by_hand).abs() < 0.01, "{celsius:?}");
    }
    assert!((steel.equilibrium_austenite(steel.ac3() - 1e-9) - 1.0).abs() < 1e-9);
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
