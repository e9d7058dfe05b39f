//! Process data objects: identifiers, transmission types and mappings, which a master may change.
//!
//! The defaults are the frames of `joint.dbc`. A master changes them while the joint is disarmed; they are not stored and
//! return to the defaults when the communication is reset, because a master configures its nodes at every start.
//! Receive PDOs with their default mapping are read as the frames they are; with another mapping, each object is
//! written as if by SDO.

mod identifiers;
mod mapping;
mod objects;
mod sync;
mod transmit;

use super::{Device, Message, NodeId};
use crate::driver::counters::count;
use crate::driver::motion::Target;
use crate::joint_node::sample_frames::{MOTION, SLOW_TYPE, SYNC_ORDER, TELEMETRY};
use crate::node::dictionary::index;
use crate::node::dictionary::records::TransmitPdoObject as Parameter;
use crate::node::sdo::{Abort, Objects};
use crate::node_settings::InputSource;
use canopen_rs::Address;
use compensator_core::can::{FdTelemetry, Frame, FrameError, SyncFrame};
use embedded_storage::nor_flash::NorFlash;
use identifiers::{DefaultIdentifier, RECEIVE_IDENTIFIERS, TRANSMIT_IDENTIFIERS};
use mapping::{Direction, Mapping};
use objects::PdoObjectAddress;
use sync::SyncState;
use transmit::{EVENT_DRIVEN, EVERY_SYNC, LAST_SYNCHRONOUS, SendOccasion, TransmitPdo};

/// Number of PDOs in each direction.
pub const PDOS: usize = 6;

/// Bit of a PDO identifier that marks it as unused.
const PDO_UNUSED: u32 = 1 << 31;

/// Receive PDO with the targets of a CiA 402 master.
const RECEIVE_DRIVE: usize = 0;

/// Receive PDO with the command current.
const RECEIVE_COMMAND: usize = 1;

/// Receive PDOs up to here are event-driven by default.
const LAST_EVENT_DRIVEN: usize = RECEIVE_COMMAND;

/// Transmit PDO of the CiA 402 drive, which has no identifier by default.
const DRIVE: usize = 5;

/// A receive PDO.
#[derive(Clone, Copy, Debug)]
struct ReceivePdo {
    /// Identifier that a master has set, with bit 31 for unused.
    identifier: Option<u32>,
    kind: u8,
    mapping: Mapping,
    /// Frame that waits for the next SYNC.
    pending: Option<Frame>,
}

impl ReceivePdo {
    fn new(slot: usize) -> Self {
        let kind = if slot <= LAST_EVENT_DRIVEN { EVENT_DRIVEN } else { EVERY_SYNC };
        Self { identifier: None, kind, mapping: Mapping::of_receive(slot), pending: None }
    }
}

/// All PDOs of a joint.
#[derive(Debug)]
pub struct Pdos {
    /// Node number in use.
    node: NodeId,
    transmit: [TransmitPdo; PDOS],
    receive: [ReceivePdo; PDOS],
    sync: SyncState,
}

impl Pdos {
    pub fn new(node: NodeId) -> Self {
        Self {
            node,
            transmit: core::array::from_fn(TransmitPdo::new),
            receive: core::array::from_fn(ReceivePdo::new),
            sync: SyncState::new(),
        }
    }

    pub const fn set_node(&mut self, node: NodeId) {
        self.node = node;
    }

    /// Returns the identifier of a transmit PDO as in its object; bit 31 is set if the PDO is unused.
    fn transmit_identifier(&self, slot: usize, source: InputSource) -> u32 {
        let given = self.transmit.get(slot).and_then(|pdo| pdo.identifier);
        given.unwrap_or_else(|| self.default_identifier(&TRANSMIT_IDENTIFIERS, slot, source))
    }

    /// Returns the identifier of a receive PDO as in its object; bit 31 is set if the PDO is unused.
    fn receive_identifier(&self, slot: usize, source: InputSource) -> u32 {
        let given = self.receive.get(slot).and_then(|pdo| pdo.identifier);
        given.unwrap_or_else(|| self.default_identifier(&RECEIVE_IDENTIFIERS, slot, source))
    }

    #[inline(never)]
    fn default_identifier(
        &self,
        of_slots: &[DefaultIdentifier; PDOS],
        slot: usize,
        source: InputSource,
    ) -> u32 {
        of_slots.get(slot).map_or(PDO_UNUSED, |default| default.value(self.node, source))
    }
}

impl<F: NorFlash> Device<F> {
    /// Returns the transmission type of a transmit PDO that no master has set. In HIL each sample has its answers, and one
    /// frame of CAN FD has room for all PDOs.
    fn default_transmit_type(&self, slot: usize) -> u8 {
        let settings = &self.base.settings;
        let is_at_every_sync = [MOTION, DRIVE].contains(&slot)
            || settings.is_in_hil()
            || self.sends_fd_telemetry()
            // 2001h:5 states the rate of Telemetry.
            || slot == TELEMETRY && settings.telemetry_every > 1;
        if is_at_every_sync { EVERY_SYNC } else { SLOW_TYPE }
    }

    /// Returns the identifiers of the receive PDOs in use; 0 for none.
    #[inline(never)]
    pub(super) fn pdo_identifiers(&self) -> [u16; PDOS] {
        core::array::from_fn(|slot| {
            let identifier = self.pdos.receive_identifier(slot, self.base.settings.source);
            if identifier & PDO_UNUSED == 0 { identifier as u16 & Frame::MAX_IDENTIFIER } else { 0 }
        })
    }

    /// Returns the receive PDO with this identifier.
    pub(super) fn receive_slot(&self, identifier: u16) -> Option<usize> {
        self.pdo_identifiers().iter().position(|used| *used == identifier && *used != 0)
    }

    /// Returns the value of a PDO parameter, a mapping or a SYNC object.
    pub(crate) fn pdo_number(&self, at_index: u16, place: u8) -> Result<u32, Abort> {
        match at_index {
            index::SYNC_PERIOD => return Ok(self.pdos.sync.period_us),
            index::SYNC_WINDOW => return Ok(self.pdos.sync.window_us),
            index::SYNC_OVERFLOW => return Ok(self.pdos.sync.overflow.into()),
            _ => {}
        }
        let PdoObjectAddress { direction, slot, is_mapping } = PdoObjectAddress::of(at_index);
        match direction {
            Direction::Receive => {
                let pdo = self.pdos.receive.get(slot).ok_or(Abort::NoObject)?;
                Ok(match place {
                    _ if is_mapping => return pdo.mapping.number(place),
                    Parameter::COB_ID => {
                        self.pdos.receive_identifier(slot, self.base.settings.source)
                    }
                    Parameter::TRANSMISSION_TYPE => pdo.kind.into(),
                    Parameter::INHIBIT_TIME | Parameter::COMPATIBILITY_ENTRY => 0,
                    Parameter::EVENT_TIMER => self.base.settings.target_timeout_ms.into(),
                    _ => return Err(Abort::NoSubIndex),
                })
            }
            Direction::Transmit => {
                let pdo = self.pdos.transmit.get(slot).ok_or(Abort::NoObject)?;
                Ok(match place {
                    _ if is_mapping => return pdo.mapping.number(place),
                    Parameter::COB_ID => {
                        self.pdos.transmit_identifier(slot, self.base.settings.source)
                    }
                    Parameter::TRANSMISSION_TYPE => {
                        pdo.kind.unwrap_or(self.default_transmit_type(slot)).into()
                    }
                    Parameter::INHIBIT_TIME => pdo.inhibit_time.into(),
                    Parameter::COMPATIBILITY_ENTRY => 0,
                    Parameter::EVENT_TIMER => pdo.event_timer_ms.into(),
                    Parameter::SYNC_START => pdo.sync_start.into(),
                    _ => return Err(Abort::NoSubIndex),
                })
            }
        }
    }

    /// Writes a PDO parameter, a mapping or a SYNC object.
    pub(crate) fn write_pdo(&mut self, at: Address, number: u32) -> Result<(), Abort> {
        self.pdos.write(&mut self.base, at, number)
    }

    /// Resets all PDOs to their defaults, when the communication restarts.
    pub(super) fn reset_pdos(&mut self) {
        let settings = self.base.settings;
        if settings.node != self.pdos.node {
            // The inputs in HIL carry the node number.
            let _ = self.set_settings(settings);
            self.memory.is_blank = false;
        }
        // Settings that were stored since the start are those of the joint.
        self.memory.is_blank &= !self.memory.is_stored;
        self.pdos = Pdos::new(settings.node);
    }

    /// Returns the node number in use.
    pub(super) const fn node_in_use(&self) -> NodeId {
        self.pdos.node
    }

    /// Forgets what was sent and received, when the network leaves the operational state.
    pub(super) fn restart_pdos(&mut self) {
        self.pdos.transmit.iter_mut().for_each(TransmitPdo::restart);
        self.pdos.receive.iter_mut().for_each(|pdo| pdo.pending = None);
    }

    /// Returns true if all transmit PDOs are frames of `joint.dbc`.
    pub fn has_default_transmit_pdos(&self) -> bool {
        (0..PDOS).all(|slot| self.has_default_frame(slot))
    }

    /// Processes a frame of a receive PDO.
    pub(super) fn take_pdo(&mut self, slot: usize, frame: &Frame, now_us: u64) {
        let is_late = self.pdos.sync.is_outside_window(now_us);
        let Some(pdo) = self.pdos.receive.get_mut(slot) else { return };
        if pdo.kind <= LAST_SYNCHRONOUS {
            if is_late {
                return count(&mut self.base.counters.outside_window, 1);
            }
            // The inputs of a sample wait for its SYNC anyway.
            let is_input = slot > LAST_EVENT_DRIVEN && pdo.mapping == Mapping::of_receive(slot);
            if !is_input {
                pdo.pending = Some(*frame);
                return;
            }
        }
        self.apply_pdo(slot, frame, now_us);
    }

    /// Writes the objects of a receive PDO.
    fn apply_pdo(&mut self, slot: usize, frame: &Frame, now_us: u64) {
        let Some(mapping) = self.pdos.receive.get(slot).map(|pdo| pdo.mapping) else { return };
        self.base.now_us = now_us;
        if mapping != Mapping::of_receive(slot) {
            return self.apply_mapped(mapping, frame);
        }
        if slot == RECEIVE_DRIVE {
            return self.take_drive_frame(frame);
        }
        let node = self.pdos.node;
        let identifier =
            self.pdos.default_identifier(&RECEIVE_IDENTIFIERS, slot, self.base.settings.source)
                as u16
                & Frame::MAX_IDENTIFIER;
        let Some(frame) = Frame::new(identifier, frame.data()) else { return };
        match Message::parse(&frame) {
            Ok(message) => self.take(&message, &frame, node, now_us),
            Err(FrameError::Length { .. }) => self.base.counters.count_wrong_length(),
            Err(_) => count(&mut self.base.counters.wrong_content, 1),
        }
    }

    fn apply_mapped(&mut self, mapping: Mapping, frame: &Frame) {
        if frame.data().len() < mapping.length() {
            return self.base.counters.count_wrong_length();
        }
        let (mut rest, mut target) = (frame.data(), Target::default());
        for object in mapping.objects() {
            let Some((value, after)) = rest.split_at_checked(object.length) else { return };
            rest = after;
            // A master repeats the mode in every frame; only a change is a request.
            if object.index == index::MODE && self.motion.profile.mode.to_le_bytes() == *value {
                continue;
            }
            let mut word = [0; 4];
            word.iter_mut().zip(value).for_each(|(place, byte)| *place = *byte);
            let at = Address::new(object.index, object.sub_index);
            // A refusal is reported as for an object (2028h), and in the statusword.
            if !target.add(object.index, u32::from_le_bytes(word))
                && self.check_write(at, Some(value.len())).is_ok()
            {
                let _ = self.write(at, value);
            }
        }
        // Last, whatever their order: the mode and the limits of this frame apply to its targets.
        let _ = self.take_target(&target);
    }

    /// Processes a SYNC with its counter, or a plain one.
    pub(super) fn take_sync(&mut self, counter: Option<u8>, now_us: u64) {
        let sync = self.pdos.sync.take(counter, now_us);
        self.base.now_us = now_us;
        for slot in 0..PDOS {
            let pending = self.pdos.receive.get_mut(slot).and_then(|pdo| pdo.pending.take());
            if let Some(frame) = pending {
                self.apply_pdo(slot, &frame, now_us);
            }
        }
        if let Some(sequence) = self.sync(sync) {
            self.transmit_at_sync(counter, sync, sequence);
        }
    }

    fn transmit_at_sync(&mut self, counter: Option<u8>, sync: SyncFrame, sequence: u32) {
        let now_us = self.base.now_us;
        let every = u32::from(self.base.settings.telemetry_every);
        let has_telemetry = every > 0 && sequence.is_multiple_of(every);
        let mut fd = self.sends_fd_telemetry().then(|| {
            // The lower half of the time.
            FdTelemetry::new(self.pdos.node, sync.counter, now_us as u32)
        });
        let occasion = SendOccasion::Sync { counter };
        let mut is_empty = true;
        for slot in SYNC_ORDER.into_iter().chain([DRIVE]) {
            if slot == TELEMETRY && !has_telemetry {
                continue;
            }
            let Some((data, frame)) = self.due_frame(slot, occasion, now_us) else { continue };
            match &mut fd {
                Some(fd) if self.has_default_frame(slot) => {
                    fd.put(slot, data);
                    is_empty = false;
                }
                _ => self.base.outbox.push(frame),
            }
        }
        if let Some(mut fd) = fd
            && !is_empty
        {
            fd.put(DRIVE, self.mapped_data(&Mapping::of_transmit(DRIVE)));
            self.base.outbox.set_fd(fd);
        }
    }

    /// Returns true if the transmit PDOs go into a frame of CAN FD. A master that moves Telemetry, whose identifier this
    /// frame has, gets classic frames.
    fn sends_fd_telemetry(&self) -> bool {
        self.base.settings.fd_telemetry && self.sends_fd && self.has_default_frame(TELEMETRY)
    }

    /// Returns true if no master has changed identifier or content of a transmit PDO.
    fn has_default_frame(&self, slot: usize) -> bool {
        self.pdos.transmit.get(slot).is_some_and(|pdo| {
            pdo.identifier.is_none() && pdo.mapping == Mapping::of_transmit(slot)
        })
    }

    /// Sends the event-driven PDOs that are due: once per tick while the network is operational.
    pub(super) fn transmit_events(&mut self, now_us: u64) {
        for slot in 0..PDOS {
            if self.pdos.transmit.get(slot).is_some_and(TransmitPdo::is_event_driven)
                && let Some((_, frame)) = self.due_frame(slot, SendOccasion::Tick, now_us)
            {
                self.base.outbox.push(frame);
            }
        }
    }

    /// Returns data and frame of a transmit PDO, if it is in use and due.
    #[inline(never)]
    fn due_frame(
        &mut self,
        slot: usize,
        occasion: SendOccasion,
        now_us: u64,
    ) -> Option<([u8; 8], Frame)> {
        let identifier = self.pdos.transmit_identifier(slot, self.base.settings.source);
        let mapping = self.pdos.transmit.get(slot)?.mapping;
        let length = mapping.length();
        if identifier & PDO_UNUSED != 0 || length == 0 {
            return None;
        }
        let data = self.mapped_data(&mapping);
        let default = self.default_transmit_type(slot);
        let pdo = self.pdos.transmit.get_mut(slot)?;
        let is_due = match occasion {
            SendOccasion::Sync { counter } => pdo.is_due_at_sync(default, counter, data, now_us),
            SendOccasion::Tick => pdo.is_due_by_event(data, now_us),
        };
        if !is_due {
            return None;
        }
        let identifier = identifier as u16 & Frame::MAX_IDENTIFIER;
        Some((data, Frame::new(identifier, data.get(..length).unwrap_or(&data))?))
    }

    /// Returns the values of the mapped objects, one after the other.
    fn mapped_data(&self, mapping: &Mapping) -> [u8; 8] {
        let mut data = [0; 8];
        let mut rest = &mut data[..];
        for object in mapping.objects() {
            let number = self.number(object.index, object.sub_index).unwrap_or_default();
            let Some((place, after)) = rest.split_at_mut_checked(object.length) else { break };
            for (byte, value) in place.iter_mut().zip(number.to_le_bytes()) {
                *byte = value;
            }
            rest = after;
        }
        data
    }
}
