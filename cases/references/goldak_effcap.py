"""Latent heat as a heat capacity, in explicit steps, for the case `wang-7.5.4.2-goldak-phase-apparent`.

    python3 goldak_effcap.py

Cells and source of `goldak_fv.py` with 0.4 mm, but temperatures advance by the capacity at the start of each step
([Wang2025] eq. 7.32). Cells that jump over the whole interval between solidus and liquidus in a step, right after the
source is switched on, gain or lose latent heat. Prints the energy at 4 s over that of the source for two steps (its
deviation from 1 is the limit of the heat audit of the case), and the number of jumps. Needs NumPy, SciPy and Numba."""

import goldak_fv as fv
import numpy as np
from numba import njit


@njit
def advance(temperature, flow, parts, step, peak):  # type: ignore[no-untyped-def]
    """Adds the flow and the source over a step; returns how many cells jumped over the interval."""
    jumps = 0
    nx, ny, nz = temperature.shape
    for i in range(nx):
        for j in range(ny):
            for k in range(nz):
                old = temperature[i, j, k]
                is_mushy = fv.SOLIDUS <= old <= fv.LIQUIDUS
                heat = fv.MUSHY_HEAT if is_mushy else fv.HEAT
                supplied = flow[i, j, k] + peak * parts[0][i] * parts[1][j] * parts[2][k]
                new = old + step * supplied / (fv.DENSITY * heat)
                low, high = min(old, new), max(old, new)
                if low < fv.SOLIDUS and high > fv.LIQUIDUS:
                    jumps += 1
                temperature[i, j, k] = new
    return jumps


def solve(step: float, size: float = 4e-4) -> tuple[float, int]:
    """Energy at the end over that of the source, and the number of jumps."""
    grid = fv.Grid(size)
    temperature, flow = np.zeros(grid.shape), np.zeros(grid.shape)
    jumps = 0
    for number in range(round(fv.END / step)):
        fv.heat_flow(temperature, grid.conductances, grid.sizes, flow)
        jumps += advance(temperature, flow, grid.source((number + 0.5) * step), step, fv.PEAK)
    below = np.minimum(temperature, fv.SOLIDUS) + np.maximum(temperature - fv.LIQUIDUS, 0.0)
    mushy = np.clip(temperature - fv.SOLIDUS, 0.0, fv.LIQUIDUS - fv.SOLIDUS)
    return grid.energy(fv.DENSITY * (fv.HEAT * below + fv.MUSHY_HEAT * mushy)), jumps


def values() -> dict[str, float]:
    """Energies over that of the source, and numbers of jumps, for steps in s."""
    found = {}
    for step in (1.8e-3, 5e-4):
        energy, jumps = solve(step)
        found[f"step {step} s: energy"] = energy
        found[f"step {step} s: jumps"] = float(jumps)
    return found


if __name__ == "__main__":
    for name, value in values().items():
        print(f"{name} {value:.6f}")
