//! Objects of CiA 301 and CiA 402.

use super::{Access, DataType, Entry, entry};
use core::mem::offset_of;

record! {
    /// Identity of the device.
    IdentityObject {
        vendor_id: Unsigned32, Const;
        product_code: Unsigned32, Const;
        revision_number: Unsigned32, Const;
        serial_number: Unsigned32, Const;
    }
}

record! {
    /// COB-IDs of the SDO server.
    SdoServerObject {
        client_to_server: Unsigned32, Const;
        server_to_client: Unsigned32, Const;
    }
}

record! {
    /// COB-ID and transmission type of a receive PDO.
    PdoObject {
        cob_id: Unsigned32, ReadWrite;
        transmission_type: Unsigned8, ReadWrite;
    }
}

record! {
    /// COB-ID, transmission type and deadline of the receive PDO with the targets of a CiA 402 master.
    DrivePdoObject {
        cob_id: Unsigned32, ReadWrite;
        transmission_type: Unsigned8, ReadWrite;
        inhibit_time: Unsigned16, Const;
        compatibility_entry: Unsigned8, Const;
        event_timer_ms: Unsigned16, ReadWrite;
    }
}

record! {
    /// COB-ID, transmission type and times of a transmit PDO. Those of a receive PDO have the same sub-indices.
    TransmitPdoObject {
        cob_id: Unsigned32, ReadWrite, COB_ID;
        transmission_type: Unsigned8, ReadWrite, TRANSMISSION_TYPE;
        inhibit_time_100us: Unsigned16, ReadWrite, INHIBIT_TIME [armed];
        compatibility_entry: Unsigned8, Const, COMPATIBILITY_ENTRY;
        event_timer_ms: Unsigned16, ReadWrite, EVENT_TIMER [armed];
        sync_start: Unsigned8, ReadWrite, SYNC_START;
    }
}

record! {
    /// Homing at a stop: torque (thousandths), time, and the largest way (1e-6 rad).
    HomingStopObject {
        torque_permille: Unsigned16, ReadWrite;
        time_ms: Unsigned16, ReadWrite;
        longest_way: Unsigned32, ReadWrite;
    }
}

record! {
    /// Software position limits, 1e-6 rad.
    PositionLimitsObject {
        min_position_limit: Integer32, ReadWrite;
        max_position_limit: Integer32, ReadWrite;
    }
}

record! {
    /// Speeds of homing, 1e-6 rad/s: to the stop, and back.
    HomingSpeedsObject {
        speed_for_switch_search: Unsigned32, ReadWrite;
        speed_for_zero_search: Unsigned32, ReadWrite;
    }
}

record! {
    /// Time between two targets: value, and exponent of ten, s.
    InterpolationTimeObject {
        period: Unsigned8, ReadWrite;
        index: Integer8, ReadWrite;
    }
}

record! {
    /// Position loop: gain in 1e-3 1/s.
    PositionLoopObject {
        gain: Unsigned32, ReadWrite;
    }
}
