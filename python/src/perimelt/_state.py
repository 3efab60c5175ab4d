"""One body at one time."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ._cloud import POSITIONS
from ._components import Array, of_components
from ._grid import Grid
from .errors import LogError, PerimeltError, UnknownNameError

if TYPE_CHECKING:
    from ._body import Body


@dataclass(frozen=True)
class Field:
    """A field of a body.

    Attributes:
        name: name, such as `temperature`
        unit: SI unit
        components: 1 (scalar), 3 (vector) or 9 (tensor)
        meaning: what it is; empty where the log does not say
        logged: whether the states have it; others are in checkpoints only
    """

    name: str
    unit: str
    components: int
    meaning: str = ""
    logged: bool = True


@dataclass(frozen=True)
class Defined:
    """A field computed from others by a function of the state."""

    field: Field
    function: Callable[[State], npt.ArrayLike]


class State(Mapping[str, Array]):
    """One body at one time: a mapping from the names of fields to their values.

    Values have one entry for each point: scalars (n,), vectors (n, 3), tensors (n, 3, 3) with row
    and column. Their precision is that of the log, float32 unless the case has `log.precision =
    "f64"`. Each access gives a new array. A component is part of the name: `displacement.x`,
    `displacement.magnitude`, `stress.xy`, `stress.von_mises`, `stress.principal_1`.

    Attributes:
        body: the body
        number: number of the state, from 0
        time: simulated time, s
    """

    def __init__(
        self, body: Body, number: int, time: float, parts: Sequence[npt.NDArray[np.void]]
    ) -> None:
        self.body = body
        self.number = number
        self.time = time
        # the points, in the parts into which a large state is split
        self._parts = parts
        self._logged = [name for name in parts[0].dtype.names or () if name != POSITIONS]
        if any(part.dtype != parts[0].dtype for part in parts):
            raise LogError("the parts of a state have different fields")

    @property
    def points(self) -> int:
        """Number of points."""
        return sum(len(part) for part in self._parts)

    @cached_property
    def positions(self) -> Array:
        """Current positions, m, shape (n, 3)."""
        return self._values(POSITIONS)

    @cached_property
    def reference_positions(self) -> Array:
        """Positions without the displacements, m, shape (n, 3).

        Those of all states are equal unless points get or lose material. Precision as logged. Where
        the displacements are not logged, they are the positions of the first state.
        """
        positions = self.positions
        if "displacement" in self.logged:
            positions = positions - self["displacement"]
        elif "displacement" in self.body.unlogged and self.number > 0:
            first = self.body.reference_positions
            positions = first if len(first) == self.points else positions
        positions.flags.writeable = False
        return positions

    @cached_property
    def grid(self) -> Grid:
        """The regular grid of the points of this state; those of all states have one shape.

        Raises:
            PerimeltError: the points have several spacings or lie on no grid
        """
        return Grid(self.reference_positions, self.body.spacing, self.body.cells)

    def nearest(self, position: npt.ArrayLike) -> int:
        """Number of the point whose reference position is nearest to a position, m."""
        return self.nearest_with_distance(position)[0]

    def nearest_with_distance(self, position: npt.ArrayLike) -> tuple[int, float]:
        """Number of that point, and its distance from the position, m."""
        wanted = np.asarray(position, dtype=float)
        if wanted.shape != (3,):
            raise PerimeltError(f"a position is three numbers, x, y and z in m, not {position!r}")
        distances = np.linalg.norm(self.reference_positions - wanted, axis=1)
        found = int(np.argmin(distances))
        return found, float(distances[found])

    @property
    def logged(self) -> list[str]:
        """Names of the fields that are in the log, without those that were defined."""
        return list(self._logged)

    def __getitem__(self, name: str) -> Array:
        defined = self.body.defined.get(name)
        if defined is not None:
            return self.computed(defined)
        if name in self._logged:
            return self._values(name)
        base, dot, component = name.rpartition(".")
        if dot and base in self:
            values = self[base]
            scalars = of_components(int(np.prod(values.shape[1:])))
            if component in scalars:
                return scalars[component](values)
            raise UnknownNameError(f"component of `{base}`", component, scalars)
        if name in self.body.unlogged:
            note = f"; `{name}` is a field of the run, add it to `log.fields` of the case"
            raise UnknownNameError("logged field", name, self, note)
        raise UnknownNameError("field", name, self)

    def __contains__(self, name: object) -> bool:
        return name in self._logged or name in self.body.defined

    def __iter__(self) -> Iterator[str]:
        yield from self._logged
        yield from (name for name in self.body.defined if name not in self._logged)

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def __repr__(self) -> str:
        fields = ", ".join(self)
        return f"<State {self.number} of {self.body.name}: t = {self.time:.6g} s, {fields}>"

    def _values(self, key: str) -> Array:
        parts = [part[key] for part in self._parts]
        if parts[0].ndim == 3:
            # packed column by column
            parts = [part.swapaxes(1, 2) for part in parts]
        joined: Array = np.concatenate(parts) if len(parts) > 1 else parts[0]
        return np.array(joined, order="C")

    def computed(self, defined: Defined) -> Array:
        """Values of a field that is computed from others."""
        values: Array = np.asarray(defined.function(self))
        name = defined.field.name
        if values.dtype.kind in "bui":
            values = values.astype(float)
        if values.dtype.kind != "f":
            raise PerimeltError(
                f"the field `{name}` has values of type {values.dtype}, not numbers"
            )
        if values.shape not in ((self.points,), (self.points, 3), (self.points, 3, 3)):
            raise PerimeltError(
                f"the field `{name}` has the shape {values.shape}; expected one number, vector (3) "
                f"or tensor (3, 3) for each of {self.points} points"
            )
        return values
