"""The ledger: what the package says of some hundred craft, beside independent truths.

Every craft of `crafts.py` goes through `fit`, `embed`, `stability`, `plant` and `margins`. A row
holds the modes chosen, links, joints and tendons, the stated errors, the largest step and the
margins of a loop, each figure beside what `truth.py` has of it. What changed against `table.json`
is printed, and with `--store` stored. Processor times are shown as a ratio, and not compared. A
gain margin is often reached beyond the band, where the exact craft has modes that a chain lacks.

Run: PYTHONPATH=tests/support python tests/ledger/ledger.py [--store] [--workers 2] [name ...]
"""

import argparse
import copy
import itertools
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
BETWEEN = 0.3  # of the way from one pose to the next, where a timed tree is judged too


def row(name):
    """One craft: its figures and truths, or the sentence with which it was refused."""
    warnings.simplefilter("ignore")
    start = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        try:
            return figures(crafts.CRAFTS[name], Path(folder))
        except Exception as error:
            said = re.sub(r"\s+", " ", f"{type(error).__name__}: {error}".replace(folder, ""))
            if not isinstance(error, bc.BeamchainError):
                last = traceback.extract_tb(error.__traceback__)[-1]
                said += f" ({Path(last.filename).name}, {last.name})"
            return {"error": said[:300], "seconds": time.process_time() - start}


def figures(c, home):
    """The row of a craft whose files are written into the folder `home`."""
    specs = c["specs"]
    for place, spec in specs.items():
        for file, text in crafts.files(place, spec).items():
            (home / file).write_text(text)
    (home / "craft.xml").write_text(crafts.mjcf(c))
    start = time.process_time()
    at = {place: home / f"{place}.toml" for place in specs}
    fits = [bc.fit(path) for path in at.values()]
    craft = bc.embed(home / "craft.xml", at)
    stated = {"craft_error": craft.craft_error, "sampled_error": craft.sampled_error}
    flexible = craft.write(home / "flexible.xml")[0]
    loop = Loop(c, craft.band)
    if not any("slosh" in spec for spec in specs.values()):  # which nothing holds at rest
        found = bc.stability(flexible, joints=c["hinges"][:1])  # slews of one hinge: they take long
        limits = {r.integrator: r.largest for r in found.rows}
        plant = bc.plant(craft, ["torque:hub"], ["attitude"])
        pair = f"torque_{loop.axis}", f"attitude_{loop.axis}"
        margins = bc.margins(plant, {pair: control.tf(loop.above, loop.below)}).loops[0]
        stated["step"] = float(limits[c["integrator"]])
        stated |= {"gain": margins.gain, "phase": abs(margins.phase)}
    seconds = time.process_time() - start

    model, untimed = copy.copy(craft.model), copy.copy(craft.untimed)
    timed = bool(np.any(model.tendon_armature != untimed.tendon_armature))
    true = truths(c, craft.band, loop, model, untimed, timed=timed)
    if "step" in stated:
        true["step"] = truth.largest_step(mujoco.MjModel.from_xml_path(str(flexible)))
    out = {"modes": counted(a.fit for a in craft.appendages), "fitted": counted(fits)}
    every = {"links": model.body, "joints": model.joint, "tendons": model.tendon}
    for what, count in (("links", model.nbody), ("joints", model.njnt), ("tendons", model.ntendon)):
        names = [every[what](i).name for i in range(count)]
        out[what] = sum(name.startswith(f"{place}_") for name in names for place in specs)
    out |= {"timed": timed, "met": craft.met}
    return out | {k: [stated[k], true[k]] for k in FIGURES if k in stated} | {"seconds": seconds}


class Loop:
    """A PD loop with two lags about an axis that the scene asks for, at a twelfth of the band."""

    def __init__(self, c, band):
        self.axis = next((a for a in "zx" if a in c["axes"]), "y")
        w, inertia = band / 12.0, c["hub"][1]["xyz".index(self.axis)]
        self.above = [1.4 * inertia * w, inertia * w**2]
        self.below = [1.0 / (400.0 * w**2), 0.1 / w, 1.0]

    def __call__(self, s):
        return np.polyval(self.above, s) / np.polyval(self.below, s)


def counted(fits):
    """The modes that fits kept, in words."""
    ports = [[mode.port for mode in fit.modes] for fit in fits]
    return "; ".join(" ".join(f"{p.count(n)} {n}" for n in dict.fromkeys(p)) for p in ports)


def truths(c, band, loop, model, untimed, *, timed):
    """Errors of a file, worst of all poses, and margins at rest."""
    poses = {"rest": [0.0] * len(c["hinges"]), **c["keys"]}
    between = itertools.pairwise(map(np.array, poses.values()))
    on_the_way = [(None, a + BETWEEN * (b - a)) for a, b in between if timed]
    out, tree = {"craft_error": 0.0, "sampled_error": 0.0}, crafts.exact(c["parts"])
    for each in (model, untimed):
        hang_liquids(c, each)
    for key, angles in [*poses.items(), *on_the_way]:
        judge = truth.Judge(truth.assemble(c["hub"], tree, angles), c["axes"], band)
        qpos = model.qpos0.copy()
        qpos[[model.joint(name).qposadr[0] for name in c["hinges"]]] = angles
        a, b = truth.step_map(model, qpos)
        off = judge.sampled_error(a, b, c["step"], mean=c["integrator"] != "RK4")
        out["sampled_error"] = max(out["sampled_error"], off)
        if key is not None:
            off = judge.craft_error(*compared(c, untimed, qpos))
            out["craft_error"] = max(out["craft_error"], off)
        if key == "rest":
            out["gain"], out["phase"] = judge.margins(loop, loop.axis)
    return out


def compared(c, model, qpos):
    """A file without timing at a pose, with the damping at which it is compared."""
    m, d, k = truth.compiled(model, qpos)
    for place, spec in c["specs"].items():
        ratio = truth.damping(spec)
        if "slosh" not in spec and (ratio is None or ratio < truth.LEAST):
            least = truth.UNSTATED if ratio is None else truth.LEAST
            d = d + truth.lacking(m, d, k, own(place, model), least)
    return m, d, k


def own(place, model):
    """Degrees of freedom of an appendage."""
    names = [model.joint(joint).name for joint in model.dof_jntid]
    return [i for i, name in enumerate(names) if name.startswith(f"{place}_")]


def hang_liquids(c, model):
    """Springs for the liquids of a file, as stiff as the stated acceleration makes them."""
    for place, spec in c["specs"].items():
        if "slosh" in spec:
            dofs = own(place, model)
            w = np.repeat(truth.tank(spec).frequencies[: len(dofs) // 2], 2)
            model.jnt_stiffness[model.dof_jntid[dofs]] = model.dof_M0[dofs] * w**2


# -- the table -------------------------------------------------------------------------------------
def rounded(value):
    """Four significant digits; what is infinite or undefined as a word."""
    if isinstance(value, list):
        return [rounded(v) for v in value]
    if isinstance(value, float):
        return float(f"{value:.4g}") if np.isfinite(value) else str(value)
    return value


def ratio(stated, true):
    """Stated over true; 1 where both are the same word."""
    if stated == true:
        return 1.0
    if isinstance(stated, str) or isinstance(true, str):
        return float("inf")
    return stated / true


def changes(old, new):
    """What differs between two rows, in words."""
    out = []
    for key in sorted((old.keys() | new.keys()) - {"seconds"}):
        a, b = old.get(key), new.get(key)
        both = isinstance(a, list) and isinstance(b, list)
        for x, y, word in zip(a, b, ("", " (truth)"), strict=True) if both else [(a, b, "")]:
            close = all(isinstance(v, float) for v in (x, y)) and abs(y - x) <= CHANGED * abs(x)
            if x != y and not close:
                out.append(f"{key}{word} {x} -> {y}")
    return out


def summary(old, new):
    """How far the figures are from their truths, which craft are gone, and the time taken."""
    sound = {name: r for name, r in new.items() if "error" not in r}
    print(f"\n{len(new)} craft, {len(new) - len(sound)} refused; stated over true:")
    for figure in FIGURES:
        both = {n: r[figure] for n, r in sound.items() if r.get(figure, ["nan"])[0] != "nan"}
        off = {n: ratio(*pair) for n, pair in both.items()}
        worst = sorted(off, key=lambda n: -abs(np.log(off[n])))[:4]
        said = ", ".join(f"{n} {off[n]:.4g} ({both[n][0]} / {both[n][1]})" for n in worst)
        within = sum(abs(v - 1.0) <= CHANGED for v in off.values())
        print(f"  {figure}: {within} of {len(off)} within {CHANGED:g}; farthest: {said}")
    same = [n for n in sound if "error" not in old.get(n, {"error": ""})]
    if same:
        times = [(new[n]["seconds"], old[n]["seconds"]) for n in same]
        each = statistics.median(a / b for a, b in times)
        whole = sum(a for a, _ in times) / sum(b for _, b in times)
        print(f"processor time over the stored one: {each:.2f} (median), {whole:.2f} (sum)")
    for name in sorted(old.keys() - crafts.CRAFTS.keys()):
        print(f"{name}: stored, and no longer in crafts.py")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", help="some of the craft; all where left out")
    parser.add_argument("--store", action="store_true")
    parser.add_argument("--workers", type=int, default=2)
    chosen = parser.parse_args()
    old = json.loads(TABLE.read_text()) if TABLE.exists() else {}
    names = chosen.names or list(crafts.CRAFTS)
    if unknown := sorted({*names} - crafts.CRAFTS.keys()):
        parser.error(
            f"no such craft: {', '.join(unknown)}; crafts.py has {', '.join(crafts.CRAFTS)}"
        )
    names.sort(key=lambda name: -old.get(name, {"seconds": 0.0})["seconds"])  # the longest first
    began, new = time.monotonic(), {}
    with ProcessPoolExecutor(chosen.workers) as pool:
        for name, found in zip(names, pool.map(row, names), strict=True):
            new[name] = {key: rounded(value) for key, value in found.items()}
            said = changes(old[name], new[name]) if name in old else ["new", *new[name].items()]
            if said:
                print(f"{name}: {'; '.join(map(str, said))}", flush=True)
    summary(old, new)
    print(f"{time.monotonic() - began:.0f} s")
    if chosen.store:
        table = {k: v for k, v in (old | new).items() if k in crafts.CRAFTS}
        lines = [f"{json.dumps(k)}: {json.dumps(v)}" for k, v in sorted(table.items())]
        TABLE.write_text("{\n" + ",\n".join(lines) + "\n}\n")


if __name__ == "__main__":
    main()
