"""Flexible spacecraft appendages for MuJoCo: hinge chains with the modes of the elastic structure.

The names stand in `__init__.pyi`. Each is imported when it is first asked for, MuJoCo with it.
"""

from importlib.metadata import version

from beamchain.late import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
__version__ = version("beamchain")
