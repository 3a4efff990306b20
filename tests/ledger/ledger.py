"""The ledger: what the package says of some hundred craft, beside independent truths.

Every craft of `crafts.py` goes through `fit`, `embed`, `stability`, `plant` and `margins`; a row
holds the modes chosen, links, hinges and tendons, the stated errors, the largest step and the
margins of a loop, each beside what `truth.py` has of it. What changed against `table.json` is
printed, and with `--store` stored. Processor times are printed as a ratio, and not compared.

Run: python tests/ledger/ledger.py [--store] [--workers 2] [name ...]
"""

import argparse
import copy
import json
import os
import re
import statistics
import tempfile
import time
import traceback
import warnings
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import control
import mujoco
import numpy as np
import truth

import beamchain as bc
import crafts

TABLE = Path(__file__).with_name("table.json")
FIGURES = ("craft_error", "sampled_error", "step", "gain", "phase")  # each beside its truth
CHANGED = 1e-3  # relative, of a figure


def controller(c, band):
    """Numerator and denominator of a PD loop about z at a twelfth of the band, with two lags."""
    w = band / 12.0
    inertia = c["hub"][1][2]
    return [1.4 * inertia * w, inertia * w**2], [1.0 / (400.0 * w**2), 0.1 / w, 1.0]


def row(name):
    """One craft: its figures and truths, or the sentence with which it was refused."""
    warnings.simplefilter("ignore")
    c = crafts.CRAFTS[name]
    with tempfile.TemporaryDirectory() as folder:
        home = Path(folder)
        at = {}
        for place, spec in c["specs"].items():
            text, table = crafts.toml(place, spec)
            at[place] = home / f"{place}.toml"
            at[place].write_text(text)
            if table:
                (home / f"{place}_modes.toml").write_text(table)
        (home / "craft.xml").write_text(crafts.mjcf(c))
        start = time.process_time()
        try:
            return figures(c, at, home, start)
        except Exception as error:
            where = traceback.extract_tb(error.__traceback__)[-1]
            sentence = re.sub(r"\s+", " ", f"{type(error).__name__}: {error}".replace(folder, ""))
            if not isinstance(error, bc.BeamchainError):
                sentence += f" ({Path(where.filename).name}, {where.name})"
            return {"error": sentence[:300], "seconds": time.process_time() - start}


def figures(c, at, home, start):
    fits = {place: bc.fit(path) for place, path in at.items()}
    craft = bc.embed(home / "craft.xml", at)
    stated = {"craft_error": craft.craft_error, "sampled_error": craft.sampled_error}
    craft.write(home / "flexible.xml")
    integrator = c["integrator"]
    loop = controller(c, craft.band)
    if not any("slosh" in spec for spec in c["specs"].values()):  # which nothing holds at rest
        found = bc.stability(home / "flexible.xml")
        limit = next(r.predicted for r in found.rows if r.integrator == integrator)
        plant = bc.plant(craft, ["torque:hub"], ["attitude"])
        margins = bc.margins(plant, {("torque_z", "attitude_z"): control.tf(*loop)}).loops[0]
        stated |= {"step": float(limit), "gain": margins.gain, "phase": abs(margins.phase)}
    spent = time.process_time() - start

    hub, parts = crafts.exact(c)
    axes = next(iter(c["specs"].values()))["scene"].get("axes", crafts.ALL)
    true = {"craft_error": 0.0, "sampled_error": 0.0}
    poses = {"rest": []} | c["keys"]
    for key, angles in poses.items():
        judge = truth.Judge(truth.assemble(hub, parts, angles), axes, craft.band)
        if key == "rest":
            true["gain"], true["phase"] = judge.margins(
                lambda s: np.polyval(loop[0], s) / np.polyval(loop[1], s)
            )
        for given, which in ((craft.untimed, "craft_error"), (craft.model, "sampled_error")):
            model = sprung(craft, c, given)
            qpos = model.qpos0 if key == "rest" else model.key(key).qpos
            if which == "craft_error":
                error = judge.craft_error(*comparable(craft, c, model, qpos))
            else:
                mean = integrator != "RK4"
                error = judge.sampled_error(*truth.step_map(model, qpos), c["step"], mean)
            true[which] = max(true[which], error)
    if "step" in stated:
        near = min(limit, 10.0 / float(found.budgets[0].frequencies[0]))
        written = mujoco.MjModel.from_xml_path(str(home / "flexible.xml"))
        true["step"] = truth.largest_step(written, near)
    out = {"modes": modes(craft), "fitted": "; ".join(map(counted, fits.values()))}
    chains = [a.fit.chain for a in craft.appendages]
    for what in ("links", "hinges", "tendons"):
        out[what] = sum(len(getattr(chain, what)) for chain in chains)
    out["timed"] = any(a.timed is not None for a in craft.appendages)
    out["met"] = craft.met
    out |= {k: [stated[k], true[k]] for k in FIGURES if k in stated}
    return out | {"seconds": spent}


def counted(fit):
    """The modes that a fit kept, in words."""
    return " ".join(f"{t.modes} {port}" for port, t in fit.target.items() if t.modes) or "none"


def modes(craft):
    return "; ".join(counted(a.fit) for a in craft.appendages)


def own(appendage, model):
    """Degrees of freedom of an appendage."""
    names = [model.joint(joint).name for joint in model.dof_jntid]
    return [i for i, name in enumerate(names) if name.startswith(appendage.prefix)]


def sprung(craft, c, model):
    """A copy of a compiled file whose liquids hang on springs as stiff as their acceleration."""
    model = copy.copy(model)
    for a in craft.appendages:
        if "slosh" in c["specs"][a.at]:
            dofs = own(a, model)
            w = np.repeat(truth.tank(c["specs"][a.at]).w[: len(dofs) // 2], 2)
            model.jnt_stiffness[model.dof_jntid[dofs]] = model.dof_M0[dofs] * w**2
    return model


def comparable(craft, c, model, qpos):
    """A compiled file with the damping at which it is compared."""
    m, d, k = truth.compiled(model, qpos)
    for a in craft.appendages:
        dofs, spec = own(a, model), c["specs"][a.at]
        if "damping" not in spec and "slosh" not in spec:
            d = d + truth.lacking(m, d, k, dofs, truth.UNSTATED)
        elif spec.get("damping", {"ratio": 1.0})["ratio"] < truth.LEAST:
            d = d + truth.lacking(m, d, k, dofs, truth.LEAST)
    return m, d, k


def rounded(value):
    """Four significant digits; what is infinite or undefined as a word."""
    if isinstance(value, dict):
        return {k: rounded(v) for k, v in value.items()}
    if isinstance(value, list):
        return [rounded(v) for v in value]
    if isinstance(value, float):
        return float(f"{value:.4g}") if np.isfinite(value) else str(value)
    return value


def ratio(stated, true):
    """Stated over true; 1 where both are the same word."""
    if stated == true:
        return 1.0
    if isinstance(stated, str) or isinstance(true, str) or true == 0.0:
        return float("inf")
    return stated / true


def changes(old, new):
    """What differs between two rows, in words."""
    out = []
    for key in sorted((old.keys() | new.keys()) - {"seconds"}):
        a, b = old.get(key), new.get(key)
        pairs = (
            list(zip(a, b, strict=True))
            if isinstance(a, list) and isinstance(b, list)
            else [(a, b)]
        )
        words = ("", "") if len(pairs) == 1 else (", stated", ", true")
        for (x, y), word in zip(pairs, words, strict=False):
            close = all(isinstance(v, float) for v in (x, y)) and abs(y - x) <= CHANGED * abs(x)
            if x != y and not close:
                out.append(f"{key}{word}: {x} -> {y}")
    return out


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", help="some of the craft; all where left out")
    parser.add_argument("--store", action="store_true")
    parser.add_argument("--workers", type=int, default=2)
    chosen = parser.parse_args()
    old = json.loads(TABLE.read_text()) if TABLE.exists() else {}
    names = chosen.names or list(crafts.CRAFTS)
    began = time.monotonic()
    new = {}
    with ProcessPoolExecutor(chosen.workers) as pool:
        for name, found in zip(names, pool.map(row, names), strict=True):
            new[name] = rounded(found)
            said = changes(old[name], new[name]) if name in old else ["new"]
            print(f"{name}: {'; '.join(said) or 'unchanged'}", flush=True)
            if chosen.names:
                print(json.dumps(new[name], indent=1))
    report(old, new)
    print(f"{time.monotonic() - began:.0f} s")
    if chosen.store:
        table = {k: v for k, v in (old | new).items() if k in crafts.CRAFTS}
        lines = [f"{json.dumps(k)}: {json.dumps(v)}" for k, v in sorted(table.items())]
        TABLE.write_text("{\n" + ",\n".join(lines) + "\n}\n")


def report(old, new):
    """How far the figures are from their truths, which craft are gone, and the time taken."""
    sound = {name: r for name, r in new.items() if "error" not in r}
    print(f"\n{len(new)} craft, {len(new) - len(sound)} refused")
    for figure in FIGURES:
        off = {n: ratio(*r[figure]) for n, r in sound.items() if r.get(figure, ["nan"])[0] != "nan"}
        worst = sorted(off, key=lambda n: abs(np.log(off[n] or 1e-300)), reverse=True)[:3]
        said = ", ".join(
            f"{n} {off[n]:.4g} ({r[0]} / {r[1]})" for n in worst for r in [sound[n][figure]]
        )
        print(f"{figure}: stated over true, farthest from 1: {said}")
    both = [n for n in sound if n in old and "error" not in old[n]]
    if both:
        times = [new[n]["seconds"] / max(old[n]["seconds"], 1e-9) for n in both]
        print(
            f"processor time over the stored: median {statistics.median(times):.2f}, sum "
            f"{sum(new[n]['seconds'] for n in both) / sum(old[n]['seconds'] for n in both):.2f}"
        )
    for name in sorted(old.keys() - crafts.CRAFTS.keys()):
        print(f"{name}: stored, and no longer in crafts.py")


if __name__ == "__main__":
    main()
