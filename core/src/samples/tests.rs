//! Files of VTK 9.7 (`test_data/make.py`) and tables, and values between their points.

use proptest::prelude::*;
use tempfile::TempDir;

use super::*;

fn wanted(field: &str) -> Wanted {
    Wanted {
        column: None,
        field: field.into(),
    }
}

fn test_data(name: &str) -> Vec<u8> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("src/samples/test_data")
        .join(name);
    std::fs::read(path).expect(name)
}

fn linear(x: &Vector3<f64>) -> f64 {
    300.0 + 10.0 * x.x + 20.0 * x.y + 40.0 * x.z
}

/// A folder with one table.
fn folder(text: &str) -> TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("t.csv"), text).expect("written");
    folder
}

fn file(name: &str, column: Option<&str>) -> FieldFile {
    FieldFile {
        file: name.into(),
        column: column.map(String::from),
    }
}

#[test]
fn vtk_files_of_every_encoding_are_the_same_field() {
    for name in [
        "ascii",
        "binary",
        "binary_zlib",
        "appended_raw",
        "appended_raw_zlib",
        "appended_base64",
        "appended_base64_zlib",
        "big_endian",
    ] {
        let bytes = test_data(&format!("{name}.vtu"));
        let samples = Samples::of_vtk(&bytes, &wanted("T")).expect(name);
        assert_eq!(samples.values.len(), 12, "{name}");
        for (at, value) in samples.positions.iter().zip(&samples.values) {
            assert_eq!(*value, linear(at), "{name}");
        }
        let cells = Samples::of_vtk(&bytes, &wanted("Tc")).expect(name);
        assert_eq!(
            cells.positions,
            [Vector3::new(0.5, 0.5, 0.5), Vector3::new(2.0, 0.5, 0.5)]
        );
        assert_eq!(cells.values, [335.0, 350.0], "{name}");
    }
}

#[test]
fn what_a_vtk_file_lacks_is_named() {
    let error = |name: &str, field: &str| {
        let samples = Samples::of_vtk(&test_data(name), &wanted(field));
        samples.expect_err(name).to_string()
    };
    assert!(error("appended_raw_lz4.vtu", "T").contains("without compression or with zlib"));
    assert!(error("ascii.vtu", "U").contains("none of its columns `T`, `Tc` is called `U`"));
    let of = |text: &str| {
        let samples = Samples::of_vtk(text.as_bytes(), &wanted("T"));
        samples.expect_err(text).to_string()
    };
    assert!(of("x,y\n1,2").contains("not valid XML"));
    assert!(of("<VTKFile type='ImageData'/>").contains("its type is `ImageData`"));
    let nan = String::from_utf8(test_data("ascii.vtu"))
        .expect("text")
        .replacen(" 330 ", " nan ", 1);
    assert!(of(&nan).contains("the value of the array `T` at point"));
}

/// A file that ends early or has a wrong byte is refused or read; it never panics and takes no memory beyond its size.
#[test]
fn damaged_vtk_files_do_no_harm() {
    for name in [
        "ascii.vtu",
        "binary.vtu",
        "appended_raw.vtu",
        "appended_raw_zlib.vtu",
        "appended_base64_zlib.vtu",
    ] {
        let bytes = test_data(name);
        for place in (0..bytes.len()).step_by(7) {
            let _ = Samples::of_vtk(&bytes[..place], &wanted("T"));
            let mut wrong = bytes.clone();
            wrong[place] ^= 1 << (place % 8);
            let _ = Samples::of_vtk(&wrong, &wanted("T"));
        }
    }
}

#[test]
fn a_table_may_have_several_times() {
    let folder = folder("time,x,T\n5,0,400\n0,0,300\n0,1,310\n5,1,430\n");
    let states =
        States::of_file(&file("t.csv", None), "temperature", folder.path()).expect("valid");
    assert_eq!(states.times(), [0.0, 5.0]);
    let values = states.samples(1).expect("read");
    assert_eq!(values.values, [400.0, 430.0]);
}

#[test]
fn a_collection_and_a_list_have_their_files_by_time() {
    let folder = tempfile::tempdir().expect("a folder");
    for name in ["ascii.vtu", "binary.vtu"] {
        std::fs::write(folder.path().join(name), test_data(name)).expect("written");
    }
    let collection = "<VTKFile type='Collection'><Collection><DataSet timestep='1' file='ascii.vtu'/>\
        <DataSet timestep='3' file='binary.vtu'/></Collection></VTKFile>";
    std::fs::write(folder.path().join("run.pvd"), collection).expect("written");
    let of_collection = States::of_file(&file("run.pvd", Some("T")), "temperature", folder.path());
    let series = FieldSeries {
        time: vec![1.0, 3.0],
        file: vec!["ascii.vtu".into(), "binary.vtu".into()],
        column: Some("T".into()),
    };
    let of_series = States::of_series(&series, "temperature", folder.path());
    for states in [of_collection, of_series] {
        let states = states.expect("valid");
        assert_eq!(states.times(), [1.0, 3.0]);
        assert_eq!(states.samples(1).expect("read").values.len(), 12);
    }
    let backwards = FieldSeries {
        time: vec![3.0, 1.0],
        ..series.clone()
    };
    let short = FieldSeries {
        time: vec![3.0],
        ..series
    };
    for (series, message) in [
        (backwards, "1 s follows 3 s"),
        (short, "1 times are given for 2 files"),
    ] {
        let error = States::of_series(&series, "T", folder.path()).expect_err(message);
        assert!(error.to_string().contains(message), "{error}");
    }
}

#[test]
fn mistakes_in_tables_name_the_file() {
    for (text, column, message) in [
        (
            "a,b\n1,2",
            None,
            "none of the columns `x`, `y` and `z`; it has `a`, `b`",
        ),
        (
            "x,T,U\n1,2,3",
            None,
            "none of its columns `T`, `U` is called `temperature`",
        ),
        ("x,T,U\n1,2,3", Some("V"), "no column `V`; it has `T`, `U`"),
        ("x,T\n1,hot", None, "line 2: `hot` in the column `T`"),
        ("x,T [C]\n1,20", None, "the column `T [C]` is in C"),
        ("x [mm],T\n1,20", None, "the column `x [mm]` is in mm"),
        ("x,T\n", None, "it has no point"),
    ] {
        let folder = folder(text);
        let states = States::of_file(&file("t.csv", column), "temperature", folder.path());
        let error = states.expect_err(text).to_string();
        assert!(
            error.contains("t.csv: ") && error.contains(message),
            "{text}: {error}"
        );
    }
    let folder = folder("\"T\",\"Points:0\",\"Points:1\",\"Points:2\"\n300,1,2,3\n");
    let states = States::of_file(&file("t.csv", None), "temperature", folder.path())
        .expect("as ParaView writes");
    assert_eq!(
        states.samples(0).expect("read").positions,
        [Vector3::new(1.0, 2.0, 3.0)]
    );
}

fn samples(
    positions: Vec<Vector3<f64>>,
    axes: [bool; 3],
    field: impl Fn(&Vector3<f64>) -> f64,
) -> Samples {
    Samples {
        values: positions.iter().map(field).collect(),
        positions,
        axes,
    }
}

/// Points of a grid with this spacing (m) in a unit cube of so many dimensions.
fn grid(spacing: f64, dimension: usize) -> Vec<Vector3<f64>> {
    let count = |axis: usize| {
        if axis < dimension {
            (1.0 / spacing).round() as usize + 1
        } else {
            1
        }
    };
    let mut all = Vec::new();
    for k in 0..count(2) {
        for j in 0..count(1) {
            all.extend((0..count(0)).map(|i| Vector3::new(i as f64, j as f64, k as f64) * spacing));
        }
    }
    all
}

proptest! {
    #[test]
    fn linear_fields_are_exact_inside_of_the_points_and_near_them(
        noise in prop::collection::vec(prop::array::uniform3(-0.04..0.04), 216),
        at in prop::array::uniform3(-0.05..1.05),
        dimension in 1_usize..=3,
    ) {
        let mut positions = grid(0.2, dimension);
        for (position, noise) in positions.iter_mut().zip(noise) {
            (0..dimension).for_each(|a| position[a] += noise[a]);
        }
        let at = Vector3::from_fn(|a, _| if a < dimension { at[a] } else { 0.0 });
        let value = samples(positions, [true; 3], linear).at(&[at], dimension).expect("near").values[0];
        prop_assert!((value - linear(&at)).abs() < 1e-9, "{value} {}", linear(&at));
    }

    #[test]
    fn values_stay_near_those_around(at in prop::array::uniform3(-0.05..1.05), hot in 0_usize..216) {
        let positions = grid(0.2, 3);
        let place = positions[hot];
        let of = samples(positions, [true; 3], |x| if *x == place { 3000.0 } else { 300.0 });
        let value = of.at(&[Vector3::from(at)], 3).expect("near").values[0];
        prop_assert!((300.0 - 1e-9..=3000.0 + 1e-9).contains(&value), "{value}");
    }
}

/// Second order between the points of a grid: the error falls to a quarter with half the spacing.
#[test]
fn curved_fields_converge_with_second_order() {
    let field = |x: &Vector3<f64>| (3.0 * x.x).sin() * (2.0 * x.y).cos() + x.z * x.z;
    let asked: Vec<Vector3<f64>> = (0..200)
        .map(|i| {
            Vector3::new(
                0.618 * i as f64 % 1.0,
                0.414 * i as f64 % 1.0,
                0.732 * i as f64 % 1.0,
            )
        })
        .collect();
    let error = |spacing: f64| {
        let of = samples(grid(spacing, 3), [true; 3], field);
        let found = of.at(&asked, 3).expect("inside").values;
        let squares = found
            .iter()
            .zip(&asked)
            .map(|(f, x)| (f - field(x)).powi(2));
        (squares.sum::<f64>() / asked.len() as f64).sqrt()
    };
    let order = (error(0.1) / error(0.05)).log2();
    assert!(order > 1.7, "{order}");
}

/// Coordinates that the table lacks, and those along which its points do not differ, are no matter.
#[test]
fn fields_of_fewer_dimensions_are_constant_along_the_others() {
    let line: Vec<Vector3<f64>> = (0..11)
        .map(|i| Vector3::new(0.1 * f64::from(i), 0.0, 0.0))
        .collect();
    let by_x = |x: &Vector3<f64>| 300.0 + 10.0 * x.x;
    let at = [Vector3::new(0.33, 0.4, 0.7), Vector3::new(0.71, -0.2, 0.1)];
    let found = samples(line, [true, false, false], by_x)
        .at(&at, 3)
        .expect("no matter");
    for (value, at) in found.values.iter().zip(&at) {
        assert!((value - by_x(at)).abs() < 1e-9, "{value}");
    }
    // a plane of points in a body with a depth, as of a thermal camera
    let plane = grid(0.1, 2);
    let at = [Vector3::new(0.33, 0.4, 0.05), Vector3::new(0.71, 0.2, -0.4)];
    let found = samples(plane, [true; 3], by_x)
        .at(&at, 3)
        .expect("one is near");
    assert_eq!(found.outside, 1);
    for (value, at) in found.values.iter().zip(&at) {
        assert!((value - by_x(at)).abs() < 1e-9, "{value}");
    }
}

#[test]
fn points_elsewhere_are_refused_and_points_outside_counted() {
    let of = samples(grid(0.1, 3), [true; 3], linear);
    let far: Vec<Vector3<f64>> = grid(100.0, 3)
        .iter()
        .map(|x| x + Vector3::repeat(50.0))
        .collect();
    let error = of.at(&far, 3).expect_err("millimetres").to_string();
    assert!(error.contains("lengths are in metres"), "{error}");
    let found = of
        .at(&[Vector3::repeat(0.5), Vector3::new(1.5, 0.5, 0.5)], 3)
        .expect("one inside");
    assert_eq!(found.outside, 1);
    assert!((found.farthest - 0.5).abs() < 1e-12);
}
