"""Any OpenAI-compatible endpoint, spoken to over a real socket: what is sent, what is understood, what is an error."""

from __future__ import annotations

import base64
import json
import socket
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from gap_hf.language import chat, vlm
from gap_runtime.contracts.failures import BadRequestError, CancelledError, PerceptionError, ToolError
from gap_runtime.contracts.types import Image
from tests.unit.hf import tiny

IMAGE = Image(tiny.picture(30, 40))


def said(content):
    return 200, {"choices": [{"message": {"role": "assistant", "content": content}}]}


class Endpoint(ThreadingHTTPServer):
    """Answers from a list of (status, body[, headers]), the last one again and again; keeps what it was asked."""

    daemon_threads = True

    def __init__(self, answers):
        self.answers, self.asked = list(answers), []
        super().__init__(("127.0.0.1", 0), Handler)


class Handler(BaseHTTPRequestHandler):
    def do_POST(self):
        body = self.rfile.read(int(self.headers["content-length"]))
        self.server.asked.append((self.path, dict(self.headers), json.loads(body)))
        answers = self.server.answers
        status, body, *headers = answers.pop(0) if len(answers) > 1 else answers[0]
        if status is None:
            self.server.stalled.wait(10)
            return
        raw = body if isinstance(body, bytes) else json.dumps(body).encode()
        self.send_response(status)
        for name, value in (headers[0] if headers else {}).items():
            self.send_header(name, value)
        self.send_header("content-length", str(len(raw)))
        self.end_headers()
        self.wfile.write(raw)

    def log_message(self, *_):
        pass


@pytest.fixture
def endpoint(monkeypatch):
    """Start an endpoint with these answers and name it in the environment."""
    servers = []
    monkeypatch.setattr(chat, "BACKOFF_S", 0.01)
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")

    def start(*answers):
        server = Endpoint(answers)
        server.stalled = threading.Event()
        threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True).start()
        servers.append(server)
        monkeypatch.setenv(chat.URL, f"http://127.0.0.1:{server.server_port}/v1/")
        monkeypatch.setenv(chat.MODEL, "some/model")
        return server

    yield start
    for server in servers:
        server.stalled.set()
        server.shutdown()
        server.server_close()


def ask(ctx, prompt="What is it?", image=IMAGE):
    return vlm.vlm_query(ctx, prompt=prompt, image=image).text


def test_the_question_and_every_pixel_arrive(endpoint, ctx, monkeypatch):
    monkeypatch.setenv(chat.KEY, "secret")
    server = endpoint(said(" a red can\n"))
    assert ask(ctx) == "a red can"
    ((path, headers, body),) = server.asked
    assert path == "/v1/chat/completions"
    assert {k.lower(): v for k, v in headers.items()}["authorization"] == "Bearer secret"
    assert (body["model"], body["temperature"]) == ("some/model", 0)
    text, picture = body["messages"][0]["content"]
    assert text == {"type": "text", "text": "What is it?"}
    kind, _, data = picture["image_url"]["url"].partition(",")
    assert kind == "data:image/png;base64"
    pixels = cv2.imdecode(np.frombuffer(base64.b64decode(data), np.uint8), cv2.IMREAD_COLOR)[..., ::-1]
    assert np.array_equal(pixels, IMAGE.data)


def test_without_a_key_none_is_sent(endpoint, ctx):
    server = endpoint(said("yes"))
    ask(ctx)
    assert "authorization" not in {k.lower() for k in server.asked[0][1]}


def test_options_are_merged_and_null_removes(endpoint, ctx, monkeypatch):
    monkeypatch.setenv(chat.OPTIONS, '{"temperature": null, "max_completion_tokens": 9}')
    server = endpoint(said("yes"))
    ask(ctx)
    body = server.asked[0][2]
    assert "temperature" not in body and body["max_completion_tokens"] == 9


@pytest.mark.parametrize(("text", "want"), [("Yes", True), ("No, there is none.", False)])
def test_yes_and_no(endpoint, ctx, text, want):
    server = endpoint(said(text))
    assert vlm.vlm_query_yes_no(ctx, prompt="Is it?", image=IMAGE).answer is want
    assert server.asked[0][2]["messages"][0]["content"][0]["text"] == "Is it? Answer with yes or no only."


def test_an_answer_in_parts_is_joined(endpoint, ctx):
    endpoint(said([{"type": "text", "text": "a "}, {"type": "text", "text": "can"}]))
    assert ask(ctx) == "a can"


def test_neither_yes_nor_no(endpoint, ctx):
    endpoint(said("Perhaps."))
    with pytest.raises(PerceptionError, match="neither yes nor no"):
        vlm.vlm_query_yes_no(ctx, prompt="Is it?", image=IMAGE)


@pytest.mark.parametrize("status", [429, 500, 503])
def test_a_busy_endpoint_is_asked_again(endpoint, ctx, status):
    server = endpoint((status, {"error": {"message": "busy"}}), (status, b"", {"retry-after": "0"}), said("a can"))
    assert ask(ctx) == "a can"
    assert len(server.asked) == 3


def test_but_not_for_ever(endpoint, ctx):
    server = endpoint((429, {"error": {"message": "quota\nexhausted"}}))
    with pytest.raises(ToolError, match="refused with 429: quota exhausted") as caught:
        ask(ctx)
    assert caught.value.code == "http" and caught.value.detail["status"] == 429
    assert len(server.asked) == chat.TRIES


@pytest.mark.parametrize(("status", "hint"), [(400, ""), (401, chat.KEY), (404, chat.MODEL)])
def test_a_refusal_is_final(endpoint, ctx, monkeypatch, status, hint):
    monkeypatch.setenv(chat.KEY, "secret")
    server = endpoint((status, {"error": {"message": "not like this"}}))
    with pytest.raises(ToolError, match="not like this") as caught:
        ask(ctx)
    assert caught.value.code == "http" and hint in caught.value.hint
    assert len(server.asked) == 1
    assert "secret" not in str(caught.value)


@pytest.mark.parametrize(
    "body", [b"<html>", b"[]", {}, {"choices": []}, {"choices": [{"message": {"content": None}}]}, said("  ")[1]]
)
def test_what_is_no_completion_is_an_error(endpoint, ctx, body):
    endpoint((200, body))
    with pytest.raises(ToolError, match="no chat completion") as caught:
        ask(ctx)
    assert caught.value.code == "answer"


def test_an_endpoint_that_does_not_answer(endpoint, ctx, monkeypatch):
    monkeypatch.setattr(chat, "BUDGET_S", 1.0)
    endpoint((None, b""))
    with pytest.raises(ToolError, match="did not answer within 1 s") as caught:
        ask(ctx)
    assert caught.value.code == "timeout"


def test_nobody_there(monkeypatch, ctx):
    with socket.socket() as held:
        held.bind(("127.0.0.1", 0))  # bound and not listening: connections are refused
        monkeypatch.setenv(chat.URL, f"http://127.0.0.1:{held.getsockname()[1]}/v1")
        monkeypatch.setenv(chat.MODEL, "m")
        monkeypatch.setenv("NO_PROXY", "127.0.0.1")
        with pytest.raises(ToolError, match="cannot be reached") as caught:
            ask(ctx)
    assert caught.value.code == "unreachable"


def test_a_cancelled_node_does_not_wait_for_the_next_try(endpoint):
    server = endpoint((429, b"", {"retry-after": "10"}))
    calls = []

    def cancelled():
        calls.append(len(server.asked))
        if server.asked:
            raise CancelledError("stop")

    with pytest.raises(CancelledError):
        ask(SimpleNamespace(state={}, raise_if_cancelled=cancelled))
    assert calls[0] == 0


@pytest.mark.parametrize("settings", [{}, {chat.URL: "localhost:8000", chat.MODEL: "m"}, {chat.URL: "http://x"}])
def test_settings_that_name_no_endpoint(monkeypatch, ctx, settings):
    for name, value in settings.items():
        monkeypatch.setenv(name, value)
    with pytest.raises(ToolError, match="must name an OpenAI-compatible endpoint") as caught:
        ask(ctx)
    assert caught.value.code == "setting"


@pytest.mark.parametrize("text", ["[]", "{", "7"])
def test_options_that_are_no_object(endpoint, ctx, monkeypatch, text):
    endpoint(said("yes"))
    monkeypatch.setenv(chat.OPTIONS, text)
    with pytest.raises(ToolError, match="not a JSON object"):
        ask(ctx)


def test_questions_it_will_not_ask(ctx):
    with pytest.raises(BadRequestError, match="characters"):
        ask(ctx, prompt=" ")
    with pytest.raises(BadRequestError, match="no image"):
        ask(ctx, image=None)
    with pytest.raises(BadRequestError, match="no pixels"):
        ask(ctx, image=Image(np.zeros((0, 3, 3), np.uint8)))
