"""What is user-defined has a definition where its code tells all; after an edit of anything it reaches, another one."""

from __future__ import annotations

import os
import subprocess
import sys
from types import ModuleType
from typing import Any

import pytest

import robot_dyn as rd
from robot_dyn.codegen.store.definition import definition
from robot_dyn.foundations.values import LRUByIdentity
from robot_dyn.simulation import StateEquation, machine_code
from robot_dyn.simulation.compiled import cache
from robot_dyn.simulation.compiled.structure import structure
from tests.codegen.cells import cell
from tests.codegen.test_kernel import Memory

ARM = rd.load("planar_2r")
CELL = """
import math
from dataclasses import dataclass, field
from functools import cached_property, partial, wraps
from typing import Any, ClassVar

import numpy as np

import robot_dyn as rd
from robot_dyn.foundations.arithmetic import tanh

GAIN, WEIGHTS, LEVELS = 2.0, np.array([0.5, 0.25]), ((1.0, 2.0), (3.0, 4.0))


def deepest(x, power=2):
    return x**power + math.pi


def deeper(x):
    return [deepest(each) for each in x][0] * LEVELS[1][0]


def scaled(factor):
    def f(x):
        return factor * x
    return f


def louder(method):
    @wraps(method)
    def call(self, *given):
        return 1.5 * method(self, *given)
    return call


twice, halved = scaled(2.0), partial(np.multiply, 0.5)


def unused(x):
    return x - 1.0


class Shape:
    width: ClassVar[float] = 0.1

    @staticmethod
    def bent(x):
        return x * 0.75

    def shape(self, v):
        return tanh(v / self.width)


@dataclass(frozen=True, eq=False)
class Drag(Shape, rd.effects.Dissipative):
    c: Any = field(default=1.0, metadata=rd.effects.coefficient("N m", minimum=0))
    offset: float = 0.25
    then: Any = twice

    def thresholds(self, n=0):
        return ()

    @cached_property
    def square(self):
        return self.c**2

    @property
    def shift(self):
        return self.offset + 0.125

    @louder
    def torque(self, dynamics, t, q, v):
        inner = lambda x: x + np.where(q > 0.5, 1e-3, 2e-3)
        try:
            return -self.square * inner(self.shape(v)) * self.shift - halved(WEIGHTS * GAIN) * self.then(q) - deeper(q)
        except IndexError:
            return self.bent(v)
"""
EDITS = {
    "a number of the module": ("2.0, np.array", "2.5, np.array"),
    "its type": ("2.0, np.array", "2, np.array"),
    "an entry of an array": ("[0.5, 0.25]", "[0.5, 0.75]"),
    "the type of an array": ("np.array([0.5, 0.25])", "np.array([0.5, 0.25], 'f4')"),
    "an entry of a tuple": ("(3.0, 4.0)", "(3.5, 4.0)"),
    "a helper": ("LEVELS[1][0]", "LEVELS[1][1]"),
    "a helper two calls deep": ("x**power +", "x**power -"),
    "a default of an argument": ("power=2", "power=3"),
    "a number of another module": ("+ math.pi", "+ math.e"),
    "what a helper is called with": ("scaled(2.0)", "scaled(3.0)"),
    "the inside of a closure": ("return factor * x", "return factor + x"),
    "a partial's argument": ("np.multiply, 0.5", "np.multiply, 0.25"),
    "a partial's function": ("np.multiply, 0.5", "np.add, 0.5"),
    "a decorator": ("1.5 * method", "1.75 * method"),
    "an attribute of a base class": ("= 0.1\n", "= 0.2\n"),
    "a method of a base class": ("v / self.width", "v * self.width"),
    "a static method": ("x * 0.75", "x * 0.5"),
    "the base classes": ("Drag(Shape, rd.effects.Dissipative)", "Drag(Shape, rd.effects.Active)"),
    "a cached property": ("self.c**2", "self.c**3"),
    "a property": ("+ 0.125", "+ 0.375"),
    "a default of a field": ("= 0.25\n", "= 0.5\n"),
    "what is declared of a coefficient": ("minimum=0", "minimum=1"),
    "an operation": ("- halved(", "+ halved("),
    "a function inside": ("lambda x: x +", "lambda x: x *"),
    "a constant": ("q > 0.5", "q > 0.625"),
    "what is called": ("inner(self.shape(v))", "inner(self.bent(v))"),
    "an error that is caught": ("except IndexError", "except ValueError"),
    "a function of this library": ("import tanh", "import sin as tanh"),
}


def edited(where: str) -> str:
    old, new = EDITS[where]
    assert CELL.count(old) == 1, where
    return CELL.replace(old, new)


@pytest.mark.parametrize("where", EDITS)
def test_after_an_edit_of_what_it_reaches_a_class_has_another_definition(where: str) -> None:
    before, after = definition(cell(CELL).Drag), definition(cell(edited(where)).Drag)
    assert before is not None
    assert after is not None
    assert before != after


def test_a_definition_is_that_of_the_text_without_its_place_and_without_what_is_not_reached() -> None:
    """The cell run again; other lines before it; a comment; an edit of a function that nothing calls."""
    before = definition(cell(CELL).Drag)
    for text in (CELL, "\n\nother = 3\n" + CELL, CELL.replace("- 1.0", "- 2.0"), CELL.replace("c**2\n", "c**2  # c\n")):
        assert definition(cell(text).Drag) == before


def test_another_process_has_the_same_definition(tmp_path) -> None:
    """With hashes of another seed; from a script in place of a cell."""
    (tmp_path / "script.py").write_text(CELL)
    code = "import script; from robot_dyn.codegen.store.definition import definition; print(definition(script.Drag))"
    for seed in ("1", "2"):
        done = subprocess.run(
            [sys.executable, "-c", f"import sys; sys.path.insert(0, {str(tmp_path)!r}); {code}"],
            env=os.environ | {"PYTHONHASHSEED": seed}, capture_output=True, text=True, check=True,
        )  # fmt: skip
        assert done.stdout.strip() == definition(cell(CELL).Drag)


def test_what_is_reached_in_another_module_is_in_the_definition(monkeypatch: pytest.MonkeyPatch) -> None:
    """By the name of the module, and by inheritance; not what is beside it there."""
    helpers = ModuleType("helpers")
    text = "class Base:\n  def g(self, x): return {} * x\ndef h(x): return {} + x\ndef other(x): return {} * x"
    monkeypatch.setitem(sys.modules, "helpers", helpers)
    made = []
    for numbers in ((1.0, 1.0, 1.0), (2.0, 1.0, 1.0), (1.0, 2.0, 1.0), (1.0, 1.0, 2.0)):
        exec(text.format(*numbers), helpers.__dict__)
        own = cell("import helpers\nclass Own(helpers.Base):\n  def f(self, x): return helpers.h(self.g(x))")
        made.append(definition(own.Own))
    assert None not in made
    assert made[0] == made[3]
    assert len({*made}) == 3


UNDEFINED = {
    "a file": "def f(t, q, v): return np.loadtxt('gains') * v",
    "a file that is opened": "def f(t, q, v): return float(open('gains').read()) * v",
    "the time": "import time\ndef f(t, q, v): return time.time() * v",
    "a setting of NumPy": "def f(t, q, v): return -v * (2.0 if np.geterr()['over'] == 'warn' else 9.0)",
    "memory that holds anything": "def f(t, q, v): return np.empty(2) * v",
    "the time of NumPy": "def f(t, q, v): return np.datetime64('now').astype(float) * v",
    "builtins of its own":
        "g = dict(__builtins__={'abs': lambda x: 2.0})\nexec('def f(t, q, v): return abs(v)', g)\nf = g['f']",
    "the environment": "import os\ndef f(t, q, v): return float(os.environ['GAIN']) * v",
    "random numbers": "def f(t, q, v): return np.random.rand() * v",
    "a generator": "R = np.random.default_rng(1)\ndef f(t, q, v): return R.normal() * v",
    "a list": "GAINS = [1.0]\ndef f(t, q, v): return GAINS[0] * v",
    "a dictionary": "GAINS = {'a': 1.0}\ndef f(t, q, v): return GAINS['a'] * v",
    "an object": "class G: x = 1.0\ng = G()\ndef f(t, q, v): return g.x * v",
    "a method of an object": "class G:\n  def h(self, x): return x\nh = G().h\ndef f(t, q, v): return h(v)",
    "a robot": "ARM = rd.load('planar_2r')\ndef f(t, q, v): return ARM.N(q)",
    "a file of a robot": "def f(t, q, v): return rd.load('arm.urdf').N(q)",
    "a module as a value": "def f(t, q, v): return vars(np)['sin'](v)",
    "a function by its text": "def f(t, q, v): return eval('v')",
    "an attribute by its text": "def f(t, q, v): return getattr(v, 'T')",
    "globals of a function": "def g(): return X\nX = 2.0\ndef f(t, q, v): return g.__globals__['X'] * v",
    "a global that it sets": "N = 0\ndef f(t, q, v):\n  global N\n  N += 1\n  return N * v",
    "an attribute that it sets": "def g(): pass\ndef f(t, q, v):\n  g.n = 1\n  return v",
    "a variable around it that it sets":
        "def make():\n  n = 0\n  def f(t, q, v):\n    nonlocal n\n    n += 1\n    return n * v\n  return f\nf = make()",
    "an import": "def f(t, q, v):\n  import math\n  return math.pi * v",
    "a name without a value": "def f(t, q, v): return unknown * v",
    "a cache": "from functools import lru_cache\n@lru_cache\ndef g(x): return x\ndef f(t, q, v): return g(2.0) * v",
    "an array of objects": "A = np.array([1.0, None])\ndef f(t, q, v): return A[0] * v",
    "code in C of others": "from lxml.etree import tostring\ndef f(t, q, v): return tostring(v)",
    "a made ufunc": "g = np.frompyfunc(lambda x: x, 1, 1)\ndef f(t, q, v): return g(v)",
    "a metaclass": "class M(type): pass\nclass G(metaclass=M): x = 1.0\ndef f(t, q, v): return G.x * v",
    "a list in a class": "class G: x = [1.0]\ndef f(t, q, v): return G.x[0] * v",
    "the identity of an object": "def f(t, q, v): return id(v) * v",
}  # fmt: skip


@pytest.mark.parametrize("what", UNDEFINED)
def test_what_another_process_may_have_otherwise_has_no_definition(what: str) -> None:
    module = cell("import numpy as np\nimport robot_dyn as rd\n" + UNDEFINED[what])
    assert definition(module.f) is None
    assert definition(cell("def f(t, q, v): return -v").f) is not None


def structure_of(effect: Any) -> Any:
    return structure(StateEquation(rd.Plant(ARM, [effect]), None))


def test_what_is_changed_at_run_time_is_in_the_structure() -> None:
    """An attribute of a class, a method put in its place, one put into an object, a variable of the module."""
    module = cell(CELL)
    known = [structure_of(module.Drag())]
    for changed, name, value in (
        (module.Drag, "width", 0.3),
        (module.Drag, "shape", lambda self, v: v),
        (module, "GAIN", 7.0),
        (module.deepest, "__defaults__", (5,)),
    ):
        setattr(changed, name, value)
        known.append(structure_of(module.Drag()))
    assert all(each.lasting for each in known)
    assert len({each.described for each in known}) == len(known)
    drag = module.Drag()
    object.__setattr__(drag, "torque", lambda dynamics, t, q, v: -v)
    assert not structure_of(drag).lasting


def test_values_inside_of_parts_that_are_no_parameters_are_in_the_structure() -> None:
    """A coefficient of an effect is an input of machine code; that of a part of it is not, nor is −0 or 1 for 1.0."""
    module = cell(CELL)
    inner = [
        module.Drag(then=each) for each in (rd.effects.Spring(3.0), rd.effects.Spring(5.0), rd.Payload("tip", 1.0))
    ]
    inner += [module.Drag(then=rd.Payload("tip", 2.0)), module.Drag(then=rd.control.hold([0.1, 0.2]))]
    inner += [
        module.Drag(then=rd.control.hold([0.1, 0.3])),
        module.Drag(then=0.0),
        module.Drag(then=-0.0),
        module.Drag(then=0),
    ]
    inner += [module.Drag(then=ARM), module.Drag(then=ARM.with_(gravity=(0.0, 0.0, -1.62)))]
    assert len({structure_of(each).described for each in inner}) == len(inner)
    assert structure_of(module.Drag(1.0)) == structure_of(module.Drag(2.0))


def test_a_part_that_is_an_effect_and_stands_in_another_one_is_a_number_there() -> None:
    """Its coefficient is an input as that of the effect, and a constant of the other one."""
    module = cell(CELL)
    made = []
    for spring in (rd.effects.Spring(3.0), rd.effects.Spring(5.0)):
        plants = rd.Plant(ARM, [spring]), rd.Plant(ARM, [spring, module.Drag(then=spring)])
        made.append([structure(StateEquation(each, None)).described for each in plants])
    assert made[0][0] == made[1][0]
    assert made[0][1] != made[1][1]


def test_numbers_that_a_controller_follows_and_knows_are_no_structure() -> None:
    """Gains, references, payload and gravity of its model, in a loop as well; the masses of the model are."""
    known = []
    for x, scale in ((1.0, 1.0), (2.0, 1.0), (1.0, 1.1)):
        model = ARM.with_(payload=rd.Payload("tip", x), gravity=(0.0, 0.0, -9.0 - x), mass_scale=scale)
        inner = rd.control.ComputedTorque(model, rd.control.hold([x, 0.2]), kp=10.0 * x, kd=x, period_s=0.01)
        loop = rd.control.Loop(inner, velocity=[rd.control.LowPass(3.0 * x)])
        known.append([structure(StateEquation(rd.Plant(ARM), each)).described for each in (inner, loop)])
    assert known[0] == known[1]
    assert known[0][0] != known[2][0]
    assert known[0][1] != known[2][1]


def in_another_process(module: Any, store: Memory, monkeypatch: pytest.MonkeyPatch) -> str:
    """The rate of an arm with this effect, by the programs of the store if they are there."""
    monkeypatch.setattr(cache, "_functions", LRUByIdentity())
    monkeypatch.setattr(cache, "_symbols", LRUByIdentity())
    monkeypatch.setattr(cache, "default_store", lambda: store)
    made = machine_code(StateEquation(rd.Plant(ARM, [module.Drag()]), None), rd.integrate.method("RK4"))
    return str(made.code.programs["rate"])


def test_programs_of_user_defined_classes_are_restored_and_after_an_edit_they_are_not(monkeypatch) -> None:
    store, traces = Memory(), []
    trace = cache._traced
    monkeypatch.setattr(cache, "_traced", lambda *given: traces.append(given) or trace(*given))
    first = in_another_process(cell(CELL), store, monkeypatch)
    assert in_another_process(cell(CELL), store, monkeypatch) == first
    assert len(traces) == 1
    made = {in_another_process(cell(edited(where)), store, monkeypatch) for where in ("a helper", "a decorator")}
    assert len(traces) == 3
    assert len(made | {first}) == 3


def test_what_changes_while_it_is_traced_is_not_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    store = Memory()
    text = CELL.replace("inner = lambda", "WEIGHTS[0] += 1.0; inner = lambda")
    in_another_process(cell(text), store, monkeypatch)
    assert not store
