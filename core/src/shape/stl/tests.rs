use std::fmt::Write;

use super::*;
use crate::body::Body;
use crate::shape::Shape;

type Triangle = [[f32; 3]; 3];

/// |x| + |y| + |z| <= 1, of volume 4/3.
fn octahedron() -> Vec<Triangle> {
    let mut triangles = Vec::new();
    for [x, y, z] in [0, 1, 2, 3, 4, 5, 6, 7_u8].map(|n| [n & 1, n >> 1 & 1, n >> 2]) {
        let signs = [x, y, z].map(|bit| 1.0 - 2.0 * f32::from(bit));
        let mut corners = [0, 1, 2].map(|a| {
            let mut corner = [0.0; 3];
            corner[a] = signs[a];
            corner
        });
        if signs.iter().product::<f32>() < 0.0 {
            corners.swap(1, 2);
        }
        triangles.push(corners);
    }
    triangles
}

/// Moved and enlarged; turned inside out by a negative factor.
fn moved(triangles: &[Triangle], factor: f32, by: f32) -> Vec<Triangle> {
    let corner = |c: [f32; 3]| [factor * c[0] + by, factor * c[1], factor * c[2]];
    triangles.iter().map(|t| t.map(corner)).collect()
}

fn text(triangles: &[Triangle]) -> String {
    let mut text = String::from("solid test\n");
    for triangle in triangles {
        text += "facet normal 0 0 0\nouter loop\n";
        for [x, y, z] in triangle {
            writeln!(text, "vertex {x} {y} {z}").expect("a String grows");
        }
        text += "endloop\nendfacet\n";
    }
    text + "endsolid test\n"
}

fn binary(triangles: &[Triangle]) -> Vec<u8> {
    let triangle = |t: &Triangle| stl_io::Triangle {
        normal: stl_io::Normal::new([0.0; 3]),
        vertices: t.map(stl_io::Vertex::new),
    };
    let triangles: Vec<_> = triangles.iter().map(triangle).collect();
    let mut bytes = Vec::new();
    stl_io::write_stl(&mut bytes, triangles.iter()).expect("a Vec grows");
    bytes
}

fn load(bytes: &[u8], scale: f64) -> Result<Shape, StlError> {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("part.stl"), bytes).expect("writable");
    let mut shape = Shape::Stl(Stl::new("part.stl", scale));
    shape.load(folder.path())?;
    Ok(shape)
}

/// Volume of the points that fill a shape.
fn volume(shape: &Shape, spacing: f64) -> f64 {
    let body = Body::fill("part", shape, 3, spacing, 1.0).expect("points");
    body.points.volume.iter().sum()
}

#[test]
fn an_octahedron_contains_what_its_inequality_allows() {
    let shape = load(text(&octahedron()).as_bytes(), 1e-3).expect("closed");
    assert_eq!(shape.mistake(), None);
    let (min, max) = shape.bounds().expect("bounded");
    assert_eq!((min, max), (Vector3::repeat(-1e-3), Vector3::repeat(1e-3)));
    // rays through the corners and along the edges, too
    let axis: Vec<f64> = (-12..=12).map(|n| f64::from(n) * 1e-4).collect();
    for (&x, &y, &z) in grid(&axis) {
        let at = Vector3::new(x, y, z);
        let sum = at.abs().sum();
        for tolerance in [1e-9, -1e-9] {
            let expected = sum <= 1e-3 + 2.0 * tolerance;
            assert_eq!(
                shape.contains(&at, tolerance),
                expected,
                "{at:?} {tolerance}"
            );
        }
    }
    let ratio = volume(&shape, 2e-5) / (4e-9 / 3.0);
    assert!((ratio - 1.0).abs() < 2e-3, "{ratio}");
}

fn grid(axis: &[f64]) -> impl Iterator<Item = (&f64, &f64, &f64)> {
    let plane = move |x| {
        axis.iter()
            .flat_map(move |y| axis.iter().map(move |z| (x, y, z)))
    };
    axis.iter().flat_map(plane)
}

#[test]
fn voids_are_empty_and_overlapping_parts_are_one() {
    let mut hollow = moved(&octahedron(), 2.0, 0.0);
    // a negative factor turns the triangles inside out
    hollow.extend(moved(&octahedron(), -1.0, 0.0));
    let hollow = load(text(&hollow).as_bytes(), 1.0).expect("closed");
    let ratio = volume(&hollow, 0.04) / (4.0 / 3.0 * 7.0);
    assert!((ratio - 1.0).abs() < 5e-3, "{ratio}");
    assert!(!hollow.contains(&Vector3::zeros(), 0.0));

    // the overlap is an octahedron of half the size
    let mut two = octahedron();
    two.extend(moved(&octahedron(), 1.0, 1.0));
    let two = load(text(&two).as_bytes(), 1.0).expect("closed");
    let ratio = volume(&two, 0.02) / (4.0 / 3.0 * (2.0 - 0.125));
    assert!((ratio - 1.0).abs() < 5e-3, "{ratio}");
}

#[test]
fn binary_files_are_read_and_may_be_moved() {
    let mut binary = binary(&octahedron());
    // a header that looks like text
    binary[..10].copy_from_slice(b"solid part");
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("part.stl"), binary).expect("writable");
    let mut shape: Shape =
        toml::from_str("stl = { file = 'part.stl', scale = 0.5, origin = [0, 0, 2] }")
            .expect("a shape");
    assert!(shape.mistake().is_some_and(|m| m.contains("not been read")));
    shape.load(folder.path()).expect("closed");
    assert!(shape.contains(&Vector3::new(0.0, 0.0, 2.4), 0.0));
    assert!(!shape.contains(&Vector3::new(0.0, 0.0, 2.6), 0.0));
}

#[test]
fn what_is_no_solid_is_refused() {
    let told = |triangles: &[Triangle]| {
        let refused = load(text(triangles).as_bytes(), 1.0);
        refused.expect_err("no solid").to_string()
    };
    let whole = octahedron();
    let open = told(&whole[1..]);
    assert!(open.contains("not closed: 3 edges"), "{open}");
    // one triangle turned over
    let mut turned = whole.clone();
    turned[0].swap(0, 1);
    assert!(told(&turned).contains("not closed: 3 edges"));
    assert!(told(&[]).contains("no triangles"));
    let [a, b, c] = whole[0];
    assert!(told(&[[a, b, c], [a, c, b]]).contains("no volume"));
    let infinite = [[a, b, [f32::INFINITY, 0.0, 0.0]]];
    // the parser of text files refuses it itself
    let infinite = load(&binary(&infinite), 1.0).expect_err("no solid");
    assert!(infinite.to_string().contains("the coordinate inf"));
    let missing = Shape::Stl(Stl::new("none.stl", 1.0)).load(Path::new("/nowhere"));
    assert!(missing.is_err_and(|e| e.to_string().starts_with("cannot read")));
    for scale in [0.0, -1.0, f64::NAN] {
        let shape = load(text(&whole).as_bytes(), scale).expect("told later");
        assert!(
            shape.mistake().is_some_and(|m| m.contains("scale")),
            "{scale}"
        );
    }
}
