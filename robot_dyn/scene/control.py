"""The controllers and references a scene can name."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from robot_dyn.control.cartesian import CartesianReference, circle, line
from robot_dyn.control.computed_torque import ComputedTorque, FeedForward, PDGravity
from robot_dyn.control.controller import Controller
from robot_dyn.control.independent_joint import PD, PID, gains_from
from robot_dyn.control.operational_space import OperationalSpace
from robot_dyn.control.reference import PiecewisePolynomial, hold, quintic, via_points
