"""Rows to come, and free runs of models that a filter reads."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from thetahat import _thetahat
from thetahat.base import numbers as _numbers
from thetahat.engine import options as _options

Array = NDArray[np.float64]


def future(u: Any, inputs: int, steps: int | None) -> Array:
    """The inputs of rows to come, shape (steps, inputs)."""
    values = _numbers.array("u", u)
    if values.ndim < 2 and inputs == 1:
        values = values.reshape(-1, 1)
    if values.ndim != 2 or values.shape[1] != inputs or len(values) == 0:
        raise ValueError(f"u: expected shape (steps, {inputs}), found {values.shape}")
    if np.isinf(values).any():
        raise ValueError("u: it is infinite somewhere; NaN is a missing sample")
    if steps is not None and _options.count("steps", steps, 10_000) != len(values):
        raise ValueError(f"steps: {steps} were asked for, and u has {len(values)}; give one of the two")
    return values


def predicted(filter: _thetahat.StateFilter, inputs: int, u: Any, steps: int | None) -> Array:
    """The outputs of a filter in rows to come, from their inputs or from the latest ones: shape (steps,), or (steps, outputs)."""
    if u is None:
        rows = np.full((_options.count("steps", 1 if steps is None else steps, 10_000), inputs), np.nan)
    else:
        rows = future(u, inputs, steps)
    found = filter.predict(rows, len(rows))
    return found[:, 0] if found.shape[1] == 1 else found


class Simulates:
    """A model that a filter reads, which runs without one too."""

    __slots__ = ()

    def _filtered(self) -> _thetahat.StateModel:
        """The model as a filter reads it."""
        raise NotImplementedError

    def simulate(self, u: ArrayLike | None = None, steps: int | None = None) -> Array:
        """The free run from the initial state, without noise, unknown parameters at their starts: the outputs that inputs drive, or so many
        steps without inputs.

        Parameters
        ----------
        u : array_like, shape (N,) or (N, inputs), optional
            The inputs, one sample time apart.
        steps : int, optional
            How many, of a model without inputs.

        Returns
        -------
        ndarray, shape (N,), or (N, outputs) where there are several

        Examples
        --------
        >>> import thetahat as th
        >>> model = th.StateModel([[0.9]], [[1.0]], [[1.0]], [[1.0]], [[1.0]], G=[[1.0]], sample_time=0.1)
        >>> model.simulate([1.0, 1.0, 1.0])
        array([0. , 1. , 1.9])
        """
        model = self._filtered()
        return predicted(_thetahat.StateFilter(model, None, None, None, None), len(model.inputs), u, steps)
