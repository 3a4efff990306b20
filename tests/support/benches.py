"""An exported appendage on a bench: its root moves freely in chosen motions,
each driven by a motor and sensed; plain XML."""

import xml.etree.ElementTree as ET

from readback import text_of

MOTIONS = {
    "xy": (("displacement", "slide", "0 1 0"), ("rotation", "hinge", "0 0 1")),
    "xz": (("displacement", "slide", "0 0 1"), ("rotation", "hinge", "0 -1 0")),
    "torsion": (("rotation", "hinge", "1 0 0"),),
    "axial": (("displacement", "slide", "1 0 0"),),
}


def bench(source, timestep=0.01, integrator="implicitfast", ports=("xy",), ballast=None) -> str:
    """The file's text with its root body on joints of the ports.

    Args:
        source: path or text of the exported appendage.
        timestep: [s].
        integrator: MuJoCo's name.
        ports: whose motions are free.
        ballast: (mass, Ixx, Iyy, Izz) of a body that carries the root.
    """
    tree = ET.fromstring(text_of(source))
    world = tree.find("worldbody")
    (root,) = world.findall("body")
    carrier = root
    if ballast is not None:
        carrier = ET.SubElement(world, "body", name="bench", pos=root.get("pos", "0 0 0"))
        mass, *inertia = (repr(float(v)) for v in ballast)
        ET.SubElement(carrier, "inertial", pos="0 0 0", mass=mass, diaginertia=" ".join(inertia))
        world.remove(root)
        root.set("pos", "0 0 0")
        carrier.append(root)
    actuator = ET.SubElement(tree, "actuator")
    sensor = ET.SubElement(tree, "sensor")
    for place, (port, (name, kind, axis)) in enumerate(
        (p, motion) for p in ports for motion in MOTIONS[p]
    ):
        joint = {"name": f"root_{port}_{name}", "type": kind, "axis": axis, "pos": "0 0 0"}
        carrier.insert(place, ET.Element("joint", joint))
        ET.SubElement(actuator, "motor", name=f"drive_{port}_{name}", joint=joint["name"], gear="1")
        ET.SubElement(sensor, "jointpos", name=f"sense_{port}_{name}", joint=joint["name"])
    option = ET.SubElement(
        tree, "option", gravity="0 0 0", timestep=repr(float(timestep)), integrator=integrator
    )
    ET.SubElement(option, "flag", contact="disable", constraint="disable")
    return ET.tostring(tree, encoding="unicode")


def with_dampers(source, values) -> str:
    """The file's text with these joint dampers, in the order of its joints."""
    tree = ET.fromstring(text_of(source))
    joints = list(tree.iter("joint"))
    hinges = [joint for joint in joints if joint.get("name")]
    for joint, value in zip(hinges, values, strict=True):
        joint.set("damping", repr(float(value)))
    return ET.tostring(tree, encoding="unicode")
