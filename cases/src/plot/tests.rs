use perimelt_core::log::{
    BodyInfo, CloudView, Coordinates, FieldView, PlyInfo, Precision, RunInfo, Writer,
};

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use clap::Parser;

use super::*;

#[derive(Parser)]
#[command(args_override_self = true)]
struct CommandLine {
    #[command(flatten)]
    args: PlotArgs,
}

/// Arguments for pictures of the log in a folder.
fn args(folder: &Path, options: &str) -> PlotArgs {
    let [log, out] = ["spot.mcap", "out"].map(|name| folder.join(name).display().to_string());
    let line = ["plot", &log, "--width", "600", "--out", &out];
    CommandLine::parse_from(line.into_iter().chain(options.split_whitespace())).args
}

/// Names and paths of the pictures.
fn files(args: &PlotArgs) -> Vec<(String, PathBuf)> {
    let plotted = plot(args).expect("pictures").into_iter();
    let named = plotted.map(|Plotted { path, .. }| {
        let name = path.file_name().expect("a name").to_string_lossy();
        (name.into_owned(), path)
    });
    named.collect()
}

fn logged() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    fixture::write_log(&folder.path().join("spot.mcap"), [24, 8, 6]);
    folder
}

/// The first picture whose name begins so, as SVG.
fn svg(folder: &Path, name: &str, options: &str) -> String {
    let files = files(&args(folder, &format!("--format svg {options}")));
    let mut files = files.iter().filter(|(file, _)| file.starts_with(name));
    fs::read_to_string(&files.next().expect("a picture").1).expect("text")
}

#[test]
fn every_picture_is_a_png_of_the_asked_width_with_more_than_paper_on_it() {
    let folder = logged();
    let files = files(&args(folder.path(), ""));
    for name in [
        "plate-temperature-1s.png",
        "plate-displacement-1s.png",
        "plate-melt-pool.png",
        "sheet-temperature-1s.png",
        "probe-thermocouples.png",
        "balance-error.png",
    ] {
        let mut names = files.iter().map(|(found, _)| found);
        assert!(names.any(|found| found == name), "no {name}");
    }
    for (name, path) in files {
        let file = std::io::BufReader::new(fs::File::open(&path).expect("there"));
        let mut reader = png::Decoder::new(file).read_info().expect("PNG");
        assert_eq!(reader.info().width, 600, "{name}");
        assert!(reader.info().height > 150);
        let mut pixels = vec![0; reader.output_buffer_size().expect("small")];
        reader.next_frame(&mut pixels).expect("whole");
        // axes and letters alone are some 2 % of a chart
        let inked = pixels.iter().filter(|&&byte| byte != 255).count();
        assert!(inked > pixels.len() / 100, "{name}");
    }
}

#[test]
fn deformed_pictures_come_as_svg_for_the_nearest_times() {
    let folder = logged();
    let options = "--body plate --field displacement.z --at 0.41,0.39,0.8 --deform 20";
    let only = args(
        folder.path(),
        &format!("--format svg --only fields {options}"),
    );
    assert_eq!(files(&only).len(), 2);
    let text = svg(folder.path(), "plate-displacement", options);
    assert!(text.starts_with(r#"<svg width="600""#), "{}", &text[..80]);
    assert!(text.contains("t = 400 ms") || text.contains("t = 0.4 s"));
}

#[test]
fn sections_pass_through_the_hottest_point_of_the_time_shown() {
    let folder = logged();
    // the spot is at 1.8 mm + 2.4 mm/s t; nothing is hot at 0 s, and half of the states that are hot are over at 0.6 s
    for (at, x) in [("0.4", "2.625"), ("1", "4.125"), ("0", "3.125")] {
        let svg = svg(folder.path(), "plate-temperature", &format!("--at {at}"));
        let caption = format!("section B, x = {x} mm");
        assert!(svg.contains(&caption), "no `{caption}` at {at} s");
    }
}

#[test]
fn numbers_below_zero_have_a_minus_sign() {
    let folder = logged();
    let options = "--at 1 --section z=-1.1e-3 --celsius --isotherm=-5,800";
    let svg = svg(folder.path(), "plate-temperature", options);
    assert!(svg.contains("z = −1.125 mm"), "caption");
    let is_wrong = |line: &&str| line.starts_with("-") || line.contains(" -");
    assert_eq!(svg.lines().find(is_wrong), None);
}

#[test]
fn mistakes_are_answered_with_what_there_is() {
    let folder = logged();
    for (options, expected) in [
        (
            "--field temprature",
            "`temprature`; it has: displacement, temperature",
        ),
        ("--body plaet", "plate, sheet"),
        ("--dpi 300 --width 1200", "expected at least 1563 pixels"),
        ("--section x=0.1", "extends from x = 0 to 0.006 m"),
    ] {
        let error = plot(&args(folder.path(), options)).expect_err(options);
        assert!(error.to_string().contains(expected), "{error}");
    }
}

#[test]
fn extreme_arguments_do_not_panic() {
    let folder = logged();
    for extreme in [f64::NAN, f64::INFINITY, -1e300, 1e300, 0.0] {
        let mut args = args(folder.path(), "--format svg --body plate --at 0.2");
        (args.isotherm, args.deform) = (vec![extreme], Some(extreme));
        assert!(plot(&args).is_ok(), "{extreme}");
        args.at = vec![extreme];
        let is_logged = extreme == 0.0;
        assert_eq!(plot(&args).is_ok(), is_logged, "{extreme}");
    }
}

#[test]
fn letters_grow_with_the_picture_or_keep_their_size_on_paper() {
    let folder = logged();
    let of = |options: &str| {
        let options = format!("--body plate --only melt-pool {options}");
        let [(_, path)] = &files(&args(folder.path(), &options))[..] else {
            panic!("one picture");
        };
        let file = std::io::BufReader::new(fs::File::open(path).expect("there"));
        png::Decoder::new(file)
            .read_info()
            .expect("PNG")
            .info()
            .size()
    };
    let (_, usual) = of("--width 1200");
    // this picture with twice the pixels
    assert_eq!(of("--width 2400"), (2400, 2 * usual));
    assert_eq!(of("--width 2400 --dpi 192"), (2400, 2 * usual));
    // letters and the height of a chart stay, the chart becomes wider
    assert_eq!(of("--width 2400 --dpi 96"), (2400, usual));
}

#[test]
fn pictures_of_some_kinds_only() {
    let folder = logged();
    let names = |options: &str| -> Vec<String> {
        let files = files(&args(folder.path(), options));
        files.into_iter().map(|(name, _)| name).collect()
    };
    let mut all = names("");
    for (kind, part) in [
        ("melt-pool", "-melt-pool"),
        ("probes", "probe-"),
        ("balance", "balance-error"),
    ] {
        let (wanted, others): (Vec<_>, _) = all.into_iter().partition(|name| name.contains(part));
        assert!(!wanted.is_empty(), "{kind}");
        assert_eq!(names(&format!("--only {kind}")), wanted);
        all = others;
    }
    assert_eq!(names("--only fields"), all);
    // a log without any of them
    let empty = folder.path().join("spot.mcap");
    let writer = Writer::create(&empty, &RunInfo::default(), "empty.toml", "");
    writer.expect("a new file").finish().expect("written");
    let error = plot(&args(folder.path(), "--only balance,probes")).expect_err("nothing");
    let expected = "`--only balance,probes`: the log has nothing";
    assert!(error.to_string().contains(expected), "{error}");
}

#[test]
fn what_did_not_change_is_not_written_again() {
    let folder = logged();
    for format in ["png", "svg"] {
        let mut args = args(folder.path(), &format!("--format {format}"));
        let first = plot(&args).expect("pictures");
        assert!(first.iter().all(|plotted| !plotted.unchanged));
        let read = |plotted: &Plotted| fs::read(&plotted.path).expect("there");
        let bytes: Vec<_> = first.iter().map(read).collect();
        let again = plot(&args).expect("pictures");
        assert!(again.iter().all(|plotted| plotted.unchanged), "{again:?}");
        assert!(again.iter().map(read).eq(bytes));
        // only pictures of temperatures are drawn again
        args.celsius = true;
        for plotted in plot(&args).expect("pictures") {
            let name = plotted.path.to_string_lossy();
            let is_other = ["displacement", "balance"]
                .iter()
                .any(|part| name.contains(part));
            assert_eq!(plotted.unchanged, is_other, "{name}");
        }
        // a file of something else is replaced, and one that was not written to its end
        let whole = read(&first[0]);
        for other in [&b"no picture"[..], &whole[..whole.len() - 20]] {
            fs::write(&first[0].path, other).expect("writable");
            assert!(!plot(&args).expect("pictures")[0].unchanged);
            assert_eq!(read(&first[0]), whole);
        }
    }
}

#[test]
fn smooth_pictures_have_colours_between_those_of_the_points() {
    let folder = logged();
    let colours = |options: &str| {
        let options = format!("--only fields --at 0.4 {options}");
        let svg = svg(folder.path(), "plate-temperature", &options);
        let fills = svg.split("fill=\"").skip(1);
        let fills: BTreeSet<_> = fills.filter_map(|rest| rest.split('"').next()).collect();
        fills.len()
    };
    for deform in ["", "--deform 10"] {
        let (points, between) = (colours(deform), colours(&format!("--smooth {deform}")));
        assert!(between > points, "{deform}: {between} {points}");
    }
}

/// A laminate of five plies of two layers, 4 x 3 points each, whose field is 100 where the layer is the higher one of its ply.
fn laminate(folder: &Path) {
    let ply = |n: usize| PlyInfo {
        angle: 45.0 * n as f64,
        middle: 1e-3 * (n as f64 + 0.5),
    };
    let body = BodyInfo {
        name: "plate".into(),
        dimension: 3,
        spacing: 2e-3,
        points: 120,
        plies: (0..5).map(ply).collect(),
        ..BodyInfo::default()
    };
    let run = RunInfo {
        bodies: vec![body],
        ..RunInfo::default()
    };
    let path = folder.join("spot.mcap");
    let mut writer = Writer::create(&path, &run, "plate.toml", "").expect("a new file");
    let points = (0..120).map(|point| (point % 4, point / 4 % 3, point / 12));
    let place = |(i, j, layer): (usize, usize, usize)| {
        let station = if layer % 2 == 0 { -0.3e-3 } else { 0.3e-3 };
        [
            2e-3 * i as f64,
            2e-3 * j as f64,
            ply(layer / 2).middle + station,
        ]
    };
    let positions: Vec<[f64; 3]> = points.clone().map(place).collect();
    let [mut plies, mut damage] = [Vec::new(), Vec::new()];
    for (_, _, layer) in points {
        plies.push((layer / 2 + 1) as f64);
        damage.push(if layer % 2 == 0 { 0.0 } else { 100.0 });
    }
    let fields = [("ply", &plies), ("damage", &damage)].map(|(name, values)| FieldView {
        name,
        components: 1,
        values,
    });
    let cloud = CloudView {
        time: 0.0,
        positions: Coordinates::Listed(&positions),
        fields: &fields,
    };
    writer
        .points("plate", Precision::F64, &cloud)
        .expect("written");
    writer.finish().expect("written");
}

#[test]
fn plies_are_drawn_from_above_and_chosen_by_number() {
    let folder = tempfile::tempdir().expect("a folder");
    laminate(folder.path());
    let captions = |options: &str| {
        let svg = svg(folder.path(), "plate", &format!("--field damage {options}"));
        (1..6)
            .filter(|ply| svg.contains(&format!("ply {ply} of 5 from below, {}°", 45 * (ply - 1))))
            .collect::<Vec<usize>>()
    };
    assert_eq!(captions(""), [1, 3, 5]);
    assert_eq!(captions("--ply 4,2,4"), [2, 4]);
    // the highest ply first
    let svg = svg(
        folder.path(),
        "plate",
        "--field damage --ply 2,5 --range 0,100",
    );
    let at = |ply: usize| svg.find(&format!("ply {ply} of 5")).expect("drawn");
    assert!(at(5) < at(2));
    let refused = |options: &str| {
        plot(&args(folder.path(), options))
            .expect_err("refused")
            .to_string()
    };
    assert_eq!(
        refused("--field damage --ply 6"),
        "`--ply 6`: body `plate` has the plies 1 to 5"
    );
    assert_eq!(
        refused("--field damage --ply 0"),
        "`--ply 0`: body `plate` has the plies 1 to 5"
    );
    assert!(refused("--field damage --section x=0").contains("`--ply` chooses plies"));
}
