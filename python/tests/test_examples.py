"""The examples of the documentation run."""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from typing import Any

import pytest

from conftest import CASES

REPOSITORY = Path(__file__).parents[2]


@pytest.mark.parametrize(
    ("document", "section", "count"),
    [("python/README.md", "", 3), ("docs/guide/logs_and_pictures.md", "Python", 1)],
)
def test_examples_run(
    document: str,
    section: str,
    count: int,
    weld_path: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    text = (REPOSITORY / document).read_text(encoding="utf-8")
    if section:
        text = text.partition(f"\n## {section}\n")[2].partition("\n## ")[0]
    examples = re.findall(r"^```python\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    assert len(examples) == count
    shutil.copy(weld_path, tmp_path / "weld.mcap")
    shutil.copy(CASES / "weld.toml", tmp_path)
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    for example in examples:
        exec(compile(example, document, "exec"), names)
    assert (tmp_path / "hot.mcap").exists()
