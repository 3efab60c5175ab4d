"""Laminates by classical lamination theory [Jones1999], chapters 2 and 4, a strip by beams, and waves in three rods.

Prints the numbers of the cases `lam-*`, which docs/theory/laminates.md explains. Angles in degrees from x towards y, plies from
below, z from the middle.
"""

import math

import numpy as np

GRAPHITE_EPOXY = dict(e1=181e9, e2=10.3e9, nu12=0.28, g12=7.17e9, a1=0.02e-6, a2=22.5e-6)

# [Gao2020], eqs. 8.5 to 8.9, by temperature in K
CARBON_EPOXY = {
    348: dict(e1=123.9076e9, e2=6.8923e9, nu12=0.33, g12=3.3198e9, a1=0.6881e-6, a2=37.768e-6),
    450: dict(e1=117.2419e9, e2=0.4223e9, nu12=0.33, g12=0.2516e9, a1=3.45e-6, a2=107.4735e-6),
}


def matmul(a, b):
    return (np.array(a) @ np.array(b)).tolist()


def solve(matrix, right):
    return np.linalg.solve(np.array(matrix), np.array(right)).tolist()


def stiffness(ply, angle):
    """Q of a ply in the axes of the laminate, for strains xx, yy, 2 xy."""
    whole = 1 - ply["nu12"] ** 2 * ply["e2"] / ply["e1"]
    q11, q22 = ply["e1"] / whole, ply["e2"] / whole
    q12, q66 = ply["nu12"] * q22, ply["g12"]
    c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    turn = [[c * c, s * s, c * s], [s * s, c * c, -c * s], [-2 * c * s, 2 * c * s, c * c - s * s]]
    q = [[q11, q12, 0], [q12, q22, 0], [0, 0, q66]]
    return matmul([list(row) for row in zip(*turn)], matmul(q, turn))


def expansion(ply, angle):
    c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    a1, a2 = ply["a1"], ply["a2"]
    return [a1 * c * c + a2 * s * s, a1 * s * s + a2 * c * c, 2 * (a1 - a2) * c * s]


def laminate(ply, angles, thickness, rise=0.0, stations=None):
    """[A, B; B, D] and the thermal load; exact, or by `stations` layers in each ply (1 or 2)."""
    thicknesses = thickness if isinstance(thickness, list) else [thickness] * len(angles)
    z = -sum(thicknesses) / 2
    abd = [[0.0] * 6 for _ in range(6)]
    load = [0.0] * 6
    for angle, h in zip(angles, thicknesses):
        middle = z + h / 2
        second = {None: h**3 / 12, 1: 0.0, 2: h**3 / 12}[stations]
        moments = [h, h * middle, h * middle**2 + second]
        q = stiffness(ply, angle)
        stress = [sum(q[i][j] * expansion(ply, angle)[j] for j in range(3)) * rise for i in range(3)]
        for i in range(3):
            load[i] += stress[i] * moments[0]
            load[3 + i] += stress[i] * moments[1]
            for j in range(3):
                abd[i][j] += q[i][j] * moments[0]
                abd[i][3 + j] += q[i][j] * moments[1]
                abd[3 + i][j] += q[i][j] * moments[1]
                abd[3 + i][3 + j] += q[i][j] * moments[2]
        z += h
    return abd, load


def warped(angles, thickness=1e-3, rise=-100.0, ply=GRAPHITE_EPOXY, stations=None):
    """Strains and curvatures (xx, yy, 2 xy) of a free laminate."""
    return solve(*laminate(ply, angles, thickness, rise, stations))


def modulus(angles, thickness=1e-3, ply=GRAPHITE_EPOXY):
    """Young's modulus along x of a free laminate, which may bend."""
    abd, _ = laminate(ply, angles, thickness)
    height = thickness * len(angles)
    return 1 / (height * solve(abd, [1, 0, 0, 0, 0, 0])[0])


def strip():
    """[NAFEMS2001], R0031/1: a strip under a line load of 10 N/mm between two lines.

    Deflection by bending and by shear (m), bending stress of the surface at a quarter of the span and shear stress between the
    two lowest plies (Pa). The strip is narrow: there is no moment but that along it.
    """
    ply = dict(e1=100e9, e2=5e9, nu12=0.4, g12=3e9, a1=0.0, a2=0.0)
    shear_modulus = 2e9
    angles, thickness = [0, 90, 0, 90, 0, 90, 0], [1e-4, 1e-4, 1e-4, 4e-4, 1e-4, 1e-4, 1e-4]
    span, load = 30e-3, 10e3
    abd, _ = laminate(ply, angles, thickness)
    bent = solve(abd, [0, 0, 0, 1, 0, 0])
    bending = load * span**3 / 48 * bent[3]

    def modulus(angle):
        # stress along the strip per moment and distance from the middle
        return sum(q * k for q, k in zip(stiffness(ply, angle)[0], bent[3:]))

    force, z, flow, energy, between = load / 2, -sum(thickness) / 2, 0.0, 0.0, []
    parts = 1000
    for angle, h in zip(angles, thickness):
        for _ in range(parts):
            dz = h / parts
            change = modulus(angle) * (z + dz / 2) * dz
            energy += (force * (flow + change / 2)) ** 2 / (2 * shear_modulus) * dz
            flow, z = flow + change, z + dz
        between.append(-force * flow)
    # the energy of both halves is half of the work of the load
    shear = 2 * energy * span / load
    stress = load * span / 8 * modulus(0) * sum(thickness) / 2
    return bending, shear, stress, between[0]


def waves(times=(4e-6, 8e-6), cells=2000, temperature=285.0, capacity=1620 * 1092.728):
    """[Gao2020], section 4.3.3.2: rods with shear between them, pulled by 1e14 Pa/s at one end, without conduction.

    Displacements (m) and temperature changes (K) of the outer and the middle ply of [0/90/0] at 5, 10, 15, 20, 30 and 40 mm, by central
    differences. Strain e changes the temperature by -T0 beta e / (rho c), which adds beta² T0 / (rho c) to the moduli; 0 K: without heat.
    """
    q, ply = stiffness(GRAPHITE_EPOXY, 0), GRAPHITE_EPOXY
    beta = [q[n][0] * ply["a1"] + q[n][1] * ply["a2"] for n in range(2)]
    beta = np.array([beta[0], beta[1], beta[0]])[:, None]
    heating = -temperature * beta / capacity
    moduli = np.array([q[0][0], q[1][1], q[0][0]])[:, None] - beta * heating
    density, shear, h, length = 1620.0, 1.308e9, 1e-3, 0.1
    dx = length / cells
    dt = 0.5 * dx / math.sqrt(moduli[0, 0] / density)
    # displacements at nodes, stresses between them
    u, v = np.zeros((3, cells + 1)), np.zeros((3, cells + 1))
    mass = np.full(cells + 1, density * dx)
    mass[0] /= 2
    found, time = {}, 0.0
    for end in times:
        while time < end - dt / 2:
            stress = moduli * np.diff(u, axis=1) / dx
            force = np.zeros_like(u)
            force[:, :-1] += stress
            force[:, 1:] -= stress
            force[:, 0] -= 1e14 * time
            between = shear / h**2 * np.diff(u, axis=0) * mass / density
            force[:-1] += between
            force[1:] -= between
            v += dt * force / mass
            v[:, -1] = 0
            u += dt * v
            time += dt
        at = np.array([round(x * 1e-3 / dx) for x in (5, 10, 15, 20, 30, 40)])
        change = heating * (u[:, at + 1] - u[:, at - 1]) / (2 * dx)
        found[end] = u[0, at], u[1, at], change[0], change[1]
    return found


def lattice_bonds(horizon):
    """Bonds of a point of a square lattice within a horizon (spacings): steps along x and y, length (spacings) and the part of the volume of the
    other end inside."""
    reach = range(-int(horizon), int(horizon) + 1)
    bonds = [(i, j, math.hypot(i, j)) for i in reach for j in reach]
    return [(i, j, length, min(1.0, horizon + 0.5 - length)) for i, j, length in bonds if 0 < length <= horizon]


def sliding(angle=20.0, end=8e-4, energy=7110.0, modulus=1.308e9, distance=1e-3, horizon=3.0):
    """Mean force per area along x and y (Pa) while two rigid plies slide by `end` (m), by the bonds of a lattice: each breaks at the
    same angle. Also the part of the energy that bonds across a row of points have, which do not break when plies slide along it."""
    bonds = [(i / length, j / length, length * volume) for i, j, length, volume in lattice_bonds(horizon)]
    scale = 2 * modulus / sum(m * x * x for x, _, m in bonds)
    whole = scale * sum(m for *_, m in bonds)
    limit = math.sqrt(4 * energy / (distance * whole))
    c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    force = [0.0, 0.0]
    for x, y, m in bonds:
        along = x * c + y * s
        if limit * distance < abs(along) * end:
            # the mean of a force that grows with the way until the bond breaks
            mean = scale * m * limit**2 * distance / (4 * abs(along) * end)
            force = [force[0] + mean * x * math.copysign(1, along), force[1] + mean * y * math.copysign(1, along)]
    across = scale * sum(m for x, _, m in bonds if x == 0) / whole
    return force, across


def published_crack(ply=GRAPHITE_EPOXY, energy=2370.0, horizon=3.0, spacing=1e-3):
    """Energy that a crack along the fibres takes by the limit of [Gao2020], eq. 4.38, over the given one: the bonds of a lattice across a plane, each of
    which breaks at the same stretch, and the dilatation of the points by the bonds that are left."""
    reach = int(horizon)
    bonds = [(i, j, length * spacing, volume) for i, j, length, volume in lattice_bonds(horizon)]
    # theta is the trace of a uniform strain
    scale = 2 / sum(v * length for *_, length, v in bonds)
    bonds = [(i, j, length, scale * v) for i, j, length, v in bonds]
    q = stiffness(ply, 0)
    a = 0.5 * (q[0][1] - q[2][2])

    def moment(*functions):
        return sum(0.5 * w * length * math.prod(f(i * spacing / length, j * spacing / length) for f in functions) for i, j, length, w in bonds)

    def wave(c, s):
        return 8 * c**4 - 8 * c**2 + 1

    # C = k0 + k4 cos 4 psi across the fibres and in shear, where fibres have no part
    rows = [[moment(f), moment(f, wave)] for f in (lambda c, s: s**4, lambda c, s: c * c * s * s)]
    k0, k4 = solve(rows, [q[1][1] - 2 * a, q[2][2]])
    # the depth of the layers of points, and the opening at which bonds break, over the limit
    across = [(j, length**2 / (j * spacing), 0.5 * w * length * (k0 + k4 * wave(i * spacing / length, j * spacing / length)) * (j * spacing), length, w) for i, j, length, w in bonds if j > 0]
    total = sum(of_bond for _, _, of_bond, _, _ in across)

    def of_dilatation(opening):
        """Integral of 2 a theta² over the depth, of both sides, for an opening of one."""
        whole = [b for b in across if b[1] > opening * (1 + 1e-9)]
        theta = [sum(w * length * j * spacing / length**2 for j, _, _, length, w in whole if j > row) for row in range(reach)]
        return 2 * a * sum(t * t for t in theta) * spacing

    openings = sorted({round(opening, 12) for _, opening, *_ in across})
    before = 0.0
    for opening in openings:
        total += opening**2 * (of_dilatation(before) - of_dilatation(opening))
        before = opening
    mu, bulk = ply["e2"] / (2 * (1 + ply["nu12"])), ply["e2"] / (2 * (1 - ply["nu12"]))
    published = (6 * mu / math.pi + 16 / (9 * math.pi**2) * (bulk - 2 * mu)) * horizon * spacing
    return total / published


def heated_from_above(times=(10.0, 30.0, 50.0), flux=5000.0, k=0.2, h=1e-3, capacity=1620 * 1092.728):
    """Rise of the temperature of three plies, one station each, with a heat flux into the highest one, K: the exact solution of the three equations."""
    matrix = k / (capacity * h * h) * np.array([[-1.0, 1, 0], [1, -2, 1], [0, 1, -1]])
    values, vectors = np.linalg.eigh(matrix)
    source = vectors.T @ np.array([0, 0, flux / (capacity * h)])
    rises = {}
    for time in times:
        growth = [time if abs(v) < 1e-12 else (math.exp(v * time) - 1) / v for v in values]
        rises[time] = (vectors @ (np.array(growth) * source)).tolist()
    return rises


def heated_edge(times=(50.0, 100.0, 300.0), cells=50, step=0.25):
    """Temperature of three plies [0/90/0] of 100 x 100 x 1 mm, one station each, whose edge at x = -50 mm has (y + 100 z) t, at seven points (x, y) of
    each ply, K: cells of the plane, Crank-Nicolson by alternating directions (Douglas)."""
    capacity, h, width = 1620 * 1092.728, 1e-3, 0.1
    d = width / cells
    along, across = 8.3075 / (capacity * d * d), 0.7575 / (capacity * d * d)
    through = 0.2 / (capacity * h * h)
    kx, ky = np.array([along, across, along]), np.array([across, along, across])
    centre = (np.arange(cells) + 0.5) * d - 0.5 * width
    second = np.diag(np.full(cells - 1, 1.0), 1) + np.diag(np.full(cells - 1, 1.0), -1) - 2 * np.eye(cells)
    second[0, 0] = second[-1, -1] = -1
    held = second.copy()
    held[0, 0] = -3  # half a cell from the edge
    plies = np.array([[-1.0, 1, 0], [1, -2, 1], [0, 1, -1]]) * through
    edge = np.zeros((3, cells, cells))
    for ply in range(3):
        edge[ply, 0, :] = 2 * kx[ply] * (centre + 100 * ply * 1e-3)
    one = np.eye(cells)
    solve_x = [np.linalg.inv(one - 0.5 * step * kx[p] * held) for p in range(3)]
    solve_y = [np.linalg.inv(one - 0.5 * step * ky[p] * second) for p in range(3)]
    solve_z = np.linalg.inv(np.eye(3) - 0.5 * step * plies)

    def operators(t):
        x = np.stack([kx[p] * held @ t[p] for p in range(3)])
        y = np.stack([ky[p] * t[p] @ second for p in range(3)])
        return x, y, np.einsum("pq,qij->pij", plies, t)

    places = [(-40, 40), (-40, -40), (-40, 0), (-25, 40), (0, 40), (0, -40), (0, 0)]
    t, time, found = np.zeros((3, cells, cells)), 0.0, {}
    while time < max(times) - 1e-9:
        x, y, z = operators(t)
        now = t + step * (x + y + z + edge * (time + 0.5 * step))
        now = np.stack([solve_x[p] @ (now[p] - 0.5 * step * x[p]) for p in range(3)])
        now = np.stack([(now[p] - 0.5 * step * y[p]) @ solve_y[p] for p in range(3)])
        t = np.einsum("pq,qij->pij", solve_z, now - 0.5 * step * z)
        time += step
        if any(abs(time - at) < 1e-9 for at in times):
            def at(ply, x, y):
                i, j = ((v * 1e-3 + 0.5 * width) / d - 0.5 for v in (x, y))
                (a, b), (u, w) = (int(i), int(j)), (i % 1, j % 1)
                field = t[ply]
                return sum(f * g * field[a + m, b + n] for m, f in ((0, 1 - u), (1, u)) for n, g in ((0, 1 - w), (1, w)))
            found[round(time)] = [[at(ply, *place) for place in places] for ply in range(3)]
    return found


if __name__ == "__main__":
    for angles in ([0, 90], [45, -45], [0, 45, -45, 90], [0, 90, 90, 0], [45, -45, -45, 45]):
        print(angles, "cooled by 100 K:", " ".join(f"{x:.6e}" for x in warped(angles)))
    print("[0, 90] by one station:", " ".join(f"{x:.6e}" for x in warped([0, 90], stations=1)))
    for angles in ([0, 90], [0, 45, -45, 90], [30, -30]):
        print(angles, f"E_x {modulus(angles):.6e} Pa")
    print("[0, 90, 0] heated by 50 K:", " ".join(f"{x:.6e}" for x in warped([0, 90, 0], rise=50.0)[:2]))
    for temperature, ply in CARBON_EPOXY.items():
        strains = warped([0, 90, 0], rise=temperature - 293.0, ply=ply)[:2]
        print(f"[0, 90, 0] of carbon/epoxy at {temperature} K:", " ".join(f"{x:.6e}" for x in strains))
    print("strip: bending, shear (m), stress at a quarter of the span, shear stress (Pa):", strip())
    for time, (outer, middle, of_outer, of_middle) in waves().items():
        print(f"waves at {time} s: outer", outer, "middle", middle, "temperature:", of_outer, of_middle)
    (along, across), rest = sliding()
    print(f"sliding: {6.4e-5 * along:.6e} N, {6.4e-5 * across:.6e} N on 8 x 8 mm; part of bonds across a row {rest:.4f}")
    print(f"crack along the fibres by the published limit: {published_crack():.6f} of the fracture energy")
    print("heated from above:", heated_from_above())
    for time, plies in heated_edge(cells=100).items():
        for ply in plies:
            print(f"heated edge at {time} s:", " ".join(f"{t:.3f}" for t in ply))
