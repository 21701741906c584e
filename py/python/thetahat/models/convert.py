"""Models as other packages write them: transfer functions and state spaces of SciPy and of python-control.

The polynomials of a model are in rising powers of q^-1: B[i] multiplies q^-i, so that B begins with the zeros of its delay. SciPy
and python-control write falling powers of z. For the same transfer function both are padded to one length n + 1,

    (b_0 + b_1 q^-1 + ... + b_n q^-n) / (1 + p_1 q^-1 + ... + p_n q^-n)
        = (b_0 z^n + b_1 z^(n-1) + ... + b_n) / (z^n + p_1 z^(n-1) + ... + p_n),

and n is the smallest that holds both, or the quotient would have a pole and a zero at the origin that cancel.
"""

from __future__ import annotations

import warnings
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    from collections.abc import Sequence


def to_scipy(numerators: Sequence[ArrayLike], denominators: Sequence[ArrayLike], sample_time: float) -> Any:
    """Transfer functions from each input to the output, for ``scipy.signal``.

    SciPy has no transfer functions of several inputs. For these there is a list, one transfer function for each input; their
    outputs add up. SciPy takes leading coefficients below 1e-14 of the numerator for zeros, with a warning: a model in such units
    wants `to_control`.

    Parameters
    ----------
    numerators : sequence of array_like
        B of each input in rising powers of q^-1, its delay as leading zeros.
    denominators : sequence of array_like
        A F of each input, in rising powers of q^-1, beginning with 1.
    sample_time : float
        Seconds from one sample to the next.

    Returns
    -------
    scipy.signal.TransferFunction or list of scipy.signal.TransferFunction
        In discrete time, with ``dt`` the sample time.

    Raises
    ------
    ValueError
        If there is no input.
    ImportError
        If SciPy is not installed.
    """
    quotients = _quotients(numerators, denominators)
    signal = _imported("scipy.signal", "scipy")
    systems = []
    for numerator, denominator in quotients:
        with warnings.catch_warnings():
            if not numerator.any():
                # SciPy takes the zero of an input without effect for a coefficient that vanished.
                warnings.simplefilter("ignore", signal.BadCoefficients)
            systems.append(signal.TransferFunction(numerator, denominator, dt=sample_time))
    return systems[0] if len(systems) == 1 else systems


def to_control(
    numerators: Sequence[ArrayLike],
    denominators: Sequence[ArrayLike],
    sample_time: float,
    input_names: Sequence[str],
    output_name: str,
) -> Any:
    """The transfer function from all inputs to the output, for python-control.

    Where several inputs have poles, python-control needs slycot to simulate it. It simulates the state space without.

    Parameters
    ----------
    numerators : sequence of array_like
        B of each input in rising powers of q^-1, its delay as leading zeros.
    denominators : sequence of array_like
        A F of each input, in rising powers of q^-1, beginning with 1.
    sample_time : float
        Seconds from one sample to the next.
    input_names : sequence of str
        The inputs' names, in the order of the numerators.
    output_name : str
        The output's name.

    Returns
    -------
    control.TransferFunction
        One output, as many inputs as there are, in discrete time with ``dt`` the sample time.

    Raises
    ------
    ValueError
        If there is no input.
    ImportError
        If python-control is not installed.
    """
    quotients = _quotients(numerators, denominators)
    control = _imported("control", "control")
    return control.TransferFunction(
        [[numerator for numerator, _ in quotients]],
        [[denominator for _, denominator in quotients]],
        sample_time,
        inputs=list(input_names),
        outputs=[output_name],
    )


def response_to_control(
    values: NDArray[np.complex128],
    frequencies: ArrayLike,
    sample_time: float,
    input_names: Sequence[str],
    output_name: str,
) -> Any:
    """A measured response from all inputs to the output, for python-control.

    Parameters
    ----------
    values : ndarray, shape (inputs, K)
        The response from each input.
    frequencies : array_like, shape (K,)
        Radians per second.
    sample_time : float
        Seconds from one sample to the next; 0 in continuous time.
    input_names : sequence of str
        The inputs' names.
    output_name : str
        The output's name.

    Returns
    -------
    control.FrequencyResponseData
        With ``dt`` the sample time.

    Raises
    ------
    ValueError
        If an input has no response at one of the frequencies.
    ImportError
        If python-control is not installed.
    """
    if np.isnan(values).any():
        raise ValueError("the inputs have responses at frequencies of their own: take one input at a time")
    control = _imported("control", "control")
    return control.FrequencyResponseData(
        values[np.newaxis], np.asarray(frequencies), dt=sample_time, inputs=list(input_names), outputs=[output_name]
    )


def with_pade(
    matrices: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]], delays: ArrayLike, order: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """A, B, C and D with Padé's approximation of the dead time of each input in front of it.

    e^(-s T) = sum_k c_k (-s T)^k / sum_k c_k (s T)^k, c_k = (2 n - k)! n! / ((2 n)! k! (n - k)!): all-pass, and right to the power
    2 n of s T (Golub and Van Loan, Matrix Computations, 4th ed. 2013, section 9.3.1). In the states of a companion form of s T.

    Parameters
    ----------
    matrices : tuple of ndarray
        A, B, C and D in continuous time.
    delays : array_like, shape (inputs,)
        Seconds.
    order : int
        n.
    """
    a, b, c, d = matrices
    coefficients = np.ones(order + 1)
    for k in range(1, order + 1):
        coefficients[k] = coefficients[k - 1] * (order - k + 1) / ((2 * order - k + 1) * k)
    signs = (-1.0) ** np.arange(order + 1)
    # Monic in falling powers of s T.
    below = coefficients[::-1] / coefficients[-1]
    above = (coefficients * signs)[::-1] / coefficients[-1]
    for place, delay in enumerate(np.asarray(delays, dtype=np.float64)):
        if delay == 0:
            continue
        state = np.zeros((order, order))
        state[0] = -below[1:]
        state[1:, :-1] += np.eye(order - 1)
        state /= delay
        drive = np.zeros((order, 1))
        drive[0] = 1.0 / delay
        seen = (above[1:] - above[0] * below[1:])[np.newaxis]
        moved, acts = b[:, [place]].copy(), d[:, [place]].copy()
        b, d = b.copy(), d.copy()
        b[:, [place]], d[:, [place]] = moved * above[0], acts * above[0]
        a = np.block([[a, moved @ seen], [np.zeros((order, a.shape[0])), state]])
        b = np.vstack([b, np.zeros((order, b.shape[1]))])
        b[-order:, [place]] = drive
        c = np.hstack([c, acts @ seen])
    return a, b, c, d


def state_space_to_scipy(F: ArrayLike, G: ArrayLike, H: ArrayLike, D: ArrayLike, sample_time: float | None) -> Any:
    """A state space from the inputs to the outputs, for ``scipy.signal``.

    Parameters
    ----------
    F, G, H, D : array_like of two dimensions
        x(t+1) = F x(t) + G u(t), y(t) = H x(t) + D u(t). SciPy calls them A, B, C and D.
    sample_time : float or None
        Seconds from one sample to the next; None in continuous time.

    Returns
    -------
    scipy.signal.StateSpace
        With ``dt`` the sample time, in continuous time without.

    Raises
    ------
    ValueError
        If there is no input.
    ImportError
        If SciPy is not installed.
    """
    matrices = _matrices(F, G, H, D)
    clock = {} if sample_time is None else {"dt": sample_time}
    return _imported("scipy.signal", "scipy").StateSpace(*matrices, **clock)


def state_space_to_control(
    F: ArrayLike,
    G: ArrayLike,
    H: ArrayLike,
    D: ArrayLike,
    sample_time: float | None,
    input_names: Sequence[str],
    output_names: Sequence[str],
) -> Any:
    """A state space from the inputs to the outputs, for python-control.

    Parameters
    ----------
    F, G, H, D : array_like of two dimensions
        x(t+1) = F x(t) + G u(t), y(t) = H x(t) + D u(t). python-control calls them A, B, C and D.
    sample_time : float or None
        Seconds from one sample to the next; None in continuous time.
    input_names : sequence of str
        The inputs' names, in the order of the columns of G.
    output_names : sequence of str
        The outputs' names, in the order of the rows of H.

    Returns
    -------
    control.StateSpace
        With ``dt`` the sample time, in continuous time 0. A state that nothing reaches stays.

    Raises
    ------
    ValueError
        If there is no input.
    ImportError
        If python-control is not installed.
    """
    matrices = _matrices(F, G, H, D)
    return _imported("control", "control").StateSpace(
        *matrices,
        0 if sample_time is None else sample_time,
        inputs=list(input_names),
        outputs=list(output_names),
        # Whatever the user's defaults are: the states are those of the model.
        remove_useless_states=False,
    )


def _quotients(
    numerators: Sequence[ArrayLike], denominators: Sequence[ArrayLike]
) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    if len(numerators) == 0:
        raise ValueError(_NO_INPUTS)
    if len(numerators) != len(denominators):
        message = (
            f"there are {len(numerators)} numerators and {len(denominators)} denominators; "
            "give one of each for every input"
        )
        raise ValueError(message)
    return [_falling(*pair) for pair in zip(numerators, denominators)]


def _falling(numerator: ArrayLike, denominator: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A quotient in falling powers of z, from one in rising powers of q^-1."""
    rising = [np.atleast_1d(np.asarray(p, dtype=np.float64)) for p in (numerator, denominator)]
    if not rising[0].any():
        # No effect: the poles of the denominator are not those of this input.
        return np.zeros(1), np.ones(1)
    length = max(int(np.flatnonzero(p)[-1]) + 1 for p in rising)
    top, bottom = (np.append(p[:length], np.zeros(max(length - p.size, 0))) for p in rising)
    # A delay leaves zeros in front of the numerator: no powers of z. SciPy warns of them.
    return top[np.flatnonzero(top)[0] :], bottom


def _matrices(F: ArrayLike, G: ArrayLike, H: ArrayLike, D: ArrayLike) -> tuple[NDArray[np.float64], ...]:
    matrices = tuple(np.asarray(matrix, dtype=np.float64) for matrix in (F, G, H, D))
    if matrices[3].shape[-1] == 0:
        raise ValueError(_NO_INPUTS)
    return matrices


_NO_INPUTS = "the model has no inputs, so there is no response to one; its noise is in to_state_space(), as the gain K"


def _imported(name: str, extra: str) -> Any:
    try:
        return import_module(name)
    except ImportError as error:
        message = f"this needs {name}, which cannot be imported ({error}): pip install thetahat[{extra}]"
        raise ImportError(message) from error
