"""Write the page of reference values, with the digits that the intervals leave."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from reference_numbers import Number, Other, Result, is_inside

MOST_DIGITS = 10
"""Largest number of digits of a number on the page."""
READ = ("last meshes", "two runs")
"""Ways whose interval is a spread of values and bounds nothing."""

INTRODUCTION = """\
# Reference values

Numbers of classical problems, most of them of contact, each in an interval, for the test suites
of other codes: {count} cases. Small displacements, displacements of degree 2 on adapted meshes,
linear elasticity where a case does not say otherwise. The file
{{download}}`reference_values.json` has all digits. Both are made by one script, which goes on
where it was ended:

```console
OMP_NUM_THREADS=1 python benchmarks/reference_values.py
```

- **proved**: the exact number lies between low and high, up to round-off ([what is
  guaranteed](number.md#what-is-guaranteed)): flat sides, no friction or Tresca's, data
  that the mesh represents exactly. Low and high are rounded outwards.
- **estimate**: an interval that is not proved, because of Coulomb friction or curved sides; or
  the number of the finest mesh, to either side the spread of the last three meshes of the run
  ("last meshes"), which bounds nothing.
- **The way**: "energies" is the intersection of the intervals of all meshes of the run, where
  they are proved, "lifting bound" is {{py:func}}`erc_contact.resultant` on the last mesh,
  "difference-quotient bound" {{py:func}}`erc_contact.interval`, of a contact both together
  ([intervals of single numbers](intervals.md)), which is not used
  with Coulomb friction.
- **Others** are closed forms, published figures and other codes: "inside" or "outside" the
  interval, up to the rounding of the figure. In brackets is the relative difference of a figure
  from the value, where there is no interval, or where the figure is of a simpler problem.
- **Seconds** are processor seconds on one core without the seconds of compilers; all cases
  together take {minutes:.0f} minutes. eps is the relative error of the finest mesh, with the
  error of flat facets.

Closed forms of the same problem that lie inside their interval: {inside} of {exact}.
{outside}
"""

SOURCES = """\
## Sources

- GRECO: code_aster, V6.04.128 (SSNV128), validation manual. "Extrapolated", and the block of
  eight codes, are own computations with the codes named.
- VM191: [Ansys verification manual](
  https://ansyshelp.ansys.com/public/Views/Secured/corp/v242/en/ans_vm/Hlp_V_VM191.html), after
  N. Chandrasekaran, W. E. Haisler, R. E. Goforth, Finite Elem. Anal. Des. 3 (1987).
- Fourier integrals: own computations on infinite layers with the pressure as the unknown.
  L. M. Keer, J. Dundurs, K. C. Tsai, J. Appl. Mech. 39 (1972), treat receding contact so.
- Hankel integrals: own computations on infinite layers by dual integral equations, to ten
  digits. Elements of degree 4 to 7: own code, with mesh lines on the rims of contact and
  stick zone; a second code of our own, of bilinear elements, agrees where both were run. The
  closed forms of tubes, shells, spinning and heated cylinders are Lame's.
- Integration along the radius: own solution of the ordinary differential equations of a tube,
  by a Runge-Kutta method. S. G. Lekhnitskii, Anisotropic Plates, 1968.
- SSNV104: code_aster, V6.04.104, validation manual. Its force, 586 081, is Hertz's for
  half-spaces with the approach of the hemispheres; the force of the hemispheres is 12.6%
  higher. SSNA102 is of the same manual; its contact follows the geometry on coarse triangles.
- COMET: J. Bleyer, Numerical Tours of Computational Mechanics with FEniCSx, 2024, the demo of a
  von Mises material. Its page has curves; the numbers are of its script, run on DOLFINx 0.11.
- GetFEM 5 and CalculiX 2.20: [one scene side by side](comparison.md#one-scene-side-by-side).
- The penny-shaped crack: I. N. Sneddon, Proc. R. Soc. A 187 (1946). The crack along an arc:
  N. I. Muskhelishvili, Some Basic Problems of the Mathematical Theory of Elasticity, 1953.
- Hertz, Cattaneo, Mindlin, the flat punch: K. L. Johnson, Contact Mechanics, 1985. The beam:
  S. Timoshenko, J. Opt. Soc. Am. 11 (1925).
- P. Coorevits, P. Hild, M. Hjiaj, SIAM J. Sci. Comput. 23 (2001).
"""


def decimals(number: Number) -> int:
    """Return the decimals that show two digits of the width of an interval."""
    width = number.high - number.low
    size = max(abs(number.low), abs(number.high)) or 1.0
    finest = MOST_DIGITS - 1 - math.floor(math.log10(size))
    if width <= 0:
        return finest
    return min(finest, 1 - math.floor(math.log10(width)))


def rounded(value: float, places: int, outwards: int = 0) -> str:
    """Return a number with so many decimals, rounded down (-1), up (1) or nearest."""
    # What is a whole number but for round-off stays it.
    scaled = round(value * 10.0**places, 3)
    ways: dict[int, Callable[[float], int]] = {-1: math.floor, 0: round, 1: math.ceil}
    near = ways[outwards](scaled) / 10.0**places
    if 0 < abs(value) < 1e-3:
        power = math.floor(math.log10(abs(value)))
        return f"{near:.{max(places + power, 0)}e}"
    return f"{near:.{max(places, 0)}f}"


def opinion(number: Number, other: Other) -> str:
    """Return in words what somebody else says, and whether it lies in the interval."""
    digits = 9
    if other.rounding:
        # A figure is printed with the digits that it has.
        digits = max(1, math.ceil(math.log10(abs(other.value) / other.rounding)))
    figure = f"{other.source}: {other.value:.{digits}g}"
    apart = f"{other.value / number.value - 1:+.2g}"
    if number.how in READ or other.approximate:
        return f"{figure} ({apart})"
    if is_inside(number, other):
        return f"{figure}, inside"
    if number.kind == "proved":
        return f"{figure}, **outside the proved interval** ({apart})"
    return f"{figure}, outside ({apart})"


def section(name: str, described: tuple[str, str], result: Result) -> str:
    """Return the section of a case with its title and geometry."""
    title, geometry = described
    mesh = f"{result.cells} cells, {result.unknowns} unknowns, eps {100 * result.eps:.2g}%"
    lines = [f"## {title}", "", geometry, "", f"`{name}`: {mesh}, {result.seconds:.0f} s.", ""]
    lines += ["| number | value | low | high | kind, way | others |", "|---|---|---|---|---|---|"]
    for number in result.numbers:
        places = decimals(number)
        low = rounded(number.low, places, -1)
        high = rounded(number.high, places, 1)
        quantity = number.quantity if number.unit == "-" else f"{number.quantity} [{number.unit}]"
        said = "; ".join(opinion(number, other) for other in number.others) or "-"
        kind = f"{number.kind}, {number.how}"
        columns = [quantity, rounded(number.value, places), low, high, kind, said]
        lines.append(f"| {' | '.join(columns)} |")
    return "\n".join(lines) + "\n"


def verdict(
    results: Mapping[str, Result], described: Mapping[str, tuple[str, str]]
) -> tuple[int, int, list[str]]:
    """Count the closed forms and those inside, and tell what is outside if proved."""
    exact = 0
    inside = 0
    outside = []
    for name, result in results.items():
        for number in result.numbers:
            for other in number.others:
                holds = is_inside(number, other)
                exact += other.exact
                inside += other.exact and holds
                if holds or other.approximate or number.kind != "proved":
                    continue
                apart = other.value / number.value - 1
                outside.append(
                    f"- {described[name][0]}: the {number.quantity} by {other.source},\n"
                    f"  {other.value:.9g}, differs by {apart:+.1g}."
                )
    return exact, inside, outside


def page(results: Mapping[str, Result], described: Mapping[str, tuple[str, str]]) -> str:
    """Return the page of all cases."""
    exact, inside, outside = verdict(results, described)
    listing = ""
    if outside:
        listing = "\nFigures that lie outside a proved interval:\n\n" + "\n".join(outside)
    introduction = INTRODUCTION.format(
        count=len(results),
        minutes=sum(result.seconds for result in results.values()) / 60,
        inside=inside,
        exact=exact,
        outside=listing,
    )
    sections = [section(name, described[name], result) for name, result in results.items()]
    return "\n".join([introduction.rstrip() + "\n", *sections, SOURCES])
