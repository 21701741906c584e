"""ARX, nonlinear ARX and state-space models as estimators of scikit-learn, for its pipelines, searches and scores.

Rows are samples in the order of time, at equal distances. Whatever splits them has to keep that order:
`sklearn.model_selection.TimeSeriesSplit` does, shuffled folds do not. An index of pandas tells: of times it is the clock, of whole
numbers it counts rows; nothing reaches across what is left out of either, and rows out of order are an error.
"""

from __future__ import annotations

try:
    from sklearn.utils.validation import validate_data as _validate_data  # noqa: F401
except ImportError as error:
    message = (
        f"thetahat.sklearn needs scikit-learn 1.6 or later, which cannot be imported ({error}): "
        "pip install thetahat[sklearn]"
    )
    raise ImportError(message) from error

from thetahat.sklearn.arx import ARXRegressor
from thetahat.sklearn.narx import NARXRegressor
from thetahat.sklearn.scorer import scorer
from thetahat.sklearn.state_space import StateSpaceRegressor

__all__ = ["EXPECTED_FAILED_CHECKS", "ARXRegressor", "NARXRegressor", "StateSpaceRegressor", "scorer"]

EXPECTED_FAILED_CHECKS = {
    "check_methods_sample_order_invariance": "rows are in the order of time",
    "check_methods_subset_invariance": "a row depends on those before it",
}
"""The checks of `sklearn.utils.estimator_checks.check_estimator` that these regressors fail by what they are, and why."""
