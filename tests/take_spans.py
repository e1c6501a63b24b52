"""A collector for one post: reads spans with OpenTelemetry's own message types and prints them as JSON.

Prints the port on which it listens first. With the name of a file it reads that instead.
"""

import base64
import http.server
import json
import sys

from google.protobuf import json_format
from opentelemetry.proto.collector.trace.v1.trace_service_pb2 import ExportTraceServiceRequest, ExportTraceServiceResponse
from opentelemetry.proto.trace.v1.trace_pb2 import Span, Status


def identifier(data, length):
    """The encoding writes ids in hexadecimal digits, where protobuf's own JSON takes base 64: back to the digits."""
    digits = base64.b64encode(data).decode()
    assert len(digits) == length and int(digits, 16), digits
    return digits


def value(any_value):
    kind = any_value.WhichOneof("value")
    if kind == "array_value":
        return [value(each) for each in any_value.array_value.values]
    return getattr(any_value, kind)


def attributes(pairs):
    found = {pair.key: value(pair.value) for pair in pairs}
    assert len(found) == len(pairs), "an attribute twice"
    return found


def read(text):
    """All spans of a request. A field that the protocol does not have is an error."""
    request = json_format.Parse(text, ExportTraceServiceRequest())
    (resource,) = request.resource_spans
    (scope,) = resource.scope_spans
    spans = []
    for span in scope.spans:
        identifier(span.trace_id, 32)
        assert span.end_time_unix_nano >= span.start_time_unix_nano > 10**18
        spans.append(
            {
                "id": identifier(span.span_id, 16),
                "parent": identifier(span.parent_span_id, 16) if span.parent_span_id else None,
                "links": [identifier(link.span_id, 16) for link in span.links],
                "name": span.name,
                "kind": Span.SpanKind.Name(span.kind),
                "start": span.start_time_unix_nano,
                "end": span.end_time_unix_nano,
                "status": Status.StatusCode.Name(span.status.code),
                "attributes": attributes(span.attributes),
            }
        )
    return {"resource": attributes(resource.resource.attributes), "spans": spans}


class Collector(http.server.BaseHTTPRequestHandler):
    def do_POST(self):
        assert self.path == "/v1/traces" and self.headers["content-type"] == "application/json"
        found = read(self.rfile.read(int(self.headers["content-length"])))
        answer = json_format.MessageToJson(ExportTraceServiceResponse()).encode()
        self.send_response(200)
        self.send_header("content-type", "application/json")
        self.send_header("content-length", str(len(answer)))
        self.end_headers()
        self.wfile.write(answer)
        json.dump(found, sys.stdout)

    def log_message(self, *_):
        pass


if __name__ == "__main__":
    if sys.argv[1:]:
        with open(sys.argv[1], encoding="utf-8") as file:
            json.dump(read(file.read()), sys.stdout)
    else:
        with http.server.HTTPServer(("127.0.0.1", 0), Collector) as server:
            server.timeout = 60
            print(server.server_port, flush=True)
            server.handle_request()
