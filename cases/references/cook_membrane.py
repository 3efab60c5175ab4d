"""Cook's membrane of nearly incompressible metal, by finite elements.

    python3 cook_membrane.py [elements along each side]

A panel with the corners (0, 0), (48, 44), (48, 60) and (0, 44) mm in plane strain, E = 240.565 Pa and nu = 0.4999, held at
its left edge; its right edge carries 100 N/m upwards [Cook1974]. Quadrilaterals with the mean dilatation of each
element ([Hughes1980]). Prints the displacement upwards at (47, 59) and (47, 58.5) mm and at the upper right corner, in m; lengths are
counted in m in place of mm. Needs NumPy and SciPy.
"""

import sys

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import spsolve

Array = NDArray[np.float64]

E, POISSONS_RATIO, LOAD = 240.565, 0.4999, 100.0
SHEAR = E / 2 / (1 + POISSONS_RATIO)
BULK = E / 3 / (1 - 2 * POISSONS_RATIO)
CORNERS = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])


def place(s: Array, t: Array) -> Array:
    """Points of the panel by their parts of the way from left to right and from below to above."""
    low, high = 44 * s, 44 + 16 * s
    return np.stack([48 * s, low + t * (high - low)], axis=-1)


def stiffness(corner: Array) -> Array:
    """Stiffness of an element from its corners."""
    strain, weight = [], []
    for at in CORNERS / np.sqrt(3):
        slope = CORNERS * (1 + at * CORNERS)[:, ::-1] / 4
        jacobian = slope.T @ corner
        by_place = slope @ np.linalg.inv(jacobian).T
        local = np.zeros((4, 8))
        local[0, 0::2], local[1, 1::2] = by_place.T
        local[3, 0::2], local[3, 1::2] = by_place[:, 1], by_place[:, 0]
        strain.append(local)
        weight.append(np.linalg.det(jacobian))
    local, area = np.array(strain), np.array(weight)
    dilatation = local[:, :3].sum(1)
    mean = area @ dilatation / area.sum()
    local[:, :3] -= dilatation[:, None] / 3
    deviatoric = 2 * SHEAR * np.diag([1, 1, 1, 0.5])
    return np.einsum("gak,ab,gbl,g->kl", local, deviatoric, local, area) + BULK * area.sum() * np.outer(mean, mean)


def solve(n: int) -> Array:
    """Displacement of the nodes by rows."""
    s, t = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1))
    position = place(s, t).reshape(-1, 2)
    row, column = np.divmod(np.arange(n * n), n)
    first = row * (n + 1) + column
    nodes = np.stack([first, first + 1, first + n + 2, first + n + 1], axis=1)
    freedoms = (2 * nodes[:, :, None] + np.arange(2)).reshape(-1, 8)
    values = np.array([stiffness(position[element]) for element in nodes])
    rows, columns = np.repeat(freedoms, 8, axis=1), np.tile(freedoms, 8)
    matrix = csr_matrix((values.ravel(), (rows.ravel(), columns.ravel())))
    force = np.zeros(position.size)
    right = np.arange(n, (n + 1) ** 2, n + 1)
    force[2 * right + 1] = LOAD / n
    force[2 * right[[0, -1]] + 1] /= 2
    free = np.flatnonzero((position[:, 0] > 0).repeat(2))
    u = np.zeros(position.size)
    u[free] = spsolve(matrix[free][:, free].tocsc(), force[free])
    return u.reshape(n + 1, n + 1, 2)


def interpolated(u: Array, abscissa: float, height: float) -> float:
    """Value at a place between the nodes."""
    n = len(u) - 1
    s = abscissa / 48
    along, up = s * n, (height - 44 * s) / (44 - 28 * s) * n
    i, j = min(int(along), n - 1), min(int(up), n - 1)
    x, y = along - i, up - j
    return float((1 - y) * ((1 - x) * u[j, i] + x * u[j, i + 1]) + y * ((1 - x) * u[j + 1, i] + x * u[j + 1, i + 1]))


def main(n: str = "64") -> None:
    """Prints the displacements."""
    u = solve(int(n))[:, :, 1]
    for height in (59, 58.5):
        print(f"{n} x {n} elements: {interpolated(u, 47, height):.4f} m at (47, {height})")
    print(f"{n} x {n} elements: {u[-1, -1]:.4f} m at the corner")


if __name__ == "__main__":
    main(*sys.argv[1:])
