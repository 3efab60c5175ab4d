"""Tension of a clamped plate in plane stress by finite elements, for the cases `wang-4.3.3-*`, `wang-4.3.6-tension-*`
and `wang-5.4.2.*`.

    python3 clamped_plate.py [elements]

A square of 1 m, thickness 0.01 m, centred at the origin, with E = 200 GPa. The edge x = -0.5 m is held in both
components, the edge x = 0.5 m is pulled by 200 MPa along x, the other edges are free ([Wang2025], 4.3.3). Bilinear
quadrilaterals with 2 x 2 Gauss points, 400 x 400 of them, consistent nodal loads, sparse direct solution; 200 x 200
elements differ by at most 0.03 %. Displacements between nodes are interpolated bilinearly. Needs NumPy and SciPy.
"""

import sys

import numpy as np
import scipy.sparse as sparse
from numpy.typing import ArrayLike, NDArray
from scipy.sparse.linalg import spsolve

Array = NDArray[np.float64]

SIDE, THICKNESS = 1.0, 0.01  # m
YOUNGS_MODULUS, TRACTION = 200e9, 200e6  # Pa
ELEMENTS = 400  # along a side

ALONG_X = (-0.4, -0.3, -0.2, -0.1, 0.0, 0.1, 0.2, 0.3, 0.4, 0.495)  # m
ALONG_Y = (0.1, 0.2, 0.3, 0.4, 0.495)  # m
# points of the plate of two spacings next to the axis: near the change of the spacing, and elsewhere
NEAR = tuple((-0.0575 + 0.005 * i, 0.0025) for i in range(12)) + tuple((0.005 + 0.01 * i, 0.005) for i in range(6))
ELSEWHERE = (
    *((x, 0.0025) for x in (-0.3975, -0.2975, -0.1975, -0.0975)),
    *((x, 0.005) for x in (0.105, 0.205, 0.305, 0.405, 0.495)),
)


class Mesh:
    """Square elements with nodes in rows along x, and the stiffness of the plate (N/m)."""

    def __init__(self, elements: int, poissons_ratio: float) -> None:
        self.elements = elements
        self.node = np.arange((elements + 1) ** 2).reshape(elements + 1, elements + 1)
        corners = [self.node[:-1, :-1], self.node[:-1, 1:], self.node[1:, 1:], self.node[1:, :-1]]
        self.corners = np.stack(corners, -1).reshape(-1, 4)
        freedoms = np.stack([2 * self.corners, 2 * self.corners + 1], -1).reshape(-1, 8)
        local = self.element_stiffness(poissons_ratio)
        rows, columns = np.repeat(freedoms, 8, 1).ravel(), np.tile(freedoms, (1, 8)).ravel()
        self.stiffness = sparse.csr_matrix((np.tile(local.ravel(), len(freedoms)), (rows, columns)))
        clamped = self.node[:, 0]
        self.held = np.concatenate([2 * clamped, 2 * clamped + 1])

    def element_stiffness(self, poissons_ratio: float) -> Array:
        """Of one element, N/m."""
        nu, side, point = poissons_ratio, SIDE / self.elements, 3**-0.5
        elasticity = np.array([[1, nu, 0], [nu, 1, 0], [0, 0, (1 - nu) / 2]]) * YOUNGS_MODULUS / (1 - nu**2)
        xs, ys = np.array([-1, 1, 1, -1]), np.array([-1, -1, 1, 1])
        local = np.zeros((8, 8))
        for x in (-point, point):
            for y in (-point, point):
                dx, dy = xs * (1 + ys * y) / 2 / side, ys * (1 + xs * x) / 2 / side
                strain = np.zeros((3, 8))
                strain[0, 0::2], strain[1, 1::2], strain[2, 0::2], strain[2, 1::2] = dx, dy, dy, dx
                local += strain.T @ elasticity @ strain * side**2 / 4 * THICKNESS
        return local

    def interpolation(self, points: ArrayLike) -> sparse.csr_matrix:
        """Matrix that takes nodal values to values at points (m)."""
        place = (np.asarray(points, float) / SIDE + 0.5) * self.elements
        cell = np.minimum((place + 1e-9).astype(int), self.elements - 1)
        x, y = (place - cell).T
        weights = np.stack([(1 - x) * (1 - y), x * (1 - y), x * y, (1 - x) * y], -1)
        nodes = self.corners[cell[:, 1] * self.elements + cell[:, 0]]
        rows = np.repeat(np.arange(len(place)), 4)
        return sparse.csr_matrix((weights.ravel(), (rows, nodes.ravel())), shape=(len(place), self.node.size))


def tension(poissons_ratio: float, points: ArrayLike, elements: int = ELEMENTS) -> Array:
    """Displacements (u, v) of the points, m."""
    mesh = Mesh(elements, poissons_ratio)
    load = np.zeros(mesh.stiffness.shape[0])
    loaded = 2 * mesh.node[:, -1]
    load[loaded] = TRACTION * THICKNESS * SIDE / elements
    load[loaded[[0, -1]]] /= 2
    free = np.setdiff1d(np.arange(len(load)), mesh.held)
    displacement = np.zeros(len(load))
    displacement[free] = spsolve(mesh.stiffness[free][:, free].tocsc(), load[free])
    return mesh.interpolation(points) @ displacement.reshape(-1, 2)


def values(elements: int = ELEMENTS) -> dict[str, float]:
    """Displacements by name, m: with Poisson's ratio 1/3 of bond-based plates, and 1/4 of the ordinary ones."""
    found = {}
    for name, poissons_ratio in (("1/3", 1 / 3), ("1/4", 0.25)):
        axis = [(x, 0.0) for x in ALONG_X]
        across = [(0.0, y) for y in ALONG_Y]
        beside = [*NEAR, *ELSEWHERE] if name == "1/3" else []
        displacement = tension(poissons_ratio, [*axis, *across, *beside], elements)
        for n, (x, y) in enumerate([*axis, *across, *beside]):
            component = int((x, y) in across)
            found[f"{'uv'[component]} at ({x:.4f}, {y:.4f}), nu = {name}"] = float(displacement[n, component])
    return found


if __name__ == "__main__":
    for quantity, value in values(int(sys.argv[1]) if len(sys.argv) > 1 else ELEMENTS).items():
        print(f"{quantity}: {value:.6e} m")
