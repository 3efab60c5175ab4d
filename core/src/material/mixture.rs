//! Conductivity of layers and mixtures.

/// Conductivity of a point in which two fluids of these conductivities lie in series, with the fraction of the first one. In a layer that
/// is heated from inside each fluid conducts its own part: heat that a beam leaves in a metal must not pass its gas.
pub fn mixed_conductivity(both: [f64; 2], fraction: f64, is_heated: bool) -> f64 {
    let c = fraction.clamp(0.0, 1.0);
    match is_heated {
        true => c * both[0] + (1.0 - c) * both[1],
        false => in_series(both, [c, 1.0 - c]),
    }
}

/// Conductivity (W/(m K)) of two layers in series from theirs, `k`; only the ratio of their `lengths` matters. Zero where both
/// conductivities are zero.
#[inline(always)]
pub fn in_series(k: [f64; 2], lengths: [f64; 2]) -> f64 {
    let resistance = lengths[0] * k[1] + lengths[1] * k[0];
    (lengths[0] + lengths[1]) * k[0] * k[1] / (resistance + f64::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layers_conduct_in_series_and_a_heated_layer_side_by_side() {
        let series = 1.0 / (0.25 / 40.0 + 0.75 / 0.5);
        let found = mixed_conductivity([40.0, 0.5], 0.25, false);
        assert!((found / series - 1.0).abs() < 1e-12, "{found}");
        let beside = mixed_conductivity([40.0, 0.5], 0.25, true);
        assert!(
            (beside - (0.25 * 40.0 + 0.75 * 0.5)).abs() < 1e-12,
            "{beside}"
        );
        for (fraction, pure) in [(1.001, 40.0), (-0.001, 0.5)] {
            let found = mixed_conductivity([40.0, 0.5], fraction, false);
            assert!((found / pure - 1.0).abs() < 1e-12, "{found}");
        }
    }
}
