"""What the functions of a model in equations compute with: expressions, conditions, tables and branches."""

from __future__ import annotations

import difflib
import functools
import inspect
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from numbers import Real
from types import CodeType, TracebackType
from typing import Any, Literal, Union

import numpy as np

_FUNCTIONS = {
    np.sin: "sin",
    np.cos: "cos",
    np.tan: "tan",
    np.arcsin: "asin",
    np.arccos: "acos",
    np.arctan: "atan",
    np.sinh: "sinh",
    np.cosh: "cosh",
    np.tanh: "tanh",
    np.exp: "exp",
    np.log: "ln",
    np.log10: "log10",
    np.sqrt: "sqrt",
    np.absolute: "abs",
    np.fabs: "abs",
    np.sign: "sign",
    np.arctan2: "atan2",
    np.minimum: "min",
    np.maximum: "max",
    np.fmin: "min",
    np.fmax: "max",
}
_SIGNS = {np.add: "+", np.subtract: "-", np.multiply: "*", np.true_divide: "/", np.power: "^"}
_COMPARISONS = {np.less: "<", np.less_equal: "<=", np.greater: ">", np.greater_equal: ">="}
_ALL = ", ".join(sorted({*_FUNCTIONS.values(), "np.where", "np.clip", "np.interp", "th.table", "th.where"}))


class Expression(np.lib.mixins.NDArrayOperatorsMixin):
    """What a function of a model in equations computes with: a text that grows with each operation.

    It takes part in ``+ - * / **``, in NumPy's functions, `numpy.where`, `numpy.clip` and `numpy.interp`, in `thetahat.table` and
    `thetahat.where`. Compared with ``< <= > >=`` it gives a condition. It has no value, so there is no ``if`` on it.
    """

    def __init__(self, text: str) -> None:
        self._text = text

    def __str__(self) -> str:
        return self._text

    __repr__ = __str__

    def __array_ufunc__(self, function: Any, method: str, *inputs: Any, **options: Any) -> Any:
        if method != "__call__" or options:
            return NotImplemented
        texts = [text_of(value) for value in inputs]
        if function in _SIGNS:
            return Expression(f"({texts[0]} {_SIGNS[function]} {texts[1]})")
        if function in _COMPARISONS:
            return Condition(texts[0], _COMPARISONS[function], texts[1])
        if function is np.negative:
            return Expression(f"(-{texts[0]})")
        if function is np.positive:
            return self
        if function is np.square:
            return Expression(f"({texts[0]} * {texts[0]})")
        if function in _FUNCTIONS:
            return Expression(f"{_FUNCTIONS[function]}({', '.join(texts)})")
        if function in (np.equal, np.not_equal):
            raise TypeError("numbers that are computed are hardly ever equal: compare them by <, <=, > or >=")
        raise TypeError(f"{function.__name__}: equations have {_ALL} and + - * / **")

    def __array_function__(self, function: Any, types: Any, args: Any, kwargs: Any) -> Any:
        return _of_numpy(function, args, kwargs)

    def __bool__(self) -> bool:
        raise TypeError("an expression has no value to branch on: use th.where(condition, a, b), np.minimum, np.maximum or abs")

    def __float__(self) -> float:
        raise TypeError("an expression has no value; use NumPy's functions, such as np.sin")


class Condition(np.lib.mixins.NDArrayOperatorsMixin):
    """A comparison of expressions: what `thetahat.where` and `numpy.where` branch on; ``&``, ``|`` and ``~`` join several."""

    def __init__(self, left: Any, sign: str, right: Any) -> None:
        self._parts = (left, sign, right)

    def __repr__(self) -> str:
        return f"({' '.join(str(part) for part in self._parts if part is not None)})"

    def chosen(self, yes: str, no: str, within: str) -> str:
        """The text of the branch."""
        left, sign, right = self._parts
        if sign == "~":
            return str(right.chosen(no, yes, within))
        if sign == "&":
            return str(left.chosen(right.chosen(yes, no, within), no, within))
        if sign == "|":
            return str(left.chosen(yes, right.chosen(yes, no, within), within))
        return f"(if {left} {sign} {right}{within} then {yes} else {no})"

    def __array_ufunc__(self, function: Any, method: str, *inputs: Any, **options: Any) -> Any:
        joined = {np.bitwise_and: "&", np.logical_and: "&", np.bitwise_or: "|", np.logical_or: "|"}
        if method == "__call__" and not options and all(isinstance(one, Condition) for one in inputs):
            if function in joined:
                return Condition(inputs[0], joined[function], inputs[1])
            if function in (np.invert, np.logical_not):
                return Condition(None, "~", inputs[0])
        raise TypeError(f"{function.__name__}: {self} is a condition and no number: use th.where(condition, 1, 0)")

    def __array_function__(self, function: Any, types: Any, args: Any, kwargs: Any) -> Any:
        return _of_numpy(function, args, kwargs)

    def __bool__(self) -> bool:
        raise TypeError(
            f"{self} has no value to branch on: write th.where(condition, a, b) for `if`, np.minimum and np.maximum for `min` and `max`, "
            "and join conditions by & | ~ instead of `and`, `or`, `not`"
        )


Computed = Union[Expression, float]
"""What a model computes with: an expression, or a number."""


def where(condition: Any, a: Any, b: Any, *, width: Any = None) -> Expression:
    """``a`` where a condition holds, else ``b``, in the functions of a model in equations: their ``if``.

    Parameters
    ----------
    condition : Condition
        A comparison of expressions by ``< <= > >=``; several of them joined by ``&``, ``|`` and ``~``.
    a, b : Expression or float
        The two sides.
    width : float or Expression, optional
        Makes a blend of both sides of the branch: the weight of ``a`` is 1/(1 + exp(-2 d/width)), where d is how far the condition is
        from its border; 88 % at d = width. Without it the model jumps, and its derivatives are those of the side that is taken.

    Returns
    -------
    Expression

    Examples
    --------
    >>> import thetahat as th
    >>> heater = th.GreyBox.from_functions(
    ...     sample_time=1,
    ...     states={"room": (20, 1)},
    ...     parameters={"loss": {"start": 0.1, "sd": 0.1, "unknown": True, "min": 0}},
    ...     next=lambda x, u, p, dt: {"room": x.room - p.loss * (x.room - 10) + th.where(x.room < 19, 1, 0)},
    ...     outputs=lambda x, u, p: {"y": x.room},
    ...     measurement={"y": 0.1},
    ... )
    >>> heater.to_dict()["next"]["room"]
    '((room - (loss * (room - 10.0))) + (if room < 19.0 then 1.0 else 0.0))'
    """
    yes, no = text_of(a), text_of(b)
    if isinstance(condition, (bool, np.bool_)):
        return Expression(yes if condition else no)
    if not isinstance(condition, Condition):
        raise TypeError(f"condition: expected a comparison of expressions, such as x.level > 1, found {condition!r}")
    return Expression(condition.chosen(yes, no, "" if width is None else f" within {text_of(width)}"))


def table(x: Any, knots: Iterable[Any], values: Iterable[Any], *, method: Literal["monotone", "linear"] = "monotone") -> Expression:
    """A look-up table of an expression, in the functions of a model in equations.

    Parameters
    ----------
    x : Expression
        What is looked up.
    knots : array_like, shape (N,)
        Numbers that rise, two or more. Beyond the first and the last the table keeps its value there.
    values : sequence of N floats or Expressions
        The values at the knots. They may be made of parameters, unknown ones too, which a fit estimates.
    method : {"monotone", "linear"}
        Cubic polynomials that rise and fall where the values do (PCHIP: Fritsch and Carlson 1980, Fritsch and Butland 1984), or straight
        lines, as `numpy.interp` has them. Derivatives are exact.

    Returns
    -------
    Expression

    Examples
    --------
    >>> import thetahat as th
    >>> cell = th.GreyBox.from_functions(
    ...     sample_time=1,
    ...     states={"soc": (0.9, 0.01)},
    ...     inputs={"current": "i"},
    ...     parameters={"r0": {"start": 0.02, "sd": 0.01, "unknown": True}},
    ...     next=lambda x, u, p, dt: {"soc": x.soc + dt * u.current / 36000},
    ...     outputs=lambda x, u, p: {"v": th.table(x.soc, [0, 0.5, 1], [3.2, 3.65, 4.1]) + p.r0 * u.current},
    ...     measurement={"v": 0.01},
    ... )
    >>> cell.to_dict()["outputs"]["v"]
    '(table(soc; 0.0:3.2, 0.5:3.65, 1.0:4.1) + (r0 * current))'
    """
    words = {"monotone": "table", "linear": "lines"}
    if method not in words:
        raise ValueError(f"method: expected one of {', '.join(words)}, found {method!r}")
    at, of = list(knots), list(values)
    if len(at) != len(of):
        raise ValueError(f"knots and values: there are {len(at)} knots, but {len(of)} values")
    if len(at) < 2:
        raise ValueError(f"knots: a table has at least two, here is {len(at)}")
    for one, next in zip(at, at[1:]):
        if not isinstance(one, Expression) and not isinstance(next, Expression) and not one < next:
            raise ValueError(f"knots: they must rise, but {next} follows {one}")
    pairs = ", ".join(f"{text_of(knot)}:{text_of(value)}" for knot, value in zip(at, of))
    return Expression(f"{words[method]}({text_of(x)}; {pairs})")


def delayed(x: Any, delay: Any) -> Expression:
    """An input some seconds ago, in the functions of a model in equations.

    Parameters
    ----------
    x : Expression
        The input, such as ``u.flow``. Before the first row it is as in it. One that is held is taken over a step as its mean, so that the
        delay need not be a whole number of samples.
    delay : float or Expression
        Seconds, a number or made of parameters, unknown ones too.

    Returns
    -------
    Expression

    Examples
    --------
    >>> import thetahat as th
    >>> pipe = th.GreyBox.from_functions(
    ...     sample_time=1,
    ...     states={"outlet": (20, 0.1)},
    ...     inputs={"inlet": "t_in"},
    ...     parameters={"delay": {"start": 3, "sd": 2, "unknown": True, "min": 0, "max": 30}},
    ...     derivative=lambda x, u, p: {"outlet": (th.delayed(u.inlet, p.delay) - x.outlet) / 5},
    ...     outputs=lambda x, u, p: {"y": x.outlet},
    ...     measurement={"y": 0.1},
    ... )
    >>> pipe.to_dict()["derivative"]["outlet"]
    '((inlet(t - (delay)) - outlet) / 5.0)'
    """
    name = text_of(x)
    if not name.isidentifier():
        raise TypeError(f"x: expected an input, such as u.flow, found {name}")
    return Expression(f"{name}(t - ({text_of(delay)}))")


def _interp(
    x: Any, xp: Iterable[Any], fp: Iterable[Any], left: Any = None, right: Any = None, period: Any = None
) -> Expression:
    """`numpy.interp` of an expression."""
    if period is not None:
        raise TypeError("np.interp: a table of an expression has no period")
    knots = list(xp)
    found = table(x, knots, fp, method="linear")
    if left is not None:
        found = where(x < knots[0], left, found)
    return found if right is None else where(x > knots[-1], right, found)


def _clip(x: Any, a_min: Any = None, a_max: Any = None, *, min: Any = None, max: Any = None) -> Expression:
    """`numpy.clip` of an expression."""
    low, high = (a_min if min is None else min), (a_max if max is None else max)
    if low is None or high is None:
        bounded = text_of(x) if low is None else f"max({text_of(x)}, {text_of(low)})"
        return Expression(bounded if high is None else f"min({bounded}, {text_of(high)})")
    return Expression(f"sat({text_of(x)}, {text_of(low)}, {text_of(high)})")


def _of_numpy(function: Any, args: Any, kwargs: Any) -> Any:
    """What a function of NumPy that is no ufunc makes of expressions."""
    known: dict[Any, Callable[..., Expression]] = {np.where: where, np.interp: _interp, np.clip: _clip}
    if function not in known:
        raise TypeError(f"{function.__name__}: equations have {_ALL} and + - * / **")
    return known[function](*args, **kwargs)


def text_of(value: Any) -> str:
    """An expression or a number as it stands in an equation."""
    if isinstance(value, Expression):
        return str(value)
    if isinstance(value, Condition):
        raise TypeError(f"{value} is a condition and no number: use th.where(condition, 1, 0)")
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value.item()
    if isinstance(value, bool) or not isinstance(value, Real):
        raise TypeError(f"expected an expression or a number, found {value!r}")
    number = float(value)
    if not np.isfinite(number):
        raise ValueError(f"{number} is not a finite number")
    return f"({number!r})" if number < 0 else repr(number)


class Names:
    """The states, inputs or parameters of a model, as attributes, by name or by place."""

    def __init__(self, kind: str, names: Iterable[str]) -> None:
        self.__kind = kind
        self.__all = {name: Expression(name) for name in names}
        self.__dict__.update(self.__all)

    def __getattr__(self, name: str) -> Expression:
        if name.startswith("__"):
            raise AttributeError(name)
        raise AttributeError(self.__no(name))

    def __getitem__(self, key: int | str) -> Expression:
        if isinstance(key, str):
            if key not in self.__all:
                raise KeyError(self.__no(key))
            return self.__all[key]
        names = list(self.__all)
        if not -len(names) <= key < len(names):
            raise IndexError(f"there is no {self.__kind} {key}, {self.__known()}")
        return self.__all[names[key]]

    def __iter__(self) -> Iterator[Expression]:
        return iter(self.__all.values())

    def __len__(self) -> int:
        return len(self.__all)

    def __repr__(self) -> str:
        return f"({', '.join(self.__all)})"

    def __known(self) -> str:
        if not self.__all:
            return f"the model has no {self.__kind}s"
        return f"the {self.__kind}s are {', '.join(self.__all)}"

    def __no(self, name: str) -> str:
        near = difflib.get_close_matches(name, self.__all, 1)
        meant = f"; did you mean '{near[0]}'?" if near else ""
        return f"there is no {self.__kind} '{name}', {self.__known()}{meant}"


class Written:
    """A function of a user that writes equations, by the argument that it was given as."""

    def __init__(self, argument: str, function: Callable[..., Mapping[str, Any]]) -> None:
        self._argument, self._function = argument, function

    def equations(self, *arguments: Any, of: Sequence[str] | None = None) -> dict[str, str]:
        """The equations that it writes; ``of`` these states, each of which must have one."""
        try:
            found = self._function(*arguments)
        except (AttributeError, IndexError, KeyError, TypeError, ValueError) as error:
            kinds = (AttributeError, IndexError, KeyError, TypeError, ValueError)
            kind = next(kind for kind in kinds if isinstance(error, kind))
            message = error.args[0] if error.args else ""
            raise kind(f"{self.place(error.__traceback__)}: {message}") from error
        if not isinstance(found, Mapping):
            raise TypeError(f"{self.place()}: it returned {type(found).__name__}; return a dict of names and expressions")
        texts = {}
        for name, value in found.items():
            try:
                texts[str(name)] = text_of(value)
            except (TypeError, ValueError) as error:
                raise type(error)(f"{self.place()}: the expression of '{name}': {error}") from error
        if of is not None:
            given = f"it returned {', '.join(texts) if texts else 'an empty dict'}"
            for state in of:
                if state not in texts:
                    raise ValueError(f"{self.place()}: the state '{state}' has no equation; {given}")
            for name in texts:
                if name not in of:
                    raise ValueError(f"{self.place()}: '{name}' is no state, the states are {', '.join(of)}")
        return texts

    def place(self, trace: TracebackType | None = None) -> str:
        """What the function is called, and where it is defined or where in it an error arose."""
        function: Any = self._function
        while isinstance(function, functools.partial):
            function = function.func
        function = inspect.unwrap(function)
        code = getattr(function, "__code__", None) or getattr(type(function).__call__, "__code__", None)
        name = getattr(function, "__name__", type(function).__name__)
        called = "a lambda" if name == "<lambda>" else f"'{name}'"
        if not isinstance(code, CodeType):
            return f"{self._argument}, which is {called}"
        lines = [code.co_firstlineno]
        while trace is not None:
            if trace.tb_frame.f_code.co_filename == code.co_filename:
                lines.append(trace.tb_lineno)
            trace = trace.tb_next
        within = f" (defined in line {lines[0]})" if lines[-1] != lines[0] else ""
        return f"{self._argument}, which is {called} of {os.path.basename(code.co_filename)}, line {lines[-1]}{within}"
