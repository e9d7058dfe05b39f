//! The table of the texts of refusals, `firmware/refusals.tsv`, against the sources.
//!
//! `UPDATE_TABLES=1 cargo test -p firmware --test all refusals::` writes it.

use compensator_core::compensator::CompensatorParameters;
use compensator_core::parameters::reason::{WORDS, places};
use compensator_core::parameters::{Envelope, ParameterId, Text};
use compensator_core::{TermKind, refusal};
use firmware::control::MotorParameters;
use firmware::drive_settings::DriveSettings;
use firmware::refusal::{Explained, emit};
use firmware::sensors::SensorParameters;
use firmware::supervisor::{Code, Thresholds};
use firmware::watch::WatchParameters;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

const SOURCES: [&str; 2] = [
    concat!(env!("CARGO_MANIFEST_DIR"), "/src"),
    concat!(env!("CARGO_MANIFEST_DIR"), "/../compensator-core/src"),
];
const TABLE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/refusals.tsv");

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

/// Returns the literal at the start of a source text, with its escapes resolved; `None` if there is none.
fn literal(source: &str) -> Option<String> {
    let mut letters = source.trim_start().strip_prefix('"')?.chars().peekable();
    let mut text = String::new();
    loop {
        match letters.next()? {
            '"' => return Some(text),
            '\\' => match letters.next()? {
                '\n' => while letters.next_if(|letter| letter.is_whitespace()).is_some() {},
                letter => text.push(letter),
            },
            letter => text.push(letter),
        }
    }
}

/// Returns the texts that the sources pass to `text!` and `refusal!`, without those of tests.
fn texts_in_sources() -> Vec<String> {
    let mut paths = Vec::new();
    SOURCES.iter().for_each(|folder| sources(Path::new(folder), &mut paths));
    assert!(paths.len() > 100, "{}", paths.len());
    let mut found = Vec::new();
    for path in paths {
        let source = std::fs::read_to_string(path).expect("text");
        let shipped = source.split("#[cfg(test)]").next().unwrap_or_default();
        for name in ["text!(", "refusal!("] {
            let code = shipped.lines().filter(|line| !line.trim_start().starts_with("//"));
            let code: Vec<_> = code.collect();
            found.extend(code.join("\n").split(name).skip(1).filter_map(literal));
        }
    }
    found
}

/// Returns the texts that macros make of lists of fields.
fn texts_of_fields() -> Vec<Text> {
    let ranges = CompensatorParameters::RANGES.iter().chain(&MotorParameters::RANGES);
    let ranges = ranges.chain(&Thresholds::RANGES).chain(&WatchParameters::RANGES);
    let whys = ranges.chain(&SensorParameters::RANGES).map(|(.., why)| *why);
    let names = Envelope::TEXTS.into_iter().chain(CompensatorParameters::TEXTS);
    let names = names.chain(MotorParameters::TEXTS).chain(Thresholds::TEXTS);
    let names = names.chain(WatchParameters::TEXTS).chain(SensorParameters::TEXTS);
    let names = names.chain(ParameterId::ALL.iter().map(|id| id.text()));
    let names = names.chain(TermKind::ALL.iter().map(|kind| kind.text()));
    whys.chain(names).chain(DriveSettings::TEXTS.into_iter().flatten()).collect()
}

#[test]
fn table_has_every_text_of_the_sources() {
    let fields = texts_of_fields().into_iter().map(|text| text.as_str().to_owned());
    let mut numbers = BTreeMap::new();
    for text in texts_in_sources().into_iter().chain(fields).filter(|text| !text.is_empty()) {
        assert!(places(&text) <= WORDS && !text.contains(['\t', '\n']), "{text}");
        let number = Text::number_of(&text);
        if let Some(other) = numbers.insert(number, text.clone()) {
            assert_eq!(other, text, "two texts have the number {number:08X}");
        }
    }
    assert!(numbers.len() > 300, "{}", numbers.len());
    let mut rows: Vec<_> =
        numbers.iter().map(|(number, text)| format!("{number:08X}\t{text}\n")).collect();
    rows.sort_by(|a, b| a[9..].cmp(&b[9..]));
    let expected = rows.concat();
    if std::env::var_os("UPDATE_TABLES").is_some() {
        std::fs::write(TABLE, &expected).expect("the table can be written");
    }
    let found = std::fs::read_to_string(TABLE).expect("the table");
    assert_eq!(found, expected, "UPDATE_TABLES=1 writes it anew");
}

#[test]
fn explained_reason_names_codes_and_conditions() {
    let reason = refusal!(
        "not armed:{faults}{limits}{conditions}",
        1u32 << (Code::Overspeed.number() - 1),
        1u32 << (Code::Derated.number() - 33),
        3u32
    );
    let bytes = emit(Some(&reason));
    let words = Explained::parse(&bytes).expect("a reason").to_string();
    assert_eq!(
        words.split_once(": ").expect("a list").1,
        "overspeed derated unobserved unmeasured"
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
