"""`sweep`: variants of an appendage drawn from [uncertain], as arrays for one compiled MuJoCo model."""

import io
import time
import tomllib
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import lru_cache
from importlib.resources import files as package_files
from pathlib import Path
from typing import Any

import numpy as np
from msgspec import structs

from beamchain import report
from beamchain.engine.library import mujoco
from beamchain.engine.linearise import compile_model
from beamchain.errors import BeamchainError, InputError, RealisationError
from beamchain.files import to_json, write_files
from beamchain.fitting.choose import make_plan, whole_beam
from beamchain.fitting.fit import damped, fit
from beamchain.fitting.hub import default_hub
from beamchain.fitting.options import Modes
from beamchain.fitting.result import Fit
from beamchain.fitting.spec import Spec, read_spec, spec_from_dict
from beamchain.fitting.spec_text import spec_toml
from beamchain.ports.compose import in_space
from beamchain.ports.motions import Array
from beamchain.studies.jobs import Progress, run_jobs, stamp

#: Fields of MuJoCo's model that differ between variants; they hold for the scene.xml written beside them.
FIELDS = (
    "jnt_stiffness", "dof_damping", "body_mass", "body_inertia", "body_ipos", "body_iquat", "body_pos", "site_pos",
    "wrap_prm", "tendon_stiffness", "tendon_damping", "tendon_armature", "tendon_solimp_lim",
)  # fmt: skip
NAMES = ("body", "jnt", "site", "tendon")
CHUNK = 10  # samples per job
STORE = ".sweep_points.jsonl"
QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)


@dataclass(frozen=True, eq=False)
class Sweep:
    """All variants."""

    spec: Spec  # with [uncertain]
    nominal: Fit  # of the spec itself
    seed: int
    indices: Array  # (k,) samples that became variants
    fields: dict[str, Array]  # per field of MuJoCo's model, (k, ...)
    coupled: Array  # (k, n) frequencies of hub and appendage, kept modes [rad/s]
    participation: dict[str, Array]  # per port (k, n, m)
    left_out: dict[int, str]  # samples without a variant and why
    seconds: float

    def as_dict(self) -> dict[str, Any]:
        """What sweep.json holds."""
        return {
            "name": self.spec.name,
            "samples": self.indices.size + len(self.left_out),
            "variants": self.indices.size,
            "seed": self.seed,
            "quantiles": QUANTILES,
            "coupled_frequencies": [_spread(column) for column in self.coupled.T],
            "participation": {
                port: [[_spread(values[:, k, i]) for i in range(values.shape[2])] for k in range(values.shape[1])]
                for port, values in self.participation.items()
            },
            "left_out": [{"sample": index, "why": why} for index, why in self.left_out.items()],
            "fields": {name: list(values.shape[1:]) for name, values in self.fields.items()},
            "mujoco": mujoco.__version__,
            "seconds": self.seconds,
        }

    def archive(self) -> bytes:
        """variants.npz: the fields, the samples' numbers, the coupled modes, and names of bodies, joints, ..."""
        model = compile_model(self.nominal.scene_mjcf())
        names = {f"{kind}_names": np.array(_names(model, kind)) for kind in NAMES}
        stream = io.BytesIO()
        np.savez_compressed(
            stream, allow_pickle=False, fields=np.array(list(self.fields)), sample=self.indices,
            coupled_frequencies=self.coupled, **names, **self.fields,
        )  # fmt: skip
        return stream.getvalue()

    def write(self, folder: Path, *, force: bool = False) -> list[Path]:
        """Write scene.xml (nominal), variants.npz, apply_variants.py, a picture and sweep.json (last); all or none.

        Raises:
            OutputError: a file exists and `force` is False, or the folder cannot be written.
        """
        example = package_files("beamchain").joinpath("examples/apply_variants.py").read_text(encoding="utf-8")
        content: dict[Path, str | bytes] = {
            folder / "scene.xml": self.nominal.scene_mjcf(),
            folder / "variants.npz": self.archive(),
            folder / "apply_variants.py": example,
            folder / "coupled_frequencies.svg": report.sweep_picture(self),
            folder / "sweep.json": to_json(self.as_dict()),
        }
        write_files(content, force=force)
        (folder / STORE).unlink(missing_ok=True)
        return list(content)


def _spread(values: Array) -> dict[str, Any]:
    quantiles = np.quantile(values, QUANTILES)
    return {"mean": float(np.mean(values)), "deviation": float(np.std(values)), "quantiles": quantiles}


def sweep(
    spec: Spec | str | Path,
    samples: int,
    *,
    seed: int = 0,
    executor: Executor | None = None,
    folder: Path | None = None,
    resume: bool = False,
    progress: Progress | None = None,
) -> Sweep:
    """Draw variants of an appendage from its [uncertain] and fit each, as `beamchain sweep` does.

    Args:
        spec: with [uncertain], or the path of such a SPEC.toml; if its modes are chosen for a scene, all variants use
            the nominal choice.
        samples: number of samples.
        seed: of the draws; the same seed gives the same variants.
        executor: runs the fits; default: one after the other in this process.
        folder: folder in which finished fits are kept until `Sweep.write`, for `resume`.
        resume: continue from the fits in `folder`.
        progress: called after every ten samples.

    Returns:
        The variants as fields of one compiled MuJoCo model (`fields`), their coupled frequencies [rad/s] (`coupled`),
        samples that could not be made and why (`left_out`), files (`write`).

    Raises:
        EngineError: a worker process died; finished fits are kept in `folder`.
        InputError: the spec has no [uncertain], or every sample was left out.

    Example:
        >>> import beamchain as bc
        >>> from importlib.resources import files
        >>> variants = bc.sweep(files("beamchain") / "examples" / "array_uncertain.toml", samples=3, seed=1)
        >>> variants.coupled.shape[0]
        3
    """
    start = time.perf_counter()
    spec = spec if isinstance(spec, Spec) else read_spec(spec)
    if spec.uncertain is None:
        raise InputError("the spec has no [uncertain]; add one with for example stiffness = { relative = 0.05 }.")
    if spec.imported is not None:
        raise InputError(
            f"[uncertain] varies a beam, but the appendage {spec.name!r} is imported modes ({spec.imported.file}); give "
            "it as [[segment]], or vary the frequencies in copies of the file."
        )
    text = spec_toml(spec)
    own = stamp(text, seed)
    chunks = [(i, min(i + CHUNK, samples)) for i in range(0, samples, CHUNK)]
    jobs = {f"{own} {first} {end}": (text, seed, first, end) for first, end in chunks}
    store = None if folder is None else folder / STORE
    results = run_jobs(vary, jobs, executor=executor, store=store, resume=resume, progress=progress)
    rows = [row for chunk in results.values() for row in chunk]
    good = [row for row in rows if "why" not in row]
    left_out = {row["sample"]: row["why"] for row in rows if "why" in row}
    if not good:
        raise InputError(f"no sample became a variant: {next(iter(left_out.values()))}")
    nominal, model = _nominal(text)
    fields = {
        name: np.array([row["fields"][name] for row in good]).reshape(len(good), *getattr(model, name).shape)
        for name in FIELDS
        if getattr(model, name).size
    }
    participation = {port: np.array([row["participation"][port] for row in good]) for port in nominal.target}
    indices, coupled = (np.array([row[what] for row in good]) for what in ("sample", "coupled"))
    seconds = time.perf_counter() - start
    return Sweep(spec, nominal, seed, indices, fields, coupled, participation, left_out, seconds)


def vary(text: str, seed: int, first: int, end: int) -> list[dict[str, Any]]:
    """One job: samples `first` to `end`, as plain data."""
    nominal, model = _nominal(text)
    return [_sample(nominal, model, seed, index) for index in range(first, end)]


@lru_cache(maxsize=4)
def _nominal(text: str) -> tuple[Fit, "mujoco.MjModel"]:
    """The fit of the spec itself, its modes and target made fast, and its compiled scene."""
    spec = spec_from_dict(tomllib.loads(text))
    found = fit(spec)
    fixed = structs.replace(
        spec,
        modes=Modes(**{port: target.modes for port, target in found.target.items()}),
        root=structs.replace(spec.root, target=found.kept_for),
    )
    model = compile_model(found.scene_mjcf())
    return replace(found, spec=fixed), model


def _sample(nominal: Fit, model: "mujoco.MjModel", seed: int, index: int) -> dict[str, Any]:
    try:
        spec = varied(nominal.spec, seed, index)
        beam = spec.beam
        hub = None if spec.root.hub is None else spec.root.hub.mass_matrix()
        full = whole_beam(spec, beam)
        plan = make_plan(spec, full, beam.rigid_mass(), hub)
        built = damped(spec, plan, beam, nominal.cut)
        for port, target in built.targets.items():
            if target.modes < nominal.target[port].modes:
                raise RealisationError(f"fewer modes in {port}: {built.status.message}")
        chain = built.chain
        own = compile_model(replace(nominal, spec=spec, chain=chain).scene_mjcf())
        if any(_names(own, kind) != _names(model, kind) for kind in NAMES):
            raise RealisationError("its hinges or bodies come in another order than the nominal model's")
    except BeamchainError as error:
        return {"sample": index, "why": str(error)}
    ports = {port: chain.port(port) for port in built.targets}
    carried = (spec.root.hub or default_hub(beam)).mass_matrix()
    modes = sum(target.modes for target in built.targets.values())
    coupled = in_space(ports, chain.rigid_mass()).with_hub(carried).free_frequencies[:modes]
    return {
        "sample": index,
        "fields": {name: getattr(own, name).ravel().tolist() for name in FIELDS if getattr(own, name).size},
        "coupled": coupled.tolist(),
        "participation": {p: m.participation[: built.targets[p].modes].tolist() for p, m in ports.items()},
    }


def _names(model: "mujoco.MjModel", kind: str) -> list[str]:
    return [getattr(model, kind)(i).name for i in range(getattr(model, f"n{kind}"))]


def varied(spec: Spec, seed: int, index: int) -> Spec:
    """The spec of one sample; refused where a drawn value is not allowed, such as a mass below zero."""
    given = spec.uncertain
    assert given is not None
    ratios = spec.damping.ratio if spec.damping is not None else 0.0
    counts = {"payload": 1, "lump": len(spec.lump), "joint_stiffness": len(spec.joint)}
    counts |= dict.fromkeys(("stiffness", "density"), len(spec.segment))
    counts["damping"] = sum(map(len, ratios.values())) if isinstance(ratios, dict) else 1
    scores = given.scores(seed, index, counts)
    changes: dict[str, Any] = {}
    if given.stiffness is not None or given.density is not None:
        stiff, dense = (
            [each.value(1.0, z) for z in scores[name]] if each else [1.0] * len(spec.segment)
            for name, each in (("stiffness", given.stiffness), ("density", given.density))
        )
        changes["segment"] = tuple(map(_segment, spec.segment, stiff, dense))
    if given.joint_stiffness is not None:
        names, value = ("stiffness_xy", "stiffness_xz", "stiffness_torsion"), given.joint_stiffness.value
        changes["joint"] = tuple(
            structs.replace(joint, **{n: value(c, z) for n in names if (c := getattr(joint, n)) is not None})
            for joint, z in zip(spec.joint, scores["joint_stiffness"], strict=True)
        )
    if given.lump is not None:
        changes["lump"] = tuple(
            _heavier(lump, given.lump.value(lump.mass, z)) for lump, z in zip(spec.lump, scores["lump"], strict=True)
        )
    if given.payload is not None and spec.payload is not None:
        changes["payload"] = _heavier(spec.payload, given.payload.value(spec.payload.mass, scores["payload"][0]))
    if given.damping is not None and spec.damping is not None:
        drawn, value = iter(scores["damping"]), given.damping.value
        if isinstance(ratios, dict):
            ratio = {port: tuple(value(z, next(drawn)) for z in values) for port, values in ratios.items()}
        else:
            ratio = value(ratios, next(drawn))
        changes["damping"] = structs.replace(spec.damping, ratio=ratio)
    return structs.replace(spec, **changes)


def _heavier(body: Any, mass: float) -> Any:
    """A lump or payload with another mass, its inertia in proportion."""
    return structs.replace(body, mass=mass, inertia=tuple(v * mass / body.mass for v in body.inertia))


def _segment(segment: Any, stiff: float, dense: float) -> Any:
    """A segment with its stiffness and mass per length multiplied."""
    changes: dict[str, Any] = {"nonstructural_mass": segment.nonstructural_mass * dense}
    factors = {**dict.fromkeys(_STIFF, stiff), **dict.fromkeys(_HEAVY, dense)}
    for name in ("section", "section_end", "material"):
        part = getattr(segment, name)
        if part is not None:
            held = {n: getattr(part, n) for n in factors if n in part.__struct_fields__}
            changes[name] = structs.replace(part, **{n: v * factors[n] for n, v in held.items() if v is not None})
    return structs.replace(segment, **changes)


_STIFF = (
    "bending_stiffness_xy", "bending_stiffness_xz", "torsion_stiffness", "axial_stiffness", "youngs_modulus",
    "shear_modulus",
)  # fmt: skip
_HEAVY = ("linear_mass", "polar_inertia", "density")
