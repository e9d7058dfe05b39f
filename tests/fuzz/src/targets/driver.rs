//! Fuzzes a whole joint driver with frames, ticks, loop reports, power cuts and restarts, and checks its invariants.
//!
//! The input is a list of steps. A step is one byte that selects its kind, followed by the bytes it needs.
//! Half of the steps use frames that the driver accepts and objects that it has. With random identifiers alone,
//! almost every frame would be ignored.

use crate::bytes::Bytes;
use canopen_rs::Address;
use canopen_rs::sdo::{encode_data_segment, encode_download_initiate_segmented};
use compensator_core::can::{Frame, Message, NodeId};
use compensator_core::{Flags, record};
use firmware::access::AccessSettings;
use firmware::background::BoardState;
use firmware::driver::{Boot, Driver, Identity, LoopReport};
use firmware::joint_node::Joint as _;
use firmware::loop_parts::StageTraits;
use firmware::node::OUTBOX_CAPACITY;
use firmware::node::dictionary::{LOAD_SIGNATURE, OBJECTS, SAVE_SIGNATURE, index};
use firmware::node::lss::LSS_ANSWER;
use firmware::node_settings::{InputSource, NodeSettings};
use firmware::store::memory::{MemoryFlash, TornStep};
use firmware::supervisor::{CanState, ResetCause};

type Flash = MemoryFlash<4>;

const IDENTITY: Identity = Identity { hardware: "fuzz", serial: 1, stage: StageTraits::NONE };

impl Bytes<'_> {
    fn word(&mut self) -> u32 {
        u32::from_le_bytes(std::array::from_fn(|_| self.byte()))
    }

    /// Returns a number: an edge case, a value within +-5, or any bits.
    fn number(&mut self) -> f32 {
        const EDGES: [f32; 8] = [0.0, 1.0, -1.0, 0.1, f32::NAN, f32::INFINITY, 1e9, 1e-20];
        match self.byte() {
            kind @ 0..=7 => EDGES[usize::from(kind)],
            kind @ 8..=200 => (f32::from(kind) - 100.0) * 0.05,
            _ => f32::from_bits(self.word()),
        }
    }
}

/// A driver, its settings and its clock.
struct World {
    driver: Driver<Flash>,
    settings: NodeSettings,
    now_us: u64,
    /// Number and CRC of the parameter set that was last checked; `None` after a start.
    set: Option<(u32, u32)>,
}

fn boot(settings: NodeSettings, flash: Flash, cause: ResetCause, now_us: u64) -> Driver<Flash> {
    Driver::boot(settings, flash, IDENTITY, &Boot { cause, ..Boot::default() }, now_us)
}

impl World {
    fn frame(&mut self, identifier: u16, data: &[u8]) {
        if let Some(frame) = Frame::new(identifier & Frame::MAX_IDENTIFIER, data) {
            self.driver.receive(&frame, self.now_us);
        }
    }

    /// Downloads a value over SDO without waiting for answers. Drains the outbox after each segment, as a board does.
    fn write(&mut self, at: u16, sub_index: u8, value: &[u8]) {
        let node = u16::from(self.settings.node.number());
        if value.len() <= 4 {
            let [low, high] = at.to_le_bytes();
            let mut request =
                [0x23 | (4 - value.len() as u8) << 2, low, high, sub_index, 0, 0, 0, 0];
            request[4..4 + value.len()].copy_from_slice(value);
            return self.frame(0x600 + node, &request);
        }
        let begin =
            encode_download_initiate_segmented(Address::new(at, sub_index), value.len() as u32);
        self.frame(0x600 + node, &begin);
        let count = value.chunks(7).count();
        for (position, chunk) in value.chunks(7).enumerate() {
            let segment = encode_data_segment(chunk, position % 2 == 1, position + 1 == count);
            self.frame(0x600 + node, &segment.expect("a segment holds seven bytes"));
            self.drain();
        }
    }

    /// Takes every frame out of the outbox and checks its identifier, length and content.
    fn drain(&mut self) {
        let node = u16::from(self.driver.node().number());
        let sent: Vec<Frame> = std::iter::from_fn(|| self.driver.transmit()).collect();
        // The segments of a block are made while the outbox is empty.
        assert!(sent.len() <= OUTBOX_CAPACITY + 127, "{} frames", sent.len());
        for frame in sent {
            let identifier = frame.identifier();
            let length = frame.data().len();
            if identifier == LSS_ANSWER {
                assert_eq!(length, 8);
                continue;
            }
            if self.driver.node() != self.settings.node {
                // LSS changed the node number, and frames with the number before may have waited.
                continue;
            }
            let base = identifier.wrapping_sub(node);
            if !self.driver.joint.has_default_transmit_pdos()
                && !matches!(base, 0x080 | 0x580 | 0x700)
            {
                // A master changed the identifiers. Only their legal ranges can be checked.
                assert!(
                    (0x181..=0x57F).contains(&identifier) || (0x680..=0x6FF).contains(&identifier)
                );
                continue;
            }
            match base {
                0x080 | 0x580 => assert_eq!(length, 8),
                0x700 => assert_eq!(length, 1),
                0x180 | 0x280 | 0x380 | 0x480 | 0x680 => self.check_message(&frame),
                _ => panic!("{identifier:03X} from node {node}"),
            }
        }
    }

    /// Checks a process data frame: it round-trips, and in HIL its values are within the limits.
    fn check_message(&self, frame: &Frame) {
        let message = Message::parse(frame).expect("the driver sends only legal frames");
        assert_eq!(message.emit(), *frame);
        let limits = &self.driver.joint.set().friction.compensator;
        if self.driver.joint.settings().source == InputSource::Sensors {
            return;
        }
        match message {
            Message::Answer(_, answer) => {
                assert!(answer.friction_torque_nm.is_finite(), "{answer:?}");
                let max_a = limits.torque_limit_nm / limits.torque_constant_nm_per_a;
                // Tolerance: half a step of fixed point, and a rounding of f32.
                let max_a =
                    max_a.abs() * 1.000_01 + 2e-6 / limits.torque_constant_nm_per_a.min(1.0);
                assert!(
                    answer.feed_forward_current_a.abs() <= max_a,
                    "{answer:?} exceeds {max_a} A"
                );
            }
            Message::Status(_, status) => {
                assert_eq!(status.flags - Flags::all(), Flags::empty());
                assert!(!status.flags.contains(Flags::MODEL_NOT_FINITE), "{status:?}");
            }
            Message::Telemetry(_, telemetry) => {
                assert!(telemetry.current_a.abs() <= limits.current_limit_a * 1.000_01 + 2e-6);
            }
            _ => panic!("{message:?} from a joint in HIL"),
        }
    }

    /// Checks the invariants of the loop commands, and the active parameter set if it is a new one.
    fn check(&mut self) {
        let commands = self.driver.joint.loop_commands(self.now_us);
        let is_hil = self.driver.joint.settings().source == InputSource::Bus;
        let drives = commands.bridge || commands.compensation;
        assert!(!(is_hil && drives), "a joint in HIL drives its motor");
        assert!(
            !commands.compensation || commands.bridge,
            "compensation is on while the bridge is off"
        );
        assert!(
            !commands.bridge || self.driver.joint.is_armed(),
            "the bridge is on while the driver is not armed"
        );
        assert!((0.0..=1.0).contains(&commands.current_share), "{}", commands.current_share);
        // Only a new set is checked: validation and CRC take longer than all other checks.
        if self.set.is_none_or(|(number, _)| number != commands.set_number) {
            assert!(
                self.set.is_none() || !self.driver.joint.is_armed(),
                "the set changed while the driver was armed"
            );
            let set = self.driver.joint.set();
            assert!(set.validate().is_ok(), "the active set is not valid");
            self.set = Some((commands.set_number, set.crc()));
        }
    }

    /// Checks that the active set is the one that was last checked.
    fn check_set(&self) {
        let crc = self.set.map(|(_, crc)| crc);
        assert_eq!(
            crc,
            Some(self.driver.joint.set().crc()),
            "the set changed but its number did not"
        );
    }

    /// Restarts the driver on its own flash.
    fn restart(&mut self, cause: ResetCause) {
        let old = std::mem::replace(
            &mut self.driver,
            boot(self.settings, Flash::new(), ResetCause::PowerOn, self.now_us),
        );
        let mut flash = old.joint.into_flash();
        flash.power_on();
        self.driver = boot(self.settings, flash, cause, self.now_us);
        self.set = None;
        self.learn_node();
    }

    /// Reads the node number, which may come from flash, from the boot-up message.
    fn learn_node(&mut self) {
        let first = self.driver.transmit().expect("a boot-up message");
        assert_eq!(first.identifier() & !0x7F, 0x700);
        self.settings.node =
            NodeId::new((first.identifier() & 0x7F) as u8).expect("a legal node number");
        assert!(!self.driver.joint.is_armed(), "the driver is armed after a start");
    }
}

/// The steps that need more than one call of the driver.
impl World {
    fn node_number(&self) -> u16 {
        u16::from(self.settings.node.number())
    }

    /// Sends a frame with an identifier that the driver accepts.
    fn receive_addressed_frame(&mut self, bytes: &mut Bytes) {
        const ACCEPTED: [u16; 9] = [0x480, 0x680, 0x400, 0x300, 0x500, 0x600, 0x080, 0x000, 0x200];
        let node = self.node_number();
        let kind = usize::from(bytes.byte() % 9);
        let identifier = ACCEPTED[kind] + if matches!(kind, 6 | 7) { 0 } else { node };
        let numbers = [bytes.number(), bytes.number()];
        let mut data = [0; 8];
        data[..4].copy_from_slice(&numbers[0].to_le_bytes());
        data[4..].copy_from_slice(&numbers[1].to_le_bytes());
        match kind {
            5 => data = std::array::from_fn(|_| bytes.byte()),
            6 => data[0] = bytes.byte(),
            7 => (data[0], data[1]) = (bytes.byte(), bytes.byte() % 2 * node as u8),
            _ => {}
        }
        let length = [8, 8, 8, 8, 8, 8, 1, 2, 4][kind];
        self.frame(identifier, &data[..length]);
    }

    /// Sends one HIL sample: a motion frame and a SYNC.
    fn receive_sample(&mut self, bytes: &mut Bytes) {
        let (velocity, counter) = (bytes.number(), bytes.byte() % 240 + 1);
        let mut data = [0; 8];
        data[..4].copy_from_slice(&velocity.to_le_bytes());
        data[4..].copy_from_slice(&bytes.number().to_le_bytes());
        self.frame(0x480 + self.node_number(), &data);
        self.frame(0x080, &[counter]);
    }

    /// Sends a frame with any identifier and any data.
    fn receive_arbitrary_frame(&mut self, bytes: &mut Bytes) {
        let (identifier, length) = (bytes.word() as u16, bytes.byte() % 9);
        let data: Vec<u8> = (0..length).map(|_| bytes.byte()).collect();
        self.frame(identifier, &data);
    }

    /// Writes an object of the dictionary with the length of its type.
    fn write_existing_object(&mut self, bytes: &mut Bytes) {
        let object = &OBJECTS[usize::from(bytes.byte()) % OBJECTS.len()];
        let sub_index =
            (u16::from(bytes.byte()) % (u16::from(object.highest_sub_index()) + 1)) as u8;
        let length = object.entry(sub_index).and_then(|entry| entry.data.length()).unwrap_or(4);
        let word =
            if bytes.byte().is_multiple_of(2) { bytes.number().to_bits() } else { bytes.word() };
        self.write(object.index, sub_index, &word.to_le_bytes()[..length]);
    }

    /// Saves, restores, commits or commissions, with the signature or CRC that the object needs.
    fn write_service_object(&mut self, bytes: &mut Bytes) {
        let crc = self.driver.joint.set().crc();
        match bytes.byte() % 7 {
            5 => {
                let wiring = self.driver.joint.set().wiring_crc();
                self.write(index::COMMISSIONING, 3, &wiring.to_le_bytes());
            }
            0 => self.write(index::STORE, 1, &SAVE_SIGNATURE.to_le_bytes()),
            1 => self.write(index::RESTORE, 1, &LOAD_SIGNATURE.to_le_bytes()),
            2 => self.write(index::COMMIT, 4, &[1]),
            3 => self.write(index::COMMIT, 3, &crc.to_le_bytes()),
            _ => self.commit_staged(),
        }
    }

    /// Reads the CRC of the staged set and commits with it, as a configuration tool does.
    fn commit_staged(&mut self) {
        let [low, high] = index::COMMIT.to_le_bytes();
        self.drain();
        self.frame(0x600 + self.node_number(), &[0x40, low, high, 2, 0, 0, 0, 0]);
        let answer = std::iter::from_fn(|| self.driver.transmit()).last();
        if let Some(answer) = answer
            && let [0x43, _, _, _, crc @ ..] = answer.data()
        {
            let crc = crc.to_vec();
            self.write(index::COMMIT, 3, &crc);
        }
    }

    /// Writes the record of the active model with one parameter changed.
    fn stage_model(&mut self, bytes: &mut Bytes) {
        let mut friction = self.driver.joint.set().friction.clone();
        let id = compensator_core::ParameterId::ALL[usize::from(bytes.byte()) % 41];
        friction.model.set(id, bytes.number());
        self.write(index::COMMIT, 5, &record::emit(&friction));
    }

    /// Restarts with a flash that loses power during the next save, saves, and restarts again.
    fn interrupt_save(&mut self, bytes: &mut Bytes) {
        let fresh = boot(self.settings, Flash::new(), ResetCause::PowerOn, self.now_us);
        let mut flash = std::mem::replace(&mut self.driver, fresh).joint.into_flash();
        flash.cut_power(usize::from(bytes.byte()) as _, TornStep::Nothing);
        self.driver = boot(self.settings, flash, ResetCause::PowerOn, self.now_us);
        self.set = None;
        self.learn_node();
        self.write(index::STORE, 1, &SAVE_SIGNATURE.to_le_bytes());
        self.drain();
        self.restart(ResetCause::PowerOn);
    }
}

/// Runs one step of the input. `selector` chooses its kind.
fn step(world: &mut World, selector: u8, bytes: &mut Bytes) {
    let node = world.node_number();
    match selector % 16 {
        0..=2 => world.receive_addressed_frame(bytes),
        3 => world.receive_sample(bytes),
        4 => world.receive_arbitrary_frame(bytes),
        5..=7 => world.write_existing_object(bytes),
        8 => world.write(index::STATE, 1, &[bytes.byte() % 4]),
        9 => world.write_service_object(bytes),
        10 => world.stage_model(bytes),
        // An NMT command to this node or to all nodes.
        11 => world.frame(0x000, &[bytes.byte(), node as u8 * (bytes.byte() % 2)]),
        12 => {
            world.now_us += u64::from(bytes.byte()) * u64::from(bytes.byte()) * 50;
            world.driver.tick(world.now_us);
        }
        13 => world.driver.joint.report(&loop_report(bytes)),
        14 => {
            let states = [CanState::Active, CanState::Active, CanState::Off];
            let receiver_overrun = bytes.byte() == 0;
            let can = states[usize::from(bytes.byte() % 3)];
            let state = BoardState { receiver_overrun, can, ..BoardState::default() };
            world.driver.joint.take_board_state(&state);
        }
        _ => match bytes.byte() % 8 {
            0 => world.restart(ResetCause::Watchdog),
            1 => world.interrupt_save(bytes),
            _ => world.now_us += u64::from(bytes.byte()),
        },
    }
}

/// Returns a report of the current loop with values from the input.
fn loop_report(bytes: &mut Bytes) -> LoopReport {
    LoopReport {
        bus_voltage_v: (bytes.byte().is_multiple_of(2)).then(|| bytes.number() * 24.0),
        phase_currents_a: Some(std::array::from_fn(|_| bytes.number())),
        current_a: bytes.number(),
        current_reference_a: bytes.number(),
        velocity_rad_s: bytes.number(),
        position_rad: bytes.number(),
        motor_torque_nm: bytes.number(),
        friction_torque_nm: bytes.number(),
        feed_forward_current_a: bytes.number(),
        residual_torque_nm: bytes.number(),
        flags: Flags::from_bits_truncate(bytes.word()),
        bridge_temperature_c: Some(bytes.number() * 50.0),
        motor_temperature_c: (bytes.byte().is_multiple_of(2)).then(|| bytes.number() * 50.0),
        sample_age_us: Some(bytes.word() % 4096),
        gate_driver_fault: bytes.byte() == 255,
        stack_intact: bytes.byte() != 255,
        overruns_in_a_row: u32::from(bytes.byte() % 8),
        ..LoopReport::default()
    }
}

/// Executes the target on an input.
pub fn run(data: &[u8]) {
    let mut bytes = Bytes(data);
    let start = bytes.byte();
    let source = if start % 2 == 0 { InputSource::Bus } else { InputSource::Sensors };
    // A locked joint would refuse what is to be tested. The policy and the key are objects, too.
    let access = AccessSettings { is_locked: start / 2 % 8 == 7, ..AccessSettings::default() };
    let settings = NodeSettings { node: NodeId::FIRST, source, access, ..NodeSettings::default() };
    let driver = boot(settings, Flash::new(), ResetCause::PowerOn, 0);
    let mut world = World { driver, settings, now_us: 0, set: None };
    world.learn_node();
    world.check();
    while let Some(selector) = bytes.next() {
        step(&mut world, selector, &mut bytes);
        world.drain();
        if world.driver.is_reset_requested() {
            world.restart(ResetCause::Software);
        }
        world.check();
    }
    world.check_set();
    world.restart(ResetCause::PowerOn);
    world.check();
}
