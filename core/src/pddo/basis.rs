//! Monomials of Taylor series, by order, then lexicographically: `x, y, xx, xy, yy` in 2D.

/// Which monomial (`N`: the constant one) times which axis makes each of the first `N` monomials.
pub(super) const fn factors<const D: usize, const N: usize>() -> [(usize, usize); N] {
    let mut factors = [(N, 0); N];
    let mut count = 0;
    while count < D && count < N {
        factors[count] = (N, count);
        count += 1;
    }
    let mut shorter = 0;
    while count < N {
        let mut axis = factors[shorter].1;
        while axis < D && count < N {
            factors[count] = (shorter, axis);
            (count, axis) = (count + 1, axis + 1);
        }
        shorter += 1;
    }
    factors
}

/// The first `N` monomials of a vector.
#[inline(always)]
pub(super) fn monomials<const D: usize, const N: usize>(xi: &[f64; 3]) -> [f64; N] {
    let mut values = [0.0; N];
    for (q, &(shorter, axis)) in const { factors::<D, N>() }.iter().enumerate() {
        values[q] = if shorter == N { 1.0 } else { values[shorter] } * xi[axis];
    }
    values
}

/// Exponents of the monomials up to `order`.
pub(super) fn exponents(dimension: usize, order: usize) -> Vec<[u8; 3]> {
    let range = |axis: usize| 0..=if axis < dimension { order as u8 } else { 0 };
    let mut all = Vec::new();
    for x in range(0) {
        for y in range(1) {
            all.extend(range(2).map(|z| [x, y, z]));
        }
    }
    let total = |e: &[u8; 3]| e.iter().map(|&e| usize::from(e)).sum::<usize>();
    all.retain(|e| (1..=order).contains(&total(e)));
    all.sort_by_key(|e| (total(e), e.map(|e| order as u8 - e)));
    all
}

/// Place of the derivative along axes `a` and `b` among those of a point, for operators of at least second
/// order.
#[inline(always)]
pub const fn second(dimension: usize, a: usize, b: usize) -> usize {
    let (low, high) = if a < b { (a, b) } else { (b, a) };
    // rows of an upper triangle, each one shorter than the one before
    dimension + low * (2 * dimension + 1 - low) / 2 + high - low
}

/// Evaluates `$body` with `$D` and `$N`, the number of monomials, as constants. Where the dimension is a constant
/// already (`const D`), `$body` is compiled for no other.
macro_rules! with_basis {
    (const $D:ident, $order:expr, |$N:ident| $body:expr) => {
        with_basis!(@table constant $D, $order, $N, $body)
    };
    ($dimension:expr, $order:expr, |$D:ident, $N:ident| $body:expr) => {
        with_basis!(@table variable $dimension, $order, $D, $N, $body)
    };
    (@table $kind:ident $($arguments:tt)*) => {
        with_basis!(@$kind $($arguments)*;
            (1, 1, 1), (1, 2, 2), (1, 3, 3), (1, 4, 4),
            (2, 1, 2), (2, 2, 5), (2, 3, 9), (2, 4, 14),
            (3, 1, 3), (3, 2, 9), (3, 3, 19), (3, 4, 34))
    };
    (@variable $dimension:expr, $order:expr, $D:ident, $N:ident, $body:expr; $(($d:literal, $o:literal, $n:literal)),*) => {
        match ($dimension, $order) {
            $(($d, $o) => {
                const $D: usize = $d;
                const $N: usize = $n;
                $body
            })*
            _ => unreachable!("the order was checked when the operator was built"),
        }
    };
    (@constant $D:ident, $order:expr, $N:ident, $body:expr; $(($d:literal, $o:literal, $n:literal)),*) => {
        match $order {
            $($o if const { $D == $d } => {
                const $N: usize = $n;
                $body
            })*
            _ => unreachable!("the order was checked when the operator was built"),
        }
    };
}

pub(super) use with_basis;

#[cfg(test)]
mod tests {
    use super::*;

    fn agree<const D: usize, const N: usize>(order: usize) {
        let xi = [2.0, 3.0, 5.0];
        let powers = exponents(D, order);
        assert_eq!(powers.len(), N);
        for (e, value) in powers.iter().zip(monomials::<D, N>(&xi)) {
            let expected: f64 = (0..3).map(|a| xi[a].powi(i32::from(e[a]))).product();
            assert_eq!(value, expected, "{e:?}");
        }
    }

    #[test]
    fn monomials_have_the_exponents_that_they_are_listed_with() {
        agree::<1, 4>(4);
        agree::<2, 5>(2);
        agree::<2, 9>(3);
        agree::<2, 14>(4);
        agree::<3, 9>(2);
        agree::<3, 34>(4);
    }
}
