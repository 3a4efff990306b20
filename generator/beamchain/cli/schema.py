"""`beamchain schema`: JSON schema of SPEC.toml."""

from beamchain.cli.common import Force, Json, Quiet
from beamchain.cli.output import print_json


def schema(as_json: Json = False, force: Force = False, quiet: Quiet = False) -> None:
    """Print the JSON schema of SPEC.toml, for editors.

    Example: beamchain schema > spec.schema.json
    """
    from beamchain.fitting.spec import schema as spec_schema

    if not quiet or as_json:
        print_json(spec_schema())
