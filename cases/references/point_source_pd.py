"""A point source that moves over a plate, by bonds: the error of the case `wang-7.5.3-point`.

    python3 point_source_pd.py

250 x 250 points of the plate of [Wang2025] 7.5.3, horizon of three spacings, explicit steps of 5 ms, half of the
plate y > 0, edges without bonds outside. The source heats the four points around a vertex (eq. 7.27), which it
changes half way between two of them or, as printed, on arrival at the next one (eq. 7.19). Prints temperatures next
to the path over those of Green's function (`moving_sources.py`) at 4 s: calibrated bonds of the rule `half` with both
dwells, and without calibration. About a minute. Needs NumPy and SciPy."""

import moving_sources as reference
import numpy as np
from numpy.typing import NDArray
from pd_lattice_constants import conductivity, family, micro_conductivity

Array = NDArray[np.float64]

HORIZON, STEP, END = 3, 5e-3, 4.0
POINTS = (-9.8, -5.0, 0.2, 5.0, 10.2, 15.0, 17.0, 18.2, 22.2, 23.0, 24.2, 25.0, 28.2, 30.2)  # mm


def march(is_calibrated: bool, is_centred: bool) -> Array:
    """Temperatures of the points next to the path, K."""
    offsets, distances, volumes = family(HORIZON, 2, "half")
    micro = micro_conductivity(HORIZON, 2) / (conductivity(HORIZON, 2, "half") if is_calibrated else 1.0)
    weights = micro * volumes / distances * reference.CONDUCTIVITY / reference.SPACING**2
    columns, rows = 250, 125
    margin = HORIZON
    # a margin of points whose bonds do not count outside, and the image of the other half
    is_inside = np.zeros((columns + 2 * margin, rows + 2 * margin))
    is_inside[margin:-margin, :-margin] = 1.0
    temperature = np.zeros((columns, rows))
    padded = np.zeros_like(is_inside)
    capacity = reference.DENSITY * reference.POINT_HEAT
    density = reference.POWER / (4 * reference.SPACING**2 * reference.THICKNESS)

    def shifted(field: Array, dx: int, dy: int) -> Array:
        return field[margin + dx : margin + dx + columns, margin + dy : margin + dy + rows]

    sums = sum(w * shifted(is_inside, *offset) for w, offset in zip(weights, offsets))
    for number in range(round(END / STEP)):
        padded[margin:-margin, margin:-margin] = temperature
        padded[margin:-margin, :margin] = temperature[:, margin - 1 :: -1]
        rate = -sums * temperature
        for weight, offset in zip(weights, offsets):
            rate += weight * shifted(padded, *offset)
        vertex = reference.SPEED * (number + 0.5) * STEP / reference.SPACING + (0.5 if is_centred else 0.0)
        column = columns // 2 + int(np.floor(vertex))
        rate[column - 1 : column + 1, 0] += density
        temperature += STEP / capacity * rate
    return temperature[:, 0]


def values() -> dict[str, float]:
    """Temperatures over those of Green's function."""
    found = {}
    x = (np.arange(250) - 124.5) * reference.SPACING
    options = (
        ("calibrated, centred", True, True),
        ("calibrated, on arrival", True, False),
        ("nominal, centred", False, True),
    )
    for name, is_calibrated, is_centred in options:
        temperature = march(is_calibrated, is_centred)
        for mm in POINTS:
            point = int(np.argmin(np.abs(x - mm / 1000)))
            found[f"{name}, x = {mm} mm"] = float(temperature[point]) / reference.point(mm / 1000, 2e-4)
    return found


if __name__ == "__main__":
    for name, value in values().items():
        print(f"{name} {value:.4f}")
