"""Random joints on a spring that rub in a thin layer of velocity, or on short bristles, and their truth.

    m x'' = −k x − F,   F = f(|v|) sign(v), with sticking, or f tanh(v / v_s), or LuGre's σ₀ z + σ₁ z' + σ₂ v

The truth is SciPy's DOP853 near rounding over this one equation, begun again at each reversal with the formulas of the
other side. It shares the numbers of a scene with the library, and nothing else.
"""

from __future__ import annotations

from collections.abc import Callable
from math import exp, tanh
from typing import Any

import numpy as np
from scipy.integrate import DOP853
from scipy.optimize import brentq

import robot_dyn as rd
from tests.campaigns.estimates.judge import Judgement, judged
from tests.campaigns.estimates.scenes import Scene

LAWS = ("dry", "dry", "tanh", "lugre")  # Stribeck's curve twice: it is half of all scenes
METHODS = ("RK4", "Midpoint", "DP8", "Rodas5PFixed", "RK4")
MASS = 1.9
SLIDER = f"""<robot name="slider"><link name="base"/><link name="block"><inertial><mass value="{MASS}"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
<joint name="slide" type="prismatic"><parent link="base"/><child link="block"/><axis xyz="1 0 0"/>
<limit lower="-99" upper="99" effort="999" velocity="999"/></joint></robot>"""

Rate = Callable[[float, np.ndarray], list[float]]


def layer_scene(seed: int, index: int) -> Scene:
    """Scene number `index` of a seed: a joint that reverses, once or a few times, by one of five methods."""
    rng = np.random.default_rng([seed, index, 31])
    law, method = LAWS[index % len(LAWS)], METHODS[index % len(METHODS)]
    step, duration = float(np.round(10 ** rng.uniform(-3.5, -2.3), 6)), float(np.round(rng.uniform(0.3, 1.2), 3))
    q, v, stiffness = -rng.uniform(0.3, 1), -rng.uniform(0.2, 3), rng.uniform(20, 120)
    sliding, static, speed = rng.uniform(4, 8), rng.uniform(8, 20), 10 ** rng.uniform(-2.3, -1)
    if law == "dry":
        friction = rd.effects.DryFriction(sliding, static=static, stribeck_velocity=speed)
    elif law == "tanh":
        friction = rd.effects.RegularisedCoulombFriction(static, speed)
    else:
        bristles = 10 ** rng.uniform(3, 4.5)
        damping = np.sqrt(bristles * MASS) * rng.uniform(0, 1)
        friction = rd.effects.LuGreFriction(bristles, damping, rng.uniform(0, 2), sliding, static, speed)
    setup = slide(step, q, v, duration, stiffness, friction, method)
    return Scene(law, setup, f"{seed}/{index} {law} {method} h={step:g} T={duration:g} v_s={speed:.2g}")


def slide(
    step: float, q: float, v: float, duration: float, stiffness: float, friction: rd.Effect, method: str
) -> rd.Setup:
    """A block on a rail without gravity, on a spring, that rubs."""
    robot = rd.Robot.from_text(SLIDER).with_(gravity=(0.0, 0.0, 0.0))
    plant = rd.Plant(robot, [rd.effects.Spring(stiffness, 0.0), friction])
    return rd.Setup(
        plant, [q], [v], duration, method=method, step_s=step, record_every_s=duration / 20, engine="compiled"
    )


def judge_layer(seed: int, index: int) -> Judgement:
    return judge_scene(layer_scene(seed, index))


def judge_scene(scene: Scene) -> Judgement:
    return judged(scene, slider_truth, lambda setup, t: slider_truth(setup, t, 1e-12))


def slider_truth(setup: rd.Setup, times: np.ndarray, tolerance: float = 3e-14) -> np.ndarray:
    """Positions at ascending times, (k, 1)."""
    spring, friction = setup.plant.effects
    result, t, y = np.empty((len(times), 1)), 0.0, np.append(setup.q0, setup.v0)
    k = _one(spring.stiffness)
    farthest = float(np.hypot(setup.q0[0], setup.v0[0] * np.sqrt(MASS / k)))
    if isinstance(friction, rd.effects.LuGreFriction):
        y, width, most = np.append(y, 0.0), _one(friction.stribeck_velocity), _one(friction.static)
    elif isinstance(friction, rd.effects.DryFriction):
        width, most = _one(friction.stribeck_velocity), _one(friction.static)
    else:
        width, most = _one(friction.velocity_scale), _one(friction.coulomb)
    longest = 2 * width * MASS / (k * farthest + most)  # so that a layer is not stepped over
    result[times <= 0.0] = y[0]
    while t < setup.duration_s:
        if y[1] == 0 and isinstance(friction, rd.effects.DryFriction) and abs(k * y[0]) <= most:
            result[times > t] = y[0]  # it sticks: nothing changes the load
            break
        way = float(np.sign(y[1] or _rate(k, friction, -np.sign(y[0]))(t, y)[1]))
        t, y = _until_reversal(_rate(k, friction, way), way, t, y, setup.duration_s, times, result, tolerance, longest)
    return result


def _rate(k: float, friction: Any, way: float) -> Rate:
    """The rate of (x, v), or (x, v, z), while v has one sign."""
    if isinstance(friction, rd.effects.DryFriction):
        low, high, v_s = (_one(x) for x in (friction.coulomb, friction.static, friction.stribeck_velocity))
        return lambda t, y: [
            y[1], (-k * y[0] - way * (low + (high - low) * exp(-((y[1] / v_s) ** 2)))) / MASS
        ]  # fmt: skip
    if isinstance(friction, rd.effects.RegularisedCoulombFriction):
        f, v_s = _one(friction.coulomb), _one(friction.velocity_scale)
        return lambda t, y: [y[1], (-k * y[0] - f * tanh(y[1] / v_s)) / MASS]
    names = ("bristle_stiffness", "bristle_damping", "viscous", "coulomb", "static", "stribeck_velocity")
    sigma, damping, viscous, low, high, v_s = (_one(getattr(friction, name)) for name in names)

    def rate(t: float, y: np.ndarray) -> list[float]:
        x, v, z = y
        bends = v - sigma * way * v * z / (low + (high - low) * exp(-((v / v_s) ** 2)))
        return [v, (-k * x - sigma * z - damping * bends - viscous * v) / MASS, bends]

    return rate


def _until_reversal(rate: Rate, way: float, t: float, y, end: float, times, result, tolerance: float, longest: float):
    """Time and state where v reverses, with v = 0, or at the end; positions are written."""
    first, last = DOP853(rate, t, y, end, rtol=tolerance, atol=tolerance / 10, max_step=longest), None
    while first.status == "running":
        first.step()
        assert first.status != "failed", f"at t = {first.t}"
        if way * first.y[1] < 0:
            dense, before = first.dense_output(), first.t_old
            root = (
                brentq(lambda s, dense=dense: dense(s)[1], before, first.t, xtol=1e-16)
                if way * dense(before)[1] > 0
                else before
            )
            last = DOP853(rate, before, dense(before), root, rtol=tolerance, atol=tolerance / 10)
        until = first.t if last is None else last.t_bound
        inside = (times > first.t_old) & (times <= until)
        if inside.any():
            result[inside, 0] = first.dense_output()(times[inside])[0]
        if last is not None:
            while last.status == "running" and last.t_bound > last.t:
                last.step()
            return last.t_bound, np.concatenate([last.y[:1], [0.0], last.y[2:]])
    return first.t, first.y


def _one(value: Any) -> float:
    """A coefficient of the one joint."""
    return float(np.ravel(value)[0])
