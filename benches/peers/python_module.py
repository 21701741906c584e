"""Does the same work with the Python module of thetahat and with other Python packages, by turns, and prints the ratios of
their times.

Usage: python_module.py, in an environment that has the module; `run` calls it. It fails on estimates that disagree, not on a
ratio that is missed.
"""

import os
import platform
import timeit
import warnings
from importlib.metadata import version

import ctrlsys
import numpy
import padasip
import pandas
import thetahat
from compare import check, print_table, processor, verdict
from filterpy.kalman import KalmanFilter
from nfoursid.nfoursid import NFourSID
from scipy.signal import coherence, csd, lfilter, welch
from sippy_unipi import system_identification
from statsmodels.tsa.statespace.sarimax import SARIMAX
from sysidentpy.basis_function import Polynomial
from sysidentpy.model_structure_selection import FROLS
from sysidentpy.parameter_estimation import LeastSquares

PACKAGES = ["thetahat", "NumPy", "SciPy", "padasip", "filterpy", "sippy-unipi", "nfoursid", "ctrlsys", "sysidentpy", "statsmodels"]


def main():
    """All rows."""
    warnings.simplefilter("ignore")
    numpy.random.seed(0)
    print(*(f"{name} {version(name)}" for name in PACKAGES), f"Python {platform.python_version()}", sep=", ")
    print(f"{processor()}, {os.cpu_count()} processors", end="\n\n", flush=True)
    rows = [["work", "peer", "thetahat", "peer's", "ratio", "required", "verdict"]]
    rows += [recursive(), kalman(), *fits(), *states(), *nonlinear(), *seasonal(), *spectra(), *calls()]
    print_table(rows)


def least(work, rounds):
    """The least time of some rounds, in seconds, and the last result."""
    best, result = float("inf"), None
    for _ in range(rounds):
        begin = timeit.default_timer()
        result = work()
        best = min(best, timeit.default_timer() - begin)
    return best, result


def by_turns(ours, theirs, rounds, seldom=1):
    """The least times of both, theirs in every few rounds, and the results."""
    mine, yours = [], []
    for turn in range(rounds):
        mine.append(least(ours, 1))
        if turn % seldom == 0:
            yours.append(least(theirs, 1))
    return min(time for time, _ in mine), min(time for time, _ in yours), mine[-1][1], yours[-1][1]


def row(work, peer, ours, theirs, required):
    """A row of the table."""
    ratio = theirs / ours
    cells = [f"at least {required}", verdict(ratio >= required)] if required else ["", ""]
    return [work, peer, shown(ours), shown(theirs), f"{ratio:,.0f}", *cells]


def shown(seconds):
    """A time in a unit that suits it."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6)):
        if seconds >= size:
            break
    return f"{seconds / size:,.2f} {unit}"


def recursive():
    """Recursive least squares, a whole array at once."""
    samples, size = 20_000, 8
    regressors = numpy.random.standard_normal((samples, size))
    theta = numpy.arange(1.0, size + 1)
    outputs = regressors @ theta + 0.1 * numpy.random.standard_normal(samples)

    def ours():
        return thetahat.RecursiveLeastSquares(size, forgetting=0.99).run(regressors, outputs).parameters[-1].copy()

    def theirs():
        peer = padasip.filters.FilterRLS(n=size, mu=0.99, w="zeros")
        peer.run(outputs, regressors)
        return peer.w

    mine, yours, found, expected = by_turns(ours, theirs, 30, 10)
    check("padasip", found, expected)
    return row("recursive least squares, 8 parameters, 20,000 samples", "padasip FilterRLS", mine, yours, 100)


def kalman():
    """A Kalman filter of 4 states and 2 measurements, a whole array at once."""
    samples, step = 20_000, 0.1
    move = numpy.eye(4) + step * numpy.eye(4, k=2)
    noise = 0.01 * numpy.eye(4)
    look = numpy.eye(2, 4)
    error = 0.5 * numpy.eye(2)
    measured = numpy.cumsum(numpy.random.standard_normal((samples, 2)), axis=0)
    transition = thetahat.LinearTransition(move, noise)
    observation = thetahat.LinearObservation(look, error)

    def ours():
        kalman = thetahat.KalmanFilter(numpy.zeros(4), numpy.eye(4))
        return kalman.run(transition, observation, measured).filtered_states[-1].copy()

    def theirs():
        peer = KalmanFilter(dim_x=4, dim_z=2)
        peer.F, peer.Q, peer.H, peer.R, peer.P = move, noise, look, error, numpy.eye(4)
        state = None
        for measurement in measured:
            peer.update(measurement)
            state = peer.x.copy()
            peer.predict()
        return numpy.ravel(state)

    mine, yours, found, expected = by_turns(ours, theirs, 30, 10)
    check("filterpy", found, expected)
    return row("Kalman filter, 4 x 2, 20,000 samples", "filterpy", mine, yours, 150)


def simulated(samples):
    """A plant of second order with white noise in its equation."""
    u = numpy.random.choice([-1.0, 1.0], samples)
    noise = 0.1 * numpy.random.standard_normal(samples)
    return u, lfilter([0, 1, 0.5], [1, -1.5, 0.7], u) + lfilter([1], [1, -1.5, 0.7], noise)


def fits():
    """Batch fits, from arrays to parameters."""
    u, y = simulated(1_000_000)
    log = thetahat.Log(y, u)

    def normal():
        inputs, outputs = u - u.mean(), y - y.mean()
        columns = [signal[4 - lag : len(y) - lag] for signal in (-outputs, inputs) for lag in range(1, 5)]
        return numpy.linalg.lstsq(numpy.column_stack(columns), outputs[4:], rcond=None)[0]

    mine, yours, found, expected = by_turns(lambda: thetahat.arx(log, 4, 4).parameters, normal, 12, 3)
    check("lstsq", found, expected)
    yield row("ARX(4, 4, 1), N = 1,000,000", "numpy.linalg.lstsq with its matrix", mine, yours, 15)
    both, again, *_ = by_turns(lambda: thetahat.arx(log, 4, 4).fits, normal, 6, 3)
    yield row("the same with the figures of the fit", "the same", both, again, None)

    u, y = simulated(100_000)
    short = thetahat.Log(y, u)

    def sippy():
        return system_identification(y, u, "ARX", ARX_orders=[4, 4, 1], centering="MeanVal")

    mine, yours, *_ = by_turns(lambda: thetahat.arx(short, 4, 4).parameters, sippy, 12, 6)
    yield row("ARX(4, 4, 1), N = 100,000", "sippy-unipi", mine, yours, 50)

    u, y = simulated(10_000)
    small = thetahat.Log(y, u)

    def iterative():
        return system_identification(y, u, "ARMAX", ARMAX_orders=[2, 2, 2, 1], centering="MeanVal")

    mine, yours, *_ = by_turns(lambda: thetahat.armax(small, 2, 2, 2).parameters, iterative, 12, 6)
    yield row("ARMAX(2, 2, 2, 1), N = 10,000", "sippy-unipi, iterative least squares", mine, yours, 50)


def driven(samples):
    """Four states of two lightly damped modes, two inputs and two outputs, the states and the outputs with noise."""
    f = numpy.array([[0.8, 0.4, 0, 0], [-0.4, 0.8, 0, 0], [0, 0, 0.3, 0.6], [0.1, 0, -0.6, 0.3]])
    g = numpy.array([[1, 0.2], [-0.5, 0.7], [0.3, 1], [0, -0.8]])
    h = numpy.array([[1, 0, 0.5, 0], [0, 0.6, 0, 1]])
    k = numpy.array([[0.3, 0], [0.1, 0.2], [0, 0.1], [-0.1, 0.3]])
    u, e = numpy.random.standard_normal((samples, 2)), 0.5 * numpy.random.standard_normal((samples, 2))
    moved, x = u @ g.T + e @ k.T, numpy.zeros((samples, 4))
    for t in range(samples - 1):
        x[t + 1] = f @ x[t] + moved[t]
    return u, x @ h.T + e, h @ numpy.linalg.solve(numpy.eye(4) - f, g)


def states():
    """Models in state space, from arrays to a model: ours with K, the covariance of the errors and all figures of the fit."""
    words = {"past": 10, "feedthrough": False, "detrend": "none", "constant": "no"}

    def near(name, gains, truth):
        # Other methods find other models of the same plant.
        if numpy.abs(gains - truth).max() > 0.3 * numpy.abs(truth).max():
            raise SystemExit(f"{name}: its static gains {gains} are not those of the plant, {truth}")

    for samples, required in [(10_000, 60), (100_000, 200)]:
        u, y, truth = driven(samples)
        log = thetahat.Log(y, u, sample_time=1)

        def sippy(u=u, y=y):
            return system_identification(y, u, "N4SID", SS_fixed_order=4, SS_f=10)

        # Threads that a peer leaves spinning disturb the first of ours.
        mine, yours, found, expected = by_turns(lambda log=log: thetahat.ss(log, 4, **words), sippy, 36, 12)
        near("thetahat", numpy.array([[found.dc_gain(i, output=o)[0] for i in range(2)] for o in range(2)]), truth)
        still = numpy.eye(4) - expected.A
        near("sippy-unipi", expected.C @ numpy.linalg.solve(still, expected.B) + expected.D, truth)
        yield row(f"state space, 2 x 2, order 4, N = {samples:,}", "sippy-unipi, N4SID", mine, yours, required)
        if samples == 10_000:
            frame = pandas.DataFrame(numpy.column_stack([u, y]), columns=["u1", "u2", "y1", "y2"])

            def nfoursid(frame=frame):
                peer = NFourSID(frame, ["y1", "y2"], ["u1", "u2"], num_block_rows=10)
                peer.subspace_identification()
                return peer.system_identification(rank=4)

            mine, yours, *_ = by_turns(lambda log=log: thetahat.ss(log, 4, **words), nfoursid, 12, 12)
            yield row(f"the same, N = {samples:,}", "nfoursid", mine, yours, None)

    u, y, _ = driven(1_000_000)
    log = thetahat.Log(y, u, sample_time=1)
    fortran = numpy.asfortranarray(u), numpy.asfortranarray(y)

    def factor():
        return ctrlsys.ib01ad("M", "C", "N", "O", "N", "N", 10, 2, 2, *fortran, 0.0, -1.0)

    def ours():
        return thetahat.ss(log, 4, weighting="moesp", future=10, **words)

    mine, yours, found, expected = by_turns(ours, factor, 12, 4)
    values = numpy.array(found.document["estimation"]["singular_values"][:4])
    check("SLICOT, singular values", values * numpy.sqrt(len(u) - 19), expected[2][:4])
    peer = "SLICOT (ctrlsys), IB01AD: the factor and its singular values alone"
    yield row("the same by MOESP, N = 1,000,000", peer, mine, yours, None)
    mine, yours, *_ = by_turns(lambda: thetahat.ss(log, 4, **words), factor, 12, 4)
    yield row("the same by SSARX", "the same", mine, yours, None)


def nonlinear():
    """Forward regression of nonlinear ARX models, the whole call: the same terms, and their coefficients."""
    for samples, lags, degree, candidates, required in [
        (10_000, 10, 2, 231, 40),
        (10_000, 10, 3, 1771, 20),
        (100_000, 6, 3, 455, 100),
    ]:
        random = numpy.random.default_rng(1)
        u, e = random.uniform(-1, 1, samples), 0.1 * random.standard_normal(samples)
        y = numpy.zeros(samples)
        for k in range(2, samples):
            products = 0.3 * u[k - 1] * y[k - 1] + 0.2 * u[k - 2] ** 2 - 0.1 * y[k - 1] ** 2 * u[k - 2]
            y[k] = 0.6 * y[k - 1] - 0.2 * y[k - 2] + u[k - 1] + products + e[k]
        log = thetahat.Log(y, u)

        def ours(log=log, lags=lags, degree=degree):
            return thetahat.narx(log, ny=lags, nu=lags, degree=degree, terms=20, detrend="none", raw_terms=True)

        def theirs(u=u, y=y, lags=lags, degree=degree):
            model = FROLS(
                order_selection=False,
                n_terms=20,
                ylag=lags,
                xlag=lags,
                estimator=LeastSquares(),
                basis_function=Polynomial(degree=degree),
            )
            return model.fit(X=u.reshape(-1, 1), y=y.reshape(-1, 1))

        mine, yours, found, expected = by_turns(ours, theirs, 9, 4)
        names = [product(term) for term in expected.final_model]
        coefficients = dict(zip(names, expected.theta.ravel(), strict=True))
        check("SysIdentPy", [coefficients.get(name, 0.0) for name in found.parameter_names], found.parameters)
        work = f"{candidates} products, N = {samples:,}"
        yield row(f"NARX, 20 of {work}", "SysIdentPy, FROLS", mine, yours, required)


def seasonal():
    """Seasonal ARIMA models by exact likelihood, the whole call: ours with all figures of the fit, and no smaller likelihood."""
    random = numpy.random.default_rng(2)
    for samples, required in [(200, None), (1_000, 100)]:
        e = random.standard_normal(samples + 200)
        w = lfilter(numpy.convolve([1, 0.3], [1, *[0] * 11, -0.5]), [1, -0.5], e)
        y = lfilter([1], numpy.convolve([1, -1], [1, *[0] * 11, -1]), w)[200:]
        log = thetahat.Log(y, sample_time=1)

        def ours(log=log):
            return thetahat.arima(log, order=(1, 1, 1), seasonal=(0, 1, 1, 12))

        def theirs(y=y):
            return SARIMAX(y, order=(1, 1, 1), seasonal_order=(0, 1, 1, 12)).fit(disp=0)

        mine, yours, found, expected = by_turns(ours, theirs, 12, 6)
        if found.log_likelihood < expected.llf - 1e-3:
            raise SystemExit(f"SARIMAX: ln L {expected.llf} is above ours, {found.log_likelihood}")
        yield row(f"ARIMA(1, 1, 1)(0, 1, 1, 12), N = {samples:,}", "statsmodels, SARIMAX", mine, yours, required)


def spectra():
    """Response by H1 and coherence, the whole call: ours with bands, their check at twice the resolution and a test for feedback."""
    samples = 1_000_000
    u = numpy.random.standard_normal(samples)
    y = lfilter([0.0, 0.5], [1.0, -0.8], u) + 0.1 * numpy.random.standard_normal(samples)
    u, y = u - u.mean(), y - y.mean()
    log = thetahat.Log(y, u)
    for window in (256, 1024):

        def ours(window=window):
            return thetahat.spectrum(log, method="welch", window=window)

        def theirs(window=window):
            words = {"nperseg": window, "detrend": False}
            response = csd(u, y, **words)[1] / welch(u, **words)[1]
            return response, coherence(u, y, **words)[1]

        mine, yours, found, (response, coherent) = by_turns(ours, theirs, 9, 2)
        inner = slice(1, window // 2)
        check("SciPy, response", found.values[0].view(float), response[inner].view(float))
        check("SciPy, coherence", found.coherence, coherent[inner])
        work = f"H1 and coherence, windows of {window:,}, N = {samples:,}"
        yield row(work, "SciPy, csd, welch, coherence", mine, yours, 12)


def product(term):
    """A term of SysIdentPy by its name here: 1002 is y(k-2), 2001 is u(k-1), 0 no factor."""
    codes = sorted(int(code) for code in term if code)
    factors = [f"{'y' if code < 2000 else 'u'}(k-{code % 1000})" for code in codes]
    powers = {factor: factors.count(factor) for factor in factors}
    return "*".join(factor if power == 1 else f"{factor}^{power}" for factor, power in powers.items()) or "1"


def calls():
    """What one call costs, and of it NumPy's own part: making and reading an array."""
    phi = numpy.ones(8)
    estimator = thetahat.RecursiveLeastSquares(8)
    single = min(timeit.repeat(lambda: estimator.update(phi, 1.0), number=100_000, repeat=5)) / 100_000
    nothing = min(timeit.repeat(lambda: phi.sum(), number=100_000, repeat=5)) / 100_000
    yield ["one update of 8 parameters from Python", "phi.sum() of NumPy", f"{single * 1e6:.2f} us", f"{nothing * 1e6:.2f} us",
           "", "under 1 us", verdict(single < 1e-6)]  # fmt: skip


if __name__ == "__main__":
    main()
