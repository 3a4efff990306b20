"""The error of a whole spacecraft at its own step:
the file as MuJoCo steps it against exact appendages, pose by pose."""

from collections.abc import Mapping, Sequence

from beamchain.craft.error import Pose, counterpart
from beamchain.craft.liquid import with_liquids_sprung
from beamchain.engine.library import mujoco
from beamchain.engine.mount import motion
from beamchain.engine.operating_point import Positions, poses, quiet_copy, rest_point
from beamchain.ports.motions import Array
from beamchain.steps.sampled import SampledError, sampled_error
from beamchain.steps.step_map import motion_at


def craft_sampled_error(
    craft: "mujoco.MjModel",
    model: "mujoco.MjModel",
    exact: Mapping[str, Sequence[Pose]],
    positions: Positions = poses,
) -> dict[str, SampledError]:
    """The error of the compiled `model` at its own step, worst base body of each pose.

    `exact`: the answers that `craft_poses` gives of the bare `craft` in the same `positions`.
    """
    still = quiet_copy(model)
    places = positions(model)
    return {
        name: max(
            (pose_sampled_error(craft, still, places[name], pose) for pose in several),
            key=lambda e: e.error,
        )
        for name, several in exact.items()
    }


def pose_sampled_error(
    craft: "mujoco.MjModel", model: "mujoco.MjModel", qpos: Array, pose: Pose
) -> SampledError:
    """The error of the quiet compiled `model` at `qpos`,
    which is the `pose` of the bare `craft`."""
    model = with_liquids_sprung(model, pose.carried)
    body = counterpart(craft, model, pose.body)
    data = rest_point(model, qpos).data()
    rows = motion(model, data, body, data.xpos[body], data.xmat[body].reshape(3, 3))
    return sampled_error(
        pose.at_samples,
        motion_at(model, qpos),
        rows[list(pose.motions)],
        scale=pose.scale,
        frozen=pose.frozen,
    )
