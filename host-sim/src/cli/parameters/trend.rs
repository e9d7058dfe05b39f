//! The stored trend of the learnt levels (2047h): a table, a file, and the change of the level.
//!
//! A level that changes over hours of sliding tells of wear before the joint fails. The slope over the entries is robust, so
//! that a single one does not decide.

use super::{Driver, Result, print_result};
use crate::cli::output::write_file;
use canopen_rs::Address;
use firmware::node::dictionary::index;
use firmware::store::{TIME_UNIT_S, TrendEntry};
use friction_results::level_trend::{LevelEntry, LevelTrend, MIN_ENTRIES, SCHEMA, robust_slope};
use joint_bus::canopen::SdoError;
use joint_bus::parameters::read_set;
use joint_log::number::significant;
use std::path::Path;

/// Abort code of a driver without a trend.
const NO_DATA: u32 = 0x0800_0020;

/// Confidence of the interval of the change.
const CONFIDENCE: f64 = 0.95;

/// Numbers of an entry that stand for 1. A quotient is the nearest decimal, a product is not.
const GAIN_OF_ONE: f64 = 1000.0;
const TERM_GAIN_OF_ONE: f64 = 500.0;

impl Driver {
    /// Prints the trend, and writes it to a file.
    pub(super) fn trend(&mut self, write: Option<&Path>, json: bool) -> Result {
        let trend = self.read_trend()?;
        if let Some(path) = write {
            let content = trend.emit(path)?;
            write_file(path, content.as_bytes())?;
        }
        print_result(json, &trend, &table(&trend))
    }

    fn read_trend(&mut self) -> Result<LevelTrend> {
        let unit = self.joint_kind()?.torque_unit().to_owned();
        let set = read_set(&mut self.client)?;
        let terms: Vec<&str> = set.friction.model.terms.iter().map(|kind| kind.name()).collect();
        let bytes = match self.client.read_blocks(Address::new(index::LEVEL_TREND, 0), |_| ()) {
            Ok(bytes) => bytes,
            Err(SdoError::Refused { code: NO_DATA, .. }) => Vec::new(),
            Err(error) => return Err(error.into()),
        };
        let entries = bytes.as_chunks().0.iter().filter_map(TrendEntry::parse);
        let entries = entries.map(|entry| level_entry(&entry, &terms)).collect();
        Ok(LevelTrend { schema: SCHEMA, unit, entries })
    }
}

/// Returns an entry in the units of a file. `terms` are those of the present set.
fn level_entry(entry: &TrendEntry, terms: &[&str]) -> LevelEntry {
    let term = terms.get(usize::from(entry.term)).map(|name| (*name).to_owned());
    LevelEntry {
        learnt_h: f64::from(entry.learnt) * f64::from(TIME_UNIT_S) / 3600.0,
        level: decimal(entry.level_nm),
        level_gain: f64::from(entry.level_permille) / GAIN_OF_ONE,
        level_std_deviation: f64::from(entry.deviation_permille) / GAIN_OF_ONE,
        viscous_gain: f64::from(entry.viscous_permille) / GAIN_OF_ONE,
        changed_term_gain: term.is_some().then(|| f64::from(entry.term_gain) / TERM_GAIN_OF_ONE),
        changed_term: term,
    }
}

/// Returns the shortest decimal of a value.
fn decimal(value: f32) -> f64 {
    value.to_string().parse().unwrap_or_else(|_| f64::from(value))
}

fn table(trend: &LevelTrend) -> String {
    if trend.entries.is_empty() {
        return "no entry: the joint writes the first one when it is disarmed after 3 minutes of learning \
                (params set adapt on), with a stored set\n"
            .to_owned();
    }
    let mut text = format!(
        "{:>10}  {:>10}  {:>15}  {:>7}  most changed term\n",
        "learnt (h)",
        format!("level ({})", trend.unit),
        "gain on level",
        "viscous"
    );
    for entry in &trend.entries {
        let term = match (&entry.changed_term, entry.changed_term_gain) {
            (Some(name), Some(gain)) => format!("{name} {gain:.3}"),
            _ => String::new(),
        };
        let line = format!(
            "{:>10.2}  {:>10}  {:>6.3} +- {:.3}  {:>7.3}  {term}",
            entry.learnt_h,
            significant(entry.level, 4),
            entry.level_gain,
            entry.level_std_deviation,
            entry.viscous_gain
        );
        text += line.trim_end();
        text.push('\n');
    }
    text + &change(trend)
}

/// Returns the change of the level in one line.
fn change(trend: &LevelTrend) -> String {
    let Some(found) = robust_slope(&trend.points(), CONFIDENCE) else {
        let count = trend.entries.len();
        return format!(
            "change of the level: found {count} entries, expected {MIN_ENTRIES} or more\n"
        );
    };
    let percent = |slope: f64| significant(100.0 * slope / found.first, 2);
    let [low, high] = found.interval.map(percent);
    let sign = if found.slope > 0.0 { "+" } else { "" };
    format!(
        "change of the level: {sign}{} % per 100 h of learning ({low} to {high}), over {} h\n",
        percent(found.slope),
        significant(100.0 * found.span, 3)
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use compensator_core::can::NodeId;
    use firmware::node_settings::{NodeSettings, emit_block};
    use firmware::parameter_set::ParameterSet;
    use firmware::store::Store;
    use firmware::store::memory::MemoryFlash;
    use joint_bus::bus::{Bus, Hub};
    use joint_bus::canopen::Client;
    use joint_bus::joint::{JointNode, defaults};

    /// Number of entries: more than a transfer in segments would carry at once.
    const ENTRIES: u32 = 40;

    /// Returns a driver whose flash has a trend that rises by 10 % per 100 h.
    fn driver(folder: &Path) -> Driver {
        let settings: NodeSettings = defaults(NodeId::FIRST);
        let mut store = Store::open(MemoryFlash::<4>::new());
        let block = emit_block(&settings, &ParameterSet::default());
        store.save(&block, &settings.identity()).expect("saved");
        for number in 1..=ENTRIES {
            let rise = 1.0 + 0.1 * (number as f32 - 1.0) / 100.0;
            let entry = TrendEntry {
                learnt: 360 * number,
                deviation_permille: 14,
                level_nm: 4.0 * rise,
                level_permille: (1000.0 * rise).round() as u16,
                viscous_permille: 950,
                term: 0,
                term_gain: 500,
            };
            store.append_trend(&entry, true).expect("appended");
        }
        let flash = folder.join("flash.bin");
        let image: Vec<u8> = store.flash().image().flatten().copied().collect();
        std::fs::write(&flash, image).expect("written");
        let hub = Hub::new();
        hub.attach(JointNode::start(NodeId::FIRST, Some(&flash)).expect("a driver"));
        let bus: Box<dyn Bus> = Box::new(hub.port());
        Driver { client: Client::new(bus, NodeId::FIRST) }
    }

    #[test]
    fn trend_of_a_driver_is_read_printed_and_written() {
        let folder = tempfile::tempdir().expect("a folder");
        let mut driver = driver(folder.path());
        let path = folder.path().join("knee.trend.json");
        driver.trend(Some(&path), false).expect("a trend");
        let trend = LevelTrend::read(&path).expect("a file");
        assert_eq!(trend.entries.len(), ENTRIES as usize);
        let second = &trend.entries[1];
        assert_eq!((second.learnt_h, second.level, second.level_gain), (2.0, 4.004, 1.001));
        assert_eq!((second.viscous_gain, second.level_std_deviation), (0.95, 0.014));
        assert_eq!(second.changed_term, None, "the set has no terms");
        let text = table(&trend);
        assert_eq!(text.lines().count() as u32, ENTRIES + 2, "{text}");
        assert!(text.contains("2.00       4.004   1.001 +- 0.014    0.950"), "{text}");
        let change = text.lines().last().expect("a line");
        for figure in ["+10 %", "100 h", "(10 to 10)", " 39"] {
            assert!(change.contains(figure), "{figure}: {text}");
        }
        let refused =
            driver.trend(Some(&folder.path().join("trend.toml")), false).unwrap_err().to_string();
        assert!(refused.contains("trend.toml") && refused.contains(".json"), "{refused}");
        crate::snapshot::check("units-of-commands", "change of a level", change);
    }

    #[test]
    fn level_entry_names_the_changed_term_of_the_set() {
        let entry = TrendEntry { term: 1, term_gain: 610, ..TrendEntry::default() };
        let found = level_entry(&entry, &["stribeck-temperature", "pressure-coulomb"]);
        assert_eq!(found.changed_term.as_deref(), Some("pressure-coulomb"));
        assert_eq!(found.changed_term_gain, Some(1.22));
    }
}
