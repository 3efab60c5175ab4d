"""What the program logged is what is read: against its own tables and against closed forms."""

from __future__ import annotations

import csv
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import numpy.testing as npt
import pandas as pd
import pytest

import perimelt


def table(path: Path) -> pd.DataFrame:
    """A table of `perimelt export`; its numbers read back exactly."""
    with path.open(newline="") as file:
        titles, *rows = csv.reader(file)
    return pd.DataFrame([[float(number) for number in row] for row in rows], columns=titles)


def without_unit(title: str) -> str:
    return title.partition(" [")[0]


@pytest.mark.parametrize("name", ["weld", "rods"])
def test_every_number_of_every_state_is_that_of_the_exported_tables(
    name: str, request: pytest.FixtureRequest
) -> None:
    log: perimelt.Log = request.getfixturevalue(name)
    tables: Path = request.getfixturevalue(f"{name}_tables")
    count = 0
    for body in log.values():
        times = table(tables / f"{body.name}-times.csv")
        npt.assert_array_equal(body.times, times["time [s]"])
        for state in body.states():
            exported = table(tables / f"{body.name}-{state.number:05}.csv")
            positions = exported[["x [m]", "y [m]", "z [m]"]].to_numpy()
            npt.assert_array_equal(state.positions, positions.astype(state.positions.dtype))
            for title, column in list(exported.items())[3:]:
                values = state[without_unit(str(title))]
                exact = column.to_numpy().astype(values.dtype)
                npt.assert_array_equal(values, exact, err_msg=f"{title} at {state.time} s")
                count += 1
            expected = {without_unit(title).partition(".")[0] for title in exported.columns[3:]}
            assert set(state) == expected
    assert count > 10


def test_units_are_those_of_the_exported_tables(weld: perimelt.Log, weld_tables: Path) -> None:
    titles = table(weld_tables / "plate-00000.csv").columns
    body = weld.body()
    for title in titles[3:]:
        name, _, unit = title.rstrip("]").partition(" [")
        assert body.unit(name) in (unit, "1")


@pytest.mark.parametrize("name", ["beside", "melt pool", "equivalent stress", "principal stress"])
def test_probes_are_those_of_the_exported_tables(
    name: str, weld: perimelt.Log, weld_tables: Path
) -> None:
    exported = table(weld_tables / f"probe-{name.replace(' ', '-')}.csv")
    probe = weld.probes[name]
    npt.assert_array_equal(probe.index, exported["time [s]"])
    npt.assert_array_equal(probe.to_numpy(), exported.to_numpy()[:, 1:])
    assert list(probe.columns) == [without_unit(title) for title in exported.columns[1:]]
    units = [weld.probes.attrs["units"][name, quantity] for quantity in probe.columns]
    assert units == [title.rstrip("]").partition(" [")[2] for title in exported.columns[1:]]


def test_reports_balance_and_progress_are_those_of_the_exported_tables(
    weld: perimelt.Log, weld_tables: Path
) -> None:
    frames = {"probe-reports": weld.reports, "balance": weld.balance, "progress": weld.progress}
    for name, frame in frames.items():
        exported = table(weld_tables / f"{name}.csv")
        npt.assert_array_equal(frame.index, exported["time [s]"])
        assert frame.shape[1] == exported.shape[1] - 1
        npt.assert_array_equal(frame.to_numpy(), exported.to_numpy()[:, 1:], err_msg=name)
    assert weld.reports.attrs["units"]["goldak.power.asked"] == "W"
    assert weld.progress["sub_steps.thermal"].sum() > 0


def test_a_steady_rod_has_a_linear_temperature(rods: perimelt.Log) -> None:
    state = rods["rod"].state(1.0)
    # cells of 0.01 m, their centres in single precision
    npt.assert_allclose(state.positions[:, 0], 0.01 * (np.arange(10) + 0.5), rtol=1e-7)
    # rounding of single precision at 500 K
    npt.assert_allclose(state["temperature"], 300 + 2000 * state.positions[:, 0], atol=1e-4)


def test_a_free_block_expands_about_its_centre(rods: perimelt.Log) -> None:
    block = rods["block"]
    reference = block.reference_positions
    # 1.5e-5 1/K times 200 K, about the centre of 20 x 10 x 10 mm
    expected = 3e-3 * (reference - np.array([0.01, 0.005, 0.005]))
    state = block.state(1.0)
    npt.assert_allclose(state["displacement"], expected, atol=1e-10)
    # rounding of single precision at 0.02 m
    npt.assert_allclose(state.positions, reference + expected, atol=4e-9)
    npt.assert_allclose(state.positions - state["displacement"], reference, atol=4e-9)
    assert block.field("displacement", 0.0).max() == 0


def test_a_log_tells_what_was_run(weld: perimelt.Log, weld_path: Path) -> None:
    assert weld.path == weld_path
    assert weld.finished
    assert weld.damage == []
    assert weld.case["couplers"][1]["power"] == 1600
    assert weld.case_text.startswith("[case]")
    assert weld.case_name == "weld.toml"
    assert weld.case_folder.name == "cases"
    assert weld.plugins["couplers"][1]["normalise"] is True
    assert weld.started.year >= 2024
    assert "A short weld" in repr(weld)
    npt.assert_allclose(weld.times, np.arange(6) / 10, atol=1e-12)


def test_bodies_are_found_by_name(rods: perimelt.Log) -> None:
    assert list(rods) == ["rod", "block"]
    assert len(rods) == 2
    assert rods.bodies["rod"] is rods["rod"]
    rod = rods.body("rod")
    assert (rod.dimension, rod.points, rod.spacing) == (1, 10, 0.01)
    with pytest.raises(perimelt.UnknownNameError, match="no body `blok`; did you mean `block`"):
        rods["blok"]
    with pytest.raises(perimelt.PerimeltError, match=r"several bodies.*`rod`, `block`"):
        rods.body()


def test_fields_have_units_and_tell_whether_they_are_logged(weld: perimelt.Log) -> None:
    fields = weld.body().fields
    assert fields["stress"].unit == "Pa"
    assert fields["stress"].components == 9
    assert fields["temperature"].logged
    assert not fields["enthalpy"].logged


def test_states_are_read_by_several_threads(weld: perimelt.Log) -> None:
    body = weld.body()
    numbers = list(range(6)) * 20
    with ThreadPoolExecutor(8) as threads:
        means = list(threads.map(lambda number: body.field("stress", number=number).sum(), numbers))
    assert means == [state["stress"].sum() for state in body.states()] * 20


def test_frames_are_copies(weld: perimelt.Log) -> None:
    table = weld.balance
    table.iloc[:, :] = 0.0
    assert weld.balance.to_numpy().any()


def test_a_closed_log_is_not_read(weld_path: Path) -> None:
    with perimelt.open(weld_path) as log:
        body = log.body()
    with pytest.raises(ValueError, match="closed"):
        body.state()
