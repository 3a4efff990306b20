"""What a command of your own needs to read and to say what those of beamchain do: options, poses
and signals as the user types them, tables, warnings and files.

A package adds its commands by the entry points `beamchain.commands`.
"""

from beamchain.import_lock import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
