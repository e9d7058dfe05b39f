//! Transmit PDOs and their identifiers, which a master may change while the joint is disarmed.

use super::{Device, Message, Source};
use crate::node::sdo::Abort;
use compensator_core::can::{Frame, cob_id};
use embedded_storage::nor_flash::NorFlash;

/// Transmit PDOs, and the place of the drive's among them.
pub const TRANSMIT_PDOS: usize = 6;
pub const DRIVE_SLOT: usize = 5;

/// Bit of a PDO's identifier that says it is not used.
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

    /// Sends a transmit PDO under the identifier it has, where it is used.
    pub(super) fn transmit(&mut self, slot: usize, data: &[u8]) {
        let identifier = self.identifier(slot);
        if identifier & PDO_UNUSED == 0
            && let Some(frame) = Frame::new(identifier as u16 & Frame::LAST_IDENTIFIER, data)
        {
            self.outbox.push(frame);
        }
    }

    /// Identifier of a transmit PDO, as its object has it: with bit 31 where it is not used.
    pub(in crate::driver) fn identifier(&self, slot: usize) -> u32 {
        if let Some(Some(given)) = self.identifiers.get(slot) {
            return *given;
        }
        let of_sensors = if self.settings.source == Source::Sensors { 0 } else { PDO_UNUSED };
        let (base, unused) = match slot {
            0 => (cob_id::TPDO_1, 0),
            1 => (cob_id::TPDO_2, 0),
            2 => (cob_id::TPDO_3, 0),
            3 => (cob_id::TPDO_4, of_sensors),
            4 => (cob_id::TPDO_5, of_sensors),
            // There is no sixth place: a master gives it one, most likely that of an f32 frame it does not want.
            _ => (cob_id::TPDO_1, PDO_UNUSED),
        };
        (u32::from(base) + u32::from(self.settings.node.number())) | unused
    }

    /// A master gives a transmit PDO another identifier, or says that it is not to be used (bit 31).
    pub(in crate::driver) fn set_identifier(
        &mut self,
        slot: usize,
        identifier: u32,
    ) -> Result<(), Abort> {
        // Bit 30 forbids remote requests, which are never answered.
        let number = identifier & !(PDO_UNUSED | 1 << 30);
        // Those that CiA 301 leaves to PDOs: the predefined set's, and the free ones behind SDO.
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

    /// The communication starts anew: with the identifiers it had.
    pub(in crate::driver) fn forget_identifiers(&mut self) {
        self.identifiers = [None; TRANSMIT_PDOS];
    }

    pub(in crate::driver) fn has_own_identifiers(&self) -> bool {
        self.identifiers.iter().all(Option::is_none)
    }
}
