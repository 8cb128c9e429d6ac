"""CasADi expressions as text formulas, with every intermediate result written out where it is used."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    import casadi as ca

_LONGEST = 2000  # characters; longer formulas are not printed
_NODES = 400  # operations; the walk is recursive
_SUM, _PRODUCT, _ATOM = range(3)


class _Term(NamedTuple):
    """A signed formula; `level` is its outermost operation."""

    sign: int
    text: str
    level: int

    def inside(self, level: int) -> str:
        """Return the text for an operation that binds more tightly than those below `level`."""
        text = self.text if self.sign > 0 else f"-{self.within(_PRODUCT)}"
        return f"({text})" if (self.level if self.sign > 0 else _SUM) < level else text

    def within(self, level: int) -> str:
        """Return the text without its sign."""
        return f"({self.text})" if self.level < level else self.text


def formula(expression: ca.SX) -> str:
    """Return a scalar in Python's notation, with six digits per number, or a note if it is too long to read."""
    import casadi as ca

    nodes = ca.n_nodes(expression)
    if nodes <= _NODES:
        text = _term(expression).inside(_SUM)
        if len(text) <= _LONGEST:
            return text
    return f"... ({nodes} operations, too long to print)"


def _term(x: ca.SX) -> _Term:
    if x.is_constant():
        value = float(x)
        return _Term(-1 if value < 0 else 1, f"{abs(value):.6g}", _ATOM)
    if x.is_symbolic():
        return _Term(1, x.name(), _ATOM)
    name = _operations()[x.op()]
    first, *rest = terms = [_term(x.dep(k)) for k in range(x.n_dep())]
    if sum(len(term.text) for term in terms) > _LONGEST:
        return _Term(1, "." * (_LONGEST + 1), _ATOM)
    if name == "neg":
        return first._replace(sign=-first.sign)
    if name in ("add", "sub"):
        second = rest[0] if name == "add" else rest[0]._replace(sign=-rest[0].sign)
        if first.sign < 0 < second.sign:
            first, second = second, first
        plus = f"+ {second.text}" if second.sign > 0 else f"- {second.within(_PRODUCT)}"
        return _Term(1, f"{first.inside(_SUM)} {plus}", _SUM)
    if name in ("mul", "div", "twice", "inv"):
        left, right = {"twice": (_Term(1, "2", _ATOM), first), "inv": (_Term(1, "1", _ATOM), first)}.get(
            name, (first, rest[0] if rest else first)
        )
        is_quotient = name in ("div", "inv")
        below = right.within(_ATOM if is_quotient else _PRODUCT)
        return _Term(left.sign * right.sign, f"{left.within(_PRODUCT)}{'/' if is_quotient else '*'}{below}", _PRODUCT)
    if name in ("sq", "pow", "constpow"):
        power = "2" if name == "sq" else rest[0].inside(_ATOM)
        return _Term(1, f"{first.inside(_ATOM)}**{power}", _PRODUCT)
    return _Term(1, f"{name}({', '.join(term.inside(_SUM) for term in terms)})", _ATOM)


@cache
def _operations() -> dict[int, str]:
    """Return the names of CasADi's operations."""
    import casadi as ca

    return {getattr(ca, name): name[3:].lower() for name in dir(ca) if name.startswith("OP_")}
