"""One model from many pieces of the data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from thetahat import _thetahat
from thetahat.base import numbers as _numbers, said as _said
from thetahat.base.said import EstimationWarning
from thetahat.engine import options as _options
from thetahat.engine.values import Order, Orders
from thetahat.fits.narx import Lags
from thetahat.fits.state_space import states
from thetahat.logs.log import Log, handle
from thetahat.models.model import Model


class NormalEquations:
    """The normal equations of a model that is linear in its parameters: of a piece of the data, to be merged with those of others.

    They are the sums of the products of all regressors, in 32 digits, and hold all that least squares asks of the data. So logs that are
    larger than memory, or spread over machines, give the model that a fit to the whole log would find, in whatever way pieces are
    grouped. They take some kilobytes, whatever the rows, pickle, and do not change.

    Pieces of one log overlap by the `lags` rows that the model reaches back to: these are a piece's `past`. When pieces are merged, in the
    order of time, they are compared with the rows that came before. Experiments have a past of 0. Missing samples, and gaps of the clock,
    are gaps as in any log.

    Of a log with several outputs the model is that of `thetahat.arx` with polynomials of matrices. Its orders may be ranges: the sums are
    the normal equations of each, and the least MDL chooses when they are solved. With ``order`` it is a state-space model, that of
    `thetahat.ss`, of any number of outputs.

    Parameters
    ----------
    log : Log
        The piece: its past, and the rows of its own.
    na : int, default 0
        Coefficients of A: past outputs; with several outputs a range too.
    nb : int, or one for each input, optional
        Coefficients of B. Without it the inputs of the log are left out.
    nk : int, or one for each input, optional
        Samples from input to first effect: 1, and 0 for `taps`.
    past : int, default 0
        How many rows at the front of the piece are of the piece before it: `lags` of them at least, or 0.
    taps : int, or one for each input, optional
        In place of na and nb: how many values the impulse response of a finite one has.
    kernel : {"dc", "tc"} or None, default "dc"
        What is known of that response, see `fir`.
    terms : sequence of str, or int, optional
        In place of na and nb: the products of a nonlinear ARX model with one output, as `thetahat.narx` writes them, such as
        ``["1", "y(k-1)", "y(k-1)*u(k-1)^2"]``; or how many forward regression takes of those with at most ``degree`` factors.
    select : str, optional
        In place of terms: the information criterion that says how many, such as ``"mdl"``.
    degree, most_terms : int, optional
        Of products that are chosen: factors at most, 2 unless it is said, and how many products are evaluated, 40.
    ny, nu : int, optional
        With terms: how many values of the output and of each input these read, 2 unless it is said.
    regressors : sequence of str, optional
        With terms: expressions of the channels that these read too, see `thetahat.NarxOptions`.
    raw_terms : bool, default False
        With terms: whether signals keep their own units; else each is divided by its standard deviation over all pieces.
    order : int, range or "auto", optional
        In place of na and nb: how many states a state-space model has, or among how many the least MDL chooses; ``"auto"`` are 1 to 20.
    weighting, feedthrough : optional
        With order: how the states are found, see `thetahat.ss`.
    horizons : tuple of int or None, optional
        With order: the past samples that the states are made of and the future ones that they tell of, ``past`` and ``future`` of
        `thetahat.ss`.
    couple : {"full", "none", "auto"}, optional
        With several outputs: whether an output depends on the past of all or of its own, see `arx`.
    detrend : {"mean", "none"}, optional
        What is taken from each channel: its mean over all pieces, unless said otherwise.
    offset : dict of str to float, optional
        Offsets of channels that are set by hand.
    constant : {"auto", "yes", "no"}, optional
        Whether the level of the output is estimated too, see `thetahat.FitOptions`.

    Attributes
    ----------
    lags, rows, samples, pieces : int
        How many rows the model reaches back to; the rows of all pieces, without their past; those that have a full regressor; how many
        pieces there are.

    Raises
    ------
    ValueError
        If an argument does not make sense, the past is shorter than `lags` or the whole piece, or squares of the signals leave the range
        of numbers.

    Notes
    -----
    Parameters are exact to 1e-15 + 1e-29 kappa^2 of their size for a condition number kappa of the regressors. O(N p) operations.
    Björck, Numerical Methods for Least Squares Problems, 1996, section 2.2.

    Examples
    --------
    >>> import thetahat as th
    >>> log = th.dc_motor()
    >>> first = th.NormalEquations(log[:400], na=2, nb=2)
    >>> second = th.NormalEquations(log[398:], na=2, nb=2, past=2)
    >>> both = first | second
    >>> both
    NormalEquations(ARX(2, 2, 1), 1000 rows in 2 pieces, inputs u, output y)
    >>> bool(abs(both.solve().parameters - th.arx(log, na=2, nb=2).parameters).max() < 1e-12)
    True
    """

    _sums: _thetahat.NormalEquations

    def __init__(
        self,
        log: Log,
        na: Order | None = None,
        nb: Orders | None = None,
        nk: Orders | None = None,
        *,
        past: int = 0,
        taps: int | Sequence[int] | None = None,
        kernel: str | None = "dc",
        terms: int | Sequence[str] | None = None,
        select: str | None = None,
        degree: int | None = None,
        most_terms: int | None = None,
        ny: Lags | None = None,
        nu: Lags | None = None,
        regressors: Sequence[str] | None = None,
        raw_terms: bool = False,
        order: int | range | str | None = None,
        weighting: str | None = None,
        feedthrough: bool | None = None,
        horizons: tuple[int | None, int | None] | None = None,
        couple: str | None = None,
        detrend: str | None = None,
        offset: Mapping[str, float] | None = None,
        constant: str | None = None,
    ) -> None:
        data = handle("log", log)
        common = {"detrend": detrend, "offset": offset, "constant": constant}
        own: dict[str, Any]
        found: dict[str, Any] = {"weighting": weighting, "feedthrough": feedthrough, "horizons": horizons}
        if order is not None:
            others = {"na": na, "nb": nb, "taps": taps, "terms": terms, "select": select, "couple": couple}
            for name, value in others.items():
                if value is not None:
                    raise ValueError(f"{name}: it is not of state-space models; leave it or the order out")
            back, ahead = both_horizons(horizons)
            own = {**states(order, nk), "weighting": weighting, "past": back, "future": ahead, "feedthrough": feedthrough}
            self._sums = _thetahat.NormalEquations(data, _options.plan({**own, **common}), _past(past))
            return
        for name, value in found.items():
            if value is not None:
                raise ValueError(f"{name}: it is for state-space models; give an order too, or leave it out")
        if terms is not None or select is not None:
            others = {"na": na, "nb": nb, "taps": taps, "couple": couple, "constant": constant}
            for name, value in others.items():
                if value is not None:
                    raise ValueError(f"{name}: it is not of nonlinear models, whose products are named; leave it or the terms out")
            if isinstance(terms, str):
                raise TypeError(f"terms: expected a sequence of str, or an int, found {_numbers.shown(terms)}")
            own = {"narx": "poly", "ny": ny, "nu": nu, "nk": nk, "terms": terms, "select": select, "degree": degree}
            own |= {"most_terms": most_terms, "regressors": regressors, "raw_terms": raw_terms}
            self._sums = _thetahat.NormalEquations(data, _options.plan({**own, **common}), _past(past))
            return
        products: dict[str, Any] = {"ny": ny, "nu": nu, "degree": degree, "most_terms": most_terms, "regressors": regressors}
        products["raw_terms"] = raw_terms or None
        for name, value in products.items():
            if value is not None:
                raise ValueError(f"{name}: it is for products; give terms too, or leave it out")
        several = len(log.outputs) > 1
        if taps is not None and several:
            raise ValueError(f"taps: an impulse response has one output, and the log {len(log.outputs)}; take it with log.select(output=...)")
        if couple is not None and not several:
            raise ValueError("couple: it is for logs with several outputs; leave it out")
        if taps is not None:
            if na is not None or nb is not None:
                raise ValueError("taps: an impulse response has neither na nor nb; leave them out, or give no taps")
            named = "none" if kernel is None else _options.text("kernel", kernel)
            own = {"model": "fir", "taps": taps, "nk": 0 if nk is None else nk, "kernel": named}
        elif na is None and nb is None:
            raise ValueError("na: give the orders na and nb, or taps, terms or an order")
        elif nb is None:
            if nk is not None:
                raise ValueError("nk: it is for inputs; give nb too, or leave it out")
            own = {"model": "arx", "na": na, "nb": 0, "couple": couple} if several else {"model": "ar", "na": na}
        else:
            own = {"model": "arx", "na": 0 if na is None else na, "nb": nb, "nk": 1 if nk is None else nk, "couple": couple}
        self._sums = _thetahat.NormalEquations(data, _options.plan({**own, **common}), _past(past))

    @classmethod
    def _of(cls, sums: _thetahat.NormalEquations) -> NormalEquations:
        made = object.__new__(cls)
        made._sums = sums
        return made

    @classmethod
    def from_json(cls, text: str) -> NormalEquations:
        """Read them back from the document that `to_json` wrote.

        Raises
        ------
        ValueError
            If it is not such a document, with line and column, or was damaged.
        """
        return cls._of(_thetahat.NormalEquations.from_json(_options.text("text", text)))

    def to_json(self) -> str:
        """The document: exact, to the bit."""
        return self._sums.to_json()

    def merge(self, *others: NormalEquations) -> NormalEquations:
        """Those of these pieces and, after them in the order of time, of others. ``a | b`` is the same for two.

        Raises
        ------
        ValueError
            If pieces are of other channels, orders or settings, a piece is given twice, the past of one is not what came before it, or
            the clock goes back.
        """
        for other in others:
            if not isinstance(other, NormalEquations):
                raise TypeError(f"others: expected NormalEquations, found {type(other).__name__}")
        return self._of(self._sums.merged([other._sums for other in others]))

    def solve(self) -> Model:
        """The model, as a fit to all pieces as one log finds it.

        Its report has the figures that need no second pass over the data: the fit one step ahead. Validate it on other rows.

        Raises
        ------
        EstimationError
            If the data cannot determine the parameters, which are named.

        Warns
        -----
        EstimationWarning
            For what a careful reader of the model should know.
        """
        solved = Model._of(self._sums.solve())
        for warning in solved._model.warnings():
            _said.warn(warning, EstimationWarning)
        return solved

    @property
    def lags(self) -> int:
        """How many rows the model reaches back to."""
        return self._sums.lags

    @property
    def rows(self) -> int:
        """The rows of all pieces, without their past."""
        return self._sums.rows

    @property
    def samples(self) -> int:
        """The rows that have a full regressor."""
        return self._sums.samples

    @property
    def pieces(self) -> int:
        """How many pieces there are."""
        return self._sums.pieces

    def __or__(self, other: object) -> NormalEquations:
        return self.merge(other) if isinstance(other, NormalEquations) else NotImplemented

    def __eq__(self, other: object) -> bool:
        return self._sums == other._sums if isinstance(other, NormalEquations) else NotImplemented

    __hash__ = None  # type: ignore[assignment]

    def __reduce__(self) -> tuple[Any, ...]:
        return (NormalEquations.from_json, (self.to_json(),))

    def __copy__(self) -> NormalEquations:
        return self

    def __deepcopy__(self, memo: dict[int, Any]) -> NormalEquations:
        # Nothing can change them.
        return self

    def __repr__(self) -> str:
        channels, first = self._sums.channels, len(self._sums.channels) - self._sums.outputs
        inputs, outputs = channels[:first], channels[first:]
        driven = f"inputs {', '.join(inputs)}" if inputs else "no inputs"
        driven += f", output{'' if len(outputs) == 1 else 's'} {', '.join(outputs)}"
        pieces = f"{self.pieces} piece{'' if self.pieces == 1 else 's'}"
        return f"NormalEquations({self._sums.name()}, {self.rows} rows in {pieces}, {driven})"


def both_horizons(horizons: tuple[int | None, int | None] | None) -> tuple[int | None, int | None]:
    """The past and the future that a subspace method is told."""
    if horizons is None:
        return None, None
    if not isinstance(horizons, (tuple, list)) or len(horizons) != 2:
        raise TypeError(f"horizons: expected two, the past and the future, found {_numbers.shown(horizons)}")
    past, future = (None if one is None else _options.count("horizons", one) for one in horizons)
    return past, future


def _past(past: int) -> int:
    if _options.integer("past", past) < 0:
        raise ValueError(f"past: {past} is below 0")
    return past
