//! Fields: named, typed, unit-bearing arrays over the points of a body.
//!
//! A [`Key`] names a field. At set-up a plugin requests the access that it needs
//! ([`crate::Setup::own`], [`crate::Setup::read`], ...) and receives a *handle*; a run-time
//! access needs a handle, so that code with undeclared access does not compile.

use std::borrow::Cow;
use std::cell::{Cell, Ref, RefCell, RefMut};
use std::marker::PhantomData;

use nalgebra::{Matrix3, Vector3};

/// A type that a field can hold: `f64`, `Vector3<f64>` or `Matrix3<f64>`.
pub trait Value: bytemuck::Pod + Default + Send + Sync {
    /// Number of `f64` components of one value: 1, 3 or 9 (column-major).
    const COMPONENTS: usize;
}

impl Value for f64 {
    const COMPONENTS: usize = 1;
}
impl Value for Vector3<f64> {
    const COMPONENTS: usize = 3;
}
impl Value for Matrix3<f64> {
    const COMPONENTS: usize = 9;
}

/// Name, unit and meaning of a field with values of type `T`.
#[derive(Clone, Debug)]
pub struct Key<T> {
    /// Name as used in case files and logs.
    pub name: Cow<'static, str>,
    /// SI unit.
    pub unit: Cow<'static, str>,
    /// One line for `perimelt list`.
    pub meaning: Cow<'static, str>,
    value: PhantomData<fn() -> T>,
}

impl<T: Value> Key<T> {
    /// A key known when the program is written.
    pub const fn new(name: &'static str, unit: &'static str, meaning: &'static str) -> Self {
        Key {
            name: Cow::Borrowed(name),
            unit: Cow::Borrowed(unit),
            meaning: Cow::Borrowed(meaning),
            value: PhantomData,
        }
    }

    /// A key for a field that a case file or a log names.
    pub fn named(name: String, unit: String) -> Self {
        Key {
            name: name.into(),
            unit: unit.into(),
            meaning: Cow::Borrowed(""),
            value: PhantomData,
        }
    }
}

/// The common vocabulary. A plugin may add keys of its own.
pub mod keys {
    use super::Key;
    use nalgebra::{Matrix3, Vector3};

    macro_rules! vocabulary {
        ($($(#[$doc:meta])* $key:ident: $value:ty = $name:literal, $unit:literal, $meaning:literal;)*) => {
            $($(#[$doc])* pub const $key: Key<$value> = Key::new($name, $unit, $meaning);)*

            /// Name, unit and meaning of every key of the vocabulary.
            pub const ALL: &[(&str, &str, &str)] = &[$(($name, $unit, $meaning)),*];
        };
    }

    vocabulary! {
        /// Temperature, K.
        TEMPERATURE: f64 = "temperature", "K", "temperature";
        /// Enthalpy per reference volume, J/m³.
        ENTHALPY: f64 = "enthalpy", "J/m3", "enthalpy per reference volume";
        /// Heat added per reference volume and time, W/m³ (sink field of the thermal physics).
        HEAT_SOURCE: f64 = "heat_source", "W/m3", "heat added per volume and time";
        /// Heat per reference volume that a flow inside the body carried to a point during a step, J/m³ (sink field of amounts of
        /// the thermal physics, [`crate::Setup::take_if_added`]); its sum over the points vanishes.
        CARRIED_HEAT: f64 = "carried_heat", "J/m3", "heat that a flow carried to the point in a step";
        /// Heat per reference volume that a physics of another body gave to a point in a step, J/m³ (sink field of amounts of the thermal
        /// physics, [`crate::Setup::take_if_added`]).
        GIVEN_HEAT: f64 = "given_heat", "J/m3", "heat that another body gave to the point in a step";
        /// Derivative of [`HEAT_SOURCE`] by the temperature of the point, with the opposite sign, W/(m³ K), of heat from bodies whose
        /// temperature is that of the moment (sink field of the thermal physics, which takes it into account in steady states).
        HEAT_CONDUCTANCE: f64 = "heat_conductance", "W/(m3 K)", "conductance to other bodies per volume";
        /// How often a point's temperature is held: 0 where it is free, one for each boundary that
        /// holds it (sink field of the thermal physics; the value is in [`HELD_TEMPERATURE`]).
        TEMPERATURE_CONSTRAINT: f64 = "temperature_constraint", "1", "number of boundaries that hold the temperature of the point";
        /// Sum of the temperatures at which boundaries hold a point, K; divided by
        /// [`TEMPERATURE_CONSTRAINT`] it is the value to take (sink field of the thermal physics).
        HELD_TEMPERATURE: f64 = "held_temperature", "K", "sum of the temperatures at which boundaries hold the point";
        /// 1 where there is material, 0 at points whose material has not been deposited yet.
        ACTIVE: f64 = "active", "1", "1 where there is material, 0 where none has been deposited yet";
        /// Temperature at which the material of a point is deposited, K.
        BIRTH_TEMPERATURE: f64 = "birth_temperature", "K", "temperature at which the material was deposited";
        /// 0 in powder, 1 in dense metal.
        CONSOLIDATED: f64 = "consolidated", "1", "0 in powder that has not melted, 1 in dense metal";
        /// Share of liquid, 0 to 1.
        LIQUID_FRACTION: f64 = "liquid_fraction", "1", "fraction of liquid";
        /// Velocity of the melt through the points of a solid body, m/s; zero in the solid.
        MELT_VELOCITY: Vector3<f64> = "melt_velocity", "m/s", "velocity of the melt through the points, zero in the solid";
        /// Force per volume on the melt that flows, N/m³ (sink field of melt flow), such as the one of an arc.
        MELT_FORCE: Vector3<f64> = "melt_force", "N/m3", "force per volume on the melt that flows";
        /// Pressure of the melt, Pa, up to a constant for each pool.
        MELT_PRESSURE: f64 = "melt_pressure", "Pa", "pressure of the melt, up to a constant for each pool";
        /// Highest temperature so far, K.
        PEAK_TEMPERATURE: f64 = "peak_temperature", "K", "highest temperature so far";
        /// Time above a temperature so far, s.
        TIME_ABOVE: f64 = "time_above", "s", "time above a temperature, by default the solidus";
        /// Time of the last cooling between two temperatures, s.
        COOLING_TIME: f64 = "cooling_time", "s", "time of the last cooling between two temperatures, by default t8/5";
        /// Rate of cooling at the last solidification, K/s.
        COOLING_RATE: f64 = "cooling_rate", "K/s", "rate of cooling at the last solidification";
        /// Magnitude of the temperature gradient at the last solidification, K/m.
        THERMAL_GRADIENT: f64 = "thermal_gradient", "K/m", "gradient of the temperature at the last solidification";
        /// Speed of the front at the last solidification, m/s.
        SOLIDIFICATION_SPEED: f64 = "solidification_speed", "m/s", "speed of the front at the last solidification";
        /// When a point melted before its last solidification, s.
        MELTING_TIME: f64 = "melting_time", "s", "time of melting before the last solidification";
        /// When a point solidified for the last time, s.
        SOLIDIFICATION_TIME: f64 = "solidification_time", "s", "time of the last solidification";
        /// How often a point has solidified.
        SOLIDIFICATIONS: f64 = "solidifications", "1", "number of solidifications so far";
        /// Share of austenite, 0 to 1.
        AUSTENITE: f64 = "austenite", "1", "fraction of austenite";
        /// Share of ferrite, 0 to 1.
        FERRITE: f64 = "ferrite", "1", "fraction of ferrite";
        /// Share of pearlite, 0 to 1.
        PEARLITE: f64 = "pearlite", "1", "fraction of pearlite";
        /// Share of bainite, 0 to 1.
        BAINITE: f64 = "bainite", "1", "fraction of bainite";
        /// Share of martensite, 0 to 1.
        MARTENSITE: f64 = "martensite", "1", "fraction of martensite";
        /// Vickers hardness.
        HARDNESS: f64 = "hardness", "HV", "Vickers hardness by composition, constituents and rate of cooling";
        /// Sum of the strains of transformation plasticity over 3/2 of the stress deviator, 1/Pa.
        TRANSFORMATION_COMPLIANCE: f64 = "transformation_compliance", "1/Pa", "strain of transformation plasticity since the start over 3/2 of a constant stress deviator";
        /// Yield stress, Pa, in place of the material's.
        YIELD_STRESS: f64 = "yield_stress", "Pa", "yield stress";
        /// Displacement from the reference position, m.
        DISPLACEMENT: Vector3<f64> = "displacement", "m", "displacement from the reference position";
        /// How often a component of the displacement is held: 0 where it is free, one for each
        /// boundary that holds it (sink field of the mechanical physics; the value is in
        /// [`HELD_DISPLACEMENT`]).
        CONSTRAINT: Vector3<f64> = "constraint", "1", "number of boundaries that hold each component of the displacement";
        /// Sum of the displacements at which boundaries hold a point, m; divided by
        /// [`CONSTRAINT`], component by component, it is the value to take (sink field of the
        /// mechanical physics).
        HELD_DISPLACEMENT: Vector3<f64> = "held_displacement", "m", "sum of the displacements at which boundaries hold the point";
        /// Velocity, m/s.
        VELOCITY: Vector3<f64> = "velocity", "m/s", "velocity";
        /// Unit normal of a solid at its interface with a fluid, from the fluid to the solid; zero away from the
        /// interface.
        INTERFACE_NORMAL: Vector3<f64> = "interface_normal", "1", "normal from the fluid to the solid, zero away from their interface";
        /// Density, kg/m³.
        DENSITY: f64 = "density", "kg/m3", "density";
        /// Flux of mass by which an Eulerian fluid advanced its density, kg/(m² s).
        MASS_FLUX: Vector3<f64> = "mass_flux", "kg/(m2 s)", "flux of mass of an Eulerian fluid in its last step";
        /// Fraction of the first of two fluids of a body.
        FLUID_FRACTION: f64 = "fluid_fraction", "1", "volume of the first of two fluids over that of the point";
        /// Pressure on the interface of two fluids at a point, from the second to the first one, Pa (sink field of the fluid).
        INTERFACE_PRESSURE: f64 = "interface_pressure", "Pa", "pressure on the interface of two fluids, from the second to the first one";
        /// Pressure, Pa.
        PRESSURE: f64 = "pressure", "Pa", "pressure";
        /// Force per volume, N/m³ (sink field of the mechanical and fluid physics).
        BODY_FORCE: Vector3<f64> = "body_force", "N/m3", "force per volume";
        /// First moment of the force per volume about the point, force (x) arm, N/m² (sink field of the mechanical physics).
        BODY_FORCE_MOMENT: Matrix3<f64> = "body_force_moment", "N/m2", "first moment of the force per volume about the point";
        /// Momentum per reference volume that a body gets at the start of a step, N s/m³ (sink field of explicit
        /// mechanics, rigid bodies and fluids; [`crate::Setup::take_if_added`]). What two bodies do to each other is an
        /// impulse, so that it is equal and opposite whatever steps they take.
        IMPULSE: Vector3<f64> = "impulse", "N s/m3", "momentum per volume given at the start of a step";
        /// Isotropic stress-free strain, for example alpha (T - T_ref) (sink field of the mechanical physics).
        EIGENSTRAIN: f64 = "eigenstrain", "1", "isotropic stress-free strain";
        /// Strain that is free of stress because the material was deposited on a strained body.
        BIRTH_STRAIN: Matrix3<f64> = "birth_strain", "1", "strain of the body where and when material was deposited, which is free of stress";
        /// Stress-free strain that differs by direction, besides [`EIGENSTRAIN`] (sink field of the mechanical physics).
        EIGENSTRAIN_TENSOR: Matrix3<f64> = "eigenstrain_tensor", "1", "stress-free strain that differs by direction, besides `eigenstrain`";
        /// Plastic strain, with what was relieved by annealing.
        PLASTIC_STRAIN: Matrix3<f64> = "plastic_strain", "1", "inelastic strain: plastic flow, and what annealing relieved";
        /// Equivalent (von Mises) plastic strain since the last annealing.
        EQUIVALENT_PLASTIC_STRAIN: f64 = "equivalent_plastic_strain", "1", "equivalent plastic strain";
        /// Work of plastic flow since the start, J/m³.
        PLASTIC_WORK: f64 = "plastic_work", "J/m3", "work of plastic flow since the start";
        /// Work of viscous friction per reference volume since the start, J/m³.
        VISCOUS_WORK: f64 = "viscous_work", "J/m3", "work of viscous friction since the start";
        /// Fraction of the bonds of a point that are broken, by their weights (Gao (2020), eq. 2.15).
        DAMAGE: f64 = "damage", "1", "fraction of broken bonds";
        /// Rotation vector from the axes of space to those of the material in the undeformed body, rad ([`crate::orientation`]).
        ORIENTATION: Vector3<f64> = "orientation", "rad", "rotation vector from the axes of space to those of the material";
        /// Stress, Pa.
        STRESS: Matrix3<f64> = "stress", "Pa", "stress; up to a third off in the first rows of curved surfaces of a lattice, unless `surface_stress` of `mechanical` is \"extrapolated\"";
        /// Stress conjugate to the eigenstrain (not a residual stress): `dW/d(strain)` summed over the bonds,
        /// Pa. Heat from deformation is `-alpha T` times its change.
        CONJUGATE_STRESS: f64 = "conjugate_stress", "Pa", "stress conjugate to the eigenstrain (not a residual stress)";
        /// Stress conjugate to [`EIGENSTRAIN_TENSOR`], Pa, whose trace is [`CONJUGATE_STRESS`]; where a coupler reads it.
        CONJUGATE_STRESS_TENSOR: Matrix3<f64> = "conjugate_stress_tensor", "Pa", "stress conjugate to `eigenstrain_tensor` (not a residual stress)";
    }
}

/// Index of a field in a [`Fields`] store.
pub type FieldIndex = usize;

macro_rules! handle {
    ($(#[$doc:meta])* $name:ident) => {
        $(#[$doc])*
        #[derive(Debug)]
        pub struct $name<T> {
            pub(crate) field: FieldIndex,
            value: PhantomData<fn() -> T>,
        }
        impl<T> $name<T> {
            pub(crate) fn new(field: FieldIndex) -> Self {
                Self { field, value: PhantomData }
            }
        }
        impl<T> Clone for $name<T> {
            fn clone(&self) -> Self {
                *self
            }
        }
        impl<T> Copy for $name<T> {}
    };
}

handle! {
    /// Permission to read a field.
    Read
}
handle! {
    /// Permission to read a field if anybody provides it.
    ReadIfProvided
}
handle! {
    /// Permission to read and write a field: its owner, its only writer, or an adder into a sink.
    Write
}

impl<T> From<Write<T>> for Read<T> {
    fn from(write: Write<T>) -> Self {
        Read::new(write.field)
    }
}

/// Components of a field, by type.
#[derive(Clone, Debug)]
pub enum Data {
    /// One number per point.
    Scalar(Vec<f64>),
    /// One vector per point.
    Vector(Vec<Vector3<f64>>),
    /// One tensor per point.
    Tensor(Vec<Matrix3<f64>>),
}

impl Data {
    fn zeros(components: usize, points: usize) -> Self {
        match components {
            1 => Data::Scalar(vec![0.0; points]),
            3 => Data::Vector(vec![Vector3::zeros(); points]),
            _ => Data::Tensor(vec![Matrix3::zeros(); points]),
        }
    }

    /// Number of `f64` components of one value: 1, 3 or 9.
    pub fn components(&self) -> usize {
        match self {
            Data::Scalar(_) => 1,
            Data::Vector(_) => 3,
            Data::Tensor(_) => 9,
        }
    }

    /// All components, point-major.
    pub fn flat(&self) -> &[f64] {
        match self {
            Data::Scalar(v) => v,
            Data::Vector(v) => bytemuck::must_cast_slice(v),
            Data::Tensor(v) => bytemuck::must_cast_slice(v),
        }
    }

    /// All components, point-major.
    pub fn flat_mut(&mut self) -> &mut [f64] {
        match self {
            Data::Scalar(v) => v,
            Data::Vector(v) => bytemuck::must_cast_slice_mut(v),
            Data::Tensor(v) => bytemuck::must_cast_slice_mut(v),
        }
    }
}

/// One field of one body.
#[derive(Debug)]
pub struct Field {
    /// Body that the field lives on.
    pub body: usize,
    /// Name as used in case files and logs.
    pub name: String,
    /// SI unit.
    pub unit: String,
    data: RefCell<Data>,
    changes: Cell<u64>,
}

/// All fields of all bodies of a world.
#[derive(Debug, Default)]
pub struct Fields {
    fields: Vec<Field>,
}

impl Fields {
    /// Index of the field `name` of `body`.
    pub fn find(&self, body: usize, name: &str) -> Option<FieldIndex> {
        self.fields
            .iter()
            .position(|f| f.body == body && f.name == name)
    }

    /// The same fields of bodies with these numbers of points, all zero.
    pub(crate) fn of_size(&self, points: impl Fn(usize) -> usize) -> Fields {
        let of_size = |field: &Field| Field {
            body: field.body,
            name: field.name.clone(),
            unit: field.unit.clone(),
            data: RefCell::new(Data::zeros(field.data().components(), points(field.body))),
            changes: Cell::new(0),
        };
        Fields {
            fields: self.fields.iter().map(of_size).collect(),
        }
    }

    /// Every field, in the order of declaration.
    pub fn iter(&self) -> impl Iterator<Item = &Field> {
        self.fields.iter()
    }

    /// The field at `index`.
    pub fn field(&self, index: FieldIndex) -> &Field {
        &self.fields[index]
    }

    pub(crate) fn values_mut(&mut self, index: FieldIndex) -> &mut [f64] {
        let field = &mut self.fields[index];
        *field.changes.get_mut() += 1;
        field.data.get_mut().flat_mut()
    }

    /// Finds or adds the field of `key`; `Err` with the present number of components
    /// when it is known with another type.
    pub(crate) fn intern<T: Value>(
        &mut self,
        body: usize,
        points: usize,
        key: &Key<T>,
    ) -> Result<FieldIndex, usize> {
        if let Some(index) = self.find(body, &key.name) {
            if self.fields[index].unit.is_empty() {
                self.fields[index].unit = key.unit.to_string();
            }
            let present = self.fields[index].data.borrow().components();
            return if present == T::COMPONENTS {
                Ok(index)
            } else {
                Err(present)
            };
        }
        self.fields.push(Field {
            body,
            name: key.name.to_string(),
            unit: key.unit.to_string(),
            data: RefCell::new(Data::zeros(T::COMPONENTS, points)),
            changes: Cell::new(0),
        });
        Ok(self.fields.len() - 1)
    }
}

impl Field {
    /// The values, whatever their type (for logs and checkpoints).
    pub fn data(&self) -> Ref<'_, Data> {
        self.data.borrow()
    }

    /// The values, whatever their type (for initial values and checkpoints).
    pub(crate) fn data_mut(&self) -> RefMut<'_, Data> {
        self.changes.set(self.changes.get() + 1);
        self.data.borrow_mut()
    }

    pub(crate) fn fill(&self, value: f64) {
        self.data.borrow_mut().flat_mut().fill(value);
    }

    /// How often the values were handed out to be changed.
    pub(crate) fn changes(&self) -> u64 {
        self.changes.get()
    }

    pub(crate) fn read<T: Value>(&self) -> Ref<'_, [T]> {
        Ref::map(self.data.borrow(), |data| bytemuck::cast_slice(data.flat()))
    }

    pub(crate) fn write<T: Value>(&self) -> RefMut<'_, [T]> {
        RefMut::map(self.data_mut(), |data| {
            bytemuck::cast_slice_mut(data.flat_mut())
        })
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    /// The world itself has a displacement and material; all other fields belong to plugins.
    const OF_THE_WORLD: [&str; 2] = ["ACTIVE", "DISPLACEMENT"];

    /// Fields that the code of a folder names by their keys, with the files; comments and tests do not count.
    fn named(folder: &Path, found: &mut Vec<String>) {
        for entry in folder.read_dir().expect("a folder") {
            let path = entry.expect("an entry").path();
            let stem = path.file_stem().expect("a name").to_string_lossy();
            if stem.ends_with("tests") {
                continue;
            }
            if path.is_dir() {
                named(&path, found);
                continue;
            }
            if path.extension().is_none_or(|extension| extension != "rs") {
                continue;
            }
            let text = std::fs::read_to_string(&path).expect("a source");
            let code = text.split("#[cfg(test)]\nmod tests {").next();
            let code = code.into_iter().flat_map(str::lines);
            let code = code.filter(|line| !line.trim_start().starts_with("//"));
            for key in code.flat_map(|line| line.split("keys::").skip(1)) {
                let mut words = key.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_'));
                let name = words.next().unwrap_or_default();
                if !name.is_empty() && name == name.to_uppercase() {
                    found.push(format!("{name} in {}", path.display()));
                }
            }
        }
    }

    #[test]
    fn core_names_no_field_of_a_plugin() {
        let mut found = Vec::new();
        named(
            &Path::new(env!("CARGO_MANIFEST_DIR")).join("src"),
            &mut found,
        );
        assert!(!found.is_empty());
        found.retain(|name| !OF_THE_WORLD.iter().any(|own| name.starts_with(own)));
        assert!(found.is_empty(), "{found:#?}");
    }
}
