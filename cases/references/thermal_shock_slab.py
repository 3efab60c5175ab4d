"""Temperature of a slab with a thermal shock at one side: reference of `wang-6.4.2-*` and `dhpd-4.5-*`.

Slab of the thickness L, diffusivity a, zero at first, s the distance from the left side, at which the temperature is
f(t) = 5 t exp(-2 t); the right side is insulated. By Duhamel's theorem

    T(s, t) = integral of f'(u) G(s, t - u) du from 0 to t,
    G(s, u) = sum over m >= 0 of (-1)^m [erfc((2 m L + s) / (2 sqrt(a u))) + erfc((2 (m + 1) L - s) / (2 sqrt(a u)))],

or by eigenfunctions, with l_n = (2 n + 1) pi / (2 L), b = a l_n^2 and g = b - 2,

    T = sum of 2 a l_n / L sin(l_n s) 5 [exp(-2 t)(g t - 1) + exp(-b t)] / g^2.

Dual-horizon diffusion, Wang et al. (2021), section 4.5: a square plate of the width W is at first T0 for y < 0 and 0
for y > 0. With insulated edges (variant A) the temperature is

    Y(y, t) = T0 [1/2 - sum over odd k of 2 / (k pi) sin(k pi y / W) exp(-a (k pi / W)^2 t)],

and with the shock at its left edge (variant B) T(s, t) + (1 - G(s, t)) Y(y, t).

    python3 thermal_shock_slab.py

Prints temperatures (K) at coordinates x = s - L/2 (m), by Duhamel's theorem and by eigenfunctions.
"""

import numpy as np
from scipy.integrate import quad
from scipy.special import erfc

LENGTH = WIDTH = 10.0  # m
DIFFUSIVITY = 1.0  # m2/s
JUMP = 0.5  # K


def shock_rate(t: float) -> float:
    """f'(t)."""
    return 5 * (1 - 2 * t) * np.exp(-2 * t)


def step_response(s: float, t: float) -> float:
    """G: a unit temperature of the left side from t = 0 on."""
    if t <= 0:
        return 0.0
    reach = 2 * np.sqrt(DIFFUSIVITY * t)
    images = (
        (-1) ** m * (erfc((2 * m * LENGTH + s) / reach) + erfc((2 * (m + 1) * LENGTH - s) / reach)) for m in range(6)
    )
    return float(sum(images))


def shock(s: float, t: float) -> float:
    """Temperature by Duhamel's theorem."""
    if s == 0:
        return 5 * t * np.exp(-2 * t)
    return quad(lambda u: shock_rate(u) * step_response(s, t - u), 0, t, epsabs=1e-13, epsrel=1e-12, limit=400)[0]


def shock_series(s: float, t: float, terms: int = 20000) -> float:
    """Temperature by eigenfunctions."""
    wave_number = (2 * np.arange(terms) + 1) * np.pi / (2 * LENGTH)
    rate = DIFFUSIVITY * wave_number**2
    g = rate - 2
    integral = 5 * (np.exp(-2 * t) * (g * t - 1) + np.exp(-rate * t)) / g**2
    return float(np.sum(2 * DIFFUSIVITY * wave_number / LENGTH * np.sin(wave_number * s) * integral))


def jump(y: float, t: float, terms: int = 400) -> float:
    """Y: the plate that is at first warm in its lower half."""
    k = 2 * np.arange(terms) + 1
    decay = np.exp(-DIFFUSIVITY * (k * np.pi / WIDTH) ** 2 * t)
    return float(JUMP * (0.5 - np.sum(2 / (k * np.pi) * np.sin(k * np.pi * y / WIDTH) * decay)))


def values() -> dict[str, float]:
    """All temperatures by name."""
    found = {}
    for x in np.arange(-5, 5.01, 0.5):
        for t in (3.0, 6.0):
            found[f"shock at x = {x:g}, t = {t:g} s"] = shock(x + 5, t)
            found[f"shock at x = {x:g}, t = {t:g} s, eigenfunctions"] = shock_series(x + 5, t)
    for t in (3.0, 6.0):
        s = np.linspace(0, 5, 2001)
        temperature = [shock_series(place, t, 3000) for place in s]
        highest = int(np.argmax(temperature))
        found[f"highest at t = {t:g} s"] = temperature[highest]
        found[f"x of the highest at t = {t:g} s, m"] = float(s[highest] - 5)
    for y in (-5, -2.5, -1, -0.5, 0, 0.5, 1, 2.5, 5):
        found[f"variant A at y = {y:g}, t = 3 s"] = jump(y, 3.0)
    for x in np.arange(-5, 5.01, 1.0):
        for y in (-5, -2.5, 2.5, 5):
            left = 1 - step_response(x + 5, 3.0)
            found[f"variant B at ({x:g}, {y:g}), t = 3 s"] = shock(x + 5, 3.0) + left * jump(y, 3.0)
    return found


if __name__ == "__main__":
    for name, value in values().items():
        print(f"{name}: {value:.8f}")
