"""Tension and free vibration of a clamped block by finite elements, for the cases `wang-4.3.4-*` and `wang-4.3.5-*`.

    python3 clamped_block.py [elements]

A cube of 0.3 m, centred at the origin, with E = 200 GPa and 7850 kg/m3. The face x = -0.15 m is held in all
components; y = 0 and z = 0 are planes of symmetry, so that a quarter is computed. Trilinear elements with 2 x 2 x 2
Gauss points, 60 x 30 x 30 of them.

Tension ([Wang2025], 4.3.5): 200 MPa along x on the face x = 0.15 m, consistent nodal loads, conjugate gradients to
1e-9. With 30 x 15 x 15 elements the loaded face differs by at most 0.07 %.

Vibration ([Wang2025], 4.3.4): released at rest from u = 0.001 (x + 0.15 m), v = w = 0; lumped mass, velocity Verlet
with steps of 2.5e-7 s for 0.15 ms. Displacements at (0.0775, 0.0775, 0.0775) m every 5 us; v and w are equal. With
half as many elements along each axis they differ by 0.4 to 0.7 % in u and 1.6 to 2.5 % in v (root mean square over
the largest value).

Displacements between nodes are interpolated linearly. Needs NumPy and SciPy.
"""

import itertools
import sys

import numpy as np
import scipy.sparse as sparse
from clamped_plate_vibration import free_motion
from numpy.typing import ArrayLike, NDArray
from scipy.sparse.linalg import cg

Array = NDArray[np.float64]

SIDE = 0.3  # m
YOUNGS_MODULUS, TRACTION = 200e9, 200e6  # Pa
DENSITY = 7850.0  # kg/m3
STRAIN = 1e-3
POINT = (0.0775, 0.0775, 0.0775)  # m
STEP, INTERVAL, END = 2.5e-7, 5e-6, 1.5e-4  # s
ELEMENTS = 60  # along x

# the last point is that of the spacing of 0.005 m, the one before that of 0.01 m
ALONG_X = (-0.12, -0.09, -0.06, -0.03, 0.0, 0.03, 0.06, 0.09, 0.12, 0.145, 0.1475)  # m
ALONG_Y = (0.03, 0.06, 0.09, 0.12, 0.145, 0.1475)  # m

CORNERS = np.array(list(itertools.product((0, 1), repeat=3)))


class Mesh:
    """Cubic elements of a quarter of the block, and its stiffness (N/m)."""

    def __init__(self, elements: int, poissons_ratio: float) -> None:
        self.shape = np.array([elements, elements // 2, elements // 2])
        self.size = SIDE / elements
        nodes = self.shape + 1
        self.node = np.arange(nodes.prod()).reshape(nodes)
        self.position = np.stack(np.indices(nodes), -1).reshape(-1, 3) * self.size - [SIDE / 2, 0, 0]
        first = np.stack(np.indices(self.shape), -1).reshape(-1, 3)
        self.corners = np.stack([self.node[tuple((first + c).T)] for c in CORNERS], -1)
        freedoms = (3 * self.corners[:, :, None] + np.arange(3)).reshape(-1, 24)
        local = self.element_stiffness(poissons_ratio)
        rows, columns = np.repeat(freedoms, 24, 1).ravel(), np.tile(freedoms, (1, 24)).ravel()
        self.stiffness = sparse.csr_matrix((np.tile(local.ravel(), len(freedoms)), (rows, columns)))
        is_free = np.ones((self.node.size, 3))
        is_free[self.node[0].ravel()] = 0.0
        is_free[self.node[:, 0].ravel(), 1] = 0.0
        is_free[self.node[:, :, 0].ravel(), 2] = 0.0
        self.is_free = is_free.ravel()

    def element_stiffness(self, poissons_ratio: float) -> Array:
        """Of one element, N/m."""
        shear = YOUNGS_MODULUS / 2 / (1 + poissons_ratio)
        lame = 2 * shear * poissons_ratio / (1 - 2 * poissons_ratio)
        elasticity = np.diag([2 * shear] * 3 + [shear] * 3)
        elasticity[:3, :3] += lame
        local = np.zeros((24, 24))
        signs = 2 * CORNERS - 1
        for point in signs * 3**-0.5:
            factors = 1 + signs * point
            slope = signs * factors[:, [1, 2, 0]] * factors[:, [2, 0, 1]] / 4 / self.size
            x, y, z = slope.T
            strain = np.zeros((6, 24))
            strain[0, 0::3], strain[1, 1::3], strain[2, 2::3] = x, y, z
            strain[3, 0::3], strain[3, 1::3] = y, x
            strain[4, 1::3], strain[4, 2::3] = z, y
            strain[5, 2::3], strain[5, 0::3] = x, z
            local += strain.T @ elasticity @ strain * self.size**3 / 8
        return local

    def interpolation(self, points: ArrayLike) -> sparse.csr_matrix:
        """Matrix that takes nodal values to values at points (m)."""
        place = (np.asarray(points, float) + np.array([SIDE / 2, 0, 0])) / self.size
        cell = np.minimum((place + 1e-9).astype(int), self.shape - 1)
        rest = (place - cell)[:, None, :]
        weights = np.where(CORNERS == 1, rest, 1 - rest).prod(-1)
        nodes = self.node[tuple(np.moveaxis(cell[:, None, :] + CORNERS, -1, 0))]
        rows = np.repeat(np.arange(len(place)), 8)
        return sparse.csr_matrix((weights.ravel(), (rows, nodes.ravel())), shape=(len(place), self.node.size))


def tension(poissons_ratio: float, points: ArrayLike, elements: int = ELEMENTS) -> Array:
    """Displacements (u, v, w) of the points, m."""
    mesh = Mesh(elements, poissons_ratio)
    load = np.zeros((mesh.node.size, 3))
    weights = np.ones(mesh.shape[1] + 1)
    weights[[0, -1]] = 0.5
    load[mesh.node[-1].ravel(), 0] = TRACTION * mesh.size**2 * np.outer(weights, weights).ravel()
    kept = np.flatnonzero(mesh.is_free)
    stiffness = mesh.stiffness[kept][:, kept]
    displacement = np.zeros(load.size)
    inverse = sparse.diags(1 / stiffness.diagonal())
    displacement[kept], info = cg(stiffness, load.ravel()[kept], rtol=1e-9, maxiter=20_000, M=inverse)
    if info != 0:
        raise RuntimeError("conjugate gradients did not converge")
    return mesh.interpolation(points) @ displacement.reshape(-1, 3)


def vibration(poissons_ratio: float, elements: int = ELEMENTS) -> tuple[Array, Array]:
    """Times (s) and displacements (u, v, w) of the point (m)."""
    mesh = Mesh(elements, poissons_ratio)
    mass = np.zeros(mesh.node.size)
    np.add.at(mass, mesh.corners.ravel(), DENSITY * mesh.size**3 / 8)
    operator = (sparse.diags(-mesh.is_free / np.repeat(mass, 3)) @ mesh.stiffness).tocsr()
    place = mesh.interpolation([POINT])
    start = np.zeros((mesh.node.size, 3))
    start[:, 0] = STRAIN * (mesh.position[:, 0] + SIDE / 2)
    return free_motion(operator, start.ravel(), (STEP, INTERVAL, END), lambda u: (place @ u.reshape(-1, 3))[0])


def values(elements: int = ELEMENTS) -> dict[str, float]:
    """Displacements by name, m: with Poisson's ratio 1/4 of bond-based blocks, and 1/3 of the ordinary ones."""
    found = {}
    points = [(x, 0.0, 0.0) for x in ALONG_X] + [(0.0, y, 0.0) for y in ALONG_Y]
    for name, poissons_ratio in (("1/4", 0.25), ("1/3", 1 / 3)):
        displacement = tension(poissons_ratio, points, elements)
        for n, x in enumerate(ALONG_X):
            found[f"tension: u at ({x:.4f}, 0, 0), nu = {name}"] = float(displacement[n, 0])
        for n, y in enumerate(ALONG_Y):
            found[f"tension: v at (0, {y:.4f}, 0), nu = {name}"] = float(displacement[len(ALONG_X) + n, 1])
        times, history = vibration(poissons_ratio, elements)
        for time, (u, v, _) in zip(times, history, strict=True):
            found[f"vibration: u at {time * 1e6:.0f} us, nu = {name}"] = float(u)
            found[f"vibration: v at {time * 1e6:.0f} us, nu = {name}"] = float(v)
    return found


if __name__ == "__main__":
    for quantity, value in values(int(sys.argv[1]) if len(sys.argv) > 1 else ELEMENTS).items():
        print(f"{quantity}: {value:.6e} m")
