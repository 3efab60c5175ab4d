//! Logs with damaged chunks.

use super::super::source::{Limit, RecordPlace, RecordReader};
use super::*;

/// Places of the chunks of a file: each record has an opcode and its length before it.
fn chunks(bytes: &[u8]) -> Vec<std::ops::Range<usize>> {
    let mut found = Vec::new();
    let mut at = mcap::MAGIC.len();
    while at + 9 <= bytes.len() {
        let length = u64::from_le_bytes(bytes[at + 1..at + 9].try_into().unwrap()) as usize;
        if bytes[at] == mcap::records::op::CHUNK {
            found.push(at + 9..at + 9 + length);
        }
        at += 9 + length;
    }
    found
}

/// Readable clouds and checkpoints.
fn sound(log: &Log, steps: u64) -> [usize; 2] {
    let clouds = (0..log.times(BODY).len()).filter(|i| log.cloud(BODY, *i).is_ok());
    let states = (0..log.checkpoints().len()).filter(|i| log.checkpoint(*i).is_ok());
    assert!(log.times(BODY).len() as u64 <= steps);
    [clouds.count(), states.count()]
}

#[test]
fn a_damaged_chunk_costs_nothing_but_what_it_holds() {
    const STEPS: u64 = 5;
    // small and large messages
    for points in [30, 4_000] {
        let (_folder, path) = logged(STEPS, points);
        let bytes = std::fs::read(&path).unwrap();
        let places = chunks(&bytes);
        assert!(places.len() >= STEPS as usize, "{}", places.len());
        let mut last_lost = 0;
        for place in &places {
            let mut damaged = bytes.clone();
            damaged[place.start + place.len() * 3 / 4] ^= 0x55;
            std::fs::write(&path, &damaged).unwrap();
            let log = Log::open(&path).unwrap();
            assert!(log.finished());
            let [clouds, states] = sound(&log, STEPS);
            let least = STEPS as usize - 1;
            assert!(clouds >= least && states >= least, "{clouds} {states}");
            // the last checkpoint that can be read is found, and the log goes on from it
            let (index, state) = log.last_sound_checkpoint().unwrap();
            let step = log.checkpoints()[index].step;
            let expected: Vec<u8> = numbers(points, step)
                .iter()
                .flat_map(|x| x.to_le_bytes())
                .collect();
            assert_eq!(state, expected);
            last_lost += usize::from(step < STEPS - 1);
            let next = path.with_file_name("next.mcap");
            let writer = continued(&log, &next, index).unwrap();
            writer.finish().unwrap();
            let next = Log::open(&next).unwrap();
            assert_eq!(next.last_sound_checkpoint().unwrap().1, expected);
        }
        assert_eq!(last_lost, 1, "of all chunks one holds the last checkpoint");
    }
}

#[test]
fn a_chunk_whose_records_end_before_it_is_damaged() {
    let (_folder, path) = logged(3, 30);
    let bytes = std::fs::read(&path).unwrap();
    // times, size when unpacked, checksum; then the name of the compression and the size of the records
    let name_at = 8 + 8 + 8 + 4;
    for place in chunks(&bytes) {
        let chunk = &bytes[place.clone()];
        let name = u32::from_le_bytes(chunk[name_at..name_at + 4].try_into().unwrap());
        let size_at = place.start + name_at + 4 + name as usize;
        let size = u64::from_le_bytes(bytes[size_at..size_at + 8].try_into().unwrap());
        for wrong in [0, size - 1, size + 1, u64::MAX] {
            let mut damaged = bytes.clone();
            damaged[size_at..size_at + 8].copy_from_slice(&wrong.to_le_bytes());
            std::fs::write(&path, &damaged).unwrap();
            let log = Log::open(&path).unwrap();
            let lost = log.damage().len() + 6 - sound(&log, 3).iter().sum::<usize>();
            assert!(lost > 0, "{wrong} for {size}");
        }
    }
}

/// Other programs may write chunks without compression. The library would count below zero in them.
#[test]
fn records_that_exceed_a_chunk_without_compression_are_damage() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("plain.mcap");
    let options = mcap::WriteOptions::new().compression(None);
    let file = std::io::BufWriter::new(std::fs::File::create(&path).unwrap());
    let mut writer = options.create(file).unwrap();
    let channel = writer
        .add_channel(0, "numbers", "", &Default::default())
        .unwrap();
    let header = mcap::records::MessageHeader {
        channel_id: channel,
        sequence: 0,
        log_time: 0,
        publish_time: 0,
    };
    writer.write_to_known_channel(&header, &[7; 100]).unwrap();
    writer.finish().unwrap();
    drop(writer);

    let bytes = std::fs::read(&path).unwrap();
    let [chunk] = &chunks(&bytes)[..] else {
        panic!("one chunk");
    };
    let place = RecordPlace {
        offset: chunk.start as u64 - 9,
        length: chunk.len() as u64 + 9,
    };
    let visited = || {
        RecordReader::open(&path)
            .unwrap()
            .visit(place, Limit::Series, |_| Ok(()))
    };
    visited().expect("a sound chunk");
    // times, size when unpacked, checksum, and the length of no name; then the size of the records
    let size_at = chunk.start + 8 + 8 + 8 + 4 + 4;
    let size = u64::from_le_bytes(bytes[size_at..size_at + 8].try_into().unwrap());
    let mut damaged = bytes.clone();
    // the checksum is left out, as a writer may
    damaged[size_at - 8..size_at - 4].fill(0);
    for wrong in [0, 20, size - 1, size + 1, u64::MAX] {
        damaged[size_at..size_at + 8].copy_from_slice(&wrong.to_le_bytes());
        std::fs::write(&path, &damaged).unwrap();
        assert!(
            matches!(visited(), Err(LogError::Damaged { .. })),
            "{wrong} for {size}"
        );
    }
}

#[test]
fn a_large_damaged_checkpoint_falls_back_to_the_one_before() {
    // beyond 256 KiB a checkpoint is a chunk of its own, which is read only when it is asked for
    const POINTS: usize = 40_000;
    let (_folder, path) = logged(3, POINTS);
    let bytes = std::fs::read(&path).unwrap();
    let whole = Log::open(&path).unwrap();
    let mut damaged = bytes.clone();
    // the last chunks: points and checkpoint of each step
    for (lost, place) in chunks(&bytes).iter().rev().enumerate() {
        damaged[place.start + place.len() * 3 / 4] ^= 0x55;
        std::fs::write(&path, &damaged).unwrap();
        let log = Log::open(&path).unwrap();
        assert_eq!(log.checkpoints().len(), whole.checkpoints().len());
        let sound = (0..log.checkpoints().len())
            .rev()
            .find(|i| log.checkpoint(*i).is_ok());
        match (log.last_sound_checkpoint(), sound) {
            (Ok((index, state)), Some(sound)) => {
                assert_eq!(index, sound, "{lost} chunks are lost");
                assert_eq!(state, whole.checkpoint(sound).unwrap());
            }
            (Err(LogError::Damaged { .. }), None) => return,
            (found, sound) => panic!("{sound:?}, but {:?}", found.map(|(index, _)| index)),
        }
    }
    panic!("all checkpoints are damaged");
}

#[test]
fn a_record_of_impossible_length_ends_the_log() {
    let (_folder, path) = logged(3, 30);
    let bytes = std::fs::read(&path).unwrap();
    let last = chunks(&bytes).pop().unwrap();
    for wrong in [u64::MAX, u64::MAX - 8, 1 << 63, bytes.len() as u64] {
        let mut damaged = bytes.clone();
        damaged[last.start - 8..last.start].copy_from_slice(&wrong.to_le_bytes());
        std::fs::write(&path, &damaged).unwrap();
        let log = Log::open(&path).unwrap();
        let expected = last.start as u64 - 9;
        assert!(
            matches!(log.ending(), Ending::Damaged { at, .. } if *at == expected),
            "{wrong}: {:?}",
            log.ending()
        );
        assert!(!log.times(BODY).is_empty());
        // in a file that was not closed it may be a record that was being written
        std::fs::write(&path, &damaged[..damaged.len() - 8]).unwrap();
        let log = Log::open(&path).unwrap();
        assert_eq!(
            *log.ending(),
            Ending::Unfinished { at: expected },
            "{wrong}"
        );
    }
}

#[test]
fn the_first_cloud_is_the_first_that_can_be_read() {
    // beyond 256 KiB a state is a chunk of its own, which is read only when it is asked for
    let (_folder, path) = logged(3, 40_000);
    let bytes = std::fs::read(&path).unwrap();
    let mut damaged = bytes.clone();
    for place in chunks(&bytes) {
        damaged[place.start + place.len() * 3 / 4] ^= 0x55;
        std::fs::write(&path, &damaged).unwrap();
        let log = Log::open(&path).unwrap();
        let sound = (0..log.times(BODY).len()).find_map(|i| log.cloud(BODY, i).ok());
        let found = log.first_cloud(BODY).map(|cloud| cloud.time).ok();
        assert_eq!(found, sound.map(|cloud| cloud.time));
    }
}
