"""Lattice effects on bond-based elasticity with a constant influence, for the tests of `wang-4.0.1`.

    python3 lattice_elasticity.py

For a point of an infinite square or cubic lattice with the spacing 1 and a horizon of n spacings it prints, for the
rules of partial volume of the case files (`none`, `half`, `full`),

- the number of members, and the volume of the family over that of the full horizon,
- the energy density of a bond-based solid with the bond constant of the continuum over that of the continuum, under
  isotropic, uniaxial and shear strain, for Poisson's ratio 1/3 (2D, plane stress) and 1/4 (3D),
- the longest stable step of explicit motion in 2D, in units of dx sqrt(density / E), by the sum of the coefficients
  of the bonds and by von Neumann's method.

Needs NumPy.
"""

import numpy as np
from pd_lattice_constants import RULES, family


def volume(n: float, dim: int, rule: str) -> float:
    """Of the family over that of the full horizon."""
    return float(family(n, dim, rule)[2].sum() / (np.pi * n**2 if dim == 2 else 4 / 3 * np.pi * n**3))


def energies(n: float, dim: int, rule: str) -> tuple[float, float, float]:
    """Energies under isotropic, uniaxial and shear strain over those of the continuum."""
    g, d, v = family(n, dim, rule)
    direction = g / d[:, None]
    square = direction[:, 0] ** 2
    mixed = (direction[:, 0] * direction[:, 1]) ** 2
    # integral of |xi| over the horizon, and means of n_x^4 and n_x^2 n_y^2 over all directions
    whole = 2 * np.pi * n**3 / 3 if dim == 2 else np.pi * n**4
    fourth, second = 3 / (dim * (dim + 2)), 1 / (dim * (dim + 2))
    total = float((d * v).sum()) / whole
    return total, float((d * v * square**2).sum()) / whole / fourth, float((d * v * mixed).sum()) / whole / second


def stable_steps(n: float, rule: str) -> tuple[float, float]:
    """By the sum of the coefficients and by von Neumann's method: plane stress, Poisson's ratio 1/3."""
    g, d, v = family(n, 2, rule)
    weight = 9 / np.pi / n**3 * v / d
    direction = g / d[:, None]
    axis = np.linspace(0, np.pi, 61)
    largest = 0.0
    for x in axis:
        for y in axis:
            factor = weight * (1 - np.cos(g @ np.array([x, y])))
            largest = max(largest, float(np.linalg.eigvalsh((direction.T * factor) @ direction)[-1]))
    return float(np.sqrt(2 / weight.sum())), float(2 / np.sqrt(largest))


def values() -> dict[str, float]:
    """Numbers of members, volumes and energies (dimensionless): `half` partial volumes, and `full` for n = 3."""
    found = {}
    for dim, n, rule in [(dim, n, "half") for dim in (2, 3) for n in range(1, 6)] + [(2, 3, "full"), (3, 3, "full")]:
        name = f"{dim}D, {n} spacings, {rule}"
        found[f"{name}: members"] = float(len(family(n, dim, rule)[1]))
        found[f"{name}: volume"] = volume(n, dim, rule)
        for strain, energy in zip(("isotropic", "uniaxial", "shear"), energies(n, dim, rule), strict=True):
            found[f"{name}: energy, {strain} strain"] = energy
    return found


if __name__ == "__main__":
    for quantity, value in values().items():
        print(f"{quantity}: {value:.4f}")
    for n in (1, 2, 3, 4, 5):
        for rule in RULES:
            by_sum, neumann = stable_steps(n, rule)
            print(f"stable step, 2D, {n} spacings, {rule}: {by_sum:.5f} by the sum, {neumann:.5f} by von Neumann")
