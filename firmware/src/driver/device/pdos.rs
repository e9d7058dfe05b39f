//! Transmit PDOs and their identifiers, which a master may change while the joint is disarmed.

use super::{Device, InputSource, Message};
use crate::node::sdo::Abort;
use compensator_core::can::{Frame, cob_id};
use embedded_storage::nor_flash::NorFlash;

/// Number of transmit PDOs, and the index of the drive's PDO.
pub const TRANSMIT_PDOS: usize = 6;
pub const DRIVE_PDO: usize = 5;

/// Bit of a PDO identifier that marks it as unused.
pub const PDO_UNUSED: u32 = 1 << 31;

impl<F: NorFlash> Device<F> {
    pub(super) fn send(&mut self, message: Message) {
        let slot = match message {
            Message::Answer(..) => 0,
            Message::Status(..) => 1,
            Message::Telemetry(..) => 2,
            Message::Motion(..) => 3,
            _ => 4,
        };
        self.transmit(slot, message.emit().data());
    }

    /// Sends a transmit PDO with its identifier, if it is in use.
    pub(super) fn transmit(&mut self, slot: usize, data: &[u8]) {
        let identifier = self.identifier(slot);
        if identifier & PDO_UNUSED == 0
            && let Some(frame) = Frame::new(identifier as u16 & Frame::MAX_IDENTIFIER, data)
        {
            self.outbox.push(frame);
        }
    }

    /// Returns the identifier of a transmit PDO as in its object; bit 31 is set if the PDO is unused.
    pub(in crate::driver) fn identifier(&self, slot: usize) -> u32 {
        if let Some(Some(given)) = self.identifiers.get(slot) {
            return *given;
        }
        let of_sensors = if self.settings.source == InputSource::Sensors { 0 } else { PDO_UNUSED };
        let (base, unused) = match slot {
            0 => (cob_id::TPDO_1, 0),
            1 => (cob_id::TPDO_2, 0),
            2 => (cob_id::TPDO_3, 0),
            3 => (cob_id::TPDO_4, of_sensors),
            4 => (cob_id::TPDO_5, of_sensors),
            // The predefined set has no sixth identifier. A master usually assigns that of a PDO it does not
            // need.
            _ => (cob_id::TPDO_1, PDO_UNUSED),
        };
        (u32::from(base) + u32::from(self.settings.node.number())) | unused
    }

    /// Sets the identifier of a transmit PDO, or marks it as unused (bit 31).
    pub(in crate::driver) fn set_identifier(
        &mut self,
        slot: usize,
        identifier: u32,
    ) -> Result<(), Abort> {
        // Bit 30 forbids remote requests, which are never answered.
        let number = identifier & !(PDO_UNUSED | 1 << 30);
        // The identifiers that CiA 301 permits for PDOs: the predefined set, and the free ones above SDO.
        let legal = (0x181..=0x57F).contains(&number) || (0x680..=0x6FF).contains(&number);
        if !legal && identifier & PDO_UNUSED == 0 {
            let why =
                format_args!("cob_id = {identifier:x}h: must be 181h to 57Fh or 680h to 6FFh");
            return Err(self.staging.refuse(Abort::Value, why));
        }
        if let Some(place) = self.identifiers.get_mut(slot) {
            *place = Some(identifier);
        }
        Ok(())
    }

    /// Resets the identifiers, when the communication restarts.
    pub(in crate::driver) fn reset_identifiers(&mut self) {
        self.identifiers = [None; TRANSMIT_PDOS];
    }

    pub(in crate::driver) fn has_own_identifiers(&self) -> bool {
        self.identifiers.iter().all(Option::is_none)
    }
}
