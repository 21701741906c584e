"""Logs that are in files."""

from __future__ import annotations

import io
import os
from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np

from thetahat import _thetahat
from thetahat.base import said as _said
from thetahat.base.clock import Clock, labels_from
from thetahat.engine import options as _options
from thetahat.engine.options import ReadOptions
from thetahat.engine.values import Duration, Resample
from thetahat.logs.log import Log, names_of


@_options.takes()
def read_csv(
    path: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    *,
    inputs: Sequence[str] | str | None = None,
    output: str | Sequence[str] | None = None,
    time: str | None = None,
    sample_time: Duration | None = None,
    resample: Resample | None = None,
    uniform: bool = True,
    time_format: str | None = None,
    time_unit: Literal["ns", "us", "ms", "s", "min", "h", "d"] | None = None,
    time_zone: str | None = None,
    delimiter: str | None = None,
    comment: str | None = None,
    encoding: str | None = None,
    sheet: str | None = None,
    decimal_comma: bool | None = None,
    header: bool | int = True,
    skip_rows: int | None = None,
    missing: str | Sequence[str] | None = None,
    values: Mapping[str, float] | None = None,
) -> Log:
    """Read a log from a CSV file, as the command line does.

    Parameters
    ----------
    path : str or path, or a sequence of them
        The file, gzip-compressed or not. Several files are several experiments with one plant.
    inputs : sequence of str, or str, optional
        The columns that are inputs: those called u, u1, u2, …, unless said otherwise. An empty one makes a time series.
    output : str or sequence of str, optional
        The column that is the output, or those that are: y, unless said otherwise.
    uniform : bool, default True
        Whether the steps of the clock have to be even. Models in equations take any.
    time, sample_time, resample, time_format, time_unit, time_zone
        The clock of the file, see `thetahat.ReadOptions`.
    delimiter, comment, encoding, sheet, decimal_comma, header, skip_rows, missing, values
        How it is written, see `thetahat.ReadOptions`.

    Returns
    -------
    Log

    Raises
    ------
    OSError
        If the file cannot be read.
    ValueError
        If it is no table, a column is not there, or a field is no number: with file, line and column.

    Warns
    -----
    UserWarning
        For what may be meant otherwise, such as a line that is read as units.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> import thetahat as th
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "log.csv")
    ...     _ = path.write_text("t,u,y\\n0,1,0\\n0.5,1,0.5\\n1,1,0.75\\n")
    ...     log = th.read_csv(path, time="t")
    >>> log
    Log(3 rows, inputs u, output y, sample time 0.5 s by column 't')

    See Also
    --------
    read_log : A log in a file of any format.
    """
    return _read(path, inputs, output, locals(), uniform=uniform)


@_options.takes()
def read_log(
    path: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    *,
    inputs: Sequence[str] | str | None = None,
    output: str | Sequence[str] | None = None,
    time: str | None = None,
    sample_time: Duration | None = None,
    resample: Resample | None = None,
    uniform: bool = True,
) -> Log:
    """Read a log from a Parquet or an Arrow file, from the log of a flight or of a robot, or from CSV, as the command line does.

    The format is known by the first bytes. Of Parquet and Arrow only the columns that are named are unpacked, batch by batch: memory
    does not hold the file.

    Parameters
    ----------
    path : str or path, or a sequence of them
        The file: Parquet, an Arrow file or stream (IPC, Feather 2), a ULog, a DataFlash log, a data log of WPILib, a MATLAB file, or CSV,
        gzip-compressed or not. Several files are several experiments with one plant.
    inputs : sequence of str, or str, optional
        The columns that are inputs: those called u, u1, u2, …, unless said otherwise. An empty one makes a time series.
    output : str or sequence of str, optional
        The column that is the output, or those that are: y, unless said otherwise.
    time : str, optional
        The column that holds the times: instants, dates or durations, numbers, or texts of dates. Without it the one column that is a
        clock.
    sample_time, resample
        As for `Log`. Columns of several topics (``topic.field``, see `topics`) are put on one clock by `resample`; without it on that of
        the fastest, where channels that move in steps are held and the others read from straight lines.
    uniform : bool, default True
        Whether the steps of the clock have to be even. Models in equations take any.

    Returns
    -------
    Log

    Raises
    ------
    OSError
        If the file cannot be read.
    ValueError
        If it is damaged, a column is not there or holds no numbers, or a value is infinite: with file, column and row.

    Warns
    -----
    UserWarning
        For whole numbers beyond 2^53, which are rounded.

    See Also
    --------
    read_csv : With the options of text.
    topics : What there is in the log of a flight or of a robot.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> import polars as pl
    >>> import thetahat as th
    >>> frame = pl.DataFrame({"u": [1, 1, 1], "y": [0.0, 0.5, 0.75], "when": [0, 500, 1000]})
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "log.parquet")
    ...     frame.with_columns(pl.col("when").cast(pl.Datetime("ms"))).write_parquet(path)
    ...     log = th.read_log(path, time="when")
    >>> log
    Log(3 rows, inputs u, output y, sample time 0.5 s by column 'when' from 1970-01-01T00:00:00)
    """
    return _read(path, inputs, output, locals(), uniform=uniform)


def _read(
    path: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    inputs: Sequence[str] | str | None,
    output: str | Sequence[str] | None,
    options: Mapping[str, Any],
    *,
    uniform: bool,
) -> Log:
    """A log from files, read with those of `ReadOptions` that are there."""
    outputs = None if output is None else names_of("output", output)
    if outputs is not None and len(outputs) > 1:
        # Read as inputs, they get their role afterwards.
        chosen = [] if inputs is None else names_of("inputs", inputs)
        words = [*_options.channels([*chosen, *outputs[:-1]], outputs[-1])]
    else:
        words = [*_options.channels(inputs, None if outputs is None else outputs[0])]
    words += _options.words(options)
    paths: list[Any] = list(path) if isinstance(path, (list, tuple)) else [path]
    if not paths:
        raise ValueError("path: there is none; give at least one")
    if inputs is not None and not isinstance(inputs, str) and not inputs and (outputs is None or len(outputs) == 1):
        # The command line reads no inputs for a model without them.
        words += ["--na=1", "--nb=0"]
    log, notes = _thetahat.Log.read([*words, "--", *map(_options.path_text, paths)], uniform)
    if outputs is not None and len(outputs) > 1:
        log = log.select([] if inputs is None else names_of("inputs", inputs), outputs)
    for note in notes:
        _said.warn(note)
    time, start = log.clock
    said = "assumed" if time is None and options.get("sample_time") is None else "" if time is None else f"by column {time!r}"
    said = said if options.get("resample") is None else f"{said}, resampled"
    # Several logs have no common start.
    seconds = None if log.boundaries else log.time()
    times = None if start is None or seconds is None else labels_from(start, seconds, time)
    return Log._of(log, Clock(said, times, column=True))


def dc_motor() -> Log:
    """The log of a DC motor that comes with the package: 1000 rows, voltage in, speed out, 0.01 s apart.

    Examples
    --------
    >>> import thetahat as th
    >>> th.dc_motor()
    Log(1000 rows, inputs u, output y, sample time 0.01 s)
    """
    table = np.loadtxt(io.StringIO(_thetahat.DEMO_LOG), delimiter=",", skiprows=1)
    return Log(table[:, 2], table[:, 1], time=table[:, 0])
