use std::os::unix::fs::symlink;

use super::*;

fn claimed(path: &Path) -> LogPlace {
    LogPlace::claim(path, Existing::Replace).expect("free")
}

fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).expect("a folder");
    let mut names: Vec<String> = entries
        .map(|e| e.expect("readable").file_name().to_string_lossy().into())
        .collect();
    names.sort();
    names
}

#[test]
fn links_lead_to_the_file_that_is_replaced() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    std::fs::create_dir(at("data")).expect("a folder");
    // the second link leads to a file that does not exist yet
    symlink("second", at("first")).expect("a link");
    symlink("data/log", at("second")).expect("a link");
    let place = claimed(&at("first"));
    let part = place.begin().expect("writable");
    part.file.as_file().write_all(b"log").expect("writable");
    let placed = part.put_in_place().expect("renamed");
    assert_eq!(std::fs::read(at("first")).expect("readable"), b"log");
    assert!(at("second").is_symlink());
    placed.check().expect("there");
    drop(place);
    assert_eq!(names(&at("data")), ["log"]);
    symlink("circle", at("circle")).expect("a link");
    let refused = LogPlace::claim(&at("circle"), Existing::Keep);
    let refused = refused.expect_err("a circle").to_string();
    assert!(refused.contains("form a cycle"), "{refused}");
}

#[test]
fn what_was_begun_and_failed_is_removed() {
    let folder = tempfile::tempdir().expect("a folder");
    let place = claimed(&folder.path().join("log"));
    drop(place.begin().expect("writable"));
    drop(place);
    assert!(names(folder.path()).is_empty());
    let refused = LogPlace::claim(folder.path(), Existing::Replace);
    let refused = refused.expect_err("a folder").to_string();
    assert!(
        refused.contains("is a folder, and a log is a regular file"),
        "{refused}"
    );
}

#[test]
fn a_place_is_claimed_once_and_its_leftovers_are_removed() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    // a file of a killed run and two files of the user
    for name in [
        ".log.lock",
        ".log.Ab12xY.part",
        ".log.mine.part",
        "log.part",
    ] {
        std::fs::write(at(name), "").expect("writable");
    }
    let place = claimed(&at("log"));
    let refused = LogPlace::claim(&at("log"), Existing::Replace);
    let refused = refused.expect_err("claimed").to_string();
    assert!(
        refused.contains("is being written by another run"),
        "{refused}"
    );
    drop(place);
    assert_eq!(names(folder.path()), [".log.mine.part", "log.part"]);
    // a lock file with content is the user's
    std::fs::write(at(".log.lock"), "precious").expect("writable");
    drop(claimed(&at("log")));
    assert_eq!(
        std::fs::read(at(".log.lock")).expect("readable"),
        b"precious"
    );
}

#[test]
fn a_log_that_loses_its_name_is_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("log");
    let place = claimed(&path);
    let placed = place.begin().expect("writable").put_in_place();
    let placed = placed.expect("renamed");
    placed.check().expect("there");
    std::fs::remove_file(&path).expect("removable");
    std::fs::write(&path, "another").expect("writable");
    let lost = placed.check().expect_err("replaced").to_string();
    assert!(lost.contains("was removed or replaced"), "{lost}");
}

#[test]
fn files_are_whole_and_links_are_replaced_not_followed() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("victim"), "precious").expect("writable");
    symlink("victim", at("table.csv")).expect("a link");
    write_whole(&at("table.csv"), |file| file.write_all(b"1")).expect("written");
    assert_eq!(std::fs::read(at("victim")).expect("readable"), b"precious");
    assert_eq!(std::fs::read(at("table.csv")).expect("readable"), b"1");
    let half = write_whole(&at("table.csv"), |file| {
        file.write_all(b"half")?;
        Err(io::Error::other("interrupted"))
    });
    half.expect_err("interrupted");
    assert_eq!(std::fs::read(at("table.csv")).expect("readable"), b"1");
    assert_eq!(names(folder.path()), ["table.csv", "victim"]);
}
