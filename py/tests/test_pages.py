"""The examples of the READMEs and of the pages under docs/ run as they stand."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def blocks(path: Path) -> list[str]:
    return re.findall(r"```python\n(.*?)```", path.read_text(encoding="utf-8"), re.DOTALL)


PAGES = [path for path in [*ROOT.glob("*.md"), ROOT / "py/README.md", *sorted(ROOT.glob("docs/*.md"))] if blocks(path)]


def test_the_readmes_have_examples() -> None:
    names = {str(path.relative_to(ROOT)) for path in PAGES}
    assert names >= {"README.md", "py/README.md", "docs/python.md"}


@pytest.mark.parametrize("path", PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_the_examples_run(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for block in blocks(path):
        exec(compile(block, str(path), "exec"), {})
        for name in re.findall(r'\.write\("(.*?)"\)', block):
            assert (tmp_path / name).exists()
