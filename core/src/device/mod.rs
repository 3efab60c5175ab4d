//! Kernels for devices that are not this processor.
//!
//! A [`DeviceKernel`] is written once, for any [`Number`]. With `f64` it is the kernel of the sweep. With [`Recorded`] one call writes down its operations
//! ([`record`]), and the [`Recording`] prints them as C ([`Recording::sweep_in_c`]), which a C compiler translates, or that of a graphics card at run time. The
//! constants of a kernel become numbers of the text. Laws of users are translated with the kernel that calls them.
//!
//! A device sweeps over the arrays of [`LatticeTables`](crate::family::LatticeTables). It sums the bonds of each point from that point only, in the order of the
//! sweep, so that its results have the bits of a kernel without [`BondKernel::PAIRED`] sums, if the compiler neither fuses nor reorders operations
//! (`-ffp-contract=off`, `--fmad=false`).

mod c;

use std::cell::RefCell;
use std::ops::{Add, Div, Mul, Neg, Sub};

use crate::arithmetic::Number;
use crate::family::{Bond, BondKernel};

/// A kernel that devices can compute, too.
pub trait DeviceKernel<const I: usize, const O: usize>: BondKernel<I, O> {
    /// [`BondKernel::bond`] for any number; that calls this one.
    fn bond_of<N: Number>(&self, bond: &Bond<N>, own: [N; I], other: [N; I]) -> [N; O];
}

/// Numbers of a bond: vector, length, one over the length, weight, dual.
pub const BOND_NUMBERS: usize = 7;

/// An operation of a kernel. Operands are results of operations before it.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Operation {
    /// A number of the bond.
    OfBond(usize),
    /// An input of the point.
    Own(usize),
    /// An input of the other end.
    Other(usize),
    Constant(f64),
    Negative(Recorded),
    Root(Recorded),
    Sum(Recorded, Recorded),
    Difference(Recorded, Recorded),
    Product(Recorded, Recorded),
    Quotient(Recorded, Recorded),
    /// `a b + c`, rounded once.
    MulAdd([Recorded; 3]),
    /// The third if the first is above the second, else the fourth.
    SelectAbove([Recorded; 4]),
}

/// The result of an operation that was written down.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Recorded(usize);

thread_local! {
    static OPERATIONS: RefCell<Vec<Operation>> = const { RefCell::new(Vec::new()) };
}

impl Recorded {
    fn new(operation: Operation) -> Self {
        OPERATIONS.with_borrow_mut(|operations| {
            operations.push(operation);
            Recorded(operations.len() - 1)
        })
    }
}

impl From<f64> for Recorded {
    fn from(value: f64) -> Self {
        Recorded::new(Operation::Constant(value))
    }
}

impl Neg for Recorded {
    type Output = Recorded;

    fn neg(self) -> Recorded {
        Recorded::new(Operation::Negative(self))
    }
}

/// Operators whose right side is recorded, too.
macro_rules! record_operator {
    ($($operator:ident $method:ident $operation:ident),*) => {$(
        impl $operator for Recorded {
            type Output = Recorded;

            fn $method(self, other: Recorded) -> Recorded {
                Recorded::new(Operation::$operation(self, other))
            }
        }
    )*};
}

/// Operators with a constant on the right side.
macro_rules! record_operator_with_constant {
    ($($operator:ident $method:ident),*) => {$(
        impl $operator<f64> for Recorded {
            type Output = Recorded;

            fn $method(self, constant: f64) -> Recorded {
                self.$method(Recorded::from(constant))
            }
        }
    )*};
}

record_operator!(Add add Sum, Sub sub Difference, Mul mul Product, Div div Quotient);
record_operator_with_constant!(Add add, Sub sub, Mul mul);

impl Number for Recorded {
    fn sqrt(self) -> Self {
        Recorded::new(Operation::Root(self))
    }

    fn mul_add(self, factor: Self, term: Self) -> Self {
        Recorded::new(Operation::MulAdd([self, factor, term]))
    }

    fn select_above(self, limit: Self, then: Self, otherwise: Self) -> Self {
        Recorded::new(Operation::SelectAbove([self, limit, then, otherwise]))
    }
}

/// The operations of a kernel.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    operations: Vec<Operation>,
    /// Results that are added to the sums.
    sums: Vec<Recorded>,
    /// Number of inputs.
    inputs: usize,
}

/// Writes down the operations of a kernel.
pub fn record<const I: usize, const O: usize>(kernel: &impl DeviceKernel<I, O>) -> Recording {
    OPERATIONS.take();
    let of_bond: [Recorded; BOND_NUMBERS] =
        std::array::from_fn(|n| Recorded::new(Operation::OfBond(n)));
    let [x, y, z, length, inverse_length, weight, dual] = of_bond;
    let bond = Bond {
        xi: [x, y, z],
        length,
        inverse_length,
        weight,
        dual,
    };
    let own = std::array::from_fn(|n| Recorded::new(Operation::Own(n)));
    let other = std::array::from_fn(|n| Recorded::new(Operation::Other(n)));
    let sums = kernel.bond_of(&bond, own, other).to_vec();
    Recording {
        operations: OPERATIONS.take(),
        sums,
        inputs: I,
    }
}
