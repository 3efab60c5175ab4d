"""Runs of the program from Python."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

import pandas as pd

from ._case import Case, Changes, case_text, change_case, read_case
from ._log import Log
from .errors import CaseError, RunError

PathLike = str | os.PathLike[str]


def find_program(program: PathLike | None = None) -> Path:
    """The program: `program`, else the environment variable `PERIMELT`, else `perimelt` in PATH.

    Raises:
        RunError: there is none
    """
    if program is None:
        program = os.environ.get("PERIMELT") or "perimelt"
    found = shutil.which(os.fspath(program))
    if found is None:
        raise RunError(
            f"the program `{program}` was not found; install it with `cargo install --path cases`, "
            "or name it by the argument `program` or the environment variable PERIMELT"
        )
    return Path(found)


def run(
    case: PathLike | Case,
    changes: Changes | None = None,
    *,
    out: PathLike | None = None,
    force: bool = False,
    until: float | None = None,
    threads: int | None = None,
    quiet: bool = False,
    folder: PathLike | None = None,
    program: PathLike | None = None,
) -> Log:
    """Runs a case and opens its log.

        log = perimelt.run("weld.toml", {"couplers.goldak.power": 3000}, out="hot.mcap")

    The program prints its progress. An interrupt (Ctrl-C) ends the run after its step, with a
    checkpoint; `resume` continues it.

    Args:
        case: case file, or the case as a dictionary
        changes: other values by their paths, see `change_case`
        out: the log to write; by default the name of the case file with `.mcap`, in the working
            directory
        force: replace a log that exists
        until: stop at the first logged state at or after this simulated time, s
        threads: number of threads; all cores if left out
        quiet: print nothing
        folder: where relative paths in the case start: by default the folder of the case file, or
            the working directory
        program: the program, see `find_program`

    Raises:
        CaseError: the changes do not fit the case
        RunError: the program refused the case or stopped with an error, in its own words
    """
    found = find_program(program)
    if isinstance(case, Mapping):
        if out is None:
            raise CaseError("give `out`: a case that is a dictionary has no name for its log")
        stem, content, start = "case", case, Path(folder or ".")
    else:
        path = Path(case)
        out = out or f"{path.stem}.mcap"
        stem, start = path.stem, Path(folder or path.parent)
        if not changes and start.resolve() == path.parent.resolve():
            _call([found, "run", path, *_options(out, until, threads, quiet, force)], quiet)
            return Log(out)
        content = read_case(path)
    with _written(change_case(content, changes or {}), stem, start) as file:
        _call([found, "run", file, *_options(out, until, threads, quiet, force)], quiet)
    return Log(out)


def resume(
    log: PathLike | Log,
    *,
    case: PathLike | Case | None = None,
    out: PathLike | None = None,
    until: float | None = None,
    threads: int | None = None,
    quiet: bool = False,
    folder: PathLike | None = None,
    program: PathLike | None = None,
) -> Log:
    """Continues a run from the last checkpoint of its log, and opens the log again.

        later = perimelt.change_case(log.case, {"time.end": 120})
        log = perimelt.resume(log, case=later, folder=log.case_folder)

    Args:
        log: the log; it is replaced unless `out` names another one
        case: case file, or the case as a dictionary, which may have another end, other steps and
            times of logging; the case of the log if left out
        out: a new log to write
        until: stop at the first logged state at or after this simulated time, s
        threads: number of threads; all cores if left out
        quiet: print nothing
        folder: where relative paths in a case that is a dictionary start: by default the working
            directory
        program: the program, see `find_program`

    Raises:
        RunError: the run cannot be continued or stopped with an error
    """
    path = log.path if isinstance(log, Log) else Path(log)
    if isinstance(log, Log) and out is None:
        log.close()
    command: list[PathLike] = [find_program(program), "resume", path]
    command += _options(out, until, threads, quiet)
    if isinstance(case, Mapping):
        with _written(case, "case", Path(folder or ".")) as file:
            _call([*command, "--case", file], quiet)
    else:
        _call(command if case is None else [*command, "--case", case], quiet)
    return Log(out or path)


def summary(
    log: PathLike | Log,
    *,
    isotherm: float | None = None,
    haz: float | None = None,
    travel: Literal["x", "y"] | None = None,
    program: PathLike | None = None,
) -> pd.DataFrame:
    """What goes into a report, as measured by `perimelt summary`: a row for each quantity.

    Melt pool, fusion zone, heat-affected zone, cooling times, distortion, stress, energies of the
    sources, errors of balances. Columns are `of` (body, plugin or probe), `id`, which stays when
    the wording changes, `quantity`, `value`, `unit`, and for some `time` (s), `place` (m),
    `distance` from the start of a line (m) and `left_out`, the reason why there is no value.

    Args:
        log: the log
        isotherm: temperature that bounds melt pool and fusion zone, K; the solidus if left out
        haz: temperature that bounds the heat-affected zone, K; Ac1 of the steel if left out
        travel: axis along which the source travels, for the length of the melt pool; x if left out
        program: the program, see `find_program`

    Raises:
        RunError: the program cannot read the log
    """
    path = log.path if isinstance(log, Log) else Path(log)
    command: list[PathLike] = [find_program(program), "summary", "--json", path]
    if isotherm is not None:
        command += ["--isotherm", repr(float(isotherm))]
    if haz is not None:
        command += ["--haz", repr(float(haz))]
    if travel is not None:
        command += ["--travel", travel]
    done = subprocess.run(command, capture_output=True, encoding="utf-8", errors="replace")
    if done.returncode != 0:
        lines = done.stderr.splitlines(keepends=True)
        raise RunError(_message(lines, done.returncode), done.returncode)
    rows: list[dict[str, Any]] = json.loads(done.stdout)
    columns = ["of", "id", "quantity", "value", "unit", "time", "place", "distance", "left_out"]
    return pd.DataFrame(rows, columns=columns)


def _options(
    out: PathLike | None,
    until: float | None,
    threads: int | None,
    quiet: bool,
    force: bool = False,
) -> list[str]:
    options = []
    if out is not None:
        options += ["--out", os.fspath(out)]
    if until is not None:
        options += ["--until", repr(float(until))]
    if threads is not None:
        options += ["--threads", str(threads)]
    if quiet:
        options.append("--quiet")
    if force:
        options.append("--force")
    return options


@contextmanager
def _written(case: Case, stem: str, folder: Path) -> Iterator[Path]:
    """The case as a file, while the program runs.

    It lies in the folder from which the relative paths in the case start.
    """
    text = case_text(case)
    try:
        handle, name = tempfile.mkstemp(prefix=f"{stem}-", suffix=".toml", dir=folder)
    except OSError as error:
        raise CaseError(
            f"cannot write the changed case to {folder}: {error.strerror}; relative paths in it "
            "start there; `folder` names another one"
        ) from error
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
        yield Path(name)
    finally:
        Path(name).unlink(missing_ok=True)


def _call(command: list[PathLike], quiet: bool) -> None:
    """Calls the program and prints what it prints, line by line."""
    lines: list[str] = []
    with subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        encoding="utf-8",
        errors="replace",
    ) as process:
        assert process.stdout is not None
        try:
            for line in process.stdout:
                lines.append(line)
                if not quiet:
                    print(line, end="", flush=True)
            status = process.wait()
        except KeyboardInterrupt:
            # a terminal has sent the program the same interrupt; a second one would end it at once
            process.send_signal(signal.SIGTERM)
            process.wait()
            raise
    if status != 0:
        raise RunError(_message(lines, status), status)


def _message(lines: list[str], status: int) -> str:
    """The error that the program printed, without the progress before it."""
    starts = [number for number, line in enumerate(lines) if line.startswith("error")]
    text = "".join(lines[starts[0] :] if starts else lines[-20:]).strip()
    return text or f"the program ended with status {status}"
