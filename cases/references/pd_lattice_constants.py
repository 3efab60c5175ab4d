"""Lattice effects on peridynamic conduction and elasticity with a constant influence, for the tests of `wang-4.0.1`
and the cases `khoshrou-4.*`, and for other programs of this folder.

    python3 pd_lattice_constants.py

For a point of an infinite square or cubic lattice with the spacing 1 and a horizon of n spacings it prints, for the
three rules of partial volume of the case files (`none`, `half`, `full`),

- the number of members and the volume of the family over that of the full horizon,
- the energy density of a bond-based solid with the bond constant of the continuum over that of the continuum, under
  isotropic (conduction: any gradient), uniaxial and shear strain, for Poisson's ratio 1/3 (2D, plane stress) and 1/4
  (3D),
- the longest stable step of explicit conduction, in units of dx^2 over the diffusivity, by positive coefficients and
  by von Neumann's method,
- the longest stable step of explicit motion in 2D, in units of dx sqrt(density / E), by the sum of the coefficients
  of the bonds and by von Neumann's method (Poisson's ratio 1/3).

Needs NumPy.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

RULES = ("none", "half", "full")


def family(n: float, dim: int, rule: str) -> tuple[NDArray[np.intp], Array, Array]:
    """Offsets, lengths (in spacings) and volume weights of the members of one point."""
    reach = int(np.ceil(n)) + 1
    axis = np.arange(-reach, reach + 1)
    g = np.stack(np.meshgrid(*([axis] * dim), indexing="ij"), -1).reshape(-1, dim)
    d = np.linalg.norm(g, axis=1)
    cut = n + 0.5 - 1e-9 if rule == "full" else n + 1e-9
    keep = (d > 0) & (d <= cut)
    g, d = g[keep], d[keep]
    v = np.ones_like(d) if rule == "none" else np.minimum(1.0, n + 0.5 - d)
    return g, d, v


def volume(n: float, dim: int, rule: str) -> float:
    """Of the family over that of the full horizon."""
    return float(family(n, dim, rule)[2].sum() / (np.pi * n**2 if dim == 2 else 4 / 3 * np.pi * n**3))


def energies(n: float, dim: int, rule: str) -> tuple[float, float, float]:
    """Energies under isotropic, uniaxial and shear strain over those of the continuum."""
    g, d, v = family(n, dim, rule)
    direction = g / d[:, None]
    square = direction[:, 0] ** 2
    mixed = (direction[:, 0] * direction[:, 1]) ** 2
    total = float((d * v).sum()) / (2 * np.pi * n**3 / 3 if dim == 2 else np.pi * n**4)
    # means of n_x^4 and n_x^2 n_y^2 over all directions: 3/(d (d + 2)) and 1/(d (d + 2))
    scale = dim * (dim + 2) / float((d * v).sum()) * total
    return total, float((d * v * square**2).sum()) * scale / 3, float((d * v * mixed).sum()) * scale


def thermal(n: float, dim: int, rule: str) -> tuple[float, float, float, int]:
    """Conductivity over the nominal one, stable steps by positive coefficients and by von Neumann, members."""
    g, d, v = family(n, dim, rule)
    kappa = 6 / np.pi / n**3 if dim == 2 else 6 / np.pi / n**4  # conductivity, spacing and thickness are 1
    weight = kappa * v / d
    axis = np.linspace(0, np.pi, 41)
    waves = np.stack(np.meshgrid(*([axis] * dim), indexing="ij"), -1).reshape(-1, dim)
    largest = max(float(np.sum(weight * (1 - np.cos(g @ wave)))) for wave in waves)
    conductivity = float(np.sum(kappa * g[:, 0] ** 2 / (2 * d) * v))
    return conductivity, float(1 / weight.sum()), 2 / largest, len(d)


def elastic2d(n: float, rule: str) -> tuple[float, float, float]:
    """Uniaxial energy over that of the continuum, and stable steps by coefficients and by von Neumann."""
    g, d, v = family(n, 2, rule)
    weight = 9 / np.pi / n**3 * v / d
    direction = g / d[:, None]
    axis = np.linspace(0, np.pi, 61)
    largest = 0.0
    for x in axis:
        for y in axis:
            factor = weight * (1 - np.cos(g @ np.array([x, y])))
            largest = max(largest, float(np.linalg.eigvalsh((direction.T * factor) @ direction)[-1]))
    return energies(n, 2, rule)[1], float(np.sqrt(2 / weight.sum())), float(2 / np.sqrt(largest))


def values() -> dict[str, float]:
    """Numbers of members, volumes and energies (dimensionless): `half` partial volumes, and `full` for n = 3 in 2D."""
    found = {}
    for dim, n, rule in [(dim, n, "half") for dim in (2, 3) for n in range(1, 6)] + [(2, 3, "full")]:
        name = f"{dim}D, {n} spacings, {rule}"
        found[f"{name}: members"] = float(len(family(n, dim, rule)[1]))
        found[f"{name}: volume"] = volume(n, dim, rule)
        for strain, energy in zip(("isotropic", "uniaxial", "shear"), energies(n, dim, rule), strict=True):
            found[f"{name}: energy, {strain} strain"] = energy
    return found


if __name__ == "__main__":
    for quantity, value in values().items():
        print(f"{quantity}: {value:.4f}")
    for dim, horizons in ((2, (1, 2, 3, 4, 5, 6, 8, 10)), (3, (2, 3, 4))):
        for n in horizons:
            for rule in RULES:
                conductivity, positive, neumann, members = thermal(n, dim, rule)
                print(
                    f"conduction, {dim}D, {n} spacings, {rule}: {members} members, conductivity {conductivity:.5f}, "
                    f"step {positive:.5f} (positive), {neumann:.5f} (von Neumann) dx^2/a"
                )
    for n in (1, 2, 3, 4, 5):
        for rule in RULES:
            energy, by_sum, neumann = elastic2d(n, rule)
            print(
                f"motion, 2D, {n} spacings, {rule}: uniaxial energy {energy:.5f}, step {by_sum:.5f} (sum), "
                f"{neumann:.5f} (von Neumann) dx sqrt(density/E)"
            )
