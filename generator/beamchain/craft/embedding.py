"""`embed`: appendages into an existing spacecraft, and what the assembled model then proves of itself."""

import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, cast

import msgspec
import numpy as np
from lxml import etree

from beamchain import report
from beamchain.caution import Caution
from beamchain.caution import at as said_of
from beamchain.checks import one_of
from beamchain.checks import whole as checked_int
from beamchain.craft.appendage import (
    PROBE,
    Appendage,
    carried,
    check_names,
    driven_too_far,
    judged,
    lightest,
    moved_by_load,
    names,
    rigid_mass,
)
from beamchain.craft.assembly import Assembly, prove
from beamchain.craft.error import CraftError, craft_error, craft_poses
from beamchain.craft.promise import MOST_MODES, asked, keep_promise, kept_band
from beamchain.craft.spoilers import check_flags
from beamchain.craft.timing import on_tendons, timed, turned, without_time, worth_it
from beamchain.engine import mount as mounting
from beamchain.engine.library import mujoco
from beamchain.engine.linearise import compile_model
from beamchain.engine.threads import one_thread
from beamchain.engine.unchanged import appended
from beamchain.errors import EngineError, InputError
from beamchain.files import write_files
from beamchain.fitting.fit import as_spec, fit_spec
from beamchain.fitting.hub import Hub
from beamchain.fitting.needs import AXES
from beamchain.fitting.options import Root, Target
from beamchain.fitting.plausibility import doubtful
from beamchain.fitting.result import Fit
from beamchain.fitting.spec import Spec, read_spec, spec_from_dict
from beamchain.mjcf import compatibility, insert, marks, write
from beamchain.mjcf.craft import Craft, bare, craft_from_text, read_craft, relocate
from beamchain.mjcf.place import find_target, split
from beamchain.structure.beam import Beam
from beamchain.structure.imported import with_length
from beamchain.structure.modal_data import ModalData

SAME_HUB = 1e-12  # relative: hubs that are one
RIGID = 1e-6  # relative: a hub that differs from a rigid body by more has loose joints


@dataclass(frozen=True, eq=False, repr=False)
class Embedded:
    """A spacecraft with its appendages.

    Args:
        appendages: in the order given.
        craft: the bare spacecraft, compiled.
        model: with its appendages, compiled.
        warnings: what would spoil the motion, and what was decided on the way.
        document: the bare spacecraft's document; None for an `MjSpec`.
        form: "inline" or "attach".
        steps: modes that were added for the craft's promise, a line each.
    """

    appendages: tuple[Appendage, ...]
    craft: "mujoco.MjModel"
    model: "mujoco.MjModel"
    warnings: tuple[str, ...]
    document: Craft | None = None
    form: str = "inline"
    steps: tuple[str, ...] = ()
    _layout: dict[str, Any] = field(default_factory=dict)

    def __repr__(self) -> str:
        return report.embedded_text(self)

    def _repr_html_(self) -> str:
        return report.embedded_html(self)

    @cached_property
    def assembly(self) -> Assembly:
        """Coupled modes and hub accelerance against the exact assembly, at rest: of what the scenes ask for, or all."""
        want = asked([a.spec for a in self.appendages])
        return prove(self.craft, self.untimed, carried(self.model, self.appendages), want.band, want.motions)

    @cached_property
    def promise(self) -> CraftError:
        """The coupled spacecraft against exact appendages, pose by pose: up to the largest band that a scene asks for.

        Without a scene's band: all motions, up to where every appendage keeps every mode of its ports.
        """
        want, exact = asked([a.spec for a in self.appendages]), carried(self.model, self.appendages)
        found = craft_poses(self.craft, exact, want.band or kept_band(self.appendages), want.motions)
        return craft_error(self.craft, self.untimed, exact, found)

    @property
    def craft_error(self) -> float:
        """In-band error of the base body's motion, worst of all poses."""
        return self.promise.error

    @property
    def band(self) -> float:
        """Upper end of the craft's error [rad/s]."""
        return self.promise.band

    @property
    def tolerance(self) -> float | None:
        """The smallest that a scene with a band asks for; None without one."""
        return asked([a.spec for a in self.appendages]).tolerance

    @property
    def met(self) -> bool | None:
        """Whether the craft's error stays within the tolerance; None without one."""
        return None if self.tolerance is None else self.craft_error <= self.tolerance

    @property
    def headline(self) -> str:
        """The craft's promise in a sentence."""
        found, tolerance = self.promise, self.tolerance
        names = [name for name, i in AXES.items() if i in found.motions]
        said = (
            f"motion of {found.body} ({', '.join(names)}) up to {found.band:.4g} rad/s, all appendages together: off by "
            f"at most {found.error:.2e}"
        )
        if len(found.poses) > 1:
            said += f" (worst of {len(found.poses)} poses: {max(found.poses, key=lambda k: found.poses[k])})"
        if tolerance is None:
            return f"{said}; no tolerance is asked for."
        return f"{said}, {'within' if self.met else 'above'} the tolerance {tolerance:g}."

    @cached_property
    def untimed(self) -> "mujoco.MjModel":
        """The model with timing taken out, which is what is compared with the exact spacecraft."""
        return without_time(self.model) if any(a.timed is not None for a in self.appendages) else self.model

    def to_mjcf(self, folder: str | Path | None = None) -> str:
        """The file's text, its relative paths right in `folder`; absolute where left out.

        Raises:
            InputError: made from an `MjSpec`, which has its own `to_xml`.
        """
        return self._files(None if folder is None else Path(folder), "craft")[0].to_bytes().decode("utf-8")

    def write(self, path: str | Path, *, force: bool = False, also: Mapping[Path, str] | None = None) -> list[Path]:
        """Write the file (and, for "attach", the appendages' files beside it); all or none.

        Args:
            path: of the MJCF file.
            force: replace files that exist.
            also: further files to appear with it.

        Raises:
            OutputError: a file exists and `force` is False, or cannot be written.
        """
        path = Path(path)
        out, beside = self._files(path.parent, path.stem)
        files: dict[Path, str | bytes] = {path.parent / name: text for name, text in beside.items()}
        files |= dict(also or {})
        files[path] = out.to_bytes()
        write_files(files, force=force)
        return list(files)

    def as_dict(self) -> dict[str, Any]:
        """What `embed --json` prints."""
        return report.embed_record(self)

    def plot(self) -> str:
        """The hub's accelerance, exact and through MuJoCo, as SVG text."""
        return report.assembly_svg(self.assembly)

    def report(self, craft: str = "craft.xml", output: str = "flexible.xml") -> str:
        """The report as the text of one HTML file.

        Args:
            craft: name of the bare spacecraft's file.
            output: name of the file with the appendages.
        """
        return report.embed_report(self, craft, output)

    def _files(self, folder: Path | None, stem: str) -> tuple[Craft, dict[str, str]]:
        if self.document is None:
            raise InputError("this was made from an MjSpec, which was changed in place; use its own to_xml().")
        return _assemble(self.document, self.appendages, self.form, folder, stem, self._layout)


def embed(
    craft: "str | Path | mujoco.MjSpec",
    at: Mapping[str, Spec | Beam | ModalData | Fit | str | Path],
    *,
    form: str = "inline",
    prefixes: Sequence[str] | None = None,
    retime: bool | None = None,
    max_modes: int = MOST_MODES,
) -> Embedded:
    """Put appendages into a spacecraft and prove the assembled model.

    A file that holds appendages of an earlier run keeps them; those at a place that `at` names are replaced.

    Args:
        craft: path or text of an MJCF file, or an `MjSpec`, which is then changed in place.
        at: by name of a site or body of the spacecraft (x of its frame outwards): a spec, the path of a SPEC.toml, a
            beam, imported modes, or a fit, which is used as it is where its hub is the one it meets, else fitted anew.
            Where a site and a body share a name: `site:NAME`, `body:NAME`. Modes that no file holds cannot be found
            when the written file is given to `embed` again.
        form: "inline": one self-contained file; "attach": appendage files beside it, brought in by `<attach>`.
        prefixes: one per entry of `at`, instead of `NAME_` of the appendage.
        retime: make the appendages exact in time for the spacecraft's own step and integrator, or do not; where left
            out, they are where the step's error would exceed a tenth of the scenes' tolerance (1e-4 without one).
        max_modes: of an appendage, up to which modes are added where the whole craft misses the scenes' tolerance.

    Raises:
        InputError: no such place, a frame that is none, a static body, clashing names, switches that would spoil it.
        EngineError: MuJoCo refuses the spacecraft.
        RealisationError: no chain exists.
    """
    one_of("form", form, insert.FORMS)
    if not isinstance(at, Mapping):
        raise InputError(
            f'at = {at!r:.60} is a {type(at).__name__}; give appendages by place: {{"mount": "array.toml"}}.'
        )
    if not at:
        raise InputError("nothing to embed: give at least one place and spec, --at NAME=SPEC.toml.")
    given = list(prefixes or [])
    if given and len(given) != len(at):
        raise InputError(
            f"{len(given)} prefixes are given for {len(at)} appendages; give one --prefix per --at, or none."
        )
    wanted: dict[str, tuple[Spec, str]] = {}
    ready: dict[str, Fit] = {}
    held: dict[str, ModalData] = {}
    most = checked_int("max_modes", max_modes, 0, 1000)
    for i, (name, spec) in enumerate(at.items()):
        made = spec if isinstance(spec, Fit) else None
        if isinstance(spec, ModalData):
            held[name] = with_length(spec, None)
        if isinstance(spec, Fit):
            if spec.space is not None:
                held[name] = spec.space.data
            spec = spec.spec
        spec = read_spec(spec) if isinstance(spec, str | Path) else as_spec(spec)
        prefix = given[i] if given else f"{spec.name}_"
        insert.check_prefix(prefix)
        if spec.imported is not None:  # the mark in the file must find the modes from anywhere
            spec = msgspec.structs.replace(spec, imported=spec.imported.beside(Path.cwd()))
        if made is not None:
            ready[name] = made if made.spec == spec else replace(made, spec=spec)
        wanted[name] = (spec, prefix)
    if isinstance(craft, mujoco.MjSpec):
        return _embed_in_spec(craft, wanted, retime, most, _Fits(ready, held))
    original, before, _ = _read(craft)
    return _embed_in_document(original, before | wanted, form, retime, most, _Fits(ready, held))


def take_out(craft: str | Path, at: Sequence[str] = ()) -> "Craft | Embedded":
    """The spacecraft without its appendages, or without those at some places.

    Args:
        craft: path or text of a file that `embed` wrote.
        at: which to take out; all where empty.

    Returns:
        The original document, or what `embed` gives where some appendages stay.

    Raises:
        InputError: there is no such appendage.
    """
    original, before, form = _read(craft)
    missing = [name for name in at if name not in before]
    if not before or missing:
        place = f"at {missing[0]!r} " if missing else ""
        raise InputError(
            f"{original.label} holds no appendage {place}that embed put in; it has: {', '.join(before) or 'none'}."
        )
    left = {name: entry for name, entry in before.items() if at and name not in at}
    return _embed_in_document(original, left, form) if left else original


def _read(craft: str | Path) -> tuple[Craft, dict[str, tuple[Spec, str]], str]:
    """The bare spacecraft, what was embedded in it by place, and in which form."""
    text = isinstance(craft, str) and craft.lstrip().startswith("<")
    read = craft_from_text(str(craft)) if text else read_craft(craft)
    facts = marks.embedded(read.root)
    before = {f["at"]: (_spec_of_mark(f["spec"], f["at"]), f["prefix"]) for f in facts}
    return bare(read), before, facts[0]["form"] if facts else "inline"


def _spec_of_mark(spec: Mapping[str, Any], at: str) -> Spec:
    """The spec that a mark holds; one of version 1 may ask for oscillators, which are a chain today."""
    options = spec.get("fit")
    if isinstance(options, Mapping) and options.get("form") == "oscillators":
        spec = {**spec, "fit": {**options, "form": None}}
    return spec_from_dict(spec, f"mark of {at}")


# -- into a document -------------------------------------------------------------------------------------------------
def _embed_in_document(
    original: Craft,
    wanted: dict[str, tuple[Spec, str]],
    form: str,
    retime: bool | None = None,
    most: int = MOST_MODES,
    fits: "_Fits | None" = None,
) -> Embedded:
    # an empty body at every place: a hub whose frame MuJoCo would move while it carries nothing stays where it is
    probe = relocate(original, None)
    targets = {name: find_target(probe, name) for name in wanted}
    for i, target in enumerate(targets.values()):
        etree.SubElement(target.body, "body", name=f"{PROBE}{i}")
    craft = compile_model(probe.to_bytes().decode("utf-8"))
    mounts = {name: mounting.mount(craft, name, t.kind, t.name) for name, t in targets.items()}
    appendages, warnings, steps = _fit_all(craft, mounts, wanted, most, fits or _Fits())
    warnings += moved_by_load(compile_model(relocate(original, None).to_bytes().decode("utf-8")), craft)
    check_flags(craft)
    check_names(craft, appendages)
    compatibility.check_compiler(original.parts(), *lightest(appendages))
    layout = _layout(original, appendages, craft, form)
    model = _compiled(original, appendages, form, layout)
    good, why = worth_it(model, appendages, retime)
    warnings += [why] if why else []
    if good:
        appendages = tuple(replace(a, fit=on_tendons(a.fit)) for a in appendages)
        check_names(craft, appendages)
        model = _compiled(original, appendages, form, layout)
    final = timed(model) if good else model
    warnings += judged(craft, model, appendages, final, compatibility.hostile(original.parts()))
    warnings += driven_too_far(model, appendages) + turned(model, appendages)
    if good:
        appendages = tuple(replace(a, timed=final) for a in appendages)
    model = final
    return Embedded(appendages, craft, model, tuple(warnings), original, form, steps, layout)


def _compiled(
    original: Craft,
    appendages: Sequence[Appendage],
    form: str,
    layout: dict[str, Any] | None,
    change: Callable[[Craft], None] | None = None,
) -> "mujoco.MjModel":
    """The document with its appendages, compiled; `change` edits it before."""
    with tempfile.TemporaryDirectory() as folder:
        out, beside = _assemble(original, appendages, form, None, "craft", layout, Path(folder))
        for name, text in beside.items():
            (Path(folder) / name).write_text(text, encoding="utf-8")
        if change is not None:
            change(out)
        return compile_model(out.to_bytes().decode("utf-8"))


def _assemble(
    original: Craft,
    appendages: Sequence[Appendage],
    form: str,
    folder: Path | None,
    stem: str,
    layout: dict[str, Any] | None,
    beside: Path | None = None,
) -> tuple[Craft, dict[str, str]]:
    """The document with its appendages for a folder, and the files of the attached ones."""
    out = relocate(original, folder)
    items = [
        insert.Insertion(
            find_target(out, a.at), a.mount.position, a.mount.quaternion, a.element(), a.spec.name, a.prefix,
            msgspec.to_builtins(a.spec),
        )
        for a in appendages
    ]  # fmt: skip
    keyed = insert.keys_to_extend(out)
    files = {a.prefix: f"{stem}_{a.prefix.rstrip('_.-')}.xml" for a in appendages}
    absolute = {p: str((beside or Path.cwd()) / n) if folder is None else n for p, n in files.items()}
    insert.put_in(out, items, form, absolute)
    if keyed and layout is not None:
        insert.extend_keys(out, layout["qpos"], layout["qvel"], layout["rest"])
    return out, {files[i.prefix]: insert.child_text(i) for i in items} if form == "attach" else {}


def _layout(original: Craft, appendages: Sequence[Appendage], craft: "mujoco.MjModel", form: str) -> dict[str, Any]:
    """Which old position and velocity every new one is: compiled without keyframes, compared by bodies' order."""

    def without_keys(out: Craft) -> None:
        for include in out.includes():
            marks.inline(include.element, include.content)
        for keyframe in list(out.root.iter("keyframe")):
            parent = keyframe.getparent()
            assert parent is not None
            parent.remove(keyframe)

    model = _compiled(original, appendages, form, None, without_keys)
    mine = appended(model, names(appendages))
    old = [j for j in range(model.njnt) if j not in set(mine["jnt"])]
    if len(old) != craft.njnt:
        raise EngineError(f"the spacecraft has {craft.njnt} joints, with appendages {len(old)} of them.")
    sizes = {0: (7, 6), 1: (4, 3), 2: (1, 1), 3: (1, 1)}
    qpos: list[int | None] = [None] * model.nq
    qvel: list[int | None] = [None] * model.nv
    for was, now in enumerate(old):
        positions, velocities = sizes[int(craft.jnt_type[was])]
        for i in range(positions):
            qpos[int(model.jnt_qposadr[now]) + i] = int(craft.jnt_qposadr[was]) + i
        for i in range(velocities):
            qvel[int(model.jnt_dofadr[now]) + i] = int(craft.jnt_dofadr[was]) + i
    return {"qpos": qpos, "qvel": qvel, "rest": [float(v) for v in model.qpos0]}


# -- into an MjSpec --------------------------------------------------------------------------------------------------
def _embed_in_spec(
    spec: "mujoco.MjSpec",
    wanted: dict[str, tuple[Spec, str]],
    retime: bool | None,
    most: int,
    fits: "_Fits",
) -> Embedded:
    places: dict[str, tuple[str, str]] = {}
    probe = spec.copy()
    for at in wanted:
        kinds, name = split(at)
        found = [kind for kind in kinds if getattr(spec, kind)(name) is not None]
        if len(found) != 1:
            known = ", ".join(s.name for s in [*spec.sites, *spec.bodies] if s.name)
            raise InputError(
                f"--at {at}: the spacecraft has {'both a site and a' if found else 'no site or'} body "
                f"{name!r}; write site:{name} or body:{name}, or choose from: {known}."
            )
        places[at] = found[0], name
        _owner(probe, *places[at]).add_body(name=f"{PROBE}{len(places)}")
    try:
        plain, craft = spec.copy().compile(), probe.compile()
    except ValueError as error:
        raise EngineError(f"MuJoCo refuses the spacecraft: {error}") from None
    mounts = {at: mounting.mount(craft, at, kind, name) for at, (kind, name) in places.items()}
    appendages, warnings, steps = _fit_all(craft, mounts, wanted, most, fits)
    warnings += moved_by_load(plain, craft)
    check_flags(craft)
    check_names(craft, appendages)

    def attached(place: "mujoco.MjSpec") -> "mujoco.MjSpec":
        for a in appendages:
            frame = _owner(place, *places[a.at]).add_frame(pos=a.mount.position, quat=a.mount.quaternion)
            text = write.text(insert.renamed(a.element(), a.spec.name, ""))
            place.attach(mujoco.MjSpec.from_string(text), frame=frame, prefix=a.prefix)
        return place

    model = attached(spec.copy()).compile()
    good, why = worth_it(model, appendages, retime)
    warnings += [why] if why else []
    if good:
        appendages = tuple(replace(a, fit=on_tendons(a.fit)) for a in appendages)
        check_names(craft, appendages)
        model = attached(spec.copy()).compile()
    final = timed(model) if good else model
    warnings += judged(craft, model, appendages, final) + driven_too_far(model, appendages)
    warnings += turned(model, appendages)
    if good:
        appendages = tuple(replace(a, timed=final) for a in appendages)
    attached(spec)  # the user's spec is touched only after a copy has proved itself
    return Embedded(appendages, craft, spec.copy().compile(), tuple(warnings), steps=steps)


def _owner(spec: "mujoco.MjSpec", kind: str, name: str) -> Any:
    """The body that a site or body means."""
    return spec.body(name) if kind == "body" else spec.site(name).parent


# -- both ------------------------------------------------------------------------------------------------------------
def _fit_all(
    model: "mujoco.MjModel",
    mounts: dict[str, mounting.Mount],
    wanted: dict[str, tuple[Spec, str]],
    most: int,
    fits: "_Fits",
) -> tuple[tuple[Appendage, ...], list[str], tuple[str, ...]]:
    """Every appendage fitted to the hub it meets, with the modes that the craft's promise needs; notes; steps taken."""
    rigid = {name: rigid_mass(spec, fits.held.get(name)) for name, (spec, _) in wanted.items()}
    places = list(mounts.values())
    behind, felt = mounting.rigid_hubs(model, places, rigid), mounting.apparent_hubs(model, places, rigid)
    out: list[Appendage] = []
    warnings: list[str] = []
    for name, (spec, prefix) in wanted.items():
        place, hub = mounts[name], Hub.from_mass_matrix(behind[name])
        size = np.sqrt(np.diag(behind[name]))
        if np.max(np.abs(felt[name] - behind[name]) / np.outer(size, size)) > RIGID:
            hub = msgspec.structs.replace(hub, apparent=tuple(tuple(float(v) for v in row) for row in felt[name]))
        for joint in place.joints:
            taken = "locked, since a spring holds it" if joint.sprung else "free, since no spring holds it"
            if not joint.own:
                text = (
                    f"{name}: stands behind the joint {joint.name} ({joint.kind}); {hub.mass:.6g} kg are rigidly "
                    f"behind its root. The fit takes that joint as {taken}."
                )
                warnings.append(Caution("joints-behind", text))
        held = place.held(spec.kept)
        if held:
            text = (
                f"{name}: the spacecraft's joints hold port {', '.join(held)}, wholly or in part; what they hold counts "
                "as infinitely heavy."
            )
            warnings.append(Caution("held-ports", text))
        warnings += [
            Caution(
                "rigid-plane",
                f"{name}: {port} is rigid, since [modes] names the other plane only; {port} = 2 keeps modes there, "
                f"{port} = 0 says that it shall be rigid.",
            )
            for port in spec.unsaid
            if not place.held([port])
        ]
        given = spec.root.hub
        if given is not None and not np.allclose(
            given.mass_matrix(), hub.mass_matrix(), rtol=1e-6, atol=1e-9 * hub.mass
        ):
            text = (
                f"{name}: the hub of the spec ({_words(given)}) is not what the spacecraft has behind the root "
                f"({_words(hub)}), which was used instead."
            )
            warnings.append(Caution("other-hub", text))
        result = fits.ready.get(name)
        if result is None or not _same_hub(result, hub):
            result = fits(name, spec, Root(target=spec.root.target, hub=hub))
        out.append(Appendage(name, prefix, place, hub, spec, result))

    def again(a: Appendage, wished: Spec) -> Fit:
        return fits(a.at, wished, Root(target=cast("Target", a.fit.kept_for), hub=a.hub))

    with one_thread():
        appendages, steps = keep_promise(model, tuple(out), most, again)
    for a in appendages:
        if not a.fit.status.ok:
            warnings.append(Caution("fit-missed", f"{a.at}: {a.fit.status.message}"))
        if a.spec.damping is not None and a.spec.damping.form == "hinge":
            # tendons are judged by the craft's own integrator
            warnings += [said_of(a.at, warning) for warning in a.fit.cautions]
        else:
            warnings += [said_of(a.at, warning) for warning in doubtful(a.spec.segment, a.spec.damping, a.fit.target)]
    return appendages, warnings, steps


class _Fits:
    """Fits that were made already: equal appendages on equal hubs are fitted once.

    Args:
        ready: fits that were handed over, by place.
        held: imported modes that were handed over, by place, instead of being read from the spec's file.
    """

    def __init__(self, ready: Mapping[str, Fit] | None = None, held: Mapping[str, ModalData] | None = None) -> None:
        self.ready: Mapping[str, Fit] = ready or {}
        self.held: Mapping[str, ModalData] = held or {}
        self._made: list[tuple[Spec, Root, ModalData | None, Fit]] = []

    def __call__(self, at: str, spec: Spec, root: Root) -> Fit:
        data = self.held.get(at)
        for known, there, own, made in self._made:
            same = known == spec and own is data and there.target == root.target
            if same and root.hub is not None and _same_hub(made, root.hub):
                return made
        made = fit_spec(msgspec.structs.replace(spec, root=root), data)
        self._made.append((spec, root, data, made))
        return made


def _same_hub(made: Fit, hub: Hub) -> bool:
    """Whether a fit was made for this hub."""
    known, here = made.hub_mass, hub.mass_matrix()
    if known is None:
        return False
    size = np.sqrt(np.diag(here))
    return float(np.max(np.abs(known - here) / np.outer(size, size))) <= SAME_HUB


def _words(hub: Hub) -> str:
    """A hub's mass, inertia and place, for a sentence."""
    inertia, offset = (", ".join(f"{value + 0.0:.4g}" for value in values) for values in (hub.inertia, hub.offset))
    return f"{hub.mass:.6g} kg, inertia {inertia} kg m^2, root at {offset} m from its centre"
