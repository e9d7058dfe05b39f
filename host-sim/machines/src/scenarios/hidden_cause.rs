//! The effects that can be hidden, each with its name, unit, column and size range.

macro_rules! hidden_causes {
    ($($(#[$about:meta])* $cause:ident = $name:literal, $unit:literal, $column:expr, $bounds:expr;)*) => {
        /// A physical effect that the plain LuGre model does not contain.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum HiddenCause {
            $($(#[$about])* $cause,)*
        }

        impl HiddenCause {
            /// All effects, those of the catalogue first.
            pub const ALL: [HiddenCause; [$($name),*].len()] = [$(HiddenCause::$cause),*];

            /// Returns the name of the cause in the catalogue.
            pub const fn name(self) -> &'static str {
                match self { $(HiddenCause::$cause => $name,)* }
            }

            /// Returns the unit of the size.
            pub const fn unit(self) -> &'static str {
                match self { $(HiddenCause::$cause => $unit,)* }
            }

            /// Returns the log column that the effect depends on.
            pub const fn column(self) -> Option<&'static str> {
                match self { $(HiddenCause::$cause => $column,)* }
            }

            /// Returns the smallest and largest size that the user can request.
            pub const fn bounds(self) -> (f64, f64) {
                match self { $(HiddenCause::$cause => $bounds,)* }
            }
        }
    };
}

hidden_causes! {
    /// Side load raises both levels, Nm/N.
    RadialForceCoulomb = "radial-force-coulomb", "Nm/N", Some("radial_force_n"), (0.0, 0.1);
    /// A change of the side load deflects the bristles, rad/N.
    RadialForceRate = "radial-force-rate", "rad/N", Some("radial_force_n"), (0.0, 1e-3);
    /// Pressure raises both levels, Nm/Pa.
    PressureCoulomb = "pressure-coulomb", "Nm/Pa", Some("pressure_diff_pa"), (0.0, 1e-4);
    /// Viscosity falls with temperature, 1/K.
    TemperatureViscous = "temperature-viscous", "1/K", Some("temperature_c"), (0.0, 0.2);
    /// The level varies with the shaft angle; relative amplitude, 1.
    PositionRipple = "position-ripple", "1", Some("position_rad"), (0.0, 0.9);
    /// A torque that varies with the angle once per turn, Nm.
    GravityImbalance = "gravity-imbalance", "Nm", Some("position_rad"), (0.0, 10.0);
    /// Level and viscosity depend on the direction; relative difference, 1.
    DirectionAsymmetry = "direction-asymmetry", "1", Some("velocity_rad_s"), (-0.9, 0.9);
    /// A constant torque, Nm.
    TorqueOffset = "torque-offset", "Nm", None, (-10.0, 10.0);
    /// Water drag, Nm s^2/rad^2.
    QuadraticDrag = "quadratic-drag", "Nm s^2/rad^2", Some("velocity_rad_s"), (0.0, 0.1);
    /// The static level grows with the logarithm of the rest time, Nm per e-fold.
    DwellTimeStatic = "dwell-time-static", "Nm", Some("velocity_rad_s"), (0.0, 5.0);
    /// The level changes over the campaign; relative change from the first to the last run.
    TimeDrift = "time-drift", "1", Some("time_s"), (-0.9, 5.0);
    /// Transmitted torque raises both levels, Nm/Nm.
    LoadTorqueCoulomb = "load-torque-coulomb", "Nm/Nm", Some("load_torque_nm"), (0.0, 1.0);
    /// An inertia in the torque column, kg m^2.
    UnmodelledInertia = "unmodelled-inertia", "kg m^2", Some("acceleration_rad_s2"), (-1.0, 1.0);
    /// Backlash of the drive, rad.
    Backlash = "backlash", "rad", Some("velocity_rad_s"), (0.0, 0.1);
    /// The exponent of the Stribeck curve; 2 is LuGre.
    StribeckShape = "stribeck-shape", "1", Some("velocity_rad_s"), (0.3, 8.0);
    /// The torque is logged later than the velocity, s.
    ChannelDelay = "channel-delay", "s", Some("velocity_rad_s"), (0.0, 0.1);
    /// An additive torque with several orders of the angle; amplitude of the first, Nm.
    TorqueRipple = "torque-ripple", "Nm", Some("position_rad"), (0.0, 10.0);
    /// The level falls with temperature, 1/K.
    TemperatureCoulomb = "temperature-coulomb", "1/K", Some("temperature_c"), (0.0, 0.2);
    /// The level falls with the stored friction heat; share of the level, 1.
    WarmUp = "warm-up", "1", Some("velocity_rad_s"), (0.0, 0.9);
    /// An effect that no cause of the catalogue describes.
    OutsideCatalogue = "unknown", "1", None, (0.0, 0.0);
}

impl HiddenCause {
    /// Returns the effect with this name.
    pub fn parse(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|effect| effect.name() == name)
    }

    /// Returns the size without an effect.
    pub const fn neutral(self) -> f64 {
        match self {
            HiddenCause::StribeckShape => 2.0,
            _ => 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parse_of_each_name_returns_its_effect() {
        for effect in HiddenCause::ALL {
            assert_eq!(HiddenCause::parse(effect.name()), Some(effect));
        }
        assert_eq!(HiddenCause::parse("none"), None);
        assert_eq!(HiddenCause::parse(""), None);
    }

    #[test]
    fn bounds_of_each_effect_contain_the_neutral_size() {
        for effect in HiddenCause::ALL {
            let (least, most) = effect.bounds();
            assert!((least..=most).contains(&effect.neutral()), "{}", effect.name());
        }
    }
}
