"""Logs of ROS 2: messages sensor_msgs/msg/JointState of an MCAP file, as columns by joint name.

Each message lists its joints in its own order. Times are read from the headers (when the joints were measured) or from
the log (when the messages arrived). They are counted from the first message in integer nanoseconds, without rounding.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from robot_dyn.control.samples.table import Table
from robot_dyn.foundations.errors import PlanError, nearest, shorten, shown
from robot_dyn.foundations.extras import needs
from robot_dyn.foundations.files import reading

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


SUFFIX, TIMES = ".mcap", ("header", "log")
_TYPE, _TOPIC = "sensor_msgs/msg/JointState", "/joint_states"
_REMEDY = "give an MCAP log of ROS 2 messages"
_MAGIC = b"\x89MCAP0\r\n"
_LARGEST = 2**30  # largest record, in bytes
needs_data = partial(needs, extra="data")


def read_joint_states(
    path: str | Path, joint_names: tuple[str, ...], topic: str | None, time: ArrayLike | None
) -> Table:
    """Return positions by joint name from a topic of an MCAP log, with times from the first message.

    Args:
        path: Path of the log.
        joint_names: Names to read; messages with none of them, for example from a gripper, are skipped.
        topic: Topic of the messages; by default the only one of joint states, or /joint_states if there are several.
        time: "header" or "log"; by default "header", unless no header has a time.

    Raises:
        PlanError: If the file cannot be read, the topic is ambiguous, or the joints of messages differ.
        MissingExtraError: If mcap or mcap-ros2-support is not installed.
    """
    if time is not None and not (isinstance(time, str) and time in TIMES):
        raise PlanError(f"{path}: time of a log must be 'header' or 'log', got {shown(time)}")
    for package in ("mcap", "mcap_ros2"):
        needs_data(package)
    with _opened(path) as stream:
        topic = _topic(path, dict(_topics(stream)), topic)
        messages = list(_decoded(stream, topic))
    times, rows, others = _of_joints(path, topic, messages, set(joint_names))
    clock = time or ("header" if any(times["header"]) else "log")
    ns, origin = times[clock], "headers" if clock == "header" else "the log" if time else "the log (headers have none)"
    note = f"topic {topic}, times of {origin}, from {ns[0] // 10**9}.{ns[0] % 10**9:09d} s" + others
    columns = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    return Table(columns, np.array([x - ns[0] for x in ns]) / 1e9, note)


@contextmanager
def _opened(path: str | Path) -> Iterator[BinaryIO]:
    """Open an MCAP file; turn every exception of mcap about a broken file into a PlanError."""
    with reading(path, PlanError, _REMEDY) as stream:
        if stream.read(len(_MAGIC)) != _MAGIC:
            raise PlanError(f"{path}: is not an MCAP file; {_REMEDY}")
        try:
            yield stream
        except PlanError:
            raise
        except Exception as error:  # raised by mcap, its decompressors, or struct
            reason = shorten(f"{type(error).__name__}: {error}", 160)
            raise PlanError(f"{path}: cannot be read as an MCAP log of ROS 2 ({reason}); {_REMEDY}") from None


def _reader(stream: BinaryIO, decoders: tuple[Any, ...] = ()) -> Any:
    stream.seek(0)
    module = needs_data("mcap.reader")
    return module.SeekingReader(stream, validate_crcs=True, decoder_factories=decoders, record_size_limit=_LARGEST)


def _topics(stream: BinaryIO) -> Iterator[tuple[str, str]]:
    """Yield topic and type of each channel, from the index of the log or, without an index, its messages."""
    reader = _reader(stream)
    summary = reader.get_summary()
    if summary is not None and summary.channels:
        pairs = [(channel, summary.schemas.get(channel.schema_id)) for channel in summary.channels.values()]
    else:
        pairs = [(channel, schema) for schema, channel, _ in reader.iter_messages(log_time_order=False)]
    yield from dict.fromkeys((channel.topic, schema.name if schema else "") for channel, schema in pairs)


def _decoded(stream: BinaryIO, topic: str) -> Iterator[tuple[int, Any]]:
    """Yield the log time of each message of a topic, in [ns], and the message."""
    decoder = needs_data("mcap_ros2.decoder").DecoderFactory()
    for _, _, message, decoded in _reader(stream, (decoder,)).iter_decoded_messages(topics=[topic]):
        yield message.log_time, decoded


def _topic(path: str | Path, types: dict[str, str], topic: str | None) -> str:
    """Return the requested topic or, by default, the only topic of joint states, from the types of all topics."""
    matches = [name for name, kind in types.items() if kind == _TYPE]
    if topic is not None:
        if topic not in matches:
            kind = f" is of {types[topic] or 'no type'}, not" if topic in types else ": there is no such topic of"
            raise PlanError(f"{path}: {shorten(topic)}{kind} {_TYPE}; {nearest(topic, matches)}")
        return topic
    if len(matches) == 1 or _TOPIC in matches:
        return _TOPIC if _TOPIC in matches else matches[0]
    if matches:
        raise PlanError(f"{path}: {len(matches)} topics are joint states; give topic= one of {', '.join(matches[:6])}")
    listed = ", ".join(f"{name} ({kind})" for name, kind in list(types.items())[:6]) or "none"
    raise PlanError(f"{path}: there is no topic of {_TYPE}; topics: {shorten(listed, 300)}")


def _of_joints(
    path: str | Path, topic: str, messages: list[tuple[int, Any]], wanted: set[str]
) -> tuple[dict[str, list[int]], list[dict[str, float]], str]:
    """Return times of headers and log in [ns], positions by joint, and a note on omitted names."""
    times: dict[str, list[int]] = {"header": [], "log": []}
    rows: list[dict[str, float]] = []
    omitted: dict[str, None] = {}
    for k, (log, message) in enumerate(messages):
        where = f"{path}: message {k + 1} of {topic}"
        try:
            names, position = [str(name) for name in message.name], [float(x) for x in message.position]
            header = int(message.header.stamp.sec) * 10**9 + int(message.header.stamp.nanosec)
        except (AttributeError, TypeError, ValueError) as error:
            raise PlanError(
                f"{where} lacks the header, names or positions of {_TYPE} ({shorten(str(error))}): the log defines"
                " another message of that name; record it again"
            ) from None
        omitted |= dict.fromkeys(name for name in names if name not in wanted)
        if not wanted & set(names):
            continue
        if len(position) != len(names) or len(set(names)) < len(names):
            counts = f"{len(position)} positions for {len(set(names))} different names"
            raise PlanError(f"{where} has {counts}; repair the log")
        row = {name: x for name, x in zip(names, position, strict=True) if name in wanted}
        if rows and row.keys().isdisjoint(rows[0]):
            here, before = (shorten(", ".join(one), 80) for one in (row, rows[0]))
            raise PlanError(
                f"{where} names {here}, the messages before it {before}: two publishers share the topic; read one by"
                " joints={joint: name} with q0= for the other joints, or record them on two topics"
            )
        if rows and row.keys() != rows[0].keys():
            odd = ", ".join(sorted(row.keys() ^ rows[0].keys()))
            raise PlanError(f"{where} has other joints than the messages before it: {odd}; split the log")
        rows.append(row)
        times["header"].append(header)
        times["log"].append(log)
    if len(rows) < 2:
        named = ", ".join(omitted) or "none"
        raise PlanError(
            f"{path}: {len(rows)} messages of {topic} name joints of the arm, at least 2 are needed; names:"
            f" {shorten(named, 200)}; give joints={{joint: name}}"
        )
    return times, rows, f"; without {shorten(', '.join(omitted), 120)}" if omitted else ""
