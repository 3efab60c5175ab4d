"""Residual stress of a ball that is quenched: a radial reference for the case `quenched-ball`.

    python3 quenched_ball.py [cells] [steps]

Heat conduction in the radius with convection at the surface, by finite volumes, exact in time; equilibrium of the
radial displacement of linear finite elements with J2 plasticity without hardening, whose yield stress depends on the
temperature, by Newton's method with the consistent tangent. Small strains; the heat is not changed by the deformation.
Prints the stress in the middle and the hoop stress at some radii after cooling. Needs NumPy.
"""

import sys

import numpy as np

RADIUS = 0.01  # m
DENSITY, SPECIFIC_HEAT, CONDUCTIVITY = 7800.0, 600.0, 30.0
YOUNGS_MODULUS, POISSONS_RATIO, EXPANSION = 180e9, 0.3, 15e-6
START, AMBIENT, COEFFICIENT = 1100.0, 300.0, 3000.0  # K, K, W/(m2 K)
END = 60.0  # s


def yield_stress(temperature):
    """Pa, at a temperature in K."""
    return np.interp(temperature, [300.0, 1100.0], [300e6, 40e6])


def tridiagonal(diagonal, above, right):
    """Solution of a symmetric tridiagonal system."""
    diagonal, solution = diagonal.copy(), right.copy()
    for i, beside in enumerate(above):
        factor = beside / diagonal[i]
        diagonal[i + 1] -= factor * beside
        solution[i + 1] -= factor * solution[i]
    solution[-1] /= diagonal[-1]
    for i in range(len(above) - 1, -1, -1):
        solution[i] = (solution[i] - above[i] * solution[i + 1]) / diagonal[i]
    return solution


class Heat:
    """Temperatures in shells of equal thickness."""

    def __init__(self, cells):
        faces = np.linspace(0.0, RADIUS, cells + 1)
        self.middle = 0.5 * (faces[1:] + faces[:-1])
        self.faces = faces
        width = RADIUS / cells
        # divided by 4 pi
        self.capacity = DENSITY * SPECIFIC_HEAT * (faces[1:] ** 3 - faces[:-1] ** 3) / 3.0
        self.between = CONDUCTIVITY * faces[1:-1] ** 2 / width
        # convection in series with half a shell
        inverse = 1.0 / COEFFICIENT + 0.5 * width / CONDUCTIVITY
        conductance = np.zeros((cells, cells))
        for i, between in enumerate(self.between):
            conductance[i : i + 2, i : i + 2] += between * np.array([[1.0, -1.0], [-1.0, 1.0]])
        conductance[-1, -1] += RADIUS**2 / inverse
        root = np.sqrt(self.capacity)
        self.rates, modes = np.linalg.eigh(conductance / root[:, None] / root[None, :])
        self.modes = modes / root[:, None]
        self.start = modes.T @ (root * (START - AMBIENT))

    def temperature(self, time):
        """Temperatures of the shells (K) at a time (s), exact in time."""
        return AMBIENT + self.modes @ (self.start * np.exp(-self.rates * time))


class Ball:
    """Radial displacements of the faces of the shells; one state in the middle of each shell."""

    def __init__(self, heat):
        self.radius = heat.middle
        self.width = np.diff(heat.faces)
        # of the rule of the middle, with which a uniform pressure is in equilibrium
        self.volume = self.radius**2 * self.width
        self.displacement = np.zeros(len(heat.faces))
        # plastic strain along the radius; half of it with the other sign along the hoops
        self.plastic = np.zeros(len(self.radius))
        self.shear = YOUNGS_MODULUS / (2.0 * (1.0 + POISSONS_RATIO))
        self.bulk = YOUNGS_MODULUS / (3.0 * (1.0 - 2.0 * POISSONS_RATIO))

    def stresses(self, temperature):
        """Radial and hoop stress, plastic strain, and the stiffness of deviators of each shell."""
        u = self.displacement
        radial = np.diff(u) / self.width
        hoop = 0.5 * (u[1:] + u[:-1]) / self.radius
        mean = self.bulk * (radial + 2.0 * hoop - 3.0 * EXPANSION * (temperature - START))
        # sigma_r - sigma_theta
        trial = 2.0 * self.shear * (radial - hoop - 1.5 * self.plastic)
        limit = yield_stress(temperature)
        excess = np.maximum(np.abs(trial) - limit, 0.0)
        difference = trial - np.sign(trial) * excess
        plastic = self.plastic + np.sign(trial) * excess / (3.0 * self.shear)
        stiffness = np.where(excess > 0.0, 0.0, 2.0 * self.shear)
        return mean + 2.0 / 3.0 * difference, mean - difference / 3.0, plastic, stiffness

    def forces(self, radial, hoop):
        """Virtual work of the stresses with the displacement of each face."""
        of_radial = self.volume * radial / self.width
        of_hoop = self.volume * hoop / self.radius
        force = np.zeros(len(self.displacement))
        force[1:] += of_radial + of_hoop
        force[:-1] += of_hoop - of_radial
        return force

    def step(self, temperature):
        """Finds equilibrium at new temperatures (K)."""
        faces = len(self.displacement)
        for _ in range(60):
            radial, hoop, plastic, deviator = self.stresses(temperature)
            force = self.forces(radial, hoop)
            force[0] = 0.0
            # forces of 1 Pa are rounding
            if np.linalg.norm(force) < 1.0 * RADIUS**2:
                break
            diagonal, above = np.zeros(faces), np.zeros(faces - 1)
            for i in range(faces - 1):
                strains = np.array(
                    [
                        [-1.0 / self.width[i], 1.0 / self.width[i]],
                        [0.5 / self.radius[i], 0.5 / self.radius[i]],
                    ]
                )
                volume = np.array([[1.0, 2.0], [2.0, 4.0]])
                shape = np.array([[1.0, -1.0], [-1.0, 1.0]])
                # of the work sigma_r e_r + 2 sigma_theta e_theta
                moduli = self.bulk * volume + 2.0 / 3.0 * deviator[i] * shape
                block = self.volume[i] * strains.T @ moduli @ strains
                diagonal[i : i + 2] += np.diag(block)
                above[i] = block[0, 1]
            # the middle does not move
            self.displacement[1:] -= tridiagonal(diagonal[1:], above[1:], force[1:])
        else:
            sys.exit("no equilibrium: take more steps")
        self.plastic = plastic
        return radial, hoop


def main():
    cells = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    steps = int(sys.argv[2]) if len(sys.argv) > 2 else 600
    heat = Heat(cells)
    ball = Ball(heat)
    # short steps first, while the surface cools fast
    times = END * (np.arange(steps + 1) / steps) ** 2
    for after in times[1:]:
        radial, hoop = ball.step(heat.temperature(after))
    print(f"temperature in the middle after {END} s: {heat.temperature(END)[0]:.3f} K")
    print(f"stress in the middle: {(radial[0] + 2 * hoop[0]) / 3e6:.3f} MPa")
    for part in (0.2, 0.4, 0.6, 0.8, 0.9, 0.95):
        at = part * RADIUS
        values = [np.interp(at, ball.radius, s) / 1e6 for s in (radial, hoop)]
        print(f"r = {1e3 * at:4.1f} mm: radial {values[0]:9.3f}, hoop {values[1]:9.3f} MPa")


if __name__ == "__main__":
    main()
