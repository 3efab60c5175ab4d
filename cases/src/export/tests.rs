use std::fs;

use super::*;
use crate::plot::fixture;

const CELLS: [usize; 3] = [6, 3, 2];

fn exported(change: impl FnOnce(&mut ExportArgs)) -> (tempfile::TempDir, Vec<PathBuf>) {
    let folder = tempfile::tempdir().expect("a folder");
    let log = folder.path().join("spot.mcap");
    fixture::write_log(&log, CELLS);
    let mut args = ExportArgs {
        log,
        out: None,
        format: ExportFormat::Vtk,
        body: vec!["plate".into()],
        field: Vec::new(),
        at: Vec::new(),
        every: 1,
    };
    change(&mut args);
    let exported = export(&args).expect("files");
    assert!(exported.is_displaced);
    (folder, exported.files)
}

fn read(paths: &[PathBuf], name: &str) -> Vec<u8> {
    let path = paths.iter().find(|path| path.ends_with(name));
    fs::read(path.unwrap_or_else(|| panic!("no {name} in {paths:?}"))).expect("readable")
}

/// Offsets and names must lead a reader to the numbers that were logged.
#[test]
fn vtu_holds_the_logged_numbers_where_its_header_says() {
    let (folder, paths) = exported(|_| {});
    let log = Log::open(folder.path().join("spot.mcap")).expect("a log");
    let cloud = log.cloud("plate", 5).expect("the last");
    let bytes = read(&paths, "plate-00005.vtu");
    let marker = b"<AppendedData encoding=\"raw\">\n_";
    let data = bytes
        .windows(marker.len())
        .position(|w| w == marker)
        .expect("data")
        + marker.len();
    let header = String::from_utf8(bytes[..data].to_vec()).expect("text");
    let numbers = |name: &str| -> Vec<f64> {
        let line = header
            .lines()
            .find(|l| l.contains(&format!("Name=\"{name}\"")))
            .expect(name);
        assert!(line.contains("Float64"), "{line}");
        let offset = line
            .split("offset=\"")
            .nth(1)
            .and_then(|rest| rest.split('"').next());
        let start = data + offset.expect("offset").parse::<usize>().expect("a number");
        let word = |at: usize| <[u8; 8]>::try_from(&bytes[at..at + 8]).expect("eight");
        let length = u64::from_le_bytes(word(start)) as usize / 8;
        (0..length)
            .map(|i| f64::from_le_bytes(word(start + 8 + 8 * i)))
            .collect()
    };
    assert_eq!(numbers("temperature"), cloud.fields[0].values);
    assert_eq!(numbers("displacement"), cloud.fields[1].values);
    assert_eq!(numbers("Points"), cloud.positions.as_flattened());
    // cells between 6 x 3 x 2 points
    assert!(header.contains(r#"NumberOfPoints="36" NumberOfCells="10""#));
    assert!(header.contains("displaced positions"));
    let undeformed = log.cloud("plate", 0).expect("the first");
    assert_eq!(
        numbers("reference_position"),
        undeformed.positions.as_flattened()
    );

    let collection = String::from_utf8(read(&paths, "spot.pvd")).expect("text");
    assert_eq!(collection.matches("<DataSet ").count(), fixture::TIMES);
    assert!(collection.contains(r#"timestep="1" group="" part="0" file="plate-00005.vtu""#));
}

#[test]
fn tables_have_units_and_read_back_exactly() {
    let (folder, paths) = exported(|args| {
        args.format = ExportFormat::Csv;
        args.field = vec!["displacement".into()];
        args.at = vec![0.61];
    });
    let log = Log::open(folder.path().join("spot.mcap")).expect("a log");
    let cloud = log.cloud("plate", 3).expect("there");
    let text = String::from_utf8(read(&paths, "plate-00003.csv")).expect("text");
    let mut lines = text.lines();
    let header = "x [m],y [m],z [m],displacement.x [m],displacement.y [m],displacement.z [m]";
    assert_eq!(lines.next(), Some(header));
    for (point, line) in lines.by_ref().enumerate() {
        let row: Vec<f64> = line
            .split(',')
            .map(|x| x.parse().expect("a number"))
            .collect();
        assert_eq!(row[..3], cloud.positions[point]);
        assert_eq!(row[3..], cloud.fields[1].values[3 * point..3 * point + 3]);
    }
    assert_eq!(text.lines().count(), 37);

    let probe = String::from_utf8(read(&paths, "probe-thermocouples.csv")).expect("text");
    assert!(
        probe.starts_with("time [s],near_weld [K],far [K],uz [m]\n0,300,300,-0\n"),
        "{probe}"
    );
    let progress = String::from_utf8(read(&paths, "progress.csv")).expect("text");
    assert!(progress.starts_with("time [s],step,step_size [s],sub_steps.heat,coupling_passes,"));
    assert_eq!(
        read(&paths, "balance.csv")
            .iter()
            .filter(|&&byte| byte == b'\n')
            .count(),
        7
    );
    assert!(!paths.iter().any(|path| path.ends_with("plate-00004.csv")));
}

#[test]
fn unknown_names_are_answered_with_what_there_is() {
    let folder = tempfile::tempdir().expect("a folder");
    let log = folder.path().join("spot.mcap");
    fixture::write_log(&log, CELLS);
    let args = ExportArgs {
        log,
        out: None,
        format: ExportFormat::Csv,
        body: Vec::new(),
        field: vec!["heat".into()],
        at: Vec::new(),
        every: 2,
    };
    let error = export(&args).expect_err("no such field").to_string();
    assert!(
        error.contains("`heat`") && error.contains("displacement, temperature"),
        "{error}"
    );
    assert!(!folder.path().join("spot-export").exists());
}
