"""JSON, and JSON5 where a message is not plain JSON.

References
----------
.. [1] *The JSON5 Data Interchange Format*, version 1.0.0, https://spec.json5.org
"""

import json
import re
from typing import Any

_TOKEN = re.compile(
    r"""
      (?P<blank>\s+|//[^\n\r]*|/\*.*?\*/)
    | (?P<text>"(?:[^"\\]|\\.)*"|'(?:[^'\\]|\\.)*')
    | (?P<number>[+-]?(?:0[xX][0-9a-fA-F]+|Infinity|NaN
                        |(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)(?![\w$.]))
    | (?P<name>[^\W\d][\w$]*|\$[\w$]*)
    | (?P<mark>[{}\[\]:,])
    """,
    re.VERBOSE | re.DOTALL,
)
_OPENING: tuple[list[str], ...] = ([], ['{'], ['['], [','])  # no comma may follow these
_KEY = re.compile(r'\s*:')
_ESCAPE = re.compile(r'\\(?:x([0-9a-fA-F]{2})|(\r\n|.))|(")|([\x00-\x1f])', re.DOTALL)
_KEPT = 'bfnrtu"\\/'  # escapes that JSON has too


def loads(message: bytes) -> Any:
    """Return what a message in JSON or JSON5 says; NaN and Infinity are numbers.

    Raises
    ------
    ValueError
        If it is neither.
    RecursionError
        If it is nested too deeply.
    """
    text = message.decode('utf-8')
    try:
        return json.loads(text)
    except json.JSONDecodeError:
        return json.loads(_as_json(text))


def _as_json(text: str) -> str:
    """Return the same in JSON (with NaN and Infinity, which Python's reader takes)."""
    parts: list[str] = []
    at = 0
    while at < len(text):
        token = _TOKEN.match(text, at)
        if token is None:
            raise ValueError(f'character {at}: {text[at : at + 10]!r} is no JSON5')
        at = token.end()
        value = token.group()
        if token.lastgroup == 'text':
            parts.append(f'"{_ESCAPE.sub(_escaped, value[1:-1])}"')
        elif token.lastgroup == 'mark':
            if value in '}]' and parts[-1:] == [','] and parts[-2:-1] not in _OPENING:
                parts.pop()
            parts.append(value)
        elif token.lastgroup in ('name', 'number') and _KEY.match(text, at):
            parts.append(f'"{value}"')
        elif token.lastgroup != 'blank':
            parts.append(_number(value) if token.lastgroup == 'number' else value)
    return ' '.join(parts)


def _number(text: str) -> str:
    sign = '-' if text[0] == '-' else ''
    digits = text.lstrip('+-')
    if digits in ('Infinity', 'NaN'):
        return sign + digits if digits == 'Infinity' else digits
    if digits[:2] in ('0x', '0X'):
        return f'{sign}{int(digits, 16)}'
    if digits.isdecimal():
        return f'{sign}{int(digits)}'
    return f'{sign}{float(digits)!r}'


def _escaped(found: re.Match[str]) -> str:
    code, letter, quote, control = found.groups()
    if code:
        return f'\\u00{code}'
    if quote:
        return '\\"'
    if control:
        return f'\\u{ord(control):04x}'
    if letter in ('\n', '\r', '\r\n', '\u2028', '\u2029'):  # the line goes on
        return ''
    if letter in ('v', '0'):
        return '\\u000b' if letter == 'v' else '\\u0000'
    return f'\\{letter}' if letter in _KEPT else letter
