//! Fuzzes the parser of parameter files with any text.
//!
//! The parser returns an error of one line or a valid file. A set that the driver accepts must survive writing and
//! reading again.

// The module alone is included, because its crate takes minutes to build.
#[allow(dead_code)]
#[path = "../../../../host-sim/tune/src/driver_file.rs"]
mod driver_file;

use compensator_core::record;
use driver_file::{apply, emit, parse};
use firmware::parameter_set::ParameterSet;

/// Executes the target on an input.
pub fn run(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let file = match parse(text) {
        Ok(file) => file,
        Err(error) => {
            let error = error.to_string();
            assert!(!error.is_empty() && !error.contains('\n'), "{error:?}");
            return;
        }
    };
    file.parameters.validate().expect("a parsed file is valid");
    let mut set = ParameterSet::default();
    // A text without a folder has no network.
    apply(&file, None, &mut set);
    // The values in f32, or together with the driver's other parameters, may be invalid. That is no error here.
    if set.validate().is_err() {
        return;
    }
    assert_eq!(record::parse(&record::emit(&set.friction)).as_ref(), Ok(&set.friction));
    let written = emit(&set, file.joint);
    let again = parse(&written).unwrap_or_else(|error| panic!("{error}\n{written}"));
    let mut read = ParameterSet::default();
    apply(&again, None, &mut read);
    assert_eq!(emit(&read, again.joint), written);
    // The file holds only the parameters that the model uses.
    for id in set.friction.model.active() {
        let (found, expected) = (read.friction.model.get(id), set.friction.model.get(id));
        assert_eq!(found.to_bits(), expected.to_bits(), "{}", id.name());
    }
}
