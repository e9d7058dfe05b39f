//! Scenarios of planned campaigns, by kind, and a benchmark of all kinds.
//!
//! [`simulated_machines::scenarios`] draws a campaign and hides effects in it. The kinds [`Kind::Confounded`] and
//! [`Kind::Decoy`] also relate its columns.

use crate::column_relation::{draw_confounded, draw_with_decoy};
use simulated_machines::sampler::{Sampler, mixed};
use simulated_machines::scenarios::{HiddenCause, Options, Plan, Scenario, draw_planned};

/// Kind of a scenario: its hidden effects.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Kind {
    /// No hidden effect: plain LuGre and noise.
    None,
    /// One effect.
    One(HiddenCause),
    /// Two effects of comparable size.
    Two(HiddenCause, HiddenCause),
    /// One effect whose column is exactly proportional to another, so that both causes are confounded.
    Confounded,
    /// One effect, and a correlated column without an effect.
    Decoy,
    /// An effect that no cause of the catalogue describes.
    Outside,
}

impl Kind {
    /// Returns the name of the kind, in one word.
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

/// Draws the plan of a kind.
fn plan(sampler: &mut Sampler, kind: Kind) -> Plan {
    let independent = |effects| Plan { effects, relation: None };
    match kind {
        Kind::None => Plan::default(),
        Kind::One(effect) => independent(vec![effect]),
        Kind::Two(first, second) if first == second => independent(vec![first]),
        Kind::Two(first, second) => independent(vec![first, second]),
        Kind::Outside => independent(vec![HiddenCause::OutsideCatalogue]),
        Kind::Confounded => draw_confounded(sampler),
        Kind::Decoy => draw_with_decoy(sampler),
    }
}

/// Draws a scenario of a kind. The same seed gives bit-identical results.
pub fn draw(kind: Kind, seed: u64) -> Scenario {
    draw_planned(&|sampler| plan(sampler, kind), &[], seed, &Options::default())
}

/// Pairs of effects that occur together on real joints and that good data can separate.
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

/// Returns the kinds and seeds of a benchmark.
///
/// It contains `per_kind` scenarios of every effect of the catalogue, four times as many without an effect, with two
/// effects and with a decoy, twice as many confounded ones, and five times as many outside the catalogue. A different
/// base gives different scenarios.
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
    fn benchmark_contains_every_kind_and_distinct_seeds() {
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
