//! The driver's bus side without an image: the boot program answers if neither slot can be started.
//!
//! It has the identity, the program download and a heartbeat, all by CiA 301 and 302-3, and no process frames. It never
//! drives a bridge. A package is received into the second slot.

use super::Program;
use super::session::{RequestError, Session};
use crate::node::dictionary::index;
use crate::node::dictionary::records::{IdentityObject, ProgramObject};
use crate::node::sdo::{Abort, Objects, SdoServer, ValueBuffer};
use crate::node::{Network, NmtAction, Outbox};
use crate::node_settings::BusSettings;
use crate::store::{FoundIdentity, LoadedSet, MAX_PAYLOAD, Store, is_newer};
use canopen_rs::Address;
use compensator_core::can::{Frame, NodeId, cob_id};
use embedded_storage::nor_flash::NorFlash;

/// State in object 2040h:4 that means recovery.
pub const RECOVERY_STATE: u32 = 3;
const HEARTBEAT_MS: u16 = 1000;

/// Returns the identity object of a driver with this serial number.
pub fn identity(serial_number: u32) -> IdentityObject {
    IdentityObject {
        // No vendor number is registered.
        vendor_id: 0,
        product_code: u32::from_be_bytes(*b"FRIC"),
        revision_number: compensator_core::record::VERSION.into(),
        serial_number,
    }
}

/// Reads node number and bit rates from the newest copy of the joint's identity, or from the newest set if no copy is intact;
/// the defaults if there are none.
// Not inlined: the stack of a set is free again afterwards.
#[inline(never)]
pub fn stored_settings<F: NorFlash>(flash: &mut F, program: &Program) -> BusSettings {
    let mut store = Store::open_within(&mut *flash, program.other_store());
    if let FoundIdentity::Copy(copy) = store.find_identity(Some(program.running_store()))
        && let Some(settings) = copy.identity.first_chunk().and_then(BusSettings::parse)
    {
        return settings;
    }
    let mut newest = None;
    let mut newest_settings = BusSettings::default();
    for slots in [program.other_store(), program.running_store()] {
        let mut block = [0; MAX_PAYLOAD];
        let loaded = Store::open_within(&mut *flash, slots).load(&mut block);
        if let Ok(LoadedSet { sequence, .. }) = loaded
            && let Some(settings) = block.first_chunk().and_then(BusSettings::parse)
            && newest.is_none_or(|newest| is_newer(sequence, newest))
        {
            (newest, newest_settings) = (Some(sequence), settings);
        }
    }
    newest_settings
}

/// The node in recovery.
#[derive(Debug)]
pub struct Recovery<F> {
    network: Network,
    server: SdoServer,
    outbox: Outbox,
    objects: RecoveryObjects<F>,
    is_reset_requested: bool,
}

#[derive(Debug)]
struct RecoveryObjects<F> {
    flash: F,
    session: Session,
    identity: IdentityObject,
    now_us: u64,
}

impl<F: NorFlash> Recovery<F> {
    /// Starts the node: it sends the boot-up message.
    pub fn boot(
        node: NodeId,
        mut flash: F,
        program: Program,
        identity: IdentityObject,
        now_us: u64,
    ) -> Self {
        let mut outbox = Outbox::default();
        let network = Network::boot(node, now_us, &mut outbox);
        let session = Session::new(&mut flash, program, now_us);
        let objects = RecoveryObjects { flash, session, identity, now_us };
        Self { network, server: SdoServer::new(), outbox, objects, is_reset_requested: false }
    }

    /// Processes a received frame.
    pub fn receive(&mut self, frame: &Frame, now_us: u64) {
        self.objects.now_us = now_us;
        if let Some(action) = self.network.on_nmt_frame(frame) {
            self.is_reset_requested |= action == NmtAction::Reset;
            return;
        }
        let node = u16::from(self.network.node().number());
        if frame.identifier() != cob_id::SDO_REQUEST + node || !self.network.can_serve_objects() {
            return;
        }
        if let Ok(request) = <&[u8; 8]>::try_from(frame.data()) {
            let answer = self.server.answer(request, now_us, &mut self.objects);
            self.send_answer(answer);
        }
    }

    fn send_answer(&mut self, answer: Option<[u8; 8]>) {
        let identifier = cob_id::SDO_ANSWER + u16::from(self.network.node().number());
        if let Some(frame) = answer.and_then(|answer| Frame::new(identifier, &answer)) {
            self.outbox.push(frame);
        }
    }

    /// Runs the periodic work: call it about once a millisecond.
    pub fn tick(&mut self, now_us: u64) {
        self.network.tick(HEARTBEAT_MS, now_us, &mut self.outbox);
        let answer = self.server.tick(now_us, &mut self.objects);
        self.send_answer(answer);
        let objects = &mut self.objects;
        // Object 1F57h has the reason of a refusal.
        let _ = objects.session.tick(&mut objects.flash, now_us);
        self.is_reset_requested |= self.objects.session.is_restart_due(now_us);
    }

    /// Returns the next frame to send.
    pub fn transmit(&mut self) -> Option<Frame> {
        self.transmit_if(|_| true)
    }

    /// Returns the next frame to send of those whose identifier the controller can take now.
    pub fn transmit_if(&mut self, can_send: impl FnMut(u16) -> bool) -> Option<Frame> {
        if self.outbox.is_empty() {
            let segment = self.server.next_segment(&mut self.objects);
            self.send_answer(segment);
        }
        self.outbox.take(can_send)
    }

    /// Returns true if a restart is requested.
    pub const fn is_reset_requested(&self) -> bool {
        self.is_reset_requested
    }

    /// Returns the flash.
    pub const fn flash(&self) -> &F {
        &self.objects.flash
    }
}

impl<F: NorFlash> Objects for RecoveryObjects<F> {
    fn check_write(&mut self, at: Address, _length: Option<usize>) -> Result<(), Abort> {
        match (at.index, at.subindex) {
            (index::PROGRAM_DATA | index::PROGRAM_CONTROL, 1) => Ok(()),
            _ => Err(Abort::NoObject),
        }
    }

    fn write(&mut self, at: Address, value: &[u8]) -> Result<(), Abort> {
        self.check_write(at, None)?;
        let now_us = self.now_us;
        let done = if at.index == index::PROGRAM_DATA {
            self.session.write(&mut self.flash, value, now_us)
        } else {
            let [command] = *value else {
                return Err(if value.is_empty() { Abort::TooShort } else { Abort::TooLong });
            };
            self.session.control(&mut self.flash, command, now_us)
        };
        done.map_err(RequestError::abort)
    }

    fn takes_parts(&self, at: Address) -> bool {
        at.index == index::PROGRAM_DATA
    }

    fn write_part(&mut self, at: Address, _offset: usize, part: &[u8]) -> Result<(), Abort> {
        self.write(at, part)
    }

    fn end_stream(&mut self, _at: Address, _length: usize) -> Result<(), Abort> {
        Ok(())
    }

    fn read(&mut self, at: Address, value: &mut ValueBuffer) -> Result<(), Abort> {
        let place = usize::from(at.subindex).wrapping_sub(1);
        let words: &[u32] = match at.index {
            index::IDENTITY => &self.identity.words(),
            index::PROGRAM_CONTROL => &[u32::from(!self.session.is_active())],
            index::PROGRAM_IDENTIFICATION => &[0, self.session.other_crc()],
            index::FLASH_STATUS => &[self.session.flash_status()],
            index::PROGRAM => {
                &ProgramObject { state: RECOVERY_STATE, ..self.session.object() }.words()
            }
            index::DEVICE_NAME => {
                return value.extend_from_slice(b"recovery").map_err(|_| Abort::Memory);
            }
            _ => return Err(Abort::NoObject),
        };
        let word = words.get(place).ok_or(Abort::NoSubIndex)?;
        let bytes = word.to_le_bytes();
        let is_byte = at.index == index::PROGRAM_CONTROL
            || at.index == index::PROGRAM
                && matches!(at.subindex, ProgramObject::STATE | ProgramObject::OTHER_STATE);
        let length = if is_byte { 1 } else { bytes.len() };
        value.extend_from_slice(bytes.get(..length).unwrap_or(&bytes)).map_err(|_| Abort::Memory)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::memory::{MemoryFlash, PAGE_BYTES};
    use crate::update::session::CLEAR;
    use crate::update::{Board, Slot};

    #[test]
    fn program_control_takes_one_byte() {
        const PAGE: u32 = PAGE_BYTES as u32;
        let slot = |page: u32| Slot { start: page * PAGE, marks: (page + 1) * PAGE };
        let program = Program {
            board: Board { number: 1, wiring: 2 },
            key_at: 0,
            base: 0,
            running: slot(0),
            other: slot(2),
            stores: [4 * PAGE, 6 * PAGE],
            store_bytes: 2 * PAGE,
        };
        let flash = MemoryFlash::<8>::new();
        let mut recovery = Recovery::boot(NodeId::FIRST, flash, program, identity(1), 0);
        let control = Address::new(index::PROGRAM_CONTROL, 1);
        for (value, result) in [
            (&[CLEAR][..], Ok(())),
            (&[], Err(Abort::TooShort)),
            (&[CLEAR, 0], Err(Abort::TooLong)),
        ] {
            assert_eq!(recovery.objects.write(control, value), result);
        }
    }
}
