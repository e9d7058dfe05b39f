//! The rows of the table of quantities, for whoever makes something of each.

/// Hands the table to a macro. A row says, in this order:
///
/// * `label`, `names` and `units`: what it is called on an axis, its column in a log and its unit, of a
///   joint that turns and of one that slides; `scale`: the unit inside over that unit, and the inverse.
/// * `flags`: how the compensator says that a reading is wrong, and that it is too old.
/// * `sample`: its field of a [`Sample`](super::Sample), where a model reads it; `input`: the same of
///   [`Inputs`](super::Inputs), where the compensator takes a reading of it.
/// * `column`: its number for the lookup-table term, which records hold: none may ever change.
/// * `guard`: for a covariate that terms alone read, where the compensator keeps its last good value; the
///   field of the [`Envelope`](crate::Envelope) it lies within on either side of 0, or the range
///   in its own unit inside; and what becomes of it when it is too old (`Fade`).
macro_rules! quantity_table {
    ($use:ident) => {
        $use! {
            /// How fast the joint moves, with its sign.
            Velocity {
                label: "velocity",
                names: ["velocity_rad_s", "velocity_m_s"], units: ["rad/s", "m/s"], scale: [1.0, 1.0],
                flags: [VELOCITY_INVALID, VELOCITY_INVALID],
                /// Joint velocity, rad/s.
                sample: velocity_rad_s, input: velocity_rad_s, column: 0,
            }
            /// How far the joint has turned or slid.
            Position {
                label: "position",
                names: ["position_rad", "position_m"], units: ["rad", "m"], scale: [1.0, 1.0],
                flags: [POSITION_INVALID, POSITION_STALE],
                /// Joint position, rad.
                sample: position_rad, input: position_rad, column: 1,
                guard: [position, envelope position_max_rad, Fade::Apart],
            }
            /// Time since the campaign (or the seal's life) began.
            CampaignTime {
                label: "campaign time",
                names: ["time_s", "time_s"], units: ["s", "s"], scale: [1.0 / 3600.0, 3600.0],
                flags: [CAMPAIGN_TIME_INVALID, CAMPAIGN_TIME_INVALID],
                /// Time since the campaign (or the seal's life) began, h.
                sample: campaign_time_h, column: 2,
            }
            /// Side load on the shaft at the seal's end.
            RadialForce {
                label: "side load",
                names: ["radial_force_n", "radial_force_n"], units: ["N", "N"], scale: [1.0, 1.0],
                flags: [RADIAL_FORCE_INVALID, RADIAL_FORCE_STALE],
                /// Side load on the shaft at the seal's end, N.
                sample: radial_force_n, input: radial_force_n, column: 3,
            }
            /// Outside minus inside pressure.
            Pressure {
                label: "pressure difference",
                names: ["pressure_diff_pa", "pressure_diff_pa"], units: ["Pa", "Pa"], scale: [1e-6, 1e6],
                flags: [PRESSURE_INVALID, PRESSURE_STALE],
                /// Outside minus inside pressure, MPa.
                sample: pressure_diff_mpa, input: pressure_diff_mpa, column: 4,
            }
            /// Temperature of the seal.
            Temperature {
                label: "temperature",
                names: ["temperature_c", "temperature_c"], units: ["°C", "°C"], scale: [1.0, 1.0],
                flags: [TEMPERATURE_INVALID, TEMPERATURE_STALE],
                /// Temperature of the seal, deg C.
                sample: temperature_c, input: temperature_c, column: 5,
                guard: [temperature, range TEMPERATURE_RANGE_C, Fade::ToReference],
            }
            /// Torque transmitted to the load.
            LoadTorque {
                label: "load torque",
                names: ["load_torque_nm", "load_torque_nm"], units: ["Nm", "Nm"], scale: [1.0, 1.0],
                flags: [LOAD_TORQUE_INVALID, LOAD_TORQUE_STALE],
                /// Torque transmitted to the load, Nm.
                sample: load_torque_nm, input: load_torque_nm, column: 6,
                guard: [load_torque, envelope load_torque_max_nm, Fade::ToZero],
            }
            /// A covariate that a joint has of its own, in that one's unit.
            Auxiliary {
                label: "auxiliary",
                names: ["auxiliary", "auxiliary"], units: ["", ""], scale: [1.0, 1.0],
                flags: [AUXILIARY_INVALID, AUXILIARY_STALE],
                /// A covariate of this joint's own, in its own unit.
                sample: auxiliary, input: auxiliary, column: 7,
                guard: [auxiliary, range AUXILIARY_RANGE, Fade::Apart],
            }
            /// How fast the velocity changes.
            Acceleration {
                label: "acceleration",
                names: ["acceleration_rad_s2", "acceleration_m_s2"], units: ["rad/s2", "m/s2"],
                scale: [1.0, 1.0],
                flags: [ACCELERATION_INVALID, ACCELERATION_STALE],
                /// Joint acceleration, rad/s^2.
                sample: acceleration_rad_s2, input: acceleration_rad_s2,
                guard: [acceleration, envelope acceleration_max_rad_s2, Fade::ToZero],
            }
            /// The measured torque, which a model explains and none reads.
            Torque {
                label: "torque",
                names: ["torque_nm", "force_n"], units: ["Nm", "N"], scale: [1.0, 1.0],
            }
        }
    };
}

pub(crate) use quantity_table;
