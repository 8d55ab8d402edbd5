"""MCAP logs: JSON and ROS 2 messages of all topics on one clock."""

import json
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ..._errors import InputError, require
from .csv import CsvTable
from .names import once
from .spread import spread

BASE = 1e-9  # s, of a log's clock


def read_mcap(path: Path) -> CsvTable:
    """Columns `topic.field` of a log: the busiest topic's times, the others held between theirs.

    Messages are JSON, or ROS 2 (CDR) if `mcap-ros2-support` is installed.  `t` is the log time
    since the first message.
    """
    reader = require("mcap.reader", "mcap", "reading `.mcap` files")
    topics: dict[str, list[tuple[int, dict[str, float]]]] = {}
    with path.open("rb") as file:
        made = reader.make_reader(file)
        for schema, channel, message in made.iter_messages():
            fields = _fields(path.name, schema, channel, message)
            if fields:
                topics.setdefault(channel.topic.strip("/"), []).append((message.log_time, fields))
    if not topics:
        raise InputError("holds no message with numbers.", path)
    clock = np.array([t for t, _ in max(topics.values(), key=len)], np.int64)
    clock = np.unique(clock)
    columns = {"t": (clock - clock[0]) * BASE}
    for topic, messages in topics.items():
        times = np.array([t for t, _ in messages], np.int64)
        order = np.argsort(times, kind="stable")
        at = np.searchsorted(times[order], clock, "right") - 1
        for key in dict.fromkeys(k for _, fields in messages for k in fields):
            values = np.array([fields.get(key, np.nan) for _, fields in messages])[order]
            columns[f"{topic}.{key}"] = np.where(at >= 0, values[np.maximum(at, 0)], np.nan)
    return spread(columns)


def _fields(file: str, schema: Any, channel: Any, message: Any) -> dict[str, float]:
    """Numbers of one message by dotted name; none of a message in another encoding."""
    if channel.message_encoding == "json":
        hook = partial(once, file)
        return _numbers(json.loads(message.data, object_pairs_hook=hook))
    if channel.message_encoding == "cdr" and schema is not None:
        support = require(
            "mcap_ros2.decoder", "mcap", "reading `.mcap` files of ROS 2", "mcap-ros2-support"
        )
        decode = support.DecoderFactory().decoder_for(channel.message_encoding, schema)
        return {} if decode is None else _numbers(decode(message.data))
    return {}


def _numbers(node: Any, before: str = "") -> dict[str, float]:
    if isinstance(node, bool | int | float):
        return {before or "value": float(node)}
    if isinstance(node, dict):
        parts = node.items()
    elif isinstance(node, list | tuple):
        parts = enumerate(node)
    elif hasattr(node, "__slots__"):  # a decoded ROS message
        parts = [(k, getattr(node, k)) for k in node.__slots__ if hasattr(node, k)]
    else:
        return {}
    out: dict[str, float] = {}
    for key, value in parts:
        out |= _numbers(value, f"{before}.{key}" if before else str(key))
    return out
