"""Runs from Python: changed cases, refusals, interrupts."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import perimelt
from conftest import CASES
from perimelt._case import case_text

WELD = CASES / "weld.toml"
# an end that no machine reaches, states that come often
LONG = {"time.end": 1e4, "log.interval": 0.02, "log.checkpoint": 100, "probes": None}


def test_a_changed_case_is_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = sorted(CASES.iterdir())
    changes = {"couplers.goldak.power": np.float64(800), "time.end": 0.2, "probes": None}
    with perimelt.run(WELD, changes, out=tmp_path / "low.mcap", threads=1) as log:
        assert log.case["couplers"][1]["power"] == 800
        assert log.times[-1] == pytest.approx(0.2)
        assert log.probes.empty
        assert log.threads == 1
        assert log.reports["goldak.power.asked"].iloc[0] == 800
        # where relative paths start
        assert log.case_folder == CASES
    # nothing is left beside the case
    assert sorted(CASES.iterdir()) == before
    assert "finished at t = 0.2 s" in capsys.readouterr().out


def test_a_dictionary_is_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    case = perimelt.read_case(WELD)
    case["couplers"][1]["power"] = 900
    log = perimelt.run(case, until=0.1, out=tmp_path / "d.mcap", folder=tmp_path, quiet=True)
    assert log.case == case
    assert log.times[-1] == pytest.approx(0.1)
    assert capsys.readouterr().out == ""
    assert [path.name for path in tmp_path.iterdir()] == ["d.mcap"]
    with pytest.raises(perimelt.CaseError, match="give `out`"):
        perimelt.run(case)


def test_a_run_is_resumed_with_the_same_results(tmp_path: Path, weld: perimelt.Log) -> None:
    first = perimelt.run(WELD, until=0.2, out=tmp_path / "a.mcap", quiet=True)
    assert len(first.times) == 3
    resumed = perimelt.resume(first, quiet=True)
    np.testing.assert_array_equal(resumed.times, weld.times)
    expected = weld.body().field("stress")
    np.testing.assert_array_equal(resumed.body().field("stress"), expected)
    np.testing.assert_array_equal(resumed.probes, weld.probes)


def test_a_run_is_resumed_with_another_case(tmp_path: Path) -> None:
    first = perimelt.run(WELD, {"time.end": 0.2}, out=tmp_path / "a.mcap", quiet=True)
    later = perimelt.change_case(first.case, {"time.end": 0.3})
    resumed = perimelt.resume(first, case=later, folder=tmp_path, quiet=True)
    assert resumed.times[-1] == pytest.approx(0.3)
    # nothing is left beside the log
    assert [path.name for path in tmp_path.iterdir()] == ["a.mcap"]
    file = tmp_path / "later.toml"
    file.write_text(case_text(perimelt.change_case(later, {"time.end": 0.4})), encoding="utf-8")
    resumed = perimelt.resume(resumed, case=file, quiet=True)
    assert resumed.times[-1] == pytest.approx(0.4)


def test_the_program_tells_what_is_wrong(tmp_path: Path) -> None:
    out = tmp_path / "wrong.mcap"
    with pytest.raises(perimelt.RunError, match="did you mean `power`") as caught:
        perimelt.run(WELD, {"couplers.goldak.powr": 1}, out=out, quiet=True)
    assert str(caught.value).startswith("error: unknown key `powr`")
    assert caught.value.status == 1
    assert not out.exists()
    out.write_bytes(b"not a log")
    with pytest.raises(perimelt.RunError, match="--force"):
        perimelt.run(WELD, out=out, quiet=True)
    with perimelt.run(WELD, until=0.1, out=out, force=True, quiet=True) as log:
        assert log.finished


def test_a_summary_has_the_numbers_of_the_states(weld: perimelt.Log, tmp_path: Path) -> None:
    rows = perimelt.summary(weld).set_index("quantity")
    temperature = weld.body().compute(peak=lambda state: state["temperature"].max())["peak"]
    highest = rows.loc["highest logged temperature"]
    assert (highest["of"], highest["value"], highest["unit"]) == ("plate", temperature.max(), "K")
    assert highest["time"] == temperature.idxmax()
    assert rows.loc["energy asked", "value"] == pytest.approx(640)
    wide = perimelt.summary(weld.path, isotherm=1000, travel="y").set_index("quantity")["value"]
    # along y, and of a lower isotherm
    length = wide["largest length of the melt pool"]
    assert length > rows["value"]["largest width of the melt pool"]
    with pytest.raises(perimelt.RunError, match=r"none\.mcap"):
        perimelt.summary(tmp_path / "none.mcap")


def test_a_program_that_is_not_there_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(perimelt.RunError, match=r"`no-such` was not found.*PERIMELT"):
        perimelt.run(WELD, program="no-such")
    monkeypatch.setenv("PERIMELT", "/no/perimelt")
    with pytest.raises(perimelt.RunError, match="/no/perimelt"):
        perimelt.find_program()


def test_a_folder_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    with pytest.raises(perimelt.CaseError, match="cannot write the changed case"):
        perimelt.run(WELD, {"time.end": 1}, out=tmp_path / "a.mcap", folder=tmp_path / "no")


@pytest.mark.skipif(os.name != "posix", reason="locks of POSIX")
def test_a_log_is_followed_while_a_run_writes_it(tmp_path: Path) -> None:
    out = tmp_path / "long.mcap"
    case = perimelt.change_case(perimelt.read_case(WELD), LONG)
    (tmp_path / "long.toml").write_text(case_text(case), encoding="utf-8")
    program = str(perimelt.find_program())
    command = [program, "run", str(tmp_path / "long.toml"), "--out", str(out), "--quiet"]
    with subprocess.Popen(command) as process:
        seen = []
        for log in perimelt.follow(out, poll=0.01):
            seen.append(len(log.times))
            if len(seen) == 2:
                assert "a run is writing it" in log.ending
                assert log.body().state().time == log.times[-1]
            if len(seen) == 3:
                process.kill()
                process.wait()
        assert not log.finished
        assert log.ending.endswith("the run was killed")
    assert seen == sorted(set(seen))
    assert len(seen) >= 3


def test_a_finished_log_is_followed_once(weld_path: Path) -> None:
    assert [len(log.times) for log in perimelt.follow(weld_path)] == [6]


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
def test_an_interrupt_leaves_a_log_that_can_be_resumed(tmp_path: Path) -> None:
    out = tmp_path / "long.mcap"
    script = f"import perimelt; perimelt.run({str(WELD)!r}, {LONG!r}, out={str(out)!r})"
    # a process group of its own, as a terminal has one: the interrupt reaches both programs
    process = subprocess.Popen(
        [sys.executable, "-c", script], start_new_session=True, stderr=subprocess.PIPE, text=True
    )
    deadline = time.monotonic() + 30
    while not out.exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    time.sleep(0.3)
    os.killpg(process.pid, signal.SIGINT)
    _, errors = process.communicate(timeout=30)
    assert errors.rstrip().endswith("KeyboardInterrupt")
    with perimelt.open(out) as log:
        assert log.finished
        reached = log.times[-1]
    assert list(CASES.glob("weld-*.toml")) == []
    resumed = perimelt.resume(out, until=float(reached) + 0.02, quiet=True)
    assert resumed.times[-1] > reached
