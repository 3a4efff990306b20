"""`bc.plant` of an arm of two flexible links, from a motor at the elbow between them, against
three-dimensional finite elements of the whole arm."""

import copy
import sys

import control
import mujoco
import numpy as np
import pytest
from scipy.linalg import eigh

import beamchain as bc
from arms import Arm, Link, assembled, mjcf, toml

BAND = 20.0
STEP = 0.002
OFF = 0.01  # damping of the frequencies at which responses are compared
# `exact` against finite elements, channel by channel; of their mesh, 30 elements a link:
# measured 1e-5
EXACT = 3e-5
# poles and zeros up to three times the band; measured 2.6e-7, of which 2.1e-7 are the mesh's
PLACES = 1e-6
# kept modes, of the largest response of a channel in the band: the error that `truncation` says
KEPT = 0.02
# a sampled plant against the same held truth: the truncation, and the step's own error below
SAMPLED = 0.02
RUN = 1e-5  # a run of MuJoCo against the plant: what is not linear in it
POSES = {"rest": 0.0, "square": np.pi / 2.0}
INPUTS = ["elbow", "torque:hand"]
OUTPUTS = ["angle", "rate", "motion:grip"]
ARM = Arm(
    (
        Link("upper", 6.0, 0.05, 0.08),
        Link("fore", 5.0, 0.04, 0.05, 4.0, (0.02, 0.02, 0.02), (0.0, 0.0, 1.0), damping=1.0),
    ),
    hand=20.0,
    hand_inertia=(0.5, 0.5, 0.5),
    keys={"square": {"fore": POSES["square"]}},
)
SIGNALS = """</worldbody><actuator><motor name="elbow" joint="hinge_fore"/></actuator>
<sensor><jointpos name="angle" joint="hinge_fore"/></sensor>"""


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("arm")
    text = mjcf(ARM, STEP, "Euler").replace("</worldbody>", SIGNALS)
    inertial = 'diaginertia="0.5 0.5 0.5"/>'
    text = text.replace(inertial, f'{inertial}<site name="grip"/>')
    (folder / "arm.xml").write_text(text)
    for link in ARM.links:
        (folder / f"{link.name}.toml").write_text(
            toml(ARM, link, BAND, 0.02, "[modes]\nxy = 2\nxz = 2\ntorsion = 1\n")
        )
    at = {f"place_{link.name}": folder / f"{link.name}.toml" for link in ARM.links}
    return bc.embed(folder / "arm.xml", at, retime=False)


class Truth:
    """The arm in finite elements with its signals: torques in the elbow and on the hand (in the
    axes of the hand); the elbow's angle, the bus's rate, the motion of the hand."""

    def __init__(self, angle):
        craft, hand = assembled(ARM, {"fore": angle})
        self.mass, self.damping, self.stiffness = craft.matrices()
        size, hand = craft.size, craft.wide(hand.own)
        (self.elbow,) = craft.hinges
        elbow = np.eye(1, size, self.elbow)
        self.inputs = np.vstack([elbow, hand[3:]]).T
        self.position = np.vstack([elbow, np.zeros((3, size)), hand])
        self.rate = np.zeros((10, size))
        self.rate[1:4, 3:6] = np.eye(3)

    def transfer(self, s):
        """`(outputs, inputs, k)` at complex frequencies."""
        return np.stack(
            [
                (self.position + v * self.rate)
                @ np.linalg.solve(v**2 * self.mass + v * self.damping + self.stiffness, self.inputs)
                for v in s
            ],
            -1,
        )

    def held(self, s, step, count=3):
        """The same of inputs held over a step: the sum of the aliases of `G(s) (1 - 1/z)/(s h)`."""
        wheel = 2j * np.pi / step
        return sum(
            self.transfer(s + k * wheel) * (1.0 - np.exp(-s * step)) / ((s + k * wheel) * step)
            for k in range(-count, count + 1)
        )

    def poles(self, locked=False):
        """Damped ones above the real axis, up to three times the band, over the modes up to 600
        times the band (at 60 the damper of the elbow would move them by 2e-5); `locked`: it is
        held."""
        keep = np.delete(np.arange(len(self.mass)), self.elbow if locked else [])
        pick = np.ix_(keep, keep)
        shift = BAND**2  # rigid motions are none of the stiffness matrix
        values, shapes = eigh(self.mass[pick], self.stiffness[pick] + shift * self.mass[pick])
        kept = values > 1.0 / ((600.0 * BAND) ** 2 + shift)
        shapes = shapes[:, kept] / np.sqrt(values[kept])
        stiffness = np.diag(1.0 / values[kept] - shift)
        damping = shapes.T @ self.damping[pick] @ shapes
        n = len(stiffness)
        s = np.linalg.eigvals(np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness, -damping]]))
        return s[(s.imag > 0.05) & (np.abs(s) < 3.0 * BAND)]


def channels(found, true):
    """The largest difference, channel by channel, over the channel's size at each frequency; what
    is nothing beside its row and column is not asked."""
    size = np.abs(true)
    top = size.max((0, 1), keepdims=True)
    rows, columns = size.max(1, keepdims=True), size.max(0, keepdims=True)
    floor = np.maximum(1e-3 * rows * columns / top, 1e-6 * top)
    return float(np.max(np.abs(found - true) / np.maximum(size, floor)))


@pytest.mark.slow
@pytest.mark.parametrize("pose", ["square"])
def test_the_exact_plant_of_an_arm_is_that_of_finite_elements(made, pose):
    plant = bc.plant(made, INPUTS, OUTPUTS, pose=None if pose == "rest" else pose)
    truth = Truth(POSES[pose])
    omega = np.geomspace(0.05, BAND, 25)
    s = omega * (OFF + 1j)
    true = truth.transfer(s)
    found = channels(plant.exact(s, squeeze=False), true)
    kept = np.abs(plant(s, squeeze=False) - true).max(-1) / np.abs(true).max(-1)
    seen = np.abs(true).max(-1) > 1e-6 * np.abs(true).max()
    sys.stdout.write(f"{pose}: exact {found:.1e}, kept modes {kept[seen].max():.1e}\n")
    assert found < EXACT
    assert kept[seen].max() < KEPT
    # what `truncation` says is what finite elements find
    true = truth.transfer(1j * omega)
    left_out = np.abs(plant(1j * omega, squeeze=False) - true) / np.maximum(np.abs(true), 1e-300)
    large = np.abs(true) > 1e-3 * np.abs(true).max((0, 1), keepdims=True)
    assert np.all(np.abs(plant.truncation(omega) - left_out)[large & (left_out < 1.0)] < 1e-4)


def polished(plant, zeros):
    """By Newton's method: the pencil that `control.zeros` takes leaves 3e-6 of rounding in them."""
    for _ in range(4):
        step = 1e-6 * np.abs(zeros)
        here, beyond, before = (
            plant(zeros + k * step, squeeze=False)[0, 0] for k in (0.0, 1.0, -1.0)
        )
        zeros = zeros - 2.0 * step * here / (beyond - before)
    return zeros


@pytest.mark.parametrize("pose", ["square"])
@pytest.mark.slow
def test_poles_and_zeros_from_the_elbow_are_those_of_finite_elements(made, pose):
    plant = bc.plant(made, ["elbow"], ["angle"], pose=None if pose == "rest" else pose).exact
    truth = Truth(POSES[pose])
    # with the elbow held nothing moves it: zeros of the torque in it to its angle
    for true, found in (
        (truth.poles(), plant.poles()),
        (truth.poles(locked=True), control.zeros(plant)),
    ):
        places = found[(found.imag > 0.05) & (np.abs(found) < 3.0 * BAND)]
        if found.size < plant.nstates:
            places = polished(plant, places)
        # the truth has the modes that the elbow does not move, too
        miss = np.abs(true[:, None] / places - 1.0).min(axis=0)
        sys.stdout.write(f"{pose}: {places.size} places, {miss.max():.1e}\n")
        assert places.size >= 3
        assert miss.max() < PLACES


@pytest.mark.slow
@pytest.mark.parametrize("pose", ["rest"])
def test_the_sampled_plant_is_the_arm_under_a_held_torque(made, pose):
    at = None if pose == "rest" else pose
    plant = bc.plant(made, ["elbow"], ["angle"], pose=at, discrete=STEP)
    s = np.geomspace(0.05, BAND, 25) * (OFF + 1j)
    true = Truth(POSES[pose]).held(s, STEP)[:1, :1]
    found = np.abs(plant(np.exp(s * STEP), squeeze=False) - true).max() / np.abs(true).max()
    each = channels(plant(np.exp(s * STEP), squeeze=False), true)
    sys.stdout.write(f"{pose}: {found:.1e} of the largest, {each:.1e} at each frequency\n")
    assert each < SAMPLED


@pytest.mark.slow
def test_the_sampled_plant_of_an_arm_is_what_mujoco_runs(made):
    plant = bc.plant(made, ["elbow"], ["angle", "rate"], pose="square", discrete=STEP)
    model = copy.copy(made.model)
    bc.retime(model, STEP)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("square").id)
    given = 1e-3 * np.random.default_rng(3).standard_normal((1, 400))
    held_input = bc.HeldInput()
    seen = []
    for u in given.T:
        seen.append([data.joint("hinge_fore").qpos[0] - POSES["square"], *data.qvel[3:6]])
        data.ctrl[:] = held_input(u)
        mujoco.mj_step(model, data)
    said = control.forced_response(plant, U=given).outputs
    error = np.abs(said - np.array(seen).T).max(axis=1) / np.abs(said).max(axis=1).clip(1e-12)
    sys.stdout.write(f"{error[[0, 3]].max():.1e}\n")
    assert error[[0, 3]].max() < RUN
