use super::*;
use crate::melt_pool::Travel;

fn args(log: PathBuf, out: &Path) -> PlotArgs {
    PlotArgs {
        log,
        out: Some(out.into()),
        format: PictureFormat::Png,
        body: Vec::new(),
        field: Vec::new(),
        at: Vec::new(),
        section: Vec::new(),
        range: None,
        isotherm: Vec::new(),
        celsius: false,
        deform: None,
        travel: Travel::X,
        width: 600,
        film: None,
        frames: 4,
        rate: 10,
    }
}

fn logged() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a folder");
    let log = folder.path().join("spot.mcap");
    fixture::write_log(&log, [24, 8, 6]);
    (folder, log)
}

#[test]
fn every_picture_is_a_png_of_the_asked_width_with_more_than_paper_on_it() {
    let (folder, log) = logged();
    let paths = plot(&args(log, &folder.path().join("out"))).expect("pictures");
    let names: Vec<_> = paths
        .iter()
        .map(|p| p.file_name().expect("a name").to_string_lossy())
        .collect();
    for name in [
        "plate-temperature-1s.png",
        "plate-displacement-1s.png",
        "plate-melt-pool.png",
        "sheet-temperature-1s.png",
        "probe-thermocouples.png",
        "balance-error.png",
    ] {
        assert!(
            names.iter().any(|found| found == name),
            "{name} is not among {names:?}"
        );
    }
    for path in paths {
        let file = std::io::BufReader::new(fs::File::open(&path).expect("there"));
        let mut reader = png::Decoder::new(file).read_info().expect("PNG");
        assert_eq!(reader.info().width, 600, "{}", path.display());
        assert!(reader.info().height > 150);
        let mut pixels = vec![0; reader.output_buffer_size().expect("small")];
        reader.next_frame(&mut pixels).expect("whole");
        // axes and letters alone are some 2 % of a chart
        let inked = pixels.iter().filter(|&&byte| byte != 255).count();
        assert!(inked > pixels.len() / 100, "{}", path.display());
    }
}

#[test]
fn deformed_pictures_come_as_svg_for_the_nearest_times() {
    let (folder, log) = logged();
    let mut args = args(log, &folder.path().join("out"));
    args.format = PictureFormat::Svg;
    args.field = vec!["displacement.z".into()];
    args.body = vec!["plate".into()];
    args.at = vec![0.41, 0.39, 0.8];
    args.deform = Some(20.0);
    let paths = plot(&args).expect("pictures");
    let plates: Vec<_> = paths
        .iter()
        .filter(|path| path.to_string_lossy().contains("displacement.z"))
        .collect();
    assert_eq!(plates.len(), 2);
    let text = fs::read_to_string(plates[0]).expect("text");
    assert!(text.starts_with(r#"<svg width="600""#), "{}", &text[..80]);
    assert!(text.contains("t = 400 ms") || text.contains("t = 0.4 s"));
}

#[test]
fn mistakes_are_answered_with_what_there_is() {
    let (folder, log) = logged();
    let mut wrong = args(log.clone(), folder.path());
    wrong.field = vec!["temprature".into()];
    let error = plot(&wrong).expect_err("misspelt").to_string();
    assert!(
        error.contains("`temprature`") && error.contains("temperature"),
        "{error}"
    );
    let mut wrong = args(log, folder.path());
    wrong.body = vec!["plaet".into()];
    let error = plot(&wrong).expect_err("misspelt").to_string();
    assert!(error.contains("plate, sheet"), "{error}");
}

#[test]
fn extreme_arguments_do_not_panic() {
    let (folder, log) = logged();
    for extreme in [f64::NAN, f64::INFINITY, -1e300, 1e300, 0.0] {
        let mut args = args(log.clone(), &folder.path().join("out"));
        args.format = PictureFormat::Svg;
        args.body = vec!["plate".into()];
        args.at = vec![0.2];
        args.isotherm = vec![extreme];
        args.deform = Some(extreme);
        assert!(plot(&args).is_ok(), "{extreme}");
        args.at = vec![extreme];
        let is_logged = extreme == 0.0;
        assert_eq!(plot(&args).is_ok(), is_logged, "{extreme}");
    }
}

/// For people: `PERIMELT_PLOTS=folder cargo test -p perimelt --lib -- --ignored show`.
#[test]
#[ignore = "writes pictures to look at"]
fn show_pictures() {
    let folder = PathBuf::from(std::env::var("PERIMELT_PLOTS").expect("a folder"));
    fs::create_dir_all(&folder).expect("writable");
    let log = folder.join("spot.mcap");
    fixture::write_log(&log, [120, 24, 20]);
    let mut args = args(log, &folder);
    args.width = 1200;
    plot(&args).expect("pictures");
    args.field = vec!["displacement.x".into()];
    args.deform = Some(30.0);
    plot(&args).expect("pictures");
    args.field.clear();
    args.deform = None;
    args.format = PictureFormat::Svg;
    plot(&args).expect("pictures");
    let export = crate::export::ExportArgs {
        log: args.log,
        out: None,
        format: crate::export::ExportFormat::Vtk,
        body: Vec::new(),
        field: Vec::new(),
        at: Vec::new(),
        every: 1,
    };
    crate::export::export(&export).expect("files");
}
