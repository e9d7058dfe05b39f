//! All texts of this version, for a PC.

use crate::control::MotorParameters;
use crate::drive_settings::DriveSettings;
use crate::sensors::SensorParameters;
use crate::supervisor::Thresholds;
use crate::watch::WatchParameters;
use compensator_core::TermKind;
use compensator_core::compensator::CompensatorParameters;
use compensator_core::parameters::{Envelope, ParameterId, Text};

/// Texts that the sources of this crate and of the core name, which `build.rs` collects.
const OF_SOURCES: &[Text] = &include!(concat!(env!("OUT_DIR"), "/texts.rs"));

/// Returns every text of a refusal of this version, some of them twice: [`Text::number`] is what an image sends.
pub fn texts() -> impl Iterator<Item = Text> {
    OF_SOURCES.iter().copied().chain(of_fields()).filter(|text| !text.as_str().is_empty())
}

/// Returns the texts that macros make of lists of fields.
fn of_fields() -> impl Iterator<Item = Text> {
    let ranges = CompensatorParameters::RANGES.iter().chain(&MotorParameters::RANGES);
    let ranges = ranges.chain(&Thresholds::RANGES).chain(&WatchParameters::RANGES);
    let whys = ranges.chain(&SensorParameters::RANGES).map(|range| range.why);
    let names = Envelope::TEXTS.into_iter().chain(CompensatorParameters::TEXTS);
    let names = names.chain(MotorParameters::TEXTS).chain(Thresholds::TEXTS);
    let names = names.chain(WatchParameters::TEXTS).chain(SensorParameters::TEXTS);
    let names = names.chain(ParameterId::ALL.iter().map(|id| id.text()));
    let names = names.chain(TermKind::ALL.iter().map(|kind| kind.text()));
    whys.chain(names).chain(DriveSettings::TEXTS.into_iter().flatten())
}
