"""What the packages beside the core stand on, and yours may: linear craft and their signals, poses,
uncertain quantities, the algebra of linear systems, the marks of timing.

They import nothing else of the core than this, `beamchain` itself with `spec`, `results`, `report`
and `commands`, and the modules at its top (`errors`, `checks`, `files`, `warning_codes`,
`import_lock`).
"""

from beamchain.import_lock import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
