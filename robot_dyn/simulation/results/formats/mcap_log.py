"""A run as an MCAP log of ROS 2 messages in CDR, by mcap and mcap-ros2-support.

| topic | type | contents |
|---|---|---|
| /joint_states | sensor_msgs/msg/JointState | q, v and u as position, velocity and effort |
| /desired/joint_states | sensor_msgs/msg/JointState | desired positions |
| /causes/NAME | sensor_msgs/msg/JointState | effort: the part of u for inertia, gravity, an effect, … |
| /tracking_error/x, y, z | std_msgs/msg/Float64 | p_d − p of a frame, in [m] |
| /power/NAME, /energy, /residual | std_msgs/msg/Float64 | power of the control and each effect, [W]; energies, [J] |

Time 0 of the run is time 0 of the log, to 1 ns. A message contains all joints or one number; messages are in the order
of time. Units are in the metadata record "robot_dyn". The causes add up to u; a run without recorded torques of its
effects has none, and the record states the reason.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import Any, BinaryIO

import numpy as np

from robot_dyn.foundations.errors import QueryError
from robot_dyn.foundations.extras import needs
from robot_dyn.simulation.columns import EXTRA, Column
from robot_dyn.simulation.results.causes import causes_of
from robot_dyn.simulation.results.run_data import TrajectoryData, attributes
from robot_dyn.simulation.results.run_file import RunFileError

_JOINT_STATE = """std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
_NS = 10**9
_LONGEST_S = 2.0**31  # seconds of a stamp are an int32
_NUMBERS = ("tracking error", "power", "energy", "residual")
_STATE, _NUMBER = "sensor_msgs/msg/JointState", "std_msgs/msg/Float64"
_DEFINITIONS = {_STATE: _JOINT_STATE, _NUMBER: "float64 data\n"}

Topic = tuple[str, str, Iterator[Any]]  # its name, its type, and its messages


def write(run: TrajectoryData, columns: list[Column], stream: BinaryIO) -> None:
    """Write a message of each topic at each sample."""
    if not (run.t < _LONGEST_S).all():
        raise RunFileError(f"the run ends at t = {run.t[-1]:.3g} s; stamps of ROS 2 end at {_LONGEST_S:.3g} s")
    stamps = [round(t * _NS) for t in run.t.tolist()]
    causes, missing = _causes(run)
    units = {f"unit of {x.quantity} {x.component}".rstrip(): x.unit for x in columns if x.unit}
    topics = [
        *_of_joints(run, stamps, causes),
        *_of_numbers([column for column in columns if column.quantity in _NUMBERS]),
    ]
    with needs("mcap_ros2.writer", extra=EXTRA).Writer(stream) as log:
        types = {name: log.register_msgdef(name, text) for name, text in _DEFINITIONS.items()}
        log.add_metadata("robot_dyn", attributes(run) | units | missing)
        for k, ns in enumerate(stamps):
            for name, kind, messages in topics:
                log.write_message(name, types[kind], next(messages), ns, ns, k)


def _causes(run: TrajectoryData) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """Return the joint torque due to each cause, (m, n), or the reason why it is unavailable."""
    try:
        return causes_of(run).torques, {}
    except QueryError as error:
        return {}, {"causes": f"none: {error}"}


def _of_joints(run: TrajectoryData, stamps: Sequence[int], causes: dict[str, np.ndarray]) -> Iterator[Topic]:
    none = np.empty((len(run.t), 0))  # absent fields are empty, see sensor_msgs/JointState.msg
    yield "/joint_states", _STATE, _states(run, stamps, run.q, run.v, run.u)
    if run.desired is not None:
        yield "/desired/joint_states", _STATE, _states(run, stamps, run.desired, none, none)
    for name, torque in zip(_names([f"/causes/{_word(cause)}" for cause in causes]), causes.values(), strict=True):
        yield name, _STATE, _states(run, stamps, none, none, torque)


def _states(run: TrajectoryData, stamps: Sequence[int], *values: np.ndarray) -> Iterator[Any]:
    """Yield messages of position, velocity and effort, (m, n) or (m, 0) each."""
    names = list(run.joint_names)
    for ns, position, velocity, effort in zip(stamps, *values, strict=True):
        seconds, rest = divmod(ns, _NS)
        yield {
            "header": {"stamp": {"sec": seconds, "nanosec": rest}, "frame_id": ""},
            "name": names,
            "position": position.tolist(),
            "velocity": velocity.tolist(),
            "effort": effort.tolist(),
        }


def _of_numbers(columns: Sequence[Column]) -> Iterator[Topic]:
    """Yield a topic for each column."""
    names = _names(
        [f"/{_word(column.quantity)}" + f"/{_word(column.component)}" * bool(column.component) for column in columns]
    )
    for name, column in zip(names, columns, strict=True):
        yield name, _NUMBER, ({"data": x} for x in column.values.tolist())


def _word(name: str) -> str:
    """Return a name of letters, digits and underscores, as ROS requires."""
    return re.sub("[^A-Za-z0-9_]+", "_", name)


def _names(names: Sequence[str]) -> list[str]:
    """Return the names, made unique by numbers."""
    return [f"{name}_{k + 1}" if names.count(name) > 1 else name for k, name in enumerate(names)]
