"""Temperature of a metal film heated by a femtosecond pulse, for the cases `dhpd-4.4-*`.

    python3 femtosecond_film.py

A film of 20 nm with insulated faces, of one temperature, starts at 0; the source ([Wang2021] section 4.4) is

    s = 0.94 J (1 - R) / (t_p l) exp(-x / l) exp(-a |t - 2 t_p| / t_p),    t >= 0.

Cosine series T = sum of T_n(t) cos(n pi x / L) over n < 400, with b_n = k / C (n pi / L)^2 and the convolution of
each mode with the pulse in closed form:

    T_n(t) = A_n / C integral of exp(-b_n (t - u)) exp(-a |u - 2 t_p| / t_p) du from 0 to t,
    A_n = 0.94 J (1 - R) / (t_p l) c_n / L l (1 - (-1)^n exp(-L / l)) / (1 + (n pi l / L)^2),    c_0 = 1, else 2.

Prints temperatures (K above the start) at x = 0, L/2 and L, the highest one, and the energy that the film absorbs in
1 ps. Needs NumPy."""

import numpy as np

LENGTH, CAPACITY, CONDUCTIVITY = 20e-9, 2.5e6, 315.0  # m, J/(m3 K), W/(m K)
FLUENCE, REFLECTIVITY, DEPTH, DURATION = 13.4, 0.93, 15.3e-9, 100e-15  # J/m2, -, m, s
HEIGHT, STEEPNESS = 0.94, 1.992
PEAK, DECAY = 2 * DURATION, STEEPNESS / DURATION  # s, 1/s
DENSITY = HEIGHT * FLUENCE * (1 - REFLECTIVITY) / (DURATION * DEPTH)  # W/m3 at x = 0 at the peak
TIMES = (50, 100, 150, 200, 250, 300, 350, 400, 500, 700, 1000)  # fs


def convolution(rate: float, time: float) -> float:
    """Integral of exp(-rate (time - u)) times the pulse from 0 to the time, s."""

    def part(sign: float, start: float, end: float) -> float:
        both = rate + sign * DECAY
        low = np.exp(-rate * (time - start) + sign * DECAY * (start - PEAK))
        high = np.exp(-rate * (time - end) + sign * DECAY * (end - PEAK))
        return (high - low) / both if abs(both) > 1e-6 * DECAY else (end - start) * low

    if time <= PEAK:
        return part(1.0, 0.0, time)
    return part(1.0, 0.0, PEAK) + part(-1.0, PEAK, time)


def temperature(x: float, time: float, terms: int = 400) -> float:
    """K above the start."""
    total = 0.0
    for n in range(terms):
        wave = n * np.pi / LENGTH
        mode = DEPTH * (1 - (-1) ** n * np.exp(-LENGTH / DEPTH)) / (1 + (wave * DEPTH) ** 2) / LENGTH * (2 if n else 1)
        rate = CONDUCTIVITY / CAPACITY * wave**2
        total += DENSITY * mode / CAPACITY * convolution(rate, time) * np.cos(wave * x)
    return float(total)


def values() -> dict[str, float]:
    """Temperatures, K above the start, and the energy that the film of the cases absorbs, 0.8 nm x 1 m of it, J."""
    found = {}
    for time in TIMES:
        for name, x in (("x = 0", 0.0), ("x = L/2", LENGTH / 2), ("x = L", LENGTH)):
            found[f"{name} at {time} fs, K"] = temperature(x, time * 1e-15)
    found["highest temperature, K"] = max(temperature(0.0, fs * 1e-15) for fs in range(310, 337))
    # of all times from 0 on, of which 1 ps holds all but exp(-16)
    fluence = DENSITY * DEPTH * (1 - np.exp(-LENGTH / DEPTH)) * (2 - np.exp(-DECAY * PEAK)) / DECAY
    found["absorbed fluence, J/m2"] = float(fluence)
    found["energy absorbed on 0.8 nm x 1 m, J"] = float(fluence) * 0.8e-9
    return found


if __name__ == "__main__":
    for name, value in values().items():
        print(f"{name} {value:.7g}")
