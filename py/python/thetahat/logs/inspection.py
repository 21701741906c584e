"""Checks of a log before a fit."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from thetahat import _thetahat
from thetahat.base.tables import Table, columns
from thetahat.engine import options as _options
from thetahat.engine.document import Document
from thetahat.engine.options import ReadOptions
from thetahat.engine.values import Duration, Resample
from thetahat.logs.log import Log


@dataclass(frozen=True)
class Finding:
    """What was found in a log that a careful reader should know. Its ``str`` is the sentence that the command line prints.

    Attributes
    ----------
    kind : str
        What kind of thing it is, such as ``"gaps"``, ``"outliers"``, ``"stuck"``, ``"feedback"`` or ``"trend"``.
    channels : list of str
        The channels that it is about; none where it is the whole log.
    rows : list of (int, int)
        The rows where it is seen, as (first, last) counted from 1, the first 20 ranges; none where it is all rows.
    seen : str
        The evidence, with its figures.
    advice : str or None
        What it means, or what to do about it.

    Examples
    --------
    >>> import numpy as np
    >>> import thetahat as th
    >>> y = np.sin(0.1 * np.arange(200.0) ** 2)
    >>> y[120] = 50.0
    >>> found = th.inspect(th.Log(y=y, sample_time=1.0)).findings[0]
    >>> found.kind, found.channels, found.rows
    ('outliers', ['y'], [(121, 121)])
    >>> print(found)
    channel 'y' has values far from their neighbours at row 121: a fit without orders takes them for missing; where they are wrong, empty their fields, or fit with norm 1
    """

    kind: str
    channels: list[str]
    rows: list[tuple[int, int]]
    seen: str
    advice: str | None

    def __str__(self) -> str:
        return self.seen if self.advice is None else f"{self.seen}: {self.advice}"


class Inspection(Document, Table):
    """The checks of a log before a fit: the document of ``thetahat inspect``. As a frame it has a row for each channel.

    Examples
    --------
    >>> import thetahat as th
    >>> inspection = th.inspect(th.dc_motor())
    >>> inspection.delays, inspection.feedback
    ({'u': 1}, {'u': False})
    """

    @property
    def findings(self) -> list[Finding]:
        """What a careful reader should know: what was seen, in which channels and rows, and what to do."""

        def of(found: dict[str, Any]) -> Finding:
            advice = found.get("advice")
            return Finding(
                found["kind"],
                found.get("channels", []),
                [(first, last) for first, last in found.get("rows", [])],
                _thetahat.in_python(found["seen"]),
                None if advice is None else _thetahat.in_python(advice),
            )

        return [of(found) for found in self.document["findings"]]

    @property
    def warnings(self) -> list[str]:
        """The findings in plain words, each in a sentence."""
        return [str(finding) for finding in self.findings]

    @property
    def delays(self) -> dict[str, int | None]:
        """The delay of each input in samples, as a fit without orders takes it; None where no effect is seen."""
        return {delay["input"]: delay["nk"] for delay in self.document["delays"]}

    @property
    def confidence(self) -> dict[str, float | None]:
        """How sure each delay is: its posterior probability among all that were compared."""
        return {delay["input"]: delay["confidence"] for delay in self.document["delays"]}

    @property
    def feedback(self) -> dict[str, bool]:
        """Whether feedback from the output to each input is suspected."""
        return {one["input"]: one["found"] for one in self.document["feedback"]}

    @property
    def excitation(self) -> dict[str, int]:
        """How many parameters each input can determine at most: its order of persistence."""
        return {one["input"]: one["order"] for one in self.document["excitation"]}

    @property
    def command(self) -> str | None:
        """The line of ``thetahat fit`` that goes with the file, if it was one."""
        return self.document.get("command")

    _index = "channel"

    def _columns(self) -> dict[str, list[Any]]:
        figures = ("missing", "minimum", "maximum", "mean", "standard_deviation", "outlier_count")

        def row(channel: dict[str, Any]) -> dict[str, Any]:
            name = channel["name"]
            own = {"channel": name, "role": channel["role"], **{figure: channel[figure] for figure in figures}}
            of_input: dict[str, dict[str, Any]] = {
                "delay": self.delays,
                "confidence": self.confidence,
                "feedback": self.feedback,
                "excitation": self.excitation,
            }
            return {**own, **{figure: of.get(name) for figure, of in of_input.items()}}

        return columns([row(channel) for channel in self.document["channels"]])

    def __repr__(self) -> str:
        count = len(self.warnings)
        return f"Inspection({self.document['rows']} rows, {count} warning{'' if count == 1 else 's'})"


@_options.takes()
def inspect(
    log: Log | str | os.PathLike[str],
    *,
    inputs: Sequence[str] | str | None = None,
    output: str | None = None,
    time: str | None = None,
    sample_time: Duration | None = None,
    resample: Resample | None = None,
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
) -> Inspection:
    """Check a log before a fit: its clock, the quality of its channels, excitation, delays and feedback.

    Parameters
    ----------
    log : Log, or path
        The data, or a CSV file, whose clock may be irregular.
    inputs, output
        The columns of a file that are inputs and output; without names all columns of numbers are inspected.
    time, sample_time, resample, time_format, time_unit, time_zone
        The clock of a file, see `thetahat.ReadOptions`.
    delimiter, comment, encoding, sheet, decimal_comma, header, skip_rows, missing, values
        How it is written, see `thetahat.ReadOptions`.

    Returns
    -------
    Inspection

    Examples
    --------
    >>> import thetahat as th
    >>> th.inspect(th.dc_motor())
    Inspection(1000 rows, 0 warnings)
    """
    words = _options.words(locals())
    if isinstance(log, Log):
        if words or inputs is not None or output is not None:
            raise TypeError("inputs, output and how to read are for files; a Log has its own")
        return Inspection(*_thetahat.inspect(log._log))
    words += _options.channels(inputs, output)
    return Inspection(*_thetahat.inspect_file([*words, "--", _options.path_text(log)]))
