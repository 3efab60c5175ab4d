//! Logs that a resumed run continues.

use super::*;

#[test]
fn a_log_resumed_equals_one_never_interrupted() {
    for points in [10, 20_000] {
        let (folder, path) = logged(5, points);
        let whole = Log::open(&path).unwrap();

        let interrupted = folder.path().join("interrupted.mcap");
        let mut writer = create(&interrupted);
        for step in 0..4 {
            log_step(&mut writer, step, points);
        }
        // killed: neither finished nor dropped
        std::mem::forget(writer);
        let old = Log::open(&interrupted).unwrap();
        assert!(!old.finished());

        let resumed = folder.path().join("resumed.mcap");
        let mut writer = continued(&old, &resumed, 2).unwrap();
        for step in 3..5 {
            log_step(&mut writer, step, points);
        }
        writer.finish().unwrap();
        let resumed = Log::open(resumed).unwrap();
        assert_same_content(&resumed, &whole);
        // the last two checkpoints before the interruption are kept
        assert_eq!(resumed.checkpoints(), &whole.checkpoints()[1..]);
        assert_eq!(resumed.checkpoint(0).unwrap(), whole.checkpoint(1).unwrap());
        assert_eq!(resumed.checkpoint(3).unwrap(), whole.checkpoint(4).unwrap());
    }
}

#[test]
fn resuming_into_the_same_file_is_refused() {
    let (_folder, path) = logged(1, 4);
    let log = Log::open(&path).unwrap();
    let refused = continued(&log, &path, 0);
    assert!(matches!(refused, Err(LogError::SameFile { .. })));
    assert_eq!(Log::open(&path).unwrap().checkpoints().len(), 1);
}

#[test]
fn resuming_without_a_checkpoint_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    create(&path).finish().unwrap();
    let log = Log::open(&path).unwrap();
    assert!(matches!(
        log.last_checkpoint(),
        Err(LogError::NoCheckpoint { .. })
    ));
    let refused = continued(&log, folder.path().join("new.mcap"), 0);
    assert!(matches!(refused, Err(LogError::NoCheckpoint { .. })));
}
