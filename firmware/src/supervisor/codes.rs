//! Every fault and limit of the joint driver, once.
//!
//! The table at the end of this file is what documentation, the EDS and emergency frames are made of. A row has
//! the code's own number (byte 3 of an emergency frame; also its bit, counted from 1, in the sets on the
//! bus: faults are 1 to 32, limits 33 to 64), its emergency error code and the bits it sets in the error
//! register (CiA 301 7.2.7.1 and object 0x1001; codes of drives as IEC 61800-7-201 has them, else device
//! specific), what it does, when it is watched, how long its cause has to last and to be gone, and in
//! words what raises and what clears it. Numbers are never given to another code.

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
    /// The device's profile: here encoder, motor and model.
    pub const PROFILE: u8 = 1 << 5;
    /// The maker's own: here the firmware.
    pub const MANUFACTURER: u8 = 1 << 7;
}

/// What a code does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effect {
    /// A fault: bridge off, held until it is cleared.
    Stops,
    /// A limit that takes the compensation away while it lasts.
    DropsCompensation,
    /// A limit.
    Limits,
}

/// When a cause becomes a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Watched {
    /// At any time.
    Always,
    /// While armed. Before, the cause only stands against arming.
    Armed,
}

/// A row of the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Info {
    /// Its own number: 1..=32 for faults, 33..=64 for limits.
    pub number: u8,
    /// Its name.
    pub name: &'static str,
    /// Emergency error code.
    pub emergency: u16,
    /// Bits it sets in the error register.
    pub register: u8,
    /// What it does.
    pub effect: Effect,
    /// When it is watched.
    pub watched: Watched,
    /// How long its cause has to last, us.
    pub raise_after_us: u32,
    /// How long its cause has to be gone, us.
    pub clear_after_us: u32,
}

/// A row of the table in words: for tools, and apart from [`Info`], so that they are in no driver's image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Words {
    /// What raises it.
    pub raised_by: &'static str,
    /// What its cause goes with.
    pub cleared_by: &'static str,
}

/// A set of codes.
#[derive(Clone, Copy, Default, PartialEq, Eq)]
pub struct CodeSet(u64);

impl CodeSet {
    /// No code.
    pub const EMPTY: Self = Self(0);

    const fn bit(code: Code) -> u64 {
        1 << (code as u8 - 1)
    }

    /// Whether it is in the set.
    #[inline]
    pub const fn contains(self, code: Code) -> bool {
        self.0 & Self::bit(code) != 0
    }

    /// Puts it in.
    pub const fn insert(&mut self, code: Code) {
        self.0 |= Self::bit(code);
    }

    /// Takes it out.
    pub const fn remove(&mut self, code: Code) {
        self.0 &= !Self::bit(code);
    }

    /// Whether nothing is in it.
    #[inline]
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Whether they have a code in common.
    #[inline]
    pub const fn intersects(self, other: Self) -> bool {
        self.0 & other.0 != 0
    }

    /// Those that are not in `other`.
    pub const fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }

    /// Its faults as they travel: bit 0 is number 1.
    pub const fn fault_bits(self) -> u32 {
        self.0 as u32
    }

    /// Its limits as they travel: bit 0 is number 33.
    pub const fn limit_bits(self) -> u32 {
        (self.0 >> 32) as u32
    }

    /// Its codes, by rising number.
    pub fn iter(self) -> impl Iterator<Item = Code> {
        Code::ALL.iter().copied().filter(move |code| self.contains(*code))
    }

    /// The error register that goes with it.
    pub fn error_register(self) -> u8 {
        self.iter().fold(0, |register, code| register | code.info().register)
    }
}

impl fmt::Debug for CodeSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_set().entries(self.iter()).finish()
    }
}

/// A delay in the table, ms to us.
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

        /// How many codes there are.
        pub const CODES: usize = [$($number),*].len();

        impl Code {
            /// Every code, by rising number.
            pub const ALL: &'static [Code; CODES] = &[$(Code::$code),*];

            /// Its row of the table.
            pub const fn info(self) -> &'static Info {
                match self {
                    $(Code::$code => const { &Info {
                        number: $number,
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

            /// Its row in words.
            pub const fn words(self) -> Words {
                match self {
                    $(Code::$code => Words { raised_by: $raised_by, cleared_by: $cleared_by },)*
                }
            }
        }
    };
}

impl Code {
    /// Its own number.
    pub const fn number(self) -> u8 {
        self as u8
    }

    /// The code with this number.
    pub fn from_number(number: u8) -> Option<Self> {
        Self::ALL.iter().copied().find(|code| code.number() == number)
    }

    /// Its place in [`Code::ALL`].
    pub(super) const fn index(self) -> usize {
        let mut index = 0;
        while index < CODES {
            if Self::ALL[index] as u8 == self as u8 {
                return index;
            }
            index += 1;
        }
        // Every code is in its own list.
        CODES
    }
}

/// Every code with an effect.
const fn with_effect(effect: Effect) -> CodeSet {
    let mut set = CodeSet::EMPTY;
    let mut index = 0;
    while index < CODES {
        let code = Code::ALL[index];
        if code.info().effect as u8 == effect as u8 {
            set.insert(code);
        }
        index += 1;
    }
    set
}

/// Every fault.
pub const STOPPING: CodeSet = with_effect(Effect::Stops);

/// Every limit that takes the compensation away.
pub const DROPS_COMPENSATION: CodeSet = with_effect(Effect::DropsCompensation);

// Columns: number, code, name, emergency code, bit of the error register, effect, watched, how long its
// cause must last and be gone (ms), what raises it, what its cause goes with.
codes! {
    1 CommandTimeout "command-timeout" 0x8250 [COMMUNICATION] Stops Armed 0 0
        "no set-point for `command_timeout_us`", "a set-point";
    2 HeartbeatLost "heartbeat-lost" 0x8130 [COMMUNICATION] Stops Armed 0 0
        "the awaited heartbeat stays away", "the heartbeat comes again";
    3 CanBusOff "can-bus-off" 0x8140 [COMMUNICATION] Stops Always 0 100
        "the CAN controller has left the bus", "it is back on the bus";
    4 Overcurrent "overcurrent" 0x2310 [CURRENT] Stops Always 0 10
        "a phase current at `overcurrent_a` in any period, or at the board's comparators, which open the bridge themselves", "all below it";
    5 CurrentSensorInvalid "current-sensor-invalid" 0x5210 [CURRENT] Stops Always 1 100
        "phase currents not valid or not finite", "valid currents";
    6 CurrentOffset "current-offset" 0x5211 [CURRENT] Stops Always 50 100
        "with the bridge off, a phase current of `current_offset_a`", "with the bridge off, all below half of it";
    7 PhaseLost "phase-lost" 0x7122 [PROFILE] Stops Armed 20 0
        "half of a set-point of `phase_check_a` or more is missing, and one phase below `phase_dead_a`",
        "the bridge is off (a new try shows)";
    8 BusOvervoltage "bus-overvoltage" 0x3210 [VOLTAGE] Stops Always 0 100
        "bus at `bus_overvoltage_v`", "bus at `bus_overvoltage_clear_v` or below";
    9 BusUndervoltage "bus-undervoltage" 0x3220 [VOLTAGE] Stops Armed 2 100
        "bus at `bus_undervoltage_v`", "bus at `bus_undervoltage_clear_v` or above";
    10 GateDriverFault "gate-driver-fault" 0x5410 [] Stops Always 0 10
        "the gate driver says so", "it no longer does";
    11 BridgeOvertemperature "bridge-overtemperature" 0x4210 [TEMPERATURE] Stops Always 100 1000
        "bridge at `bridge_trip_c`", "bridge `temperature_hysteresis_c` below it";
    12 MotorOvertemperature "motor-overtemperature" 0x4310 [TEMPERATURE] Stops Always 100 1000
        "motor at `motor_trip_c`", "motor `temperature_hysteresis_c` below it";
    13 EncoderLost "encoder-lost" 0x7305 [PROFILE] Stops Armed 0 100
        "no angle to drive by: the loop has coasted for too long", "the observer has settled on an angle";
    14 EncoderJump "encoder-jump" 0x7300 [PROFILE] Stops Armed 2 100
        "the encoder goes on jumping farther than the shaft can turn", "it no longer does";
    15 AdcTimeout "adc-timeout" 0x5212 [] Stops Always 0 100
        "no conversion for `sample_timeout_us`, or no bus voltage to go by", "conversions come";
    16 Overspeed "overspeed" 0x8400 [PROFILE] Stops Always 5 100
        "joint at `overspeed_rad_s`", "joint at nine tenths of it or below";
    17 LoopOverrun "loop-overrun" 0x6110 [MANUFACTURER] Stops Always 0 0
        "`overruns_in_a_row` periods in a row were too short for the loop", "a period that was not";
    18 ModelNotFinite "model-not-finite" 0x6103 [MANUFACTURER] Stops Always 0 100
        "the friction model gave no finite torque", "it gives one";
    19 StoreDamaged "store-damaged" 0x5530 [] Stops Always 0 0
        "no parameter set is whole, and there may have been one", "a save";
    20 SelfTestFailed "self-test-failed" 0x5220 [] Stops Always 0 0
        "the self-test failed", "it passes when repeated";
    21 WatchdogReset "watchdog-reset" 0x6010 [MANUFACTURER] Stops Always 0 0
        "the watchdog ended the last life", "over already";
    22 PanicBeforeReset "panic-before-reset" 0x6101 [MANUFACTURER] Stops Always 0 0
        "a panic ended the last life", "over already";
    23 StackOverflow "stack-overflow" 0x6102 [MANUFACTURER] Stops Always 0 0
        "the guard below the stack is overwritten, or was in the last life", "a restart, which paints it anew";
    24 Internal "internal" 0x6100 [MANUFACTURER] Stops Always 0 100
        "the firmware caught itself: a number of the loop not finite, a clock that runs backwards",
        "an observation without it";
    25 NotCommissioned "not-commissioned" 0xFF15 [PROFILE] Stops Armed 0 0
        "nobody has confirmed that motor, encoder and gear are wired as the parameters say, or they were changed since",
        "it is confirmed (200Ah:3)";
    26 SystemBreak "system-break" 0x5000 [MANUFACTURER] Stops Always 0 100
        "the chip opened the bridge: supply below 2.8 V, a clock that stopped, memory whose check bits do not fit",
        "an observation without it";
    27 MotorAgainst "motor-against-order" 0x7120 [PROFILE] Stops Armed 10 0
        "the motor's induced voltage has the other sign than its speed: electrical zero or direction is half a turn off",
        "the bridge is off (a new try shows)";
    28 MotorStands "motor-stands" 0x7121 [PROFILE] Stops Armed 500 0
        "`stall_current_a` or more, and the joint has not moved since it was armed: held, or wired other than the parameters say",
        "the bridge is off (a new try shows)";

    33 LoopLate "loop-late" 0xFF01 [MANUFACTURER] DropsCompensation Always 0 100
        "one period was too short for the loop", "periods that are not";
    34 ParametersDefault "parameters-default" 0x6310 [MANUFACTURER] DropsCompensation Always 0 0
        "no parameters were ever saved", "parameters are set";
    35 ParametersRefused "parameters-refused" 0x6320 [MANUFACTURER] DropsCompensation Always 0 0
        "the stored parameters are refused, the default ones in use", "parameters are set";
    36 VelocityInvalid "velocity-invalid" 0xFF04 [PROFILE] DropsCompensation Always 5 100
        "the compensator has no velocity, measured or reference", "it has one";
    37 StoreReduced "store-reduced" 0x5531 [] Limits Always 0 0
        "one of the two stored sets is damaged", "a save";
    38 CanErrorPassive "can-error-passive" 0x8120 [COMMUNICATION] Limits Always 0 100
        "the CAN controller is error passive", "it is error active";
    39 VoltageLimited "voltage-limited" 0xFF07 [VOLTAGE] Limits Always 5 100
        "the loop asks for more voltage than the bus has", "it does not";
    40 CurrentLimited "current-limited" 0xFF08 [CURRENT] Limits Always 5 100
        "the sum of set-point and compensation is beyond the current limit", "it is not";
    41 CurrentImbalance "current-imbalance" 0xFF09 [CURRENT] Limits Always 5 100
        "the three phase currents do not add up to 0", "they do";
    42 Derated "derated" 0x4211 [TEMPERATURE] Limits Always 100 1000
        "bridge at `bridge_derate_c`, motor at `motor_derate_c` or its copper, by the model, at `winding_derate_c`", "all `temperature_hysteresis_c` below";
    43 TemperatureUnknown "temperature-unknown" 0x4212 [TEMPERATURE] Limits Always 100 1000
        "a temperature sensor gives no number; half the current is left", "it gives one";
    44 EncoderCoasting "encoder-coasting" 0xFF0C [PROFILE] Limits Always 0 100
        "an encoder sample is missing or not believed", "none is";
    45 SetpointInvalid "setpoint-invalid" 0xFF0D [COMMUNICATION] Limits Always 0 100
        "a set-point that is no number; it counts as 0 A", "one that is";
    46 CompensationLimited "compensation-limited" 0xFF0E [PROFILE] Limits Always 5 100
        "the torque limit of the compensation acts", "it does not";
    47 CompensationSlewed "compensation-slewed" 0xFF0F [PROFILE] Limits Always 5 100
        "the slew limit of the compensation acts", "it does not";
    48 RadialForceStale "radial-force-stale" 0xFF10 [PROFILE] Limits Always 0 100
        "side load too old or out of its range; it fades", "a good value";
    49 PressureStale "pressure-stale" 0xFF11 [PROFILE] Limits Always 0 100
        "pressure too old or out of its range; it fades", "a good value";
    50 TemperatureStale "temperature-stale" 0xFF12 [PROFILE] Limits Always 0 100
        "seal temperature too old or out of its range; it fades", "a good value";
    51 OtherInputStale "other-input-stale" 0xFF13 [PROFILE] Limits Always 0 100
        "position, acceleration, load torque, auxiliary input or campaign time too old or out of its range",
        "good values";
    52 ModelOutOfBand "model-out-of-band" 0xFF14 [PROFILE] Limits Always 0 0
        "the torque residual is outside the band the model promised", "it is inside";
    53 Stalled "stalled" 0xFF16 [PROFILE] Limits Always 500 100
        "`stall_current_a` or more, and the joint stands, having moved before", "it moves, or less current";
    54 OverCompensated "over-compensated" 0xFF17 [PROFILE] Limits Always 0 100
        "the model was seen to have more friction than the joint, so that its compensation would drive it; less is compensated",
        "it has not, or other parameters are set";
    55 RadialForceStuck "radial-force-stuck" 0xFF18 [PROFILE] Limits Always 0 100
        "side load has been the same to the bit for 200 readings, where its noise was wider than its steps; it fades",
        "it changes";
    56 PressureStuck "pressure-stuck" 0xFF19 [PROFILE] Limits Always 0 100
        "pressure has been the same to the bit for 200 readings, where its noise was wider than its steps; it fades",
        "it changes";
}
