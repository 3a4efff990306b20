"""What a log cannot tell apart: two modes close to each other,
and a mode from one that lies the sample rate higher."""

from dataclasses import replace

import numpy as np

from beamchain.identification.likelihood import Found, Likelihood, derivatives, inverse
from beamchain.identification.response import Piece
from beamchain.identification.result import Identification
from beamchain.identification.structure import (
    Parts,
    Structure,
    Unknown,
    frozen_inertia,
    rotation,
)
from beamchain.toolkit import Array

SPLIT = 1.0  # trial separation in half widths of the mode
MORE = 6.0  # numbers that one mode more has, which the criterion prices


def resolution(structure: Structure, found: Found, likelihood: Likelihood, mode: int) -> float:
    """Separation [rad/s] from which two modes of equal participation in place of `mode` would be
    distances apart; inf if never.

    The mode is split in two; the information on their separation grows with its square,
    so that one trial tells.
    """
    parts = structure.parts(found.theta)
    w = parts.frequencies[mode]
    half = parts.damping[mode] * parts.frequencies[mode] * SPLIT / 2.0
    order = [*range(structure.modes), mode]
    frequencies = parts.frequencies[order]
    frequencies[[mode, -1]] = w - half, w + half
    rows = parts.participation[order]
    rows[[mode, -1]] /= np.sqrt(2.0)
    two = replace(structure, live=structure.live[order])
    theta = two.theta(
        Parts(frequencies, parts.damping[order], rows, parts.rigid, parts.hub),
        found.theta[structure.places[3]],
        structure.delay(found.theta),
    )
    split = Likelihood(likelihood.pieces, two.raw, likelihood.scale)
    try:
        matrix = split.normal(theta, likelihood.weights(found.squares))[1]
    except (np.linalg.LinAlgError, ValueError):
        return float("inf")

    def apart(x: Array) -> Array:
        now = two.parts(x).frequencies
        return now[-1:] - now[mode : mode + 1]

    slope = derivatives(apart, theta)[0]
    deviation = float(np.sqrt(max(slope @ inverse(matrix) @ slope, 0.0)))
    sure = np.sqrt(MORE * np.log(max(float(likelihood.counts.sum()), 2.0)))
    return float(np.sqrt(2.0 * sure * deviation * 2.0 * half))


def images(structure: Structure, found: Found, likelihood: Likelihood) -> list[tuple[float, float]]:
    """Modes and where they may lie instead: equal samples are the same if a frequency is higher
    by the sample rate.

    With torque held between samples, such a mode has its moment's square larger by the ratio of the
    frequencies; where that is more than the appendage's inertia, it is excluded.
    """
    pieces = likelihood.pieces
    if not all(isinstance(piece, Piece) and piece.even for piece in pieces):
        return []
    rates = [
        2.0 * np.pi * (p.time.size - 1) / float(p.time[-1] - p.time[0])
        for p in pieces
        if isinstance(p, Piece)
    ]
    if np.ptp(rates) > 1e-3 * rates[0]:
        return []  # logs of different rates tell a mode from its image
    parts = structure.parts(found.theta)
    inertia, moments, _ = rotation(parts)
    gained = inertia - frozen_inertia(parts.hub)
    return [
        (w, w + rates[0])
        for w, row in zip(parts.frequencies.tolist(), moments, strict=True)
        if float(row @ row) ** 2 * (w + rates[0]) / w < float(row @ gained @ row)
    ]


def add_resolution(
    result: Identification, structure: Structure, found: Found, likelihood: Likelihood
) -> Identification:
    """The result with `resolution` of the modes found in the log,
    and sentences on what looks the same.

    With a prior the frequencies depend on rows that the log does not show;
    then no resolution is stated.
    """
    alone = isinstance(structure.body, Unknown)
    number_of = {float(w): i for i, w in enumerate(structure.parts(found.theta).frequencies)}
    modes = tuple(
        replace(
            mode, resolution=resolution(structure, found, likelihood, number_of[mode.frequency])
        )
        if alone and mode.determined
        else mode
        for mode in result.modes
    )
    messages = list(result.undetermined)
    if distances := ", ".join(
        f"{m.resolution:.2g} at {m.frequency:.5g}" for m in modes if np.isfinite(m.resolution)
    ):
        messages.append(
            "modes closer to each other than this would be found as one, of their joint moment "
            f"[rad/s]: {distances}."
        )
    if higher := images(structure, found, likelihood):
        messages.append(
            "equal steps cannot tell a mode from one that lies the sample rate or a multiple of it "
            "higher: "
            + ", ".join(f"{w:.5g} may be {image:.5g} rad/s" for w, image in higher)
            + "; sample faster, or unequally, where such modes are possible."
        )
    return replace(result, modes=modes, undetermined=tuple(messages))
