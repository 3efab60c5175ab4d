#!/usr/bin/env python3
"""Reference of `gao-3.5.3-block-thermal`: coupled thermoelasticity of a slender block by finite elements.

Quadratic elements on a structured grid of a quarter of the block 5 x 0.15 x 0.15; matrices are Kronecker products of
those along the axes. The trapezoidal rule in time, for displacement, velocity and temperature at once. Scales as in
the case: density, heat capacity, conductivity, lambda + 2 mu and the thermal modulus are 1, and so is the coupling.
Prints temperature and displacement along the axis at pi/4, pi/2, 3 pi/4 and pi.

    pip install numpy scipy
    python cases/references/block_thermal.py 100 2 2000
"""

import sys

import numpy as np
import scipy.sparse as sparse
from scipy.sparse.linalg import splu

POISSON = 0.33
LENGTH, HALF_WIDTH = 5.0, 0.075
PLACES = np.array([0, 0.25, 0.5, 0.75, 1, 1.5, 2, 2.5, 3])


def along_axis(length, elements):
    """Integrals of N N, N' N' and N N' along an axis, and the nodes."""
    size = length / elements
    points, weights = np.polynomial.legendre.leggauss(4)
    s, weights = (points + 1) / 2, weights / 2 * size
    shape = np.array([2 * (s - 0.5) * (s - 1), -4 * s * (s - 1), 2 * s * (s - 0.5)])
    slope = np.array([4 * s - 3, 4 - 8 * s, 4 * s - 1]) / size
    nodes = 2 * elements + 1
    matrices = []
    for left, right in ((shape, shape), (slope, slope), (shape, slope)):
        matrix = sparse.lil_matrix((nodes, nodes))
        for element in range(elements):
            own = slice(2 * element, 2 * element + 3)
            matrix[own, own] += np.einsum("iq,jq,q->ij", left, right, weights)
        matrices.append(matrix.tocsr())
    return matrices, np.linspace(0, length, nodes)


def product(x, y, z):
    return sparse.kron(sparse.kron(x, y), z, format="csr")


def main():
    elements_along, elements_across, steps = (int(a) for a in sys.argv[1:4])
    (mx, sx, dx), x = along_axis(LENGTH, elements_along)
    (m, s, d), y = along_axis(HALF_WIDTH, elements_across)
    mass = product(mx, m, m)
    second = [product(sx, m, m), product(mx, s, m), product(mx, m, s)]
    conductivity = sum(second)
    lame = POISSON / (1 - POISSON)
    shear = (1 - lame) / 2
    diagonal = [second[a] + shear * (conductivity - second[a]) for a in range(3)]
    xy = lame * product(dx.T, d, m) + shear * product(dx, d.T, m)
    xz = lame * product(dx.T, m, d) + shear * product(dx, m, d.T)
    yz = lame * product(mx, d.T, d) + shear * product(mx, d, d.T)
    stiffness = sparse.bmat([[diagonal[0], xy, xz], [xy.T, diagonal[1], yz], [xz.T, yz.T, diagonal[2]]]).tocsr()
    coupling = sparse.vstack([product(dx.T, m, m), product(mx, d.T, m), product(mx, m, d.T)]).tocsr()
    inertia = sparse.block_diag([mass] * 3).tocsr()

    nodes = mass.shape[0]
    number = np.arange(nodes).reshape(len(x), len(y), len(y))
    held = [number[-1].ravel() + a * nodes for a in range(3)]
    symmetry = [number[:, 0, :].ravel() + nodes, number[:, :, 0].ravel() + 2 * nodes]
    moving = np.setdiff1d(np.arange(3 * nodes), np.concatenate(held + symmetry))
    heated = number[0].ravel()
    inner = np.setdiff1d(np.arange(nodes), heated)

    dt = np.pi / steps
    own = coupling[moving][:, inner]
    mechanical = inertia[moving][:, moving] / dt + dt / 4 * stiffness[moving][:, moving]
    thermal = mass[inner][:, inner] / dt + 0.5 * conductivity[inner][:, inner]
    system = splu(sparse.bmat([[mechanical, -0.5 * own], [0.5 * own.T, thermal]]).tocsc())

    displacement, velocity, temperature = np.zeros(3 * nodes), np.zeros(3 * nodes), np.zeros(nodes)
    printed = [int(np.argmin(abs(x - place))) for place in PLACES]
    assert np.allclose(x[printed], PLACES), "a number of elements that has nodes at the places"
    for step in range(1, steps + 1):
        next_temperature = np.zeros(nodes)
        next_temperature[heated] = np.sin(step * dt)
        force = inertia @ velocity / dt - stiffness @ (displacement + dt / 4 * velocity)
        force += 0.5 * coupling @ (temperature + next_temperature)
        heat = mass @ (temperature - next_temperature) / dt
        heat -= 0.5 * (conductivity @ (temperature + next_temperature) + coupling.T @ velocity)
        solution = system.solve(np.concatenate([force[moving], heat[inner]]))
        next_velocity = np.zeros(3 * nodes)
        next_velocity[moving] = solution[: len(moving)]
        next_temperature[inner] = solution[len(moving) :]
        displacement += dt / 2 * (velocity + next_velocity)
        velocity, temperature = next_velocity, next_temperature
        if step % (steps // 4) == 0:
            axis = number[printed, 0, 0]
            print(f"{4 * step // steps} pi/4: T", np.round(temperature[axis], 5).tolist())
            print("      u", np.round(displacement[axis], 5).tolist(), flush=True)


if __name__ == "__main__":
    main()
