"""The YAML and JSON traps: what a lenient parser would guess at is an error with its line."""

import os

import pytest

from gap_runtime.contracts.documents import (
    MAX_BYTES,
    MAX_YAML,
    ambiguous,
    check_text,
    parse_json,
    parse_yaml,
    read_json,
    read_yaml,
)
from gap_runtime.contracts.failures import DocumentError


@pytest.mark.parametrize(
    ("text", "data"),
    [
        ("", None),
        ("a: 1\nb: [1.5, -2, true, null, text]", {"a": 1, "b": [1.5, -2, True, None, "text"]}),
        ("x: 1\ny: 2\nn: 3", {"x": 1, "y": 2, "n": 3}),
        ('a: "no"\nb: \'12:30\'\nc: "010"', {"a": "no", "b": "12:30", "c": "010"}),
        ("a: 1.0e-3", {"a": 0.001}),
        ("a: |\n  two\n  lines\n", {"a": "two\nlines\n"}),
        ("a: größe 😀", {"a": "größe 😀"}),
        ("a: b # c\r\n", {"a": "b"}),
        ("---\na: 1\n...\n", {"a": 1}),
        ('a: "tab\\tand\\nline"', {"a": "tab\tand\nline"}),
        ("a: -0", {"a": 0}),
    ],
)
def test_plain_yaml_is_read(text, data):
    assert parse_yaml(text, "f") == data


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a: 1\na: 2", "f:2: key 'a' appears twice"),
        ("a: {b: 1, b: 2}", "key 'b' appears twice"),
        ("a: 1\nb: no", "f:2: no could mean"),
        ("a: On", "On could mean"),
        ("a: [y]", "y could mean"),
        ("on: 1", "key 'on' is not text"),
        ("1: a", "key '1' is not text"),
        ("null: a", "is not text"),
        ("? [a]\n: 1", "is not text"),
        ("? {a: 1}\n: 1", "is not text"),
        ("<<: {a: 1}", "is not text"),
        ("a: 12:30:45", "read as a time"),
        ("a: 1:30.5", "read as a time"),
        ("a: 2024-01-31", "read as a time"),
        ("a: 2024-01-31T12:00:00Z", "read as a time"),
        ("a: 010", "not a decimal"),
        ("a: 0x1F", "not a decimal"),
        ("a: 0b11", "not a decimal"),
        ("a: 1_000", "not a decimal"),
        ("a: 1_0.5", "not a finite decimal"),
        ("a: 1e3", "read as text"),
        ("a: -2.5E7", "read as text"),
        ("a: .inf", "not a finite"),
        ("a: -.Inf", "not a finite"),
        ("a: .NaN", "not a finite"),
        ("a: 1.0e+999", "not a finite"),
        ("a: 9223372036854775808", "64 bits"),
        ("a: " + "9" * 5000, "64 bits"),
        ("a: &x 1\nb: 2", "f:1: uses an anchor"),
        ("a: *x", "uses an anchor"),
        ("a: &x [*x]", "uses an anchor"),
        ("a: !!python/object/apply:os.system [ls]", "uses the tag"),
        ("a: !mine 1", "uses the tag !mine"),
        ("a: !!binary aGk=", "uses the tag"),
        ("!!set {a}", "uses the tag"),
        ("a: =", "not YAML"),
        ("a: 1\nb:\t- 1\n\tc: 2", "Indent with spaces"),
        ("a: b: c", "f:1: is not YAML"),
        ("a: [1", "not YAML"),
        ("a: 1\n---\nb: 2", "another document"),
        ("%YAML 3.0\n---\na: 1", "not YAML"),
        ("[" * 100, "deeper than"),
        ("- " * 100 + "a", "deeper than"),
        ("{a: " * 100, "deeper than"),
        ("a: x\0y", "U+0000"),
        ("a: 1\nb: x\u202ey", "f:2: holds the invisible character U+202E"),
        ("a: x\u200by", "U+200B"),
        ("\ufeffa: 1", "U+FEFF"),
        ("a: x\U000e0041y", "U+E0041"),
        ("a: x\u2028y", "U+2028"),
        ('a: "\\x1b[2J"', "U+001B"),
        ('a: "\\u202e"', "U+202E"),
        ('a: "\\0"', "U+0000"),
        ('"a\\u200b": 1', "U+200B"),
        ("a: 1\n" * (MAX_YAML // 5 + 1), "longer than"),
    ],
    ids=lambda v: repr(v)[:40],
)
def test_a_trap_in_yaml_is_an_error(text, said):
    with pytest.raises(DocumentError) as caught:
        parse_yaml(text, "f")
    assert said in str(caught.value)


@pytest.mark.parametrize(
    ("text", "data"),
    [
        ("[1, 2.5, -0]", [1, 2.5, 0]),
        ('{"a": {"b": null}}', {"a": {"b": None}}),
        ('"\\ud83d\\ude00"', "😀"),
        ("1e3", 1000.0),
    ],
)
def test_plain_json_is_read(text, data):
    assert parse_json(text, "f") == data


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "f:1: is not JSON"),
        ("{'a': 1}", "is not JSON"),
        ('{"a": 1,}', "is not JSON"),
        ("[1] // no", "is not JSON"),
        ("{}\n\n{}", "f:3: is not JSON"),
        ('{"a": 1, "b": {"a": 1, "a": 2}}', "key 'a' appears twice"),
        ("[NaN]", "NaN is not a finite"),
        ("[-Infinity]", "-Infinity is not a finite"),
        ("1e999", "1e999 is not a finite"),
        ("[9223372036854775808]", "64 bits"),
        ("-" + "1" * 5000, "64 bits"),
        ('"\\ud800"', "surrogate"),
        ('{"\\udc00": 1}', "surrogate"),
        ("[" * 65 + "]" * 65, "deeper than"),
        ('{"a":' * 1000 + "1" + "}" * 1000, ""),
        ("[" * 100_000, "not JSON"),
        ("\ufeff{}", "is not JSON"),
        ("nul", "is not JSON"),
        ('"a\nb"', "is not JSON"),
    ],
    ids=lambda v: repr(v)[:40],
)
def test_a_trap_in_json_is_an_error(text, said):
    with pytest.raises(DocumentError) as caught:
        parse_json(text, "f")
    assert said in str(caught.value)


def test_a_file_is_named_with_the_line_that_is_not_utf8(tmp_path):
    path = tmp_path / "task.yaml"
    path.write_bytes(b"a: 1\nb: \xff\n")
    with pytest.raises(DocumentError, match=r"task.yaml:2: is not UTF-8"):
        read_yaml(path)


@pytest.mark.parametrize("text", ["a: 1".encode("utf-16"), "a: größe".encode("latin-1")])
def test_other_encodings_are_refused(tmp_path, text):
    path = tmp_path / "x.yaml"
    path.write_bytes(text)
    with pytest.raises(DocumentError):
        read_yaml(path)


def test_a_byte_order_mark_is_harmless(tmp_path):
    path = tmp_path / "x.yaml"
    path.write_bytes(b"\xef\xbb\xbfa: 1")
    assert read_yaml(path) == {"a": 1}


def test_what_is_not_a_readable_file_is_said_to_be_so(tmp_path):
    fifo = tmp_path / "fifo"
    os.mkfifo(fifo)
    loop = tmp_path / "loop"
    loop.symlink_to(loop)
    big = tmp_path / "big.json"
    with big.open("wb") as file:
        file.truncate(MAX_BYTES + 1)
    for path, said in [
        (tmp_path, "not a file"),
        (fifo, "not a file"),
        (loop, "no such file"),
        (tmp_path / "none", "no such file"),
        (tmp_path / ("x" * 300), "cannot be read"),
        (tmp_path / "x\0y", "no such file"),
        (big, "larger than"),
    ]:
        with pytest.raises(DocumentError, match=said):
            read_json(path)


def test_text_that_a_reviewer_can_see_is_left_alone():
    text = "größe — “quoted” 😀 \t\r\n日本語"
    assert check_text(text, "f") == text


@pytest.mark.parametrize("word", ["yes", "NO", "y", "1e5", "12:30", "-1.5e3"])
def test_words_that_need_quotes_are_known(word):
    assert ambiguous(word)
    with pytest.raises(DocumentError):
        parse_yaml(f"a: {word}", "f")
    assert parse_yaml(f'a: "{word}"', "f") == {"a": word}


@pytest.mark.parametrize("word", ["soup", "1.5", "none", "e5", "a:b"])
def test_other_words_need_none(word):
    assert not ambiguous(word)
    parse_yaml(f"a: {word}", "f")
