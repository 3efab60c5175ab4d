"""Clamped circular laminate under the pressure of an explosion, by the method of Ritz: reference of `gao-4.4a-*`.

    python3 explosion_plate.py

The middle plane moves by polynomials that vanish at the edge, with their slopes for the deflection. Membrane energy of large
strains, bending energy of small curvatures, inertia of all three displacements, a pressure that keeps its direction. Two measures of strain:
the stretch tensor U - 1 with the stiffness A, and the stretches of fibres in all directions, whose energy is that of bonds in the limit of a
small horizon (`docs/theory/laminates.md`, "Bonds of a ply"). They agree for small strains. Prints the deflection of the middle in time and its first
extremum for growing numbers of unknowns.
"""

from itertools import product
from math import exp, pi

import numpy as np

RADIUS = 0.1143
PLY = 0.254e-3
ANGLES = [0, 90] * 6 + [0]
DENSITY = 1850.0
E1, E2, G12, NU12 = 39.3e9, 9.7e9, 3.32e9, 0.33
THICKNESS = PLY * len(ANGLES)


def pressure(time: float) -> float:
    """Gao (2020), eq. 4.60, Pa."""
    return 9.65e6 * min(time / 4e-5, 1.0) * exp(-max(time - 8e-5, 0.0) / 2e-4)


def reduced_stiffness(angle: int) -> tuple[float, float, float, float]:
    """Qxx, Qyy, Qxy and Qss of a ply at 0 or 90 degrees, Pa."""
    nu21 = NU12 * E2 / E1
    q11, q22 = E1 / (1 - NU12 * nu21), E2 / (1 - NU12 * nu21)
    first, second = (q11, q22) if angle == 0 else (q22, q11)
    return first, second, NU12 * q22, G12


def stiffness() -> tuple[np.ndarray, np.ndarray]:
    """A (N/m) and D (N m): xx, yy, xy and ss of each."""
    a, d = np.zeros(4), np.zeros(4)
    for k, angle in enumerate(ANGLES):
        bottom = k * PLY - THICKNESS / 2
        q = np.array(reduced_stiffness(angle))
        a += q * PLY
        d += q * ((bottom + PLY) ** 3 - bottom**3) / 3
    return a, d


class Plate:
    """A quarter of the plate: the displacements are u = sum c_i f_i with even and odd polynomials."""

    def __init__(self, degree: int, points: int = 40):
        # Gauss points in the radius and the angle
        r, wr = np.polynomial.legendre.leggauss(points)
        phi, wphi = np.polynomial.legendre.leggauss(points)
        r, wr = (r + 1) / 2, wr / 2
        phi, wphi = (phi + 1) * pi / 4, wphi * pi / 4
        rr, pp = np.meshgrid(r, phi, indexing="ij")
        self.weight = (np.outer(wr * r, wphi)).ravel() * RADIUS**2
        x, y = (rr * np.cos(pp)).ravel(), (rr * np.sin(pp)).ravel()
        even = [(i, j) for i, j in product(range(0, degree + 1, 2), repeat=2) if i + j <= degree]
        self.w = self.functions(x, y, even, 2)
        self.u = self.functions(x, y, [(i + 1, j) for i, j in even], 1)
        self.v = self.functions(x, y, [(i, j + 1) for i, j in even], 1)
        self.counts = (len(even),) * 3
        self.mass = DENSITY * THICKNESS
        masses = [self.mass * (f[0] * self.weight) @ f[0].T for f in (self.u, self.v, self.w)]
        self.inverse = [np.linalg.inv(m) for m in masses]
        self.a, d = stiffness()
        fxx, fyy, fxy = self.w[3:]
        weight = self.weight
        self.bending = (
            d[0] * (fxx * weight) @ fxx.T
            + d[1] * (fyy * weight) @ fyy.T
            + d[2] * ((fxx * weight) @ fyy.T + (fyy * weight) @ fxx.T)
            + 4 * d[3] * (fxy * weight) @ fxy.T
        )
        self.load = self.w[0] @ weight
        self.middle = self.functions(np.zeros(1), np.zeros(1), even, 2)[0][:, 0]
        self.directions()

    @staticmethod
    def functions(x: np.ndarray, y: np.ndarray, powers: list[tuple[int, int]], order: int) -> list[np.ndarray]:
        """(1 - r²)^order x^i y^j and its derivatives x, y, xx, yy, xy in m; x and y in radii."""

        def monomial(i: int, j: int, dx: int, dy: int) -> np.ndarray:
            factor = 1.0
            for k in range(dx):
                factor *= i - k
            for k in range(dy):
                factor *= j - k
            return factor * x ** max(i - dx, 0) * y ** max(j - dy, 0)

        # the factor as a polynomial: 1 - r² or (1 - r²)²
        terms = {(0, 0): 1.0, (2, 0): -1.0, (0, 2): -1.0}
        if order == 2:
            terms = {(0, 0): 1.0, (2, 0): -2.0, (0, 2): -2.0, (4, 0): 1.0, (2, 2): 2.0, (0, 4): 1.0}
        derivatives = [(0, 0), (1, 0), (0, 1), (2, 0), (0, 2), (1, 1)]
        return [
            np.array([sum(c * monomial(i + a, j + b, dx, dy) for (a, b), c in terms.items()) for i, j in powers])
            / RADIUS ** (dx + dy)
            for dx, dy in derivatives
        ]

    def directions(self, count: int = 48) -> None:
        """Weights of the stretches in all directions, N/m, that give A for small strains, and the factor of the dilatation."""
        psi = np.arange(count) * pi / count
        self.normal = np.cos(psi), np.sin(psi)
        xx, yy, xy, ss = self.a
        # sum over plies at 0 and 90 degrees: fibres along both axes
        self.dilatation = (xy - ss) / 2
        c4, c22 = np.cos(psi) ** 4, (np.cos(psi) * np.sin(psi)) ** 2
        wave = np.cos(4 * psi)
        # the stiffness is the mean of C n n n n over the directions
        system = np.array([[np.mean(c4), np.mean(c4 * wave)], [np.mean(c22), np.mean(c22 * wave)]])
        plies = [reduced_stiffness(0)[0], reduced_stiffness(0)[1]]
        matrix = (plies[1] * THICKNESS) - 2 * self.dilatation
        k0, k4 = np.linalg.solve(system, [matrix, ss])
        self.density = (k0 + k4 * wave) / count
        fibres = plies[0] - plies[1]
        along = sum(PLY for angle in ANGLES if angle == 0)
        self.density[0] += fibres * along
        self.density[count // 2] += fibres * (THICKNESS - along)

    def membrane_stress(self, gradient: tuple[np.ndarray, ...], measure: str) -> tuple[np.ndarray, ...]:
        """Derivatives of the membrane energy per area by u_x, u_y, v_x, v_y, w_x, w_y, N/m."""
        ux, uy, vx, vy, wx, wy = gradient
        cxx = (1 + ux) ** 2 + vx**2 + wx**2
        cyy = uy**2 + (1 + vy) ** 2 + wy**2
        cxy = (1 + ux) * uy + vx * (1 + vy) + wx * wy
        if measure == "stretch tensor":
            # U = (C + sqrt(det C) 1) / sqrt(tr C + 2 sqrt(det C))
            root = np.sqrt(cxx * cyy - cxy**2)
            trace = np.sqrt(cxx + cyy + 2 * root)
            exx, eyy, exy = (cxx + root) / trace - 1, (cyy + root) / trace - 1, cxy / trace
            axx, ayy, axy, ass = self.a
            # derivatives of the energy by exx, eyy and exy
            n = (axx * exx + axy * eyy, axy * exx + ayy * eyy, 4 * ass * exy)
            numerators = (cxx + root, cyy + root, cxy)
            droot = (cyy / (2 * root), cxx / (2 * root), -cxy / root)
            by_c = []
            for index in range(3):
                dtrace = ((index < 2) + 2 * droot[index]) / (2 * trace)
                strains = [
                    ((k == index) + (k < 2) * droot[index]) / trace - numerators[k] * dtrace / trace**2 for k in range(3)
                ]
                by_c.append(sum(x * y for x, y in zip(n, strains)))
            sxx, syy, sxy = by_c
        else:
            sxx = syy = sxy = 0.0
            cosine, sine = self.normal
            stretches = [
                np.sqrt(c * c * cxx + s * s * cyy + 2 * s * c * cxy) for c, s in zip(cosine, sine)
            ]
            count = len(stretches)
            # theta = 2 means of the stretch: the trace of small strains
            theta = 2 * sum(length - 1 for length in stretches) / count
            for c, s, length, density in zip(cosine, sine, stretches, self.density):
                # W = dilatation theta² + sum density (length - 1)² / 2
                slope = density * (length - 1) + 2 * self.dilatation * theta * 2 / count
                slope = slope / (2 * length)
                sxx = sxx + slope * c * c
                syy = syy + slope * s * s
                sxy = sxy + slope * 2 * s * c
        # dC by the gradients
        return (
            2 * sxx * (1 + ux) + sxy * uy,
            2 * syy * uy + sxy * (1 + ux),
            2 * sxx * vx + sxy * (1 + vy),
            2 * syy * (1 + vy) + sxy * vx,
            2 * sxx * wx + sxy * wy,
            2 * syy * wy + sxy * wx,
        )

    def accelerations(self, c: list[np.ndarray], time: float, measure: str) -> list[np.ndarray]:
        gradient = []
        for functions, coefficients in zip((self.u, self.v, self.w), c):
            gradient += [coefficients @ functions[1], coefficients @ functions[2]]
        stress = self.membrane_stress(tuple(gradient), measure)
        forces = []
        for k, functions in enumerate((self.u, self.v, self.w)):
            sx, sy = stress[2 * k] * self.weight, stress[2 * k + 1] * self.weight
            forces.append(-(functions[1] @ sx + functions[2] @ sy))
        forces[2] += -self.bending @ c[2] - pressure(time) * self.load
        return [inverse @ force for inverse, force in zip(self.inverse, forces)]

    def run(self, measure: str, step: float, end: float = 2.6e-4) -> list[tuple[float, float]]:
        """Deflection (m) of the middle by time (s): velocity Verlet."""
        c = [np.zeros(n) for n in self.counts]
        v = [np.zeros(n) for n in self.counts]
        a = self.accelerations(c, 0.0, measure)
        history = [(0.0, 0.0)]
        for i in range(round(end / step)):
            v = [x + step / 2 * y for x, y in zip(v, a)]
            c = [x + step * y for x, y in zip(c, v)]
            a = self.accelerations(c, (i + 1) * step, measure)
            v = [x + step / 2 * y for x, y in zip(v, a)]
            history.append(((i + 1) * step, float(c[2] @ self.middle)))
        return history


def report(history: list[tuple[float, float]]) -> str:
    times, deflections = np.array(history).T
    at = [float(np.interp(t, times, deflections)) * 1e3 for t in (4e-5, 6e-5, 8e-5, 1e-4, 1.4e-4, 1.8e-4)]
    lowest = int(np.argmin(deflections))
    values = ", ".join(f"{u:.4f}" for u in at)
    return f"{values} mm; extremum {deflections[lowest] * 1e3:.3f} mm at {times[lowest] * 1e3:.4f} ms"


if __name__ == "__main__":
    print("deflection of the middle at 40, 60, 80, 100, 140 and 180 us")
    for measure in ("stretch tensor", "fibres"):
        for degree in (8, 12, 16):
            plate = Plate(degree)
            print(f"{measure}, {sum(plate.counts)} unknowns:", report(plate.run(measure, 5e-8)), flush=True)
