//! Fuzzes the dry side of a joint: the sensor in its housing, and what the driver makes of leak probe, air and safe torque off.
//!
//! The sensor is a register file with any calibration constants. Between its transfers it loses power, leaves the bus, or
//! is another device. Every state of the air that the driver of the sensor returns must be that of an undisturbed sensor,
//! and it must return one again 3 s after the last disturbance.
//!
//! The joint is armed and gets these readings, and any others. Safe torque off must open its bridge at once, a leak that
//! stops after 200 ms, everything else never. The limits follow their readings within their times, and 2012h holds them.

use crate::bytes::Bytes;
use compensator_core::can::{CommandFrame, Frame, Message, NodeId};
use embedded_hal::i2c::{ErrorKind, ErrorType, I2c, Operation};
use firmware::access::AccessSettings;
use firmware::background::BoardState;
use firmware::driver::{Boot, Driver, Identity, LoopReport};
use firmware::joint_node::Joint as _;
use firmware::loop_parts::StageTraits;
use firmware::node::dictionary::index;
use firmware::node_settings::{InputSource, NodeSettings};
use firmware::sensors::SensorParameters;
use firmware::sensors::bme280::{Air, Bme280};
use firmware::sensors::enclosure::{LastAir, Readings};
use firmware::sensors::ms5837::SensorBus;
use firmware::store::memory::MemoryFlash;
use firmware::supervisor::Code;

/// Time of one execution, ms.
const LONGEST_MS: u64 = 12_000;

/// Time between two ticks while readings are held for long, ms; otherwise 1 ms.
const COARSE_MS: u64 = 10;

impl Bytes<'_> {
    /// Returns a share of 0 to 1, or NaN.
    fn share(&mut self) -> f32 {
        match self.byte() {
            255 => f32::NAN,
            byte => f32::from(byte) / 254.0,
        }
    }
}

/// A BME280: what it would measure, and its registers.
#[derive(Clone)]
struct Sensor {
    registers: [u8; 256],
    raw: [u8; 8],
    is_gone: bool,
    is_other: bool,
    transfers: usize,
}

impl Sensor {
    const IDENTITY: usize = 0xD0;
    const DATA: usize = 0xF7;
    const HUMIDITY_CONTROL: usize = 0xF2;

    /// Creates a sensor with calibration constants and raw values of the input.
    fn new(bytes: &mut Bytes) -> Self {
        let mut registers = [0; 256];
        for register in (0x88..0xA2).chain(0xE1..0xE8) {
            registers[register] = bytes.byte();
        }
        let raw = std::array::from_fn(|_| bytes.byte());
        let mut sensor = Self { registers, raw, is_gone: false, is_other: false, transfers: 0 };
        sensor.reset();
        sensor
    }

    /// Resets the control and data registers, as a loss of power does.
    fn reset(&mut self) {
        self.registers[Self::IDENTITY] = 0x60;
        self.registers[0xF2..0xF7].fill(0);
        self.registers[Self::DATA..].copy_from_slice(&[0x80, 0, 0, 0x80, 0, 0, 0x80, 0, 0]);
    }

    fn write(&mut self, register: usize, word: u8) {
        self.registers[register] = word;
        match register {
            0xE0 if word == 0xB6 => self.reset(),
            0xF4 if word & 3 == 1 => {
                // Data sheet, 5.4.3 to 5.4.5: a quantity that is not sampled has its reset value.
                let is_sampled = |samples: u8| samples & 7 != 0;
                let [p, t] = [word >> 2, word >> 5];
                let humidity = self.registers[Self::HUMIDITY_CONTROL];
                let data = &mut self.registers[Self::DATA..Self::DATA + 8];
                data.copy_from_slice(&[0x80, 0, 0, 0x80, 0, 0, 0x80, 0]);
                for (range, samples) in [(0..3, p), (3..6, t), (6..8, humidity)] {
                    if is_sampled(samples) {
                        data[range.clone()].copy_from_slice(&self.raw[range]);
                    }
                }
            }
            _ => {}
        }
    }
}

impl ErrorType for Sensor {
    type Error = ErrorKind;
}

impl I2c for Sensor {
    fn transaction(&mut self, address: u8, steps: &mut [Operation<'_>]) -> Result<(), ErrorKind> {
        assert_eq!(address, 0x77);
        self.transfers += 1;
        if self.is_gone {
            return Err(ErrorKind::Other);
        }
        let mut at = 0;
        for step in steps {
            match step {
                Operation::Write([register]) => at = usize::from(*register),
                Operation::Write([register, word]) => self.write(usize::from(*register), *word),
                Operation::Write(other) => panic!("{} bytes written", other.len()),
                Operation::Read(into) => {
                    into.copy_from_slice(&self.registers[at..at + into.len()]);
                    if self.is_other && at == Self::IDENTITY {
                        into[0] = 0x58;
                    }
                }
            }
        }
        Ok(())
    }
}

impl SensorBus for Sensor {
    fn recover(&mut self) {}
}

/// The sensor, its driver, and the time since the last disturbance.
struct Housing {
    sensor: Sensor,
    driver: Bme280,
    last: LastAir,
    /// What an undisturbed sensor of this kind measures; `None` if its calibration or its raw values are refused.
    expected: Option<Air>,
    undisturbed_ms: u64,
}

impl Housing {
    fn new(bytes: &mut Bytes) -> Self {
        let sensor = Sensor::new(bytes);
        let (mut undisturbed, mut driver) = (sensor.clone(), Bme280::new());
        let mut measured =
            (0..100).filter_map(|ms| driver.poll(&mut undisturbed, 1000 * ms).ok().flatten());
        let expected = measured.next();
        if let Some(air) = expected {
            assert!((0.0..=100.0).contains(&air.humidity_percent), "{air:?}");
            assert!(air.pressure_pa.is_finite() && air.temperature_c.is_finite(), "{air:?}");
        }
        Self { sensor, driver: Bme280::new(), last: LastAir::NONE, expected, undisturbed_ms: 0 }
    }

    fn disturb(&mut self, kind: u8) {
        self.undisturbed_ms = 0;
        match kind % 4 {
            0 => self.sensor.reset(),
            1 => self.sensor.is_gone = !self.sensor.is_gone,
            2 => self.sensor.is_other = !self.sensor.is_other,
            _ => (self.sensor.is_gone, self.sensor.is_other) = (false, false),
        }
    }

    fn poll(&mut self, now_us: u64, passed_ms: u64) {
        let before = self.sensor.transfers;
        if let Ok(Some(air)) = self.driver.poll(&mut self.sensor, now_us) {
            assert_eq!(Some(air), self.expected, "after {} ms", self.undisturbed_ms);
            self.last.set(air, now_us);
        }
        assert!(self.sensor.transfers - before <= 1, "one transfer in a poll");
        self.undisturbed_ms += passed_ms;
        if !self.sensor.is_gone
            && !self.sensor.is_other
            && self.undisturbed_ms > 3000
            && let Some(expected) = self.expected
        {
            assert_eq!(self.last.get(now_us), expected);
        }
    }
}

/// Whether a cause is present, and the time since the tick that first observed this, ms.
#[derive(Default)]
struct Since {
    is_present: bool,
    ms: u64,
}

impl Since {
    fn pass(&mut self, is_present: bool, passed_ms: u64) {
        self.ms = if is_present == self.is_present { self.ms + passed_ms } else { 0 };
        self.is_present = is_present;
    }

    fn is_present_for(&self, ms: u64) -> bool {
        self.is_present && self.ms > ms
    }

    fn is_absent_for(&self, ms: u64) -> bool {
        !self.is_present && self.ms > ms
    }
}

/// A code of the dry side.
struct DryCode {
    code: Code,
    /// Time of its cause after which it comes, ms.
    comes_ms: u64,
    /// Time without its cause after which it goes, ms.
    goes_ms: u64,
}

const fn dry(code: Code, comes_ms: u64, goes_ms: u64) -> DryCode {
    DryCode { code, comes_ms, goes_ms }
}

/// The codes of the dry side.
const CODES: [DryCode; 7] = [
    dry(Code::TorqueOff, 0, 100),
    dry(Code::TorqueOffChannels, 100, 100),
    dry(Code::Leak, 200, 1000),
    dry(Code::LeakReported, 200, 1000),
    dry(Code::HousingHumid, 3000, 3000),
    dry(Code::HousingPressure, 3000, 3000),
    dry(Code::EnclosureUnknown, 1000, 1000),
];

/// Returns which codes these readings are a cause of, in the order of [`CODES`].
fn causes(readings: &Readings, sensors: &SensorParameters) -> [bool; CODES.len()] {
    let leaks = sensors.leak_connected != 0.0;
    let share = readings.leak_share.unwrap_or(f32::NAN);
    let is_wet = leaks && share < sensors.leak_wet_share;
    let is_open = leaks && (share.is_nan() || share >= sensors.leak_open_share);
    let breathes = sensors.air_connected != 0.0;
    let air = readings.air.unwrap_or(Air::INVALID);
    let (low, high) = (sensors.housing_pressure_min_pa, sensors.housing_pressure_max_pa);
    let is_outside = air.pressure_pa < low || air.pressure_pa > high;
    let is_unknown = !air.pressure_pa.is_finite() || !air.humidity_percent.is_finite();
    let watches = sensors.sto_connected != 0.0;
    let [first, second] = readings.torque_allowed.unwrap_or_default();
    [
        watches && !(first && second),
        watches && first != second,
        is_wet && sensors.leak_stops != 0.0,
        is_wet && sensors.leak_stops == 0.0,
        breathes && air.humidity_percent >= sensors.humidity_max_percent,
        breathes && is_outside,
        is_open || breathes && is_unknown,
    ]
}

struct Joint {
    driver: Driver<MemoryFlash<4>>,
    now_us: u64,
    counter: u8,
    readings: Readings,
    since: [Since; CODES.len()],
}

impl Joint {
    fn new(bytes: &mut Bytes) -> Self {
        let source = InputSource::Sensors;
        // The switches are of the service level.
        let access = AccessSettings { is_locked: false, ..AccessSettings::default() };
        let settings =
            NodeSettings { node: NodeId::FIRST, source, access, ..NodeSettings::default() };
        let identity = Identity { hardware: "fuzz", serial: 1, stage: StageTraits::NONE };
        let driver = Driver::boot(settings, MemoryFlash::new(), identity, &Boot::default(), 0);
        let (readings, since) = (Readings::default(), std::array::from_fn(|_| Since::default()));
        let mut joint = Self { driver, now_us: 0, counter: 0, readings, since };
        joint.frame(0, &[1, 1]);
        let connected = bytes.byte();
        let switches = ["leak_connected", "air_connected", "sto_connected", "leak_stops"];
        for (bit, name) in switches.into_iter().enumerate() {
            let place = SensorParameters::NAMES.iter().position(|found| *found == name);
            let value = f32::from(connected >> bit & 1);
            let place = place.expect("it has this parameter") as u8;
            joint.write(index::SENSORS, place + 1, &value.to_le_bytes());
        }
        let staged = joint.read(index::COMMIT, 2);
        joint.write(index::COMMIT, 3, &staged);
        let wiring = joint.read(index::COMMISSIONING, 2);
        joint.write(index::COMMISSIONING, 3, &wiring);
        assert_eq!(joint.driver.joint.set().sensors.leak_connected, f32::from(connected & 1));
        joint
    }

    fn frame(&mut self, identifier: u16, data: &[u8]) -> Option<[u8; 8]> {
        self.driver.receive(&Frame::new(identifier, data).expect("legal"), self.now_us);
        std::iter::from_fn(|| self.driver.transmit())
            .filter(|frame| frame.identifier() == 0x581)
            .last()
            .and_then(|frame| frame.data().try_into().ok())
    }

    fn write(&mut self, at: u16, sub_index: u8, value: &[u8]) -> bool {
        let [low, high] = at.to_le_bytes();
        let mut request = [0x23 | (4 - value.len() as u8) << 2, low, high, sub_index, 0, 0, 0, 0];
        request[4..4 + value.len()].copy_from_slice(value);
        self.frame(0x601, &request).expect("an answer")[0] == 0x60
    }

    fn read(&mut self, at: u16, sub_index: u8) -> [u8; 4] {
        let [low, high] = at.to_le_bytes();
        let answer = self.frame(0x601, &[0x40, low, high, sub_index, 0, 0, 0, 0]);
        let [command, _, _, _, data @ ..] = answer.expect("an answer");
        assert_ne!(command, 0x80, "{at:04X}h:{sub_index}");
        data
    }

    /// Passes some time: a report of the loop, a command, the readings, a tick, and its invariants.
    fn pass(&mut self, passed_ms: u64) {
        self.now_us += 1000 * passed_ms;
        self.counter = self.counter.wrapping_add(1);
        self.driver.joint.report(&LoopReport {
            bus_voltage_v: Some(48.0),
            phase_currents_a: Some([0.0; 3]),
            bridge_temperature_c: Some(30.0),
            motor_temperature_c: Some(30.0),
            sample_age_us: Some(10),
            velocity_rad_s: 1.5,
            position_rad: 0.25,
            stack_intact: true,
            ..LoopReport::default()
        });
        let command = CommandFrame::new(0.0, 0.0, self.counter);
        let command = Message::Command(NodeId::FIRST, command).emit();
        self.driver.receive(&command, self.now_us);
        let was_armed = self.driver.joint.is_armed();
        self.driver
            .joint
            .take_board_state(&BoardState { enclosure: self.readings, ..BoardState::default() });
        self.driver.tick(self.now_us);
        while self.driver.transmit().is_some() {}
        let causes = causes(&self.readings, &self.driver.joint.set().sensors);
        for (since, is_present) in self.since.iter_mut().zip(causes) {
            since.pass(is_present, passed_ms);
        }
        self.check(was_armed, passed_ms);
    }

    fn check(&self, was_armed: bool, passed_ms: u64) {
        let late_ms = 2 * passed_ms;
        let supervisor = self.driver.joint.supervisor();
        for (DryCode { code, comes_ms, goes_ms }, since) in CODES.iter().zip(&self.since) {
            if matches!(code, Code::TorqueOff | Code::Leak) {
                // A fault is kept until it is cleared, and does not come while the joint is safe.
                let stops = since.is_present_for(comes_ms + late_ms);
                assert!(!(stops && self.driver.joint.is_armed()), "armed in spite of {code:?}");
                continue;
            }
            let is_limited = supervisor.limits().contains(*code);
            assert!(is_limited || !since.is_present_for(comes_ms + late_ms), "{code:?} is missing");
            assert!(!is_limited || !since.is_absent_for(goes_ms + late_ms), "{code:?} stays");
        }
        let [torque_off, _, leak, ..] = &self.since;
        if was_armed && !torque_off.is_present && !leak.is_present {
            assert!(self.driver.joint.is_armed(), "{:?} disarms", self.readings);
        }
        let commands = self.driver.joint.loop_commands(self.now_us);
        assert!(
            !commands.bridge || !torque_off.is_present_for(late_ms),
            "bridge in spite of torque off"
        );
    }

    /// Checks that 2012h holds the readings.
    fn check_object(&mut self) {
        self.driver
            .joint
            .take_board_state(&BoardState { enclosure: self.readings, ..BoardState::default() });
        let Readings { leak_share, air, torque_allowed } = self.readings;
        let air = air.unwrap_or(Air::INVALID);
        let numbers = [
            leak_share.unwrap_or(f32::NAN),
            air.humidity_percent,
            air.pressure_pa,
            air.temperature_c,
        ];
        for (place, number) in numbers.into_iter().enumerate() {
            assert_eq!(self.read(index::ENCLOSURE, place as u8 + 1), number.to_le_bytes());
        }
        let [first, second] = torque_allowed.unwrap_or_default();
        let bits = u8::from(first) | u8::from(second) << 1;
        assert_eq!(self.read(index::ENCLOSURE, 5)[0], bits);
    }
}

/// Sets a reading from the input.
fn set_reading(readings: &mut Readings, bytes: &mut Bytes) {
    match bytes.byte() % 4 {
        0 => readings.leak_share = (bytes.byte() != 0).then(|| bytes.share()),
        1 => {
            let bits = bytes.byte();
            readings.torque_allowed = (bits & 4 == 0).then_some([bits & 1 == 0, bits & 2 == 0]);
        }
        2 => readings.air = None,
        _ => {
            readings.air = Some(Air {
                pressure_pa: 2e5 * bytes.share(),
                temperature_c: 20.0,
                humidity_percent: 100.0 * bytes.share(),
            });
        }
    }
}

/// Executes the target on an input.
pub fn run(data: &[u8]) {
    let mut bytes = Bytes(data);
    let mut joint = Joint::new(&mut bytes);
    let mut housing = Housing::new(&mut bytes);
    let mut measures_air = true;
    while let Some(selector) = bytes.next()
        && joint.now_us < 1000 * LONGEST_MS
    {
        match selector % 6 {
            0 => {
                set_reading(&mut joint.readings, &mut bytes);
                measures_air = false;
            }
            1 => measures_air = true,
            2 => housing.disturb(bytes.byte()),
            3 => {
                joint.write(index::STATE, 1, &[2]);
                joint.write(index::STATE, 1, &[1]);
            }
            4 => joint.check_object(),
            _ => {
                let time_ms = u64::from(bytes.byte()) * u64::from(selector / 16);
                let passed_ms = if time_ms > 200 { COARSE_MS } else { 1 };
                for _ in 0..=time_ms / passed_ms {
                    housing.poll(joint.now_us, passed_ms);
                    if measures_air {
                        joint.readings.air = Some(housing.last.get(joint.now_us));
                    }
                    joint.pass(passed_ms);
                }
            }
        }
    }
}
