"""Steady temperature of a plate with an insulated crack by bonds: the error of the cases `wang-6.4.3.1-*`.

    python3 crack_pd_steady.py

A quarter of the plate of `insulated_crack_plate.py` on a lattice of 0.1 mm with horizons of n spacings. Bonds that
meet the crack are cut, without a correction beside it; layers behind the upper edge are odd about its temperature,
those behind the sides even, and the lower half is odd. Steady temperatures do not depend on the calibration. Prints
the temperature of the point above the middle of the crack, and the largest error on x = 0 (K of 100 K). About a
minute. Needs NumPy and SciPy."""

import numpy as np
from insulated_crack_plate import steady
from numpy.typing import NDArray
from pd_lattice_constants import family
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import spsolve

Array = NDArray[np.float64]

POINTS, WALL = 100, 100.0  # along a side of the quarter, degrees


def solve(horizon: int, rule: str) -> tuple[Array, Array]:
    """Heights of the points (cm), and temperatures of the column next to x = 0."""
    size = 1.0 / POINTS
    column, row = (a.ravel() for a in np.meshgrid(np.arange(POINTS), np.arange(POINTS), indexing="ij"))
    rows, columns, entries = [], [], []
    supplied = np.zeros(POINTS**2)
    for (dx, dy), distance, volume in zip(*family(horizon, 2, rule)):
        weight = volume / distance
        a, b = column + dx, row + dy
        y_own, y_other = (row + 0.5) * size, (b + 0.5) * size
        crosses = y_own * y_other < 0
        part = np.where(crosses, y_own / np.where(crosses, y_own - y_other, 1.0), 0.0)
        at = (column + 0.5 + part * dx) * size
        kept = ~(crosses & (np.abs(at) < 0.5 - 1e-12))
        own, a, b = (column * POINTS + row)[kept], a[kept], b[kept]
        a = np.where(a < 0, -1 - a, np.where(a >= POINTS, 2 * POINTS - 1 - a, a))
        sign, added = np.ones(len(own)), np.zeros(len(own))
        sign[b < 0] = -1.0
        b = np.where(b < 0, -1 - b, b)
        sign[b >= POINTS], added[b >= POINTS] = -1.0, 2 * WALL
        b = np.where(b >= POINTS, 2 * POINTS - 1 - b, b)
        rows += [own, own]
        columns += [a * POINTS + b, own]
        entries += [weight * sign, np.full(len(own), -weight)]
        np.add.at(supplied, own, weight * added)
    indices = (np.concatenate(rows), np.concatenate(columns))
    matrix = coo_matrix((np.concatenate(entries), indices), shape=(POINTS**2, POINTS**2)).tocsc()
    temperature = spsolve(matrix, -supplied).reshape(POINTS, POINTS)
    return (np.arange(POINTS) + 0.5) * size, temperature[0]


def values() -> dict[str, float]:
    """Temperatures (degrees) and largest errors (K)."""
    found = {}
    for horizon in range(1, 6):
        y, temperature = solve(horizon, "half")
        exact = np.array([steady(float(height)) for height in y[::10]])
        found[f"n = {horizon}: temperature above the crack"] = float(temperature[0])
        found[f"n = {horizon}: largest error, K"] = float(np.abs(temperature[::10] - exact).max())
    return found


if __name__ == "__main__":
    for name, value in values().items():
        print(f"{name} {value:.4f}")
