"""The same scenario in Basilisk: nHingedRigidBody, n identical panels with a hinge each, RK4.

Run: python tests/benchmarks/peers/basilisk_peer.py build/peers/basilisk.json
"""

import sys
import time
from pathlib import Path

import numpy as np
from Basilisk.simulation import (
    extForceTorque,
    nHingedRigidBodyStateEffector,
    spacecraft,
    svIntegrators,
)
from Basilisk.utilities import SimulationBaseClass, macros
from task import ARM, BENDING, END, HALF, LENGTH, MASS, MOMENT, TASK, Peer, measure, write


def panels(n: int) -> Peer:
    """Half-length root spring 2 EI n / L, EI n / L between panels:
    the recipe that one hinge per panel allows."""

    def run(h: float, record: bool):
        simulation = SimulationBaseClass.SimBaseClass()
        process = simulation.CreateNewProcess("dynamics")
        process.addTask(simulation.CreateNewTask("task", macros.sec2nano(h)))
        craft = spacecraft.Spacecraft()
        craft.ModelTag = "craft"
        craft.hub.mHub = TASK.hub.mass
        craft.hub.r_BcB_B = [[0.0], [0.0], [0.0]]
        craft.hub.IHubPntBc_B = np.diag(TASK.hub.inertia).tolist()
        wing = nHingedRigidBodyStateEffector.NHingedRigidBodyStateEffector()
        wing.ModelTag = "wing"
        # the panel's frame: -s1 points outwards, hinges turn about s2
        wing.r_HB_B = [[ARM], [0.0], [0.0]]
        wing.dcm_HB = [[-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]]
        piece = LENGTH / n
        for i in range(n):
            panel = nHingedRigidBodyStateEffector.HingedPanel()
            panel.mass = MASS / n
            panel.IPntS_S = np.diag(
                [1e-6, MASS / n * piece**2 / 12.0, MASS / n * piece**2 / 12.0]
            ).tolist()
            panel.d = piece / 2.0
            panel.k = (2.0 if i == 0 else 1.0) * BENDING * n / LENGTH
            panel.c = 0.0
            panel.thetaInit = panel.thetaDotInit = 0.0
            wing.addHingedPanel(panel)
        craft.addStateEffector(wing)
        torque = extForceTorque.ExtForceTorque()
        craft.addDynamicEffector(torque)
        craft.setIntegrator(svIntegrators.svIntegratorRK4(craft))
        simulation.AddModelToTask("task", torque)
        simulation.AddModelToTask("task", craft)
        log = craft.scStateOutMsg.recorder() if record else None
        if log is not None:
            simulation.AddModelToTask("task", log)
        simulation.InitializeSimulation()
        seconds = 0.0
        for moment, until in ((MOMENT, HALF), (-MOMENT, 2.0 * HALF), (0.0, END)):
            torque.extTorquePntB_B = [[0.0], [0.0], [moment]]
            simulation.ConfigureStopTime(macros.sec2nano(until))
            start = time.process_time()  # it runs its tasks on a thread of its own
            simulation.ExecuteSimulation()
            seconds += time.process_time() - start
        if log is None:
            return None, seconds
        sigma = np.asarray(log.sigma_BN)[:, 2]
        return 4.0 * np.arctan(sigma)[1:], seconds

    return Peer("Basilisk nHinged", n, "RK4", run, "identical panels only")


def main(path: Path) -> None:
    peers = [panels(n) for n in (2, 3, 5, 7, 10)]
    # in units of sqrt(EI / m L^3), on a heavy hub
    fastest = {n: 5.5 * n**2 for n in (2, 3, 5, 7, 10)}
    unit = np.sqrt(BENDING / (MASS * LENGTH**3))
    points = measure(
        peers,
        2.0,
        rungs=4,
        limits={f"Basilisk nHinged {n}": 2.6 / (w * unit) for n, w in fastest.items()},
    )
    write(points, path)
    for p in points:
        print(
            f"{p['model']:18} n={p['n']} h={p['timestep']:.4g} error {p['error']:.2e} "
            f"{1e3 * p['seconds']:.3f} ms"
        )


if __name__ == "__main__":
    main(Path(sys.argv[1]))
