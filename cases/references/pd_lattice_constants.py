"""Conductivity and stable steps of bond-based conduction on a lattice: docs/theory/heat_conduction.md, "Calibration".

    python3 pd_lattice_constants.py

A square (2D) or cubic (3D) lattice with the spacing 1 and the horizon n, and the micro-conductivity of the continuum,
6 k / (pi h delta^3) in 2D and 6 k / (pi delta^4) in 3D. Rules for the volume of members near the edge of the horizon:

    none    |xi| <= n, full volumes
    half    |xi| <= n, volume n + 1/2 - |xi| where this is below 1
    full    |xi| < n + 1/2, volume as for half

Prints the discrete conductivity over k, and the monotone and the von Neumann limit of forward Euler in units of
spacing^2 / diffusivity. Other programs of this folder import the family of a point. Needs NumPy.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
RULES = ("none", "half", "full")


def family(horizon: float, dimension: int, rule: str) -> tuple[NDArray[np.int64], Array, Array]:
    """Offsets of the members of a point in spacings, their distances, and their volumes."""
    reach = int(np.ceil(horizon)) + 1
    axis = np.arange(-reach, reach + 1)
    offset = np.stack(np.meshgrid(*([axis] * dimension), indexing="ij"), -1).reshape(-1, dimension)
    distance = np.linalg.norm(offset, axis=1)
    limit = horizon + 0.5 - 1e-9 if rule == "full" else horizon + 1e-9
    is_member = (distance > 0) & (distance <= limit)
    offset, distance = offset[is_member], distance[is_member]
    volume = np.ones_like(distance) if rule == "none" else np.minimum(1.0, horizon + 0.5 - distance)
    return offset, distance, volume


def micro_conductivity(horizon: float, dimension: int) -> float:
    """Of the continuum, for a conductivity, a spacing and a thickness of one."""
    return 6 / np.pi / horizon ** (dimension + 1)


def conductivity(horizon: float, dimension: int, rule: str) -> float:
    """Of the lattice, over that of the continuum."""
    offset, distance, volume = family(horizon, dimension, rule)
    return float(np.sum(micro_conductivity(horizon, dimension) * offset[:, 0] ** 2 / (2 * distance) * volume))


def stable_steps(horizon: float, dimension: int, rule: str) -> tuple[float, float]:
    """Monotone and von Neumann limit of forward Euler."""
    offset, distance, volume = family(horizon, dimension, rule)
    weight = micro_conductivity(horizon, dimension) * volume / distance
    axis = np.linspace(0, np.pi, 41)
    waves = np.stack(np.meshgrid(*([axis] * dimension), indexing="ij"), -1).reshape(-1, dimension)
    parts = np.array_split(waves, max(1, len(waves) // 2000))
    fastest = max(float(((1 - np.cos(part @ offset.T)) @ weight).max()) for part in parts)
    return float(1 / weight.sum()), 2 / fastest


def values() -> dict[str, float]:
    """Conductivity over that of the continuum, and stable steps over spacing^2 / diffusivity."""
    found = {}
    for dimension, horizons in ((2, (1, 2, 3, 4, 5, 6)), (3, (2, 3, 4))):
        for horizon in horizons:
            for rule in RULES:
                case = f"{dimension}D, n = {horizon}, {rule}"
                found[f"{case}: conductivity"] = conductivity(horizon, dimension, rule)
                monotone, von_neumann = stable_steps(horizon, dimension, rule)
                found[f"{case}: monotone step"] = monotone
                found[f"{case}: von Neumann step"] = von_neumann
    return found


if __name__ == "__main__":
    for name, value in values().items():
        print(f"{name} {value:.5f}")
