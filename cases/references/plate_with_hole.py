"""Square plate with an elliptical hole under tension by finite elements, for the cases `khoshrou-4.*`.

    python3 plate_with_hole.py [refinement]

A plate of 0.5 m x 0.5 m in plane stress, E = 200 GPa, Poisson's ratio 0.3, with a hole of the semi-axes a along x and
b along y in its middle, pulled along y by 10 MPa at y = -0.25 and 0.25 m ([Khoshrou2024], chapter 4). One quarter
with curved biquadratic elements (9 nodes) on a confocal mesh around the hole, whose outer part leads to the square; 4
x 4 Gauss points. With refinement 2 it has 140 322 unknowns; refinement 1 changes stresses at the tip and at the first
point by up to 0.4 %, others by at most 0.1 %. Stresses are projected to the shape functions by least squares; values
between nodes are interpolated linearly. `infinite_plate` is the closed form of Inglis (1913) and Kirsch (1898) on the
axis y = 0 of an infinite plate. Needs NumPy and SciPy.
"""

import sys

import numpy as np
import scipy.sparse as sparse
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import LinearNDInterpolator
from scipy.sparse.linalg import spsolve

Array = NDArray[np.float64]

YOUNGS_MODULUS, POISSONS_RATIO, TENSION = 200e9, 0.3, 10e6  # Pa, -, Pa
HALF = 0.25  # half side of the plate, m
SEMI_AXIS = 0.05  # of the hole along x, m
REFINEMENT = 2

# case: semi-axis of the hole along y, height of the row of points, and (first, distance, number) of points along it, m
ROWS = {
    "circle": (0.05, 0.00125, [(0.05375, 0.005, 40), (0.06125, 0.0025, 36)]),
    "4.1a": (0.00625, 0.000625, [(0.050625, 0, 1), (0.053125, 0.005, 40)]),
    "4.1b": (0.00625, 0.0003125, [(0.0503125, 0, 1), (0.0528125, 0.005, 40)]),
    "4.2": (0.005, 0.0003125, [(0.0503125, 0, 1), (0.0528125, 0.005, 40), (0.0509375, 0.00125, 20)]),
}


# where the displacement along y is compared, m
ABOVE = [(x, y) for y in (0.05, 0.1, 0.2) for x in (0.05, 0.1, 0.15, 0.2)]


def infinite_plate(x: ArrayLike, a: float, b: float) -> Array:
    """Stress along y over the tension on y = 0, x >= a, around an elliptical hole in an infinite plate."""
    x = np.asarray(x, float)
    m = (a - b) / (a + b)
    q = ((x + np.sqrt(x * x - (a * a - b * b))) / (a + b)) ** 2
    k = 1 + m + m * m
    return (
        0.5 * (q + 2 + m) / (q - m)
        - (1 + m) * q * (q + m) / (q - m) ** 3
        + 0.5 * (q / (q - m) + (k * q * q + (k * m + 3) * q - m) / (q - m) ** 3)
    )


def mesh(a: float, b: float, refinement: int) -> Array:
    """Positions of the nodes (m), in rows around the hole: every second node is a corner of elements."""
    around, outwards, outer = 64 * refinement, 48 * refinement, 20 * refinement
    angle = np.linspace(0, np.pi / 2, around + 1)
    if a > b:
        focus, start = np.sqrt(a * a - b * b), np.arctanh(b / a)
        level = start + (np.arcsinh(0.55 * HALF / focus) - start) * np.linspace(0, 1, outwards + 1) ** 1.3
        x = focus * np.cosh(level)[:, None] * np.cos(angle)
        y = focus * np.sinh(level)[:, None] * np.sin(angle)
    else:
        radius = a * (0.55 * HALF / a) ** np.linspace(0, 1, outwards + 1)
        x, y = radius[:, None] * np.cos(angle), radius[:, None] * np.sin(angle)
    half = around // 2  # this ray ends in the corner of the square
    slopes = HALF * np.tan(np.linspace(0, np.pi / 4, half + 1))
    square_x = np.concatenate([np.full(half, HALF), slopes[::-1]])
    square_y = np.concatenate([slopes, np.full(half, HALF)])
    part = np.linspace(0, 1, outer + 1)[1:, None]
    x = np.vstack([x, (1 - part) * x[-1] + part * square_x])
    y = np.vstack([y, (1 - part) * y[-1] + part * square_y])
    corner = np.stack([x, y], -1)
    node = np.zeros((2 * corner.shape[0] - 1, 2 * corner.shape[1] - 1, 2))
    node[::2, ::2] = corner
    node[1::2, ::2] = 0.5 * (corner[1:] + corner[:-1])
    node[:, 1::2] = 0.5 * (node[:, 2::2] + node[:, :-1:2])
    node[0] /= np.hypot(node[0, :, 0] / a, node[0, :, 1] / b)[:, None]
    return node


def shapes(s: float) -> tuple[Array, Array]:
    """Quadratic functions of the nodes at -1, 0 and 1, and their slopes."""
    return np.array([s * (s - 1) / 2, 1 - s * s, s * (s + 1) / 2]), np.array([s - 0.5, -2 * s, s + 0.5])


class Plate:
    """Displacement (m) and stress along y (Pa) at the nodes of the mesh."""

    def __init__(self, a: float, b: float, refinement: int = REFINEMENT) -> None:
        grid = mesh(a, b, refinement)
        rows, columns = grid.shape[:2]
        number = np.arange(rows * columns).reshape(rows, columns)
        first = number[:-2:2, :-2:2].ravel()
        self.element = first[:, None] + (np.arange(3)[:, None] * columns + np.arange(3)).ravel()
        self.node = grid.reshape(-1, 2)
        shear = YOUNGS_MODULUS / 2 / (1 + POISSONS_RATIO)
        lame = YOUNGS_MODULUS * POISSONS_RATIO / (1 - POISSONS_RATIO**2)  # plane stress
        elasticity = np.array([[lame + 2 * shear, lame, 0], [lame, lame + 2 * shear, 0], [0, 0, shear]])

        elements = len(self.element)
        stiffness, mass = np.zeros((elements, 18, 18)), np.zeros((elements, 9, 9))
        points = []
        for (s, ws), (t, wt) in ((p, q) for p in zip(*GAUSS, strict=True) for q in zip(*GAUSS, strict=True)):
            (ns, ds), (nt, dt) = shapes(s), shapes(t)
            value = np.outer(ns, nt).ravel()
            local = np.stack([np.outer(ds, nt).ravel(), np.outer(ns, dt).ravel()])
            jacobian = local @ self.node[self.element]
            slope = np.linalg.solve(jacobian, np.broadcast_to(local, (elements, 2, 9)))
            area = np.abs(np.linalg.det(jacobian)) * ws * wt
            strain = np.zeros((elements, 3, 18))
            strain[:, 0, 0::2], strain[:, 1, 1::2] = slope[:, 0], slope[:, 1]
            strain[:, 2, 0::2], strain[:, 2, 1::2] = slope[:, 1], slope[:, 0]
            stiffness += np.einsum("eia,ij,ejb,e->eab", strain, elasticity, strain, area, optimize=True)
            mass += area[:, None, None] * np.outer(value, value)
            points.append((value, strain, area))

        freedoms = np.stack([2 * self.element, 2 * self.element + 1], -1).reshape(elements, 18)
        matrix = assembled(freedoms, stiffness)
        load = np.zeros(len(matrix.indptr) - 1)
        top = number[-1, columns // 2 :]
        lengths = -np.diff(self.node[top[::2], 0])
        for part, weight in ((top[:-2:2], 1 / 6), (top[1:-1:2], 4 / 6), (top[2::2], 1 / 6)):
            np.add.at(load, 2 * part + 1, TENSION * weight * lengths)
        free = np.ones(len(load), bool)
        free[2 * number[:, 0] + 1] = False  # y = 0
        free[2 * number[:, -1]] = False  # x = 0
        displacement = np.zeros(len(load))
        displacement[free] = spsolve(matrix[free][:, free].tocsc(), load[free])
        self.displacement = displacement.reshape(-1, 2)

        projected = np.zeros(len(self.node))
        for value, strain, area in points:
            stress = np.einsum("j,eja,ea->e", elasticity[1], strain, displacement[freedoms])
            np.add.at(projected, self.element, (area * stress)[:, None] * value)
        self.stress = spsolve(assembled(self.element, mass).tocsc(), projected)
        self.tip = self.stress[number[0, 0]]

    def at(self, points: ArrayLike) -> tuple[Array, Array]:
        """Displacement along x (m) and stress along y (Pa) at points (m)."""
        values = np.stack([self.displacement[:, 0], self.stress], -1)
        u, stress = LinearNDInterpolator(self.node, values)(points).T
        return u, stress

    def along_y(self, points: ArrayLike) -> Array:
        """Displacement along y (m) at points (m)."""
        return np.asarray(LinearNDInterpolator(self.node, self.displacement[:, 1])(points))

    def displacement_near(self, point: tuple[float, float]) -> Array:
        """Of the node nearest to a point, m."""
        return self.displacement[np.argmin(np.hypot(*(self.node - point).T))]


GAUSS = np.polynomial.legendre.leggauss(4)


def assembled(freedoms: NDArray[np.intp], local: Array) -> sparse.csr_matrix:
    """The sum of element matrices."""
    count = freedoms.shape[1]
    rows, columns = np.repeat(freedoms, count, 1).ravel(), np.tile(freedoms, (1, count)).ravel()
    return sparse.csr_matrix((local.ravel(), (rows, columns)))


def values(refinement: int = REFINEMENT) -> dict[str, float]:
    """Displacements (m) and stresses (Pa) by name."""
    found = {}
    plates: dict[float, Plate] = {}
    for case, (b, height, parts) in ROWS.items():
        row = sorted({round(first + step * n, 7) for first, step, count in parts for n in range(count)})
        if b not in plates:
            plates[b] = Plate(SEMI_AXIS, b, refinement)
        plate = plates[b]
        u, stress = plate.at([(x, height) for x in row])
        for n, x in enumerate(row):
            found[f"{case}: u at ({x:.7f}, {height}), m"] = float(u[n])
            found[f"{case}: stress along y at ({x:.7f}, {height}), Pa"] = float(stress[n])
        for (x, y), v in zip(ABOVE, plate.along_y(ABOVE), strict=True):
            found[f"{case}: v at ({x}, {y}), m"] = float(v)
        found[f"{case}: stress along y at the tip, Pa"] = float(plate.tip)
    found["circle: v in the middle of the loaded edge, m"] = float(plates[0.05].displacement_near((0.0, HALF))[1])
    return found


if __name__ == "__main__":
    for quantity, number in values(int(sys.argv[1]) if len(sys.argv) > 1 else REFINEMENT).items():
        print(f"{quantity}: {number:.6e}")
