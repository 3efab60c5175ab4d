"""Displacements of the laminate whose edge is in a fire (gao-8.4.1-*), without damage.

    python3 laminate_fire_displacements.py

Plane stress in each ply of the laminate [0/90/0], with shear between the middles of plies: elements with four nodes and two by two Gauss points on the
finite volumes of `laminate_fire.py`, whose temperatures they take. By symmetry there is no deflection. Displacements are those of the lowest ply. Elastic constants and mean expansions from 293 K are those of
[Gao2020], eqs. 8.5 to 8.9, which keep their last values at higher temperatures; the end x = L is clamped.
"""

import numpy as np
from laminate_fire import heated_edge
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import spsolve

LENGTH = 0.1
PLY = 0.001
REFERENCE = 293.0
SHEAR_ACROSS = 1.308e9


def constants(t):
    """E1, E2, G12 (Pa), alpha1 and alpha2 (1/K) at temperatures (K)."""
    e1 = np.where(t < 475, 146.64937 - 0.06535 * t, 110.86495 + 905.51983 * np.exp(-t / 91.34695))
    e2 = np.where(t < 475, 4.645 - 4.529 * np.tanh(0.02177 * (t - 373)), 0.1)
    g12 = 2.29 - 2.238 * np.tanh(0.0199 * (t - 373))
    hot = np.minimum(t, 623.0)
    a1 = np.where(
        t <= 293, 1.38, np.where(hot <= 413, 36.71 - 0.2116 * hot + 0.0003106 * hot**2, -10.95 + 0.032 * hot)
    )
    a2 = np.where(
        t <= 313, 29.263, np.where(hot <= 413, 388.9 - 2.401 * hot + 0.004 * hot**2, -231.966 + 0.75431 * hot)
    )
    return e1 * 1e9, e2 * 1e9, g12 * 1e9, a1 * 1e-6, a2 * 1e-6


def membrane(t):
    """Stiffness (xx, yy, 2 xy), Pa, and thermal stress, Pa, of each element of a ply; t by ply, x and y."""
    stiffness = np.zeros((*t.shape, 3, 3))
    stress = np.zeros((*t.shape, 3))
    nu = 0.33
    for ply, (along, across) in enumerate(((0, 1), (1, 0), (0, 1))):
        e1, e2, g12, a1, a2 = constants(t[ply])
        whole = 1 - nu**2 * e2 / e1
        q = stiffness[ply]
        q[..., along, along] = e1 / whole
        q[..., across, across] = e2 / whole
        q[..., 0, 1] = q[..., 1, 0] = nu * e2 / whole
        q[..., 2, 2] = g12
        strain = np.zeros((*t.shape[1:], 3))
        strain[..., along] = a1 * (t[ply] - REFERENCE)
        strain[..., across] = a2 * (t[ply] - REFERENCE)
        stress[ply] = np.einsum("xyab,xyb->xya", q, strain)
    return stiffness, stress


def displacements(t):
    """Displacements at the nodes (ply, x, y, component) by temperatures of the elements (ply, x, y)."""
    plies, cells = t.shape[:2]
    h = LENGTH / cells
    stiffness, stress = membrane(t)
    gauss = 0.5 * h * (1 + np.array([-1, 1]) / np.sqrt(3))
    element = np.zeros((plies, cells, cells, 8, 8))
    load = np.zeros((plies, cells, cells, 8))
    shear = np.zeros((8, 8))
    for x in gauss:
        for y in gauss:
            # nodes (0, 0), (1, 0), (1, 1), (0, 1)
            dx = np.array([-(h - y), h - y, y, -y]) / h**2
            dy = np.array([-(h - x), -x, x, h - x]) / h**2
            b = np.zeros((3, 8))
            b[0, 0::2] = dx
            b[1, 1::2] = dy
            b[2, 0::2], b[2, 1::2] = dy, dx
            weight = PLY * h * h / 4
            element += weight * np.einsum("ai,pxyab,bj->pxyij", b, stiffness, b)
            load += weight * np.einsum("ai,pxya->pxyi", b, stress)
            value = np.array([(h - x) * (h - y), x * (h - y), x * y, (h - x) * y]) / h**2
            n = np.kron(value, np.eye(2))
            shear += h * h / 4 * SHEAR_ACROSS / PLY * n.T @ n
    nodes = np.arange((cells + 1) ** 2).reshape(cells + 1, cells + 1)
    corners = np.stack([nodes[:-1, :-1], nodes[1:, :-1], nodes[1:, 1:], nodes[:-1, 1:]], axis=-1)
    plane = np.stack([2 * corners, 2 * corners + 1], axis=-1).reshape(cells, cells, 8)
    freedoms = np.stack([plane + 2 * nodes.size * ply for ply in range(plies)])
    blocks = [(freedoms, freedoms, element)]
    for ply in range(plies - 1):
        for i, j in ((0, 0), (0, 1), (1, 0), (1, 1)):
            sign = 1 if i == j else -1
            blocks.append((freedoms[ply + i], freedoms[ply + j], np.broadcast_to(sign * shear, (cells, cells, 8, 8))))
    rows, columns, values = [], [], []
    for first, second, matrix in blocks:
        rows.append(np.broadcast_to(first[..., :, None], matrix.shape).ravel())
        columns.append(np.broadcast_to(second[..., None, :], matrix.shape).ravel())
        values.append(matrix.ravel())
    count = 2 * nodes.size * plies
    rows, columns, values = map(np.concatenate, (rows, columns, values))
    matrix = coo_matrix((values, (rows, columns)), (count, count)).tocsr()
    right = np.zeros(count)
    np.add.at(right, freedoms.ravel(), load.ravel())
    free = np.ones((plies, nodes.size, 2), bool)
    free[:, nodes[-1]] = False
    free = free.ravel()
    u = np.zeros(count)
    u[free] = spsolve(matrix[free][:, free], right[free])
    return u.reshape(plies, cells + 1, cells + 1, 2)


def at(u, x, y):
    """Displacement at a position, y from the lower edge, linear between nodes."""
    h = LENGTH / (len(u) - 1)
    i, j = min(int(x / h), len(u) - 2), min(int(y / h), len(u) - 2)
    fx, fy = x / h - i, y / h - j
    return (
        (1 - fx) * (1 - fy) * u[i, j]
        + fx * (1 - fy) * u[i + 1, j]
        + fx * fy * u[i + 1, j + 1]
        + (1 - fx) * fy * u[i, j + 1]
    )


if __name__ == "__main__":
    for cells, step in ((40, 0.1), (80, 0.05)):
        for time, t in heated_edge(cells, step):
            u = displacements(t)[0] * 1e6
            half = LENGTH / 2
            print(f"{cells} x {cells}, {time:.0f} s, micrometres:")
            print("   nodes", [round(v, 3) for v in (u[0, cells // 2, 0], *u[0, 0], *u[0, cells // 4], u[cells // 2, cells // 2, 0])])
            near = 0.00125
            first, corner, quarter = (at(u, near, y) for y in (half, near, half / 2))
            middle = at(u, half, half)
            print("   points", [round(v, 3) for v in (first[0], *corner, *quarter, middle[0])])
