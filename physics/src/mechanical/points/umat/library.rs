//! A subroutine in its shared library.

use std::error::Error;
use std::path::Path;
use std::sync::{Mutex, PoisonError};

use libloading::Library;
use perimelt_core::SetupError;

use super::Umat;
use super::arguments::Arguments;
use crate::mechanical::points::scratch::with_copy;

/// The arguments of UMAT in order, and the length of CMNAME, which Fortran passes behind them.
#[rustfmt::skip]
type Function = unsafe extern "C" fn(
    // STRESS, STATEV, DDSDDE, SSE, SPD, SCD
    *mut f64, *mut f64, *mut f64, *mut f64, *mut f64, *mut f64,
    // RPL, DDSDDT, DRPLDE, DRPLDT
    *mut f64, *mut f64, *mut f64, *mut f64,
    // STRAN, DSTRAN, TIME, DTIME, TEMP, DTEMP, PREDEF, DPRED
    *mut f64, *mut f64, *mut f64, *mut f64, *mut f64, *mut f64, *mut f64, *mut f64,
    // CMNAME, NDI, NSHR, NTENS, NSTATV
    *mut u8, *mut i32, *mut i32, *mut i32, *mut i32,
    // PROPS, NPROPS, COORDS, DROT, PNEWDT, CELENT, DFGRD0, DFGRD1
    *mut f64, *mut i32, *mut f64, *mut f64, *mut f64, *mut f64, *mut f64, *mut f64,
    // NOEL, NPT, LAYER, KSPT, JSTEP, KINC
    *mut i32, *mut i32, *mut i32, *mut i32, *mut i32, *mut i32,
    usize,
);

/// Letters of CMNAME.
const LETTERS: usize = 80;

/// A subroutine, with the library that has it.
#[derive(Debug)]
pub(super) struct Subroutine {
    function: Function,
    /// PROPS.
    properties: Vec<f64>,
    /// CMNAME, padded by blanks.
    material: [u8; LETTERS],
    /// One call at a time, unless the subroutine may be called in parallel.
    turn: Option<Mutex<()>>,
    /// Keeps the code of `function` in memory.
    _library: Library,
}

impl Subroutine {
    /// Loads the library that the keys name.
    ///
    /// # Errors
    /// A file that is no library, a library without the symbol, a name of the material that is too long.
    pub(super) fn load(keys: &Umat) -> Result<Self, SetupError> {
        let mut material = [b' '; LETTERS];
        let name = keys.material.as_bytes();
        let Some(place) = material.get_mut(..name.len()).filter(|_| name.is_ascii()) else {
            let message = format!("the name has {} bytes", name.len());
            return Err(SetupError::value("material", message, "80 letters at most"));
        };
        place.copy_from_slice(name);
        let refuse = |key: &str, error: libloading::Error, expected: &str| {
            // the message of the loader, which has the name
            let cause = error.source().map(ToString::to_string);
            SetupError::value(key, cause.unwrap_or(error.to_string()), expected)
        };
        // a name without a folder would be looked for among the libraries of the system
        let path = Path::new(".").join(&keys.library.place);
        // SAFETY: the user names a library whose initialisers may run.
        let library = unsafe { Library::new(path) };
        let library =
            library.map_err(|e| refuse("library", e, "a shared library, such as `./steel.so`"))?;
        // SAFETY: the user says that the symbol is a subroutine with the arguments of UMAT.
        let function = unsafe { library.get::<Function>(keys.symbol.as_bytes()) };
        let function = function
            .map_err(|e| refuse("symbol", e, "a function of the library, such as \"umat_\""))?;
        Ok(Subroutine {
            function: *function,
            properties: keys.properties.clone(),
            material,
            turn: (!keys.parallel).then(Mutex::default),
            _library: library,
        })
    }

    /// Calls the subroutine; `states` is STATEV.
    // the arguments in the lines of `Function`
    #[rustfmt::skip]
    pub(super) fn call(&self, arguments: &mut Arguments, states: &mut [f64]) {
        let turn = self.turn.as_ref();
        let _turn = turn.map(|turn| turn.lock().unwrap_or_else(PoisonError::into_inner));
        with_copy(&self.properties, |properties| {
            let count = |numbers: &[f64]| i32::try_from(numbers.len()).unwrap_or(i32::MAX);
            let [mut properties_count, mut states_count] = [count(properties), count(states)];
            let mut material = self.material;
            let [mut heat, mut heat_by_temperature, mut temperature_change] = [0.0; 3];
            let [mut stress_by_temperature, mut heat_by_strain] = [[0.0; 6]; 2];
            let [mut field, mut field_change] = [0.0; 2];
            let [mut normal, mut shear, mut components] = [3, 3, 6];
            let ([mut one, mut layer, mut section], mut steps) = ([1; 3], [1; 4]);
            let Arguments {
                stress,
                tangent,
                energies: [elastic, plastic, creep],
                strain,
                increment,
                time,
                step,
                temperature,
                position,
                rotation,
                next_step,
                spacing,
                gradients: [before, after],
                number,
                increments,
            } = arguments;
            // SAFETY: each pointer is to an object of the type and the length that the interface prescribes, which lives and
            // is not used otherwise until the function returns; `_library` keeps the code of the function.
            unsafe {
                (self.function)(
                    stress.as_mut_ptr(), states.as_mut_ptr(), tangent.as_mut_ptr(), elastic, plastic, creep,
                    &mut heat, stress_by_temperature.as_mut_ptr(), heat_by_strain.as_mut_ptr(), &mut heat_by_temperature,
                    strain.as_mut_ptr(), increment.as_mut_ptr(), time.as_mut_ptr(), step, temperature,
                    &mut temperature_change, &mut field, &mut field_change,
                    material.as_mut_ptr(), &mut normal, &mut shear, &mut components, &mut states_count,
                    properties.as_mut_ptr(), &mut properties_count, position.as_mut_ptr(), rotation.as_mut_ptr(),
                    next_step, spacing, before.as_mut_ptr(), after.as_mut_ptr(),
                    number, &mut one, &mut layer, &mut section, steps.as_mut_ptr(), increments,
                    LETTERS,
                );
            }
        });
    }
}
