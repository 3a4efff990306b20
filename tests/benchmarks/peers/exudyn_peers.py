"""The same scenario in Exudyn: modal (linear), floating frame with component modes (3-D),
ANCF cables (2-D).

Run: python tests/benchmarks/peers/exudyn_peers.py build/peers/exudyn.json
"""

import sys
import time
from itertools import pairwise
from pathlib import Path

import exudyn as exu
import numpy as np
from exudyn import itemInterface as item  # noqa: N813
from exudyn.FEM import FEMinterface, ObjectFFRFreducedOrderInterface
from scipy.linalg import eigh
from scipy.sparse import csr_matrix
from task import ARM, AXIAL, BENDING, END, HALF, LENGTH, MASS, MOMENT, TASK, Peer, measure, write

# of the lumped beam behind the component modes: its own error is far below the modes' truncation
POINTS = 900
# the cables are pushed harder, still linear to 1e-7: Newton stalls at 2e-9 N m of rounding in EA
LARGER = 100.0
HUB_MASS = TASK.hub.mass
HUB_INERTIA = float(TASK.hub.inertia[2])


def settings(steps: int, end: float, record: bool) -> exu.SimulationSettings:
    out = exu.SimulationSettings()
    out.timeIntegration.numberOfSteps = steps
    out.timeIntegration.startTime = 0.0
    out.timeIntegration.endTime = end
    out.timeIntegration.verboseMode = 0
    out.solutionSettings.writeSolutionToFile = False
    out.solutionSettings.sensorsWritePeriod = end / steps * 0.999 if record else 1e9
    out.displayStatistics = False
    out.displayComputationTime = False
    return out


class Explicit:
    """Runs an assembled system with RK44, the torque switched between three stretches;
    only the steps are timed."""

    solver = exu.MainSolverExplicit

    def configure(self, given) -> None:
        given.timeIntegration.explicitIntegration.dynamicSolverType = exu.DynamicSolverType.RK44
        given.timeIntegration.explicitIntegration.computeEndOfStepAccelerations = False
        given.timeIntegration.explicitIntegration.useLieGroupIntegration = False

    def __init__(self, mbs, loads, sensor, angle):
        self.mbs, self.loads, self.sensor, self.angle = mbs, loads, sensor, angle
        self.start = mbs.systemData.GetSystemState()

    def __call__(self, h: float, record: bool):
        mbs = self.mbs
        mbs.systemData.SetSystemState(self.start, configuration=exu.ConfigurationType.Initial)
        out, seconds = [], 0.0
        for sign, length in ((1.0, HALF), (-1.0, HALF), (0.0, END - 2.0 * HALF)):
            for load, unit in self.loads:
                if np.ndim(unit):
                    mbs.SetLoadParameter(load, "loadVector", list(sign * MOMENT * np.asarray(unit)))
                else:
                    mbs.SetLoadParameter(load, "load", sign * MOMENT * unit)
            given = settings(round(length / h), length, record)
            given.timeIntegration.automaticStepSize = given.timeIntegration.adaptiveStep = False
            self.configure(given)
            solver = self.solver()
            if not solver.InitializeSolver(mbs, given):
                return None, seconds
            begin = time.thread_time()
            good = solver.SolveSystem(mbs, given)
            seconds += time.thread_time() - begin
            solver.FinalizeSolver(mbs, given)
            if not good:
                return None, seconds
            if record:
                stored = mbs.GetSensorStoredData(self.sensor)
                out.append(
                    self.angle(stored[1:] if stored.shape[0] == round(length / h) + 1 else stored)
                )
            state = mbs.systemData.GetSystemState()
            mbs.systemData.SetSystemState(state, configuration=exu.ConfigurationType.Initial)
        return (np.concatenate(out) if record else None), seconds


class Implicit(Explicit):
    """The same with the generalised-alpha solver,
    linear solver and tolerances as a careful user would set them."""

    solver = exu.MainSolverImplicitSecondOrder

    def configure(self, given) -> None:
        given.timeIntegration.generalizedAlpha.spectralRadius = 1.0
        given.timeIntegration.newton.useModifiedNewton = True
        given.timeIntegration.newton.relativeTolerance = 1e-5
        # rounding of the stretching stiffness leaves 2e-9
        given.timeIntegration.newton.absoluteTolerance = 1e-8
        given.linearSolverType = exu.LinearSolverType.EigenSparse


def modal(n: int) -> Peer:
    """The first coupled modes as one linear object: no large motion."""
    response = TASK.full["xy"].with_hub(TASK.hub.mass_matrix()[np.ix_([1, 5], [1, 5])])
    rigid = np.linalg.inv(response.rigid_mass)[1, 1]
    w = response.free_frequencies[:n]
    values = np.concatenate([[np.sqrt(rigid)], response.free_port_values[:n, 1]])
    mbs = exu.SystemContainer().AddSystem()
    rest = [0.0] * (n + 1)
    node = mbs.AddNode(
        item.NodeGenericODE2(
            referenceCoordinates=rest,
            initialCoordinates=rest,
            initialCoordinates_t=rest,
            numberOfODE2Coordinates=n + 1,
        )
    )
    mbs.AddObject(
        item.ObjectGenericODE2(
            nodeNumbers=[node], massMatrix=np.eye(n + 1), stiffnessMatrix=np.diag([0.0, *w**2])
        )
    )
    loads = []
    for i, value in enumerate(values):
        marker = mbs.AddMarker(item.MarkerNodeCoordinate(nodeNumber=node, coordinate=i))
        loads.append(
            (mbs.AddLoad(item.LoadCoordinate(markerNumber=marker, load=0.0)), float(value))
        )
    sensor = mbs.AddSensor(
        item.SensorNode(
            nodeNumber=node,
            storeInternal=True,
            outputVariableType=exu.OutputVariableType.Coordinates,
        )
    )
    mbs.Assemble()
    return Peer(
        "Exudyn modal",
        n,
        "RK44",
        Explicit(mbs, loads, sensor, lambda s: s[:, 1:] @ values),
        "linear only",
    )


def lumped() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Point masses along the beam: x `(p,)`, masses,
    cantilever frequencies and deflections per mode."""
    x = (np.arange(POINTS) + 0.5) * LENGTH / POINTS
    mass = np.full(POINTS, MASS / POINTS)
    a = np.minimum.outer(x, x)
    b = np.maximum.outer(x, x)
    flexibility = a**2 * (3.0 * b - a) / (6.0 * BENDING)
    root = np.sqrt(mass)
    values, vectors = eigh(root[:, None] * flexibility * root)
    return x, mass, 1.0 / np.sqrt(values[::-1]), vectors[:, ::-1] / root[:, None]


def floating(n: int) -> Peer:
    """Floating frame on the hub with n cantilever modes: large motion, three dimensions."""
    x, mass, w, shapes = lumped()
    # six points with the hub's mass and inertia (all three equal)
    reach = np.sqrt(1.5 * HUB_INERTIA / HUB_MASS)
    hub = reach * np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])
    along = np.column_stack([ARM + x, np.zeros(POINTS), np.zeros(POINTS)])
    places = np.vstack([hub, along])
    weights = np.concatenate([np.full(6, HUB_MASS / 6.0), mass])
    basis = np.zeros((3 * len(places), n))
    basis[3 * 6 + 1 :: 3] = shapes[:, :n]
    stiffness = basis @ np.diag(w[:n] ** 2) @ basis.T  # only its projection on the modes is used
    weight3 = np.repeat(weights, 3)
    scaled = weight3[:, None] * stiffness * weight3
    fem = FEMinterface()
    fem.nodes = {"Position": places}
    fem.massMatrix = csr_matrix(np.diag(weight3))
    fem.stiffnessMatrix = csr_matrix(scaled)
    fem.modeBasis = {"matrix": basis, "type": "NormalModes"}
    fem.elements = []
    fem.surface = []
    cms = ObjectFFRFreducedOrderInterface(fem, rigidBodyNodeType="NodeType.RotationRxyz")
    mbs = exu.SystemContainer().AddSystem()
    made = cms.AddObjectFFRFreducedOrder(mbs, positionRef=[0, 0, 0])
    node = made["nRigidBody"]
    marker = mbs.AddMarker(item.MarkerNodeRigid(nodeNumber=node))
    load = mbs.AddLoad(item.LoadTorqueVector(markerNumber=marker, loadVector=[0, 0, 0]))
    sensor = mbs.AddSensor(
        item.SensorNode(
            nodeNumber=node, storeInternal=True, outputVariableType=exu.OutputVariableType.Rotation
        )
    )
    mbs.Assemble()
    return Peer(
        "Exudyn FFRF",
        n,
        "RK44",
        Explicit(mbs, [(load, (0.0, 0.0, 1.0))], sensor, lambda s: s[:, 3]),
        "3-D",
    )


def cables(n: int) -> Peer:
    """ANCF cables clamped to a planar hub, generalised alpha (spectral radius 1): large motion,
    in the plane."""
    mbs = exu.SystemContainer().AddSystem()
    body = mbs.AddNode(item.NodeRigidBody2D(referenceCoordinates=[0, 0, 0]))
    hub = mbs.AddObject(
        item.ObjectRigidBody2D(physicsMass=HUB_MASS, physicsInertia=HUB_INERTIA, nodeNumber=body)
    )
    x = ARM + np.linspace(0.0, LENGTH, n + 1)
    nodes = [
        mbs.AddNode(item.NodePoint2DSlope1(referenceCoordinates=[float(v), 0, 1, 0])) for v in x
    ]
    made = [
        mbs.AddObject(
            item.ObjectANCFCable2D(
                physicsLength=LENGTH / n,
                physicsMassPerLength=MASS / LENGTH,
                physicsBendingStiffness=BENDING,
                physicsAxialStiffness=AXIAL,
                nodeNumbers=[a, b],
                useReducedOrderIntegration=1,
            )
        )
        for a, b in pairwise(nodes)
    ]
    first = mbs.AddMarker(item.MarkerBodyRigid(bodyNumber=hub, localPosition=[ARM, 0, 0]))
    second = mbs.AddMarker(item.MarkerBodyRigid(bodyNumber=made[0], localPosition=[0, 0, 0]))
    mbs.AddObject(
        item.GenericJoint(markerNumbers=[first, second], constrainedAxes=[1, 1, 0, 0, 0, 1])
    )
    marker = mbs.AddMarker(item.MarkerNodeRigid(nodeNumber=body))
    load = mbs.AddLoad(item.LoadTorqueVector(markerNumber=marker, loadVector=[0, 0, 0]))
    sensor = mbs.AddSensor(
        item.SensorNode(
            nodeNumber=body,
            storeInternal=True,
            outputVariableType=exu.OutputVariableType.Coordinates,
        )
    )
    mbs.Assemble()
    return Peer(
        "Exudyn ANCF",
        n,
        "GeneralizedAlpha",
        Implicit(mbs, [(load, (0.0, 0.0, LARGER))], sensor, lambda s: s[:, 3] / LARGER),
        "2-D",
    )


def main(path: Path) -> None:
    peers = [cables(n) for n in (2, 3, 4, 6, 8)]
    peers += [make(n) for make in (modal, floating) for n in (1, 2, 3, 4, 5)]
    limits = {
        f"{p.model} {p.n}": 2.7
        / float(
            TASK.full["xy"]
            .with_hub(TASK.hub.mass_matrix()[np.ix_([1, 5], [1, 5])])
            .free_frequencies[p.n - 1]
        )
        for p in peers
        if "ANCF" not in p.model
    }
    points = measure(peers, 1.0, rungs=24, limits=limits)
    write(points, path)
    for p in points:
        print(
            f"{p['model']:14} n={p['n']} h={p['timestep']:.4g} error {p['error']:.2e} "
            f"{1e3 * p['seconds']:.3f} ms"
        )


if __name__ == "__main__":
    main(Path(sys.argv[1]))
