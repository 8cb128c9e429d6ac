"""The manual of scene files, from their schema: `python -m robot_dyn.scene.manual > docs/reference/scenes.md`."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from typing import Any

from pydantic.fields import FieldInfo

from robot_dyn.integrate.adaptive import ADAPTIVE
from robot_dyn.integrate.methods import FIXED_STEP
from robot_dyn.scene.control import BLOCKS, KINDS, Control, Model
from robot_dyn.scene.effects import ACTING, EDITS
from robot_dyn.scene.references import KINDS as REFERENCES
from robot_dyn.scene.scene import Loading, Scene, Start, tool_tables
from robot_dyn.scene.schema import Part, kinds_of

_OPENING = """# Scenes

A scene is a TOML file that describes one simulation: `robot-dyn simulate scene.toml`. Only the effects in the file act;
even gravity must be listed. `robot-dyn scene` prints scenes to start from; `robot-dyn explain scene.toml` prints the
equations of a scene, and the source of each number. This page is generated from the schema that scenes are checked
against.

- Units are SI and end the names of keys. They are for a revolute joint: for a prismatic joint read m for rad and
  N for N m, so N m/rad is N/m, and kg for kg m² of an armature; a bandwidth is in rad/s for both.
- *by joint* is one number for all joints, a list of n numbers in the order of `robot-dyn info`, or a table by name
  such as `{elbow_joint = 0.3}`, in which joints left out have 0 unless stated otherwise.
- `"urdf"` is the value in the file of the robot.
- Numbers must be finite. A key that is not listed here is an error.
"""
_LINES = {
    "position": "measured position, from the joints to the controller",
    "velocity": "measured velocity, from the joints to the controller",
    "actuation": "torque, from the controller to the joints",
}
_FORMS = {"boolean": "true or false", "string": "text"}


def manual() -> str:
    """Return the page, in Markdown."""
    methods = ", ".join(f"`{name}`" for name in FIXED_STEP)
    adaptive = ", ".join(f"`{name}`" for name in ADAPTIVE)
    parts = [
        _OPENING,
        *_section("The run", "Keys at the top of the file.", Scene),
        f"Methods with a fixed step: {methods}. Adaptive methods: {adaptive}.\n",
        *_section("`[load]`", _text(Loading), Loading),
        *_section("`[start]`", "The state at the start.", Start),
        "## `[[effect]]`\n\nThe effects; one table for each effect, with its `kind`.\n",
    ]
    parts += _kinds(*EDITS, *ACTING)
    parts += _section("`[control]`", _text(Control), Control)
    parts += [
        "| kind | law |\n|---|---|",
        *(f"| `{kind}` | {_cell(f'u = {law.term}')} |" for kind, law in KINDS.items()),
        "",
    ]
    parts += _section("`[control.model]`", _text(Model), Model)
    for line, blocks in BLOCKS.items():
        parts += [
            f"## `[[control.{line}]]`\n\nBlocks of the {_LINES[line]}; one table for each block, with its `kind`.\n"
        ]
        parts += _kinds(*blocks)
    parts += ["## `[reference]`\n\nThe reference of the controller; one table, with its `kind`.\n"]
    parts += _kinds(*REFERENCES)
    for name, entry in sorted(tool_tables().items()):
        table = entry.load()
        parts += _section(f"`[{name}]`", _text(table), table)
    return "\n".join(parts).rstrip() + "\n"


def _kinds(*parts: type[Part]) -> Iterator[str]:
    """Yield a section for each table."""
    for part in parts:
        yield from _section(f'`kind = "{kinds_of(part)[0]}"`', _text(part), part, level=3)


def _section(title: str, text: str, part: type[Part], level: int = 2) -> Iterator[str]:
    yield f"{'#' * level} {title}\n\n{text}\n"
    fields = {key: field for key, field in part.model_fields.items() if key != "kind" or part is Control}
    if fields:
        yield "| key | value | default | meaning |\n|---|---|---|---|"
        schemas = part.model_json_schema()["properties"]
        yield from (_row(key, field, schemas[key]) for key, field in fields.items())
        yield ""


def _row(key: str, field: FieldInfo, schema: dict[str, Any]) -> str:
    return f"| `{key}` | {_cell(_form(schema))} | {_default(field)} | {_cell(field.description or '')} |"


def _form(schema: dict[str, Any]) -> str:
    """Return the form of a value, from its JSON schema."""
    if "anyOf" in schema:  # an optional value
        return _form(schema["anyOf"][0])
    if "const" in schema or "enum" in schema:
        return " or ".join(f"`{json.dumps(value)}`" for value in schema.get("enum", [schema.get("const")]))
    if schema.get("type") == "array":
        return f"list of {_several(_form(schema['items']))}"
    if "additionalProperties" in schema:
        return f"table by name of {_several(_form(schema['additionalProperties']))}"
    form = str(schema.get("type", "table"))  # a nested table has a $ref instead of a type
    sign = "positive" if "exclusiveMinimum" in schema else "not negative" if "minimum" in schema else ""
    return _FORMS.get(form, form) + (f", {sign}" if sign else "")


def _several(form: str) -> str:
    """Return the plural of a form: `numbers, positive` for `number, positive`."""
    return form if form.startswith("`") else re.sub(r"^\w+", lambda word: f"{word[0]}s", form)


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return "required"
    default = field.default
    if default is None or isinstance(default, Part) or default in ((), {}):
        return ""
    return f"`{json.dumps(default)}`"


def _text(part: type[Part]) -> str:
    """Return the docstring of a table."""
    return "\n".join(line.strip() for line in (part.__doc__ or "").strip().splitlines())


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


if __name__ == "__main__":
    print(manual(), end="")
