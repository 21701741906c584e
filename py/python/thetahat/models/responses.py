"""What models answer: forecasts, frequency and step responses, state space matrices."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from thetahat.base import clock as _clock
from thetahat.base.clock import Clock
from thetahat.base.tables import Table
from thetahat.engine import options as _options
from thetahat.models import convert as _convert

Array = npt.NDArray[np.float64]


class Forecast:
    """What comes after the end of a log.

    Attributes
    ----------
    time : ndarray, shape (steps,)
        Seconds.
    values : ndarray, shape (steps,)
        The expected outputs, in the units of the log.
    standard_deviations : ndarray, shape (steps,)
        Those of their errors: what the noise does, and what the uncertainty of the parameters, of the output's offset
        and of the initial states adds.
    outputs : list of str
        The names of the outputs. Of several, arrays have an axis for them, and the columns of frames begin with their names.
    """

    def __init__(
        self,
        time: Array,
        values: Array,
        standard_deviations: Array,
        clock: Clock | None = None,
        outputs: Sequence[str] = ("y",),
    ) -> None:
        self.time = time
        self.values = values
        self.standard_deviations = standard_deviations
        self.outputs = list(outputs)
        self._clock = Clock() if clock is None else clock

    def interval(self, level: float = 0.95) -> Array:
        """The lower and the upper ends of intervals that hold the output with this probability, shape (steps, 2), of several outputs
        (steps, outputs, 2)."""
        half = _options.quantile(level) * self.standard_deviations
        return np.stack([self.values - half, self.values + half], axis=-1)

    def to_pandas(self, level: float = 0.95) -> Any:
        """A data frame of pandas, whose index goes on from that of the log, or is the time in seconds.

        Where the log's times follow a calendar, such as the first days of months, so do these.

        Parameters
        ----------
        level : float, default 0.95
            The probability with which the intervals from ``lower`` to ``upper`` hold the output.

        Returns
        -------
        pandas.DataFrame
            Columns ``value``, ``standard_deviation``, ``lower`` and ``upper``.

        Examples
        --------
        >>> import pandas as pd
        >>> import thetahat as th
        >>> months = pd.date_range("2025-01-01", periods=12, freq="MS")
        >>> sales = pd.Series([3.0, 4.0, 3.5, 5.0, 4.0, 4.5, 5.5, 5.0, 4.0, 4.5, 5.0, 4.0], months)
        >>> log = th.Log(sales)
        >>> th.ar(log, na=1).forecast(log, 2).to_pandas()["value"].round(1)
        2026-01-01    4.3
        2026-02-01    4.3
        Freq: MS, Name: value, dtype: float64
        """
        return _clock.to_pandas(self._clock, self.time, self._columns(level))

    def to_polars(self, level: float = 0.95) -> Any:
        """As `to_pandas`, for Polars: the times are the first column."""
        return _clock.to_polars(self._clock, self.time, self._columns(level))

    def _columns(self, level: float) -> dict[str, Array]:
        figures = {"value": self.values, "standard_deviation": self.standard_deviations}
        figures |= dict(zip(("lower", "upper"), np.moveaxis(self.interval(level), -1, 0)))
        if self.values.ndim == 1:
            return figures
        return {f"{output}_{name}": column[:, place] for place, output in enumerate(self.outputs) for name, column in figures.items()}

    def __repr__(self) -> str:
        return f"Forecast({len(self.values)} steps from {self.time[0]:g} s)"


class FrequencyResponse(Table):
    """The response of an output to its sources at some frequencies.

    As a frame it has a row for each source and frequency.

    Attributes
    ----------
    frequencies : ndarray, shape (K,)
        Radians per second.
    sources : list of str
        The inputs, then ``"noise"``: one for each row of what follows.
    values : ndarray of complex, shape (sources, K)
        Units of the output per unit of the source.
    magnitude, phase : ndarray, shape (sources, K)
        The phase is in radians and does not jump.
    magnitude_errors, phase_errors : ndarray, shape (sources, K)
        Standard errors; NaN where no theory gives one.
    output : str or None
        The name of the output, where it is known.
    """

    def __init__(self, sources: Sequence[tuple[str | None, Sequence[Array]]], output: str | None = None) -> None:
        self.output = output
        self.sources = ["noise" if name is None else name for name, _ in sources]
        columns = np.array([list(columns) for _, columns in sources])
        self.frequencies: Array = columns[0, 0]
        self.values: npt.NDArray[np.complex128] = columns[:, 1] + 1j * columns[:, 2]
        self.magnitude: Array = columns[:, 3]
        self.magnitude_errors: Array = columns[:, 4]
        self.phase: Array = columns[:, 5]
        self.phase_errors: Array = columns[:, 6]

    def _columns(self) -> dict[str, Any]:
        count = len(self.frequencies)
        return {
            "source": [source for source in self.sources for _ in range(count)],
            "frequency": np.tile(self.frequencies, len(self.sources)),
            "magnitude": self.magnitude.ravel(),
            "magnitude_error": self.magnitude_errors.ravel(),
            "phase": self.phase.ravel(),
            "phase_error": self.phase_errors.ravel(),
        }

    def __repr__(self) -> str:
        return f"FrequencyResponse({len(self.frequencies)} frequencies, {', '.join(self.sources)})"


class TransientResponse(Table):
    """The response of an output to a unit step or impulse of an input, from rest. As a frame its index is the time.

    Attributes
    ----------
    time : ndarray, shape (K,)
        Seconds since it happened.
    values : ndarray, shape (K,)
        Units of the output per unit of the input.
    standard_errors : ndarray, shape (K,)
        NaN where no theory gives one.
    """

    _index = "time"

    def __init__(self, time: Array, values: Array, standard_errors: Array) -> None:
        self.time = time
        self.values = values
        self.standard_errors = standard_errors

    def _columns(self) -> dict[str, Any]:
        return {"time": self.time, "value": self.values, "standard_error": self.standard_errors}

    def __repr__(self) -> str:
        return f"TransientResponse({len(self.time)} samples, {self.values[-1]:g} at the end)"


class StateSpace(NamedTuple):
    """The innovations form, x(t+1) = F x(t) + G u(t) + K e(t), y(t) = H x(t) + D u(t) + e(t), in deviations from the offsets.

    A Kalman filter takes it with Q = K R K', S = K R and R = cov e, of which K is the steady gain.

    Attributes
    ----------
    F, G, H, D, K : ndarray, shapes (n, n), (n, inputs), (outputs, n), (outputs, inputs), (n, outputs)
        The matrices.
    noise_covariance : ndarray, shape (outputs, outputs)
        The covariance of e.
    sample_time : float
        Seconds from one sample to the next.
    inputs, outputs : list of str
        The names of the channels.

    Examples
    --------
    >>> import numpy as np
    >>> import thetahat as th
    >>> model = th.arx(th.dc_motor(), na=2, nb=2)
    >>> form = model.to_state_space()
    >>> bool(np.allclose(np.sort(np.linalg.eigvals(form.F)), np.sort(model.poles().real)))
    True
    """

    F: Array
    G: Array
    H: Array
    D: Array
    K: Array
    noise_covariance: Array
    sample_time: float
    inputs: list[str]
    outputs: list[str]

    def to_scipy(self) -> Any:
        """The response to the inputs as a discrete `scipy.signal.StateSpace`."""
        return _convert.state_space_to_scipy(self.F, self.G, self.H, self.D, self.sample_time)

    def to_control(self) -> Any:
        """The response to the inputs as a `control.StateSpace`."""
        matrices = (self.F, self.G, self.H, self.D)
        return _convert.state_space_to_control(*matrices, self.sample_time, self.inputs, self.outputs)
