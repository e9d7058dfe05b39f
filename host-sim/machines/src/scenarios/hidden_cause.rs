//! The effects that can be hidden, each with its name, its unit and what sizes it may have.

/// A physical effect that plain LuGre does not know.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum HiddenCause {
    /// Side load raises both levels, Nm/N.
    RadialForceCoulomb,
    /// Changing side load bends the bristles, rad/N.
    RadialForceRate,
    /// Pressure raises both levels, Nm/Pa.
    PressureCoulomb,
    /// Viscosity falls with temperature, 1/K.
    TemperatureViscous,
    /// The level follows the shaft angle, amplitude 1.
    PositionRipple,
    /// A torque of the angle, Nm.
    GravityImbalance,
    /// Level and viscosity differ by direction, 1.
    DirectionAsymmetry,
    /// A constant torque, Nm.
    TorqueOffset,
    /// Water drag, Nm s^2/rad^2.
    QuadraticDrag,
    /// The static level grows with rest, Nm per e-fold.
    DwellTimeStatic,
    /// The level changes over the campaign; relative change from its beginning to its end.
    TimeDrift,
    /// Transmitted torque raises both levels, Nm/Nm.
    LoadTorqueCoulomb,
    /// An inertia in the torque column, kg m^2.
    UnmodelledInertia,
    /// Play in the drive, rad.
    Backlash,
    /// The exponent of the Stribeck curve; 2 is LuGre.
    StribeckShape,
    /// Torque is logged later than velocity, s.
    ChannelDelay,
    /// An additive torque of the angle, several orders, Nm of the strongest.
    TorqueRipple,
    /// The level rises as it gets colder, 1/K.
    TemperatureCoulomb,
    /// The level falls with the heat that rubbing leaves; share of the level.
    WarmUp,
    /// Structure that no cause of the catalogue has.
    OutsideCatalogue,
}

/// What is fixed for each effect.
struct Facts {
    name: &'static str,
    unit: &'static str,
    column: Option<&'static str>,
    /// Bounds of a size given by hand.
    least: f64,
    most: f64,
}

const fn facts(
    name: &'static str,
    unit: &'static str,
    column: Option<&'static str>,
    least: f64,
    most: f64,
) -> Facts {
    Facts { name, unit, column, least, most }
}

impl HiddenCause {
    /// Every effect, those of the catalogue first.
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

    const fn facts(self) -> Facts {
        let velocity = Some("velocity_rad_s");
        let position = Some("position_rad");
        let force = Some("radial_force_n");
        match self {
            HiddenCause::RadialForceCoulomb => {
                facts("radial-force-coulomb", "Nm/N", force, 0.0, 0.1)
            }
            HiddenCause::RadialForceRate => facts("radial-force-rate", "rad/N", force, 0.0, 1e-3),
            HiddenCause::PressureCoulomb => {
                facts("pressure-coulomb", "Nm/Pa", Some("pressure_diff_pa"), 0.0, 1e-4)
            }
            HiddenCause::TemperatureViscous => {
                facts("temperature-viscous", "1/K", Some("temperature_c"), 0.0, 0.2)
            }
            HiddenCause::PositionRipple => facts("position-ripple", "1", position, 0.0, 0.9),
            HiddenCause::GravityImbalance => facts("gravity-imbalance", "Nm", position, 0.0, 10.0),
            HiddenCause::DirectionAsymmetry => {
                facts("direction-asymmetry", "1", velocity, -0.9, 0.9)
            }
            HiddenCause::TorqueOffset => facts("torque-offset", "Nm", None, -10.0, 10.0),
            HiddenCause::QuadraticDrag => {
                facts("quadratic-drag", "Nm s^2/rad^2", velocity, 0.0, 0.1)
            }
            HiddenCause::DwellTimeStatic => facts("dwell-time-static", "Nm", velocity, 0.0, 5.0),
            HiddenCause::TimeDrift => facts("time-drift", "1", Some("time_s"), -0.9, 5.0),
            HiddenCause::LoadTorqueCoulomb => {
                facts("load-torque-coulomb", "Nm/Nm", Some("load_torque_nm"), 0.0, 1.0)
            }
            HiddenCause::UnmodelledInertia => {
                facts("unmodelled-inertia", "kg m^2", Some("acceleration_rad_s2"), -1.0, 1.0)
            }
            HiddenCause::Backlash => facts("backlash", "rad", velocity, 0.0, 0.1),
            HiddenCause::StribeckShape => facts("stribeck-shape", "1", velocity, 0.3, 8.0),
            HiddenCause::ChannelDelay => facts("channel-delay", "s", velocity, 0.0, 0.1),
            HiddenCause::TorqueRipple => facts("torque-ripple", "Nm", position, 0.0, 10.0),
            HiddenCause::TemperatureCoulomb => {
                facts("temperature-coulomb", "1/K", Some("temperature_c"), 0.0, 0.2)
            }
            HiddenCause::WarmUp => facts("warm-up", "1", velocity, 0.0, 0.9),
            HiddenCause::OutsideCatalogue => facts("unknown", "1", None, 0.0, 0.0),
        }
    }

    /// The name of the cause, as the catalogue writes it.
    pub const fn name(self) -> &'static str {
        self.facts().name
    }

    /// The effect of a cause.
    pub fn parse(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|effect| effect.name() == name)
    }

    /// The unit of its size.
    pub const fn unit(self) -> &'static str {
        self.facts().unit
    }

    /// The column it follows, by its name in a log.
    pub const fn column(self) -> Option<&'static str> {
        self.facts().column
    }

    /// Smallest and largest size that may be asked for.
    pub const fn bounds(self) -> (f64, f64) {
        let facts = self.facts();
        (facts.least, facts.most)
    }

    /// The size at which nothing acts.
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
    fn names_are_distinct_and_read_back() {
        for effect in HiddenCause::ALL {
            assert_eq!(HiddenCause::parse(effect.name()), Some(effect));
        }
        assert_eq!(HiddenCause::parse("none"), None);
        assert_eq!(HiddenCause::parse(""), None);
    }

    #[test]
    fn the_neutral_size_may_be_asked_for() {
        for effect in HiddenCause::ALL {
            let (least, most) = effect.bounds();
            assert!((least..=most).contains(&effect.neutral()), "{}", effect.name());
        }
    }
}
