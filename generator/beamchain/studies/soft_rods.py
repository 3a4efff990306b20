"""MuJoCo's own elastic rods as rivals: `flexcomp` rods and, where the installed version still has it, the cable.

Both clamp at the middle of their first segment: that point is put at the root, and the last vertex of a rod weighs half.
"""

from contextlib import suppress

import numpy as np

from beamchain.engine.library import mujoco
from beamchain.engine.linearise import compile_model
from beamchain.fitting.hub import Hub
from beamchain.mjcf.write import number
from beamchain.structure.beam import Beam

FLEXCOMP, CABLE = "flexcomp rod", "composite cable"

#: flex elasticity is refused by MuJoCo 4's implicit and implicitfast
INTEGRATORS = {FLEXCOMP: ("Euler", "RK4", "discrete"), CABLE: ("Euler", "implicitfast", "RK4")}

ALONG = np.array([1.0, 0.0, 0.0])

_SCENE = """<mujoco>
  <option timestep="0.001" gravity="0 0 0"><flag contact="disable"/></option>{extension}
  <worldbody>
    <body name="hub">
      <freejoint/>
      <inertial pos="0 0 0" mass="{mass}" fullinertia="{inertia}"/>{appendage}
    </body>
  </worldbody>
</mujoco>"""

_ROD = """
      <body pos="{first}"><inertial pos="0 0 0" mass="{piece}" diaginertia="{small}"/></body>
      <flexcomp name="rod" type="grid" dim="1" count="{count} 1 1" spacing="{spacing} 1 1" mass="{total}"
                inertiabox="0.001" radius="{radius}" pos="{middle}">
        <contact contype="0" conaffinity="0" selfcollide="none"/>
        <edge equality="false"/>
        <elasticity young="{young}" poisson="0.3"/>
        <pin id="0 1"/>
      </flexcomp>"""

_CABLE = """
      <body pos="{offset}">
        <composite prefix="rod" type="cable" curve="s" count="{count} 1 1" size="{length}" offset="{start} 0 0"
                   initial="none">
          <plugin plugin="mujoco.elasticity.cable">
            <config key="twist" value="{shear}"/><config key="bend" value="{young}"/>
          </plugin>
          <joint kind="main" damping="0"/>
          <geom type="capsule" size="{radius}" density="{density}" contype="0" conaffinity="0"/>
        </composite>
      </body>"""


def available(beam: Beam) -> list[str]:
    """The rods that can stand for this appendage in the installed MuJoCo: uniform ones that stretch only."""
    out: list[str] = []
    hub = Hub(mass=1.0, inertia=(1.0, 1.0, 1.0))
    stretches = beam.uniform and float(beam.segments[0].at(np.array([0.5])).axial[0]) > 0.0
    for name in (FLEXCOMP, CABLE) if stretches else ():
        with suppress(RuntimeError, ValueError):
            scene_model(name, beam, hub, 3)
            out.append(name)
    return out


def fastest(beam: Beam, count: int) -> float:
    """Bound on the fastest frequency of a rod: its segments stretching against each other [rad/s]."""
    stations = beam.segments[0].at(np.array([0.5]))
    spacing = beam.length / (count - 0.5)
    return 2.0 * float(np.sqrt(stations.axial[0] / stations.mass[0])) / spacing


def scene_model(name: str, beam: Beam, hub: Hub, count: int) -> "mujoco.MjModel":
    """The compiled scene of a rod with `count` segments on the hub.

    The round section has the beam's own stretching and bending stiffness in plane xy.
    """
    at = beam.segments[0].at(np.array([0.5]))
    bending, axial, density = float(at.bending_xy[0]), float(at.axial[0]), float(at.mass[0])
    radius = 2.0 * float(np.sqrt(bending / axial))
    young = axial / (np.pi * radius**2)
    spacing = beam.length / (count - 0.5)
    offset = np.asarray(hub.offset)
    if name == FLEXCOMP:
        text = _ROD.format(
            first=number(offset + spacing / 2.0 * ALONG), piece=density * spacing,
            small=number(np.full(3, max(density * spacing * radius**2, 1e-12))),
            count=count + 1, spacing=spacing, total=density * spacing * (count + 1), radius=radius,
            middle=number(offset + spacing * (count - 1) / 2.0 * ALONG), young=young,
        )  # fmt: skip
        extension = ""
    else:
        text = _CABLE.format(
            offset=number(offset), count=count + 1, length=spacing * count, start=-spacing / 2.0, radius=radius,
            shear=young / 2.6, young=young, density=density / (np.pi * radius**2),
        )  # fmt: skip
        extension = '<extension><plugin plugin="mujoco.elasticity.cable"/></extension>'
    model = compile_model(
        _SCENE.format(mass=hub.mass, inertia=number((*hub.inertia, *hub.products)), extension=extension, appendage=text)
    )
    if name == FLEXCOMP:
        model.body_mass[model.body(f"rod_{count}").id] *= 0.5
        mujoco.mj_setConst(model, mujoco.MjData(model))
    return model
