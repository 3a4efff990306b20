"""What a SPEC and the files beside it are made of: their tables, and what makes one."""

from beamchain.import_lock import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
