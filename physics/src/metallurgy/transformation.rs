//! Transformation of the constituents of a point over a step.

use serde::{Deserialize, Serialize};

use super::composition::Composition;
use super::kinetics::Kinetics;

/// Constituents of steel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Constituent {
    /// Stable at high temperature.
    Austenite,
    /// Forms by diffusion between `Ac3` and the start of bainite.
    Ferrite,
    /// Forms by diffusion between `Ac1` and the start of bainite.
    Pearlite,
    /// Forms by diffusion below the start of bainite.
    Bainite,
    /// Forms without diffusion below the start of martensite.
    Martensite,
}

/// Number of constituents.
pub const CONSTITUENTS: usize = 5;

/// Constituents that form by diffusion, in the order of [`Steel::reactions`].
const BY_DIFFUSION: [Constituent; 3] = [
    Constituent::Ferrite,
    Constituent::Pearlite,
    Constituent::Bainite,
];

/// Largest change of temperature in a sub-step, K.
const RESOLUTION: f64 = 1.0;

/// Largest fraction transformed in a sub-step where more than one constituent forms.
const LARGEST_FRACTION: f64 = 0.01;

/// Temperature at which the cooling rate determines the hardness, K (700 °C).
const HARDNESS_TEMPERATURE: f64 = 973.15;

/// Formation of austenite (Leblond and Devaux 1984): `da/dt = (a_eq(T) - a) / time`.
#[derive(Clone, Copy, Debug)]
pub struct Austenitisation {
    /// Temperature at which it begins, K.
    pub start: f64,
    /// Temperature at which all is austenite in equilibrium, K.
    pub end: f64,
    /// Time constant, s.
    pub time: f64,
}

/// Formation of martensite (Koistinen and Marburger 1959): the fraction `exp(-rate (start - T))` of the austenite remains.
#[derive(Clone, Copy, Debug)]
pub struct MartensiteLaw {
    /// Temperature at which it begins, K.
    pub start: f64,
    /// 1/K.
    pub rate: f64,
}

/// Laws of a steel; a constituent without a law does not form.
#[derive(Clone, Debug)]
pub struct Steel {
    /// Law of austenite.
    pub austenite: Option<Austenitisation>,
    /// Laws of ferrite, pearlite and bainite.
    pub reactions: [Option<Kinetics>; 3],
    /// Law of martensite.
    pub martensite: Option<MartensiteLaw>,
    /// Composition, for equilibrium and hardness.
    pub composition: Option<Composition>,
}

/// Constituents of a point and the state of their transformation.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Microstructure {
    /// Fractions by [`Constituent`], with the sum 1.
    pub fractions: [f64; CONSTITUENTS],
    /// Temperature, K.
    pub temperature: f64,
    /// Lowest temperature since austenite formed, K.
    lowest: f64,
    /// Cooling rate at the last cooling through 700 °C, K/s.
    pub cooling_rate: f64,
}

impl Microstructure {
    /// Constituents at a temperature (K) that formed at a cooling rate (K/s at 700 °C).
    pub fn new(fractions: [f64; CONSTITUENTS], temperature: f64, cooling_rate: f64) -> Self {
        Microstructure {
            fractions,
            temperature,
            lowest: temperature,
            cooling_rate,
        }
    }

    /// Fraction of a constituent.
    pub fn fraction(&self, of: Constituent) -> f64 {
        self.fractions[of as usize]
    }

    fn austenite(&mut self) -> &mut f64 {
        &mut self.fractions[Constituent::Austenite as usize]
    }

    /// Transforms an amount of austenite into a constituent.
    fn form(&mut self, of: Constituent, amount: f64) {
        *self.austenite() -= amount;
        self.fractions[of as usize] += amount;
    }
}

impl Steel {
    /// Fraction of austenite in equilibrium at a temperature (K).
    fn equilibrium(&self, law: &Austenitisation, temperature: f64) -> f64 {
        if temperature <= law.start {
            return 0.0;
        }
        match &self.composition {
            // the lever rule holds for the temperatures of the composition
            Some(c) if (law.start, law.end) == (c.ac1(), c.ac3()) => {
                c.equilibrium_austenite(temperature)
            }
            _ => ((temperature - law.start) / (law.end - law.start)).min(1.0),
        }
    }

    /// Largest fraction of ferrite at a temperature (K): the fraction in equilibrium with austenite; below `Ac1`, where the rest
    /// becomes pearlite, the fraction at `Ac1`.
    fn most_ferrite(&self, temperature: f64) -> f64 {
        match (&self.composition, &self.austenite) {
            (Some(c), _) => 1.0 - c.equilibrium_austenite(temperature.max(c.ac1())),
            (None, Some(law)) => 1.0 - self.equilibrium(law, temperature),
            (None, None) => 1.0,
        }
    }

    /// Transforms a point whose temperature changes linearly to `end` (K) over `time` (s).
    pub fn follow(&self, point: &mut Microstructure, end: f64, time: f64) {
        let start = std::mem::replace(&mut point.temperature, end);
        if start > HARDNESS_TEMPERATURE && end <= HARDNESS_TEMPERATURE && time > 0.0 {
            point.cooling_rate = (start - end) / time;
        }
        let above = self.austenite.is_some_and(|law| start.max(end) > law.start);
        if !above && *point.austenite() <= 0.0 {
            return;
        }
        let smallest = RESOLUTION / (end - start).abs();
        let mut elapsed = 0.0;
        while elapsed < 1.0 {
            let mut fraction = smallest.min(1.0 - elapsed);
            let at = |elapsed: f64| start + elapsed * (end - start);
            // a remainder by rounding belongs to this sub-step
            if 1.0 - elapsed - fraction < 1e-9 {
                fraction = 1.0 - elapsed;
            }
            let temperatures = [at(elapsed + 0.5 * fraction), at(elapsed + fraction)];
            fraction *= self.sub_step(point, temperatures, fraction * time);
            elapsed += fraction;
        }
    }

    /// One sub-step with the temperatures (K) at its middle and end; returns the fraction of its `time` (s) that it covered.
    fn sub_step(&self, point: &mut Microstructure, [middle, end]: [f64; 2], time: f64) -> f64 {
        let mut done = 1.0;
        let formed = self.form_by_diffusion(point, middle, time);
        let total: f64 = formed.iter().sum();
        let several = formed.iter().filter(|f| **f > 0.0).count() > 1;
        let formed = if several && total > LARGEST_FRACTION {
            done = (LARGEST_FRACTION / total).max(1e-3);
            self.form_by_diffusion(point, middle, done * time)
        } else {
            formed
        };
        for (constituent, amount) in BY_DIFFUSION.into_iter().zip(formed) {
            let left = *point.austenite();
            point.form(constituent, amount.min(left));
        }
        if let Some(law) = &self.austenite {
            self.austenitise(point, law, middle, done * time);
        }
        if let Some(law) = self.martensite.filter(|_| done == 1.0) {
            let from = point.lowest.min(law.start);
            if end < from {
                let formed = -(-law.rate * (from - end)).exp_m1() * *point.austenite();
                point.form(Constituent::Martensite, formed);
            }
            point.lowest = point.lowest.min(end);
        }
        done
    }

    /// Fractions of ferrite, pearlite and bainite that form at a temperature (K) over `time` (s).
    fn form_by_diffusion(&self, point: &Microstructure, temperature: f64, time: f64) -> [f64; 3] {
        let mut formed = [0.0; 3];
        let austenite = point.fraction(Constituent::Austenite);
        if austenite <= 0.0 {
            return formed;
        }
        for (index, constituent) in BY_DIFFUSION.into_iter().enumerate() {
            let Some(law) = &self.reactions[index] else {
                continue;
            };
            let present = point.fraction(constituent);
            let available = match constituent {
                Constituent::Ferrite => (self.most_ferrite(temperature) - present).min(austenite),
                _ => austenite,
            };
            if available > 0.0 {
                let whole = present + available;
                let x = present / whole;
                formed[index] = (law.after(x, temperature, time) - x).max(0.0) * whole;
            }
        }
        formed
    }

    /// Forms austenite from all other constituents in proportion.
    fn austenitise(&self, point: &mut Microstructure, law: &Austenitisation, at: f64, time: f64) {
        let present = *point.austenite();
        let missing = self.equilibrium(law, at) - present;
        if missing <= 0.0 || present >= 1.0 {
            return;
        }
        let formed = -missing * (-time / law.time).exp_m1();
        let left = 1.0 - formed / (1.0 - present);
        point.fractions.iter_mut().for_each(|f| *f *= left);
        *point.austenite() = present + formed;
        point.lowest = f64::INFINITY;
    }

    /// Vickers hardness; austenite that remains counts as martensite. `None` without a composition.
    pub fn hardness(&self, point: &Microstructure) -> Option<f64> {
        let [ferrite_pearlite, bainite, martensite] =
            self.composition?.hardness(point.cooling_rate);
        let [austenite, f, p, b, m] = point.fractions;
        Some((f + p) * ferrite_pearlite + b * bainite + (m + austenite) * martensite)
    }
}
