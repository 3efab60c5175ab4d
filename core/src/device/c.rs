//! The text of a recording in C.

use std::fmt::{self, Display, Formatter};

use super::{BOND_NUMBERS, Operation, Recorded, Recording};
use crate::family::LatticeTables;

/// What sums the bonds of a point, and a loop over points in whose place a device has a thread for each.
const SWEEP: &str = "
static void sum_point(long point, const uint32_t *slots, const int64_t *first_weight, const double *weights, long bonds,
                      const int64_t *offsets, const double *stencil, const double *const *inputs, double *sums)
{
    const long slot = slots[point];
    double own[INPUTS + 1], other[INPUTS + 1], part[SUMS], sum[SUMS] = {0};
    for (int i = 0; i < INPUTS; i++)
        own[i] = inputs[i][slot];
    for (long number = 0; number < bonds; number++) {
        double of_bond[BOND_NUMBERS];
        for (int n = 0; n < BOND_NUMBERS; n++)
            of_bond[n] = stencil[number * BOND_NUMBERS + n];
        if (first_weight[point] >= 0) {
            const double *weight = weights + first_weight[point] + number * NEXT;
            of_bond[BOND_NUMBERS - 2] = weight[0];
            of_bond[BOND_NUMBERS - 1] = weight[DUAL];
            if (weight[0] + weight[DUAL] == 0.0)
                continue;
        }
        for (int i = 0; i < INPUTS; i++)
            other[i] = inputs[i][slot + offsets[number]];
        bond(of_bond, own, other, part);
        for (int o = 0; o < SUMS; o++)
            sum[o] += part[o];
    }
    for (int o = 0; o < SUMS; o++)
        sums[point * SUMS + o] = sum[o];
}

void sweep(long points, const uint32_t *slots, const int64_t *first_weight, const double *weights, long bonds,
           const int64_t *offsets, const double *stencil, const double *const *inputs, double *sums)
{
    for (long point = 0; point < points; point++)
        sum_point(point, slots, first_weight, weights, bonds, offsets, stencil, inputs, sums);
}
";

impl Recording {
    /// A function in C that sums the kernel over the bonds of points of a lattice:
    ///
    /// ```c
    /// void sweep(long points, const uint32_t *slots, const int64_t *first_weight, const double *weights, long bonds,
    ///            const int64_t *offsets, const double *stencil, const double *const *inputs, double *sums);
    /// ```
    ///
    /// with the arrays of [`LatticeTables`], inputs by slot, and sums by point.
    pub fn sweep_in_c(&self) -> String {
        format!(
            "#include <math.h>\n#include <stdint.h>\n\n#define INPUTS {}\n#define SUMS {}\n#define BOND_NUMBERS {BOND_NUMBERS}\n#define DUAL {}\n#define NEXT {}\n\n{self}{SWEEP}",
            self.inputs,
            self.sums.len(),
            LatticeTables::DUAL,
            LatticeTables::NEXT,
        )
    }
}

/// The contributions of a bond as a function in C.
impl Display for Recording {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "static void bond(const double *of_bond, const double *own, const double *other, double *sums)\n{{"
        )?;
        for (number, operation) in self.operations.iter().enumerate() {
            writeln!(f, "    const double {} = {operation};", Recorded(number))?;
        }
        for (number, sum) in self.sums.iter().enumerate() {
            writeln!(f, "    sums[{number}] = {sum};")?;
        }
        f.write_str("}\n")
    }
}

impl Display for Recorded {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "v{}", self.0)
    }
}

impl Display for Operation {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Operation::OfBond(number) => write!(f, "of_bond[{number}]"),
            Operation::Own(number) => write!(f, "own[{number}]"),
            Operation::Other(number) => write!(f, "other[{number}]"),
            // the shortest decimal number that rounds to this one
            Operation::Constant(value) if value.is_finite() => write!(f, "{value:e}"),
            Operation::Constant(value) if value.is_nan() => f.write_str("NAN"),
            Operation::Constant(value) => f.write_str(if *value > 0.0 {
                "INFINITY"
            } else {
                "-INFINITY"
            }),
            Operation::Negative(a) => write!(f, "-{a}"),
            Operation::Root(a) => write!(f, "sqrt({a})"),
            Operation::Sum(a, b) => write!(f, "{a} + {b}"),
            Operation::Difference(a, b) => write!(f, "{a} - {b}"),
            Operation::Product(a, b) => write!(f, "{a} * {b}"),
            Operation::Quotient(a, b) => write!(f, "{a} / {b}"),
            Operation::MulAdd([a, b, c]) => write!(f, "fma({a}, {b}, {c})"),
            Operation::SelectAbove([a, limit, then, otherwise]) => {
                write!(f, "{a} > {limit} ? {then} : {otherwise}")
            }
        }
    }
}
