"""Random complex systems and matrices, and the response of one from its definition."""

import numpy as np

from beamchain.robust.multipliers import ComplexSystem


def gaussian(random, *shape):
    return random.normal(size=shape) + 1j * random.normal(size=shape)


SIZE = 0.2


def complex_system(states, signals, seed):
    random = np.random.default_rng(seed)
    a = 0.4 * gaussian(random, states, states) - np.eye(states)
    shapes = (states, signals), (signals, states), (signals, signals)
    return ComplexSystem(a, *(SIZE * gaussian(random, *shape) for shape in shapes))


def hermitian(seed, size, scale=1.0):
    half = gaussian(np.random.default_rng(seed), size, size)
    return scale * (half + half.conj().T) / 2.0


def value(system, omega):
    a, b, c, d = system
    return c @ np.linalg.solve(1j * omega * np.eye(len(a)) - a, b) + d


def gains_of(n, deltas):
    """|e / d| with `w = delta z` of every channel."""
    delta = np.diag(deltas)
    size = len(deltas)
    inner = np.linalg.solve(np.eye(size) - n[:size, :size] @ delta, n[:size, size])
    return abs(n[size, size] + n[size, :size] @ delta @ inner)
