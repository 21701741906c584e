"""Models of numbers that are known: polynomials, transfer functions, matrices, systems of python-control and SciPy."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal, TypeVar, Union

import numpy as np
from numpy.typing import ArrayLike

from thetahat import _thetahat
from thetahat.base.numbers import shown
from thetahat.engine import options as _options
from thetahat.engine.values import Duration

if TYPE_CHECKING:
    from typing_extensions import Self

_Hold = Literal["zoh", "foh", "tustin"]
_Names = Union[str, Sequence[str]]
_T = TypeVar("_T")


class KnownModels:
    """How a `Model` is made of numbers that are known. Nothing is estimated: there are no standard errors and no figures of a fit;
    models predict, simulate, validate, filter, compare, convert, control and export as those that were fitted."""

    @classmethod
    def _of(cls, handle: _thetahat.Model) -> Self:
        raise NotImplementedError

    @classmethod
    def from_polynomials(
        cls,
        *,
        b: ArrayLike | Sequence[ArrayLike] | None = None,
        f: ArrayLike | Sequence[ArrayLike] | None = None,
        a: ArrayLike | None = None,
        c: ArrayLike | None = None,
        d: ArrayLike | None = None,
        noise_variance: float = 0.0,
        sample_time: Duration,
        inputs: _Names | None = None,
        output: str | None = None,
        offset: Mapping[str, float] | None = None,
    ) -> Self:
        """A model A(q) y = B(q)/F(q) u + C(q)/D(q) e with these polynomials in rising powers of q^-1.

        Parameters
        ----------
        b : array_like, or sequence of array_like for several inputs
            B: zeros at its beginning are samples that the input waits. None for a time series.
        f : array_like, or sequence of array_like
            F, which begins with 1, of each input or of all; 1 if not given.
        a, c, d : array_like, optional
            A, C and D, which begin with 1; 1 if not given.
        noise_variance : float, default 0
            The variance of e.
        sample_time : float or timedelta
            Time from one sample to the next.
        inputs, output : str, or sequence of str
            The names of the channels: u, or u1, u2, …, and y, if not given.
        offset : dict of str to float, optional
            What a channel is measured from, such as where the plant works; 0 if not given.

        Returns
        -------
        Model

        Raises
        ------
        ValueError
            For polynomials that do not begin with 1, and numbers that are not finite or do not fit together.

        Examples
        --------
        >>> import thetahat as th
        >>> model = th.Model.from_polynomials(b=[0, 0.36, 0.32], f=[1, -1.54, 0.58], sample_time=0.01, output="speed")
        >>> model
        Model(OE(2, 2, 1))
        >>> round(model.dc_gain()[0], 6)
        17.0
        """
        return cls._known(
            a=_one("a", a),
            b=_each("b", b),
            c=_one("c", c),
            d=_one("d", d),
            f=_each("f", f),
            noise_covariance=_options.number("noise_variance", noise_variance),
            sample_time=_seconds(sample_time),
            input=_names("inputs", inputs),
            output=_names("output", output),
            offset=_options.named("offset", offset),
        )

    @classmethod
    def from_transfer_function(
        cls,
        num: ArrayLike | Sequence[Any],
        den: ArrayLike | Sequence[Any],
        sample_time: Duration | None = None,
        *,
        delay: float | Sequence[float] = 0.0,
        noise_variance: float = 0.0,
        hold: _Hold = "zoh",
        inputs: _Names | None = None,
        outputs: _Names | None = None,
        offset: Mapping[str, float] | None = None,
    ) -> Self:
        """A model num/den in falling powers of z, or without a sample time of s.

        Parameters
        ----------
        num, den : array_like, or nested sequences of array_like
            Numerator and denominator, as python-control and SciPy write them. With several channels ``num[i][j]`` is from input j to
            output i, and ``den`` alike, or one for all.
        sample_time : float or timedelta, optional
            Time from one sample to the next; without it the model is in continuous time, and verbs sample it as their log is.
        delay : float or sequence of float, default 0
            The dead time of each input in seconds.
        noise_variance : float, default 0
            The variance of e, of each output.
        hold : {"zoh", "foh", "tustin"}
            What inputs do between samples, of a model in continuous time.
        inputs, outputs : str, or sequence of str
            The names of the channels.
        offset : dict of str to float, optional
            What a channel is measured from, such as where the plant works; 0 if not given.

        Returns
        -------
        Model

        Raises
        ------
        ValueError
            For a numerator of a higher degree than its denominator, and numbers that are not finite or do not fit together.

        Examples
        --------
        >>> import thetahat as th
        >>> model = th.Model.from_transfer_function([3], [10, 1], delay=2)
        >>> model.name
        'continuous state space of order 1, delays 2 s'
        >>> [round(value, 3) for value in th.tune(model).settings("simc", "pi")]
        [0.833, 10.0, 0.0]
        """
        rows = _table("num", num)
        count = len(rows[0])
        outputs_count = len(rows)
        below = _table("den", den)
        if len(below) == 1 and len(below[0]) == 1:
            below = [below[0] * count] * outputs_count
        if any(len(row) != count for row in [*rows, *below]) or len(below) != outputs_count:
            raise ValueError("den: give one for each numerator, or one for all")
        delays = [float(delay)] * count if np.ndim(delay) == 0 else [float(one) for one in delay]  # type: ignore[arg-type, union-attr]
        if len(delays) != count:
            raise ValueError(f"delay: there are {len(delays)} for {count} inputs; give one for each, or one for all")
        return cls._known(
            num=[one for row in rows for one in row],
            den=[one for row in below for one in row],
            delay=delays * outputs_count if any(delays) else None,
            noise_covariance=_diagonal(noise_variance, outputs_count),
            sample_time=_seconds(sample_time),
            hold=hold if sample_time is None else None,
            input=_names("inputs", inputs),
            output=_names("outputs", outputs) or ([f"y{k}" for k in range(1, outputs_count + 1)] if outputs_count > 1 else None),
            offset=_options.named("offset", offset),
        )

    @classmethod
    def from_state_space(
        cls,
        A: ArrayLike,
        B: ArrayLike,
        C: ArrayLike,
        D: ArrayLike | None = None,
        *,
        K: ArrayLike | None = None,
        noise_covariance: ArrayLike | None = None,
        sample_time: Duration | None = None,
        hold: _Hold = "zoh",
        inputs: _Names | None = None,
        outputs: _Names | None = None,
        offset: Mapping[str, float] | None = None,
    ) -> Self:
        """A model x(t+1) = A x + B u + K e, y = C x + D u + e, or without a sample time dx/dt = A x + B u + K e.

        Parameters
        ----------
        A, B, C, D : array_like
            The matrices; D is zero if not given. The document calls those of sampled models F, G, H and D.
        K : array_like, optional
            What the innovations do to the state; zero if not given.
        noise_covariance : array_like, optional
            The variance of e, or of several outputs its covariance matrix, in samples; zero if not given.
        sample_time : float or timedelta, optional
            Time from one sample to the next; without it the model is in continuous time.
        hold : {"zoh", "foh", "tustin"}
            What inputs do between samples, of a model in continuous time.
        inputs, outputs : str, or sequence of str
            The names of the channels.
        offset : dict of str to float, optional
            What a channel is measured from, such as where the plant works; 0 if not given.

        Returns
        -------
        Model

        Raises
        ------
        ValueError
            For matrices that do not fit together, and numbers that are not finite.

        Examples
        --------
        >>> import thetahat as th
        >>> model = th.Model.from_state_space([[0.9, 0.1], [0, 0.8]], [[0], [1]], [[1, 0]], sample_time=0.1)
        >>> model.name
        'state space of order 2'
        """
        return cls._known(
            state_matrix=_matrix("A", A),
            input_matrix=_matrix("B", B),
            output_matrix=_matrix("C", C),
            feedthrough_matrix=_matrix("D", D),
            noise_gain=_matrix("K", K),
            noise_covariance=_matrix("noise_covariance", noise_covariance),
            sample_time=_seconds(sample_time),
            hold=hold if sample_time is None else None,
            input=_names("inputs", inputs),
            output=_names("outputs", outputs),
            offset=_options.named("offset", offset),
        )

    @classmethod
    def from_control(cls, system: Any, *, delay: float | Sequence[float] = 0.0, noise_variance: float = 0.0) -> Self:
        """A model of a linear system of python-control: a TransferFunction or a StateSpace, with the names of its channels.

        Parameters
        ----------
        system : control.TransferFunction or control.StateSpace
            In continuous time where its ``dt`` is 0 or None.
        delay, noise_variance
            As for `from_transfer_function`, which python-control does not know; a delay is of a transfer function.

        Returns
        -------
        Model

        Raises
        ------
        TypeError
            For something else.
        ValueError
            As for `from_transfer_function` and `from_state_space`.
        """
        dt = getattr(system, "dt", None)
        if dt is True:
            raise ValueError("system: its sample time is not said (dt=True); give it one in seconds")
        seconds = None if not dt else float(dt)
        inputs = _own_names("u", getattr(system, "input_labels", None))
        outputs = _own_names("y", getattr(system, "output_labels", None))
        if all(hasattr(system, name) for name in "ABCD"):
            if np.any(delay):
                raise ValueError("delay: it is for transfer functions; leave it out")
            count = np.shape(system.C)[0]
            noise = noise_variance * np.eye(count) if noise_variance else None
            return cls.from_state_space(
                system.A,
                system.B,
                system.C,
                system.D,
                noise_covariance=noise,
                sample_time=seconds,
                inputs=inputs,
                outputs=outputs,
            )
        if hasattr(system, "num") and hasattr(system, "den"):
            return cls.from_transfer_function(
                _lists(system.num),
                _lists(system.den),
                seconds,
                delay=delay,
                noise_variance=noise_variance,
                inputs=inputs,
                outputs=outputs,
            )
        raise TypeError(f"system: expected a transfer function or a state space of python-control, found {type(system).__name__}")

    @classmethod
    def from_scipy(cls, system: Any, *, delay: float | Sequence[float] = 0.0, noise_variance: float = 0.0) -> Self:
        """A model of a linear system of scipy.signal: ``lti`` or ``dlti``, as transfer function, state space or zeros, poles and gain.

        Parameters
        ----------
        system : scipy.signal.lti or scipy.signal.dlti
            In continuous time where its ``dt`` is None.
        delay, noise_variance
            As for `from_transfer_function`, which SciPy does not know; a delay is of a transfer function.

        Returns
        -------
        Model

        Raises
        ------
        TypeError
            For something else.
        ValueError
            As for `from_transfer_function` and `from_state_space`.

        Examples
        --------
        >>> import thetahat as th
        >>> from scipy import signal
        >>> th.Model.from_scipy(signal.dlti([0.36, 0.32], [1, -1.54, 0.58], dt=0.01)).name
        'OE(2, 2, 1)'
        """
        if hasattr(system, "zeros") and hasattr(system, "gain") and hasattr(system, "to_tf"):
            system = system.to_tf()
        return cls.from_control(system, delay=delay, noise_variance=noise_variance)

    @classmethod
    def _read(cls, argument: str, value: Any) -> Self:
        """A model as it is, a linear system of python-control or SciPy as a model."""
        if isinstance(value, cls):
            return value
        if any(hasattr(value, name) for name in ("num", "A", "to_tf")):
            return cls.from_scipy(value)
        raise TypeError(f"{argument}: expected a Model, found {type(value).__name__}")

    @classmethod
    def _known(cls, **options: Any) -> Self:
        given = {name: value for name, value in options.items() if value is not None}
        return cls._of(_thetahat.Model.known(json.dumps(given)))


def _numbers(name: str, values: ArrayLike) -> list[float]:
    """The numbers of one polynomial."""
    try:
        found = np.atleast_1d(np.asarray(values, dtype=np.float64))
    except (TypeError, ValueError) as error:
        raise TypeError(f"{name}: expected numbers, found {shown(values)}") from error
    if found.ndim != 1 or found.size == 0:
        raise ValueError(f"{name}: expected a list of numbers, found an array of the shape {found.shape}")
    if not np.isfinite(found).all():
        raise ValueError(f"{name}: expected finite numbers, found {shown(values)}")
    return [float(value) for value in found]


def _written(values: Sequence[float]) -> str:
    return ",".join(repr(value) for value in values)


def _one(name: str, values: ArrayLike | None) -> str | None:
    return None if values is None else _written(_numbers(name, values))


def _is_nested(values: Any) -> bool:
    """Whether it holds polynomials, and not the numbers of one."""
    return isinstance(values, (list, tuple)) and any(np.ndim(one) > 0 for one in values) or np.ndim(values) == 2


def _each(name: str, values: ArrayLike | Sequence[ArrayLike] | None) -> list[str] | None:
    """One polynomial, or one for each input."""
    if values is None:
        return None
    several: Any = values if _is_nested(values) else [values]
    return [_written(_numbers(name, one)) for one in several]


def _table(name: str, values: Any) -> list[list[str]]:
    """Polynomials of each output from each input: of one from one, a list for each input, or a list of lists."""
    if not _is_nested(values):
        return [[_written(_numbers(name, values))]]
    if any(_is_nested(row) for row in values):
        return [[_written(_numbers(name, one)) for one in row] for row in values]
    return [[_written(_numbers(name, one)) for one in values]]


def _lists(values: Any) -> Any:
    """The polynomials of python-control, which are arrays of arrays, and of SciPy, which are one."""
    if isinstance(values, (list, tuple)) or getattr(values, "dtype", None) == object:
        return [[np.asarray(one, dtype=np.float64) for one in row] for row in values]
    return values


def _matrix(name: str, values: ArrayLike | None) -> str | None:
    if values is None:
        return None
    try:
        found = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise TypeError(f"{name}: expected a matrix of numbers, found {shown(values)}") from error
    found = np.atleast_2d(found)
    if found.ndim != 2 or not np.isfinite(found).all():
        raise ValueError(f"{name}: expected a matrix of finite numbers, found one of the shape {found.shape}")
    return None if found.size == 0 else ";".join(_written([float(value) for value in row]) for row in found)


def _diagonal(variance: float, outputs: int) -> str:
    value = float(_options.number("noise_variance", variance))
    return ";".join(_written([value if i == j else 0.0 for j in range(outputs)]) for i in range(outputs))


def _seconds(value: Duration | None) -> float | None:
    return None if value is None else _options.seconds("sample_time", value)


def _own_names(letter: str, labels: Sequence[str] | None) -> list[str] | None:
    """The names of channels, without those that python-control gives by itself: u[0], u[1], …"""
    names = [str(label) for label in labels or ()]
    return None if all(name.startswith(f"{letter}[") for name in names) else names


def _names(name: str, value: _Names | None) -> list[str] | None:
    if value is None:
        return None
    return [_options.text(name, one) for one in ([value] if isinstance(value, str) else value)]
