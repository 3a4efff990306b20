"""The two-link arm in Exudyn, floating frames with Craig-Bampton modes and ANCF cables, beside
embedded hinge chains: error against run time.

Of the component modes only what bends in the plane is kept, as in the chains beside them: fewer
coordinates than a user would have. The bus is part of the upper arm's body, elbow and hand of the
forearm's, so that two bodies and one joint are all there is.
Run: python tests/benchmarks/peers/exudyn_arm.py build/peers/arm.json
"""

import sys
import time
from itertools import pairwise
from pathlib import Path

import exudyn as exu
import numpy as np
from arm_chains import chains
from arm_task import (
    ANGLE,
    ARM,
    BEAT,
    END,
    FORE,
    TORQUE,
    UPPER,
    ArmPeer,
    measure,
    table,
    write,
)
from exudyn import itemInterface as item  # noqa: N813
from exudyn.FEM import FEMinterface, ObjectFFRFreducedOrderInterface
from exudyn_peers import settings
from scipy.linalg import eigh
from scipy.sparse import csr_matrix

from arms import DENSITY, YOUNG

STATIONS = 60  # Gauss points along a link, where its mass is: cubic shapes are integrated exactly
CLAMPED_MODES = 40  # elements of the beam behind the component modes
REACH = 0.1  # of the four points by which the end of a link is held [m]


def straight(link):
    """Bending stiffness in the plane, axial stiffness and mass per length of a link."""
    area = link.width_y * link.width_z
    return YOUNG * link.width_z * link.width_y**3 / 12.0, YOUNG * area, DENSITY * area


def hermite(x, size):
    """Values and slopes `(len(x), 4)` of the cubic shapes of an element."""
    s = x / size
    values = [1 - 3 * s**2 + 2 * s**3, size * (s - 2 * s**2 + s**3)]
    values += [3 * s**2 - 2 * s**3, size * (s**3 - s**2)]
    return np.array(values).T


def shapes_of(link, n):
    """Craig-Bampton shapes of a link held at its root, at its stations: deflections
    `(stations, 2 + n)` for a unit deflection and rotation of the end and for n modes with both ends
    held, their stiffness, the stations and their masses."""
    bending, _, mass = straight(link)
    count = CLAMPED_MODES
    size = link.length / count
    m = np.array([[156, 22, 54, -13], [22, 4, 13, -3], [54, 13, 156, -22], [-13, -3, -22, 4]])
    k = np.array([[12, 6, -12, 6], [6, 4, -6, 2], [-12, -6, 12, -6], [6, 2, -6, 4]])
    scale = np.array([1.0, size, 1.0, size])
    m = m * np.outer(scale, scale) * mass * size / 420.0
    k = k * np.outer(scale, scale) * bending / size**3
    whole_m, whole_k = (np.zeros((2 * count + 2, 2 * count + 2)) for _ in range(2))
    for e in range(count):
        both = slice(2 * e, 2 * e + 4)
        whole_m[both, both] += m
        whole_k[both, both] += k
    inner, end = slice(2, 2 * count), slice(2 * count, 2 * count + 2)
    basis = np.zeros((2 * count + 2, 2 + n))
    basis[end, :2] = np.eye(2)
    basis[inner, :2] = -np.linalg.solve(whole_k[inner, inner], whole_k[inner, end])
    basis[inner, 2:] = eigh(whole_k[inner, inner], whole_m[inner, inner])[1][:, :n]
    stiffness = basis.T @ whole_k @ basis
    points, weights = np.polynomial.legendre.leggauss(STATIONS)
    x = link.length * (points + 1.0) / 2.0
    element = np.minimum((x / size).astype(int), count - 1)
    local = hermite(x - size * element, size)
    at_stations = np.array([local[i] @ basis[2 * e : 2 * e + 4] for i, e in enumerate(element)])
    return at_stations, stiffness, x, weights * mass * link.length / 2.0


def rigid_points(mass, inertia, at):
    """Six points with the mass and the diagonal inertia of a body at a place."""
    a, b, c = np.sqrt(np.maximum(1.5 / mass * (sum(inertia) - 2.0 * np.array(inertia)), 0.0))
    offsets = np.array([[a, 0, 0], [-a, 0, 0], [0, b, 0], [0, -b, 0], [0, 0, c], [0, 0, -c]])
    return np.array(at) + offsets, np.full(6, mass / 6.0)


def floating(mbs, link, n, root, end, at, turn):
    """A link as a floating frame: what is at its root and at its end (mass, inertia, place of the
    root body before the link's root); the nodes, and the numbers of the points at its end."""
    deflection, stiffness, x, mass = shapes_of(link, n)
    stretching = straight(link)[1]
    count = 3 + n  # the last: stretching by a force at the end
    places, weights, rows = [], [], []

    def add(points, masses, moved):
        places.append(points)
        weights.append(masses)
        rows.append(moved)

    add(*rigid_points(*root), np.zeros((6, 3, count)))
    field = np.zeros((STATIONS, 3, count))
    field[:, 1, : 2 + n] = deflection
    field[:, 0, -1] = x / link.length
    begin = np.array(at)
    add(np.column_stack([begin[0] + x, 0.0 * x, 0.0 * x]), mass, field)
    tip = begin + link.length * np.eye(3)[0]

    def of_end(points):
        moved = np.zeros((len(points), 3, count))
        moved[:, 1, 0] = 1.0
        moved[:, 0, 1] = -(points - tip)[:, 1]
        moved[:, 1, 1] = (points - tip)[:, 0]
        moved[:, 0, -1] = 1.0
        return moved

    if end is not None:
        points, masses = rigid_points(*end, tip)
        add(points, masses, of_end(points))
    held = tip + REACH * np.array([[0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])
    add(held, np.zeros(4), of_end(held))
    places, weights, rows = np.vstack(places), np.concatenate(weights), np.vstack(rows)
    basis = rows.reshape(-1, count)
    weight3 = np.repeat(weights, 3)
    whole = np.zeros((count, count))
    whole[: 2 + n, : 2 + n] = stiffness
    whole[-1, -1] = stretching / link.length
    # only its projection on the modes is used
    inverse = np.linalg.inv(basis.T @ (weight3[:, None] * basis))
    spread = (weight3[:, None] * basis) @ inverse
    fem = FEMinterface()
    fem.nodes = {"Position": places}
    fem.massMatrix = csr_matrix(np.diag(weight3))
    fem.stiffnessMatrix = csr_matrix(spread @ whole @ spread.T)
    fem.modeBasis = {"matrix": basis, "type": "HCBmodes"}
    fem.elements = []
    fem.surface = []
    cms = ObjectFFRFreducedOrderInterface(fem, rigidBodyNodeType="NodeType.RotationRxyz")
    made = cms.AddObjectFFRFreducedOrder(mbs, positionRef=turn[0], rotationMatrixRef=turn[1])
    return made, np.arange(len(places) - 4, len(places))


def elbow():
    return np.add(ARM.at, [UPPER.length, 0.0, 0.0])


def turned():
    c, s = np.cos(ANGLE), np.sin(ANGLE)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def component_modes(n, solver):
    """Two floating frames and a revolute joint: large motion, three dimensions."""
    mbs = exu.SystemContainer().AddSystem()
    bus = (ARM.bus, ARM.bus_inertia, (0.0, 0.0, 0.0))
    upper, held = floating(mbs, UPPER, n, bus, None, ARM.at, ([0, 0, 0], np.eye(3)))
    root = (FORE.mass, FORE.inertia, (0.0, 0.0, 0.0))
    hand = (ARM.hand, ARM.hand_inertia)
    fore, _ = floating(mbs, FORE, n, root, hand, (0.0, 0.0, 0.0), (elbow(), turned()))
    first = mbs.AddMarker(
        item.MarkerSuperElementRigid(
            bodyNumber=upper["oFFRFreducedOrder"],
            meshNodeNumbers=held,
            weightingFactors=np.full(4, 0.25),
        )
    )
    second = mbs.AddMarker(item.MarkerNodeRigid(nodeNumber=fore["nRigidBody"]))
    mbs.AddObject(
        item.GenericJoint(markerNumbers=[first, second], constrainedAxes=[1, 1, 1, 1, 1, 0])
    )
    node = upper["nRigidBody"]
    marker = mbs.AddMarker(item.MarkerNodeRigid(nodeNumber=node))
    load = mbs.AddLoad(item.LoadTorqueVector(markerNumber=marker, loadVector=[0, 0, 0]))
    sensor = mbs.AddSensor(
        item.SensorNode(
            nodeNumber=node, storeInternal=True, outputVariableType=exu.OutputVariableType.Rotation
        )
    )
    mbs.Assemble()
    run = Run(mbs, load, sensor, solver)
    name = "Exudyn CMS" + ("" if solver.iterates else ", one iteration")
    return ArmPeer(name, n, solver.name, run, "3-D")


def cables(n, solver):
    """ANCF cables between rigid bodies in the plane: large motion."""
    mbs = exu.SystemContainer().AddSystem()

    def body(mass, inertia, at):
        node = mbs.AddNode(item.NodeRigidBody2D(referenceCoordinates=[at[0], at[1], 0.0]))
        made = mbs.AddObject(
            item.ObjectRigidBody2D(physicsMass=mass, physicsInertia=inertia, nodeNumber=node)
        )
        return node, made

    def link(of, begin, angle):
        along = np.array([np.cos(angle), np.sin(angle)])
        bending, stretching, mass = straight(of)
        nodes = [
            mbs.AddNode(
                item.NodePoint2DSlope1(referenceCoordinates=[*(begin[:2] + s * along), *along])
            )
            for s in np.linspace(0.0, of.length, n + 1)
        ]
        return [
            mbs.AddObject(
                item.ObjectANCFCable2D(
                    physicsLength=of.length / n,
                    physicsMassPerLength=mass,
                    physicsBendingStiffness=bending,
                    physicsAxialStiffness=stretching,
                    nodeNumbers=[a, b],
                    useReducedOrderIntegration=1,
                )
            )
            for a, b in pairwise(nodes)
        ]

    def join(one, at_one, other, at_other, turns, angle=0.0):
        marks = [
            mbs.AddMarker(item.MarkerBodyRigid(bodyNumber=b, localPosition=[x, 0.0, 0.0]))
            for b, x in ((one, at_one), (other, at_other))
        ]
        c, s = np.cos(angle), np.sin(angle)
        mbs.AddObject(
            item.GenericJoint(
                markerNumbers=marks,
                constrainedAxes=[1, 1, 0, 0, 0, 0 if turns else 1],
                rotationMarker0=np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]),
            )
        )

    node, bus = body(ARM.bus, ARM.bus_inertia[2], (0.0, 0.0))
    upper = link(UPPER, np.array(ARM.at), 0.0)
    join(bus, ARM.at[0], upper[0], 0.0, turns=False)
    _, drum = body(FORE.mass, FORE.inertia[2], elbow())
    join(drum, 0.0, upper[-1], UPPER.length / n, turns=True)
    fore = link(FORE, elbow(), ANGLE)
    join(drum, 0.0, fore[0], 0.0, turns=False, angle=ANGLE)
    _, hand = body(ARM.hand, ARM.hand_inertia[2], elbow() + FORE.length * turned()[:, 0])
    join(hand, 0.0, fore[-1], FORE.length / n, turns=False, angle=ANGLE)
    marker = mbs.AddMarker(item.MarkerNodeRigid(nodeNumber=node))
    load = mbs.AddLoad(item.LoadTorqueVector(markerNumber=marker, loadVector=[0, 0, 0]))
    sensor = mbs.AddSensor(
        item.SensorNode(
            nodeNumber=node,
            storeInternal=True,
            outputVariableType=exu.OutputVariableType.Coordinates,
        )
    )
    mbs.Assemble()
    name = "Exudyn ANCF" + ("" if solver.iterates else ", one iteration")
    return ArmPeer(name, n, solver.name, Run(mbs, load, sensor, solver), "2-D")


class Implicit:
    """The implicit solver: generalised alpha, or the trapezoidal rule with constraints on
    velocities ("index 2"); modified Newton; small systems are solved dense, which is quicker.

    The explicit solvers take no constraints: with springs of 1e8 N/m in the elbow a step of RK44
    takes twice as long, and 0.3 ms is unstable.
    """

    solver = exu.MainSolverImplicitSecondOrder

    def __init__(self, radius=None, *, dense=True, absolute=1e-9, iterates=True):
        self.radius, self.dense, self.absolute, self.iterates = radius, dense, absolute, iterates
        self.name = "trapezoidal" if radius is None else f"alpha {radius:g}"

    def configure(self, given):
        alpha, newton = given.timeIntegration.generalizedAlpha, given.timeIntegration.newton
        if self.radius is None:
            alpha.useNewmark = alpha.useIndex2Constraints = True
        else:
            alpha.spectralRadius = self.radius
        newton.useModifiedNewton = True
        newton.useNewtonSolver = self.iterates
        newton.relativeTolerance = 1e-6
        newton.absoluteTolerance = self.absolute
        given.linearSolverType = (
            exu.LinearSolverType.EXUdense if self.dense else exu.LinearSolverType.EigenSparse
        )


class Run:
    """Runs an assembled arm, the torque switched between three stretches; only the steps are
    timed."""

    def __init__(self, mbs, load, sensor, solver):
        self.mbs, self.load, self.sensor, self.kind = mbs, load, sensor, solver
        self.start = mbs.systemData.GetSystemState()

    def __call__(self, h: float, record: bool):
        attitude, seconds = self._once(h, TORQUE, record)
        if not record or attitude is None:
            return None, seconds
        other, _ = self._once(h, -TORQUE, record)
        return (None if other is None else (attitude - other) / 2.0), seconds

    def _once(self, h: float, torque: float, record: bool):
        mbs = self.mbs
        mbs.systemData.SetSystemState(self.start, configuration=exu.ConfigurationType.Initial)
        out, seconds = [], 0.0
        for sign, length in ((1.0, BEAT), (-1.0, BEAT), (0.0, END - 2.0 * BEAT)):
            mbs.SetLoadParameter(self.load, "loadVector", [0.0, 0.0, sign * torque])
            count = round(length / h)
            given = settings(count, length, record)
            given.timeIntegration.automaticStepSize = given.timeIntegration.adaptiveStep = False
            self.kind.configure(given)
            solver = self.kind.solver()
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
                out.append(stored[1:, 3] if len(stored) == count + 1 else stored[:, 3])
            state = mbs.systemData.GetSystemState()
            mbs.systemData.SetSystemState(state, configuration=exu.ConfigurationType.Initial)
        return (np.concatenate(out) if record else None), seconds


def main(path: Path) -> None:
    kinds = [*((n, "Euler") for n in (2, 3, 4, 5, 6)), (3, "RK4"), (5, "RK4")]
    peers = [chains("beamchain", n, f"xy = {n}\naxial = 1", kind) for n, kind in kinds]
    peers += [
        chains("beamchain, 3-D", n, f"xy = {n}\nxz = {n}\ntorsion = 1\naxial = 1", "Euler")
        for n in (3, 5)
    ]
    for iterates in (True, False):
        # small motion lets the solver do with one iteration: no user can count on it
        peers += [component_modes(n, Implicit(iterates=iterates)) for n in (3, 4, 5)]
        # rounding of the stretching stiffness keeps Newton above 1e-6
        several = {"dense": False, "absolute": 1e-5, "iterates": iterates}
        peers += [cables(n, Implicit(**several)) for n in (8, 12)]
    points = measure(peers)
    write(points, path)
    table(points)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
