"""Writes the logs in this folder: one short experiment, as text, by PyArrow and by Polars.

Run with PyArrow 26.0.1 and Polars 2.1.0: python tests/data/columnar/make.py
"""

import datetime
import pathlib

import polars as pl
import pyarrow as pa
import pyarrow.feather
import pyarrow.parquet

folder = pathlib.Path(__file__).parent
rows = range(60)

# A first-order plant, its input in {0, 1, 2} and its output in thousandths.
u = [(k * k // 7) % 3 for k in rows]
y = [0.0]
for k in rows[1:]:
    y.append(round(0.8 * y[-1] + 0.5 * u[k - 1], 3))
missing = {17, 40}
y_there = [None if k in missing else value for k, value in enumerate(y)]
zone = datetime.timezone(datetime.timedelta(hours=1))
start = datetime.datetime(2024, 3, 1, 12, 0, 0, 250_000, zone)
when = [start + datetime.timedelta(milliseconds=100 * k) for k in rows]
notes = ["ok" if k % 2 else "µ" for k in rows]

# As text, to compare with.
lines = ["when,u,y,note"]
for k in rows:
    lines.append(f"{when[k].isoformat(timespec='milliseconds')},{u[k]},{'' if k in missing else y[k]},{notes[k]}")
(folder / "log.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")

# PyArrow: small types, dictionaries, row groups of 25 rows, and a column in columns.
table = pa.table(
    {
        "when": pa.array(when, pa.timestamp("ms", tz="+01:00")),
        "u": pa.array(u, pa.int8()).dictionary_encode(),
        "y": pa.array(y_there, pa.float64()),
        "note": pa.array(notes).dictionary_encode(),
        "pair": pa.array([{"a": k, "b": [k]} for k in rows]),
    }
)
pyarrow.parquet.write_table(table, folder / "pyarrow.parquet", row_group_size=25, compression="zstd")
pyarrow.feather.write_feather(table.drop(["pair"]), folder / "pyarrow.arrow", compression="lz4", chunksize=25)
with pa.OSFile(str(folder / "pyarrow.arrows"), "wb") as sink, pa.ipc.new_stream(sink, table.drop(["pair"]).schema) as writer:
    writer.write_table(table.drop(["pair"]), max_chunksize=25)

# Polars: its own strings, categories, decimals and times.
frame = pl.DataFrame(
    {
        "when": pl.Series(when).dt.convert_time_zone("Europe/Berlin"),
        "u": pl.Series(u, dtype=pl.UInt16),
        "y": pl.Series(y_there).cast(pl.Decimal(10, 3)),
        "note": pl.Series(notes).cast(pl.Categorical),
    }
)
frame.write_parquet(folder / "polars.parquet", row_group_size=25)
frame.write_ipc(folder / "polars.arrow", compression="zstd")
frame.write_ipc_stream(folder / "polars.arrows")
