"""The craft's promise with imported appendages:
modes are added from those of the file until the craft holds.

The truth is worked out from the numbers that were written into the file (finite elements of a boom,
Ritz of a plate), the model is the exported file as MuJoCo compiles it: `found_error` of
test_craft_promise, which imports nothing of the package.
"""

import json

import numpy as np
import pytest
from test_craft_promise import AGREE, found_error, in_space

import beamchain as bc
import finite_elements as fe
from beamchain import ModalData
from prints import plate
from solver import Modes

PRINT = 5e-7  # relative precision of seven printed digits

RATIO = 0.008
HELD = 8  # modes of every port in the file
BOOM = {
    "name": "boom",
    "segment": [
        {
            "length": 4.0,
            "section": {
                "shape": "equivalent",
                "bending_stiffness_xy": 900.0,
                "bending_stiffness_xz": 1600.0,
                "torsion_stiffness": 300.0,
                "axial_stiffness": 1e6,
                "linear_mass": 4.0,
                "polar_inertia": 0.3,
            },
        }
    ],
}
BUS = (
    '<mujoco><option gravity="0 0 0" timestep="1e-4" integrator="RK4"/><worldbody>'
    '<body name="bus"><freejoint/><inertial pos="0 0 0" mass="{}" diaginertia="{}"/>'
    '<site name="left" pos="{} 0 0"/><site name="right" pos="-{} 0 0" euler="0 0 180"/></body>'
    "</worldbody></mujoco>"
)
SPEC = 'name = "array"\n{more}\n[imported]\nfile = "modes.json"\n{named}[damping]\nratio = 0.008\n'
SCENE = "[scene]\nbandwidth = {band!r}\ntolerance = 1e-3\n"


def boom_modes():
    """What the file holds: some modes of every port, from finite elements."""
    whole = in_space(BOOM)
    w, rows = whole.frequencies, whole.participation
    size = w.size // len(fe.PORTS)
    pick = np.concatenate([np.arange(k * size, k * size + HELD) for k in range(len(fe.PORTS))])
    order = pick[np.argsort(w[pick])]
    return Modes(w[order], RATIO, rows[order], whole.rigid, 0.0 * rows[order])


def plate_modes():
    """Modes that couple bending and torsion."""
    modes = plate()
    rows = modes.participation
    return Modes(modes.frequencies, RATIO, rows, modes.mass, 0.0 * rows)


#: modes, bandwidth in first frequencies, bus: mass,
#: inertia and arm relative to the appendage's mass
KINDS = {
    "independent": (boom_modes, 1.5, (1.25, (0.5625, 0.5, 0.4375), 0.5)),
    "on the hub's modes": (boom_modes, 4.0, (1.25, (0.5625, 0.5, 0.4375), 0.5)),
    "coupled": (plate_modes, 1.5, (0.5, (5e-4, 6e-4, 7e-4), 0.02)),
}


class Case:
    """A light bus with two equal imported arrays, in a folder."""

    def __init__(self, kind, folder, more="", named=""):
        make, factor, (mass, inertia, arm) = KINDS[kind]
        self.exact = make()
        w, _, rows, rigid, *_ = self.exact
        m = rigid[0, 0]
        self.text = BUS.format(mass * m, " ".join(f"{v * m:.12g}" for v in inertia), arm, arm)
        self.band = factor * float(w[0])
        record = {
            "frequencies": w.tolist(),
            "participation": rows.T.tolist(),
            "mass": rigid.tolist(),
            "digits": 15,
        }
        (folder / "modes.json").write_text(json.dumps(record))
        (folder / "craft.xml").write_text(self.text)
        self.at = {}
        for site in ("left", "right"):
            self.at[site] = folder / f"{site}.toml"
            scene = SCENE.format(band=self.band)
            self.at[site].write_text(
                SPEC.format(more=more if site == "left" else "", named=named) + scene
            )
        self.folder = folder

    def embed(self, at=None, **more):
        return bc.embed(self.text, at or self.at, retime=False, **more)

    def found(self, done) -> float:
        """Craft error in the exported file."""
        file = done.write(self.folder / "flexible.xml", force=True)[-1]
        scene = {"bandwidth": self.band, "axes": ["x", "y", "z", "tx", "ty", "tz"]}
        spec = {"scene": scene, "damping": {"ratio": RATIO}}
        return found_error(
            self.text, file, dict.fromkeys(self.at, spec), dict.fromkeys(self.at, self.exact)
        )


def kept(appendage) -> int:
    return len(appendage.fit.space.numbers)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_modes_are_added_until_the_craft_holds(kind, tmp_path):
    case = Case(kind, tmp_path)
    own = case.embed(max_modes=0)
    assert own.met is False
    # each kept what its own scene asks for
    assert all(a.fit.promise <= 1e-3 for a in own.appendages)
    assert case.found(own) == pytest.approx(own.craft_error, rel=AGREE)
    done = case.embed()
    assert done.met is True
    assert case.found(done) == pytest.approx(done.craft_error, rel=AGREE)
    assert case.found(done) <= 1e-3 * (1.0 + AGREE)
    assert sum(map(kept, own.appendages)) < sum(map(kept, done.appendages)) <= 24
    assert len(done.steps) == sum(map(kept, done.appendages)) - sum(map(kept, own.appendages))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["independent", "coupled"])
def test_what_was_typed_stays(kind, tmp_path):
    """A count in [modes] fixes its port, numbers in [imported] fix all;
    the other appendage alone cannot mend it."""
    port = "xy" if kind == "independent" else "xz"
    case = Case(kind, tmp_path, more=f"[modes]\n{port} = 2")
    done = case.embed()
    left = done.appendages[0].fit.space
    numbers = [left.data.belongs[k - 1] for k in left.numbers]
    assert numbers.count(port) == 2
    assert not any(
        f"left: mode {n} in {port}" in step for step in done.steps for n in range(HELD + 1)
    )
    case = Case(kind, tmp_path, named="modes = [1, 2, 3]\n")
    done = case.embed()
    assert done.met is False
    assert done.steps == ()
    assert [a.fit.space.numbers for a in done.appendages] == [(1, 2, 3)] * 2


@pytest.mark.slow
def test_no_more_modes_than_the_bound(tmp_path):
    case = Case("coupled", tmp_path)
    own = case.embed(max_modes=0)
    most = max(map(kept, own.appendages))
    assert case.embed(max_modes=most).met is False
    more = case.embed(max_modes=most + 1)
    assert [kept(a) for a in more.appendages] == [most + 1] * 2
    assert more.craft_error < own.craft_error


@pytest.mark.slow
def test_modes_that_no_file_holds(tmp_path):
    """ModalData, or a fit of it, instead of a spec."""
    case = Case("coupled", tmp_path)
    w, _, rows, rigid, *_ = case.exact
    data = ModalData(rigid, w, rows, damping=np.full(w.size, RATIO), precision=PRINT)
    bare = bc.embed(case.text, {"left": data}, retime=False)
    assert kept(bare.appendages[0]) == w.size  # no scene: all
    assert bare.steps == ()  # and none is left to add
    made = bc.fit(data, scene=bc.Scene(bandwidth=case.band, tolerance=1e-3))
    done = case.embed(dict.fromkeys(case.at, made))
    assert done.met is True
    assert done.steps
    assert case.found(done) == pytest.approx(done.craft_error, rel=AGREE)
    fits = {a.at: a.fit for a in done.appendages}
    again = case.embed(fits)
    assert [a.fit for a in again.appendages] == list(fits.values())
