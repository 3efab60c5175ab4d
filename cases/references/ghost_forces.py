"""Ghost forces of dual-horizon solids beside a plane where the spacing doubles, independent of Perimelt, for the
table of docs/theory/horizons.md and the test of `physics/src/mechanical/cloud_tests.rs`.

    python3 ghost_forces.py

Points with the spacing 0.005 m for x < 0 and 0.01 m for x > 0 in plane stress, uniform strain along x. The force
density of every point would be zero in a continuum. Prints the largest one times the spacing of its point over
Young's modulus and strain, for horizons of 2 and 3 spacings of each point and for constant horizons of 0.02 and 0.03
m: bond-based (nu = 1/3), ordinary (1/4) and correspondence solids (1/3), `half` partial volumes. The bond-based and
ordinary solids have the factors of [Wang2025], eqs. 4.4 to 4.8: of the own family under uniaxial strain along x and
y, means of both ends, combined as the radius of an ellipse. Needs NumPy and SciPy.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

Array = NDArray[np.float64]

FINE = 0.005  # m, spacing for x < 0
LENGTH, HEIGHT = 0.4, 0.3  # m, of the patch
HORIZONS = {"2 spacings": (2, 0.0), "3 spacings": (3, 0.0), "0.02 m": (0, 0.02), "0.03 m": (0, 0.03)}


class Patch:
    """Points, and the directed bonds of their horizons."""

    def __init__(self, spacings: float, constant: float) -> None:
        parts = []
        for spacing, left in ((FINE, -LENGTH / 2), (2 * FINE, 0.0)):
            x = left + (np.arange(round(LENGTH / 2 / spacing)) + 0.5) * spacing
            y = (np.arange(round(HEIGHT / spacing)) + 0.5) * spacing - HEIGHT / 2
            parts.append(np.stack([*np.meshgrid(x, y), np.full((len(y), len(x)), spacing)], -1).reshape(-1, 3))
        points = np.vstack(parts)
        self.x, self.spacing = points[:, :2], points[:, 2]
        self.horizon = spacings * self.spacing + constant
        self.volume = self.spacing**2
        members = cKDTree(self.x).query_ball_point(self.x, self.horizon * (1 + 1e-9))
        self.i = np.repeat(np.arange(len(self.x)), [len(m) for m in members])
        self.j = np.concatenate(members).astype(int)
        keep = self.i != self.j
        self.i, self.j = self.i[keep], self.j[keep]
        self.xi = self.x[self.j] - self.x[self.i]
        self.length = np.hypot(*self.xi.T)
        self.direction = self.xi / self.length[:, None]
        beside = self.spacing[self.j]
        self.partial = np.clip((self.horizon[self.i] + beside / 2 - self.length) / beside, 0, 1)

    def sum(self, terms: Array) -> Array:
        """Of the bonds of each point, over their members."""
        return np.bincount(self.i, terms * (self.partial * self.volume[self.j]), len(self.x))

    def largest(self, state: Array) -> float:
        """Largest force density times spacing in the middle, from force states of the bonds (over E times strain)."""
        force = np.zeros_like(self.x)
        for axis in (0, 1):
            per_bond = state[:, axis] * self.partial
            force[:, axis] += np.bincount(self.i, per_bond * self.volume[self.j], len(self.x))
            force[:, axis] -= np.bincount(self.j, per_bond * self.volume[self.i], len(self.x))
        middle = (abs(self.x[:, 0]) < 0.1) & (abs(self.x[:, 1]) < 0.05)
        return float((np.hypot(*force.T) * self.spacing)[middle].max())

    def factor(self, axes: list[Array]) -> Array:
        """Of the bonds, from factors of the points along the axes."""
        parts = [(self.direction[:, n] / (0.5 * (axis[self.i] + axis[self.j]))) ** 2 for n, axis in enumerate(axes)]
        return 1 / np.sqrt(parts[0] + parts[1])

    def bonds(self, nu: float) -> float:
        """Ghost force of an ordinary solid (bond-based for nu = 1/3), for a Young's modulus and a strain of one."""
        shear, bulk = 1 / 2 / (1 + nu), 1 / 2 / (1 - nu)
        a = 0.5 * (bulk - 2 * shear)
        b, d = 6 * shear / np.pi / self.horizon**4, 2 / np.pi / self.horizon**3
        squares = self.direction**2
        deviator = [1.5 * shear / (b * self.horizon * self.sum(self.length * squares[:, n] ** 2)) for n in (0, 1)]
        dilatation = [1 / (d * self.horizon * self.sum(squares[:, n])) for n in (0, 1)]
        of_deviator, of_dilatation = self.factor(deviator), self.factor(dilatation)
        stretch = squares[:, 0]
        theta = d * self.horizon * self.sum(of_dilatation * stretch)
        i, delta = self.i, self.horizon[self.i]
        size = 2 * a * d[i] * delta * of_dilatation * theta[i] / self.length + 2 * delta * b[i] * of_deviator * stretch
        return self.largest(size[:, None] * self.direction)

    def correspondence(self, nu: float) -> float:
        """Ghost force of a correspondence solid, for a Young's modulus and a strain of one."""
        stress = np.diag([1.0, nu]) / (1 - nu**2)
        products = [self.sum(self.xi[:, m] * self.xi[:, n]) for m, n in ((0, 0), (0, 1), (1, 0), (1, 1))]
        shape = np.stack(products, -1).reshape(-1, 2, 2)
        return self.largest(
            np.einsum("mn,bn->bm", stress, np.linalg.solve(shape[self.i], self.xi[:, :, None])[:, :, 0])
        )


def values() -> dict[str, float]:
    """Ghost forces by name, dimensionless."""
    found = {}
    for name, horizon in HORIZONS.items():
        patch = Patch(*horizon)
        found[f"bond, {name}"] = patch.bonds(1 / 3)
        found[f"ordinary, {name}"] = patch.bonds(0.25)
        found[f"correspondence, {name}"] = patch.correspondence(1 / 3)
    return found


if __name__ == "__main__":
    for quantity, value in values().items():
        print(f"{quantity}: {value:.4f}")
