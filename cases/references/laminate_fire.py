"""References of laminates in fires.

    python3 laminate_fire.py

- `fire-laminate-plate`: a plate of one temperature in the standard fire, by convection and radiation through its sides, its edges, and
  both, integrated by a method of Runge and Kutta of order 8.
- `gao-8.4.1-*`: the laminate [0/90/0] of Gao (2020), 8.4.1, 100 x 100 x 3 mm, whose edge has the temperature of the fire over 25 mm. Finite
  volumes with the enthalpy as the state, explicit steps; the edge conducts over half a volume; conductivities are the means of
  neighbours, those between plies k / h^2.
"""

import numpy as np
from fires import iso_834, iso_834_rise
from scipy.integrate import solve_ivp

STEFAN_BOLTZMANN = 5.670374419e-8  # W/(m2 K4)
DENSITY = 1620.0

# Gao (2020), eqs. 8.2 and 8.3 at the ends of their ranges
TEMPERATURE = np.array([273.0, 348, 373, 573])
CAPACITY = np.array([803.916, 1080.816, 1357.84, 1729.634])
ACROSS = np.array([0.568661, 0.6254, 0.563, 0.809])
ALONG, THROUGH = 8.3075, 0.2


def capacity(t):
    return np.interp(t, TEMPERATURE, CAPACITY)


def plate(width: float = 0.02, thickness: float = 0.003) -> None:
    """A plate of one temperature with the areas over the volume of its sides and of its edges."""
    sides, edges = 2 / thickness, 4 / width
    times = [100.0, 200.0, 300.0, 600.0]
    for name, area in (("sides", sides), ("edges", edges), ("all", sides + edges)):

        def rate(time: float, t: np.ndarray, area: float = area) -> np.ndarray:
            gas = iso_834(time)
            flux = 25 * (gas - t) + 0.8 * STEFAN_BOLTZMANN * (gas**4 - t**4)
            return area * flux / (DENSITY * capacity(t))

        found = solve_ivp(rate, (0, times[-1]), [293.15], "DOP853", times, rtol=1e-11, atol=1e-9)
        print(f"{name}: " + ", ".join(f"{t:.3f} K at {time:.0f} s" for time, t in zip(times, found.y[0])))


def heated_edge(cells: int, step: float, times=(100.0, 250.0, 500.0)) -> None:
    """Mean rises of the plies, temperatures on the line y = W/2 and ignited areas; gives times and temperatures by ply, x and y."""
    length, thickness = 0.1, 0.001
    dx = length / cells
    middle = (np.arange(cells) + 0.5) * dx
    held = np.abs(middle - length / 2) < length / 8
    # the integral of the capacity
    fine = np.linspace(273, 1400, 200_001)
    c = capacity(fine)
    enthalpy = DENSITY * np.concatenate([[0], np.cumsum((c[1:] + c[:-1]) / 2 * np.diff(fine))])
    h = np.full((3, cells, cells), np.interp(293.0, fine, enthalpy))
    steps = round(times[-1] / step)
    for number in range(steps):
        t = np.interp(h, enthalpy, fine)
        across = np.interp(t, TEMPERATURE, ACROSS)
        along = np.full_like(t, ALONG)
        k = [np.stack([along[0], across[1], along[2]]), np.stack([across[0], along[1], across[2]])]
        rate = np.zeros_like(h)
        # arrays have the plies, x and y as axes
        for axis, conductivity in ((1, k[0]), (2, k[1])):
            first = [slice(None)] * 3
            second = [slice(None)] * 3
            first[axis], second[axis] = slice(0, -1), slice(1, None)
            first, second = tuple(first), tuple(second)
            mean = (conductivity[first] + conductivity[second]) / 2
            flow = mean * (t[second] - t[first]) / dx**2
            rate[first] += flow
            rate[second] -= flow
        flow = THROUGH * np.diff(t, axis=0) / thickness**2
        rate[:-1] += flow
        rate[1:] -= flow
        fire = 293 + iso_834_rise((number + 0.5) * step)
        rate[:, 0, held] += k[0][:, 0, held] * (fire - t[:, 0, held]) / (dx * dx / 2)
        h += step * rate
        time = (number + 1) * step
        if any(abs(time - wanted) < step / 2 for wanted in times):
            t = np.interp(h, enthalpy, fine)
            rises = t.mean(axis=(1, 2)) - 293
            line = (t[:, :, cells // 2 - 1] + t[:, :, cells // 2]) / 2
            print(f"{cells} x {cells}, {time:.0f} s: mean rise {t.mean() - 293:.3f} K, of the plies {rises.round(3)}")
            for x in (0.005, 0.01, 0.02, 0.05, 0.095):
                print(f"    x = {x} m: " + ", ".join(f"{np.interp(x, middle, line[ply]):.2f}" for ply in (0, 1)) + " K")
            ignited = (t > 573).sum(axis=(1, 2)) * dx * dx * 1e6
            print(f"    above 573 K: {ignited.round(1)} mm2; heat {(h - np.interp(293.0, fine, enthalpy)).sum() * dx * dx * thickness:.1f} J")
            yield time, t


if __name__ == "__main__":
    plate()
    for cells, step in ((40, 0.1), (80, 0.05)):
        list(heated_edge(cells, step))
