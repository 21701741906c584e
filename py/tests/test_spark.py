"""The recipe of docs/many-logs.md for Spark, where pyspark is installed."""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path
from typing import Any

import pytest

import thetahat as th

PAGE = Path(__file__).parents[2] / "docs" / "many-logs.md"


def test_the_recipe_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pyspark = pytest.importorskip("pyspark.sql")
    monkeypatch.setitem(os.environ, "PYSPARK_PYTHON", sys.executable)
    motor = th.dc_motor()
    paths = []
    for number, first in enumerate((0, 500)):
        part = motor[first : first + 500]
        paths.append(str(tmp_path / f"{number}.csv"))
        Path(paths[-1]).write_text("u,y\n" + "".join(f"{u},{y}\n" for u, y in zip(part["u"], part["y"])))
    Path(tmp_path, "2.csv").write_text("u,y\n1,two\n")
    paths.append(str(tmp_path / "2.csv"))
    recipe = next(text for text in re.findall(r"```text\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL) if "mapInPandas" in text)
    spark = pyspark.SparkSession.builder.master("local[2]").config("spark.ui.enabled", "false").getOrCreate()
    try:
        names: dict[str, Any] = {"spark": spark, "paths": paths}
        exec(compile(recipe, str(PAGE), "exec"), names)
        table = names["table"].toPandas().sort_values("log")
    finally:
        spark.stop()
    expected = th.fit_many(paths, th.arx, na=2, nb=2)
    assert table["exit_code"].tolist() == [row["exit_code"] for row in expected.rows] == [0, 0, 3]
    assert table["a1"].tolist()[:2] == [row["a1"] for row in expected.rows[:2]]
