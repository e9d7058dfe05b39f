//! The kinds of scenario, and the benchmark of them.

use super::hidden_cause::HiddenCause;
use super::sampler::mixed;

/// What is hidden in a scenario.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Kind {
    /// Nothing: plain LuGre and noise.
    None,
    /// One effect.
    One(HiddenCause),
    /// Two effects of comparable size.
    Two(HiddenCause, HiddenCause),
    /// One effect whose column moves exactly with another: no data can tell the two apart.
    Confounded,
    /// One effect, and a column that moves nearly with it but does nothing.
    Decoy,
    /// Structure that no cause of the catalogue has.
    Outside,
}

impl Kind {
    /// One word.
    pub const fn name(self) -> &'static str {
        match self {
            Kind::None => "none",
            Kind::One(HiddenCause::OutsideCatalogue) | Kind::Outside => "outside",
            Kind::One(_) => "one",
            Kind::Two(..) => "two",
            Kind::Confounded => "confounded",
            Kind::Decoy => "decoy",
        }
    }
}

/// Pairs that occur together on real joints and that good data can tell apart.
pub const PAIRS: [(HiddenCause, HiddenCause); 16] = [
    (HiddenCause::PressureCoulomb, HiddenCause::RadialForceCoulomb),
    (HiddenCause::PressureCoulomb, HiddenCause::TimeDrift),
    (HiddenCause::RadialForceCoulomb, HiddenCause::PositionRipple),
    (HiddenCause::TemperatureViscous, HiddenCause::PressureCoulomb),
    (HiddenCause::GravityImbalance, HiddenCause::PositionRipple),
    (HiddenCause::TorqueOffset, HiddenCause::TemperatureViscous),
    (HiddenCause::QuadraticDrag, HiddenCause::PressureCoulomb),
    (HiddenCause::UnmodelledInertia, HiddenCause::RadialForceCoulomb),
    (HiddenCause::LoadTorqueCoulomb, HiddenCause::TimeDrift),
    (HiddenCause::Backlash, HiddenCause::PressureCoulomb),
    (HiddenCause::StribeckShape, HiddenCause::RadialForceCoulomb),
    (HiddenCause::ChannelDelay, HiddenCause::TorqueOffset),
    (HiddenCause::DwellTimeStatic, HiddenCause::TimeDrift),
    (HiddenCause::DirectionAsymmetry, HiddenCause::LoadTorqueCoulomb),
    (HiddenCause::QuadraticDrag, HiddenCause::TorqueOffset),
    (HiddenCause::RadialForceRate, HiddenCause::RadialForceCoulomb),
];

/// A benchmark of scenarios to be drawn: `per_kind` of every effect of the catalogue, four times as many
/// without any, and so on. Another base gives other scenarios throughout.
pub fn benchmark(seed_base: u64, per_kind: usize) -> impl Iterator<Item = (Kind, u64)> {
    let times = |kind: Kind, count: usize| std::iter::repeat_n(kind, count);
    let catalogue =
        HiddenCause::ALL.into_iter().filter(|effect| *effect != HiddenCause::OutsideCatalogue);
    let none = times(Kind::None, 4 * per_kind);
    let one = catalogue.flat_map(move |effect| times(Kind::One(effect), per_kind));
    let offset = (mixed(seed_base) % PAIRS.len() as u64) as usize;
    let two = (0..4 * per_kind).map(move |index| {
        let (first, second) = PAIRS[(offset + index) % PAIRS.len()];
        Kind::Two(first, second)
    });
    let rest = times(Kind::Confounded, 2 * per_kind)
        .chain(times(Kind::Decoy, 4 * per_kind))
        .chain(times(Kind::Outside, 5 * per_kind));
    let all = none.chain(one).chain(two).chain(rest);
    all.enumerate().map(move |(index, kind)| (kind, mixed(mixed(seed_base) ^ index as u64)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn a_bank_has_every_kind_and_no_seed_twice() {
        let scenarios: Vec<(Kind, u64)> = benchmark(1, 2).chain(benchmark(2, 2)).collect();
        let seeds: HashSet<u64> = scenarios.iter().map(|(_, seed)| *seed).collect();
        assert_eq!(seeds.len(), scenarios.len());
        for effect in HiddenCause::ALL.into_iter().take(HiddenCause::ALL.len() - 1) {
            assert_eq!(scenarios.iter().filter(|(kind, _)| *kind == Kind::One(effect)).count(), 4);
        }
        for kind in ["none", "one", "two", "confounded", "decoy", "outside"] {
            assert!(scenarios.iter().any(|(known, _)| known.name() == kind), "{kind}");
        }
        assert_eq!(benchmark(7, 0).count(), 0);
    }
}
