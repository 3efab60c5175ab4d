"""The program, the logs of two small cases, and their tables by `perimelt export`."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

import perimelt

HERE = Path(__file__).parent
CASES = HERE / "cases"
TARGET = Path(os.environ.get("CARGO_TARGET_DIR", HERE.parents[1] / "target"))


@pytest.fixture(scope="session", autouse=True)
def program() -> Path:
    """The program: that of `PERIMELT`, else a build of this repository, else that in PATH."""
    built = [TARGET / "release" / "perimelt", TARGET / "debug" / "perimelt-tests"]
    found = [os.environ.get("PERIMELT"), *map(str, filter(Path.is_file, built))]
    found.append(shutil.which("perimelt"))
    for path in filter(None, found):
        os.environ["PERIMELT"] = path
        return Path(path)
    pytest.exit("build the program (`cargo build --release`) or set PERIMELT to its path")


@pytest.fixture(scope="session")
def weld_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Log of a weld in double precision."""
    out = tmp_path_factory.mktemp("weld") / "weld.mcap"
    perimelt.run(CASES / "weld.toml", out=out, quiet=True).close()
    return out


@pytest.fixture
def weld(weld_path: Path) -> perimelt.Log:
    return perimelt.open(weld_path)


@pytest.fixture(scope="session")
def rods_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Log of two bodies in single precision."""
    out = tmp_path_factory.mktemp("rods") / "rods.mcap"
    perimelt.run(CASES / "rods.toml", out=out, quiet=True).close()
    return out


@pytest.fixture
def rods(rods_path: Path) -> perimelt.Log:
    return perimelt.open(rods_path)


@pytest.fixture(scope="session")
def layers(tmp_path_factory: pytest.TempPathFactory) -> perimelt.Log:
    """Log of a body that grows and moves, of which the case asks for the temperature only."""
    out = tmp_path_factory.mktemp("layers") / "layers.mcap"
    return perimelt.run(CASES / "layers.toml", out=out, quiet=True)


def export(program: Path, log: Path) -> Path:
    """Folder with the tables of a log, written by the program."""
    folder = log.parent / f"{log.stem}-tables"
    if not folder.exists():
        command: list[str | Path] = [program, "export", log, "--format", "csv", "--out", folder]
        subprocess.run(command, check=True, capture_output=True)
    return folder


@pytest.fixture(scope="session")
def weld_tables(program: Path, weld_path: Path) -> Path:
    return export(program, weld_path)


@pytest.fixture(scope="session")
def rods_tables(program: Path, rods_path: Path) -> Path:
    return export(program, rods_path)
