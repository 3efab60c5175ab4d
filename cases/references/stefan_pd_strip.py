"""Freezing of a slab by bonds, which shows the error that the cases `wang-7.5.1-*` and `wang-7.5.2-*` may have.

    python3 stefan_pd_strip.py

Slab of `stefan_neumann.py` as a strip of 100 columns (`dual_horizon_strip.py`) with a horizon of three spacings and
steps of 30 ms to 900 s, as [Wang2025] 7.5.1. Bonds without or with calibration, partial volumes `none`, `half` or
`full`; latent heat as an enthalpy or as a heat capacity at the start of a step; layers behind the cold face mirrored
(eq. 7.17) or constant. Prints when the last column reaches -1 degrees Celsius (s; the last half spacing makes it
later than the face by some 0.01 s) and the largest error (K) at 300, 600 and 900 s against finite volumes. Some
minutes. Needs NumPy and SciPy."""

import numpy as np
import stefan_neumann as reference
from dual_horizon_strip import Strip
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

Array = NDArray[np.float64]

COLUMNS, HORIZON, STEP, END = 100, 3, 0.03, 900.0
TIMES = (300.0, 600.0, 900.0)
# rule, calibrated, enthalpy, mirrored
OPTIONS = (
    ("half", True, True, True),
    ("half", True, False, True),
    ("half", True, False, False),
    ("none", False, False, True),
    ("none", False, False, False),
    ("full", False, False, True),
    ("half", False, False, True),
)


def strip(rule: str, is_calibrated: bool, left: str) -> Strip:
    """The slab, insulated on the right."""
    spacing = reference.LENGTH / COLUMNS
    sizes = (reference.LENGTH, (spacing, spacing), (HORIZON * spacing, HORIZON * spacing), reference.CONDUCTIVITY)
    return Strip(*sizes, rule, is_calibrated, (left, "insulated"))


def march(start: float, rule: str, is_calibrated: bool, by_enthalpy: bool, mirrored: bool) -> tuple[list[Array], float]:
    """Temperatures of the columns at the times, and when the last one falls below the solidus, s (else infinite)."""
    odd = strip(rule, is_calibrated, "prescribed")
    matrix, from_wall = odd.matrix, odd.left
    if not mirrored:
        # a constant layer is the mean of an odd and an even one
        matrix = (matrix + strip(rule, is_calibrated, "insulated").matrix) / 2
        from_wall = from_wall / 2
    sparse = csr_matrix(matrix)
    temperature = np.full(COLUMNS, start)
    enthalpy = reference.enthalpy_of(temperature)
    frozen, found = np.inf, []
    for number in range(1, round(END / STEP) + 1):
        rate = sparse @ temperature + from_wall * reference.WALL
        if by_enthalpy:
            enthalpy = enthalpy + STEP * rate
            new = reference.temperature_of(enthalpy)
        else:
            is_mushy = (temperature >= reference.SOLIDUS) & (temperature <= reference.LIQUIDUS)
            heat = np.where(is_mushy, reference.MUSHY_HEAT, reference.HEAT)
            new = temperature + STEP * rate / (reference.DENSITY * heat)
        if np.isinf(frozen) and new[-1] < reference.SOLIDUS:
            part = (temperature[-1] - reference.SOLIDUS) / (temperature[-1] - new[-1])
            frozen = (number - 1 + part) * STEP
        temperature = new
        if round(number * STEP, 6) in TIMES:
            found.append(temperature)
    return found, float(frozen)


def values(starts: tuple[float, ...] = (0.0, 2.0)) -> dict[str, float]:
    """Times (s) and largest errors (K)."""
    found = {}
    middle = (np.arange(COLUMNS) + 0.5) / COLUMNS * 10
    for start in starts:
        times, states = reference.slab(200, start, END)
        for options in OPTIONS:
            rule, is_calibrated, by_enthalpy, mirrored = options
            temperatures, frozen = march(start, *options)
            name = f"from {start}: {rule}, {'calibrated' if is_calibrated else 'nominal'}, "
            name += f"{'enthalpy' if by_enthalpy else 'capacity'}, {'mirrored' if mirrored else 'constant'}"
            found[f"{name}: freezing time, s"] = frozen
            for time, temperature in zip(TIMES, temperatures, strict=True):
                exact = [np.interp(time, times, column) for column in states.T]
                # only columns beside a whole millimetre, between which the temperature is nearly linear
                near = np.array([10 * mm + shift for mm in range(1, 10) for shift in (-1, 0)])
                curve = 0.5 * (temperature[near[0::2]] + temperature[near[1::2]])
                assert np.allclose(middle[near].reshape(-1, 2).mean(1), np.arange(1, 10))
                found[f"{name}: error at {time:.0f} s, K"] = float(np.abs(curve - exact[1:10]).max())
    return found


if __name__ == "__main__":
    for name, value in values().items():
        print(f"{name} {value:.4f}")
