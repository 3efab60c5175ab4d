"""Free laminates that are cooled or heated, with the strips at their edges where the plies strain apart.

    python3 laminate_edges.py

The model of docs/theory/laminates.md without bonds: plane stress in each layer of points, shear and opening between layers, by finite elements
with four nodes, two by two Gauss points and the displacements of each layer as unknowns. Lay-ups are symmetric about their middle: the
upper half, whose layers have equal and opposite displacements along z below; plies at 0 and 90 degrees on a quarter of the plate.
"""

import numpy as np
from laminates import GRAPHITE_EPOXY, expansion, stiffness
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import spsolve

SIDE = 0.1
G, E3, A3 = 1.308e9, 3.4e9, 63e-6


def gauss(h):
    """Shape functions and their gradients at the Gauss points of a square of edge h; nodes 00, 10, 01, 11."""
    for x in (0.5 - 0.5 / 3**0.5, 0.5 + 0.5 / 3**0.5):
        for y in (0.5 - 0.5 / 3**0.5, 0.5 + 0.5 / 3**0.5):
            n = np.array([(1 - x) * (1 - y), x * (1 - y), (1 - x) * y, x * y])
            dx = np.array([y - 1, 1 - y, -y, y]) / h
            dy = np.array([x - 1, -x, 1 - x, x]) / h
            yield n, dx, dy, h * h / 4


def layer(q, free, thickness, h):
    """Stiffness and load of an element of a layer; unknowns (node, u v w)."""
    k, f = np.zeros((12, 12)), np.zeros(12)
    for _, dx, dy, area in gauss(h):
        b = np.zeros((3, 12))
        b[0, 0::3], b[1, 1::3] = dx, dy
        b[2, 0::3], b[2, 1::3] = dy, dx
        k += thickness * area * b.T @ q @ b
        f += thickness * area * b.T @ q @ free
    return k, f


def interface(distance, rise, h, g):
    """Stiffness and load of an element between two layers; unknowns (lower and upper, node, u v w)."""
    k, f = np.zeros((24, 24)), np.zeros(24)
    for n, dx, dy, area in gauss(h):
        for axis, slope in ((0, dx), (1, dy)):
            b = np.zeros(24)
            b[axis:12:3], b[12 + axis :: 3] = -n / distance, n / distance
            b[2:12:3] = b[14::3] = slope / 2
            k += g * distance * area * np.outer(b, b)
        b = np.zeros(24)
        b[2:12:3], b[14::3] = -n, n
        k += E3 / distance * area * np.outer(b, b)
        f += E3 * A3 * rise * area * b
    return k, f


def displacements(angles, thickness, rise, cells, stations=2, g=G, side=SIDE):
    """Displacements (layer of the upper half from below, x, y, component) at nodes; positions of the nodes; layers (z, angle)."""
    quarter = all(angle % 90 == 0 for angle in angles)
    length, origin = (side / 2, 0.0) if quarter else (side, -side / 2)
    h = length / cells
    offset = 0.5 / 3**0.5 * thickness
    middles = (np.arange(len(angles)) - (len(angles) - 1) / 2) * thickness
    heights = [(z + s, a) for z, a in zip(middles, angles) for s in ((-offset, offset) if stations == 2 else (0.0,))]
    upper = [(z, a) for z, a in heights if z > -1e-12]
    nodes, unknowns = cells + 1, 3 * (cells + 1) ** 2
    number = np.arange(nodes * nodes).reshape(nodes, nodes)
    corners = np.stack([number[:-1, :-1], number[1:, :-1], number[:-1, 1:], number[1:, 1:]], axis=-1).reshape(-1, 4)
    of_element = (3 * corners[:, :, None] + np.arange(3)).reshape(-1, 12)
    rows, columns, values = [], [], []
    load = np.zeros(len(upper) * unknowns)

    def add(places, k, f):
        size = places.shape[1]
        rows.append(np.repeat(places, size, axis=1).ravel())
        columns.append(np.tile(places, (1, size)).ravel())
        values.append(np.tile(k.ravel(), len(places)))
        np.add.at(load, places.ravel(), np.tile(f, len(places)))

    for number_of_layer, (z, angle) in enumerate(upper):
        places = of_element + number_of_layer * unknowns
        part = 0.5 if abs(z) < 1e-12 else 1.0
        free = rise * np.array(expansion(GRAPHITE_EPOXY, angle))
        add(places, *layer(np.array(stiffness(GRAPHITE_EPOXY, angle)), free, part * thickness / stations, h))
        if number_of_layer > 0:
            below = of_element + (number_of_layer - 1) * unknowns
            add(np.hstack([below, places]), *interface(z - upper[number_of_layer - 1][0], rise, h, g))
    held = np.zeros(load.size, dtype=bool)
    field = held.reshape(len(upper), nodes, nodes, 3)
    lowest = upper[0][0]
    if abs(lowest) < 1e-12:
        field[0, :, :, 2] = True
    else:
        # half of the bonds to the mirrored layer, whose displacement along z is opposite
        for n, _, _, area in gauss(h):
            w = of_element[:, 2::3]
            rows.append(np.repeat(w, 4, axis=1).ravel())
            columns.append(np.tile(w, (1, 4)).ravel())
            values.append(np.tile((E3 / lowest * area * np.outer(n, n)).ravel(), len(w)))
            np.add.at(load, w.ravel(), np.tile(E3 * A3 * rise * area * n, len(w)))
    if quarter:
        field[:, 0, :, 0] = True
        field[:, :, 0, 1] = True
    else:
        middle = cells // 2
        field[0, middle, middle, :2] = True
        field[0, -1, middle, 1] = True
    matrix = coo_matrix((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))).tocsc()
    result = np.zeros(load.size)
    result[~held] = spsolve(matrix[~held][:, ~held], load[~held])
    return result.reshape(field.shape), origin + h * np.arange(nodes), upper


def strain_inside(angles, thickness, cells, **options):
    """Strain along x of the middle third: that of the line through the displacements there, all layers and rows."""
    u, x, _ = displacements(angles, thickness, -100.0, cells, **options)
    inside = np.abs(x) < 0.0167
    place = np.broadcast_to(x[inside][None, :, None], u[:, inside][:, :, inside, 0].shape)
    return (u[:, inside][:, :, inside, 0] * place).sum() / (place * place).sum()


if __name__ == "__main__":
    import sys
    theory = -1.523929e-4
    for angles, h in (([0, 90, 90, 0], 1e-3), ([45, -45, -45, 45], 0.25e-3), ([45, -45, -45, 45], 1e-3)):
        for cells in ((25, 50, 100) if angles[0] == 0 else (50, 100)):
            strain = strain_inside(angles, h, cells)
            print(f"{angles}, plies of {h} m, {cells} cells: strain {strain:.6e}, over theory - 1: {strain / theory - 1:.4%}", flush=True)
    strain = strain_inside([0, 90, 90, 0], 1e-3, 50, g=100e9)
    print(f"G 100 GPa: {strain / theory - 1:.4%}")
    strain = strain_inside([0, 90, 90, 0], 1e-3, 50, side=0.2)
    print(f"side 200 mm: {strain / theory - 1:.4%}")
    for cells in (50, 100):
        u, x, upper = displacements([0, 90, 0], 1e-3, 50.0, cells, stations=1)
        print(cells, "inside, over theory - 1", u[:, x <= 0.03][:, -1, 0, 0] / (4.651303e-5 * x[x <= 0.03][-1]) - 1)
        at = lambda f: [np.interp(0.0495, x, f[n]) for n in (0, 1)]
        print("ends: x middle, outer", at(u[:, :, 0, 0]), "y", at(u[:, 0, :, 1]))
