"""Models in blocks on public and simulated logs: errors of the free run on rows held out, and seconds, as a table.

    python benches/blocks.py FOLDER [PROGRAM]

FOLDER has the logs of nonlinear benchmarks: silverbox.csv, cascaded_tanks_est.csv, cascaded_tanks_val.csv, ced_uniform.csv. Those that are
not there are left out by name. PROGRAM is target/release/thetahat unless it is said.
"""

import json
import pathlib
import subprocess
import sys
import tempfile
import time

HERE = pathlib.Path(__file__).parent.parent
# Name, log, options of the fit, log and rows held out.
CASES = [
    ("valve", "valve.csv", "--blocks hammerstein -u valve -y flow --estimate 1..2000", "valve.csv", "2001..3000"),
    ("sensor", "sensor.csv", "--blocks wiener -u drive -y reading --estimate 1..2000", "sensor.csv", "2001..3000"),
    ("amplifier", "amplifier.csv", "--blocks wh -u input -y output --estimate 1..3000", "amplifier.csv", "3001..4000"),
    ("spring", "spring.csv", "--blocks feedback -u force -y position --estimate 1..2000", "spring.csv", "2001..3000"),
    ("Silverbox, multisine", "silverbox.csv", "--blocks feedback --estimate 40651..105712", "silverbox.csv", "105713..127400"),
    ("Silverbox, arrow", "silverbox.csv", "--blocks feedback --estimate 40651..105712", "silverbox.csv", "101..40575"),
    ("cascaded tanks", "cascaded_tanks_est.csv", "--blocks feedback", "cascaded_tanks_val.csv", "1..1024"),
    ("coupled drives 1", "ced_uniform.csv", "--blocks wiener -u u11 -y z11 --estimate 1..400", "ced_uniform.csv", "401..500"),
    ("coupled drives 2", "ced_uniform.csv", "--blocks wiener -u u12 -y z12 --estimate 1..400", "ced_uniform.csv", "401..500"),
]


def found(folder: pathlib.Path, name: str) -> pathlib.Path:
    """A log of the repository, or of the folder."""
    own = HERE / "tests/data/blocks" / name
    return own if own.exists() else folder / name


def main(folder: str, program: str = str(HERE / "target/release/thetahat")) -> None:
    print("| log | options | error of the free run | fit | seconds |\n|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as temporary:
        report = pathlib.Path(temporary) / "report.json"
        for name, log, options, fresh, rows in CASES:
            log, fresh = found(pathlib.Path(folder), log), found(pathlib.Path(folder), fresh)
            if not (log.exists() and fresh.exists()):
                print(f"{name}: {log.name} is not there", file=sys.stderr)
                continue
            begin = time.perf_counter()
            subprocess.run([program, "fit", log, *options.split(), "--report", report], check=True, capture_output=True)
            seconds = time.perf_counter() - begin
            told = subprocess.run(
                [program, "validate", report, fresh, "--rows", rows, "--format", "json"], check=True, capture_output=True, text=True
            )
            free = [fit for fit in json.loads(told.stdout)["fit"] if fit["horizon"]["kind"] == "free-run"][0]
            options = options.split(" --estimate")[0]
            print(f"| {name} | `{options}` | {free['rmse']:.3g} | {free['percent']:.1f} % | {seconds:.1f} |")


if __name__ == "__main__":
    main(*sys.argv[1:])
