"""Bond-based conduction under a moving semi-ellipsoid that melts a block, for the cases `wang-7.5.4.2-*`.

    python3 goldak_pd.py [spacing in mm]

Window of the block of [Wang2025] 7.5.4: -16.8 <= x <= 37.2 mm, half of the block beside the path to 18 mm, 10 mm
deep, mirrored on all sides; what the window cuts off is below 1 % of the rise near the path. Lattice of 0.4 mm,
horizon of three spacings, partial volumes of the rule `half`, calibrated micro-conductivity, source sampled at the
points and scaled to its power, explicit steps of 5 ms for the enthalpy to 4 s, latent heat as in `goldak_fv.py`.

Prints temperatures (degrees Celsius) of the points next to the path (y = depth = 0.2 mm), with latent heat, those the
cases hold, and without, and lengths (m) of the pool. A few minutes. Needs NumPy, SciPy and Numba."""

import sys

import goldak_fv as fv
import numpy as np
from numba import njit, prange
from numpy.typing import NDArray
from pd_lattice_constants import family

Array = NDArray[np.float64]

STEP, HORIZON = 5e-3, 3  # s, spacings
LOW, HIGH, SIDE = -0.0168, 0.0372, 0.018  # m


@njit(parallel=True)
def heat_flow(temperature, offsets, weights, flow):  # type: ignore[no-untyped-def]
    """Heat that flows to each point, W/m3; points behind faces mirror those in front of them."""
    nx, ny, nz = temperature.shape
    for i in prange(nx):
        for j in range(ny):
            for k in range(nz):
                own, total = temperature[i, j, k], 0.0
                for m in range(weights.size):
                    a, b, c = i + offsets[m, 0], j + offsets[m, 1], k + offsets[m, 2]
                    a = -1 - a if a < 0 else (2 * nx - 1 - a if a >= nx else a)
                    b = -1 - b if b < 0 else (2 * ny - 1 - b if b >= ny else b)
                    c = -1 - c if c < 0 else (2 * nz - 1 - c if c >= nz else c)
                    total += weights[m] * (temperature[a, b, c] - own)
                flow[i, j, k] = total


def solve(spacing: float, melts: bool) -> tuple[tuple[Array, Array, Array], Array, float]:
    """Positions of the points along the axes, temperatures at the end, and energy over that of the source."""
    offsets, distance, volume = family(HORIZON, 3, "half")
    weights = 2 * fv.CONDUCTIVITY / np.sum(offsets[:, 0] ** 2 / distance * volume) * volume / distance / spacing**2
    extents = (HIGH - LOW, SIDE, fv.THICKNESS)
    x, y, depth = (spacing * (np.arange(round(extent / spacing)) + 0.5) for extent in extents)
    x = x + LOW

    def bell(u: Array, length: float) -> Array:
        return np.exp(-3 * u**2 / length**2)

    across, below = bell(y, fv.HALF_WIDTH), bell(depth, fv.DEPTH)
    enthalpy, temperature, flow = (np.zeros((len(x), len(y), len(depth))) for _ in range(3))
    for number in range(round(fv.END / STEP)):
        along = bell(x - fv.SPEED * (number + 0.5) * STEP, fv.HALF_LENGTH)
        # the half has half of the power
        peak = 0.5 * fv.POWER / (along.sum() * across.sum() * below.sum() * spacing**3)
        heat_flow(temperature, offsets, weights, flow)
        fv.advance(enthalpy, temperature, flow, (along, across, below), STEP, peak, melts)
    return (x, y, depth), temperature, float(2 * enthalpy.sum() * spacing**3 / (fv.POWER * fv.END))


def values(spacing: float = 4e-4) -> dict[str, float]:
    """Temperatures next to the path, degrees Celsius; lengths of the melt pool, m; energies over that of the source."""
    found = {}
    for name, melts in (("with latent heat", True), ("without latent heat", False)):
        positions, temperature, energy = solve(spacing, melts)
        found[f"{name}, energy"] = energy
        for mm in (5.0, 9.8, 13.0, 15.0, 17.0, 18.2, 21.8, 22.2, 23.0, 25.0, 27.8):
            point = int(np.argmin(np.abs(positions[0] - mm / 1000)))
            found[f"{name}, x = {mm} mm"] = float(temperature[point, 0, 0])
        for isotherm in (fv.SOLIDUS, fv.LIQUIDUS):
            for extent, length in fv.melt_pool(positions, temperature, isotherm).items():
                found[f"{name}, {extent} at {isotherm:.0f} degrees, m"] = length
    return found


if __name__ == "__main__":
    for name, value in values(float(sys.argv[1]) * 1e-3 if len(sys.argv) > 1 else 4e-4).items():
        print(f"{name} {value:.7g}")
