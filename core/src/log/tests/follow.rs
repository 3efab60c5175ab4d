//! Messages as they are written.

use super::*;

/// Topic and log time of the messages that are new.
fn new_messages(follow: &mut Follow) -> Vec<(String, u64)> {
    let mut found = Vec::new();
    let visited = follow.visit(|message| {
        let is_json = serde_json::from_slice::<serde_json::Value>(message.data).is_ok();
        assert_eq!(message.channel.encoding == "json", is_json);
        found.push((message.channel.topic.clone(), message.log_time));
    });
    visited.expect("the file is read");
    found
}

#[test]
fn a_growing_log_is_followed_from_its_newest_state_to_its_end() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut writer = create(&path);
    for step in 0..5 {
        log_step(&mut writer, step, 40);
    }
    let mut follow = Log::open(&path).unwrap().follow();
    let topics = ["/plate/points", "/probes/tip", "/balance", "/progress"];
    let of_step = |step: u64| {
        let time = (time_of(step) * 1e9).round() as u64;
        topics.map(|topic| (topic.to_owned(), time))
    };
    let sorted = |mut messages: Vec<(String, u64)>| {
        messages.sort();
        messages
    };
    assert_eq!(
        sorted(new_messages(&mut follow)),
        sorted(of_step(4).to_vec())
    );
    assert!(new_messages(&mut follow).is_empty());

    log_step(&mut writer, 5, 40);
    assert_eq!(
        sorted(new_messages(&mut follow)),
        sorted(of_step(5).to_vec())
    );
    log_step(&mut writer, 6, 40);
    writer.finish().unwrap();
    assert_eq!(
        sorted(new_messages(&mut follow)),
        sorted(of_step(6).to_vec())
    );
    assert!(new_messages(&mut follow).is_empty());
    assert!(!follow.is_replaced());
}

#[test]
fn a_message_that_is_half_written_is_waited_for() {
    let (folder, path) = logged(3, 400);
    let whole = std::fs::read(&path).unwrap();
    let mut expected = Log::open(&path).unwrap().follow();
    let expected = new_messages(&mut expected);
    let cut = folder.path().join("cut.mcap");
    // some bytes at a time, so that records of all kinds are cut
    let mut found = Vec::new();
    let mut follow: Option<Follow> = None;
    for end in (0..whole.len()).step_by(101).chain([whole.len()]) {
        let mut file = std::fs::OpenOptions::new()
            .create(true)
            .append(true)
            .open(&cut)
            .unwrap();
        let so_far = file.metadata().unwrap().len() as usize;
        std::io::Write::write_all(&mut file, &whole[so_far..end]).unwrap();
        if follow.is_none() {
            follow = Log::open(&cut).ok().map(Log::follow);
        }
        if let Some(follow) = &mut follow {
            found.extend(new_messages(follow));
        }
    }
    // the first look was at the beginning: everything was new
    assert!(found.ends_with(&expected));
    let clouds = found.iter().filter(|(topic, _)| topic == "/plate/points");
    assert_eq!(clouds.count(), 3);
}

#[test]
fn another_file_of_the_same_name_is_noticed() {
    // shorter and longer than the first
    for steps in [1, 6] {
        let (folder, path) = logged(3, 40);
        let follow = Log::open(&path).unwrap().follow();
        let other = folder.path().join("other.mcap");
        let mut writer = create(&other);
        (0..steps).for_each(|step| log_step(&mut writer, step, 40));
        writer.finish().unwrap();
        std::fs::rename(&other, &path).unwrap();
        assert!(follow.is_replaced(), "{steps} steps");
    }
}
