"""A warning: a sentence with a code that scripts can rely on."""

from collections.abc import Iterable
from typing import Self

#: What each code stands for, and its cure; docs/reference.py makes a page of them.
CODES = {
    "alignfree": (
        "MuJoCo defines a body's frame differently as soon as the body carries an appendage",
        'Write `align="false"` at the free joint to keep the frame as written. Otherwise read '
        "positions and keyframes in the frame that the warning states.",
    ),
    "allocation-matrix": (
        "the matrix of an allocation does not give the torque that is commanded",
        "Check signs and axes: a positive command turns the body positively, so the motor of "
        "a wheel gets a negative one. Without `matrix` the pseudo-inverse is taken.",
    ),
    "allocation-null": (
        "actuators of an allocation can work against each other without torque",
        "None is needed. Wheels can be sped up or slowed along these directions without "
        "turning the spacecraft.",
    ),
    "almost-rigid": (
        "the rigid mass of imported matrices departs slightly from a rigid body's",
        "None is needed if you know the cause; the nearest rigid mass is taken. Usual causes "
        "are grids rounded to 8 characters, coupling of interface and modes in `KAA`, and an "
        "a-set that leaves freedoms out.",
    ),
    "bent-keyframe": (
        "a keyframe bends an appendage, where `embed` writes zeros",
        "Write all values of `qpos`, zeros for the elastic hinges. Or put the keyframe into "
        "the spacecraft's file and embed again.",
    ),
    "carried-apart": (
        "a body stands beside the port that carries it, across a rigid gap",
        "None, if it is a bracket. Otherwise make the distance of the body from the place "
        "equal to the `x` of the port.",
    ),
    "collisions": (
        "shapes of the appendages can touch others",
        "None, if you asked for it by `scene.contacts`; the verification leaves contacts out.",
    ),
    "coloured-residuals": (
        "what an identified model leaves of a log is not white",
        "Look at the spectra in the report. Keep one mode more (`--modes`), or leave out "
        "disturbed channels. The intervals are widened already.",
    ),
    "contacts": (
        "bodies of the spacecraft touch, which is left out",
        "Exclude pairs that only overlap as drawn (`<contact><exclude/>`). Weld "
        "docked bodies together in a file of their own and embed there.",
    ),
    "counted-twice": (
        "the body that holds an appendage probably has the appendage's own mass",
        "Take the geoms of the link, or their mass, out of the body "
        "([trees](../howto/embed.md#arms-and-trees)). None, if the mass is "
        "another.",
    ),
    "delay": (
        "torques of a log act later or earlier than the log says",
        "None is needed: the delay is estimated with the modes. Half a step usually means a "
        "gyro of mean rates, whose columns are called `mean_rate_*`. A whole step means a "
        "torque in the row after its own.",
    ),
    "discrete-damping": (
        "the integrator discrete damps the kept modes more than the structure does",
        "Take a timestep below the one that the warning states.",
    ),
    "dry-friction": (
        "dry friction in joints of the spacecraft is left out",
        "None, if the joint moves while it matters. Hold a joint that sticks by a spring or a "
        "servo, which the verification knows.",
    ),
    "equality": (
        "equality constraints of the spacecraft are left out of the verification",
        "Check the effect of the constraints on the coupled modes yourself.",
    ),
    "exact-in-time": (
        "the appendages were made exact in time for the spacecraft's own step",
        "None is needed. Run the file at this step, with inputs through "
        "[`bc.HeldInput`](../time.md#the-input); `--no-retime` leaves the appendages as they "
        "are.",
    ),
    "far-mount": (
        "an appendage is mounted far outside of the spacecraft, probably because of a wrong unit",
        "Give `pos` of the site in metres. The warning comes beyond 20 m and 100 radii of "
        "gyration from the centre of mass.",
    ),
    "file-units": (
        "an imported file is probably in other units than stated",
        "Compare the stated mass and length with those of the appendage. A model in mm and "
        "tonne needs `units = { length = 1e-3, mass = 1e3 }` in `[imported]`.",
    ),
    "fit-missed": (
        "the fit of an appendage missed a requirement",
        "Read the message behind it: it names the tolerance or the number of modes that was "
        "not reached, and what to change.",
    ),
    "gravity": (
        "gravity acts on the spacecraft",
        'In orbit write `<option gravity="0 0 0"/>`. On the ground `embed --loaded` verifies '
        "the spacecraft under gravity ([loads](../craft.md#under-gravity-or-thrust)).",
    ),
    "half-units": (
        "only one of the units of an imported file is stated",
        "Give both, even if one is 1: `units = { length = 1e-3, mass = 1.0 }` for mm and kg.",
    ),
    "heavy-appendage": (
        "an appendage weighs more than a hundred times the spacecraft",
        "Check the units of its specification: lengths in m, densities in kg/m³.",
    ),
    "heavy-liquid": (
        "the liquid of a tank outweighs the spacecraft many times over, probably because of a "
        "wrong unit",
        "Give `slosh.radius` and `slosh.height` in metres. The warning comes above 100 times "
        "the mass of the rigid spacecraft, and above 1e7 kg.",
    ),
    "held-ports": (
        "the spacecraft's joints hold a port, wholly or in part",
        "None, if the mount is meant to be held. Otherwise free the joint, or mount the "
        "appendage on the body that moves.",
    ),
    "high-damping": (
        "a damping ratio of 0.1 or more is stated",
        "Check the unit of `damping.ratio`: 0.5 % is 0.005.",
    ),
    "hinge-damping": (
        "plain joint damping cannot give every mode its damping ratio",
        'Tendons give every mode its ratio: `damping.form = "modal"`, the default.',
    ),
    "huge-section": (
        "a section is very wide for the appendage's length, probably because of a wrong unit",
        "Give the dimensions of the section in metres.",
    ),
    "ignored-damping": (
        "an imported file holds damping, which is ignored, and none is stated",
        "State the ratios in `[damping]`; [how they "
        "follow](../imported.md#what-to-ask-of-nastran) from `K4AA` and `BAA`.",
    ),
    "imbalance": (
        "a wheel's imbalance is so large that its unit is probably wrong",
        "Give `static` in kg m (1 g cm = 1e-5 kg m) and `dynamic` in kg m² (1 g cm² = 1e-7 kg m²).",
    ),
    "impact-on-flexible": (
        "a hinge was stopped at once beside a flexible body",
        "Leave `impact` out: the latched hinge is then a stiff spring with damping. What an "
        "impact takes beside a flexible body depends on the modes kept.",
    ),
    "inaccurate-step": (
        "the scene's step is stable but misses the scene's tolerance",
        "State a step up to the one that the warning names: `scene.timestep` makes the chain "
        "exact at it.",
    ),
    "joints-behind": (
        "the appendage is mounted behind joints of the spacecraft",
        "None, if the drive is meant. A spring at the joint makes it count as locked.",
    ),
    "large-motion": (
        "a run or a keyframe exceeds a chain's large-motion limits",
        "Choose a slower manoeuvre; `beamchain inspect --steps` prints the limits. More modes "
        "allow more bending, not always more spin, and no more thrust "
        "([theory](../theory.md#7-large-motion)).",
    ),
    "large-motion-unknown": (
        "the large-motion limits of the chain could not be computed",
        "Compare with a chain of more modes yourself. Imported modes have no beam to compare with.",
    ),
    "last-mode": (
        "the modes of an imported file end too soon for the scene's bandwidth",
        "Ask for modes up to the frequency that the sentence names, or for residual vectors "
        "([deliveries](../howto/fe-modes.md#a-nastran-superelement)).",
    ),
    "least-damping": (
        "damping ratios are lower than the least at which errors are compared",
        "None: files have the ratio that is stated. Errors and the search for modes take it "
        "for 1e-5, or for 0.5 % where no damping is stated at all.",
    ),
    "left-certain": (
        "structural properties that are uncertain are left certain in an uncertain plant",
        "`beamchain sweep` shows what uncertain stiffness and density do. In the plant, state "
        "the uncertainty of `frequency`, `damping` or `participation`.",
    ),
    "light-material": (
        "a density below that of foam is stated",
        "Give `density` in kg/m^3.",
    ),
    "limits": (
        "a joint of the spacecraft stands outside its range",
        "Write `ref`, or widen the range: the rest pose is that of all joints at their `ref`. "
        "MuJoCo pushes the joint back as soon as the file runs.",
    ),
    "load-left-out": (
        "a keyframe was judged without its load, which changes the motion",
        "Verify the spacecraft under its load with `--loaded` (`loaded=True`, "
        "[loads](../craft.md#under-gravity-or-thrust)). Imported modes cannot be verified "
        "under a load.",
    ),
    "log-gaps": (
        "a log has gaps",
        "None, if the gaps are known: every piece starts anew, and short ones are left out.",
    ),
    "long-delay": (
        "a dead time is longer than a period of its loop",
        "Give `delay` in seconds. None, if the delay is that long: all figures include it.",
    ),
    "medium": (
        "the density or viscosity of a medium causes drag on the links",
        "In space set `density` and `viscosity` of `<option>` to 0. `bc.plant` leaves the "
        "medium out.",
    ),
    "model-order": (
        "a log supports another number of modes than was asked for",
        "Compare the errors on the held-out part for both numbers of modes (`--modes`). "
        "Excite longer if they do not tell.",
    ),
    "modes-refused": (
        "[imported] refuses the modes that were identified",
        "`fit` will refuse these modes: they are not physical. Check the axes of the torques, "
        "other appendages, and the mass that the prior states.",
    ),
    "not-carried": (
        "a body stands at a point of an appendage that does not carry it",
        'Name the body at the port, `carries = ["elbow"]` or `--carry PLACE:PORT=elbow`, '
        "where it is meant to hang on the appendage ([trees](../craft.md#trees)).",
    ),
    "not-exact-in-time": (
        "the spacecraft's integrator cannot be made exact in time",
        "Use Euler, implicit or implicitfast. Or keep the integrator at a step whose own "
        "error you accept.",
    ),
    "other": (
        "anything else",
        "Read the sentence; it names the value and the remedy.",
    ),
    "other-bases": (
        "other bodies of the file move by themselves and carry no appendage",
        "None: every body that carries an appendage is verified by itself. What ties it to "
        "another one is left out and named beside.",
    ),
    "other-hub": (
        "the hub in the specification differs from that of the spacecraft",
        "None: that of the spacecraft was used. Correct or leave out `[root] hub`.",
    ),
    "other-step": (
        "a model runs at another step or integrator than the one its appendages were made for",
        "Run `beamchain retime FILE --timestep H -o OUT` for your step, or run the file at "
        "the step that it was made for.",
    ),
    "overdamped": (
        "nothing oscillates in a model; its step limits are left out",
        "None, if the damping is meant. Otherwise check the unit of `damping`.",
    ),
    "points-inward": (
        "an appendage probably runs the wrong way",
        "Turn the site so that its x axis points from the spacecraft to the tip, or to the "
        "body that is carried.",
    ),
    "ports-coupled": (
        "two ports that should be independent are coupled in the compiled model",
        "Change nothing in the written file by hand. If you did not, please report it with "
        "the specification.",
    ),
    "pose-in-radians": (
        "an angle in `--pose` looks like radians",
        "`--pose` takes degrees for hinges: `drive=90`. In Python `pose` takes radians.",
    ),
    "pose-not-proven": (
        "a plant is asked for in a pose at which the file misses its tolerance or was not checked",
        "Modes are chosen, and errors stated, at rest and at the keyframes. Give the spacecraft a "
        "keyframe at the pose and embed again.",
    ),
    "preloaded-spring": (
        "a spring of the spacecraft is preloaded at rest",
        "Write `springref` so that the spring is slack at rest, or leave it where a motor or "
        "gravity balances it.",
    ),
    "prior-contradicted": (
        "a log contradicts what was believed before",
        "Check the stiffness and mass of the prior, and the mass of the spacecraft. Widen "
        "`[uncertain]` if the prior is only roughly known.",
    ),
    "proportional-torques": (
        "the torques of a log are multiples of each other",
        "Drive the axes one after the other, or with different signals.",
    ),
    "raised-inertia": (
        "the polar inertia of very thin links was raised to MuJoCo's minimum",
        "None: only torsion feels this inertia.",
    ),
    "rigid-plane": (
        "a bending plane is rigid because [modes] names only the other one",
        "Write `xz = 2` to keep modes there, or `xz = 0` to say that it shall be rigid (`xy` "
        "alike).",
    ),
    "sensor": (
        "a sensor of a log saturates or is coarse",
        "None for single saturated samples, which are left out. Otherwise choose a wider "
        "range or a finer resolution.",
    ),
    "servo-saturates": (
        "a servo that saturates may go on switching between its limits for ever",
        "Write `<joint damping=.../>` in place of `kv` ([which step](../howto/step.md)), or "
        "take the step that the warning states. None, if commands never take the servo to its "
        "limit.",
    ),
    "slew-chain": (
        "in a slew of a hinge the chains are off by more than the tolerance",
        "Turn more slowly, or keep more modes ([slews](../time.md#large-slews-of-hinges)).",
    ),
    "slew-step": (
        "in a slew of a hinge the step is off by more than the tolerance",
        "Integrate such slews with RK4, at the step that `stability.json` states "
        '(`step_rk4`), after `bc.retime(model, step, "RK4")`. Or take a shorter step.',
    ),
    "slosh-tilt": (
        "a load pushes the liquid of a tank so far aside that it is no pendulum any more",
        "Turn the place of the tank, or `slosh.axis`, along the thrust or against gravity. "
        "Beyond about 10 degrees take the numbers for an estimate "
        "([tanks](../howto/tanks.md)).",
    ),
    "slosh-weightless": (
        "nothing presses the liquid of a tank onto its bottom",
        "Simulate and linearise under a thrust or gravity: a keyframe with the `ctrl` of the "
        "thruster, and `--loaded` ([tanks](../howto/tanks.md)). Surface tension is not in the "
        "model.",
    ),
    "slowed-modes": (
        "modes too fast for the step were slowed",
        "None where the tolerance is kept. Modes above 2.6 rad per step (RK4: 2.0) are "
        "slowed; they keep their static response and stay stable ([time](../time.md)).",
    ),
    "soft-material": (
        "a Young's modulus below that of rubber is stated",
        "Give `youngs_modulus` in N/m^2.",
    ),
    "stocky-beam": (
        "Euler's beam theory is used for an appendage so short that shear matters",
        'Write `theory = "timoshenko"` in the segment.',
    ),
    "tendon-damping": (
        "Euler treats the damping of tendons explicitly",
        "Take an integrator and a step below the limit that the warning states.",
    ),
    "thrust-offset": (
        "a thrust passes beside the centre of mass; its moment is taken as balanced",
        "Cancel the moment in a run (thrust times offset, from `data.subtree_com`), or the "
        "spacecraft turns away.",
    ),
    "time-error": (
        "the poles of a model at its step are not those of exact motion",
        "Compare `sampled_error` with the tolerance "
        "([time](../time.md#two-figures-for-every-step)). Sprung or damped joints of the "
        "spacecraft's own are corrected by `retime --retime-joints` only.",
    ),
    "turn-error": (
        "the step's error in the rotation of the rigid spacecraft exceeds the tolerance",
        "Use RK4 or implicit, which turn the rigid spacecraft more exactly, or a shorter step.",
    ),
    "undamped-modes": (
        "a table of damping ratios leaves imported modes undamped",
        "Name the missing ports in `[damping] ratio`, or list a value per mode of the file.",
    ),
    "undetermined": (
        "a log does not determine something",
        "Read `undetermined` in the record; `advice` beside it tells which torques would "
        "determine it. A prior fills it in.",
    ),
    "unstable-step": (
        "the step is beyond the integrator's stability limit",
        "Take the step that the warning states, or `--retime`. A latched hinge needs the "
        "armature that it states.",
    ),
    "written-out": (
        "the spacecraft's file was written out by MuJoCo",
        "None, or put the site into a body of the file itself. Comments are lost where MuJoCo "
        "writes a file that `<attach>`, `<replicate>`, URDF or `.mjz` makes.",
    ),
}


class Caution(str):
    """A warning, which is its sentence.

    Args:
        code: one of `CODES`.
        text: the sentence.

    Raises:
        KeyError: there is no such code.
    """

    code: str

    def __new__(cls, code: str, text: str) -> Self:
        """The sentence, with its code."""
        if code not in CODES:
            raise KeyError(code)
        made = super().__new__(cls, text)
        made.code = code
        return made

    def __reduce__(self) -> tuple[type["Caution"], tuple[str, str]]:
        """For pickling."""
        return Caution, (self.code, str(self))

    def at(self, place: str) -> "Caution":
        """The same, said of a place."""
        return Caution(self.code, f"{place}: {self}")


def at(place: str, warning: str) -> str:
    """A warning said of a place; its code stays."""
    return warning.at(place) if isinstance(warning, Caution) else f"{place}: {warning}"


def warnings_record(warnings: Iterable[str]) -> list[dict[str, str]]:
    """Codes and sentences, as they stand in every record."""
    return [{"code": getattr(w, "code", "other"), "message": str(w)} for w in warnings]
