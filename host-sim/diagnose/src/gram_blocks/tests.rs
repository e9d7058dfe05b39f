//! What the linear fit says of columns whose truth is known.

use super::*;

const ONCE: CandidateOptions = CandidateOptions { comparisons: 1.0, block_weighted: false };

/// A log of `blocks` blocks: base column 1, candidates a (true, in the residual) and b (noise).
fn gram(blocks: usize, size: f64, seed: u64) -> GramBlocks {
    let mut random = Pcg64::seed_from_u64(seed);
    let mut normal = move || (0..12).map(|_| random.random_range(-0.5..0.5f64)).sum::<f64>();
    let block = |index: usize| {
        let mut products = DMatrix::zeros(4, 4);
        for _ in 0..50 {
            let (a, b) = (normal(), normal());
            let row = DVector::from_vec(vec![1.0, a, b, size * a + normal()]);
            products += &row * row.transpose();
        }
        Block { run: index / STRETCHES, stretch: index % STRETCHES, products, rows: 50 }
    };
    GramBlocks::new(1, &[1, 1], (0..blocks).map(block).collect())
}

#[test]
fn try_all_with_planted_candidate_returns_its_coefficient() {
    let fits = gram(64, 0.2, 1).try_all(&[ONCE, ONCE]);
    assert!((fits[0].coefficients[0] - 0.2).abs() < 0.06, "{:?}", fits[0]);
    assert!(fits[0].p_value < 1e-3 && fits[0].unseen.value > 0.0, "{:?}", fits[0]);
    assert!(fits[0].unseen_runs.unwrap().in_standard_errors() > 2.0, "{:?}", fits[0]);
    assert!(fits[1].p_value > 0.01, "{:?}", fits[1]);
}

#[test]
fn try_all_with_one_block_per_run_distinguishes_runs() {
    let mut gram = gram(64, 0.5, 1);
    let alike =
        |block: Block| Block { run: block.run * STRETCHES + block.stretch, stretch: 4, ..block };
    let blocks: Vec<Block> = std::mem::take(&mut gram.blocks).into_iter().map(alike).collect();
    let fits = GramBlocks::new(1, &[1, 1], blocks).try_all(&[ONCE, ONCE]);
    assert!(fits[0].unseen.value > 0.0 && fits[0].p_value < 1e-3, "{:?}", fits[0]);
}

#[test]
fn try_all_with_noise_is_rarely_significant() {
    let least = |seed| {
        let fits = gram(64, 0.0, seed).try_all(&[ONCE, ONCE]);
        fits.iter().map(|fit| fit.p_value).fold(1.0, f64::min)
    };
    let alarms = (0..400).filter(|seed| least(*seed) < 0.05).count();
    // 20 of 400 by its own word, which is to first order in the number of blocks: of 64 it was 35.
    assert!((4..=44).contains(&alarms), "{alarms} of 400 at 5 %");
}

#[test]
fn confusion_of_copied_column_is_one_and_of_other_is_small() {
    let mut gram = gram(40, 0.5, 3);
    assert!(gram.confusion(0, 1).0 < 0.1);
    for block in gram.blocks.iter_mut().map(|b| &mut b.products).chain([&mut gram.total]) {
        let column = block.column(1).into_owned();
        block.set_column(2, &column);
        let row = block.row(1).into_owned();
        block.set_row(2, &row);
        block[(2, 2)] = block[(1, 1)];
    }
    assert!(gram.confusion(0, 1).0 > 0.999);
}

#[test]
fn beside_other_laws_with_explained_candidate_is_small() {
    // Base column 1; a candidate that another law's column holds all but a tenth of, and one of its own.
    let mut random = Pcg64::seed_from_u64(4);
    let mut normal = move || (0..12).map(|_| random.random_range(-0.5..0.5f64)).sum::<f64>();
    let block = |index: usize| {
        let mut products = DMatrix::zeros(5, 5);
        for _ in 0..50 {
            let (law, own) = (normal(), normal());
            let torque = 0.3 * law + 0.3 * own + normal();
            let row = DVector::from_vec(vec![1.0, law + 0.1 * normal(), own, law, torque]);
            products += &row * row.transpose();
        }
        Block { run: index / STRETCHES, stretch: index % STRETCHES, products, rows: 50 }
    };
    let gram = GramBlocks::new(1, &[1, 1], (0..64).map(block).collect());
    let fits = gram.try_all(&[ONCE, ONCE]);
    let left = |fit: &CandidateFit| gram.beside_other_laws(fit.candidate).value / fit.unseen.value;
    assert!(fits.iter().all(|fit| fit.unseen.in_standard_errors() > 3.0), "{fits:?}");
    assert!(left(&fits[0]) < 0.1 && left(&fits[1]) > 0.8, "{} {}", left(&fits[0]), left(&fits[1]));
}

#[test]
fn try_all_with_covariate_constant_per_run_only_describes() {
    // Four runs of one level each, two of them with a torque that no straight line over the level has.
    let mut random = Pcg64::seed_from_u64(9);
    let mut normal = move || (0..12).map(|_| random.random_range(-0.5..0.5f64)).sum::<f64>();
    let block = |index: usize| {
        let run = index / 16;
        let (level, torque) = ([0.0, 1.0, 2.0, 3.0][run], [0.0, 5.0, 1.0, 5.0][run]);
        let mut products = DMatrix::zeros(3, 3);
        for _ in 0..50 {
            let row = DVector::from_vec(vec![1.0, level, torque + normal()]);
            products += &row * row.transpose();
        }
        Block { run, stretch: index % 16 / 2, products, rows: 50 }
    };
    let fits = GramBlocks::new(1, &[1], (0..64).map(block).collect()).try_all(&[ONCE]);
    assert!(fits[0].p_value < 1e-4, "{:?}", fits[0]);
    assert!(fits[0].unseen_runs.unwrap().value < 0.0, "{:?}", fits[0]);
}
