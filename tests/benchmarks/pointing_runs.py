"""Pointing budgets beside MuJoCo: wheels that carry masses off their axis, at the speed of the
largest stated error; and the time of a budget of four wheels with nine orders each.

Run by hand.
"""

import sys
import time
from importlib.resources import files
from pathlib import Path

import beamchain as bc
from beamchain import pointing

sys.path.insert(0, str(Path(__file__).parent.parent / "support"))
sys.path.insert(0, str(Path(__file__).parent.parent / "pointing"))
from unbalanced_wheel import (
    BEAM,
    CRAFT,
    PLACES,
    budget_of,
    simulated_amplitude,
    unbalanced,
)

ORDERS = (2.0, 2.82, 3.0, 4.5, 5.2, 5.6, 6.1, 7.4)
TURNED = ((35, 0), (-35, 0), (0, 35), (0, -35))  # degrees about x and y


def unbalanced_wheels() -> None:
    """Stated amplitude and those of two runs."""
    craft = bc.embed(CRAFT, {"mount": BEAM})
    print("imbalance   speed, rad/s   stated, rad   masses on the wheel   forces on the wheel")
    for kind in sorted(PLACES):
        budget = budget_of(craft, kind)
        worst = max(budget.worst, key=lambda error: error.peak)
        plant = bc.plant(craft, ["torque:bus"], ["attitude"], rates={"rw": worst.speed})
        number = plant.modes.index(worst.mode)
        settling = 1.0 / float(plant.frequency[number] * plant.damping_ratio[number])
        axis = "xyz".index(worst.output[-1])
        found, _ = simulated_amplitude(unbalanced(craft, kind), worst.speed, axis, settling, 0.015)
        off = found / worst.peak - 1.0
        forces = budget.simulate().difference
        print(f"{kind:10}  {worst.speed:12.5g}   {worst.peak:11.4g}   {off:19.2%}   {forces:19.2%}")


def four_wheels() -> None:
    """Seconds of processor time of a budget."""
    shipped = files("beamchain") / "examples"
    wheels = "".join(
        f'<body name="rw{i}" pos="0 0 -0.4" euler="{x} {y} 0"><joint name="rw{i}" axis="0 0 1"/>'
        '<inertial pos="0 0 0" mass="7" diaginertia="0.03 0.03 0.05"/></body>'
        for i, (x, y) in enumerate(TURNED)
    )
    text = (shipped / "satellite.xml").read_text()
    end = text.rindex("</body>", 0, text.index("</worldbody>"))
    array = shipped / "array.toml"
    craft = bc.embed(text[:end] + wheels + text[end:], {"left": array, "right": array})
    harmonics = tuple(
        pointing.WheelHarmonic(order=order, radial_force=3e-8, radial_torque=1e-9)
        for order in ORDERS
    )
    given = pointing.Disturbances(
        wheel=tuple(
            pointing.WheelDisturbance(
                joint=f"rw{i}", speeds=(2.0, 600.0), static=7e-7, dynamic=2e-8, harmonic=harmonics
            )
            for i in range(4)
        )
    )
    start = time.process_time()
    budget = pointing.budget(craft, given)
    spent = time.process_time() - start
    speeds = sum(source.curve.speed.size for source in budget.sources if source.curve)
    print(f"four wheels, {len(ORDERS) + 1} orders, {speeds} speeds: {spent:.1f} s")


unbalanced_wheels()
four_wheels()
