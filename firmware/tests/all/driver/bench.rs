//! A test bench for a driver: frames in, frames out, and a tool that reads and writes its objects.

use super::object_observer::ObjectObserver;
use canopen_rs::Address;
use canopen_rs::sdo::{
    decode_abort, decode_data_segment, decode_download_response, encode_data_segment,
    encode_download_initiate_segmented, encode_upload_request, encode_upload_segment_request,
};
use compensator_core::can::{Frame, Message, NodeId, SyncFrame};
use embedded_storage::nor_flash::NorFlash;
use firmware::access::Key;
use firmware::driver::{Boot, Driver, Identity};
use firmware::loop_parts::StageTraits;
use firmware::node::dictionary::index;
use firmware::node_settings::{InputSource, NodeSettings};
use firmware::refusal::Explained;
use firmware::store::memory::MemoryFlash;

pub type Flash = MemoryFlash<4>;

/// Abort code of a write that needs an unlock.
pub const LOCKED: u32 = 0x0601_0000;

pub const NODE: NodeId = NodeId::FIRST;

pub struct Bench<F: NorFlash = Flash> {
    pub driver: Driver<F>,
    pub now_us: u64,
    /// Node number of the joint.
    pub node: NodeId,
    /// Key with which a locked joint is unlocked when it refuses a write; `None` leaves it locked.
    pub key: Option<Key>,
    observer: ObjectObserver,
}

pub fn frame(identifier: u16, data: &[u8]) -> Frame {
    Frame::new(identifier, data).expect("a legal frame")
}

impl Bench {
    /// Starts a driver in HIL.
    pub fn hil() -> Self {
        Self::boot(InputSource::Bus, Flash::new(), &Boot::default())
    }

    /// Starts a driver on its own sensors.
    pub fn on_sensors() -> Self {
        Self::boot(InputSource::Sensors, Flash::new(), &Boot::default())
    }

    /// Starts a driver on its own sensors that has this node number.
    pub fn numbered(node: NodeId) -> Self {
        let settings =
            NodeSettings { node, source: InputSource::Sensors, ..NodeSettings::default() };
        let identity = Identity { hardware: "bench", serial: 7, stage: StageTraits::NONE };
        let driver = Driver::boot(settings, Flash::new(), identity, &Boot::default(), 0);
        Self { driver, node, ..Self::on_sensors() }
    }

    /// Starts a driver on its own sensors, with this power stage.
    pub fn on_stage(stage: StageTraits) -> Self {
        Self::boot_on(stage, InputSource::Sensors, Flash::new(), &Boot::default())
    }

    pub fn boot(source: InputSource, flash: Flash, boot: &Boot) -> Self {
        Self::boot_on(StageTraits::NONE, source, flash, boot)
    }

    /// Starts a joint without stored settings that has this serial number.
    pub fn blank(serial: u32) -> Self {
        let settings = NodeSettings { node: NODE, ..NodeSettings::default() };
        let identity = Identity { hardware: "bench", serial, stage: StageTraits::NONE };
        let driver = Driver::boot(settings, Flash::new(), identity, &Boot::default(), 0);
        Self {
            driver,
            now_us: 0,
            node: NODE,
            key: Some(Key::DEFAULT),
            observer: ObjectObserver::default(),
        }
    }
}

impl<F: NorFlash> Bench<F> {
    /// Starts a driver with this power stage and flash.
    pub fn boot_on(stage: StageTraits, source: InputSource, flash: F, boot: &Boot) -> Self {
        let settings = NodeSettings { node: NODE, source, ..NodeSettings::default() };
        let identity = Identity { hardware: "bench", serial: 7, stage };
        let driver = Driver::boot(settings, flash, identity, boot, 0);
        Self {
            driver,
            now_us: 0,
            node: NODE,
            key: Some(Key::DEFAULT),
            observer: ObjectObserver::default(),
        }
    }

    /// Returns all frames that the driver sends.
    pub fn sent(&mut self) -> Vec<Frame> {
        std::iter::from_fn(|| self.driver.transmit()).collect()
    }

    /// Returns all sent frames that are messages of a joint.
    pub fn messages(&mut self) -> Vec<Message> {
        self.sent().iter().filter_map(|frame| Message::parse(frame).ok()).collect()
    }

    pub fn give(&mut self, message: Message) {
        self.driver.receive(&message.emit(), self.now_us);
    }

    /// Gives ten SYNCs. The joint sends all its frames at the last one.
    pub fn give_ten_syncs(&mut self) {
        for counter in 1..=10 {
            self.sent();
            self.give(Message::Sync(SyncFrame { counter }));
        }
    }

    /// Advances the time with a tick per millisecond.
    pub fn pass_ms(&mut self, milliseconds: u64) {
        for _ in 0..milliseconds {
            self.now_us += 1000;
            self.driver.tick(self.now_us);
        }
    }

    /// Sets the network state to operational.
    pub fn start(&mut self) {
        self.driver.receive(&frame(0, &[1, self.node.number()]), self.now_us);
    }

    /// Confirms that the joint is wired as its parameters say.
    pub fn commission(&mut self) {
        let wiring = self.number(index::COMMISSIONING, 2);
        self.write(index::COMMISSIONING, 3, &wiring.to_le_bytes()).expect("it is in use");
    }

    /// Sends a request of a transfer, and returns its answer, or the abort code.
    pub fn exchange(&mut self, request: [u8; 8]) -> Result<[u8; 8], u32> {
        let request = self.observer.request(request);
        let node = u16::from(self.node.number());
        self.driver.receive(&frame(0x600 + node, &request), self.now_us);
        let answers: Vec<Frame> =
            self.sent().into_iter().filter(|frame| frame.identifier() == 0x580 + node).collect();
        let [answer] = answers[..] else { panic!("{} answers", answers.len()) };
        let data = answer.data().try_into().expect("eight bytes");
        match decode_abort(&data) {
            Ok((_, code)) => Err(code),
            Err(_) => Ok(self.observer.answer(data)),
        }
    }

    /// Reads an object, or returns the abort code.
    pub fn read(&mut self, index: u16, sub_index: u8) -> Result<Vec<u8>, u32> {
        let answer = self.exchange(encode_upload_request(Address::new(index, sub_index)))?;
        if answer[0] & 2 != 0 {
            return Ok(answer[4..8 - usize::from(answer[0] >> 2 & 3)].to_vec());
        }
        let (mut value, mut toggle) = (Vec::new(), false);
        loop {
            let answer = self.exchange(encode_upload_segment_request(toggle))?;
            let segment = decode_data_segment(&answer).expect("a segment");
            value.extend_from_slice(segment.data);
            if segment.last {
                return Ok(value);
            }
            toggle = !toggle;
        }
    }

    /// Reads a number.
    pub fn number(&mut self, index: u16, sub_index: u8) -> u32 {
        let value = self.read(index, sub_index).expect("can be read");
        value.iter().rev().fold(0, |number, byte| number << 8 | u32::from(*byte))
    }

    /// Reads a text.
    pub fn text(&mut self, at_index: u16) -> String {
        if at_index == index::REFUSAL {
            let bytes = self.read(at_index, 0).expect("can be read");
            return Explained::parse(&bytes).map(|reason| reason.to_string()).unwrap_or_default();
        }
        String::from_utf8(self.read(at_index, 0).expect("can be read")).expect("text")
    }

    /// Requires that the last refusal contains the names and figures `parts`, and compares its words.
    #[track_caller]
    pub fn check_refusal(&mut self, section: &str, parts: &[&str]) {
        crate::message::check("refusals", section, &self.text(index::REFUSAL), parts);
    }

    /// Writes an object, or returns the abort code. A locked joint is unlocked with the bench's key.
    pub fn write(&mut self, index: u16, sub_index: u8, value: &[u8]) -> Result<(), u32> {
        match (self.write_once(index, sub_index, value), self.key) {
            (Err(LOCKED), Some(key)) => {
                self.unlock(&key)?;
                self.write_once(index, sub_index, value)
            }
            (written, _) => written,
        }
    }

    /// Answers a challenge of the joint.
    pub fn unlock(&mut self, key: &Key) -> Result<(), u32> {
        let response = self.response(key);
        self.write_once(index::ACCESS, 3, &response)
    }

    /// Reads a challenge, and returns the response to it.
    pub fn response(&mut self, key: &Key) -> [u8; 8] {
        self.proof(key, &[])
    }

    /// Reads a challenge, and returns the proof of a new key or policy.
    pub fn proof(&mut self, key: &Key, change: &[u8]) -> [u8; 8] {
        let challenge = self.read(index::ACCESS, 2).expect("can be read");
        let serial = self.number(index::IDENTITY, 4);
        key.proof(challenge.try_into().expect("eight bytes"), serial, self.node.number(), change)
    }

    /// Writes a new key or policy with its proof. A locked joint is unlocked with the same key before.
    pub fn write_proven(&mut self, sub_index: u8, change: &[u8], key: &Key) -> Result<(), u32> {
        if self.number(index::ACCESS, 1) == 0 {
            self.unlock(key)?;
        }
        let proof = self.proof(key, change);
        self.write_once(index::ACCESS, sub_index, &[change, &proof].concat())
    }

    fn write_once(&mut self, index: u16, sub_index: u8, value: &[u8]) -> Result<(), u32> {
        let at = Address::new(index, sub_index);
        if value.len() <= 4 {
            let mut request = [0x23 | ((4 - value.len()) as u8) << 2, 0, 0, sub_index, 0, 0, 0, 0];
            request[1..3].copy_from_slice(&index.to_le_bytes());
            request[4..4 + value.len()].copy_from_slice(value);
            let answer = self.exchange(request)?;
            decode_download_response(&answer).expect("done");
            return Ok(());
        }
        self.exchange(encode_download_initiate_segmented(at, value.len() as u32))?;
        let count = value.chunks(7).count();
        for (place, chunk) in value.chunks(7).enumerate() {
            let last = place + 1 == count;
            self.exchange(encode_data_segment(chunk, place % 2 == 1, last).expect("fits"))?;
        }
        Ok(())
    }
}
