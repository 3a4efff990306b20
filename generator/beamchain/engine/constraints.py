"""What a model holds by constraints, in words: contacts, limits, dry friction, equalities.

None of them has a linear part: contacts and limits push on one side only, dry friction sticks, and
MuJoCo's equalities are soft. Linear models are made without them.
"""

import copy
from collections.abc import Sequence

import numpy as np

from beamchain.engine.library import mujoco

NAMED = 3  # in one sentence; of the others their number is said
ROUNDING = 1e-12  # m or rad: how far beyond a limit a pose may be by rounding
KINDS = {
    int(kind): name.removeprefix("mjEQ_").lower() for name, kind in mujoco.mjtEq.__members__.items()
}


def without_constraints(model: "mujoco.MjModel") -> "mujoco.MjModel":
    """A copy without contacts, limits, dry friction and equalities."""
    out = copy.copy(model)
    flags = mujoco.mjtDisableBit
    out.opt.disableflags |= int(flags.mjDSBL_CONTACT) | int(flags.mjDSBL_CONSTRAINT)
    return out


def touching(model: "mujoco.MjModel", data: "mujoco.MjData") -> list[tuple[str, str]]:
    """Shapes that touch in a state that `mj_forward` has seen, by name, else by their body's."""
    return [
        (_shape(model, int(contact.geom[0])), _shape(model, int(contact.geom[1])))
        for contact in (data.contact[i] for i in range(data.ncon))
        if contact.dist <= 0.0
    ]


def beyond_limits(model: "mujoco.MjModel", data: "mujoco.MjData") -> list[str]:
    """Joints and tendons outside their range in a state that `mj_forward` has seen."""
    kinds = {
        int(mujoco.mjtConstraint.mjCNSTR_LIMIT_JOINT): ("joint", model.joint),
        int(mujoco.mjtConstraint.mjCNSTR_LIMIT_TENDON): ("tendon", model.tendon),
    }
    out: list[str] = []
    for row in range(data.nefc):
        known = kinds.get(int(data.efc_type[row]))
        if known is None or float(data.efc_pos[row]) >= -ROUNDING:
            continue
        word, element = known
        number = int(data.efc_id[row])
        out.append(_named(word, element(number).name, number))
    return list(dict.fromkeys(out))


def with_dry_friction(model: "mujoco.MjModel") -> list[str]:
    """Joints and tendons with `frictionloss`."""
    if _is_disabled(model, "FRICTIONLOSS"):
        return []
    joints = dict.fromkeys(model.dof_jntid[np.asarray(model.dof_frictionloss) > 0.0].tolist())
    tendons = np.flatnonzero(np.asarray(model.tendon_frictionloss) > 0.0).tolist()
    return [
        *(_named("joint", model.joint(j).name, j) for j in joints),
        *(_named("tendon", model.tendon(t).name, t) for t in tendons),
    ]


def equalities(model: "mujoco.MjModel") -> list[str]:
    """Equality constraints by kind and name; those that are not active at the start say so."""
    if _is_disabled(model, "EQUALITY"):
        return []
    out: list[str] = []
    for i in range(model.neq):
        inactive = "" if bool(model.eq_active0[i]) else ", inactive at the start"
        out.append(_equality(model, i) + inactive)
    return out


def _equality(model: "mujoco.MjModel", number: int) -> str:
    """An equality constraint by its name, else by those of what it ties."""
    kind, name = KINDS[int(model.eq_type[number])], str(model.equality(number).name)
    of_sites = int(model.eq_objtype[number]) == int(mujoco.mjtObj.mjOBJ_SITE)
    between = model.site if of_sites else model.body
    known = {"joint": model.joint, "tendon": model.tendon, "connect": between, "weld": between}
    if name or kind not in known:
        return _named(kind, name, number)
    tied = [int(ids[number]) for ids in (model.eq_obj1id, model.eq_obj2id)]
    named = [str(known[kind](i).name) for i in tied if i >= 0]
    words = " and ".join(repr(one) for one in named if one)
    return f"{kind} of {words}" if words else _named(kind, name, number)


def listed(words: Sequence[str]) -> str:
    """The first few, and how many more there are."""
    between = "; " if any("," in word for word in words) else ", "
    few = between.join(words[:NAMED])
    more = len(words) - NAMED
    return f"{few} and {more} more" if more > 0 else few


def _is_disabled(model: "mujoco.MjModel", name: str) -> bool:
    flags = mujoco.mjtDisableBit
    wanted = int(getattr(flags, f"mjDSBL_{name}")) | int(flags.mjDSBL_CONSTRAINT)
    return bool(int(model.opt.disableflags) & wanted)


def _named(word: str, name: str, number: int) -> str:
    return f"{word} {name!r}" if name else f"{word} {number}"


def _shape(model: "mujoco.MjModel", geom: int) -> str:
    if geom < 0:
        return "a flex"
    body = model.body(int(model.geom_bodyid[geom])).name
    return model.geom(geom).name or body or f"shape {geom}"
