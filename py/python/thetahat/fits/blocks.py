"""Models in blocks: linear systems and static curves."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal

from thetahat.engine import options as _options, progress as _progress
from thetahat.engine.option_types import BlocksOptions
from thetahat.engine.progress import Progress
from thetahat.fits.fit import fitted
from thetahat.logs.log import Log
from thetahat.models.model import Model

if TYPE_CHECKING:
    from typing_extensions import Unpack

Structure = Literal["hammerstein", "wiener", "wiener-hammerstein", "wh", "feedback", "lfr"]
"""How linear systems and curves follow one another."""


@_options.takes(BlocksOptions)
def blocks(
    log: Log,
    structure: Structure = "hammerstein",
    *,
    order: int | range | None = None,
    nk: int | Sequence[int] | None = None,
    progress: Progress = None,
    **options: Unpack[BlocksOptions],
) -> Model:
    """Fit linear systems and static curves that follow one another, for the least errors of the free run.

    Parameters
    ----------
    log : Log
        The data, with one output and one or more inputs.
    structure : {"hammerstein", "wiener", "wiener-hammerstein", "feedback"}
        A curve of each input before the linear system, as of a valve; a curve after it, as of a sensor; a curve between two linear systems
        (also ``"wh"``); or a linear system around a curve, as of a spring that stiffens (also ``"lfr"``).
    order : int or range, optional
        States of the linear systems, or a range from which the least MDL is chosen: 1 to 3 unless it is said, 2 to 4 of two systems.
    nk : int, or one for each input, optional
        Samples from input to first effect; those with the least MDL unless they are said.
    progress : bool or callable, optional
        True shows how far it is, by tqdm if that is installed; a function is called with how many iterations are done, of how many, where
        that is known, and the least cost so far.
    curve, knots, degree, search, max_iterations, tolerance, step, starts, seed, time_limit, profile, estimate, validate, split
        Which form curves have, what to fit to and how, see `thetahat.BlocksOptions`.

    Returns
    -------
    Model
        A model in equations: `Model.kind` is ``"equations"``. Its parameters are those of the systems and the values of the curves.

    Raises
    ------
    EstimationError
        If a channel does not move, no linear model follows the output, or the log leaves a parameter open.
    ValueError
        If an argument does not make sense.

    Warns
    -----
    EstimationWarning
        For what a careful reader of the model should know.

    Examples
    --------
    A valve that opens from 3 on, and a lag after it:

    >>> import numpy as np
    >>> import thetahat as th
    >>> rng = np.random.default_rng(0)
    >>> valve = np.repeat(rng.integers(0, 11, 150), 5).astype(float)
    >>> level = np.zeros(750)
    >>> for k in range(1, 750):
    ...     level[k] = 0.8 * level[k - 1] + 0.2 * max(valve[k - 1] - 3, 0)
    >>> level += 0.01 * rng.standard_normal(750)
    >>> model = th.blocks(th.Log(level, valve, sample_time=1), "hammerstein", order=1)
    >>> values = dict(zip(model.parameter_names, model.parameters))
    >>> round(float(values["f1"]), 2)
    -0.8
    """
    _options.text("structure", structure)
    with _progress.told(progress, "blocks"):
        return fitted(log, {"blocks": structure, "order": order, "nk": nk}, options)
