"""The modes of an embedded appendage as parameters of MuJoCo's own system identification,
`mujoco.sysid`."""

from typing import TYPE_CHECKING, Any

import numpy as np

from beamchain import Embedded
from beamchain.checks import positive
from beamchain.errors import InputError
from beamchain.toolkit import FILLER, foreign, modal_tendons, timing_marks

if TYPE_CHECKING:
    from mujoco.sysid import Parameter, ParameterDict

    from beamchain.toolkit import mujoco


def to_sysid(embedded: Embedded, frequency: float = 0.3, damping: float = 0.9) -> "ParameterDict":
    """Frequencies and damping ratios of the kept modes as parameters of `mujoco.sysid`.

    Each has its nominal value, its bounds, and a `modifier` that writes it into the craft's MjSpec:
    of a mode's tendon the stiffness `w^2` and the damping `2 zeta w`. Needs
    `pip install 'beamchain[sysid]'`.

    Args:
        embedded: a craft whose modes have tendons (the damping form "modal" gives them) and are not
            made exact in time.
        frequency: how far a frequency may come from its nominal value, relative.
        damping: how far a damping ratio may.

    Returns:
        Parameters `PREFIXmode1_xy.frequency` [rad/s] and `PREFIXmode1_xy.damping`, for
            `mujoco.sysid.optimize`; further ones, of the bus or of actuators, can be added.

    Raises:
        InputError: the craft has no modal tendons, or they are exact for one step; or
            `mujoco.sysid` is not installed.

    Example:
        >>> import beamchain as bc
        >>> from beamchain import identification
        >>> craft = '''<mujoco><worldbody><body name="bus"><freejoint/>
        ... <inertial pos="0 0 0" mass="300" diaginertia="90 90 90"/>
        ... <site name="mount" pos="0.5 0 0"/></body></worldbody></mujoco>'''
        >>> section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
        >>> spec = bc.Spec(
        ...     segment=(bc.Segment(length=8.0, section=section),),
        ...     modes=bc.Modes(xy=1),
        ...     damping=bc.Damping(ratio=0.005),
        ... )
        >>> identification.to_sysid(bc.embed(craft, {"mount": spec})).keys()
        ['appendage_mode1_xy.frequency', 'appendage_mode1_xy.damping']
    """
    try:
        from mujoco.sysid import Parameter, ParameterDict
    except ImportError as error:
        raise InputError(
            f"mujoco.sysid is not installed ({error}); install it with: pip install "
            "'beamchain[sysid]'."
        ) from None
    model = embedded.model
    modal = modal_tendons(model)
    if not modal.names:
        raise foreign("to_sysid")
    if any(timing_marks(model)):
        raise InputError(
            "the craft's modes are exact in time for their own frequencies alone; embed without "
            "retime, at a step that resolves them."
        )
    reach = {
        "frequency": positive("frequency", frequency, "of the nominal value"),
        "damping": positive("damping", damping, "of the nominal value"),
    }
    out = ParameterDict()
    for name, w, rate in zip(modal.names, modal.frequency, modal.damping, strict=True):
        if FILLER.search(name):
            continue
        for kind, value in (("frequency", float(w)), ("damping", float(rate / (2.0 * w)))):
            far = reach[kind] * value
            low, high = value - far, value + far
            out.add(Parameter(f"{name}.{kind}", value, low, high, modifier=_write))
    return out


def _write(spec: "mujoco.MjSpec", parameter: "Parameter") -> None:
    """Write a frequency or a damping ratio into the tendon of its mode, the other as it was."""
    name, _, kind = parameter.name.rpartition(".")
    tendon: Any = spec.tendon(name)
    value = float(parameter.value[0])
    w = np.sqrt(tendon.stiffness[0])
    ratio = tendon.damping[0] / (2.0 * w)
    w, ratio = (value, ratio) if kind == "frequency" else (w, value)
    tendon.stiffness[0] = w**2
    tendon.damping[0] = 2.0 * ratio * w
