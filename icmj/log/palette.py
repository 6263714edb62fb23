"""Colours of the replay: the palette of Okabe and Ito, told apart with any colour vision, on a dark ground."""

from __future__ import annotations

Colour = tuple[int, int, int, int]

ORANGE: Colour = (230, 159, 0, 255)
SKY: Colour = (86, 180, 233, 255)
GREEN: Colour = (0, 158, 115, 255)
YELLOW: Colour = (240, 228, 66, 255)
BLUE: Colour = (0, 114, 178, 255)
VERMILION: Colour = (213, 94, 0, 255)
PURPLE: Colour = (204, 121, 167, 255)
WHITE: Colour = (240, 240, 240, 255)
GREY: Colour = (130, 130, 130, 255)

CONTINUOUS = GREY
PREDICTED = WHITE
EVENT = YELLOW
E = SKY
RUNNING = GREY
CRITICAL = ORANGE
OTHER_MODES: Colour = (95, 110, 120, 255)

_CYCLE = (SKY, ORANGE, GREEN, PURPLE, VERMILION, YELLOW, BLUE, WHITE)


def series(count: int) -> tuple[Colour, ...]:
    """Colours of ``count`` series; they repeat after eight."""
    return tuple(_CYCLE[i % len(_CYCLE)] for i in range(count))


def dim(colour: Colour) -> Colour:
    """The same hue, held back towards the dark ground: a prediction under its measurement, the approach to a cycle."""
    r, g, b, a = colour
    return (r * 2 // 5 + 12, g * 2 // 5 + 12, b * 2 // 5 + 12, a)


def bright(colour: Colour) -> Colour:
    """The same hue towards white: what acts, over the command that it is made of."""
    r, g, b, a = colour
    return ((r + 255) // 2, (g + 255) // 2, (b + 255) // 2, a)
