"""A drop in a temperature gradient: reference numbers of the case `two-fluids-drop-in-a-gradient`.

Staggered (MAC) grid, forward in time, with a tracked front for the interface [Wang2025], section 8.5.5:

    python drop_in_a_gradient.py 64        # speed and position of the drop at t* = 0.5, 1, 1.5, 2

A circle of the radius R in a square of 4 R between plates at y = 0, L that hold its temperature and frictionless, insulated sides.
Segments of the front pull along their tangents with gamma(T), which contains both the pressure of the curved surface and the stress along it;
forces and velocities pass between front and grid by the cosine delta over four cells. Density, viscosity, conductivity and heat capacity
change over three cells. Viscous stress mu (grad v + grad v^T); the pressure is split so that a constant operator has to be solved (Dodd &
Ferrante, Journal of Computational Physics 273 (2014), 416-434). Speeds are relative to |dgamma/dT| |grad T| R / mu_outer = 0.024 m/s,
times to R over that, 0.06 s.
"""

import sys

import numpy as np
import scipy.sparse as sparse
from scipy.interpolate import CubicSpline
from scipy.sparse.linalg import splu

RADIUS, SIZE, SLOPE, GRADIENT = 1.44e-3, 5.76e-3, -0.002, 200.0
TENSION, COLD = 0.01, 290.0
# drop, outer fluid: density, viscosity, conductivity, heat capacity per volume
DENSITY, VISCOSITY = (250.0, 500.0), (0.012, 0.024)
CONDUCTIVITY, CAPACITY = (1.2e-6, 2.4e-6), (0.0125, 0.05)
SPEED = abs(SLOPE) * GRADIENT * RADIUS / VISCOSITY[1]
TIME = RADIUS / SPEED


class Front:
    """Closed line of points around the drop."""

    def __init__(self, spacing: float) -> None:
        self.h = spacing
        count = int(2 * np.pi * RADIUS / (0.5 * spacing))
        angle = 2 * np.pi * np.arange(count) / count
        self.x = SIZE / 2 + RADIUS * np.stack([np.cos(angle), np.sin(angle)], axis=1)

    def centre(self) -> tuple[np.ndarray, float]:
        """Centroid and area of the polygon."""
        a, b = self.x, np.roll(self.x, -1, axis=0)
        cross = a[:, 0] * b[:, 1] - b[:, 0] * a[:, 1]
        area = 0.5 * cross.sum()
        return ((a + b) * cross[:, None]).sum(axis=0) / (6 * area), area

    def inside(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Fraction of the drop, which changes over three cells; the line is nearly a circle."""
        middle, _ = self.centre()
        own = self.x - middle
        angle = np.arctan2(own[:, 1], own[:, 0])
        order = np.argsort(angle)
        radius = np.hypot(own[:, 0], own[:, 1])[order]
        at = np.arctan2(y - middle[1], x - middle[0])
        radius = np.interp(at, angle[order], radius, period=2 * np.pi)
        d = np.clip((radius - np.hypot(x - middle[0], y - middle[1])) / (1.5 * self.h), -1, 1)
        return 0.5 * (1 + d + np.sin(np.pi * d) / np.pi)

    def weights(self, origin: tuple[float, float], shape: tuple[int, int], x: np.ndarray) -> sparse.csr_matrix:
        """Interpolation from a grid to points."""
        rows, columns, values = [], [], []
        place = (x - np.array(origin)) / self.h
        low = np.floor(place).astype(int) - 1
        for i in range(4):
            for j in range(4):
                cell = low + [i, j]
                away = place - cell
                weight = (0.25 * (1 + np.cos(0.5 * np.pi * away))).prod(axis=1)
                rows.append(np.arange(len(x)))
                columns.append(np.ravel_multi_index(cell.T, shape))
                values.append(weight)
        entries = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
        return sparse.csr_matrix(entries, shape=(len(x), shape[0] * shape[1]))

    def pulls(self, grid: "Grid") -> np.ndarray:
        """Force of the two segments of each point, N/m."""
        along = np.roll(self.x, -1, axis=0) - self.x
        middle = self.x + 0.5 * along
        temperature = grid.cells(self, middle) @ grid.t.ravel()
        gamma = TENSION + SLOPE * (temperature - COLD)
        pull = gamma[:, None] * along / np.hypot(along[:, 0], along[:, 1])[:, None]
        return pull - np.roll(pull, 1, axis=0)

    def spread(self) -> None:
        """Distributes the points evenly along the line."""
        closed = np.vstack([self.x, self.x[:1]])
        step = np.hypot(*np.diff(closed, axis=0).T)
        length = np.concatenate([[0.0], np.cumsum(step)])
        line = CubicSpline(length, closed, bc_type="periodic")
        count = len(self.x)
        self.x = line(length[-1] * np.arange(count) / count)


class Grid:
    """Velocities u, v at the faces across x and y; pressure and temperature in the cells."""

    def __init__(self, n: int) -> None:
        self.n, self.h = n, SIZE / n
        centre = (np.arange(n) + 0.5) * self.h
        face = np.arange(n + 1) * self.h
        mesh = lambda x, y: np.meshgrid(x, y, indexing="ij")
        self.at_u, self.at_v = mesh(face, centre), mesh(centre, face)
        self.at_cell, self.at_corner = mesh(centre, centre), mesh(face, face)
        self.u, self.v, self.p = np.zeros((n + 1, n)), np.zeros((n, n + 1)), np.zeros((n, n))
        self.before = self.p
        self.t = COLD + GRADIENT * self.at_cell[1]
        line = sparse.diags([1, -2, 1], [-1, 0, 1], shape=(n, n)).tolil()
        line[0, 0] = line[-1, -1] = -1
        one = sparse.identity(n)
        laplacian = (sparse.kron(line, one) + sparse.kron(one, line)).tolil() / self.h**2
        laplacian[0, 0] *= 2
        self.solve = splu(laplacian.tocsc()).solve

    def cells(self, front: Front, x: np.ndarray) -> sparse.csr_matrix:
        return front.weights((0.5 * self.h, 0.5 * self.h), self.t.shape, x)

    def faces(self, front: Front) -> list[sparse.csr_matrix]:
        half = 0.5 * self.h
        return [
            front.weights((0.0, half), self.u.shape, front.x),
            front.weights((half, 0.0), self.v.shape, front.x),
        ]

    def heat(self, front: Front, dt: float) -> None:
        """Advances the temperature."""
        h, t = self.h, self.t
        k = mixed(CONDUCTIVITY, front.inside(*self.at_cell))
        ends = (COLD, COLD + GRADIENT * SIZE)
        wide = np.pad(t, 1, mode="edge")
        wide[:, 0], wide[:, -1] = 2 * ends[0] - wide[:, 1], 2 * ends[1] - wide[:, -2]
        k = np.pad(k, 1, mode="edge")
        kx = 2 * k[1:, 1:-1] * k[:-1, 1:-1] / (k[1:, 1:-1] + k[:-1, 1:-1])
        ky = 2 * k[1:-1, 1:] * k[1:-1, :-1] / (k[1:-1, 1:] + k[1:-1, :-1])
        slope_x, slope_y = np.diff(wide[:, 1:-1], axis=0) / h, np.diff(wide[1:-1], axis=1) / h
        capacity = mixed(CAPACITY, front.inside(*self.at_cell))
        flow = (np.diff(kx * slope_x, axis=0) + np.diff(ky * slope_y, axis=1)) / h
        moved_x, moved_y = self.u * slope_x, self.v * slope_y
        carried = 0.5 * (moved_x[1:] + moved_x[:-1] + moved_y[:, 1:] + moved_y[:, :-1])
        self.t = t + dt * (flow / capacity - carried)

    def rates(self, front: Front) -> tuple[np.ndarray, np.ndarray]:
        """Rates of u and v by viscosity, convection and the front, zero at the walls."""
        h, u, v = self.h, self.u, self.v
        mu = mixed(VISCOSITY, front.inside(*self.at_cell))
        corner = mixed(VISCOSITY, front.inside(*self.at_corner))
        u_wide = np.pad(u, ((0, 0), (1, 1)), mode="edge")
        u_wide[:, 0] *= -1
        u_wide[:, -1] *= -1
        v_wide = np.pad(v, ((1, 1), (0, 0)), mode="edge")
        u_y, v_x = np.diff(u_wide, axis=1) / h, np.diff(v_wide, axis=0) / h
        u_x, v_y = np.diff(u, axis=0) / h, np.diff(v, axis=1) / h
        shear = corner * (u_y + v_x)
        du, dv = np.zeros(u.shape), np.zeros(v.shape)
        du[1:-1] = (2 * np.diff(mu * u_x, axis=0) + np.diff(shear[1:-1], axis=1)) / h
        dv[:, 1:-1] = (2 * np.diff(mu * v_y, axis=1) + np.diff(shear[:, 1:-1], axis=0)) / h
        pulls = front.pulls(self) / h**2
        for rate, to_front, pull in zip((du, dv), self.faces(front), pulls.T):
            rate += (to_front.T @ pull).reshape(rate.shape)
        du /= self.rho_u
        dv /= self.rho_v
        v_at_u = 0.25 * (v[1:, 1:] + v[1:, :-1] + v[:-1, 1:] + v[:-1, :-1])
        u_at_v = 0.25 * (u[1:, 1:] + u[1:, :-1] + u[:-1, 1:] + u[:-1, :-1])
        du[1:-1] -= u[1:-1] * 0.5 * (u_x[1:] + u_x[:-1]) + v_at_u * 0.5 * (u_y[1:-1, 1:] + u_y[1:-1, :-1])
        dv[:, 1:-1] -= v[:, 1:-1] * 0.5 * (v_y[:, 1:] + v_y[:, :-1]) + u_at_v * 0.5 * (v_x[1:, 1:-1] + v_x[:-1, 1:-1])
        du[0] = du[-1] = 0
        dv[:, 0] = dv[:, -1] = 0
        return du, dv

    def step(self, front: Front, dt: float) -> None:
        """Advances flow, temperature and front."""
        h, least = self.h, min(DENSITY)
        self.rho_u = mixed(DENSITY, front.inside(*self.at_u))
        self.rho_v = mixed(DENSITY, front.inside(*self.at_v))
        du, dv = self.rates(front)
        guess = 2 * self.p - self.before
        du[1:-1] -= (1 / self.rho_u - 1 / least)[1:-1] * np.diff(guess, axis=0) / h
        dv[:, 1:-1] -= (1 / self.rho_v - 1 / least)[:, 1:-1] * np.diff(guess, axis=1) / h
        self.heat(front, dt)
        self.u, self.v = self.u + dt * du, self.v + dt * dv
        excess = (np.diff(self.u, axis=0) + np.diff(self.v, axis=1)) / h
        self.before = self.p
        self.p = self.solve(least / dt * excess.ravel()).reshape(self.p.shape)
        self.u[1:-1] -= dt / least * np.diff(self.p, axis=0) / h
        self.v[:, 1:-1] -= dt / least * np.diff(self.p, axis=1) / h
        velocity = [w @ field.ravel() for w, field in zip(self.faces(front), (self.u, self.v))]
        front.x = front.x + dt * np.stack(velocity, axis=1)


def mixed(values: tuple[float, float], inside: np.ndarray) -> np.ndarray:
    """Property of a mixture."""
    return values[1] + (values[0] - values[1]) * inside


def main(n: int) -> None:
    grid, front = Grid(n), Front(SIZE / n)
    _, area = front.centre()
    steps = int(np.ceil(2 * TIME / (0.12 * grid.h**2 / 9.6e-5)))
    dt = 2 * TIME / steps
    for step in range(1, steps + 1):
        grid.step(front, dt)
        if step % 20 == 0:
            front.spread()
        if step % (steps // 20) == 0:
            middle, now = front.centre()
            inside = front.inside(*grid.at_v)
            speed = (inside * grid.v).sum() / inside.sum() / SPEED
            y = (middle[1] - SIZE / 2) / RADIUS
            print(f"t* = {step * dt / TIME:.3f}  U* = {speed:.4f}  y/R = {y:.4f}  area {now / area - 1:+.1e}", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]))
