"""Tension of plates with a hole and with a crack by finite elements, for the cases `quench-3.3-*` and `quench-3.4-*`.

    python3 quench_mechanical_fem.py

Plate of 2 x 2 cm ([Aatitya2021] 3.3, 3.4), plane stress, nu = 1/3, lengthened by U = 1 mm between ends that slide; a
quarter of it with U/2 on its upper side. Biquadratic elements with nine nodes and 3 x 3 Gauss points. Hole of radius
4 mm: 96 elements around, 64 to the boundary of the inner part and 32 to the sides, curved along the hole; half as
many differ by less than 1e-5. Crack of half length 5 mm: 32 x 32 elements that grow with the third power away from
its tip. Energy release rate by the energies of cracks of half lengths 4.99 and 5.01 mm.

Stresses and energies are those over Young's modulus; displacements do not depend on it. Prints displacements (m),
stresses over E and the energy release rate over E (m). Needs NumPy and SciPy."""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import spsolve

Array = NDArray[np.float64]
Nodes = NDArray[np.int64]

HALF, LENGTHENING, POISSONS_RATIO = 0.01, 1e-3, 1 / 3  # m, m, -
RADIUS, CRACK = 0.004, 0.005  # m
GAUSS = (np.array([-(0.6**0.5), 0.0, 0.6**0.5]), np.array([5, 8, 5]) / 9)
ELASTICITY = np.array([[1, POISSONS_RATIO, 0], [POISSONS_RATIO, 1, 0], [0, 0, (1 - POISSONS_RATIO) / 2]])
ELASTICITY /= 1 - POISSONS_RATIO**2


def shape(r: float) -> tuple[Array, Array]:
    """Quadratic functions of the nodes at -1, 0 and 1, and their derivatives."""
    return np.array([r * (r - 1) / 2, 1 - r * r, r * (r + 1) / 2]), np.array([r - 0.5, -2 * r, r + 0.5])


class Plate:
    """Nodes in a grid of odd numbers (2 elements + 1), and the solution of the quarter with some nodes held along y."""

    def __init__(self, x: Array, y: Array, held_below: NDArray[np.bool_], top: NDArray[np.bool_]) -> None:
        self.x, self.y = x, y
        self.number = np.arange(x.size).reshape(x.shape)
        starts = self.number[:-2:2, :-2:2]
        steps = np.array([i * x.shape[1] + j for i in range(3) for j in range(3)])
        self.nodes: Nodes = starts.reshape(-1, 1) + steps
        matrix = self.stiffness()
        freedoms = 2 * x.size
        u, known = np.zeros(freedoms), np.zeros(freedoms, bool)
        known[2 * self.number[np.abs(x) < 1e-12]] = True
        known[2 * self.number[held_below] + 1] = True
        top_nodes = 2 * self.number[top] + 1
        known[top_nodes], u[top_nodes] = True, LENGTHENING / 2
        free = np.flatnonzero(~known)
        u[free] = spsolve(matrix[free][:, free], -(matrix[free] @ u))
        force = matrix @ u
        # of the half section of the quarter, over E and the thickness
        self.stress = float(force[top_nodes].sum()) / HALF
        self.energy = float(0.5 * u @ force)
        self.u_x, self.u_y = u[0::2].reshape(x.shape), u[1::2].reshape(x.shape)

    def gradients(self, r: float, s: float) -> tuple[Array, Array]:
        """Derivatives of the functions of all elements along x and y (elements x 2 x 9), and the areas per (r, s)."""
        (n, dn), (m, dm) = shape(r), shape(s)
        local = np.stack([np.outer(dn, m).ravel(), np.outer(n, dm).ravel()])
        places = np.stack([self.x.ravel()[self.nodes], self.y.ravel()[self.nodes]], 2)
        jacobian = local @ places
        return np.linalg.solve(jacobian, np.broadcast_to(local, (len(self.nodes), 2, 9))), np.linalg.det(jacobian)

    def strains(self, r: float, s: float) -> tuple[Array, Array]:
        """Matrices from the displacements of an element to its strains, and areas."""
        gradient, area = self.gradients(r, s)
        strain = np.zeros((len(self.nodes), 3, 18))
        strain[:, 0, 0::2], strain[:, 1, 1::2] = gradient[:, 0], gradient[:, 1]
        strain[:, 2, 0::2], strain[:, 2, 1::2] = gradient[:, 1], gradient[:, 0]
        return strain, area

    def stiffness(self):  # type: ignore[no-untyped-def]
        """Of the plate, over E and its thickness."""
        local = np.zeros((len(self.nodes), 18, 18))
        for r, a in zip(*GAUSS):
            for s, b in zip(*GAUSS):
                strain, area = self.strains(r, s)
                local += (a * b * np.abs(area))[:, None, None] * (strain.transpose(0, 2, 1) @ ELASTICITY @ strain)
        freedoms = np.stack([2 * self.nodes, 2 * self.nodes + 1], 2).reshape(-1, 18)
        rows, columns = np.repeat(freedoms, 18, 1).ravel(), np.tile(freedoms, (1, 18)).ravel()
        return coo_matrix((local.ravel(), (rows, columns))).tocsr()

    def stress_below(self) -> tuple[Array, Array]:
        """Positions (m) along the first column of nodes, and stress yy there over E."""
        of_elements = np.stack([self.u_x.ravel()[self.nodes], self.u_y.ravel()[self.nodes]], 2).reshape(-1, 18)
        first = np.flatnonzero(self.nodes[:, 0] % self.x.shape[1] == 0)
        positions, stresses = [], []
        for r in (-1.0, 0.0, 1.0):
            strain, _ = self.strains(r, -1.0)
            stress = np.einsum("ij,ejk,ek->ei", ELASTICITY, strain[first], of_elements[first])
            positions.append(self.x.ravel()[self.nodes[first, 3 * round(r + 1)]])
            stresses.append(stress[:, 1])
        order = np.argsort(np.concatenate(positions), kind="stable")
        return np.concatenate(positions)[order], np.concatenate(stresses)[order]


def with_hole(fineness: int = 2) -> Plate:
    """Rays from the hole to the sides: circles inside, straight to the sides beyond."""
    around, inside, outside = 48 * fineness, 32 * fineness, 16 * fineness
    angle = np.linspace(0, np.pi / 2, 2 * around + 1)
    edge = 0.55 * HALF
    radius = RADIUS * (edge / RADIUS) ** np.linspace(0, 1, 2 * inside + 1)
    x, y = radius[:, None] * np.cos(angle), radius[:, None] * np.sin(angle)
    # the ray in the middle ends in the corner
    up = np.tan(np.linspace(0, np.pi / 4, around + 1))
    side_x = HALF * np.concatenate([np.ones(around + 1), up[-2::-1]])
    side_y = HALF * np.concatenate([up, np.ones(around)])
    part = np.linspace(0, 1, 2 * outside + 1)[1:, None]
    x = np.vstack([x, (1 - part) * x[-1] + part * side_x])
    y = np.vstack([y, (1 - part) * y[-1] + part * side_y])
    return Plate(x, y, np.abs(y) < 1e-12, np.abs(y - HALF) < 1e-12)


def with_crack(half_length: float = CRACK, elements: int = 32) -> Plate:
    """A grid that is finest at the tip."""
    # the middle node of an element lies in its middle
    corners = np.linspace(0, 1, elements + 1) ** 3

    def nodes(corners: Array) -> Array:
        found = np.empty(2 * len(corners) - 1)
        found[0::2], found[1::2] = corners, 0.5 * (corners[1:] + corners[:-1])
        return found

    along = np.concatenate([half_length * (1 - corners[::-1]), half_length + (HALF - half_length) * corners[1:]])
    x, y = np.meshgrid(nodes(along), nodes(HALF * corners), indexing="ij")
    ligament = (np.abs(y) < 1e-12) & (x > half_length - 1e-9)
    return Plate(x, y, ligament, np.abs(y - HALF) < 1e-12)


def values() -> dict[str, float]:
    """For a lengthening of 1 mm: stresses over E, displacements (m), energy release rate over E (m)."""
    hole, crack = with_hole(), with_crack()
    x, stress = hole.stress_below()
    found = {"hole: mean stress at the top": hole.stress, "hole: largest stress": float(stress.max())}
    for mm in (1, 2, 3, 4, 5):
        found[f"hole: stress {mm} mm beside it"] = float(np.interp(RADIUS + mm / 1000, x, stress))
    found["hole: u_x of the side at mid height"] = float(hole.u_x[-1, 0])
    found["crack: mean stress at the top"] = crack.stress
    found["crack: half opening in its middle"] = float(crack.u_y[0, 0])
    found["crack: u_x of the side at mid height"] = float(crack.u_x[-1, 0])
    # of one tip and both halves beside the crack
    change = with_crack(CRACK - 1e-5).energy - with_crack(CRACK + 1e-5).energy
    found["crack: energy release rate"] = 2 * change / 2e-5
    return found


if __name__ == "__main__":
    for name, value in values().items():
        print(f"{name} {value:.6g}")
