"""A slender thermoelastic bar that is heated at its end: one-dimensional reference of `gao-3.5.3-block-thermal`.

Gao (2020), section 3.5.3, in scales in which density, heat capacity, conductivity, lambda + 2 mu and the thermal
modulus of three dimensions are 1. The sides are free: the lateral stresses are zero, and elimination of the lateral
strains from the scaled equations 3.20 gives

    u_tt = e u_xx - a T_x,   (1 + 2 eps (1 - nu)) T_t = T_xx - eps a u_xt,   e u_x = a T and T = sin(t) at x = 0,
    e = (1 + nu)(1 - 2 nu)/(1 - nu),   a = 1 - 2 nu.

Lateral inertia and lateral gradients of the temperature are neglected. Linear finite elements in space, the trapezoidal
rule in time for displacement, velocity and temperature at once.

    python3 thermoelastic_bar.py [elements] [steps]
"""

import sys

import numpy as np
from scipy.sparse import block_diag, bmat, diags, identity
from scipy.sparse.linalg import splu

RATIO, COUPLING, LENGTH = 0.33, 1.0, 5.0
PLACES = (0.0, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 2.5, 3.0)


def solve(elements: int = 2000, steps: int = 4000) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Nodes, and temperatures and displacements at pi/4, pi/2, 3 pi/4 and pi; `steps` is a multiple of 4."""
    size, step = LENGTH / elements, np.pi / steps
    stiffness = (1 + RATIO) * (1 - 2 * RATIO) / (1 - RATIO)
    modulus, capacity = 1 - 2 * RATIO, 1 + 2 * COUPLING * (1 - RATIO)
    nodes = elements + 1
    ends = np.ones(nodes)
    ends[[0, -1]] = 0.5
    mass = diags([size * ends, np.full(elements, 0.0)], [0, 1])
    second = diags([2 * ends, -np.ones(elements), -np.ones(elements)], [0, 1, -1]) / size
    # integral of N_i N_j'
    slope = diags([np.full(elements, 0.5), np.full(elements, -0.5)], [1, -1]).tolil()
    slope[0, 0], slope[-1, -1] = -0.5, 0.5
    slope = slope.tocsr()
    free = np.arange(nodes - 1)  # displacement: the last node is held
    warm = np.arange(1, nodes)  # temperature: the first node is given
    m, k = mass.tocsr()[free][:, free], stiffness * second.tocsr()[free][:, free]
    b = modulus * slope.T.tocsr()[free]  # force of the temperature
    c, d = capacity * mass.tocsr()[warm][:, warm], second.tocsr()[warm]
    g = COUPLING * modulus * slope[warm][:, free]
    unit, none = identity(len(free)), None
    left = block_diag([unit, m, c]).tocsr()
    rate = bmat([[unit * 0, unit, none], [-k, m * 0, b[:, warm]], [none, -g, -d[:, warm]]]).tocsr()
    implicit, explicit = splu((left - 0.5 * step * rate).tocsc()), left + 0.5 * step * rate
    state = np.zeros(left.shape[0])
    given_force = b[:, [0]].toarray()[:, 0]
    given_heat = d[:, [0]].toarray()[:, 0]
    temperatures, displacements = [], []
    for number in range(1, steps + 1):
        mean = 0.5 * (np.sin((number - 1) * step) + np.sin(number * step))
        load = np.concatenate([np.zeros(len(free)), mean * given_force, -mean * given_heat])
        state = implicit.solve(explicit @ state + step * load)
        if number % (steps // 4) == 0:
            displacements.append(np.append(state[: len(free)], 0.0))
            temperatures.append(np.append(np.sin(number * step), state[2 * len(free) :]))
    return np.linspace(0, LENGTH, nodes), np.array(temperatures), np.array(displacements)


def values(elements: int = 2000, steps: int = 4000) -> dict[str, float]:
    """Temperatures and displacements along the axis by name."""
    x, temperatures, displacements = solve(elements, steps)
    found = {}
    for row, time in enumerate(("pi/4", "pi/2", "3pi/4", "pi")):
        for place in PLACES:
            found[f"T at x = {place}, t = {time}"] = float(np.interp(place, x, temperatures[row]))
            found[f"u at x = {place}, t = {time}"] = float(np.interp(place, x, displacements[row]))
    return found


if __name__ == "__main__":
    for name, value in values(*map(int, sys.argv[1:3])).items():
        print(f"{name}: {value:.4f}")
