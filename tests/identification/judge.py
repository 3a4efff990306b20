"""Whether an identification is right, silent about what it does not know, or wrong:
a judge that knows the truth.

right            every determined number of every determined mode is the truth within its interval,
                 the interval is useful, and no mode that the log shows plainly is missing without
                 a word
undetermined     not right in that sense, but every number that is called determined holds, and the
                 record names each thing that is not: a mode's `determined` is False or its remark
                 names the quantity; for a missing mode a warning of the order or of the residuals,
                 or an undetermined mode near it. Sentences about anything else do not count
refused          an InputError; the caller knows whether that was to be expected
wrong            anything else: a number outside its interval, a wide interval without a word, a
                 missing mode, a mode that does not exist

A mode that does not exist counts as undetermined if the record names the higher mode whose samples
look the same. True modes closer to a found one than the resolution that the record states for it
count as one mode with their joint moment. The interval is that of all determined numbers of a case
together with 99.9 % (each is given its share).
"""

import re
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from flight_log import Elastic, as_seen

LEVEL = 1e-3  # probability that a case whose intervals are right has a number outside
# largest relative standard deviation
USEFUL = {"frequency": 0.02, "damping": 0.5, "participation": 0.25}
ROUNDING = 1e-7  # relative: what a deviation may be without any noise
SEEN = 1e-9  # of the largest row: a mode with less does not turn the hub
OF_MISSING = {"model-order", "coloured-residuals"}  # codes of warnings that admit a missing mode
FOLDED = 0.01  # relative: what a mode that is said to be possibly folded may change of the others
NEAR = 0.1  # of its frequency: a mode further from every true one does not exist


@dataclass(frozen=True)
class Judgement:
    """The verdict and its reasons."""

    verdict: str
    reasons: tuple[str, ...] = ()


def of_record(found):
    """The identified modes as a structure of the truth's kind."""
    modes = found.modes
    return Elastic(
        np.array([m.frequency for m in modes]),
        np.array([m.damping for m in modes]),
        np.array([np.nan_to_num(m.participation) for m in modes]).reshape(len(modes), 6).T,
        np.asarray(found.rigid),
    )


def said(found):
    """All that the record says in words."""
    return [
        *map(str, found.warnings),
        *map(str, found.undetermined),
        *(m.remark for m in found.modes if m.remark),
    ]


def admits_more(found, frequency):
    """Whether the record says that a mode near this frequency may be there."""
    codes = {getattr(one, "code", "") for one in found.warnings}
    near = [
        m
        for m in found.modes
        if not m.determined and abs(m.frequency - frequency) < NEAR * frequency
    ]
    return bool(near) or bool(codes & OF_MISSING)


def judge(found, elastic, axes, plain, hub=None):
    """The verdict on an `Identification`.

    `elastic` is the truth, `axes` the rotation rows that the log excites, and `plain` numbers, from
    0, those of its modes with such rows that the log shows plainly. With `hub`, modes are compared
    as that hub sees them: rotation held, translation free.
    """
    wrong, told, missed = [], [], []
    true_w = elastic.frequency
    true_z = elastic.damping
    true_l = elastic.participation[3:]
    record = of_record(found)
    w = record.frequency
    z = record.damping
    rows = record.participation[3:]
    if hub is not None and found.modes:
        true_w, true_z, true_l = as_seen(hub, elastic)
        w, z, rows = as_seen(hub, record)
    axes = list(axes)
    strength = np.abs(true_l[axes]).max(axis=0, initial=0.0)
    visible = np.flatnonzero(strength > SEEN * strength.max(initial=0.0))
    determined = [k for k, mode in enumerate(found.modes) if mode.determined]
    reach = norm.isf(LEVEL / 2.0 / max(1, len(determined) * (2 + len(axes))))
    # every true mode belongs to the nearest found one; those closer to it than the stated
    # resolution count as one with it
    nearest = {i: int(np.argmin(np.abs(w - true_w[i]))) for i in visible} if determined else {}
    taken = set()
    folded = False
    for k in determined:
        mode = found.modes[k]
        own = sorted((i for i in visible if nearest[i] == k), key=lambda i: abs(true_w[i] - w[k]))
        if not own or abs(true_w[own[0]] - w[k]) > NEAR * w[k]:
            image = re.search(rf"{w[k]:.5g} may be ([\d.e+]+)", " ".join(found.undetermined))
            rate = float(image[1]) - w[k] if image else np.inf
            higher = (
                np.abs(true_w[:, None] - w[k] - rate * np.arange(1, 6)) < NEAR * true_w[:, None]
            )
            folded |= image is not None and bool(higher.any())
            (told if folded else wrong).append(f"no mode at {w[k]:.5g} rad/s")
            continue
        one = [i for i in own if abs(true_w[i] - w[k]) <= mode.resolution]
        taken |= {own[0], *one}
        size = np.linalg.norm(rows[axes, k])
        values = {
            "frequency": (w[k], mode.frequency_std, w[k]),
            "damping": (z[k], mode.damping_std, z[k]),
        }
        if hub is None:
            values |= {
                f"participation {a}": (rows[a, k], mode.participation_std[3 + a], size)
                for a in axes
            }
        off = _off(values, true_w, true_z, true_l, axes, rows[:, k], [own[0]], reach)
        if off and len(one) > 1:
            off = _off(values, true_w, true_z, true_l, axes, rows[:, k], one, reach)
        missed += [f"{text} at {w[k]:.5g} rad/s" for text in off]
        for name, (value, std, scale) in values.items():
            if not np.isfinite(std):
                told.append(f"{name} at {w[k]:.5g} rad/s is not determined")
            elif std > USEFUL[name.split()[0]] * scale:
                (told if name.split()[0] in mode.remark else wrong).append(
                    f"{name} {value:.4g} at {w[k]:.5g} rad/s is known to {std:.2g} only"
                )
    # the inertia of a mode that is folded is put at the wrong frequency,
    # which the others feel a little
    (told if folded and missed and max(_share(one) for one in missed) < FOLDED else wrong).extend(
        missed
    )
    missing = [visible[rank] for rank in plain if visible[rank] not in taken]
    for i in missing:
        (told if admits_more(found, true_w[i]) else wrong).append(
            f"the mode at {true_w[i]:.5g} rad/s is missing"
        )
    if wrong:
        return Judgement("wrong", tuple(wrong))
    told += [
        f"{m.frequency:.5g} rad/s: {m.remark}"
        for m in found.modes
        if not m.determined and not m.remark.endswith("prior")
    ]
    return Judgement("undetermined" if told else "right", tuple(told))


def _off(values, w, z, rows, axes, found, members, reach):
    """What lies outside its interval, taking the true modes `members` as one:
    their span adds to the intervals."""
    span = np.ptp(w[members])
    moment = np.sqrt((rows[:, members] ** 2).sum(axis=1))
    sign = np.sign(found[axes] * rows[axes, members[0]])
    if len(members) == 1:
        sign = np.full(len(axes), 1.0 if found[axes] @ rows[axes, members[0]] >= 0.0 else -1.0)
    truth = {
        "frequency": (w[members].min(), w[members].max()),
        "damping": (z[members].min(), z[members].max() + span / w[members[0]]),
    }
    for s, a in zip(sign, axes, strict=True):
        value = s * (
            rows[a, members[0]] if len(members) == 1 else np.sign(rows[a, members[0]]) * moment[a]
        )
        slack = span / w[members[0]] * moment.max()
        truth[f"participation {a}"] = (value - slack, value + slack)
    out = []
    for name, (value, std, scale) in values.items():
        low, high = truth[name]
        beyond = max(low - value, value - high, 0.0)
        if np.isfinite(std) and beyond > reach * std + ROUNDING * scale:
            out.append(
                f"{name} {value:.6g} is not {low:.6g} to {high:.6g}, "
                f"{beyond / max(std, 1e-300):.1f} std,"
            )
    return out


def _share(text):
    """Relative deviation that a text of `_off` tells."""
    value, low, high = (
        float(one) for one in re.findall(r"(-?[\d.e+-]+)(?: is not| to|,)", text)[:3]
    )
    return max(low - value, value - high) / max(abs(value), 1e-300)
