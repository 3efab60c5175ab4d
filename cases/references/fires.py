"""References of cases in fires.

    python3 fires.py

- `gao-8.2-moduli`: displacements of a bar under uniform stress whose modulus depends on the temperature, by quadrature.
- `fire-steel-plate`: half of the plate in finite volumes of equal width, enthalpy as the state, integrated by LSODA. The temperature of
  the surface balances the fluxes from the gas and from the centre of the outermost volume.
"""

from math import log10, tanh

import numpy as np
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq

STEFAN_BOLTZMANN = 5.670374419e-8  # W/(m2 K4)
CELSIUS = 273.15


def iso_834(time: float) -> float:
    """Gas temperature (K) of the standard fire at a time (s)."""
    return CELSIUS + 20 + iso_834_rise(time)


def iso_834_rise(time: float) -> float:
    """Rise of the gas temperature (K) in the standard fire at a time (s): EN 1991-1-2, eq. 3.4."""
    return 345 * log10(8 * time / 60 + 1)


def steel_plate(cells: int) -> None:
    """Temperatures of a plate of 20 mm with the fire on both sides."""
    half, density = 0.01, 7850.0
    rows = np.array([20, 100, 200, 300, 400, 500, 600, 700, 735, 800, 900]) + CELSIUS
    capacity = np.array([440.0, 488, 530, 565, 606, 667, 760, 1008, 5000, 803, 650])
    # the integral of a piecewise linear capacity, on a fine grid
    fine = np.linspace(rows[0], 1500, 200_001)
    c = np.interp(fine, rows, capacity)
    enthalpy = density * np.concatenate([[0], np.cumsum((c[1:] + c[:-1]) / 2 * np.diff(fine))])

    def conductivity(t):
        return np.interp(t, [rows[0], 800 + CELSIUS], [53.334, 27.36])

    width = half / cells

    def flux_from_gas(surface: float, gas: float) -> float:
        return 25 * (gas - surface) + 0.7 * STEFAN_BOLTZMANN * (gas**4 - surface**4)

    def surface(outermost: float, gas: float) -> float:
        def balance(s: float) -> float:
            return flux_from_gas(s, gas) - conductivity(outermost) * (s - outermost) / (width / 2)

        return brentq(balance, 200, 2000, xtol=1e-12)

    def rate(time: float, h: np.ndarray) -> np.ndarray:
        t = np.interp(h, enthalpy, fine)
        k = conductivity((t[1:] + t[:-1]) / 2)
        # from the middle plane outwards, into the cell on the inner side
        inner = k * np.diff(t) / width
        gas = iso_834(time)
        outer = flux_from_gas(surface(t[-1], gas), gas)
        return np.diff(np.concatenate([[0], inner, [outer]])) / width

    times = [600.0, 1200.0, 1800.0, 2400.0]
    found = solve_ivp(rate, (0, times[-1]), np.zeros(cells), "LSODA", times, rtol=1e-7, atol=1.0, lband=1, uband=1)
    for time, h in zip(times, found.y.T):
        t = np.interp(h, enthalpy, fine)
        # even in the distance from the middle plane
        middle = t[0] - (t[1] - t[0]) / 8
        gas = iso_834(time)
        print(f"{cells} cells, {time:.0f} s: gas {gas:.4f} K, surface {surface(t[-1], gas):.4f} K, middle {middle:.4f} K")
        print(f"    heat taken up by the plate {2 * width * h.sum():.6e} J/m2")


def bar_through_the_glass_transition() -> None:
    """Displacements under 1 MPa at a temperature of 273 K + 2000 K/m x; Gao (2020), eq. 8.5."""

    def strain(x: float) -> float:
        return 1e6 / ((4.645 - 4.529 * tanh(0.02177 * (2000 * x - 100))) * 1e9)

    for x in (0.02, 0.04, 0.06, 0.08, 0.09):
        print(f"displacement at {x} m: {quad(strain, 0, x)[0]:.6e} m")


if __name__ == "__main__":
    bar_through_the_glass_transition()
    for number in (100, 200):
        steel_plate(number)
