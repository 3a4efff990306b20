"""The errors that beamchain raises. Every message names the field, the value, what is allowed and the remedy."""


class BeamchainError(Exception):
    """Base class of every error that beamchain raises deliberately; the command line prints it and exits with status 2.

    Example:
        >>> import beamchain as bc
        >>> try:
        ...     bc.read_spec("missing.toml")
        ... except bc.BeamchainError as error:
        ...     print(type(error).__name__)
        InputError
    """


class InputError(BeamchainError, ValueError):
    """A value the user gave cannot be used.

    Example:
        >>> import beamchain as bc
        >>> bc.Round(diameter=-1.0)
        Traceback (most recent call last):
            ...
        beamchain.errors.InputError: diameter = -1.0 must be above zero (m). Give diameter a positive value.
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
    """No physical chain (all masses, lengths and stiffnesses positive) has the wanted port behaviour.

    Example:
        >>> import beamchain as bc
        >>> steel = bc.Material(youngs_modulus=2.06e11, density=7800.0)
        >>> rod = bc.Segment(length=15.0, section=bc.Round(diameter=0.012), material=steel)
        >>> payload = bc.Lump(x=15.0, mass=1e11)
        >>> bc.fit(bc.Beam(segments=(rod,), lumps=(payload,)), target="free")
        Traceback (most recent call last):
            ...
        beamchain.errors.RealisationError: with 2 free modes the root is too light beside the rest: ...
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
