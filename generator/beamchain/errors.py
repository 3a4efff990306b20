"""The errors that beamchain raises. Every message names the field, the value,
what is allowed and the remedy."""

import re

LONGEST_WORD = 120  # letters; paths of ordinary folders are shorter
KEPT = 30  # letters at either end of a longer word


class BeamchainError(Exception):
    """Base class of every error that beamchain raises deliberately;
    the command line prints it and exits with status 2.

    Args:
        message: one sentence; words of more than 120 letters are shortened.

    Example:
        >>> import beamchain as bc
        >>> try:
        ...     bc.read_spec("missing.toml")
        ... except bc.BeamchainError as error:
        ...     print(type(error).__name__)
        InputError
    """

    def __init__(self, message: object = "") -> None:
        super().__init__(shorten_words(str(message)))


def shorten_words(text: str) -> str:
    """The text, with the middle of every word of more than `LONGEST_WORD` letters left out."""
    return re.sub(
        rf"\S{{{LONGEST_WORD + 1},}}", lambda word: f"{word[0][:KEPT]}...{word[0][-KEPT:]}", text
    )


class InputError(BeamchainError, ValueError):
    """A value the user gave cannot be used; the message names the field,
    the value and what is allowed.

    Example:
        >>> import beamchain as bc
        >>> bc.Round(diameter=-1.0)
        Traceback (most recent call last):
            ...
        beamchain.errors.InputError: diameter = -1.0 must be above zero (m). ...
    """


class OutputError(BeamchainError, OSError):
    """A file or folder cannot be written.

    Example:
        >>> import beamchain as bc
        >>> section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
        >>> spec = bc.Spec(segment=(bc.Segment(length=8.0, section=section),))
        >>> bc.fit(spec).write("/proc/fit")
        Traceback (most recent call last):
            ...
        beamchain.errors.OutputError: ...
    """


class RealisationError(BeamchainError, ArithmeticError):
    """No physical chain (all masses, lengths and stiffnesses positive) has the
    wanted port behaviour.

    Example:
        >>> import beamchain as bc
        >>> steel = bc.Material(youngs_modulus=2.06e11, density=7800.0)
        >>> rod = bc.Segment(length=15.0, section=bc.Round(diameter=0.012), material=steel)
        >>> payload = bc.Lump(x=15.0, mass=1e11)
        >>> bc.fit(bc.Beam(segments=(rod,), lumps=(payload,)), target="free")
        Traceback (most recent call last):
            ...
        beamchain.errors.RealisationError: with 2 free modes the root is too light ...
    """


class EngineError(BeamchainError, RuntimeError):
    """MuJoCo rejected a model, or its results cannot be used.

    Example:
        >>> import beamchain as bc
        >>> bc.linearise("<mujoco><worldbody/></mujoco>")
        Traceback (most recent call last):
            ...
        beamchain.errors.EngineError: ...
    """
