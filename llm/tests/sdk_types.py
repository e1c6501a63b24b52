"""Whether the official clients' types of requests take our bodies: python sdk_types.py FOLDER

Each file of FOLDER is WIRE.NAME.json with a `body` as it goes out. Prints how many were checked and what does not fit, one
sentence each; also where a body that is wrong on purpose is taken, for then the types say nothing.
"""

import copy
import json
import pathlib
import sys
import typing
import warnings

warnings.simplefilter("ignore")
from anthropic.types.message_create_params import MessageCreateParamsNonStreaming, MessageCreateParamsStreaming
from google.genai import types as gemini
from ollama._types import ChatRequest
from openai.types.chat.completion_create_params import (
    CompletionCreateParamsNonStreaming,
    CompletionCreateParamsStreaming,
)
from openai.types.responses.response_create_params import ResponseCreateParamsNonStreaming, ResponseCreateParamsStreaming
from pydantic import TypeAdapter, ValidationError

DICTS = {
    "openai-chat": (CompletionCreateParamsNonStreaming, CompletionCreateParamsStreaming),
    "openai-responses": (ResponseCreateParamsNonStreaming, ResponseCreateParamsStreaming),
    "anthropic": (MessageCreateParamsNonStreaming, MessageCreateParamsStreaming),
}
GEMINI_FIELDS = ("contents", "systemInstruction", "generationConfig", "tools", "toolConfig")


def camel(name):
    first, *rest = name.split("_")
    return first + "".join(word.capitalize() for word in rest)


def unknown(value, known, kind):
    """Fields that a type does not have: it would let them pass."""
    return [f"`{name}` is no field of {kind.__name__}" for name in value if name not in known]


def of_dict(kind, value):
    TypeAdapter(kind).validate_python(value)
    return unknown(value, typing.get_type_hints(kind), kind)


def of_model(kind, value, case=lambda name: name):
    kind.model_validate(value)
    return unknown(value, {case(name) for name in kind.model_fields}, kind)


def of_gemini(body):
    parts = [(gemini.Content, content) for content in body["contents"]]
    parts += [(gemini.Content, body["systemInstruction"]), (gemini.GenerationConfig, body["generationConfig"])]
    parts += [(gemini.Tool, tool) for tool in body.get("tools", [])]
    parts += [(gemini.ToolConfig, body["toolConfig"])] if "toolConfig" in body else []
    odd = [f"`{name}` is no field of a request" for name in body if name not in GEMINI_FIELDS]
    return odd + [fault for kind, value in parts for fault in of_model(kind, value, camel)]


def faults(wire, body):
    try:
        if wire in DICTS:
            return of_dict(DICTS[wire][bool(body.get("stream"))], body)
        return of_gemini(body) if wire == "gemini" else of_model(ChatRequest, body)
    except ValidationError as error:
        first = error.errors()[0]
        return [f"{'.'.join(map(str, first['loc']))}: {first['msg']}"]
    except TypeError as error:
        return [str(error)]


def spoiled(wire, body):
    """Bodies that are wrong on purpose."""
    misspelt = copy.deepcopy(body)
    misspelt["max_token"] = 5
    yield "a misspelt field", misspelt
    turns = copy.deepcopy(body)
    turns[{"gemini": "contents", "openai-responses": "input"}.get(wire, "messages")] = 7
    yield "a number in the place of turns", turns


def main(folder):
    told, checked = [], 0
    for path in sorted(pathlib.Path(folder).glob("*.json")):
        wire, name, _ = path.name.split(".")
        body = json.loads(path.read_text())["body"]
        checked += 1
        told += [f"{wire}, {name}: {fault}" for fault in faults(wire, body)]
        taken = [what for what, wrong in spoiled(wire, body) if not faults(wire, wrong)]
        told += [f"{wire}, {name}: {what} is taken, so the types say nothing" for what in taken]
    print(json.dumps({"checked": checked, "faults": told}))


main(sys.argv[1])
