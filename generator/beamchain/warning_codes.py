"""A warning: a sentence with a code that scripts can rely on."""

from collections.abc import Iterable
from typing import Self

#: what each code stands for; docs/warnings.md lists them
CODES = {
    "contacts": "bodies of the spacecraft touch, which is left out",
    "dry-friction": "dry friction in joints of the spacecraft is left out",
    "limits": "a joint of the spacecraft stands outside its range",
    "other-bases": "other bodies of the file move by themselves and carry no appendage",
    "almost-rigid": "the rigid mass of imported matrices departs slightly from a rigid body's",
    "alignfree": "MuJoCo defines a body's frame differently as soon as the body carries an "
    "appendage",
    "allocation-matrix": "the matrix of an allocation does not give the torque that is commanded",
    "allocation-null": "actuators of an allocation can work against each other without torque",
    "bent-keyframe": "a keyframe bends an appendage, where `embed` writes zeros",
    "carried-apart": "a body stands beside the port that carries it, across a rigid gap",
    "not-carried": "a body stands at a point of an appendage that does not carry it",
    "counted-twice": "the body that holds an appendage probably has the appendage's own mass",
    "collisions": "shapes of the appendages collide",
    "discrete-damping": "the integrator discrete damps the kept modes more than the structure does",
    "far-mount": "an appendage is mounted far outside of the spacecraft, probably because of a "
    "wrong unit",
    "file-units": "an imported file is probably in other units than stated",
    "half-units": "only one of the units of an imported file is stated",
    "equality": "equality constraints of the spacecraft are left out of the verification",
    "exact-in-time": "the appendages were made exact in time for the spacecraft's own step",
    "fit-missed": "the fit of an appendage missed a requirement",
    "gravity": "gravity acts on the spacecraft",
    "heavy-liquid": "the liquid of a tank outweighs the spacecraft many times over, probably "
    "because of a wrong unit",
    "high-damping": "a damping ratio of 0.1 or more is stated",
    "hinge-damping": "plain joint damping cannot give every mode its damping ratio",
    "huge-section": "a section is very wide for the appendage's length, probably because of a "
    "wrong unit",
    "inaccurate-step": "the scene's step is stable but misses the scene's tolerance",
    "joints-behind": "the appendage is mounted behind joints of the spacecraft",
    "held-ports": "the spacecraft's joints hold a port, wholly or in part",
    "large-motion": "a run or a keyframe exceeds a chain's large-motion limits",
    "large-motion-unknown": "the large-motion limits of the chain could not be computed",
    "last-mode": "the modes of an imported file end too soon for the scene's bandwidth",
    "least-damping": "damping ratios are lower than the least at which errors are compared",
    "left-certain": "structural properties that are uncertain are left certain in an uncertain "
    "plant",
    "light-material": "a density below that of foam is stated",
    "medium": "the density or viscosity of a medium causes drag on the links",
    "not-exact-in-time": "the spacecraft's integrator cannot be made exact in time",
    "other-hub": "the hub in the specification differs from that of the spacecraft",
    "other-step": "a model runs at another step or integrator than the one its appendages were "
    "made for",
    "overdamped": "nothing oscillates in a model; its step limits are left out",
    "long-delay": "a dead time is longer than a period of its loop",
    "points-inward": "an appendage probably runs the wrong way",
    "pose-in-radians": "the pose of a hinge, in degrees, is a common angle in radians",
    "ports-coupled": "two ports that should be independent are coupled in the compiled model",
    "preloaded-spring": "a spring of the spacecraft is preloaded at rest",
    "raised-inertia": "the polar inertia of very thin links was raised to MuJoCo's minimum",
    "rigid-plane": "a bending plane is rigid because [modes] names only the other one",
    "servo-saturates": "a servo that saturates may go on switching between its limits for ever",
    "slosh-tilt": "a load pushes the liquid of a tank so far aside that it is no pendulum any more",
    "slosh-weightless": "nothing presses the liquid of a tank onto its bottom",
    "slowed-modes": "modes too fast for the step were slowed",
    "slew-chain": "in a slew of a hinge the chains are off by more than the tolerance",
    "slew-step": "in a slew of a hinge the step is off by more than the tolerance",
    "soft-material": "a Young's modulus below that of rubber is stated",
    "stocky-beam": "Euler's beam theory is used for an appendage so short that shear matters",
    "tendon-damping": "Euler treats the damping of tendons explicitly",
    "imbalance": "a wheel's imbalance is so large that its unit is probably wrong",
    "ignored-damping": "an imported file holds damping, which is ignored, and none is stated",
    "impact-on-flexible": "a hinge was stopped at once beside a flexible body",
    "thrust-offset": "a thrust passes beside the centre of mass; its moment is taken as balanced",
    "time-error": "the poles of a model at its step are not those of exact motion",
    "turn-error": "the step's error in the rotation of the rigid spacecraft exceeds the tolerance",
    "undamped-modes": "a table of damping ratios leaves imported modes undamped",
    "unstable-step": "the step is beyond the integrator's stability limit",
    "written-out": "the spacecraft's file was written out by MuJoCo",
    "coloured-residuals": "what an identified model leaves of a log is not white",
    "delay": "torques of a log act later or earlier than the log says",
    "load-left-out": "a keyframe was judged without its load, which changes the motion",
    "log-gaps": "a log has gaps",
    "modes-refused": "[imported] refuses the modes that were identified",
    "model-order": "a log supports another number of modes than was asked for",
    "proportional-torques": "the torques of a log are multiples of each other",
    "prior-contradicted": "a log contradicts what was believed before",
    "sensor": "a sensor of a log saturates or is coarse",
    "undetermined": "a log does not determine something",
    "other": "anything else",
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


def warnings_record(warnings: Iterable[str]) -> dict[str, list[str] | list[dict[str, str]]]:
    """`warnings`, sentences, and `warning_codes`, each with its code,
    as they stand in every record."""
    said = list(warnings)
    coded = [{"code": w.code if isinstance(w, Caution) else "other", "text": str(w)} for w in said]
    return {"warnings": [str(w) for w in said], "warning_codes": coded}
