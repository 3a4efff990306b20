"""Nastran-like prints made for the tests, and the structures whose modes they hold:
nothing of beamchain is used."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial.legendre import Legendre, leggauss
from scipy.linalg import eigh


@dataclass(frozen=True)
class Modes:
    """Frequencies [rad/s], participation rows (6 per mode),
    rigid mass about the origin; any units."""

    frequencies: np.ndarray
    participation: np.ndarray
    mass: np.ndarray
    generalized: np.ndarray | None = None

    def in_units(self, length: float, mass: float) -> "Modes":
        """The same in units of `length` metres and `mass` kilograms."""
        turn = np.array([1.0, 1.0, 1.0, 1.0 / length, 1.0 / length, 1.0 / length])
        return replace(
            self,
            participation=self.participation / np.sqrt(mass) * turn,
            mass=self.mass / mass * np.outer(turn, turn),
        )


def plate(count: int = 21, *, length=0.21, width=0.09, thickness=0.0012, corner=True) -> Modes:
    """A thin cantilever plate in the plane z = 0, clamped along x = 0,
    by Ritz with x^2 P_i(x) P_j(y); SI.

    The reference point is a corner (or the middle) of the clamped edge,
    so that bending and torsion are coupled.
    """
    e, nu, rho, n = 7.1e10, 0.33, 2750.0, 9
    d = e * thickness**3 / 12.0 / (1.0 - nu**2)
    points, weights = leggauss(24)
    x = (points + 1.0) * length / 2.0
    wx = weights * length / 2.0
    y = (points + 1.0) * width / 2.0
    wy = weights * width / 2.0
    fx = np.zeros((3, n, x.size))
    fy = np.zeros((3, n, y.size))
    for i in range(n):
        p = Legendre.basis(i, domain=[0.0, length])
        q = Legendre.basis(i, domain=[0.0, width])
        square = Legendre([1.0 / 3.0, 0.5, 1.0 / 6.0], domain=[0.0, length])  # (x / length)^2
        function = p * square
        for k in range(3):
            fx[k, i] = function.deriv(k)(x) if k else function(x)
            fy[k, i] = q.deriv(k)(y) if k else q(y)
    ix = np.einsum("aip,bjp,p->abij", fx, fx, wx)
    iy = np.einsum("aip,bjp,p->abij", fy, fy, wy)

    def product(a, b, c, f):
        return np.einsum("ij,kl->ikjl", ix[a, b], iy[c, f]).reshape(n * n, n * n)

    mass = rho * thickness * product(0, 0, 0, 0)
    mixed = product(2, 0, 0, 2)
    stiffness = d * (
        product(2, 2, 0, 0)
        + product(0, 0, 2, 2)
        + nu * (mixed + mixed.T)
        + 2.0 * (1.0 - nu) * product(1, 1, 1, 1)
    )
    squares, shapes = eigh(stiffness, mass)
    shapes = shapes[:, :count]
    m = rho * thickness

    def moment(px, py):
        return (
            m * np.einsum("i,j->ij", fx[0] @ (wx * x**px), fy[0] @ (wy * (y - shift) ** py)).ravel()
        )

    shift = 0.0 if corner else width / 2.0
    rows = np.zeros((count, 6))
    rows[:, 2] = moment(0, 0) @ shapes
    rows[:, 3] = moment(0, 1) @ shapes
    rows[:, 4] = -(moment(1, 0) @ shapes)
    total = m * length * width
    cx, cy = length / 2.0, width / 2.0 - shift
    xx = total * length**2 / 3.0
    yy = total * (width**2 / 12.0 + cy**2)
    rigid = np.diag([total, total, total, yy, xx, xx + yy])
    rigid[3, 4] = rigid[4, 3] = -total * cx * cy
    for i, j, v in ((0, 5, -cy), (1, 5, cx), (2, 3, cy), (2, 4, -cx)):
        rigid[i, j] = rigid[j, i] = total * v
    return Modes(np.sqrt(squares[:count]), rows, rigid)


def cantilever(turn: float = 0.0) -> Modes:
    """A Nastran cantilever of two lumped CBARs, its printed numbers;
    the pairs turned by an angle."""
    w = 2.0 * np.pi * np.array([63.70329, 63.70329, 319.9485, 319.9485, 1240.472])
    rows = np.zeros((5, 6))
    for k, (force, moment) in ((0, (-3.462030, -2.774607)), (2, (-1.979560, -0.5036983))):
        rows[k, [1, 5]] = force, moment
        rows[k + 1, [2, 4]] = force, -moment
    rows[4, 0] = 3.930588
    c = np.cos(turn)
    s = np.sin(turn)
    for k in (0, 2):
        rows[[k, k + 1]] = np.array([[c, s], [-s, c]]) @ rows[[k, k + 1]]
    m = 21.20575
    about = 2.650718 + 21.20575 * 0.25
    rigid = np.diag([m, m, m, 0.0, about, about])
    rigid[1, 5] = rigid[5, 1] = 0.5 * m
    rigid[2, 4] = rigid[4, 2] = -0.5 * m
    return Modes(w, rows, rigid)


# -- the print -------------------------------------------------------------------------------------
BLANK = " " * 132


def number(value: float) -> str:
    return f"{value:.6E}"


class Print:
    """A print as Nastran writes it: pages with headings, tables that pages may break.

    Args:
        style: "msc" or "simcenter".
        rows: of a table per page.
    """

    def __init__(self, style: str = "msc", rows: int = 50) -> None:
        self.style, self.rows, self.lines, self.page = style, rows, [], 0

    def text(self) -> str:
        return (
            "\r\n".join(self.lines) + "\r\n"
            if self.style == "msc"
            else "\n".join(self.lines) + "\n"
        )

    def head(self, subcase: int) -> None:
        self.page += 1
        name = "MSC Nastran 12/ 1/17" if self.style == "msc" else "SIMCENTER NASTRAN  3/22/19"
        self.lines += [f"1    PANEL{'':60}MAY   5, 2026  {name}   PAGE {self.page:5d}", BLANK]
        if self.style == "simcenter":
            self.lines.append("0")
        self.lines += [f"0{'':101}SUBCASE {subcase}              ", ""]

    def echo(self) -> None:
        """Case control echo, which names what a reader looks for."""
        self.lines += [
            "0        C A S E    C O N T R O L    E C H O",
            "     9      MEFFMASS(PRINT,ALL) = YES",
            "    10      SUBCASE 1",
        ]

    def _table(self, subcase: int, title: list[str], rows: list[str], end: list[str]) -> None:
        for at in range(0, len(rows), self.rows):
            self.head(subcase)
            self.lines += [*title, *rows[at : at + self.rows]]
        self.lines += [*end, "", ""]

    def eigenvalues(self, modes: Modes, subcase: int = 1) -> None:
        m = np.ones(modes.frequencies.size) if modes.generalized is None else modes.generalized
        title = [
            f"{'':46}R E A L   E I G E N V A L U E S",
            "   MODE    EXTRACTION      EIGENVALUE            RADIANS             CYCLES           "
            " GENERALIZED         GENERALIZED",
            "    NO.       ORDER                                                                   "
            "    MASS              STIFFNESS",
        ]
        rows = [
            f"{k:9d} {k:9d}        "
            + "        ".join(number(v) for v in (w**2, w, w / 2 / np.pi, g, g * w**2))
            for k, (w, g) in enumerate(zip(modes.frequencies, m, strict=True), 1)
        ]
        self._table(subcase, title, rows, [])

    def sixes(
        self, modes: Modes, values: np.ndarray, title: str, subcase: int = 1, *, total: bool = True
    ) -> None:
        head = [
            f"{'':53}{title}",
            "",
            "    MODE     FREQUENCY               T1                T2                T3           "
            "     R1                R2                R3",
            "     NO.",
            "",
        ]
        rows = [
            f"{k:8d}    {number(w / 2 / np.pi)}     "
            + "     ".join(f"{number(v):>13}" for v in row)
            for k, (w, row) in enumerate(zip(modes.frequencies, values, strict=True), 1)
        ]
        sums = "     ".join(f"{number(v):>13}" for v in values.sum(axis=0))
        self._table(subcase, head, rows, ["", f"{'':18}TOTAL      {sums}"] if total else [])

    def factors(self, modes: Modes, subcase: int = 1) -> None:
        m = np.ones(modes.frequencies.size) if modes.generalized is None else modes.generalized
        self.sixes(
            modes, modes.participation / np.sqrt(m)[:, None], "MODAL PARTICIPATION FACTORS", subcase
        )

    def effective(self, modes: Modes, subcase: int = 1) -> None:
        self.sixes(modes, modes.participation**2, "     MODAL EFFECTIVE MASS   ", subcase)

    def fractions(self, modes: Modes, subcase: int = 1) -> None:
        for words, at in (("TRANSLATIONAL", 0), ("ROTATIONAL", 3)):
            title = [f"{'':52}MODAL EFFECTIVE MASS FRACTION"]
            title += [f"{'':48}(FOR {words} DEGREES OF FREEDOM)"] if self.style == "msc" else []
            title += [
                "",
                "    MODE    FREQUENCY                      T1                                  T2",
                "     NO.",
                "",
            ]
            part = modes.participation[:, at : at + 3] ** 2 / np.maximum(
                np.diag(modes.mass)[at : at + 3], 1e-30
            )
            rows = [
                f"{k:8d}    {number(w / 2 / np.pi)}      "
                + "      ".join(f"{number(v)}      {number(v)}" for v in row)
                for k, (w, row) in enumerate(zip(modes.frequencies, part, strict=True), 1)
            ]
            self._table(subcase, title, rows, [])

    def matrix(self, title: str, values: np.ndarray) -> None:
        stars = f"{'':23}***{'':82}***"
        self.lines += [f"{'':53}{title}", stars]
        self.lines += [f"{'':23}* {' '.join(f'{number(v):>13}' for v in row)} *" for row in values]
        self.lines += [stars, ""]

    def summary(self, modes: Modes, subcase: int = 1) -> None:
        self.head(subcase)
        self.lines += [
            f"{'':39}M O D A L   E F F E C T I V E   M A S S   S U M M A R Y",
            "",
            f"{'':52}TOTAL EFFECTIVE MASS FRACTION",
            f"{'':41}REFERENCE POINT AT ORIGIN OF BASIC COORDINATE SYSTEM",
            "",
            f"{'':24}T1                T2                T3                R1                R2    "
            "            R3",
            f"{'':19}{'      '.join(number(v) for v in np.zeros(6))}",
            "",
        ]
        self.matrix("    EFFECTIVE MASS MATRIX   ", modes.participation.T @ modes.participation)
        self.matrix("A-SET RIGID BODY MASS MATRIX", modes.mass)

    def weight(self, modes: Modes, subcase: int = 1, reference: int = 0) -> None:
        self.head(subcase)
        self.lines += [
            f"{'':27}O U T P U T   F R O M   G R I D   P O I N T   W E I G H T   G E N E R A T O R",
            f"0{'':53}REFERENCE POINT = {reference:8d}",
            f"{'':64}M O",
        ]
        self.lines += [
            f"{'':22}* {' '.join(f'{number(v):>13}' for v in row)} *" for row in modes.mass
        ]
        self.lines += [f"{'':65}S"]
        self.lines += [
            f"{'':43}* {' '.join(f'{number(v):>13}' for v in row)} *" for row in np.eye(3)
        ]
        self.lines += [f"{'':31}DIRECTION", f"{'':26}MASS AXIS SYSTEM (S)     MASS", ""]


def whole(
    modes: Modes,
    style: str = "msc",
    rows: int = 50,
    *,
    subcases: Sequence[int] = (1,),
    weight: bool = False,
) -> str:
    """A whole print with all tables."""
    out = Print(style, rows)
    out.echo()
    if weight:
        out.weight(modes)
    for subcase in subcases:
        out.eigenvalues(modes, subcase)
        out.summary(modes, subcase)
        out.fractions(modes, subcase)
        out.factors(modes, subcase)
        out.effective(modes, subcase)
    return out.text()
