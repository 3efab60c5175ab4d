"""Two bodies of one temperature each that exchange heat: `fire-two-way`.

    python3 two_bodies.py

Laminates of 20 mm width along x and 3 mm thickness, and a block, beside gas of 10 mm. The flux balances that through the half cell of 2.5 mm
below the surface, whose temperature is a root. Integrated by a method of Runge and Kutta of order 8; the film of constant coefficient
also by its exponential.
"""

from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

STEFAN_BOLTZMANN = 5.670374419e-8  # W/(m2 K4)
GAS = 800 * 1000 * 0.01  # J/(m2 K)
Law = Callable[[float, float], float]
TIMES = np.array([50.0, 100.0, 150.0, 200.0])


def plies(t: float) -> float:
    return np.interp(t, [273.0, 348, 373, 573], [803.916, 1080.816, 1357.84, 1729.634])


def film() -> list[np.ndarray]:
    body = 1620 * 1000 * 0.005
    conductance = 1 / (1 / 50 + 0.0025 / 50)
    mixed = (300 * body + 900 * GAS) / (body + GAS)
    rate = conductance * (1 / body + 1 / GAS)
    temperature = mixed + (300 - mixed) * np.exp(-rate * TIMES)
    gas = mixed + (900 - mixed) * np.exp(-rate * TIMES)
    return [temperature, gas]


def mixed(law: Law, capacity: Callable[[float], float], conductivity: float) -> list[np.ndarray]:
    def flux(t: float, gas: float) -> float:
        def surplus(surface: float) -> float:
            return law(gas, surface) - conductivity / 0.0025 * (surface - t)

        return law(gas, brentq(surplus, min(t, gas) - 1e-9, max(t, gas) + 1e-9, xtol=1e-12))

    def rate(_: float, state: np.ndarray) -> list[float]:
        q = flux(*state)
        return [q / capacity(state[0]), -q / GAS]

    found = solve_ivp(rate, (0, TIMES[-1]), [300.0, 900.0], "DOP853", TIMES, rtol=1e-10, atol=1e-8)
    return [found.y[0], found.y[1]]


def radiation(gas: float, t: float) -> float:
    return 0.8 * STEFAN_BOLTZMANN * (gas**4 - t**4)


def natural(factor: float, least: float = 0.0) -> Law:
    return lambda gas, t: max(least, factor * abs(gas - t) ** (1 / 3)) * (gas - t) + radiation(gas, t)


def values() -> dict[str, float]:
    """Temperatures of the bodies and of their gas at `TIMES`, K."""
    pairs = {
        "film": film(),
        "fire": mixed(natural(1.38, 5), lambda t: 1620 * plies(t) * 0.02, 200),
        "block": mixed(natural(1.52), lambda _: 1620 * 1000 * 0.02, 200),
    }
    return {
        f"{name}, {which}, after {time:.0f} s": float(temperature)
        for name, pair in pairs.items()
        for which, temperatures in zip(("body", "gas"), pair, strict=True)
        for time, temperature in zip(TIMES, temperatures, strict=True)
    }


if __name__ == "__main__":
    for name, value in values().items():
        print(f"{name}: {value:.3f} K")
