//! The inner loops. Each sum runs in eight fixed lanes without fused multiply-add, so that its bits
//! are the same on every instruction set that the dispatcher may choose. Where sums have twice the precision, a fused
//! multiply-add gives what a product lacks, exactly, and so the same bits too.

use faer::fx128;
use multiversion::multiversion;

const LANES: usize = 8;
/// Terms of an extended sum between two renormalisations, which take a tenth of its time.
const TERMS: usize = 256 * LANES;
static ONES: [f64; TERMS] = [1.0; TERMS];
/// How many neighbouring shifts one pass serves: eight accumulators fill the registers of AVX2.
const SHIFTS: usize = 4;

type Lanes = [f64; LANES];

/// The eight lanes of a sum, added pairwise.
fn fold(lanes: Lanes) -> f64 {
    let [a, b, c, d, e, f, g, h] = lanes;
    ((a + b) + (c + d)) + ((e + f) + (g + h))
}

/// `sum[l] += x[l] y[l]`.
#[inline(always)]
fn accumulate(sum: &mut Lanes, x: &Lanes, y: &Lanes) {
    for lane in 0..LANES {
        sum[lane] += x[lane] * y[lane];
    }
}

/// `x'y`, both as long. 2 flops a sample.
#[multiversion(targets("x86_64+avx512f", "x86_64+avx2"))]
pub fn product(x: &[f64], y: &[f64]) -> f64 {
    let ((x, x_rest), (y, y_rest)) = (x.as_chunks(), y.as_chunks());
    let mut sum = [0.0; LANES];
    for (x, y) in x.iter().zip(y) {
        accumulate(&mut sum, x, y);
    }
    for ((sum, x), y) in sum.iter_mut().zip(x_rest).zip(y_rest) {
        *sum += x * y;
    }
    fold(sum)
}

/// `x'y` in twice the precision. 17 flops a sample, five times what [`product`] takes.
///
/// Source: Ogita, Rump and Oishi, Accurate sum and dot product, SIAM Journal on Scientific Computing 26 (2005),
/// algorithm 5.3 (Dot2).
pub fn extended_product(x: &[f64], y: &[f64]) -> fx128 {
    let chunks = x.chunks(TERMS).zip(y.chunks(TERMS));
    chunks.fold(fx128::ZERO, |sum, (x, y)| {
        let (sums, lost) = extended_lanes(x, y);
        sums.into_iter().zip(lost).fold(sum, |sum, (lane, lost)| {
            sum.add_accurate(fx128::from_f64(lane)).add_accurate(fx128::from_f64(lost))
        })
    })
}

/// The sum of products in each lane, and what rounding took from it.
#[multiversion(targets("x86_64+avx512f", "x86_64+avx2+fma"))]
fn extended_lanes(x: &[f64], y: &[f64]) -> (Lanes, Lanes) {
    let ((x, x_rest), (y, y_rest)) = (x.as_chunks::<LANES>(), y.as_chunks::<LANES>());
    let (mut sums, mut lost) = ([0.0; LANES], [0.0; LANES]);
    for (x, y) in x.iter().zip(y) {
        for lane in 0..LANES {
            add_exactly(&mut sums[lane], &mut lost[lane], x[lane], y[lane]);
        }
    }
    for (lane, (x, y)) in x_rest.iter().zip(y_rest).enumerate() {
        add_exactly(&mut sums[lane], &mut lost[lane], *x, *y);
    }
    (sums, lost)
}

/// sum + lost grows by x y, both errors of rounding included: TwoProduct, and Knuth's TwoSum.
#[inline(always)]
fn add_exactly(sum: &mut f64, lost: &mut f64, x: f64, y: f64) {
    let product = x * y;
    let rest = x.mul_add(y, -product);
    let total = *sum + product;
    let added = total - *sum;
    let error = (*sum - (total - added)) + (product - added);
    *sum = total;
    *lost += error + rest;
}

/// The sum of `x` in twice the precision.
pub fn extended_sum(x: &[f64]) -> fx128 {
    x.chunks(TERMS).fold(fx128::ZERO, |sum, x| sum.add_accurate(extended_product(x, &ONES[..x.len()])))
}

/// `x'x`.
pub fn sum_of_squares(x: &[f64]) -> f64 {
    product(x, x)
}

/// The largest size of some values.
pub fn largest(values: &[f64]) -> f64 {
    let mut lanes = [0.0_f64; LANES];
    let (whole, rest) = values.as_chunks::<LANES>();
    for values in whole {
        for (lane, value) in lanes.iter_mut().zip(values) {
            *lane = if value.abs() > *lane { value.abs() } else { *lane };
        }
    }
    lanes.iter().chain(rest).fold(0.0, |largest, value| value.abs().max(largest))
}

/// `sum_t x[t] y[t + k]` for k = 0..4; `y` holds 3 values more than `x`. 8 flops a sample, each signal read once.
#[multiversion(targets("x86_64+avx512f", "x86_64+avx2"))]
fn four_products(x: &[f64], y: &[f64]) -> [f64; SHIFTS] {
    let (chunks, rest) = x.as_chunks();
    let mut sums = [[0.0; LANES]; SHIFTS];
    // Four zipped lists of chunks: indexed forms of this loop were compiled to shuffles, three times slower.
    let (y0, y1, y2, y3) =
        (y[0..].as_chunks().0, y[1..].as_chunks().0, y[2..].as_chunks().0, y[3..].as_chunks().0);
    for ((((x, y0), y1), y2), y3) in chunks.iter().zip(y0).zip(y1).zip(y2).zip(y3) {
        accumulate(&mut sums[0], x, y0);
        accumulate(&mut sums[1], x, y1);
        accumulate(&mut sums[2], x, y2);
        accumulate(&mut sums[3], x, y3);
    }
    let done = chunks.len() * LANES;
    for (k, sum) in sums.iter_mut().enumerate() {
        for ((sum, x), y) in sum.iter_mut().zip(rest).zip(&y[done + k..]) {
            *sum += x * y;
        }
    }
    sums.map(fold)
}

/// `target += weight x`, both as long. 2 flops a sample.
#[multiversion(targets("x86_64+avx512f", "x86_64+avx2"))]
pub fn add_scaled(target: &mut [f64], weight: f64, x: &[f64]) {
    for (target, x) in target.iter_mut().zip(x) {
        *target += weight * x;
    }
}

/// `target[t] += sum_k weights[k] x[t + k]` for k = 0..4; `x` holds 3 values more than `target`. 8 flops a sample.
#[multiversion(targets("x86_64+avx512f", "x86_64+avx2"))]
fn add_four_scaled(target: &mut [f64], weights: [f64; SHIFTS], x: &[f64]) {
    let shifted = x[0..].iter().zip(&x[1..]).zip(&x[2..]).zip(&x[3..]);
    for (target, (((x0, x1), x2), x3)) in target.iter_mut().zip(shifted) {
        *target = (((*target + weights[0] * x0) + weights[1] * x1) + weights[2] * x2) + weights[3] * x3;
    }
}

/// The same for two weights: one pass over the target where there would be two.
#[multiversion(targets("x86_64+avx512f", "x86_64+avx2"))]
fn add_two_scaled(target: &mut [f64], weights: [f64; 2], x: &[f64]) {
    for (target, (x0, x1)) in target.iter_mut().zip(x[0..].iter().zip(&x[1..])) {
        *target = (*target + weights[0] * x0) + weights[1] * x1;
    }
}

/// `into[k] += sum_t x[t] y[t + k]`; `y` holds as many values as `x` and `into` together, less one.
pub(super) fn correlations(x: &[f64], y: &[f64], into: &mut [f64]) {
    let (tiles, rest) = into.as_chunks_mut::<SHIFTS>();
    let done = tiles.len() * SHIFTS;
    for (tile, into) in tiles.iter_mut().enumerate() {
        let first = tile * SHIFTS;
        let products = four_products(x, &y[first..first + x.len() + SHIFTS - 1]);
        into.iter_mut().zip(products).for_each(|(sum, product)| *sum += product);
    }
    for (k, into) in rest.iter_mut().enumerate() {
        *into += product(x, &y[done + k..done + k + x.len()]);
    }
}

/// `target[t] += sum_l weights[l] x(t - l)`: a filter of L + 1 weights. `x` begins L samples before `target` and ends
/// with it.
pub(super) fn add_filtered(target: &mut [f64], weights: &[f64], x: &[f64]) {
    // The largest lag stands first in x.
    let (rest, tiles) = weights.as_rchunks::<SHIFTS>();
    let length = target.len();
    let mut first = 0;
    for tile in tiles.iter().rev() {
        let mut falling = *tile;
        falling.reverse();
        add_four_scaled(target, falling, &x[first..first + length + SHIFTS - 1]);
        first += SHIFTS;
    }
    let (single, pairs) = rest.as_rchunks::<2>();
    for pair in pairs.iter().rev() {
        add_two_scaled(target, [pair[1], pair[0]], &x[first..first + length + 1]);
        first += 2;
    }
    for weight in single {
        add_scaled(target, *weight, &x[first..first + length]);
    }
}

/// The sum of what values are above a base, with the bits of [`sum`]. 2 flops a value.
#[multiversion(targets("x86_64+avx512f", "x86_64+avx2"))]
pub fn sum_above(values: &[f64], base: f64) -> f64 {
    sum_of(values, |value| value - base)
}

/// The sum of squares of what values are above a base, with the bits of [`sum`]. 3 flops a value.
#[multiversion(targets("x86_64+avx512f", "x86_64+avx2"))]
pub fn squares_above(values: &[f64], base: f64) -> f64 {
    sum_of(values, |value| (value - base) * (value - base))
}

/// The sum of a term of each value, in the lanes of [`sum`].
#[inline(always)]
fn sum_of(values: &[f64], term: impl Fn(f64) -> f64) -> f64 {
    let (chunks, rest) = values.as_chunks::<LANES>();
    let mut sum = [0.0; LANES];
    for values in chunks {
        for lane in 0..LANES {
            sum[lane] += term(values[lane]);
        }
    }
    sum.iter_mut().zip(rest).for_each(|(sum, value)| *sum += term(*value));
    fold(sum)
}

/// The sums of squares and of sizes of x - y, with the bits of [`sum`], and the largest size; NaN if one is. 5 flops a
/// sample.
#[multiversion(targets("x86_64+avx512f", "x86_64+avx2"))]
pub fn differences(x: &[f64], y: &[f64]) -> [f64; 3] {
    let ((x, x_rest), (y, y_rest)) = (x.as_chunks::<LANES>(), y.as_chunks::<LANES>());
    let (mut squares, mut sizes, mut largest) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
    for (x, y) in x.iter().zip(y) {
        for lane in 0..LANES {
            let size = (x[lane] - y[lane]).abs();
            squares[lane] += size * size;
            sizes[lane] += size;
            largest[lane] = larger(largest[lane], size);
        }
    }
    for (lane, (x, y)) in x_rest.iter().zip(y_rest).enumerate() {
        let size = (x - y).abs();
        squares[lane] += size * size;
        sizes[lane] += size;
        largest[lane] = larger(largest[lane], size);
    }
    [fold(squares), fold(sizes), largest.into_iter().fold(0.0, larger)]
}

/// The larger of two values. One that is not a number stays one.
#[inline(always)]
fn larger(largest: f64, value: f64) -> f64 {
    if value > largest || value.is_nan() { value } else { largest }
}

/// The sum of `values`, in eight lanes.
pub fn sum(mut values: impl Iterator<Item = f64>) -> f64 {
    let mut lanes = [0.0; LANES];
    // A round of all lanes at a time, so that they stay in registers.
    loop {
        for lane in &mut lanes {
            match values.next() {
                Some(value) => *lane += value,
                None => return fold(lanes),
            }
        }
    }
}
