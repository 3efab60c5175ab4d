"""Logs of Perimelt runs as NumPy arrays and pandas frames.

    import perimelt

    log = perimelt.open("weld.mcap")
    log.times                                      # of the logged states, s
    log.probes["melt pool"]["width"]               # pandas
    plate = log["plate"]
    plate.field("temperature", 2.0)                # NumPy, one value for each point
    plate.field("stress.von_mises")                # at the last state
    plate.compute(peak=lambda state: state["temperature"].max())

    hot = perimelt.run("weld.toml", {"couplers.goldak.power": 3000}, out="hot.mcap")

States are read from the file when they are asked for. All values are in SI units.
"""

from __future__ import annotations

import os

from ._body import Body
from ._case import change_case, read_case
from ._components import Array, hydrostatic, magnitude, principal, von_mises
from ._file import Damage
from ._follow import follow
from ._grid import Grid
from ._log import Log
from ._run import find_program, resume, run, summary
from ._state import Field, State
from .errors import (
    CaseError,
    DamagedError,
    DamageWarning,
    LogError,
    NoStateError,
    PerimeltError,
    RunError,
    UnknownNameError,
)

__version__ = "0.1.0"


def open(path: str | os.PathLike[str]) -> Log:  # noqa: A001 - `perimelt.open` says what it does
    """Opens the log of a run, finished or not."""
    return Log(path)


__all__ = [
    "Array",
    "Body",
    "CaseError",
    "Damage",
    "DamageWarning",
    "DamagedError",
    "Field",
    "Grid",
    "Log",
    "LogError",
    "NoStateError",
    "PerimeltError",
    "RunError",
    "State",
    "UnknownNameError",
    "change_case",
    "find_program",
    "follow",
    "hydrostatic",
    "magnitude",
    "open",
    "principal",
    "read_case",
    "resume",
    "run",
    "summary",
    "von_mises",
]
