"""What is kept of an appendage: the modes that are stated, or the fewest that its scene needs."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from beamchain.errors import InputError
from beamchain.fitting.body import Body
from beamchain.fitting.candidate import Candidate, free_ports
from beamchain.fitting.grow import grow, prune
from beamchain.fitting.kept import (
    Choice,
    Kept,
    LeftOut,
    first_of_ports,
    numbered,
    of_ports,
)
from beamchain.fitting.needs import AXES, MOST
from beamchain.fitting.options import Scene
from beamchain.ports.compare import keeps_tolerance, tolerance_statement

LISTED = 6  # modes left out whose cost is worked out each by itself; the rest stands in one line


def select(body: Body, target: str | None = None) -> Kept:
    """The modes of an appendage that are kept; `target`: of those that the scene chooses, in place
    of the specification's."""
    spec = body.spec
    if spec.slosh is not None:
        return numbered(body, range(1, 2 * spec.slosh.kept + 1))
    named = None if spec.imported is None else spec.imported.modes
    if named is not None and spec.modes is not None:
        raise InputError(
            "[modes] and imported.modes are both given; name the modes by number "
            "(imported.modes) or count them per port ([modes])."
        )
    if not spec.chooses or named is not None:
        return _stated(body)
    _check_typed(body)
    able = ["clamped", "hub"]
    if body.couples or spec.further or body.hub is None:
        able = able[:1]
    wanted = target or spec.root.target
    return _chosen(body, able if wanted in (None, "auto") else [str(wanted)])


def _stated(body: Body) -> Kept:
    """The modes that a specification states; of imported ones all where it states none."""
    spec, data = body.spec, body.data
    target = "clamped" if spec.root.target in (None, "auto") else str(spec.root.target)
    if data is None:
        _check_typed(body)
        return Kept(target, dict(spec.kept))
    numbers = None if spec.imported is None else spec.imported.modes
    if numbers is None and spec.modes is not None:
        numbers = first_of_ports(data, spec.modes.counts())
    if numbers:
        data.check_numbers(numbers)
    kept = numbered(body, range(1, data.modes + 1) if numbers is None else numbers, target)
    if target != "clamped":
        first = tuple(range(1, len(kept.numbers) + 1))
        lowest = first if kept.coupled_ports else first_of_ports(data, kept.counts)
        if kept.numbers != lowest:
            raise InputError(
                f'modes {list(kept.numbers)} of the file and root.target = "{target}" do not go '
                f"together: that target takes the lowest modes, here {list(lowest)}; write "
                f'imported.modes = {list(lowest)}, or target = "clamped".'
            )
    return kept


def _chosen(body: Body, targets: Sequence[str]) -> Kept:
    """The fewest modes that keep the promise, or the best there are; the first of `targets` wins a
    tie."""
    promise, scene = body.promise, body.spec.scene
    assert promise is not None
    assert scene is not None
    tried: list[Kept] = []
    free = free_ports(body.spec)
    enough = np.inf  # modes with which a target before keeps the promise

    def may_keep(_: int, item: Candidate) -> bool:
        counts = item.kept.counts
        few = body.couples or all(counts.get(port, 0) <= MOST for port in free)
        return few and item.modes <= enough

    for target in targets:
        least = _least(body, target)
        grown, steps = grow({"hub": promise}, [Candidate(body, least)], scene.tolerance, may_keep)
        found = prune(promise, grown[0], least, scene.tolerance)
        error = promise.of_models([found.model])
        if keeps_tolerance(error, scene.tolerance):
            enough = found.modes
        choice = Choice(
            modes={port: found.kept.counts.get(port, 0) for port in body.ports},
            target=target,
            error=error,
            met=keeps_tolerance(error, scene.tolerance),
            left_out=(),
            cannot=(),
            reasoning=tuple(
                f"{step.added}: in-band error {step.before:.2e} -> {step.after:.2e}"
                for step in steps
            ),
        )
        tried.append(replace(found.kept, choice=choice))
    return _explained(body, tried, scene)


def _explained(body: Body, tried: Sequence[Kept], scene: Scene) -> Kept:
    """The best of what was tried, with what it leaves out and how it was found."""
    choices = [kept.choice for kept in tried if kept.choice is not None]
    ranks = [(not c.met, sum(c.modes.values()) if c.met else c.error) for c in choices]
    at = min(range(len(tried)), key=lambda k: ranks[k])
    best, kept = choices[at], tried[at]
    item = Candidate(body, kept)
    ledger = _ledger_of_modes(item) if body.couples else _ledger_of_ports(item)
    lines = [_result_of_target(c, scene.tolerance) for c in choices]
    chosen = f'chosen: target "{best.target}", {sum(best.modes.values())} flexible modes'
    choice = replace(
        best,
        left_out=tuple(ledger),
        cannot=tuple(_cannot(item, tip=scene.tip)),
        reasoning=(*lines, chosen, *best.reasoning),
    )
    return replace(kept, choice=choice)


def _least(body: Body, target: str) -> Kept:
    """What is kept whatever the error: the modes that were typed, and for the tip those in the
    band."""
    spec, scene = body.spec, body.spec.scene
    fixed = {} if spec.modes is None else spec.modes.given()
    band = scene.bandwidth if scene is not None and scene.tip else None
    if body.data is None or not body.couples:
        inside = {
            port: min(int(np.sum(model.frequencies <= (band or 0.0))), MOST)
            for port, model in body.ports.items()
            if port in ("xy", "xz")
        }
        return of_ports(body, inside | fixed, target)
    numbers = {*first_of_ports(body.data, fixed)}
    for k, w in enumerate(body.data.frequencies, 1):
        if w <= (band or 0.0) and body.data.belongs[k - 1] not in fixed:
            numbers.add(k)
    return numbered(body, sorted(numbers), target)


def _result_of_target(choice: Choice, tolerance: float) -> str:
    """What the search for a target ended with, in a line."""
    kept = [f"{count} in {port}" for port, count in choice.modes.items() if count]
    above = "" if choice.met else f" ({tolerance_statement(choice.error, tolerance)})"
    return (
        f'target "{choice.target}": {", ".join(kept) or "rigid"}, '
        f"in-band error {choice.error:.2e}{above}"
    )


def _ledger_of_ports(item: Candidate) -> Iterator[LeftOut]:
    """What was left out of each port, and the error it costs by itself."""
    promise = item.body.promise
    assert promise is not None
    for port, model in item.body.ports.items():
        kept = item.kept.counts.get(port, 0)
        if kept >= model.modes:
            continue
        first = float(model.frequencies[kept])
        what = f"{port} (first mode {first:.3g} rad/s)"
        if kept:
            what = f"{port} mode {kept + 1} ({first:.3g} rad/s)"
        if not promise.reaches(port):
            axes = [name for name, i in AXES.items() if i in promise.asked]
            yield LeftOut(what, f"no path to hub axes {', '.join(axes)}", 0.0)
            continue
        if kept:
            what += " and above"
        where = "outside" if first > promise.band else "inside"
        cost = promise.of_exchange(0, item.without(port))
        yield LeftOut(what, f"{where} {promise.band:.4g} rad/s", cost)


def _ledger_of_modes(item: Candidate) -> Iterator[LeftOut]:
    """What was left out of modes that couple ports, the heaviest first, and what each costs by
    itself; beyond the heaviest, together."""
    promise, data = item.body.promise, item.body.data
    assert promise is not None
    assert data is not None
    weight = item.weights(promise.band)
    left = [k for k in np.argsort(-weight) if k + 1 not in item.kept.numbers]
    for k in left[:LISTED]:
        where = "outside" if data.frequencies[k] > promise.band else "inside"
        others = [other for other in range(data.modes) if other != k]
        cost = promise.of_exchange(0, item.body.space.picked(others))
        what = f"mode {k + 1} of the file ({data.belongs[k]}, {data.frequencies[k]:.3g} rad/s)"
        yield LeftOut(what, f"{where} {promise.band:.4g} rad/s", cost)
    rest = left[LISTED:]
    if rest:
        kept = [k for k in range(data.modes) if k not in rest]
        cost = promise.of_models([item.body.space.picked(kept)])
        yield LeftOut(f"{len(rest)} lighter modes", "together within the tolerance", cost)


def _cannot(item: Candidate, *, tip: bool) -> Iterator[str]:
    """What a model with these modes has no answer to."""
    data = item.body.data
    if item.body.couples and data is not None:
        left = [w for k, w in enumerate(data.frequencies, 1) if k not in item.kept.numbers]
        yield from (f"motion above {w:.3g} rad/s" for w in left[:1])
    else:
        for port, model in item.body.ports.items():
            kept = item.kept.counts.get(port, 0)
            if not kept:
                word = {"torsion": "twist and torsion loads", "axial": "axial loads"}.get(
                    port, f"bending loads in {port}"
                )
                yield f"{word}: {port} is rigid"
            elif kept < model.modes:
                yield f"{port} motion above {model.frequencies[kept]:.3g} rad/s"
    if not tip:
        yield (
            "tip pointing: the chain is right at the root; set scene.tip = true where the tip "
            "matters"
        )


def _check_typed(body: Body) -> None:
    """Every independent port has as many modes as were typed."""
    given = {} if body.spec.modes is None or body.couples else body.spec.modes.given()
    for port, count in given.items():
        if count and port not in body.ports:
            raise InputError(
                f"modes.{port} = {count} but the appendage is rigid there; set it to 0."
            )
        if count and count > body.ports[port].modes:
            raise InputError(
                f"modes.{port} = {count}, but the appendage has only {body.ports[port].modes} "
                "there; ask for fewer."
            )
