"""Does the same work with thetahat and with its peers, by turns, and prints the ratios of their times.

Usage: compare.py THETAHAT THETAHAT_PEERS FOLDER (the two programs, and a folder for the data); `run` calls it.
It fails on errors and on estimates that disagree, not on a ratio that is missed.
"""

import json
import os
import platform
import subprocess
import sys
import time
from collections import defaultdict

# Estimates may differ by so much, relative to their largest parameter.
AGREEMENT = 1e-8

# What somebody with pandas and NumPy would write for `thetahat fit LOG --na 4 --nb 4`.
SCRIPT = """
import sys
import numpy
import pandas

log = pandas.read_csv(sys.argv[1])
u, y = (log[name].to_numpy() - log[name].mean() for name in ("u", "y"))
columns = [signal[4 - lag : len(y) - lag] for signal in (-y, u) for lag in range(1, 5)]
theta = numpy.linalg.lstsq(numpy.stack(columns).T, y[4:], rcond=None)[0]
print(*theta.tolist())
"""

VERSIONS = """
import numpy, pandas
blas = numpy.show_config(mode="dicts")["Build Dependencies"]["blas"]
print("NumPy", numpy.__version__, "with", blas["name"], blas["version"] + ", pandas", pandas.__version__)
"""


def main():
    thetahat, peers, folder = sys.argv[1:]
    os.makedirs(folder, exist_ok=True)
    subprocess.run([peers, "write", folder], check=True)
    print_versions(thetahat)
    # First, while this process is small: a child's peak memory begins with that of its parent.
    commands = compare_commands(thetahat, folder)
    small = compare_estimates(peers, folder, (4, 4, 1), rounds=12, required=(6, 20))
    large = compare_estimates(peers, folder, (30, 30, 1), rounds=4, required=(10, 50))
    grid = compare_grid(peers, folder, (10, 10, 5), rounds=20, required=(2, 200))
    header = ["work", "peer", "thetahat", "peer's", "ratio", "required", "verdict"]
    print_table([header, *small, *large, *grid, *commands])


def print_versions(thetahat):
    """The programs, the libraries and the processor."""
    commands = [[thetahat, "--version"], ["rustc", "--version"], [sys.executable, "-c", VERSIONS]]
    lines = [subprocess.check_output(command, text=True).strip() for command in commands]
    print(*lines, f"Python {platform.python_version()}", sep=", ")
    print(f"{processor()}, {os.cpu_count()} processors", end="\n\n", flush=True)


def processor():
    """The model of the processor."""
    try:
        with open("/proc/cpuinfo") as lines:
            return next(line.split(":")[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()


def compare_commands(thetahat, folder):
    """`thetahat fit` against a Python process, from the log to the parameters: time and memory."""
    log, report = os.path.join(folder, "log.csv"), os.path.join(folder, "report.json")
    commands = {
        "fit": [thetahat, "fit", log, "--na", "4", "--nb", "4", "--report", report],
        "script": [sys.executable, "-c", SCRIPT, log],
    }
    output = {name: os.path.join(folder, f"{name}.txt") for name in commands}
    seconds, memory = defaultdict(list), defaultdict(list)
    for _ in range(15):
        for name, command in commands.items():
            duration, peak = run(command, output[name])
            seconds[name].append(duration)
            memory[name].append(peak / 1e6)
    with open(report) as text:
        ours = [parameter["value"] for parameter in json.load(text)["model"]["parameters"]]
    with open(output["script"]) as text:
        check("pandas and lstsq", [float(word) for word in text.read().split()], ours)
    ours, theirs = max(memory["fit"]), max(memory["script"])
    limit = 64
    return [
        timing("`thetahat fit` on the log", "pandas, lstsq", min(seconds["fit"]), min(seconds["script"]), 3),
        [
            "its peak memory",
            "pandas, lstsq",
            f"{ours:.0f} MB",
            f"{theirs:.0f} MB",
            f"{theirs / ours:.1f}",
            f"at most {limit} MB",
            verdict(ours <= limit),
        ],
    ]


def run(command, output):
    """Runs a command with its output in a file; gives its wall time in seconds and its peak memory in bytes."""
    to_file = (os.POSIX_SPAWN_OPEN, 1, output, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o644)
    begin = time.perf_counter()
    child = os.posix_spawn(command[0], command, os.environ, file_actions=[to_file])
    _, status, usage = os.wait4(child, 0)
    duration = time.perf_counter() - begin
    if status:
        sys.exit(f"{command[0]} failed with status {os.waitstatus_to_exitcode(status)}")
    # In kibibytes, but in bytes on macOS.
    return duration, usage.ru_maxrss * (1 if sys.platform == "darwin" else 1024)


def compare_estimates(peers, folder, orders, rounds, required):
    """ARX estimates from arrays in memory, on one thread each, the making of the regressor matrix included."""
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    import numpy

    u, y = (numpy.fromfile(os.path.join(folder, name)) for name in ("u.f64", "y.f64"))
    na, nb, nk = orders
    first = max(na, nb + nk - 1)

    def columns():
        minus_y = -y
        lagged = [(minus_y, 1 + i) for i in range(na)] + [(u, nk + i) for i in range(nb)]
        return [signal[first - lag : len(y) - lag] for signal, lag in lagged]

    def normal_equations(phi):
        return numpy.linalg.solve(phi.T @ phi, phi.T @ y[first:])

    theirs = {
        # As most people write it; the matrix lies in memory row by row.
        "stacked": lambda: normal_equations(numpy.column_stack(columns())),
        # The fastest way that we found: column by column.
        "by columns": lambda: normal_equations(numpy.stack(columns()).T),
        "lstsq": lambda: numpy.linalg.lstsq(numpy.stack(columns()).T, y[first:], rcond=None)[0],
    }
    seconds, parameters = defaultdict(list), {}
    with start(peers, "serve", folder) as server:

        def request(method):
            return [float(word) for word in ask(server, method, *orders).split()]

        def measure(solve):
            begin = time.perf_counter()
            values = solve().tolist()
            return [time.perf_counter() - begin, *values]

        turns = [(method, request, method) for method in ("arx", "factor", "faer")]
        turns += [(method, measure, solve) for method, solve in theirs.items()]
        for _ in range(rounds):
            for method, how, what in turns:
                # Twice: the turn before has filled the caches with other data.
                for _ in range(2):
                    duration, *parameters[method] = how(what)
                    seconds[method].append(duration)
    for method, values in parameters.items():
        check(method, values, parameters["arx"])
    best = {method: min(values) for method, values in seconds.items()}
    work = f"ARX({na}, {nb}, {nk})"
    return [
        timing(work, "NumPy, normal equations, stacked", best["arx"], best["stacked"], required[0]),
        timing(work, "NumPy, normal equations, by columns", best["arx"], best["by columns"], required[0]),
        timing(work, "NumPy, lstsq", best["arx"], best["lstsq"], required[1]),
        timing(f"{work} by QR", "NumPy, lstsq", best["factor"], best["lstsq"], None),
        timing(f"{work} by QR", "faer, QR", best["factor"], best["faer"], None),
    ]


def compare_grid(peers, folder, orders, rounds, required):
    """All ARX models up to some orders on common samples, and the best by MDL: ours from one Gram matrix, then fitted."""
    import numpy

    samples = 100_000
    u, y = (numpy.fromfile(os.path.join(folder, name))[:samples] for name in ("u.f64", "y.f64"))
    first = max(orders[0], orders[1] + orders[2] - 1)
    target = y[first:]
    count = len(target)
    models = [
        (na, nb, nk)
        for na in range(1, orders[0] + 1)
        for nb in range(1, orders[1] + 1)
        for nk in range(1, orders[2] + 1)
    ]

    def regressors(na, nb, nk):
        columns = numpy.empty((na + nb, count))
        for lag in range(1, na + 1):
            columns[lag - 1] = -y[first - lag : samples - lag]
        for lag in range(nk, nk + nb):
            columns[na + lag - nk] = u[first - lag : samples - lag]
        return columns.T

    def normal(phi):
        return numpy.linalg.solve(phi.T @ phi, phi.T @ target)

    def lstsq(phi):
        return numpy.linalg.lstsq(phi, target, rcond=None)[0]

    def loop(solve):
        best = None
        for model in models:
            phi = regressors(*model)
            errors = target - phi @ solve(phi)
            mse = errors @ errors / count
            mdl = len(phi.T) * numpy.log(count) / count + numpy.log(mse)
            if best is None or mdl < best[0]:
                best = mdl, [*model, mse]
        return best[1]

    seconds = defaultdict(list)
    with start(peers, "serve", folder) as server:
        for _ in range(rounds):
            for method in ("grid", "largest"):
                duration, *answer = map(float, ask(server, method, *orders).split())
                seconds[method].append(duration)
                if method == "grid":
                    ours = answer
        for name, solve in (("normal", normal), ("lstsq", lstsq)):
            begin = time.perf_counter()
            theirs = loop(solve)
            seconds[name].append(time.perf_counter() - begin)
            check(name, theirs, ours)
        server.stdin.close()
    best = {method: min(values) for method, values in seconds.items()}
    work = f"{len(models)} models and a fit"
    ratio = best["grid"] / best["largest"]
    return [
        timing(work, "NumPy loop, normal equations", best["grid"], best["normal"], required[1]),
        timing(work, "NumPy loop, lstsq", best["grid"], best["lstsq"], required[1]),
        [
            work,
            "our fit of the largest",
            f"{best['grid'] * 1e3:.2f} ms",
            f"{best['largest'] * 1e3:.2f} ms",
            f"{ratio:.2f} fits",
            f"at most {required[0]}",
            verdict(ratio <= required[0]),
        ],
    ]


def start(*command):
    """A program that answers each line with a line, on one thread."""
    one_thread = {**os.environ, "RAYON_NUM_THREADS": "1"}
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True, "bufsize": 1}
    return subprocess.Popen(command, env=one_thread, **pipes)


def ask(server, *words):
    """The program's answer to a line."""
    print(*words, file=server.stdin)
    answer = server.stdout.readline()
    if not answer:
        sys.exit(f"{server.args[0]} gave no answer to {' '.join(map(str, words))}")
    return answer


def check(name, theirs, ours):
    """Fails if two estimates differ."""
    allowed = AGREEMENT * max(map(abs, ours))
    if len(theirs) != len(ours) or not all(abs(a - b) <= allowed for a, b in zip(theirs, ours)):
        sys.exit(f"{name} disagrees with thetahat:\n{theirs}\n{ours}")


def timing(work, peer, ours, theirs, required):
    """A row of the table."""
    ratio = theirs / ours
    cells = ["", ""] if required is None else [f"at least {required}", verdict(ratio >= required)]
    return [work, peer, f"{ours * 1e3:.1f} ms", f"{theirs * 1e3:.1f} ms", f"{ratio:.1f}", *cells]


def verdict(met):
    return "met" if met else "missed"


def print_table(rows):
    """Rows as a Markdown table, the first as its header."""
    widths = [max(map(len, column)) for column in zip(*rows)]
    header, *rows = rows
    for row in [header, ["-" * width for width in widths], *rows]:
        print("|", " | ".join(cell.ljust(width) for cell, width in zip(row, widths)), "|")


if __name__ == "__main__":
    main()
