//! The kinds of world, and the bank of them.

use super::dice::mixed;
use super::effect::Effect;

/// What is hidden in a world.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Kind {
    /// Nothing: plain LuGre and noise.
    None,
    /// One effect.
    One(Effect),
    /// Two effects of comparable size.
    Two(Effect, Effect),
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
            Kind::One(Effect::OutsideCatalogue) | Kind::Outside => "outside",
            Kind::One(_) => "one",
            Kind::Two(..) => "two",
            Kind::Confounded => "confounded",
            Kind::Decoy => "decoy",
        }
    }
}

/// Pairs that occur together on real joints and that good data can tell apart.
pub const PAIRS: [(Effect, Effect); 16] = [
    (Effect::PressureCoulomb, Effect::RadialForceCoulomb),
    (Effect::PressureCoulomb, Effect::TimeDrift),
    (Effect::RadialForceCoulomb, Effect::PositionRipple),
    (Effect::TemperatureViscous, Effect::PressureCoulomb),
    (Effect::GravityImbalance, Effect::PositionRipple),
    (Effect::TorqueOffset, Effect::TemperatureViscous),
    (Effect::QuadraticDrag, Effect::PressureCoulomb),
    (Effect::UnmodelledInertia, Effect::RadialForceCoulomb),
    (Effect::LoadTorqueCoulomb, Effect::TimeDrift),
    (Effect::Backlash, Effect::PressureCoulomb),
    (Effect::StribeckShape, Effect::RadialForceCoulomb),
    (Effect::ChannelDelay, Effect::TorqueOffset),
    (Effect::DwellTimeStatic, Effect::TimeDrift),
    (Effect::DirectionAsymmetry, Effect::LoadTorqueCoulomb),
    (Effect::QuadraticDrag, Effect::TorqueOffset),
    (Effect::RadialForceRate, Effect::RadialForceCoulomb),
];

/// A bank of worlds to be drawn: `per_kind` of every effect of the catalogue, four times as many
/// without any, and so on. Another base gives other worlds throughout.
pub fn bank(seed_base: u64, per_kind: usize) -> impl Iterator<Item = (Kind, u64)> {
    let times = |kind: Kind, count: usize| std::iter::repeat_n(kind, count);
    let catalogue = Effect::ALL.into_iter().filter(|effect| *effect != Effect::OutsideCatalogue);
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
        let worlds: Vec<(Kind, u64)> = bank(1, 2).chain(bank(2, 2)).collect();
        let seeds: HashSet<u64> = worlds.iter().map(|(_, seed)| *seed).collect();
        assert_eq!(seeds.len(), worlds.len());
        for effect in Effect::ALL.into_iter().take(16) {
            assert_eq!(worlds.iter().filter(|(kind, _)| *kind == Kind::One(effect)).count(), 4);
        }
        for kind in ["none", "one", "two", "confounded", "decoy", "outside"] {
            assert!(worlds.iter().any(|(known, _)| known.name() == kind), "{kind}");
        }
        assert_eq!(bank(7, 0).count(), 0);
    }
}
