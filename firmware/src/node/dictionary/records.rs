//! Objects of several values: each entry with its name, type and access, and the place of its value.
//!
//! The macro `record` makes of one list both what a tool sees, [`Entry`] by entry, and a struct that the driver
//! fills by name and never by position. A new entry is a row here; the compiler then asks for its value.
//! Entries that are written, or sent in process frames, have a constant for their sub-index as well.

/// Type of a value, by its number in CiA 301.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum DataType {
    /// Eight bits with a sign.
    Integer8 = 0x02,
    /// Sixteen bits with a sign.
    Integer16 = 0x03,
    /// Thirty-two bits with a sign.
    Integer32 = 0x04,
    /// Eight bits.
    Unsigned8 = 0x05,
    /// Sixteen bits.
    Unsigned16 = 0x06,
    /// Thirty-two bits.
    Unsigned32 = 0x07,
    /// `f32`.
    Real32 = 0x08,
    /// Text.
    VisibleString = 0x09,
    /// Bytes.
    Domain = 0x0F,
}

impl DataType {
    /// Length in bytes; `None` where it varies.
    pub const fn length(self) -> Option<usize> {
        match self {
            Self::Unsigned8 | Self::Integer8 => Some(1),
            Self::Unsigned16 | Self::Integer16 => Some(2),
            Self::Unsigned32 | Self::Integer32 | Self::Real32 => Some(4),
            Self::VisibleString | Self::Domain => None,
        }
    }
}

/// Who may do what.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Never changes.
    Const,
    /// The driver changes it.
    ReadOnly,
    /// A tool may write it.
    ReadWrite,
    /// A tool may write it, and a process frame does: what a receive PDO is mapped to must be writable.
    Input,
    /// A tool may write it; there is nothing to read.
    WriteOnly,
}

/// One value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Entry {
    /// Name, in the words of the rest of the project; empty on a board.
    pub name: &'static str,
    /// Its type.
    pub data: DataType,
    /// Who may do what.
    pub access: Access,
}

pub(super) const fn entry(name: &'static str, data: DataType, access: Access) -> Entry {
    Entry { name: kept(name), data, access }
}

/// A name as the dictionary has it: nothing in a driver's image, where nobody asks for it. Tools know the names from
/// their own copy of this dictionary or from `joint.eds`.
pub(super) const fn kept(name: &'static str) -> &'static str {
    if cfg!(target_os = "none") { "" } else { name }
}

/// The sub-index of an entry; a name that is not there does not compile where the result is a constant.
const fn sub_index(names: &[&str], name: &str) -> u8 {
    let mut place = 0;
    while place < names.len() {
        if is_same(names[place].as_bytes(), name.as_bytes()) {
            return place as u8 + 1;
        }
        place += 1;
    }
    panic!("no entry of this name")
}

const fn is_same(a: &[u8], b: &[u8]) -> bool {
    let mut place = 0;
    while place < a.len() && place < b.len() && a[place] == b[place] {
        place += 1;
    }
    place == a.len() && place == b.len()
}

macro_rules! record {
    ($(#[$doc:meta])* $record:ident {
        $($field:ident: $data:ident, $access:ident $(, $AT:ident)?;)*
    }) => {
        $(#[$doc])*
        ///
        /// Values are words; a float is its bits.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
        #[allow(missing_docs)]
        pub struct $record { $(pub $field: u32),* }

        #[allow(missing_docs)]
        impl $record {
            /// The entries, from sub-index 1 on.
            pub const ENTRIES: &'static [Entry] =
                &[$(entry(stringify!($field), DataType::$data, Access::$access)),*];

            #[allow(dead_code)] // A record whose places nobody asks for by name.
            const NAMES: &'static [&'static str] = &[$(stringify!($field)),*];

            $($(pub const $AT: u8 = sub_index(Self::NAMES, stringify!($field));)?)*

            /// The values, in the order of the entries.
            pub const fn words(&self) -> [u32; Self::ENTRIES.len()] {
                [$(self.$field),*]
            }
        }
    };
}

record! {
    /// Who the device is.
    Identity {
        vendor_id: Unsigned32, Const;
        product_code: Unsigned32, Const;
        revision_number: Unsigned32, Const;
        serial_number: Unsigned32, Const;
    }
}

record! {
    /// Identifiers of the server of objects.
    SdoServer {
        client_to_server: Unsigned32, Const;
        server_to_client: Unsigned32, Const;
    }
}

record! {
    /// Identifier of a PDO, and how it travels.
    Pdo {
        cob_id: Unsigned32, Const;
        transmission_type: Unsigned8, Const;
    }
}

record! {
    /// Identifier of a transmit PDO, which a master may change, and how it travels.
    TransmitPdo {
        cob_id: Unsigned32, ReadWrite;
        transmission_type: Unsigned8, Const;
    }
}

record! {
    /// What a trace says of the samples that follow.
    Trace {
        run: Unsigned32, ReadWrite, RUN;
        sequence: Unsigned32, ReadWrite, SEQUENCE;
        joint_kind: Unsigned32, ReadWrite, JOINT_KIND;
    }
}

record! {
    /// How the driver takes part in the bus.
    Operation {
        source: Unsigned8, ReadWrite, SOURCE;
        number: Unsigned8, ReadWrite, NUMBER;
        period_s: Real32, ReadWrite, PERIOD_S;
        campaign_h: Real32, ReadWrite, CAMPAIGN_H;
        telemetry_every: Unsigned8, ReadWrite, TELEMETRY_EVERY;
        node: Unsigned8, ReadWrite, NODE;
        bit_rate_kbit: Unsigned16, ReadWrite;
    }
}

record! {
    /// The state machine.
    State {
        request: Unsigned8, WriteOnly, REQUEST;
        state: Unsigned8, ReadOnly;
        faults: Unsigned32, ReadOnly;
        limits: Unsigned32, ReadOnly;
        blocking_codes: Unsigned32, ReadOnly;
        set_position_rad: Real32, WriteOnly;
    }
}

record! {
    /// What last came in process frames. Written as an object it counts as if it had come in its frame.
    Inputs {
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

impl Inputs {
    /// Sets the entry at a sub-index; gives both words of its frame, which is every two entries.
    pub fn set(&mut self, sub_index: u8, word: u32) -> Option<[u32; 2]> {
        let pairs = [
            [&mut self.velocity_rad_s, &mut self.position_rad],
            [&mut self.torque_nm, &mut self.load_torque_nm],
            [&mut self.radial_force_n, &mut self.pressure_diff_pa],
            [&mut self.temperature_c, &mut self.auxiliary],
            [&mut self.command_current_a, &mut self.command_velocity_and_counter],
        ];
        let place = usize::from(sub_index.checked_sub(1)?);
        let [first, second] = pairs.into_iter().nth(place / 2)?;
        *(if place % 2 == 0 { &mut *first } else { &mut *second }) = word;
        Some([*first, *second])
    }
}

record! {
    /// What was last answered in process frames.
    Outputs {
        friction_torque_nm: Real32, ReadOnly, FRICTION_TORQUE;
        feed_forward_current_a: Real32, ReadOnly, FEED_FORWARD_CURRENT;
        flags: Unsigned32, ReadOnly, FLAGS;
        sequence: Unsigned32, ReadOnly, SEQUENCE;
        current_a: Real32, ReadOnly, CURRENT;
        residual_torque_nm: Real32, ReadOnly, RESIDUAL_TORQUE;
    }
}

record! {
    /// What the joint last measured of itself; one in HIL, what it was told.
    Measured {
        velocity_rad_s: Real32, ReadOnly, VELOCITY;
        position_rad: Real32, ReadOnly, POSITION;
        torque_nm: Real32, ReadOnly, TORQUE;
        load_torque_nm: Real32, ReadOnly, LOAD_TORQUE;
    }
}

record! {
    /// Whether the model keeps its promise.
    WatchState {
        in_band: Unsigned8, ReadOnly;
        windows: Unsigned32, ReadOnly;
        windows_out_of_band: Unsigned32, ReadOnly;
        alarms: Unsigned32, ReadOnly;
        largest_in_bands: Real32, ReadOnly;
    }
}

record! {
    /// The network that supplies the law, where there is one: the guard of its inputs, and its factors.
    NetworkState {
        present: Unsigned8, ReadOnly, PRESENT;
        outside: Unsigned8, ReadOnly, OUTSIDE;
        outside_count: Unsigned32, ReadOnly, OUTSIDE_COUNT;
        share: Real32, ReadOnly, SHARE;
        coulomb_factor: Real32, ReadOnly, COULOMB_FACTOR;
        static_factor: Real32, ReadOnly, STATIC_FACTOR;
        stiffness_factor: Real32, ReadOnly, STIFFNESS_FACTOR;
    }
}

record! {
    /// The staged parameter set, and what takes it.
    Commit {
        active_crc: Unsigned32, ReadOnly;
        staged_crc: Unsigned32, ReadOnly;
        commit: Unsigned32, WriteOnly, COMMIT;
        discard: Unsigned8, WriteOnly, DISCARD;
        friction_record: Domain, ReadWrite, FRICTION_RECORD;
        drive_record: Domain, ReadWrite, DRIVE_RECORD;
        network_record: Domain, ReadWrite, NETWORK_RECORD;
    }
}

record! {
    /// Whether the joint is wired as its parameters say: confirmed by writing back the CRC of the wiring in use.
    Commissioning {
        commissioned: Unsigned8, ReadOnly;
        wiring_crc: Unsigned32, ReadOnly, WIRING_CRC;
        confirm: Unsigned32, WriteOnly, CONFIRM;
    }
}

record! {
    /// The driver finds out by itself what motor it drives: what it may do, how far it is, what it found.
    CommissioningRun {
        order: Unsigned8, WriteOnly, ORDER;
        current_a: Real32, ReadWrite, CURRENT;
        travel_rad: Real32, ReadWrite, TRAVEL;
        step: Unsigned8, ReadOnly, STEP;
        reason: Unsigned8, ReadOnly, REASON;
        offset_a_a: Real32, ReadOnly, OFFSET_A;
        offset_b_a: Real32, ReadOnly, OFFSET_B;
        resistance_ohm: Real32, ReadOnly, RESISTANCE;
        inductance_d_h: Real32, ReadOnly, INDUCTANCE_D;
        inductance_q_h: Real32, ReadOnly, INDUCTANCE_Q;
        pole_pairs: Unsigned8, ReadOnly, POLE_PAIRS;
        encoder_direction: Integer8, ReadOnly, ENCODER_DIRECTION;
        encoder_offset_rad: Real32, ReadOnly, ENCODER_OFFSET;
        lag_rad: Real32, ReadOnly, LAG;
        torque_constant_nm_per_a: Real32, ReadOnly, TORQUE_CONSTANT;
        friction_torque_nm: Real32, ReadOnly, FRICTION_TORQUE;
        speed_rad_s: Real32, ReadWrite, SPEED;
    }
}

macro_rules! counters {
    ($($(#[$doc:meta])* $name:ident),* $(,)?) => {
        /// What came in and could not be used, and what was lost.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
        pub struct Counters { $($(#[$doc])* pub $name: u32),* }

        /// What the frames and answers are counted as, in the order of their sub-indices.
        pub const FRAME_COUNTERS: &[&str] = &[$(stringify!($name)),*];

        impl Counters {
            /// The counts, in the order of [`FRAME_COUNTERS`].
            pub const fn words(&self) -> [u32; FRAME_COUNTERS.len()] {
                [$(self.$name),*]
            }
        }
    };
}

counters! {
    /// Frames taken in.
    received,
    /// Frames sent.
    sent,
    /// Frames there was no room for.
    not_sent,
    /// Frames of others.
    foreign,
    /// Process frames that came while the node was not operational.
    passed_over,
    /// Frames of ours with too few or too many bytes.
    wrong_length,
    /// Frames of ours whose content is not legal.
    wrong_content,
    /// SYNCs that never came.
    sync_lost,
    /// SYNCs that came twice.
    sync_duplicate,
    /// SYNCs that came after a later one.
    sync_late,
    /// Commands that came twice.
    command_duplicate,
    /// Commands that never came.
    command_lost,
    /// Commands that came after a later one.
    command_late,
    /// Object requests refused.
    sdo_refused,
    /// Times the controller lost what came in.
    receiver_overrun,
    /// Times the controller left the bus.
    bus_off,
}
