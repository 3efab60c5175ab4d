"""A body of a run, through all its logged states."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
from typing import Any, SupportsFloat

import numpy as np
import numpy.typing as npt
import pandas as pd

from ._cloud import decode
from ._components import Array, of_components
from ._file import LogFile, points_topic
from ._grid import Grid
from ._series import frame
from ._state import Defined, Field, State
from .errors import DamagedError, DamageWarning, NoStateError, PerimeltError, UnknownNameError

# A time is that of a state if it differs by less than this fraction of the logged time: printed
# times have fewer digits. The command line has the same limit.
TIME_SLACK = 1e-4


class Body:
    """A body of a run.

    Attributes:
        name: name in the case
        dimension: 1, 2 or 3
        spacing: smallest distance between neighbouring points, m
        thickness: extent across the plane of a two-dimensional body, m
        points: number of points
        symmetry: faces that are planes of symmetry, such as `y-`: the body is a part of the whole
        lattice: `origin` (centre of the first cell, m), `spacing` and `cells` of the regular grid
            of the body; None where it has none, or where an older version wrote the log
        times: times of the logged states, s
        defined: fields that `define` added
    """

    def __init__(self, file: LogFile, info: Mapping[str, Any]) -> None:
        self._file = file
        self._topic = points_topic(info["name"])
        self._infos: list[dict[str, Any]] = info["fields"]
        self.name: str = info["name"]
        self.dimension: int = info["dimension"]
        self.spacing: float = info["spacing"]
        self.thickness: float = info["thickness"]
        self.points: int = info["points"]
        self.symmetry: tuple[str, ...] = tuple(info.get("symmetry", ()))
        self.lattice: dict[str, Any] | None = info.get("lattice")
        log_times = (place.log_time for place in file.large.get(self._topic, ()))
        self.times: npt.NDArray[np.float64] = np.array(
            [file.exact.get((self._topic, time), time * 1e-9) for time in log_times], dtype=float
        )
        self.defined: dict[str, Defined] = {}

    def __repr__(self) -> str:
        return (
            f"<Body {self.name}: {self.points} points, {self.dimension}D, spacing "
            f"{self.spacing:.6g} m, {len(self.times)} states>"
        )

    @property
    def fields(self) -> dict[str, Field]:
        """The fields by name, with their units; those with `logged` are in the states."""
        fields = {}
        for info in self._infos:
            fields[info["name"]] = Field(
                info["name"],
                info["unit"],
                info["components"],
                info.get("meaning", ""),
                info["name"] in self._logged,
            )
        return fields | {name: defined.field for name, defined in self.defined.items()}

    @property
    def unlogged(self) -> list[str]:
        """Names of the fields that the states do not have."""
        names = (info["name"] for info in self._infos)
        return [name for name in names if name not in self._logged]

    @cached_property
    def _logged(self) -> list[str]:
        first = next(self.states(), None)
        return [] if first is None else first.logged

    def unit(self, name: str) -> str:
        """SI unit of a field or of a component, such as `stress.xx`."""
        fields = self.fields
        field = fields.get(name) or fields.get(name.rpartition(".")[0])
        if field is None:
            raise UnknownNameError("field", name, fields)
        return field.unit

    # States

    def state(
        self,
        time: float | None = None,
        *,
        number: int | None = None,
        nearest: bool = False,
    ) -> State:
        """The state at a logged time, s, or that with a number; the last one without either.

        Args:
            time: time of a state, s
            number: number of the state, from 0; negative numbers count from the last one
            nearest: take the state nearest to a time between two states; else it is an error

        Raises:
            NoStateError: there is no such state
            DamagedError: the state is damaged
        """
        number = self._number(time, number, nearest)
        at = float(self.times[number])
        try:
            places = self._file.parts(self._topic, number)
            parts = [decode(self._file.message(place)) for place in places]
        except DamagedError as error:
            what = f"the state of `{self.name}` at {at:.6g} s"
            raise DamagedError(error.offset, error.reason, what) from error
        return State(self, number, at, parts)

    def states(
        self, since: float | None = None, until: float | None = None, *, every: int = 1
    ) -> Iterator[State]:
        """The states one after the other; each is read when the loop comes to it.

        Damaged states are left out with a `DamageWarning`.

        Args:
            since: earliest time, s
            until: latest time, s
            every: take every n-th state only
        """
        for number in range(0, len(self.times), every):
            after = since is None or self.times[number] >= since
            before = until is None or self.times[number] <= until
            if not (after and before):
                continue
            try:
                state = self.state(number=number)
            except DamagedError as error:
                warnings.warn(f"a state is left out: {error}", DamageWarning, stacklevel=2)
                continue
            yield state

    def _number(self, time: float | None, number: int | None, nearest: bool) -> int:
        count = len(self.times)
        if count == 0:
            raise NoStateError(f"the log has no state of `{self.name}`")
        if time is not None and number is not None:
            raise NoStateError("give `time` or `number`, not both")
        if time is None:
            number = count - 1 if number is None else number
            if not -count <= number < count:
                raise NoStateError(f"there is no state {number}; the log has {count}, from 0")
            return number % count
        first, last = float(self.times[0]), float(self.times[-1])
        found = int(np.argmin(np.abs(self.times - time)))
        slack = TIME_SLACK * (last - first)
        if not first - slack <= time <= last + slack:
            raise NoStateError(
                f"there is no state at {time:.9g} s; "
                f"the logged times are {first:.9g} to {last:.9g} s"
            )
        if not nearest and abs(self.times[found] - time) > slack:
            at = int(np.searchsorted(self.times, time))
            raise NoStateError(
                f"there is no state at {time:.9g} s; the logged times beside it are "
                f"{self.times[at - 1]:.9g} and {self.times[at]:.9g} s; "
                "`nearest=True` takes the nearer one"
            )
        return found

    # Fields

    def field(
        self,
        name: str,
        time: float | None = None,
        *,
        number: int | None = None,
        nearest: bool = False,
    ) -> Array:
        """Values of a field, or of a component of it, at a time; see `state` and `State`.

        To read several fields of one time, take its `state`: the points are unpacked once.
        """
        return self.state(time, number=number, nearest=nearest)[name]

    def positions(
        self, time: float | None = None, *, number: int | None = None, nearest: bool = False
    ) -> Array:
        """Current positions at a time, m, shape (n, 3); see `state`."""
        return self.state(time, number=number, nearest=nearest).positions

    @cached_property
    def reference_positions(self) -> Array:
        """Positions of the undeformed body, m, shape (n, 3): those of the first state.

        Where points get or lose material, each state has its own: `state.reference_positions`.
        """
        return self._first.reference_positions

    @cached_property
    def _first(self) -> State:
        first = next(self.states(), None)
        if first is None:
            raise NoStateError(f"the log has no sound state of `{self.name}`")
        return first

    @cached_property
    def grid(self) -> Grid:
        """The regular grid of the points, to have fields as arrays of (nx, ny, nz).

        It is that of the first state. Where points get or lose material, each state has its own, of
        the same shape: `state.grid`.

        Raises:
            PerimeltError: the points have several spacings or lie on no grid
        """
        return self._first.grid

    @cached_property
    def cells(self) -> Mapping[str, Any] | None:
        """`origin` and `cells` of the grid of all states: `lattice`, or the extent of the points.

        Without `lattice` it is the extent of the points of the first and of the last state.
        """
        if self.lattice is not None:
            return self.lattice
        ends = [state.reference_positions for state in (self._first, self.state())]
        points = np.concatenate(ends).astype(float)
        if len(points) == 0:
            return None
        start = points.min(axis=0)
        steps = np.rint((points.max(axis=0) - start) / self.spacing).astype(int)
        return {"origin": start.tolist(), "cells": (steps + 1).tolist()}

    def nearest(self, position: npt.ArrayLike) -> int:
        """Number of the point whose reference position is nearest to a position, m.

        Where points are added or removed, numbers change: this is that of the first state.
        """
        return self._first.nearest(position)

    def history(self, name: str, point: int | npt.ArrayLike, *, every: int = 1) -> pd.DataFrame:
        """A field at one point over all logged times.

        Reads all states. A probe of the case has the same and is in the log at once.

        Args:
            name: field or component
            point: number of the point, or a position (m): the point nearest to it in the reference
                configuration is taken; its number and position in the last state are in `attrs`.
                States before a point is added there have no row.
            every: take every n-th state only

        Returns:
            A column for a scalar, one for each component of a vector or tensor.
        """
        number = int(point) if isinstance(point, (int, np.integer)) else None
        if number is not None and not -self.points <= number < self.points:
            raise PerimeltError(f"there is no point {number}; `{self.name}` has {self.points}")
        times: list[float] = []
        columns: dict[str, list[float]] = {}
        found, place = 0, np.zeros(3)
        # where points are added, another one is nearest before
        ends = [] if number is not None else [self._first, self.state()]
        distances = (1.001 * state.nearest_with_distance(point)[1] for state in ends)
        reach = max(self.spacing, min(distances, default=np.inf))
        for state in self.states(every=every):
            if number is None:
                nearest, distance = state.nearest_with_distance(point)
                if distance > reach:
                    continue
                found = nearest
            else:
                found = number % state.points
            place = state.reference_positions[found]
            times.append(state.time)
            for column, value in _by_component(name, state[name][found : found + 1]):
                columns.setdefault(column, []).append(float(value[0]))
        table = frame(times, columns, dict.fromkeys(columns, self.unit(name)))
        table.attrs["point"] = found
        table.attrs["position"] = tuple(map(float, place))
        return table

    # What is computed from the log

    def define(
        self,
        name: str,
        function: Callable[[State], npt.ArrayLike],
        *,
        unit: str = "",
        meaning: str = "",
    ) -> None:
        """Adds a field that is computed from others when it is read.

        `state[name]`, `field`, `history` and other defined fields then know it:

            body.define("superheat", lambda state: state["temperature"] - 1773, unit="K")

        Args:
            name: name of the field, not that of a logged one
            function: gives a number, vector (3) or tensor (3, 3) for each point of a state
            unit: SI unit
            meaning: what it is
        """
        if name in self._logged:
            raise PerimeltError(f"`{name}` is a logged field; give the defined one another name")
        first = next(self.states(), None)
        trial = Defined(Field(name, unit, 1, meaning), function)
        values = np.empty(0) if first is None else first.computed(trial)
        components = int(np.prod(values.shape[1:]))
        self.defined[name] = Defined(Field(name, unit, components, meaning), function)

    def compute(
        self,
        *,
        every: int = 1,
        units: Mapping[str, str] | None = None,
        **functions: Callable[[State], SupportsFloat],
    ) -> pd.DataFrame:
        """Numbers of each state over all logged times, as a probe would log them.

        All functions see a state while it is in memory:

            body.compute(
                peak=lambda state: state["temperature"].max(),
                molten=lambda state: (state["temperature"] > 1723).mean(),
                units={"peak": "K"},
            )

        Args:
            every: take every n-th state only
            units: SI units by name, for `attrs["units"]`
            functions: numbers of a state, by the name of their column
        """
        times: list[float] = []
        columns: dict[str, list[float]] = {name: [] for name in functions}
        for state in self.states(every=every):
            times.append(state.time)
            for name, function in functions.items():
                value = np.asarray(function(state))
                if value.ndim != 0:
                    raise PerimeltError(
                        f"`{name}` gives an array of shape {value.shape}, expected one number; "
                        "`define` takes functions that give fields"
                    )
                columns[name].append(float(value))
        return frame(times, columns, {name: (units or {}).get(name, "") for name in columns})


def _by_component(name: str, values: Array) -> Iterator[tuple[str, Array]]:
    """Names and values of the entries of a field; the field itself if it is a scalar."""
    components = int(np.prod(values.shape[1:]))
    if components == 1:
        yield name, values
        return
    for component, of in of_components(components).items():
        if component in ("x", "y", "z") or (len(component) == 2 and set(component) <= set("xyz")):
            yield f"{name}.{component}", of(values)
