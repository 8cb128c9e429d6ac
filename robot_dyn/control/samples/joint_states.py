"""Logs of ROS 2: messages sensor_msgs/msg/JointState of an MCAP file, as columns by the names of joints.

Each message names its joints, in an order of its own. Times are those of the headers, at which the joints were
measured, or those at which the log got the messages; they are counted from the first message, in whole nanoseconds, so
that nothing of them is lost.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from robot_dyn.control.samples.table import Table
from robot_dyn.foundations.errors import PlanError, nearest, shorten, shown
from robot_dyn.foundations.extras import needs
from robot_dyn.foundations.files import reading

SUFFIX, TIMES = ".mcap", ("header", "log")
_TYPE, _TOPIC = "sensor_msgs/msg/JointState", "/joint_states"
_REMEDY = "give an MCAP log of ROS 2 messages"
_MAGIC = b"\x89MCAP0\r\n"
_LARGEST = 2**30  # bytes of a record
needs_data = partial(needs, extra="data")


def read_joint_states(path: str | Path, joint_names: tuple[str, ...], topic: str | None, time: Any) -> Table:
    """Return positions by name of joint from a topic of an MCAP log, with times from the first message.

    Args:
        path: The log.
        joint_names: Names that count; messages that have none of them, such as those of a gripper, are left out.
        topic: Of the messages; by default the one of joint states, or /joint_states if there are several.
        time: "header" or "log"; by default that of the headers, unless none of them has one.

    Raises:
        PlanError: If it cannot be read, the topic is not clear, or a message has not the joints of the others.
        MissingExtraError: Without mcap and mcap-ros2-support.
    """
    if time is not None and not (isinstance(time, str) and time in TIMES):
        raise PlanError(f"{path}: time of a log is 'header' or 'log', got {shown(time)}")
    for package in ("mcap", "mcap_ros2"):
        needs_data(package)
    with _opened(path) as stream:
        topic = _topic(path, dict(_topics(stream)), topic)
        messages = list(_decoded(stream, topic))
    times, rows, others = _of_joints(path, topic, messages, set(joint_names))
    of = time or ("header" if any(times["header"]) else "log")
    ns, where = times[of], "headers" if of == "header" else "the log" if time else "the log, as the headers have none"
    note = f"topic {topic}, times of {where}, from {ns[0] // 10**9}.{ns[0] % 10**9:09d} s" + others
    columns = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    return Table(columns, np.array([x - ns[0] for x in ns]) / 1e9, note)


@contextmanager
def _opened(path: str | Path) -> Iterator[BinaryIO]:
    """Open an MCAP file; whatever mcap raises of a broken one becomes a PlanError."""
    with reading(path, PlanError, _REMEDY) as stream:
        if stream.read(len(_MAGIC)) != _MAGIC:
            raise PlanError(f"{path}: is not an MCAP file; {_REMEDY}")
        try:
            yield stream
        except PlanError:
            raise
        except Exception as error:  # of mcap, its decompressors, or struct
            what = shorten(f"{type(error).__name__}: {error}", 160)
            raise PlanError(f"{path}: cannot be read as an MCAP log of ROS 2 ({what}); {_REMEDY}") from None


def _reader(stream: BinaryIO, decoders: tuple[Any, ...] = ()) -> Any:
    stream.seek(0)
    module = needs_data("mcap.reader")
    return module.SeekingReader(stream, validate_crcs=True, decoder_factories=decoders, record_size_limit=_LARGEST)


def _topics(stream: BinaryIO) -> Iterator[tuple[str, str]]:
    """Topic and type of each channel, from the index of the log or, without one, its messages."""
    reader = _reader(stream)
    summary = reader.get_summary()
    if summary is not None and summary.channels:
        pairs = [(each, summary.schemas.get(each.schema_id)) for each in summary.channels.values()]
    else:
        pairs = [(channel, schema) for schema, channel, _ in reader.iter_messages(log_time_order=False)]
    yield from dict.fromkeys((channel.topic, schema.name if schema else "") for channel, schema in pairs)


def _decoded(stream: BinaryIO, topic: str) -> Iterator[tuple[int, Any]]:
    """The log's time of each message of a topic, in [ns], and the message."""
    decoder = needs_data("mcap_ros2.decoder").DecoderFactory()
    for _, _, message, decoded in _reader(stream, (decoder,)).iter_decoded_messages(topics=[topic]):
        yield message.log_time, decoded


def _topic(path: str | Path, types: dict[str, str], topic: str | None) -> str:
    """Return the requested topic, or the only one of joint states, from the types of all."""
    known = [each for each, kind in types.items() if kind == _TYPE]
    if topic is not None:
        if topic not in known:
            kind = f" is of {types[topic] or 'no type'}, not" if topic in types else ": there is no such topic of"
            raise PlanError(f"{path}: {shorten(topic)}{kind} {_TYPE}; {nearest(topic, known)}")
        return topic
    if len(known) == 1 or _TOPIC in known:
        return _TOPIC if _TOPIC in known else known[0]
    if known:
        raise PlanError(f"{path}: {len(known)} topics are joint states; give topic= one of {', '.join(known[:6])}")
    listed = ", ".join(f"{name} ({kind})" for name, kind in list(types.items())[:6]) or "none"
    raise PlanError(f"{path}: there is no topic of {_TYPE}; topics: {shorten(listed, 300)}")


def _of_joints(
    path: str | Path, topic: str, messages: list[tuple[int, Any]], wanted: set[str]
) -> tuple[dict[str, list[int]], list[dict[str, float]], str]:
    """Return times in [ns] of headers and log, positions by joint, and a note on names that are left out."""
    times: dict[str, list[int]] = {"header": [], "log": []}
    rows: list[dict[str, float]] = []
    left_out: dict[str, None] = {}
    for k, (log, message) in enumerate(messages):
        where = f"{path}: message {k + 1} of {topic}"
        try:
            names, position = [str(name) for name in message.name], [float(x) for x in message.position]
            header = int(message.header.stamp.sec) * 10**9 + int(message.header.stamp.nanosec)
        except (AttributeError, TypeError, ValueError) as error:
            raise PlanError(
                f"{where} has not the header, names and positions of {_TYPE} ({shorten(str(error))}); the log"
                " defines another message by that name: write it again"
            ) from None
        left_out |= dict.fromkeys(name for name in names if name not in wanted)
        if not wanted & set(names):
            continue
        if len(position) != len(names) or len(set(names)) < len(names):
            raise PlanError(f"{where} has {len(position)} positions for {len(set(names))} different names")
        row = {name: x for name, x in zip(names, position, strict=True) if name in wanted}
        if rows and row.keys() != rows[0].keys():
            odd = ", ".join(sorted(row.keys() ^ rows[0].keys()))
            raise PlanError(f"{where} has not the joints of the ones before it: {odd}; split the log")
        rows.append(row)
        times["header"].append(header)
        times["log"].append(log)
    if len(rows) < 2:
        named = ", ".join(left_out) or "none"
        raise PlanError(
            f"{path}: {len(rows)} messages of {topic} name joints of the arm, 2 are the least; names:"
            f" {shorten(named, 200)}; give joints={{joint: name}}"
        )
    return times, rows, f"; without {shorten(', '.join(left_out), 120)}" if left_out else ""
