"""`python -m beamchain`."""

from beamchain.cli import main

main()
