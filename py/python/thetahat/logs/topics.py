"""Logs of flights and robots: topics, each with a clock of its own."""

from __future__ import annotations

import json
import os
from typing import NamedTuple

from thetahat import _thetahat
from thetahat.engine import options as _options


class Topic(NamedTuple):
    """A topic of a log, see `topics`.

    Attributes
    ----------
    name : str
        Its name.
    rows : int
        How many messages it has.
    rate : float or None
        How many messages a second on average; None for a single one.
    duration : float
        Seconds from the first message to the last.
    columns : tuple of str
        The names of its columns, as `read_log` takes them.
    """

    name: str
    rows: int
    rate: float | None
    duration: float
    columns: tuple[str, ...]


def topics(path: str | os.PathLike[str]) -> list[Topic]:
    """List the topics of a log of a flight or of a robot, in the order of the log.

    The log is a ULog (PX4), a DataFlash log (ArduPilot) or a data log of WPILib, gzip-compressed or not. `read_log` reads columns of
    one topic or of several, which are then put on one clock.

    Parameters
    ----------
    path : str or path
        The file.

    Returns
    -------
    list of Topic

    Raises
    ------
    OSError
        If the file cannot be read.
    ValueError
        If it has no topics, or is damaged.

    See Also
    --------
    read_log : A log of some of their columns.
    """
    document = json.loads(_thetahat.topics(["--", _options.path_text(path)]))
    return [
        Topic(topic["name"], topic["rows"], topic["rate"], topic["duration"], tuple(topic["columns"]))
        for topic in document["topics"]
    ]
