"""Logs of ROS 2: messages sensor_msgs/msg/JointState of an MCAP file, as columns by the names of joints.

Each message names its joints, in an order of its own. Times are those of the headers, at which the joints were
measured, or those at which the log got the messages; they are counted from the first message, in whole nanoseconds, so
that nothing of them is lost.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np

from robot_dyn.foundations.errors import PlanError, nearest, shorten, shown
from robot_dyn.foundations.extras import needs
from robot_dyn.foundations.files import reading

SUFFIX, TIMES = ".mcap", ("header", "log")
_TYPE, _TOPIC = "sensor_msgs/msg/JointState", "/joint_states"
_REMEDY = "give an MCAP log of ROS 2 messages"
_MAGIC = b"\x89MCAP0\r\n"
_LARGEST = 2**30  # bytes of a record
needs_data = partial(needs, extra="data")


class JointStates(NamedTuple):
    """Positions by name of joint, each (m,), with times in [s] from the first message, and where they are from."""

    t: np.ndarray
    columns: dict[str, np.ndarray]
    note: str


class _Message(NamedTuple):
    log: int  # its time, in [ns]
    header: int  # likewise
    position: dict[str, float]


def read_joint_states(path: str | Path, joint_names: tuple[str, ...], topic: str | None, time: Any) -> JointStates:
    """The joint states of a topic of an MCAP log.

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
    with reading(path, PlanError, _REMEDY) as stream:
        if stream.read(len(_MAGIC)) != _MAGIC:
            raise PlanError(f"{path}: is not an MCAP file; {_REMEDY}")
        topic = _topic(path, _guarded(path, _topics(stream)), topic)
        messages, others = _of_joints(path, topic, list(_guarded(path, _decoded(stream, topic))), set(joint_names))
    of_header = time == "header" or (time is None and any(each.header for each in messages))
    ns = [each.header if of_header else each.log for each in messages]
    where = "headers" if of_header else "the log" if time else "the log, as the headers have none"
    note = f"topic {topic}, times of {where}, from {ns[0] // 10**9}.{ns[0] % 10**9:09d} s" + others
    columns = {name: np.array([each.position[name] for each in messages]) for name in messages[0].position}
    return JointStates(np.array([each - ns[0] for each in ns]) / 1e9, columns, note)


def _guarded(path: str | Path, items: Iterator[Any]) -> Iterator[Any]:
    """What an iterator yields; whatever mcap raises of a broken file becomes a PlanError."""
    while True:
        try:
            yield next(items)
        except StopIteration:
            return
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


def _topic(path: str | Path, found: Iterator[tuple[str, str]], topic: str | None) -> str:
    """The topic that was asked for, or the only one of joint states."""
    types = dict(found)
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
    path: str | Path, topic: str, found: list[tuple[int, Any]], wanted: set[str]
) -> tuple[list[_Message], str]:
    """The messages that name joints of the arm, each with the same ones; and what is left out, for the note."""
    kept: list[_Message] = []
    left_out: dict[str, None] = {}
    for k, (log, message) in enumerate(found):
        where = f"{path}: message {k + 1} of {topic}"
        try:
            names, position = [str(each) for each in message.name], [float(each) for each in message.position]
            header = int(message.header.stamp.sec) * 10**9 + int(message.header.stamp.nanosec)
        except (AttributeError, TypeError, ValueError) as error:
            raise PlanError(
                f"{where} has not the header, names and positions of {_TYPE} ({shorten(str(error))}); the log"
                " defines another message by that name: write it again"
            ) from None
        if not wanted & set(names):
            left_out |= dict.fromkeys(names)
            continue
        if len(position) != len(names) or len(set(names)) < len(names):
            raise PlanError(f"{where} has {len(position)} positions for {len(set(names))} different names")
        here = {name: x for name, x in zip(names, position, strict=True) if name in wanted}
        if kept and here.keys() != kept[0].position.keys():
            odd = sorted(here.keys() ^ kept[0].position.keys())
            raise PlanError(f"{where} has not the joints of the ones before it: {', '.join(odd)}; split the log")
        left_out |= dict.fromkeys(name for name in names if name not in wanted)
        kept.append(_Message(log, header, here))
    if len(kept) < 2:
        named = ", ".join(left_out) or "none"
        raise PlanError(
            f"{path}: {len(kept)} messages of {topic} name joints of the arm, 2 are the least; names:"
            f" {shorten(named, 200)}; give joints={{joint: name}}"
        )
    return kept, f"; without {shorten(', '.join(left_out), 120)}" if left_out else ""
