"""Every entry point takes every kind of numbers, to the bit as it takes arrays of NumPy."""

from __future__ import annotations

import decimal
import fractions
import functools
import pickle
import warnings
from collections.abc import Callable
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pytest
from numpy.typing import NDArray

import thetahat as th
from thetahat import plot
from thetahat.base import numbers as _numbers
from thetahat.sklearn import ARXRegressor

Array = NDArray[np.float64]
RANDOM = np.random.default_rng(14)
# Whole numbers: every kind holds them exactly.
U = RANDOM.integers(-3, 4, 60).astype(float)
TWO = RANDOM.integers(-3, 4, (60, 2)).astype(float)
Y: Array = np.round(10 * np.convolve(U, [0, 1, 0.5, 0.25])[:60]) + RANDOM.integers(-2, 3, 60).astype(float)
MISSING = Y.copy()
MISSING[17] = np.nan
TIME = np.arange(60.0)
STATE = np.array([3.0, 1.0])
SQUARE = np.array([[4.0, 1.0], [1.0, 2.0]])


def masked(values: Array) -> Any:
    return np.ma.masked_array(np.where(np.isnan(values), 999.0, values), np.isnan(values))


def objects(missing: Any, make: Callable[[float], Any] = float) -> Callable[[Array], Any]:
    def made(values: Array) -> Any:
        flat = [missing if np.isnan(value) else make(value) for value in values.ravel()]
        out = np.empty(len(flat), dtype=object)
        out[:] = flat
        return out.reshape(values.shape)

    return made


def frame(values: Array, **types: Any) -> Any:
    values = values.reshape(len(values), -1)
    return pd.DataFrame({f"c{j}": pd.Series(values[:, j], **types) for j in range(values.shape[1])})


def polars_frame(values: Array) -> Any:
    return pl.from_pandas(frame(values))


def whole(values: Array) -> Any:
    """Nulls among integers of Polars."""
    return pl.Series([None if np.isnan(value) else int(value) for value in values])


# Of one dimension or two.
ANY: dict[str, Callable[[Array], Any]] = {
    "list": lambda values: values.tolist(),
    "tuple": lambda values: tuple(values.tolist()),
    "list of arrays": list,
    "float32": lambda values: values.astype(np.float32),
    "long double": lambda values: values.astype(np.longdouble),
    "big-endian": lambda values: values.astype(">f8"),
    "strided": lambda values: np.repeat(values, 2, axis=0)[::2],
    "backwards": lambda values: values[::-1].copy()[::-1],
    "column by column": np.asfortranarray,
    "read-only": lambda values: np.frombuffer(values.tobytes()).reshape(values.shape),
    "masked": masked,
    "objects with None": objects(None),
    "objects with NaN": objects(np.nan),
    "objects with NA": objects(pd.NA, int),
    "decimals": objects(decimal.Decimal("nan"), decimal.Decimal),
    "fractions": objects(None, fractions.Fraction),
    "numbers of NumPy": objects(None, np.float64),
    "list with None": lambda values: objects(None)(values).tolist(),
    "list with NA": lambda values: objects(pd.NA)(values).tolist(),
    "subclass": lambda values: values.view(type("Own", (np.ndarray,), {})),
}
# Of one dimension: one channel.
ONE: dict[str, Callable[[Array], Any]] = {
    **ANY,
    "column": lambda values: values.reshape(-1, 1),
    "strided column": lambda values: np.column_stack([values, values])[:, :1],
    "masked column": lambda values: masked(values.reshape(-1, 1)),
    "column of objects": lambda values: objects(None)(values.reshape(-1, 1)),
    "list of columns": lambda values: values.reshape(-1, 1).tolist(),
    "pandas": pd.Series,
    "pandas by dates": lambda values: pd.Series(values, pd.date_range("2026-01-01", periods=len(values), freq="s")),
    "pandas of a frame": lambda values: pd.DataFrame(np.column_stack([values, values]))[0],
    "pandas Float64": lambda values: pd.Series(values, dtype="Float64"),
    "pandas Int64": lambda values: pd.Series(values, dtype="Float64").astype("Int64"),
    "pandas objects": lambda values: pd.Series(objects(None)(values), dtype=object),
    "pandas objects with NA": lambda values: pd.Series(objects(pd.NA)(values), dtype=object),
    "pandas Arrow": lambda values: pd.Series(objects(None)(values).tolist(), dtype="double[pyarrow]"),
    "pandas array": lambda values: pd.array(objects(pd.NA)(values), dtype="Float64"),
    "pandas sparse": lambda values: pd.Series(pd.arrays.SparseArray(values)),
    "pandas index": pd.Index,
    "pandas frame": frame,
    "pandas frame Float64": lambda values: frame(values, dtype="Float64"),
    "Polars": lambda values: pl.Series(values),
    "Polars with null": lambda values: pl.Series(objects(None)(values).tolist()),
    "Polars whole": whole,
    "Polars named": lambda values: pl.Series("c0", values),
    "Polars frame": polars_frame,
    "PyArrow": lambda values: pa.array(values, from_pandas=True),
    "PyArrow chunks": lambda values: pa.chunked_array([values[:9], values[9:]]),
    "PyArrow table": lambda values: pa.table({"c0": pa.array(values, from_pandas=True)}),
}
# Of two: a column for each of several channels.
SEVERAL: dict[str, Callable[[Array], Any]] = {
    **ANY,
    "pandas frame": frame,
    "pandas frame Float64": lambda values: frame(values, dtype="Float64"),
    "pandas frame of objects": lambda values: frame(values).astype(object),
    "pandas frame without names": pd.DataFrame,
    "Polars frame": polars_frame,
    "PyArrow table": lambda values: pa.Table.from_pandas(frame(values), preserve_index=False),
}


def arx_model(log: th.Log) -> list[Array]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", th.EstimationWarning)
        return [th.arx(log, na=1, nb=2).parameters, log.y, log.u, log.time]


@functools.lru_cache
def fitted(inputs: int) -> th.Model:
    u = {f"c{j}": column for j, column in enumerate([U] if inputs == 1 else TWO.T)}
    return th.arx(th.Log(Y, u), na=1, nb=2)


def least_squares(phi: Any, y: Any) -> list[Any]:
    estimator = th.RecursiveLeastSquares(1 if np.ndim(phi) == 1 else np.shape(phi)[1])
    return steps(estimator.run(phi, y)) + [estimator.parameters]


def steps(run: Any) -> list[Any]:
    return [run.parameters, run.errors, run.variances, run.nis, run.actions]


def recursive(kind: Any, orders: tuple[int, ...], y: Any, u: Any, inputs: int) -> list[Any]:
    estimator = kind(1, [1] * inputs, *orders)
    run = steps(estimator.run(y, u=u))
    return [*run, estimator.predict(u)]


def kalman(y: Any, u: Any, inputs: int) -> list[Any]:
    transition = th.LinearTransition([[0.5]], [[1.0]], [[1.0] * inputs])
    observation = th.LinearObservation([[1.0]], [[1.0]])
    run = th.KalmanFilter([0.0], [[1.0]]).run(transition, observation, y, inputs=u)
    smooth = th.KalmanFilter([0.0], [[1.0]]).smooth(transition, observation, y, inputs=u)
    return [run.filtered_states, run.errors, smooth.states]


def extended(y: Any, u: Any) -> list[Any]:
    transition = th.NonlinearTransition(lambda x, u: np.sin(x) + u[:1], [[1.0]])
    observation = th.NonlinearObservation(lambda x, u: x, [[1.0]])
    run = th.ExtendedKalmanFilter([0.0], [[1.0]]).run(transition, observation, y, inputs=u)
    smooth = th.ExtendedKalmanFilter([0.0], [[1.0]]).smooth(transition, observation, y, inputs=u)
    return [run.filtered_states, run.errors, smooth.states]


def observer(y: Any, u: Any, inputs: int) -> list[Any]:
    transition = th.LinearTransition([[0.5]], [[1.0]], [[1.0] * inputs])
    run = th.LuenbergerObserver([0.0], [[0.3]]).run(transition, th.LinearObservation([[1.0]], [[1.0]]), y, inputs=u)
    return [run.predicted_states, run.errors]


def filter_of(state: Any, covariance: Any) -> list[Any]:
    made: list[Any] = [th.KalmanFilter(state, covariance), th.ExtendedKalmanFilter(state, covariance)]
    return [value for one in made for value in (one.state, one.covariance)]


def linear(matrix: Any) -> list[Any]:
    transition, observation = th.LinearTransition(matrix, matrix, matrix), th.LinearObservation(matrix, matrix, matrix)
    return [transition.state_matrix, transition.noise, transition.input_matrix, observation.output_matrix, observation.noise]


def stepped(vector: Any) -> list[Any]:
    """One sample of two signals at a time."""
    motion, measured = th.LinearTransition(np.eye(2), np.eye(2), np.eye(2)), th.LinearObservation(np.eye(2), np.eye(2))
    kalman, extended = th.KalmanFilter([0, 0], np.eye(2)), th.ExtendedKalmanFilter([0, 0], np.eye(2))
    for one in (kalman, extended):
        one.update(vector, observation=measured)
        one.predict(motion, vector)
    called = th.ExtendedKalmanFilter([0, 0], np.eye(2))
    called.update(vector, vector, observation=th.NonlinearObservation(lambda x, u: x + u, np.eye(2)))
    called.predict(th.NonlinearTransition(lambda x, u: x + u, np.eye(2)), vector)
    luenberger = th.LuenbergerObserver(vector, 0.5 * np.eye(2))
    luenberger.update(motion, measured, vector, input=vector)
    plain = th.RecursiveLeastSquares(2, scales=vector, parameters=vector)
    plain.update(vector, 1.0)
    many = th.RecursiveLeastSquares(2, outputs=2)
    many.update(vector, vector)
    arx = th.RecursiveArx(1, [1, 1], input_scales=vector)
    arx.update(1.0, u=vector)
    arx.applied(vector)
    armax = th.RecursiveArmax(1, [1, 1], 1, input_scales=vector)
    armax.update(1.0, u=vector)
    armax.applied(vector)
    estimators: list[Any] = [plain, many, arx, armax]
    return [
        *(one.state for one in (kalman, extended, called, luenberger)),
        *(one.parameters for one in estimators),
        plain.predict(vector),
    ]


def placed(poles: Any) -> list[Any]:
    observer = th.LuenbergerObserver([0, 0], [[0.0], [0.0]])
    observer.place(th.LinearTransition([[1, 1], [0, 1]], np.eye(2)), th.LinearObservation([[1, 0]], [[1]]), poles)
    return [observer.gain]


def returned(vector: Any) -> list[Any]:
    """What a function of the user returns."""
    transition = th.NonlinearTransition(lambda x, u: vector, np.eye(2), lambda x, u: np.eye(2))
    extended = th.ExtendedKalmanFilter([0, 0], np.eye(2))
    extended.predict(transition)
    return [extended.state]


def regressor(x: Any, y: Any) -> list[Any]:
    with warnings.catch_warnings():
        # scikit-learn says that a column is no vector; of missing values the fit does.
        warnings.simplefilter("ignore")
        made = ARXRegressor(na=1, nb=1, horizon=1).fit(x, y)
        return [made.coef_, made.predict(x, y), made.score(x, y)]


def bode(w: Any) -> list[Any]:
    data = [line.get_xydata() for axes in plot.bode(fitted(1), w).flat for line in axes.lines]
    plt.close("all")
    return data


# What takes one channel, and which values.
ONE_CHANNEL: dict[str, tuple[Callable[[Any], Any], Array]] = {
    "Log y": (lambda y: arx_model(th.Log(y, U)), MISSING),
    "Log u": (lambda u: arx_model(th.Log(Y, u)), U),
    "Log u by name": (lambda u: arx_model(th.Log(Y, {"u": u})), U),
    "Log time": (lambda time: arx_model(th.Log(Y, U, time=time)), TIME),
    "simulate": (lambda u: fitted(1).simulate(u), U),
    "simulate by name": (lambda u: fitted(1).simulate({"c0": u}), U),
    "forecast": (lambda u: fitted(1).forecast(th.Log(Y, {"c0": U}), 60, u).values, U),
    "frequency_response": (lambda w: fitted(1).frequency_response(w).values, np.array([1.0, 2.0, 3.0])),
    "plot.bode": (bode, np.array([1.0, 2.0, 3.0])),
    "RecursiveLeastSquares phi": (lambda phi: least_squares(phi, Y), U.reshape(-1, 1)[:, 0]),
    "RecursiveLeastSquares y": (lambda y: least_squares(TWO, y), MISSING),
    "RecursiveArx y": (lambda y: recursive(th.RecursiveArx, (), y, U, 1), MISSING),
    "RecursiveArx u": (lambda u: recursive(th.RecursiveArx, (), MISSING, u, 1), U),
    "RecursiveArmax y": (lambda y: recursive(th.RecursiveArmax, (1,), y, U, 1), MISSING),
    "RecursiveArmax u": (lambda u: recursive(th.RecursiveArmax, (1,), MISSING, u, 1), U),
    "KalmanFilter measurements": (lambda y: kalman(y, U, 1), MISSING),
    "KalmanFilter inputs": (lambda u: kalman(MISSING, u, 1), U),
    "ExtendedKalmanFilter measurements": (lambda y: extended(y, U), MISSING),
    "ExtendedKalmanFilter inputs": (lambda u: extended(MISSING, u), U),
    "LuenbergerObserver measurements": (lambda y: observer(y, U, 1), MISSING),
    "LuenbergerObserver inputs": (lambda u: observer(MISSING, u, 1), U),
    "state": (lambda state: filter_of(state, SQUARE), STATE),
    "one sample": (stepped, STATE),
    "poles": (placed, np.zeros(2)),
    "what a function returns": (returned, STATE),
    "ARXRegressor y": (lambda y: regressor(TWO, y), MISSING),
}
# What takes several.
CHANNELS: dict[str, tuple[Callable[[Any], Any], Array]] = {
    "Log u": (lambda u: arx_model(th.Log(Y, u)), TWO),
    "simulate": (lambda u: fitted(2).simulate(u), TWO),
    "forecast": (lambda u: fitted(2).forecast(th.Log(Y, {"c0": TWO[:, 0], "c1": TWO[:, 1]}), 60, u).values, TWO),
    "RecursiveLeastSquares phi": (lambda phi: least_squares(phi, Y), TWO),
    "RecursiveLeastSquares y": (lambda y: steps(th.RecursiveLeastSquares(2, outputs=2).run(TWO, y)), TWO),
    "RecursiveArx u": (lambda u: recursive(th.RecursiveArx, (), MISSING, u, 2), TWO),
    "RecursiveArmax u": (lambda u: recursive(th.RecursiveArmax, (1,), MISSING, u, 2), TWO),
    "KalmanFilter inputs": (lambda u: kalman(MISSING, u, 2), TWO),
    "ExtendedKalmanFilter inputs": (lambda u: extended(MISSING, u), TWO),
    "LuenbergerObserver inputs": (lambda u: observer(MISSING, u, 2), TWO),
    "covariance": (lambda matrix: filter_of(STATE, matrix), SQUARE),
    "matrices": (linear, SQUARE),
    "ARXRegressor X": (lambda x: regressor(x, Y), TWO),
}




def bits(values: Any) -> bytes:
    listed = values if isinstance(values, list) else [values]
    return pickle.dumps([np.asarray(value).tolist() for value in listed])


@pytest.mark.parametrize("kind", ONE)
@pytest.mark.parametrize("entry", ONE_CHANNEL)
def test_one_channel(entry: str, kind: str) -> None:
    call, values = ONE_CHANNEL[entry]
    assert bits(call(ONE[kind](values))) == bits(call(values))


@pytest.mark.parametrize("kind", SEVERAL)
@pytest.mark.parametrize("entry", CHANNELS)
def test_several_channels(entry: str, kind: str) -> None:
    call, values = CHANNELS[entry]
    assert bits(call(SEVERAL[kind](values))) == bits(call(values))


def test_contiguous_floats_are_not_copied() -> None:
    column = U.reshape(-1, 1)
    assert _numbers.array("u", U) is U and np.shares_memory(_numbers.array("u", column), column)
    for series in (pd.Series(U), pl.Series(U)):
        assert np.shares_memory(_numbers.array("u", series), series.to_numpy())


SERIES_OF_DATES = pd.Series(pd.date_range("2026-01-01", periods=60, freq="s"))


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ([*U[:-1], "1.5"], r"numbers, found .*U"),
        (objects("1.5")(MISSING), r"numbers, found '1.5' \(str\) in entry 17; convert"),
        (objects("-")(MISSING), r"numbers, found '-' \(str\) in entry 17; convert"),
        (objects(pd.NaT)(MISSING), r"numbers, found NaT .* in entry 17"),
        (objects(pd.NaT)(np.column_stack([MISSING, U])), r"numbers, found NaT .* in entry \(17, 0\)"),
        (U.astype(complex), "numbers, found dtype complex128"),
        (SERIES_OF_DATES, r"numbers, found datetime64\[\w+\]"),
        (SERIES_OF_DATES.to_frame("when"), "found datetime64"),
        (pl.from_pandas(SERIES_OF_DATES), "numbers, found Datetime"),
        (SERIES_OF_DATES.diff(), "numbers, found timedelta64"),
        (SERIES_OF_DATES.astype(str), "numbers, found str|object"),
        (pd.Series(["a"] * 60, dtype="category"), "numbers, found category"),
        (pl.Series([[1.0]] * 60), "numbers, found List"),
        (pl.LazyFrame({"u": U}), "numbers, found polars.*LazyFrame"),
        ((value for value in U), "numbers, found generator"),
        (iter, "numbers, found builtin_function"),
        (np.zeros(60, dtype=[("a", float)]), "numbers, found dtype"),
    ],
)
def test_what_is_no_number_is_named(kind: Any, words: str) -> None:
    calls: list[Callable[[Any], Any]] = [
        lambda u: th.Log(Y, u),
        lambda u: th.RecursiveArx(1, 1).run(Y, u=u),
        lambda u: kalman(Y, u, 1),
    ]
    if not hasattr(kind, "shape") or len(kind.shape) == 1:
        calls += [lambda u: fitted(1).simulate(u), lambda y: th.Log(y)]
    for call in calls:
        with pytest.raises(TypeError, match=rf"^(u|y|inputs): (expected|column 'when').*{words}"):
            call(kind)


def test_columns_are_no_rows() -> None:
    for u in (TWO.T, pd.DataFrame(TWO.T), [[1.0], [1.0, 2.0]], 5.0, TWO[:, :, None]):
        with pytest.raises((ValueError, TypeError), match="^u: |rows"):
            th.Log(Y, u)
    with pytest.raises(ValueError, match=r"y: expected one dimension, or a column for each output, found shape \(2, 60\)"):
        th.Log(TWO.T)
    with pytest.raises(ValueError, match=r"measurements: expected shape \(any, 1\), found shape \(60, 2\)"):
        kalman(pl.DataFrame(TWO), U, 1)
    with pytest.raises(ValueError, match="u: two columns have"):
        th.Log(Y, pd.DataFrame(TWO, columns=["a", "a"]))
    with pytest.raises(ValueError, match="u: entry 3: .*too large"):
        th.Log(Y, [0, 1, 2, 10**400])


@pytest.mark.parametrize("library", [pd, pl], ids=["pandas", "polars"])
def test_names_are_kept(library: Any) -> None:
    y, u = library.Series(Y, name="speed") if library is pd else library.Series("speed", Y), library.DataFrame({"fan": U, "heat": TWO[:, 0]})
    log = th.Log(y, u)
    assert (log.output, log.inputs) == ("speed", ["fan", "heat"])
    log = th.Log(y, u, input_names=["a", "b"], output_name="c")
    assert (log.output, log.inputs) == ("c", ["a", "b"]) and np.array_equal(log["b"], TWO[:, 0])
    assert th.Log(u[["heat"]], u["fan"]).inputs == ["fan"] and th.Log(u[["heat"]]).output == "heat"
    assert th.Log(Y, u["fan"], input_names="voltage").inputs == ["voltage"]
    # Columns of a frame are inputs by their names, wherever they are.
    model = th.arx(th.Log(y, u), 1, [1, 1])
    mixed = u.assign(room=1.0)[["room", "heat", "fan"]] if library is pd else u.with_columns(room=1.0)[["room", "heat", "fan"]]
    arrays = np.column_stack([U, TWO[:, 0]])
    assert np.array_equal(model.simulate(mixed), model.simulate(arrays))
    assert np.array_equal(model.simulate(dict(heat=TWO[:, 0].tolist(), fan=U)), model.simulate(arrays))
    log = th.Log(y, u)
    assert np.array_equal(model.forecast(log, 60, mixed).values, model.forecast(log, 60, arrays).values)
    for other in (mixed[["room", "heat"]], {"heat": U}):
        with pytest.raises(ValueError, match=r"u: there is no column 'fan', which is an input of the model; there are"):
            model.simulate(other)


def test_one_measurement_is_a_number_of_any_kind() -> None:
    def estimate(value: Any) -> list[Any]:
        arx, plain = th.RecursiveArx(1, 1), th.RecursiveLeastSquares(1)
        filter = th.KalmanFilter([0.0], [[1.0]])
        arx.update(2.0, u=1.0)
        arx.update(value, u=1.0)
        arx.measured(value)
        plain.update([1.0], value)
        filter.update(value, observation=th.LinearObservation([[1.0]], [[1.0]]))
        return [arx.parameters, plain.parameters, filter.state]

    three = [3, np.float32(3), np.int8(3), np.array(3.0), decimal.Decimal(3), fractions.Fraction(3), np.float64(3)]
    for value in three:
        assert bits(estimate(value)) == bits(estimate(3.0))
    for value in (pd.NA, np.ma.masked, np.float32(np.nan)):
        assert bits(estimate(value)) == bits(estimate(np.nan))
    refused: list[Any] = ["3", np.str_("3"), None, pd.Series([3.0]), [3.0], pd.NaT, 3j, np.datetime64("2026-01-01")]
    for value in refused:
        with pytest.raises((TypeError, ValueError), match="^y: expected (a number|numbers|a datetime)"):
            th.RecursiveArx(1, 1).update(value, u=1.0)
    with pytest.raises(TypeError, match="y: expected a number, found None; NaN stands for a missing one"):
        th.RecursiveArx(1, 1).update(None, u=1.0)  # type: ignore[arg-type]
