"""A compliant hinge line between segments."""

from typing import Annotated

from beamchain.checks import Struct, field
from beamchain.errors import InputError


class Joint(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A compliant hinge line between segments; a stiffness left out is rigid.

    Example:
        >>> import beamchain as bc
        >>> bc.Joint(after_segment=1, stiffness_xy=600.0).stiffness("xy")
        600.0
    """

    after_segment: Annotated[
        int, field("number of the segment at whose tip end it stands; 0 is the root", "", least=0, most=10000)
    ]
    stiffness_xy: Annotated[
        float | None,
        field("rotational stiffness in plane xy", "N m/rad", above=0.0, cure="Leave it out for a rigid joint."),
    ] = None
    stiffness_xz: Annotated[
        float | None,
        field("rotational stiffness in plane xz", "N m/rad", above=0.0, cure="Leave it out for a rigid joint."),
    ] = None
    stiffness_torsion: Annotated[
        float | None,
        field("rotational stiffness about x", "N m/rad", above=0.0, cure="Leave it out for a rigid joint."),
    ] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.stiffness_xy is None and self.stiffness_xz is None and self.stiffness_torsion is None:
            raise InputError(
                "the joint gives no stiffness; give stiffness_xy, stiffness_xz or stiffness_torsion, or remove it."
            )

    def stiffness(self, port: str) -> float | None:
        """Stiffness in a port [N m/rad]; None: rigid."""
        return getattr(self, f"stiffness_{port}", None)
