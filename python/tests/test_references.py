"""The programs that computed reference values give the numbers of the cases."""

from __future__ import annotations

import importlib.util
import sys
from decimal import Decimal
from pathlib import Path

import pytest

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

CASES = Path(__file__).parents[2] / "cases"

# those that take seconds
FAST = (
    "closed_forms",
    "diffusion_series",
    "orthotropic",
    "thermoelastic_bar",
    "thermoelastic_waves",
    "two_bodies",
)


def references(program: str) -> dict[str, list[float]]:
    """Reference values of the checks that cite a program, by case and quantity."""
    found = {}
    cited = f"cases/references/{program}.py"
    for path in CASES.rglob("*.toml"):
        text = path.read_text(encoding="utf-8")
        if cited not in text:
            continue
        for check in tomllib.loads(text).get("verify", []):
            if cited in check["source"]:
                given = check["reference"]
                numbers = given if isinstance(given, list) else [given]
                found[f"{path.stem}: {check['quantity']}"] = numbers
    return found


def unit_of_last_digit(number: float) -> float:
    exponent = Decimal(repr(number)).as_tuple().exponent
    assert isinstance(exponent, int)
    return float(Decimal(1).scaleb(exponent))


@pytest.mark.parametrize("program", FAST)
def test_programs_give_the_references_of_the_cases(program: str) -> None:
    spec = importlib.util.spec_from_file_location(program, CASES / f"references/{program}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    values: list[float] = list(module.values().values())
    cited = references(program)
    assert cited, "checks cite the program"
    for check, numbers in cited.items():
        for number in numbers:
            # cases hold four digits and more
            tolerance = max(1e-3 * abs(number), unit_of_last_digit(number))
            assert any(abs(value - number) <= tolerance for value in values), f"{check}: {number}"
