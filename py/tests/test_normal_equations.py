"""One model from many pieces of the data."""

from __future__ import annotations

import copy
import functools
import multiprocessing
import operator
import pickle
from concurrent.futures import ProcessPoolExecutor
from typing import Any, Optional

import numpy as np
import pytest

import thetahat as th

ORDERS: dict[str, Any] = {"na": 2, "nb": [2, 1], "nk": [1, 3]}
LAGS = 3


@pytest.fixture(scope="module")
def log() -> th.Log:
    """y = 1.6 y(t-1) - 0.7 y(t-2) + u1(t-1) + 0.4 u1(t-2) - 0.3 u2(t-3) + e, about 50, with holes."""
    random = np.random.default_rng(3)
    u, e, y = random.standard_normal((3000, 2)), 0.2 * random.standard_normal(3000), np.zeros(3000)
    for t in range(3, 3000):
        y[t] = 1.6 * y[t - 1] - 0.7 * y[t - 2] + u[t - 1, 0] + 0.4 * u[t - 2, 0] - 0.3 * u[t - 3, 1] + e[t]
    y[[700, 999, 1000, 2500]] = np.nan
    return th.Log(y + 50, u, sample_time=0.1)


def cut(log: th.Log, boundaries: list[int]) -> list[th.NormalEquations]:
    return [made((log[max(0, first - LAGS) : last], min(first, LAGS))) for first, last in zip(boundaries, boundaries[1:])]


def made(piece: tuple[th.Log, int]) -> th.NormalEquations:
    return th.NormalEquations(piece[0], 2, [2, 1], [1, 3], past=piece[1])


def assert_same(found: th.Model, expected: th.Model) -> None:
    np.testing.assert_allclose(found.parameters, expected.parameters, rtol=1e-12)
    np.testing.assert_allclose(found.standard_errors, expected.standard_errors, rtol=1e-12)
    assert found.noise_variance == pytest.approx(expected.noise_variance, rel=1e-12)
    assert found.fits[0]["percent"] == pytest.approx(expected.fits[0]["percent"], abs=1e-10)
    assert found.samples == expected.samples


@pytest.mark.filterwarnings("ignore::thetahat.EstimationWarning")
def test_pieces_give_the_model_of_the_whole(log: th.Log) -> None:
    whole = th.arx(log, **ORDERS)
    pieces = cut(log, [0, 400, 1000, 1001, 2000, 3000])
    merged = functools.reduce(operator.or_, pieces)
    assert_same(merged.solve(), whole)
    assert_same(pieces[0].merge(*pieces[1:]).solve(), whole)
    tree = (pieces[0] | pieces[1]) | ((pieces[2] | pieces[3]) | pieces[4])
    assert_same(tree.solve(), whole)
    assert tree == (pieces[0] | pieces[1]) | ((pieces[2] | pieces[3]) | pieces[4])
    assert (merged.rows, merged.pieces, merged.samples, merged.lags) == (3000, 5, whole.samples, LAGS)
    assert repr(merged) == "NormalEquations(ARX(2, [2 1], [1 3]), 3000 rows in 5 pieces, inputs u1, u2, output y)"
    # What was merged is as it was.
    assert pieces[0].pieces == 1 and pieces[0] != merged and pieces[0] != 3


@pytest.mark.filterwarnings("ignore::thetahat.EstimationWarning")
def test_the_model_does_what_others_do(log: th.Log) -> None:
    model = functools.reduce(operator.or_, cut(log, [0, 1500, 3000])).solve()
    whole = th.arx(log, **ORDERS)
    np.testing.assert_allclose(model.predict(log), whole.predict(log), rtol=1e-10, equal_nan=True)
    np.testing.assert_allclose(model.simulate(np.ones((50, 2))), whole.simulate(np.ones((50, 2))), rtol=1e-10)
    np.testing.assert_allclose(model.predict_interval(log), whole.predict_interval(log), rtol=1e-10, equal_nan=True)
    validated = model.validate(log[2000:])
    assert validated.fit(1) == pytest.approx(whole.validate(log[2000:]).fit(1))
    assert th.Model.from_json(model.to_json()) == model
    assert "normal equations in twice the precision" in str(model._model.table())


@pytest.mark.filterwarnings("ignore::thetahat.EstimationWarning")
@pytest.mark.parametrize("constant", [None, "yes", "no"])
@pytest.mark.parametrize("detrend", [None, "none"])
def test_offsets_are_those_of_all_pieces(log: th.Log, detrend: Optional[str], constant: Any) -> None:
    whole = th.arx(log, **ORDERS, detrend=detrend, constant=constant)
    options: dict[str, Any] = {"detrend": detrend, "constant": constant}
    first = th.NormalEquations(log[:1200], **ORDERS, **options)
    second = th.NormalEquations(log[1197:], **ORDERS, past=3, **options)
    found = (first | second).solve()
    np.testing.assert_allclose(found.parameters, whole.parameters, rtol=1e-9)
    for name in ("u1", "u2", "y"):
        assert found.offsets[name] == pytest.approx(whole.offsets[name], rel=1e-9)


@pytest.mark.filterwarnings("ignore::thetahat.EstimationWarning")
def test_series_and_impulse_responses(log: th.Log) -> None:
    def both(whole: th.Model, tolerance: float, **orders: Any) -> None:
        lags = th.NormalEquations(log[:500], **orders).lags
        first = th.NormalEquations(log[:1600], **orders)
        second = th.NormalEquations(log[1600 - lags :], past=lags, **orders)
        found = (first | second).solve()
        np.testing.assert_allclose(found.parameters, whole.parameters, rtol=tolerance, atol=tolerance)
        assert found.method == whole.method

    both(th.ar(log, na=3), 1e-11, na=3)
    both(th.fir(log, taps=20), 1e-6, taps=20)
    both(th.fir(log, taps=20, kernel="tc"), 1e-6, taps=20, kernel="tc")
    both(th.fir(log, taps=[20, 8], nk=1, kernel=None), 1e-11, taps=[20, 8], nk=1, kernel=None)


@pytest.fixture(scope="module")
def two() -> th.Log:
    """Two outputs that follow one another, and two inputs."""
    random = np.random.default_rng(4)
    u, e, y = random.standard_normal((2000, 2)), 0.2 * random.standard_normal((2000, 2)), np.zeros((2000, 2))
    for t in range(3, 2000):
        y[t] = [[0.8, 0.1], [-0.3, 0.5]] @ y[t - 1] - 0.1 * y[t - 2] + [u[t - 1, 0], 0.5 * u[t - 2, 1]] + e[t]
    y[[700, 999], [0, 1]] = np.nan
    return th.Log(y + 50, u, sample_time=0.1)


@pytest.mark.filterwarnings("ignore::thetahat.EstimationWarning")
@pytest.mark.parametrize(
    "orders",
    [
        {"na": 2, "nb": 2},
        {"na": 2, "nb": [2, 1], "nk": [1, 2], "couple": "none"},
        {"na": range(1, 4), "nb": range(1, 4), "constant": "yes"},
        {"na": 1, "nb": 2, "nk": 0, "couple": "full", "offset": {"y1": 50.0}},
    ],
)
def test_several_outputs(two: th.Log, orders: dict[str, Any]) -> None:
    lags = th.NormalEquations(two[:500], **orders).lags
    first = th.NormalEquations(two[:1000], **orders)
    second = th.NormalEquations(two[1000 - lags :], past=lags, **orders)
    both = pickle.loads(pickle.dumps(first | second))
    assert both == first | second
    found, whole = both.solve(), th.arx(two, **orders)
    for matrix in ("a", "b"):
        values = [np.ravel([[[q["value"], q["standard_error"] or 0] for q in row] for row in one]) for one in
                  found.document["estimation"][matrix] + whole.document["estimation"][matrix]]
        half = len(values) // 2
        np.testing.assert_allclose(np.concatenate(values[:half]), np.concatenate(values[half:]), rtol=1e-12, atol=1e-13)
    one, other = (model.document["model"]["noise_covariance"] for model in (found, whole))
    np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(found.simulate(np.ones((50, 2))), whole.simulate(np.ones((50, 2))), rtol=1e-10)
    assert [fit["output"] for fit in found.fits] == ["y1", "y2"] and found.samples == whole.samples
    assert repr(both).endswith("2000 rows in 2 pieces, inputs u1, u2, outputs y1, y2)")


@pytest.mark.filterwarnings("ignore::thetahat.EstimationWarning")
@pytest.mark.parametrize(
    "options",
    [
        {},
        {"raw_terms": True, "detrend": "none"},
        {"regressors": ["sqrt(abs(u1))"], "offset": {"y": 49.0}},
    ],
)
def test_products_of_a_nonlinear_model(log: th.Log, options: dict[str, Any]) -> None:
    terms = ["1", "y(k-1)", "y(k-2)", "u1(k-1)", "u1(k-2)", "u2(k-3)", "u1(k-1)^2*u2(k-2)", "y(k-1)*u1(k-2)"]
    terms += ["sqrt(abs(u1))(k-1)"] if "regressors" in options else []
    orders: dict[str, Any] = {"terms": terms, "ny": 2, "nu": 3, **options}
    sums = [th.NormalEquations(log[max(0, first - 3) : first + 1000], past=min(first, 3), **orders) for first in (0, 1000, 2000)]
    found, whole = (sums[0] | pickle.loads(pickle.dumps(sums[1] | sums[2]))).solve(), th.narx(log, **orders)
    digits = 1e-12 if options.get("detrend") is None else 1e-8  # offsets that are left take digits from the fit in one pass
    np.testing.assert_allclose(found.parameters, whole.parameters, rtol=digits, atol=digits)
    np.testing.assert_allclose(found.standard_errors, whole.standard_errors, rtol=digits)
    assert found.parameter_names == whole.parameter_names and found.samples == whole.samples
    assert found.kind == "nonlinear-arx"
    for name, offset in whole.offsets.items():
        assert found.offsets[name] == pytest.approx(offset, rel=1e-12)
    assert repr(sums[0]).startswith(f"NormalEquations(NARX polynomial, {len(terms)} terms, 1000 rows in 1 piece, inputs u1, u2")
    np.testing.assert_allclose(found.predict(log), whole.predict(log), rtol=1e-9, equal_nan=True)


@pytest.mark.filterwarnings("ignore::thetahat.EstimationWarning")
@pytest.mark.parametrize("options", [{"terms": 5, "degree": 3}, {"select": "mdl", "most_terms": 15}])
def test_products_that_are_chosen(log: th.Log, options: dict[str, Any]) -> None:
    orders: dict[str, Any] = {"ny": 2, "nu": 2, "nk": [1, 2], **options}
    sums = th.NormalEquations(log[:1700], **orders) | th.NormalEquations(log[1697:], past=3, **orders)
    found, whole = sums.solve(), th.narx(log, **orders)
    assert found.parameter_names == whole.parameter_names
    np.testing.assert_allclose(found.parameters, whole.parameters, rtol=1e-12, atol=1e-12)


def test_products_of_other_kinds_are_refused(log: th.Log, two: th.Log) -> None:
    with pytest.raises(TypeError, match="terms: expected a sequence of str"):
        th.NormalEquations(log, terms="y(k-1)")
    with pytest.raises(ValueError, match="select: free runs say how many products"):
        th.NormalEquations(log, select="cv")
    with pytest.raises(ValueError, match="output: pieces make nonlinear models of one output"):
        th.NormalEquations(two, terms=["y1(k-1)"])
    with pytest.raises(ValueError, match="other products"):
        th.NormalEquations(log[:999], terms=["y(k-1)"]).merge(th.NormalEquations(log[999:], terms=["y(k-2)"]))


@pytest.mark.filterwarnings("ignore::thetahat.EstimationWarning")
@pytest.mark.parametrize(
    "options",
    [
        {},
        {"order": range(1, 8), "nk": [1, 2]},
        {"order": 4, "weighting": "cva", "past": 8, "future": 6, "feedthrough": False, "constant": "yes"},
    ],
)
def test_states(two: th.Log, options: dict[str, Any]) -> None:
    own = dict(options)
    horizons = own.pop("past", None), own.pop("future", None)
    orders: dict[str, Any] = {"order": "auto", "horizons": horizons, **own}
    lags = th.NormalEquations(two[:500], **orders).lags
    first = th.NormalEquations(two[:1000], **orders)
    second = th.NormalEquations(two[1000 - lags :], past=lags, **orders)
    both = pickle.loads(pickle.dumps(first | second))
    assert both == first | second and repr(both).startswith("NormalEquations(state space")
    found, whole = both.solve(), th.ss(two, **options)
    assert found.name == whole.name and found.samples > 1850
    np.testing.assert_allclose(found.simulate(np.ones((50, 2))), whole.simulate(np.ones((50, 2))), rtol=1e-12)
    for one, other in zip(found.fits, whole.fits):
        assert one["percent"] == pytest.approx(other["percent"], abs=0.3)


def test_states_that_cannot_be_found_are_refused(log: th.Log, two: th.Log) -> None:
    refused: list[tuple[dict[str, Any], type[Exception], str]] = [
        ({"order": 2, "na": 2}, ValueError, "na: it is not of state-space models"),
        ({"na": 2, "nb": 2, "weighting": "cva"}, ValueError, "weighting: it is for state-space models"),
        ({"order": "all"}, TypeError, "order: expected an int"),
        ({"order": 0}, ValueError, "order"),
        ({"order": 2, "horizons": 3}, TypeError, "horizons: expected two"),
        ({"order": 2, "horizons": (0, None)}, ValueError, "horizons"),
        ({"order": 2, "weighting": "pca"}, ValueError, "'pca' is none; there are ssarx"),
        ({"order": 2, "past": 9}, ValueError, "past: 9 rows are fewer than the 50"),
        ({"order": 2, "horizons": (10**6, None)}, ValueError, "past: 1000000 is outside 1..1000"),
    ]
    for arguments, kind, message in refused:
        with pytest.raises(kind, match=message):
            th.NormalEquations(two, **arguments)
    with pytest.raises(th.EstimationError, match="lagged signals"):
        th.NormalEquations(log[:6], order=1).solve()


def test_several_outputs_without_inputs(two: th.Log) -> None:
    sums = th.NormalEquations(two, na=2)
    assert repr(sums) == "NormalEquations(ARX(2) with 2 outputs, 2000 rows in 1 piece, no inputs, outputs y1, y2)"
    assert sums.solve().inputs == []
    with pytest.raises(ValueError, match="taps: an impulse response has one output"):
        th.NormalEquations(two, taps=5)
    with pytest.raises(ValueError, match="couple: it is for logs with several outputs"):
        th.NormalEquations(two.select(output="y1"), 2, 2, couple="full")
    with pytest.raises(ValueError, match="nk: the rows of a model change with its delay"):
        th.NormalEquations(two, 2, 2, range(1, 3))
    with pytest.raises(ValueError, match="of ARX.2, 2, .1 1.. with 2 outputs, the second ones of ARX.1"):
        th.NormalEquations(two[:999], 2, 2).merge(th.NormalEquations(two[999:], 1, 2))


@pytest.mark.filterwarnings("ignore::thetahat.EstimationWarning")
def test_they_travel(log: th.Log) -> None:
    pieces = cut(log, [0, 1000, 2000, 3000])
    again = [pickle.loads(pickle.dumps(piece)) for piece in pieces]
    assert again == pieces and all(copy.deepcopy(piece) is piece and copy.copy(piece) is piece for piece in pieces)
    assert th.NormalEquations.from_json(pieces[0].to_json()) == pieces[0]
    work = [(log[max(0, first - LAGS) : first + 1000], min(first, LAGS)) for first in (0, 1000, 2000)]
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn")) as pool:
        assert list(pool.map(made, work)) == pieces
    # Some kilobytes, however many rows.
    assert len(pickle.dumps(pieces[1])) < 10_000
    with pytest.raises(ValueError, match="this is not a thetahat document of normal equations"):
        th.NormalEquations.from_json("{}")
    with pytest.raises(ValueError, match="do not fit together"):
        th.NormalEquations.from_json(pieces[0].to_json().replace('"na": 2', '"na": 3'))
    with pytest.raises(TypeError, match="text"):
        th.NormalEquations.from_json(3)  # type: ignore[arg-type]


def test_what_does_not_fit_together_is_refused(log: th.Log) -> None:
    first, second, third = cut(log, [0, 1000, 2000, 3000])
    for other, message in [
        (first, "a piece is given twice"),
        (third, "the second pieces do not go on where the first ones end"),
        (th.NormalEquations(log[997:2000], 2, [2, 1], [1, 3]), "begin with the last 3 rows of the first ones"),
        (th.NormalEquations(log[1000:], 2, [1, 1], [1, 3]), "the second ones of ARX"),
        (th.NormalEquations(log[1000:], 2), "have the channels u1, u2, y, the second ones y"),
        (th.NormalEquations(log[1000:], 2, [2, 1], [1, 3], detrend="none"), "other offsets, another constant"),
    ]:
        with pytest.raises(ValueError, match=message):
            first | other
    assert (first | second).pieces == 2
    time = np.arange(1000) * 0.1
    clock = [th.Log(log["y"][k : k + 1000], log["u1"][k : k + 1000], time=time + 0.1 * k) for k in (0, 999)]
    pieces = [th.NormalEquations(one, 2, 2, past=past) for one, past in zip(clock, (0, 2))]
    with pytest.raises(ValueError, match="the clock goes back over the boundary"):
        pieces[1] | th.NormalEquations(clock[0][500:], 2, 2, past=2)
    with pytest.raises(TypeError):
        first | 3
    with pytest.raises(TypeError, match="expected NormalEquations, found int"):
        first.merge(3)  # type: ignore[arg-type]


def test_what_makes_no_piece_is_refused(log: th.Log) -> None:
    refused: list[tuple[dict[str, Any], str]] = [
        ({"na": 2, "nb": 2, "past": 1}, "past: 1 rows are fewer than the 2"),
        ({"na": 2, "nb": 2, "past": 3000}, "past: all 3000 rows of the piece"),
        ({"na": 2, "nb": 2, "past": -1}, "past: -1 is below 0"),
        ({}, "na: give the orders na and nb, or taps, terms or an order"),
        ({"na": 2, "taps": 10}, "taps: an impulse response has neither na nor nb"),
        ({"na": 2, "nk": 1}, "nk: it is for inputs"),
        ({"na": 2, "ny": 1}, "ny: it is for products; give terms too"),
        ({"na": 2, "terms": ["y(k-1)"]}, "na: it is not of nonlinear models"),
        ({"terms": []}, "terms: there is none"),
        ({"terms": ["y(k-9)"]}, "y.k-9."),
        ({"terms": ["y(k-1)"], "detrend": "linear"}, "detrend: what is taken"),
        ({"na": 2, "nb": 2, "detrend": "linear"}, "detrend: what is taken"),
        ({"na": 2, "nb": 2, "offset": {"w": 1.0}}, "'w' is neither an input nor the output"),
        ({"na": range(1, 3), "nb": 2}, "orders: pieces of a log make one model"),
    ]
    for arguments, message in refused:
        with pytest.raises(ValueError, match=message):
            th.NormalEquations(log, **arguments)
    with pytest.raises(TypeError, match="past: expected an int"):
        th.NormalEquations(log, 2, 2, past=2.0)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="log: expected a Log"):
        th.NormalEquations(np.zeros(10), 2, 2)  # type: ignore[arg-type]
    with pytest.raises(th.EstimationError, match="too few rows for the orders"):
        th.NormalEquations(log[:7], **ORDERS).solve()
    still = th.Log(log["y"][:100], np.ones(100))
    with pytest.raises(th.EstimationError, match="input 'u' is constant"):
        th.NormalEquations(still, 2, 2).solve()


@pytest.mark.filterwarnings("ignore::thetahat.EstimationWarning")
def test_a_million_rows_come_by_as_a_stream() -> None:
    random = np.random.default_rng(5)
    rows, size, lags = 1_000_000, 50_000, 4
    u, e, y = random.standard_normal(rows), random.standard_normal(rows), np.zeros(rows)
    for t in range(2, rows):
        y[t] = 1.5 * y[t - 1] - 0.7 * y[t - 2] + u[t - 1] + e[t]
    y += 1e6
    total: Optional[th.NormalEquations] = None
    for first in range(0, rows, size):
        past = min(first, lags)
        piece = th.NormalEquations(th.Log(y[first - past : first + size], u[first - past : first + size]), 4, 4, past=past)
        total = piece if total is None else total | piece
    assert total is not None
    found, whole = total.solve(), th.arx(th.Log(y, u), 4, 4)
    np.testing.assert_allclose(found.parameters, whole.parameters, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(found.standard_errors, whole.standard_errors, rtol=1e-12)
    assert found.samples == whole.samples == rows - 4
