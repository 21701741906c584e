"""Test signals for experiments, and what these are worth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Union, overload

import numpy as np
import numpy.typing as npt

from thetahat import _thetahat
from thetahat.base import numbers as _numbers
from thetahat.base.tables import Table, columns
from thetahat.engine import options as _options
from thetahat.engine.document import Document
from thetahat.engine.option_types import DesignOptions
from thetahat.models.model import Model

if TYPE_CHECKING:
    from typing_extensions import Unpack

Array = npt.NDArray[np.float64]

Wanted = Mapping[str, Union[float, str]]
"""The standard error that each figure may have: a number, or a fraction of the figure such as ``"2%"``."""


class TestSignal:
    """A signal to drive a plant with.

    Attributes
    ----------
    time : ndarray, shape (N,)
        Seconds.
    inputs : ndarray, shape (N, channels)
        The values, in units of the inputs.
    period : int or None
        After how many samples it repeats itself; None for what is random.
    frequencies : ndarray
        Those of its sinusoids in radians per second: of a multisine, rising, or of stepped sines, one after the other.
    mean, rms : ndarray, shape (channels,)
        The mean, and the root mean square of the deviations from it.
    crest_factor : ndarray, shape (channels,)
        The largest deviation over that; NaN for a constant.
    order : list of int
        The order of persistent excitation of each channel, 50 at most: a constant has 1, a sinusoid 2.
    spectrum : (ndarray, shape (K,), ndarray, shape (channels, K))
        Frequencies in radians per second, and the power spectral density of the deviations there.
    """

    # Its name does not make it a class of tests.
    __test__ = False

    def __init__(self, name: str, plan: str) -> None:
        channels, figures, period, frequencies, sample_time = _thetahat.design_signal(plan)
        self._name = name
        self.inputs: Array = np.column_stack(channels)
        self.time: Array = np.arange(len(self.inputs), dtype=np.float64) * sample_time
        self.period = period
        self.frequencies = frequencies
        self.mean: Array = np.array([mean for mean, *_ in figures])
        self.rms: Array = np.array([rms for _, rms, *_ in figures])
        self.crest_factor: Array = _numbers.of_document([crest for _, _, crest, *_ in figures])
        self.order = [order for _, _, _, order, *_ in figures]
        self.spectrum = figures[0][5], np.array([densities for *_, densities in figures])

    def __repr__(self) -> str:
        samples, channels = self.inputs.shape
        return f"TestSignal({self._name}, {samples} samples, {channels} channel{'' if channels == 1 else 's'})"


class ExperimentDesign(Document, Table):
    """What several signals are worth for a model: the document of ``thetahat design --for``. As a frame it has a row for each signal."""

    _index = "signal"

    def _columns(self) -> dict[str, Any]:
        errors = list(self.standard_errors.values())
        return {"signal": list(self.needed), **columns(errors), "needed": list(self.needed.values())}

    @property
    def warnings(self) -> list[str]:
        """There are none."""
        return []

    @property
    def figures(self) -> list[str]:
        """What is compared: parameters, gains and time constants."""
        return [figure["name"] for figure in self.document["figures"]]

    @property
    def standard_errors(self) -> dict[str, dict[str, float]]:
        """Of each signal the standard error that each figure would have; NaN where the signal leaves it open."""

        def errors(values: list[float | None]) -> dict[str, float]:
            return dict(zip(self.figures, _numbers.of_document(values).tolist()))

        return {one["signal"]: errors(one["standard_errors"]) for one in self.document["signals"]}

    @property
    def needed(self) -> dict[str, int | None]:
        """Of each signal the samples that it takes; None where a million are too few, or nothing is wanted."""
        return {one["signal"]: one["needed"] for one in self.document["signals"]}

    def __repr__(self) -> str:
        return f"ExperimentDesign({self.document['model']}, {', '.join(self.needed)})"


@overload
def design(signal: str = "prbs", **options: Unpack[DesignOptions]) -> TestSignal: ...
@overload
def design(
    signal: str | Sequence[str] | None = None,
    *,
    model: Model,
    want: Wanted | None = None,
    **options: Unpack[DesignOptions],
) -> ExperimentDesign: ...
@_options.takes(DesignOptions)
def design(
    signal: str | Sequence[str] | None = None,
    *,
    model: Model | None = None,
    want: Wanted | None = None,
    **options: Unpack[DesignOptions],
) -> TestSignal | ExperimentDesign:
    """Make a test signal for an experiment, or say which one a model needs, and for how long.

    Parameters
    ----------
    signal : {"prbs", "rbs", "multisine", "chirp", "white", "sines", "steps"}
        The kind of signal. After a colon stands for how many samples each value of a PRBS, an RBS, white noise or steps is held, such
        as ``"prbs:4"``. With a model there may be several; without any all kinds are compared.
    model : Model
        What is known of the plant and its noise: signals are then compared for it.
    want : dict of str to float or str
        The standard errors that are wanted, such as ``{"a1": 0.01, "dc-gain": "2%"}``: of a parameter, of ``dc-gain`` or
        ``time-constant``, with the number of the input or pole where there are several. The comparison then says how many samples
        each signal takes.
    length, range, rms, band, points, period, channels, sample_time, seed
        What the signal has to be, see `thetahat.DesignOptions`.

    Returns
    -------
    TestSignal or ExperimentDesign
        The signal, or with a model the comparison.

    Raises
    ------
    ValueError
        If an argument makes no sense or does not go with another one, or the model is of another kind, unstable, or without noise.

    Examples
    --------
    >>> import thetahat as th
    >>> signal = th.design("prbs", length=127, range=(0, 5))
    >>> signal.inputs.shape, signal.period, signal.order
    ((127, 1), 127, [31])
    >>> model = th.arx(th.dc_motor(), na=2, nb=2)
    >>> found = th.design(["prbs", "prbs:4", "steps"], model=model, want={"dc-gain": "2%"})
    >>> min(found.needed, key=lambda signal: found.needed[signal] or 10**7) in ("prbs:4", "steps")
    True
    """
    usual = [] if model is not None else ["prbs"]
    names = usual if signal is None else [signal] if isinstance(signal, str) else list(signal)
    signals = ",".join(_options.text("signal", name) for name in names) or None
    if model is None:
        if want is not None:
            raise ValueError("want: it needs a model; give one, or leave it out")
        return TestSignal(str(names[0]), _options.plan({"signal": signals, **options}))
    model = Model._read("model", model)
    wanted = ",".join(_want(figure, error) for figure, error in (want or {}).items()) or None
    return ExperimentDesign(*_thetahat.compare_signals(model._model, _options.plan({"signal": signals, "want": wanted, **options})))


def _want(figure: str, error: float | str) -> str:
    """A figure and its standard error, as a plan writes them."""
    return f"{_options.text('want', figure)}:{error if isinstance(error, str) else _options.number('want', error)}"
