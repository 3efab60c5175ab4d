"""Files, commands, outputs and programs of the tutorial are as its pages show them."""

from __future__ import annotations

import os
import re
import subprocess
from pathlib import Path
from typing import Any

import pytest

REPOSITORY = Path(__file__).parents[2]
TUTORIAL = REPOSITORY / "docs" / "tutorial"
FENCE = re.compile(r"(?:^<!-- (.*?) -->\n)?^```(\w+)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
# builds and installs, opens a browser, is run by `cargo test`
NOT_RUN = {
    "cargo install --path cases\n",
    "perimelt view bead_on_plate.mcap\n",
    "cargo run --release -- run drying.toml\n",
}


def same(expected: str, printed: str) -> bool:
    """Whether a text is as expected; `...` stands for any text in a line, or for any lines."""
    lines = [" ".join(line.split()) for line in expected.splitlines() if line.strip()]
    pattern = "".join(
        r"(?:.*\n)*" if line == "..." else re.escape(line).replace(r"\.\.\.", ".*") + r"\n"
        for line in lines
    )
    text = "".join(" ".join(line.split()) + "\n" for line in printed.splitlines() if line.strip())
    return re.fullmatch(pattern, text) is not None


def run_console(block: str, folder: Path, program: Path) -> None:
    for command, expected in re.findall(r"^\$ (.*)\n((?:(?!\$ ).*\n)*)", block, re.MULTILINE):
        ran = subprocess.run(
            ["sh", "-c", command],
            cwd=folder,
            env=os.environ | {"PATH": f"{program.parent}:{os.environ['PATH']}"},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            encoding="utf-8",
            check=False,
        )
        # lines of progress stand for the bar where there is no terminal
        printed = re.sub(r"^ *[\d.]+ %  t = .*\n", "", ran.stdout, flags=re.MULTILINE)
        wanted = "error:" in expected
        assert (ran.returncode != 0) == wanted, f"{command}: {ran.returncode}\n{printed}"
        assert same(expected, printed), f"{command}\n{expected}--- but\n{printed}"


def write_file(block: str, folder: Path) -> None:
    """Writes the file that the first line names, adds to it, or replaces one of its lines."""
    head, _, text = block.partition("\n")
    if match := re.fullmatch(r"# add to (\S+)", head):
        path = folder / match[1]
        path.write_text(f"{path.read_text(encoding='utf-8')}\n{text}", encoding="utf-8")
    elif match := re.fullmatch(r"# in (\S+), instead of (.*)", head):
        path = folder / match[1]
        before = path.read_text(encoding="utf-8")
        assert before.splitlines().count(match[2]) == 1, f"{match[2]} in\n{before}"
        path.write_text(before.replace(f"{match[2]}\n", text), encoding="utf-8")
    else:
        (folder / head.removeprefix("# ")).write_text(text, encoding="utf-8")


def check_origin(origin: str, block: str) -> None:
    """The text is that of a file of the repository."""
    if origin.startswith("from "):
        whole = (REPOSITORY / origin.removeprefix("from ")).read_text(encoding="utf-8")
        lines = "\n".join(line.split(" // ")[0] for line in whole.splitlines())
        assert block.strip("\n") in lines, f"{origin}:\n{block}"
        return
    # versions of dependencies
    whole = (REPOSITORY / "Cargo.toml").read_text(encoding="utf-8")
    dependencies = block.partition("[dependencies]\n")[2].splitlines()
    for line in filter(lambda line: "path" not in line, dependencies):
        assert line in whole.splitlines(), line


@pytest.mark.parametrize("page", sorted(TUTORIAL.glob("*.md")), ids=lambda page: page.stem)
def test_a_page_shows_what_happens(
    page: Path, program: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    commands = tmp_path / "bin"
    commands.mkdir()
    (commands / "perimelt").symlink_to(program.resolve())
    names: dict[str, Any] = {}
    fences = FENCE.findall(page.read_text(encoding="utf-8"))
    assert fences
    for origin, language, block in fences:
        if origin:
            check_origin(origin, block)
        elif language == "toml":
            write_file(block, tmp_path)
        elif language == "console":
            run_console(block, tmp_path, commands / "perimelt")
        elif language == "python":
            exec(compile(block, str(page), "exec"), names)
        else:
            assert block in NOT_RUN, f"{language}: {block}"
