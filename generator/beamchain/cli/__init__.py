"""The command line: parse, call, print."""

import os
import sys

import typer

from beamchain.cli import embed, examples, fit, init, inspect, render, retime, schema, seed, stability, study, sweep
from beamchain.cli.common import explain, version
from beamchain.errors import BeamchainError

app = typer.Typer(
    name="beamchain",
    help="Flexible spacecraft appendages for MuJoCo: hinge chains that push back on the hub exactly as the beam does.",
    no_args_is_help=True,
    add_completion=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
)


@app.callback()
def beamchain(
    _version: bool = typer.Option(
        False, "--version", callback=version, is_eager=True, help="Print the version and exit."
    ),
) -> None:
    """Flexible spacecraft appendages for MuJoCo: hinge chains that push back on the hub exactly as the beam does."""


app.command(name="fit")(fit.fit)
app.command(name="embed")(embed.embed)
app.command(name="seed")(seed.seed)
app.command(name="study")(study.study)
app.command(name="sweep")(sweep.sweep)
app.command(name="stability")(stability.stability)
app.command(name="inspect")(inspect.inspect)
app.command(name="retime")(retime.retime)
app.command(name="schema")(schema.schema)
app.command(name="render")(render.render)
app.command(name="view")(render.view)
app.command(name="init")(init.init)
app.command(name="examples")(examples.examples)


def main() -> None:
    """Entry point: 0 done, 2 bad input, 3 done but a stated tolerance was missed."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # matrices are small: threads only wait for each other
    try:
        app()
    except BeamchainError as error:
        explain(str(error))
        sys.exit(2)
    except KeyboardInterrupt:
        explain("stopped; nothing was left half written.")
        sys.exit(130)
    except BrokenPipeError:
        sys.exit(0)
    except OSError as error:  # of standard output: files have their own
        explain(f"cannot write the output: {error.strerror or error}; what was asked for in files is written.")
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # the rest of it, at exit
        sys.exit(2)
    except (MemoryError, RecursionError) as error:
        explain(f"the input is too large ({type(error).__name__}); make it smaller.")
        sys.exit(2)
