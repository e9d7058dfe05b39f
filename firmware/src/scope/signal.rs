//! The signals of the current loop that a scope can record, in one table.

use crate::control::{CycleResult, StageSample};

macro_rules! signals {
    ($($number:literal $name:ident $(#[$doc:meta])* |$sample:ident, $cycle:ident| $value:expr;)*) => {
        /// A signal, by its number.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub struct Signal(u8);

        impl Signal {
            /// Numbers and names of all signals, in ascending order.
            pub const ALL: &'static [(u8, &'static str)] = &[$(($number, stringify!($name))),*];

            /// Returns the signal with this number.
            pub fn from_number(number: u8) -> Option<Self> {
                matches!(number, $($number)|*).then_some(Self(number))
            }

            /// Returns the signal with this name.
            pub fn from_name(name: &str) -> Option<Self> {
                Self::ALL.iter().find(|(_, known)| *known == name).map(|(number, _)| Self(*number))
            }

            /// Returns the number of the signal.
            pub const fn number(self) -> u8 {
                self.0
            }

            /// Returns the name of the signal, with its unit.
            pub fn name(self) -> &'static str {
                let found = Self::ALL.iter().find(|(number, _)| *number == self.0);
                found.map_or("", |(_, name)| *name)
            }
        }

        /// Returns the value of a signal in a period; NaN for a number without signal.
        #[inline(always)]
        pub(crate) fn value(number: u8, sample: &StageSample, cycle: &CycleResult) -> f32 {
            match number {
                $($number => { let ($sample, $cycle) = (sample, cycle); $value })*
                _ => f32::NAN,
            }
        }
    };
}

// The names are those of a log's columns where a log has them.
signals! {
    1 current_a |_s, c| c.current_q_a;
    2 current_d_a |_s, c| c.current_d_a;
    3 current_reference_a |_s, c| c.current_reference_a;
    4 voltage_d_v |_s, c| c.voltage_v[0];
    5 voltage_q_v |_s, c| c.voltage_v[1];
    6 bus_voltage_v |s, _c| s.bus_v;
    7 phase_a_a |s, _c| s.currents_a[0];
    8 phase_b_a |s, _c| s.currents_a[1];
    9 velocity_rad_s |_s, c| c.velocity_rad_s;
    10 position_rad |_s, c| c.position_rad;
    11 torque_nm |_s, c| c.motor_torque_nm;
    12 friction_torque_nm |_s, c| c.friction_torque_nm;
    13 feed_forward_current_a |_s, c| c.feed_forward_current_a;
    14 residual_torque_nm |_s, c| c.residual_torque_nm;
}
