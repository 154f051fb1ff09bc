//! What holds for all values.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

use proptest::prelude::*;
use stillmap_sbs::alignment::{Covariance, Pair, region};
use stillmap_sbs::components::components;
use stillmap_sbs::estimation::least_squares;
use stillmap_sbs::mixture::{EmRule, learn};
use stillmap_sbs::plane::Plane;
use stillmap_sbs::score::Score;
use stillmap_sbs::transform::{Class, Transform};

proptest! {
    /// The log-likelihood never falls, S stays below B, the weights sum to 1 above their floor and σ keeps to its own.
    #[test]
    fn em_climbs(samples in proptest::collection::vec(0_u8..=255, 1..120)) {
        let samples: Vec<f64> = samples.into_iter().map(f64::from).collect();
        let rule = EmRule::default();
        let fit = learn(&samples, &rule).unwrap();
        for pair in fit.log_likelihood.windows(2) {
            prop_assert!(pair[1] >= pair[0] - 1e-9 * pair[0].abs(), "{pair:?}");
        }
        let m = fit.mixture;
        prop_assert!(m.shadow.mean < m.background.mean || m.background.mean == 0.0, "{m:?}");
        prop_assert!(m.background.sigma >= rule.sigma_min && m.shadow.sigma >= rule.sigma_min);
        let weights = [m.weights.foreground, m.weights.background, m.weights.shadow];
        prop_assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-9 && weights.iter().all(|w| *w >= rule.weight_min * (1.0 - 1e-9)));
    }

    /// Pairs that a similarity made are mapped exactly by every class that holds it, and a wild pair is never a panic.
    #[test]
    fn least_squares_find_a_similarity(
        places in proptest::collection::vec((0.0_f64..160.0, 0.0_f64..120.0), 8..30),
        (a, b, u, v) in (0.9_f64..1.1, -0.1_f64..0.1, -5.0_f64..5.0, -5.0_f64..5.0),
        wild in proptest::collection::vec((any::<f64>(), any::<f64>(), any::<f64>(), any::<f64>()), 0..8),
    ) {
        let truth = Transform::new([a, -b, u, b, a, v, 0.0, 0.0, 1.0]).unwrap();
        let pairs: Vec<Pair> = places.iter().map(|&(x, y)| Pair { frame: [x, y], background: truth.apply([x, y]) }).collect();
        for class in [Class::Similarity, Class::Affine, Class::Homography] {
            if let Some(found) = least_squares(class, &pairs) {
                prop_assert!(Covariance::of_residuals(&found, &pairs).rms() < 1e-4, "{class:?} {found:?}");
            }
        }
        let wild: Vec<Pair> = wild.iter().map(|w| Pair { frame: [w.0, w.1], background: [w.2, w.3] }).collect();
        for class in [Class::Translation, Class::Similarity, Class::Affine, Class::Homography] {
            let _ = least_squares(class, &wild);
        }
    }

    /// A region holds its centre's pixel or the ones with D ≤ ħ, and grows with β.
    #[test]
    fn regions_grow(u in -5.0_f64..5.0, v in -5.0_f64..5.0, uu in 0.01_f64..4.0, vv in 0.01_f64..4.0, r in -0.9_f64..0.9, h in 0.1_f64..6.0) {
        let sigma = Covariance { uu, uv: r * (uu * vv).sqrt(), vv };
        let (small, large) = (region([u, v], sigma, h), region([u, v], sigma.times(2.0), h));
        prop_assert!(!small.is_empty() && large.len() >= small.len());
        prop_assert!(small.len() == 1 || small.iter().all(|p| p.distance <= h));
    }

    /// Components agree with a flood fill in number, size and place.
    #[test]
    fn components_agree_with_a_flood_fill(width in 1_usize..40, height in 1_usize..12, bits in proptest::collection::vec(any::<bool>(), 480)) {
        let values: Vec<u8> = bits.iter().take(width * height).map(|&b| u8::from(b) * 255).collect();
        let mask = Plane::from_values(width, height, values.clone()).unwrap();
        let found = components(&mask);
        let mut left = values;
        let mut sizes = Vec::new();
        for start in 0..left.len() {
            let (mut stack, mut size) = (vec![start], 0);
            while let Some(at) = stack.pop() {
                if std::mem::take(&mut left[at]) == 0 {
                    continue;
                }
                size += 1;
                let (u, v) = (at % width, at / width);
                for nv in v.saturating_sub(1)..(v + 2).min(height) {
                    stack.extend((u.saturating_sub(1)..(u + 2).min(width)).map(|nu| nv * width + nu));
                }
            }
            sizes.extend((size > 0).then_some(size));
        }
        prop_assert_eq!(found.list.iter().map(|c| c.size).collect::<Vec<_>>(), sizes);
        for (k, c) in found.list.iter().enumerate() {
            let runs = || found.runs.iter().filter(|r| r.component == k);
            prop_assert_eq!(c.size as usize, runs().map(|r| r.end - r.start).sum::<usize>());
            prop_assert_eq!(c.sum_u, runs().flat_map(|r| r.start..r.end).map(|u| u as u64).sum::<u64>());
            prop_assert_eq!((c.left as usize, c.right as usize), (runs().map(|r| r.start).min().unwrap(), runs().map(|r| r.end).max().unwrap()));
            prop_assert_eq!((c.top as usize, c.bottom as usize), (runs().map(|r| r.row).min().unwrap(), runs().map(|r| r.row).max().unwrap() + 1));
        }
    }
}

#[test]
fn the_score_counts_what_it_says() {
    // 160 wide: components from 40 px count. One of 10 × 10 on the moving truth, one of 8 × 5 on nothing, one of 39 px dropped.
    let mut mask = Plane::filled(160, 30, 0_u8);
    let mut truth = Plane::filled(160, 30, 0_u8);
    let fill = |plane: &mut Plane<u8>, u: usize, v: usize, w: usize, h: usize, value: u8| {
        for row in v..v + h {
            plane.row_mut(row)[u..u + w].fill(value);
        }
    };
    fill(&mut mask, 10, 10, 10, 10, 255);
    fill(&mut mask, 50, 10, 8, 5, 255);
    fill(&mut mask, 80, 10, 13, 3, 255);
    fill(&mut truth, 15, 10, 10, 10, 255);
    fill(&mut truth, 10, 10, 5, 4, 50);
    fill(&mut truth, 10, 14, 5, 2, 170);
    let mut score = Score::default();
    score.add(&mask, &truth);
    let expected = Score {
        frames: 1,
        true_positives: 50,
        false_positives: 50 - 10 + 40,
        false_negatives: 50,
        shadow: 20,
        shadow_as_foreground: 20,
        false_blobs: 1,
    };
    assert_eq!(score, expected);
    assert!((score.f1() - 100.0 / 230.0).abs() < 1e-12);
}
