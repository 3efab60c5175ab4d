"""Displacement of a plate heated by a moving Gaussian, by linear bonds, for the case `wang-7.5.5.2-gauss-phase-D`.

    python3 gaussian_plate_bbpd.py

Half of the plate of `gaussian_plate_thermomech.py` on a lattice of 0.4 mm with a horizon of three spacings, mirrored
at the path, free edges without correction, partial volumes of the rule `half` (or `none`). Bonds of [Wang2025] eq.
7.15 without large rotations, c = 9 E / (pi h delta^3) with the mean modulus of both ends (eq. 7.14) and the stretch
alpha (T + T') / 2 free of force; equilibrium by a sparse direct solution, zero mean u_x. Temperatures are those of
`gaussian_plate_thermomech.py` with cells of 0.2 mm, interpolated linearly.

Prints u_x (m) of the points next to the path (y = 0.2 mm). About a minute. Needs NumPy and SciPy.
"""

import gaussian_plate_thermomech as plate
import numpy as np
from numpy.typing import NDArray
from pd_lattice_constants import family
from scipy.interpolate import RegularGridInterpolator
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import spsolve

Array = NDArray[np.float64]

SPACING, HORIZON = 4e-4, 3  # m, spacings
COLUMNS, ROWS = 250, 125
POINTS = (-49.8, -30.2, -10.2, -5.0, -3.0, 4.2, 5.0, 10.2, 30.2, 49.8)  # mm


def displacements(temperature: Array, modulus: Array, rule: str) -> Array:
    """u_x of the points, m."""
    offsets, distances, volumes = family(HORIZON, 2, rule)
    column, row = (a.ravel() for a in np.meshgrid(np.arange(COLUMNS), np.arange(ROWS), indexing="ij"))
    temperature, modulus = temperature.ravel(), modulus.ravel()
    number = 2 * COLUMNS * ROWS
    rows, columns, entries = [], [], []
    force = np.zeros(number)
    for offset, distance, volume in zip(offsets, distances * SPACING, volumes):
        a, b = column + offset[0], row + offset[1]
        is_image = b < 0
        b = np.where(is_image, -1 - b, b)
        inside = (a >= 0) & (a < COLUMNS) & (b < ROWS)
        own, other = (column * ROWS + row)[inside], a[inside] * ROWS + b[inside]
        direction = offset * SPACING / distance
        mean = 0.5 * (modulus[own] + modulus[other])
        constant = 9 / (np.pi * (HORIZON * SPACING) ** 3) * mean * volume * SPACING**2
        # the image of a point moves by u_x and -u_y
        sign = np.where(is_image[inside], -1.0, 1.0)
        for i in (0, 1):
            stretch = plate.EXPANSION * 0.5 * (temperature[own] + temperature[other])
            np.add.at(force, 2 * own + i, constant * stretch * direction[i])
            for j in (0, 1):
                stiffness = constant / distance * direction[i] * direction[j]
                rows += [2 * own + i, 2 * own + i]
                columns += [2 * other + j, 2 * own + j]
                entries += [stiffness * (sign if j else 1.0), -stiffness]
    indices = (np.concatenate(rows), np.concatenate(columns))
    matrix = coo_matrix((np.concatenate(entries), indices), shape=(number, number)).tocsc()
    u = np.zeros(number)
    # one point does not move along x
    u[1:] = spsolve(matrix[1:][:, 1:], force[1:])
    u_x = u[0::2].reshape(COLUMNS, ROWS)
    return u_x - u_x.mean()


def values() -> dict[str, float]:
    """u_x of the variant D, m."""
    edges = plate.grid(2e-4)
    centres = tuple(0.5 * (e[1:] + e[:-1]) for e in edges)
    x, y = (np.arange(COLUMNS) - (COLUMNS - 1) / 2) * SPACING, (np.arange(ROWS) + 0.5) * SPACING
    of_cells = plate.temperatures(edges, 2.5e-3, True)
    at = RegularGridInterpolator(centres, of_cells, bounds_error=False, fill_value=None)
    temperature = at(np.stack(np.meshgrid(x, y, indexing="ij"), -1))
    modulus = plate.moduli(temperature, True)
    found = {}
    for rule in ("half", "none"):
        u_x = displacements(temperature, modulus, rule)[:, 0]
        for mm in POINTS:
            point = int(np.argmin(np.abs(x - mm / 1000)))
            found[f"{rule}: u_x at x = {mm} mm, m"] = float(u_x[point])
    return found


if __name__ == "__main__":
    for name, value in values().items():
        print(f"{name} {value:.4g}")
