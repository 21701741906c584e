//! A map as the functions of an estimator of the core.

use serde::{Deserialize, Serialize};
use thetahat_core::{Basis, Error as CoreError};

use super::evaluator::Evaluator;
use super::map::Map;
use crate::Error;

/// The functions of a [`Map`], for [`RecursiveNarx`](thetahat_core::RecursiveNarx) and
/// [`NonlinearArx`](thetahat_core::NonlinearArx).
///
/// ```
/// use thetahat::model::{Functions, Map};
/// use thetahat::thetahat_core::Basis;
///
/// // 1, z_0, z_1, z_0^2, z_0 z_1, z_1^2.
/// let functions = Functions::new(Map::polynomial(2, 2)?, 2)?;
/// let mut values = [0.0; 6];
/// functions.evaluate(&[2.0, 3.0], &mut values);
/// assert_eq!(values, [1.0, 2.0, 3.0, 4.0, 6.0, 9.0]);
/// # Ok::<(), thetahat::Error>(())
/// ```
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(into = "Stored", try_from = "Stored")]
pub struct Functions {
    map: Map,
    regressors: usize,
    evaluator: Evaluator,
}

impl Functions {
    /// The functions of this many regressors.
    ///
    /// # Errors
    /// [`Error::Argument`] if the parts of the map do not fit together.
    pub fn new(map: Map, regressors: usize) -> Result<Self, Error> {
        map.check(regressors).map_err(|message| Error::argument("map", message))?;
        let evaluator = Evaluator::new(&map, vec![0.0; map.parameters(regressors)]);
        Ok(Self { map, regressors, evaluator })
    }

    /// The map.
    pub fn map(&self) -> &Map {
        &self.map
    }
}

impl Basis<f64> for Functions {
    fn functions(&self) -> usize {
        self.evaluator.parameters()
    }

    fn check(&self, regressors: usize) -> Result<(), CoreError> {
        if regressors == self.regressors {
            return Ok(());
        }
        Err(CoreError::Length { argument: "basis", expected: self.regressors, found: regressors })
    }

    fn each(&self, z: &[f64], take: impl FnMut(usize, f64)) {
        self.evaluator.each(z, take);
    }

    fn add_slopes(&self, parameters: &[f64], z: &[f64], slopes: &mut [f64]) {
        let mut own = vec![0.0; slopes.len()];
        Evaluator::new(&self.map, parameters.to_vec()).slopes(z, &mut own);
        slopes.iter_mut().zip(own).for_each(|(slope, own)| *slope += own);
    }
}

/// What is written of it.
#[derive(Serialize, Deserialize)]
struct Stored {
    map: Map,
    regressors: usize,
}

impl From<Functions> for Stored {
    fn from(Functions { map, regressors, .. }: Functions) -> Self {
        Self { map, regressors }
    }
}

impl TryFrom<Stored> for Functions {
    type Error = Error;

    fn try_from(Stored { map, regressors }: Stored) -> Result<Self, Error> {
        Self::new(map, regressors)
    }
}
