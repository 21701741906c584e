"""What is computed with fitted models: predictions, free runs, forecasts, validations and responses."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from thetahat import _thetahat
from thetahat.base import frames as _frames, numbers as _numbers, picture as _picture, said as _said
from thetahat.base.frames import Frame
from thetahat.base.said import EstimationWarning
from thetahat.engine import files as _files, options as _options
from thetahat.engine.option_types import ValidationOptions
from thetahat.engine.values import Initial
from thetahat.logs.log import Log, handle
from thetahat.models.forms import ConvertibleModel
from thetahat.models.known import KnownModels
from thetahat.models.responses import Forecast, FrequencyResponse, TransientResponse
from thetahat.models.validation import Validation

if TYPE_CHECKING:
    from typing_extensions import Unpack

Array = npt.NDArray[np.float64]


class Model(ConvertibleModel, KnownModels):
    """An estimated model, A(q) y(t) = sum_j B_j(q)/F_j(q) u_j(t) + C(q)/D(q) e(t), and the report of its fit.

    Polynomials are written in rising powers of q^-1, which delays by one sample: ``b[j][i]`` multiplies u_j(t - i). Signals
    go in and come out in the units of the log; the offsets that were removed before the fit are part of the model.

    Models are made by `arx`, `armax`, `oe`, `bj`, `ar`, `arma`, `arima`, `general`, `fir`, `process`, `iv`, `sriv`, `search` and `from_json`; of numbers that
    are known by `from_polynomials`, `from_transfer_function`, `from_state_space`, `from_control` and `from_scipy`. They do not change; they
    pickle and copy.

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

    def __init__(self) -> None:
        raise TypeError("models are made by fits such as thetahat.arx(log, na=2, nb=2), or by Model.from_json(text)")

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
            Data to evaluate on, such as those of the fit.
        """
        _thetahat.write(_files.name(path), self._model.page(None if log is None else handle("log", log), "thetahat.Model.write_html"))

    def predict(self, log: Log | Frame, horizon: int | None = 1, *, initial: Initial = "auto") -> Array:
        """The prediction of each row from what was known some steps before, in the units of the log.

        Parameters
        ----------
        log : Log or data frame
            The data; its channels are found by name. Rows of a frame without a clock are a sample time of the model apart; for a free
            run it needs no output.
        horizon : int or None, default 1
            Steps ahead. None is a free run: the inputs alone drive the model.
        initial : {"auto", "drop", "zero", "estimate"}, default "auto"
            The initial condition of each segment, in the words of the fits: measured samples ("drop": the first ones then
            have no prediction), zeros, or an estimate. "auto" is "drop" for models that need only a few past samples,
            else "estimate"; "zero" where the log has no output.

        Returns
        -------
        ndarray, shape (N,), or (N, outputs) where there are several
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
        return _beside(self._model.predict(*self._asked(log, horizon, initial)))

    def predict_interval(
        self, log: Log | Frame, horizon: int | None = 1, *, level: float = 0.95, initial: Initial = "auto"
    ) -> Array:
        """Intervals that hold the output, as far as one knows some steps before.

        They count what the noise does and how uncertain the parameters are, on a log that the model was not fitted to.

        Parameters
        ----------
        log, horizon, initial
            As for `predict`. In a free run (None) there are intervals of nonlinear ARX models of which rows were held out.
        level : float, default 0.95
            The probability with which they hold it.

        Returns
        -------
        ndarray, shape (N, 2), or (N, outputs, 2) where there are several
            The lower and the upper end; NaN where there is none.
        """
        quantile = _options.quantile(level)
        found = self._model.predict_with_deviations(*self._asked(log, horizon, initial))
        values = _beside([values for values, _ in found])
        known = [deviations for _, deviations in found if deviations is not None]
        half = quantile * (_beside(known) if known else np.nan)
        return np.stack([values - half, values + half], axis=-1)

    def _asked(self, log: Log | Frame, horizon: int | None, initial: Initial) -> tuple[_thetahat.Log, int | None, Initial]:
        """What a prediction is of, how far ahead, and from where."""
        if horizon is not None:
            horizon = _options.count("horizon", horizon, 1_000_000)
        data = self._log_of(log, horizon is None)
        if horizon is None and initial == "auto" and all(data.missing[output] == len(data) for output in self.outputs if output in data):
            initial = "zero"
        return data._log, horizon, initial

    def simulate(self, u: _numbers.Columns | Log, *, initial: Initial = "auto", clamp: bool = False) -> Array:
        """The free run on inputs, in the units of the log.

        Parameters
        ----------
        u : array_like, shape (N,) or (N, inputs), or data frame, dict of str to array_like, or Log
            The inputs. Those of a frame, dict or log are found by name.
        initial : {"auto", "drop", "zero", "estimate"}, default "auto"
            The initial condition, as for `predict`. "auto" is "zero" for inputs alone, and "estimate" for a
            log with the output, as of ``thetahat simulate``.
        clamp : bool, default False
            Keep the outputs that a nonlinear ARX model feeds back within 1.1 times the range of the rows of its fit, and warn of how
            many were: so a run that leaves the data is finite, if not good.

        Returns
        -------
        ndarray, shape (N,)

        Warns
        -----
        EstimationWarning
            If values were kept within the range.

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
            if not clamp:
                return self.predict(u, None, initial=initial)
            values, kept = self._model.clamped_run(handle("u", u), None, initial)
        elif initial not in ("auto", "zero"):
            raise ValueError(f"initial: inputs alone start from zero, not '{initial}'; give a Log to start from its output")
        elif not clamp:
            return _beside(self._model.simulate(self._inputs_of(u)))
        else:
            values, kept = self._model.clamped_run(None, self._inputs_of(u), initial)
        if kept:
            message = f"{kept} values were kept within 1.1 times the range of the estimation rows"
            _said.warn(message, EstimationWarning)
        return _beside(values)

    def sample(
        self, u: _numbers.Columns | Log, draws: int = 100, *, seed: int = 0, initial: Initial = "auto"
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
            The initial condition, as for `simulate`. From zero the noise starts at rest too; else it is stationary.

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
        Each run is B/(A F) u + C/(A D) e with parameters, and the output's level, from a normal distribution of the
        covariance of the estimate, and e of its noise variance.

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
            _said.warn(message, EstimationWarning)
        if unstable:
            message = f"parameters of an unstable model were drawn {unstable} times, and drawn again"
            _said.warn(message, EstimationWarning)
        return runs

    def forecast(
        self, log: Log | Frame, steps: int, u: _numbers.Columns | None = None, *, initial: Initial = "auto"
    ) -> Forecast:
        """What comes after the end of a log.

        Where the log ends in missing outputs it goes on from the last measured one, with as many more steps: the deviations
        grow accordingly. The inputs of these rows must be in the log.

        Parameters
        ----------
        log : Log or data frame
            What is known.
        steps : int
            The horizon.
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
        log = self._log_of(log)
        found = self._model.forecast(log._log, steps, future, initial)
        values, deviations = (_beside(columns) for columns in zip(*found))
        time = log.time[-1] + self.sample_time * np.arange(1, steps + 1)
        return Forecast(time, values, deviations, log._clock.after(steps, self.sample_time), self.outputs)

    def residuals(self, log: Log | Frame, horizon: int = 1, *, initial: Initial = "auto") -> Array:
        """The measured output less its prediction.

        Parameters
        ----------
        log, horizon, initial
            As for `predict`.

        Returns
        -------
        ndarray, shape (N,), of several outputs (N, outputs)
            NaN where there is no prediction, or no measured output.

        Examples
        --------
        >>> import numpy as np
        >>> import thetahat as th
        >>> model = th.arx(th.dc_motor(), na=2, nb=2)
        >>> bool(np.isclose(np.nanmean(model.residuals(th.dc_motor()) ** 2), model.mse))
        True
        """
        log = self._log_of(log)
        values = self.predict(log, horizon, initial=initial)
        return _beside([log[output] for output in self.outputs]) - values

    @_options.takes(ValidationOptions)
    def validate(
        self,
        log: Log | Frame,
        require: str | Sequence[str] | None = None,
        **options: Unpack[ValidationOptions],
    ) -> Validation:
        """Say how the model does on a log: fits, tests of its residuals, coverage of its intervals.

        Parameters
        ----------
        log : Log or data frame
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
        data = self._log_of(log)
        plan = _options.plan(options, len(data))
        listed = [require] if isinstance(require, str) else require or ()
        required = [one for text in listed for one in _options.text("require", text).split(",")]
        return Validation._of(_thetahat.validate(self._model, data._log, plan, required))

    def frequency_response(
        self, w: npt.ArrayLike | None = None, *, points: int = 100, output: int | str | None = None
    ) -> FrequencyResponse:
        """The response of the output to each input, and to the noise, at some frequencies.

        Parameters
        ----------
        w : array_like, optional
            Frequencies in radians per second. Without them, this many points evenly on a logarithmic scale up to pi over the
            sample time.
        points : int, default 100
            How many.
        output : int or str, optional
            Of which output, where there are several: its position, or its name.

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
        place = self._output(output)
        found = self._model.frequency_response(w, points, place)
        if not found:
            raise ValueError(
                "model: it has no inputs, and with several outputs no response to the noise: there is no frequency response"
            )
        return FrequencyResponse(found, self.outputs[place])

    def step_response(
        self, input: int | str = 0, samples: int | None = None, *, output: int | str | None = None
    ) -> TransientResponse:
        """The response of the output to a unit step of an input, from rest, counted from 0.

        Parameters
        ----------
        input : int or str, default 0
            Which input: its position, or its name.
        samples : int, optional
            How many; until it has settled, unless said otherwise.
        output : int or str, optional
            Of which output, where there are several: its position, or its name.

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
        return TransientResponse(*self._model.step_response(*self._source(input, samples), self._output(output)))

    def impulse_response(
        self, input: int | str = 0, samples: int | None = None, *, output: int | str | None = None
    ) -> TransientResponse:
        """The impulse response from an input: the coefficients g_i of B/(A F) = g_0 + g_1 q^-1 + …

        The input is 1 in the sample at time 0 and 0 afterwards. The sums of the response are the step response.

        Parameters
        ----------
        input, samples, output
            As for `step_response`.

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
        return TransientResponse(*self._model.impulse_response(*self._source(input, samples), self._output(output)))

    def _log_of(self, data: Log | Frame, inputs_alone: bool = False) -> Log:
        """A log, or that of the channels of a frame that the model has."""
        if isinstance(data, Log) or not hasattr(data, "columns"):
            handle("log", data)
            return data
        frame = _frames.plain(data)
        there = _frames.names(frame)
        for name in [*self.inputs, *self.outputs]:
            if name not in there and not (inputs_alone and name in self.outputs):
                raise ValueError(f"log: there is no column {name!r}, which is a channel of the model; there are {', '.join(map(repr, there))}")
        missing = [name for name in self.outputs if name not in there]
        if missing:
            frame = _frames.with_missing(frame, missing)
        with _said.kept() as words:
            log = Log.from_dataframe(frame, inputs=self.inputs, output=self.outputs)
        if log._clock.times is None:
            return Log.from_dataframe(frame, inputs=self.inputs, output=self.outputs, sample_time=self.sample_time)
        for word in words:
            _said.warn(word)
        return log

    def _source(self, input: int | str, samples: int | None) -> tuple[int, int | None]:
        return self._input(input), None if samples is None else _options.count("samples", samples)

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

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Model):
            return NotImplemented
        return self._found() == other._found()

    def __hash__(self) -> int:
        return hash(self._found())

    def _found(self) -> str:
        """The document without the options that it was made of, which may say the same in other words."""
        return json.dumps({name: value for name, value in self.document.items() if name != "plan"})

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
        try:
            steps = [
                (f"step of {name} to {output}" if len(self.outputs) > 1 else f"step of {name}", [response.values])
                for output in self.outputs
                for index, name in enumerate(self.inputs)
                for response in [self.step_response(index, output=output)]
            ]
        except ValueError:
            # What is not linear has no step response of its own.
            steps = []
        table = _picture.rows(repr(self), steps)
        return f"{table}<pre>{escape(self.summary())}</pre>"


def _beside(columns: Sequence[Array]) -> Array:
    """One column as it is, several side by side."""
    return columns[0] if len(columns) == 1 else np.column_stack(columns)
