"""Pre-warping: the chain whose *discrete* frequencies, at one step of one integrator, are the beam's.

A step of h turns a frequency w' into another, w. So the chain is made for the w' that the step turns into the wanted w:
for the modes of the beam on its hub, with port values scaled by w'/w, which keeps the static response p^2/w^2. Then the
hub is taken off and the chain is realised as always. THEORY of the semi-implicit step: w' = (2/h) sin(w h/2).

Without a hub the root counts as held (an infinite hub): the cantilever modes are warped, participation scaled by w'/w.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from beamchain.chain.chain import Chain
from beamchain.chain.damping import Damper
from beamchain.errors import InputError, RealisationError
from beamchain.motion import Array, square_root
from beamchain.port import PortModel

SEMI_IMPLICIT = ("Euler", "implicit", "implicitfast")
RUNGE_KUTTA_REACH = 2.0  # w' h up to which the classical Runge-Kutta step is aimed; it is stable up to 2.828


@dataclass(frozen=True, eq=False)
class Prewarp:
    """What one port of the chain is aimed at.

    Args:
        integrator, timestep: for which it holds [s].
        hub_mass: `(m, m)` hub in this port; None: held root.
        wanted: `(n,)` frequencies the simulation shall show, undamped [rad/s] ("discrete": modulus of the damped pole).
        aimed: `(n,)` frequencies of the continuous chain [rad/s].
        rates: `(n,)` damping of the chain's modes on the hub [1/s]; "discrete" only, else empty.
        target: what the chain is realised for.
        ratios: `(n,)` damping ratios of the cantilever modes that "discrete" shows; else empty.
    """

    integrator: str
    timestep: float
    hub_mass: Array | None
    wanted: Array
    aimed: Array
    rates: Array
    target: PortModel
    ratios: Array

    def shown(self, achieved: PortModel) -> PortModel:
        """What a simulation at that step shows of the chain: its port model with the warp undone."""
        n = min(achieved.modes, self.wanted.size)
        back = self.wanted[:n] / self.aimed[:n]
        ratios = self.ratios if self.ratios.size else achieved.damping
        if self.hub_mass is None:
            return achieved.replaced(
                frequencies=achieved.frequencies[:n] * back,
                participation=achieved.participation[:n] * back[:, None],
                damping=ratios[:n],
                tip=None,
            )
        loaded = achieved.with_hub(self.hub_mass)
        w, p = loaded.free_frequencies[:n], loaded.free_port_values[:n]
        out = PortModel.from_free_modes(loaded.rigid_mass, w * back, p * back[:, None])
        return out.replaced(rigid_mass=achieved.rigid_mass, damping=ratios[: out.modes])


def prewarp(model: PortModel, count: int, hub_mass: Array | None, integrator: str, timestep: float) -> Prewarp:
    """Aim the first `count` modes of a beam on its hub.

    Args:
        model: all modes of the beam in one port, with its damping ratios.
        count: modes kept.
        hub_mass: `(m, m)` of the hub in this port; zeros: free; None: held root.
        integrator: MuJoCo's name.
        timestep: [s].

    Raises:
        InputError: the step is too long for a mode, or "discrete" damps a mode more than the structure does.
        RealisationError: no appendage responds so on this hub (a mass would be negative).
    """
    w, values = _loaded(model, count, hub_mass)
    rates = np.zeros(0)
    if integrator == "discrete":
        w_shown, aimed, rates = _aim_discrete(model, count, hub_mass, timestep)
    else:
        w_shown = w
        aimed = np.array([_aim(integrator, float(v), timestep) for v in w])
    scale = (aimed / w)[:, None]
    if hub_mass is None:
        order = np.argsort(aimed)
        tip = None if model.tip is None else model.tip[:count][order]
        target = PortModel(model.rigid_mass, aimed[order], (values * scale)[order], tip=tip)
    else:
        loaded = PortModel.from_free_modes(model.rigid_mass + hub_mass, aimed, values * scale)
        try:
            target = loaded.replaced(rigid_mass=model.rigid_mass)
        except InputError:
            raise RealisationError(
                f"fit.timestep = {timestep:g} s is too long for {count} modes (w h up to {w[-1] * timestep:.3g}): the "
                "appendage whose discrete response is the beam's would have a negative mass; take a smaller step "
                "or fewer modes."
            ) from None
    target = _with_damping(target, model, hub_mass, aimed, rates)
    kept = model.damping[:count] if rates.size else np.zeros(0)
    return Prewarp(integrator, timestep, hub_mass, w_shown, aimed, rates, target, kept)


def _loaded(model: PortModel, count: int, hub_mass: Array | None) -> tuple[Array, Array]:
    """Frequencies `(count,)` and port values `(count, m)` on the hub; held: participation instead."""
    if hub_mass is None:
        kept = model.truncated(count)
        return kept.frequencies, kept.participation
    loaded = model.with_hub(hub_mass)
    return loaded.free_frequencies[:count], loaded.free_port_values[:count]


def _aim(integrator: str, omega: float, timestep: float) -> float:
    """The continuous frequency [rad/s] that the step turns into `omega`."""
    angle = omega * timestep
    if integrator in SEMI_IMPLICIT:
        if angle >= np.pi:
            raise InputError(
                f"fit.timestep = {timestep:g} s cannot show a mode of {omega:.6g} rad/s: w h = {angle:.3g} must stay "
                f"below pi (a step below {np.pi / omega:.3g} s); take a smaller step or fewer modes."
            )
        return 2.0 / timestep * float(np.sin(angle / 2.0))

    def shown(x: float) -> float:
        s = 1j * x
        return float(np.angle(1.0 + s * (1.0 + s / 2.0 * (1.0 + s / 3.0 * (1.0 + s / 4.0)))))

    most = shown(RUNGE_KUTTA_REACH)
    if angle >= most:
        raise InputError(
            f"fit.timestep = {timestep:g} s is too long to aim RK4 at a mode of {omega:.6g} rad/s: w h = {angle:.3g} "
            f"must stay below {most:.3g} (a step below {most / omega:.3g} s); take a smaller step or fewer modes."
        )
    return float(brentq(lambda x: shown(x) - angle, 0.0, RUNGE_KUTTA_REACH, xtol=1e-16, rtol=1e-15)) / timestep


def coupled_poles(model: PortModel, hub_mass: Array | None) -> NDArray[np.complex128]:
    """`(n,)` complex poles (positive imaginary part, slowest first) of a damped port model on a hub [1/s].

    Its damping belongs to the cantilever modes and couples the modes on the hub:
    `C = diag(w) V^T diag(2 zeta / W) V diag(w)`, V the loaded modes in strain coordinates.
    """
    if hub_mass is None:
        w, c = model.frequencies, np.diag(2.0 * model.damping * model.frequencies)
    else:
        w, _, v, _ = model.with_hub(hub_mass)._free
        c = (v * w).T @ ((2.0 * model.damping / model.frequencies)[:, None] * (v * w))
    n = w.size
    step = np.block([[np.zeros((n, n)), np.eye(n)], [-np.diag(w**2), -c]])
    poles = np.linalg.eigvals(step).astype(np.complex128)
    poles = poles[poles.imag > 0.0]
    return poles[np.argsort(np.abs(poles))]


def _aim_discrete(model: PortModel, count: int, hub_mass: Array | None, timestep: float) -> tuple[Array, Array, Array]:
    """Shown frequency, aimed frequency and damping rate per mode.

    The step of "discrete" has poles z with `|z|^2 = 1 / (1 + h c + h^2 w'^2)` and `|1 - z|^2 = h^2 w'^2 |z|^2`, so that
    any damped pole with `c >= 0` can be met exactly: its own numerical damping takes the place of the structure's.
    """
    poles = coupled_poles(model, hub_mass)[:count]
    z = np.exp(poles * timestep)
    square = np.abs(1.0 - z) ** 2 / np.abs(z) ** 2
    rates = (1.0 / np.abs(z) ** 2 - 1.0 - square) / timestep
    for k, pole in enumerate(poles):
        w, zeta = abs(pole), -pole.real / abs(pole)
        if abs(pole.imag) * timestep >= np.pi:
            raise InputError(
                f"fit.timestep = {timestep:g} s cannot show mode {k + 1} of {w:.6g} rad/s: w h must stay below pi."
            )
        if rates[k] < 0.0:
            x = timestep * w
            least = float(np.log1p(square[k]) / 2.0 / x)
            raise InputError(
                f'integrator "discrete" at fit.timestep = {timestep:g} s damps mode {k + 1} ({w:.6g} rad/s on the hub) '
                f"by a ratio of {least:.3g} of its own, more than the structure's {zeta:.3g}, which cannot be "
                f"compensated; take a step below {2.0 * zeta / w:.3g} s, or implicitfast."
            )
    return np.abs(poles), np.sqrt(square) / timestep, rates


def _with_damping(target: PortModel, model: PortModel, hub_mass: Array | None, aimed: Array, rates: Array) -> PortModel:
    """The target with the ratios its cantilever modes get."""
    if rates.size == 0:
        return target.replaced(damping=model.damping[: target.modes])
    if hub_mass is None:
        return target.replaced(damping=(rates / aimed / 2.0)[np.argsort(aimed)])
    v = target.with_hub(hub_mass)._free[2]
    return target.replaced(damping=target.frequencies / 2.0 * ((v**2) @ (rates / aimed**2)))


def loaded_tendons(chain: Chain, port: str, plan: Prewarp) -> list[Damper]:
    """One damping tendon per mode of the chain *on its hub*, with the rates of the plan.

    In space the tendons of `chain.damping` belong to cantilever modes; these belong to the coupled modes, each of which
    then has a pole of its own, as "discrete" needs.

    Args:
        chain: realised for `plan.target`.
        port: which port.
        plan: with rates.
    """
    moving = [i for i, hinge in enumerate(chain.hinges, 1) if port in hinge.stiffness]
    pairs = [(i - 1, chain.hinges[i - 1]) for i in moving]
    rigid, elastic = chain._rows(port, pairs)
    if plan.hub_mass is not None:
        rigid = np.vstack([rigid, square_root(plan.hub_mass)])
        elastic = np.vstack([elastic, np.zeros((plan.hub_mass.shape[0], elastic.shape[1]))])
        q, _ = np.linalg.qr(rigid)
        elastic = elastic - q @ (q.T @ elastic)
    _, s, vt = np.linalg.svd(elastic, full_matrices=False)  # s = 1/w, so that the slowest mode comes first
    roots = np.array([np.sqrt(h.stiffness[port]) for _, h in pairs])
    order = np.argsort(plan.aimed)
    return [
        Damper(
            port, k + 1, tuple((h, float(v)) for h, v in zip(moving, s[k] * vt[k] * roots, strict=True)), float(rate)
        )
        for k, rate in enumerate(plan.rates[order])
        if rate > 0.0
    ]
