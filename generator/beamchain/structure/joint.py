"""A compliant hinge line between segments."""

from beamchain.checks import Struct, own_numbers, positive, whole
from beamchain.errors import InputError


class Joint(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A compliant hinge line after a segment; a stiffness left out is rigid.

    Args:
        after_segment: 1, 2, ...; 0: at the root.
        stiffness_xy: [N m/rad].
        stiffness_xz: [N m/rad].
        stiffness_torsion: [N m/rad].
    """

    after_segment: int
    stiffness_xy: float | None = None
    stiffness_xz: float | None = None
    stiffness_torsion: float | None = None

    def __post_init__(self) -> None:
        own_numbers(self)
        whole("after_segment", self.after_segment, 0, 10_000)
        for name in ("stiffness_xy", "stiffness_xz", "stiffness_torsion"):
            if getattr(self, name) is not None:
                positive(name, getattr(self, name), "N m/rad", cure="Leave it out for a rigid joint.")
        if self.stiffness_xy is None and self.stiffness_xz is None and self.stiffness_torsion is None:
            raise InputError(
                "the joint gives no stiffness; give stiffness_xy, stiffness_xz or stiffness_torsion, or remove it."
            )

    def stiffness(self, port: str) -> float | None:
        """Stiffness in a port [N m/rad]; None: rigid."""
        return getattr(self, f"stiffness_{port}", None)
