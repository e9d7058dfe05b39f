//! The scope's objects: 2013h and 2014h.

use super::Device;
use crate::node::dictionary::index;
use crate::node::dictionary::records::ScopeObject;
use crate::node::sdo::Abort;
use compensator_core::text;
use embedded_storage::nor_flash::NorFlash;

impl<F: NorFlash> Device<F> {
    /// Returns settings and state of the scope.
    pub(crate) fn scope_object(&self) -> ScopeObject {
        let settings = &self.scope.settings;
        let count = |count: usize| u32::try_from(count).unwrap_or(u32::MAX);
        ScopeObject {
            state: self.scope.state() as u32,
            every: settings.every.into(),
            rows_before: settings.rows_before.into(),
            trigger_signal: settings.trigger_signal.into(),
            trigger_level: settings.trigger_level.to_bits(),
            is_falling: settings.is_falling.into(),
            memory_values: count(self.scope.memory_values()),
            rows: count(self.scope.readable_rows()),
            trigger_row: count(self.scope.trigger_row()),
            ..Default::default()
        }
    }

    /// Returns the number of a signal of the scope, by its sub-index.
    pub(crate) fn scope_signal(&self, sub_index: u8) -> Result<u32, Abort> {
        let place = usize::from(sub_index).wrapping_sub(1);
        let number = self.scope.settings.signals.get(place).ok_or(Abort::NoSubIndex)?;
        Ok(u32::from(*number))
    }

    /// Writes an order or a setting of the scope. Settings act at the next start.
    pub(crate) fn write_scope(
        &mut self,
        at_index: u16,
        sub_index: u8,
        number: u32,
    ) -> Result<(), Abort> {
        let settings = &mut self.scope.settings;
        if at_index == index::SCOPE_SIGNALS {
            let place = usize::from(sub_index).wrapping_sub(1);
            *settings.signals.get_mut(place).ok_or(Abort::NoSubIndex)? = number as u8;
            return Ok(());
        }
        match sub_index {
            ScopeObject::ORDER => return self.order_scope(number as u8),
            ScopeObject::EVERY => settings.every = number as u16,
            ScopeObject::ROWS_BEFORE => settings.rows_before = number as u16,
            ScopeObject::TRIGGER_SIGNAL => settings.trigger_signal = number as u8,
            ScopeObject::TRIGGER_LEVEL => settings.trigger_level = f32::from_bits(number),
            ScopeObject::IS_FALLING if number <= 1 => settings.is_falling = number == 1,
            ScopeObject::IS_FALLING => {
                return Err(self.base.refuse_setting(text!("is_falling"), text!("0 or 1")));
            }
            _ => return Err(Abort::ReadOnly),
        }
        Ok(())
    }

    /// Executes an order: 0 stop, 1 start, 2 trigger.
    fn order_scope(&mut self, order: u8) -> Result<(), Abort> {
        match order {
            0 => self.scope.stop(),
            1 => {
                let started = self.scope.start();
                started.map_err(|why| self.base.refuse(Abort::Refused, why))?;
            }
            2 => self.scope.request_trigger(),
            _ => {
                let why =
                    text!("the order of the scope (2013h:1) is 0 (stop), 1 (start) or 2 (trigger)");
                return Err(self.base.refuse(Abort::Value, why));
            }
        }
        Ok(())
    }
}
