//! Logs that were cut or damaged anywhere.

use std::path::Path;

use proptest::prelude::*;

use super::*;

/// A log, and how long it was after its head and after each step was flushed.
fn flushed_lengths(path: &Path, steps: u64, points: usize) -> Vec<usize> {
    let length = || std::fs::metadata(path).expect("exists").len() as usize;
    let mut writer = create(path);
    let mut lengths = vec![length()];
    for step in 0..steps {
        log_step(&mut writer, step, points);
        lengths.push(length());
    }
    writer.finish().expect("finishes");
    lengths
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Where a file is cut, as a fraction of its length; small and large messages.
    #[test]
    fn flushed_steps_survive_a_cut(fraction in 0.0..1.0, points in prop::sample::select(vec![5_usize, 4_000])) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.mcap");
        let lengths = flushed_lengths(&path, 4, points);
        let bytes = std::fs::read(&path).unwrap();
        let cut = (fraction * bytes.len() as f64) as usize;
        std::fs::write(&path, &bytes[..cut]).unwrap();

        match Log::open(&path) {
            Err(_) => prop_assert!(cut < lengths[0]),
            Ok(log) => {
                prop_assert!(!log.finished());
                let survived = lengths[1..].iter().filter(|length| **length <= cut).count();
                prop_assert!(log.checkpoints().len() >= survived);
                prop_assert!(log.progress().len() >= survived);
                prop_assert!(log.probes().get("tip").map_or(0, |tip| tip.times.len()) >= survived);
                for step in 0..survived {
                    let expected = some_cloud(time_of(step as u64), points, step as u64);
                    prop_assert_eq!(log.cloud(BODY, step).unwrap(), expected);
                }
            }
        }
    }

    /// No damage makes the reader panic or return a wrong number.
    #[test]
    fn a_damaged_byte_is_never_read_as_data(fraction in 0.0..1.0, change in 1_u8..=255) {
        let (_folder, path) = logged(3, 30);
        let mut bytes = std::fs::read(&path).unwrap();
        let at = (fraction * bytes.len() as f64) as usize;
        bytes[at] ^= change;
        std::fs::write(&path, &bytes).unwrap();
        if let Ok(log) = Log::open(&path) {
            for index in 0..log.times(BODY).len() {
                if let Ok(cloud) = log.cloud(BODY, index) {
                    // an earlier cloud may be lost, but none may be another one's or distorted
                    // where the exact time is lost, that of MCAP is left, in whole nanoseconds
                    let step = (0..3).find(|step| (time_of(*step) - cloud.time).abs() <= 1e-9);
                    let step = step.expect("the time of a step");
                    let mut expected = some_cloud(time_of(step), 30, step);
                    expected.time = cloud.time;
                    // units are in a metadata record, which MCAP does not protect by a checksum
                    for (expected, field) in expected.fields.iter_mut().zip(&cloud.fields) {
                        expected.unit.clone_from(&field.unit);
                    }
                    prop_assert_eq!(cloud, expected);
                }
            }
        }
    }
}
