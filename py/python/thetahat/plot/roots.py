"""Pictures of the poles and zeros of linear models. `thetahat.plot` has them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import log as ln
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Ellipse

from thetahat.engine import options as _options
from thetahat.models.model import Model
from thetahat.plot import drawing as _drawing

_FARTHEST = 3.0
"""Roots farther out than this are named and not shown: they would make a dot of the unit circle. In continuous time as
many times the magnitude of the largest pole."""


class _Roots(NamedTuple):
    """Some roots of one name."""

    name: str
    marker: str
    places: npt.NDArray[np.complex128]
    regions: Sequence[Mapping[str, Any]] = ()
    """The roots as the document has them, where it has their covariance."""


def poles_zeros(model: Model, ax: Axes | None = None, *, output: int | str | None = None, level: float = 0.95) -> Axes:
    """The poles and zeros of a linear model: in the z plane with the unit circle, in continuous time in the s plane.

    Poles decay inside of the circle, or left of the imaginary axis, which is shaded; outside they grow. The nearer to the
    edge, the more slowly. Complex roots have ellipses and real ones intervals that hold the root with the probability
    ``level``, to first order, where the covariance of the root is known.

    Parameters
    ----------
    model : Model
        What to draw. Of several outputs the zeros are the transmission zeros, at which some combination of the inputs
        does not reach the outputs.
    ax : Axes, optional
        Where to draw.
    output : int or str, optional
        The zeros from each input to this one of several outputs instead, by its position or its name.
    level : float, default 0.95
        The probability.

    Returns
    -------
    Axes

    Raises
    ------
    ValueError
        If the model is not linear.

    Notes
    -----
    A root with the covariance S of its real and imaginary part lies, with the probability p, where d' S^-1 d is below
    the quantile of chi-square for two degrees of freedom, -2 ln(1 - p). Roots near to one another have no S: there the
    first order does not hold.

    Transmission zeros are the finite generalised eigenvalues of ([F G; H D], [I 0; 0 0]). Where there are not as many
    outputs as inputs, they are those that two random combinations of the more numerous ones share.

    References
    ----------
    Davison and Wang, Properties and calculation of transmission zeros of linear multivariable systems, Automatica 10,
    1974.

    Examples
    --------
    >>> import thetahat as th
    >>> from thetahat import plot
    >>> ax = plot.poles_zeros(th.armax(th.dc_motor(), na=2, nb=2, nc=1))
    >>> [text.get_text() for text in ax.get_legend().get_texts()]
    ['poles', 'zeros from u', 'noise zeros']
    """
    _drawing.expect("model", model, Model)
    half = _options.quantile(level)
    groups = _groups(model, output)
    ax = _drawing.one(ax)
    continuous = model.kind in ("process", "continuous-state-space")
    ax.axhline(0, color="0.85", linewidth=0.8, zorder=0)
    ax.axvline(0, color="0.6" if continuous else "0.85", linewidth=0.8, zorder=0)
    farthest = _FARTHEST
    if continuous:
        poles = [float(size) for size in np.abs(groups[0].places) if size > 0]
        nearest = [float(size) for group in groups for size in np.abs(group.places) if size > 0]
        farthest *= max(poles) if poles else min(nearest, default=1.0)
    reach = 0.0 if continuous else 1.0
    right = above = 0.0
    for group in groups:
        if group.places.size == 0:
            continue
        near = np.abs(group.places) <= farthest
        away = ", ".join(f"{place:.4g}" if place.imag else f"{place.real:.4g}" for place in group.places[~near])
        label = f"{group.name}, outside of the picture: {away}" if away else group.name
        (line,) = ax.plot(
            group.places.real, group.places.imag, group.marker, fillstyle="none", label=_drawing.shown(label), zorder=3
        )
        seen = group.places[near]
        reach = float(np.max([np.abs(seen.real), np.abs(seen.imag)], initial=reach))
        right, above = float(np.max(seen.real, initial=right)), float(np.max(seen.imag, initial=above))
        for root in group.regions:
            _region(ax, root, half, level, line.get_color())
    if continuous:
        reach = reach or 1.0
        ax.set_xlim(-1.15 * reach, max(0.3 * reach, 1.15 * right))
        ax.set_ylim(-max(1.15 * above, 0.6 * reach), max(1.15 * above, 0.6 * reach))
        # Left of it is stable.
        ax.axvspan(-1.15 * reach, 0, color="0.95", zorder=-1)
        ax.set_xlabel("real part [1/s]")
        ax.set_ylabel("imaginary part [rad/s]")
    else:
        ax.add_patch(Circle((0, 0), 1, fill=False, color="0.6", linewidth=0.8))
        ax.set_xlim(-1.15 * reach, 1.15 * reach)
        ax.set_ylim(-1.15 * reach, 1.15 * reach)
        ax.set_xlabel("real part")
        ax.set_ylabel("imaginary part")
    ax.set_aspect("equal")
    _drawing.legend(ax)
    return ax


def _groups(model: Model, output: int | str | None) -> list[_Roots]:
    """The roots to draw, the poles first."""
    if model.kind in ("equations", "nonlinear-arx"):
        raise ValueError(
            f"model: poles and zeros are of linear models, and this one is {model.name}; plot.fit draws what it predicts, "
            "and plot.residuals what it leaves"
        )
    if output is not None:
        model._output(output)
    if model.kind == "polynomial":
        own = model._own
        named = [("poles", "x", own["poles"])]
        named += [(f"zeros from {name}", "o", roots) for name, roots in zip(model.inputs, own["zeros"])]
        named += [("noise poles", "+", own["noise_poles"]), ("noise zeros", "D", own["noise_zeros"])]
        return [_Roots(name, marker, _places(roots), roots) for name, marker, roots in named]
    poles = model._polynomial("poles")
    groups = [_Roots("poles", "x", _places(poles), poles)]
    if len(model.outputs) > 1 and output is None:
        return [*groups, _Roots("transmission zeros", "o", _transmission_zeros(*_matrices(model)))]
    zeros = [_Roots(f"zeros from {name}", "o", model.zeros(name, output=output)) for name in model.inputs]
    return groups + zeros


def _places(roots: Sequence[Mapping[str, Any]]) -> npt.NDArray[np.complex128]:
    return np.array([complex(root["re"], root["im"]) for root in roots], dtype=np.complex128)


def _matrices(model: Model) -> tuple[_drawing.Array, ...]:
    """Those from the inputs to the outputs, without dead times, which have no zeros."""
    if model.kind == "state-space":
        form = model.to_state_space()
        return form.F, form.G, form.H, form.D
    return model._matrices_in_seconds()


def _transmission_zeros(
    F: _drawing.Array, G: _drawing.Array, H: _drawing.Array, D: _drawing.Array
) -> npt.NDArray[np.complex128]:
    """The values z at which [F - z I, G; H, D] loses rank."""
    outputs, inputs = D.shape
    if min(D.shape) == 0 or len(F) == 0:
        return np.empty(0, dtype=np.complex128)
    size, rows, columns = (float(np.linalg.norm(matrix)) or 1.0 for matrix in (F, G, H))
    G, H, D = G * (size / rows), H * (size / columns), D * (size * size / rows / columns)
    random = np.random.default_rng(0)
    found = []
    # Zeros at infinity are near it by rounding, elsewhere each time; finite ones stay where they are.
    for shift in (size * (0.75 + 0.57j), size * (-0.67 + 0.43j)):
        mix = np.eye(outputs) if outputs == inputs else random.standard_normal((inputs, outputs))
        if outputs < inputs:
            found.append(_square_zeros(F, G @ mix, H, D @ mix, shift))
        else:
            found.append(_square_zeros(F, G, mix @ H, mix @ D, shift))
    first, second = found
    shared = [z for z in first if second.size and np.min(np.abs(second - z)) <= 1e-6 * max(size, abs(z))]
    return np.array(shared, dtype=np.complex128)


def _square_zeros(
    F: _drawing.Array, G: _drawing.Array, H: _drawing.Array, D: _drawing.Array, shift: complex
) -> npt.NDArray[np.complex128]:
    """Those of as many outputs as inputs: z = s + 1/mu of the eigenvalues mu of (M - s N)^-1 N, where mu = 0 is a zero at
    infinity."""
    system = np.block([[F, G], [H, D]])
    states = np.diag([1.0] * len(F) + [0.0] * len(D))
    try:
        inverse = np.linalg.eigvals(np.linalg.solve(system - shift * states, states.astype(np.complex128)))
    except np.linalg.LinAlgError:
        # Some combination of the inputs reaches no output at any frequency.
        return np.empty(0, dtype=np.complex128)
    zeros = shift + 1 / inverse[np.abs(inverse * shift) > 1e-12]
    real = np.abs(zeros.imag) <= 1e-7 * (np.abs(zeros) + abs(shift))
    return np.asarray(np.where(real, zeros.real + 0j, zeros), dtype=np.complex128)


def _region(ax: Axes, root: Mapping[str, Any], half: float, level: float, colour: Any) -> None:
    """Where a root lies with this probability: an ellipse, of a real root an interval."""
    if root["covariance"] is None:
        return
    covariance = np.array(root["covariance"], dtype=np.float64)
    if not np.isfinite(covariance).all():
        return
    if covariance[1, 1] == 0:
        spread = half * float(np.sqrt(covariance[0, 0]))
        ax.plot([root["re"] - spread, root["re"] + spread], [root["im"]] * 2, color=colour, linewidth=1.2)
        return
    variances, directions = np.linalg.eigh(covariance)
    width, height = 2 * np.sqrt(-2 * ln(1 - level) * np.maximum(variances, 0))
    angle = float(np.degrees(np.arctan2(directions[1, 0], directions[0, 0])))
    ax.add_patch(Ellipse((root["re"], root["im"]), width, height, angle=angle, fill=False, color=colour))
