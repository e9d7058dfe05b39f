//! The table of quantities. Other macros generate code from its rows.

/// Passes the table to a macro. A row contains these items, in this order:
///
/// * `label`: the name on an axis.
/// * `names` and `units`: the log column and its unit, for a revolute and for a prismatic joint.
/// * `scale`: the internal unit divided by the column's unit, and the inverse.
/// * `flags`: the flags for an invalid reading and for one that is too old.
/// * `sample`: the field of [`Sample`](crate::Sample), if a model reads the quantity.
/// * `input`: the field of [`Inputs`](crate::Inputs), if the reading comes from the joint's encoder.
///   `covariate`: the same field, if the reading comes from another sensor or from the bus.
/// * `column`: the column number for the lookup-table term. Records contain it, so it must not change.
/// * `guard`: present for a covariate that only terms read. It gives the field that holds the last valid value, the
///   valid range, and how the value fades when it is too old (`Fade`). The range is a limit of the
///   [`Envelope`](crate::Envelope) on either side of 0, or a range in the internal unit.
#[macro_export]
macro_rules! quantity_table {
    ($use:ident) => {
        $use! {
            /// Signed velocity of the joint.
            Velocity {
                label: "velocity",
                names: ["velocity_rad_s", "velocity_m_s"], units: ["rad/s", "m/s"], scale: [1.0, 1.0],
                flags: [VELOCITY_INVALID, VELOCITY_INVALID],
                /// Joint velocity, rad/s.
                sample: velocity_rad_s, input: velocity_rad_s, column: 0,
            }
            /// Position of the joint: angle or travel.
            Position {
                label: "position",
                names: ["position_rad", "position_m"], units: ["rad", "m"], scale: [1.0, 1.0],
                flags: [POSITION_INVALID, POSITION_STALE],
                /// Joint position, rad.
                sample: position_rad, input: position_rad, column: 1,
                guard: [position, envelope position_max_rad, Fade::Apart],
            }
            /// Time since the start of the campaign, or of the seal's life.
            CampaignTime {
                label: "campaign time",
                names: ["time_s", "time_s"], units: ["s", "s"], scale: [1.0 / 3600.0, 3600.0],
                flags: [CAMPAIGN_TIME_INVALID, CAMPAIGN_TIME_INVALID],
                /// Time since the start of the campaign, or of the seal's life, h.
                sample: campaign_time_h, column: 2,
            }
            /// Side load on the shaft at the seal's end.
            RadialForce {
                label: "side load",
                names: ["radial_force_n", "radial_force_n"], units: ["N", "N"], scale: [1.0, 1.0],
                flags: [RADIAL_FORCE_INVALID, RADIAL_FORCE_STALE],
                /// Side load on the shaft at the seal's end, N.
                sample: radial_force_n, covariate: radial_force_n, column: 3,
            }
            /// Outside minus inside pressure.
            Pressure {
                label: "pressure difference",
                names: ["pressure_diff_pa", "pressure_diff_pa"], units: ["Pa", "Pa"], scale: [1e-6, 1e6],
                flags: [PRESSURE_INVALID, PRESSURE_STALE],
                /// Outside minus inside pressure, MPa.
                sample: pressure_diff_mpa, covariate: pressure_diff_mpa, column: 4,
            }
            /// Temperature of the seal.
            Temperature {
                label: "temperature",
                names: ["temperature_c", "temperature_c"], units: ["°C", "°C"], scale: [1.0, 1.0],
                flags: [TEMPERATURE_INVALID, TEMPERATURE_STALE],
                /// Temperature of the seal, deg C.
                sample: temperature_c, covariate: temperature_c, column: 5,
                guard: [temperature, range TEMPERATURE_RANGE_C, Fade::ToReference],
            }
            /// Torque transmitted to the load.
            LoadTorque {
                label: "load torque",
                names: ["load_torque_nm", "load_torque_nm"], units: ["Nm", "Nm"], scale: [1.0, 1.0],
                flags: [LOAD_TORQUE_INVALID, LOAD_TORQUE_STALE],
                /// Torque transmitted to the load, Nm.
                sample: load_torque_nm, covariate: load_torque_nm, column: 6,
                guard: [load_torque, envelope load_torque_max_nm, Fade::ToZero],
            }
            /// An additional covariate of this joint, in its own unit.
            Auxiliary {
                label: "auxiliary",
                names: ["auxiliary", "auxiliary"], units: ["", ""], scale: [1.0, 1.0],
                flags: [AUXILIARY_INVALID, AUXILIARY_STALE],
                /// An additional covariate of this joint, in its own unit.
                sample: auxiliary, covariate: auxiliary, column: 7,
                guard: [auxiliary, range AUXILIARY_RANGE, Fade::Apart],
            }
            /// Acceleration of the joint.
            Acceleration {
                label: "acceleration",
                names: ["acceleration_rad_s2", "acceleration_m_s2"], units: ["rad/s2", "m/s2"],
                scale: [1.0, 1.0],
                flags: [ACCELERATION_INVALID, ACCELERATION_STALE],
                /// Joint acceleration, rad/s^2.
                sample: acceleration_rad_s2, input: acceleration_rad_s2,
                guard: [acceleration, envelope acceleration_max_rad_s2, Fade::ToZero],
            }
            /// The measured torque. A model predicts it and never reads it.
            Torque {
                label: "torque",
                names: ["torque_nm", "force_n"], units: ["Nm", "N"], scale: [1.0, 1.0],
            }
        }
    };
}
