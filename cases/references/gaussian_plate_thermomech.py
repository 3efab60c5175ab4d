"""A moving Gaussian source on a plate that melts and expands, for the cases `wang-7.5.5.*`.

    python3 gaussian_plate_thermomech.py [size in mm]

Half of the plate of [Wang2025] 7.5.5 (100 x 100 x 10 mm) beside the path of the source, at 0.08 s. Cells of one size
from x = -6 to 8 mm and to 6 mm beside the path, growing by 12 % outwards. Temperatures by explicit finite volumes for
the enthalpy in steps of 20 microseconds, with the exact power in each cell and the flux spread over a depth; latent
heat of 260 kJ/kg between 1385 and 1450 degrees Celsius without sensible heat in the interval, or none. Displacements
in equilibrium by bilinear elements of plane stress on the same cells (nu = 1/3, 2 x 2 Gauss points), thermal strain
alpha T of each cell, free edges, zero mean u_x; Young's modulus 200 GPa, or by Table 7-1 with its second row of 1673
K read as 1073 K, constant outside. The cases hold the numbers of 0.1 mm (some minutes); 0.2 mm differs by less than
0.02 micrometres without melting.

Variants: A depth of 10 mm (the thickness) without melting; C depth of 0.4 mm with melting; D depth of 2.5 mm with
melting, with the modulus of the table or a constant one; B and D without melting are 25 and 4 times A. Prints
temperatures (degrees Celsius) and u_x (m) on the path. Needs NumPy and SciPy."""

import sys

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import spsolve
from scipy.special import erf

Array = NDArray[np.float64]

POWER, SPEED, CONDUCTIVITY, DENSITY, HEAT, SIGMA = 3200.0, 0.025, 50.0, 7820.0, 490.0, 7e-4
WIDTH, THICKNESS, END, STEP = 0.1, 0.01, 0.08, 2e-5  # m, m, s, s
EXPANSION, POISSONS_RATIO, YOUNGS_MODULUS = 13e-6, 1 / 3, 200e9  # 1/K, -, Pa
SOLIDUS, LIQUIDUS, MUSHY_HEAT = 1385.0, 1450.0, 4000.0  # degrees Celsius, J/(kg K)
TABLE = np.array([298, 473, 673, 873, 973, 1073, 1573.0]) - 273.0  # degrees Celsius
MODULI = np.array([200, 187, 172, 157, 141, 106, 10.0]) * 1e9  # Pa
ON_PATH = (-50, -30, -20, -10, -5, -4, -3, -2, -1, 0, 1, 2, 3, 4, 5, 6, 10, 20, 30, 50)  # mm


def growing(start: float, end: float, size: float, ratio: float = 1.12) -> Array:
    """Edges of cells that grow from the start to the end."""
    sizes: list[float] = []
    while sum(sizes) < abs(end - start):
        sizes.append(size * ratio ** (len(sizes) + 1))
    return start + (end - start) * np.cumsum(sizes) / sum(sizes)


def grid(size: float) -> tuple[Array, Array]:
    """Edges of the cells along x and y, m."""
    path = -0.006 + size * np.arange(round(0.014 / size) + 1)
    x = np.concatenate([growing(path[0], -WIDTH / 2, size)[::-1], path, growing(path[-1], WIDTH / 2, size)])
    near = size * np.arange(round(0.006 / size) + 1)
    return x, np.concatenate([near, growing(near[-1], WIDTH / 2, size)])


def temperature_of(enthalpy: Array, melts: bool) -> Array:
    """Degrees Celsius, at enthalpies (J/m3) above 0 degrees."""
    if not melts:
        return enthalpy / (DENSITY * HEAT)
    solid = DENSITY * HEAT * SOLIDUS
    latent = DENSITY * MUSHY_HEAT * (LIQUIDUS - SOLIDUS)
    sensible = np.minimum(enthalpy, solid) + np.maximum(enthalpy - solid - latent, 0.0)
    return sensible / (DENSITY * HEAT) + np.clip(enthalpy - solid, 0.0, latent) / (DENSITY * MUSHY_HEAT)


def mean_in_cells(edges: Array) -> Array:
    """Mean of the Gaussian between edges."""
    return SIGMA * np.sqrt(np.pi / 2) * np.diff(erf(edges / (np.sqrt(2) * SIGMA))) / np.diff(edges)


def temperatures(edges: tuple[Array, Array], depth: float, melts: bool) -> Array:
    """Degrees Celsius of the cells at the end, with the flux spread over a depth (m)."""
    x, y = edges
    dx, dy = np.diff(x)[:, None], np.diff(y)[None, :]
    along = CONDUCTIVITY / np.diff(0.5 * (x[1:] + x[:-1]))[:, None]
    across = CONDUCTIVITY / np.diff(0.5 * (y[1:] + y[:-1]))[None, :]
    beside = mean_in_cells(y)[None, :] * POWER / (2 * np.pi * SIGMA**2) / depth
    enthalpy = np.zeros((len(x) - 1, len(y) - 1))
    temperature = enthalpy.copy()
    for number in range(round(END / STEP)):
        rate = mean_in_cells(x - SPEED * (number + 0.5) * STEP)[:, None] * beside
        flow = along * np.diff(temperature, axis=0)
        rate[:-1] += flow / dx[:-1]
        rate[1:] -= flow / dx[1:]
        flow = across * np.diff(temperature, axis=1)
        rate[:, :-1] += flow / dy[:, :-1]
        rate[:, 1:] -= flow / dy[:, 1:]
        enthalpy += STEP * rate
        temperature = temperature_of(enthalpy, melts)
    return temperature


def moduli(temperature: Array, falls: bool) -> Array:
    """Young's moduli at temperatures, by the table or constant, Pa."""
    return np.interp(temperature, TABLE, MODULI) if falls else np.full(temperature.shape, YOUNGS_MODULUS)


def displacements(edges: tuple[Array, Array], temperature: Array, modulus: Array) -> Array:
    """u_x at the corners of the cells, m."""
    x, y = edges
    nx, ny = len(x), len(y)
    corner = np.arange(nx * ny).reshape(nx, ny)
    corners = np.stack([corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]], -1).reshape(-1, 4)
    dx, dy = (a.ravel() for a in np.meshgrid(np.diff(x), np.diff(y), indexing="ij"))
    nu = POISSONS_RATIO
    elasticity = np.array([[1, nu, 0], [nu, 1, 0], [0, 0, (1 - nu) / 2]]) / (1 - nu**2)
    stiffness, load = np.zeros((len(dx), 8, 8)), np.zeros((len(dx), 8))
    signs_x, signs_y = np.array([-1, 1, 1, -1]), np.array([-1, -1, 1, 1])
    for r in (-(3**-0.5), 3**-0.5):
        for s in (-(3**-0.5), 3**-0.5):
            strain = np.zeros((len(dx), 3, 8))
            strain[:, 0, 0::2] = signs_x * (1 + signs_y * s) / 2 / dx[:, None]
            strain[:, 1, 1::2] = signs_y * (1 + signs_x * r) / 2 / dy[:, None]
            strain[:, 2, 0::2], strain[:, 2, 1::2] = strain[:, 1, 1::2], strain[:, 0, 0::2]
            weight = modulus.ravel() * dx * dy / 4
            transposed = strain.transpose(0, 2, 1)
            stiffness += weight[:, None, None] * (transposed @ elasticity @ strain)
            thermal = EXPANSION * temperature.ravel() * weight
            load += thermal[:, None] * (transposed @ (elasticity @ np.array([1.0, 1.0, 0.0])))
    freedoms = np.stack([2 * corners, 2 * corners + 1], -1).reshape(-1, 8)
    number = 2 * nx * ny
    rows, columns = np.repeat(freedoms, 8, 1).ravel(), np.tile(freedoms, (1, 8)).ravel()
    matrix = coo_matrix((stiffness.ravel(), (rows, columns)), shape=(number, number)).tocsc()
    force = np.bincount(freedoms.ravel(), load.ravel(), number)
    # symmetry, and one point that does not move along x
    held = np.concatenate([2 * corner[:, 0] + 1, [0]])
    free = np.setdiff1d(np.arange(number), held)
    u = np.zeros(number)
    u[free] = spsolve(matrix[free][:, free], force[free])
    u_x = u[0::2].reshape(nx, ny)
    # of each corner a quarter of the cells around it
    area = np.diff(x)[:, None] * np.diff(y)[None, :]
    weights = np.zeros((nx, ny))
    for a in (slice(0, -1), slice(1, None)):
        for b in (slice(0, -1), slice(1, None)):
            weights[a, b] += area
    return u_x - (u_x * weights).sum() / weights.sum()


def values(size: float = 2e-4) -> dict[str, float]:
    """Temperatures, degrees Celsius, and displacements, m, on the path."""
    edges = grid(size)
    x = edges[0]
    centres = 0.5 * (x[1:] + x[:-1])
    found = {}
    for name, depth, melts in (("A", THICKNESS, False), ("C", 4e-4, True), ("D", 2.5e-3, True)):
        temperature = temperatures(edges, depth, melts)
        path = (9 * temperature[:, 0] - temperature[:, 1]) / 8
        for mm in (-3, -2, -1, 0, 1, 1.5, 2, 2.5, 3, 3.5, 4):
            found[f"{name}: temperature at x = {mm} mm"] = float(np.interp(mm / 1000, centres, path))
        for falls in (False, True) if name == "D" else (False,) if name == "A" else ():
            u_x = displacements(edges, temperature, moduli(temperature, falls))[:, 0]
            modulus = "falling" if falls else "constant"
            for mm in ON_PATH:
                found[f"{name}, {modulus} modulus: u_x at x = {mm} mm, m"] = float(np.interp(mm / 1000, x, u_x))
    at = "u_x at x = -10 mm, m"
    constant = found[f"D, constant modulus: {at}"]
    found["D: u_x at -10 mm, falling over constant modulus"] = found[f"D, falling modulus: {at}"] / constant
    found["D: u_x at -10 mm, with over without latent heat"] = constant / (4 * found[f"A, constant modulus: {at}"])
    return found


if __name__ == "__main__":
    for name, value in values(float(sys.argv[1]) * 1e-3 if len(sys.argv) > 1 else 2e-4).items():
        print(f"{name} {value:.5g}")
