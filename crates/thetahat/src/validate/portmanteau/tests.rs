use thetahat_numerics::noise::Noise;

use super::*;

fn innovations(errors: Vec<f64>) -> Vec<Innovations> {
    let rows = 0..errors.len();
    vec![Innovations::alone(rows.clone(), std::iter::once(rows).collect(), errors)]
}

#[test]
fn white_errors_pass_as_often_as_they_should() {
    let mut noise = Noise(3);
    let mut rejected = 0;
    for _ in 0..400 {
        let all: Vec<(f64, f64)> = (0..300).map(|_| (noise.uniform(), noise.uniform())).collect();
        // Correlated in the same sample, and nowhere else.
        let first = innovations(all.iter().map(|(a, _)| 5.0 + a).collect());
        let second = innovations(all.iter().map(|(a, b)| a + 0.5 * b).collect());
        let found = portmanteau(&[&first, &second], 10, 0).unwrap();
        assert_eq!((found.lags, found.degrees), (10, 40.0));
        rejected += usize::from(found.p_value.unwrap() < 0.05);
    }
    assert!((8..=34).contains(&rejected), "{rejected} of 400 at 5 %");
}

#[test]
fn it_sees_what_one_output_knows_of_another() {
    let mut noise = Noise(4);
    let all: Vec<f64> = noise.take(1001);
    let second: Vec<f64> = (1..1001).map(|t| 0.3 * all[t - 1] + noise.uniform()).collect();
    let (first, second) = (innovations(all[1..].to_vec()), innovations(second));
    assert!(portmanteau(&[&first, &second], 10, 0).unwrap().p_value.unwrap() < 1e-6);
    // In numbers: of one lag with C_0 = I it is N^2/(N - 1) times the sum of the squares of C_1.
    let plain: [Vec<f64>; 2] = [vec![1.0, 1.0, -1.0, -1.0], vec![1.0, -1.0, -1.0, 1.0]];
    let [first, second] = plain.map(innovations);
    let found = portmanteau(&[&first, &second], 1, 1).unwrap();
    // C_1 = [[1, 3], [-3, -1]]/4 with e(t) e(t-1)'.
    assert!((found.statistic - 16.0 / 3.0 * 20.0 / 16.0).abs() < 1e-12 && found.degrees == 3.0, "{found:?}");
}

#[test]
fn rows_count_in_which_all_outputs_do() {
    let mut noise = Noise(6);
    let mut rejected = 0;
    for _ in 0..400 {
        // One row in five misses the second output: runs are short, pairs are not few.
        let mut counted: Vec<Range<usize>> = Vec::new();
        let mut all: [Vec<f64>; 2] = Default::default();
        for row in 0..400 {
            let there = noise.uniform() > -0.6;
            let first = noise.uniform();
            all[0].push(first);
            all[1].push(if there { first + noise.uniform() } else { 0.0 });
            match counted.last_mut().filter(|last| there && last.end == row) {
                Some(last) => last.end = row + 1,
                None if there => counted.push(row..row + 1),
                None => {}
            }
        }
        let [first, second] = all;
        let second = vec![Innovations::alone(0..400, counted, second)];
        let found = portmanteau(&[&innovations(first), &second], 10, 0);
        rejected += usize::from(found.and_then(|test| test.p_value).is_none_or(|p| p < 0.05));
    }
    assert!((8..=34).contains(&rejected), "{rejected} of 400 at 5 %");
    assert_eq!(shared(&[0..5, 7..9], &[1..2, 3..8, 8..12]), [1..2, 3..5, 7..8, 8..9]);
}

#[test]
fn what_cannot_be_tested_is_none() {
    let (one, short) = (innovations(vec![1.0, -1.0, 2.0]), innovations(vec![1.0, -1.0]));
    assert_eq!(portmanteau(&[&one], 1, 0), None);
    assert_eq!(portmanteau(&[&one, &short], 1, 0), None);
    assert_eq!(portmanteau(&[&one, &one], 1, 0), None);
    assert_eq!(portmanteau(&[&one, &innovations(vec![0.5, 1.0, 0.0])], 3, 0), None);
    assert_eq!(portmanteau(&[&one, &innovations(vec![0.5, 1.0, 0.0])], 1, 4), None);
}
