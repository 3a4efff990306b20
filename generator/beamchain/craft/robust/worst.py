"""The loop closed around an uncertain plant, its peaks, and a search for the worst sample.

`[z, e] = N [w, d]`, `w = Delta z`: a controller's loops closed around M, d added to one of its inputs, e one of its outputs.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize, minimize_scalar

from beamchain.craft.plants.controllers import Controller, place, places, realised
from beamchain.craft.plants.controllers import response as of_loop
from beamchain.craft.robust.systems import Complex, System, looped, picked, response, with_deltas
from beamchain.errors import InputError
from beamchain.ports.motions import Array

GROWS = 1e-9  # relative real part of a pole, below which it is rounding
STARTS = 4  # of the local search, from the worst samples
STILL = 1e-2  # of the lowest frequency looked at: a gain that is largest at rest is taken there
AROUND = np.sinh(np.linspace(-4.0, 4.0, 25))  # half widths of a resonance, at which it is looked at


class Peak(NamedTuple):
    """Largest gain of a closed loop [unit of e per unit of d] and where [rad/s]; infinite: unstable, at its pole."""

    gain: float
    omega: float


class Loops:
    """The closed loop N of M and a controller: exact in the frequency domain, its state space with dead times by Pade.

    `blocks` `(channels,)` is the number of the delta of each channel; `ends` are the input where d acts and the output e.
    """

    blocks: NDArray[np.intp]
    controller: Controller
    system: System
    poles: Complex

    def __init__(
        self, system: System, blocks: Sequence[int], inputs: list[str], outputs: list[str], controller: Controller,
        ends: tuple[str, str],
    ) -> None:  # fmt: skip
        self.blocks, n = np.asarray(blocks, dtype=np.intp), len(blocks)
        rows, columns = places(controller, inputs, outputs)
        d, e = place(ends[0], inputs, "input", ""), place(ends[1], outputs, "output", "")
        self.controller, self._m, self._rows = controller, system, [n + i for i in rows]
        self._columns, self._ends = [n + i for i in columns], ([*range(n), n + e], [*range(n), n + d])
        self.system = picked(looped(system, realised(controller), self._rows, self._columns), *self._ends)
        self.poles = np.linalg.eigvals(self.system[0]).astype(np.complex128)
        top = float(np.abs(self.poles).max(initial=1e-300))
        if float(self.poles.real.max(initial=-1.0)) > -GROWS * top:
            raise InputError(
                "the closed loop of the nominal plant is not stable, so that nothing can be worse; close loops that hold all "
                f"that {ends[1]!r} shows, stably (bc.plant's margins say how far they are from it)."
            )
        size = np.abs(self.poles)
        self._wide = np.geomspace(0.1 * size.min(), 2.0 * top, 300)

    def exact(self, omega: Array) -> Complex:
        """`(k, channels + 1, channels + 1)` N at frequencies `(k,)`, dead times exact."""
        s = (1j * omega).astype(np.complex128)
        m = response(self._m, s)
        k = np.array([of_loop(loop, s) for loop in self.controller.loop]).T[:, :, None]
        (outputs, inputs), rows, columns = self._ends, m[:, self._rows], self._columns
        through = np.eye(k.shape[1]) + rows[:, :, columns] * np.swapaxes(k, 1, 2)
        back = k * np.linalg.solve(through, rows[:, :, inputs])
        return m[:, outputs][:, :, inputs] - m[:, outputs][:, :, columns] @ back

    def gain(self, deltas: Array, omega: Array) -> Array:
        """`(k,)` gains of a sample `(blocks,)`, dead times exact."""
        return np.abs(self._sample(self.exact(omega), deltas)[0])

    def _sample(self, n: Complex, deltas: Array) -> tuple[Complex, Complex]:
        """`(k,)` response of a sample, and its slope by every channel's delta `(k, channels)`."""
        delta, eye = deltas[self.blocks], np.eye(self.blocks.size)
        right = np.linalg.solve(eye - n[:, :-1, :-1] * delta, n[:, :-1, -1:])[:, :, 0]
        left = np.linalg.solve(np.swapaxes(eye - delta[:, None] * n[:, :-1, :-1], 1, 2), n[:, -1, :-1, None])[:, :, 0]
        return n[:, -1, -1] + np.einsum("ki,i,ki->k", n[:, -1, :-1], delta, right), left * right

    def peak(self, deltas: Array) -> Peak:
        """The largest gain of a sample over all frequencies, resonances resolved."""
        a, b, c, d = with_deltas(self.system, deltas[self.blocks])
        poles, vectors = (np.asarray(part, dtype=np.complex128) for part in np.linalg.eig(a))
        first = int(np.argmax(poles.real))
        if poles[first].real > GROWS * np.abs(poles).max():
            return Peak(np.inf, float(np.abs(poles[first].imag)))
        weight = (c[-1] @ vectors) * np.linalg.solve(vectors, b[:, -1].astype(np.complex128))

        def size(omega: Array) -> Array:
            return np.abs((weight / (1j * omega[:, None] - poles)).sum(axis=1) + d[-1, -1])

        up = poles[poles.imag > 0.0]
        near, least = (up.imag[:, None] - up.real[:, None] * AROUND).ravel(), STILL * self._wide[0]
        omega = np.unique(np.concatenate([[least], self._wide, near[near > least]]))
        at = int(np.argmax(size(omega)))
        ends = float(omega[max(at - 1, 0)]), float(omega[min(at + 1, omega.size - 1)])
        best = minimize_scalar(
            lambda w: -float(size(np.array([w]))[0]), bounds=ends, method="bounded", options={"xatol": 1e-9 * ends[1]}
        )
        found = float(best.x)
        return Peak(float(self.gain(deltas, np.array([found]))[0]), found)

    def slope(self, deltas: Array, omega: float) -> Array:
        """`(blocks,)` slope of the logarithm of the gain at a frequency; at the peak it is that of the peak."""
        value, channels = self._sample(self.exact(np.array([omega])), deltas)
        each = (channels[0] / value[0]).real
        return np.asarray(np.bincount(self.blocks, each, minlength=deltas.size), dtype=np.float64)


def search(loops: Loops, samples: Array, seed: int = 0) -> tuple[Array, Peak, list[Peak]]:
    """The worst deltas found, their peak, and the peaks of the samples `(n, blocks)`.

    Tried are the samples, random corners, corners that slopes point to, and local ascent from the worst.
    """
    count = samples.shape[1]
    corners = np.random.default_rng(seed).choice([-1.0, 1.0], size=(min(2**count, 8 * STARTS), count))
    peaks = [loops.peak(row) for row in samples]
    others = np.vstack([corners, np.zeros(count)])
    tried = [*zip(samples, peaks, strict=True), *((row, loops.peak(row)) for row in others)]
    tried.sort(key=lambda one: -one[1].gain)

    def cost(deltas: Array) -> tuple[float, Array]:
        found = loops.peak(deltas)
        tried.append((deltas.copy(), found))
        if not np.isfinite(found.gain):
            raise StopIteration
        return -float(np.log(found.gain)), -loops.slope(deltas, found.omega)

    try:
        for start, peak in tried[:STARTS]:
            if not np.isfinite(peak.gain):
                break
            ascent = minimize(cost, start, jac=True, method="L-BFGS-B", bounds=[(-1.0, 1.0)] * count)
            cost(np.where(cost(np.asarray(ascent.x))[1] < 0.0, 1.0, -1.0))
    except StopIteration:
        pass  # unstable: nothing is worse
    deltas, worst = max(tried, key=lambda one: one[1].gain)
    if not np.isfinite(worst.gain):  # where on the way to them stability ends
        low, high = 0.0, 1.0
        while high - low > 1e-9:
            middle = (low + high) / 2.0
            here = loops.peak(middle * deltas)
            low, high, worst = (middle, high, worst) if np.isfinite(here.gain) else (low, middle, here)
    return deltas, worst, peaks
