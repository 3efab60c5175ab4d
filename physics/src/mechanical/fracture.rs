//! Fracture: bonds break irreversibly at a critical stretch or energy.
//!
//! ```text
//! s - e >= s_c                      stretch,    Gao (2020), eqs. 2.13 and 2.14
//! (T_ij + T_ji) |xi| (s - e) / 2 >= w kappa     energy of the bond, after Foster et al. (2011)
//! phi = 1 - sum_unbroken w / sum w              Gao (2020), eq. 2.15
//! ```
//!
//! with the thermo-elastic stretch `s - e`, in tension only; `s_c`, `kappa` and `e` are the means of both
//! ends, but for bonds between materials and across [`interfaces`](super::interfaces). The limits follow from the fracture energy G, which is the energy to break all bonds across a plane:
//!
//! ```text
//! G = s_c^2 horizon { 2 (d + 2) mu A + 2 a B },   kappa = 2 G, pi/2 G, 4/3 G  in 1D, 2D, 3D
//! A = m_3/(4 m_2), m_4/(pi m_3), 3 m_5/(8 m_4),   m_p = integral of w r^(p - 1) dr from 0 to 1
//! B = 0, 16/(9 pi^2), (3/4)^4
//! ```
//!
//! with the dilatation stiffness a. A is derived for any influence function w; the constant one
//! gives the published 6 mu/pi and 3 mu. B is that of the publication, for the constant influence; its 3D form has
//! `K - 2 mu` in place of `K - 5/3 mu`, which is not zero for the bond-based solid. Correspondence solids break by
//! stretch, at the limit of ordinary state-based ones.

mod state;

use std::sync::OnceLock;

use perimelt_core::body::Horizons;
use perimelt_core::family::BrokenBonds;
use perimelt_core::material::Property;
use perimelt_core::solver::Reducer;
use perimelt_core::{Body, Bond, Family, Setup, SetupError};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::exceeding::{Breakable, Exceeding, broken_pairs, lost_fraction};
use super::interfaces::{Crossings, Interfaces, Limit, OneOrMany};
use super::moduli::Moduli;
pub use state::{FractureState, SavedFracture};

/// When bonds break: at the `fracture_energy` or the `critical_stretch` of the material.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct FractureSection {
    /// What is compared with its limit.
    pub criterion: Criterion,
    /// How the limit of the bonds of plies follows from the fracture energy.
    pub limits: Limits,
    /// Exponent m of `(E_I / G_I)^m + (E_II / G_II)^m = 1` \[WuReuter1965\], at which the interface of a point between plies breaks as a whole:
    /// 1 for the sum of the energies of opening and sliding. Without, both break by themselves.
    pub mixed_mode_exponent: Option<f64>,
    /// Regions whose bonds never break, such as those under loads.
    pub no_fail: Vec<String>,
    /// Strength of an interface, or of a list of them, such as
    /// `interface = { between = ["steel", "glue"], fracture_energy = 100 }`. Without, a bond between two materials has the
    /// smaller limit of both.
    #[schemars(with = "OneOrMany")]
    pub interface: Interfaces,
    /// In each step break all bonds beyond their limit, and find no equilibrium without them: an indicator of where damage
    /// starts. By default, the bonds under the largest loads break and equilibrium is found again, until none is beyond
    /// its limit. Not for the explicit solver.
    pub once: bool,
}

impl FractureSection {
    /// By point, whether its bonds never break.
    ///
    /// # Errors
    /// An unknown region.
    pub(super) fn unbreakable(
        &self,
        setup: &Setup<'_>,
        body: usize,
    ) -> Result<Vec<bool>, SetupError> {
        let mut unbreakable = vec![false; setup.body(body).points.len()];
        for name in &self.no_fail {
            for &point in &setup.region(body, "fracture.no_fail", name)?.points {
                unbreakable[point as usize] = true;
            }
        }
        Ok(unbreakable)
    }
}

/// How the limit of the bonds of a ply follows from its fracture energy.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Limits {
    /// From the energy of the discrete bonds that a plane cuts, which dissipate the given fracture energy.
    #[default]
    Discrete,
    /// That of the matrix by \[Gao2020\], eq. 4.38, from isotropic constants: a crack along the fibres dissipates more than the given energy.
    Published,
}

/// Criterion by which a bond breaks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Criterion {
    /// Its thermo-elastic stretch.
    #[default]
    Stretch,
    /// The energy that it stores; needs the `fracture_energy`. Not available for `correspondence`, whose bonds have
    /// no energy of their own.
    Energy,
}

/// Strength and broken bonds of a body.
#[derive(Debug)]
pub struct Fracture {
    criterion: Criterion,
    dimension: usize,
    /// By material.
    strength: Vec<Strength>,
    /// m, by point.
    horizon: Horizons,
    unbreakable: Vec<bool>,
    /// Bonds with limits of their own.
    crossings: Crossings,
    /// `A` of the energy of stretched bonds.
    crossing: f64,
    /// Critical stretch, or kappa in J/m², of each point at its present temperature.
    pub critical: Vec<f64>,
    /// Sum of the excess of the bonds of each point over their limits; zero where no bond exceeds its limit.
    pub excess: Vec<f64>,
    /// Broken bonds.
    pub state: FractureState,
    /// The points with bonds to those of other processes, found when they are needed first.
    beside_remote: OnceLock<Vec<u32>>,
}

/// Bonds that broke in one evaluation.
#[derive(Clone, Debug, Default)]
pub struct NewBreaks {
    /// Pairs of points that lost their bond.
    pub pairs: Vec<[u32; 2]>,
    /// Whether any bond broke, including bonds to a layer.
    pub any: bool,
}

/// How the bonds of a body are loaded.
pub struct BondLoads<R, C> {
    /// Load of a bond over the mean limit of its ends, from the slots of both.
    pub ratio: R,
    /// Stress conjugate to the eigenstrain that the bond of a point with a slot carries along itself, Pa.
    pub conjugate: C,
}

/// Energy of a bond at an elastic stretch, over its initial stiffness.
pub(super) type BondEnergy<'a> = &'a (dyn Fn(f64) -> f64 + Sync);

/// The stretch at which an energy, near its square, has a value; infinite where it does not reach it.
fn stretch_of_energy(value: f64, energy: impl Fn(f64) -> f64) -> f64 {
    /// Beyond the stretch of any bond.
    const LARGEST: f64 = 1e6;
    let (mut low, mut high) = (0.0, value.sqrt());
    while !(energy(high) > value) {
        (low, high) = (high, 2.0 * high);
        if !(high < LARGEST) {
            return f64::INFINITY;
        }
    }
    for _ in 0..f64::MANTISSA_DIGITS {
        let middle = 0.5 * (low + high);
        match energy(middle) > value {
            true => high = middle,
            false => low = middle,
        }
    }
    high
}

#[derive(Debug)]
enum Strength {
    Stretch(Property),
    Energy(Property),
}

impl Fracture {
    /// Takes the strengths of the materials of a body.
    ///
    /// # Errors
    /// A material without strength, an unknown region or interface.
    pub fn of(
        section: &FractureSection,
        setup: &mut Setup<'_>,
        body: usize,
        family: &Family,
    ) -> Result<Self, SetupError> {
        let FractureSection {
            interface,
            criterion,
            ..
        } = section;
        let of_plies = [
            ("limits", section.limits == Limits::Published),
            ("mixed_mode_exponent", section.mixed_mode_exponent.is_some()),
        ];
        if let Some((key, _)) = of_plies.iter().find(|(_, is_given)| *is_given) {
            let message = format!("`{key}` belongs to plies");
            let expected = format!("no `{key}`, or `law.lamina`");
            let key = format!("fracture.{key}");
            return Err(SetupError::value(key, message, expected));
        }
        let crossings = Crossings::of(interface, *criterion, setup, body, family)?;
        let this = setup.body(body);
        let strength = this.materials.iter().map(|material| {
            let of = |name| material.get(name).cloned();
            let stretch = match section.criterion {
                Criterion::Stretch => of("critical_stretch").map(Strength::Stretch),
                Criterion::Energy => None,
            };
            let strength = stretch.or_else(|| of("fracture_energy").map(Strength::Energy));
            strength.ok_or_else(|| {
                let message = format!("material `{}` has no strength", material.name());
                let expected = match section.criterion {
                    Criterion::Stretch => "`fracture_energy` (J/m²) or `critical_stretch`",
                    Criterion::Energy => "`fracture_energy` (J/m²)",
                };
                SetupError::value("fracture", message, expected)
            })
        });
        let strength = strength.collect::<Result<Vec<_>, _>>()?;
        let points = this.points.len();
        let reducer = setup.world().reducer(body);
        // rows of bits have the same length in all processes
        let most_bonds = reducer.max(family.most_bonds() as f64) as usize;
        let unbreakable = section.unbreakable(setup, body)?;
        let spec = family.spec();
        let moment = |power| spec.influence.radial_moment(power);
        Ok(Fracture {
            criterion: section.criterion,
            dimension: this.dimension,
            strength,
            horizon: Horizons::of(&this.points, spec.horizon),
            unbreakable,
            crossings,
            crossing: match this.dimension {
                1 => moment(3) / (4.0 * moment(2)),
                2 => moment(4) / (std::f64::consts::PI * moment(3)),
                _ => 3.0 * moment(5) / (8.0 * moment(4)),
            },
            critical: vec![f64::INFINITY; points],
            excess: vec![0.0; points],
            state: FractureState::intact(family.unbroken_of(most_bonds), points),
            beside_remote: OnceLock::new(),
        })
    }

    /// Whether the energy of bonds is compared, not their stretch.
    pub fn compares_energy(&self) -> bool {
        self.criterion == Criterion::Energy
    }

    /// Bonds that broke.
    pub fn broken(&self) -> &BrokenBonds {
        &self.state.broken[0]
    }

    /// Whether strengths are the same at all temperatures.
    pub fn is_constant(&self) -> bool {
        let constant = |s: &Strength| match s {
            Strength::Stretch(p) | Strength::Energy(p) => p.is_constant(),
        };
        self.strength.iter().all(constant)
    }

    /// Evaluates the limit of each point at its temperature, K; `bond` is the energy of a bond whose law is not linear.
    pub fn load(
        &mut self,
        body: &Body,
        temperature: Option<&[f64]>,
        moduli: impl Fn(usize) -> Moduli + Sync,
        bond: Option<BondEnergy<'_>>,
    ) {
        for i in 0..self.critical.len() {
            if self.unbreakable[i] {
                continue;
            }
            let at = |p: &Property| p.at(temperature.map_or(0.0, |t| t[i]), 0.0);
            self.critical[i] = match (
                &self.strength[body.material_of_point[i] as usize],
                self.criterion,
            ) {
                (Strength::Stretch(stretch), _) => at(stretch),
                (Strength::Energy(energy), _) => {
                    self.limit_of_energy(at(energy), [i; 2], &moduli, bond)
                }
            };
        }
        let mut crossings = std::mem::take(&mut self.crossings);
        crossings.load(&self.critical, |limit, ends| match limit {
            Limit::Stretch(stretch) => stretch,
            Limit::Energy(energy) => self.limit_of_energy(energy, ends, &moduli, bond),
        });
        self.crossings = crossings;
    }

    /// Limit of a bond whose fracture energy is given, J/m², with the mean stiffness of both ends.
    fn limit_of_energy(
        &self,
        energy: f64,
        ends: [usize; 2],
        moduli: &impl Fn(usize) -> Moduli,
        bond: Option<BondEnergy<'_>>,
    ) -> f64 {
        if self.compares_energy() {
            let factors = [2.0, std::f64::consts::FRAC_PI_2, 4.0 / 3.0];
            return factors[self.dimension - 1] * energy;
        }
        let of_square = |i: usize| {
            let [bonds, dilatation] = self.energies_of_square(&moduli(i));
            (bonds + dilatation) * self.horizon[i]
        };
        let [own, other] = ends.map(of_square);
        let linear = (energy / (0.5 * (own + other))).sqrt();
        let Some(bond) = bond else {
            return linear;
        };
        let fractions = ends.map(|i| {
            let [bonds, dilatation] = self.energies_of_square(&moduli(i));
            bonds / (bonds + dilatation)
        });
        let fraction = 0.5 * (fractions[0] + fractions[1]);
        stretch_of_energy(linear * linear, |stretch| {
            2.0 * fraction * bond(stretch) + (1.0 - fraction) * stretch * stretch
        })
    }

    /// Adds what bonds with limits of their own exceed them by; `ratio` is the load over the mean limit of the ends of a
    /// bond, from the slots of both.
    pub(super) fn add_excess_of_crossings(
        &mut self,
        family: &Family,
        ratio: impl Fn(&Bond, usize, usize) -> f64 + Sync,
    ) {
        if self.crossings.is_empty() {
            return;
        }
        let broken = &self.state.broken[0];
        let is_broken = |point: usize, bond: usize| broken.is_broken(point, bond);
        self.crossings
            .add_excess(family, is_broken, ratio, &mut self.excess);
    }

    /// Energies of bonds and dilatation at a crack over horizon and square of the critical stretch, Pa.
    fn energies_of_square(&self, moduli: &Moduli) -> [f64; 2] {
        use std::f64::consts::PI;
        let dilatation = [0.0, 16.0 / (9.0 * PI * PI), 0.75f64.powi(4)][self.dimension - 1];
        [
            moduli.bond_stiffness(self.dimension) * self.crossing,
            2.0 * moduli.dilatation_stiffness(self.dimension) * dilatation,
        ]
    }

    /// Breaks the bonds of which the load over their limit, from `ratio`, is at least 1 and at least `fraction` of the largest;
    /// raises `damage` to the fraction of the weight of its bonds that a point lost. `ratio` takes a bond and the
    /// slots of both ends; `conjugate` is the stress conjugate to the eigenstrain that the bond of a point with a
    /// slot carries, Pa. Only the bonds of points with an excess are examined, remote ones included: processes that share
    /// a bond find the same.
    pub fn break_bonds(
        &mut self,
        family: &Family,
        points: &Reducer,
        fraction: f64,
        damage: &mut [f64],
        loads: BondLoads<impl Fn(&Bond, usize, usize) -> f64, impl Fn(usize, &Bond, usize) -> f64>,
    ) -> NewBreaks {
        let BondLoads { ratio, conjugate } = loads;
        let exceeds = |point: &usize| self.excess[*point] > 0.0;
        let ratio = |point: usize, number: usize, bond: &Bond, slot: usize| {
            self.crossings.factor(point, number) * ratio(bond, family.slot_of(point), slot)
        };
        let mut exceeding = Vec::new();
        let breakable = Breakable {
            set: 0,
            family,
            broken: self.broken(),
        };
        let own = (0..family.points()).filter(exceeds);
        breakable.find_exceeding(own, ratio, &mut exceeding);
        let remote = family.remote().iter();
        let remote = remote.filter(|(_, point)| exceeds(&(*point as usize)));
        let mut remote: Vec<usize> = remote.map(|(slot, _)| *slot as usize).collect();
        remote.sort_unstable();
        if !remote.is_empty() {
            let beside = (self.beside_remote).get_or_init(|| family.points_beside_remote());
            let others = beside.iter().map(|point| *point as usize);
            let others = others.filter(|point| !exceeds(point));
            let ratio = |point: usize, number: usize, bond: &Bond, other: usize| match remote
                .binary_search(&other)
            {
                Ok(_) => ratio(point, number, bond, other),
                Err(_) => 0.0,
            };
            breakable.find_exceeding(others, ratio, &mut exceeding);
        }
        Exceeding::keep_largest(&mut exceeding, fraction, points);
        let FractureState { broken, frozen, .. } = &mut self.state;
        let broken = &mut broken[0];
        let mut lost: Vec<[usize; 2]> = Vec::new();
        let mut lose = |point: usize, number: usize| lost.push([point, number]);
        let pairs = exceeding.iter();
        let pairs = pairs.filter_map(|e| e.break_bond(family, broken, &mut lose));
        let pairs = pairs.collect();
        // in an order that does not depend on where the bonds were found
        lost.sort_unstable();
        for of_point in lost.chunk_by(|a, b| a[0] == b[0]) {
            let point = of_point[0][0];
            let mut numbers = of_point.iter().map(|[_, number]| *number).peekable();
            family.for_each_bond(point, |number, bond, slot| {
                if numbers.next_if_eq(&number).is_none() {
                    return;
                }
                let stress = conjugate(point, bond, slot);
                let [x, y, z] = bond.xi.map(|x| x * bond.inverse_length);
                let along = [x * x, y * y, z * z, x * y, y * z, z * x];
                (0..6).for_each(|c| frozen[point][c] += stress * along[c]);
            });
            let lost = lost_fraction(family, broken, point, |_| true);
            damage[point] = damage[point].max(lost);
        }
        NewBreaks {
            pairs,
            any: !exceeding.is_empty(),
        }
    }

    /// All pairs of points that lost their bond.
    pub fn broken_pairs(&self, family: &Family) -> Vec<[u32; 2]> {
        let pairs = broken_pairs(family, self.broken());
        pairs.map(|pair| pair.map(|point| point as u32)).collect()
    }
}
