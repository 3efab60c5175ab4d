"""Changes of cases."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import perimelt
from conftest import CASES
from perimelt._case import case_text, parse


@pytest.fixture
def case() -> dict[str, Any]:
    return perimelt.read_case(CASES / "weld.toml")


def test_paths_go_through_tables_and_lists(case: dict[str, Any]) -> None:
    original = parse(case_text(case), "copy")
    changed = perimelt.change_case(
        case,
        {
            "time.end": 2,
            "time.step": 0.01,
            "couplers.goldak.toolpath.line.speed": 0.04,
            "couplers.0.form": "enthalpy",
            "couplers.-1.region": "other",
            "probes.melt pool.kind.melt_pool.isotherm": 1700,
            ("probes", "beside", "kind", "point", 2): 0.003,
            "log.precision": None,
            "run.new.section": True,
        },
    )
    assert case == original
    assert changed["time"] == {"end": 2, "step": 0.01}
    assert changed["couplers"][1]["toolpath"]["line"]["speed"] == 0.04
    assert changed["couplers"][0]["form"] == "enthalpy"
    assert changed["couplers"][3]["region"] == "other"
    assert changed["probes"][1]["kind"]["melt_pool"] == {"isotherm": 1700}
    assert changed["probes"][0]["kind"]["point"] == [0.0085, 0.0065, 0.003]
    assert changed["log"] == {"interval": 0.1}
    assert changed["run"] == {"new": {"section": True}}


def test_entries_of_lists_are_replaced_and_removed(case: dict[str, Any]) -> None:
    changed = perimelt.change_case(
        case, {"couplers.clamp": None, "couplers.0": {"type": "gravity"}}
    )
    assert [entry["type"] for entry in changed["couplers"]] == [
        "gravity",
        "goldak",
        "thermal_expansion",
    ]


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("couplers.goldac.power", "no entry of `couplers` `goldac`; did you mean `goldak`"),
        ("couplers.7.power", "`couplers` has 4 entries; there is no `couplers.7`"),
        ("probes.kind", "no entry of `probes` `kind`"),
        ("time.end.x", "`time.end` is 0.5, which has no key `x`"),
        ("time.end.x.y", "`time.end` is 0.5, which has no key `x`"),
        ("time..end", "is not a path"),
        ("", "is not a path"),
    ],
)
def test_a_path_that_leads_nowhere_is_refused(
    case: dict[str, Any], path: str, message: str
) -> None:
    with pytest.raises(perimelt.PerimeltError, match=message):
        perimelt.change_case(case, {path: 1})


def test_a_name_of_several_entries_is_refused(case: dict[str, Any]) -> None:
    case["couplers"].append({"type": "clamp", "region": "b"})
    with pytest.raises(perimelt.CaseError, match=r"`couplers\.3` and `couplers\.4`"):
        perimelt.change_case(case, {"couplers.clamp.region": "c"})


def test_values_of_numpy_are_written(case: dict[str, Any]) -> None:
    changed = perimelt.change_case(
        case,
        {"time.end": np.float32(0.5), "n": np.int64(3), "a": np.arange(2.0), "p": Path("x.csv")},
    )
    read = parse(case_text(changed), "written")
    assert (read["time"]["end"], read["n"], read["a"], read["p"]) == (0.5, 3, [0.0, 1.0], "x.csv")
    with pytest.raises(perimelt.CaseError, match=r"`time\.end` is 1j; expected"):
        case_text(perimelt.change_case(case, {"time.end": 1j}))


def test_a_file_that_is_no_case_is_named(tmp_path: Path) -> None:
    (tmp_path / "bad.toml").write_text("[case")
    with pytest.raises(perimelt.CaseError, match=r"bad\.toml is not TOML"):
        perimelt.read_case(tmp_path / "bad.toml")
    with pytest.raises(perimelt.CaseError, match="cannot read the case"):
        perimelt.read_case(tmp_path / "none.toml")
