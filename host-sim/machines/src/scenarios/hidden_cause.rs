//! The effects that can be hidden, each with its name, unit, column and size range.

/// A physical effect that the plain LuGre model does not contain.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum HiddenCause {
    /// Side load raises both levels, Nm/N.
    RadialForceCoulomb,
    /// A change of the side load deflects the bristles, rad/N.
    RadialForceRate,
    /// Pressure raises both levels, Nm/Pa.
    PressureCoulomb,
    /// Viscosity falls with temperature, 1/K.
    TemperatureViscous,
    /// The level varies with the shaft angle; relative amplitude, 1.
    PositionRipple,
    /// A torque that varies with the angle once per turn, Nm.
    GravityImbalance,
    /// Level and viscosity depend on the direction; relative difference, 1.
    DirectionAsymmetry,
    /// A constant torque, Nm.
    TorqueOffset,
    /// Water drag, Nm s^2/rad^2.
    QuadraticDrag,
    /// The static level grows with the logarithm of the rest time, Nm per e-fold.
    DwellTimeStatic,
    /// The level changes over the campaign; relative change from the first to the last run.
    TimeDrift,
    /// Transmitted torque raises both levels, Nm/Nm.
    LoadTorqueCoulomb,
    /// An inertia in the torque column, kg m^2.
    UnmodelledInertia,
    /// Backlash of the drive, rad.
    Backlash,
    /// The exponent of the Stribeck curve; 2 is LuGre.
    StribeckShape,
    /// The torque is logged later than the velocity, s.
    ChannelDelay,
    /// An additive torque with several orders of the angle; amplitude of the first, Nm.
    TorqueRipple,
    /// The level falls with temperature, 1/K.
    TemperatureCoulomb,
    /// The level falls with the stored friction heat; share of the level, 1.
    WarmUp,
    /// An effect that no cause of the catalogue describes.
    OutsideCatalogue,
}

/// Constant properties of an effect.
struct CauseProperties {
    name: &'static str,
    unit: &'static str,
    column: Option<&'static str>,
    /// Bounds of a size given by the user.
    least: f64,
    most: f64,
}

const fn properties(
    name: &'static str,
    unit: &'static str,
    column: Option<&'static str>,
    least: f64,
    most: f64,
) -> CauseProperties {
    CauseProperties { name, unit, column, least, most }
}

impl HiddenCause {
    /// All effects, those of the catalogue first.
    pub const ALL: [HiddenCause; 20] = [
        HiddenCause::RadialForceCoulomb,
        HiddenCause::RadialForceRate,
        HiddenCause::PressureCoulomb,
        HiddenCause::TemperatureViscous,
        HiddenCause::PositionRipple,
        HiddenCause::GravityImbalance,
        HiddenCause::DirectionAsymmetry,
        HiddenCause::TorqueOffset,
        HiddenCause::QuadraticDrag,
        HiddenCause::DwellTimeStatic,
        HiddenCause::TimeDrift,
        HiddenCause::LoadTorqueCoulomb,
        HiddenCause::UnmodelledInertia,
        HiddenCause::Backlash,
        HiddenCause::StribeckShape,
        HiddenCause::ChannelDelay,
        HiddenCause::TorqueRipple,
        HiddenCause::TemperatureCoulomb,
        HiddenCause::WarmUp,
        HiddenCause::OutsideCatalogue,
    ];

    /// Returns the constant properties of the effect.
    const fn properties(self) -> CauseProperties {
        let velocity = Some("velocity_rad_s");
        let position = Some("position_rad");
        let force = Some("radial_force_n");
        match self {
            HiddenCause::RadialForceCoulomb => {
                properties("radial-force-coulomb", "Nm/N", force, 0.0, 0.1)
            }
            HiddenCause::RadialForceRate => {
                properties("radial-force-rate", "rad/N", force, 0.0, 1e-3)
            }
            HiddenCause::PressureCoulomb => {
                properties("pressure-coulomb", "Nm/Pa", Some("pressure_diff_pa"), 0.0, 1e-4)
            }
            HiddenCause::TemperatureViscous => {
                properties("temperature-viscous", "1/K", Some("temperature_c"), 0.0, 0.2)
            }
            HiddenCause::PositionRipple => properties("position-ripple", "1", position, 0.0, 0.9),
            HiddenCause::GravityImbalance => {
                properties("gravity-imbalance", "Nm", position, 0.0, 10.0)
            }
            HiddenCause::DirectionAsymmetry => {
                properties("direction-asymmetry", "1", velocity, -0.9, 0.9)
            }
            HiddenCause::TorqueOffset => properties("torque-offset", "Nm", None, -10.0, 10.0),
            HiddenCause::QuadraticDrag => {
                properties("quadratic-drag", "Nm s^2/rad^2", velocity, 0.0, 0.1)
            }
            HiddenCause::DwellTimeStatic => {
                properties("dwell-time-static", "Nm", velocity, 0.0, 5.0)
            }
            HiddenCause::TimeDrift => properties("time-drift", "1", Some("time_s"), -0.9, 5.0),
            HiddenCause::LoadTorqueCoulomb => {
                properties("load-torque-coulomb", "Nm/Nm", Some("load_torque_nm"), 0.0, 1.0)
            }
            HiddenCause::UnmodelledInertia => {
                properties("unmodelled-inertia", "kg m^2", Some("acceleration_rad_s2"), -1.0, 1.0)
            }
            HiddenCause::Backlash => properties("backlash", "rad", velocity, 0.0, 0.1),
            HiddenCause::StribeckShape => properties("stribeck-shape", "1", velocity, 0.3, 8.0),
            HiddenCause::ChannelDelay => properties("channel-delay", "s", velocity, 0.0, 0.1),
            HiddenCause::TorqueRipple => properties("torque-ripple", "Nm", position, 0.0, 10.0),
            HiddenCause::TemperatureCoulomb => {
                properties("temperature-coulomb", "1/K", Some("temperature_c"), 0.0, 0.2)
            }
            HiddenCause::WarmUp => properties("warm-up", "1", velocity, 0.0, 0.9),
            HiddenCause::OutsideCatalogue => properties("unknown", "1", None, 0.0, 0.0),
        }
    }

    /// Returns the name of the cause in the catalogue.
    pub const fn name(self) -> &'static str {
        self.properties().name
    }

    /// Returns the effect with this name.
    pub fn parse(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|effect| effect.name() == name)
    }

    /// Returns the unit of the size.
    pub const fn unit(self) -> &'static str {
        self.properties().unit
    }

    /// Returns the log column that the effect depends on.
    pub const fn column(self) -> Option<&'static str> {
        self.properties().column
    }

    /// Returns the smallest and largest size that the user can request.
    pub const fn bounds(self) -> (f64, f64) {
        let properties = self.properties();
        (properties.least, properties.most)
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
