"""What the worst case of a loop states: where an unstable one begins to ring, in words, in JSON and
on the page; its run in MuJoCo; and what it no longer states.

`RINGS`: the loop's response at the stated frequency is -1 on the way to the unstable values; dead
times are Pade approximations in one of the two, to 1e-6 at these frequencies. `PEAK`: of a peak in
MuJoCo; the run is as long as leaves 2 % of any difference from the prediction unseen.
"""

import re

import control
import mujoco
import numpy as np
import pytest
from scipy.optimize import minimize_scalar

import beamchain as bc
from beamchain import robust
from command import run

RINGS, PEAK = 1e-4, 0.01
UNDRIVEN = 1e-4  # rad/s: what is slower is a motion that the loop does not drive
CRAFT = """<mujoco model="craft"><option gravity="0 0 0"/><worldbody><body name="bus"><freejoint/>
<inertial pos="0 0 0" mass="300" diaginertia="90 80 70"/><site name="mount" pos="0.5 0 0"/>{}</body>
</worldbody>{}</mujoco>"""
WHEEL = """<body name="rotor" pos="0 0 0.2"><joint name="wheel" axis="0 0 1"{}/>
<inertial pos="0 0 0" mass="5" diaginertia="0.02 0.02 0.03"/></body>"""
SENSOR = '<sensor><accelerometer name="tip" site="mount"/></sensor>'
UNCERTAIN = (
    '[appendage.boom_]\nfrequency = {{ relative = {}, distribution = "uniform", each = true }}\n'
)
TOP, BOTTOM, DELAY = [200.0, 300.0], [0.05, 1.0], 0.1
LOOP = f"""[[loop]]
input = "torque_{{axis}}"
output = "attitude_{{axis}}"
numerator = {TOP}
denominator = {BOTTOM}
delay = {{delay}}
"""


def uncertain_plant(
    folder, spread, delay=DELAY, axes="z", body="", sensor="", outputs=(), damping=0.003, **options
):
    """A boom whose modes move by so much, and a loop that some of its values make unstable
    where `spread` is 0.15."""
    section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
    spec = bc.Spec(
        name="boom",
        segment=(bc.Segment(length=8.0, section=section),),
        modes=bc.Modes(xy=2),
        damping=bc.Damping(ratio=damping),
        fit=bc.spec.FitOptions(springs="modes"),
    )
    (folder / "loop.toml").write_text("".join(LOOP.format(axis=axis, delay=delay) for axis in axes))
    (folder / "uncertain.toml").write_text(UNCERTAIN.format(spread))
    embedded = bc.embed(CRAFT.format(body, sensor), {"mount": spec})
    embedded.write(folder / "flexible.xml", force=True)
    plant = bc.plant(embedded, ["torque:bus"], ["attitude", *outputs], **options)
    return robust.uncertain(plant, folder / "uncertain.toml")


def distance(uncertain, share, deltas, omega):
    """|1 + K G| at a frequency, of the plant that lies at a share of the way to deltas."""
    s = 1j * omega
    plant = uncertain.sample(share * deltas)
    row = plant.output_labels.index("attitude_z")
    column = plant.input_labels.index("torque_z")
    loop = np.polyval(TOP, s) / np.polyval(BOTTOM, s) * np.exp(-DELAY * s)
    return abs(1.0 + loop * np.asarray(plant(s))[row, column])


def stable(uncertain, deltas):
    """Whether `control` finds the loop stable."""
    plant = uncertain.sample(deltas)["attitude_z", "torque_z"]
    loop = control.tf(TOP, BOTTOM) * control.tf(*control.pade(DELAY, 6))
    poles = control.feedback(control.ss(plant), loop).poles()
    turning = np.abs(poles) > UNDRIVEN
    return poles[turning].real.max() < 1e-9


def test_an_unstable_loop_begins_to_ring_at_the_stated_frequency(tmp_path):
    uncertain = uncertain_plant(tmp_path, 0.15)
    worst = uncertain.worst_case(tmp_path / "loop.toml", samples=5)
    assert not worst.stable
    assert np.isnan(worst.simulated)
    assert f"the loop begins to ring at {worst.frequency:.4g} rad/s" in worst.sentence
    assert "on the way to them from the nominal ones" in worst.sentence
    limit = minimize_scalar(
        lambda share: distance(uncertain, share, worst.deltas, worst.frequency),
        bounds=(0.0, 1.0),
        method="bounded",
        options={"xatol": 1e-10},
    )
    assert limit.fun < RINGS
    assert stable(uncertain, 0.99 * limit.x * worst.deltas)
    assert not stable(uncertain, min(1.01 * limit.x, 1.0) * worst.deltas)
    assert worst.as_dict()["gain"] is None
    assert worst.as_dict()["frequency"] == worst.frequency


@pytest.mark.slow
def test_the_command_and_the_page_say_where_it_begins_to_ring(tmp_path, capsys, monkeypatch):
    uncertain_plant(tmp_path, 0.15)
    words = ["worst-case", tmp_path / "flexible.xml", "--from", "torque:bus"]
    words += ["--to", "attitude"]
    words += ["--controller", tmp_path / "loop.toml", "--uncertain", tmp_path / "uncertain.toml"]
    words = [str(word) for word in [*words, "-o", tmp_path / "worst.html"]]
    status, out, err = run(words, capsys, monkeypatch)
    assert status == 3, err
    (said,) = re.findall(r"the loop begins to ring at ([\d.]+) rad/s", " ".join(out.split()))
    page = " ".join((tmp_path / "worst.html").read_text(encoding="utf-8").split())
    assert "at which the loop begins to ring" in page
    assert said in page


@pytest.mark.parametrize(
    ("output", "options"),
    [
        (
            "tip_y",
            {"sensor": SENSOR, "outputs": ["tip"], "damping": 0.02},
        ),  # reads the torque at once
        ("attitude_z", {"body": WHEEL.format(""), "rates": {"wheel": 300.0}, "axes": "zxy"}),
        ("attitude_z", {"body": WHEEL.format(' stiffness="4e2" damping="2"')}),  # fast and stiff
    ],
)
@pytest.mark.slow
def test_the_worst_sample_runs_in_mujoco(output, options, tmp_path):
    uncertain = uncertain_plant(tmp_path, 0.01, **options)
    worst = uncertain.worst_case(tmp_path / "loop.toml", "torque_z", output, samples=5)
    assert abs(worst.simulated / worst.gain - 1.0) < PEAK
    assert f"{worst.simulated:.4g} in MuJoCo" in worst.sentence


@pytest.mark.slow
def test_a_run_that_would_take_too_long_is_left_out(tmp_path):
    stiff = WHEEL.format(' stiffness="4e8" damping="400"')
    uncertain = uncertain_plant(tmp_path, 0.01, body=stiff)
    worst = uncertain.worst_case(tmp_path / "loop.toml", samples=5)
    assert worst.stable
    assert np.isnan(worst.simulated)
    assert worst.as_dict()["simulated"] is None
    assert "MuJoCo" not in worst.sentence


SPRUNG = """<mujoco><option gravity="0 0 0"/><worldbody><body name="bus">
<joint name="drive" axis="0 0 1" stiffness="20" damping="6"/>
<inertial pos="0 0 0" mass="1" diaginertia="5 5 5"/></body></worldbody></mujoco>"""
ROTOR = """<body name="rotor"><joint name="drive" axis="0 0 1" stiffness="12" damping="0.04"/>
<inertial pos="0 0 0" mass="5" diaginertia="1 1 2"/></body>"""


def with_uncertain_drive(text):
    plant = bc.plant(mujoco.MjModel.from_xml_string(text), ["torque:bus"], ["attitude"])
    third = bc.spec.Uncertainty(relative=0.3, distribution="uniform")
    return robust.uncertain(
        plant, bc.spec.UncertainCraft(joint={"drive": bc.spec.UncertainJoint(stiffness=third)})
    )


def controller(axes, top, bottom):
    return bc.spec.Controller(
        loop=tuple(
            bc.spec.Loop(
                input=f"torque_{a}", output=f"attitude_{a}", numerator=top, denominator=bottom
            )
            for a in axes
        )
    )


@pytest.mark.parametrize("options", [{}, {"bound": True}, {"omega": [1.0, 2.0]}])
def test_a_loop_that_drifts_away_does_not_ring(options):
    """A push of 18 N m/rad along, which a spring of 14 to 26 N m/rad holds or does not."""
    uncertain = with_uncertain_drive(SPRUNG)
    push = controller("z", (-18.0,), (1.0,))
    worst = uncertain.worst_case(push, samples=0, **options)  # corners alone
    assert not worst.stable
    assert (worst.input, worst.output) == ("torque_z", "attitude_z")
    assert worst.unit == "rad per N m"
    assert 14.0 <= worst.values["drive.stiffness"] < 18.0
    assert worst.frequency == 0.0
    assert worst.bound is None
    assert worst.sentence.endswith("the loop begins to drift away")
    assert worst.omega.min() > 0.0
    s = 1j * worst.omega
    assert worst.nominal == pytest.approx(abs(1.0 / (5.0 * s**2 + 6.0 * s + 2.0)), rel=1e-9)
    worst.plot()


@pytest.mark.slow
def test_an_output_that_the_input_does_not_move_is_refused():
    """The axes of a craft without products of inertia do not know of each other."""
    uncertain = with_uncertain_drive(CRAFT.format(ROTOR, ""))
    loops = controller("xyz", (80.0, 30.0), (0.05, 1.0))
    assert uncertain.worst_case(loops, "torque_z", "attitude_z", simulate=False).stable
    with pytest.raises(bc.InputError, match="'torque_z' .*'attitude_x'"):
        uncertain.worst_case(loops, "torque_z", "attitude_x")
