"""Thermoelastic plates by finite differences: reference of `gao-3.5.1-plate-shock-*` and `gao-3.6.2a-cracked-plate`.

Gao (2020), sections 3.5.1 and 3.6.2. The equations of plane stress with coupling,

    rho u_tt = div sigma,   rho c T_t = k lap T - T0 beta d/dt div u,
    sigma_xx = M (u_x + nu v_y) - beta T,   sigma_yy = M (nu u_x + v_y) - beta T,   sigma_xy = M (1 - nu)/2 (u_y + v_x),

for the upper half of the plate, y = 0 being a plane of symmetry. Staggered grid: temperature and normal stresses at
the centres of the cells, u and v on their faces, shear stress at their corners. Displacements and velocities by the
leapfrog method, temperature by forward Euler. Faces on free edges have half a mass and the given stress. A crack along
a line of faces gives these two displacements, each with half a mass and no stress.

    python3 thermoelastic_plate.py [cells along the plate]

The numbers of the cases are of 400 cells. With the default, 200 cells for the scaled plate and 400 for the cracked one,
the scaled plate is within 2e-4 (T) and 1.6e-3 (u) of them.
"""

import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np


@dataclass
class Plate:
    """A square plate of cells of equal size, loaded on its left edge and held on its right one."""

    length: float
    cells: int
    density: float
    capacity: float  # rho c
    conductivity: float
    stiffness: float  # M
    ratio: float
    thermal_modulus: float
    reference: float  # T0; zero without coupling
    crack: float = 0.0  # half of its length, in the middle of the plate
    u: np.ndarray = field(init=False)
    v: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        columns, rows = self.cells, self.cells // 2
        self.size = self.length / self.cells
        self.u, self.du = np.zeros((2, columns + 1, rows))
        self.v, self.dv = np.zeros((2, columns, rows + 1))
        self.temperature = np.zeros((columns, rows))
        self.middle, self.open = columns // 2, round(self.crack / self.size)
        # right side of the crack; the left one is in `u`
        self.right, self.dright = np.zeros((2, self.open))

    def strains(self, u: np.ndarray, v: np.ndarray, right: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Of displacements, or their rates."""
        x, y = np.diff(u, axis=0), np.diff(v, axis=1)
        x[self.middle, : self.open] += u[self.middle, : self.open] - right
        return x / self.size, y / self.size

    def step(self, dt: float, pressure: float, edge: float | None) -> None:
        """One step under a pressure and, if given, a temperature of the left edge."""
        h, open_, middle = self.size, self.open, self.middle
        x, y = self.strains(self.u, self.v, self.right)
        thermal = self.thermal_modulus * self.temperature
        sxx = self.stiffness * (x + self.ratio * y) - thermal
        syy = self.stiffness * (self.ratio * x + y) - thermal
        # corners: zero on the free edges and on the axis
        shear = np.zeros((self.cells + 1, self.v.shape[1]))
        u = self.u.copy()
        u[middle, :open_] = 0.5 * (u[middle, :open_] + self.right)
        shear[1:, 1:-1] = np.diff(u, axis=1)[1:]
        shear[1:-1, 1:-1] += np.diff(self.v, axis=0)[:, 1:-1]
        shear[-1, 1:-1] -= 2 * self.v[-1, 1:-1]
        shear[middle, :open_] = 0.0
        shear *= self.stiffness * (1 - self.ratio) / (2 * h)
        force = np.diff(shear, axis=1)
        force[1:-1] += np.diff(sxx, axis=0)
        force[0] = 2 * (sxx[0] + pressure)
        right = 2 * sxx[middle, :open_]
        force[middle, :open_] = -2 * sxx[middle - 1, :open_]
        force[-1] = 0.0
        self.du += dt / (self.density * h) * force
        self.dright += dt / (self.density * h) * right
        force = np.diff(shear, axis=0)
        force[:, 1:-1] += np.diff(syy, axis=1)
        force[:, -1] = -2 * syy[:, -1]
        force[:, 0] = 0.0
        self.dv += dt / (self.density * h) * force
        self.u += dt * self.du
        self.v += dt * self.dv
        self.right += dt * self.dright
        self.conduct(dt, edge)

    def conduct(self, dt: float, edge: float | None) -> None:
        """Conduction and the heat of deformation."""
        t = self.temperature
        flux = np.zeros_like(t)
        across = np.diff(t, axis=0)
        across[self.middle - 1, : self.open] = 0.0
        flux[:-1] += across
        flux[1:] -= across
        across = np.diff(t, axis=1)
        flux[:, :-1] += across
        flux[:, 1:] -= across
        if edge is not None:
            flux[0] += 2 * (edge - t[0])
        x, y = self.strains(self.du, self.dv, self.dright)
        heat = self.conductivity / self.size**2 * flux - self.reference * self.thermal_modulus * (x + y)
        self.temperature = t + dt / self.capacity * heat

    def on_axis(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Displacement and temperature at distances from the left edge."""
        faces = np.arange(self.cells + 1) * self.size
        centres = faces[1:] - 0.5 * self.size
        # the first row lies half a cell from the axis: even in y
        return (
            np.interp(places, faces, 1.125 * self.u[:, 0] - 0.125 * self.u[:, 1]),
            np.interp(places, centres, 1.125 * self.temperature[:, 0] - 0.125 * self.temperature[:, 1]),
        )


def pulse(t: float) -> float:
    """Pressure or temperature of the left edge of the scaled plate."""
    return 5 * t * np.exp(-2 * t)


def run(
    plate: Plate, dt: float, times: list[float], load: Callable[[float], tuple[float, float | None]]
) -> Iterator[float]:
    """Runs a plate; yields each of the times when it is reached."""
    number = 0
    for time in times:
        while number < round(time / dt):
            # both at the beginning of the step: of first order in time
            plate.step(dt, *load(number * dt))
            number += 1
        yield time


def scaled(loading: str, coupling: float, cells: int) -> dict[str, float]:
    """The scaled plate of section 3.5.1: L1 is a pulse of pressure, L2 one of heat."""
    plate = Plate(10.0, cells, 1.0, 1.0, 1.0, 1.0, 0.17, 1.0, coupling)
    # a fifth of the square of the cell is the limit at the left edge
    steps = int(np.ceil(3 / (0.16 * plate.size**2)))
    places = np.array([0, 0.5, 1, 1.5, 2, 2.5, 3.5, 4, 4.5, 5, 5.5, 6.5, 7, 8])

    def load(t: float) -> tuple[float, float]:
        return (pulse(t), 0.0) if loading == "L1" else (0.0, pulse(t))

    found = {}
    for time in run(plate, 3 / steps, [3.0, 6.0], load):
        u, temperature = plate.on_axis(places)
        for place, a, b in zip(places, u, temperature, strict=True):
            name = f"{loading}, coupling {coupling}, t = {time:g}, x = {place:g}"
            found[f"u, {name}"] = float(a)
            if place > 0:
                found[f"T, {name}"] = float(b)
        highest = int(plate.temperature[:, 0].argmax())
        found[f"T, {loading}, coupling {coupling}, t = {time:g}, highest"] = float(plate.temperature[highest, 0])
        found[f"x, {loading}, coupling {coupling}, t = {time:g}, of the highest T"] = (highest + 0.5) * plate.size
    return found


def cracked(cells: int) -> dict[str, float]:
    """The steel plate with a crack of section 3.6.2, in SI units."""
    modulus, ratio = 200e9, 0.17
    stiffness, thermal = modulus / (1 - ratio**2), modulus * 11.5e-6 / (1 - ratio)
    plate = Plate(0.1, cells, 7870.0, 7870.0 * 472.0, 51.9, stiffness, ratio, thermal, 285.0, 0.01)
    dt = 1e-6 / np.ceil(1e-6 * 5123 / (0.5 * plate.size))
    places = np.array([-0.04, -0.02, 0.02, 0.04])
    found = {}
    times = [7e-6, 15e-6, 16e-6, 20e-6, 25e-6, 30e-6]
    for time in run(plate, dt, times, lambda t: (-1e14 * min(t, 8e-6), None)):
        name = f"at {1e6 * time:g} us"
        u, temperature = plate.on_axis(places + 0.05)
        for place, a, b in zip(places, u, temperature, strict=True):
            found[f"u of x = {1e3 * place:g} mm {name}, m"] = float(a)
            found[f"T of x = {1e3 * place:g} mm {name}, K"] = float(b)
        opening = plate.right - plate.u[plate.middle, : plate.open]
        found[f"opening of the crack {name}, m"] = float(1.125 * opening[0] - 0.125 * opening[1])
        if time == 15e-6:
            at = [int(0.01 / plate.size), int(0.04 / plate.size)]
            found[f"T of (-40, 40) mm {name}, K"] = float(plate.temperature[tuple(at)])
    found["highest T at 30 us, K"] = float(plate.temperature.max())
    found["lowest T at 30 us (at the tip, singular), K"] = float(plate.temperature.min())
    return found


def values(cells: int = 200) -> dict[str, float]:
    """All numbers by name."""
    found = {}
    for loading in ("L1", "L2"):
        for coupling in (0.0, 0.1):
            found |= scaled(loading, coupling, cells)
    return found | cracked(2 * cells)


if __name__ == "__main__":
    for name, value in values(*map(int, sys.argv[1:2])).items():
        print(f"{name}: {value:.5g}")
