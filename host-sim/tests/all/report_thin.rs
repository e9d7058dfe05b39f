//! Thinned data tells the story of the full data: spikes, holes, outliers and densities stay,
//! every point is a measured one, and the same data always gives the same points.

use friction_results::report::{thin_scatter, thin_series};

const MAX: usize = 1000;

fn time(length: usize) -> Vec<f64> {
    (0..length).map(|i| i as f64 * 1e-3).collect()
}

#[test]
fn thin_of_short_series_returns_it_unchanged() {
    let (x, y) = (time(MAX), time(MAX));
    assert_eq!(thin_series(&x, &y, MAX), (x.clone(), y.clone()));
    assert_eq!(thin_scatter(&x, &y, MAX), (x, y));
}

#[test]
fn thin_series_keeps_spikes_and_ends() {
    let x = time(50_000);
    let mut y: Vec<f64> = x.iter().map(|t| (20.0 * t).sin()).collect();
    y[12_345] = 9.0;
    y[40_001] = -7.0;
    let (thin_x, thin_y) = thin_series(&x, &y, MAX);
    assert!(thin_x.len() <= MAX && thin_x.len() > MAX / 2, "{}", thin_x.len());
    assert!(thin_x.contains(&x[12_345]) && thin_y.contains(&9.0) && thin_y.contains(&-7.0));
    assert_eq!((thin_x[0], thin_x[thin_x.len() - 1]), (x[0], x[49_999]));
    assert!(thin_x.is_sorted());
    assert_eq!(thin_series(&x, &y, MAX), (thin_x, thin_y));
}

#[test]
fn thin_series_keeps_gaps() {
    let x = time(50_000);
    let mut y = vec![1.0; 50_000];
    y[30_000] = f64::NAN;
    let (thin_x, thin_y) = thin_series(&x, &y, MAX);
    assert!(thin_x.len() <= MAX);
    assert_eq!(thin_y.iter().filter(|value| value.is_nan()).count(), 1);
    let (_, all_holes) = thin_series(&x, &vec![f64::INFINITY; 50_000], MAX);
    assert!(all_holes.len() <= MAX);
}

#[test]
fn thin_scatter_keeps_outliers_and_density() {
    // Nine in ten points sit left of zero; one lies far off.
    let spread = |i: usize, by: usize| (i * by % 1009) as f64 / 1009.0;
    let mut x: Vec<f64> =
        (0..20_000).map(|i| if i % 10 == 0 { spread(i, 37) } else { -spread(i, 41) }).collect();
    let mut y: Vec<f64> = (0..20_000).map(|i| spread(i, 613)).collect();
    (x[777], y[777]) = (30.0, 40.0);
    let (thin_x, thin_y) = thin_scatter(&x, &y, MAX);
    assert!(thin_x.len() <= MAX && thin_x.len() > MAX / 2, "{}", thin_x.len());
    assert!(thin_x.contains(&30.0) && thin_y.contains(&40.0));
    let left = thin_x.iter().filter(|&&x| x < 0.0).count() as f64 / thin_x.len() as f64;
    assert!((0.85..0.95).contains(&left), "{left}");
    assert!(
        thin_x
            .iter()
            .zip(&thin_y)
            .all(|(a, b)| { x.iter().zip(&y).any(|(x, y)| x == a && y == b) })
    );
    assert_eq!(thin_scatter(&x, &y, MAX), (thin_x, thin_y));
}

#[test]
fn thin_with_unusual_input_stays_within_limit() {
    let cases: [(Vec<f64>, Vec<f64>); 5] = [
        (vec![], vec![]),
        (vec![1.0; 5000], vec![2.0; 5000]),
        (vec![f64::NAN; 5000], vec![f64::INFINITY; 5000]),
        (time(5000), time(3)),
        ((0..5000).map(|i| if i % 2 == 0 { f64::MAX } else { f64::MIN }).collect(), time(5000)),
    ];
    for (x, y) in &cases {
        for max_points in [0, 1, 16, 17, 100, 10_000] {
            for (thin_x, thin_y) in [thin_series(x, y, max_points), thin_scatter(x, y, max_points)]
            {
                assert_eq!(thin_x.len(), thin_y.len());
                assert!(thin_x.len() <= max_points.max(16));
            }
        }
    }
}
