"""The `derive` command: prints the equations of an arm in letters, or writes them in LaTeX."""

from __future__ import annotations

import robot_dyn as rd
from robot_dyn.cli import AS_STATED, Force, Name, RobotOptions, command, show, to_stderr
from robot_dyn.foundations import ExportError, FileKind, QueryError, save, target


@command("Dynamics")
def derive(
    robot: Name,
    /,
    output: str | None = None,
    letters: str = "file",
    matrices: str = "MCN",
    force: Force = False,
    options: RobotOptions = AS_STATED,
) -> None:
    """Print the equations of an arm as formulas.

    Each letter is printed with its value and its place in the file, and each angle that is read as a multiple of 15°.

    Options:
        output (FILE.tex): LaTeX file to input into a document that uses amsmath.
        letters (file|base|none): A letter for each number of the file, for each base parameter, or none.
        matrices (LETTERS): Matrices to print, for example N for gravity only.
    """
    kinds = {"file": "file", "base": "base", "none": None}
    if letters not in kinds:
        raise QueryError(f"--letters must be file, base or none, got {letters}")
    path = None if output is None else target(output, FileKind("LaTeX", ".tex"), ExportError, force=force)
    equations = rd.tools.symbols.symbols(options.load(robot), kinds[letters])  # pyright: ignore[reportArgumentType]
    latex = equations.latex(matrices)
    if path is None:
        show([*str(equations).splitlines(), *latex.splitlines()], as_json=False)
        return
    comments = "".join(f"% {line}\n" for line in str(equations).splitlines())
    pages = f"\\begingroup\\allowdisplaybreaks\n{latex}\\endgroup\n"
    save(path, lambda stream: stream.write((comments + pages).encode()), ExportError)
    show(str(equations).splitlines(), as_json=False)
    to_stderr(f"written: {path}")
