"""Bond-based conduction with dual horizons on a plate whose data do not depend on y, for the cases `wang-6.4.1.*`.

    python3 dual_horizon_strip.py

With mirrored edges y the sums over the bonds of the plate collapse to sums over its columns; the reduction is exact,
also for zones with the spacings 1 : 2. Every ordered pair of an owner p and a member q with |x_q - x_p| <= delta_p
has the weight w_pq = kappa_p v(delta_p, spacing_q) / (2 |xi|): w_pq V_q (T_q - T_p) flows to p and w_pq V_p (T_p -
T_q) to q ([Wang2025] eqs. 6.19 to 6.24). v is the partial volume of the rule `half`; kappa_p is that of the continuum
over the conductivity of the lattice of the owner's zone. Layers behind the ends are mirrored, odd about a prescribed
temperature.

Prints the largest deviation (K) from the line between 0 on the left and 10 K on the right of a plate of 10 mm. The
cases hold it over 9.95 K, the largest temperature of a point. Needs NumPy."""

import numpy as np
from numpy.typing import NDArray
from pd_lattice_constants import conductivity as conductivity_of_lattice

Array = NDArray[np.float64]

LENGTH, CONDUCTIVITY, DIFFERENCE = 0.01, 233.0, 10.0  # m, W/(m K), K
SPACING = 1e-4  # m, of the left half
# case: spacings of both halves, and their horizons, in spacings of the left half
CASES = {
    "wang-6.4.1.1": ((1, 1), lambda n: (n, n)),
    "wang-6.4.1.2": ((1, 1), lambda n: (2 * n, n)),
    "wang-6.4.1.3": ((1, 2), lambda n: (2 * n, 2 * n)),
    "wang-6.4.1.4": ((1, 2), lambda n: (n, 2 * n)),
}


def partial_volume(distance: Array, horizon: float, spacing: float, rule: str = "half") -> Array:
    """Part of the volume of members that counts; 0 beyond the horizon."""
    limit = horizon + spacing / 2 if rule == "full" else horizon * (1 + 1e-9)
    part = np.ones_like(distance) if rule == "none" else (horizon + spacing / 2 - distance) / spacing
    return np.where(distance <= limit, np.clip(part, 0.0, 1.0), 0.0)


class Strip:
    """Columns of a plate of two halves, and the heat that flows to them: matrix T + left T_l + right T_r, W/m3."""

    def __init__(
        self,
        length: float,
        spacings: tuple[float, float],
        horizons: tuple[float, float],
        conductivity: float,
        rule: str = "half",
        is_calibrated: bool = True,
        ends: tuple[str, str] = ("prescribed", "prescribed"),
    ) -> None:
        number = [round(length / 2 / s) for s in spacings]
        self.spacing = np.repeat(spacings, number)
        self.x = np.concatenate(
            [-length / 2 + (np.arange(number[0]) + 0.5) * spacings[0], (np.arange(number[1]) + 0.5) * spacings[1]]
        )
        horizon = np.repeat(horizons, number)
        ratio = [conductivity_of_lattice(h / s, 2, rule) if is_calibrated else 1.0 for h, s in zip(horizons, spacings)]
        micro = 6 * conductivity / (np.pi * horizon**3) / np.repeat(ratio, number)
        reach = max(horizons) + max(spacings)
        columns = len(self.x)
        self.matrix = np.zeros((columns, columns))
        self.left, self.right = np.zeros(columns), np.zeros(columns)
        # columns of the body, and their images behind both ends
        others = [(x, source, 0) for source, x in enumerate(self.x)]
        others += [(-length - x, source, -1) for source, x in enumerate(self.x) if x + length / 2 < reach]
        others += [(length - x, source, 1) for source, x in enumerate(self.x) if length / 2 - x < reach]
        for own in range(columns):
            for x, source, side in others:
                if abs(x - self.x[own]) > reach:
                    continue
                spacing = self.spacing[source]
                rows = int(np.ceil((reach + self.spacing[own] / 2) / spacing)) + 1
                dy = (np.arange(-rows, rows + 1) + 0.5) * spacing - self.spacing[own] / 2
                distance = np.hypot(x - self.x[own], dy)
                distance = distance[distance > 1e-12 * length]
                of_own = micro[own] * partial_volume(distance, horizon[own], spacing, rule)
                of_other = micro[source] * partial_volume(distance, horizon[source], self.spacing[own], rule)
                heat = float(np.sum((of_own + of_other) / (2 * distance))) * spacing**2
                self.matrix[own, own] -= heat
                if side == 0 or ends[(side + 1) // 2] == "insulated":
                    self.matrix[own, source] += heat
                    continue
                # odd about the temperature of the end
                self.matrix[own, source] -= heat
                (self.left if side < 0 else self.right)[own] += 2 * heat


def deviation(case: str, n: int) -> float:
    """Largest deviation from the line, K."""
    spacings, horizons_of = CASES[case]
    spacing = (spacings[0] * SPACING, spacings[1] * SPACING)
    first, second = horizons_of(n)
    strip = Strip(LENGTH, spacing, (first * SPACING, second * SPACING), CONDUCTIVITY)
    temperature = np.linalg.solve(strip.matrix, -strip.right * DIFFERENCE)
    line = DIFFERENCE * (strip.x / LENGTH + 0.5)
    return float(np.abs(temperature - line).max())


def values() -> dict[str, float]:
    """Largest deviations of all cases, K."""
    return {f"{case}-n{n}: deviation from the line, K": deviation(case, n) for case in CASES for n in range(1, 6)}


if __name__ == "__main__":
    for name, value in values().items():
        print(f"{name} {value:.6f}")
