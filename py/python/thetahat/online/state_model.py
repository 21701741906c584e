"""A linear model in matrices with its noises, whose state a `StateFilter` estimates."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from thetahat import _thetahat
from thetahat.base import numbers as _numbers
from thetahat.engine import files as _files, options as _options
from thetahat.engine.runs import Simulates
from thetahat.engine.values import Duration

if TYPE_CHECKING:
    import os

Array = npt.NDArray[np.float64]


class StateModel(Simulates):
    """A linear model in matrices with its noises, for a `StateFilter`.

    ::

        x(k+1) = F x(k) + G u(k) + w(k)          w ~ (0, Q), v ~ (0, R), cov(w, v) = S
        y(k)   = H x(k) + D u(k) + v(k)          at the first row x ~ (x0, P0)

    Parameters
    ----------
    F : array_like, shape (n, n)
        The state matrix.
    H : array_like, shape (m, n)
        The output matrix.
    Q : array_like, shape (n, n), optional
        The covariance of the process noise, added each sample. It, ``R`` and ``P0`` are needed without bounds; where one is left
        out beside its bound b, it is that of noise that is uniform within it: b²/3.
    R : array_like, shape (m, m), optional
        The covariance of the measurement noise.
    P0 : array_like, shape (n, n), optional
        The covariance of what is known of the state at the first row.
    sample_time : float or timedelta
        Time of a sample: seconds, or a timedelta.
    G : array_like, shape (n, k), optional
        The matrix of the inputs; without it there are none.
    D : array_like, shape (m, k), optional
        What acts on the outputs at once: zero if not given.
    S : array_like, shape (n, m), optional
        The covariance of the two noises: zero if not given.
    x0 : array_like, shape (n,), optional
        The state at the first row: zero if not given.
    process_bound, measurement_bound, initial_bound : float, or array_like of shape (n,), (m,), (n,), optional
        The largest magnitudes of the entries of w and v, and of x - x0 at the first row, for the estimator "bounded": all three or
        none. A number is that of all entries.
    states, inputs, outputs : sequence of str, optional
        The names of the states, and the channels of the inputs and outputs: x1, x2, …; u, or u1, u2, …; y, or y1, y2, ….

    Raises
    ------
    ValueError
        If a shape is wrong, an entry not finite, a covariance none, or a name there twice.

    Examples
    --------
    >>> import thetahat as th
    >>> # The yearly flow of the Nile as a level that walks (Durbin and Koopman, 2nd ed. 2012, section 2.2).
    >>> nile = th.StateModel([[1]], [[1]], [[1469.1]], [[15099]], [[1e7]], sample_time=1, states=["level"])
    >>> nile
    StateModel(states level, no inputs, outputs y, sample time 1.0 s)

    Noise of which the bound alone is known: the level is within 0.9 of 3.4 for certain.

    >>> bounds = {"process_bound": 0.1, "measurement_bound": 1, "initial_bound": 100}
    >>> tank = th.StateModel([[1]], [[1]], **bounds, sample_time=1)
    >>> level = th.StateFilter(tank, "bounded").run([3.0, 4.0])
    >>> level.filtered[-1].round(6).tolist(), level.filtered_bounds[-1].round(6).tolist()
    ([3.55], [0.55])
    """

    __slots__ = ("_model", "_text")
    _model: _thetahat.StateModel
    _text: str

    def __init__(
        self,
        F: npt.ArrayLike,
        H: npt.ArrayLike,
        Q: npt.ArrayLike | None = None,
        R: npt.ArrayLike | None = None,
        P0: npt.ArrayLike | None = None,
        *,
        sample_time: Duration,
        G: npt.ArrayLike | None = None,
        D: npt.ArrayLike | None = None,
        S: npt.ArrayLike | None = None,
        x0: npt.ArrayLike | None = None,
        process_bound: npt.ArrayLike | None = None,
        measurement_bound: npt.ArrayLike | None = None,
        initial_bound: npt.ArrayLike | None = None,
        states: Sequence[str] | None = None,
        inputs: Sequence[str] | None = None,
        outputs: Sequence[str] | None = None,
    ) -> None:
        size, measured = len(_matrix("F", F, None, None)), len(_matrix("H", H, None, None))
        driven = 0 if G is None else _matrix("G", G, size, None).shape[1]
        shapes = {
            "F": (F, size, size),
            "G": (G, size, driven),
            "H": (H, measured, size),
            "D": (D, measured, driven),
            "Q": (Q, size, size),
            "R": (R, measured, measured),
            "S": (S, size, measured),
            "P0": (P0, size, size),
        }
        named = {
            "states": _names("states", states, size, [f"x{place}" for place in range(1, size + 1)]),
            "inputs": _names("inputs", inputs, driven, _usual("u", driven)),
            "outputs": _names("outputs", outputs, measured, _usual("y", measured)),
        }
        both = [name for name in named["outputs"] if name in named["inputs"]]
        if both:
            raise ValueError(f"outputs: {both[0]!r} is an input too; it can only be one of them")
        lines = [f"sample_time = {_positive('sample_time', sample_time)!r}"]
        lines += [f"{name} = [{', '.join(map(_quoted, names))}]" for name, names in named.items()]
        for name, (value, rows, columns) in shapes.items():
            if value is not None:
                lines.append(f"{name} = {_matrix(name, value, rows, columns).tolist()!r}")
        vectors = {
            "x0": (x0, size),
            "process_bound": (_repeated(process_bound, size), size),
            "measurement_bound": (_repeated(measurement_bound, measured), measured),
            "initial_bound": (_repeated(initial_bound, size), size),
        }
        for name, (value, entries) in vectors.items():
            if value is not None:
                lines.append(f"{name} = {_matrix(name, _numbers.column(name, value)[:, np.newaxis], entries, 1)[:, 0].tolist()!r}")
        self._text = "\n".join(lines) + "\n"
        try:
            self._model = _thetahat.StateModel.from_toml(self._text)
        except ValueError as error:
            # Nobody has seen the text that the place is in.
            message = re.sub(r"^line \d+, column \d+: ", "", str(error))
            raise ValueError(re.sub(r"^'(\w+)' ", r"\1: it ", message)) from None

    @classmethod
    def from_toml(cls, text: str) -> StateModel:
        """Read a model from a text, as ``thetahat filter`` reads it.

        Parameters
        ----------
        text : str
            TOML, with matrices that are called as the arguments of `StateModel`, or with equations.

        Raises
        ------
        ValueError
            If something is wrong in it, with line and column.

        Examples
        --------
        >>> import thetahat as th
        >>> text = "sample_time = 1\\noutputs = ['y']\\nF = [[1]]\\nH = [[1]]\\nQ = [[0.1]]\\nR = [[2]]\\nP0 = [[1]]"
        >>> th.StateModel.from_toml(text).states
        ['x1']
        """
        made = object.__new__(cls)
        made._text = _options.text("text", text)
        made._model = _thetahat.StateModel.from_toml(text)
        return made

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> StateModel:
        """Read a model from a file, see `from_toml`."""
        with open(_files.name(path), encoding="utf-8") as file:
            return cls.from_toml(file.read())

    def to_toml(self) -> str:
        """The text of the model, which ``thetahat filter`` reads."""
        return self._text

    @property
    def states(self) -> list[str]:
        """The names of the states."""
        return self._model.states

    @property
    def inputs(self) -> list[str]:
        """The channels of the inputs."""
        return self._model.inputs

    @property
    def outputs(self) -> list[str]:
        """The channels of the outputs."""
        return self._model.outputs

    @property
    def unknown(self) -> list[str]:
        """The names of the unknown parameters of a model in equations."""
        return self._model.unknown

    @property
    def sample_time(self) -> float:
        """Seconds of a sample."""
        return self._model.sample_time

    def _filtered(self) -> _thetahat.StateModel:
        return self._model

    def __eq__(self, other: object) -> bool:
        return self._text == other._text if isinstance(other, StateModel) else NotImplemented

    def __hash__(self) -> int:
        return hash(self._text)

    def __reduce__(self) -> tuple[Any, ...]:
        return (StateModel.from_toml, (self._text,))

    def __repr__(self) -> str:
        inputs = f"inputs {', '.join(self.inputs)}" if self.inputs else "no inputs"
        unknown = f", unknown {', '.join(self.unknown)}" if self.unknown else ""
        names = f"states {', '.join(self.states)}{unknown}, {inputs}, outputs {', '.join(self.outputs)}"
        return f"StateModel({names}, sample time {self.sample_time} s)"


def _matrix(name: str, value: npt.ArrayLike, rows: int | None, columns: int | None) -> Array:
    """A matrix of finite numbers, of this size where it is known."""
    found = _numbers.array(name, value)
    if found.ndim != 2 or found.shape[0] != (rows or found.shape[0]) or found.shape[1] != (columns or found.shape[1]):
        expected = ", ".join("any" if side is None else str(side) for side in (rows, columns))
        raise ValueError(f"{name}: expected shape ({expected}), found shape {found.shape}")
    if 0 in found.shape:
        raise ValueError(f"{name}: expected at least one entry, found none")
    if not np.isfinite(found).all():
        raise ValueError(f"{name}: expected finite numbers, found {found[~np.isfinite(found)][0]}")
    return found


def _repeated(bound: npt.ArrayLike | None, entries: int) -> npt.ArrayLike | None:
    """A number as that of all entries."""
    return [float(bound)] * entries if isinstance(bound, (int, float, np.generic)) else bound


def _positive(name: str, value: Duration) -> float:
    seconds = _options.seconds(name, value)
    if seconds <= 0:
        raise ValueError(f"{name}: {seconds} is not above 0")
    return seconds


def _usual(letter: str, count: int) -> list[str]:
    return [letter] if count == 1 else [f"{letter}{place}" for place in range(1, count + 1)]


def _names(argument: str, given: Sequence[str] | None, count: int, usual: list[str]) -> list[str]:
    names = usual if given is None else [given] if isinstance(given, str) else list(given)
    if len(names) != count:
        raise ValueError(f"{argument}: expected {count} names, found {len(names)}")
    if len(set(names)) < len(names):
        raise ValueError(f"{argument}: {_numbers.twice(names)!r} is there twice")
    return [_options.text(argument, name) for name in names]


def _quoted(name: str) -> str:
    return json.dumps(name, ensure_ascii=False).replace("\x7f", "\\u007f")
