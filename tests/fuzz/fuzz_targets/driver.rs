//! Any frames, ticks, reports of a current loop, power cuts and restarts: what a driver may never do.
//!
//! The input is a list of steps, a byte that says which and what it needs. Half the steps are aimed (frames a
//! driver listens to, objects it has), or the fuzzer would spend its life in front of the identifiers.

#![no_main]

use canopen_rs::Address;
use canopen_rs::sdo::{encode_data_segment, encode_download_initiate_segmented};
use compensator_core::can::{Frame, Message, Node};
use compensator_core::{Flags, record};
use firmware::driver::{Boot, Driver, Identity, LoopReport};
use firmware::node::OUTBOX;
use firmware::node::dictionary::{LOAD, OBJECTS, SAVE, index};
use firmware::node_settings::{NodeSettings, Source};
use firmware::store::memory::{MemoryFlash, Torn};
use firmware::supervisor::{CanState, ResetCause};
use libfuzzer_sys::fuzz_target;

type Flash = MemoryFlash<4>;

const IDENTITY: Identity = Identity { hardware: "fuzz", serial: 1 };

/// Takes what is needed from the input; 0 behind its end.
struct Bytes<'a>(&'a [u8]);

impl Bytes<'_> {
    fn next(&mut self) -> Option<u8> {
        let (first, rest) = self.0.split_first()?;
        self.0 = rest;
        Some(*first)
    }

    fn byte(&mut self) -> u8 {
        self.next().unwrap_or(0)
    }

    fn word(&mut self) -> u32 {
        u32::from_le_bytes(std::array::from_fn(|_| self.byte()))
    }

    /// A number: any bits, or one of those that are near an edge.
    fn number(&mut self) -> f32 {
        const EDGES: [f32; 8] = [0.0, 1.0, -1.0, 0.1, f32::NAN, f32::INFINITY, 1e9, 1e-20];
        match self.byte() {
            kind @ 0..=7 => EDGES[usize::from(kind)],
            kind @ 8..=200 => (f32::from(kind) - 100.0) * 0.05,
            _ => f32::from_bits(self.word()),
        }
    }
}

struct World {
    driver: Driver<Flash>,
    settings: NodeSettings,
    now_us: u64,
    /// Number and CRC of the set that was last looked at; `None` after a start.
    set: Option<(u32, u32)>,
}

fn boot(settings: NodeSettings, flash: Flash, cause: ResetCause, now_us: u64) -> Driver<Flash> {
    Driver::boot(settings, flash, IDENTITY, &Boot { cause, ..Boot::default() }, now_us)
}

impl World {
    fn frame(&mut self, identifier: u16, data: &[u8]) {
        if let Some(frame) = Frame::new(identifier & Frame::LAST_IDENTIFIER, data) {
            self.driver.receive(&frame, self.now_us);
        }
    }

    /// A whole download, by a client that does not wait for answers; an outbox is drained as by a board.
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
        for (place, chunk) in value.chunks(7).enumerate() {
            let segment = encode_data_segment(chunk, place % 2 == 1, place + 1 == count);
            self.frame(0x600 + node, &segment.expect("seven bytes fit"));
            self.drain();
        }
    }

    fn drain(&mut self) {
        let node = u16::from(self.settings.node.number());
        let sent: Vec<Frame> = std::iter::from_fn(|| self.driver.transmit()).collect();
        assert!(sent.len() <= OUTBOX, "{} frames waited", sent.len());
        for frame in sent {
            let identifier = frame.identifier();
            let length = frame.data().len();
            let base = identifier.wrapping_sub(node);
            if !self.driver.has_own_identifiers() && !matches!(base, 0x080 | 0x580 | 0x700) {
                // A master gave them others, which may be anybody's.
                assert!((0x181..=0x57F).contains(&identifier) || (0x680..=0x6FF).contains(&identifier));
                continue;
            }
            match base {
                0x080 | 0x580 => assert_eq!(length, 8),
                0x700 => assert_eq!(length, 1),
                0x180 | 0x280 | 0x380 | 0x480 | 0x680 => self.process(&frame),
                _ => panic!("{identifier:03X} from node {node}"),
            }
        }
    }

    fn process(&self, frame: &Frame) {
        let message = Message::parse(frame).expect("a driver's frame is legal");
        assert_eq!(message.emit(), *frame);
        let limits = &self.driver.set().friction.compensator;
        if self.driver.source() == Source::Sensors {
            return;
        }
        match message {
            Message::Answer(_, answer) => {
                assert!(answer.friction_torque_nm.is_finite(), "{answer:?}");
                let most_a = limits.torque_limit_nm / limits.torque_constant_nm_per_a;
                // Half a step of fixed point, and a rounding.
                let most_a =
                    most_a.abs() * 1.000_01 + 2e-6 / limits.torque_constant_nm_per_a.min(1.0);
                assert!(
                    answer.feed_forward_current_a.abs() <= most_a,
                    "{answer:?} beyond {most_a}"
                );
            }
            Message::Status(_, status) => {
                assert_eq!(status.flags - Flags::all(), Flags::empty());
                assert!(!status.flags.contains(Flags::MODEL_NOT_FINITE), "{status:?}");
            }
            Message::Telemetry(_, telemetry) => {
                assert!(telemetry.current_a.abs() <= limits.current_limit_a * 1.000_01 + 2e-6);
            }
            _ => panic!("{message:?} of a fed joint"),
        }
    }

    fn check(&mut self) {
        let orders = self.driver.orders(self.now_us);
        let fed = self.driver.source() == Source::Bus;
        assert!(!(fed && (orders.bridge || orders.compensation)), "a fed joint drives nothing");
        assert!(!orders.compensation || orders.bridge, "compensation without a bridge");
        assert!(!orders.bridge || self.driver.is_armed(), "a bridge that is on unarmed");
        assert!((0.0..=1.0).contains(&orders.current_share), "{}", orders.current_share);
        // Looked at where it is another one: that costs more than all the rest.
        if self.set.is_none_or(|(number, _)| number != orders.set_number) {
            assert!(self.set.is_none() || !self.driver.is_armed(), "another set while armed");
            let set = self.driver.set();
            assert!(set.validate().is_ok(), "an active set that is not valid");
            self.set = Some((orders.set_number, set.crc()));
        }
    }

    /// The set is still the one that was looked at.
    fn check_set(&self) {
        let crc = self.set.map(|(_, crc)| crc);
        assert_eq!(crc, Some(self.driver.set().crc()), "a set that changed and was not counted");
    }

    fn restart(&mut self, cause: ResetCause) {
        let old = std::mem::replace(
            &mut self.driver,
            boot(self.settings, Flash::new(), ResetCause::PowerOn, self.now_us),
        );
        let mut flash = old.into_flash();
        flash.power_on();
        self.driver = boot(self.settings, flash, cause, self.now_us);
        self.set = None;
        self.learn_node();
    }

    /// Whatever number was stored is its number now: its first frame says so.
    fn learn_node(&mut self) {
        let first = self.driver.transmit().expect("it says that it is there");
        assert_eq!(first.identifier() & !0x7F, 0x700);
        self.settings.node = Node::new((first.identifier() & 0x7F) as u8).expect("a legal number");
        assert!(!self.driver.is_armed(), "armed at the start");
    }
}

fn step(world: &mut World, which: u8, bytes: &mut Bytes) {
    let node = u16::from(world.settings.node.number());
    match which % 16 {
        // What it listens to.
        0..=2 => {
            const OWN: [u16; 9] = [0x480, 0x680, 0x400, 0x300, 0x500, 0x600, 0x080, 0x000, 0x200];
            let kind = usize::from(bytes.byte() % 9);
            let identifier = OWN[kind] + if matches!(kind, 6 | 7) { 0 } else { node };
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
            world.frame(identifier, &data[..length]);
        }
        3 => {
            // A sample: motion and the SYNC that follows the last.
            let (velocity, counter) = (bytes.number(), bytes.byte() % 240 + 1);
            let mut data = [0; 8];
            data[..4].copy_from_slice(&velocity.to_le_bytes());
            data[4..].copy_from_slice(&bytes.number().to_le_bytes());
            world.frame(0x480 + node, &data);
            world.frame(0x080, &[counter]);
        }
        // Anything at all.
        4 => {
            let (identifier, length) = (bytes.word() as u16, bytes.byte() % 9);
            let data: Vec<u8> = (0..length).map(|_| bytes.byte()).collect();
            world.frame(identifier, &data);
        }
        // Objects it has, with the length they have.
        5..=7 => {
            let object = &OBJECTS[usize::from(bytes.byte()) % OBJECTS.len()];
            let place = (u16::from(bytes.byte()) % (u16::from(object.last()) + 1)) as u8;
            let length = object.entry(place).and_then(|entry| entry.data.length()).unwrap_or(4);
            let word = if bytes.byte() % 2 == 0 { bytes.number().to_bits() } else { bytes.word() };
            world.write(object.index, place, &word.to_le_bytes()[..length]);
        }
        8 => world.write(index::STATE, 1, &[bytes.byte() % 4]),
        9 => {
            let crc = world.driver.set().crc();
            match bytes.byte() % 7 {
                5 => {
                    let wiring = world.driver.set().wiring_crc();
                    world.write(index::COMMISSIONING, 3, &wiring.to_le_bytes());
                }
                0 => world.write(index::STORE, 1, &SAVE.to_le_bytes()),
                1 => world.write(index::RESTORE, 1, &LOAD.to_le_bytes()),
                2 => world.write(index::COMMIT, 4, &[1]),
                3 => world.write(index::COMMIT, 3, &crc.to_le_bytes()),
                // The CRC of what is staged, as a tool that asked for it.
                _ => {
                    let [low, high] = index::COMMIT.to_le_bytes();
                    world.drain();
                    world.frame(0x600 + node, &[0x40, low, high, 2, 0, 0, 0, 0]);
                    let answer = std::iter::from_fn(|| world.driver.transmit()).last();
                    if let Some(answer) = answer
                        && let [0x43, _, _, _, crc @ ..] = answer.data()
                    {
                        let crc = crc.to_vec();
                        world.write(index::COMMIT, 3, &crc);
                    }
                }
            }
        }
        10 => {
            // A whole model that is valid in itself, with one number changed.
            let mut friction = world.driver.set().friction.clone();
            let id = compensator_core::ParameterId::ALL[usize::from(bytes.byte()) % 41];
            friction.model.set(id, bytes.number());
            world.write(index::COMMIT, 5, &record::emit(&friction));
        }
        11 => world.frame(0x000, &[bytes.byte(), node as u8 * (bytes.byte() % 2)]),
        12 => {
            world.now_us += u64::from(bytes.byte()) * u64::from(bytes.byte()) * 50;
            world.driver.tick(world.now_us);
        }
        13 => {
            let report = LoopReport {
                bus_voltage_v: (bytes.byte() % 2 == 0).then(|| bytes.number() * 24.0),
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
                motor_temperature_c: (bytes.byte() % 2 == 0).then(|| bytes.number() * 50.0),
                sample_age_us: Some(bytes.word() % 4096),
                gate_driver_fault: bytes.byte() == 255,
                stack_intact: bytes.byte() != 255,
                overruns_in_a_row: u32::from(bytes.byte() % 8),
                ..LoopReport::default()
            };
            world.driver.report(&report);
        }
        14 => {
            let states = [CanState::Active, CanState::Active, CanState::Off];
            world.driver.bus_state(bytes.byte() == 0, states[usize::from(bytes.byte() % 3)]);
        }
        _ => match bytes.byte() % 8 {
            0 => world.restart(ResetCause::Watchdog),
            1 => {
                // Power goes while it saves.
                let flash = {
                    let fresh =
                        boot(world.settings, Flash::new(), ResetCause::PowerOn, world.now_us);
                    std::mem::replace(&mut world.driver, fresh).into_flash()
                };
                let mut cut = flash;
                cut.cut(usize::from(bytes.byte()) as _, Torn::Nothing);
                world.driver = boot(world.settings, cut, ResetCause::PowerOn, world.now_us);
                world.set = None;
                world.learn_node();
                world.write(index::STORE, 1, &SAVE.to_le_bytes());
                world.drain();
                world.restart(ResetCause::PowerOn);
            }
            _ => world.now_us += u64::from(bytes.byte()),
        },
    }
}

fuzz_target!(|data: &[u8]| {
    let mut bytes = Bytes(data);
    let source = if bytes.byte() % 2 == 0 { Source::Bus } else { Source::Sensors };
    let settings = NodeSettings { node: Node::FIRST, source, ..NodeSettings::default() };
    let driver = boot(settings, Flash::new(), ResetCause::PowerOn, 0);
    let mut world = World { driver, settings, now_us: 0, set: None };
    world.learn_node();
    world.check();
    while let Some(which) = bytes.next() {
        step(&mut world, which, &mut bytes);
        world.drain();
        if world.driver.reset_wanted() {
            world.restart(ResetCause::Software);
        }
        world.check();
    }
    world.check_set();
    world.restart(ResetCause::PowerOn);
    world.check();
});
