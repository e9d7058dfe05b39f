//! Any text as a parameter file: refused in one line, or a set that a driver takes, written and read as the same.

#![no_main]

// The file itself: the crate it belongs to, fits, papers and pages, takes minutes to build.
#[allow(dead_code)]
#[path = "../../../host-sim/src/driver_file.rs"]
mod driver_file;

use compensator_core::record;
use driver_file::{apply, emit, parse};
use firmware::parameter_set::ParameterSet;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let file = match parse(text) {
        Ok(file) => file,
        Err(why) => {
            assert!(!why.is_empty() && !why.contains('\n'), "{why:?}");
            return;
        }
    };
    file.parameters.validate().expect("what is read is valid");
    let mut set = ParameterSet::default();
    apply(&file, &mut set);
    // In `f32`, and with the rest of the driver, it may be refused; it is no panic.
    if set.validate().is_err() {
        return;
    }
    assert_eq!(record::parse(&record::emit(&set.friction)).as_ref(), Ok(&set.friction));
    let written = emit(&set, file.joint);
    let again = parse(&written).unwrap_or_else(|why| panic!("{why}\n{written}"));
    let mut read = ParameterSet::default();
    apply(&again, &mut read);
    assert_eq!(emit(&read, again.joint), written);
    // What a model does not use is not in its file.
    for id in set.friction.model.active() {
        let (found, expected) = (read.friction.model.get(id), set.friction.model.get(id));
        assert_eq!(found.to_bits(), expected.to_bits(), "{}", id.name());
    }
});
