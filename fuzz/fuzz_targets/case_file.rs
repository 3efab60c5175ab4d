//! Any text as a case file: it is composed, or refused with a message.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    let _ = perimelt_fuzz::compose("case.toml", text);
});
