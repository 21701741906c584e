"""Frequency responses from data, without a model."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from thetahat import _thetahat
from thetahat.base import numbers as _numbers
from thetahat.base.tables import Table
from thetahat.engine import options as _options
from thetahat.engine.document import Document
from thetahat.engine.option_types import SpectrumOptions
from thetahat.logs.log import Log, handle
from thetahat.models import convert as _convert
from thetahat.models.responses import FrequencyResponse

if TYPE_CHECKING:
    from typing_extensions import Unpack

Array = NDArray[np.float64]


class MeasuredResponse(Document, Table):
    """The frequency response estimated from a log, or measured elsewhere (`given`): the document of ``thetahat spectrum``.

    As a frame it has a row for each input and frequency.

    Examples
    --------
    >>> import thetahat as th
    >>> found = th.spectrum(th.dc_motor())
    >>> found
    MeasuredResponse(lpm, 200 frequencies, u)
    >>> found.honest
    True
    >>> found.magnitude.shape, found.coherence.shape
    ((1, 200), (200,))
    """

    @classmethod
    def given(
        cls,
        frequencies: ArrayLike,
        values: ArrayLike,
        *,
        input: str = "u",
        output: str = "y",
        standard_deviations: ArrayLike | None = None,
        held: float | None = None,
    ) -> MeasuredResponse:
        """The response of points that were measured elsewhere: by an analyser, or as an impedance.

        Parameters
        ----------
        frequencies : array_like, shape (K,)
            Radians per second, in any order.
        values : array_like of complex, shape (K,)
            The response at each.
        input, output : str
            What the channels are called.
        standard_deviations : array_like, shape (K,), optional
            That of the real part of each point, which is that of the imaginary part too. Without them fits count errors relative to
            each point, and find how large these are.
        held : float, optional
            For how many seconds the input was held from sample to sample; without it the input was a sine in continuous time.

        Returns
        -------
        MeasuredResponse

        Raises
        ------
        ValueError
            For points that are not finite, frequencies below 0 or above pi/held, arrays of other lengths.

        Examples
        --------
        The impedance of 10 ohm beside 1 F, in series with 2 ohm:

        >>> import numpy as np
        >>> import thetahat as th
        >>> omega = np.logspace(-3, 1, 30)
        >>> impedance = th.MeasuredResponse.given(omega, 2 + 10 / (1 + 10j * omega), input="current", output="voltage")
        >>> impedance
        MeasuredResponse(given, 30 frequencies, current)
        >>> th.process(impedance, "rc1").parameters.round(6)
        array([ 2., 10., 10.])
        """
        omega = _numbers.column("frequencies", frequencies)
        points = np.asarray(values, dtype=np.complex128)
        deviations = None if standard_deviations is None else _numbers.column("standard_deviations", standard_deviations)
        for name, array in (("values", points), ("standard_deviations", deviations)):
            if array is not None and array.shape != omega.shape:
                raise ValueError(f"{name}: {array.shape} beside frequencies {omega.shape}: give one for each frequency")
        own = None if deviations is None else deviations.tolist()
        return cls(*_thetahat.given_response(input, output, omega.tolist(), points.real.tolist(), points.imag.tolist(), own, held))

    def within(self, low: float, high: float) -> MeasuredResponse:
        """The points from one frequency to another, in radians per second.

        Parameters
        ----------
        low, high : float
            The ends, both included.

        Returns
        -------
        MeasuredResponse

        Raises
        ------
        ValueError
            If there is no point between them above frequency 0.

        Examples
        --------
        >>> import thetahat as th
        >>> th.MeasuredResponse.given([1.0, 2.0, 4.0], [1.0, 0.5, 0.2]).within(1, 3).frequencies
        array([1., 2.])
        """
        return type(self)(*_thetahat.response_within(self.to_json(), low, high))

    @property
    def inputs(self) -> list[str]:
        """The inputs that the response is from."""
        return [response["input"] for response in self.document["responses"]]

    @property
    def output(self) -> str:
        """The output that it is to."""
        return str(self.document["output"])

    @property
    def method(self) -> dict[str, Any]:
        """How it was estimated: its ``name`` and its sizes, those that were chosen too."""
        return dict(self.document["method"])

    @property
    def frequencies(self) -> Array:
        """Radians per second, shape (K,)."""
        return _numbers.of_document([point["frequency"] for point in self.document["noise"]])

    @property
    def values(self) -> NDArray[np.complex128]:
        """The response from each input, shape (inputs, K); NaN where "sines" have none from it."""
        re, im = self._points(lambda point: point["re"]), self._points(lambda point: point["im"])
        return re + 1j * im

    @property
    def magnitude(self) -> Array:
        """Units of the output per unit of the input, shape (inputs, K)."""
        return self._points(lambda point: point["magnitude"]["value"])

    @property
    def magnitude_errors(self) -> Array:
        """Standard errors of the magnitude; NaN where there are none."""
        return self._points(lambda point: point["magnitude"]["standard_error"])

    @property
    def magnitude_intervals(self) -> Array:
        """95 % intervals of the magnitude, shape (inputs, K, 2); NaN where there are none."""
        return self._intervals("magnitude")

    @property
    def phase(self) -> Array:
        """Radians, shape (inputs, K)."""
        return self._points(lambda point: point["phase"]["value"])

    @property
    def phase_errors(self) -> Array:
        """Standard errors of the phase; NaN where there are none."""
        return self._points(lambda point: point["phase"]["standard_error"])

    @property
    def phase_intervals(self) -> Array:
        """95 % intervals of the phase, shape (inputs, K, 2); NaN where there are none."""
        return self._intervals("phase")

    @property
    def coherence(self) -> Array:
        """The part of the output's power that the inputs explain, 0 to 1, shape (K,); NaN where the method does not tell."""
        return _numbers.of_document([point["coherence"] for point in self.document["noise"]])

    @property
    def noise(self) -> Array:
        """The one-sided power spectral density of the rest, in units squared per radian per second, shape (K,)."""
        return _numbers.of_document([point["density"] for point in self.document["noise"]])

    @property
    def honest(self) -> bool | None:
        """Whether the 95 % intervals hold what they say; None where it is not known, or there are none."""
        honest: bool | None = self.document["bands"]["honest"]
        return honest

    @property
    def sample_time(self) -> float:
        """Seconds from one row to the next; of sines in continuous time half the period of the highest frequency."""
        return float(self.document["sample_time"])

    @property
    def continuous(self) -> bool:
        """Whether it is of sines in continuous time, and not of inputs that are held from row to row."""
        return bool(self.document.get("continuous", False))

    def to_control(self) -> Any:
        """The response as a `control.FrequencyResponseData`, of one output and all inputs.

        Raises
        ------
        ValueError
            If the inputs have sines of their own, at frequencies of their own.
        ImportError
            If python-control is not installed.

        Examples
        --------
        >>> import thetahat as th
        >>> th.spectrum(th.dc_motor()).to_control().shape  # doctest: +SKIP
        (1, 1)
        """
        return _convert.response_to_control(
            self.values, self.frequencies, 0.0 if self.continuous else self.sample_time, self.inputs, self.output
        )

    def to_frequency_response(self) -> FrequencyResponse:
        """The response as models have theirs, for `thetahat.plot.bode`; the noise is its source "noise" without a phase."""
        columns = [self.values.real, self.values.imag, self.magnitude, self.magnitude_errors, self.phase, self.phase_errors]
        sources: list[tuple[str | None, Sequence[Array]]] = [
            (name, [self.frequencies, *(column[row] for column in columns)]) for row, name in enumerate(self.inputs)
        ]
        nothing = np.full(len(self.frequencies), np.nan)
        amplitude = np.sqrt(self.noise * np.pi / self.sample_time)
        sources.append((None, [self.frequencies, amplitude, nothing, amplitude, nothing, nothing, nothing]))
        return FrequencyResponse(sources, self.output)

    def _columns(self) -> dict[str, Any]:
        count, inputs = len(self.frequencies), len(self.inputs)
        found: dict[str, Any] = {
            "input": [name for name in self.inputs for _ in range(count)],
            "frequency": np.tile(self.frequencies, inputs),
        }
        for name, values, ends in (
            ("magnitude", self.magnitude, self.magnitude_intervals),
            ("phase", self.phase, self.phase_intervals),
        ):
            lower, upper = np.moveaxis(ends, -1, 0)
            found |= {name: values.ravel(), f"{name}_lower": lower.ravel(), f"{name}_upper": upper.ravel()}
        return found | {"coherence": np.tile(self.coherence, inputs), "noise": np.tile(self.noise, inputs)}

    def _points(self, of: Any) -> Array:
        frequencies = [point["frequency"] for point in self.document["noise"]]
        rows = []
        for response in self.document["responses"]:
            known = {point["frequency"]: of(point) for point in response["points"]}
            rows.append(_numbers.of_document([known.get(frequency) for frequency in frequencies]))
        return np.array(rows)

    def _intervals(self, what: str) -> Array:
        def end(name: str) -> Array:
            return self._points(lambda point: (point[what].get("interval") or {}).get(name))

        return np.stack([end("lower"), end("upper")], axis=-1)

    def __repr__(self) -> str:
        count = len(self.document["noise"])
        return f"MeasuredResponse({self.method['name']}, {count} frequencies, {', '.join(self.inputs)})"


@_options.takes(SpectrumOptions)
def spectrum(
    log: Log,
    **options: Unpack[SpectrumOptions],
) -> MeasuredResponse:
    """Estimate the frequency response from the inputs of a log to its output, without a model.

    Parameters
    ----------
    log : Log
        The data, of one output; a log of several experiments is several segments.
    method : {"lpm", "spa", "welch", "etfe", "sines"}, default "lpm"
        Local polynomials, windowed covariances, averages over windows, the plain ratio of the transforms, or correlation over
        whole periods of a stepped or a multi-sine input.
    frequencies, points, half_width, lags, window, estimator, period, discard, rows, detrend
        See `thetahat.SpectrumOptions`.

    Returns
    -------
    MeasuredResponse

    Raises
    ------
    ValueError
        For options that make no sense, or a log that does not hold what is needed.
    EstimationError
        If an input is constant, or has no power at any of the frequencies.

    Examples
    --------
    >>> import thetahat as th
    >>> log = th.dc_motor()
    >>> found = th.spectrum(log, method="spa", lags=50, frequencies=[10, 30, 100])
    >>> found.frequencies
    array([ 10.,  30., 100.])
    >>> th.spectrum(log, frequencies=(1, 300), points=50)
    MeasuredResponse(lpm, 50 frequencies, u)
    """
    plan = _options.plan(options, len(log) if isinstance(log, Log) else None)
    return MeasuredResponse(*_thetahat.spectrum(handle("log", log), plan))
