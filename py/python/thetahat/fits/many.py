"""Many logs, each by itself: a row for each in a table."""

from __future__ import annotations

import glob
import json
import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import PurePosixPath
from threading import Lock
from typing import Any, Union

from thetahat import _thetahat
from thetahat.base import numbers as _numbers, said as _said
from thetahat.engine import files as _files, options as _options, progress as _progress
from thetahat.engine.progress import Progress
from thetahat.fits.fit import search
from thetahat.logs.inspection import Inspection
from thetahat.logs.log import Log
from thetahat.logs.read import read_csv
from thetahat.models.model import Model

Item = Union[str, "os.PathLike[str]", Log, Any]
"""A log: a file, a `Log`, or a data frame."""

_BETWEEN = " | "
_NOTED = (0, 3, 4)
"""The exit codes of what depends on the log alone: not on arguments, nor on whether a file can be read. (Nor on the memory.)"""
_ENDINGS = re.compile(r"(\.(gz|csv|tsv|txt|parquet|arrow|feather))+$", re.IGNORECASE)


@dataclass(frozen=True)
class Work:
    """What is done with each log. It can be pickled if `fit` can."""

    fit: Callable[..., Any] = search
    options: Mapping[str, Any] = field(default_factory=dict)
    read: Mapping[str, Any] = field(default_factory=dict)

    def __call__(
        self, name: str, item: Item, report: str | None = None, journal: _thetahat.Journal | None = None
    ) -> tuple[dict[str, Any], Any]:
        """The row of one log, and what was found. The document goes into the file `report`.

        What the journal knows of a file is taken from there, and what it does not know is noted in it.
        """
        if journal is None or not isinstance(item, (str, os.PathLike)):
            return self._new(name, report, lambda: self.log(name, item))
        with ExitStack() as stack:
            try:
                path = stack.enter_context(_files.local(item))
            except OSError as error:
                return _failed(name, error), error
            digest = journal.digest(path)
            known = None if digest is None else _known(journal.row(name, digest), report)
            if known is not None:
                return known
            row, found = self._new(name, report, lambda: self._of_file(name, item, path))
        if digest is not None and row["exit_code"] in _NOTED and not isinstance(found, MemoryError):
            journal.note(digest, list(row.items()))
        return row, found

    def _new(self, name: str, report: str | None, log: Callable[[], Log]) -> tuple[dict[str, Any], Any]:
        row: dict[str, Any] = {"log": name, "exit_code": 0}
        with _said.kept() as words:
            try:
                found = self.fit(log(), **self.options)
                text = found.to_json()
                figures = _thetahat.row(text)
            except (ValueError, OSError, MemoryError, _thetahat.EstimationError) as error:
                return _failed(name, error), error
        for figure, value in figures:
            while figure in row:
                figure += "_"
            row[figure] = value
        words += [warning for warning in found.warnings if warning not in words]
        if words:
            row["warnings"] = _BETWEEN.join(words)
        if report is not None:
            _files.write_anywhere(report, text)
            row["report"] = report
        return row, found

    def log(self, name: str, item: Item) -> Log:
        """The log that an item is."""
        if isinstance(item, Log):
            return item
        if isinstance(item, (str, os.PathLike)):
            with _files.local(item) as path:
                return self._of_file(name, item, path)
        return Log.from_dataframe(item, **self.read)

    def _of_file(self, name: str, item: str | os.PathLike[str], path: str) -> Log:
        if path == os.fspath(item):
            return read_csv(path, **self.read)
        # What was fetched is called as it is where it came from.
        try:
            log = read_csv(path, **self.read)
        except (ValueError, OSError) as error:
            raise type(error)(str(error).replace(path, name)) from None
        return Log._of(log._log.called(name), log._clock)

    def journal(self, reports: str | os.PathLike[str] | None) -> _thetahat.Journal | None:
        """The journal of a folder, if what is done can be told in words: by a function of this package, with plain arguments."""
        if reports is None or _files.is_url(os.fspath(reports)):
            return None
        module, function = (str(getattr(self.fit, name, "")) for name in ("__module__", "__qualname__"))
        if module.split(".")[0] != "thetahat" or not function.isidentifier():
            return None
        try:
            words = json.dumps([module, function, _plain(self.options), _plain(self.read)])
        except TypeError:
            return None
        return _thetahat.Journal(os.fspath(reports), f"fit_many {words}")


def _plain(value: Any) -> Any:
    """The same as JSON has it. A TypeError for what it does not have."""
    if isinstance(value, range):
        return {"range": [value.start, value.stop, value.step]}
    if isinstance(value, Mapping):
        return [[_plain(key), _plain(item)] for key, item in value.items()]
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    raise TypeError(type(value).__name__)


def _known(cells: list[tuple[str, Any]] | None, report: str | None) -> tuple[dict[str, Any], Any] | None:
    """The row of an earlier run and what was found, if its document can be read still."""
    if cells is None:
        return None
    row = dict(cells)
    if row["exit_code"] != 0:
        kind = _thetahat.EstimationError if row["exit_code"] == 4 else ValueError
        return row, kind(row.get("message", ""))
    if report is None or row.get("report") != report:
        return None
    try:
        with open(report, encoding="utf-8") as file:
            text = file.read()
        kind = json.loads(text)["schema"].split("/")[0]
        if kind == "thetahat.inspection":
            return row, Inspection(*_thetahat.inspection(text))
        return (row, Model.from_json(text)) if kind == "thetahat.report" else None
    except (OSError, ValueError, KeyError):
        return None


def _failed(name: str, error: Exception) -> dict[str, Any]:
    return {"log": name, "exit_code": _exit_code(error), "message": str(error)}


def _exit_code(error: Exception) -> int:
    if isinstance(error, _thetahat.EstimationError):
        return 4
    if isinstance(error, OSError):
        return 5
    # What reads the arguments complains of nothing else.
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    of_arguments = trace is not None and trace.tb_frame.f_globals.get("__name__") == _options.__name__
    return int(getattr(error, "exit_code", 2 if of_arguments else 3))


class Fits(Sequence[Any]):
    """What `fit_many` made of many logs: a row for each, in their order, and the model of each.

    ``fits[0]`` and ``fits["name"]`` are what was found for a log; where that is nothing, the error is raised that says why.

    Examples
    --------
    >>> import thetahat as th
    >>> motor = th.dc_motor()
    >>> fits = th.fit_many({"first": motor[:500], "second": motor[500:], "short": motor[:3]}, th.arx, na=2, nb=2)
    >>> fits
    Fits(3 logs, 2 of them without a failure)
    >>> fits["second"].name
    'ARX(2, 2, 1)'
    >>> [(row["log"], row["exit_code"]) for row in fits.rows]
    [('first', 0), ('second', 0), ('short', 4)]
    """

    __slots__ = ("_found", "rows")
    rows: list[dict[str, Any]]
    """A dict for each log: its name (``log``), the ``exit_code`` that the command line would have had, a ``message`` if that is not
    0, and the figures of the model; a figure that there is none of is not in it."""

    def __init__(self, rows: Sequence[dict[str, Any]], found: Sequence[Any]) -> None:
        self.rows = list(rows)
        self._found = list(found)

    @property
    def failures(self) -> dict[str, str]:
        """Why there is no model, by the names of the logs."""
        return {row["log"]: row.get("message", "") for row in self.rows if row["exit_code"] != 0}

    def to_pandas(self) -> Any:
        """The rows as a data frame of pandas, with the columns in the order that the command line gives them."""
        import pandas

        return pandas.DataFrame(self.rows, columns=columns(self.rows))

    def to_polars(self) -> Any:
        """The rows as a data frame of Polars, with the columns in the order that the command line gives them."""
        import polars

        names = columns(self.rows)
        return polars.DataFrame({name: [row.get(name) for row in self.rows] for name in names})

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, log: Any) -> Any:
        if isinstance(log, slice):
            return Fits(self.rows[log], self._found[log])
        if isinstance(log, str):
            places = [place for place, row in enumerate(self.rows) if row["log"] == log]
            if not places:
                raise KeyError(log)
            log = places[0]
        found = self._found[log]
        if isinstance(found, Exception):
            raise found
        return found

    def __iter__(self) -> Iterator[Any]:
        """What was found, with None for a log of which nothing was."""
        return (None if isinstance(found, Exception) else found for found in self._found)

    def __repr__(self) -> str:
        return f"Fits({len(self)} logs, {len(self) - len(self.failures)} of them without a failure)"


def fit_many(
    logs: Iterable[Item] | Mapping[str, Item] | str,
    fit: Callable[..., Any] = search,
    *,
    read: Mapping[str, Any] | None = None,
    reports: str | os.PathLike[str] | None = None,
    threads: int | None = None,
    progress: Progress = None,
    **options: Any,
) -> Fits:
    """Fit each of many logs a model of its own.

    A log that fails gets a row with the reason. The results do not depend on the number of threads.

    Parameters
    ----------
    logs : iterable, or dict of names to logs, or str
        Files (paths, URLs of fsspec, or a pattern such as ``"logs/*.csv"``), logs (`Log`), or data frames. A file is called as it
        is, any other log by its name in the dict, or by its place.
    fit : callable, default `search`
        What is done with each log: `arx`, `oe`, `search`, …, `inspect`, or any function of a log that gives a model, a validation or
        an inspection, such as ``lambda log: model.validate(log)``.
    read : dict, optional
        How files are read (the arguments of `read_csv`), or frames (those of `Log.from_dataframe`).
    reports : path or URL, optional
        A folder, which is made, for the document of each. A later call with the same arguments takes from there what is done with
        files that have not changed, and goes on where an earlier one was interrupted, as ``thetahat fit --each --reports`` does:
        ``journal.jsonl`` in it has a digest of each file and of the arguments. Logs in memory and frames are fitted again, and so are all
        where ``fit`` is a function of your own, an argument is more than numbers, texts and lists of them, or the folder is a URL.
    threads : int, optional
        How many threads to use: as many as there are cores, unless said otherwise.
    progress : bool or callable, optional
        True shows how many logs are done, by tqdm if that is installed; a function is called with how many are done, of how many, and None.
    **options
        The arguments of ``fit``.

    Returns
    -------
    Fits

    Raises
    ------
    ValueError
        If the arguments do not make sense, whatever the log; if there is no log, or two have one document.
    OSError
        If the folder cannot be written, or another run is writing it.
    TypeError
        If ``fit`` has no such argument.

    Examples
    --------
    >>> import thetahat as th
    >>> motor = th.dc_motor()
    >>> fits = th.fit_many([motor[:300], motor[300:600], motor[600:]], th.oe, nb=2, nf=2)
    >>> fits.to_pandas()[["log", "model", "dc_gain"]].round(2)
      log        model  dc_gain
    0   0  OE(2, 2, 1)    18.43
    1   1  OE(2, 2, 1)    18.88
    2   2  OE(2, 2, 1)    18.94
    """
    if isinstance(logs, Log):
        raise TypeError("logs: expected several, found a Log; fit_many({'name': log, …}), or one of the fits for a log alone")
    if not callable(fit):
        raise TypeError(f"fit: expected a function such as thetahat.arx, found {_numbers.shown(fit)}")
    named = name_all(logs)
    files = reports_of([name for name, _ in named], named, reports)
    count = _threads(threads)
    work = Work(fit, options, dict(read or {}))
    journal = work.journal(reports)

    stop = _thetahat.Stop()
    done, lock = 0, Lock()

    def one(place: int) -> tuple[dict[str, Any], Any]:
        nonlocal done
        name, item = named[place]
        before = _thetahat.threads(count, stop)
        try:
            return work(name, item, files[place], journal)
        finally:
            _thetahat.threads(*before)
            if tell is not None:
                with lock:
                    done += 1
                    tell(done, len(named), None)

    with ExitStack() as stack:
        tell = stack.enter_context(_progress.shown(progress, "logs"))
        if journal is not None:
            stack.callback(journal.close)
        pool = stack.enter_context(ThreadPoolExecutor(min(count, len(named))))
        # Whatever ends this, and Ctrl-C too: what waits is not begun, and what is under way ends.
        stack.callback(pool.shutdown, wait=False, cancel_futures=True)
        stack.callback(stop.ask)
        futures = [pool.submit(one, place) for place in range(len(named))]
        outcomes = [future.result() for future in futures]
    return Fits([row for row, _ in outcomes], checked([found for _, found in outcomes]))


def checked(found: list[Any]) -> list[Any]:
    """What was found, unless the arguments were wrong whatever the log."""
    if all(isinstance(one, Exception) and _exit_code(one) == 2 for one in found):
        raise found[0].with_traceback(None)
    return found


def columns(rows: Iterable[Mapping[str, Any]]) -> list[str]:
    """The names of all cells: what went wrong in front, the others each once, after the name before it in the first row that has it."""
    names = ["log", "exit_code", "message"]
    known = set(names)
    for row in rows:
        place = 0
        for name in row:
            if name not in known:
                known.add(name)
                names.insert(place, name)
                place += 1
            else:
                place = names.index(name) + 1
    return names


def name_all(logs: Iterable[Item] | Mapping[str, Item] | str) -> list[tuple[str, Item]]:
    """Each log with its name."""
    if isinstance(logs, str):
        logs = sorted(glob.glob(logs, recursive=True)) if glob.has_magic(logs) and not os.path.exists(logs) else [logs]
    elif isinstance(logs, Mapping):
        return _some([(_options.text("logs", name), item) for name, item in logs.items()])
    named = []
    for place, item in enumerate(logs):
        named.append((os.fspath(item) if isinstance(item, (str, os.PathLike)) else str(place), item))
    return _some(named)


def _some(named: list[tuple[str, Item]]) -> list[tuple[str, Item]]:
    if not named:
        raise ValueError("logs: there is none; give at least one, or a pattern that matches some files")
    return named


def reports_of(
    names: Sequence[str], named: Sequence[tuple[str, Item]], reports: str | os.PathLike[str] | None
) -> list[str | None]:
    """Where the document of each goes: the name of a file below the folder that all files share, any other name as it is."""
    if reports is None:
        return [None] * len(names)
    folder = os.fspath(reports).rstrip("/") or "/"
    are_files = all(isinstance(item, (str, os.PathLike)) for _, item in named)
    own = [PurePosixPath(name.replace("\\", "/")) for name in names]
    shared = os.path.commonpath([os.path.join("/", path.parent) for path in own]) if are_files else "/"
    below = [PurePosixPath("/", path).relative_to(shared) if are_files else path for path in own]
    files: list[str | None] = []
    taken: dict[str, str] = {}
    for name, path in zip(names, below):
        file = report_of(folder, path)
        if file in taken:
            raise ValueError(f"logs: the documents of {taken[file]} and {name} would both be {file}; rename one of the logs")
        taken[file] = name
        files.append(file)
    return files


def report_of(folder: str, name: PurePosixPath) -> str:
    """The file of a document in a folder, and never out of it."""
    *folders, own = [part for part in name.parts if part not in ("/", ".", "..")] or ["log"]
    return "/".join([folder, *folders, f"{_ENDINGS.sub('', own) or own}.json"])


def _threads(threads: int | None) -> int:
    if threads is None:
        return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    if isinstance(threads, bool) or not isinstance(threads, int) or threads < 1:
        raise ValueError(f"threads={threads!r}: give a number from 1 on")
    return threads
