"""Time series as pandas frames."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import pandas as pd

TIME = "time"


def frame(
    times: Sequence[float],
    columns: Mapping[str, Sequence[float]],
    units: Mapping[str, str],
) -> pd.DataFrame:
    """A frame with the times (s) as its index and the units in `attrs["units"]`."""
    index = pd.Index(times, name=TIME, dtype=float)
    table = pd.DataFrame(dict(columns), index=index)
    table.attrs["units"] = {TIME: "s", **units}
    return table


def series(messages: Iterable[bytes], columns: Sequence[tuple[str, str]]) -> pd.DataFrame:
    """The frame of a time series; what was not finite is NaN."""
    times: list[float] = []
    values: dict[str, list[float]] = {name: [] for name, _ in columns}
    for message in messages:
        row = json.loads(message)
        times.append(row[TIME])
        for name, column in values.items():
            value = row.get(name)
            column.append(float("nan") if value is None else value)
    return frame(times, values, dict(columns))


def progress(messages: Iterable[bytes]) -> pd.DataFrame:
    """Steps, cost and wall time, with columns such as `sub_steps.thermal` for each physics."""
    rows: list[dict[str, Any]] = []
    for message in messages:
        row: dict[str, Any] = {}
        for key, value in json.loads(message).items():
            if isinstance(value, dict):
                row.update({f"{key}.{name}": count for name, count in value.items()})
            else:
                row[key] = value
        rows.append(row)
    columns = sorted({key for row in rows for key in row} or {TIME}, key=_order)
    table = pd.DataFrame(rows, columns=columns).set_index(TIME)
    table.attrs["units"] = {TIME: "s", "step_size": "s", "wall_seconds": "s"}
    return table


def _order(column: str) -> tuple[int, str]:
    """The order of the columns of `progress`, which is that of exported tables."""
    order = (TIME, "step", "step_size", "sub_steps", "iterations", "evaluations", "coupling_passes")
    key = column.partition(".")[0]
    return (order.index(key) if key in order else len(order), column)


def side_by_side(tables: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Frames as one, with two levels of columns: the name of the frame, then its own columns."""
    units = {
        (name, column): unit
        for name, table in tables.items()
        for column, unit in table.attrs["units"].items()
        if column != TIME
    }
    if not tables:
        return frame([], {}, {})
    # rows of a damaged chunk are missing in some of the frames
    table = pd.concat(dict(tables), axis="columns", names=["probe", "quantity"]).sort_index()
    table.attrs["units"] = {TIME: "s", **units}
    return table
