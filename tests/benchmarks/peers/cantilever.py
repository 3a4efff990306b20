"""One cantilever with a mass at its tip in MuJoCo, by several means: first frequency, deflection,
cost of a second.

The beam is that of MuJoCo's own flex mechanisms: 0.9 m, 70 x 55 mm, 8 MPa, 0.12 kg, 0.2 kg at the
tip. Truth: Euler-Bernoulli, the frequency from its transcendental equation. A hundredth of gravity
is switched on at rest, nothing is damped: the mean of the tip's motion over whole periods is the
deflection, their length the frequency. Steps are 1 ms, as in MuJoCo's example, or the largest half,
quarter, ... of it that is stable.
Run: python tests/benchmarks/peers/cantilever.py
"""

import time
from collections.abc import Iterator

import mujoco
import numpy as np
from scipy.optimize import brentq

import beamchain as bc

LENGTH, WIDTH, HEIGHT, YOUNG, BEAM, TIP, GRAVITY = 0.9, 0.07, 0.055, 8e6, 0.12, 0.2, 0.0981
EI = YOUNG * WIDTH * HEIGHT**3 / 12.0
LINKS = (4, 8, 16, 32)
SECONDS = 10


def truth() -> tuple[float, float]:
    """First circular frequency [rad/s] and deflection of the tip under a
    hundredth of gravity [m]."""
    ratio = TIP / BEAM

    def equation(x: float) -> float:
        return (
            1.0
            + np.cos(x) * np.cosh(x)
            + ratio * x * (np.cos(x) * np.sinh(x) - np.sin(x) * np.cosh(x))
        )

    x = brentq(equation, 0.1, 1.8)
    deflection = GRAVITY * (TIP * LENGTH**3 / 3.0 + BEAM * LENGTH**3 / 8.0) / EI
    return x**2 * np.sqrt(EI / (BEAM * LENGTH**3)), deflection


def chain(text: str, place: str = "") -> str:
    return f"""<mujoco><option timestep="0.001" integrator="Euler" gravity="0 0 0"/><worldbody>
    <site name="root"/>{place}{text}
</worldbody></mujoco>"""


def equal_links(count: int, root: float) -> str:
    """Equal rigid links, EI N/L at every hinge and `root` times that at the first."""
    size = LENGTH / count
    stiffness = EI * count / LENGTH
    out = ""
    for i in range(count):
        k = stiffness * (root if i == 0 else 1.0)
        inertia = BEAM / count * size**2 / 12.0
        out += (
            f'<body pos="{size if i else 0.0} 0 0"><joint axis="0 1 0" '
            f'stiffness="{k!r}"/><inertial pos="{size / 2.0} 0 0" mass="{BEAM / count!r}" '
            f'diaginertia="1e-9 {inertia!r} {inertia!r}"/>'
        )
    tip = (
        f'<site name="tip" pos="{size} 0 0"/><body pos="{size} 0 0"><inertial pos="0 0 0" '
        f'mass="{TIP}" diaginertia="1e-9 1e-9 1e-9"/></body>'
    )
    return chain(out + tip + "</body>" * count)


def flex() -> str:
    """MuJoCo's quadratic flex of two cells, as its example has it, undamped."""
    connects = "".join(
        f'<connect body1="soft_4_{i}_{j}" body2="end" anchor="0 0 0"/>'
        for i in (0, 2)
        for j in (0, 2)
    )
    return f"""<mujoco>
    <option timestep="0.001" integrator="discrete" solver="Newton" tolerance="1e-7"
    iterations="1000"
 gravity="0 0 0"/><default><equality solref=".003 1" solimp=".99 .999 .001"/></default><worldbody>
<body name="clamp">
<flexcomp name="soft" type="grid" count="49 3 3"
spacing="{LENGTH / 48.0} {WIDTH / 2.0} {HEIGHT / 2.0}" pos="{LENGTH / 2.0} 0 0"
 dim="3" dof="quadratic" cellcount="2 1 1" mass="{BEAM}" radius=".001">
 <elasticity young="{YOUNG}" poisson=".25"/>
<contact selfcollide="none" contype="0" conaffinity="0"/><pin id="0 1 2 3 4 5 6 7 8"/></flexcomp>
</body>
<body name="end" pos="{LENGTH} 0 0"><freejoint/>
<geom type="box" size=".035 .065 .04" mass="{TIP}" contype="0" conaffinity="0"/>
<site name="tip"/></body></worldbody><equality>{connects}</equality></mujoco>"""


def fitted(modes: int, *, tip: bool) -> mujoco.MjSpec:
    section = bc.Rectangle(width_y=WIDTH, width_z=HEIGHT)
    material = bc.Material(youngs_modulus=YOUNG, density=BEAM / (LENGTH * WIDTH * HEIGHT))
    beam = bc.Beam(
        segments=(bc.Segment(length=LENGTH, section=section, material=material),),
        lumps=(bc.Lump(x=LENGTH, mass=TIP),),
    )
    fit = bc.fit(beam, modes={"xz": modes}, target="clamped", damping=0.0, scene=bc.Scene(tip=tip))
    spec = mujoco.MjSpec.from_string(chain(""))
    fit.attach(spec, "root")
    links = spec.bodies[1:]
    if not tip:
        links[-1].add_site(
            name="tip", pos=[LENGTH - sum(float(link.pos[0]) for link in links), 0.0, 0.0]
        )
    return spec


def models() -> Iterator[tuple[str, str | mujoco.MjSpec]]:
    for modes in (1, 2, 3):
        yield f"beamchain, {modes} mode{'s' * (modes > 1)}", fitted(modes, tip=False)
    yield "beamchain, 3 modes and the tip", fitted(3, tip=True)
    for name, root in (("equal links, EI N/L", 1.0), ("equal links, 2 EI N/L at the root", 2.0)):
        for count in LINKS:
            yield f"{name}, {count}", equal_links(count, root)
    yield "flex, quadratic, 2 cells", flex()


def moved(model: mujoco.MjModel) -> tuple[np.ndarray, float]:
    """The tip's way down [m] at every step, and the time of a simulated second [s]."""
    model.opt.gravity[:] = 0.0, 0.0, -GRAVITY
    data = mujoco.MjData(model)
    count = round(1.0 / model.opt.timestep)
    tip = next(i for i in range(model.nsite) if "tip" in model.site(i).name)
    mujoco.mj_forward(model, data)
    start = float(data.site_xpos[tip, 2])
    heights = []
    times = []
    for _ in range(SECONDS):
        begun = time.perf_counter()
        for _ in range(count):
            mujoco.mj_step(model, data)
            heights.append(start - data.site_xpos[tip, 2])
        times.append(time.perf_counter() - begun)
        if np.any(data.warning.number):
            return np.full(1, np.nan), np.inf
    return np.array(heights), min(times)


def measured(model: mujoco.MjModel, deflection: float) -> tuple[float, float, float]:
    """First frequency [rad/s], deflection of the tip [m], and time of a simulated second [s]."""
    tip, seconds = moved(model)
    while not np.all(np.abs(tip) < 10.0 * deflection):
        model.opt.timestep /= 2.0
        tip, seconds = moved(model)
    middle = tip.mean()
    for _ in range(20):  # the mean between the first and the last crossing upwards of the mean
        # without the modes above the first
        smooth = np.convolve(tip - middle, np.ones(64) / 64.0, "valid")
        up = np.flatnonzero((smooth[:-1] < 0.0) & (smooth[1:] >= 0.0))
        middle = tip[up[0] : up[-1]].mean()
    exact = up - smooth[up] / (smooth[up + 1] - smooth[up])
    period = (exact[-1] - exact[0]) / (len(up) - 1) * model.opt.timestep
    return 2.0 * np.pi / period, float(middle), seconds


def main() -> None:
    frequency, deflection = truth()
    print(f"truth: {frequency:.6f} rad/s, {1e3 * deflection:.4f} mm; MuJoCo {mujoco.__version__}")
    print(f"{'':38}{'degrees of freedom':>20}{'frequency':>12}{'deflection':>12}{'ms for 1 s':>12}")
    for name, source in models():
        model = (
            mujoco.MjModel.from_xml_string(source) if isinstance(source, str) else source.compile()
        )
        found = measured(model, deflection)
        errors = found[0] / frequency - 1.0, found[1] / deflection - 1.0
        print(
            f"{name:38}{model.nv:>20}{errors[0]:>+12.1e}{errors[1]:>+12.1e}"
            f"{1e3 * model.opt.timestep:>12.4f}{1e3 * found[2]:>12.1f}"
        )


if __name__ == "__main__":
    main()
