"""Fitted models and their responses."""

from __future__ import annotations

import json
import warnings
from collections.abc import Mapping, Sequence
from functools import cached_property
from html import escape
from statistics import NormalDist
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from thetahat import _files, _numbers, _options, _picture, _thetahat
from thetahat._judgement import Validation
from thetahat._log import Log, handle
from thetahat._options import Rows, ValidationOptions
from thetahat._responses import Forecast, FrequencyResponse, StateSpace, TransientResponse

if TYPE_CHECKING:
    import os

Array = npt.NDArray[np.float64]


class Model:
    """An estimated model, A(q) y(t) = sum_j B_j(q)/F_j(q) u_j(t) + C(q)/D(q) e(t), and the report of its fit.

    Polynomials are written in rising powers of q^-1, which delays by one sample: ``b[j][i]`` multiplies u_j(t - i). Signals
    go in and come out in the units of the log; the offsets that were removed before the fit are part of the model.

    Models are made by `arx`, `armax`, `oe`, `bj`, `ar`, `arma`, `pem`, `iv`, `sriv`, `search` and `from_json`. They do not
    change; they pickle and copy.

    Examples
    --------
    >>> import thetahat as th
    >>> log = th.dc_motor()
    >>> model = th.arx(log[:700], na=2, nb=2)
    >>> model
    Model(ARX(2, 2, 1), 1-step fit 98.06 % on rows 1..700)
    >>> round(model.validate(log[700:]).fit(1), 2)
    98.12
    """

    _model: _thetahat.Model

    def __init__(self) -> None:
        raise TypeError("models are made by fits such as thetahat.arx(log, na=2, nb=2), or by Model.from_json(text)")

    @classmethod
    def _of(cls, model: _thetahat.Model) -> Model:
        made = object.__new__(cls)
        made._model = model
        return made

    @classmethod
    def from_json(cls, text: str) -> Model:
        """Read a model back from the document that `to_json` or ``thetahat fit`` wrote.

        Parameters
        ----------
        text : str
            The document.

        Raises
        ------
        ValueError
            If it is not such a document, with line and column, or was damaged.
        """
        return cls._of(_thetahat.Model.from_json(_options.text("text", text)))

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> Model:
        """Read a model back from a file."""
        with open(_files.name(path), encoding="utf-8") as file:
            return cls.from_json(file.read())

    def to_json(self) -> str:
        """The document of ``thetahat fit``: of the same file the same bytes."""
        return self._model.to_json()

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write the document to a file, whole or not at all."""
        _thetahat.write(_files.name(path), self.to_json())

    def write_html(self, path: str | os.PathLike[str], log: Log | None = None) -> None:
        """Write a page with charts, which loads nothing from elsewhere.

        Parameters
        ----------
        path : str or path
            The file to write; it is written whole or not at all.
        log : Log, optional
            Data to look at, such as those of the fit.
        """
        _thetahat.write(_files.name(path), self._model.page(None if log is None else handle("log", log), "thetahat.Model.write_html"))

    def summary(self) -> str:
        """The table that ``thetahat fit`` prints.

        Examples
        --------
        >>> import thetahat as th
        >>> print(th.arx(th.dc_motor(), na=2, nb=2).summary().splitlines()[0])
        ARX: A(q) y(t) = B(q) u(t) + e(t), sample time 0.01 s
        """
        return self._model.table()

    @cached_property
    def document(self) -> dict[str, Any]:
        """The document as a dict: whatever has no attribute of its own."""
        document: dict[str, Any] = json.loads(self.to_json())
        return document

    # The figures of the fit take longer than least squares: what does not need them does not wait for them.
    @cached_property
    def _parts(self) -> tuple[dict[str, Any], dict[str, Any]]:
        model, estimation = self._model.parts()
        return json.loads(model), json.loads(estimation)

    @property
    def _own(self) -> dict[str, Any]:
        return self._parts[0]

    @property
    def _estimation(self) -> dict[str, Any]:
        return self._parts[1]

    @property
    def name(self) -> str:
        """Structure and orders, such as ``ARX(2, 2, 1)``."""
        return self._model.name()

    @property
    def structure(self) -> str:
        """Which polynomials there are, such as ``"arx"``."""
        return str(self._own["structure"])

    @property
    def orders(self) -> dict[str, Any]:
        """na, nb, nc, nd, nf, nk; nb, nf and nk have one for each input."""
        return dict(self._own["orders"])

    @property
    def parameters(self) -> Array:
        """The estimates, shape (p,), in the order of `parameter_names`."""
        return np.array([parameter["value"] for parameter in self._own["parameters"]])

    @property
    def parameter_names(self) -> list[str]:
        """Such as ``a1`` or ``b3``: the letter of the polynomial and the power of q^-1."""
        return [parameter["name"] for parameter in self._own["parameters"]]

    @property
    def standard_errors(self) -> Array:
        """The square roots of the parameters' variances, shape (p,); NaN where no theory gives one."""
        return _array([parameter["standard_error"] for parameter in self._own["parameters"]])

    @property
    def covariance(self) -> Array | None:
        """The covariance matrix of the parameters, shape (p, p); None where no theory gives one."""
        covariance = self._own["covariance"]
        return None if covariance is None else np.array(covariance).reshape(2 * (len(self._own["parameters"]),))

    def confidence_interval(self, level: float = 0.95) -> Array:
        """The intervals that hold the parameters with this probability, shape (p, 2).

        Examples
        --------
        >>> import thetahat as th
        >>> th.arx(th.dc_motor(), na=2, nb=2).confidence_interval().round(2)
        array([[-1.56, -1.53],
               [ 0.56,  0.6 ],
               [ 0.34,  0.38],
               [ 0.28,  0.34]])
        """
        if not 0 < level < 1:
            raise ValueError(f"level: {level} is not between 0 and 1; give one such as 0.95")
        half = NormalDist().inv_cdf((1 + level) / 2) * self.standard_errors
        return np.column_stack([self.parameters - half, self.parameters + half])

    @property
    def a(self) -> Array:
        """A, monic, in rising powers of q^-1."""
        return np.array(self._own["a"])

    @property
    def b(self) -> list[Array]:
        """B of each input, with its nk leading zeros."""
        return [np.array(b) for b in self._own["b"]]

    @property
    def c(self) -> Array:
        """C, monic."""
        return np.array(self._own["c"])

    @property
    def d(self) -> Array:
        """D, monic."""
        return np.array(self._own["d"])

    @property
    def f(self) -> list[Array]:
        """F of each input, monic."""
        return [np.array(f) for f in self._own["f"]]

    @property
    def noise_variance(self) -> float:
        """The variance of e: the sum of squared residuals over N - p."""
        return float(self._own["noise_variance"])

    @property
    def sample_time(self) -> float:
        """Seconds from one sample to the next."""
        return float(self._own["sample_time"])

    @property
    def inputs(self) -> list[str]:
        """The names of the inputs."""
        return [signal["name"] for signal in self._own["inputs"]]

    @property
    def output(self) -> str:
        """The name of the output."""
        return str(self._own["output"]["name"])

    @property
    def offsets(self) -> dict[str, tuple[float, float]]:
        """What was taken from each channel before the fit: its level, and its slope per second."""
        signals = [*self._own["inputs"], self._own["output"]]
        return {signal["name"]: (signal["offset"]["level"], signal["offset"]["slope"]) for signal in signals}

    @property
    def stable(self) -> bool:
        """Whether all poles lie inside the unit circle."""
        return bool(self._own["stable"])

    def poles(self) -> npt.NDArray[np.complex128]:
        """The roots of A and of each F in the z plane."""
        return _roots(self._own["poles"])

    def zeros(self, input: int | str = 0) -> npt.NDArray[np.complex128]:
        """The finite roots of an input's B in the z plane."""
        return _roots(self._own["zeros"][self._input(input)])

    def noise_poles(self) -> npt.NDArray[np.complex128]:
        """The roots of D: what the noise has beside the roots of A."""
        return _roots(self._own["noise_poles"])

    def noise_zeros(self) -> npt.NDArray[np.complex128]:
        """The roots of C."""
        return _roots(self._own["noise_zeros"])

    def dc_gain(self, input: int | str = 0) -> tuple[float, float]:
        """The static gain from an input and its standard error; NaN at an integrator.

        Near an integrator the gain is far from normal; `dc_gain_interval` holds there too.
        """
        gain = self._own["dc_gain"][self._input(input)]
        if gain is None:
            return (np.nan, np.nan)
        return (float(gain["value"]), float("nan" if gain["standard_error"] is None else gain["standard_error"]))

    def time_constants(self) -> Array:
        """-T/ln|p| in seconds for each of `poles`, T being the sample time; NaN for |p| >= 1."""
        constants = self._own["time_constants"]
        return _array([None if constant is None else constant["value"] for constant in constants])

    def dc_gain_interval(self, input: int | str = 0) -> Array:
        """The interval that holds the static gain with a probability of 95 %, shape (2,), by Fieller's theorem.

        Infinite where it has no end, as near an integrator; NaN where there is no gain or no standard error.

        Examples
        --------
        >>> import thetahat as th
        >>> th.arx(th.dc_motor(), na=2, nb=2).dc_gain_interval().round(1)
        array([18.3, 19.6])
        """
        return _interval(self._own["dc_gain"][self._input(input)])

    def time_constant_intervals(self) -> Array:
        """The intervals that hold the `time_constants` with a probability of 95 % each, shape (n, 2).

        From the intervals of the poles' moduli; infinite where a pole may be an integrator, NaN where nothing is known.
        """
        return np.array([_interval(constant) for constant in self._own["time_constants"]]).reshape(-1, 2)

    def _input(self, input: int | str) -> int:
        """The position of an input."""
        if isinstance(input, str):
            if input not in self.inputs:
                raise ValueError(f"input: there is no input '{input}'; there are: {', '.join(self.inputs) or 'none'}")
            return self.inputs.index(input)
        index = _options.integer("input", input)
        if not 0 <= index < len(self.inputs):
            raise ValueError(f"input: there is no input {index}; the model has {len(self.inputs)}, counted from 0")
        return index

    def _inputs_of(self, u: Any) -> Any:
        """The columns of a frame or of a dict by the names of the inputs, in their order; what has no names as it is."""
        columns = _numbers.named("u", u)
        if columns is None:
            return u
        if len(columns) == len(self.inputs) == 1 and not isinstance(u, Mapping):
            return columns[0][1]
        there = dict(columns)
        for name in self.inputs:
            if name not in there:
                names = ", ".join(map(repr, there)) or "none"
                raise ValueError(f"u: there is no column {name!r}, which is an input of the model; there are {names}")
        return np.column_stack([_numbers.column(f"u: column {name!r}", there[name]) for name in self.inputs])

    @property
    def method(self) -> str:
        """How the model was estimated."""
        return str(self._estimation["method"])

    @property
    def samples(self) -> int:
        """N, the samples that count in the fit."""
        return int(self._estimation["samples"])

    @property
    def mse(self) -> float:
        """The mean of e^2 over these samples."""
        return float(self._estimation["mse"])

    @property
    def criteria(self) -> dict[str, float]:
        """FPE, AIC, AICc and MDL for each sample, as Ljung counts them; NaN where one is not defined. `aic` and `bic` are those
        of the whole log."""
        estimation = self._estimation
        names = ("fpe", "aic", "aicc", "mdl")
        return {name: float("nan" if estimation.get(name) is None else estimation[name]) for name in names}

    @property
    def log_likelihood(self) -> float:
        """The logarithm of the likelihood of the fit, as statsmodels counts it.

        Notes
        -----
        For Gaussian errors with the variance V that makes it largest, the mean of e^2 over the N samples that count::

            ln L = -N/2 (ln 2 pi + ln V + 1)

        It is the likelihood given the samples that do not count (the conditional one), of a fit by least squared errors of
        which V is the least. NaN for an exact fit.

        References
        ----------
        Akaike, A new look at the statistical model identification, 1974. Schwarz, Estimating the dimension of a model, 1978.
        """
        return -self.samples / 2 * (np.log(2 * np.pi) + np.log(self.mse) + 1) if self.mse > 0 else np.nan

    @property
    def aic(self) -> float:
        """Akaike's information criterion as statsmodels counts it, -2 ln L + 2 (p + 1), with the p parameters and V.

        A level and a slope that were estimated count among them.

        It is on another scale than ``criteria["aic"]``, which is ln V + 2 p/N: N (AIC + ln 2 pi + 1) + 2. Both order models
        that were fitted to the same samples in the same way.

        Examples
        --------
        >>> import numpy as np
        >>> import thetahat as th
        >>> model = th.arx(th.dc_motor(), na=2, nb=2)
        >>> bool(np.isclose(model.aic, model.samples * (model.criteria["aic"] + np.log(2 * np.pi) + 1) + 2))
        True
        """
        return -2 * self.log_likelihood + 2 * (self._estimated + 1)

    @property
    def bic(self) -> float:
        """Schwarz's Bayesian information criterion as statsmodels counts it, -2 ln L + (p + 1) ln N.

        It is N (MDL + ln 2 pi + 1) + ln N, where MDL, ``criteria["mdl"]``, is ln V + p ln(N)/N.
        """
        return -2 * self.log_likelihood + (self._estimated + 1) * float(np.log(self.samples))

    @property
    def _estimated(self) -> int:
        levels = [self._estimation.get(name) for name in ("level", "slope")]
        return len(self.parameters) + sum(level is not None for level in levels)

    @property
    def fits(self) -> list[dict[str, Any]]:
        """How well the model fits: one entry for each part of the log and horizon."""
        return list(self.document["fit"])

    @property
    def selection(self) -> dict[str, Any] | None:
        """How the model was chosen among others, if it was."""
        return self.document.get("selection")

    @property
    def warnings(self) -> list[str]:
        """What a careful reader should know, in plain words."""
        return [_thetahat.in_python(warning) for warning in self.document["warnings"]]

    def predict(self, log: Log, horizon: int | None = 1, *, initial: str = "auto") -> Array:
        """The prediction of each row from what was known some steps before, in the units of the log.

        Parameters
        ----------
        log : Log
            The data; its channels are found by name.
        horizon : int or None, default 1
            Steps ahead. None is a free run: the inputs alone drive the model.
        initial : {"auto", "drop", "zero", "estimate"}, default "auto"
            What stands before the first sample of a stretch, in the words of the fits: nothing ("drop": measured samples
            start the prediction, and the first ones have none), zeros, or what fits best. "auto" is "drop" where the
            model needs no more, else "estimate"; "zero" where the log has no output.

        Returns
        -------
        ndarray, shape (N,)
            NaN where there is no prediction: in gaps, and before a start. Free runs, and predictions of models without A, C
            and D, go on where the output alone is missing.

        Raises
        ------
        ValueError
            If a channel is not in the log, its sample time is not the model's, or an argument is out of its range.

        Examples
        --------
        >>> import thetahat as th
        >>> log = th.dc_motor()
        >>> model = th.arx(log, na=2, nb=2)
        >>> model.predict(log).shape
        (1000,)
        """
        return self._predicted(log, horizon, initial)[0]

    def predict_interval(
        self, log: Log, horizon: int = 1, *, level: float = 0.95, initial: str = "auto"
    ) -> tuple[Array, Array]:
        """Intervals that hold the output, as far as one knows some steps before.

        They count what the noise does and how uncertain the parameters are, on a log that the model was not fitted to.

        Parameters
        ----------
        log, horizon, initial
            As for `predict`; there are none in a free run.
        level : float, default 0.95
            The probability with which they hold it.

        Returns
        -------
        lower, upper : ndarray, shape (N,)
            NaN where there is no prediction.
        """
        if not 0 < level < 1:
            raise ValueError(f"level: {level} is not between 0 and 1; give one such as 0.95")
        values, deviations = self._predicted(log, _options.integer("horizon", horizon), initial)
        half = NormalDist().inv_cdf((1 + level) / 2) * (np.nan if deviations is None else deviations)
        return values - half, values + half

    def _predicted(self, log: Log, horizon: int | None, initial: str) -> tuple[Array, Array | None]:
        if horizon is not None:
            horizon = _options.count("horizon", horizon, 1_000_000)
        return self._model.predict(handle("log", log), horizon, initial)

    def simulate(self, u: _numbers.Columns | Log, *, initial: str = "auto") -> Array:
        """The free run on inputs, in the units of the log.

        Parameters
        ----------
        u : array_like, shape (N,) or (N, inputs), or data frame, dict of str to array_like, or Log
            The inputs. Those of a frame, dict or log are found by name.
        initial : {"auto", "drop", "zero", "estimate"}, default "auto"
            What stands before the first sample, as for `predict`. "auto" is "zero" for inputs alone, and "estimate" for a
            log with the output, as of ``thetahat simulate``.

        Returns
        -------
        ndarray, shape (N,)

        Examples
        --------
        >>> import numpy as np
        >>> import thetahat as th
        >>> model = th.arx(th.dc_motor(), na=2, nb=2)
        >>> y = model.simulate(np.full(500, 4.0))
        >>> bool(np.isclose(y[-1], model.offsets["y"][0] + (4 - model.offsets["u"][0]) * model.dc_gain()[0]))
        True
        """
        if isinstance(u, Log):
            return self._predicted(u, None, initial)[0]
        if initial not in ("auto", "zero"):
            raise ValueError(f"initial: inputs alone start from zero, not '{initial}'; give a Log to start from its output")
        return self._model.simulate(self._inputs_of(u))

    def sample(
        self, u: _numbers.Columns | Log, draws: int = 100, *, seed: int = 0, initial: str = "auto"
    ) -> Array:
        """Free runs drawn from what the estimate leaves open: its noise, and its parameters within their covariance.

        Parameters
        ----------
        u : array_like, shape (N,) or (N, inputs), or data frame, dict of str to array_like, or Log
            The inputs, as for `simulate`; of a model without inputs a Log, whose rows say how long the runs are.
        draws : int, default 100
            How many runs, up to 100000.
        seed : int, default 0
            Which ones: the same seed gives the same runs.
        initial : {"auto", "drop", "zero", "estimate"}, default "auto"
            What stands before the first sample, as for `simulate`. From zero the noise starts at rest too; else it has run
            before.

        Returns
        -------
        ndarray, shape (draws, N)
            In the units of the log; NaN where `simulate` gives NaN.

        Warns
        -----
        EstimationWarning
            If parameters that were drawn made an unstable model of a stable one, and were drawn again; if the covariance of
            the parameters is not known, so that the runs differ in their noise alone.

        Notes
        -----
        Each run is B/(A F) u + C/(A D) e with parameters from a normal distribution of the covariance of the estimate, and e
        of its noise variance.

        Examples
        --------
        >>> import numpy as np
        >>> import thetahat as th
        >>> log = th.dc_motor()
        >>> model = th.bj(log[:700], nb=2, nc=0, nd=1, nf=2)
        >>> low, high = np.quantile(model.sample(log[700:], draws=200), [0.025, 0.975], axis=0)
        >>> bool(np.mean((low < log.y[700:]) & (log.y[700:] < high)) > 0.8)
        True
        """
        from thetahat._fit import EstimationWarning

        draws = _options.count("draws", draws, 100_000)
        seed = _options.integer("seed", seed)
        if not 0 <= seed < 2**64:
            raise ValueError(f"seed: {seed} is outside 0..2^64 - 1")
        if isinstance(u, Log):
            runs, unstable, varied = self._model.sample(handle("log", u), None, draws, seed, initial)
        else:
            if initial not in ("auto", "zero"):
                raise ValueError(f"initial: inputs alone start from zero, not '{initial}'; give a Log to start from its output")
            runs, unstable, varied = self._model.sample(None, self._inputs_of(u), draws, seed, "zero")
        if not varied:
            message = "the covariance of the parameters is not known: the runs differ in their noise alone"
            warnings.warn(message, EstimationWarning, stacklevel=2)
        if unstable:
            message = f"parameters of an unstable model were drawn {unstable} times, and drawn again"
            warnings.warn(message, EstimationWarning, stacklevel=2)
        return runs

    def forecast(
        self, log: Log, steps: int, u: _numbers.Columns | None = None, *, initial: str = "auto"
    ) -> Forecast:
        """What comes after the end of a log.

        Where the log ends in missing outputs it goes on from the last measured one, with as many more steps: the deviations
        grow accordingly. The inputs of these rows must be in the log.

        Parameters
        ----------
        log : Log
            What is known.
        steps : int
            How far to look.
        u : array_like, shape (steps,) or (steps, inputs), or data frame or dict of str to array_like
            The inputs in these steps, of a model that has some. Those of a frame or dict are found by name.
        initial : {"auto", "drop", "zero", "estimate"}, default "auto"
            As for `predict`.

        Returns
        -------
        Forecast

        Raises
        ------
        ValueError
            If a channel is not in the log, its sample time is not the model's, or an argument is out of its range.

        Examples
        --------
        >>> import thetahat as th
        >>> log = th.dc_motor()
        >>> model = th.arx(log, na=2, nb=2)
        >>> model.forecast(log[:900], 3, log.u[900:903]).values.shape
        (3,)
        """
        steps = _options.count("steps", steps, 1_000_000)
        future = None if u is None else self._inputs_of(u)
        values, deviations = self._model.forecast(handle("log", log), steps, future, initial)
        time = log.time[-1] + self.sample_time * np.arange(1, steps + 1)
        return Forecast(time, values, deviations, log._clock.after(steps, self.sample_time))

    def residuals(self, log: Log, horizon: int = 1, *, initial: str = "auto") -> Array:
        """The measured output less its prediction.

        Parameters
        ----------
        log, horizon, initial
            As for `predict`.

        Returns
        -------
        ndarray, shape (N,)
            NaN where there is no prediction, or no measured output.

        Examples
        --------
        >>> import numpy as np
        >>> import thetahat as th
        >>> model = th.arx(th.dc_motor(), na=2, nb=2)
        >>> bool(np.isclose(np.nanmean(model.residuals(th.dc_motor()) ** 2), model.mse))
        True
        """
        values = self.predict(log, horizon, initial=initial)
        return log[self.output] - values

    def validate(
        self,
        log: Log,
        require: str | Sequence[str] | None = None,
        *,
        rows: Rows | None = None,
        detrend: str | None = None,
        horizon: int | Sequence[int] | None = None,
        lags: int | None = None,
        alpha: float | None = None,
        alphas: Sequence[float] | None = None,
    ) -> Validation:
        """Say how the model does on a log: fits, tests of its residuals, coverage of its intervals.

        Parameters
        ----------
        log : Log
            The data, best those that the model was not fitted to.
        require : str or sequence of str, optional
            What the model must be or do: ``white``, ``independent``, ``stable``, ``fit>=80``, ``fit@5>=80``,
            ``mean-error<=0.5``, ``largest-error@5<=2`` (of ``|e|``, in units of the output), ``coverage>=90``.
            `Validation.unmet` says what it is not.
        rows, detrend, horizon, lags, alpha, alphas
            What to validate on and how, see `thetahat.ValidationOptions`.

        Returns
        -------
        Validation

        Raises
        ------
        ValueError
            If a channel is not in the log, its sample time is not the model's, or an argument is out of its range.

        Examples
        --------
        >>> import thetahat as th
        >>> log = th.dc_motor()
        >>> model = th.bj(log[:700], nb=2, nc=0, nd=1, nf=2)
        >>> model.validate(log[700:], require=["white", "independent", "fit>=90"]).unmet
        []
        """
        words = _options.words(ValidationOptions, locals(), len(log) if isinstance(log, Log) else None)
        words += [f"--require={one}" for one in ([require] if isinstance(require, str) else require or ())]
        return Validation._of(_thetahat.validate(self._model, handle("log", log), words))

    def frequency_response(self, w: npt.ArrayLike | None = None, *, points: int = 100) -> FrequencyResponse:
        """The response of the output to each input, and to the noise, at some frequencies.

        Parameters
        ----------
        w : array_like, optional
            Frequencies in radians per second. Without them, so many points evenly on a logarithmic scale up to pi over the
            sample time.
        points : int, default 100
            How many.

        Returns
        -------
        FrequencyResponse

        Examples
        --------
        >>> import thetahat as th
        >>> response = th.arx(th.dc_motor(), na=2, nb=2).frequency_response([0.1, 1.0, 10.0])
        >>> abs(response.values[0]).round(1)
        array([19. , 18.9, 13.4])
        """
        points = _options.count("points", points)
        return FrequencyResponse(self._model.frequency_response(w, points))

    def step_response(self, input: int | str = 0, samples: int | None = None) -> TransientResponse:
        """The response of the output to a unit step of an input, from rest, counted from 0.

        Parameters
        ----------
        input : int or str, default 0
            Which input: its position, or its name.
        samples : int, optional
            How many; until it has settled, unless said otherwise.

        Returns
        -------
        TransientResponse

        Examples
        --------
        >>> import thetahat as th
        >>> response = th.arx(th.dc_motor(), na=2, nb=2).step_response(samples=3)
        >>> response.time
        array([0.  , 0.01, 0.02])
        """
        return TransientResponse(*self._model.step_response(*self._source(input, samples)))

    def impulse_response(self, input: int | str = 0, samples: int | None = None) -> TransientResponse:
        """The impulse response from an input: the coefficients g_i of B/(A F) = g_0 + g_1 q^-1 + …

        The input is 1 in the sample at time 0 and 0 afterwards. The sums of the response are the step response.

        Parameters
        ----------
        input : int or str, default 0
            Which input: its position, or its name.
        samples : int, optional
            How many; until it has settled, unless said otherwise.

        Returns
        -------
        TransientResponse

        References
        ----------
        Ljung, System Identification, 2nd ed. 1999, sections 2.1 and 9.4.

        Examples
        --------
        >>> import numpy as np
        >>> import thetahat as th
        >>> model = th.arx(th.dc_motor(), na=2, nb=2)
        >>> impulse, step = model.impulse_response(samples=50), model.step_response(samples=50)
        >>> bool(np.allclose(np.cumsum(impulse.values), step.values))
        True
        """
        return TransientResponse(*self._model.impulse_response(*self._source(input, samples)))

    def _source(self, input: int | str, samples: int | None) -> tuple[int, int | None]:
        return self._input(input), None if samples is None else _options.count("samples", samples)

    def to_state_space(self) -> StateSpace:
        """The innovations form, x(t+1) = F x(t) + G u(t) + K e(t), y(t) = H x(t) + D u(t) + e(t), in deviations.

        Examples
        --------
        >>> import thetahat as th
        >>> th.arx(th.dc_motor(), na=2, nb=2).to_state_space().F.shape
        (2, 2)
        """
        matrices = self._model.state_space()
        return StateSpace(*matrices, self.noise_variance, self.sample_time, self.inputs, self.output)

    def to_scipy(self) -> Any:
        """The plant as a discrete transfer function of SciPy; of several inputs, a list of them.

        Returns
        -------
        scipy.signal.dlti, or a list of them
            B/(A F) of each input, in deviations from the offsets.
        """
        from thetahat import _convert

        return _convert.to_scipy(self.b, self._denominators(), self.sample_time)

    def to_control(self) -> Any:
        """The plant as a transfer function of python-control, with one output and the inputs by name.

        Returns
        -------
        control.TransferFunction
            B/(A F) of each input, in deviations from the offsets.
        """
        from thetahat import _convert

        return _convert.to_control(self.b, self._denominators(), self.sample_time, self.inputs, self.output)

    def _denominators(self) -> list[Array]:
        return [np.convolve(self.a, f) for f in self.f]

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Model):
            return NotImplemented
        return self.to_json() == other.to_json()

    def __hash__(self) -> int:
        return hash(self.to_json())

    def __reduce__(self) -> tuple[Any, ...]:
        return (Model.from_json, (self.to_json(),))

    def __copy__(self) -> Model:
        return self

    def __deepcopy__(self, memo: dict[int, Any]) -> Model:
        # Nothing can change a model.
        return self

    def __repr__(self) -> str:
        shown = [fit for fit in self.fits if fit["horizon"].get("steps") == 1 and fit["percent"] is not None]
        if not shown:
            return f"Model({self.name})"
        rows = ", ".join(f"{first}..{last}" for first, last in shown[-1]["rows"][:3])
        return f"Model({self.name}, 1-step fit {shown[-1]['percent']:.2f} % on rows {rows})"

    def _repr_html_(self) -> str:
        steps = [(f"step of {name}", [self.step_response(index).values]) for index, name in enumerate(self.inputs)]
        table = _picture.rows(repr(self), steps)
        return f"{table}<pre>{escape(self.summary())}</pre>"


def _array(values: Sequence[float | None]) -> Array:
    return np.array([np.nan if value is None else value for value in values], dtype=np.float64)


def _interval(quantity: dict[str, Any] | None) -> Array:
    """The ends of a figure's interval: infinite where there is none, NaN where nothing is known."""
    known = None if quantity is None else quantity.get("interval")
    if known is None:
        return np.array([np.nan, np.nan])
    lower, upper = known["lower"], known["upper"]
    return np.array([-np.inf if lower is None else lower, np.inf if upper is None else upper])


def _roots(roots: Sequence[dict[str, Any]]) -> npt.NDArray[np.complex128]:
    return np.array([complex(root["re"], root["im"]) for root in roots], dtype=np.complex128)
