"""One result used by many threads, and threads that import and call at once as the first thing."""

import json
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor

import matplotlib as mpl
import mujoco
import pytest

import beamchain as bc

THREADS = 8
CRAFT = """<mujoco><option gravity="0 0 0" timestep="0.05" integrator="implicitfast"/><worldbody>
<body name="bus"><freejoint/>
<inertial pos="0 0 0" mass="300" diaginertia="90 90 90"/><site name="mount" pos="0.5 0 0"/></body>
</worldbody></mujoco>"""
FIRST = f"""
import threading
CRAFT = '''{CRAFT}'''
gate, wrong = threading.Barrier({THREADS}), []

def work(number):
    gate.wait()
    try:
        import beamchain as bc
        section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
        spec = bc.Spec(segment=(bc.Segment(length=8.0, section=section),), modes=bc.Modes(xy=1))
        if number % 3 == 0:
            bc.fit(spec).as_dict()
        elif number % 3 == 1:
            bc.embed(CRAFT, {{"mount": spec}}).report()
        else:
            bc.plant(bc.embed(CRAFT, {{"mount": spec}}), ["torque:bus"]).truncation([1.0])
    except BaseException as error:
        wrong.append(repr(error))

threads = [threading.Thread(target=work, args=(k,)) for k in range({THREADS})]
[thread.start() for thread in threads]
[thread.join() for thread in threads]
assert not wrong, wrong
"""


def embedded():
    section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
    spec = bc.Spec(segment=(bc.Segment(length=8.0, section=section),), modes=bc.Modes(xy=2))
    return bc.embed(CRAFT, {"mount": spec})


def at_once(function):
    gate = threading.Barrier(THREADS)

    def started(number):
        gate.wait()
        return function(number)

    with ThreadPoolExecutor(THREADS) as pool:
        return list(pool.map(started, range(THREADS)))


@pytest.mark.slow
def test_records_of_one_craft_are_alike():
    def record(made):
        return json.dumps(made.as_dict(), default=lambda values: values.tolist())

    true = record(embedded())
    made = embedded()
    assert at_once(lambda _: record(made)) == [true] * THREADS


@pytest.mark.slow
def test_reports_of_one_craft_are_alike():
    """Every thread reads the same step limits of "discrete" from the shared model,
    and draws the same pictures."""
    true = embedded().report()
    made = embedded()
    style = dict(mpl.rcParams)
    assert at_once(lambda _: made.report()) == [true] * THREADS
    assert dict(mpl.rcParams) == style


@pytest.mark.slow
def test_linearise_leaves_the_model_alone():
    """While threads linearise, the one model that they share keeps its integrator."""
    model = embedded().model
    integrator = int(model.opt.integrator)
    seen = set()
    stop = threading.Event()

    def watch():
        while not stop.is_set():
            seen.add(int(model.opt.integrator))

    assert integrator == int(mujoco.mjtIntegrator.mjINT_IMPLICITFAST)
    model.opt.integrator = integrator = int(mujoco.mjtIntegrator.mjINT_EULER)
    watcher = threading.Thread(target=watch)
    watcher.start()
    found = at_once(lambda _: bc.linearise(model, mujoco.MjData(model)))
    stop.set()
    watcher.join()
    assert seen == {integrator}
    assert all((one.a == found[0].a).all() and one.integrator == "Euler" for one in found)


@pytest.mark.slow
def test_threads_that_import_first():
    done = subprocess.run(
        [sys.executable, "-X", "faulthandler", "-c", FIRST],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
