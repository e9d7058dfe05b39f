//! `params set`: parameters, settings of the drive and an order to the adaptation, done together or not at all.
//!
//! All items are parsed and checked before the first write. The parameters are committed as one set. Each setting of the drive
//! is an object of its own, which is active at once. So the settings are written first, and written back if the driver refuses
//! one of them, the set or the order. The order is last, because it cannot be taken back.
//!
//! A set is committed only if it differs from the driver's, because a commit discards what the joint has learnt.

use super::adaptation::{self, Order, Request};
use super::drive::{self, Change};
use super::{CompensatedArguments, Driver, Result, for_driver, in_part, passivity_error, unfit};
use crate::cli::words::text_in_options;
use crate::driver_file;
use firmware::node::dictionary::{SAVE_SIGNATURE, index};
use firmware::parameter_set::ParameterSet;
use friction_results::loop_cost::late_loop_warning;
use joint_bus::parameters::{read_set, write_set};
use joint_tuning::names::{differences, put};
use std::path::Path;

/// Maximum number of changes that are listed by name.
const MAX_LISTED_CHANGES: usize = 6;

/// What one command changes.
struct Changes {
    /// The driver's parameters with the new values.
    set: ParameterSet,
    settings: Vec<Change>,
    order: Option<Order>,
}

impl Driver {
    /// Sets parameters from `NAME=VALUE` items and files. Returns a summary of the changes.
    ///
    /// # Errors
    /// One line, if an item is wrong or the driver refuses it. Then nothing is changed.
    pub(super) fn set(
        &mut self,
        what: &[String],
        save: bool,
        taken: &CompensatedArguments,
    ) -> Result<String> {
        let before = read_set(&mut self.client)?;
        let changes = self.parse_changes(what, &before, taken)?;
        // The driver runs the same check. Here the error uses the file's names.
        changes.set.validate()?;
        if let Some(error) = passivity_error(&changes.set) {
            eprintln!(
                "warning: allow_active: the law can supply energy, so compensation can keep the joint moving: {error}"
            );
        }
        if let Some(late) = late_loop_warning(changes.set.friction.model.terms.as_slice()) {
            eprintln!("warning: {late}");
        }
        let mut former = Vec::new();
        if let Err(refused) = self.write_changes(&changes, &before, &mut former) {
            self.take_back(&before, &former);
            return Err(refused);
        }
        let active = self.number(index::COMMIT, 1)?;
        if save {
            self.store(index::STORE, SAVE_SIGNATURE)?;
        }
        let settings = former.iter().zip(&changes.settings);
        let settings = settings.map(|(former, new)| new.in_words(former));
        let orders = changes.order.iter().map(|order| format!("learnt levels: {}", order.name));
        let values = differences(&before, &changes.set).into_iter();
        let values =
            values.map(|value| format!("{} {} -> {}", value.name, value.before, value.after));
        let changed: Vec<String> = settings.chain(orders).chain(values).collect();
        let changed = match changed.len() {
            0 => "nothing changed".to_owned(),
            1..=MAX_LISTED_CHANGES => changed.join(", "),
            count => format!("{count} values changed"),
        };
        let kept = if save { "saved" } else { "not saved: lost at a reset" };
        Ok(format!("{changed} (crc {active:08x}, {kept})"))
    }

    /// Parses the items. Nothing is written.
    fn parse_changes(
        &mut self,
        what: &[String],
        before: &ParameterSet,
        taken: &CompensatedArguments,
    ) -> Result<Changes> {
        let (mut set, mut settings, mut order) = (before.clone(), Vec::new(), None);
        let mut items = what.iter();
        while let Some(item) = items.next() {
            let pair = item.split_once('=');
            let adapt = match pair {
                Some((adaptation::ITEM, word)) => Some(word),
                None if item == adaptation::ITEM => Some(items.next().map_or("", String::as_str)),
                _ => None,
            };
            match (adapt.map(adaptation::parse).transpose()?, pair) {
                (Some(Request::Mode(change)), _) => settings.push(change),
                (Some(Request::Order(_)), _) if order.is_some() => {
                    return Err(unfit(adaptation::ITEM, "found two orders, expected one"));
                }
                (Some(Request::Order(given)), _) => order = Some(given),
                (None, Some((name, value))) => match drive::parse(name.trim(), value.trim())? {
                    Some(change) => settings.push(change),
                    None => put(&mut set, name.trim(), value.trim())?,
                },
                (None, None) => self.take_file(item, taken, &mut set)?,
            }
        }
        Ok(Changes { set, settings, order })
    }

    /// Applies a parameter file to a set.
    fn take_file(
        &mut self,
        item: &str,
        taken: &CompensatedArguments,
        set: &mut ParameterSet,
    ) -> Result {
        let path = Path::new(item);
        if !path.exists() {
            return Err(unfit(item, "No such file; expected a parameter file or NAME=VALUE"));
        }
        let mut file = self.read_file(path)?;
        taken.apply(&mut file);
        if let Some(left_out) = file.left_out_in_words() {
            eprintln!("note: {}", text_in_options(&left_out));
        }
        let network = for_driver(&file).map_err(in_part(item))?;
        driver_file::apply(&file, network, set);
        Ok(())
    }

    /// Writes the settings, the set and the order. `former` gets the settings that were replaced, in their order.
    fn write_changes(
        &mut self,
        changes: &Changes,
        before: &ParameterSet,
        former: &mut Vec<Change>,
    ) -> Result {
        for change in &changes.settings {
            former.push(self.write_setting(change)?);
        }
        if changes.set != *before {
            write_set(&mut self.client, &changes.set)?;
        }
        changes.order.map_or(Ok(()), |order| self.order_adaptation(order))
    }

    /// Brings back what a refused change has replaced. An error here would hide the refusal, so it is not reported.
    fn take_back(&mut self, before: &ParameterSet, former: &[Change]) {
        for setting in former.iter().rev() {
            let _ = self.write_setting(setting);
        }
        if self.number(index::COMMIT, 1).is_ok_and(|active| active != before.crc()) {
            let _ = write_set(&mut self.client, before);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use compensator_core::can::NodeId;
    use joint_bus::bus::{Bus, Hub};
    use joint_bus::canopen::Client;
    use joint_bus::joint::JointNode;

    #[test]
    fn set_with_a_refused_item_changes_nothing() {
        let hub = Hub::new();
        hub.attach(JointNode::start(NodeId::FIRST, None).expect("a driver"));
        let bus: Box<dyn Bus> = Box::new(hub.port());
        let mut driver = Driver { client: Client::new(bus, NodeId::FIRST) };
        let before = driver.set_and_settings();
        for refused in [
            // The driver refuses the value, the PC a number beyond its object.
            &["static_torque=2.5", "drive.position_min=-5", "drive.brake_engage_at=2"][..],
            &["static_torque=2.5", "drive.position_min=-5", "drive.brake_test_ms=65536"],
            // The adaptation is off.
            &["static_torque=2.5", "drive.position_min=-5", "adapt", "adopt"],
            // The set is refused before a setting is written.
            &["drive.position_min=-5", "static_torque=-1"],
            &["drive.position_min=-5", "adapt=adopt", "adapt=discard"],
        ] {
            let items: Vec<String> = refused.iter().map(|item| (*item).to_owned()).collect();
            driver.set(&items, false, &Default::default()).expect_err(&items.join(" "));
            assert_eq!(driver.set_and_settings(), before, "{items:?}");
        }
        let items = ["static_torque=2.5", "drive.position_min=-5"].map(str::to_owned);
        let done = driver.set(&items, false, &Default::default()).expect("values");
        assert!(done.contains("drive.position_min 0 -> -5, static_torque "), "{done}");
    }

    impl Driver {
        /// Returns the CRC of the active set, and the settings of the drive.
        fn set_and_settings(&mut self) -> (u32, Vec<i64>) {
            let crc = self.number(index::COMMIT, 1).expect("a checksum");
            let settings = drive::names().map(|(_, at)| self.drive_setting(at).expect("a number"));
            (crc, settings.collect())
        }
    }
}
