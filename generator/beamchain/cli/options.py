"""Options as they are typed: one that takes one value refuses a second,
where the last would win in silence."""

from typing import Any

from typer import Exit
from typer.core import TyperCommand

from beamchain.cli.common import explain
from beamchain.errors import InputError
from beamchain.files import noted_inputs


class OneValueEach(TyperCommand):
    """A command whose options take one value each, but for those that are declared as lists.

    A flag may be repeated; one that is both set and unset is refused.
    """

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Refuse repeated options, then parse."""
        if not ctx.resilient_parsing:  # no completion is in progress
            for word in args:
                check_text(word)
            self._refuse_repeated(ctx, args)
        return super().parse_args(ctx, args)

    def invoke(self, ctx: Any) -> Any:
        """Run the command; what it reads it does not replace, and Ctrl-C ends it with one line."""
        try:
            with noted_inputs():
                return super().invoke(ctx)
        except KeyboardInterrupt:
            explain("stopped; nothing was left half written.")
            raise Exit(130) from None

    def _refuse_repeated(self, ctx: Any, args: list[str]) -> None:
        """Parse once with every value kept, and refuse options with several."""
        parser = self.make_parser(ctx)
        options = [param for param in self.get_params(ctx) if param.param_type_name == "option"]
        single: list[Any] = [one for one in options if not getattr(one, "multiple", False)]
        for option in single:
            if not option.is_flag:
                parser.add_option(
                    option, option.opts, option.name, action="append", nargs=option.nargs
                )
            elif option.secondary_opts:
                for names, const in (
                    (option.opts, option.opts[0]),
                    (option.secondary_opts, option.secondary_opts[0]),
                ):
                    parser.add_option(
                        option, names, option.name, action="append_const", const=const
                    )
        try:
            values: dict[str, Any] = parser.parse_args(args=list(args))[0]
        except Exception:  # wrong usage of another kind: the parse that follows says so
            return
        for option in single:
            given = values.get(option.name)
            if given == [""]:
                raise InputError(
                    f"{'/'.join(option.opts)} is empty; give a value, or leave it out."
                )
            if not isinstance(given, list) or len(given) < 2:
                continue
            name = "/".join(option.opts)
            if not option.is_flag:
                words = " and ".join(repr(value) for value in given)
                raise InputError(
                    f"{name} is given {len(given)} times, with {words}, but takes one value; leave "
                    "all but one out."
                )
            if len(set(given)) > 1:
                raise InputError(
                    f"{' and '.join(sorted(set(given)))} are both given; leave one out."
                )


def check_text(word: str) -> None:
    """Refuse bytes that are no text, which neither MuJoCo nor a report can show."""
    try:
        word.encode("utf-8")
    except UnicodeEncodeError:
        raise InputError(
            f"{word!r} is not UTF-8 text; rename the file, or give another name."
        ) from None
