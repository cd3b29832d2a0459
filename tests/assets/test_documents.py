import time

import pytest

from assets.documents import DocumentError, parse_json, parse_yaml


def test_plain_documents_and_modest_aliases_are_read():
    text = "a: &x [1, 2.5, yes, null, text]\nb: *x\nc: {d: 2020-01-02}\n"
    document = parse_yaml(text)
    assert document["a"] == document["b"] == [1, 2.5, True, None, "text"]
    assert parse_yaml("") is None and parse_yaml("3") == 3
    assert parse_json('{"a": [1, null]}') == {"a": [1, None]}


@pytest.mark.parametrize(
    "text",
    [
        "a: [1",
        "!!python/object/apply:os.system [echo]",
        "&a [*a]",
        "[" * 5000,
        "- " * 5000 + "x",
        "a: 2020-13-45",
        "? [1]\n: 2\n? {a: 1}\n: 2",
        "a: !!int x",
        "a: !!float []",
        "a: \x00",
        "--- 1\n--- 2",
        "<<: 3",
    ],
)
def test_what_is_no_plain_yaml_gets_one_line(text):
    with pytest.raises(DocumentError) as caught:
        parse_yaml(text)
    assert "\n" not in str(caught.value)


def test_aliases_that_multiply_are_refused_at_once():
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]" for n in range(1, 20)]
    started = time.monotonic()
    with pytest.raises(DocumentError, match="more than 1,000,000 values"):
        parse_yaml("\n".join(lines))
    assert time.monotonic() - started < 10


@pytest.mark.parametrize("text", ["", "{", "[" * 100_000, '{"a": }', "nul"])
def test_what_is_no_json_gets_one_line(text):
    with pytest.raises(DocumentError) as caught:
        parse_json(text)
    assert "\n" not in str(caught.value)
