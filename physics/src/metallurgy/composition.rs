//! Transformations and hardness of low-alloy steels by their composition.
//!
//! - `Ac1`, `Ac3`, `Ms`: Andrews, K. W. (1965), Empirical formulae for the calculation of some transformation
//!   temperatures, J. Iron Steel Inst. 203, 721-727; the linear formulas.
//! - start of bainite and kinetics of ferrite, pearlite and bainite: Li, M. V., Niebuhr, D. V., Meekisho, L. L.,
//!   Atteridge, D. G. (1998), A computational model for the prediction of steel hardenability, Metall. Mater. Trans. B
//!   29, 661-672, a refit of Kirkaldy and Venugopalan (1984).
//! - kinetics of plain carbon steel with 0.3 % carbon and more: Kirkaldy, J. S., Venugopalan, D. (1984), Prediction of
//!   microstructure and hardenability in low alloy steels, in: Phase transformations in ferrous alloys, AIME, 125-148. The
//!   refit, whose factors grow with `exp(6.31 C)` to `exp(10.18 C)`, leaves too much of such a steel to martensite.
//! - hardness: Maynier, P., Jungmann, B., Dollet, J. (1978), Creusot-Loire system for the prediction of the mechanical
//!   properties of low alloy steel products, in: Hardenability concepts with applications to steel, AIME, 518-545.
//!
//! The formulas were fitted to steels of up to about 0.6 % carbon and 5 % of other elements.

use std::sync::Arc;

use perimelt_core::material::{Material, MaterialError};

use super::kinetics::{Kinetics, Kirkaldy, LI, Sigmoid, activation};

/// Zero of degrees Celsius, K.
const ZERO_CELSIUS: f64 = 273.15;

/// Carbon that ferrite dissolves, mass %.
const IN_FERRITE: f64 = 0.02;

/// Least carbon (mass %) from which plain carbon steel follows Kirkaldy and Venugopalan.
const PLAIN_CARBON: f64 = 0.3;

/// Most nickel, chromium, molybdenum and vanadium together, and most manganese, of plain carbon steel (SAE J403), mass %.
const RESIDUAL: f64 = 0.3;
const MOST_MANGANESE: f64 = 1.65;

/// Content of the elements of the formulas, mass %.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Composition {
    /// C.
    pub carbon: f64,
    /// Mn.
    pub manganese: f64,
    /// Si.
    pub silicon: f64,
    /// Ni.
    pub nickel: f64,
    /// Cr.
    pub chromium: f64,
    /// Mo.
    pub molybdenum: f64,
    /// V.
    pub vanadium: f64,
}

impl Composition {
    /// Composition of a material; `None` without `carbon`. Elements that are not given are absent.
    ///
    /// # Errors
    /// A content that depends on temperature.
    pub fn of(material: &Material) -> Result<Option<Self>, MaterialError> {
        if material.get("carbon").is_none() {
            return Ok(None);
        }
        let content = |element: &str| match material.get(element) {
            None => Ok(0.0),
            Some(_) => material.constant(element),
        };
        Ok(Some(Composition {
            carbon: content("carbon")?,
            manganese: content("manganese")?,
            silicon: content("silicon")?,
            nickel: content("nickel")?,
            chromium: content("chromium")?,
            molybdenum: content("molybdenum")?,
            vanadium: content("vanadium")?,
        }))
    }

    /// Temperature at which austenite begins to form, K.
    pub fn ac1(&self) -> f64 {
        let celsius = 723.0 - 10.7 * self.manganese - 16.9 * self.nickel
            + 29.1 * self.silicon
            + 16.9 * self.chromium;
        celsius + ZERO_CELSIUS
    }

    /// Temperature at which the last ferrite has transformed, K.
    pub fn ac3(&self) -> f64 {
        self.ac3_without_carbon() - 203.0 * self.carbon.sqrt()
    }

    /// `Ac3` of the composition without its carbon, K.
    fn ac3_without_carbon(&self) -> f64 {
        let celsius = 910.0 - 15.2 * self.nickel
            + 44.7 * self.silicon
            + 104.0 * self.vanadium
            + 31.5 * self.molybdenum
            - 30.0 * self.manganese
            - 11.0 * self.chromium;
        celsius + ZERO_CELSIUS
    }

    /// Temperature at which bainite begins to form, K.
    pub fn bainite_start(&self) -> f64 {
        let celsius = 637.0
            - 58.0 * self.carbon
            - 35.0 * self.manganese
            - 15.0 * self.nickel
            - 34.0 * self.chromium
            - 41.0 * self.molybdenum;
        celsius + ZERO_CELSIUS
    }

    /// Temperature at which martensite begins to form, K.
    pub fn martensite_start(&self) -> f64 {
        let celsius = 539.0
            - 423.0 * self.carbon
            - 30.4 * self.manganese
            - 17.7 * self.nickel
            - 12.1 * self.chromium
            - 7.5 * self.molybdenum;
        celsius + ZERO_CELSIUS
    }

    /// Fraction of austenite in equilibrium between `Ac1` and `Ac3`, by the lever rule: the austenite has the carbon at
    /// which its `Ac3` is the temperature (K), ferrite has 0.02 %.
    pub fn equilibrium_austenite(&self, temperature: f64) -> f64 {
        let of_austenite = ((self.ac3_without_carbon() - temperature) / 203.0).powi(2);
        let fraction = (self.carbon - IN_FERRITE) / (of_austenite - IN_FERRITE);
        if temperature >= self.ac3() || fraction.is_nan() {
            1.0
        } else {
            fraction.clamp(0.0, 1.0)
        }
    }

    /// Whether this is a plain carbon steel with enough carbon for Kirkaldy and Venugopalan (1984).
    pub fn is_plain_carbon(&self) -> bool {
        let residual = self.nickel + self.chromium + self.molybdenum + self.vanadium;
        self.carbon >= PLAIN_CARBON && residual <= RESIDUAL && self.manganese <= MOST_MANGANESE
    }

    /// Kinetics of ferrite, pearlite and bainite for austenite of an ASTM grain size number.
    pub fn kinetics(&self, grain_size: f64) -> [Kinetics; 3] {
        match self.is_plain_carbon() {
            true => self.kinetics_of_kirkaldy(grain_size),
            false => self.kinetics_of_li(grain_size),
        }
    }

    /// Kirkaldy and Venugopalan (1984), as quoted by Li et al. (1998).
    fn kinetics_of_kirkaldy(&self, grain_size: f64) -> [Kinetics; 3] {
        let Composition {
            carbon: c,
            manganese: mn,
            nickel: ni,
            chromium: cr,
            molybdenum: mo,
            ..
        } = *self;
        let grains: f64 = (0.5 * (grain_size - 1.0)).exp2();
        let form = |slowing: f64| Arc::new(Sigmoid::new(2.0 / 3.0, slowing));
        let slowing = 1.9 * c + 2.5 * mn + 0.9 * ni + 1.7 * cr + 4.0 * mo - 2.6;
        let bainite_start = self.bainite_start();
        [
            Kirkaldy {
                factor: (59.6 * mn + 1.45 * ni + 67.7 * cr + 244.0 * mo).max(0.1) / grains,
                exponent: 3,
                range: bainite_start..self.ac3(),
                resistances: [(1.0, activation(23_500.0)), (0.0, 0.0)],
                form: form(0.0),
            },
            Kirkaldy {
                factor: (1.79 + 5.42 * (cr + mo + 4.0 * mo * ni)) / grains,
                exponent: 3,
                range: bainite_start..self.ac1(),
                resistances: [
                    (1.0, activation(27_500.0)),
                    (0.01 * cr + 0.52 * mo, activation(37_000.0)),
                ],
                form: form(0.0),
            },
            Kirkaldy {
                factor: 1e-4 * (2.34 + 10.1 * c + 3.8 * cr + 19.0 * mo) / grains,
                exponent: 2,
                range: self.martensite_start()..bainite_start,
                resistances: [(1.0, activation(27_500.0)), (0.0, 0.0)],
                form: form(slowing.max(0.0)),
            },
        ]
        .map(Kinetics::Kirkaldy)
    }

    /// Li et al. (1998), eqs. 10-12.
    fn kinetics_of_li(&self, grain_size: f64) -> [Kinetics; 3] {
        let Composition {
            carbon: c,
            manganese: mn,
            silicon: si,
            nickel: ni,
            chromium: cr,
            molybdenum: mo,
            ..
        } = *self;
        let ferrite = 1.00 + 6.31 * c + 1.78 * mn + 0.31 * si + 1.12 * ni + 2.70 * cr + 4.06 * mo;
        let pearlite =
            -4.25 + 4.12 * c + 4.36 * mn + 0.44 * si + 1.71 * ni + 3.33 * cr + 5.19 * mo.sqrt();
        let bainite = -10.23 + 10.18 * c + 0.85 * mn + 0.55 * ni + 0.90 * cr + 0.36 * mo;
        let factor = |logarithm: f64, grain: f64| logarithm.exp() / (grain * grain_size).exp2();
        let bainite_start = self.bainite_start();
        [
            (factor(ferrite, 0.41), 3, bainite_start..self.ac3()),
            (factor(pearlite, 0.32), 3, bainite_start..self.ac1()),
            (
                factor(bainite, 0.29),
                2,
                self.martensite_start()..bainite_start,
            ),
        ]
        .map(|(factor, exponent, range)| {
            Kinetics::Kirkaldy(Kirkaldy {
                factor,
                exponent,
                range,
                resistances: [(1.0, activation(27_500.0)), (0.0, 0.0)],
                form: LI.clone(),
            })
        })
    }

    /// Vickers hardness of ferrite-pearlite, bainite and martensite that formed at a rate of cooling (K/s at 700 °C).
    pub fn hardness(&self, cooling_rate: f64) -> [f64; 3] {
        let Composition {
            carbon: c,
            manganese: mn,
            silicon: si,
            nickel: ni,
            chromium: cr,
            molybdenum: mo,
            vanadium: v,
        } = *self;
        // logarithm of the rate in K/h
        let rate = (3600.0 * cooling_rate).max(1.0).log10();
        let ferrite_pearlite = 42.0
            + 223.0 * c
            + 53.0 * si
            + 30.0 * mn
            + 12.6 * ni
            + 7.0 * cr
            + 19.0 * mo
            + (10.0 - 19.0 * si + 4.0 * ni + 8.0 * cr + 130.0 * v) * rate;
        let bainite = -323.0
            + 185.0 * c
            + 330.0 * si
            + 153.0 * mn
            + 65.0 * ni
            + 144.0 * cr
            + 191.0 * mo
            + (89.0 + 53.0 * c - 55.0 * si - 22.0 * mn - 10.0 * ni - 20.0 * cr - 33.0 * mo) * rate;
        let martensite =
            127.0 + 949.0 * c + 27.0 * si + 11.0 * mn + 8.0 * ni + 16.0 * cr + 21.0 * rate;
        [ferrite_pearlite, bainite, martensite]
    }
}

#[cfg(test)]
mod tests;
