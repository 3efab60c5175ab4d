//! Refusals whose reason is not the key that they name: each is met by a case, and the case that follows the advice gets on.

use std::path::Path;

use perimelt::case::Case;

const BODY_IN_A_STREAM: &str = r#"
[bodies.fluid]
shape.difference = { from = { box = { min = [0, 0, 0], max = [0.4, 0.2, 0.01] } }, subtract = { box = { min = [0.1, 0.08, 0], max = [0.14, 0.12, 0.01] } } }
dimension = 2
spacing = 0.01
material = "liquid"
periodic = ["x"]
initial.velocity = [0.2, 0, 0]

[bodies.block]
shape.box = { min = [0.1, 0.08, 0], max = [0.14, 0.12, 0.01] }
dimension = 2
spacing = 0.01
material = "solid"

[materials.liquid]
density = 1
viscosity = 1e-3
specific_heat = 1
conductivity = 1e-3

[materials.solid]
density = 1
specific_heat = 1
conductivity = 1

[[physics]]
type = "fluid"
body = "fluid"
description = "eulerian"
form = "conservative"
state.tait.sound_speed = 4
density_diffusion = 0.1

[[physics]]
type = "rigid_body"
body = "block"
hold = ["x", "y", "rotation"]

[[couplers]]
type = "fluid_structure"
fluid = "fluid"
solid = "block"

[[couplers]]
type = "wall"
body = "fluid"
faces = ["y-", "y+"]

[time]
end = 0.1
"#;

const CLOSED: &str = r#"
[bodies.fluid]
shape.box = { min = [0, 0, 0], max = [0.2, 0.1, 0.01] }
dimension = 2
spacing = 0.01
material = "liquid"

[materials.liquid]
density = 1
viscosity = 1e-3

[[physics]]
type = "fluid"
form = "conservative"
surface = "closed"
state.tait.sound_speed = 4

[[couplers]]
type = "wall"
faces = ["x-", "x+", "y-"]

[time]
end = 0.1
"#;

/// What composing a case comes to.
fn compose(text: &str) -> Result<(), String> {
    let case = Case::parse("case.toml", text.into(), Path::new("")).map_err(|e| e.render(false))?;
    case.compose().map(|_| ()).map_err(|e| e.render(false))
}

/// A case with texts replaced by others.
fn changed(text: &str, changes: &[(&str, &str)]) -> String {
    changes.iter().fold(text.to_string(), |text, (old, new)| {
        assert!(text.contains(old), "`{old}` is there");
        text.replace(old, new)
    })
}

#[test]
fn who_follows_the_advice_gets_on() {
    let hole = ", subtract = { box = { min = [0.1, 0.08, 0], max = [0.14, 0.12, 0.01] } } }";
    for (what, text, reason, followed) in [
        (
            "a body in a stream",
            BODY_IN_A_STREAM.to_string(),
            "",
            String::new(),
        ),
        (
            "a gap between a fluid and a wall",
            changed(
                BODY_IN_A_STREAM,
                &[(
                    hole,
                    ", subtract = { box = { min = [0.08, 0.06, 0], max = [0.16, 0.14, 0.01] } } }",
                )],
            ),
            "neither fluid nor a wall",
            BODY_IN_A_STREAM.to_string(),
        ),
        (
            "a closed fluid with an open face",
            CLOSED.to_string(),
            "another `surface` than \"closed\"",
            changed(CLOSED, &[("surface = \"closed\"\n", "")]),
        ),
        (
            "a closed fluid with an open face, closed",
            CLOSED.to_string(),
            "a `wall` or `symmetry` there",
            changed(CLOSED, &[("\"y-\"]", "\"y-\", \"y+\"]")]),
        ),
    ] {
        if reason.is_empty() {
            assert_eq!(compose(&text), Ok(()), "{what}");
            continue;
        }
        let refusal = compose(&text).expect_err(what);
        assert!(refusal.contains(reason), "{what}: {refusal}");
        // no key is asked for as it is given
        let given = text
            .lines()
            .filter(|l| l.contains('=') && !l.starts_with("type"));
        for line in given {
            assert!(
                !refusal.contains(&format!("expected `{line}`")),
                "{what}: {refusal}"
            );
        }
        assert_eq!(compose(&followed), Ok(()), "{what}");
    }
}
