//! Gains of one set over another, from rounds that have a block of each: their intervals are Student's.
//!
//! The logarithm of a round's ratio is the observation. Its blocks follow each other, so that a slow drift of the joint is in
//! both of them, and a balanced order of the rounds ([`order`]) removes the rest of a steady one.

use crate::score::Scored;
use friction_results::tune::{TuneGain, TuneQuantity};

/// Returns the least value of a quantity, in its unit: a smaller one counts as this. The time stuck is known to the window of
/// the velocity only.
fn least(quantity: TuneQuantity) -> f64 {
    if quantity == TuneQuantity::StuckTime { 0.02 } else { 1e-9 }
}

/// Quantiles of Student's distribution at 97.5 %, from one degree of freedom on.
const STUDENT: [f64; 11] =
    [12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228, 2.201];
/// The quantile for more degrees of freedom.
const STUDENT_OF_MORE: f64 = 2.179;

/// Returns the gain of each quantity over pairs of blocks, first set first, with its 95 % interval.
pub fn gains(pairs: &[[Scored; 2]]) -> Vec<TuneGain> {
    TuneQuantity::ALL.into_iter().map(|quantity| gain(pairs, quantity)).collect()
}

/// Returns the gain of a quantity, as [`gains`] does.
pub fn gain(pairs: &[[Scored; 2]], quantity: TuneQuantity) -> TuneGain {
    let least = least(quantity);
    let log = |scored: &Scored| scored.scores.of(quantity).max(least).ln();
    let count = pairs.len() as f64;
    let mean = |of: &dyn Fn(&[Scored; 2]) -> f64| pairs.iter().map(of).sum::<f64>() / count;
    let ratio = |[before, after]: &[Scored; 2]| log(after) - log(before);
    let middle = mean(&ratio);
    let squares = mean(&|pair| (ratio(pair) - middle).powi(2));
    let student = match pairs.len() {
        0 | 1 => f64::NAN,
        pairs => STUDENT.get(pairs - 2).copied().unwrap_or(STUDENT_OF_MORE),
    };
    let half = student * (squares / (count - 1.0)).sqrt();
    let is_none = pairs.iter().flatten().all(|scored| scored.scores.of(quantity) <= least);
    let [before, after] = [0, 1].map(|which| mean(&|pair| log(&pair[which])).exp());
    TuneGain {
        quantity,
        unit: quantity.unit(),
        before: if is_none { 0.0 } else { before },
        after: if is_none { 0.0 } else { after },
        gain: -middle.exp_m1(),
        ci95: [-(middle + half).exp_m1(), -(middle - half).exp_m1()],
    }
}

/// Returns a balanced order of this number of rounds, each with every set once: the mean place of each set is the same, so that
/// a steady drift favours none. An odd number needs an odd number of sets, and at least as many rounds.
pub fn order<T: Copy>(sets: &[T], rounds: usize) -> Vec<Vec<T>> {
    let rotated = |by: usize| {
        let mut round = sets.to_vec();
        round.rotate_left(by % sets.len());
        round
    };
    let mut all = Vec::new();
    if rounds % 2 == 1 {
        all.extend((0..sets.len()).map(rotated));
    }
    for by in 0.. {
        if all.len() >= rounds {
            break;
        }
        let round = rotated(by);
        let mirrored = round.iter().rev().copied().collect();
        all.extend([round, mirrored]);
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::score::Health;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_pcg::Pcg64;

    fn scored(value: f64) -> Scored {
        Scored { scores: [value; 4].into(), health: Health::default() }
    }

    #[test]
    fn gain_of_equal_blocks_is_none_and_of_better_blocks_is_proven() {
        let noise = [0.02, -0.01, 0.0, 0.015, -0.02, 0.01];
        let equal: Vec<_> = noise.iter().map(|n| [scored(1.0 + n), scored(1.0 - n)]).collect();
        let better: Vec<_> = noise.iter().map(|n| [scored(1.0 + n), scored(0.5)]).collect();
        let none = &gains(&equal)[0];
        assert!(none.ci95[0] < 0.0 && none.ci95[1] > 0.0, "{none:?}");
        let half = &gains(&better)[0];
        assert!((half.gain - 0.5).abs() < 0.02 && half.ci95[0] > 0.4, "{half:?}");
        assert!((half.gain - (1.0 - half.after / half.before)).abs() < 1e-12, "{half:?}");
    }

    #[test]
    fn gain_of_time_stuck_is_finite_without_any() {
        let pairs = |before: f64, after: f64| vec![[scored(before), scored(after)]; 3];
        let none = gain(&pairs(0.0, 0.0), TuneQuantity::StuckTime);
        assert_eq!((none.before, none.after, none.gain, none.ci95), (0.0, 0.0, 0.0, [0.0; 2]));
        let gone = gain(&pairs(0.4, 0.0), TuneQuantity::StuckTime);
        assert!((gone.gain - 0.95).abs() < 1e-9, "{gone:?}");
    }

    #[test]
    fn interval_covers_the_true_gain_in_95_percent_of_drawn_trials() {
        const TRIALS: usize = 20_000;
        const SPREAD: f64 = 0.15;
        const DRIFT: f64 = 0.04;
        const RATIO: f64 = 0.6;
        let mut random = Pcg64::seed_from_u64(46);
        for (sets, rounds) in [(3, 3), (3, 4), (2, 4), (3, 6), (2, 6)] {
            let places: Vec<usize> = (0..sets).collect();
            let order = order(&places, rounds);
            let mut covered = 0;
            for _ in 0..TRIALS {
                let mut at = 0.0;
                let mut pairs = vec![[scored(0.0); 2]; rounds];
                for (pair, round) in pairs.iter_mut().zip(&order) {
                    for set in round {
                        let noise: f64 = StandardNormal.sample(&mut random);
                        let level = if *set == 0 { 1.0 } else { RATIO };
                        if *set < 2 {
                            pair[*set] = scored(level * (SPREAD * noise + DRIFT * at).exp());
                        }
                        at += 1.0;
                    }
                }
                let [low, high] = gain(&pairs, TuneQuantity::TrackingRms).ci95;
                covered += usize::from((low..=high).contains(&(1.0 - RATIO)));
            }
            let share = covered as f64 / TRIALS as f64;
            println!("measured: {rounds} rounds of {sets} sets: {share:.4} covered");
            assert!((0.93..=0.97).contains(&share), "{rounds} rounds of {sets} sets: {share}");
        }
    }

    #[test]
    fn order_gives_each_set_the_same_mean_place() {
        for (sets, rounds) in [(2, 4), (2, 6), (3, 3), (3, 4), (3, 5), (3, 6)] {
            let places: Vec<usize> = (0..sets).collect();
            let order = order(&places, rounds);
            assert_eq!(order.len(), rounds);
            assert_eq!(order[0], places, "the first round is in the order given");
            let sums = places.iter().map(|set| {
                order
                    .iter()
                    .flatten()
                    .enumerate()
                    .filter(|(_, placed)| *placed == set)
                    .map(|(at, _)| at)
                    .sum()
            });
            let sums: Vec<usize> = sums.collect();
            assert!(
                sums.iter().all(|sum| *sum == sums[0]),
                "{sets} sets, {rounds} rounds: {sums:?}"
            );
        }
    }
}
