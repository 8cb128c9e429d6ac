"""Logs of ROS 2: joints by the names in each message, times as they are named, and nothing of a broken log."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.foundations import PlanError
from tests.control.test_from_samples import ARM, NAMES, REST, T

writer = pytest.importorskip("mcap_ros2.writer")

FIRST = 1_700_000_000_123_456_789  # [ns]: of seconds since 1970, a float keeps 2e-7
LATE = 3_000_000  # [ns] from the measurement to the log, and a varying part of it
STATE = """std_msgs/Header header
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


class Message(NamedTuple):
    header: int
    log: int
    names: list[str]
    position: list[float]


def measured(names: tuple[str, ...] = NAMES, q: np.ndarray = REST) -> list[Message]:
    """The motion, with the joints of each message in another order."""
    rng, found = np.random.default_rng(0), []
    for t, row in zip(T, q, strict=True):
        order, ns = rng.permutation(6), FIRST + round(t * 1e9)
        late = LATE + int(rng.integers(LATE))
        found.append(Message(ns, ns + late, [names[i] for i in order], row[order].tolist()))
    return found


def write(path: Path, messages: Iterable[Message], topic: str = "/joint_states", other: str = "") -> Path:
    with path.open("wb") as stream, writer.Writer(stream) as log:
        state = log.register_msgdef("sensor_msgs/msg/JointState", STATE)
        number = log.register_msgdef("std_msgs/msg/Float64", "float64 data\n")
        for k, each in enumerate(messages):
            stamp = {"sec": each.header // 10**9, "nanosec": each.header % 10**9}
            message = {"header": {"stamp": stamp, "frame_id": ""}, "name": each.names, "position": each.position}
            log.write_message(topic, state, message | {"velocity": [], "effort": []}, each.log, each.log, k)
        if other:
            log.write_message(other, number, {"data": 1.0}, FIRST, FIRST, 0)
    return path


def test_joints_are_found_by_name_at_the_times_of_the_headers(tmp_path: Path) -> None:
    """The motion is one polynomial of degree 5: times to the nanosecond give it back to rounding of positions."""
    plan = rd.control.from_samples(ARM, write(tmp_path / "log.mcap", measured()))
    np.testing.assert_allclose(plan.reference.at(T)[0], REST, atol=1e-8)  # 1 ns at 1 rad/s, 9 digits of a stamp
    np.testing.assert_allclose(plan.reference.at(0.5 * (T[1:] + T[:-1]))[0], 0.5 * (REST[1:] + REST[:-1]), atol=1e-3)
    assert plan.reference.start_s == 0 and plan.duration_s == pytest.approx(2.0, abs=1e-9) and plan.findings == ()
    assert "topic /joint_states, times of headers, from 1700000000.123456789 s" in plan.method


def test_times_of_the_log_are_those_at_which_it_got_the_messages(tmp_path: Path) -> None:
    messages = measured()
    path = write(tmp_path / "log.mcap", messages)
    t = np.array([each.log - messages[0].log for each in messages]) * 1e-9
    plan = rd.control.from_samples(ARM, path, time="log")
    np.testing.assert_allclose(plan.reference.breaks, t, atol=1e-12)
    assert "times of the log, from" in plan.method
    unstamped = write(tmp_path / "unstamped.mcap", [each._replace(header=0) for each in messages])
    plan = rd.control.from_samples(ARM, unstamped)
    np.testing.assert_allclose(plan.reference.breaks, t, atol=1e-12)
    assert "times of the log (headers have none)" in plan.method


def test_other_joints_and_messages_of_others_are_left_out_and_said(tmp_path: Path) -> None:
    both = [each._replace(names=[*each.names, "finger"], position=[*each.position, 0.1]) for each in measured()]
    expected = rd.control.from_samples(ARM, write(tmp_path / "plain.mcap", measured())).reference.coefficients
    gripper = [Message(each.header + 1, each.log + 1, ["finger"], [0.2]) for each in both]
    between = [each for pair in zip(measured(), gripper, strict=True) for each in pair]
    for name, messages in (("both", both), ("between", between)):
        plan = rd.control.from_samples(ARM, write(tmp_path / f"{name}.mcap", messages))
        np.testing.assert_array_equal(plan.reference.coefficients, expected)
        assert plan.method.endswith("; without finger")


def test_names_of_the_log_are_given_by_joint(tmp_path: Path) -> None:
    path = write(tmp_path / "log.mcap", measured(tuple(f"left_{name}" for name in NAMES)), "/left/states", "/x")
    plan = rd.control.from_samples(ARM, path, joints={name: f"left_{name}" for name in NAMES})
    np.testing.assert_allclose(plan.reference.at(T)[0], REST, atol=1e-8)
    with pytest.raises(PlanError, match=r"0 messages of /left/states name joints of the arm.*left_wrist"):
        rd.control.from_samples(ARM, path)


def test_a_log_of_rd_export_is_read_back(tmp_path: Path) -> None:
    """Positions to the bit at its samples, by either topic."""
    controller = rd.control.PD(rd.control.quintic([0.1] * 6, [0.3] * 6, 0.3), kp=400.0, kd=40.0)
    run = rd.simulate(ARM, [0.1] * 6, duration_s=0.3, controller=controller)
    path = run.save(tmp_path / "run.mcap")
    assert run.desired is not None
    for topic, q in (("/joint_states", run.q), ("/desired/joint_states", run.desired)):
        plan = rd.control.from_samples(ARM, path, topic=topic, ends="rest")
        np.testing.assert_allclose(plan.reference.at(plan.reference.breaks)[0], q, atol=1e-14)
        np.testing.assert_allclose(plan.reference.breaks, run.t, atol=1e-9)


def changed(k: int, **fields: Any) -> list[Message]:
    messages = measured()
    messages[k] = messages[k]._replace(**fields)
    return messages


@pytest.mark.parametrize(
    ("messages", "options", "message"),
    [
        (changed(5, names=list(NAMES[:5]), position=[0.3] * 5), {}, "message 6 of /joint_states has other joints"),
        (changed(5, position=[]), {}, "message 6 of /joint_states has 0 positions for 6 different names"),
        (changed(5, names=[NAMES[0]] * 6), {}, "message 6 of /joint_states has 6 positions for 1 different names"),
        (changed(5, position=[np.nan] * 6), {}, "sample 6 is nan"),
        (changed(5, header=FIRST), {}, r"times must increase: sample 6 is at 0 s.*time='log'"),
        ([each._replace(header=0) for each in measured()], {"time": "header"}, "times must increase: sample 2 is at 0"),
        (measured(), {"topic": "/joint_state"}, "/joint_state: there is no such topic .*nearest: /joint_states"),
        (measured(), {"topic": "/x"}, "/x is of std_msgs/msg/Float64, not sensor_msgs/msg/JointState"),
        (measured(), {"time": "t"}, "time of a log must be 'header' or 'log', got 't'"),
        (measured(), {"time": T}, "time of a log must be 'header' or 'log'"),
        ([], {}, "there is no topic of sensor_msgs/msg/JointState; topics: /x"),
    ],
)
def test_a_log_without_a_single_meaning_is_refused(
    tmp_path: Path, messages: list[Message], options: dict[str, Any], message: str
) -> None:
    path = write(tmp_path / "log.mcap", messages, other="/x")
    with pytest.raises(PlanError, match=message):
        rd.control.from_samples(ARM, path, **options)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda data: data[:5000], "cannot be read as an MCAP log"),
        (lambda data: data[:3000] + bytes([data[3000] ^ 255]) + data[3001:], "crc validation failed"),
        (lambda data: b"\x89MCAP0\r\n", "cannot be read as an MCAP log"),
        (lambda data: b"t,a\n0,1\n", "is not an MCAP file"),
        (lambda data: b"", "is not an MCAP file"),
    ],
)
def test_a_broken_log_is_refused_by_name(tmp_path: Path, change: Any, message: str) -> None:
    path = write(tmp_path / "log.mcap", measured())
    path.write_bytes(change(path.read_bytes()))
    with pytest.raises(PlanError, match=rf"{re.escape(str(path))}: .*{message}"):
        rd.control.from_samples(ARM, path)


@pytest.mark.parametrize("options", [{"topic": "/joint_states"}, {"time": "header"}])
def test_options_of_logs_are_refused_for_other_sources(options: dict[str, str]) -> None:
    table = {"t": T} | dict(zip(NAMES, REST.T, strict=True))
    with pytest.raises(PlanError, match=r"applies to MCAP logs only"):
        rd.control.from_samples(ARM, table, **options)


@pytest.mark.parametrize(
    ("definition", "message"),
    [
        ("", {}),
        (STATE.replace("string[] name\n", ""), {}),
        (STATE.replace("float64[] position", "string[] position"), {"name": ["a"], "position": ["up"]}),
        ("string[] name\nfloat64[] position\n", {"name": [NAMES[0]], "position": [0.0]}),
    ],
)
def test_a_message_of_another_definition_is_refused_by_name(tmp_path: Path, definition: str, message: dict) -> None:
    """A log defines its messages; the name alone does not make one a joint state."""
    path, header = tmp_path / "log.mcap", {"header": {"stamp": {"sec": 1, "nanosec": 0}, "frame_id": ""}}
    with path.open("wb") as stream, writer.Writer(stream) as log:
        state = log.register_msgdef("sensor_msgs/msg/JointState", definition)
        for k in range(3):
            log.write_message("/joint_states", state, (header if "header" in definition else {}) | message, k, k, k)
    with pytest.raises(PlanError, match=r"log\.mcap: message 1 of /joint_states lacks the header, names or positions"):
        rd.control.from_samples(ARM, path)


def late(messages: list[Message], ns: int, q: np.ndarray | None = None) -> list[Message]:
    """Messages of a second publisher, whose clock is behind, with its own positions."""
    rows = messages if q is None else [m._replace(names=list(NAMES), position=list(q)) for m in messages]
    return [m._replace(header=m.header - ns, log=m.log + 1) for m in rows]


@pytest.mark.parametrize("ns", [0, 60_000_000, 10**9, 10**12])
@pytest.mark.parametrize("time", ["header", "log"])
def test_two_publishers_on_one_topic_are_named(tmp_path: Path, ns: int, time: str) -> None:
    """A robot, and a simulator that publishes zeros, by either time."""
    pairs = zip(measured(), late(measured(), ns, np.zeros(6)), strict=True)
    path = write(tmp_path / "log.mcap", [message for pair in pairs for message in pair])
    with pytest.raises(PlanError, match="two publishers appear to be interleaved"):
        rd.control.from_samples(ARM, path, time=time, ends="measured")


def test_publishers_of_different_joints_are_named_and_one_of_them_can_be_read(tmp_path: Path) -> None:
    """The remedy of the message works."""
    messages = [
        message._replace(
            names=[name for name in message.names if (name in NAMES[:3]) is first],
            position=[
                x for name, x in zip(message.names, message.position, strict=True) if (name in NAMES[:3]) is first
            ],
        )
        for message in measured()
        for first in (True, False)
    ]
    path = write(tmp_path / "log.mcap", messages)
    with pytest.raises(PlanError, match=r"two publishers share the topic; read one by joints="):
        rd.control.from_samples(ARM, path)
    plan = rd.control.from_samples(ARM, path, joints={name: name for name in NAMES[:3]}, q0=np.zeros(6))
    np.testing.assert_allclose(plan.reference.at(T)[0][:, :3], REST[:, :3], atol=1e-8)
