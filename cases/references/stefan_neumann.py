"""Freezing of a slab: references of the cases `wang-7.5.1-*`, `wang-7.5.2-*` and `freezing-water*`.

    python3 stefan_neumann.py

Slab of L = 10 mm, 0.6 W/(m K), 1000 kg/m3, 4200 J/(kg K), whose latent heat of 42 kJ/kg is absorbed between -1 and 0
degrees Celsius ([Wang2025] eqs. 7.20 to 7.22); the side s = 0 is at -5, the other one is insulated. It starts at 0
(Stefan) or at 2 degrees (Neumann).

- Similarity solution of the half space: temperatures -1 and 0 at s = 2 l sqrt(a t), where l solves the balance of the
  heat flows on both sides of these isotherms (docs/theory/phase_change.md).
- Slab: explicit finite volumes for the enthalpy, points on the faces of L/n, n = 100 and 200, Fourier number 1/4,
  extrapolated with the square of the size (times of crossings, too).
- Without latent heat: series of sines.
- Water that freezes at one temperature, of other properties in ice: Neumann's solution.

Prints temperatures (degrees Celsius) at s in mm, times (s) and fractions. Needs NumPy and SciPy.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, fsolve
from scipy.special import erf, erfc

Array = NDArray[np.float64]

CONDUCTIVITY, DENSITY, LENGTH = 0.6, 1000.0, 0.01  # W/(m K), kg/m3, m
HEAT, MUSHY_HEAT = 4200.0, 42000.0  # J/(kg K)
SOLIDUS, LIQUIDUS, WALL = -1.0, 0.0, -5.0  # degrees Celsius
DIFFUSIVITY = CONDUCTIVITY / DENSITY / HEAT  # m2/s
ROOT = (MUSHY_HEAT / HEAT) ** 0.5
LATENT = DENSITY * MUSHY_HEAT * (LIQUIDUS - SOLIDUS)  # J/m3
MILLIMETRES = np.arange(1, 11)


def slope(at: float) -> float:
    """exp(-l^2) / erf(l) at l."""
    return float(np.exp(-at * at) / erf(at))


def isotherms(start: float) -> tuple[float, float | None]:
    """l of the isotherms of -1 and 0 degrees in the half space; all of it freezes from 0 degrees on."""
    solid, mushy = SOLIDUS - WALL, LIQUIDUS - SOLIDUS
    if start == LIQUIDUS:

        def one(at: float) -> float:
            return solid * slope(at) - mushy * ROOT * float(np.exp(-((ROOT * at) ** 2)) / erfc(ROOT * at))

        return float(brentq(one, 0.1, 1.0, xtol=1e-15)), None

    def two(ls: Array) -> list[float]:
        first, second = ls
        width = erf(ROOT * second) - erf(ROOT * first)
        return [
            solid * slope(first) - mushy * ROOT * np.exp(-((ROOT * first) ** 2)) / width,
            mushy * ROOT * np.exp(-((ROOT * second) ** 2)) / width
            - (start - LIQUIDUS) * np.exp(-(second**2)) / erfc(second),
        ]

    first, second = fsolve(two, (0.35, 0.5), xtol=1e-12)
    return float(first), float(second)


def similarity(s: float, time: float, start: float) -> float:
    """Temperature in the half space, degrees Celsius."""
    first, second = isotherms(start)
    at = s / (2 * (DIFFUSIVITY * time) ** 0.5)
    if at < first:
        return float(WALL + (SOLIDUS - WALL) * erf(at) / erf(first))
    if second is None:
        return float(LIQUIDUS - (LIQUIDUS - SOLIDUS) * erfc(ROOT * at) / erfc(ROOT * first))
    if at < second:
        part = (erf(ROOT * at) - erf(ROOT * first)) / (erf(ROOT * second) - erf(ROOT * first))
        return float(SOLIDUS + (LIQUIDUS - SOLIDUS) * part)
    return float(start - (start - LIQUIDUS) * erfc(at) / erfc(second))


def temperature_of(enthalpy: Array) -> Array:
    """Degrees Celsius; the enthalpy (J/m3) is zero at the solidus."""
    solid = SOLIDUS + np.minimum(enthalpy, 0.0) / (DENSITY * HEAT)
    mushy = np.clip(enthalpy, 0.0, LATENT) / (DENSITY * MUSHY_HEAT)
    return solid + mushy + np.maximum(enthalpy - LATENT, 0.0) / (DENSITY * HEAT)


def enthalpy_of(temperature: Array) -> Array:
    """J/m3, zero at the solidus."""
    solid = DENSITY * HEAT * np.minimum(temperature - SOLIDUS, 0.0)
    mushy = DENSITY * MUSHY_HEAT * np.clip(temperature - SOLIDUS, 0.0, LIQUIDUS - SOLIDUS)
    return solid + mushy + DENSITY * HEAT * np.maximum(temperature - LIQUIDUS, 0.0)


def slab(cells: int, start: float, end: float) -> tuple[Array, Array]:
    """Times about 0.1 s apart (s), and temperatures at s = 0, 1, ..., 10 mm at these times (degrees Celsius)."""
    size = LENGTH / cells
    step = 0.25 * size**2 / DIFFUSIVITY
    temperature = np.full(cells + 1, start)
    temperature[0] = WALL
    enthalpy = enthalpy_of(temperature)
    volume = np.full(cells + 1, size)
    volume[[0, -1]] = size / 2
    every = max(1, round(0.1 / step))
    times, states = [0.0], [temperature[:: cells // 10].copy()]
    divergence = np.zeros(cells + 1)
    for number in range(1, int(np.ceil(end / step)) + every + 1):
        flow = CONDUCTIVITY / size * np.diff(temperature)
        divergence[:-1] = flow
        divergence[-1] = 0.0
        divergence[1:] -= flow
        enthalpy += step * divergence / volume
        temperature = temperature_of(enthalpy)
        temperature[0] = WALL
        if number % every == 0:
            times.append(number * step)
            states.append(temperature[:: cells // 10].copy())
    return np.array(times), np.array(states)


def crossing(times: Array, temperatures: Array, value: float) -> float:
    """Time at which a falling temperature reaches a value, s."""
    after = int(np.argmax(temperatures < value))
    before = after - 1
    part = (value - temperatures[before]) / (temperatures[after] - temperatures[before])
    return float(times[before] + part * (times[after] - times[before]))


def without_latent_heat(s: float, time: float, terms: int = 200) -> float:
    """Degrees Celsius, from 0 at first."""
    wave = (2 * np.arange(terms) + 1) * np.pi / (2 * LENGTH)
    series = np.sum(2 / (wave * LENGTH) * np.sin(wave * s) * np.exp(-DIFFUSIVITY * wave**2 * time))
    return float(WALL * (1 - series))


def freezing_water(time: float) -> float:
    """Fraction of a column of 30 mm that is liquid: from 2 degrees above freezing, with a wall 10 below (Neumann)."""
    ice, water = (2.2, 2000.0), (0.56, 4200.0)  # W/(m K), J/(kg K)
    ice_diffusivity, water_diffusivity = (k / (1000.0 * c) for k, c in (ice, water))
    ratio = (ice_diffusivity / water_diffusivity) ** 0.5

    def balance(at: float) -> float:
        to_wall = ice[0] * 10.0 * np.exp(-at * at) / (erf(at) * ice_diffusivity**0.5)
        from_water = water[0] * 2.0 * np.exp(-((ratio * at) ** 2)) / (erfc(ratio * at) * water_diffusivity**0.5)
        return float(to_wall - from_water - 1000.0 * 334e3 * at * (np.pi * ice_diffusivity) ** 0.5)

    front = brentq(balance, 1e-3, 2.0, xtol=1e-14)
    return float(1 - 2 * front * (ice_diffusivity * time) ** 0.5 / 0.03)


def values() -> dict[str, float]:
    """Temperatures, degrees Celsius; times, s; fractions of water."""
    found = {}
    for name, start, end in (("Stefan", 0.0, 900.0), ("Neumann", 2.0, 1500.0)):
        first, second = isotherms(start)
        found[f"{name}: l of -1 degrees"] = first
        if second is not None:
            found[f"{name}: l of 0 degrees"] = second
        runs = [slab(cells, start, end) for cells in (100, 200)]
        for time in (50, 100, 300, 600, 900):
            coarse, fine = ([np.interp(time, times, column) for column in states.T] for times, states in runs)
            for mm in MILLIMETRES:
                value = fine[mm] + (fine[mm] - coarse[mm]) / 3
                found[f"{name}: slab, s = {mm} mm at {time} s"] = float(value)
        for time in range(50, 1501, 50) if name == "Neumann" else ():
            for mm in (1, 10):
                coarse_value, fine_value = (float(np.interp(time, times, states[:, mm])) for times, states in runs)
                history = fine_value + (fine_value - coarse_value) / 3
                found[f"{name}: history of the slab, s = {mm} mm at {time} s"] = history
        for value in (0.0, -1.0):
            if value < start:
                coarse_time, fine_time = (crossing(times, states[:, -1], value) for times, states in runs)
                found[f"{name}: far face at {value} degrees, s"] = fine_time + (fine_time - coarse_time) / 3
    for time in (50, 100, 300):
        for mm in MILLIMETRES:
            found[f"Stefan: half space, s = {mm} mm at {time} s"] = similarity(mm / 1000, time, 0.0)
    for time in (300, 600, 900):
        for mm in MILLIMETRES:
            found[f"without latent heat, s = {mm} mm at {time} s"] = without_latent_heat(mm / 1000, time)
    for time in (50, 100, 200):
        found[f"liquid fraction of water at {time} s"] = freezing_water(time)
    return found


if __name__ == "__main__":
    for name, value in values().items():
        print(f"{name} {value:.7f}")
