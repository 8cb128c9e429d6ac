"""Runs to plot, and what stands on the axes of a figure."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

import robot_dyn as rd
from robot_dyn.simulation import Ledger


@cache
def ur5():
    """UR5 under PD, in general position."""
    arm = rd.load("ur5")
    q = np.array([0.1, -1.2, 1.8, -2.2, -1.5, 0.3])
    plan = rd.control.quintic(q, q + np.array([0.3, -0.2, 0.1, 0.4, -0.3, 0.2]), 0.2)
    kp, kd = rd.control.gains_from(np.diag(arm.M(q)), 20.0)
    controller = rd.control.PD(plan, kp=kp, kd=kd)
    return rd.simulate(rd.Plant(arm), q0=q, v0=0 * q, duration_s=0.3, controller=controller, method="RK4", step_s=0.005)


@cache
def cart_pole():
    """A joint that slides and one that turns, without a reference."""
    plant = rd.Plant(rd.load("cart_pole"), [rd.effects.ViscousFriction(0.1)])
    return rd.simulate(plant, q0=[0.1, 0.4], v0=[0.2, -0.3], duration_s=0.2, method="RK4", step_s=0.01)


def cells(figure, symbol: str) -> list:
    """The axes whose y axis has that symbol before its unit."""
    return [axes for axes in figure.axes if axes.get_ylabel().partition("[")[0].strip() == symbol]


def headings(figure) -> str:
    """Texts of a figure and of its parts that are not of axes."""
    return " ".join([*(text.get_text() for text in figure.texts), *map(headings, figure.subfigs)])


def legend(figure) -> list[str]:
    """The entries of the legends of a figure and of its parts."""
    legends = [*figure.legends, *(axes.get_legend() for axes in figure.axes if axes.get_legend())]
    own = [text.get_text() for each in legends for text in each.texts]
    return own + [text for part in figure.subfigs for text in legend(part)]


def lines(axes, label: str) -> list:
    return [line for line in axes.lines if line.get_label() == label]


def stretched(run, m: int, **changes):
    """The run with m samples of made-up, smooth motion, whose ledger does not matter."""
    t = np.linspace(0.0, 5.0, m)
    q = np.sin(t[:, None] * np.arange(1, len(run.joint_names) + 1))
    zero = np.zeros(m)
    made = {"t": t, "q": q, "v": q, "a": q, "u": q, "desired": None, "tracking_error": None, "error": None}
    return replace(run, **(made | {"ledger": Ledger(zero, zero, {"control": zero})} | changes))


def many(run, n: int, m: int = 50):
    return stretched(replace(run, joint_names=tuple(f"joint_{i:02d}" for i in range(n)), metadata={}), m)
