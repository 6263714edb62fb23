"""Figures as elements of one page, in which outlines of letters, words, marks, clips and styles stand once.

Lengths are whole tenths of a point, and paths go from point to point. The figures of eleven cases have a fifth of the
bytes of their files, and need no script.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import groupby
from typing import NamedTuple
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from markupsafe import Markup, escape

TENTHS = 10.0  # of a point

_SVG, _LINK = "{http://www.w3.org/2000/svg}", "{http://www.w3.org/1999/xlink}href"
_UNSEEN = tuple(_SVG + tag for tag in ("metadata", "style", "defs"))
_EM = 64  # units of an outline of a letter in one of the drawing of its word
_SERIES = 4  # marks alike that are written as one path
_NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e-?\d+)?")
_COMMAND = re.compile(r"([A-Za-z])([^A-Za-z]*)")
_LENGTHS = re.compile(r"(?<=stroke-width:)[^;]*|(?<=stroke-dasharray:)[^;]*|(?<=stroke-dashoffset:)[^;]*")
_STEP = re.compile(r"(\w+)\(([^)]*)\) ?")
_WORD = re.compile(r'(?P<style>.*) transform="(?P<place>.*)(?P<scale>scale\([^)]*\))"')
_MOVED = re.compile(r' transform="translate\((-?\d+) (-?\d+)\)"')
_REFERENCE = re.compile(r"url\(#([^)]*)\)")
_ROOT = "stroke-width:10;stroke-linejoin:round"  # a point, which is what SVG has for none; what matplotlib has for all
_MARKER = '<marker markerUnits="userSpaceOnUse" markerWidth="1" markerHeight="1" overflow="visible">'


class SharedVectors:
    """Figures of one page, each an element, and the element of what they share."""

    def __init__(self) -> None:
        self._parts: dict[str, str] = {}
        self._styles: dict[str, str] = {}
        self._outlines: dict[tuple[str, float], str] = {}

    def take(self, svg: bytes, words: str) -> Markup:
        """The element of a figure that matplotlib wrote, letters as paths; ``words`` are its alternative text."""
        root = ElementTree.fromstring(svg)
        defined = {str(one.get("id")): one for group in root.iter(f"{_SVG}defs") for one in group}
        inside = _Writer(self, defined).write(root)
        head = '<svg class="drawn" role="img" aria-label="{}" viewBox="{}">{}</svg>'
        return Markup(head).format(words, _count_tenths(root.get("viewBox", "")), Markup(inside))

    def share(self) -> Markup:
        """The element of what the figures share, which takes no place; nothing without figures."""
        if not self._parts:
            return Markup("")
        rules = "".join(f".{name}{{{style}}}" for style, name in self._styles.items())
        parts = "".join(re.sub(r"^<\w+", rf'\g<0> id="{name}"', part) for part, name in self._parts.items())
        head = '<svg class="drawn" id="_" width="0" height="0"><style>'
        return Markup(f"{head}.drawn{{{_ROOT}}}{rules}</style><defs>{parts}</defs></svg>")

    def shorten_outline(self, path: str, scale: float) -> str:
        """The short path of a letter or a mark, which come again and again."""
        if (path, scale) not in self._outlines:
            self._outlines[path, scale] = shorten_path(path, scale)
        return self._outlines[path, scale]

    def name_part(self, part: str) -> str:
        """The id of an element that figures use."""
        return self._parts.setdefault(part, f"_{len(self._parts):x}")

    def name_style(self, style: str) -> str:
        """The class of a style."""
        return self._styles.setdefault(style, f"_{len(self._styles):x}")


class _Piece(NamedTuple):
    """A stroke or a mark, which may go on in the next of the same attributes, or anything else that is written."""

    kind: str
    given: str
    text: str


class _Writer:
    """Writes one figure; ``defined`` are its definitions by their names."""

    def __init__(self, shared: SharedVectors, defined: dict[str, Element]) -> None:
        self.shared, self.defined = shared, defined

    def write(self, parent: Element) -> str:
        """What is seen of the elements in another."""
        written = []
        for (kind, given), group in groupby(self._list_pieces(parent), key=lambda piece: piece[:2]):
            texts = [piece.text for piece in group]
            if kind == "stroke":
                written.append(f'<path d="{shorten_path(" ".join(texts))}"{given}/>')
            elif kind == "mark":
                written.append(self._write_marks(texts, given))
            else:
                written += texts
        return "".join(written)

    def _list_pieces(self, parent: Element) -> Iterator[_Piece]:
        for element in parent:
            tag = element.tag.removeprefix(_SVG)
            if element.tag in _UNSEEN or (tag == "path" and not element.get("d")):
                continue
            given = self._write_attributes(element)
            if tag == "path":
                d, style = str(element.get("d")), element.get("style", "")
                if "fill: none" in style and "opacity" not in style:
                    yield _Piece("stroke", given, d)
                else:
                    yield _Piece("", "", f'<path d="{shorten_path(d)}"{given}/>')
            elif tag == "use":
                yield from self._use(element, given)
            elif tag != "g":
                yield _Piece("", "", f"<{tag}{given}>{self.write(element)}</{tag}>")
            elif not given:
                yield from self._list_pieces(element)
            elif inside := self.write(element):
                yield _Piece("", "", self._write_group(inside, given))

    def _use(self, element: Element, given: str) -> Iterator[_Piece]:
        """A letter, or a mark of a curve or an axis."""
        outline = self.defined[str(element.get(_LINK)).removeprefix("#")]
        if not (path := outline.get("d", "")):
            return  # a space
        letter = "transform" in outline.attrib  # in units of its own
        shape = self.shared.shorten_outline(path, TENTHS / _EM if letter else TENTHS)
        style = "" if letter else self._write_attributes(outline)
        name = self.shared.name_part(f'<path d="{shape}"{style}/>')
        reference = f' href="#{name}"{given}'
        if letter:
            yield _Piece("", "", f"<use{_shorten_place(reference)}/>")
        else:
            yield _Piece("mark", reference, f"{element.get('x', '0')} {element.get('y', '0')}")

    def _write_marks(self, places: list[str], given: str) -> str:
        """Marks alike: a few one by one, more as the corners of a path, which itself is not drawn."""
        if len(places) < _SERIES:
            at = (_count_tenths(place).split() for place in places)
            return "".join(f'<use{given} x="{x}" y="{y}"/>' for x, y in at)
        marker = self.shared.name_part(f"{_MARKER}<use{given}/></marker>")
        style = self._write_class(f"fill: none; marker: url(#{marker})")
        return f'<path d="{shorten_path("M" + "L".join(places))}"{style}/>'

    def _write_group(self, inside: str, given: str) -> str:
        """A group; a word, which has a scale of its own, is a part that others have at other places."""
        word = _WORD.fullmatch(given)
        if word is None:
            return f"<g{given}>{inside}</g>"
        name = self.shared.name_part(f'<g transform="{word["scale"]}">{inside}</g>')
        place = f' transform="{word["place"]}"' if word["place"] else ""
        return f'<use href="#{name}"{word["style"]}{_shorten_place(place)}/>'

    def _write_attributes(self, element: Element) -> str:
        """Attributes in tenths of a point; style and clip are a class."""
        style, written = [], ""
        for name, value in element.attrib.items():
            if name == "style":
                style.append(value)
            elif name == "clip-path":
                style.append(f"{name}: {value}")
            elif name == "transform":
                written += f' transform="{_STEP.sub(_shorten_step, value)}"'
            elif name in ("x", "y", "width", "height"):
                written += "" if element.tag == f"{_SVG}use" else f' {name}="{_count_tenths(value)}"'
            elif name not in ("id", "d", _LINK):
                written += f' {name}="{escape(value)}"'
        if element.tag == f"{_SVG}image":
            written += f' href="{escape(element.get(_LINK, ""))}"'
        return self._write_class("; ".join(style)) + written

    def _write_class(self, style: str) -> str:
        found = _REFERENCE.sub(lambda named: f"url(#{self._name_definition(named[1])})", style)
        found = _LENGTHS.sub(lambda lengths: _scale(lengths[0]), re.sub(r"\s*([:;])\s*", r"\1", found))
        return f' class="{self.shared.name_style(found)}"' if found else ""

    def _name_definition(self, name: str) -> str:
        """The id of a clip or a pattern in the page; what is of the page has it already."""
        if name not in self.defined:
            return name
        element = self.defined[name]
        tag = element.tag.removeprefix(_SVG)
        return self.shared.name_part(f"<{tag}{self._write_attributes(element)}>{self.write(element)}</{tag}>")


def shorten_path(path: str, scale: float = TENTHS) -> str:
    """A path of absolute commands M, L, Q, C and z as one of whole steps from point to point.

    Each point is rounded by itself, so that errors do not add up: on a figure it moves by 0.05 points along each axis
    at most, a tenth of a pixel of the page.
    """
    found, last, before, first = "", [0, 0], "", [0, 0]
    for command, numbers in _COMMAND.findall(path):
        points = [round(scale * float(number)) for number in numbers.split()]
        steps = [point - last[i % 2] for i, point in enumerate(points)]
        name, last = command.lower(), points[-2:] or first
        first = last if name == "m" else first
        if name == "l" and 0 in steps:
            name, steps = ("v", steps[1:]) if steps[0] == 0 else ("h", steps[:1])
        text = "".join(f" {step}" if step >= 0 else str(step) for step in steps)
        goes_on = (before, name) == ("m", "l") or name == before != "m"  # then the letter may be left out
        found += text if goes_on else name + text.removeprefix(" ")
        before = name
    return found


def _shorten_place(given: str) -> str:
    """Attributes of a use: where it is only moved, its place says so in fewer letters."""
    return _MOVED.sub(r' x="\1" y="\2"', given).replace(' y="0"', "")


def _count_tenths(text: str) -> str:
    """Lengths in whole tenths of a point."""
    return _NUMBER.sub(lambda number: str(round(TENTHS * float(number[0]))), text)


def _scale(text: str) -> str:
    return _NUMBER.sub(lambda number: f"{TENTHS * float(number[0]):.3g}", text)


def _shorten_step(step: re.Match[str]) -> str:
    """A step of a transformation: lengths in tenths of a point, others to four digits."""
    if step[1] == "translate":
        return f"translate({_count_tenths(step[2])})"
    return f"{step[1]}({_NUMBER.sub(lambda number: f'{float(number[0]):.4g}', step[2])})"
