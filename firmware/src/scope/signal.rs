//! The signals of the current loop that a scope can record, in one table.

use crate::driver::PeriodValues;

macro_rules! signals {
    ($($number:literal $name:ident |$values:ident| $value:expr;)*) => {
        /// A signal, by its number.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub struct Signal(u8);

        impl Signal {
            /// Numbers and names of all signals, in ascending order.
            pub const ALL: &'static [(u8, &'static str)] = &[$(($number, stringify!($name))),*];

            /// Returns the signal with this number.
            pub fn from_number(number: u8) -> Option<Self> {
                [$($number),*].contains(&number).then_some(Self(number))
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
        pub(crate) fn value(number: u8, period: &PeriodValues) -> f32 {
            // Numbers count from 1. An array in RAM, because a table of jumps would be read from flash.
            let values = [$({ let $values = period; $value }),*];
            values.get(usize::from(number).wrapping_sub(1)).copied().unwrap_or(f32::NAN)
        }
    };
}

// The names are those of a log's columns where a log has them.
signals! {
    1 current_a |v| v.current_a;
    2 current_d_a |v| v.current_d_a;
    3 current_reference_a |v| v.current_reference_a;
    4 voltage_q_v |v| v.voltage_q_v;
    5 bus_voltage_v |v| v.bus_voltage_v;
    6 phase_a_a |v| v.phase_currents_a[0];
    7 phase_b_a |v| v.phase_currents_a[1];
    8 phase_c_a |v| v.phase_currents_a[2];
    9 velocity_rad_s |v| v.velocity_rad_s;
    10 position_rad |v| v.turned_rad;
    11 torque_nm |v| v.motor_torque_nm;
    12 friction_torque_nm |v| v.friction_torque_nm;
    13 feed_forward_current_a |v| v.feed_forward_current_a;
    14 residual_torque_nm |v| v.residual_torque_nm;
    15 level_gain |v| v.level_gain;
}
