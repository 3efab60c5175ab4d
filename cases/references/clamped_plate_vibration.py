"""Free vibration of a clamped plate in plane stress by finite elements, for the cases `wang-4.3.2-*`,
`wang-4.3.6-vibration-*` and `wang-5.4.1.*`.

    python3 clamped_plate_vibration.py [elements]

The plate of `clamped_plate.py`, density 7850 kg/m3, held at x = -0.5 m in both components. It is released at rest
from u = 0.001 (x + 0.5 m), v = 0 ([Wang2025], 4.3.2). Bilinear quadrilaterals, 400 x 400 of them, lumped mass,
velocity Verlet with steps of 1e-7 s for 1 ms. Prints the displacement at (0.255, 0.255) m, interpolated bilinearly,
every 20 us; 100 x 100 elements differ by 0.24 % in u and 0.8 % in v (root mean square over the largest value). Takes
some minutes. Needs NumPy and SciPy.
"""

import sys
from collections.abc import Callable

import numpy as np
import scipy.sparse as sparse

from clamped_plate import ELEMENTS, SIDE, THICKNESS, Array, Mesh

DENSITY = 7850.0  # kg/m3
STRAIN = 1e-3
POINT = (0.255, 0.255)  # m
STEP, INTERVAL, END = 1e-7, 2e-5, 1e-3  # s


def free_motion(
    operator: sparse.csr_matrix,
    start: Array,
    span: tuple[float, float, float],
    observe: Callable[[Array], Array],
) -> tuple[Array, Array]:
    """Times (s) and what is observed of u'' = operator u from rest, by velocity Verlet.

    The span has the step, the interval of observations and the end, s.
    """
    step, interval, end = span
    displacement, velocity = start.copy(), np.zeros_like(start)
    acceleration = operator @ displacement
    every = round(interval / step)
    history = []
    for number in range(round(end / step) + 1):
        if number % every == 0:
            history.append(observe(displacement))
        velocity += 0.5 * step * acceleration
        displacement += step * velocity
        acceleration = operator @ displacement
        velocity += 0.5 * step * acceleration
    return interval * np.arange(len(history)), np.array(history)


def vibration(poissons_ratio: float, elements: int = ELEMENTS, end: float = END) -> tuple[Array, Array]:
    """Times (s) and displacements (u, v) of the point (m)."""
    mesh = Mesh(elements, poissons_ratio)
    mass = np.zeros(mesh.node.size)
    np.add.at(mass, mesh.corners.ravel(), DENSITY * THICKNESS * (SIDE / elements) ** 2 / 4)
    inverse_mass = np.repeat(1 / mass, 2)
    inverse_mass[mesh.held] = 0.0
    operator = (sparse.diags(-inverse_mass) @ mesh.stiffness).tocsr()
    place = mesh.interpolation([POINT])
    displacement = np.zeros(2 * mesh.node.size)
    displacement[0::2] = STRAIN * SIDE * np.tile(np.linspace(0, 1, elements + 1), elements + 1)
    return free_motion(operator, displacement, (STEP, INTERVAL, end), lambda u: (place @ u.reshape(-1, 2))[0])


def values(elements: int = ELEMENTS) -> dict[str, float]:
    """Displacements by name, m: with Poisson's ratio 1/3 of bond-based plates, and 1/4 of the ordinary ones."""
    found = {}
    for name, poissons_ratio in (("1/3", 1 / 3), ("1/4", 0.25)):
        times, history = vibration(poissons_ratio, elements)
        for time, (u, v) in zip(times, history, strict=True):
            found[f"u at {time * 1e3:.2f} ms, nu = {name}"] = float(u)
            found[f"v at {time * 1e3:.2f} ms, nu = {name}"] = float(v)
    return found


if __name__ == "__main__":
    for quantity, value in values(int(sys.argv[1]) if len(sys.argv) > 1 else ELEMENTS).items():
        print(f"{quantity}: {value:.6e} m")
