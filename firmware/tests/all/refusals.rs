//! The texts of refusals, which the build collects from the sources, and how a reason is printed with them.

use compensator_core::parameters::reason::{WORDS, places};
use compensator_core::refusal;
use firmware::refusal::{Explained, emit, texts};
use firmware::supervisor::{Code, SelfTest};
use std::collections::BTreeMap;

#[test]
fn texts_of_this_version_have_different_numbers_and_room_for_theirs() {
    let mut numbers = BTreeMap::new();
    for text in texts() {
        let words = text.as_str();
        assert!(places(words) <= WORDS && !words.contains(['\t', '\n']), "{words}");
        if let Some(other) = numbers.insert(text.number(), words) {
            assert_eq!(other, words, "two texts have the number {:08X}", text.number());
        }
    }
    assert!(numbers.len() > 500, "{}", numbers.len());
}

/// One of each source: the core, behind an item of tests, this crate, over several lines, and the lists of fields.
#[test]
fn texts_of_both_crates_and_of_their_fields_are_collected() {
    for expected in [
        "{name} = {f32}: must be a whole number: {name}",
        "{name}: must be {name}",
        "their sum must stay within the range of fixed point",
        "the number type cannot hold this product of the step within the envelope",
        "-1 (short): the shorted motor would exceed overcurrent_a at velocity_max_rad_s",
        "coulomb_torque",
        "command_timeout_us",
    ] {
        assert!(texts().any(|text| text == expected), "{expected}");
    }
}

#[test]
fn explained_reason_names_codes_and_conditions() {
    let reason = refusal!(
        "not armed:{faults}{conditions}{test}",
        1u32 << (Code::Overspeed.number() - 1),
        3u32,
        SelfTest::Comparator(3).number()
    );
    let bytes = emit(Some(&reason));
    let words = Explained::parse(&bytes).expect("a reason").to_string();
    assert_eq!(
        words.split_once(": ").expect("a list").1,
        "overspeed unobserved unmeasured (test 13: comparator 3)"
    );
    assert_eq!(Explained::parse(&emit(None)), None);
    assert_eq!(Explained::parse(&bytes[1..]), None);
}

#[test]
fn reason_of_another_version_is_printed_as_numbers() {
    let mut bytes = emit(Some(&refusal!("law = {u32}: there is no such law", 9u8)));
    bytes[0] ^= 1;
    let words = Explained::parse(&bytes).map(|reason| reason.to_string()).expect("a reason");
    assert!(words.contains("another version") && words.contains('9'), "{words}");
}
