"""`identify`: from logs of a spacecraft's motion to the modes of its appendage,
with what the logs do not determine."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from beamchain.checks import list_of_names, number, of_type, one_of, whole_number
from beamchain.errors import InputError
from beamchain.files import noted_inputs
from beamchain.identification.channels import spectral_channels, time_channels
from beamchain.identification.hub import bare
from beamchain.identification.initial_model import MOST_MODES
from beamchain.identification.logs import read_logs
from beamchain.identification.prior import read_prior
from beamchain.identification.result import Identification
from beamchain.identification.run import Run
from beamchain.toolkit import one_thread
from beamchain.warning_codes import Caution

if TYPE_CHECKING:
    from beamchain.toolkit import mujoco


@one_thread()
def identify(
    logs: Any,
    craft: "str | Path | mujoco.MjSpec | mujoco.MjModel",
    mount: str,
    *,
    prior: Any = None,
    modes: int | None = None,
    axes: str | Sequence[str] | None = None,
    map: Mapping[str, str] | None = None,
    held_out: float = 0.2,
) -> Identification:
    """Modes of an appendage from logs of the spacecraft that carries it, with their covariance.

    Small motions in free flight: the hub's mass properties are those of `craft`, torques are held
    from sample to sample, all later than the log says by one delay, which is estimated. A first
    model is built mode by mode, then the likelihood of the exact sampled coupled model is maximised
    in frequency, damping, participation and delay; residual masses are positive at every step. A
    log of rotation determines moments of participation about the axes that were driven; the other
    rows, and the part of the frequency that depends on them (the craft translates freely), come
    from the prior, with a relative standard deviation of 0.3 where it states none in [uncertain].
    Without a prior they are zero and listed: frequencies are then those with the hub's rotation
    held and its translation free, and no mass is known, so that the result has no `data()`.

    Args:
        logs: a path (.csv, .npz), a mapping of arrays, or a list of those. Time logs: `time` [s],
            `torque_x|y|z` [N m] on the hub in its axes or an actuator's name, `rate_*` [rad/s],
            `attitude_*` [rad] (small), or `mean_rate_*` [rad/s], the mean since the sample before,
            as a rate-integrating gyro gives it (its increment of angle over the step). Frequency
            responses: `frequency` [Hz] or `omega` [rad/s], and `rate_z/torque_z re`, `... im`.
        craft: the bare rigid spacecraft: path or text of MJCF, MjSpec or MjModel.
        mount: its site or body that carries the appendage, whose x axis points outwards.
        prior: SPEC.toml, Spec, beam or modes.
        modes: how many; None: as the Bayesian information criterion says.
        axes: letters of the hub's axes that are used; all that were driven where left out.
        map: column names of the log, and what they mean.
        held_out: the last part of the samples of each log, predicted from the rest, then used.

    Returns:
        An `Identification`: `modes`, `covariance`, `delay`, `undetermined`, `warnings`,
            `data()`, `write(path)`.

    Raises:
        InputError: a log cannot be read, contradicts itself or the craft,
            or nothing in it excites the craft.

    Example:
        >>> import beamchain as bc
        >>> from beamchain import identification
        >>> import numpy as np
        >>> craft = '''<mujoco><worldbody><body name="bus"><freejoint/>
        ... <inertial pos="0 0 0" mass="300" diaginertia="90 90 90"/>
        ... <site name="mount" pos="0.5 0 0"/></body></worldbody></mujoco>'''
        >>> omega = np.linspace(0.2, 8.0, 300)
        >>> s = 1j * omega
        >>> inertia = 130.0 - 36.0 * s**2 / (s**2 + 0.02 * s + 4.0)  # 36 kg m^2 swing at 2 rad/s
        >>> log = {"omega": omega, "rate_z/torque_z": 1.0 / (s * inertia)}
        >>> found = identification.identify(log, craft, "mount")
        >>> len(found.modes)
        1
    """
    if map is not None:
        of_type("map", map, Mapping, 'names by column of the log: {"gyro z": "rate_z"}')
    of_type(
        "mount", mount, str, "the name of the spacecraft's site or body that carries the appendage"
    )
    with noted_inputs() as inputs:
        result = _identify(logs, craft, mount, prior, modes, axes, map, held_out)
    return replace(result, inputs=tuple(inputs))


def _identify(
    logs: Any,
    craft: "str | Path | mujoco.MjSpec | mujoco.MjModel",
    mount: str,
    prior: Any,
    modes: int | None,
    axes: str | Sequence[str] | None,
    map: Mapping[str, str] | None,
    held_out: float,
) -> Identification:
    """Do the work of `identify`."""
    known = bare(craft, mount)
    held = number(
        "held_out", held_out, "", cure="Give the part of the log that is predicted, 0 to 0.5."
    )
    if not 0.0 <= held <= 0.5:
        raise InputError(
            f"held_out = {held_out!r} must lie between 0 and 0.5; 0.2 predicts the last fifth of "
            "each log."
        )
    if modes is not None:
        whole_number("modes", modes, 1, MOST_MODES - 1)
    times, spectra = read_logs(logs, map, list(known.actuators))
    before = None if prior is None else read_prior(prior, known.mass)
    if bool(times) == bool(spectra):
        raise InputError(
            "time logs and frequency responses cannot be used together; give one kind."
        )
    wanted = _axes(axes)
    data = (
        time_channels(times, known, wanted, before)
        if times
        else spectral_channels(spectra, known, wanted, before)
    )
    return _with_refusal(Run(data, known, before, modes, held).result(mount))


def _with_refusal(found: Identification) -> Identification:
    """The result with a warning where `[imported]` refuses its modes."""
    if not found.massive:  # the record says already that it needs a mass
        return found
    try:
        found.data()
    except InputError as error:
        text = (
            f"the modes found cannot be made into an appendage, and [imported] refuses their file: "
            f"{error} Look first at the torques' axes (those of the hub's body), at other "
            "appendages that the craft carries, and at the prior's mass."
        )
        return replace(found, warnings=(*found.warnings, Caution("modes-refused", text)))
    return found


def _axes(axes: str | Sequence[str] | None) -> tuple[str, ...]:
    letters = tuple(
        "xyz" if axes is None else axes if isinstance(axes, str) else list_of_names("axes", axes)
    )
    for letter in letters:
        one_of("axes", letter, "xyz")
    if not letters:
        raise InputError("axes is empty; name at least one of x, y, z.")
    return letters
