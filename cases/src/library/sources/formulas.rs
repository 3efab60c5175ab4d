//! Formulas that several entries share.

use nalgebra::Complex;

/// Absorbed fraction of light at normal incidence on a smooth surface (Fresnel) at 1.07 µm, from two rows (wavelength in µm,
/// n, k) of measured optical constants, of which the wavelength lies between.
pub(super) fn absorptivity_1070nm(below: [f64; 3], above: [f64; 3]) -> f64 {
    let part = (1.07 - below[0]) / (above[0] - below[0]);
    let [_, n, k] = std::array::from_fn(|i| below[i] + part * (above[i] - below[i]));
    4.0 * n / ((n + 1.0).powi(2) + k * k)
}

/// Emissivity of a smooth surface at a temperature (K), over all directions and wavelengths: Fresnel's equations by Lambert's
/// and Planck's laws. `optical`: rows (wavelength in µm, n, k), beyond which the body emits nothing that counts.
pub(super) fn hemispherical_emissivity(optical: &[[f64; 3]], temperature: f64) -> f64 {
    let reflected = |n: f64, k: f64, cosine: f64| {
        let index = Complex::new(n, k);
        let inside = (Complex::from(1.0) - (1.0 - cosine * cosine) / (index * index)).sqrt();
        let outside = Complex::from(cosine);
        let across = (outside - index * inside) / (outside + index * inside);
        let along = (index * outside - inside) / (index * outside + inside);
        0.5 * (across.norm_sqr() + along.norm_sqr())
    };
    let middles = |parts: u32| (0..parts).map(move |i| (f64::from(i) + 0.5) / f64::from(parts));
    let angles = 200;
    let emitted = |&[wavelength, n, k]: &[f64; 3]| {
        let lost: f64 = middles(angles)
            .map(|cosine| 2.0 * cosine * reflected(n, k, cosine))
            .sum();
        (wavelength, 1.0 - lost / f64::from(angles))
    };
    let rows: Vec<_> = optical.iter().map(emitted).collect();
    let planck = |wavelength: f64| {
        let radiation_constant = 14_387.77;
        (wavelength.powi(5) * (radiation_constant / (wavelength * temperature)).exp_m1()).recip()
    };
    let (mut sum, mut weight) = (0.0, 0.0);
    for pair in rows.windows(2) {
        let ((from, low), (to, high)) = (pair[0], pair[1]);
        for part in middles(50) {
            let intensity = planck(from + part * (to - from)) * (to - from);
            sum += intensity * (low + part * (high - low));
            weight += intensity;
        }
    }
    sum / weight
}

/// An element.
struct Element {
    /// g/mol.
    molar_mass: f64,
    /// K (CRC Handbook).
    boiling: f64,
    /// Heat of vaporisation at the boiling point, J/mol (JANAF: enthalpies of formation of gas and liquid at 298.15 K and the
    /// integrals of their heat capacities).
    vaporisation: f64,
}

impl Element {
    fn of(symbol: &str) -> Element {
        let [molar_mass, boiling, vaporisation] = match symbol {
            "Fe" => [55.845, 3134.15, 349_576.0],
            "Ni" => [58.693, 3186.15, 377_061.0],
            "Cr" => [51.996, 2944.15, 339_604.0],
            "Mo" => [95.94, 4912.15, 590_040.0],
            "Nb" => [92.906, 5014.15, 690_141.0],
            other => panic!("no data of {other}"),
        };
        Element {
            molar_mass,
            boiling,
            vaporisation,
        }
    }
}

/// A melt that boils at 1 atm.
pub(super) struct Boiling {
    /// K.
    pub(super) temperature: f64,
    /// Heat of vaporisation of the first vapour, J/kg.
    pub(super) heat: f64,
    /// Molar mass of the first vapour, kg/mol.
    pub(super) molar_mass: f64,
}

/// Boiling of a melt by Raoult's law with Clausius and Clapeyron's vapour pressures. `melt`: elements and mass %.
pub(super) fn boiling(melt: &[(&str, f64)]) -> Boiling {
    let moles: f64 = melt
        .iter()
        .map(|(e, w)| w / Element::of(e).molar_mass)
        .sum();
    // partial pressures, atm
    let vapour = |temperature: f64| -> Vec<f64> {
        melt.iter()
            .map(|(e, w)| {
                let element = Element::of(e);
                let over_boiling = 1.0 / temperature - 1.0 / element.boiling;
                let pressure = (-element.vaporisation / 8.314_462 * over_boiling).exp();
                w / element.molar_mass / moles * pressure
            })
            .collect()
    };
    let (mut low, mut high) = (2000.0, 4500.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if vapour(middle).iter().sum::<f64>() > 1.0 {
            high = middle;
        } else {
            low = middle;
        }
    }
    let pressures = vapour(low);
    let sum = |f: fn(Element) -> f64| -> f64 {
        melt.iter()
            .zip(&pressures)
            .map(|((e, _), p)| p * f(Element::of(e)))
            .sum()
    };
    Boiling {
        temperature: low,
        heat: 1e3 * sum(|e| e.vaporisation) / sum(|e| e.molar_mass),
        molar_mass: 1e-3 * sum(|e| e.molar_mass) / pressures.iter().sum::<f64>(),
    }
}

/// Mass fractions times molar values (J/mol, J/(mol K)) over molar masses (g/mol), per kg.
pub(super) fn mixture(parts: &[[f64; 3]]) -> f64 {
    parts
        .iter()
        .map(|[fraction, molar, mass]| 1e3 * fraction * molar / mass)
        .sum()
}

/// Viscosity (Pa s): log10(viscosity / mPa s) = a + b/T.
pub(super) fn viscosity(a: f64, b: f64) -> impl Fn(f64) -> f64 + 'static {
    move |temperature| 1e-3 * 10f64.powf(a + b / temperature)
}

#[test]
fn a_surface_that_reflects_nothing_emits_all_and_a_mirror_nothing() {
    assert!(
        (hemispherical_emissivity(&[[2.0, 1.0, 0.0], [200.0, 1.0, 0.0]], 300.0) - 1.0).abs()
            < 1e-12
    );
    assert!(hemispherical_emissivity(&[[2.0, 1.0, 1e6], [200.0, 1.0, 1e6]], 300.0) < 1e-4);
}

#[test]
fn raoults_law_gives_the_boiling_point_that_kim_has_for_316l() {
    let melt = [("Fe", 69.0), ("Cr", 17.0), ("Ni", 12.0), ("Mo", 2.0)];
    let Boiling { temperature, .. } = boiling(&melt);
    assert!((temperature - 3090.0).abs() < 2.0, "{temperature}");
}
