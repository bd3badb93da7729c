"""Asks any OpenAI-compatible endpoint (`POST <base>/chat/completions`) about an image."""

from __future__ import annotations

import base64
import json
import os
import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from gap_hf.loading import INSTALL
from gap_runtime.contracts.failures import ToolError
from gap_runtime.contracts.tool import ToolContext
from gap_runtime.contracts.types import Image

URL, MODEL, KEY, OPTIONS = "GAP_HF_VLM_URL", "GAP_HF_VLM_MODEL", "GAP_HF_VLM_KEY", "GAP_HF_VLM_OPTIONS"
TRIES = 4
TRY_AGAIN = frozenset({429, 500, 502, 503, 504})
BACKOFF_S = 0.5  # doubled after each try
LONGEST_WAIT_S = 10.0  # whatever Retry-After asks
TIMEOUT_S = 60.0  # of one try
BUDGET_S = 150.0  # of all tries together


@dataclass(frozen=True)
class Endpoint:
    """Where to ask whom: base URL, model name, bearer key (may be empty), and what is merged into each request."""

    url: str
    model: str
    key: str = field(default="", repr=False)
    options: dict[str, Any] = field(default_factory=dict)


def endpoint() -> Endpoint:
    """The endpoint of the environment. Raises `ToolError` (`setting`) for what is missing or malformed."""
    url, model = os.environ.get(URL, "").strip().rstrip("/"), os.environ.get(MODEL, "").strip()
    if not url.startswith(("http://", "https://")) or not model:
        raise ToolError(
            "setting",
            f"{URL} and {MODEL} must name an OpenAI-compatible endpoint and a model that reads images.",
            hint=f"E.g. {URL}=http://localhost:8000/v1 {MODEL}=Qwen/Qwen3-VL-8B-Instruct; {KEY} if it wants a key.",
        )
    try:
        options = json.loads(os.environ.get(OPTIONS, "") or "{}")
    except ValueError:
        options = None
    if not isinstance(options, dict):
        raise ToolError(
            "setting", f"{OPTIONS} is not a JSON object.", hint="E.g. '{\"max_tokens\": 512}'; null removes."
        )
    return Endpoint(url, model, os.environ.get(KEY, ""), options)


def request(where: Endpoint, prompt: str, image: Image) -> dict[str, Any]:
    """The body of one request: a user turn of text and image, decoded greedily unless the options say otherwise."""
    content = [{"type": "text", "text": prompt}, {"type": "image_url", "image_url": {"url": data_url(image)}}]
    body = {
        "model": where.model,
        "messages": [{"role": "user", "content": content}],
        "temperature": 0,
        **where.options,
    }
    return {name: value for name, value in body.items() if value is not None}


def data_url(image: Image) -> str:
    """The image as a PNG data URL: lossless, so that boxes in the prompt mean its own pixels."""
    import cv2

    done, png = cv2.imencode(".png", np.ascontiguousarray(image.data[..., ::-1]))
    if not done:
        raise ToolError("image", "The image could not be encoded as PNG.")
    return "data:image/png;base64," + base64.b64encode(png.tobytes()).decode("ascii")


def ask(ctx: ToolContext, prompt: str, image: Image) -> str:
    """The endpoint's answer. Tries again on 429 and 5xx, a few times within a time limit.

    Raises `ToolError`: `extra`, `setting`, `unreachable` (no connection), `timeout`, `http` (refused, or still failing
    after the last try), `answer` (not what a chat completion looks like); `CancelledError`.
    """
    try:
        import httpx2 as httpx
    except ImportError:
        raise ToolError("extra", "httpx2 is not installed.", hint=INSTALL) from None
    where = endpoint()
    body = request(where, prompt, image)
    headers = {"Authorization": f"Bearer {where.key}"} if where.key else {}
    end = time.monotonic() + BUDGET_S
    with httpx.Client(headers=headers) as client:
        for left in reversed(range(TRIES)):
            ctx.raise_if_cancelled()
            limit = max(1.0, min(TIMEOUT_S, end - time.monotonic()))
            try:
                response = client.post(f"{where.url}/chat/completions", json=body, timeout=limit)
            except httpx.TimeoutException:
                raise ToolError("timeout", f"{where.url} did not answer within {limit:.0f} s.") from None
            except (httpx.HTTPError, httpx.InvalidURL) as problem:
                raise ToolError(
                    "unreachable", f"{where.url} cannot be reached: {problem}.", hint=f"Is {URL} right?"
                ) from None
            if response.status_code == 200:
                return _text(where, response)
            wait = _wait(response, TRIES - 1 - left)
            if response.status_code not in TRY_AGAIN or not left or time.monotonic() + wait > end:
                raise _refused(where, response)
            _sleep(ctx, wait)
    raise AssertionError("unreachable")


def _text(where: Endpoint, response: Any) -> str:
    try:
        content = response.json()["choices"][0]["message"]["content"]
        if isinstance(content, list):  # some servers answer in parts
            content = "".join(part["text"] for part in content if part.get("type") == "text")
    except (ValueError, KeyError, IndexError, TypeError, AttributeError):
        content = None
    if not isinstance(content, str) or not content.strip():
        raise ToolError(
            "answer", f"{where.url} answered with something that is no chat completion.",
            detail={"body": response.text[:300]},
        )  # fmt: skip
    return content.strip()


def _refused(where: Endpoint, response: Any) -> ToolError:
    try:
        said = str(response.json()["error"]["message"])
    except (ValueError, KeyError, TypeError):
        said = response.text
    hint = {401: f"Is {KEY} right?", 403: f"Is {KEY} right?", 404: f"Are {URL} and {MODEL} right?"}
    return ToolError(
        "http",
        f"{where.url} refused with {response.status_code}: {' '.join(said.split())[:200] or 'no reason given'}.",
        hint=hint.get(response.status_code, ""),
        detail={"status": response.status_code},
    )


def _wait(response: Any, tried: int) -> float:
    """Seconds until the next try: what the server asks for, else ever longer."""
    try:
        asked = float(response.headers.get("retry-after", ""))
    except ValueError:
        asked = BACKOFF_S * 2**tried
    return min(max(asked, 0.0), LONGEST_WAIT_S)


def _sleep(ctx: ToolContext, seconds: float) -> None:
    end = time.monotonic() + seconds
    while (left := end - time.monotonic()) > 0:
        ctx.raise_if_cancelled()
        time.sleep(min(left, 0.1))
