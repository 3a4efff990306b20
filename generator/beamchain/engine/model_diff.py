"""Two compiled models compared element by element:
nothing of the spacecraft or of the appendage may have changed."""

from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from beamchain.engine.library import mujoco
from beamchain.ports.motions import Array

KINDS = {
    "body": "nbody",
    "jnt": "njnt",
    "dof": "nv",
    "geom": "ngeom",
    "site": "nsite",
    "cam": "ncam",
    "light": "nlight",
    "mesh": "nmesh",
    "mat": "nmat",
    "tex": "ntex",
    "skin": "nskin",
    "pair": "npair",
    "eq": "neq",
    "tendon": "ntendon",
    "actuator": "nu",
    "sensor": "nsensor",
}
NAMED = {
    "body": "body",
    "jnt": "joint",
    "geom": "geom",
    "site": "site",
    "mat": "material",
    "tex": "texture",
    "skin": "skin",
    "tendon": "tendon",
    "sensor": "sensor",
}
#: where a thing is stored, what is derived from the whole model, what a weld group shares
INDEXED = (
    "id",
    "adr",
    "num",
    "treeid",
    "sameframe",
    "simple",
    "Madr",
    "bvh",
    "limited_",
    "trnid",
    "obj",
    "ref",
    "dim",
    "sizes",
)
DERIVED = (
    "subtreemass",
    "poscom0",
    "invweight0",
    "length0",
    "dof_length",
    "lengthspring",
    "lengthrange",
    "acc0",
    "M0",
    "plugin",
    "pathadr",
    "cranklength",
)
#: of the parts of all skins together, whose number may be that of the skins by chance
PARTS = ("skin_bone", "skin_face", "skin_texcoord", "skin_vert")


class Difference(NamedTuple):
    """One number that is not what it was."""

    element: str
    field: str
    wanted: float
    found: float


def ids_of(model: "mujoco.MjModel", names: Mapping[str, set[str]]) -> dict[str, list[int]]:
    """Ids per kind of the elements that bear one of `names[kind]`."""
    out: dict[str, list[int]] = {}
    for kind, word in NAMED.items():
        get = getattr(model, word)
        out[kind] = [
            i
            for i in range(int(getattr(model, KINDS[kind])))
            if get(i).name in names.get(kind, set())
        ]
    joints = set(out["jnt"])
    out["dof"] = [i for i in range(model.nv) if int(model.dof_jntid[i]) in joints]
    return out


def others(model: "mujoco.MjModel", mine: Mapping[str, list[int]]) -> dict[str, list[int]]:
    """Ids per kind of all elements that are not in `mine`."""
    return {
        kind: [i for i in range(int(getattr(model, count))) if i not in set(mine.get(kind, []))]
        for kind, count in KINDS.items()
    }


def in_order_of(
    craft: "mujoco.MjModel",
    bodies: Sequence[int],
    model: "mujoco.MjModel",
    ids: Mapping[str, list[int]],
    moved: Collection[str],
) -> dict[str, list[int]]:
    """Elements of `model` by kind in the order of the bare craft, where the bodies `moved` hang
    elsewhere.

    Args:
        craft: the bare craft, and the ids of those of its `bodies` that are meant.
        model, ids: the elements of `model` that are the craft's.
        moved: names; what hangs on each of them keeps its order.
    """
    groups = _in_groups(craft, bodies, moved)
    found = _in_groups(model, ids["body"], moved)
    was = {
        now: before
        for name, group in groups.items()
        for before, now in zip(group, found.get(name, []), strict=False)
    }
    out = dict(ids)
    out["body"] = sorted(ids["body"], key=lambda i: was.get(i, i))
    for kind in ("jnt", "dof", "geom", "site", "cam", "light"):
        owner = getattr(model, f"{kind}_bodyid")
        out[kind] = sorted(ids[kind], key=lambda i: (was.get(int(owner[i]), int(owner[i])), i))
    return out


def _in_groups(
    model: "mujoco.MjModel", bodies: Sequence[int], moved: Collection[str]
) -> dict[str, list[int]]:
    """Bodies by the moved one that they hang on, "" for none."""
    out: dict[str, list[int]] = {}
    for body in bodies:
        top = body
        while top and model.body(top).name not in moved:
            top = int(model.body_parentid[top])
        out.setdefault(model.body(top).name if top else "", []).append(body)
    return out


def differences(
    wanted: "mujoco.MjModel",
    found: "mujoco.MjModel",
    pairs: Mapping[str, tuple[list[int], list[int]]],
    *,
    placed: Collection[str] = (),
    tolerance: float = 0.0,
    user: bool = True,
) -> list[Difference]:
    """Numbers of `found` that are not those of `wanted`; bodies `placed` may stand elsewhere in
    their parents."""
    out: list[Difference] = []
    for kind, (first, second) in pairs.items():
        if len(first) != len(second):
            out.append(Difference(kind, "number of elements", len(first), len(second)))
            continue
        for field in _fields(wanted, kind):
            if field.endswith("_user") and not user:
                continue
            a = np.asarray(getattr(wanted, field))
            b = np.asarray(getattr(found, field))
            for i, j in zip(first, second, strict=True):
                label = _name(found, kind, j)
                if label in placed and field in ("body_pos", "body_quat"):
                    continue
                x, y = _same_width(a[i], b[j])
                far = np.abs(x - y) > tolerance * np.max(np.abs(x), initial=0.0)
                if np.any(far):
                    k = int(np.argmax(far))
                    out.append(Difference(label, field, float(x[k]), float(y[k])))
    return out


def _same_width(x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
    """Two rows as numbers; shorter user data end in zeros."""
    a, b = (np.atleast_1d(np.asarray(row, dtype=np.float64)).ravel() for row in (x, y))
    wide = max(a.size, b.size)
    if a.size == b.size:
        return a, b
    return np.pad(a, (0, wide - a.size)), np.pad(b, (0, wide - b.size))


def _fields(model: "mujoco.MjModel", kind: str) -> list[str]:
    count = int(getattr(model, KINDS[kind]))
    out: list[str] = []
    for field in dir(model):
        if (
            not field.startswith(f"{kind}_")
            or field.endswith(INDEXED)
            or field.startswith(PARTS)
            or any(word in field for word in DERIVED)
        ):
            continue
        values = getattr(model, field)
        if (
            isinstance(values, np.ndarray)
            and values.ndim >= 1
            and values.shape[0] == count
            and values.dtype != object
        ):
            out.append(field)
    return out


def _name(model: "mujoco.MjModel", kind: str, index: int) -> str:
    word = {"jnt": "joint", "dof": "joint", "cam": "cam", "tex": "tex", "mat": "mat"}.get(
        kind, kind
    )
    if kind == "dof":
        index = int(model.dof_jntid[index])
    get = getattr(model, word, None)
    return (get(index).name if get is not None else "") or f"{kind} {index}"
