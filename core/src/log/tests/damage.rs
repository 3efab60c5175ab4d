//! Logs with damaged chunks.

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
