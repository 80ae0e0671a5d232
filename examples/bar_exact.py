"""Exact solution of the impacted bar: d'Alembert's formula with mirror images."""

import numpy as np

YOUNG, DENSITY, LENGTH, SPEED = 200e9, 7833.0, 0.1333, 5.0
WAVE_SPEED = np.sqrt(YOUNG / DENSITY)


def bar_exact(x: np.ndarray, t: float) -> tuple[np.ndarray, np.ndarray]:
    """Displacement [m] and velocity [m/s] at positions x [m] in [0, LENGTH] and time t [s].

    Left end fixed, right end free, right quarter at SPEED at t = 0. The initial velocity is continued oddly about 0,
    evenly about LENGTH, with period 4 LENGTH; half of it runs either way. At a jump the velocity is the mean.
    """
    start, stop = 0.75 * LENGTH, 1.25 * LENGTH

    def wrapped(s):
        return (s + 2.0 * LENGTH) % (4.0 * LENGTH) - 2.0 * LENGTH

    def velocity(s):
        s = wrapped(s)
        return SPEED * np.sign(s) * 0.5 * (np.sign(np.abs(s) - start) - np.sign(np.abs(s) - stop))

    def integral(s):
        return SPEED * (np.clip(np.abs(wrapped(s)), start, stop) - start)

    right, left = np.asarray(x) - WAVE_SPEED * t, np.asarray(x) + WAVE_SPEED * t
    return (integral(left) - integral(right)) / (2.0 * WAVE_SPEED), 0.5 * (velocity(right) + velocity(left))
