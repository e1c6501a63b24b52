"""Reads a trace with the MCAP libraries from PyPI and prints what it found as JSON.

Shows how little it takes to look into a trace from Python, and lets a test compare that with what ACM itself reads.
"""

import json
import pathlib
import struct
import sys

from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

sys.path.insert(0, str(pathlib.Path(__file__).parent.parent / "python"))
from acm_trace import Trace  # noqa: E402


def png_size(data):
    """Width and height from the header of a PNG."""
    assert data[:8] == b"\x89PNG\r\n\x1a\n", "no PNG"
    return list(struct.unpack(">II", data[16:24]))


def read(path):
    """Everything that the test compares."""
    with open(path, "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        found = {"messages": [], "frames": [], "thumbnails": [], "lines": 0}
        for schema, channel, message in reader.iter_messages():
            if schema.name == "acm.Message":
                record = json.loads(message.data)
                missing = set(json.loads(schema.data)["required"]) - set(record)
                assert not missing, f"a record without {missing}"
                assert message.log_time == record["t"] and channel.topic == f"/{record['to']}/{record['kind']}"
                found["messages"].append(record)
            elif channel.topic == "/effect/frame":
                found["frames"].append(json.loads(message.data)["frame"])
        viewers = [c.topic for c in reader.get_summary().channels.values() if c.message_encoding == "protobuf"]
        for _, channel, _, decoded in reader.iter_decoded_messages(topics=viewers):
            if channel.topic == "/log":
                found["lines"] += 1
                assert decoded.message and decoded.line
            elif channel.topic.endswith("/thumbnail"):
                found["thumbnails"].append(png_size(decoded.data))
            elif channel.topic.endswith("/calibration"):
                assert len(decoded.K) == 9 and decoded.K[0] > 0
        # By time messages of one moment may come in any order; their numbers say which came first.
        found["messages"].sort(key=lambda record: record["seq"])
        found["run"] = next(m.metadata for m in reader.iter_metadata() if m.name == "acm.run")
        found["attachments"] = sorted(attachment.name for attachment in reader.iter_attachments())
        return found


def compare(path, found):
    """Holds our own small reader against what was found without it."""
    run = Trace(path)
    assert run.cut is None and run.about == found["run"] and sorted(run.attachments) == found["attachments"]
    headers = [{name: message[name] for name in record} for message, record in zip(run.messages, found["messages"])]
    assert headers == found["messages"] and all(message["line"] for message in run.messages)
    assert list(run.frames) == found["frames"] and len(run.lines) == found["lines"]
    assert [png_size(frame.thumbnail_png) for frame in run.frames.values()] == found["thumbnails"]
    assert run.steps and run.steps[0].body("verdict") and "asked for by" in run.steps[0].reason
    changed = next(change["object"] for change in run.changes if change["change"] == "object")
    assert run.changes_of(changed)
    # Adding the changes up from any keyframe leads to the next one.
    for keyframe in run.keyframes[1:]:
        assert run.believed(keyframe["seq"] + 1) == keyframe["objects"]
        without = [other for other in run.keyframes if other["seq"] < keyframe["seq"]]
        every, run.keyframes = run.keyframes, without
        assert run.believed(keyframe["seq"] + 1) == keyframe["objects"]
        run.keyframes = every
    assert {state["actor"] for state in run.states} == {"episode", "executor", "perception"} and run.calls == []
    try:
        next(iter(run.frames.values())).color
    except ValueError as error:
        assert "--trace-frames full" in str(error)
    else:
        raise AssertionError("pixels that the trace does not keep")


def cut(path):
    """A file that ends early is read as far as it goes."""
    half = pathlib.Path(path).with_suffix(".half")
    data = pathlib.Path(path).read_bytes()
    half.write_bytes(data[: len(data) // 2])
    try:
        run = Trace(half)
        assert run.cut and 0 < len(run.messages) and run.about
    finally:
        half.unlink()


if __name__ == "__main__":
    everything = read(sys.argv[1])
    compare(sys.argv[1], everything)
    cut(sys.argv[1])
    json.dump(everything, sys.stdout)
