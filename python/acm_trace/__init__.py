"""Traces of ACM as tables and images.

A trace is an MCAP file, described in docs/trace.md. Everything here is read once, when a `Trace` is opened; times are
virtual, in nanoseconds as `t` and in seconds as `seconds`.
"""

import io
import json
import re
import struct
from dataclasses import dataclass, field
from typing import Any, Dict, List, Optional

from mcap.exceptions import McapError
from mcap.reader import NonSeekingReader
from mcap_protobuf.decoder import DecoderFactory

__all__ = ["Frame", "Step", "Trace"]

PROFILE = "acm"


@dataclass
class Frame:
    """A frame that a camera gave: what `/effect/frame` says of it, and the pixels that the trace keeps."""

    about: Dict[str, Any]
    _color: Any = None
    _depth: Any = None
    thumbnail_png: Optional[bytes] = None
    intrinsics: Optional[List[float]] = None
    """Nominal 3x3 calibration matrix, row by row, pixels."""

    @property
    def id(self) -> str:
        return self.about["frame"]

    @property
    def color(self):
        """(height, width, 3) uint8, sRGB; an error if the trace keeps no full frames."""
        return self._plane(self._color, "uint8", (3,))

    @property
    def depth(self):
        """(height, width) float32, metres along the optical axis; 0 where nothing was measured."""
        return self._plane(self._depth, "<f4", ())

    def _plane(self, image, kind, shape):
        if image is None:
            raise ValueError(f"the trace keeps no pixels of {self.id}: record with --trace-frames full")
        import numpy

        return numpy.frombuffer(image.data, dtype=kind).reshape((image.height, image.width) + shape)

    def picture(self):
        """A Pillow image: all pixels, else the thumbnail."""
        from PIL import Image

        if self._color is not None:
            return Image.fromarray(self.color)
        if self.thumbnail_png is None:
            raise ValueError(f"the trace keeps nothing of {self.id} but its hash")
        return Image.open(io.BytesIO(self.thumbnail_png))


def _topic_name(camera: str) -> str:
    """A camera's name as it stands in topics."""
    return re.sub(r"[^A-Za-z0-9_-]", "_", camera[:64])


@dataclass
class Step:
    """A skill that was run: the decision, and the messages from it up to the next one."""

    number: int
    seq: int
    decision: Dict[str, Any]
    messages: List[Dict[str, Any]] = field(default_factory=list)

    @property
    def reason(self) -> str:
        """The goal that the step serves, and the part of the instruction that asked for it."""
        explanation = self.decision.get("explanation", {})
        return f"{explanation.get('goal')}, asked for by \"{explanation.get('subtask')}\""

    def body(self, kind: str) -> Optional[Any]:
        """The body of the last message of a kind in this step, such as `skill-ended` or `verdict`."""
        return next((m["body"] for m in reversed(self.messages) if m["kind"] == kind), None)


class Trace:
    """A run, read from a file."""

    def __init__(self, path):
        self.about: Dict[str, str] = {}
        self.result: Dict[str, str] = {}
        self.attachments: Dict[str, bytes] = {}
        self.messages: List[Dict[str, Any]] = []
        self.changes: List[Dict[str, Any]] = []
        self.keyframes: List[Dict[str, Any]] = []
        """All that memory believed, at several moments."""
        self.states: List[Dict[str, Any]] = []
        """What actors kept between messages, wherever it changed."""
        self.lines: Dict[int, str] = {}
        self.frames: Dict[str, Frame] = {}
        self.cut: Optional[str] = None
        """Why the file ends too early, if it does."""
        self._asked: Dict[Any, Frame] = {}
        with open(path, "rb") as file:
            self._read(file, path)
        # Messages of one moment have their numbers to say which came first.
        self.messages.sort(key=lambda message: message["seq"])
        for message in self.messages:
            message["seconds"] = message["t"] * 1e-9
            message["line"] = self.lines.get(message["seq"], "")

    def _read(self, file, path):
        reader = NonSeekingReader(file, decoder_factories=[DecoderFactory()])
        header = reader.get_header()
        if header.profile != PROFILE:
            raise ValueError(f"{path} is an MCAP file of another program (`{header.profile or header.library}`)")
        # One pass for each kind: a reader that cannot seek goes through the file once.
        passes = [self._messages, self._metadata, self._attachments]
        for read in passes:
            file.seek(0)
            reader = NonSeekingReader(file, decoder_factories=[DecoderFactory()])
            try:
                read(reader)
            # The library reads a record that is cut in its middle with `struct`, which has an error of its own.
            except (McapError, EOFError, struct.error) as error:
                self.cut = str(error) or type(error).__name__

    def _messages(self, reader):
        decoder, decoders = DecoderFactory(), {}
        for schema, channel, message in reader.iter_messages(log_time_order=False):
            if channel.message_encoding == "json":
                self._json(schema.name, channel.topic, json.loads(message.data))
                continue
            if channel.id not in decoders:
                decoders[channel.id] = decoder.decoder_for(channel.message_encoding, schema)
            self._viewer(channel.topic, message.sequence, decoders[channel.id](message.data))

    def _json(self, schema, topic, record):
        if schema == "acm.Message":
            self.messages.append(record)
        elif schema == "acm.MemoryDelta":
            self.changes.append(record)
        elif schema == "acm.MemoryKeyframe":
            self.keyframes.append(record)
        elif schema == "acm.ActorState":
            self.states.append(record)
        elif topic == "/effect/frame":
            frame = Frame(record)
            self.frames[frame.id] = frame
            self._asked[(_topic_name(record["camera"]), record["seq"])] = frame

    def _viewer(self, topic, sequence, decoded):
        if topic == "/log":
            self.lines[decoded.line] = decoded.message
            return
        parts = topic.split("/")
        if len(parts) != 4 or parts[1] != "camera":
            return
        frame = self._asked.get((parts[2], sequence))
        if frame is None:
            return
        if parts[3] == "color":
            frame._color = decoded
        elif parts[3] == "depth":
            frame._depth = decoded
        elif parts[3] == "thumbnail":
            frame.thumbnail_png = decoded.data
        elif parts[3] == "calibration":
            frame.intrinsics = list(decoded.K)

    def _metadata(self, reader):
        for metadata in reader.iter_metadata():
            if metadata.name == "acm.run":
                self.about = dict(metadata.metadata)
            elif metadata.name == "acm.result":
                self.result = dict(metadata.metadata)

    def _attachments(self, reader):
        for attachment in reader.iter_attachments():
            self.attachments[attachment.name] = attachment.data

    @property
    def steps(self) -> List[Step]:
        """The skills that were run, in order."""
        steps: List[Step] = []
        for message in self.messages:
            body = message["body"]
            decision = body.get("decision") if message["kind"] == "decided" and isinstance(body, dict) else None
            if isinstance(decision, dict) and "act" in decision:
                steps.append(Step(len(steps) + 1, message["seq"], decision["act"]))
            if steps:
                steps[-1].messages.append(message)
        return steps

    @property
    def calls(self) -> List[Dict[str, Any]]:
        """The questions to a language model, each with its answer; None for one that never came."""
        answers = {m["cause"]: m["body"] for m in self.messages if m["kind"] == "llm-replied"}
        asked = (m for m in self.messages if m["kind"] == "ask-llm")
        return [{"seq": m["seq"], "request": m["body"]["request"], "answer": answers.get(m["seq"])} for m in asked]

    def believed(self, seq: int) -> Dict[str, Dict[str, Any]]:
        """What memory believed of each object just before a message: a keyframe, and what changed since."""
        before = [keyframe for keyframe in self.keyframes if keyframe["seq"] < seq]
        objects = dict(before[-1]["objects"]) if before else {}
        since = before[-1]["event"] if before else 0
        for change in self.changes:
            if since < change["event"] and change["seq"] < seq:
                if change["change"] == "object":
                    objects[change["object"]] = change["after"]
                elif change["change"] == "wiped":
                    objects.clear()
        return objects

    def changes_of(self, object_id: str) -> List[Dict[str, Any]]:
        """What memory came to believe of an object such as `O3`, in order."""
        return [change for change in self.changes if change["object"] == object_id]

    @staticmethod
    def table(rows):
        """Rows as a pandas table; nested values stay as they are."""
        import pandas

        return pandas.DataFrame(rows)
