"""Static dual-horizon ordinary state-based peridynamics of a square plate with an elliptical hole, independent of
Perimelt.

    python3 plate_with_hole_peridynamics.py

The plate of `plate_with_hole.py` with linear kinematics, solved from its energy

    W_i = alpha theta_i^2 + beta_i delta_i sum_j G_b |xi| s_ij^2 v_ij V_j,
    theta_i = d_i delta_i sum_j G_d s_ij v_ij V_j,      j in the horizon of i alone

([Khoshrou2024], eqs. 71, 87; corrections of docs/theory/stress.md), whose derivative is the dual-horizon equation of
motion. G are factors of the family of each point under uniaxial strain, means of both axes and of both ends. One
quadrant is solved, members in the others are folded. It gives

- for `khoshrou-4.2-phi8-unstable` the part of the load that bonds carry across the hole, and with bonds across it cut
  (`khoshrou-4.2-phi8-narrow`) the displacement at the tip,
- for `khoshrou-4.0-plain-*` the range of the stress of points (S1 of docs/theory/stress.md) without a hole.

Needs NumPy and SciPy.
"""

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray
from scipy.sparse.linalg import LinearOperator, cg
from scipy.spatial import cKDTree

Array = NDArray[np.float64]

YOUNGS_MODULUS, POISSONS_RATIO, TENSION = 200e9, 0.3, 10e6  # Pa, -, Pa
HALF = 0.25  # half side of the plate, m
THICKNESS = 1.0  # m, arbitrary
SHEAR = YOUNGS_MODULUS / 2 / (1 + POISSONS_RATIO)
BULK = YOUNGS_MODULUS / 2 / (1 - POISSONS_RATIO)  # of plane stress
ALPHA = 0.5 * (BULK - 2 * SHEAR)
HORIZON = 3.0  # spacings


def quadrant(a: float, b: float, fine: float, ratio: int, band: float) -> tuple[Array, Array]:
    """Points (m) at the centres of the cells and their spacings: fine for y < band, `ratio` times as coarse above."""
    parts = []
    for spacing, low, high in ((fine, 0.0, band), (ratio * fine, band, HALF)):
        x = (np.arange(round(HALF / spacing)) + 0.5) * spacing
        y = low + (np.arange(round((high - low) / spacing)) + 0.5) * spacing
        parts.append(np.stack([*np.meshgrid(x, y), np.full((len(y), len(x)), spacing)], -1).reshape(-1, 3))
    points = np.vstack(parts)
    points = points[(points[:, 0] / a) ** 2 + (points[:, 1] / b) ** 2 >= 1]
    return points[:, :2], points[:, 2]


def crosses_ellipse(start: Array, end: Array, a: float, b: float) -> NDArray[np.bool_]:
    """Whether lines from start to end pass through the hole."""
    scale = np.array([1 / a, 1 / b])
    start, way = start * scale, (end - start) * scale
    nearest = np.clip(-(start * way).sum(1) / (way * way).sum(1), 0, 1)
    return ((start + nearest[:, None] * way) ** 2).sum(1) < 1 - 1e-12


class Bonds:
    """Directed bonds from points of the quadrant to members of their horizons, folded into the quadrant."""

    def __init__(self, x: Array, spacing: Array, hole: tuple[float, float], cut: bool) -> None:
        signs = np.array([(1, 1), (-1, 1), (1, -1), (-1, -1)])
        everywhere = np.concatenate([x * sign for sign in signs])
        base, sign = np.tile(np.arange(len(x)), 4), np.repeat(signs, len(x), axis=0)
        self.horizon = HORIZON * spacing
        tree = cKDTree(everywhere)
        pairs = [
            np.stack([np.full(len(members), i), members])
            for i, members in enumerate(tree.query_ball_point(x, self.horizon * (1 + 1e-9)))
        ]
        i, j = np.concatenate(pairs, axis=1)
        keep = i != j
        if cut:
            keep[keep] = ~crosses_ellipse(x[i[keep]], everywhere[j[keep]], *hole)
        self.i, j = i[keep], j[keep]
        self.j, self.sign, self.end = base[j], sign[j], everywhere[j]
        self.xi = self.end - x[self.i]
        self.length = np.hypot(*self.xi.T)
        half = 0.5 * spacing[self.j]
        self.partial = np.clip((self.horizon[self.i] + half - self.length) / (2 * half), 0, 1)


class Solution:
    """Displacement (m), stress of the points along y (Pa), and force across y = 0 by position."""

    def __init__(self, hole: tuple[float, float], fine: float, ratio: int, band: float, cut: bool = True) -> None:
        self.x, spacing = quadrant(*hole, fine, ratio, band)
        bonds = Bonds(self.x, spacing, hole, cut)
        count, volume = len(self.x), spacing**2 * THICKNESS
        i, j, delta, length = bonds.i, bonds.j, bonds.horizon, bonds.length
        d = 2 / (np.pi * THICKNESS * delta**3)
        beta = 6 * SHEAR / (np.pi * THICKNESS * delta**4)
        direction = bonds.xi / length[:, None]
        member = bonds.partial * volume[j]

        dilatation, deviator = np.zeros(count), np.zeros(count)
        for axis in (0, 1):
            square = direction[:, axis] ** 2
            theta = d * delta * np.bincount(i, square * member, count)
            energy = beta * delta * np.bincount(i, length * square**2 * member, count) / (1.5 * SHEAR)
            # at least 0.2, for families without bonds along an axis
            dilatation += 0.5 / np.maximum(theta, 0.2)
            deviator += 0.5 / np.maximum(energy, 0.2)
        of_dilatation, of_deviator = 0.5 * (dilatation[i] + dilatation[j]), 0.5 * (deviator[i] + deviator[j])

        number = np.arange(len(i))
        signed = direction * bonds.sign / length[:, None]
        own = -direction / length[:, None]
        entries = np.concatenate([signed[:, 0], signed[:, 1], own[:, 0], own[:, 1]])
        columns = np.concatenate([2 * j, 2 * j + 1, 2 * i, 2 * i + 1])
        stretch = sparse.csr_matrix((entries, (np.tile(number, 4), columns)), shape=(len(i), 2 * count))
        theta = (
            sparse.csr_matrix(((d * delta)[i] * of_dilatation * member, (i, number)), shape=(count, len(i))) @ stretch
        )
        per_bond = 2 * (beta * delta * volume)[i] * of_deviator * length * member
        per_point = 2 * ALPHA * volume

        def apply(u: Array) -> Array:
            return stretch.T @ (per_bond * (stretch @ u)) + theta.T @ (per_point * (theta @ u))

        diagonal = stretch.power(2).T @ per_bond + theta.power(2).T @ per_point
        diagonal[diagonal == 0] = 1.0
        load = np.zeros((count, 2))
        layer = HALF - self.x[:, 1] < delta.max() * (1 + 1e-9)  # body force in a layer of one horizon
        load[layer, 1] = TENSION * HALF * THICKNESS / volume[layer].sum() * volume[layer]
        u, info = cg(
            LinearOperator((2 * count, 2 * count), apply, dtype=float),
            load.ravel(),
            rtol=1e-8,
            maxiter=60_000,
            M=sparse.diags(1 / diagonal),
        )
        if info != 0:
            raise RuntimeError("conjugate gradients did not converge")
        self.displacement = u.reshape(-1, 2)
        s, t = stretch @ u, theta @ u
        force = 2 * delta[i] * (of_dilatation * d[i] * ALPHA * t[i] / length + of_deviator * beta[i] * s)
        along_y = force * direction[:, 1]
        self.stress = np.bincount(i, along_y * bonds.xi[:, 1] * member, count)
        # bonds that cross y = 0, and where: each stands for its image from below too
        crossing = bonds.end[:, 1] < 0
        i, end = i[crossing], bonds.end[crossing]
        way = end - self.x[i]
        self.place = abs(self.x[i, 0] - way[:, 0] * self.x[i, 1] / way[:, 1])
        self.carried = -2 * along_y[crossing] * volume[i] * member[crossing]

    def fraction_across(self, a: float) -> float:
        """Part of the load that crosses y = 0 at |x| < a."""
        return float(self.carried[self.place < a].sum() / self.carried.sum())


def values() -> dict[str, float]:
    """Fractions of the load, displacements (m) and stresses (Pa) by name."""
    found = {}
    hole = (0.05, 0.005)
    for name, cut in (("bonds across the hole", False), ("bonds across the hole cut", True)):
        plate = Solution(hole, 0.625e-3, 8, 5e-3, cut)
        found[f"4.2, ratio 8, band 5 mm, {name}: fraction of the load across it"] = plate.fraction_across(hole[0])
        tip = np.argmin(np.hypot(plate.x[:, 0] - 0.0528125, plate.x[:, 1] - 0.0003125))
        found[f"4.2, ratio 8, band 5 mm, {name}: u at (0.0528125, 0.0003125), m"] = float(plate.displacement[tip, 0])
    for ratio in (1, 2, 4):
        plate = Solution((1e-12, 1e-12), 3.125e-3, ratio, 50e-3)
        inner = (plate.x[:, 0] < 0.2) & (plate.x[:, 1] < 0.15)
        stress = plate.stress[inner]
        found[f"plain, ratio {ratio}: least stress along y (S1), Pa"] = float(stress.min())
        found[f"plain, ratio {ratio}: largest stress along y (S1), Pa"] = float(stress.max())
        exact = TENSION / YOUNGS_MODULUS * plate.x * np.array([-POISSONS_RATIO, 1.0])
        error = abs(plate.displacement - exact)[inner].max(0)
        scale = TENSION / YOUNGS_MODULUS * np.array([POISSONS_RATIO * 0.2, 0.15])
        found[f"plain, ratio {ratio}: largest error of u over its largest value"] = float(error[0] / scale[0])
        found[f"plain, ratio {ratio}: largest error of v over its largest value"] = float(error[1] / scale[1])
    return found


if __name__ == "__main__":
    for quantity, value in values().items():
        print(f"{quantity}: {value:.6e}")
