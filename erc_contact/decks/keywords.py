"""Keep the table of keywords: what each card means, and how a scene says it.

It is also the table of the page "Keywords of Abaqus and CalculiX"
(``docs/yours/decks.md``), which :func:`as_page` writes.
"""

from __future__ import annotations

from dataclasses import dataclass

TAKEN, HARMLESS, REFUSED = "taken", "harmless", "refused"
"""What becomes of a card."""
FATES = (TAKEN, HARMLESS, REFUSED)
"""All of them."""


@dataclass(frozen=True)
class Keyword:
    """Hold a keyword of Abaqus or CalculiX.

    Attributes:
        name: The keyword without its star.
        fate: What becomes of its cards: :data:`TAKEN`, :data:`HARMLESS` or
            :data:`REFUSED`.
        meaning: What it means.
        said: How a scene says it; what to do where it is refused.
    """

    name: str
    fate: str
    meaning: str
    said: str = ""


def _taken(name: str, meaning: str, said: str) -> Keyword:
    """Return a keyword that is taken."""
    return Keyword(name, TAKEN, meaning, said)


def _refused(name: str, meaning: str, said: str) -> Keyword:
    """Return a keyword that is refused."""
    return Keyword(name, REFUSED, meaning, said)


def _alike(fate: str, names: str, meaning: str, said: str) -> list[Keyword]:
    """Return keywords that mean the same, of names with commas between."""
    return [Keyword(name, fate, meaning, said) for name in names.split(", ")]


OF_MESH = "`deck.domain`"
"""How cards of the mesh are said."""
OUTPUT = ("what is written", "`history.save`, `history.at`, `history.force`")
"""Meaning of cards of output, and what has the same."""
SOLVER = ("how it is solved", "`ec.adapt` finds its mesh and steps itself")
"""Meaning of cards of the solver, and what stands for them."""
STATICS = "statics is solved; keep a deck with *STATIC"
"""What to do with other procedures."""

KEYWORDS = (
    _taken("NODE", "points", OF_MESH),
    _taken("ELEMENT", "cells: C3D4 to C3D20R, CPS, CPE, CAX; split into simplices", OF_MESH),
    _taken("NSET", "sets of nodes, GENERATE", "a part, where it has facets"),
    _taken("ELSET", "sets of elements, GENERATE", "a region, `ec.Elastic({region: E})`"),
    _taken("SURFACE", "faces of elements, or nodes", "a part"),
    _taken("INCLUDE", "another file in the same folder", "it is read in its place"),
    _taken("SYSTEM", "coordinate system of nodes", OF_MESH),
    _taken("PART", "a part of Abaqus", OF_MESH),
    *_alike(TAKEN, "END PART, END ASSEMBLY, END INSTANCE", "its end", OF_MESH),
    _taken("ASSEMBLY", "parts in their places", OF_MESH),
    _taken("INSTANCE", "a part in its place", OF_MESH),
    _taken("MATERIAL", "a material", "`ec.Scene(material, ...)`"),
    _taken(
        "ELASTIC",
        "isotropic moduli, by temperature; ORTHO, ENGINEERING CONSTANTS",
        "`ec.Elastic(E, nu)`, `ec.OrthotropicElastic(E, nu, G)`",
    ),
    _taken("ORIENTATION", "rectangular axes of orthotropic moduli", "`axes=`"),
    _taken("EXPANSION", "isotropic thermal expansion", "`ec.ThermalStrain(alpha, T)`"),
    _taken("DENSITY", "mass per volume", "`ec.BodyForce`"),
    _taken(
        "PLASTIC",
        "von Mises plasticity, linear or by a curve",
        "`ec.Plastic(E, nu, yield_stress, hardening)`, `ec.HardeningCurve`",
    ),
    _taken(
        "SOLID SECTION",
        "material of elements, thickness of plane elements",
        "`material` by region; forces are per unit of thickness",
    ),
    _taken("AMPLITUDE", "factors by time, a table", "`deck.scene_at(t)`"),
    _taken("STEP", "a step; NLGEOM is assumed small", "`deck.times`"),
    _taken("STATIC", "statics, and the period of the step", "`ec.evolve(deck.scene_at, ...)`"),
    _taken("END STEP", "the end of a step", "`deck.times`"),
    _taken(
        "BOUNDARY",
        "prescribed displacements of nodes, OP, AMPLITUDE, FIXED",
        "`ec.Displacement`; of single nodes what stands above",
    ),
    _taken(
        "TRANSFORM",
        "local axes of nodes",
        "`ec.Symmetry` on a plane across an axis, a bilateral `ec.Contact` on a cylinder",
    ),
    _taken("CLOAD", "forces on nodes", "`ec.Traction` with their force and moment"),
    _taken(
        "DLOAD",
        "pressure on faces, GRAV, CENTRIF",
        "`ec.Traction(part, pressure=p)`, `ec.BodyForce`",
    ),
    _taken("DSLOAD", "pressure on surfaces, TRVEC", "`ec.Traction(part, pressure=p)`"),
    _taken("TEMPERATURE", "temperatures of nodes", "`ec.ThermalStrain(alpha, T)`"),
    _taken(
        "INITIAL CONDITIONS",
        "TYPE=TEMPERATURE, STRESS, PLASTIC STRAIN",
        "T of `ec.ThermalStrain` is the difference; `ec.Eigenstrain`",
    ),
    _taken("CONTACT PAIR", "two surfaces in contact", "`ec.Contact(slave, against=master)`"),
    _taken("SURFACE INTERACTION", "the law of a contact", "arguments of `ec.Contact`"),
    _taken(
        "SURFACE BEHAVIOR",
        "HARD, LINEAR, EXPONENTIAL, TIED",
        "hard contact; with `penalty='kept'` `foundation=ec.Foundation(k)`; `ec.Tied`",
    ),
    _taken("FRICTION", "Coulomb's coefficient", "`ec.Contact(..., friction=mu)`"),
    _taken("CLEARANCE", "distance of a pair", "`ec.Contact(..., gap=g)`"),
    _taken("TIE", "two surfaces that are glued", "`ec.Tied(slave, master)`"),
    _taken("PRE-TENSION SECTION", "a cut through a bolt", "`ec.Preload(side, side, force=F)`"),
    _taken("RIGID BODY", "nodes that move rigidly", "`ec.Rigid(part, ...)`"),
    _taken("COUPLING", "a surface and its node", "`ec.Rigid(part, ...)`, `ec.RemoteForce`"),
    _taken("KINEMATIC", "the surface moves as the node", "`ec.Rigid(part, ...)`"),
    _taken("DISTRIBUTING", "the surface shares the force", "`ec.RemoteForce(part, F, at=a)`"),
    _taken("DISTRIBUTING COUPLING", "nodes share it by weights", "`ec.RemoteForce` in their mean"),
    Keyword("HEADING", HARMLESS, "a title"),
    *_alike(
        HARMLESS,
        "PREPRINT, NODE PRINT, NODE FILE, NODE OUTPUT, EL PRINT, EL FILE, "
        "ELEMENT OUTPUT, CONTACT PRINT, CONTACT FILE, CONTACT OUTPUT, "
        "SECTION PRINT, FACE PRINT, OUTPUT, FILE FORMAT, ENERGY PRINT, "
        "ENERGY OUTPUT, ENERGY FILE, MONITOR, PRINT, TIME POINTS",
        *OUTPUT,
    ),
    Keyword("RESTART", HARMLESS, "files to go on from; READ is not followed", "`checkpoint=`"),
    *_alike(HARMLESS, "CONTROLS, SOLVER, NO ANALYSIS, CONTACT CONTROLS", *SOLVER),
    Keyword("CONTACT DAMPING", HARMLESS, "damping of a contact, which statics has not"),
    Keyword("DAMPING", HARMLESS, "damping, which statics has not"),
    Keyword("CONDUCTIVITY", HARMLESS, "heat conduction, which statics has not"),
    Keyword("SPECIFIC HEAT", HARMLESS, "heat capacity, which statics has not"),
    Keyword("GAP CONDUCTANCE", HARMLESS, "heat across a contact, which statics has not"),
    Keyword("PHYSICAL CONSTANTS", HARMLESS, "constants of heat and gravitation"),
    *_alike(
        HARMLESS,
        "MATERIAL ORIENTATION, DISTRIBUTION",
        "axes, which isotropic materials do not need",
        "",
    ),
    _refused("EQUATION", "linear equations of displacements", "give the symmetry as a support"),
    _refused("MPC", "relations of displacements", "use *TIE, *COUPLING or a support"),
    _refused("CYCLIC SYMMETRY MODEL", "a sector of a wheel", "take the whole, or a half of it"),
    _refused("SHELL SECTION", "shells", "mesh the solid"),
    _refused("BEAM SECTION", "beams", "mesh the solid"),
    _refused("BEAM GENERAL SECTION", "beams", "mesh the solid"),
    _refused("MEMBRANE SECTION", "membranes", "mesh the solid"),
    _refused("NODAL THICKNESS", "shells", "mesh the solid"),
    _refused("SPRING", "springs", "give `ec.Spring` on a part"),
    _refused("DASHPOT", "dampers", STATICS),
    _refused("GAP", "gap elements", "use *CONTACT PAIR"),
    _refused("MASS", "point masses", "give their weight as *CLOAD"),
    _refused("CONTACT", "general contact", "write the pairs: *CONTACT PAIR"),
    _refused("MODEL CHANGE", "elements or contacts that come and go", "one deck for each state"),
    _refused("CHANGE FRICTION", "friction that changes", "use `ec.evolve` with a scene of yours"),
    _refused("CHANGE SURFACE BEHAVIOR", "a law that changes", "one deck for each state"),
    *_alike(
        REFUSED,
        "CHANGE MATERIAL, CHANGE PLASTIC, CHANGE SOLID SECTION",
        "a material that changes",
        "one deck for each state",
    ),
    _refused("HYPERELASTIC", "large strains", "linear elasticity: *ELASTIC"),
    _refused("HYPERFOAM", "large strains", "linear elasticity: *ELASTIC"),
    _refused("DEFORMATION PLASTICITY", "Ramberg and Osgood's law", "*PLASTIC with two lines"),
    _refused("CYCLIC HARDENING", "a hardening law", "*PLASTIC with two lines"),
    _refused("CREEP", "creep", "keep the elastic law"),
    _refused("USER MATERIAL", "a subroutine", "`ec.Material`, a class of yours"),
    _refused("DEPVAR", "a subroutine", "`ec.Material`, a class of yours"),
    *_alike(REFUSED, "DYNAMIC, MODAL DYNAMIC, STEADY STATE DYNAMICS", "dynamics", STATICS),
    _refused("FREQUENCY", "frequencies", STATICS),
    _refused("COMPLEX FREQUENCY", "frequencies", STATICS),
    _refused("BUCKLE", "buckling", STATICS),
    _refused("VISCO", "creep", STATICS),
    _refused("HEAT TRANSFER", "heat conduction", "solve it, and give *TEMPERATURE"),
    _refused("COUPLED TEMPERATURE-DISPLACEMENT", "heat conduction", STATICS),
    _refused("UNCOUPLED TEMPERATURE-DISPLACEMENT", "heat conduction", STATICS),
    *_alike(REFUSED, "CFLUX, DFLUX, FILM, RADIATE", "heat", "solve it, and give *TEMPERATURE"),
    _refused("SUBMODEL", "displacements of a larger model", "give them in *BOUNDARY"),
    _refused("SUBSTRUCTURE GENERATE", "a substructure", STATICS),
    _refused("GREEN", "a substructure", STATICS),
    _refused("SENSITIVITY", "derivatives", STATICS),
)
"""The keywords, in the order of the page."""


def squeezed(name: str) -> str:
    """Return a keyword in capitals without blanks, as CalculiX compares it."""
    return "".join(name.upper().split())


BY_NAME = {squeezed(keyword.name): keyword for keyword in KEYWORDS}
"""The keywords by their names without blanks."""
TITLES = {
    TAKEN: ("Taken", "Said in a scene"),
    HARMLESS: ("Left out, as it changes no solution", "In its place"),
    REFUSED: ("Refused", "What to do"),
}
"""Titles of the tables of the page, and of their last column."""


def as_page() -> str:
    """Return the tables of the page, in Markdown."""
    blocks = []
    for fate, (title, last) in TITLES.items():
        lines = [f"### {title}", "", f"| Card | Meaning | {last} |", "| --- | --- | --- |"]
        for keyword in KEYWORDS:
            if keyword.fate == fate:
                lines.append(f"| `*{keyword.name}` | {keyword.meaning} | {keyword.said} |")
        blocks.append("\n".join(lines))
    return "\n\n".join(blocks) + "\n"
