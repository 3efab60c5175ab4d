"""Points of a regular grid as an array with an axis for each direction."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from ._components import Array
from .errors import PerimeltError

# a point is on the grid if it is nearer than this to the centre of a cell, in spacings
TOLERANCE = 0.05


class Grid:
    """The regular grid on which the points of a body lie in the reference configuration.

        grid = body.grid
        temperature = grid.fill(body.field("temperature", 2.0))      # shape (nx, ny, nz)
        plt.pcolormesh(grid.x, grid.y, temperature[:, :, -1].T)      # the top layer

    The grids of all states of a body have one shape. Where points get or lose material, each state
    has other points: take the grid of the state.

        state = body.state(2.0)
        temperature = state.grid.fill(state["temperature"])          # NaN where nothing is yet

    Attributes:
        x: coordinates of the cell centres along x, m
        y: along y
        z: along z
        cells: cell of each point along x, y and z, shape (n, 3)
    """

    def __init__(
        self, positions: Array, spacing: float, lattice: Mapping[str, Any] | None = None
    ) -> None:
        exact = positions.astype(float)
        self.cells: npt.NDArray[np.intp] = np.empty((0, 3), np.intp)
        counts = np.zeros(3, np.intp)
        start = np.zeros(3)
        if lattice is not None:
            start = np.array(lattice["origin"], dtype=float)
            counts = np.array(lattice["cells"], dtype=np.intp)
        if len(exact) > 0:
            steps = (exact - start) / spacing
            # a window that moves leaves the cells in which it began
            if np.rint(steps).min() < 0 or (np.rint(steps).max(axis=0) >= counts).any():
                start = exact.min(axis=0)
                steps = (exact - start) / spacing
                counts = np.rint(steps).astype(np.intp).max(axis=0) + 1
            self.cells = np.rint(steps).astype(np.intp)
            if np.abs(steps - self.cells).max() > TOLERANCE:
                raise PerimeltError("the points do not lie on one regular grid")
        self.x, self.y, self.z = (
            start[axis] + spacing * np.arange(counts[axis]) for axis in range(3)
        )
        flat = np.ravel_multi_index(tuple(self.cells.T), tuple(counts))
        if len(np.unique(flat)) != len(flat):
            raise PerimeltError("several points lie in one cell of the grid")

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of cells along x, y and z."""
        return (len(self.x), len(self.y), len(self.z))

    def fill(self, values: npt.ArrayLike, empty: float = np.nan) -> npt.NDArray[Any]:
        """Values of points (n, ...) by cell (nx, ny, nz, ...); `empty` where there is no point."""
        of_points = np.asarray(values)
        if len(of_points) != len(self.cells):
            raise PerimeltError(
                f"there are {len(of_points)} values for the {len(self.cells)} points of the grid; "
                "where points get or lose material, each state has its own `state.grid`"
            )
        kind = np.result_type(of_points.dtype, np.float32)
        filled = np.full((*self.shape, *of_points.shape[1:]), empty, dtype=kind)
        i, j, k = self.cells.T
        filled[i, j, k] = of_points
        return filled
