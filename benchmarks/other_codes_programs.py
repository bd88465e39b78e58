"""Run the programs of other_codes.py on a scene, and hold what they tell."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

import erc_contact as ec

SIDES = {2: ((0, 1), (1, 2), (2, 0)), 3: ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0))}
"""Corners of the sides of CalculiX's triangles and tetrahedra."""


@dataclass
class Row:
    """Hold a line of the table.

    Args:
        name: The program and its method.
        force: Components of the force of the contact [force], shape (n,).
        energy: Strain energy [force length].
        unknowns: Number of unknowns.
        seconds: Processor time, without starting Python.
        error: What it says about its error.
    """

    name: str
    force: np.ndarray
    energy: float
    unknowns: int
    seconds: float
    error: str


def ours(scene: ec.Scene, domain: ec.Domain, contact: str, accuracy: float) -> Row:
    """Solve with this package, to an accuracy; 1 is reached on the first mesh."""
    began = process_time()
    evolution = ec.evolve(lambda _: scene, domain, [1.0], accuracy=accuracy, degree=2)
    seconds = process_time() - began
    error, step = evolution.error, evolution.steps[-1]
    unknowns = error.model.space.d * error.model.space.node_count
    said = f"at most {error.relative:.2%}, of all and of each element"
    name = "erc_contact, that mesh" if accuracy == 1.0 else f"erc_contact, to {accuracy:.2g}"
    return Row(name, error.force(contact).force, step.stored, unknowns, seconds, said)


def getfem(folder: Path, script: str, data: Mapping[str, Any]) -> Row:
    """Solve with GetFEM, in the Python of the system, which Debian's package is for.

    Args:
        folder: A folder for its files.
        script: Name of the script beside this one that solves the scene.
        data: Arrays that it reads from ``scene.npz`` there.
    """
    np.savez(folder / "scene.npz", **data)
    python = shutil.which("python3", path=os.defpath)
    if python is None:
        raise FileNotFoundError("No Python of the system is found.")
    output = run([python, str(Path(__file__).with_name(script)), str(folder)], folder)
    told = json.loads(output.splitlines()[-1])
    force = np.array(told["force"])
    name = f"GetFEM, {told['iterations']} iterations"
    return Row(name, force, told["energy"], told["unknowns"], told["seconds"], "nothing")


def calculix(folder: Path, deck: str, unknowns: int, dim: int, wedges: int = 1) -> Row:
    """Solve with CalculiX; the deck prints the force on the set TOP, and the energy.

    Args:
        folder: A folder for its files.
        deck: Its input.
        unknowns: Number of unknowns.
        dim: Number of the components of the force.
        wedges: How many of the bodies that it computes there are.
    """
    program = shutil.which("ccx")
    if program is None:
        raise FileNotFoundError("No ccx is found.")
    (folder / "scene.inp").write_text(deck)
    before = os.times()
    run([program, "scene"], folder)
    after = os.times()
    seconds = after.children_user - before.children_user
    seconds += after.children_system - before.children_system
    printed = (folder / "scene.dat").read_text().split("\n")
    totals = {}
    # Each increment prints a title, and the totals two lines below it.
    for title, values in zip(printed, printed[2:], strict=False):
        for word in ("total force", "total internal energy"):
            if word in title:
                totals[word] = np.array(values.split(), dtype=float)
    force = -wedges * totals["total force"][:dim]
    energy = float(wedges * totals["total internal energy"][0])
    said = "jumps of the stress at nodes, no bound"
    return Row("CalculiX, penalty", force, energy, unknowns, seconds, said)


def run(command: list[str], folder: Path) -> str:
    """Run a program and return what it prints."""
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(f"{command[0]} failed:\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
    return done.stdout


def numbered(rows: np.ndarray) -> str:
    """Write rows of numbers, each with its own number, from 1 on."""
    lines = []
    for number, row in enumerate(rows, start=1):
        lines.append(", ".join([str(number), *(f"{value:.12g}" for value in row)]))
    return "\n".join(lines)


def members(numbers: np.ndarray) -> str:
    """Write the members of a set of CalculiX, which are numbered from 0 here."""
    return ",\n".join(str(number + 1) for number in numbers)


def sides_at(
    x: np.ndarray, elements: np.ndarray, level: float, chosen: np.ndarray | bool = True
) -> list[str]:
    """Write the sides of elements at a height, as lines of a surface of CalculiX.

    Args:
        x: Places of the nodes [length], shape (n, d).
        elements: Nodes of the triangles or tetrahedra, corners first, shape (t, 6 or
            10).
        level: The height, the last coordinate [length].
        chosen: Which elements count, shape (t,).
    """
    lines = []
    d = x.shape[1]
    is_there = abs(x[elements[:, : d + 1], -1] - level) < 1e-9
    for k, corners in enumerate(SIDES[d], start=1):
        on_level = chosen & is_there[:, corners].all(axis=1)
        lines += [f"{number + 1}, S{k}" for number in np.flatnonzero(on_level)]
    return lines


def pressed(slave: str, master: str, stiffness: float, friction: float = 0.0) -> list[str]:
    """Write a contact of CalculiX with a penalty [force/length^3]."""
    lines = ["*SURFACE INTERACTION, NAME=JOINT"]
    lines += ["*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", f"{stiffness}"]
    if friction:
        lines += ["*FRICTION", f"{friction}, {stiffness / 10}"]
    lines += ["*CONTACT PAIR, INTERACTION=JOINT, TYPE=SURFACE TO SURFACE"]
    return [*lines, f"{slave}, {master}"]


def stepped(boundary: list[str]) -> list[str]:
    """Write one increment to the boundary conditions, and what is printed."""
    lines = ["*STEP", "*STATIC", "1., 1., 1e-5, 1.", "*BOUNDARY", *boundary]
    lines += ["*NODE PRINT, NSET=TOP, TOTALS=ONLY", "RF"]
    lines += ["*EL PRINT, ELSET=BODIES, TOTALS=ONLY", "ELSE"]
    return [*lines, "*EL FILE", "S, ERR", "*END STEP", ""]
