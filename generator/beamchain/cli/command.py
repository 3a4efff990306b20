"""What every command does around its own work."""

from typing import Any

from typer import Exit
from typer.core import TyperCommand

from beamchain.cli.common import explain
from beamchain.errors import InputError
from beamchain.files import noted_inputs


class Command(TyperCommand):
    """A command whose words are text, whose inputs are noted, and which Ctrl-C ends."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Check that every word is text, then parse."""
        if not ctx.resilient_parsing:  # no completion is in progress
            for word in args:
                check_text(word)
        return super().parse_args(ctx, args)

    def invoke(self, ctx: Any) -> Any:
        """Run the command; what it reads it does not replace, and Ctrl-C ends it with one line."""
        try:
            with noted_inputs():
                return super().invoke(ctx)
        except KeyboardInterrupt:
            explain("stopped; nothing was left half written.")
            raise Exit(130) from None


def check_text(word: str) -> None:
    """Refuse bytes that are no text, which neither MuJoCo nor a report can show."""
    try:
        word.encode("utf-8")
    except UnicodeEncodeError:
        raise InputError(
            f"{word!r} is not UTF-8 text; rename the file, or give another name."
        ) from None
