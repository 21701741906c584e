mod bounded;
mod equations;
mod lags;
mod noises;
mod observers;
mod reference;
mod refusals;
mod reports;
mod smoothing;
mod snapshots;
mod unscented;

use crate::filter::{Estimator, StateFilter, StateModel};

/// The level of the Nile, a walk that is measured.
pub(super) const NILE: &str = "\
sample_time = 1
states = ['level']
outputs = ['y']
F = [[1]]
H = [[1]]
Q = [[1469.1]]
R = [[15099]]
x0 = [0]
P0 = [[1e7]]
";

/// The flow of the Nile, 1871 to 1890, in 10^8 m^3.
pub(super) const FLOW: [f64; 20] = [
    1120.0, 1160.0, 963.0, 1210.0, 1160.0, 1160.0, 813.0, 1230.0, 1370.0, 1140.0, 995.0, 935.0, 1110.0,
    994.0, 1020.0, 960.0, 1180.0, 799.0, 958.0, 1140.0,
];

pub(super) fn filter(text: &str, estimator: Estimator) -> StateFilter {
    StateFilter::new(StateModel::from_toml(text).unwrap(), estimator).unwrap()
}
