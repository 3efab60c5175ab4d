//! Constants in place of flags that are known at run time only.

/// Evaluates an expression with constants in place of flags, compiled for each combination of their values:
/// `specialise!(FINITE = finite, DILATATION = dilatation => sum(&Force::<FINITE, DILATATION>))`.
macro_rules! specialise {
    ($name:ident = $flag:expr => $body:expr) => {
        if $flag {
            const $name: bool = true;
            $body
        } else {
            const $name: bool = false;
            $body
        }
    };
    ($name:ident = $flag:expr, $($rest:tt)+) => {
        if $flag {
            const $name: bool = true;
            specialise!($($rest)+)
        } else {
            const $name: bool = false;
            specialise!($($rest)+)
        }
    };
}

pub(super) use specialise;
