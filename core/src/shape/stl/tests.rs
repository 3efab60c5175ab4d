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
    let mut bytes = vec![b' '; 80];
    bytes.extend((triangles.len() as u32).to_le_bytes());
    for triangle in triangles {
        bytes.extend([0; 12]);
        bytes.extend(triangle.as_flattened().iter().flat_map(|c| c.to_le_bytes()));
        bytes.extend([0; 2]);
    }
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

/// The cube of edge 10 with its corner of the smallest coordinates at `x`, 0, 0.
fn cube(x: f32) -> Vec<Triangle> {
    let corner = |n: usize| {
        [
            x + 10.0 * (n & 1) as f32,
            5.0 * (n & 2) as f32,
            2.5 * (n & 4) as f32,
        ]
    };
    // each face counterclockwise from outside
    let faces = [
        [0, 4, 6, 2],
        [1, 3, 7, 5],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 2, 3, 1],
        [4, 5, 7, 6],
    ];
    let halves = faces
        .iter()
        .flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]);
    halves.map(|triangle| triangle.map(corner)).collect()
}

/// Number of cells of 1 in the solid of a file.
fn cells(bytes: &[u8]) -> usize {
    let shape = load(bytes, 1.0).unwrap_or_else(|e| panic!("{e}"));
    let body = Body::fill("part", &shape, 3, 1.0, 1.0).expect("points");
    body.points.len()
}

fn refused(bytes: &[u8]) -> String {
    let refused = load(bytes, 1.0).expect_err("no solid");
    let text = refused.to_string();
    // without the folder of the test
    let start = text.find("part.stl").expect("the file is told");
    text[start..].to_string()
}

fn replaced(text: &str, what: &str, by: &str) -> Vec<u8> {
    assert!(text.contains(what), "{what}");
    text.replacen(what, by, 1).into_bytes()
}

#[test]
fn all_solids_of_a_text_belong_to_the_surface() {
    let solid = |triangles: &[Triangle]| text(triangles);
    let inwards = |triangles: &[Triangle]| -> Vec<Triangle> {
        triangles.iter().map(|[a, b, c]| [*a, *c, *b]).collect()
    };
    let small: Vec<Triangle> = cube(0.0)
        .iter()
        .map(|t| t.map(|c| c.map(|c| 0.4 * c + 2.0)))
        .collect();
    for (solids, expected) in [
        // apart, in contact, overlapping, a void, three
        (vec![cube(0.0), cube(20.0)], 2000),
        (vec![cube(0.0), cube(10.0)], 2000),
        (vec![cube(0.0), cube(5.0)], 1500),
        (vec![cube(0.0), inwards(&small)], 1000 - 64),
        (vec![cube(0.0), cube(20.0), cube(40.0)], 3000),
    ] {
        let file: String = solids.iter().map(|triangles| solid(triangles)).collect();
        assert_eq!(cells(file.as_bytes()), expected);
        // also without the ends, and on one line
        let open_ended = file.replace("endsolid test\n", "");
        assert_eq!(cells(open_ended.as_bytes()), expected);
        assert_eq!(cells(file.replace('\n', " ").as_bytes()), expected);
    }
    let followed = text(&cube(0.0)) + "created by a program\n";
    assert!(refused(followed.as_bytes()).contains("`created` where `solid` or the end"));
}

#[test]
fn text_is_read_as_programs_write_it() {
    let plain = text(&cube(0.0));
    let utf16: Vec<u8> = format!("\u{feff}{plain}")
        .encode_utf16()
        .flat_map(u16::to_le_bytes)
        .collect();
    let with_bytes = |before: &[u8], after: &[u8]| [before, plain.as_bytes(), after].concat();
    for bytes in [
        plain.clone().into_bytes(),
        replaced(&plain, "solid test", "solid"),
        replaced(&plain, "solid test", "solid facet of normal quality"),
        [&b"solid Schwei\xdfteil"[..], &plain.as_bytes()[10..]].concat(),
        plain
            .replace("normal 0 0 0", "normal nan -nan(ind) 1.#QNAN")
            .into_bytes(),
        plain.replace("normal 0 0 0", "").into_bytes(),
        plain.to_uppercase().into_bytes(),
        plain.replace('\n', "\r\n").into_bytes(),
        plain.replace('\n', "\r").into_bytes(),
        plain.replace(" 10", "\t1.0D+01").into_bytes(),
        with_bytes(b"\xef\xbb\xbf", b""),
        with_bytes(b"\n  ", b"\x1a\0\0"),
        utf16,
        // a corner that differs in the last digits
        replaced(&plain, "vertex 0 0 0", "vertex 4.3e-18 0 0"),
        replaced(&plain, "vertex 10 10 0", "vertex 10.000001 10 0"),
        replaced(&plain, "vertex 10 10 0", "vertex 9.999995 10 0"),
    ] {
        assert_eq!(cells(&bytes), 1000, "{}", String::from_utf8_lossy(&bytes));
    }
}

#[test]
fn binary_files_are_read_as_programs_write_them() {
    let plain = binary(&cube(0.0));
    let with = |header: &[u8], count: u32, after: &[u8]| {
        let mut bytes = plain.clone();
        bytes[..header.len()].copy_from_slice(header);
        bytes[80..84].copy_from_slice(&count.to_le_bytes());
        bytes.extend(after);
        bytes
    };
    for bytes in [
        with(b"", 12, b""),
        with(b"solid part", 12, b"\0\0"),
        with(b"solid facet normal 0 0 0", 12, &[7; 60]),
        // of programs that write while they compute
        with(b"", 0, b""),
        with(b"solid", u32::MAX, b""),
    ] {
        assert_eq!(cells(&bytes), 1000);
    }
    let mut not_a_number = with(b"", 12, b"");
    for triangle in not_a_number[84..].chunks_mut(50) {
        triangle[..12].fill(0xff);
    }
    assert_eq!(cells(&not_a_number), 1000);
}

#[test]
fn broken_files_are_refused_with_the_place() {
    let plain = text(&cube(0.0));
    let binary = binary(&cube(0.0));
    let mut short = binary.clone();
    short[80] = 15;
    let mut none = binary[..84].to_vec();
    none[80] = 0;
    let mut infinite = binary.clone();
    infinite[84 + 50 + 12..][..4].copy_from_slice(&f32::INFINITY.to_le_bytes());
    let cut = plain.find("endloop").expect("a triangle");
    for (bytes, told) in [
        (
            replaced(&plain, "endloop", "endlop"),
            "text STL, line 7: `endlop` where `endloop`",
        ),
        (
            replaced(&plain, "vertex 10 10 0", "vertex 10,0 10,0 0,0"),
            "`10,0` has a comma",
        ),
        (
            replaced(&plain, "vertex 10 10 0", "vertex 10 10"),
            "where a coordinate is expected",
        ),
        (
            replaced(&plain, "vertex 10 10 0", "vertex inf 10 0"),
            "the coordinate inf is not finite",
        ),
        (
            plain.as_bytes()[..cut].to_vec(),
            "text STL, line 6: the file ends where `endloop`",
        ),
        (
            b"solid a\nendsolid a\n".to_vec(),
            "text STL without triangles",
        ),
        (b"ISO-10303-21;".to_vec(), "no STL file"),
        (Vec::new(), "no STL file"),
        (short, "binary STL: 15 triangles announced, 12 in the file"),
        (none, "binary STL without triangles"),
        (
            infinite,
            "binary STL, triangle number 2: the coordinate inf is not finite",
        ),
    ] {
        let message = refused(&bytes);
        assert!(message.contains(told), "{message}");
    }
}

#[test]
fn gaps_flipped_and_repeated_triangles_are_told_apart() {
    let whole = cube(0.0);
    let message = |triangles: &[Triangle]| refused(text(triangles).as_bytes());
    let gap = message(&whole[1..]);
    assert!(
        gap.contains("1 gap with 3 open edges, such as that from [0.0, 0.0, 0.0]"),
        "{gap}"
    );
    assert!(
        gap.contains("triangle at line") && !gap.contains("flipped"),
        "{gap}"
    );
    let gap = refused(&binary(&whole[..11]));
    assert!(
        gap.contains("binary STL, 11 triangles") && gap.contains("triangle number"),
        "{gap}"
    );

    let mut turned = whole.clone();
    turned[0].swap(0, 1);
    turned[4].swap(0, 1);
    let flipped = message(&turned);
    assert!(
        flipped.contains("not closed: 2 flipped triangles, the first at line 2;"),
        "{flipped}"
    );

    let mut twice = whole.clone();
    twice.push(whole[3]);
    let repeated = message(&twice);
    assert!(
        repeated.contains("not closed: 1 triangle written twice, at line 86;"),
        "{repeated}"
    );

    // all at once; the two triangles that are missing share a corner
    let mut all = [turned, whole[3..4].to_vec()].concat();
    all.remove(10);
    all.remove(7);
    let all = message(&all);
    assert!(all.contains("1 gap with 6 open edges"), "{all}");
    assert!(
        all.contains("2 flipped triangles") && all.contains("1 triangle written twice"),
        "{all}"
    );
}

#[test]
fn corners_are_joined_whatever_grid_cell_they_are_in() {
    let plain = text(&cube(0.0));
    for exponent in -16..-5 {
        for sign in ["", "-"] {
            // on both sides of zero and of ten
            let moved = replaced(
                &plain,
                "vertex 0 0 0",
                &format!("vertex {sign}1e{exponent} 0 0"),
            );
            assert_eq!(cells(&moved), 1000, "{sign}1e{exponent}");
        }
    }
    // more than the tolerance is a gap, unless it is given
    let moved = replaced(&plain, "vertex 0 0 0", "vertex 1e-3 0 0");
    assert!(refused(&moved).contains("open edges"));
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("part.stl"), &moved).expect("writable");
    let mut stl = Stl::new("part.stl", 1e-3);
    stl.tolerance = Some(2e-6);
    let mut shape = Shape::Stl(stl);
    shape.load(folder.path()).expect("closed");
    assert_eq!(
        Body::fill("part", &shape, 3, 1e-3, 1.0)
            .expect("points")
            .points
            .len(),
        1000
    );

    // far away from the origin, where single precision has steps of 6e-5
    let far = cube(1000.0);
    let mut last_digit = far.clone();
    for corner in &mut last_digit[0] {
        corner[0] = corner[0].next_up();
    }
    assert_eq!(cells(&binary(&far)), 1000);
    assert_eq!(cells(&binary(&last_digit)), 1000);
}

#[test]
fn sheets_thinner_than_the_tolerance_keep_two_faces() {
    let thickness = 1e-6;
    let sheet: Vec<Triangle> = cube(0.0)
        .iter()
        .map(|t| t.map(|[x, y, z]| [x, y, 0.1 * thickness * z]))
        .collect();
    let volume = |bytes: &[u8]| match load(bytes, 1.0).expect("closed") {
        Shape::Stl(stl) => stl.surface.expect("read").enclosed_volume(),
        other => panic!("{other:?}"),
    };
    let expected = 100.0 * f64::from(thickness);
    let plain = text(&sheet);
    // one corner differs by less than the thickness
    let moved = replaced(&plain, "vertex 0 0 0", "vertex 0 1e-14 0");
    for bytes in [plain.as_bytes(), &moved] {
        let ratio = volume(bytes) / expected;
        assert!((ratio - 1.0).abs() < 1e-5, "{ratio}");
    }
}

#[test]
fn edges_that_end_within_another_enclose_nothing_open() {
    // one triangle of a face is divided at the middle of an edge and its neighbour is not, on several edges
    let mut divided = Vec::new();
    for (index, [a, b, c]) in cube(0.0).into_iter().enumerate() {
        let middle = [0, 1, 2].map(|axis| 0.3 * a[axis] + 0.7 * b[axis]);
        if index % 3 == 0 {
            divided.extend([[a, middle, c], [middle, b, c]]);
        } else {
            divided.push([a, b, c]);
        }
    }
    assert_eq!(cells(text(&divided).as_bytes()), 1000);
    // a point of a corner on the long edge of another part of the surface
    let shape = load(&binary(&divided), 1.0).expect("closed");
    let ratio = volume(&shape, 0.5) / 1000.0;
    assert!((ratio - 1.0).abs() < 1e-12, "{ratio}");
    // a gap beside it is still told
    divided.remove(3);
    assert!(refused(text(&divided).as_bytes()).contains("1 gap with"));
}

#[test]
fn what_is_no_solid_is_refused() {
    let whole = octahedron();
    let [a, b, c] = whole[0];
    let flat = text(&[[a, b, c], [a, c, b]]);
    assert!(refused(flat.as_bytes()).contains("no volume"));
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
