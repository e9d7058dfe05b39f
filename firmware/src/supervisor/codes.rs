//! The table of all faults and limits of the joint driver.
//!
//! Documentation, the EDS and emergency frames are generated from the table at the end of this file. Each
//! row has:
//!
//! - its number, in byte 3 of an emergency frame and as a bit (counted from 1) in the code sets on the bus.
//!   Faults are 1 to 32, limits 33 to 64. A number is never reused;
//! - its emergency error code and the bits it sets in the error register (CiA 301 7.2.7.1 and object
//!   0x1001). Drive codes follow IEC 61800-7-201, the others are device specific;
//! - its effect, when it is monitored, how long its cause must last and be gone;
//! - what raises it and what clears it.

use core::fmt;

/// Bits of the error register, object 0x1001.
pub mod register {
    /// Set with every code.
    pub const GENERIC: u8 = 1 << 0;
    /// Current.
    pub const CURRENT: u8 = 1 << 1;
    /// Voltage.
    pub const VOLTAGE: u8 = 1 << 2;
    /// Temperature.
    pub const TEMPERATURE: u8 = 1 << 3;
    /// Communication.
    pub const COMMUNICATION: u8 = 1 << 4;
    /// Device profile: encoder, motor and model.
    pub const PROFILE: u8 = 1 << 5;
    /// Manufacturer specific: the firmware.
    pub const MANUFACTURER: u8 = 1 << 7;
}

/// Effect of a code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effect {
    /// A fault: it opens the bridge and stays latched until it is cleared.
    Stops,
    /// A limit that disables the compensation while it is active.
    DropsCompensation,
    /// A limit without further effect.
    Limits,
}

/// When the cause of a fault is monitored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Watched {
    /// At any time.
    Always,
    /// While the joint is armed. Otherwise the cause only prevents arming.
    Armed,
}

/// One row of the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CodeInfo {
    /// Number of the code: 1..=32 for faults, 33..=64 for limits.
    pub number: u8,
    /// Name of the code. A board has none: it sends the number.
    #[cfg(not(target_os = "none"))]
    pub name: &'static str,
    /// Emergency error code.
    pub emergency: u16,
    /// Bits that the code sets in the error register.
    pub register: u8,
    /// Effect of the code.
    pub effect: Effect,
    /// When the code is monitored.
    pub watched: Watched,
    /// Time the cause must last before the code is raised, us.
    pub raise_after_us: u32,
    /// Time the cause must be gone before it counts as gone, us.
    pub clear_after_us: u32,
}

/// Explanation of one code, for tools. It is separate from [`CodeInfo`], so that the texts are not in a
/// driver's image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CodeDescription {
    /// Condition that raises the code.
    pub raised_by: &'static str,
    /// Condition that ends the cause.
    pub cleared_by: &'static str,
}

/// A set of codes.
#[derive(Clone, Copy, Default, PartialEq, Eq)]
pub struct CodeSet(u64);

impl CodeSet {
    /// The empty set.
    pub const EMPTY: Self = Self(0);

    /// Returns the set of these codes.
    pub const fn of(codes: &[Code]) -> Self {
        let mut set = Self::EMPTY;
        let mut index = 0;
        while index < codes.len() {
            set.insert(codes[index]);
            index += 1;
        }
        set
    }

    const fn bit(code: Code) -> u64 {
        1 << (code as u8 - 1)
    }

    /// Returns true if the set contains the code.
    #[inline]
    pub const fn contains(self, code: Code) -> bool {
        self.0 & Self::bit(code) != 0
    }

    /// Adds a code.
    pub const fn insert(&mut self, code: Code) {
        self.0 |= Self::bit(code);
    }

    /// Removes a code.
    pub const fn remove(&mut self, code: Code) {
        self.0 &= !Self::bit(code);
    }

    /// Returns true if the set is empty.
    #[inline]
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Returns true if the two sets share a code.
    #[inline]
    pub const fn intersects(self, other: Self) -> bool {
        self.0 & other.0 != 0
    }

    /// Returns the codes of both sets.
    pub const fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Returns the codes that are not in `other`.
    pub const fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }

    /// Returns the faults as sent on the bus: bit 0 is number 1.
    pub const fn fault_bits(self) -> u32 {
        self.0 as u32
    }

    /// Returns the limits as sent on the bus: bit 0 is number 33.
    pub const fn limit_bits(self) -> u32 {
        (self.0 >> 32) as u32
    }

    /// Returns the codes in ascending order of their numbers.
    pub fn iter(self) -> impl Iterator<Item = Code> {
        Code::ALL.iter().copied().filter(move |code| self.contains(*code))
    }

    /// Returns the error register for this set.
    pub fn error_register(self) -> u8 {
        self.iter().fold(0, |register, code| register | code.info().register)
    }
}

impl fmt::Debug for CodeSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_set().entries(self.iter()).finish()
    }
}

/// Converts a delay of the table from ms to us.
const fn ms(milliseconds: u32) -> u32 {
    milliseconds * 1000
}

macro_rules! codes {
    ($(
        $number:literal $code:ident $name:literal $emergency:literal [$($bit:ident)?]
        $effect:ident $watched:ident $raise:literal $clear:literal
        $raised_by:literal, $cleared_by:literal;
    )*) => {
        /// A fault or a limit.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[repr(u8)]
        pub enum Code {
            $(#[doc = concat!("`", $name, "`: ", $raised_by, ".")] $code = $number,)*
        }

        /// Number of codes.
        pub const CODE_COUNT: usize = [$($number),*].len();

        impl Code {
            /// All codes, in ascending order of their numbers.
            pub const ALL: &'static [Code; CODE_COUNT] = &[$(Code::$code),*];

            /// Returns the row of the table.
            pub const fn info(self) -> &'static CodeInfo {
                match self {
                    $(Code::$code => const { &CodeInfo {
                        number: $number,
                        #[cfg(not(target_os = "none"))]
                        name: $name,
                        emergency: $emergency,
                        register: register::GENERIC $(| register::$bit)?,
                        effect: Effect::$effect,
                        watched: Watched::$watched,
                        raise_after_us: ms($raise),
                        clear_after_us: ms($clear),
                    } },)*
                }
            }

            /// Returns the explanation of the code.
            pub const fn description(self) -> CodeDescription {
                match self {
                    $(Code::$code => CodeDescription { raised_by: $raised_by, cleared_by: $cleared_by },)*
                }
            }
        }
    };
}

impl Code {
    /// Returns the number of the code.
    pub const fn number(self) -> u8 {
        self as u8
    }

    /// Returns the code with this number.
    pub fn from_number(number: u8) -> Option<Self> {
        Self::ALL.iter().copied().find(|code| code.number() == number)
    }

    /// Returns the position of the code in [`Code::ALL`].
    pub(super) const fn index(self) -> usize {
        let mut index = 0;
        while index < CODE_COUNT {
            if Self::ALL[index] as u8 == self as u8 {
                return index;
            }
            index += 1;
        }
        // Unreachable: the list holds every code.
        CODE_COUNT
    }
}

/// Returns all codes with an effect.
const fn with_effect(effect: Effect) -> CodeSet {
    let mut set = CodeSet::EMPTY;
    let mut index = 0;
    while index < CODE_COUNT {
        let code = Code::ALL[index];
        if code.info().effect as u8 == effect as u8 {
            set.insert(code);
        }
        index += 1;
    }
    set
}

/// All faults.
pub const FAULT_CODES: CodeSet = with_effect(Effect::Stops);

/// Faults of the bridge, its shunts and its supply. The low sides are not shorted after them.
pub const BRIDGE_FAULT_CODES: CodeSet = CodeSet::of(&[
    Code::Overcurrent,
    Code::CurrentSensorInvalid,
    Code::CurrentOffset,
    Code::PhaseLost,
    Code::BusUndervoltage,
    Code::GateDriverFault,
    Code::BridgeOvertemperature,
    Code::AdcTimeout,
    Code::SelfTestFailed,
    Code::Internal,
    Code::SystemBreak,
    Code::TorqueOff,
]);

/// All limits that disable the compensation.
pub const COMPENSATION_DROPPING_CODES: CodeSet = with_effect(Effect::DropsCompensation);

// Columns: number, code, name, emergency code, bit of the error register, effect, when monitored, time the
// cause must last and time it must be gone (ms), what raises the code, what ends its cause.
codes! {
    1 CommandTimeout "command-timeout" 0x8250 [COMMUNICATION] Stops Armed 0 0
        "no set-point for `command_timeout_us`", "a set-point";
    2 HeartbeatLost "heartbeat-lost" 0x8130 [COMMUNICATION] Stops Armed 0 0
        "the monitored heartbeat is missing", "the heartbeat returns";
    3 CanBusOff "can-bus-off" 0x8140 [COMMUNICATION] Stops Always 0 100
        "the CAN controller has left the bus", "it is back on the bus";
    4 Overcurrent "overcurrent" 0x2310 [CURRENT] Stops Always 0 10
        "a phase current reaches `overcurrent_a` in any period, or the board's comparators open the bridge", "all phase currents are below it";
    5 CurrentSensorInvalid "current-sensor-invalid" 0x5210 [CURRENT] Stops Always 1 100
        "a phase current is invalid or not finite", "the phase currents are valid";
    6 CurrentOffset "current-offset" 0x5211 [CURRENT] Stops Always 50 100
        "with the bridge off, a phase current reaches `current_offset_a`", "with the bridge off, all phase currents are below half of it";
    7 PhaseLost "phase-lost" 0x7122 [PROFILE] Stops Armed 20 0
        "of a set-point of at least `phase_check_a`, half or more is not reached, and one phase is below `phase_dead_a`",
        "the bridge is off (arming checks again)";
    8 BusOvervoltage "bus-overvoltage" 0x3210 [VOLTAGE] Stops Always 0 100
        "the bus voltage reaches `bus_overvoltage_v`", "the bus voltage is at most `bus_overvoltage_clear_v`";
    9 BusUndervoltage "bus-undervoltage" 0x3220 [VOLTAGE] Stops Armed 2 100
        "the bus voltage falls to `bus_undervoltage_v`", "the bus voltage is at least `bus_undervoltage_clear_v`";
    10 GateDriverFault "gate-driver-fault" 0x5410 [] Stops Always 0 10
        "the gate driver reports a fault", "it reports none";
    11 BridgeOvertemperature "bridge-overtemperature" 0x4210 [TEMPERATURE] Stops Always 100 1000
        "the bridge temperature reaches `bridge_trip_c`", "it is `temperature_hysteresis_c` below that";
    12 MotorOvertemperature "motor-overtemperature" 0x4310 [TEMPERATURE] Stops Always 100 1000
        "the motor temperature reaches `motor_trip_c`", "it is `temperature_hysteresis_c` below that";
    13 EncoderLost "encoder-lost" 0x7305 [PROFILE] Stops Armed 0 100
        "no angle is known: the observer has coasted for too long, or the samples do not change although the rotor turns", "the observer has settled";
    14 EncoderJump "encoder-jump" 0x7300 [PROFILE] Stops Armed 2 100
        "the encoder repeatedly jumps farther than the shaft can turn", "it does not";
    15 AdcTimeout "adc-timeout" 0x5212 [] Stops Always 0 100
        "no conversion for `sample_timeout_us`, or no valid bus voltage", "conversions arrive";
    16 Overspeed "overspeed" 0x8400 [PROFILE] Stops Always 5 100
        "the joint speed reaches `overspeed_rad_s`", "the joint speed is at most 90 % of it";
    17 LoopOverrun "loop-overrun" 0x6110 [MANUFACTURER] Stops Always 0 0
        "the loop exceeded its period `overruns_in_a_row` times in a row", "a period without an overrun";
    18 ModelNotFinite "model-not-finite" 0x6103 [MANUFACTURER] Stops Always 0 100
        "the friction torque of the model is not finite", "it is finite";
    19 StoreDamaged "store-damaged" 0x5530 [] Stops Always 0 0
        "no stored parameter set is intact, and one may have been lost", "parameters are saved";
    20 SelfTestFailed "self-test-failed" 0x5220 [] Stops Always 0 0
        "the self-test failed", "it passes when repeated";
    21 WatchdogReset "watchdog-reset" 0x6010 [MANUFACTURER] Stops Always 0 0
        "the watchdog reset the processor", "the cause lies in the past";
    22 PanicBeforeReset "panic-before-reset" 0x6101 [MANUFACTURER] Stops Always 0 0
        "a panic reset the processor", "the cause lies in the past";
    23 StackOverflow "stack-overflow" 0x6102 [MANUFACTURER] Stops Always 0 0
        "the guard words below the stack are overwritten, now or in the previous run", "a restart, which writes them again";
    24 Internal "internal" 0x6100 [MANUFACTURER] Stops Always 0 100
        "the firmware found an internal error: a value of the loop is not finite, or the clock runs backwards",
        "an observation without it";
    25 NotCommissioned "not-commissioned" 0xFF15 [PROFILE] Stops Armed 0 0
        "the wiring of motor, encoder and gear is not confirmed, or its parameters were changed since",
        "the wiring is confirmed (200Ah:3)";
    26 SystemBreak "system-break" 0x5000 [MANUFACTURER] Stops Always 0 100
        "the microcontroller opened the bridge: supply below 2.9 V, clock failure, or a memory error (ECC, parity)",
        "an observation without it";
    27 MotorAgainst "motor-against-order" 0x7120 [PROFILE] Stops Armed 10 0
        "induced voltage and speed of the motor have opposite signs: the electrical zero or the direction is half a turn off",
        "the bridge is off (arming checks again)";
    28 MotorStands "motor-stands" 0x7121 [PROFILE] Stops Armed 500 0
        "the current reaches `stall_current_a`, the joint has not moved since it was armed, and its motor never turned with these wiring parameters: it is blocked or wired differently",
        "the bridge is off (arming checks again)";
    29 PositionUnknown "position-unknown" 0xFF1B [PROFILE] Stops Armed 0 0
        "`position_required` is 1, the position is unknown, and the drive is not in homing mode",
        "the position is set (2002h:6, or homing)";
    30 FollowingError "following-error" 0x8611 [PROFILE] Stops Armed 0 0
        "in mode 1 or 8 the position is farther than 6065h from its demand for 6066h, or the two sides of the gear differ by more than `joint_encoder_window_rad`",
        "the bridge is off (arming checks again)";
    31 TorqueOff "safe-torque-off" 0xFF1F [MANUFACTURER] Stops Armed 0 100
        "a channel of safe torque off does not allow torque", "both channels allow it";
    32 Leak "leak" 0xFF20 [MANUFACTURER] Stops Always 200 1000
        "water is at the leak probe, and `leak_stops` is 1", "the probe is dry";

    33 LoopLate "loop-late" 0xFF01 [MANUFACTURER] DropsCompensation Always 0 100
        "the loop exceeded its period once", "periods without an overrun";
    34 ParametersDefault "parameters-default" 0x6310 [MANUFACTURER] DropsCompensation Always 0 0
        "no parameters were ever saved; the defaults are in use", "parameters are set";
    35 ParametersRefused "parameters-refused" 0x6320 [MANUFACTURER] DropsCompensation Always 0 0
        "the stored parameters are refused; the defaults are in use", "parameters are set";
    36 VelocityInvalid "velocity-invalid" 0xFF04 [PROFILE] DropsCompensation Always 5 100
        "the compensator has no velocity, measured or reference", "it has one";
    37 StoreReduced "store-reduced" 0x5531 [] Limits Always 0 0
        "one of the two stored sets is damaged", "parameters are saved";
    38 CanErrorPassive "can-error-passive" 0x8120 [COMMUNICATION] Limits Always 0 100
        "the CAN controller is error passive", "it is error active";
    39 VoltageLimited "voltage-limited" 0xFF07 [VOLTAGE] Limits Always 5 100
        "the loop asks for more voltage than the bus has", "it does not";
    40 CurrentLimited "current-limited" 0xFF08 [CURRENT] Limits Always 5 100
        "the sum of set-point and compensation exceeds the current limit", "it does not";
    41 CurrentImbalance "current-imbalance" 0xFF09 [CURRENT] Limits Always 5 100
        "the three phase currents do not add up to 0", "they do";
    42 Derated "derated" 0x4211 [TEMPERATURE] Limits Always 100 1000
        "the bridge reaches `bridge_derate_c`, the motor `motor_derate_c`, or the modelled winding `winding_derate_c`", "all are `temperature_hysteresis_c` below";
    43 TemperatureUnknown "temperature-unknown" 0x4212 [TEMPERATURE] Limits Always 100 1000
        "a temperature sensor gives no valid value; the current limit is halved", "all values are valid";
    44 EncoderCoasting "encoder-coasting" 0xFF0C [PROFILE] Limits Always 2 100
        "encoder samples are missing or implausible again and again", "all samples are valid";
    45 SetpointInvalid "setpoint-invalid" 0xFF0D [COMMUNICATION] Limits Always 0 100
        "the set-point is not a number; 0 A is used", "the set-point is a number";
    46 CompensationLimited "compensation-limited" 0xFF0E [PROFILE] Limits Always 5 100
        "the torque limit of the compensation acts", "it does not";
    47 CompensationSlewed "compensation-slewed" 0xFF0F [PROFILE] Limits Always 5 100
        "the slew limit of the compensation acts", "it does not";
    48 RadialForceStale "radial-force-stale" 0xFF10 [PROFILE] Limits Always 0 100
        "the side load is too old or out of range; its effect fades out", "a valid value";
    49 PressureStale "pressure-stale" 0xFF11 [PROFILE] Limits Always 0 100
        "the pressure is too old or out of range; its effect fades out", "a valid value";
    50 TemperatureStale "temperature-stale" 0xFF12 [PROFILE] Limits Always 0 100
        "the seal temperature is too old or out of range; its effect fades out", "a valid value";
    51 OtherInputStale "other-input-stale" 0xFF13 [PROFILE] Limits Always 0 100
        "position, acceleration, load torque, auxiliary input or campaign time is too old or out of range",
        "valid values";
    52 ModelOutOfBand "model-out-of-band" 0xFF14 [PROFILE] Limits Always 0 0
        "the torque residual is outside the band of the model", "it is inside";
    53 Stalled "stalled" 0xFF16 [PROFILE] Limits Always 500 100
        "the current reaches `stall_current_a`, and the joint stands still after having moved", "the joint moves, or the current is lower";
    54 OverCompensated "over-compensated" 0xFF17 [PROFILE] Limits Always 0 100
        "the model predicts more friction than the joint has, so its compensation would drive the joint; it is reduced",
        "the prediction is not too high, or other parameters are set";
    55 RadialForceStuck "radial-force-stuck" 0xFF18 [PROFILE] Limits Always 0 100
        "200 identical readings of the side load, although its noise exceeds its resolution; its effect fades out",
        "the reading changes";
    56 PressureStuck "pressure-stuck" 0xFF19 [PROFILE] Limits Always 0 100
        "200 identical readings of the pressure, although its noise exceeds its resolution; its effect fades out",
        "the reading changes";
    57 BrakingLimited "braking-limited" 0xFF1A [VOLTAGE] Limits Always 5 100
        "the bus is nearly full: the winding burns braking power, or braking is reduced", "the bus has room";
    58 EncoderMagnet "encoder-magnet" 0xFF1C [PROFILE] Limits Always 0 100
        "an encoder warns: a magnet too weak, too strong or misplaced, lost counts, no index, levels that contradict each other, or missing or jumping frames of the joint's encoder",
        "it reports none at the next reading, a second later";
    59 BrakeTestFailed "brake-test-failed" 0xFF1D [PROFILE] Limits Always 0 0
        "in its last test, the holding brake slipped, or the current did not reach the torque (2030h:12)",
        "the brake holds in a test";
    60 TorqueOffChannels "safe-torque-off-channels" 0xFF21 [MANUFACTURER] Limits Always 100 100
        "the two channels of safe torque off differ", "they are equal";
    61 LeakReported "leak-reported" 0xFF22 [MANUFACTURER] Limits Always 200 1000
        "water is at the leak probe, and `leak_stops` is 0", "the probe is dry";
    62 HousingHumid "housing-humid" 0xFF23 [MANUFACTURER] Limits Always 3000 3000
        "the humidity in the housing reaches `humidity_max_percent`", "it is below";
    63 HousingPressure "housing-pressure" 0xFF24 [MANUFACTURER] Limits Always 3000 3000
        "the pressure in the housing is below `housing_pressure_min_pa` or above `housing_pressure_max_pa`", "it is within";
    64 EnclosureUnknown "enclosure-unknown" 0xFF25 [MANUFACTURER] Limits Always 1000 1000
        "the leak probe's wire is broken, or the sensor in the housing gives no valid value", "all connected sensors give valid values";
}
