"""What a command says first: its figures beside those of the results, how much is said, and what
comes first."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

import beamchain as bc
from beamchain.craft.coupled_modes import Mode
from beamchain.report.tables.embed import coupled_table
from beamchain.report.tables.first_screen import (
    embedded_lines,
    embedded_tiles,
    fit_lines,
    fit_tiles,
    margin_lines,
    plant_lines,
    plant_tiles,
)

WIDTH, MOST = 80, 12  # characters of a line, lines of the first screen
CRAFT = """<mujoco><option gravity="0 0 0" timestep="0.01"/><worldbody><body name="bus"><freejoint/>
<inertial pos="0 0 0" mass="300" diaginertia="100 120 150"/><site name="left" pos="0.6 0 0"/>
<site name="right" pos="-0.6 0 0" euler="0 0 180"/></body></worldbody></mujoco>"""


def boom(tolerance=1e-3):
    section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
    return bc.Spec(
        name="boom",
        segment=(bc.Segment(length=8.0, section=section),),
        scene=bc.Scene(bandwidth=5.0, tolerance=tolerance, axes=("z",)),
    )


def rows(lines):
    """Lines of a terminal that they take."""
    return sum(math.ceil(len(line) / WIDTH) for line in lines)


def test_a_fit_says_what_it_is_what_was_reached_and_the_largest_step():
    fit = bc.fit(boom())
    first, *more = fit_lines(fit)
    # mu L = 32 kg, and 1.875104^2 sqrt(EI / mu L^4) = 1.2285 rad/s
    assert first.startswith("boom: 8 m, 32 kg, first frequency 1.23 rad/s (0.196 Hz); kept: ")
    assert f"{fit.promise:.2e}, within the tolerance 0.001" in more[0]
    assert more[-1].startswith("largest stable step: ")
    assert rows([first, *more]) <= MOST - 4  # notes, files and what comes next
    tiles = fit_tiles(fit)
    assert [value for value, _ in tiles][::2] == [
        f"{fit.promise:.2e}",
        f"{len(fit.chain.links)} links",
    ]


def test_a_craft_says_its_error_and_what_hangs_on_it():
    craft = bc.embed(CRAFT, {"left": boom(), "right": boom()})
    lines = list(embedded_lines(craft))
    assert f"{craft.craft_error:.2e}" in lines[0]
    assert "bus with all that it carries: 364 kg" in lines
    assert [line.split(":")[0] for line in lines if "32 kg" in line] == ["left", "right"]
    assert rows(lines) <= MOST - 2
    alike, opposed = (line for line in lines if line.startswith("  "))
    assert alike.endswith("left and right in phase, bending xy; bus along y")
    assert opposed.endswith("left and right opposed, bending xy; bus about z")
    twin = list(embedded_lines(bc.embed(CRAFT, {"left": boom()}, rigid=True)))
    assert twin[0].startswith("rigid twin: ")
    assert twin[-1].endswith("kept: none")
    slow = bc.Spec(name="boom", segment=boom().segment, scene=bc.Scene(bandwidth=0.01))
    assert not any("Hz): " in line for line in embedded_lines(bc.embed(CRAFT, {"left": slow})))
    added = craft.model.nv - craft.craft.nv
    assert embedded_tiles(craft)[-1][0] == f"{added} degrees of freedom"


def test_a_mode_that_only_the_chain_has_stands_for_no_exact_one():
    """A light boom with a body at its tip keeps one mode about z; its chain's own lies at 12 rad/s,
    twice the band, far from the boom's mode out of the plane."""
    section = bc.Equivalent(bending_stiffness_xy=2780.0, linear_mass=0.07)
    body = bc.Lump(x=7.0, mass=2.3, inertia=(0.01, 0.012, 0.014))
    scene = bc.Scene(bandwidth=6.0, axes=("z",))
    segment = bc.Segment(length=7.0, section=section)
    spec = bc.Spec(name="light", segment=(segment,), lump=(body,), scene=scene)
    craft = bc.embed(CRAFT.replace('pos="0.6 0 0"', 'pos="0.7 0 0.3"'), {"left": spec})
    (own,) = (mode for mode in craft.assembly.modes if mode.exact is None)
    assert own.mujoco == pytest.approx(12.0, rel=1e-3)
    (told,) = (line for line in embedded_lines(craft) if line.startswith("  "))
    assert "bending xy" in told


def loop(name, disk, stable=True):
    at = {"gain_db": 6.02, "gain_frequency": 3.0, "phase": 45.0, "phase_frequency": 2.0}
    return SimpleNamespace(name=name, disk=disk, stable=stable, delay=math.inf, **at)


def test_unstable_loops_come_first_then_the_smallest_margins():
    of_pose = [
        SimpleNamespace(pose="rest", loops=[loop("a", 1.2), loop("b", math.nan, stable=False)]),
        SimpleNamespace(pose="", loops=[loop("c", 0.4), loop("d", 2.0)]),
    ]
    said = list(margin_lines(of_pose))
    assert said[0] == "rest: b: unstable"
    assert said[1] == (
        "c: gain margin 6.02 dB at 3 rad/s, phase margin 45 degrees at 2 rad/s, delay margin "
        "without limit"
    )
    assert [line.split(":")[-2].split()[-1] for line in said[1:]] == ["c", "a", "d"]
    assert next(words for _, words in plant_tiles(None, of_pose)) == "rest: b"
    many = [SimpleNamespace(pose="", loops=[loop(str(k), k / 9.0) for k in range(9)])]
    assert [line.split(":")[0] for line in margin_lines(many)][:6] == list("012345")
    assert list(margin_lines(many))[6:] == ["and 3 loops with larger margins"]


def test_a_plant_says_its_size():
    names = [f"torque_{k}" for k in range(8)]
    plant = SimpleNamespace(
        input_names=names,
        output_names=names[:2],
        nstates=10,
        modes=["one", "two"],
        frequency=np.array([3.0, 12.0]),
        damping_ratio=np.array([0.01, 0.002]),
    )
    first, second = plant_lines(plant)
    assert first.endswith("torque_5 and 2 more; outputs: torque_0, torque_1")
    assert second == "2 flexible modes: 3 to 12 rad/s, damping ratios 0.002 to 0.01"
    plant.modes = []
    assert list(plant_lines(plant))[1] == "no flexible modes"
    assert plant_tiles(plant, []) == [("10", "states"), ("0", "flexible modes")]


@pytest.mark.parametrize(("band", "shown"), [(1.0, 2), (2.0, 4), (0.1, 1)])
def test_coupled_modes_are_listed_up_to_ten_times_the_band(band, shown):
    modes = (
        Mode(0.9, 0.9, kept=True),
        Mode(9.9, None, kept=False),
        Mode(None, 10.1, kept=True),
        Mode(19.0, 19.0, kept=True),
    )
    table = coupled_table(SimpleNamespace(modes=modes, band=band))
    assert len(table.rows) == shown
    told = [note for note in table.notes if "more lie above" in note]
    assert told == ([] if shown == 4 else [f"{4 - shown} more lie above {10 * band:g} rad/s."])
