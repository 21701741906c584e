"""What a fitted model is: its parameters, polynomials, roots, and the figures of its fit, as its report holds them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import erfc, sqrt
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from thetahat import _thetahat
from thetahat.base import numbers as _numbers
from thetahat.base.clock import imported
from thetahat.base.tables import Records, Table
from thetahat.engine import options as _options

Array = npt.NDArray[np.float64]

_STATES = ("state-space", "continuous-state-space")


@dataclass(frozen=True)
class Decision:
    """What a fit did by itself because of what it found in the log. Its ``str`` is the sentence that the command line prints.

    Attributes
    ----------
    kind : str
        What was found: ``"feedback"``, ``"integration"``, ``"drift"``, ``"outliers"``, ``"nonlinear"``, ``"few_sinusoids"`` or
        ``"in_motion"``.
    channels : list of str
        The channels that it is about; none where it is the whole log.
    because : str
        The evidence, with its figures.
    did : str
        What was done.
    instead : str
        The argument that says otherwise.

    Examples
    --------
    >>> import numpy as np
    >>> import thetahat as th
    >>> u = np.sin(0.3 * np.arange(400.0))
    >>> y = np.convolve(u, 0.5 ** np.arange(1, 20))[:400] + 0.01 * np.random.default_rng(1).standard_normal(400)
    >>> [decision.kind for decision in th.fit(th.Log(u=u, y=y, sample_time=1.0)).decisions]
    ['few_sinusoids']
    """

    kind: str
    channels: list[str]
    because: str
    did: str
    instead: str

    def __str__(self) -> str:
        return f"{self.because}: {self.did} ({self.instead} says otherwise)"


class ReportedModel(Table):
    """What the report of a fit says. As a frame it has a row for each parameter."""

    _index = "parameter"

    def _columns(self) -> dict[str, Any]:
        lower, upper = self.confidence_interval().T
        return {
            "parameter": self.parameter_names,
            "value": self.parameters,
            "standard_error": self.standard_errors,
            "t": self._t,
            "p": self._p,
            "lower": lower,
            "upper": upper,
        }

    _model: _thetahat.Model

    def to_json(self) -> str:
        """The document of ``thetahat fit``: of the same file the same bytes."""
        return self._model.to_json()

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

    @property
    def plan(self) -> dict[str, Any] | None:
        """The options of the fit, with which ``thetahat.fit(log, plan=...)`` and ``thetahat fit --plan`` repeat it."""
        plan = self.document.get("plan")
        return None if plan is None else dict(plan)

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

    @cached_property
    def _states(self) -> _thetahat.Model:
        """The model in state space, if it is not in polynomials: a process in continuous time."""
        return self._model.converted("continuous", None) if self.kind == "process" else self._model

    @cached_property
    def _in_states(self) -> dict[str, Any]:
        """Its document."""
        own: dict[str, Any] = json.loads(self._states.parts()[0])
        return own

    @property
    def name(self) -> str:
        """Structure and orders, such as ``ARX(2, 2, 1)``; of equations how many states they have."""
        return self._model.name()

    @property
    def kind(self) -> str:
        """``"polynomial"``, ``"equations"``, ``"nonlinear-arx"``, ``"process"``, ``"state-space"`` or ``"continuous-state-space"``."""
        return str(self._own["kind"])

    def _polynomial(self, name: str) -> Any:
        """A part that only models of polynomials have; of those in state space, and of processes, what follows from its poles."""
        shared = ("stable", "poles", "time_constants", "dc_gain")
        if self.kind == "process" and name in shared:
            return self._in_states[name]
        if name not in self._own or (self.kind in _STATES and name not in shared):
            kind = {
                "equations": "in equations",
                "nonlinear-arx": "a nonlinear ARX model",
                "process": "a process",
                "state-space": "in state space",
                "continuous-state-space": "in continuous time",
            }.get(self.kind, self.name)
            raise AttributeError(
                f"{name} is of polynomial models, and this one is {kind}: it predicts, simulates, validates and compares"
            )
        return self._own[name]

    @property
    def structure(self) -> str:
        """Which polynomials there are, such as ``"arx"``."""
        return str(self._polynomial("structure"))

    @property
    def orders(self) -> dict[str, Any]:
        """na, nb, nc, nd, nf, nk; nb, nf and nk have one for each input."""
        return dict(self._polynomial("orders"))

    @property
    def parameters(self) -> Array:
        """The estimates, shape (p,), in the order of `parameter_names`; none in state space, where coordinates are a choice."""
        return np.array([parameter["value"] for parameter in self._entries])

    @property
    def parameter_names(self) -> list[str]:
        """Such as ``a1`` or ``b3``: the letter of the polynomial and the power of q^-1; of a seasonal ARIMA model such as ``ma1`` and
        ``sma12``."""
        return [parameter["name"] for parameter in self._entries]

    @property
    def standard_errors(self) -> Array:
        """The square roots of the parameters' variances, shape (p,); NaN where no theory gives one."""
        return _numbers.of_document([parameter["standard_error"] for parameter in self._entries])

    @property
    def figures(self) -> dict[str, tuple[float, float]]:
        """What the ``[figures]`` of a model in equations ask for: each value with its standard error; empty for other models.

        Examples
        --------
        >>> import thetahat as th
        >>> th.arx(th.dc_motor(), na=2, nb=2).figures
        {}
        """
        figures = self._own.get("figures", [])
        numbers = [_numbers.of_document([figure["value"], figure["standard_error"]]) for figure in figures]
        return {figure["name"]: (float(value), float(error)) for figure, (value, error) in zip(figures, numbers)}

    @property
    def _entries(self) -> list[dict[str, Any]]:
        return list(self._uncertain.get("parameters", []))

    @property
    def _uncertain(self) -> dict[str, Any]:
        """What holds the parameters and their covariance: of a seasonal ARIMA model its factors."""
        return cast("dict[str, Any]", self._own.get("factors", self._own))

    @property
    def covariance(self) -> Array | None:
        """The covariance matrix of the parameters, shape (p, p); None where no theory gives one."""
        covariance = self._uncertain.get("covariance")
        return None if covariance is None else np.array(covariance).reshape(2 * (len(self._entries),))

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
        half = _options.quantile(level) * self.standard_errors
        return np.column_stack([self.parameters - half, self.parameters + half])

    def conf_int(self, level: float = 0.95) -> Any:
        """`confidence_interval` as a frame of pandas, columns ``lower`` and ``upper``, by the names of the parameters."""
        ends = dict(zip(("lower", "upper"), self.confidence_interval(level).T))
        return imported("pandas").DataFrame(ends, self.parameter_names)

    @property
    def params(self) -> Any:
        """The `parameters` as a series of pandas, by their names.

        Examples
        --------
        >>> import thetahat as th
        >>> model = th.arx(th.dc_motor(), na=2, nb=2)
        >>> print(model.params.round(2).to_dict())
        {'a1': -1.55, 'a2': 0.58, 'b1': 0.36, 'b2': 0.31}
        >>> print(model.tvalues.idxmin(), model.pvalues.max() < 1e-9)
        a1 True
        """
        return self._series(self.parameters)

    @property
    def std_errors(self) -> Any:
        """The `standard_errors` as a series of pandas; statsmodels calls them ``bse``."""
        return self._series(self.standard_errors)

    bse = std_errors

    @property
    def tvalues(self) -> Any:
        """Each parameter over its standard error, as a series of pandas."""
        return self._series(self._t)

    @property
    def pvalues(self) -> Any:
        """How likely a t as far from 0 is where the parameter is 0, by the normal distribution, as a series of pandas."""
        return self._series(self._p)

    def _series(self, values: Array) -> Any:
        return imported("pandas").Series(values, self.parameter_names)

    @property
    def _t(self) -> Array:
        with np.errstate(divide="ignore", invalid="ignore"):
            return self.parameters / self.standard_errors

    @property
    def _p(self) -> Array:
        return np.array([erfc(abs(t) / sqrt(2.0)) for t in self._t])

    @property
    def a(self) -> Array:
        """A, monic, in rising powers of q^-1."""
        return np.array(self._polynomial("a"))

    @property
    def b(self) -> list[Array]:
        """B of each input, with its nk leading zeros."""
        return [np.array(b) for b in self._polynomial("b")]

    @property
    def c(self) -> Array:
        """C, monic."""
        return np.array(self._polynomial("c"))

    @property
    def d(self) -> Array:
        """D, monic."""
        return np.array(self._polynomial("d"))

    @property
    def f(self) -> list[Array]:
        """F of each input, monic."""
        return [np.array(f) for f in self._polynomial("f")]

    @property
    def noise_variance(self) -> float:
        """The variance of e: the sum of squared residuals over N - p. Of equations that of the measurement."""
        [[variance]] = self.noise_covariance if len(self.outputs) == 1 else [[np.nan]]
        return float(variance)

    @property
    def noise_covariance(self) -> Array:
        """The covariance matrix of the noise of the outputs, shape (outputs, outputs); of a model in continuous time as samples every
        `sample_time` seconds see it.
        """
        if self.kind == "continuous-state-space":
            return np.array(self._own["noise_intensity"]) / self.sample_time
        return np.array(self._own["noise_covariance"])

    @property
    def sample_time(self) -> float:
        """Seconds from one sample to the next; of a model in continuous time those of the model that it was made from."""
        return float(self._own["sample_time"])

    @property
    def inputs(self) -> list[str]:
        """The names of the inputs."""
        return [signal["name"] for signal in self._own["inputs"]]

    @property
    def outputs(self) -> list[str]:
        """The names of the outputs."""
        return [signal["name"] for signal in self._own["outputs"]]

    @property
    def output(self) -> str:
        """The name of the output, of a model that has one."""
        if len(self.outputs) > 1:
            raise AttributeError(f"the model has several outputs: {', '.join(self.outputs)}; see outputs")
        return self.outputs[0]

    @property
    def offsets(self) -> dict[str, tuple[float, float]]:
        """What was taken from each channel before the fit: its level, and its slope per second."""
        signals = [*self._own["inputs"], *self._own["outputs"]]
        return {signal["name"]: (signal["offset"]["level"], signal["offset"]["slope"]) for signal in signals}

    @property
    def stable(self) -> bool:
        """Whether all poles lie inside the unit circle; in continuous time left of the imaginary axis."""
        return bool(self._polynomial("stable"))

    def poles(self) -> npt.NDArray[np.complex128]:
        """The roots of A and of each F in the z plane; in state space the eigenvalues of F, in continuous time of A, and of a process what
        its time constants say."""
        return _roots(self._polynomial("poles"))

    def zeros(self, input: int | str = 0, *, output: int | str | None = None) -> npt.NDArray[np.complex128]:
        """The finite zeros from an input to an output: of polynomials the roots of B in the z plane, in continuous time in the s plane."""
        if self.kind == "polynomial":
            return _roots(self._own["zeros"][self._input(input)])
        zeros, _, _ = self._transfer("zeros", input, output)
        return zeros

    def num(self, input: int | str = 0, *, output: int | str | None = None) -> Array:
        """The numerator from an input to an output, in falling powers of z, in continuous time of s; `den` is the denominator.

        Of a model in continuous time without its delay, see `delays`.

        Examples
        --------
        >>> import thetahat as th
        >>> model = th.Model.from_transfer_function([3], [10, 1], delay=2)
        >>> model.num(), model.den(), model.delays
        (array([0.3]), array([1. , 0.1]), array([2.]))
        """
        return self._quotient("num", input, output)[0]

    def den(self, input: int | str = 0, *, output: int | str | None = None) -> Array:
        """The denominator from an input to an output, monic, in falling powers of z, in continuous time of s."""
        return self._quotient("den", input, output)[1]

    @property
    def delays(self) -> Array:
        """What each input waits, in seconds: of a model in continuous time its dead time, of a sampled one samples that only delay."""
        if self.kind == "polynomial":
            return np.array([max(0, delay - 1) * self.sample_time for delay in self.orders["nk"]])
        own = self._in_states
        if "delays" not in own:
            raise AttributeError(f"delays are of linear models, and this one is {self.name}")
        factor = 1.0 if self.kind in ("process", "continuous-state-space") else self.sample_time
        return np.array(own["delays"], dtype=np.float64) * factor

    def _quotient(self, name: str, input: int | str, output: int | str | None) -> tuple[Array, Array]:
        """Numerator and denominator in falling powers."""
        if self.kind == "polynomial":
            place = self._input(input)
            self._output(output)
            above, below = self.b[place], np.convolve(self.a, self.f[place])
            length = max(len(above), len(below))
            padded = [np.pad(values, (0, length - len(values))) for values in (above, below)]
            return np.trim_zeros(padded[0], "f"), padded[1]
        zeros, poles, gain = self._transfer(name, input, output)
        return np.real(gain * np.atleast_1d(np.poly(zeros))), np.real(np.atleast_1d(np.poly(poles)))

    def _transfer(
        self, name: str, input: int | str, output: int | str | None
    ) -> tuple[npt.NDArray[np.complex128], npt.NDArray[np.complex128], float]:
        """Zeros, poles and gain from an input to an output."""
        if self.kind not in (*_STATES, "process"):
            raise AttributeError(f"{name} is of linear models, and this one is {self.name}")
        zeros, poles, gain = self._model.transfer(self._output(output), self._input(input))
        complexes = [np.array([complex(*root) for root in roots], dtype=np.complex128) for roots in (zeros, poles)]
        return complexes[0], complexes[1], gain

    def noise_poles(self) -> npt.NDArray[np.complex128]:
        """The roots of D: what the noise has beside the roots of A."""
        return _roots(self._polynomial("noise_poles"))

    def noise_zeros(self) -> npt.NDArray[np.complex128]:
        """The roots of C."""
        return _roots(self._polynomial("noise_zeros"))

    def dc_gain(self, input: int | str = 0, *, output: int | str | None = None) -> tuple[float, float]:
        """The static gain from an input and its standard error; NaN at an integrator.

        Near an integrator the gain is far from normal; `dc_gain_interval` holds there too. ``output`` says to which, where there are
        several.
        """
        gain = self._gain(input, output)
        if gain is None:
            return (np.nan, np.nan)
        return (float(gain["value"]), float("nan" if gain["standard_error"] is None else gain["standard_error"]))

    def time_constants(self) -> Array:
        """-T/ln|p| in seconds for each of `poles`, T being the sample time; NaN for |p| >= 1."""
        constants = self._polynomial("time_constants")
        return _numbers.of_document([None if constant is None else constant["value"] for constant in constants])

    def _gain(self, input: int | str, output: int | str | None) -> dict[str, Any] | None:
        gains, place = self._polynomial("dc_gain"), self._output(output)
        found: dict[str, Any] | None = (gains if self.kind == "polynomial" else gains[place])[self._input(input)]
        return found

    def dc_gain_interval(self, input: int | str = 0, *, output: int | str | None = None) -> Array:
        """The interval that holds the static gain with a probability of 95 %, shape (2,), by Fieller's theorem.

        Infinite where it has no end, as near an integrator; NaN where there is no gain or no standard error.

        Examples
        --------
        >>> import thetahat as th
        >>> th.arx(th.dc_motor(), na=2, nb=2).dc_gain_interval().round(1)
        array([18.3, 19.6])
        """
        return _interval(self._gain(input, output))

    def time_constant_intervals(self) -> Array:
        """The intervals that hold the `time_constants` with a probability of 95 % each, shape (n, 2).

        From the intervals of the poles' moduli; infinite where a pole may be an integrator, NaN where nothing is known.
        """
        return np.array([_interval(constant) for constant in self._polynomial("time_constants")]).reshape(-1, 2)

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

    def _output(self, output: int | str | None) -> int:
        """The position of an output; the only one needs no name."""
        if output is None:
            if len(self.outputs) > 1:
                raise ValueError(f"output: there are several: {', '.join(self.outputs)}; name one")
            return 0
        if isinstance(output, str):
            if output not in self.outputs:
                raise ValueError(f"output: there is no output '{output}'; there are: {', '.join(self.outputs)}")
            return self.outputs.index(output)
        index = _options.integer("output", output)
        if not 0 <= index < len(self.outputs):
            raise ValueError(f"output: there is no output {index}; the model has {len(self.outputs)}, counted from 0")
        return index

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
        """The mean of e^2 over these samples; with ``likelihood="exact"`` that of v^2/f, f being the variances of the innovations v
        over that of e."""
        return float(self._estimation["mse"])

    @property
    def criteria(self) -> dict[str, float]:
        """FPE, AIC, AICc, MDL and HQC for each sample, as Ljung counts them; NaN where one is not defined. `aic` and `bic` are those
        of the whole log."""
        estimation = self._estimation
        words = (word for word, _, _ in _thetahat.CRITERIA)
        return {word: float("nan" if estimation.get(word) is None else estimation[word]) for word in words}

    @property
    def log_likelihood(self) -> float:
        """The logarithm of the likelihood of the fit, as statsmodels counts it.

        Notes
        -----
        For Gaussian errors with the variance V that makes it largest, the mean of e^2 over the N samples that count::

            ln L = -N/2 (ln 2 pi + ln V + 1)

        It is the likelihood given the samples that do not count (the conditional one), of a fit by least squared errors of
        which V is the least. With ``likelihood="exact"`` it is that of all measured outputs, in which the variances of the
        innovations differ by factors f, and half the sum of their logarithms is taken off::

            ln L = -N/2 (ln 2 pi + ln V + 1) - 1/2 sum ln f

        NaN where no error is left.

        References
        ----------
        Akaike, A new look at the statistical model identification, 1974. Schwarz, Estimating the dimension of a model, 1978.
        """
        if self.method in ("exact-likelihood", "innovations-likelihood"):
            known = self._estimation["log_likelihood"]
            return np.nan if known is None else float(known)
        if self.kind == "state-space":
            # The determinant of the covariance of the errors stands in the criteria.
            size, determinant = len(self.outputs), self.criteria["aic"] - 2 * self._estimated / self.samples
            return float(-self.samples / 2 * (size * (np.log(2 * np.pi) + 1) + determinant))
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

        It is N (MDL + ln 2 pi + 1) + ln N, where MDL, ``criteria["mdl"]``, is ln V + p ln(N)/N. N counts the outputs that were
        measured; statsmodels' SARIMAX counts missing ones too.
        """
        return -2 * self.log_likelihood + (self._estimated + 1) * float(np.log(self.samples))

    @property
    def _estimated(self) -> int:
        levels = [self._estimation.get(name) for name in ("level", "slope")]
        return int(self._own.get("free_parameters", len(self._entries))) + sum(level is not None for level in levels)

    @property
    def fits(self) -> list[dict[str, Any]]:
        """How well the model fits: one entry for each part of the log and horizon."""
        return list(self.document["fit"])

    @property
    def purpose(self) -> str:
        """What the model is good for, in one sentence: prediction, simulation, control design up to which frequency.

        Examples
        --------
        >>> import numpy as np
        >>> import thetahat as th
        >>> rng = np.random.default_rng(1)
        >>> u = rng.standard_normal(1000)
        >>> y = np.convolve(u, 0.5 ** np.arange(1, 20))[:1000] + 0.1 * rng.standard_normal(1000)
        >>> th.fit(th.Log(u=u, y=y, sample_time=1.0)).purpose.split(" (")[0]
        'Good for prediction one step ahead'
        """
        purpose: str = self.document.get("purpose", "")
        return purpose

    @property
    def decisions(self) -> list[Decision]:
        """What the fit did by itself because of what it found in the log."""

        def of(made: dict[str, Any]) -> Decision:
            because, did, instead = (_thetahat.in_python(made[word]) for word in ("because", "did", "instead"))
            return Decision(made["kind"], made.get("channels", []), because, did, instead)

        return [of(made) for made in self.document.get("decisions", [])]

    @property
    def selection(self) -> Records | None:
        """How the model was chosen among others, if it was: a dict, and as a frame the best of those that were compared.

        Examples
        --------
        >>> import thetahat as th
        >>> chosen = th.arx(th.dc_motor(), na=range(1, 4), nb=range(1, 4))
        >>> chosen.selection.to_pandas()[["na", "nb", "parameters", "score"]].head(2).round(3)
           na  nb  parameters  score
        0   3   3           6 -1.191
        1   3   2           5 -1.089
        """
        found = self.document.get("selection")
        return None if found is None else Records(found, "best")

    @property
    def warnings(self) -> list[str]:
        """What a careful reader should know, in plain words."""
        return [_thetahat.in_python(warning) for warning in self.document["warnings"]]


def _interval(quantity: dict[str, Any] | None) -> Array:
    """The ends of a figure's interval: infinite where there is none, NaN where nothing is known."""
    known = None if quantity is None else quantity.get("interval")
    if known is None:
        return np.array([np.nan, np.nan])
    lower, upper = known["lower"], known["upper"]
    return np.array([-np.inf if lower is None else lower, np.inf if upper is None else upper])


def _roots(roots: Sequence[dict[str, Any]]) -> npt.NDArray[np.complex128]:
    return np.array([complex(root["re"], root["im"]) for root in roots], dtype=np.complex128)
