//! Objects with several values: each entry with name, type, access and rights, and a struct for the values.
//!
//! From one list, the macro `record` generates both the [`Entry`] list that tools see and a struct that the
//! driver fills by field name. A new entry is one row here; the compiler then requires its value. Entries
//! that are written, or mapped to process frames, also get a constant for their sub-index.
//!
//! The comments of entries are the tables of docs/src/reference/can-objects.md.

use super::entry::{Access, DataType, Entry, entry};
use core::mem::offset_of;

macro_rules! record {
    ($(#[$doc:meta])* $record:ident {
        $($(#[$meaning:meta])* $field:ident: $data:ident, $access:ident $(, $AT:ident)? $([$right:ident])?;)*
    }) => {
        $(#[$doc])*
        ///
        /// All values are `u32`; a float is stored as its bits.
        // The layout of C, so that the place of a field is that of its entry.
        #[repr(C)]
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
        #[allow(missing_docs)]
        pub struct $record { $($(#[$meaning])* pub $field: u32),* }

        #[allow(missing_docs)]
        impl $record {
            /// The entries, starting with sub-index 1.
            pub const ENTRIES: &'static [Entry] =
                &[$(entry(stringify!($field), DataType::$data, Access::$access)$(.$right())?),*];

            $($(pub const $AT: u8 = (1 + offset_of!($record, $field) / size_of::<u32>()) as u8;)?)*

            /// Returns the values in the order of the entries.
            pub const fn words(&self) -> [u32; Self::ENTRIES.len()] {
                [$(self.$field),*]
            }

            /// Returns the record with this word at a sub-index; `None` if there is no such entry.
            #[allow(dead_code)] // Used by some records only.
            pub(crate) const fn of([$($field),*]: [u32; Self::ENTRIES.len()]) -> Self {
                Self { $($field),* }
            }
        }
    };
}

mod counters;
mod profile;

pub use counters::{Counters, FRAME_COUNTERS};
pub use profile::*;

record! {
    /// Run, sequence and joint kind of the samples that follow in a trace.
    TraceObject {
        run: Unsigned32, ReadWrite, RUN;
        sequence: Unsigned32, ReadWrite, SEQUENCE;
        joint_kind: Unsigned32, ReadWrite, JOINT_KIND;
    }
}

record! {
    /// Settings of the node on its bus.
    OperationObject {
        source: Unsigned8, ReadWrite, SOURCE [service];
        number: Unsigned8, ReadWrite, NUMBER;
        period_s: Real32, ReadWrite, PERIOD_S;
        campaign_h: Real32, ReadWrite, CAMPAIGN_H;
        telemetry_every: Unsigned8, ReadWrite, TELEMETRY_EVERY;
        node: Unsigned8, ReadWrite, NODE [service];
        bit_rate_kbit: Unsigned16, ReadWrite, BIT_RATE [service];
        data_bit_rate_kbit: Unsigned16, ReadWrite, DATA_BIT_RATE [service];
        fd_telemetry: Unsigned8, ReadWrite, FD_TELEMETRY [service];
    }
}

record! {
    /// State machine of the joint.
    StateObject {
        request: Unsigned8, WriteOnly, REQUEST [armed];
        state: Unsigned8, ReadOnly;
        faults: Unsigned32, ReadOnly;
        limits: Unsigned32, ReadOnly;
        blocking_codes: Unsigned32, ReadOnly;
        set_position_rad: Real32, WriteOnly, SET_POSITION;
        /// First test of the board that failed at the start; 0 none. 1 pins of the wiring, 2 duty of the outputs, 3 clock of
        /// the encoder, 4 and 5 offsets of the amplifiers a and b, 10 + n comparator n.
        failed_self_test: Unsigned8, ReadOnly, FAILED_SELF_TEST;
    }
}

record! {
    /// Last inputs from process frames. Writing the object has the effect of receiving its frame.
    InputsObject {
        velocity_rad_s: Real32, Input, VELOCITY;
        position_rad: Real32, Input, POSITION;
        torque_nm: Real32, Input, TORQUE;
        load_torque_nm: Real32, Input, LOAD_TORQUE;
        radial_force_n: Real32, Input, RADIAL_FORCE;
        pressure_diff_pa: Real32, Input, PRESSURE_DIFF;
        temperature_c: Real32, Input, TEMPERATURE;
        auxiliary: Real32, Input, AUXILIARY;
        command_current_a: Real32, Input, COMMAND_CURRENT;
        command_velocity_and_counter: Unsigned32, Input, COMMAND_REST;
    }
}

impl InputsObject {
    /// Sets the entry at a sub-index and returns both words of its frame. Two consecutive entries form a
    /// frame.
    pub fn set(&mut self, sub_index: u8, word: u32) -> Option<[u32; 2]> {
        let place = usize::from(sub_index.checked_sub(1)?);
        let mut words = self.words();
        *words.get_mut(place)? = word;
        *self = Self::of(words);
        words.as_chunks().0.get(place / 2).copied()
    }
}

record! {
    /// Last outputs in process frames.
    OutputsObject {
        friction_torque_nm: Real32, ReadOnly, FRICTION_TORQUE;
        feed_forward_current_a: Real32, ReadOnly, FEED_FORWARD_CURRENT;
        flags: Unsigned32, ReadOnly, FLAGS;
        sequence: Unsigned32, ReadOnly, SEQUENCE;
        current_a: Real32, ReadOnly, CURRENT;
        residual_torque_nm: Real32, ReadOnly, RESIDUAL_TORQUE;
    }
}

record! {
    /// Last measurements of the joint. For a joint in HIL, its received inputs.
    MeasuredObject {
        velocity_rad_s: Real32, ReadOnly, VELOCITY;
        position_rad: Real32, ReadOnly, POSITION;
        torque_nm: Real32, ReadOnly, TORQUE;
        load_torque_nm: Real32, ReadOnly, LOAD_TORQUE;
    }
}

record! {
    /// State of the model watch.
    WatchObject {
        in_band: Unsigned8, ReadOnly;
        windows: Unsigned32, ReadOnly;
        windows_out_of_band: Unsigned32, ReadOnly;
        alarms: Unsigned32, ReadOnly;
        largest_in_bands: Real32, ReadOnly;
    }
}

record! {
    /// State of the network that supplies the law, if one is used: input guard and factors.
    NetworkObject {
        /// 1: a network is present.
        present: Unsigned8, ReadOnly, PRESENT;
        /// 1: the last evaluation was outside the training range, so that the law returned to its constants.
        outside: Unsigned8, ReadOnly, OUTSIDE;
        /// Number of evaluations outside the training range.
        outside_count: Unsigned32, ReadOnly, OUTSIDE_COUNT;
        /// Weight of the network's factors.
        share: Real32, ReadOnly, SHARE;
        /// Factor on the Coulomb level.
        coulomb_factor: Real32, ReadOnly, COULOMB_FACTOR;
        /// Factor on the static level.
        static_factor: Real32, ReadOnly, STATIC_FACTOR;
        /// Factor on the stiffness.
        stiffness_factor: Real32, ReadOnly, STIFFNESS_FACTOR;
    }
}

record! {
    /// The running program, and the one that is being received (1F50h). `board` is 0 if there are no updates.
    ProgramObject {
        /// Number of the board; 0 if it takes no updates.
        board: Unsigned32, ReadOnly, BOARD;
        /// Version of the running program.
        version: Unsigned32, ReadOnly, VERSION;
        /// Rollback counter of the running program.
        rollback_counter: Unsigned32, ReadOnly, COUNTER;
        /// Running program: 0 unknown, 1 trial, 2 confirmed, 3 recovery by the boot program.
        state: Unsigned8, ReadOnly, STATE;
        /// Version of the program in the other slot.
        other_version: Unsigned32, ReadOnly, OTHER_VERSION;
        /// Other program: 0 none, 1 waits for its start, 2 not signed, 3 failed, 4 confirmed.
        other_state: Unsigned8, ReadOnly, OTHER_STATE;
        /// Identity of the package that arrives; 0 if unknown.
        receiving: Unsigned32, ReadOnly, RECEIVING;
        /// Bytes of it that arrived.
        received_bytes: Unsigned32, ReadOnly, RECEIVED;
        /// Identity of the running program.
        identity: Unsigned32, ReadOnly, IDENTITY;
        /// Load address of the image that is accepted next.
        accepted_address: Unsigned32, ReadOnly, ACCEPTED_ADDRESS;
        /// Identity of the board's wiring.
        wiring: Unsigned32, ReadOnly, WIRING;
        /// First four bytes of the key whose programs are accepted; EA4A 6C63h is the published test key.
        update_key: Unsigned32, ReadOnly, UPDATE_KEY;
    }
}

record! {
    /// The staged parameter set, with the commands to commit or discard it.
    CommitObject {
        /// CRC of the active set.
        active_crc: Unsigned32, ReadOnly;
        /// CRC of the staged set.
        staged_crc: Unsigned32, ReadOnly;
        /// Write the CRC of the staged set: the driver validates the set and activates it.
        commit: Unsigned32, WriteOnly, COMMIT;
        /// Any value discards the staged set.
        discard: Unsigned8, WriteOnly, DISCARD;
        /// The friction parameters as one record.
        friction_record: Domain, ReadWrite, FRICTION_RECORD;
        /// Motor, sensors, thresholds and watch as one record.
        drive_record: Domain, ReadWrite, DRIVE_RECORD [service];
        /// Record of a network, 1872 bytes. A record of 16 bytes removes the network.
        network_record: Domain, ReadWrite, NETWORK_RECORD;
    }
}

record! {
    /// State of the wiring confirmation. A tool confirms by writing back the CRC of the wiring in use. The wiring is
    /// proven once the motor has turned by its current.
    CommissioningObject {
        /// 1: the wiring is confirmed.
        commissioned: Unsigned8, ReadOnly;
        /// CRC of the wiring parameters.
        wiring_crc: Unsigned32, ReadOnly, WIRING_CRC;
        /// Write the CRC of the wiring parameters to confirm them.
        confirm: Unsigned32, WriteOnly, CONFIRM;
        /// 1: the motor was measured, or has turned the joint by 0.1 rad in the direction of its current.
        proven: Unsigned8, ReadOnly, PROVEN;
    }
}

record! {
    /// The automatic commissioning run: its limits, its progress and its results.
    CommissioningRunObject {
        /// 1 measures the motor, 3 makes a friction run, 2 at least every 100 ms keeps either running, 0 ends it.
        order: Unsigned8, WriteOnly, ORDER [armed];
        /// Largest current, A; default three tenths of `motor.current_limit_a`.
        current_a: Real32, ReadWrite, CURRENT;
        /// Travel to either side, rad; default 0.5.
        travel_rad: Real32, ReadWrite, TRAVEL;
        /// Step of the run.
        step: Unsigned8, ReadOnly, STEP;
        /// Reason of its end.
        reason: Unsigned8, ReadOnly, REASON;
        /// Offset of phase a, A.
        offset_a_a: Real32, ReadOnly, OFFSET_A;
        /// Offset of phase b, A.
        offset_b_a: Real32, ReadOnly, OFFSET_B;
        /// Phase resistance, ohm.
        resistance_ohm: Real32, ReadOnly, RESISTANCE;
        /// Inductance along the magnet, H.
        inductance_d_h: Real32, ReadOnly, INDUCTANCE_D;
        /// Inductance across the magnet, H.
        inductance_q_h: Real32, ReadOnly, INDUCTANCE_Q;
        /// Pole pairs.
        pole_pairs: Unsigned8, ReadOnly, POLE_PAIRS;
        /// Direction of the encoder, 1 or -1.
        encoder_direction: Integer8, ReadOnly, ENCODER_DIRECTION;
        /// Electrical zero, rad.
        encoder_offset_rad: Real32, ReadOnly, ENCODER_OFFSET;
        /// Lag of the rotor behind the field, rad.
        lag_rad: Real32, ReadOnly, LAG;
        /// Torque constant, Nm/A.
        torque_constant_nm_per_a: Real32, ReadOnly, TORQUE_CONSTANT;
        /// Friction, Nm.
        friction_torque_nm: Real32, ReadOnly, FRICTION_TORQUE;
        /// Start speed of the friction run, rad/s; default 2.
        speed_rad_s: Real32, ReadWrite, SPEED;
        /// Dead time of the bridge, s.
        dead_time_s: Real32, ReadOnly, DEAD_TIME;
        /// Current at which half of the dead time's voltage is lost, A.
        dead_time_current_a: Real32, ReadOnly, DEAD_TIME_CURRENT;
        /// Bandwidth of the current loop that is staged, Hz.
        current_bandwidth_hz: Real32, ReadOnly, BANDWIDTH;
        /// Its phase margin with 5 % less inductance, rad.
        phase_margin_rad: Real32, ReadOnly, PHASE_MARGIN;
        /// Its gain margin with 5 % less inductance, a factor.
        gain_margin: Real32, ReadOnly, GAIN_MARGIN;
    }
}

record! {
    /// The dry side of the joint: leak probe, air in the housing, channels of safe torque off (bits 0 and 1: torque is
    /// allowed). NaN marks what is not measured.
    EnclosureObject {
        leak_share: Real32, ReadOnly;
        humidity_percent: Real32, ReadOnly;
        housing_pressure_pa: Real32, ReadOnly;
        housing_temperature_c: Real32, ReadOnly;
        torque_allowed: Unsigned8, ReadOnly;
    }
}

record! {
    /// The encoder at the joint's side of the gear: see `crate::driver::device::joint_encoder`.
    JointEncoderObject {
        /// Joint's side less motor's side since the joint was armed, rad.
        difference_rad: Real32, ReadOnly;
        /// 0 a valid frame, or no such encoder; 1 missing, 2 a jump, 3 the sides differ by more than the window.
        state: Unsigned8, ReadOnly;
    }
}

record! {
    /// Access to the objects of the service level: see [`crate::access`].
    AccessObject {
        /// 0 open, 1 service.
        level: Unsigned8, ReadOnly, LEVEL;
        /// 8 bytes, new with every read.
        challenge: Domain, ReadOnly, CHALLENGE;
        /// 8 bytes; valid once, for the last challenge.
        response: Domain, WriteOnly, RESPONSE [armed];
        /// Any value locks the joint.
        lock: Unsigned8, WriteOnly, LOCK [armed];
        /// New key of 16 bytes, then its proof of 8 bytes. It acts at once, and 1010h:1 stores it.
        new_key: Domain, WriteOnly, NEW_KEY [service];
        /// 1: the joint starts locked (default). 0: every node has the service level.
        locked_by_default: Unsigned8, ReadOnly, LOCKED_BY_DEFAULT;
        /// Wrong responses and proofs since the last right one.
        wrong_responses: Unsigned16, ReadOnly;
        /// New policy of 1 byte, then its proof of 8 bytes.
        new_policy: Domain, WriteOnly, NEW_POLICY [service];
    }
}

record! {
    /// Trial of a parameter set: time to its deadline, order, state, and the CRC of the set that comes back.
    TrialObject {
        /// Write 100 to 60000: opens the trial, or renews its deadline. Reads the time left, 0 if none is open.
        deadline_ms: Unsigned16, ReadWrite, DEADLINE [armed];
        /// 1 keeps what is active, in RAM; 1010h:1 then stores it. 2 returns to the flash. 3, disarmed only, stores what
        /// is active and keeps it; if that fails, the trial stays open.
        order: Unsigned8, WriteOnly, ORDER [armed];
        /// 0 none since the start, 1 open, 2 kept. Returned: 3 by request, 4 at the deadline, 5 after a fault,
        /// 6 because the connection was lost or the network stopped. 7: the joint stops, then it returns.
        state: Unsigned8, ReadOnly, STATE;
        /// CRC of the set that comes back; 0 before the first trial.
        returning_crc: Unsigned32, ReadOnly, RETURNING_CRC;
    }
}

record! {
    /// Record of the last tuning, and the order to undo it.
    TuningObject {
        /// Unix time of the tuning, s.
        unix_time_s: Unsigned32, ReadWrite;
        /// First four bytes of the hash of the recorded runs.
        run: Unsigned32, ReadWrite;
        /// CRC of the set before.
        set_before_crc: Unsigned32, ReadWrite;
        /// CRC of the tuned set.
        tuned_set_crc: Unsigned32, ReadWrite;
        /// Reduction of the tracking error, thousandths.
        gain_permille: Integer16, ReadWrite;
        /// Number of the cause; 0 for none.
        cause: Unsigned8, ReadWrite;
        /// 1 activates the block that was saved before this one, with its settings of the drive, and clears this
        /// record.
        undo: Unsigned8, WriteOnly, UNDO;
    }
}

record! {
    /// Adaptation of the friction levels: settings, order, and what it knows.
    AdaptationObject {
        /// 0 off: the set applies. 1 on. 2 hold: what was learnt applies, and nothing more is learnt. 3 on in every mode:
        /// otherwise no gain above 1 applies in the torque modes.
        mode: Unsigned8, ReadWrite, MODE [armed];
        /// Least gain, thousandths; 1000 is the tuned set.
        least_gain_permille: Unsigned16, ReadWrite;
        /// Largest gain, thousandths.
        largest_gain_permille: Unsigned16, ReadWrite;
        /// Memory, s of sliding.
        memory_s: Unsigned16, ReadWrite;
        /// 1 adopts: the set with the gains in use becomes the active one, at gain 1. 2 discards. Disarmed only.
        order: Unsigned8, WriteOnly, ORDER;
        /// 0 it learns. Else the reason: 1 off, 2 hold or trial, 3 not armed, 4 settling for 3 s, 5 a limit acts,
        /// 6 standstill, 7 after a reversal, 8 an input of the model is stale or implausible, 9 contact,
        /// 10 the set with the next gains is refused.
        frozen: Unsigned8, ReadOnly, FROZEN;
        /// Sliding that was learnt from, s.
        learnt_s: Real32, ReadOnly, LEARNT_S;
        /// Time since something was learnt, s.
        age_s: Real32, ReadOnly, AGE_S;
        /// Torque that does not depend on the direction of motion, Nm. It is not compensated.
        constant_torque_nm: Real32, ReadOnly;
        /// Quantity that the learnt level follows while the model does not use it: 1 pressure, 2 side load,
        /// 3 temperature, 0 none.
        follows: Unsigned8, ReadOnly, FOLLOWS;
        /// Share of the level's variance that this quantity explains.
        follows_share: Real32, ReadOnly, FOLLOWS_SHARE;
    }
}

record! {
    /// Output, delays and state of the holding brake; settings, order and result of its test (ways in 1e-6 rad).
    HoldingBrakeObject {
        /// 0 no brake (default); 1 a high level releases it, 2 a low level.
        output: Unsigned8, ReadWrite;
        /// Time until the brake is open; default 100.
        release_delay_ms: Unsigned16, ReadWrite;
        /// Time until the brake is closed; default 100.
        engage_delay_ms: Unsigned16, ReadWrite;
        /// If the bridge opens in motion: 0 the brake closes at standstill (default), 1 at once.
        engage_at: Unsigned8, ReadWrite;
        /// Longest wait for standstill; default 1000.
        longest_wait_ms: Unsigned16, ReadWrite;
        /// 1 while the output releases the brake.
        released: Unsigned8, ReadOnly, RELEASED;
        /// Torque of the test, thousandths of 6076h; 0 (default): no test.
        test_torque_permille: Unsigned16, ReadWrite;
        /// Time at the torque in each direction; default 200.
        test_time_ms: Unsigned16, ReadWrite;
        /// Largest way, 1e-6 rad: above play and elasticity of brake and gear; default 20000.
        test_way: Unsigned32, ReadWrite;
        /// Operating hours from one test to the next; 0: on request only; default 24.
        test_interval_h: Unsigned16, ReadWrite;
        /// 1 tests now (disarmed), 0 ends the test.
        test_order: Unsigned8, WriteOnly, TEST_ORDER [armed];
        /// 0 none since the start, 1 running, 2 held, 3 slipped, 4 the current did not reach the torque, 5 interrupted.
        test_result: Unsigned8, ReadOnly, TEST_RESULT;
        /// Largest way forwards, 1e-6 rad.
        way_forwards: Integer32, ReadOnly, WAY_FORWARDS;
        /// Largest way back, 1e-6 rad.
        way_back: Integer32, ReadOnly, WAY_BACK;
    }
}

record! {
    /// A scope: settings, state and rows of a capture of the current loop.
    ScopeObject {
        order: Unsigned8, WriteOnly, ORDER;
        state: Unsigned8, ReadOnly, STATE;
        every: Unsigned16, ReadWrite, EVERY;
        rows_before: Unsigned16, ReadWrite, ROWS_BEFORE;
        trigger_signal: Unsigned8, ReadWrite, TRIGGER_SIGNAL;
        trigger_level: Real32, ReadWrite, TRIGGER_LEVEL;
        is_falling: Unsigned8, ReadWrite, IS_FALLING;
        memory_values: Unsigned16, ReadOnly, MEMORY_VALUES;
        rows: Unsigned16, ReadOnly, ROWS;
        trigger_row: Unsigned16, ReadOnly, TRIGGER_ROW;
        data: Domain, ReadOnly, DATA;
    }
}
