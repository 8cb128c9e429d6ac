"""The command line as a process: help, groups, errors in one line, pipes, encodings, Ctrl-C, completion."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from importlib.metadata import entry_points, version
from pathlib import Path

import pytest

import robot_dyn as rd
from robot_dyn.cli import GROUPS, program
from robot_dyn.cli.application import app
from tests.command import MAIN, interrupted_at_work, refusal, run, said, spawn
from tests.long import long, stress


@pytest.mark.parametrize(
    "args",
    [["info", "massless_tip"], ["info", "--colour"], *long([["info", "pendulum"], ["info", "ur6"], ["query", "-h"]])],
)
def test_the_command_in_the_process_of_a_test_is_that_of_its_own(args: list[str]):
    own, here = spawn(*args, PYTHONUTF8="1"), run(*args)
    assert (own.returncode, own.stdout.decode(), own.stderr.decode()) == (here.returncode, here.stdout, here.stderr)


def test_the_package_runs_as_a_module():
    """`python -m robot_dyn` is the command."""
    done = subprocess.run([sys.executable, "-m", "robot_dyn", "info", "pendulum"], capture_output=True, timeout=60)
    assert (done.returncode, done.stdout, done.stderr) == (0, said("info", "pendulum").encode(), b"")


# --- help and list


def test_help():
    text = said("--help")
    assert "Usage:" in text and said("-h") == text


def test_no_arguments_shows_the_help():
    done = run()
    assert done.returncode in (0, 2) and "Usage:" in done.stdout + done.stderr


def test_list_prints_every_name():
    assert said("list").split() == list(rd.list_robots())


# --- errors


@pytest.mark.parametrize(
    ("file", "message"),
    [
        ("package://legs/leg.urdf", r"no file for package://legs/leg\.urdf; searched .*"),
        (__file__, r".*test_command_line\.py: is not well-formed XML: .*"),
    ],
)
def test_a_file_that_is_not_there_or_no_urdf_is_refused_in_one_line(file: str, message: str):
    """By texts of the machine and of lxml."""
    assert re.fullmatch(message, refusal(["info", file]))


@pytest.mark.parametrize(
    "args",
    [["lst"], ["--colour"], ["info"], ["info", "ur5", "--colour"], ["info", "ur5", "ur10"], ["query", "ur5", "--q"]]
    + [["compare", "ur5", "--samples", value] for value in ("0", "many")],
)
def test_usage_error(args: list[str]):
    done = run(*args)
    assert (done.returncode, done.stdout) == (2, "")
    assert re.search(r"Usage:|requires an argument", done.stderr) and "Traceback" not in done.stderr


# --- the process


def test_a_folder_that_is_gone_is_no_hindrance(tmp_path: Path):
    """A name of the catalog needs no working directory."""
    gone = str(tmp_path / "gone")
    done = spawn("info", "ur5", code=f"import os; os.mkdir({gone!r}); os.chdir({gone!r}); os.rmdir({gone!r})\n{MAIN}")
    assert (done.returncode, done.stderr) == (0, b"")


WATCHED = """
import signal
import robot_dyn as rd
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell lets what it runs in the background ignore it
compare = rd.compare
rd.compare = lambda *args, **options: (tell(), compare(*args, **options))[1]
"""


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
def test_interrupted_exits_with_130():
    assert interrupted_at_work("compare", "panda", "--samples", "100000", watched=WATCHED) == ""


@pytest.mark.skipif(os.name != "posix", reason="pipes of POSIX")
@pytest.mark.parametrize(
    "args", [["list"], ["query", "tiago_dual", "--json"], *long([["info", "tiago_dual"], ["--help"]])]
)
def test_reader_that_leaves_is_no_error(args: list[str]):
    read, write = os.pipe()
    os.close(read)  # nobody will ever read
    with open(write, "wb") as stream:
        done = subprocess.run([sys.executable, "-c", MAIN, *args], stdout=stream, stderr=subprocess.PIPE, timeout=30)
    assert done.returncode in (0, 1, 141)
    assert all(line.startswith(b"robot-dyn: warning: ") for line in done.stderr.splitlines())


@pytest.mark.skipif(os.name != "posix", reason="/dev/full and descriptors of POSIX")
@pytest.mark.parametrize("redirection", ["> /dev/full", ">&-"])
@pytest.mark.parametrize(
    "args", ["list", *long(["info pendulum", "query pendulum --json", "--help", "scene pendulum"])]
)
def test_output_that_cannot_be_written_is_an_error_of_one_line(args: str, redirection: str):
    command = f'"{sys.executable}" -c "{MAIN}" {args} {redirection}'
    done = subprocess.run(["bash", "-c", command], capture_output=True, encoding="utf-8", timeout=30)
    assert done.returncode == 2
    assert re.fullmatch(r"robot-dyn: error: standard output cannot be written \(.*\); redirect .*\n", done.stderr)


@pytest.mark.skipif(os.name != "posix", reason="/dev/full and descriptors of POSIX")
@pytest.mark.parametrize("redirection", ["2> /dev/full", *long(["2>&-", ">&- 2>&-", "<&- >&- 2>&-"])])
def test_an_error_that_cannot_be_told_has_its_exit_code(redirection: str):
    command = f'"{sys.executable}" -c "{MAIN}" info ur6 {redirection}'
    assert subprocess.run(["bash", "-c", command], capture_output=True, timeout=30).returncode == 2


@pytest.mark.skipif(os.name != "posix", reason="descriptors of POSIX")
def test_a_closed_stream_is_not_replaced_by_a_file_that_is_opened_later(tmp_path: Path):
    """Else what a library writes to descriptor 1 would go into that file."""
    code = "import os; os.close(1); os.close(2)\nfrom robot_dyn.cli.terminal import open_streams; open_streams()\n"
    code += "import sys; stream = open(sys.argv[1], 'w'); os.write(1, b'x') if 0 else None; sys.exit(stream.fileno())"
    assert spawn(tmp_path / "x", code=code).returncode > 2


COMPARED = ["compare", "pendulum", "--samples", "1"], 0, "1 of 1 agree"
NAMED = ["info", "panda"], 0, "panda_finger_joint1"
REFUSED = ["info", "ur6"], 2, "robot-dyn: error: no robot 'ur6'"


@pytest.mark.parametrize(
    ("encoding", "args", "code", "shown"),
    [
        ("ascii", *COMPARED),
        *long([("cp1252", *COMPARED), ("ascii", *REFUSED)]),
        *stress([("ascii", *NAMED), ("cp1252", *NAMED), ("cp1252", *REFUSED)]),
        *stress([("utf-16", *case) for case in (COMPARED, NAMED, REFUSED)]),
    ],
)
def test_output_in_an_encoding_without_mathematical_signs(encoding: str, args: list[str], code: int, shown: str):
    """Windows pipes in cp1252; Ṁ and · are not in it, and are shown as ?."""
    done = spawn(*args, PYTHONIOENCODING=encoding)
    out, err = done.stdout.decode(encoding), done.stderr.decode(encoding)
    assert done.returncode == code and shown in out + err and "Traceback" not in err


LOADED = "import sys; print(*sorted({name.partition('.')[0] for name in sys.modules}))"
HEAVY = {"pinocchio", "yourdfpy", "trimesh", "scipy", "flint", "lxml", "numpy"}


@pytest.mark.parametrize(
    ("line", "completed"),
    [
        ("compare pendulum planar_2", ["planar_2r"]),
        ("info planar_2r --lock joint_2", ["joint_2="]),
        ("scene pendu", ["pendulum"]),
        *long([("info planar_2", ["planar_2r"]), ("query planar_2r --why joint", ["joint_1", "joint_2"])]),
    ],
)
def test_the_shell_completes_robots_scenes_and_joints(line: str, completed: list[str]):
    """Nothing that takes time is imported for it."""
    words = ["robot-dyn", *line.split()]
    environment = {"COMP_WORDS": " ".join(words), "COMP_CWORD": str(len(words) - 1)}
    code = f"import sys; sys.argv[0] = 'robot-dyn'\ntry:\n    {MAIN}\nfinally:\n    {LOADED}"
    done = spawn(code=code, _ROBOT_DYN_COMPLETE="complete_bash", **environment)
    *names, loaded = done.stdout.decode().splitlines()
    assert names == completed and done.stderr == b""
    assert not set(loaded.split()) & HEAVY


def test_version_and_public_names():
    assert said("--version") == f"robot-dyn {rd.__version__}\n" == f"robot-dyn {version('robot-dyn')}\n"
    assert set(dir(rd)) == {*rd.__all__, "__version__"}


MODULES = {entry.value for entry in entry_points(group="robot_dyn.commands")}
TOOLS = sorted(name for name, command in program().commands.items() if command.callback.__module__ in MODULES)


def commands() -> dict[str, tuple[str, str]]:
    """Group and line of each command, in the order of the help."""
    return {
        name: (command.rich_help_panel, (command.short_help or command.help).partition("\n")[0])
        for name, command in program().commands.items()
    }


def test_every_command_is_in_one_group() -> None:
    """Groups follow each other; commands of tools come after those of the core."""
    groups = [group for group, _ in commands().values()]
    assert groups == sorted(groups, key=GROUPS.index)
    for group in GROUPS:
        of_tools = [name in TOOLS for name, (its, _) in commands().items() if its == group]
        assert of_tools == sorted(of_tools) and not all(of_tools)
    assert {program().commands[name].callback.__module__ for name in TOOLS} == MODULES and {*TOOLS} < {*commands()}


def test_help_has_the_groups_and_a_line_for_each_command() -> None:
    shown = [line.strip("│ \n") for line in said("--help").splitlines()]
    titles = [re.sub(r"[^\w ]", "", line).strip() for line in shown if line.startswith("╭")]
    assert titles == ["Options", *GROUPS]
    width = max(map(len, commands()))
    for name, (_, line) in commands().items():
        assert f"{name:<{width}}  {line}" in shown, name


@pytest.mark.parametrize("name", commands())
def test_what_takes_no_value_has_no_type_in_help(name: str) -> None:
    text = said(name, "--help")
    assert "Usage:" in text and said(name, "-h") == text
    assert re.search(r"--help\s+-h\s+Show this", text) and "bool" not in text


@pytest.mark.parametrize("name", commands())
def test_every_argument_and_option_is_described(name: str) -> None:
    """By its docstring, which names no other."""
    command = program().commands[name]
    assert [option.name for option in command.params if not option.help] == []
    assert "Options:" not in command.help


NAMES = """import json
from robot_dyn.cli import program
commands = program().commands.items()
print(json.dumps({name: [[each.opts, each.secondary_opts] for each in command.params] for name, command in commands}))
"""


def test_options_have_their_names_without_docstrings() -> None:
    """Python -OO drops them."""
    assert json.loads(spawn(code=NAMES, PYTHONOPTIMIZE="2").stdout) == json.loads(spawn(code=NAMES).stdout)


def test_a_command_keeps_its_own_help() -> None:
    assert "exit code is 1 if the run diverges" in re.sub(r"\s+", " ", said("simulate", "--help"))


def test_commands_without_a_known_group_come_last(monkeypatch: pytest.MonkeyPatch) -> None:
    """A plug-in may name a group of its own, or none."""
    monkeypatch.setattr(app, "registered_commands", [*app.registered_commands])
    app.command("of-no-group")(lambda: None)
    app.command("of-another", rich_help_panel="Others")(lambda: None)
    assert [*program().commands][-2:] == ["of-no-group", "of-another"]


def test_the_help_of_check_names_what_needs_fix() -> None:
    assert re.search(
        r"--allow-overlap, --units and --inertia-unit need --fix", re.sub(r"[\s│]+", " ", said("check-urdf", "--help"))
    )
