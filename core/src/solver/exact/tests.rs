use super::*;

fn sum(terms: &[f64]) -> f64 {
    let mut sum = ExactSum::default();
    terms.iter().for_each(|term| sum.add(*term));
    sum.value()
}

fn sum_by_buffers(terms: &[f64]) -> ExactSum {
    let mut sum = ExactSum::default();
    for part in terms.chunks(LENGTH) {
        let mut buffer = [0.0; LENGTH];
        buffer[..part.len()].copy_from_slice(part);
        sum.add_all(&mut buffer);
    }
    sum
}

/// Numbers of both signs over a range of powers of two.
fn numbers(count: usize, range: i32) -> Vec<f64> {
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    let mut next = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        state
    };
    let number = |_| {
        let power = next() as i32 % (range + 1);
        let fraction = (next() >> 11) as f64 / (1_u64 << 53) as f64 + 0.5;
        let sign = if next() % 2 == 0 { 1.0 } else { -1.0 };
        sign * fraction * 2.0_f64.powi(power)
    };
    (0..count).map(number).collect()
}

#[test]
fn what_cancels_leaves_the_rest_exactly() {
    assert_eq!(sum(&[1e300, 1.0, -1e300, 1e-300]), 1.0);
    assert_eq!(sum(&[1e300, 1e-300, -1e300]), 1e-300);
    assert_eq!(sum(&[-1e16, 1.0, 1e16, -3.0]), -2.0);
    assert_eq!(sum(&[f64::MAX, f64::MAX, -f64::MAX, -f64::MAX]), 0.0);
    assert_eq!(sum(&[f64::MAX, f64::MAX]), f64::INFINITY);
    let least = f64::from_bits(1);
    assert_eq!(sum(&[least; 3]), 3.0 * least);
    assert_eq!(sum(&[f64::MIN_POSITIVE, -least]), f64::MIN_POSITIVE - least);
    assert_eq!(sum(&[]).to_bits(), 0.0_f64.to_bits());
}

#[test]
fn the_total_is_rounded_to_nearest_and_ties_to_even() {
    let half = 2.0_f64.powi(-53);
    assert_eq!(sum(&[1.0, half]), 1.0);
    assert_eq!(sum(&[1.0 + 2.0 * half, half]), 1.0 + 4.0 * half);
    // a bit far below decides the tie
    assert_eq!(sum(&[1.0, half, 1e-300]), 1.0 + 2.0 * half);
    assert_eq!(sum(&[-1.0, -half, -1e-300]), -1.0 - 2.0 * half);
    assert_eq!(sum(&[1.0, half, -1e-300]), 1.0);
}

#[test]
fn terms_that_are_not_finite_decide() {
    for bad in [f64::INFINITY, f64::NEG_INFINITY, f64::NAN] {
        let mut terms = numbers(1000, 20);
        terms[777] = bad;
        let found = sum_by_buffers(&terms).value();
        assert!(found == bad || (bad.is_nan() && found.is_nan()), "{found}");
    }
    let both = sum_by_buffers(&[f64::INFINITY, 1.0, f64::NEG_INFINITY]);
    assert!(both.value().is_nan());
}

#[test]
fn sums_are_those_of_integers() {
    // multiples of 2^-60 below 2^60 fit into 128 bits
    let terms: Vec<f64> = numbers(100_000, 30)
        .iter()
        .map(|x| (x * 2f64.powi(40)).round())
        .collect();
    let exact: i128 = terms.iter().map(|x| *x as i128).sum();
    assert_eq!(sum_by_buffers(&terms).value(), exact as f64);
}

#[test]
fn neither_order_nor_division_nor_buffers_change_a_bit() {
    for range in [3, 60, 300, 1020] {
        let mut terms = numbers(5000, range);
        let expected = sum(&terms).to_bits();
        assert_eq!(
            sum_by_buffers(&terms).value().to_bits(),
            expected,
            "{range}"
        );
        terms.reverse();
        terms.rotate_left(1234);
        assert_eq!(
            sum_by_buffers(&terms).value().to_bits(),
            expected,
            "{range}"
        );
        for parts in [2, 3, 5, 7] {
            let mut whole = ExactSum::default();
            for part in terms.chunks(terms.len().div_ceil(parts)) {
                whole.merge(&sum_by_buffers(part));
            }
            assert_eq!(whole.value().to_bits(), expected, "{range}, {parts} parts");
        }
    }
}
