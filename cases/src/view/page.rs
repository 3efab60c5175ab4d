//! The files of the page, which are part of the program.

/// A file of the page.
pub(super) struct File {
    pub(super) name: &'static str,
    pub(super) media_type: &'static str,
    pub(super) text: &'static str,
}

const HTML: &str = "text/html; charset=utf-8";
const CSS: &str = "text/css; charset=utf-8";
const SCRIPT: &str = "text/javascript; charset=utf-8";

macro_rules! files {
    ($($name:literal, $media_type:expr;)*) => {
        [$(File {
            name: $name,
            media_type: $media_type,
            text: include_str!(concat!("page/", $name)),
        }),*]
    };
}

/// All files; the first is the page itself.
const FILES: [File; 20] = files! {
    "index.html", HTML;
    "style.css", CSS;
    "main.js", SCRIPT;
    "controls.js", SCRIPT;
    "plies.js", SCRIPT;
    "data.js", SCRIPT;
    "viewer.js", SCRIPT;
    "scene.js", SCRIPT;
    "shaders.js", SCRIPT;
    "camera.js", SCRIPT;
    "cells.js", SCRIPT;
    "overlay.js", SCRIPT;
    "charts.js", SCRIPT;
    "capture.js", SCRIPT;
    "units.js", SCRIPT;
    "address.js", SCRIPT;
    "edges.js", SCRIPT;
    "marks.js", SCRIPT;
    "plane.js", SCRIPT;
    "pointer.js", SCRIPT;
};

/// The page.
pub(super) fn index() -> &'static File {
    &FILES[0]
}

/// The file called `name`.
pub(super) fn find(name: &str) -> Option<&'static File> {
    FILES.iter().find(|file| file.name == name)
}
