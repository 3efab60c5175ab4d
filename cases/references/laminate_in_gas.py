"""Reference of `gao-8.4.2-*`: a laminate [0/90/0] in a cavity of hot gas.

    python3 laminate_in_gas.py [cells]

The gas: incompressible flow with buoyancy (Boussinesq) on a staggered grid, by a projection in each explicit step, in units of the width of the
cavity (0.2 m) and of the diffusivity (2e-5 m2/s) at 293 K; viscosity and conductivity by Sutherland's law, conduction by fluxes through the faces of
cells. The laminate, 40 cells a side at 80 cells of the cavity, is solid and insulated for the gas. Finite volumes with the enthalpy as the state, in K and s;
three edges take up h (Tg - T) + sigma (Tg^4 - T^4), h = C |Tg - T|^(1/3), with the mean Tg of the gas within 3.015 cells of the cell at the edge.
T is the temperature of the cell at the edge, as in the source, or, second, that of the edge itself, half a cell away. Displacements are those of
`laminate_fire_displacements.py`, with the wall of the cavity clamped.
"""

import sys

import numpy as np
from fires import iso_834_rise
from laminate_fire import ACROSS, ALONG, DENSITY, STEFAN_BOLTZMANN, TEMPERATURE, THROUGH, capacity
from laminate_fire_displacements import at, displacements
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import splu

START, TIME, LENGTH = 293.0, 2000.0, 0.2  # K, s, m
PRANDTL, RAYLEIGH = 0.713, 1e3
SUTHERLAND = 111 / START
POINTS = [(0.125, 0.125), (0.375, 0.125), (0.25, 0.24), (0.49, 0.24), (0.75, 0.25), (0.75, 0.5), (0.75, 0.9)]


def sutherland(t: np.ndarray) -> np.ndarray:
    """Viscosity and conductivity over those at the start, by the rise over the temperature at the start."""
    theta = 1 + t
    return theta**1.5 * (1 + SUTHERLAND) / (theta + SUTHERLAND)


class Gas:
    """Cells (x, y) with the rise of the temperature over 293 K, and velocities at their faces."""

    def __init__(self, n: int):
        self.n, self.h = n, 1 / n
        fluid = np.ones((n, n), bool)
        fluid[: n // 2, n // 4 : 3 * n // 4] = False
        self.fluid = fluid
        self.padded = np.pad(fluid, 1)
        self.open_x = self.padded[:-1, 1:-1] & self.padded[1:, 1:-1]
        self.open_y = self.padded[1:-1, :-1] & self.padded[1:-1, 1:]
        self.t = np.zeros((n, n))
        self.u, self.v = np.zeros((n + 1, n)), np.zeros((n, n + 1))
        self.hot = (np.arange(n) + 0.5) * self.h < 0.25
        index = -np.ones((n, n), int)
        index[fluid] = np.arange(fluid.sum())
        rows, columns, values = [], [], []
        for one, two in (((slice(0, -1), slice(None)), (slice(1, None), slice(None))), ((slice(None), slice(0, -1)), (slice(None), slice(1, None)))):
            both = fluid[one] & fluid[two]
            a, b = index[one][both], index[two][both]
            rows += [a, b, a, b]
            columns += [b, a, a, b]
            ones = np.ones(a.size)
            values += [ones, ones, -ones, -ones]
        rows, columns, values = map(np.concatenate, (rows, columns, values))
        # one pressure is held
        values = np.append(values, -1.0)
        matrix = coo_matrix((values, (np.append(rows, 0), np.append(columns, 0)))).tocsc()
        self.solve = splu(matrix).solve

    def viscous(self, w: np.ndarray, is_open: np.ndarray, mu: np.ndarray, along: int) -> np.ndarray:
        """div(mu grad w) of a velocity along an axis at its faces, at rest at walls."""
        if along == 1:
            return self.viscous(w.T, is_open.T, mu.T, 0).T
        out = np.zeros_like(w)
        # along its own direction the cells lie between the faces
        flux = mu * np.diff(w, axis=0)
        out[1:-1] += np.diff(flux, axis=0)
        # across, the viscosity of a face is the mean of its cells
        at_face = np.pad(mu, ((1, 1), (0, 0)), "edge")
        at_face = (at_face[:-1] + at_face[1:]) / 2
        wide, seen = np.pad(w, ((0, 0), (1, 1))), np.pad(is_open, ((0, 0), (1, 1)))
        for neighbour, known in ((wide[:, :-2], seen[:, :-2]), (wide[:, 2:], seen[:, 2:])):
            # a wall lies half a cell away
            out += at_face * np.where(known, neighbour - w, -2 * w)
        return np.where(is_open, out, 0) / self.h**2

    def step(self, dt: float, fire: float) -> None:
        h, u, v, t = self.h, self.u, self.v, self.t
        k = np.where(self.fluid, sutherland(t), 1.0)
        # velocities at the centres and at the corners
        uc, vc = (u[:-1] + u[1:]) / 2, (v[:, :-1] + v[:, 1:]) / 2
        wide_u, wide_v = np.pad(u, ((0, 0), (1, 1))), np.pad(v, ((1, 1), (0, 0)))
        corner_u, corner_v = (wide_u[:, :-1] + wide_u[:, 1:]) / 2, (wide_v[:-1] + wide_v[1:]) / 2
        product = corner_u * corner_v
        du = PRANDTL * self.viscous(u, self.open_x, k, 0)
        dv = PRANDTL * self.viscous(v, self.open_y, k, 1)
        du[1:-1] -= np.diff(uc**2, axis=0) / h + np.diff(product, axis=1)[1:-1] / h
        dv[:, 1:-1] -= np.diff(vc**2, axis=1) / h + np.diff(product, axis=0)[:, 1:-1] / h
        dv[:, 1:-1] += RAYLEIGH * PRANDTL * (t[:, :-1] + t[:, 1:]) / 2
        u, v = np.where(self.open_x, u + dt * du, 0), np.where(self.open_y, v + dt * dv, 0)
        divergence = (np.diff(u, axis=0) + np.diff(v, axis=1)) / h
        p = np.zeros_like(t)
        p[self.fluid] = self.solve(divergence[self.fluid] * h**2 / dt)
        u[1:-1] -= dt * np.where(self.open_x[1:-1], np.diff(p, axis=0), 0) / h
        v[:, 1:-1] -= dt * np.where(self.open_y[:, 1:-1], np.diff(p, axis=1), 0) / h
        self.u, self.v = u, v
        fx, fy = np.zeros_like(u), np.zeros_like(v)
        fx[1:-1] = u[1:-1] * (t[:-1] + t[1:]) / 2 - (k[:-1] + k[1:]) / 2 * np.diff(t, axis=0) / h
        fy[:, 1:-1] = v[:, 1:-1] * (t[:, :-1] + t[:, 1:]) / 2 - (k[:, :-1] + k[:, 1:]) / 2 * np.diff(t, axis=1) / h
        fx, fy = np.where(self.open_x, fx, 0), np.where(self.open_y, fy, 0)
        wall = sutherland((fire + t[self.hot, 0]) / 2)
        fy[self.hot, 0] = wall * (fire - t[self.hot, 0]) / (h / 2)
        self.t = t - dt * (np.diff(fx, axis=0) + np.diff(fy, axis=1)) / h


class Laminate:
    """Enthalpies of the cells of three plies; arrays have the plies, x and y as axes."""

    FINE = np.linspace(273, 1400, 200_001)
    C = capacity(FINE)
    ENTHALPY = DENSITY * np.concatenate([[0], np.cumsum((C[1:] + C[:-1]) / 2 * np.diff(FINE))])

    def __init__(self, gas: Gas, through: float, at_edge: bool):
        self.n, self.dx = gas.n // 2, LENGTH / gas.n
        self.through, self.at_edge = through, at_edge
        self.h = np.full((3, self.n, self.n), np.interp(START, self.FINE, self.ENTHALPY))
        self.t = np.full_like(self.h, START)
        x, y = np.nonzero(gas.fluid)
        line = np.arange(self.n)
        last = np.full(self.n, self.n - 1)
        self.edges = []
        for axis, factor, i, j in ((2, 1.52, line, 0 * line), (2, 1.52, line, last), (1, 1.38, last, line)):
            near = (x - i[:, None]) ** 2 + (y - j[:, None] - gas.n // 4) ** 2 <= 3.015**2
            self.edges.append((axis, factor, i, j, x, y, near / near.sum(axis=1)[:, None]))

    def step(self, dt: float, gas: np.ndarray) -> None:
        t, dx = self.t, self.dx
        across, along = np.interp(t, TEMPERATURE, ACROSS), np.full_like(t, ALONG)
        k = [None, np.stack([along[0], across[1], along[2]]), np.stack([across[0], along[1], across[2]])]
        rate = np.zeros_like(t)
        for axis in (1, 2):
            first, second = [slice(None)] * 3, [slice(None)] * 3
            first[axis], second[axis] = slice(0, -1), slice(1, None)
            first, second = tuple(first), tuple(second)
            flow = (k[axis][first] + k[axis][second]) / 2 * (t[second] - t[first]) / dx**2
            rate[first] += flow
            rate[second] -= flow
        flow = self.through * np.diff(t, axis=0) / 0.001**2
        rate[:-1] += flow
        rate[1:] -= flow
        for axis, factor, i, j, x, y, weights in self.edges:
            around = weights @ gas[x, y]
            own, conductance = t[:, i, j], k[axis][:, i, j] / (dx / 2)
            surface, flux = own, 0.0
            for _ in range(4 if self.at_edge else 1):
                difference = around - surface
                flux = factor * np.abs(difference) ** (1 / 3) * difference + STEFAN_BOLTZMANN * (around**4 - surface**4)
                if self.at_edge:
                    slope = 4 / 3 * factor * np.abs(difference) ** (1 / 3) + 4 * STEFAN_BOLTZMANN * surface**3
                    surface = surface + (flux + conductance * (own - surface)) / (conductance + slope)
            rate[:, i, j] += (conductance * (surface - own) if self.at_edge else flux) / dx
        self.h += dt * rate
        self.t = np.interp(self.h, self.ENTHALPY, self.FINE)


def moved(t: np.ndarray) -> list[tuple[float, float]]:
    """Displacements (x and y, um) of points of the lowest ply at the free edge: at the hot corner, 10 mm from it, in the middle, at the other corner."""
    u = displacements(t[:, ::-1])[0]
    width = LENGTH / 2
    near = width / (len(u) - 1) / 2
    ends = (at(u, near, y) for y in (near, 0.01, width / 2, width - near))
    return [(round(-1e6 * float(x), 3), round(1e6 * float(y), 3)) for x, y in ends]


def main(n: int) -> None:
    gas = Gas(n)
    step = 1e-5 * (80 / n) ** 2
    every = round(1e-4 / step)
    plates = {
        (name, edge): Laminate(gas, through, edge)
        for edge in (False, True)
        for name, through in (("plies that exchange heat", THROUGH), ("plies apart", 0.0))
    }
    for number in range(round(0.25 / step)):
        fire = iso_834_rise((number + 0.5) * step * TIME) / START
        gas.step(step, fire)
        if (number + 1) % every == 0:
            for plate in plates.values():
                plate.step(every * step * TIME, START * (1 + gas.t))
        time = (number + 1) * step
        if any(abs(time - wanted) < step / 2 for wanted in (0.05, 0.1, 0.15, 0.2, 0.25)):
            found = [START * gas.t[int(x * n + 1e-9), int(y * n + 1e-9)] for x, y in POINTS]
            speed = max(np.abs(gas.u).max(), np.abs(gas.v).max())
            mean = START * gas.t[gas.fluid].mean()
            print(f"t* = {time:.2f}: rises of the gas {np.round(found, 2)} K, mean {mean:.3f} K, speed {speed:.3f}", flush=True)
            for (name, edge), plate in plates.items():
                rises = plate.t.mean(axis=(1, 2)) - START
                place = "the edge" if edge else "its cells"
                print(f"    {name}, temperature of {place}: mean {rises.mean():.3f} K, plies {rises.round(3)}, hottest {plate.t.max():.1f} K", flush=True)
                if name == "plies that exchange heat":
                    print(f"        displacements of the free edge {moved(plate.t)} um", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 80)
