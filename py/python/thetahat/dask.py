"""Many logs on many machines: `thetahat.fit_many` on Dask; and one model of a log that many machines have pieces of.

Needs ``pip install "thetahat[dask]"``. Nothing here schedules: Dask shares the work out, repeats what a lost worker had, and is
interrupted as it always is. A task fits a few logs, one after the other, on one thread of its worker. The same logs and arguments give
the same rows, whatever the workers.

>>> import dask
>>> import thetahat as th
>>> import thetahat.dask
>>> motor = th.dc_motor()
>>> with dask.config.set(scheduler="threads"):
...     table = thetahat.dask.fit_many({"first": motor[:500], "second": motor[500:]}, th.arx, na=2, nb=2).compute()
>>> table[["log", "model", "dc_gain"]].round(2)
      log         model  dc_gain
0   first  ARX(2, 2, 1)     18.6
1  second  ARX(2, 2, 1)    19.35
"""

from __future__ import annotations

import contextvars
import inspect
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import chain, islice
from pathlib import PurePosixPath
from typing import Any, NamedTuple, Union

import dask
import dask.bag
import dask.dataframe
import numpy
import pandas
from dask.delayed import Delayed

from thetahat import _thetahat
from thetahat.base import said as _said
from thetahat.engine import options as _options
from thetahat.engine.option_types import EquationsOptions
from thetahat.fits import many as _many
from thetahat.fits.fit import ar, arma, armax, arx, bj, fir, general, oe, search, told
from thetahat.fits.grey_box import GreyBox, grey
from thetahat.fits.normal_equations import NormalEquations as _NormalEquations
from thetahat.fits.normal_equations import both_horizons
from thetahat.fits.state_space import ss
from thetahat.logs.log import Log
from thetahat.models.model import Model

__all__ = ["fit_experiments", "fit_many", "normal_equations", "rows"]

Logs = Union[str, Iterable[Any], Mapping[str, Any], "dask.bag.Bag", "dask.dataframe.DataFrame"]
_Run = Sequence["tuple[str, Any]"]
"""Logs with their names, one after the other."""
_Share = Sequence[_Run]

_TASKS = 16
"""A task has one log unless each worker has more tasks than this: the scheduler takes some milliseconds for a task."""
_MOST = 32
"""The logs of a task, at most: so many are done again when a worker is lost."""
_ASKED = 4
"""The tasks that a search asks on each thread of the workers, at most: the scheduler takes as long for one as an iteration on 10^5 rows."""
_FRONT = 16
"""Rows at the front of some pieces beside those that the model reaches back to: their steps are its sample time."""


def fit_many(
    logs: Logs,
    fit: Callable[..., Any] = search,
    *,
    by: str | None = None,
    read: Mapping[str, Any] | None = None,
    reports: str | os.PathLike[str] | None = None,
    per_task: int | None = None,
    **options: Any,
) -> Any:
    """Fit each of many logs a model of its own, on the workers of Dask.

    The rows are computed at once, and stay on the workers: only then is known which columns there are.

    Parameters
    ----------
    logs : iterable, dict of names to logs, str, Bag or DataFrame
        As for `thetahat.fit_many`: files by paths that all workers see, or by URLs of fsspec, a pattern, `Log`, data frames of pandas;
        also delayed objects that give any of these, a bag of them, or pairs of name and log in a bag. A data frame of Dask is
        grouped by a column, see ``by``.
    fit, read, options
        As for `thetahat.fit_many`. Functions of your own have to be ones that can be pickled.
    by : str, optional
        The column of a data frame of Dask whose values tell the logs apart: the rows of each value are a log, in the order of the
        column that ``read`` names as ``time``, as the order of rows does not outlast a shuffle. ``read`` has the roles of the others.
    reports : path or URL, optional
        A folder that all workers see, for the document of each.
    per_task : int, optional
        How many logs a task has. Unless said otherwise one, and more where there are many for each worker.

    Returns
    -------
    dask.dataframe.DataFrame
        A row for each log, in the order of the logs (of ``by``, in that of its values within each partition), with the columns
        that `thetahat.Fits.to_pandas` has.

    Raises
    ------
    ValueError
        If the arguments do not make sense, whatever the log; if there is no log, or two have one document.

    Examples
    --------
    >>> import dask, pandas
    >>> import dask.dataframe
    >>> import thetahat as th
    >>> import thetahat.dask
    >>> motor = th.dc_motor().to_pandas().reset_index(names="t").assign(unit=["a", "b"] * 500)
    >>> frame = dask.dataframe.from_pandas(motor, npartitions=4)
    >>> roles = {"inputs": "u", "output": "y", "time": "t"}
    >>> with dask.config.set(scheduler="threads"):
    ...     table = thetahat.dask.fit_many(frame, th.arx, by="unit", read=roles, na=2, nb=2).compute()
    >>> sorted(table["log"])
    ['a', 'b']
    """
    parts = dask.persist(*_tasks(logs, _many.Work(fit, options, dict(read or {})), by, reports, per_task))
    heads = dask.compute(*[dask.delayed(_head)(part) for part in parts])
    if all(wrong is not None for _, _, wrong in heads):
        raise ValueError(heads[0][2])
    kinds = [own for own, _, _ in heads]
    firsts = numpy.cumsum([0, *(count for _, count, _ in heads)])
    names = _many.columns(kinds)
    types = {name: _type(set().union(*[own.get(name, ()) for own in kinds])) for name in names}
    meta = pandas.DataFrame({name: pandas.Series([], dtype=kind) for name, kind in types.items()})
    frames = [dask.delayed(_frame)(part, int(first), types) for part, first in zip(parts, firsts)]
    return dask.dataframe.from_delayed(frames, meta=meta, verify_meta=False)


def rows(
    logs: Logs,
    fit: Callable[..., Any] = search,
    *,
    by: str | None = None,
    read: Mapping[str, Any] | None = None,
    reports: str | os.PathLike[str] | None = None,
    per_task: int | None = None,
    **options: Any,
) -> dask.bag.Bag:
    """The rows of `fit_many` as a bag of dicts, of which nothing has been computed yet.

    Examples
    --------
    >>> import dask
    >>> import thetahat as th
    >>> import thetahat.dask
    >>> bag = thetahat.dask.rows([th.dc_motor()], th.oe, nb=2, nf=2)
    >>> with dask.config.set(scheduler="threads"):
    ...     [row["model"] for row in bag.compute()]
    ['OE(2, 2, 1)']
    """
    return dask.bag.from_delayed(_tasks(logs, _many.Work(fit, options, dict(read or {})), by, reports, per_task))


def normal_equations(
    logs: Logs, *, experiments: bool = False, read: Mapping[str, Any] | None = None, **orders: Any
) -> Delayed:
    """The normal equations of one model, of which the workers of Dask have pieces: `thetahat.NormalEquations`, merged as a tree.

    A worker has one piece in memory for each of its threads, reads it once, and hands on some kilobytes. The result is solved where it is wanted:
    ``normal_equations(…).compute().solve()`` is the model that a fit to all rows in one pass gives.

    Parameters
    ----------
    logs : iterable, dict of names to logs, str or DataFrame
        The pieces, as for `fit_many`: files, logs, frames, delayed objects; or a data frame of Dask, whose partitions they are. Parts of
        one log in the order of time, unless ``experiments`` says otherwise: the past samples that the model needs come from the piece before.
    experiments : bool, default False
        Whether each piece is an experiment of its own; lags then do not cross from one piece into the next.
    read : dict, optional
        How pieces are read, as for `thetahat.fit_many`.
    **orders
        The arguments of `thetahat.NormalEquations`, ``past`` excepted.

    Returns
    -------
    Delayed
        Of `thetahat.NormalEquations`. Computing it raises a ValueError that names the piece which has no rows, other columns, or a clock that
        goes back.

    Examples
    --------
    >>> import dask
    >>> import thetahat as th
    >>> import thetahat.dask
    >>> motor = th.dc_motor()
    >>> pieces = [motor[first : first + 100] for first in range(0, 1000, 100)]
    >>> with dask.config.set(scheduler="threads"):
    ...     sums = thetahat.dask.normal_equations(pieces, na=2, nb=2).compute()
    >>> sums
    NormalEquations(ARX(2, 2, 1), 1000 rows in 10 pieces, inputs u, output y)
    >>> bool(abs(sums.solve().parameters - th.arx(motor, na=2, nb=2).parameters).max() < 1e-12)
    True
    """
    work = _many.Work(read=dict(read or {}))
    lags = 0 if experiments else _lags(**orders)
    # A task has some pieces that follow one another, one after the other in memory. The rows at the front of its first one, which
    # reach back to those before, are a piece of their own: so each is read once, and no task waits for another.
    runs = _runs(_pieces(logs), finer=4)
    parts = [dask.delayed(_part)(work, run, lags + _FRONT if place and lags else 0, lags, orders) for place, run in enumerate(runs)]
    sums, end = parts[:1], parts[0]
    for part in parts[1:]:
        sums += [dask.delayed(_front)(end, part, orders), part] if lags else [part]
        end = dask.delayed(_later_end)(end, part, lags)
    while len(sums) > 1:
        sums = [dask.delayed(_merged)(*sums[first : first + 2]) for first in range(0, len(sums), 2)]
    return dask.delayed(_merged)(*sums)


def fit_experiments(
    logs: Logs,
    fit: Callable[..., Model] = oe,
    *,
    read: Mapping[str, Any] | None = None,
    per_task: int | None = None,
    **options: Any,
) -> Model:
    """Fit one model to experiments that the workers of Dask have: the one that ``fit(Log.join(logs), **options)`` finds.

    Each iteration of the search asks all workers at once for the sums over their experiments: the cost, its gradient and its Gram
    matrix. Experiments stay in the workers' memory, which has to hold them all once; some kilobytes go over the network in an
    iteration. Starts are found in some rows here; logs of fewer than 262,144 rows together are fetched.

    Parameters
    ----------
    logs : iterable, dict of names to logs, str or DataFrame
        The experiments, as for `fit_many`: files, logs, frames, delayed objects; or a data frame of Dask, whose partitions they are. Nothing
        reaches from one into the next.
    fit : {oe, armax, bj, arma, general, grey, arx, ar, fir, ss}, default oe
        The function of this package that fits the model to one log. What is linear in its parameters is solved in one pass, by
        `normal_equations`. Logs of a model in equations (`grey`) are fetched too: it is the steps of its filter that take long.
    read : dict, optional
        How experiments are read, as for `thetahat.fit_many`.
    per_task : int, optional
        How many experiments a task has: unless said otherwise as many as leave four tasks for each thread of the workers.
    **options
        The arguments of ``fit``. All rows serve for the fit, and what is taken from the channels is the mean over all, or nothing.

    Returns
    -------
    Model
        Its report has the fit one step ahead; further figures are those of ``model.validate(log)``. That of a model in equations has all.

    Raises
    ------
    EstimationError, ValueError
        As for ``fit``; if an experiment cannot be read, has other columns or another sample time, or is given twice.

    Notes
    -----
    An iteration takes O(N p) operations on a worker for its N rows, and one message to each task. A sum is over a 16th of the
    experiments, and 32 at most (or ``per_task``): the same experiments give the same bytes, whatever the workers. Parameters are those
    of one process to 1e-8 of their size.

    Examples
    --------
    >>> import dask
    >>> import thetahat as th
    >>> import thetahat.dask
    >>> motor = th.dc_motor()
    >>> with dask.config.set(scheduler="threads"):
    ...     model = thetahat.dask.fit_experiments([motor[:500], motor[500:]], th.oe, nb=2, nf=2)
    >>> whole = th.oe(th.Log.join([motor[:500], motor[500:]]), nb=2, nf=2)
    >>> bool(abs(model.parameters - whole.parameters).max() < 1e-8)
    True
    """
    if fit not in (oe, armax, bj, arma, general, grey, arx, ar, fir, ss):
        name = getattr(fit, "__name__", fit)
        raise ValueError(f"fit: {name!r} fits no one model to experiments; give thetahat.oe, armax, bj, arma, general, grey or ss")
    bound = inspect.signature(fit).bind(None, **options)
    bound.apply_defaults()
    if fit is ss:
        order = options.pop("order", None)
        horizons = options.pop("past", None), options.pop("future", None)
        options.update(order="auto" if order is None else order, horizons=horizons)
    if fit in (arx, ar, fir, ss):
        for name in sorted(set(options) - set(inspect.signature(_NormalEquations).parameters)):
            raise ValueError(f"{name}: the model is made in one pass over the experiments, which does not know it; leave it out")
        return told(normal_equations(logs, experiments=True, read=read, **options).compute().solve())
    work = _many.Work(read=dict(read or {}))
    runs = _runs(_pieces(logs), per_task)
    shares = _shares(runs, per_task)
    if fit is grey:
        return told(_equations(work, shares, bound.arguments))
    own = _options.plan({"model": fit.__name__, **{name: value for name, value in bound.arguments.items() if name != "log"}})
    held = dask.persist(*[dask.delayed(_experiments)(work, share, own) for share in shares])
    known = list(chain(*dask.compute(*[dask.delayed(_described)(part, len(runs)) for part in held])))
    every = _together([(run[0][0], _thetahat.Experiments.from_json(text)) for run, (_, text) in zip(runs, known)])
    offsets = every.offsets(own)
    if every.are_fetched:
        fetched = known if all(log is not None for log, _ in known) else chain(*dask.compute(*held))
        near = _deviations(fetched, own, offsets)
        found = every.fit(own, lambda questions: _answers(near, questions, own))
    else:
        held = dask.persist(*[dask.delayed(_deviations)(part, own, offsets) for part in held])
        found = every.fit(own, _asking(_answers, held, shares, own))
    return told(Model._of(found))


def _asking(
    answers: Callable[..., list[bytes]], held: Sequence[Any], shares: Sequence[Sequence[Any]], *arguments: Any
) -> Callable[[list[bytes]], list[bytes]]:
    """Asks all who hold experiments at once, each the questions about its runs."""
    # From another thread.
    context = contextvars.copy_context()

    def ask(questions: list[bytes]) -> list[bytes]:
        left = iter(questions)
        asked = [(part, list(islice(left, len(share)))) for part, share in zip(held, shares)]
        tasks = [dask.delayed(answers, pure=False)(part, own, *arguments) for part, own in asked]
        return list(chain(*context.run(dask.compute, *tasks)))

    return ask


def _equations(work: _many.Work, shares: Sequence[_Share], arguments: Mapping[str, Any]) -> Model:
    """A model in equations, of which the workers compute the likelihood."""
    box = arguments["model"] if isinstance(arguments["model"], GreyBox) else GreyBox(arguments["model"])
    held = dask.persist(*[dask.delayed(_joined)(work, share) for share in shares])
    logs = list(chain(*dask.compute(*held)))
    counts = [len(log.experiments) for log in logs]
    own = _options.plan({name: arguments.get(name) for name in EquationsOptions.__annotations__})
    log = Log.join(logs)._log
    return Model._of(_thetahat.fit_equations_distributed(log, box._model, own, counts, _asking(_equations_answers, held, shares, box)))


def _pieces(logs: Logs) -> list[tuple[str, Any]]:
    """The logs with their names, each of them once."""
    if isinstance(logs, dask.dataframe.DataFrame):
        named = [(f"partition {place}", part) for place, part in enumerate(logs.to_delayed())]
    else:
        named = _many.name_all(logs)
    known: dict[Any, str] = {}
    for name, item in named:
        own = name if isinstance(item, (str, os.PathLike)) else id(item)
        if own in known:
            raise ValueError(f"logs: {known[own]} is given twice, the second time as {name}; give each piece once")
        known[own] = name
    return named


def _runs(named: Sequence[tuple[str, Any]], per_task: int | None = None, finer: int = 1) -> list[_Run]:
    """The pieces that one sum is over. How many does not depend on the workers: the same pieces give the same bytes."""
    count = _count(per_task, max(1, min(_MOST, len(named) // (finer * _TASKS))))
    return [named[first : first + count] for first in range(0, len(named), count)]


def _shares(runs: Sequence[_Run], per_task: int | None) -> list[_Share]:
    """The runs that each task of a search has: one where it is said how much that is, or where no worker has come yet."""
    tasks = len(runs) if per_task is not None else min(len(runs), _ASKED * _workers() or len(runs))
    cuts = [len(runs) * task // tasks for task in range(tasks + 1)]
    return [runs[first:last] for first, last in zip(cuts, cuts[1:])]


def _experiments(work: _many.Work, share: _Share, own: str) -> list[tuple[Log, str]]:
    """The experiments of each run as one log, and what is known of them."""
    with _shared():
        return [_described_run(work, run, own) for run in share]


def _described_run(work: _many.Work, run: _Run, own: str) -> tuple[Log, str]:
    logs: list[Log] = []
    described = []
    for name, item in run:
        log = _loaded(work, name, item)
        with _in_piece(name):
            described.append((name, _thetahat.Experiments(log._log, own)))
        logs.append(log)
    return Log.join(logs), _together(described).joined().to_json()


def _together(described: Sequence[tuple[str, _thetahat.Experiments]]) -> _thetahat.Experiments:
    """All experiments as one model sees them; errors name the one that does not fit."""
    (_, every), *others = described
    for name, own in others:
        with _in_piece(name):
            every = every.merged([own])
    return every


def _joined(work: _many.Work, share: _Share) -> list[Log]:
    """The experiments of each run as one log."""
    with _shared():
        return [Log.join([_loaded(work, name, item) for name, item in run]) for run in share]


def _equations_answers(part: Iterable[Log], questions: Iterable[bytes], box: GreyBox) -> list[bytes]:
    with _shared():
        return [_thetahat.answer_equations(log._log, box._model, question) for log, question in zip(part, questions)]


def _described(part: Iterable[tuple[Log, str]], count: int) -> list[tuple[Log | None, str]]:
    """What is known of the experiments of each run, and they themselves where so many runs as short as it are fetched."""
    fetched = _thetahat.Experiments.FETCHED_BELOW
    return [(log if count * len(log) < fetched else None, text) for log, text in part]


def _deviations(part: Iterable[tuple[Any, str]], own: str, offsets: Sequence[float]) -> list[Log]:
    with _shared():
        return [Log._of(_thetahat.deviations(log._log, own, offsets), log._clock) for log, _ in part]


def _answers(part: Iterable[Log], questions: Iterable[bytes], own: str) -> list[bytes]:
    with _shared():
        return [_thetahat.answer(log._log, own, question) for log, question in zip(part, questions)]


@contextmanager
def _shared() -> Iterator[None]:
    """What is done here shares the threads of the worker."""
    before = _thetahat.threads(_threads(), None)
    try:
        yield
    finally:
        _thetahat.threads(*before)


def _lags(
    na: Any = 0,
    nb: Any = 0,
    nk: Any = None,
    taps: Any = None,
    terms: Any = None,
    select: Any = None,
    ny: Any = None,
    nu: Any = None,
    order: Any = None,
    weighting: Any = None,
    horizons: Any = None,
    **_: Any,
) -> int:
    """How many rows the model reaches back to, at most. Orders are numbers, ranges, or one of these for each input."""
    if order is not None:
        return _largest(nk) + _thetahat.NormalEquations.lags_of_states(weighting, *both_horizons(horizons))
    if terms is not None or select is not None:
        na, nb = 2 if ny is None else ny, 2 if nu is None else nu
    first = (0 if taps is not None else 1) if nk is None else _largest(nk)
    count = _largest(nb if taps is None else taps)
    return max(_largest(na), first + count - 1 if count else 0)


def _largest(order: Any) -> int:
    if isinstance(order, (range, list, tuple, numpy.ndarray)):
        return max(map(_largest, order), default=0)
    return 0 if order is None else int(order)


def _loaded(work: _many.Work, name: str, item: Any) -> Log:
    """A piece under its name: the same values under another name are those of a plant that rests."""
    with _in_piece(name), _said.kept():
        return _called(work.log(name, item), name)


def _called(log: Log, name: str) -> Log:
    return Log._of(log._log.called(name), log._clock)


def _columns(log: Log, rows: slice = slice(None)) -> dict[str | None, Any]:
    """Some rows of a piece: a column for each channel; under None the times in seconds, from one origin for all pieces, if it has a clock."""
    columns: dict[str | None, Any] = {name: log._log.values(name)[rows] for name in [*log.inputs, *log.outputs]}
    if log._log.time() is not None:
        _, start = log._log.clock
        columns[None] = (0.0 if start is None else pandas.to_datetime(start, utc=True).timestamp()) + log.time[rows]
    return columns


def _past(before: dict[str | None, Any] | None, end: dict[str | None, Any], lags: int) -> dict[str | None, Any]:
    """The last rows of a piece, and of those before it where it is short."""
    if before is None:
        return end
    return {name: numpy.concatenate([before[name], values])[-lags:] if name in before else values for name, values in end.items()}


class _Part(NamedTuple):
    """What a task has found in some pieces that follow one another."""

    sums: _NormalEquations | None
    """Of all rows but those of the front; none if there are no others."""
    front: dict[str | None, Any]
    end: dict[str | None, Any]
    """The last rows."""
    first: Log
    """A row of the first piece, for its channels."""
    name: str


def _part(work: _many.Work, run: Sequence[tuple[str, Any]], front: int, lags: int, orders: Mapping[str, Any]) -> _Part:
    """The sums of some pieces that follow one another, of which the first rows are the front."""
    sums: _NormalEquations | None = None
    own: dict[str | None, Any] | None = None
    past: dict[str | None, Any] | None = None
    first: Log | None = None
    with _shared():
        for name, item in run:
            log = _loaded(work, name, item)
            first = log[:1] if first is None else first
            with _in_piece(name):
                rows = min(front, len(log))
                front -= rows
                if rows:
                    taken = {channel: values.copy() for channel, values in _columns(log, slice(rows)).items()}
                    own = taken if own is None else _joined_columns(own, taken)
                if rows < len(log):
                    before = rows + (0 if past is None else len(next(iter(past.values()))))
                    # What has dates gets the one origin that all pieces share.
                    whole = log if past is None and not _has_dates(log) else _after(past, _columns(log), log, name)
                    piece = _NormalEquations(whole, past=before, **orders)
                    sums = piece if sums is None else sums.merge(piece)
            if lags:
                past = _past(past, _columns(log, slice(-lags, None)), lags)
    if first is None:
        raise ValueError("logs: there is none; give at least one piece")
    end = {channel: values.copy() for channel, values in (past or {}).items()}
    return _Part(sums, own or {}, end, first, run[0][0])


def _front(before: _Part, part: _Part, orders: Mapping[str, Any]) -> _NormalEquations:
    """The sums of the front of some pieces, which reaches back to the rows before."""
    with _in_piece(part.name):
        rows = len(next(iter(before.end.values())))
        return _NormalEquations(_after(before.end, part.front, part.first, part.name), past=rows, **orders)


def _later_end(before: _Part, part: _Part, lags: int) -> _Part:
    """What is known of the last rows of some pieces after others."""
    return part._replace(sums=None, front={}, end=_past(before.end, part.end, lags)) if lags else part


def _joined_columns(one: dict[str | None, Any], other: dict[str | None, Any]) -> dict[str | None, Any]:
    if list(one) != list(other):
        own, before = (", ".join(str(name or "a clock") for name in names) for names in (other, one))
        raise ValueError(f"it has {own}, the piece before it {before}; give all the same columns")
    return {name: numpy.concatenate([values, other[name]]) for name, values in one.items()}


def _has_dates(log: Log) -> bool:
    _, start = log._log.clock
    return start is not None


def _after(past: dict[str | None, Any] | None, rows: dict[str | None, Any], like: Log, name: str) -> Log:
    """Rows with those before them in front, as a log with the channels of another."""
    columns = rows if past is None else _joined_columns(past, rows)
    clock = {"time": columns[None]} if None in columns else {"sample_time": like.sample_time}
    outputs, inputs = ({name: columns[name] for name in names} for names in (like.outputs, like.inputs))
    return _called(Log(outputs, inputs or None, **clock), name)


def _merged(*found: _NormalEquations | _Part) -> _NormalEquations | None:
    sums = [one for one in ((part.sums if isinstance(part, _Part) else part) for part in found) if one is not None]
    return sums[0].merge(*sums[1:]) if sums else None


@contextmanager
def _in_piece(name: str) -> Iterator[None]:
    """Errors say in which piece they are."""
    try:
        yield
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None


def _tasks(
    logs: Logs, work: _many.Work, by: str | None, reports: str | os.PathLike[str] | None, per_task: int | None
) -> list[Delayed]:
    """Tasks of which each gives the rows of some logs."""
    if isinstance(logs, dask.dataframe.DataFrame):
        return _grouped(logs, by, work, reports)
    if by is not None:
        raise ValueError("by: it is the column of a data frame of Dask; these logs are apart already")
    if isinstance(logs, dask.bag.Bag):
        pairs = [dask.delayed(_pairs)(part, place) for place, part in enumerate(logs.to_delayed())]
        return [dask.delayed(_each)(work, part, _folder(reports)) for part in pairs]
    named = _many.name_all(logs)
    files = _many.reports_of([name for name, _ in named], named, reports)
    triples = [(name, item, file) for (name, item), file in zip(named, files)]
    count = _count(per_task, max(1, min(_MOST, len(triples) // (_TASKS * max(1, _workers())))))
    tasks = [triples[first : first + count] for first in range(0, len(triples), count)]
    return [dask.delayed(_each)(work, task, None) for task in tasks]


def _count(per_task: int | None, default: int) -> int:
    """How many logs a task has."""
    count = default if per_task is None else per_task
    if isinstance(count, bool) or not isinstance(count, int) or count < 1:
        raise ValueError(f"per_task={per_task!r}: give a number from 1 on")
    return count


def _workers() -> int:
    """How many tasks run at the same time on the cluster, none before it has workers; without one, as many as there are cores."""
    try:
        from distributed import get_client

        return sum(get_client().nthreads().values())
    except (ImportError, ValueError):
        return os.cpu_count() or 1


def _each(work: _many.Work, task: Iterable[tuple[str, Any, str | None]], folder: str | None) -> list[dict[str, Any]]:
    """The rows of some logs."""
    with _shared():
        if folder is not None:
            task = [(name, item, _many.report_of(folder, PurePosixPath(name))) for name, item, _ in task]
        return [work(name, item, file)[0] for name, item, file in task]


def _threads() -> int:
    """As many as the worker has, which all of its tasks share; 0, as many as there are cores, where there is none."""
    try:
        from distributed import get_worker

        return int(get_worker().state.nthreads)
    except (ImportError, ValueError):
        return 0


def _pairs(part: Iterable[Any], place: int) -> list[tuple[str, Any, None]]:
    """The logs of a part of a bag, with their names: those of files, of pairs, or their places."""
    named: list[tuple[str, Any, None]] = []
    for own, item in enumerate(part):
        if isinstance(item, tuple) and len(item) == 2 and isinstance(item[0], str):
            named.append((item[0], item[1], None))
        else:
            is_file = isinstance(item, (str, os.PathLike))
            named.append((os.fspath(item) if is_file else f"{place}.{own}", item, None))
    return named


def _folder(reports: str | os.PathLike[str] | None) -> str | None:
    return None if reports is None else os.fspath(reports).rstrip("/")


def _grouped(
    frame: dask.dataframe.DataFrame, by: str | None, work: _many.Work, reports: str | os.PathLike[str] | None
) -> list[Delayed]:
    """A task for each partition of a frame in which all rows of a value are together."""
    if by is None:
        raise ValueError("by: name the column whose values tell the logs apart")
    time = work.read.get("time")
    if by not in frame.columns:
        raise ValueError(f"by: there is no column {by!r}; there are: {', '.join(map(str, frame.columns))}")
    if not isinstance(time, str) or time not in frame.columns:
        raise ValueError("read: name the column of times, as in read={'time': 't', …}: a shuffle does not keep the order of rows")
    together = frame.shuffle(on=by)
    return [dask.delayed(_groups)(work, part, by, time, _folder(reports)) for part in together.to_delayed()]


def _groups(work: _many.Work, part: pandas.DataFrame, by: str, time: str, folder: str | None) -> list[dict[str, Any]]:
    groups = part.groupby(by, sort=True, dropna=False, observed=True)
    logs = [(str(name), group.sort_values(time, kind="stable").drop(columns=by).reset_index(drop=True)) for name, group in groups]
    return _each(work, [(name, log, None) for name, log in logs], folder)


def _head(part: Iterable[Mapping[str, Any]]) -> tuple[dict[str, set[type]], int, str | None]:
    """The columns of some rows with the types of their values; how many there are; what is wrong with the arguments, if that is all."""
    part = list(part)
    kinds: dict[str, set[type]] = {name: set() for name in _many.columns(part)}
    for row in part:
        for name, value in row.items():
            kinds[name].add(type(value))
    wrong = part and all(row["exit_code"] == 2 for row in part)
    return kinds, len(part), part[0]["message"] if wrong else None


def _type(kinds: set[type]) -> str:
    """The type of a column in which some values may be missing."""
    if kinds <= {bool}:
        return "boolean"
    if kinds <= {int}:
        return "Int64"
    return "Float64" if kinds <= {int, float} else "string"


def _frame(part: Iterable[Mapping[str, Any]], first: int, types: Mapping[str, str]) -> pandas.DataFrame:
    """Some rows as a frame, counted from the first one of all."""
    part = list(part)
    cells = {name: pandas.array([row.get(name) for row in part], dtype=kind) for name, kind in types.items()}
    return pandas.DataFrame(cells, index=range(first, first + len(part)))
