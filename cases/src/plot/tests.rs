use perimelt_core::log::{RunInfo, Writer};

use std::fs;
use std::path::Path;

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
        only: Vec::new(),
        smooth: false,
        width: 600,
        dpi: None,
        film: None,
        frames: 4,
        rate: 10,
    }
}

/// Paths of the pictures.
fn files(args: &PlotArgs) -> Vec<PathBuf> {
    let plotted = plot(args).expect("pictures");
    plotted.into_iter().map(|plotted| plotted.path).collect()
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
    let paths = files(&args(log, &folder.path().join("out")));
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
    let paths = files(&args);
    let plates: Vec<_> = paths
        .iter()
        .filter(|path| path.to_string_lossy().contains("displacement.z"))
        .collect();
    assert_eq!(plates.len(), 2);
    let text = fs::read_to_string(plates[0]).expect("text");
    assert!(text.starts_with(r#"<svg width="600""#), "{}", &text[..80]);
    assert!(text.contains("t = 400 ms") || text.contains("t = 0.4 s"));
}

/// The picture of the plate's temperature at a time (s), as SVG.
fn temperature_svg(mut args: PlotArgs, at: f64) -> String {
    args.format = PictureFormat::Svg;
    args.body = vec!["plate".into()];
    args.field = vec!["temperature".into()];
    args.at = vec![at];
    let paths = files(&args);
    let is_asked = |path: &&PathBuf| path.to_string_lossy().contains("plate-temperature");
    fs::read_to_string(paths.iter().find(is_asked).expect("a picture")).expect("text")
}

#[test]
fn sections_pass_through_the_hottest_point_of_the_time_shown() {
    let (folder, log) = logged();
    // the spot is at 1.8 mm + 2.4 mm/s t; nothing is hot at 0 s, and half of the states that are hot are over at 0.6 s
    for (at, x) in [(0.4, "2.625"), (1.0, "4.125"), (0.0, "3.125")] {
        let svg = temperature_svg(args(log.clone(), &folder.path().join("out")), at);
        let caption = format!("section B, x = {x} mm");
        assert!(svg.contains(&caption), "no `{caption}` at {at} s");
    }
}

/// Place of a text that begins so, in whatever pixels the file has.
fn place_of(svg: &str, text: &str) -> [f64; 2] {
    let (before, _) = svg.split_once(&format!(">\n{text}")).expect(text);
    let (_, tag) = before.rsplit_once("<text").expect("a tag");
    ["x", "y"].map(|name| {
        let (_, value) = tag.split_once(&format!(" {name}=\"")).expect(name);
        let (value, _) = value.split_once('"').expect("a value");
        value.parse().expect("a number")
    })
}

#[test]
fn the_letter_of_a_section_does_not_cover_the_caption() {
    let (folder, log) = logged();
    let height = |section: &str| {
        let mut args = args(log.clone(), &folder.path().join("out"));
        args.section = vec![section.parse().expect("a section")];
        let svg = temperature_svg(args, 1.0);
        let [caption, letter] = ["surface from above", "A\n"].map(|text| place_of(&svg, text));
        letter[1] - caption[1]
    };
    // drawn three times as large
    assert!(height("x=5e-4") > 3.0 * 16.0);
    assert!(height("x=5e-3").abs() < 3.0 * 4.0);
}

#[test]
fn numbers_below_zero_have_a_minus_sign() {
    let (folder, log) = logged();
    let mut args = args(log, &folder.path().join("out"));
    args.section = vec!["z=-1.1e-3".parse().expect("a section")];
    args.celsius = true;
    args.isotherm = vec![-5.0, 800.0];
    let svg = temperature_svg(args, 1.0);
    assert!(svg.contains("z = −1.125 mm"), "caption");
    let is_wrong = |line: &&str| line.starts_with("-") || line.contains(" -");
    assert_eq!(svg.lines().find(is_wrong), None);
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

/// Width and height of a PNG file.
fn size(path: &Path) -> (u32, u32) {
    let file = std::io::BufReader::new(fs::File::open(path).expect("there"));
    let reader = png::Decoder::new(file).read_info().expect("PNG");
    (reader.info().width, reader.info().height)
}

#[test]
fn letters_grow_with_the_picture_or_keep_their_size_on_paper() {
    let (folder, log) = logged();
    let of = |width: u32, dpi: Option<u32>| {
        let mut args = args(log.clone(), &folder.path().join(format!("{width}-{dpi:?}")));
        (args.width, args.dpi, args.body) = (width, dpi, vec!["plate".into()]);
        args.only = vec![PictureKind::MeltPool];
        let pictures: Vec<_> = files(&args).iter().map(|path| size(path)).collect();
        assert_eq!(pictures.len(), 1);
        pictures[0]
    };
    let (_, usual) = of(1200, None);
    // this picture with twice the pixels
    assert_eq!(of(2400, None), (2400, 2 * usual));
    assert_eq!(of(2400, Some(192)), (2400, 2 * usual));
    // letters and the height of a chart stay, the chart becomes wider
    assert_eq!(of(2400, Some(96)), (2400, usual));
    let mut narrow = args(log, folder.path());
    (narrow.width, narrow.dpi) = (1200, Some(300));
    let error = plot(&narrow).expect_err("too narrow").to_string();
    assert!(error.contains("expected at least 1563 pixels"), "{error}");
}

#[test]
fn pictures_of_some_kinds_only() {
    let (folder, log) = logged();
    let mut args = args(log, &folder.path().join("out"));
    let names = |args: &mut PlotArgs, kinds: &[PictureKind]| -> Vec<String> {
        args.only = kinds.to_vec();
        let name = |path: &PathBuf| {
            path.file_stem()
                .expect("a name")
                .to_string_lossy()
                .into_owned()
        };
        files(args).iter().map(name).collect()
    };
    let all = names(&mut args, &[]);
    let kinds = [
        (PictureKind::MeltPool, "-melt-pool"),
        (PictureKind::Probes, "probe-"),
        (PictureKind::Balance, "balance-error"),
    ];
    let mut others = 0;
    for (kind, part) in kinds {
        let wanted: Vec<_> = all
            .iter()
            .filter(|name| name.contains(part))
            .cloned()
            .collect();
        others += wanted.len();
        assert!(!wanted.is_empty(), "{kind:?}");
        assert_eq!(names(&mut args, &[kind]), wanted, "{kind:?}");
    }
    assert_eq!(
        names(&mut args, &[PictureKind::Fields]).len(),
        all.len() - others
    );
    // a log without any of them
    let empty = folder.path().join("empty.mcap");
    let writer = Writer::create(&empty, &RunInfo::default(), "empty.toml", "");
    writer.expect("a new file").finish().expect("written");
    (args.log, args.only) = (empty, vec![PictureKind::Balance, PictureKind::Probes]);
    let error = plot(&args).expect_err("nothing").to_string();
    assert!(
        error.contains("`--only balance,probes`: the log has nothing"),
        "{error}"
    );
}

#[test]
fn what_did_not_change_is_not_written_again() {
    let (folder, log) = logged();
    for format in [PictureFormat::Png, PictureFormat::Svg] {
        let mut args = args(log.clone(), &folder.path().join(format.extension()));
        args.format = format;
        let first = plot(&args).expect("pictures");
        assert!(first.iter().all(|plotted| !plotted.unchanged));
        let bytes: Vec<_> = first
            .iter()
            .map(|p| fs::read(&p.path).expect("there"))
            .collect();
        let again = plot(&args).expect("pictures");
        assert!(again.iter().all(|plotted| plotted.unchanged), "{again:?}");
        for (plotted, before) in again.iter().zip(&bytes) {
            assert_eq!(&fs::read(&plotted.path).expect("there"), before);
        }
        // only pictures of temperatures are drawn again
        args.celsius = true;
        for plotted in plot(&args).expect("pictures") {
            let name = plotted.path.to_string_lossy().into_owned();
            let is_other = ["displacement", "balance"]
                .iter()
                .any(|part| name.contains(part));
            assert_eq!(plotted.unchanged, is_other, "{name}");
        }
        // a file of something else is replaced, and one that was not written to its end
        let path = &first[0].path;
        let whole = fs::read(path).expect("there");
        for other in [&b"no picture"[..], &whole[..whole.len() - 20]] {
            fs::write(path, other).expect("writable");
            assert!(!plot(&args).expect("pictures")[0].unchanged);
            assert_eq!(fs::read(path).expect("there"), whole);
        }
    }
}

#[test]
fn smooth_pictures_have_colours_between_those_of_the_points() {
    let (folder, log) = logged();
    let colours = |smooth: bool, deform: Option<f64>| {
        let mut args = args(
            log.clone(),
            &folder.path().join(format!("{smooth}{deform:?}")),
        );
        (args.format, args.smooth, args.deform) = (PictureFormat::Svg, smooth, deform);
        (args.only, args.at) = (vec![PictureKind::Fields], vec![0.4]);
        let paths = files(&args);
        let is_asked = |path: &&PathBuf| path.to_string_lossy().contains("plate-temperature");
        let svg =
            fs::read_to_string(paths.iter().find(is_asked).expect("a picture")).expect("text");
        let fills = svg
            .split("fill=\"")
            .skip(1)
            .filter_map(|rest| rest.split('"').next());
        let fills: std::collections::BTreeSet<_> = fills.map(str::to_owned).collect();
        fills.len()
    };
    for deform in [None, Some(10.0)] {
        let (points, between) = (colours(false, deform), colours(true, deform));
        assert!(between > points, "{deform:?}: {between} {points}");
    }
}
