"""The shipped array of three panels a side: folded, half, deployed, and on the way there, with
rigid panels and flexible ones.

SLOW_MODES, KEPT, BENT: frequencies against finite elements, of rigid panels (rounding), of flexible
ones up to the band, and of latched ones, which bend more with one mode each. AGREE: stated and
found error, relative, or NOTHING, what finite elements of rounded numbers leave. ACROSS: momentum
before and after a latch, of its scale: rounding. DEPLOYED: over the whole deployment, at the steps
of RK4 below. GROWS: of the energy between two looks. POLES: of the latched array against the same
chains in another file.
"""

import copy
import re
import sys
from functools import cache

import mujoco
import numpy as np
import pytest
from lxml import etree

import beamchain as bc
import wings
from arms import frequencies
from command import call
from craft_truth import Pair, compiled
from examples import EXAMPLES, example
from mechanics import (
    after_a_step,
    damping_matrix,
    mass_matrix,
    momentum,
    stiffness_matrix,
    system_matrix,
    total_energy,
)

SLOW_MODES, KEPT, BENT = 2e-6, 1e-5, 5e-5
AGREE, NOTHING = 0.05, 1e-5
ACROSS, DEPLOYED, GROWS = 1e-12, 1e-7, 1e-9
POLES = 1e-6
BAND = 12.0
STEP = {True: 0.002, False: 0.00025}  # of RK4, with rigid panels and with flexible ones
LOOK = 25  # steps between two looks at the energy
HELD = {"stiffness": 1000.0, "damping": 1.0}
SIDES = ("right", "left")
NUMBERS = (1, 2, 3)
CRAFT = EXAMPLES / "wing_unfolds.xml"
SLOW = pytest.mark.slow
BOTH = pytest.mark.parametrize(
    "rigid", [True, pytest.param(False, marks=SLOW)], ids=["rigid", "flexible"]
)


def embedded(text, rigid=False):
    """The array with its panels."""
    at = {f"panel{k}_{side}": example("panel") for side in SIDES for k in NUMBERS}
    carry = {f"panel{k}_{side}:end": f"hinge{k + 1}_{side}" for side in SIDES for k in (1, 2)}
    return bc.embed(text, at, carry=carry, rigid=rigid, retime=False)


@cache
def array(rigid):
    return embedded(CRAFT, rigid)


@cache
def with_stiff_hinges():
    """The same chains in a file whose hinges are written as they are when latched."""
    text = CRAFT.read_text()
    text = re.sub(r'stiffness="0.8" springref="[-\d]+" damping="0.1"', HINGE, text)
    return embedded(re.sub(r' range="[-\d ]+"', "", text))


HINGE = 'stiffness="1000" damping="1"'


@cache
def welded():
    """The same chains in a file without hinges."""
    text = re.sub(r"<joint [^>]*/>", "", CRAFT.read_text())
    return embedded(re.sub(r"<keyframe>.*</keyframe>", "", text, flags=re.S))


def poles(model, pose=None):
    """Damped poles of a compiled model about a pose, without the spacecraft's rigid motion."""
    mass = mass_matrix(model, model.qpos0 if pose is None else pose)
    found = np.linalg.eigvals(
        system_matrix(mass[6:, 6:], damping_matrix(model)[6:, 6:], stiffness_matrix(model)[6:, 6:])
    )
    found = found[found.imag > 0.0]
    return found[np.argsort(np.abs(found))]


# -- at rest ---------------------------------------------------------------------------------------
@BOTH
@pytest.mark.parametrize("name", list(wings.ANGLES))
@pytest.mark.slow
def test_frequencies_of_each_stage_are_those_of_finite_elements(name, rigid):
    model = array(rigid).model
    truth = wings.side(BAND, wings.ANGLES[name], rigid=rigid)
    wanted = frequencies(truth, 8)
    wanted = wanted[: 6 if rigid else int(np.sum(wanted <= BAND))]
    ours = frequencies(compiled(model, model.key(name).qpos), 8)[: wanted.size]
    sys.stdout.write(f"{name}: {wanted.round(4)}, off by {np.abs(ours / wanted - 1.0).max():.1e}\n")
    assert wanted.size >= 5
    assert ours == pytest.approx(wanted, rel=SLOW_MODES if rigid else KEPT)


@SLOW
@pytest.mark.parametrize("name", ["half"])
def test_the_promise_of_each_stage_is_what_finite_elements_find(name):
    model, stated = array(False).model, array(False).promise.poses[name]
    truth = wings.side(BAND, wings.ANGLES[name])
    pair = Pair(truth, compiled(model, model.key(name).qpos), list(range(6)), BAND)
    found, place = pair.search()
    sys.stdout.write(f"{name}: stated {stated:.3e}, found {found:.3e} at {place:.4g} rad/s\n")
    assert stated == pytest.approx(found, rel=AGREE, abs=NOTHING)


# -- on the way ------------------------------------------------------------------------------------
class Books:
    """Energy and momentum of a deployment, looked at before and after everything."""

    def __init__(self, model, data):
        self.model, self.data = model, data
        self.energy = total_energy(model, data)
        self.start = momentum(model, data)
        self.size = np.abs(self.start).max()
        self.grown = self.across = self.step = 0.0

    def look(self):
        now = total_energy(self.model, self.data)
        self.grown = max(self.grown, (now - self.energy) / self.energy)
        self.energy = now

    def latch(self, name, **given):
        """`bc.latch`, compared with the shortened step that MuJoCo makes alone."""
        state = np.zeros(mujoco.mj_stateSize(self.model, mujoco.mjtState.mjSTATE_INTEGRATION))
        mujoco.mj_getState(self.model, self.data, state, mujoco.mjtState.mjSTATE_INTEGRATION)
        done = bc.latch(self.model, self.data, name, **HELD, **given)
        if done is None:
            return None
        latched = {field: getattr(self.model, field).copy() for field in FIELDS}
        after = momentum(self.model, self.data), total_energy(self.model, self.data)
        here = mujoco.MjData(self.model)
        bc.unlatch(self.model, here, name)
        mujoco.mj_setState(self.model, here, state, mujoco.mjtState.mjSTATE_INTEGRATION)
        before = momentum(self.model, here)
        plain = copy.copy(self.model)
        plain.jnt_limited[:] = False  # the stop does not act before the latch
        if self.data.time > here.time:
            plain, here = after_a_step(plain, here, self.data.time - here.time)
        moved = momentum(plain, here)
        self.across = max(self.across, np.abs(after[0] - moved).max() / self.size)
        self.step = max(self.step, np.abs(moved - before).max() / self.size)
        dropped = total_energy(plain, here) - after[1]
        assert float(done) == pytest.approx(dropped, abs=1e-11 * self.energy)
        for field, values in latched.items():
            getattr(self.model, field)[:] = values
        self.energy = after[1]
        return done

    def unlatch(self, name):
        before = momentum(self.model, self.data), total_energy(self.model, self.data)
        brought = bc.unlatch(self.model, self.data, name)
        jump = np.abs(momentum(self.model, self.data) - before[0]).max() / self.size
        self.across = max(self.across, jump)
        self.energy = total_energy(self.model, self.data)
        assert brought == pytest.approx(self.energy - before[1], abs=1e-11 * self.energy)


FIELDS = (
    "jnt_stiffness",
    "jnt_limited",
    "qpos_spring",
    "dof_damping",
    "dof_armature",
    "dof_frictionloss",
    "dof_solref",
    "jnt_solimp",
)


def deployed(rigid):
    """The array unfolded panel by panel from its tumbling bus, both sides at once; its books."""
    model = copy.copy(array(rigid).model)
    model.opt.timestep = STEP[rigid]
    if not rigid:
        bc.retime(model, STEP[rigid], "RK4")
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("folded").id)
    books = Books(model, data)
    for k in NUMBERS[1:]:
        for side in SIDES:  # held as they are until it is their turn
            name = f"hinge{k}_{side}"
            assert books.latch(name, angle=float(data.joint(name).qpos[0])) is not None
    for k in NUMBERS:
        waiting = [f"hinge{k}_{side}" for side in SIDES]
        if k > 1:
            for name in waiting:
                books.unlatch(name)
        while waiting:
            for _ in range(LOOK):
                for name in list(waiting):
                    if books.latch(name) is not None:
                        waiting.remove(name)
                        assert abs(data.joint(name).qpos[0]) < 1e-12
                mujoco.mj_step(model, data)
            books.look()
            assert data.time < 30.0
    books.end = momentum(model, data)
    return books


@BOTH
@pytest.mark.slow
def test_panels_unfold_and_latch_and_nothing_is_made_from_nothing(rigid):
    books = deployed(rigid)
    whole = np.abs(books.end - books.start).max() / books.size
    line = (
        f"momentum: across a latch {books.across:.1e}, in its shortened step {books.step:.1e}, in "
        f"all {whole:.1e}; energy grows by {books.grown:.1e} at most; {books.data.time:.2f} s"
    )
    sys.stdout.write(f"{line}\n")
    assert books.across <= ACROSS
    assert whole <= DEPLOYED
    assert books.grown <= GROWS
    for side in SIDES:
        for k in NUMBERS:
            assert abs(books.data.joint(f"hinge{k}_{side}").qpos[0]) < 0.3  # it rings


# -- afterwards ------------------------------------------------------------------------------------
def latched(stiffness, damping=1.0):
    """The deployed array with every hinge latched."""
    model = copy.copy(array(False).model)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("deployed").id)
    for side in SIDES:
        for k in NUMBERS:
            given = {"stiffness": stiffness, "damping": damping, "armature": 0.0}
            assert bc.latch(model, data, f"hinge{k}_{side}", **given) is not None
    assert data.time == 0.0
    return model


@SLOW
def test_the_latched_array_is_the_same_chains_with_hinges_of_that_stiffness():
    model, written = latched(1000.0), with_stiff_hinges().model
    ours = poles(model, model.key("deployed").qpos)
    theirs = poles(written, written.key("deployed").qpos)
    sys.stdout.write(f"{ours.size} poles off by {np.abs(ours / theirs - 1.0).max():.1e}\n")
    assert np.abs(ours / theirs - 1.0).max() <= POLES


@SLOW
def test_latched_ever_stiffer_it_is_the_same_chains_welded():
    wanted = poles(welded().model)[:12]
    soft, stiff = (
        poles(latched(k, 0.0), np.array(array(False).model.key("deployed").qpos))[:12]
        for k in (1e7, 2e7)
    )
    limit = 2.0 * stiff - soft  # what a stiffness k leaves falls as 1/k
    off = [np.abs(found / wanted - 1.0).max() for found in (soft, stiff, limit)]
    sys.stdout.write(f"off by {off[0]:.1e} at 1e7 N m/rad, {off[1]:.1e} at 2e7, {off[2]:.1e}\n")
    assert off[0] == pytest.approx(2.0 * off[1], rel=0.01)
    assert off[2] <= POLES


@SLOW
def test_the_promise_of_the_latched_array_is_what_finite_elements_find():
    embedded = with_stiff_hinges()
    model, stated = latched(1000.0), embedded.promise.poses["deployed"]
    truth = wings.side(BAND, wings.ANGLES["deployed"], stiffness=1000.0, damping=1.0)
    file = compiled(model, model.key("deployed").qpos)
    found, place = Pair(truth, file, list(range(6)), BAND).search()
    wanted = frequencies(truth, 6)
    wanted = wanted[wanted <= BAND]
    ours = frequencies(file, 6)[: wanted.size]
    sys.stdout.write(f"{wanted}, off by {np.abs(ours / wanted - 1.0).max():.1e}\n")
    sys.stdout.write(f"stated {stated:.3e}, found {found:.3e} at {place:.4g} rad/s\n")
    assert ours == pytest.approx(wanted, rel=BENT)
    assert stated == pytest.approx(found, rel=AGREE, abs=NOTHING)
    assert found <= embedded.tolerance


@SLOW
@pytest.mark.parametrize("step", [0.002, 0.01, 0.05])
def test_latched_hinges_between_flexible_panels_are_stable_at_every_step_of_euler(step):
    """Where the panels are retimed to the limit there is no room for further springs."""
    fastest = {}
    for armature in (None, 0.0):
        model = copy.copy(array(False).model)
        model.opt.timestep, model.opt.integrator = step, mujoco.mjtIntegrator.mjINT_EULER
        bc.retime(model, step, "Euler")
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, model.key("deployed").id)
        for side in SIDES:
            for k in NUMBERS:
                assert bc.latch(model, data, f"hinge{k}_{side}", armature=armature, **HELD)
        data.qvel[6:] = 1e-3 * np.random.default_rng(0).standard_normal(model.nv - 6)
        for _ in range(4000):
            mujoco.mj_step(model, data)
        fastest[armature] = np.abs(data.qvel).max()
        started_again = data.time < 3999.5 * step  # MuJoCo does so where numbers overflow
        assert started_again == (armature == 0.0 and step > 0.005)
    assert fastest[None] < 0.02


def test_the_command_that_init_names_fits_the_file(tmp_path):
    answer = call("init", "wing_unfolds", "-o", tmp_path / "wing_unfolds.xml")
    assert answer.status == 0
    words = answer.out.split("next: ")[1].split()
    names = {
        node.get("name")
        for node in etree.fromstring((tmp_path / "wing_unfolds.xml").read_bytes()).iter()
    }
    given = dict(words[i + 1].split("=") for i, word in enumerate(words) if word.startswith("--"))
    assert len(given) == 10
    for place, what in given.items():
        assert place.split(":")[0] in names
        assert what == "panel.toml" or what in names
