"""Temperatures of the cases `quench-2.*` and `dual-growing-crack` ([Aatitya2021], chapter 2).

    python3 quench_thermal.py

- Square plate with one hot side: Fourier series with 200 terms.
- Plate of 2 cm with an insulated crack along its middle, sides insulated: exact steady state by a conformal map to a
  rectangle (docs/theory/heat_conduction.md, "Insulated crack"), for a crack in the middle and for one from the edge.
- Its cooling from 500 degrees Celsius: the sum of an odd part, by finite volumes with points at the corners of 80 and
  160 cells per cm, implicit Euler with 1000 and 2000 steps, each extrapolated linearly, and of an even part, a series
  of sines.
- Quenching of a plate of aluminium by a moving jet: finite volumes along the plate with 900 cells, explicit steps of
  0.2 of size^2 / diffusivity, with the boiling curve and the film of docs/theory/quenching.md, with and without six
  insulating cracks.

Prints temperatures in degrees Celsius and positions in m, heat in J per metre of plate. Needs NumPy and SciPy.
"""

from collections.abc import Callable

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.sparse.linalg import splu
from scipy.special import ellipj, ellipk, ellipkinc

Array = NDArray[np.float64]

WALL, START = 100.0, 500.0  # degrees Celsius
DIFFUSIVITY = 1.14e-4  # m2/s, of the plate with a crack
HALF = 0.01  # m, half of that plate
# of the quenched plate: m, m, W/(m K), J/(m3 K), degrees Celsius
LENGTH, THICKNESS, CONDUCTIVITY, CAPACITY, HOT = 0.2, 0.01, 200.0, 2.6e6, 560.0
SPEED, IMPINGEMENT = 0.01, 0.01  # m/s, m
BOILING = ((50.0, 180.0, 500.0), (0.0, 7e6, 3.5e6))  # degrees Celsius, W/m2
WATER, LEIDENFROST, FILM = 50.0, 500.0, 200.0  # degrees Celsius, degrees Celsius, W/(m2 K)
CRACKS = np.array([56, 87.111, 107.556, 125.333, 142.222, 168.889]) * 1e-3  # m
RECORDS = np.array([3.675, 5.2, 6.25, 7.35, 10.4, 12.5, 14.0])  # s
ALONG = np.array([60, 70, 80, 90, 100, 110, 120, 130, 140, 160, 180, 195]) * 1e-3  # m


def hot_side(x: float, y: float, terms: int = 200) -> float:
    """Temperature of a square of side 1 at 100 degrees on y = 1 and at 0 elsewhere."""
    wave = (2 * np.arange(terms) + 1) * np.pi
    rise = np.exp(wave * (y - 1)) * (1 - np.exp(-2 * wave * y)) / (1 - np.exp(-2 * wave))
    return float(WALL * np.sum(4 / wave * rise * np.sin(wave * x)))


def half_plate(crack: float, width: float, height: float) -> tuple[float, Callable[[float], float]]:
    """Flux over conductivity, and the temperature at x = 0 by y, of half of a plate, 0 < x < width, 0 < y < height.

    Its lower side is insulated up to the crack's length and at 0 beyond, its upper side is at 1.
    """
    m = float(brentq(lambda m: ellipk(1 - m) / ellipk(m) - height / width, 1e-12, 1 - 1e-12, xtol=1e-15))
    tip = ellipj(ellipk(m) * crack / width, m)[0] ** 2
    q = (1 - tip) / (1 / m - tip)

    def temperature(y: float) -> float:
        sn, cn = ellipj(ellipk(m) * y / width, 1 - m)[:2]
        along = (-((sn / cn) ** 2) - tip) / (1 - tip)
        return float(ellipkinc(np.arctan(np.sqrt(-along)), 1 - q) / ellipk(1 - q))

    return float(ellipk(q) / ellipk(1 - q)), temperature


def odd_part(times: Array, cells: int, steps: int) -> Array:
    """Temperatures at x = 0, y = 0, 1, ..., 10 mm above the crack at some times, from 0, with 1 at the upper side."""
    size, number = HALF / cells, cells + 1
    weight = np.ones(number)
    weight[[0, -1]] = 0.5
    along = sparse.diags([np.ones(cells), -2 * weight, np.ones(cells)], [-1, 0, 1])
    mass = sparse.diags(weight)
    # y, x
    conduction = (sparse.kron(along, mass) + sparse.kron(mass, along)).tocsr()
    volume = np.kron(weight, weight) * size**2
    held, value = np.zeros((number, number), bool), np.zeros((number, number))
    held[0, np.arange(number) * size > 0.5 * HALF - 1e-9] = True
    held[-1], value[-1] = True, 1.0
    free, value = ~held.ravel(), value.ravel()
    from_held = conduction[free][:, ~free] @ value[~free]

    def march(steps: int) -> Array:
        step = times[-1] / steps
        solver = splu((sparse.diags(volume[free]) - DIFFUSIVITY * step * conduction[free][:, free]).tocsc())
        now, found = np.zeros(int(free.sum())), []
        for i in range(1, steps + 1):
            now = solver.solve(volume[free] * now + DIFFUSIVITY * step * from_held)
            if np.any(np.abs(times - i * step) < 1e-9):
                value[free] = now
                found.append(value.reshape(number, number)[:: cells // 10, 0].copy())
        return np.array(found)

    return 2 * march(steps) - march(steps // 2)


def even_part(y: float, time: float, terms: int = 200) -> float:
    """Of a slab of 2 cm between sides at 0 that starts at 500 degrees, at y above its middle, m."""
    n = 2 * np.arange(terms) + 1
    wave = n * np.pi / (2 * HALF)
    series = 4 / (n * np.pi) * np.sin(wave * (HALF + y)) * np.exp(-DIFFUSIVITY * wave**2 * time)
    return float(START * np.sum(series))


def quench(cells: int, cracks: Array) -> tuple[Array, list[tuple[Array, float]]]:
    """Centres of the cells (m), and at each record their temperatures and the heat taken (J/m)."""
    size = LENGTH / cells
    x = (np.arange(cells) + 0.5) * size
    between = np.full(cells - 1, CONDUCTIVITY / size)
    between[np.round(cracks / size).astype(int) - 1] = 0.0
    steps = int(np.ceil(RECORDS[-1] / (0.2 * size**2 * CAPACITY / CONDUCTIVITY)))
    step = RECORDS[-1] / steps
    temperature, taken, found = np.full(cells, HOT), 0.0, []
    for i in range(steps):
        below = x - (LENGTH - SPEED * i * step)  # the way from the jet, downstream
        is_wet = below >= 0
        flux = np.where(is_wet, np.interp(temperature, *BOILING), 0.0)
        too_hot = np.flatnonzero(is_wet & (below > IMPINGEMENT) & (temperature > LEIDENFROST))
        if len(too_hot):
            lifted = slice(too_hot[0] + 1, None)
            flux[lifted] = FILM * (temperature[lifted] - WATER)
        flow = between * np.diff(temperature)
        rate = -flux / THICKNESS
        rate[:-1] += flow / size
        rate[1:] -= flow / size
        temperature = temperature + step / CAPACITY * rate
        taken += float(flux.sum()) * size * step
        while len(found) < len(RECORDS) and (i + 1) * step >= RECORDS[len(found)] - 1e-9:
            found.append((temperature, taken))
    return x, found


def values() -> dict[str, float]:
    """Temperatures, degrees Celsius; positions, m; fluxes over those without a crack; heat, J/m."""
    found = {}
    for part in (0.1, 0.25, 0.5, 0.75, 0.9):
        found[f"hot side: x = L/2, y = {part} L"] = hot_side(0.5, part)
        found[f"hot side: x = {part} L, y = L/2"] = hot_side(part, 0.5)
    steady = half_plate(0.5, 1.0, 1.0)[1]
    for mm in range(10):
        found[f"crack: steady, {mm} mm above it"] = WALL * steady(mm / 10)
    for cm in (0.25, 0.5, 0.75, 1.0, 1.25, 1.5):
        flux, at = half_plate(cm, 2.0, 1.0)
        found[f"crack of {cm} cm from the edge: flux"] = flux / 2
        found[f"crack of {cm} cm from the edge: lip at the edge"] = WALL * at(0.0)
        flux, at = half_plate(cm / 2, 1.0, 1.0)
        found[f"crack of {cm} cm in the middle: flux"] = flux
        found[f"crack of {cm} cm in the middle: lip in its middle"] = WALL * at(0.0)
    times = np.array([0.05, 0.1, 0.2, 0.5, 1.0])
    coarse, fine = (WALL * odd_part(times, cells, 2000) for cells in (80, 160))
    for time, odd in zip(times, 2 * fine - coarse):
        for mm in range(10):
            found[f"crack: odd part at {time} s, {mm} mm above it"] = float(odd[mm])
            found[f"crack: even part at {time} s, {mm} mm above it"] = even_part(mm / 1000, time)
    for name, cracks in (("jet", np.array([])), ("jet, cracks", CRACKS)):
        x, records = quench(900, cracks)
        for time, (temperature, taken) in zip(RECORDS, records):
            found[f"{name}: heat taken at {time} s, J/m"] = taken
            found[f"{name}: mean temperature at {time} s"] = float(temperature.mean())
            if len(cracks):
                for position, value in zip(ALONG, np.interp(ALONG, x, temperature)):
                    found[f"{name}: x = {position:.3f} m at {time} s"] = float(value)
                if time == 7.35:
                    for crack in CRACKS:
                        right = round(crack * 900 / LENGTH)
                        found[f"{name}: left lip at {crack:.6f} m, {time} s"] = float(temperature[right - 1])
                        found[f"{name}: right lip at {crack:.6f} m, {time} s"] = float(temperature[right])
            else:
                for level in (500.0, 300.0):
                    position = np.interp(-level, -temperature, x)
                    found[f"{name}: x of {level:.0f} degrees at {time} s, m"] = float(position)
    return found


if __name__ == "__main__":
    for name, value in values().items():
        print(f"{name} {value:.7g}")
